"""Recovery end to end on signals formed by their integrals."""

from __future__ import annotations

import numpy as np
import pytest

from camssf import recover
from camssf.basis import gaussian_basis
from camssf.errors import InvalidArgument, LampUnfit
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.ssf import explain
from tests.problems import chart_and_lamp, measured_cameras, theory, toy_camera

SEEN = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)


def rmse(values: Floats, truth: Floats) -> float:
    return float(np.sqrt(np.mean((values / values.max(0) - truth / truth.max(0))[SEEN] ** 2, axis=0)).mean())


def test_equation_5_reproduced_on_the_paper_s_basis() -> None:
    """Noise-free, equal-energy, 12 patches: mean RMSE over the 52 measured cameras at most 0.040."""
    reflectance, lamp = chart_and_lamp("equal-energy")
    errors = []
    for camera in measured_cameras().values():
        answer = recover(
            theory(reflectance, lamp, camera),
            reflectance,
            lamp,
            basis="gaussian",
            chart_tolerance=0,
            white_tolerance=0,
        )
        errors.append(rmse(answer.values, camera))
    assert np.mean(errors) <= 0.040


def test_a_curve_of_the_basis_comes_back() -> None:
    """Limit case: the truth is one atom, so is the answer."""
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    atoms = gaussian_basis().dictionary[0]
    camera = atoms[:, [11, 8, 4]]
    answer = recover(theory(reflectance, lamp, camera), reflectance, lamp, basis="gaussian", chart_tolerance=0)
    assert rmse(answer.values, camera) < 2e-3


def test_scale_is_fixed_by_the_white_of_the_first_lamp() -> None:
    reflectance, lamp = chart_and_lamp("A", slice(0, 24))
    white = 0.9 - 0.1 * (WAVELENGTHS - 380) / 340
    y = theory(reflectance, lamp, toy_camera(), white)
    for basis in ("gaussian", "cameras"):
        answer = recover(y, reflectance, 7.0 * lamp, basis=basis, white_reflectance=white, standard_error=0.01 * y)
        assert (answer.values.T @ (white * 7.0 * lamp) * STEP) == pytest.approx(np.ones(3))
        assert answer.peak()[0].max(axis=0) == pytest.approx(np.ones(3))


def test_the_lamp_s_scale_and_the_white_s_do_not_matter() -> None:
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    plain = recover(y, reflectance, lamp, basis="cameras", standard_error=0.005 * y)
    scaled = recover(y, reflectance, 1e3 * lamp, basis="cameras", standard_error=0.005 * y)
    assert scaled.peak()[0] == pytest.approx(plain.peak()[0], abs=1e-9)


def test_discrepancy_meets_the_noise() -> None:
    """The ε form: the residual of the chosen γ has the size of the noise."""
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    error = np.hypot(0.01 * y, 0.002)
    noisy = y + error * np.random.default_rng(4).normal(size=y.shape)
    answer = recover(noisy, reflectance, lamp, standard_error=error, basis="gaussian", chart_tolerance=0)
    power = lamp * STEP / (lamp.sum() * STEP)
    curves = gaussian_basis().dictionary[0] @ answer.code
    chi2 = np.sum((((reflectance * power) @ curves - noisy) / error) ** 2, axis=0)
    assert chi2 == pytest.approx(np.full(3, 24.0), rel=0.03)


def test_literal_equation_10_allows_negative_codes() -> None:
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    error = 0.002 * y
    noisy = y + error * np.random.default_rng(1).normal(size=y.shape)
    positive = recover(noisy, reflectance, lamp, standard_error=error, basis="gaussian", gamma=1e-2)
    signed = recover(noisy, reflectance, lamp, standard_error=error, basis="gaussian", gamma=1e-2, nonnegative=False)
    assert (positive.code >= 0).all()
    assert (signed.code < 0).any()


