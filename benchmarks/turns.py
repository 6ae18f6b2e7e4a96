"""Contenders that take turns, warm JVMs, and Kotlin's build."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

BINDINGS = Path(os.environ.get("CAMSSF_BINDINGS", Path(__file__).parents[1] / "android-bindings"))


class Unavailable(Exception):
    """The benchmark cannot run here; the message says what to do."""


def clocked(call: Callable[[], object]) -> Callable[[], float]:
    """The call, made to return its seconds."""

    def seconds() -> float:
        start = time.perf_counter()
        call()
        return time.perf_counter() - start

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


def ratio(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """Median of the ratios turn by turn."""
    return float(np.median(np.divide(ours, theirs)))


def class_path(bindings: Path = BINDINGS) -> str:
    """The built jars of Kotlin's golden runner, and their libraries."""
    target = bindings / "golden" / "target"
    jars = [jar for jar in target.glob("camssf-golden-*.jar") if not jar.stem.endswith(("-sources", "-javadoc"))]
    if len(jars) != 1 or not (target / "classpath.txt").exists():
        raise Unavailable(f"The jars are missing: run mvn -f {bindings} -DskipTests package.")
    return os.pathsep.join([str(jars[0]), (target / "classpath.txt").read_text("utf-8").strip()])


class Jvm:
    """One warm JVM that answers lines with lines; the command `command` with a heap of so many megabytes."""

    def __init__(self, *command: str, heap: int = 512) -> None:
        flags = [f"-Xmx{heap}m", "-XX:+UseSerialGC", "-cp", class_path()]
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
