"""Reads a DNG as a mosaic: the sensor's samples as stored, and the file's metadata.

The tags are read with `camssf.photo.read.tiff` and every number is checked, because LibRaw hides some tags and
tolerates much damage. `camssf.photo.read.pieces` decodes the samples.
Tags and their meaning: TIFF 6.0, and Digital Negative (DNG) Specification 1.7, Adobe.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from camssf.files import error_in_words, local
from camssf.grid import Floats
from camssf.messages import fail
from camssf.photo.read.colour_matrix import ColourMatrix, colour_matrix, no_light
from camssf.photo.read.gain_maps import GAIN_MAP, HARMLESS, OPCODES, GainMap, read_gain_map, read_opcodes
from camssf.photo.read.pieces import DEFLATE, LOSSLESS_JPEG, MAX_SIDE, PLAIN, Picture, decode, picture_of
from camssf.photo.read.tiff import Directory, Tiff
from camssf.photo.read.unit import Area, Unit, unit_of

CFA_ORDERS = ("RGGB", "GRBG", "GBRG", "BGGR")

_CODECS = {
    5: "LZW",
    34892: "lossy JPEG",
    34713: "Nikon NEF",
    32767: "Sony ARW",
    50002: "JPEG XL",
    52546: "JPEG XL",
}


@dataclass(frozen=True)
class Mosaic:
    """One RAW photo, neither demosaiced nor white-balanced.

    Attributes:
        path: path of the file, or a name.
        samples: (h, w) uint16 DN of the active area, after the file's LinearizationTable (if any),
            before black subtraction.
        cfa: colours of the 2 × 2 cell at the active area's corner, one of RGGB, GRBG, GBRG, BGGR.
        black: (2, 2) black level of each cell position, DN.
        white: the white level (saturation), DN.
        make, model: of the camera; "" if unknown.
        exposure: exposure time, s; None if unknown.
        iso: sensitivity; None if unknown.
        orientation: the TIFF orientation of the display, 1 to 8 (pose and samples ignore it).
        gain_maps: the file's lens-shading maps, in the order they act; not applied to the samples (`shading`).
        color_matrix1, color_matrix2: (3, 3) XYZ to camera, or None.
        as_shot_neutral: (3,) or None.
        sha256: of the file, hex; for a picture, of its bytes followed by its sidecar's.
        colour_matrices: with the camera's own calibration and gains, each with its illuminant.
        matrices_left_out: which matrices of the file are not among them, and why; "" if none.
        unit: the physical camera and its lens, as far as the file names them.
        active_area: top, left, bottom, right in the stored picture; None if there was no file.
        levels: source of pattern, black and white level, in words; "" if they are a DNG's own tags.
        unique_model: the DNG's UniqueCameraModel; "" if missing.
    """

    path: str
    samples: NDArray[np.uint16]
    cfa: str
    black: Floats
    white: float
    make: str
    model: str
    exposure: float | None
    iso: float | None
    orientation: int
    gain_maps: tuple[GainMap, ...]
    color_matrix1: Floats | None
    color_matrix2: Floats | None
    as_shot_neutral: Floats | None
    sha256: str
    colour_matrices: tuple[ColourMatrix, ...] = ()
    unit: Unit = field(default_factory=Unit)
    active_area: Area | None = None
    levels: str = ""
    unique_model: str = ""
    matrices_left_out: str = ""

    @property
    def gain_map(self) -> bool:
        """True if the file holds lens-shading maps, which are not applied to the samples."""
        return bool(self.gain_maps)


def read_dng(path: str | Path, part: Area | None = None, rest: bool = False) -> Mosaic:
    """Read the raw frame of a DNG file, or only a `part` of its active area and, if it is sound, the `rest`.

    The samples are those of the active area (tag 50829), after the file's LinearizationTable; black and white level
    are on that scale. A black level with a repeat pattern larger than 2 × 2, or with row and column deltas
    (tags 50713 to 50716), is averaged for each cell position.

    Args:
        path: of the file.
        part: top, left, bottom, right: decode only the strips and tiles that this part of the active area touches.
            Samples outside it are 0, and damage in other strips and tiles is not seen.
        rest: decode these as well, and leave those that are damaged 0.

    Raises:
        UnreadableRaw: missing, empty, truncated, damaged, or not a raw file at all.
        UnsupportedRaw: an intact raw file that is no DNG, or a DNG in a form that camssf does not read.
        NotSensorRaw: LinearRaw, that is, already demosaiced.
        OutOfMemory: its samples do not fit into the free memory.
    """
    file = local(path)
    try:
        with file.open("rb") as stream:
            mosaic = _parse(Tiff(file, stream), part, rest)
            stream.seek(0)
            return replace(mosaic, sha256=hashlib.file_digest(stream, "sha256").hexdigest())
    except IsADirectoryError as error:
        raise fail("unreadable_raw.folder", file=file) from error
    except FileNotFoundError as error:
        raise fail("unreadable_raw.missing", file=file) from error
    except MemoryError as error:
        raise fail("out_of_memory.computer", file=file) from error
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise fail("unreadable_raw.no_access", file=file, detail=error_in_words(error)) from error


def shading(mosaic: Mosaic, x: float, y: float) -> Floats:
    """The file's own lens shading correction at (x, y), as (2, 2) factors for the positions of the CFA cell.

    Each factor is the product of the gain maps that cover its position there. Maps of list 2 act on plane 0, those of
    list 3 on the planes R, G, B. Coordinates are px of the active area, (0, 0) the centre of its first sample.

    Raises:
        UnsupportedRaw: a map of list 1, which acts before linearisation, or a map with a pitch above 2.
    """
    height, width = mosaic.samples.shape
    factors = np.ones((2, 2))
    for gains in _maps_to_apply(mosaic):
        for row, column in np.ndindex(2, 2):
            plane = _plane(mosaic, gains, row, column)
            if gains.covers(x, y, row, column, plane):
                factors[row, column] *= gains.at(x, y, width, height, plane)
    return factors


def shading_of_samples(mosaic: Mosaic, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Floats:
    """The lens shading correction of the samples in these rows and columns, (rows, columns), as `shading`.

    Raises:
        UnsupportedRaw: as `shading`.
    """
    factors = np.ones((rows.size, columns.size))
    for gains in _maps_to_apply(mosaic):
        for row, column in np.ndindex(2, 2):
            plane = _plane(mosaic, gains, row, column)
            inside = (rows % 2 == row) & (rows >= gains.top) & (rows < gains.bottom)
            across = (columns % 2 == column) & (columns >= gains.left) & (columns < gains.right)
            if gains.covers(gains.left, gains.top, row, column, plane) and inside.any() and across.any():
                over = gains.over(rows[inside], columns[across], mosaic.samples.shape, plane)
                factors[np.ix_(inside, across)] *= over
    return factors


def _maps_to_apply(mosaic: Mosaic) -> Iterator[GainMap]:
    for gains in mosaic.gain_maps:
        if gains.stage == 1 or max(gains.row_pitch, gains.column_pitch) > 2:
            raise fail(
                "unsupported_raw.shading_map",
                file=mosaic.path,
                list=gains.stage,
                rows=gains.row_pitch,
                columns=gains.column_pitch,
            )
        yield gains


def _plane(mosaic: Mosaic, gains: GainMap, row: int, column: int) -> int:
    return "RGB".index(mosaic.cfa[2 * row + column]) if gains.stage == 3 else 0


def _parse(tiff: Tiff, part: Area | None, rest: bool) -> Mosaic:
    """The mosaic, still without its hash."""
    raw = _raw_directory(tiff)
    picture = _picture(tiff, raw)
    cfa, black, white = _cfa(tiff, raw), _black(tiff, raw, picture), _white(tiff, raw, picture)
    gain_maps = _gain_maps(tiff, raw)
    samples = decode(tiff, picture, _linearization(tiff, raw), part, rest)
    first, exif = tiff.main[0], tiff.exif()
    matrices, matrices_left_out = _colour_matrices(tiff, first)
    _check_others(tiff, raw, exif)
    orientation = tiff.one(first, 274, 1)
    return Mosaic(
        path=str(tiff.file),
        samples=samples,
        cfa=cfa,
        black=black,
        white=white,
        make=tiff.text(first, 271),
        model=tiff.text(first, 272) or tiff.text(first, 50708),
        exposure=_positive(tiff, (first, raw, exif), 33434),
        iso=_positive(tiff, (first, raw, exif), 34855),
        orientation=orientation if 1 <= orientation <= 8 else 1,
        gain_maps=gain_maps,
        color_matrix1=_matrix(tiff, first, 50721),
        color_matrix2=_matrix(tiff, first, 50722),
        as_shot_neutral=_neutral(tiff, first),
        sha256="",
        colour_matrices=matrices,
        matrices_left_out=matrices_left_out,
        unit=unit_of(tiff, exif),
        active_area=picture.area,
        unique_model=tiff.text(first, 50708),
    )


def _raw_directory(tiff: Tiff) -> Directory:
    """The directory of the largest full-resolution mosaic."""
    version = tiff.raw_bytes(tiff.main[0], 50706)
    if not version:
        if any(32803 in tiff.whole(directory, 262)[:1] for directory in tiff.all):
            raise fail("unsupported_raw.no_dng", file=tiff.file)
        raise fail("unreadable_raw.tiff_picture", file=tiff.file)
    if version[0] != 1:
        raise fail("unsupported_raw.dng_version", file=tiff.file, version=version[0])
    full = [directory for directory in tiff.all if tiff.one(directory, 254, 0) == 0]
    mosaics = [directory for directory in full if tiff.one(directory, 262, -1) == 32803]
    if mosaics:
        return max(mosaics, key=lambda each: tiff.one(each, 256, 0) * tiff.one(each, 257, 0))
    if any(tiff.one(directory, 262, -1) == 34892 for directory in full):
        raise fail("not_sensor_raw.linear_dng", file=tiff.file)
    raise fail("unsupported_raw.no_mosaic", file=tiff.file)


def _picture(tiff: Tiff, raw: Directory) -> Picture:
    """Check size, coding, active area and pieces of the stored picture."""
    width, height = tiff.one(raw, 256, 0), tiff.one(raw, 257, 0)
    if not (2 <= width <= MAX_SIDE and 2 <= height <= MAX_SIDE):
        raise tiff.damaged(f"a picture of {width} × {height} samples")
    bits, samples = tiff.whole(raw, 258) or [1], tiff.one(raw, 277, 1)
    if samples != 1 or len(bits) != 1:
        raise fail("unsupported_raw.samples_per_pixel", file=tiff.file, count=samples)
    if tiff.one(raw, 339, 1) != 1:
        raise fail("unsupported_raw.sample_format", file=tiff.file)
    compression = tiff.one(raw, 259, 1)
    if compression not in (PLAIN, LOSSLESS_JPEG, DEFLATE):
        codec = _CODECS.get(compression, f"number {compression}")
        raise fail("unsupported_raw.compression", file=tiff.file, codec=codec)
    if not 8 <= bits[0] <= 16:
        raise fail("unsupported_raw.bits", file=tiff.file, bits=bits[0])
    order = tiff.one(raw, 266, 1)
    if order != 1:  # readers interpret it differently beyond 8 bits
        raise fail("unsupported_raw.fill_order", file=tiff.file, order=order)
    top, left, bottom, right = tiff.whole(raw, 50829, 4) or [0, 0, height, width]
    if not (0 <= top < bottom <= height and 0 <= left < right <= width) or min(bottom - top, right - left) < 2:
        raise tiff.damaged(f"active area {top}, {left}, {bottom}, {right} in {width} × {height} samples")
    return picture_of(tiff, raw, (width, height), (bits[0], compression), (top, left, bottom, right))


def _cfa(tiff: Tiff, raw: Directory) -> str:
    """The Bayer order at the active area's corner, which is the pattern's origin."""
    size = tiff.whole(raw, 33421, 2) or [2, 2]
    pattern, planes = tiff.raw_bytes(raw, 33422), tiff.raw_bytes(raw, 50710) or bytes((0, 1, 2))
    letters = "".join("RGB"[code] if code in planes and code < 3 else "?" for code in pattern)
    if size != [2, 2] or letters not in CFA_ORDERS or tiff.one(raw, 50711, 1) != 1:
        raise fail(
            "unsupported_raw.colour_filters",
            file=tiff.file,
            filters=letters or "unnamed",
            rows=size[0],
            columns=size[1],
            orders=", ".join(CFA_ORDERS),
        )
    return letters


def _black(tiff: Tiff, raw: Directory, picture: Picture) -> Floats:
    """(2, 2) DN: the mean black level of each position of the colour cell over the active area."""
    rows, columns = tiff.whole(raw, 50713, 2) or [1, 1]
    if not (0 < rows <= 64 and 0 < columns <= 64):
        raise tiff.damaged(f"a black level that repeats every {rows} × {columns} samples")
    stored = tiff.numbers(raw, 50714, rows * columns)
    pattern = np.zeros((1, 1)) if stored is None else stored.reshape(rows, columns)
    pattern = np.tile(pattern, (2, 2))  # an even period in both directions
    top, left, bottom, right = picture.area
    across, down = tiff.numbers(raw, 50715, right - left), tiff.numbers(raw, 50716, bottom - top)
    black = np.empty((2, 2))
    for i, j in np.ndindex(2, 2):
        black[i, j] = pattern[i::2, j::2].mean()
        black[i, j] += (0 if down is None else down[i::2].mean()) + (0 if across is None else across[j::2].mean())
    if not (np.isfinite(black).all() and (np.abs(black) <= 65535).all()):
        raise tiff.damaged("its black level is no number")
    return black


def _white(tiff: Tiff, raw: Directory, picture: Picture) -> float:
    """The white level, DN; 2^bits - 1 if the tag is missing."""
    stored = tiff.numbers(raw, 50717, 1)
    white = float(2**picture.bits - 1 if stored is None else stored[0])
    if not 0 < white <= 65535:
        raise tiff.damaged(f"a white level of {white:g}")
    return white


def _check_others(tiff: Tiff, raw: Directory, exif: Directory) -> None:
    """Raise if a tag is damaged that is not used here but that Kotlin's reader returns."""
    areas, pairs = tiff.count(raw, 50830), raw if 51041 in raw else tiff.main[0]
    if 0 < areas <= 256 and areas % 4 == 0:
        tiff.whole(raw, 50830)
    if tiff.count(pairs, 51041) in (2, 4, 6, 8):
        tiff.numbers(pairs, 51041)
    tiff.numbers(tiff.main[0], 50729)
    for tag in (36867, 36881):
        tiff.raw_bytes(exif, tag)


