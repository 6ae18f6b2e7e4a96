"""The rivals in their limits: exact where the problem is, by hand where a formula is, by another solver elsewhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.paper import rivals
from benchmarks.paper.rivals import FIGURE_4, OURS, TABLE_1, Given, bends, between, method, pinv, qr
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import NODES, gaussian_basis, read_basis
from camssf.spectra import read_chart, read_lamp

ALL = (*TABLE_1, *OURS, *FIGURE_4)


def bells(centres: tuple[float, float, float], width: float = 30.0) -> Floats:
    """(69, 3) on the nodes."""
    return np.exp(-0.5 * ((NODES[:, None] - np.array(centres)) / width) ** 2)


TRAINING = np.stack(
    [
        bells((600.0 + a, 535.0 + b, 460.0 + a), 28.0 + c)
        for a in (-9.0, 0.0, 8.0)
        for b in (-6.0, 5.0)
        for c in (0.0, 6.0)
    ]
)
TRUTH = between() @ bells((598.0, 537.0, 458.0))


def capture(truth: Floats, reflectance: Floats, noise: float = 0.0, lamp: str = "D55") -> Given:
    light = read_lamp(lamp).values
    y = (reflectance * light) @ truth / (light @ truth)
    error = np.full(y.shape, noise)
    y = y + noise * np.random.default_rng(3).normal(size=y.shape)
    return Given(y, error, reflectance, light, TRAINING, read_basis("cameras"))


def hats() -> Floats:
    """(69, 681) one narrow reflectance a node: with them every curve on the nodes is determined."""
    return between().T


def off(found: Floats, truth: Floats) -> float:
    """Largest difference of curves of peak 1."""
    return float(np.abs(found / found.max(axis=0) - truth / truth.max(axis=0)).max())


def test_every_file_is_a_method_and_every_method_a_file() -> None:
    files = {path.stem for path in Path(rivals.__file__).parent.glob("*.py")} - {"__init__"}
    assert files == set(ALL)
    names = [method(name).NAME for name in ALL]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", ALL)
def test_every_method_answers_a_real_capture(name: str) -> None:
    given = capture(TRUTH, read_chart("classic24").values, 0.003)
    one = method(name)
    for weight in (one.WEIGHTS[0], one.WEIGHTS[-1]):
        found = one.estimate(given, weight)
        assert found.shape == (681, 3)
        assert np.isfinite(found).all()


def test_the_rows_are_equation_8() -> None:
    given = capture(TRUTH, read_chart("classic24").values)
    white = given.lamp / (given.lamp.sum() * STEP)
    scaled = TRUTH / (white @ TRUTH * STEP)
    assert given.rows() @ scaled == pytest.approx(given.signals, rel=1e-12)
    nodes = TRUTH[::10] / (white @ TRUTH * STEP)
    assert given.node_rows() @ nodes == pytest.approx(given.signals, rel=1e-12)
    assert (given.scale() == 1e-4).all()


def test_bends_vanish_on_a_line_and_count_a_parabola() -> None:
    x = np.arange(69.0)
    assert bends() @ (2.0 + 3.0 * x) == pytest.approx(np.zeros(67), abs=1e-10)
    assert bends() @ (x / 4.0) ** 2 == pytest.approx(np.full(67, 2.0))


@pytest.mark.parametrize("name", ["quadratic", "tikhonov"])
def test_smooth_methods_are_exact_where_all_is_determined(name: str) -> None:
    assert off(method(name).estimate(capture(TRUTH, hats()), 1e-7), TRUTH) < 1e-6


@pytest.mark.parametrize("name", ["quadratic", "tikhonov"])
def test_an_infinite_weight_leaves_a_straight_line(name: str) -> None:
    found = method(name).estimate(capture(TRUTH, read_chart("classic24").values), 1e6)
    assert np.abs(np.diff(found[::10], 2, axis=0)).max() < 1e-6 * np.abs(found).max()


def test_tikhonov_is_its_closed_form() -> None:
    given = capture(TRUTH, read_chart("classic24").values, 0.01)
    F, D, w = given.node_rows() / 0.01, bends(), 2.0
    nodes = np.linalg.solve(F.T @ F + w**2 * D.T @ D, F.T @ given.signals / 0.01)
    assert method("tikhonov").estimate(given, w)[::10] == pytest.approx(nodes, rel=1e-6, abs=1e-8)


@pytest.mark.full
def test_the_quadratic_programme_is_solved() -> None:
    """Against Clarabel, and by its optimality conditions."""
    cp = pytest.importorskip("cvxpy")
    given = capture(TRUTH, read_chart("classic24").values, 0.005)
    found = method("quadratic").estimate(given, 0.3)[::10]
    assert found.min() >= 0.0
    F = given.node_rows() / 0.005
    for c in range(3):
        y = given.signals[:, c] / 0.005
        gradient = F.T @ (F @ found[:, c] - y) + 0.09 * bends().T @ (bends() @ found[:, c])
        scale = np.abs(F.T @ y).max()
        assert gradient.min() > -1e-8 * scale
        assert np.abs(gradient[found[:, c] > 0]).max() < 1e-8 * scale
        s = cp.Variable(69, nonneg=True)
        objective = 0.5 * cp.sum_squares(F @ s - y) + 0.045 * cp.sum_squares(bends() @ s)
        best = cp.Problem(cp.Minimize(objective)).solve(solver=cp.CLARABEL)
        ours = 0.5 * np.sum((F @ found[:, c] - y) ** 2) + 0.045 * np.sum((bends() @ found[:, c]) ** 2)
        assert ours == pytest.approx(best, rel=1e-5)


def test_the_subspace_is_exact_for_a_camera_in_it() -> None:
    """Three training cameras span three dimensions; a mixture of them is one of their kind."""
    training = TRAINING[[0, 5, 11]]
    nodes = np.einsum("k,kmc->mc", [0.5, 0.2, 0.3], training)
    given = replace(capture(between() @ nodes, read_chart("classic24").values), training=training)
    assert off(method("subspace").estimate(given, 3.0), between() @ nodes) < 1e-7
    assert off(method("subspace").estimate(given, 1.0), between() @ nodes) > 1e-3


def test_wiener_gives_the_only_camera_it_knows_and_trusts_noise_as_told() -> None:
    given = capture(TRUTH, read_chart("classic24").values, 0.01)
    alone = replace(given, training=TRAINING[:1])
    assert off(method("wiener").estimate(alone, 1.0), between() @ TRAINING[0]) < 1e-9
    # The same estimate as a penalised fit: min ‖(F s - y) / σ‖² + sᵀ K⁻¹ s on the span of the cameras.
    F, white = given.node_rows(), (given.lamp / given.lamp.sum()) @ between()
    for c in range(3):
        cameras = TRAINING[:, :, c] / (TRAINING[:, :, c] @ white)[:, None]
        B = cameras.T / np.sqrt(len(cameras))
        x = np.linalg.solve(
            B.T @ F.T @ F @ B / 0.01**2 + np.eye(B.shape[1]), B.T @ F.T @ given.signals[:, c] / 0.01**2
        )
        assert method("wiener").estimate(given, 1.0)[::10, c] == pytest.approx(B @ x, rel=1e-6, abs=1e-9)


def test_ranks_keep_the_order_and_know_nothing_else() -> None:
    given = capture(TRUTH, read_chart("classic24").values)
    found = method("ranks").estimate(given, 0.05)
    assert found.min() >= 0.0
    order = np.argsort(given.signals, axis=0)
    seen = np.take_along_axis(given.rows() @ found, order, axis=0)
    assert np.diff(seen, axis=0).min() > -1e-4 * seen.max()
    # Any rising curve laid over the signals, as a picture's tone curve, changes nothing.
    bent = replace(given, signals=given.signals**0.45)
    assert method("ranks").estimate(bent, 0.05) == pytest.approx(found, rel=1e-9, abs=1e-12)


def test_a_gaussian_camera_is_found_by_a_gaussian() -> None:
    truth = np.exp(
        -0.5 * ((WAVELENGTHS[:, None] - np.array([607.0, 541.0, 452.0])) / np.array([24.0, 38.0, 21.0])) ** 2
    )
    assert off(method("gaussians").estimate(capture(truth, read_chart("classic24").values), 1.0), truth) < 1e-5


def test_the_slopes_of_the_gaussians_are_their_derivatives() -> None:
    from benchmarks.paper.rivals import gaussians

    p = np.array([0.9, 560.0, 30.0, 0.3, 450.0, 20.0])
    slopes = gaussians._slopes(p)
    for i, step in enumerate((1e-5, 1e-3, 1e-3) * 2):
        up, down = p.copy(), p.copy()
        up[i] += step
        down[i] -= step
        numeric = (gaussians._curve(up) - gaussians._curve(down)) / (2 * step)
        assert slopes[:, i] == pytest.approx(numeric, rel=1e-5, abs=1e-8)


def test_the_basic_solution_is_basic_and_solves() -> None:
    rng = np.random.default_rng(0)
    rows, y = rng.normal(size=(5, 40)), rng.normal(size=5)
    x = qr.basic(rows, y)
    assert np.count_nonzero(x) == 5
    assert rows @ x == pytest.approx(y, rel=1e-10)


@pytest.mark.parametrize("name", FIGURE_4)
@pytest.mark.parametrize("reading", [2.0, 3.0])
def test_gaussians_come_back_where_all_is_determined(name: str, reading: float) -> None:
    """More patches than Gaussians, no noise, a truth of non-negative Gaussians."""
    atoms = gaussian_basis().dictionary[0]
    truth = atoms[:, [12, 8, 4]] + 0.5 * atoms[:, [13, 9, 5]]
    assert off(method(name).estimate(capture(truth, hats()), reading), truth) < 1e-3


def test_the_pseudo_inverse_is_the_smallest_solution() -> None:
    given = capture(TRUTH, read_chart("classic24").values[6:18])
    smallest = np.linalg.lstsq(given.rows(), given.signals, rcond=None)[0]
    assert pinv.estimate(given, 0.0) == pytest.approx(np.maximum(smallest, 0.0), rel=1e-5, abs=1e-7)


@pytest.mark.full
def test_the_smallest_non_negative_solution() -> None:
    """Against Clarabel: min ‖s‖ under F s = y, s ≥ 0; on ten patches, whose equations it can meet."""
    cp = pytest.importorskip("cvxpy")
    given = capture(TRUTH, read_chart("classic24").values[6:12])
    found = pinv.estimate(given, 1.0)
    assert found.min() >= 0.0
    assert given.rows() @ found == pytest.approx(given.signals, rel=2e-4)
    s = cp.Variable(681, nonneg=True)
    exact = cp.Problem(cp.Minimize(cp.sum_squares(s)), [given.rows() @ s == given.signals[:, 1]])
    exact.solve(solver=cp.CLARABEL)
    assert np.linalg.norm(found[:, 1]) == pytest.approx(np.linalg.norm(s.value), rel=0.01)


def test_non_negative_least_squares_is_never_clipped() -> None:
    given = capture(TRUTH, read_chart("classic24").values[6:18], 0.005)
    for name in FIGURE_4:
        for reading in (1.0, 3.0):
            found = method(name).estimate(given, reading)
            assert found.min() >= 0.0
            clipped = method(name).estimate(given, reading - 1.0)
            assert np.linalg.norm(given.rows() @ found - given.signals) < np.linalg.norm(
                given.rows() @ clipped - given.signals
            )


def test_the_paper_and_the_tuned_one_solve_the_same_problem() -> None:
    """A truth of the dictionary, almost no noise: both are near it, whatever chose γ."""
    atoms = gaussian_basis().dictionary[0]
    truth = atoms[:, [12, 8, 4]]
    given = capture(truth, hats(), 1e-4)
    assert off(method("paper").estimate(given, 0.0), truth) < 0.02
    assert off(method("tuned").estimate(given, 1.0), truth) < 0.02
