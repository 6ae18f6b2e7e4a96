"""A camera, lamps and a chart → real DNG files and the truth: the demo's input and the tests' camera.

    signal(pixel) = exposure · Σ R L S dλ / max over channels (Σ 1 L S dλ) · falloff(pixel)      share of full scale
    DN(pixel)     = round(black + (white level − black) · signal + dark current), clipped at 0 and the white level

with R the reflectance that the pixel looks at, L the lamp, S the pixel's channel. The white frame is an ideal
diffuser (R = 1) and the dark frame sees no light, both at the chart's exposure. Noise is that of a photon
counter: a Poisson number of electrons, `Sensor.full_well` at full scale, plus normal read noise.
"""

from __future__ import annotations

import errno
import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.fonts import prepare_matplotlib
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.photo.mosaic import CFA_ORDERS
from camssf.photo.pose import LAYOUTS, ChartLayout, Pose, block_corners, map_points, patch_corners
from camssf.spectra import CameraCurves, ChartTable, Lamp

SURROUNDS = {"white": 0.90, "grey": 0.20, "black": 0.02}
"""Flat reflectance of what the chart lies on."""

FRAME = 0.04
"""Reflectance of the chart's black frame, which also fills the gaps between the patches."""

FRAME_WIDTH = 0.30
"""How far the frame reaches beyond the block of patches, in pitches."""

FOCAL = 1.0
"""Focal length in picture widths (36 mm on a full-frame camera): it sets how much a tilt converges."""


LARGEST = 200_000_000
"""Pixels of the largest picture: more than any camera's, and what a computer's memory holds."""


@dataclass(frozen=True)
class Scene:
    """What lies before the camera, and how.

    Attributes:
        layout: key of `camssf.photo.pose.LAYOUTS`.
        size: (width, height) of the picture, px.
        fill: width of the block of patches, before rotation and tilt, as a share of the picture's width.
        rotation: of the chart in its plane, degrees clockwise as seen in the picture.
        tilt: of the chart about the picture's vertical axis, degrees; positive moves the right side away.
        centre: where the chart's middle lies, as shares of the picture's width and height.
        mirrored: the chart as seen in a mirror (left and right exchanged before the rotation).
        surround: "white", "grey" or "black".
        vignetting: light lost in the picture's corners, as a share: cos⁴-like, (1 + a r²)⁻².
        blur: standard deviation of the lens' Gaussian blur, px.
        glare: veil over the chart photo alone, as a share of the white signal.
    """

    layout: str = "classic24"
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
class Sensor:
    """How the camera counts.

    Attributes:
        cfa: colours of the 2 × 2 cell at the corner, one of RGGB, GRBG, GBRG, BGGR.
        black, white_level: DN; the distance between them is full scale.
        exposure: the brightest channel's signal of an ideal diffuser, as a share of full scale.
        gains: of the channels R, G, B, on top of the camera's curves: a colour cast.
        noise: whether shot and read noise are drawn at all.
        full_well: electrons at full scale.
        read_noise: standard deviation, electrons.
        dark_current: mean thermal signal in every frame, DN.
    """

    cfa: str = "RGGB"
    black: float = 512.0
    white_level: int = 16383
    exposure: float = 0.8
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    noise: bool = True
    full_well: float = 5000.0
    read_noise: float = 2.5
    dark_current: float = 0.0


@dataclass(frozen=True)
class Told:
    """What a frame's file says of itself, whether or not it is true.

    Attributes:
        cfa, black, white_level: as in `Sensor`, DN.
        exposure: seconds. iso: sensitivity.
    """

    cfa: str
    black: float
    white_level: int
    exposure: float = 0.01
    iso: float = 100.0


@dataclass(frozen=True)
class View:
    """What falls on one frame's pixels, for those who interfere: `Plan.light`.

    Attributes:
        u, v: (h, w) float32, the pixel's place on the chart in patch pitches; patch (column, row) is centred there.
        reflected: (n, 3) light of every patch, white: (3,) of an ideal diffuser, DN above black.
        cfa: of the sensor.
    """

    u: NDArray[np.float32]
    v: NDArray[np.float32]
    reflected: Floats
    white: Floats
    cfa: str


Light: TypeAlias = Callable[[NDArray[np.float32], View], NDArray[np.float32]]
Samples: TypeAlias = Callable[[NDArray[np.uint16], "Plan"], NDArray[np.uint16]]


