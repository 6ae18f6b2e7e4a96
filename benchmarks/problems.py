"""Seeded problems, and the one duality gap that judges every solver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from benchmarks.shared import chart
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.capture import Photo
from camssf.photo.read.colour_matrix import ColourMatrix
from camssf.recovery.basis import Basis
from camssf.recovery.hypotheses import LampGuess, UnweighedHypothesis, choose
from camssf.recovery.layers import DEPTH, splitting
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import onnx_runtime
from camssf.recovery.pivoting import pivot_to_optimum
from camssf.recovery.rows import anchor
from camssf.recovery.sensitivity import Ssf
from camssf.spectra import read_lamp
from camssf.spectra.bundled import observer
from golden.linear_model import LinearModel, linear_model, whitened_problem

Long: TypeAlias = NDArray[np.longdouble]


MUNSELL = Path(__file__).parents[1] / "data" / "surfaces" / "vhrel_munsell.csv"
MATRIX_ERROR = 0.03
"""Relative error of a maker's colour matrices."""
WIEN = 1.438776877e7
"""Planck's second constant, nm K: ln L of a hot body falls by WIEN / (λ T)."""


@dataclass(frozen=True)
class Problem:
    """One call of a model: one convex problem of the three channels on a learned basis, three on the paper's.

    Attributes:
        inputs: of the model, as docs/architecture.md names them; l2, gamma and nonnegative included.
        basis: name of the shipped basis.
        label: what it is, in words.
    """

    inputs: dict[str, Floats]
    basis: str
    label: str

    @property
    def l2(self) -> float:
        """λ₂."""
        return float(self.inputs["l2"])

    @property
    def gamma(self) -> float:
        """γ, one for the three channels."""
        return float(self.inputs["gamma"])

    @property
    def nonnegative(self) -> bool:
        """Whether x ≥ 0."""
        return float(self.inputs["nonnegative"]) > 0.5

    def anchored(self, basis: Basis) -> Basis:
        """The basis in which the problem's codes are curves."""
        return anchor(basis, self.inputs["white_reflectance"] * self.inputs["lamp"][0])

    @property
    def evidence(self) -> Observation:
        """What the model is told, as the reference takes it."""
        given = self.inputs
        return Observation(
            (given["chart"] - given["dark"]) / (given["white"] - given["dark"]), given["reflectance"], given["lamp"],
            standard_error=given["standard_error"], chart_tolerance=given["chart_tolerance"],
            white_reflectance=given["white_reflectance"], white_tolerance=float(given["white_tolerance"]),
            lamp_tolerance=given["lamp_tolerance"], lamp_modes=given["lamp_modes"],
        )  # fmt: skip

    def sensing(self, basis: Basis) -> LinearModel:
        """The reference's rows and covariance."""
        return linear_model(self.evidence, basis)

    def penalties(self, linear: LinearModel) -> Floats:
        """(p,) γ of each of the convex problems."""
        return np.full(len(linear.matrix), self.gamma)


def reflectances(n: int, rng: np.random.Generator) -> Floats:
    """(n, 681): the chart's patches, drawn without replacement; beyond 24, convex blends of all of them."""
    if n <= 24:
        return chart() if n == 24 else chart()[np.sort(rng.choice(24, n, replace=False))]
    return np.concatenate([chart(), rng.dirichlet(np.full(24, 0.15), n - 24) @ chart()])


def temperature_mode(kelvin: float, off: float) -> Floats:
    """(681,) change of ln L of a hot body that is `off` K warmer: Wien's law, by its derivative."""
    return np.asarray(WIEN * off / kelvin**2 * (1.0 / WAVELENGTHS - 1.0 / 550.0))


