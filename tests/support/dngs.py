"""Writes small DNG files byte by byte, also unusual ones, independently of the readers, tifffile and LibRaw."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

BYTE, ASCII, SHORT, LONG, RATIONAL, UNDEFINED, SRATIONAL = 1, 2, 3, 4, 5, 7, 10
Tags = dict[int, tuple[int, Any] | None]
_CODES = {BYTE: "B", ASCII: "B", SHORT: "H", LONG: "I", UNDEFINED: "B", RATIONAL: "II", SRATIONAL: "ii"}
DEFLATE = 8
"""TIFF's number of the compression."""


def opcode(number: int, data: bytes) -> bytes:
    """One opcode of DNG 1.3, which may be skipped."""
    return struct.pack(">4I", number, 0x01030000, 1, len(data)) + data


def opcode_list(*opcodes: bytes) -> tuple[int, bytes]:
    """An opcode list as a tag value; always big-endian."""
    return UNDEFINED, struct.pack(">I", len(opcodes)) + b"".join(opcodes)


def gain_map(
    gains: Any,
    area: tuple[int, int, int, int],
    pitch: tuple[int, int] = (1, 1),
    spacing: tuple[float, float] = (1.0, 1.0),
    origin: tuple[float, float] = (0.0, 0.0),
) -> bytes:
    """A GainMap opcode of gains (v, h) on an area (top, left, bottom, right)."""
    net = np.asarray(gains, ">f4")
    return opcode(9, struct.pack(">10I4dI", *area, 0, 1, *pitch, *net.shape, *spacing, *origin, 1) + net.tobytes())


BAD_PIXELS = opcode(4, struct.pack(">2I", 0, 0))
"""FixBadPixelsConstant: samples of 0 are bad; the pattern begins with red."""
GAIN_MAP = gain_map([[1.0]], (0, 0, 64, 96))


def pack(samples: NDArray[np.integer[Any]], bits: int) -> bytes:
    """Packed rows of samples, most significant bit first; each row begins at a byte."""
    wide = (samples[..., None].astype(np.uint32) >> np.arange(bits - 1, -1, -1)) & 1
    return np.packbits(wide.reshape(len(samples), -1).astype(np.uint8), axis=1).tobytes()


@dataclass
class Dng:
    """A DNG file to encode; `tags` (raw directory), `first` (IFD0) and `exif` override or, with None, remove tags."""

    samples: NDArray[np.uint16]  # (h, w) as stored, before the LinearizationTable
    cfa: bytes = bytes((0, 1, 1, 2))  # colour numbers of the 2 × 2 cell
    bits: int = 16  # a sample; packed unless 16
    order: str = "<"  # or ">"
    compression: int = 1  # none, or DEFLATE
    rows_per_strip: int | None = None
    sub: bool = False  # whether the raw directory is a SubIFD, not IFD0
    tags: Tags = field(default_factory=dict)
    first: Tags = field(default_factory=dict)
    exif: Tags = field(default_factory=dict)

    def _strip(self, block: NDArray[np.uint16]) -> bytes:
        plain = block.astype(self.order + "u2").tobytes() if self.bits == 16 else pack(block, self.bits)
        return zlib.compress(plain, 9) if self.compression == DEFLATE else plain

    def encode(self) -> bytes:
        """The bytes of the file."""
        height, width = self.samples.shape
        rows = self.rows_per_strip or height
        strips = [self._strip(self.samples[top : top + rows]) for top in range(0, height, rows)]
        body = b"".join(strips)
        ends = np.cumsum([8, *map(len, strips)]).tolist()
        body += b"\0" * (-len(body) % 4)
        raw: Tags = {
            254: (LONG, [0]), 256: (LONG, [width]), 257: (LONG, [height]), 258: (SHORT, [self.bits]),
            259: (SHORT, [self.compression]), 262: (SHORT, [32803]), 273: (LONG, ends[:-1]), 277: (SHORT, [1]),
            278: (LONG, [rows]), 279: (LONG, [len(strip) for strip in strips]), 284: (SHORT, [1]),
            33421: (SHORT, [2, 2]), 33422: (BYTE, self.cfa), 50717: (LONG, [2**self.bits - 1]),
        }  # fmt: skip
        return self._assemble(body, raw | self.tags)

    def _assemble(self, body: bytes, raw: Tags) -> bytes:
        """Join header, data and directories; children before their parents, IFD0 last."""
        first: Tags = {
            271: (ASCII, b"Maker\0"), 272: (ASCII, b"Model 1\0"), 50706: (BYTE, bytes((1, 4, 0, 0))),
            50708: (ASCII, b"Maker Model 1\0"),
        }  # fmt: skip
        preview: Tags = {
            254: (LONG, [1]), 256: (LONG, [2]), 257: (LONG, [2]), 258: (SHORT, [8]), 259: (SHORT, [1]),
            262: (SHORT, [1]), 273: (LONG, [8]), 277: (SHORT, [1]), 278: (LONG, [2]), 279: (LONG, [4]),
        }  # fmt: skip

        def add(tags: Tags) -> int:
            nonlocal body
            at = 8 + len(body)
            body += self._directory(tags, at)
            return at

        if self.exif:
            first |= {34665: (LONG, [add(self.exif)])}
        first |= preview | {330: (LONG, [add(raw)])} if self.sub else raw
        start = add(first | self.first)
        magic = b"II*\0" if self.order == "<" else b"MM\0*"
        return magic + struct.pack(self.order + "I", start) + body

    def _directory(self, tags: Tags, at: int) -> bytes:
        """One directory for byte offset `at`, followed by its long values."""
        present = sorted((tag, value) for tag, value in tags.items() if value is not None)
        values_at = at + 2 + 12 * len(present) + 4
        entries, values = b"", b""
        for tag, (kind, content) in present:
            code = _CODES[kind]
            flat: list[Any] = list(content)
            count = len(flat) // len(code)
            data = struct.pack(f"{self.order}{len(flat)}{code[0]}", *flat)
            if len(data) <= 4:
                value = data.ljust(4, b"\0")
            else:
                value = struct.pack(self.order + "I", values_at + len(values))
                values += data + b"\0" * (-len(data) % 4)
            entries += struct.pack(self.order + "HHI", tag, kind, count) + value
        number = struct.pack(self.order + "H", len(present))
        return number + entries + bytes(4) + values


FIRST = {271: "Maker", 272: "Model", 50735: "body 9"}
EXIF = {
    42036: "Wide 24 mm", 37386: (247, 10), 33437: (18, 10), 36867: "2026:11:20 09:15:00", 36881: "+01:00",
}  # fmt: skip
"""Tags of a photo's two directories."""


def told(first: dict[int, Any], exif: dict[int, Any]) -> bytes:
    """A small DNG whose directories say this: text, a whole number, or (numerator, denominator)."""

    def coded(value: Any) -> tuple[int, Any]:
        if isinstance(value, str):
            return ASCII, value.encode() + b"\0"
        return (LONG, [value]) if isinstance(value, int) else (RATIONAL, value)

    ours: Tags = dict.fromkeys((271, 272, 50708))
    tags = [{tag: coded(value) for tag, value in each.items()} for each in (first, exif)]
    return Dng(np.zeros((2, 2), np.uint16), first=ours | tags[0], exif=dict(tags[1])).encode()