@dataclass(frozen=True)
class Plan:
    """One shot before it is taken: what lies there, what the camera does with it, what the user says of it.

    Attributes:
        camera, lamp, table, scene, sensor: the truth about the chart photo.
        told_lamp: the spec that the user names; told_chart: likewise.
        white_lamp: the light on the white frame; None for the chart's own.
        white_level: brightness of the white frame's target, 1 for an ideal diffuser in the chart's light.
        dark_offset: DN that the dark frame has more than the others.
        light: what happens to the light on its way to the "chart" or "white" frame.
        samples: what software does to the samples of all frames.
        told: changes of what the files say, by frame.
        handed: which frame is handed in as what; None where there is none.
    """

    camera: CameraCurves
    lamp: Lamp
    table: ChartTable
    scene: Scene
    sensor: Sensor
    told_lamp: str
    told_chart: str
    white_lamp: Lamp | None = None
    white_level: float = 1.0
    dark_offset: float = 0.0
    light: Mapping[str, Light] = field(default_factory=dict)
    samples: Samples | None = None
    told: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    handed: Mapping[str, str | None] = field(
        default_factory=lambda: {"chart": "chart", "white": "white", "dark": "dark"}
    )

    def says(self, frame: str) -> Told:
        """What the file of "chart", "white" or "dark" says."""
        sensor = self.sensor
        return replace(Told(sensor.cfa, sensor.black, sensor.white_level), **self.told.get(frame, {}))


Change: TypeAlias = Callable[[Plan], Plan]


@dataclass(frozen=True)
class Frames:
    """One shot in memory.

    Attributes:
        chart, white, dark: (h, w) uint16 DN.
        signals: (n, 3) y = Σ R L S dλ / Σ L S dλ of every patch: what Eq. (5) must give back (glare adds to it).
        levels: (n, 3) DN of every patch before falloff, noise and rounding; with black, dark current and glare.
        white_levels: (3,) the same of the ideal diffuser.
        pose: where the chart truly lies.
    """

    chart: NDArray[np.uint16]
    white: NDArray[np.uint16]
    dark: NDArray[np.uint16]
    signals: Floats
    levels: Floats
    white_levels: Floats
    pose: Pose


@dataclass(frozen=True)
class SimulatedShot:
    """The files of one lamp; a fault may leave out the white or the dark frame.

    `lamp` and `told_chart` are what to calibrate with; `signals` (n, 3) is what Eq. (5) must give.
    """

    chart: Path
    white: Path | None
    dark: Path | None
    lamp: str
    told_chart: str
    signals: Floats


@dataclass(frozen=True)
class Simulation:
    """What was written, and from what.

    Attributes:
        shots: one a lamp, in the order asked for.
        truth: path of the CSV of the camera's curves, peak 1.
        pose: where the chart truly lies in every chart photo.
        camera, chart: by name.
        scene, sensor: all settings.
        seed: of the noise.
    """

    shots: tuple[SimulatedShot, ...]
    truth: Path
    pose: Pose
    camera: str
    chart: str
    scene: Scene
    sensor: Sensor
    seed: int


