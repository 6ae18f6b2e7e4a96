"""The tasks of the page, each a function of a checked order (`camssf_app.orders`).

They run in a process whose current folder is the session's.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from camssf.errors import CalibrationError, OutOfMemory, RawError
from camssf.files import write_file
from camssf.grid import WAVELENGTHS
from camssf.progress import Progress
from camssf_app.orders import (
    RESULT,
    CalibrateOrder,
    ChartOrder,
    ColourOrder,
    ExportOrder,
    FindOrder,
    KeyOrder,
    Order,
    PassportOrder,
    listed_chart,
    result_path,
    uploaded,
)

if TYPE_CHECKING:
    from camssf.result import Result

Json: TypeAlias = dict[str, Any]
"""The answer of a task, for the page."""
SMALLEST_REGION = 12
"""Smallest side of a white region on the chart, px: `measure_regions` needs as much."""


def find(order: FindOrder, progress: Progress) -> Json:
    """Read a photo, write its preview, and search for the chart.

    Returns:
        Size and orientation; the chart's corners and its white patch, or the reason why it was not found.
    """
    from camssf.photo.find.pose import find_chart
    from camssf.photo.read.raw import read_raw
    from camssf.report.previews import photo_preview
    from camssf.spectra import read_chart

    path = uploaded("photo", order.photo)
    progress("reading the photo", 0.1)
    try:
        mosaic = read_raw(path)
    except RawError:
        path.unlink()
        raise
    preview, table = f"preview-{order.photo}.jpg", read_chart(listed_chart(order.chart))
    write_file(preview, photo_preview(mosaic) or b"")
    height, width = mosaic.samples.shape
    answer: Json = {
        "preview": preview, "width": width, "height": height, "orientation": mosaic.orientation,
        "camera": f"{mosaic.make} {mosaic.model}".strip(), "corners": None, "white": None, "problem": None,
    }  # fmt: skip
    progress("looking for the chart", 0.5)
    try:
        pose = find_chart(mosaic, table)
    except CalibrationError as error:
        return answer | {"problem": _problem(error)}
    patch = pose.patches[table.white]
    low, high = patch.min(axis=0), patch.max(axis=0)
    centre, side = (low + high) / 2, max(SMALLEST_REGION, 0.5 * float((high - low).min()))
    white = [*(centre - side / 2).tolist(), side, side]
    visible = (WAVELENGTHS >= 450) & (WAVELENGTHS <= 650)
    reflectance = round(float(table.values[table.white][visible].mean()), 2)
    return answer | {"corners": pose.corners.tolist(), "white": white, "reflectance": reflectance}


def chart(order: ChartOrder, progress: Progress) -> Json:
    """Check the files of a chart of the user's own; returns its layout's name and its number of patches."""
    from camssf.spectra import read_chart

    table = read_chart(listed_chart(order.chart))
    return {"layout": table.layout.name, "patches": len(table.patches)}


def calibrate(order: CalibrateOrder, progress: Progress) -> Json:
    """Calibrate the camera from the photos and write the report.

    Returns:
        The verdict with its reasons, and the names of the files; or the refusal's reason.
    """
    from camssf.calibration import attempt
    from camssf.photo.shot import Shot
    from camssf.progress import part_of
    from camssf.report.build import report
    from camssf.report.provenance import read_provenance

    def frame(number: int | None) -> Path | None:
        return None if number is None else uploaded("photo", number)

    shots = [
        Shot(uploaded("photo", shot.photo), shot.lamp, frame(shot.white), frame(shot.dark), shot.corners)
        for shot in order.shots
    ]
    result = attempt(shots, chart=listed_chart(order.chart), progress=part_of(progress, 0.0, 0.9))
    if isinstance(result.error, RawError):
        raise result.error
    progress("writing the report", 0.9)
    pages = report(result, result.previews, provenance=read_provenance([shot.photo for shot in shots]))
    shutil.rmtree(RESULT, ignore_errors=True)
    files = [path.name for path in pages.save(RESULT)]
    reasons = [f"{reason.message} {reason.advice}" for reason in result.verdict.reasons]
    return {"status": result.verdict.status, "reasons": reasons, "files": files}


def colour(order: ColourOrder, progress: Progress) -> Json:
    """The colour and the reflectance spectrum of a region of a photo.

    Returns:
        Lab with its standard deviations, an sRGB colour for the screen, the name of the spectrum's picture, and what
        is known of a light that was not named.
    """
    import numpy as np

    from camssf.colorimetry import srgb
    from camssf.documents.unnamed_light import weighed_kinds_in_words
    from camssf.report.sections.patches import hexed
    from camssf_colour import LitSurfaces, View, camera_of_result, read_prior, spectrum, standard_colour
    from camssf_colour.camera import make_and_model
    from camssf_colour.reach import check_reach
    from camssf_colour.reflectance import FAR
    from camssf_colour.regions import measure_photo
    from camssf_colour.spectrum_plot import spectrum_svg

    result = _result()
    camera, path, lamp = camera_of_result(result), uploaded("photo", order.photo), order.lamp
    progress("measuring the region", 0.2)
    whose, share = make_and_model(result), order.reflectance
    measured = measure_photo(path, whose, [order.region], order.white, reflectance=share)
    progress("computing the colour", 0.5)
    view = View("1931", "D65")
    signals, errors = measured.signals, measured.errors
    colours = standard_colour(camera, lamp, signals, errors, reference=measured.reference, view=view)
    check_reach(colours.reach)
    progress("computing the spectrum", 0.8)
    lit = LitSurfaces(lamp, signals, errors, measured.reference)
    spectra = spectrum(camera, lit, prior=read_prior("general"), view=view)
    picture = f"spectrum-{order.photo}.svg"
    write_file(picture, spectrum_svg(spectra))
    return {
        "lab": colours.lab[0].tolist(),
        "lab_std": (colours.lab_covariance[0].diagonal() ** 0.5).tolist(),
        "srgb": hexed(np.clip(srgb(colours.xyz[0]), 0.0, 1.0).tolist()),
        "spectrum": picture,
        "far": bool(spectra.distance[0] > FAR),
        "light": weighed_kinds_in_words(colours.lamps),
    }


def export(order: ExportOrder, progress: Progress) -> Json:
    """Write the result in another program's format; returns the file's name."""
    from camssf.exports import export as write

    to = order.to
    content = write(_result(), to)
    name = f"camera-{to}.{ENDINGS[to]}"
    write_file(name, content)
    return {"file": name}


def make_key(order: KeyOrder, progress: Progress) -> Json:
    """Make a pair of keys for passports; returns the files' names."""
    from camssf_fleet.passport.keys import PRIVATE, PUBLIC
    from camssf_fleet.passport.keys import make_key as make

    for name in (PRIVATE, PUBLIC):
        Path(name).unlink(missing_ok=True)
    make(Path(), _passphrase(order))
    return {"files": [PRIVATE, PUBLIC]}


