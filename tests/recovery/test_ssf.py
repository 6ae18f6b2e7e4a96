"""Recovery end to end on signals formed by their integrals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from camssf.errors import InvalidArgument, LampUnfit
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import NODES, gaussian_basis, misfit_profile, read_basis
from camssf.recovery.observation import Observation
from camssf.recovery.rows import anchor
from camssf.recovery.sensitivity import Ssf
from golden.linear_model import linear_model, solve
from tests.support import problems
from tests.support.problems import chart_and_lamp, explained, measured_cameras, predicted, theory, toy_camera

ENGINE = "onnx"
SEEN = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)


def recovered(*positional: Any, **named: Any) -> Ssf:
    """`recover` by the engine at hand."""
    return problems.recovered(*positional, **{"engine": ENGINE} | named)


def rmse(values: Floats, truth: Floats) -> float:
    return float(np.sqrt(np.mean((values / values.max(0) - truth / truth.max(0))[SEEN] ** 2, axis=0)).mean())


def test_equation_5_reproduced_on_the_paper_s_basis() -> None:
    """Noise-free, equal-energy, 12 patches: mean RMSE over the 52 measured cameras at most 0.040."""
    reflectance, lamp = chart_and_lamp("equal-energy")
    errors = []
    for camera in measured_cameras().values():
        answer = recovered(
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
    answer = recovered(theory(reflectance, lamp, camera), reflectance, lamp, basis="gaussian", chart_tolerance=0)
    assert rmse(answer.values, camera) < 2e-3


def test_scale_is_fixed_by_the_white_of_the_first_lamp() -> None:
    reflectance, lamp = chart_and_lamp("A", slice(0, 24))
    white = 0.9 - 0.1 * (WAVELENGTHS - 380) / 340
    y = theory(reflectance, lamp, toy_camera(), white)
    for basis in ("gaussian", "cameras"):
        answer = recovered(y, reflectance, 7.0 * lamp, basis=basis, white_reflectance=white, standard_error=0.01 * y)
        assert (answer.values.T @ (white * 7.0 * lamp) * STEP) == pytest.approx(np.ones(3))
        assert answer.peak()[0].max(axis=0) == pytest.approx(np.ones(3))


def test_discrepancy_meets_the_noise() -> None:
    """The ε form: the residual of the chosen γ has the size of the noise."""
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    error = np.hypot(0.01 * y, 0.002)
    noisy = y + error * np.random.default_rng(4).normal(size=y.shape)
    answer = recovered(noisy, reflectance, lamp, standard_error=error, basis="gaussian", chart_tolerance=0)
    power = lamp * STEP / (lamp.sum() * STEP)
    curves = gaussian_basis().dictionary[0] @ answer.code
    chi2 = np.sum((((reflectance * power) @ curves - noisy) / error) ** 2, axis=0)
    assert chi2 == pytest.approx(np.full(3, 24.0), rel=0.03)


def test_literal_equation_10_allows_negative_codes() -> None:
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    error = 0.002 * y
    noisy = y + error * np.random.default_rng(1).normal(size=y.shape)
    positive = recovered(noisy, reflectance, lamp, standard_error=error, basis="gaussian", gamma=1e-2)
    signed = recovered(
        noisy, reflectance, lamp, standard_error=error, basis="gaussian", gamma=1e-2, nonnegative=False
    )
    assert (positive.code >= 0).all()
    assert (signed.code < 0).any()


def test_bands_shrink_with_evidence_and_exist_only_with_a_prior() -> None:
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    few = recovered(y[:6], reflectance[:6], lamp, basis="cameras", standard_error=0.005 * y[:6])
    many = recovered(y, reflectance, lamp, basis="cameras", standard_error=0.005 * y)
    uncertain = recovered(y, reflectance, lamp, basis="cameras", standard_error=0.05 * y, lamp_tolerance=0.1)
    assert few.std is not None
    assert many.std is not None
    assert uncertain.std is not None
    assert many.std.mean() < few.std.mean()
    assert many.std.mean() < uncertain.std.mean()
    assert recovered(y, reflectance, lamp, basis="gaussian", standard_error=0.005 * y).std is None


def test_predictions_are_signals() -> None:
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    answer = recovered(y, reflectance, lamp, basis="cameras", standard_error=0.002 * y, chart_tolerance=0.0)
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
        ({"gamma": [0.05, 0.05, 0.06]}, InvalidArgument),
        ({"gamma": [0.05, 0.05]}, InvalidArgument),
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
        recovered(**(arguments | change))  # type: ignore[arg-type]
    assert refusal.value.advice  # type: ignore[attr-defined]


def test_a_gamma_of_each_channel_is_the_paper_s_alone() -> None:
    """On `gaussian` the channels are three problems, each as if asked alone; on a learned basis they are one."""
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    arguments: dict[str, Any] = {"basis": "gaussian", "standard_error": 0.005 * y, "chart_tolerance": 0.0}
    gammas = [0.3, 1.0, 3.0]
    mixed = recovered(y, reflectance, lamp, gamma=gammas, **arguments)
    assert mixed.gamma == pytest.approx(gammas)
    assert mixed.proof.layers_gap.shape == mixed.proof.finish_steps.shape == (3,)
    for c, gamma in enumerate(gammas):
        alone = recovered(y, reflectance, lamp, gamma=gamma, **arguments)
        assert mixed.code[:, c] == pytest.approx(alone.code[:, c], abs=1e-12)
    with pytest.raises(InvalidArgument, match="one problem"):
        recovered(y, reflectance, lamp, gamma=gammas)
    same = recovered(y, reflectance, lamp, gamma=[0.3] * 3)
    assert same.gamma == pytest.approx([0.3] * 3)
    assert same.values == pytest.approx(recovered(y, reflectance, lamp, gamma=0.3).values, rel=1e-12)


def declared(shots: int) -> dict[str, Any]:
    """Signals of the toy camera under known daylight and bulb, and what is told of them."""
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    lamps = np.stack([day, chart_and_lamp("A")[1]])[:shots]
    y = np.stack([theory(reflectance, lamp, toy_camera()) for lamp in lamps])
    return {
        "signals": y[:, ::2],
        "reflectance": reflectance[::2],
        "lamp": lamps,
        "standard_error": np.hypot(0.005 * y[:, ::2], 0.001),
        "chart_tolerance": 0.03,
        "white_tolerance": 0.01,
        "lamp_tolerance": 0.02,
    }


def peak_one(code: Floats, lamp: Floats, at: Any = None) -> Floats:
    """(681, 3) μ + Ψ x over its own value at the nodes `at`, by default at its peak."""
    book = anchor(read_basis("cameras"), lamp)
    curves = (book.mean + np.einsum("cmr,cr->cm", book.dictionary, code.reshape(3, -1))).T
    top = curves.argmax(axis=0) if at is None else at
    return np.asarray(curves / curves[top, [0, 1, 2]])


def missed() -> Floats:
    """(681, 3) what every basis misses of the curves of peak 1, one standard deviation."""
    return np.stack([np.interp(WAVELENGTHS, NODES, channel) for channel in misfit_profile()], axis=1)


def slopes_of_peak_one(code: Floats, lamp: Floats, h: float = 1e-4) -> Floats:
    """(3, 681, 72) by finite differences, the peak's wavelength held."""
    top = peak_one(code, lamp).argmax(axis=0)
    return np.stack(
        [(peak_one(code + e, lamp, top) - peak_one(code - e, lamp, top)).T / (2 * h) for e in h * np.eye(code.size)],
        axis=-1,
    )


