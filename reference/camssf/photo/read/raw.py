"""Reads a RAW file as a mosaic: a DNG by its tags, other raw formats by LibRaw, a linear picture by its sidecar.

The tags of a DNG are checked one by one (`camssf.photo.read.dng`). Pattern and levels of other files cannot be
verified: `Mosaic.levels` names their source, and the result lists it as an assumption.
"""

from __future__ import annotations

import hashlib
import io
import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument, NotSensorRaw, UnreadableRaw, UnsupportedRaw
from camssf.files import error_in_words, local
from camssf.grid import Floats
from camssf.messages import fail
from camssf.photo.read.colour_matrix import ColourMatrix, colour_matrix
from camssf.photo.read.dng import CFA_ORDERS, Mosaic, opened, read_dng
from camssf.photo.read.pieces import check_size
from camssf.photo.read.unit import Area, sidecar_of

SIDECAR = "camssf-mosaic/1"
LARGEST_SIDECAR = 100_000
HEAD = 1 << 20
"""Bytes at the beginning of a file that are searched for its maker and model."""
ORIENTATIONS = {0: 1, 3: 3, 5: 8, 6: 6}
"""TIFF orientation by LibRaw's flip code."""
_KEYS = {"format", "cfa", "black", "white", "make", "model", "exposure", "iso", "orientation"}


def read_raw(path: str | Path, part: Area | None = None, rest: bool = False) -> Mosaic:
    """Read the raw frame of a photo: a DNG, a raw file that LibRaw decodes as Bayer, or a picture with a sidecar.

    A picture is a PNG or TIFF of one channel, 8 or 16 bits, that holds the sensor's own linear samples. The
    sidecar of `photo.png` is `photo.png.json`, for example
    `{"format": "camssf-mosaic/1", "cfa": "RGGB", "black": 512, "white": 16383}`. `black` may also be 2 × 2 numbers,
    one for each position of the CFA cell; make, model, exposure (s), iso and orientation (TIFF's) are optional.
    `part` and `rest` are those of `read_dng`; another file is always read whole.

    Raises:
        UnreadableRaw: missing, empty, truncated, damaged, or not a raw file at all.
        UnsupportedRaw: no Bayer pattern (X-Trans, Foveon, four colours), unknown format, or PNG without sidecar.
        NotSensorRaw: already demosaiced: a linear DNG, sRAW, a picture of three channels.
        InvalidArgument: the sidecar is invalid.
    """
    file = local(path)
    sidecar = sidecar_of(file)
    if sidecar is not None:
        return _picture(file, sidecar)
    if file.suffix.casefold() == ".png" and file.is_file():
        raise fail("unsupported_raw.no_sidecar", file=file, sidecar=f"{file.name}.json")
    try:
        return read_dng(file, part, rest)
    except UnsupportedRaw as error:
        if error.key != "unsupported_raw.no_dng":
            raise
        return _by_libraw(file)


def _by_libraw(file: Path) -> Mosaic:
    """Read a raw file in another format than DNG: samples, pattern and levels come from LibRaw."""
    import rawpy

    try:
        with opened(file) as name, rawpy.RawPy() as raw:
            (raw.open_file if isinstance(name, str) else raw.open_buffer)(name)
            check_size(file, raw.sizes.raw_width, raw.sizes.raw_height)
            raw.unpack()
            mosaic = _of_libraw(file, raw, rawpy)
    except rawpy.LibRawFileUnsupportedError as error:
        raise fail("unsupported_raw.libraw", file=file, version=_version(rawpy)) from error
    except rawpy.LibRawError as error:
        raise fail("unreadable_raw.undecodable", file=file, detail=f"LibRaw says {error}") from error
    with file.open("rb") as stream:
        make, model = _maker(stream.read(HEAD))
        stream.seek(0)
        return replace(mosaic, make=make, model=model, sha256=hashlib.file_digest(stream, "sha256").hexdigest())


