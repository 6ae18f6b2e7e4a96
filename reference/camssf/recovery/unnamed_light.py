"""Recovers the curves and the light of shots whose lamp is not named, by the evidence of each kind of light.

A hypothesis is the kind of light of every unnamed shot, and a basis. The evidence of each is
computed in closed form; those of enough weight are solved, and mixed by the law of total variance (docs/maths.md, "A
light that nobody named").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy.linalg import solve_triangular

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, basis_of, widened
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.recovery.hypotheses import (
    AUTO,
    FAMILIES,
    MAKERS_OF,
    mixture,
    of_peak_one,
    posterior_weights,
    prior_belief,
    probabilities,
    recover_any_camera,
)
from camssf.recovery.linear_model import DARKEST, LinearModel, linear_model
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import (
    SOLVER_DEFAULTS,
    EstimatedLamp,
    FamilyTest,
    Hypothesis,
    SolverSettings,
    Ssf,
    answer,
    half_width_of,
    predict_signals,
)
from camssf.recovery.solve import log_evidences
from camssf.recovery.unfamiliar_camera import WIDER, family_test
from camssf.rules import rules
from camssf.spectra.charts import faded
from camssf.spectra.families import FAMILIES as LAMP_KINDS
from camssf.spectra.surfaces import correlated_temperature, observer

SOLVED = rules().number("lamp.solved")
"""Smallest weight of a hypothesis that is solved."""
NARROW = rules().number("lamp.narrow")
"""Width of a phones' prior for the curves, relative to the learned one, where no light is named."""
NO_KIND = rules().number("lamp.no_kind")
"""Prior probability of a light that is of no kind; any kind may be taken for it."""
SCREENED = rules().number("lamp.screened")
"""Smallest probability, by its own shot alone, of a kind that is combined with those of other shots."""


@dataclass(frozen=True)
class LampGuess:
    """A hypothesis on the kinds of light.

    Attributes:
        kinds: of each shot, "" where its lamp was named.
        observation: with the lamps of these kinds.
        belief: ln of its prior probability.
    """

    kinds: tuple[str, ...]
    observation: Observation
    belief: float

    def faded(self, amount: float) -> LampGuess:
        """The same with a chart that has faded by `amount`."""
        return replace(self, observation=self.observation.faded(amount))


@dataclass(frozen=True)
class LampHypothesis:
    """A hypothesis on kinds of light and basis.

    Attributes:
        guess, basis, scale: kinds of light, basis, and width of its prior relative to the learned one.
        belief: ln of the prior odds of the basis.
    """

    guess: LampGuess
    basis: str | Basis
    scale: float
    belief: float

    @property
    def widened_basis(self) -> Basis:
        """The basis, widened by `scale`."""
        return widened(basis_of(self.basis), self.scale)

    @property
    def log_prior(self) -> float:
        """ln of its prior odds: of the kinds of light, times those of the basis."""
        return self.guess.belief + self.belief

    @property
    def name(self) -> str:
        """Name of the basis."""
        return self.basis.name if isinstance(self.basis, Basis) else self.basis


def recover_in_any_light(
    guesses: Sequence[LampGuess],
    *,
    basis: str | Basis = AUTO,
    prior: Mapping[str, float] | None = None,
    prior_scale: float = 1.0,
    of: Floats | None = None,
    settings: SolverSettings = SOLVER_DEFAULTS,
) -> Ssf:
    """The curves that explain the signals under lights that are not named.

    Args:
        guesses: the possible kinds of the lights.
        basis, prior, prior_scale: as in `recover`.
        of: (n, 681) reflectances whose signals are predicted; None for those of the observation.
        settings: as in `recover`.

    Returns:
        A mixture. What depends on one basis or one lamp is that of the most probable hypothesis: codes, their
        covariance, the scale of the curves, `kinds`.

    Raises:
        InvalidArgument: as `recover`; also for a basis without a prior, which has no evidence.
        NotConverged: as `recover`.
    """
    if basis != AUTO:
        return _recover(_hypotheses(guesses, basis, prior, prior_scale), of, settings)

    def hypotheses(fading: float) -> list[LampHypothesis]:
        return _hypotheses([guess.faded(fading) for guess in guesses], AUTO, prior)

    def solved(given: Sequence[LampHypothesis], fading: float) -> Ssf:
        return _recover(given, None if of is None else faded(of, fading), settings)

    def chosen(fading: float) -> tuple[Ssf, FamilyTest]:
        found = solved(hypotheses(fading), fading)
        best = next(guess.faded(fading) for guess in guesses if guess.kinds == found.light.kinds)
        learned = answer(best.observation, found.settings.basis, settings=settings)
        return found, family_test(best.observation, learned, [not kind for kind in best.kinds])

    def evidence(fading: float) -> float:
        given = hypotheses(fading)
        return float(np.logaddexp.reduce(_evidences(given) + [each.log_prior for each in given]))

    def wider(name: str, fading: float) -> Ssf:
        return solved([replace(each, scale=WIDER) for each in hypotheses(fading) if each.basis == name], fading)

    return recover_any_camera(chosen, evidence, wider)


