"""Batch: a bad row stops no other, nothing is done twice, no name escapes its folder."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from camssf.errors import ChartNotFound, InvalidArgument
from camssf.files import ASIDE, NEW
from camssf.report.build import NAMES
from camssf.result import refused
from camssf_fleet import batch
from camssf_fleet.batch import MARK, calibrate_into
from camssf_fleet.manifest import Job, Manifest
from camssf_fleet.outcome import Outcome
from camssf_fleet.pools import Recorder, Work
from camssf_fleet.recorder import summary_csv

HEADER = "name,photo,lamp,white,dark,chart"


def stub(job: Job, folder: Path) -> Outcome:
    """In place of the calibration, run in the other process: what the photo says is what happens."""
    text = Path(job.photos[0]).read_text()
    if text == "dies":
        os.kill(os.getpid(), signal.SIGKILL)
    if text == "bug":
        raise RuntimeError("two\nlines")
    if text == "refused":
        return Outcome(job.name, "refused", "overexposed", "Too bright.")
    folder.mkdir(parents=True, exist_ok=True)
    if text == "refused with evidence":
        (folder / "result.json").write_text('{"verdict": {"status": "refused"}}')
        (folder / "ssf.csv").unlink(missing_ok=True)
        return Outcome(job.name, "refused", "overexposed", "Too bright.")
    for name in NAMES:
        (folder / name).write_text('{"verdict": {"status": "accepted"}}')
    if text == "dies late":
        os.kill(os.getpid(), signal.SIGKILL)
    with open(folder / "visits", "a") as file:
        file.write(f"{os.getpid()} {os.environ.get('OMP_NUM_THREADS')} {text}\n")
    return Outcome(job.name, "accepted")


def slow(job: Job, folder: Path) -> Outcome:
    time.sleep(1.0)
    return stub(job, folder)


def run_batch(
    manifest: Path, out: Path, *, jobs: int = 1, work: Callable[[Job, Path], Outcome], **options: str
) -> tuple[Outcome, ...]:
    return batch.run_batch(Manifest(manifest, **options), out, workers=jobs, work=work).outcomes


def here(manifest: Path, out: Path, **options: str) -> tuple[Outcome, ...]:
    """As `run_batch`, in this process."""

    def in_this_process(jobs: Iterator[Job], work: Work, count: int, recorder: Recorder) -> None:
        for job in jobs:
            recorder.add(job, work(job))

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(batch, "run_processes", in_this_process)
        return run_batch(manifest, out, work=stub, **options)


def read_manifest(path: Path) -> tuple[Job, ...]:
    return Manifest(path).read_all()


def write(home: Path, rows: list[str], photos: dict[str, str]) -> Path:
    for name, text in photos.items():
        (home / name).parent.mkdir(parents=True, exist_ok=True)
        (home / name).write_text(text)
    manifest = home / "manifest.csv"
    manifest.write_text("\n".join([HEADER, *rows]) + "\n", "utf-8")
    return manifest


def visits(out: Path, name: str) -> int:
    return len((out / name / "visits").read_text().splitlines())


def test_it_goes_on_after_bad_rows(tmp_path: Path) -> None:
    manifest = write(
        tmp_path, ["good,a,D55,,,", "bug,b,D55,,,", "lost,missing,D55,,,", "refused,d,D55,,,", "last,a,A,,,"],
        {"a": "fine", "b": "bug", "d": "refused"},
    )  # fmt: skip
    outcomes = here(manifest, tmp_path / "out")
    expected = {"good": "accepted", "bug": "failed", "lost": "failed", "refused": "refused", "last": "accepted"}
    assert [(o.name, o.status) for o in outcomes] == list(expected.items())
    assert "RuntimeError: two lines" in outcomes[1].reason
    rows = list(csv.DictReader((tmp_path / "out" / "summary.csv").read_text("utf-8").splitlines()))
    assert [row["name"] for row in rows] == [o.name for o in outcomes]
    assert rows[3]["code"] == "overexposed"


@pytest.mark.full
def test_it_goes_on_after_a_crash(tmp_path: Path) -> None:
    manifest = write(tmp_path, ["good,a,D55,,,", "dies,c,D55,,,", "last,a,A,,,"], {"a": "fine", "c": "dies"})
    outcomes = run_batch(manifest, tmp_path / "out", work=stub)
    assert [(o.name, o.status) for o in outcomes] == [("good", "accepted"), ("dies", "failed"), ("last", "accepted")]
    assert "died" in outcomes[1].reason


@pytest.mark.full
def test_a_script_that_guards_no_call_is_an_error_in_words(tmp_path: Path) -> None:
    write(tmp_path, ["good,a,D55,,,"], {"a": "no photo"})
    script = tmp_path / "script.py"
    script.write_text(
        "from camssf_fleet.batch import run_batch\nfrom camssf_fleet.manifest import Manifest\n"
        "run_batch(Manifest('manifest.csv'), 'out', workers=2)\n"
    )
    ended = subprocess.run(
        [sys.executable, script.name], cwd=tmp_path, stderr=subprocess.PIPE, text=True, timeout=120
    )
    assert "InvalidArgument: A batch starts processes" in ended.stderr
    assert 'below a line `if __name__ == "__main__":`' in ended.stderr
    assert ended.stderr.count("Traceback") == 1
    assert list((tmp_path / "out").iterdir()) == []


def test_it_resumes(tmp_path: Path) -> None:
    manifest = write(
        tmp_path, ["one,a,D55,,,", "two,b,D55,w,,", "bad,c,D55,,,"], {"a": "1", "b": "2", "w": "w", "c": "refused"}
    )
    out = tmp_path / "out"

    def again(**options: str) -> list[bool]:
        return [o.resumed for o in here(manifest, out, **options)]

    assert again() == [False, False, False]
    assert again() == [True, True, False]  # what was refused is tried again
    assert visits(out, "one") == visits(out, "two") == 1

    (tmp_path / "w").write_text("another white frame")
    assert again() == [True, False, False]
    manifest.write_text(manifest.read_text().replace("one,a,D55", "one,a,A"))
    assert again() == [False, True, False]
    assert again(basis="gaussian") == [False, False, False]
    assert again(basis="gaussian") == [True, True, False]
    (out / "one" / "result.json").unlink()
    (out / "two" / MARK).write_text("not JSON")
    assert again(basis="gaussian") == [False, False, False]


def test_another_basis_in_the_same_file_and_another_sidecar_are_noticed(tmp_path: Path) -> None:
    manifest = write(tmp_path, ["one,a.png,D55,,,"], {"a.png": "1", "a.png.json": "black 1", "mine.npz": "basis 1"})
    basis = str(tmp_path / "mine.npz")

    def again() -> bool:
        (outcome,) = here(manifest, tmp_path / "out", basis=basis)
        return outcome.resumed

    assert [again(), again()] == [False, True]
    (tmp_path / "mine.npz").write_text("basis 2")
    assert not again()
    (tmp_path / "a.png.json").write_text("black 2")
    assert not again()
    assert again()


def test_a_refused_capture_replaces_no_result_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its photo is another now: missing, no RAW, or one that is refused."""
    (tmp_path / "result.json").write_text('{"verdict": {"status": "accepted"}}')
    (tmp_path / "ssf.csv").write_text("curves")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    job = Job("one", (str(tmp_path / "typo.dng"),), ("D55",), (None,), (None,), "classic24")
    outcome = calibrate_into(job, tmp_path)
    assert (outcome.status, outcome.code) == ("refused", "unreadable_raw")
    assert outcome.reason.endswith("The earlier result of this name was kept as it is.")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before
    assert (tmp_path / "refused" / "result.json").is_file()
    refusal = refused(ChartNotFound("No chart.", "Take one."))
    monkeypatch.setattr(batch, "attempt_job", lambda _: refusal)
    outcome = calibrate_into(job, tmp_path)
    assert outcome.reason == "No chart. Take one. The earlier result of this name was kept as it is."
    assert sorted(path.name for path in (tmp_path / "refused").iterdir()) == ["report.html", "result.json"]
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


