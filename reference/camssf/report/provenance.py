"""Facts for the report's page that are not in the result: camera unit, time, signature.

A result holds no time and no serial number, so that the same photo gives the same bytes. These are read from the
photos' files and from a passport.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Protocol

from camssf.errors import CalibrationError
from camssf.photo.read.unit import Unit, read_unit


class SignedResult(Protocol):
    """What the page shows of a signed result."""

    @property
    def id(self) -> str:
        """32 random hexadecimal digits."""

    @property
    def issued(self) -> datetime:
        """When it was signed, UTC."""

    @property
    def begins(self) -> datetime:
        """Start of its validity, UTC."""

    @property
    def ends(self) -> datetime:
        """End of its validity, UTC."""

    @property
    def unit(self) -> Unit:
        """The camera unit that the curves belong to."""

    @property
    def captured(self) -> str:
        """When the photo was taken, ISO 8601; "" if unknown."""

    @property
    def chart_serial(self) -> str:
        """Serial number of the chart; "" if unknown."""

    @property
    def lamp_serials(self) -> tuple[str, ...]:
        """Serial number of each lamp; "" if unknown."""

    @property
    def result_sha256(self) -> str:
        """SHA-256 of the whole result's file."""


@dataclass(frozen=True)
class Signature:
    """A passport of the result.

    Attributes:
        passport: its content.
        key: name of the key that the passport states.
        verified: whether that key is trusted and the signature is valid.
    """

    passport: SignedResult
    key: str
    verified: bool


@dataclass(frozen=True)
class Provenance:
    """Facts that are not in the result; all are optional.

    Attributes:
        unit: the camera unit.
        captured: when each photo was taken, ISO 8601; "" if its file does not state it.
        signature: None for an unsigned result.
    """

    unit: Unit = field(default_factory=Unit)
    captured: tuple[str, ...] = ()
    signature: Signature | None = None


NO_PROVENANCE = Provenance()


def read_provenance(photos: Sequence[Path | str]) -> Provenance:
    """Read the camera unit and the times from the photos' files; an unreadable file gives an empty time."""
    unit, captured = Unit(), []
    for path in photos:
        try:
            photo = read_unit(path)
        except CalibrationError:  # measuring the photo reports the error in detail
            captured.append("")
            continue
        unit = unit.filled(photo.unit)
        captured.append(photo.time)
    return Provenance(unit=unit, captured=tuple(captured))
