"""Reads UPRtek's text (CV600, MK350 ...; with the suffix `.xls`): lines of `380nm`, a tab and a value."""

from __future__ import annotations

import re
from pathlib import Path

from camssf.grid import Floats
from camssf.spectra.readers.lines import enough, finest

_LINE = re.compile(r"^(\d{3,4})nm\t(.*)$", re.MULTILINE)


def claims(text: str) -> bool:
    """Whether enough lines have this form."""
    return enough(_LINE, text)


def read(text: str, path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and power, (w,) each; errors as in `lines.finest`."""
    return finest(_LINE, text, path)
