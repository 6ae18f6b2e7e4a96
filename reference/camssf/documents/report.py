"""Result document → report: JSON, CSV, picture and one self-contained page. Knows plain data only."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from camssf.documents.schema import BrokenError, check
from camssf.documents.schema import schema as form
from camssf.errors import InvalidArgument
from camssf.files import PHOTO, kind_of, local, readable, write_files
from camssf.grid import WAVELENGTHS

if TYPE_CHECKING:
    from camssf.documents.beside import Beside

Json: TypeAlias = dict[str, Any]

CHANNELS = ("red", "green", "blue")
NAMES = ("result.json", "ssf.csv", "ssf.png", "report.html")
REFUSED = "refused"
"""Folder of a refused result, below that of a result with curves."""
LARGEST_DOCUMENT = 64 * 2**20
LARGEST_PREVIEW = 16 * 2**20


@dataclass(frozen=True)
class Report:
    """What `calibrate` leaves behind.

    Attributes:
        result_json: the document, UTF-8, every number lossless; the same document gives the same bytes.
        ssf_csv: the curves, peak = 1, 681 rows; None when refused.
        ssf_png: their picture; None when refused, and where matplotlib is not installed.
        html: one page that needs nothing else.
    """

    result_json: bytes
    ssf_csv: str | None
    ssf_png: bytes | None
    html: str

    def save(self, folder: Path | str) -> list[Path]:
        """Leave result.json, ssf.csv, ssf.png and report.html in `folder`: all or none.

        A refused result has no ssf.csv and no ssf.png. It never replaces a result with curves: where any stands in
        `folder`, the refused one goes to `folder`/refused. On any failure, Ctrl-C included, the folder is as it was
        before.

        Returns:
            The files that were written.

        Raises:
            InvalidArgument: the folder cannot be written to.
        """
        folder = local(folder)
        return write_files(
            folder / REFUSED if self.ssf_csv is None and holds_result(folder) else folder,
            {
                "result.json": self.result_json,
                "ssf.csv": self.ssf_csv,
                "ssf.png": self.ssf_png,
                "report.html": self.html,
            },
        )


def holds_result(folder: Path) -> bool:
    """Whether a folder holds files of a result that no refusal may replace: any of NAMES, unless it is refused."""
    standing = {name for name in NAMES if os.path.isfile(folder / name)}
    if standing & {"ssf.csv", "ssf.png"} or "result.json" not in standing:
        return bool(standing)
    return verdict_in(folder) != "refused"


def verdict_in(folder: Path) -> str:
    """The verdict's status in a folder's result.json; "" where there is none, or it cannot be read."""
    try:
        return str(json.loads((folder / "result.json").read_bytes())["verdict"]["status"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return ""


def report(document: Json, previews: Sequence[bytes | None] = (), *, beside: Beside | None = None) -> Report:
    """Render a result.

    Args:
        document: plain data in the form "camssf-result/1" (data/result.schema.json).
        previews: for each shot a JPEG or PNG of its whole active area, as the sensor saw it (not yet turned
            by the orientation), or None; may be shorter than the list of shots.
        beside: what the page says and the document does not hold: unit, time, signature, another result.

    Raises:
        InvalidArgument: the document breaks its form, or a preview is no JPEG or PNG.
    """
    from camssf.documents.beside import NOTHING
    from camssf.documents.page import page
    from camssf.documents.picture import picture
    from camssf.documents.view.photos import media_type

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
        result_json=document_bytes(document),
        ssf_csv=_csv(document) if curves else None,
        ssf_png=picture(document) if curves and find_spec("matplotlib") else None,
        html=page(document, shown, beside or NOTHING),
    )


def document_bytes(document: Json) -> bytes:
    """A sound document as result.json holds it: the same content gives the same bytes, however it was laid out."""
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
        raise InvalidArgument(f"{path}: cannot be read ({error}).", advice) from error
    if len(data) > LARGEST_DOCUMENT:
        raise InvalidArgument(f"{path}: larger than {LARGEST_DOCUMENT} bytes.", advice)
    return check_document(parse_json(data, str(path), advice), str(path))


def parse_json(data: bytes, name: str, advice: str) -> Any:
    """Sound JSON: UTF-8, numbers that JSON knows, no key twice in an object.

    Raises:
        InvalidArgument: it is not; `name` says where it came from.
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
        raise InvalidArgument(f"{name}: is not sound JSON ({error}).", advice) from error


def check_document(document: Any, name: str, *, excerpt: bool = False) -> Json:
    """The document, once its form "camssf-result/1" is checked.

    Args:
        document: plain data.
        name: what messages call it.
        excerpt: what a passport holds of a result, without its patches and covariance, will do.

    Raises:
        InvalidArgument: it breaks the form; the message names the place inside the document. Or it is an excerpt.
    """
    _check_document(document, name, excerpt)
    return dict(document)


# The form


def _no_constant(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")


def _no_twins(pairs: list[tuple[str, Any]]) -> Json:
    together = dict(pairs)
    if len(together) < len(pairs):
        raise ValueError("the same key twice in one object")
    return together


def _check_document(document: Any, name: str, excerpt: bool = False) -> None:
    """The schema, and what a schema cannot say."""
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
    """One number a problem, and as many of a covariance as a triangle has."""
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


# The files


def _json(value: Any, schema: Any = None, margin: str = "\n") -> str:
    """Objects in the schema's order, one key a line; lists without objects on one line; floats lossless."""
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
