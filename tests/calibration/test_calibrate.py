"""The stages joined: simulated captures with a known truth, the real photo, and refusals that keep their evidence."""

import json
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.calibration import attempt, calibrate, solve
from camssf.documents.document import document_bytes
from camssf.errors import ChartNotFound, InvalidArgument, LampUnfit
from camssf.options import Options
from camssf.photo.capture import Capture, measure
from camssf.photo.shot import Shot
from camssf.report.build import report
from camssf.report.shots import shots_of
from camssf.result import Result
from camssf.spectra import CameraCurves, read_chart, read_lamp, read_light
from camssf_lab.simulation.frames import Simulation, simulate
from camssf_lab.simulation.scene import Scene
from tests.support.documents import changed
from tests.support.problems import toy_camera

ROOT = Path(__file__).parents[2]
SIZE = (900, 675)
# Bells are unlike any real filter, so the learned basis has no easy game; benchmarks/ scores real cameras.
CAMERA = CameraCurves("toy", toy_camera(), "a formula")


@pytest.fixture(scope="module")
def two_lamps(tmp_path_factory: pytest.TempPathFactory) -> Simulation:
    scene = Scene(size=SIZE, vignetting=0.5, rotation=8, tilt=10)
    return simulate(CAMERA, ["D55", "A"], tmp_path_factory.mktemp("two"), scene=scene)


@pytest.fixture(scope="module")
def capture(two_lamps: Simulation) -> Capture:
    return measure(two_lamps.shots[0].shot)


@pytest.mark.requirement("R-PIPELINE")
@pytest.mark.parametrize(("basis", "bound"), [("gaussian", 0.08), ("cameras", 0.07)])
def test_recovers_the_simulated_camera(capture: Capture, basis: str, bound: float) -> None:
    result = solve(capture, options=Options(basis=basis), truth=CAMERA)
    assert result.scores.rmse.mean() < bound
    assert (result.scores.rmsre_percent < 3.0).all()
    assert (result.ssf.proof.gap < 1e-9).all()
    assert result.verdict.status == "accepted"
    assert (result.ssf.std is None) == (basis == "gaussian")


@pytest.mark.full
def test_two_shots_join_and_know_more(two_lamps: Simulation, capture: Capture) -> None:
    pair = calibrate([shot.shot for shot in two_lamps.shots], options=Options(basis="cameras"), truth=CAMERA)
    single = solve(capture, options=Options(basis="cameras"), truth=CAMERA)
    assert pair.ssf.predicted.shape == (2, 24, 3)
    assert pair.ssf.std.mean() < single.ssf.std.mean()
    assert len(pair.uncertainty.alone) == 2
    assert pair.uncertainty.half_width < min(pair.uncertainty.alone)


@pytest.mark.full
@pytest.mark.requirement("R-TABLE")
def test_the_chart_s_table_is_the_one_that_fits(tmp_path: Path) -> None:
    """A chart like Ohta's table is solved with it, unless the caller fixes the table or the basis has no prior."""
    (shot,) = simulate(CAMERA, "D55", tmp_path, chart="classic24:ohta", scene=Scene(size=SIZE)).shots
    measured = measure(shot.shot)
    chosen, fixed, paper = (
        solve(replace(measured, chart=read_chart(chart)), options=Options(basis=basis))
        for chart, basis in (("classic24", "auto"), ("classic24:babelcolor", "auto"), ("classic24", "gaussian"))
    )
    tables = [result.capture.chart.table for result in (chosen, fixed, paper)]
    assert tables == ["ColorChecker N Ohta", "BabelColor Average", "BabelColor Average"]
    assert np.mean(chosen.scores.rmsre_percent) < np.mean(fixed.scores.rmsre_percent)


@pytest.fixture(scope="module")
def solved(capture: Capture) -> Result:
    return solve(capture)


def test_predicted_colours_carry_bands(capture: Capture, solved: Result) -> None:
    """The chart has its table's reflectances and the lamp its spectrum: what is predicted unseen lies within."""
    answer = solved.answer
    seen, unseen, y = answer.predicted_std, answer.unseen_std, solved.signals
    assert seen.shape == unseen.shape == (1, 24, 3)
    assert np.median(unseen / seen) > 1.0
    off = np.abs(answer.unseen - y.values) / np.hypot(unseen, y.standard_error)
    assert np.mean(off <= 1.96) > 0.9
    document = json.loads(document_bytes(solved))["answer"]
    assert (document["predicted_std"], document["unseen_std"]) == (seen.tolist(), unseen.tolist())


def test_fit_on_twelve_patches_validates_on_the_rest(capture: Capture) -> None:
    result = solve(capture, options=Options(basis="cameras", fit=np.arange(7, 19)))
    assert result.signals.used[0].nonzero()[0].tolist() == list(range(6, 18))
    assert np.isfinite(result.answer.unseen[0]).all(axis=1).nonzero()[0].tolist() == [*range(6), *range(18, 24)]
    assert "12 patches" in result.scores.unseen
    for bad in ([], [0], [25], ["7"]):
        with pytest.raises(InvalidArgument, match="1 to 24"):
            solve(capture, options=Options(fit=bad))


def test_unseen_predictions_come_from_fits_without_the_patch(capture: Capture, solved: Result) -> None:
    """Change one measured patch: its own unseen prediction stays, others move."""
    mean = capture.shots[0].means.chart.mean.copy()
    mean[9] *= 1.05
    after = solve(changed(capture, shots__0__means__chart__mean=mean)).answer.unseen
    before = solved.answer.unseen
    assert after[0, 9] == pytest.approx(before[0, 9], rel=1e-12)
    assert np.abs(after[0, 10] - before[0, 10]).max() > 1e-6


