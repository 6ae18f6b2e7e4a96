"""Reads the columns of a CSV of numbers."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.files import local
from camssf.grid import Floats
from camssf.spectra.sampled import ascending
from camssf.spectra.text import numbers_in, read_text, rows_of

PathLike: TypeAlias = str | Path


def read_columns(path: PathLike, names: tuple[str, ...]) -> tuple[Floats, ...]:
    """The named columns of a CSV, (w,) each, in the order in which the first one increases.

    Raises:
        InvalidArgument: unreadable, other columns, values that are not finite, or a first column that neither
            increases nor decreases.
    """
    path = local(path)
    wanted = ",".join(names)
    rows = rows_of(read_text(path))
    at = next((i for i, row in enumerate(rows) if set(names) <= set(row.fields)), None)
    if at is None:
        raise InvalidArgument(f"{path} is not a table of {wanted}.", f"Its first line must read {wanted}.")
    columns = [rows[at].fields.index(name) for name in names]
    body = rows[at + 1 :]
    if (short := next((row for row in body if len(row.fields) <= max(columns)), None)) is not None:
        raise InvalidArgument(f"{path}, line {short.line}, has too few cells.", f"Write {wanted} in each line.")
    selected = [row._replace(fields=[row.fields[i] for i in columns]) for row in body]
    table = numbers_in(selected, path, wavelengths=True).reshape(len(body), len(names))
    first, table = ascending(table[:, 0], table)
    if len(table) < 2 or not np.isfinite(table).all() or (np.diff(first) <= 0).any():
        raise InvalidArgument(
            f"{path} holds {len(table)} rows, or values that are not finite, or a {names[0]} that does not increase.",
            "Sort it, each value once.",
        )
    return tuple(table.T)
