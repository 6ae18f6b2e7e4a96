"""Faults do what they say, as files too; the verdict's table in the docs is the benchmark's."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.faults import FAULTS, SEVERITIES, apply_fault
from camssf.calibration import calibrate
from camssf.errors import CalibrationError, InvalidArgument
from camssf.grid import Floats
from camssf.photo.read.dng import read_dng
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import Simulation, simulate
from camssf_lab.simulation.scene import Scene, true_pose
from camssf_lab.simulation.shot import Frames, take
from camssf_lab.simulation.shot_plan import ShotPlan

DOCS = Path(__file__).parents[2] / "docs"
SIZE = (360, 270)
QUIET = Sensor(noise=False)


@cache
def sound(lamp: str = "D55", noise: bool = False) -> ShotPlan:
    scene = Scene(size=SIZE, fill=0.6)
    camera, light, table = read_camera("Nikon 5100 (NPL)"), read_lamp(lamp), read_chart("classic24")
    return ShotPlan(camera, light, table, scene, replace(QUIET, noise=noise), lamp, "classic24")


@cache
def clean() -> Frames:
    return take(sound(), (1,))


def struck(name: str, severity: int, lamp: str = "D55") -> tuple[ShotPlan, Frames]:
    changed = apply_fault(name, severity)(sound(lamp))
    return changed, take(changed, (1,))


def patch(samples: Floats, number: int, colour: str, scene: Scene) -> float:
    """Mean of a colour's samples in the middle of a patch, DN above black."""
    x, y = true_pose(scene).patches[number].mean(axis=0)
    row, column = divmod("RGGB".index(colour), 2)
    rows = np.arange(int(y) - 8, int(y) + 8)
    columns = np.arange(int(x) - 8, int(x) + 8)
    rows, columns = rows[rows % 2 == row], columns[columns % 2 == column]
    return float(samples[np.ix_(rows, columns)].mean()) - QUIET.black


@pytest.mark.full
@pytest.mark.parametrize("name", FAULTS)
def test_every_severity_is_another_capture(name: str) -> None:
    assert len(set(FAULTS[name].degrees)) == len(SEVERITIES)
    seen = {repr([sound().stated_lamp, sound().sensor, sound().file_tags("chart"), *hashes(clean(), sound())])}
    for severity in SEVERITIES:
        changed, frames = struck(name, severity)
        tags = [changed.file_tags(frame) for frame in ("chart", "white", "dark")]
        seen.add(repr([changed.stated_lamp, changed.sensor, tags, *hashes(frames, changed)]))
    assert len(seen) == 1 + len(SEVERITIES)


def hashes(frames: Frames, changed: ShotPlan) -> list[object]:
    """What is handed in."""
    samples = {"chart": frames.chart, "white": frames.white, "dark": frames.dark}
    return [(role, frame and hash(samples[frame].tobytes())) for role, frame in changed.handed_in.items()]


def test_what_is_no_fault_is_refused() -> None:
    with pytest.raises(InvalidArgument, match="No fault is called"):
        apply_fault("gremlins", 1)
    with pytest.raises(InvalidArgument, match="no severity 4"):
        apply_fault("glare", 4)


# each as much as it says


def test_glare_black_and_dark_in_dn() -> None:
    white = sound().sensor.exposure * (sound().sensor.white_level - sound().sensor.black)
    _, frames = struck("glare", 3)
    for colour in "RGB":
        power = (sound().lamp.values @ sound().camera.values)["RGB".index(colour)]
        share = power / (sound().lamp.values @ sound().camera.values).max()
        veil = patch(frames.chart, 23, colour, sound().scene) - patch(clean().chart, 23, colour, sound().scene)
        assert veil == pytest.approx(0.2 * white * share, rel=0.01)
    changed, frames = struck("black", 2)
    span = sound().sensor.white_level - sound().sensor.black
    assert changed.file_tags("chart").black == sound().sensor.black
    assert frames.dark.mean() - changed.file_tags("dark").black == pytest.approx(0.02 * span, rel=0.05)
    _, frames = struck("dark-leak", 2)
    assert frames.dark.mean() - clean().dark.mean() == pytest.approx(0.015 * span, rel=0.01)


def test_light_on_one_half_and_on_one_patch() -> None:
    changed, frames = struck("shadow", 3)
    ratio = [patch(frames.chart, i, "G", changed.scene) / patch(clean().chart, i, "G", changed.scene) for i in (0, 5)]
    assert ratio == pytest.approx([0.4, 1.0], abs=0.01)
    changed, frames = struck("specular", 2)
    brighter = [
        patch(frames.chart, i, "G", changed.scene) - patch(clean().chart, i, "G", changed.scene) for i in range(24)
    ]
    assert int(np.argmax(brighter)) == 14
    assert brighter[14] > 0.25 * patch(clean().white, 14, "G", changed.scene)
    assert abs(brighter[0]) < 2


