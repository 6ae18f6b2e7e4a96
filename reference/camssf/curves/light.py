"""Evidence under a light that nobody named → the curves, and the light, by the evidence of each kind.

One hypothesis is the kind of every unnamed shot, a basis and how wide its prior is taken. All of them are weighed in
closed form; those that matter are solved, and mixed by the law of total variance (docs/maths.md, "A light that nobody
named").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from camssf.curves.basis import Basis, read_basis, widened
from camssf.curves.choice import AUTO, answering, of_peak_one, probabilities
from camssf.curves.choice import hypotheses as families
from camssf.curves.code import log_evidence
from camssf.curves.covariance import LAMP_CORRELATION, smooth_errors
from camssf.curves.evidence import Evidence
from camssf.curves.sensing import DARKEST, Sensing, sense
from camssf.curves.ssf import FoundLight, Ssf, Weight, answer, respond
from camssf.errors import InvalidArgument
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.rules import rules
from camssf.spectra.families import FAMILIES as LAMP_KINDS
from camssf.spectra.surfaces import observer

SOLVED = rules().number("lamp.solved")
"""A hypothesis of less weight is not solved."""
BELIEFS = {kind: rules().number(f"lamp.{kind}") for kind in LAMP_KINDS}
"""How probable each kind is beforehand."""


@dataclass(frozen=True)
class Guess:
    """A hypothesis on the lights.

    Attributes:
        kinds: of each shot, "" where its lamp was named.
        evidence: the signals, with the lamps as these kinds have them.
    """

    kinds: tuple[str, ...]
    evidence: Evidence

    @property
    def belief(self) -> float:
        """ln of how probable it is beforehand."""
        return float(sum(np.log(BELIEFS[kind]) for kind in self.kinds if kind))


@dataclass(frozen=True)
class Hypothesis:
    """A guess, a basis, and how wide its prior is taken.

    Attributes:
        guess, basis, scale: which it is.
        belief: ln of how probable basis and scale are beforehand.
    """

    guess: Guess
    basis: str | Basis
    scale: float
    belief: float

    @property
    def known(self) -> Basis:
        """The basis as wide as it is taken."""
        return widened(self.basis if isinstance(self.basis, Basis) else read_basis(self.basis), self.scale)

    @property
    def name(self) -> str:
        """Of the basis."""
        return self.basis.name if isinstance(self.basis, Basis) else self.basis


def recover_in_any_light(
    guesses: Sequence[Guess],
    *,
    basis: str | Basis = AUTO,
    prior: Mapping[str, float] | None = None,
    prior_scale: float = 1.0,
    of: Floats | None = None,
    **how: Any,
) -> Ssf:
    """The curves that explain the signals, whatever the light was.

    Args:
        guesses: what the lights may be.
        basis, prior, prior_scale: as in `recover`.
        of: (n, 681) reflectances whose signals are predicted; None for the evidence's own.
        how: the same's l2, gamma, nonnegative and engine.

    Returns:
        A mixture. What belongs to one basis or one lamp is the likeliest hypothesis's: codes, their covariance, the
        scale of the curves, `kinds`.

    Raises:
        InvalidArgument: as `recover`; a basis without a prior, which weighs nothing.
        NotConverged: as `recover`.
    """
    asked = families(prior or {}) if basis == AUTO else [(basis, prior_scale, 0.0)]
    hypotheses = [Hypothesis(guess, name, scale, belief) for name, scale, belief in asked for guess in guesses]
    without = next((each.known for each in hypotheses if not each.known.prior), None)
    if without is not None:
        raise InvalidArgument(
            f"The {without.name} basis has no prior, so it cannot tell one light from another.",
            "Name the lamp, or take --basis phones.",
        )
    nats = np.array([log_evidence(sense(each.guess.evidence, each.known)) for each in hypotheses])
    likely = probabilities(nats + [each.guess.belief + each.belief for each in hypotheses])
    told = tuple(
        Weight(each.name, each.scale, float(size), float(share), each.guess.kinds)
        for each, size, share in zip(hypotheses, nats, likely, strict=True)
    )
    weights = answering([each.name for each in hypotheses], likely)
    kept = np.flatnonzero(weights >= min(SOLVED, weights.max()))
    share = weights[kept] / weights[kept].sum()
    answers = [
        answer(each.guess.evidence, each.basis, prior_scale=each.scale, **how)
        for each in (hypotheses[i] for i in kept)
    ]
    seen = [light_of(each.guess.evidence, each.known) for each in (hypotheses[i] for i in kept)]
    lights = tuple(
        _found([(hypotheses[i].guess.kinds[j], seen[a][j]) for a, i in enumerate(kept)], share, likely, told, j)
        if kind
        else None
        for j, kind in enumerate(guesses[0].kinds)
    )
    best = hypotheses[kept[share.argmax()]].guess
    chart = best.evidence.reflectance if of is None else of
    # The product of curve and light is known far better than each: means of products, not products of means.
    rho = best.evidence.white_reflectance
    predicted = np.einsum(
        "a,aknc->knc", share, np.stack([respond(each.values, chart, each.lamp, rho) for each in answers])
    )
    return replace(
        _mixed(answers, share, best.evidence), predicted=predicted, choice=told, lights=lights, kinds=best.kinds
    )


def _mixed(answers: Sequence[Ssf], share: Floats, evidence: Evidence) -> Ssf:
    """The mixture of answers under different lamps; `evidence` is the likeliest's."""
    best = answers[int(share.argmax())]
    mean, std = of_peak_one(answers, share)
    assert std is not None  # every basis has a prior
    scale = (evidence.white_reflectance * evidence.lamp[0] * STEP) @ mean  # (3,)
    lamps = np.stack([each.lamp / each.lamp.mean(axis=1, keepdims=True) for each in answers])  # (a, k, m)
    curves = np.stack([each.peak()[0] for each in answers])
    apart = np.einsum("a,amc->c", share, (curves - mean) ** 2)
    return replace(
        best,
        values=mean / scale,
        std=std / scale,
        gap=np.max([each.gap for each in answers], axis=0),
        layers_gap=np.max([each.layers_gap for each in answers], axis=0),
        finish_steps=np.max([each.finish_steps for each in answers], axis=0),
        lamp=np.einsum("a,akm->km", share, lamps),
        gain_code=np.einsum("a,akg->kg", share, np.stack([each.gain_code for each in answers])),
        between=apart / np.sum(std**2, axis=0),
    )


