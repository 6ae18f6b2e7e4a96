"""The command line, run as a user runs it: what goes where, what it exits with, what it leaves behind."""

import io
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import camssf
from camssf import cli, errors
from camssf.documents.forms import content_hash
from camssf.errors import CalibrationError, InvalidArgument
from camssf.fit.scores import rmse
from camssf.grid import WAVELENGTHS
from camssf.options import Options
from camssf.photo.shot import Shot
from camssf.recovery.basis import read_basis
from camssf.spectra import read_camera
from camssf_fleet.passport.keys import key_name, read_public

ROOT = Path(__file__).parents[2]
CAMERA = "Nikon 5100 (NPL)"
FILES = ["patches.csv", "report.html", "result.json", "ssf.csv", "ssf.svg"]


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """chart.dng, white.dng, dark.dng and truth.csv of a simulated camera, written by the command line."""
    folder = tmp_path_factory.mktemp("shots")
    assert (
        cli.main(
            ["simulate", "--camera", CAMERA, "--lamp", "D55", "--size", "900x675", "-o", str(folder), "--seed", "1"]
        )
        == 0
    )
    return folder


@pytest.fixture(scope="module")
def triple(shots: Path) -> list[str]:
    """The arguments of that capture."""
    frames = {kind: str(shots / f"{kind}.dng") for kind in ("chart", "white", "dark")}
    return [frames["chart"], "--lamp", "D55", "--white", frames["white"], "--dark", frames["dark"]]


@pytest.fixture(scope="module")
def result(shots: Path, triple: list[str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("result") / "deep" / "out"
    assert cli.main(["calibrate", *triple, "--truth", str(shots / "truth.csv"), "-o", str(out)]) == 0
    return out


@pytest.fixture
def feed(monkeypatch: pytest.MonkeyPatch) -> Callable[[str | bytes], None]:
    """Put something on stdin."""

    def put(data: str | bytes) -> None:
        raw = data if isinstance(data, bytes) else data.encode()
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(raw), "utf-8"))

    return put


def swap(monkeypatch: pytest.MonkeyPatch, name: str, value: Any) -> None:
    """Replace something in camssf.calibration."""
    monkeypatch.setattr(import_module("camssf.calibration"), name, value)


def raising(error: BaseException) -> Callable[..., Any]:
    def fail(*_: Any, **__: Any) -> Any:
        raise error

    return fail


def leaves() -> list[type[CalibrationError]]:
    kinds = [CalibrationError]
    for kind in kinds:
        kinds.extend(kind.__subclasses__())
    return [kind for kind in kinds if kind.__module__ == "camssf.errors" and not kind.__subclasses__()]


# The whole way


@pytest.mark.requirement("R-PIPELINE")
def test_calibrate_leaves_four_files_and_prints_no_data(result: Path, shots: Path) -> None:
    assert sorted(path.name for path in result.iterdir()) == FILES
    document = json.loads((result / "result.json").read_text("utf-8"))
    assert document["format"] == "camssf/2"
    assert document["verdict"]["status"] in ("accepted", "doubtful")
    truth = np.genfromtxt(shots / "truth.csv", delimiter=",", skip_header=1)
    found = np.genfromtxt(result / "ssf.csv", delimiter=",", skip_header=1)
    inside = (found[:, 0] >= 400) & (found[:, 0] <= 700)
    for channel in (1, 2, 3):
        known = np.interp(found[:, 0], truth[:, 0], truth[:, channel])
        known /= known.max()
        # computed here from the two CSV files, so that the printed number has a witness
        rmse = float(np.sqrt(np.mean((found[inside, channel] - known[inside]) ** 2)))
        assert rmse == pytest.approx(document["answer"]["scores"]["rmse"][channel - 1], rel=1e-3)
        assert rmse < 0.10  # of the peak; the mean of 87 cameras is 0.05, a wrong answer is above 0.15


