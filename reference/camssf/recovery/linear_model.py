"""Turns an observation into a linear model: the rows that the curves must satisfy, and their covariance.

Letters as in the paper: R reflectance, L lamp, Ψ basis, x code, y signals. ρ_w is the white reference.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import solve_triangular

from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, fold, interpolate
from camssf.recovery.covariance import EDGE, FLOOR, LinearisedSignals, Tolerances, covariance
from camssf.recovery.observation import Observation

DARKEST = 0.02
"""Lower limit of the factors by which lamp modes and gain modes change the light."""
SOURCES = ("noise", "chart", "white", "lamp", "lamp modes", "uneven light")


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
    """
    if not basis.mean.any():
        return _paper_rows(observation, basis)
    basis = anchor(basis, observation.white_reflectance * observation.lamp[0])
    power = observation.lamp * STEP
    reflectance = observation.reflectance
    given = _Folded(
        observation, observation.errors(basis), observation.lamp_modes[:, :, ::10],
        basis.mean[:, ::10], basis.dictionary[:, ::10],
        fold(power[:, None, :] * reflectance),
        fold(power[:, None, :] * EDGE * np.gradient(reflectance, STEP, axis=1)),
        fold(power * observation.white_reflectance),
        fold(power),
    )  # fmt: skip
    point = _first_pass(given) if given.modes.any() or given.gains.any() else _start(given)
    rows = _rows(given, point)
    terms = {source: rows.terms[source][None] for source in SOURCES}
    terms["lamp modes"] = terms["lamp modes"] + rows.modes @ rows.modes.T
    terms["uneven light"] = terms["uneven light"] + rows.gains @ rows.gains.T
    return LinearModel(
        rows.matrix[None],
        rows.target[None],
        np.sum(list(terms.values()), axis=0),
        terms,
        observation.lamp * interpolate(point.lamp.T).T,
        point.curves @ (given.white * point.lamp).T,
        rows.modes,
        rows.gains,
    )


@dataclass(frozen=True)
class _Folded:
    """The observation with every integral over the grid folded onto the v nodes.

    Attributes:
        observation: as given.
        standard_error: (k, n, 3), MASKED_STANDARD_ERROR for masked signals.
        modes: (k, q, v) lamp modes.
        mean, atoms: (3, v) μ and (3, v, r) Ψ.
        patches, edges: (k, n, v) R L dλ and 70 nm · dR/dλ L dλ.
        white, light: (k, v) ρ_w L dλ and L dλ.
    """

    observation: Observation
    standard_error: Floats
    modes: Floats
    mean: Floats
    atoms: Floats
    patches: Floats
    edges: Floats
    white: Floats
    light: Floats

    @property
    def gains(self) -> Floats:
        """(k, g, n) the gain modes."""
        return self.observation.gain_modes


