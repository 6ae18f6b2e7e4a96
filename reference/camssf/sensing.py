"""Signals → sensing matrix: the rows that the curves must satisfy, and the covariance of their errors.

Letters as in the paper: R reflectance, L lamp, Ψ basis, x code, y signals. ρ_w is the white reference.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from scipy.linalg import solve_triangular

from camssf.basis import NODES, Basis, fold, interpolate, steady_exp
from camssf.grid import STEP, WAVELENGTHS, Floats

CHART_CORRELATION = 100.0
"""Length over which the relative part of a chart's error, and a white's error, are smooth, nm."""
TABLE_CORRELATION = 25.0
"""Length over which the other parts of a chart's error are smooth, nm."""
RELATIVE, ABSOLUTE, EDGE = 0.6, 1.0 / 3.0, 70.0
"""A chart's error as parts of its tolerance τ: ε = τ (0.6 R u₁ + u₂ / 3 + 70 nm · dR/dλ u₃).

Robust fit (multivariate t) to the difference of the two measured tables in colour-science, BabelColor's and Ohta's:
1.8 % of R over 100 nm, 1.0 % of white over 35 nm and a wavelength error of 2.1 nm over 17 nm; the same on odd and on
even patches but for the first (0 to 2.4 %). One length stands for both short ones; τ = 3 % is a public table's."""
LAMP_CORRELATION = 60.0
"""Length over which a lamp's error is smooth, nm."""
INDEPENDENT_SHARE = 0.05
"""Part of the chart's tolerance that is independent from patch to patch and shot to shot."""
DARKEST = 0.02
"""No lamp is taken to be dimmer than this share of its mean at any wavelength."""
SOURCES = ("noise", "chart", "white", "lamp", "lamp modes")
FLOOR = 1e-4
"""No row is believed better than this share of its white signal."""


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


def smooth_errors(length: float, at: Floats = NODES) -> Floats:
    """Directions Φ of a smooth random error at these wavelengths: ε = Φ u with u standard normal, (len(at), p).

    White noise on points ℓ/2 apart, smoothed so that Φ Φᵀ = exp(-½ (Δλ / ℓ)²), to 1e-3 at the ends of the grid.
    """
    step = length / 2.0
    points = np.arange(380.0 - 2.0 * length, 720.0 + 2.0 * length + step, step)
    weight = np.sqrt(step / (length * np.sqrt(np.pi / 2.0)))
    return np.asarray(weight * steady_exp(-(((at[:, None] - points) / length) ** 2)))


@cache
def _on_nodes(length: float) -> Floats:
    """`smooth_errors`, once a process; nobody writes to it."""
    return smooth_errors(length)


def sense(
    signals: Floats,
    standard_error: Floats,
    reflectance: Floats,
    lamp: Floats,
    basis: Basis,
    *,
    chart_tolerance: Floats,
    white_reflectance: Floats,
    white_tolerance: float,
    lamp_tolerance: Floats,
    lamp_modes: Floats,
) -> Sensing:
    """Rows and their covariance, as in DESIGN.md, Mathematics 2 and 3.

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

    Args:
        signals, standard_error: (k, n, 3).
        reflectance: (n, 681).
        lamp: (k, 681), any scale.
        basis: mean (3, 681), dictionary (3, 681, r), straight between the 5-nm nodes.
        chart_tolerance: (n,) τ.
        white_reflectance: (681,).
        white_tolerance: size of ε_w.
        lamp_tolerance: (k,) size of the smooth η.
        lamp_modes: (k, q, 681), known on the 5-nm nodes.
    """
    if not basis.mean.any():
        return _paper_rows(signals, standard_error, reflectance, lamp, basis, chart_tolerance, white_reflectance)
    basis = anchor(basis, white_reflectance * lamp[0])
    power = lamp * STEP
    scene = _Scene(
        signals, standard_error, chart_tolerance, white_tolerance, lamp_tolerance, lamp_modes[:, :, ::10],
        basis.mean[:, ::10], basis.dictionary[:, ::10],
        fold(power[:, None, :] * reflectance),
        fold(power[:, None, :] * EDGE * np.gradient(reflectance, STEP, axis=1)),
        fold(power * white_reflectance),
        fold(power),
    )  # fmt: skip
    point = _look(scene) if scene.modes.any() else _start(scene)
    channels = [_rows(scene, point, c) for c in range(3)]
    terms = {source: np.stack([rows.terms[source] for rows in channels]) for source in SOURCES}
    modes = np.stack([rows.modes for rows in channels])
    terms["lamp modes"] += modes @ point.covariance @ np.swapaxes(modes, 1, 2)
    return Sensing(
        np.stack([rows.matrix for rows in channels]),
        np.stack([rows.target for rows in channels]),
        np.sum(list(terms.values()), axis=0),
        terms,
        lamp * interpolate(point.lamp.T).T,
        point.curves @ (scene.white * point.lamp).T,
    )