# The light itself


@dataclass(frozen=True)
class LampPosterior:
    """What the signals say of one shot's lamp under one hypothesis.

    Attributes:
        power: (681,) of mean 1.
        modes: (p, 681) its errors, each one standard deviation long; none of them changes its mean.
    """

    power: Floats
    modes: Floats

    @property
    def kelvin(self) -> tuple[float, float]:
        """Correlated colour temperature and its standard deviation, K, in linear propagation.

        So it does not hang on which modes tell the errors, as long as they tell the same ones.
        """
        change = self.modes @ temperature_slope(self.power)
        return float(temperature(self.power)), float(np.sqrt(np.sum(change**2)))


def light_of(evidence: Evidence, basis: Basis) -> list[LampPosterior]:
    """Each shot's lamp: the Gaussian posterior of its modes and of its smooth error, which is asked as modes, too."""
    asked = by_modes(evidence)
    every = asked.lamp_modes
    k, size, _ = every.shape
    mean, spread = posterior(sense(asked, basis))
    mean = mean.reshape(k, size)
    found = []
    for j in range(k):
        values, vectors = np.linalg.eigh(spread[j * size : (j + 1) * size, j * size : (j + 1) * size])
        power = evidence.lamp[j] * np.maximum(1.0 + mean[j] @ every[j], DARKEST)
        level = power.mean()
        modes = (np.sqrt(np.maximum(values, 0.0)) * vectors).T @ every[j] * evidence.lamp[j] / level
        power = power / level
        found.append(LampPosterior(power, modes - modes.mean(axis=1, keepdims=True) * power))  # a scale is nothing
    return found


