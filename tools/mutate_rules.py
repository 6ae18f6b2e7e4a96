"""A mutation run over data/rules.json: `python -m tools.mutate_rules [--only NAME]`

Every number is changed (times 1.5, times 0.5 or plus and minus 1), every reason given another message. Each mutant is
loaded from a changed copy of the file, and the golden cases, which Kotlin must meet as well, must notice. Rival lamps
and makers are left out: no golden case can hold a photo for each of them. Survivors that are not among `EQUIVALENT`,
each with its reason, give exit status 1.
"""

from __future__ import annotations

import argparse
import copy
import json
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.shared import progress

PLACE = Path(__file__).parents[1] / "reference" / "camssf" / "data" / "rules.json"
STAGES = ("verdict", "signals", "patches", "choice", "light", "rivals", "calibrate")
"""Stages of golden cases; those of the first three take a second in all."""
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
        for word, entry in entries.items():
            value = entry["value"]
            changed = {"+ 1": value + 1, "- 1": value - 1} if isinstance(value, int) else {
                "x 1.5": 1.5 * value, "x 0.5": 0.5 * value,
            }  # fmt: skip
            for how, number in changed.items():
                mutant = copy.deepcopy(document)
                mutant["numbers"][group][word]["value"] = number
                yield Mutant(f"{group}.{word} {how}", mutant)
    keys = [entry["message"] for entry in document["reasons"].values()]
    for name, entry in document["reasons"].items():
        another = copy.deepcopy(document)
        another["reasons"][name]["message"] = keys[keys.index(entry["message"]) - 1]
        yield Mutant(f"{name}, another message", another)


@contextmanager
def loaded(file: Path) -> Iterator[None]:
    """camssf and golden anew, with the rules of a file; what stood there before comes back."""
    ours = ("camssf", "golden")
    kept = {name: module for name, module in sys.modules.items() if name.partition(".")[0] in ours}
    for name in kept:
        del sys.modules[name]
    try:
        import_module("camssf.rules").PLACE = file  # type: ignore[attr-defined]
        yield
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] in ours]:
            del sys.modules[name]
        sys.modules.update(kept)


def noticed(file: Path, stages: Sequence[str]) -> str | None:
    """The first golden case that notices the rules of a file, in words; None if none does."""
    with loaded(file):
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


def survivors(found: Sequence[Mutant]) -> list[str]:
    """Names of the mutants that no golden case notices.

    Raises:
        ValueError: the cases fail without any mutant.
    """
    alive = []
    with tempfile.TemporaryDirectory() as place:
        file = Path(shutil.copy(PLACE, place))
        if fault := noticed(file, STAGES):
            raise ValueError(f"The cases fail without any mutant: {fault}")
        with progress() as bar:
            for mutant in bar.track(found, description="mutants"):
                file.write_text(json.dumps(mutant.document, ensure_ascii=False), "utf-8")
                own_first = sorted(STAGES, key=mutant.name.partition(".")[0].__ne__)
                alive += [] if noticed(file, own_first) else [mutant.name]
    return alive


def main(argv: Sequence[str] | None = None) -> int:
    """Run; 1 if a mutant survives without a reason."""
    parser = argparse.ArgumentParser(prog="python -m tools.mutate_rules", description=__doc__)
    parser.add_argument("--only", default="", help="mutants whose name begins so")
    options = parser.parse_args(argv)
    document = json.loads(PLACE.read_text("utf-8"))
    found = [mutant for mutant in mutants(document) if mutant.name.startswith(options.only)]
    alive = survivors(found)
    for name in alive:
        print(f"{name} survives: {EQUIVALENT.get(name, 'NO REASON')}")
    odd = sum(name not in EQUIVALENT for name in alive)
    print(f"{len(found) - len(alive)} of {len(found)} noticed, {len(alive) - odd} equivalent, {odd} survive")
    return int(odd > 0)


if __name__ == "__main__":
    sys.exit(main())
