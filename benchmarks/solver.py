"""What does an answer cost, and how exact is it? `python -m benchmarks.solver [--rounds 30]`

One run, one thread, contenders in turn (A B C, A B C ...), medians; a ratio is the median of each turn's ratio. Times
are for the three channels and include

- ONNX model: one session.run from raw patch means: Eq. (5), rows, covariance and its inverse, the solution and its
  proof, curves, bands, predictions. Nothing is prepared.
- NumPy reference: `camssf.recover(engine="reference")`, the same work from signals, with its checks of the input.
- every peer: the code x alone. Rows, covariance and whitening are given to it for free, and what can be compiled
  beforehand is. Its calls go through its own Python face; tolerances as `_peers` says.

Relative duality gaps are recomputed for all by one function (`_common.relative_gap`) on the same whitened rows.
Then the bars: ONNX against compiled cvxpy, each from patch means to the code (the peer's solve plus its rows and
whitening in NumPy), and beside it the harder comparison, with these given for free. And cost against patches (beyond
24 by convex blends of the chart's), shots and atoms (Gaussian models built for it), as tables and as a plot. Camera:
colour-science's Nikon 5100, noise 0.5 %. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module, resources
from typing import Any

import numpy as np

from benchmarks._common import (
    RESULTS,
    Problem,
    console,
    gamma_max,
    lamp,
    make_problem,
    one_thread,
    progress,
    reflectances,
    relative_gap,
    save,
    table,
    versions,
    whiten,
)
from benchmarks._peers import PEERS, Missing
from camssf.curves.basis import Basis, gaussian_basis, read_basis
from camssf.curves.choice import recover
from camssf.curves.code import solve
from camssf.curves.engine import load_model, onnx_runtime
from camssf.grid import Floats
from camssf.spectra import read_camera

ONNX, REFERENCE = "ONNX model, from raw patch means", "NumPy reference, from signals"
ROWS = "(rows and whitening in NumPy: free for peers)"
SHORT = {
    ONNX: "ONNX",
    REFERENCE: "reference",
    "cvxpy, compiled (DPP), a channel a solve": "cvxpy compiled",
    "Clarabel, called directly": "Clarabel",
}
COMPILED = tuple(name for name in PEERS if "compiled" in name)
SIZE_BAR, LOAD_BAR, SPEED_BAR, SPEED_GOAL = 400_000, 50.0, 1 / 2, 1 / 3
SHOTS = ("D55", "A", "FL2", "LED-B3", "D75", "HP1")
PATCHES = (9, 12, 18, 24, 48, 96, 140)
ATOMS = (9, 18, 27, 36, 54, 72)


def problem_of(basis: str, patches: int, shots: int = 1, share: float = 1e-3, book: Basis | None = None) -> Problem:
    """The product's defaults: λ₂ 1, γ 0.05, full Σ; on `gaussian` λ₂ 0, γ = share · γ_max, x ≥ 0, diagonal Σ."""
    rng = np.random.default_rng(patches)
    paper = basis == "gaussian"
    table_ = reflectances(patches, rng)
    tolerances = {} if paper else {"chart_tolerance": 0.03, "white_tolerance": 0.01, "lamp_tolerance": 0.02}
    made = make_problem(
        basis,
        read_camera("Nikon 5100 (NPL)").values,
        np.stack([lamp(name) for name in SHOTS[:shots]]),
        table_,
        table_,
        noise=0.005,
        rng=rng,
        l2=0.0 if paper else 1.0,
        gamma=0.05,
        nonnegative=paper,
        label=f"{basis}, {patches} patches, {' + '.join(SHOTS[:shots])}",
        **tolerances,  # type: ignore[arg-type]
    )
    if paper:
        top = gamma_max(*whiten(made.sensing(book or read_basis(basis))), True)
        made = Problem(made.inputs | {"gamma": np.array(share * top.min())}, basis, made.label)
    return made


def engines(problem: Problem, book: Basis, session: Callable[[dict[str, Floats]], Mapping[str, Floats]]) -> Runs:
    """Our two."""
    given = problem.inputs
    signals = (given["chart"] - given["dark"]) / (given["white"] - given["dark"])
    reference = partial(
        recover, signals, given["reflectance"], given["lamp"], standard_error=given["standard_error"],
        chart_tolerance=given["chart_tolerance"], white_reflectance=given["white_reflectance"],
        white_tolerance=float(given["white_tolerance"]), lamp_tolerance=given["lamp_tolerance"], basis=book,
        l2=problem.l2, gamma=problem.gamma, nonnegative=problem.nonnegative, engine="reference",
    )  # fmt: skip
    return {ONNX: lambda: session(given)["code"].T, REFERENCE: lambda: reference().code.T}


Runs = dict[str, Callable[[], Floats]]


def race(runs: Runs, rounds: int, label: str) -> tuple[dict[str, list[float]], dict[str, Floats]]:
    """Seconds and last codes of each contender, called in turn; the first round warms up and does not count."""
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    codes: dict[str, Floats] = {}
    with warnings.catch_warnings(), progress() as bar:
        warnings.simplefilter("ignore")  # what a peer has not reached, its gap shows
        for turn in bar.track(range(rounds + 1), description=label):
            for name, run in runs.items():
                start = time.perf_counter()
                codes[name] = run()
                if turn:
                    seconds[name].append(time.perf_counter() - start)
    return seconds, codes