def likely_kinds(guesses: Sequence[LampGuess], basis: str | Basis, prior: Mapping[str, float]) -> list[str]:
    """The kinds of one shot's light that are probable enough to be combined with those of other shots."""
    hypotheses = _hypotheses(guesses, basis, prior)
    likely = probabilities(_evidences(hypotheses) + [each.log_prior for each in hypotheses])
    share = dict.fromkeys((guess.kinds[0] for guess in guesses), 0.0)
    for each, probability in zip(hypotheses, likely, strict=True):
        share[each.guess.kinds[0]] += float(probability)
    return [kind for kind, probability in share.items() if probability >= SCREENED]


def _hypotheses(
    guesses: Sequence[LampGuess], basis: str | Basis, prior: Mapping[str, float] | None, prior_scale: float = 1.0
) -> list[LampHypothesis]:
    """The guesses with every basis; a phones' prior is narrower where no light is named."""
    names = FAMILIES if basis == AUTO else (basis,)
    unnamed = all(kind for guess in guesses for kind in guess.kinds)
    found = []
    for each in names:
        name = each.name if isinstance(each, Basis) else each
        scale = NARROW if unnamed and MAKERS_OF.get(name) == "phones" else 1.0
        belief = prior_belief(name, prior or {}) if basis == AUTO else 0.0
        found += [LampHypothesis(guess, each, scale * prior_scale, belief) for guess in guesses]
    return found


def _evidences(hypotheses: Sequence[LampHypothesis]) -> Floats:
    """ln of the marginal likelihood of the signals under each hypothesis, up to a common constant.

    `_hypotheses` lists the guesses of one basis after those of another; each basis is weighed in one go.
    """
    by_basis = (list(own) for _, own in groupby(hypotheses, key=lambda each: (each.name, each.scale)))
    return np.concatenate(
        [log_evidences([each.guess.observation for each in own], own[0].widened_basis) for own in by_basis]
    )


def _answer(hypothesis: LampHypothesis, settings: SolverSettings) -> Ssf:
    """The answer of a hypothesis; one of a narrowed prior has the bands of the learned one.

    Under an unnamed light a wide prior draws the curves off the family's mean, since the signals determine only the
    product of light and curve; but a camera may be as far from that mean as the learned width says. The code is given
    in units of the learned width: s = μ + w Ψ x = μ + Ψ (w x).
    """
    observation = hypothesis.guess.observation
    found = answer(observation, hypothesis.basis, prior_scale=hypothesis.scale, settings=settings)
    if hypothesis.scale >= 1.0:
        return found
    wide = answer(observation, hypothesis.basis, settings=settings)
    band = wide.peak()[1]
    assert wide.posterior is not None  # `_recover` refuses a basis without a prior
    assert found.posterior is not None
    assert band is not None
    posterior = replace(
        wide.posterior, std=band * found.values.max(axis=0), log_evidence=found.posterior.log_evidence
    )
    return replace(found, code=hypothesis.scale * found.code, posterior=posterior, settings=wide.settings)


def _recover(hypotheses: Sequence[LampHypothesis], of: Floats | None, settings: SolverSettings) -> Ssf:
    """Weigh the hypotheses, solve those of enough weight, and mix them."""
    without = next((each.widened_basis for each in hypotheses if not each.widened_basis.prior), None)
    if without is not None:
        raise InvalidArgument(
            f"The {without.name} basis has no prior, so the light cannot be estimated.",
            "Name the lamp, or choose the basis phones.",
        )
    nats = _evidences(hypotheses)
    likely = probabilities(nats + [each.log_prior for each in hypotheses])
    weighed = tuple(
        Hypothesis(each.name, float(size), float(share), each.guess.kinds)
        for each, size, share in zip(hypotheses, nats, likely, strict=True)
    )
    weights = posterior_weights([each.name for each in hypotheses], likely)
    kept = [int(i) for i in np.flatnonzero(weights >= min(SOLVED, weights.max()))]
    share = weights[kept] / weights[kept].sum()
    answers = [_answer(hypotheses[i], settings) for i in kept]
    seen = [light_of(each.guess.observation, each.widened_basis) for each in (hypotheses[i] for i in kept)]
    lights = tuple(
        _found([(hypotheses[i].guess.kinds[j], seen[a][j]) for a, i in enumerate(kept)], share, likely, weighed, j)
        if kind
        else None
        for j, kind in enumerate(hypotheses[0].guess.kinds)
    )
    best = hypotheses[kept[int(share.argmax())]].guess
    chart = best.observation.reflectance if of is None else of
    # The product of curve and light is more certain than either: take means of products, not products of means.
    rho = best.observation.white_reflectance
    predicted = np.einsum(
        "a,aknc->knc",
        share,
        np.stack([predict_signals(each.values, chart, each.light.lamp, rho) for each in answers]),
    )
    found = _mixed(answers, share, best.observation)
    own = np.array([each.settings.basis == found.settings.basis for each in answers])
    std = of_peak_one([each for each, same in zip(answers, own, strict=True) if same], share[own] / share[own].sum())[
        1
    ]
    assert std is not None  # every basis has a prior
    light = replace(found.light, lights=lights, kinds=best.kinds, half_width_of_basis=half_width_of(std))
    return replace(found, predicted=predicted, light=light, choice=weighed)


