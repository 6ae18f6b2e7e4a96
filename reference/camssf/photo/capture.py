"""Measures a capture: the shots of one chart with one camera, from photos and lamps."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from numbers import Real
from os import PathLike as OsPath
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf.errors import FramesDiffer, InvalidArgument
from camssf.grid import Floats
from camssf.options import DEFAULTS, Options
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.patches import PatchMeans, measure_patches
from camssf.photo.read.colour_matrix import ColourMatrix
from camssf.photo.read.dng import Mosaic
from camssf.photo.read.raw import read_raw
from camssf.photo.read.unit import Area, Unit, check_unit
from camssf.photo.shot import Shot, Shots, check_shots, check_torch, some_white
from camssf.spectra import ChartLike, ChartTable, Light, LightLike, read_chart

PREVIEW = 1200
"""Longest side of a thumbnail, px."""

Progress: TypeAlias = Callable[[str, float], None]


@dataclass(frozen=True)
class Photo:
    """Metadata of a frame, without its samples.

    `colour_matrices`: of the file, XYZ to raw.
    `unit`: the physical camera and its lens; `active_area`: top, left, bottom, right of its sensor's active area.
    `levels`: the source of its pattern and levels; "" if they are a DNG's own tags.
    `unique_model`: the DNG's UniqueCameraModel, by which raw converters identify the camera; "" if missing.
    """

    name: str
    width: int
    height: int
    orientation: int
    exposure: float | None
    iso: float | None
    gain_map: bool
    make: str
    model: str
    sha256: str
    colour_matrices: tuple[ColourMatrix, ...] = ()
    unit: Unit = field(default_factory=Unit)
    active_area: Area | None = None
    levels: str = ""
    unique_model: str = ""


@dataclass(frozen=True)
class MeasuredShot:
    """A measured shot: the chart photo under one lamp, with its frames.

    Attributes:
        lamp: its light; `Unnamed` if the user named none.
        photo, white, dark: metadata of the frames; None for a missing frame.
        pose: the chart's position in the photo.
        means: the patch statistics of all frames.
        thumbnail: (h, w, 3) DN, a sparse sample of the active area for the report; None after pickling.
        lens_shading: treatment of the shading that the file describes, one of `camssf.photo.patches.LENS_SHADING`.
    """

    lamp: Light
    photo: Photo
    white: Photo | None
    dark: Photo | None
    pose: Pose
    means: PatchMeans
    thumbnail: NDArray[np.uint16] | None
    lens_shading: str = "as-stored"


@dataclass(frozen=True)
class Capture:
    """k measured shots of one chart with one camera: the input of `solve`.

    Attributes:
        shots: the k shots.
        chart: the chart's table.
        white_reflectance: reflectance of the white frame's target, one number; None for a perfect diffuser.
        files: SHA-256 of the lamp and chart files, by role and name; empty if neither is a file.
    """

    shots: tuple[MeasuredShot, ...]
    chart: ChartTable
    white_reflectance: float | None
    files: dict[str, str] = field(default_factory=dict)


@dataclass
class Unfinished:
    """A shot that is being measured: its lamp, and the data available so far.

    Attributes:
        lamp: its light.
        photo: metadata of its file; None until it is read.
        black, saturation: black levels (3,) and white level, DN.
        thumbnail: as in `MeasuredShot`.
        pose: None until the chart is found.
    """

    lamp: Light
    photo: Photo | None = None
    black: Floats = field(default_factory=lambda: np.zeros(3))
    saturation: float = 0.0
    thumbnail: NDArray[np.uint16] | None = None
    pose: Pose | None = None


@dataclass
class Record:
    """The data of a capture so far. `measure` and `solve` fill it, so that the report of a refusal can show it.

    Attributes:
        chart: name of the chart.
        table: table of the chart; None until it is read.
        files: as in `Capture`.
        shots: the measured shots.
        unfinished: the shot that is being measured; None between two shots.
    """

    chart: str = ""
    table: ChartTable | None = None
    files: dict[str, str] = field(default_factory=dict)
    shots: list[MeasuredShot] = field(default_factory=list)
    unfinished: Unfinished | None = None

    def note(self, capture: Capture) -> None:
        """Copy the data of a finished capture."""
        self.chart, self.table, self.files = capture.chart.name, capture.chart, capture.files
        self.shots, self.unfinished = list(capture.shots), None


def measure(
    shots: Shots,
    lamp: LightLike | None = None,
    *,
    chart: ChartLike = "classic24",
    options: Options = DEFAULTS,
    progress: Progress | None = None,
    record: Record | None = None,
) -> Capture:
    """Read the photos, find the chart and measure its patches.

    Args:
        shots, lamp, chart, progress: as in `calibrate`.
        options: the options of measuring.
        record: filled step by step; it keeps its data when this raises.

    Raises:
        CalibrationError: a file, a chart or a frame is unusable; FramesDiffer for two cameras.
    """
    tell = progress or (lambda stage, part: None)
    record = Record() if record is None else record
    record.chart = str(chart) if isinstance(chart, str | OsPath) else str(getattr(chart, "name", "chart (given)"))
    given = check_shots(shots, lamp)
    target = check_target(options.white_reflectance, given[0].white is not None)
    for role, spec in [("chart table", chart), *((f"shot {j + 1}, lamp", s.lamp) for j, s in enumerate(given))]:
        record.files |= input_hash(role, spec)
    lights = [shot.light() for shot in given]
    check_torch(given, lights)
    record.table = table = read_chart(chart)
    record.chart = table.name
    k = len(given)
    for j, (shot, light) in enumerate(zip(given, lights, strict=True)):
        at = f" {j + 1} of {k}" if k > 1 else ""
        record.unfinished = Unfinished(light)
        tell(f"reading photo{at}", j / k)
        photo = read_raw(shot.photo)
        record.unfinished = begun = Unfinished(
            light, photo_of(photo), cell_blacks(photo), photo.white, thumbnail(photo)
        )
        tell(f"looking for the chart{at}", (j + 0.4) / k)
        begun.pose = find_chart(photo, table, corners=shot.corners)
        tell(f"measuring the patches{at}", (j + 0.7) / k)
        record.shots.append(_measured(shot, photo, begun))
        record.unfinished = None
    check_alike(record.shots)
    return Capture(tuple(record.shots), table, target, record.files)


def _measured(shot: Shot, photo: Mosaic, begun: Unfinished) -> MeasuredShot:
    """The shot measured, once its chart is found."""
    assert begun.photo is not None
    assert begun.pose is not None
    white, dark = (None if path is None else read_raw(path) for path in (shot.white, shot.dark))
    return MeasuredShot(
        lamp=begun.lamp,
        photo=begun.photo,
        white=None if white is None else photo_of(white),
        dark=None if dark is None else photo_of(dark),
        pose=begun.pose,
        means=measure_patches(photo, begun.pose, white=white, dark=dark, lens_shading=shot.lens_shading),
        thumbnail=begun.thumbnail,
        lens_shading=shot.lens_shading,
    )


def photo_of(mosaic: Mosaic) -> Photo:
    """Metadata of a photo, without its samples."""
    height, width = mosaic.samples.shape
    return Photo(
        name=Path(mosaic.path).name,
        width=width,
        height=height,
        orientation=mosaic.orientation,
        exposure=mosaic.exposure,
        iso=mosaic.iso,
        gain_map=mosaic.gain_map,
        make=mosaic.make,
        model=mosaic.model,
        sha256=mosaic.sha256,
        colour_matrices=mosaic.colour_matrices,
        unit=mosaic.unit,
        active_area=mosaic.active_area,
        levels=mosaic.levels,
        unique_model=mosaic.unique_model,
    )


def thumbnail(mosaic: Mosaic) -> NDArray[np.uint16]:
    """Sample CFA cells at regular intervals, as (h, w, 3) DN; the report renders the picture only if needed."""
    height, width = mosaic.samples.shape
    step = 2 * max(1, -(-max(height, width) // (2 * PREVIEW)))
    rows, columns = (height - 1) // step, (width - 1) // step
    picture = np.empty((rows, columns, 3), np.uint16)
    for position in range(4):
        y, x = divmod(position, 2)  # the lower green overwrites the upper one
        picture[:, :, "RGB".index(mosaic.cfa[position])] = mosaic.samples[y::step, x::step][:rows, :columns]
    return picture


def cell_blacks(mosaic: Mosaic) -> Floats:
    """Black levels (3,) of the first cell of each colour, DN."""
    return np.array([mosaic.black[divmod(mosaic.cfa.index(colour), 2)] for colour in "RGB"])


def check_target(share: Any, framed: bool) -> float | None:
    """Check the reflectance of the white frame's target and return it.

    Raises:
        InvalidArgument: the reflectance is not a number from 0.05 to 1.2, or there is no white frame.
    """
    if share is None:
        return None
    if isinstance(share, bool) or not isinstance(share, Real) or not 0.05 <= float(share) <= 1.2:
        raise InvalidArgument(
            f"The white target's reflectance must lie between 0.05 and 1.2; got {share}.", "Write 95 % as 0.95."
        )
    if not framed:
        raise InvalidArgument(
            "A white target's reflectance was given, but no white frame.", "Give the white frame, or leave it out."
        )
    return float(share)


def check_alike(shots: Sequence[MeasuredShot]) -> None:
    """Raise unless the shots are different photos by one camera, and all or none have a white frame.

    Raises:
        InvalidArgument: a photo given twice, or a white frame for some shots only.
        FramesDiffer: two cameras.
        UnitDiffers: two physical cameras or lenses of one model.
    """
    hashes = [shot.photo.sha256 for shot in shots]
    twice = [shot.photo.name for shot in shots if hashes.count(shot.photo.sha256) > 1]
    if twice:
        raise InvalidArgument(
            f"{twice[0]} was given {len(twice)} times: the same photo adds no information.",
            "Give each photo once; a second shot is another photo, best under another lamp.",
        )
    bodies = {(shot.photo.make, shot.photo.model) for shot in shots}
    if len(bodies) > 1:
        raise FramesDiffer(
            f"The photos come from different cameras: {', '.join(sorted(' '.join(b) for b in bodies))}.",
            "Calibrate one camera at a time.",
        )
    first = shots[0].photo
    for shot in shots[1:]:
        photo = shot.photo
        check_unit(first.name, (first.unit, first.active_area), photo.name, (photo.unit, photo.active_area))
    if len({shot.white is None for shot in shots}) > 1:
        raise some_white()


def input_hash(role: str, spec: Any) -> dict[str, str]:
    """SHA-256 of the file behind a lamp or chart spec, if there is one."""
    text = str(spec) if isinstance(spec, str | Path) else ""
    for name in (text, text.partition(":")[2]):
        try:
            if name and Path(name).is_file():
                return {f"{role}: {Path(name).name}": hashlib.sha256(Path(name).read_bytes()).hexdigest()}
        except (OSError, ValueError):
            continue  # reading the table later reports the error
    return {}
