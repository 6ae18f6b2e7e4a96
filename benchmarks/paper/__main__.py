"""The paper's experiments and its rivals: `python -m benchmarks.paper [--jobs 2] [--every 1]`

Cameras: the 52 measured ones and colour-science's two; the paper's own camera is not public. Whatever learns (PCA,
Wiener, the `cameras` basis) sees no camera of the maker it is scored on, and a method with a free number takes the
one that is best on the other makers' cameras under the same lamp and noise. RMSE on peak-normalised curves, 400 to
700 nm, mean of R, G, B; noise σ = ν hypot(y, 0.2) with ν = 0, 0.5 % or 1 %; 12 patches are numbers 7 to 18.

Leaves benchmarks/results/paper.json, of which `python -m tools.paper_page` makes docs/paper.json and the pictures.
Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

from benchmarks.paper import captures
from benchmarks.paper.experiments import CURVE_CAMERA, EXPERIMENTS, LAMPS, NOISES, cameras, phone, run, spectrograph
from benchmarks.paper.gathering import GATHER, bars_of, correlations, curves, gather_direct
from benchmarks.shared import (
    bars_table,
    command_parser,
    console,
    one_thread,
    progress,
    save,
    table,
    versions,
)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--every", type=int, default=1, help="take every so manieth camera")
    options = parser.parse_args(arguments)
    out = console()
    begun = time.perf_counter()
    known = cameras()
    chosen = [i for i in range(len(known)) if i % options.every == 0 or known[i].name.endswith("(NPL)")]
    phones = [i for i, camera in enumerate(known) if camera.name in captures.PHONES]
    work: list[tuple[Any, ...]] = [(run, name, i) for name in EXPERIMENTS for i in chosen]
    public = next(i for i, camera in enumerate(known) if camera.name == CURVE_CAMERA)
    work += [(spectrograph, i, light) for i in sorted({*chosen[::4], public}) for light in ("AM1.5", "daylight")]
    work += [(phone, i) for i in phones]
    results: dict[tuple[Any, ...], Any] = {}
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool, progress() as bar:
        task = bar.add_task("the paper's experiments", total=len(work))
        waiting = {pool.submit(*each): each for each in work}
        for done in as_completed(waiting):
            results[waiting[done]] = done.result()
            bar.advance(task)
    found: dict[str, Any] = {"cameras": len(chosen), "every": options.every}
    for name, gather in GATHER.items():
        found[name] = gather({i: results[run, name, i] for i in chosen})
    found["correlation"], found["curves_of_one"] = correlations(), curves()
    spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    found["minutes"] = (time.perf_counter() - begun) / 60.0
    found["cpu_minutes"] = sum(each.ru_utime + each.ru_stime for each in spent) / 60.0
    found["phones"] = {known[i].name: results[phone, i] for i in phones}
    found["direct"] = gather_direct({k[1:]: v for k, v in results.items() if k[0] is spectrograph})
    found["direct_of_one"] = results[spectrograph, public, "AM1.5"]
    found["bars"] = bars_of(found)
    found["versions"] = versions("scipy", "colour-science", "scikit-learn")
    place = save("paper", found)
    show(found, out)
    out.print(f"{place}, {found['minutes']:.1f} minutes")
    return 0 if all(bar["met"] for bar in found["bars"]) else 1


def show(found: dict[str, Any], out: Any) -> None:
    """The tables, on stdout."""
    rows = found["rivals"]
    head = ["method", *(f"{name} {float(noise):.1%}" for noise in map(str, NOISES) for name in LAMPS)]
    cells = [
        [name, *(f"{row[noise][lamp_]['rmse']:.4f}" for noise in map(str, NOISES) for lamp_ in LAMPS)]
        for name, row in rows.items()
    ]
    out.print(table(f"Table 1's families, 24 patches, {found['cameras']} cameras", head, cells))
    head = ["method", *(f"{float(noise):.1%}" for noise in map(str, NOISES))]
    cells = [[name, *(f"{row[str(noise)]:.4f}" for noise in NOISES)] for name, row in found["figure_4"].items()]
    out.print(table("Fig. 4, 12 patches, D55", head, cells))
    out.print(bars_table(found["bars"]))


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
