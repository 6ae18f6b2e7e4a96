"""The tasks of the page, each a function of an order; they run in a process whose current folder is the session's.

An order is the JSON that the page sent. It names files by their numbers, lamps and charts by the names of the lists:
no text of it ever becomes a path. A file that was sent keeps its own name, in a folder of its number, for the report.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

from camssf.errors import CalibrationError, InvalidArgument, OutOfMemory, RawError
from camssf.files import write_file
from camssf.grid import WAVELENGTHS

Json: TypeAlias = dict[str, Any]
Tell: TypeAlias = Callable[[str, float], None]

RESULT = Path("result")
"""The folder of the newest report, in the session's folder."""
SMALLEST_REGION = 12
"""Smallest side of a white region on the chart, px: `measure_regions` needs as much."""


UPLOADS = {"photo": ".dng", "layout": ".json", "table": ".csv"}
"""Kinds of files from the page, and the ending that their names get if they have another."""
LONGEST_NAME = 60
"""Characters; at most four bytes each, and a file system takes 255."""
_UNSAFE = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|\u202a-\u202e\u2066-\u2069\ud800-\udfff]')
"""Separators and what Windows forbids; control characters, also those that turn text around; lone surrogates."""


def stored_name(kind: str, name: str) -> str:
    """The name under which a file from the page is stored: its own, without what could mean something in a path."""
    plain = _UNSAFE.sub("_", name).lstrip(". -")[:LONGEST_NAME] or kind
    return plain if plain.lower().endswith(UPLOADS[kind]) else plain + UPLOADS[kind]


def uploaded(kind: str, number: Any) -> Path:
    """A file that the page sent, by its number.

    Raises:
        InvalidArgument: there is no such file.
    """
    found = list(Path(f"{kind}-{number}").glob("*")) if isinstance(number, int) else []
    if not found:
        raise InvalidArgument(f"This tab has no {kind} {number!r}.", f"Drop the {kind} again.")
    return found[0]


def find(order: Json, tell: Tell) -> Json:
    """Read a photo, write its preview, and search for the chart.

    Returns:
        Size and orientation; the chart's corners and its white patch, or the reason why it was not found.
    """
    from camssf.photo.find.pose import find_chart
    from camssf.photo.read.raw import read_raw
    from camssf.report.previews import photo_preview
    from camssf.spectra import read_chart

    number = order["photo"]
    path = uploaded("photo", number)
    tell("reading the photo", 0.1)
    try:
        mosaic = read_raw(path)
    except RawError:
        path.unlink()
        raise
    preview, table = f"preview-{number}.jpg", read_chart(_chart(order))
    write_file(preview, photo_preview(mosaic) or b"")
    height, width = mosaic.samples.shape
    found: Json = {
        "preview": preview, "width": width, "height": height, "orientation": mosaic.orientation,
        "camera": f"{mosaic.make} {mosaic.model}".strip(), "corners": None, "white": None, "problem": None,
    }  # fmt: skip
    tell("looking for the chart", 0.5)
    try:
        pose = find_chart(mosaic, table)
    except CalibrationError as error:
        return found | {"problem": _problem(error)}
    patch = pose.patches[table.white]
    low, high = patch.min(axis=0), patch.max(axis=0)
    centre, side = (low + high) / 2, max(SMALLEST_REGION, 0.5 * float((high - low).min()))
    white = [*(centre - side / 2).tolist(), side, side]
    visible = (WAVELENGTHS >= 450) & (WAVELENGTHS <= 650)
    reflectance = round(float(table.values[table.white][visible].mean()), 2)
    return found | {"corners": pose.corners.tolist(), "white": white, "reflectance": reflectance}


def chart(order: Json, tell: Tell) -> Json:
    """Check the files of a chart of the user's own; returns its layout's name and its number of patches."""
    from camssf.spectra import read_chart

    table = read_chart(_chart(order))
    return {"layout": table.layout.name, "patches": len(table.patches)}


