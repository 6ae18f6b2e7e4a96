"""How far does the unrolled part come alone? `python -m benchmarks.depth [--cameras 12] [--seed 0]`

For each depth, the layers of both constructors (`camssf.recovery.layers`: `splitting`, which ships, and `ista`)
without the finish: distance of their curve from the exact one, in parts of its peak, over cameras x lamps x
channels: worst, and in brackets the median. Then what the finish makes of the shipped layers' answer at that depth:
the same distance, how many calls' layers are proof enough by themselves (relative gap <= 1e-10: the finish takes no
step), and how many pivots it takes from there in the others. Exact: the shipped depth and the finish, taken whatever
the layers' own proof says; its relative duality gap, recomputed in long double (`_common.relative_gap`), must be
<= 1e-9; the largest is printed. Where it is not, cvxpy is asked (`benchmarks.certify`), and that is counted.

24 patches, noise 0.1 % with a foot; lamps D55 | D55 + A | FL2 on `cameras` (one problem of 72 unknowns; γ 0.05 with
λ₂ 1, γ 1.4 with λ₂ 0, signed, full Σ of the chart's 3 %), D55 | A | FL2 on `gaussian` (a problem a channel;
γ = 1e-3 γ_max, x >= 0, diagonal Σ). A second bar: on the product's defaults the shipped depth comes within 1e-7.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks._common import (
    RESULTS,
    Problem,
    cameras,
    chart,
    console,
    convex,
    curves,
    forced,
    gamma_max,
    gaps,
    lamp,
    make_problem,
    one_thread,
    progress,
    save,
    table,
    versions,
    whiten,
    whiten_finely,
)
from benchmarks.certify import oracle
from camssf.grid import Floats
from camssf.recovery.basis import read_basis
from camssf.recovery.duality_gap import duality_gap
from camssf.recovery.elastic_net import ElasticNet as Convex
from camssf.recovery.layers import DEPTH, LAYERS
from camssf.recovery.pivoting import PROVEN, finish_steps, pivot_to_optimum

DEPTHS = (1, 2, 4, 8, 16, 32, 64, 128, 512)
LIGHTS = {
    "cameras": (("D55",), ("D55", "A"), ("FL2",)),
    "gaussian": (("D55",), ("A",), ("FL2",)),
}
GAMMAS = {0.0: 1.4, 1.0: 0.05}
GAP_BAR, CURVE_BAR = 1e-9, 1e-7


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


def unrolled(each: Convex, layers: str, depths: tuple[int, ...]) -> Floats:
    """(depths, r) answers of the nets of those depths; a net's last layers may differ from its others."""
    layer = LAYERS[layers](each)
    return np.stack([layer.unroll(depth) for depth in depths])


@dataclass(frozen=True)
class Measured:
    """One call at every depth.

    Attributes:
        off: by constructor, (depths, 3) distance of the curves without the finish.
        finished: (depths, 3) the same of `splitting` with the finish as it ships.
        pivots: (depths,) of the finish, all problems of the call; 0 where the layers were proof enough.
        gap: of the exact code.
        asked: whether cvxpy had to give that.
    """

    off: dict[str, Floats]
    finished: Floats
    pivots: Floats
    gap: float
    asked: bool


def measure(problem: Problem, depths: tuple[int, ...]) -> Measured:
    """Layers alone, and with the finish, against the exact curve."""
    basis = problem.anchored(read_basis(problem.basis))
    sensing = problem.sensing(basis)
    each = convex(sensing, problem)
    fine = whiten_finely(sensing)
    exact = np.stack([forced(one) for one in each])
    asked = not float(gaps(*fine, exact, problem).max()) <= GAP_BAR
    if asked:
        exact = oracle(*whiten(sensing), basis, problem.l2, problem.gamma, problem.nonnegative).code
    truth = curves(basis, exact)
    codes = {name: np.stack([unrolled(one, name, depths) for one in each], axis=1) for name in LAYERS}
    finished, pivots = [], []
    for z in codes["splitting"]:
        done = [
            (x, 0) if duality_gap(one, x)[1] <= PROVEN else pivot_to_optimum(one, x, finish_steps(x.size))
            for one, x in zip(each, z, strict=True)
        ]
        finished.append(_distance(curves(basis, np.stack([x for x, _ in done])), truth))
        pivots.append(sum(taken for _, taken in done))
    off = {name: np.stack([_distance(curves(basis, z), truth) for z in found]) for name, found in codes.items()}
    return Measured(off, np.stack(finished), np.array(pivots, float), float(gaps(*fine, exact, problem).max()), asked)


