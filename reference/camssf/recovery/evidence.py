"""The evidence of many hypotheses on one capture, in closed form, without solving any."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camssf.grid import Floats
from camssf.recovery.basis import Basis
from camssf.recovery.inputs import hypotheses_of, stacks_of
from camssf.recovery.observation import Observation
from camssf.recovery.posterior import evidence_of
from camssf.recovery.whitening import whitened_model

STACKS = {1: 24, 2: 12}
"""By the number of shots, how many hypotheses are computed in one go: more would not fit into the cache."""
STACK = 7
"""The same for more shots."""


def log_evidences(observations: Sequence[Observation], basis: Basis) -> Floats:
    """ln of the density of the rows under x ~ N(0, I) of each observation on a basis with a prior, up to a constant.

    Hypotheses on the lamps or the chart of one capture are computed in one go.
    """
    evidences = np.empty(len(observations))

    def measured(i: int) -> tuple[object, ...]:
        return observations[i].signals.tobytes(), observations[i].errors(basis).tobytes()

    for group in stacks_of(observations, measured):
        size = STACKS.get(len(observations[group[0]].signals), STACK)
        for start in range(0, len(group), size):
            some = group[start : start + size]
            hypotheses = hypotheses_of([observations[i] for i in some], basis)
            evidences[some] = evidence_of(whitened_model(hypotheses, np.array(0.0)))
    return evidences
