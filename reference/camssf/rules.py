"""Reads data/rules.json: all thresholds, the rival lamps, makers' names, and the limits of the verdict's reasons.

Python and Kotlin read the same file, so that no number is duplicated. docs/verdict.md lists the
thresholds as a table and describes the file's format.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import isfinite
from types import MappingProxyType
from typing import Any

from camssf.errors import InvalidArgument
from camssf.messages import Message, messages
from camssf.strict_json import parse_strict

FORMAT = "camssf-rules/1"
PLACE = files("camssf") / "data" / "rules.json"


@dataclass(frozen=True)
class Number:
    """One number of the rules.

    Attributes:
        name: group and word, for example "verdict.goodness_of_fit".
        value, unit: the number and its unit. Whole numbers are int.
        what, why: what it measures, and why it has this value.
        makes: "doubtful" or "refused" for a bound of the verdict, else None.
        beyond: "above" or "below", the side on which the bound is broken, else None.
        refuses: for a doubtful bound, the name of the bound on the same quantity that refuses; None if there is none.
    """

    name: str
    value: float
    unit: str
    what: str
    why: str
    makes: str | None = None
    beyond: str | None = None
    refuses: str | None = None


@dataclass(frozen=True)
class Ground:
    """A reason of the verdict: what it says, and which numbers decide.

    Attributes:
        name: of the reason, for example "veil".
        message: its texts.
        limits: the numbers of the group "verdict" that decide: the doubtful one, then the refusing one if it exists.
    """

    name: str
    message: Message
    limits: tuple[str, ...]


@dataclass(frozen=True)
class Rules:
    """The whole file.

    Attributes:
        numbers: by group and word, for example "signals.clipped".
        rivals: lamps tried in place of the named one.
        makers: for each basis, beginnings of makers' names that make it more probable, in lower case.
        reasons: by name.
    """

    numbers: Mapping[str, Number]
    rivals: tuple[str, ...]
    makers: Mapping[str, tuple[str, ...]]
    reasons: Mapping[str, Ground]

    def number(self, name: str) -> float:
        """A number by group and word.

        Raises:
            InvalidArgument: the file does not contain it.
        """
        return float(self._found(name).value)

    def whole(self, name: str) -> int:
        """A whole number by group and word.

        Raises:
            InvalidArgument: the file does not contain it, or it is not a whole number.
        """
        value = self._found(name).value
        _need(isinstance(value, int), f"{name} is {value}, which is no whole number")
        return int(value)

    def _found(self, name: str) -> Number:
        _need(name in self.numbers, f"{name} is missing")
        return self.numbers[name]


@cache
def rules() -> Rules:
    """The rules of this installation.

    Raises:
        InvalidArgument: the file is missing or damaged.
    """
    try:
        text = PLACE.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise _damaged(str(error)) from error
    return parse(text)


def parse(text: str) -> Rules:
    """Parse the file's text; unknown and missing keys are errors.

    Raises:
        InvalidArgument: the text is not valid.
    """
    try:
        document = parse_strict(text)
    except ValueError as error:
        raise _damaged(f"it is no strict JSON: {error}") from error
    _keys("the file", document, {"format", "numbers", "rivals", "makers", "reasons"})
    _need(document["format"] == FORMAT, f"it calls itself {document['format']!r} instead of {FORMAT!r}")
    for part in ("numbers", "makers", "reasons"):
        _need(isinstance(document[part], dict), f"{part} is no object")
    numbers: dict[str, Number] = {}
    for group, entries in document["numbers"].items():
        _need(isinstance(entries, dict), f"numbers, {group} is no object")
        numbers |= {f"{group}.{word}": _number(f"{group}.{word}", entry) for word, entry in entries.items()}
    for number in numbers.values():
        _check_graver(number, numbers)
    rivals = document["rivals"]
    _need(_texts(rivals) and len(set(rivals)) == len(rivals), "rivals is no list of different names")
    for basis, names in document["makers"].items():
        _need(_texts(names) and len(set(names)) == len(names), f"makers, {basis} is no list of different names")
    makers = {basis: tuple(names) for basis, names in document["makers"].items()}
    reasons = {name: _ground(name, entry, numbers) for name, entry in document["reasons"].items()}
    return Rules(MappingProxyType(numbers), tuple(rivals), MappingProxyType(makers), MappingProxyType(reasons))


def _number(name: str, entry: Any) -> Number:
    _keys(name, entry, {"value", "unit", "what", "why"}, frozenset({"makes", "beyond", "refuses"}))
    value = entry["value"]
    sound = isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value) and value != 0
    _need(sound, f"{name} is {value!r} instead of a number other than 0")
    _need(_texts([entry[key] for key in ("unit", "what", "why")]), f"{name} has an empty text")
    _need(entry.get("makes") in (None, "doubtful", "refused"), f"{name} makes {entry.get('makes')!r}")
    _need(entry.get("beyond") in (None, "above", "below"), f"{name} decides {entry.get('beyond')!r}")
    _need(("makes" in entry) == ("beyond" in entry), f"{name} has one of makes and beyond")
    decides = (entry.get(key) for key in ("makes", "beyond", "refuses"))
    return Number(name, value, entry["unit"], entry["what"], entry["why"], *decides)


def _check_graver(number: Number, numbers: Mapping[str, Number]) -> None:
    """Check that the refusing bound named by a doubtful bound has the same unit and side."""
    if number.refuses is None:
        return
    graver = numbers.get(f"{number.name.partition('.')[0]}.{number.refuses}")
    said = (number.makes, graver and graver.makes, graver and graver.unit, graver and graver.beyond)
    _need(said == ("doubtful", "refused", number.unit, number.beyond), f"{number.name} refuses by {number.refuses!r}")


def _ground(name: str, entry: Any, numbers: Mapping[str, Number]) -> Ground:
    _keys(name, entry, {"message", "limits"})
    key = entry["message"]
    _need(isinstance(key, str) and key in messages(), f"{name} has the message {key!r}, which messages.json lacks")
    limits = entry["limits"]
    _need(_texts(limits) and len(limits) in (1, 2), f"{name} has the limits {limits!r} instead of one or two names")
    makes = [numbers[f"verdict.{limit}"].makes if f"verdict.{limit}" in numbers else "nothing" for limit in limits]
    _need(makes == ["doubtful", "refused"][: len(makes)], f"{name} has limits that make {makes}")
    return Ground(name, messages()[key], tuple(limits))


def _texts(values: Any) -> bool:
    return isinstance(values, list) and bool(values) and all(isinstance(v, str) and v for v in values)


def _keys(where: str, members: Any, needed: set[str], allowed: frozenset[str] = frozenset()) -> None:
    _need(isinstance(members, dict), f"{where} is no object")
    odd = sorted(set(members) - needed - allowed) + sorted(needed - set(members))
    _need(not odd, f"{where} has unknown or missing keys: {', '.join(odd)}")


def _need(holds: bool, message: str) -> None:
    if not holds:
        raise _damaged(message)


def _damaged(what: str) -> InvalidArgument:
    return InvalidArgument(f"The rules of this installation cannot be read: {what}.", "Install camssf anew.")
