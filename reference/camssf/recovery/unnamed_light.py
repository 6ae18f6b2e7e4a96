"""Estimates the light of shots whose lamp is not named: a mixture over its kinds (docs/maths.md, "Unnamed light")."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import Basis
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.recovery.inputs import hypotheses_of
from camssf.recovery.observation import Observation
from camssf.recovery.posterior import code_posterior, modes_of_lamps
from camssf.recovery.rows import DARKEST
from camssf.recovery.sensitivity import EstimatedLamp, Hypothesis
from camssf.recovery.whitening import whitened_model
from camssf.rules import rules
from camssf.spectra.bundled import correlated_temperature, observer
from camssf.spectra.families import FAMILIES as LAMP_KINDS
from camssf.spectra.lights import kind_of

NO_KIND = rules().number("lamp.no_kind")
"""Prior probability of a light that is of no kind; any kind may be taken for it."""


NAMED = "named"
"""The kind of a lamp that is that of a table."""


@dataclass(frozen=True)
class LampPosterior:
    """Posterior of one shot's lamp under one hypothesis.

    Attributes:
        power: (681,) relative, of mean 1.
        modes: (p, 681) modes of its error, each of one standard deviation; none of them changes the mean of 1.
    """

    power: Floats
    modes: Floats

    @property
    def kelvin(self) -> tuple[float, float]:
        """Correlated colour temperature and its standard deviation, K, by linear propagation.

        The result depends on the covariance of `power` only, not on the modes chosen to describe it.
        """
        change = self.modes @ temperature_slope(self.power)
        return float(temperature(self.power)), float(np.sqrt(np.sum(change**2)))


def lamp_posteriors(observation: Observation, basis: Basis) -> list[LampPosterior]:
    """Gaussian posterior of each shot's lamp, from its modes and its smooth error, expressed as modes too."""
    with_modes = by_modes(observation)
    every = with_modes.lamp_modes
    k, size, _ = every.shape
    model = whitened_model(hypotheses_of([with_modes], basis), np.array(0.0))
    estimate, covariance = modes_of_lamps(model, *code_posterior(model))
    mean, spread = estimate.reshape(k, size), covariance[0]
    posteriors = []
    for j in range(k):
        values, vectors = np.linalg.eigh(spread[j * size : (j + 1) * size, j * size : (j + 1) * size])
        power = observation.lamp[j] * np.maximum(1.0 + mean[j] @ every[j], DARKEST)
        level = power.mean()
        modes = (np.sqrt(np.maximum(values, 0.0)) * vectors).T @ every[j] * observation.lamp[j] / level
        power = power / level
        posteriors.append(LampPosterior(power, modes - modes.mean(axis=1, keepdims=True) * power))  # not its scale
    return posteriors


def by_modes(observation: Observation) -> Observation:
    """The observation with the lamps' smooth errors expressed as additional lamp modes."""
    smooth = smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T
    every = np.concatenate([observation.lamp_modes, observation.lamp_tolerance[:, None, None] * smooth], axis=1)
    return replace(observation, lamp_modes=every, lamp_tolerance=np.zeros(len(every)))


def estimated_lamp(
    posteriors: Sequence[LampPosterior], share: Floats, choice: Sequence[Hypothesis], j: int
) -> EstimatedLamp:
    """Shot j's light.

    Args:
        posteriors, share: of its lamp under each hypothesis that was solved, and (a,) their weights.
        choice: all hypotheses, whose probabilities each kind's is the sum of.
        j: 0-based.
    """
    power = np.stack([posterior.power for posterior in posteriors])
    mean = share @ power
    variance = np.stack([np.sum(posterior.modes**2, axis=0) for posterior in posteriors])
    kelvin, kelvin_std = np.array([posterior.kelvin for posterior in posteriors]).T
    middle = float(share @ kelvin)
    called = any(kind_of(hypothesis.kinds[j]) is None for hypothesis in choice)
    kinds = {} if called else dict.fromkeys(LAMP_KINDS, 0.0)
    for hypothesis in choice:
        kind = kind_of(hypothesis.kinds[j]) or NAMED
        kinds[kind] = kinds.get(kind, 0.0) + hypothesis.probability
    other = 0.0 if called else NO_KIND
    return EstimatedLamp(
        kinds={kind: (1.0 - other) * min(sum_, 1.0) + other / len(kinds) for kind, sum_ in kinds.items()},
        power=mean,
        std=np.sqrt(share @ (variance + (power - mean) ** 2)),
        kelvin=middle,
        kelvin_std=float(np.sqrt(share @ (kelvin_std**2 + (kelvin - middle) ** 2))),
    )


def temperature(power: Floats) -> Floats:
    """Correlated colour temperature of powers (..., 681), K."""
    return correlated_temperature(np.asarray(power) @ observer("1931"))


def temperature_slope(power: Floats) -> Floats:
    """∂T / ∂L of `temperature` at a power (681,), K: dx = (x̄ - x (x̄ + ȳ + z̄)) / (X + Y + Z), and dy alike."""
    functions = observer("1931")  # (681, 3)
    xyz = power @ functions
    x, y = xyz[:2] / xyz.sum()
    dx, dy = ((functions[:, i] - share * functions.sum(axis=1)) / xyz.sum() for i, share in enumerate((x, y)))
    n = (x - 0.3320) / (y - 0.1858)
    return np.asarray(((-1347.0 * n + 7050.0) * n - 6823.3) * (dx - n * dy) / (y - 0.1858))
