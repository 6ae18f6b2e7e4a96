"""Kotlin's standard colour of a live preview: `python -m benchmarks.kernels.kotlin_colour [--runs 200]`

A mosaic of 200 × 200 samples, a pixel a colour-filter cell: 10,000 pixels, read and turned into Lab by one thread of
one warm JVM, under a lamp that is named and under one that is weighed among four kinds. Also what the process's first
colour, another standardiser with its tables and the colour of one surface take. Bar: 5 ms for reading and Lab. Needs
`mvn -f android-bindings package`.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from benchmarks.kernels.kotlin_calibrate import Unavailable, class_path
from benchmarks.shared import command_parser, console, one_thread, save, table, versions

BAR = 5.0
"""Milliseconds."""
PIXELS, SIDE = 10_000, 200
CASES = {"named": "colour/named", "auto": "colour/auto"}
GOLDEN = Path(__file__).parents[2] / "golden"
TIMES = ("first", "make", "one", "read", "xyz", "lab")


def measure(case: str, runs: int) -> dict[str, float]:
    """Milliseconds, medians.

    Raises:
        Unavailable: the JVM gave no times.
    """
    command = ["java", "-Xmx256m", "-XX:+UseSerialGC", "-cp", class_path(), "org.camssf.golden.Preview"]
    done = subprocess.run(
        [*command, str(GOLDEN), case, str(SIDE), str(runs)], stdout=subprocess.PIPE, text=True, check=False
    )
    answer = done.stdout.split()
    if done.returncode or len(answer) != len(TIMES) + 1 or int(answer[-1]) != PIXELS:
        raise Unavailable(f"Kotlin gave no times for {case}; its error is above.")
    return dict(zip(TIMES, map(float, answer), strict=False))


def holds(found: dict[str, dict[str, float]]) -> bool:
    """Whether a preview keeps the bar."""
    return all(one["read"] + one["lab"] < BAR for one in found.values())


def main() -> int:
    """Runs, prints, saves; 1 where the bar is broken, 2 where it cannot run."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--runs", type=int, default=200)
    options = parser.parse_args()
    try:
        found = {name: measure(case, options.runs) for name, case in CASES.items()}
    except (Unavailable, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    rows = [(name, *(f"{one[time]:.2f}" for time in TIMES)) for name, one in found.items()]
    head = ("lamp", "first ms", "make ms", "one ms", "read ms", "XYZ ms", "Lab ms")
    console().print(table(f"{PIXELS} pixels, medians of {options.runs}, warm; bar {BAR:g} ms", head, rows))
    print(save("kotlin_colour", {"versions": versions(), "runs": options.runs, "lamps": found}))
    return 0 if holds(found) else 1


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
