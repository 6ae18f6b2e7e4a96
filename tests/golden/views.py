"""Where the charts lie in the photos of golden/dng.

The photos are stored inputs. They were drawn with integer arithmetic: each pixel is the mean of 4 × 4 points, patches
of BabelColor's table are uniform, gaps and surround dark, and a formula of the position replaces noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats


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
