"""Reads Sekonic's CSV (C-700, C-800, C-7000): lines `Spectral Data 380[nm],0.0012`, every 5 nm, then every 1 nm."""

from __future__ import annotations

import re
from pathlib import Path

from camssf.grid import Floats
from camssf.spectra.readers.lines import enough, finest

_LINE = re.compile(r"^\s*Spectral Data (\d{3,4})\[nm\][ \t]*,(.*)$", re.MULTILINE)


def claims(text: str) -> bool:
    """Whether enough lines have this form."""
    return enough(_LINE, text)


def read(text: str, path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and power, (w,) each, every 1 nm if available; errors as in `lines.finest`."""
    return finest(_LINE, text, path)
