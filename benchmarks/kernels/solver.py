"""What does an answer cost, and how exact is it? `python -m benchmarks.kernels.solver [--rounds 30]`

One run, one thread, contenders in turn (A B C, A B C ...), medians; a ratio is the median of each turn's ratio. Times
are for the three channels and include

- ONNX model: one session.run from raw patch means: Eq. (5), rows, covariance and its inverse, the solution and its
  proof, curves, bands, predictions. Nothing is prepared.
- NumPy reference: `camssf.recover(engine="reference")`, the same work from signals, with its checks of the input.
- every peer: the code x alone, of the same problem: 72 unknowns at once on `cameras`, three times 18 on `gaussian`.
  Rows, covariance and whitening are given to it for free, and so is their reduction to as many rows as unknowns
  (QR), and what can be compiled beforehand is. Its calls go through its own Python face; tolerances as `peers` says.

Relative duality gaps are recomputed for all by one function (`problems.relative_gap`) on the same whitened rows.
Then the bars: ONNX from raw patch means against compiled cvxpy's solve alone, its fastest form; beside it, without a
bar, the same with the peer's rows and whitening in NumPy added to its time. And 140 patches (beyond 24 by convex
blends of the chart's), or 6 shots, may cost 4 times what 24 patches and one shot do. Camera: colour-science's Nikon
5100, noise 0.5 %. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module, resources
from typing import Any

import numpy as np

from benchmarks.kernels.peers import PEERS
from benchmarks.kernels.turns import Unavailable, clocked, in_turn
from benchmarks.problems import Problem, gamma_max, gaps, make_problem, reflectances, whiten
from benchmarks.shared import command_parser, console, lamp, one_thread, save, table, versions
from camssf.grid import Floats
from camssf.recovery import onnx_model
from camssf.recovery.basis import LEARNED, Basis, read_basis
from camssf.recovery.hypotheses import recover
from camssf.recovery.onnx_model import load_model
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import read_camera

ONNX, REFERENCE = "ONNX model, from raw patch means", "NumPy reference, from signals"
ROWS = "(rows and whitening in NumPy: free for peers)"
ONE_BY_ONE, AT_ONCE = "cvxpy, compiled (DPP), a problem a solve", "cvxpy, compiled (DPP), all in one solve"
COMPILED = (ONE_BY_ONE, AT_ONCE)
SIZE_BAR, LOAD_BAR = 400_000, 50.0
SPEED_BARS = {"cameras": 0.5, "gaussian": 0.6}
"""ONNX over the fastest compiled cvxpy, whose rows are free."""
GROWTH_BAR = 4.0
"""Of the largest sizes over one shot and 24 patches."""
SHOTS = ("D55", "A", "FL2", "LED-B3", "D75", "HP1")


def problem_of(basis: str, patches: int, shots: int = 1) -> Problem:
    """The product's defaults: λ₂ 1, γ 0.05, full Σ; on `gaussian` λ₂ 0, γ = 0.001 γ_max, x ≥ 0, diagonal Σ."""
    rng = np.random.default_rng(patches)
    paper = basis == "gaussian"
    table_, lamps = reflectances(patches, rng), np.stack([lamp(name) for name in SHOTS[:shots]])
    tolerances = {} if paper else {"chart_tolerance": 0.03, "white_tolerance": 0.01, "lamp_tolerance": 0.02}
    made = make_problem(
        basis, read_camera("Nikon 5100 (NPL)").values, lamps, table_, table_, noise=0.005, rng=rng,
        l2=0.0 if paper else 1.0, gamma=0.05, nonnegative=paper,
        label=f"{basis}, {patches} patches, {' + '.join(SHOTS[:shots])}", **tolerances,  # type: ignore[arg-type]
    )  # fmt: skip
    if paper:
        top = gamma_max(*whiten(made.sensing(read_basis(basis))), True)
        made = Problem(made.inputs | {"gamma": np.array(1e-3 * top.min())}, basis, made.label)
    return made


Runs = dict[str, Callable[[], Floats]]


