"""The registry: a row a result, which adds up in any order, listed, corrected, deleted, and read by others."""

import json
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest

from camssf.documents.document import document_bytes
from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS
from camssf.photo.read.unit import Unit
from camssf_fleet import record_files
from camssf_fleet.record_queries import all_records, query_of
from camssf_fleet.records import COLUMNS, STRIDE, Origin, Row, columns, row
from camssf_fleet.registry import Deleted, Registry, Wanted, _plain
from camssf_fleet.verification import verify
from tests.support.desk import Desk
from tests.support.documents import document
from tests.support.registries import START, bells, correct, ended, keys, made


def test_a_result_s_row_comes_back_as_it_was(one: Registry) -> None:
    """But for its photos' names, which may tell the place and the hour: it has their hashes."""
    whole = document("D55", "A")
    unit = Unit(camera_id="2", serial="A1", lens="24 mm", focal_length=24.7, aperture=1.8)
    origin = Origin(unit, "2026-11-20T10:00:00+01:00", "cam", "m" * 64, "p" * 32, "x/result.json", {"site": "Ω '\";"})
    mine = row(document_bytes(whole), whole, origin)
    one.add([mine])
    (stored,) = one.query("SELECT * FROM rows")
    for name in columns(Row):
        value = getattr(mine, name)
        if name in CHANNELS or name.endswith("_std"):
            curves = getattr(whole.answer.std if "_" in name else whole.answer.curves, name.partition("_")[0])
            assert stored[name] == pytest.approx(curves[::STRIDE], rel=1e-6)
        elif name == "code_covariance":
            assert stored[name] == pytest.approx(whole.answer.code_covariance, rel=1e-6)
        else:
            assert stored[name] == (list(value) if isinstance(value, tuple) else value), name
    assert stored["captured"] == datetime(2026, 11, 20, 9, tzinfo=UTC)
    assert json.loads(stored["extra"]) == {"site": "Ω '\";"}
    assert stored["lamps"] == ["D55", "A"]
    assert sorted(stored["inputs"]) == sorted(whole.capture.hashes.values())
    assert whole.capture.photos[0].name not in str({k: v for k, v in stored.items() if k != "reason"})


@pytest.mark.full
def test_the_same_result_twice_is_there_once_and_a_correction_counts(one: Registry) -> None:
    one.add([made(1), made(2)])
    files = one.files.sizes()
    one.add([made(2, added=START + timedelta(days=9)), made(1)])
    assert one.files.sizes() == files, "nothing new, no file"
    correct(one, made(1, serial="B2", added=START - timedelta(days=1500)), made(3), made(3, serial="C3"))
    for _ in range(2):
        assert len(keys(one)) == 3
        assert [found["key"][-1] for found in one.listing(Wanted(Unit(serial="B2")))] == ["1"]
        assert [found["key"][-1] for found in one.listing(Wanted(Unit(serial="C3")))] == ["3"]
        assert {found["status"] for found in one.listing()} == {"accepted"}
        one.files.compact()
        assert len(one.files.sizes()) == 1


def test_a_unit_has_one_name_however_it_is_spelt(one: Registry) -> None:
    for serial in (" A\u0301 ", "\u00c1", "A\u0301"):
        one.add([row(document_bytes(document()), document(), Origin(Unit(serial=serial)))])
        assert one.query("SELECT serial FROM rows") == [{"serial": "\u00c1"}]
        assert len(one.listing(Wanted(Unit(serial=serial)))) == 1


