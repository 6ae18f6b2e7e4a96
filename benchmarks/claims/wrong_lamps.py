"""Does the verdict see a lamp that is named wrongly?

Each capture is simulated as samples of a sensor, measured, solved and judged on `auto` as `camssf calibrate` does it:
one shot with white and dark frame, of the chart whose table is told and of Ohta's, under lamps exactly as their
tables. The file has no colour matrix, so that the chart alone can tell. A wrong name harms where the curves are worse
by more than 0.03 RMSE than under the right one.

Phones are solved with a basis of the other phones, and with one of the other makers' phones; cameras with their maker
left out (every sixth of the 52); another laboratory's cameras with both bases as shipped. Each with the file's maker
named, and without.

Bars, each with the maker named: phones, basis of the others: at most 2 % of the clean captures doubted, none refused,
95 % of the harmful names caught; another laboratory's cameras: 85 % caught, the bands of what is accepted cover 92 %,
of the worst camera 80 %.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.captures import model_of
from benchmarks.claim import Run
from benchmarks.devices import BY_OTHER_MAKER, BY_OTHERS, FOREIGN, LEFT_OUT, Device, populations
from benchmarks.staged import HARM, Outcome, shoot, solved, stage
from camssf.photo.capture import MeasuredShot
from camssf.recovery.basis import Basis
from camssf.spectra import read_chart, read_lamp

WRONG = (
    ("A", "LED-BH1"), ("A", "LED-B1"), ("LED-B3", "LED-B4"), ("D55", "D:15000"), ("D65", "A"), ("A", "D55"),
    ("D55", "FL2"), ("FL2", "FL11"), ("LED-B3", "LED-V1"), ("D65", "LED-B3"), ("D55", "LED-B5"), ("FL2", "A"),
    ("bulb", "LED-BH1"), ("bulb", "LED-B1"), ("daylight", "LED-B4"), ("equal-energy", "A"),
)  # fmt: skip
"""Told, true."""
RIGHT = (
    *((lamp, lamp) for lamp in ("D55", "D65", "A", "LED-B3", "FL2")), ("bulb", "A"), ("daylight", "D:5000"),
)  # fmt: skip
CHARTS = ("classic24", "classic24:ohta")


@dataclass(frozen=True)
class Told:
    """One capture, judged.

    Attributes:
        device: whose.
        outcome: of the verdict.
        harm: RMSE beyond that under the right name; 0 where that was told.
    """

    device: str
    outcome: Outcome
    harm: float


def taken(device: Device, light: str, chart: str, number: int) -> MeasuredShot:
    """The chart under that light, measured; its file holds no colour matrix."""
    staged = stage(number, device.name, device.curves, light)
    table = replace(read_chart(chart), name=CHARTS[0])
    shot = shoot(staged, replace(staged.setup, lamp=read_lamp(light), table=table, white_level=1.0))
    return replace(shot, photo=replace(shot.photo, colour_matrices=()))


def judged(shot: MeasuredShot, lamp: str, maker: str, basis: Basis, device: Device) -> Outcome:
    """The verdict of the shot under that name of its lamp; a file that names the maker names the model, too."""
    photo = replace(shot.photo, make=maker, model=model_of(device, maker))
    return solved([replace(shot, photo=photo, lamp=read_lamp(lamp))], basis, device.curves)


def of_device(device: Device, basis: Basis, maker: str, number: int) -> Iterator[Told]:
    """Every right and wrong name, both charts."""
    for chart in CHARTS:
        shots = {light: taken(device, light, chart, number) for _, light in (*RIGHT, *WRONG)}
        right = {light: judged(shot, light, maker, basis, device) for light, shot in shots.items()}
        for lamp, light in RIGHT:
            known = right[light] if lamp == light else judged(shots[light], lamp, maker, basis, device)
            yield Told(device.name, known, 0.0)
        for lamp, light in WRONG:
            outcome, known = judged(shots[light], lamp, maker, basis, device), right[light]
            yield Told(device.name, outcome, (outcome.rmse or np.inf) - (known.rmse or np.inf))


def row(rows: Sequence[Told]) -> dict[str, Any]:
    """Counts."""
    clean = [one for one in rows if one.harm == 0.0]
    accepted: dict[str, list[float]] = {one.device: [] for one in clean}
    for one in clean:
        if not one.outcome.caught and one.outcome.covered is not None:
            accepted[one.device].append(one.outcome.covered)
    harmful = [one.outcome for one in rows if one.harm > HARM]
    statuses = [one.outcome.status for one in clean]
    return {
        "clean: doubtful, refused": (statuses.count("doubtful"), statuses.count("refused"), len(clean)),
        "coverage": np.mean([held for own in accepted.values() for held in own]),
        "worst device": min(np.mean(own or [1.0]) for own in accepted.values()),
        "RMSE": np.mean([one.outcome.rmse for one in clean if one.outcome.rmse is not None]),
        "harmful": len(harmful),
        "caught": sum(one.caught for one in harmful) / max(len(harmful), 1),
        "of these refused": sum(one.status == "refused" for one in harmful),
    }


def claim(run: Run) -> None:
    """A row a population and file."""
    rows = []
    for population in populations(run, BY_OTHERS, BY_OTHER_MAKER, FOREIGN, LEFT_OUT):
        told: dict[str, list[Told]] = {"maker named": [], "no maker": []}
        title = population.title
        for number, device in enumerate(run.track(population.devices, title), 3000):
            basis = device.known_by(population.key)
            for words, own in told.items():
                own += of_device(device, basis, device.maker if words == "maker named" else "", number)
        found = {words: row(own) for words, own in told.items()}
        rows += [(title, words, *one.values()) for words, one in found.items()]
        named = found["maker named"]
        doubted, refused, clean = named["clean: doubtful, refused"]
        if title in (BY_OTHERS, FOREIGN):
            least = 0.95 if title == BY_OTHERS else 0.85
            run.bar(f"{title}: harmful names caught", named["caught"], least=least)
        if title == BY_OTHERS:
            run.bar(f"{title}: clean captures doubted", doubted / clean, most=0.02)
            run.bar(f"{title}: clean captures refused", refused / clean, most=0.0)
        elif title == FOREIGN:
            run.bar(f"{title}: coverage of the accepted", named["coverage"], least=0.92)
            run.bar(f"{title}: the same of the worst camera", named["worst device"], least=0.80)
    columns = {"population": "", "maker": "", "clean: doubtful, refused": "{}, {} of {}", "coverage": ".3f"}
    columns |= {"worst device": ".3f", "RMSE": ".4f", "harmful": "d", "caught": ".1%", "of these refused": "d"}
    run.table("A lamp named rightly, and wrongly", columns, rows)
