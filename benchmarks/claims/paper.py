"""How good are the paper's methods, and where do they not hold?

Cameras: the 52 measured ones and colour-science's two; the paper's own camera is not public. Whatever learns (PCA,
Wiener, the `cameras` basis) sees no camera of the maker it is scored on, and a method with a free number takes the
one that is best on the other makers' cameras under the same lamp and noise. RMSE on peak-normalised curves, 400 to
700 nm, mean of R, G, B; noise σ = ν hypot(y, 0.2) with ν = 0, 0.5 % or 1 %; 12 patches are numbers 7 to 18.

Leaves benchmarks/results/paper.json, which `python -m tools.results paper` keeps as docs/paper.json.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

from benchmarks.claim import Run
from benchmarks.paper.experiments import EXPERIMENTS, LAMPS, NOISES, cameras
from benchmarks.paper.experiments import run as experiment
from benchmarks.paper.gathering import GATHER, check

OPTIONS = {"jobs": (2, "processes"), "every": (1, "take every so manieth camera")}


def claim(run: Run) -> None:
    """All experiments, in processes, and the tables of the paper's Table 1 and Fig. 4."""
    known, every = cameras(), run.options.every
    chosen = [i for i in range(len(known)) if i % every == 0 or known[i].name.endswith("(NPL)")]
    work = [(name, i) for name in EXPERIMENTS for i in chosen]
    with ProcessPoolExecutor(run.options.jobs, get_context("spawn")) as pool:
        waiting = {pool.submit(experiment, *each): each for each in work}
        results = {waiting[done]: done.result() for done in run.track(as_completed(waiting), "experiments")}
    found: dict[str, Any] = {"cameras": len(chosen), "every": every}
    for name, gather in GATHER.items():
        found[name] = gather({i: results[name, i] for i in chosen})
    run.kept = found
    show(run, found)
    check(run, found)


def show(run: Run, found: dict[str, Any]) -> None:
    """The tables."""
    noises = [str(noise) for noise in NOISES]
    columns = {f"{name} {float(noise):.1%}": ".4f" for noise in noises for name in LAMPS}
    rows: list[Any] = [
        (name, *(row[noise][lamp]["rmse"] for noise in noises for lamp in LAMPS))
        for name, row in found["rivals"].items()
    ]
    run.table(f"Table 1's families, 24 patches, {found['cameras']} cameras", {"method": ""} | columns, rows)
    columns = {f"{float(noise):.1%}": ".4f" for noise in noises}
    rows = [(name, *(row[noise] for noise in noises)) for name, row in found["figure_4"].items()]
    run.table("Fig. 4, 12 patches, D55", {"method": ""} | columns, rows)
    rows = [
        (name, case, *(row[case][lamp]["rmse"] for lamp in row[case]),
         max(score["rmsre_percent"] for score in row[case].values()))
        for name, row in found["lamps"].items() for case in ("known", "ignored")
    ]  # fmt: skip
    lamps = dict.fromkeys(next(iter(found["lamps"].values()))["known"], ".3f")
    run.table("The lamp, known and ignored", {"method": "", "lamp": ""} | lamps | {"largest RMSRE, %": ".2f"}, rows)
