"""Simulates the light of a scene with a chart on every pixel: geometry, falloff, blur, glare."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.photo.find.geometry import block_corners, map_points, patch_corners
from camssf.photo.find.pose import Pose
from camssf.spectra.layouts import LAYOUTS, ChartLayout
from camssf_lab.simulation.camera import cell, refuse, sites

SURROUNDS = {"white": 0.90, "grey": 0.20, "black": 0.02}
"""Spectrally flat reflectance of the surface on which the chart lies."""

FRAME = 0.04
"""Reflectance of the chart's black frame, which also fills the gaps between the patches."""

FRAME_WIDTH = 0.30
"""Width of the frame around the block of patches, in pitches."""

FOCAL = 1.0
"""Focal length in picture widths (36 mm on a full-frame camera): it sets the perspective of a tilted chart."""

LARGEST = 200_000_000
"""Largest number of pixels of a picture: more than any camera has, and small enough for a computer's memory."""


@dataclass(frozen=True)
class Scene:
    """Geometry and optics of a simulated photo.

    Attributes:
        layout: printed geometry of the chart.
        size: (width, height) of the picture, px.
        fill: width of the block of patches, before rotation and tilt, as a share of the picture's width.
        rotation: rotation of the chart in its plane, degrees clockwise as seen in the picture.
        tilt: rotation of the chart about the picture's vertical axis, degrees; positive moves the right side away.
        centre: position of the chart's centre, as shares of the picture's width and height.
        mirrored: True for a chart seen in a mirror (left and right exchanged before the rotation).
        surround: "white", "grey" or "black".
        vignetting: light lost in the picture's corners, as a share: cos⁴-like, (1 + a r²)⁻².
        blur: standard deviation of the lens' Gaussian blur, px.
        glare: veiling glare in the chart photo only, as a share of the white signal.
    """

    layout: ChartLayout = LAYOUTS["classic24"]
    size: tuple[int, int] = (4000, 3000)
    fill: float = 0.6
    rotation: float = 0.0
    tilt: float = 0.0
    centre: tuple[float, float] = (0.5, 0.5)
    mirrored: bool = False
    surround: str = "grey"
    vignetting: float = 0.0
    blur: float = 0.0
    glare: float = 0.0


@dataclass(frozen=True)
class ChartProjection:
    """The chart as projected onto the sensor, for the changes of the light in `ShotPlan.light`.

    Attributes:
        u, v: (h, w) float32, the pixel's place on the chart in patch pitches; patch (column, row) is centred there.
        reflected: (n, 3) light of every patch, DN above black.
        white: (3,) light of an ideal diffuser, DN above black.
        cfa: colours of the sensor's 2 × 2 cell.
    """

    u: NDArray[np.float32]
    v: NDArray[np.float32]
    reflected: Floats
    white: Floats
    cfa: str


def check_scene(scene: Scene) -> None:
    """Refuse settings out of range.

    Raises:
        InvalidArgument: names the setting.
    """
    width, height = scene.size
    refuse(
        (min(width, height) >= 16 and max(width, height) <= 30000, "size", "16 to 30000 px a side"),
        (width * height <= LARGEST, "size", f"at most {LARGEST // 1_000_000} megapixels"),
        (0 < scene.fill <= 1, "fill", "a share of the picture's width, above 0 and at most 1"),
        (abs(scene.tilt) <= 80, "tilt", "-80 to 80 degrees"),
        (bool(np.isfinite(scene.rotation)), "rotation", "finite, degrees"),
        (scene.surround in SURROUNDS, "surround", f"one of {', '.join(SURROUNDS)}"),
        (0 <= scene.vignetting < 1, "vignetting", "at least 0 and below 1"),
        (0 <= scene.blur <= 100, "blur", "0 to 100 px"),
        (0 <= scene.glare <= 1, "glare", "0 to 1"),
    )