def engines(problem: Problem, book: Basis) -> Runs:
    """Our two; codes as the problems have them, (p, r)."""
    model, p = load_model(problem.basis), 1 if book.prior else 3
    settings = SolverSettings(problem.l2, problem.gamma, problem.nonnegative, "reference")
    evidence = problem.evidence
    return {
        ONNX: lambda: model.run(problem.inputs)["code"].T.reshape(p, -1),
        REFERENCE: lambda: recover(evidence, basis=book, settings=settings).code.T.reshape(p, -1),
    }


def reduced(A: Floats, b: Floats) -> tuple[Floats, Floats]:
    """The same problems, up to a constant of the objective, in no more rows than unknowns: what peers are given."""
    if A.shape[1] <= A.shape[2]:
        return A, b
    Q, R = np.linalg.qr(A)
    return R, np.einsum("pnr,pn->pr", Q, b)


def race(runs: Runs, rounds: int, label: str) -> tuple[dict[str, list[float]], dict[str, Floats]]:
    """Seconds and last codes of each contender, called in turn; the first round warms up and does not count."""
    codes: dict[str, Floats] = {}

    def remembered(name: str) -> Callable[[], float]:
        return clocked(lambda: codes.__setitem__(name, runs[name]()))

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what a peer has not reached, its gap shows
        print(f"{label} ...", file=sys.stderr)
        return in_turn({name: remembered(name) for name in runs}, rounds, warm=1), codes


def contest(problem: Problem, rounds: int, peers: Sequence[str] = tuple(PEERS)) -> tuple[list[dict[str, Any]], str]:
    """Every contender on one problem: median, quartiles, ratio to ONNX, worst gap; and who was missing."""
    book = read_basis(problem.basis)
    A, b = whiten(problem.sensing(book))
    runs = engines(problem, book)
    missing = []
    for name in peers:
        if name == AT_ONCE and len(A) == 1:
            continue  # one problem: the same as a problem a solve
        try:
            runs[name] = PEERS[name](*reduced(A, b), problem.l2, problem.gamma, problem.nonnegative)
        except Unavailable as reason:
            missing.append(f"{name} is not installed and left out ({reason})")
    runs[ROWS] = lambda: whiten(problem.sensing(book))[1]
    seconds, codes = race(runs, rounds, problem.label)
    base = np.array(seconds[ONNX])
    rows = []
    for name, taken in seconds.items():
        low, middle, high = np.percentile(taken, (25, 50, 75))
        gap = None if name == ROWS else float(np.max(gaps(A, b, codes[name], problem)))
        rows.append({"contender": name, "ms": 1e3 * middle, "quartiles": [1e3 * low, 1e3 * high], "gap": gap}
                    | {"times_onnx": float(np.median(np.array(taken) / base))})  # fmt: skip
    return rows, "; ".join(missing)


def load_times(basis: str, sessions: int = 15, processes: int = 5) -> dict[str, float]:
    """Median ms to read the file and make a session: again and again in this process, and first in fresh ones."""
    again = []
    for _ in range(sessions):
        load_model.cache_clear()
        onnx_model._open.cache_clear()
        start = time.perf_counter()
        load_model(basis)
        again.append(time.perf_counter() - start)
    script = (
        "import time, numpy\nfrom camssf.recovery.onnx_model import load_model, onnx_runtime\nonnx_runtime()\n"
        f"start = time.perf_counter()\nload_model({basis!r})\nprint(time.perf_counter() - start)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    first = [
        float(subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, check=True).stdout)
        for _ in range(processes)
    ]
    return {"session_ms": 1e3 * float(np.median(again)), "first_session_ms": 1e3 * float(np.median(first))}


def growth(rounds: int) -> dict[str, float]:
    """A call of the largest sizes over one of 24 patches and one shot, called in turn."""
    sizes = {"24 patches, one shot": (24, 1), "140 patches": (140, 1), "6 shots": (24, 6)}
    books = read_basis("cameras")
    runs = {name: engines(problem_of("cameras", n, k), books)[ONNX] for name, (n, k) in sizes.items()}
    seconds, _ = race(runs, rounds, "growth")
    base, *rest = map(np.array, seconds.values())
    return {name: float(np.median(each / base)) for name, each in zip([*sizes][1:], rest, strict=True)}


