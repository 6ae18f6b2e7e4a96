"""The `choice` of an answer in words: which basis was used, its posterior odds, and why."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from camssf.documents.document import Answer
from camssf.fit.solutions import Uncertainty
from camssf.recovery.hypotheses import CLEAR, MAKERS_OF
from camssf.recovery.sensitivity import Hypothesis

OTHERS = {"phones": "cameras", "cameras": "phones"}
"""The other makers of MAKERS_OF."""
LARGEST = 1e6
"""Larger odds are not distinguished."""


@dataclass(frozen=True)
class Chosen:
    """The basis that the evidence (marginal likelihood) chose.

    Attributes:
        basis: the most probable one.
        odds: its posterior odds against all other bases together; infinite if they have probability 0.
        prior_odds: prior odds of its makers' cameras (phones or cameras) against the others', from the maker named in
            the file; None if they cannot be recovered.
        words: all of this in sentences.
    """

    basis: str
    odds: float
    prior_odds: float | None
    words: tuple[str, ...]


def choice_of(answer: Answer | None) -> Chosen | None:
    """The choice; None if the basis was given, or there is no answer."""
    if answer is None:
        return None
    weighed = answer.choice
    total = math.fsum(hypothesis.probability for hypothesis in weighed)
    if not total > 0:
        return None
    shares: dict[str, float] = {}
    for hypothesis in weighed:
        shares[hypothesis.basis] = shares.get(hypothesis.basis, 0.0) + hypothesis.probability
    basis = max(shares, key=lambda name: shares[name])
    rest = math.fsum(share for name, share in shares.items() if name != basis)
    odds = shares[basis] / rest if rest > 0 else math.inf
    others = " and ".join(name for name in shares if name != basis)
    prior_odds = _prior_odds(weighed, MAKERS_OF[basis]) if basis in MAKERS_OF else None
    return Chosen(basis, odds, prior_odds, tuple(_words(basis, others, odds, prior_odds, answer.prior_scale)))


def band_in_words(uncertainty: Uncertainty) -> str:
    """The band's mean half-width, 400 to 700 nm, and that without a photo if the result has it."""
    width = f"± {uncertainty.half_width:.3f} of the peak on average, 400 to 700 nm"
    without = uncertainty.half_width_without_photo
    return width if without is None else f"{width}; of a typical camera, without a photo, ± {without:.3f}"


def odds_in_words(odds: float) -> str:
    """Odds as text, for example 240 : 1."""
    if odds > LARGEST:
        return "more than a million : 1"
    if CLEAR - 0.5 <= odds < CLEAR * (1 - 1e-9):
        return f"{math.floor(10 * odds) / 10:.1f} : 1"  # not rounded up to CLEAR
    return f"{odds:.1f} : 1" if odds < 10 else f"{odds:,.0f} : 1"


def _prior_odds(weighed: Sequence[Hypothesis], makers: str) -> float | None:
    """Prior odds of phones against cameras, or the reverse: posterior odds divided by the Bayes factor."""
    own, other = (
        max((entry for entry in weighed if entry.basis == name), key=lambda entry: entry.probability, default=None)
        for name in (makers, OTHERS[makers])
    )
    if own is None or other is None or not (own.probability > 0 and other.probability > 0):
        return None
    # The prior odds of lights cancel only between hypotheses of the same light.
    alike = (entry for entry in weighed if (entry.basis, entry.kinds) == (other.basis, own.kinds))
    other = next(alike, None)
    if other is None or not other.probability > 0:
        return None
    exponent = math.log(own.probability / other.probability) - (own.log_evidence - other.log_evidence)
    return math.exp(exponent) if abs(exponent) < math.log(LARGEST) else None


def _words(basis: str, others: str, odds: float, prior_odds: float | None, scale: float) -> list[str]:
    words = []
    if others:
        family = f"Sensor family: {basis} ({odds_in_words(odds)} against {others})."
        words.append(
            f"{family} This basis is used alone."
            if odds >= CLEAR
            else f"{family} Below {CLEAR:g} : 1 the curves of these bases are averaged with their probabilities, and "
            "the band includes their difference."
        )
        if prior_odds is not None and abs(math.log(prior_odds)) > 0.01:
            own = MAKERS_OF[basis]
            likely, prior = (own, prior_odds) if prior_odds > 1 else (OTHERS[own], 1 / prior_odds)
            words.append(f"These odds include the maker's name in the file: {odds_in_words(prior)} for {likely}.")
    if scale > 1.0:
        words.append(
            f"The camera is unlike those that this basis was learned from, so most of the answer is that of a prior "
            f"{scale:g} times as wide, and the error bands are wider."
        )
    return words