def _of_libraw(file: Path, raw: Any, rawpy: Any) -> Mosaic:
    """Check the values that LibRaw reports for an unpacked file and build the mosaic."""
    if raw.raw_type != rawpy.RawType.Flat or raw.raw_image_visible is None:
        raise fail("not_sensor_raw.several_colours", file=file)
    pattern = raw.raw_pattern
    if pattern is None or pattern.shape != (2, 2):
        shape = "none" if pattern is None else f"{pattern.shape[0]} × {pattern.shape[1]}"
        raise fail("unsupported_raw.no_bayer", file=file, pattern=shape, orders=", ".join(CFA_ORDERS))
    corner = raw.raw_colors_visible[:2, :2]
    letters = raw.color_desc.decode("ascii", "replace")
    cfa = "".join(letters[i] if i < len(letters) else "?" for i in corner.ravel())
    if cfa not in CFA_ORDERS:
        raise fail(
            "unsupported_raw.colour_filters", file=file, filters=cfa, rows=2, columns=2, orders=", ".join(CFA_ORDERS)
        )
    levels = raw.black_level_per_channel
    black = np.array([levels[i] for i in corner.ravel()], dtype=np.float64).reshape(2, 2)
    stated = [level for level in (raw.camera_white_level_per_channel or ()) if level and level > 0]
    white = float(min(stated) if stated else raw.white_level)
    samples = np.array(raw.raw_image_visible, dtype=np.uint16, order="C")
    _check_levels(file, samples, black, white)
    # LibRaw has one matrix for each camera that it knows, made for D65.
    known: tuple[ColourMatrix, ...] = ()
    with suppress(ValueError):  # it has zeros for a camera that it does not know
        known = (colour_matrix(21, np.asarray(raw.rgb_xyz_matrix, dtype=np.float64)[:3]),)
    return Mosaic(
        path=str(file),
        samples=samples,
        cfa=cfa,
        black=black,
        white=white,
        make="",
        model="",
        exposure=_positive(raw.other.shutter_speed),
        iso=_positive(raw.other.iso_speed),
        orientation=ORIENTATIONS.get(int(raw.sizes.flip), 1),
        gain_maps=(),
        color_matrix1=None,
        color_matrix2=None,
        as_shot_neutral=None,
        sha256="",
        colour_matrices=known,
        levels=f"LibRaw {_version(rawpy)}",
    )


def _maker(head: bytes) -> tuple[str, str]:
    """Maker and model from the beginning of a file: a TIFF, a CR3 (with a TIFF inside) or a RAF; "" if not found."""
    if head[:15] == b"FUJIFILMCCD-RAW":
        return "FUJIFILM", head[28:60].split(b"\0")[0].decode("ascii", "replace").strip()
    box = head.find(b"CMT1")
    start = box + 4 if head[4:12] == b"ftypcrx " and box > 0 else 0
    magic = head[start : start + 4]
    if magic[:2] in (b"II", b"MM"):  # some makers change the version number that follows
        head = head[start : start + 2] + (b"*\0" if magic[:2] == b"II" else b"\0*") + head[start + 4 :]
        with suppress(Exception):  # only the names are lost; tifffile raises many types of exceptions
            import tifffile

            with tifffile.TiffFile(io.BytesIO(head)) as tiff:
                tags = tiff.pages.first.tags
                words = [tags[code].value if code in tags else "" for code in (271, 272)]
                make, model = (str(word).split("\0")[0].strip() for word in words)
                return make, model
    return "", ""


def _picture(file: Path, sidecar: Path) -> Mosaic:
    """Read a linear picture of the mosaic, with the metadata of its sidecar."""
    values, words = _sidecar(sidecar)
    try:
        data = file.read_bytes()
    except OSError as error:
        raise fail("unreadable_raw.no_access", file=file, detail=error_in_words(error)) from error
    samples = _png(file, data) if file.suffix.casefold() == ".png" else _tiff(file, data)
    if samples.ndim != 2 or samples.dtype not in (np.uint8, np.uint16):
        raise fail("not_sensor_raw.shape", file=file, type=samples.dtype, shape=samples.shape)
    check_size(file, samples.shape[1], samples.shape[0])
    black = np.array(values["black"], dtype=np.float64) * np.ones((2, 2))
    samples = np.ascontiguousarray(samples, dtype=np.uint16)
    _check_levels(file, samples, black, float(values["white"]))
    return Mosaic(
        path=str(file),
        samples=samples,
        cfa=values["cfa"],
        black=black,
        white=float(values["white"]),
        make=values.get("make", ""),
        model=values.get("model", ""),
        exposure=values.get("exposure"),
        iso=values.get("iso"),
        orientation=values.get("orientation", 1),
        gain_maps=(),
        color_matrix1=None,
        color_matrix2=None,
        as_shot_neutral=None,
        sha256=hashlib.sha256(data + words).hexdigest(),  # the same as `photo_hash`
        levels=f"the sidecar {sidecar.name}",
    )


