"""χ² of an answer's residuals and prior, and what may explain a bad fit (rules 1 to 3 of docs/verdict.md)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from camssf.fit.capture_fit import lamp_modes
from camssf.grid import Floats
from camssf.photo.find.pose import Pose
from camssf.photo.patches import PatchMeans
from camssf.photo.signals import Signals
from camssf.recovery.misfit import KINDS, JudgedSignals, Misfit, errors_at_answer, misfit, signals_at_answer
from camssf.recovery.sensitivity import Ssf
from camssf.rules import rules
from camssf.spectra import ChartTable, Lamp
from camssf.verdict.cause_groups import Causes
from camssf.verdict.lamp import Rival

_NUMBER = rules().number
GOODNESS_OF_FIT = _NUMBER("verdict.goodness_of_fit")
EXPLANATION, SHARE = _NUMBER("verdict.explanation"), _NUMBER("verdict.share")
BLACK = _NUMBER("verdict.black")
FEWEST = rules().whole("verdict.fewest")
VEIL_FAVOUR = _NUMBER("verdict.veil_favour")
OFFSETS = ("veil", "black")
"""Explanations that add an offset to every signal; a tone curve looks similar."""


@dataclass(frozen=True)
class Explanation:
    """One possible error of a capture, and the part of T that it explains (rule 3).

    Attributes:
        kind: "veil", "black", "white", "light", "tone" or "patch".
        patch: 0-based; None unless the kind is "patch".
        gain: the explained part of T.
        amount: size of the error in units of D if it has one direction (d = 1), else 0.
    """

    kind: str
    patch: int | None
    gain: float
    amount: float


@dataclass(frozen=True)
class GoodnessOfFit:
    """χ² of the residuals and of the prior (rules 1 to 3).

    Attributes:
        residual, prior: the two parts of T, summed over the channels.
        count: N, the degrees of freedom.
        explanations: in the order of rule 3, patches last.
    """

    residual: float
    prior: float
    count: int
    explanations: tuple[Explanation, ...]

    @property
    def total(self) -> float:
        """T."""
        return self.residual + self.prior

    @property
    def z(self) -> float:
        """T transformed to a standard normal number (rule 2)."""
        u = 2.0 / (9.0 * self.count)
        return float(((self.total / self.count) ** (1.0 / 3.0) - (1.0 - u)) / np.sqrt(u))


@dataclass(frozen=True)
class VerdictInputs:
    """The k measured shots that a verdict judges, with their chart, lamps and white reference.

    Attributes:
        signals: (k, n, 3).
        table: the chart's.
        means, poses, lamps: k of each.
        white_reference: its reflectance ρ (681,), and the relative error of it.
        gains: gain modes (k, g, n), and the part of them that is independent in each channel (`CaptureFit.gains`).
        causes: weighs the causes of shot j (`camssf.verdict.cause`), given the rivals of all shots and the causes for
            which another rule speaks; None where they cannot be weighed, on a basis without a prior.
    """

    signals: Signals
    table: ChartTable
    means: Sequence[PatchMeans]
    poses: Sequence[Pose]
    lamps: Sequence[Lamp]
    white_reference: tuple[Floats, float]
    gains: tuple[Floats, float] | None = None
    causes: Callable[[int, Sequence[Rival], Collection[str]], Causes] | None = None

    def goodness_of_fit(self, answer: Ssf) -> GoodnessOfFit:
        """Rules 1 and 2 for all shots together."""
        return _goodness_of_fit(self, answer, explain=False)

    def goodness_of_fit_of_shot(self, j: int, answer: Ssf) -> GoodnessOfFit:
        """Rules 1 to 3 for shot j alone, by the answer to it; no explanations below `FEWEST` patches."""
        if int(self.signals.used[j].sum()) < FEWEST:
            return GoodnessOfFit(0.0, 0.0, FEWEST, ())
        return _goodness_of_fit(self.of_shot(j), answer, explain=True)

    def of_shot(self, j: int) -> VerdictInputs:
        """Shot j alone."""
        return replace(
            self, signals=self.signals.of_shot(j), means=[self.means[j]], poses=[self.poses[j]],
            lamps=[self.lamps[j]],
            gains=None if self.gains is None else (self.gains[0][j : j + 1], self.gains[1]),
        )  # fmt: skip


def _goodness_of_fit(inputs: VerdictInputs, ssf: Ssf, *, explain: bool) -> GoodnessOfFit:
    """Rules 1 to 3; explanations are computed for inputs of one shot only."""
    judged = explained_signals(inputs, ssf) if explain else judged_signals(inputs, ssf)
    parts = misfit(judged, np.array(float(explain)))
    prior = float(parts.prior) if ssf.std is not None else 0.0
    return GoodnessOfFit(
        float(parts.residual), prior, round(float(parts.count)), _explanations(inputs, parts) if explain else ()
    )


def _explanations(inputs: VerdictInputs, parts: Misfit) -> tuple[Explanation, ...]:
    """Those that the one shot's frames leave open, patches last."""
    means, (used,) = inputs.means[0], inputs.signals.used
    open_kinds = {"veil", "light", "tone"}
    open_kinds |= {"black"} if means.dark is None else set()
    open_kinds |= {"white"} if means.white is not None else set()
    amounts = dict(zip(("veil", "black", "tone"), parts.amount, strict=True))
    by_kind = [
        Explanation(kind, None, float(gain), float(amounts.get(kind, 0.0)))
        for kind, gain in zip(KINDS, parts.gain, strict=True)
        if kind in open_kinds
    ]
    return (*by_kind, *(Explanation("patch", int(i), float(parts.patch_gain[i]), 0.0) for i in np.flatnonzero(used)))


