"""What is said of one result adds up in any order: nothing is emptied, and contradictions are refused."""

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from camssf import cli
from tests.support.desk import Desk
from tests.support.documents import document
from tests.support.registries import START, bells, correct, made

pytest.importorskip("duckdb", reason="duckdb is not here")
pytest.importorskip("cryptography", reason="cryptography is not here")

from camssf.errors import InvalidArgument
from camssf.photo.read.unit import Unit
from camssf_fleet.passport.document import PassportRequest, create_passport, sign
from camssf_fleet.passport.keys import PRIVATE, PUBLIC, make_key, read_private
from camssf_fleet.registry import Registry
from camssf_fleet.verification import verify

TIME = "2026-11-20T10:00:00+01:00"


class Clinic:
    """A result in an archive, a copy of it, its passport, and a registry to which they are added."""

    def __init__(self, home: Path) -> None:
        self.home, self.desk = home, Desk(home, "name,photo,lamp,serial,lens,site")
        self.desk.write(["cam,a,D55,A1B2,50mm,lab"], {"a": "Phone"})
        self.desk.run()
        (found,) = (home / "out").glob("*/*/result.json")
        self.result, self.passport = home / "result.json", home / "camera.jws"
        self.result.write_bytes(found.read_bytes())
        (home / "phones").rename(home / "first")
        make_key(home)
        request = PassportRequest(Unit(serial="A1B2", camera_id="2"), TIME)
        self.drawn = create_passport(found.read_bytes(), request)
        self.passport.write_bytes(sign(self.drawn, read_private(home / PRIVATE)))

    def add(self, *words: object) -> int:
        return cli.main(["registry", "add", str(self.home / "phones"), *map(str, words)])

    def row(self) -> dict[str, Any]:
        (found,) = Registry(self.home / "phones").query("SELECT * FROM rows")
        return found


@pytest.fixture
def clinic(tmp_path: Path) -> Clinic:
    return Clinic(tmp_path)


@pytest.mark.full
def test_in_any_order_it_is_the_same(clinic: Clinic) -> None:
    """Each step before and after each other one."""
    key = ("--key", clinic.home / PUBLIC)
    steps: list[Callable[[], Any]] = [
        lambda: clinic.add(clinic.result, "--captured", TIME),
        lambda: clinic.add(clinic.passport, *key),
        lambda: clinic.desk.run().failed,
        lambda: clinic.add(clinic.passport, clinic.result, *key),
    ]
    rows = []
    for number, order in enumerate((steps, steps[::-1], [*steps[1:], steps[0]])):
        for step in order:
            assert step() == 0
        assert clinic.add(clinic.result) == 0
        assert verify(Registry(clinic.home / "phones")).faults == ()
        rows.append(clinic.row())
        (clinic.home / "phones").rename(clinic.home / f"phones {number}")
    row = rows[0]
    assert (row["serial"], row["camera_id"], row["lens"], row["name"]) == ("A1B2", "2", "50mm", "cam")
    assert (row["captured"], row["extra"]) == (datetime(2026, 11, 20, 9, tzinfo=UTC), '{"site": "lab"}')
    assert (row["passport"], row["passport_ends"]) == (clinic.drawn.id, clinic.drawn.ends)
    assert len(row["code_covariance"]) == len(document().answer.code_covariance)
    for other in rows:
        assert other["place"].endswith("result.json")
        assert other | {name: row[name] for name in ("added", "place")} == row


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
