"""Problem and answer → unseen: predictions of fits that had not seen the patch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.curves.ssf import Ssf
from camssf.evidence.problem import Problem
from camssf.evidence.scores import Scores, validate
from camssf.grid import Floats
from camssf.rules import rules
from camssf.spectra import CameraCurves

FOLDS = rules().whole("calibration.folds")
"""All patches enter the fit; each is predicted by a fit that left its quarter of the chart out."""


@dataclass(frozen=True)
class Unseen:
    """How well fits foretell patches that they had not seen.

    Attributes:
        values: (k, n, 3) their predictions, as `Ssf.predicted` in even light; NaN where every fit had seen the patch.
        std: (k, n, 3) one standard deviation of the true signals less these; None without a prior.
        how: how that was done, in words.
    """

    values: Floats
    std: Floats | None
    how: str


def foretell(problem: Problem, ssf: Ssf, predicted_std: Floats | None) -> Unseen:
    """By the answer itself where patches stayed out of the fit, fold by fold where none did."""
    capture, signals = problem.capture, problem.signals
    rest = ~problem.asked
    if capture.shots[0].means.white is None:
        rest = rest & (np.arange(rest.size) != capture.chart.white)  # its signal is 1 whatever the curves
    if rest.any():
        out = rest[None, :, None]
        std = None if predicted_std is None else np.where(out, predicted_std, np.nan)
        how = f"{int(rest.sum())} patches that did not enter the fit"
        return Unseen(np.where(out, ssf.predicted, np.nan), std, how)
    taken, level = np.flatnonzero(signals.used.any(axis=0)), problem.level(ssf)[:, :, None]
    values = np.full(ssf.predicted.shape, np.nan)
    std = None if predicted_std is None else values.copy()
    for fold in range(FOLDS):
        left_out = np.zeros(rest.size, dtype=bool)
        left_out[taken[fold::FOLDS]] = True
        answer = problem.solve(signals.used & ~left_out, ssf.gamma)
        # Each fit has a light of its own; all are told in the answer's.
        scale = (level / problem.level(answer)[:, :, None])[:, left_out]
        values[:, left_out] = scale * answer.predicted[:, left_out]
        band = problem.bands(signals.used & ~left_out, answer)
        if std is not None and band is not None:
            std[:, left_out] = scale * band[:, left_out]
    values[~signals.used] = np.nan
    return Unseen(values, std, f"each of {taken.size} patches, by a fit that left its quarter of the chart out")


def score(problem: Problem, ssf: Ssf, unseen: Unseen, truth: CameraCurves | None) -> Scores:
    """`validate` on the unseen predictions; the others fill the places that do not count.

    The signals are taken as even light would have given them.
    """
    counts = np.all(np.isfinite(unseen.values), axis=2)
    predicted = np.where(counts[:, :, None], unseen.values, ssf.predicted)
    table = problem.capture.chart
    return validate(problem.levelled(ssf), predicted, table, problem.lamps, ssf.values, truth, counts, unseen.how)
