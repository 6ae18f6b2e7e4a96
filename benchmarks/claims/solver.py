"""What does an answer cost beside another solver?

One run, one thread, contenders in turn (A B C, A B C ...), medians; a ratio is the median of each turn's ratio. Times
are for the three channels:

- ONNX model: one session.run from raw patch means: Eq. (5), rows, covariance and its inverse, the solution and its
  proof, curves, bands, predictions. Nothing is prepared.
- NumPy reference: `camssf.recover(engine="reference")`, the same work from signals, with its checks of the input.
- cvxpy with Clarabel, compiled (DPP) beforehand: the code alone, of the same problem: 72 unknowns at once on
  `cameras`, three times 18 on `gaussian`, a problem a solve or all in one. Rows, covariance and whitening are given
  to it for free, and so is their reduction to as many rows as unknowns (QR).

"Rows counted" adds the rows and their whitening in NumPy to cvxpy's time. Gaps are recomputed for all by one function
on the same whitened rows. Camera: colour-science's Nikon 5100, noise 0.5 %.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.claim import Run
from benchmarks.problems import Problem, gamma_max, gaps, make_problem, reflectances, whiten
from benchmarks.shared import lamp
from benchmarks.turns import Unavailable, clocked, in_turn, ratio
from camssf.grid import Floats
from camssf.recovery.basis import Basis, read_basis
from camssf.recovery.hypotheses import recover
from camssf.recovery.onnx_model import load_model
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import read_camera

OPTIONS = {"rounds": (30, "turns of each contender")}
ONNX, REFERENCE = "ONNX model, from raw patch means", "NumPy reference, from signals"
ROWS = "(rows and whitening in NumPy)"
COMPILED = {"cvxpy, compiled, a problem a solve": False, "cvxpy, compiled, all in one solve": True}
BARS = {"cameras": 0.5, "gaussian": 0.6}
"""ONNX over the faster compiled cvxpy, whose rows are free."""
CONTESTS = (("cameras", 24, ("D55",)), ("cameras", 24, ("D55", "A")), ("gaussian", 12, ("D55",)))
Solve = Callable[[], Floats]


def problem_of(basis: str, patches: int, shots: tuple[str, ...]) -> Problem:
    """The product's defaults: λ₂ 1, γ 0.05, full Σ; on `gaussian` λ₂ 0, γ = 0.001 γ_max, x ≥ 0, diagonal Σ."""
    rng = np.random.default_rng(patches)
    paper = basis == "gaussian"
    table, lamps = reflectances(patches, rng), np.stack([lamp(name) for name in shots])
    tolerances = {} if paper else {"chart_tolerance": 0.03, "white_tolerance": 0.01, "lamp_tolerance": 0.02}
    made = make_problem(
        basis, read_camera("Nikon 5100 (NPL)").values, lamps, table, table, noise=0.005, rng=rng,
        l2=0.0 if paper else 1.0, gamma=0.05, nonnegative=paper,
        label=f"{basis}, {patches} patches, {' + '.join(shots)}", **tolerances,  # type: ignore[arg-type]
    )  # fmt: skip
    if paper:
        top = gamma_max(*whiten(made.sensing(read_basis(basis))), True)
        made = Problem(made.inputs | {"gamma": np.array(1e-3 * top.min())}, basis, made.label)
    return made


def engines(problem: Problem, book: Basis) -> dict[str, Solve]:
    """Our two; codes as the problems have them, (p, r)."""
    model, p = load_model(problem.basis), 1 if book.prior else 3
    settings = SolverSettings(problem.l2, problem.gamma, problem.nonnegative, "reference")
    evidence = problem.evidence
    return {
        ONNX: lambda: model.run(problem.inputs)["code"].T.reshape(p, -1),
        REFERENCE: lambda: recover(evidence, basis=book, settings=settings).code.T.reshape(p, -1),
    }


