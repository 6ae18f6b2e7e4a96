"""Turns an observation into a linear model: the rows that the curves must satisfy, and their covariance.

Letters as in the paper: R reflectance, L lamp, Ψ basis, x code, y signals. ρ_w is the white reference.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, fold, interpolate
from camssf.recovery.covariance import EDGE, FLOOR, LinearisedSignals, Tolerances, covariance, outer
from camssf.recovery.elastic_net import whiten
from camssf.recovery.observation import Observation

DARKEST = 0.02
"""Lower limit of the factors by which lamp modes and gain modes change the light."""
SOURCES = ("noise", "chart", "white", "lamp", "lamp modes", "uneven light")


STACK = 7
"""Largest number of observations computed in one go: more would not fit into the processor's cache."""


@dataclass(frozen=True)
class LinearModel:
    """Linear models b = A x + error, error ~ N(0, Σ), of p problems.

    On a basis with a mean p = 1: x = (x_R, x_G, x_B) and N = 3 k n rows, channel by channel, shot by shot, patch by
    patch. On the paper's basis p = 3, one problem a channel, of N = n rows.

    Attributes:
        matrix: (p, N, r) A.
        target: (p, N) b.
        covariance: (p, N, N) Σ.
        terms: the summands of Σ by source, (p, N, N) each.
        lamp: (k, 681) each shot's lamp in the rows: the given lamp, changed by the estimate of its modes.
        white: (3, k) W, the white signals that the rows are divided by.
        modes: (N, k q) D, derivatives of the rows by the lamp modes; D Dᵀ is included in `terms`.
        gains: (N, k g) D of the gain modes; also included in `terms`.
    """

    matrix: Floats
    target: Floats
    covariance: Floats
    terms: dict[str, Floats] = field(default_factory=dict)
    lamp: Floats = field(default_factory=lambda: np.zeros((0, WAVELENGTHS.size)))
    white: Floats = field(default_factory=lambda: np.zeros((3, 0)))
    modes: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    gains: Floats = field(default_factory=lambda: np.zeros((0, 0)))


def anchor(basis: Basis, white: Floats) -> Basis:
    """The basis with its scale fixed by a shot's white: no atom changes Σ white s dλ.

    Rows do not depend on the scale of s. If the white signal were free, the noise of every row would be proportional
    to it, and the smallest residual would belong to a camera of low sensitivity. To first order in the code,
    s / (w s) · (w μ) = μ + (Ψ - μ (w Ψ) / (w μ)) x.

    Args:
        basis: one without a mean is returned unchanged.
        white: (681,) ρ_w L of the first shot.
    """
    if not basis.mean.any():
        return basis
    share = np.einsum("m,cmr->cr", white, basis.dictionary) / (basis.mean @ white)[:, None]
    return replace(basis, dictionary=basis.dictionary - basis.mean[:, :, None] * share[:, None, :])


def linear_model(observation: Observation, basis: Basis) -> LinearModel:
    """The linear model of one observation; see `linear_models`."""
    return linear_models([observation], basis)[0]


