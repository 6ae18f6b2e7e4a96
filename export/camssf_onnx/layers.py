"""The unrolled layers as nodes: `camssf.recovery.layers`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camssf.recovery.layers import RELAXATION, settling
from camssf_onnx.algebra import BIG, D, stride_of
from camssf_onnx.elastic_net import ElasticNet
from camssf_onnx.graph import Body, Graph, Value

SQUARINGS = 12
"""Number of times that M is squared to find its norm."""


@dataclass(frozen=True)
class Layer:
    """v ← W₁ b + W₂ soft(v, θ) + W₃ v: W1b (p, r, 1), W2, W3 (p, r, r), θ a number; `exact` as in the reference."""

    W1b: Value
    W2: Value
    W3: Value
    theta: Value
    exact: Callable[[Value, Value], Value] | None = None


def splitting_weight(problem: ElasticNet) -> Value:
    """ρ of the inverse (H + ρ I)⁻¹ in `splitting`."""
    return problem.gamma + 2.0 * problem.l2


def splitting(problem: ElasticNet, W: Value) -> Layer:
    """The default layer; W = (H + ρ I)⁻¹."""
    rho = splitting_weight(problem)
    one = np.eye(problem.r)
    u = W @ problem.g
    Wg = u + W @ (problem.pull(u.squeeze(2)) - rho * u)
    share = rho / (rho + problem.l2)
    step = RELAXATION * share

    def exact(v: Value, x: Value) -> Value:
        return v + step * (W @ (problem.pull(x.squeeze(2)) + rho * (x - v / share)))

    rho_W = rho * W
    theta = problem.gamma / (rho + problem.l2)
    return Layer(step * Wg, step * (2.0 * rho_W - one), one - RELAXATION * rho_W, theta, exact)


def ista(problem: ElasticNet) -> Layer:
    """Iterative soft thresholding with the step 1 / ‖M‖, the norm by power iteration and Rayleigh's quotient."""
    power = problem.M
    for _ in range(SQUARINGS):
        power = power / power.max(1, 2, keep=True)
        power = power @ power
    v = power @ np.ones((problem.r, 1))
    norm = (v * (problem.M @ v)).sum(1, keep=True) / (v * v).sum(1, keep=True)  # (p, 1, 1)
    theta = problem.gamma / norm
    return Layer(problem.g / norm, np.eye(problem.r) - problem.M / norm, problem.M * 0.0, theta)


def unroll(problem: ElasticNet, layer: Layer, depth: int) -> Value:
    """x (p, r) after `depth` layers, from v = 0: with soft(v) = v - clip(v), v ← W₁ b + (W₂ + W₃) v - W₂ clip(v)."""
    g, r = problem.graph, problem.r
    high = layer.theta
    low = g.op("Where", problem.positive, -BIG, -high)
    both = g.op("Concat", layer.W2 + layer.W3, -layer.W2, axis=2)

    def clip(graph: Graph, v: Value) -> Value:
        return graph.op("Min", graph.op("Max", v, low), high)

    def turn(body: Graph, step: Value, state: list[Value]) -> Body:
        (v,) = state
        for _ in range(stride):
            pair = body.op("Concat", v, clip(body, v), axis=1)
            v = body.op("Add", layer.W1b, body.op("MatMul", both, pair))
        return Body([v])

    def settle(body: Graph, step: Value, state: list[Value]) -> Body:
        (v,) = state
        assert layer.exact is not None
        return Body([layer.exact(v, v - clip(body, v))])

    last = 0 if layer.exact is None else settling(depth)
    stride = stride_of(depth - last)
    v = g.constant(np.zeros((problem.count, r, 1)))
    if depth > last:
        (v,) = g.loop(turn, [v], [D], g.constant((depth - last) // stride, np.int64), "layers")
    if last:
        (v,) = g.loop(settle, [v], [D], g.constant(last, np.int64), "settle")
    return (v - clip(g, v)).squeeze(2)
