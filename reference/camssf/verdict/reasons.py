"""The reasons of a verdict, worded by data/rules.json, and the error that a refused verdict raises."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from camssf import errors
from camssf.errors import CalibrationError
from camssf.rules import rules
from camssf.verdict.checks import Check


@dataclass(frozen=True)
class Reason:
    """Why a verdict is not accepted: a code of `camssf.errors`, with the number that decided and its threshold."""

    code: str
    message: str
    advice: str
    value: float | None = None
    threshold: float | None = None


class Fatal(Reason):
    """A reason that makes the verdict refused."""


@dataclass(frozen=True)
class Verdict:
    """The judgement of an answer.

    Attributes:
        status: "accepted", "doubtful" or "refused".
        reasons: empty only when accepted.
        checks: every number that was compared, whether its limit holds or not; empty if an earlier stage refused.
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
    """Create the reason of that name.

    Args:
        name: in data/rules.json.
        value: the number that decided.
        words: values of the placeholders.
        fatal: whether the number passed the limit that refuses.
        threshold: the bound that was broken, if it is not the rule's own limit.
    """
    wording = rules().reasons[name]
    bound = rules().numbers[f"verdict.{wording.limits[-1 if fatal else 0]}"].value if threshold is None else threshold
    message, advice = wording.say(words)
    return (Fatal if fatal else Reason)(wording.code, message, advice, value, bound)


def refusal(verdict: Verdict) -> CalibrationError:
    """The error that a refused verdict raises: that of its first fatal reason, with all reasons attached."""
    reason = next(r for r in verdict.reasons if isinstance(r, Fatal))
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, CalibrationError)]
    kind = next(kind for kind in kinds if kind.code == reason.code)
    error = kind(reason.message, reason.advice, value=reason.value, threshold=reason.threshold)
    error.reasons, error.checks = verdict.reasons, verdict.checks
    return error
