"""How far does the unrolled part come alone? `python -m benchmarks.depth [--cameras 12] [--seed 0]`

For each depth, the layers without the finish (`solve(..., finish=0)`): distance of their curve from the exact one, in
parts of its peak, over cameras x lamps x channels: worst, and in brackets the median. Beside it plain ISTA on the
same problem, z ← soft(z + (g - M z) / ‖M‖, γ / ‖M‖), as many steps. Exact: the full solver's code, whose relative
duality gap, recomputed (`_common.relative_gap`), must be <= 1e-9; the largest is printed. Where it is not, cvxpy is
asked (`benchmarks.certify`), and that is counted.

24 patches, noise 0.1 % with a foot; lamps D55 | D55 + A | FL2 on `cameras` (γ 0.05 with λ₂ 1, γ 1.4 with λ₂ 0,
signed, full Σ of the chart's 3 %), D55 | A | FL2 on `gaussian` (γ = 1e-3 γ_max, x >= 0, diagonal Σ).
"""

from __future__ import annotations

import argparse
import os
import sys
from typing import Any

import numpy as np

from benchmarks._common import (
    RESULTS,
    Problem,
    cameras,
    chart,
    console,
    curves,
    gamma_max,
    lamp,
    make_problem,
    one_thread,
    progress,
    relative_gap,
    save,
    table,
    versions,
    whiten,
)
from benchmarks.certify import oracle
from camssf.curves.basis import read_basis
from camssf.curves.code import soft, solve
from camssf.grid import Floats

DEPTHS = (1, 2, 4, 8, 16, 32, 64, 128, 512)
LIGHTS = {
    "cameras": (("D55",), ("D55", "A"), ("FL2",)),
    "gaussian": (("D55",), ("A",), ("FL2",)),
}
GAMMAS = {0.0: 1.4, 1.0: 0.05}
GAP_BAR = 1e-9


def problems(basis: str, l2: float, count: int, seed: int) -> list[Problem]:
    """`count` cameras, evenly out of those that are there, under each light."""
    known = cameras()[0]
    names = [list(known)[i] for i in np.unique(np.linspace(0, len(known) - 1, count).astype(int))]
    paper, made = basis == "gaussian", []
    for i, name in enumerate(names):
        for j, light in enumerate(LIGHTS[basis]):
            problem = make_problem(
                basis,
                known[name],
                np.stack([lamp(x) for x in light]),
                chart(),
                chart(),
                noise=0.001,
                rng=np.random.default_rng([seed, i, j]),
                l2=l2,
                gamma=GAMMAS[l2],
                nonnegative=paper,
                chart_tolerance=0.0 if paper else 0.03,
                white_tolerance=0.0 if paper else 0.01,
                label=f"{name}, {' + '.join(light)}",
            )
            if paper:
                top = gamma_max(*whiten(problem.sensing(read_basis(basis))), True)
                problem = Problem(problem.inputs | {"gamma": np.array(1e-3 * top.min())}, basis, problem.label)
            made.append(problem)
    return made


def ista(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool, depths: tuple[int, ...]) -> Floats:
    """(depths, 3, r) iterates of plain ISTA from zero, on whitened rows."""
    M = A.transpose(0, 2, 1) @ A + l2 * np.eye(A.shape[2])
    pull = np.einsum("cnr,cn->cr", A, b)
    step = 1.0 / np.linalg.eigvalsh(M)[:, -1:]  # (3, 1)
    z, kept = np.zeros_like(pull), []
    for count in range(1, max(depths) + 1):
        inner = z + step * (pull - np.einsum("crs,cs->cr", M, z))
        z = np.stack([soft(v, gamma * float(t[0]), nonnegative) for v, t in zip(inner, step, strict=True)])
        if count in depths:
            kept.append(z)
    return np.array(kept)


