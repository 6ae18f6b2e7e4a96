"""What the kernels' benchmarks share: contenders that take turns, warm JVMs, and Kotlin's build."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec

BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", Path(__file__).parents[2] / "android-bindings"))
Arguments = ParamSpec("Arguments")


class Unavailable(Exception):
    """The benchmark cannot run here; the message says what to do."""


def or_unavailable(main: Callable[Arguments, int]) -> Callable[Arguments, int]:
    """The command, with exit status 2 and the reason on stderr where it cannot run here."""

    @wraps(main)
    def command(*arguments: Arguments.args, **options: Arguments.kwargs) -> int:
        try:
            return main(*arguments, **options)
        except subprocess.CalledProcessError as error:
            said = (error.stderr or error.stdout or "").strip().splitlines()
            print(f"{Path(error.cmd[0]).name} failed: {' '.join(said[-3:])}", file=sys.stderr)
        except (Unavailable, OSError) as error:
            print(error, file=sys.stderr)
        return 2

    return command


def clocked(call: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> Callable[[], float]:
    """The call, made to return its seconds."""

    def seconds() -> float:
        start = clock()
        call()
        return clock() - start

    return seconds


def in_turn(contenders: Mapping[str, Callable[[], float]], rounds: int, warm: int = 0) -> dict[str, list[float]]:
    """The seconds of each contender (A B C, A B C ...), without `warm` rounds: a busy machine slows all alike."""
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for turn in range(-warm, rounds):
        for name, call in contenders.items():
            taken = call()
            if turn >= 0:
                seconds[name].append(taken)
    return seconds


def ratio(ours: Sequence[float], theirs: Sequence[float]) -> dict[str, Any]:
    """Median of the ratios turn by turn, and their 10th and 90th percentile."""
    ratios = sorted(a / b for a, b in zip(ours, theirs, strict=True))
    return {
        "ratio": statistics.median(ratios),
        "ratio_10_90": [ratios[len(ratios) // 10], ratios[-1 - len(ratios) // 10]],
    }


def ratio_cells(measured: Mapping[str, Any]) -> tuple[str, str]:
    """The cells "ratio" and "10 to 90 %" of a table."""
    return f"{measured['ratio']:.2f}", "{:.2f} to {:.2f}".format(*measured["ratio_10_90"])


def class_path(bindings: Path = BINDINGS) -> str:
    """The built jars of Kotlin's golden runner, and their libraries."""
    target = bindings / "golden" / "target"
    jars = [jar for jar in target.glob("camssf-golden-*.jar") if not jar.stem.endswith(("-sources", "-javadoc"))]
    if len(jars) != 1 or not (target / "classpath.txt").exists():
        raise Unavailable(f"The jars are missing: run mvn -f {bindings} -DskipTests package.")
    return os.pathsep.join([str(jars[0]), (target / "classpath.txt").read_text("utf-8").strip()])


class Jvm:
    """One warm JVM that answers lines with lines; the command `command` with a heap of so many megabytes."""

    def __init__(self, path: str, *command: str, heap: int = 512) -> None:
        flags = [f"-Xmx{heap}m", "-XX:+UseSerialGC", "-cp", path]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        self.process = subprocess.Popen(["java", *flags, *command], text=True, **pipes)  # type: ignore[call-overload]

    def ask(self, line: str) -> list[str]:
        """The words of its answer."""
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()
        answer: list[str] = self.process.stdout.readline().split()
        if not answer:
            raise Unavailable("The JVM has ended; its error is above.")
        return answer

    def __enter__(self) -> Jvm:
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ends it."""
        self.process.stdin.close()
        self.process.wait()
