"""Reads the directories of a TIFF file and the values of their tags, within the file's bounds.

camssf has its own small parser because tifffile drops a damaged tag with only a log line, and a black level lost
without an error gives wrong curves. Tags and types: TIFF 6.0, Adobe.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from camssf.errors import CalibrationError
from camssf.grid import Floats
from camssf.messages import fail

MAX_DIRECTORIES, MAX_DEPTH = 64, 4

_OTHER_RAWS = (  # (offset, bytes) that identify other raw formats; some have a valid TIFF header
    (8, b"CR\x02"),
    (4, b"ftypcrx "),
    (0, b"FUJIFILMCCD-RAW"),
    (0, b"IIU\x00"),
    (0, b"IIRO"),
    (0, b"IIRS"),
    (0, b"MMOR"),
    (0, b"FOVb"),
    (0, b"\x00MRM"),
)
_TYPES = {  # NumPy types of TIFF's field types
    1: "u1",
    2: "u1",
    3: "u2",
    4: "u4",
    5: "u4",
    6: "i1",
    7: "u1",
    8: "i2",
    9: "i4",
    10: "i4",
    11: "f4",
    12: "f8",
    13: "u4",
}
_RATIONALS = (5, 10)


@dataclass(frozen=True)
class TiffField:
    """One directory entry, whose value is not yet read: TIFF type, count, and offset of the value."""

    kind: int
    count: int
    at: int


Directory = dict[int, TiffField]


class Tiff:
    """The directories of a TIFF file; values are read on request, within the file's bounds."""

    def __init__(self, file: Path, stream: BinaryIO) -> None:
        self.file, self.stream = file, stream
        self.size = os.fstat(stream.fileno()).st_size
        if self.size == 0:
            raise fail("unreadable_raw.empty", file=file)
        magic = stream.read(16)
        if any(magic[at : at + len(word)] == word for at, word in _OTHER_RAWS):
            raise fail("unsupported_raw.no_dng", file=file)
        if magic[:4] not in (b"II*\0", b"MM\0*"):
            if magic[:4] in (b"II+\0", b"MM\0+"):
                raise fail("unsupported_raw.big_tiff", file=file)
            raise fail("unreadable_raw.no_dng", file=file)
        self.order = "<" if magic[:1] == b"I" else ">"
        self.main: list[Directory] = []
        self.all: list[Directory] = []
        self.places: set[int] = set()
        """Offsets of the directories."""
        at = self._unpack("I", 4)[0]
        while at:
            directory, at = self._directory(at, 0)
            self.main.append(directory)
        if not self.main:
            raise self.damaged("it has no directory")

    def damaged(self, what: str) -> CalibrationError:
        """The error for this file, damaged."""
        return damaged(self.file, what)

    def bytes_at(self, at: int, length: int) -> bytes:
        """`length` bytes from offset `at`; raises UnreadableRaw if the file is truncated."""
        if at < 0 or length < 0 or at + length > self.size:
            raise self.damaged(f"byte {at + length} is wanted of {self.size}")
        self.stream.seek(at)
        content = self.stream.read(length)
        if len(content) != length:
            raise self.damaged("it ends early")
        return content

    def _unpack(self, layout: str, at: int) -> tuple[int, ...]:
        layout = self.order + layout
        return struct.unpack(layout, self.bytes_at(at, struct.calcsize(layout)))

    def _directory(self, at: int, depth: int) -> tuple[Directory, int]:
        """The directory at `at`, and the offset of the next one; also reads its sub-directories into `all`."""
        if at in self.places or len(self.places) == MAX_DIRECTORIES or depth > MAX_DEPTH:
            raise self.damaged("its directories run in a circle or are too many")
        self.places.add(at)
        count = self._unpack("H", at)[0]
        entries = self.bytes_at(at + 2, 12 * count)
        directory: Directory = {}
        for number in range(count):
            tag, kind, length, value = struct.unpack_from(f"{self.order}HHII", entries, 12 * number)
            if kind in _TYPES:  # TIFF 6.0, page 16: skip fields of an unknown type
                inline = length * _width(kind) <= 4
                directory.setdefault(tag, TiffField(kind, length, at + 10 + 12 * number if inline else value))
        self.all.append(directory)
        if 330 in directory:
            if directory[330].count > MAX_DIRECTORIES:
                raise self.damaged("its directories are too many")
            for child in self.whole(directory, 330):
                self._directory(child, depth + 1)
        return directory, self._unpack("I", at + 2 + 12 * count)[0]

    def exif(self) -> Directory:
        """The Exif directory, empty where there is none."""
        if 34665 not in self.main[0]:
            return {}
        return self._directory(self.whole(self.main[0], 34665, 1)[0], 1)[0]

    def raw_bytes(self, directory: Directory, tag: int) -> bytes:
        """The value's bytes as stored, b"" if the tag is missing."""
        field = directory.get(tag)
        return self.bytes_at(field.at, field.count * _width(field.kind)) if field else b""

    def count(self, directory: Directory, tag: int) -> int:
        """The number of values, 0 if the tag is missing."""
        return directory[tag].count if tag in directory else 0

    def numbers(self, directory: Directory, tag: int, count: int | None = None) -> Floats | None:
        """The value as (count,) float64, None if the tag is missing; `count` None accepts any number of values."""
        field = directory.get(tag)
        if field is None:
            return None
        if count not in (None, field.count) or field.count == 0:
            raise self.damaged(f"tag {tag} has {field.count} values")
        values = np.frombuffer(self.raw_bytes(directory, tag), self.order + _TYPES[field.kind]).astype(float)
        if field.kind in _RATIONALS:
            with np.errstate(divide="ignore", invalid="ignore"):
                values = values[::2] / values[1::2]
        return values

    def whole(self, directory: Directory, tag: int, count: int | None = None) -> list[int]:
        """The value as whole numbers, [] if the tag is missing."""
        values = self.numbers(directory, tag, count)
        if values is None:
            return []
        if not (np.isfinite(values) & (values == np.rint(values)) & (np.abs(values) < 2**32)).all():
            raise self.damaged(f"tag {tag} holds no whole numbers")
        return [int(value) for value in values]

    def one(self, directory: Directory, tag: int, default: int) -> int:
        """A single whole number, `default` if the tag is missing."""
        return (self.whole(directory, tag, 1) or [default])[0]

    def text(self, directory: Directory, tag: int) -> str:
        """A string without its closing zero and blanks."""
        return self.raw_bytes(directory, tag).split(b"\0")[0].decode("utf-8", "replace").strip()


def damaged(name: str | Path, what: str) -> CalibrationError:
    """The error for a damaged file."""
    return fail("unreadable_raw.damaged", file=name, detail=what)


def _width(kind: int) -> int:
    """Bytes of one value of a TIFF type."""
    return int(_TYPES[kind][1]) * (2 if kind in _RATIONALS else 1)
