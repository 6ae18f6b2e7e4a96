"""Walks from the layers' solution to the exact optimum by pivoting, where the layers' duality gap is too large.

The walk starts from the support and signs of the layers' z, which solves the problem exactly for some other g₀ (see
`_start`). Along g(t) = g₀ + t (g - g₀), 0 ≤ t ≤ 1, the optimum is piecewise linear, and each kink is one pivot of a
complementary tableau (Lemke 1965, with bounds on both sides: w = g - M x must lie in [-γ, γ] and x may leave zero
only at such a bound). A good start needs few pivots; any start reaches the optimum, since M is positive semidefinite.

A start of more atoms than there are rows has pivots as small as RIDGE: the tableau then grows to 1 / RIDGE and keeps
few digits. Such a walk ends at the right support but with inaccurate values. If the gap is still too large, a new
walk therefore starts from that support alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.recovery.duality_gap import duality_gap
from camssf.recovery.elastic_net import ElasticNet

GOLDEN = 0.6180339887498949
PIVOT_FLOOR = 1e-12
"""Smallest pivot of a tableau of unit diagonal; atoms closer to linear dependence never share a support."""
REFINEMENTS, EXACT = 8, 1e-10
"""Largest number of refinement steps; error, as a share of γ, below which they stop once it no longer halves."""
SETTLED = 1e-12
"""Relative duality gap of the layers that needs no walk: the curve is exact to within 1e-7 of its peak."""
PROVEN, WALKS = 1e-9, 3
"""Relative duality gap that is small enough after a walk; largest number of walks, each from the last one's end."""
RIDGE = 1e-11
"""Added to the walk's unit diagonal to make linearly dependent atoms barely independent, whatever the rounding.
The refinement and the duality gap do not contain it."""


def finish_steps(atoms: int) -> int:
    """Largest number of pivots of one walk, far more than any start has needed."""
    return 8 * atoms + 16


def pivot_to_optimum(problem: ElasticNet, z: Floats, steps: int) -> tuple[Floats, int]:
    """Walk from the layers' z to the optimum, repeat until the gap is at most PROVEN; x and the number of pivots."""
    best, least, taken = z, np.inf, 0
    for turn in range(WALKS):
        walk = _start(problem, z)
        taken += walk.go(steps)
        z = _settle(problem, walk)
        gap = duality_gap(problem, z)[1]
        if turn == 0 or gap < least:
            best, least = z, gap
        if least <= PROVEN:
            break
    return best, taken


def _start(problem: ElasticNet, z: Floats) -> _Walk:
    """The tableau, scaled to unit diagonal (one tolerance fits all), at t = 0, where z solves the problem for g₀."""
    r = z.size
    diagonal = np.diag(problem.M)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    high = problem.gamma * scale
    low = np.full(r, -np.inf) if problem.nonnegative else -high
    free = problem.gamma == 0 and not problem.nonnegative

    tableau = -(problem.M * scale * scale[:, None] + RIDGE * np.eye(r))
    support = np.zeros(r, dtype=bool)
    for i in range(r) if free else map(int, np.flatnonzero(z)):
        if -tableau[i, i] > PIVOT_FLOOR:
            tableau = _exchange(tableau, i, i)
            support[i] = True
    x0 = np.where(support, z / scale, 0.0)
    up = z >= 0
    w = problem.residual(x0 * scale) * scale
    # Off the support w₀ must lie strictly inside its bounds, each at another depth: ties can make a walk cycle.
    depths = 0.05 + 0.9 * ((np.arange(r) * GOLDEN) % 1.0)
    if problem.nonnegative:
        strictly = w - (1.0 + depths) * np.maximum(w - high, 0.0)
    else:
        strictly = np.where(np.abs(w) > high, np.sign(w) * high * depths, w)
    w0 = np.where(support, np.where(up, high, -high), strictly)
    d = w - w0
    slope = np.where(support, 0.0, d) - tableau @ np.where(support, d, 0.0)
    count = np.arange(r)
    return _Walk(
        tableau=np.concatenate([tableau, slope[:, None]], axis=1),
        value=np.where(support, x0, w0),
        lower=np.where(support, np.where(up & (not free), 0.0, -np.inf), low),
        upper=np.where(support, np.where(up | free, np.inf, 0.0), high),
        rows=np.where(support, count, count + r),
        columns=np.append(np.where(support, count + r, count), 2 * r),
        low=low,
        high=high,
        free=free,
        scale=scale,
    )


