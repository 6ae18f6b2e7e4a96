"""Standard input, output and error: pipes, full disks, terminals and other codings, names that are no UTF-8."""

import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest

from camssf import cli
from camssf.documents.forms import content_hash
from tests.cli.conftest import Capture, Feed, Patch, spoken
from tests.support.failures import raising

LATIN = os.fsdecode(b"gr\xfcn")
"""Half of a name in Latin-1, as old cards and archives hold it: no UTF-8."""

FULL = "No space left on device"
SCRIPTS = [
    ("patches TRIPLE | camssf solve -", 0, "verdict: "), ("lamps | head -n 1", 0, ""),
    ("lamps >&-", 2, "Standard output is closed"),
    *((f"{command} > /dev/full", 2, FULL) for command in ("validate RESULT", "lamps", "--version", "--help")),
    ("calibrate WHITE --lamp D55 > /dev/full", 4, FULL),  # the refusal is the greater news
    # PYTHONUNBUFFERED, usual in containers, makes stdout a raw file, which takes what fits and goes on.
    ("validate RESULT > short.json", 2, "cannot be written"), ("calibrate TRIPLE -o big", 2, "File too large"),
    ("calibrate TRIPLE -o locked", 2, "Permission denied"),
]  # fmt: skip


@pytest.mark.full
@pytest.mark.skipif(sys.platform != "linux", reason="no bash, or no /dev/full, on this system")
@pytest.mark.parametrize(("script", "status", "words"), SCRIPTS, ids=[script[:40] for script, _, _ in SCRIPTS])
def test_a_pipe_or_a_disk_that_ends_is_said(
    script: str, status: int, words: str, result: Path, shots: Path, triple: list[str], tmp_path: Path
) -> None:
    """In processes of their own: Python writes once more at its end."""
    (tmp_path / "locked").mkdir(0o555)
    if "locked" in script and os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    places = {"TRIPLE": " ".join(triple), "RESULT": str(result / "result.json"), "WHITE": str(shots / "white.dng")}
    for name, value in places.items():
        script = script.replace(name, value)
    limit = "ulimit -f 8; " if "short" in script or "big" in script else ""
    line = f'camssf() {{ {sys.executable} -m camssf "$@"; }}; {limit}camssf {script}'
    env = os.environ | ({"PYTHONUNBUFFERED": "1"} if "short" in script else {})
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=120)
    assert done.returncode == status, done.stderr
    assert words in done.stderr
    for word in ("bug", "fault", "Traceback", "Exception"):
        assert word not in done.stderr
    assert (status == 4) == ("chart_not_found: " in done.stderr)
    assert (status == 2) == ("invalid_argument: " in done.stderr)
    assert not words.endswith(("large", "denied")) or "nothing was left behind" in done.stderr
    assert {path.name for path in tmp_path.iterdir()} <= {"locked", "short.json"}


