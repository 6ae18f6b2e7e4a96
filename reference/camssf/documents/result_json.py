"""Builds, checks, reads and writes results as JSON, "camssf-result/1"."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

import numpy as np

from camssf.documents.patches_json import plain
from camssf.documents.schema import BrokenError, check
from camssf.documents.schema import schema as form
from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import PHOTO, error_in_words, kind_of, local, readable
from camssf.fit.scores import reflectance_srgb, rmse
from camssf.grid import CHANNELS, WAVELENGTHS, Floats, columns
from camssf.photo.capture import Capture, MeasuredShot, Photo, Record, Unfinished
from camssf.photo.signals import Assumption, normalise
from camssf.recovery.sensitivity import EstimatedLamp, Hypothesis
from camssf.spectra import CameraCurves, ChartTable, Lamp, Light
from camssf.verdict.reasons import Verdict
from camssf.version import __version__

Json: TypeAlias = dict[str, Any]

LARGEST_DOCUMENT = 64 * 2**20


def compare(document: Json, truth: CameraCurves) -> None:
    """Add the true curves and the RMSE against them to a result document."""
    document["scores"]["rmse"] = rmse(columns(document["ssf"]), truth.values).tolist()
    document["truth"] = {"name": truth.name, "ssf": curves_json(truth.values / truth.values.max(axis=0))}


def weight_json(hypothesis: Hypothesis) -> Json:
    """A hypothesis as plain data; `kinds` only if a light was not named."""
    entry = {name: value for name, value in vars(hypothesis).items() if name != "kinds"}
    return entry | {"kinds": list(hypothesis.kinds)} if hypothesis.kinds else entry


def _lamp(lamp: Light) -> Json:
    """A lamp as it was given; an unnamed light has no tolerance and no power."""
    entry: Json = {"name": lamp.name, "tolerance": None, "source": lamp.source}
    if not isinstance(lamp, Lamp):
        return entry
    entry |= {"tolerance": lamp.tolerance, "power": (lamp.values / lamp.values.mean()).tolist()}
    return entry if lamp.tolerance_kelvin is None else entry | {"tolerance_kelvin": lamp.tolerance_kelvin}


def light_json(lamp: EstimatedLamp) -> Json:
    """The estimate of an unnamed light as plain data."""
    return {
        "kinds": lamp.kinds,
        "wavelength_nm": WAVELENGTHS.tolist(),
        "power": lamp.power.tolist(),
        "std": lamp.std.tolist(),
        "kelvin": lamp.kelvin,
        "kelvin_std": lamp.kelvin_std,
    }


def record_of(capture: Capture) -> Record:
    """The record of a completely measured capture."""
    record = Record()
    record.note(capture)
    return record


def head_json(record: Record, verdict: Verdict, assumptions: tuple[Assumption, ...]) -> Json:
    """The part of a document that needs no curves."""
    table, last = record.table, record.unfinished
    photos = [shot.photo for shot in record.shots]
    shots = [_shot_document(shot, table) for shot in record.shots] if table else []
    if last is not None and last.photo is not None:
        photos.append(last.photo)
        shots.append(_unfinished_document(last, last.photo))
    inputs = dict(record.files)
    for j, photo in enumerate(photos):
        inputs[f"shot {j + 1}, chart: {photo.name}"] = photo.sha256
    for j, shot in enumerate(record.shots):
        for role, frame in (("white", shot.white), ("dark", shot.dark)):
            if frame is not None:
                inputs[f"shot {j + 1}, {role}: {frame.name}"] = frame.sha256
    return {
        "format": "camssf-result/1",
        "generator": {"name": "camssf", "version": __version__},
        "camera": {
            "make": photos[0].make if photos else "",
            "model": photos[0].model if photos else "",
            "unique_model": (photos[0].unique_model if photos else "") or None,
        },
        "chart": {
            "name": record.chart,
            "table": table.table if table else "",
            "layout": table.layout.name if table else "",
            "source": table.source if table else "",
        },
        "shots": shots,
        "verdict": {"status": verdict.status, "reasons": [vars(reason) for reason in verdict.reasons]}
        | ({"checks": [vars(check) for check in verdict.checks]} if verdict.checks else {}),
        "assumptions": [vars(assumption) for assumption in assumptions],
        "hashes": {"inputs": inputs, "model": None},
    }


def _unfinished_document(shot: Unfinished, photo: Photo) -> Json:
    """A shot whose measurement was not completed."""
    return {
        "lamp": _lamp(shot.lamp),
        "white_reference": "white patch",
        "dark_reference": "black level",
        "photo": photo_json(photo),
        "white": None,
        "dark": None,
        "pose": plain(vars(shot.pose)) if shot.pose else None,
        "saturation": shot.saturation,
        "patches": [],
    }


def photo_json(photo: Photo) -> Json:
    """A photo's metadata as the document holds them."""
    apart = ("make", "model", "colour_matrices", "unit", "active_area", "levels", "unique_model")
    facts = {key: value for key, value in vars(photo).items() if key not in apart}
    return facts | {"camera": " ".join(filter(None, (photo.make, photo.model)))}