def threads() -> str:
    """How many threads the linear algebra really uses."""
    try:
        import_module("sklearn.linear_model")  # its OpenMP is to be counted too
        pools = import_module("threadpoolctl").threadpool_info()
    except ImportError:
        return "set to one (threadpoolctl or scikit-learn is missing: not verified)"
    return ", ".join(sorted({f"{pool['internal_api']} {pool['num_threads']}" for pool in pools})) or "no pool loaded"


def bars_of(label: str, basis: str, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A contest's bars: time against compiled cvxpy, and a gap no larger."""
    named = {row["contender"]: row for row in rows}
    ours, given, made = named[ONNX], named[ROWS], []
    compiled = [named[name] for name in COMPILED if name in named]
    if compiled:
        peer = min(compiled, key=lambda row: float(row["times_onnx"]))
        made += [
            _bar(f"ONNX / {peer['contender']}, rows free: {label}", 1.0 / peer["times_onnx"], SPEED_BARS[basis]),
            _bar("    with its rows and whitening", ours["ms"] / (peer["ms"] + given["ms"]), None),
            _bar(f"gap of ONNX: {label}", ours["gap"], peer["gap"]),
        ]
    return made


def _bar(what: str, value: float, limit: float | None) -> dict[str, Any]:
    """Without a limit it is only told."""
    return {"what": what, "value": value, "limit": limit, "met": limit is None or value <= limit}


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}" if 0 < value < 1e-3 else f"{value:.2f}"


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--rounds", type=int, default=30, help="turns of each contender")
    parser.add_argument("--contest-only", action="store_true", help="leave out growth and load times")
    options = parser.parse_args(arguments)
    out = console()
    out.print(f"threads: {threads()}; {options.rounds} rounds in turn; ms for three channels, medians and quartiles")
    contests: dict[str, list[dict[str, Any]]] = {}
    bars: list[dict[str, Any]] = []
    for problem in (problem_of("cameras", 24), problem_of("cameras", 24, 2), problem_of("gaussian", 12)):
        rows, missing = contest(problem, options.rounds)
        contests[problem.label] = rows
        bars += bars_of(problem.label, problem.basis, rows)
        penalties = f"λ₂ {problem.l2:g}, γ {problem.gamma:.3g}, {'x >= 0' if problem.nonnegative else 'signed'}"
        lines = [
            (
                row["contender"], f"{row['ms']:.2f}", f"{row['quartiles'][0]:.2f} - {row['quartiles'][1]:.2f}",
                f"{row['times_onnx']:.2f}", "" if row["gap"] is None else f"{row['gap']:.1e}",
            )
            for row in rows
        ]  # fmt: skip
        out.print(table(f"{problem.label}; {penalties}", ("contender", "ms", "quartiles", "x ONNX", "gap"), lines))
        if missing:
            out.print(missing)
    content: dict[str, Any] = {"rounds": options.rounds, "contests": contests}
    if not options.contest_only:
        grown = growth(max(3, options.rounds // 3))
        bars += [_bar(f"ONNX / 24 patches, one shot: {name}", value, GROWTH_BAR) for name, value in grown.items()]
        content["models"] = {}
        for basis in ("cameras", "gaussian"):
            file = f"camssf-{'learned' if basis in LEARNED else basis}.onnx"
            size = len((resources.files("camssf") / "data" / file).read_bytes())
            times = load_times(basis)
            content["models"][basis] = {"bytes": size} | times
            bars.append(_bar(f"file: {file}, kB", size / 1e3, SIZE_BAR / 1e3))
            for key, where in (("session_ms", "again in one process"), ("first_session_ms", "first of a process")):
                bars.append(_bar(f"load: {file}, {where}, ms", times[key], LOAD_BAR))
    words = {True: "held", False: "MISSED"}
    lines = [
        (bar["what"], _number(bar["value"]), _number(bar["limit"]), "" if bar["limit"] is None else words[bar["met"]])
        for bar in bars
    ]
    out.print(table("Bars", ("what", "measured", "bar", ""), lines))
    held = all(bar["met"] for bar in bars)
    content |= {"bars": bars, "versions": versions("cvxpy", "clarabel", "osqp", "scikit-learn", "skglm")}
    out.print(f"written: {save('solver', content)}")
    out.print("every bar held" if held else "a bar was MISSED")
    return 0 if held else 1


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
