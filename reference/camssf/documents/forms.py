"""Reads and writes documents: frozen dataclasses as strict JSON.

A field's type says what it may hold (`camssf.shapes`). Supported are dataclasses, None, bool, int, float, str,
Literal, tuples, dicts with text keys, arrays, `Any` (foreign JSON as it is), unions of dataclasses that have a
`KIND`, which is their key "kind", unions of one dataclass and one other type, and `Argument`, a text or a number. A
class with its own form has `to_plain`, `from_plain` and `PLAIN`, the form's JSON Schema.
"""

from __future__ import annotations

import hashlib
import json
import re
import struct
from collections.abc import Iterable
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NoReturn, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import PHOTO, kind_of, readable
from camssf.shapes import MOST, Apart, Argument, Bounds, Pattern, Shape, Words
from camssf.strict_json import parse_strict

Part = TypeVar("Part")
Json: TypeAlias = dict[str, Any]

LARGEST = 64 * 2**20
"""Bytes of a document."""
HASH = "sha256"
"""Last key of a document: the hash of its content."""
_GAP = float("nan")
"""A number of a row that is missing."""
_WORDS = {
    float: "must be a number",
    int: "must be a whole number",
    bool: "must be true or false",
    str: "must be a text",
    NoneType: "must be null",
}


class BrokenError(InvalidArgument):
    """A part holds what it must not: `args` are the place inside the part and what is wrong there."""

    def __init__(self, place: str, what: str) -> None:
        super().__init__(f"{place.lstrip('.') or 'the document'} {what}.", "Correct it.")
        self.args = (place, what)


@dataclass(frozen=True)
class _Row:
    """One field of a part: name, type, whether a document must hold it, and its default."""

    name: str
    hint: Any
    required: bool
    default: Any


# Reading


def read(data: bytes, kind: type[Part], name: str, advice: str) -> Part:
    """The document of these bytes.

    Args:
        data: UTF-8.
        kind: its type; its fields `format` and `sha256` are checked before all others.
        name: of its source, for messages.
        advice: what to do if it is another document.

    Raises:
        InvalidArgument: it is no such document; the message names the place of the first fault.
    """
    return from_plain(parse_json(data, name, advice), kind, name, advice)


def from_plain(document: Any, kind: type[Part], name: str, advice: str) -> Part:
    """The document of parsed JSON; else as `read`."""
    try:
        if isinstance(document, dict) and HASH in document and is_dataclass(kind) and HASH in fields_of(kind):
            _check_format(kind, document, "")
            document = _unsealed(document)
        return part_of(kind, document)
    except BrokenError as error:
        where, what = error.args
        where = where.lstrip(".") or "the document"
        raise InvalidArgument(readable(f"{name}: {where} {what}."), advice) from None
    except RecursionError:
        raise InvalidArgument(f"{name} is nested too deep.", advice) from None


def part_of(kind: type[Part], value: Any) -> Part:
    """A part of parsed JSON; raises BrokenError at the first fault."""
    part: Part = _part(kind, value, "")
    return part


def parse_json(data: bytes, name: str, advice: str) -> Any:
    """Parse strict JSON: UTF-8, no NaN or infinity, no key twice in an object.

    Raises:
        InvalidArgument: the data is not such JSON; `name` is its source in the message.
    """
    kind = kind_of(data)
    if kind is not None:
        if data.startswith(PHOTO):
            advice = (
                "Measure it first: `camssf calibrate` makes a result.json of it, `camssf patches` what `solve` takes."
            )
        raise InvalidArgument(f"{name} is {kind}, not JSON.", advice)
    if len(data) > LARGEST:
        raise InvalidArgument(f"{name} is larger than {LARGEST} bytes.", advice)
    try:
        return parse_strict(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InvalidArgument(f"{name} is not valid JSON ({error}).", advice) from error


def _unsealed(document: Json) -> Json:
    """The document without its hash, which must be that of the rest."""
    rest = {key: value for key, value in document.items() if key != HASH}
    _need(
        document[HASH] == content_hash(rest), HASH,
        "is not the hash of the rest: something was changed after it was written. Give the file as it was written, "
        f'or take out "{HASH}" if the change was meant',
    )  # fmt: skip
    return rest


@cache
def fields_of(kind: Any) -> dict[str, _Row]:
    """The fields of a part that a document holds, by name."""
    hints = get_type_hints(kind, include_extras=True)
    return {
        entry.name: _Row(entry.name, hints[entry.name], _is_missing(entry), _default(entry))
        for entry in fields(kind)
        if mark_of(hints[entry.name], Apart) is None
    }


def _is_missing(entry: Field[Any]) -> bool:
    return entry.default is MISSING and entry.default_factory is MISSING


def _default(entry: Field[Any]) -> Any:
    return entry.default_factory() if entry.default_factory is not MISSING else entry.default


def mark_of(hint: Any, kind: type[Part]) -> Part | None:
    """What a field's type is annotated with, of this kind; None without."""
    return next((mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, kind)), None)


