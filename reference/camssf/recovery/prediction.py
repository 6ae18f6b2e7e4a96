"""Predicts signals from recovered curves, with standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, basis_of, widened
from camssf.recovery.inputs import hypotheses_of
from camssf.recovery.observation import Observation, array_of, surfaces_of, tolerance_of
from camssf.recovery.posterior import code_posterior, predicted_std
from camssf.recovery.rows import levels
from camssf.recovery.sensitivity import Ssf, predict_signals
from camssf.recovery.whitening import whitened_model


@dataclass(frozen=True)
class Prediction:
    """Predicted signals and their standard deviations.

    Attributes:
        values: (k, p, 3), 1.
        std: (k, p, 3) one standard deviation of the true, noise-free signal minus the prediction.
    """

    values: Floats
    std: Floats


def predict(
    ssf: Ssf,
    observation: Observation,
    *,
    of: ArrayLike | None = None,
    of_tolerance: ArrayLike = 0.0,
    of_gains: ArrayLike | None = None,
    basis: str | Basis | None = None,
) -> Prediction:
    """Predict the signals of the observation's patches, then of other surfaces `of`, with standard deviations.

    The true signal of a row is t = A x + e, where e is the error of chart, white and lamp; the measured signals, with
    noise ν, gave x̂ = G (A x + e + ν). So t - A x̂ = (I - A G)(A x + e) - A G ν: the posterior uncertainty of the
    curves, and the errors of this surface and light that the data cannot determine
    (`camssf.recovery.whitening.errors_by_source` has the formula). A surface that was not measured enters the rows as
    a masked signal. The small l1 penalty is left out, as in `explain`.

    Gain modes are unknowns next to the code here, t = y (1 - Σ v φ): their uncertainty is part of `std`, but `values`
    are signals in even light.

    Args:
        ssf: the curves recovered from the observation.
        observation: the input of that recovery.
        of: (p, 681) reflectances of the other surfaces, under the same lamps; None for none.
        of_tolerance: relative error of these, (p,) or one number; 0 for surfaces of exactly that reflectance.
        of_gains: (k, g, p) their gain modes, if they were in the same photos; None for surfaces under the same light
            as the white.
        basis: that of `ssf`; required if it was a file or a Basis. For a mixture, that of the most probable solution.

    Returns:
        n + p surfaces: the n of `reflectance`, then the p of `of`.

    Raises:
        InvalidArgument: as `recover`; also for a basis without a prior, which has no bands.
    """
    named = ssf.basis if basis is None else basis
    return predict_together([ssf], [observation], of=of, of_tolerance=of_tolerance, of_gains=of_gains, basis=named)[0]


def predict_together(
    answers: Sequence[Ssf],
    observations: Sequence[Observation],
    *,
    of: ArrayLike | None = None,
    of_tolerance: ArrayLike = 0.0,
    of_gains: ArrayLike | None = None,
    basis: str | Basis,
) -> list[Prediction]:
    """`predict` of each answer to its observation, in one go; the observations differ in what is used alone."""
    basis = basis_of(basis)
    if not basis.prior:
        raise InvalidArgument(f"The {basis.name} basis has no prior, so no bands.", "Choose the basis cameras.")
    observations[0].check_for(basis)
    basis = widened(basis, answers[0].prior_scale)
    others = np.zeros((0, WAVELENGTHS.size)) if of is None else surfaces_of("of", of)
    (k, g, _), p = observations[0].gain_modes.shape, len(others)
    tolerances = tolerance_of("of_tolerance", of_tolerance, p)
    gains = np.zeros((k, g, p)) if of_gains is None else array_of("of_gains", of_gains, (k, g, p))
    pairs = [
        _extended(ssf, observation, basis, others, tolerances, gains)
        for ssf, observation in zip(answers, observations, strict=True)
    ]
    model = whitened_model(hypotheses_of([observation for _, observation in pairs], basis), np.array(1.0))
    white = observations[0].white_reflectance * STEP
    first = basis.mean @ (observations[0].lamp[0] * white)
    response = np.stack([(ssf.lamp * white) @ ssf.values * first for ssf in answers])  # (h, k, 3)
    std = predicted_std(model, code_posterior(model)[1], response)
    return [Prediction(values, band) for (values, _), band in zip(pairs, std, strict=True)]


def _extended(
    ssf: Ssf, observation: Observation, basis: Basis, others: Floats, tolerances: Floats, gains: Floats
) -> tuple[Floats, Observation]:
    """Predictions (k, n + p, 3), and the observation with the other surfaces; a masked signal has its prediction."""
    (k, n, _), p = observation.signals.shape, len(others)
    every = np.concatenate([observation.reflectance, others])
    values = predict_signals(ssf.values, every, ssf.lamp, observation.white_reflectance)
    used = np.ones((k, n), dtype=bool) if observation.used is None else observation.used
    modes = np.concatenate([observation.gain_modes, gains], axis=2)
    # Gains of another observation say nothing of this one's light.
    code, shape = ssf.gain_code, (k, modes.shape[1])
    relit = values / levels(code if code.shape == shape else np.zeros(shape), modes)[:, :, None]  # in this light
    return values, replace(
        observation,
        signals=np.concatenate([np.where(used[:, :, None], observation.signals, relit[:, :n]), relit[:, n:]], axis=1),
        standard_error=np.concatenate([observation.errors(basis), np.zeros((k, p, 3))], axis=1),
        used=np.concatenate([used, np.zeros((k, p), dtype=bool)], axis=1),
        reflectance=every,
        chart_tolerance=np.concatenate([observation.chart_tolerance, tolerances]),
        gain_modes=modes,
        frames=None,
    )
