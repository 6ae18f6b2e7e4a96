"""Facts for the report's page that are not in the result: camera unit, time, signature, another result to compare.

A result holds no time and no serial number, so that the same photo gives the same bytes. These are read from the
photos' files and from a passport.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from camssf.errors import CalibrationError
from camssf.photo.read.unit import Unit, read_unit

if TYPE_CHECKING:
    from camssf.documents.passport import Passport

Json: TypeAlias = dict[str, Any]


@dataclass(frozen=True)
class Signature:
    """A passport of the result.

    Attributes:
        passport: its content.
        key: name of the key that the passport states.
        verified: whether that key is trusted and the signature is valid.
    """

    passport: Passport
    key: str
    verified: bool


@dataclass(frozen=True)
class Provenance:
    """Facts that are not in the result; all are optional.

    Attributes:
        unit: the camera unit.
        captured: when each photo was taken, ISO 8601; "" if its file does not state it.
        signature: None for an unsigned result.
        other: a result document to compare with, or None.
        other_name: its name on the page.
    """

    unit: Unit = field(default_factory=Unit)
    captured: tuple[str, ...] = ()
    signature: Signature | None = None
    other: Json | None = None
    other_name: str = ""


NO_PROVENANCE = Provenance()


def read_provenance(photos: Sequence[Path | str]) -> Provenance:
    """Read the camera unit and the times from the photos' files; an unreadable file gives an empty time."""
    unit, captured = Unit(), []
    for path in photos:
        try:
            found = read_unit(path)
        except CalibrationError:  # measuring the photo reports the error in detail
            captured.append("")
            continue
        unit = unit.filled(found.unit)
        captured.append(found.time)
    return Provenance(unit=unit, captured=tuple(captured))
