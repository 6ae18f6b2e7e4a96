"""Turns an observation into whitened rows: `camssf.recovery.linear_model` and `covariance` as nodes, same names.

The algebra works on the 5-nm nodes: integrals are folded onto them (`fold`), curves interpolated at the end
(`unfold`). Rows are ordered patch by patch: without modes Σ is one block of 3 k rows a patch plus a low-rank part,
and `Folded.sparse` whitens the two separately.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from camssf.grid import STEP
from camssf.recovery.basis import Basis
from camssf.recovery.covariance import CHANNEL_SHARE, EDGE, FLOOR, INDEPENDENT_SHARE
from camssf.recovery.linear_model import DARKEST
from camssf_onnx.algebra import (
    I64,
    D,
    M,
    fold,
    identity,
    outer,
    size_of,
    slope,
    sum_of_squares,
    unfold,
    whiten,
    whiten_and_root,
)
from camssf_onnx.covariance import Errors, LinearisedSignals, covariance, errors_by_source
from camssf_onnx.graph import Body, Graph, Value, within
from camssf_onnx.sensitivity import Answer, moves_of_peak_one, variance_of_curves

EYE = np.eye(3)


@dataclass(frozen=True)
class Whitened:
    """p problems in rows of unit covariance: A (p, N, R), b (p, N).

    With a prior p is h, one problem a hypothesis, with ln det Σ (h,), D of the lamp modes (h, N, k q) and of the gain
    modes (h, N, k g), and the errors by source; else None.
    """

    A: Value
    b: Value
    log_det: Value | None = None
    modes: Value | None = None
    gains: Value | None = None
    errors: Errors | None = None


# From the code (3, r) and its covariance (3, r, r), one block a channel, to the curves and what follows from them.
Curves = Callable[[Value, Value | None], Answer]


class Rows:
    """Eq. (5) and the integrals that every basis needs. Channels come first: (3, k, n); hypotheses before all: h."""

    def __init__(self, g: Graph, given: dict[str, Value]) -> None:
        self.g, self.given = g, given
        white = given["white"] - given["dark"]
        self.white_signal = white
        self.signals = (given["chart"] - given["dark"]) / white
        self.y = self.signals.transpose(2, 0, 1)
        self.error = given["standard_error"].transpose(2, 0, 1)
        self.power = given["lamp"] * STEP  # (h, k, m)
        self.seen_white = self.power * given["white_reflectance"].unsqueeze(1)  # (h, k, m)

    def gain(self) -> Value:
        """Raw white signal of the first shot relative to green, (3,)."""
        first = self.white_signal.slice(0, 1, 0)
        means = self.g.op("ReduceMean", first, self.g.ints(0, 1), keepdims=0)
        return means / means.slice(1, 2, 0)


def paper_rows(g: Graph, rows: Rows, basis: Basis) -> tuple[Whitened, Curves]:
    """F Ψ x = y with F = R L dλ, L scaled so that Σ ρ_w L dλ = 1; Σ diagonal. One shot, one problem a channel."""
    atoms = g.constant(basis.dictionary[0], name="dictionary")  # (m, r)
    seen_white, reflectance = (
        each.slice(0, 1, 0).squeeze(0) for each in (rows.seen_white, rows.given["reflectance"])
    )
    power, lamp = (each.slice(0, 1, 0).squeeze(0) for each in (rows.power, rows.given["lamp"]))
    scale = seen_white.slice(0, 1, 0).sum(0, 1)
    everything = power.unsqueeze(1) * reflectance  # (k, n, m)
    seen = everything.slice(0, 1, 0).squeeze(0)  # (n, m)
    b = rows.y.slice(0, 1, 1).squeeze(1)
    error = rows.error.slice(0, 1, 1).squeeze(1)
    tolerance = rows.given["chart_tolerance"] * b
    deviation = g.op("Sqrt", g.op("Max", error * error + tolerance * tolerance, FLOOR**2))  # (3, n)
    whitened = Whitened(((seen / scale) @ atoms).unsqueeze(0) / deviation.unsqueeze(2), b / deviation)

    def curves(x: Value, spread: Value | None) -> Answer:
        del spread  # no prior, no band
        s = atoms @ x.transpose(1, 0)  # (m, 3)
        s = s / (seen_white.slice(0, 1, 0) @ s)
        response = seen_white @ s
        return Answer(s, s * np.nan, (everything @ s) / response.unsqueeze(1), lamp, response)

    return whitened, curves


def learned_rows(g: Graph, rows: Rows, basis: Basis, prior_scale: Value) -> tuple[Whitened, Curves]:
    """Rows free of exposure, whitened by their full covariance, on the 5-nm nodes (`camssf.recovery.linear_model`).

    One Loop whose body computes the rows at a point: one turn if there are no modes, else two, the first of which is
    `_first_pass`.
    """
    given = rows.given
    nodes = basis.mean[:, ::10]
    mean = g.constant(nodes, name="mean")  # (3, v)
    atoms = prior_scale * g.constant(basis.dictionary[:, ::10], name="dictionary")  # (3, v, r)
    v, r = basis.dictionary[:, ::10].shape[1:]
    shape = g.op("Shape", rows.signals)
    k, n = shape.slice(0, 1, 0), shape.slice(1, 2, 0)
    h = g.op("Shape", given["lamp"]).slice(0, 1, 0)
    given_twice = g.op("Concat", given["reflectance"], slope(g, given["reflectance"]), axis=1)  # (c, 2 n, m)
    folded = fold(g, rows.power.unsqueeze(2) * given_twice.unsqueeze(1))  # (h, k, 2 n, v)
    parts = folded.like(g.op("Concat", h, k, g.ints(2, -1, v), axis=0))
    patches, edges = parts.slice(0, 1, 2).squeeze(2), parts.slice(1, 2, 2).squeeze(2)  # (h, k, n, v) each
    whites = fold(g, g.op("Concat", rows.seen_white, rows.power, axis=1))  # (h, 2 k, v)
    pair = whites.like(g.op("Concat", h, g.ints(2, -1, v), axis=0))
    white, flat_light = pair.slice(0, 1, 1).squeeze(1), pair.slice(1, 2, 1).squeeze(1)  # (h, k, v) each
    first = white.slice(0, 1, 1).unsqueeze(1)  # (h, 1, 1, v)
    share = (first @ atoms) / (first @ mean.unsqueeze(2))  # (h, 3, 1, r)
    atoms = atoms - mean.unsqueeze(2) * share  # (h, 3, v, r), anchored to the first white

    known = fold_observation(g, rows, (mean, atoms), (patches, edges, white, flat_light), r)
    one = g.ints(1)
    start = [
        g.op("Expand", mean, g.op("Concat", h, g.ints(3, v), axis=0)),
        white * 0.0 + 1.0,
        g.op("Expand", 1.0, g.op("Concat", h, k, n, one, axis=0)),
        g.op("Expand", 0.0, g.op("Concat", h, known.K, one, axis=0)),
        g.op("Expand", 0.0, g.op("Concat", h, known.G, one, axis=0)),
        g.op("Expand", identity(g, known.K.squeeze(0)), g.op("Concat", h, known.K, known.K, axis=0)),
        g.op("Expand", np.eye(3 * r), g.op("Concat", h, g.ints(3 * r, 3 * r), axis=0)),
    ]
    turns = g.op("Cast", known.any_modes, to=I64) + g.constant(1, np.int64)
    left = g.loop(known.turn(turns), start, [D] * len(start), turns, "look")[len(start) :]
    A, b, log_det, modes, lamp, *errors = (value.slice(-1, 2**31, 0).squeeze(0) for value in left)  # the last turn's
    gains = g.op("Slice", modes, known.K, g.ints(2**31), g.ints(2))
    modes = g.op("Slice", modes, g.ints(0), known.K, g.ints(2))

    def curves(x: Value, spread: Value | None) -> Answer:
        assert spread is not None
        g = x.graph
        of_first = (each.here(g).slice(0, 1, 0).squeeze(0) for each in (atoms, white, lamp, given["lamp"]))
        psi, white_now, bend, power = of_first
        chart, rho = (given[name].here(g).slice(0, 1, 0).squeeze(0) for name in ("reflectance", "white_reflectance"))
        s = mean + (psi @ x.unsqueeze(2)).squeeze(2)  # (3, v)
        first = white_now.slice(0, 1, 0).transpose(1, 0)
        scale = (s @ first).squeeze(1)  # (3,)
        s = s / scale.unsqueeze(1)
        here, between = variance_of_curves(g, moves_of_peak_one(g, s, psi), spread)
        both = g.op("Concat", between.reshape(3, M - 1), here.slice(-1, 2**31, 1), axis=1)
        std = g.op("Sqrt", g.op("Max", both, 0.0)) / scale.unsqueeze(1)
        values = unfold(g, s).transpose(1, 0)  # (m, 3)
        light = power * unfold(g, bend)  # (k, m)
        seen = (light.unsqueeze(1) * chart) @ values
        response = (light * rho) @ values  # (k, 3)
        predicted = seen / response.unsqueeze(1)
        return Answer(values, std.transpose(1, 0), predicted, light, response * STEP * (mean @ first).squeeze(1))

    return Whitened(A, b, log_det, modes, gains, Errors(mean, atoms.slice(0, 1, 0).squeeze(0), *errors)), curves


@dataclass(frozen=True)
class Folded:
    """The observation folded onto the nodes, and constants of its rows: `_Folded` of `camssf.recovery.linear_model`.

    Hypothesis h, channel 3, shot k, patch n, mode q, gain mode g, node v, atom r; R = 3 r codes, K = k q modes,
    G = k g gain modes, N = 3 k n rows.

    Attributes:
        mean, atoms: (3, v) and (h, 3, v, r). patches, edges: (h, k, n, v). white, light: (h, k, v).
        modes: (h, k, q, v). loose: (h, k, 1, 1) whether a lamp has any. K: (1,) their number.
        gain_modes: (k, g, n). G: (1,) their number. any_modes: whether there is any, of lamps or gains.
        gains: (h, 3, k, n, k, g) their D. gain_own: size of each channel's own part relative to the gain modes.
        explain: whether the errors by source are wanted.
        y: (3, k, n, 1). noise, independent: (h n, 3 k) variance of noise and of the chart's own part.
        tolerance: (n, 1). white_tolerance: a number. lamp_tolerance: (h, 1, k, 1, 1).
        share: (3 k, 3 k) of the chart's smooth error that two rows of a patch have in common.
        own: (k, 1, k, 1), 1 where a shot is the same.
        h, by_patch, flat, blocks: shapes (h,), (h n, 3 k, -1), (h, N, -1) and (h, 3, n k, K, r).
        r: a number.
    """

    mean: Value
    atoms: Value
    patches: Value
    edges: Value
    white: Value
    light: Value
    modes: Value
    loose: Value
    K: Value
    gain_modes: Value
    G: Value
    any_modes: Value
    gains: Value
    gain_own: Value
    explain: Value
    y: Value
    noise: Value
    independent: Value
    tolerance: Value
    white_tolerance: Value
    lamp_tolerance: Value
    share: Value
    own: Value
    h: Value
    by_patch: Value
    flat: Value
    blocks: Value
    r: int

    def turn(self, turns: Value) -> Callable[[Graph, Value, list[Value]], Body]:
        """The Loop's body: computes the next point, and stacks whitened rows, ln det Σ, D and the point's lamp."""

        def body(g: Graph, step: Value, state: list[Value]) -> Body:
            here = within(self, g)
            looks = g.op("Less", step + g.constant(1, np.int64), turns.here(g))
            here = replace(here, explain=g.op("And", here.explain, g.op("Not", looks)))
            looks = looks.real()
            rows = here.rows(state)

            def loose(branch: Graph) -> list[Value]:
                inner, given = within(here, branch), [value.here(branch) for value in state]
                return inner.dense(within(rows, branch), given, looks.here(branch))

            def named(branch: Graph) -> list[Value]:
                return [*within(here, branch).sparse(within(rows, branch)), *(value.here(branch) for value in state)]

            A, b, log_det, modes, *errors = g.choose(here.any_modes, loose, named, "sense")
            errors, after = errors[:4], errors[4:]
            return Body([value * 1.0 for value in after], [A, b, log_det, modes, state[1] * 1.0, *errors])

        return body

    def rows(self, state: Sequence[Value]) -> Rowed:
        """A, b and the parts of Σ at a point, patch by patch."""
        curve, lamp, level, *_ = state
        y = self.y * level.unsqueeze(1)  # (h, 3, k, n, 1)
        s = curve.unsqueeze(2, 4)  # (h, 3, 1, v, 1)
        bend = lamp.unsqueeze(2)  # (h, k, 1, v)
        W = curve @ (self.white * lamp).transpose(0, 2, 1)  # (h, 3, k)
        seen = (self.patches * bend).unsqueeze(1) / W.unsqueeze(3, 4)  # (h, 3, k, n, v)
        white = ((self.white * lamp).unsqueeze(1) / W.unsqueeze(3)).unsqueeze(3)  # (h, 3, k, 1, v)
        light = ((self.light * lamp).unsqueeze(1) / W.unsqueeze(3)).unsqueeze(3)
        expected = seen @ s  # (h, 3, k, n, 1) ŷ
        g = expected.graph
        about = g.op("Where", self.loose.unsqueeze(1), expected, y)
        a = seen - about * white
        against_white = seen - expected * white
        A = (a @ self.atoms.unsqueeze(2)).unsqueeze(4) * EYE[:, None, None, :, None]  # (h, 3, k, n, 3, r)
        b = y - about - a @ self.mean.unsqueeze(1, 3)
        edges = (EDGE * self.edges * bend).unsqueeze(1) / W.unsqueeze(3, 4)
        level = g.op("Expand", level.unsqueeze(1), g.op("Shape", y))
        chart, common, noise = covariance(
            self, LinearisedSignals(s, expected, level, seen, edges, light, white, against_white)
        )
        rows = self.patchwise(A, 1), self.patchwise(b)
        block = chart + noise * identity(g, size_of(g, chart, 1))
        return Rowed(*rows, block, chart, common, noise, W, against_white, white)

    def patchwise(self, rows: Value, more: int = 0) -> Value:
        """(h, 3, k, n, columns), with `more` axes of columns, → (h n, 3 k, columns)."""
        return rows.transpose(0, 3, 1, 2, *range(4, 5 + more)).like(self.by_patch)

    def sparse(self, rows: Rowed) -> list[Value]:
        """L⁻¹ A (h, N', R), L⁻¹ b (h, N'), ln det Σ (h,) and L⁻¹ D = 0, where Σ = B + U Uᵀ with B block diagonal.

        Then the errors by source.

        The rows are whitened by B first; then Σ is I + U Uᵀ. With S = I + Uᵀ U and V = S⁻¹ Uᵀ (A b), the rows
        (A b) - U V, with V below them, have the same products as whitened rows: those of the least squares that
        solves for U's unknowns w ~ N(0, I) together with the code. An error of V changes them in second order only.
        """
        g = rows.b.graph
        every = g.op("Concat", rows.A, rows.b, rows.common, axis=2)
        unit = identity(g, size_of(g, rows.block, 1)) + 0.0 * rows.block
        blocks, log_blocks = whiten(g, rows.block, g.op("Concat", unit, every, axis=2), 3)
        size = size_of(g, rows.block, 1).unsqueeze(0)
        root = g.op("Slice", blocks, g.ints(0), size, g.ints(2))  # L⁻¹ of each block
        every = g.op("Slice", blocks, size, g.ints(2**31), g.ints(2)).like(self.flat)
        own, U = every.slice(0, 3 * self.r + 1, 2), every.slice(3 * self.r + 1, 2**31, 2)
        across = U.transpose(0, 2, 1)
        count = size_of(g, U, 2)
        S = identity(g, count) + across @ U
        one = identity(g, count) + 0.0 * S
        found, log_common = whiten(g, S, g.op("Concat", across @ own, one, axis=2))
        found, back = found.slice(0, 3 * self.r + 1, 2), found.slice(3 * self.r + 1, 2**31, 2)
        V = back.transpose(0, 2, 1) @ found
        rest = own - U @ V
        joined = g.op("Concat", rest, V, axis=1)
        A, b = joined.slice(0, 3 * self.r, 2), joined.slice(3 * self.r, 3 * self.r + 1, 2).squeeze(2)
        none = b.unsqueeze(2) * g.op("Expand", 0.0, self.K + self.G)  # (h, N', K + G)
        plain = rest.slice(0, 3 * self.r, 2)

        def solved(g: Graph) -> tuple[Value, Value, Value, Value]:
            back = root.here(g).transpose(0, 2, 1)
            E = (back @ plain.here(g).like(self.by_patch)).like(self.flat)
            no_gains = 0.0 * self.patchwise(self.gains.here(g), 1).like(self.flat)
            no_term = g.op("Expand", 0.0, g.ints(1, 3 * self.r, 3 * self.r))
            return g.op("Concat", E, no_gains, axis=2), no_term, no_term, 0.0 * rows.noise.here(g).like(self.flat)

        log_det = log_blocks.like(g.op("Concat", self.h, g.ints(-1), axis=0)).sum(1) + log_common
        return [A, b, log_det, none, *errors_by_source(self, rows, solved)]

    def dense(self, rows: Rowed, state: Sequence[Value], looks: Value) -> list[Value]:
        """As `sparse` where there are modes, from the whole Σ, and the next point: `_first_pass`.

        Σ contains D Dᵀ, but in a first pass A Aᵀ instead.
        """
        _, _, _, offset, gained, mode_covariance, code_covariance = state
        g, r = rows.b.graph, self.r
        A, b, U = (each.like(self.flat) for each in (rows.A, rows.b, rows.common))
        N = size_of(g, b, 1)
        three_k = size_of(g, rows.block, 1)
        n = g.op("Div", N, three_k)
        block = rows.block.like(g.op("Concat", self.h, n.unsqueeze(0), three_k.unsqueeze(0), g.ints(-1), axis=0))
        spaced = block.unsqueeze(3) * identity(g, n).unsqueeze(1, 3)  # (h, n, 3 k, n, 3 k)
        N = N.unsqueeze(0)
        sigma = spaced.like(g.op("Concat", self.h, N, N, axis=0)) + outer(U)
        modes, bent = self.bend(rows, state)
        curvature = self.curvature(bent, mode_covariance, code_covariance)
        sigma = sigma + curvature
        gains = self.patchwise(self.gains, 1).like(self.flat)
        each_channel = self.gains.unsqueeze(4) * EYE[:, None, None, :, None, None]  # (h, 3, k, n, 3, k, g)
        own = self.gain_own * self.patchwise(each_channel, 2).like(self.flat)
        b = b + modes @ offset + gains @ gained
        by_lamps, modes = modes, g.op("Concat", modes, gains, axis=2)
        sigma = sigma + outer(own) + (1.0 - looks) * outer(modes) + looks * outer(A)
        columns, log_det, root = whiten_and_root(g, sigma, g.op("Concat", A, b, modes, axis=2))
        whitened = columns
        A, b, modes = (
            columns.slice(0, 3 * r, 2),
            columns.slice(3 * r, 3 * r + 1, 2),
            columns.slice(3 * r + 1, 2**31, 2),
        )

        def solved(g: Graph) -> tuple[Value, Value, Value, Value]:
            E = g.op("Slice", root.solve(whitened.here(g)), g.ints(0), N, g.ints(1))  # Σ⁻¹ (A, b, D)
            of_code = E.slice(0, 3 * r, 2)
            of_gains = g.op("Slice", E, self.K.here(g) + g.ints(3 * r + 1), g.ints(2**31), g.ints(2))
            across = of_code.transpose(0, 2, 1)
            lamps = outer(across @ by_lamps) + across @ curvature.here(g) @ of_code
            own_curvature = (curvature.here(g) * identity(g, N.here(g).squeeze(0))).sum(2, keep=True)
            variance = sum_of_squares(g.op("Concat", by_lamps, own, axis=2)) + own_curvature
            uneven = outer(across @ gains) + outer(across @ own)
            return g.op("Concat", of_code, of_gains, axis=2), lamps, uneven, variance

        errors = errors_by_source(self, rows, solved)
        return [A, b.squeeze(2), log_det, modes, *errors, *self.after(A, b, modes)]

    def bend(self, rows: Rowed, state: Sequence[Value]) -> tuple[Value, Value]:
        """D (h, N, K) and B (h, 3, n k, K, r) of `camssf.recovery.linear_model`: a row by its own channel's code."""
        curve, lamp, *_ = state
        relative = rows.against_white / lamp.unsqueeze(1, 3)  # the modes are relative to the lamp as given
        across = self.modes.transpose(0, 1, 3, 2).unsqueeze(1)  # (h, 1, k, v, q)
        atoms = self.atoms.unsqueeze(2)  # (h, 3, 1, v, r)
        s = curve.unsqueeze(2, 3)  # (h, 3, 1, 1, v)
        steps = (relative * s) @ across  # (h, 3, k, n, q)
        bent = (relative.unsqueeze(4) * self.modes.unsqueeze(1, 3)) @ atoms.unsqueeze(2)  # (h, 3, k, n, q, r)
        off = (rows.white / lamp.unsqueeze(1, 3) * s) @ across  # (h, 3, k, 1, q)
        bent = bent - off.unsqueeze(5) * (rows.against_white @ atoms).unsqueeze(4)
        bent = bent - steps.unsqueeze(5) * (rows.white @ atoms).unsqueeze(4)
        D_ = steps.unsqueeze(4) * self.own  # (h, 3, k, n, k, q)
        B_ = (bent.unsqueeze(4) * self.own.unsqueeze(4)).transpose(0, 1, 3, 2, 4, 5, 6).like(self.blocks)
        return self.patchwise(D_, 1).like(self.flat), B_

    def curvature(self, B_: Value, mode_covariance: Value, code_covariance: Value) -> Value:
        """Σ over q, r, p, s of B_qr C_qp X_rs B_ps, (h, N, N); two channels have their block of X in common."""
        g, r = B_.graph, self.r
        X = code_covariance.reshape(-1, 3, r, 3, r).transpose(0, 1, 3, 2, 4)  # (h, 3, 3, r, r)
        left = mode_covariance.unsqueeze(1, 2) @ B_  # (h, 3, n k, K, r)
        left = left.like(g.op("Concat", self.h, g.ints(3, 1, -1, r), axis=0)) @ X  # (h, 3, 3, n k K, r)
        codes = self.K * g.ints(r)
        left = left.like(g.op("Concat", self.h, g.ints(3, 3, -1), codes, axis=0))
        across = B_.like(g.op("Concat", self.h, g.ints(1, 3, -1), codes, axis=0)).transpose(0, 1, 2, 4, 3)
        k, N = g.op("Shape", self.white).slice(1, 2, 0), self.flat.slice(1, 2, 0)
        spread = left @ across  # (h, 3, 3, n k, n k)
        spread = spread.like(g.op("Concat", self.h, g.ints(3, 3, -1), k, g.op("Div", N, k * g.ints(3)), k, axis=0))
        return spread.transpose(0, 3, 1, 4, 5, 2, 6).like(g.op("Concat", self.h, N, N, axis=0))

    def after(self, A: Value, b: Value, modes: Value) -> list[Value]:
        """The next point, from rows whitened with A Aᵀ in Σ; `modes` is D of the lamps, then of the gains."""
        g = b.graph
        turned = modes.transpose(0, 2, 1)
        precision = identity(g, (self.K + self.G).squeeze(0)) + turned @ modes
        one = identity(g, (self.K + self.G).squeeze(0)) + 0.0 * precision
        root, _ = whiten(g, precision, g.op("Concat", turned @ b, one, axis=2), 1)
        pull, back = root.slice(0, 1, 2), root.slice(1, 2**31, 2)
        turned = back.transpose(0, 2, 1)
        found, of_all = turned @ pull, turned @ back  # (h, K + G, 1), (h, K + G, K + G)
        across = A.transpose(0, 2, 1)
        code = (across @ (b - modes @ found)).reshape(-1, 3, self.r, 1)
        curve = self.mean + (self.atoms @ code).squeeze(3)
        offset = g.op("Slice", found, g.ints(0), self.K, g.ints(1))
        gained = g.op("Slice", found, self.K, g.ints(2**31), g.ints(1))
        mode_covariance = g.op("Slice", of_all, g.ints(0, 0), g.op("Concat", self.K, self.K, axis=0), g.ints(1, 2))
        size = g.op("Concat", g.op("Shape", self.white).slice(0, 2, 0), g.ints(1, -1), axis=0)
        bend = 1.0 + (offset.like(size) @ self.modes).squeeze(2)  # (h, k, v)
        level = 1.0 - (gained.like(size) @ self.gain_modes).squeeze(2)  # (h, k, n)
        return [
            curve, g.op("Max", bend, DARKEST), g.op("Max", level, DARKEST).unsqueeze(3), offset, gained,
            mode_covariance, np.eye(3 * self.r) - across @ A,
        ]  # fmt: skip


