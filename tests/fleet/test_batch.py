"""Batches into folders and into the registry: a bad row stops no other, nothing is done twice, a kill is taken up."""

import csv
import io
import json
import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from concurrent.futures import Future
from contextlib import nullcontext
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from camssf import cli
from camssf.errors import ChartNotFound, InvalidArgument
from camssf.files import ASIDE, NEW
from camssf.places import write_place
from camssf.recovery.basis import read_basis
from camssf.report.build import NAMES
from camssf.result import refused
from camssf_fleet import batch, pools
from camssf_fleet.batch import MARK, calibrate_into
from camssf_fleet.inputs import basis_hash, file_hash
from camssf_fleet.manifest import Job, Manifest
from camssf_fleet.outcome import Outcome
from camssf_fleet.recorder import summary_csv
from camssf_fleet.registry import Registry
from tests.support.captures import photos
from tests.support.desk import Desk, slow
from tests.support.failures import raising
from tests.support.processes import until

pytestmark = pytest.mark.full  # pools of processes

ONE, ONE_ROW = ["one,a,D55,,,"], ["one,a,D55,,,,,"]
"""Without and with a registry."""


@pytest.fixture
def pages(tmp_path: Path) -> Desk:
    return Desk(tmp_path, "name,photo,lamp,white,dark,chart")


def test_it_resumes(pages: Desk) -> None:
    photos = {"a": "1", "b": "2", "w": "w", "c": "refused"}
    pages.write(["one,a,D55,,,", "two,b,D55,w,,", "bad,c,D55,,,"], photos)

    def again(**options: str) -> list[bool]:
        return [outcome.resumed for outcome in pages.run_pages(options=options)]

    assert again() == [False, False, False]
    table = list(csv.DictReader((pages.out / "summary.csv").read_text("utf-8").splitlines()))
    codes = [("one", "overexposed"), ("two", "overexposed"), ("bad", "chart_not_found")]
    assert [(row["name"], row["code"]) for row in table] == codes
    left = pages.out / "one" / f"{ASIDE}00000000" / NEW  # by a run that was killed
    left.mkdir(parents=True)
    (left / "report.html").write_text("half")
    assert again() == [True, True, False]  # what was refused is tried again
    assert pages.visits() == {"one": 1, "two": 1, "bad": 2}
    mark = json.loads((pages.out / "one" / MARK).read_text("utf-8"))
    assert (mark["format"], len(mark["made_from"])) == ("camssf-batch/1", 64)
    assert not list(pages.out.rglob(".camssf-*"))

    (pages.home / "w").write_text("another white frame")
    assert again() == [True, False, False]
    pages.manifest.write_text(pages.manifest.read_text().replace("one,a,D55", "one,a,A"))
    assert again() == [False, True, False]
    assert again(basis="gaussian") == [False, False, False]
    assert again(basis="gaussian") == [True, True, False]
    (pages.out / "one" / "result.json").unlink()
    (pages.out / "two" / MARK).write_text("not JSON")
    assert again(basis="gaussian") == [False, False, False]


