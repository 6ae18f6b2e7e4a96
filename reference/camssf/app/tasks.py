"""The tasks of the page, each a function of the session's folder and an order; they run in a process of their own.

An order is the JSON that the page sent. It names photos by their numbers, lamps and charts by the names of the lists:
no text of it ever becomes a path.
"""

from __future__ import annotations

import os
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

RESULT = "result"
"""The folder of the newest report, in the session's folder."""
SMALLEST_REGION = 12
"""Smallest side of a white region on the chart, px: `measure_regions` needs as much."""


def photo_path(folder: Path, number: Any) -> Path:
    """The file of a session's photo.

    Raises:
        InvalidArgument: there is no such photo.
    """
    path = folder / f"photo-{number}.dng"
    if not isinstance(number, int) or not path.is_file():
        raise InvalidArgument(f"This tab has no photo {number!r}.", "Drop the photo again.")
    return path


def find(folder: Path, order: Json, tell: Tell) -> Json:
    """Read a photo, write its preview, and search for the chart.

    Returns:
        Size and orientation; the chart's corners and its white patch, or the reason why it was not found.
    """
    from camssf.photo.find.pose import find_chart
    from camssf.photo.read.raw import read_raw
    from camssf.report.previews import photo_preview
    from camssf.spectra import read_chart

    number = order["photo"]
    path = photo_path(folder, number)
    tell("reading the photo", 0.1)
    try:
        mosaic = read_raw(path)
    except RawError:
        path.unlink()
        raise
    preview, table = f"preview-{number}.jpg", read_chart(_listed_chart(order))
    write_file(folder / preview, photo_preview(mosaic) or b"")
    height, width = mosaic.samples.shape
    found: Json = {
        "preview": preview, "width": width, "height": height, "orientation": mosaic.orientation,
        "camera": f"{mosaic.make} {mosaic.model}".strip(), "corners": None, "white": None, "problem": None,
    }  # fmt: skip
    tell("looking for the chart", 0.5)
    try:
        pose = find_chart(mosaic, table)
    except CalibrationError as error:
        return found | {"problem": _problem(error, folder)}
    patch = pose.patches[table.white]
    low, high = patch.min(axis=0), patch.max(axis=0)
    centre, side = (low + high) / 2, max(SMALLEST_REGION, 0.5 * float((high - low).min()))
    white = [*(centre - side / 2).tolist(), side, side]
    visible = (WAVELENGTHS >= 450) & (WAVELENGTHS <= 650)
    reflectance = round(float(table.values[table.white][visible].mean()), 2)
    return found | {"corners": pose.corners.tolist(), "white": white, "reflectance": reflectance}


def calibrate(folder: Path, order: Json, tell: Tell) -> Json:
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
        return None if shot.get(role) is None else photo_path(folder, shot[role])

    shots = [
        Shot(
            photo_path(folder, shot["photo"]), listed_lamp(shot), frame(shot, "white"), frame(shot, "dark"),
            shot.get("corners"),
        )
        for shot in order["shots"]
    ]  # fmt: skip
    out = folder / RESULT
    shutil.rmtree(out, ignore_errors=True)
    found = attempt(shots, chart=_listed_chart(order), progress=tell)
    if isinstance(found, Refusal) and isinstance(found.error, RawError):
        raise found.error
    tell("writing the report", 0.97)
    document = found.document()
    pages = report(document, found.previews, provenance=read_provenance([shot.photo for shot in shots]))
    files = [path.name for path in pages.save(out)]
    verdict = document["verdict"]
    reasons = [f"{each['message']} {each['advice']}".replace(f"{folder}{os.sep}", "") for each in verdict["reasons"]]
    return {"status": verdict["status"], "reasons": reasons, "files": files}


def colour(folder: Path, order: Json, tell: Tell) -> Json:
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

    result = _result(folder)
    camera, curves = camera_of_result(result), read_curves(result)
    path, lamp = photo_path(folder, order["photo"]), listed_lamp(order)
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
    write_file(folder / picture, spectrum_picture(spectra, ".svg"))
    return {
        "lab": colours.lab[0].tolist(),
        "lab_std": (colours.lab_covariance[0].diagonal() ** 0.5).tolist(),
        "srgb": hexed(np.clip(srgb(colours.xyz[0]), 0.0, 1.0).tolist()),
        "spectrum": picture,
        "far": bool(spectra.distance[0] > FAR),
    }


