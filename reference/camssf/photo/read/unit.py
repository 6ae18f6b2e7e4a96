"""Identifies a photo: by the hash of its files, and by the physical camera and the time that a DNG states."""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass, fields
from datetime import datetime
from pathlib import Path
from typing import Annotated, TypeAlias

from camssf.files import error_in_words, local
from camssf.messages import fail
from camssf.photo.read.tiff import Directory, Tiff
from camssf.places import PICTURES
from camssf.rules import rules
from camssf.shapes import Apart, Count, Pattern, Positive, Text

PIECE = 1 << 20
"""Bytes read at a time."""


def sidecar_of(path: Path) -> Path | None:
    """The sidecar with pattern and levels of a picture; None if there is none, or `path` is no picture."""
    if path.suffix.casefold() not in PICTURES:
        return None
    sidecar = path.with_name(f"{path.name}.json")
    return sidecar if sidecar.is_file() else None


def photo_hash(path: Path | str) -> str:
    """SHA-256 of a photo: of its file, or of a picture followed by its sidecar (`cat photo.png photo.png.json`)."""
    digest, sidecar = hashlib.sha256(), sidecar_of(Path(path))
    for file in (Path(path), *(() if sidecar is None else (sidecar,))):
        with file.open("rb") as stream:
            while piece := stream.read(PIECE):
                digest.update(piece)
    return digest.hexdigest()


_OFFSET = re.compile(r"[+-]\d\d:\d\d")
_TIME = re.compile(r"(\d{4}):(\d\d):(\d\d) (\d\d:\d\d:\d\d)")


Area: TypeAlias = tuple[Count, Count, Count, Count]
"""Top, left, bottom, right of the sensor's active area, in samples of the stored picture."""
ALIKE = rules().number("patches.alike")
"""Relative difference up to which two focal lengths or f-numbers count as equal: files round them."""


@dataclass(frozen=True)
class Unit:
    """One physical camera; "" and None mean unknown.

    Attributes:
        make, model: as its files name it.
        camera_id: the camera used, on a phone with several.
        serial: serial number of the body; only in a document whose app wrote it, because documents are shared.
        serial_check: 4 hex digits of the serial number's hash, which tell two units apart and name none.
        lens: model of the lens.
        focal_length: mm.
        aperture: the f-number.
    """

    make: Annotated[str, Apart()] = ""
    model: Annotated[str, Apart()] = ""
    camera_id: Text = ""
    serial: Text = ""
    serial_check: Annotated[str, Pattern("([0-9a-f]{4})?", "must be 4 hex digits")] = ""
    lens: Text = ""
    focal_length: Positive | None = None
    aperture: Positive | None = None

    def differs(self, other: Unit) -> tuple[str, ...]:
        """Names of the attributes that are known in both and differ."""
        pairs = {field.name: (getattr(self, field.name), getattr(other, field.name)) for field in fields(self)}
        names = (name.removesuffix("_check") for name, (a, b) in pairs.items() if a and b and a != b)
        return tuple(dict.fromkeys(names))

    def filled(self, other: Unit) -> Unit:
        """A copy whose unknown attributes are taken from `other`."""
        return Unit(**{field.name: getattr(self, field.name) or getattr(other, field.name) for field in fields(self)})


@dataclass(frozen=True)
class Taken:
    """Camera, time and hash of a photo.

    Attributes:
        unit: the physical camera.
        time: ISO 8601, with the offset from UTC if the file has one; "" if unknown.
        sha256: of the file; for a picture with a sidecar, of both.
    """

    unit: Unit
    time: str
    sha256: str


def read_unit(path: Path | str) -> Taken:
    """Read camera, time and hash of a DNG, without its samples.

    Raises:
        UnreadableRaw: the file cannot be read, or is damaged.
        UnsupportedRaw: another raw format, or a BigTIFF.
    """
    path = local(path)
    try:
        sha256 = photo_hash(path)
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise fail("unreadable_raw.no_access", file=path, detail=error_in_words(error)) from error
    return Taken(*read_metadata(path), sha256)