@pytest.mark.parametrize(("command", "data", "words"), [
    ("solve", None, "closed"), ("solve", "", "is empty"), ("solve", b"\xff\xfe", "is not valid JSON"),
    ("solve", "[]", "standard input: the document must be an object, is a list"),
    ("validate", '{"format": "camssf/2", "version": ""}', "was not solved"),
    ("report", '{"format": "camssf/2", "version": "", "verdict": {"status": "good"}}', "verdict.status must be"),
])  # fmt: skip
def test_bad_standard_input_is_2(
    command: str, data: Any, words: str, tmp_path: Path, feed: Feed, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    feed(data)
    assert cli.main([command, "-"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.partition(":")[0]) == ("", "invalid_argument")
    assert words in err
    assert tempfile.gettempdir() not in err  # no temporary name in the words
    assert not list(tmp_path.iterdir())


@pytest.mark.full
def test_standard_input_is_written_nowhere(result: Path, feed: Feed, monkeypatch: Patch, capsys: Capture) -> None:
    for name in ("TemporaryDirectory", "NamedTemporaryFile", "mkstemp", "mkdtemp"):
        monkeypatch.setattr(tempfile, name, raising(AssertionError("a temporary file")))
    feed((result / "result.json").read_bytes())
    assert cli.main(["validate", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["format"] == "camssf/2"


def test_a_terminal_shows_no_json(triple: list[str], result: Path, capsys: Capture, monkeypatch: Patch) -> None:
    for words, shown in (
        (["patches", *triple], "24 patches measured"), (["validate", str(result / "result.json")], "verdict: "),
    ):  # fmt: skip
        terminal = io.StringIO()
        monkeypatch.setattr(terminal, "isatty", lambda: True)
        monkeypatch.setattr(sys, "stdout", terminal)
        assert cli.main(words) == 0
        assert shown in capsys.readouterr().err
        assert terminal.getvalue() == ""


def test_words_steer_no_terminal(tmp_path: Path, capsys: Capture) -> None:
    """A file's name may hold what a terminal obeys."""
    assert cli.main(["calibrate", str(tmp_path / "\x1b]0;own\x07\x1b[2J\x9b31m\u202egnp.dng"), "--lamp", "D55"]) == 3
    err = capsys.readouterr().err
    assert "There is no file" in err
    assert not set(err) & set("\x1b\x07\x9b\u202e")


def test_json_is_utf8_on_a_terminal_of_another_coding(result: Path, tmp_path: Path) -> None:
    document = json.loads((result / "result.json").read_text("utf-8"))
    document["capture"]["shots"][0]["photo"]["name"] = "Späße \u6f22.dng"
    del document["sha256"]
    (tmp_path / "r.json").write_text(json.dumps(document), "utf-8")
    status, out, err = spoken(["validate", str(tmp_path / "r.json")], "utf-16")
    assert status == 0, err
    printed = json.loads(out.decode("utf-16"))
    assert printed.pop("sha256") == content_hash(document)
    assert printed == document
    assert spoken(["cameras"], "ascii")[0] == 0


@pytest.mark.full
@pytest.mark.skipif(sys.platform != "linux", reason="names are Unicode there")
def test_names_that_are_no_utf8(shots: Path, tmp_path: Path, monkeypatch: Patch) -> None:
    """Every command that takes or writes files, in a folder and with files of such names."""
    (tmp_path / LATIN).mkdir()
    monkeypatch.chdir(tmp_path / LATIN)
    for name in ("chart.dng", "white.dng", "dark.dng", "truth.csv"):
        shutil.copyfile(shots / name, f"{LATIN}-{name}")
    shutil.copyfile(shots / "chart.dng", "b.dng")
    Path(f"{LATIN}-m.csv").write_text("name,photo,lamp\na,missing.dng,D55\nb,b.dng,D55\n")
    chart, frames = "L-chart.dng", "--white L-white.dng --dark L-dark.dng"
    commands = [
        (f"calibrate {chart} --lamp D55 {frames} --truth L-truth.csv --basis gaussian -o out", 0),
        (f"patches {chart} --lamp D55 {frames}", 0), ("solve L-patches.json --basis gaussian", 0),
        (f"report L-solve.json -o report --photo {chart}", 0),
        ("batch L-m.csv --basis gaussian -o batch --workers 1", cli.BATCH_FAILED),
        ("calibrate L-white.dng --lamp D55 -o refused", 4),
        ("calibrate L-none --lamp D55", 3), (f"calibrate {chart} --lamp L-none", 2), ("solve L-none", 2),
    ]  # fmt: skip
    for line, expected in commands:
        call = [word.replace("L-", f"{LATIN}-") for word in line.split()]
        status, out, err = spoken(call)
        assert status == expected, (line, err)
        assert b"fault. Run" not in err
        err.decode("utf-8")
        if out:
            json.loads(out.decode("utf-8"))
            Path(f"{LATIN}-{call[0]}.json").write_bytes(out)
    written = [path for path in Path().rglob("*") if path.suffix in (".json", ".csv", ".html")]
    assert len(written) > 8
    for path in written:
        path.read_text("utf-8")
    photo = json.loads(Path("out/result.json").read_text("utf-8"))["capture"]["shots"][0]["photo"]
    assert photo["name"] == "gr\ufffdn-chart.dng"
