"""The rows that the curves must satisfy, linearised at a point: A, b and the derivatives by lamp and gain modes.

Letters as in the paper: R reflectance, L lamp, Ψ basis, x code, y signals. ρ_w is the white reference.
h hypotheses, n patches, 3 channels, k shots; v = 69 nodes, m = 681 points of the grid, r atoms a channel, q lamp
modes and g gain modes a shot. There are N = 3 k n rows, ordered by patch, channel and shot. An axis c, e or b is as
long as h, or 1 if all hypotheses have the same chart, signals or basis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from camssf.grid import STEP, Floats
from camssf.recovery.arrays import Array, constant, eye, namespace, zeros
from camssf.recovery.basis import Basis, fold
from camssf.recovery.covariance import (
    FLOOR,
    Covariance,
    LinearisedSignals,
    Tolerances,
    by_shot,
    covariance,
    patchwise,
)
from camssf.rules import rules

DARKEST = rules().number("gains.darkest")
"""Lower limit of the factors by which lamp modes and gain modes change the light."""


@dataclass(frozen=True)
class Hypotheses:
    """What is known of a capture under h hypotheses.

    Attributes:
        signals, standard_error: (e, k, n, 3), MASKED_STANDARD_ERROR for masked signals.
        reflectance: (c, n, m) of the patches.
        chart_tolerance: (n,) their relative error.
        white_reflectance: (c, m).
        white_tolerance: its relative error, a number.
        lamp: (h, k, m) relative power.
        lamp_tolerance: (h, k) relative error of each lamp.
        lamp_modes: (h, k, q, m), q ≥ 1; zeros for none.
        gain_modes: (k, g, n), g ≥ 1; zeros for none.
        gain_own: size of the gain errors that are independent by channel, relative to the gain modes.
        mean: (b, 3, v) μ at the nodes.
        dictionary: (b, 3, v, r) Ψ at the nodes.
    """

    signals: Array
    standard_error: Array
    reflectance: Array
    chart_tolerance: Array
    white_reflectance: Array
    white_tolerance: Array
    lamp: Array
    lamp_tolerance: Array
    lamp_modes: Array
    gain_modes: Array
    gain_own: Array
    mean: Array
    dictionary: Array


@dataclass(frozen=True)
class Folded:
    """The hypotheses with every integral over the grid folded onto the nodes.

    Attributes:
        hypotheses: what was folded.
        sizes: k, n, q, g, r.
        signal, standard_error: (e, 3, k, n).
        atoms: (h, 3, v, r) Ψ, anchored.
        patches: (h, k, n, v) R L dλ.
        edges: (h, k, n, v) dR/dλ L dλ.
        white, light: (h, k, v) ρ_w L dλ and L dλ.
        modes: (h, k, q, v) lamp modes.
        gains: (e, n, 3, k, k, g) D of the gain modes, zero between shots.
    """

    hypotheses: Hypotheses
    sizes: tuple[int, int, int, int, int]
    signal: Array
    standard_error: Array
    atoms: Array
    patches: Array
    edges: Array
    white: Array
    light: Array
    modes: Array
    gains: Array

    @property
    def h(self) -> Any:
        """Number of hypotheses."""
        return self.modes.shape[0]

    @property
    def mean(self) -> Array:
        """(b, 3, v) μ."""
        return self.hypotheses.mean

    @property
    def has_modes(self) -> Array:
        """Whether a lamp or the light on the patches has modes."""
        xp, modes = namespace(self.modes), (self.modes, self.hypotheses.gain_modes)
        return (xp.max(xp.abs(modes[0])) > 0.0) | (xp.max(xp.abs(modes[1])) > 0.0)


@dataclass(frozen=True)
class Point:
    """Linearisation points, and the covariances of modes and code.

    Attributes:
        curves: (h, 3, v) s₀.
        lamp: (h, k, v) 1 + Σ û m.
        level: (h, k, n) 1 - ĥ.
        offset: (h, k q) û.
        gain_code: (h, k g) v̂.
        mode_covariance: (h, k q, k q) of u.
        code_covariance: (h, 3 r, 3 r) of x.
    """

    curves: Array
    lamp: Array
    level: Array
    offset: Array
    gain_code: Array
    mode_covariance: Array
    code_covariance: Array


@dataclass(frozen=True)
class Rows:
    """Rows b = A x + error of one linearisation.

    Attributes:
        A: (h, N, 3 r), zero between channels.
        b: (h, N).
        covariance: of their errors, but for those of the modes.
        white_signal: (h, 3, k) W.
        against_white: (h, 3, k, n, v) (R - ŷ ρ_w) L dλ / W.
        white: (h, 3, k, 1, v) ρ_w L dλ / W.
    """

    A: Array
    b: Array
    covariance: Covariance
    white_signal: Array
    against_white: Array
    white: Array

    def scaled(self, scale: Array) -> Rows:
        """With `scale` (h, n) times the chart's variance of each patch."""
        return replace(self, covariance=self.covariance.scaled(scale))


