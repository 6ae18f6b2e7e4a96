"""Signals → sensing matrix: the rows that the curves must satisfy, and the covariance of their errors.

Letters as in the paper: R reflectance, L lamp, Ψ basis, x code, y signals. ρ_w is the white reference.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from camssf.basis import NODES, Basis, interpolate
from camssf.grid import STEP, Floats

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
    """

    matrix: Floats
    target: Floats
    covariance: Floats
    terms: dict[str, Floats] = field(default_factory=dict)


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


def smooth_errors(length: float) -> Floats:
    """Directions Φ of a smooth random error on the 5-nm nodes: ε = Φ u with u standard normal, (69, p).

    White noise on points ℓ/2 apart, smoothed so that Φ Φᵀ = exp(-½ (Δλ / ℓ)²), to 1e-3 at the ends of the grid.
    """
    step = length / 2.0
    points = np.arange(380.0 - 2.0 * length, 720.0 + 2.0 * length + step, step)
    weight = np.sqrt(step / (length * np.sqrt(np.pi / 2.0)))
    return np.asarray(weight * np.exp(-(((NODES[:, None] - points) / length) ** 2)))


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

    With a mean s₀ = μ, W_j = Σ ρ_w L_j s₀ dλ and ŷ_ij = Σ R_i L_j s₀ dλ / W_j:

        row       a_ij = (R_i - y_ij ρ_w) L_j dλ / W_j,   A = a Ψ,   b = -a μ
        noise     se_ij² + (τ_i y_ij / 20)²                            independent
        chart     Σ ε_i L_j s₀ dλ / W_j                                one ε_i a patch, for all shots
        white     -ŷ_ij Σ ρ_w ε_w L_j s₀ dλ / W_j                      one ε_w for all rows
        lamp      Σ (R_i - ŷ_ij ρ_w) L_j η_j s₀ dλ / W_j               one η_j a shot: smooth, and the modes

    The lamp's and the white's errors enter with the predicted ŷ, not with the measured y: else a mere scale
    would eat the evidence. For the same reason Ψ is anchored to the first shot's white.

    Args:
        signals, standard_error: (k, n, 3).
        reflectance: (n, 681).
        lamp: (k, 681), any scale.
        basis: mean (3, 681), dictionary (3, 681, r).
        chart_tolerance: (n,) τ.
        white_reflectance: (681,).
        white_tolerance: size of ε_w.
        lamp_tolerance: (k,) size of the smooth part of η.
        lamp_modes: (k, q, 681).
    """
    k, n, _ = signals.shape
    if not basis.mean.any():
        return _paper_rows(signals, standard_error, reflectance, lamp, basis, chart_tolerance, white_reflectance)
    basis = anchor(basis, white_reflectance * lamp[0])
    chart_errors, lamp_errors = smooth_errors(CHART_CORRELATION), smooth_errors(LAMP_CORRELATION)
    table_errors = smooth_errors(TABLE_CORRELATION)
    edge = EDGE * np.gradient(reflectance, STEP, axis=1)
    matrix, target = [], []
    terms: dict[str, list[Floats]] = {source: [] for source in SOURCES}
    same_patch, same_shot = np.tile(np.eye(n), (k, k)), np.kron(np.eye(k), np.ones((n, n)))
    for c in range(3):
        y, se = signals[:, :, c], standard_error[:, :, c]
        mean = basis.mean[c]
        power = lamp * STEP  # (k, m)
        white = power @ (white_reflectance * mean)  # (k,) W
        seen = power[:, None, :] * reflectance / white[:, None, None]  # (k, n, m) R L dλ / W
        seen_white = power * white_reflectance / white[:, None]  # (k, m)
        expected = seen @ mean  # (k, n) ŷ
        a = seen - y[:, :, None] * seen_white[:, None, :]
        a_expected = seen - expected[:, :, None] * seen_white[:, None, :]

        noise = np.maximum(se**2, FLOOR**2)
        independent = np.maximum(se**2 + (INDEPENDENT_SHARE * chart_tolerance * y) ** 2, FLOOR**2) - noise
        # A smooth error times s₀ is a curve like any other: known on the nodes, straight between them.
        chart_curves = interpolate(chart_errors * mean[::10, None])  # (m, p)
        lamp_curves = interpolate(lamp_errors * mean[::10, None])
        table_curves = interpolate(table_errors * mean[::10, None])
        light = power / white[:, None]  # (k, m) L dλ / W
        floor = np.broadcast_to((ABSOLUTE * (light @ table_curves))[:, None, :], (k, n, table_curves.shape[1]))
        edges = (light[:, None, :] * edge) @ table_curves
        chart = np.concatenate([RELATIVE * (seen @ chart_curves), floor, edges], axis=2)  # (k, n, p)
        chart = chart_tolerance[:, None] * chart
        paper = white_tolerance * expected[:, :, None] * (seen_white @ chart_curves)[:, None, :]
        smooth = lamp_tolerance[:, None, None] * (a_expected @ lamp_curves)  # (k, n, p')
        modes = np.einsum("knm,kqm->knq", a_expected * mean, lamp_modes)

        matrix.append(a.reshape(k * n, -1) @ basis.dictionary[c])
        target.append(-a.reshape(k * n, -1) @ mean)
        terms["noise"].append(np.diag(noise.ravel()))
        terms["chart"].append(np.diag(independent.ravel()) + same_patch * _outer(chart))
        terms["white"].append(_outer(paper))
        terms["lamp"].append(same_shot * _outer(smooth))
        terms["lamp modes"].append(same_shot * _outer(modes))
    parts = {source: np.stack(term) for source, term in terms.items()}
    return Sensing(np.stack(matrix), np.stack(target), np.asarray(sum(parts.values())), parts)


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
    return Sensing((reflectance * power) @ basis.dictionary, y.copy(), sigma, {"noise": sigma})


def _outer(factors: Floats) -> Floats:
    """Covariance (k n, k n) of errors that are factors (k, n, p) times standard normal numbers."""
    flat = factors.reshape(factors.shape[0] * factors.shape[1], -1)
    return np.asarray(flat @ flat.T)
