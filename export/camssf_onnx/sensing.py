"""Evidence → whitened rows: `camssf.curves.sensing` and `covariance` as nodes, by the same names.

What is known only on the 5-nm nodes stays there: integrals are folded onto them (`fold`), curves unfolded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camssf.curves.basis import Basis
from camssf.curves.covariance import (
    ABSOLUTE,
    CHART_CORRELATION,
    EDGE,
    FLOOR,
    INDEPENDENT_SHARE,
    LAMP_CORRELATION,
    RELATIVE,
    TABLE_CORRELATION,
    smooth_errors,
)
from camssf.curves.sensing import DARKEST
from camssf.grid import STEP
from camssf_onnx.algebra import I64, D, M, fold, identity, outer, same, size_of, slope, unfold, whiten
from camssf_onnx.graph import Body, Graph, Value, within

# From the code and its spread: curves, their errors, predicted signals, the lamp.
Curves = Callable[[Value, Value], tuple[Value, Value, Value, Value]]


class Rows:
    """Eq. (5) and the integrals that every basis needs. Channels come first: (3, k, n)."""

    def __init__(self, g: Graph, given: dict[str, Value]) -> None:
        self.g, self.given = g, given
        white = given["white"] - given["dark"]
        self.white_signal = white
        self.signals = (given["chart"] - given["dark"]) / white
        self.y = self.signals.transpose(2, 0, 1)
        self.error = given["standard_error"].transpose(2, 0, 1)
        self.power = given["lamp"] * STEP  # (k, m)
        self.seen_white = self.power * given["white_reflectance"]  # (k, m)

    def gain(self) -> Value:
        """Raw white signal of the first shot relative to green, (3,)."""
        first = self.white_signal.slice(0, 1, 0)
        means = self.g.op("ReduceMean", first, self.g.ints(0, 1), keepdims=0)
        return means / means.slice(1, 2, 0)


def paper_rows(g: Graph, rows: Rows, basis: Basis) -> tuple[Value, Value, Curves]:
    """F Ψ x = y with F = R L dλ, L scaled so that Σ ρ_w L dλ = 1; Σ diagonal. One shot."""
    atoms = g.constant(basis.dictionary[0], name="dictionary")  # (m, r)
    scale = rows.seen_white.slice(0, 1, 0).sum(0, 1)
    everything = rows.power.unsqueeze(1) * rows.given["reflectance"]  # (k, n, m)
    seen = everything.slice(0, 1, 0).squeeze(0)  # (n, m)
    A = ((seen / scale) @ atoms).unsqueeze(0) * np.ones((3, 1, 1))
    b = rows.y.slice(0, 1, 1).squeeze(1)
    error = rows.error.slice(0, 1, 1).squeeze(1)
    tolerance = rows.given["chart_tolerance"] * b
    variance = g.op("Max", error * error + tolerance * tolerance, FLOOR**2)
    sigma = variance.unsqueeze(2) * identity(g, size_of(g, b, 1))

    columns = whiten(g, sigma, g.op("Concat", A, b.unsqueeze(2), axis=2))
    r = basis.dictionary.shape[2]

    def curves(x: Value, spread: Value) -> tuple[Value, Value, Value, Value]:
        del spread  # no prior, no band
        s = atoms @ x.transpose(1, 0)  # (m, 3)
        s = s / (rows.seen_white.slice(0, 1, 0) @ s)
        predicted = (everything @ s) / (rows.seen_white @ s).unsqueeze(1)
        return s, s * np.nan, predicted, rows.given["lamp"]

    return columns.slice(0, r, 2), columns.slice(r, r + 1, 2).squeeze(2), curves


def learned_rows(g: Graph, rows: Rows, basis: Basis) -> tuple[Value, Value, Curves]:
    """Rows free of exposure, whitened by their full covariance, on the 5-nm nodes (sensing.py, `sense`).

    One Loop whose body takes the rows about a point: one turn where the lamps have no modes, else two, the first of
    which is `_look`.
    """
    given = rows.given
    nodes = basis.mean[:, ::10]
    mean = g.constant(nodes, name="mean")  # (3, v)
    atoms = g.constant(basis.dictionary[:, ::10], name="dictionary")  # (3, v, r)
    v, r = basis.dictionary[:, ::10].shape[1:]
    k = g.op("Shape", rows.power).slice(0, 1, 0)
    given_twice = g.op("Concat", given["reflectance"], slope(g, given["reflectance"]), axis=0)  # (2 n, m)
    folded = fold(g, rows.power.unsqueeze(1) * given_twice)  # (k, 2 n, v)
    parts = folded.like(g.op("Concat", k, g.ints(2, -1, v), axis=0))
    U, bends = parts.slice(0, 1, 1).squeeze(1), parts.slice(1, 2, 1).squeeze(1)  # (k, n, v) each
    whites = fold(g, g.op("Concat", rows.seen_white, rows.power, axis=0))  # (2 k, v)
    pair = whites.like(g.ints(2, -1, v))
    V, plain = pair.slice(0, 1, 0).squeeze(0), pair.slice(1, 2, 0).squeeze(0)  # (k, v) each
    first = V.slice(0, 1, 0)
    share = (first @ atoms) / (first @ mean.unsqueeze(2))  # (3, 1, r)
    atoms = atoms - mean.unsqueeze(2) * share  # anchored to the first white

    folded_ = fold_evidence(g, rows, (mean, atoms), (U, bends, V, plain), r)
    of_u, of_x = folded_.K, np.broadcast_to(np.eye(r), (3, r, r))
    start = [
        mean * 1.0,
        V * 0.0 + 1.0,
        g.op("Expand", 0.0, g.op("Concat", of_u, g.ints(1), axis=0)),
        g.op("Expand", 0.0, g.op("Concat", g.ints(3), of_u, g.ints(1), axis=0)),
        identity(g, of_u.squeeze(0)) * np.ones((3, 1, 1)),
        g.constant(of_x),
    ]
    turns = g.op("Cast", folded_.any_modes, to=I64) + g.constant(1, np.int64)
    *_, A, b, lamp = g.loop(folded_.turn(turns), start, [D] * 6, turns, "look")
    A, b, lamp = (value.slice(-1, 2**31, 0).squeeze(0) for value in (A, b, lamp))  # of the last turn

    def curves(x: Value, spread: Value) -> tuple[Value, Value, Value, Value]:
        s = mean + (atoms @ x.unsqueeze(2)).squeeze(2)  # (3, v)
        scale = (s @ V.slice(0, 1, 0).transpose(1, 0)).squeeze(1)  # (3,)
        s = s / scale.unsqueeze(1)
        shape = s / s.max(1, keep=True)
        top = g.op("ArgMax", s, axis=1, keepdims=1)
        peak = g.op("Equal", top, g.constant(np.arange(v), np.int64)).real()  # (3, v)
        moves = atoms - shape.unsqueeze(2) * (peak.unsqueeze(1) @ atoms)
        reach = moves @ spread
        here = (reach * moves).sum(2)  # (3, v)
        next_ = (reach.slice(0, v - 1, 1) * moves.slice(1, v, 1)).sum(2)
        left = 1.0 - np.arange(10) / 10.0
        right = 1.0 - left
        between = (
            here.slice(0, v - 1, 1).unsqueeze(2) * left**2
            + next_.unsqueeze(2) * (2.0 * left * right)
            + here.slice(1, v, 1).unsqueeze(2) * right**2
        ).reshape(3, M - 1)
        variance_ = g.op("Concat", between, here.slice(v - 1, v, 1), axis=1)
        std = g.op("Sqrt", g.op("Max", variance_, 0.0)) / scale.unsqueeze(1)
        values = unfold(g, s).transpose(1, 0)  # (m, 3)
        light = given["lamp"] * unfold(g, lamp)  # (k, m)
        seen = (light.unsqueeze(1) * given["reflectance"]) @ values
        predicted = seen / ((light * given["white_reflectance"]) @ values).unsqueeze(1)
        return values, std.transpose(1, 0), predicted, light

    return A, b, curves


@dataclass(frozen=True)
class Folded:
    """The evidence folded onto the nodes, and what its rows share: `_Folded` of `camssf.curves.sensing`.

    Shapes: channel 3, shot k, patch n, mode q, node v, atom r; N = k n rows, K = k q modes. `r` is a number.
    """

    mean: Value
    atoms: Value
    U: Value
    bends: Value
    V: Value
    plain: Value
    k: Value
    n: Value
    N: Value
    modes: Value
    loose: Value
    any_modes: Value
    K: Value
    y: Value
    flat: Value
    same_patch: Value
    same_shot: Value
    tolerance: Value
    white_tolerance: Value
    lamp_tolerance: Value
    noise: Value
    own: Value
    blocks: Value
    r: int

    def turn(self, turns: Value) -> Callable[[Graph, Value, list[Value]], Body]:
        """The Loop's body: point → next point; leaves the whitened rows behind."""

        def body(g: Graph, step: Value, state: list[Value]) -> Body:
            here = within(self, g)
            looks = g.op("Less", step + g.constant(1, np.int64), turns.here(g)).real()
            A, b, modes, lamp = here.rows(g, state, looks)
            return Body(here.after(g, A, b, modes), [A, b.squeeze(2), lamp])

        return body

    def rows(self, g: Graph, state: list[Value], looks: Value) -> tuple[Value, Value, Value, Value]:
        """L⁻¹ A (3, N, r), L⁻¹ b (3, N, 1), L⁻¹ D (3, N, K) about a point, and that point's lamp (k, v).

        Σ = L Lᵀ holds D C Dᵀ, but in a first look A Aᵀ instead.
        """
        curve, lamp, offset, told, of_u, of_x = state
        errors = curve.unsqueeze(1, 3)  # (3, 1, v, 1): times smooth errors (v, p)
        bend = lamp.unsqueeze(1)  # (k, 1, v)
        W = curve @ (self.V * lamp).transpose(1, 0)  # (3, k)
        seen = self.U * bend / W.unsqueeze(2, 3)  # (3, k, n, v)
        seen_white = (self.V * lamp / W.unsqueeze(2)).unsqueeze(2)  # (3, k, 1, v)
        light = (self.plain * lamp / W.unsqueeze(2)).unsqueeze(2)
        expected = seen @ errors  # (3, k, n, 1) ŷ
        about = g.op("Where", self.loose, expected, self.y)
        a = seen - about * seen_white
        a_expected = seen - expected * seen_white
        atoms = self.atoms.unsqueeze(1)  # (3, 1, v, r)
        A = (a @ atoms).like(self.flat)
        b = (self.y - about - a @ self.mean.unsqueeze(1, 3)).like(self.flat)

        edges = EDGE * self.bends * bend / W.unsqueeze(2, 3)
        seen_by = Seen(errors, expected, seen, edges, light, seen_white, a_expected)
        sigma = covariance(self, seen_by)

        relative = a_expected / bend  # the modes are relative to the lamp as given
        across = self.modes.transpose(0, 2, 1)  # (k, v, q)
        steps = (relative * curve.unsqueeze(1, 2)) @ across  # (3, k, n, q)
        modes = (steps.unsqueeze(3) * self.own).like(self.blocks).squeeze(3)  # (3, N, K)
        bent = (relative.unsqueeze(3) * self.modes.unsqueeze(1)) @ self.atoms.unsqueeze(1, 2)  # (3, k, n, q, r)
        off = ((self.V / W.unsqueeze(2) * curve.unsqueeze(1)).unsqueeze(2) @ across).unsqueeze(4)  # (3, k, 1, q, 1)
        bent = bent - off * (a_expected @ atoms).unsqueeze(3)
        bent = bent - steps.unsqueeze(4) * (seen_white @ atoms).unsqueeze(3)
        bent = (bent.unsqueeze(3) * self.own.unsqueeze(4)).like(self.blocks)  # (3, N, K, r)
        spread = of_u.unsqueeze(1) @ (bent @ of_x.unsqueeze(1))
        sigma = sigma + spread.like(self.flat) @ bent.like(self.flat).transpose(0, 2, 1)
        sigma = sigma + (1.0 - looks) * (modes @ of_u @ modes.transpose(0, 2, 1)) + looks * outer(A)

        b = b + modes @ (offset - told)
        columns = whiten(g, sigma, g.op("Concat", A, b, modes, axis=2))
        r = self.r
        return columns.slice(0, r, 2), columns.slice(r, r + 1, 2), columns.slice(r + 1, 2**31, 2), lamp * 1.0

    def after(self, g: Graph, A: Value, b: Value, modes: Value) -> list[Value]:
        """`_look`: the next point, from whitened rows."""
        turned = modes.transpose(0, 2, 1)
        precision, pull = turned @ modes, turned @ b  # Λ (3, K, K), h (3, K, 1)
        whole, force = precision.sum(0, keep=True), pull.sum(0, keep=True)
        one = identity(g, self.K.squeeze(0))
        system = one + g.op("Concat", whole - precision, whole, axis=0)  # (4, K, K): the channels' others, all
        forces = g.op("Concat", force - pull, force, axis=0)
        columns = whiten(g, system, g.op("Concat", g.op("Expand", one, g.op("Shape", system)), forces, axis=2))
        root, right = columns.slice(0, -1, 2), columns.slice(-1, 2**31, 2)  # L⁻¹, L⁻¹ h
        back = root.transpose(0, 2, 1)
        solved, covariance = back @ right, (back @ root).slice(0, 3, 0)
        offset, told = solved.slice(3, 4, 0).squeeze(0), solved.slice(0, 3, 0)  # (K, 1), (3, K, 1)
        across = A.transpose(0, 2, 1)
        code = across @ (b - modes @ offset)  # (3, r, 1)
        curve = self.mean + (self.atoms @ code).squeeze(2)
        size = g.op("Concat", self.k, g.ints(1, -1), axis=0)
        bend = 1.0 + (offset.like(size) @ self.modes).squeeze(1)  # (k, v)
        lamp = g.op("Max", bend, DARKEST)
        return [curve, lamp, offset * 1.0, told * 1.0, covariance * 1.0, np.eye(self.r) - across @ A]


