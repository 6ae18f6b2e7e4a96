"""How often is a clean capture of a phone doubted, and why? `python -m benchmarks.claims.clean --phones phones.csv`

Good captures as `benchmarks.claims.faults` makes them (a chart within its tolerance, a lamp off by a smooth 2 %, a
colour matrix 3 % off), of phones under lamps of 2,000 to 10,000 K and under white LEDs, solved with a basis of the
other phones and judged as `camssf calibrate` does it: the lamp named; not named; not named, and no maker in the file.
An LED is taken out of the table of its kind first where it is not named.

Phones in turn belong to two halves: `poor_pose` and `white_balance_mismatch_unnamed` are set on `tune`. Each doubted
capture is counted under every limit of the rules that it broke. `--offsets` prints instead the reason that is given
if there is no dark frame, and stray light lies over the chart or the file's black level is wrong. `--phones` (or
CAMSSF_PHONES) names the table that may not be passed on, as in benchmarks.claims.phones. Exit status 1 if a bar is
missed: with the maker in the file at most 2 % doubted, none refused.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

from benchmarks.claims.any_light import unnamed
from benchmarks.claims.faults import shoot, stage
from benchmarks.claims.phones import OTHERS, Device, phones_left_out
from benchmarks.claims.wrong_lamps import stands_in
from benchmarks.shared import (
    TABLE,
    command_parser,
    console,
    count_missed,
    one_thread,
    parse_for_phones,
    progress,
    save,
    standing_in,
    table,
    versions,
)
from camssf.calibration import solve
from camssf.errors import CalibrationError
from camssf.options import Options
from camssf.photo.capture import Capture, MeasuredShot
from camssf.spectra import Light, read_chart, read_lamp
from camssf.verdict.reasons import Check, Verdict
from camssf_lab.learning.training import maker_of, read_curves
from camssf_lab.simulation.shot_plan import ShotPlan

BULBS = ("2000K", "2150K", "2300K", "2500K", "2700K", "3000K", "3500K", "4000K")
DAYLIGHT = ("D:4500", "D:5000", "D:5500", "D:6000", "D:6500", "D:7000", "D:7500", "D:8500", "D:10000")
LEDS = ("LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "LED-BH1", "LED-V1", "LED-V2")
LAMPS = (*BULBS, *DAYLIGHT, *LEDS)
NAMED, AUTO, NO_MAKER = "named", "not named", "not named, no maker"
HALVES, ALL = ("tune", "report"), "all"
OFFSETS = (
    *(("stray light", size) for size in (0.02, 0.04, 0.06)),
    *(("black level", size) for size in (-0.01, 0.005, 0.01, 0.02, 0.04, 0.08, 0.11)),
)
"""Of white, and of the sensor's range."""
OFFSET_LAMPS = ("D55", "A", "LED-B3", "2300K", "D:7500", "FL2")
WORDS = {"stray light": "Stray light or a wrong black level adds", "black level": "black level seems wrong"}
MOST_DOUBTED = 0.02


@dataclass(frozen=True)
class Judged:
    """One clean capture.

    Attributes:
        half: of the phone.
        status: of the verdict.
        broken: limits of the rules beyond which it lay, or the code of the stage that refused it.
    """

    half: str
    status: str
    broken: tuple[str, ...]


def judged(shot: MeasuredShot, light: Light, maker: str, model: str, half: str) -> Judged:
    """The product's verdict."""
    shot = replace(shot, lamp=light, photo=replace(shot.photo, make=maker, model=model))
    capture = Capture((shot,), read_chart(TABLE), None)
    try:
        verdict = solve(capture, options=Options(engine="reference")).verdict
        return Judged(half, verdict.status, tuple(check.name for check in verdict.checks if beyond(check)))
    except CalibrationError as error:
        return Judged(half, "refused", tuple(check.name for check in error.checks if beyond(check)) or (error.code,))


def beyond(check: Check) -> bool:
    """Does a number lie beyond its limit?"""
    return check.value > check.limit if check.beyond == "above" else check.value < check.limit


def of_phone(device: Device, number: int, draws: int) -> Iterator[tuple[str, Judged]]:
    """How it was named, and the verdict, under every lamp."""
    maker, half = maker_of(device.name), HALVES[number % 2]
    model = device.name[len(maker) :].strip()
    with standing_in(stands_in(device, OTHERS)):
        for draw in range(draws):
            for at, lamp in enumerate(LAMPS):
                staged = stage(5000 + 1000 * draw + 100 * number + at, device.name, device.curves, lamp)
                shot = shoot(staged, staged.setup, search=False)
                yield NAMED, judged(shot, read_lamp(lamp), maker, model, half)
                yield AUTO, judged(shot, unnamed(lamp), maker, model, half)
                yield NO_MAKER, judged(shot, unnamed(lamp), "", "", half)


