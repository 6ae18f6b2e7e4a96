"""A batch into folders: a bad row stops no other, nothing is done twice, and whatever is killed is taken up."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from camssf.errors import ChartNotFound
from camssf.files import ASIDE, NEW
from camssf.report.build import NAMES
from camssf.result import refused
from camssf_fleet import batch
from camssf_fleet.batch import MARK, calibrate_into
from camssf_fleet.manifest import Job
from camssf_fleet.outcome import Outcome
from camssf_fleet.recorder import summary_csv
from tests.support.desk import Desk, slow_pages, until

ONE = ["one,a,D55,,,"]


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path, "name,photo,lamp,white,dark,chart")


def statuses(outcomes: tuple[Outcome, ...]) -> dict[str, str]:
    return {outcome.name: outcome.status for outcome in outcomes}


def visits(desk: Desk, name: str) -> list[list[str]]:
    return [line.split() for line in (desk.out / name / "visits").read_text().splitlines()]


def test_it_goes_on_after_bad_rows(desk: Desk) -> None:
    rows = [
        "good,a,D55,,,",
        "bug,b,D55,,,",
        "lost,missing,D55,,,",
        "refused,d,D55,,,",
        "fault,,D55,,,",
        "last,a,A,,,",
    ]
    desk.write(rows, {"a": "fine", "b": "bug", "d": "refused"})
    outcomes = desk.run_pages()
    expected = {"good": "accepted", "bug": "failed", "lost": "failed", "refused": "refused", "fault": "refused"}
    assert statuses(outcomes) == expected | {"last": "accepted"}
    assert "RuntimeError: two lines" in outcomes[1].reason
    table = list(csv.DictReader((desk.out / "summary.csv").read_text("utf-8").splitlines()))
    assert [row["name"] for row in table] == [outcome.name for outcome in outcomes]
    assert (table[3]["code"], table[4]["code"]) == ("overexposed", "invalid_argument")


def test_it_resumes(desk: Desk) -> None:
    photos = {"a": "1", "b": "2", "w": "w", "c": "refused"}
    desk.write(["one,a,D55,,,", "two,b,D55,w,,", "bad,c,D55,,,"], photos)

    def again(**options: str) -> list[bool]:
        return [outcome.resumed for outcome in desk.run_pages(options=options)]

    assert again() == [False, False, False]
    left = desk.out / "one" / f"{ASIDE}00000000" / NEW  # by a run that was killed
    left.mkdir(parents=True)
    (left / "report.html").write_text("half")
    assert again() == [True, True, False]  # what was refused is tried again
    assert len(visits(desk, "one")) == len(visits(desk, "two")) == 1
    mark = json.loads((desk.out / "one" / MARK).read_text("utf-8"))
    assert (mark["format"], len(mark["made_from"])) == ("camssf-batch/1", 64)
    assert not list(desk.out.rglob(".camssf-*"))

    (desk.home / "w").write_text("another white frame")
    assert again() == [True, False, False]
    desk.manifest.write_text(desk.manifest.read_text().replace("one,a,D55", "one,a,A"))
    assert again() == [False, True, False]
    assert again(basis="gaussian") == [False, False, False]
    assert again(basis="gaussian") == [True, True, False]
    (desk.out / "one" / "result.json").unlink()
    (desk.out / "two" / MARK).write_text("not JSON")
    assert again(basis="gaussian") == [False, False, False]


def test_a_refused_capture_replaces_no_result_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its photo is another now: missing, no RAW, or one that is refused."""
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
    ("refused", False), ("refused with evidence", False), ("bug", False),
    pytest.param("dies late", True, marks=pytest.mark.full),
])  # fmt: skip
def test_what_came_between_is_not_forgotten(desk: Desk, meanwhile: str, processes: bool) -> None:
    """Good, then something else in the same folder, then good again: the first result is not there any more."""
    desk.write(ONE, {"a": "fine", "b": meanwhile})
    assert statuses(desk.run_pages()) == {"one": "accepted"}
    (desk.home / "other.csv").write_text(desk.manifest.read_text().replace("one,a", "one,b"))
    (between,) = desk.run_pages(manifest="other.csv", processes=processes)
    assert not between.ok
    assert not (desk.out / "one" / MARK).exists()
    (again,) = desk.run_pages()
    assert (again.status, again.resumed) == ("accepted", False)
    assert json.loads((desk.out / "one" / "result.json").read_text())["verdict"]["status"] == "accepted"
    assert [outcome.resumed for outcome in desk.run_pages()] == [True]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("text", [None, '{"verdict": {"status": "doubtful"}}'], ids=["gone", "as long as before"])