def homography(scene: Scene) -> Floats:
    """(3, 3) map from the chart's plane to pixels.

    The plane's unit is the pitch; the centre of the first patch is (0, 0). Pixels are those of `Pose`.
    """
    layout = scene.layout
    width, height = scene.size
    pitch = scene.fill * width / (layout.columns - 1 + layout.side[0])
    middle = np.array([[1, 0, -(layout.columns - 1) / 2], [0, 1, -(layout.rows - 1) / 2], [0, 0, 1.0]])
    scale = np.diag([-pitch if scene.mirrored else pitch, pitch, 1.0])
    c, s = np.cos(np.deg2rad(scene.rotation)), np.sin(np.deg2rad(scene.rotation))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    c, s, f = np.cos(np.deg2rad(scene.tilt)), np.sin(np.deg2rad(scene.tilt)), FOCAL * width
    project = np.array([[c, 0, 0], [0, 1, 0], [s / f, 0, 1.0]])
    x, y = scene.centre[0] * width - 0.5, scene.centre[1] * height - 0.5
    shift = np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])
    return np.asarray(shift @ project @ turn @ scale @ middle, dtype=np.float64)


def true_pose(scene: Scene) -> Pose:
    """The true pose of the chart in `scene`."""
    layout = scene.layout
    to_pixels = homography(scene)
    patches = patch_corners(to_pixels, layout, layout.side)
    corners = map_points(to_pixels, block_corners(layout, layout.side))
    turns = round(scene.rotation / 90) % 4
    return Pose(layout.name, corners, patches, turns, "simulated", 1.0, ())


