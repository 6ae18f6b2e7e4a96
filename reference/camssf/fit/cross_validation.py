"""Cross-validates a fit: predictions of patches by fits that did not use them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.fit.capture_fit import CaptureFit
from camssf.fit.scores import Scores, validate
from camssf.fit.solutions import prediction_bands, recover_fit
from camssf.grid import Floats
from camssf.recovery.sensitivity import Ssf
from camssf.rules import rules
from camssf.spectra import CameraCurves

FOLDS = rules().whole("calibration.folds")
"""Number of folds; each patch is predicted by a fit that leaves its fold out."""


@dataclass(frozen=True)
class CrossValidation:
    """Predictions of patches by fits that did not use them.

    Attributes:
        values: (k, n, 3) predictions in even light, as `Ssf.predicted`; NaN where every fit used the patch.
        std: (k, n, 3) one standard deviation of the true signals minus these; None without a prior.
        method: the method, in words.
    """

    values: Floats
    std: Floats | None
    method: str


def cross_validate(fit: CaptureFit, ssf: Ssf, predicted_std: Floats | None) -> CrossValidation:
    """Predict the patches that `ssf` did not use by `ssf` itself; if there are none, all patches fold by fold."""
    capture, signals = fit.capture, fit.signals
    rest = ~fit.allowed
    if capture.shots[0].means.white is None:
        rest = rest & (np.arange(rest.size) != capture.chart.white)  # its signal is 1 whatever the curves
    if rest.any():
        out = rest[None, :, None]
        std = None if predicted_std is None else np.where(out, predicted_std, np.nan)
        method = f"{int(rest.sum())} patches that did not enter the fit"
        return CrossValidation(np.where(out, ssf.predicted, np.nan), std, method)
    taken, level = np.flatnonzero(signals.used.any(axis=0)), fit.level(ssf)[:, :, None]
    values = np.full(ssf.predicted.shape, np.nan)
    std = None if predicted_std is None else values.copy()
    for fold in range(FOLDS):
        left_out = np.zeros(rest.size, dtype=bool)
        left_out[taken[fold::FOLDS]] = True
        answer = recover_fit(fit, signals.used & ~left_out, ssf.settings.gamma)
        # Each fold estimates its own illumination. Its predictions are rescaled to the full fit's.
        scale = (level / fit.level(answer)[:, :, None])[:, left_out]
        values[:, left_out] = scale * answer.predicted[:, left_out]
        band = prediction_bands(fit, signals.used & ~left_out, answer)
        if std is not None and band is not None:
            std[:, left_out] = scale * band[:, left_out]
    values[~signals.used] = np.nan
    return CrossValidation(
        values, std, f"each of {taken.size} patches, by a fit that left its quarter of the chart out"
    )


def score(fit: CaptureFit, ssf: Ssf, held_out: CrossValidation, truth: CameraCurves | None) -> Scores:
    """`validate` on the cross-validated predictions; `ssf.predicted` fills the places that do not count.

    The signals are corrected to even light.
    """
    counts = np.all(np.isfinite(held_out.values), axis=2)
    predicted = np.where(counts[:, :, None], held_out.values, ssf.predicted)
    table = fit.capture.chart
    return validate(fit.levelled(ssf), predicted, table, fit.lamps, ssf.values, truth, counts, held_out.method)
