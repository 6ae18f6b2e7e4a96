"""Pictures with a chart before books, tiles, keys and windows, for the finder; not of `camssf_lab.simulation`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.photo.find.chart_colours import chart_colours
from camssf.photo.find.geometry import block_corners, map_points
from camssf.photo.read.dng import Mosaic
from camssf.spectra.layouts import LAYOUTS

BLACK, WHITE = 512.0, 16383.0
CAMERA = np.array([[0.75, 0.18, 0.02], [0.22, 0.70, 0.20], [0.03, 0.12, 0.78]])
"""A camera whose filters see more of each other's light than the plain one's, by which the finder knows a chart."""


@dataclass(frozen=True)
class Drawing:
    """What is drawn; lengths in picture widths, angles in degrees.

    Attributes:
        name: in tables.
        chart: key of LAYOUTS, or "" for none.
        fill: width of the block of patches.
        turn, tilt, lean: in the picture's plane, about its upright axis, about its level one.
        middle: of the chart, shares of width and height.
        stops: exposure; 0 puts white at 60 % of full scale.
        cast: gains of red, green and blue.
        blur: Gaussian, px of the mosaic.
        noise: of white, as a share.
        shade: light left in the shaded part, 1 for none; its edge runs through the chart.
        behind: "plain", "books", "tiles", "keys", "window", "text", "checks" or "swatches".
        mirrored: left and right exchanged.
        seed: of clutter and noise.
        size: px.
    """

    name: str
    chart: str = "classic24"
    fill: float = 0.5
    turn: float = 0.0
    tilt: float = 0.0
    lean: float = 0.0
    middle: tuple[float, float] = (0.5, 0.5)
    stops: float = 0.0
    cast: tuple[float, float, float] = (1.0, 1.0, 1.0)
    blur: float = 1.0
    noise: float = 0.01
    shade: float = 1.0
    behind: str = "plain"
    mirrored: bool = False
    seed: int = 0
    size: tuple[int, int] = (1600, 1200)


def truth(drawing: Drawing) -> tuple[Floats, Floats]:
    """Corners (4, 2) and patch centres (n, 2), px."""
    layout = LAYOUTS[drawing.chart]
    index = np.arange(layout.columns * layout.rows)
    centres = np.stack([index % layout.columns, index // layout.columns], axis=1).astype(np.float64)
    to_picture = _plane(drawing)
    return map_points(to_picture, block_corners(layout, layout.side)), map_points(to_picture, centres)


def _plane(drawing: Drawing) -> Floats:
    """Homography from pitches to px: a pinhole of one picture width's focal length."""
    layout = LAYOUTS[drawing.chart]
    width, height = drawing.size
    pitch = drawing.fill * width / (layout.columns - 1 + layout.side[0])
    t, a, b = (np.deg2rad(x) for x in (drawing.turn, drawing.tilt, drawing.lean))
    turn = np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]])
    upright = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    level = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    flip = -pitch if drawing.mirrored else pitch
    to_plane = np.array(
        [[flip, 0, -flip * (layout.columns - 1) / 2], [0, pitch, -pitch * (layout.rows - 1) / 2], [0, 0, 0]]
    )
    placed = level @ upright @ turn @ to_plane
    placed[2, 2] += width
    lens = np.array(
        [[width, 0, drawing.middle[0] * width - 0.5], [0, width, drawing.middle[1] * height - 0.5], [0, 0, 1.0]]
    )
    return np.asarray(lens @ placed)


def light(drawing: Drawing) -> NDArray[np.float32]:
    """(h, w, 3) linear, white at 1, before exposure, cast and noise."""
    rng = np.random.default_rng(drawing.seed)
    width, height = drawing.size
    picture = _behind(drawing, rng)
    if drawing.chart:
        _put(drawing, picture)
    if drawing.shade < 1:
        y, x = np.mgrid[:height, :width].astype(np.float32)
        angle = rng.uniform(0, 2 * np.pi)
        across = np.cos(angle) * (x - drawing.middle[0] * width) + np.sin(angle) * (y - drawing.middle[1] * height)
        part = 1 / (1 + np.exp(-across / (0.008 * width)))
        picture *= (drawing.shade + (1 - drawing.shade) * part)[:, :, None]
    return picture