def calibrate(order: Json, tell: Tell) -> Json:
    """Calibrate the camera from the photos and write the report.

    Returns:
        The verdict with its reasons, and the names of the files; or the refusal's reason.
    """
    from camssf.calibration import attempt
    from camssf.photo.shot import Shot
    from camssf.report.build import report
    from camssf.report.provenance import read_provenance
    from camssf.result import Refusal

    def frame(shot: Json, role: str) -> Path | None:
        return None if shot.get(role) is None else uploaded("photo", shot[role])

    shots = [
        Shot(
            uploaded("photo", shot["photo"]), listed_lamp(shot), frame(shot, "white"), frame(shot, "dark"),
            shot.get("corners"),
        )
        for shot in order["shots"]
    ]  # fmt: skip
    found = attempt(shots, chart=_chart(order), progress=tell)
    if isinstance(found, Refusal) and isinstance(found.error, RawError):
        raise found.error
    tell("writing the report", 0.97)
    document = found.document()
    pages = report(document, found.previews, provenance=read_provenance([shot.photo for shot in shots]))
    shutil.rmtree(RESULT, ignore_errors=True)
    files = [path.name for path in pages.save(RESULT)]
    verdict = document["verdict"]
    reasons = [f"{each['message']} {each['advice']}" for each in verdict["reasons"]]
    return {"status": verdict["status"], "reasons": reasons, "files": files}


def colour(order: Json, tell: Tell) -> Json:
    """The colour and the reflectance spectrum of a region of a photo.

    Returns:
        Lab with its standard deviations, an sRGB colour for the screen, and the name of the spectrum's picture.
    """
    import numpy as np

    from camssf.colour import LitSurfaces, View, camera_of_result, read_prior, spectrum, standard_colour
    from camssf.colour.reach import check_reach
    from camssf.colour.reflectance import FAR
    from camssf.colour.regions import measure_photo
    from camssf.exports import read_result as read_curves
    from camssf.report.sections.patches import hexed
    from camssf.report.spectrum_plot import spectrum_picture
    from camssf.spectra.appearance import srgb

    result = _result()
    camera, curves = camera_of_result(result), read_curves(result)
    path, lamp = uploaded("photo", order["photo"]), listed_lamp(order)
    tell("measuring the region", 0.2)
    region, white = _rectangle(order["region"]), _rectangle(order["white"])
    share = float(order["reflectance"])
    found = measure_photo(path, (result["camera"], curves.camera), [region], white, reflectance=share)
    tell("computing the colour", 0.5)
    view = View("1931", "D65")
    signals, errors = found.signals, found.errors
    colours = standard_colour(camera, lamp, signals, errors, reference=found.reference, view=view)
    check_reach(colours.reach)
    tell("computing the spectrum", 0.8)
    lit = LitSurfaces(lamp, signals, errors, found.reference)
    spectra = spectrum(camera, lit, prior=read_prior("general"), view=view)
    picture = f"spectrum-{order['photo']}.svg"
    write_file(picture, spectrum_picture(spectra, ".svg"))
    return {
        "lab": colours.lab[0].tolist(),
        "lab_std": (colours.lab_covariance[0].diagonal() ** 0.5).tolist(),
        "srgb": hexed(np.clip(srgb(colours.xyz[0]), 0.0, 1.0).tolist()),
        "spectrum": picture,
        "far": bool(spectra.distance[0] > FAR),
    }


def export(order: Json, tell: Tell) -> Json:
    """Write the result in another program's format; returns the file's name."""
    from camssf.exports import FORMATS
    from camssf.exports import export as write

    to = order["to"]
    if to not in FORMATS:
        raise InvalidArgument(f"There is no export to {to!r}.", f"Take one of {', '.join(FORMATS)}.")
    content = write(_result(), to)
    name = f"camera-{to}.{ENDINGS[to]}"
    write_file(name, content)
    return {"file": name}


