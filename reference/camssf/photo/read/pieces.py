"""Decodes the strips and tiles of a stored picture to the samples of its active area.

Plain and deflated samples are unpacked here. LibRaw decodes lossless JPEG, but of several strips only the first, and
it breaks the rows of tiles that are wider than the picture. So it gets the JPEGs alone, one below the other, as the
tiles of a DNG made for this purpose.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.errors import UnreadableRaw, UnsupportedRaw
from camssf.photo.read.jpeg import Jpeg, read_jpeg
from camssf.photo.read.tiff import CONVERT, COPY_AGAIN, Directory, Tiff

PLAIN, LOSSLESS_JPEG, DEFLATE = 1, 7, 8
MAX_SIDE, MAX_PIECES = 65535, 1 << 16
MAX_DEFLATE = 1032
"""Largest compression ratio of deflate."""
CHUNK = 1 << 18
"""Samples unpacked at a time."""
STACK = 1 << 24
"""Largest number of samples that LibRaw decodes at a time, unless one JPEG has more."""
TALLEST, SMALLEST = 60000, 22
"""Largest height and smallest side of a picture that LibRaw accepts."""

Samples = NDArray[np.uint16]


@dataclass(frozen=True)
class Picture:
    """Layout of the stored picture, and its pieces: strips or tiles, row by row from the top left.

    Attributes:
        width, height: samples.
        bits: bits of a sample.
        compression: PLAIN, LOSSLESS_JPEG or DEFLATE.
        differences: True if deflate holds differences of neighbours (TIFF's predictor 2).
        area: the active area: top, left, bottom, right.
        tiled: True for tiles, padded at the edges; False for strips, of which the last may have fewer rows.
        piece_width, piece_height: samples of a piece.
        offsets, counts: position and length of each piece in the file, bytes.
    """

    width: int
    height: int
    bits: int
    compression: int
    differences: bool
    area: tuple[int, int, int, int]
    tiled: bool
    piece_width: int
    piece_height: int
    offsets: list[int]
    counts: list[int]

    @property
    def row_bytes(self) -> int:
        """Bytes of an unpacked row of a piece."""
        return -(-self.piece_width * self.bits // 8)

    def rows(self, number: int) -> int:
        """Number of rows stored in piece `number`."""
        return self.piece_height if self.tiled else min(self.piece_height, self.height - number * self.piece_height)

    def corner(self, number: int) -> tuple[int, int]:
        """Top and left of piece `number` in the picture."""
        across = -(-self.width // self.piece_width)
        return number // across * self.piece_height, number % across * self.piece_width


def picture_of(
    tiff: Tiff, raw: Directory, size: tuple[int, int], coding: tuple[int, int], area: tuple[int, int, int, int]
) -> Picture:
    """Read the layout of a picture and check it against the file's size.

    `size` is (width, height), `coding` is (bits, compression).

    Raises:
        UnreadableRaw: the pieces cannot hold the picture.
        UnsupportedRaw: a form of deflate that camssf does not read.
    """
    (width, height), (bits, compression) = size, coding
    tiled = 322 in raw or 323 in raw
    if tiled:
        across, down = tiff.one(raw, 322, 0), tiff.one(raw, 323, 0)
    else:
        across, down = width, min(tiff.one(raw, 278, height), height)
    if not (0 < across <= MAX_SIDE and 0 < down <= MAX_SIDE):
        raise tiff.damaged(f"pieces of {across} × {down} samples")
    pieces = -(-width // across) * -(-height // down)
    if pieces > MAX_PIECES:
        raise tiff.damaged(f"its samples in {pieces} pieces")
    tags = (324, 325) if tiled else (273, 279)
    for tag in tags:
        if tiff.count(raw, tag) != pieces:
            raise tiff.damaged(f"{tiff.count(raw, tag)} pieces of data instead of {pieces}")
    differences = _differences(tiff, raw, bits, compression)
    offsets, counts = (tiff.whole(raw, tag) for tag in tags)
    found = Picture(width, height, bits, compression, differences, area, tiled, across, down, offsets, counts)
    _check_extent(tiff, found)
    return found


def _differences(tiff: Tiff, raw: Directory, bits: int, compression: int) -> bool:
    """True for deflate's predictor 2: each sample is stored as the difference from its left neighbour."""
    predictor = tiff.one(raw, 317, 1) if compression == DEFLATE else 1
    if predictor != 1 and (predictor != 2 or bits % 8):
        raise UnsupportedRaw(
            f"{tiff.file} uses deflate with predictor {predictor} on samples of {bits} bits.", CONVERT
        )
    return predictor == 2


def _check_extent(tiff: Tiff, picture: Picture) -> None:
    """Raise unless every piece lies in the file and can hold its samples, and all fit into the file together."""
    for number, (at, count) in enumerate(zip(picture.offsets, picture.counts, strict=True)):
        if at < 8 or count < 1 or at + count > tiff.size:
            raise tiff.damaged(f"its samples end at byte {at + count} of {tiff.size}")
        rows = picture.rows(number)
        least = {
            PLAIN: rows * picture.row_bytes,
            LOSSLESS_JPEG: -(-rows * picture.piece_width // 8),  # at least one bit a sample
            DEFLATE: rows * picture.row_bytes // MAX_DEFLATE,
        }[picture.compression]
        if count < least:
            raise tiff.damaged(f"piece {number} of its data is too short")
    if sum(picture.counts) > tiff.size:  # otherwise a small file could request much memory
        raise tiff.damaged("its pieces of data overlap")


def decode(tiff: Tiff, picture: Picture, table: Samples | None) -> Samples:
    """The active area's samples, through the linearization `table` (65536,) if there is one.

    Pieces outside the active area are not decoded.
    """
    top, left, bottom, right = picture.area
    samples = np.empty((bottom - top, right - left), np.uint16)
    wanted = []
    for number in range(len(picture.offsets)):
        y, x = picture.corner(number)
        if top < y + picture.rows(number) and y < bottom and left < x + picture.piece_width and x < right:
            wanted.append(number)
    for y, x, rows in _rows(tiff, picture, wanted):
        first, last = max(top, y), min(bottom, y + len(rows))
        start, end = max(left, x), min(right, x + rows.shape[1])
        if first < last:
            part = rows[first - y : last - y, start - x : end - x]
            samples[first - top : last - top, start - left : end - left] = part if table is None else table[part]
    return samples


def _rows(tiff: Tiff, picture: Picture, wanted: list[int]) -> Iterator[tuple[int, int, Samples]]:
    """Decode the pieces in blocks of rows; yields top, left and samples of each block."""
    if picture.compression == LOSSLESS_JPEG:
        for number, rows in _jpegs(tiff, picture, wanted):
            yield *picture.corner(number), rows
        return
    some = max(1, CHUNK // picture.piece_width)
    order = tiff.order if picture.bits == 16 else ">"
    for number in wanted:
        y, x = picture.corner(number)
        stream = _Inflated(tiff, picture, number) if picture.compression == DEFLATE else None
        for row in range(0, picture.rows(number), some):
            count = min(some, picture.rows(number) - row)
            length = count * picture.row_bytes
            if stream is None:
                data = tiff.bytes_at(picture.offsets[number] + row * picture.row_bytes, length)
            else:
                data = stream.read(length)
            rows = unpacked(data, count, picture.piece_width, picture.bits, order)
            if picture.differences:
                rows = np.cumsum(rows, axis=1, dtype=np.uint16) & np.uint16((1 << picture.bits) - 1)
            yield y + row, x, rows
        if stream is not None:
            stream.finish()


def unpacked(data: bytes, rows: int, width: int, bits: int, order: str) -> Samples:
    """Unpack (rows, width) samples: 8 or 16 bits in `order`; others highest bit first, rows padded to bytes."""
    if bits in (8, 16):
        return np.frombuffer(data, f"{order}u{bits // 8}").reshape(rows, width).astype(np.uint16)
    packed = np.frombuffer(data, np.uint8).reshape(rows, -1)
    groups = -(-width // 8)  # eight samples take `bits` bytes
    padded = np.zeros((rows, groups * bits + 2), np.uint32)
    padded[:, : packed.shape[1]] = packed
    samples = np.empty((rows, groups, 8), np.uint16)
    for k in range(8):
        byte, bit = divmod(k * bits, 8)
        a, b, c = (padded[:, byte + i : byte + i + groups * bits : bits][:, :groups] for i in range(3))
        samples[:, :, k] = ((a << 16 | b << 8 | c) >> (24 - bits - bit)) & ((1 << bits) - 1)
    return samples.reshape(rows, -1)[:, :width]


class _Inflated:
    """Reader of a piece's zlib stream."""

    def __init__(self, tiff: Tiff, picture: Picture, number: int) -> None:
        self.tiff = tiff
        self.stream = zlib.decompressobj()
        self.left = tiff.bytes_at(picture.offsets[number], picture.counts[number])

    def read(self, length: int) -> bytes:
        """The next `length` bytes."""
        try:
            data = self.stream.decompress(self.left, length)
        except zlib.error as error:
            raise self.tiff.damaged("its deflated samples") from error
        self.left = self.stream.unconsumed_tail
        if len(data) < length:
            raise self.tiff.damaged("its deflated samples end early")
        return data

    def finish(self) -> None:
        """Raise unless the stream ends here with the right checksum."""
        try:
            more = self.stream.decompress(self.left, 1)
        except zlib.error as error:
            raise self.tiff.damaged("its deflated samples") from error
        if more:
            raise self.tiff.damaged("its deflated samples are too many")
        if not self.stream.eof:
            raise self.tiff.damaged("its deflated samples have no end")


def _jpegs(tiff: Tiff, picture: Picture, wanted: list[int]) -> Iterator[tuple[int, Samples]]:
    """Number and samples of each piece, decoded in batches of one width and at most `STACK` samples."""
    batch: list[tuple[int, Jpeg]] = []
    lines = parts = 0
    for number in wanted:
        data = tiff.bytes_at(picture.offsets[number], picture.counts[number])
        jpeg = read_jpeg(tiff, data, picture.piece_width * picture.rows(number))
        tall = max(lines, jpeg.parts[0].lines) * (parts + len(jpeg.parts))
        if batch and (jpeg.width != batch[0][1].width or tall > TALLEST or tall * jpeg.width > STACK):
            yield from _stacked(tiff, picture, batch)
            batch, lines, parts = [], 0, 0
        batch.append((number, jpeg))
        lines, parts = max(lines, jpeg.parts[0].lines), parts + len(jpeg.parts)
    if batch:
        yield from _stacked(tiff, picture, batch)


def _stacked(tiff: Tiff, picture: Picture, batch: list[tuple[int, Jpeg]]) -> Iterator[tuple[int, Samples]]:
    """Decode JPEGs of one width by LibRaw; yields number and samples of each piece."""
    import rawpy

    width = batch[0][1].width
    lines = max(jpeg.parts[0].lines for _, jpeg in batch)
    tiles = [part.content for _, jpeg in batch for part in jpeg.parts]
    content = _dng(tiles, width, lines, tiff.raw_bytes(tiff.main[0], 50706))
    try:
        with rawpy.imread(io.BytesIO(content)) as raw:
            stored = raw.raw_image
            if stored is None or len(stored) < lines * len(tiles):
                raise UnreadableRaw(f"{tiff.file} cannot be decoded: LibRaw finds no samples.", COPY_AGAIN)
            at = 0
            for number, jpeg in batch:
                parts = []
                for part in jpeg.parts:
                    parts.append(stored[at : at + part.lines, :width])
                    jpeg.check(tiff, part, parts[-1])
                    at += lines
                whole = parts[0] if len(parts) == 1 else np.concatenate(parts)
                if jpeg.shift:
                    whole = whole << np.uint16(jpeg.shift)
                yield number, whole.reshape(-1, picture.piece_width)
    except rawpy.LibRawError as error:
        raise UnreadableRaw(f"{tiff.file} cannot be decoded: LibRaw says {error}.", COPY_AGAIN) from error


def _dng(tiles: list[bytes], width: int, lines: int, version: bytes) -> bytes:
    """A DNG of tiles of one width, one below the other; tiles too small for LibRaw are repeated."""
    across, down = 1 if width >= SMALLEST else SMALLEST, max(len(tiles), -(-SMALLEST // lines))
    places, at = [], 8
    for tile in tiles:
        places.append(at)
        at += len(tile)
    order = [min(row, len(tiles) - 1) for row in range(down) for _ in range(across)]
    offsets, counts = ([values[i] for i in order] for values in (places, [len(tile) for tile in tiles]))
    longs = {256: [across * width], 257: [down * lines], 322: [width], 323: [lines], 324: offsets, 325: counts}
    shorts = {258: [16], 259: [7], 262: [32803], 277: [1], 33421: [2, 2]}
    values = {tag: (4, struct.pack(f"<{len(v)}I", *v), len(v)) for tag, v in longs.items()}
    values |= {tag: (3, struct.pack(f"<{len(v)}H", *v), len(v)) for tag, v in shorts.items()}
    values |= {33422: (1, bytes((0, 1, 1, 2)), 4), 50706: (1, version[:4].ljust(4, b"\0"), 4)}
    start = at + at % 2
    behind = start + 2 + 12 * len(values) + 4
    entries = more = b""
    for tag, (kind, value, count) in sorted(values.items()):
        if len(value) > 4:
            more, value = more + value, struct.pack("<I", behind + len(more))
        entries += struct.pack("<HHI", tag, kind, count) + value.ljust(4, b"\0")
    head = b"II*\0" + struct.pack("<I", start)
    directory = struct.pack("<H", len(values)) + entries + bytes(4) + more
    return b"".join([head, *tiles, bytes(at % 2), directory])
