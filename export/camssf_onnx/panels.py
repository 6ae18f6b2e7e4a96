"""Cholesky's decomposition and substitution, which ONNX lacks, as loops over panels of rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from camssf_onnx.sizes import Dim, Size
    from camssf_onnx.tracer import Array, Tracer

PANEL = 6
"""Number of rows that are eliminated in one step."""


def whiten(xp: Tracer, sigma: Array, columns: Array, panel: int) -> tuple[Array, Array, Callable[[], Array]]:
    """L⁻¹ columns and ln det Σ with Σ = L Lᵀ, and a function for Σ⁻¹ columns: (..., N, N) and (..., N, p).

    Works from the first panel to the last: what the rows found so far explain is subtracted from the panel's rows of
    (Σ | columns), and the inverse of the panel's own small Cholesky factor turns the rest into rows of
    L⁻¹ (Σ | columns). N is padded to whole panels, Σ by the identity and columns by zeros.
    """
    *lead, N, p = columns.shape
    c = prod(lead)
    turns, size = _panels(xp, N, panel)
    sigma, columns = (xp.reshape(x, (c, *x.shape[-2:])) for x in (sigma, columns))
    new = xp.arange(size) >= xp.node("Identity", (1,), xp.size(N), dtype="int64")
    padded = _pad(xp, sigma, (c, size, size)) + xp.astype(new, xp.float64) * xp.eye(size)
    given = xp.concat([padded, _pad(xp, columns, (c, size, p))], axis=2)
    before = given[:, :1] * 0.0
    before.shape = (c, xp.symbol(), *before.shape[2:])  # a row of zeros, then those found so far

    def eliminate(step: Array, state: Sequence[Array]) -> tuple[list[Array], list[Array], None]:
        (before,) = state
        at = step * panel + np.arange(panel)
        rows = _take(xp, given, at, 1) - _take(xp, before, at, 2).mT @ before  # (c, panel, size + p)
        root, pivots = _root(xp, _take(xp, rows, at, 2), panel)
        return [xp.concat([before, root @ rows], axis=1)], [pivots, root], None

    found, pivots, roots = xp.repeat(turns, [before], eliminate)
    found.shape = (c, size + 1, *found.shape[2:])
    log_det = xp.sum(xp.log(pivots), axis=(0, 2, 3))
    white = xp.reshape(found[:, 1 : N + 1, size:], (*lead, N, p))

    def solve() -> Array:
        """L⁻ᵀ L⁻¹ columns: substitution from the last panel to the first."""
        upper, last = found[:, 1:, :size], xp.node("Sub", (), turns, xp.graph.constant(1, "int64"), dtype="int64")

        def substitute(step: Array, state: Sequence[Array]) -> tuple[list[Array], list[Array], None]:
            (rest,) = state
            turn = last - step
            at = turn * panel + np.arange(panel)
            rows = _take(xp, roots, turn, 0).mT @ _take(xp, rest, at, 1)
            return [rest - _take(xp, upper, at, 2) @ rows], [rows], None

        _, stacked = xp.repeat(turns, [found[:, 1:, size:]], substitute)  # (turns, c, panel, p), the last one first
        back = xp.node("Range", stacked.shape[:1], last.name, *(xp.graph.constant(-1, "int64"),) * 2, dtype="int64")
        ordered = xp.permute_dims(_take(xp, stacked, back, 0), (1, 0, 2, 3))
        whole = xp.node("Reshape", (c, size, p), ordered.name, xp.vector((c, size, p)))
        return xp.reshape(whole[:, :N], (*lead, N, p))

    return white, xp.reshape(log_det, tuple(lead)), solve


def _panels(xp: Tracer, N: Size, panel: int) -> tuple[str, Dim]:
    """Number of panels, and N padded to whole ones."""
    graph = xp.graph.outermost
    wide, more = graph.constant([panel], "int64"), graph.constant([panel - 1], "int64")
    turns = graph.add("Div", [graph.add("Add", [xp.size(N), more])[0], wide])[0]
    return graph.add("Squeeze", [turns])[0], xp.symbol(graph.add("Mul", [turns, wide])[0])


def _pad(xp: Tracer, x: Array, shape: Sequence[Size]) -> Array:
    """Zeros at the ends of the axes."""
    fill = [target - size for size, target in zip(x.shape, shape, strict=True)]
    return xp.node("Pad", shape, x.name, xp.vector([0, 0, 0, *fill]))


def _take(xp: Tracer, x: Array, at: Array, axis: int) -> Array:
    """Places `at` of an axis."""
    return xp.node("Gather", (*x.shape[:axis], *at.shape, *x.shape[axis + 1 :]), x.name, at.name, axis=axis)


def _root(xp: Tracer, matrix: Array, size: int) -> tuple[Array, Array]:
    """L⁻¹ of small L Lᵀ (c, s, s), and its pivots (c, s, 1), by Gauss' elimination of (L Lᵀ | I)."""
    reduced, pivots = [], []
    rest = xp.concat([matrix, matrix * 0.0 + np.eye(size)], axis=2)
    for j in range(size):
        row = rest
        if j + 1 < size:
            parts = xp.graph.constant([1, size - 1 - j], "int64")
            names = xp.graph.add("Split", [rest.name, parts], 2, axis=1)
            row, rest = (
                type(rest)(xp, name, (rest.shape[0], rows, 2 * size))
                for name, rows in zip(names, (1, size - 1 - j), strict=True)
            )
        pivot = row[:, :, j : j + 1]
        reduced.append(row)
        pivots.append(pivot)
        if j + 1 < size:
            rest = rest - rest[:, :, j : j + 1] / pivot * row
    every = xp.concat(pivots, axis=1)
    return xp.concat(reduced, axis=1)[:, :, size:] / xp.sqrt(every), every
