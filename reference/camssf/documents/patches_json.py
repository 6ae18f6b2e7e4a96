"""Writes and reads a capture as "camssf-patches/1": measured patches as plain data, solvable without other files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.capture import Capture, MeasuredShot, Photo, check_alike, check_target
from camssf.photo.find.pose import Pose
from camssf.photo.patches import LENS_SHADING, FrameMeans, PatchMeans
from camssf.photo.read.colour_matrix import WHITE_POINTS, ColourMatrix
from camssf.photo.read.unit import Area, Unit
from camssf.photo.shot import MOST_SHOTS
from camssf.spectra import ChartTable, Lamp, Light
from camssf.spectra.lamps import UNNAMED, unnamed_light
from camssf.spectra.layouts import LAYOUTS, ChartLayout, layout_from
from camssf.version import __version__

Json: TypeAlias = dict[str, Any]

MOST_PATCHES = 1000
MOST = 1e12
"""Largest number that is accepted; sums of squares of much larger ones would overflow."""
UNIT = ("camera_id", "lens", "focal_length", "aperture")
"""Fields of a photo's unit in a patches document, in addition to make and model."""


def patches_document(capture: Capture) -> Json:
    """The capture as plain data."""
    return {
        "format": "camssf-patches/1",
        "generator": {"name": "camssf", "version": __version__},
        "chart": _chart_document(capture.chart),
        "white_reflectance": capture.white_reflectance,
        "files": capture.files,
        "shots": [
            {
                "lamp": _lamp_document(shot.lamp),
                "photo": _photo_document(shot.photo),
                "white": _photo_document(shot.white) if shot.white else None,
                "dark": _photo_document(shot.dark) if shot.dark else None,
                "pose": plain(vars(shot.pose)),
                "lens_shading": shot.lens_shading,
                "saturation": shot.means.saturation,
                "black": shot.means.black.tolist(),
                "means": {
                    frame: plain(vars(means)) if (means := getattr(shot.means, frame)) else None
                    for frame in ("chart", "white", "dark")
                },
            }
            for shot in capture.shots
        ],
    }


def read_patches(document: Json) -> Capture:
    """The capture of a "camssf-patches/1" document.

    Raises:
        InvalidArgument: another format, or a field is missing or of the wrong kind.
    """
    if not isinstance(document, dict) or document.get("format") != "camssf-patches/1":
        raise InvalidArgument("This is not a camssf-patches/1 document.", "Make one with `camssf patches`.")
    try:
        table = _table_from(document["chart"])
        shots = tuple(_shot_from(entry, table) for entry in document["shots"])
        _need(0 < len(shots) <= MOST_SHOTS, "shots", f"must hold 1 to {MOST_SHOTS}")
        files = {_text(key, "files"): _text(value, "files") for key, value in document["files"].items()}
        check_alike(shots)
        return Capture(shots, table, check_target(document["white_reflectance"], shots[0].white is not None), files)
    except KeyError as error:
        raise InvalidArgument(
            f"The camssf-patches/1 document lacks {error}.", "Make it anew with `camssf patches`."
        ) from error
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InvalidArgument(
            f"The camssf-patches/1 document is damaged: {error}.", "Make it anew with `camssf patches`."
        ) from error


def _shot_from(entry: Mapping[str, Any], table: ChartTable) -> MeasuredShot:
    """One shot of a patches document, of the chart of `table`."""
    n = len(table.patches)
    frames = {name: _means_from(entry["means"][name], name, n) for name in ("chart", "white", "dark")}
    photos = {role: _photo_from(entry[role], role) for role in ("photo", "white", "dark")}
    pose, lamp = entry["pose"], entry["lamp"]
    chart, photo = frames["chart"], photos["photo"]
    if chart is None or photo is None:
        raise ValueError("a shot has no chart photo")
    for role in ("white", "dark"):
        _need((frames[role] is None) == (photos[role] is None), role, "must be there as a photo and as means, or not")
    _need(pose["layout"] == table.layout.name, "pose.layout", "must be the chart's")
    black, saturation = (
        _numbers(entry["black"], "black", (3,)),
        float(_numbers(entry["saturation"], "saturation", ())),
    )
    _need(bool((saturation > black).all()), "saturation", "must lie above black")
    place = Pose(
        pose["layout"],
        _numbers(pose["corners"], "pose.corners", (4, 2)),
        _numbers(pose["patches"], "pose.patches", (n, 4, 2)),
        int(pose["quarter_turns"]) % 4,
        _text(pose["method"], "pose.method"),
        float(_numbers(pose["score"], "pose.score", ())),
        tuple(_text(note, "pose.notes") for note in pose["notes"]),
    )
    means = PatchMeans(chart, frames["white"], frames["dark"], black, saturation)
    shading = entry.get("lens_shading", LENS_SHADING[0])
    _need(shading in LENS_SHADING, "lens_shading", f"must be {' or '.join(LENS_SHADING)}")
    return MeasuredShot(_light_from(lamp), photo, photos["white"], photos["dark"], place, means, None, shading)