def read_metadata(path: Path | str) -> tuple[Unit, str]:
    """Camera and time of a DNG, as in `Taken`, without its hash; raises what `read_unit` raises."""
    path = local(path)
    try:
        with path.open("rb") as stream:
            tiff = Tiff(path, stream)
            exif = tiff.exif()
            return unit_of(tiff, exif), _time(tiff, exif)
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise fail("unreadable_raw.no_access", file=path, detail=error_in_words(error)) from error


def check_unit(chart: str, one: tuple[Unit, Area | None], other: str, two: tuple[Unit, Area | None]) -> None:
    """Refuse photos of two physical cameras or lenses. Unknown attributes, make and model are not compared.

    Args:
        chart, other: names of the photos in the message.
        one, two: the unit of each, and its sensor's active area.

    Raises:
        UnitDiffers: camera, serial number, lens, focal length, aperture or active area differ.
    """
    (ours, area), (theirs, place) = one, two
    differ = [
        f"{word} '{there}' against '{here}'"
        for word, there, here in (("camera", theirs.camera_id, ours.camera_id), ("lens", theirs.lens, ours.lens))
        if there and here and there != here
    ]
    if "serial" in theirs.differs(ours):
        differ.append("another serial number")
    for there, here, form in (
        (theirs.focal_length, ours.focal_length, "focal length {:g} mm against {:g} mm"),
        (theirs.aperture, ours.aperture, "aperture f/{:g} against f/{:g}"),
    ):
        if there and here and abs(there - here) > ALIKE * max(there, here):
            differ.append(form.format(there, here))
    if place and area and place != area:
        differ.append(f"active area {', '.join(map(str, place))} against {', '.join(map(str, area))}")
    if differ:
        raise fail("unit_differs.photos", file=other, other=chart, differences="; ".join(differ))


def serial_check(make: str, model: str, serial: str) -> str:
    """4 hex digits of the SHA-256 of maker, model and serial number; "" without a serial number.

    Of 65,536 units of a model one has the same digits, so that they tell units apart and lead to none of them.
    """
    return hashlib.sha256(f"camssf unit\n{make}\n{model}\n{serial}".encode()).hexdigest()[:4] if serial else ""


def unit_of(tiff: Tiff, exif: Directory) -> Unit:
    """The physical camera that a DNG's directories describe."""
    first = tiff.main[0]
    make, model = tiff.text(first, 271), tiff.text(first, 272) or tiff.text(first, 50708)
    serial = tiff.text(exif, 42033) or tiff.text(first, 50735)
    return Unit(
        make=make,
        model=model,
        serial=serial,
        serial_check=serial_check(make, model, serial),
        lens=tiff.text(exif, 42036),
        focal_length=_positive(tiff, (exif, first), 37386),
        aperture=_positive(tiff, (exif, first), 33437),
    )


def _positive(tiff: Tiff, places: tuple[Directory, ...], tag: int) -> float | None:
    """The first positive number; Exif writes 0 for unknown. TIFF/EP has these tags in the first directory."""
    for place in places:
        values = tiff.numbers(place, tag)
        if values is not None and math.isfinite(values[0]) and values[0] > 0:
            return float(values[0])
    return None


def _time(tiff: Tiff, exif: Directory) -> str:
    """DateTimeOriginal with its offset; "" if invalid: a clock that was never set writes zeros or blanks."""
    match = _TIME.fullmatch(tiff.text(exif, 36867))
    if match is None:
        return ""
    year, month, day, clock = match.groups()
    offset = tiff.text(exif, 36881)
    text = f"{year}-{month}-{day}T{clock}" + (offset if _OFFSET.fullmatch(offset) else "")
    try:
        datetime.fromisoformat(text)
    except ValueError:
        return ""
    return text
