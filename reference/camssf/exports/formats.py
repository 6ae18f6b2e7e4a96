"""The formats by name, and the one way to all of them."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from camssf.errors import InvalidArgument
from camssf.exports.curves import Curves, one_line, read_result
from camssf.exports.rawtoaces import rawtoaces
from camssf.exports.tables import colour_csv, plain_csv, spectacle_csv

UNSTATED = "not stated by the owner"


@dataclass(frozen=True)
class Order:
    """What an export is asked for beside the result.

    Attributes:
        created: time of the export, UTC, where a format asks for it.
        licence: of the curves, where a format asks for it.
    """

    created: datetime
    licence: str = UNSTATED


@dataclass(frozen=True)
class Format:
    """A format: what it is in words, and its writer."""

    what: str
    write: Callable[[Curves, Order], str | bytes]


FORMATS = {
    "rawtoaces": Format("rawtoaces camera file (JSON)", lambda c, order: rawtoaces(c, order.created, order.licence)),
    "spectacle": Format("SPECTACLE spectral_response.csv", lambda c, order: spectacle_csv(c)),
    "csv": Format("plain CSV", lambda c, order: plain_csv(c)),
    "colour": Format("colour-science CSV", lambda c, order: colour_csv(c)),
}


def export(document: dict[str, Any], to: str, *, created: datetime | None = None, licence: str = UNSTATED) -> bytes:
    """A result in another format.

    Args:
        document: of a result, "camssf-result/1".
        to: one of FORMATS.
        created: aware; now unless given. The environment's SOURCE_DATE_EPOCH comes first.
        licence: that the owner of the curves gives them, for formats that ask for one.

    Returns:
        The file's content.

    Raises:
        InvalidArgument: an unknown format, a document that breaks its form, or a refused one.
    """
    if to not in FORMATS:
        raise InvalidArgument(f"There is no export to {to!r}.", f"Take one of {', '.join(FORMATS)}.")
    if not one_line(licence):
        raise InvalidArgument("The licence is empty.", "Name one, for example CC-BY-4.0, or leave it out.")
    written = FORMATS[to].write(read_result(document), Order(_time(created), one_line(licence)))
    return written if isinstance(written, bytes) else written.encode()


def _time(created: datetime | None) -> datetime:
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    if epoch.isdecimal() and int(epoch) < 1 << 37:
        return datetime.fromtimestamp(int(epoch), UTC)
    return datetime.now(UTC) if created is None else created.astimezone(UTC)
