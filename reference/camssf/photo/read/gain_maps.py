"""Reads the opcode lists of a DNG and the gain maps in them (DNG Specification 1.7, chapter 7).

A gain map holds the lens shading that a phone measured but did not correct. Lists are big-endian in every file.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats

GAIN_MAP = 9
OPTIONAL = 1
"""Flag of an opcode that a reader may skip."""
HARMLESS = frozenset((1, 2, 3, 4, 5, 6, GAIN_MAP, 14))
"""Opcodes that may be left out even if the file requires them: docs/raw.md says why."""
OPCODES = {
    7: "MapTable", 8: "MapPolynomial",
    10: "DeltaPerRow", 11: "DeltaPerColumn", 12: "ScalePerRow", 13: "ScalePerColumn",
}  # fmt: skip
"""Names of the opcodes that change the samples' values."""
_HEAD = struct.Struct(">10I4dI")
_HUGE = 1 << 24
"""A map with more points than this is treated as damaged."""


@dataclass(frozen=True)
class GainMap:
    """Factors at a coarse grid of points over the active area, for samples above black.

    Attributes:
        stage: number of the opcode list: 1 before linearisation, 2 on the mosaic, 3 on the demosaiced picture.
        top, left, bottom, right: rectangle of the active area that it covers, px; bottom and right are exclusive.
        plane, planes: the first plane it covers and their number; a mosaic has plane 0, list 3 has R, G, B.
        row_pitch, column_pitch: it acts on every row_pitch-th row and column_pitch-th column, from the first.
        spacing, origin: (rows, columns) of the points, as fractions of the active area's height and width.
        gains: (v, h, p) factors; plane i has the entry min(i, p - 1).
    """

    stage: int
    top: int
    left: int
    bottom: int
    right: int
    plane: int
    planes: int
    row_pitch: int
    column_pitch: int
    spacing: tuple[float, float]
    origin: tuple[float, float]
    gains: Floats

    def covers(self, x: float, y: float, row: int, column: int, plane: int) -> bool:
        """True if the map covers the samples around (x, y) that lie at (row, column) of the 2 × 2 cell."""
        return (
            self.top <= int(np.floor(y + 0.5)) < self.bottom
            and self.left <= int(np.floor(x + 0.5)) < self.right
            and (self.row_pitch == 1 or (row - self.top) % 2 == 0)
            and (self.column_pitch == 1 or (column - self.left) % 2 == 0)
            and self.plane <= plane < self.plane + self.planes
        )

    def at(self, x: float, y: float, width: int, height: int, plane: int) -> float:
        """The factor at (x, y) px of an active area of this size: bilinear, constant beyond the outer points."""
        return float(self.over(np.array([y]), np.array([x]), (height, width), plane)[0, 0])

    def over(self, rows: Floats, columns: Floats, size: tuple[int, int], plane: int) -> Floats:
        """`at` for every pair of a row and a column, (rows, columns), of an active area of this height and width."""
        net = self.gains[:, :, min(plane, self.gains.shape[2] - 1)]
        for axis, places in ((0, rows), (1, columns)):
            along = ((places + 0.5) / size[axis] - self.origin[axis]) / self.spacing[axis]
            along = np.clip(along, 0.0, net.shape[axis] - 1.0)
            below = along.astype(np.int64)
            above = np.minimum(below + 1, net.shape[axis] - 1)
            share = np.expand_dims(along - below, 1 - axis)
            net = np.take(net, below, axis) * (1.0 - share) + np.take(net, above, axis) * share
        return net


def read_opcodes(data: bytes) -> Iterator[tuple[int, bool, bytes]]:
    """The opcodes of a list, in its order: number, whether a reader may skip it, and parameters.

    Raises:
        ValueError: the list ends early; the message completes "opcode list N ...".
    """
    if not data:
        return
    place = 4
    try:
        for _ in range(struct.unpack_from(">I", data)[0]):
            number, _version, flags, length = struct.unpack_from(">4I", data, place)
            place += 16 + length
            if place > len(data):
                raise ValueError("ends early")
            yield number, bool(flags & OPTIONAL), data[place - length : place]
    except struct.error:
        raise ValueError("ends early") from None


def read_gain_map(data: bytes, stage: int) -> GainMap:
    """The gain map with these parameters, of opcode list `stage`.

    Raises:
        ValueError: it breaks the format; the message completes "opcode list N ...".
    """
    if len(data) < _HEAD.size:
        raise ValueError("holds a gain map that ends early")
    *area, v, h, step_v, step_h, from_v, from_h, p = _HEAD.unpack_from(data)
    if not 0 < v * h * p <= _HUGE or len(data) != _HEAD.size + 4 * v * h * p:
        raise ValueError(f"holds a gain map of {v} × {h} × {p} points in {len(data)} bytes")
    # like Adobe's reader: the spacing of a single point is ignored
    step_v, from_v = (1.0, 0.0) if v == 1 else (step_v, from_v)
    step_h, from_h = (1.0, 0.0) if h == 1 else (step_h, from_h)
    gains = np.frombuffer(data, ">f4", offset=_HEAD.size).astype(np.float64).reshape(v, h, p)
    sizes = np.array([step_v, step_h, from_v, from_h])
    if not (np.isfinite(gains).all() and (gains > 0).all() and np.isfinite(sizes).all() and (sizes[:2] > 0).all()):
        raise ValueError("holds a gain map whose gains or spacings are not positive")
    top, left, bottom, right, plane, planes, row_pitch, column_pitch = area
    if min(row_pitch, column_pitch) < 1:
        raise ValueError("holds a gain map with a pitch of 0")
    gains.setflags(write=False)
    return GainMap(
        stage, top, left, bottom, right, plane, planes, row_pitch, column_pitch, (step_v, step_h), (from_v, from_h),
        gains,
    )  # fmt: skip
