"""What does judging cost, in fits of the capture? `python -m benchmarks.kernels.judging`

One small simulated photo under D55, the lamp named: the verdict, which weighs all rival lamps, and a fit of the same
signals (one run of the model) take turns. On the basis cameras, and where the signals choose the basis. One thread,
medians of the ratios pair by pair. Before the rivals were weighed in one go judging took 11 fits on the basis cameras
and 18 where the signals choose; the goal is a third of that. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from functools import partial
from pathlib import Path

from benchmarks.kernels.turns import clocked, in_turn, ratio
from benchmarks.shared import command_parser, console, one_thread, save, table, versions
from camssf import Options
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import recover_fit
from camssf.photo.capture import measure
from camssf.verdict.rival_lamps import weigh
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene

BARS = {"cameras": (6.5, 3.6), "auto": (11.0, 6.0)}
"""Judging on a basis, in fits on the basis cameras: bar and goal."""


def main(arguments: list[str] | None = None) -> int:
    """Measure; 1 where a bar is missed."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--runs", type=int, default=31)
    runs = parser.parse_args(arguments).runs
    with tempfile.TemporaryDirectory() as folder:
        made = simulate("Nikon 5100 (NPL)", "D55", Path(folder), scene=Scene(size=(900, 675)))
        capture = measure(made.shots[0].chart, "D55")
    single = prepare_fit(capture, Options(basis="cameras"))
    rows = []
    for basis in BARS:
        fit = prepare_fit(capture, Options(basis=basis))
        ssf = recover_fit(fit, fit.signals.used, None)
        used = fit.signals.used
        contenders = {
            "fit": clocked(partial(recover_fit, single, used, None)), "judging": clocked(partial(weigh, fit, ssf, []))
        }  # fmt: skip
        times = in_turn(contenders, runs)
        medians = (round(1e3 * statistics.median(seconds), 1) for seconds in times.values())
        rows.append((basis, *medians, round(ratio(times["judging"], times["fit"])["ratio"], 2), *BARS[basis]))
    head = ["basis", "a fit, ms", "judging, ms", "ratio", "bar", "goal"]
    console().print(table(f"Judging one photo, {runs} pairs", head, rows))
    print(f"written: {save('judging', {'rows': rows, 'runs': runs, 'versions': versions()})}")
    return int(any(measured > bar for *_, measured, bar, _ in rows))


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