@pytest.mark.parametrize("shots", [1, 2])
def test_bands_are_the_posterior_s(shots: int) -> None:
    """The covariance of x as I - Aᵀ (Σ + A Aᵀ)⁻¹ A, and the curves' by finite differences of the curve of peak 1."""
    arguments = declared(shots) | {"basis": "cameras"}
    answer = recovered(**arguments)
    rows = linear_model(problems.observed(**arguments)[0], read_basis("cameras"))
    A, sigma = rows.matrix[0], rows.covariance[0]
    spread = np.eye(72) - A.T @ np.linalg.solve(sigma + A @ A.T, A)
    assert answer.code_covariance is not None
    assert answer.code_covariance.shape == (72, 72)
    assert answer.code_covariance == pytest.approx(spread, abs=1e-10)
    deviation = np.sqrt(np.diag(spread))
    between = (spread / np.outer(deviation, deviation))[:24, 24:48]
    assert np.abs(between).max() > 0.09  # one chart, one white, one lamp: what is wrong with red is with green
    slopes = slopes_of_peak_one(answer.code.T.ravel(), arguments["lamp"][0])
    std = answer.peak()[1]
    assert std is not None
    own = np.sqrt(np.einsum("cmx,xz,cmz->cm", slopes, spread, slopes))
    assert pytest.approx(np.hypot(own, missed().T), abs=1e-7) == std.T


