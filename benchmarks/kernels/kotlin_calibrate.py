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
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

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
BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", Path(__file__).parents[2] / "android-bindings"))


class Unavailable(Exception):
    """The benchmark cannot run here; the message says what to do."""


def class_path(bindings: Path = BINDINGS) -> str:
    """The built jars and their libraries."""
    target = bindings / "golden" / "target"
    jars = [jar for jar in sorted(target.glob("camssf-golden-*.jar")) if "sources" not in jar.name]
    if not jars or not (target / "classpath.txt").exists():
        raise Unavailable(f"The jars are missing: run mvn -f {bindings} package.")
    return os.pathsep.join([*map(str, jars), (target / "classpath.txt").read_text("utf-8").strip()])


class Jvm:
    """One warm JVM that calibrates on demand."""

    def __init__(self, bindings: Path = BINDINGS) -> None:
        command = [
            "java",
            "-Xmx512m",
            "-XX:+UseSerialGC",
            "-cp",
            class_path(bindings),
            "org.camssf.golden.Calibrate",
            "--serve",
        ]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def answer(self, words: list[str]) -> list[float]:
        """The seconds that its answer states."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write("\t".join(words) + "\n")
        self.process.stdin.flush()
        status, *seconds = self.process.stdout.readline().split() or [""]
        if status != "0":
            raise Unavailable("Kotlin gave no curves; its error is above.")
        return [float(second) for second in seconds]

    def calibrate(self, words: list[str]) -> tuple[float, float]:
        """Seconds of the whole, and of these in `toJson`."""
        whole, json_ = self.answer(words)
        return whole, json_

    def open_session(self, basis: str) -> float:
        """Seconds."""
        return self.answer(["--open", basis])[0]

    def close(self) -> None:
        """Ends it."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def words(shot: Shot, out: Path) -> list[str]:
    """Kotlin's command line."""
    corners = ",".join(repr(float(v)) for v in np.ravel(shot.corners))
    return [str(shot.photo), "--lamp", str(shot.lamp), "--corners", corners, "-o", str(out)]


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


def measure(jvm: Jvm, before: Jvm | None, shot: Shot, runs: int, folder: Path) -> dict[str, Any]:
    """Medians and the ratio's spread over `runs` pairs, and the times of `toJson`, WARM pairs before included."""
    out, other = folder / "kotlin.json", folder / "before.json"
    mine: list[float] = []
    theirs: list[float] = []
    json_: list[float] = []
    apart = 0.0
    for run in range(-WARM, runs):
        if before is None:
            seconds, document = python(shot)
        else:
            seconds, _ = before.calibrate(words(shot, other))
            document = json.loads(other.read_text("utf-8"))
        kotlin, to_json = jvm.calibrate(words(shot, out))
        json_.append(to_json)
        apart = max(apart, distance(document, json.loads(out.read_text("utf-8"))))
        if run >= 0:
            theirs.append(seconds)
            mine.append(kotlin)
    if apart > CLOSE:
        raise SystemExit(f"The curves differ by {apart:.1e} of the peak.")
    ratios = sorted(a / b for a, b in zip(mine, theirs, strict=True))
    return {
        "other_seconds": statistics.median(theirs),
        "kotlin_seconds": statistics.median(mine),
        "ratio": statistics.median(ratios),
        "ratio_10_90": [ratios[len(ratios) // 10], ratios[-1 - len(ratios) // 10]],
        "curves_apart": apart,
        "to_json_seconds": json_,
    }


def main() -> int:
    """Runs, prints, saves; 1 where the bar is broken, 2 where it cannot run."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--before", type=Path, help="android-bindings of another build, in place of Python")
    options = parser.parse_args()
    found: dict[str, dict[str, Any]] = {}
    jvms: list[Jvm] = []
    try:
        jvms = [Jvm(), *([Jvm(options.before)] if options.before else [])]
        jvm, before = jvms[0], jvms[1] if options.before else None
        with tempfile.TemporaryDirectory() as name, progress() as bar:
            task = bar.add_task("calibrations", total=len(LAMPS) * len(STORAGES))
            sessions = [jvm.open_session(basis) for basis in BASES for _ in range(5)][1:]
            for storage, compression in STORAGES.items():
                folder = Path(name) / storage
                folder.mkdir()
                sensor = Sensor(compression=compression)
                made = simulate(DEMO_PHONE, "D55", folder, scene=Scene(size=(4000, 3000)), sensor=sensor)
                for named, lamp in LAMPS.items():
                    shot = Shot(made.shots[0].chart, lamp, corners=made.pose.corners)
                    found[f"{storage}, {named}"] = measure(jvm, before, shot, options.runs, folder)
                    bar.advance(task)
    except (Unavailable, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    finally:
        for each in jvms:
            each.close()
    of = "before" if options.before else "Python"
    rows = [
        (
            name,
            f"{1e3 * one['other_seconds']:.0f}",
            f"{1e3 * one['kotlin_seconds']:.0f}",
            f"{one['ratio']:.2f}",
            "{:.2f} to {:.2f}".format(*one["ratio_10_90"]),
            f"{one['curves_apart']:.0e}",
        )
        for name, one in found.items()
    ]
    head = ("12 megapixels", f"{of} ms", "Kotlin ms", "ratio", "10 to 90 %", "curves apart")
    title = f"Calibration, medians of {options.runs} pairs, warm; bar {BAR} x {of}"
    console().print(table(title, head, rows))
    first, *warm = (seconds for one in found.values() for seconds in one["to_json_seconds"])
    bars = [bar_of(f"{name}, x {of}", one["ratio"], BAR) for name, one in found.items()]
    bars += [
        bar_of("toJson, the first, s", first, JSON_BAR),
        bar_of("toJson, warm, s", statistics.median(warm[WARM:]), JSON_BAR),
        bar_of("a session, s", statistics.median(sessions), SESSION_BAR),
    ]
    console().print(bars_table(bars))
    document = {"versions": versions(), "runs": options.runs, "captures": found, "sessions": sessions, "bars": bars}
    print(save("kotlin_calibrate", document))
    return 0 if all(each["met"] for each in bars) else 1


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
