"""What is a lamp worth that is known only by kind? `python -m benchmarks.claims.lamps [--draws 4] [--phones CSV]`

First the families themselves (spectra/families.py), one lamp left out at a time: by how much of the family's mean it
differs from it (RMS, 400 to 700 nm, both of one mean power there), and how much of that its modes leave at best.

Then the curves: measured cameras, each with a basis learned without its maker, or with `--phones` (CAMSSF_PHONES)
measured phones, each with a basis of the others; patches simulated from Ohta's table
and solved with BabelColor's, 24 of them, noise hypot(0.1 %, 0.0002). The true lamp is drawn: daylight 5,800 ± 900 K,
a bulb 2,700 ± 250 K, or one of the family's CIE lamps, which the family then does not hold; bent by a smooth 2 %. It
is told to the solver as measured ("known"), or by its kind alone ("kind"). RMSE of peak-normalised curves, 400 to
700 nm, and the share of the truth inside the 95 % bands. Under three minutes; exit status 1 where a bar is missed:
daylight by kind at most 1.1 x known; daylight with a white LED by kind better than daylight alone.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from benchmarks.claims.accuracy import LAMP_SMOOTH, LOW, SEEN, score
from benchmarks.claims.phones import CAMERAS, PHONES, each_left_out
from benchmarks.shared import chart, command_parser, console, one_thread, progress, save, table, take_tables, versions
from camssf.fit.capture_fit import lamp_modes
from camssf.grid import Floats
from camssf.recovery.basis import interpolate
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.recovery.hypotheses import LampGuess, recover
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import Called, read_chart, read_lamp, read_light
from camssf.spectra.families import FAMILIES, DrawnKind, LampKind, principal_modes

SETTINGS = (
    ("daylight",),
    ("bulb",),
    ("white-led",),
    ("fluorescent",),
    ("daylight", "bulb"),
    ("daylight", "white-led"),
    ("daylight", "fluorescent"),
    ("bulb", "white-led"),
    ("white-led", "white-led"),
    ("daylight", "bulb", "white-led"),
)
SEED = 7


DRAWN = {
    "daylight": ("D:4800", "D:5500", "D:6500", "D:7500", "D:10000"),
    "white-led": (*(f"LED-B{i}" for i in range(1, 6)), "LED-BH1", "LED-V1", "LED-V2"),
}
"""Lamps that a drawn kind was not made from."""


def draw(kind: str, rng: np.random.Generator) -> tuple[Floats, Called]:
    """The power (681,) of a true lamp, bent by a smooth ripple, and what its kind says of it without it."""
    family, light = FAMILIES[kind], read_light(kind)
    assert isinstance(light, Called)
    if isinstance(family, LampKind):
        name = str(rng.choice(family.members))
        rest = [read_lamp(member).values for member in family.members if member != name]
        mean, modes = principal_modes(rest, family.components)
        (lamp,) = light.lamps
        power = read_lamp(name).values
        light = replace(light, lamps=(replace(lamp, values=mean / mean.mean(), modes=modes),))
    elif isinstance(family, DrawnKind):
        power = read_lamp(str(rng.choice(DRAWN[kind]))).values
    else:
        kelvin = family.centre + family.spread * float(np.clip(rng.normal(), -2.0, 2.0))
        power = read_lamp(f"D:{max(kelvin, 4000.0):.0f}" if kind == "daylight" else f"{kelvin:.0f}K").values
    smooth = smooth_errors(LAMP_CORRELATION)
    ripple = LAMP_SMOOTH * interpolate((smooth @ rng.normal(size=smooth.shape[1]))[:, None])[:, 0]
    return power * np.exp(ripple), light


def by_kind(known: Observation, lights: Sequence[Called]) -> list[LampGuess]:
    """The guesses on the lamps of shots whose kinds alone are known: one for each combination of their shapes."""
    guesses = []
    for choice in product(*(zip(light.lamps, light.log_prior, strict=True) for light in lights)):
        lamps = [lamp for lamp, _ in choice]
        tolerances = np.array([lamp.tolerance for lamp in lamps])
        told = replace(
            known,
            lamp=np.stack([lamp.values for lamp in lamps]),
            lamp_modes=lamp_modes(lamps),
            lamp_tolerance=tolerances,
        )
        guesses.append(LampGuess(tuple(lamp.name for lamp in lamps), told, sum(prior for _, prior in choice)))
    return guesses


def leave_one_out() -> list[dict[str, Any]]:
    """RMS by which a lamp left out differs from its family, relative to it: from its mean, and after its modes."""
    rows = []
    for kind, family in FAMILIES.items():
        before, after = [], []
        if isinstance(family, LampKind):
            cases = [
                (
                    read_lamp(name).values,
                    principal_modes([read_lamp(m).values for m in family.members if m != name], family.components),
                )
                for name in family.members
            ]
        elif isinstance(family, DrawnKind):
            lamp = read_lamp(kind)
            cases = [(read_lamp(name).values, (lamp.values, lamp.modes)) for name in DRAWN[kind]]
        else:
            lamp = read_lamp(kind)
            kelvins = [family.centre + side * family.spread for side in (-1.5, -1.0, 1.0, 1.5)]
            names = [f"D:{k:.0f}" if kind == "daylight" else f"{k:.0f}K" for k in kelvins]
            cases = [(read_lamp(name).values, (lamp.values, lamp.modes)) for name in names]
        for power, (mean, modes) in cases:
            off = (power / power[SEEN].mean() / (mean / mean[SEEN].mean()) - 1.0)[SEEN]
            design = np.concatenate([modes[:, SEEN], np.ones((1, SEEN.sum()))]).T  # a scale of the lamp is free
            left = off - design @ np.linalg.lstsq(design, off, rcond=None)[0]
            before.append(np.sqrt(np.mean(off**2)))
            after.append(np.sqrt(np.mean(left**2)))
        rows.append(
            {
                "family": kind,
                "lamps": len(cases),
                "modes": len(modes),
                "mean": float(np.mean(before)),
                "modes_left": float(np.mean(after)),
                "worst": float(np.max(after)),
            }
        )
    return rows


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--draws", type=int, default=2, help="runs of every camera")
    parser.add_argument("--every", type=int, default=1, help="take every so manieth camera")
    take_tables(parser, "phones")
    options = parser.parse_args(arguments)
    families = leave_one_out()
    out = console()
    out.print(
        table(
            "Families, a lamp left out: RMS relative to the family's mean, 400 to 700 nm",
            ["family", "lamps", "modes", "off the mean", "modes leave", "worst lamp"],
            [
                [
                    r["family"],
                    str(r["lamps"]),
                    str(r["modes"]),
                    f"{r['mean']:.3f}",
                    f"{r['modes_left']:.3f}",
                    f"{r['worst']:.3f}",
                ]
                for r in families
            ],
        )
    )
    cameras, bases = each_left_out(options.phones)
    names = list(cameras)[:: options.every]
    ohta, given = read_chart("classic24:ohta").values, chart()
    rows: list[dict[str, Any]] = []
    with progress() as bar:
        task = bar.add_task("lamps", total=len(SETTINGS) * options.draws * len(names))
        for kinds in SETTINGS:
            rng = np.random.default_rng(SEED)
            runs: dict[str, list[tuple[Floats, Floats | None]]] = {"known": [], "kind": []}
            for _ in range(options.draws):
                for name in names:
                    drawn = [draw(kind, rng) for kind in kinds]
                    true = np.stack([power for power, _ in drawn])
                    y = ((true[:, None, :] * ohta) @ cameras[name]) / (true @ cameras[name])[:, None, :]
                    error = np.hypot(LOW[0] * y, LOW[1])
                    y = y + error * rng.normal(size=y.shape)
                    known = Observation(
                        y, given, true, standard_error=error, lamp_tolerance=[LAMP_SMOOTH] * len(kinds)
                    )
                    ways: dict[str, Observation | list[LampGuess]] = {
                        "known": known,
                        "kind": by_kind(known, [light for _, light in drawn]),
                    }
                    basis = replace(bases[name], name=PHONES if options.phones else CAMERAS)
                    for how, told in ways.items():
                        answer = recover(told, basis=basis, settings=SolverSettings(engine="reference"))
                        runs[how].append(score(answer, cameras[name]))
                    bar.advance(task)
            row: dict[str, Any] = {"lamps": " + ".join(kinds)}
            for how, run in runs.items():
                covered = [np.asarray(c)[:, SEEN].mean() for _, c in run if c is not None]
                row[how] = {"rmse": float(np.mean([e for e, _ in run])), "coverage": float(np.mean(covered))}
            rows.append(row)
    out.print(
        table(
            "Curves: RMSE and coverage of the 95 % bands",
            ["lamps", "known: RMSE", "coverage", "by kind: RMSE", "coverage", "kind / known"],
            [
                [
                    r["lamps"],
                    f"{r['known']['rmse']:.4f}",
                    f"{r['known']['coverage']:.3f}",
                    f"{r['kind']['rmse']:.4f}",
                    f"{r['kind']['coverage']:.3f}",
                    f"{r['kind']['rmse'] / r['known']['rmse']:.2f}",
                ]
                for r in rows
            ],
        )
    )
    found = {r["lamps"]: r for r in rows}
    day, with_led = found["daylight"], found["daylight + white-led"]
    bars = [
        ("daylight by kind over known", day["kind"]["rmse"] / day["known"]["rmse"], 1.1),
        ("daylight + white LED over daylight, by kind", with_led["kind"]["rmse"] / day["kind"]["rmse"], 1.0),
    ]
    for name, value, limit in bars:
        out.print(f"{name}: {value:.3f} (bar {limit:g}): {'held' if value <= limit else 'MISSED'}")
    path = save(
        "lamps-phones" if options.phones else "lamps",
        {"families": families, "rows": rows, "bars": bars, "versions": versions()},
    )
    out.print(f"written: {path}")
    return int(any(value > limit for _, value, limit in bars))


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
