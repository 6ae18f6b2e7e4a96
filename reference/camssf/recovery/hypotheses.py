"""Recovers the curves by weighing hypotheses: the families of cameras, and the kinds of light that are not named.

Phones, cameras and phones with an RYYB sensor are three families of curves, each with a basis. A hypothesis is a
basis together with a kind of light for each shot whose lamp was not named. The posterior probability of each follows
from its evidence and its prior odds (docs/maths.md, "Which basis" and "Unnamed light"). A basis with odds of at least
CLEAR is used alone. Answers of enough weight are mixed by probability, their bands by the law of total variance.
Where the camera seems to belong to no family, the chart may have faded (`faded_chart`); by the probability of such a
camera the answer is mixed with that of a wider prior (`unfamiliar_camera`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.grid import STEP, Floats
from camssf.recovery.basis import Basis, basis_of, widened
from camssf.recovery.evidence import log_evidences
from camssf.recovery.faded_chart import chart_fading
from camssf.recovery.observation import Observation, surfaces_of
from camssf.recovery.sensitivity import (
    SOLVER_DEFAULTS,
    Hypothesis,
    Problem,
    Proof,
    SolverSettings,
    Ssf,
    half_width_of,
    predict_signals,
    solve_on_basis,
    solve_together,
)
from camssf.recovery.unfamiliar_camera import WIDER, family_test, stranger_probability
from camssf.recovery.unnamed_light import estimated_lamp, lamp_posteriors
from camssf.rules import rules
from camssf.spectra.charts import faded
from camssf.spectra.lights import kind_of

AUTO = "auto"
MAKERS_OF = {"phones": "phones", "cameras": "cameras", "ryyb": "phones"}
"""Who makes cameras of a family: makers of phones or of cameras, as in the rules' `makers`."""
FAMILIES = tuple(MAKERS_OF)
"""The bases that `auto` chooses from, in this order."""
_NUMBER = rules().number
RYYB = _NUMBER("choice.ryyb")
"""Prior odds of an RYYB sensor against another one in a phone."""
MAKER = _NUMBER("choice.maker")
"""Prior odds of phones or cameras if the file names a maker of them."""
CLEAR = _NUMBER("choice.clear")
"""Posterior odds at which a basis is used alone."""
NEGLIGIBLE = _NUMBER("choice.negligible")
"""Smallest weight of a hypothesis that is solved, if all lamps are named."""
SOLVED = _NUMBER("lamp.solved")
"""The same if a light is not named, where hypotheses are many."""
NARROW = _NUMBER("lamp.narrow")
"""Width of a phones' prior for the curves, relative to the learned one, where no light is named."""
UNFAMILIAR = _NUMBER("choice.unfamiliar")
"""Smallest probability of a camera of no family at which the answer of a wider prior is computed."""
SCREENED = _NUMBER("lamp.screened")
"""Smallest probability, by its own shot alone, of a kind that is combined with those of other shots."""


@dataclass(frozen=True)
class LampGuess:
    """A hypothesis on the kinds of light.

    Attributes:
        kinds: of each shot, "" where its lamp was named; empty if all were.
        observation: with the lamps of these kinds.
        belief: ln of its prior probability.
        tabulated: whether the lamp of a shot is that of a table, so that the curves have the learned prior.
    """

    kinds: tuple[str, ...]
    observation: Observation
    belief: float
    tabulated: bool = False


@dataclass(frozen=True)
class UnweighedHypothesis:
    """A hypothesis to be weighed.

    Attributes:
        guess: the kinds of light.
        basis, scale: the basis, and the width of its prior relative to the learned one.
        belief: ln of the prior odds of the basis.
    """

    guess: LampGuess
    basis: str | Basis
    scale: float
    belief: float

    @property
    def name(self) -> str:
        """Name of the basis; of a file, its own without the suffix."""
        return self.basis.name if isinstance(self.basis, Basis) else Path(self.basis).stem

    @property
    def log_prior(self) -> float:
        """ln of its prior odds: of the kinds of light, times those of the basis."""
        return self.guess.belief + self.belief

    @property
    def problem(self) -> Problem:
        """What is solved for its answer: with the learned width where a lamp is that of a table."""
        scale = max(self.scale, 1.0) if self.guess.tabulated else self.scale
        return Problem(self.guess.observation, self.basis, scale)

    @property
    def widened_basis(self) -> Basis:
        """The basis, widened by `scale`."""
        return widened(basis_of(self.basis), self.scale)


