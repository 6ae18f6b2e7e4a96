"""The command line, run as a user runs it: what goes where, what it exits with, what it leaves behind."""

import json
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import camssf
from camssf import cli, errors
from camssf.errors import InvalidArgument
from camssf.fit.scores import rmse
from camssf.options import Options
from camssf.photo.shot import Shot
from camssf.recovery.basis import read_basis
from camssf.result import Result
from camssf.spectra import read_camera
from camssf_fleet import batch
from tests.cli.conftest import FILES, Capture, Feed, Patch, Swap
from tests.support.failures import raising

ROOT = Path(__file__).parents[2]


@pytest.mark.requirement("R-PIPELINE")
def test_calibrate_leaves_its_files_with_curves_near_the_truth(result: Path, shots: Path) -> None:
    assert sorted(path.name for path in result.iterdir()) == FILES
    document = json.loads((result / "result.json").read_text("utf-8"))
    assert document["format"] == "camssf/2"
    assert document["verdict"]["status"] in ("accepted", "doubtful")
    nm, *truth = np.genfromtxt(shots / "truth.csv", delimiter=",", skip_header=1).T
    grid, *curves = np.genfromtxt(result / "ssf.csv", delimiter=",", skip_header=1).T
    inside = (grid >= 400) & (grid <= 700)
    for known, curve, printed in zip(truth, curves, document["answer"]["scores"]["rmse"], strict=False):
        # computed here from the two CSV files, so that the printed number has a witness
        error = float(np.sqrt(np.mean((curve - np.interp(grid, nm, known) / known.max())[inside] ** 2)))
        assert error == pytest.approx(printed, rel=1e-3)
        assert error < 0.10  # of the peak; the mean of 87 cameras is 0.05, a wrong answer is above 0.15