def linear_models(observations: Sequence[Observation], basis: Basis) -> list[LinearModel]:
    """The rows and their covariance (docs/maths.md, "The rows" and "What the rows' errors have in common").

    Without a mean (the paper's basis, one shot): F s = y with F = R L dλ, L scaled so that Σ ρ_w L dλ = 1;
    Σ is diagonal, se² + (τ y)².

    With a mean, the three channels are one problem, since errors of chart, white and lamp are common to them.
    About s₀ = μ, W_cj = Σ ρ_w L_j s₀ dλ and ŷ_cij = Σ R_i L_j s₀ dλ / W_cj, where s₀ is channel c's:

        row       a_cij = (R_i - y_cij ρ_w) L_j dλ / W_cj,   A = a Ψ,   b = -a μ
        noise     se_cij² + (τ_i y_cij / 20)²                          independent
        chart     Σ ε_i L_j s₀ dλ / W_cj                               one ε_i a patch, for all shots; 0.7 of its
                                                                       variance common to the channels
        white     -ŷ_cij Σ ρ_w ε_w L_j s₀ dλ / W_cj                    one ε_w for all rows
        lamp      Σ (R_i - ŷ_cij ρ_w) L_j η_j s₀ dλ / W_cj             one smooth η_j a shot, for all channels
                  ŷ_cij / 100                                          drift of the light: one a shot, all channels

    The errors of lamp and white enter with the predicted ŷ, not with the measured y: otherwise a mere change of
    scale could explain the signals. For the same reason Ψ is anchored to the first shot's white.

    Lamp modes m_q have unknown amplitudes u ~ N(0, I): the lamp is L_j (1 + Σ u_jq m_jq), the same u for the three
    channels. It can be far from its mean, so `_first_pass` first estimates û and x̂. Then all of the above is
    computed again with L_j (1 + Σ û m) for L_j and μ + Ψ x̂ for s₀. In those shots' rows a_cij has ŷ in place of y,
    and b gains y - ŷ. With the covariances C of u and X of x from the first pass (C = I and X = I in the first pass):

        modes     D_jq = Σ (R_i - ŷ_cij ρ_w) L_j m_jq s₀ dλ / W_cj,   b += D û,   covariance D Dᵀ
        curvature Σ over q, r, p, s of B_qr C_qp X_rs B_ps with B_qr = ∂²y / ∂u_q ∂x_r: the derivative of the signals
                  by the code depends on the lamp

    Gain modes φ_q describe uneven light on the patches: in even light the signals would be y_cij (1 - h_ij) with
    h_ij = Σ v_jq φ_jq(i), v ~ N(0, I), the same h for the three channels. With the measured y the rows are exactly
    linear in v; with predicted signals h (y (1 - h) - ŷ) would remain. The first pass estimates v together with u.
    The second pass has y (1 - ĥ) for y in all of the above, but not in these:

        gains     D_jq = y_cij φ_jq(i),   b += D v̂,   covariance D Dᵀ
                  κ² D Dᵀ within a channel: gains that differ a little from channel to channel

    Observations with equal shapes, as hypotheses on the lamps of one capture, are computed in one go.
    """
    if not basis.mean.any():
        return [_paper_rows(observation, basis) for observation in observations]
    found: dict[int, LinearModel] = {}
    alike: dict[tuple[object, ...], list[int]] = {}
    for i, each in enumerate(observations):
        adjusted = bool(each.lamp_modes.any() or each.gain_modes.any())
        shapes = each.signals.shape, each.lamp_modes.shape, each.gain_modes.shape, adjusted
        alike.setdefault(shapes, []).append(i)
    for group in alike.values():
        for start in range(0, len(group), STACK):
            some = group[start : start + STACK]
            found |= zip(some, _rows_of([observations[i] for i in some], basis), strict=True)
    return [found[i] for i in range(len(observations))]


def _rows_of(observations: Sequence[Observation], basis: Basis) -> Iterator[LinearModel]:
    """The linear models of observations with equal shapes, all with modes or all without."""
    given = _fold(observations, basis)
    point = _first_pass(given) if given.modes.any() or given.gains.any() else _start(given)
    rows = _rows(given, point)
    rows.terms["lamp modes"] += outer(rows.modes)
    rows.terms["uneven light"] += outer(rows.gains)
    covariances = _total(rows.terms)
    lamps = interpolate(np.swapaxes(point.lamp, -1, -2))
    whites = point.curves @ np.swapaxes(given.white * point.lamp, -1, -2)
    for i, observation in enumerate(observations):
        terms = {source: rows.terms[source][i : i + 1] for source in SOURCES}
        yield LinearModel(
            rows.matrix[i : i + 1], rows.target[i : i + 1], covariances[i : i + 1], terms,
            observation.lamp * lamps[i].T, whites[i], rows.modes[i], rows.gains[i],
        )  # fmt: skip


@dataclass(frozen=True)
class _Folded:
    """A stack of h observations with every integral over the grid folded onto the v nodes.

    Attributes:
        signals, standard_error: (h, 3, k, n), MASKED_STANDARD_ERROR for masked signals.
        chart_tolerance, lamp_tolerance, white_tolerance: (h, n), (h, k) and (h, 1, 1).
        modes: (h, k, q, v) lamp modes.
        gains, gain_own: (h, k, g, n) gain modes, and (h, 1, 1).
        mean, atoms: (3, v) μ and (h, 3, v, r) Ψ, anchored.
        patches, edges: (h, k, n, v) R L dλ and 70 nm · dR/dλ L dλ.
        white, light: (h, k, v) ρ_w L dλ and L dλ.
    """

    signals: Floats
    standard_error: Floats
    chart_tolerance: Floats
    lamp_tolerance: Floats
    white_tolerance: Floats
    modes: Floats
    gains: Floats
    gain_own: Floats
    mean: Floats
    atoms: Floats
    patches: Floats
    edges: Floats
    white: Floats
    light: Floats