def test_the_evidence_is_that_of_the_rows_and_prefers_the_true_lamp() -> None:
    arguments = declared(2) | {"basis": "cameras"}
    answer = recovered(**arguments)
    rows = linear_model(problems.observed(**arguments)[0], read_basis("cameras"))
    assert answer.log_evidence == pytest.approx(solve(rows, 1.0, np.full(1, 0.05)).log_evidence[0], rel=1e-9)
    wrong = recovered(**arguments | {"lamp": np.stack([arguments["lamp"][0], chart_and_lamp("FL2")[1]])})
    assert answer.log_evidence is not None
    assert wrong.log_evidence is not None
    assert answer.log_evidence > wrong.log_evidence + 10
    paper = recovered(**declared(1) | {"basis": "gaussian", "chart_tolerance": 0.0, "gamma": 1.0})
    assert paper.code_covariance is None
    assert paper.log_evidence is None


@pytest.mark.parametrize("shots", [1, 2])
def test_the_budget_s_parts_are_the_posterior(shots: int) -> None:
    """Each source's variance by hand, G Σ_t Gᵀ seen through finite differences; with what no patch has seen they add
    up to the band that `recover` returns, channel by channel."""
    arguments = declared(shots)
    shares = explained(**arguments)
    answer = recovered(**arguments, basis="cameras", gamma=0.0)
    assert answer.code_covariance is not None
    std = answer.peak()[1]
    assert std is not None
    rows = linear_model(problems.observed(**arguments)[0], read_basis("cameras"))
    gain = answer.code_covariance @ rows.matrix[0].T @ np.linalg.inv(rows.covariance[0])
    slopes = slopes_of_peak_one(answer.code.T.ravel(), arguments["lamp"][0])
    band = np.sum(std**2, axis=0)
    assert set(shares) == {"noise", "chart", "white", "lamp", "lamp modes", "uneven light", "unseen"}
    for source, term in rows.terms.items():
        own = np.einsum("cmx,xz,cmz->c", slopes, gain @ term[0] @ gain.T, slopes)
        assert shares[source] * band == pytest.approx(own, rel=1e-5, abs=1e-9 * band.max())
    left = np.eye(72) - gain @ rows.matrix[0]
    unseen = np.einsum("cmx,xz,cmz->c", slopes, left @ left.T, slopes) + np.sum(missed() ** 2, axis=0)
    assert shares["unseen"] * band == pytest.approx(unseen, rel=1e-5)
    assert sum(shares.values()) == pytest.approx(np.ones(3))


