"""The dense linear model: rows one by one and their whole covariance, by NumPy and LAPACK alone.

An oracle for `camssf.recovery`, by another hand and other means: one observation, one row after the other, errors as
whole matrices Σ by source, no block form. It must not import the formulas that it
judges.

Letters as in the paper: R reflectance, L lamp, Ψ basis, x code, y signals. ρ_w is the white reference.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import NODES, Basis
from camssf.recovery.observation import Observation
from camssf.rules import rules

DARKEST = rules().number("gains.darkest")
BETWEEN = np.stack([np.interp(WAVELENGTHS, NODES, node) for node in np.eye(NODES.size)], axis=1)
"""(681, 69): a curve on the grid is this times its nodes; its transpose takes an integral over the grid to them."""


def rule(name: str) -> float:
    """A number of the table of known errors."""
    return rules().number(f"covariance.{name}")


@dataclass(frozen=True)
class DenseModel:
    """b = A x + error, error ~ N(0, Σ): A (N, 3 r), b (N,), summands (N, N) of Σ by source, D (N, k q) of lamp modes.

    Rows go by channel, then shot, then patch. D Dᵀ is in Σ.
    """

    A: Floats
    b: Floats
    terms: dict[str, Floats]
    D: Floats

    @property
    def sigma(self) -> Floats:
        """(N, N) Σ."""
        return sum(self.terms.values())

    @property
    def log_evidence(self) -> float:
        """ln N(b; 0, Σ + A Aᵀ) but for ½ N ln 2 π."""
        root = np.linalg.cholesky(self.sigma + self.A @ self.A.T)
        rest = solve_triangular(root, self.b, lower=True)
        return float(-0.5 * (rest @ rest + 2.0 * np.log(np.diag(root)).sum()))


def dense_model(observation: Observation, basis: Basis) -> DenseModel:
    """The model of an observation on a basis with a mean."""
    start = _prior(observation, basis)
    rows = _Rows(observation, basis, start)
    scale = _patch_scales(rows)
    if observation.lamp_modes.any() or observation.gain_modes.any():
        rows = _Rows(observation, basis, _first_pass(rows, scale))
    rows.terms["chart"] *= scale
    rows.terms["lamp modes"] += rows.D @ rows.D.T
    rows.terms["uneven light"] += rows.G @ rows.G.T
    return DenseModel(rows.A, rows.b, rows.terms, rows.D)


@dataclass(frozen=True)
class _Point:
    """Where the rows are linearised."""

    curves: Floats  # (3, v) s₀
    lamp: Floats  # (k, v) 1 + Σ û m
    level: Floats  # (k, n) 1 - Σ v̂ φ, at least DARKEST
    modes: Floats  # (k q,) û
    gains: Floats  # (k g,) v̂
    modes_covariance: Floats  # (k q, k q) of u
    code_covariance: Floats  # (3 r, 3 r) of x


def _prior(observation: Observation, basis: Basis) -> _Point:
    """The prior means: μ, the lamp as given, even light; u and x ~ N(0, I)."""
    k, n, _ = observation.signals.shape
    kq, kg = (k * modes.shape[1] for modes in (observation.lamp_modes, observation.gain_modes))
    code = np.eye(3 * basis.dictionary.shape[2])
    mean, even = basis.mean[:, ::10], np.ones((k, n))
    return _Point(mean, np.ones((k, NODES.size)), even, np.zeros(kq), np.zeros(kg), np.eye(kq), code)


class _Rows:
    """The rows at a point: A (N, 3 r), b (N,), D of lamp modes (N, k q), G of gain modes (N, k g), Σ by source.

    With W = Σ ρ_w L s dλ, the prediction is ŷ = Σ R L s dλ / W. A has ŷ in place of y if the shot's lamp has modes,
    since y is not linear in them. Sources of Σ, beside D Dᵀ and G Gᵀ:

        noise        se²                                                  independent
        chart        (τ y / 20)²                                          independent
                     τ Σ (0.6 R u₁ + u₂ / 3 + 70 nm · dR/dλ u₃) h L s dλ / W  one u a patch, for all shots; κ = 0.7 of
                                                                            its variance common to the channels;
                                                                            h = 1 + 1.6 / (1 + exp(-(λ - 650) / 8))
        white        -ŷ Σ ρ_w ε_w L s dλ / W                              one ε_w for all rows
        lamp         Σ (R - ŷ ρ_w) L η s dλ / W                           one smooth η a shot, for all channels
                     ŷ / 100                                              drift of the light: one a shot, all channels
        lamp modes   curvature: u ∂²y / ∂u ∂x x
        uneven light own gain errors of a channel

    Errors of lamp and white enter with ŷ, not with the measured y: otherwise a mere change of scale could explain the
    signals. The independent part of a row's standard error has a floor.
    """

    def __init__(self, observation: Observation, basis: Basis, point: _Point) -> None:
        self.observation, self.basis, self.point = observation, basis, point
        k, n, _ = observation.signals.shape
        q, g = observation.lamp_modes.shape[1], observation.gain_modes.shape[1]
        self.index = np.array(list(product(range(3), range(k), range(n))))
        N, r, v = len(self.index), basis.dictionary.shape[2], NODES.size
        modes, phi = observation.lamp_modes[..., ::10], observation.gain_modes
        mean, atoms = basis.mean[:, ::10], _anchored(observation, basis)
        errors = observation.errors(basis)
        slope = rule("edge") * np.gradient(observation.reflectance, STEP, axis=-1)
        self.A, self.b, self.D, self.G = np.zeros((N, 3 * r)), np.zeros(N), np.zeros((N, k * q)), np.zeros((N, k * g))
        bent = np.zeros((N, k * q, 3 * r))
        self.y, self.predicted, self.error, tau = np.zeros((4, N))
        patches, edges, light, whites = np.zeros((4, N, v))
        for i, (c, j, p) in enumerate(self.index):
            curve, lamp = point.curves[c], point.lamp[j]
            power = observation.lamp[j] * STEP
            white = (power * observation.white_reflectance) @ BETWEEN
            W = white @ (lamp * curve)
            rho = white * lamp / W
            patch = (power * observation.reflectance[p]) @ BETWEEN * lamp / W
            measured, level = observation.signals[j, p, c], point.level[j, p]
            y, predicted = measured * level, patch @ curve
            of = predicted if modes[j].any() else y
            own, shot, gain = (slice(at * size, (at + 1) * size) for at, size in ((c, r), (j, q), (j, g)))
            self.A[i, own] = (patch - of * rho) @ atoms[c]
            self.b[i] = y - of - (patch - of * rho) @ mean[c]
            self.G[i, gain] = measured * phi[j, :, p]
            a, b = (patch - predicted * rho) / lamp, rho / lamp  # of the lamp as given
            steps = modes[j] @ (a * curve)  # ∂y / ∂u
            self.D[i, shot] = steps
            # ∂²y / ∂u ∂x, where y is a quotient N / D and D = 1: ∂²N - ∂D ∂y - ∂y ∂D
            bent[i, shot, own] = (modes[j] * a) @ atoms[c]
            bent[i, shot, own] -= np.outer(modes[j] @ (b * curve), (a * lamp) @ atoms[c])
            bent[i, shot, own] -= np.outer(steps, (b * lamp) @ atoms[c])
            self.y[i], self.predicted[i], self.error[i] = y, predicted, errors[j, p, c] * level
            tau[i] = observation.chart_tolerance[p]
            patches[i], whites[i] = patch * curve, rho * curve
            edges[i] = (power * slope[p]) @ BETWEEN * lamp / W * curve
            light[i] = power @ BETWEEN * lamp / W * curve
        self.b += self.D @ point.modes + self.G @ point.gains
        self.terms = self._covariance(tau, patches, edges, light, whites)
        curvature = np.tensordot(bent, point.modes_covariance, axes=(1, 0)).swapaxes(1, 2) @ point.code_covariance
        self.terms["lamp modes"] = curvature.reshape(N, -1) @ bent.reshape(N, -1).T
        self.terms["uneven light"] = self.same(0) * observation.gain_own**2 * (self.G @ self.G.T)

    def same(self, which: int) -> Floats:
        """1 where two rows are of the same channel (0), shot (1) or patch (2)."""
        label = self.index[:, which]
        return np.asarray(label[:, None] == label, float)

    def _covariance(
        self, tau: Floats, patches: Floats, edges: Floats, light: Floats, whites: Floats
    ) -> dict[str, Floats]:
        over_chart, over_lamp, over_table = (
            _smooth_errors(rule(f"{name}_correlation")) for name in ("chart", "lamp", "table")
        )
        red = 1.0 + rule("red_more") / (1.0 + np.exp(-(NODES[:, None] - rule("red_from")) / rule("red_over")))
        parts = (
            rule("relative") * patches @ (red * over_chart),
            rule("absolute") * light @ (red * over_table),
            edges @ (red * over_table),
        )
        chart = tau[:, None] * np.concatenate(parts, axis=1)
        white = self.observation.white_tolerance * self.predicted[:, None] * (whites @ over_chart)
        against = self.observation.lamp_tolerance[self.index[:, 1], None] * (
            patches - self.predicted[:, None] * whites
        )
        lamp = np.concatenate([against @ over_lamp, rule("drift") * self.predicted[:, None]], axis=1)
        own = (rule("independent_share") * tau * self.y) ** 2
        floor = rule("floor")
        # max(se² + own, floor²) - noise, without a difference of two large numbers where a signal is masked.
        independent = np.maximum(own - np.maximum(floor**2 - self.error**2, 0.0), 0.0)
        shared = self.same(2) * np.where(self.same(0), 1.0, rule("channel_share"))
        return {
            "noise": np.diag(np.maximum(self.error**2, floor**2)),
            "chart": shared * (chart @ chart.T) + np.diag(independent),
            "white": white @ white.T,
            "lamp": self.same(1) * (lamp @ lamp.T),
        }


def _anchored(observation: Observation, basis: Basis) -> Floats:
    """Ψ (3, v, r) at the nodes, whose atoms leave the white of the first shot as the mean curve has it."""
    white = (observation.lamp[0] * STEP * observation.white_reflectance) @ BETWEEN
    mean, atoms = basis.mean[:, ::10], basis.dictionary[:, ::10]
    return np.stack([own - np.outer(m, (white @ own) / (white @ m)) for m, own in zip(mean, atoms, strict=True)])


def _smooth_errors(length: float) -> Floats:
    """Factor Φ, (v, p), of a smooth random error at the nodes: Φ Φᵀ = exp(-½ (Δλ / ℓ)²)."""
    step = length / 2.0
    points = np.arange(380.0 - 2.0 * length, 720.0 + 2.0 * length + step, step)
    weight = np.sqrt(step / (length * np.sqrt(np.pi / 2.0)))
    return np.asarray(weight * np.exp(-(((NODES[:, None] - points) / length) ** 2)))


def _patch_scales(rows: _Rows) -> Floats:
    """Scale (N, N) of the chart's covariance, one number a patch: EM steps by the explicit inverse of P."""
    chart, patch = rows.terms["chart"], rows.index[:, 2]
    rest = sum(rows.terms.values()) - chart + rows.A @ rows.A.T + rows.D @ rows.D.T + rows.G @ rows.G.T
    scales, freedom = np.ones(patch.max() + 1), rule("patch_freedom")
    for _ in range(3):
        inverse = cho_solve(cho_factor(rest + chart * scales[patch], lower=True), np.eye(len(rest)))
        e = inverse @ rows.b
        for p, scale in enumerate(scales.copy()):
            own = np.flatnonzero(patch == p)
            part = scale * chart[np.ix_(own, own)]
            q, t = e[own] @ part @ e[own], np.trace(part @ inverse[np.ix_(own, own)])
            scales[p] = np.clip(scale * (freedom + q) / (freedom + t), 1.0, rule("patch_most"))
    return np.broadcast_to(scales[patch], rest.shape)


