"""A manifest into the registry: streamed, resumed without reading, duplicates known, the poisonous put aside."""

import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf import cli
from camssf.errors import InvalidArgument
from tests.support.captures import photos
from tests.support.processes import SEARCH

pytest.importorskip("duckdb", reason="duckdb is not here")

from camssf.documents.document import Document, read_document
from camssf.photo.read.unit import Unit
from camssf_fleet import archive, batch, pools, processes
from camssf_fleet.archive import task_of
from camssf_fleet.batch import inputs_hash
from camssf_fleet.inputs import basis_hash, file_hash
from camssf_fleet.manifest import Job, Manifest
from camssf_fleet.outcome import Outcome, Summary
from camssf_fleet.record_queries import connection
from camssf_fleet.records import Row, columns
from camssf_fleet.registry import Registry

HEADER = "name,photo,lamp,white,dark,chart,serial,site"
ROOT = Path(__file__).parents[2]
LAST = "added = (SELECT max(added) FROM jobs)"


def stub(job: Job, folder: Path) -> Outcome:
    """In place of the calibration, in the other process: what the photo says is what happens."""
    photo = Path(job.photos[0])
    text = photo.read_text()
    with open(photo.parent / "visits", "a") as file:
        file.write(f"{job.name}\n")
    if text.startswith("dies"):
        os.kill(os.getpid(), signal.SIGKILL)
    if text == "bug":
        raise RuntimeError("two\nlines")
    if text == "wrong":
        raise InvalidArgument("The lamp is none.", "Name one.")
    document = json.loads((photo.parent / f"template-{text == 'refused'}.json").read_text("utf-8"))
    capture = document["capture"]
    photo_of = capture.get("unfinished") or capture["shots"][0]
    photo_of["photo"]["model"] = text
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").write_text(json.dumps(document), "utf-8")
    return Outcome(job.name, document["verdict"]["status"])


def in_this_process(jobs: Iterator[Job], work: pools.Work, count: int, recorder: pools.Recorder) -> None:
    """In place of `run_processes` where processes are not what is tested."""
    for job in jobs:
        recorder.add(job, work(job))
        recorder.update()


def slow(job: Job, folder: Path) -> Outcome:
    time.sleep(0.4)
    return stub(job, folder)


@pytest.fixture(scope="module")
def templates() -> dict[str, str]:
    return made_templates()


def made_templates() -> dict[str, str]:
    """Of an answer and of a refusal."""
    from tests.support.documents import document, text_of, unplaced

    return {"template-False.json": text_of(document()), "template-True.json": text_of(unplaced())}


class Desk:
    """A folder with photos, a manifest, an archive and a registry."""

    def __init__(self, home: Path, templates: dict[str, str]) -> None:
        self.home = home
        for name, text in templates.items():
            (home / name).write_text(text, "utf-8")

    def write(self, rows: list[str], photos: dict[str, str], header: str = HEADER) -> None:
        for name, text in photos.items():
            (self.home / name).write_text(text)
        (self.home / "manifest.csv").write_text("\n".join([header, *rows]) + "\n", "utf-8")

    def run(self, *, processes: bool = False, **more: Any) -> Summary:
        manifest = Manifest(self.home / "manifest.csv", **more.pop("options", {}))
        registry = Registry(self.home / "phones", new=True, correct=more.pop("correct", False))
        out = self.home / more.pop("out", "out")
        with pytest.MonkeyPatch.context() as patched:
            if not processes:
                patched.setattr(batch, "run_processes", in_this_process)
            return batch.run_batch(manifest, out, registry, **{"workers": 1, "work": stub, **more})

    def rows(self, columns: str = "name, model, status") -> list[dict[str, Any]]:
        return Registry(self.home / "phones").query(f"SELECT {columns} FROM rows ORDER BY name")

    def tasks(self) -> dict[str, str]:
        found = Registry(self.home / "phones").query("SELECT name, status FROM jobs ORDER BY added")
        return {each["name"]: each["status"] for each in found}

    def visits(self) -> Counter[str]:
        file = self.home / "visits"
        return Counter(file.read_text().split()) if file.exists() else Counter()