def test_fallbacks_are_named(two_lamps: Simulation) -> None:
    result = calibrate(two_lamps.shots[0].chart, "D55", options=Options(basis="cameras"), truth=CAMERA)
    codes = {assumption.code for assumption in result.assumptions}
    assert {"white_from_patch", "dark_from_black_level", "chart_table", "lamp"} <= codes
    assert not result.signals.used[0, 18]
    seen = result.ssf.values.T @ (result.capture.chart.values[18] * read_lamp("D55").values)
    assert seen * 0.5 == pytest.approx(np.ones(3))
    assert "uneven_light" in codes  # 50 % vignetting, no white frame: solved for
    assert 0.6 < result.answer.level.min() < 0.9
    assert "uneven_light" not in {reason.code for reason in result.verdict.reasons}


@pytest.mark.parametrize(("change", "options", "words"), [
    ({"shots": 5, "lamp": None}, {}, "5 is no shot"), ({"shots": ["a.dng"], "lamp": None}, {}, "'a.dng' is no Shot"),
    ({"shots": Shot("a.dng")}, {}, "in addition to shots"), ({"shots": [], "lamp": None}, {}, "no photo"),
    ({"shots": Shot("a.dng", white=3), "lamp": None}, {}, "3 is no path"),
    ({"shots": [Shot("a.dng")] * 65, "lamp": None}, {}, "65 photos are too many"),
    ({"shots": Shot("a.dng", lamp_tolerance="2%"), "lamp": None}, {}, "has no tolerance"),
    ({"shots": [Shot("a.dng", white="w.dng"), Shot("b.dng")], "lamp": None}, {}, "for all shots"),
    ({"lamp": 5}, {}, "lamp"), ({"lamp": ["D55", "A"]}, {}, "lamp"), ({"lamp": "nonsense"}, {}, "nonsense"),
    ({"chart": "nonsense"}, {}, "nonsense"), ({}, {"fit": 5}, "no list"), ({}, {"basis": None}, "None"),
    ({}, {"gamma": "x"}, "gamma"), ({}, {"white_reflectance": "a"}, "0.95"),
], ids=str)  # fmt: skip
def test_bad_arguments_are_named(two_lamps: Simulation, change: Any, options: Any, words: str) -> None:
    arguments = {"shots": two_lamps.shots[0].chart, "lamp": "D55"} | change
    with pytest.raises(InvalidArgument, match=words):
        calibrate(**arguments, options=Options(**options))


@pytest.mark.repository
def test_every_option_is_one_that_the_product_uses() -> None:
    """A misspelt or forgotten one would be taken and do nothing."""
    files = ("photo/capture.py", "fit/capture_fit.py", "fit/solutions.py", "calibration.py")
    source = "".join((ROOT / "reference" / "camssf" / path).read_text("utf-8") for path in files)
    assert all(f"options.{field.name}" in source for field in fields(Options))


@pytest.mark.requirement("R-REFUSAL")
def test_a_refusal_is_a_product_that_keeps_its_evidence(tmp_path: Path, two_lamps: Simulation) -> None:
    """What `calibrate` raises, `attempt` gives; its capture holds the shots that were measured."""
    first, second = two_lamps.shots
    pair = [Shot(first.chart, "D55"), Shot(second.white, "A")]
    found = attempt(pair)
    assert isinstance(found.error, ChartNotFound)
    assert (found.answer, found.verdict.status, found.verdict.reasons[0].code) == (None, "refused", "chart_not_found")
    last = found.capture.unfinished
    assert (last.lamp.name, last.photo.unique_model, last.pose) == ("A", "camssf simulated camera", None)
    assert list(found.capture.hashes) == ["shot 1, chart: chart-D55.dng", "shot 2, chart: white-A.dng"]
    assert [shot.patches is not None for shot in shots_of(found)] == [True, False]
    assert [preview is not None for preview in found.previews] == [True, True]
    assert "pixels of the active area" in report(found, found.previews).html
    with pytest.raises(ChartNotFound) as raised:
        calibrate(pair)
    for capture in (found.capture, raised.value.capture):
        assert [shot.lamp.name for shot in capture.shots] == ["D55"]
    document = json.loads(document_bytes(found))
    assert [len(shot["means"]["chart"]["mean"]) for shot in document["capture"]["shots"]] == [24]
    assert document["capture"]["unfinished"]["photo"]["name"] == "white-A.dng"
    with pytest.raises(InvalidArgument, match="Measure it anew"):
        solve(found.capture)
    (tmp_path / "dark.csv").write_text("400,0\n500,0\n600,0\n700,0\n")
    dark = attempt(first.chart, str(tmp_path / "dark.csv"))
    assert isinstance(dark.error, LampUnfit)
    assert list(dark.capture.hashes) == ["shot 1, lamp: dark.csv"]


@pytest.mark.full
def test_the_real_photo_tells_warm_light_from_daylight() -> None:
    """Taken under an unknown warm light: 3000 K stands, if doubtful; D65 is doubted, and a warmer light is said."""
    photo = measure(Shot(ROOT / "data" / "dng" / "colorchart.dng", "3000K"))
    warm = solve(photo, options=Options(basis="cameras"))
    codes = {reason.code for reason in warm.verdict.reasons}
    assert (warm.verdict.status, codes & {"lamp_unfit", "underexposed"}) == ("doubtful", {"underexposed"})
    assert warm.capture.shots[0].pose.corners[:, 1].min() > 400  # the lower page
    assert warm.ssf.std is not None
    cold = solve(changed(photo, shots__0__lamp=read_light("D65")), options=Options(basis="cameras"))
    assert cold.verdict.status == "doubtful"
    assert any("another than D65" in reason.message for reason in cold.verdict.reasons)
    assert any("called D65; by the signals another daylight of 4," in one.message for one in cold.assumptions)