def fold_hypotheses(hypotheses: Hypotheses) -> Folded:
    """Fold the integrals onto the nodes, and anchor the basis to the first shot's white."""
    xp, power = namespace(hypotheses.signals), hypotheses.lamp[:, :, None, :] * STEP  # (h, k, 1, m)
    reflectance, rho = hypotheses.reflectance[:, None, ...], hypotheses.white_reflectance[:, None, None, :]
    white = fold(power, rho)[:, :, 0, :]
    signal, standard_error = (
        xp.permute_dims(x, (0, 3, 1, 2)) for x in (hypotheses.signals, hypotheses.standard_error)
    )
    gains = signal[..., None] * hypotheses.gain_modes.mT  # (e, 3, k, n, g)
    (_, k, q, _), (_, g, n), r = (
        hypotheses.lamp_modes.shape,
        hypotheses.gain_modes.shape,
        hypotheses.dictionary.shape[-1],
    )
    return Folded(
        hypotheses=hypotheses,
        sizes=(k, n, q, g, r),
        signal=signal,
        standard_error=standard_error,
        atoms=anchored(hypotheses.mean, hypotheses.dictionary, white[:, :1, None, :]),
        patches=fold(power, reflectance),
        edges=fold(power, slope(reflectance)),
        white=white,
        light=fold(power)[:, :, 0, :],
        modes=hypotheses.lamp_modes[..., ::10],
        gains=by_shot(patchwise(gains)),
    )


def anchored(mean: Array, dictionary: Array, white: Array) -> Array:
    """The dictionary (..., 3, v, r) with the scale of the curves fixed by a white: no atom changes Σ white s dλ.

    Rows do not depend on the scale of s. If the white signal were free, the noise of every row would be proportional
    to it, and the smallest residual would belong to a camera of low sensitivity. To first order in the code,
    s / (w s) · (w μ) = μ + (Ψ - μ (w Ψ) / (w μ)) x.

    Args:
        mean: (..., 3, v) μ.
        dictionary: (..., 3, v, r) Ψ.
        white: (..., 1, 1, v) w = ρ_w L of the first shot.
    """
    return dictionary - mean[..., None] * ((white @ dictionary) / (white @ mean[..., None]))


def anchor(basis: Basis, white: Floats) -> Basis:
    """The basis with its scale fixed by a shot's white ρ_w L (681,), `anchored`; one without a mean unchanged."""
    if not basis.mean.any():
        return basis
    return replace(basis, dictionary=anchored(basis.mean, basis.dictionary, white[None, None]))


def slope(f: Array) -> Array:
    """d f / dλ on the grid, (..., m): central differences, one-sided at the ends."""
    xp, steps = namespace(f), (f[..., 1:] - f[..., :-1]) / STEP
    return xp.concat([steps[..., :1], 0.5 * (steps[..., :-1] + steps[..., 1:]), steps[..., -1:]], axis=-1)


def levels(gain_code: Array, gain_modes: Array) -> Array:
    """1 - ĥ (..., k, n) from v̂ (..., k, g) and gain modes (..., k, g, n), at least DARKEST."""
    return namespace(gain_code).maximum(1.0 - (gain_code[..., None, :] @ gain_modes)[..., 0, :], DARKEST)