def measure(problem: Problem, depths: tuple[int, ...]) -> tuple[Floats, Floats, float, bool]:
    """Distances (depths, 3) of the layers and of ISTA, the exact code's gap, and whether cvxpy had to give it."""
    basis = problem.anchored(read_basis(problem.basis))
    sensing = problem.sensing(basis)
    A, b = whiten(sensing)
    l2, gamma, nonnegative = problem.l2, problem.gamma, problem.nonnegative
    weights = np.full(3, gamma)

    def worst(code: Floats) -> float:
        return max(relative_gap(A[c], b[c], code[c], l2, gamma, nonnegative) for c in range(3))

    exact = solve(sensing, l2, weights, nonnegative=nonnegative).values
    asked = not worst(exact) <= GAP_BAR
    if asked:
        exact = oracle(A, b, basis, l2, gamma, nonnegative).code
    truth = curves(basis, exact)
    layers = [solve(sensing, l2, weights, nonnegative=nonnegative, depth=d, finish=0).values for d in depths]
    plain = ista(A, b, l2, gamma, nonnegative, depths)
    off = [[_distance(curves(basis, code), truth) for code in codes] for codes in (layers, plain)]
    return np.array(off[0]), np.array(off[1]), worst(exact), asked


def _distance(s: Floats, truth: Floats) -> Floats:
    """Not peak on peak: a code that is still zero has no peak."""
    return np.asarray(np.abs(s - truth).max(axis=1) / np.abs(truth).max(axis=1))


def plot(rows: list[dict[str, Any]]) -> str:
    """Distance against depth as benchmarks/results/depth.png."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(rows), figsize=(3.4 * len(rows), 3.4), sharey=True, squeeze=False)
    for axis, row in zip(axes[0], rows, strict=True):
        for name, colour in (("layers", "tab:blue"), ("ista", "tab:orange")):
            for kind, style in (("worst", "o-"), ("median", "o--")):
                values = np.maximum(row[name][kind], 1e-16)
                axis.loglog(row["depths"], values, style, color=colour, label=f"{name}, {kind}", ms=3)
        axis.set(title=f"{row['basis']}, λ₂ {row['l2']:g}", xlabel="depth")
        axis.grid(alpha=0.3)
    axes[0, 0].set_ylabel("distance, parts of the peak")
    axes[0, 0].legend(fontsize=7)
    figure.tight_layout()
    RESULTS.mkdir(exist_ok=True)
    temporary = RESULTS / ".depth.png"
    figure.savefig(temporary, dpi=130, format="png")
    os.replace(temporary, RESULTS / "depth.png")
    pyplot.close(figure)
    return "benchmarks/results/depth.png"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.depth", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cameras", type=int, default=12, help="how many")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--depths", type=int, nargs="+", default=list(DEPTHS))
    options = parser.parse_args(arguments)
    depths = tuple(sorted(set(options.depths)))
    out = console()
    out.print(
        f"cameras: {options.cameras} of {cameras()[1]}; no finish; distance from the exact curve in parts of its peak"
    )
    rows: list[dict[str, Any]] = []
    with progress() as bar:
        for basis in LIGHTS:
            for l2 in (0.0, 1.0):
                group = problems(basis, l2, options.cameras, options.seed)
                found = [measure(p, depths) for p in bar.track(group, description=f"{basis}, l2 {l2:g}")]
                row: dict[str, Any] = {"basis": basis, "l2": l2, "problems": 3 * len(group), "depths": list(depths)}
                for at, name in enumerate(("layers", "ista")):
                    off = np.stack([one[at] for one in found], axis=1).reshape(len(depths), -1)
                    row[name] = {"worst": off.max(axis=1).tolist(), "median": np.median(off, axis=1).tolist()}
                row["exact gap"] = max(one[2] for one in found)
                row["asked of cvxpy"] = sum(one[3] for one in found)
                rows.append(row)
    head = ("depth", *(f"{row['basis']}, λ₂ {row['l2']:g}" for row in rows))
    for name, title in (("layers", "Unrolled layers alone: worst (median)"), ("ista", "Plain ISTA: worst (median)")):
        lines = [
            (depth, *(f"{row[name]['worst'][i]:.1e} ({row[name]['median'][i]:.0e})" for row in rows))
            for i, depth in enumerate(depths)
        ]
        out.print(table(title, head, lines))
    for row in rows:
        out.print(
            f"{row['basis']}, λ₂ {row['l2']:g}: {row['problems']} problems; "
            f"gap of the exact codes <= {row['exact gap']:.1e}"
            + (f"; {row['asked of cvxpy']} calls asked of cvxpy" if row["asked of cvxpy"] else "")
        )
    good = all(row["exact gap"] <= GAP_BAR for row in rows)
    place = plot(rows)
    out.print(f"written: {place}, {save('depth', {'seed': options.seed, 'rows': rows, 'versions': versions()})}")
    return 0 if good else 1


if __name__ == "__main__":
    one_thread("benchmarks.depth")
    sys.exit(main())