def _value(hint: Any, value: Any, place: str) -> Any:
    """A JSON value as its type; raises BrokenError."""
    shape = mark_of(hint, Shape)
    if shape is not None:
        return _array(shape, value, place)
    bounds, pattern, words = mark_of(hint, Bounds), mark_of(hint, Pattern), mark_of(hint, Words)
    if get_origin(hint) is Annotated:
        hint = get_args(hint)[0]
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        if hint == Argument:
            _need(type(value) in inner, place, f"must be a text or a number{_is(value)}")
            return _value(type(value), value, place)
        kinds = [kind for kind in inner if kind is not NoneType]
        if value is None and len(kinds) < len(inner):
            return None
        plain = [kind for kind in kinds if not is_dataclass(kind)]
        if plain and len(kinds) > 1:  # a text, or an object
            kinds = [kind for kind in kinds if is_dataclass(kind) == isinstance(value, dict)]
        return _value(kinds[0], value, place) if len(kinds) == 1 else _union(kinds, value, place)
    if origin is Literal or words is not None:
        options = inner if words is None else words.options
        _need(type(value) is str and value in options, place, f"must be {_options(options)}{_is(value)}")
        return value
    if origin in (tuple, dict):
        return (_tuple if origin is tuple else _dict)(inner, bounds or Bounds(), value, place)
    if hint is Any:
        return value
    if is_dataclass(hint):
        return _part(hint, value, place)
    if hint is float and type(value) is int and abs(value) <= MOST:
        value = float(value)
    _need(type(value) is hint, place, f"{_WORDS[hint]}{_is(value)}")
    if hint is str:
        most = int((bounds or Bounds(0, 4096)).most)
        _need(len(value) <= most, place, f"must have at most {most} characters")
        if pattern is not None:
            _need(re.fullmatch(pattern.expression, value) is not None, place, f"{pattern.words}{_is(value)}")
    elif hint in (int, float):
        least, top = ((bounds or Bounds()).least, (bounds or Bounds()).most)
        _need(least <= value <= top, place, f"must lie between {least:g} and {top:g}{_is(value)}")
    return value


def _tuple(inner: tuple[Any, ...], bounds: Bounds, value: Any, place: str) -> Any:
    _need(type(value) is list, place, f"must be a list{_is(value)}")
    several = inner[-1] is Ellipsis
    if several and not bounds.least <= len(value) <= bounds.most:
        _need(False, place, f"must hold {max(bounds.least, 0):g} to {bounds.most:g} entries, holds {len(value)}")
    kinds = [inner[0]] * len(value) if several else inner
    _need(len(kinds) == len(value), place, f"must hold {len(kinds)} entries, holds {len(value)}")
    return tuple(
        _value(kind, entry, f"{place}[{i}]") for i, (kind, entry) in enumerate(zip(kinds, value, strict=True))
    )


def _dict(inner: tuple[Any, ...], _bounds: Bounds, value: Any, place: str) -> Any:
    _need(type(value) is dict, place, f"must be an object{_is(value)}")
    return {_value(inner[0], key, place): _value(inner[1], entry, f"{place}.{key}") for key, entry in value.items()}


def _union(kinds: list[Any], value: Any, place: str) -> Any:
    _need(type(value) is dict, place, f"must be an object{_is(value)}")
    by_kind = {kind.KIND: kind for kind in kinds}
    word = value.get("kind")
    _need(type(word) is str and word in by_kind, f"{place}.kind", f"must be {_options(by_kind)}{_is(word)}")
    return _part(by_kind[word], {key: entry for key, entry in value.items() if key != "kind"}, place)


