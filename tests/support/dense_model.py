"""The dense linear model: rows and their whole covariance by NumPy alone, an oracle for `camssf.recovery`.

Written before the formulas of `camssf.recovery` were traced to ONNX, and by other means: errors on the 5-nm nodes as
whole matrices Σ by source, LAPACK's Cholesky, no block form. `test_dense_model.py` compares; nothing else may
import this file. It must not import the formulas that it judges.

Letters as in the paper: R reflectance, L lamp, Ψ basis, x code, y signals. ρ_w is the white reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.grid import STEP, Floats
from camssf.recovery.basis import NODES, Basis, fold, interpolate
from camssf.recovery.observation import Observation
from camssf.rules import rules

DARKEST = 0.02
CHART_CORRELATION = rules().number("covariance.chart_correlation")
TABLE_CORRELATION = rules().number("covariance.table_correlation")
RELATIVE, ABSOLUTE, EDGE = (rules().number(f"covariance.{name}") for name in ("relative", "absolute", "edge"))
LAMP_CORRELATION = rules().number("covariance.lamp_correlation")
INDEPENDENT_SHARE = rules().number("covariance.independent_share")
CHANNEL_SHARE = rules().number("covariance.channel_share")
DRIFT = rules().number("covariance.drift")
FLOOR = rules().number("covariance.floor")
RED_MORE, RED_FROM, RED_OVER = (rules().number(f"covariance.red_{name}") for name in ("more", "from", "over"))
FREEDOM, MOST = (rules().number(f"covariance.patch_{name}") for name in ("freedom", "most"))


@dataclass(frozen=True)
class DenseModel:
    """b = A x + error, error ~ N(0, Σ): A (N, 3 r), b (N,), Σ (N, N), lamp (k, 681).

    Rows go by channel, then shot, then patch.
    """

    A: Floats
    b: Floats
    sigma: Floats
    lamp: Floats

    @property
    def log_evidence(self) -> float:
        """ln N(b; 0, Σ + A Aᵀ) but for ½ N ln 2 π."""
        spread = self.sigma + self.A @ self.A.T
        root = np.linalg.cholesky(spread)
        from scipy.linalg import solve_triangular

        rest = solve_triangular(root, self.b, lower=True)
        return float(-0.5 * (rest @ rest + 2.0 * np.log(np.diag(root)).sum()))


def dense_models(observations: Sequence[Observation], basis: Basis) -> list[DenseModel]:
    """The models of observations of equal shapes, all with modes or all without, on a basis with a mean."""
    given = _fold(observations, basis)
    scale = _patch_scales(_rows(given, _start(given)), given.signals.shape)
    point = _first_pass(given, scale) if given.modes.any() or given.gains.any() else _start(given)
    rows = _rows(given, point)
    rows.terms["chart"] *= scale
    rows.terms["lamp modes"] += outer(rows.modes)
    rows.terms["uneven light"] += outer(rows.gains)
    covariances = _total(rows.terms)
    lamps = interpolate(np.swapaxes(point.lamp, -1, -2))
    return [
        DenseModel(rows.matrix[i], rows.target[i], covariances[i], observation.lamp * lamps[i].T)
        for i, observation in enumerate(observations)
    ]


def whiten(A: Floats, b: Floats, sigma: Floats) -> tuple[Floats, Floats]:
    """L⁻¹ A and L⁻¹ b with Σ = L Lᵀ, (h, N, r) and (h, N), by LAPACK's triangular solve."""
    from scipy.linalg import solve_triangular

    columns = np.concatenate([A, b[..., None]], axis=-1)
    found = np.stack([
        solve_triangular(np.linalg.cholesky(one), own, lower=True) for one, own in zip(sigma, columns, strict=True)
    ])  # fmt: skip
    return found[..., :-1], found[..., -1]


@dataclass(frozen=True)
class LinearisedSignals:
    """Signals and their derivatives at a linearisation point, curves s under lamps L.

    N rows, in any order; v wavelengths. s is the curve of the row's channel, L the lamp of its shot, and
    W = Σ ρ_w L s dλ. All but the indices may have leading axes, as a stack of hypotheses.

    Attributes:
        channel, shot, patch: (N,) indices of each row.
        signal, predicted: (N,) measured y, and ŷ predicted from s and L.
        standard_error: (N,) of y.
        patches: (N, v) R L s dλ / W.
        edges: (N, v) 70 nm · dR/dλ L s dλ / W.
        light: (N, v) L s dλ / W.
        white: (N, v) ρ_w L s dλ / W.
        at: (v,) the wavelengths, nm.
    """

    channel: NDArray[np.intp]
    shot: NDArray[np.intp]
    patch: NDArray[np.intp]
    signal: Floats
    predicted: Floats
    standard_error: Floats
    patches: Floats
    edges: Floats
    light: Floats
    white: Floats
    at: Floats

    @property
    def against_white(self) -> Floats:
        """(R - ŷ ρ_w) L s dλ / W, (N, v): derivative of ŷ with respect to a relative change of L or of s."""
        return self.patches - self.predicted[..., None] * self.white


