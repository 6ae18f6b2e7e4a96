"""Covariance of the errors of the signals, by source: noise, chart, white reference and lamp.

The linear model (at the mean camera), the verdict (at the solution), the budget and the predictions all use it. The
ONNX model and Kotlin's `Covariance` use the same names.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.recovery.basis import NODES, steady_exp
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
    at: Floats = field(default_factory=lambda: NODES)

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


def smooth_errors(length: float, at: Floats = NODES) -> Floats:
    """Factor Φ, (len(at), p), of a smooth random error at the wavelengths `at`: ε = Φ u with u ~ N(0, I).

    White noise on points ℓ/2 apart, smoothed so that Φ Φᵀ = exp(-½ (Δλ / ℓ)²), to 1e-3 at the ends of the grid.
    """
    return _smooth_errors(length, at.tobytes())


@lru_cache(maxsize=16)
def _smooth_errors(length: float, wavelengths: bytes) -> Floats:
    """`smooth_errors` with hashable arguments, cached: the verdict repeats the same few calls."""
    at = np.frombuffer(wavelengths)
    step = length / 2.0
    points = np.arange(380.0 - 2.0 * length, 720.0 + 2.0 * length + step, step)
    weight = np.sqrt(step / (length * np.sqrt(np.pi / 2.0)))
    found = np.asarray(weight * steady_exp(-(((at[:, None] - points) / length) ** 2)))
    found.setflags(write=False)
    return found


def covariance(signals_at: LinearisedSignals, tolerances: Tolerances) -> dict[str, Floats]:
    """Covariance of the rows by source, (..., N, N) each; Σ is their sum.

        noise     se²                                                  independent
        chart     (τ y / 20)²                                          independent
                  τ Σ (0.6 R u₁ + u₂ / 3 + 70 nm · dR/dλ u₃) L s dλ / W    one u a patch, for all shots; κ = 0.7 of
                                                                         its variance common to the channels
        white     -ŷ Σ ρ_w ε_w L s dλ / W                              one ε_w for all rows
        lamp      Σ (R - ŷ ρ_w) L η s dλ / W                           one smooth η a shot, for all channels
                  ŷ / 100                                              drift of the light: one a shot, all channels

    The errors of lamp and white enter with the predicted ŷ, not with the measured y: otherwise a mere change of scale
    could explain the signals. The independent part of a row's standard error is at least FLOOR.
    """
    over_chart, over_lamp, over_table = (
        smooth_errors(length, signals_at.at) for length in (CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION)
    )
    chart = np.concatenate(
        [
            RELATIVE * (signals_at.patches @ over_chart),
            ABSOLUTE * (signals_at.light @ over_table),
            signals_at.edges @ over_table,
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