def _fold(observations: Sequence[Observation], basis: Basis) -> _Folded:
    """Stack and fold observations with equal shapes."""

    def stack(name: str) -> Floats:
        return np.stack([getattr(each, name) for each in observations])

    charts = [each.reflectance for each in observations]
    reflectance = np.stack(charts[:1] if all(each is charts[0] for each in charts) else charts)
    power, rho = stack("lamp") * STEP, stack("white_reflectance")[:, None]
    slope = EDGE * np.gradient(reflectance, STEP, axis=-1)
    white, mean, atoms = fold(power * rho), basis.mean[:, ::10], basis.dictionary[:, ::10]
    first = white[:, :1, None]  # (h, 1, 1, v): the scale is fixed by the first shot's white, as in `anchor`
    errors = np.stack([each.errors(basis) for each in observations])
    return _Folded(
        np.moveaxis(stack("signals"), -1, 1),
        np.moveaxis(errors, -1, 1),
        stack("chart_tolerance"),
        stack("lamp_tolerance"),
        stack("white_tolerance")[:, None, None],
        stack("lamp_modes")[..., ::10],
        stack("gain_modes"),
        stack("gain_own")[:, None, None],
        mean,
        atoms - mean[..., None] * ((first @ atoms) / (first @ mean[..., None])),
        fold(power[:, :, None] * reflectance[:, None]),
        fold(power[:, :, None] * slope[:, None]),
        white,
        fold(power),
    )


@dataclass(frozen=True)
class _Expansion:
    """The linearisation points of h hypotheses: curves, lamps and gains, with the covariances of modes and code.

    Attributes:
        curves: (h, 3, v) s₀.
        lamp: (h, k, v) 1 + Σ û m.
        level: (h, k, n) 1 - ĥ.
        offset: (h, k q) û.
        gained: (h, k g) v̂.
        mode_covariance: (h, k q, k q) covariance of u.
        code_covariance: (h, 3 r, 3 r) covariance of x.
    """

    curves: Floats
    lamp: Floats
    level: Floats
    offset: Floats
    gained: Floats
    mode_covariance: Floats
    code_covariance: Floats


@dataclass(frozen=True)
class _Rows:
    """The models at points: A, b, D of lamps (h, N, k q) and of gains (h, N, k g), and Σ by source without D Dᵀ."""

    matrix: Floats
    target: Floats
    modes: Floats
    gains: Floats
    terms: dict[str, Floats]


def _start(given: _Folded) -> _Expansion:
    """The linearisation point at the prior means: μ, the lamp as given, even light; u and x ~ N(0, I)."""
    (h, k, q, v), (_, _, g, n), r = given.modes.shape, given.gains.shape, given.atoms.shape[-1]
    one = np.ones((h, 1, 1))
    return _Expansion(
        one * given.mean, np.ones((h, k, v)), np.ones((h, k, n)), np.zeros((h, k * q)), np.zeros((h, k * g)),
        one * np.eye(k * q), one * np.eye(3 * r),
    )  # fmt: skip