def _png(file: Path, data: bytes) -> NDArray[Any]:
    if data[:8] != b"\x89PNG\r\n\x1a\n" or data[12:16] != b"IHDR":
        raise fail("unreadable_raw.no_png", file=file)
    check_size(file, int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big"))
    if data[24] not in (8, 16) or data[25] != 0:  # checked before decoding
        raise fail("not_sensor_raw.no_grey_png", file=file)
    import cv2

    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise fail("unreadable_raw.undecodable", file=file, detail="OpenCV finds no picture")
    return np.asarray(image)


def _tiff(file: Path, data: bytes) -> NDArray[Any]:
    import tifffile

    try:
        with tifffile.TiffFile(io.BytesIO(data)) as tiff:
            page: Any = tiff.pages.first
            if len(tiff.pages) > 1:
                raise fail("not_sensor_raw.pages", file=file, count=len(tiff.pages))
            if page.photometric == tifffile.PHOTOMETRIC.MINISWHITE:
                raise fail("unsupported_raw.negative", file=file)
            check_size(file, page.imagewidth, page.imagelength)
            if page.samplesperpixel != 1:
                raise fail("not_sensor_raw.samples_per_pixel", file=file, count=page.samplesperpixel)
            if page.bitspersample not in (8, 16):
                raise fail("unsupported_raw.tiff_bits", file=file, bits=page.bitspersample)
            return np.asarray(page.asarray())
    except (NotSensorRaw, UnsupportedRaw, UnreadableRaw):
        raise
    except Exception as error:  # tifffile raises many types of exceptions
        raise fail("unreadable_raw.undecodable_tiff", file=file, detail=error) from error


def _sidecar(path: Path) -> tuple[dict[str, Any], bytes]:
    """Read a sidecar and check every value; returns the values and the file's bytes."""
    try:
        with path.open("rb") as stream:
            data = stream.read(LARGEST_SIDECAR + 1)
        text = data.decode("utf-8") if len(data) <= LARGEST_SIDECAR else "null"
        values = json.loads(text, object_pairs_hook=_once)
    except (OSError, ValueError, RecursionError) as error:
        raise InvalidArgument(f"{path} cannot be read ({error}).", "Write it as docs/raw.md shows.") from error

    def need(right: bool, what: str) -> None:
        if not right:
            raise InvalidArgument(f"{path}: {what}.", "Write it as docs/raw.md shows.")

    need(isinstance(values, dict) and values.get("format") == SIDECAR, f"it is no {SIDECAR}")
    assert isinstance(values, dict)
    need(
        {"cfa", "black", "white"} <= values.keys() <= _KEYS, "it needs cfa, black and white, and knows no other keys"
    )
    need(values["cfa"] in CFA_ORDERS, f"cfa must be one of {', '.join(CFA_ORDERS)}")
    rows = values["black"] if isinstance(values["black"], list) else [[values["black"]] * 2] * 2
    square = len(rows) == 2 and all(isinstance(row, list) and len(row) == 2 for row in rows)
    need(square and all(_number(v) for row in rows for v in row), "black must be a number, or [[a, b], [c, d]]")
    need(_number(values["white"]) and values["white"] > 0, "white must be a positive number")
    for key in ("exposure", "iso"):
        need(key not in values or (_number(values[key]) and values[key] > 0), f"{key} must be a positive number")
    for key in ("make", "model"):
        need(isinstance(values.get(key, ""), str) and len(values.get(key, "")) <= 200, f"{key} must be a short text")
    need(values.get("orientation", 1) in range(1, 9), "orientation must be 1 to 8")
    return values, data


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; refuses duplicate keys, whose meaning is ambiguous."""
    members = dict(pairs)
    if len(members) < len(pairs):
        raise ValueError("a key stands twice")
    return members


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 65535


def _check_levels(file: Path, samples: NDArray[np.uint16], black: Floats, white: float) -> None:
    """Raise if the levels are impossible for these samples."""
    if not (np.isfinite(black).all() and 0 < white <= 65535 and (black < white).all() and (black >= 0).all()):
        raise fail("unsupported_raw.levels", file=file, black=black.min(), white=white)
    if int(samples.max()) > 4 * white:
        raise fail("unsupported_raw.above_white", file=file, largest=samples.max(), white=white)


def _positive(value: float) -> float | None:
    return float(value) if np.isfinite(value) and value > 0 else None


def _version(rawpy: Any) -> str:
    return ".".join(map(str, rawpy.libraw_version))
