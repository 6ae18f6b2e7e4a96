"""Covariance of the errors of the signals, by source: noise, chart, white reference and lamp.

The linear model (at the mean camera), the verdict (at the solution), the budget and the predictions all use it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from camssf.grid import Floats
from camssf.recovery.arrays import Array, constant, eye, namespace
from camssf.recovery.basis import NODES
from camssf.rules import rules

CHART_CORRELATION = rules().number("covariance.chart_correlation")
"""Correlation length of the relative part of the chart's error and of the white reference's error, nm."""
TABLE_CORRELATION = rules().number("covariance.table_correlation")
"""Correlation length of the other parts of the chart's error, nm."""
RELATIVE, ABSOLUTE, EDGE = (rules().number(f"covariance.{name}") for name in ("relative", "absolute", "edge"))
"""Parts of the chart's error relative to its tolerance τ: ε = τ (0.6 R u₁ + u₂ / 3 + 70 nm · dR/dλ u₃).

From a robust fit (multivariate t) to the difference of the two measured tables in colour-science, BabelColor's and
Ohta's: 1.8 % of R over 100 nm, 1.0 % of white over 35 nm and a wavelength error of 2.1 nm over 17 nm.
TABLE_CORRELATION replaces the two short lengths; τ = 3 % is the tolerance of a public table."""
RED_MORE, RED_FROM, RED_OVER = (rules().number(f"covariance.{name}") for name in ("red_more", "red_from", "red_over"))
"""The chart's error in the deep red, relative to that elsewhere: 1 + 1.6 / (1 + exp(-(λ - 650 nm) / 8 nm))."""
LAMP_CORRELATION = rules().number("covariance.lamp_correlation")
"""Correlation length of a lamp's error, nm."""
INDEPENDENT_SHARE = rules().number("covariance.independent_share")
"""Part of the chart's tolerance that is independent from patch to patch and shot to shot."""
CHANNEL_SHARE = rules().number("covariance.channel_share")
"""Share of the variance of the chart's smooth error that is common to the channels; the rest is independent.

A wrong reflectance affects all three channels, but a real table also has errors of finer spectral structure than this
model, and each channel weighs other wavelengths. Pairs of measured tables gave this number (docs/verdict.md)."""
DRIFT = rules().number("covariance.drift")
"""Relative change of the light between a shot's chart frame and its white frame, one standard deviation."""
FLOOR = rules().number("covariance.floor")
"""Smallest standard error of a row, as a share of its white signal."""
SOURCES = ("noise", "chart", "white", "lamp", "lamp modes", "uneven light")
"""Of the errors; modes of lamps and of uneven light are unknowns of the model (`camssf.recovery.whitening`)."""


@dataclass(frozen=True)
class LinearisedSignals:
    """Signals and their derivatives at a linearisation point, curves s under lamps L.

    h hypotheses, 3 channels, k shots, n patches, v wavelengths; W = Σ ρ_w L s dλ of channel and shot.

    Attributes:
        signal, predicted: (h, 3, k, n) measured y, and ŷ predicted from s and L.
        standard_error: (h, 3, k, n) of y.
        curve: (h, 3, 1, v, 1) s.
        patches: (h, 3, k, n, v) R L dλ / W.
        edges: (h, 3, k, n, v) dR/dλ L dλ / W.
        light: (h, 3, k, 1, v) L dλ / W.
        white: (h, 3, k, 1, v) ρ_w L dλ / W.
    """

    signal: Array
    predicted: Array
    standard_error: Array
    curve: Array
    patches: Array
    edges: Array
    light: Array
    white: Array

    @property
    def against_white(self) -> Array:
        """(R - ŷ ρ_w) L dλ / W, (h, 3, k, n, v): times s, the derivative of ŷ by a relative change of L."""
        return self.patches - self.predicted[..., None] * self.white


@dataclass(frozen=True)
class Tolerances:
    """Relative errors of chart, white reference and lamps.

    Attributes:
        chart: (n,) τ of each patch.
        white: of ρ_w, a number.
        lamp: (h, k) of each shot's lamp.
    """

    chart: Array
    white: Array
    lamp: Array


@dataclass(frozen=True)
class Covariance:
    """Σ as its blocks and factors: chart + noise + white whiteᵀ + lamp lampᵀ, N = n 3 k rows.

    Rows are ordered by patch, then channel, then shot: then the chart's part is one block a patch.

    Attributes:
        chart: (h, n, 3 k, 3 k).
        noise: (h, N) variances of independent errors.
        white: (h, N, p) factors of the white reference's error.
        lamp: (h, N, p) factors of the lamps' errors and of the light's drift.
    """

    chart: Array
    noise: Array
    white: Array
    lamp: Array

    def scaled(self, scale: Array) -> Covariance:
        """With `scale` (h, n) times the chart's variance of each patch."""
        return replace(self, chart=scale[..., None, None] * self.chart)

    @property
    def common(self) -> Array:
        """(h, N, p) factors U of the errors that patches have in common."""
        return namespace(self.noise).concat([self.white, self.lamp], axis=-1)

    @property
    def chart_term(self) -> Array:
        """The chart's part as a whole matrix, (h, N, N)."""
        xp, (h, n, rows, _) = namespace(self.noise), self.chart.shape
        apart = self.chart[:, :, :, None, ...] * eye(xp, n)[:, None, :, None, ...]  # (h, n, 3 k, n, 3 k)
        return xp.reshape(apart, (h, n * rows, n * rows))

    @property
    def noise_term(self) -> Array:
        """The noise's part as a whole matrix, (h, N, N)."""
        return self.noise[..., None] * eye(namespace(self.noise), self.noise.shape[-1])

    @property
    def dense(self) -> Array:
        """Σ as a whole matrix, (h, N, N)."""
        return self.chart_term + self.noise_term + self.common @ self.common.mT


