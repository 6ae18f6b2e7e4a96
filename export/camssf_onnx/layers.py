"""The unrolled layers as nodes: `camssf.curves.layers`, `splitting`."""

from __future__ import annotations

import numpy as np

from camssf.curves.layers import RELAXATION
from camssf_onnx.algebra import D, stride_of
from camssf_onnx.graph import Body, Graph, Value


def unroll(g: Graph, W: Value, pulled: Value, rho: Value, gamma: Value, low: Value, r: int, depth: int) -> Value:
    """The unrolled layers: v ← W₁ b + W_v v + W_q clip(v), the step of `splitting` with soft(v) = v - clip(v)."""
    high, low = gamma / rho, low / rho
    W2 = RELAXATION * (rho * W)
    eye = np.eye(r)
    both = g.op("Concat", W2 + (1.0 - RELAXATION) * eye, RELAXATION * eye - 2.0 * W2, axis=2)
    push = RELAXATION * pulled  # (3, r, 1)

    def clip(graph: Graph, v: Value) -> Value:
        return graph.op("Min", graph.op("Max", v, low), high)

    def layer(body: Graph, step: Value, state: list[Value]) -> Body:
        (v,) = state
        for _ in range(stride):
            pair = body.op("Concat", v, clip(body, v), axis=1)
            v = body.op("Add", push, body.op("MatMul", both, pair))
        return Body([v])

    stride = stride_of(depth)
    start = g.constant(np.zeros((3, r, 1)))
    (v,) = g.loop(layer, [start], [D], g.constant(depth // stride, np.int64), "layers")
    return (v - clip(g, v)).squeeze(2)