@dataclass(frozen=True)
class Tolerances:
    """Relative errors of chart, white reference and lamps.

    Attributes:
        chart: (..., N) τ of each row's patch.
        white: of ρ_w, one number, or (h, 1, 1).
        lamp: (..., N) of the lamp of each row's shot.
    """

    chart: Floats
    white: float | Floats
    lamp: Floats


def smooth_errors(length: float, at: Floats) -> Floats:
    """Factor Φ, (len(at), p), of a smooth random error at the wavelengths `at`: Φ Φᵀ = exp(-½ (Δλ / ℓ)²)."""
    step = length / 2.0
    points = np.arange(380.0 - 2.0 * length, 720.0 + 2.0 * length + step, step)
    weight = np.sqrt(step / (length * np.sqrt(np.pi / 2.0)))
    return np.asarray(weight * np.exp(-(((at[:, None] - points) / length) ** 2)))


def covariance(signals_at: LinearisedSignals, tolerances: Tolerances) -> dict[str, Floats]:
    """Covariance of the rows by source, (..., N, N) each; Σ is their sum.

        noise     se²                                                  independent
        chart     (τ y / 20)²                                          independent
                  τ Σ (0.6 R u₁ + u₂ / 3 + 70 nm · dR/dλ u₃) h L s dλ / W  one u a patch, for all shots; κ = 0.7 of
                                                                         its variance common to the channels;
                                                                         h = 1 + 1.6 / (1 + exp(-(λ - 650) / 8))
        white     -ŷ Σ ρ_w ε_w L s dλ / W                              one ε_w for all rows
        lamp      Σ (R - ŷ ρ_w) L η s dλ / W                           one smooth η a shot, for all channels
                  ŷ / 100                                              drift of the light: one a shot, all channels

    The errors of lamp and white enter with the predicted ŷ, not with the measured y: otherwise a mere change of scale
    could explain the signals. The independent part of a row's standard error is at least FLOOR.
    """
    over_chart, over_lamp, over_table = (
        smooth_errors(length, signals_at.at) for length in (CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION)
    )
    red = (1.0 + RED_MORE / (1.0 + np.exp(-(signals_at.at - RED_FROM) / RED_OVER)))[:, None]
    chart = np.concatenate(
        [
            RELATIVE * (signals_at.patches @ (red * over_chart)),
            ABSOLUTE * (signals_at.light @ (red * over_table)),
            signals_at.edges @ (red * over_table),
        ],
        axis=-1,
    )
    drift = DRIFT * signals_at.predicted[..., None]
    white = tolerances.white * signals_at.predicted[..., None] * (signals_at.white @ over_chart)
    lamp = np.concatenate([tolerances.lamp[..., None] * (signals_at.against_white @ over_lamp), drift], axis=-1)
    noise = np.maximum(signals_at.standard_error**2, FLOOR**2)
    own = (INDEPENDENT_SHARE * tolerances.chart * signals_at.signal) ** 2
    # max(se² + own, floor²) - noise, without a difference of two large numbers where a signal is masked.
    independent = np.maximum(own - np.maximum(FLOOR**2 - signals_at.standard_error**2, 0.0), 0.0)
    same_channel, same_shot, same_patch = (
        label[:, None] == label for label in (signals_at.channel, signals_at.shot, signals_at.patch)
    )
    shared = same_patch * np.where(same_channel, 1.0, CHANNEL_SHARE)
    terms = {
        "noise": _diagonal(noise),
        "chart": outer(tolerances.chart[..., None] * chart),
        "white": outer(white),
        "lamp": outer(lamp),
    }
    terms["chart"] *= shared
    terms["chart"] += _diagonal(independent)
    terms["lamp"] *= same_shot
    return terms


def _diagonal(variance: Floats) -> Floats:
    """Covariance (..., N, N) of independent errors of variance (..., N)."""
    found = np.zeros((*variance.shape, variance.shape[-1]))
    at = np.arange(variance.shape[-1])
    found[..., at, at] = variance
    return found


