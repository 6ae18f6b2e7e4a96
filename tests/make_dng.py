"""A byte-level writer of small DNG files, odd ones included: independent of the reader and of tifffile."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

BYTE, ASCII, SHORT, LONG, RATIONAL, UNDEFINED, SRATIONAL = 1, 2, 3, 4, 5, 7, 10
Tags = dict[int, tuple[int, Any] | None]
_CODES = {BYTE: "B", ASCII: "B", SHORT: "H", LONG: "I", UNDEFINED: "B", RATIONAL: "II", SRATIONAL: "ii"}

GAIN_MAP = struct.pack(">I", 9) + struct.pack(">3I", 0x01030000, 1, 4) + b"\0\0\0\0"
BAD_PIXELS = struct.pack(">4I", 4, 0x01030000, 1, 8) + b"\0" * 8


def opcode_list(*opcodes: bytes) -> tuple[int, bytes]:
    """An opcode list as a tag value; big-endian in every file."""
    return UNDEFINED, struct.pack(">I", len(opcodes)) + b"".join(opcodes)


def pack(samples: NDArray[np.integer[Any]], bits: int) -> bytes:
    """Rows of samples, most significant bit first, each row beginning on a byte."""
    wide = (samples[..., None].astype(np.uint32) >> np.arange(bits - 1, -1, -1)) & 1
    return np.packbits(wide.reshape(len(samples), -1).astype(np.uint8), axis=1).tobytes()


def lossless_jpeg(samples: NDArray[np.uint16], bits: int) -> bytes:
    """One lossless JPEG of two components, as a colour filter row alternates two colours."""
    import imagecodecs

    height, width = samples.shape
    pairs = np.ascontiguousarray(samples).reshape(height, width // 2, 2)
    return bytes(imagecodecs.jpeg_encode(pairs, lossless=True, bitspersample=bits))


@dataclass
class Dng:
    """A DNG to be; `tags` (raw directory), `first` (IFD0) and `exif` override or, with None, remove."""

    samples: NDArray[np.uint16]
    cfa: bytes = bytes((0, 1, 1, 2))
    bits: int = 16
    order: str = "<"
    compression: int = 1
    tile: tuple[int, int] | None = None
    rows_per_strip: int | None = None
    reverse_pieces: bool = False
    in_subifd: bool = False
    tags: Tags = field(default_factory=dict)
    first: Tags = field(default_factory=dict)
    exif: Tags = field(default_factory=dict)

    def pieces(self) -> list[bytes]:
        """The strips or tiles, edge tiles padded."""
        height, width = self.samples.shape
        if self.tile:
            rows, columns = self.tile
            padded = np.pad(self.samples, ((0, -height % rows), (0, -width % columns)), mode="edge")
        else:
            rows, columns, padded = self.rows_per_strip or height, width, self.samples
        blocks = [
            padded[top : top + rows, left : left + columns]
            for top in range(0, padded.shape[0], rows)
            for left in range(0, padded.shape[1], columns)
        ]
        if self.compression == 7:
            return [lossless_jpeg(block, self.bits) for block in blocks]
        if self.bits == 16:
            return [block.astype(self.order + "u2").tobytes() for block in blocks]
        return [pack(block, self.bits) for block in blocks]

    def encode(self) -> bytes:
        """The file."""
        height, width = self.samples.shape
        pieces = self.pieces()
        counts = [len(piece) for piece in pieces]
        at, offsets = 8, [0] * len(pieces)
        numbers = range(len(pieces))
        body = b""
        for number in reversed(numbers) if self.reverse_pieces else numbers:
            offsets[number] = at
            body += pieces[number]
            at += counts[number]
        body += b"\0" * (-at % 4)
        raw: Tags = {
            254: (LONG, [0]),
            256: (LONG, [width]),
            257: (LONG, [height]),
            258: (SHORT, [self.bits]),
            259: (SHORT, [self.compression]),
            262: (SHORT, [32803]),
            277: (SHORT, [1]),
            284: (SHORT, [1]),
            33421: (SHORT, [2, 2]),
            33422: (BYTE, self.cfa),
            50717: (LONG, [2**self.bits - 1]),
        }
        if self.tile:
            raw |= {322: (LONG, [self.tile[1]]), 323: (LONG, [self.tile[0]])}
            raw |= {324: (LONG, offsets), 325: (LONG, counts)}
        else:
            raw |= {278: (LONG, [self.rows_per_strip or height]), 273: (LONG, offsets), 279: (LONG, counts)}
        first: Tags = {
            271: (ASCII, b"Maker\0"),
            272: (ASCII, b"Model 1\0"),
            50706: (BYTE, bytes((1, 4, 0, 0))),
            50708: (ASCII, b"Maker Model 1\0"),
        }
        start = 8 + len(body)
        if self.exif:
            child = self._directory(self.exif, start)
            first |= {34665: (LONG, [start])}
            body, start = body + child, start + len(child)
        if self.in_subifd:
            child = self._directory(raw | self.tags, start)
            preview: Tags = {254: (LONG, [1]), 256: (LONG, [2]), 257: (LONG, [2]), 258: (SHORT, [8])}
            preview |= {259: (SHORT, [1]), 262: (SHORT, [1]), 273: (LONG, [8]), 277: (SHORT, [1])}
            first |= preview | {278: (LONG, [2]), 279: (LONG, [4]), 330: (LONG, [start])}
            body, start = body + child, start + len(child)
        else:
            first |= raw | self.tags
        directory = self._directory(first | self.first, start)
        magic = b"II*\0" if self.order == "<" else b"MM\0*"
        return magic + struct.pack(self.order + "I", start) + body + directory

    def _directory(self, tags: Tags, at: int) -> bytes:
        """One directory that will lie at byte `at`, its long values behind it."""
        present = sorted((tag, value) for tag, value in tags.items() if value is not None)
        values_at = at + 2 + 12 * len(present) + 4
        entries, values = b"", b""
        for tag, (kind, content) in present:
            code = _CODES[kind]
            items: Iterable[Any] = content
            flat = list(items)
            count = len(flat) // len(code)
            data = struct.pack(f"{self.order}{len(flat)}{code[0]}", *flat)
            if len(data) <= 4:
                value = data.ljust(4, b"\0")
            else:
                value = struct.pack(self.order + "I", values_at + len(values))
                values += data + b"\0" * (-len(data) % 4)
            entries += struct.pack(self.order + "HHI", tag, kind, count) + value
        return struct.pack(self.order + "H", len(present)) + entries + b"\0\0\0\0" + values
