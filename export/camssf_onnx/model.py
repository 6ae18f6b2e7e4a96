"""The whole algebra from Eq. (5) to the curves as one ONNX graph: float64, opset 18, standard operators only.

The same steps in the same order as `sensing`, `unrolled` and `ssf` of `camssf.curves`, which are the specification;
names follow them. Differences of form, none of value:

- What is known only on the 5-nm nodes stays there: integrals are folded onto them (`_fold`), curves unfolded.
- ONNX has no float64 Cholesky or inverse. Rows are whitened by Gauss' elimination in a Loop, whose scaled pivot rows
  are L⁻¹ (A | b). Matrices of unit diagonal are inverted by a Loop of symmetric sweeps, one rank-one update each.
- The three channels are solved side by side; one that has arrived stands still.
- No infinities: a bound that does not exist is ±1e300.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
import onnx
from onnx import TensorProto, helper

from camssf import __version__
from camssf.curves.basis import NODES, Basis
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
from camssf.curves.unrolled import (
    DEPTH,
    EXACT,
    GOLDEN,
    PIVOT_FLOOR,
    PROVEN,
    REFINEMENTS,
    RELAXATION,
    RIDGE,
    WALKS,
    finish_steps,
)
from camssf.grid import STEP, WAVELENGTHS
from camssf_onnx.graph import Body, Graph, Value

OPSET, IR = 18, 9
BIG = 1e300
D, I64, B = TensorProto.DOUBLE, TensorProto.INT64, TensorProto.BOOL
M = WAVELENGTHS.size
INPUTS: dict[str, list[str | int]] = {
    "chart": ["k", "n", 3],
    "white": ["k", "n", 3],
    "dark": ["k", "n", 3],
    "standard_error": ["k", "n", 3],
    "reflectance": ["n", M],
    "chart_tolerance": ["n"],
    "white_reflectance": [M],
    "white_tolerance": [],
    "lamp": ["k", M],
    "lamp_tolerance": ["k"],
    "lamp_modes": ["k", "q", M],
    "l2": [],
    "gamma": [],
}

# From the code and its spread: curves, their errors, predicted signals, the lamp.
_Curves = Callable[[Value, Value], tuple[Value, Value, Value, Value]]


def build(basis: Basis, *, depth: int = DEPTH) -> onnx.ModelProto:
    """The model of a basis; the same basis gives the same bytes."""
    g = Graph(f"camssf-{basis.name}")
    given = {name: Value(g, name) for name in INPUTS}
    nonnegative = Value(g, "nonnegative")
    r = basis.dictionary.shape[2]

    rows = _Rows(g, given)
    A, b, curves = _cameras(g, rows, basis) if basis.prior else _paper(g, rows, basis)
    H = A.transpose(0, 2, 1) @ A
    pull = (A.transpose(0, 2, 1) @ b.unsqueeze(2)).squeeze(2)  # (3, r) g
    l2, gamma = given["l2"], given["gamma"]
    eye = g.constant(np.eye(r))
    quadratic = H + l2 * eye  # M
    rho = gamma + 2.0 * l2
    low = -g.op("Where", g.op("Greater", nonnegative, 0.5), BIG, gamma)
    # The layers' weights and the code's posterior covariance in one go.
    both = _inverse(g, g.op("Concat", quadratic + rho * eye, H + eye, axis=0), r)
    W, spread = both.slice(0, 3, 0), both.slice(3, 6, 0)

    problem = _Problem(g, A, b, quadratic, l2, gamma, nonnegative, r)
    z = _layers(g, W, problem.pulled(W, pull, rho), rho, gamma, low, r, depth)
    x, gap = problem.finish(z)
    ssf, std, predicted, lamp = curves(x, spread)
    outputs = {
        "ssf": ssf,
        "ssf_std": std,
        "code": x.transpose(1, 0),
        "signals": rows.signals,
        "predicted": predicted,
        "gap": gap,
        "channel_gain": rows.gain(),
        "lamp_estimate": lamp,
    }
    shapes: dict[str, list[str | int]] = {
        "ssf": [M, 3],
        "ssf_std": [M, 3],
        "code": [r, 3],
        "signals": ["k", "n", 3],
        "predicted": ["k", "n", 3],
        "gap": [3],
        "channel_gain": [3],
        "lamp_estimate": ["k", M],
    }
    for name in shapes:
        g.nodes.append(helper.make_node("Identity", [outputs[name].name], [name]))
    default = helper.make_tensor("nonnegative", D, [], [0.0 if basis.prior else 1.0])
    graph = helper.make_graph(
        g.nodes,
        g.name,
        [helper.make_tensor_value_info(name, D, shape) for name, shape in INPUTS.items()]
        + [helper.make_tensor_value_info("nonnegative", D, [])],
        [helper.make_tensor_value_info(name, D, shape) for name, shape in shapes.items()],
        [*g.initializers, default],
        doc_string="RAW patch statistics of a ColorChecker in, camera spectral sensitivities and their proof out.",
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR, producer_name="camssf"
    )
    model.producer_version = __version__
    metadata = {
        "basis": basis.name,
        "basis_sha256": basis.sha256(),
        "basis_source": basis.source,
        "depth": str(depth),
        "finish": str(finish_steps(r)),
        "grid": "380 to 720 nm every 0.5 nm",
        "vocabulary": "1",
    }
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model, full_check=True)
    return model


class _Rows:
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


def _paper(g: Graph, rows: _Rows, basis: Basis) -> tuple[Value, Value, _Curves]:
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
    sigma = variance.unsqueeze(2) * _identity(g, _size(g, b, 1))

    columns = _whiten(g, sigma, g.op("Concat", A, b.unsqueeze(2), axis=2))
    r = basis.dictionary.shape[2]

    def curves(x: Value, spread: Value) -> tuple[Value, Value, Value, Value]:
        del spread  # no prior, no band
        s = atoms @ x.transpose(1, 0)  # (m, 3)
        s = s / (rows.seen_white.slice(0, 1, 0) @ s)
        predicted = (everything @ s) / (rows.seen_white @ s).unsqueeze(1)
        return s, s * np.nan, predicted, rows.given["lamp"]

    return columns.slice(0, r, 2), columns.slice(r, r + 1, 2).squeeze(2), curves


def _cameras(g: Graph, rows: _Rows, basis: Basis) -> tuple[Value, Value, _Curves]:
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
    given_twice = g.op("Concat", given["reflectance"], _slope(g, given["reflectance"]), axis=0)  # (2 n, m)
    folded = _fold(g, rows.power.unsqueeze(1) * given_twice)  # (k, 2 n, v)
    parts = folded.like(g.op("Concat", k, g.ints(2, -1, v), axis=0))
    U, bends = parts.slice(0, 1, 1).squeeze(1), parts.slice(1, 2, 1).squeeze(1)  # (k, n, v) each
    whites = _fold(g, g.op("Concat", rows.seen_white, rows.power, axis=0))  # (2 k, v)
    pair = whites.like(g.ints(2, -1, v))
    V, plain = pair.slice(0, 1, 0).squeeze(0), pair.slice(1, 2, 0).squeeze(0)  # (k, v) each
    first = V.slice(0, 1, 0)
    share = (first @ atoms) / (first @ mean.unsqueeze(2))  # (3, 1, r)
    atoms = atoms - mean.unsqueeze(2) * share  # anchored to the first white

    scene = _Scene(g, rows, mean, atoms, U, bends, V, plain, r)
    of_u, of_x = scene.K, np.broadcast_to(np.eye(r), (3, r, r))
    start = [
        mean * 1.0,
        V * 0.0 + 1.0,
        g.op("Expand", 0.0, g.op("Concat", of_u, g.ints(1), axis=0)),
        g.op("Expand", 0.0, g.op("Concat", g.ints(3), of_u, g.ints(1), axis=0)),
        _identity(g, of_u.squeeze(0)) * np.ones((3, 1, 1)),
        g.constant(of_x),
    ]
    turns = g.op("Cast", scene.any_modes, to=I64) + g.constant(1, np.int64)
    *_, A, b, lamp = g.loop(scene.turn(turns), start, [D] * 6, turns, "look")
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
        values = _unfold(g, s).transpose(1, 0)  # (m, 3)
        light = given["lamp"] * _unfold(g, lamp)  # (k, m)
        seen = (light.unsqueeze(1) * given["reflectance"]) @ values
        predicted = seen / ((light * given["white_reflectance"]) @ values).unsqueeze(1)
        return values, std.transpose(1, 0), predicted, light

    return A, b, curves


class _Scene:
    """`_Scene`, `_rows` and `_look` of sensing.py. Shapes: channel 3, shot k, patch n, mode q, node v, atom r."""

    def __init__(
        self, g: Graph, rows: _Rows, mean: Value, atoms: Value, U: Value, bends: Value, V: Value, plain: Value, r: int
    ) -> None:
        self.mean, self.atoms, self.U, self.bends, self.V, self.plain, self.r = mean, atoms, U, bends, V, plain, r
        given = rows.given
        shape = g.op("Shape", rows.y)
        self.k, self.n = shape.slice(1, 2, 0), shape.slice(2, 3, 0)
        self.N = self.k * self.n
        steps = g.constant([10], np.int64)
        self.modes = g.op("Slice", given["lamp_modes"], g.ints(0), g.ints(M), g.ints(2), steps)  # (k, q, v)
        sizes = g.op("ReduceMax", g.op("Abs", self.modes), g.ints(1, 2), keepdims=1)  # (k, 1, 1)
        self.loose = g.op("Greater", sizes, 0.0)
        self.any_modes = g.op("Greater", sizes.max(0, 1, 2), 0.0)
        self.K = self.k * g.op("Shape", self.modes).slice(1, 2, 0)
        self.y = rows.y.unsqueeze(3)  # (3, k, n, 1)
        self.flat = g.op("Concat", g.ints(3), self.N, g.ints(-1), axis=0)
        N = self.N.squeeze(0)
        order = g.op("Range", g.constant(0, np.int64), N, g.constant(1, np.int64))
        self.same_patch, self.same_shot = (_same(g, g.op(kind, order, self.n)) for kind in ("Mod", "Div"))
        self.tolerance = given["chart_tolerance"].unsqueeze(1)  # (n, 1)
        self.white_tolerance = given["white_tolerance"]
        self.lamp_tolerance = given["lamp_tolerance"].unsqueeze(1, 2)
        independent = INDEPENDENT_SHARE * given["chart_tolerance"] * rows.y
        variance = g.op("Max", rows.error * rows.error + independent * independent, FLOOR**2)
        self.noise = variance.like(g.op("Concat", g.ints(3), self.N, g.ints(1), axis=0)) * _identity(g, N)
        shots = _identity(g, self.k.squeeze(0))
        self.own = shots.unsqueeze(1, 3)  # (k, 1, k, 1): a shot's errors are no other's
        self.blocks = g.op("Concat", g.ints(3), self.N, self.K, g.ints(-1), axis=0)

    def turn(self, turns: Value) -> Callable[[Graph, Value, list[Value]], Body]:
        """The Loop's body: point → next point; leaves the whitened rows behind."""

        def body(g: Graph, step: Value, state: list[Value]) -> Body:
            here = copy(self)
            for name, value in vars(self).items():
                if isinstance(value, Value):
                    setattr(here, name, value.here(g))
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

        chart_curves, lamp_curves, table_curves = (
            errors * smooth_errors(length) for length in (CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION)
        )
        edges = (EDGE * self.bends * bend / W.unsqueeze(2, 3)) @ table_curves
        floor = ABSOLUTE * (light @ table_curves) + 0.0 * edges
        parts = g.op("Concat", RELATIVE * (seen @ chart_curves), floor, edges, axis=3)
        sigma = self.noise + self.same_patch * _outer((self.tolerance * parts).like(self.flat))
        paper = self.white_tolerance * expected * (seen_white @ chart_curves)
        sigma = sigma + _outer(paper.like(self.flat))
        smooth = self.lamp_tolerance * (a_expected @ lamp_curves)
        sigma = sigma + self.same_shot * _outer(smooth.like(self.flat))

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
        sigma = sigma + (1.0 - looks) * (modes @ of_u @ modes.transpose(0, 2, 1)) + looks * _outer(A)

        b = b + modes @ (offset - told)
        columns = _whiten(g, sigma, g.op("Concat", A, b, modes, axis=2))
        r = self.r
        return columns.slice(0, r, 2), columns.slice(r, r + 1, 2), columns.slice(r + 1, 2**31, 2), lamp * 1.0

    def after(self, g: Graph, A: Value, b: Value, modes: Value) -> list[Value]:
        """`_look`: the next point, from whitened rows."""
        turned = modes.transpose(0, 2, 1)
        precision, pull = turned @ modes, turned @ b  # Λ (3, K, K), h (3, K, 1)
        whole, force = precision.sum(0, keep=True), pull.sum(0, keep=True)
        one = _identity(g, self.K.squeeze(0))
        system = one + g.op("Concat", whole - precision, whole, axis=0)  # (4, K, K): the channels' others, all
        forces = g.op("Concat", force - pull, force, axis=0)
        columns = _whiten(g, system, g.op("Concat", g.op("Expand", one, g.op("Shape", system)), forces, axis=2))
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


