"""What does the verdict catch, and what does it miss?

Every fault of `benchmarks.faults` in every severity, on captures of measured cameras under several lamps, solved as
the product does it, `auto`, with a basis `cameras` learned without the camera's maker (as in `accuracy`), or on
phones with a basis `phones` learned without the phone's maker. The files name no maker. Each capture has a real
chart and a real lamp: a quarter has the table's own reflectances, a quarter Ohta's, half a chart drawn from the
tolerance that the solver is told; the lamp is off by a smooth 2 %, and by 1 % brighter or darker when the white
frame is taken; the file's colour matrices are off by 3 %. Poses are the true corners, 1 % of a pitch off, but for
faults that concern the search: there it is the search's.

Cameras are split in halves by maker: thresholds were set on the first (`--half tune`), the table is of the second.

A capture is caught if it is refused or doubtful; else it is missed where the fault raised the RMSE of the curves (400
to 700 nm, peak-normalised, mean of R, G, B) by more than 0.03 against the same capture without the fault, and
harmless where not. "Harmful caught" is the share caught of those whose curves are known and harmful; captures that an
earlier stage refused, before there were curves, are not counted in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.claim import Run
from benchmarks.devices import CAMERAS, OTHER_MAKER, Device, measured_cameras, phones_left_out
from benchmarks.faults import FAULTS, SEVERITIES, apply_fault
from benchmarks.staged import HARM, Outcome, Staged, shoot, stage, tried
from camssf_lab.learning.training import read_curves
from camssf_lab.simulation.shot_plan import ShotPlan

OPTIONS = {
    "quick": (False, "two captures a fault instead of eight"),
    "half": ("report", "which makers' cameras: tune or report"),
    "on-phones": (False, "on the measured phones in place of the cameras"),
}
LAMPS = ("D55", "A", "LED-B3", "D65", "FL2", "3200K", "LED-B5", "D:5000")
SEARCHED = {"mirrored", "upside-down", "covered", "wrong-type", "defocus", "motion", "printed", "swapped", "cfa"}
"""Faults that the chart search must face itself."""
TUNE = ("canon", "fujifilm", "arri")
"""Makers of the first half."""


@dataclass
class Tally:
    """Outcomes of one fault and severity, with the RMSE of the same captures without the fault."""

    outcomes: list[Outcome] = field(default_factory=list)
    unspoilt: list[float] = field(default_factory=list)

    def add(self, outcome: Outcome, known: Outcome) -> None:
        """A spoilt capture, and the same one without the fault."""
        assert known.rmse is not None
        self.outcomes.append(outcome)
        self.unspoilt.append(known.rmse)

    def row(self) -> dict[str, Any]:
        """The numbers of the table."""
        harmful = [
            outcome for outcome, clean in zip(self.outcomes, self.unspoilt, strict=True)
            if outcome.rmse is not None and outcome.rmse - clean > HARM
        ]  # fmt: skip
        accepted = [outcome.rmse for outcome in self.outcomes if not outcome.caught and outcome.rmse is not None]
        codes = [code for outcome in self.outcomes for code in dict.fromkeys(outcome.codes)]
        statuses = [outcome.status for outcome in self.outcomes]
        return {
            "captures": len(self.outcomes),
            **{status: statuses.count(status) for status in ("refused", "doubtful", "accepted")},
            "harmful": len(harmful),
            "harmful_caught": sum(outcome.caught for outcome in harmful),
            "missed": sum(not outcome.caught for outcome in harmful),
            "rmse_accepted": float(np.mean(accepted)) if accepted else None,
            "codes": sorted(set(codes), key=lambda code: (-codes.count(code), code)),
        }


def devices_of(run: Run) -> tuple[list[Device], str]:
    """Cameras of one half, or phones, and which of their bases does not know their maker."""
    if run.options.on_phones:
        return phones_left_out(read_curves(run.named("phones"))), OTHER_MAKER
    half = run.options.half == "tune"
    return [camera for camera in measured_cameras() if (camera.maker in TUNE) == half], CAMERAS


def outcome(device: Device, key: str, staged: Staged, plan: ShotPlan, *, search: bool = False) -> Outcome:
    """What becomes of a plan's capture."""
    return tried(lambda: [shoot(staged, plan, search=search)], device.known_by(key), device.curves)


