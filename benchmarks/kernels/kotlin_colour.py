"""Kotlin's standard colour of a live preview: `python -m benchmarks.kernels.kotlin_colour [--runs 200]`

A mosaic of 200 × 200 samples, a pixel a colour-filter cell: 10,000 pixels, read and turned into Lab by one thread of
one warm JVM, under a lamp that is named and under one that is weighed among four kinds. Also what the process's first
colour, another standardiser with its tables and the colour of one surface take. Bar: 5 ms for reading and Lab. Needs
`mvn -f android-bindings package`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from benchmarks.kernels.turns import Jvm, Unavailable, class_path, or_unavailable
from benchmarks.shared import command_parser, console, one_thread, save, table, versions

BAR = 5.0
"""Milliseconds."""
PIXELS, SIDE = 10_000, 200
CASES = {"named": "colour/named", "auto": "colour/auto"}
GOLDEN = Path(__file__).parents[2] / "golden"
TIMES = ("first", "make", "one", "read", "xyz", "lab")


def measure(case: str, runs: int) -> dict[str, float]:
    """Milliseconds, medians, in a JVM of its own."""
    words = ("org.camssf.golden.Preview", str(GOLDEN), case, str(SIDE), str(runs))
    with Jvm(class_path(), *words, heap=256) as jvm:
        *times, pixels = jvm.ask("")
    if len(times) != len(TIMES) or int(pixels) != PIXELS:
        raise Unavailable(f"Kotlin gave no times for {case}.")
    return dict(zip(TIMES, map(float, times), strict=True))


@or_unavailable
def main() -> int:
    """Runs, prints, saves; 1 where the bar is broken, 2 where it cannot run."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--runs", type=int, default=200)
    runs = parser.parse_args().runs
    lamps = {name: measure(case, runs) for name, case in CASES.items()}
    rows = [(name, *(f"{times[step]:.2f}" for step in TIMES)) for name, times in lamps.items()]
    head = ("lamp", "first ms", "make ms", "one ms", "read ms", "XYZ ms", "Lab ms")
    console().print(table(f"{PIXELS} pixels, medians of {runs}, warm; bar {BAR:g} ms", head, rows))
    print(save("kotlin_colour", {"versions": versions(), "runs": runs, "lamps": lamps}))
    return int(any(times["read"] + times["lab"] >= BAR for times in lamps.values()))


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
