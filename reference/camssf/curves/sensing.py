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
SOURCES = ("noise", "chart", "white", "lamp", "lamp modes")


@dataclass(frozen=True)
class Sensing:
    """One linear model a channel: b = A x + error, error ~ N(0, Σ). Rows run shot by shot, patch by patch.

    Attributes:
        matrix: (3, k n, r) A.
        target: (3, k n) b.
        covariance: (3, k n, k n) Σ.
        terms: what Σ is the sum of, by source, (3, k n, k n) each.
        lamp: (k, 681) each shot's lamp as the rows take it: as given, but for what the signals say of its modes.
        white: (3, k) W, the white signals that the rows are divided by.
    """

    matrix: Floats
    target: Floats
    covariance: Floats
    terms: dict[str, Floats] = field(default_factory=dict)
    lamp: Floats = field(default_factory=lambda: np.zeros((0, WAVELENGTHS.size)))
    white: Floats = field(default_factory=lambda: np.zeros((3, 0)))


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

    With a mean, about s₀ = μ, W_j = Σ ρ_w L_j s₀ dλ and ŷ_ij = Σ R_i L_j s₀ dλ / W_j:

        row       a_ij = (R_i - y_ij ρ_w) L_j dλ / W_j,   A = a Ψ,   b = -a μ
        noise     se_ij² + (τ_i y_ij / 20)²                            independent
        chart     Σ ε_i L_j s₀ dλ / W_j                                one ε_i a patch, for all shots
        white     -ŷ_ij Σ ρ_w ε_w L_j s₀ dλ / W_j                      one ε_w for all rows
        lamp      Σ (R_i - ŷ_ij ρ_w) L_j η_j s₀ dλ / W_j               one smooth η_j a shot

    The lamp's and the white's errors enter with the predicted ŷ, not with the measured y: else a mere scale
    would eat the evidence. For the same reason Ψ is anchored to the first shot's white.

    Lamp modes m_q are off by unknown amounts u ~ N(0, I): L_j (1 + Σ u_jq m_jq), the same u in the three channels.
    Such a lamp can be far from its mean, so what the signals say of it is found out first (`_look`): û and x̂, about
    which all of the above is taken anew with L_j (1 + Σ û m) for L_j and μ + Ψ x̂ for s₀, and ŷ for y in those shots'
    rows, a_ij; then b gains y - ŷ. With u's mean ū and covariance C as the other two channels tell them, and x's
    covariance X of the first look (ū = 0, C = I and X = I there):

        modes     D_jq = Σ (R_i - ŷ_ij ρ_w) L_j m_jq s₀ dλ / W_j,   b += D (û - ū),   covariance D C Dᵀ
        curvature Σ over q, r, p, s of B_qr C_qp X_rs B_ps with B_qr = ∂²y / ∂u_q ∂x_r: such a lamp also bends how
                  the signals answer to the curve
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
    point = _look(given) if given.modes.any() else _start(given)
    channels = [_rows(given, point, c) for c in range(3)]
    terms = {source: np.stack([rows.terms[source] for rows in channels]) for source in SOURCES}
    modes = np.stack([rows.modes for rows in channels])
    terms["lamp modes"] += modes @ point.covariance @ np.swapaxes(modes, 1, 2)
    return Sensing(
        np.stack([rows.matrix for rows in channels]),
        np.stack([rows.target for rows in channels]),
        np.sum(list(terms.values()), axis=0),
        terms,
        evidence.lamp * interpolate(point.lamp.T).T,
        point.curves @ (given.white * point.lamp).T,
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


@dataclass(frozen=True)
class _Expansion:
    """The curves and lamps about which the rows are linear, and what each channel is told of u.

    Attributes:
        curves: (3, v) s₀.
        lamp: (k, v) 1 + Σ û m.
        offset: (k q,) û.
        mean, covariance: (3, k q) and (3, k q, k q) of u.
        spread: (3, r, r) covariance of x.
    """

    curves: Floats
    lamp: Floats
    offset: Floats
    mean: Floats
    covariance: Floats
    spread: Floats


@dataclass(frozen=True)
class _Rows:
    """One channel: A, b, D (k n, k q), and covariances by source, but for D C Dᵀ."""

    matrix: Floats
    target: Floats
    modes: Floats
    terms: dict[str, Floats]


def _start(given: _Folded) -> _Expansion:
    """At the means: μ, the lamp as given, u ~ N(0, I)."""
    k, q, v = given.modes.shape
    size = k * q
    of_u, of_x = (np.broadcast_to(np.eye(p), (3, p, p)) for p in (size, given.atoms.shape[2]))
    return _Expansion(given.mean, np.ones((k, v)), np.zeros(size), np.zeros((3, size)), of_u, of_x)


def _look(given: _Folded) -> _Expansion:
    """What a first look says of lamps and curves: their Gaussian posterior, linearised at the means.

    With P = Σ + A Aᵀ a channel knows Λ = Dᵀ P⁻¹ D and h = Dᵀ P⁻¹ b of u. Then û = (I + Σ Λ)⁻¹ Σ h over the channels
    and x̂ = Aᵀ P⁻¹ (b - D û); but of u a channel is told only what the other two know, since its own rows still stand
    in its own problem. Of x̂ the covariance given the lamp is taken, I - Aᵀ P⁻¹ A.
    """
    start = _start(given)
    channels = [_rows(given, start, c) for c in range(3)]
    # Whitened, P = L Lᵀ: an explicit P⁻¹ would cost twice the digits, and modes may make P's condition 1e12 and more.
    whitened = [
        _whiten(
            np.sum(list(rows.terms.values()), axis=0) + rows.matrix @ rows.matrix.T,
            np.concatenate([rows.matrix, rows.target[:, None], rows.modes], axis=1),
        )
        for rows in channels
    ]
    r = given.atoms.shape[2]
    matrix, target, modes = (
        np.stack([rows[:, part] for rows in whitened]) for part in (slice(r), r, slice(r + 1, None))
    )
    precision = np.swapaxes(modes, 1, 2) @ modes
    pull = np.einsum("cnq,cn->cq", modes, target)
    one = np.eye(start.offset.size)
    offset = _posterior(one + precision.sum(axis=0), pull.sum(axis=0))[0]
    others = [
        _posterior(one + precision.sum(axis=0) - own, pull.sum(axis=0) - told)
        for own, told in zip(precision, pull, strict=True)
    ]
    mean, of_u = (np.stack(parts) for parts in zip(*others, strict=True))
    code = np.einsum("cnr,cn->cr", matrix, target - modes @ offset)
    spread = np.eye(r) - np.swapaxes(matrix, 1, 2) @ matrix
    k, q, _ = given.modes.shape
    bend = 1.0 + np.einsum("kq,kqv->kv", offset.reshape(k, q), given.modes)
    curves = given.mean + np.einsum("cvr,cr->cv", given.atoms, code)
    return _Expansion(curves, np.maximum(bend, DARKEST), offset, mean, of_u, spread)


def _whiten(covariance: Floats, columns: Floats) -> Floats:
    """L⁻¹ columns with covariance = L Lᵀ."""
    return np.asarray(solve_triangular(np.linalg.cholesky(covariance), columns, lower=True))


def _posterior(precision: Floats, pull: Floats) -> tuple[Floats, Floats]:
    """Λ⁻¹ h and Λ⁻¹, symmetric and of no negative eigenvalue whatever Λ's condition."""
    root = _whiten(precision, np.column_stack([np.eye(pull.size), pull]))
    return root[:, :-1].T @ root[:, -1], root[:, :-1].T @ root[:, :-1]


def _rows(given: _Folded, point: _Expansion, c: int) -> _Rows:
    """One channel's rows about a point. A has ŷ for y where the shot's lamp has modes: y bends with such a lamp."""
    k, n, _ = given.evidence.signals.shape
    y, se = given.evidence.signals[:, :, c], given.standard_error[:, :, c]
    curve, atoms = point.curves[c], given.atoms[c]
    white = (given.white * point.lamp) @ curve  # (k,) W
    patches = given.patches * (point.lamp / white[:, None])[:, None]  # (k, n, v) R L dλ / W
    seen_white = given.white * point.lamp / white[:, None]  # (k, v)
    expected = patches @ curve  # (k, n) ŷ
    bends = np.any(given.modes, axis=(1, 2), keepdims=True)[:, 0]
    about = np.where(bends, expected, y)
    a = patches - about[:, :, None] * seen_white[:, None]
    matrix = a @ atoms  # (k, n, r)
    target = (y - about) - a @ given.mean[c]

    shot, patch = np.divmod(np.arange(k * n), n)
    seen = Seen(
        shot, patch, y.ravel(), expected.ravel(), se.ravel(), curve,
        patches.reshape(k * n, -1),
        (given.edges * (point.lamp / white[:, None])[:, None]).reshape(k * n, -1),
        (given.light * point.lamp / white[:, None])[shot],
        seen_white[shot],
    )  # fmt: skip
    known = Tolerances(
        given.evidence.chart_tolerance[patch], given.evidence.white_tolerance, given.evidence.lamp_tolerance[shot]
    )
    terms = covariance(seen, known)
    a_expected = seen.against_white.reshape(patches.shape)

    relative = a_expected / point.lamp[:, None]  # the modes are relative to the lamp as given
    steps = np.einsum("knv,kqv->knq", relative * curve, given.modes)
    modes = _by_shot(steps[..., None])
    # ∂²y / ∂u ∂x, where y is a quotient N / D and D = 1: ∂²N - ∂D ∂y - ∂y ∂D
    bent = np.einsum("knv,kqv,vr->knqr", relative, given.modes, atoms, optimize=True)
    off = ((given.white / white[:, None] * curve)[:, None] * given.modes).sum(axis=2)
    bent -= off[:, None, :, None] * (a_expected @ atoms)[:, :, None]
    bent -= steps[..., None] * (seen_white @ atoms)[:, None, None]
    bent = _by_shot(bent)
    spread = bent.reshape(k * n, -1, atoms.shape[1]) @ point.spread[c]
    spread = np.einsum("nqr,qp->npr", spread, point.covariance[c])
    terms["lamp modes"] = spread.reshape(k * n, -1) @ bent.T
    told = point.offset - point.mean[c]
    return _Rows(matrix.reshape(k * n, -1), target.ravel() + modes @ told, modes, terms)


def _by_shot(factors: Floats) -> Floats:
    """Factors (k, n, q, p) of errors that each shot has for itself: (k n, k q p), zero between shots."""
    k, n, _, _ = factors.shape
    blocks = np.zeros((k, n, k, factors[0, 0].size))
    blocks[np.arange(k), :, np.arange(k)] = factors.reshape(k, n, -1)
    return blocks.reshape(k * n, -1)


def _paper_rows(evidence: Evidence, basis: Basis) -> Sensing:
    """Eq. (8) to (10): F Ψ x = y."""
    power = evidence.lamp[0] * STEP / (evidence.lamp[0] @ evidence.white_reflectance * STEP)
    y = np.moveaxis(evidence.signals[0], -1, 0)  # (3, n)
    variance = np.moveaxis(evidence.errors(basis)[0], -1, 0) ** 2 + (evidence.chart_tolerance * y) ** 2
    sigma = np.maximum(variance, FLOOR**2)[:, :, None] * np.eye(y.shape[1])
    matrix = (evidence.reflectance * power) @ basis.dictionary
    return Sensing(matrix, y.copy(), sigma, {"noise": sigma}, evidence.lamp)
