"""Kotlin's whole calibration beside Python's: `python -m benchmarks.kernels.kotlin_calibrate [--runs 15]`

A simulated 12-megapixel photo of a phone, as lossless JPEG and uncompressed, no white and no dark frame, corners by
hand; with its lamp named and not: from the file to the result document as JSON. One warm JVM and this process take
turns, one thread each; the ratio is taken pair by pair. Both work out all that the document holds, and their curves
must agree. `--before FOLDER` takes another build's android-bindings in place of Python, for what a change brought.
Then Kotlin's `toJson`, the first of the JVM and the median of the warm ones, and the opening of a session, the median
without the first, which loads ONNX Runtime. Bars: 0.6 x Python, toJson 30 ms, a session 200 ms. Exit status 1 where
one is missed. Needs `mvn -f android-bindings package`.
"""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.kernels.turns import (
    BINDINGS,
    Jvm,
    Unavailable,
    class_path,
    in_turn,
    or_unavailable,
    ratio,
    ratio_cells,
)
from benchmarks.shared import bar as bar_of
from benchmarks.shared import bars_table, command_parser, console, one_thread, progress, save, table, versions
from camssf.calibration import calibrate
from camssf.documents.document import document_bytes
from camssf.photo.capture import Shot
from camssf.spectra.cameras import DEMO_PHONE
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene

BAR, JSON_BAR, SESSION_BAR = 0.6, 0.030, 0.200
CLOSE = 1e-9
"""Largest difference of two curves of peak 1 that is none."""
LAMPS = {"lamp named": "D55", "no lamp named": "auto"}
STORAGES: dict[str, str | None] = {"lossless JPEG": "ljpeg", "uncompressed": None}
BASES = ("phones", "cameras", "ryyb")
WARM = 8
"""Pairs that are not counted: the JVM compiles what it runs often."""


def words(shot: Shot, out: Path) -> str:
    """Kotlin's command line."""
    corners = ",".join(repr(float(v)) for v in np.ravel(shot.corners))
    return "\t".join([str(shot.photo), "--lamp", str(shot.lamp), "--corners", corners, "-o", str(out)])


def python(shot: Shot) -> tuple[float, dict[str, Any]]:
    """Seconds, and the document."""
    start = time.perf_counter()
    data = document_bytes(calibrate([shot]))
    return time.perf_counter() - start, json.loads(data)


def distance(ours: dict[str, Any], theirs: dict[str, Any]) -> float:
    """Largest difference of the curves of peak 1."""
    colours = ("red", "green", "blue")
    return max(
        float(np.abs(np.subtract(ours["answer"]["curves"][c], theirs["answer"]["curves"][c])).max()) for c in colours
    )


def kotlin(jvm: Jvm, line: str) -> list[float]:
    """The seconds that an answer states."""
    status, *seconds = jvm.ask(line)
    if status != "0":
        raise Unavailable("Kotlin gave no curves; its error is above.")
    return [float(second) for second in seconds]


def measure(jvm: Jvm, before: Jvm | None, shot: Shot, runs: int, folder: Path) -> dict[str, Any]:
    """Medians and the ratio's spread over `runs` pairs, and the times of `toJson`, WARM pairs before included."""
    out, other = folder / "kotlin.json", folder / "before.json"
    to_json: list[float] = []
    documents: dict[str, Any] = {}

    def theirs() -> float:
        if before is None:
            seconds, documents["other"] = python(shot)
            return seconds
        seconds, _ = kotlin(before, words(shot, other))
        documents["other"] = json.loads(other.read_text("utf-8"))
        return seconds

    def ours() -> float:
        seconds, writing = kotlin(jvm, words(shot, out))
        to_json.append(writing)
        apart = distance(documents["other"], json.loads(out.read_text("utf-8")))
        documents["apart"] = max(apart, documents.get("apart", 0.0))
        return seconds

    times = in_turn({"other_seconds": theirs, "kotlin_seconds": ours}, runs, WARM)
    if documents["apart"] > CLOSE:
        raise SystemExit(f"The curves differ by {documents['apart']:.1e} of the peak.")
    medians = {name: statistics.median(taken) for name, taken in times.items()}
    spread = ratio(times["kotlin_seconds"], times["other_seconds"])
    return medians | spread | {"curves_apart": documents["apart"], "to_json_seconds": to_json}


@or_unavailable
def main() -> int:
    """Runs, prints, saves; 1 where the bar is broken, 2 where it cannot run."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--before", type=Path, help="android-bindings of another build, in place of Python")
    options = parser.parse_args()
    captures: dict[str, dict[str, Any]] = {}
    with ExitStack() as stack:
        jvm, *others = [
            stack.enter_context(Jvm(class_path(bindings), "org.camssf.golden.Calibrate", "--serve"))
            for bindings in (BINDINGS, *([options.before] if options.before else []))
        ]
        sessions = [kotlin(jvm, f"--open\t{basis}")[0] for basis in BASES for _ in range(5)][1:]
        root = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        bar = stack.enter_context(progress())
        for storage, compression in bar.track(STORAGES.items(), description="storages"):
            sensor = Sensor(compression=compression)
            made = simulate(DEMO_PHONE, "D55", root / storage, scene=Scene(size=(4000, 3000)), sensor=sensor)
            for named, lamp in LAMPS.items():
                shot = Shot(made.shots[0].chart, lamp, corners=made.pose.corners)
                before = others[0] if others else None
                captures[f"{storage}, {named}"] = measure(jvm, before, shot, options.runs, root / storage)
    keys = ("other_seconds", "kotlin_seconds")
    of = "before" if options.before else "Python"
    rows = [
        (name, *(f"{1e3 * one[key]:.0f}" for key in keys), *ratio_cells(one), f"{one['curves_apart']:.0e}")
        for name, one in captures.items()
    ]
    head = ("12 megapixels", f"{of} ms", "Kotlin ms", "ratio", "10 to 90 %", "curves apart")
    title = f"Calibration, medians of {options.runs} pairs, warm; bar {BAR} x {of}"
    console().print(table(title, head, rows))
    first, *warm = (seconds for one in captures.values() for seconds in one["to_json_seconds"])
    bars = [bar_of(f"{name}, x {of}", one["ratio"], BAR) for name, one in captures.items()]
    bars += [
        bar_of("toJson, the first, s", first, JSON_BAR),
        bar_of("toJson, warm, s", statistics.median(warm[WARM:]), JSON_BAR),
        bar_of("a session, s", statistics.median(sessions), SESSION_BAR),
    ]
    console().print(bars_table(bars))
    content = {"versions": versions(), "runs": options.runs, "captures": captures, "sessions": sessions, "bars": bars}
    print(save("kotlin_calibrate", content))
    return 0 if all(each["met"] for each in bars) else 1


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