def make_problem(
    basis: str, camera: Floats, lamps: Floats, seen: Floats, table: Floats, *, noise: float,
    rng: np.random.Generator, l2: float, gamma: float, nonnegative: bool, standard_error: Floats | None = None,
    chart_tolerance: float = 0.0, white_tolerance: float = 0.0, lamp_tolerance: float | Sequence[float] = 0.0,
    lamp_modes: Floats | None = None, light: Floats | None = None, white: Floats | None = None, label: str = "",
) -> Problem:  # fmt: skip
    """Raw means of a chart of reflectance `seen` (n, 681), to be solved with `table`; Eq. (5) by its integrals.

    The light that fell on it is `light` (k, 681) where it is not what the solver is told of the lamps.
    The noise is relative with a foot of 5 % of white: se = noise · hypot(y, 0.05). White frames differ in the
    channels' raw levels, dark ones lie at 64 DN.
    """
    k, n = len(lamps), len(seen)
    rho = np.ones_like(WAVELENGTHS) if white is None else white
    light = lamps if light is None else light
    y = ((light[:, None, :] * seen) @ camera) / ((light * rho) @ camera)[:, None, :]
    error = noise * np.hypot(y, 0.05)
    y = y + error * rng.normal(size=y.shape)
    dark = np.full(y.shape, 64.0)
    bright = dark + np.array([5000.0, 9000.0, 6500.0]) * rng.uniform(0.8, 1.2, (k, 1, 1)) * np.ones_like(y)
    inputs = {
        "chart": dark + y * (bright - dark),
        "white": bright,
        "dark": dark,
        "standard_error": error if standard_error is None else np.broadcast_to(standard_error, y.shape).copy(),
        "reflectance": table,
        "chart_tolerance": np.full(n, chart_tolerance),
        "white_reflectance": rho,
        "white_tolerance": np.array(white_tolerance),
        "lamp": lamps,
        "lamp_tolerance": np.broadcast_to(np.asarray(lamp_tolerance, float), k).copy(),
        "lamp_modes": np.zeros((k, 1, WAVELENGTHS.size)) if lamp_modes is None else lamp_modes,
        "gain_modes": np.zeros((k, 1, n)),
        "gain_own": np.array(0.0),
        "l2": np.array(float(l2)),
        "gamma": np.array(float(gamma)),
        "nonnegative": np.array(float(nonnegative)),
        "prior_scale": np.array(1.0),
        "explain": np.array(0.0),
    }
    return Problem(inputs, basis, label)


def whiten(linear: LinearModel) -> tuple[Floats, Floats]:
    """Σ^-½ A (p, N, r) and Σ^-½ b (p, N) by Cholesky: neither engine's inverse."""
    from scipy.linalg import solve_triangular

    rows, targets = [], []
    for A, b, sigma in zip(linear.matrix, linear.target, linear.covariance, strict=True):
        root = np.linalg.cholesky(sigma)
        rows.append(solve_triangular(root, A, lower=True))
        targets.append(solve_triangular(root, b, lower=True))
    return np.stack(rows), np.stack(targets)


def whiten_finely(linear: LinearModel) -> tuple[Long, Long]:
    """The same in long double, from the same float64 numbers: 11 bits more, so that rounding is the judged's alone.

    Gauss' elimination of (Σ | A | b), row by row; its pivot rows over the pivots' roots are L⁻¹ (A | b).
    """
    rows, targets = [], []
    for A, b, sigma in zip(linear.matrix, linear.target, linear.covariance, strict=True):
        system = np.column_stack([sigma, A, b]).astype(np.longdouble)
        for i in range(len(b)):
            system[i] /= np.sqrt(system[i, i])
            # Below row i, Σ's own column holds the multipliers; what has been eliminated is not touched again.
            column = system[i + 1 :, i] / system[i, i]
            system[i + 1 :, i + 1 :] -= column[:, None] * system[i, i + 1 :]
        rows.append(system[:, len(b) : -1])
        targets.append(system[:, -1])
    return np.stack(rows), np.stack(targets)


def gamma_max(A: Floats, b: Floats, nonnegative: bool) -> Floats:
    """(p,) the smallest γ that leaves the zero code, from whitened rows; of |Aᵀ b| where no γ > 0 leaves more."""
    pull = np.einsum("pnr,pn->pr", A, b)
    top = pull.max(axis=1)
    bound = np.abs(pull).max(axis=1)
    return np.asarray(np.where(top > 0, top, bound) if nonnegative else bound)