def outer(factors: Floats) -> Floats:
    """Covariance (..., N, N) of errors that are factors (..., N, p) times standard normal numbers."""
    return np.asarray(factors @ np.swapaxes(factors, -1, -2))


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
        return np.stack([getattr(observation, name) for observation in observations])

    charts = [observation.reflectance for observation in observations]
    reflectance = np.stack(charts[:1] if all(chart is charts[0] for chart in charts) else charts)
    power, rho = stack("lamp") * STEP, stack("white_reflectance")[:, None]
    slope = EDGE * np.gradient(reflectance, STEP, axis=-1)
    white, mean, atoms = fold(power * rho), basis.mean[:, ::10], basis.dictionary[:, ::10]
    first = white[:, :1, None]  # (h, 1, 1, v): the scale is fixed by the first shot's white, as in `anchor`
    errors = np.stack([observation.errors(basis) for observation in observations])
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
        gain_estimate: (h, k g) v̂.
        mode_covariance: (h, k q, k q) covariance of u.
        code_covariance: (h, 3 r, 3 r) covariance of x.
    """

    curves: Floats
    lamp: Floats
    level: Floats
    offset: Floats
    gain_estimate: Floats
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


def _patch_scales(rows: _Rows, shape: tuple[int, ...]) -> Floats:
    """Scale (h, N, N) of the chart's covariance, one number a patch: EM steps by the explicit inverse of P."""
    from scipy.linalg import cho_factor, cho_solve

    h, _, k, n = shape
    rest = outer(rows.matrix) + outer(rows.modes) + outer(rows.gains)
    rest += sum(term for source, term in rows.terms.items() if source != "chart")
    patch = np.tile(np.arange(n), 3 * k)
    scales = np.ones((h, n))
    for i in range(h):
        chart = rows.terms["chart"][i]
        for _ in range(3):
            spread = rest[i] + chart * scales[i][patch]
            inverse = cho_solve(cho_factor(spread, lower=True), np.eye(len(spread)))
            e = inverse @ rows.target[i]
            for p in range(n):
                own = np.flatnonzero(patch == p)
                part = scales[i, p] * chart[np.ix_(own, own)]
                q, t = e[own] @ part @ e[own], np.trace(part @ inverse[np.ix_(own, own)])
                scales[i, p] = np.clip(scales[i, p] * (FREEDOM + q) / (FREEDOM + t), 1.0, MOST)
    return np.asarray(np.broadcast_to(scales[:, None, patch], (h, patch.size, patch.size)))


def _first_pass(given: _Folded, scale: Floats) -> _Expansion:
    """Gaussian posterior of lamps, gains and curves, from rows linearised at the prior means.

    With P = Σ + A Aᵀ, and D of both u and v, Λ = Dᵀ P⁻¹ D and h = Dᵀ P⁻¹ b: û = C h with C = (I + Λ)⁻¹, and
    x̂ = Aᵀ P⁻¹ (b - D û). `code_covariance` is the one given lamps and gains, I - Aᵀ P⁻¹ A.
    """
    rows = _rows(given, _start(given))
    rows.terms["chart"] *= scale
    # Whitened by P = L Lᵀ: an explicit P⁻¹ loses twice the digits, and modes may raise P's condition above 1e12.
    spread = _total(rows.terms)
    spread += outer(rows.matrix)
    columns, target = whiten(np.concatenate([rows.matrix, rows.modes, rows.gains], axis=-1), rows.target, spread)
    r, target = rows.matrix.shape[-1], target[..., None]
    matrix, modes = columns[..., :r], columns[..., r:]
    across = np.swapaxes(modes, -1, -2)
    precision = np.eye(modes.shape[-1]) + across @ modes
    root, pull = whiten(
        np.broadcast_to(np.eye(precision.shape[-1]), precision.shape), (across @ target)[..., 0], precision
    )
    back = np.swapaxes(root, -1, -2)
    found = back @ pull[..., None]
    (h, k, q, _), lamps = given.modes.shape, rows.modes.shape[-1]
    code = (np.swapaxes(matrix, -1, -2) @ (target - modes @ found)).reshape(h, 3, -1, 1)
    offset, gain_estimate = found[:, :lamps, 0], found[:, lamps:, 0]
    lamp_factors = 1.0 + (offset.reshape(h, k, 1, q) @ given.modes)[:, :, 0]
    return _Expansion(
        given.mean + (given.atoms @ code)[..., 0],
        np.maximum(lamp_factors, DARKEST),
        levels(gain_estimate.reshape(h, k, -1), given.gains),
        offset,
        gain_estimate,
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
    linearisation_point = np.where(lamp_has_modes, expected, y)
    a = patches - linearisation_point[..., None] * seen_white
    matrix = a @ given.atoms[:, :, None]
    target = (y - linearisation_point) - (a @ given.mean[:, None, :, None])[..., 0]

    s = curve[:, :, None, None]
    channel, shot, patch = (index.ravel() for index in np.indices((3, k, n)))
    linearised = LinearisedSignals(
        channel, shot, patch,
        *(part.reshape(h, -1) for part in (y, expected, given.standard_error * point.level[:, None])),
        *(np.broadcast_to(part * s, patches.shape).reshape(h, 3 * k * n, -1) for part in (
            patches, given.edges[:, None] * per_white, given.light[:, None, :, None] * per_white, seen_white,
        )),
        NODES,
    )  # fmt: skip
    known = Tolerances(given.chart_tolerance[:, patch], given.white_tolerance, given.lamp_tolerance[:, shot])
    terms = covariance(linearised, known)
    relative = (patches - expected[..., None] * seen_white) / point.lamp[:, None, :, None]
    modes, terms["lamp modes"] = _lamp_mode_rows(given, point, relative, seen_white / point.lamp[:, None, :, None])
    gains = gain_rows(given.signals, given.gains)
    terms["uneven light"] = (channel[:, None] == channel) * (given.gain_own**2 * outer(gains))
    target = (
        target.reshape(h, -1) + (modes @ point.offset[..., None] + gains @ point.gain_estimate[..., None])[..., 0]
    )
    return _Rows(_by_channel(matrix.reshape(h, 3, k * n, -1)), target, modes, gains, terms)


def _lamp_mode_rows(given: _Folded, point: _Expansion, a: Floats, white: Floats) -> tuple[Floats, Floats]:
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