def test_a_refused_capture_replaces_no_result_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its photo is missing, or another now."""
    (tmp_path / "result.json").write_text('{"verdict": {"status": "accepted"}}')
    (tmp_path / "ssf.csv").write_text("curves")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    job = Job("one", (str(tmp_path / "typo.dng"),), ("D55",), (None,), (None,), "classic24")
    outcome = calibrate_into(job, tmp_path)
    assert (outcome.status, outcome.code) == ("refused", "unreadable_raw")
    assert outcome.reason.endswith("The earlier result of this name was kept as it is.")
    monkeypatch.setattr(batch, "attempt_job", lambda _: refused(ChartNotFound("No chart.", "Take one.")))
    outcome = calibrate_into(job, tmp_path)
    assert outcome.reason == "No chart. Take one. The earlier result of this name was kept as it is."
    assert sorted(path.name for path in (tmp_path / "refused").iterdir()) == ["report.html", "result.json"]
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


@pytest.mark.parametrize(("meanwhile", "processes"), [
    ("refused", False), ("wrong", False), ("bug", False), ("dies late", True),
])  # fmt: skip
def test_what_came_between_is_not_forgotten(pages: Desk, meanwhile: str, processes: bool) -> None:
    """Good, then something else in the same folder, then good again: the first result is not there any more."""
    pages.write(ONE, {"a": "fine", "b": meanwhile})
    assert [outcome.status for outcome in pages.run_pages()] == ["doubtful"]
    (pages.home / "other.csv").write_text(pages.manifest.read_text().replace("one,a", "one,b"))
    (between,) = pages.run_pages(manifest="other.csv", processes=processes)
    assert (between.ok, (pages.out / "one" / MARK).exists()) == (False, False)
    (again,) = pages.run_pages()
    assert (again.status, again.resumed) == ("doubtful", False)
    assert json.loads((pages.out / "one" / "result.json").read_text())["verdict"]["status"] == "doubtful"
    assert [outcome.resumed for outcome in pages.run_pages()] == [True]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("gone", [True, False], ids=["gone", "as long as before"])
def test_a_result_that_is_not_whole_is_done_again(pages: Desk, name: str, gone: bool) -> None:
    pages.write(ONE, {"a": "fine"})
    pages.run_pages()
    file = pages.out / "one" / name
    whole = file.read_bytes()
    file.unlink() if gone else file.write_bytes(whole.replace(b"doubtful", b"accepted"))
    assert [outcome.resumed for outcome in pages.run_pages()] == [False]
    assert file.read_bytes() == whole


@pytest.mark.parametrize(("text", "cell"), [
    *((text, f"'{text}") for text in ("=1", "\n=1", "-1", "@SUM(A1)", "+1", "\uff1dcmd|' /C calc'!A0")),
    ("\t=1", "'\t'=1"), ("\r=1", "' =1"), ("cam;=1+1", "cam;'=1+1"),
    *((text, text) for text in ("Nikon 5100 (NPL)", "a-b", "2 % - 3", "'quoted", "")),
])  # fmt: skip
def test_no_cell_of_the_summary_is_a_formula(text: str, cell: str) -> None:
    """Names, folders and reasons come from whoever wrote the manifest; a spreadsheet runs a formula."""
    table = io.StringIO(summary_csv([Outcome(text, "refused", "", text, text)]), newline="")
    (row,) = csv.DictReader(table)
    assert {row["name"], row["reason"], row["folder"]} == {cell}


def test_a_script_that_guards_no_call_is_an_error_in_words(pages: Desk) -> None:
    pages.write(ONE, {"a": "no photo"})
    (pages.home / "script.py").write_text(
        "from camssf_fleet.batch import run_batch\nfrom camssf_fleet.manifest import Manifest\n"
        "run_batch(Manifest('manifest.csv'), 'out', workers=2)\n"
    )
    call = [sys.executable, "script.py"]
    ended = subprocess.run(call, cwd=pages.home, stderr=subprocess.PIPE, text=True, timeout=120)
    assert "InvalidArgument: A batch starts processes" in ended.stderr
    assert 'below a line `if __name__ == "__main__":`' in ended.stderr
    assert ended.stderr.count("Traceback") == 1
    assert list(pages.out.iterdir()) == []


def alive(process: int) -> bool:
    """Whether it runs; one that ended and waits for its parent to notice does not."""
    try:
        os.kill(process, 0)
        stat = Path(f"/proc/{process}/stat")
        return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
def test_a_batch_that_is_killed_leaves_no_process(pages: Desk) -> None:
    """SIGKILL cannot be answered: the processes themselves must see that their parent is gone."""
    pages.write([f"c{i},a,D55,,," for i in range(120)], {"a": "fine"})
    with pages.started("run_pages", slow, workers=2) as running:
        until(lambda: len(pages.workers()) == 2)
        running.kill()
        assert running.wait(timeout=60) == -signal.SIGKILL
    try:
        until(lambda: not any(map(alive, pages.workers())))
    finally:
        for worker in filter(alive, pages.workers()):
            os.kill(worker, signal.SIGKILL)


def test_ctrl_c_stops_what_has_not_begun_and_a_second_run_goes_on(pages: Desk) -> None:
    pages.write([f"c{i},a,D55,,," for i in range(8)], {"a": "fine"})

    def done() -> set[str]:
        return {path.parent.name for path in pages.out.glob(f"*/{MARK}")}

    hears = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}  # a background job ignores it
    with pages.started("run_pages", slow, start_new_session=True, **hears) as running:
        until(done)
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does: the children hear it, too
        assert running.wait(timeout=60) != 0
    before = done()
    assert 0 < len(before) < 8
    assert not (pages.out / "summary.csv").exists()
    outcomes = pages.run_pages(processes=True, workers=2)
    assert {outcome.name for outcome in outcomes if outcome.resumed} == before
    assert all(outcome.ok for outcome in outcomes)


def test_it_goes_on_and_resumes_without_reading(desk: Desk) -> None:
    rows = ["good,a,D55,,,,S1,lab", "bug,b,D55,,,,,", "wrong,w,D55,,,,,", "refused,d,D55,,,,,", "lost,none,D55,,,,,"]
    desk.write([*rows, "again,a2,D55,,,,S1,lab", "fault,,D55,,,,,"],
               {"a": "Phone", "b": "bug", "w": "wrong", "d": "refused", "a2": "Phone"})  # fmt: skip
    first = desk.run()
    expected = {"good": "doubtful", "bug": "failed", "wrong": "refused", "refused": "refused", "lost": "failed"}
    assert desk.tasks() == expected | {"again": "doubtful", "fault": "refused"}
    assert (first.total, first.resumed, first.duplicates, first.failed) == (7, 0, 1, 5)
    (bug,) = Registry(desk.home / "phones").query("SELECT reason FROM jobs WHERE name = 'bug'")
    assert "RuntimeError: two lines" in bug["reason"]
    assert [each["name"] for each in desk.rows()] == ["again", "refused"]  # what was said last
    (good, _) = desk.rows("name, serial, extra, place, made_from, key")
    assert (good["serial"], json.loads(good["extra"])) == ("S1", {"site": "lab"})
    assert (desk.home / "phones" / good["place"]).is_file()
    assert desk.visits() == {"good": 1, "bug": 1, "wrong": 1, "refused": 1}  # `again` is a duplicate, by its contents
    second = desk.run()
    assert (second.resumed, second.duplicates, second.total) == (3, 0, 7)
    assert desk.visits() == {"good": 1, "bug": 2, "wrong": 2, "refused": 1}
    assert (second.by_status, second.by_model) == (first.by_status, first.by_model)
    assert {model.split()[-1]: dict(each) for model, each in first.by_model.items() if model} == {
        "Phone": {"doubtful": 2}, "refused": {"refused": 1},
    }  # fmt: skip
    assert first.by_model[""] == {"failed": 2, "refused": 2}
    (desk.home / "a").write_text("Phone 2")
    third = desk.run()
    assert (third.resumed, desk.visits()["good"]) == (2, 2)
    assert sorted(each["model"] for each in desk.rows()) == ["Phone", "Phone 2", "refused"]


def test_a_damaged_result_in_the_archive_is_made_anew(desk: Desk) -> None:
    """Without the registry, which is made again from the archive."""
    desk.write(ONE_ROW, {"a": "Phone"})
    desk.run()
    (file,) = (desk.home / "out").glob("*/*/result.json")
    whole = file.read_bytes()
    file.write_bytes(whole[:1000])
    for _ in range(2):
        shutil.rmtree(desk.home / "phones")
        assert desk.run().by_status == {"doubtful": 1}
        assert (file.read_bytes(), len(desk.rows())) == (whole, 1)
        assert desk.visits() == {"one": 2}


def test_a_correction_of_the_manifest_reaches_the_registry(desk: Desk) -> None:
    """What contradicts is refused until it is asked for, the rest is written; nothing is emptied or done again."""
    desk.header, other = "name,photo,lamp,serial,captured,lens,site", "z,z,D55,Z9,,,"
    desk.write(["cam,a,D55,S1,2026-01-02T10:00,50mm,lab"], {"a": "Phone", "z": "Other"})
    desk.run()
    captured = datetime(2026, 1, 3, 10, tzinfo=UTC)
    for words, expected in (
        ("S2,2026-01-03T10:00,50mm,lab", {"serial": "S2", "captured": captured}),
        ("S2,,,roof", {"captured": captured, "lens": "50mm", "extra": '{"site": "roof"}'}),
    ):
        desk.write([f"cam,a,D55,{words}", other], {})
        before = desk.rows("*")[0]
        assert desk.run().by_code["invalid_argument"] == 1
        found = desk.run(correct=True)
        assert (found.total, found.resumed, found.duplicates, found.failed) == (2, 1, 0, 0)
        row = desk.rows("*")[0]
        assert {name: row[name] for name in expected} == expected
        assert all(row[name] == value for name, value in before.items() if value and name not in (*expected, "added"))
    refusals = "SELECT reason FROM jobs WHERE name = 'cam' AND status = 'refused'"
    assert all("What is given of" in row["reason"] for row in Registry(desk.home / "phones").query(refusals))
    assert desk.run().resumed == 2
    desk.write(["camera,a,D55,S2,,,roof"], {})
    desk.run()
    assert desk.rows("name") == [{"name": "camera"}, {"name": "z"}]
    assert desk.visits() == {"cam": 1, "z": 1}


def test_another_basis_in_the_same_file_is_noticed(desk: Desk) -> None:
    basis = desk.home / "mine.npz"
    basis.write_bytes(b"one")
    desk.write(ONE_ROW, {"a": "Phone"})
    how = {"options": {"basis": str(basis)}}
    assert [desk.run(**how).resumed for _ in range(2)] == [0, 1]
    os.utime(basis, (1, 1))
    assert desk.run(**how).resumed == 0  # it may be another; its contents say that it is not
    assert desk.visits() == {"one": 1}
    basis.write_bytes(b"two")
    assert desk.run(**how).resumed == 0
    assert desk.visits() == {"one": 2}


def test_a_process_that_lives_on_reads_the_new_basis(tmp_path: Path) -> None:
    file, shipped = tmp_path / "mine.npz", [read_basis(name) for name in ("phones", "cameras")]
    for number, basis in enumerate(shipped):
        np.savez(file, mean=basis.mean[:, ::10], dictionary=basis.dictionary[..., ::10, :], source="s")
        os.utime(file, (number, number))
        assert basis_hash(str(file)) == file_hash(file)
        assert np.allclose(read_basis(str(file)).mean, basis.mean)
    assert basis_hash("phones") is basis_hash("auto") is basis_hash("nowhere.npz") is None


def test_the_poisonous_is_put_aside(desk: Desk) -> None:
    """It takes another along once, and is tried alone; then never again until its file is another."""
    desk.write([f"{name},{name},D55,,,,," for name in "xb"], {"x": "dies", "b": "Phone b"})
    for resumed in (0, 2):
        summary = desk.run(processes=True)
        assert (summary.by_status["failed"], summary.total, summary.resumed) == (1, 2, resumed)
        assert desk.visits()["x"] == pools.DEATHS
    (failed,) = Registry(desk.home / "phones").query("SELECT name, reason FROM jobs WHERE status = 'failed'")
    assert failed["name"] == "x"
    assert "died" in failed["reason"]
    assert len(desk.rows()) == 1
    (desk.home / "x").write_text("Phone x, healed")
    assert desk.run().by_status["failed"] == 0


AGAIN = f"It was interrupted {pools.RESUBMISSIONS + 1} times. Run the same command again for it."


@pytest.mark.parametrize(("interruptions", "error", "submitted", "end"), [
    (1, pools.Lost(), 2, ("accepted", "", 0)),
    (pools.RESUBMISSIONS, pools.Lost(), pools.RESUBMISSIONS + 1, ("accepted", "", 0)),
    (10**6, pools.Lost(), pools.RESUBMISSIONS + 1, ("failed", AGAIN, 0)),  # no job's fault: the next run tries again
    (pools.DEATHS - 1, ChildProcessError(), None, ("accepted", "", 0)),
    (pools.DEATHS, ChildProcessError(), None, ("failed", pools.DIED, pools.DEATHS)),
])  # fmt: skip
def test_what_is_interrupted_is_submitted_again_not_for_ever(
    interruptions: int, error: Exception, submitted: int | None, end: Any, tmp_path: Path
) -> None:
    asked, ends = Counter[str](), list[Outcome]()

    def submit(do: Any, job: Job, work: Any, marks: Path, version: str) -> Future[Outcome]:
        """Interrupts a job so many times, after it has begun, before it does it."""
        future: Future[Outcome] = Future()
        asked[job.name] += 1
        if asked[job.name] > interruptions:
            future.set_result(do(job, work, marks, version))
        else:
            write_place(marks / str(asked[job.name]), b"")  # by a worker
            future.set_exception(error)
        return future

    (tmp_path / "m.csv").write_text("name,photo,lamp\na,x,D55\n")
    pool = nullcontext(pools.Pool(submit, lambda: 1, ChildProcessError))
    recorder: Any = SimpleNamespace(add=lambda job, outcome: ends.append(outcome), update=lambda: None)
    jobs = iter(Manifest(tmp_path / "m.csv"))
    pools.run_jobs(jobs, lambda job: Outcome(job.name, "accepted"), pool, tmp_path / "marks", recorder)
    assert [(outcome.status, outcome.reason, outcome.deaths) for outcome in ends] == [end]
    assert submitted is None or asked == {"a": submitted}


def test_the_registry_s_full_disk_is_said(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    desk.write(ONE_ROW, {"a": "Phone"})
    with monkeypatch.context() as patched:
        patched.setattr(Registry, "append", raising(InvalidArgument("No space left.", "Free some.")))
        with pytest.raises(InvalidArgument, match="No space"):
            desk.run()
    assert desk.run().by_status["doubtful"] == 1
    assert desk.visits() == {"one": 1}  # its result was in the archive


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
