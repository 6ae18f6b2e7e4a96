"""The causes of a misfit, weighed against each other."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from camssf.calibration import solve
from camssf.errors import CalibrationError
from camssf.grid import Floats
from camssf.options import Options
from camssf.photo.capture import Capture
from camssf.recovery.basis import read_basis, widened
from camssf.recovery.causes import CAUSES, NARROW, ChartScene, cause_evidences, kinds_of_error, patch_groups, spoilt
from camssf.recovery.misfit import (
    AnswerBasis,
    atoms_at_answer,
    derivative_by_code,
    errors_at_answer,
    signals_at_answer,
)
from camssf.verdict.cause import put_first, tables_of_causes, weigh_causes
from camssf.verdict.goodness_of_fit import explained_signals, places
from camssf.verdict.reasons import Fatal, because
from golden.forms import resolve
from golden.scenes import PHONE
from tests.recovery.test_choice import capture
from tests.verdict.test_verdict import BLACK, TABLE, Scene, clean

pytestmark = pytest.mark.requirement("R-CAUSE")

TABLES = np.stack([table.values for table in tables_of_causes(TABLE)])
X = (np.arange(24) % 6 - 2.5)[:, None] / 5.0


def test_the_evidence_is_that_of_normal_signals() -> None:
    """ln of N(b; 0, P + D Dᵀ) over N(b; 0, P), by SciPy."""
    scene = Scene(clean() * (1.0 + X * [0.3, 0.0, -0.3]))
    alone, basis = scene.told().of_shot(0), widened(read_basis(scene.ssf.basis), scene.ssf.prior_scale)
    judged = explained_signals(alone, scene.ssf)
    nodes = AnswerBasis(scene.lamps[0].values, basis.mean[:, ::10], basis.dictionary[:, ::10])
    chart = ChartScene(places(alone.poses[0], alone.signals.used[0]), np.zeros(24), TABLES)
    found = dict(zip(CAUSES, cause_evidences(judged, nodes, chart).log_evidence, strict=True))
    at = signals_at_answer(judged)
    A = derivative_by_code(judged, at, atoms_at_answer(judged, nodes))
    b = judged.difference[:, 0] + A @ judged.code.T.reshape(-1)
    P = errors_at_answer(judged, at).covariance + NARROW**2 * A @ A.T

    def density(D: Floats) -> float:
        return float(multivariate_normal(cov=P + D @ D.T).logpdf(b))

    none = density(np.zeros((72, 1)))
    for name, variants in zip(CAUSES[1:9], kinds_of_error(judged, chart), strict=True):
        gains = np.concatenate(
            [[density(D.reshape(72, -1)) - none for D in kind.directions] for kind in variants if kind.counts.any()]
        )
        expected = np.logaddexp.reduce(gains) - np.log(len(gains))
        assert found[name] == pytest.approx(expected, rel=1e-7, abs=1e-6), name
    own = spoilt(judged, chart).reshape(-1)
    gains = np.array([density(np.diag(own * np.repeat(group, 3))) - none for group in patch_groups(judged, chart)])
    assert found["patch"] == pytest.approx(np.logaddexp.reduce(gains) - np.log(len(gains)), rel=1e-7)


def test_what_the_noise_shows_comes_before_any_cause() -> None:
    scene = Scene(clean() ** 0.88)
    told, basis = scene.told(), widened(read_basis(scene.ssf.basis), scene.ssf.prior_scale)
    weighed = weigh_causes(told, 0, scene.ssf, basis, [], TABLES, ())
    one = told.goodness_of_fit_of_shot(0, scene.ssf)
    mixed = because("mixed", 0.2, {"shot": 1, "share": 0.2})
    unexplained = because("unexplained", 9.0, {"size": 3.0}, fatal=True)
    first, second = put_first([unexplained, mixed], weighed, one, told)
    assert (first.key, second.key) == ("not_sensor_raw.mixed", "not_sensor_raw.tone")
    assert isinstance(first, Fatal)


def spoilt_capture(patches: Mapping[int, float]) -> Capture:
    """A phone's photo under D55 in which these patches have another signal by these factors."""
    made = capture(resolve(PHONE), ["D55"], make="Apple")
    (shot,) = made.shots
    mean = shot.means.chart.mean.copy()
    for patch, factor in patches.items():
        mean[patch] = BLACK + factor * (mean[patch] - BLACK)
    means = replace(shot.means, chart=replace(shot.means.chart, mean=mean))
    return replace(made, shots=(replace(shot, means=means),))


def test_one_bad_patch_is_left_out_and_said() -> None:
    """The answer is that of a fit without it: accepted, although with it the capture would be doubted."""
    spoilt = spoilt_capture({13: 0.6})
    result = solve(spoilt)
    assert result.verdict.status == "accepted"
    (said,) = [each.message for each in result.assumptions if each.code == "patch_left_out"]
    assert said.startswith(f"patch {TABLE.patches[13]} was left out")
    assert np.flatnonzero(~np.array(result.answer.used[0])).tolist() == [13]
    without = solve(spoilt, options=Options(fit=[i + 1 for i in range(24) if i != 13]))
    assert np.abs(result.ssf.peak()[0] - without.ssf.peak()[0]).max() < 1e-9


def test_several_bad_patches_are_not_left_out() -> None:
    """Which ones is not known."""
    with pytest.raises(CalibrationError):
        solve(spoilt_capture({1: 0.5, 13: 0.6, 16: 1.5}))