@dataclass(frozen=True)
class Seen:
    """What the errors of the three channels' rows hang on: `Seen` of `camssf.curves.covariance`.

    Attributes:
        curve: (3, 1, v, 1) s. predicted: (3, k, n, 1) ŷ.
        patches, edges: (3, k, n, v). light, white: (3, k, 1, v). against_white: (3, k, n, v).
    """

    curve: Value
    predicted: Value
    patches: Value
    edges: Value
    light: Value
    white: Value
    against_white: Value


def covariance(known: Folded, seen: Seen) -> Value:
    """Σ of each channel's rows without lamp modes, (3, N, N): `camssf.curves.covariance.covariance`."""
    chart_curves, lamp_curves, table_curves = (
        seen.curve * smooth_errors(length) for length in (CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION)
    )
    edges = seen.edges @ table_curves
    floor = ABSOLUTE * (seen.light @ table_curves) + 0.0 * edges
    chart = edges.graph.op("Concat", RELATIVE * (seen.patches @ chart_curves), floor, edges, axis=3)
    sigma = known.noise + known.same_patch * outer((known.tolerance * chart).like(known.flat))
    white = known.white_tolerance * seen.predicted * (seen.white @ chart_curves)
    sigma = sigma + outer(white.like(known.flat))
    lamp = known.lamp_tolerance * (seen.against_white @ lamp_curves)
    return sigma + known.same_shot * outer(lamp.like(known.flat))


