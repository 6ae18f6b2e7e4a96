"""Calibrated once, photographed again: what is it worth?

A unit is calibrated under a named lamp: daylight of 5,200 K, a bulb, a white LED in turn. Later there is one photo
of the same chart in each of the 18 ordinary lamps of `any_light`, once with its lamp named and once not, solved as
`camssf calibrate --previous` does it, and alone; white LEDs also as the phone's torch (`--lamp torch`), with the
error of the spectrum that is found (RMS over the mean power, 400 to 700 nm) and the coverage of its band. Captures
are those of `any_light`, and the raw white is good to 0.3 %. Phones are solved with a basis of the other phones, and
with one of the other makers' phones.

Then, with the basis of the others, the unit has changed before the later photo: its blue curve has moved by 5 nm, or
one of its flanks; or the lens has yellowed (10 % at 420 nm, smooth). Noticed: the result is doubtful. The limits in
data/rules.json were set on every other phone, and the rest is reported apart.

RMSE of peak-normalised curves and coverage of the 95 % bands, 400 to 700 nm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.captures import KIND_OF, capture, power, unnamed
from benchmarks.captures import OPTIONS as PRODUCT
from benchmarks.claim import Run
from benchmarks.devices import (
    BY_OTHER_MAKER,
    BY_OTHERS,
    OTHERS,
    PHONES,
    SEEN,
    Device,
    no_photo,
    populations,
    scored,
)
from camssf.calibration import solve
from camssf.errors import CalibrationError
from camssf.grid import BAND, WAVELENGTHS, Floats
from camssf.photo.capture import Capture
from camssf.photo.patches import FrameMeans
from camssf.recovery.basis import read_basis
from camssf.result import Result
from camssf.spectra import Light, read_lamp, read_light
from camssf.spectra.lamps import TORCH

BEFORE = ("D:5200", "2856K", "LED-B3")
"""Lamps of the previous result, one after the other."""
STEP = 5.0
"""nm, a drift."""
LOST = 0.1
"""Of the light at 420 nm, in a yellowed lens."""
SAME, REPORTED = "same", "every other phone"
WHITE = 0.003
"""Relative error of a raw white in each channel."""
NAMED, UNNAMED = "named", "not named"
"""How the later lamp is given; or TORCH."""


def moved(low: float, high: float) -> Callable[[Floats], Floats]:
    """The blue curve with its short-wave and its long-wave flank moved by so many nm to the red."""

    def change(curves: Floats) -> Floats:
        peak = WAVELENGTHS[curves[:, 2].argmax()]
        below = np.minimum(WAVELENGTHS - low, peak) if low != high else WAVELENGTHS - low
        above = np.maximum(WAVELENGTHS - high, peak) if low != high else WAVELENGTHS - high
        found = curves.copy()
        found[:, 2] = np.interp(np.where(peak > WAVELENGTHS, below, above), WAVELENGTHS, curves[:, 2])
        return found

    return change


def yellowed(curves: Floats) -> Floats:
    """Behind a lens that takes LOST of the light at 420 nm and less towards the red."""
    left = 1.0 - LOST * np.exp(-(((WAVELENGTHS - 380.0) / 60.0) ** 2)) / np.exp(-(((420.0 - 380.0) / 60.0) ** 2))
    return np.asarray(curves * left[:, None])


CHANGES: dict[str, Callable[[Floats], Floats]] = {
    SAME: lambda curves: curves,
    "blue +5 nm": moved(STEP, STEP),
    "blue -5 nm": moved(-STEP, -STEP),
    "its long-wave flank +5 nm": moved(0.0, STEP),
    "its long-wave flank -5 nm": moved(0.0, -STEP),
    "its short-wave flank +5 nm": moved(STEP, 0.0),
    "its short-wave flank -5 nm": moved(-STEP, 0.0),
    "lens yellowed": yellowed,
}
BLUE = tuple(name for name in CHANGES if name.startswith("blue"))


@dataclass(frozen=True)
class Later:
    """One later photo, solved with the previous result and alone.

    Attributes:
        device, lamp, given, change: whose; the later lamp, and how it was given; what had changed.
        used: whether the answer is the common one.
        status: of the verdict with the previous result; a doubtful one notices a change.
        rmse, covered: of the curves as they are now; None if refused.
        alone: RMSE of the new photo alone; None if that was refused, or the unit has changed.
        previous: RMSE of the previous result. no_photo: of the mean phone.
        light: error and coverage of the later lamp's spectrum, and its error by the new photo alone; torch only.
    """

    device: str
    lamp: str
    given: str
    change: str
    used: bool
    status: str
    rmse: float | None
    covered: float | None
    alone: float | None
    previous: float
    no_photo: float
    light: tuple[float, float, float] | None


def solved(asked: Capture, previous: Result | None = None) -> Result | None:
    """The answer; None if refused."""
    try:
        return solve(asked, previous=previous, options=PRODUCT)
    except CalibrationError as error:
        if error.exit_status == 2:
            raise
        return None


def photo(device: Device, lamp: str, light: Light, seed: int, number: int) -> Capture:
    """One photo, as file number `number`."""
    asked = capture(device, {lamp: power(lamp)}, [light], device.maker, seed)
    (shot,) = asked.shots
    gain = np.exp(WHITE * np.random.default_rng([seed, number]).normal(size=3))
    means = shot.means

    def seen(frame: FrameMeans | None) -> FrameMeans | None:
        return None if frame is None else replace(frame, mean=means.black + gain * (frame.mean - means.black))

    means = replace(means, chart=seen(means.chart), white=seen(means.white))
    return replace(asked, shots=(replace(shot, photo=replace(shot.photo, sha256=f"{number:064d}"), means=means),))


def of_device(device: Device, number: int, changes: Sequence[str]) -> Iterator[Later]:
    """All later photos of one unit."""
    for i, lamp in enumerate(KIND_OF):
        before = BEFORE[i % len(BEFORE)]
        first = solved(photo(device, before, read_lamp(before), 1000 * number + i, 1))
        if first is None or first.verdict.status != "accepted":
            continue
        for j, change in enumerate(changes):
            now = replace(device, curves=CHANGES[change](device.curves))
            ways: dict[str, Light] = {NAMED: read_lamp(lamp), UNNAMED: unnamed(lamp)}
            if KIND_OF[lamp] == "white-led" and change == SAME:
                ways[TORCH] = read_light(TORCH)
            for word, light in ways.items():
                new = photo(now, lamp, light, 1000 * number + 100 * (j + 1) + i, 2)
                yield later(now, first, new, change, lamp, word)


def later(device: Device, first: Result, new: Capture, change: str, lamp: str, given: str) -> Later:
    """One later photo."""
    alone, found = solved(new) if change == SAME else None, solved(new, first)
    rmse, covered = (None, None) if found is None else scored(found.ssf.peak(), device.curves)
    light = None
    used = found is not None and found.capture is not None and len(found.capture.shots) > 1
    if given == TORCH and alone is not None and found is not None and used:
        light = *light_score(found, lamp), light_score(alone, lamp)[0]
    return Later(
        device.name, lamp, given, change, used, "refused" if found is None else found.verdict.status, rmse, covered,
        None if alone is None else scored(alone.ssf.peak(), device.curves)[0],
        scored(first.ssf.peak(), device.curves)[0],
        no_photo(read_basis(PHONES), device.curves), light,
    )  # fmt: skip


def light_score(found: Result, lamp: str) -> tuple[float, float]:
    """Error and coverage of the first shot's estimated spectrum, both of mean power 1 from 400 to 700 nm."""
    light = found.ssf.lights[0]
    assert light is not None
    level, true = light.power[SEEN].mean(), power(lamp)[SEEN]
    off = light.power[SEEN] / level - true / true.mean()
    return float(np.sqrt(np.mean(off**2))), float((np.abs(off) <= BAND * light.std[SEEN] / level).mean())


