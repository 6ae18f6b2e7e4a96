"""Result document → report: JSON, CSV, picture and one self-contained page. Knows plain data only."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from camssf.errors import InvalidArgument
from camssf.files import readable, write_files
from camssf.grid import WAVELENGTHS

Json: TypeAlias = dict[str, Any]

CHANNELS = ("red", "green", "blue")
NAMES = ("result.json", "ssf.csv", "ssf.png", "report.html")
LARGEST_DOCUMENT = 64 * 2**20
LARGEST_PREVIEW = 16 * 2**20


@dataclass(frozen=True)
class Report:
    """What `calibrate` leaves behind.

    Attributes:
        result_json: the document, UTF-8, every number lossless; the same document gives the same bytes.
        ssf_csv: the curves, peak = 1, 681 rows; None when refused.
        ssf_png: their picture; None when refused.
        html: one page that needs nothing else.
    """

    result_json: bytes
    ssf_csv: str | None
    ssf_png: bytes | None
    html: str

    def save(self, folder: Path | str) -> list[Path]:
        """Leave result.json, ssf.csv, ssf.png and report.html in `folder`: all or none.

        A refused result has no ssf.csv and no ssf.png; older ones in the folder are removed, since they would
        belong to another result. On any failure, Ctrl-C included, the folder is as it was before.

        Returns:
            The files that were written.

        Raises:
            InvalidArgument: the folder cannot be written to.
        """
        return write_files(
            folder,
            {
                "result.json": self.result_json,
                "ssf.csv": self.ssf_csv,
                "ssf.png": self.ssf_png,
                "report.html": self.html,
            },
        )


def report(document: Json, previews: Sequence[bytes | None] = ()) -> Report:
    """Render a result.

    Args:
        document: plain data in the form "camssf-result/1" (data/result.schema.json).
        previews: for each shot a JPEG or PNG of its whole active area, as the sensor saw it (not yet turned
            by the orientation), or None; may be shorter than the list of shots.

    Raises:
        InvalidArgument: the document breaks its form, or a preview is no JPEG or PNG.
    """
    from camssf.documents.page import media_type, page, picture

    _check_document(document, "document")
    for i, preview in enumerate(previews):
        if preview is not None and (media_type(preview) is None or len(preview) > LARGEST_PREVIEW):
            raise InvalidArgument(
                f"Preview {i + 1} is not a JPEG or PNG of at most {LARGEST_PREVIEW} bytes.",
                "Encode the photo's preview as one of them, or give None.",
            )
    if len(previews) > len(document["shots"]):
        raise InvalidArgument(
            f"{len(previews)} previews for {len(document['shots'])} shots.",
            "Give one preview a shot, in order.",
        )
    curves = "ssf" in document
    shown = [*previews, *[None] * (len(document["shots"]) - len(previews))]
    return Report(
        result_json=result_json(document),
        ssf_csv=_csv(document) if curves else None,
        ssf_png=picture(document) if curves else None,
        html=page(document, shown),
    )


def result_json(document: Json) -> bytes:
    """result.json of a document whose form is checked: the same document gives the same bytes."""
    return readable(_json(document) + "\n").encode()


def read_document(path: Path | str) -> Json:
    """Read and check a result.json.

    Raises:
        InvalidArgument: unreadable, too large, not JSON, or not in the form "camssf-result/1"; the message
            names the place inside the document.
    """
    advice = "Give the result.json that camssf wrote."
    try:
        with open(path, "rb") as file:
            data = file.read(LARGEST_DOCUMENT + 1)
    except (OSError, ValueError) as error:
        raise InvalidArgument(f"{path}: cannot be read ({error}).", advice) from error
    if len(data) > LARGEST_DOCUMENT:
        raise InvalidArgument(f"{path}: larger than {LARGEST_DOCUMENT} bytes.", advice)
    return check_document(parse_json(data, str(path), advice), str(path))


def parse_json(data: bytes, name: str, advice: str) -> Any:
    """Sound JSON: UTF-8, numbers that JSON knows, no key twice in an object.

    Raises:
        InvalidArgument: it is not; `name` says where it came from.
    """
    try:
        return json.loads(data.decode("utf-8"), parse_constant=_no_constant, object_pairs_hook=_no_twins)
    except (ValueError, RecursionError) as error:
        raise InvalidArgument(f"{name}: is not sound JSON ({error}).", advice) from error


def check_document(document: Any, name: str) -> Json:
    """The document, once its form "camssf-result/1" is checked.

    Raises:
        InvalidArgument: it breaks the form; the message names the place inside the document.
    """
    _check_document(document, name)
    return dict(document)


# The form


@cache
def _schema() -> Json:
    text = files("camssf").joinpath("data", "result.schema.json").read_text("utf-8")
    return dict(json.loads(text))


def _no_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")


def _no_twins(pairs: list[tuple[str, Any]]) -> Json:
    together = dict(pairs)
    if len(together) < len(pairs):
        raise ValueError("the same key twice in one object")
    return together


class _BrokenError(Exception):
    """Where the document breaks its form, and how. Never leaves this module."""


def _check_document(document: Any, name: str) -> None:
    """The schema, and what a schema cannot say."""
    try:
        _check(document, _schema(), "")
        _check_sense(document)
    except _BrokenError as error:
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
            raise _BrokenError(f"{key}.wavelength_nm", "must be 380 to 720 nm every 0.5 nm")
    for colour in CHANNELS if "ssf" in document else ():
        peak = max(document["ssf"][colour])
        if abs(peak - 1) > 1e-6:
            raise _BrokenError(f"ssf.{colour}", f"must have peak 1, has {peak:.6g}")
    _check_proof(document)
    for i, shot in enumerate(document["shots"]):
        outlines = [] if shot["pose"] is None else shot["pose"]["patches"]
        if shot["patches"] and len(outlines) != len(shot["patches"]):
            raise _BrokenError(f"shots[{i}].pose.patches", f"must hold {len(shot['patches'])} entries")
        if "ssf" in document and not shot["patches"]:
            raise _BrokenError(f"shots[{i}].patches", "must not be empty beside curves")


def _check_proof(document: Json) -> None:
    """One number a problem, and as many of a covariance as a triangle has."""
    problems = [(key, len(document[key])) for key in ("layers_gap", "finish_steps") if key in document]
    for key, count in problems:
        if count not in (1, 3) or count != problems[0][1]:
            raise _BrokenError(key, f"must hold one number a problem, 1 or 3 of them, holds {count}")
    triangle = document.get("code_covariance")
    if not triangle:
        return
    size = (math.isqrt(8 * len(triangle) + 1) - 1) // 2
    if size * (size + 1) // 2 != len(triangle) or size % 3:
        raise _BrokenError("code_covariance", f"must be the triangle of a matrix of 3 r rows, holds {len(triangle)}")
    for i in range(size):
        if triangle[i * (i + 3) // 2] < 0:
            raise _BrokenError(f"code_covariance[{i * (i + 3) // 2}]", "must not be negative, it is a variance")


_TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "boolean": (bool,),
    "null": (type(None),),
    "number": (int, float),
    "integer": (int,),
}
_WORDS = {
    *("$schema", "$id", "$defs", "$ref", "title", "description", "type", "const", "enum", "anyOf", "pattern"),
    *("if", "then", "else", "properties", "required", "additionalProperties", "maxProperties", "items"),
    *("minItems", "maxItems", "minimum", "maximum", "minLength", "maxLength"),
}
"""The part of JSON Schema 2020-12 that result.schema.json uses and `_check` knows."""


def _check(value: Any, schema: Any, where: str) -> None:
    """JSON Schema 2020-12 as far as _WORDS go; the tests hold it against a full validator."""
    if isinstance(schema, bool):
        _need(schema, where, "must be missing here")
        return
    if "$ref" in schema:
        _check(value, _target(schema), where)
    if "anyOf" in schema and not any(_fits(value, s) for s in schema["anyOf"]):
        _check(value, schema["anyOf"][0], where)
    if "type" in schema:
        right = isinstance(value, _TYPES[schema["type"]])
        if schema["type"] == "integer" and isinstance(value, float):
            right = value.is_integer()
        # Python counts True as 1, JSON does not.
        right = right and (schema["type"] == "boolean" or not isinstance(value, bool))
        _need(right, where, f"must be of type {schema['type']}, is {_short(value)}")
    allowed = schema.get("enum", [schema["const"]] if "const" in schema else None)
    if allowed is not None:
        _need(value in allowed, where, f"must be {' or '.join(map(json.dumps, allowed))}, is {_short(value)}")
    if isinstance(value, str):
        _bound(len(value), "characters", schema.get("minLength"), schema.get("maxLength"), where)
        right = re.search(schema.get("pattern", ""), value) is not None
        _need(right, where, f"must match {schema.get('pattern')}, is {_short(value)}")
    elif isinstance(value, (int, float)):
        _need(isinstance(value, int) or math.isfinite(value), where, "must be a finite number")
        _bound(value, "", schema.get("minimum"), schema.get("maximum"), where)
    elif isinstance(value, list):
        _bound(len(value), "entries", schema.get("minItems"), schema.get("maxItems"), where)
        for i, entry in enumerate(value):
            _check(entry, schema.get("items", True), f"{where}[{i}]")
    elif isinstance(value, dict):
        _bound(len(value), "keys", None, schema.get("maxProperties"), where)
        lacking = [key for key in schema.get("required", ()) if key not in value]
        _need(not lacking, where, f"lacks {', '.join(lacking)}")
        known, other = schema.get("properties", {}), schema.get("additionalProperties", True)
        for key, entry in value.items():
            _need(isinstance(key, str), where, f"has a key that is no text, {_short(key)}")
            _need(key in known or other is not False, where, f"has an unknown key, {_short(key)}")
            _check(entry, known.get(key, other), f"{where}.{key}")
    if "if" in schema:
        _check(value, schema.get("then" if _fits(value, schema["if"]) else "else", True), where)


def _target(schema: Json) -> Json:
    """The definition that a $ref names."""
    return dict(_schema()["$defs"][schema["$ref"].removeprefix("#/$defs/")])


def _need(right: bool, where: str, what: str) -> None:
    if not right:
        raise _BrokenError(where, what)


def _fits(value: Any, schema: Any) -> bool:
    try:
        _check(value, schema, "")
    except _BrokenError:
        return False
    return True


def _bound(size: float, unit: str, low: float | None, high: float | None, where: str) -> None:
    unit = f" {unit}" if unit else ""
    _need(low is None or size >= low, where, f"must be at least {low}{unit}, is {_short(size)}")
    _need(high is None or size <= high, where, f"must be at most {high}{unit}, is {_short(size)}")


def _short(value: Any) -> str:
    if isinstance(value, int) and value.bit_length() > 200:
        return "a huge integer"
    text = repr(value) if isinstance(value, (str, int, float, type(None))) else type(value).__name__
    return text if len(text) <= 60 else text[:57] + "..."


# The files


def _json(value: Any, schema: Any = None, margin: str = "\n") -> str:
    """Objects in the schema's order, one key a line; lists without objects on one line; floats lossless."""
    schema = _schema() if schema is None else schema
    if "$ref" in schema:
        schema = _target(schema)
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


def _csv(document: Json) -> str:
    """wavelength_nm, the three curves, and their standard deviations where known."""
    columns, head = [WAVELENGTHS, *(document["ssf"][colour] for colour in CHANNELS)], ["wavelength_nm", *CHANNELS]
    if document.get("ssf_std"):
        columns += [document["ssf_std"][colour] for colour in CHANNELS]
        head += [f"{colour}_std" for colour in CHANNELS]
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    rows = (
        ",".join([f"{row[0]:.1f}", *(f"{round(v, 9) + 0.0:.9f}" for v in row[1:])])
        for row in zip(*columns, strict=True)
    )
    return "\n".join([",".join(head), *rows, ""])
