"""The registry: every acknowledged row once, whoever writes, dies, gathers or reads; and what is compared is true."""

import csv
import hashlib
import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf import cli
from camssf.documents.document import document_bytes
from camssf.documents.forms import from_plain, to_plain
from camssf.documents.schema import schema
from camssf.errors import InvalidArgument
from camssf.photo.read.unit import Unit
from tests.support.documents import document, refused
from tests.support.processes import SEARCH
from tests.support.registries import START, bells, made, plain

pytest.importorskip("duckdb", reason="duckdb is not here")

from camssf.files import ASIDE
from camssf.grid import CHANNELS
from camssf_fleet import compare, record_files
from camssf_fleet.documents import (
    DeletionDocument,
    DriftDocument,
    SpreadDocument,
    VerificationDocument,
)
from camssf_fleet.drift import FALSE_ALARMS, FEATURES, drift_of, drifts, features
from camssf_fleet.record_files import RecordFiles
from camssf_fleet.record_queries import all_records, connection
from camssf_fleet.records import COLUMNS, STRIDE, JobEnd, Origin, Row, columns, row
from camssf_fleet.registry import Deleted, Registry, Wanted, _plain
from camssf_fleet.verification import verify

WRITER = (sys.executable, "-m", "tests.support.registries")


@pytest.fixture
def one(tmp_path: Path) -> Registry:
    return Registry(tmp_path / "phones", new=True)


def keys(each: Registry) -> list[str]:
    return [str(found["key"]) for found in each.query("SELECT key FROM rows ORDER BY key")]


# One row a result


def test_a_result_s_row_comes_back_as_it_was(one: Registry) -> None:
    data = document_bytes(document("D55", "A"))
    unit = Unit(camera_id="2", serial="A1", lens="24 mm", focal_length=24.7, aperture=1.8)
    origin = Origin(unit, "2026-11-20T10:00:00+01:00", "cam", "m" * 64, "p" * 32, "x/result.json", {"site": "Ω '\";"})
    mine = row(data, document("D55", "A"), origin)
    one.add([mine])
    (found,) = one.query("SELECT * FROM rows")
    for name in columns(Row):
        value = getattr(mine, name)
        if name in CHANNELS or name.endswith("_std"):
            answer = document("D55", "A").answer
            given = getattr(answer.std if "_" in name else answer.curves, name.partition("_")[0])
            assert found[name] == pytest.approx(given[::STRIDE], rel=1e-6)
        elif name == "code_covariance":
            assert found[name] == pytest.approx(document("D55", "A").answer.code_covariance, rel=1e-6)
        else:
            assert found[name] == (list(value) if isinstance(value, tuple) else value), name
    assert found["captured"] == datetime(2026, 11, 20, 9, tzinfo=UTC)
    assert json.loads(found["extra"]) == {"site": "Ω '\";"}
    assert found["lamps"] == ["D55", "A"]
    assert sorted(found["inputs"]) == sorted(document("D55", "A").capture.hashes.values())


def test_no_name_of_a_photo_is_kept(one: Registry, tmp_path: Path) -> None:
    """A file's name may tell the place and the hour; the row has its hash."""
    one.add([row(document_bytes(document()), document(), Origin())])
    photo = document().capture.photos[0].name
    assert photo
    (found,) = one.query("SELECT * FROM rows")
    assert photo not in str({name: value for name, value in found.items() if name != "reason"})


def test_a_refused_result_has_a_row_without_curves(one: Registry) -> None:
    one.add([row(document_bytes(refused()), refused(), Origin())])
    (found,) = one.query("SELECT status, red, blue_std, gap, captured FROM rows")
    assert found == {"status": "refused", "red": [], "blue_std": [], "gap": None, "captured": None}


def test_the_same_result_twice_is_there_once_and_a_correction_counts(one: Registry) -> None:
    one.add([made(1), made(2)])
    files = one.files.sizes()
    one.add([made(2, added=START + timedelta(days=9)), made(1)])
    assert one.files.sizes() == files, "nothing new, no file"
    Registry(one.folder, correct=True).add(
        [made(1, serial="B2", added=START - timedelta(days=1500)), made(3), made(3, serial="C3")]
    )
    for _ in range(2):
        assert len(keys(one)) == 3
        assert [found["key"][-1] for found in one.listing(Wanted(Unit(serial="B2")))] == ["1"]
        assert [found["key"][-1] for found in one.listing(Wanted(Unit(serial="C3")))] == ["3"]
        assert {found["status"] for found in one.listing()} == {"accepted"}
        one.files.compact()
        assert len(one.files.sizes()) == 1


def test_a_unit_has_one_name_however_it_is_spelt(one: Registry) -> None:
    data = document_bytes(document())
    for serial in (" A\u0301 ", "\u00c1", "A\u0301"):
        one.add([row(data, document(), Origin(Unit(serial=serial)))])
        assert one.query("SELECT serial FROM rows") == [{"serial": "\u00c1"}]
        assert len(one.listing(Wanted(Unit(serial=serial)))) == 1


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.parametrize("name", ["serial=5", "kind=x", "site=Lyon", "a[b]*? 'c"])
def test_a_folder_may_have_any_name(tmp_path: Path, name: str) -> None:
    """`name=value` is a column for other readers of Parquet."""
    one = Registry(tmp_path / name / "phones", new=True)
    one.add([made(1, serial="A6")])
    one.add([made(2, serial="A7")])
    for _ in range(2):
        assert one.query("SELECT serial FROM rows ORDER BY key") == [{"serial": "A6"}, {"serial": "A7"}]
        assert verify(one).faults == ()
        one.files.compact()


def test_a_camera_may_be_named_otherwise_or_strangely(one: Registry) -> None:
    """A passport may name the camera otherwise than the photo did."""
    strange = "É =/%'?*"
    for number, (model, expected) in enumerate((("", ""), (strange, strange), ("", strange), ("Model", "Model"))):
        Registry(one.folder, new=True, correct=True).add(
            [made(1, model=model, make=""), made(2, model="Model", lens=str(number))]
        )
        found = one.query("SELECT make, model, serial FROM rows WHERE key LIKE '%1'")
        assert found == [{"make": "", "model": expected, "serial": "A1"}], model
        (again,) = one.query("SELECT lens FROM rows WHERE key LIKE '%2' AND make = 'Maker' AND model = 'Model'")
        assert again["lens"] == str(number)
    assert len(keys(one)) == 2
    assert verify(one).faults == ()


def files_of(each: Registry) -> list[tuple[str, str]]:
    """Each file with each kind of record that it holds."""
    return each.files.ask(lambda con: con.execute("SELECT DISTINCT filename, kind FROM stored").fetchall())


def ended(name: str, key: str = "", **more: Any) -> JobEnd:
    return JobEnd(f"t{name}", f"j{name}", "", START, name, "failed", "", "", key, **more)


