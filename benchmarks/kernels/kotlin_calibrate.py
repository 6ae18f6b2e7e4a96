"""Kotlin's whole calibration beside Python's: `python -m benchmarks.kernels.kotlin_calibrate [--runs 15]`

A simulated 12-megapixel capture, chart, white and dark frame uncompressed, corners by hand: from the files to the
result document as JSON. One warm JVM and this process take turns; the ratio is taken pair by pair. Python also works
out the uncertainty budget and the bands of the predictions, which Kotlin leaves out. The curves must agree.
Bar: 1.5 x Python. Needs `mvn -f android-bindings package`.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.shared import command_parser, console, one_thread, progress, save, table, versions
from camssf.calibration import calibrate
from camssf.simulation.frames import Simulation, simulate

BAR = 1.5
CLOSE = 1e-9
"""Largest difference of two curves of peak 1 that is none."""
LAMPS = ("D55", "A")
BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", Path(__file__).parents[2] / "android-bindings"))


class Unavailable(Exception):
    """The benchmark cannot run here; the message says what to do."""


def class_path() -> str:
    """The built jars and their libraries."""
    target = BINDINGS / "golden" / "target"
    jars = [jar for jar in sorted(target.glob("camssf-golden-*.jar")) if "sources" not in jar.name]
    if not jars or not (target / "classpath.txt").exists():
        raise Unavailable("The jars are missing: run mvn -f android-bindings package.")
    return os.pathsep.join([*map(str, jars), (target / "classpath.txt").read_text("utf-8").strip()])


class Jvm:
    """One warm JVM that calibrates on demand."""

    def __init__(self) -> None:
        command = [
            "java",
            "-Xmx512m",
            "-XX:+UseSerialGC",
            "-cp",
            class_path(),
            "org.camssf.golden.Calibrate",
            "--serve",
        ]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def calibrate(self, words: list[str]) -> float:
        """Seconds."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write("\t".join(words) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline().split()
        if len(answer) != 2 or answer[0] != "0":
            raise Unavailable("Kotlin gave no curves; its error is above.")
        return float(answer[1])

    def close(self) -> None:
        """Ends it."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def words(made: Simulation, k: int, out: Path) -> list[str]:
    """Kotlin's command line for the first k shots."""
    corners = ",".join(repr(float(v)) for v in made.pose.corners.ravel())
    found: list[str] = []
    for shot in made.shots[:k]:
        found += [str(shot.chart), "--lamp", shot.lamp, "--corners", corners]
        found += ["--white", str(shot.white), "--dark", str(shot.dark)]
    return [*found, "-o", str(out)]


def python(made: Simulation, k: int) -> tuple[float, dict[str, Any]]:
    """Seconds, and the document."""
    start = time.perf_counter()
    document = calibrate([replace(shot.shot, corners=made.pose.corners) for shot in made.shots[:k]]).document()
    text = json.dumps(document)
    return time.perf_counter() - start, json.loads(text)


def distance(ours: dict[str, Any], theirs: dict[str, Any]) -> float:
    """Largest difference of the curves of peak 1."""
    colours = ("red", "green", "blue")
    return max(float(np.abs(np.subtract(ours["ssf"][c], theirs["ssf"][c])).max()) for c in colours)


def measure(jvm: Jvm, made: Simulation, k: int, runs: int, folder: Path) -> dict[str, Any]:
    """Medians and the ratio's spread over `runs` pairs, after half as many to warm up."""
    out = folder / "kotlin.json"
    mine: list[float] = []
    theirs: list[float] = []
    apart = 0.0
    for run in range(-max(runs // 2, 3), runs):
        seconds, document = python(made, k)
        kotlin = jvm.calibrate(words(made, k, out))
        apart = max(apart, distance(document, json.loads(out.read_text("utf-8"))))
        if run >= 0:
            theirs.append(seconds)
            mine.append(kotlin)
    if apart > CLOSE:
        raise SystemExit(f"The curves differ by {apart:.1e} of the peak.")
    ratios = sorted(a / b for a, b in zip(mine, theirs, strict=True))
    return {
        "python_seconds": statistics.median(theirs),
        "kotlin_seconds": statistics.median(mine),
        "ratio": statistics.median(ratios),
        "ratio_10_90": [ratios[len(ratios) // 10], ratios[-1 - len(ratios) // 10]],
        "curves_apart": apart,
    }


def main() -> int:
    """Runs, prints, saves; 1 where the bar is broken, 2 where it cannot run."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--runs", type=int, default=15)
    options = parser.parse_args()
    found: dict[str, dict[str, Any]] = {}
    try:
        jvm = Jvm()
    except (Unavailable, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    try:
        with tempfile.TemporaryDirectory() as name, progress() as bar:
            folder = Path(name)
            task = bar.add_task("calibrations", total=len(LAMPS))
            made = simulate("Nikon 5100 (NPL)", LAMPS, folder)
            for k in range(1, len(LAMPS) + 1):
                found[f"{k} shot{'s' if k > 1 else ''}, white and dark"] = measure(jvm, made, k, options.runs, folder)
                bar.advance(task)
    except Unavailable as error:
        print(error, file=sys.stderr)
        return 2
    finally:
        jvm.close()
    rows = [
        (
            name,
            f"{1e3 * one['python_seconds']:.0f}",
            f"{1e3 * one['kotlin_seconds']:.0f}",
            f"{one['ratio']:.2f}",
            "{:.2f} to {:.2f}".format(*one["ratio_10_90"]),
            f"{one['curves_apart']:.0e}",
        )
        for name, one in found.items()
    ]
    head = ("12 megapixels", "Python ms", "Kotlin ms", "ratio", "10 to 90 %", "curves apart")
    title = f"Calibration, medians of {options.runs} pairs, warm; bar {BAR} x Python"
    console().print(table(title, head, rows))
    print(save("kotlin_calibrate", {"versions": versions(), "runs": options.runs, "captures": found}))
    return 0 if all(one["ratio"] <= BAR for one in found.values()) else 1


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
