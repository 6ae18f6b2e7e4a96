"""Writes small DNG files byte by byte, also unusual ones, independently of the readers, tifffile and LibRaw.

Directories: TIFF 6.0 and DNG Specification 1.7. Lossless JPEG: ITU-T T.81, annex H.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

BYTE, ASCII, SHORT, LONG, RATIONAL, UNDEFINED, SRATIONAL, DOUBLE = 1, 2, 3, 4, 5, 7, 10, 12
Tags = dict[int, tuple[int, Any] | None]
_CODES = {
    BYTE: "B", ASCII: "B", SHORT: "H", LONG: "I", UNDEFINED: "B", RATIONAL: "II", SRATIONAL: "ii", DOUBLE: "d",
}  # fmt: skip
NONE, JPEG, DEFLATE = 1, 7, 8
"""TIFF's numbers of the compressions that this writer supports."""


def opcode(number: int, data: bytes, *, required: bool = False) -> bytes:
    """One opcode of DNG 1.3, optional unless `required`."""
    return struct.pack(">4I", number, 0x01030000, not required, len(data)) + data


def opcode_list(*opcodes: bytes) -> tuple[int, bytes]:
    """An opcode list as a tag value; always big-endian."""
    return UNDEFINED, struct.pack(">I", len(opcodes)) + b"".join(opcodes)


def gain_map(
    gains: Any,
    area: tuple[int, int, int, int],
    pitch: tuple[int, int] = (1, 1),
    spacing: tuple[float, float] = (1.0, 1.0),
    origin: tuple[float, float] = (0.0, 0.0),
    plane: tuple[int, int] = (0, 1),
) -> bytes:
    """A GainMap opcode of gains (v, h) or (v, h, planes) on an area (top, left, bottom, right)."""
    net = np.atleast_3d(np.asarray(gains, ">f4"))
    v, h, planes = net.shape
    return opcode(9, struct.pack(">10I4dI", *area, *plane, *pitch, v, h, *spacing, *origin, planes) + net.tobytes())


BAD_PIXELS = opcode(4, struct.pack(">2I", 0, 0))
"""FixBadPixelsConstant: samples of 0 are bad; the pattern begins with red."""
GAIN_MAP = gain_map([[1.0]], (0, 0, 64, 96))


def pack(samples: NDArray[np.integer[Any]], bits: int) -> bytes:
    """Packed rows of samples, most significant bit first; each row begins at a byte."""
    wide = (samples[..., None].astype(np.uint32) >> np.arange(bits - 1, -1, -1)) & 1
    return np.packbits(wide.reshape(len(samples), -1).astype(np.uint8), axis=1).tobytes()


def lossless_jpeg(
    samples: NDArray[np.uint16],
    bits: int,
    *,
    components: int = 2,
    predictor: int = 1,
    restart_rows: int = 0,
    transform: int = 0,
) -> bytes:
    """One lossless JPEG (SOF3) with the samples in raster order, distributed over the components.

    Args:
        samples: (h, w) of a strip or tile.
        bits: precision.
        components: number of components; that many adjacent samples form one pixel.
        predictor: 1 to 7.
        restart_rows: JPEG lines in a restart interval; 0 for none.
        transform: the point transform: number of low bits that are dropped.
    """
    planes = samples.reshape(len(samples), -1, components).astype(np.int64) >> transform
    height, width, _ = planes.shape
    head = b"\xff\xd8" + _segment(0xC4, bytes([0, *({1: 1, 6: 16}.get(n, 0) for n in range(1, 17)), *range(17)]))
    each = b"".join(struct.pack(">3B", number, 0x11, 0) for number in range(components))
    head += _segment(0xC3, struct.pack(">BHHB", bits, height, width, components) + each)
    if restart_rows:
        head += _segment(0xDD, struct.pack(">H", restart_rows * width))
    each = b"".join(struct.pack(">2B", number, 0) for number in range(components))
    head += _segment(0xDA, bytes([components]) + each + bytes([predictor, 0, transform]))
    rows = restart_rows or height
    scans = [_coded(planes[top : top + rows], predictor, bits - transform) for top in range(0, height, rows)]
    body = scans[0] + b"".join(bytes((0xFF, 0xD0 + n % 8)) + scan for n, scan in enumerate(scans[1:]))
    return head + body + b"\xff\xd9"


def _segment(marker: int, data: bytes) -> bytes:
    return struct.pack(">2BH", 0xFF, marker, len(data) + 2) + data


def _coded(planes: NDArray[np.int64], predictor: int, bits: int) -> bytes:
    """The entropy-coded bytes of one interval (rows, columns, components): T.81, H.1.2.

    The code of category 0 is one bit, 0; that of category n six bits, 31 + n.
    """
    guess = np.empty_like(planes)
    guess[0, 0] = 1 << (bits - 1)
    guess[0, 1:] = planes[0, :-1]
    guess[1:, 0] = planes[:-1, 0]
    a, b, c = planes[1:, :-1], planes[:-1, 1:], planes[:-1, :-1]
    rules = (a, b, c, a + b - c, a + ((b - c) >> 1), b + ((a - c) >> 1), (a + b) >> 1)
    guess[1:, 1:] = rules[predictor - 1]
    difference = ((planes - guess) + 32767).ravel() % 65536 - 32767
    size = np.searchsorted(1 << np.arange(17), np.abs(difference), side="right")  # the category, 0 to 16
    more = np.where(size == 16, 0, size)  # category 16 is 32768 alone
    extra = np.where(difference > 0, difference, difference + (1 << size) - 1)
    prefix = np.where(size > 0, 31 + size, 0)
    code = np.where(more > 0, (prefix << more) | extra, prefix)
    count = np.where(size > 0, 6 + more, 1)
    parts = [_bits(code[at : at + 65536], count[at : at + 65536]) for at in range(0, code.size, 65536)]
    bits_of = np.concatenate(parts)
    full = np.concatenate([bits_of, np.ones(-bits_of.size % 8, np.uint8)])
    return np.packbits(full).tobytes().replace(b"\xff", b"\xff\0")


