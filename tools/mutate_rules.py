"""A mutation run over data/rules.json: `python -m tools.mutate_rules [--only NAME]`

Every number is changed (times 1.5, times 0.5 or plus and minus 1), every reason given another message. Each mutant is
loaded from a changed copy of the file, and the golden cases, which Kotlin must meet as well, must notice; as outputs
hold the limits, one is noticed that no case's decision is near to. Rival lamps and makers are left out: no case
can hold a photo for each. Survivors that are not among `EQUIVALENT`, each with its reason, give exit status 1.
"""

from __future__ import annotations

import copy
import json
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.shared import command_parser, progress

PLACE = Path(__file__).parents[1] / "reference" / "camssf" / "data" / "rules.json"
STAGES = (
    "verdict", "signals", "mosaic", "patches", "pose", "ssf", "choice", "light", "rivals", "calibrate", "colour",
    "spectrum", "picture",
)  # fmt: skip
"""Stages of golden cases, the quick ones first."""
EQUIVALENT = {
    "calibration.hidden": "the row weighs a millionth of the others at 1000, and no more at 500 or 1500",
    "calibration.faintest": "no sensor gives a signal between half and one and a half millionths of white that is "
    "not lost in noise",
    "calibration.largest_gap": "the gap of an answer is below 1e-10",
    "choice.negligible": "an answer of such a weight changes the mean by less than the cases allow",
    "colour.level": "the distance is the same at every level at which no reflectance comes near 1",
    "pose.darkest": "no printed patch gives so small a signal",
    "pose.patch_pixels": "pictures are reduced by whole numbers, which a pixel more or less changes in few photos",
    "surfaces.narrowest": "no two surfaces of the shipped priors are nearer; it is for a file of one's own",
}
"""Numbers whose mutants no run can tell from the original, each with the reason why."""
Json = dict[str, Any]


def mutants(document: Json) -> Iterator[tuple[str, Json]]:
    """Every mutant of a rules document: what was changed, and the changed copy."""
    for group, entries in document["numbers"].items():
        for word, entry in entries.items():
            value = entry["value"]
            changed = {"+ 1": value + 1, "- 1": value - 1} if isinstance(value, int) else {
                "x 1.5": 1.5 * value, "x 0.5": 0.5 * value,
            }  # fmt: skip
            for how, number in changed.items():
                mutant = copy.deepcopy(document)
                mutant["numbers"][group][word]["value"] = number
                yield f"{group}.{word} {how}", mutant
    keys = [entry["message"] for entry in document["reasons"].values()]
    for name, entry in document["reasons"].items():
        another = copy.deepcopy(document)
        another["reasons"][name]["message"] = keys[keys.index(entry["message"]) - 1]
        yield f"{name}, another message", another


def noticed(file: Path, stages: Sequence[str]) -> str | None:
    """The first golden case that notices the rules of a file, in words; None if none does."""
    for name in [name for name in sys.modules if name.startswith(("camssf", "golden"))]:
        del sys.modules[name]  # loaded anew, with these rules
    import_module("camssf.rules").PLACE = file  # type: ignore[attr-defined]
    try:
        running, reading = import_module("golden.running"), import_module("golden.reading")
    except Exception as error:  # the reader's own, of another class than this process knows
        if type(error).__name__ != "InvalidArgument":
            raise
        return f"the reader: {error}"
    for path in [path for stage in stages for path in reading.paths() if path.parent.name == stage]:
        case = reading.read_case(path)
        try:
            broken = [finding.limit for finding in running.findings(case) if not finding.holds]
        except Exception as error:  # numbers without sense, such as a belief above 1, may end anyhow
            return f"{case['case']}: {type(error).__name__}"
        if broken:
            return f"{case['case']}: {broken[0]}"
    return None


def main() -> int:
    """Run; 1 if a mutant survives without a reason.

    Raises:
        ValueError: the cases fail without any mutant.
    """
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--only", default="", help="mutants whose name begins so")
    only = parser.parse_args().only
    changed = [mutant for mutant in mutants(json.loads(PLACE.read_text("utf-8"))) if mutant[0].startswith(only)]
    alive = []
    with tempfile.TemporaryDirectory() as place, progress() as bar:
        file = Path(shutil.copy(PLACE, place))
        if fault := noticed(file, STAGES):
            raise ValueError(f"The cases fail without any mutant: {fault}")
        for name, document in bar.track(changed, description="mutants"):
            file.write_text(json.dumps(document, ensure_ascii=False), "utf-8")
            if not noticed(file, sorted(STAGES, key=name.partition(".")[0].__ne__)):  # its own stage first
                alive.append(name)
                print(f"{name} survives: {EQUIVALENT.get(name.partition(' ')[0], 'NO REASON')}", flush=True)
    odd = sum(name.partition(" ")[0] not in EQUIVALENT for name in alive)
    print(f"{len(changed) - len(alive)} of {len(changed)} noticed, {len(alive) - odd} equivalent, {odd} survive")
    return int(odd > 0)


if __name__ == "__main__":
    sys.exit(main())
