"""Splits the posterior variance of the curves into an uncertainty budget by source."""

from __future__ import annotations

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.recovery.basis import Basis, basis_of, widened
from camssf.recovery.covariance import SOURCES
from camssf.recovery.inputs import hypotheses_of
from camssf.recovery.observation import Observation
from camssf.recovery.posterior import budget, code_posterior
from camssf.recovery.whitening import whitened_model


def explain(
    observation: Observation,
    *,
    basis: str | Basis = "cameras",
    prior_scale: float = 1.0,
) -> dict[str, Floats]:
    """Uncertainty budget: the share of each source in the variance of each channel, (3,); the shares add up to 1.

    `camssf.recovery.posterior.budget` has the formula. `basis` and `prior_scale` are those of the result.

    Raises:
        InvalidArgument: as `recover`; also for a basis without a prior, which has no posterior variance.
    """
    basis = basis_of(basis)
    if not basis.prior:
        raise InvalidArgument(f"The {basis.name} basis has no prior, so no variance.", "Choose the basis cameras.")
    observation.check_for(basis)
    model = whitened_model(hypotheses_of([observation], widened(basis, prior_scale)), np.array(1.0))
    shares = budget(model, *code_posterior(model))[0]
    return dict(zip((*SOURCES, "unseen"), shares, strict=True))
