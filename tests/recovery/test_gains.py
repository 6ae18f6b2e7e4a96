"""Uneven light without a white frame: rows by hand, the joint solution by another road, captures that it saves."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.calibration import calibrate, solve
from camssf.errors import InvalidArgument, UnevenLight
from camssf.fit.capture_fit import BOWL, CORNER, OWN, PLANE, gain_modes, places, prepare_fit, smooth_modes
from camssf.grid import Floats
from camssf.options import Options
from camssf.photo.capture import Capture
from camssf.photo.find.pose import Pose
from camssf.photo.patches import FrameMeans
from camssf.recovery import Observation, explain, predict
from camssf.recovery.basis import read_basis
from camssf.recovery.covariance import SOURCES
from camssf.recovery.sensitivity import SolverSettings, Ssf, solve_on_basis
from camssf.report.page import page
from camssf.report.sections.uneven import fall_of
from camssf.report.shots import shots_of
from camssf.result import Result
from camssf.spectra import CameraCurves, read_chart, read_lamp
from camssf.spectra.layouts import LAYOUTS
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene
from golden.forms import resolve
from golden.linear_model import linear_model
from golden.scenes import PHONE
from tests.recovery.test_choice import SEEN, capture
from tests.support.problems import theory, toy_camera

TABLE = read_chart("classic24")
WHITE = 18
SIZE = (1200, 900)


def pose() -> Pose:
    return capture(resolve(PHONE), ("D55",)).shots[0].pose


def shaded(vignetting: float, gradient: float, middle: tuple[float, float] = (0.3, -0.2)) -> Floats:
    """Relative light (24,), 1 on the white patch: lost at the farthest patch, and change across the chart."""
    X, Y = places(pose()).T
    squares = (X - middle[0]) ** 2 + (Y - middle[1]) ** 2
    light = (1.0 - vignetting * squares / squares.max()) * (1.0 + 0.5 * gradient * X)
    return np.asarray(light / light[WHITE])


def uneven(light: Floats, lamps: tuple[str, ...] = ("D55",), **how: Any) -> Capture:
    """A phone's capture with so much light on each patch, and no white frame."""
    given = capture(resolve(PHONE), lamps, **how)
    shots = tuple(replace(shot, white=None, means=_shaded(shot.means, light)) for shot in given.shots)
    return replace(given, shots=shots)


def _shaded(means: Any, light: Floats) -> Any:
    chart: FrameMeans = means.chart
    black = means.dark.mean if means.dark is not None else means.black
    mean = black + 0.8 * (chart.mean - black) * light[:, None] / light.max()
    return replace(means, chart=replace(chart, mean=mean), white=None)


@cache
def found(vignetting: float, gradient: float, lamps: tuple[str, ...] = ("D55",)) -> Result:
    return solve(uneven(shaded(vignetting, gradient), lamps), options=Options(basis="phones"))


def off(ssf: Ssf) -> tuple[float, float]:
    """RMSE against the phone's own curves, and the share of them that the bands hold."""
    truth = resolve(PHONE)
    curves, std = ssf.peak()
    assert std is not None
    apart = (curves - truth / truth.max(axis=0))[SEEN]
    return float(np.sqrt(np.mean(apart**2, axis=0)).mean()), float((np.abs(apart) <= 1.96 * std[SEEN]).mean())


def observed(
    light: Floats, lamps: tuple[str, ...] = ("D55",), modes: Floats | None = None, **more: Any
) -> Observation:
    """Exact signals of the toy camera under uneven light, with gain modes."""
    lights = np.stack([read_lamp(lamp).values for lamp in lamps])
    k = len(lamps)
    rho = TABLE.values[WHITE]
    signals = np.stack([theory(TABLE.values, each, toy_camera(), rho) for each in lights]) * light[:, None]
    modes = smooth_modes(pose(), LAYOUTS["classic24"], WHITE) if modes is None else modes
    return Observation(
        signals, TABLE.values, lights, standard_error=np.full(signals.shape, 1e-3), white_reflectance=rho,
        gain_modes=np.repeat(modes[None], k, axis=0), **({"gain_own": OWN} | more),
    )  # fmt: skip


# -- the modes ------------------------------------------------------------------------------------------------------


def test_the_modes_are_a_plane_a_bowl_and_a_level_less_the_white_s() -> None:
    XY = places(pose())
    assert np.abs(XY[:, 0]).max() == pytest.approx(1.0)
    assert XY.max(axis=0) + XY.min(axis=0) == pytest.approx(np.zeros(2))
    found = smooth_modes(pose(), LAYOUTS["classic24"], WHITE)
    assert found[:, WHITE] == pytest.approx(np.zeros(6))
    by_hand = [PLANE * (XY[3, 0] - XY[WHITE, 0]), BOWL * (XY[3, 0] * XY[3, 1] - XY[WHITE, 0] * XY[WHITE, 1])]
    assert found[[0, 3, 5], 3] == pytest.approx([*by_hand, CORNER])