def smooth_errors(length: float, at: Array = NODES) -> Array:
    """Factor Φ, (len(at), p), of a smooth random error at the wavelengths `at`: ε = Φ u with u ~ N(0, I).

    White noise on points ℓ/2 apart, smoothed so that Φ Φᵀ = exp(-½ (Δλ / ℓ)²), to 1e-3 at the ends of the grid.
    """
    xp, step = namespace(at), length / 2.0
    points = constant(xp, np.arange(380.0 - 2.0 * length, 720.0 + 2.0 * length + step, step))
    weight = float(np.sqrt(step / (length * np.sqrt(np.pi / 2.0))))
    return weight * xp.exp(-(((at[:, None] - points) / length) ** 2))


def red_end(at: Array) -> Array:
    """h (v,): the chart's smooth error at the wavelengths `at`, relative to that elsewhere."""
    xp = namespace(at)
    return 1.0 + RED_MORE / (1.0 + xp.exp((RED_FROM - at) / RED_OVER))


def covariance(signals_at: LinearisedSignals, tolerances: Tolerances, at: Floats = NODES) -> Covariance:
    """Covariance of the errors of linearised signals; `at` are the wavelengths, (v,).

        noise     se²                                                  independent
        chart     (τ y / 20)²                                          independent
                  τ Σ (0.6 R u₁ + u₂ / 3 + 70 nm · dR/dλ u₃) h L s dλ / W  one u a patch, for all shots; κ = 0.7 of
                                                                         its variance common to the channels;
                                                                         h(λ) of `red_end`
        white     -ŷ Σ ρ_w ε_w L s dλ / W                              one ε_w for all rows
        lamp      Σ (R - ŷ ρ_w) L η s dλ / W                           one smooth η a shot, for all channels
                  ŷ / 100                                              drift of the light: one a shot, all channels

    The errors of lamp and white enter with the predicted ŷ, not with the measured y: otherwise a mere change of scale
    could explain the signals. The independent part of a row's standard error is at least FLOOR.
    """
    xp, (h, _, k, n) = namespace(signals_at.signal), signals_at.signal.shape
    N, predicted, wavelengths = n * 3 * k, signals_at.predicted[..., None], constant(xp, at)
    over_chart, over_lamp, over_table = (
        signals_at.curve * smooth_errors(length, wavelengths)
        for length in (CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION)
    )
    red = red_end(wavelengths)[:, None]
    edges = EDGE * (signals_at.edges @ (red * over_table))
    light = xp.broadcast_to(ABSOLUTE * (signals_at.light @ (red * over_table)), edges.shape)
    chart = xp.concat([RELATIVE * (signals_at.patches @ (red * over_chart)), light, edges], axis=-1)
    chart = patchwise(tolerances.chart[:, None] * chart)
    chart = xp.reshape(chart, (h, n, 3 * k, chart.shape[-1]))
    between_channels = constant(xp, CHANNEL_SHARE + (1.0 - CHANNEL_SHARE) * np.eye(3))[:, None, :, None]
    shared = xp.reshape(xp.broadcast_to(between_channels, (3, k, 3, k)), (3 * k, 3 * k))

    white = patchwise(tolerances.white * predicted * (signals_at.white @ over_chart))
    lamp = tolerances.lamp[:, None, :, None, None] * (signals_at.against_white @ over_lamp)
    lamp = by_shot(patchwise(xp.concat([lamp, DRIFT * predicted], axis=-1)))

    variance = signals_at.standard_error * signals_at.standard_error
    independent = INDEPENDENT_SHARE * tolerances.chart * signals_at.signal
    # max(se² + own, floor²) - noise, without a difference of two large numbers where a signal is masked.
    independent = xp.maximum(independent * independent - xp.maximum(FLOOR**2 - variance, 0.0), 0.0)
    diagonal = xp.reshape(patchwise(independent), (h, n, 3 * k))[..., None] * eye(xp, 3 * k)
    return Covariance(
        (chart @ chart.mT) * shared + diagonal,
        xp.reshape(patchwise(xp.maximum(variance, FLOOR**2)), (h, N)),
        xp.reshape(white, (h, N, white.shape[-1])),
        xp.reshape(lamp, (h, N, k * lamp.shape[-1])),
    )


def patchwise(x: Array) -> Array:
    """(h, 3, k, n, ...) → (h, n, 3, k, ...): the order of the rows."""
    return namespace(x).permute_dims(x, (0, 3, 1, 2, *range(4, len(x.shape))))


def by_shot(factors: Array) -> Array:
    """Factors (h, n, 3, k, p) of errors of each shot alone as (h, n, 3, k, k, p), zero between shots."""
    return factors[..., None, :] * eye(namespace(factors), factors.shape[3])[..., None]
