"""Answer → surprise: how ill it fits what was told, and what would explain that. Rules 1 to 3 of docs/verdict.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.curves.covariance import EDGE, Seen, Tolerances, covariance, smooth_errors
from camssf.curves.ssf import Ssf
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.photo.patches import PatchMeans
from camssf.photo.pose import Pose
from camssf.photo.signals import Signals
from camssf.rules import rules
from camssf.spectra import ChartTable, Lamp

_NUMBER = rules().number
SURPRISE = _NUMBER("verdict.surprise")
SUSPECT, SHARE = _NUMBER("verdict.suspect"), _NUMBER("verdict.share")
BLACK = _NUMBER("verdict.black")
FEWEST = rules().whole("verdict.fewest")
VEIL_FAVOUR, DARKEST_TONE = _NUMBER("verdict.veil_favour"), _NUMBER("verdict.darkest_tone")
OFFSETS = ("veil", "black")
"""Suspects that add to every signal; a tone curve looks much like them."""


@dataclass(frozen=True)
class Suspect:
    """One way in which a capture may be wrong, and what it would explain of T: rule 3.

    Attributes:
        kind: "veil", "black", "white", "light", "tone" or "patch".
        patch: 0-based; None where it is of no patch.
        gain: of T. amount: its size where d = 1, in units of D; 0 else.
    """

    kind: str
    patch: int | None
    gain: float
    amount: float


@dataclass(frozen=True)
class Surprise:
    """How ill the answer fits what was told: rules 1 to 3.

    Attributes:
        residual, prior: the two parts of T, summed over the channels.
        count: N.
        suspects: in the order of rule 3, patches last.
    """

    residual: float
    prior: float
    count: int
    suspects: tuple[Suspect, ...]

    @property
    def total(self) -> float:
        """T."""
        return self.residual + self.prior

    @property
    def z(self) -> float:
        """T as a standard normal number, rule 2."""
        u = 2.0 / (9.0 * self.count)
        return float(((self.total / self.count) ** (1.0 / 3.0) - (1.0 - u)) / np.sqrt(u))


def directions(length: float) -> Floats:
    """Φ of a smooth error on the grid, (681, p): column q is √(h / (ℓ √(π/2))) exp(-((λ - t_q) / ℓ)²).

    h = ℓ / 2, t_q = 380 - 2 ℓ + q h up to the first at or beyond 720 + 2 ℓ: white noise, smoothed, so that
    Φ Φᵀ = exp(-½ (Δλ / ℓ)²).
    """
    return smooth_errors(length, WAVELENGTHS)


@dataclass(frozen=True)
class Weighed:
    """What a verdict weighs: k measured shots, and what was told of them.

    Attributes:
        signals: (k, n, 3).
        table: the chart's.
        means, poses, lamps: k of each.
        white_reflectance, white_tolerance: (681,) ρ and its relative error.
        gains: gain modes (k, g, n), and what part of them each channel has for itself (`evidence.gains`).
    """

    signals: Signals
    table: ChartTable
    means: Sequence[PatchMeans]
    poses: Sequence[Pose]
    lamps: Sequence[Lamp]
    white_reflectance: Floats
    white_tolerance: float
    gains: tuple[Floats, float] | None = None

    def surprise(self, answer: Ssf) -> Surprise:
        """Rules 1 and 2 of all shots together."""
        return _surprise(self, answer, suspects=False)

    def surprise_of(self, j: int, answer: Ssf) -> Surprise:
        """Rules 1 to 3 of shot j alone, by the answer to it; below `FEWEST` patches nothing is suspected."""
        if int(self.signals.used[j].sum()) < FEWEST:
            return Surprise(0.0, 0.0, FEWEST, ())
        alone = replace(
            self, signals=only(self.signals, j), means=[self.means[j]], poses=[self.poses[j]], lamps=[self.lamps[j]],
            gains=None if self.gains is None else (self.gains[0][j : j + 1], self.gains[1]),
        )  # fmt: skip
        return _surprise(alone, answer, suspects=True)


def _surprise(weighed: Weighed, ssf: Ssf, *, suspects: bool) -> Surprise:
    """Rules 1 to 3. Suspects are questioned of one shot.

    Light that the gain modes can carry stands in Σ, so that what they take for it counts by its own size.
    """
    signals = weighed.signals
    used = signals.used
    y, off = signals.values[used], (signals.values - ssf.predicted)[used]  # (rows, 3)
    inverse = np.asarray(np.linalg.inv(_covariance(weighed, ssf)), dtype=np.float64)
    e = np.asarray(inverse @ off.T.ravel(), dtype=np.float64)
    residual = float(off.T.ravel() @ e)
    prior = float(np.sum(ssf.code**2)) if ssf.std is not None else 0.0
    found: list[Suspect] = []
    if suspects:
        means = weighed.means[0]
        X, Y = _places(weighed.poses[0], used[0])[used[0]].T[:, :, None]
        ways: dict[str, list[NDArray[np.floating[Any]]]] = {"veil": [1.0 - y]}
        if means.dark is None:
            level = (signals.white - signals.dark)[used] / (means.saturation - signals.dark[used])
            ways["black"] = [(1.0 - y) / level]
        if means.white is not None:
            ways["white"] = [y * np.eye(3)[c] for c in range(3)]
        ways["light"] = [y * way for way in _falls(X, Y, solved=_solved(weighed))]
        ways["light"] += [y] if means.white is None else []
        ways["tone"] = [y * np.log(np.maximum(y, DARKEST_TONE))]
        found += [Suspect(kind, None, *_gain(way, inverse, e)) for kind, way in ways.items()]
        patches = np.flatnonzero(used[0])
        found += [Suspect("patch", int(i), _own_gain(row, inverse, e), 0.0) for row, i in enumerate(patches)]
    return Surprise(residual, prior, 3 * len(y), tuple(found))


def _covariance(weighed: Weighed, ssf: Ssf) -> Floats:
    """Rule 1, (3 rows, 3 rows): red's rows, green's, blue's."""
    signals, table, rho = weighed.signals, weighed.table, weighed.white_reflectance
    shot, patch = np.nonzero(signals.used)
    light = (ssf.lamp * STEP)[:, None] * ssf.values.T  # (k, 3, m) L s dλ
    light = light / (light @ rho)[..., None]
    light = np.moveaxis(light, 1, 0)[:, shot].reshape(-1, WAVELENGTHS.size)  # (3 rows, m) L s dλ / W
    channel, shot, patch = np.repeat(np.arange(3), len(shot)), np.tile(shot, 3), np.tile(patch, 3)
    slope = np.gradient(table.values, STEP, axis=1)[patch]
    widths = np.array([lamp.tolerance for lamp in weighed.lamps])
    y, expected, error = (
        each[signals.used].T.ravel() for each in (signals.values, ssf.predicted, signals.standard_error)
    )
    seen = Seen(
        channel, shot, patch, y, expected, error,
        light * table.values[patch], EDGE * light * slope, light, light * rho, WAVELENGTHS,
    )  # fmt: skip
    known = Tolerances(table.tolerance[patch], weighed.white_tolerance, widths[shot])
    sigma = np.sum(list(covariance(seen, known).values()), axis=0)
    for j, each in enumerate(weighed.lamps):
        if len(each.modes):
            modes = (seen.against_white * (shot == j)[:, None]) @ each.modes.T
            sigma = sigma + modes @ modes.T
    if weighed.gains is not None and weighed.gains[0].size:
        modes, own = weighed.gains
        for j in range(len(weighed.lamps)):
            steps = (y * (shot == j))[:, None] * modes[j].T[patch]
            sigma = sigma + np.where(channel[:, None] == channel, 1.0 + own**2, 1.0) * (steps @ steps.T)
    return np.asarray(sigma)