def _linearization(tiff: Tiff, raw: Directory) -> NDArray[np.uint16] | None:
    """(65536,) linearised value of each stored value; the table's last entry holds beyond its end."""
    if tiff.count(raw, 50712) > 65536:
        raise tiff.damaged("a linearization table of too many values")
    table = tiff.whole(raw, 50712)
    if not table:
        return None
    if not all(0 <= value <= 65535 for value in table):
        raise tiff.damaged("its linearization table leaves 16 bits")
    return np.array(table + table[-1:] * (65536 - len(table)), np.uint16)


def _gain_maps(tiff: Tiff, raw: Directory) -> tuple[GainMap, ...]:
    """The gain maps of the three opcode lists; refuses other opcodes that may not be skipped."""
    maps: list[GainMap] = []
    for stage, tag in enumerate((51008, 51009, 51022), 1):
        try:
            for number, optional, data in read_opcodes(tiff.raw_bytes(raw, tag)):
                if number == GAIN_MAP:
                    maps.append(read_gain_map(data, stage))
                elif number not in HARMLESS and not optional:
                    raise fail(
                        "unsupported_raw.opcode",
                        file=tiff.file,
                        opcode=number,
                        name=OPCODES.get(number, "unknown"),
                        list=stage,
                    )
        except ValueError as error:
            raise tiff.damaged(f"opcode list {tag} {error}") from error
    return tuple(maps)