@dataclass(frozen=True)
class _Expansion:
    """The linearisation point of the rows: curves, lamps and gains, with the covariances of lamp modes and code.

    Attributes:
        curves: (3, v) s₀.
        lamp: (k, v) 1 + Σ û m.
        level: (k, n) 1 - ĥ.
        offset: (k q,) û.
        gained: (k g,) v̂.
        mode_covariance: (k q, k q) covariance of u.
        code_covariance: (3 r, 3 r) covariance of x.
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
    """The linear model at a point: A, b, D of lamps (N, k q) and of gains (N, k g), and Σ by source without D Dᵀ."""

    matrix: Floats
    target: Floats
    modes: Floats
    gains: Floats
    terms: dict[str, Floats]


def _start(given: _Folded) -> _Expansion:
    """The linearisation point at the prior means: μ, the lamp as given, even light; u and x ~ N(0, I)."""
    (k, q, v), (_, g, n) = given.modes.shape, given.gains.shape
    return _Expansion(
        given.mean, np.ones((k, v)), np.ones((k, n)), np.zeros(k * q), np.zeros(k * g), np.eye(k * q),
        np.eye(3 * given.atoms.shape[2]),
    )  # fmt: skip


def _first_pass(given: _Folded) -> _Expansion:
    """Gaussian posterior of lamps, gains and curves, from rows linearised at the prior means.

    With P = Σ + A Aᵀ, and D of both u and v, Λ = Dᵀ P⁻¹ D and h = Dᵀ P⁻¹ b: û = C h with C = (I + Λ)⁻¹, and
    x̂ = Aᵀ P⁻¹ (b - D û). `code_covariance` is the one given lamps and gains, I - Aᵀ P⁻¹ A.
    """
    rows = _rows(given, _start(given))
    # Whitened by P = L Lᵀ: an explicit P⁻¹ loses twice the digits, and modes may raise P's condition above 1e12.
    spread = np.sum(list(rows.terms.values()), axis=0) + rows.matrix @ rows.matrix.T
    columns = np.concatenate([rows.matrix, rows.target[:, None], rows.modes, rows.gains], axis=1)
    whitened = _whiten(spread, columns)
    r = rows.matrix.shape[1]
    matrix, target, modes = (whitened[:, part] for part in (slice(r), r, slice(r + 1, None)))
    precision = np.eye(modes.shape[1]) + modes.T @ modes
    root = _whiten(precision, np.column_stack([np.eye(len(precision)), modes.T @ target]))
    back, pull = root[:, :-1], root[:, -1]
    found = back.T @ pull
    code = (matrix.T @ (target - modes @ found)).reshape(3, -1)
    (k, q, _), lamps = given.modes.shape, rows.modes.shape[1]
    offset, gained = found[:lamps], found[lamps:]
    bend = 1.0 + np.einsum("kq,kqv->kv", offset.reshape(k, q), given.modes)
    return _Expansion(
        given.mean + np.einsum("cvr,cr->cv", given.atoms, code),
        np.maximum(bend, DARKEST),
        levels(gained.reshape(k, -1), given.gains),
        offset,
        gained,
        back[:, :lamps].T @ back[:, :lamps],
        np.eye(r) - matrix.T @ matrix,
    )


def _whiten(covariance: Floats, columns: Floats) -> Floats:
    """L⁻¹ columns with covariance = L Lᵀ."""
    return np.asarray(solve_triangular(np.linalg.cholesky(covariance), columns, lower=True))


def _rows(given: _Folded, point: _Expansion) -> _Rows:
    """The rows at a point. A has ŷ in place of y if the shot's lamp has modes, since y is not linear in them."""
    k, n, _ = given.observation.signals.shape
    measured, se = (
        np.moveaxis(each, -1, 0) for each in (given.observation.signals, given.standard_error)
    )  # (3, k, n)
    y = measured * point.level
    curve = point.curves
    white = curve @ (given.white * point.lamp).T  # (3, k) W
    per_white = (point.lamp / white[:, :, None])[:, :, None]  # (3, k, 1, v)
    patches = given.patches * per_white  # (3, k, n, v) R L dλ / W
    seen_white = given.white[:, None] * per_white  # (3, k, 1, v)
    expected = np.einsum("cknv,cv->ckn", patches, curve)  # ŷ
    lamp_has_modes = np.any(given.modes, axis=(1, 2))[:, None]
    about = np.where(lamp_has_modes, expected, y)
    a = patches - about[..., None] * seen_white
    matrix = np.einsum("cknv,cvr->cknr", a, given.atoms)
    target = (y - about) - np.einsum("cknv,cv->ckn", a, given.mean)

    s = curve[:, None, None]
    channel, shot, patch = (index.ravel() for index in np.indices((3, k, n)))
    each_row = np.ones((1, 1, n, 1))
    seen = LinearisedSignals(
        channel, shot, patch, y.ravel(), expected.ravel(), (se * point.level).ravel(),
        *((part * s * each_row).reshape(3 * k * n, -1) for part in (
            patches, given.edges * per_white, given.light[:, None] * per_white, seen_white,
        )),
    )  # fmt: skip
    known = Tolerances(
        given.observation.chart_tolerance[patch],
        given.observation.white_tolerance,
        given.observation.lamp_tolerance[shot],
    )
    terms = covariance(seen, known)
    modes, bent = _bend(given, point, patches - expected[..., None] * seen_white, seen_white)
    spread = bent @ point.code_covariance
    spread = np.einsum("Nqr,qp->Npr", spread, point.mode_covariance)
    terms["lamp modes"] = spread.reshape(len(shot), -1) @ bent.reshape(len(shot), -1).T
    gains = gain_rows(measured, given.gains)
    own = channel[:, None] == channel
    terms["uneven light"] = own * (given.observation.gain_own**2 * (gains @ gains.T))
    target = target.ravel() + modes @ point.offset + gains @ point.gained
    return _Rows(_by_channel(matrix.reshape(3, k * n, -1)), target, modes, gains, terms)


