"""Photos of a chart, drawn with integer arithmetic: stages `pose`, `patches` and `finder`.

Each pixel is the mean of 4 × 4 points. A point's position in the chart's lattice (patch centres at integers) is a
quotient of two sums with integer coefficients, so every machine draws the same samples. Patches are uniform, gaps and
surround dark; a formula of the position replaces noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.grid import WAVELENGTHS, Floats
from golden.contract import case
from golden.dngs import JPEG, LONG, RATIONAL, SHORT, Dng, Tags
from golden.forms import Json, chart

BLACK, WHITE = 256, 15000
GAP, TABLE = 420, 1900
"""Levels between the patches, and around the chart, DN."""
SIDE = (44, 100)
"""Half a patch's edge as a fraction of the pitch: 44 / 100."""
Samples = NDArray[np.uint16]


@dataclass(frozen=True)
class View:
    """A chart's pose: maps px (x, y) to lattice (u, v) = (p + q · (x, y)) / (r + s · (x, y)), integer coefficients.

    Attributes:
        size: width, height, px.
        u, v: (p, q_x, q_y) of both numerators; x, y in eighths of a pixel.
        w: (r, s_x, s_y) of the denominator.
    """

    size: tuple[int, int]
    u: tuple[int, int, int]
    v: tuple[int, int, int]
    w: tuple[int, int, int]

    def corners(self) -> Floats:
        """(4, 2) px of the block's outer corners."""
        low, high = -0.44, np.array([5.44, 3.44])
        return self.places(np.array([[low, low], [high[0], low], high, [low, high[1]]]))

    def quads(self) -> Floats:
        """(24, 4, 2) px of the patches' corners."""
        at = np.array([[i % 6, i // 6] for i in range(24)], float)[:, None]
        return self.places(at + 0.44 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))

    def places(self, lattice: Floats) -> Floats:
        """Pixel positions (..., 2) of lattice positions (..., 2): the inverse map."""
        (p, a, b), (q, c, d), (r, e, f) = self.u, self.v, self.w
        u, v = lattice[..., 0], lattice[..., 1]
        m, n = (a - e * u, b - f * u), (c - e * v, d - f * v)
        right = (r * u - p, r * v - q)
        determinant = m[0] * n[1] - m[1] * n[0]
        x = (right[0] * n[1] - right[1] * m[1]) / determinant
        y = (m[0] * right[1] - n[0] * right[0]) / determinant
        return np.stack([x, y], axis=-1) / 8


def turned(pitch: int, turns: int, margin: int = 30) -> View:
    """An upright chart, or one rotated clockwise by quarter turns; `pitch` px between patch centres."""
    wide, high = 5 * pitch + 2 * margin, 3 * pitch + 2 * margin
    size = (wide, high) if turns % 2 == 0 else (high, wide)
    unit, first = (8 * pitch, 0, 0), -8 * margin
    ways = (
        ((first, 1, 0), (first, 0, 1)),
        ((first, 0, 1), (8 * (size[0] - 1 - margin), -1, 0)),
        ((8 * (size[0] - 1 - margin), -1, 0), (8 * (size[1] - 1 - margin), 0, -1)),
        ((8 * (size[1] - 1 - margin), 0, -1), (first, 1, 0)),
    )
    return View(size, *ways[turns], unit)


TILTED = View((224, 184), (-50 * 8 * 940, 940, 342), (-9 * 8 * 940, -342, 940), (24 * 8 * 1000, 11, 17))


@cache
def levels() -> NDArray[np.int64]:
    """(24, 3) DN of the patches: BabelColor's table through three Gaussian curves; multiples of 4 above black."""
    curves = np.exp(-4 * np.log(2) * ((WAVELENGTHS[:, None] - np.array([600.0, 540.0, 455.0])) / 90) ** 2)
    signals = chart("babelcolor") @ (curves / curves.sum(axis=0)) * np.array([0.6, 1.0, 0.75])
    whole: NDArray[np.int64] = BLACK + 4 * np.rint(3000 * signals).astype(np.int64)
    return whole


def draw(view: View, cfa: bytes = bytes((0, 1, 1, 2)), *, unrest: int = 7, mirrored: bool = False) -> Samples:
    """The photo's samples, without any change."""
    width, height = view.size
    colour = np.tile(np.array(list(cfa)).reshape(2, 2), (height // 2 + 1, width // 2 + 1))[:height, :width]
    total = np.zeros((height, width), np.int64)
    table = levels()
    y, x = np.mgrid[0:height, 0:width].astype(np.int64)
    for down in (-3, -1, 1, 3):
        for across in (-3, -1, 1, 3):
            X, Y = 8 * x + across, 8 * y + down
            W = view.w[0] + view.w[1] * X + view.w[2] * Y
            U, V = (s[0] + s[1] * X + s[2] * Y for s in (view.u, view.v))
            i, j = (2 * U + W) // (2 * W), (2 * V + W) // (2 * W)  # the nearest patch
            inside = (abs(U - i * W) * SIDE[1] <= SIDE[0] * W) & (abs(V - j * W) * SIDE[1] <= SIDE[0] * W)
            known = (i >= 0) & (i < 6) & (j >= 0) & (j < 4)
            board = (W * -62 <= 100 * U) & (100 * U <= W * 562) & (W * -62 <= 100 * V) & (100 * V <= W * 362)
            column = 5 - i if mirrored else i
            patch = np.where(known, 6 * np.clip(j, 0, 3) + np.clip(column, 0, 5), 0)
            total += np.where(inside & known, table[patch, colour], np.where(board, GAP, TABLE))
    noise = (29 * x + 37 * y + x * y) % unrest - unrest // 2 if unrest else 0
    return (total // 16 + noise).astype(np.uint16)


def file(
    samples: Samples,
    *,
    cfa: bytes = bytes((0, 1, 1, 2)),
    tags: Tags | None = None,
    iso: int = 100,
    exposure: Sequence[int] = (1, 60),
) -> bytes:
    """The bytes of a DNG: 14 bits, lossless JPEG, black 256, white 15000."""
    more: Tags = {50714: (SHORT, [BLACK]), 50717: (LONG, [WHITE])}
    exif: Tags = {33434: (RATIONAL, list(exposure)), 34855: (SHORT, [iso])}
    width = samples.shape[1]
    jpeg = {"components": 2 if width % 2 == 0 else 1}
    return Dng(samples, cfa=cfa, bits=14, compression=JPEG, jpeg=jpeg, tags=more | (tags or {}), exif=exif).encode()


def rounded(points: Floats, places: int = 2) -> list[Any]:
    """Points as plain numbers."""
    found: list[Any] = (np.round(points, places) + 0.0).tolist()
    return found


@cache
def charts() -> dict[str, bytes]:
    """Photos of a chart alone, by their names in golden/dng."""
    gbrg = bytes((1, 2, 0, 1))
    return {
        **{f"chart-turned-{turns}.dng": file(draw(turned(24, turns))) for turns in range(4)},
        **{f"chart-large-{n}.dng": file(draw(turned(p, 1, p), unrest=0)) for n, p in ((2, 90), (3, 128))},
        "chart-tilted.dng": file(draw(TILTED, gbrg), cfa=gbrg),
        "chart-mirrored.dng": file(draw(turned(24, 0), mirrored=True)),
        "chart-small.dng": file(draw(turned(8, 0, margin=8))),
    }


def photo_case(name: str, comment: str, inputs: Json, photos: dict[str, bytes], expect: str = "success") -> Json:
    """A case with those of the photos that its inputs name."""
    named = [value for value in inputs.values() if isinstance(value, str) and value in photos]
    return case(name, comment, inputs, expect=expect, files={f"dng/{photo}": photos[photo] for photo in named})
