"""What a verdict consists of: the numbers that were compared, and its reasons."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated

from camssf.errors import BY_CODE, CalibrationError
from camssf.messages import plain
from camssf.rules import rules
from camssf.shapes import Argument, Number, Text, Whole, Words


@dataclass(frozen=True)
class Check:
    """One number of a verdict and its limits.

    Attributes:
        name: of the limit in data/rules.json, group "verdict".
        shot: from 1; None for the capture as a whole.
        value: the measured number.
        limit: beyond it the verdict is not accepted.
        refuses: beyond it the verdict is refused; None if this number never refuses.
        beyond: "above" or "below", the side on which the limit is broken.
    """

    name: Text
    shot: Whole | None
    value: Number
    limit: Number
    refuses: Number | None
    beyond: Annotated[str, Words(("above", "below"))]


@dataclass
class Checks:
    """Collects the numbers that the rules compare."""

    _seen: dict[tuple[str, int | None], Check] = field(default_factory=dict)

    def note(
        self,
        name: str,
        value: float,
        shot: int | None = None,
        *,
        limit: float | None = None,
        refuses: float | None = None,
    ) -> None:
        """Record one number; a later one of the same name and shot replaces it.

        Args:
            name: as in `Check`.
            value: the number; ignored if it is not finite.
            shot: from 0; None for the capture as a whole.
            limit, refuses: replace the rule's own limits.
        """
        if not math.isfinite(value):
            return
        numbers = rules().numbers
        rule = numbers[f"verdict.{name}"]
        at = None if shot is None else shot + 1
        own = rule.value if limit is None else limit
        if refuses is None and rule.refuses is not None:
            refuses = numbers[f"verdict.{rule.refuses}"].value
        elif refuses is None and rule.makes == "refused":
            refuses = own
        self._seen[name, at] = Check(name, at, float(value), own, refuses, rule.beyond or "above")

    def __iter__(self) -> Iterator[Check]:
        """In the order in which they were first recorded."""
        return iter(self._seen.values())


@dataclass(frozen=True)
class Reason:
    """Why a verdict is not accepted.

    Attributes:
        code: of `camssf.errors`.
        message: what is wrong.
        advice: what to do next.
        value, threshold: the number that decided and the bound that it broke; missing if there is none.
        key: of the message in camssf's messages.json, by which an app finds its own text; missing if there is none.
        arguments: values of the message's placeholders, texts and numbers.
    """

    code: Text
    message: Text
    advice: Text
    value: Number | None = None
    threshold: Number | None = None
    key: Text = ""
    arguments: dict[Text, Argument] = field(default_factory=dict, hash=False)


def reason_of(error: CalibrationError) -> Reason:
    """The reason that an error gives."""
    return Reason(
        error.code, error.message, error.advice, error.value, error.threshold, error.key, error.arguments
    )  # fmt: skip


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

    status: Annotated[str, Words(("accepted", "doubtful", "refused"))]
    reasons: tuple[Reason, ...] = ()
    checks: tuple[Check, ...] = field(default=(), compare=False)


def because(
    name: str,
    value: float | None,
    arguments: Mapping[str, object],
    *,
    fatal: bool = False,
    threshold: float | None = None,
) -> Reason:
    """Create the reason of that name.

    Args:
        name: in data/rules.json.
        value: the number that decided; None if none did alone.
        arguments: values of the placeholders, as `camssf.messages.plain` takes them.
        fatal: whether the number passed the limit that refuses.
        threshold: the bound that was broken, if it is not the rule's own limit.
    """
    ground, values = rules().reasons[name], plain(arguments)
    if threshold is None and value is not None:
        threshold = rules().numbers[f"verdict.{ground.limits[-1 if fatal else 0]}"].value
    said = ground.message
    return (Fatal if fatal else Reason)(said.code, *said.say(values), value, threshold, said.key, values)


def refusal(verdict: Verdict) -> CalibrationError:
    """The error that a refused verdict raises: that of its first fatal reason, with all reasons attached."""
    reason = next(r for r in verdict.reasons if isinstance(r, Fatal))
    error = BY_CODE[reason.code](
        reason.message, reason.advice, value=reason.value, threshold=reason.threshold, key=reason.key,
        arguments=reason.arguments,
    )  # fmt: skip
    error.reasons, error.checks = verdict.reasons, verdict.checks
    return error