def fold_evidence(g: Graph, rows: Rows, basis: tuple[Value, Value], scenes: tuple[Value, ...], r: int) -> Folded:
    """What the rows need of the evidence; `basis` is mean and anchored atoms, `scenes` the folded integrals."""
    mean, atoms = basis
    U, bends, V, plain = scenes
    given = rows.given
    shape = g.op("Shape", rows.y)
    k, n = shape.slice(1, 2, 0), shape.slice(2, 3, 0)
    N = k * n
    steps = g.constant([10], np.int64)
    modes = g.op("Slice", given["lamp_modes"], g.ints(0), g.ints(M), g.ints(2), steps)  # (k, q, v)
    sizes = g.op("ReduceMax", g.op("Abs", modes), g.ints(1, 2), keepdims=1)  # (k, 1, 1)
    loose = g.op("Greater", sizes, 0.0)
    any_modes = g.op("Greater", sizes.max(0, 1, 2), 0.0)
    K = k * g.op("Shape", modes).slice(1, 2, 0)
    y = rows.y.unsqueeze(3)  # (3, k, n, 1)
    flat = g.op("Concat", g.ints(3), N, g.ints(-1), axis=0)
    count = N.squeeze(0)
    order = g.op("Range", g.constant(0, np.int64), count, g.constant(1, np.int64))
    same_patch, same_shot = (same(g, g.op(kind, order, n)) for kind in ("Mod", "Div"))
    tolerance = given["chart_tolerance"].unsqueeze(1)  # (n, 1)
    white_tolerance = given["white_tolerance"]
    lamp_tolerance = given["lamp_tolerance"].unsqueeze(1, 2)
    independent = INDEPENDENT_SHARE * given["chart_tolerance"] * rows.y
    variance = g.op("Max", rows.error * rows.error + independent * independent, FLOOR**2)
    noise = variance.like(g.op("Concat", g.ints(3), N, g.ints(1), axis=0)) * identity(g, count)
    shots = identity(g, k.squeeze(0))
    own = shots.unsqueeze(1, 3)  # (k, 1, k, 1): a shot's errors are no other's
    blocks = g.op("Concat", g.ints(3), N, K, g.ints(-1), axis=0)
    return Folded(
        mean,
        atoms,
        U,
        bends,
        V,
        plain,
        k,
        n,
        N,
        modes,
        loose,
        any_modes,
        K,
        y,
        flat,
        same_patch,
        same_shot,
        tolerance,
        white_tolerance,
        lamp_tolerance,
        noise,
        own,
        blocks,
        r,
    )