def passport(order: PassportOrder, progress: Progress) -> Json:
    """Sign the result with the private key that the page sent; the key's file is removed at once."""
    from camssf.photo.read.unit import Unit
    from camssf_fleet.passport.document import PassportRequest, create_passport, sign
    from camssf_fleet.passport.keys import read_private

    data = result_path().read_bytes()
    secret = Path(".signing-key.pem")
    try:
        with open(os.open(secret, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as stream:
            stream.write(order.key)
        key = read_private(secret, _passphrase(order))
    finally:
        secret.unlink(missing_ok=True)
    photos = [uploaded("photo", number) for number in order.photos]
    request = PassportRequest(unit=Unit(serial=order.serial))
    write_file("camera.jws", sign(create_passport(data, request, photos=photos), key))
    return {"file": "camera.jws"}


TASKS: Mapping[str, Callable[[Any, Progress], Json]] = {
    "find": find, "chart": chart, "calibrate": calibrate, "colour": colour, "export": export, "key": make_key,
    "passport": passport,
}  # fmt: skip
ENDINGS = {
    "rawtoaces": "json", "dcamprof": "json", "spectacle": "csv", "csv": "csv", "dcp": "dcp", "icc": "icc",
    "clf": "clf", "colour": "csv",
}  # fmt: skip


def perform(name: str, order: Order, progress: Progress) -> Json:
    """Run a task; an error becomes plain data, without a traceback."""
    try:
        progress("starting", 0.0)
        value = TASKS[name](order, progress)
        progress("done", 1.0)
        return {"value": value}
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


def _result() -> Result:
    return _read_result(result_path(), result_path().stat().st_mtime_ns)


@lru_cache(maxsize=1)
def _read_result(path: Path, changed: int) -> Result:
    from camssf.result import Result

    return Result.load(path)


def _passphrase(order: KeyOrder | PassportOrder) -> bytes | None:
    return order.passphrase.encode() or None
