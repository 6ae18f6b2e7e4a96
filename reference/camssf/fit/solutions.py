"""Solves the fit of a capture, on any of its patches and on each shot alone, and gives its predictions bands."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.errors import InvalidArgument
from camssf.fit.capture_fit import CaptureFit
from camssf.grid import Floats
from camssf.recovery.hypotheses import recover
from camssf.recovery.prediction import predict
from camssf.recovery.sensitivity import SolverSettings, Ssf, predict_signals
from camssf.recovery.unnamed_light import LampGuess, likely_kinds, recover_in_any_light
from camssf.rules import rules
from camssf.spectra import Unnamed

MOST_UNNAMED = rules().whole("lamp.most")
"""Largest number of shots whose light is not named."""


def recover_fit(fit: CaptureFit, used: NDArray[np.bool_], gamma: ArrayLike | None) -> Ssf:
    """`recover` on the used patches (k, n); the result predicts all n patches.

    Raises:
        InvalidArgument: the light of more than MOST_UNNAMED shots is not named; else as `recover`.
        NotConverged: as `recover`.
    """
    options, chart = fit.options, fit.capture.chart
    settings = SolverSettings(l2=options.l2, gamma=gamma, nonnegative=options.nonnegative, engine=options.engine)
    if any(fit.unnamed):
        return recover_in_any_light(
            _guesses(fit, used), basis=fit.basis, prior=fit.prior_odds, prior_scale=fit.prior_scale, of=chart.values,
            settings=settings,
        )  # fmt: skip
    ssf = recover(
        fit.given(used), basis=fit.basis, prior=fit.prior_odds, prior_scale=fit.prior_scale, settings=settings
    )
    fit = fit.with_chart_of(ssf)
    rho, _ = fit.white_reference()
    return replace(ssf, predicted=predict_signals(ssf.values, fit.capture.chart.values, ssf.light.lamp, rho))


def recover_each_shot(fit: CaptureFit) -> list[Ssf]:
    """The solution of each shot alone; empty if there is only one shot."""
    k = len(fit.capture.shots)
    shots = np.eye(k, dtype=bool)[:, :, None] if k > 1 else ()
    return [recover_fit(fit, fit.signals.used & shot, fit.options.gamma) for shot in shots]


def prediction_bands(fit: CaptureFit, used: NDArray[np.bool_], ssf: Ssf) -> Floats | None:
    """(k, n, 3) standard deviation of each true signal minus its prediction by a fit to the used patches."""
    if ssf.std is None:
        return None
    table, taken = fit.capture.chart, used.any(axis=0)
    others, tolerance = table.values[~taken], table.tolerance[~taken]
    modes = fit.gains[0][:, :, ~taken]
    found = predict(ssf, fit.given(used), of=others, of_tolerance=tolerance, of_gains=modes, basis=fit.basis).std
    std = np.empty_like(fit.signals.values)
    std[:, taken], std[:, ~taken] = found[:, : taken.sum()], found[:, taken.sum() :]
    return std


def _guesses(fit: CaptureFit, used: NDArray[np.bool_]) -> list[LampGuess]:
    """All combinations of kinds for the unnamed lights."""
    if sum(fit.unnamed) > MOST_UNNAMED:
        raise InvalidArgument(
            f"The light of {sum(fit.unnamed)} shots was not named; at most {MOST_UNNAMED} can be estimated at once.",
            "Name the lamp of the others, at least its kind: daylight, bulb, white-led or fluorescent.",
        )
    kinds = list(product(*(_kinds(fit, used, j) for j in range(len(fit.capture.shots)))))
    return [_guess(fit, used, each) for each in kinds]


def _kinds(fit: CaptureFit, used: NDArray[np.bool_], j: int) -> list[str]:
    """The kinds of shot j's light that are combined with those of the other shots; "" if it was named."""
    lamp = fit.capture.shots[j].lamp
    if not isinstance(lamp, Unnamed):
        return [""]
    kinds = [each.name for each in lamp.kinds]
    if sum(fit.unnamed) == 1:
        return kinds
    alone, own = fit.of_shot(j), used[j : j + 1]
    return likely_kinds([_guess(alone, own, (kind,)) for kind in kinds], fit.basis, fit.prior_odds)


def _guess(fit: CaptureFit, used: NDArray[np.bool_], kinds: tuple[str, ...]) -> LampGuess:
    belief = sum(
        dict(zip([lamp.name for lamp in shot.lamp.kinds], shot.lamp.log_prior, strict=True))[kind]
        for kind, shot in zip(kinds, fit.capture.shots, strict=True)
        if isinstance(shot.lamp, Unnamed)
    )
    return LampGuess(kinds, fit.with_kinds(kinds).given(used), belief)