def test_sixty_four_small_files_are_gathered(one: Registry, desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """By `add` and by a batch; fewer are left as they are."""
    one.add([made(1)])
    count = len(one.files.sizes())
    assert (one.files.compact(count + 1), len(one.files.sizes())) == (0, count)
    assert (one.files.compact(count), len(one.files.sizes())) == (count, 1)
    asked: list[int] = []
    monkeypatch.setattr(record_files.RecordFiles, "compact", lambda self, least: asked.append(least))
    one.add([made(2)])
    desk.fill(1)
    desk.run()
    assert set(asked) == {64}


@pytest.mark.requirement("R-REGISTRY")
def test_a_folder_may_have_any_name(tmp_path: Path) -> None:
    """`name=value` is a column for other readers of Parquet."""
    one = Registry(tmp_path / "serial=5" / "a[b]*? 'c" / "phones", new=True)
    one.add([made(1, serial="A6")])
    one.add([made(2, serial="A7")])
    for _ in range(2):
        assert one.query("SELECT serial FROM rows ORDER BY key") == [{"serial": "A6"}, {"serial": "A7"}]
        assert verify(one).faults == ()
        one.files.compact()


def test_lists(one: Registry) -> None:
    quote = "Two' OR '1'='1"
    one.add([made(1, model="One"), made(2, model="Two", status="doubtful"), made(3, model="Two", status="refused"),
             made(4, model=quote, serial="", make="Other")])  # fmt: skip
    for wanted, expected in (
        (Wanted(), "4321"), (Wanted(Unit(model="Two")), "32"), (Wanted(Unit(make="Other")), "4"),
        (Wanted(Unit(serial="A1")), "321"), (Wanted(Unit(model="Two"), statuses=("accepted",)), ""),
        (Wanted(statuses=("refused", "doubtful")), "32"), (Wanted(Unit(model=quote)), "4"),
    ):  # fmt: skip
        assert "".join(found["key"][-1] for found in one.listing(wanted)) == expected


@pytest.mark.full
def test_history_says_what_was_said_and_when(one: Registry) -> None:
    one.add([made(1, serial="")])
    one.add([made(1, serial="A7", note="screen replaced", added=START + timedelta(days=1))])
    correct(one, made(1, serial="B2", added=START + timedelta(days=2)))
    for serial in ("A7", "B2"):
        changes = one.history(Unit(serial=serial))
        assert [change.what for change in changes] == [
            "accepted result, make Maker, model Model", "serial set to A7, note set to screen replaced",
            "serial changed from A7 to B2",
        ]  # fmt: skip
    assert changes[1].added == "2026-01-02T00:00:00Z"
    assert "@" in changes[0].added_by
    assert one.history(Unit(serial="nobody")) == []


def by_pandas(folder: Path, wanted: list[str]) -> Any:
    filters = [("kind", "==", "result"), ("model", "==", "Model")]
    pytest.importorskip("pyarrow")
    return pytest.importorskip("pandas").read_parquet(folder, columns=wanted, filters=filters).to_dict("records")


def by_pyarrow(folder: Path, wanted: list[str]) -> Any:
    dataset = pytest.importorskip("pyarrow.dataset")
    of_model = (dataset.field("kind") == "result") & (dataset.field("model") == "Model")
    return dataset.dataset(folder).to_table(columns=wanted, filter=of_model).to_pylist()


def by_polars(folder: Path, wanted: list[str]) -> Any:
    frame = pytest.importorskip("polars").scan_parquet(folder / "*.parquet")
    return frame.filter(kind="result", model="Model").select(wanted).collect().to_dicts()


@pytest.mark.full
@pytest.mark.parametrize("reader", [by_pandas, by_pyarrow, by_polars])
def test_a_program_of_others_reads_it(one: Registry, reader: Any) -> None:
    """As docs/registry.md says: a folder of Parquet files; times with their zone, the curves."""
    captured = datetime(2026, 11, 20, 10, tzinfo=timezone(timedelta(hours=1)))
    one.add([made(1, bells(), captured=captured), made(2, bells(), model="Other")])
    one.add([made(3, bells(), captured=captured)])
    rows = reader(one.folder, ["key", "serial", "captured", "red"])
    first, second = sorted(rows, key=lambda row: str(row["key"]))
    assert (first["serial"], second["serial"], first["captured"]) == ("A1", "A1", captured)
    assert list(first["red"]) == pytest.approx(bells()[0], rel=1e-6)


@pytest.mark.full
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


def test_without_the_library_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(InvalidArgument, match=r"install -e .*\[fleet\]"):
        Registry(tmp_path)


@pytest.mark.full
def test_another_release_has_other_columns(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """An older one lacks `odds`, a newer one has `later` as well: its records stay whole here."""
    records = [_plain(vars(made(number))) | {"kind": "result", "revision": 0} for number in (1, 2, 3)]
    monkeypatch.setattr(record_files, "COLUMNS", {name: kind for name, kind in COLUMNS.items() if name != "odds"})
    one._write([{name: value for name, value in records[0].items() if name != "odds"}], START)
    monkeypatch.setattr(record_files, "COLUMNS", COLUMNS | {"later": "VARCHAR"})
    one._write([record | {"later": word} for record, word in zip(records[1:], "xy", strict=True)], START)
    monkeypatch.undo()
    one.list_records()
    correct(one, made(4, odds=7.0), made(1, serial="B2"), made(2, serial="B2"))
    for _ in range(2):
        assert len(keys(one)) == 4
        assert {found["odds"] for found in one.query("SELECT odds FROM rows")} == {None, 7.0}
        assert one.listing(Wanted(Unit(serial="B2")))[0]["key"] == f"{2:064x}"
        assert verify(one).faults == ()
        later = query_of("SELECT later FROM stored WHERE later <> '' ORDER BY ALL", [])
        assert [found["later"] for found in one.files.ask(later)] == ["x", "y"]
        one.files.compact()


@pytest.mark.full
def test_what_is_silent_empties_nothing_and_what_contradicts_is_refused(one: Registry) -> None:
    full = made(1, bells(), captured=START, lens="50mm", focal_length=24.0, extra='{"site": "lab"}')
    empty = replace(full, serial="", captured=None, lens="", focal_length=None, extra="", make="", model="", red=())
    assert one.add([empty])[0].new
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
