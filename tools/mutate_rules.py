"""A mutation run over data/rules.json and its two readers: `python -m tools.mutate_rules [--kotlin]`

Every number is changed (times 1.5, times 0.5 or plus and minus 1, and exchanged with its neighbour), every reason
given another message. Each mutant is loaded by the reader itself from a changed
copy of the file, and the golden cases must notice: in this process for Python, in a JVM each for Kotlin's jar. Rival
lamps and makers are left out: no golden case can hold a photo for each of them.
Survivors that are not among `EQUIVALENT`, each with its reason, give exit status 1. Kotlin needs
`mvn -f android-bindings -pl core,model,golden -am package`; without its jar it is skipped, and says so.
"""

from __future__ import annotations

import argparse
import copy
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.shared import console, progress, table
from benchmarks.turns import Unavailable, class_path
from golden.forms import ROOT

PLACE = Path(__file__).parents[1] / "reference" / "camssf" / "data" / "rules.json"
FAULT = 3
"""Exit status of Kotlin's runner where a case does not hold."""
CHEAP = ("verdict", "signals", "patches")
"""Stages whose golden cases take a second in all; the others follow where these notice nothing."""
STAGES = (*CHEAP, "choice", "light", "rivals", "calibrate")
_HIDDEN = "the row weighs a millionth of the others at 1000, and no more at 500 or 1500"
_FAINTEST = "no sensor gives a signal between half and one and a half millionths of white that is not lost in noise"
EQUIVALENT: dict[str, str] = {
    "calibration.hidden x 1.5": _HIDDEN,
    "calibration.hidden x 0.5": _HIDDEN,
    "calibration.faintest x 1.5": _FAINTEST,
    "calibration.faintest x 0.5": _FAINTEST,
}
"""Mutants that no run can tell from the original, each with the reason why."""
Json = dict[str, Any]


@dataclass(frozen=True)
class Mutant:
    """A changed copy of the file: its name says what was changed."""

    name: str
    document: Json


def mutants(document: Json) -> Iterator[Mutant]:
    """Every mutant of a rules document."""
    for group, entries in document["numbers"].items():
        words = list(entries)
        for at, word in enumerate(words):
            value = entries[word]["value"]
            whole = isinstance(value, int)
            changed = {"+ 1": value + 1, "- 1": value - 1} if whole else {"x 1.5": 1.5 * value, "x 0.5": 0.5 * value}
            for how, number in changed.items():
                yield Mutant(f"{group}.{word} {how}", _with(document, (group, word, number)))
            other = words[(at + 1) % len(words)]
            theirs = entries[other]["value"]
            if theirs != value and isinstance(theirs, int) == whole:
                swapped = _with(document, (group, word, theirs), (group, other, value))
                yield Mutant(f"{group}.{word} <> {other}", swapped)
    keys = [entry["message"] for entry in document["reasons"].values()]
    for name, entry in document["reasons"].items():
        another = copy.deepcopy(document)
        another["reasons"][name]["message"] = keys[keys.index(entry["message"]) - 1]
        yield Mutant(f"{name}, another message", another)


def _with(document: Json, *changes: tuple[str, str, float]) -> Json:
    changed = copy.deepcopy(document)
    for group, word, value in changes:
        changed["numbers"][group][word]["value"] = value
    return changed


@contextmanager
def loaded(folder: Path) -> Iterator[None]:
    """camssf and golden anew, with the rules of a folder; what stood there before comes back."""
    ours = ("camssf", "golden")
    kept = {name: module for name, module in sys.modules.items() if name.partition(".")[0] in ours}
    for name in kept:
        del sys.modules[name]
    try:
        import_module("camssf.rules").PLACE = folder / "rules.json"  # type: ignore[attr-defined]
        yield
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] in ours]:
            del sys.modules[name]
        sys.modules.update(kept)


