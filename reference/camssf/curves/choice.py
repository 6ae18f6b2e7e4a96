"""Evidence → the basis that answers: phones, cameras, or a mixture of both, by their marginal likelihood.

Phones and cameras are two families. Which one a camera belongs to, and whether it lies as near to it as those that
the basis was learned from, is weighed by the evidence of each hypothesis (docs/maths.md, "Which basis"). A clear
winner answers alone; else the answers are mixed by their probabilities, and their bands by the law of total variance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camssf.curves.basis import Basis
from camssf.curves.evidence import Evidence
from camssf.curves.ssf import Ssf, Weight, answer, respond
from camssf.grid import STEP, Floats
from camssf.rules import rules

AUTO = "auto"
FAMILIES = ("phones", "cameras")
"""The bases that `auto` chooses from, in this order."""
SCALES = (1.0, rules().number("choice.wide"))
"""How much wider a camera may lie than those that its basis was learned from."""
UNUSUAL = rules().number("choice.unusual")
"""What is believed of the second scale beforehand."""
CLEAR = rules().number("choice.clear")
"""Odds at which a basis answers alone."""


def recover(
    evidence: Evidence,
    *,
    basis: str | Basis = AUTO,
    l2: float | None = None,
    gamma: ArrayLike | None = None,
    nonnegative: bool | None = None,
    engine: str = "onnx",
    prior: Mapping[str, float] | None = None,
    prior_scale: float = 1.0,
) -> Ssf:
    """The curves that explain the signals.

    Args:
        evidence: the signals, and what is known of chart, white and lamps.
        basis: "auto" lets the evidence choose among FAMILIES; else a name, a file, or a Basis.
        l2, gamma: the penalties λ₂ and γ. On a basis with a prior, whose channels are one problem, γ is one number,
            and they default to 1 and 0.05. On the paper's γ may be one a channel, and they default to 0 and to the
            discrepancy principle: the largest γ whose residual is not above the measured noise,
            rᵀ Σ⁻¹ r ≤ Σ se² / Σ_ii (the ε form, the paper's Eq. (9)), but at least 1e-5 of the γ that leaves nothing.
        nonnegative: x ≥ 0; None asks for it on a basis without a mean. False gives the paper's literal Eq. (10).
        engine: "onnx", the shipped model, or "reference". A basis without a shipped model takes the reference;
            the answer says which it was.
        prior: with "auto", the odds of each of FAMILIES beforehand; equal where nothing is said.
        prior_scale: with a named basis, how much wider its prior is taken.

    With `basis="gaussian"`, no standard errors and zero tolerances Σ = I.

    Raises:
        InvalidArgument: values or names that do not fit.
        NotConverged: a relative duality gap above 1e-9.
    """
    how: dict[str, Any] = {"l2": l2, "gamma": gamma, "nonnegative": nonnegative, "engine": engine}
    if basis != AUTO:
        return answer(evidence, basis, prior_scale=prior_scale, **how)
    asked = hypotheses(prior or {})
    answers = [answer(evidence, name, prior_scale=scale, **how) for name, scale, _ in asked]
    return choose(evidence, answers, np.array([belief for _, _, belief in asked]))


def hypotheses(odds: Mapping[str, float]) -> list[tuple[str, float, float]]:
    """What "auto" weighs: family, how wide its prior is taken, and ln of what is believed of both beforehand."""
    return [
        (name, scale, float(np.log(odds.get(name, 1.0) * belief)))
        for name in FAMILIES
        for scale, belief in zip(SCALES, (1.0 - UNUSUAL, UNUSUAL), strict=True)
    ]


def choose(evidence: Evidence, answers: Sequence[Ssf], beliefs: Floats) -> Ssf:
    """One answer of several to the same signals, each with ln of what was believed of it beforehand."""
    likely = probabilities(np.array([each.log_evidence for each in answers], float) + beliefs)
    told = tuple(
        Weight(each.basis, each.prior_scale, float(each.log_evidence or 0.0), float(share))
        for each, share in zip(answers, likely, strict=True)
    )
    return replace(mixed(evidence, answers, answering([each.basis for each in answers], likely)), choice=told)


def answering(bases: Sequence[str], likely: Floats) -> Floats:
    """The weights that answer: a basis that is CLEAR times as probable as all others answers alone."""
    share = {name: float(likely[[basis == name for basis in bases]].sum()) for name in bases}
    winner = max(share, key=lambda name: share[name])
    if share[winner] >= CLEAR * (1.0 - share[winner]):
        likely = np.where([basis == winner for basis in bases], likely, 0.0)
    return np.asarray(likely / likely.sum())


def probabilities(logarithms: Floats) -> Floats:
    """e^l / Σ e^l without overflow."""
    weights = np.exp(logarithms - logarithms.max())
    return np.asarray(weights / weights.sum())


def mixed(evidence: Evidence, answers: Sequence[Ssf], weights: Floats) -> Ssf:
    """The mixture of answers to the same signals; all that belongs to a basis is the likeliest answer's.

    Curves of peak 1 are mixed, s̄ = Σ w s, and their variance is Σ w (σ² + (s - s̄)²).
    """
    kept = [(each, weight) for each, weight in zip(answers, weights, strict=True) if weight > NEGLIGIBLE]
    best = max(kept, key=lambda pair: pair[1])[0]
    if len(kept) == 1:
        return best
    share = np.array([weight for _, weight in kept]) / sum(weight for _, weight in kept)
    mean, std = of_peak_one([each for each, _ in kept], share)
    lamp = np.einsum("a,akm->km", share, np.stack([each.lamp for each, _ in kept]))
    scale = (evidence.white_reflectance * evidence.lamp[0] * STEP) @ mean  # (3,)
    values = mean / scale
    return replace(
        best,
        values=values,
        std=None if std is None else std / scale,
        predicted=respond(values, evidence.reflectance, lamp, evidence.white_reflectance),
        gap=np.max([each.gap for each, _ in kept], axis=0),
        layers_gap=np.max([each.layers_gap for each, _ in kept], axis=0),
        finish_steps=np.max([each.finish_steps for each, _ in kept], axis=0),
        lamp=lamp,
        gain_code=np.einsum("a,akg->kg", share, np.stack([each.gain_code for each, _ in kept])),
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
"""An answer of a smaller weight moves no curve."""