@dataclass(frozen=True)
class Space:
    """The hypotheses on a capture: each of the guesses on the light with each basis.

    Attributes:
        guesses: one if all lamps were named.
        bases: basis, width of its prior, and ln of its prior odds, of each.
        of: (n, 681) reflectances whose signals are predicted; None for those of the observation.
        settings: penalties, signs and engine.
    """

    guesses: tuple[LampGuess, ...]
    bases: tuple[tuple[str | Basis, float, float], ...]
    of: Floats | None = None
    settings: SolverSettings = SOLVER_DEFAULTS

    @property
    def hypotheses(self) -> list[UnweighedHypothesis]:
        """All hypotheses, those of one basis after those of another."""
        return [UnweighedHypothesis(guess, *basis) for basis in self.bases for guess in self.guesses]

    def faded(self, amount: float) -> Space:
        """The same with a chart that has faded by `amount`."""
        of = None if self.of is None else faded(self.of, amount)
        guesses = [replace(guess, observation=guess.observation.faded(amount)) for guess in self.guesses]
        return replace(self, guesses=tuple(guesses), of=of)

    def on(self, basis: str, scale: float) -> Space:
        """The hypotheses of one basis, with another width of its prior."""
        return replace(self, bases=tuple((one, scale, belief) for one, _, belief in self.bases if one == basis))

    def log_evidences(self) -> Floats:
        """ln of the marginal likelihood of the signals under each hypothesis, up to a common constant."""
        observations = [guess.observation for guess in self.guesses]
        return np.concatenate(
            [log_evidences(observations, widened(basis_of(basis), scale)) for basis, scale, _ in self.bases]
        )

    def log_weights(self) -> Floats:
        """ln of evidence times prior odds of each hypothesis."""
        return np.asarray(self.log_evidences() + [hypothesis.log_prior for hypothesis in self.hypotheses])

    def solve(self) -> Ssf:
        """The mixture of the hypotheses' answers; the answer itself if there is but one basis and no unnamed light.

        Raises:
            InvalidArgument: as `recover`.
            NotConverged: as `recover`.
        """
        hypotheses = self.hypotheses
        if not hypotheses[0].guess.kinds:  # so few that one call solves all of them faster than it weighs them first
            answers = solve_together([hypothesis.problem for hypothesis in hypotheses], self.settings)
            if len(answers) == 1:
                return mixture(hypotheses, answers, np.ones(1), self.of)
            nats = np.array([answer.log_evidence for answer in answers], float)
            return choose(hypotheses, nats, lambda kept: [answers[i] for i in kept], self.of)

        def solve(kept: Sequence[int]) -> list[Ssf]:
            return _answers([hypotheses[i] for i in kept], self.settings)

        return choose(hypotheses, self.log_evidences(), solve, self.of)

    def recover(self) -> Ssf:
        """Solve, where the chart may have faded and the camera may belong to none of the families.

        Raises:
            InvalidArgument, NotConverged: as `recover`.
        """
        answer, passed = self.solve_and_test()
        space, fading = self, 0.0
        if not passed:
            fading = chart_fading(lambda v: float(np.logaddexp.reduce(self.faded(v).log_weights())), CLEAR)
        if fading:
            space = self.faded(fading)
            answer, _ = space.solve_and_test()
        assert answer.family_test is not None
        share = stranger_probability(answer.family_test)
        if share >= UNFAMILIAR:
            answer = of_two_widths(answer, space.on(answer.basis, WIDER).solve(), share, space)
        return replace(answer, chart_fading=fading)

    def solve_and_test(self) -> tuple[Ssf, bool]:
        """The answer with its `family_test`, and whether it passed; the test is of the prior's learned width."""
        answer = self.solve()
        best = next(one for one in self.hypotheses if (one.name, one.guess.kinds) == (answer.basis, answer.kinds))
        learned, observation = answer, best.guess.observation
        if best.scale != 1.0:
            learned = solve_on_basis(observation, best.basis, settings=self.settings)
        named = [not kind_of(kind) for kind in answer.kinds] or [True] * len(observation.lamp)
        test = family_test(observation, learned, named)
        return replace(answer, family_test=test), test.passed


