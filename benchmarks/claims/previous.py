"""Calibrated once, photographed again: what is it worth? `python -m benchmarks.claims.previous --phones phones.csv`

A unit is calibrated under a named lamp: daylight of 5,200 K, a bulb, a white LED in turn. Later there is one photo of
the same chart in each of the 18 lamps of `any_light`, once with its lamp named and once not, solved as `camssf
calibrate --previous` does it, and alone; white LEDs also as the phone's torch (`--lamp torch`), with the error of the
spectrum that is found (RMS over the mean power, 400 to 700 nm) and the coverage of its band. Captures are those of
`any_light`: white and dark frame, Ohta's chart named as BabelColor's, noise hypot(0.1 %, 0.0002), and the raw white
good to 0.3 %. Phones are solved with a basis of the other phones, and with one of the other makers' phones.

Then, with the basis of the others, the unit has changed before the later photo: its blue curve has moved by 5 nm, or
one of its flanks; or the lens has yellowed (10 % at 420 nm, smooth). Noticed: the result is doubtful. The limits in
data/rules.json were set on every other phone, and the rest is reported apart.

RMSE of peak-normalised curves and coverage of the 95 % bands, 400 to 700 nm. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.claims.accuracy import SEEN
from benchmarks.claims.any_light import KIND_OF, capture, no_photo, power, unnamed
from benchmarks.claims.phones import OTHER_MAKER, OTHERS, Device, phones_left_out
from benchmarks.claims.wrong_lamps import stands_in
from benchmarks.shared import (
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
from camssf.grid import WAVELENGTHS, Floats
from camssf.options import Options
from camssf.photo.capture import Capture
from camssf.photo.patches import FrameMeans
from camssf.result import Result
from camssf.spectra import Light, read_lamp, read_light
from camssf.spectra.lamps import TORCH
from camssf_lab.learning.training import maker_of, read_curves

BEFORE = ("D:5200", "2856K", "LED-B3")
"""Lamps of the previous result, one after the other."""
STEP = 5.0
"""nm, a drift."""
LOST = 0.1
"""Of the light at 420 nm, in a yellowed lens."""
SAME = "same"
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
        noticed: whether the verdict says that the unit may have changed.
        status: of the verdict with the previous result.
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
    noticed: bool
    status: str
    rmse: float | None
    covered: float | None
    alone: float | None
    previous: float
    no_photo: float
    light: tuple[float, float, float] | None


def solved(given: Capture, previous: Result | None = None) -> Result | None:
    """The answer; None if refused."""
    try:
        return solve(given, options=Options(engine="reference"), previous=previous)
    except CalibrationError as error:
        if error.exit_status == 2:
            raise
        return None


def score(found: Result, curves: Floats) -> tuple[float, float]:
    """RMSE and coverage."""
    given, std = found.ssf.peak()
    assert std is not None
    off = (given - curves / curves.max(axis=0))[SEEN]
    return float(np.sqrt(np.mean(off**2, axis=0)).mean()), float((np.abs(off) <= 1.96 * std[SEEN]).mean())


def photo(device: Device, lamp: str, light: Light, seed: int, number: int) -> Capture:
    """One photo, as file number `number`."""
    found = capture(device, {lamp: power(lamp)}, [light], maker_of(device.name), seed)
    (shot,) = found.shots
    gain = np.exp(WHITE * np.random.default_rng([seed, number]).normal(size=3))
    means = shot.means

    def seen(frame: FrameMeans | None) -> FrameMeans | None:
        return None if frame is None else replace(frame, mean=means.black + gain * (frame.mean - means.black))

    means = replace(means, chart=seen(means.chart), white=seen(means.white))
    return replace(found, shots=(replace(shot, photo=replace(shot.photo, sha256=f"{number:064d}"), means=means),))


def of_device(device: Device, key: str, number: int, changes: Sequence[str], tell: Callable[[], None]) -> list[Later]:
    """All later photos of one unit."""
    rows = []
    with standing_in(stands_in(device, key)):
        for i, lamp in enumerate(KIND_OF):
            before = BEFORE[i % len(BEFORE)]
            first = solved(photo(device, before, read_lamp(before), 1000 * number + i, 1))
            known = first is not None and first.verdict.status == "accepted"
            for j, change in enumerate(changes if known else ()):
                assert first is not None
                now = replace(device, curves=CHANGES[change](device.curves))
                ways: dict[str, Light] = {NAMED: read_lamp(lamp), UNNAMED: unnamed(lamp)}
                if KIND_OF[lamp] == "white-led" and change == SAME:
                    ways[TORCH] = read_light(TORCH)
                for word, light in ways.items():
                    new = photo(now, lamp, light, 1000 * number + 100 * (j + 1) + i, 2)
                    rows.append(later(now, first, new, change, lamp, word))
            tell()
    return rows


def later(device: Device, first: Result, new: Capture, change: str, lamp: str, given: str) -> Later:
    """One later photo."""
    alone, found = solved(new) if change == SAME else None, solved(new, first)
    rmse, covered = (None, None) if found is None else score(found, device.curves)
    light = None
    used = found is not None and len(found.capture.shots) > 1
    if given == TORCH and alone is not None and used:
        assert found is not None
        light = *light_score(found, lamp), light_score(alone, lamp)[0]
    return Later(
        device.name, lamp, given, change, used, found is not None and found.verdict.status == "doubtful",
        "refused" if found is None else found.verdict.status, rmse, covered,
        None if alone is None else score(alone, device.curves)[0], score(first, device.curves)[0], no_photo(device),
        light,
    )  # fmt: skip


def light_score(found: Result, lamp: str) -> tuple[float, float]:
    """Error and coverage of the first shot's estimated spectrum, both of mean power 1 from 400 to 700 nm."""
    light = found.ssf.lights[0]
    assert light is not None
    level, true = light.power[SEEN].mean(), power(lamp)[SEEN]
    off = light.power[SEEN] / level - true / true.mean()
    return float(np.sqrt(np.mean(off**2))), float((np.abs(off) <= 1.96 * light.std[SEEN] / level).mean())


