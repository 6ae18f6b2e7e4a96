"""Reads data/messages.json: what each refusal and each reason of the verdict says, and what to do next.

Python and Kotlin read the same file. A key is the error code and a name, for example "frames_differ.swapped"; an app
that speaks another language has texts of its own under the same keys, and fills in the same arguments.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import isfinite
from types import MappingProxyType
from typing import TypeAlias

from camssf.errors import BY_CODE, CalibrationError, InvalidArgument
from camssf.strict_json import parse_strict

FORMAT = "camssf-messages/1"
PLACE = files("camssf") / "data" / "messages.json"
PLACEHOLDER = re.compile(r"\{([a-z_]+)(?::(percent|fixed|general|scientific)([0-9]))?\}")
"""`{name}`, `{name:percent1}` (a share as per cent with one decimal), `{name:fixed2}` (two decimals),
`{name:general6}` (six significant digits), `{name:scientific1}` (one decimal and an exponent)."""
_LETTERS = {"percent": "%", "fixed": "f", "general": "g", "scientific": "e"}

Arguments: TypeAlias = Mapping[str, str | int | float]
"""Values of placeholders: texts and finite numbers."""


@dataclass(frozen=True)
class Message:
    """The texts of a refusal or of a reason, with placeholders.

    Attributes:
        key: the error code (`camssf.errors`), a full stop, and a name.
        text: what is wrong.
        advice: what to do next.
    """

    key: str
    text: str
    advice: str

    @property
    def code(self) -> str:
        """The error code."""
        return self.key.partition(".")[0]

    def say(self, arguments: Arguments) -> tuple[str, str]:
        """Text and advice with the placeholders filled in."""
        return fill(self.text, arguments), fill(self.advice, arguments)


def fail(
    key: str, *, value: float | None = None, threshold: float | None = None, **arguments: object
) -> CalibrationError:
    """The error with this message.

    Args:
        key: of the message.
        value, threshold: the number that decided and the bound that it broke; None if there is none.
        arguments: values of the placeholders, as `plain` takes them.

    Raises:
        KeyError: the file has no such message, or a placeholder has no value.

    Example:
        >>> from camssf.messages import fail
        >>> str(fail("unreadable_raw.missing", file="a.dng"))
        'There is no file a.dng. Check the path.'
    """
    said, values = messages()[key], plain(arguments)
    text, advice = said.say(values)
    return BY_CODE[said.code](text, advice, value=value, threshold=threshold, key=key, arguments=values)


def fill(template: str, arguments: Arguments) -> str:
    """Fill in the placeholders of a template.

    Raises:
        KeyError: a placeholder has no value.
    """

    def text(match: re.Match[str]) -> str:
        value, kind, digits = arguments[match[1]], match[2], match[3]
        return str(value) if kind is None or isinstance(value, str) else f"{value:.{digits}{_LETTERS[kind]}}"

    return PLACEHOLDER.sub(text, template)


def plain(arguments: Mapping[str, object]) -> dict[str, str | int | float]:
    """Arguments as JSON can hold them: finite numbers; all else, also NaN and infinity, as text."""
    numbers = {name: value.item() if hasattr(value, "item") else value for name, value in arguments.items()}
    return {
        name: value if isinstance(value, int | float) and isfinite(value) else str(value)
        for name, value in numbers.items()
    }


@cache
def messages() -> Mapping[str, Message]:
    """The messages of this installation by key.

    Raises:
        InvalidArgument: the file is missing or damaged.
    """
    try:
        document = parse_strict(PLACE.read_text("utf-8"))
        if document["format"] != FORMAT:
            raise ValueError(f"it calls itself {document['format']!r} instead of {FORMAT!r}")
        phrases, entries = document["phrases"], document["messages"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        words = f"The messages of this installation cannot be read: {error}."
        raise InvalidArgument(words, "Install camssf anew.") from error

    def whole(template: str) -> str:
        """The template with each shared phrase in place of its name."""
        return PLACEHOLDER.sub(lambda match: phrases.get(match[1], match[0]), template)

    return MappingProxyType(
        {key: Message(key, whole(entry["text"]), whole(entry["advice"])) for key, entry in entries.items()}
    )
