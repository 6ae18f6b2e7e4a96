"""Writes a DNG camera profile (.dcp; DNG 1.7, chapters 4 and 6): two illuminants, colour and forward matrices.

It states a linear tone curve and no black rendering; otherwise Adobe's converters apply their own curve and darken
the shadows.
"""

from __future__ import annotations

import struct

import numpy as np

from camssf.errors import InvalidArgument
from camssf.exports.curves import ExportedCurves
from camssf.exports.matrices import LARGEST, matrices, neutral
from camssf.grid import Floats

ILLUMINANTS = {"A": 17, "D65": 21}
"""Lamps with their Exif LightSource codes, the warmer one first."""
_PARTS = 10_000_000
_ASCII, _SHORT, _LONG, _SRATIONAL, _FLOAT = 2, 3, 4, 10, 11
_STRAIGHT = (0.0, 0.0, 1.0, 1.0)
_NO_BLACK_RENDERING = 1


def dcp(curves: ExportedCurves) -> bytes:
    """The profile.

    A colour matrix converts XYZ to raw RGB on the camera's own scale, so the channels' relative scale must be known.
    A forward matrix converts white-balanced RGB to XYZ under D50.

    Raises:
        InvalidArgument: the channels' relative scale is unknown, or the curves give no valid matrix.
    """
    tags: dict[int, tuple[int, bytes, int]] = {
        50708: _text(curves.unique_model or curves.camera),
        50936: _text(f"camssf {curves.status} {curves.sha256[:8]}"),
        50940: (_FLOAT, struct.pack("<4f", *_STRAIGHT), len(_STRAIGHT)),
        50941: (_LONG, struct.pack("<I", 0), 1),
        50942: _text(curves.description),
        51110: (_LONG, struct.pack("<I", _NO_BLACK_RENDERING), 1),
    }
    for which, (lamp, code) in enumerate(ILLUMINANTS.items()):
        transforms = matrices(curves, lamp)
        colour = neutral(curves, lamp)[:, None] * np.linalg.inv(transforms.to_xyz)
        if not np.abs(colour).max() < LARGEST:
            raise InvalidArgument(
                f"No matrix from colours to this camera could be computed under {lamp}.", "Check the curves."
            )
        tags |= {
            50721 + which: _rationals(colour),
            50778 + which: (_SHORT, struct.pack("<H", code), 1),
            50964 + which: _rationals(transforms.to_d50),
        }
    entries, data, start = b"", b"", 8 + 2 + 12 * len(tags) + 4
    for tag, (kind, content, count) in sorted(tags.items()):
        if len(content) > 4:
            place = struct.pack("<I", start + len(data))
            data += content + bytes(len(content) % 2)
        else:
            place = content.ljust(4, b"\0")
        entries += struct.pack("<HHI", tag, kind, count) + place
    return b"IIRC" + struct.pack("<IH", 8, len(tags)) + entries + bytes(4) + data


def _text(words: str) -> tuple[int, bytes, int]:
    content = words.encode() + b"\0"
    return _ASCII, content, len(content)


def _rationals(values: Floats) -> tuple[int, bytes, int]:
    numbers = np.rint(values.ravel() * _PARTS).astype(np.int64)
    content = b"".join(struct.pack("<ii", int(number), _PARTS) for number in numbers)
    return _SRATIONAL, content, numbers.size
