"""DNG → the one physical camera that took it, as far as the file says, and when."""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass, fields
from datetime import datetime
from pathlib import Path

from camssf.errors import UnreadableRaw
from camssf.photo.tags import COPY_AGAIN, Directory, Tiff

_OFFSET = re.compile(r"[+-]\d\d:\d\d")
_TIME = re.compile(r"(\d{4}):(\d\d):(\d\d) (\d\d:\d\d:\d\d)")


@dataclass(frozen=True)
class Unit:
    """One physical camera; "" and None where nothing is known.

    Attributes:
        make, model: as its files name it.
        camera_id: of a phone with several cameras, the one that was used.
        serial: of the body.
        lens: its model.
        focal_length: mm.
        aperture: the f-number.
    """

    make: str = ""
    model: str = ""
    camera_id: str = ""
    serial: str = ""
    lens: str = ""
    focal_length: float | None = None
    aperture: float | None = None

    def differs(self, other: Unit) -> tuple[str, ...]:
        """Names of what both say, and not alike."""
        pairs = {each.name: (getattr(self, each.name), getattr(other, each.name)) for each in fields(self)}
        return tuple(name for name, (a, b) in pairs.items() if a and b and a != b)

    def filled(self, other: Unit) -> Unit:
        """With what the other knows where this one is silent."""
        return Unit(**{each.name: getattr(self, each.name) or getattr(other, each.name) for each in fields(self)})


@dataclass(frozen=True)
class Taken:
    """What a photo's file says of its taking.

    Attributes:
        unit: by what camera.
        time: ISO 8601, with the offset from UTC where the file has one; "" where it is silent.
        sha256: of the file.
    """

    unit: Unit
    time: str
    sha256: str


def read_unit(path: Path | str) -> Taken:
    """Who took a DNG, and when; its samples are not read.

    Raises:
        UnreadableRaw: it cannot be read, or is damaged.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
            stream.seek(0)
            tiff = Tiff(path, stream)
            exif = tiff.exif()
            return Taken(_unit(tiff, exif), _time(tiff, exif), sha256)
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise UnreadableRaw(
            f"{path} cannot be read ({getattr(error, 'strerror', None) or error}).", COPY_AGAIN
        ) from error


def _unit(tiff: Tiff, exif: Directory) -> Unit:
    first = tiff.main[0]
    return Unit(
        make=tiff.text(first, 271),
        model=tiff.text(first, 272) or tiff.text(first, 50708),
        serial=tiff.text(exif, 42033) or tiff.text(first, 50735),
        lens=tiff.text(exif, 42036),
        focal_length=_positive(tiff, (exif, first), 37386),
        aperture=_positive(tiff, (exif, first), 33437),
    )


def _positive(tiff: Tiff, places: tuple[Directory, ...], tag: int) -> float | None:
    """A number above 0; Exif writes 0 where it is not known. TIFF/EP has these tags in the first directory."""
    for place in places:
        values = tiff.numbers(place, tag)
        if values is not None and math.isfinite(values[0]) and values[0] > 0:
            return float(values[0])
    return None


def _time(tiff: Tiff, exif: Directory) -> str:
    """DateTimeOriginal with its offset; a clock that was never set writes zeros or blanks, which is no time."""
    found = _TIME.fullmatch(tiff.text(exif, 36867))
    if found is None:
        return ""
    year, month, day, clock = found.groups()
    offset = tiff.text(exif, 36881)
    text = f"{year}-{month}-{day}T{clock}" + (offset if _OFFSET.fullmatch(offset) else "")
    try:
        datetime.fromisoformat(text)
    except ValueError:
        return ""
    return text