def row(rows: Sequence[Later]) -> dict[str, Any]:
    """Means of photos of unchanged units."""
    answered = [one for one in rows if one.rmse is not None]
    lights = [one.light for one in rows if one.light is not None]

    def mean(name: str) -> float:
        return float(np.mean([value for one in answered if (value := getattr(one, name)) is not None]))

    return {name: mean(name) for name in ("rmse", "covered", "alone", "previous", "no_photo")} | {
        "photos": len(rows),
        "false_alarms": float(np.mean([one.noticed for one in rows])),
        "used": float(np.mean([one.used for one in rows])),
        "status": {word: sum(one.status == word for one in rows) for word in ("accepted", "doubtful", "refused")},
        "light": np.mean(lights, axis=0).tolist() if lights else None,
    }


def noticed(rows: Sequence[Later]) -> dict[str, float]:
    """Share of changed units that are noticed, by change and by kind of light."""
    by_change = {change: [one for one in rows if one.change == change] for change in CHANGES if change != SAME}
    blue = [one for change in BLUE for one in by_change[change]]
    kinds = {kind: [one for one in blue if KIND_OF[one.lamp] == kind] for kind in dict.fromkeys(KIND_OF.values())}
    shares = by_change | {f"blue ±5 nm, {kind}": each for kind, each in kinds.items()}
    return {name: float(np.mean([one.noticed for one in share])) for name, share in shares.items() if share}


def summary(rows: Sequence[Later]) -> dict[str, Any]:
    """By whether the later lamp was named."""
    document: dict[str, Any] = {}
    for word in (NAMED, UNNAMED, TORCH):
        own = [one for one in rows if one.given == word]
        document[word] = row([one for one in own if one.change == SAME])
        if len(own) > document[word]["photos"]:
            document[word]["noticed"] = noticed(own)
    return document


def bars(document: dict[str, dict[str, Any]]) -> list[tuple[str, float, float, float]]:
    """Name, value, least and most that is wanted."""
    found: list[tuple[str, float, float, float]] = []
    for title, words in document.items():
        auto = words[UNNAMED]
        if REPORTED not in title:
            found.append(
                (f"{title}: not named, RMSE over the previous result", auto["rmse"] / auto["previous"], 0.0, 1.0)
            )
            found.append((f"{title}: coverage", auto["covered"], 0.94, 1.0))
        for word in (NAMED, UNNAMED) if REPORTED in title else ():
            own = words[word]
            share = float(np.mean([own["noticed"][change] for change in BLUE]))
            found.append((f"{title}, {word}: false alarms", own["false_alarms"], 0.0, 0.02))
            found.append((f"{title}, {word}: blue ±5 nm noticed", share, 0.88, 1.0))
    return found


def show(document: dict[str, dict[str, Any]]) -> None:
    """Both tables."""
    names = ("rmse", "alone", "previous", "no_photo", "covered", "used", "false_alarms")
    lines = [
        [title, word, own["photos"], *(f"{own[name]:.4f}" for name in names),
         ", ".join(str(count) for count in own["status"].values())]
        for title, words in document.items()
        for word, own in words.items()
    ]  # fmt: skip
    head = [
        "population", "later lamp", "photos", "the result", "new photo alone", "previous result alone", "no photo",
        "coverage", "common answer", "false alarms", "accepted, doubtful, refused",
    ]  # fmt: skip
    console().print(table("RMSE of the unchanged unit", head, lines))
    lights = [[title, *(f"{part:.3f}" for part in words[TORCH]["light"])] for title, words in document.items()]
    head = ["population", "with both", "coverage", "new photo alone"]
    console().print(table("Spectrum of a white LED given as the torch, RMS over its mean power", head, lights))
    shares = [
        [title, word, *(f"{share:.2f}" for share in own["noticed"].values())]
        for title, words in document.items()
        for word, own in words.items()
        if "noticed" in own
    ]
    if shares:
        first = next(own["noticed"] for words in document.values() for own in words.values() if "noticed" in own)
        console().print(table("Noticed", ["population", "later lamp", *first], shares))


REPORTED = "every other phone"


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--unchanged", action="store_true", help="leave out the units that have changed")
    options = parse_for_phones(parser, arguments)
    if options is None:
        return 2
    devices = phones_left_out(read_curves(options.phones))
    document: dict[str, dict[str, Any]] = {}
    with progress() as bar:
        for key in (OTHERS, OTHER_MAKER):
            changes = tuple(CHANGES) if key == OTHERS and not options.unchanged else (SAME,)
            task = bar.add_task(key, total=len(devices) * len(KIND_OF))
            each = [
                of_device(device, key, number, changes, lambda task=task: bar.advance(task))  # type: ignore[misc]
                for number, device in enumerate(devices)
            ]
            document[f"phones, basis of the {key}"] = summary([one for rows in each for one in rows])
            if len(changes) > 1:
                document[REPORTED] = summary([one for rows in each[1::2] for one in rows])
    show(document)
    missed = count_missed(bars(document))
    print(f"written: {save('previous', document | {'versions': versions('scipy')})}")
    return int(missed > 0)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
