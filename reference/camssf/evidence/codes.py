"""Error code → what it means, what brings it about and what to do: data/errors.json beside `errors` and the rules.

`camssf explain CODE` prints it, and docs/errors has a page of each, made by `python -m benchmarks.error_pages`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from camssf.errors import CalibrationError, InvalidArgument
from camssf.rules import PLACEHOLDER, Number, Wording, rules

FORMAT = "camssf-errors/1"


@dataclass(frozen=True)
class Explained:
    """One code of the vocabulary.

    Attributes:
        code: its word.
        kind: the class that is raised.
        exit_status: of the command line.
        means: what is wrong, in a sentence or two.
        causes: what usually brings it about, the likeliest first.
        do: what to do next, in this order.
        see: pages of the documentation.
        reasons: of the verdict that carry this code; none where only stages raise it.
    """

    code: str
    kind: str
    exit_status: int
    means: str
    causes: tuple[str, ...]
    do: tuple[str, ...]
    see: tuple[str, ...]
    reasons: tuple[Wording, ...]


def codes() -> tuple[str, ...]:
    """Every code, in the order of `camssf.errors`."""
    return tuple(kind.code for kind in _leaves())


def explain_code(code: str) -> Explained:
    """What a code means and what to do.

    Raises:
        InvalidArgument: no such code.

    Example:
        >>> from camssf.evidence.codes import explain_code
        >>> explain_code("overexposed").do[0]
        'Expose less: the white at about 80 % of full scale.'
    """
    word = code.strip().casefold().replace("-", "_")
    kind = next((each for each in _leaves() if word in (each.code, each.__name__.casefold())), None)
    if kind is None:
        from difflib import get_close_matches

        near = get_close_matches(word, codes(), n=2)
        raise InvalidArgument(
            f"There is no error code {code!r}.",
            (f"Did you mean {' or '.join(near)}? " if near else "") + f"The codes: {', '.join(codes())}.",
        )
    entry = _table()[kind.code]
    reasons = tuple(each for each in rules().reasons.values() if each.code == kind.code)
    return Explained(
        kind.code, kind.__name__, kind.exit_status, entry["means"], tuple(entry["causes"]), tuple(entry["do"]),
        tuple(entry["see"]), reasons,
    )  # fmt: skip


def as_text(found: Explained) -> str:
    """For a terminal."""
    lines = [f"{found.code} (exit status {found.exit_status}): {found.means}", "", "What usually brings it about:"]
    lines += [f"  - {each}" for each in found.causes]
    lines += ["", "What to do:"]
    lines += [f"  {number}. {each}" for number, each in enumerate(found.do, 1)]
    if found.reasons:
        lines += ["", "What the verdict says with this code:"]
        for reason in found.reasons:
            lines += [f"  - {without_holes(reason.message)}", f"    {without_holes(reason.advice)}"]
            lines += [f"    {limit_in_words(each)}" for each in limits_of(reason)]
    lines += ["", f"More: {', '.join(f'docs/{page}' for page in (f'errors/{found.code}.md', *found.see))}"]
    return "\n".join(lines)


def limits_of(reason: Wording) -> tuple[Number, ...]:
    """The numbers of the rules that decide a reason."""
    return tuple(rules().numbers[f"verdict.{name}"] for name in reason.limits)


def limit_in_words(number: Number) -> str:
    """A bound, as "doubtful above 3 (what it measures, its unit)"."""
    return f"{number.makes} {number.beyond} {number.value:g} ({number.what}, {number.unit})"


def without_holes(template: str) -> str:
    """A message as it is written, its values as dots."""
    return PLACEHOLDER.sub("…", template)


def _leaves() -> list[type[CalibrationError]]:
    """The classes that have no kind of their own below them, as they stand in `camssf.errors`."""
    found: list[type[CalibrationError]] = []

    def walk(kind: type[CalibrationError]) -> None:
        below = [each for each in kind.__subclasses__() if each.__module__ == "camssf.errors"]
        for each in below:
            walk(each)
        if not below:
            found.append(kind)

    walk(CalibrationError)
    return found


@cache
def _table() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((files("camssf") / "data" / "errors.json").read_text("utf-8"))
    return dict(found["codes"])
