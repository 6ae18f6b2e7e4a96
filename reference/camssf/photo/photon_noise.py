"""Whether a colour's noise is that of its own photons, as on a sensor, or of others' too, as after a colour matrix.

The variance of a sensor's samples grows with their own photons alone: V = a + g S + t S², with S above black. Where a
program has mixed the colours, V follows the unmixed signal, so the others' mean signal O enters:
V = a + g (S + h O) + t S². h is 0 for a sensor, whatever its gain, and −2x / (3 − 2x) after desaturation by x.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from camssf.grid import Floats
from camssf.rules import rules

FEWEST, ROUNDS = rules().whole("noise.fewest"), rules().whole("noise.rounds")
QUIET, FAR, SIGNIFICANT = (rules().number(f"noise.{word}") for word in ("quiet", "far", "significant"))
ROUNDING = 1.0 / 12.0
"""Variance of rounding, in squared steps."""


@dataclass(frozen=True)
class Estimate:
    """A number with its error.

    Attributes:
        value: the number.
        error: its standard error.
    """

    value: float
    error: float


def mixed_noise(signal: Floats, variance: Floats, count: Floats, step: float) -> Estimate | None:
    """h of the module's equation, weighed over the colours; None if no colour has photon noise to judge.

    Args:
        signal: (n, 3) of the patches, above black, DN.
        variance: (n, 3) of their samples, rounding included, DN².
        count: (n, 3) samples.
        step: DN between neighbouring values of the samples.
    """
    own = list(_of_colours(signal, variance, count, step))
    weight = sum(one.error**-2 for one in own)
    return Estimate(sum(one.value / one.error**2 for one in own) / weight, weight**-0.5) if own else None


def _of_colours(signal: Floats, variance: Floats, count: Floats, step: float) -> Iterator[Estimate]:
    for colour in range(3):
        judged = variance[:, colour] > QUIET * step**2
        if judged.sum() < FEWEST:
            continue
        own = np.maximum(signal[judged, colour], 0.0)
        others = np.delete(signal, colour, 1)[judged].mean(axis=1)
        estimate = _of_colour(own, others, variance[judged, colour], count[judged, colour], ROUNDING * step**2)
        if estimate is not None:
            yield estimate


def _of_colour(own: Floats, others: Floats, variance: Floats, count: Floats, rounding: float) -> Estimate | None:
    """h of one colour by least squares, reweighted; None if its noise does not grow with its signal."""
    relative = np.sqrt(2.0 / np.maximum(count - 3.0, 1.0))
    photons = variance - rounding
    predicted, trust = variance.copy(), np.ones(own.size)
    sensor = np.stack([np.ones(own.size), own, own * own], axis=1)
    mixed = np.stack([np.ones(own.size), own, others], axis=1)
    scale, fit = 1.0, np.zeros(3)
    for _ in range(ROUNDS):
        weight = trust / (relative * predicted)
        a, g, t = _positive(sensor * weight[:, None], photons * weight)
        rest = photons - t * own * own
        fit = _least_squares(mixed * weight[:, None], rest * weight)
        predicted = np.maximum(np.maximum(mixed @ fit, a + g * own) + t * own * own + rounding, rounding)
        off = np.abs(rest - mixed @ fit) / (relative * predicted)
        scale = max(1.0, 1.4826 * float(np.median(off)))
        trust = 1.0 / np.sqrt(np.maximum(1.0, off / (FAR * scale)))
    rows = mixed * (trust / (relative * predicted))[:, None]
    covariance = np.linalg.pinv(rows.T @ rows)
    gain = float(fit[1])
    if gain <= SIGNIFICANT * float(np.sqrt(covariance[1, 1])):
        return None
    return Estimate(float(fit[2]) / gain, scale * float(np.sqrt(covariance[2, 2])) / gain)


def _positive(matrix: Floats, target: Floats) -> Floats:
    """Least squares with x ≥ 0, by columns of length 1, whose sizes differ by many orders.

    All sets of the three columns are tried: SciPy's solver gives the same, and takes longer to load than all this.
    """
    length, best = _lengths(matrix), (float(target @ target), np.zeros(matrix.shape[1]))
    for count in range(1, matrix.shape[1] + 1):
        for kept in combinations(range(matrix.shape[1]), count):
            columns = matrix[:, kept] / length[list(kept)]
            x = np.linalg.lstsq(columns, target, rcond=None)[0]
            rest = target - columns @ x
            if (x >= 0.0).all() and float(rest @ rest) < best[0]:
                best = float(rest @ rest), np.zeros(matrix.shape[1])
                best[1][list(kept)] = x
    return np.asarray(best[1] / length)


def _least_squares(matrix: Floats, target: Floats) -> Floats:
    length = _lengths(matrix)
    return np.asarray(np.linalg.lstsq(matrix / length, target, rcond=None)[0] / length)


def _lengths(matrix: Floats) -> Floats:
    length = np.sqrt((matrix**2).sum(axis=0))
    return np.where(length > 0.0, length, 1.0)