def test_a_white_frame_leaves_none() -> None:
    framed = capture(resolve(PHONE), ("D55", "A"))
    modes, _ = gain_modes(framed, None)
    assert modes.shape == (2, 0, 24)
    bare = replace(framed, shots=tuple(replace(s, means=replace(s.means, white=None)) for s in framed.shots))
    modes, own = gain_modes(bare, None)
    assert modes.shape == (2, 6, 24)
    assert own == OWN


def test_patches_one_by_one_have_a_mode_each() -> None:
    framed = capture(resolve(PHONE), ("D55",))
    modes, own = gain_modes(framed, 0.08)
    assert modes[0] == pytest.approx(0.08 * np.eye(24))
    assert own == 0.0
    bare = replace(framed, shots=tuple(replace(s, means=replace(s.means, white=None)) for s in framed.shots))
    (each,), _ = gain_modes(bare, 0.08)
    # The white's own gain is in all others: independent errors of .08 plus a common one.
    rest = np.delete(np.arange(24), WHITE)
    assert (each.T @ each)[np.ix_(rest, rest)] == pytest.approx(0.08**2 * (np.eye(23) + 1.0))
    assert each[:, WHITE] == pytest.approx(0.0)


# -- the rows -------------------------------------------------------------------------------------------------------


def test_the_answer_is_the_joint_least_squares() -> None:
    """Curves and gains beside each other, x and v ~ N(0, I): the same as gains folded into Σ, by lstsq."""
    given = observed(shaded(0.3, 0.15))
    basis = read_basis("cameras")
    rows = linear_model(given, basis)
    found = solve_on_basis(given, "cameras", settings=SolverSettings(gamma=0.0, engine="reference"))
    A, D, b = rows.matrix[0], rows.gains, rows.target[0]
    root = np.linalg.cholesky(rows.covariance[0] - D @ D.T)
    both = np.linalg.solve(root, np.column_stack([A, D, b]))
    stacked = np.vstack([both[:, :-1], np.eye(A.shape[1] + D.shape[1])])
    z = np.linalg.lstsq(stacked, np.append(both[:, -1], np.zeros(stacked.shape[1])), rcond=None)[0]
    assert found.code.T.ravel() == pytest.approx(z[: A.shape[1]], abs=1e-7 * np.abs(z).max())
    assert found.gain_code.ravel() == pytest.approx(z[A.shape[1] :], abs=1e-7 * np.abs(z).max())


def test_each_patch_free_makes_any_shading_no_matter() -> None:
    """With a gain of each patch the ratios of its colours are left: another shading, the same curves."""
    modes = gain_modes(uneven(np.ones(24)), 1.0)[0][0]
    rng = np.random.default_rng(4)
    one, other = (
        solve_on_basis(observed(np.exp(0.1 * rng.normal(size=24)), modes=modes, gain_own=0.0), "phones").peak()[0]
        for _ in range(2)
    )
    plain = [
        solve_on_basis(observed(np.exp(0.1 * rng.normal(size=24)), modes=np.zeros((0, 24))), "phones").peak()[0]
        for _ in range(2)
    ]
    assert np.abs(one - other).max() < 0.1 * np.abs(plain[0] - plain[1]).max()


# -- captures -------------------------------------------------------------------------------------------------------


@pytest.mark.requirement("R-FIELD")
@pytest.mark.parametrize("lamps", [("D55",), pytest.param(("D55", "A"), marks=pytest.mark.full)])
def test_uneven_light_costs_hardly_anything(lamps: tuple[str, ...]) -> None:
    even, held = off(found(0.0, 0.0, lamps).ssf)
    for vignetting, gradient in ((0.1, 0.05), (0.3, 0.15)):
        uneven_, covered = off(found(vignetting, gradient, lamps).ssf)
        assert uneven_ < 1.1 * even + 0.001
        assert covered > held - 0.04
        assert found(vignetting, gradient, lamps).verdict.status == "accepted"


def test_the_light_is_found() -> None:
    light = shaded(0.3, 0.15)
    done = found(0.3, 0.15)
    level = done.answer.level
    assert 1.0 / level[0] == pytest.approx(light, abs=0.04)
    assert np.ptp(light) > 0.25
    assert level[0, WHITE] == 1.0
    (said,) = [assumption.message for assumption in done.assumptions if assumption.code == "uneven_light"]
    assert f"{100 / level.min() - 100:+.0f} %" in said


def test_residuals_are_those_of_even_light() -> None:
    """Scores compare what even light would have given; as the light fell they would be 20 % and more."""
    assert (found(0.3, 0.15).scores.rmsre_percent < 2.0).all()
    answer = found(0.3, 0.15).answer
    even, level = answer.predicted, answer.level[:, :, None]
    signals = found(0.3, 0.15).signals.values
    used = found(0.3, 0.15).signals.used
    assert np.abs(signals * level - even)[used].max() < 0.25 * np.abs(signals - even)[used].max()


