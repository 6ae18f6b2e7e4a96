"""Problems shared by the solver's tests: measured-camera-like signals and random matrices, all seeded."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery import Observation, Ssf, arrays, recover
from camssf.recovery import duality_gap as gaps
from camssf.recovery.basis import read_basis
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.inputs import observation_arrays
from camssf.recovery.pivoting import pivot_to_optimum
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import read_chart, read_lamp
from golden.linear_model import LinearModel

CURVES = Path(__file__).parents[2] / "data" / "ssf" / "rawtoaces.csv"


def seeds(*bounds: int, quick: int = 3) -> list[Any]:
    """`range` for a parametrised test: so many of it by default, all in the full run."""
    every = range(*bounds)
    return [*every[:quick], *(pytest.param(seed, marks=pytest.mark.full) for seed in every[quick:])]


def near(found: NDArray[Any], expected: NDArray[Any], rel: float = 0.0, abs: float = 1e-12) -> bool:
    """`found == pytest.approx(expected, ...)` of large arrays, without a Python loop."""
    assert found.shape == expected.shape
    return bool(np.all(np.abs(found - expected) <= np.maximum(rel * np.abs(expected), abs)))


def bell(centre: float, width: float) -> Floats:
    return np.exp(-0.5 * ((WAVELENGTHS - centre) / width) ** 2)


def toy_camera(shift: float = 0.0) -> Floats:
    """Smooth curves that no basis here was learned from, (681, 3)."""
    red = bell(600 + shift, 32) + 0.08 * bell(440 + shift, 25)
    green = bell(532 + shift, 38)
    blue = bell(458 + shift, 27) + 0.03 * bell(540, 30)
    return np.stack([red, green, blue], axis=1)


def theory(reflectance: Floats, lamp: Floats, camera: Floats, white: Floats | float = 1.0) -> Floats:
    """Eq. (5) by its integrals, (n, 3)."""
    return ((reflectance * lamp) @ camera) / ((white * lamp) @ camera)


def chart_and_lamp(lamp: str = "D55", patches: slice = slice(6, 18)) -> tuple[Floats, Floats]:
    return read_chart("classic24").values[patches], read_lamp(lamp).values


def measured_cameras() -> dict[str, Floats]:
    """The 52 cameras on the grid; skips where the data is not there."""
    from camssf.recovery.basis import interpolate
    from camssf_lab.learning.training import read_curves

    return {name: interpolate(curves) for name, curves in read_curves(CURVES).items()}


def random_sensing(seed: int, rows: int, atoms: int) -> LinearModel:
    """Three random problems with smooth, correlated columns and a full covariance."""
    rng = np.random.default_rng(seed)
    mixing = np.exp(-0.5 * ((np.arange(atoms)[:, None] - np.arange(atoms)) / 1.5) ** 2)
    matrix = rng.normal(size=(3, rows, atoms)) @ mixing
    target = np.einsum("crn,cn->cr", matrix, rng.normal(size=(3, atoms)) * (rng.random((3, atoms)) < 0.4))
    target += 0.1 * rng.normal(size=target.shape)
    factor = 0.5 * rng.normal(size=(3, rows, 3))
    return LinearModel(matrix, target, np.eye(rows) + factor @ factor.transpose(0, 2, 1))


def whiten(A: Floats, b: Floats, sigma: Floats) -> tuple[Floats, Floats]:
    """L⁻¹ A (N, r) and L⁻¹ b (N,) of one problem."""
    rows, _ = arrays.whiten(sigma, np.column_stack([A, b]))
    return rows[:, :-1], rows[:, -1]


def walked(problem: ElasticNet, z: Floats) -> tuple[Floats, float]:
    """The optimum (r,) of one problem by the walk from z, whatever the gap of z, and the number of pivots."""
    column = replace(problem, b=problem.b[:, None])
    x, _, taken = pivot_to_optimum(column, z[:, None], np.full((1, 1), np.inf))
    return x[:, 0], float(taken[0, 0])


def duality_gap(problem: ElasticNet, x: Floats) -> tuple[float, float]:
    """Objective and relative duality gap of x (r,), of one problem."""
    objective, gap = gaps.duality_gap(replace(problem, b=problem.b[:, None]), x[:, None])
    return float(objective[0, 0]), float(gap[0, 0])


def model_inputs(observation: Observation, basis: str) -> dict[str, Floats]:
    """The inputs of a shipped model for it, with the usual penalties."""
    y = observation.signals
    settings = {"l2": 1.0, "gamma": 0.05, "nonnegative": 0.0, "prior_scale": 1.0, "explain": 0.0}
    given = observation_arrays(observation, read_basis(basis))
    given |= {name: np.array(value) for name, value in settings.items()}
    return given | {"chart": y, "white": np.ones_like(y), "dark": np.zeros_like(y)}


def observed(*positional: Any, **named: Any) -> tuple[Observation, dict[str, Any]]:
    """Hypotheses from the arguments that are its own, and the rest."""
    fields = Observation.__dataclass_fields__
    observation = Observation(*positional, **{name: value for name, value in named.items() if name in fields})
    return observation, {name: value for name, value in named.items() if name not in fields}


def recovered(*positional: Any, **named: Any) -> Ssf:
    """`recover` of signals, reflectance, lamp and the rest by name."""
    evidence, rest = observed(*positional, **named)
    settings = SolverSettings(
        **{name: rest.pop(name) for name in SolverSettings.__dataclass_fields__ if name in rest}
    )
    return recover(evidence, **rest, settings=settings)