def _layers(g: Graph, W: Value, pulled: Value, rho: Value, gamma: Value, low: Value, r: int, depth: int) -> Value:
    """The unrolled layers: v ← W₁ b + W_v v + W_q clip(v), the step of `unrolled.py` with z = v - clip(v)."""
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

    stride = _stride(depth)
    start = g.constant(np.zeros((3, r, 1)))
    (v,) = g.loop(layer, [start], [D], g.constant(depth // stride, np.int64), "layers")
    return (v - clip(g, v)).squeeze(2)


class _Problem:
    """min ½ xᵀ M x - gᵀ x + γ ‖x‖₁ for three channels at once."""

    def __init__(
        self, g: Graph, A: Value, b: Value, quadratic: Value, l2: Value, gamma: Value, nonnegative: Value, r: int
    ) -> None:
        self.g, self.A, self.b, self.M, self.l2, self.gamma, self.r = g, A, b, quadratic, l2, gamma, r
        self.positive = g.op("Greater", nonnegative, 0.5)
        self.free = g.op("And", g.op("Equal", gamma, 0.0), g.op("Not", self.positive))
        diagonal = (quadratic * np.eye(r)).sum(2)
        self.scale = 1.0 / g.op("Sqrt", g.op("Where", g.op("Greater", diagonal, 0.0), diagonal, 1.0))  # (3, r)

    def at(self, g: Graph) -> _Problem:
        """The same problem, seen from a body."""
        other = copy(self)
        other.g = g
        for name, value in vars(self).items():
            if isinstance(value, Value):
                setattr(other, name, value.here(g))
        return other

    def pulled(self, W: Value, pull: Value, rho: Value) -> Value:
        """W g, (3, r, 1), refined on the residual (unrolled.py, `unroll`)."""
        u = W @ pull.unsqueeze(2)
        first = u.squeeze(2)
        return u + W @ (self.residual(first) - rho * first).unsqueeze(2)

    def rest(self, x: Value) -> Value:
        """b - A x, (3, N, 1)."""
        return self.b.unsqueeze(2) - self.A @ x.unsqueeze(2)

    def residual(self, x: Value) -> Value:
        """w = Aᵀ (b - A x) - λ₂ x, (3, r)."""
        return (self.A.transpose(0, 2, 1) @ self.rest(x)).squeeze(2) - self.l2 * x

    def finish(self, z: Value) -> tuple[Value, Value]:
        """Walk from the layers' z to the optimum, anew from what was found until it is proven: x, gap (3,)."""

        def walk(body: Graph, step: Value, state: list[Value]) -> Body:
            z, best, least = state
            here = self.at(body)
            x = here.walk(z)
            gap = here.gap(x).unsqueeze(1)
            better = body.op("Or", body.op("Less", gap, least), body.op("Equal", step, body.constant(0, np.int64)))
            best, least = body.op("Where", better, x, best), body.op("Where", better, gap, least)
            unproven = body.op("Not", body.op("LessOrEqual", least, PROVEN)).real()
            return Body([x, best, least], go=body.op("Greater", unproven.max(0, 1), 0.5))

        start = [z, z, self.g.constant(np.full((3, 1), BIG))]
        _, x, gap = self.g.loop(walk, start, [D] * 3, self.g.constant(WALKS, np.int64), "finish")
        return x, gap.squeeze(1)

    def walk(self, z: Value) -> Value:
        """One walk from z (unrolled.py, `_start`, `_Walk`, `_settle`)."""
        g, r, scale = self.g, self.r, self.scale
        unit = self.M * scale.unsqueeze(1) * scale.unsqueeze(2) + RIDGE * np.eye(r)
        high = self.gamma * scale
        low = g.op("Where", self.positive, -BIG, -high)
        wanted = g.op("Or", g.op("Not", g.op("Equal", z, 0.0)), self.free).real().unsqueeze(2)  # (3, r, 1)

        stride, eye = _stride(r), g.constant(np.eye(r))

        def enter(body: Graph, step: Value, state: list[Value]) -> Body:
            (X,) = state
            entered = []
            for at in _turns(body, step, r, stride):
                column = X.take(at, 2)
                pivot = column.take(at, 1)
                deep = body.op("Greater", pivot, PIVOT_FLOOR)
                share = body.op("Where", deep, wanted.here(body).take(at, 1) / pivot, 0.0)
                u = column - eye.here(body).take(at, 1)
                X = X - (share * u) * u.transpose(0, 2, 1)
                entered.append(body.op("Greater", share, 0.0).real())
            return Body([X], [body.op("Concat", *entered, axis=1)])

        X, entered = g.loop(enter, [unit], [D], g.constant(r // stride, np.int64), "enter")
        inside = entered.transpose(1, 0, 2, 3).reshape(3, r)
        support = g.op("Greater", inside, 0.5)
        # A sweep leaves 2 - 1 / p on its diagonal; the tableau has -M⁻¹ on the support, its signs by column.
        table = X * (2.0 * inside - 1.0).unsqueeze(1) - 2.0 * inside.unsqueeze(2) * np.eye(r)

        x0 = g.op("Where", support, z / scale, 0.0)
        up = g.op("Not", g.op("Less", z, 0.0))
        w = self.residual(x0 * scale) * scale
        depths = 0.05 + 0.9 * ((np.arange(r) * GOLDEN) % 1.0)
        over = g.op("Max", w - high, 0.0)
        outside = g.op("Greater", g.op("Abs", w), high)
        inner = g.op("Where", outside, g.op("Sign", w) * high * depths, w)
        strictly = g.op("Where", self.positive, w - (1.0 + depths) * over, inner)
        w0 = g.op("Where", support, g.op("Where", up, high, -high), strictly)
        d = w - w0
        aside = g.op("Where", support, 0.0, d)
        last = aside - (table @ g.op("Where", support, d, 0.0).unsqueeze(2)).squeeze(2)
        table = g.op("Concat", table, last.unsqueeze(2), axis=2)  # (3, r, r + 1)
        value = g.op("Where", support, x0, w0)

        count = np.arange(r, dtype=float)
        x_low = g.op("Where", g.op("Or", g.op("Not", up), self.free), -BIG, 0.0)
        x_high = g.op("Where", g.op("Or", up, self.free), BIG, 0.0)
        lower, upper = g.op("Where", support, x_low, low), g.op("Where", support, x_high, high)
        row_labels = g.op("Where", support, count, count + r)
        column_labels = g.op(
            "Concat", g.op("Where", support, count + r, count), np.full((3, 1), 2.0 * r), axis=1
        )  # fmt: skip
        ones = np.ones((3, 1))
        state = [
            table, value, lower, upper, row_labels, column_labels,
            g.constant(2.0 * r * ones), g.constant(ones), g.constant(np.zeros((3, 1))), g.constant(ones),
            g.constant(0.0 * ones), g.constant(ones), g.constant(np.ones((3, 1), bool), np.bool_),
        ]  # fmt: skip
        kinds = [D] * 12 + [B]
        state = g.loop(self._pivot(low, high), state, kinds, g.constant(finish_steps(r), np.int64), "walk")
        table, value, lower, upper, row_labels, column_labels = state[:6]

        rows = g.op("Equal", row_labels.unsqueeze(2), count).real()  # (3, r rows, r variables): x_i basic in that row
        columns = g.op("Equal", column_labels.unsqueeze(2), count + r).real()  # (3, r + 1, r): w_i nonbasic
        to_x = rows.transpose(0, 2, 1)
        x = (to_x @ value.unsqueeze(2)).squeeze(2)
        K = -(to_x @ table @ columns)
        support = g.op("Greater", rows.sum(1), 0.5)
        down = g.op("LessOrEqual", upper, 0.0).real().unsqueeze(2)
        down = g.op("Greater", (to_x @ down).squeeze(2), 0.5)
        target = g.op("Where", down, -high, high)
        x = x * scale
        enough = EXACT * high.max(1, keep=True)  # (3, 1)

        def refine(body: Graph, step: Value, state: list[Value]) -> Body:
            x, best, smallest = state
            error = body.op("Where", support, self.at(body).residual(x) * scale - target, 0.0)
            size = body.op("Abs", error).max(1, keep=True)
            halves = body.op("LessOrEqual", size, 0.5 * smallest)
            more = body.op("Or", halves, body.op("Greater", size, enough)).real()
            better = body.op("Less", size, smallest)
            best, smallest = body.op("Where", better, x, best), body.op("Where", better, size, smallest)
            x = x + scale * (K @ error.unsqueeze(2)).squeeze(2)
            return Body([x, best, smallest], go=body.op("Greater", more.max(0, 1), 0.5))

        start = [x, x, g.constant(np.full((3, 1), BIG))]
        x = g.loop(refine, start, [D] * 3, g.constant(REFINEMENTS, np.int64), "refine")[1]
        crossed = g.op("Less", g.op("Where", down, -x, x), 0.0)
        crossed = g.op("And", crossed, g.op("Not", self.free))
        wrong = g.op("Or", g.op("Not", support), crossed)
        return g.op("Where", wrong, 0.0, x)

    def _pivot(self, low: Value, high: Value) -> Callable[[Graph, Value, list[Value]], Body]:
        """One step of the walk; three channels, those that have arrived masked."""
        r = self.r

        def body(g: Graph, step: Value, state: list[Value]) -> Body:
            (table, value, lower, upper, rows, columns, driver, direction, start, own, d_low, d_high, going) = state
            q = g.op("Equal", columns, driver).real()  # (3, r + 1)
            column = table @ q.unsqueeze(2)  # (3, r, 1)
            rate = direction * column.squeeze(2)
            room = g.op("Where", g.op("Greater", rate, 0.0), upper, lower) - value
            size = g.op("Abs", rate)
            moves = g.op("Greater", size, PIVOT_FLOOR)
            limit = g.op("Where", moves, g.op("Max", room / g.op("Where", moves, rate, 1.0), 0.0), BIG)
            nearest = limit.min(1, keep=True)  # (3, 1)
            flips = g.op("LessOrEqual", own, nearest)
            length = g.op("Where", going, g.op("Min", nearest, own), 0.0)
            value = value + length * rate

            candidates = g.op("Where", g.op("LessOrEqual", limit, nearest), size, -1.0)
            best = g.op("ArgMax", candidates, axis=1, keepdims=1)
            p = g.op("Equal", best, g.constant(np.arange(r), np.int64)).real()  # (3, r)
            does = g.op("And", going, g.op("Not", flips))
            leaving = (rows * p).sum(1, keep=True)
            rate_p = (rate * p).sum(1, keep=True)
            pivot = g.op("Where", does, direction * rate_p, 1.0).unsqueeze(2)
            row = p.unsqueeze(1) @ table  # (3, 1, r + 1)
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
            x_low = g.op("Where", g.op("And", up, g.op("Not", self.free)), 0.0, -BIG)
            x_high = g.op("Where", g.op("Or", up, self.free), BIG, 0.0)
            d_low, d_high = g.op("Where", is_x, x_low, bottom), g.op("Where", is_x, x_high, top)
            after = [table, value, lower, upper, rows, columns, driver, direction, start, own, d_low, d_high, going]
            return Body(after, go=g.op("Greater", going.real().max(0, 1), 0.5))

        return body

    def gap(self, x: Value) -> Value:
        """Relative duality gap (3,) of `unrolled.py`, from the residual itself."""
        g = self.g
        rest = self.rest(x)
        w = self.residual(x)
        quadratic = (rest * rest).sum(1, 2) + self.l2 * (x * x).sum(1)
        l1 = self.gamma * g.op("Abs", x).sum(1)
        objective = 0.5 * quadratic + l1
        worst = g.op("Where", self.positive, w, g.op("Abs", w)).max(1)
        worst = g.op("Max", worst, 0.0)
        some = g.op("Greater", worst, 0.0)
        alpha = g.op("Where", some, g.op("Min", self.gamma / g.op("Where", some, worst, 1.0), 1.0), 1.0)
        short = 1.0 - alpha
        with_l1 = 0.5 * short * short * quadratic + l1 - alpha * (x * w).sum(1)
        at_bound = g.op("And", g.op("Equal", x, 0.0), self.positive)
        slope = g.op("Where", at_bound, g.op("Max", w, 0.0), w)
        l2 = g.op("Where", g.op("Greater", self.l2, 0.0), self.l2, 1.0)
        smooth = 0.5 * (slope * slope).sum(1) / l2
        gap = g.op("Max", g.op("Where", g.op("Equal", self.gamma, 0.0), smooth, with_l1), 0.0)
        known = g.op("Greater", objective, 0.0)
        return g.op("Where", known, gap / g.op("Where", known, objective, 1.0), objective)


def _whiten(g: Graph, sigma: Value, columns: Value) -> Value:
    """L⁻¹ columns (c, N, p) with Σ = L Lᵀ: the pivot rows of (Σ | columns), each over its pivot's root."""

    def eliminate(body: Graph, step: Value, state: list[Value]) -> Body:
        (Z,) = state
        at = step.unsqueeze(0)
        row, column = Z.take(at, 1), Z.take(at, 2)
        pivot = column.take(at, 1)
        return Body([Z - (column / pivot) * row], [row / body.op("Sqrt", pivot)])

    N = _size(g, columns, 1)
    _, left = g.loop(eliminate, [g.op("Concat", sigma, columns, axis=2)], [D], N, "whiten")  # (N, c, 1, N + p)
    rows = left.squeeze(2).transpose(1, 0, 2)
    return g.op("Slice", rows, N.unsqueeze(0), g.ints(2**31), g.ints(2))


def _inverse(g: Graph, matrix: Value, size: int) -> Value:
    """Inverse of symmetric positive definite matrices (c, r, r): unit diagonal, then r symmetric sweeps."""
    eye = np.eye(size)
    scale = 1.0 / g.op("Sqrt", (matrix * eye).sum(2))  # (c, r)
    unit = matrix * scale.unsqueeze(1) * scale.unsqueeze(2)
    identity, stride = g.constant(eye), _stride(size)

    def sweep(body: Graph, step: Value, state: list[Value]) -> Body:
        (X,) = state
        for at in _turns(body, step, size, stride):
            column = X.take(at, 2)
            u = column - identity.here(body).take(at, 1)
            X = X - (u / column.take(at, 1)) * u.transpose(0, 2, 1)
        return Body([X])

    (X,) = g.loop(sweep, [unit], [D], g.constant(size // stride, np.int64), "weigh")
    return (2.0 * eye - X) * scale.unsqueeze(1) * scale.unsqueeze(2)  # a sweep leaves 2 - 1 / p on its diagonal


def _stride(count: int) -> int:
    """Steps that share one turn of a Loop, whose own cost is that of a few nodes."""
    return next(stride for stride in (4, 3, 2, 1) if count % stride == 0)


def _turns(body: Graph, step: Value, count: int, stride: int) -> list[Value]:
    """The indices (1,) that a turn of a Loop over `count` takes."""
    order = np.arange(count).reshape(-1, stride)
    return [body.op("Gather", body.constant(order[:, i : i + 1], np.int64), step, axis=0) for i in range(stride)]


def _fold(g: Graph, f: Value) -> Value:
    """Adjoint of `_unfold`: values on the grid (..., 681) to the 5-nm nodes (..., 69), Σ f s = Σ fold(f) s_nodes."""
    share = np.arange(10) / 10.0
    shape = g.op("Shape", f)
    lead = shape.slice(0, -1, 0)
    head = f.slice(0, M - 1, -1).like(g.op("Concat", lead, g.ints(NODES.size - 1, 10), axis=0))
    parts = head @ np.stack([1.0 - share, share], axis=1)  # (..., 68, 2)
    zero = f.slice(0, 1, -1) * 0.0
    left = g.op("Concat", parts.slice(0, 1, -1).squeeze(-1), f.slice(M - 1, M, -1), axis=-1)
    return left + g.op("Concat", zero, parts.slice(1, 2, -1).squeeze(-1), axis=-1)


def _slope(g: Graph, f: Value) -> Value:
    """d f / dλ on the grid, (n, 681): central differences, one-sided at the ends."""
    steps = (f.slice(1, M, 1) - f.slice(0, M - 1, 1)) / STEP
    inner = 0.5 * (steps.slice(0, M - 2, 1) + steps.slice(1, M - 1, 1))
    return g.op("Concat", steps.slice(0, 1, 1), inner, steps.slice(M - 2, M - 1, 1), axis=1)


def _unfold(g: Graph, s: Value) -> Value:
    """Curves on the nodes (c, 69), straight between them, on the grid (c, 681)."""
    share = np.arange(10) / 10.0
    v = NODES.size
    between = s.slice(0, v - 1, 1).unsqueeze(2) * (1.0 - share) + s.slice(1, v, 1).unsqueeze(2) * share
    return g.op("Concat", between.reshape(-1, M - 1), s.slice(v - 1, v, 1), axis=1)


def _identity(g: Graph, size: Value) -> Value:
    order = g.op("Range", g.constant(0, np.int64), size, g.constant(1, np.int64))
    return _same(g, order)


def _same(g: Graph, labels: Value) -> Value:
    """1 where two labels (N,) agree, else 0: (N, N)."""
    return g.op("Equal", labels.unsqueeze(1), labels.unsqueeze(0)).real()


def _outer(factors: Value) -> Value:
    return factors @ factors.transpose(0, 2, 1)


def _size(g: Graph, value: Value, axis: int) -> Value:
    return g.op("Shape", value).slice(axis, axis + 1, 0).squeeze(0)


__all__: Sequence[str] = ["INPUTS", "build"]
