"""Writes a result in the formats of other programs. The writers are independent of each other."""

from __future__ import annotations

from camssf.exports.curves import ExportedCurves, exported
from camssf.exports.formats import FORMATS, Format, export

__all__ = ["FORMATS", "ExportedCurves", "Format", "export", "exported"]