def test_a_result_that_is_not_whole_is_done_again(desk: Desk, name: str, text: str | None) -> None:
    desk.write(ONE, {"a": "fine"})
    desk.run_pages()
    file = desk.out / "one" / name
    whole = file.read_bytes()
    file.unlink()
    if text is not None:
        file.write_text(text)
    assert [outcome.resumed for outcome in desk.run_pages()] == [False]
    assert file.read_bytes() == whole


FORMULAS = ("=1", "\n=1", "-1", "@SUM(A1)", "+1", "\uff1dcmd|' /C calc'!A0")


@pytest.mark.parametrize(("text", "cell"), [
    *((text, f"'{text}") for text in FORMULAS), ("\t=1", "'\t'=1"), ("\r=1", "' =1"), ("cam;=1+1", "cam;'=1+1"),
    *((text, text) for text in ("Nikon 5100 (NPL)", "a-b", "2 % - 3", "'quoted", "")),
])  # fmt: skip
def test_no_cell_of_the_summary_is_a_formula(text: str, cell: str) -> None:
    """Names, folders and reasons come from whoever wrote the manifest; a spreadsheet runs a formula."""
    table = io.StringIO(summary_csv([Outcome(text, "refused", "", text, text)]), newline="")
    (row,) = csv.DictReader(table)
    assert {row["name"], row["reason"], row["folder"]} == {cell}


# Processes


@pytest.mark.full
def test_a_script_that_guards_no_call_is_an_error_in_words(desk: Desk) -> None:
    desk.write(ONE, {"a": "no photo"})
    (desk.home / "script.py").write_text(
        "from camssf_fleet.batch import run_batch\nfrom camssf_fleet.manifest import Manifest\n"
        "run_batch(Manifest('manifest.csv'), 'out', workers=2)\n"
    )
    call = [sys.executable, "script.py"]
    ended = subprocess.run(call, cwd=desk.home, stderr=subprocess.PIPE, text=True, timeout=120)
    assert "InvalidArgument: A batch starts processes" in ended.stderr
    assert 'below a line `if __name__ == "__main__":`' in ended.stderr
    assert ended.stderr.count("Traceback") == 1
    assert list(desk.out.iterdir()) == []


def alive(process: int) -> bool:
    """Whether it runs; one that ended and waits for its parent to notice does not."""
    try:
        os.kill(process, 0)
        stat = Path(f"/proc/{process}/stat")
        return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
def test_a_batch_that_is_killed_leaves_no_process(desk: Desk) -> None:
    """SIGKILL cannot be answered: the processes themselves must see that their parent is gone."""
    desk.write([f"c{i},a,D55,,," for i in range(120)], {"a": "fine"})

    def workers() -> set[int]:
        texts = [path.read_text().split() for path in desk.out.glob("*/visits")]
        return {int(words[0]) for words in texts if words}

    with desk.started("run_pages", slow_pages, workers=2) as running:
        until(lambda: len(workers()) == 2)
        running.kill()
        assert running.wait(timeout=60) == -signal.SIGKILL
    try:
        until(lambda: not any(map(alive, workers())))
    finally:
        for worker in filter(alive, workers()):
            os.kill(worker, signal.SIGKILL)


@pytest.mark.full
def test_ctrl_c_stops_what_has_not_begun_and_a_second_run_goes_on(desk: Desk) -> None:
    desk.write([f"c{i},a,D55,,," for i in range(8)], {"a": "fine"})

    def done() -> set[str]:
        return {path.parent.name for path in desk.out.glob(f"*/{MARK}")}

    hears = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}  # a background job ignores it
    with desk.started("run_pages", slow_pages, start_new_session=True, **hears) as running:
        until(done)
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does: the children hear it, too
        assert running.wait(timeout=60) != 0
    before = done()
    assert 0 < len(before) < 8
    assert not (desk.out / "summary.csv").exists()
    outcomes = desk.run_pages(processes=True, workers=2)
    assert {outcome.name for outcome in outcomes if outcome.resumed} == before
    assert all(outcome.ok for outcome in outcomes)