def test_nothing_of_nothing(one: Registry) -> None:
    one.add([])
    one.append([])
    one.list_records()
    assert not one.folder.exists()
    one.files.compact()
    with pytest.raises(InvalidArgument, match="There is no folder"):
        Registry(one.folder)
    one.append([], [ended("name")])
    assert Registry(one.folder).listing() == []
    assert one.query("SELECT name, deaths FROM jobs") == [{"name": "name", "deaths": 0}]
    one.append([], [ended("name")])
    assert len(one.files.sizes()) == 1, "nothing new, no file"


def test_lists(one: Registry) -> None:
    one.add(
        [
            made(1, model="One"), made(2, model="Two", status="doubtful"), made(3, model="Two", status="refused"),
            made(4, model="Two' OR '1'='1", serial="", make="Other"),
        ]
    )  # fmt: skip
    assert [found["key"][-1] for found in one.listing()] == ["4", "3", "2", "1"]
    for wanted, expected in (
        (Wanted(Unit(model="Two")), "32"), (Wanted(Unit(make="Other")), "4"), (Wanted(Unit(serial="A1")), "321"),
        (Wanted(Unit(model="Two"), statuses=("accepted",)), ""), (Wanted(statuses=("refused", "doubtful")), "32"),
        (Wanted(Unit(model="Two' OR '1'='1")), "4"),
    ):  # fmt: skip
        assert "".join(found["key"][-1] for found in one.listing(wanted)) == expected


# What may go wrong


