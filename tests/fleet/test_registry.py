"""The registry: a row a result, in any order, listed, corrected, deleted; its commands; read by others."""

import csv
import json
import sys
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest

from camssf import cli
from camssf.documents.document import document_bytes
from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS
from camssf.photo.read.unit import Unit
from camssf_fleet import record_files
from camssf_fleet.record_queries import all_records, connection, query_of
from camssf_fleet.records import COLUMNS, STRIDE, Origin, Row, columns, row
from camssf_fleet.registry import Deleted, Deletion, Registry, Wanted, _plain
from camssf_fleet.verification import verify
from tests.fleet.conftest import Said
from tests.support.desk import Desk
from tests.support.documents import document
from tests.support.registries import START, bells, correct, ended, far_off, history, keys, made

WRONG = InvalidArgument.exit_status


def test_a_result_s_row_comes_back_as_it_was(one: Registry) -> None:
    """But for its photos' names, which may tell the place and the hour: it has their hashes."""
    whole = document("D55", "A")
    unit = Unit(camera_id="2", serial="A1", lens="24 mm", focal_length=24.7, aperture=1.8)
    origin = Origin(unit, "2026-11-20T10:00:00+01:00", "cam", "m" * 64, "p" * 32, "x/result.json", {"site": "Ω '\";"})
    mine = row(document_bytes(whole), whole, origin)
    one.add([mine])
    (stored,) = one.query("SELECT * FROM rows")
    rounded = {"code_covariance": whole.answer.code_covariance}
    for colour in CHANNELS:
        rounded[colour] = getattr(whole.answer.curves, colour)[::STRIDE]
        rounded[f"{colour}_std"] = getattr(whole.answer.std, colour)[::STRIDE]
    for name in columns(Row):
        value = getattr(mine, name)
        exact = list(value) if isinstance(value, tuple) else value
        assert stored[name] == (pytest.approx(rounded[name], rel=1e-6) if name in rounded else exact), name
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
    pandas, _ = pytest.importorskip("pandas"), pytest.importorskip("pyarrow")
    filters = [("kind", "==", "result"), ("model", "==", "Model")]
    return pandas.read_parquet(folder, columns=wanted, filters=filters).to_dict("records")


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
    assert one.delete(Unit(serial="nobody")) == Deletion((), records=0, files=0)
    gone = tuple(Deleted(f"{n:064x}", f"../a/{n}.json") for n in range(3))
    assert one.delete(Unit(serial="PATIENT-7")) == Deletion(gone, records=5, files=3)
    assert [key[-1] for key in keys(one)] == ["8", "9"]
    assert one.query("SELECT name FROM jobs") == [{"name": "x"}]
    assert one.history(Unit(serial="PATIENT-7")) == []
    assert "atient" not in str(one.files.ask(lambda con: list(all_records(con)))).lower()
    for path in one.folder.iterdir():
        assert b"atient" not in path.read_bytes().lower(), path
    assert verify(one).faults == ()
    one.add(mine)
    assert (len(keys(one)), one.delete(Unit(serial="PATIENT-7")).records) == (5, 3)
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
    (added,) = one.add([full])
    assert ", ".join(added.changes) == (
        "make set to Maker, model set to Model, serial set to A1, lens set to 50mm, focal length set to 24.0, "
        "time set to 2026-01-01T00:00:00Z, site set to lab"
    )
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
    (corrected,) = correct(one, replace(full, **changed))
    assert ["changed from" in change for change in corrected.changes] == [True] * len(others)
    correct(one, full)
    with pytest.raises(InvalidArgument, match="serial A in the registry, B given"):  # within one call
        one.add([made(3, serial="A"), made(3, serial="B")])
    one.add([replace(full, focal_length=24.0 * 1.0001)])  # files round it
    old = replace(full, passport="old", passport_ends=START, half_width=0.09)  # an excerpt, which is rounded
    one.add([replace(full, passport="new", passport_ends=START + timedelta(days=1)), old])
    assert one.query("SELECT passport, half_width FROM rows") == [{"passport": "new", "half_width": full.half_width}]
    one.list_records()  # of `append`
    assert verify(one).faults == ()