def _distance(s: Floats, truth: Floats) -> Floats:
    """Not peak on peak: a code that is still zero has no peak."""
    return np.asarray(np.abs(s - truth).max(axis=1) / np.abs(truth).max(axis=1))


def summed(found: list[Measured], depths: tuple[int, ...]) -> dict[str, Any]:
    """A group's worst and median distances, and its pivots, by depth."""
    row: dict[str, Any] = {"calls": len(found), "depths": list(depths)}
    parts = {name: [one.off[name] for one in found] for name in LAYERS} | {
        "finished": [one.finished for one in found]
    }
    for name, part in parts.items():
        off = np.stack(part, axis=1).reshape(len(depths), -1)
        row[name] = {"worst": off.max(axis=1).tolist(), "median": np.median(off, axis=1).tolist()}
    pivots = np.stack([one.pivots for one in found], axis=1)
    row["pivots"] = {
        "none": (pivots == 0).mean(axis=1).tolist(),
        "median": [float(np.median(at[at > 0])) if at.any() else 0.0 for at in pivots],
        "most": pivots.max(axis=1).tolist(),
    }
    row["exact gap"] = max(one.gap for one in found)
    row["asked of cvxpy"] = sum(one.asked for one in found)
    return row


def plot(rows: list[dict[str, Any]]) -> str:
    """Distance against depth as benchmarks/results/depth.png."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(rows), figsize=(3.4 * len(rows), 3.4), sharey=True, squeeze=False)
    for axis, row in zip(axes[0], rows, strict=True):
        for name, colour in (("splitting", "tab:blue"), ("ista", "tab:orange")):
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
    out.print(f"cameras: {options.cameras} of {cameras()[1]}; distance from the exact curve in parts of its peak")
    rows: list[dict[str, Any]] = []
    with progress() as bar:
        for basis in LIGHTS:
            for l2 in (0.0, 1.0):
                group = problems(basis, l2, options.cameras, options.seed)
                found = [measure(p, depths) for p in bar.track(group, description=f"{basis}, l2 {l2:g}")]
                rows.append({"basis": basis, "l2": l2} | summed(found, depths))
    head = ("depth", *(f"{row['basis']}, λ₂ {row['l2']:g}" for row in rows))
    titles = {
        "splitting": "Layers alone (`splitting`, which ships): worst (median)",
        "ista": "Layers alone (`ista`): worst (median)",
        "finished": "`splitting` with the finish, where the layers are not proof enough: worst (median)",
    }
    for name, title in titles.items():
        lines = [
            (depth, *(f"{row[name]['worst'][i]:.1e} ({row[name]['median'][i]:.0e})" for row in rows))
            for i, depth in enumerate(depths)
        ]
        out.print(table(title, head, lines))
    lines = [
        (
            depth,
            *(
                f"{100 * row['pivots']['none'][i]:.0f} % ({row['pivots']['median'][i]:.0f}, "
                f"{row['pivots']['most'][i]:.0f})"
                for row in rows
            ),
        )
        for i, depth in enumerate(depths)
    ]
    out.print(table("Calls without a step of the finish (pivots of the others: median, most)", head, lines))
    for row in rows:
        out.print(
            f"{row['basis']}, λ₂ {row['l2']:g}: {row['calls']} calls; exact codes' gap <= {row['exact gap']:.1e}"
            + (f"; {row['asked of cvxpy']} calls asked of cvxpy" if row["asked of cvxpy"] else "")
        )
    held = all(row["exact gap"] <= GAP_BAR for row in rows)
    if DEPTH in depths:
        product = next(row for row in rows if row["basis"] == "cameras" and row["l2"] == 1.0)
        worst = product["splitting"]["worst"][depths.index(DEPTH)]
        held &= worst <= CURVE_BAR
        out.print(
            f"the product's defaults, {DEPTH} layers alone: {worst:.1e} of the peak (bar {CURVE_BAR:.0e}): "
            + ("held" if worst <= CURVE_BAR else "MISSED")
        )
    place = plot(rows)
    out.print(f"written: {place}, {save('depth', {'seed': options.seed, 'rows': rows, 'versions': versions()})}")
    return 0 if held else 1


if __name__ == "__main__":
    one_thread("benchmarks.depth")
    sys.exit(main())
