"""How good are the paper's methods, and where do they not hold?

Cameras: the 52 measured ones and colour-science's two; the paper's own camera is not public. Whatever learns (PCA,
Wiener, the `cameras` basis) sees no camera of the maker it is scored on, and a method with a free number takes the
one that is best on the other makers' cameras under the same lamp and noise. RMSE on peak-normalised curves, 400 to
700 nm, mean of R, G, B; noise σ = ν hypot(y, 0.2) with ν = 0, 0.5 % or 1 %; 12 patches are numbers 7 to 18.

Leaves benchmarks/results/paper.json, which `python -m tools.results paper` keeps as docs/paper.json, and of which
`python -m tools.paper_picture` makes the picture.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

from benchmarks.claim import Run
from benchmarks.paper import captures
from benchmarks.paper.experiments import EXPERIMENTS, LAMPS, NOISES, cameras, phone, spectrograph
from benchmarks.paper.experiments import run as experiment
from benchmarks.paper.gathering import GATHER, check, correlations, gather_direct

METHODS = {
    "paper": "l1 on Gaussians", "gaussian": "l1 on Gaussians", "product": "camssf", "cameras": "camssf",
}  # fmt: skip
OPTIONS = {"jobs": (2, "processes"), "every": (1, "take every so manieth camera")}


def claim(run: Run) -> None:
    """All experiments, in processes, and the tables of the paper's Table 1 and Fig. 4."""
    known, every = cameras(), run.options.every
    chosen = [i for i in range(len(known)) if i % every == 0 or known[i].name.endswith("(NPL)")]
    phones = [i for i, camera in enumerate(known) if camera.name in captures.PHONES]
    work: list[tuple[Any, ...]] = [(experiment, name, i) for name in EXPERIMENTS for i in chosen]
    work += [(spectrograph, i, light) for i in chosen[::4] for light in ("AM1.5", "daylight")]
    work += [(phone, i) for i in phones]
    results: dict[tuple[Any, ...], Any] = {}
    with ProcessPoolExecutor(run.options.jobs, get_context("spawn")) as pool:
        waiting = {pool.submit(*each): each for each in work}
        results = {waiting[done]: done.result() for done in run.track(as_completed(waiting), "experiments")}
    found: dict[str, Any] = {"cameras": len(chosen), "every": every}
    for name, gather in GATHER.items():
        found[name] = gather({i: results[experiment, name, i] for i in chosen})
    found["correlation"] = correlations()
    found["phones"] = {known[i].name: results[phone, i] for i in phones}
    found["direct"] = gather_direct({k[1:]: v for k, v in results.items() if k[0] is spectrograph})
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
    colours = found["colours"]
    shown = {str(count): i for i, count in enumerate(colours["counts"]) if count % 3 == 0}
    rows = [
        (f"{METHODS[key]}, noise {float(noise):.1%}", *(colours[key][noise]["mean"][i] for i in shown.values()))
        for key in ("paper", "product") for noise in noises[:2]
    ]  # fmt: skip
    run.table("Fig. 3a, patches chosen at random, D55", {"patches": ""} | dict.fromkeys(shown, ".3f"), rows)
    tables, coherence = found["correlation"]["tables"], found["correlation"]["coherence_below_1"]
    rows = [(name, row["mean"]) for name, row in tables.items()]
    run.table("Fig. 3f", {"table, patches": "", "mean size of the pairs' r": ".3f"}, rows)
    run.say(f"The mutual coherence of the paper's dictionary is 1 - {coherence:.1e}.")
    columns = {"light": ""} | dict.fromkeys(("RMSE", "worst channel"), ".4f")
    columns |= dict.fromkeys(("colour: worst wavelength, nm", "mono: worst wavelength, nm"), ".2f")
    roles = ("rgb", "mono")
    rows = [
        (light, row["rmse"], row["rmse_worst"], *(row[role]["wavelength_error_worst_nm"] for role in roles))
        for light, row in found["direct"].items()
    ]
    run.table("Sec. 4: direct measurement", columns, rows)
    three = "{:.3f} {:.3f} {:.3f}"
    rows = [
        (name, f"{world}, {METHODS[method]}", *((tuple(answer[key]) for key in ("rmsre_percent", "rmse"))
         if "refused" not in answer else (None, None)), answer.get("delta_e00"),
         answer.get("verdict") or answer["refused"])
        for name, row in found["phones"].items() for world, answers in row["worlds"].items()
        for method, answer in ((key, answers[key]) for key in ("gaussian", "cameras"))
    ]  # fmt: skip
    columns = {"camera": "", "world": "", "RMSRE, %": three, "RMSE": three, "mean ΔE00": ".2f", "verdict": ""}
    run.table("Sec. 5: three small cameras as phones", columns, rows)
    rows = [
        (name, case, *(row[case][lamp]["rmse"] for lamp in row[case]),
         max(score["rmsre_percent"] for score in row[case].values()))
        for name, row in found["lamps"].items() for case in ("known", "ignored")
    ]  # fmt: skip
    lamps = dict.fromkeys(next(iter(found["lamps"].values()))["known"], ".3f")
    run.table("The lamp, known and ignored", {"method": "", "lamp": ""} | lamps | {"largest RMSRE, %": ".2f"}, rows)