def _shot_document(shot: MeasuredShot, table: ChartTable) -> Json:
    """One shot without predictions; signals are 0 if they cannot be formed."""
    colours = reflectance_srgb(table)
    means = shot.means
    try:
        signals = normalise([means], table)
        y, error, white, dark = signals.values[0], signals.standard_error[0], signals.white[0], signals.dark[0]
    except CalibrationError:  # the capture will be refused; show what was measured
        y = error = np.zeros_like(means.chart.mean)
        white = means.white.mean if means.white else np.tile(means.chart.mean[table.white], (len(y), 1))
        dark = means.dark.mean if means.dark else np.tile(means.black, (len(y), 1))
    return {
        "lamp": _lamp(shot.lamp),
        "white_reference": "white frame" if means.white else "white patch",
        "dark_reference": "dark frame" if means.dark else "black level",
        "photo": photo_json(shot.photo),
        "white": {"name": shot.white.name, "sha256": shot.white.sha256} if shot.white else None,
        "dark": {"name": shot.dark.name, "sha256": shot.dark.sha256} if shot.dark else None,
        "lens_shading": shot.lens_shading,
        "pose": plain(vars(shot.pose)),
        "saturation": means.saturation,
        "patches": [
            {
                "name": name,
                "used": False,
                "reflectance_srgb": colours[i].tolist(),
                "measured_srgb": None,
                "synthetic_srgb": None,
                "signal": y[i].tolist(),
                "level": 1.0,
                "predicted": None,
                "unseen": None,
                "standard_error": error[i].tolist(),
                "clipped": means.chart.clipped[i].tolist(),
                "dead": means.chart.dead[i].tolist(),
                "gradient": means.chart.gradient[i].tolist(),
                "chart": means.chart.mean[i].tolist(),
                "white": white[i].tolist(),
                "dark": dark[i].tolist(),
            }
            for i, name in enumerate(table.patches)
        ],
    }


def triangle(covariance: Floats) -> list[float]:
    """The lower triangle of a symmetric matrix, row after row, to halve its size without loss of digits."""
    lower: list[float] = covariance[np.tril_indices(len(covariance))].tolist()
    return lower


def curves_json(values: Floats) -> Json:
    """Curves (681, 3) as the document holds them."""
    red, green, blue = values.T.tolist()
    return {"wavelength_nm": WAVELENGTHS.tolist(), "red": red, "green": green, "blue": blue}


# JSON in and out


def document_bytes(document: Json) -> bytes:
    """A valid document as the bytes of result.json: the same content always gives the same bytes."""
    return readable(_json(document) + "\n").encode()


def read_document(path: Path | str) -> Json:
    """Read and check a result.json.

    Raises:
        InvalidArgument: unreadable, too large, not JSON, or not in the form "camssf-result/1"; the message
            names the place inside the document.
    """
    advice = "Give the result.json that camssf wrote."
    try:
        with open(local(path), "rb") as file:
            data = file.read(LARGEST_DOCUMENT + 1)
    except (OSError, ValueError) as error:
        raise InvalidArgument(f"{path}: cannot be read ({error_in_words(error)}).", advice) from error
    if len(data) > LARGEST_DOCUMENT:
        raise InvalidArgument(f"{path}: larger than {LARGEST_DOCUMENT} bytes.", advice)
    return check_document(parse_json(data, str(path), advice), str(path))


def parse_json(data: bytes, name: str, advice: str) -> Any:
    """Parse strict JSON: UTF-8, no NaN or infinity, no key twice in an object.

    Raises:
        InvalidArgument: the data is not such JSON; `name` is its source in the message.
    """
    kind = kind_of(data)
    if kind is not None:
        if data.startswith(PHOTO):
            advice = (
                "Measure it first: `camssf calibrate` makes a result.json of it, `camssf patches` what `solve` takes."
            )
        raise InvalidArgument(f"{name} is {kind}, not JSON.", advice)
    try:
        return json.loads(data.decode("utf-8"), parse_constant=_no_constant, object_pairs_hook=_no_twins)
    except (ValueError, RecursionError) as error:
        raise InvalidArgument(f"{name} is not valid JSON ({error}).", advice) from error