def _first_pass(given: _Folded) -> _Expansion:
    """Gaussian posterior of lamps, gains and curves, from rows linearised at the prior means.

    With P = Σ + A Aᵀ, and D of both u and v, Λ = Dᵀ P⁻¹ D and h = Dᵀ P⁻¹ b: û = C h with C = (I + Λ)⁻¹, and
    x̂ = Aᵀ P⁻¹ (b - D û). `code_covariance` is the one given lamps and gains, I - Aᵀ P⁻¹ A.
    """
    rows = _rows(given, _start(given))
    # Whitened by P = L Lᵀ: an explicit P⁻¹ loses twice the digits, and modes may raise P's condition above 1e12.
    spread = _total(rows.terms)
    spread += outer(rows.matrix)
    columns, target, _ = whiten(np.concatenate([rows.matrix, rows.modes, rows.gains], axis=-1), rows.target, spread)
    r, target = rows.matrix.shape[-1], target[..., None]
    matrix, modes = columns[..., :r], columns[..., r:]
    across = np.swapaxes(modes, -1, -2)
    precision = np.eye(modes.shape[-1]) + across @ modes
    root, pull, _ = whiten(
        np.broadcast_to(np.eye(precision.shape[-1]), precision.shape), (across @ target)[..., 0], precision
    )
    back = np.swapaxes(root, -1, -2)
    found = back @ pull[..., None]
    (h, k, q, _), lamps = given.modes.shape, rows.modes.shape[-1]
    code = (np.swapaxes(matrix, -1, -2) @ (target - modes @ found)).reshape(h, 3, -1, 1)
    offset, gained = found[:, :lamps, 0], found[:, lamps:, 0]
    bend = 1.0 + (offset.reshape(h, k, 1, q) @ given.modes)[:, :, 0]
    return _Expansion(
        given.mean + (given.atoms @ code)[..., 0],
        np.maximum(bend, DARKEST),
        levels(gained.reshape(h, k, -1), given.gains),
        offset,
        gained,
        outer(back[:, :lamps]),
        np.eye(r) - np.swapaxes(matrix, -1, -2) @ matrix,
    )


def _total(terms: dict[str, Floats]) -> Floats:
    """Sum of the terms, in place: a new stack of matrices for each sum would cost more than the sum."""
    total = np.zeros_like(terms["noise"])
    for term in terms.values():
        total += term
    return total


def _rows(given: _Folded, point: _Expansion) -> _Rows:
    """The rows at points. A has ŷ in place of y if the shot's lamp has modes, since y is not linear in them."""
    h, _, k, n = given.signals.shape
    y = given.signals * point.level[:, None]
    curve = point.curves
    white = curve @ np.swapaxes(given.white * point.lamp, -1, -2)  # (h, 3, k) W
    per_white = (point.lamp[:, None] / white[..., None])[:, :, :, None]  # (h, 3, k, 1, v)
    patches = given.patches[:, None] * per_white  # (h, 3, k, n, v) R L dλ / W
    seen_white = given.white[:, None, :, None] * per_white  # (h, 3, k, 1, v)
    expected = (patches @ curve[:, :, None, :, None])[..., 0]  # ŷ
    lamp_has_modes = np.any(given.modes, axis=(2, 3))[:, None, :, None]
    about = np.where(lamp_has_modes, expected, y)
    a = patches - about[..., None] * seen_white
    matrix = a @ given.atoms[:, :, None]
    target = (y - about) - (a @ given.mean[:, None, :, None])[..., 0]

    s = curve[:, :, None, None]
    channel, shot, patch = (index.ravel() for index in np.indices((3, k, n)))
    seen = LinearisedSignals(
        channel, shot, patch,
        *(part.reshape(h, -1) for part in (y, expected, given.standard_error * point.level[:, None])),
        *(np.broadcast_to(part * s, patches.shape).reshape(h, 3 * k * n, -1) for part in (
            patches, given.edges[:, None] * per_white, given.light[:, None, :, None] * per_white, seen_white,
        )),
    )  # fmt: skip
    known = Tolerances(given.chart_tolerance[:, patch], given.white_tolerance, given.lamp_tolerance[:, shot])
    terms = covariance(seen, known)
    relative = (patches - expected[..., None] * seen_white) / point.lamp[:, None, :, None]
    modes, terms["lamp modes"] = _bend(given, point, relative, seen_white / point.lamp[:, None, :, None])
    gains = gain_rows(given.signals, given.gains)
    terms["uneven light"] = (channel[:, None] == channel) * (given.gain_own**2 * outer(gains))
    target = target.reshape(h, -1) + (modes @ point.offset[..., None] + gains @ point.gained[..., None])[..., 0]
    return _Rows(_by_channel(matrix.reshape(h, 3, k * n, -1)), target, modes, gains, terms)