def _settle(problem: ElasticNet, walk: _Walk) -> Floats:
    """x at the end of the walk, refined by the residual of the rows."""
    r = problem.g.size
    inside = walk.rows < r
    x, down = np.zeros(r), np.zeros(r, dtype=bool)
    x[walk.rows[inside]] = walk.value[inside]
    down[walk.rows[inside]] = walk.upper[inside] <= 0
    support = np.isin(np.arange(r), walk.rows[inside])
    inverse = np.zeros((2 * r + 1, 2 * r + 1))
    inverse[np.ix_(walk.rows, walk.columns)] = -walk.tableau
    K = inverse[:r, r : 2 * r]  # M⁻¹ on the support, where the tableau holds ∂x / ∂w = -M⁻¹
    x = x * walk.scale
    best, smallest = x, np.inf
    for _ in range(REFINEMENTS):
        error = problem.residual(x) * walk.scale - np.where(down, -walk.high, walk.high)
        error = np.where(support, error, 0.0)
        size = float(np.abs(error).max())
        settled = size <= EXACT * float(walk.high.max()) and size > 0.5 * smallest
        if size < smallest:  # at the limit of the precision steps are random: keep the best
            best, smallest = x, size
        if settled:
            break
        x = x + walk.scale * (K @ error)
    x = best
    crossed = (np.where(down, -x, x) < 0) & (not walk.free)
    return np.where(support & ~crossed, x, 0.0)


@dataclass
class _Walk:
    """A tableau between t = 0 and t = 1: rows are basic variables, columns nonbasic ones at a bound.

    Labels: x_i is i, w_i is r + i, t is 2 r. One nonbasic variable, the driver, moves at a time. The first basic
    variable that reaches a bound trades places with it, and its complement (x_i for w_i, w_i for x_i) moves next.
    """

    tableau: Floats
    value: Floats
    lower: Floats
    upper: Floats
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    low: Floats
    high: Floats
    free: bool
    scale: Floats

    def go(self, steps: int) -> int:
        """Take at most `steps` pivots and return their number."""
        r = self.value.size
        driver, direction = 2 * r, 1.0
        for taken in range(1, steps + 1):
            start, floor, ceiling = self._range(driver, direction)
            own = ceiling - floor
            q = int(np.flatnonzero(self.columns == driver)[0])
            rate = direction * self.tableau[:, q]
            moves = np.abs(rate) > PIVOT_FLOOR
            room = np.where(rate > 0, self.upper, self.lower) - self.value
            limit = np.where(moves, np.maximum(room / np.where(moves, rate, 1.0), 0.0), np.inf)
            nearest = float(limit.min())
            step = min(nearest, own)
            if not np.isfinite(step):
                return taken  # unbounded: only by rounding, as the problem is convex; the gap will be large
            self.value = self.value + step * rate
            if own <= nearest:
                if driver == 2 * r:
                    return taken  # t = 1
                driver -= r  # w_i crossed from one bound to the other: x_i leaves zero on that side
                continue
            p = int(np.argmax(np.where(limit <= nearest, np.abs(rate), -1.0)))
            leaving = int(self.rows[p])
            self.tableau = _exchange(self.tableau, p, q)
            self.rows[p], self.columns[q] = driver, leaving
            self.value[p], self.lower[p], self.upper[p] = start + direction * step, floor, ceiling
            if leaving == 2 * r:
                return taken  # t = 1
            driver = leaving + r if leaving < r else leaving - r
            direction = float(np.sign(rate[p]))
        return steps

    def _range(self, driver: int, direction: float) -> tuple[float, float, float]:
        """Start value of a driver, and its lower and upper bound from then on."""
        r = self.value.size
        if driver == 2 * r:
            return 0.0, 0.0, 1.0
        if driver >= r:
            floor, ceiling = float(self.low[driver - r]), float(self.high[driver - r])
            return (floor if direction > 0 else ceiling), floor, ceiling
        if self.free:
            return 0.0, -np.inf, np.inf
        return (0.0, 0.0, np.inf) if direction > 0 else (0.0, -np.inf, 0.0)


def _exchange(tableau: Floats, p: int, q: int) -> Floats:
    """Swap the basic variable of row p with the nonbasic one of column q."""
    pivot = tableau[p, q]
    row, column = tableau[p] / pivot, tableau[:, q] / pivot
    swapped = tableau - np.outer(tableau[:, q], row)
    swapped[p], swapped[:, q] = -row, column
    swapped[p, q] = 1.0 / pivot
    return swapped
