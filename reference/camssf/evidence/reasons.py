"""Rules of data/rules.json → reasons: the words and numbers of a verdict, and the error that a refusal raises."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from camssf import errors
from camssf.errors import CalibrationError
from camssf.evidence.checks import Check
from camssf.rules import rules


@dataclass(frozen=True)
class Reason:
    """Why a result is not simply accepted: the vocabulary of `camssf.errors`, with the number that decided."""

    code: str
    message: str
    advice: str
    value: float | None = None
    threshold: float | None = None


class Fatal(Reason):
    """A reason that leaves no answer: the verdict is refused."""


@dataclass(frozen=True)
class Verdict:
    """What the evidence says.

    Attributes:
        status: "accepted", "doubtful" or "refused".
        reasons: empty only when accepted.
        checks: every number that was looked at, whether it held or not; empty where a stage refused before.
    """

    status: str
    reasons: tuple[Reason, ...]
    checks: tuple[Check, ...] = field(default=(), compare=False)


def because(
    name: str,
    value: float,
    words: Mapping[str, str | float],
    *,
    fatal: bool = False,
    threshold: float | None = None,
) -> Reason:
    """The reason of that name.

    Args:
        name: in data/rules.json.
        value: the number that decided.
        words: for the placeholders.
        fatal: it passed the limit that refuses.
        threshold: the bound it broke, where that is not simply the rule's own limit.
    """
    wording = rules().reasons[name]
    bound = rules().numbers[f"verdict.{wording.limits[-1 if fatal else 0]}"].value if threshold is None else threshold
    message, advice = wording.say(words)
    return (Fatal if fatal else Reason)(wording.code, message, advice, value, bound)


def refusal(verdict: Verdict) -> CalibrationError:
    """The error that a refused verdict raises: its gravest reason's, with all of them on it."""
    reason = next(r for r in verdict.reasons if isinstance(r, Fatal))
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, CalibrationError)]
    kind = next(kind for kind in kinds if kind.code == reason.code)
    error = kind(reason.message, reason.advice, value=reason.value, threshold=reason.threshold)
    error.reasons, error.checks = verdict.reasons, verdict.checks
    return error
