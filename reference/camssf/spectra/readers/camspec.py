"""Reads the camera list of Jiang et al. 2013 (camspec_database.txt): a name, then a line for each of R, G, B.

Each line has 33 numbers, 400 to 720 nm every 10 nm, separated by tabs or blanks.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra.text import numbers_of

NM: Floats = np.arange(400.0, 721.0, 10.0)
NM.setflags(write=False)


def claims(text: str) -> bool:
    """Whether the first line is not a row of numbers and the second is a row of 33."""
    first = [line.split() for line in text.splitlines() if line.strip()][:2]
    return len(first) == 2 and numbers_of(first[0]) is None and len(numbers_of(first[1]) or ()) == NM.size


def read(text: str, path: Path) -> dict[str, tuple[Floats, Floats]]:
    """All cameras, by name.

    Raises:
        InvalidArgument: a camera without three rows of 33 numbers, or a camera listed twice.
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    cameras: dict[str, tuple[Floats, Floats]] = {}
    for at in range(0, len(lines), 4):
        name, *curves = lines[at : at + 4]
        table = [numbers_of(curve.split()) for curve in curves]
        if numbers_of(name.split()) is not None or [len(row or ()) for row in table] != [NM.size] * 3:
            raise InvalidArgument(
                f"{path} ends early at {name[:40]!r}.", "Each camera has a name and three lines of 33 numbers."
            )
        if name in cameras:
            raise InvalidArgument(f"{path} has {name[:40]!r} twice.", "Leave one of them out.")
        cameras[name] = (NM, np.array(table, dtype=np.float64).T)
    return cameras
