"""Computes the drawn 95 % band from mean and standard deviation; sensitivities and powers cannot be negative.

The document holds the Gaussian's mean and standard deviation. The band is the shortest interval with 95 % of that
Gaussian truncated at zero. Far above zero it is the mean ± 1.96 standard deviations; near zero it is asymmetric, from
0 up to

    u = m + σ Φ⁻¹(1 − 0.05 Φ(m/σ)),

and its upper end is never above that of the untruncated Gaussian.
"""

from __future__ import annotations

from math import erfc, log, sqrt
from statistics import NormalDist

import numpy as np

from camssf.grid import Floats

SHARE = 0.95
FAR = -35.0
"""m/σ below which the truncated Gaussian is taken for an exponential: the same within 0.1 %."""


def possible(mean: Floats, std: Floats) -> tuple[Floats, Floats]:
    """Lower and upper end of the band, ≥ 0, in the shape of the arguments.

    Args:
        mean: of a Gaussian; it may be negative, and then lies outside the band.
        std: its standard deviation, ≥ 0.
    """
    mean, std = np.asarray(mean, dtype=np.float64), np.asarray(std, dtype=np.float64)
    safe = np.where(std > 0, std, 1.0)
    with np.errstate(over="ignore"):
        t = np.clip(mean / safe, -1e6, 1e6)
    kept = np.reshape([0.5 * erfc(-v / sqrt(2.0)) for v in np.maximum(t, FAR).ravel().tolist()], t.shape)  # Φ(m/σ)
    half = _quantile(0.5 * (1.0 + SHARE * kept))
    # Far below zero Φ(t) underflows, and what is left of the Gaussian is an exponential with mean σ / |t|.
    upper = np.where(t < FAR, log(1.0 - SHARE) / np.minimum(t, FAR), t - _quantile((1.0 - SHARE) * kept))
    whole = half <= t
    # Use the mean itself: the clipped m/σ loses it where σ is almost 0, as at a curve's peak.
    low = np.where(whole, np.maximum(mean - half * safe, 0.0), 0.0)
    high = np.where(whole, mean + half * safe, np.maximum(upper, 0.0) * safe)
    sure = std > 0
    return (
        np.asarray(np.where(sure, low, np.maximum(mean, 0.0))),
        np.asarray(np.where(sure, high, np.maximum(mean, 0.0))),
    )


def _quantile(share: Floats) -> Floats:
    """Φ⁻¹ of each share."""
    return np.reshape([NormalDist().inv_cdf(value) for value in share.ravel().tolist()], share.shape)
