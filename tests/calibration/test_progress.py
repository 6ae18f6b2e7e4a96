"""Progress is reported from 0 to 1, and never goes back; a command says so before it loads what takes long."""

import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from camssf import cli
from camssf.calibration import solve
from camssf.photo.capture import measure
from camssf.photo.shot import Shot
from camssf.progress import Progress, part_of
from tests.support.captures import photos

Reports = list[tuple[str, float]]


@pytest.fixture
def photo() -> Path:
    return Path(str(photos(camera="Demo phone").shots[0].chart))


def check(reports: Reports) -> None:
    parts = [part for _, part in reports]
    assert parts[0] == 0.0, reports
    assert parts[-1] == 1.0, reports
    assert parts == sorted(parts), reports
    assert len(reports) > 2
    assert max(late - early for early, late in pairwise(parts)) <= 0.65, reports


def told(reports: Reports) -> Progress:
    return lambda stage, part: reports.append((stage, part))


def test_measuring_and_solving_tell_from_0_to_1(photo: Path) -> None:
    reports: Reports = []
    capture = measure(Shot(photo, "D55"), progress=told(reports))
    check(reports)
    reports = []
    solve(capture, progress=told(reports))
    check(reports)


def test_a_part_of_the_whole() -> None:
    reports: Reports = []
    part_of(told(reports), 0.2, 0.6)("solving", 0.5)
    part_of(part_of(told(reports), 0.5, 1.0), 0.5, 1.0)("validating", 1.0)
    part_of(None, 0.0, 1.0)("nothing", 0.0)
    assert reports == [("solving", pytest.approx(0.4)), ("validating", 1.0)]


SAID = """
import json, sys
from camssf.cli import main, terminal
said = []
def call(bar, stage, part):
    said.append((stage, part, "numpy" in sys.modules or "camssf.calibration" in sys.modules))
    raise SystemExit(0)
terminal._Bar.__call__ = call
for line in ("calibrate chart.dng --lamp D55", "batch none.csv", "demo -o out"):
    try:
        main(line.split())
    except SystemExit:
        pass
print(json.dumps(said), file=sys.stderr)
"""


def test_a_command_begins_to_tell_before_it_loads_anything(tmp_path: Path) -> None:
    """Each command ends at its first word."""
    done = subprocess.run([sys.executable, "-c", SAID], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stderr.strip() == str([["starting", 0.0, False]] * 3).replace("'", '"').lower(), done.stderr


@pytest.mark.full
def test_a_command_tells_from_0_to_1(
    photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    reports: Reports = []
    real = cli.terminal._Bar.__call__

    def call(bar: cli.terminal._Bar, stage: str, part: float) -> None:
        reports.append((stage, part))
        real(bar, stage, part)

    monkeypatch.setattr(cli.terminal._Bar, "__call__", call)
    assert cli.main(["calibrate", str(photo), "--lamp", "D55", "-o", str(tmp_path / "out")]) == 0
    check(reports)
    reports.clear()
    assert cli.main(["report", str(tmp_path / "out" / "result.json"), "-o", str(tmp_path / "again")]) == 0
    check(reports)
    capsys.readouterr()
