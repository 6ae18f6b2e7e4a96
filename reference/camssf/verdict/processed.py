"""Whether the samples are a sensor's own: rule 11 of docs/verdict.md."""

from __future__ import annotations

import numpy as np

from camssf.photo.patches import PatchMeans
from camssf.photo.photon_noise import Estimate, mixed_noise
from camssf.rules import rules
from camssf.verdict.reasons import Checks, Reason, because

_NUMBER = rules().number
MIXED, DEMOSAICED, SMOOTHED = _NUMBER("verdict.mixed"), _NUMBER("verdict.demosaiced"), _NUMBER("verdict.smoothed")
SURE_MIXED, SURE = _NUMBER("verdict.mixed_errors"), _NUMBER("verdict.demosaiced_errors")
UNSURE = _NUMBER("verdict.mixing_error")


def colours_mixed(means: PatchMeans) -> Estimate | None:
    """By how much each colour's noise follows the others' photons; None if noise or samples do not suffice."""
    chart = means.chart
    if means.noise is None or means.evened:
        return None
    variance = chart.standard_error**2 * chart.count
    estimate = mixed_noise(chart.mean - means.black, variance, chart.count.astype(np.float64), means.noise.step)
    return estimate if estimate is not None and estimate.error < UNSURE else None


def processed(means: PatchMeans, j: int, checks: Checks) -> list[Reason]:
    """Check that no program has mixed, demosaiced or smoothed the samples of shot j."""
    if means.noise is None:
        return []
    mixed = colours_mixed(means)
    found = _far("mixed", mixed, MIXED, SURE_MIXED, j, checks) or _far(
        "demosaiced", means.noise.unlike, DEMOSAICED, SURE, j, checks
    )
    if found or mixed is not None:  # noise that was smoothed away would hide a mixture, and does no harm by itself
        return found
    return _far("smoothed", means.noise.like, SMOOTHED, SURE, j, checks)


def _far(name: str, found: Estimate | None, limit: float, errors: float, j: int, checks: Checks) -> list[Reason]:
    """The reason `name` if a number is further from 0 than its limit and than so many standard errors."""
    if found is None:
        return []
    value, beyond = abs(found.value), max(limit, errors * found.error)
    checks.note(name, value, j, limit=beyond)
    return [because(name, value, {"shot": j + 1, "share": value}, threshold=beyond)] if value > beyond else []
