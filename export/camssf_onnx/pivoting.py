"""The pivoting walk as nodes: `camssf.recovery.pivoting`. A problem at its optimum no longer changes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from camssf.recovery.pivoting import (
    EXACT,
    GOLDEN,
    PIVOT_FLOOR,
    PROVEN,
    REFINEMENTS,
    RIDGE,
    SETTLED,
    WALKS,
    finish_steps,
)
from camssf_onnx.algebra import BIG, B, D, stride_of, turns
from camssf_onnx.duality_gap import duality_gap as gap_of
from camssf_onnx.elastic_net import ElasticNet
from camssf_onnx.graph import Body, Graph, Value, within


def pivot_to_optimum(problem: ElasticNet, z: Value, before: Value) -> tuple[Value, Value, Value]:
    """Walk from the layers' z, whose gap is `before`, to the optimum; repeat until the gap is at most PROVEN.

    Returns x (p, r), its gap (p,) and the pivots (p,). A problem whose `before` is at most SETTLED keeps z; if that
    holds for all, no walk is taken.
    """
    g = problem.graph
    unproven = g.op("Not", g.op("LessOrEqual", before.unsqueeze(1), SETTLED))  # (p, 1)

    def walk(body: Graph, step: Value, state: list[Value]) -> Body:
        z, best, least, taken = state
        here = within(problem, body)
        x, pivots = _pivot_steps(here, z)
        gap = gap_of(here, x).unsqueeze(1)
        first = body.op("Equal", step, body.constant(0, np.int64))
        later = body.op("Not", body.op("LessOrEqual", least, PROVEN))
        open_ = body.op(
            "Or", body.op("And", first, unproven.here(body)), body.op("And", body.op("Not", first), later)
        )
        better = body.op("And", open_, body.op("Or", body.op("Less", gap, least), first))
        best, least = body.op("Where", better, x, best), body.op("Where", better, gap, least)
        taken = taken + open_.real() * pivots
        going = body.op("Not", body.op("LessOrEqual", least, PROVEN)).real()
        return Body([x, best, least, taken], go=body.op("Greater", going.max(0, 1), 0.5))

    start = [z, z, before.unsqueeze(1), g.constant(np.zeros((problem.count, 1)))]
    any_ = g.op("Greater", unproven.real().max(0, 1), 0.5)
    trips = g.constant(WALKS, np.int64)
    _, x, gap, taken = g.loop(walk, start, [D] * 4, trips, "finish", begin=any_)
    return x, gap.squeeze(1), taken.squeeze(1)


def _pivot_steps(problem: ElasticNet, z: Value) -> tuple[Value, Value]:
    """One walk from z (`_start`, `_Walk` and `_settle` of the reference): its end, and its pivots (p, 1)."""
    g, r, p = problem.graph, problem.r, problem.count
    diagonal = (problem.M * np.eye(r)).sum(2)
    scale = 1.0 / g.op("Sqrt", g.op("Where", g.op("Greater", diagonal, 0.0), diagonal, 1.0))  # (p, r)
    unit = problem.M * scale.unsqueeze(1) * scale.unsqueeze(2) + RIDGE * np.eye(r)
    high = problem.gamma * scale
    low = g.op("Where", problem.positive, -BIG, -high)
    wanted = g.op("Or", g.op("Not", g.op("Equal", z, 0.0)), problem.free).real().unsqueeze(2)  # (p, r, 1)

    stride, eye = stride_of(r), g.constant(np.eye(r))

    def enter(body: Graph, step: Value, state: list[Value]) -> Body:
        (X,) = state
        entered = []
        for at in turns(body, step, r, stride):
            column = X.take(at, 2)
            pivot = column.take(at, 1)
            deep = body.op("Greater", pivot, PIVOT_FLOOR)
            share = body.op("Where", deep, wanted.here(body).take(at, 1) / pivot, 0.0)
            u = column - eye.here(body).take(at, 1)
            X = X - (share * u) * u.transpose(0, 2, 1)
            entered.append(body.op("Greater", share, 0.0).real())
        return Body([X], [body.op("Concat", *entered, axis=1)])

    X, entered = g.loop(enter, [unit], [D], g.constant(r // stride, np.int64), "enter")
    inside = entered.transpose(1, 0, 2, 3).reshape(p, r)
    support = g.op("Greater", inside, 0.5)
    # A sweep with pivot π leaves 2 - 1 / π on the diagonal; the tableau needs -M⁻¹ on the support, signs by column.
    table = X * (2.0 * inside - 1.0).unsqueeze(1) - 2.0 * inside.unsqueeze(2) * np.eye(r)

    x0 = g.op("Where", support, z / scale, 0.0)
    up = g.op("Not", g.op("Less", z, 0.0))
    w = problem.residual(x0 * scale) * scale
    depths = 0.05 + 0.9 * ((np.arange(r) * GOLDEN) % 1.0)
    over = g.op("Max", w - high, 0.0)
    outside = g.op("Greater", g.op("Abs", w), high)
    inner = g.op("Where", outside, g.op("Sign", w) * high * depths, w)
    strictly = g.op("Where", problem.positive, w - (1.0 + depths) * over, inner)
    w0 = g.op("Where", support, g.op("Where", up, high, -high), strictly)
    d = w - w0
    aside = g.op("Where", support, 0.0, d)
    last = aside - (table @ g.op("Where", support, d, 0.0).unsqueeze(2)).squeeze(2)
    table = g.op("Concat", table, last.unsqueeze(2), axis=2)  # (p, r, r + 1)
    value = g.op("Where", support, x0, w0)

    count = np.arange(r, dtype=float)
    x_low = g.op("Where", g.op("Or", g.op("Not", up), problem.free), -BIG, 0.0)
    x_high = g.op("Where", g.op("Or", up, problem.free), BIG, 0.0)
    lower, upper = g.op("Where", support, x_low, low), g.op("Where", support, x_high, high)
    row_labels = g.op("Where", support, count, count + r)
    column_labels = g.op(
        "Concat", g.op("Where", support, count + r, count), np.full((p, 1), 2.0 * r), axis=1
    )  # fmt: skip
    ones = np.ones((p, 1))
    state = [
        table, value, lower, upper, row_labels, column_labels,
        g.constant(2.0 * r * ones), g.constant(ones), g.constant(0.0 * ones), g.constant(ones),
        g.constant(0.0 * ones), g.constant(ones), g.constant(np.ones((p, 1), bool), np.bool_),
        g.constant(0.0 * ones),
    ]  # fmt: skip
    kinds = [D] * 12 + [B, D]
    state = g.loop(_pivot(problem, low, high), state, kinds, g.constant(finish_steps(r), np.int64), "walk")
    table, value, lower, upper, row_labels, column_labels = state[:6]
    taken = state[-1]

    rows = g.op("Equal", row_labels.unsqueeze(2), count).real()  # (p, r rows, r variables): x_i basic in that row
    columns = g.op("Equal", column_labels.unsqueeze(2), count + r).real()  # (p, r + 1, r): w_i nonbasic
    to_x = rows.transpose(0, 2, 1)
    x = (to_x @ value.unsqueeze(2)).squeeze(2)
    K = -(to_x @ table @ columns)
    support = g.op("Greater", rows.sum(1), 0.5)
    down = g.op("LessOrEqual", upper, 0.0).real().unsqueeze(2)
    down = g.op("Greater", (to_x @ down).squeeze(2), 0.5)
    target = g.op("Where", down, -high, high)
    x = x * scale
    enough = EXACT * high.max(1, keep=True)  # (p, 1)

    def refine(body: Graph, step: Value, state: list[Value]) -> Body:
        x, best, smallest = state
        error = body.op("Where", support, within(problem, body).residual(x) * scale - target, 0.0)
        size = body.op("Abs", error).max(1, keep=True)
        halves = body.op("LessOrEqual", size, 0.5 * smallest)
        more = body.op("Or", halves, body.op("Greater", size, enough)).real()
        better = body.op("Less", size, smallest)
        best, smallest = body.op("Where", better, x, best), body.op("Where", better, size, smallest)
        x = x + scale * (K @ error.unsqueeze(2)).squeeze(2)
        return Body([x, best, smallest], go=body.op("Greater", more.max(0, 1), 0.5))

    start = [x, x, g.constant(np.full((p, 1), BIG))]
    x = g.loop(refine, start, [D] * 3, g.constant(REFINEMENTS, np.int64), "refine")[1]
    crossed = g.op("Less", g.op("Where", down, -x, x), 0.0)
    crossed = g.op("And", crossed, g.op("Not", problem.free))
    wrong = g.op("Or", g.op("Not", support), crossed)
    return g.op("Where", wrong, 0.0, x), taken


def _pivot(problem: ElasticNet, low: Value, high: Value) -> Callable[[Graph, Value, list[Value]], Body]:
    """One step of the walk; problems at their optimum are masked."""
    r = problem.r

    def body(g: Graph, step: Value, state: list[Value]) -> Body:
        (table, value, lower, upper, rows, columns, driver, direction, start, own, d_low, d_high, going, taken) = (
            state
        )
        taken = taken + going.real()
        q = g.op("Equal", columns, driver).real()  # (p, r + 1)
        column = table @ q.unsqueeze(2)  # (p, r, 1)
        rate = direction * column.squeeze(2)
        room = g.op("Where", g.op("Greater", rate, 0.0), upper, lower) - value
        size = g.op("Abs", rate)
        moves = g.op("Greater", size, PIVOT_FLOOR)
        limit = g.op("Where", moves, g.op("Max", room / g.op("Where", moves, rate, 1.0), 0.0), BIG)
        nearest = limit.min(1, keep=True)  # (p, 1)
        flips = g.op("LessOrEqual", own, nearest)
        length = g.op("Where", going, g.op("Min", nearest, own), 0.0)
        value = value + length * rate

        candidates = g.op("Where", g.op("LessOrEqual", limit, nearest), size, -1.0)
        best = g.op("ArgMax", candidates, axis=1, keepdims=1)
        p = g.op("Equal", best, g.constant(np.arange(r), np.int64)).real()  # (p, r)
        does = g.op("And", going, g.op("Not", flips))
        leaving = (rows * p).sum(1, keep=True)
        rate_p = (rate * p).sum(1, keep=True)
        pivot = g.op("Where", does, direction * rate_p, 1.0).unsqueeze(2)
        row = p.unsqueeze(1) @ table  # (p, 1, r + 1)
        p_rest, q_rest = 1.0 - p, 1.0 - q
        u = ((column.squeeze(2) * p_rest + p).unsqueeze(2)) / pivot
        swapped = table * p_rest.unsqueeze(2) * q_rest.unsqueeze(1)
        swapped = swapped + u * (q.unsqueeze(1) - row * q_rest.unsqueeze(1))
        table = g.op("Where", does.unsqueeze(2), swapped, table)
        enters = g.op("And", g.op("Greater", p, 0.5), does)
        value = g.op("Where", enters, start + direction * length, value)
        rows = g.op("Where", enters, driver, rows)
        lower, upper = g.op("Where", enters, d_low, lower), g.op("Where", enters, d_high, upper)
        leaves = g.op("And", g.op("Greater", q, 0.5), does)
        columns = g.op("Where", leaves, leaving, columns)

        arrived = g.op("Equal", g.op("Where", does, leaving, driver), 2.0 * r)
        going = g.op("And", going, g.op("Not", g.op("And", arrived, g.op("Or", does, flips))))
        was_x = g.op("Less", leaving, float(r))
        mate = leaving + g.op("Where", was_x, float(r), -float(r))
        direction = g.op("Where", does, g.op("Sign", rate_p), direction)
        driver = g.op("Where", does, mate, driver - float(r))
        is_x = g.op("Less", driver, float(r))
        i = g.op("Equal", driver - g.op("Where", is_x, 0.0, float(r)), np.arange(r, dtype=float)).real()
        top, bottom = (high * i).sum(1, keep=True), (low * i).sum(1, keep=True)
        up = g.op("Greater", direction, 0.0)
        start = g.op("Where", is_x, 0.0, g.op("Where", up, bottom, top))
        own = g.op("Where", is_x, BIG, top - bottom)
        x_low = g.op("Where", g.op("And", up, g.op("Not", problem.free)), 0.0, -BIG)
        x_high = g.op("Where", g.op("Or", up, problem.free), BIG, 0.0)
        d_low, d_high = g.op("Where", is_x, x_low, bottom), g.op("Where", is_x, x_high, top)
        after = [
            table,
            value,
            lower,
            upper,
            rows,
            columns,
            driver,
            direction,
            start,
            own,
            d_low,
            d_high,
            going,
            taken,
        ]
        return Body(after, go=g.op("Greater", going.real().max(0, 1), 0.5))

    return body