def came_between(tmp_path: Path, meanwhile: str, run: Callable[[Path, Path], tuple[Outcome, ...]]) -> None:
    """Good, then something else in the same folder, then good again: the first result is not there any more."""
    good = write(tmp_path, ["one,a,D55,,,"], {"a": "fine", "b": meanwhile})
    out = tmp_path / "out"
    assert [o.status for o in here(good, out)] == ["accepted"]
    other = tmp_path / "other.csv"
    other.write_text(good.read_text().replace("one,a", "one,b"))
    (between,) = run(other, out)
    assert not between.ok
    assert not (out / "one" / MARK).exists()
    (again,) = here(good, out)
    assert (again.status, again.resumed) == ("accepted", False)
    assert json.loads((out / "one" / "result.json").read_text())["verdict"]["status"] == "accepted"
    assert [o.resumed for o in here(good, out)] == [True]


def test_what_came_between_is_not_forgotten(tmp_path: Path) -> None:
    for meanwhile in ("refused", "refused with evidence", "bug"):
        came_between(tmp_path / meanwhile, meanwhile, here)


@pytest.mark.full
def test_a_death_between_is_not_forgotten(tmp_path: Path) -> None:
    came_between(tmp_path, "dies late", partial(run_batch, work=stub))


def test_a_result_that_is_not_whole_is_done_again(tmp_path: Path) -> None:
    manifest = write(tmp_path, ["one,a,D55,,,"], {"a": "fine"})
    out = tmp_path / "out"
    here(manifest, out)
    for name in NAMES:
        whole = (out / "one" / name).read_bytes()
        for other in (None, '{"verdict": {"status": "doubtful"}}'):  # gone; as long as before
            (out / "one" / name).unlink()
            if other is not None:
                (out / "one" / name).write_text(other)
            assert [o.resumed for o in here(manifest, out)] == [False], (name, other)
            assert (out / "one" / name).read_bytes() == whole


