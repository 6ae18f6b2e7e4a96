"""Reads DCamProf's camera SSF file: JSON with `camera_name`, `ssf_bands` and a list for each of red, green and blue.

`ssf_bands` lists the wavelengths in nm, or is [first, last, step]. The three curves have one scale. DCamProf's own
files contain comments, `//` and `/* */`, which JSON does not allow.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS, Floats
from camssf.spectra.text import UNSOUND, json_number
from camssf.strict_json import parse_strict

_STRING_OR_COMMENT = re.compile(r'("(?:\\.|[^"\\])*(?:"|\Z))|//[^\n]*|/\*.*?(?:\*/|\Z)', re.DOTALL)
_MOST_BANDS = 10_000


def claims(text: str) -> bool:
    """Whether the text looks like JSON, possibly after a comment, with `ssf_bands`."""
    return text.lstrip()[:1] in ("{", "/") and '"ssf_bands"' in text


def read(text: str, path: Path) -> dict[str, tuple[Floats, Floats]]:
    """The one camera: wavelengths (w,) and curves (w, 3).

    Raises:
        InvalidArgument: other JSON, or lists that differ in length from the bands.
    """
    try:
        document = parse_strict(_STRING_OR_COMMENT.sub(lambda match: match[1] or " ", text))
        bands = _bands([json_number(number) for number in document["ssf_bands"]])
        curves = [[json_number(number) for number in document[f"{name}_ssf"]] for name in CHANNELS]
        name = " ".join(_text(document["camera_name"]).split()) or path.stem
        table = np.array(curves, dtype=np.float64).T
    except UNSOUND as error:
        raise _none(path) from error
    if table.shape != (bands.size, 3):
        raise _none(path)
    return {name: (bands, table)}


def _bands(listed: list[float]) -> Floats:
    """Wavelengths, nm. Three numbers that do not increase at the end are read as [first, last, step]."""
    if len(listed) != 3 or listed[2] > listed[1]:
        return np.array(listed, dtype=np.float64)
    first, last, step = listed
    count = round((last - first) / step) + 1 if step > 0 else 0
    if not 2 <= count <= _MOST_BANDS or abs(first + (count - 1) * step - last) > 1e-6:
        raise ValueError("ssf_bands")
    return np.linspace(first, last, count)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(value)
    return value


def _none(path: Path) -> InvalidArgument:
    return InvalidArgument(
        f"{path} is not a camera SSF file of DCamProf.",
        "It needs camera_name, ssf_bands (every wavelength in nm, or [first, last, step]) and red_ssf, green_ssf and "
        "blue_ssf with a number a band.",
    )
