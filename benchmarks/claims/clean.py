"""How often is a clean capture of a phone doubted, and why?

Good captures as `faults` makes them (a chart within its tolerance, a lamp off by a smooth 2 %, a colour matrix 3 %
off), of phones under lamps of 2,000 to 10,000 K and under white LEDs, solved with a basis of the other phones and
judged as `camssf calibrate` does it: the lamp named; not named; not named, and no maker in the file. An LED is taken
out of the table of its kind first where it is not named.

Phones in turn belong to two halves: `poor_pose` and `white_balance_mismatch_unnamed` are set on `tune`. Each doubted
capture is counted under every limit of the rules that it broke. Bar: with the maker in the file at most 2 % doubted,
none refused.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from benchmarks.captures import unnamed
from benchmarks.claim import Run
from benchmarks.devices import OTHERS, Device, phones_left_out
from benchmarks.staged import answered, by_maker, shoot, stage
from camssf.photo.capture import MeasuredShot
from camssf.spectra import Light, read_lamp
from camssf.verdict.reasons import Check
from camssf_lab.learning.training import read_curves

OPTIONS = {"draws": (1, "captures of each phone under each lamp")}
BULBS = ("2000K", "2150K", "2300K", "2500K", "2700K", "3000K", "3500K", "4000K")
DAYLIGHT = ("D:4500", "D:5000", "D:5500", "D:6000", "D:6500", "D:7000", "D:7500", "D:8500", "D:10000")
LEDS = ("LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "LED-BH1", "LED-V1", "LED-V2")
LAMPS = (*BULBS, *DAYLIGHT, *LEDS)
NAMED, AUTO, NO_MAKER = "named", "not named", "not named, no maker"
HALVES, ALL = ("tune", "report"), "all"


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


def judged(shot: MeasuredShot, light: Light, device: Device, maker: str, half: str) -> Judged:
    """The product's verdict."""
    answer = answered(replace(by_maker(shot, device, maker), lamp=light))
    broken = tuple(check.name for check in answer.checks if beyond(check))
    return Judged(half, answer.status, broken or ((answer.error.code,) if answer.error else ()))


def beyond(check: Check) -> bool:
    """Does a number lie beyond its limit?"""
    return check.value > check.limit if check.beyond == "above" else check.value < check.limit


def of_phone(device: Device, number: int, draws: int) -> Iterator[tuple[str, Judged]]:
    """How it was named, and the verdict, under every lamp."""
    half = HALVES[number % 2]
    with device.left_out(OTHERS):
        for draw, (at, lamp) in product(range(draws), enumerate(LAMPS)):
            staged = stage(5000 + 1000 * draw + 100 * number + at, device.name, device.curves, lamp)
            shot = shoot(staged, staged.setup)
            yield NAMED, judged(shot, read_lamp(lamp), device, device.maker, half)
            yield AUTO, judged(shot, unnamed(lamp), device, device.maker, half)
            yield NO_MAKER, judged(shot, unnamed(lamp), device, "", half)


def claim(run: Run) -> None:
    """Counts by half and by what was told."""
    devices = phones_left_out(read_curves(run.phones))
    found: dict[str, list[Judged]] = {}
    for number, device in enumerate(run.track(devices, "captures")):
        for word, one in of_phone(device, number, run.options.draws):
            found.setdefault(word, []).append(one)
    rows = []
    for half, (word, every) in product((*HALVES, ALL), found.items()):
        own = [one for one in every if half in (one.half, ALL)]
        doubted, refused = (sum(one.status == status for one in own) for status in ("doubtful", "refused"))
        broken = Counter(name for one in own for name in one.broken).most_common()
        rows.append((half, word, len(own), doubted, refused, ", ".join(f"{name} {n}" for name, n in broken)))
        if half == ALL and word != NO_MAKER:
            run.bar(f"{word}: doubted", doubted / len(own), most=0.02)
            run.bar(f"{word}: refused", refused, most=0)
    columns = {"half": "", "the lamp": ""} | dict.fromkeys(("captures", "doubted", "refused"), "d")
    run.table("Clean captures of phones left out", columns | {"limits broken": ""}, rows)