def _first_pass(rows: _Rows, scale: Floats) -> _Point:
    """Gaussian posterior of lamps, gains and curves, from rows linearised at the prior means.

    With P = Σ + A Aᵀ, and D of both u and v, Λ = Dᵀ P⁻¹ D and h = Dᵀ P⁻¹ b: û = C h with C = (I + Λ)⁻¹, and
    x̂ = Aᵀ P⁻¹ (b - D û). `code_covariance` is the one given lamps and gains, I - Aᵀ P⁻¹ A.
    """
    observation, (k, n, _) = rows.observation, rows.observation.signals.shape
    rows.terms["chart"] *= scale
    # Whitened by P = L Lᵀ: an explicit P⁻¹ loses twice the digits, and modes may raise P's condition above 1e12.
    root = np.linalg.cholesky(sum(rows.terms.values()) + rows.A @ rows.A.T)
    A, b, modes = (solve_triangular(root, part, lower=True) for part in (rows.A, rows.b, np.hstack([rows.D, rows.G])))
    root = np.linalg.cholesky(np.eye(modes.shape[1]) + modes.T @ modes)
    factor = solve_triangular(root, np.eye(len(root)), lower=True)  # C = factorᵀ factor
    estimate = factor.T @ (factor @ (modes.T @ b))
    code = (A.T @ (b - modes @ estimate)).reshape(3, -1)
    u, v = np.split(estimate, [rows.D.shape[1]])
    lamp = 1.0 + np.einsum("kq,kqv->kv", u.reshape(k, -1), observation.lamp_modes[..., ::10])
    level = 1.0 - np.einsum("kg,kgn->kn", v.reshape(k, -1), observation.gain_modes) if v.size else np.ones((k, n))
    atoms = _anchored(observation, rows.basis)
    curves = rows.basis.mean[:, ::10] + np.einsum("cvr,cr->cv", atoms, code)
    of_modes = factor[:, : u.size]
    code_covariance = np.eye(A.shape[1]) - A.T @ A
    floors = (np.maximum(part, DARKEST) for part in (lamp, level))
    return _Point(curves, *floors, u, v, of_modes.T @ of_modes, code_covariance)
