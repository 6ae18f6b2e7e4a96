"""Recovery end to end on signals formed by their integrals."""

from typing import Any

import numpy as np
import pytest

from camssf.errors import InvalidArgument
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery import explain, predict
from camssf.recovery.basis import NODES, gaussian_basis, misfit_profile, read_basis
from camssf.recovery.rows import anchor
from camssf.spectra import read_lamp
from tests.support.dense_model import dense_model
from tests.support.problems import chart_and_lamp, measured_cameras, observed, recovered, theory, toy_camera

SEEN = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)


def test_equation_5_reproduced_on_the_paper_s_basis() -> None:
    """Noise-free, equal-energy, 12 patches: mean RMSE over the 52 measured cameras at most 0.040."""
    reflectance, lamp = chart_and_lamp("equal-energy")
    errors = []
    for camera in measured_cameras().values():
        y, exact = theory(reflectance, lamp, camera), {"chart_tolerance": 0, "white_tolerance": 0}
        answer = recovered(y, reflectance, lamp, basis="gaussian", **exact)
        off = answer.values / answer.values.max(0) - camera / camera.max(0)
        errors.append(np.sqrt(np.mean(off[SEEN] ** 2, axis=0)).mean())
    assert np.mean(errors) <= 0.040


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


def test_what_is_not_used_may_be_unknown() -> None:
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    used, hole = np.ones((1, 24), dtype=bool), y.copy()
    used[0, 3], hole[3] = False, np.nan
    given: dict[str, Any] = {"standard_error": 0.02 * y, "used": used}
    found, known = (recovered(signals, reflectance, lamp, **given) for signals in (hole, y))
    assert found.peak()[0] == pytest.approx(known.peak()[0], abs=1e-5)


@pytest.mark.parametrize(
    "change",
    [
        {"signals": np.ones((12, 4))}, {"lamp": np.ones(680)}, {"lamp_tolerance": np.inf},
        {"standard_error": np.ones((11, 3))}, {"gamma": [0.05, 0.05, 0.06]}, {"l2": np.nan},
        {"basis": "nonsense"}, {"engine": "nonsense"}, {"reflectance": 100 * np.ones((12, 681))},
        {"used": np.zeros((1, 12), dtype=bool)}, {"used": [[True], [True, False]]},
        {"frames": 3}, {"frames": (np.ones((12, 3)), np.ones((12, 3)), np.ones((5, 3)))},
    ],
)  # fmt: skip
def test_bad_arguments_are_named(change: dict[str, object]) -> None:
    reflectance, lamp = chart_and_lamp()
    signals = theory(reflectance, lamp, toy_camera())
    arguments: dict[str, object] = {"signals": signals, "reflectance": reflectance, "lamp": lamp}
    with pytest.raises(InvalidArgument) as refusal:
        recovered(**(arguments | change))  # type: ignore[arg-type]
    assert refusal.value.advice


def declared(shots: int) -> dict[str, Any]:
    """Signals of the toy camera under known daylight and bulb, and what is told of them."""
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    lamps = np.stack([day, chart_and_lamp("A")[1]])[:shots]
    y = np.stack([theory(reflectance, lamp, toy_camera()) for lamp in lamps])
    tolerances = {"chart_tolerance": 0.03, "white_tolerance": 0.01, "lamp_tolerance": 0.02}
    y, error = y[:, ::2], np.hypot(0.005 * y[:, ::2], 0.001)
    return {"signals": y, "reflectance": reflectance[::2], "lamp": lamps, "standard_error": error} | tolerances


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
def test_bands_and_the_budget_s_parts_are_the_posterior_s(shots: int) -> None:
    """The covariance of x as I - Aᵀ (Σ + A Aᵀ)⁻¹ A; that of curves and of sources, G Σ_t Gᵀ, by finite differences
    of the curve of peak 1. With what no patch has seen the sources add up to the band, channel by channel."""
    arguments = declared(shots)
    (given, _), answer = observed(**arguments), recovered(**arguments, basis="cameras", gamma=0.0)
    shares, rows = explain(given), dense_model(given, read_basis("cameras"))
    A, sigma = rows.A, rows.sigma
    spread = np.eye(72) - A.T @ np.linalg.solve(sigma + A @ A.T, A)
    assert answer.code_covariance.shape == (72, 72)
    assert answer.code_covariance == pytest.approx(spread, abs=1e-10)
    deviation = np.sqrt(np.diag(spread))
    between = (spread / np.outer(deviation, deviation))[:24, 24:48]
    assert np.abs(between).max() > 0.09  # one chart, one white, one lamp: what is wrong with red is with green
    slopes = slopes_of_peak_one(answer.code.T.ravel(), arguments["lamp"][0])
    std = answer.peak()[1]
    own = np.sqrt(np.einsum("cmx,xz,cmz->cm", slopes, spread, slopes))
    assert pytest.approx(np.hypot(own, missed().T), abs=1e-7) == std.T
    band, gain = np.sum(std**2, axis=0), spread @ A.T @ np.linalg.inv(sigma)
    assert set(shares) == {"noise", "chart", "white", "lamp", "lamp modes", "uneven light", "unseen"}
    for source, term in rows.terms.items():
        part = np.einsum("cmx,xz,cmz->c", slopes, gain @ term @ gain.T, slopes)
        assert shares[source] * band == pytest.approx(part, rel=1e-5, abs=1e-9 * band.max())
    left = np.eye(72) - gain @ A
    unseen = np.einsum("cmx,xz,cmz->c", slopes, left @ left.T, slopes) + np.sum(missed() ** 2, axis=0)
    assert shares["unseen"] * band == pytest.approx(unseen, rel=1e-5)
    assert sum(shares.values()) == pytest.approx(np.ones(3))