@pytest.mark.requirement("R-PIPELINE")
@pytest.mark.full
@pytest.mark.parametrize("first", ["patches", "result"])
def test_the_pipe_is_calibrate_in_steps(
    first: str, triple: list[str], shots: Path, result: Path, tmp_path: Path, feed: Feed, capsys: Capture
) -> None:
    """patches | solve | validate | report, in process: each takes the stdout of the one before; so does a result."""
    whole = (result / "result.json").read_text("utf-8")
    commands = [["solve", "-"], ["validate", "-", "--truth", str(shots / "truth.csv")]]
    feed(whole)
    for command in [["patches", *triple], *commands] if first == "patches" else commands:
        assert cli.main(command) == 0
        data, err = capsys.readouterr()
        feed(data)
    assert data == whole
    assert err.startswith("verdict: ")  # first, then what it is worth
    assert "colour error about" in err.splitlines()[1]
    assert cli.main(["report", "-", "-o", str(tmp_path / "out"), "--photo", triple[0]]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    assert (tmp_path / "out" / "ssf.csv").read_bytes() == (result / "ssf.csv").read_bytes()
    assert "data:image/jpeg" in (tmp_path / "out" / "report.html").read_text("utf-8")


@pytest.mark.full
@pytest.mark.requirement("R-PIPELINE")
def test_demo(tmp_path: Path, capsys: Capture, swap: Swap) -> None:
    out = tmp_path / "out"
    assert cli.main(["demo", "-o", str(out)]) == 0
    err = capsys.readouterr().err
    assert sorted(path.name for path in out.iterdir()) == sorted([*FILES, "named", "pictures.html", "shots"])
    assert sorted(path.name for path in (out / "named").iterdir()) == FILES
    assert all(str(out / name) in err for name in ("report.html", "pictures.html"))
    first, second = (Result.load(folder / "result.json") for folder in (out, out / "named"))
    assert [result.capture.photos[0].model for result in (first, second)] == ["Demo phone"] * 2
    assert second.capture.shots[0].lamp.name == "D55"
    unnamed, named = first.answer.scores.rmse, second.answer.scores.rmse
    assert len(first.answer.lights) == 1
    page = (out / "report.html").read_text("utf-8")
    mean = read_basis("phones").mean.T
    without = rmse(mean / mean.max(axis=0), read_camera("Demo phone").values)
    assert all(f"{value:.3f}" in text for value in (*without, *unnamed) for text in (err, page))
    assert all(f"{value:.3f}" in err for value in named)
    (shown,) = re.findall(r"```text\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    printed = {" ".join(line.split()).replace("┃", "│") for line in err.splitlines()}
    assert {" ".join(line.split()) for line in shown.splitlines()} <= printed
    assert np.mean(unnamed) < 0.8 * np.mean(without)  # the photo is worth something
    by_matrix, by_curves = map(float, re.findall(r'"number">([0-9.]+)<', (out / "pictures.html").read_text("utf-8")))
    assert by_curves < 0.6 * by_matrix  # what two phones differ by
    swap(InvalidArgument("enough.", ""))
    assert cli.main(["demo", "-o", str(out)]) == 2
    assert capsys.readouterr().err == "invalid_argument: enough.\n  \n"  # so it would replace its own


def test_simulate_says_what_it_wrote_and_replaces_its_own_alone(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "shots"
    call = ["simulate", "--lamp", "D55", "--lamp", "2856K", "--size", "480x360", "-o", str(out)]
    for _ in range(2):
        assert cli.main(call) == 0
        printed = capsys.readouterr()
    written = json.loads(printed.out)
    assert "truth.csv" in printed.err
    assert [shot["lamp"] for shot in written["shots"]] == ["D55", "2856K"]
    paths = {Path(shot[kind]) for shot in written["shots"] for kind in ("chart", "white", "dark")}
    assert paths | {Path(written["truth"]), Path(written["corners"])} == set(out.iterdir())
    (out / "white-D55.dng").write_bytes(b"mine")
    assert cli.main(call) == InvalidArgument.exit_status
    assert (out / "white-D55.dng").read_bytes() == b"mine"


@pytest.mark.requirement("R-REFUSAL")
@pytest.mark.parametrize("kind", errors.BY_CODE.values(), ids=errors.BY_CODE)
def test_each_family_has_its_exit_status(kind: Any, swap: Swap, capsys: Capture, tmp_path: Path) -> None:
    swap(kind("What [is] wrong.", "What to do."))
    assert cli.main(["calibrate", "x.dng", "--lamp", "D55", "-o", str(tmp_path / "out")]) == kind.exit_status
    assert tuple(capsys.readouterr()) == ("", f"{kind.code}: What [is] wrong.\n  What to do.\n")
    assert not (tmp_path / "out").exists()


@pytest.mark.requirement("R-REFUSAL")
def test_a_refusal_goes_down_the_pipe_whole(shots: Path, tmp_path: Path, feed: Feed, capsys: Capture) -> None:
    """A white frame in place of the chart: calibrate, or patches | solve | validate | report."""
    out, photo = tmp_path / "out", [str(shots / "white.dng"), "--lamp", "D55"]
    assert cli.main(["calibrate", *photo, "-o", str(out)]) == errors.ChartNotFound.exit_status
    assert sorted(path.name for path in out.iterdir()) == ["report.html", "result.json"]
    refused = json.loads((out / "result.json").read_text("utf-8"))
    assert refused["verdict"]["status"] == "refused"
    assert [reason["code"] for reason in refused["verdict"]["reasons"]] == ["chart_not_found"]
    assert "answer" not in refused
    err = capsys.readouterr().err
    assert (err.count("chart_not_found"), str(out / "report.html") in err) == (1, True)
    commands = [["solve", "-"], ["validate", "-", "--truth", str(shots / "truth.csv")]]
    for command in (["calibrate", *photo], ["patches", *photo], *commands):
        assert cli.main(command) == 4
        data, err = capsys.readouterr()
        feed(data)
        assert json.loads(data) == refused
        assert err.count("chart_not_found") == 1
    assert cli.main(["report", "-", "-o", str(tmp_path / "report")]) == 4
    assert json.loads((tmp_path / "report" / "result.json").read_text("utf-8")) == refused
    assert cli.main(["solve", str(tmp_path / "report" / "result.json")]) == 4
    assert json.loads(capsys.readouterr().out) == refused


def test_an_unknown_exception_is_one_line_and_a_request(swap: Swap, capsys: Capture) -> None:
    swap(RuntimeError("odd [/] thing\nsecond line"))
    call = ["calibrate", "x.dng", "--lamp", "D55"]
    assert cli.main(call) == cli.BUG
    out, err = capsys.readouterr()
    assert (out, "Traceback" in err) == ("", False)
    assert re.match(r"bug: RuntimeError: odd \[/\] thing second line\n.*report", err, re.DOTALL)
    for arguments in (["--debug", *call], [*call, "--debug"]):
        assert cli.main(arguments) == cli.BUG
        assert "Traceback" in capsys.readouterr().err


def test_ctrl_c_is_130_and_a_batch_resumes(swap: Swap, tmp_path: Path, monkeypatch: Patch, capsys: Capture) -> None:
    swap(KeyboardInterrupt())
    assert cli.main(["calibrate", "x.dng", "--lamp", "D55"]) == 130
    assert "Traceback" not in capsys.readouterr().err
    (tmp_path / "m.csv").write_text("name,photo,lamp\na,typo.dng,D55\n")
    monkeypatch.setattr(batch, "run_batch", raising(KeyboardInterrupt()))
    assert cli.main(["batch", str(tmp_path / "m.csv"), "-o", str(tmp_path / "out"), "--workers", "1"]) == 130
    assert "Run the same command again to resume" in capsys.readouterr().err


def test_arguments_arrive_in_their_order(swap: Swap) -> None:
    heard: dict[str, Any] = {}

    def listen(shots: list[Shot], *, options: Options, progress: Any, **more: Any) -> Any:
        heard.update(vars(options) | more, shots=shots)
        raise InvalidArgument("enough.", "")

    swap(listen)
    line = "calibrate a b --lamp D55 --lamp 2856K --white none --white w --dark d1 --dark NONE --fit 1,7-9,8 "
    line += "--signed --gamma 0.1 --l2 1 --white-reflectance 0.95 --lamp-tolerance 2% --lamp-tolerance 100K "
    line += "--lens-shading apply --light-per-patch 8% --corners none --corners"
    assert cli.main([*line.split(), "1,2 3,4 5,6.5 -7,8"]) == 2
    assert heard == {
        "shots": [
            Shot("a", "D55", None, "d1", None, "2%", "apply"),
            Shot("b", "2856K", "w", None, [[1, 2], [3, 4], [5, 6.5], [-7, 8]], "100K", "apply"),
        ],
        "white_reflectance": 0.95, "chart": "classic24", "basis": "auto", "fit": (1, 7, 8, 9), "nonnegative": False,
        "gamma": 0.1, "l2": 1.0, "engine": "onnx", "light_per_patch": 0.08, "truth": None, "previous": None,
    }  # fmt: skip


def test_help_and_version(capsys: Capture) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"camssf {camssf.__version__}\n"
    for command in ("demo", "calibrate", "batch", "simulate", "patches", "solve", "validate", "report", "lamps"):
        assert cli.main([command, "--help"]) == 0
        assert f"Example: camssf {'patches' if command == 'solve' else command}" in capsys.readouterr().out
    assert cli.main(["--help"]) == 0
    assert "..." not in capsys.readouterr().out.partition("Commands:")[2]  # no summary is cut off


def test_lists_are_one_name_a_line(capsys: Capture) -> None:
    for command, name in (("lamps", "LED-B3"), ("charts", "classic24"), ("cameras", "Nikon 5100 (NPL)")):
        assert cli.main([command]) == 0
        assert name in [line.partition("\t")[0] for line in capsys.readouterr().out.splitlines()]


def test_progress_shows_itself_on_long_work_only(swap: Swap, monkeypatch: Patch, capsys: Capture) -> None:
    def work(*_: Any, progress: Callable[[str, float], None], **__: Any) -> Any:
        progress("looking for the chart", 0.5)
        for timer in threading.enumerate():
            if isinstance(timer, threading.Timer) and cli.terminal.PROGRESS_AFTER == 0.0:
                timer.join()
        raise InvalidArgument("enough.", "")

    assert cli.terminal.PROGRESS_AFTER == 2.0
    swap(work)
    monkeypatch.setenv("TERM", "xterm-256color")
    for forced, after, shown in (("1", 0.0, True), ("1", 3600.0, False), ("", 0.0, False)):
        monkeypatch.setenv("FORCE_COLOR", forced)  # rich then takes stderr for a terminal
        monkeypatch.setattr(cli.terminal, "PROGRESS_AFTER", after)
        assert cli.main(["calibrate", "x.dng", "--lamp", "D55"]) == 2
        out, err = capsys.readouterr()
        assert (out, "looking for the chart" in err) == ("", shown)
    assert err == "invalid_argument: enough.\n  \n"