def prior_point(folded: Folded) -> Point:
    """The linearisation point at the prior means: μ, the lamp as folded, even light; u and x ~ N(0, I)."""
    xp, h, (k, n, q, g, r) = namespace(folded.signal), folded.h, folded.sizes
    v = folded.modes.shape[-1]
    return Point(
        curves=xp.broadcast_to(folded.mean, (h, 3, v)),
        lamp=xp.ones((h, k, v), dtype=xp.float64),
        level=xp.ones((h, k, n), dtype=xp.float64),
        offset=zeros(xp, h, k * q),
        gain_code=zeros(xp, h, k * g),
        mode_covariance=xp.broadcast_to(eye(xp, k * q), (h, k * q, k * q)),
        code_covariance=xp.broadcast_to(eye(xp, 3 * r), (h, 3 * r, 3 * r)),
    )


def rows_at(folded: Folded, point: Point) -> Rows:
    """The rows at a point; the formulas are those of `camssf.recovery.whitening.whitened_model`.

    Where a lamp has modes, the white's term has the predicted signal ŷ in place of y, because y is not linear in u.
    """
    xp, h, (k, n, _, _, r), hypotheses = namespace(folded.signal), folded.h, folded.sizes, folded.hypotheses
    curve = point.curves[:, :, None, :, None]  # (h, 3, 1, v, 1)
    white_signal = point.curves @ (folded.white * point.lamp).mT  # (h, 3, k) W
    per_white = (point.lamp[:, None, ...] / white_signal[..., None])[:, :, :, None, :]  # (h, 3, k, 1, v)
    patches, edges = (x[:, None, ...] * per_white for x in (folded.patches, folded.edges))  # (h, 3, k, n, v)
    white, light = (x[:, None, :, None, :] * per_white for x in (folded.white, folded.light))  # (h, 3, k, 1, v)
    y = folded.signal * point.level[:, None, ...]  # (h, 3, k, n)
    predicted = (patches @ curve)[..., 0]  # ŷ
    lamp_has_modes = xp.max(xp.abs(folded.modes), axis=(2, 3)) > 0.0  # (h, k)
    about = xp.where(lamp_has_modes[:, None, :, None], predicted, y)
    a = patches - about[..., None] * white
    target = (y - about) - (a @ folded.mean[:, :, None, :, None])[..., 0]
    linearised = LinearisedSignals(
        y, predicted, folded.standard_error * point.level[:, None, ...], curve, patches, edges, light, white
    )
    tolerances = Tolerances(hypotheses.chart_tolerance, hypotheses.white_tolerance, hypotheses.lamp_tolerance)
    factors = patchwise(a @ folded.atoms[:, :, None, ...])[:, :, :, :, None, :]  # (h, n, 3, k, 1, r)
    return Rows(
        A=xp.reshape(factors * constant(xp, np.eye(3)[:, None, :, None]), (h, 3 * k * n, 3 * r)),
        b=xp.reshape(patchwise(target), (h, 3 * k * n)),
        covariance=covariance(linearised, tolerances),
        white_signal=white_signal,
        against_white=linearised.against_white,
        white=white,
    )


@dataclass(frozen=True)
class ModeRows:
    """What lamp modes and gain modes add to the rows.

    Attributes:
        lamps: (h, N, k q) D = ∂y / ∂u of the lamp modes.
        gains: (h, N, k g) D = y φ of the gain modes.
        by_channel: (h, N, 3 k g) factors of the gain errors that are independent by channel.
        curvature: (h, N, N) covariance that B = ∂²y / ∂u ∂x adds.
    """

    lamps: Array
    gains: Array
    by_channel: Array
    curvature: Array

    @property
    def both(self) -> Array:
        """(h, N, k q + k g) D of lamps and gains."""
        return namespace(self.lamps).concat([self.lamps, self.gains], axis=-1)