def _part(kind: Any, value: Any, place: str) -> Any:
    if hasattr(kind, "from_plain"):
        try:
            return kind.from_plain(value, place.lstrip("."))
        except CalibrationError as error:
            raise BrokenError(place, f"is no such form: {error.message.rstrip('.')}") from None
    _need(type(value) is dict, place, f"must be an object{_is(value)}")
    rows = fields_of(kind)
    _check_format(kind, value, place)
    for key in value:
        _need(key in rows, place, f"has the unknown key {json.dumps(key)[:80]}")
    missing = [row.name for row in rows.values() if row.required and row.name not in value]
    _need(not missing, place, f"lacks {', '.join(missing)}")
    held = {key: _value(rows[key].hint, entry, f"{place}.{key}") for key, entry in value.items()}
    try:
        return kind(**held)
    except BrokenError as error:  # of __post_init__, which compares parts with each other
        where, what = error.args
        raise BrokenError(f"{place}.{where}" if where else place, what) from None
    except CalibrationError as error:
        raise BrokenError(place, f"does not fit together: {error.message.rstrip('.')}") from None


def _check_format(kind: Any, value: Json, place: str) -> None:
    row, word = fields_of(kind).get("format"), value.get("format")
    if row is None or word == (wanted := get_args(row.hint)[0]):
        return
    if isinstance(word, str) and word.startswith("camssf"):
        name, why = word.partition("/")[0], ""
        if name in ("camssf-result", "camssf-patches", "camssf-shot"):
            why = "; that form was never released, so measure or calibrate the photos anew"
        elif name == wanted.partition("/")[0]:
            why = "; another version of camssf wrote it"
        raise BrokenError(place, f"is {readable(word)[:40]}, not {wanted}{why}")
    raise BrokenError(place, f'is not {wanted}: it has no "format": "{wanted}"')


def _array(shape: Shape, value: Any, place: str) -> Any:
    """Nested lists as an array, checked down to each number."""
    if value == [] and shape.fewest == 0:
        return np.zeros((0, *(side or 0 for side in shape.sides[1:])))
    lengths: list[int] = []
    rows = [value]
    for axis, side in enumerate(shape.sides):  # one level of lists after the other, without their places
        sound = all(type(row) is list for row in rows) and len({len(row) for row in rows}) == 1
        if not sound or len(rows[0]) == 0 or (side is not None and len(rows[0]) != side):
            _ragged(shape, value, place)
        lengths.append(len(rows[0]))
        rows = [entry for row in rows for entry in row]
        if shape.gaps and axis == len(shape.sides) - 2:
            gap = [_GAP] * (shape.sides[-1] or 0)
            rows = [gap if row is None else row for row in rows]
    types = set(map(type, rows))
    least, most = shape.least, shape.most
    if not types <= ({int} if shape.whole else {int, float}) or not all(
        least <= number <= most or number is _GAP for number in rows
    ):
        _ragged(shape, value, place)
    return np.array(rows, dtype=np.int64 if shape.whole else np.float64).reshape(lengths)


def _ragged(shape: Shape, value: Any, place: str) -> NoReturn:
    """Raise BrokenError at the first fault of an array."""
    first = list(shape.sides)

    def walk(value: Any, axis: int, place: str) -> None:
        if axis == len(shape.sides):
            word = "a whole number" if shape.whole else "a number"
            sound = type(value) in ((int,) if shape.whole else (int, float))
            bounds = f" from {shape.least:g} to {shape.most:g}"
            _need(sound and shape.least <= value <= shape.most, place, f"must be {word}{bounds}{_is(value)}")
            return
        if value is None and shape.gaps and axis == len(shape.sides) - 1:
            return
        _need(type(value) is list, place, f"must be a list{_is(value)}")
        first[axis] = first[axis] or len(value)
        _need(len(value) > 0, place, "must not be empty")
        _need(len(value) == first[axis], place, f"must hold {first[axis]} entries, holds {len(value)}")
        for i, entry in enumerate(value):
            walk(entry, axis + 1, f"{place}[{i}]")

    walk(value, 0, place)
    raise BrokenError(place, "is damaged")


def _need(right: bool, place: str, what: str) -> None:
    if not right:
        raise BrokenError(place, what)


def _options(words: Iterable[str]) -> str:
    return " or ".join(json.dumps(word) for word in words)


def _is(value: Any) -> str:
    """The faulty value for a message, shortened."""
    if isinstance(value, int) and value.bit_length() > 200:
        return ", is too large"
    if value is None or isinstance(value, bool | int | float | str):
        shown = json.dumps(value, ensure_ascii=False)
        return f", is {shown if len(shown) <= 60 else shown[:60] + '…'}"
    return f", is {'a list' if isinstance(value, list) else 'an object'}"


