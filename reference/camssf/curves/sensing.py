"""Signals → sensing matrix: the rows that the curves must satisfy, and the covariance of their errors.

Letters as in the paper: R reflectance, L lamp, Ψ basis, x code, y signals. ρ_w is the white reference.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import solve_triangular

from camssf.curves.basis import Basis, fold, interpolate
from camssf.curves.covariance import EDGE, FLOOR, Seen, Tolerances, covariance
from camssf.curves.evidence import Evidence
from camssf.grid import STEP, WAVELENGTHS, Floats

DARKEST = 0.02
"""No lamp is taken to be dimmer than this share of its mean at any wavelength."""
SOURCES = ("noise", "chart", "white", "lamp", "lamp modes", "uneven light")


@dataclass(frozen=True)
class Sensing:
    """Linear models b = A x + error, error ~ N(0, Σ), of p problems.

    On a basis with a mean p = 1: x = (x_R, x_G, x_B) and N = 3 k n rows, channel by channel, shot by shot, patch by
    patch. On the paper's p = 3, one problem a channel, of N = n rows.

    Attributes:
        matrix: (p, N, r) A.
        target: (p, N) b.
        covariance: (p, N, N) Σ.
        terms: what Σ is the sum of, by source, (p, N, N) each.
        lamp: (k, 681) each shot's lamp as the rows take it: as given, but for what the signals say of its modes.
        white: (3, k) W, the white signals that the rows are divided by.
        modes: (N, k q) D, how the rows answer to the lamps' modes; D Dᵀ is in the terms.
        gains: (N, k g) D of the gain modes, in the terms, too.
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
    """The same basis in the scale that a shot's white fixes: no atom changes Σ white s dλ.

    Rows know no scale: s and t s are one answer. Were the white signal free, noise times white signal would stand in
    every row, and the smallest residual would be that of a camera that sees little. To first order in the code,
    s / (w s) · (w μ) = μ + (Ψ - μ (w Ψ) / (w μ)) x.

    Args:
        basis: with a mean; without one it comes back as it is.
        white: (681,) ρ_w L of the first shot.
    """
    if not basis.mean.any():
        return basis
    share = np.einsum("m,cmr->cr", white, basis.dictionary) / (basis.mean @ white)[:, None]
    return replace(basis, dictionary=basis.dictionary - basis.mean[:, :, None] * share[:, None, :])


def sense(evidence: Evidence, basis: Basis) -> Sensing:
    """Rows and their covariance: docs/maths.md, 2 and 3.

    Without a mean (the paper's basis, one shot): F s = y with F = R L dλ, L scaled so that Σ ρ_w L dλ = 1;
    Σ is diagonal, se² + (τ y)².

    With a mean, the three channels are one problem: what goes wrong with chart, white and lamp is the same for all.
    About s₀ = μ, W_cj = Σ ρ_w L_j s₀ dλ and ŷ_cij = Σ R_i L_j s₀ dλ / W_cj, where s₀ is channel c's:

        row       a_cij = (R_i - y_cij ρ_w) L_j dλ / W_cj,   A = a Ψ,   b = -a μ
        noise     se_cij² + (τ_i y_cij / 20)²                          independent
        chart     Σ ε_i L_j s₀ dλ / W_cj                               one ε_i a patch, for all shots; 0.7 of its
                                                                       variance common to the channels
        white     -ŷ_cij Σ ρ_w ε_w L_j s₀ dλ / W_cj                    one ε_w for all rows
        lamp      Σ (R_i - ŷ_cij ρ_w) L_j η_j s₀ dλ / W_cj             one smooth η_j a shot, for all channels
                  ŷ_cij / 100                                          light that drifts: one a shot, all channels

    The lamp's and the white's errors enter with the predicted ŷ, not with the measured y: else a mere scale
    would eat the evidence. For the same reason Ψ is anchored to the first shot's white.

    Lamp modes m_q are off by unknown amounts u ~ N(0, I): L_j (1 + Σ u_jq m_jq), the same u for the three channels.
    Such a lamp can be far from its mean, so what the signals say of it is found out first (`_look`): û and x̂, about
    which all of the above is taken anew with L_j (1 + Σ û m) for L_j and μ + Ψ x̂ for s₀, and ŷ for y in those shots'
    rows, a_cij; then b gains y - ŷ. With u's covariance C and x's covariance X of the first look (C = I and X = I
    there):

        modes     D_jq = Σ (R_i - ŷ_cij ρ_w) L_j m_jq s₀ dλ / W_cj,   b += D û,   covariance D Dᵀ
        curvature Σ over q, r, p, s of B_qr C_qp X_rs B_ps with B_qr = ∂²y / ∂u_q ∂x_r: such a lamp also bends how
                  the signals answer to the curve

    Gain modes φ_q say how the light on the patches may be off: y_cij (1 - h_ij) is what even light would have given,
    h_ij = Σ v_jq φ_jq(i), v ~ N(0, I), the same h for the three channels. With the measured y the rows are linear in
    v as they stand; predicted signals would leave h (y (1 - h) - ŷ). In the first look v stands beside u, and where
    y stands above, the second look has y (1 - ĥ), but in these:

        gains     D_jq = y_cij φ_jq(i),   b += D v̂,   covariance D Dᵀ
                  κ² D Dᵀ within a channel: gains that differ a little from channel to channel
    """
    if not basis.mean.any():
        return _paper_rows(evidence, basis)
    basis = anchor(basis, evidence.white_reflectance * evidence.lamp[0])
    power = evidence.lamp * STEP
    reflectance = evidence.reflectance
    given = _Folded(
        evidence, evidence.errors(basis), evidence.lamp_modes[:, :, ::10],
        basis.mean[:, ::10], basis.dictionary[:, ::10],
        fold(power[:, None, :] * reflectance),
        fold(power[:, None, :] * EDGE * np.gradient(reflectance, STEP, axis=1)),
        fold(power * evidence.white_reflectance),
        fold(power),
    )  # fmt: skip
    point = _look(given) if given.modes.any() or given.gains.any() else _start(given)
    rows = _rows(given, point)
    terms = {source: rows.terms[source][None] for source in SOURCES}
    terms["lamp modes"] = terms["lamp modes"] + rows.modes @ rows.modes.T
    terms["uneven light"] = terms["uneven light"] + rows.gains @ rows.gains.T
    return Sensing(
        rows.matrix[None],
        rows.target[None],
        np.sum(list(terms.values()), axis=0),
        terms,
        evidence.lamp * interpolate(point.lamp.T).T,
        point.curves @ (given.white * point.lamp).T,
        rows.modes,
        rows.gains,
    )


