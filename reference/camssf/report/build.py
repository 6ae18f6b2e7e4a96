"""Builds the report of a result: JSON, CSV, picture and one self-contained page."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from camssf.documents.document import Answer, Document, document_bytes
from camssf.errors import InvalidArgument
from camssf.files import local_folder, write_files
from camssf.grid import CHANNELS, WAVELENGTHS
from camssf.report.shots import shots_of
from camssf.report.tables import PATCH_COLUMNS, patch_rows

if TYPE_CHECKING:
    from camssf.report.provenance import Provenance

NAMES = ("result.json", "ssf.csv", "patches.csv", "ssf.svg", "ssf.png", "report.html")
"""Files of a result; the PNG only where it is wanted."""
REFUSED = "refused"
"""Subfolder for a refused result, if the folder holds a result with curves."""
LARGEST_PREVIEW = 16 * 2**20


@dataclass(frozen=True)
class Report:
    """The output files of `calibrate`.

    Attributes:
        result_json: the document, UTF-8, every number lossless; the same document gives the same bytes.
        ssf_csv: the curves, peak = 1, 681 rows; None when refused.
        patches_csv: the signals, measured and predicted; None when refused.
        ssf_svg: a picture of the curves; None when refused.
        ssf_png: the same as PNG; None unless it was wanted.
        html: one self-contained page.
    """

    result_json: bytes
    ssf_csv: str | None
    patches_csv: str | None
    ssf_svg: str | None
    ssf_png: bytes | None
    html: str

    def save(self, folder: Path | str) -> list[Path]:
        """Write result.json, ssf.csv, patches.csv, ssf.svg and report.html to `folder`: all or none.

        A refused result has result.json and report.html alone. It never replaces a result with curves: if `folder`
        holds one, the refused result goes to `folder`/refused. On any failure, including Ctrl-C, the folder is left
        unchanged.

        Returns:
            The files that were written.

        Raises:
            InvalidArgument: the folder cannot be written to.
        """
        folder = local_folder(folder)
        return write_files(
            folder / REFUSED if self.ssf_csv is None and holds_result(folder) else folder,
            {
                "result.json": self.result_json,
                "ssf.csv": self.ssf_csv,
                "patches.csv": self.patches_csv,
                "ssf.svg": self.ssf_svg,
                "ssf.png": self.ssf_png,
                "report.html": self.html,
            },
        )


def holds_result(folder: Path) -> bool:
    """Whether a folder holds files of a result that a refused one must not replace: any of NAMES, unless refused."""
    standing = {name for name in NAMES if os.path.isfile(folder / name)}
    if standing - {"result.json", "report.html"} or "result.json" not in standing:
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


def report(
    document: Document,
    previews: Sequence[bytes | None] = (),
    *,
    provenance: Provenance | None = None,
    png: bool = False,
) -> Report:
    """Render a result.

    Args:
        document: the result.
        previews: for each shot a JPEG or PNG of its whole active area, not rotated by the orientation, or None; may
            be shorter than the list of shots.
        provenance: facts that are not in the result: unit, time, signature.
        png: whether to draw the curves as PNG, too.

    Raises:
        InvalidArgument: a preview is not a JPEG or PNG, or a PNG is wanted without matplotlib.
    """
    from camssf.report.page import page
    from camssf.report.picture import picture
    from camssf.report.provenance import NO_PROVENANCE
    from camssf.report.sections.photos import media_type

    for i, preview in enumerate(previews):
        if preview is not None and (media_type(preview) is None or len(preview) > LARGEST_PREVIEW):
            raise InvalidArgument(
                f"Preview {i + 1} is not a JPEG or PNG of at most {LARGEST_PREVIEW} bytes.",
                "Encode the photo's preview as one of them, or give None.",
            )
    if document.verdict is None:
        raise InvalidArgument("This capture was not solved: there is nothing to report.", "Solve it: `camssf solve`.")
    shots, answer = shots_of(document), document.answer
    if len(previews) > len(shots):
        raise InvalidArgument(
            f"{len(previews)} previews for {len(shots)} shots.",
            "Give one preview a shot, in order.",
        )
    pictures = [*previews, *[None] * (len(shots) - len(previews))]
    return Report(
        result_json=document_bytes(document),
        ssf_csv=None if answer is None else _csv(answer),
        patches_csv=None if answer is None else _patches_csv(document),
        ssf_svg=None if answer is None else picture(document),
        ssf_png=_png(document) if answer is not None and png else None,
        html=page(document, shots, pictures, provenance or NO_PROVENANCE),
    )


def _csv(answer: Answer) -> str:
    """wavelength_nm, the three curves, and their standard deviations if known."""
    columns, head = [WAVELENGTHS, *answer.curves.values.T], ["wavelength_nm", *CHANNELS]
    if answer.std is not None:
        columns += [*answer.std.values.T]
        head += [f"{colour}_std" for colour in CHANNELS]
    # Adding 0.0 turns a rounded -0.0 into 0.0.
    rows = (
        ",".join([f"{row[0]:.1f}", *(f"{round(v, 9) + 0.0:.9f}" for v in row[1:])])
        for row in zip(*columns, strict=True)
    )
    return "\n".join([",".join(head), *rows, ""])


def _patches_csv(document: Document) -> str:
    """The rows of `to_pandas("patches")`; what is not known is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(PATCH_COLUMNS)
    writer.writerows([["" if cell != cell else cell for cell in row] for row in patch_rows(document)])
    return text.getvalue()


def _png(document: Document) -> bytes:
    from camssf.report.plots import curves_png

    return curves_png(document)
