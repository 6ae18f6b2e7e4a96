"""Explains error codes: meaning, causes and what to do, from data/errors.json, messages and rules.

`camssf explain CODE` prints the explanation; the site has a page of each.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from camssf.errors import BY_CODE, InvalidArgument
from camssf.messages import PLACEHOLDER
from camssf.rules import Ground, Number, rules

FORMAT = "camssf-errors/1"


@dataclass(frozen=True)
class Explained:
    """The explanation of one error code.

    Attributes:
        code: the code.
        kind: name of the class that is raised.
        exit_status: of the command line.
        means: what is wrong, in a sentence or two.
        causes: the usual causes, the likeliest first.
        do: what to do next, in this order.
        see: pages of the documentation.
        reasons: reasons of the verdict with this code; empty if only stages raise it.
    """

    code: str
    kind: str
    exit_status: int
    means: str
    causes: tuple[str, ...]
    do: tuple[str, ...]
    see: tuple[str, ...]
    reasons: tuple[Ground, ...]


def codes() -> tuple[str, ...]:
    """Every code, in the order of `camssf.errors`."""
    return tuple(BY_CODE)


def explain_code(code: str) -> Explained:
    """Explain a code, which may also be given as its class name.

    Raises:
        InvalidArgument: no such code.

    Example:
        >>> from camssf.error_codes import explain_code
        >>> explain_code("overexposed").do[0]
        'Expose less: the white at about 80 % of full scale.'
    """
    word = code.strip().casefold().replace("-", "_")
    kind = next((leaf for leaf in BY_CODE.values() if word in (leaf.code, leaf.__name__.casefold())), None)
    if kind is None:
        from difflib import get_close_matches

        near = get_close_matches(word, codes(), n=2)
        raise InvalidArgument(
            f"There is no error code {code!r}.",
            (f"Did you mean {' or '.join(near)}? " if near else "") + f"The codes: {', '.join(codes())}.",
        )
    entry = _table()[kind.code]
    reasons = tuple(reason for reason in rules().reasons.values() if reason.message.code == kind.code)
    return Explained(
        kind.code, kind.__name__, kind.exit_status, entry["means"], tuple(entry["causes"]), tuple(entry["do"]),
        tuple(entry["see"]), reasons,
    )  # fmt: skip


def as_text(explanation: Explained) -> str:
    """The explanation as text for a terminal."""
    lines = [f"{explanation.code} (exit status {explanation.exit_status}): {explanation.means}", "", "Usual causes:"]
    lines += [f"  - {cause}" for cause in explanation.causes]
    lines += ["", "What to do:"]
    lines += [f"  {number}. {step}" for number, step in enumerate(explanation.do, 1)]
    if explanation.reasons:
        lines += ["", "Reasons of the verdict with this code:"]
        for reason in explanation.reasons:
            lines += [f"  - {without_holes(reason.message.text)}", f"    {without_holes(reason.message.advice)}"]
            lines += [f"    {limit_in_words(limit)}" for limit in limits_of(reason)]
    lines += [
        "",
        f"More: {', '.join(f'docs/{page}' for page in (f'errors/{explanation.code}.md', *explanation.see))}",
    ]
    return "\n".join(lines)


def limits_of(reason: Ground) -> tuple[Number, ...]:
    """The numbers of the rules that decide a reason."""
    return tuple(rules().numbers[f"verdict.{name}"] for name in reason.limits)


def limit_in_words(number: Number) -> str:
    """A limit in words, for example "doubtful above 3 (what it measures, its unit)"."""
    return f"{number.makes} {number.beyond} {number.value:g} ({number.what}, {number.unit})"


def without_holes(template: str) -> str:
    """A message template with "…" in place of each value."""
    return PLACEHOLDER.sub("…", template)


@cache
def _table() -> dict[str, Any]:
    table: dict[str, Any] = json.loads((files("camssf") / "data" / "errors.json").read_text("utf-8"))
    return dict(table["codes"])