@dataclass(frozen=True)
class _Folded:
    """The evidence with every integral over the grid folded onto the nodes (v of them).

    Attributes:
        evidence: as given.
        standard_error: (k, n, 3), unused signals without end.
        modes: (k, q, v) of the lamps.
        mean, atoms: (3, v) μ and (3, v, r) Ψ.
        patches, edges: (k, n, v) R L dλ and 70 nm · dR/dλ L dλ.
        white, light: (k, v) ρ_w L dλ and L dλ.
    """

    evidence: Evidence
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
        return self.evidence.gain_modes


@dataclass(frozen=True)
class _Expansion:
    """The curves, lamps and gains about which the rows are linear, and how far the true ones may lie from there.

    Attributes:
        curves: (3, v) s₀.
        lamp: (k, v) 1 + Σ û m.
        level: (k, n) 1 - ĥ.
        offset: (k q,) û.
        gained: (k g,) v̂.
        of_u: (k q, k q) covariance of u.
        of_x: (3 r, 3 r) covariance of x.
    """

    curves: Floats
    lamp: Floats
    level: Floats
    offset: Floats
    gained: Floats
    of_u: Floats
    of_x: Floats


@dataclass(frozen=True)
class _Rows:
    """The one problem: A, b, D of lamps (N, k q) and of gains (N, k g), and covariances by source, but for D Dᵀ."""

    matrix: Floats
    target: Floats
    modes: Floats
    gains: Floats
    terms: dict[str, Floats]


def _start(given: _Folded) -> _Expansion:
    """At the means: μ, the lamp as given, even light, u and x ~ N(0, I)."""
    (k, q, v), (_, g, n) = given.modes.shape, given.gains.shape
    return _Expansion(
        given.mean, np.ones((k, v)), np.ones((k, n)), np.zeros(k * q), np.zeros(k * g), np.eye(k * q),
        np.eye(3 * given.atoms.shape[2]),
    )  # fmt: skip