def test_the_budget_names_what_is_uncertain() -> None:
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    certain = {"standard_error": np.full(y.shape, 1e-9), "chart_tolerance": 0.0, "white_tolerance": 0.0}
    noisy = certain | {"standard_error": np.full(y.shape, 0.01)}
    quiet, loud = explained(y, reflectance, lamp, **certain), explained(y, reflectance, lamp, **noisy)
    assert sum(loud.values()) == pytest.approx(np.ones(3))
    assert (loud["noise"] > quiet["noise"]).all()
    for source in ("chart", "white", "lamp modes"):
        assert (loud[source] == 0).all()
    assert (loud["lamp"] < 0.02).all()  # that it drifts is never told
    veiled = explained(y, reflectance, lamp, **(certain | {"chart_tolerance": 0.03}))
    assert (veiled["chart"] > 0.1).all()
    with pytest.raises(InvalidArgument, match="no prior"):
        explained(y, reflectance, lamp, basis="gaussian")


@pytest.mark.parametrize("shots", [1, 2])
def test_prediction_bands_are_those_of_their_model(shots: int) -> None:
    """GUM Supplement 1: draw code, errors and noise from the rows' own model, fit, compare."""
    arguments, book = declared(shots), read_basis("cameras")
    others = chart_and_lamp("D55", slice(0, 24))[0][1::2]
    answer = recovered(**arguments)
    found = predicted(answer, **arguments, of=others, of_tolerance=0.02)
    assert found.values[:, :12] == pytest.approx(answer.predicted, rel=1e-9)
    k, n = shots, 24
    y = np.concatenate([arguments["signals"], found.values[:, 12:]], axis=1)
    rows = linear_model(
        Observation(
            y,
            np.concatenate([arguments["reflectance"], others]),
            arguments["lamp"],
            standard_error=np.concatenate([arguments["standard_error"], np.full((k, 12, 3), 1e3)], axis=1),
            chart_tolerance=np.repeat([0.03, 0.02], 12),
            white_reflectance=np.ones(681),
            white_tolerance=0.01,
            lamp_tolerance=np.full(k, 0.02),
            lamp_modes=np.zeros((k, 0, 681)),
        ),
        book,
    )
    fitted = np.tile(np.arange(n) < 12, 3 * k)
    rng = np.random.default_rng(4)
    A, sigma, noise = rows.matrix[0], rows.covariance[0], np.diag(rows.terms["noise"][0])
    errors = sum(term[0] for source, term in rows.terms.items() if source != "noise")
    root = np.linalg.cholesky(errors + 1e-14 * np.eye(len(A)))
    truth = A @ rng.normal(size=(72, 20000)) + root @ rng.normal(size=(len(A), 20000))
    seen = (truth + np.sqrt(noise)[:, None] * rng.normal(size=truth.shape))[fitted]
    B, S = A[fitted], sigma[np.ix_(fitted, fitted)]
    x = np.linalg.solve(B.T @ np.linalg.solve(S, B) + np.eye(72), B.T @ np.linalg.solve(S, seen))
    drawn = (truth - A @ x).std(axis=1).reshape(3, k, n)
    for c in range(3):
        # The rows' unit is the white signal of μ, the signals' that of the curve found.
        curve = book.mean[c]
        s = answer.values[:, c] * (curve @ arguments["lamp"][0]) * STEP
        unit = (arguments["lamp"] @ curve) / (arguments["lamp"] @ s)
        assert found.std[:, :, c] == pytest.approx(drawn[c] * unit[:, None], rel=0.03, abs=1e-5)


def test_a_surface_of_known_reflectance_is_better_known_than_a_patch() -> None:
    arguments = declared(2)
    others = chart_and_lamp("D55", slice(0, 24))[0][1::2]
    answer = recovered(**arguments)
    exact, table = (predicted(answer, **arguments, of=others, of_tolerance=tau).std for tau in (0.0, 0.03))
    assert (exact[:, 12:] < table[:, 12:]).all()
    assert exact[:, :12] == pytest.approx(table[:, :12], rel=1e-6)  # what is asked changes no answer
    assert predicted(answer, **arguments).std == pytest.approx(exact[:, :12], rel=1e-6)
    with pytest.raises(InvalidArgument, match="no prior"):
        predicted(answer, **arguments | {"basis": "gaussian"})
    with pytest.raises(InvalidArgument, match="`of` has shape"):
        predicted(answer, **arguments, of=np.ones((2, 3)))
