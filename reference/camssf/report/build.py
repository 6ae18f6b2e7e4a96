"""Builds the report of a result document: JSON, CSV, picture and one self-contained page."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from camssf.documents.result_json import check_document, document_bytes
from camssf.errors import InvalidArgument
from camssf.files import local, local_folder, write_files
from camssf.grid import CHANNELS, WAVELENGTHS

if TYPE_CHECKING:
    from camssf.report.provenance import Provenance

Json: TypeAlias = dict[str, Any]

NAMES = ("result.json", "ssf.csv", "ssf.png", "report.html")
REFUSED = "refused"
"""Subfolder for a refused result, if the folder holds a result with curves."""
LARGEST_PREVIEW = 16 * 2**20


@dataclass(frozen=True)
class Report:
    """The output files of `calibrate`.

    Attributes:
        result_json: the document, UTF-8, every number lossless; the same document gives the same bytes.
        ssf_csv: the curves, peak = 1, 681 rows; None when refused.
        ssf_png: their picture; None when refused, or if matplotlib is not installed.
        html: one self-contained page.
    """

    result_json: bytes
    ssf_csv: str | None
    ssf_png: bytes | None
    html: str

    def save(self, folder: Path | str) -> list[Path]:
        """Write result.json, ssf.csv, ssf.png and report.html to `folder`: all or none.

        A refused result has no ssf.csv and no ssf.png. It never replaces a result with curves: if `folder` holds one,
        the refused result goes to `folder`/refused. On any failure, including Ctrl-C, the folder is left unchanged.

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
    """Whether a folder holds files of a result that a refused one must not replace: any of NAMES, unless refused."""
    standing = {name for name in NAMES if os.path.isfile(folder / name)}
    if standing & {"ssf.csv", "ssf.png"} or "result.json" not in standing:
        return bool(standing)
    return verdict_in(folder) != "refused"


def result_folder(path: Path | str) -> Path:
    """The path of a folder for a result, checked not to hold other files of the same names.

    Raises:
        InvalidArgument: it is a URL or a file, or holds one of NAMES, but no result.
    """
    folder = local_folder(path)
    standing = [folder / name for name in NAMES if os.path.isfile(folder / name)]
    if standing and not verdict_in(folder):
        raise InvalidArgument(
            f"{standing[0]} belongs to no sound result and would be overwritten.",
            "Move it away, or name another folder.",
        )
    return folder


def verdict_in(folder: Path) -> str:
    """The verdict's status in a folder's result.json; "" if the file is missing or cannot be read."""
    try:
        return str(json.loads((folder / "result.json").read_bytes())["verdict"]["status"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return ""


def report(document: Json, previews: Sequence[bytes | None] = (), *, provenance: Provenance | None = None) -> Report:
    """Render a result.

    Args:
        document: plain data in the form "camssf-result/1" (data/result.schema.json).
        previews: for each shot a JPEG or PNG of its whole active area, not rotated by the orientation, or None; may
            be shorter than the list of shots.
        provenance: facts that are not in the document: unit, time, signature, another result.

    Raises:
        InvalidArgument: the document is invalid, or a preview is not a JPEG or PNG.
    """
    from camssf.report.page import page
    from camssf.report.picture import picture
    from camssf.report.provenance import NO_PROVENANCE
    from camssf.report.sections.photos import media_type

    check_document(document, "document")
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
        html=page(document, shown, provenance or NO_PROVENANCE),
    )


def _csv(document: Json) -> str:
    """wavelength_nm, the three curves, and their standard deviations if known."""
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