@pytest.mark.parametrize("shots", [1, 2])
def test_prediction_bands_are_those_of_their_model(shots: int) -> None:
    """GUM Supplement 1: draw code, errors and noise from the rows' own model, fit, compare."""
    arguments, book = declared(shots), read_basis("cameras")
    others = chart_and_lamp("D55", slice(0, 24))[0][1::2]
    answer = recovered(**arguments)
    found = predict(answer, observed(**arguments)[0], of=others, of_tolerance=0.02)
    assert found.values[:, :12] == pytest.approx(answer.predicted, rel=1e-9)
    k, n = shots, 24
    y = np.concatenate([arguments["signals"], found.values[:, 12:]], axis=1)
    error = np.concatenate([arguments["standard_error"], np.full((k, 12, 3), 1e3)], axis=1)
    more = {"signals": y, "standard_error": error, "chart_tolerance": np.repeat([0.03, 0.02], 12)}
    more["reflectance"] = np.concatenate([arguments["reflectance"], others])
    (observation, _) = observed(**(arguments | more))
    rows = dense_model(observation, book)
    fitted = np.tile(np.arange(n) < 12, 3 * k)
    rng = np.random.default_rng(4)
    A, sigma, noise = rows.A, rows.sigma, np.diag(rows.terms["noise"])
    errors = sum(term for source, term in rows.terms.items() if source != "noise")
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


@pytest.mark.full
def test_lamps_far_off_leave_the_bands_honest() -> None:
    """Cameras of the prior, LEDs drawn from their family's own modes: 95 % bands hold, and the LED helps a little."""
    basis, led = read_basis("cameras"), read_lamp("white-led")
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    modes = np.stack([0 * led.modes, led.modes])
    rng = np.random.default_rng(11)
    held, wrong = [], []
    while len(held) < 60:
        camera = (basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, rng.normal(size=(3, 24)))).T
        light = led.values * (1 + rng.normal(size=len(led.modes)) @ led.modes)
        if camera.min() < -0.15 * camera.max() or light.min() < 0:
            continue  # no camera, no lamp
        y = np.stack([theory(reflectance, lamp, camera) for lamp in (day, light)])
        error = np.hypot(0.005 * y, 0.001)
        y = y + error * rng.normal(size=y.shape)
        truth = camera / camera.max(axis=0)
        errors = []
        for k in (1, 2):
            answer = recovered(
                y[:k], reflectance, np.stack([day, led.values])[:k], standard_error=error[:k], chart_tolerance=0.0,
                white_tolerance=0.0, lamp_modes=modes[:k], basis=basis, engine="reference",
            )  # fmt: skip
            got, std = answer.peak()
            errors.append(np.sqrt(np.mean((got - truth)[40:641] ** 2)))
        held.append(np.mean(np.abs(got - truth)[40:641] <= 1.96 * std[40:641]))
        wrong.append(errors)
    assert 0.92 <= np.mean(held) <= 0.98
    alone, pair = np.mean(wrong, axis=0)
    assert pair < alone
