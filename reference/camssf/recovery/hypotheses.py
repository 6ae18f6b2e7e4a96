"""Chooses the basis, or a mixture of bases, by their marginal likelihoods.

Phones, cameras and phones with an RYYB sensor are three families of curves. The posterior probability of each one
follows from its evidence and its prior odds (docs/maths.md, "Which basis"). A basis with odds of at least CLEAR is
used alone; otherwise solutions are mixed by probability, and their bands by the law of total variance. Where the
camera seems to belong to no family, the chart may have faded (`faded_chart`), or the answer has a wider prior
(`unfamiliar_camera`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from camssf.grid import STEP, Floats
from camssf.recovery.basis import Basis, read_basis
from camssf.recovery.faded_chart import chart_fading
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import (
    SOLVER_DEFAULTS,
    FamilyTest,
    Hypothesis,
    Proof,
    SolverSettings,
    Ssf,
    answer,
    predict_signals,
)
from camssf.recovery.solve import log_evidences
from camssf.recovery.unfamiliar_camera import WIDER, family_test
from camssf.rules import rules

AUTO = "auto"
MAKERS_OF = {"phones": "phones", "cameras": "cameras", "ryyb": "phones"}
"""Who makes cameras of a family: makers of phones or of cameras, as in the rules' `makers`."""
FAMILIES = tuple(MAKERS_OF)
"""The bases that `auto` chooses from, in this order."""
RYYB = rules().number("choice.ryyb")
"""Prior odds of an RYYB sensor against another one in a phone."""
MAKER = rules().number("choice.maker")
"""Prior odds of phones or cameras if the file names a maker of them."""
CLEAR = rules().number("choice.clear")
"""Posterior odds at which a basis is used alone."""


def recover(
    observation: Observation,
    *,
    basis: str | Basis = AUTO,
    prior: Mapping[str, float] | None = None,
    prior_scale: float = 1.0,
    settings: SolverSettings = SOLVER_DEFAULTS,
) -> Ssf:
    """The curves that explain the signals.

    Args:
        observation: the signals, and what is known of chart, white and lamps.
        basis: "auto" chooses among FAMILIES by their evidence; else a name, a file, or a Basis.
        prior: with "auto", prior odds of phones and cameras; 1 for a missing name.
        prior_scale: with a named basis, the width of its prior relative to the learned one.
        settings: penalties, signs and engine; `SolverSettings()` for the defaults.

    With `basis="gaussian"`, no standard errors and zero tolerances Σ = I.

    Raises:
        InvalidArgument: invalid values or names.
        NotConverged: a relative duality gap above 1e-9.
    """
    if basis != AUTO:
        return answer(observation, basis, prior_scale=prior_scale, settings=settings)
    beliefs = np.array([prior_belief(name, prior or {}) for name in FAMILIES])

    def chosen(fading: float) -> tuple[Ssf, FamilyTest]:
        given = observation.faded(fading)
        found = choose(given, [answer(given, name, settings=settings) for name in FAMILIES], beliefs)
        return found, family_test(given, found, [True] * len(given.lamp))

    def evidence(fading: float) -> float:
        given = observation.faded(fading)
        nats = np.array([log_evidences([given], read_basis(name))[0] for name in FAMILIES])
        return float(np.logaddexp.reduce(nats + beliefs))

    def wider(name: str, fading: float) -> Ssf:
        return answer(observation.faded(fading), name, prior_scale=WIDER, settings=settings)

    return recover_any_camera(chosen, evidence, wider)


def recover_any_camera(
    chosen: Callable[[float], tuple[Ssf, FamilyTest]],
    log_evidence: Callable[[float], float],
    wider: Callable[[str, float], Ssf],
) -> Ssf:
    """The answer whether or not the camera belongs to a family: with a faded chart or a wider prior if it does not.

    Args:
        chosen: the answer of the learned width and its test, for a chart that has faded by so much.
        log_evidence: as in `chart_fading`.
        wider: the answer of a basis with a prior WIDER times as wide, for such a chart.
    """
    found, test = chosen(0.0)
    fading = 0.0 if test.passed else chart_fading(log_evidence, CLEAR)
    if fading:
        found, test = chosen(fading)
    if not test.passed:
        found = replace(wider(found.settings.basis, fading), choice=found.choice)
    return found.tested(test, fading)