def reduced(A: Floats, b: Floats) -> tuple[Floats, Floats]:
    """The same problems, up to a constant of the objective, in no more rows than unknowns: what cvxpy is given."""
    if A.shape[1] <= A.shape[2]:
        return A, b
    Q, R = np.linalg.qr(A)
    return R, np.einsum("pnr,pn->pr", Q, b)


def compiled(A: Floats, b: Floats, problem: Problem, at_once: bool) -> Solve:
    """Problems of that size compiled once, rows, targets and γ parameters; solved one by one or all in one."""
    try:
        cp: Any = import_module("cvxpy")
    except ImportError as error:
        raise Unavailable("pip install cvxpy") from error
    together = len(A) if at_once else 1
    rows = [cp.Parameter(A.shape[1:]) for _ in range(together)]
    targets = [cp.Parameter(A.shape[1]) for _ in range(together)]
    xs = [cp.Variable(A.shape[2], nonneg=problem.nonnegative) for _ in range(together)]
    weight = cp.Parameter(nonneg=True)
    parts = [
        0.5 * cp.sum_squares(a @ x - t) + weight * cp.norm1(x) for a, t, x in zip(rows, targets, xs, strict=True)
    ]
    if problem.l2 > 0:
        parts += [0.5 * problem.l2 * cp.sum_squares(x) for x in xs]
    posed = cp.Problem(cp.Minimize(sum(parts)))

    def run() -> Floats:
        codes = []
        for start in range(0, len(A), together):
            for i in range(together):
                rows[i].value, targets[i].value = A[start + i], b[start + i]
            weight.value = problem.gamma
            posed.solve(solver=cp.CLARABEL)
            codes += [np.array(x.value) for x in xs]
        return np.array(codes)

    return run


def contest(problem: Problem, rounds: int) -> tuple[dict[str, list[float]], dict[str, float]]:
    """Seconds of every contender, turn by turn, and the largest gap of its last codes."""
    book = read_basis(problem.basis)
    A, b = whiten(problem.sensing(book))
    runs = engines(problem, book)
    for name, at_once in COMPILED.items():
        if len(A) > 1 or not at_once:
            runs[name] = compiled(*reduced(A, b), problem, at_once)
    codes: dict[str, Floats] = {}

    def remembered(name: str) -> Callable[[], float]:
        return clocked(lambda: codes.__setitem__(name, runs[name]()))

    contenders = {name: remembered(name) for name in runs}
    contenders[ROWS] = clocked(lambda: whiten(problem.sensing(book)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what a solver has not reached, its gap shows
        seconds = in_turn(contenders, rounds, warm=1)
    return seconds, {name: float(np.max(gaps(A, b, code, problem))) for name, code in codes.items()}


def claim(run: Run) -> None:
    """A row a problem and contender."""
    rows, ratios = [], []
    for basis, patches, shots in run.track(CONTESTS, "contests"):
        problem = problem_of(basis, patches, shots)
        seconds, found = contest(problem, run.options.rounds)
        rows += [(problem.label, name, 1e3 * np.median(taken), found.get(name)) for name, taken in seconds.items()]
        peer = min((name for name in COMPILED if name in seconds), key=lambda name: np.median(seconds[name]))
        free = ratio(seconds[ONNX], seconds[peer])
        counted = np.median(seconds[ONNX]) / (np.median(seconds[peer]) + np.median(seconds[ROWS]))
        ratios.append((problem.label, peer, free, counted))
        run.bar(f"{problem.label}: ONNX over cvxpy, rows free", free, most=BARS[basis])
        run.bar(f"{problem.label}: gap of ONNX over cvxpy's", found[ONNX] / found[peer], most=1.0)
    run.table("Answers", {"problem": "", "contender": "", "ms": ".2f", "gap": ".1e"}, rows)
    columns = {"problem": "", "cvxpy": ""} | dict.fromkeys(("rows free", "rows counted"), ".2f")
    run.table("ONNX over compiled cvxpy", columns, ratios)
