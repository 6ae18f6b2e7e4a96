"""Result document → other people's formats. Each writer reads the document only and knows no other writer."""

from __future__ import annotations

from camssf.exports.curves import Curves, read_result
from camssf.exports.formats import FORMATS, Format, export

__all__ = ["FORMATS", "Curves", "Format", "export", "read_result"]