def _bend(given: _Folded, point: _Expansion, a: Floats, white: Floats) -> tuple[Floats, Floats]:
    """D = ∂y / ∂u (N, k q) of the lamp modes, and B = ∂²y / ∂u ∂x (N, k q, 3 r).

    a is (R - ŷ ρ_w) L dλ / W, (3, k, n, v); white is ρ_w L dλ / W, (3, k, 1, v).
    """
    curve, modes = point.curves[:, None, None], given.modes
    if not modes.shape[1]:  # the usual case: a lamp without modes
        rows, r = a.size // a.shape[-1], given.atoms.shape[2]
        return np.zeros((rows, 0)), np.zeros((rows, 0, 3 * r))
    relative = a / point.lamp[:, None]  # the modes are relative to the lamp as given
    steps = np.einsum("cknv,kqv->cknq", relative * curve, modes)
    # ∂²y / ∂u ∂x, where y is a quotient N / D and D = 1: ∂²N - ∂D ∂y - ∂y ∂D
    bent = np.einsum("cknv,kqv,cvr->cknqr", relative, modes, given.atoms, optimize=True)
    off = np.einsum("cknv,kqv->cknq", white / point.lamp[:, None] * curve, modes)
    bent -= off[..., None] * np.einsum("cknv,cvr->cknr", a, given.atoms)[:, :, :, None]
    bent -= steps[..., None] * np.einsum("cknv,cvr->cknr", white, given.atoms)[:, :, :, None]
    return np.concatenate(_by_shot(steps[..., None])[..., 0]), _by_channel(_by_shot(bent))


def levels(code: Floats, modes: Floats) -> Floats:
    """1 - ĥ (k, n) from v̂ (k, g) and gain modes (k, g, n), at least DARKEST; ones if v̂ is empty."""
    if not code.size:
        return np.ones((len(modes), modes.shape[2]))
    return np.asarray(np.maximum(1.0 - np.einsum("kg,kgn->kn", code, modes), DARKEST))


def gain_rows(signals: Floats, modes: Floats) -> Floats:
    """D (3 k n, k g) of gain modes φ (k, g, n) and measured signals y (3, k, n): y φ, zero between shots."""
    steps = signals[..., None] * np.swapaxes(modes, 1, 2)  # (3, k, n, g)
    return np.asarray(np.concatenate(_by_shot(steps[..., None])[..., 0]))


def _by_channel(factors: Floats) -> Floats:
    """Factors (3, rows, ..., r) as one block a channel: (3 rows, ..., 3 r), zero between channels."""
    _, rows, *between, r = factors.shape
    blocks = np.zeros((3, rows, *between, 3, r))
    for c in range(3):
        blocks[c, ..., c, :] = factors[c]
    return blocks.reshape(3 * rows, *between, 3 * r)


def _by_shot(factors: Floats) -> Floats:
    """Factors (3, k, n, q, p) as one block a shot: (3, k n, k q, p), zero between shots."""
    _, k, n, q, p = factors.shape
    blocks = np.zeros((3, k, n, k, q, p))
    for j in range(k):
        blocks[:, j, :, j] = factors[:, j]
    return blocks.reshape(3, k * n, k * q, p)


def _paper_rows(observation: Observation, basis: Basis) -> LinearModel:
    """Eq. (8) to (10): F Ψ x = y, one problem a channel."""
    power = observation.lamp[0] * STEP / (observation.lamp[0] @ observation.white_reflectance * STEP)
    y = np.moveaxis(observation.signals[0], -1, 0)  # (3, n)
    variance = np.moveaxis(observation.errors(basis)[0], -1, 0) ** 2 + (observation.chart_tolerance * y) ** 2
    sigma = np.maximum(variance, FLOOR**2)[:, :, None] * np.eye(y.shape[1])
    matrix = (observation.reflectance * power) @ basis.dictionary
    return LinearModel(matrix, y.copy(), sigma, {"noise": sigma}, observation.lamp)
