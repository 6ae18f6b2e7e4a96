"""Every number that a verdict compares, with its limits, whether they hold or not."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from camssf.rules import rules


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

    name: str
    shot: int | None
    value: float
    limit: float
    refuses: float | None
    beyond: str


@dataclass
class Checks:
    """Collects the numbers that the rules compare."""

    _seen: dict[tuple[str, int | None], Check] = field(default_factory=dict)

    def note(self, name: str, value: float, shot: int | None = None, *, limit: float | None = None) -> None:
        """Record one number; a later one of the same name and shot replaces it.

        Args:
            name: as in `Check`.
            value: the number; ignored if it is not finite.
            shot: from 0; None for the capture as a whole.
            limit: replaces the rule's own limit.
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
        """In the order in which they were first recorded."""
        return iter(self._seen.values())
