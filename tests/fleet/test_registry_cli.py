"""`camssf registry`: what it prints is a document of its form, and a wrong call changes nothing."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from camssf import cli
from camssf.documents.document import document_bytes
from camssf.errors import InvalidArgument
from camssf_fleet.record_queries import connection
from camssf_fleet.registry import Registry
from tests.fleet.conftest import Said
from tests.support.documents import document
from tests.support.registries import far_off, history, made

WRONG = InvalidArgument.exit_status


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
    with connection() as con:
        set_for_export = "current_setting('threads') = 1 AND NOT current_setting('preserve_insertion_order')"
        assert con.execute(f"SELECT {set_for_export}").fetchone() == (False,)
        sql = f"SELECT count(*) FROM '{tmp_path / 'all.parquet'}' WHERE len(red) = 69"
        assert con.execute(sql).fetchone() == (1,)
    (cells,) = csv.DictReader((tmp_path / "all.csv").read_text("utf-8").splitlines())
    assert cells["serial"] == "'=A1"
    assert "red" not in cells
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
    found = said.document(*words, status=cli.UNDECIDED)
    assert (found["outcome"], found["alarm"], found["doubtful"]) == ("undecided", False, 0)
    (left,) = found["left_out"]
    assert (left["key"], left["captured"], left["why"]) == (f"{50:064x}", "2026-07-20T00:00:00Z", "doubtful")
    assert left["newest"]
    assert left["steps"]["blue centre"] == pytest.approx(11, abs=2)
    message = said(*words, status=cli.UNDECIDED)[1]
    for part in ("2026-07-20T00:00:00Z, doubtful (lamp_unfit: The photo fits", "blue centre +1", "undecided"):
        assert part in message
    found = said.document(*words, "--doubtful", status=cli.PARTED)
    assert (found["outcome"], found["doubtful"], found["left_out"]) == ("drift", 1, [])
    assert "6 results, 1 of them doubtful," in said(*words, "--doubtful", status=cli.PARTED)[1]
