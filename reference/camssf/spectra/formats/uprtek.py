"""UPRtek's text (CV600, MK350 ...; its name ends in `.xls`): `380nm`, a tab and a value a line."""

from __future__ import annotations

import re
from pathlib import Path

from camssf.grid import Floats
from camssf.spectra.formats.lines import enough, finest

_LINE = re.compile(r"^(\d{3,4})nm\t(.*)$", re.MULTILINE)


def claims(text: str) -> bool:
    """By its lines."""
    return enough(_LINE, text)


def read(text: str, path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and power, (w,) each; errors as `lines.finest`."""
    return finest(_LINE, text, path)
