"""The benchmarks run, and count every miss and no file of their own; tiny sizes, no speed is judged here."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import shared
from benchmarks.__main__ import main, questions
from benchmarks.claim import Run
from benchmarks.claims import arm, certify, speed
from camssf.calibration import solve
from camssf.options import Options
from camssf.photo.capture import Capture
from camssf.recovery.basis import read_basis
from camssf.spectra import read_chart, read_lamp
from camssf_lab.simulation.scene import Scene

pytestmark = pytest.mark.full


@pytest.fixture(autouse=True)
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nothing here overwrites a real result, and nothing needs what may not be passed on."""
    folder = tmp_path / "results"
    monkeypatch.setattr(shared, "RESULTS", folder)
    monkeypatch.delenv("CAMSSF_PHONES", raising=False)
    return folder


@pytest.mark.parametrize(("value", "met"), [(0.94, True), (0.93, True), (0.92, False), (float("nan"), False)])
def test_a_bar_that_is_missed_is_printed_and_is_the_status(
    value: float, met: bool, results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = Run.of("x", certify, [])
    run.table("t", {"name": "", "share": ".1%", "of": "{} of {}"}, [("a", 0.5, (1, 2)), ("b", None, None)])
    run.bar("coverage", value, least=0.93, most=0.97)
    assert run.end() == (not met)
    said = capsys.readouterr().out
    assert "≥ 0.93 and ≤ 0.97" in said
    assert ("MISSED" in said) != met
    assert "50.0%" in said
    kept = json.loads((results / "x.json").read_text())
    assert kept["tables"]["t"][0] == {"name": "a", "share": 0.5, "of": [1, 2]}
    assert [bar["met"] for bar in kept["bars"]] == [met]


def test_every_claim_is_listed_and_a_missing_table_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in questions())
    assert main(["nothing"]) == 2
    for words, table in (("phones", "PHONES"), ("wrong_lamps", "PHONES"), ("wrong_lamps --only another", "FOREIGN")):
        assert main(words.split()) == 2
        assert f"--{table.lower()} or CAMSSF_{table}" in capsys.readouterr().err
    for table in ("phones", "foreign"):
        assert main(["strangers", f"--{table}", "nowhere.csv"]) == 2
        assert "nowhere.csv cannot be read" in capsys.readouterr().err


@pytest.mark.requirement("R-OPTIMUM", "R-COLOUR")
@pytest.mark.parametrize(
    "words", ["certify --count 3", "lamps --every 60 --draws 1", "colour --cameras 2 --only cameras"]
)
def test_a_claim_runs_on_its_smallest_part(words: str, results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whether a bar holds for one camera is chance, but for the optimum; that all numbers are there is not."""
    name, *more = words.split()
    status = main([name, *more])
    assert status == ("MISSED" in capsys.readouterr().out)
    kept = json.loads((results / f"{name}.json").read_text())
    assert np.isfinite([bar["value"] for bar in kept["bars"]]).all()
    rows = [row for rows in kept["tables"].values() for row in rows]
    assert len(rows) > 1
    assert np.isfinite([value for row in rows for value in row.values() if isinstance(value, float)]).all()
    assert name != "certify" or status == 0


@pytest.mark.requirement("R-ARM")
@pytest.mark.parametrize(
    ("machine", "failed", "off", "status"),
    [
        ("aarch64", 0, 1e-12, 0),
        ("aarch64", 0, 1e-8, 1),
        ("aarch64", 1, 1e-12, 1),
        ("x86_64", 0, 1e-12, 1),  # not emulated after all
    ],
)
def test_arm_holds_its_bar(
    machine: str, failed: int, off: float, status: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """`.ci/run` runs it on the emulated processor."""
    monkeypatch.setattr(arm, "tools", lambda: None)
    monkeypatch.setattr(arm, "root_folder", lambda *_: tmp_path)
    monkeypatch.setattr(arm, "java_of", lambda root: root / "java")
    monkeypatch.setattr(arm, "golden", lambda *_: ((machine, "17", 4, failed, off), []))
    assert main(["arm"]) == status


@pytest.mark.requirement("R-SPEED")
@pytest.mark.parametrize(("ratio", "status"), [(2.0, 0), (2.01, 1), (float("nan"), 1)])
def test_speed_ends_with_1_where_its_bar_is_missed(
    ratio: float, status: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(speed, "LARGE", Scene(size=(240, 180)))
    seconds = {"bare decode": [1.0], "calibrate": [ratio], "LibRaw's picture": [1.0], "picture": [1.0]}
    monkeypatch.setattr(speed, "in_turn", lambda *_, **__: seconds)
    assert main(["speed", "--only", "python"]) == status
    assert ("MISSED" in capsys.readouterr().out) == bool(status)


@pytest.mark.requirement("R-FIELD")
@pytest.mark.parametrize("row", ["any light", "framed", "field", "a fault's clean capture"])
def test_simulated_captures_are_solved_and_not_refused_as_files(row: str) -> None:
    """A benchmark that counts refusals must not count those of its own files: a chart and a frame that are one."""
    from benchmarks import captures, staged
    from benchmarks.claims import field
    from benchmarks.devices import CAMERAS, Device
    from tests.support.problems import measured_cameras

    name = "Nikon D5100"
    device = Device(name, measured_cameras()[name], {CAMERAS: read_basis("cameras")})
    light = read_lamp("D55")
    if row == "any light":
        simulated = captures.capture(device, {"D55": light.values}, [light], "nikon", 3)
    elif row.startswith("a fault"):
        good = staged.stage(3, name, device.curves, "D55")
        simulated = Capture((staged.shoot(good, good.setup),), read_chart("classic24"), None)
    else:
        place = field.place(np.random.default_rng(3), row)
        simulated = field.photographed(device, "D55", light, place, row, "nikon", 3)
    assert solve(simulated, options=Options(engine="reference")).verdict.status == "accepted"