def _look(given: _Folded) -> _Expansion:
    """What a first look says of lamps, gains and curves: their Gaussian posterior, linearised at the means.

    With P = Σ + A Aᵀ the rows know Λ = Dᵀ P⁻¹ D and h = Dᵀ P⁻¹ b of u and v: û = C h with C = (I + Λ)⁻¹, and
    x̂ = Aᵀ P⁻¹ (b - D û). Of x̂ the covariance given lamps and gains is taken, I - Aᵀ P⁻¹ A.
    """
    rows = _rows(given, _start(given))
    # Whitened, P = L Lᵀ: an explicit P⁻¹ would cost twice the digits, and modes may make P's condition 1e12 and more.
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
    """The rows about a point. A has ŷ for y where the shot's lamp has modes: y bends with such a lamp."""
    k, n, _ = given.evidence.signals.shape
    measured, se = (np.moveaxis(each, -1, 0) for each in (given.evidence.signals, given.standard_error))  # (3, k, n)
    y = measured * point.level
    curve = point.curves
    white = curve @ (given.white * point.lamp).T  # (3, k) W
    per_white = (point.lamp / white[:, :, None])[:, :, None]  # (3, k, 1, v)
    patches = given.patches * per_white  # (3, k, n, v) R L dλ / W
    seen_white = given.white[:, None] * per_white  # (3, k, 1, v)
    expected = np.einsum("cknv,cv->ckn", patches, curve)  # ŷ
    bends = np.any(given.modes, axis=(1, 2))[:, None]
    about = np.where(bends, expected, y)
    a = patches - about[..., None] * seen_white
    matrix = np.einsum("cknv,cvr->cknr", a, given.atoms)
    target = (y - about) - np.einsum("cknv,cv->ckn", a, given.mean)

    s = curve[:, None, None]
    channel, shot, patch = (index.ravel() for index in np.indices((3, k, n)))
    each_row = np.ones((1, 1, n, 1))
    seen = Seen(
        channel, shot, patch, y.ravel(), expected.ravel(), (se * point.level).ravel(),
        *((part * s * each_row).reshape(3 * k * n, -1) for part in (
            patches, given.edges * per_white, given.light[:, None] * per_white, seen_white,
        )),
    )  # fmt: skip
    known = Tolerances(
        given.evidence.chart_tolerance[patch], given.evidence.white_tolerance, given.evidence.lamp_tolerance[shot]
    )
    terms = covariance(seen, known)
    modes, bent = _bend(given, point, patches - expected[..., None] * seen_white, seen_white)
    spread = bent @ point.of_x
    spread = np.einsum("Nqr,qp->Npr", spread, point.of_u)
    terms["lamp modes"] = spread.reshape(len(shot), -1) @ bent.reshape(len(shot), -1).T
    gains = gain_rows(measured, given.gains)
    own = channel[:, None] == channel
    terms["uneven light"] = own * (given.evidence.gain_own**2 * (gains @ gains.T))
    target = target.ravel() + modes @ point.offset + gains @ point.gained
    return _Rows(_by_channel(matrix.reshape(3, k * n, -1)), target, modes, gains, terms)


def _bend(given: _Folded, point: _Expansion, a: Floats, white: Floats) -> tuple[Floats, Floats]:
    """D (N, k q) and B (N, k q, 3 r): how the signals answer to the lamps' modes, and how that to the code.

    a is (R - ŷ ρ_w) L dλ / W, (3, k, n, v); white is ρ_w L dλ / W, (3, k, 1, v).
    """
    curve, modes = point.curves[:, None, None], given.modes
    if not modes.shape[1]:  # a lamp known by name, as most are
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
    """1 - ĥ (k, n) of gains v̂ (k, g) along modes (k, g, n), never below the darkest; ones where none were found."""
    if not code.size:
        return np.ones((len(modes), modes.shape[2]))
    return np.asarray(np.maximum(1.0 - np.einsum("kg,kgn->kn", code, modes), DARKEST))


def gain_rows(signals: Floats, modes: Floats) -> Floats:
    """D (3 k n, k g) of gain modes (k, g, n): y φ, of measured signals (3, k, n), zero between shots."""
    steps = signals[..., None] * np.swapaxes(modes, 1, 2)  # (3, k, n, g)
    return np.asarray(np.concatenate(_by_shot(steps[..., None])[..., 0]))


def _by_channel(factors: Floats) -> Floats:
    """Factors (3, rows, ..., r) of what each channel has for itself: (3 rows, ..., 3 r), zero between channels."""
    _, rows, *between, r = factors.shape
    blocks = np.zeros((3, rows, *between, 3, r))
    for c in range(3):
        blocks[c, ..., c, :] = factors[c]
    return blocks.reshape(3 * rows, *between, 3 * r)


def _by_shot(factors: Floats) -> Floats:
    """Factors (3, k, n, q, p) of what each shot has for itself: (3, k n, k q, p), zero between shots."""
    _, k, n, q, p = factors.shape
    blocks = np.zeros((3, k, n, k, q, p))
    for j in range(k):
        blocks[:, j, :, j] = factors[:, j]
    return blocks.reshape(3, k * n, k * q, p)


def _paper_rows(evidence: Evidence, basis: Basis) -> Sensing:
    """Eq. (8) to (10): F Ψ x = y, each channel for itself."""
    power = evidence.lamp[0] * STEP / (evidence.lamp[0] @ evidence.white_reflectance * STEP)
    y = np.moveaxis(evidence.signals[0], -1, 0)  # (3, n)
    variance = np.moveaxis(evidence.errors(basis)[0], -1, 0) ** 2 + (evidence.chart_tolerance * y) ** 2
    sigma = np.maximum(variance, FLOOR**2)[:, :, None] * np.eye(y.shape[1])
    matrix = (evidence.reflectance * power) @ basis.dictionary
    return Sensing(matrix, y.copy(), sigma, {"noise": sigma}, evidence.lamp)