# Writing


def write(document: Any) -> bytes:
    """A document as bytes: the same content always gives the same bytes. Its last key is the hash of its content."""
    plain = to_plain(document)
    kind: Any = type(document)
    if HASH in fields_of(kind):
        plain = {key: value for key, value in plain.items() if key != HASH}
        plain[HASH] = content_hash(plain)
    return (pretty(plain) + "\n").encode()


def to_plain(value: Any) -> Any:
    """A part as JSON has it: fields in their order, without those that have their default."""
    if is_dataclass(value) and not isinstance(value, type):
        kind = {"kind": value.KIND} if hasattr(value, "KIND") else {}
        if hasattr(value, "to_plain"):
            plain = value.to_plain()
            return kind | plain if kind else plain
        for row in fields_of(type(value)).values():
            plain = _numbers(row.hint, getattr(value, row.name))
            if row.required or plain != to_plain(row.default):
                kind[row.name] = plain
        return kind
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, tuple | list):
        return [to_plain(entry) for entry in value]
    if isinstance(value, dict):
        return {readable(key): to_plain(value[key]) for key in sorted(value)}
    return readable(value) if isinstance(value, str) else value


def _numbers(hint: Any, entry: Any) -> Any:
    """The field's value as JSON has it; a number of a field of floats is a float."""
    if entry is not None and _has_gaps(hint):
        return _with_gaps(entry)
    plain = to_plain(entry)
    return float(plain) if type(plain) is int and _is_float(hint) else plain


@cache
def _has_gaps(hint: Any) -> bool:
    shape = mark_of(hint, Shape)
    return shape.gaps if shape is not None else any(_has_gaps(inner) for inner in get_args(hint))


def _with_gaps(rows: Any) -> Any:
    if rows.ndim == 1:
        return None if np.isnan(rows).any() else rows.tolist()
    return [_with_gaps(row) for row in rows]


@cache
def _is_float(hint: Any) -> bool:
    if get_origin(hint) in (Union, UnionType, Annotated):
        return any(_is_float(inner) for inner in get_args(hint)[: 1 if get_origin(hint) is Annotated else None])
    return hint is float


def pretty(value: Any, margin: str = "\n") -> str:
    """JSON text: one key a line; lists without objects on one line; floats lossless."""
    inner = margin + " "
    if isinstance(value, dict) and value:
        rows = (f"{_dumps(key)}: {pretty(entry, inner)}" for key, entry in value.items())
        return "{" + inner + f",{inner}".join(rows) + margin + "}"
    if isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        return "[" + inner + f",{inner}".join(pretty(entry, inner) for entry in value) + margin + "]"
    return _dumps(value)


def _dumps(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def content_hash(plain: Any) -> str:
    """SHA-256 of JSON values, of whatever spacing, order of keys and spelling of numbers.

    Each value is one letter and its content: `{` its keys sorted by UTF-8, each as a text before its value, `}`; `[`
    its values `]`; `n` and 8 bytes, the number as big-endian float64; `s`, 4 bytes of length and UTF-8; `t`, `f` and
    `0` for true, false and null.
    """
    digest = hashlib.sha256()

    def add(value: Any) -> None:
        if isinstance(value, dict):
            digest.update(b"{")
            for key in sorted(value, key=lambda key: key.encode("utf-8", "surrogatepass")):
                add(key)
                add(value[key])
            digest.update(b"}")
        elif isinstance(value, list):
            digest.update(b"[")
            if value and set(map(type, value)) <= {float}:
                records = np.empty(len(value), dtype=[("letter", "S1"), ("number", ">f8")])
                records["letter"], records["number"] = b"n", np.array(value) + 0.0
                digest.update(records.tobytes())
            else:
                for entry in value:
                    add(entry)
            digest.update(b"]")
        elif isinstance(value, str):
            data = value.encode("utf-8", "surrogatepass")
            digest.update(b"s" + struct.pack(">I", len(data)) + data)
        elif isinstance(value, bool) or value is None:
            digest.update({True: b"t", False: b"f", None: b"0"}[value])
        else:
            digest.update(b"n" + struct.pack(">d", value + 0.0 if abs(value) < 1e300 else 1e300))

    add(plain)
    return digest.hexdigest()
