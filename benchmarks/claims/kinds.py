"""Does a photo do harm where its light is not known? `python -m benchmarks.claims.kinds --phones phones.csv`

One photo of each of six phones, solved and judged as `camssf calibrate` does it with a basis of the five others: with
the lamp named by its kind, and not named; beside the mean of the five others, without any photo. Ohta's chart given
as BabelColor's, white and dark frame, noise hypot(0.1 %, 0.0002).

No light set anything: lamps on sale that others measured (the sources of IES TM-30: every fourth LED with
phosphors, every second hybrid one, every third broad and second narrow fluorescent lamp, all bulbs; `pip install
--no-deps luxpy`, under the GPL, brings the table and is read only here), and daylight by the Sun's 5,780 K through
air and haze, sky, and mixtures of both. Apart, without bars, are lights that are named by a kind which does not
describe them: bulbs of neodymium glass, and the Sun so low that it is warmer than the kind reaches.

RMSE of peak-normalised curves, 400 to 700 nm, mean over the lights of a kind; differences with their 95 % interval
over phones (Student's t). Exit status 1 where a photo by kind is worse than an unnamed one beyond that interval, or
an unnamed one, or those accepted of them, worse than no photo on average. Five minutes.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student

from benchmarks.claims.any_light import Taken, capture, judged
from benchmarks.claims.phones import OTHERS, phones_left_out
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
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_light
from camssf.spectra.bundled import planck
from camssf.spectra.lamps import AUTO
from camssf_lab.learning.training import maker_of, read_curves

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
        raise SystemExit("TM-30's sources are missing: pip install --no-deps luxpy (GPL; nothing of it is shipped).")
    folder = Path(spec.submodule_search_locations[0]) / "data" / "spds"
    rows = np.loadtxt(folder / "IESTM30_15_Sspds.dat", delimiter=",")
    named: dict[str, dict[str, Floats]] = {"daylight": daylights(), LOW_SUN: low_suns()}
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


def low_suns() -> dict[str, Floats]:
    """Before sunset, without any sky."""
    return {f"sun, air mass {air:g}": sun(air) for air in (4.0, 6.0)}


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
    return float(values.mean()), float(
        student.ppf(0.975, len(values) - 1) * values.std(ddof=1) / np.sqrt(len(values))
    )


def row(by_kind: Sequence[Taken], unnamed: Sequence[Taken]) -> dict[str, Any]:
    """What the photos of one kind of light are worth."""
    phones = sorted({one.device for one in unnamed})

    def mean(differences: Sequence[tuple[str, float]]) -> tuple[float, float]:
        return interval([float(np.mean([d for name, d in differences if name == phone])) for phone in phones])

    accepted = [one for one in unnamed if one.status == "accepted"]
    return {
        "lights": len({one.lamps for one in unnamed}),
        "captures": len(unnamed),
        KIND: float(np.mean([one.rmse for one in by_kind])),
        UNNAMED: float(np.mean([one.rmse for one in unnamed])),
        "no_photo": float(np.mean([one.no_photo for one in unnamed])),
        "kind_over_unnamed": mean([(a.device, a.rmse - b.rmse) for a, b in zip(by_kind, unnamed, strict=True)]),
        "unnamed_over_no_photo": mean([(one.device, one.rmse - one.no_photo) for one in unnamed]),
        "accepted": len(accepted),
        "accepted_rmse": float(np.mean([one.rmse for one in accepted])),
        "accepted_no_photo": float(np.mean([one.no_photo for one in accepted])),
        "accepted_kind": sum(one.status == "accepted" for one in by_kind),
        "coverage": [float(np.mean([one.covered for one in ones])) for ones in (by_kind, unnamed)],
    }


def bars(document: dict[str, dict[str, Any]]) -> list[tuple[str, float, float, float]]:
    """Name, value, least and most."""
    limits = []
    for kind, one in document.items():
        if kind in CALLED:
            continue
        worse, half = one["kind_over_unnamed"]
        limits.append((f"{kind}: by kind worse than unnamed, beyond its interval", max(worse - half, 0.0), 0.0, 0.0))
        limits.append((f"{kind}: unnamed over no photo", one[UNNAMED] / one["no_photo"], 0.0, 1.0))
        accepted = one["accepted_rmse"] / one["accepted_no_photo"]
        limits.append((f"{kind}: unnamed and accepted over no photo", accepted, 0.0, 1.0))
    return limits


def show(document: dict[str, dict[str, Any]]) -> None:
    """The table."""
    head = [
        "light", "lights, photos", "by kind", "unnamed", "no photo", "kind - unnamed", "unnamed - no photo",
        "accepted: by kind, unnamed", "these unnamed", "no photo", "coverage: by kind, unnamed",
    ]  # fmt: skip
    lines = [
        [
            kind, f"{one['lights']}, {one['captures']}", f"{one[KIND]:.4f}", f"{one[UNNAMED]:.4f}",
            f"{one['no_photo']:.4f}", *("{:+.4f} ± {:.4f}".format(*one[key]) for key in
            ("kind_over_unnamed", "unnamed_over_no_photo")), f"{one['accepted_kind']}, {one['accepted']}",
            f"{one['accepted_rmse']:.4f}", f"{one['accepted_no_photo']:.4f}",
            "{:.3f}, {:.3f}".format(*one["coverage"]),
        ]
        for kind, one in document.items()
    ]  # fmt: skip
    console().print(table("Phones left out: RMSE of the curves by kind of light", head, lines))


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    options = parse_for_phones(parser, arguments)
    if options is None:
        return 2
    phones = phones_left_out(read_curves(options.phones))
    document: dict[str, dict[str, Any]] = {}
    with progress() as steps:
        for kind, powers in lights().items():
            task, rows = steps.add_task(kind, total=len(phones) * len(powers)), {KIND: [], UNNAMED: []}
            for number, phone in enumerate(phones):
                maker = maker_of(phone.name)
                with standing_in(stands_in(phone, OTHERS)):
                    for name, power in powers.items():
                        for way, given in ((KIND, CALLED.get(kind, kind)), (UNNAMED, AUTO)):
                            photo = capture(phone, {name: power}, [read_light(given)], maker, 100 * number + 1)
                            rows[way].append(judged(photo, phone, {name: power}))
                        steps.advance(task)
            document[kind] = row(rows[KIND], rows[UNNAMED])
    show(document)
    missed = count_missed(bars(document))
    print(f"written: {save('kinds', document | {'versions': versions('scipy')})}")
    return int(missed > 0)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
