"""Writes samples as a DNG file, and the camera's true curves as a CSV file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.errors import CalibrationError
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.read.tiff import Tiff
from camssf.spectra import CameraCurves
from camssf.spectra.bundled import illuminant, observer
from camssf_lab.simulation.shot_plan import FileTags

MAKE = "camssf"
"""Maker in the tags of a simulated photo, unless another is given."""
MARK = "camssf simulated camera"
"""UniqueCameraModel of every simulated photo, whatever its make and model."""


def write_dng(
    path: Path,
    samples: NDArray[np.uint16],
    tags: FileTags,
    camera: CameraCurves,
    neutral: Floats,
    compression: str | None,
) -> None:
    """Write a DNG 1.4, CFA in IFD0, 16 bits, uncompressed or in lossless JPEG tiles ("ljpeg")."""
    import tifffile

    from camssf.version import __version__

    height, width = samples.shape
    pattern = bytes("RGB".index(letter) for letter in tags.cfa)
    extra: list[tuple[int, int, int, Any, bool]] = [
        (271, 2, 0, _ascii(tags.make or MAKE), True),
        (272, 2, 0, _ascii(tags.model or camera.name), True),
        (274, 3, 1, 1, True),
        (33421, 3, 2, (2, 2), True),
        (33422, 1, 4, pattern, True),
        (33434, 5, 1, tuple(_rationals(np.array([tags.exposure]), 1_000_000)), True),
        (34855, 3, 1, round(tags.iso), True),
        (50706, 1, 4, bytes((1, 4, 0, 0)), True),
        (50707, 1, 4, bytes((1, 1, 0, 0)), True),
        (50708, 2, 0, MARK, True),
        (50713, 3, 2, (2, 2), True),
        (50714, 5, 4, _rationals(np.full(4, tags.black), 100), True),
        (50717, 4, 1, tags.white_level, True),
        (50721, 10, 9, _rationals(color_matrix(camera)), True),
        (50728, 5, 3, _rationals(neutral), True),
        (50778, 3, 1, 21, True),
        (50829, 4, 4, (0, 0, height, width), True),
    ]
    options: dict[str, Any] = {
        "photometric": "cfa",
        "metadata": None,
        "software": f"camssf {__version__}",
        "extratags": extra,
    }
    if compression is None:
        tifffile.imwrite(path, samples, byteorder="<", rowsperstrip=64, **options)
        return
    tile = (256, 256)
    tifffile.imwrite(
        path,
        _jpeg_tiles(samples, tile),
        byteorder="<",
        shape=samples.shape,
        dtype=np.uint16,
        tile=tile,
        compression=7,
        **options,
    )


def write_truth(path: Path, camera: CameraCurves) -> None:
    """Write the curves, each with peak 1, as a CSV wavelength_nm,red,green,blue."""
    curves = camera.values / camera.values.max(axis=0)
    rows = np.column_stack([WAVELENGTHS, curves])
    lines = [f"{nm:.1f},{r:.9g},{g:.9g},{b:.9g}" for nm, r, g, b in rows.tolist()]
    path.write_text("\n".join(["wavelength_nm,red,green,blue", *lines, ""]), encoding="utf-8")


def is_simulated(path: Path) -> bool:
    """Whether a file is a DNG that `write_dng` wrote."""
    try:
        with path.open("rb") as stream:
            tiff = Tiff(path, stream)
            return tiff.text(tiff.main[0], 50708) == MARK
    except (OSError, CalibrationError):
        return False


def _ascii(text: str) -> str:
    return text.encode("ascii", "replace").decode()


def color_matrix(camera: CameraCurves, lamp: str = "D65") -> Floats:
    """(3, 3) XYZ to camera under a lamp: the CIE 1931 observer fitted to the curves, rows scaled to keep white."""
    functions, daylight = observer("1931"), illuminant(lamp)
    weights = np.sqrt(daylight)[:, None]
    matrix = np.linalg.lstsq(weights * functions, weights * camera.values, rcond=None)[0].T
    white = daylight @ functions / (daylight @ functions[:, 1])
    neutral = daylight @ camera.values
    return np.asarray(matrix * (neutral / neutral.max() / (matrix @ white))[:, None], dtype=np.float64)


def _rationals(values: Floats, denominator: int = 10000) -> list[int]:
    return [part for value in np.ravel(values) for part in (round(float(value) * denominator), denominator)]


def _jpeg_tiles(samples: NDArray[np.uint16], tile: tuple[int, int]) -> Iterator[bytes]:
    """Lossless JPEG (SOF3) of every tile, edge tiles padded; two components, as a CFA row alternates two colours."""
    import imagecodecs

    bits = max(2, int(samples.max()).bit_length())
    padded = np.pad(samples, [(0, -n % t) for n, t in zip(samples.shape, tile, strict=True)], mode="edge")
    for top in range(0, padded.shape[0], tile[0]):
        for left in range(0, padded.shape[1], tile[1]):
            block = padded[top : top + tile[0], left : left + tile[1]]
            pairs = np.ascontiguousarray(block).reshape(tile[0], tile[1] // 2, 2)
            yield bytes(imagecodecs.jpeg_encode(pairs, lossless=True, bitspersample=bits))