def _solved(weighed: Weighed) -> bool:
    """Was a plane and a bowl of light solved for with the curves?"""
    return weighed.gains is not None and bool(weighed.gains[0].size)


def _falls(X: Floats, Y: Floats, *, solved: bool) -> list[Floats]:
    """How light may fall over a chart: a plane and a bowl, or, where these are in Σ, what is beyond them."""
    return [X**3, X**2 * Y, X * Y**2, Y**3] if solved else [X, Y, X**2 + Y**2]


def _places(pose: Pose, used: NDArray[np.bool_]) -> Floats:
    """(n, 2) X, Y of the patches."""
    centres = pose.patches.mean(axis=1)
    return np.asarray((centres - centres[used].mean(axis=0)) / max(float(np.ptp(centres[used], axis=0).max()), 1.0))


def _gain(ways: Sequence[NDArray[np.floating[Any]]], inverse: Floats, e: Floats) -> tuple[float, float]:
    """What a suspect explains, and its amount: rule 3. Each way is (rows, 3)."""
    D = np.stack([way.T.ravel() for way in ways], axis=1)
    g, G = D.T @ e, D.T @ inverse @ D
    amounts = np.linalg.solve(G + (1e-12 * np.trace(G) + 1e-300) * np.eye(len(G)), g)
    return float(g @ amounts), float(amounts[0]) if len(ways) == 1 else 0.0