def _mixed(answers: Sequence[Ssf], share: Floats, observation: Observation) -> Ssf:
    """The mixture of solutions under different lamps; `observation` is that of the most probable one."""
    lamps = np.stack([each.light.lamp / each.light.lamp.mean(axis=1, keepdims=True) for each in answers])  # (a, k, m)
    found = mixture(observation, answers, share, np.einsum("a,akm->km", share, lamps))
    curves = np.stack([each.peak()[0] for each in answers])
    mean, std = of_peak_one(answers, share)
    assert std is not None  # every basis has a prior
    apart = np.einsum("a,amc->c", share, (curves - mean) ** 2)
    return replace(found, light=replace(found.light, between=apart / np.sum(std**2, axis=0)))


# The light itself


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


def light_of(observation: Observation, basis: Basis) -> list[LampPosterior]:
    """Gaussian posterior of each shot's lamp, from its modes and its smooth error, expressed as modes too."""
    with_modes = by_modes(observation)
    every = with_modes.lamp_modes
    k, size, _ = every.shape
    mean, spread = posterior(linear_model(with_modes, basis))
    mean = mean.reshape(k, size)
    found = []
    for j in range(k):
        values, vectors = np.linalg.eigh(spread[j * size : (j + 1) * size, j * size : (j + 1) * size])
        power = observation.lamp[j] * np.maximum(1.0 + mean[j] @ every[j], DARKEST)
        level = power.mean()
        modes = (np.sqrt(np.maximum(values, 0.0)) * vectors).T @ every[j] * observation.lamp[j] / level
        power = power / level
        found.append(LampPosterior(power, modes - modes.mean(axis=1, keepdims=True) * power))  # not its scale
    return found


def by_modes(observation: Observation) -> Observation:
    """The observation with the lamps' smooth errors expressed as additional lamp modes."""
    smooth = smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T
    every = np.concatenate([observation.lamp_modes, observation.lamp_tolerance[:, None, None] * smooth], axis=1)
    return replace(observation, lamp_modes=every, lamp_tolerance=np.zeros(len(every)))


def posterior(linear: LinearModel) -> tuple[Floats, Floats]:
    """Posterior mean (k q,) and covariance of the lamp modes: the model's `mode_estimate` and `mode_covariance`.

    With b = A x + D u + e, P = Σ + A Aᵀ and D Dᵀ in Σ: û = Dᵀ P⁻¹ b with covariance I - Dᵀ P⁻¹ D.
    """
    A, b, D = linear.matrix[0], linear.target[0], linear.modes
    root = np.linalg.cholesky(linear.covariance[0] + A @ A.T)
    white = solve_triangular(root, np.column_stack([D, b]), lower=True)
    D, b = white[:, :-1], white[:, -1]
    return D.T @ b, np.eye(D.shape[1]) - D.T @ D


def _found(
    posteriors: Sequence[tuple[str, LampPosterior]],
    share: Floats,
    likely: Floats,
    weights: Sequence[Hypothesis],
    j: int,
) -> EstimatedLamp:
    """Shot j's light: the mixture of the solved hypotheses' posteriors; `kinds` sums over all hypotheses."""
    power = np.stack([each.power for _, each in posteriors])
    mean = share @ power
    own = np.stack([np.sum(each.modes**2, axis=0) for _, each in posteriors])
    kelvin, off = np.array([each.kelvin for _, each in posteriors]).T
    middle = float(share @ kelvin)
    kinds = dict.fromkeys(LAMP_KINDS, 0.0)
    for weight, probability in zip(weights, likely, strict=True):
        kinds[weight.kinds[j]] += float(probability)
    kinds = {kind: (1.0 - NO_KIND) * min(share, 1.0) + NO_KIND / len(kinds) for kind, share in kinds.items()}
    return EstimatedLamp(
        kinds, mean, np.sqrt(share @ (own + (power - mean) ** 2)),
        middle, float(np.sqrt(share @ (off**2 + (kelvin - middle) ** 2))),
    )  # fmt: skip


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
