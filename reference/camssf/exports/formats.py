"""The export formats by name, and the function that writes them."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

from camssf.documents.document import Document
from camssf.documents.excerpt import Excerpt
from camssf.errors import InvalidArgument
from camssf.exports.clf import clf
from camssf.exports.curves import ExportedCurves, exported, one_line
from camssf.exports.dcamprof import dcamprof
from camssf.exports.dcp import dcp
from camssf.exports.icc import icc
from camssf.exports.matrices import matrices
from camssf.exports.rawtoaces import rawtoaces
from camssf.exports.tables import colour_csv, plain_csv, spectacle_csv

UNSTATED = "not stated by the owner"
MATRIX_LAMP = "D65"


@dataclass(frozen=True)
class Order:
    """Parameters of an export.

    Attributes:
        created: time of the export, UTC, for formats that state it.
        licence: licence of the curves, for formats that state it.
        lamp: lamp of the matrix, for formats that hold one.
    """

    created: datetime
    licence: str = UNSTATED
    lamp: str = MATRIX_LAMP


@dataclass(frozen=True)
class Format:
    """An export format.

    Attributes:
        what: description.
        write: makes the content from curves and an order.
    """

    what: str
    write: Callable[[ExportedCurves, Order], str | bytes]


FORMATS = {
    "rawtoaces": Format("rawtoaces camera file (JSON)", lambda c, order: rawtoaces(c, order.created, order.licence)),
    "dcamprof": Format("DCamProf camera SSF (JSON)", lambda c, order: dcamprof(c)),
    "spectacle": Format("SPECTACLE spectral_response.csv", lambda c, order: spectacle_csv(c)),
    "csv": Format("plain CSV", lambda c, order: plain_csv(c)),
    "dcp": Format("DNG camera profile", lambda c, order: dcp(c)),
    "icc": Format("ICC profile", lambda c, order: icc(c, matrices(c, order.lamp), order.created)),
    "clf": Format("Common LUT Format", lambda c, order: clf(c, matrices(c, order.lamp))),
    "colour": Format("colour-science CSV", lambda c, order: colour_csv(c)),
}


def export(
    result: Document | Excerpt,
    to: str,
    *,
    created: datetime | None = None,
    licence: str = UNSTATED,
    lamp: str = MATRIX_LAMP,
) -> bytes:
    """Write a result in another format.

    Args:
        result: a result, or the excerpt of one in a passport.
        to: one of FORMATS.
        created: time with time zone; default: now. The environment variable SOURCE_DATE_EPOCH has precedence.
        licence: licence of the curves, for formats that state one.
        lamp: lamp of the matrix in `icc` and `clf`.

    Returns:
        The file's content.

    Raises:
        InvalidArgument: an unknown format, or a refused result.
    """
    if to not in FORMATS:
        raise InvalidArgument(f"There is no export to {to!r}.", f"Take one of {', '.join(FORMATS)}.")
    if not one_line(licence):
        raise InvalidArgument("The licence is empty.", "Name one, for example CC-BY-4.0, or leave it out.")
    curves = exported(result)
    order = Order(_time(created), one_line(licence), lamp)
    written = FORMATS[to].write(curves, order)
    return written if isinstance(written, bytes) else written.encode()


def _time(created: datetime | None) -> datetime:
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    if epoch.isdecimal() and int(epoch) < 1 << 37:
        return datetime.fromtimestamp(int(epoch), UTC)
    return datetime.now(UTC) if created is None else created.astimezone(UTC)