def recover(
    observation: Observation | Sequence[LampGuess],
    *,
    basis: str | Basis = AUTO,
    prior: Mapping[str, float] | None = None,
    prior_scale: float = 1.0,
    of: ArrayLike | None = None,
    settings: SolverSettings = SOLVER_DEFAULTS,
) -> Ssf:
    """The curves that explain the signals.

    Args:
        observation: the signals, and what is known of chart, white and lamps; or the guesses on unnamed lights.
        basis: "auto" chooses among FAMILIES by their evidence; else a name, a file, or a Basis.
        prior: with "auto", prior odds of phones and cameras; 1 for a missing name.
        prior_scale: with a named basis, the width of its prior relative to the learned one; if no light is named,
            relative to the narrower one that phones then have (docs/maths.md, "Unnamed light").
        of: (n, 681) reflectances whose signals are predicted; None for those of the observation.
        settings: penalties, signs and engine; `SolverSettings()` for the defaults.

    With `basis="gaussian"`, no standard errors and zero tolerances Σ = I.

    Returns:
        If several hypotheses have weight, a mixture. What depends on one basis or one lamp is that of the most
        probable hypothesis: code, its covariance, the scale of the curves, `kinds`.

    Raises:
        InvalidArgument: invalid values or names; an unnamed light on a basis without a prior, which has no evidence.
        NotConverged: a relative duality gap above 1e-9.
    """
    guesses = [LampGuess((), observation, 0.0)] if isinstance(observation, Observation) else observation
    shown = None if of is None else surfaces_of("of", of)
    space = Space(tuple(guesses), _bases(guesses, basis, prior or {}, prior_scale), shown, settings)
    return space.solve() if basis != AUTO else space.recover()


def of_two_widths(answer: Ssf, wider: Ssf, share: float, space: Space) -> Ssf:
    """The answer mixed with that of a wider prior, which has the weight `share`; what is not mixed is the likelier's.

    Curves of peak 1 and their variances are mixed as those of hypotheses are (`mixture`).
    """
    likelier = answer if share <= 0.5 else replace(wider, choice=answer.choice, family_test=answer.family_test)
    mean, std = of_peak_one([answer, wider], np.array([1.0 - share, share]))
    assert std is not None  # every family has a prior
    best = next(one for one in space.guesses if one.kinds == likelier.kinds)
    scale = (best.observation.white_reflectance * best.observation.lamp[0] * STEP) @ mean
    of_basis = likelier.half_width if likelier.half_width_of_basis is None else likelier.half_width_of_basis
    (_, own), between = likelier.peak(), likelier.between
    if between is not None and own is not None:  # a share of the mixture's variance
        between = between * np.sum(own**2, axis=0) / np.sum(std**2, axis=0)
    mixed = replace(
        likelier,
        values=mean / scale,
        std=std / scale,
        proof=largest_gaps([answer, wider]),
        between=between,
        half_width_of_basis=of_basis,
    )
    if likelier.kinds:
        return replace(mixed, predicted=(1.0 - share) * answer.predicted + share * wider.predicted)
    chart = best.observation.reflectance if space.of is None else space.of
    rho = best.observation.white_reflectance
    return replace(mixed, predicted=predict_signals(mixed.values, chart, likelier.lamp, rho))


def likely_kinds(guesses: Sequence[LampGuess], basis: str | Basis, prior: Mapping[str, float]) -> dict[str, float]:
    """The kinds of one shot's light that are combined with those of other shots, with their probabilities."""
    space = Space(tuple(guesses), _bases(guesses, basis, prior))
    share = dict.fromkeys((guess.kinds[0] for guess in guesses), 0.0)
    for hypothesis, probability in zip(space.hypotheses, probabilities(space.log_weights()), strict=True):
        share[hypothesis.guess.kinds[0]] += float(probability)
    return {kind: probability for kind, probability in share.items() if probability >= SCREENED}


