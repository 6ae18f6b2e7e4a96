"""What is said of one result adds up in any order: nothing is emptied, and contradictions are refused."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest

from tests.support.registries import START, bells, correct, made

pytest.importorskip("duckdb", reason="duckdb is not here")
pytest.importorskip("cryptography", reason="cryptography is not here")

from camssf.errors import InvalidArgument
from camssf_fleet.registry import Registry
from camssf_fleet.verification import verify


def test_what_is_silent_empties_nothing_and_what_contradicts_is_refused(one: Registry) -> None:
    full = made(1, bells(), captured=START, lens="50mm", focal_length=24.0, extra='{"site": "lab"}')
    empty = replace(full, serial="", captured=None, lens="", focal_length=None, extra="", make="", model="", red=())
    (said,) = one.add([empty])
    assert said.new
    (said,) = one.add([full])
    assert said.changes == (
        "make set to Maker", "model set to Model", "serial set to A1", "lens set to 50mm", "focal length set to 24.0",
        "time set to 2026-01-01T00:00:00Z", "site set to lab",
    )  # fmt: skip
    files = one.files.sizes()
    assert [row.changes for row in one.add([empty, full])] == [(), ()]
    assert one.files.sizes() == files
    contradictions: list[tuple[dict[str, Any], str]] = [
        ({"serial": "B2"}, "serial A1 in the registry, B2 given"), ({"model": "Other"}, "model Model in .*, Other"),
        ({"captured": START + timedelta(seconds=1)}, "time 2026-01-01T00:00:00Z in .*, 2026-01-01T00:00:01Z given"),
        ({"focal_length": 35.0}, "focal length 24.0 in .*, 35.0 given"), ({"lens": "35mm"}, "lens 50mm in .*, 35mm"),
        ({"extra": '{"site": "roof"}'}, "site lab in the registry, roof given"),
    ]  # fmt: skip
    others = [replace(full, **more) for more, _ in contradictions]
    for other, (_, words) in zip(others, contradictions, strict=True):
        with pytest.raises(InvalidArgument, match=words):
            one.add([made(2), other])
    assert len(one.listing()) == 1, "all or nothing"
    refused = [each.contradiction != "" for each in one.append([*others, replace(full, name="x")], partly=True)]
    assert refused == [True] * len(others) + [False]
    changed = {name: value for more, _ in contradictions for name, value in more.items()}
    (said,) = correct(one, replace(full, **changed))
    assert len(said.changes) == len(others)
    assert all("changed from" in change for change in said.changes)
    correct(one, full)
    with pytest.raises(InvalidArgument, match="serial A in the registry, B given"):  # within one call
        one.add([made(3, serial="A"), made(3, serial="B")])
    one.add([replace(full, focal_length=24.0 * 1.0001)])  # files round it
    old = replace(full, passport="old", passport_ends=START, half_width=0.09)  # an excerpt, which is rounded
    one.add([replace(full, passport="new", passport_ends=START + timedelta(days=1)), old])
    assert one.query("SELECT passport, half_width FROM rows") == [{"passport": "new", "half_width": full.half_width}]
    one.list_records()  # of `append`
    assert verify(one).faults == ()
