"""Measures a capture: the shots of one chart with one camera, from photos and lamps."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from numbers import Real
from os import PathLike as OsPath
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from camssf.errors import CalibrationError, InvalidArgument
from camssf.grid import Floats
from camssf.messages import fail
from camssf.options import DEFAULTS, Options
from camssf.photo.find.pose import Pose, chart_area, find_chart
from camssf.photo.patches import LENS_SHADING, PatchMeans, measure_patches
from camssf.photo.read.colour_matrix import ColourMatrix
from camssf.photo.read.dng import Mosaic
from camssf.photo.read.raw import read_raw
from camssf.photo.read.unit import Area, Unit, check_unit
from camssf.photo.shot import Shot, Shots, check_shots, check_torch, some_white
from camssf.progress import Progress, part_of
from camssf.shapes import MOST_SHOTS, Apart, Bounds, Rgb, Sha256, Size, Text, Whole, Words
from camssf.spectra import ChartLike, ChartTable, Light, LightLike, read_chart
from camssf.spectra.charts import chart_parts
from camssf.spectra.lamps import is_lamp_name
from camssf.spectra.limits import CARD
from camssf.spectra.sampled import text_of
from camssf.spectra.text import is_file

PREVIEW = 1200
"""Longest side of a thumbnail, px."""
CHART_TABLE = "chart table"
"""Role of the chart's file among the hashes of a capture."""


@dataclass(frozen=True)
class Photo:
    """Metadata of a frame, without its samples.

    Attributes:
        name: of its file.
        width, height: of the active area, px.
        orientation: TIFF orientation of the display; points ignore it.
        exposure: exposure time, s.
        iso: ISO sensitivity.
        gain_map: whether the file holds a lens-shading map that its samples do not contain.
        make, model: as the file names them.
        sha256: of the file; for a picture with a sidecar, of both.
        colour_matrices: of the file, XYZ to raw.
        unit: the physical camera and its lens.
        active_area: top, left, bottom, right of the sensor's active area, px.
        levels: the source of its pattern and levels; "" if they are a DNG's own tags.
        unique_model: the DNG's UniqueCameraModel, by which raw converters identify the camera; "" if missing.
        matrices_left_out: which of the file's colour matrices are not used, and why; "" if none.
        time: when it was taken, ISO 8601; only in a document whose app wrote it.
    """

    name: Text
    width: Whole
    height: Whole
    orientation: Annotated[int, Bounds(1, 8)]
    exposure: Size | None
    iso: Size | None
    gain_map: bool
    make: Text
    model: Text
    sha256: Sha256
    colour_matrices: tuple[ColourMatrix, ...] = ()
    unit: Unit = Unit()  # noqa: RUF009  (frozen)
    active_area: Area | None = None
    levels: Text = ""
    unique_model: Text = ""
    matrices_left_out: Text = ""
    time: Text = ""


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
    thumbnail: Annotated[NDArray[np.uint16] | None, Apart()] = None
    lens_shading: Annotated[str, Words(LENS_SHADING)] = LENS_SHADING[0]


@dataclass(frozen=True)
class UnfinishedShot:
    """A shot at which measuring ended: its lamp, and what is known of it.

    Attributes:
        lamp: its light.
        photo: metadata of its file; None if it was not read.
        black, saturation: black levels (3,) and white level, DN.
        pose: None if the chart was not found.
        thumbnail: as in `MeasuredShot`.
    """

    lamp: Light
    photo: Photo | None = None
    black: Rgb | None = None
    saturation: Size = 0.0
    pose: Pose | None = None
    thumbnail: Annotated[NDArray[np.uint16] | None, Apart()] = None