@dataclass(frozen=True)
class _Scene:
    """What is known, with every integral over the grid folded onto the nodes (v of them).

    Attributes:
        signals, standard_error: (k, n, 3).
        chart_tolerance: (n,).
        white_tolerance: one number.
        lamp_tolerance: (k,).
        modes: (k, q, v).
        mean, atoms: (3, v) μ and (3, v, r) Ψ.
        patches, edges: (k, n, v) R L dλ and 70 nm · dR/dλ L dλ.
        white, light: (k, v) ρ_w L dλ and L dλ.
    """

    signals: Floats
    standard_error: Floats
    chart_tolerance: Floats
    white_tolerance: float
    lamp_tolerance: Floats
    modes: Floats
    mean: Floats
    atoms: Floats
    patches: Floats
    edges: Floats
    white: Floats
    light: Floats


@dataclass(frozen=True)
class _Point:
    """Where the rows are taken, and what each channel is told of u.

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


def _start(scene: _Scene) -> _Point:
    """At the means: μ, the lamp as given, u ~ N(0, I)."""
    k, q, v = scene.modes.shape
    size = k * q
    of_u, of_x = (np.broadcast_to(np.eye(p), (3, p, p)) for p in (size, scene.atoms.shape[2]))
    return _Point(scene.mean, np.ones((k, v)), np.zeros(size), np.zeros((3, size)), of_u, of_x)


def _look(scene: _Scene) -> _Point:
    """What a first look says of lamps and curves: their Gaussian posterior, linearised at the means.

    With P = Σ + A Aᵀ a channel knows Λ = Dᵀ P⁻¹ D and h = Dᵀ P⁻¹ b of u. Then û = (I + Σ Λ)⁻¹ Σ h over the channels
    and x̂ = Aᵀ P⁻¹ (b - D û); but of u a channel is told only what the other two know, since its own rows still stand
    in its own problem. Of x̂ the covariance given the lamp is taken, I - Aᵀ P⁻¹ A.
    """
    start = _start(scene)
    channels = [_rows(scene, start, c) for c in range(3)]
    # Whitened, P = L Lᵀ: an explicit P⁻¹ would cost twice the digits, and modes may make P's condition 1e12 and more.
    whitened = [
        _whiten(
            np.sum(list(rows.terms.values()), axis=0) + rows.matrix @ rows.matrix.T,
            np.concatenate([rows.matrix, rows.target[:, None], rows.modes], axis=1),
        )
        for rows in channels
    ]
    r = scene.atoms.shape[2]
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
    mean, covariance = (np.stack(parts) for parts in zip(*others, strict=True))
    code = np.einsum("cnr,cn->cr", matrix, target - modes @ offset)
    spread = np.eye(r) - np.swapaxes(matrix, 1, 2) @ matrix
    k, q, _ = scene.modes.shape
    bend = 1.0 + np.einsum("kq,kqv->kv", offset.reshape(k, q), scene.modes)
    curves = scene.mean + np.einsum("cvr,cr->cv", scene.atoms, code)
    return _Point(curves, np.maximum(bend, DARKEST), offset, mean, covariance, spread)


def _whiten(covariance: Floats, columns: Floats) -> Floats:
    """L⁻¹ columns with covariance = L Lᵀ."""
    return np.asarray(solve_triangular(np.linalg.cholesky(covariance), columns, lower=True))


def _posterior(precision: Floats, pull: Floats) -> tuple[Floats, Floats]:
    """Λ⁻¹ h and Λ⁻¹, symmetric and of no negative eigenvalue whatever Λ's condition."""
    root = _whiten(precision, np.column_stack([np.eye(pull.size), pull]))
    return root[:, :-1].T @ root[:, -1], root[:, :-1].T @ root[:, :-1]