def row(rows: Sequence[Later]) -> dict[str, Any]:
    """Means of photos of unchanged units."""
    answered = [one for one in rows if one.rmse is not None]
    statuses = [one.status for one in rows]

    def mean(name: str) -> float:
        return float(np.mean([value for one in answered if (value := getattr(one, name)) is not None]))

    return {
        "photos": len(rows), "the result": mean("rmse"), "new photo alone": mean("alone"),
        "previous result alone": mean("previous"), "no photo": mean("no_photo"), "coverage": mean("covered"),
        "common answer": np.mean([one.used for one in rows]),
        "false alarms": statuses.count("doubtful") / len(rows),
        "accepted, doubtful, refused": tuple(map(statuses.count, ("accepted", "doubtful", "refused"))),
    }  # fmt: skip


def noticed(rows: Sequence[Later]) -> dict[str, float]:
    """Share of changed units that are noticed, by change."""
    by_change = {change: [one for one in rows if one.change == change] for change in CHANGES if change != SAME}
    return {name: float(np.mean([one.status == "doubtful" for one in share])) for name, share in by_change.items()}


def claim(run: Run) -> None:
    """Unchanged units, the torch's spectrum, and changed units."""
    kept: dict[str, list[Later]] = {}
    for population in populations(run, BY_OTHERS, BY_OTHER_MAKER):
        changes = tuple(CHANGES) if population.key == OTHERS else (SAME,)
        units = []
        for number, device in enumerate(run.track(population.devices, population.title)):
            with device.left_out(population.key):
                units.append(list(of_device(device, number, changes)))
        kept[population.title] = [one for unit in units for one in unit]
        if len(changes) > 1:
            kept[REPORTED] = [one for unit in units[1::2] for one in unit]
    same: dict[tuple[str, str], dict[str, Any]] = {}
    lights, shares = [], []
    for title, rows in kept.items():
        for word in (NAMED, UNNAMED, TORCH):
            own = [one for one in rows if one.given == word]
            unchanged = [one for one in own if one.change == SAME]
            same[title, word] = row(unchanged)
            if len(own) > len(unchanged):
                shares.append((title, word, noticed(own)))
        lights.append((title, *np.mean([one.light for one in rows if one.light is not None], axis=0)))
    columns = {"population": "", "later lamp": ""} | dict.fromkeys(next(iter(same.values())), ".4f")
    columns |= {"photos": "d", "accepted, doubtful, refused": "{}, {}, {}"}
    run.table("RMSE of the unchanged unit", columns, [(*key, *own.values()) for key, own in same.items()])
    columns = {"population": ""} | dict.fromkeys(("with both", "coverage", "new photo alone"), ".3f")
    run.table("Spectrum of a white LED given as the torch, RMS over its mean power", columns, lights)
    if shares:
        columns = {"population": "", "later lamp": ""} | dict.fromkeys(shares[0][2], ".2f")
        run.table("Noticed", columns, [(title, word, *share.values()) for title, word, share in shares])
    check(run, same, shares)


def check(run: Run, same: Mapping[tuple[str, str], dict[str, Any]], shares: Any) -> None:
    """The bars."""
    for (title, word), own in same.items():
        if title != REPORTED and word == UNNAMED:
            ratio = own["the result"] / own["previous result alone"]
            run.bar(f"{title}: not named, RMSE over the previous result", ratio, most=1.0)
            run.bar(f"{title}: coverage", own["coverage"], least=0.94)
    for title, word, share in shares:
        if title == REPORTED and word != TORCH:
            run.bar(f"{title}, {word}: false alarms", same[title, word]["false alarms"], most=0.02)
            run.bar(f"{title}, {word}: blue ±5 nm noticed", np.mean([share[name] for name in BLUE]), least=0.88)
