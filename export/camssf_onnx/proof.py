"""The relative duality gap as nodes: `camssf.curves.proof`."""

from __future__ import annotations

from camssf_onnx.graph import Value
from camssf_onnx.problem import Problem


def gap(problem: Problem, x: Value) -> Value:
    """Relative duality gap (3,) of `camssf.curves.proof`, from the residual itproblem."""
    g = problem.graph
    rest = problem.rest(x)
    w = problem.residual(x)
    quadratic = (rest * rest).sum(1, 2) + problem.l2 * (x * x).sum(1)
    l1 = problem.gamma * g.op("Abs", x).sum(1)
    objective = 0.5 * quadratic + l1
    worst = g.op("Where", problem.positive, w, g.op("Abs", w)).max(1)
    worst = g.op("Max", worst, 0.0)
    some = g.op("Greater", worst, 0.0)
    alpha = g.op("Where", some, g.op("Min", problem.gamma / g.op("Where", some, worst, 1.0), 1.0), 1.0)
    short = 1.0 - alpha
    with_l1 = 0.5 * short * short * quadratic + l1 - alpha * (x * w).sum(1)
    at_bound = g.op("And", g.op("Equal", x, 0.0), problem.positive)
    slope = g.op("Where", at_bound, g.op("Max", w, 0.0), w)
    l2 = g.op("Where", g.op("Greater", problem.l2, 0.0), problem.l2, 1.0)
    smooth = 0.5 * (slope * slope).sum(1) / l2
    gap = g.op("Max", g.op("Where", g.op("Equal", problem.gamma, 0.0), smooth, with_l1), 0.0)
    known = g.op("Greater", objective, 0.0)
    return g.op("Where", known, gap / g.op("Where", known, objective, 1.0), objective)