def export(folder: Path, order: Json, tell: Tell) -> Json:
    """Write the result in another program's format; returns the file's name."""
    from camssf.exports import FORMATS
    from camssf.exports import export as write

    to = order["to"]
    if to not in FORMATS:
        raise InvalidArgument(f"There is no export to {to!r}.", f"Take one of {', '.join(FORMATS)}.")
    content = write(_result(folder), to)
    name = f"camera-{to}.{ENDINGS[to]}"
    write_file(folder / name, content)
    return {"file": name}


def make_key(folder: Path, order: Json, tell: Tell) -> Json:
    """Make a pair of keys for passports; returns the files' names."""
    from camssf.documents.keys import PRIVATE, PUBLIC
    from camssf.documents.keys import make_key as make

    for name in (PRIVATE, PUBLIC):
        (folder / name).unlink(missing_ok=True)
    make(folder, _passphrase(order))
    return {"files": [PRIVATE, PUBLIC]}


def passport(folder: Path, order: Json, tell: Tell) -> Json:
    """Sign the result with the private key that the page sent; the key's file is removed at once."""
    from camssf.documents.keys import read_private
    from camssf.documents.passport import PassportRequest, create_passport, sign
    from camssf.photo.read.unit import Unit

    data = _result_path(folder).read_bytes()
    secret = folder / ".signing-key.pem"
    try:
        with open(os.open(secret, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as stream:
            stream.write(str(order["key"]))
        key = read_private(secret, _passphrase(order))
    finally:
        secret.unlink(missing_ok=True)
    photos = [photo_path(folder, number) for number in order["photos"]]
    request = PassportRequest(unit=Unit(serial=str(order.get("serial") or "")))
    write_file(folder / "camera.jws", sign(create_passport(data, request, photos=photos), key))
    return {"file": "camera.jws"}


TASKS: Mapping[str, Callable[[Path, Json, Tell], Json]] = {
    "find": find, "calibrate": calibrate, "colour": colour, "export": export, "key": make_key, "passport": passport,
}  # fmt: skip
ENDINGS = {
    "rawtoaces": "json", "dcamprof": "json", "spectacle": "csv", "csv": "csv", "dcp": "dcp", "icc": "icc",
    "clf": "clf", "colour": "csv",
}  # fmt: skip


def perform(name: str, folder: Path, order: Json, tell: Tell) -> Json:
    """Run a task; an error becomes plain data, without a traceback and without the folder's path."""
    try:
        return {"value": TASKS[name](folder, order, tell)}
    except CalibrationError as error:
        return {"error": _problem(error, folder)}
    except MemoryError:
        words = "The photo does not fit into this computer's free memory."
        return {"error": {"code": OutOfMemory.code, "words": f"{words} Close other programs and try again."}}
    except Exception as error:
        words = f"{type(error).__name__}: {error}. This is camssf's fault: report it, and reload the page."
        return {"error": {"code": "bug", "words": words.replace(f"{folder}{os.sep}", "")}}


def _problem(error: CalibrationError, folder: Path) -> Json:
    return {"code": error.code, "words": str(error).replace(f"{folder}{os.sep}", "")}


def listed_lamp(order: Json) -> str:
    """The lamp of an order: a name of the list or "auto", never a file."""
    from camssf.spectra import lamp_names
    from camssf.spectra.lamps import AUTO

    name = order.get("lamp", AUTO)
    if name != AUTO and name not in lamp_names():
        raise InvalidArgument(f"There is no lamp {name!r} in the list.", "Choose one from it, or leave it unknown.")
    return str(name)


def _listed_chart(order: Json) -> str:
    from camssf.spectra import chart_names

    name = order.get("chart", "classic24")
    if name not in chart_names():
        raise InvalidArgument(f"There is no chart {name!r} in the list.", "Choose one from it.")
    return str(name)


def _result_path(folder: Path) -> Path:
    path = folder / RESULT / "result.json"
    if not path.is_file():
        raise InvalidArgument("This tab has no result yet.", "Calibrate first.")
    return path


def _result(folder: Path) -> Json:
    return _read_result(_result_path(folder), _result_path(folder).stat().st_mtime_ns)


@lru_cache(maxsize=1)
def _read_result(path: Path, changed: int) -> Json:
    from camssf.documents.result_json import read_document

    return read_document(path)


def _rectangle(numbers: Any) -> tuple[float, float, float, float]:
    x, y, w, h = map(float, numbers)
    return x, y, w, h


def _passphrase(order: Json) -> bytes | None:
    return str(order.get("passphrase") or "").encode() or None