def _own_gain(row: int, inverse: Floats, e: Floats) -> float:
    """What an error of one patch's three signals explains, each free: eᵀ (Σ⁻¹)⁻¹ e of its rows."""
    own = np.arange(3) * (len(e) // 3) + row
    return float(e[own] @ np.linalg.solve(inverse[np.ix_(own, own)], e[own]))


def only(signals: Signals, j: int) -> Signals:
    """Shot j alone."""
    arrays = ("values", "standard_error", "chart", "white", "dark", "used", "white_is_patch")
    return replace(signals, **{name: getattr(signals, name)[j : j + 1] for name in arrays})


def shot_answer(answer: Ssf, j: int) -> Ssf:
    """What an answer says of shot j alone."""
    return replace(answer, predicted=answer.predicted[j : j + 1], lamp=answer.lamp[j : j + 1])


def accusable(one: Surprise) -> tuple[Suspect, float]:
    """The strongest suspect of a shot, and the gain beyond which it is named."""
    strongest = max(_possible(one), key=lambda each: each.gain * (VEIL_FAVOUR if each.kind in OFFSETS else 1.0))
    return strongest, SHARE * (one.total - one.count) if one.z > SURPRISE else SUSPECT


def offset(one: Surprise) -> Suspect | None:
    """The likelier of stray light and a wrong black level, where no dark frame was taken; None where one was.

    Stray light has the white's colour, a wrong black level is the same in every channel.
    """
    if not _may_be_black(one):
        return None
    return max((each for each in _possible(one) if each.kind in OFFSETS), key=lambda each: each.gain)


def accused(one: Surprise) -> Suspect | None:
    """The strongest suspect of a shot, if it explains enough: SHARE of a surprise, or SUSPECT. Else the offset.

    The several directions of a wrong white frame and of uneven light can follow an offset; an offset hardly follows
    them. So one that alone explains SHARE of what they do is named in their place.
    """
    if not one.suspects:
        return None
    strongest, enough = accusable(one)
    found = offset(one)
    if found is None or found.gain <= BLACK:
        return strongest if strongest.gain > enough else None
    imitated = strongest.kind in ("white", "light") and found.gain > SHARE * strongest.gain
    return strongest if strongest.gain > enough and not imitated else found


def _possible(one: Surprise) -> list[Suspect]:
    """Light over the chart only adds: a veil that takes away is the black level, where that may be it."""
    darker = _may_be_black(one)
    return [each for each in one.suspects if not (darker and each.kind == "veil" and each.amount < 0)]


def _may_be_black(one: Surprise) -> bool:
    return any(each.kind == "black" for each in one.suspects)