def _bases(
    guesses: Sequence[LampGuess], basis: str | Basis, prior: Mapping[str, float], prior_scale: float = 1.0
) -> tuple[tuple[str | Basis, float, float], ...]:
    """`Space.bases` for the arguments of `recover`; a phones' prior is narrower where no light is named.

    Raises:
        InvalidArgument: no guesses; an unnamed light on a basis without a prior.
    """
    if not guesses:
        raise InvalidArgument("There are no guesses on the light.", "Give one for each kind of light.")
    if guesses[0].kinds and basis != AUTO and not basis_of(basis).prior:
        raise InvalidArgument(
            f"The {basis_of(basis).name} basis has no prior, so the light cannot be estimated.",
            "Name the lamp, or choose the basis phones.",
        )
    narrow = {}
    if all(guess.kinds and all(guess.kinds) for guess in guesses):
        narrow = {name: NARROW for name, makers in MAKERS_OF.items() if makers == "phones"}
    if basis == AUTO:
        return tuple((name, narrow.get(name, 1.0), prior_belief(name, prior)) for name in FAMILIES)
    name = basis.name if isinstance(basis, Basis) else basis
    return ((basis, narrow.get(name, 1.0) * prior_scale, 0.0),)


def prior_belief(family: str, odds: Mapping[str, float]) -> float:
    """ln of a family's prior odds; `odds` are those of phones and cameras by the maker's name, 1 if missing."""
    return float(np.log(odds.get(MAKERS_OF[family], 1.0) * (RYYB if family == "ryyb" else 1.0)))


def choose(
    hypotheses: Sequence[UnweighedHypothesis],
    nats: Floats,
    solve: Callable[[Sequence[int]], Sequence[Ssf]],
    of: Floats | None = None,
) -> Ssf:
    """The mixture of the hypotheses' answers by their posterior probabilities.

    Args:
        hypotheses: of one capture.
        nats: ln of the evidence of each.
        solve: gives the answers of some of them, by their numbers.
        of: as in `recover`.
    """
    likely = probabilities(nats + [hypothesis.log_prior for hypothesis in hypotheses])
    weights = posterior_weights([hypothesis.name for hypothesis in hypotheses], likely)
    kinds = hypotheses[0].guess.kinds
    kept = np.flatnonzero(weights >= (min(SOLVED, weights.max()) if kinds else NEGLIGIBLE)).tolist()
    some, share = [hypotheses[i] for i in kept], weights[kept] / weights[kept].sum()
    answer = mixture(some, solve(kept), share, of)
    choice = tuple(
        Hypothesis(one.name, float(size), float(probability), one.guess.kinds)
        for one, size, probability in zip(hypotheses, nats, likely, strict=True)
    )
    if not kinds:
        return replace(answer, choice=choice)
    posteriors = [lamp_posteriors(one.guess.observation, one.widened_basis) for one in some]
    lights = tuple(
        estimated_lamp([of_shots[j] for of_shots in posteriors], share, choice, j) if kind else None
        for j, kind in enumerate(kinds)
    )
    return replace(answer, choice=choice, lights=lights)


def posterior_weights(bases: Sequence[str], likely: Floats) -> Floats:
    """Mixture weights: if the posterior odds of one basis reach CLEAR, the other bases get weight 0."""
    share = {name: float(likely[[basis == name for basis in bases]].sum()) for name in bases}
    winner = max(share, key=lambda name: share[name])
    if share[winner] >= CLEAR * (1.0 - share[winner]):
        likely = np.where([basis == winner for basis in bases], likely, 0.0)
    return np.asarray(likely / likely.sum())


def probabilities(logarithms: Floats) -> Floats:
    """e^l / Σ e^l without overflow."""
    weights = np.exp(logarithms - logarithms.max())
    return np.asarray(weights / weights.sum())


