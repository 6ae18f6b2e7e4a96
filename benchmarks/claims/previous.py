"""Calibrated once, photographed again: what is it worth? `python -m benchmarks.claims.previous --phones phones.csv`

A unit is calibrated under a named lamp (daylight of 5,200 K, a bulb, a white LED). Later one photo of the same chart is
taken in each of the 18 lamps of `any_light`, once with its lamp named and once not, and solved as
`camssf calibrate --previous` does it; and alone. Captures are those of `any_light`: white and dark frame, Ohta's chart
named as BabelColor's, noise hypot(0.1 %, 0.0002). Phones are solved with a basis of the other phones, and with one of
the other makers' phones.

Then the unit has changed before the later photo: its blue curve has moved by 5 nm to either side, or one of its
flanks; or the lens has yellowed (10 % at 420 nm, smooth). Noticed: the answer is that of the new photo alone, with
the drift as a reason. The limits in data/rules.json were set on every other phone (`set`), and are reported on the
rest.

RMSE of peak-normalised curves and coverage of the 95 % bands, 400 to 700 nm. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchmarks.claims.any_light import KIND_OF, capture, no_photo, unnamed
from benchmarks.claims.phones import OTHER_MAKER, OTHERS, Device, phones_left_out
from benchmarks.claims.accuracy import SEEN
from benchmarks.claims.wrong_lamps import stands_in
from benchmarks.shared import (
    command_parser,
    console,
    count_missed,
    one_thread,
    progress,
    save,
    standing_in,
    table,
    take_tables,
    versions,
)
from camssf.calibration import solve
from camssf.errors import CalibrationError
from camssf.grid import WAVELENGTHS, Floats
from camssf.learning.training import maker_of, read_curves
from camssf.options import Options
from camssf.photo.capture import Capture
from camssf.result import Calibration
from camssf.spectra import Light, read_lamp

BEFORE = ("D:5200", "2856K", "LED-B3")
"""Lamps of the previous result, one after the other."""
STEP = 5.0
"""nm, a drift."""
LOST = 0.1
"""Of the light at 420 nm, in a yellowed lens."""
SAME = "same"


def moved(low: float, high: float) -> Callable[[Floats], Floats]:
    """The blue curve with its short-wave and its long-wave flank moved by so many nm to the red."""

    def change(curves: Floats) -> Floats:
        peak = WAVELENGTHS[curves[:, 2].argmax()]
        below = np.minimum(WAVELENGTHS - low, peak) if low != high else WAVELENGTHS - low
        above = np.maximum(WAVELENGTHS - high, peak) if low != high else WAVELENGTHS - high
        found = curves.copy()
        found[:, 2] = np.interp(np.where(WAVELENGTHS < peak, below, above), WAVELENGTHS, curves[:, 2])
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
        device, before, lamp, named, change: whose; the lamps; whether the later one was named; what had changed.
        drift: the check; None if the answer was refused.
        used: whether the answer is the common one.
        status: of the verdict with the previous result.
        rmse, covered: of the curves as they are now.
        alone: RMSE of the new photo alone; None if that was refused. previous: of the previous result.
        no_photo: RMSE of the mean phone.
    """

    device: str
    before: str
    lamp: str
    named: bool
    change: str
    drift: float | None
    used: bool
    status: str
    rmse: float | None
    covered: float | None
    alone: float | None
    previous: float
    no_photo: float


def solved(given: Capture, previous: Calibration | None = None) -> Calibration | None:
    """The answer; None if refused."""
    try:
        return solve(given, options=Options(engine="reference", previous=previous))
    except CalibrationError as error:
        if error.exit_status == 2:
            raise
        return None


def score(found: Calibration, curves: Floats) -> tuple[float, float]:
    """RMSE and coverage."""
    given, std = found.ssf.peak()
    assert std is not None
    off = (given - curves / curves.max(axis=0))[SEEN]
    return float(np.sqrt(np.mean(off**2, axis=0)).mean()), float((np.abs(off) <= 1.96 * std[SEEN]).mean())


def photo(device: Device, lamp: str, light: Light, seed: int, number: int) -> Capture:
    """One photo, as file number `number`."""
    found = capture(device, [lamp], [light], maker_of(device.name), seed)
    (shot,) = found.shots
    return replace(found, shots=(replace(shot, photo=replace(shot.photo, sha256=f"{number:064d}")),))


def of_device(
    device: Device, key: str, number: int, changes: Sequence[str], tell: Callable[[], None], unframed: bool = False
) -> list[Later]:
    """All later photos of one unit."""
    rows = []
    with standing_in(stands_in(device, key)):
        for i, lamp in enumerate(KIND_OF):
            before = BEFORE[i % len(BEFORE)]
            first = solved(photo(device, before, read_lamp(before), 1000 * number + i, 1))
            assert first is not None
            if first.verdict.status != "accepted":
                continue
            for j, change in enumerate(changes):
                now = replace(device, curves=CHANGES[change](device.curves))
                for named in (True, False):
                    light: Light = read_lamp(lamp) if named else unnamed(lamp)
                    new = photo(now, lamp, light, 1000 * number + 100 * (j + 1) + i, 2)
                    if unframed:
                        (shot,) = new.shots
                        new = replace(new, shots=(replace(shot, white=None, means=replace(shot.means, white=None)),))
                    rows.append(later(now, first, new, Later(
                        device.name, before, lamp, named, change, None, False, "refused", None, None, None,
                        score(first, now.curves)[0], no_photo(now),
                    )))  # fmt: skip
            tell()
    return rows


def later(device: Device, first: Calibration, new: Capture, row: Later) -> Later:
    """One later photo."""
    alone, found = solved(new), solved(new, first)
    if alone is not None:
        row = replace(row, alone=score(alone, device.curves)[0])
    if found is None:
        return row
    drift = [check.value for check in found.verdict.checks if check.name == "unit_drift"]
    rmse, covered = score(found, device.curves)
    return replace(
        row, drift=drift[0] if drift else None, used=len(found.capture.shots) > 1, status=found.verdict.status,
        rmse=rmse, covered=covered,
    )  # fmt: skip
