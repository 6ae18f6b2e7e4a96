"""Computes the drawn 95 % band from mean and standard deviation; sensitivities and powers cannot be negative.

The document holds the Gaussian's mean and standard deviation. The band is the shortest interval with 95 % of that
Gaussian truncated at zero. Far above zero it is the mean ± 1.96 standard deviations; near zero it is asymmetric, from
0 up to

    u = m + σ Φ⁻¹(1 − 0.05 Φ(m/σ)),

and its upper end is never above that of the untruncated Gaussian.
"""

from __future__ import annotations

import numpy as np

from camssf.grid import Floats

SHARE = 0.95


def possible(mean: Floats, std: Floats) -> tuple[Floats, Floats]:
    """Lower and upper end of the band, ≥ 0, in the shape of the arguments.

    Args:
        mean: of a Gaussian; it may be negative, and then lies outside the band.
        std: its standard deviation, ≥ 0.
    """
    from scipy.special import log_ndtr, ndtri, ndtri_exp

    mean, std = np.asarray(mean, dtype=np.float64), np.asarray(std, dtype=np.float64)
    safe = np.where(std > 0, std, 1.0)
    with np.errstate(over="ignore"):
        t = np.clip(mean / safe, -1e6, 1e6)
    kept = np.exp(log_ndtr(t))  # Φ(m/σ), the mass of the Gaussian above zero
    half = ndtri(0.5 * (1.0 + SHARE * kept))
    # -Φ⁻¹(0.05 Φ(t)) by its logarithm: far below zero Φ(t) itself underflows.
    upper = t - ndtri_exp(np.log1p(-SHARE) + log_ndtr(t))
    whole = half <= t
    # Use the mean itself: the clipped m/σ loses it where σ is almost 0, as at a curve's peak.
    low = np.where(whole, np.maximum(mean - half * safe, 0.0), 0.0)
    high = np.where(whole, mean + half * safe, np.maximum(upper, 0.0) * safe)
    sure = std > 0
    return (
        np.asarray(np.where(sure, low, np.maximum(mean, 0.0))),
        np.asarray(np.where(sure, high, np.maximum(mean, 0.0))),
    )
