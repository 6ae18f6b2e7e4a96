"""What a verdict looked at, kept and broken alike: each number beside its limits."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from camssf.rules import rules


@dataclass(frozen=True)
class Check:
    """One number of a verdict, and the limits that it was held against.

    Attributes:
        name: of the limit in data/rules.json, group "verdict".
        shot: from 1; None where it is of the capture as a whole.
        value: what was found.
        limit: beyond it the verdict is not accepted.
        refuses: beyond it there is no answer; None where it never refuses.
        beyond: "above" or "below", the side on which it breaks.
    """

    name: str
    shot: int | None
    value: float
    limit: float
    refuses: float | None
    beyond: str


@dataclass
class Checks:
    """Told of every number as a rule weighs it."""

    _seen: dict[tuple[str, int | None], Check] = field(default_factory=dict)

    def note(self, name: str, value: float, shot: int | None = None, *, limit: float | None = None) -> None:
        """One number; `shot` from 0.

        Args:
            name: as in `Check`.
            value: the number; what is no number was not looked at.
            shot: whose; None for the capture as a whole.
            limit: the limit, where it is not simply the rule's own.
        """
        if not math.isfinite(value):
            return
        numbers = rules().numbers
        rule = numbers[f"verdict.{name}"]
        at = None if shot is None else shot + 1
        own = rule.value if limit is None else limit
        refuses = own if rule.makes == "refused" else None
        if rule.refuses is not None:
            refuses = numbers[f"verdict.{rule.refuses}"].value
        self._seen[name, at] = Check(name, at, float(value), own, refuses, rule.beyond or "above")

    def __iter__(self) -> Iterator[Check]:
        """In the order in which they were first told."""
        return iter(self._seen.values())
