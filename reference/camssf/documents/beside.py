"""What the report's page says beside the result: whose camera, when, signed by whom, and another to compare.

A result holds no time and no serial number, so that the same photo gives the same bytes. The photos' files and a
passport know them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from camssf.errors import CalibrationError
from camssf.photo.unit import Unit, read_unit

if TYPE_CHECKING:
    from camssf.documents.passport import Passport

Json: TypeAlias = dict[str, Any]


@dataclass(frozen=True)
class Signature:
    """A passport of the result.

    Attributes:
        passport: what it says.
        key: the name of the key that signed it, by its own word.
        verified: that key was trusted, and its signature fits.
    """

    passport: Passport
    key: str
    verified: bool


@dataclass(frozen=True)
class Beside:
    """All of that; nothing of it need be known.

    Attributes:
        unit: whose curves these are.
        captured: when each photo was taken, ISO 8601; "" where its file is silent.
        signature: None for an unsigned result.
        other: a result document to compare with, or None.
        other_name: what to call it.
    """

    unit: Unit = field(default_factory=Unit)
    captured: tuple[str, ...] = ()
    signature: Signature | None = None
    other: Json | None = None
    other_name: str = ""


NOTHING = Beside()


def taken(photos: Sequence[Path | str]) -> Beside:
    """What the photos' files say of the unit and of the time; a file that cannot be read says nothing."""
    unit, captured = Unit(), []
    for path in photos:
        try:
            found = read_unit(path)
        except CalibrationError:  # whoever measures the photo says so, and better
            captured.append("")
            continue
        unit = unit.filled(found.unit)
        captured.append(found.time)
    return Beside(unit=unit, captured=tuple(captured))
