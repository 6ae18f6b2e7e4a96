"""Each fault makes another capture, the worst are caught as files; the table in the docs is the benchmark's."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest

from benchmarks.claims.faults import LAMPS
from benchmarks.faults import FAULTS, SEVERITIES, apply_fault
from camssf.calibration import calibrate
from camssf.errors import CalibrationError
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene
from camssf_lab.simulation.shot import take
from camssf_lab.simulation.shot_plan import ShotPlan

DOCS = Path(__file__).parents[2] / "docs"


@cache
def sound(lamp: str = "D55") -> ShotPlan:
    scene = Scene(size=(360, 270), fill=0.6)
    camera, light, table = read_camera("Nikon 5100 (NPL)"), read_lamp(lamp), read_chart("classic24")
    return ShotPlan(camera, light, table, scene, Sensor(noise=False), lamp, "classic24")


@cache
def content(fault: str | None, severity: int = 0) -> str:
    """What is handed in."""
    plan = apply_fault(fault, severity)(sound()) if fault else sound()
    frames = take(plan, (1,))
    samples = {"chart": frames.chart, "white": frames.white, "dark": frames.dark}
    hashes = [(role, frame and hash(samples[frame].tobytes())) for role, frame in plan.handed_in.items()]
    return repr([plan.stated_lamp, plan.sensor, [plan.file_tags(frame) for frame in samples], hashes])


@pytest.mark.full
@pytest.mark.parametrize("name", FAULTS)
def test_every_severity_is_another_capture(name: str) -> None:
    assert len(set(FAULTS[name].degrees)) == len(SEVERITIES)
    changed = {content(name, severity) for severity in SEVERITIES}
    assert len(changed) == len(SEVERITIES)
    assert content(None) not in changed or name == "demosaiced"  # which alone leaves each sample as it is


@pytest.mark.parametrize("lamp", [*LAMPS, "D:6000"])
def test_a_wrong_name_is_never_the_right_one(lamp: str) -> None:
    told = [apply_fault("wrong-lamp", severity)(sound(lamp)).stated_lamp for severity in SEVERITIES]
    assert lamp not in told
    assert told[-1] == ("D65" if lamp in ("A", "3200K") else "A")  # the opposite


WORST = {
    "swapped": "chart_not_found", "cfa": "chart_not_found", "mirrored": "chart_not_found", "clipped": "overexposed",
    "dark-iso": "frames_differ", "glare": "glare", "tone-mapped": "not_sensor_raw", "white-level": "frames_differ",
    "wrong-lamp": "lamp_unfit", "wall": "lamp_unfit", "shadow": "uneven_light",
}  # fmt: skip


@pytest.mark.requirement("R-FAULTS")
@pytest.mark.full
@pytest.mark.parametrize(("name", "code"), WORST.items())
def test_the_worst_is_caught_from_real_files(tmp_path: Path, name: str, code: str) -> None:
    scene = Scene(size=(720, 540), fill=0.55)
    made = simulate("Nikon 5100 (NPL)", ["D55"], tmp_path, scene=scene, change=apply_fault(name, 3), seed=4)
    try:
        result = calibrate(made.shots[0].shot)
        codes = {reason.code for reason in result.verdict.reasons}
    except CalibrationError as error:
        codes = {reason.code for reason in error.reasons} | {error.code}
    assert code in codes


@pytest.mark.repository
@pytest.mark.requirement("R-FAULTS")
def test_the_docs_headline_is_the_benchmark_s() -> None:
    found = json.loads((DOCS / "faults.json").read_text("utf-8"))
    caught = {bar["bar"]: f"{100 * bar['value']:.1f} %" for bar in found["bars"]}
    first, second = (caught[f"severity {number}: harmful caught"] for number in (2, 3))
    said = f"{first} of the harmful ones at severity 2 and {second} at severity 3"
    assert said in (DOCS / "verdict.md").read_text("utf-8")
    assert list(found["faults"]) == list(FAULTS)
    assert found["half"] == "report"


@pytest.mark.repository
@pytest.mark.requirement("R-FAULTS")
def test_the_benchmark_met_its_bars() -> None:
    """As committed, but for two: the command makes the numbers anew, and exits 1 where a bar is missed.

    At severity 3 whole copies of the chart, and files of it that are off in wavelength, are missed; of good captures
    of cameras more are doubted than the bar allows (docs/verdict.md, What it catches).
    """
    found = json.loads((DOCS / "faults.json").read_text("utf-8"))
    assert [bar["bar"] for bar in found["bars"] if not bar["met"]] == [
        "severity 3: harmful caught", "clean captures doubtful or refused",
    ]  # fmt: skip
    assert {name for name, each in found["faults"].items() if each[2]["missed"]} == {"printed", "moved-table"}