def test_add_list_export(tmp_path: Path, said: Said) -> None:
    folder, result = tmp_path / "phones", tmp_path / "out" / "result.json"
    result.parent.mkdir()
    result.write_bytes(document_bytes(document()))
    words = ("--serial", "=A1", "--captured", "2026-11-20T10:00:00+01:00")
    for _ in range(2):
        said("add", folder, result, *words)
    out, err = said("list", folder)
    (listed,) = csv.DictReader(out.splitlines())
    assert (listed["serial"], listed["captured"], listed["status"]) == ("'=A1", "2026-11-20T09:00:00Z", "doubtful")
    assert "1 doubtful" in err
    assert "no results" in said("list", folder, "--model", "another")[1]
    assert Registry(folder).query("SELECT place FROM rows") == [{"place": "../out/result.json"}]
    for name in ("all.parquet", "all.csv"):
        said("export", folder, "-o", tmp_path / name)
    settings = "current_setting('threads') = 1 AND NOT current_setting('preserve_insertion_order')"  # of an export
    rows = f"(SELECT count(*) FROM '{tmp_path / 'all.parquet'}' WHERE len(red) = 69)"
    with connection() as con:
        assert con.execute(f"SELECT {settings}, {rows}").fetchone() == (False, 1)
    (cells,) = csv.DictReader((tmp_path / "all.csv").read_text("utf-8").splitlines())
    assert (cells["serial"], "red" in cells) == ("'=A1", False)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["all.csv", "all.parquet", "out", "phones"]


@pytest.mark.full
def test_upkeep(one: Registry, said: Said) -> None:
    one.add([made(1, place="../1.json"), made(2, serial="B2")])
    one.add([made(3, serial="B2")])
    found = said.document("verify", one.folder)
    assert (found["rows"], found["documents_missing"], found["faults"]) == (3, 1, [])
    (head, *_) = found["heads"]
    assert f"head {head}" in said("verify", one.folder, "--head", head)[1]
    for words, status in ((f" {head.upper()} {head[:12]}", 0), ("7" * 64, cli.PARTED), ("7", WRONG)):
        said("verify", one.folder, "--head", words, status=status)
    assert "4 files before, 1 file now" in said("compact", one.folder)[1]
    assert len(said("list", one.folder)[0].splitlines()) == 4
    (change,) = csv.DictReader(said("history", one.folder, "A1")[0].splitlines())
    assert (change["key"], change["what"]) == (f"{1:064x}", "accepted result, make Maker, model Model, serial A1")
    said("history", one.folder, "nobody", status=WRONG)
    deleted = said.document("delete", one.folder, "A1")
    assert deleted["results"] == [{"key": f"{1:064x}", "place": "../1.json"}]
    assert (deleted["records"], deleted["files"]) == (1, 1)
    said("delete", one.folder, "A1", status=WRONG)
    file = Path(next(iter(one.files.sizes())))
    file.write_bytes(file.read_bytes()[:100] + b"!" + file.read_bytes()[101:])
    assert said.document("verify", one.folder, status=cli.PARTED)["faults"]
    assert "damaged" in said("verify", one.folder, status=cli.PARTED)[1]


def test_compare(one: Registry, said: Said) -> None:
    """The status tells an alarm; a unit is named by its number, a model's spread counts what it leaves out."""
    others = [replace(row, key=f"b{row.key[1:]}", serial="B2") for row in history(13, 0)]
    left_out = (far_off(serial="r"), far_off(key="a" * 64, status="refused", red=(), serial=""))
    one.add([*history(13, 6), *others, *left_out])
    drift = ("compare", one.folder, "--serial", "A1")
    assert said.document(*drift, status=cli.PARTED)["alarm"] is True
    assert "red centre" in said(*drift, status=cli.PARTED)[1]
    assert said.document("compare", one.folder, "--serial", "B2")["alarm"] is False
    found = said.document("compare", one.folder, "--model", "Model")
    assert (found["units"], found["left_out"]) == (2, {"doubtful": 1, "refused": 1})
    assert "left out: 1 doubtful, 1 refused" in said("compare", one.folder, "--model", "Model")[1]


def test_a_newest_result_that_was_left_out_is_not_no_drift(one: Registry, said: Said) -> None:
    one.add([*history(5, 0), far_off()])
    words = ("compare", one.folder, "--serial", "A1")
    printed = said.document(*words, status=cli.UNDECIDED)
    assert (printed["outcome"], printed["alarm"], printed["doubtful"]) == ("undecided", False, 0)
    (left,) = printed["left_out"]
    assert (left["key"], left["captured"]) == (f"{50:064x}", "2026-07-20T00:00:00Z")
    assert (left["why"], left["newest"]) == ("doubtful", True)
    assert left["steps"]["blue centre"] == pytest.approx(11, abs=2)
    message = said(*words, status=cli.UNDECIDED)[1]
    for part in ("2026-07-20T00:00:00Z, doubtful (lamp_unfit: The photo fits", "blue centre +1", "undecided"):
        assert part in message
    printed = said.document(*words, "--doubtful", status=cli.PARTED)
    assert (printed["outcome"], printed["doubtful"], printed["left_out"]) == ("drift", 1, [])
    assert "6 results, 1 of them doubtful," in said(*words, "--doubtful", status=cli.PARTED)[1]
