"""What a photo's tags say of the unit that took it, and when."""

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from camssf.errors import UnreadableRaw
from camssf.photo.read.unit import Taken, Unit, read_unit, serial_check
from tests.support.dngs import EXIF, FIRST, told

BODY = Unit("Maker", "Model", "", "body 9", serial_check("Maker", "Model", "body 9"))
WHOLE = replace(BODY, lens="Wide 24 mm", focal_length=24.7, aperture=1.8)
OTHER = replace(WHOLE, serial="serial 1", serial_check=serial_check("Maker", "Model", "serial 1"))
DAY = "2026:11:20 09:15:00"


@pytest.mark.parametrize(("first", "exif", "unit", "time"), [
    (FIRST, EXIF, WHOLE, "2026-11-20T09:15:00+01:00"),
    (FIRST, EXIF | {42033: "serial 1"}, OTHER, "2026-11-20T09:15:00+01:00"),
    (FIRST, {36867: DAY}, BODY, "2026-11-20T09:15:00"),
    ({271: "Maker", 50708: "Unique"}, {}, Unit("Maker", "Unique"), ""),
    ({}, {36867: "0000:00:00 00:00:00"}, Unit(), ""),
    ({}, {36867: "    :  :     :  :  "}, Unit(), ""),
    ({}, {36867: "2026:13:45 99:99:99"}, Unit(), ""),
    ({}, {37386: (0, 1), 33437: (1, 0)}, Unit(), ""),
    ({37386: (50, 1), 33437: (4, 1)}, {}, Unit(focal_length=50.0, aperture=4.0), ""),
])  # fmt: skip
def test_what_a_file_says(tmp_path: Path, first: Any, exif: Any, unit: Unit, time: str) -> None:
    file = tmp_path / "a.dng"
    file.write_bytes(told(first, exif))
    assert read_unit(file) == Taken(unit, time, hashlib.sha256(file.read_bytes()).hexdigest())


def test_files_that_cannot_tell(tmp_path: Path) -> None:
    """Missing, a folder, cut off anywhere."""
    whole = told(FIRST, EXIF)
    file = tmp_path / "a.dng"
    for path in (file, tmp_path):
        with pytest.raises(UnreadableRaw):
            read_unit(path)
    cut = [whole[:length] for length in range(0, len(whole), 7)]  # before the end of the first directory
    end = len(told(FIRST | {34665: 0}, {}))
    for data in (*cut, *(told(FIRST | {34665: end + place}, {}) for place in (-1, 99))):  # and of the other
        file.write_bytes(data)
        with pytest.raises(UnreadableRaw):
            read_unit(file)


def test_units_that_differ() -> None:
    assert WHOLE.differs(Unit()) == WHOLE.differs(WHOLE) == ()
    assert WHOLE.differs(replace(WHOLE, serial="x", aperture=2.0)) == ("serial", "aperture")
    assert Unit(lens="Wide 24 mm").filled(WHOLE) == WHOLE
