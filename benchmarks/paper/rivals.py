"""Other ways from patches to curves, each a function `(given, weight)` that returns curves (681, 3) of any scale.

A method's weights are the values that its one free number may take; the bench chooses among them on the cameras of
other makers, whose truth it may look at. A method without one has (0.0,).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from scipy.linalg import lstsq, solve_triangular
from scipy.linalg import pinv as pseudo_inverse
from scipy.linalg import qr as pivoted
from scipy.optimize import nnls

from camssf.grid import STEP, Floats
from camssf.recovery.basis import NODES, Basis, gaussian_basis, interpolate
from camssf.recovery.covariance import FLOOR
from camssf.recovery.hypotheses import recover
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import colour_science

TABLE_1 = ("quadratic", "tikhonov", "subspace", "wiener")
"""Of the families of the paper's Table 1 those that are linear or convex."""
OURS = ("paper", "tuned", "product")
FIGURE_4 = ("qr", "pinv")
NO_WEIGHT = (0.0,)
SMOOTHNESS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)


@dataclass(frozen=True)
class Given:
    """What every method is told.

    Attributes:
        signals: (n, 3) of Eq. (5).
        standard_error: (n, 3) of the signals; 0 without noise.
        reflectance: (n, 681).
        lamp: (681,) as the method believes it to be.
        training: (cameras, 69, 3) on the 5-nm nodes, peak 1; no camera of this maker among them.
        basis: learned from the same cameras.
    """

    signals: Floats
    standard_error: Floats
    reflectance: Floats
    lamp: Floats
    training: Floats
    basis: Basis

    def rows(self) -> Floats:
        """F (n, 681) of the paper's Eq. (8): R L dλ, with Σ L dλ = 1, so that F s = y."""
        return self.reflectance * self.lamp * STEP / (self.lamp.sum() * STEP)

    def node_rows(self) -> Floats:
        """The same for a curve that runs straight between the 5-nm nodes, (n, 69)."""
        return self.rows() @ between()

    def channels(self) -> list[tuple[Floats, Floats]]:
        """For each channel its signals (n,), and what they and their rows are divided by for a noise of 1."""
        scale = np.maximum(self.standard_error, FLOOR)
        return list(zip(self.signals.T, scale.T, strict=True))

    def solved(self, basis: Basis | str, **settings: Any) -> Floats:
        """By camssf's own solver; no error is declared but the noise."""
        observation = Observation(
            self.signals, self.reflectance, self.lamp, standard_error=self.standard_error, chart_tolerance=0.0,
            white_tolerance=0.0,
        )  # fmt: skip
        return recover(observation, basis=basis, settings=SolverSettings(**settings)).values


Estimate: TypeAlias = Callable[[Given, float], Floats]


@dataclass(frozen=True)
class Method:
    """A rival: its label in the tables, the values of its free number, and itself."""

    label: str
    weights: tuple[float, ...]
    estimate: Estimate


_METHODS: dict[str, Method] = {}


def _rival(label: str, weights: tuple[float, ...]) -> Callable[[Estimate], Estimate]:
    def listed(estimate: Estimate) -> Estimate:
        _METHODS[estimate.__name__] = Method(label, weights, estimate)
        return estimate

    return listed


def method(name: str) -> Method:
    """The method of that name."""
    return _METHODS[name]


@cache
def between() -> Floats:
    """(681, 69) from nodes to the grid, straight lines."""
    return interpolate(np.eye(NODES.size))


@cache
def bends() -> Floats:
    """(67, 69) second differences of a curve on its nodes, times 16: of the bend over 20 nm."""
    return np.asarray(16.0 * np.diff(np.eye(NODES.size), 2, axis=0))


@_rival("l1 on Gaussians (the paper)", NO_WEIGHT)
def paper(given: Given, weight: float) -> Floats:
    """The paper: l1 on Gaussians, x ≥ 0, γ by the discrepancy principle (its Eq. (9))."""
    return given.solved("gaussian")


@_rival("l1 on Gaussians, γ tuned", (1.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0))
def tuned(given: Given, weight: float) -> Floats:
    """The same with the γ that is best on the other makers' cameras: more than the paper asks for."""
    return given.solved("gaussian", gamma=weight)


@_rival("elastic net on cameras (camssf)", NO_WEIGHT)
def product(given: Given, weight: float) -> Floats:
    """camssf's default: the elastic net on the learned basis, λ₂ = 1, γ = 0.05."""
    return given.solved(given.basis, engine="reference")


@_rival("Tikhonov, second differences", SMOOTHNESS)
def tikhonov(given: Given, weight: float) -> Floats:
    """Least squares with a penalty on second differences, in closed form; the curve may be negative."""
    return _smooth(given, weight, lambda rows, y: lstsq(rows, y)[0])


@_rival("quadratic programme, smooth and non-negative", SMOOTHNESS)
def quadratic(given: Given, weight: float) -> Floats:
    """The smoothest non-negative curve that explains the signals.

    min ½ ‖(F s - y) / σ‖² + ½ w² ‖D² s‖² over s ≥ 0 on the 5-nm nodes. Without other constraints this program is a
    non-negative least-squares problem, which SciPy solves exactly (Lawson and Hanson 1974).
    """
    return _smooth(given, weight, lambda rows, y: nnls(rows, y)[0])


def _smooth(given: Given, weight: float, solve: Callable[[Floats, Floats], Floats]) -> Floats:
    rows, penalty = given.node_rows(), weight * bends()
    nodes = [
        solve(np.vstack([rows / sigma[:, None], penalty]), np.concatenate([y / sigma, np.zeros(len(penalty))]))
        for y, sigma in given.channels()
    ]
    return between() @ np.stack(nodes, axis=1)