def _bits(code: NDArray[np.int64], count: NDArray[np.int64]) -> NDArray[np.uint8]:
    """The lowest `count` bits of each code, most significant first, concatenated."""
    ends = np.repeat(np.cumsum(count), count)
    return ((np.repeat(code, count) >> (ends - 1 - np.arange(ends.size))) & 1).astype(np.uint8)


@dataclass
class Dng:
    """A DNG file to encode; `tags` (raw directory), `first` (IFD0) and `exif` override or, with None, remove tags.

    Attributes:
        samples: (h, w) uint16 as stored, before the LinearizationTable.
        cfa: colour numbers of the 2 × 2 cell.
        bits: bits a sample; packed unless 16.
        order: "<" or ">".
        compression: NONE, JPEG or DEFLATE.
        predictor: TIFF's predictor for DEFLATE: 1, or 2 for horizontal differences.
        jpeg: arguments of `lossless_jpeg`.
        tile: rows, columns; None for strips of `rows_per_strip`.
        reverse_pieces: the last piece comes first in the file.
        place: position of the raw directory: "first", "chain" (second in the chain), "sub", or "nested" (a SubIFD of
            a SubIFD).
    """

    samples: NDArray[np.uint16]
    cfa: bytes = bytes((0, 1, 1, 2))
    bits: int = 16
    order: str = "<"
    compression: int = NONE
    predictor: int = 1
    jpeg: dict[str, Any] = field(default_factory=dict)
    tile: tuple[int, int] | None = None
    rows_per_strip: int | None = None
    reverse_pieces: bool = False
    place: str = "first"
    tags: Tags = field(default_factory=dict)
    first: Tags = field(default_factory=dict)
    exif: Tags = field(default_factory=dict)

    def pieces(self) -> list[bytes]:
        """The encoded strips or tiles; tiles at the edges are padded."""
        height, width = self.samples.shape
        if self.tile:
            rows, columns = self.tile
            padded = np.pad(self.samples, ((0, -height % rows), (0, -width % columns)), mode="edge")
        else:
            rows, columns, padded = self.rows_per_strip or height, width, self.samples
        return [
            self._piece(padded[top : top + rows, left : left + columns])
            for top in range(0, padded.shape[0], rows)
            for left in range(0, padded.shape[1], columns)
        ]

    def _piece(self, block: NDArray[np.uint16]) -> bytes:
        if self.compression == JPEG:
            return lossless_jpeg(block, self.bits, **self.jpeg)
        if self.predictor == 2:
            block = np.diff(block, axis=1, prepend=np.zeros((len(block), 1), block.dtype))
        plain = block.astype(self.order + "u2").tobytes() if self.bits == 16 else pack(block, self.bits)
        return zlib.compress(plain, 9) if self.compression == DEFLATE else plain

    def encode(self) -> bytes:
        """The bytes of the file."""
        height, width = self.samples.shape
        pieces = self.pieces()
        offsets, body = [0] * len(pieces), b""
        numbers = range(len(pieces))
        for number in reversed(numbers) if self.reverse_pieces else numbers:
            offsets[number] = 8 + len(body)
            body += pieces[number]
        body += b"\0" * (-len(body) % 4)
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
        if self.predictor != 1:
            raw[317] = (SHORT, [self.predictor])
        counts = [len(piece) for piece in pieces]
        if self.tile:
            raw |= {322: (LONG, [self.tile[1]]), 323: (LONG, [self.tile[0]])}
            raw |= {324: (LONG, offsets), 325: (LONG, counts)}
        else:
            raw |= {278: (LONG, [self.rows_per_strip or height]), 273: (LONG, offsets), 279: (LONG, counts)}
        return self._assemble(body, raw | self.tags)

    def _assemble(self, body: bytes, raw: Tags) -> bytes:
        """Join header, data and directories; children before their parents, IFD0 last."""
        first: Tags = {
            271: (ASCII, b"Maker\0"),
            272: (ASCII, b"Model 1\0"),
            50706: (BYTE, bytes((1, 4, 0, 0))),
            50708: (ASCII, b"Maker Model 1\0"),
        }
        preview: Tags = {254: (LONG, [1]), 256: (LONG, [2]), 257: (LONG, [2]), 258: (SHORT, [8])}
        preview |= {259: (SHORT, [1]), 262: (SHORT, [1]), 273: (LONG, [8]), 277: (SHORT, [1])}
        preview |= {278: (LONG, [2]), 279: (LONG, [4])}

        def add(tags: Tags, following: int = 0) -> int:
            nonlocal body
            at = 8 + len(body)
            body += self._directory(tags, at, following)
            return at

        following = 0
        if self.exif:
            first |= {34665: (LONG, [add(self.exif)])}
        if self.place == "first":
            first |= raw
        elif self.place == "chain":
            following, first = add(raw), first | preview
        elif self.place == "sub":
            first |= preview | {330: (LONG, [add(raw)])}
        else:
            inner = add(raw)
            first |= preview | {330: (LONG, [add(preview), add(preview | {330: (LONG, [inner])})])}
        start = add(first | self.first, following)
        magic = b"II*\0" if self.order == "<" else b"MM\0*"
        return magic + struct.pack(self.order + "I", start) + body

    def _directory(self, tags: Tags, at: int, following: int) -> bytes:
        """One directory for byte offset `at`, followed by its long values."""
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
        number = struct.pack(self.order + "H", len(present))
        return number + entries + struct.pack(self.order + "I", following) + values
