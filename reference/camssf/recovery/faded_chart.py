"""Weighs whether the chart has faded: its colours are duller than in its table.

Where a camera seems to belong to no family (`unfamiliar_camera`), the chart may be the reason. Fading is described by
one number for the whole chart (`camssf.spectra.charts.faded`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from camssf.rules import rules

AMOUNTS = rules().number("choice.fading") * np.arange(1, 1 + rules().whole("choice.fading_steps"))
"""Amounts v that are weighed."""
FADED = rules().number("choice.faded")
"""Prior probability that a chart has faded."""


def chart_fading(log_evidence: Callable[[float], float], clear: float) -> float:
    """The chart's most probable fading, or 0 if its posterior odds are below `clear`.

    Args:
        log_evidence: ln of the marginal likelihood of the signals for a fading v, over all hypotheses.
        clear: posterior odds of any fading against none.

    Returns:
        The posterior mean of v over AMOUNTS.
    """
    nats = np.array([log_evidence(float(amount)) for amount in AMOUNTS]) - log_evidence(0.0)
    odds = FADED / (1.0 - FADED) / len(AMOUNTS) * np.exp(np.minimum(nats, 700.0))
    return float(AMOUNTS @ odds / odds.sum()) if odds.sum() >= clear else 0.0