def contest(problem: Problem, rounds: int, peers: tuple[str, ...] = tuple(PEERS)) -> tuple[list[dict[str, Any]], str]:
    """Every contender on one problem: median, quartiles, ratio to ONNX, worst gap; and who was missing."""
    book = read_basis(problem.basis)
    A, b = whiten(problem.sensing(book))
    runs = engines(problem, book, load_model(problem.basis).run)
    missing = []
    for name in peers:
        try:
            runs[name] = PEERS[name](A, b, problem.l2, problem.gamma, problem.nonnegative)
        except Missing as reason:
            missing.append(f"{name} is not installed and left out ({reason})")
    runs[ROWS] = lambda: whiten(problem.sensing(book))[1]
    seconds, codes = race(runs, rounds, problem.label)
    base = np.array(seconds[ONNX])
    rows = []
    for name, taken in seconds.items():
        low, middle, high = np.percentile(taken, (25, 50, 75))
        gap = None if name == ROWS else worst_gap(A, b, codes[name], problem)
        rows.append({"contender": name, "ms": 1e3 * middle, "quartiles": [1e3 * low, 1e3 * high], "gap": gap}
                    | {"times_onnx": float(np.median(np.array(taken) / base))})  # fmt: skip
    return rows, "; ".join(missing)


def worst_gap(A: Floats, b: Floats, codes: Floats, problem: Problem) -> float:
    """Largest of the three channels' relative duality gaps."""
    gaps = [relative_gap(A[c], b[c], codes[c], problem.l2, problem.gamma, problem.nonnegative) for c in range(3)]
    return float(np.max(gaps))


def load_times(basis: str, sessions: int = 15, processes: int = 5) -> dict[str, float]:
    """Median ms to read the file and make a session: again and again in this process, and first in fresh ones."""
    again = []
    for _ in range(sessions):
        start = time.perf_counter()
        load_model.__wrapped__(basis)
        again.append(time.perf_counter() - start)
    script = (
        "import time, numpy\nfrom camssf.engine import load_model, onnx_runtime\nonnx_runtime()\n"
        f"start = time.perf_counter()\nload_model({basis!r})\nprint(time.perf_counter() - start)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    first = [
        float(subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, check=True).stdout)
        for _ in range(processes)
    ]
    return {"session_ms": 1e3 * float(np.median(again)), "first_session_ms": 1e3 * float(np.median(first))}


def cost(problems: dict[int, Problem], word: str, rounds: int) -> list[dict[str, Any]]:
    """ONNX, the reference and the two fastest kinds of peer against one size."""
    rows = []
    for size, problem in problems.items():
        found, _ = contest(problem, rounds, (COMPILED[0], "Clarabel, called directly"))
        times = {row["contender"]: row["ms"] for row in found if row["contender"] != ROWS}
        rows.append({word: size} | times | {"gap ONNX": found[0]["gap"], "gap reference": found[1]["gap"]})
    return rows


def cost_of_atoms(counts: tuple[int, ...], rounds: int) -> list[dict[str, Any]]:
    """The same for Gaussian models of other sizes, built here; raises Missing without onnx."""
    try:
        from camssf_onnx.model import build
    except ImportError as error:
        raise Missing("pip install onnx") from error
    onnxruntime = onnx_runtime()
    rows = []
    for count in counts:
        book = gaussian_basis(count)
        content = build(book).SerializeToString()
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
        options.log_severity_level = 3
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        problem = problem_of("gaussian", 24, book=book)
        A, b = whiten(problem.sensing(book))
        runs: Runs = {
            ONNX: lambda s=session, p=problem: s.run(["code"], p.inputs)[0].T,  # type: ignore[misc]
            REFERENCE: lambda p=problem, book=book: (
                solve(  # type: ignore[misc]
                    p.sensing(book), p.l2, np.full(3, p.gamma), nonnegative=True
                ).values
            ),
        }
        for name in (COMPILED[0], "Clarabel, called directly"):
            runs[name] = PEERS[name](A, b, problem.l2, problem.gamma, problem.nonnegative)
        seconds, codes = race(runs, rounds, f"{count} atoms")
        row: dict[str, Any] = {"atoms": count} | {
            name: 1e3 * float(np.median(taken)) for name, taken in seconds.items()
        }
        gaps = {
            f"gap {name.split()[i].rstrip(',')}": worst_gap(A, b, codes[name], problem)
            for i, name in ((0, ONNX), (1, REFERENCE))
        }
        rows.append(row | gaps | {"file kB": len(content) / 1e3})
    return rows


