"""rules.json: read strictly, and shown in the docs as it is."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from camssf import rules as module
from camssf.errors import InvalidArgument
from camssf.photo import samples, signals
from camssf.rules import parse, rules
from camssf.verdict import judge
from tools import mutate_rules, site_pages

Json = dict[str, Any]
TEXT = mutate_rules.PLACE.read_text("utf-8")
DOCUMENT = json.loads(TEXT)


def test_the_stages_read_the_file() -> None:
    assert judge.GOODNESS_OF_FIT == rules().number("verdict.goodness_of_fit") == 3.5
    assert signals.FEWEST == rules().whole("signals.fewest") == 6
    assert samples.SHRINK == DOCUMENT["numbers"]["patches"]["shrink"]["value"] == 0.5
    assert rules().number("covariance.absolute") == 1 / 3


def limit(document: Json, name: str = "goodness_of_fit") -> Json:
    return document["numbers"]["verdict"][name]


BREAKS: dict[str, tuple[Callable[[Json], object], str]] = {
    "another format": (lambda d: d.update(format="camssf-rules/2"), "camssf-rules/2"),
    "unknown key": (lambda d: d.update(kinds=[]), "kinds"), "missing key": (lambda d: d.pop("rivals"), "rivals"),
    "no value": (lambda d: limit(d).pop("value"), "verdict.goodness_of_fit.*value"),
    "a text for a number": (lambda d: limit(d).update(value="3.5"), "verdict.goodness_of_fit"),
    "no reason why": (lambda d: limit(d).update(why=""), "empty text"),
    "makes a fuss": (lambda d: limit(d).update(makes="fuss"), "fuss"),
    "one side": (lambda d: limit(d).pop("beyond"), "makes and beyond"),
    "refuses by nothing": (lambda d: limit(d, "veil").update(refuses="mist"), "verdict.veil.*mist"),
    "refuses from above": (lambda d: limit(d, "unnamed").update(refuses="veil_refuses"), "unnamed.*veil_refuses"),
    "a rival twice": (lambda d: d["rivals"].append("FL2"), "rivals"),
    "unknown message": (lambda d: d["reasons"]["veil"].update(message="glare.mist"), "glare.mist"),
    "unknown limit": (lambda d: d["reasons"]["veil"].update(limits=["fears"]), "limits"),
    "limits exchanged": (lambda d: d["reasons"]["veil"]["limits"].reverse(), "limits"),
}  # fmt: skip


@pytest.mark.parametrize("name", BREAKS)
def test_a_damaged_file_is_refused(name: str) -> None:
    document = json.loads(TEXT)
    change, said = BREAKS[name]
    change(document)
    with pytest.raises(InvalidArgument, match=said) as caught:
        parse(json.dumps(document))
    assert caught.value.advice == "Install camssf anew."


def test_a_missing_file_is_a_typed_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PLACE", tmp_path / "rules.json")
    rules.cache_clear()
    try:
        with pytest.raises(InvalidArgument, match="rules of this installation"):
            rules()
    finally:
        rules.cache_clear()


def test_the_site_s_table_has_every_limit_of_the_file() -> None:
    table = site_pages.limits()
    assert "| above 3.5 σ | `goodness_of_fit` |" in table
    assert "| above 0.1, refused above 0.25 share of white | `veil`, `veil_refuses` |" in table
    names = {number.name.partition(".")[2] for number in rules().numbers.values() if number.makes}
    cells = [row.split(" | ")[-1] for row in table.splitlines()[2:]]
    assert sorted(names) == sorted(re.findall(r"`(\w+)`", "".join(cells)))
