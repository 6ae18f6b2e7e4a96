"""The rivals in their limits: exact where the problem is, by hand where a formula is, by optimality elsewhere."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from benchmarks.paper.rivals import FIGURE_4, Given, bends, between, method
from camssf.grid import Floats
from camssf.recovery.basis import NODES, gaussian_basis, read_basis
from camssf.spectra import read_chart, read_lamp


def bells(centres: tuple[float, float, float], width: float = 30.0) -> Floats:
    """(69, 3) on the nodes."""
    return np.exp(-0.5 * ((NODES[:, None] - np.array(centres)) / width) ** 2)


CHANGES = product((-9.0, 0.0, 8.0), (-6.0, 5.0), (0.0, 6.0))
TRAINING = np.stack([bells((600.0 + a, 535.0 + b, 460.0 + a), 28.0 + c) for a, b, c in CHANGES])
TRUTH = between() @ bells((598.0, 537.0, 458.0))


def capture(truth: Floats, reflectance: Floats, noise: float = 0.0, lamp: str = "D55") -> Given:
    light = read_lamp(lamp).values
    y = (reflectance * light) @ truth / (light @ truth)
    error = np.full(y.shape, noise)
    y = y + noise * np.random.default_rng(3).normal(size=y.shape)
    return Given(y, error, reflectance, light, TRAINING, read_basis("cameras"))


def test_tikhonov_is_its_closed_form() -> None:
    given = capture(TRUTH, read_chart("classic24").values, 0.01)
    F, D, w = given.node_rows() / 0.01, bends(), 2.0
    nodes = np.linalg.solve(F.T @ F + w**2 * D.T @ D, F.T @ given.signals / 0.01)
    assert method("tikhonov").estimate(given, w)[::10] == pytest.approx(nodes, rel=1e-6, abs=1e-8)


def test_the_quadratic_programme_is_solved() -> None:
    """Its optimality conditions: no gradient where a curve is above 0, none below 0 where it is 0."""
    given = capture(TRUTH, read_chart("classic24").values, 0.005)
    found = method("quadratic").estimate(given, 0.3)[::10]
    assert found.min() >= 0.0
    F, y = given.node_rows() / 0.005, given.signals / 0.005
    gradient = F.T @ (F @ found - y) + 0.09 * bends().T @ (bends() @ found)
    scale = np.abs(F.T @ y).max(axis=0)
    assert (gradient > -1e-8 * scale).all()
    assert (np.abs(np.where(found > 0, gradient, 0.0)) < 1e-8 * scale).all()


@pytest.mark.parametrize("name", FIGURE_4)
@pytest.mark.parametrize("reading", [2.0, 3.0])
def test_gaussians_come_back_where_all_is_determined(name: str, reading: float) -> None:
    """A narrow patch at each node, no noise, a truth of non-negative Gaussians."""
    atoms = gaussian_basis().dictionary[0]
    truth = atoms[:, [12, 8, 4]] + 0.5 * atoms[:, [13, 9, 5]]
    found = method(name).estimate(capture(truth, between().T), reading)
    assert np.abs(found / found.max(axis=0) - truth / truth.max(axis=0)).max() < 1e-3