@dataclass(frozen=True)
class Rowed:
    """Rows at a point, patch by patch, and the parts of Σ without modes.

    Attributes:
        A, b: (h n, 3 k, R) and (h n, 3 k, 1).
        block: (h n, 3 k, 3 k) covariance within a patch, `chart` plus `noise`. chart: (h n, 3 k, 3 k).
        common: (h n, 3 k, u) U of the errors common to the patches. noise: (h n, 3 k, 1). white_signal: (h, 3, k) W.
        against_white, white: (h, 3, k, n, v) and (h, 3, k, 1, v), for the modes.
    """

    A: Value
    b: Value
    block: Value
    chart: Value
    common: Value
    noise: Value
    white_signal: Value
    against_white: Value
    white: Value


def fold_observation(
    g: Graph, rows: Rows, basis: tuple[Value, Value], scenes: tuple[Value, Value, Value, Value], r: int
) -> Folded:
    """Fold the observation for the rows; `basis` is mean and anchored atoms, `scenes` the folded integrals."""
    mean, atoms = basis
    given = rows.given
    shape = g.op("Shape", rows.y)
    k, n = shape.slice(1, 2, 0), shape.slice(2, 3, 0)
    h = g.op("Shape", given["lamp"]).slice(0, 1, 0)
    steps = g.constant([10], np.int64)
    modes = g.op("Slice", given["lamp_modes"], g.ints(0), g.ints(M), g.ints(3), steps)  # (h, k, q, v)
    sizes = g.op("ReduceMax", g.op("Abs", modes), g.ints(2, 3), keepdims=1)  # (h, k, 1, 1)
    K = k * g.op("Shape", modes).slice(2, 3, 0)
    independent = INDEPENDENT_SHARE * given["chart_tolerance"] * rows.y
    three_k = k * g.constant([3], np.int64)
    by_row = g.op("Concat", h * n, three_k, axis=0)
    of_each = g.op("Concat", h, g.ints(1, 1, 1), axis=0)
    noise, own_chart = (
        g.op("Expand", (each * each).transpose(2, 0, 1), of_each).like(by_row) for each in (rows.error, independent)
    )
    share = g.op("Expand", CHANNEL_SHARE + (1.0 - CHANNEL_SHARE) * EYE[:, None, :, None],
                 g.op("Concat", g.ints(3), k, g.ints(3), k, axis=0))  # fmt: skip
    patches, edges, white, light = scenes
    loose = g.op("Greater", sizes, 0.0)
    gain_modes = given["gain_modes"]
    uneven = g.op("Greater", g.op("Abs", gain_modes).max(0, 1, 2), 0.0)
    own = identity(g, k.squeeze(0)).unsqueeze(1, 3)
    gains = (rows.y.unsqueeze(3) * gain_modes.transpose(0, 2, 1)).unsqueeze(3) * own  # (3, k, n, k, g)
    return Folded(
        mean, atoms, patches, edges, white, light,
        modes, loose, K,
        gain_modes, k * g.op("Shape", gain_modes).slice(1, 2, 0),
        g.op("Or", g.op("Greater", sizes.max(0, 1, 2, 3), 0.0), uneven),
        g.op("Expand", gains, g.op("Concat", h, g.ints(1, 1, 1, 1, 1), axis=0)), given["gain_own"],
        g.op("Greater", given["explain"], 0.5),
        rows.y.unsqueeze(3),
        noise,
        own_chart,
        given["chart_tolerance"].unsqueeze(1),
        given["white_tolerance"],
        given["lamp_tolerance"].unsqueeze(1, 3, 4),
        share.like(g.op("Concat", three_k, three_k, axis=0)),
        own,
        h,
        g.op("Concat", h * n, three_k, g.ints(-1), axis=0),
        g.op("Concat", h, n * three_k, g.ints(-1), axis=0),
        g.op("Concat", h, g.ints(3, -1), K, g.ints(r), axis=0),
        r,
    )  # fmt: skip
