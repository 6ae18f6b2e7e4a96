"""The one covariance of signals' errors: noise, chart, white and lamp, as they are in nature.

Everybody who asks how well signals are known asks here: the rows that the solver takes (about the mean camera), the
verdict (about the answer), budget and predictions. The model and Kotlin's `Covariance` follow it by name.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from camssf.curves.basis import NODES, steady_exp
from camssf.grid import Floats
from camssf.rules import rules

CHART_CORRELATION = rules().number("covariance.chart_correlation")
"""Length over which the relative part of a chart's error, and a white's error, are smooth, nm."""
TABLE_CORRELATION = rules().number("covariance.table_correlation")
"""Length over which the other parts of a chart's error are smooth, nm."""
RELATIVE, ABSOLUTE, EDGE = (rules().number(f"covariance.{name}") for name in ("relative", "absolute", "edge"))
"""A chart's error as parts of its tolerance τ: ε = τ (0.6 R u₁ + u₂ / 3 + 70 nm · dR/dλ u₃).

Robust fit (multivariate t) to the difference of the two measured tables in colour-science, BabelColor's and Ohta's:
1.8 % of R over 100 nm, 1.0 % of white over 35 nm and a wavelength error of 2.1 nm over 17 nm; the same on odd and on
even patches but for the first (0 to 2.4 %). One length stands for both short ones; τ = 3 % is a public table's."""
LAMP_CORRELATION = rules().number("covariance.lamp_correlation")
"""Length over which a lamp's error is smooth, nm."""
INDEPENDENT_SHARE = rules().number("covariance.independent_share")
"""Part of the chart's tolerance that is independent from patch to patch and shot to shot."""
CHANNEL_SHARE = rules().number("covariance.channel_share")
"""Part of the chart's smooth error that the three channels share; the rest each has for itself.

A reflectance that is wrong is wrong for all three, but a real table is also wrong in ways finer than smooth errors
can say, and each channel looks elsewhere. `python -m benchmarks.tables` measures what the number is worth."""
DRIFT = rules().number("covariance.drift")
"""Relative change of a shot's light between its chart and its white frame: nobody's fault."""
FLOOR = rules().number("covariance.floor")
"""No row is believed better than this share of its white signal."""


@dataclass(frozen=True)
class Seen:
    """Rows about curves s under lamps L: what their errors hang on.

    N rows of any channel, in any order; v wavelengths. Each row has the s of its channel and the L of its shot, and
    W = Σ ρ_w L s dλ.

    Attributes:
        channel, shot, patch: (N,) which of them a row belongs to.
        signal, predicted: (N,) y as measured, ŷ as the curve gives it.
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
        """(R - ŷ ρ_w) L s dλ / W, (N, v): how a row answers to a relative change of L, or of s."""
        return self.patches - self.predicted[:, None] * self.white


@dataclass(frozen=True)
class Tolerances:
    """How well all but the signals is known.

    Attributes:
        chart: (N,) τ of each row's patch.
        white: of ρ_w, one number.
        lamp: (N,) of the lamp of each row's shot.
    """

    chart: Floats
    white: float
    lamp: Floats


def smooth_errors(length: float, at: Floats = NODES) -> Floats:
    """Directions Φ of a smooth random error at these wavelengths: ε = Φ u with u standard normal, (len(at), p).

    White noise on points ℓ/2 apart, smoothed so that Φ Φᵀ = exp(-½ (Δλ / ℓ)²), to 1e-3 at the ends of the grid.
    """
    return _smooth_errors(length, at.tobytes())


@lru_cache(maxsize=16)
def _smooth_errors(length: float, wavelengths: bytes) -> Floats:
    """Once a process: the verdict asks a hundred times, always for the same few."""
    at = np.frombuffer(wavelengths)
    step = length / 2.0
    points = np.arange(380.0 - 2.0 * length, 720.0 + 2.0 * length + step, step)
    weight = np.sqrt(step / (length * np.sqrt(np.pi / 2.0)))
    found = np.asarray(weight * steady_exp(-(((at[:, None] - points) / length) ** 2)))
    found.setflags(write=False)
    return found


def covariance(seen: Seen, known: Tolerances) -> dict[str, Floats]:
    """Σ of the rows by source, (N, N) each; Σ is their sum.

        noise     se²                                                  independent
        chart     (τ y / 20)²                                          independent
                  τ Σ (0.6 R u₁ + u₂ / 3 + 70 nm · dR/dλ u₃) L s dλ / W    one u a patch, for all shots; κ = 0.7 of
                                                                         its variance common to the channels
        white     -ŷ Σ ρ_w ε_w L s dλ / W                              one ε_w for all rows
        lamp      Σ (R - ŷ ρ_w) L η s dλ / W                           one smooth η a shot, for all channels
                  ŷ / 100                                              light that drifts: one a shot, all channels

    The lamp's and the white's errors enter with the predicted ŷ, not with the measured y: else a mere scale would eat
    the evidence. No row's independent part is below FLOOR.
    """
    over_chart, over_lamp, over_table = (
        smooth_errors(length, seen.at) for length in (CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION)
    )
    chart = np.concatenate(
        [RELATIVE * (seen.patches @ over_chart), ABSOLUTE * (seen.light @ over_table), seen.edges @ over_table],
        axis=1,
    )
    white = known.white * seen.predicted[:, None] * (seen.white @ over_chart)
    lamp = np.column_stack([known.lamp[:, None] * (seen.against_white @ over_lamp), DRIFT * seen.predicted])
    noise = np.maximum(seen.standard_error**2, FLOOR**2)
    own = seen.standard_error**2 + (INDEPENDENT_SHARE * known.chart * seen.signal) ** 2
    independent = np.maximum(own, FLOOR**2) - noise
    same_channel, same_shot, same_patch = (label[:, None] == label for label in (seen.channel, seen.shot, seen.patch))
    shared = same_patch * np.where(same_channel, 1.0, CHANNEL_SHARE)
    return {
        "noise": np.diag(noise),
        "chart": np.diag(independent) + shared * _outer(known.chart[:, None] * chart),
        "white": _outer(white),
        "lamp": same_shot * _outer(lamp),
    }


def _outer(factors: Floats) -> Floats:
    """Covariance (N, N) of errors that are factors (N, p) times standard normal numbers."""
    return np.asarray(factors @ factors.T)