def _put(drawing: Drawing, picture: NDArray[np.float32]) -> None:
    """The chart, four samples a pixel: patches of 0.88 pitch or less in a black frame, that in a grey holder."""
    layout = LAYOUTS[drawing.chart]
    height, width = picture.shape[:2]
    colours = {kind.name: kind.colours for kind in chart_colours()}[
        "sg140" if layout.columns == 14 else "classic24"
    ] @ CAMERA
    back = np.linalg.inv(_plane(drawing))
    corners = truth(drawing)[0]
    middle = corners.mean(axis=0)
    wide = middle + 1.5 * (corners - middle)
    left, top = np.maximum(wide.min(axis=0).astype(int) - 4, 0)
    right, bottom = np.minimum(wide.max(axis=0).astype(int) + 5, (width, height))
    total = np.zeros((bottom - top, right - left, 3), dtype=np.float32)
    plain = picture[top:bottom, left:right]
    for dy in (-0.25, 0.25):
        for dx in (-0.25, 0.25):
            y, x = np.mgrid[top:bottom, left:right].astype(np.float64)
            x, y = x + dx, y + dy
            depth = back[2, 0] * x + back[2, 1] * y + back[2, 2]
            u = (back[0, 0] * x + back[0, 1] * y + back[0, 2]) / depth
            v = (back[1, 0] * x + back[1, 1] * y + back[1, 2]) / depth
            i = np.clip(np.rint(u), 0, layout.columns - 1).astype(int)
            j = np.clip(np.rint(v), 0, layout.rows - 1).astype(int)
            patch = (np.abs(u - i) < layout.side[0] / 2) & (np.abs(v - j) < layout.side[1] / 2)
            out = np.maximum(
                np.maximum(-0.5 - u, u - layout.columns + 0.5), np.maximum(-0.5 - v, v - layout.rows + 0.5)
            )
            part = np.where((out < 0.25)[:, :, None], np.float32(0.035), plain)
            part = np.where(((out >= 0.25) & (out < 0.4))[:, :, None], np.float32(0.3), part)
            total += np.where(patch[:, :, None], colours[j * layout.columns + i], part).astype(np.float32)
    picture[top:bottom, left:right] = total / 4