def by_modes(evidence: Evidence) -> Evidence:
    """The same evidence with the lamps' smooth errors as modes beside their own."""
    smooth = smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T
    every = np.concatenate([evidence.lamp_modes, evidence.lamp_tolerance[:, None, None] * smooth], axis=1)
    return replace(evidence, lamp_modes=every, lamp_tolerance=np.zeros(len(every)))


def posterior(sensing: Sensing) -> tuple[Floats, Floats]:
    """Mean (k q,) and covariance of the lamps' modes: the model's `mode_estimate` and `mode_covariance`.

    With b = A x + D u + e, P = Σ + A Aᵀ and D Dᵀ in Σ: û = Dᵀ P⁻¹ b with covariance I - Dᵀ P⁻¹ D.
    """
    A, b, D = sensing.matrix[0], sensing.target[0], sensing.modes
    root = np.linalg.cholesky(sensing.covariance[0] + A @ A.T)
    white = solve_triangular(root, np.column_stack([D, b]), lower=True)
    D, b = white[:, :-1], white[:, -1]
    return D.T @ b, np.eye(D.shape[1]) - D.T @ D


def _found(
    seen: Sequence[tuple[str, LampPosterior]], share: Floats, likely: Floats, told: Sequence[Weight], j: int
) -> FoundLight:
    """Shot j's light: the mixture of the solved hypotheses' posteriors; probabilities are those of all."""
    power = np.stack([each.power for _, each in seen])
    mean = share @ power
    own = np.stack([np.sum(each.modes**2, axis=0) for _, each in seen])
    kelvin, off = np.array([each.kelvin for _, each in seen]).T
    middle = float(share @ kelvin)
    kinds = dict.fromkeys(BELIEFS, 0.0)
    for weight, probability in zip(told, likely, strict=True):
        kinds[weight.kinds[j]] += float(probability)
    kinds = {kind: min(probability, 1.0) for kind, probability in kinds.items()}  # a sum may round above it
    return FoundLight(
        kinds, mean, np.sqrt(share @ (own + (power - mean) ** 2)),
        middle, float(np.sqrt(share @ (off**2 + (kelvin - middle) ** 2))),
    )  # fmt: skip


def temperature(power: Floats) -> Floats:
    """Correlated colour temperature of powers (..., 681), K: McCamy (Color Res. Appl. 1992, 17, 142).

    T = -449 n³ + 3525 n² - 6823.3 n + 5520.33, n = (x - 0.3320) / (y - 0.1858), of CIE 1931.
    """
    xyz = np.asarray(power) @ observer("1931")
    x, y = np.moveaxis(xyz[..., :2] / xyz.sum(axis=-1, keepdims=True), -1, 0)
    n = (x - 0.3320) / (y - 0.1858)
    return np.asarray(((-449.0 * n + 3525.0) * n - 6823.3) * n + 5520.33)


def temperature_slope(power: Floats) -> Floats:
    """∂T / ∂L of `temperature` at a power (681,), K: dx = (x̄ - x (x̄ + ȳ + z̄)) / (X + Y + Z), and dy alike."""
    functions = observer("1931")  # (681, 3)
    xyz = power @ functions
    x, y = xyz[:2] / xyz.sum()
    dx, dy = ((functions[:, i] - share * functions.sum(axis=1)) / xyz.sum() for i, share in enumerate((x, y)))
    n = (x - 0.3320) / (y - 0.1858)
    return np.asarray(((-1347.0 * n + 7050.0) * n - 6823.3) * (dx - n * dy) / (y - 0.1858))
