"""Walks from the layers' solution to the exact optimum by pivoting, where the layers' duality gap is too large.

The walk starts from the support and signs of the layers' z, which solves the problem exactly for some other g₀ (see
`_start`). Along g(t) = g₀ + t (g - g₀), 0 ≤ t ≤ 1, the optimum is piecewise linear, and each kink is one pivot of a
complementary tableau (Lemke 1965, with bounds on both sides: w = g - M x must lie in [-γ, γ] and x may leave zero
only at such a bound). A good start needs few pivots; any start reaches the optimum, since M is positive semidefinite.

A start of more atoms than there are rows has pivots as small as RIDGE: the tableau then grows to 1 / RIDGE and keeps
few digits. Such a walk ends at the right support but with inaccurate values. If the gap is still too large, a new
walk therefore starts from that support alone.

All problems of a stack are walked at once, so that the same formulas are a model's nodes: what an index would pick is
picked by a product with a column of zeros and a one, and a problem that has arrived changes no more. Labels of the
tableau's variables: x_i is i, w_i is r + i, t is 2 r.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from camssf.recovery.arrays import Array, constant, eye, loop, loop_while, namespace, real
from camssf.recovery.duality_gap import duality_gap
from camssf.recovery.elastic_net import BIG, ElasticNet

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


def pivot_to_optimum(
    problem: ElasticNet, z: Array, gap: Array, steps: int | None = None
) -> tuple[Array, Array, Array]:
    """Walk from the layers' z to the optimum where their gap is above SETTLED, repeat until it is at most PROVEN.

    Args:
        problem: one or a stack of p.
        z: (..., r, 1).
        gap: (..., 1, 1) relative duality gap of z.
        steps: largest number of pivots of one walk; None for `finish_steps`.

    Returns:
        x, its gap and the number of pivots, with the shapes of z and gap.
    """
    xp = namespace(z)
    most = finish_steps(z.shape[-2]) if steps is None else steps
    wanted = xp.logical_not(gap <= SETTLED)

    def turn(state: Sequence[Array]) -> tuple[list[Array], Array]:
        z, best, least, pivots = state
        x, more = walk(problem, z, most)
        after = duality_gap(problem, x)[1]
        unproven = xp.logical_not(least <= PROVEN)
        better = unproven & (after < least)
        best, least = xp.where(better, x, best), xp.where(better, after, least)
        return [x, best, least, pivots + real(unproven) * more], xp.any(xp.logical_not(least <= PROVEN))

    least = xp.where(wanted, BIG, gap)  # any answer of a wanted walk is better than z
    _, x, least, pivots = loop_while(WALKS, [z, z, least, 0.0 * real(wanted)], turn, xp.any(wanted))
    return x, least, pivots


@dataclass(frozen=True)
class Walk:
    """A tableau between t = 0 and t = 1: rows are basic variables, columns nonbasic ones at a bound.

    One nonbasic variable, the driver, moves at a time. The first basic variable that reaches a bound trades places
    with it, and its complement (x_i for w_i, w_i for x_i) moves next. The driver leaves zero (x_i) or one bound (w_i)
    in its direction, and stops at the end of its range, if no other variable stops it before.

    Attributes:
        tableau: (..., r, r + 1) derivatives of the basic variables by the nonbasic ones.
        value, lower, upper: (..., r, 1) of the basic variables.
        rows: (..., r, 1) labels of the basic variables.
        columns: (..., 1, r + 1) labels of the nonbasic ones.
        driver, direction: (..., 1, 1) label, and 1 or -1.
        active: (..., 1, 1) 1 until t = 1.
        pivots: (..., 1, 1) number of pivots.
    """

    tableau: Array
    value: Array
    lower: Array
    upper: Array
    rows: Array
    columns: Array
    driver: Array
    direction: Array
    active: Array
    pivots: Array


@dataclass(frozen=True)
class DualBounds:
    """Bounds of the dual variables w, and unit scale.

    Attributes:
        low, high: (..., r, 1) -γ and γ, or no lower bound, of the scaled problem.
        free: whether x may leave zero everywhere: γ = 0 without x ≥ 0.
        scale: (..., r, 1) 1 / √M_ii.
    """

    low: Array
    high: Array
    free: Array
    scale: Array


def walk(problem: ElasticNet, z: Array, steps: int) -> tuple[Array, Array]:
    """One walk of at most `steps` pivots: x at its end, and the number of pivots."""
    xp = namespace(z)
    bounds, start = _start(problem, z)

    def step(state: Sequence[Array]) -> tuple[list[Array], Array]:
        after = _pivot(bounds, Walk(*state))
        return [getattr(after, field.name) for field in fields(Walk)], xp.any(after.active > 0.5)

    end = Walk(*loop_while(steps, [getattr(start, field.name) for field in fields(Walk)], step))
    return _settle(problem, bounds, end), end.pivots


def _start(problem: ElasticNet, z: Array) -> tuple[DualBounds, Walk]:
    """The tableau, scaled to unit diagonal (one tolerance fits all), at t = 0, where z solves the problem for g₀."""
    xp, r = namespace(z), z.shape[-2]
    one, order = eye(xp, r), constant(xp, np.arange(r, dtype=float)[:, None])
    diagonal = xp.sum(problem.M * one, axis=-1, keepdims=True)
    scale = 1.0 / xp.sqrt(xp.where(diagonal > 0.0, diagonal, 1.0))
    unit = problem.M * scale * scale.mT + RIDGE * one
    high = problem.gamma * scale
    low = xp.where(problem.nonnegative, -BIG, -high)
    free = xp.logical_not(problem.nonnegative) & (high[..., :1, :] == 0.0)
    wanted = real((z != 0.0) | free)

    def enter(step: Array, state: Sequence[Array]) -> list[Array]:
        """Atom number `step` enters the support if it is wanted and independent enough of those before."""
        X, inside = state
        e = real(constant(xp, np.arange(r)[:, None]) == step)  # (r, 1)
        column = X @ e
        pivot, want = xp.sum(column * e, axis=-2, keepdims=True), xp.sum(wanted * e, axis=-2, keepdims=True)
        deep = pivot > PIVOT_FLOOR
        share = xp.where(deep, want / xp.where(deep, pivot, 1.0), 0.0)
        u = column - e
        return [X - (share * u) @ u.mT, inside + real(share > 0.0) * e]

    X, inside = loop(r, [unit, 0.0 * wanted], enter)
    support = inside > 0.5
    tableau = X * (2.0 * inside - 1.0).mT - 2.0 * inside * one

    x0, up = xp.where(support, z / scale, 0.0), z >= 0.0
    w = problem.residual(x0 * scale) * scale
    # Off the support w₀ must lie strictly inside its bounds, each at another depth: ties can make a walk cycle.
    depths = constant(xp, 0.05 + 0.9 * ((np.arange(r)[:, None] * GOLDEN) % 1.0))
    inner = xp.where(xp.abs(w) > high, xp.sign(w) * high * depths, w)
    inner = xp.where(problem.nonnegative, w - (1.0 + depths) * xp.maximum(w - high, 0.0), inner)
    w0 = xp.where(support, xp.where(up, high, -high), inner)
    d = w - w0
    slope = xp.where(support, 0.0, d) - tableau @ xp.where(support, d, 0.0)
    zero, t = 0.0 * d, 2.0 * r + 0.0 * d[..., :1, :]
    columns = xp.where(support, order + r, order).mT
    start = Walk(
        tableau=xp.concat([tableau, slope], axis=-1),
        value=xp.where(support, x0, w0),
        lower=xp.where(support, xp.where(xp.logical_not(up) | free, -BIG, zero), low),
        upper=xp.where(support, xp.where(up | free, BIG, zero), high),
        rows=xp.where(support, order, order + r),
        columns=xp.concat([columns, t], axis=-1),
        driver=t,
        direction=0.0 * t + 1.0,
        active=0.0 * t + 1.0,
        pivots=0.0 * t,
    )
    return DualBounds(low, high, free, scale), start


def _pivot(bounds: DualBounds, walk: Walk) -> Walk:
    """Move the driver until it has crossed its range, or a basic variable reaches a bound and leaves the basis."""
    xp, r = namespace(walk.value), walk.value.shape[-2]
    start, floor, ceiling = _range(bounds, walk)
    direction, driver = walk.direction, walk.driver
    q = real(walk.columns == driver)  # (..., 1, r + 1), the driver's column
    column = walk.tableau @ q.mT
    rate = direction * column
    moves = xp.abs(rate) > PIVOT_FLOOR
    room = xp.where(rate > 0.0, walk.upper, walk.lower) - walk.value
    limit = xp.where(moves, xp.maximum(room / xp.where(moves, rate, 1.0), 0.0), BIG)
    nearest = xp.min(limit, axis=-2, keepdims=True)
    crosses, reach = ceiling - floor <= nearest, xp.minimum(nearest, ceiling - floor)
    going = (walk.active > 0.5) & (reach < BIG)  # unbounded only by rounding, as the problem is convex: a large gap
    length = xp.where(going, reach, 0.0)
    value = walk.value + length * rate
    trades = going & xp.logical_not(crosses)

    best = xp.argmax(xp.where(limit <= nearest, xp.abs(rate), -1.0), axis=-2, keepdims=True)
    p = real(best == constant(xp, np.arange(r)[:, None]))  # (..., r, 1), the leaving variable's row
    leaving, rate_p = xp.sum(walk.rows * p, axis=-2, keepdims=True), xp.sum(rate * p, axis=-2, keepdims=True)
    row = p.mT @ walk.tableau
    new = (column * (1.0 - p) + p) / xp.where(trades, direction * rate_p, 1.0)
    swapped = walk.tableau * (1.0 - p) * (1.0 - q) + new * (q - row * (1.0 - q))
    enters, leaves = (p > 0.5) & trades, (q > 0.5) & trades

    # The leaving variable's complement moves next; a w_i that has crossed its range lets x_i leave zero on that side.
    complement = leaving + xp.where(leaving < r, r + 0.0 * leaving, -r)
    arrived = going & (xp.where(trades, leaving, driver) == 2.0 * r)  # t = 1
    return Walk(
        tableau=xp.where(trades, swapped, walk.tableau),
        value=xp.where(enters, start + direction * length, value),
        lower=xp.where(enters, floor, walk.lower),
        upper=xp.where(enters, ceiling, walk.upper),
        rows=xp.where(enters, driver, walk.rows),
        columns=xp.where(leaves, leaving, walk.columns),
        driver=xp.where(trades, complement, driver - r),
        direction=xp.where(trades, xp.sign(rate_p), direction),
        active=real(going & xp.logical_not(arrived)),
        pivots=walk.pivots + walk.active,
    )


def _range(bounds: DualBounds, walk: Walk) -> tuple[Array, Array, Array]:
    """Start value of the driver, and its lower and upper bound from then on, (..., 1, 1) each."""
    xp, r = namespace(walk.value), walk.value.shape[-2]
    order = constant(xp, np.arange(r, dtype=float)[:, None])
    driver, up, free = walk.driver, walk.direction > 0.0, bounds.free
    is_x, is_t = driver < r, driver == 2.0 * r
    i = real(driver - xp.where(is_x, 0.0 * driver, r) == order)
    top, bottom = (xp.sum(bound * i, axis=-2, keepdims=True) for bound in (bounds.high, bounds.low))
    zero = 0.0 * driver
    floor = xp.where(is_x, xp.where(up & xp.logical_not(free), zero, -BIG), xp.where(is_t, zero, bottom))
    ceiling = xp.where(is_x, xp.where(up | free, BIG, zero), xp.where(is_t, 1.0, top))
    start = xp.where(is_x | is_t, zero, xp.where(up, bottom, top))
    return start, floor, ceiling


def _settle(problem: ElasticNet, bounds: DualBounds, walk: Walk) -> Array:
    """x at the end of the walk, refined by the residual of the rows."""
    xp, r, scale = namespace(walk.value), walk.value.shape[-2], bounds.scale
    order = constant(xp, np.arange(r, dtype=float)[:, None])
    to_x = real(walk.rows == order.mT).mT  # (..., r, r): a basic x_i from its row to place i
    of_w = real(walk.columns.mT == order.mT + r)  # (..., r + 1, r): a nonbasic w_i from its column to place i
    K = -(to_x @ walk.tableau @ of_w)  # M⁻¹ on the support, where the tableau holds ∂x / ∂w = -M⁻¹
    support = xp.sum(to_x, axis=-1, keepdims=True) > 0.5
    down = (to_x @ real(walk.upper <= 0.0)) > 0.5
    target = xp.where(down, -bounds.high, bounds.high)
    enough = EXACT * xp.max(bounds.high, axis=-2, keepdims=True)

    def refine(state: Sequence[Array]) -> tuple[list[Array], Array]:
        x, best, smallest = state
        error = xp.where(support, problem.residual(x) * scale - target, 0.0)
        size = xp.max(xp.abs(error), axis=-2, keepdims=True)
        more, better = (size <= 0.5 * smallest) | (size > enough), size < smallest
        # At the limit of the precision steps are random: keep the best.
        best, smallest = xp.where(better, x, best), xp.where(better, size, smallest)
        return [x + scale * (K @ error), best, smallest], xp.any(more)

    x = (to_x @ walk.value) * scale
    x = loop_while(REFINEMENTS, [x, x, BIG + 0.0 * enough], refine)[1]
    crossed = (xp.where(down, -x, x) < 0.0) & xp.logical_not(bounds.free)
    return xp.where(xp.logical_not(support) | crossed, 0.0, x)
