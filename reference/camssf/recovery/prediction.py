"""Predicts signals from recovered curves, with standard deviations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, basis_of, widened
from camssf.recovery.linear_model import levels, linear_model
from camssf.recovery.observation import Observation, array_of, tolerance_of
from camssf.recovery.sensitivity import Ssf, predict_signals


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
    noise ν, gave x̂ = G (A x + e + ν). So t - A x̂ = (I - A G)(A x + e) - A G ν, and its variance is the diagonal of
    (I - A G)(A Aᵀ + Σ - N)(I - A G)ᵀ + A G N Gᵀ Aᵀ with N the noise's part of Σ: the posterior uncertainty of the
    curves, and the errors of this surface and light that the data cannot determine. A surface that was not measured
    enters the rows as a masked signal. The small l1 penalty is left out, as in `explain`.

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
    basis = basis_of(ssf.settings.basis if basis is None else basis)
    if not basis.prior:
        raise InvalidArgument(f"The {basis.name} basis has no prior, so no bands.", "Choose the basis cameras.")
    observation.check_for(basis)
    basis = widened(basis, ssf.settings.prior_scale)
    others = np.zeros((0, WAVELENGTHS.size)) if of is None else np.atleast_2d(array_of("of", of))
    if others.shape[1:] != (WAVELENGTHS.size,):
        raise InvalidArgument(f"`of` has shape {others.shape}.", "Give reflectances (p, 681) on the grid.")
    (k, n, _), p = observation.signals.shape, len(others)
    every = np.concatenate([observation.reflectance, others])
    g = observation.gain_modes.shape[1]
    other_gains = np.zeros((k, g, p)) if of_gains is None else array_of("of_gains", of_gains, (k, g, p))
    values = predict_signals(ssf.values, every, ssf.light.lamp, observation.white_reflectance)
    used = np.ones((k, n), dtype=bool) if observation.used is None else observation.used
    modes = np.concatenate([observation.gain_modes, other_gains], axis=2)
    gain_code = ssf.light.gain_code
    if gain_code.shape != (k, g):  # it belongs to another observation
        gain_code = np.zeros((k, 0))
    relit = values / levels(gain_code, modes)[:, :, None]  # as they would have been measured in this light
    extended = replace(
        observation,
        signals=np.concatenate([np.where(used[:, :, None], observation.signals, relit[:, :n]), relit[:, n:]], axis=1),
        standard_error=np.concatenate([observation.errors(basis), np.zeros((k, p, 3))], axis=1),
        used=np.concatenate([used, np.zeros((k, p), dtype=bool)], axis=1),
        reflectance=every,
        chart_tolerance=np.concatenate([observation.chart_tolerance, tolerance_of("of_tolerance", of_tolerance, p)]),
        gain_modes=modes,
        frames=None,
    )
    linear = linear_model(extended, basis)
    # A row is a difference of signals times its curve's white signal over W.
    first = observation.lamp[0] * observation.white_reflectance * STEP
    seen = (ssf.light.lamp * observation.white_reflectance * STEP) @ ssf.values * (basis.mean @ first)  # (k, 3)
    shared = linear.gains @ linear.gains.T
    A = np.concatenate([linear.matrix[0], linear.gains], axis=1)
    sigma, noise = linear.covariance[0] - shared, np.diag(linear.terms["noise"][0])
    weighted = np.linalg.solve(sigma, A)
    smoother = A @ np.linalg.solve(A.T @ weighted + np.eye(A.shape[1]), weighted.T)
    rest = np.eye(len(A)) - smoother
    kept = A @ A.T - shared + sum(term[0] for source, term in linear.terms.items() if source != "noise")
    variance = np.sum(rest @ kept * rest, axis=1) + smoother**2 @ noise
    std = np.sqrt(variance).reshape(3, k, n + p) * (linear.white / seen.T)[:, :, None]
    return Prediction(values, np.moveaxis(std, 0, -1))