def _behind(drawing: Drawing, rng: np.random.Generator) -> NDArray[np.float32]:
    width, height = drawing.size
    picture = np.full((height, width, 3), 0.18, dtype=np.float32)
    colour = lambda n: rng.uniform(0.03, 0.8, (n, 3)).astype(np.float32)  # noqa: E731
    if drawing.behind == "books":
        for top in range(0, height, height // 3):
            x = 0
            while x < width:
                w = int(rng.uniform(0.02, 0.06) * width)
                picture[top : top + height // 3 - 12, x : x + w] = colour(1)
                for _ in range(int(rng.integers(2, 9))):  # a title of small marks
                    y0 = top + int(rng.uniform(0.1, 0.8) * height / 3)
                    picture[y0 : y0 + 8, x + w // 4 : x + 3 * w // 4] = colour(1)
                picture[top : top + height // 3, x + w - 2 : x + w + 1] = 0.02
                x += w + 1
            picture[top + height // 3 - 12 : top + height // 3] = 0.3
    elif drawing.behind in ("tiles", "keys", "window", "checks", "swatches"):
        step = {"tiles": 0.08, "keys": 0.035, "window": 0.22, "checks": 0.06, "swatches": 0.07}[drawing.behind]
        pitch = int(step * width)
        gap = {"tiles": 0.1, "keys": 0.2, "window": 0.15, "checks": 0.0, "swatches": 0.12}[drawing.behind]
        flat = colour(1)[0]
        for row, y0 in enumerate(range(0, height, pitch)):
            for column, x0 in enumerate(range(0, width, pitch)):
                one = {
                    "tiles": flat * rng.uniform(0.9, 1.1),
                    "keys": np.float32(rng.uniform(0.06, 0.1)),
                    "window": np.float32(0.9) * rng.uniform(0.8, 1.0, 3),
                    "checks": np.float32(0.75 if (row + column) % 2 else 0.05),
                    "swatches": colour(1)[0],
                }[drawing.behind]
                picture[y0 : y0 + pitch, x0 : x0 + pitch] = 0.02 if drawing.behind != "tiles" else 0.25
                edge = int(gap * pitch)
                picture[y0 : y0 + pitch - edge, x0 : x0 + pitch - edge] = one
    elif drawing.behind == "text":
        picture[:] = 0.8
        for y0 in range(10, height - 20, 26):
            x0 = 20
            while x0 < width - 40:
                w = int(rng.integers(4, 14))
                if rng.random() > 0.2:
                    picture[y0 : y0 + 14, x0 : x0 + w] = 0.05
                x0 += w + 4
    return picture


def as_mosaic(drawing: Drawing) -> Mosaic:
    """Drawing → 14-bit RGGB mosaic."""
    import cv2

    rng = np.random.default_rng(drawing.seed + 1000)
    picture = light(drawing)
    if drawing.blur > 0:
        picture = cv2.GaussianBlur(picture, (0, 0), drawing.blur).astype(np.float32)
    picture *= np.array(drawing.cast, dtype=np.float32) * np.float32(0.6 * 2**drawing.stops)
    plane = np.empty(picture.shape[:2])
    plane[::2, ::2], plane[1::2, 1::2] = picture[::2, ::2, 0], picture[1::2, 1::2, 2]
    plane[::2, 1::2], plane[1::2, ::2] = picture[::2, 1::2, 1], picture[1::2, ::2, 1]
    # Noise of a sensor: of the light's quanta, and of reading.
    plane += rng.normal(size=plane.shape) * np.sqrt(np.maximum(plane, 0) * drawing.noise**2 + 3e-4**2)
    samples = np.clip(np.rint(BLACK + plane * (WHITE - BLACK)), 0, WHITE).astype(np.uint16)
    return Mosaic(
        path=drawing.name, samples=samples, cfa="RGGB", black=np.full((2, 2), BLACK), white=WHITE, make="", model="",
        exposure=0.01, iso=100.0, orientation=1, gain_maps=(), color_matrix1=None, color_matrix2=None,
        as_shot_neutral=None, sha256="",
    )  # fmt: skip


def as_preview(drawing: Drawing) -> NDArray[np.uint8]:
    """Drawing → (h, w, 3) 8 bits as on a display, its noise that of a phone's preview."""
    import cv2

    rng = np.random.default_rng(drawing.seed + 2000)
    picture = light(drawing)
    if drawing.blur > 0:
        picture = cv2.GaussianBlur(picture, (0, 0), drawing.blur).astype(np.float32)
    picture *= np.array(drawing.cast, dtype=np.float32) * np.float32(0.8 * 2**drawing.stops)
    shown = np.clip(picture, 0, 1) ** (1 / 2.2) + rng.normal(size=picture.shape) * 0.012
    return np.clip(np.rint(255 * shown), 0, 255).astype(np.uint8)


COVERS = ("books", "tiles", "keys", "window", "text", "checks", "swatches")

DRAWINGS: tuple[Drawing, ...] = (
    *(Drawing(f"{100 * fill:.0f} % wide, {behind}", fill=fill, behind=behind, turn=7 + 10 * i, seed=i)
      for i, (fill, behind) in enumerate(
          [(0.10, "plain"), (0.10, "books"), (0.12, "tiles"), (0.15, "keys"), (0.2, "window"), (0.3, "text"),
           (0.4, "checks"), (0.5, "swatches")])),
    *(Drawing(f"{100 * fill:.0f} % wide", fill=fill, turn=turn, seed=10 + i)
      for i, (fill, turn) in enumerate([(0.7, 0), (0.8, 180), (0.9, 2), (0.9, 180)])),
    *(Drawing(f"tilt {tilt}, lean {lean}, turn {turn}", tilt=tilt, lean=lean, turn=turn, fill=0.45, seed=20 + i,
              behind=COVERS[i % 7])
      for i, (tilt, lean, turn) in enumerate(
          [(55, 0, 0), (-55, 0, 90), (0, 55, 0), (0, -55, 45), (40, 35, 20), (50, 0, 200), (-45, 30, 300)])),
    *(Drawing(f"{stops:+d} EV, {behind}", stops=stops, behind=behind, turn=33 * i, fill=0.4, seed=30 + i)
      for i, (stops, behind) in enumerate(
          [(-2, "books"), (-3, "tiles"), (-4, "plain"), (-4, "books"), (-4, "swatches"), (-4, "checks")])),
    *(Drawing(f"cast {cast}, {behind}", cast=cast, behind=behind, turn=25 * i, fill=0.35, seed=40 + i)
      for i, (cast, behind) in enumerate(
          [((1, 0.6, 0.15), "books"), ((0.15, 0.5, 1), "tiles"), ((0.4, 1, 0.3), "swatches"),
           ((1, 0.35, 0.35), "text"), ((0.9, 0.4, 0.05), "keys")])),
    *(Drawing(f"blur {blur:g}, {100 * fill:.0f} % wide", blur=blur, fill=fill, behind=behind, turn=45 * i,
              seed=50 + i)
      for i, (blur, fill, behind) in enumerate(
          [(3, 0.3, "books"), (4, 0.4, "tiles"), (6, 0.6, "books"), (2.5, 0.2, "plain"), (8, 0.9, "plain"),
           (5, 0.4, "swatches")])),
    *(Drawing(f"shade {shade:g}, {behind}", shade=shade, behind=behind, turn=50 * i, fill=0.45, seed=60 + i)
      for i, (shade, behind) in enumerate(
          [(0.5, "plain"), (0.25, "plain"), (0.25, "books"), (0.125, "plain"), (0.35, "swatches"), (0.2, "tiles")])),
    *(Drawing(f"{chart}, {behind}", chart=chart, behind=behind, turn=36 * i, fill=fill, seed=70 + i)
      for i, (chart, behind, fill) in enumerate(
          [("nano24", "books", 0.15), ("mini24", "keys", 0.2), ("passport24", "text", 0.3),
           ("passport24", "swatches", 0.4),
           ("sg140", "books", 0.5), ("sg140", "plain", 0.8), ("sg140", "swatches", 0.6), ("sg140", "plain", 0.4)])),
    Drawing("all at once", fill=0.3, tilt=35, lean=-20, turn=130, stops=-3, cast=(1, 0.6, 0.3), blur=2, shade=0.5,
            behind="books", seed=80),
    Drawing("all at once, small", fill=0.2, tilt=25, lean=15, turn=250, stops=-2, cast=(0.4, 0.7, 1), blur=1.5,
            shade=0.5, behind="tiles", seed=81),
    Drawing("noise 6 %", noise=0.06, fill=0.3, turn=15, behind="books", seed=82),
    Drawing("in a corner", fill=0.25, middle=(0.15, 0.16), behind="swatches", seed=83),
    Drawing("mirrored", fill=0.4, mirrored=True, turn=20, behind="books", seed=84),
    Drawing("mirrored, tilted", fill=0.3, mirrored=True, turn=110, tilt=40, seed=85),
)  # fmt: skip
"""With a whole chart."""

EMPTY: tuple[Drawing, ...] = (
    *(Drawing(f"no chart, {behind}", chart="", behind=behind, seed=90 + i)
      for i, behind in enumerate(("plain", *COVERS, "swatches", "swatches", "books"))),
    Drawing("half out of view", fill=0.6, middle=(0.9, 0.5), seed=110),
    Drawing("sg140, cut off", chart="sg140", fill=0.9, turn=45, seed=111),
)  # fmt: skip