def _lamp_document(lamp: Light) -> Json:
    """A shot's lamp; `tolerance_kelvin` only if given."""
    if not isinstance(lamp, Lamp):
        return {"name": lamp.name}
    return {key: value for key, value in plain(vars(lamp)).items() if key != "tolerance_kelvin" or value is not None}


def _light_from(entry: Mapping[str, Any]) -> Light:
    """A shot's lamp; an unnamed light has only the field `name`, one of UNNAMED."""
    if entry.keys() == {"name"} and entry["name"] in UNNAMED:
        return unnamed_light(entry["name"])
    modes = np.asarray(entry["modes"], float).reshape(-1, WAVELENGTHS.size)
    kelvin = entry.get("tolerance_kelvin")
    return Lamp(
        _text(entry["name"], "lamp.name"),
        _numbers(entry["values"], "lamp.values", (WAVELENGTHS.size,)),
        float(_numbers(entry["tolerance"], "lamp.tolerance", (), least=0.0)),
        _numbers(modes, "lamp.modes", modes.shape),
        _text(entry["source"], "lamp.source"),
        None if kelvin is None else float(_numbers(kelvin, "lamp.tolerance_kelvin", (), least=0.0)),
    )


def _chart_document(table: ChartTable) -> Json:
    """A chart table; `geometry` only for a layout of the user's own."""
    own = {} if table.layout.shipped else {"geometry": table.layout.document()}
    return plain(vars(table) | {"layout": table.layout.name}) | own


def _layout_from(entry: Mapping[str, Any]) -> ChartLayout:
    name = _text(entry["layout"], "chart.layout")
    if "geometry" in entry:
        layout = layout_from(entry["geometry"], "chart.geometry")
        _need(layout.name == name, "chart.layout", "must be the name in chart.geometry")
        count = layout.columns * layout.rows
        _need(len(entry["patches"]) == count, "chart.patches", f"must hold the {count} of chart.geometry")
        return layout
    _need(name in LAYOUTS, "chart.layout", "is no layout that camssf knows, and chart.geometry is missing")
    return LAYOUTS[name]


def _table_from(entry: Mapping[str, Any]) -> ChartTable:
    """The chart table of a patches document."""
    patches = tuple(_text(name, "chart.patches") for name in entry["patches"])
    n = len(patches)
    _need(0 < n <= MOST_PATCHES, "chart.patches", f"must hold 1 to {MOST_PATCHES}")
    white = entry["white"]
    layout = _layout_from(entry)
    _need(isinstance(white, int) and 0 <= white < n, "chart.white", f"must be a number from 0 to {n - 1}")
    return ChartTable(
        _text(entry["name"], "chart.name"),
        _text(entry["table"], "chart.table"),
        layout,
        patches,
        _numbers(entry["values"], "chart.values", (n, WAVELENGTHS.size), least=0.0, most=2.0),
        _numbers(entry["tolerance"], "chart.tolerance", (n,), least=0.0),
        white,
        _text(entry["source"], "chart.source"),
    )


def _means_from(entry: Mapping[str, Any] | None, name: str, n: int) -> FrameMeans | None:
    if entry is None:
        return None
    least = {"standard_error": 0.0, "count": 1.0, "clipped": 0.0, "dead": 0.0}
    most = {"count": 1e15, "clipped": 1.0, "dead": 1.0}
    fields: dict[str, Any] = {
        key: _numbers(
            entry[key],
            f"{name} {key}",
            (n, 2 if key == "greens" else 3),
            least=least.get(key, -MOST),
            most=most.get(key, MOST),
        )
        for key in FrameMeans.__annotations__
    }
    fields["count"] = fields["count"].astype(np.int64)
    return FrameMeans(**fields)