@dataclass(frozen=True)
class Capture:
    """k measured shots of one chart with one camera: the input of `solve`.

    Attributes:
        shots: the k shots; fewer, or none, of a capture that was refused while it was measured.
        chart: the chart's table.
        white_reflectance: reflectance of the white frame's target, one number; None for a perfect diffuser.
        files: SHA-256 of the lamp and chart files, by role and name; empty if neither is a file.
        unfinished: the shot at which measuring ended; None of a whole capture.
    """

    shots: Annotated[tuple[MeasuredShot, ...], Bounds(0, MOST_SHOTS)]
    chart: ChartTable
    white_reflectance: Annotated[float, Bounds(*CARD)] | None = None
    files: dict[Text, Sha256] = field(default_factory=dict)
    unfinished: UnfinishedShot | None = None

    @property
    def photos(self) -> tuple[Photo, ...]:
        """The chart photos that were read, in order."""
        last = self.unfinished
        return tuple(shot.photo for shot in self.shots) + (
            () if last is None or last.photo is None else (last.photo,)
        )

    @property
    def lights(self) -> tuple[Light, ...]:
        """The lights of `photos`."""
        last = self.unfinished
        lights = tuple(shot.lamp for shot in self.shots)
        return lights if last is None or last.photo is None else (*lights, last.lamp)

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of all inputs by role and name: lamp and chart files, photos, frames."""
        hashes = dict(self.files)
        for j, photo in enumerate(self.photos, 1):
            hashes[f"shot {j}, chart: {photo.name}"] = photo.sha256
        for j, shot in enumerate(self.shots, 1):
            for role, frame in (("white", shot.white), ("dark", shot.dark)):
                if frame is not None:
                    hashes[f"shot {j}, {role}: {frame.name}"] = frame.sha256
        return hashes


def measure(
    shots: Shots,
    lamp: LightLike | None = None,
    *,
    chart: ChartLike = "classic24",
    options: Options = DEFAULTS,
    progress: Progress | None = None,
) -> Capture:
    """Read the photos, find the chart and measure its patches.

    Args:
        shots, lamp, chart, progress: as in `calibrate`.
        options: the options of measuring.

    Raises:
        CalibrationError: a file, a chart or a frame is unusable; its `capture` holds what was measured until then.
        FramesDiffer: two cameras.
    """
    tell = part_of(progress, 0.0, 1.0)
    posed = check_shots(shots, lamp)
    target = check_target(options.white_reflectance, posed[0].white is not None)
    files: dict[str, str] = {}
    for role, spec in [(CHART_TABLE, chart), *((f"shot {j + 1}, lamp", s.lamp) for j, s in enumerate(posed))]:
        files |= input_hash(role, spec)
    measured = Capture((), read_chart(chart), target, files)
    k = len(posed)
    try:
        lights = [shot.light() for shot in posed]
        check_torch(posed, lights)
        for j, (shot, light) in enumerate(zip(posed, lights, strict=True)):
            at = f" {j + 1} of {k}" if k > 1 else ""
            measured = replace(measured, unfinished=UnfinishedShot(light))
            tell(f"reading photo{at}", j / k)
            photo = read_raw(shot.photo, None if shot.corners is None else chart_area(shot.corners), rest=True)
            unfinished = UnfinishedShot(
                light, photo_of(photo), cell_blacks(photo), photo.white, thumbnail=thumbnail(photo)
            )
            measured = replace(measured, unfinished=unfinished)
            tell(f"looking for the chart{at}", (j + 0.4) / k)
            unfinished = replace(unfinished, pose=find_chart(photo, measured.chart, corners=shot.corners))
            measured = replace(measured, unfinished=unfinished)
            tell(f"measuring the patches{at}", (j + 0.7) / k)
            measured = replace(measured, shots=(*measured.shots, _measured(shot, photo, unfinished)), unfinished=None)
        check_alike(measured.shots)
    except CalibrationError as error:
        error.capture = measured
        raise
    tell("measured", 1.0)
    return measured


def _measured(shot: Shot, photo: Mosaic, unfinished: UnfinishedShot) -> MeasuredShot:
    """The shot measured, once its chart is found."""
    assert unfinished.photo is not None
    assert unfinished.pose is not None
    part = chart_area(unfinished.pose.corners if shot.corners is None else shot.corners)
    white, dark = (None if path is None else read_raw(path, part) for path in (shot.white, shot.dark))
    check_roles([("the chart's photo", photo), ("the white frame", white), ("the dark frame", dark)])
    return MeasuredShot(
        lamp=unfinished.lamp,
        photo=unfinished.photo,
        white=None if white is None else photo_of(white),
        dark=None if dark is None else photo_of(dark),
        pose=unfinished.pose,
        means=measure_patches(photo, unfinished.pose, white=white, dark=dark, lens_shading=shot.lens_shading),
        thumbnail=unfinished.thumbnail,
        lens_shading=shot.lens_shading,
    )


def check_roles(frames: Sequence[tuple[str, Mosaic | Photo | None]]) -> None:
    """Check that photos of different roles, each with its name in words, are different files by their content.

    Raises:
        InvalidArgument: one file has two roles.
    """
    known = [(role, frame) for role, frame in frames if frame is not None]
    for (first, one), (second, other) in combinations(known, 2):
        if one.sha256 == other.sha256:
            raise InvalidArgument(
                f"{first[0].upper()}{first[1:]} and {second} are the same photo ({one.sha256[:12]}).",
                "Give another file for one of them: the white frame shows an even white target in the chart's light, "
                "the dark frame no light. Or leave it out.",
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
        matrices_left_out=mosaic.matrices_left_out,
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
    if isinstance(share, bool) or not isinstance(share, Real) or not CARD[0] <= float(share) <= CARD[1]:
        raise InvalidArgument(
            "The white target's reflectance must lie between {:g} and {:g}; got {}.".format(*CARD, share),
            "Write 95 % as 0.95.",
        )
    if not framed:
        raise InvalidArgument(
            "A white target's reflectance was given, but no white frame.", "Give the white frame, or leave it out."
        )
    return float(share)


def check_alike(shots: Sequence[MeasuredShot]) -> None:
    """Raise unless the shots are different photos by one camera, and all or none have a white frame.

    Raises:
        InvalidArgument: a photo given twice or in two roles, or a white frame for some shots only.
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
    for j, shot in enumerate(shots, 1):
        for k, other in enumerate(shots, 1):
            chart = f"the chart's photo of shot {j}", shot.photo
            check_roles([chart, (f"the white frame of shot {k}", other.white)])
            check_roles([chart, (f"the dark frame of shot {k}", other.dark)])
    bodies = {(shot.photo.make, shot.photo.model) for shot in shots}
    if len(bodies) > 1:
        raise fail("frames_differ.cameras", cameras=", ".join(sorted(" ".join(b) for b in bodies)))
    first = shots[0].photo
    for shot in shots[1:]:
        photo = shot.photo
        check_unit(first.name, (first.unit, first.active_area), photo.name, (photo.unit, photo.active_area))
    if len({shot.means.white is None for shot in shots}) > 1:
        raise some_white()


def input_hash(role: str, spec: Any) -> dict[str, str]:
    """SHA-256 of the file behind a lamp or chart spec, if there is one."""
    path = spec_file(role, spec)
    try:
        return {} if path is None else {f"{role}: {path.name}": hashlib.sha256(path.read_bytes()).hexdigest()}
    except OSError:
        return {}  # reading the table later reports the error


def spec_file(role: str, spec: Any) -> Path | None:
    """The file that a lamp or chart spec names; None for a known name, an object or a missing file."""
    if not isinstance(spec, str | OsPath):
        return None
    text = text_of(spec)
    name = chart_parts(text)[1] if role == CHART_TABLE else "" if is_lamp_name(text) else text
    return Path(name) if name and is_file(name) else None