@pytest.mark.requirement("R-REGISTRY")
def test_a_writer_that_was_killed_leaves_it_readable(one: Registry) -> None:
    """A file that is half written is hidden; records without a list are named until the next writer lists them."""
    one.add([made(1)])
    (one.folder / f"{ASIDE}80").mkdir()
    (one.folder / f"{ASIDE}80" / "half").write_bytes(b"PAR1")
    one.append([made(2)], [ended("c")])
    assert len(keys(Registry(one.folder))) == 2
    (fault,) = verify(one).faults
    assert fault.startswith("2 records in no list: their writer was stopped or still writes, or the list is lost (")
    one.add([made(3)])
    assert verify(one).faults == ()
    one.files.compact()
    assert (len(keys(Registry(one.folder))), verify(one).faults) == (3, ())


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.parametrize("last", range(12))
def test_a_compaction_may_be_killed_anywhere(one: Registry, last: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """After the step number `last`: a file written or taken away."""
    for number in range(4):
        one.append([made(number, serial=str(number))], [ended(str(number))])
        one.list_records()
    before, steps = one.query("SELECT * FROM rows ORDER BY key"), iter(range(last))
    for name in ("_write", "_remove"):
        real = getattr(RecordFiles, name)

        def step(self: RecordFiles, *values: Any, real: Any = real) -> Any:
            if next(steps, None) is None:
                raise KeyboardInterrupt
            return real(self, *values)

        monkeypatch.setattr(RecordFiles, name, step)
    with suppress(KeyboardInterrupt):
        one.files.compact()
    monkeypatch.undo()
    assert one.query("SELECT * FROM rows ORDER BY key") == before
    assert verify(one).faults == ()
    assert len(one.query("SELECT DISTINCT task FROM jobs")) == 4
    one.files.compact()
    assert (one.query("SELECT * FROM rows ORDER BY key"), verify(one).faults) == (before, ())


def test_compactions_at_once_lose_nothing(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process compacts before each step of this one."""
    for number in range(6):
        one.add([made(number)])
    real = RecordFiles._remove

    def late(self: RecordFiles, path: str) -> None:
        monkeypatch.setattr(RecordFiles, "_remove", real)
        other = Registry(one.folder)
        other.add([made(10 + len(one.files.sizes()))])
        other.files.compact()
        real(self, path)
        monkeypatch.setattr(RecordFiles, "_remove", late)

    monkeypatch.setattr(RecordFiles, "_remove", late)
    one.files.compact()
    monkeypatch.undo()
    assert len(keys(one)) > 6
    assert len(keys(one)) == len(set(keys(one)))
    assert verify(one).faults == ()


@pytest.mark.requirement("R-REGISTRY")
def test_a_compaction_leaves_damaged_and_strange_files_alone(one: Registry, tmp_path: Path) -> None:
    """It would give them a right name, and take the evidence away."""
    for number in range(4):
        one.add([made(number, serial=f"S{number}")])
    (file,) = [Path(name) for name, kind in files_of(one) if kind == "result" and "S2" in str(content(one, name))]
    whole = file.read_bytes()
    changed = tmp_path / "changed"
    with connection() as con:
        con.execute(f"COPY (SELECT * REPLACE ('WRONG' AS serial) FROM '{file}') TO '{changed}' (FORMAT parquet)")
    file.write_bytes(changed.read_bytes())
    one.files.compact()
    assert file.read_bytes() == changed.read_bytes()
    assert any(f"{file} differs from its name" in fault for fault in verify(one).faults)
    with pytest.raises(InvalidArgument, match="differs from its name"):
        one.delete(Unit(serial="WRONG"))
    file.write_bytes(whole)
    assert one.query("SELECT serial FROM rows WHERE key LIKE '%2'") == [{"serial": "S2"}]
    assert not [fault for fault in verify(one).faults if "still in a file" not in fault and "is missing" not in fault]


def content(one: Registry, file: str) -> list[Any]:
    sql = "SELECT serial FROM stored WHERE filename = ?"
    return one.files.ask(lambda con: con.execute(sql, [file]).fetchall())  # type: ignore[no-any-return]


@pytest.mark.parametrize("columns_", ["'x' AS foo", "* REPLACE ('x' AS revision)", "* REPLACE ([record] AS record)"])
def test_a_file_of_another_program_with_a_right_name_is_named(one: Registry, tmp_path: Path, columns_: str) -> None:
    one.add([made(1)])
    file = Path(next(name for name, kind in files_of(one) if kind == "result"))
    strange = tmp_path / "strange"
    with connection() as con:
        con.execute(f"COPY (SELECT {columns_} FROM '{file}') TO '{strange}' (FORMAT parquet)")
    name = f"{hashlib.sha256(strange.read_bytes()).hexdigest()}.parquet"
    strange.rename(one.folder / name)
    (fault,) = verify(one).faults
    assert fault.startswith(f"{one.folder / name} is no file of a registry (its columns ")


def flipped(data: bytes, start: int, count: int = 400) -> bytes:
    return data[:start] + bytes(byte ^ 0x5A for byte in data[start : start + count]) + data[start + count :]


def test_a_damaged_file_is_named(one: Registry, tmp_path: Path) -> None:
    """Whatever DuckDB says of it: in the footer, whose length stands at the end, is what it reads first."""
    one.add([made(n, bells()) for n in range(50)])
    one.add([made(n, bells()) for n in range(100, 150)])
    file = max((Path(path) for path in one.files.sizes()), key=lambda path: path.stat().st_size)
    whole = file.read_bytes()
    spoilt = [whole[:-9], b"", b"PAR", b"x" * 99]
    footer = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    spoilt += [flipped(whole, footer + 700 * part) for part in range(4)]
    for number, data in enumerate(spoilt):
        file.write_bytes(data)
        for attempt in (lambda: one.export(tmp_path / "all.parquet"), one.listing):
            with pytest.raises(InvalidArgument, match=file.name) as caught:
                attempt()
            assert "backup" in caught.value.advice, number
    assert not list(tmp_path.glob("*.parquet"))


@pytest.mark.requirement("R-REGISTRY")
def test_every_flipped_bit_is_found(one: Registry, tmp_path: Path) -> None:
    """In results, jobs, lists and documents."""
    for number in range(3):
        data = document_bytes(document()) + b" " * number
        (tmp_path / f"{number}.json").write_bytes(data)
        one.add([row(data, document(), Origin(place=f"../{number}.json"))])
        one.add([made(n, bells(), model=f"M{n % 3}") for n in range(5 * number, 5 * number + 5)])
    one.append([], [ended("x")])
    one.list_records()
    found = verify(one)
    assert (found.rows, found.documents, found.documents_missing) == (18, 3, 0)
    assert found.faults == ()
    files = [path for path in (*one.folder.rglob("*"), *tmp_path.glob("*.json")) if path.is_file()]
    dice = np.random.default_rng(0)
    for number in range(200):
        path = files[number % len(files)]
        whole = path.read_bytes()
        at, bit = int(dice.integers(len(whole))), int(dice.integers(8))
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << bit]) + whole[at + 1 :])
        faults = verify(Registry(one.folder)).faults
        assert any(str(path) in fault for fault in faults), (path.name, at, bit)
        path.write_bytes(whole)
    assert not verify(one).faults


def test_curves_that_cannot_be_are_named(tmp_path: Path) -> None:
    for wrong in (float("nan"), float("inf"), -1e30, 7.0):
        one = Registry(tmp_path / f"{wrong}", new=True)
        curves = bells()
        curves[1, 30] = wrong
        one.add([*history(5, 0), made(77, curves, captured=START, serial="A1"), made(78, bells(), serial="B2")])
        (place,) = {
            row[0]
            for row in one.files.ask(lambda con: con.execute("SELECT filename FROM results").fetchall(), rows=True)
        }
        attempts = [
            lambda one=one: compare.spread(one, Unit(model="Model")),
            lambda one=one: drift_of(one, Unit(serial="A1")),
        ]
        for attempt in attempts if wrong == 7.0 else attempts[:1]:
            with pytest.raises(InvalidArgument, match=f"{Path(place).name} is damaged: of the result 00000000000"):
                attempt()


def test_curves_of_another_length_are_named(one: Registry) -> None:
    one.add([made(1, bells()), made(2, bells()[:, :60], serial="B2")])
    with pytest.raises(InvalidArgument, match="the curves cannot be right"):
        compare.spread(one, Unit(model="Model"))


def test_an_export_s_place_is_to_blame_for_itself(one: Registry, tmp_path: Path) -> None:
    one.add([made(1)])
    (tmp_path / "folder.csv").mkdir()
    for name in ("nodir/x.parquet", "folder.csv"):
        with pytest.raises(InvalidArgument, match=f"{name} cannot be written") as caught:
            one.export(tmp_path / name)
        assert str(one.folder) not in caught.value.message
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder.csv", "phones"]


def test_another_release_has_other_columns(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """An older one lacks `odds`, a newer one has `later` as well: its records stay whole here."""
    records = [_plain(vars(made(number))) | {"kind": "result", "revision": 0} for number in (1, 2, 3)]
    monkeypatch.setattr(record_files, "COLUMNS", {name: kind for name, kind in COLUMNS.items() if name != "odds"})
    one._write([{name: value for name, value in records[0].items() if name != "odds"}], START)
    monkeypatch.setattr(record_files, "COLUMNS", COLUMNS | {"later": "VARCHAR"})
    one._write([record | {"later": word} for record, word in zip(records[1:], "xy", strict=True)], START)
    monkeypatch.undo()
    one.list_records()
    Registry(one.folder, correct=True).add([made(4, odds=7.0), made(1, serial="B2"), made(2, serial="B2")])
    for _ in range(2):
        assert len(keys(one)) == 4
        assert {found["odds"] for found in one.query("SELECT odds FROM rows")} == {None, 7.0}
        assert one.listing(Wanted(Unit(serial="B2")))[0]["key"] == f"{2:064x}"
        assert verify(one).faults == ()
        later = one.files.ask(
            lambda con: con.execute("SELECT later FROM stored WHERE later <> '' ORDER BY ALL").fetchall()
        )
        assert later == [("x",), ("y",)]
        one.files.compact()


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    for new in (True, False):
        with pytest.raises(InvalidArgument, match="no registry"):
            Registry(tmp_path, new=new)
    with pytest.raises(InvalidArgument, match=r"letter\.txt is a file"):
        Registry(tmp_path / "letter.txt", new=True)
    with pytest.raises(InvalidArgument, match="There is no folder"):
        Registry(tmp_path / "missing")


@pytest.mark.requirement("R-REGISTRY")
def test_writers_that_contradict_each_other_at_once(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither saw the other: both records stay, `verify` names the contradiction, and a correction settles it."""
    one.add([made(1, serial=""), made(4)])
    real = Registry._held

    def late(self: Registry, keys: Any) -> Any:
        held = real(self, keys)
        monkeypatch.setattr(Registry, "_held", real)
        Registry(one.folder).add([made(1, serial="theirs"), made(2), made(3, serial="theirs")])
        one.files.compact()
        return held

    monkeypatch.setattr(Registry, "_held", late)
    one.add([made(1, serial="mine"), made(2), made(3, serial="mine")])
    assert len(keys(one)) == 4
    faults = verify(one).faults
    assert len(faults) == 1, "the same words of both"
    assert f"two writers gave the result {0:012x} two values of serial: mine and theirs" in faults[0]
    assert verify(one).advice == "Add the result again with what is right, and --correct."
    for number in (1, 3):
        (shown,) = one.query("SELECT serial FROM rows WHERE key = ?", [f"{number:064x}"])
        (said,) = Registry(one.folder, correct=True).add([made(number, serial=shown["serial"])])
        assert said.changes == (f"serial settled as {shown['serial']}",)
    assert verify(one).faults == ()
    Registry(one.folder, correct=True).add([made(1, serial="mine"), made(3, serial="mine")])
    assert {
        found["serial"] for found in one.query("SELECT serial FROM rows WHERE key LIKE '%1' OR key LIKE '%3'")
    } == {"mine"}
    assert verify(one).faults == ()


def test_two_writers_that_begin_a_registry_together(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other one writes its first file between this one's two looks into the folder."""
    real = RecordFiles.sizes

    def late(self: RecordFiles) -> Any:
        sizes = real(self)
        monkeypatch.setattr(RecordFiles, "sizes", real)
        Registry(one.folder, new=True).add([made(1)])
        return sizes

    monkeypatch.setattr(RecordFiles, "sizes", late)
    Registry(one.folder, new=True).add([made(2)])
    assert len(keys(one)) == 2


@pytest.mark.requirement("R-REGISTRY")
def test_two_writers_add_the_same_at_once(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    real = Registry._held

    def late(self: Registry, keys: Any) -> Any:
        held = real(self, keys)
        monkeypatch.setattr(Registry, "_held", real)
        Registry(one.folder, new=True).add([made(1, bells(), serial="A7"), made(2)])
        return held

    monkeypatch.setattr(Registry, "_held", late)
    one.add([made(1, bells(), serial="A7", added=START + timedelta(days=1)), made(3)])
    assert len(keys(one)) == 3
    assert one.query("SELECT serial, added FROM rows WHERE key LIKE '%1'") == [
        {"serial": "A7", "added": START + timedelta(seconds=1)}
    ]
    assert verify(one).faults == ()


@pytest.mark.requirement("R-REGISTRY")
def test_a_fact_that_is_said_of_a_result_that_is_being_deleted_is_named(
    one: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    one.add([made(1, serial="A"), made(2, serial="B")])
    real = Registry._held

    def late(self: Registry, keys: Any) -> Any:
        held = real(self, keys)
        monkeypatch.setattr(Registry, "_held", real)
        Registry(one.folder).delete(Unit(serial="A"))
        return held

    monkeypatch.setattr(Registry, "_held", late)
    one.add([made(1, serial="A", lens="50mm")])
    assert len(keys(one)) == 1
    assert verify(one).faults == (f"facts are said of the result {0:012x}, which is not there",)
    one.add([made(1, serial="A", lens="50mm")])
    assert (len(keys(one)), verify(one).faults) == (2, ())


@pytest.mark.requirement("R-REGISTRY")
def test_a_clock_that_is_set_back_moves_nothing(one: Registry) -> None:
    """What corrects counts, whatever the clock says."""
    one.add([made(1, serial="A", added=START + timedelta(days=900))])
    for days, serial in ((0, "B"), (-500, "C"), (3000, "D"), (-900, "A"), (-901, "B")):
        Registry(one.folder, correct=True).add([made(1, serial=serial, added=START + timedelta(days=days))])
        assert one.query("SELECT serial FROM rows") == [{"serial": serial}]
    assert len(one.history(Unit(serial="A"))) == 6
    assert verify(one).faults == ()


def test_history_says_what_was_said_and_when(one: Registry) -> None:
    one.add([made(1, serial="")])
    one.add([made(1, serial="A7", note="screen replaced", added=START + timedelta(days=1))])
    later = {"serial": "B2", "added": START + timedelta(days=2)}
    Registry(one.folder, correct=True).add([made(1, **later)])
    for serial in ("A7", "B2"):
        changes = one.history(Unit(serial=serial))
        assert [change.what for change in changes] == [
            "accepted result, make Maker, model Model", "serial set to A7, note set to screen replaced",
            "serial changed from A7 to B2",
        ]  # fmt: skip
    assert changes[1].added == "2026-01-02T00:00:00Z"
    assert "@" in changes[0].added_by
    assert one.history(Unit(serial="nobody")) == []


@pytest.mark.parametrize("when", ["records", "list"])
def test_a_disk_that_is_full_adds_nothing(one: Registry, when: str, monkeypatch: pytest.MonkeyPatch) -> None:
    one.add([made(1)])
    real, calls = record_files.write_place, []

    def full(*values: Any) -> None:
        calls.append(values)
        if len(calls) == (1 if when == "records" else 2):
            raise OSError(28, "No space left on device")
        real(*values)

    monkeypatch.setattr(record_files, "write_place", full)
    with pytest.raises(InvalidArgument, match="No space") as caught:
        one.add([made(2)])
    monkeypatch.undo()
    assert caught.value.message.startswith("The results were added, but then: ") == (when == "list")
    assert len(keys(one)) == (1 if when == "records" else 2)
    one.add([made(2)])
    assert (len(keys(one)), verify(one).faults) == (2, ())


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="other rights there")
def test_a_folder_that_may_not_be_written_is_named(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    one.add([made(1)])

    def refuse(*values: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(record_files, "write_place", refuse)  # the tests' user may write everywhere
    with pytest.raises(InvalidArgument, match=r"the registry cannot be used \(Permission denied"):
        one.add([made(2)])
    assert len(keys(one)) == 1


def test_a_file_that_vanishes_while_it_is_read(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """As when somebody deletes a unit between the look into the folder and the reading."""
    one.add([made(number, serial=str(number)) for number in range(4)])
    real, calls = RecordFiles.sizes, []

    def late(self: RecordFiles) -> Any:
        sizes = real(self)
        if not calls:
            calls.append(1)
            Registry(one.folder).delete(Unit(serial="3"))
        return sizes

    monkeypatch.setattr(RecordFiles, "sizes", late)
    assert len(keys(one)) == 3


def test_a_deleted_unit_is_gone_from_every_file(one: Registry) -> None:
    """Other units are as before; what is added again is there again."""
    mine = [made(n, serial="PATIENT-7", name=f"patient-{n}", place=f"../a/{n}.json", added=START) for n in range(3)]
    one.add([*mine[:2], made(8), made(9, model="Other")])
    one.add([mine[2]])
    one.append([], [ended("patient-1", mine[1].key), ended("x"), ended("patient-4", serial="PATIENT-7")])
    one.list_records()
    nothing = one.delete(Unit(serial="nobody"))
    assert (nothing.results, nothing.records, nothing.files) == ((), 0, 0)
    deletion = one.delete(Unit(serial="PATIENT-7"))
    assert deletion.results == tuple(Deleted(f"{n:064x}", f"../a/{n}.json") for n in range(3))
    assert (deletion.records, deletion.files) == (5, 3)
    assert [key[-1] for key in keys(one)] == ["8", "9"]
    assert one.query("SELECT name FROM jobs") == [{"name": "x"}]
    assert one.history(Unit(serial="PATIENT-7")) == []
    assert "atient" not in str(one.files.ask(lambda con: list(all_records(con)))).lower()
    for path in one.folder.iterdir():
        assert b"atient" not in path.read_bytes().lower(), path
    assert verify(one).faults == ()
    one.add(mine)
    assert len(keys(one)) == 5
    assert one.delete(Unit(serial="PATIENT-7")).records == 3
    assert (len(keys(one)), verify(one).faults) == (2, ())


@pytest.mark.requirement("R-REGISTRY")
def test_a_deletion_that_is_killed_is_finished_by_the_same_command(
    one: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    one.add([made(1, serial="A"), made(2, serial="B")])

    def killed(self: RecordFiles, records: Any) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(RecordFiles, "drop", killed)
    with pytest.raises(KeyboardInterrupt):
        one.delete(Unit(serial="A"))
    monkeypatch.undo()
    assert len(keys(one)) == 1
    (fault,) = verify(one).faults
    assert fault == "1 deleted record still in a file"
    one.delete(Unit(serial="A"))
    assert (len(keys(one)), verify(one).faults) == (1, ())


@pytest.mark.full
@pytest.mark.parametrize("reader", ["pandas", "polars", "pyarrow", "duckdb"])
def test_a_program_of_others_reads_it(one: Registry, reader: str) -> None:
    """As docs/registry.md says: a folder of Parquet files; times with their zone, the curves."""
    library = pytest.importorskip(reader)
    if reader == "pandas":
        pytest.importorskip("pyarrow")
    captured = datetime(2026, 11, 20, 10, tzinfo=timezone(timedelta(hours=1)))
    one.add([made(1, bells(), captured=captured), made(2, bells(), model="Other")])
    one.add([made(3, bells(), captured=captured)])
    wanted = ["key", "serial", "captured", "red"]
    if reader == "pandas":
        frame = library.read_parquet(
            one.folder, columns=wanted, filters=[("kind", "==", "result"), ("model", "==", "Model")]
        )
        found = frame.to_dict("records")
    elif reader == "pyarrow":
        from pyarrow import dataset

        table = dataset.dataset(one.folder).to_table(
            columns=wanted, filter=(dataset.field("kind") == "result") & (dataset.field("model") == "Model")
        )
        found = table.to_pylist()
    elif reader == "polars":
        frame = library.scan_parquet(one.folder / "*.parquet")
        found = frame.filter(kind="result", model="Model").select(wanted).collect().to_dicts()
    else:
        times = "epoch(captured)"  # for times with a zone DuckDB needs pytz
        where = f"FROM '{one.folder}/*.parquet' WHERE kind = 'result' AND model = 'Model'"
        rows = library.sql(f"SELECT key, serial, {times}, red {where}").fetchall()
        found = [
            dict(zip(wanted, (*row[:2], datetime.fromtimestamp(row[2], UTC), row[3]), strict=True)) for row in rows
        ]
    first, second = sorted(found, key=lambda row: str(row["key"]))
    assert (first["serial"], second["serial"]) == ("A1", "A1")
    assert first["captured"] == captured
    assert list(first["red"]) == pytest.approx(bells()[0], rel=1e-6)


def test_without_the_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(InvalidArgument, match=r"install -e .*\[fleet\]"):
        Registry(tmp_path)


# Many at once


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.full
def test_six_writers_two_of_them_killed(one: Registry) -> None:
    """Somebody reads and somebody gathers meanwhile. All that was acknowledged is there, once."""
    rows = {number: 100 if number > 2 else 1_000_000 for number in range(1, 7)}  # victims never end by themselves
    writers = [
        subprocess.Popen(
            [*WRITER, str(one.folder), str(number), str(count), "5"],
            bufsize=0, stdout=subprocess.PIPE, env=os.environ | {"PYTHONPATH": SEARCH},
        )
        for number, count in rows.items()
    ]  # fmt: skip
    added: list[list[str]] = []
    try:
        deadline = time.monotonic() + 240
        while not one.files.sizes() and time.monotonic() < deadline:
            time.sleep(0.01)
        reader = Registry(one.folder)
        for victim in writers[:2]:
            assert victim.stdout is not None
            acknowledged_first = victim.stdout.readline().decode().strip()
            found = keys(reader)
            assert acknowledged_first in found
            assert len(found) == len(set(found))
            reader.files.compact()
            victim.kill()
            added.append([acknowledged_first])
        for process in writers:
            out, _ = process.communicate(timeout=240)
            added.append(out.decode().splitlines())
    finally:
        for process in writers:
            process.kill()
            process.wait()
    assert [process.returncode != 0 for process in writers] == [True] * 2 + [False] * 4
    assert [len(lines) for lines in added[4:]] == [100] * 4
    found = keys(reader)
    assert len(found) == len(set(found))
    acknowledged = {line for lines in added for line in lines}
    assert acknowledged <= set(found)
    assert len(set(found) - acknowledged) <= 10  # a task of each victim that was safe, and he did not live to say so
    reader.files.compact()
    assert keys(reader) == found
    reader.list_records()
    assert verify(reader).faults == ()


# Comparing


def fleet(one: Registry, units: int, repeats: int, between: float, within: float, seed: int = 0) -> None:
    """Units whose curves differ by a bump of so many parts of the peak, and results of each that do by another."""
    dice = np.random.default_rng(seed)
    bump = np.exp(-0.5 * ((compare.NM - 550) / 40) ** 2)
    rows = []
    for unit in range(units):
        own = between * dice.standard_normal((3, 1)) * bump
        for repeat in range(repeats):
            curves = bells() + own + within * dice.standard_normal((3, 1)) * bump
            rows.append(made(1000 * unit + repeat, curves, serial=f"u{unit}"))
    one.add(rows)


def rms(bump: float = 1.0) -> float:
    return float(bump * np.sqrt(np.mean(np.exp(-(((compare.NM[compare.COMPARED] - 550) / 40) ** 2)))))


def test_the_spread_of_a_model(one: Registry) -> None:
    fleet(one, units=60, repeats=3, between=0.03, within=0.02)
    one.add([made(900_000, bells(20.0), serial=""), made(900_001, bells(50.0), status="refused", serial="r")])
    found = compare.spread(one, Unit(model="Model"))
    assert (found.units, found.results, found.without_serial) == (60, 180, 1)
    assert found.repeat is not None
    assert found.between is not None
    assert found.repeat == pytest.approx(rms(0.02), rel=0.15)
    assert found.between == pytest.approx(rms(0.03), rel=0.25)
    assert (found.low < rms(0.03)).all()
    assert (found.high > rms(0.03)).all()
    assert found.observed == pytest.approx(rms(np.hypot(0.03, 0.02 / np.sqrt(3))), rel=0.25)


def test_the_interval_of_a_spread_covers() -> None:
    """0.95 of simulated fleets of six units, and not much more where one bump is all that differs."""
    dice, inside = np.random.default_rng(3), 0
    bump = np.exp(-0.5 * ((compare.NM[compare.COMPARED] - 550) / 40) ** 2)
    for _ in range(400):
        units = [0.03 * dice.standard_normal((3, 1)) * bump for _ in range(6)]
        _, repeat, between, low, high = compare.between_units([unit[None] for unit in units])
        assert repeat is between is None
        inside += int(np.sum((low <= rms(0.03)) & (rms(0.03) <= high)))
    assert 0.93 <= inside / 1200 <= 0.97


def test_units_that_are_equal_spread_by_nothing(one: Registry) -> None:
    """What repeats explain is not the units'."""
    fleet(one, units=30, repeats=4, between=0.0, within=0.02)
    found = compare.spread(one, Unit(model="Model"))
    assert (found.low == 0).all()
    assert (found.high < rms(0.015)).all()
    same = [np.ones((2, 3, 5))] * 3
    assert all((np.asarray(each) == 0).all() for each in compare.between_units(same))


def test_too_few_units(one: Registry) -> None:
    one.add([made(1, bells()), made(2, bells())])
    with pytest.raises(InvalidArgument, match="1 unit of Model"):
        compare.spread(one, Unit(model="Model"))
    with pytest.raises(InvalidArgument, match="no unit of Nothing"):
        compare.spread(one, Unit(model="Nothing"))


def history(count: int, drift: float, step: float = 0.0, noise: float = 0.3, seed: int = 0) -> list[Row]:
    """Results of one unit every month; red's centre drifts by so many nm a year, and steps before the last."""
    dice = np.random.default_rng(seed)
    rows = []
    for month in range(count):
        red = drift * month / 12 + step * (month == count - 1)
        curves = bells(np.array([red, 0, 0]) + noise * dice.standard_normal(3))
        rows.append(made(month, curves, captured=START + timedelta(days=30.4 * month)))
    return rows


@pytest.mark.parametrize(("drift", "step", "alarm"), [(0, 0, ""), (6, 0, "trend"), (-6, 0, "trend"), (0, 5, "step")])
def test_a_drift_raises_an_alarm(one: Registry, drift: float, step: float, alarm: str) -> None:
    one.add(history(13, drift, step))
    found = {feature.feature: feature for feature in drift_of(one, Unit(serial="A1")).features}
    assert set(found) == set(FEATURES)
    assert found["red centre"].alarm == alarm
    assert not [each for name, each in found.items() if each.alarm and name != "red centre"]
    red = found["red centre"]
    assert (red.results, red.days) == (13, pytest.approx(364.8))
    if alarm == "trend":
        assert red.slope == pytest.approx(drift, abs=4 * red.slope_error)
        assert red.slope == pytest.approx(drift, abs=1.0)
    if alarm == "step":
        assert red.step == pytest.approx(step, abs=1.0)


def test_false_alarms_are_as_rare_as_they_say() -> None:
    dice, days = np.random.default_rng(5), np.arange(8) * 30.0
    alarms = 0
    for _ in range(2000):
        values = 500 + 20 * dice.standard_normal((8, len(FEATURES)))  # so loud that no limit hides one
        alarms += any(drift.alarm for drift in drifts(days, values))
    assert 0 < alarms / 2000 <= 1.5 * FALSE_ALARMS


def test_a_drift_that_is_certain_and_small_is_no_alarm() -> None:
    days = np.arange(10) * 36.5
    values = np.outer(days / 365, [0.5] * 6) + 500
    for drift in drifts(days, values):
        assert drift.p_trend < 1e-6
        assert not drift.alarm
    still = drifts(days, np.full((10, 6), 500.0))
    assert [(each.change, each.p_trend, each.p_step, each.alarm) for each in still] == [(0, 1, 1, "")] * 6
    at_once = drifts(np.zeros(5), np.arange(30.0).reshape(5, 6))
    assert all(each.slope == 0 for each in at_once)


def test_what_a_drift_needs(one: Registry) -> None:
    one.add([*history(3, 0), made(90, bells(), captured=None)])
    with pytest.raises(
        InvalidArgument,
        match=r"not testable yet: of the unit A1 3 accepted results have a time, .* needs 4\. Left out: 1 no time",
    ):
        drift_of(one, Unit(serial="A1"))
    with pytest.raises(InvalidArgument, match="no result of a unit with the serial number none"):
        drift_of(one, Unit(serial="none"))
    one.add([replace(each, key=f"{i:064d}", model="Other") for i, each in enumerate(history(4, 0), 10)])
    with pytest.raises(InvalidArgument, match="Several units"):
        drift_of(one, Unit(serial="A1"))
    assert len(drift_of(one, Unit(serial="A1", model="Other")).features) == 6


def test_a_unit_is_one_however_much_its_rows_say(one: Registry) -> None:
    """What is silent where several are named is of nobody."""
    one.add([made(1, bells(), lens="50mm"), made(2, bells()), made(3, bells(1.0), serial="B2"),
             made(4, bells(1.0), serial="B2", camera_id="2", lens="50mm")])  # fmt: skip
    found = compare.spread(one, Unit(model="Model"))
    assert (found.units, found.results, found.without_serial) == (2, 4, 0)
    one.add([made(5, bells(), lens="24mm"), made(6, bells(), camera_id="1", lens="24mm")])
    found = compare.spread(one, Unit(model="Model"))
    assert (found.units, found.results, found.without_serial) == (3, 5, 1)
    assert compare.spread(one, Unit(model="Model", lens="50mm")).results == 3
    units = compare.units_of([["m", "p", c, "s", lens] for c, lens in (("1", "a"), ("2", ""), ("2", "b"), ("", "a"))])
    assert units == [("m", "p", "1", "s", "a"), ("m", "p", "2", "s", "b"), ("m", "p", "2", "s", "b"), None]


def test_what_several_units_of_a_number_differ_in_is_said(one: Registry) -> None:
    rows = history(4, 0)
    both = [replace(each, key=f"{i:064d}", lens="24mm") for i, each in enumerate(rows, 10)]
    one.add([replace(each, lens="50mm") for each in rows] + both)
    with pytest.raises(InvalidArgument, match="lens '24mm', '50mm'") as caught:
        drift_of(one, Unit(serial="A1", model="Model", make="Maker"))
    assert caught.value.advice == "Name one by --lens."
    assert drift_of(one, Unit(serial="A1", lens="24mm")).features[0].results == 4
    one.add([replace(each, key=f"{i:064d}", make="Other", lens="24mm") for i, each in enumerate(rows, 20)])
    with pytest.raises(InvalidArgument, match=r"make 'Maker', 'Other'; lens") as caught:
        drift_of(one, Unit(serial="A1"))
    assert caught.value.advice == "Name one by --make or --lens."
    assert run("compare", one.folder, "--serial", "A1", "--make", "Other") == 0
    assert run("compare", one.folder, "--serial", "A1", "--lens", "24mm") == InvalidArgument.exit_status
    assert run("compare", one.folder, "--serial", "A1", "--lens", "50mm", "--camera-id", "7") == 0


def test_features_are_centres_and_widths() -> None:
    found = features(bells(np.array([-3.0, 0.0, 4.0]), width=25.0)[None][..., compare.COMPARED])[0]
    assert found == pytest.approx([597, 25, 540, 25, 464, 25], abs=0.5)  # red and blue end a little inside


# The command line


FORMS = {
    "camssf-spread/1": SpreadDocument, "camssf-drift/1": DriftDocument,
    "camssf-verification/1": VerificationDocument, "camssf-deletion/1": DeletionDocument,
}  # fmt: skip


def validated(found: dict[str, Any], form: str) -> dict[str, Any]:
    """By its type, which reads it, and by its schema."""
    jsonschema = pytest.importorskip("jsonschema")
    assert to_plain(from_plain(found, FORMS[form], "it", "")) == found
    jsonschema.Draft202012Validator(schema(FORMS[form])).validate(found)
    return found


def run(*words: object) -> int:
    return cli.main(["registry", *map(str, words)])


def test_add_list_compare_export(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, result = tmp_path / "phones", tmp_path / "out" / "result.json"
    result.parent.mkdir()
    result.write_bytes(document_bytes(document()))
    assert run("add", folder, result, "--serial", "=A1", "--captured", "2026-11-20T10:00:00+01:00") == 0
    assert run("add", folder, result, "--serial", "=A1", "--captured", "2026-11-20T10:00:00+01:00") == 0
    capsys.readouterr()
    assert run("list", folder) == 0
    out, err = capsys.readouterr()
    (found,) = csv.DictReader(out.splitlines())
    assert (found["serial"], found["captured"], found["status"]) == ("'=A1", "2026-11-20T09:00:00Z", "doubtful")
    assert "1 doubtful" in err
    assert run("list", folder, "--model", "another") == 0
    assert "no results" in capsys.readouterr().err
    assert Registry(folder).query("SELECT place FROM rows") == [{"place": "../out/result.json"}]
    for name in ("all.parquet", "all.csv"):
        assert run("export", folder, "-o", tmp_path / name) == 0
    with connection() as con:
        (count,) = con.execute(f"SELECT count(*) FROM '{tmp_path / 'all.parquet'}' WHERE len(red) = 69").fetchone()
    assert count == 1
    (cells,) = csv.DictReader((tmp_path / "all.csv").read_text("utf-8").splitlines())
    assert cells["serial"] == "'=A1"
    assert "red" not in cells
    assert sorted(path.name for path in tmp_path.iterdir()) == ["all.csv", "all.parquet", "out", "phones"]


def test_what_is_added_is_called_what_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for data, word in ((b"II*\0" + bytes(99), "DNG"), (b"\x89PNG\r\n", "PNG"), (b"name,photo\nx,y\n", "text"),
                       (bytes(9) + b"..", "binary")):  # fmt: skip
        (tmp_path / "chart.dng").write_bytes(data)
        for more in ((), ("--serial", "x")):
            assert run("add", tmp_path / "phones", tmp_path / "chart.dng", *more) == InvalidArgument.exit_status
            message = capsys.readouterr().err
            assert word in message
            assert "no passport" in " ".join(message.split())
    assert not (tmp_path / "phones").exists()


def test_add_a_passport(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cryptography", reason="cryptography is not here")
    from camssf_fleet.passport.document import PassportRequest, as_printed, create_passport, sign
    from camssf_fleet.passport.keys import PUBLIC, make_key, read_private
    from camssf_fleet.passport.revocations import sign_revocations

    make_key(tmp_path)
    drawn = create_passport(
        document_bytes(document()), PassportRequest(Unit(serial="S"), "2026-01-02"), now=datetime.now(UTC)
    )
    file, folder = tmp_path / "a.jws", tmp_path / "phones"
    file.write_bytes(sign(drawn, read_private(tmp_path / "passport-key.pem")))
    assert run("add", folder, file) == 2
    assert run("add", folder, file, "--key", tmp_path / PUBLIC, "--serial", "x") == 2
    lists = sign_revocations([drawn.id], read_private(tmp_path / "passport-key.pem"))
    (tmp_path / "revoked").write_bytes(lists)
    assert run("add", folder, file, "--key", tmp_path / PUBLIC, "--revoked", tmp_path / "revoked") == 10
    assert not folder.exists()
    capsys.readouterr()
    assert run("add", folder, file, "--key", tmp_path / PUBLIC) == 0
    capsys.readouterr()
    (found,) = Registry(folder).query("SELECT * FROM rows")
    assert (found["passport"], found["serial"], found["key"]) == (drawn.id, "S", drawn.result_sha256)
    assert found["captured"] == datetime(2026, 1, 2, tzinfo=UTC)
    assert not found["code_covariance"]
    # With the whole result, or with what `passport verify` printed: the same row, and nothing of it is lost.
    (tmp_path / "y.json").write_text(json.dumps(to_plain(as_printed(file.read_bytes(), drawn))), "utf-8")
    (tmp_path / "result.json").write_bytes(document_bytes(document()))
    assert run("add", folder, tmp_path / "y.json") == 2  # a passport wants a key, in this form, too
    capsys.readouterr()
    assert run("add", folder, tmp_path / "result.json", tmp_path / "y.json", "--key", tmp_path / PUBLIC) == 0
    message = capsys.readouterr().err
    assert "result.json: covariance added" in message
    assert "1 result changed in" in message
    (found,) = Registry(folder).query("SELECT * FROM rows")
    assert (found["passport"], found["serial"], found["key"]) == (drawn.id, "S", drawn.result_sha256)
    assert list(found["code_covariance"]) == pytest.approx(document().answer.code_covariance, abs=1e-6)


def test_upkeep_on_the_command_line(one: Registry, capsys: pytest.CaptureFixture[str]) -> None:
    one.add([made(1, place="../1.json"), made(2, serial="B2")])
    one.add([made(3, serial="B2")])
    assert run("verify", one.folder) == 0
    found = validated(json.loads(capsys.readouterr().out), "camssf-verification/1")
    assert (found["rows"], found["documents_missing"], found["faults"]) == (3, 1, [])
    head = found["heads"][0]
    assert run("verify", one.folder, "--head", head) == 0
    assert f"head {head}" in " ".join(capsys.readouterr().err.split())
    assert run("verify", one.folder, "--head", f" {head.upper()} {head[:12]}") == 0
    assert run("verify", one.folder, "--head", "7" * 64) == cli.PARTED
    assert run("verify", one.folder, "--head", "7") == InvalidArgument.exit_status
    assert run("compact", one.folder) == 0
    assert "4 files before, 1 file now" in capsys.readouterr().err
    assert run("list", one.folder) == 0
    assert len(capsys.readouterr().out.splitlines()) == 4
    assert run("history", one.folder, "A1") == 0
    (said,) = csv.DictReader(capsys.readouterr().out.splitlines())
    assert (said["key"], said["what"]) == (f"{1:064x}", "accepted result, make Maker, model Model, serial A1")
    assert run("history", one.folder, "nobody") == InvalidArgument.exit_status
    capsys.readouterr()
    assert run("delete", one.folder, "A1") == 0
    found = validated(json.loads(capsys.readouterr().out), "camssf-deletion/1")
    assert found["results"] == [{"key": f"{1:064x}", "place": "../1.json"}]
    assert (found["records"], found["files"]) == (1, 1)
    assert run("delete", one.folder, "A1") == InvalidArgument.exit_status
    file = Path(next(iter(one.files.sizes())))
    file.write_bytes(flipped(file.read_bytes(), 100, 1))
    assert run("verify", one.folder) == cli.PARTED
    out, err = capsys.readouterr()
    assert validated(json.loads(out), "camssf-verification/1")["faults"]
    assert "damaged" in err


def test_a_drift_on_the_command_line_ends_with_1(
    one: Registry, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one.add([*history(13, 6), *(replace(each, key=f"b{each.key[1:]}", serial="B2") for each in history(13, 0))])
    assert run("compare", one.folder, "--serial", "A1") == cli.PARTED
    out, err = capsys.readouterr()
    assert validated(json.loads(out), "camssf-drift/1")["alarm"] is True
    assert "red centre" in err
    assert run("compare", one.folder, "--serial", "B2") == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["alarm"] is False
    assert run("compare", one.folder, "--model", "Model") == 0
    assert validated(json.loads(capsys.readouterr().out), "camssf-spread/1")["units"] == 2


def last(**more: Any) -> Row:
    """A result of the unit of `history`, newer than its first five; so far off that it is doubtful."""
    row_ = made(50, bells(np.array([0.0, 0.0, 12.0])), captured=START + timedelta(days=200), status="doubtful")
    row_ = replace(row_, inputs=("b" * 64,))
    return replace(row_, **{"code": "lamp_unfit", "reason": "The photo fits D:4300 better."} | more)


def test_a_newest_result_that_was_left_out_is_not_no_drift(one: Registry, capsys: pytest.CaptureFixture[str]) -> None:
    one.add([*history(5, 0), last()])
    assert run("compare", one.folder, "--serial", "A1") == cli.UNDECIDED
    out, err = capsys.readouterr()
    found = validated(json.loads(out), "camssf-drift/1")
    assert (found["outcome"], found["alarm"], found["doubtful"]) == ("undecided", False, 0)
    (left,) = found["left_out"]
    assert (left["key"], left["captured"], left["why"]) == (f"{50:064x}", "2026-07-20T00:00:00Z", "doubtful")
    assert left["newest"]
    assert left["steps"]["blue centre"] == pytest.approx(11, abs=2)
    err = " ".join(err.split())
    for words in ("2026-07-20T00:00:00Z, doubtful (lamp_unfit: The photo fits", "blue centre +1", "undecided"):
        assert words in err
    assert run("compare", one.folder, "--serial", "A1", "--doubtful") == cli.PARTED
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert (found["outcome"], found["doubtful"], found["left_out"]) == ("drift", 1, [])
    assert "6 results, 1 of them doubtful," in err
    one.add([replace(each, key=f"f{each.key[1:]}", serial="B2") for each in history(3, 0)])
    assert run("compare", one.folder, "--serial", "B2") == InvalidArgument.exit_status


@pytest.mark.parametrize(
    ("more", "outcome", "why"),
    [
        ({"captured": START + timedelta(days=45)}, "no_drift", "doubtful"),
        ({"red": (), "green": (), "blue": (), "status": "refused"}, "undecided", "no curves"),
        ({"captured": None, "status": "accepted"}, "no_drift", "no time"),  # it was added before the last photo
        ({"captured": None, "status": "accepted", "added": START + timedelta(days=300)}, "undecided", "no time"),
        ({"camera_id": "1", "lens": "", "status": "accepted"}, "undecided", "unit not certain"),
        ({"lens": "24mm"}, "no_drift", None),  # of another unit
        ({"inputs": ("a" * 64,)}, "no_drift", "doubtful"),  # the same photos count, in another result
        ({"model": "Other"}, "no_drift", None),
    ],
)
def test_what_is_left_out_of_a_drift_is_named(
    one: Registry, more: dict[str, Any], outcome: str, why: str | None
) -> None:
    rows = [replace(each, camera_id="1", lens="50mm") for each in history(5, 0)]
    rows[-1] = replace(rows[-1], inputs=("a" * 64,))
    other = [replace(rows[0], key="e" * 64, lens="35mm")] if why == "unit not certain" else []
    one.add([*rows, *other, last(**{"camera_id": "1", "lens": "50mm"} | more)])
    found = drift_of(one, Unit(serial="A1", lens="50mm", model="Model" if "model" in more else ""))
    assert (found.outcome, [each.why for each in found.left_out]) == (outcome, [] if why is None else [why])
    assert all((each.steps is None) == (why == "no curves") for each in found.left_out)
    assert found.features[0].results == 5


def test_an_older_result_that_was_left_out_is_listed(one: Registry, capsys: pytest.CaptureFixture[str]) -> None:
    one.add([*history(5, 0), last(captured=START + timedelta(days=45))])
    assert run("compare", one.folder, "--serial", "A1") == 0
    found = validated(json.loads(capsys.readouterr().out), "camssf-drift/1")
    assert [each["newest"] for each in found["left_out"]] == [False]


def test_a_time_to_come_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "result.json").write_bytes(document_bytes(document()))
    words = ("add", tmp_path / "new", tmp_path / "result.json", "--serial", "A", "--captured", "9000-01-01")
    assert run(*words) == InvalidArgument.exit_status
    assert "lies in the future" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_what_a_spread_leaves_out_is_counted(one: Registry, capsys: pytest.CaptureFixture[str]) -> None:
    fleet(one, units=3, repeats=1, between=0.03, within=0.0)
    one.add([last(serial="r"), last(key="a" * 64, status="refused", red=(), green=(), blue=())])
    assert run("compare", one.folder, "--model", "Model") == 0
    out, err = capsys.readouterr()
    assert validated(json.loads(out), "camssf-spread/1")["left_out"] == {"doubtful": 1, "refused": 1}
    assert "left out: 1 doubtful, 1 refused" in err


WRONG = [
    (["list", "missing"], "There is no folder missing. Name the folder that `camssf registry add`"),
    (["list", "else"], "else is no registry: it holds no file of records."),
    (["delete", "phones"], ""),
    (["add", "else", "result.json"], "Name a new or an empty folder."),
    (["compare", "phones"], "Nothing to compare was named. Give --model to compare its units, or --serial to"),
    (["compare", "phones", "--serial", "none"], "The registry has no result of a unit with the serial number none."),
    (["compare", "phones", "--model", "Model"], "There is 1 unit of Model with a serial number and accepted results"),
    (["export", "phones", "-o", "x.txt"], "x.txt ends in neither .parquet nor .csv."),
    (["add", "phones", "no.json"], ""),
    (["add", "phones", "empty.json"], ""),
    (["add", "phones", "result.json", "--captured", "soon"], ""),
    (["export", "phones", "-o", "no/where.csv"], ""),
]
"""Calls that are wrong, and words of the message."""


def test_messages_say_what_is_wrong_and_nothing_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Registry("phones", new=True).add([made(1, bells())])
    Path("empty.json").write_text("{}")
    Path("result.json").write_bytes(document_bytes(document()))
    Path("refused.json").write_bytes(document_bytes(refused()))
    Path("else").mkdir()
    Path("else/letter.txt").write_text("dear")
    before = sorted(str(path) for path in tmp_path.rglob("*"))
    for words, message in WRONG:
        assert run(*words) == InvalidArgument.exit_status, words
        assert message in " ".join(capsys.readouterr().err.split()), words
        assert sorted(str(path) for path in tmp_path.rglob("*")) == before, words


def test_rows_know_what_they_must() -> None:
    """The words of the issue: verdict, unit, scores, lamp, hashes, times, place, curves and bands."""
    assert {
        "status", "reason", "make", "model", "serial", "delta_e00", "evidence", "odds", "lamps", "inputs", "onnx",
        "captured", "added", "place", *CHANNELS, *(f"{colour}_std" for colour in CHANNELS),
    } <= set(columns(Row))  # fmt: skip
    assert not [name for name in columns(Row) if "gps" in name or "photo" in name]
    assert plain().key