def python(folder: Path, stages: Sequence[str]) -> str | None:
    """The first golden case that notices these rules, in words; None if none does."""
    with loaded(folder):
        try:
            running, reading = import_module("golden.running"), import_module("golden.reading")
        except Exception as error:  # the reader's own, of another class than this process knows
            if type(error).__name__ != "InvalidArgument":
                raise
            return f"the reader: {error}"
        for stage in stages:
            for path in [path for path in reading.paths() if path.parent.name == stage]:
                case = reading.read_case(path)
                try:
                    found = running.findings(case)
                except Exception as error:  # numbers without sense, such as a belief above 1, may end anyhow
                    return f"{case['case']}: {type(error).__name__}"
                for finding in found:
                    if not finding.holds:
                        return f"{case['case']}: {finding.limit}"
    return None


def kotlin(folder: Path, stages: Sequence[str]) -> str | None:
    """The same of Kotlin's jar, the changed file before its own on the class path."""
    place = folder / "org" / "camssf" / "model"
    place.mkdir(parents=True, exist_ok=True)
    content = (folder / "rules.json").read_bytes()
    (place / "rules.json").write_bytes(content)
    (place / "rules.json.sha256").write_text(hashlib.sha256(content).hexdigest(), "ascii")
    done = subprocess.run(
        [
            "java", "-Xmx512m", "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1", "-cp",
            os.pathsep.join([str(folder), class_path()]), "org.camssf.golden.Stages", str(ROOT), *stages,
        ],
        capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    if done.returncode == 0:
        return None
    if done.returncode == FAULT:
        return done.stdout.strip().splitlines()[-1]
    raise Unavailable(f"org.camssf.golden.Stages failed: {done.stderr.strip()[-300:] or done.stdout.strip()[-300:]}")


Reader = Callable[[Path, Sequence[str]], str | None]


def survivors(reader: Reader, found: Sequence[Mutant], stages: Sequence[str], workers: int = 1) -> list[str]:
    """Names of the mutants that the reader's golden cases do not notice.

    Raises:
        Unavailable: the reader cannot run, or its cases fail without any mutant.
    """

    def one(mutant: Mutant) -> tuple[str, bool]:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            (folder / "rules.json").write_text(json.dumps(mutant.document, ensure_ascii=False), "utf-8")
            own_first = sorted(stages, key=lambda stage: not mutant.name.startswith(f"{stage}."))
            return mutant.name, reader(folder, own_first) is None

    with tempfile.TemporaryDirectory() as place:
        shutil.copy(PLACE, place)
        fault = reader(Path(place), stages)
        if fault is not None:
            raise Unavailable(f"The cases fail without any mutant: {fault}")
    with progress() as bar, ThreadPoolExecutor(workers) as pool:
        task = bar.add_task("mutants", total=len(found))
        alive = []
        for name, survives in pool.map(one, found):
            bar.advance(task)
            alive += [name] if survives else []
    return alive


def main(argv: Sequence[str] | None = None) -> int:
    """Run; 1 if a mutant survives without a reason."""
    parser = argparse.ArgumentParser(prog="python -m tools.mutate_rules", description=__doc__)
    parser.add_argument("--kotlin", action="store_true", help="Kotlin's reader, too")
    parser.add_argument("--only", default="", help="mutants whose name begins so")
    options = parser.parse_args(argv)
    document = json.loads(PLACE.read_text("utf-8"))
    found = [mutant for mutant in mutants(document) if mutant.name.startswith(options.only)]
    readers: list[tuple[str, Reader, int]] = [("Python", python, 1)]
    if options.kotlin:
        readers.append(("Kotlin", kotlin, os.cpu_count() or 1))
    rows, unexplained = [], []
    for language, reader, workers in readers:
        try:
            alive = survivors(reader, found, STAGES, workers)
        except Unavailable as error:
            console().print(f"{language}: SKIPPED. {error}")
            continue
        odd = [name for name in alive if name not in EQUIVALENT]
        unexplained += odd
        rows.append([language, len(found) - len(alive), len(found), len(alive) - len(odd), len(odd)])
        for name in alive:
            console().print(f"{language}: {name} survives: {EQUIVALENT.get(name, 'NO REASON')}")
    if rows:
        console().print(table("Mutants of rules.json", ["reader", "killed", "of", "equivalent", "survive"], rows))
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(main())
