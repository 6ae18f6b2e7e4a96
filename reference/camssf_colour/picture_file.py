"""Writes a picture in standard colour as TIFF or PNG, and beside it the picture of its uncertainty.

PNG: Portable Network Graphics (Third Edition), W3C 2025. OpenCV, which reads and writes photos elsewhere, embeds
neither profile nor text.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from camssf.colorimetry import BRADFORD, adaptation
from camssf.errors import InvalidArgument
from camssf.exports.icc import SRGB_CURVE, matrix_profile
from camssf.exports.matrices import D50
from camssf.files import local, write_aside
from camssf.version import __version__
from camssf_colour.picture import PictureSpace, Samples, StandardPicture
from camssf_colour.picture_strip import CLIPPED, OUT_OF_REACH, PER_UNIT

TIFF, PNG = (".tif", ".tiff"), (".png",)
LIMIT = 1 << 32
"""Bytes of a TIFF."""
FILTER_UP = 2
"""PNG's filter of the difference from the row above."""


@dataclass(frozen=True)
class Written:
    """The two files of a picture.

    Attributes:
        picture: its path.
        uncertainty: path of the picture of its uncertainty.
        clipped, out_of_reach: shares of the picture.
    """

    picture: Path
    uncertainty: Path
    clipped: float
    out_of_reach: float


def write_picture(picture: StandardPicture, path: str | Path, text: str, bits: int = 16) -> Written:
    """Write a picture and, as NAME.uncertainty.EXT, its uncertainty: all or none.

    Args:
        picture: the picture.
        path: .tif, .tiff or .png.
        text: what both files say of themselves.
        bits: 16, or 8 for the picture as PNG.

    Raises:
        InvalidArgument: another kind of file, or one that cannot be written; 8 bits of XYZ or of TIFF.
    """
    path = local(path)
    suffix = path.suffix.lower()
    if suffix not in TIFF + PNG:
        raise InvalidArgument(f"{path.name} is no name of a TIFF or PNG.", "End it in .tif or .png.")
    if bits not in (8, 16) or (bits == 8 and (suffix in TIFF or picture.space.primaries is None)):
        raise InvalidArgument(
            f"A picture of {bits} bits in {picture.space.name} cannot be written as {suffix}.",
            "Take 16 bits; 8 are for PNG in srgb or display-p3.",
        )
    beside = path.with_name(f"{path.stem}.uncertainty{path.suffix}")
    layers: list[Samples] = []

    def colours() -> Iterator[Samples]:
        for pixels, layer in picture.strips():
            layers.append(layer)
            yield pixels

    with ExitStack() as files:
        first, second = (files.enter_context(write_aside(file)) for file in (path, beside))
        _write(first, suffix, colours(), _Head(picture.size, text, profile_of(picture.space), bits))
        layer = np.concatenate(layers)
        size = (layer.shape[0], layer.shape[1])
        _write(second, suffix, iter([layer]), _Head(size, f"{LAYER} {text}", None, 16))
    clipped, far = (float(np.mean((layer == mark).all(axis=2))) for mark in (CLIPPED, OUT_OF_REACH))
    return Written(path, beside, clipped, far)


LAYER = (
    f"Standard deviation of L*, a*, b* of a pixel, in 1/{PER_UNIT:g}, for blocks of 2 x 2 pixels; "
    f"{CLIPPED:g}: clipped; {OUT_OF_REACH:g}: no surface has this colour under this light."
)
"""What the picture of the uncertainty holds."""


def profile_of(space: PictureSpace) -> bytes | None:
    """The ICC profile of a space of RGB."""
    if space.primaries is None:
        return None
    to_d50 = adaptation(space.to_xyz.sum(axis=1), D50, BRADFORD)
    never = datetime(2026, 1, 1)
    return matrix_profile(b"mntr", PROFILES[space.name], to_d50 @ space.to_xyz, to_d50, SRGB_CURVE, never)


PROFILES = {"srgb": "sRGB (IEC 61966-2-1)", "display-p3": "Display P3"}


@dataclass(frozen=True)
class _Head:
    """What a file says before its pixels: height and width, text, ICC profile, bits of a sample."""

    size: tuple[int, int]
    text: str
    profile: bytes | None
    bits: int


def _write(path: Path, suffix: str, strips: Iterator[Samples], head: _Head) -> None:
    if suffix in PNG:
        with path.open("wb") as file:
            file.writelines(_png(strips, head))
        return
    import tifffile

    size = head.size
    with tifffile.TiffWriter(path, bigtiff=size[0] * size[1] * 6 > LIMIT - (1 << 20)) as tiff:
        rows = 64
        tiff.write(
            _of_rows(strips, rows), shape=(*size, 3), dtype=np.uint16, photometric="rgb", rowsperstrip=rows,
            description=head.text, software=f"camssf {__version__}", metadata=None, iccprofile=head.profile,
        )  # fmt: skip


def _of_rows(strips: Iterator[Samples], rows: int) -> Iterator[Samples]:
    """The same rows in strips of this many, but for the last."""
    rest: Samples | None = None
    for strip in strips:
        whole = strip if rest is None else np.concatenate([rest, strip])
        full = len(whole) // rows * rows
        for start in range(0, full, rows):
            yield np.ascontiguousarray(whole[start : start + rows])
        rest = whole[full:]
    if rest is not None and len(rest):
        yield np.ascontiguousarray(rest)


def _png(strips: Iterator[Samples], head: _Head) -> Iterator[bytes]:
    """The chunks of a PNG of RGB."""
    height, width = head.size
    yield b"\x89PNG\r\n\x1a\n"
    yield _chunk(b"IHDR", struct.pack(">2I5B", width, height, head.bits, 2, 0, 0, 0))
    if head.profile is not None:
        yield _chunk(b"iCCP", b"ICC profile\0\0" + zlib.compress(head.profile))
    for key, value in (("Software", f"camssf {__version__}"), ("Description", head.text)):
        yield _chunk(b"iTXt", key.encode() + b"\0\0\0\0\0" + value.encode())
    packed, above = zlib.compressobj(6), np.zeros(width * 3 * head.bits // 8, np.uint8)
    for strip in strips:
        levels = strip.astype(">u2") if head.bits == 16 else np.rint(strip / 257.0).astype(np.uint8)
        rows = np.ascontiguousarray(levels).view(np.uint8).reshape(len(strip), -1)
        lines = np.empty((len(rows), rows.shape[1] + 1), np.uint8)
        lines[:, 0], lines[0, 1:], lines[1:, 1:] = FILTER_UP, rows[0] - above, rows[1:] - rows[:-1]
        above = rows[-1]
        yield _chunk(b"IDAT", packed.compress(lines.tobytes()))
    yield _chunk(b"IDAT", packed.flush())
    yield _chunk(b"IEND", b"")


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
