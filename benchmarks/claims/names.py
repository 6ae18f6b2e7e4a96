"""What does the name of a lamp cost if it is wrong? `python -m benchmarks.claims.names --phones phones.csv`

One photo of each of six phones, solved and judged as `camssf calibrate` does it with a basis of the five others,
under lamps that have their names rightly and wrongly: D50 to D75 in daylight of 5,000 to 8,000 K, and in the Sun and
sky of benchmarks.claims.kinds; A under bulbs of 2,400 to 3,200 K; LED-B1 to B5 under LEDs, FL2, FL7 and FL11 under
tubes on sale (TM-30's, as there). The lamp is `called` by the name, which is one hypothesis beside its kind; `said`,
as with `--lamp-tolerance 2%`; or named by its `kind`. Ohta's chart given as BabelColor's, white and dark frame, noise
hypot(0.1 %, 0.0002).

RMSE of peak-normalised curves, 400 to 700 nm; coverage of the blue curve's 95 % band; share of the photos that are
worse than the mean of the five others without any photo; accepted. Exit status 1 where a bar is missed. Six minutes.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.claims.any_light import Taken, capture, judged, power
from benchmarks.claims.kinds import lights
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
from camssf.grid import Floats
from camssf.spectra import Light, read_lamp, read_light
from camssf.spectra.lights import plain_kind
from camssf_lab.learning.training import maker_of, read_curves

CALLED, SAID, KIND = "called", "said", "kind"
D_NUMBERS, KELVINS = ("D50", "D55", "D65", "D75"), (5000, 6000, 7000, 8000)
OF_NUMBER = {"D50": 5003, "D55": 5503, "D65": 6504, "D75": 7504}
LEDS, TUBES = tuple(f"LED-B{i}" for i in range(1, 6)), ("FL2", "FL7", "FL11")
APART = 300
"""K by which a D number is wrong."""


def settings() -> dict[str, list[tuple[str, str, Floats]]]:
    """(name given, true lamp, its power) by title."""
    sold = {kind: list(lights()[kind].items()) for kind in ("daylight", "white-led", "fluorescent")}
    return {
        "D number, right": [(name, name, power(name)) for name in D_NUMBERS],
        "D number, wrong": [
            (name, f"D:{kelvin}", power(f"D:{kelvin}"))
            for name in D_NUMBERS for kelvin in KELVINS if abs(kelvin - OF_NUMBER[name]) > APART
        ],
        "D number, Sun and sky": [
            (D_NUMBERS[i % len(D_NUMBERS)], true, lit) for i, (true, lit) in enumerate(sold["daylight"])
        ],
        "A, right": [("A", "A", power("A"))],
        "A, wrong": [("A", true, power(true)) for true in ("2400K", "2600K", "3000K", "3200K")],
        "LED-B, right": [(name, name, power(name)) for name in LEDS],
        "LED-B, another": [(LEDS[i % 5], true, lit) for i, (true, lit) in enumerate(sold["white-led"][::3])],
        "FL, right": [(name, name, power(name)) for name in TUBES],
        "FL, another": [(TUBES[i % 3], true, lit) for i, (true, lit) in enumerate(sold["fluorescent"][::2])],
    }  # fmt: skip


def ways(name: str) -> dict[str, Light]:
    """The light as the solver is told it."""
    return {CALLED: read_light(name), SAID: read_lamp(name), KIND: read_light(plain_kind(name) or name)}


def row(photos: Sequence[Taken]) -> dict[str, Any]:
    """Means and shares."""
    return {
        "photos": len(photos),
        "rmse": float(np.mean([one.rmse for one in photos])),
        "worst": max(one.rmse for one in photos),
        "blue": float(np.mean([one.blue for one in photos])),
        "worse": float(np.mean([one.rmse > one.no_photo for one in photos])),
        "accepted": sum(one.status == "accepted" for one in photos),
        "accepted_worst": max((one.rmse for one in photos if one.status == "accepted"), default=None),
    }


def bars(document: dict[str, dict[str, dict[str, Any]]]) -> list[tuple[str, float, float, float]]:
    """Name, value, least and most."""
    wrong = document["D number, wrong"][CALLED]
    right = [document[title] for title in document if title.endswith("right")]
    return [
        ("D number, wrong: RMSE", wrong["rmse"], 0.0, 0.029),
        ("D number, wrong: blue covered", wrong["blue"], 0.95, 1.0),
        ("D number, wrong: worse than no photo", wrong["worse"], 0.0, 0.1),
        ("right names: RMSE over as said", max(one[CALLED]["rmse"] / one[SAID]["rmse"] for one in right), 0.0, 1.15),
        ("LED-B, another: RMSE", document["LED-B, another"][CALLED]["rmse"], 0.0, 0.036),
        ("FL, another: RMSE", document["FL, another"][CALLED]["rmse"], 0.0, 0.034),
    ]


def show(document: dict[str, dict[str, dict[str, Any]]]) -> None:
    """The table."""
    head = ["name", "photos", "given as", "RMSE", "worst", "blue covered", "worse than no photo", "accepted", "worst"]
    lines = [
        [
            title, one["photos"], way, f"{one['rmse']:.4f}", f"{one['worst']:.3f}", f"{one['blue']:.2f}",
            f"{one['worse']:.2f}", one["accepted"],
            "" if one["accepted_worst"] is None else f"{one['accepted_worst']:.3f}",
        ]
        for title, rows in document.items() for way, one in rows.items()
    ]  # fmt: skip
    console().print(table("Phones left out: a lamp by name", head, lines))


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    options = parse_for_phones(parser, arguments)
    if options is None:
        return 2
    phones = phones_left_out(read_curves(options.phones))
    document: dict[str, dict[str, dict[str, Any]]] = {}
    with progress() as steps:
        for title, cases in settings().items():
            task, rows = steps.add_task(title, total=len(phones) * len(cases)), {CALLED: [], SAID: [], KIND: []}
            for number, phone in enumerate(phones):
                with standing_in(stands_in(phone, OTHERS)):
                    for name, true, lit in cases:
                        for way, light in ways(name).items():
                            photo = capture(phone, {true: lit}, [light], maker_of(phone.name), 100 * number + 1)
                            rows[way].append(judged(photo, phone, {true: lit}))
                        steps.advance(task)
            document[title] = {way: row(taken) for way, taken in rows.items()}
    show(document)
    missed = count_missed(bars(document))
    print(f"written: {save('names', document | {'versions': versions('scipy')})}")
    return int(missed > 0)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