def make_key(order: Json, tell: Tell) -> Json:
    """Make a pair of keys for passports; returns the files' names."""
    from camssf.documents.keys import PRIVATE, PUBLIC
    from camssf.documents.keys import make_key as make

    for name in (PRIVATE, PUBLIC):
        Path(name).unlink(missing_ok=True)
    make(Path(), _passphrase(order))
    return {"files": [PRIVATE, PUBLIC]}


def passport(order: Json, tell: Tell) -> Json:
    """Sign the result with the private key that the page sent; the key's file is removed at once."""
    from camssf.documents.keys import read_private
    from camssf.documents.passport import PassportRequest, create_passport, sign
    from camssf.photo.read.unit import Unit

    data = _result_path().read_bytes()
    secret = Path(".signing-key.pem")
    try:
        with open(os.open(secret, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as stream:
            stream.write(str(order["key"]))
        key = read_private(secret, _passphrase(order))
    finally:
        secret.unlink(missing_ok=True)
    photos = [uploaded("photo", number) for number in order["photos"]]
    request = PassportRequest(unit=Unit(serial=str(order.get("serial") or "")))
    write_file("camera.jws", sign(create_passport(data, request, photos=photos), key))
    return {"file": "camera.jws"}


TASKS: Mapping[str, Callable[[Json, Tell], Json]] = {
    "find": find, "chart": chart, "calibrate": calibrate, "colour": colour, "export": export, "key": make_key,
    "passport": passport,
}  # fmt: skip
ENDINGS = {
    "rawtoaces": "json", "dcamprof": "json", "spectacle": "csv", "csv": "csv", "dcp": "dcp", "icc": "icc",
    "clf": "clf", "colour": "csv",
}  # fmt: skip


def perform(name: str, order: Json, tell: Tell) -> Json:
    """Run a task; an error becomes plain data, without a traceback."""
    try:
        return {"value": TASKS[name](order, tell)}
    except CalibrationError as error:
        return {"error": _problem(error)}
    except MemoryError:
        words = "The photo does not fit into this computer's free memory."
        return {"error": {"code": OutOfMemory.code, "words": f"{words} Close other programs and try again."}}
    except Exception as error:
        words = f"{type(error).__name__}: {error}. This is camssf's fault: report it, and reload the page."
        return {"error": {"code": "bug", "words": words}}


def _problem(error: CalibrationError) -> Json:
    return {"code": error.code, "words": str(error)}


def listed_lamp(order: Json) -> str:
    """The lamp of an order: a name of the list or "auto", never a file."""
    from camssf.spectra import lamp_names
    from camssf.spectra.lamps import AUTO

    name = order.get("lamp", AUTO)
    if name != AUTO and name not in lamp_names():
        raise InvalidArgument(f"There is no lamp {name!r} in the list.", "Choose one from it, or leave it unknown.")
    return str(name)


def _chart(order: Json) -> str:
    """The chart of an order: a name of the list, or {"layout": number, "table": number} of the user's own files."""
    from camssf.spectra import chart_names

    chart = order.get("chart", "classic24")
    if isinstance(chart, dict):
        kinds = [kind for kind in ("layout", "table") if chart.get(kind) is not None]
        return ":".join(str(uploaded(kind, chart[kind])) for kind in kinds)
    if chart not in chart_names():
        raise InvalidArgument(f"There is no chart {chart!r} in the list.", "Choose one from it.")
    return str(chart)


def _result_path() -> Path:
    path = RESULT / "result.json"
    if not path.is_file():
        raise InvalidArgument("This tab has no result yet.", "Calibrate first.")
    return path


def _result() -> Json:
    return _read_result(_result_path(), _result_path().stat().st_mtime_ns)


@lru_cache(maxsize=1)
def _read_result(path: Path, changed: int) -> Json:
    from camssf.documents.result_json import read_document

    return read_document(path)


def _rectangle(numbers: Any) -> tuple[float, float, float, float]:
    x, y, w, h = map(float, numbers)
    return x, y, w, h


def _passphrase(order: Json) -> bytes | None:
    return str(order.get("passphrase") or "").encode() or None