def prior_belief(family: str, odds: Mapping[str, float]) -> float:
    """ln of a family's prior odds; `odds` are those of phones and cameras by the maker's name, 1 if missing."""
    return float(np.log(odds.get(MAKERS_OF[family], 1.0) * (RYYB if family == "ryyb" else 1.0)))


def choose(observation: Observation, answers: Sequence[Ssf], beliefs: Floats) -> Ssf:
    """Combine several solutions for the same signals; `beliefs` are the ln of their prior odds."""
    nats = [np.nan if each.posterior is None else each.posterior.log_evidence for each in answers]
    likely = probabilities(np.array(nats) + beliefs)
    names = [each.settings.basis for each in answers]
    weighed = tuple(
        Hypothesis(name, size, float(share)) for name, size, share in zip(names, nats, likely, strict=True)
    )
    return replace(mixed(observation, answers, posterior_weights(names, likely)), choice=weighed)


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


def mixed(observation: Observation, answers: Sequence[Ssf], weights: Floats) -> Ssf:
    """The mixture of solutions for the same signals; what depends on a basis is that of the most probable one.

    Curves of peak 1 are mixed, s̄ = Σ w s, and their variance is Σ w (σ² + (s - s̄)²).
    """
    kept = [(each, weight) for each, weight in zip(answers, weights, strict=True) if weight > NEGLIGIBLE]
    best = max(kept, key=lambda pair: pair[1])[0]
    if len(kept) == 1:
        return best
    share = np.array([weight for _, weight in kept]) / sum(weight for _, weight in kept)
    answers = [each for each, _ in kept]
    lamp = np.einsum("a,akm->km", share, np.stack([each.light.lamp for each in answers]))
    found = mixture(observation, answers, share, lamp)
    rho = observation.white_reflectance
    return replace(found, predicted=predict_signals(found.values, observation.reflectance, lamp, rho))


def mixture(observation: Observation, answers: Sequence[Ssf], share: Floats, lamp: Floats) -> Ssf:
    """The most probable solution with curves, bands and gains mixed by `share`, and the largest gaps of all.

    Args:
        observation: that of the most probable solution; its first lamp scales the curves.
        answers, share: a solutions and (a,) their weights, which add up to 1.
        lamp: (k, 681) the mixed lamps.
    """
    best = answers[int(share.argmax())]
    mean, std = of_peak_one(answers, share)
    scale = (observation.white_reflectance * observation.lamp[0] * STEP) @ mean  # (3,)
    gains = np.einsum("a,akg->kg", share, np.stack([each.light.gain_code for each in answers]))
    band = None if best.posterior is None or std is None else replace(best.posterior, std=std / scale)
    return replace(
        best,
        values=mean / scale,
        posterior=band,
        light=replace(best.light, lamp=lamp, gain_code=gains),
        proof=Proof(
            gap=np.max([each.proof.gap for each in answers], axis=0),
            layers_gap=np.max([each.proof.layers_gap for each in answers], axis=0),
            finish_steps=np.max([each.proof.finish_steps for each in answers], axis=0),
        ),
    )


def of_peak_one(answers: Sequence[Ssf], share: Floats) -> tuple[Floats, Floats | None]:
    """Mean (681, 3) and standard deviation of the curves of peak 1, by the law of total variance."""
    curves = np.stack([each.peak()[0] for each in answers])  # (a, m, 3)
    mean = np.einsum("a,amc->mc", share, curves)
    own = [band for each in answers if (band := each.peak()[1]) is not None]
    if not own:
        return mean, None
    return mean, np.sqrt(np.einsum("a,amc->mc", share, np.stack(own) ** 2 + (curves - mean) ** 2))


NEGLIGIBLE = 1e-6
"""Solutions of a smaller weight are left out of a mixture."""