def good_captures(devices: Sequence[Device], key: str, count: int) -> Iterator[tuple[Device, Staged, Outcome]]:
    """Without a fault."""
    for number in range(count):
        device = devices[number % len(devices)]
        lamp = LAMPS[(number // len(devices) * 3 + number) % len(LAMPS)]
        staged = stage(number, device.name, device.curves, lamp)
        yield device, staged, outcome(device, key, staged, staged.setup)


def spoilt(good: Sequence[tuple[Device, Staged, Outcome]], key: str, f: int, name: str, captures: int) -> list[Tally]:
    """A fault in every severity on some of the good captures."""
    tallies = []
    for severity in SEVERITIES:
        tally = Tally()
        for j in range(captures):
            device, staged, known = good[(37 * f + 13 * severity + 29 * j) % len(good)]
            plan = apply_fault(name, severity)(staged.setup)
            tally.add(outcome(device, key, staged, plan, search=name in SEARCHED), known)
        tallies.append(tally)
    return tallies


SAID = {
    "patch": ("chart_unfit.patch", "chart_unfit.dirt"),
    "offset": (
        "glare.gloss", "glare.veil", "glare.darkest_patch", "frames_differ.bright_dark", "frames_differ.black",
    ),
    "white or ceiling": ("frames_differ.white", "overexposed.patches"),
    "uneven": ("uneven_light.light", "uneven_light.lights"),
    "tone": ("not_sensor_raw.tone",),
    "processed": tuple(f"not_sensor_raw.{how}" for how in ("mixed", "demosaiced", "smoothed", "smooth")),
    "light": ("lamp_unfit.rival", "lamp_unfit.tint"),
    "table": ("chart_unfit.table", "chart_unfit.faded"),
    "camera": ("camera_unusual.stranger", "camera_unusual.improbable_curves", "camera_unusual.lamp_residual"),
}  # fmt: skip
"""Groups of causes by the keys of their messages."""


def confusion(tallies: dict[str, list[Tally]]) -> dict[str, Any]:
    """Of what was caught at severities 2 and 3 and has curves: the group of the fault, and of the first reason."""
    group_of = {key: group for group, keys in SAID.items() for key in keys}
    counts: dict[str, dict[str, int]] = {group: {} for group in SAID}
    shares, blamed, others = [], 0, 0
    for name, each in tallies.items():
        right = FAULTS[name].groups
        firsts = [o.first for tally in each[1:] for o in tally.outcomes if o.caught and o.rmse is not None]
        said = [group_of.get(key, "none of them") for key in firsts]
        if not right or not said:
            continue
        for group in said:
            counts[right[0]][group] = counts[right[0]].get(group, 0) + 1
        shares.append(float(np.mean([group in right for group in said])))
        if "light" not in right:
            blamed, others = blamed + said.count("light"), others + len(said)
    return {"counts": counts, "right": float(np.mean(shares)), "light_blamed": blamed, "not_light": others}


def claim(run: Run) -> None:
    """All of it; results/faults.json is the second half's whole run."""
    captures, clean = (2, 26) if run.options.quick else (8, 208)
    devices, key = devices_of(run)
    good = list(run.track(good_captures(devices, key, clean), "good captures"))
    tallies = {name: spoilt(good, key, f, name, captures) for f, name in enumerate(run.track(FAULTS, "faults"))}
    outcomes = [known for _, _, known in good]
    every = outcomes + [one for own in tallies.values() for tally in own for one in tally.outcomes]
    statuses = [outcome.status for outcome in outcomes]
    run.kept = {
        "half": run.options.half,
        "cameras": len(devices),
        "captures_a_fault_and_severity": captures,
        "clean": {
            "captures": len(outcomes),
            **{status: statuses.count(status) for status in ("accepted", "doubtful", "refused")},
            "rmse": float(np.mean([o.rmse for o in outcomes if o.rmse is not None])),
            "reasons": [o.words[0] for o in outcomes if o.caught],
        },
        "coverage": float(np.mean([o.covered for o in every if not o.caught and o.covered is not None])),
        "faults": {name: [tally.row() for tally in own] for name, own in tallies.items()},
        "causes": confusion(tallies),
    }
    show(run, run.kept)
    check(run, run.kept)
    if run.options.on_phones or run.options.quick or run.options.half != "report":
        run.name = "faults-phones" if run.options.on_phones else f"faults-{run.options.half}"


def check(run: Run, found: dict[str, Any]) -> None:
    """The bars."""
    causes, clean, rows = found["causes"], found["clean"], found["faults"].values()
    run.bar("the right cause comes first, mean of the faults", causes["right"], least=0.75)
    blamed = causes["light_blamed"] / max(causes["not_light"], 1)
    run.bar("light blamed for another fault", blamed, most=0.05)
    for severity, least in ((2, 0.90), (3, 0.99)):
        harmful, caught = (sum(row[severity - 1][key] for row in rows) for key in ("harmful", "harmful_caught"))
        run.bar(f"severity {severity}: harmful caught", caught / max(harmful, 1), least=least)
    run.bar("clean captures refused", clean["refused"] / clean["captures"], most=0.01)
    run.bar("clean captures doubtful or refused", 1 - clean["accepted"] / clean["captures"], most=0.05)
    run.bar("coverage of the bands on all that was accepted", found["coverage"], least=0.90)


def show(run: Run, found: dict[str, Any]) -> None:
    """The tables."""
    caught = {"harmful caught": "{} of {}"}
    columns = {"fault": "", "severity": ""} | dict.fromkeys(("refused", "doubtful", "harmless", "missed"), "d")
    run.table(
        f"Faults, {found['cameras']} cameras",
        columns | caught | {"RMSE accepted": ".3f", "codes": ""},
        [
            ("" if at else f"{name}: {FAULTS[name].what}", FAULTS[name].degrees[at], row["refused"], row["doubtful"],
             row["accepted"] - row["missed"], row["missed"], (row["harmful_caught"], row["harmful"]),
             row["rmse_accepted"], ", ".join(row["codes"][:3]))
            for name, own in found["faults"].items() for at, row in enumerate(own)
        ],
    )  # fmt: skip
    clean = found["clean"]
    run.say(
        f"clean: {clean['captures']} captures, {clean['accepted']} accepted, {clean['doubtful']} doubtful, "
        f"{clean['refused']} refused, RMSE {clean['rmse']:.3f}; bands of all accepted cover {found['coverage']:.1%}"
    )
    for words in clean["reasons"]:
        run.say(f"  {words}")