def render_mosaic(scene: Scene, patches: Floats, white: Floats, cfa: str = "RGGB") -> NDArray[np.float32]:
    """The light on every pixel of a colour filter array, without noise.

    Each pixel is mapped back to the chart's plane; borders are anti-aliased by the pixel's own footprint.

    Args:
        scene: geometry, surround, falloff, blur and glare.
        patches: (n, 3) light of each patch in R, G, B, any unit.
        white: (3,) light of an ideal diffuser, in the same unit; frame, surround and glare are shares of it.
        cfa: colours of the 2 × 2 cell at the picture's corner.

    Returns:
        (h, w) in the unit of `patches`.

    Raises:
        InvalidArgument: the number of patches differs from the layout's, or a name is unknown.
    """
    layout = scene.layout
    if patches.shape != (layout.columns * layout.rows, 3):
        raise InvalidArgument(
            f"{len(patches)} patches do not fit the chart layout {layout.name}.",
            f"Give ({layout.columns * layout.rows}, 3) values.",
        )
    width, height = scene.size
    lookup = np.asarray(patches, dtype=np.float32)
    light = np.empty((height, width), dtype=np.float32)
    to_plane = np.asarray(np.linalg.inv(homography(scene)), dtype=np.float64)
    for rows, columns, colour in sites(cfa, height, width):
        light[rows, columns] = SURROUNDS[scene.surround] * white[colour]
    halo = int(np.ceil(4 * scene.blur)) if scene.blur > 0 else 0
    top, bottom, left, right = _extent(scene, layout, halo)
    step = max(16, (1 << 20) // max(1, right - left)) // 2 * 2
    for start in range(top, bottom, step):
        stop = min(start + step, bottom)
        for row, column, colour in cell(cfa):
            values = lookup[:, colour], float(white[colour])
            if halo:
                y = np.arange(start - halo, stop + halo)
                x = np.arange(left - halo, right + halo)
                plane = _blurred(_chart_plane(scene, layout, to_plane, x, y, *values), scene.blur)
                plane = plane[halo:-halo, halo:-halo][row::2, column::2]
            else:
                x, y = np.arange(left + column, right, 2), np.arange(start + row, stop, 2)
                plane = _chart_plane(scene, layout, to_plane, x, y, *values)
            light[start + row : stop : 2, left + column : right : 2] = plane
    if scene.glare:
        for rows, columns, colour in sites(cfa, height, width):
            light[rows, columns] += scene.glare * white[colour]
    return fall_off(light, scene.vignetting)


def fall_off(light: NDArray[np.float32], vignetting: float) -> NDArray[np.float32]:
    """Multiply by (1 + a r²)⁻², r = 1 in the corners: cos⁴ θ with tan θ = √a r. In place."""
    if vignetting > 0:
        height, width = light.shape
        y = (np.arange(height) - (height - 1) / 2) / np.hypot((height - 1) / 2, (width - 1) / 2)
        x = (np.arange(width) - (width - 1) / 2) / np.hypot((height - 1) / 2, (width - 1) / 2)
        a = (1 - vignetting) ** -0.5 - 1
        for row, y_squared in zip(light, y**2, strict=True):
            row /= (1 + a * (x**2 + y_squared)) ** 2
    return light


def project(scene: Scene, reflected: Floats, white: Floats, cfa: str) -> ChartProjection:
    """Position on the chart of every pixel."""
    width, height = scene.size
    y, x = np.mgrid[:height, :width].astype(np.float32)
    g = np.linalg.inv(homography(scene))
    depth = g[2, 0] * x + g[2, 1] * y + g[2, 2]
    u, v = ((g[i, 0] * x + g[i, 1] * y + g[i, 2]) / depth for i in (0, 1))
    return ChartProjection(u.astype(np.float32), v.astype(np.float32), reflected, white, cfa)


def _extent(scene: Scene, layout: ChartLayout, halo: int) -> tuple[int, int, int, int]:
    """Even top and left, bottom and right of the rectangle that holds the chart, within the picture."""
    frame = block_corners(layout, np.array(layout.side) + 2 * FRAME_WIDTH)
    corners = map_points(homography(scene), frame)
    low, high = np.floor(corners.min(axis=0)) - halo - 2, np.ceil(corners.max(axis=0)) + halo + 3
    left, top = (np.maximum(low, 0).astype(int) // 2 * 2).tolist()
    right, bottom = np.minimum(high, scene.size).astype(int).tolist()
    return top, bottom, left, right


def _chart_plane(
    scene: Scene,
    layout: ChartLayout,
    to_plane: Floats,
    x: NDArray[np.int64],
    y: NDArray[np.int64],
    patches: NDArray[np.float32],
    white: float,
) -> NDArray[np.float32]:
    """One colour's light at pixels (x, y): surround, frame over it, patches over the frame; (len(y), len(x))."""
    g = to_plane
    depth = g[2, 0] * x[None, :] + (g[2, 1] * y + g[2, 2])[:, None]
    around, edge = SURROUNDS[scene.surround] * white, FRAME * white
    inside = np.ones(depth.shape, dtype=np.float32)
    within = np.ones(depth.shape, dtype=np.float32)
    index = np.zeros(depth.shape, dtype=np.intp)
    for axis, count, stride in ((0, layout.columns, 1), (1, layout.rows, layout.columns)):
        u = (g[axis, 0] * x[None, :] + (g[axis, 1] * y + g[axis, 2])[:, None]) / depth
        pixel = np.hypot(g[axis, 0] - u * g[2, 0], g[axis, 1] - u * g[2, 1]) / np.abs(depth)
        half = layout.side[axis] / 2
        middle = (count - 1) / 2
        inside *= np.clip((half + FRAME_WIDTH + middle - np.abs(u - middle)) / pixel + 0.5, 0, 1)
        nearest = np.clip(np.rint(u), 0, count - 1)
        within *= np.clip((half - np.abs(u - nearest)) / pixel + 0.5, 0, 1)
        index += nearest.astype(np.intp) * stride
    behind = around + (edge - around) * inside
    return np.asarray(behind + (patches[index] - behind) * within, dtype=np.float32)


def _blurred(plane: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(plane, sigma, mode="nearest", truncate=4.0), dtype=np.float32)
