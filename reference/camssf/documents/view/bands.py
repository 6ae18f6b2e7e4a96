"""Mean and standard deviation → the band that can be: no sensor answers light with less than nothing.

The document keeps the Gaussian's numbers. What is drawn and told is the shortest interval that holds 95 % of that
Gaussian once what lies below zero is cut off. Far above zero it is the mean ± 1.96 standard deviations; near zero it
is lopsided, from 0 up to

    u = m + σ Φ⁻¹(1 − 0.05 Φ(m/σ)),

and its upper end never lies above the Gaussian's.
"""

from __future__ import annotations

import numpy as np

from camssf.grid import Floats

SHARE = 0.95


def possible(mean: Floats, std: Floats) -> tuple[Floats, Floats]:
    """Lower and upper end of the band, of the same shape; neither is negative.

    Args:
        mean: of a Gaussian; may lie below zero, and is then outside of the band.
        std: its standard deviation, ≥ 0.
    """
    from scipy.special import log_ndtr, ndtri, ndtri_exp

    mean, std = np.asarray(mean, dtype=np.float64), np.asarray(std, dtype=np.float64)
    safe = np.where(std > 0, std, 1.0)
    with np.errstate(over="ignore"):
        t = np.clip(mean / safe, -1e6, 1e6)
    kept = np.exp(log_ndtr(t))  # Φ(m/σ), what is left of the Gaussian
    half = ndtri(0.5 * (1.0 + SHARE * kept))
    # -Φ⁻¹(0.05 Φ(t)) by its logarithm: far below zero Φ(t) itself is no number any more.
    upper = t - ndtri_exp(np.log1p(-SHARE) + log_ndtr(t))
    whole = half <= t
    # About the mean itself: m/σ was clipped, and has lost it where σ is next to nothing, as at a curve's peak.
    low = np.where(whole, np.maximum(mean - half * safe, 0.0), 0.0)
    high = np.where(whole, mean + half * safe, np.maximum(upper, 0.0) * safe)
    sure = std > 0
    return (
        np.asarray(np.where(sure, low, np.maximum(mean, 0.0))),
        np.asarray(np.where(sure, high, np.maximum(mean, 0.0))),
    )