@_rival("PCA subspace (Jiang 2013, colour-science)", (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0))
def subspace(given: Given, weight: float) -> Floats:
    """PCA subspace of measured cameras, least squares in it: Jiang et al. (2013) as colour-science has it.

    The free number is how many eigenvectors are kept. The library knows no noise, so rows count alike.
    """
    colour = colour_science()
    eigenvectors = _eigenvectors(given.training.tobytes(), len(given.training))
    # On nodes the product of reflectance and lamp is what a curve straight between them is weighed by.
    rows = given.node_rows() / (5.0 / STEP)
    lamp = colour.SpectralDistribution(np.ones(NODES.size), NODES)
    patches = colour.MultiSpectralDistributions(rows.T, NODES, [str(i) for i in range(len(rows))])
    shape = colour.SpectralShape(NODES[0], NODES[-1], 5)
    solve = colour.recovery.RGB_to_sd_camera_sensitivity_Jiang2013
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # colour-science announces alignments that do not happen
        found = [
            solve(y, lamp, patches, vectors[:, : int(weight)], shape).values
            for y, vectors in zip(given.signals.T, eigenvectors, strict=True)
        ]
    return between() @ np.stack(found, axis=1)


@cache
def _eigenvectors(training: bytes, count: int) -> Any:
    """Of R, G, B, (69, 69) each; they take longer than the fit, so each training set's are kept."""
    colour = colour_science()
    curves = np.frombuffer(training).reshape(count, NODES.size, 3)
    cameras = {
        str(i): colour.characterisation.RGB_CameraSensitivities(curve, NODES, labels=["red", "green", "blue"])
        for i, curve in enumerate(curves)
    }
    return colour.recovery.PCA_Jiang2013(cameras, NODES.size)


@_rival("Wiener", (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0))
def wiener(given: Given, weight: float) -> Floats:
    """The linear estimate of least mean square error for cameras like the measured ones.

    s = K Fᵀ (F K Fᵀ + w² σ²)⁻¹ y with K the second moments of the other makers' cameras, scaled to white as the
    signals are (Pratt and Mancill 1976). w = 1 trusts the noise as measured; with few cameras more may serve better.
    """
    rows = given.node_rows()
    white = (given.lamp / given.lamp.sum()) @ between()
    found = []
    for c, (y, sigma) in enumerate(given.channels()):
        cameras = given.training[:, :, c] / (given.training[:, :, c] @ white)[:, None]
        moments = cameras.T @ cameras / len(cameras)
        seen = rows @ moments
        found.append(seen.T @ np.linalg.solve(seen @ rows.T + np.diag((weight * sigma) ** 2), y))
    return between() @ np.stack(found, axis=1)


READINGS = ("wavelengths, clipped", "wavelengths, NNLS", "Gaussians, clipped", "Gaussians, NNLS")
"""How the paper makes the comparisons of its Fig. 4 non-negative it does not say, nor whether the unknowns are
wavelengths or Gaussians: the free number is which reading."""


@_rival("QR with non-negativity", (0.0, 1.0, 2.0, 3.0))
def qr(given: Given, weight: float) -> Floats:
    r"""The basic solution of the underdetermined F s = y by QR with column pivoting (what MATLAB's `F \ y` gives).

    As many wavelengths as patches respond, all others are 0. NNLS works by active sets, each solved by QR: it gives a
    basic solution that never was negative.
    """

    def basic(rows: Floats, y: Floats) -> Floats:
        count = min(rows.shape)
        q, r, order = pivoted(rows, mode="economic", pivoting=True)
        x = np.zeros(rows.shape[1])
        x[order[:count]] = solve_triangular(r[:count, :count], (q.T @ y)[:count])
        return x

    atoms, rows, nonnegative = _reading(given, weight)
    solve = (lambda rows, y: nnls(rows, y)[0]) if nonnegative else basic
    return atoms @ np.maximum(np.stack([solve(rows, y) for y in given.signals.T], axis=1), 0.0)


RIDGE = 1e-6
"""Of the largest singular value: below what the signals can tell, above rounding."""


@_rival("pseudo-inverse with non-negativity", (0.0, 1.0, 2.0, 3.0))
def pinv(given: Given, weight: float) -> Floats:
    """s = F⁺ y, the smallest curve that gives the signals (Moore-Penrose).

    By NNLS it is the smallest among the non-negative ones, found as the limit of a vanishing ridge.
    """
    atoms, rows, nonnegative = _reading(given, weight)
    if not nonnegative:
        return np.asarray(atoms @ np.maximum(pseudo_inverse(rows) @ given.signals, 0.0))
    system = np.vstack([rows, RIDGE * np.linalg.norm(rows, 2) * np.eye(rows.shape[1])])
    targets = np.vstack([given.signals, np.zeros((rows.shape[1], 3))])
    return atoms @ np.stack([nnls(system, target, maxiter=20_000)[0] for target in targets.T], axis=1)


def _reading(given: Given, weight: float) -> tuple[Floats, Floats, bool]:
    """The unknowns' curves (681, r), the rows (n, r), and whether by NNLS, of one of READINGS."""
    reading = READINGS[int(weight)]
    atoms = gaussian_basis().dictionary[0] if reading.startswith("Gaussians") else np.eye(given.lamp.size)
    return atoms, given.rows() @ atoms, reading.endswith("NNLS")
