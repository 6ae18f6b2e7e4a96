"""χ² of an answer's residuals and prior, and what may explain a bad fit (rules 1 to 3 of docs/verdict.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.photo.find.pose import Pose
from camssf.photo.patches import PatchMeans
from camssf.photo.signals import Signals
from camssf.recovery.covariance import EDGE, LinearisedSignals, Tolerances, covariance, smooth_errors
from camssf.recovery.sensitivity import Ssf
from camssf.rules import rules
from camssf.spectra import ChartTable, Lamp

_NUMBER = rules().number
GOODNESS_OF_FIT = _NUMBER("verdict.goodness_of_fit")
EXPLANATION, SHARE = _NUMBER("verdict.explanation"), _NUMBER("verdict.share")
BLACK = _NUMBER("verdict.black")
FEWEST = rules().whole("verdict.fewest")
VEIL_FAVOUR, DARKEST_TONE = _NUMBER("verdict.veil_favour"), _NUMBER("verdict.darkest_tone")
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


def directions(length: float) -> Floats:
    """Directions Φ (681, p) of a smooth error on the grid.

    Column q is √(h / (ℓ √(π/2))) exp(-((λ - t_q) / ℓ)²) with h = ℓ / 2 and t_q = 380 - 2 ℓ + q h, up to the first
    t_q at or beyond 720 + 2 ℓ. This is smoothed white noise: Φ Φᵀ = exp(-½ (Δλ / ℓ)²).
    """
    return smooth_errors(length, WAVELENGTHS)


@dataclass(frozen=True)
class VerdictInputs:
    """The k measured shots that a verdict judges, with their chart, lamps and white reference.

    Attributes:
        signals: (k, n, 3).
        table: the chart's.
        means, poses, lamps: k of each.
        white_reflectance, white_tolerance: (681,) ρ and its relative error.
        gains: gain modes (k, g, n), and the part of them that is independent in each channel (`CaptureFit.gains`).
    """

    signals: Signals
    table: ChartTable
    means: Sequence[PatchMeans]
    poses: Sequence[Pose]
    lamps: Sequence[Lamp]
    white_reflectance: Floats
    white_tolerance: float
    gains: tuple[Floats, float] | None = None

    def goodness_of_fit(self, answer: Ssf) -> GoodnessOfFit:
        """Rules 1 and 2 for all shots together."""
        return _goodness_of_fit(self, answer, explain=False)

    def goodness_of_fit_of_shot(self, j: int, answer: Ssf) -> GoodnessOfFit:
        """Rules 1 to 3 for shot j alone, by the answer to it; no explanations below `FEWEST` patches."""
        if int(self.signals.used[j].sum()) < FEWEST:
            return GoodnessOfFit(0.0, 0.0, FEWEST, ())
        alone = replace(
            self, signals=self.signals.of_shot(j), means=[self.means[j]], poses=[self.poses[j]],
            lamps=[self.lamps[j]],
            gains=None if self.gains is None else (self.gains[0][j : j + 1], self.gains[1]),
        )  # fmt: skip
        return _goodness_of_fit(alone, answer, explain=True)


def _goodness_of_fit(inputs: VerdictInputs, ssf: Ssf, *, explain: bool) -> GoodnessOfFit:
    """Rules 1 to 3; explanations are computed for inputs of one shot only.

    Σ includes the gain modes, so that uneven light which they can model is weighted by its prior size.
    """
    signals = inputs.signals
    used = signals.used
    y, off = signals.values[used], (signals.values - ssf.predicted)[used]  # (rows, 3)
    inverse = np.asarray(np.linalg.inv(signal_covariance(inputs, ssf)), dtype=np.float64)
    e = np.asarray(inverse @ off.T.ravel(), dtype=np.float64)
    residual = float(off.T.ravel() @ e)
    prior = float(np.sum(ssf.code**2)) if ssf.std is not None else 0.0
    found: list[Explanation] = []
    if explain:
        means = inputs.means[0]
        X, Y = _places(inputs.poses[0], used[0])[used[0]].T[:, :, None]
        ways: dict[str, list[NDArray[np.floating[Any]]]] = {"veil": [1.0 - y]}
        if means.dark is None:
            level = (signals.white - signals.dark)[used] / (means.saturation - signals.dark[used])
            ways["black"] = [(1.0 - y) / level]
        if means.white is not None:
            ways["white"] = [y * np.eye(3)[c] for c in range(3)]
        ways["light"] = [y * way for way in _falls(X, Y, solved=_solved(inputs))]
        ways["light"] += [y] if means.white is None else []
        ways["tone"] = [y * np.log(np.maximum(y, DARKEST_TONE))]
        found += [Explanation(kind, None, *_gain(way, inverse, e)) for kind, way in ways.items()]
        patches = np.flatnonzero(used[0])
        found += [Explanation("patch", int(i), _own_gain(row, inverse, e), 0.0) for row, i in enumerate(patches)]
    return GoodnessOfFit(residual, prior, 3 * len(y), tuple(found))


def signal_covariance(inputs: VerdictInputs, ssf: Ssf) -> Floats:
    """Covariance Σ of rule 1, (3 rows, 3 rows): rows of red, then green, then blue."""
    signals, table, rho = inputs.signals, inputs.table, inputs.white_reflectance
    shot, patch = np.nonzero(signals.used)
    light = (ssf.light.lamp * STEP)[:, None] * ssf.values.T  # (k, 3, m) L s dλ
    light = light / (light @ rho)[..., None]
    light = np.moveaxis(light, 1, 0)[:, shot].reshape(-1, WAVELENGTHS.size)  # (3 rows, m) L s dλ / W
    channel, shot, patch = np.repeat(np.arange(3), len(shot)), np.tile(shot, 3), np.tile(patch, 3)
    slope = np.gradient(table.values, STEP, axis=1)[patch]
    widths = np.array([lamp.tolerance for lamp in inputs.lamps])
    y, expected, error = (
        each[signals.used].T.ravel() for each in (signals.values, ssf.predicted, signals.standard_error)
    )
    seen = LinearisedSignals(
        channel, shot, patch, y, expected, error,
        light * table.values[patch], EDGE * light * slope, light, light * rho, WAVELENGTHS,
    )  # fmt: skip
    known = Tolerances(table.tolerance[patch], inputs.white_tolerance, widths[shot])
    sigma = np.sum(list(covariance(seen, known).values()), axis=0)
    for j, each in enumerate(inputs.lamps):
        if len(each.modes):
            modes = (seen.against_white * (shot == j)[:, None]) @ each.modes.T
            sigma = sigma + modes @ modes.T
    if inputs.gains is not None and inputs.gains[0].size:
        modes, own = inputs.gains
        for j in range(len(inputs.lamps)):
            steps = (y * (shot == j))[:, None] * modes[j].T[patch]
            sigma = sigma + np.where(channel[:, None] == channel, 1.0 + own**2, 1.0) * (steps @ steps.T)
    return np.asarray(sigma)


def _solved(inputs: VerdictInputs) -> bool:
    """Whether a plane and a bowl of light were solved for with the curves."""
    return inputs.gains is not None and bool(inputs.gains[0].size)


def _falls(X: Floats, Y: Floats, *, solved: bool) -> list[Floats]:
    """Directions of uneven light over a chart: a plane and a bowl, or cubic terms if Σ includes plane and bowl."""
    return [X**3, X**2 * Y, X * Y**2, Y**3] if solved else [X, Y, X**2 + Y**2]


def _places(pose: Pose, used: NDArray[np.bool_]) -> Floats:
    """(n, 2) centres X, Y of the patches, about the mean of the used ones, divided by the larger range."""
    centres = pose.patches.mean(axis=1)
    return np.asarray((centres - centres[used].mean(axis=0)) / max(float(np.ptp(centres[used], axis=0).max()), 1.0))


def _gain(ways: Sequence[NDArray[np.floating[Any]]], inverse: Floats, e: Floats) -> tuple[float, float]:
    """Gain and amount of an explanation (rule 3); each direction in `ways` is (rows, 3)."""
    D = np.stack([way.T.ravel() for way in ways], axis=1)
    g, G = D.T @ e, D.T @ inverse @ D
    amounts = np.linalg.solve(G + (1e-12 * np.trace(G) + 1e-300) * np.eye(len(G)), g)
    return float(g @ amounts), float(amounts[0]) if len(ways) == 1 else 0.0


def _own_gain(row: int, inverse: Floats, e: Floats) -> float:
    """Gain of independent errors in one patch's three signals: eᵀ (Σ⁻¹)⁻¹ e of its rows."""
    own = np.arange(3) * (len(e) // 3) + row
    return float(e[own] @ np.linalg.solve(inverse[np.ix_(own, own)], e[own]))


def shot_answer(answer: Ssf, j: int) -> Ssf:
    """The answer with the predictions and the lamp of shot j only."""
    light = replace(answer.light, lamp=answer.light.lamp[j : j + 1])
    return replace(answer, predicted=answer.predicted[j : j + 1], light=light)


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
    return max((each for each in _possible(one) if each.kind in OFFSETS), key=lambda each: each.gain)


def best_explanation(one: GoodnessOfFit) -> Explanation | None:
    """The explanation to report for a shot; None if none explains enough.

    This is the strongest one if its gain exceeds the limit of `strongest_explanation`, else an offset above BLACK.
    The several directions of a wrong white frame and of uneven light can imitate an offset, but an offset can hardly
    imitate them. So an offset that explains more than SHARE of their gain replaces them.
    """
    if not one.explanations:
        return None
    strongest, enough = strongest_explanation(one)
    found = offset(one)
    if found is None or found.gain <= BLACK:
        return strongest if strongest.gain > enough else None
    imitated = strongest.kind in ("white", "light") and found.gain > SHARE * strongest.gain
    return strongest if strongest.gain > enough and not imitated else found


def _possible(one: GoodnessOfFit) -> list[Explanation]:
    """The physically possible explanations: stray light cannot be negative; that would be a wrong black level."""
    darker = _may_be_black(one)
    return [each for each in one.explanations if not (darker and each.kind == "veil" and each.amount < 0)]


def _may_be_black(one: GoodnessOfFit) -> bool:
    return any(each.kind == "black" for each in one.explanations)
