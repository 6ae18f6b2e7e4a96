"""Broken documents are refused with the place of the fault, in Python as in Kotlin; Kotlin's table is current."""

import copy
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.calibration import attempt
from camssf.documents import forms
from camssf.documents.document import Document, document_bytes
from camssf.errors import InvalidArgument
from camssf.options import Options
from camssf.photo.shot import Shot
from tools import formats

ROOT = Path(__file__).parents[2]
CASES = json.loads((Path(__file__).parent / "broken_documents.json").read_text("utf-8"))
OURS = [
    {"name": name, "set": put, "to": to, "place": place, "says": says} for name, put, to, place, says in (
        ("a key of two lines and too long", "answer.x\n" + "y" * 200, 1, "answer",
         'has the unknown key "x\\n' + "y" * 76 + "."),
        ("half a step", "answer.proof.finish_steps[0]", 1.5, "answer.proof.finish_steps[0]",
         "must be a whole number from 0 to 1e+12"),
        ("an answer that was refused", "verdict.status", "refused", "answer", "is there, but the verdict is refused"),
        ("a shot that was not finished", "capture.unfinished", {"lamp": {"kind": "unnamed", "name": "auto"}},
         "capture", "must hold all its shots unless"),
        ("a dark lamp", "capture.shots[0].lamp.values", [0.0] * 681, "capture.shots[0].lamp.values",
         "must not be 0 at all wavelengths"),
        ("a black white patch", "capture.chart.reflectance", [[0.0] * 36] * 24,
         "capture.chart.reflectance", "must be above 0 for the white patch"),
        ("a number for the format", "format", 2, "the document", 'is not camssf/2: it has no "format": "camssf/2"'),
    )
]  # fmt: skip
"""Python's alone, whose numbers and messages have limits of their own."""
CORNERS = np.array([[22.44, 17.44], [156.56, 22.44], [162.56, 116.56], [16.44, 109.56]])


@pytest.fixture(scope="module")
def base() -> dict[str, Any]:
    """A result; Kotlin's test makes its own of the same photo."""
    photo = ROOT / "golden/dng/chart-turned-0.dng"
    result = attempt([Shot(photo, "E", corners=CORNERS)], options=Options(basis="phones"))
    return dict(json.loads(document_bytes(result)))


def at(document: Any, path: str) -> tuple[Any, Any]:
    """The container and the key of a place, as a.b[2]."""
    *way, last = [int(key) if key.isdigit() else key for key in re.findall(r"[^.\[\]]+", path)]
    for key in way:
        document = document[key]
    return document, last


def value(document: Any, path: str) -> Any:
    holder, key = at(document, path)
    return holder[key]


def broken(base: dict[str, Any], case: dict[str, Any]) -> str:
    """The text of a broken document. broken_documents.json says what is changed:

    set a place to a value (of another place: "@place", or half of it: "@place/2") or to raw text, drop it, or cut the
    last entry of its list; "sealed" keeps the hash; "whole" is the whole text.
    """
    if "whole" in case:
        return str(case["whole"])
    document = copy.deepcopy(base)
    if "sealed" not in case:
        del document["sha256"]
    if "drop" in case:
        holder, key = at(document, case["drop"])
        del holder[key]
    elif "cut" in case:
        value(document, case["cut"]).pop()
    else:
        holder, key = at(document, case["set"])
        new = case.get("to", "@RAW@")
        if isinstance(new, str) and new.startswith("@") and new != "@RAW@":
            path, _, half = new[1:].partition("/")
            new = [number / 2 for number in value(document, path)] if half else value(document, path)
        holder[key] = new
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":"))
    return text.replace('"@RAW@"', case.get("raw", "") * case.get("times", 1))


@pytest.mark.parametrize("case", CASES + OURS, ids=[case["name"] for case in CASES + OURS])
def test_a_broken_document_is_refused_with_its_place(base: dict[str, Any], case: dict[str, Any]) -> None:
    with pytest.raises(InvalidArgument) as refused:
        forms.read(broken(base, case).encode(), Document, "it", "Give another.")
    assert str(refused.value.message).startswith(f"it: {case['place']} " if case["place"] else "it is not valid JSON")
    assert case.get("says", "") in refused.value.message, refused.value.message
    assert len(refused.value.message) < 400
    assert refused.value.advice


def test_the_base_is_sound_with_and_without_its_hash(base: dict[str, Any]) -> None:
    for document in (base, {key: value for key, value in base.items() if key != "sha256"}):
        forms.read(json.dumps(document).encode(), Document, "it", "Give another.")


def test_kotlins_table_of_forms_is_current() -> None:
    assert formats.FORMS.read_text("utf-8") == formats.kotlin_table(), "run python -m tools.formats"