def judged_signals(inputs: VerdictInputs, ssf: Ssf) -> JudgedSignals:
    """The arrays of `misfit`, without explanations: level 1 and no fields."""
    signals, table, lamps = inputs.signals, inputs.table, inputs.lamps
    k, n, _ = signals.values.shape
    gain_modes, own = (np.zeros((k, 0, n)), 0.0) if inputs.gains is None else inputs.gains
    return JudgedSignals(
        signals=np.where(signals.used[..., None], signals.values, 1.0),
        standard_error=signals.standard_error,
        predicted=ssf.predicted,
        used=signals.used.astype(float),
        level=np.ones((k, n, 3)),
        fields=np.zeros((0, k, n)),
        curves=ssf.values,
        code=ssf.code,
        lamp=ssf.lamp,
        lamp_tolerance=np.array([lamp.tolerance for lamp in lamps]),
        lamp_modes=lamp_modes(lamps),
        reflectance=table.values,
        chart_tolerance=table.tolerance,
        white_reflectance=inputs.white_reference[0],
        white_tolerance=np.array(inputs.white_reference[1]),
        gain_modes=gain_modes,
        gain_own=np.array(own),
    )


def explained_signals(inputs: VerdictInputs, ssf: Ssf) -> JudgedSignals:
    """The arrays of `misfit` of one shot, with what its explanations need."""
    return replace(judged_signals(inputs, ssf), level=_level(inputs), fields=_fields(inputs))


def signal_covariance(inputs: VerdictInputs, ssf: Ssf) -> Floats:
    """Covariance Σ of rule 1, (3 rows, 3 rows): the used rows of red, then green, then blue."""
    used, k = inputs.signals.used, len(inputs.lamps)
    shot, patch = np.nonzero(used)
    channel, shot, patch = np.repeat(np.arange(3), len(shot)), np.tile(shot, 3), np.tile(patch, 3)
    order, judged = (patch * 3 + channel) * k + shot, judged_signals(inputs, ssf)  # of the rows of `misfit`
    return np.asarray(errors_at_answer(judged, signals_at_answer(judged)).covariance[np.ix_(order, order)])


