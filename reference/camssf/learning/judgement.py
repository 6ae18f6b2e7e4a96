"""Cross-validates a learned basis: whether it predicts photos of unseen cameras better than the old one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats
from camssf.learning.results import PhotoLikelihood, ReferenceBasis, Tables, log_predictive, populate
from camssf.learning.training import maker_of

FOLDS = 12
"""Largest number of cross-validation folds; with more groups, a fold leaves out several."""
CONFIDENCE = 0.95
"""Level of the interval that decides whether a basis helps."""


@dataclass(frozen=True)
class Judgement:
    """Cross-validated gain in predictive log-likelihood of the learned basis over the old one.

    Attributes:
        left_out: what a group is: model, maker or unit.
        groups: number of groups.
        nats: gain in log-likelihood a photo, mean over the groups; None for fewer than two groups.
        error: standard error of `nats`; None for fewer than two groups.
        low, high: CONFIDENCE interval of `nats`, by Student's t with groups - 1 degrees of freedom; None as `error`.
        helps: True if the interval lies above 0, False if below; None if it contains 0, or as `error`.
    """

    left_out: str
    groups: int
    nats: float | None
    error: float | None
    low: float | None
    high: float | None
    helps: bool | None


def judge(
    results: Sequence[PhotoLikelihood],
    reference: ReferenceBasis,
    tables: Tables,
    *,
    of: tuple[str, str] | None,
    leave: str,
    progress: Callable[[str, float], None],
) -> Judgement:
    """Learn without each group in turn, and compute the gain in log-likelihood of its photos.

    Args:
        results: the likelihoods of all photos.
        reference: the old basis.
        tables: measured cameras that are learned from as well.
        of: judge the basis of this model, by leaving out its units; None for that of all cameras.
        leave: what each fold leaves out then: model or maker.
        progress: called with a message and a fraction.
    """
    word = "unit" if of else leave
    judged = [each for each in results if of is None or each.member[:2] == of]

    def group_of(each: PhotoLikelihood) -> tuple[str, ...]:
        return each.member if of else each.member[:2] if leave == "model" else each.member[:1]

    groups = list(dict.fromkeys(map(group_of, judged)))
    if len(groups) < 2:
        return judge_gains(word, np.zeros(len(groups)))
    size = 3 * reference.dictionary.shape[2]
    gains: dict[tuple[str, ...], list[float]] = {each: [] for each in groups}
    folds = [groups[i::FOLDS] for i in range(min(FOLDS, len(groups)))]
    for number, fold in enumerate(folds):
        progress(f"without a {word}", number / len(folds))
        out = set(fold)
        rest = [each for each in results if group_of(each) not in out]
        others = tables if of or leave == "model" else _without(tables, {each[0] for each in out})
        found = populate(rest, reference, others) if rest else None
        if found is None:
            continue
        mean, covariance = found.prior(of if of in found.models else None)
        for each in judged:
            if group_of(each) in out:
                before = log_predictive(each, np.zeros(size), np.eye(size))
                gains[group_of(each)].append(log_predictive(each, mean, covariance) - before)
    means = np.array([np.mean(each) for each in gains.values() if each])
    return judge_gains(word, means)


def judge_gains(left_out: str, gains: Floats) -> Judgement:
    """The mean gain of the groups with its interval.

    Args:
        left_out: what a group is.
        gains: (groups,) nats a photo.
    """
    from scipy.special import stdtrit

    n = len(gains)
    if n < 2:
        return Judgement(left_out, n, None, None, None, None, None)
    mean, error = float(gains.mean()), float(gains.std(ddof=1) / np.sqrt(n))
    half = float(stdtrit(n - 1, (1 + CONFIDENCE) / 2)) * error
    helps = None if mean - half <= 0 <= mean + half else mean > 0
    return Judgement(left_out, n, mean, error, mean - half, mean + half, helps)


def _without(tables: Tables, makers: set[str]) -> Tables:
    kept = [i for i, name in enumerate(tables.names) if maker_of(name) not in makers]
    return Tables(tables.curves[kept], tuple(tables.names[i] for i in kept), tables.size)