@pytest.mark.full
def test_it_uses_the_processes(tmp_path: Path) -> None:
    """Two sleepers at once are in two processes, each with one thread for its algebra; jobs=1 takes one process."""
    manifest = write(tmp_path, ["one,a,D55,,,", "two,b,D55,,,"], {"a": "1", "b": "2"})
    for jobs, expected in ((2, 2), (1, 1)):
        out = tmp_path / str(jobs)
        run_batch(manifest, out, jobs=jobs, work=slow)
        seen = [(out / name / "visits").read_text().split() for name in ("one", "two")]
        assert len({line[0] for line in seen}) == expected
        assert os.environ.get("OMP_NUM_THREADS", "1") == seen[0][1]
        assert str(os.getpid()) not in {line[0] for line in seen}


def test_no_name_escapes(tmp_path: Path) -> None:
    manifest = tmp_path / "manifest.csv"
    for name in ("../evil", "..", ".", "/etc/passwd", "a/../../b", "C:\\Windows", "CON", "lpt1.txt", "x" * 300,
                 "nul\tbyte", "~", " "):  # fmt: skip
        with manifest.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([HEADER.split(","), [name, "a", "D55", "", "", ""]])
        (job,) = read_manifest(manifest)
        inside = (tmp_path / "out" / job.folder).resolve()
        assert inside.parent == (tmp_path / "out").resolve(), name
        assert len(job.folder) < 120, name
        assert not set(job.folder) & set('/\\:*?"<>|\t\0'), name
        assert not job.folder.endswith((".", " ")), name
        assert job.folder.split(".")[0].casefold() not in ("con", "lpt1"), name


def test_a_camera_named_as_the_summary_leaves_room_for_it(tmp_path: Path) -> None:
    manifest = write(tmp_path, ["summary.csv,a,D55,,,", "SUMMARY.CSV,a,A,,,", "summary,a,A,,,"], {"a": "1"})
    folders = [job.folder for job in read_manifest(manifest)]
    assert "summary.csv" not in {folder.casefold() for folder in folders}
    assert folders[2] == "summary"
    assert all(outcome.ok for outcome in here(manifest, tmp_path / "out"))
    assert (tmp_path / "out" / "summary.csv").is_file()


def test_a_lamp_that_is_left_out_is_nobody_s(tmp_path: Path) -> None:
    (job,) = read_manifest(write(tmp_path, ["one,a,,,,", "one,b,auto,,,", "one,c,D55,,,"], {}))
    assert job.lamps == ("auto", "auto", "D55")
    assert not job.fault


def test_parquet_needs_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "duckdb", None)
    (tmp_path / "m.parquet").write_bytes(b"PAR1")
    with pytest.raises(InvalidArgument, match="A manifest in Parquet needs") as caught:
        read_manifest(tmp_path / "m.parquet")
    assert '".[fleet]"' in caught.value.advice


def test_names_stay_readable_and_apart(tmp_path: Path) -> None:
    names = ["Nikon 5100 (NPL)", "Kamera für Späße", "a/b", "a_b", "a?b", "canon", "Canon"]
    manifest = write(tmp_path, [f"{name},a,D55,,," for name in names], {"a": "1"})
    folders = [job.folder for job in read_manifest(manifest)]
    assert folders[:2] == names[:2]
    assert folders[3] == "a_b"
    assert len({folder.casefold() for folder in folders}) == len(names)
    assert folders == [job.folder for job in read_manifest(manifest)]


