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
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from camssf.errors import RawError
from camssf.messages import fail
from camssf.photo.read.jpeg import Jpeg, read_jpeg
from camssf.photo.read.tiff import Directory, Tiff, damaged
from camssf.photo.read.unit import Area

PLAIN, LOSSLESS_JPEG, DEFLATE = 1, 7, 8
MAX_SIDE, MAX_PIECES = 65535, 1 << 16
MAX_SAMPLES = 220_000_000
"""Largest number of samples of a photo (SECURITY.md); phones' largest mosaics have 201 million."""
MAX_DEFLATE = 1032
"""Largest compression ratio of deflate."""
CHUNK = 1 << 18
"""Samples unpacked at a time."""
STACK = 1 << 24
"""Largest number of samples that LibRaw decodes at a time, unless one JPEG has more."""
TALLEST, SMALLEST = 60000, 22
"""Largest height and smallest side of a picture that LibRaw accepts."""

MAX_TABLES = 1 << 16
"""Bytes allowed for a JPEG's headers; its samples take less than twice their plain size."""
PAIRS = 64
"""Pairs of rows that are compared to tell whether rows are padded."""

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
        offsets, ends: first byte of each piece in the file, and the byte behind its last.
        stride: bytes from row to row of an uncompressed piece.
    """

    width: int
    height: int
    bits: int
    compression: int
    differences: bool
    area: Area
    tiled: bool
    piece_width: int
    piece_height: int
    offsets: list[int]
    ends: list[int]
    stride: int

    @property
    def row_bytes(self) -> int:
        """Bytes of an unpacked row of a piece."""
        return -(-self.piece_width * self.bits // 8)

    def order(self, tiff: Tiff) -> str:
        """Byte order of the samples: packed ones have the highest bit first in every file."""
        return tiff.order if self.bits == 16 else ">"

    def rows(self, number: int) -> int:
        """Number of rows stored in piece `number`."""
        return self.piece_height if self.tiled else min(self.piece_height, self.height - number * self.piece_height)

    def corner(self, number: int) -> tuple[int, int]:
        """Top and left of piece `number` in the picture."""
        across = -(-self.width // self.piece_width)
        return number // across * self.piece_height, number % across * self.piece_width


def check_size(name: str | Path, width: int, height: int) -> None:
    """Check the number of samples of a photo before they are decoded.

    Raises:
        UnreadableRaw: a side that no photo has.
        UnsupportedRaw: more than MAX_SAMPLES.
    """
    if not (2 <= width <= MAX_SIDE and 2 <= height <= MAX_SIDE):
        raise damaged(name, f"a picture of {width} × {height} samples")
    if width * height > MAX_SAMPLES:
        raise fail("unsupported_raw.too_large", file=name, width=width, height=height, most=MAX_SAMPLES // 1_000_000)


def picture_of(tiff: Tiff, raw: Directory, size: tuple[int, int], coding: tuple[int, int], area: Area) -> Picture:
    """Read the layout of a picture and check it against the file's size.

    `size` is (width, height), `coding` is (bits, compression). Like LibRaw, it does not trust the byte counts, which
    some writers compute wrongly: a piece reaches to the next piece or directory, or to the file's end.

    Raises:
        UnreadableRaw: the pieces cannot hold the picture.
        UnsupportedRaw: a form of deflate that camssf does not read, or too many samples.
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
    row_bytes = -(-across * bits // 8)
    picture = Picture(
        width, height, bits, compression, differences, area, tiled, across, down, offsets, _ends(tiff, offsets),
        row_bytes,
    )  # fmt: skip
    _check_extent(tiff, picture)
    check_size(tiff.file, width, height)
    return replace(picture, stride=_stride(tiff, picture, counts))


def _differences(tiff: Tiff, raw: Directory, bits: int, compression: int) -> bool:
    """True for deflate's predictor 2: each sample is stored as the difference from its left neighbour."""
    predictor = tiff.one(raw, 317, 1) if compression == DEFLATE else 1
    if predictor != 1 and (predictor != 2 or bits % 8):
        raise fail("unsupported_raw.deflate_predictor", file=tiff.file, predictor=predictor, bits=bits)
    return predictor == 2


def _ends(tiff: Tiff, offsets: list[int]) -> list[int]:
    """The byte behind each piece's last: the next piece or directory, or the file's end."""
    following = dict(pairwise(sorted({*offsets, *tiff.places, tiff.size})))
    return [following.get(at, tiff.size) for at in offsets]


def _check_extent(tiff: Tiff, picture: Picture) -> None:
    """Raise unless every piece can hold its samples."""
    if len(set(picture.offsets)) < len(picture.offsets):  # otherwise a small file could request much memory
        raise tiff.damaged("its pieces of data overlap")
    for number, (at, end) in enumerate(zip(picture.offsets, picture.ends, strict=True)):
        rows = picture.rows(number)
        least = {
            PLAIN: rows * picture.row_bytes,
            LOSSLESS_JPEG: -(-rows * picture.piece_width // 8),  # at least one bit a sample
            DEFLATE: max(1, rows * picture.row_bytes // MAX_DEFLATE),
        }[picture.compression]
        if at < 8 or at >= tiff.size:
            raise tiff.damaged(f"its samples end at byte {at + least} of {tiff.size}")
        if at + least > end:
            raise tiff.damaged(f"piece {number} of its data is too short")


def _stride(tiff: Tiff, picture: Picture, counts: list[int]) -> int:
    """Bytes from row to row: more than a row's own if the byte counts allow for padding and the samples show it.

    Neighbouring rows of one colour resemble each other if they are read with the right stride.
    """
    plain, rows = picture.row_bytes, picture.rows(0)
    padded = counts[0] // rows
    fits = all(
        count in (picture.rows(number) * padded, picture.piece_height * padded)
        and picture.offsets[number] + picture.rows(number) * padded <= picture.ends[number]
        for number, count in enumerate(counts)
    )
    if picture.compression != PLAIN or padded <= plain or not fits or rows < 3:
        return plain
    steps = range(0, rows - 2, max(1, (rows - 2) // PAIRS))
    if 10 * _unlike(tiff, picture, padded, steps) < 9 * _unlike(tiff, picture, plain, steps):
        return padded
    return plain


def _unlike(tiff: Tiff, picture: Picture, stride: int, steps: range) -> int:
    """Sum of absolute differences between rows of the first piece and the rows two below."""

    def row(y: int) -> NDArray[np.int64]:
        data = tiff.bytes_at(picture.offsets[0] + y * stride, picture.row_bytes)
        return unpacked(data, 1, picture.piece_width, picture.bits, picture.order(tiff)).astype(np.int64)

    return sum(int(np.abs(row(y + 2) - row(y)).sum()) for y in steps)


def decode(
    tiff: Tiff, picture: Picture, table: Samples | None, part: Area | None = None, rest: bool = False
) -> Samples:
    """The active area's samples, through the linearization `table` (65536,) if there is one.

    Pieces outside the active area are not decoded.

    Args:
        part: decode only the pieces that this part of the active area touches, and keep only its samples; the others
            are 0, and take no memory.
        rest: with `part`, decode the other pieces as well, and leave those that are damaged 0.

    Raises:
        UnreadableRaw: a piece that was asked for is damaged.
        UnsupportedRaw: it is no lossless JPEG.
    """
    area = picture.area
    samples = np.zeros((area[2] - area[0], area[3] - area[1]), np.uint16)
    wanted = area if part is None else _clipped(picture, part)
    inside = _touched(picture, wanted)
    kept = area if rest else wanted
    for block in _rows(tiff, picture, inside, kept):
        _keep(picture, samples, block, kept, table)
    if rest:
        others = sorted({*_touched(picture, area)} - {*inside})
        try:
            for block in _rows(tiff, picture, others, area):
                _keep(picture, samples, block, area, table)
        except RawError:
            for number in others:
                with suppress(RawError):
                    for block in _rows(tiff, picture, [number], area):
                        _keep(picture, samples, block, area, table)
    return samples


def _clipped(picture: Picture, part: Area) -> Area:
    """A part of the active area, clipped to it, in samples of the stored picture."""
    top, left, bottom, right = picture.area
    rows = min(max(part[0], 0) + top, bottom), min(part[2] + top, bottom)
    columns = min(max(part[1], 0) + left, right), min(part[3] + left, right)
    return rows[0], columns[0], rows[1], columns[1]


def _touched(picture: Picture, part: Area) -> list[int]:
    """Numbers of the pieces that hold samples of a part of the stored picture."""
    top, left, bottom, right = part
    pieces = []
    for number in range(len(picture.offsets)):
        y, x = picture.corner(number)
        if top < y + picture.rows(number) and y < bottom and left < x + picture.piece_width and x < right:
            pieces.append(number)
    return pieces


def _keep(
    picture: Picture, samples: Samples, block: tuple[int, int, Samples], part: Area, table: Samples | None
) -> None:
    """Copy those samples of a decoded block that belong to a part of the stored picture."""
    y, x, rows = block
    first, last = max(part[0], y), min(part[2], y + len(rows))
    start, end = max(part[1], x), min(part[3], x + rows.shape[1])
    if first < last and start < end:
        piece = rows[first - y : last - y, start - x : end - x]
        top, left = picture.area[:2]
        samples[first - top : last - top, start - left : end - left] = piece if table is None else table[piece]


def _rows(tiff: Tiff, picture: Picture, wanted: list[int], part: Area) -> Iterator[tuple[int, int, Samples]]:
    """Decode the pieces in blocks of rows; yields top, left and samples of each block.

    Of uncompressed pieces only the rows of `part` are read. The others are decoded to their end, so that damage in
    them is seen wherever it is.
    """
    if picture.compression == LOSSLESS_JPEG:
        for number, rows in _jpegs(tiff, picture, wanted):
            yield *picture.corner(number), rows
        return
    some = max(1, CHUNK // picture.piece_width)
    for number in wanted:
        y, x = picture.corner(number)
        first, last = 0, picture.rows(number)
        stream = _Inflated(tiff, picture, number) if picture.compression == DEFLATE else None
        if stream is None:
            first, last = max(first, part[0] - y), min(last, part[2] - y)
        for row in range(first, last, some):
            count = min(some, last - row)
            if stream is None:
                data = _rows_of(tiff, picture, number, row, count)
            else:
                data = stream.read(count * picture.row_bytes)
            rows = unpacked(data, count, picture.piece_width, picture.bits, picture.order(tiff))
            if picture.differences:
                rows = np.cumsum(rows, axis=1, dtype=np.uint16) & np.uint16((1 << picture.bits) - 1)
            yield y + row, x, rows
        if stream is not None:
            stream.finish()


def _rows_of(tiff: Tiff, picture: Picture, number: int, row: int, count: int) -> bytes:
    """The bytes of `count` rows of an uncompressed piece from `row` on, without their padding."""
    at, stride = picture.offsets[number] + row * picture.stride, picture.stride
    data = tiff.bytes_at(at, (count - 1) * stride + picture.row_bytes)
    if stride == picture.row_bytes:
        return data
    return b"".join(data[y * stride : y * stride + picture.row_bytes] for y in range(count))


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
    """Reader of a piece's zlib stream, of which little is in memory at a time."""

    def __init__(self, tiff: Tiff, picture: Picture, number: int) -> None:
        self.tiff = tiff
        self.stream = zlib.decompressobj()
        self.at, self.end = picture.offsets[number], picture.ends[number]
        self.left = b""

    def read(self, length: int) -> bytes:
        """The next `length` bytes."""
        data = b""
        while len(data) < length:
            more = self._some(length - len(data))
            if not more:
                raise self.tiff.damaged("its deflated samples end early")
            data += more
        return data

    def _some(self, length: int) -> bytes:
        """At least one byte; none at the end of the stream or the piece."""
        while not self.stream.eof:
            try:
                data = self.stream.decompress(self.left, length)
            except zlib.error as error:
                raise self.tiff.damaged("its deflated samples") from error
            self.left = self.stream.unconsumed_tail
            if data or self.stream.eof or (not self.left and self.at == self.end):
                return data
            if not self.left:
                count = min(CHUNK, self.end - self.at)
                self.left, self.at = self.tiff.bytes_at(self.at, count), self.at + count
        return b""

    def finish(self) -> None:
        """Raise unless the stream ends here with the right checksum."""
        if self._some(1):
            raise self.tiff.damaged("its deflated samples are too many")
        if not self.stream.eof:
            raise self.tiff.damaged("its deflated samples have no end")


def _jpegs(tiff: Tiff, picture: Picture, wanted: list[int]) -> Iterator[tuple[int, Samples]]:
    """Number and samples of each piece, decoded in batches of one width and at most `STACK` samples."""
    batch: list[tuple[int, Jpeg]] = []
    lines = parts = 0
    for number in wanted:
        at, plain = picture.offsets[number], picture.rows(number) * picture.row_bytes
        data = tiff.bytes_at(at, min(picture.ends[number] - at, 2 * plain + MAX_TABLES))
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
                raise fail("unreadable_raw.undecodable", file=tiff.file, detail="LibRaw finds no samples")
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
        raise fail("unreadable_raw.undecodable", file=tiff.file, detail=f"LibRaw says {error}") from error


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