def _positive(tiff: Tiff, directories: tuple[Directory, ...], tag: int) -> float | None:
    """The first positive number under `tag`; some writers store 0 for unknown."""
    for directory in directories:
        values = tiff.numbers(directory, tag)
        if values is not None and np.isfinite(values[0]) and values[0] > 0:
            return float(values[0])
    return None


def _matrix(tiff: Tiff, first: Directory, tag: int) -> Floats | None:
    values = tiff.numbers(first, tag)
    if values is None or values.size != 9 or not np.isfinite(values).all():
        return None
    return values.reshape(3, 3)


def _colour_matrices(tiff: Tiff, first: Directory) -> tuple[tuple[ColourMatrix, ...], str]:
    """The usable colour matrices, and in words which were left out and why."""
    gains, neutral = tiff.numbers(first, 50727), _neutral(tiff, first)
    balance = gains if gains is not None and gains.size == 3 and np.isfinite(gains).all() else None
    matrices, why = [], []
    for number, tag, own, light in ((1, 50721, 50723, 50778), (2, 50722, 50724, 50779)):
        matrix = _matrix(tiff, first, tag)
        if matrix is None:
            continue
        try:
            matrices.append(colour_matrix(tiff.one(first, light, 0), matrix, _matrix(tiff, first, own), balance))
        except ValueError as error:
            why.append(f"ColorMatrix{number} was left out: it {error}")
    if neutral is not None and no_light(neutral, matrices):
        matrices, why = (
            [],
            [*why, "the colour matrices were left out: with them AsShotNeutral is the white of no lamp"],
        )
    return tuple(matrices), "; ".join(why)


def _neutral(tiff: Tiff, first: Directory) -> Floats | None:
    values = tiff.numbers(first, 50728)
    return values if values is not None and values.size == 3 and (values > 0).all() else None


@contextmanager
def opened(file: Path) -> Iterator[str | BinaryIO]:
    """A file as rawpy accepts it: by name if that is valid Unicode, otherwise as an open stream."""
    try:
        str(file).encode()
    except UnicodeEncodeError:  # a name in another encoding, from an old card or archive
        with file.open("rb") as stream:
            yield stream
    else:
        yield str(file)
