"""The relative duality gap as nodes: `camssf.recovery.duality_gap`."""

from __future__ import annotations

from camssf_onnx.algebra import BIG
from camssf_onnx.elastic_net import ElasticNet
from camssf_onnx.graph import Value


def duality_gap(problem: ElasticNet, x: Value) -> Value:
    """Relative duality gap (p,), from the residual: by the penalty's conjugate, or with λ₂ = 0 by scaling."""
    g, gamma = problem.graph, problem.gamma
    rest = problem.rest(x)
    pull = (problem.A.transpose(0, 2, 1) @ rest).squeeze(2)  # (p, r) g
    squares = (rest * rest).sum(1, 2)
    size = g.op("Abs", x)
    l1 = gamma * size.sum(1)
    objective = 0.5 * (squares + problem.l2 * (x * x).sum(1)) + l1

    some_l2 = g.op("Greater", problem.l2, 0.0)
    l2 = g.op("Where", some_l2, problem.l2, 1.0)
    low = g.op("Where", problem.positive, -BIG, -gamma)
    inside = g.op("Min", g.op("Max", pull, low), gamma)
    short = x - (pull - inside) / l2
    conjugate = (0.5 * l2 * (short * short) + (gamma * size - x * inside)).sum(1)

    worst = g.op("Max", g.op("Where", problem.positive, pull, g.op("Abs", pull)).max(1), 0.0)
    some = g.op("Greater", worst, 0.0)
    alpha = g.op("Where", some, g.op("Min", gamma / g.op("Where", some, worst, 1.0), 1.0), 1.0)
    rest_of_one = 1.0 - alpha
    scaled = 0.5 * rest_of_one * rest_of_one * squares + l1 - alpha * (x * pull).sum(1)

    found = g.op("Max", g.op("Where", some_l2, conjugate, scaled), 0.0)
    known = g.op("Greater", objective, 0.0)
    return g.op("Where", known, found / g.op("Where", known, objective, 1.0), objective)