def mode_rows(folded: Folded, rows: Rows, point: Point) -> ModeRows:
    """Derivatives of the rows by lamp and gain modes, and the lamps' curvature."""
    xp, h, (k, n, q, g, r) = namespace(folded.signal), folded.h, folded.sizes
    N, K = 3 * k * n, k * q
    lamp = point.lamp[:, None, :, None, :]
    relative, white = rows.against_white / lamp, rows.white / lamp  # of the lamps as given
    curve, atoms = point.curves[:, :, None, None, :], folded.atoms[:, :, None, ...]
    modes, across = (
        folded.modes[:, None, :, None, ...],
        folded.modes.mT[:, None, ...],
    )  # (h, 1, k, 1, q, v), (h, 1, k, v, q)
    steps, white_steps = (relative * curve) @ across, (white * curve) @ across  # (h, 3, k, n or 1, q)
    # B = ∂²y / ∂u ∂x, where y is a quotient N / D and D = 1: ∂²N - ∂D ∂y - ∂y ∂D
    B = (relative[..., None, :] * modes) @ atoms[:, :, :, None, ...]  # (h, 3, k, n, q, r)
    B = B - white_steps[..., None] * (rows.against_white @ atoms)[..., None, :]
    B = B - steps[..., None] * (rows.white @ atoms)[..., None, :]
    # Cov of Σ u_q B_qr x_r: of C ⊗ X, rows of two channels have the block of X between these channels in common.
    B = xp.permute_dims(B, (0, 1, 3, 2, 4, 5))[:, :, :, :, None, ...] * eye(xp, k)[..., None, None]
    B = xp.reshape(B, (h, 3, n * k, K, r))  # zero between shots
    X = xp.permute_dims(xp.reshape(point.code_covariance, (h, 3, r, 3, r)), (0, 1, 3, 2, 4))  # (h, 3, 3, r, r)
    left = xp.reshape(point.mode_covariance[:, None, None, ...] @ B, (h, 3, 1, n * k * K, r)) @ X
    left = xp.reshape(left, (h, 3, 3, n * k, K * r))
    spread = left @ xp.reshape(B, (h, 1, 3, n * k, K * r)).mT  # (h, 3, 3, n k, n k)
    spread = xp.permute_dims(xp.reshape(spread, (h, 3, 3, n, k, n, k)), (0, 3, 1, 4, 5, 2, 6))
    apart = folded.gains[:, :, :, :, None, ...] * constant(
        xp, np.eye(3)[:, None, :, None, None]
    )  # (e, n, 3, k, 3, k, g)
    return ModeRows(
        lamps=xp.reshape(by_shot(patchwise(steps)), (h, N, K)),
        gains=gain_rows(folded),
        by_channel=folded.hypotheses.gain_own
        * xp.reshape(xp.broadcast_to(apart, (h, n, 3, k, 3, k, g)), (h, N, 3 * k * g)),
        curvature=xp.reshape(spread, (h, N, N)),
    )


def gain_rows(folded: Folded) -> Array:
    """D (h, N, k g) of the gain modes φ: y φ with the measured y, zero between shots."""
    xp, h, (k, n, _, g, _) = namespace(folded.signal), folded.h, folded.sizes
    return xp.reshape(xp.broadcast_to(folded.gains, (h, n, 3, k, k, g)), (h, 3 * k * n, k * g))


def paper_rows(
    signals: Array, error: Array, tolerance: Array, chart: Array, white: Array, lamp: Array, dictionary: Array
) -> tuple[Array, Array, Array]:
    """The paper's Eq. (8) to (10), F Ψ x = y: A (3 or 1, n, r), b (3, n, 1) and the variances of the rows (3, n, 1).

    F = R L dλ with L scaled so that Σ ρ_w L dλ = 1; the rows are independent, of variance se² + (τ y)².

    Args:
        signals, error: (n, 3) y and se.
        tolerance: (n,) τ.
        chart: (n, m) R.
        white: (m,) ρ_w.
        lamp: (m,) L.
        dictionary: (m, r) Ψ.
    """
    xp = namespace(signals)
    power = lamp / xp.sum(lamp * white)
    y, se = signals.mT[..., None], error.mT[..., None]
    variance = xp.maximum(se**2 + (tolerance[:, None] * y) ** 2, FLOOR**2)
    return ((chart * power) @ dictionary)[None, ...], y, variance