def test_the_budget_names_uneven_light() -> None:
    shares = explain(prepare_fit(uneven(shaded(0.3, 0.15)), Options(basis="phones")).given(
        found(0.3, 0.15).signals.used), basis="phones")  # fmt: skip
    assert set(SOURCES) <= set(shares)
    assert (shares["uneven light"] > 0.002).all()
    assert sum(shares.values()) == pytest.approx(np.ones(3))
    uncertainty = found(0.3, 0.15).uncertainty
    assert uncertainty is not None
    (row,) = [each for each in uncertainty.budget if each.source == "uneven light"]
    assert "no white frame" in row.size


@pytest.mark.parametrize("depth", [0.7, 1.3])
def test_light_that_no_bowl_can_be_is_doubted(depth: float) -> None:
    """A shadow over half of the chart, with its edge."""
    half = places(pose())[:, 0] > 0.0
    done = solve(uneven(np.where(half, depth, 1.0)), options=Options(basis="phones"))
    assert "uneven_light" in {reason.code for reason in done.verdict.reasons}


def test_a_slight_shadow_is_not_spoken_of() -> None:
    half = places(pose())[:, 0] > 0.0
    slight = solve(uneven(np.where(half, 0.9, 1.0)), options=Options(basis="phones"))
    assert slight.verdict.status == "accepted"
    assert off(slight.ssf)[0] < 1.2 * off(found(0.0, 0.0).ssf)[0]


def test_predictions_take_other_patches_gains() -> None:
    given = observed(shaded(0.3, 0.15))
    ssf = solve_on_basis(given, "cameras")
    inside = predict(ssf, given, of=TABLE.values[:2], of_gains=given.gain_modes[:, :, :2]).std
    plain = predict(ssf, given, of=TABLE.values[:2]).std
    assert (inside[:, 24:] > plain[:, 24:]).any()
    with pytest.raises(InvalidArgument, match="of_gains"):
        predict(ssf, given, of=TABLE.values[:2], of_gains=np.zeros((1, 6, 3)))


def test_the_bands_of_unseen_patches_hold_under_a_dark_lens() -> None:
    """A patch that the fit has not seen stands in its own light: even-light values in its place made bands too narrow
    (two shots, 60 %: .78 held)."""
    done = found(0.6, 0.15, ("D55", "A"))
    answer, signals = done.answer, done.signals
    assert answer.unseen_std is not None
    apart = (signals.values * answer.level[:, :, None] - answer.unseen)[signals.used]
    assert np.mean(np.abs(apart) <= 1.96 * answer.unseen_std[signals.used]) > 0.9


def test_the_paper_s_basis_has_no_place_for_uneven_light() -> None:
    """What is not solved for is not excused by the verdict either."""
    given = uneven(shaded(0.3, 0.15))
    with pytest.raises(UnevenLight):
        solve(given, options=Options(basis="gaussian"))
    with pytest.raises(InvalidArgument, match="differs between patches cannot be estimated"):
        solve(given, options=Options(basis="gaussian", light_per_patch=0.08))


def test_a_white_patch_in_the_middle_has_no_level_of_its_own() -> None:
    assert smooth_modes(pose(), LAYOUTS["classic24"], 18).shape == (6, 24)
    assert smooth_modes(pose(), LAYOUTS["classic24"], 8).shape == (5, 24)


@pytest.mark.parametrize("size", [0.0, -0.1, 1.5, True, "8%", float("nan")])
def test_light_that_cannot_be_is_refused(size: Any) -> None:
    with pytest.raises(InvalidArgument):
        solve(uneven(np.ones(24)), options=Options(light_per_patch=size))


def test_gain_modes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InvalidArgument, match="gain_modes"):
        observed(np.ones(24), modes=np.zeros((5, 23)))
    with pytest.raises(InvalidArgument, match="gain_own"):
        observed(np.ones(24), gain_own=-0.1)


@pytest.mark.full
def test_a_photo_without_a_white_frame(tmp_path: Path) -> None:
    """From the DNG on: a rendered phone's chart under 50 % vignetting, as good without a white frame as with one."""
    camera = CameraCurves("phone", resolve(PHONE), "golden")
    shot = simulate(camera, ["D55"], tmp_path, scene=Scene(size=SIZE, vignetting=0.5, rotation=8, tilt=10)).shots[0]
    bare = calibrate(shot.chart, "D55", options=Options(basis="phones"), truth=camera)
    framed = calibrate(shot.shot, options=Options(basis="phones"), truth=camera)
    assert bare.verdict.status == framed.verdict.status == "accepted"
    assert bare.scores.rmse is not None
    assert framed.scores.rmse is not None
    assert bare.scores.rmse.mean() < 1.3 * framed.scores.rmse.mean()


def test_the_report_draws_the_light() -> None:
    done = found(0.3, 0.15)
    (shown,) = shots_of(done)
    text = page(done, [shown], [None])
    assert "Unevenness of the light" in text
    most = f"{100.0 / done.answer.level.min() - 100.0:+.0f} %"
    assert f">{most}</text>" in text
    assert text.count("hsl(45") == 24
    assert fall_of(replace(shown, pose=None, patches=None)) is None