def test_rows_of_one_name_are_its_shots_and_paths_are_the_manifest_s(tmp_path: Path) -> None:
    home = tmp_path / "home"
    manifest = write(
        home,
        ["cam,day.dng,D:5500,wd.dng,dd.dng,nano24:mine.csv", "other,x.dng,D55,,,", "cam,bulb.dng,lamp.csv,none,,"],
        {"mine.csv": "", "lamp.csv": ""},
    )
    manifest.write_text(manifest.read_text().replace("lamp.csv,none,,", "lamp.csv,none,,nano24:mine.csv"))
    cam, other = read_manifest(manifest)
    assert cam.photos == (str(home / "day.dng"), str(home / "bulb.dng"))
    assert cam.lamps == ("D:5500", str(home / "lamp.csv"))
    assert cam.white == (str(home / "wd.dng"), None)
    assert cam.dark == (str(home / "dd.dng"), None)
    assert cam.chart == f"nano24:{home / 'mine.csv'}"
    assert (other.chart, other.white, other.dark) == ("classic24", (None,), (None,))
    assert not cam.fault
    assert not other.fault


def test_a_spreadsheet_s_csv(tmp_path: Path) -> None:
    """Byte-order mark, semicolons, carriage returns, capitals, missing columns, an empty line."""
    manifest = tmp_path / "manifest.csv"
    manifest.write_bytes("\ufeffName;Photo;Lamp\r\ncam;a.dng;D55\r\n\r\n".encode())
    (job,) = read_manifest(manifest)
    assert (job.name, job.lamps, job.photos) == ("cam", ("D55",), (str(tmp_path / "a.dng"),))


def test_a_bad_row_is_its_name_s_fault(tmp_path: Path) -> None:
    manifest = write(
        tmp_path,
        [
            "two charts,a,D55,,,classic24",
            "two charts,a,A,,,sg140",
            "no photo,,D55,,,",
            "long,a,D55,,,,,x",
            "ok,a,D55,,,",
        ],
        {"a": "1"},
    )
    outcomes = here(manifest, tmp_path / "out")
    assert [(o.status, o.code) for o in outcomes] == [("refused", "invalid_argument")] * 3 + [("accepted", "")]
    for outcome, words in zip(outcomes, ("different charts", "no photo", "more fields"), strict=False):
        assert words in outcome.reason


def test_a_manifest_without_sense(tmp_path: Path) -> None:
    for content, words in ((None, "cannot be read"), (b"name,photo,lamp,lens\n", "unknown")):
        manifest = tmp_path / "manifest.csv"
        if content is not None:
            manifest.write_bytes(content)
        with pytest.raises(InvalidArgument, match=words):
            run_batch(manifest, tmp_path / "out", work=stub)
        assert not (tmp_path / "out").exists()


def test_an_output_folder_that_is_a_file(tmp_path: Path) -> None:
    manifest = write(tmp_path, ["one,a,D55,,,"], {"a": "1"})
    with pytest.raises(InvalidArgument, match="a is a file"):
        run_batch(manifest, tmp_path / "a", work=stub)


