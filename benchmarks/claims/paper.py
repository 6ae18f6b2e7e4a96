"""How good are the paper's methods, and where do they not hold?

Cameras: the 52 measured ones and colour-science's two; the paper's own camera is not public. Whatever learns (PCA,
Wiener, the `cameras` basis) sees no camera of the maker it is scored on, and a method with a free number takes the
one that is best on the other makers' cameras under the same lamp and noise. RMSE on peak-normalised curves, 400 to
700 nm, mean of R, G, B; noise σ = ν hypot(y, 0.2) with ν = 0, 0.5 % or 1 %; 12 patches are numbers 7 to 18.

Leaves benchmarks/results/paper.json, of which `python -m tools.paper_page` makes docs/paper.json and the pictures.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

from benchmarks.claim import Run
from benchmarks.paper import captures
from benchmarks.paper.experiments import CURVE_CAMERA, EXPERIMENTS, LAMPS, NOISES, cameras, phone, spectrograph
from benchmarks.paper.experiments import run as experiment
from benchmarks.paper.gathering import GATHER, check, correlations, curves, gather_direct

OPTIONS = {"jobs": (2, "processes"), "every": (1, "take every so manieth camera")}


def claim(run: Run) -> None:
    """All experiments, in processes, and the tables of the paper's Table 1 and Fig. 4."""
    known, every = cameras(), run.options.every
    chosen = [i for i in range(len(known)) if i % every == 0 or known[i].name.endswith("(NPL)")]
    phones = [i for i, camera in enumerate(known) if camera.name in captures.PHONES]
    work: list[tuple[Any, ...]] = [(experiment, name, i) for name in EXPERIMENTS for i in chosen]
    public = next(i for i, camera in enumerate(known) if camera.name == CURVE_CAMERA)
    work += [(spectrograph, i, light) for i in sorted({*chosen[::4], public}) for light in ("AM1.5", "daylight")]
    work += [(phone, i) for i in phones]
    results: dict[tuple[Any, ...], Any] = {}
    with ProcessPoolExecutor(run.options.jobs, get_context("spawn")) as pool:
        waiting = {pool.submit(*each): each for each in work}
        results = {waiting[done]: done.result() for done in run.track(as_completed(waiting), "experiments")}
    found: dict[str, Any] = {"cameras": len(chosen), "every": every}
    for name, gather in GATHER.items():
        found[name] = gather({i: results[experiment, name, i] for i in chosen})
    found["correlation"], found["curves_of_one"] = correlations(), curves()
    found["phones"] = {known[i].name: results[phone, i] for i in phones}
    found["direct"] = gather_direct({k[1:]: v for k, v in results.items() if k[0] is spectrograph})
    found["direct_of_one"] = results[spectrograph, public, "AM1.5"]
    run.kept = found
    columns = {f"{name} {noise:.1%}": ".4f" for noise in NOISES for name in LAMPS}
    rows = [
        (name, *(row[str(noise)][lamp]["rmse"] for noise in NOISES for lamp in LAMPS))
        for name, row in found["rivals"].items()
    ]
    run.table(f"Table 1's families, 24 patches, {len(chosen)} cameras", {"method": ""} | columns, rows)
    columns = {f"{noise:.1%}": ".4f" for noise in NOISES}
    rows = [(name, *(row[str(noise)] for noise in NOISES)) for name, row in found["figure_4"].items()]
    run.table("Fig. 4, 12 patches, D55", {"method": ""} | columns, rows)
    check(run, found)
