"""The linear model of `camssf.recovery` against the one of `tests.support.dense_model`, which another hand wrote."""

from typing import Any

import numpy as np
import pytest

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import NODES, read_basis
from camssf.recovery.covariance import CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION, smooth_errors
from camssf.recovery.evidence import log_evidences
from camssf.recovery.hypotheses import recover
from camssf.recovery.linear_rows import linear_rows
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import read_chart, read_lamp
from golden.compare import norm
from tests.support.dense_model import dense_model
from tests.support.problems import seeds

pytestmark = pytest.mark.requirement("R-OPTIMUM")

BASES = ("phones", "cameras", "ryyb")
LAMPS = ("D55", "A", "FL2", "D65", "FL11")


def smooth(rng: np.random.Generator, q: int, size: float) -> Floats:
    """q smooth functions of wavelength, (q, 681)."""
    x = np.linspace(-1.0, 1.0, WAVELENGTHS.size)
    waves = [[rng.normal() * np.cos(np.pi * j * (x + rng.random())) for j in range(4)] for _ in range(q)]
    return np.asarray(size * np.sum(waves, axis=1))


def random_captures(seed: int, *, h: int = 1) -> list[Observation]:
    """One capture under h hypotheses on its lamps: 1 to 4 shots; lamp modes, gain modes and a mask, each in half."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 5))
    modes, gains, masked = rng.random(3) < 0.5
    basis = read_basis(BASES[seed % 3])
    code = 0.8 * rng.normal(size=(3, basis.dictionary.shape[2]))
    camera = basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code)
    every = np.stack([read_lamp(name).values for name in LAMPS])
    lamps = [every[rng.integers(0, len(LAMPS), k)] for _ in range(h)]
    q, g = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    none: dict[str, Any] = {}
    gain_modes = 0.02 * rng.normal(size=(k, g, 24))
    rho = 0.9 + 0.02 * np.sin(WAVELENGTHS / 80.0)
    chart = read_chart("classic24").values
    y = ((lamps[0][:, None] * chart) @ camera.T) / ((lamps[0] * rho) @ camera.T)[:, None]
    y = y * (1.0 + 0.004 * rng.normal(size=y.shape))
    if gains:
        y = y * (1.0 + (rng.normal(size=(k, 1, g)) @ gain_modes)[:, 0][..., None])
        none |= {"gain_modes": gain_modes, "gain_own": 0.2}
    error = 0.003 * (1.0 + rng.random(y.shape)) * np.maximum(y, 0.02)
    used = rng.random((k, 24)) > 0.15 if masked else None
    return [
        Observation(
            y, chart, lamp, standard_error=error, used=used, chart_tolerance=np.array(0.03), white_reflectance=rho,
            lamp_tolerance=np.full(k, 0.02 + 0.01 * rng.random()),
            lamp_modes=np.stack([smooth(rng, q, 0.08) for _ in range(k)]) if modes else np.zeros((0, 681)), **none,
        )
        for lamp in lamps
    ]  # fmt: skip


@pytest.mark.parametrize("seed", seeds(12))
def test_public_rows_are_those_that_are_solved(seed: int) -> None:
    """A, b and Σ of the other hand, by patch, channel and shot; their posterior mean is the curve of `recover`.

    Σ's masked rows lie at 1e6.
    """
    (observation,) = random_captures(seed)
    name = BASES[seed % 3]
    known, found = dense_model(observation, read_basis(name)), linear_rows(observation, basis=name)
    k, n, _ = observation.signals.shape
    order = np.moveaxis(np.arange(3 * k * n).reshape(n, 3, k), 0, -1).ravel()
    sigma, used = found.covariance[order][:, order], known.sigma.diagonal() < 1.0
    assert norm(found.A[order], known.A) <= 1e-12
    assert norm(found.b[order], known.b) <= 1e-11
    assert norm(sigma, known.sigma) <= 1e-12
    assert norm(sigma[used][:, used], known.sigma[used][:, used]) <= 1e-11
    weighted = np.linalg.solve(found.covariance, found.A)
    code = np.linalg.solve(found.A.T @ weighted + np.eye(found.A.shape[1]), weighted.T @ found.b)
    ssf = recover(observation, basis=name, settings=SolverSettings(gamma=0.0))
    assert np.abs(found.curves(code) - ssf.peak()[0]).max() <= 1e-7


@pytest.mark.parametrize("length", [CHART_CORRELATION, LAMP_CORRELATION, TABLE_CORRELATION])
def test_smooth_errors_have_their_kernel(length: float) -> None:
    """exp(-½ (Δλ / ℓ)²), which points ℓ / 2 apart make."""
    factor, kernel = smooth_errors(length), np.exp(-0.5 * ((NODES[:, None] - NODES) / length) ** 2)
    assert norm(factor @ factor.T, kernel) <= 2e-3


def test_public_rows_need_a_prior_and_a_code_of_their_size() -> None:
    (observation,) = random_captures(0)
    with pytest.raises(InvalidArgument, match="no prior"):
        linear_rows(observation, basis="gaussian")
    with pytest.raises(InvalidArgument, match="code"):
        linear_rows(observation, basis="phones").curves(np.zeros(5))


@pytest.mark.parametrize("seed", seeds(12))
def test_evidence_of_a_stack_of_hypotheses(seed: int) -> None:
    observations = random_captures(seed, h=4)
    basis = read_basis(BASES[seed % 3])
    known = np.array([dense_model(observation, basis).log_evidence for observation in observations])
    assert log_evidences(observations, basis) == pytest.approx(known, rel=1e-10)
