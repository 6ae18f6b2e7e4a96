"""Reads rawtoaces' camera file: JSON, `spectral_data.data.main` by wavelength, with columns named in `index.main`."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra.readers.strict_json import UNSOUND, load, number


def claims(text: str) -> bool:
    """Whether the text looks like JSON."""
    return text.lstrip().startswith("{")


def read(text: str, path: Path) -> dict[str, tuple[Floats, Floats]]:
    """The one camera: wavelengths (w,) and curves (w, 3).

    Raises:
        InvalidArgument: other JSON, or a table without red, green and blue.
    """
    try:
        document = load(text)
        header, spectra = document.get("header") or {}, document["spectral_data"]
        index, rows = spectra["index"]["main"], spectra["data"]["main"]
        places = [[str(each).casefold() for each in index].index(channel) for channel in "rgb"]
        table = sorted((_number(nm), [number(row[i]) for i in places]) for nm, row in rows.items())
        words = [header.get(key) for key in ("manufacturer", "model")]
    except UNSOUND as error:
        raise InvalidArgument(
            f"{path} is not a camera file of rawtoaces.",
            "It needs spectral_data with index.main R, G, B and data.main by wavelength. A result of camssf becomes "
            "one by `camssf export --to rawtoaces`.",
        ) from error
    if not table:
        raise InvalidArgument(f"{path} has no samples.", "Give measured curves.")
    name = " ".join(" ".join(str(word) for word in words if word).split()) or path.stem
    return {name: (np.array([nm for nm, _ in table]), np.array([row for _, row in table], dtype=np.float64))}


def _number(text: str) -> float:
    if not re.fullmatch(r"\d{1,5}(\.\d{1,9})?", text, re.ASCII):
        raise ValueError(text)
    return float(text)