def test_a_white_frame_of_another_lamp() -> None:
    changed, frames = struck("white-lamp", 3)
    camera = sound().camera.values
    expected = (read_lamp("A").values @ camera) / (sound().lamp.values @ camera)
    found = [patch(frames.white, 9, c, changed.scene) / patch(clean().white, 9, c, changed.scene) for c in "RGB"]
    assert np.array(found) / found[1] == pytest.approx(expected / expected[1], rel=0.01)


@pytest.mark.parametrize(
    ("lamp", "told"),
    [
        ("D55", ("D65", "LED-B3", "A")),
        ("A", ("2500K", "LED-B1", "D65")),
        ("LED-B3", ("LED-B4", "D55", "A")),
        ("FL2", ("FL7", "LED-B3", "A")),
        ("3000K", ("2500K", "LED-B1", "D65")),
        ("D:6000", ("D65", "LED-B3", "A")),
        ("D65", ("LED-B3", "LED-B3", "A")),  # never the right name
    ],
)
def test_wrong_names(lamp: str, told: tuple[str, ...]) -> None:
    assert tuple(apply_fault("wrong-lamp", s)(sound(lamp)).stated_lamp for s in SEVERITIES) == told


def test_software() -> None:
    changed, frames = struck("tone-mapped", 3)
    for number in (0, 18):
        linear = patch(clean().chart, number, "G", changed.scene) / (changed.sensor.white_level - QUIET.black)
        bent = patch(frames.chart, number, "G", changed.scene) / (changed.sensor.white_level - QUIET.black)
        assert bent == pytest.approx(np.sqrt(linear), rel=0.01)
    _, frames = struck("demosaiced", 1)
    inside = slice(2, -2)
    np.testing.assert_array_equal(frames.chart[inside, inside], clean().chart[inside, inside])  # known sites stay


@pytest.mark.full
def test_a_printed_copy_looks_alike_and_is_none() -> None:
    """Judged by colour-science: near the chart's colours under D50, far from its spectra."""
    from camssf.spectra import colour_science

    colour = colour_science()
    shape = colour.SpectralShape(380, 720, 0.5)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    light = read_lamp("D50").values
    white = light @ observer
    chart, copy = sound().table.values, apply_fault("printed", 3)(sound()).table.values
    lab = [colour.XYZ_to_Lab((v * light) @ observer / white[1], colour.XYZ_to_xy(white)) for v in (chart, copy)]
    assert np.median(colour.delta_E(*lab, method="CIE 2000")) < 3
    assert np.sqrt(np.mean((chart - copy) ** 2)) > 0.04


# files


@cache
def files(folder: Path, name: str, severity: int, lamp: str = "D55") -> Simulation:
    change = apply_fault(name, severity) if name != "clean" else None
    out = folder / f"{name}{severity}"
    return simulate("Nikon 5100 (NPL)", [lamp], out, scene=Scene(size=(720, 540), fill=0.55), change=change, seed=4)


@pytest.mark.full
def test_files_say_what_the_plan_says(tmp_path: Path) -> None:
    shot = files(tmp_path, "dark-iso", 2).shots[0]
    assert shot.dark is not None
    assert (read_dng(shot.chart).iso, read_dng(shot.dark).iso) == (100, 800)
    assert read_dng(files(tmp_path, "cfa", 1).shots[0].chart).cfa == "BGGR"
    assert files(tmp_path, "vignetting", 2).shots[0].white is None
    assert files(tmp_path, "wrong-lamp", 3).shots[0].lamp == "A"


@pytest.mark.requirement("R-FAULTS")
@pytest.mark.full
@pytest.mark.parametrize(
    ("name", "codes"),
    [
        ("swapped", {"chart_not_found"}),
        ("cfa", {"chart_not_found"}),
        ("mirrored", {"chart_not_found"}),
        ("clipped", {"overexposed"}),
        ("dark-iso", {"frames_differ"}),
        ("glare", {"glare"}),
        ("tone-mapped", {"not_sensor_raw"}),
        ("white-level", {"frames_differ"}),
        ("wrong-lamp", {"lamp_unfit"}),
        ("wall", {"lamp_unfit"}),
        ("shadow", {"uneven_light"}),
    ],
)
def test_the_worst_is_caught_from_real_files(tmp_path: Path, name: str, codes: set[str]) -> None:
    shot = files(tmp_path, name, 3).shots[0]
    try:
        result = calibrate(shot.shot)
        found = {reason.code for reason in result.verdict.reasons}
    except CalibrationError as error:
        found = {reason.code for reason in error.reasons} | {error.code}
    assert codes <= found


# docs


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
    missed = sum(row["missed"] for each in found["faults"].values() for row in each)
    harmful = sum(row["harmful"] for each in found["faults"].values() for row in each)
    caught = sum(row["harmful_caught"] for each in found["faults"].values() for row in each)
    assert harmful == caught + missed
