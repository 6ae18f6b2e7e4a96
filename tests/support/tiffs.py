"""Small TIFFs that have tags and no picture."""

import struct
from typing import Any

FIRST = {271: "Maker", 272: "Model", 50735: "body 9"}
EXIF = {
    42036: "Wide 24 mm", 37386: (247, 10), 33437: (18, 10), 36867: "2026:11:20 09:15:00", 36881: "+01:00",
}  # fmt: skip
"""Tags of a photo's two directories."""


def tiff(first: dict[int, Any], exif: dict[int, Any]) -> bytes:
    """A TIFF of two directories: text, or (numerator, denominator)."""
    main = _directory(8, first | {34665: 0})
    start = 8 + len(main)
    return b"II*\0" + struct.pack("<I", 8) + _directory(8, first | {34665: start}) + _directory(start, exif)


def _directory(at: int, tags: dict[int, Any]) -> bytes:
    entries, rest = b"", b""
    behind = at + 2 + 12 * len(tags) + 4
    for tag, value in sorted(tags.items()):
        if isinstance(value, str):
            kind, count, data = 2, len(value) + 1, value.encode() + b"\0"
        elif isinstance(value, int):
            kind, count, data = 4, 1, struct.pack("<I", value)
        else:
            kind, count, data = 5, 1, struct.pack("<II", *value)
        if len(data) > 4:
            entries += struct.pack("<HHII", tag, kind, count, behind + len(rest))
            rest += data
        else:
            entries += struct.pack("<HHI4s", tag, kind, count, data)
    return struct.pack("<H", len(tags)) + entries + b"\0\0\0\0" + rest
