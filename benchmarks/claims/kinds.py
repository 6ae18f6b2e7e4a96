"""Does a photo do harm where its light is not known?

One photo of each of six phones, solved and judged as `camssf calibrate` does it with a basis of the five others: with
the lamp named by its kind, and not named; beside the mean of the five others, without any photo. Ohta's chart given
as BabelColor's, white and dark frame, noise hypot(0.1 %, 0.0002).

No light set anything: lamps on sale that others measured (the sources of IES TM-30: every fourth LED with
phosphors, every second hybrid one, every third broad and second narrow fluorescent lamp, all bulbs; `pip install
--no-deps luxpy`, under the GPL, brings the table and is read only here), and daylight by the Sun's 5,780 K through
air and haze, sky, and mixtures of both. Apart, without bars, are lights that are named by a kind which does not
describe them: bulbs of neodymium glass, and the Sun so low that it is warmer than the kind reaches.

RMSE of peak-normalised curves, 400 to 700 nm, mean over the lights of a kind; differences with their 95 % interval
over phones (Student's t).
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from scipy.stats import t as student

from benchmarks.captures import Groups, capture, judged
from benchmarks.claim import Run
from benchmarks.devices import OTHERS, phones_left_out
from benchmarks.turns import Unavailable
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_light
from camssf.spectra.bundled import planck
from camssf.spectra.lamps import AUTO
from camssf_lab.learning.training import read_curves

TYPES = {
    "white-led": (("LED Phosphor", 4), ("LED Hybrid", 2)),
    "fluorescent": (("Fluorescent Broadband", 3), ("Fluorescent Narrowband", 2)),
    "bulb": (("Incandescent/Filament", 1),),
}
"""The types of TM-30's sources that are of a kind; of each, every so manieth on sale is taken."""
KIND, UNNAMED = "kind", "unnamed"
FILTERED, LOW_SUN = "bulb, neodymium glass", "daylight, low sun"
CALLED = {FILTERED: "bulb", LOW_SUN: "daylight"}
"""Lights of no kind, and what they are called."""


@cache
def lights() -> dict[str, dict[str, Floats]]:
    """Powers (681,) of mean 1 by kind and name."""
    spec = find_spec("luxpy")
    if spec is None or not spec.submodule_search_locations:
        raise Unavailable("TM-30's sources are missing: pip install --no-deps luxpy (GPL; nothing of it is shipped).")
    folder = Path(spec.submodule_search_locations[0]) / "data" / "spds"
    rows = np.loadtxt(folder / "IESTM30_15_Sspds.dat", delimiter=",")
    named: dict[str, dict[str, Floats]] = {"daylight": daylights()}
    named[LOW_SUN] = {f"sun, air mass {air:g}": sun(air) for air in (4.0, 6.0)}
    with (folder / "IESTM30_15_Sinfo.txt").open(encoding="utf-8") as stream:
        sources = [{key: (word or "").strip() for key, word in row.items() if key} for row in csv.DictReader(stream)]
    for kind, types in TYPES.items():
        own = named[kind] = {}
        for type_, step in types:
            sold = [one for one in sources if (one["type"], one["category"]) == (type_, "Commercial")]
            for one in sold[::step]:
                power = np.interp(WAVELENGTHS, rows[:, 0], rows[:, int(one["nr"])])
                own[f"TM-30 {one['nr']} {one['name']}"] = np.asarray(power / power.mean())
    named[FILTERED] = {name: named["bulb"].pop(name) for name in list(named["bulb"]) if "Neodymium" in name}
    return named


def sun(air: float) -> Floats:
    """Planck's law through air masses of depths 0.008735 λ^-4.08 (air) and 0.1 λ^-1.3 (haze), λ in µm."""
    micrometres = WAVELENGTHS / 1000.0
    power = planck(5780.0) * np.exp(-air * (0.008735 * micrometres**-4.08 + 0.1 * micrometres**-1.3))
    return np.asarray(power / power.mean())


def daylights() -> dict[str, Floats]:
    """Sun, sky, and both."""
    sky = planck(5780.0) * (WAVELENGTHS / 1000.0) ** -3.2
    sky = sky / sky.mean()
    shares = {
        f"sun with {share:.0%} of sky": (1.0 - share) * sun(1.5) + share * sky for share in (0.2, 0.4, 0.6, 0.8)
    }
    return {f"sun, air mass {air:g}": sun(air) for air in (1.0, 1.5, 2.5)} | shares | {"sky": sky}


def interval(by_phone: Sequence[float]) -> tuple[float, float]:
    """Mean and half-width of its 95 % interval."""
    values = np.asarray(by_phone)
    wide = student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    return float(values.mean()), float(wide)


def claim(run: Run) -> None:
    """A row a kind of light."""
    phones, groups = phones_left_out(read_curves(run.phones)), Groups()
    for kind, powers in lights().items():
        for number, phone in enumerate(run.track(phones, kind)):
            with phone.left_out(OTHERS):
                for name, power in powers.items():
                    for way, given in ((KIND, CALLED.get(kind, kind)), (UNNAMED, AUTO)):
                        photo = capture(phone, {name: power}, [read_light(given)], phone.maker, 100 * number + 1)
                        groups.add(judged(photo, phone, {name: power}), kind, way)
    rows = []
    for kind in lights():
        by_kind, unnamed = groups[kind, KIND], groups[kind, UNNAMED]
        own, others = (np.array(group.by_device("rmse")) for group in (by_kind, unnamed))
        worse, half = interval((own - others).tolist())
        over = interval((others - np.array(unnamed.by_device("no_photo"))).tolist())
        accepted, without = unnamed.accepted, unnamed.mean("no_photo") or np.nan
        rows.append((
            kind, (len({one.lamps for one in unnamed}), len(unnamed)), by_kind.rmse, unnamed.rmse, without,
            (worse, half), over, (len(by_kind.accepted), len(accepted)), accepted.mean("rmse"),
            accepted.mean("no_photo"), (by_kind.coverage, unnamed.coverage),
        ))  # fmt: skip
        if kind not in CALLED:
            run.bar(f"{kind}: by kind worse than unnamed, beyond its interval", max(worse - half, 0.0), most=0.0)
            run.bar(f"{kind}: unnamed over no photo", unnamed.rmse / without, most=1.0)
            ratio = accepted.rmse / (accepted.mean("no_photo") or np.nan)
            run.bar(f"{kind}: unnamed and accepted over no photo", ratio, most=1.0)
    columns = {"light": "", "lights, photos": "{}, {}"} | dict.fromkeys(("by kind", "unnamed", "no photo"), ".4f")
    columns |= dict.fromkeys(("kind - unnamed", "unnamed - no photo"), "{:+.4f} ± {:.4f}")
    columns |= {"accepted: by kind, unnamed": "{}, {}", "these unnamed": ".4f", "these, no photo": ".4f"}
    columns |= {"coverage: by kind, unnamed": "{:.3f}, {:.3f}"}
    run.table("Phones left out: RMSE of the curves by kind of light", columns, rows)
