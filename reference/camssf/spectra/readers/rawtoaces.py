"""Reads rawtoaces' JSON of cameras and lamps: `spectral_data.data.main` by wavelength, columns as in `index.main`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra.text import UNSOUND, json_number
from camssf.strict_json import parse_strict


def claims(text: str) -> bool:
    """Whether the text looks like JSON."""
    return re.match(r"\s*(\{|\[\s*[\[{\"0-9-])", text) is not None


def read(text: str, path: Path) -> dict[str, tuple[Floats, Floats]]:
    """The one camera: wavelengths (w,) and curves (w, 3).

    Raises:
        InvalidArgument: other JSON, or a table without red, green and blue.
    """
    advice = (
        "It needs spectral_data with index.main R, G, B and data.main by wavelength. A result of camssf becomes one "
        "by `camssf export --to rawtoaces`."
    )
    header, columns, table = _table(text, path, "a camera file of rawtoaces", advice)
    if not set("rgb") <= set(columns):
        raise _other(path, "a camera file of rawtoaces", f"its columns are {', '.join(columns)}", advice)
    words = [header.get(key) for key in ("manufacturer", "model")]
    name = " ".join(" ".join(str(word) for word in words if word).split()) or path.stem
    return {name: (table[:, 0], table[:, [1 + columns.index(channel) for channel in "rgb"]])}


def read_lamp(text: str, path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and power, (w,) each, of an illuminant.

    Raises:
        InvalidArgument: other JSON, or a table of several columns.
    """
    advice = "It needs spectral_data with one column and data.main by wavelength; or give two columns, nm and power."
    _, columns, table = _table(text, path, "an illuminant of rawtoaces", advice)
    if len(columns) != 1:
        raise _other(path, "an illuminant of rawtoaces", f"its columns are {', '.join(columns)}", advice)
    return table[:, 0], table[:, 1]


def _table(text: str, path: Path, what: str, advice: str) -> tuple[dict[str, Any], list[str], Floats]:
    """Header, names of the columns in lower case, and (w, 1 + columns) wavelengths and values, sorted."""
    keys = ""
    try:
        document = parse_strict(text)
        keys = f"its keys are {', '.join(map(str, document))[:60]}" if isinstance(document, dict) else "it is a list"
        header, spectra = document.get("header") or {}, document["spectral_data"]
        columns = [str(column).casefold() for column in spectra["index"]["main"]]
        rows = spectra["data"]["main"]
        table = sorted((_number(nm), *(json_number(row[i]) for i in range(len(columns)))) for nm, row in rows.items())
        header.get("model")
    except UNSOUND as error:
        raise _other(path, what, keys or f"it is not sound JSON ({str(error)[:60]})", advice) from error
    if not table:
        raise InvalidArgument(f"{path} has no samples.", "Give a measured spectrum.")
    return header, columns, np.array(table, dtype=np.float64)


def _other(path: Path, what: str, why: str, advice: str) -> InvalidArgument:
    return InvalidArgument(f"{path} is not {what}: {why}.", advice)


def _number(text: str) -> float:
    if not re.fullmatch(r"\d{1,5}(\.\d{1,9})?", text, re.ASCII):
        raise ValueError(text)
    return float(text)
