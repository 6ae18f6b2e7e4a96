"""Linear algebra and the grid's integrals, as nodes: what ONNX lacks in float64, written over what it has."""

from __future__ import annotations

import numpy as np
from onnx import TensorProto

from camssf.curves.basis import NODES
from camssf.grid import STEP, WAVELENGTHS
from camssf_onnx.graph import Body, Graph, Value

BIG = 1e300
"""A bound that does not exist: no infinities."""
D, I64, B = TensorProto.DOUBLE, TensorProto.INT64, TensorProto.BOOL
M = WAVELENGTHS.size


def whiten(g: Graph, sigma: Value, columns: Value) -> Value:
    """L⁻¹ columns (c, N, p) with Σ = L Lᵀ: the pivot rows of (Σ | columns), each over its pivot's root."""

    def eliminate(body: Graph, step: Value, state: list[Value]) -> Body:
        (Z,) = state
        at = step.unsqueeze(0)
        row, column = Z.take(at, 1), Z.take(at, 2)
        pivot = column.take(at, 1)
        return Body([Z - (column / pivot) * row], [row / body.op("Sqrt", pivot)])

    N = size_of(g, columns, 1)
    _, left = g.loop(eliminate, [g.op("Concat", sigma, columns, axis=2)], [D], N, "whiten")  # (N, c, 1, N + p)
    rows = left.squeeze(2).transpose(1, 0, 2)
    return g.op("Slice", rows, N.unsqueeze(0), g.ints(2**31), g.ints(2))


def inverse(g: Graph, matrix: Value, size: int) -> Value:
    """Inverse of symmetric positive definite matrices (c, r, r): unit diagonal, then r symmetric sweeps."""
    eye = np.eye(size)
    scale = 1.0 / g.op("Sqrt", (matrix * eye).sum(2))  # (c, r)
    unit = matrix * scale.unsqueeze(1) * scale.unsqueeze(2)
    identity, stride = g.constant(eye), stride_of(size)

    def sweep(body: Graph, step: Value, state: list[Value]) -> Body:
        (X,) = state
        for at in turns(body, step, size, stride):
            column = X.take(at, 2)
            u = column - identity.here(body).take(at, 1)
            X = X - (u / column.take(at, 1)) * u.transpose(0, 2, 1)
        return Body([X])

    (X,) = g.loop(sweep, [unit], [D], g.constant(size // stride, np.int64), "weigh")
    return (2.0 * eye - X) * scale.unsqueeze(1) * scale.unsqueeze(2)  # a sweep leaves 2 - 1 / p on its diagonal


def stride_of(count: int) -> int:
    """Steps that share one turn of a Loop, whose own cost is that of a few nodes."""
    return next(stride for stride in (4, 3, 2, 1) if count % stride == 0)


def turns(body: Graph, step: Value, count: int, stride: int) -> list[Value]:
    """The indices (1,) that a turn of a Loop over `count` takes."""
    order = np.arange(count).reshape(-1, stride)
    return [body.op("Gather", body.constant(order[:, i : i + 1], np.int64), step, axis=0) for i in range(stride)]


def fold(g: Graph, f: Value) -> Value:
    """Values on the grid (..., 681) to the 5-nm nodes (..., 69), the adjoint of `unfold`: Σ f s = Σ f_nodes s."""
    share = np.arange(10) / 10.0
    shape = g.op("Shape", f)
    lead = shape.slice(0, -1, 0)
    head = f.slice(0, M - 1, -1).like(g.op("Concat", lead, g.ints(NODES.size - 1, 10), axis=0))
    parts = head @ np.stack([1.0 - share, share], axis=1)  # (..., 68, 2)
    zero = f.slice(0, 1, -1) * 0.0
    left = g.op("Concat", parts.slice(0, 1, -1).squeeze(-1), f.slice(M - 1, M, -1), axis=-1)
    return left + g.op("Concat", zero, parts.slice(1, 2, -1).squeeze(-1), axis=-1)


def slope(g: Graph, f: Value) -> Value:
    """d f / dλ on the grid, (n, 681): central differences, one-sided at the ends."""
    steps = (f.slice(1, M, 1) - f.slice(0, M - 1, 1)) / STEP
    inner = 0.5 * (steps.slice(0, M - 2, 1) + steps.slice(1, M - 1, 1))
    return g.op("Concat", steps.slice(0, 1, 1), inner, steps.slice(M - 2, M - 1, 1), axis=1)


def unfold(g: Graph, s: Value) -> Value:
    """Curves on the nodes (c, 69), straight between them, on the grid (c, 681)."""
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
    """Factors (c, N, p) → factors times their transpose, (c, N, N)."""
    return factors @ factors.transpose(0, 2, 1)


def size_of(g: Graph, value: Value, axis: int) -> Value:
    """A dimension, as a number."""
    return g.op("Shape", value).slice(axis, axis + 1, 0).squeeze(0)