def _level(inputs: VerdictInputs) -> Floats:
    """The one shot's white signal over the largest one, both above dark, (1, n, 3); 1 where it is not used."""
    signals, saturation = inputs.signals, inputs.means[0].saturation
    level = (signals.white - signals.dark) / (saturation - signals.dark)
    return np.where(signals.used[..., None], level, 1.0)


def _fields(inputs: VerdictInputs) -> Floats:
    """Uneven light over the one shot's chart, (f, 1, n), and its level if the white patch is the reference."""
    X, Y = places(inputs.poses[0], inputs.signals.used[0]).T
    fields = _falls(X, Y, solved=_solved(inputs)) + ([np.ones_like(X)] if inputs.means[0].white is None else [])
    return np.stack(fields)[:, None, :]


def _solved(inputs: VerdictInputs) -> bool:
    """Whether a plane and a bowl of light were solved for with the curves."""
    return inputs.gains is not None and bool(inputs.gains[0].size)


def _falls(X: Floats, Y: Floats, *, solved: bool) -> list[Floats]:
    """Directions of uneven light over a chart: a plane and a bowl, or cubic terms if Σ includes plane and bowl."""
    return [X**3, X**2 * Y, X * Y**2, Y**3] if solved else [X, Y, X**2 + Y**2]


def places(pose: Pose, used: NDArray[np.bool_]) -> Floats:
    """(n, 2) centres X, Y of the patches, about the mean of the used ones, divided by the larger range."""
    centres = pose.patches.mean(axis=1)
    return np.asarray((centres - centres[used].mean(axis=0)) / max(float(np.ptp(centres[used], axis=0).max()), 1.0))


def shot_answer(answer: Ssf, j: int) -> Ssf:
    """The answer with the predictions and the lamp of shot j only."""
    return replace(answer, predicted=answer.predicted[j : j + 1], lamp=answer.lamp[j : j + 1])


def strongest_explanation(one: GoodnessOfFit) -> tuple[Explanation, float]:
    """The strongest explanation of a shot, and the gain above which it is reported."""
    strongest = max(_possible(one), key=lambda each: each.gain * (VEIL_FAVOUR if each.kind in OFFSETS else 1.0))
    return strongest, SHARE * (one.total - one.count) if one.z > GOODNESS_OF_FIT else EXPLANATION


def offset(one: GoodnessOfFit) -> Explanation | None:
    """The likelier of stray light and a wrong black level if there is no dark frame, else None.

    Stray light has the white's colour; a wrong black level is the same in every channel.
    """
    if not _may_be_black(one):
        return None
    return max(
        (explanation for explanation in _possible(one) if explanation.kind in OFFSETS), key=lambda each: each.gain
    )


def best_explanation(one: GoodnessOfFit) -> Explanation | None:
    """The explanation to report for a shot; None if none explains enough.

    This is the strongest one if its gain exceeds the limit of `strongest_explanation`, else an offset above BLACK.
    The several directions of a wrong white frame and of uneven light can imitate an offset, but an offset can hardly
    imitate them. So an offset that explains more than SHARE of their gain replaces them.
    """
    if not one.explanations:
        return None
    strongest, enough = strongest_explanation(one)
    added = offset(one)
    if added is None or added.gain <= BLACK:
        return strongest if strongest.gain > enough else None
    imitated = strongest.kind in ("white", "light") and added.gain > SHARE * strongest.gain
    return strongest if strongest.gain > enough and not imitated else added


def _possible(one: GoodnessOfFit) -> list[Explanation]:
    """The physically possible explanations: stray light cannot be negative; that would be a wrong black level."""
    darker = _may_be_black(one)
    return [
        explanation
        for explanation in one.explanations
        if not (darker and explanation.kind == "veil" and explanation.amount < 0)
    ]


def _may_be_black(one: GoodnessOfFit) -> bool:
    return any(explanation.kind == "black" for explanation in one.explanations)
