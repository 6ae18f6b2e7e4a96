"""messages.json: each key is used, each placeholder has a value, and another language says the same numbers."""

import ast
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camssf import messages as module
from camssf.documents import forms
from camssf.errors import BY_CODE, InvalidArgument, Overexposed
from camssf.messages import PLACEHOLDER, fail, fill, messages
from camssf.photo.signals import normalise
from camssf.rules import rules
from camssf.verdict.reasons import Reason, because, reason_of
from tests.photo.test_patches import CLASSIC, SHOT

ROOT = Path(__file__).parents[2]
FILE = json.loads(module.PLACE.read_text("utf-8"))
KEY = re.compile(rf"(?:{'|'.join(BY_CODE)})\.[a-z_]+")
REASONS = {ground.message.key for ground in rules().reasons.values()}
GERMAN = {
    "overexposed.white": "Aufnahme {shot}: bis zu {share:percent1} der Werte eines Feldes sind übersteuert.",
    "glare.veil": "Aufnahme {shot}: dunkle Felder sind zu hell, Streulicht fügt {amount:percent1} Weiß hinzu.",
}
"""What an app in German holds."""


def placeholders(key: str) -> set[str]:
    return {match[1] for match in PLACEHOLDER.finditer(messages()[key].text + messages()[key].advice)}


def keys_in(node: ast.AST) -> set[str]:
    """The keys that an expression names; `f"{code}.gap"` names that of each code."""
    keys = set()
    for part in ast.walk(node):
        if isinstance(part, ast.Constant) and isinstance(part.value, str) and KEY.fullmatch(part.value):
            keys.add(part.value)
        if isinstance(part, ast.JoinedStr) and ast.unparse(part).startswith("f'{code}."):
            keys |= {key for key in messages() if key.endswith(str(part.values[1].value))}
    return keys


def python_calls() -> Iterator[tuple[str, set[str], set[str] | None]]:
    """Of each call of `fail`: its place, its keys, and the names that it gives; None if they stand elsewhere."""
    for path in sorted((ROOT / "reference").rglob("*.py")):
        tree = ast.parse(path.read_text("utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "fail" and path.name != "messages.py":
                given = {word.arg for word in node.keywords} - {"value", "threshold"}
                yield f"{path.name}:{node.lineno}", keys_in(node.args[0]), None if None in given else given


def kotlin_calls() -> Iterator[tuple[str, set[str], set[str] | None]]:
    """The same of each `Refusal.of`."""
    for path in sorted((ROOT / "android-bindings").glob("*/src/main/kotlin/**/*.kt")):
        text = re.sub(r"(?m)^\s*\*.*$", "", path.read_text("utf-8"))
        for match in re.finditer(r"Refusal\.of\(", text):
            depth, end = 1, match.end()
            while depth:
                depth += {"(": 1, ")": -1}.get(text[end], 0)
                end += 1
            call = text[match.end() : end - 1]
            keys = set(re.findall(rf'"({KEY.pattern})"', call))
            keys |= {key for key in messages() for name in re.findall(r'"\$code(\.\w+)"', call) if key.endswith(name)}
            aside = "*words" in call or re.search(r"^\s*\w+,|, (?:detail|count),", call) is not None
            if keys:
                yield f"{path.name}: {call[:60]}", keys, None if aside else set(re.findall(r'"(\w+)" to ', call))


@pytest.mark.full
def test_each_call_names_a_message_and_gives_its_placeholders_and_each_message_is_used() -> None:
    calls = [*python_calls(), *kotlin_calls()]
    assert len(calls) > 150
    for place, keys, names in calls:
        assert keys, place
        assert keys <= set(messages()), place
        assert names is None or all(placeholders(key) == names for key in keys), place
    assert set(messages()) - REASONS == set().union(*(keys for _, keys, _ in calls))
    templates = "".join(text for entry in FILE["messages"].values() for text in entry.values())
    assert set(FILE["phrases"]) <= {match[1] for match in PLACEHOLDER.finditer(templates)}


@pytest.mark.parametrize("key", sorted(messages()))
def test_each_message_can_be_said(key: str) -> None:
    said = messages()[key]
    assert said.code in BY_CODE
    text, advice = said.say(dict.fromkeys(placeholders(key), 0.5))
    for words in (text, advice):
        assert words == words.strip()
        assert not set("{}") & set(words)
    assert text.endswith(".")
    assert "--" not in text + advice  # apps and notebooks say it, too


def test_an_overexposed_photo_and_a_reason_in_german() -> None:
    bright = replace(SHOT, white=replace(SHOT.white, clipped=np.full((24, 3), 0.25)))
    with pytest.raises(Overexposed) as caught:
        normalise([bright], CLASSIC)
    white = reason_of(caught.value)
    assert "25.0% of a patch's samples" in white.message
    veil = because("veil", 9.0, {"shot": 2, "amount": np.float64(0.0312)})
    assert veil.message.startswith("shot 2: dark patches are too bright.")
    for said, german in (
        (white, "Aufnahme 1: bis zu 25.0% der Werte eines Feldes sind übersteuert."),
        (veil, "Aufnahme 2: dunkle Felder sind zu hell, Streulicht fügt 3.1% Weiß hinzu."),
    ):
        for reason in (said, forms.part_of(Reason, forms.to_plain(said))):  # an app may store the result
            assert fill(GERMAN[reason.key], reason.arguments) == german


def test_arguments_are_texts_and_finite_numbers() -> None:
    error = fail("unsupported_raw.levels", file=Path("a.dng"), black=np.float64("nan"), white=np.int64(1023))
    assert error.arguments == {"file": "a.dng", "black": "nan", "white": 1023}
    assert error.message == "a.dng has black at nan and white at 1023, which is impossible."


def test_placeholders() -> None:
    values = {"a": 0.125, "n": 12, "t": "x", "s_t": 1234567.0}
    said = fill("{a:percent1} {a:percent0} {a:fixed2} {n} {t} {s_t:general6} {s_t:scientific1} {t:fixed1}", values)
    assert said == "12.5% 12% 0.12 12 x 1.23457e+06 1.2e+06 x"
    with pytest.raises(KeyError):
        fill("{b}", values)


@pytest.mark.parametrize("text", [None, "[]", "{}", '{"format": "camssf-messages/2"}', '{"format": 1, "format": 1}'])
def test_a_damaged_file_is_a_typed_error(text: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = tmp_path / "messages.json"
    if text is not None:
        place.write_text(text, "utf-8")
    monkeypatch.setattr(module, "PLACE", place)
    with pytest.raises(InvalidArgument, match="messages of this installation"):
        module.messages.__wrapped__()
