"""Reads the columns of a CSV of numbers."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.files import kind_of, local
from camssf.grid import Floats

PathLike: TypeAlias = str | Path

LARGEST_FILE = 64 * 2**20


def read_columns(path: PathLike, names: tuple[str, ...]) -> tuple[Floats, ...]:
    """The named columns of a CSV, (w,) each; the first must increase.

    Raises:
        InvalidArgument: unreadable, other columns, values that are not finite, or a first column that does not
            increase.
    """
    wanted = ",".join(names)
    try:
        with open(local(path), "rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
        if (kind := kind_of(data)) is not None:
            raise InvalidArgument(f"{path} is {kind}, not a table.", f"Give a CSV of {wanted}.")
        if len(data) > LARGEST_FILE:
            raise InvalidArgument(f"{path} is larger than {LARGEST_FILE} bytes.", f"Give a table of {wanted}.")
        lines = [line for line in data.decode("utf-8-sig").splitlines() if line.strip() and line.lstrip()[0] != "#"]
        rows = list(csv.DictReader(io.StringIO("\n".join(lines))))
        table = np.array([[float(row[name]) for name in names] for row in rows], dtype=np.float64)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8"
        raise InvalidArgument(f"{path} cannot be read: {reason}.", "Check the path.") from error
    except (KeyError, TypeError, ValueError, csv.Error) as error:
        raise InvalidArgument(f"{path} is not a table of {wanted}.", f"Its first line must read {wanted}.") from error
    if len(table) < 2 or not np.isfinite(table).all() or (np.diff(table[:, 0]) <= 0).any():
        raise InvalidArgument(
            f"{path} holds {len(table)} rows, or values that are not finite, or a {names[0]} that does not increase.",
            "Sort it, each value once.",
        )
    return tuple(table.T)