def _answers(hypotheses: Sequence[UnweighedHypothesis], settings: SolverSettings) -> list[Ssf]:
    """The answers of hypotheses; one of a narrowed prior has the bands of the learned one.

    Under an unnamed light a wide prior draws the curves off the family's mean, since the signals determine only the
    product of light and curve; but a camera may be as far from that mean as the learned width says. The code is given
    in units of the learned width: s = μ + w Ψ x = μ + Ψ (w x).
    """
    narrow = [i for i, one in enumerate(hypotheses) if one.scale < 1.0 and not one.guess.tabulated]
    problems = [hypothesis.problem for hypothesis in hypotheses]
    problems += [replace(problems[i], prior_scale=1.0) for i in narrow]
    answers = solve_together(problems, settings)
    for i, wide in zip(narrow, answers[len(hypotheses) :], strict=True):
        answer, band = answers[i], wide.peak()[1]
        assert band is not None  # `_bases` refuses a basis without a prior
        answers[i] = replace(
            answer, code=hypotheses[i].scale * answer.code, std=band * answer.values.max(axis=0),
            code_covariance=wide.code_covariance, prior_scale=1.0,
        )  # fmt: skip
    return answers[: len(hypotheses)]


def mixture(
    hypotheses: Sequence[UnweighedHypothesis], answers: Sequence[Ssf], share: Floats, of: Floats | None = None
) -> Ssf:
    """The answers mixed by `share`, with the largest gaps of all; what depends on a basis is that of the likeliest.

    Curves of peak 1 are mixed, s̄ = Σ w s, and their variance is Σ w (σ² + (s - s̄)²). The scale is that under the
    likeliest hypothesis's first lamp.
    """
    likeliest = int(share.argmax())
    guess, best = hypotheses[likeliest].guess, answers[likeliest]
    rho, chart = guess.observation.white_reflectance, guess.observation.reflectance if of is None else of
    if not guess.kinds and len(answers) == 1:
        return best if of is None else replace(best, predicted=predict_signals(best.values, of, best.lamp, rho))
    lamps = np.stack([answer.lamp for answer in answers])  # (a, k, m)
    if guess.kinds:  # of no common scale
        lamps = lamps / lamps.mean(axis=2, keepdims=True)
    lamp, (mean, std) = np.einsum("a,akm->km", share, lamps), of_peak_one(answers, share)
    scale = (rho * guess.observation.lamp[0] * STEP) @ mean  # (3,)
    mixed = replace(
        best,
        values=mean / scale,
        std=None if std is None else std / scale,
        lamp=lamp,
        gain_code=np.einsum("a,akg->kg", share, np.stack([answer.gain_code for answer in answers])),
        proof=largest_gaps(answers),
    )
    if not guess.kinds:
        return replace(mixed, predicted=predict_signals(mixed.values, chart, lamp, rho))
    # The product of curve and light is more certain than either: take means of products, not products of means.
    signals = np.stack([predict_signals(answer.values, chart, answer.lamp, rho) for answer in answers])
    apart = np.stack([answer.peak()[0] for answer in answers]) - mean
    own = np.array([answer.basis == best.basis for answer in answers])
    _, of_basis = of_peak_one([answer for answer, same in zip(answers, own, strict=True) if same],
                              share[own] / share[own].sum())  # fmt: skip
    assert std is not None  # `_bases` refuses a basis without a prior
    assert of_basis is not None
    return replace(
        mixed,
        predicted=np.einsum("a,aknc->knc", share, signals),
        kinds=guess.kinds,
        between=np.einsum("a,amc->c", share, apart**2) / np.sum(std**2, axis=0),
        half_width_of_basis=half_width_of(of_basis),
    )


def largest_gaps(answers: Sequence[Ssf]) -> Proof:
    """The largest of each gap, and the most steps, of several answers."""
    return Proof(
        gap=np.max([answer.proof.gap for answer in answers], axis=0),
        layers_gap=np.max([answer.proof.layers_gap for answer in answers], axis=0),
        finish_steps=np.max([answer.proof.finish_steps for answer in answers], axis=0),
    )


def of_peak_one(answers: Sequence[Ssf], share: Floats) -> tuple[Floats, Floats | None]:
    """Mean (681, 3) and standard deviation of the curves of peak 1, by the law of total variance."""
    curves = np.stack([answer.peak()[0] for answer in answers])  # (a, m, 3)
    mean = np.einsum("a,amc->mc", share, curves)
    own = [band for answer in answers if (band := answer.peak()[1]) is not None]
    if not own:
        return mean, None
    return mean, np.sqrt(np.einsum("a,amc->mc", share, np.stack(own) ** 2 + (curves - mean) ** 2))