def check_document(document: Any, name: str, *, excerpt: bool = False) -> Json:
    """Check that a document has the form "camssf-result/1" and return it.

    Args:
        document: plain data.
        name: its name in messages.
        excerpt: accept also the excerpt in a passport, without patches and covariance.

    Raises:
        InvalidArgument: the form is wrong (the message names the place inside the document), or it is an excerpt.
    """
    _check_document(document, name, excerpt)
    return dict(document)


def _no_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")


def _no_twins(pairs: list[tuple[str, Any]]) -> Json:
    together = dict(pairs)
    if len(together) < len(pairs):
        raise ValueError("the same key twice in one object")
    return together


def _check_document(document: Any, name: str, excerpt: bool = False) -> None:
    """Check the schema and the rules that a schema cannot express."""
    try:
        check(document, "result")
        if "excerpt" in document and not excerpt:
            raise InvalidArgument(
                f"{name}: is the excerpt that a passport holds, without patches and covariance.",
                f"Give the whole result.json, of SHA-256 {document['excerpt']['result_sha256']}.",
            )
        _check_sense(document)
    except BrokenError as error:
        where, what = error.args
        raise InvalidArgument(
            f"{name}: {where.lstrip('.') or 'the document'} {what}.",
            'The form is "camssf-result/1" (data/result.schema.json); `camssf calibrate` writes it.',
        ) from None


def _check_sense(document: Json) -> None:
    curves = [(key, document[key]) for key in ("ssf", "ssf_std") if document.get(key)]
    if "truth" in document:
        curves.append(("truth.ssf", document["truth"]["ssf"]))
    for key, curve in curves:
        if curve["wavelength_nm"] != WAVELENGTHS.tolist():
            raise BrokenError(f"{key}.wavelength_nm", "must be 380 to 720 nm every 0.5 nm")
    for colour in CHANNELS if "ssf" in document else ():
        peak = max(document["ssf"][colour])
        if abs(peak - 1) > 1e-6:
            raise BrokenError(f"ssf.{colour}", f"must have peak 1, has {peak:.6g}")
    _check_proof(document)
    for i, shot in enumerate(document["shots"]):
        outlines = [] if shot["pose"] is None else shot["pose"]["patches"]
        if shot["patches"] and len(outlines) != len(shot["patches"]):
            raise BrokenError(f"shots[{i}].pose.patches", f"must hold {len(shot['patches'])} entries")
        if "ssf" in document and "excerpt" not in document and not shot["patches"]:
            raise BrokenError(f"shots[{i}].patches", "must not be empty beside curves")


def _check_proof(document: Json) -> None:
    """Check that each list has one number per convex problem and that the covariance is a triangle."""
    problems = [(key, len(document[key])) for key in ("layers_gap", "finish_steps") if key in document]
    for key, count in problems:
        if count not in (1, 3) or count != problems[0][1]:
            raise BrokenError(key, f"must hold one number a problem, 1 or 3 of them, holds {count}")
    triangle = document.get("code_covariance")
    if not triangle:
        return
    size = (math.isqrt(8 * len(triangle) + 1) - 1) // 2
    if size * (size + 1) // 2 != len(triangle) or size % 3:
        raise BrokenError("code_covariance", f"must be the triangle of a matrix of 3 r rows, holds {len(triangle)}")
    for i in range(size):
        if triangle[i * (i + 3) // 2] < 0:
            raise BrokenError(f"code_covariance[{i * (i + 3) // 2}]", "must not be negative, it is a variance")


def _json(value: Any, schema: Any = None, margin: str = "\n") -> str:
    """Write objects in the schema's order, one key per line; lists without objects on one line; floats lossless."""
    schema = form("result") if schema is None else schema
    if "$ref" in schema:
        schema = form("result")["$defs"][schema["$ref"].removeprefix("#/$defs/")]
    if "anyOf" in schema:
        return _json(value, schema["anyOf"][0], margin)
    inner = margin + " "
    if isinstance(value, dict) and value:
        known, other = schema.get("properties", {}), schema.get("additionalProperties") or {}
        order = [*(key for key in known if key in value), *sorted(value.keys() - known.keys())]
        rows = (f"{_plain(key)}: {_json(value[key], known.get(key, other), inner)}" for key in order)
        return "{" + inner + f",{inner}".join(rows) + margin + "}"
    if isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        rows = (_json(entry, schema.get("items", {}), inner) for entry in value)
        return "[" + inner + f",{inner}".join(rows) + margin + "]"
    return _plain(value)


def _plain(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