def test_bands_shrink_with_evidence_and_exist_only_with_a_prior() -> None:
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    few = recover(y[:6], reflectance[:6], lamp, basis="cameras", standard_error=0.005 * y[:6])
    many = recover(y, reflectance, lamp, basis="cameras", standard_error=0.005 * y)
    vague = recover(y, reflectance, lamp, basis="cameras", standard_error=0.05 * y, lamp_tolerance=0.1)
    assert few.std is not None
    assert many.std is not None
    assert vague.std is not None
    assert many.std.mean() < few.std.mean()
    assert many.std.mean() < vague.std.mean()
    assert recover(y, reflectance, lamp, basis="gaussian", standard_error=0.005 * y).std is None


def test_predictions_are_signals() -> None:
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    answer = recover(y, reflectance, lamp, basis="cameras", standard_error=0.002 * y, chart_tolerance=0.0)
    assert answer.predicted[0] == pytest.approx(theory(reflectance, lamp, answer.values))
    assert answer.predicted[0] == pytest.approx(y, rel=0.03)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"signals": np.ones((12, 4))}, InvalidArgument),
        ({"signals": [[1.0, 2.0, 3.0], [1.0, 2.0]]}, InvalidArgument),
        ({"signals": np.full((12, 3), np.nan)}, InvalidArgument),
        ({"reflectance": np.ones((11, 681))}, InvalidArgument),
        ({"lamp": np.ones(680)}, InvalidArgument),
        ({"lamp": np.zeros(681)}, LampUnfit),
        ({"lamp": -np.ones(681)}, LampUnfit),
        ({"chart_tolerance": -0.1}, InvalidArgument),
        ({"chart_tolerance": [0.1, 0.2]}, InvalidArgument),
        ({"lamp_tolerance": np.inf}, InvalidArgument),
        ({"lamp_modes": np.ones((2, 1, 681))}, InvalidArgument),
        ({"standard_error": -np.ones((12, 3))}, InvalidArgument),
        ({"standard_error": np.ones((11, 3))}, InvalidArgument),
        ({"white_reflectance": np.zeros(681)}, InvalidArgument),
        ({"gamma": -1.0}, InvalidArgument),
        ({"gamma": 0.0, "l2": 0.0}, InvalidArgument),
        ({"l2": np.nan}, InvalidArgument),
        ({"basis": "nonsense"}, InvalidArgument),
        ({"engine": "nonsense"}, InvalidArgument),
        ({"signals": np.ones((2, 12, 3)), "basis": "gaussian"}, InvalidArgument),
    ],
)
def test_bad_arguments_are_named(change: dict[str, object], error: type[Exception]) -> None:
    reflectance, lamp = chart_and_lamp()
    arguments: dict[str, object] = {
        "signals": theory(reflectance, lamp, toy_camera()),
        "reflectance": reflectance,
        "lamp": lamp,
    }
    with pytest.raises(error) as refusal:
        recover(**(arguments | change))  # type: ignore[arg-type]
    assert refusal.value.advice  # type: ignore[attr-defined]


def test_the_budget_s_parts_are_the_posterior() -> None:
    """The sources' variances add up to the band that `recover` returns: made with each source's share by hand."""
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    certain = {"standard_error": np.full(y.shape, 1e-9), "chart_tolerance": 0.0, "white_tolerance": 0.0}
    noisy = certain | {"standard_error": np.full(y.shape, 0.01)}
    quiet, loud = explain(y, reflectance, lamp, **certain), explain(y, reflectance, lamp, **noisy)
    assert sum(loud.values()) == pytest.approx(np.ones(3))
    assert (loud["noise"] > quiet["noise"]).all()
    for source in ("chart", "white", "lamp", "lamp modes"):
        assert (loud[source] == 0).all()
    veiled = explain(y, reflectance, lamp, **(certain | {"chart_tolerance": 0.03}))
    assert (veiled["chart"] > 0.1).all()
    with pytest.raises(InvalidArgument, match="no prior"):
        explain(y, reflectance, lamp, basis="gaussian")