def test_calibrate_without_a_folder_is_json_on_stdout(triple: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["calibrate", *triple]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["format"] == "camssf/2"
    assert err.startswith("verdict: ")  # first, then what it is worth
    assert "colour error about" in err.splitlines()[1]


@pytest.mark.requirement("R-PIPELINE")
def test_the_pipe_is_calibrate_in_steps(
    triple: list[str],
    shots: Path,
    result: Path,
    tmp_path: Path,
    feed: Callable[[str], None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    """patches | solve | validate | report, in process: each takes the stdout of the one before."""
    whole = (result / "result.json").read_text("utf-8")
    truth = ["--truth", str(shots / "truth.csv")]
    for arguments in (["patches", *triple], ["solve", "-"], ["validate", "-", *truth]):
        assert cli.main(arguments) == 0
        data = capsys.readouterr().out
        feed(data)
    assert data == whole

    photo = ["--photo", triple[0]]
    assert cli.main(["report", "-", "-o", str(tmp_path / "out"), *photo]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == FILES
    assert (tmp_path / "out" / "ssf.csv").read_bytes() == (result / "ssf.csv").read_bytes()
    assert "data:image/jpeg" in (tmp_path / "out" / "report.html").read_text("utf-8")


@pytest.mark.full
def test_a_real_pipe_of_processes(triple: list[str]) -> None:
    camssf_ = [sys.executable, "-m", "camssf"]
    first = subprocess.Popen([*camssf_, "patches", *triple], stdout=subprocess.PIPE)
    with first:
        done = subprocess.run(
            [*camssf_, "solve", "-"], stdin=first.stdout, capture_output=True, text=True, timeout=120
        )
    assert first.returncode == 0
    assert done.returncode == 0
    assert json.loads(done.stdout)["format"] == "camssf/2"


def test_a_closed_pipe_is_no_bug() -> None:
    done = subprocess.run(
        ["bash", "-c", f"{sys.executable} -m camssf lamps | head -n 1"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stdout == "A\n"
    assert "bug" not in done.stderr
    assert "Traceback" not in done.stderr


def test_a_report_shows_no_other_photo(result: Path, triple: list[str], tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert cli.main(["report", str(result / "result.json"), "-o", str(out), "--photo", triple[4]]) == 2
    assert not out.exists()


def test_a_report_beside_a_passport_and_another_result(
    result: Path, triple: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("cryptography", reason="cryptography is not here: nothing is signed")
    own, keys, out = result / "result.json", tmp_path / "keys", tmp_path / "out"
    assert cli.main(["passport", "key", "-o", str(keys)]) == 0
    assert cli.main(["passport", "key", "-o", str(tmp_path / "strange")]) == 0
    private, public = keys / "passport-key.pem", keys / "passport-key.pub.pem"
    signed = tmp_path / "camera.jws"
    said = ["--serial", "A1B2", "--captured", "2026-11-22T10:30:00+01:00"]
    assert cli.main(["passport", "sign", str(own), "--key", str(private), "-o", str(signed), *said]) == 0
    secret = private.read_bytes()
    for lost in (private, own):
        assert cli.main(["passport", "sign", str(own), "--key", str(private), "-o", str(lost), *said]) == 2
    assert private.read_bytes() == secret
    beside = [str(own), "-o", str(out), "--passport", str(signed)]
    assert cli.main(["report", *beside]) == 0
    page = (out / "report.html").read_text("utf-8")
    for words in ("A1B2", "2026-11-22 10:30:00+01:00", "not verified for this page"):
        assert words in page
    assert cli.main(["report", *beside, "--key", str(public)]) == 0
    assert "Signature verified." in (out / "report.html").read_text("utf-8")
    assert (out / "result.json").read_bytes() == own.read_bytes()
    before = (out / "report.html").read_bytes()
    strange = str(tmp_path / "strange" / "passport-key.pub.pem")
    assert cli.main(["report", *beside, "--key", strange]) == 10
    revoked = tmp_path / "revoked.jws"
    name = key_name(read_public([public]).popitem()[1])
    assert cli.main(["passport", "revoke", name, "--key", str(private), "-o", str(revoked)]) == 0
    assert cli.main(["report", *beside, "--key", str(public), "--revoked", str(revoked)]) == 10
    assert cli.main(["report", *beside, "--revoked", str(revoked)]) == 2  # nobody's signature was verified
    changed = tmp_path / "changed.json"
    changed.write_bytes(own.read_bytes() + b" ")
    for key in ([], ["--key", str(public)]):
        call = ["report", str(changed), "-o", str(out), "--passport", str(signed), *key]
        assert cli.main(call) == 10
        assert "another result" in capsys.readouterr().err
    assert cli.main(["report", str(own), "-o", str(out), "--key", str(public)]) == 2
    assert (out / "report.html").read_bytes() == before


@pytest.mark.requirement("R-PIPELINE")
def test_demo(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["demo", "-o", str(tmp_path / "out")]) == 0
    _, err = capsys.readouterr()
    out = tmp_path / "out"
    assert sorted(path.name for path in out.iterdir()) == sorted([*FILES, "named", "shots"])
    assert sorted(path.name for path in (out / "named").iterdir()) == FILES
    assert str(out / "report.html") in err
    unnamed, named = (
        json.loads(path.read_text("utf-8")) for path in (out / "result.json", out / "named" / "result.json")
    )
    assert len(unnamed["answer"]["lights"]) == 1
    assert named["capture"]["shots"][0]["lamp"]["name"] == "D55"
    assert {each["capture"]["shots"][0]["photo"]["model"] for each in (unnamed, named)} == {"Demo phone"}
    unnamed, named = unnamed["answer"], named["answer"]
    page = (out / "report.html").read_text("utf-8")
    mean = read_basis("phones").mean.T
    without = rmse(mean / mean.max(axis=0), read_camera("Demo phone").values)
    for found in (without, unnamed["scores"]["rmse"], named["scores"]["rmse"]):
        assert all(f"{value:.3f}" in err for value in found)
    for found in (without, unnamed["scores"]["rmse"]):
        assert all(f"{value:.3f}" in page for value in found)
    (shown,) = re.findall(r"```text\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    printed = {" ".join(line.split()).replace("┃", "│") for line in err.splitlines()}
    assert {" ".join(line.split()) for line in shown.splitlines()} <= printed
    assert np.mean(unnamed["scores"]["rmse"]) < 0.8 * np.mean(without)  # the photo is worth something
    assert cli.main(["demo", "-o", str(out)]) == 0  # its own it replaces


@pytest.mark.parametrize("name", ["chart.dng", "white.dng", "truth.csv"])
def test_a_simulation_replaces_no_file_of_another(name: str, shots: Path, tmp_path: Path) -> None:
    words = ["simulate", "--lamp", "D55", "--size", "480x360", "-o", str(tmp_path)]
    own = tmp_path / name
    own.write_bytes(b"mine")
    assert cli.main(words) == InvalidArgument.exit_status
    assert own.read_bytes() == b"mine"
    assert list(tmp_path.iterdir()) == [own]
    own.unlink()
    assert [cli.main(words), cli.main(words)] == [0, 0]  # its own it replaces


class Terminal(io.StringIO):
    """A stdout that is a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_no_json(
    triple: list[str],
    result: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    document = str(result / "result.json")
    for words, shown in (
        (["simulate", "--lamp", "D55", "--size", "480x360", "-o", str(tmp_path)], "truth.csv"),
        (["patches", *triple], "24 patches measured"),
        (["validate", document], "verdict: "),
    ):
        terminal = Terminal()
        monkeypatch.setattr(sys, "stdout", terminal)
        assert cli.main(words) == 0
        assert shown in capsys.readouterr().err
        assert terminal.getvalue() == ""


def test_simulate_says_what_it_wrote(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "shots"
    arguments = ["simulate", "--lamp", "D55", "--lamp", "2856K", "--size", "480x360", "-o", str(out)]
    assert cli.main(arguments) == 0
    said = json.loads(capsys.readouterr().out)
    assert [shot["lamp"] for shot in said["shots"]] == ["D55", "2856K"]
    paths = {Path(shot[kind]) for shot in said["shots"] for kind in ("chart", "white", "dark")} | {
        Path(said["truth"]),
        Path(said["corners"]),
    }
    assert paths == set(out.iterdir())


def test_the_corners_that_simulate_wrote_are_taken(
    shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By `calibrate` as they stand: its answer is that of the same four points written out, and lies on the truth."""
    photo, stored = str(shots / "chart.dng"), shots / "corners.json"
    true = json.loads(stored.read_text("utf-8"))["photos"]["chart.dng"]
    assert true["layout"] == "classic24"
    text = " ".join(f"{x!r},{y!r}" for x, y in true["corners"])
    answers = []
    for corners in (str(stored), text):
        assert cli.main(["calibrate", photo, "--lamp", "D55", "--basis", "cameras", "--corners", corners]) == 0
        answers.append(json.loads(capsys.readouterr().out))
    assert answers[0] == answers[1]
    pose = answers[0]["capture"]["shots"][0]["pose"]
    assert pose["method"] == "by hand"
    np.testing.assert_allclose(pose["corners"], true["corners"], atol=1.0)  # moved to the printed borders


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "Cannot read the corners"),
        ("{", "holds no corners"),
        ("[" * 100_000, "holds no corners"),
        ('{"format": "camssf-corners/2", "photos": {}}', "holds no corners"),
        ('{"format": "camssf-corners/1", "photos": {"chart.dng": {"corners": [[1, 2]]}}}', "holds no corners"),
        ('{"format": "camssf-corners/1", "photos": {"chart.dng": {"corners": "1234"}}}', "holds no corners"),
        ('{"format": "camssf-corners/1", "photos": {"chart.dng": [4]}}', "holds no corners"),
        ("7", "holds no corners"),
        ('{"format": "camssf-corners/1", "photos": []}', "holds no corners"),
        ('{"format": "camssf-corners/1", "photos": {"other.dng": {}}}', "names no photo chart.dng"),
        (" " * (1 << 20) + "{}", "holds no corners"),
    ],
)
def test_a_wrong_file_of_corners_is_said(
    content: str | None, words: str, shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored = tmp_path / "corners.json"
    if content is not None:
        stored.write_text(content, "utf-8")
    photo = str(shots / "chart.dng")
    assert cli.main(["calibrate", photo, "--lamp", "D55", "--corners", str(stored), "-o", str(tmp_path / "o")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert err.startswith("invalid_argument: ")


def test_the_readme_s_python_runs(
    triple: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    block = text.partition("```python\n")[2].partition("```")[0]
    for source, name in zip((triple[0], triple[4], triple[6]), ("photo.dng", "white.dng", "dark.dng"), strict=True):
        shutil.copy(source, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(compile(block, "README.md", "exec"), names)
    assert names["curves"].shape == (681, 3)
    assert capsys.readouterr().out.startswith(("accepted", "doubtful"))


@pytest.mark.full
def test_batch_end_to_end(triple: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = tmp_path / "manifest.csv"
    chart, _, _, _, white, _, dark = triple
    manifest.write_text(
        f"name,photo,lamp,white,dark,chart\ngood,{chart},D55,{white},{dark},\nbad,{chart},no-such-lamp,,,\n", "utf-8"
    )
    out = tmp_path / "out"
    assert cli.main(["batch", str(manifest), "-o", str(out), "--workers", "1"]) == cli.BATCH_FAILED
    stdout, err = capsys.readouterr()
    assert stdout == ""
    assert "1 of 2 calibrated" in err
    assert sorted(path.name for path in (out / "good").iterdir()) == sorted([*FILES, "batch.json"])
    before = (out / "good" / "result.json").stat().st_mtime_ns
    assert cli.main(["batch", str(manifest), "-o", str(out), "--workers", "1"]) == cli.BATCH_FAILED
    assert "(unchanged)" in capsys.readouterr().err
    assert (out / "good" / "result.json").stat().st_mtime_ns == before


# Refusals


@pytest.mark.requirement("R-REFUSAL")
@pytest.mark.parametrize("kind", leaves(), ids=lambda kind: kind.code)
def test_each_family_has_its_exit_status(
    kind: type[CalibrationError], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    swap(monkeypatch, "attempt", raising(kind("What [is] wrong.", "What to do.")))
    assert cli.main(["calibrate", "x.dng", "--lamp", "D55", "-o", str(tmp_path / "out")]) == kind.exit_status
    out, err = capsys.readouterr()
    assert out == ""
    assert err == f"{kind.code}: What [is] wrong.\n  What to do.\n"
    assert not (tmp_path / "out").exists()


@pytest.mark.requirement("R-REFUSAL")
def test_a_refused_capture_leaves_its_evidence(
    shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A white frame in place of the chart."""
    out = tmp_path / "out"
    arguments = ["calibrate", str(shots / "white.dng"), "--lamp", "D55"]
    assert cli.main([*arguments, "-o", str(out)]) == errors.ChartNotFound.exit_status
    assert sorted(path.name for path in out.iterdir()) == ["report.html", "result.json"]
    document = json.loads((out / "result.json").read_text("utf-8"))
    assert document["verdict"]["status"] == "refused"
    assert [reason["code"] for reason in document["verdict"]["reasons"]] == ["chart_not_found"]
    assert "ssf" not in document
    _, err = capsys.readouterr()
    assert err.count("chart_not_found") == 1
    assert str(out / "report.html") in err

    assert cli.main(arguments) == errors.ChartNotFound.exit_status
    assert json.loads(capsys.readouterr().out) == document


def state(folder: Path) -> dict[str, bytes | None]:
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


@pytest.fixture
def good(result: Path, tmp_path: Path) -> Path:
    """A folder with a result, beside which nothing else stands."""
    return Path(shutil.copytree(result, tmp_path / "good"))


@pytest.mark.requirement("R-REFUSAL")
@pytest.mark.parametrize(
    ("photo", "lamp"),
    [
        *((name, "D55") for name in ("typo.dng", "folder", "empty.dng", "picture.jpg", "note.dng")),
        *((name, lamp) for name in ("s3://bucket/photo.dng", "white: typo.dng") for lamp in ("D55", "tungstn")),
    ],
)
def test_a_wrong_input_writes_nothing_and_deletes_nothing(
    photo: str,
    lamp: str,
    good: Path,
    shots: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(good.parent)
    Path("folder").mkdir()
    for name, content in (("empty.dng", b""), ("picture.jpg", b"\xff\xd8\xff\xe0" + bytes(99)), ("note.dng", b"hi")):
        Path(name).write_bytes(content)
    before = state(good.parent)
    white = photo.removeprefix("white: ")
    words = [photo] if white == photo else [str(shots / "chart.dng"), "--white", white]
    assert cli.main(["calibrate", *words, "--lamp", lamp, "-o", "good/"]) in (2, 3)
    assert cli.main(["calibrate", *words, "--lamp", lamp, "-o", "new/"]) in (2, 3)
    assert state(good.parent) == before
    assert "Traceback" not in capsys.readouterr().err


def test_a_refusal_replaces_no_result(good: Path, shots: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = state(good)
    wrong = ["calibrate", str(shots / "white.dng"), "--lamp", "D55"]
    for _ in range(2):
        assert cli.main([*wrong, "-o", str(good)]) == errors.ChartNotFound.exit_status
        _, err = capsys.readouterr()
        assert f"The result in {good} was kept as it is." in err
        assert str(good / "refused" / "report.html") in err
        after = state(good)
        assert {name: content for name, content in after.items() if not name.startswith("refused")} == before
        assert sorted(after.keys() - before.keys()) == ["refused", "refused/report.html", "refused/result.json"]
    alone = Path(shutil.copytree(good / "refused", good.parent / "alone")) / "result.json"
    shutil.rmtree(good / "refused")
    assert cli.main(["report", str(alone), "-o", str(good)]) == errors.ChartNotFound.exit_status
    _, err = capsys.readouterr()
    assert f"The result in {good} was kept as it is." in err
    assert f"report: {good / 'refused' / 'report.html'}" in err
    assert {name: state(good)[name] for name in before} == before


def test_other_commands_replace_no_result(good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (good.parent / "other.json").write_bytes((good / "result.json").read_bytes())
    real = json.loads((good / "result.json").read_text("utf-8"))
    real["capture"]["shots"][0]["photo"]["make"] = "Canon"
    del real["sha256"]
    (good / "result.json").write_text(json.dumps(real), "utf-8")
    before = state(good)
    assert cli.main(["demo", "-o", str(good)]) == 2
    assert "holds a result that is not from a demo" in capsys.readouterr().err
    for name in ("result.json", "ssf.csv", "report.html"):
        assert cli.main(["export", str(good.parent / "other.json"), "--to", "csv", "-o", str(good / name)]) == 2
        assert "belongs to the result in" in capsys.readouterr().err
    assert state(good) == before


URL = "https://bucket/x"


@pytest.mark.parametrize(
    "words",
    [
        ["calibrate", URL],
        ["calibrate", "CHART", "--lamp", URL],
        ["calibrate", "CHART", "--lamp", "D55", "--white", URL],
        ["calibrate", "CHART", "--lamp", "D55", "--dark", URL],
        ["calibrate", "CHART", "--lamp", "D55", "--chart", URL],
        ["calibrate", "CHART", "--lamp", "D55", "--chart", f"classic24:{URL}"],
        ["calibrate", "CHART", "--lamp", "D55", "--corners", f"{URL}.json"],
        ["calibrate", "CHART", "--lamp", "D55", "-o", URL],
        ["patches", URL],
        ["simulate", "--lamp", "D55", "-o", URL],
        ["simulate", "--camera", f"{URL}.csv", "--lamp", "D55", "-o", "out"],
        ["simulate", "--camera", f"{URL}.csv:Canon", "--lamp", "D55", "-o", "out"],
        ["demo", "-o", URL],
        ["batch", URL],
        ["batch", "m.csv", "-o", URL],
        ["batch", "m.csv", "--basis", URL],
        ["batch", "m.csv", "--registry", URL],
        ["batch", "m.csv", "--registry", "r", "-o", URL],
        ["batch", "m.csv", "--registry", "r", "--basis", URL],
        ["batch", URL, "--registry", "r"],
        ["solve", URL],
        ["validate", URL],
        ["validate", "RESULT", "--truth", URL],
        ["report", URL],
        ["report", "RESULT", "-o", URL],
        ["report", "RESULT", "--photo", URL],
        ["report", "RESULT", "--passport", URL],
        ["export", URL, "-o", "x.csv"],
        ["export", "RESULT", "-o", URL],
        ["export", "RESULT", "--to", "icc", "--lamp", URL, "-o", "x.icc"],
        ["colour", URL, "CHART", "--region", "9,9,9,9", "--white-region", "9,9,9,9"],
        ["colour", "RESULT", URL, "--region", "9,9,9,9", "--white-region", "9,9,9,9"],
        ["colour", "RESULT", "CHART", "--region", "9,9,9,9", "--white-region", "9,9,9,9", "--dark", URL],
        ["spectrum", URL, "CHART", "--region", "9,9,9,9", "--white-region", "9,9,9,9"],
        ["spectrum", "RESULT", URL, "--region", "9,9,9,9", "--white-region", "9,9,9,9"],
        ["spectrum", "RESULT", "CHART", "--region", "9,9,9,9", "--white-region", "9,9,9,9", "--prior", URL],
        ["spectrum", "RESULT", "CHART", "--region", "9,9,9,9", "--white-region", "9,9,9,9", "--index", URL],
        ["direct", URL],
        ["direct", f"{URL}.csv", f"{URL}.csv"],
        ["direct", "sweep.csv", "-o", URL],
        ["parity", URL, "CHART"],
        ["parity", "RESULT", URL],
        ["passport", "key", "-o", URL],
        ["passport", "sign", "RESULT", "--key", URL, "-o", "x.jws"],
        ["passport", "verify", URL, "--key", "k.pem"],
        ["registry", "add", URL, "RESULT"],
        ["registry", "add", "r", URL],
        ["registry", "list", URL],
        ["registry", "compare", URL, "--model", "x"],
        ["registry", "export", URL, "-o", "x.csv"],
    ],
    ids=" ".join,
)
def test_a_url_is_refused_by_name(
    words: list[str],
    shots: Path,
    result: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.csv").write_text("name,photo,lamp\na,x.dng,D55\n")
    before = state(tmp_path)
    places = {"CHART": str(shots / "chart.dng"), "RESULT": str(result / "result.json")}
    assert cli.main([places.get(word, word) for word in words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"invalid_argument: {URL}") or f":{URL}" in err
    assert "is a URL; camssf reads and writes local files only" in err
    assert state(tmp_path) == before


def test_a_url_in_a_manifest_is_its_row_s_fault(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = tmp_path / "m.csv"
    rows = [
        f"{URL},D55,,,",
        f"x.dng,{URL},,,",
        f"x.dng,D55,{URL},,",
        f"x.dng,D55,,{URL},",
        f"x.dng,D55,,,nano24:{URL}",
    ]
    lines = [f"n{i},{row}" for i, row in enumerate(rows)]
    manifest.write_text("\n".join(["name,photo,lamp,white,dark,chart", *lines]) + "\n")
    assert cli.main(["batch", str(manifest), "-o", str(tmp_path / "out"), "--workers", "1"]) == cli.BATCH_FAILED
    assert "run the same command again: what is done is not done again" in capsys.readouterr().err
    summary = (tmp_path / "out" / "summary.csv").read_text("utf-8")
    assert summary.count(f"{URL} is a URL; camssf reads and writes local files only.") == len(rows)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["summary.csv"]


def test_a_refused_result_stays_refused_down_the_pipe(
    shots: Path, tmp_path: Path, feed: Callable[[str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    cli.main(["calibrate", str(shots / "white.dng"), "--lamp", "D55"])
    feed(capsys.readouterr().out)
    assert cli.main(["validate", "-", "--truth", str(shots / "truth.csv")]) == 4
    feed(capsys.readouterr().out)
    assert cli.main(["report", "-", "-o", str(tmp_path / "out")]) == 4
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["report.html", "result.json"]


def test_a_refusal_goes_through_solve(
    shots: Path, tmp_path: Path, feed: Callable[[str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    """patches | solve | validate | report of a photo without a chart: the evidence arrives, the status with it."""
    assert cli.main(["patches", str(shots / "white.dng"), "--lamp", "D55"]) == 4
    data = capsys.readouterr().out
    refused = json.loads(data)
    assert refused["verdict"]["status"] == "refused"
    truth = ["--truth", str(shots / "truth.csv")]
    for command in (["solve", "-"], ["validate", "-", *truth]):
        feed(data)
        assert cli.main(command) == 4
        data, err = capsys.readouterr()
        assert json.loads(data) == refused
        assert err.count("chart_not_found") == 1
    feed(data)
    assert cli.main(["report", "-", "-o", str(tmp_path / "out")]) == 4
    assert json.loads((tmp_path / "out" / "result.json").read_text("utf-8")) == refused
    assert cli.main(["solve", str(tmp_path / "out" / "result.json")]) == 4
    assert json.loads(capsys.readouterr().out) == refused


def test_solve_takes_a_result(
    result: Path, shots: Path, capsys: pytest.CaptureFixture[str], feed: Callable[[str | bytes], None]
) -> None:
    """Its photos are solved again."""
    assert cli.main(["solve", str(result / "result.json")]) == 0
    feed(capsys.readouterr().out)
    assert cli.main(["validate", "-", "--truth", str(shots / "truth.csv")]) == 0
    assert capsys.readouterr().out == (result / "result.json").read_text("utf-8")


FULL = Path("/dev/full")


@pytest.mark.full
@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("command", ["validate", "lamps", "--version", "--help", "refused"])
def test_a_full_disk_behind_stdout_is_said(command: str, result: Path, shots: Path) -> None:
    """In a process of its own: Python writes once more at its end. All JSON is printed as `validate` does."""
    arguments = {
        "refused": ["calibrate", str(shots / "white.dng"), "--lamp", "D55"],
        "validate": ["validate", str(result / "result.json")],
    }.get(command, [command])
    with FULL.open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "camssf", *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
        )
    assert "No space left on device" in done.stderr
    for word in ("bug", "fault", "Traceback", "Exception"):
        assert word not in done.stderr
    if command == "refused":  # the refusal is the greater news
        assert done.returncode == errors.ChartNotFound.exit_status
        assert "chart_not_found: " in done.stderr
    else:
        assert done.returncode == InvalidArgument.exit_status
        assert "invalid_argument: " in done.stderr


def test_a_short_write_of_unbuffered_output_is_said(result: Path, tmp_path: Path) -> None:
    """PYTHONUNBUFFERED, usual in containers, makes stdout a raw file, which takes what fits and goes on."""
    short = (
        f"ulimit -f 8; exec {sys.executable} -m camssf validate {result / 'result.json'} > {tmp_path / 'short.json'}"
    )
    done = subprocess.run(
        ["bash", "-c", short],
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    assert done.returncode == InvalidArgument.exit_status
    assert "cannot be written" in done.stderr


def test_a_closed_stdout_is_said() -> None:
    done = subprocess.run(
        ["bash", "-c", f"{sys.executable} -m camssf lamps >&-"], stderr=subprocess.PIPE, text=True, timeout=60
    )
    assert done.returncode == InvalidArgument.exit_status
    assert "Standard output is closed" in done.stderr


def test_without_a_lamp_a_camera_is_refused(triple: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """The same as `--lamp auto`: only a phone's curves can do without."""
    for words in ([], ["--lamp", "auto"]):
        assert cli.main(["calibrate", triple[0], *words]) == errors.LampUnfit.exit_status
        out, err = capsys.readouterr()
        assert json.loads(out)["verdict"]["reasons"][0]["code"] == "lamp_unfit"
        assert "the light's spectrum was not given" in err
        assert "daylight, bulb, white-led, fluorescent" in err


def test_patches_need_no_lamp(triple: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["patches", triple[0]]) == 0
    out, _ = capsys.readouterr()
    assert json.loads(out)["capture"]["shots"][0]["lamp"] == {"kind": "unnamed", "name": "auto"}


@pytest.mark.parametrize(
    ("command", "data", "words"),
    [
        ("solve", "", "is empty"),
        ("solve", "{", "is not valid JSON"),
        ("solve", b"\xff\xfe", "is not valid JSON"),
        ("solve", "[]", "standard input: the document must be an object, is a list"),
        ("solve", '{"a": 1}', "the document is not camssf/2"),
        ("solve", '{"format": "camssf-result/1"}', "camssf-result/1, not camssf/2; that form was never"),
        ("solve", '{"format": "camssf-patches/1"}', "camssf-patches/1, not camssf/2; that form was never"),
        (
            "solve",
            '{"format": "camssf/2", "version": "", "capture": {"chart": 1, "shots": []}}',
            "capture.chart must",
        ),
        (
            "solve",
            '{"format": "camssf/2", "version": "", "capture": {"shots": [1]}}',
            "standard input: capture lacks chart",
        ),
        ("validate", '{"format": "camssf/2", "version": ""}', "was not solved"),
        ("validate", '{"format": "camssf/2", "verdict": {"status": "refused"}}', "lacks version"),
        ("report", '{"format": "camssf/2", "version": "", "verdict": {"status": "good"}}', "verdict.status must be"),
        ("report", "NaN", "is not valid JSON"),
        ("solve", "[" * 100_000, "is not valid JSON"),
        ("solve", '{"format": "camssf/2", "format": "camssf/2"}', "the same key twice"),
        ("validate", '{"format": "camssf/2", "a": 1, "a": 1}', "the same key twice"),
        ("solve", '{"format": "camssf/2", "version": -Infinity}', "is not a number"),
    ],
)
def test_bad_json_is_2(
    command: str,
    data: str | bytes,
    words: str,
    tmp_path: Path,
    feed: Callable[[str | bytes], None],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    feed(data)
    assert cli.main([command, "-"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("invalid_argument: ")
    assert words in err
    assert str(tmp_path.parent.parent) not in err
    assert tempfile.gettempdir() not in err  # no temporary name in the words
    assert not list(tmp_path.iterdir())


def test_a_key_twice_is_found_in_files_and_on_stdin(
    result: Path, tmp_path: Path, feed: Callable[[bytes], None], capsys: pytest.CaptureFixture[str]
) -> None:
    """Which of the two counts would else be the parser's choice."""
    text = (result / "result.json").read_text("utf-8").replace('"basis"', '"basis": "other", "basis"', 1)
    (tmp_path / "twice.json").write_text(text, "utf-8")
    for source in ("-", str(tmp_path / "twice.json")):
        feed(text.encode())
        assert cli.main(["validate", source]) == 2
        assert "the same key twice" in capsys.readouterr().err


def test_standard_input_is_written_nowhere(
    result: Path, feed: Callable[[bytes], None], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("TemporaryDirectory", "NamedTemporaryFile", "mkstemp", "mkdtemp"):
        monkeypatch.setattr(tempfile, name, raising(AssertionError("a temporary file")))
    feed((result / "result.json").read_bytes())
    assert cli.main(["validate", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["format"] == "camssf/2"


def test_no_standard_input_is_said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    assert cli.main(["solve", "-"]) == 2
    assert "closed" in capsys.readouterr().err


LATIN = os.fsdecode(b"gr\xfcn")
"""Half of a name in Latin-1, as old cards and archives hold it: no UTF-8."""


def spoken(arguments: list[str], coding: str = "utf-8") -> tuple[int, bytes, bytes]:
    """Status, stdout and stderr of a command with strict streams: what cannot be encoded is an exception."""
    out, err = (io.TextIOWrapper(io.BytesIO(), coding, errors="strict") for _ in range(2))
    with redirect_stdout(out), redirect_stderr(err):
        status = cli.main(arguments)
    out.flush()
    err.flush()
    return status, out.buffer.getvalue(), err.buffer.getvalue()  # type: ignore[attr-defined]


@pytest.mark.full
@pytest.mark.skipif(sys.platform != "linux", reason="names are Unicode there")
def test_names_that_are_no_utf8(shots: Path, tmp_path: Path) -> None:
    """Every command that takes or writes files, in a folder and with files of such names."""
    home = tmp_path / LATIN
    home.mkdir()
    frames = {role: str(home / f"{LATIN}-{role}.dng") for role in ("chart", "white", "dark")}
    for role, path in frames.items():
        shutil.copyfile(shots / f"{role}.dng", path)
    truth, manifest = str(home / f"{LATIN}.csv"), home / f"{LATIN}-m.csv"
    shutil.copyfile(shots / "truth.csv", truth)
    shutil.copyfile(frames["chart"], home / "b.dng")
    manifest.write_text("name,photo,lamp\na,missing.dng,D55\nb,b.dng,D55\n")
    photo = [frames["chart"], "--lamp", "D55", "--white", frames["white"], "--dark", frames["dark"]]
    patches, found = home / f"{LATIN}-p.json", home / f"{LATIN}-r.json"
    missing = str(home / f"{LATIN}-none")
    commands: list[tuple[list[str], int, Path | None]] = [
        (["simulate", "--lamp", "D55", "--size", "600x450", "-o", str(home / "s")], 0, None),
        (["calibrate", *photo, "--truth", truth, "-o", str(home / "out")], 0, None),
        (["patches", *photo], 0, patches),
        (["solve", str(patches)], 0, found),
        (["validate", str(found), "--truth", truth], 0, None),
        (["report", str(found), "-o", str(home / "report"), "--photo", frames["chart"]], 0, None),
        (["report", str(found), "-o", str(home / "other"), "--photo", frames["white"]], 2, None),
        (["parity", str(found), *photo[:1], *photo[3:]], 0, None),
        (["batch", str(manifest), "-o", str(home / "batch"), "--workers", "1"], cli.BATCH_FAILED, None),
        (["calibrate", frames["white"], "--lamp", "D55", "-o", str(home / "refused")], 4, None),
        (["calibrate", missing, "--lamp", "D55"], 3, None),
        (["calibrate", *photo, "--basis", missing], 2, None),
        (["calibrate", *photo, "--chart", missing], 2, None),
        (["calibrate", frames["chart"], "--lamp", missing], 2, None),
        (["solve", missing], 2, None),
        (["direct", missing, missing], 2, None),
        (["calibrate", frames["chart"], "--lamp", "D55", "--corners", LATIN], 2, None),
    ]
    for arguments, status, keep in commands:
        ended, out, err = spoken(arguments)
        words = err.decode("utf-8")
        assert ended == status, (arguments[0], words)
        assert "fault. Run" not in words
        if out:
            json.loads(out.decode("utf-8"))
        if keep is not None:
            keep.write_bytes(out)
    written = [path for path in home.rglob("*") if path.suffix in (".json", ".csv", ".html")]
    assert len(written) > 12
    for path in written:
        path.read_text("utf-8")
    assert json.loads((home / "out" / "result.json").read_text("utf-8"))["capture"]["shots"][0]["photo"]["name"] == (
        "gr\ufffdn-chart.dng"
    )


@pytest.mark.parametrize("coding", ["ascii", "latin-1", "utf-16"])
def test_json_is_utf8_on_a_terminal_of_another_coding(coding: str, result: Path, tmp_path: Path) -> None:
    document = json.loads((result / "result.json").read_text("utf-8"))
    document["capture"]["shots"][0]["photo"]["name"] = "Späße \u6f22.dng"
    del document["sha256"]
    (tmp_path / "r.json").write_text(json.dumps(document), "utf-8")
    status, out, err = spoken(["validate", str(tmp_path / "r.json")], coding)
    assert status == 0, err
    said = json.loads(out.decode("ascii" if coding != "utf-16" else coding))
    assert said.pop("sha256") == content_hash(document)
    assert said == document
    assert spoken(["cameras"], coding)[0] == 0


def test_words_steer_no_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file's name may hold what a terminal obeys."""
    assert cli.main(["calibrate", str(tmp_path / "\x1b]0;own\x07\x1b[2J\x9b31m\u202egnp.dng"), "--lamp", "D55"]) == 3
    err = capsys.readouterr().err
    assert "There is no file" in err
    assert not set(err) & set("\x1b\x07\x9b\u202e")


def test_an_unknown_exception_is_one_line_and_a_request(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    swap(monkeypatch, "attempt", raising(RuntimeError("odd [/] thing\nsecond line")))
    call = ["calibrate", "x.dng", "--lamp", "D55"]
    assert cli.main(call) == cli.BUG
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("bug: RuntimeError: odd [/] thing second line\n")
    assert "report" in err
    assert "Traceback" not in err
    for arguments in (["--debug", *call], [*call, "--debug"]):
        assert cli.main(arguments) == cli.BUG
        assert "Traceback" in capsys.readouterr().err


def test_ctrl_c_is_130(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    swap(monkeypatch, "attempt", raising(KeyboardInterrupt()))
    assert cli.main(["calibrate", "x.dng", "--lamp", "D55"]) == 130
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["solve", "DNG"],
        ["validate", "DNG"],
        ["report", "DNG"],
        ["export", "DNG", "-o", "x.csv"],
        ["colour", "DNG", "DNG", "--region", "9,9,9,9", "--white-region", "9,9,9,9"],
        ["spectrum", "DNG", "DNG", "--region", "9,9,9,9", "--white-region", "9,9,9,9"],
        ["spectrum", "RESULT", "DNG", "--region", "9,9,9,9", "--white-region", "9,9,9,9", "--prior", "DNG"],
        ["parity", "DNG", "DNG"],
        ["batch", "DNG"],
        ["batch", "DNG", "--registry", "r"],
        ["direct", "DNG"],
        ["calibrate", "DNG", "--lamp", "DNG"],
        ["calibrate", "DNG", "--lamp", "D55", "--chart", "DNG"],
        ["validate", "RESULT", "--truth", "DNG"],
        ["registry", "add", "r", "DNG"],
    ],
    ids=" ".join,
)
def test_a_photo_in_another_file_s_place_is_named(
    words: list[str],
    shots: Path,
    result: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(shots / "white.dng", "photo.dng")
    places = {"DNG": "photo.dng", "RESULT": str(result / "result.json")}
    assert cli.main([places.get(word, word) for word in words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("invalid_argument: photo.dng is a photo (DNG or TIFF), no")
    assert "codec" not in err
    assert [path.name for path in tmp_path.iterdir()] == ["photo.dng"]


def test_an_interrupted_batch_says_how_to_resume(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "m.csv").write_text("name,photo,lamp\na,typo.dng,D55\n")
    call = ["batch", str(tmp_path / "m.csv"), "-o", str(tmp_path / "out"), "--workers", "1"]
    monkeypatch.setattr(import_module("camssf_fleet.batch"), "run_batch", raising(KeyboardInterrupt()))
    assert cli.main(call) == 130
    assert "Run the same command again to resume" in capsys.readouterr().err


def test_the_reasons_of_a_batch_are_those_of_jobs_without_curves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An accepted result needs no reason; a failed one has no code, but is named."""
    pytest.importorskip("duckdb", reason="duckdb is not here")
    from camssf_fleet import batch
    from camssf_fleet.outcome import Summary

    found = Summary()
    for status, code, count in (("accepted", "", 10), ("refused", "overexposed", 2), ("failed", "", 1)):
        for _ in range(count):
            found.count(status, code, "Phone" if status == "accepted" else "")
    monkeypatch.setattr(batch, "run_batch", lambda *_, **__: found)
    (tmp_path / "m.csv").write_text("name,photo,lamp\na,typo.dng,D55\n")
    call = ["batch", str(tmp_path / "m.csv"), "-o", str(tmp_path / "out"), "--registry", str(tmp_path / "r")]
    assert cli.main(call) == cli.BATCH_FAILED
    lines = [line.strip() for line in capsys.readouterr().err.splitlines()]
    assert lines[:4] == [
        "10 Phone: 10 accepted", "3 of an unknown model: 2 refused, 1 failed", "2 overexposed",
        "1 failed: a process died, or a fault of camssf",
    ]  # fmt: skip


# Arguments


def test_arguments_arrive_in_their_order(monkeypatch: pytest.MonkeyPatch) -> None:
    heard: dict[str, Any] = {}

    def listen(shots: list[Shot], *, options: Options, **more: Any) -> Any:
        heard.update(vars(options) | more, shots=shots)
        raise InvalidArgument("enough.", "")

    swap(monkeypatch, "attempt", listen)
    line = "calibrate a b --lamp D55 --lamp 2856K --white none --white w --dark d1 --dark NONE --fit 1,7-9,8 --signed"
    corners = ["--corners", "none", "--corners", "1,2 3,4 5,6.5 -7,8"]
    assert (
        cli.main(
            [
                *line.split(),
                *corners,
                "--gamma",
                "0.1",
                "--l2",
                "1",
                "--white-reflectance",
                "0.95",
                "--lamp-tolerance",
                "2%",
                "--lamp-tolerance",
                "100K",
                "--lens-shading",
                "apply",
                "--light-per-patch",
                "8%",
            ]
        )
        == 2
    )
    heard.pop("progress")
    assert heard == {
        "shots": [
            Shot("a", "D55", None, "d1", None, "2%", "apply"),
            Shot("b", "2856K", "w", None, [[1, 2], [3, 4], [5, 6.5], [-7, 8]], "100K", "apply"),
        ],
        "white_reflectance": 0.95,
        "chart": "classic24",
        "basis": "auto",
        "fit": (1, 7, 8, 9),
        "nonnegative": False,
        "gamma": 0.1,
        "l2": 1.0,
        "engine": "onnx",
        "light_per_patch": 0.08,
        "truth": None,
        "previous": None,
    }


def test_help_and_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"camssf {camssf.__version__}\n"
    for command in ("demo", "calibrate", "batch", "simulate", "patches", "solve", "validate", "report", "lamps"):
        assert cli.main([command, "--help"]) == 0
        assert f"Example: camssf {'patches' if command == 'solve' else command}" in capsys.readouterr().out
    assert cli.main(["--help"]) == 0
    assert "..." not in capsys.readouterr().out.partition("Commands:")[2]  # no summary is cut off


@pytest.mark.parametrize(
    ("command", "name"), [("lamps", "LED-B3"), ("charts", "classic24"), ("cameras", "Nikon 5100 (NPL)")]
)
def test_lists_are_one_name_a_line(command: str, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([command]) == 0
    assert name in [line.partition("\t")[0] for line in capsys.readouterr().out.splitlines()]


def test_every_listed_name_is_read() -> None:
    from camssf import spectra

    for names, read in (
        (spectra.lamp_names(), spectra.read_lamp),
        (spectra.chart_names(), spectra.read_chart),
        (spectra.camera_names(), spectra.read_camera),
    ):
        assert len(names) > 1
        for name in names:
            assert len(WAVELENGTHS) in np.shape(read(name).values)


# Progress


def test_progress_shows_itself_on_long_work_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def work(*_: Any, progress: Callable[[str, float], None], **__: Any) -> Any:
        progress("looking for the chart", 0.5)
        if cli.terminal.PROGRESS_AFTER == 0.0:
            for timer in threading.enumerate():
                if isinstance(timer, threading.Timer):
                    timer.join()
        raise InvalidArgument("enough.", "")

    swap(monkeypatch, "attempt", work)
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich then takes stderr for a terminal
    monkeypatch.setenv("TERM", "xterm-256color")
    for after, shown in ((0.0, True), (3600.0, False)):
        monkeypatch.setattr(cli.terminal, "PROGRESS_AFTER", after)
        assert cli.main(["calibrate", "x.dng", "--lamp", "D55"]) == 2
        out, err = capsys.readouterr()
        assert ("looking for the chart" in err) is shown
        assert out == ""
    monkeypatch.delenv("FORCE_COLOR")
    monkeypatch.setattr(cli.terminal, "PROGRESS_AFTER", 0.0)
    assert cli.main(["calibrate", "x.dng", "--lamp", "D55"]) == 2
    assert capsys.readouterr().err == "invalid_argument: enough.\n  \n"


def test_the_bar_waits_two_seconds() -> None:
    assert cli.terminal.PROGRESS_AFTER == 2.0


@pytest.mark.repository
def test_main_is_the_console_script(monkeypatch: pytest.MonkeyPatch) -> None:
    import tomllib

    from camssf.__main__ import main

    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["scripts"]["camssf"] == "camssf.__main__:main"
    monkeypatch.setattr(sys, "argv", ["camssf", "nosuch"])
    assert main() == 2


def test_an_empty_basis_is_an_invalid_argument(tmp_path: Path) -> None:
    (tmp_path / "e.npz").touch()
    with pytest.raises(InvalidArgument, match=r"no \.npz"):
        read_basis(str(tmp_path / "e.npz"))