def _bend(given: _Folded, point: _Expansion, a: Floats, white: Floats) -> tuple[Floats, Floats]:
    """D = ∂y / ∂u (h, N, k q) of the lamp modes, and the covariance (h, N, N) of the curvature B = ∂²y / ∂u ∂x.

    a is (R - ŷ ρ_w) L dλ / W, (h, 3, k, n, v), and white ρ_w L dλ / W, (h, 3, k, 1, v), of the lamps as given.
    """
    (h, k, q, _), (*_, n, _), r = given.modes.shape, a.shape, given.atoms.shape[-1]
    N = 3 * k * n
    if not q:  # the usual case: a lamp without modes
        return np.zeros((h, N, 0)), np.zeros((h, N, N))
    curve, modes = point.curves[:, :, None, None], given.modes[:, None]  # (h, 3, 1, 1, v) and (h, 1, k, q, v)
    lamp, atoms = point.lamp[:, None, :, None], given.atoms[:, :, None]
    steps = (a * curve) @ np.swapaxes(modes, -1, -2)  # (h, 3, k, n, q)
    # ∂²y / ∂u ∂x, where y is a quotient N / D and D = 1: ∂²N - ∂D ∂y - ∂y ∂D
    bent = (a[..., None, :] * modes[:, :, :, None]) @ atoms[:, :, :, None]  # (h, 3, k, n, q, r)
    bent -= ((white * curve) @ np.swapaxes(modes, -1, -2))[..., None] * ((a * lamp) @ atoms)[..., None, :]
    bent -= steps[..., None] * ((white * lamp) @ atoms)[..., None, :]
    B = _by_shot(bent)  # (h, 3, k n, k q, r)
    # Of C ⊗ X, rows of two channels have the block of X between these channels in common.
    X = np.swapaxes(point.code_covariance.reshape(h, 3, r, 3, r), 2, 3)  # (h, 3, 3, r, r)
    left = point.mode_covariance[:, None, None] @ B  # (h, 3, k n, k q, r)
    left = (left.reshape(h, 3, 1, -1, r) @ X).reshape(h, 3, 3, k * n, -1)
    across = np.swapaxes(B.reshape(h, 1, 3, k * n, -1), -1, -2)
    spread = np.swapaxes(left @ across, 2, 3).reshape(h, N, N)
    return _by_shot(steps[..., None]).reshape(h, N, k * q), spread


def levels(code: Floats, modes: Floats) -> Floats:
    """1 - ĥ (..., k, n) from v̂ (..., k, g) and gain modes (..., k, g, n), at least DARKEST; ones if v̂ is empty."""
    if not code.size:
        return np.ones((*modes.shape[:-2], modes.shape[-1]))
    return np.asarray(np.maximum(1.0 - (code[..., None, :] @ modes)[..., 0, :], DARKEST))


def gain_rows(signals: Floats, modes: Floats) -> Floats:
    """D (h, 3 k n, k g) of gain modes φ (h, k, g, n) and measured signals y (h, 3, k, n): y φ, zero between shots."""
    h, k, g, n = modes.shape
    steps = signals[..., None] * np.swapaxes(modes, -1, -2)[:, None]  # (h, 3, k, n, g)
    return _by_shot(steps[..., None]).reshape(h, 3 * k * n, k * g)


def _by_channel(factors: Floats) -> Floats:
    """Factors (h, 3, rows, r) as one block a channel: (h, 3 rows, 3 r), zero between channels."""
    h, _, rows, r = factors.shape
    blocks = np.zeros((h, 3, rows, 3, r))
    for c in range(3):
        blocks[:, c, :, c] = factors[:, c]
    return blocks.reshape(h, 3 * rows, 3 * r)


def _by_shot(factors: Floats) -> Floats:
    """Factors (h, 3, k, n, q, p) as one block a shot: (h, 3, k n, k q, p), zero between shots."""
    h, _, k, n, q, p = factors.shape
    blocks = np.zeros((h, 3, k, n, k, q, p))
    for j in range(k):
        blocks[:, :, j, :, j] = factors[:, :, j]
    return blocks.reshape(h, 3, k * n, k * q, p)


def _paper_rows(observation: Observation, basis: Basis) -> LinearModel:
    """Eq. (8) to (10): F Ψ x = y, one problem a channel."""
    power = observation.lamp[0] * STEP / (observation.lamp[0] @ observation.white_reflectance * STEP)
    y = np.moveaxis(observation.signals[0], -1, 0)  # (3, n)
    variance = np.moveaxis(observation.errors(basis)[0], -1, 0) ** 2 + (observation.chart_tolerance * y) ** 2
    sigma = np.maximum(variance, FLOOR**2)[:, :, None] * np.eye(y.shape[1])
    matrix = (observation.reflectance * power) @ basis.dictionary
    return LinearModel(matrix, y.copy(), sigma, {"noise": sigma}, observation.lamp)
