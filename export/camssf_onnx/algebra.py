"""Linear algebra and the grid's integrals as nodes: float64 operations that ONNX lacks, built from those it has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from onnx import TensorProto

from camssf.grid import STEP, WAVELENGTHS
from camssf.recovery.basis import NODES
from camssf_onnx.graph import Body, Graph, Value

BIG = 1e300
"""Stands for a missing bound, so that the graph has no infinities."""
PANEL = 6
"""Number of pivots that `whiten` eliminates in one step."""
D, I64, B = TensorProto.DOUBLE, TensorProto.INT64, TensorProto.BOOL
M = WAVELENGTHS.size


@dataclass(frozen=True)
class Root:
    """Σ = L Lᵀ by panels of pivots.

    Attributes:
        upper: (c, N', N') Lᵀ.
        blocks: (turns, c, panel, panel) L⁻¹ of each panel's own pivots.
        turns: number of panels.
    """

    upper: Value
    blocks: Value
    turns: Value

    def solve(self, columns: Value) -> Value:
        """L⁻ᵀ columns, (c, N', p) each: substitution from the last panel to the first."""
        g, panel = columns.graph, PANEL
        last = self.turns.here(g) - g.constant(1, np.int64)

        def substitute(body: Graph, step: Value, state: list[Value]) -> Body:
            (Z,) = state
            turn = last - step
            at = turn * body.constant(panel, np.int64) + body.constant(np.arange(panel), np.int64)
            found = self.blocks.here(body).take(turn, 0).transpose(0, 2, 1) @ Z.take(at, 1)
            return Body([Z - self.upper.here(body).take(at, 2) @ found], [found])

        _, left = g.loop(substitute, [columns], [D], self.turns, "solve")  # (turns, c, panel, p), the last one first
        back = g.op("Range", last, g.constant(-1, np.int64), g.constant(-1, np.int64))
        return left.take(back, 0).transpose(1, 0, 2, 3).like(g.op("Shape", columns))


def whiten(g: Graph, sigma: Value, columns: Value, panel: int = PANEL) -> tuple[Value, Value]:
    """L⁻¹ columns with Σ = L Lᵀ, and ln det Σ: (c, N, N) and (c, N, p) give (c, N', p) and (c,).

    Works by panels of pivots, from the first to the last: what the rows found so far explain is subtracted from the
    panel's rows of (Σ | columns), and the inverse of the panel's small Cholesky factor turns the rest into rows of
    L⁻¹ (Σ | columns). N is padded to whole panels, Σ by the identity and columns by zeros.
    """
    found, log_det, _ = _whiten(g, sigma, columns, panel, rooted=False)
    return found, log_det


def whiten_and_root(g: Graph, sigma: Value, columns: Value) -> tuple[Value, Value, Root]:
    """`whiten`, and the root L."""
    found, log_det, root = _whiten(g, sigma, columns, PANEL, rooted=True)
    assert root is not None
    return found, log_det, root


def _whiten(g: Graph, sigma: Value, columns: Value, panel: int, *, rooted: bool) -> tuple[Value, Value, Root | None]:
    N = size_of(g, sigma, 1)
    whole = g.constant(panel, np.int64)
    turns = g.op("Div", N + g.constant(panel - 1, np.int64), whole)
    size = turns * whole
    fill = (size - N).unsqueeze(0)
    none = g.ints(0)
    order = g.op("Range", g.constant(0, np.int64), size, g.constant(1, np.int64))
    new = g.op("Not", g.op("Less", order, N)).real()
    sigma = g.op("Pad", sigma, g.op("Concat", g.ints(0, 0, 0, 0), fill, fill, axis=0)) + new * same(g, order)
    columns = g.op("Pad", columns, g.op("Concat", g.ints(0, 0, 0, 0), fill, none, axis=0))
    given = g.op("Concat", sigma, columns, axis=2)
    steps = np.arange(panel)

    def eliminate(body: Graph, step: Value, state: list[Value]) -> Body:
        (before,) = state  # a row of zeros, then those found so far
        at = step * whole.here(body) + body.constant(steps, np.int64)
        rows = given.here(body).take(at, 1) - before.take(at, 2).transpose(0, 2, 1) @ before  # (c, panel, N' + p)
        root, pivots = _root(rows.take(at, 2), panel)
        after = body.op("Concat", before, root @ rows, axis=1)
        return Body([after], [pivots, root] if rooted else [pivots])

    found, pivots, *blocks = g.loop(eliminate, [given.slice(0, 1, 1) * 0.0], [D], turns, "whiten")
    log_det = g.op("Log", pivots).sum(0, 2, 3)
    size = size.unsqueeze(0)
    kept = g.op("Slice", found, g.op("Concat", g.ints(1), size, axis=0), g.ints(2**31, 2**31), g.ints(1, 2))
    if not rooted:
        return kept, log_det, None
    upper = g.op("Slice", found, g.ints(1, 0), g.op("Concat", g.ints(2**31), size, axis=0), g.ints(1, 2))
    return kept, log_det, Root(upper, blocks[0], turns)


def _root(matrix: Value, size: int) -> tuple[Value, Value]:
    """L⁻¹ of small L Lᵀ (c, s, s), and its pivots (c, s, 1)."""
    left, pivots = [], []
    g = matrix.graph
    rest = g.op("Concat", matrix, matrix * 0.0 + np.eye(size), axis=2)
    for j in range(size):
        row = rest
        if j + 1 < size:
            row, rest = g.ops("Split", rest, g.ints(1, size - 1 - j), outputs=2, axis=1)  # (c, 1, 2 s)
        pivot = row.slice(j, j + 1, 2)
        left.append(row)
        pivots.append(pivot)
        if j + 1 < size:
            rest = rest - rest.slice(j, j + 1, 2) / pivot * row
    every = g.op("Concat", *pivots, axis=1)
    return g.op("Concat", *left, axis=1).slice(size, 2 * size, 2) / g.op("Sqrt", every), every


def inverse(g: Graph, matrix: Value, size: int) -> tuple[Value, Value]:
    """Inverse of symmetric positive definite matrices (c, r, r), L⁻ᵀ L⁻¹, and ln of their determinants (c,)."""
    root, log_det = whiten(g, matrix, matrix * 0.0 + np.eye(size))
    return root.transpose(0, 2, 1) @ root, log_det


def stride_of(count: int) -> int:
    """Number of steps in one turn of a Loop: a turn itself costs as much as a few nodes."""
    return next(stride for stride in (4, 3, 2, 1) if count % stride == 0)


def turns(body: Graph, step: Value, count: int, stride: int) -> list[Value]:
    """The indices (1,) that one turn of a Loop over `count` steps takes."""
    order = np.arange(count).reshape(-1, stride)
    return [body.op("Gather", body.constant(order[:, i : i + 1], np.int64), step, axis=0) for i in range(stride)]


def fold(g: Graph, f: Value) -> Value:
    """Fold values on the grid (..., 681) onto the nodes (..., 69), the adjoint of `unfold`: Σ f s = Σ f_nodes s."""
    share = np.arange(10) / 10.0
    shape = g.op("Shape", f)
    lead = shape.slice(0, -1, 0)
    head = f.slice(0, M - 1, -1).like(g.op("Concat", lead, g.ints(NODES.size - 1, 10), axis=0))
    parts = head @ np.stack([1.0 - share, share], axis=1)  # (..., 68, 2)
    zero = f.slice(0, 1, -1) * 0.0
    left = g.op("Concat", parts.slice(0, 1, -1).squeeze(-1), f.slice(M - 1, M, -1), axis=-1)
    return left + g.op("Concat", zero, parts.slice(1, 2, -1).squeeze(-1), axis=-1)


def slope(g: Graph, f: Value) -> Value:
    """d f / dλ on the grid, (..., 681): central differences, one-sided at the ends."""
    steps = (f.slice(1, M, -1) - f.slice(0, M - 1, -1)) / STEP
    inner = 0.5 * (steps.slice(0, M - 2, -1) + steps.slice(1, M - 1, -1))
    return g.op("Concat", steps.slice(0, 1, -1), inner, steps.slice(M - 2, M - 1, -1), axis=-1)


def unfold(g: Graph, s: Value) -> Value:
    """Interpolate curves linearly from the nodes (c, 69) to the grid (c, 681)."""
    share = np.arange(10) / 10.0
    v = NODES.size
    between = s.slice(0, v - 1, 1).unsqueeze(2) * (1.0 - share) + s.slice(1, v, 1).unsqueeze(2) * share
    return g.op("Concat", between.reshape(-1, M - 1), s.slice(v - 1, v, 1), axis=1)


def identity(g: Graph, size: Value) -> Value:
    """The identity of a size known at run time, (N, N)."""
    order = g.op("Range", g.constant(0, np.int64), size, g.constant(1, np.int64))
    return same(g, order)


def same(g: Graph, labels: Value) -> Value:
    """1 where two labels (N,) agree, else 0: (N, N)."""
    return g.op("Equal", labels.unsqueeze(1), labels.unsqueeze(0)).real()


def outer(factors: Value) -> Value:
    """Factors (c, N, p) times their transpose, (c, N, N)."""
    return factors @ factors.transpose(0, 2, 1)


def sum_of_squares(factors: Value) -> Value:
    """Diagonal of `outer`, (c, N, 1)."""
    return (factors * factors).sum(2, keep=True)


def size_of(g: Graph, value: Value, axis: int) -> Value:
    """The size of one dimension, a scalar."""
    return g.op("Shape", value).slice(axis, axis + 1, 0).squeeze(0)
