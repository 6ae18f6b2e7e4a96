"""What is a lamp worth that is known only by kind?

First the families themselves (spectra/families.py), one lamp left out at a time: by how much of the family's mean it
differs from it (RMS, 400 to 700 nm, both of one mean power there), and how much of that its modes leave at best.

Then the curves: measured cameras, each with a basis learned without its maker, and measured phones, each with a basis
of the others; patches simulated from Ohta's table and solved with BabelColor's, 24 of them, noise hypot(0.1 %,
0.0002). The true lamp is drawn: daylight 5,800 ± 900 K, a bulb 2,700 ± 250 K, or one of the family's CIE lamps, which
the family then does not hold; bent by a smooth 2 %. It is told to the solver as measured ("known"), or by its kind
alone ("kind"). RMSE of peak-normalised curves, 400 to 700 nm, and the share of the truth inside the 95 % bands; "no
photo" is the mean of the basis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from benchmarks.captures import LAMPS, LOW, without
from benchmarks.claim import Run
from benchmarks.devices import (
    BY_OTHERS,
    CAMERAS,
    LEFT_OUT,
    OTHERS,
    SEEN,
    Device,
    measured_cameras,
    no_photo,
    phones_left_out,
    scored,
)
from benchmarks.shared import LAMP_SMOOTH, chart, ripple
from camssf.fit.capture_fit import lamp_modes
from camssf.grid import Floats
from camssf.recovery.hypotheses import LampGuess, recover
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import Called, read_chart, read_lamp, read_light
from camssf.spectra.families import FAMILIES, DrawnKind, LampKind
from camssf_lab.learning.training import read_curves

OPTIONS = {"draws": (2, "runs of every device"), "every": (1, "take every so manieth device")}
SETTINGS = (
    ("daylight",), ("bulb",), ("white-led",), ("fluorescent",), ("daylight", "bulb"), ("daylight", "white-led"),
    ("daylight", "fluorescent"), ("bulb", "white-led"), ("white-led", "white-led"), ("daylight", "bulb", "white-led"),
)  # fmt: skip
SEED = 7
DRAWN = {
    "daylight": LAMPS["daylight"],
    "white-led": (*LAMPS["white-led"], "LED-V2"),
}
"""Lamps that a drawn kind was not made from."""


def draw(kind: str, rng: np.random.Generator) -> tuple[Floats, Called]:
    """The power (681,) of a true lamp, bent by a smooth ripple, and what its kind says of it without it."""
    family, light = FAMILIES[kind], read_light(kind)
    assert isinstance(light, Called)
    if isinstance(family, LampKind):
        name = str(rng.choice(family.members))
        mean, modes = without(family, name)
        (lamp,) = light.lamps
        power = read_lamp(name).values
        light = replace(light, lamps=(replace(lamp, values=mean, modes=modes),))
    elif isinstance(family, DrawnKind):
        power = read_lamp(str(rng.choice(DRAWN[kind]))).values
    else:
        kelvin = family.centre + family.spread * float(np.clip(rng.normal(), -2.0, 2.0))
        power = read_lamp(f"D:{max(kelvin, 4000.0):.0f}" if kind == "daylight" else f"{kelvin:.0f}K").values
    return power * ripple(rng), light


def by_kind(known: Observation, lights: Sequence[Called]) -> list[LampGuess]:
    """The guesses on the lamps of shots whose kinds alone are known: one for each combination of their shapes."""
    guesses = []
    for choice in product(*(zip(light.lamps, light.log_prior, strict=True) for light in lights)):
        lamps = [lamp for lamp, _ in choice]
        told = replace(
            known,
            lamp=np.stack([lamp.values for lamp in lamps]),
            lamp_modes=lamp_modes(lamps),
            lamp_tolerance=np.array([lamp.tolerance for lamp in lamps]),
        )
        guesses.append(LampGuess(tuple(lamp.name for lamp in lamps), told, sum(prior for _, prior in choice)))
    return guesses


def leave_one_out(kind: str) -> tuple[Any, ...]:
    """RMS by which a lamp left out differs from its family, relative to it: from its mean, and after its modes."""
    family = FAMILIES[kind]
    if isinstance(family, LampKind):
        cases = [(name, *without(family, name)) for name in family.members]
    else:
        lamp = read_lamp(kind)
        names = DRAWN.get(kind, ())
        if not isinstance(family, DrawnKind):
            kelvins = [family.centre + side * family.spread for side in (-1.5, -1.0, 1.0, 1.5)]
            names = tuple(f"D:{k:.0f}" if kind == "daylight" else f"{k:.0f}K" for k in kelvins)
        cases = [(name, lamp.values, lamp.modes) for name in names]
    before, after = [], []
    for name, mean, modes in cases:
        power = read_lamp(name).values
        off = (power / power[SEEN].mean() / (mean / mean[SEEN].mean()) - 1.0)[SEEN]
        design = np.concatenate([modes[:, SEEN], np.ones((1, SEEN.sum()))]).T  # a scale of the lamp is free
        left = off - design @ np.linalg.lstsq(design, off, rcond=None)[0]
        before.append(np.sqrt(np.mean(off**2)))
        after.append(np.sqrt(np.mean(left**2)))
    return kind, len(cases), len(cases[0][2]), np.mean(before), np.mean(after), np.max(after)


def measure(kinds: Sequence[str], devices: Sequence[Device], key: str, draws: int) -> tuple[float, ...]:
    """RMSE and coverage with the lamps known, and by kind."""
    rng, ohta = np.random.default_rng(SEED), read_chart("classic24:ohta").values
    scores = []
    for _ in range(draws):
        for device in devices:
            drawn = [draw(kind, rng) for kind in kinds]
            true = np.stack([power for power, _ in drawn])
            y = ((true[:, None, :] * ohta) @ device.curves) / (true @ device.curves)[:, None, :]
            error = np.hypot(LOW[0] * y, LOW[1])
            y = y + error * rng.normal(size=y.shape)
            smooth = [LAMP_SMOOTH] * len(kinds)
            known = Observation(y, chart(), true, standard_error=error, lamp_tolerance=smooth)
            row: list[float] = []
            for told in (known, by_kind(known, [light for _, light in drawn])):
                answer = recover(told, basis=device.known_by(key), settings=SolverSettings(engine="reference"))
                row += scored(answer.peak(), device.curves)
            scores.append(row)
    return tuple(np.mean(scores, axis=0).tolist())


def claim(run: Run) -> None:
    """The families, then the curves of cameras and phones."""
    columns = {"family": "", "lamps": "d", "modes": "d"} | dict.fromkeys(
        ("off the mean", "modes leave", "worst lamp"), ".3f"
    )
    title = "Families, a lamp left out: RMS relative to the family's mean, 400 to 700 nm"
    run.table(title, columns, map(leave_one_out, FAMILIES))
    groups = {LEFT_OUT: (measured_cameras, CAMERAS)} if run.wants(LEFT_OUT) else {}
    if run.options.phones is not None and run.wants(BY_OTHERS):
        groups[BY_OTHERS] = lambda: phones_left_out(read_curves(run.named("phones"))), OTHERS
    columns = {"lamps": ""} | dict.fromkeys(("known: RMSE", "by kind: RMSE", "no photo"), ".4f")
    columns |= dict.fromkeys(("known: coverage", "by kind: coverage"), ".3f") | {"kind / known": ".2f"}
    for title, (make, key) in groups.items():
        devices = make()[:: run.options.every]
        mean = float(np.mean([no_photo(device.bases[key], device.curves) for device in devices]))
        rows = {kinds: measure(kinds, devices, key, run.options.draws) for kinds in run.track(SETTINGS, title)}
        run.table(
            f"{title}: RMSE and coverage of the 95 % bands",
            columns,
            [
                (" + ".join(kinds), known, kind, mean, held, held_, kind / known)
                for kinds, (known, held, kind, held_) in rows.items()
            ],
        )
        known, _, kind, _ = rows[("daylight",)]
        with_led = rows["daylight", "white-led"][2]
        run.bar(f"{title}: daylight by kind over known", kind / known, most=1.1)
        run.bar(f"{title}: daylight + white LED over daylight, by kind", with_led / kind, most=1.0)