def _rows(scene: _Scene, point: _Point, c: int) -> _Rows:
    """One channel's rows about a point. A has ŷ for y where the shot's lamp has modes: y bends with such a lamp."""
    k, n, _ = scene.signals.shape
    y, se, tolerance = scene.signals[:, :, c], scene.standard_error[:, :, c], scene.chart_tolerance
    curve, atoms = point.curves[c], scene.atoms[c]
    white = (scene.white * point.lamp) @ curve  # (k,) W
    seen = scene.patches * (point.lamp / white[:, None])[:, None]  # (k, n, v) R L dλ / W
    seen_white = scene.white * point.lamp / white[:, None]  # (k, v)
    light = scene.light * point.lamp / white[:, None]
    edge = scene.edges * (point.lamp / white[:, None])[:, None]
    expected = seen @ curve  # (k, n) ŷ
    loose = np.any(scene.modes, axis=(1, 2), keepdims=True)[:, 0]
    about = np.where(loose, expected, y)
    a = seen - about[:, :, None] * seen_white[:, None]
    a_expected = seen - expected[:, :, None] * seen_white[:, None]
    matrix = a @ atoms  # (k, n, r)
    target = (y - about) - a @ scene.mean[c]

    # A smooth error times s₀ is a curve like any other: known on the nodes, straight between them.
    chart_curves, lamp_curves, table_curves = (
        _on_nodes(length) * curve[:, None] for length in (CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION)
    )
    floor = np.broadcast_to((light @ table_curves)[:, None], (k, n, table_curves.shape[1]))
    chart = np.concatenate([RELATIVE * (seen @ chart_curves), ABSOLUTE * floor, edge @ table_curves], axis=2)
    paper = scene.white_tolerance * expected[:, :, None] * (seen_white @ chart_curves)[:, None]
    smooth = scene.lamp_tolerance[:, None, None] * (a_expected @ lamp_curves)
    noise = np.maximum(se**2, FLOOR**2)
    independent = np.maximum(se**2 + (INDEPENDENT_SHARE * tolerance * y) ** 2, FLOOR**2) - noise
    same_patch, same_shot = np.tile(np.eye(n), (k, k)), np.kron(np.eye(k), np.ones((n, n)))
    terms = {
        "noise": np.diag(noise.ravel()),
        "chart": np.diag(independent.ravel()) + same_patch * _outer(tolerance[:, None] * chart),
        "white": _outer(paper),
        "lamp": same_shot * _outer(smooth),
    }

    given = a_expected / point.lamp[:, None]  # the modes are relative to the lamp as given
    steps = np.einsum("knv,kqv->knq", given * curve, scene.modes)
    modes = _by_shot(steps[..., None])
    # ∂²y / ∂u ∂x, where y is a quotient N / D and D = 1: ∂²N - ∂D ∂y - ∂y ∂D
    bent = np.einsum("knv,kqv,vr->knqr", given, scene.modes, atoms, optimize=True)
    off = ((scene.white / white[:, None] * curve)[:, None] * scene.modes).sum(axis=2)
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


def _paper_rows(
    signals: Floats,
    standard_error: Floats,
    reflectance: Floats,
    lamp: Floats,
    basis: Basis,
    tolerance: Floats,
    white_reflectance: Floats,
) -> Sensing:
    """Eq. (8) to (10): F Ψ x = y."""
    power = lamp[0] * STEP / (lamp[0] @ white_reflectance * STEP)
    y = np.moveaxis(signals[0], -1, 0)  # (3, n)
    variance = np.moveaxis(standard_error[0], -1, 0) ** 2 + (tolerance * y) ** 2
    sigma = np.maximum(variance, FLOOR**2)[:, :, None] * np.eye(y.shape[1])
    return Sensing((reflectance * power) @ basis.dictionary, y.copy(), sigma, {"noise": sigma}, lamp)


def _outer(factors: Floats) -> Floats:
    """Covariance (k n, k n) of errors that are factors (k, n, p) times standard normal numbers."""
    flat = factors.reshape(factors.shape[0] * factors.shape[1], -1)
    return np.asarray(flat @ flat.T)