def homography(scene: Scene) -> Floats:
    """(3, 3) map from the chart's plane to pixels.

    The plane's unit is the pitch; the centre of the first patch is (0, 0). Pixels are those of `Pose`.
    """
    layout = _layout(scene)
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
    """Where the chart of `scene` lies."""
    layout = _layout(scene)
    to_pixels = homography(scene)
    patches = patch_corners(to_pixels, layout, layout.side)
    corners = map_points(to_pixels, block_corners(layout, layout.side))
    turns = round(scene.rotation / 90) % 4
    return Pose(scene.layout, corners, patches, turns, "simulated", 1.0, ())


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
        InvalidArgument: `patches` has another count than the layout, or a name is unknown.
    """
    layout = _layout(scene)
    if patches.shape != (layout.columns * layout.rows, 3):
        raise InvalidArgument(
            f"{len(patches)} patches do not fit the chart layout {scene.layout}.",
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
        for row, column, colour in _cell(cfa):
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
    return _fall_off(light, scene.vignetting)


def photograph(
    camera: CameraCurves,
    lamp: Lamp,
    table: ChartTable,
    scene: Scene,
    sensor: Sensor,
    seed: Sequence[int] = (0,),
) -> Frames:
    """One shot in memory: chart, white and dark frame, and the truth about them.

    Raises:
        InvalidArgument: a setting is out of range, or camera and lamp share no light.
    """
    return take(Plan(camera, lamp, table, scene, sensor, lamp.name, table.name), seed)


def take(plan: Plan, seed: Sequence[int] = (0,)) -> Frames:
    """The frames of a plan, in memory; what the files say and which are handed in is the writer's.

    Raises:
        InvalidArgument: as `photograph`.
    """
    scene, sensor = plan.scene, plan.sensor
    _check(scene, sensor)
    reflected, diffuser = _exposed(plan, plan.lamp)
    if plan.white_lamp is None:
        white = diffuser
    else:
        _, white = _exposed(plan, plan.white_lamp)
    width, height = scene.size
    flat = np.empty((height, width), dtype=np.float32)
    for rows, columns, colour in sites(sensor.cfa, height, width):
        flat[rows, columns] = plan.white_level * white[colour]
    _fall_off(flat, scene.vignetting)
    light = render_mosaic(scene, reflected, diffuser, sensor.cfa)
    if plan.light:
        view = _look(scene, reflected, diffuser, sensor.cfa)
        flat = plan.light["white"](flat, view) if "white" in plan.light else flat
        light = plan.light["chart"](light, view) if "chart" in plan.light else light
    chart = _count(light, sensor, np.random.default_rng([*seed, 0]))
    del light
    lit = _count(flat, sensor, np.random.default_rng([*seed, 1]))
    warm = replace(sensor, dark_current=sensor.dark_current + plan.dark_offset)
    dark = _count(np.zeros_like(flat), warm, np.random.default_rng([*seed, 2]))
    if plan.samples is not None:
        chart, lit, dark = (plan.samples(frame, plan) for frame in (chart, lit, dark))
    offset = sensor.black + sensor.dark_current
    levels = reflected + scene.glare * diffuser + offset
    signals = reflected / diffuser
    return Frames(chart, lit, dark, signals, levels, diffuser + offset, true_pose(scene))


def _exposed(plan: Plan, lamp: Lamp) -> tuple[Floats, Floats]:
    """Light of the patches (n, 3) and of a diffuser (3,) under a lamp, DN above black."""
    sensor, curves = plan.sensor, plan.camera.values
    diffuser = np.einsum("m,mc->c", lamp.values, curves) * STEP * sensor.gains
    if not diffuser.min() > 0:
        raise InvalidArgument(
            f"Camera {plan.camera.name} sees nothing of lamp {lamp.name} in a channel.",
            "Choose a lamp with power between 400 and 700 nm.",
        )
    reflected = np.einsum("nm,m,mc->nc", plan.table.values, lamp.values, curves) * STEP * sensor.gains
    scale = sensor.exposure * (sensor.white_level - sensor.black) / float(diffuser.max())
    return scale * reflected, scale * diffuser


def _look(scene: Scene, reflected: Floats, white: Floats, cfa: str) -> View:
    """Where on the chart every pixel looks."""
    width, height = scene.size
    y, x = np.mgrid[:height, :width].astype(np.float32)
    g = np.linalg.inv(homography(scene))
    depth = g[2, 0] * x + g[2, 1] * y + g[2, 2]
    u, v = ((g[i, 0] * x + g[i, 1] * y + g[i, 2]) / depth for i in (0, 1))
    return View(u.astype(np.float32), v.astype(np.float32), reflected, white, cfa)


def simulate(
    camera: CameraCurves | str,
    lamps: Sequence[Lamp | str] | Lamp | str,
    out: str | Path,
    *,
    chart: ChartTable | str = "classic24",
    size: tuple[int, int] = (4000, 3000),
    cfa: str = "RGGB",
    black: float = 512.0,
    white_level: int = 16383,
    exposure: float = 0.8,
    noise: bool = True,
    seed: int = 0,
    vignetting: float = 0.0,
    tilt: float = 0.0,
    rotation: float = 0.0,
    fill: float = 0.6,
    blur: float = 0.0,
    glare: float = 0.0,
    dark_current: float = 0.0,
    surround: str = "grey",
    mirrored: bool = False,
    full_well: float = 5000.0,
    read_noise: float = 2.5,
    compression: str | None = None,
    change: Change | None = None,
) -> Simulation:
    """Write chart, white and dark frame of every lamp as DNG, and the camera's curves as truth.csv.

    One lamp gives `chart.dng white.dng dark.dng`, several `chart-<lamp>.dng` and so on. All files appear, or none.

    Args:
        camera: curves, or a name or file that `camssf.spectra.read_camera` knows.
        lamps: lamps, or what `read_lamp` knows, one a shot.
        out: folder; made where it is missing.
        chart: a table, or what `read_chart` knows.
        size, fill, rotation, tilt, vignetting, blur, glare, surround, mirrored: see `Scene`.
        cfa, black, white_level, exposure, noise, dark_current, full_well, read_noise: see `Sensor`.
        seed: of the noise; the same seed gives the same bytes.
        compression: None, or "ljpeg" for lossless JPEG tiles (needs imagecodecs, for benchmarks).
        change: what goes wrong with the last lamp's shot (`camssf.simulation.faults`).

    Raises:
        InvalidArgument: a setting is out of range, or the chart does not fit into the picture.
    """
    from camssf import spectra

    body = spectra.read_camera(camera) if isinstance(camera, str) else camera
    table = spectra.read_chart(chart) if isinstance(chart, str) else chart
    wanted = [lamps] if isinstance(lamps, str | Lamp) else list(lamps)
    lights = [spectra.read_lamp(lamp) if isinstance(lamp, str) else lamp for lamp in wanted]
    if not lights:
        raise InvalidArgument("A simulation without a lamp is dark.", 'Name one, for example "D55".')
    scene = Scene(
        layout=table.layout,
        size=size,
        fill=fill,
        rotation=rotation,
        tilt=tilt,
        mirrored=mirrored,
        surround=surround,
        vignetting=vignetting,
        blur=blur,
        glare=glare,
    )
    sensor = Sensor(
        cfa=cfa,
        black=black,
        white_level=white_level,
        exposure=exposure,
        noise=noise,
        full_well=full_well,
        read_noise=read_noise,
        dark_current=dark_current,
    )
    _check(scene, sensor)
    if seed < 0:
        raise InvalidArgument(f"Seed {seed} is below 0.", "Choose any whole number from 0 up.")
    if compression not in (None, "ljpeg"):
        raise InvalidArgument(f"Compression {compression} is unknown.", 'Choose None or "ljpeg".')
    if compression and find_spec("imagecodecs") is None:
        raise InvalidArgument("Lossless JPEG needs imagecodecs.", "Install it, or leave compression out.")
    pose = true_pose(scene)
    if not ((pose.corners >= 0) & (pose.corners <= np.array(size) - 1)).all():
        raise InvalidArgument(
            "The chart reaches beyond the picture.", "Make fill smaller, or rotate or tilt it less."
        )
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".camssf-") as aside:
            shots = []
            for number, (light, tag) in enumerate(zip(lights, _tags(lights), strict=True)):
                plan = Plan(body, light, table, scene, sensor, light.name, table.name)
                if change is not None and number == len(lights) - 1:
                    plan = change(plan)
                frames = take(plan, (seed, number))
                samples = {"chart": frames.chart, "white": frames.white, "dark": frames.dark}
                neutral = (frames.white_levels - plan.sensor.black - plan.sensor.dark_current) / plan.sensor.exposure
                neutral /= plan.sensor.white_level - plan.sensor.black
                paths: dict[str, Path] = {}
                for role, frame in plan.handed.items():
                    if frame is not None:
                        name = f"{role}{tag}.dng"
                        _write_dng(Path(aside, name), samples[frame], plan.says(frame), body, neutral, compression)
                        paths[role] = folder / name
                shots.append(
                    SimulatedShot(
                        paths["chart"], paths.get("white"), paths.get("dark"), plan.told_lamp, plan.told_chart,
                        frames.signals,
                    )
                )  # fmt: skip
            _write_truth(Path(aside, "truth.csv"), body)
            written = sorted(Path(aside).iterdir())
            for path in written:
                if (folder / path.name).is_dir():
                    raise IsADirectoryError(errno.EISDIR, f"{path.name} is a folder there")
            for path in written:
                os.replace(path, folder / path.name)
    except OSError as error:
        raise InvalidArgument(
            f"Cannot write into {folder}: {error.strerror or error}.",
            "Choose a folder that you may write to.",
        ) from error
    return Simulation(tuple(shots), folder / "truth.csv", pose, body.name, table.name, scene, sensor, seed)


def _layout(scene: Scene) -> ChartLayout:
    try:
        return LAYOUTS[scene.layout]
    except KeyError:
        raise InvalidArgument(
            f"No chart layout is called {scene.layout}.", f"Choose one of {', '.join(LAYOUTS)}."
        ) from None


def _check(scene: Scene, sensor: Sensor) -> None:
    """Refuse settings out of range."""
    width, height = scene.size
    rules = (
        (min(width, height) >= 16 and max(width, height) <= 30000, "size", "16 to 30000 px a side"),
        (width * height <= LARGEST, "size", f"at most {LARGEST // 1_000_000} megapixels"),
        (0 < scene.fill <= 1, "fill", "a share of the picture's width, above 0 and at most 1"),
        (abs(scene.tilt) <= 80, "tilt", "-80 to 80 degrees"),
        (np.isfinite(scene.rotation), "rotation", "finite, degrees"),
        (scene.surround in SURROUNDS, "surround", f"one of {', '.join(SURROUNDS)}"),
        (0 <= scene.vignetting < 1, "vignetting", "at least 0 and below 1"),
        (0 <= scene.blur <= 100, "blur", "0 to 100 px"),
        (0 <= scene.glare <= 1, "glare", "0 to 1"),
        (sensor.cfa in CFA_ORDERS, "cfa", f"one of {', '.join(CFA_ORDERS)}"),
        (1 <= sensor.white_level <= 65535, "white_level", "1 to 65535 DN"),
        (0 <= sensor.black < sensor.white_level, "black", "at least 0 and below white_level, DN"),
        (0 < sensor.exposure <= 100, "exposure", "above 0 and at most 100"),
        (sensor.full_well > 0, "full_well", "above 0, electrons"),
        (sensor.read_noise >= 0, "read_noise", "at least 0, electrons"),
        (sensor.dark_current >= 0, "dark_current", "at least 0, DN"),
        (min(sensor.gains) > 0, "gains", "above 0"),
    )
    for holds, name, wanted in rules:
        if not holds:
            raise InvalidArgument(f"The simulation's {name} is out of range.", f"It must be {wanted}.")


def _cell(cfa: str) -> Iterator[tuple[int, int, int]]:
    """(row, column, colour) of the cell's four positions."""
    if cfa not in CFA_ORDERS:
        raise InvalidArgument(f"No Bayer order is called {cfa}.", f"Choose one of {', '.join(CFA_ORDERS)}.")
    for position, letter in enumerate(cfa):
        yield position // 2, position % 2, "RGB".index(letter)