@pytest.fixture
def desk(tmp_path: Path, templates: dict[str, str]) -> Desk:
    return Desk(tmp_path, templates)


# The manifest


def jobs(path: Path) -> list[Job]:
    return list(Manifest(path))


def test_streamed_or_read_at_once_it_is_the_same(tmp_path: Path) -> None:
    for data in (
        b"name,photo,lamp,white,dark,chart\ncam,day.dng,D:5500,wd.dng,,nano24:mine.csv\ncam,b.dng,A,none,,\nx,y,D55,,,\n",
        "\ufeffName;Photo;Lamp\r\ncam;a.dng;D55\r\n\r\n".encode(),
        b'name,photo,lamp\n"a, ""b""\nc",p,D55\n',
        b"name,photo,lamp\nlong,a,D55,x\nno photo,,D55\n,a,D55\n",
        b"name,photo,lamp\rcam,a.dng,D55\rother,b.dng,\r",
        b"name,photo,lamp\rlong,a,D55,x\r\nb,c,A\n",
        b'"name\n",photo,lamp\ncam,a.dng,D55\nlong,a,D55,x\n',
        "name,photo,lamp\nk\u00e4mera,\u00fc.dng,\n".encode(),
    ):
        (tmp_path / "mine.csv").write_text("")
        manifest = tmp_path / "manifest.csv"
        manifest.write_bytes(data)
        for mine, other in zip(jobs(manifest), Manifest(manifest).read_all(), strict=True):
            assert mine == replace(other, folder="")


def test_parquet_and_further_columns(tmp_path: Path) -> None:
    text = (
        "name,photo,lamp,serial,captured,site,n\ncam,a.dng,D55,S1,2026-01-02,lab,1\ncam,b.dng,A,S1,2026-01-02,lab,1\n"
    )
    (tmp_path / "m.csv").write_text(text + "other,c.dng,A,,,,\n")
    with connection() as con:
        con.execute(
            f"COPY (SELECT * FROM read_csv('{tmp_path}/m.csv', all_varchar = true)) TO '{tmp_path}/m.parquet' "
            "(FORMAT parquet)"
        )
    one, two = jobs(tmp_path / "m.csv"), jobs(tmp_path / "m.parquet")
    assert one == two
    assert (one[0].unit, one[0].captured) == (Unit(serial="S1"), "2026-01-02")
    assert one[0].extra == (("site", "lab"), ("n", "1"))
    assert len(one[0].photos) == 2
    assert (one[1].unit, one[1].captured, one[1].extra) == (Unit(), "", ())
    with pytest.raises(InvalidArgument, match="an unknown column"):  # without a registry they have no place
        Manifest(tmp_path / "m.parquet").read_all()


def test_parquet_of_any_columns_and_in_capitals(tmp_path: Path) -> None:
    """Times with a zone need no further library; whole numbers and truths are as their text."""
    file = tmp_path / "P.PARQUET"
    with connection() as con:
        con.execute(
            "COPY (SELECT 'cam' AS Name, 'a.dng' AS photo, NULL AS lamp, TIMESTAMPTZ '2026-01-02 10:00:00+01' AS "
            f"captured, DATE '2026-01-02' AS day, 7 AS serial, true AS tripod) TO '{file}' (FORMAT parquet)"
        )
    (found,) = jobs(file)
    assert not found.fault
    assert datetime.fromisoformat(found.captured) == datetime(2026, 1, 2, 9, tzinfo=UTC)
    assert (found.unit.serial, found.lamps) == ("7", ("auto",))
    assert dict(found.extra) == {"day": "2026-01-02", "tripod": "true"}