def _photo_document(photo: Photo) -> Json:
    """A photo as plain data; `levels` and `unique_model` only if not empty.

    The body's serial number is left out, because these documents are shared.
    """
    facts = {key: value for key, value in vars(photo).items() if key not in ("levels", "unique_model") or value}
    facts["colour_matrices"] = [plain(vars(each)) for each in photo.colour_matrices]
    return facts | {"unit": {key: value for key, value in vars(photo.unit).items() if key in UNIT and value}}


def _unit_from(entry: Any, role: str) -> Unit:
    _need(isinstance(entry, dict) and entry.keys() <= set(UNIT), f"{role}.unit", f"may hold {', '.join(UNIT)}")
    camera_id, lens = (_text(entry.get(key, ""), f"{role}.unit.{key}") for key in UNIT[:2])
    focal_length, aperture = (
        float(_numbers(entry[key], f"{role}.unit.{key}", (), least=1e-9)) if key in entry else None
        for key in UNIT[2:]
    )
    return Unit(camera_id=camera_id, lens=lens, focal_length=focal_length, aperture=aperture)


def _area_from(entry: Any, role: str) -> Area | None:
    if entry is None:
        return None
    top, left, bottom, right = (int(side) for side in _numbers(entry, f"{role}.active_area", (4,), least=0.0))
    return top, left, bottom, right


def _photo_from(entry: Mapping[str, Any] | None, role: str) -> Photo | None:
    if entry is None:
        return None
    texts = {key: _text(entry[key], f"{role}.{key}") for key in ("name", "make", "model", "sha256")}
    _need(re.fullmatch("[0-9a-f]{64}", texts["sha256"]) is not None, f"{role}.sha256", "must be 64 hex digits")
    for key in ("width", "height", "orientation"):
        _need(isinstance(entry[key], int) and entry[key] > 0, f"{role}.{key}", "must be a whole number above 0")
    exposure, iso = (
        None if entry[key] is None else float(_numbers(entry[key], f"{role}.{key}", (), least=0.0))
        for key in ("exposure", "iso")
    )
    return Photo(
        width=entry["width"],
        height=entry["height"],
        orientation=entry["orientation"],
        gain_map=bool(entry["gain_map"]),
        colour_matrices=tuple(
            ColourMatrix(
                _light_source(each["light"]),
                tuple(_numbers(each["values"], f"{role}.colour_matrices", (9,)).tolist()),
            )
            for each in entry["colour_matrices"]
        ),
        unit=_unit_from(entry.get("unit", {}), role),
        active_area=_area_from(entry.get("active_area"), role),
        exposure=exposure,
        iso=iso,
        levels=_text(entry.get("levels", ""), f"{role}.levels"),
        unique_model=_text(entry.get("unique_model", ""), f"{role}.unique_model"),
        **texts,
    )


def _light_source(name: Any) -> str:
    _need(name in WHITE_POINTS, "colour_matrices", f"must be of one of {', '.join(WHITE_POINTS)}")
    return str(name)


def _numbers(value: Any, name: str, shape: tuple[int, ...], *, least: float = -MOST, most: float = MOST) -> Floats:
    array = np.asarray(value, dtype=np.float64)
    _need(array.shape == shape, name, f"has shape {array.shape}, not {shape}")
    _need(bool(np.isfinite(array).all()), name, "is not finite")
    _need(bool((array >= least).all() and (array <= most).all()), name, f"must lie between {least:g} and {most:g}")
    return array


def _text(value: Any, name: str) -> str:
    _need(isinstance(value, str) and len(value) <= 4096, name, "must be a short text")
    return str(value)


def _need(right: bool, name: str, what: str) -> None:
    if not right:
        raise InvalidArgument(
            f"The field {name} {what}.", "Correct it, or make the document anew with `camssf patches`."
        )


def plain(fields: Mapping[str, Any]) -> Json:
    """A product's fields, with lists in place of arrays and tuples."""
    return {
        key: value.tolist() if isinstance(value, np.ndarray) else list(value) if isinstance(value, tuple) else value
        for key, value in fields.items()
    }