def offset(plan: ShotPlan, what: str, size: float, white: bool) -> ShotPlan:
    """No dark frame, and stray light or a black level that the file does not tell; in even light without a white."""
    scene, sensor = plan.scene, plan.sensor
    if not white:
        scene = replace(scene, vignetting=0.4 * scene.vignetting)
    if what == "stray light":
        scene = replace(scene, glare=size)
    levels = {"black": sensor.black}
    if what == "black level":
        sensor = replace(sensor, black=sensor.black + size * (sensor.white_level - sensor.black))
    return replace(
        plan, scene=scene, sensor=sensor, tags=dict.fromkeys(("chart", "white", "dark"), levels),
        handed_in={"chart": "chart", "white": "white" if white else None, "dark": None},
    )  # fmt: skip


def named(verdict: Verdict) -> str:
    """What the first reason says of an offset."""
    first = verdict.reasons[0].message if verdict.reasons else "nothing"
    return next((what for what, words in WORDS.items() if words in first), "another" if verdict.reasons else first)


def offsets_of(device: Device, number: int) -> Iterator[tuple[tuple[str, float, bool], str]]:
    """What lies over the chart, with or without a white frame, and what is named first."""
    maker = maker_of(device.name)
    with standing_in(stands_in(device, OTHERS)):
        for at, lamp in enumerate(OFFSET_LAMPS):
            staged = stage(9000 + 100 * number + at, device.name, device.curves, lamp)
            for (what, size), white in product(OFFSETS, (True, False)):
                shot = shoot(staged, offset(staged.setup, what, size, white), search=False)
                shot = replace(shot, photo=replace(shot.photo, make=maker, model=device.name[len(maker) :].strip()))
                try:
                    verdict = solve(
                        Capture((shot,), read_chart(TABLE), None), options=Options(engine="reference")
                    ).verdict
                except CalibrationError as error:
                    verdict = Verdict("refused", error.reasons)
                yield (what, size, white), named(verdict)


def show_offsets(devices: Sequence[Device]) -> int:
    """The table; exit status 1 where anything but the truth is named."""
    found: dict[tuple[str, float, bool], Counter[str]] = {}
    with progress() as bar:
        task = bar.add_task("offsets", total=len(devices) * len(OFFSET_LAMPS) * len(OFFSETS) * 2)
        for number, device in enumerate(devices):
            for key, word in offsets_of(device, number):
                found.setdefault(key, Counter())[word] += 1
                bar.advance(task)
    lines = [
        [what, f"{size:.1%}", "yes" if white else "no", ", ".join(f"{word} {n}" for word, n in words.items())]
        for (what, size, white), words in found.items()
    ]
    console().print(table("No dark frame", ["what is wrong", "by", "white frame", "named first"], lines))
    return int(any(set(words) - {what, "nothing"} for (what, *_), words in found.items()))


def row(rows: Sequence[Judged]) -> dict[str, Any]:
    """Counts."""
    return {
        "captures": len(rows),
        "doubtful": sum(one.status == "doubtful" for one in rows),
        "refused": sum(one.status == "refused" for one in rows),
        "broken": dict(Counter(name for one in rows for name in one.broken).most_common()),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--draws", type=int, default=1, help="captures of each phone under each lamp")
    parser.add_argument("--offsets", action="store_true", help="what is named without a dark frame instead")
    options = parse_for_phones(parser, arguments)
    if options is None:
        return 2
    devices = phones_left_out(read_curves(options.phones))
    if options.offsets:
        return show_offsets(devices)
    found: dict[str, list[Judged]] = {}
    with progress() as bar:
        task = bar.add_task("captures", total=3 * len(devices) * options.draws * len(LAMPS))
        for number, device in enumerate(devices):
            for word, one in of_phone(device, number, options.draws):
                found.setdefault(word, []).append(one)
                bar.advance(task)
    document = {
        half: {word: row([one for one in rows if half in (one.half, ALL)]) for word, rows in found.items()}
        for half in (*HALVES, ALL)
    }
    lines = [
        [half, word, one["captures"], one["doubtful"], one["refused"],
         ", ".join(f"{name} {count}" for name, count in one["broken"].items())]
        for half, rows in document.items() for word, one in rows.items()
    ]  # fmt: skip
    head = ["half", "the lamp", "captures", "doubtful", "refused", "limits broken"]
    console().print(table("Clean captures of phones left out", head, lines))
    bars = []
    for word in (NAMED, AUTO):
        one = document[ALL][word]
        bars.append((f"{word}: doubted", one["doubtful"] / one["captures"], 0.0, MOST_DOUBTED))
        bars.append((f"{word}: refused", float(one["refused"]), 0.0, 0.0))
    missed = count_missed(bars)
    print(f"written: {save('clean', document | {'versions': versions('scipy')})}")
    return int(missed > 0)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