def plot(costs: dict[str, list[dict[str, Any]]]) -> str:
    """The cost tables as benchmarks/results/solver.png."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(costs), figsize=(4.5 * len(costs), 3.6), sharey=True, squeeze=False)
    for axis, (word, rows) in zip(axes[0], costs.items(), strict=True):
        for name in rows[0]:
            if name != word and not name.startswith(("gap", "file")):
                axis.plot(
                    [row[word] for row in rows], [row[name] for row in rows], "o-", label=name.split(", from")[0]
                )
        axis.set(xlabel=word, xscale="linear", yscale="log", xticks=[row[word] for row in rows])
        axis.tick_params(axis="x", labelsize=7)
        axis.grid(alpha=0.3)
    axes[0, 0].set_ylabel("ms for three channels")
    axes[0, 0].legend(fontsize=7)
    figure.tight_layout()
    RESULTS.mkdir(exist_ok=True)
    temporary = RESULTS / ".solver.png"
    figure.savefig(temporary, dpi=130, format="png")
    os.replace(temporary, RESULTS / "solver.png")
    pyplot.close(figure)
    return "benchmarks/results/solver.png"


def threads() -> str:
    """How many threads the linear algebra really uses."""
    try:
        import_module("sklearn.linear_model")  # its OpenMP is to be counted too
        pools = import_module("threadpoolctl").threadpool_info()
    except ImportError:
        return "set to one (threadpoolctl or scikit-learn is missing: not verified)"
    return ", ".join(sorted({f"{pool['internal_api']} {pool['num_threads']}" for pool in pools})) or "no pool loaded"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.solver", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=30, help="turns of each contender")
    parser.add_argument("--contest-only", action="store_true", help="leave out load times and cost tables")
    options = parser.parse_args(arguments)
    out = console()
    out.print(f"threads: {threads()}; {options.rounds} rounds in turn; ms for three channels, medians and quartiles")
    contests: dict[str, list[dict[str, Any]]] = {}
    for problem in (problem_of("cameras", 24), problem_of("cameras", 24, 2), problem_of("gaussian", 12)):
        rows, missing = contest(problem, options.rounds)
        contests[problem.label] = rows
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
    bars, held = [], True
    for label, rows in contests.items():
        ours, given = rows[0], next(row for row in rows if row["contender"] == ROWS)
        for peer in (row for row in rows if row["contender"] in COMPILED):
            ratio, alone = ours["ms"] / (peer["ms"] + given["ms"]), 1.0 / peer["times_onnx"]
            good = ratio <= SPEED_BAR and ours["gap"] <= peer["gap"]
            held &= good
            word = "held, goal too" if good and ratio <= SPEED_GOAL else "held" if good else "MISSED"
            bars.append(
                (f"ONNX / {peer['contender']}, with its rows: {label}", f"{ratio:.2f}", "0.50 (goal 0.33)", word)
            )
            word = "below 0.50" if alone <= SPEED_BAR else "above 0.50"
            bars.append(("    rows and whitening given to the peer for free", f"{alone:.2f}", "", word))
    content: dict[str, Any] = {"rounds": options.rounds, "contests": contests}
    if not options.contest_only:
        content["models"] = {}
        for basis in ("cameras", "gaussian"):
            size = len((resources.files("camssf") / "data" / f"camssf-{basis}.onnx").read_bytes())
            times = load_times(basis)
            content["models"][basis] = {"bytes": size} | times
            held &= size <= SIZE_BAR and max(times.values()) <= LOAD_BAR
            said = "held" if size <= SIZE_BAR else "MISSED"
            bars.append((f"file: camssf-{basis}.onnx, kB", f"{size / 1e3:.1f}", f"{SIZE_BAR / 1e3:.0f}", said))
            for key, where in (("session_ms", "again in one process"), ("first_session_ms", "first of a process")):
                said = "held" if times[key] <= LOAD_BAR else "MISSED"
                bars.append((f"load: camssf-{basis}.onnx, {where}, ms", f"{times[key]:.1f}", f"{LOAD_BAR:.0f}", said))
    out.print(table("Bars", ("what", "measured", "bar", ""), bars))
    if not options.contest_only:
        few = max(3, options.rounds // 3)
        costs = {
            "patches": cost({n: problem_of("cameras", n) for n in PATCHES}, "patches", few),
            "shots": cost({k: problem_of("cameras", 24, k) for k in range(1, 7)}, "shots", few),
        }
        try:
            costs["atoms"] = cost_of_atoms(ATOMS, few)
        except Missing as reason:
            out.print(f"cost against atoms is left out ({reason})")
        titles = {"patches": "cameras, one shot", "shots": "cameras, 24 patches", "atoms": "gaussian, 24 patches"}
        for word, rows in costs.items():
            cells = [
                [
                    f"{v:.1e}" if key.startswith("gap") else f"{v:.2f}" if isinstance(v, float) else v
                    for key, v in row.items()
                ]
                for row in rows
            ]
            out.print(table(f"Cost against {word} ({titles[word]}), ms", [SHORT.get(x, x) for x in rows[0]], cells))
        content["costs"] = costs
        out.print(f"written: {plot(costs)}")
    content["versions"] = versions("cvxpy", "clarabel", "osqp", "scikit-learn", "skglm")
    out.print(f"written: {save('solver', content)}")
    out.print("every bar held" if held else "a bar was MISSED")
    return 0 if held else 1


if __name__ == "__main__":
    one_thread("benchmarks.solver")
    sys.exit(main())
