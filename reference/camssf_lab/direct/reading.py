"""Reads a spectrum from a frame (DNG, grey TIFF or CSV) and its dark frame."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.files import local
from camssf.grid import CHANNELS, Floats
from camssf.messages import fail
from camssf.photo.read.dng import Mosaic, read_dng
from camssf_lab.direct.columns import PathLike, read_columns
from camssf_lab.direct.extraction import FrameSpectrum, extract

_CLIPPED = 0.002

DENSEST = 2000
"""Largest compression ratio of a TIFF that is read; deflate reaches 1032, LZW 1365."""


def read_spectrum(path: PathLike, dark: PathLike | None, channels: int) -> tuple[FrameSpectrum, tuple[str, str]]:
    """The spectrum in a file, and the camera's make and model ("" if unknown)."""
    name, kind = local(path).name, Path(path).suffix.casefold()
    if kind == ".csv":
        if dark is not None:
            raise InvalidArgument(
                f"{name} is a table, so a dark frame cannot be subtracted from it.", "Subtract it before extracting."
            )
        pixel, *columns = read_columns(path, ("pixel", *(CHANNELS if channels == 3 else ("signal",))))
        positions = (pixel,) * channels
        return FrameSpectrum(name, positions, tuple(columns), None, 0.0, "as in the table"), ("", "")
    mosaic: Mosaic | None = None
    if kind == ".dng":
        mosaic = read_dng(path)
        samples, ceiling = mosaic.samples.astype(np.float64), mosaic.white
    elif kind in (".tif", ".tiff") and channels == 1:
        stored = _read_tiff(path)
        samples, ceiling = stored.astype(np.float64), float(np.iinfo(stored.dtype).max)
    else:
        kinds = (
            "a DNG, or a CSV pixel,red,green,blue" if channels == 3 else "a grey TIFF, a DNG or a CSV pixel,signal"
        )
        raise InvalidArgument(
            f"{name} cannot be the {'colour' if channels == 3 else 'mono'} frame.", f"Give {kinds}."
        )
    _check_ceiling(samples, ceiling, name)
    level, words = _black(samples, mosaic, dark, name)
    cell = np.zeros((2, 2), dtype=np.int64)
    if mosaic is not None and channels == 3:
        cell = np.array(["RGB".index(letter) for letter in mosaic.cfa]).reshape(2, 2)
    camera = ("", "") if mosaic is None else (mosaic.make, mosaic.model)
    return extract(samples - level, cell, name, words), camera


def _check_ceiling(samples: Floats, ceiling: float, name: str) -> None:
    """Raise Overexposed if too many samples are at the ceiling: the file's, or a lower one where values pile up."""
    bright = samples[samples > 0.5 * samples.max()]
    levels, counts = np.unique(bright, return_counts=True)
    heap = len(counts) > 4 and counts[-1] > 3 * counts[-5:-1].mean()
    share = float(np.mean(bright >= (levels[-1] if heap else ceiling))) if bright.size else 0.0
    if share > _CLIPPED:
        raise fail("overexposed.spectrum", value=share, threshold=_CLIPPED, file=name, share=share, level=levels[-1])


def _black(samples: Floats, mosaic: Mosaic | None, dark: PathLike | None, name: str) -> tuple[Floats | float, str]:
    """The black level to subtract, and its source in words."""
    if dark is not None:
        closed = None if mosaic is None else read_dng(dark)
        other = (_read_tiff(dark) if closed is None else closed.samples).astype(np.float64)
        for word in ("exposure", "iso"):
            ours, theirs = getattr(mosaic, word, None), getattr(closed, word, None)
            if ours is not None and theirs is not None and abs(theirs / ours - 1.0) > 0.01:
                raise fail(
                    "frames_differ.dark_setting",
                    value=float(theirs),
                    threshold=float(ours),
                    file=name,
                    setting=word,
                    here=ours,
                    there=theirs,
                )
        if other.shape != samples.shape:
            raise fail(
                "frames_differ.dark_size",
                file=name,
                size=f"{samples.shape[1]} × {samples.shape[0]}",
                other=f"{other.shape[1]} × {other.shape[0]}",
            )
        if other.mean() >= samples.mean():
            raise fail("frames_differ.bright_dark_frame", file=name)
        return float(other.mean()) if mosaic is None else _cell_means(other), "a dark frame"
    if mosaic is not None:
        repeat = (samples.shape[0] // 2 + 1, samples.shape[1] // 2 + 1)
        return np.tile(mosaic.black, repeat)[: samples.shape[0], : samples.shape[1]], "the file's black level"
    rows = samples.mean(axis=1)
    beside = rows <= np.quantile(rows, 0.1)
    return float(np.median(samples[beside])), "the darkest tenth of the rows"


def _cell_means(dark: Floats) -> Floats:
    """(h, w): the mean of the dark frame at each position of the 2 × 2 cell, without the dark frame's noise."""
    level = np.empty_like(dark)
    for row in (0, 1):
        for column in (0, 1):
            level[row::2, column::2] = dark[row::2, column::2].mean()
    return level


def _read_tiff(path: PathLike) -> NDArray[Any]:
    """(h, w) samples of a grey TIFF of unsigned integers, as stored."""
    import tifffile

    try:
        with tifffile.TiffFile(path) as file:
            size = sum(math.prod(sery.shape) * sery.dtype.itemsize for sery in file.series[:1])
            if size > DENSEST * file.filehandle.size:
                raise ValueError(f"{file.filehandle.size} bytes cannot hold {size}")
            samples = file.asarray()
    except FileNotFoundError as error:
        raise fail("unreadable_raw.missing", file=path) from error
    except Exception as error:  # tifffile and its codecs raise many kinds
        raise fail("unreadable_raw.undecodable_tiff", file=path, detail=error) from error
    if samples.ndim != 2 or samples.dtype.kind != "u" or samples.size == 0:
        raise fail("unreadable_raw.no_mono_tiff", file=path, type=samples.dtype, shape=samples.shape)
    return np.asarray(samples)
