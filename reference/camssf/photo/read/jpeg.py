"""Splits a stored JPEG into parts that LibRaw can decode, and checks the decoded samples (ITU-T T.81, process 14).

LibRaw does not report damage inside the coded samples. So the decoded samples are coded again, as far as needed to
count the bits and compare the last ones: after damage, both agree with the file only by chance.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from camssf.messages import fail
from camssf.photo.read.tiff import Tiff

END = b"\xff\xd9"
CHECKED = 1 << 20
"""Samples that are coded again at a time."""
LAST = 8
"""Number of last samples whose coded bits are compared."""


Samples = NDArray[np.uint16]


@dataclass(frozen=True)
class HuffmanCodes:
    """A Huffman table of difference categories.

    Attributes:
        of: the code of each category, as a string of 0 and 1.
        lengths: (65536,) number of bits of a difference with its code, 0 if the table has no code for it.
    """

    of: dict[int, str]
    lengths: NDArray[np.uint8]

    def text(self, difference: int) -> str:
        """The coded bits of a difference modulo 2^16, as a string of 0 and 1."""
        value = difference if difference <= 32768 else difference - 65536
        size = abs(value).bit_length()
        more = f"{value if value > 0 else value + (1 << size) - 1:0{size}b}" if 0 < size < 16 else ""
        return self.of[size] + more


@dataclass(frozen=True)
class Part:
    """The lines between two restarts, as a complete JPEG without restarts and point transform.

    Attributes:
        lines: number of lines.
        content: bytes of the JPEG.
        start: offset of the coded samples in `content`; they end before the end marker.
    """

    lines: int
    content: bytes
    start: int


@dataclass(frozen=True)
class Jpeg:
    """One lossless JPEG (SOF3).

    Attributes:
        width: samples of a line, those of all components.
        precision: bits of a sample as stored.
        predictor: 1 to 7.
        shift: the point transform: number of low bits that were not stored.
        codes: Huffman codes of each component.
        parts: the parts between the restarts.
    """

    width: int
    precision: int
    predictor: int
    shift: int
    codes: tuple[HuffmanCodes, ...]
    parts: tuple[Part, ...]

    def check(self, tiff: Tiff, part: Part, samples: Samples) -> None:
        """Raise unless a part has exactly the coded bytes that its decoded samples (lines, width) need.

        In DNG 1.0 category 16 stands for more than one difference, so codes that have it are not checked there.

        Raises:
            UnreadableRaw: LibRaw's samples are not those that were stored.
        """
        if tiff.raw_bytes(tiff.main[0], 50706)[1:2] < b"\1" and any(16 in codes.of for codes in self.codes):
            return
        n = len(self.codes)
        bits, last = 0, list[int]()
        for start in range(0, len(samples), some := max(1, CHECKED // self.width)):
            block = samples[start : start + some]
            if int(block.max()) >> self.precision:
                raise tiff.damaged(f"its JPEG data leave {self.precision} bits")
            differences = self._differences(samples, start, start + len(block))
            taken = [codes.lengths[differences[:, c::n]] for c, codes in enumerate(self.codes)]
            if not all(lengths.all() for lengths in taken):
                raise tiff.damaged("a code in its JPEG data is in no table, or they end early")
            bits += sum(int(lengths.sum(dtype=np.int64)) for lengths in taken)
            last = (last + differences.ravel()[-LAST:].tolist())[-LAST:]
        used = -(-bits // 8)
        coded = part.content[part.start : -len(END)].replace(b"\xff\0", b"\xff")
        if used > len(coded):
            raise tiff.damaged("a code in its JPEG data is in no table, or they end early")
        first = samples.size - len(last)
        text = "".join(self.codes[(first + i) % n].text(value) for i, value in enumerate(last))
        tail = "".join(f"{byte:08b}" for byte in coded[used - len(text) // 8 - 2 : used])[: bits - 8 * used or None]
        if not tail.endswith(text):
            raise tiff.damaged("its JPEG data end early")
        if coded[used:].strip(b"\0"):
            raise tiff.damaged("its JPEG data go on too long")

    def _differences(self, samples: Samples, start: int, stop: int) -> Samples:
        """What is coded of the lines from `start` to `stop`: the differences from their predictions, modulo 2^16."""
        n, block, first = len(self.codes), samples[start:stop], 0 if start else 1
        guess = np.empty_like(block)
        if first:
            guess[0, :n] = 1 << (self.precision - 1)
            guess[0, n:] = block[0, :-n]
        above = samples[start + first - 1 : stop - 1]
        guess[first:, :n] = above[:, :n]
        guess[first:, n:] = _predicted(self.predictor, block[first:, :-n], above[:, n:], above[:, :-n])
        return np.subtract(block, guess, out=guess)


def _predicted(predictor: int, a: Samples, b: Samples, c: Samples) -> Samples:
    """Prediction from the left, upper and upper left neighbour, modulo 2^16. T.81, table H.1."""
    if predictor <= 4:
        return np.asarray((a, b, c, a + b - c)[predictor - 1])
    left, up, corner = (x.astype(np.int32) for x in (a, b, c))
    guess = (left + ((up - corner) >> 1), up + ((left - corner) >> 1), (left + up) >> 1)[predictor - 5]
    return guess.astype(np.uint16)


def read_jpeg(tiff: Tiff, data: bytes, samples: int) -> Jpeg:
    """Read the JPEG in `data`, which must hold exactly `samples` samples.

    LibRaw does not support the point transform, and after a restart it still predicts from the line above. So each
    part between restarts becomes a separate JPEG, whose headers have neither.

    Raises:
        UnreadableRaw: the JPEG is damaged.
        UnsupportedRaw: not a lossless JPEG with interleaved components.
    """
    frame = scan = b""
    tables = b""
    defined: dict[int, dict[int, str]] = {}
    interval, place = 0, 2
    if data[:2] != b"\xff\xd8":
        raise tiff.damaged("a piece of its data is no JPEG")
    while not scan:
        if data[place : place + 1] != b"\xff":
            raise tiff.damaged("a JPEG has no header")
        while data[place : place + 1] == b"\xff":
            place += 1
        marker, length = data[place] if place < len(data) else 0, 0
        if place + 3 <= len(data):
            length = int.from_bytes(data[place + 1 : place + 3], "big")
        if marker < 2 or 0xD0 <= marker <= 0xD9 or length < 2 or place + 1 + length > len(data):
            raise tiff.damaged("a JPEG's header ends early")
        body = data[place + 3 : place + 1 + length]
        place += 1 + length
        if marker == 0xC3:
            if frame or len(body) < 6 or len(body) != 6 + 3 * body[5]:
                raise tiff.damaged("a JPEG's frame header")
            frame = body
            _check_frame(tiff, body)
        elif marker == 0xC4:
            defined |= _tables(tiff, body)
            tables += _segment(0xC4, body)
        elif marker == 0xDD:
            if len(body) != 2:
                raise tiff.damaged("a JPEG's restart interval")
            interval = int.from_bytes(body, "big")
        elif marker == 0xDA:
            if not body:
                raise tiff.damaged("a JPEG's scan header")
            scan = body
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC8, 0xCC):
            raise fail("unsupported_raw.lossy_jpeg", file=tiff.file, process=marker - 0xC0)
    if not frame:
        raise tiff.damaged("a JPEG without a frame header")
    precision, lines, columns, components = struct.unpack_from(">BHHB", frame)
    predictor, shift, codes = _scan(tiff, scan, frame, defined)
    if interval % columns:
        raise tiff.damaged("a JPEG restarts within a line")
    if lines * columns * components != samples:
        raise tiff.damaged(f"a JPEG of {columns} × {lines} × {components} in a piece of {samples} samples")
    rows = interval // columns or lines
    parts = []
    for number, (start, end) in enumerate(_segments(tiff, data, place, -(-lines // rows))):
        count = min(rows, lines - number * rows)
        size = struct.pack(">BH", precision - shift, count) + frame[3:]
        head = b"\xff\xd8" + tables + _segment(0xC3, size) + _segment(0xDA, scan[:-1] + b"\0")
        parts.append(Part(count, head + data[start:end] + END, len(head)))
    return Jpeg(columns * components, precision - shift, predictor, shift, codes, tuple(parts))


def _segment(marker: int, body: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(body) + 2) + body


def _check_frame(tiff: Tiff, body: bytes) -> None:
    """T.81 B.2.2."""
    precision, lines, columns, components = struct.unpack_from(">BHHB", body)
    if not (2 <= precision <= 16 and 1 <= components <= 4 and lines and columns):
        raise tiff.damaged(f"a JPEG of {columns} × {lines} × {components} samples of {precision} bits")
    if any(body[7 + 3 * i] != 0x11 for i in range(components)):
        raise fail("unsupported_raw.subsampled_jpeg", file=tiff.file)


def _tables(tiff: Tiff, body: bytes) -> dict[int, dict[int, str]]:
    """Huffman tables of a segment, by their number: the code of each category. T.81 B.2.4.2."""
    tables = {}
    while body:
        counts = body[1:17]
        codes = sum(counts)
        if len(body) < 17 + codes or body[0] > 3:
            raise tiff.damaged("a JPEG's Huffman table")
        categories = body[17 : 17 + codes]
        words, code, full = [], 0, False
        for length, count in enumerate(counts, 1):
            words += [f"{code + i:0{length}b}" for i in range(count)]
            full = full or code + count > 1 << length
            code = (code + count) << 1
        if full or len(set(categories)) < codes or max(categories, default=0) > 16:
            raise tiff.damaged("a JPEG's Huffman table")
        tables[body[0]] = dict(zip(categories, words, strict=True))
        body = body[17 + codes :]
    return tables


def _scan(
    tiff: Tiff, body: bytes, frame: bytes, defined: dict[int, dict[int, str]]
) -> tuple[int, int, tuple[HuffmanCodes, ...]]:
    """Predictor, point transform, and the codes of each component. T.81 B.2.3, table B.3."""
    precision, components = frame[0], frame[5]
    if len(body) != 4 + 2 * body[0]:
        raise tiff.damaged("a JPEG's scan header")
    if body[0] != components:
        raise fail("unsupported_raw.separate_components", file=tiff.file)
    which = []
    for i in range(components):
        which.append(body[2 + 2 * i] >> 4)
        if body[1 + 2 * i] != frame[6 + 3 * i] or which[i] not in defined:
            raise tiff.damaged("a JPEG's scan header")
    predictor, shift = body[-3], body[-1] & 15
    if not 1 <= predictor <= 7 or shift >= precision:
        raise tiff.damaged(f"a JPEG with predictor {predictor}, shift {shift}")
    return predictor, shift, tuple(_codes(tuple(sorted(defined[n].items()))) for n in which)


@lru_cache(1)
def _categories() -> NDArray[np.intp]:
    """(65536,) category of each difference modulo 2^16: the bits of its size."""
    differences = np.abs((np.arange(65536) + 32767) % 65536 - 32767)
    return np.searchsorted(1 << np.arange(17), differences, side="right")


@lru_cache(16)
def _codes(of: tuple[tuple[int, str], ...]) -> HuffmanCodes:
    bits = np.zeros(17, np.uint8)
    for n, code in of:
        bits[n] = len(code) + n % 16  # category 16 is only 32768, without extra bits
    return HuffmanCodes(dict(of), bits[_categories()])


def _segments(tiff: Tiff, data: bytes, start: int, count: int) -> list[tuple[int, int]]:
    """Start and end of the coded data between the restart markers, which must be in order and before the end."""
    coded = np.frombuffer(data, np.uint8, offset=start)
    after = coded[1:]
    ends = start + np.flatnonzero((coded[:-1] == 0xFF) & (after != 0) & (after != 0xFF))
    wanted = [0xD0 + number % 8 for number in range(count - 1)] + [0xD9]
    if [data[end + 1] for end in ends[:count].tolist()] != wanted:
        raise tiff.damaged("its JPEG data have no proper end")
    return list(zip([start, *(ends[: count - 1] + 2).tolist()], ends[:count].tolist(), strict=True))
