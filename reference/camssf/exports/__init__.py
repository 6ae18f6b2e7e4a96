"""Writes a result document in the formats of other programs. The writers are independent of each other."""

from __future__ import annotations

from camssf.exports.curves import ExportedCurves, read_result
from camssf.exports.formats import FORMATS, Format, export

__all__ = ["FORMATS", "ExportedCurves", "Format", "export", "read_result"]