def test_how_much_was_read_is_known_of_any_text(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_bytes("name,photo,lamp\r\nk\u00e4m,\u00fc,\r\n".encode())
    manifest = Manifest(tmp_path / "m.csv")
    assert len(list(manifest)) == 1
    assert manifest.done == 1.0


def test_a_manifest_without_sense(tmp_path: Path) -> None:
    for name, content, words in (
        ("m.csv", None, "cannot be read"), ("m.csv", b"", "lacks the column"), ("m.csv", b"name,photo\n", "lamp"),
        ("m.csv", b"name,photo,lamp\n", "no rows"), ("m.csv", b"name,photo,lamp,lamp\n", "doubled"),
        ("m.csv", b"name,photo,lamp\n\xff\xfe,x,y\n", "cannot be read"), ("m.parquet", None, "cannot be read"),
        ("m.csv", b"name,photo,lamp\n" + b"x" * 2_000_000, "too long"),
        ("m.parquet", b"PAR1xPAR1", "cannot be read"),
    ):  # fmt: skip
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(InvalidArgument, match=words):
            jobs(tmp_path / name)


def test_faults_of_rows(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text(
        "name,photo,lamp,captured\na,x,D55,\nb,x,D55,soon\na,y,D55,\nc,x,D55,,,\n,x,D55,\nd,,D55,\ne,x,D55,\n"
    )
    found = [job.fault for job in jobs(tmp_path / "m.csv")]
    for fault, words in zip(
        found, ("", "no time", "stand together", "more fields", "no name", "no photo", ""), strict=True
    ):
        assert (words in fault) if words else not fault


def test_a_task_is_known_by_what_it_would_be_made_from(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("1")
    (tmp_path / "lamp.csv").write_text("1")
    (tmp_path / "m.csv").write_text("name,photo,lamp,chart\ncam,a,lamp.csv,nano24:lamp.csv\n")

    def task(**options: str) -> str:
        (found,) = Manifest(tmp_path / "m.csv", **options)
        return task_of(found, None)

    seen = [task()]
    assert task() == seen[0]
    seen.append(task(basis="gaussian"))
    (tmp_path / "a").write_text("12")
    seen.append(task())
    os.utime(tmp_path / "lamp.csv", (1, 1))
    seen.append(task())
    (tmp_path / "m.csv").write_text("name,photo,lamp,chart\ncam,a,lamp.csv,\n")
    seen.append(task())
    (tmp_path / "m.csv").write_text("name,photo,lamp,chart,serial\ncam,a,lamp.csv,,9\n")
    seen.append(task())
    assert len(set(seen)) == len(seen)


@pytest.mark.full
@pytest.mark.skipif(sys.platform != "linux", reason="in other units elsewhere")
def test_many_rows_are_streamed(tmp_path: Path) -> None:
    """The first job at once; the names alone are remembered."""
    with open(tmp_path / "m.csv", "w") as file:
        file.write("name,photo,lamp\n")
        file.writelines(f"cam{i},p{i}.dng,D55\n" for i in range(200_000))
    manifest = Manifest(tmp_path / "m.csv")
    next(iter(manifest))
    assert manifest.done < 1e-4
    code = (
        "import resource, sys\nfrom itertools import islice\nfrom camssf_fleet.manifest import Manifest\n"
        "def kilobytes(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        f"rows = iter(Manifest({str(tmp_path / 'm.csv')!r}))\n"
        "next(rows); before = kilobytes(); n = sum(1 for _ in islice(rows, 20_000)); print(n, kilobytes() - before)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": SEARCH},
        capture_output=True,
        text=True,
        check=True,
    )
    count, held = map(int, done.stdout.split())
    assert count == 20_000
    assert held < 4_000  # kB: 200 MB for a million names


# The work


def test_it_goes_on_and_resumes_without_reading(desk: Desk) -> None:
    rows = ["good,a,D55,,,,S1,lab", "bug,b,D55,,,,,", "wrong,w,D55,,,,,", "refused,d,D55,,,,,", "lost,none,D55,,,,,"]
    desk.write([*rows, "again,a2,D55,,,,S1,lab", "fault,,D55,,,,,"],
               {"a": "Phone", "b": "bug", "w": "wrong", "d": "refused", "a2": "Phone"})  # fmt: skip
    first = desk.run()
    expected = {"good": "doubtful", "bug": "failed", "wrong": "refused", "refused": "refused", "lost": "failed"}
    assert desk.tasks() == expected | {"again": "doubtful", "fault": "refused"}
    assert (first.total, first.resumed, first.duplicates, first.failed) == (7, 0, 1, 5)
    assert [each["name"] for each in desk.rows()] == ["again", "refused"]  # what was said last
    (good, _) = desk.rows("name, serial, extra, place, made_from, key")
    assert (good["serial"], json.loads(good["extra"])) == ("S1", {"site": "lab"})
    assert (desk.home / "phones" / good["place"]).is_file()
    assert desk.visits() == {"good": 1, "bug": 1, "wrong": 1, "refused": 1}  # `again` is a duplicate, by its contents
    second = desk.run()
    assert (second.resumed, second.duplicates, second.total) == (3, 0, 7)
    assert desk.visits() == {"good": 1, "bug": 2, "wrong": 2, "refused": 1}
    assert second.by_status == first.by_status
    assert second.by_model == first.by_model
    assert {model.split()[-1]: dict(each) for model, each in first.by_model.items() if model} == {
        "Phone": {"doubtful": 2}, "refused": {"refused": 1},
    }  # fmt: skip
    assert first.by_model[""] == {"failed": 2, "refused": 2}
    (desk.home / "a").write_text("Phone 2")
    third = desk.run()
    assert (third.resumed, desk.visits()["good"]) == (2, 2)
    assert sorted(each["model"] for each in desk.rows()) == ["Phone", "Phone 2", "refused"]


def test_a_damaged_result_in_the_archive_is_made_anew(desk: Desk) -> None:
    desk.write(["one,a,D55,,,,,"], {"a": "Phone"})
    desk.run()
    (file,) = (desk.home / "out").glob("*/*/result.json")
    whole = file.read_bytes()
    file.write_bytes(whole[:1000])
    shutil.rmtree(desk.home / "phones")
    assert desk.run().by_status == {"doubtful": 1}
    assert file.read_bytes() == whole
    assert desk.visits() == {"one": 2}
    shutil.rmtree(desk.home / "phones")
    assert desk.run().by_status == {"doubtful": 1}
    assert desk.visits() == {"one": 2}  # the registry made again from the archive
    assert len(desk.rows()) == 1


def test_a_correction_of_the_manifest_reaches_the_registry(desk: Desk) -> None:
    """What contradicts the registry is refused until it is asked for; nothing is emptied, or calibrated for it."""
    header = "name,photo,lamp,serial,captured,lens,site"
    desk.write(["cam,a,D55,S1,2026-01-02T10:00,50mm,lab"], {"a": "Phone"}, header)
    desk.run()
    for words, expected in (
        ("S2,2026-01-03T10:00,50mm,lab", {"serial": "S2", "captured": datetime(2026, 1, 3, 10, tzinfo=UTC)}),
        ("S2,2026-01-03T10:00,35mm,lab", {"lens": "35mm"}),
        ("S2,,,roof", {"captured": datetime(2026, 1, 3, 10, tzinfo=UTC), "lens": "35mm",
                       "extra": '{"site": "roof"}'}),
    ):  # fmt: skip
        desk.write([f"cam,a,D55,{words}"], {}, header)
        (before,) = desk.rows("*")
        for _ in range(2):  # it is tried again, not forgotten
            assert desk.run().by_code == {"invalid_argument": 1}
        (stored_row,) = Registry(desk.home / "phones").query(f"SELECT reason FROM jobs WHERE {LAST}")
        assert "What is given of the result" in stored_row["reason"]
        assert desk.rows("*") == [before]
        found = desk.run(correct=True)
        assert (found.total, found.resumed, found.duplicates, found.failed) == (1, 0, 0, 0)
        (row,) = desk.rows("*")
        assert {name: row[name] for name in expected} == expected
    assert desk.run().resumed == 1
    desk.write(["camera,a,D55,S2,,,roof"], {}, header)
    desk.run()
    assert desk.rows("name") == [{"name": "camera"}]
    assert desk.visits() == {"cam": 1}


def test_a_correction_wins_against_a_clock_that_was_years_ahead(desk: Desk) -> None:
    desk.write(["cam,a,D55,,,,S1,"], {"a": "Phone"})
    desk.run()
    registry = Registry(desk.home / "phones")
    (now,) = desk.rows(", ".join(columns(Row)))
    now = Row(**{name: tuple(v) if isinstance(v, list) else v for name, v in now.items()})
    Registry(registry.folder, correct=True).add([replace(now, serial="S0", added=now.added + timedelta(days=1500))])
    desk.write(["cam,a,D55,,,,S2,"], {})
    desk.run(correct=True)
    assert desk.rows("serial") == [{"serial": "S2"}]


def test_another_basis_in_the_same_file_is_noticed(desk: Desk) -> None:
    basis = desk.home / "mine.npz"
    basis.write_bytes(b"one")
    desk.write(["cam,a,D55,,,,,"], {"a": "Phone"})
    how = {"options": {"basis": str(basis)}}
    assert desk.run(**how).resumed == 0
    assert desk.run(**how).resumed == 1
    os.utime(basis, (1, 1))
    assert desk.run(**how).resumed == 0  # it may be another; its contents say that it is not
    assert desk.visits() == {"cam": 1}
    basis.write_bytes(b"two")
    assert desk.run(**how).resumed == 0
    assert desk.visits() == {"cam": 2}
    other = desk.home / "elsewhere"
    other.mkdir()
    shutil.copy2(basis, other)
    desk.run(options={"basis": str(other / "mine.npz")})
    assert desk.visits() == {"cam": 2}


def test_a_process_that_lives_on_reads_the_new_basis(tmp_path: Path) -> None:
    """As a cluster's worker does."""
    from camssf.recovery.basis import read_basis

    file, shipped = tmp_path / "mine.npz", [read_basis(name) for name in ("phones", "cameras")]
    for number, basis in enumerate(shipped):
        np.savez(file, mean=basis.mean[:, ::10], dictionary=basis.dictionary[..., ::10, :], source="s")
        os.utime(file, (number, number))
        assert basis_hash(str(file)) == file_hash(file)
        assert np.allclose(read_basis(str(file)).mean, basis.mean)
    assert basis_hash("phones") is basis_hash("auto") is basis_hash("nowhere.npz") is None


def test_a_cluster_is_told_where_the_basis_lies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker may stand elsewhere; what a result is named after is the same."""
    monkeypatch.chdir(tmp_path)
    for name in ("mine.npz", "p"):
        Path(name).write_bytes(b"one")
    Path("m.csv").write_text("name,photo,lamp\ncam,p,D55\n")
    (job,) = Manifest("m.csv", basis="mine.npz")
    (sent,) = Manifest("m.csv", basis="mine.npz").absolute()
    assert sent.photos == (str(tmp_path / "p"),)
    assert sent.basis == str(tmp_path / "mine.npz")
    assert inputs_hash(sent) == inputs_hash(job)
    (job,) = Manifest("m.csv").absolute()
    assert job.basis == "auto"


def test_a_basis_is_looked_at_once_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mine.npz").write_bytes(b"one")
    (tmp_path / "m.csv").write_text("name,photo,lamp\n" + "".join(f"c{i},p,D55\n" for i in range(50)))
    looked: list[Path] = []
    monkeypatch.setattr(archive, "stamp", lambda path: looked.append(path))
    manifest = Manifest(tmp_path / "m.csv", basis=str(tmp_path / "mine.npz"))
    registry, place = Registry(tmp_path / "phones", new=True), archive.Archive(tmp_path, tmp_path)
    assert len(list(archive.unfinished(manifest, registry, Summary(), place))) == 50
    assert looked == [tmp_path / "mine.npz"]


def test_a_picture_s_sidecar_is_part_of_it(desk: Desk) -> None:
    desk.write(["cam,a.png,D55,,,,,"], {"a.png": "Phone", "a.png.json": '{"black": 1}'})
    desk.run()
    assert desk.run().resumed == 1
    (desk.home / "a.png.json").write_text('{"black": 2}')
    assert desk.run().resumed == 0
    assert desk.visits() == {"cam": 2}
    (desk.home / "a.png.json").unlink()
    assert desk.run().resumed == 0
    assert desk.visits() == {"cam": 3}


def test_done_is_what_lies_in_this_archive(desk: Desk) -> None:
    """A result that is gone, another archive: it is done again, for those alone."""
    desk.write(["one,a,D55,,,,,", "two,b,D55,,,,,"], {"a": "Phone a", "b": "Phone b"})
    desk.run()
    assert desk.run().resumed == 2
    places = desk.rows("place")
    shutil.rmtree((desk.home / "phones" / places[0]["place"]).parent)
    assert desk.run().resumed == 1
    assert desk.visits() == {"one": 2, "two": 1}
    assert desk.run(out="other").resumed == 0
    assert len(list((desk.home / "other").glob("*/*/result.json"))) == 2
    assert desk.visits() == {"one": 3, "two": 2}
    assert (desk.run(out="other").resumed, desk.run().resumed) == (2, 2)
    for row in desk.rows("place"):
        assert row["place"].startswith("../other/")
        assert (desk.home / "phones" / row["place"]).is_file()


def test_a_place_is_seen_from_the_registry(desk: Desk, capsys: pytest.CaptureFixture[str]) -> None:
    """The same words from a batch and from `registry add`; through a link, too."""
    desk.write(["one,a,D55,,,,,"], {"a": "Phone"})
    desk.run()
    (row,) = desk.rows("place")
    result = (desk.home / "phones" / row["place"]).resolve()
    assert cli.main(["registry", "add", str(desk.home / "others"), str(result)]) == 0
    assert Registry(desk.home / "others").query("SELECT place FROM rows") == [row]
    (desk.home / "far" / "away").mkdir(parents=True)
    try:
        (desk.home / "link").symlink_to(desk.home / "far" / "away")
    except OSError:
        pytest.skip("no links here")
    assert cli.main(["registry", "add", str(desk.home / "link"), str(result)]) == 0
    (linked,) = Registry(desk.home / "link").query("SELECT place FROM rows")
    assert (desk.home / "link" / linked["place"]).is_file()
    capsys.readouterr()


def test_a_done_run_begins_no_process(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    desk.write(["one,a,D55,,,,,"], {"a": "Phone"})
    desk.run()
    monkeypatch.setattr(processes, "ProcessPoolExecutor", None)
    assert desk.run(processes=True).resumed == 1


def test_the_poisonous_is_put_aside(desk: Desk) -> None:
    """It takes another along once, and is tried alone; then never again until its file is another."""
    desk.write([f"{name},{name},D55,,,,," for name in "xb"], {"x": "dies", "b": "Phone b"})
    found = desk.run(processes=True)
    assert (found.by_status["failed"], found.total) == (1, 2)
    assert desk.tasks()["x"] == "failed"
    assert len(desk.rows()) == 1
    deaths = desk.visits()["x"]
    assert deaths == pools.DEATHS
    again = desk.run(processes=True)
    assert (again.resumed, again.by_status["failed"], desk.visits()["x"]) == (2, 1, deaths)
    (desk.home / "x").write_text("Phone x, healed")
    assert desk.run().by_status["failed"] == 0


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
def test_a_run_that_is_killed_is_taken_up(desk: Desk) -> None:
    """What was in the archive and not yet in the registry is not done again."""
    desk.write([f"c{i},p{i},D55,,,,," for i in range(12)], {f"p{i}": f"Phone {i}" for i in range(12)})
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
        "from pathlib import Path\nfrom tests.fleet.test_stream import *\n"
        f"if __name__ == '__main__':\n desk = Desk.__new__(Desk); desk.home = Path({str(desk.home)!r})\n"
        " desk.run(work=slow, processes=True)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": SEARCH}) as running:
        deadline = time.monotonic() + 120
        while sum(desk.visits().values()) < 5 and time.monotonic() < deadline:
            time.sleep(0.05)
        running.kill()
    before = desk.visits()
    assert 5 <= sum(before.values()) < 12
    found = desk.run()
    assert found.total == 12
    assert len(desk.rows()) == 12
    assert max(desk.visits().values()) <= 2
    assert sum(count - 1 for count in desk.visits().values()) <= 1  # the one that was under way


def test_the_registry_s_full_disk_is_said(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    desk.write(["one,a,D55,,,,,"], {"a": "Phone"})

    def full(self: Registry, *rows: Any, **more: Any) -> None:
        raise InvalidArgument("No space left.", "Free some.")

    with monkeypatch.context() as patched:
        patched.setattr(Registry, "append", full)
        with pytest.raises(InvalidArgument, match="No space"):
            desk.run()
    assert desk.run().by_status["doubtful"] == 1
    assert desk.visits() == {"one": 1}  # its result was in the archive


def test_progress_tells_rate_and_time(desk: Desk) -> None:
    desk.write([f"c{i},p{i},D55,,,,," for i in range(5)], {f"p{i}": f"Phone {i}" for i in range(5)})
    said: list[tuple[str, float]] = []
    desk.run(progress=lambda words, part: said.append((words, part)))
    assert said[-1][0].startswith("5 done, ")
    assert said[-1][1] == 1.0


@pytest.mark.full
def test_the_row_of_a_job_is_that_of_its_file(tmp_path: Path) -> None:
    """A worker does not read the document that it has just written."""
    photo = photos().shots[0].chart
    job = Job("one", (str(photo),), ("D55",), (None,), (None,), "classic24", unit=Unit(serial="S1"))
    outcome = batch.calibrate_into(job, tmp_path, pages=False)
    file = tmp_path / archive.RESULT_FILE
    stored = archive.row_of(job, file.read_bytes(), read_document(file, Document))
    assert outcome.row is not None
    assert replace(outcome.row, added=stored.added) == stored
    assert (stored.serial, stored.model) == ("S1", "Nikon 5100 (NPL)")
    missing = batch.calibrate_into(replace(job, photos=("none.dng",)), tmp_path / "none", pages=False)
    assert (missing.status, missing.code) == ("refused", "unreadable_raw")
    assert missing.row is not None


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="mallopt is glibc's")
def test_a_job_s_memory_is_kept_for_the_next(tmp_path: Path) -> None:
    """As in the worker of a Dask nanny, which lets each freed array go back to the system."""
    code = (
        "import resource, numpy as np\nfrom camssf_fleet.memory import keep_memory\n"
        "def faults():\n before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt\n"
        " for _ in range(50): np.ones(1_000_000)\n"
        " return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before\n"
        "first = faults(); keep_memory(); faults(); print(first, faults())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"MALLOC_TRIM_THRESHOLD_": "65536"}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    before, after = map(int, done.stdout.split())
    assert after < before / 10


@pytest.mark.full
def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A real capture, its twin under another name, and one that is no photo."""
    monkeypatch.chdir(tmp_path)
    Path("shots").mkdir()
    shutil.copy(photos().shots[0].chart, "shots/chart.dng")
    Path("shots/twin.dng").write_bytes(Path("shots/chart.dng").read_bytes())
    Path("shots/none.dng").write_text("no photo")
    Path("m.csv").write_text(
        "name,photo,lamp,serial\na,shots/chart.dng,D55,S1\nb,shots/twin.dng,D55,S1\nc,shots/none.dng,A,\n"
    )
    capsys.readouterr()
    words = ["batch", "m.csv", "-o", "archive", "--registry", "phones", "--workers", "1"]
    assert cli.main(words) == cli.BATCH_FAILED
    document = json.loads(capsys.readouterr().out)
    assert (document["total"], document["duplicates"], document["by_status"]["refused"]) == (3, 1, 1)
    (row,) = Registry("phones").query("SELECT * FROM rows WHERE status <> 'refused'")
    assert (row["serial"], row["model"]) == ("S1", "Nikon 5100 (NPL)")
    assert [path.name for path in (Path("phones") / row["place"]).parent.iterdir()] == ["result.json"]
    assert cli.main(words) == cli.BATCH_FAILED
    assert json.loads(capsys.readouterr().out)["resumed"] == 3
    assert cli.main(["batch", "m.csv", "-o", "archive", "--correct"]) == InvalidArgument.exit_status
