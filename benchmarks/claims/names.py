"""What does the name of a lamp cost if it is wrong?

One photo of each of six phones, solved and judged as `camssf calibrate` does it with a basis of the five others,
under lamps that have their names rightly and wrongly: D50 to D75 in daylight of 5,000 to 8,000 K, and in the Sun and
sky of `kinds`; A under bulbs of 2,400 to 3,200 K; LED-B1 to B5 under LEDs, FL2, FL7 and FL11 under tubes on sale
(TM-30's, as there). The lamp is `called` by the name, which is one hypothesis beside its kind; `said`, as with
`--lamp-tolerance 2%`; or named by its `kind`. Ohta's chart given as BabelColor's, white and dark frame, noise
hypot(0.1 %, 0.0002).

RMSE of peak-normalised curves, 400 to 700 nm; coverage of the blue curve's 95 % band; share of the photos that are
worse than the mean of the five others without any photo; accepted.
"""

from __future__ import annotations

from benchmarks.captures import Groups, capture, judged, power
from benchmarks.claim import Run
from benchmarks.claims.kinds import lights
from benchmarks.devices import OTHERS, phones_left_out
from camssf.grid import Floats
from camssf.spectra import Light, read_lamp, read_light
from camssf.spectra.lights import plain_kind
from camssf_lab.learning.training import read_curves

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


def claim(run: Run) -> None:
    """A row a kind of name and way of telling it."""
    phones, groups = phones_left_out(read_curves(run.phones)), Groups()
    for title, cases in settings().items():
        for number, phone in enumerate(run.track(phones, title)):
            with phone.left_out(OTHERS):
                for name, true, lit in cases:
                    for way, light in ways(name).items():
                        photo = capture(phone, {true: lit}, [light], phone.maker, 100 * number + 1)
                        groups.add(judged(photo, phone, {true: lit}), title, way)
    columns = {"name": "", "given as": "", "photos": "d", "RMSE": ".4f", "worst": ".3f", "no photo": ".4f"}
    columns |= {"blue covered": ".2f", "worse than no photo": ".2f", "accepted": "d", "worst of these": ".3f"}
    worse = {key: group.share(lambda one: one.rmse > one.no_photo) or 0.0 for key, group in groups.items()}
    rows = [
        (*key, len(group), group.rmse, group.worst, group.mean("no_photo"), group.mean("blue"), worse[key],
         len(group.accepted), group.accepted.worst if group.accepted else None)
        for key, group in groups.items()
    ]  # fmt: skip
    run.table("Phones left out: a lamp by name", columns, rows)
    wrong = "D number, wrong", CALLED
    right = [title for title, _ in groups if title.endswith("right")]
    run.bar("D number, wrong: RMSE", groups[wrong].rmse, most=0.029)
    run.bar("D number, wrong: blue covered", groups[wrong].mean("blue") or 0.0, least=0.95)
    run.bar("D number, wrong: worse than no photo", worse[wrong], most=0.1)
    ratio = max(groups[title, CALLED].rmse / groups[title, SAID].rmse for title in right)
    run.bar("right names: RMSE over as said", ratio, most=1.15)
    run.bar("LED-B, another: RMSE", groups["LED-B, another", CALLED].rmse, most=0.036)
    run.bar("FL, another: RMSE", groups["FL, another", CALLED].rmse, most=0.034)