def sites(cfa: str, height: int, width: int) -> Iterator[tuple[slice, slice, int]]:
    """Slices of the four sub-pictures, with their colours."""
    for row, column, colour in _cell(cfa):
        yield slice(row, height, 2), slice(column, width, 2), colour


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


def _fall_off(light: NDArray[np.float32], vignetting: float) -> NDArray[np.float32]:
    """Multiply by (1 + a r²)⁻², r = 1 in the corners: cos⁴ θ with tan θ = √a r. In place."""
    if vignetting > 0:
        height, width = light.shape
        y = (np.arange(height) - (height - 1) / 2) / np.hypot((height - 1) / 2, (width - 1) / 2)
        x = (np.arange(width) - (width - 1) / 2) / np.hypot((height - 1) / 2, (width - 1) / 2)
        a = (1 - vignetting) ** -0.5 - 1
        for row, y_squared in zip(light, y**2, strict=True):
            row /= (1 + a * (x**2 + y_squared)) ** 2
    return light


def _count(light: NDArray[np.float32], sensor: Sensor, rng: np.random.Generator) -> NDArray[np.uint16]:
    """Light in DN above black → samples, in strips so that memory stays small."""
    samples = np.empty(light.shape, dtype=np.uint16)
    electrons = sensor.full_well / (sensor.white_level - sensor.black)
    step = max(1, (1 << 20) // light.shape[1])
    for start in range(0, len(light), step):
        strip = light[start : start + step].astype(np.float64) + sensor.dark_current
        if sensor.noise:
            strip = rng.poisson(strip * electrons) + sensor.read_noise * rng.standard_normal(strip.shape)
            strip /= electrons
        np.rint(strip + sensor.black, out=strip)
        samples[start : start + step] = np.clip(strip, 0, sensor.white_level, out=strip)
    return samples


def _tags(lamps: list[Lamp]) -> list[str]:
    """What tells the lamps' files apart: nothing for one lamp."""
    if len(lamps) == 1:
        return [""]
    tags: list[str] = []
    for lamp in lamps:
        tag = "-" + (re.sub(r"[^A-Za-z0-9.]+", "-", Path(lamp.name).stem).strip("-.") or "lamp")
        again = sum(other == tag or other.startswith(tag + "~") for other in tags)
        tags.append(f"{tag}~{again + 1}" if again else tag)
    return tags


def _write_truth(path: Path, camera: CameraCurves) -> None:
    curves = camera.values / camera.values.max(axis=0)
    rows = np.column_stack([WAVELENGTHS, curves])
    lines = [f"{nm:.1f},{r:.9g},{g:.9g},{b:.9g}" for nm, r, g, b in rows.tolist()]
    path.write_text("\n".join(["wavelength_nm,red,green,blue", *lines, ""]), encoding="utf-8")


def _color_matrix(camera: CameraCurves) -> Floats:
    """(3, 3) XYZ to camera under D65: the CIE 1931 observer fitted to the curves, its rows scaled to keep white."""
    prepare_matplotlib()  # colour-science loads it
    import colour

    shape = colour.SpectralShape(380, 720, STEP)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    daylight = colour.SDS_ILLUMINANTS["D65"].copy().align(shape).values
    weights = np.sqrt(daylight)[:, None]
    matrix = np.linalg.lstsq(weights * observer, weights * camera.values, rcond=None)[0].T
    white = daylight @ observer / (daylight @ observer[:, 1])
    neutral = daylight @ camera.values
    return np.asarray(matrix * (neutral / neutral.max() / (matrix @ white))[:, None], dtype=np.float64)


def _rationals(values: Floats, denominator: int = 10000) -> list[int]:
    return [part for value in np.ravel(values) for part in (round(float(value) * denominator), denominator)]


def _write_dng(
    path: Path,
    samples: NDArray[np.uint16],
    told: Told,
    camera: CameraCurves,
    neutral: Floats,
    compression: str | None,
) -> None:
    """One DNG 1.4, CFA in IFD0, 16 bits, uncompressed or in lossless JPEG tiles."""
    import tifffile

    from camssf import __version__

    height, width = samples.shape
    pattern = bytes("RGB".index(letter) for letter in told.cfa)
    extra: list[tuple[int, int, int, Any, bool]] = [
        (271, 2, 0, "camssf", True),
        (272, 2, 0, camera.name.encode("ascii", "replace").decode(), True),
        (274, 3, 1, 1, True),
        (33421, 3, 2, (2, 2), True),
        (33422, 1, 4, pattern, True),
        (33434, 5, 1, tuple(_rationals(np.array([told.exposure]), 1_000_000)), True),
        (34855, 3, 1, round(told.iso), True),
        (50706, 1, 4, bytes((1, 4, 0, 0)), True),
        (50707, 1, 4, bytes((1, 1, 0, 0)), True),
        (50708, 2, 0, "camssf simulated camera", True),
        (50713, 3, 2, (2, 2), True),
        (50714, 5, 4, _rationals(np.full(4, told.black), 100), True),
        (50717, 4, 1, told.white_level, True),
        (50721, 10, 9, _rationals(_color_matrix(camera)), True),
        (50728, 5, 3, _rationals(neutral), True),
        (50778, 3, 1, 21, True),
        (50829, 4, 4, (0, 0, height, width), True),
    ]
    options: dict[str, Any] = {
        "photometric": "cfa",
        "metadata": None,
        "software": f"camssf {__version__}",
        "extratags": extra,
    }
    if compression is None:
        tifffile.imwrite(path, samples, byteorder="<", rowsperstrip=64, **options)
        return
    tile = (256, 256)
    tifffile.imwrite(
        path,
        _jpeg_tiles(samples, tile),
        byteorder="<",
        shape=samples.shape,
        dtype=np.uint16,
        tile=tile,
        compression=7,
        **options,
    )


def _jpeg_tiles(samples: NDArray[np.uint16], tile: tuple[int, int]) -> Iterator[bytes]:
    """Lossless JPEG (SOF3) of every tile, edge tiles padded; two components, as a CFA row alternates two colours."""
    import imagecodecs

    bits = max(2, int(samples.max()).bit_length())
    padded = np.pad(samples, [(0, -n % t) for n, t in zip(samples.shape, tile, strict=True)], mode="edge")
    for top in range(0, padded.shape[0], tile[0]):
        for left in range(0, padded.shape[1], tile[1]):
            block = padded[top : top + tile[0], left : left + tile[1]]
            pairs = np.ascontiguousarray(block).reshape(tile[0], tile[1] // 2, 2)
            yield bytes(imagecodecs.jpeg_encode(pairs, lossless=True, bitspersample=bits))
