"""Writes ICC version 4.3 matrix profiles (ICC.1:2010): RGB of a camera or of a display to D50 XYZ."""

from __future__ import annotations

import hashlib
import struct
from datetime import datetime

import numpy as np

from camssf.colorimetry import GAMMA, OFFSET, SLOPE_OF_DARK
from camssf.exports.curves import ExportedCurves
from camssf.exports.matrices import D50, Matrices
from camssf.grid import Floats

_ID = slice(84, 100)


def icc(curves: ExportedCurves, matrices: Matrices, created: datetime) -> bytes:
    """The profile of linear, white-balanced camera RGB."""
    says = f"{curves.camera}, {matrices.lamp}: {curves.description}"
    return matrix_profile(b"scnr", says, matrices.to_d50, matrices.adaptation, LINEAR, created)


LINEAR = b"curv" + bytes(4) + struct.pack(">I", 0)
"""Curve of the identity."""
_NUMBERS = (GAMMA, 1.0 / (1.0 + OFFSET), OFFSET / (1.0 + OFFSET), 1.0 / SLOPE_OF_DARK, 0.04045)
SRGB_CURVE = b"para" + bytes(4) + struct.pack(">HH5i", 3, 0, *(round(value * 65536) for value in _NUMBERS))
"""The curve of sRGB (IEC 61966-2-1)."""


def matrix_profile(
    kind: bytes, says: str, to_d50: Floats, chromatic: Floats, curve: bytes, created: datetime
) -> bytes:
    """A profile: curves, colorants that sum to D50, and the chromatic adaptation matrix.

    Args:
        kind: its class: b"scnr", an input, or b"mntr", a display.
        says: its description.
        to_d50: (3, 3) from linear RGB to XYZ adapted to D50.
        chromatic: (3, 3) from XYZ of the white itself to D50.
        curve: LINEAR or SRGB_CURVE, for the three channels.
        created: when.
    """
    colorants = _fixed(to_d50.T)
    colorants[1] = _fixed(D50) - colorants[0] - colorants[2]  # so that the sum is D50 to the last bit
    tags = {
        "desc": _text(says),
        "cprt": _text("No copyright is claimed on this profile."),
        "wtpt": _xyz(_fixed(D50)),
        "chad": b"sf32" + bytes(4) + _fixed(chromatic).astype(">i4").tobytes(),
        "rXYZ": _xyz(colorants[0]),
        "gXYZ": _xyz(colorants[1]),
        "bXYZ": _xyz(colorants[2]),
        "rTRC": curve,
        "gTRC": curve,
        "bTRC": curve,
    }
    table, data, places = struct.pack(">I", len(tags)), b"", dict[bytes, int]()
    start = 128 + 4 + 12 * len(tags)
    for name, content in tags.items():
        if content not in places:
            places[content] = start + len(data)
            data += content + bytes(-len(content) % 4)
        table += struct.pack(">4sII", name.encode(), places[content], len(content))
    time = struct.pack(">6H", *created.timetuple()[:6])
    header = struct.pack(
        ">I4s4s4s4s4s12s4s4sI4s4sQI12s4s",
        128 + len(table) + len(data), bytes(4), b"\x04\x30\0\0", kind, b"RGB ", b"XYZ ", time, b"acsp", bytes(4),
        0, bytes(4), bytes(4), 0, 1, _fixed(D50).astype(">i4").tobytes(), bytes(4),
    ).ljust(128, b"\0")  # fmt: skip
    profile = bytearray(header + table + data)
    # the profile ID is the MD5 with flags, rendering intent and ID set to zero
    blank = bytearray(profile)
    blank[44:48], blank[64:68] = bytes(4), bytes(4)
    profile[_ID] = hashlib.md5(blank, usedforsecurity=False).digest()
    return bytes(profile)


def _fixed(values: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """Convert to s15Fixed16Number."""
    return np.rint(np.asarray(values) * 65536.0).astype(np.int64)


def _xyz(fixed: np.ndarray[tuple[int, ...], np.dtype[np.int64]]) -> bytes:
    return b"XYZ " + bytes(4) + fixed.astype(">i4").tobytes()


def _text(words: str) -> bytes:
    """Encode as multiLocalizedUnicodeType with one language."""
    coded = words.encode("utf-16-be")
    return b"mluc" + bytes(4) + struct.pack(">II2s2sII", 1, 12, b"en", b"US", len(coded), 28) + coded