def test_no_cell_of_the_summary_is_a_formula(tmp_path: Path) -> None:
    """Names, folders and reasons come from whoever wrote the manifest; a spreadsheet runs a formula."""
    leads = ("=", "+", "-", "@", "\uff1d")
    names = [name for lead in leads for name in (f"{lead}cmd|' /C calc'!A0", f"cam;{lead}1+1", f"{lead}1")]
    rows = [f"{name},a,D55,,," for name in names]
    manifest = write(tmp_path, [*rows, "refused,=x,D55,,,"], {"a": "fine"})
    assert [o.name for o in here(manifest, tmp_path / "out")] == [*names, "refused"]
    with (tmp_path / "out" / "summary.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    for row in lines:
        for cell in row.values():
            assert not any(part.startswith((*leads, "\t", "\r")) for part in cell.split(";")), cell
    assert [row["name"] for row in lines] == [
        *(name.replace(";", ";'") if name.startswith("cam") else f"'{name}" for name in names), "refused",
    ]  # fmt: skip
    assert [o.resumed for o in here(manifest, tmp_path / "out")] == [True] * len(names) + [False]


def test_summary_cells_of_any_text() -> None:
    def cells(text: str) -> dict[str, str]:
        (row,) = csv.DictReader(io.StringIO(summary_csv([Outcome(text, "refused", "", text, text)]), newline=""))
        return row

    for text in ("=1", "\t=1", "\r=1", "\n=1", "-1", "@SUM(A1)"):
        assert cells(text)["name"][0] == cells(text)["reason"][0] == "'"
    for text in ("Nikon 5100 (NPL)", "a-b", "2 % - 3", "'quoted", ""):
        assert cells(text)["name"] == cells(text)["reason"] == text


@pytest.mark.skipif(os.sep == "\\", reason="there backslashes are folders")
def test_backslashes_are_explained(tmp_path: Path) -> None:
    rows = ["shots\\a.dng,D55,,,", "a,lamps\\l.csv,,,", "a,D55,w\\x,,", "a,D55,,d\\x,", "a,D55,,,nano24:c\\x.csv",
            "C:\\a.dng,D55,,,"]  # fmt: skip
    named = [f"cam{i},{row}" for i, row in enumerate(rows)]
    manifest = write(tmp_path, [*named, "ok,a\\b,D55,,,"], {"a": "fine", "a\\b": "fine"})
    *bad, good = here(manifest, tmp_path / "out")
    assert [(outcome.status, outcome.code) for outcome in bad] == [("refused", "invalid_argument")] * len(rows)
    assert all("write / instead" in outcome.reason for outcome in bad)
    assert good.status == "accepted"  # a name that holds one


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
def test_a_batch_that_is_killed_leaves_no_process(tmp_path: Path) -> None:
    """SIGKILL cannot be answered: the processes themselves must see that their parent is gone."""
    manifest = write(tmp_path, [f"c{i},a,D55,,," for i in range(120)], {"a": "fine"})
    out = tmp_path / "out"
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[2])!r})\n"
        "from pathlib import Path\nfrom tests.fleet.test_batch import run_batch, slow\n"
        f"if __name__ == '__main__': run_batch(Path({str(manifest)!r}), Path({str(out)!r}), jobs=2, work=slow)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE) as running:
        deadline = time.monotonic() + 100
        workers: set[int] = set()
        while len(workers) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
            workers = {int(words[0]) for path in out.glob("*/visits") if (words := path.read_text().split())}
        running.kill()
        assert running.wait(timeout=60) == -signal.SIGKILL
    try:
        assert len(workers) == 2
        deadline = time.monotonic() + 100
        while any(map(alive, workers)) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not list(filter(alive, workers))
    finally:
        for worker in filter(alive, workers):
            os.kill(worker, signal.SIGKILL)


def alive(process: int) -> bool:
    """Whether it runs; one that ended and waits for its parent to notice does not."""
    try:
        os.kill(process, 0)
        stat = Path(f"/proc/{process}/stat")
        return not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def test_what_a_killed_run_left_in_a_finished_folder_goes(tmp_path: Path) -> None:
    manifest = write(tmp_path, ["one,a,D55,,,"], {"a": "1"})
    here(manifest, tmp_path / "out")
    left = tmp_path / "out" / "one" / f"{ASIDE}00000000" / NEW
    left.mkdir(parents=True)
    (left / "report.html").write_text("half")
    (outcome,) = here(manifest, tmp_path / "out")
    assert outcome.resumed
    assert not list((tmp_path / "out").rglob(".camssf-*"))


def test_the_mark_and_the_summary_are_whole(tmp_path: Path) -> None:
    manifest = write(tmp_path, ["one,a,D55,,,"], {"a": "1"})
    here(manifest, tmp_path / "out")
    mark = json.loads((tmp_path / "out" / "one" / MARK).read_text("utf-8"))
    assert mark["format"] == "camssf-batch/1"
    assert len(mark["made_from"]) == 64
    assert not list((tmp_path / "out").rglob(".camssf-*"))


@pytest.mark.full
def test_ctrl_c_stops_what_has_not_begun_and_a_second_run_goes_on(tmp_path: Path) -> None:
    manifest = write(tmp_path, [f"c{i},a,D55,,," for i in range(8)], {"a": "fine"})
    out = tmp_path / "out"
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[2])!r})\n"
        "from pathlib import Path\nfrom tests.fleet.test_batch import run_batch, slow\n"
        f"if __name__ == '__main__': run_batch(Path({str(manifest)!r}), Path({str(out)!r}), work=slow)"
    )
    running = subprocess.Popen(
        [sys.executable, "-c", code],
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's background job ignores it
    )
    with running:
        deadline = time.monotonic() + 60
        while not list(out.glob(f"*/{MARK}")) and time.monotonic() < deadline:
            time.sleep(0.05)
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does: the children hear it, too
        assert running.wait(timeout=60) != 0
    done = {path.parent.name for path in out.glob(f"*/{MARK}")}
    assert 0 < len(done) < 8
    assert not (out / "summary.csv").exists()
    again = run_batch(manifest, out, jobs=2, work=stub)
    assert {outcome.name for outcome in again if outcome.resumed} == done
    assert all(outcome.ok for outcome in again)