def relative_gap(A: Floats | Long, b: Floats | Long, x: Floats, l2: float, gamma: float, nonnegative: bool) -> float:
    """Relative duality gap of x from whitened rows (N, r), (N,), in their precision; γ > 0 or λ₂ > 0.

    The two gaps of `camssf.recovery.duality_gap`, written anew: with λ₂ > 0 the penalty's conjugate in its plain
    form, (|g| - γ)₊² / (2 λ₂), which cancels where the engine's does not. A code with a negative entry where x ≥ 0 is
    asked is judged after that entry is set to zero.
    """
    z = np.asarray(np.maximum(x, 0.0) if nonnegative else x, dtype=A.dtype)
    r = b - A @ z
    g = A.T @ r
    squares, size = r @ r, np.abs(z)
    objective = 0.5 * (squares + l2 * z @ z) + gamma * size.sum()
    if l2 > 0:
        over = np.maximum((g if nonnegative else np.abs(g)) - gamma, 0.0)
        gap = np.sum(0.5 * l2 * z**2 + gamma * size + over**2 / (2.0 * l2) - z * g)
    else:
        worst = np.max(g if nonnegative else np.abs(g), initial=0.0)
        alpha = min(1.0, gamma / worst) if worst > 0 else 1.0
        gap = 0.5 * (1.0 - alpha) ** 2 * squares + np.sum(size * (gamma - alpha * np.sign(z) * g))
    return float(max(gap, 0.0) / objective) if objective > 0 else 0.0


def gaps(A: Floats | Long, b: Floats | Long, x: Floats, problem: Problem) -> Floats:
    """(p,) of the codes x, three channels' (3, r) or as the problems have them."""
    given = zip(A, b, x.reshape(len(A), -1), strict=True)
    return np.array([relative_gap(*each, problem.l2, problem.gamma, problem.nonnegative) for each in given])


def forced(linear: LinearModel, problem: Problem) -> Floats:
    """(p, r) exact codes: the walk from the layers' answer, whether their own proof asks for it or not."""
    convex, _ = whitened_problem(linear, problem.l2, problem.penalties(linear), problem.nonnegative)
    z = splitting(convex).unroll(DEPTH)
    return np.asarray(pivot_to_optimum(convex, z, np.full((len(z), 1, 1), np.inf))[0][..., 0])


def curves(basis: Basis, code: Floats) -> Floats:
    """s = μ + Ψ x of codes (3, r), or (1, 3 r): (3, 681)."""
    return np.asarray(basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code.reshape(3, -1)))


def distance(s: Floats, other: Floats) -> Floats:
    """(3,) largest difference of curves (3, 681), each divided by its own value where `other` peaks."""
    at = np.abs(other).argmax(axis=1)[:, None]
    a, b = s / np.take_along_axis(s, at, 1), other / np.take_along_axis(other, at, 1)
    return np.asarray(np.abs(a - b).max(axis=1))


def open_model(content: bytes) -> Any:
    """An ONNX model as a session of one thread, its graph as it stands: what `camssf.recovery.onnx_model` does."""
    runtime = onnx_runtime()
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = runtime.ExecutionMode.ORT_SEQUENTIAL
    options.graph_optimization_level = runtime.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("mlas.disable_kleidiai", "1")
    return runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])


def in_roles(photo: Photo) -> tuple[Photo, Photo, Photo]:
    """A simulated photo as chart's photo, white frame and dark frame: three files, since one file has one role."""
    chart, white, dark = (replace(photo, sha256=digit + photo.sha256[1:]) for digit in "cad")
    return chart, white, dark


def makers_matrices(curves: Floats, seed: int, off: float = MATRIX_ERROR) -> tuple[ColourMatrix, ...]:
    """Colour matrices for A and D65 as a maker may fit them to a camera (681, 3), with this relative error."""
    table = np.loadtxt(MUNSELL, delimiter=",", skiprows=1)
    surfaces = np.stack([np.interp(WAVELENGTHS, table[:, 0], column) for column in table.T[1:]])
    error = np.eye(3) + off * np.random.default_rng([11, seed]).normal(size=(3, 3))
    found = []
    for light in ("A", "D65"):
        reflected = surfaces * read_lamp(light).values
        to_raw = np.linalg.lstsq(reflected @ observer("1931"), reflected @ curves, rcond=None)[0].T
        found.append(ColourMatrix(light, tuple((error @ to_raw).ravel().tolist())))
    return tuple(found)


def chosen_basis(observation: Observation, answers: Sequence[Ssf], beliefs: Floats) -> Ssf:
    """The mixture of answers to one observation by their evidences and beliefs, ln of the bases' prior odds."""
    guess = LampGuess((), observation, 0.0)
    hypotheses = [
        UnweighedHypothesis(guess, answer.basis, answer.prior_scale, float(belief))
        for answer, belief in zip(answers, beliefs, strict=True)
    ]
    nats = np.array([np.nan if answer.log_evidence is None else answer.log_evidence for answer in answers])
    return choose(hypotheses, nats, lambda kept: [answers[i] for i in kept])
