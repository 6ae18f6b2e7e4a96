"""What do curves cost where nobody names the light?

Each capture is solved and judged as `camssf calibrate` does it: with the lamp named (`named`), with `--lamp auto`
(`auto`), and with `--lamp auto` where the file has two colour matrices, as a maker might have made them (`matrices`:
fitted by least squares to Munsell colours under A and D65, then each multiplied by I + 3 % noise, so that their
whites are off). One shot with white and dark frame, Ohta's chart given as BabelColor's, noise hypot(0.1 %, 0.0002);
then two shots.

The ordinary lights: daylight of 4,800 to 10,000 K, bulbs of 2,500 to 3,000 K, LED-B1 to B5, BH1 and V1, FL2, FL7 and
FL11 (a CIE lamp is taken out of the table of its kind first), and lights that no kind was made from: sky of 12,000
and 20,000 K, daylight under a tree, and lamps that others measured (colour-science's SDS_LIGHT_SOURCES). Apart
from these: a bulb of neodymium glass.

Phones are solved with a basis of the other phones, and with one of the other makers' phones. RMSE of peak-normalised
curves and coverage of the 95 % bands, 400 to 700 nm, of all captures, refused ones too; "no photo" is the mean phone
of the basis.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.captures import (
    KIND_OF,
    MATRIX_ERROR,
    Group,
    Groups,
    Taken,
    capture,
    judged,
    makers_matrices,
    power,
    unnamed,
)
from benchmarks.claim import Run
from benchmarks.devices import BY_OTHER_MAKER, BY_OTHERS, Population, populations
from camssf.rules import rules
from camssf.spectra import Lamp, read_lamp

OPTIONS = {"matrices-off": (MATRIX_ERROR, "relative error of the colour matrices")}
OWN = {
    "D:12000": "daylight", "D:20000": "daylight", "under a tree": "daylight", "60 A/W (Soft White)": "bulb",
    "Phosphor LED YAG": "white-led", "PHOS-4": "white-led", "Luxeon WW 2880": "white-led",
    "F32T8/TL841 (Triphosphor)": "fluorescent", "F34/CW/RS/EW (Cool White FL)": "fluorescent",
}  # fmt: skip
"""Lights that no kind was made from, and what they are."""
FILTERED = "Neodimium Incandescent"
"""A bulb behind neodymium glass, as colour-science spells it: shown apart, since its kind does not describe it."""
EVERY = dict(sorted((KIND_OF | OWN).items(), key=lambda one: one[0] in OWN))
"""The kind of each light, ordinary ones and own."""
PAIRS = (
    ("D:5500", "2700K"), ("D:6500", "LED-B3"), ("2700K", "LED-B4"), ("D:5500", "FL2"),
    ("D:12000", "Phosphor LED YAG"), ("under a tree", "60 A/W (Soft White)"),
)  # fmt: skip
NAMED, AUTO, MATRICES = "named", "auto", "matrices"
FAR = 0.04
"""RMSE of a phone's curves that are hardly better than no photo."""
SURE = 0.9


def measure(run: Run, population: Population) -> Iterable[tuple[str, Taken]]:
    """What was given, and what came of it, for all devices and lamps."""
    lights = [*((lamp,) for lamp in (*EVERY, FILTERED)), *PAIRS]
    for number, device in enumerate(run.track(population.devices, population.title)):
        with device.left_out(population.key):
            matrices = makers_matrices(device.curves, number, vars(run.options)["matrices_off"])
            for lamps in lights:
                seed = 100 * number + len(lamps)
                powers = {lamp: power(lamp) for lamp in lamps}
                known: list[Lamp] = [replace(read_lamp("E"), name=lamp, values=lit) for lamp, lit in powers.items()]
                nobody = [unnamed(lamp) for lamp in lamps]
                ways: dict[str, tuple[Sequence[Any], Any]] = {
                    NAMED: (known, ()), AUTO: (nobody, ()), MATRICES: (nobody, matrices),
                }  # fmt: skip
                for word, (told, stated) in ways.items():
                    asked = capture(device, powers, told, device.maker, seed, matrices=stated)
                    apart = ", neodymium glass" * (FILTERED in lamps)
                    yield word + ", two" * (len(lamps) - 1) + apart, judged(asked, device, powers)


def is_right(one: Taken) -> bool:
    """Whether the likeliest kind is the light's."""
    return one.kind == EVERY.get(one.lamps[0])


def is_far(one: Taken) -> bool:
    """Whether a photo is worth little."""
    return one.rmse > FAR


def sure_of(group: Group) -> Group:
    """The captures whose light is given a kind with SURE."""
    return group.where(lambda one: bool(one.kinds) and max(one.kinds.values()) > SURE)


def show(run: Run, groups: Groups) -> None:
    """The table of what was given, and what stands behind the rows of one unnamed light."""
    numbers = dict.fromkeys(("RMSE", "no photo"), ".4f") | {"above 0.04": ".2f", "the same, accepted": ".2f"}
    numbers |= {"worst": ".4f", "coverage": ".3f", "worst device": ".3f", "accepted, doubtful, refused": "{}, {}, {}"}
    numbers |= {"> 90 %: right": "{:.3f} of {}"}
    rows = []
    for key, group in groups.items():
        sure = sure_of(group)
        rows.append((
            *key, group.rmse, group.mean("no_photo"), group.share(is_far), group.accepted.share(is_far), group.worst,
            group.coverage, min(group.by_device("covered")), group.counts,
            (sure.share(is_right), len(sure)) if sure else None,
        ))  # fmt: skip
    run.table("The light named, and not named", {"population": "", "given": ""} | numbers, rows)
    one_light = {key: group for key, group in groups.items() if key[1] in (AUTO, MATRICES)}
    by_lamp = [
        (lamp, kind, *(group.where(lambda one, lamp=lamp: one.lamps == (lamp,)).rmse for group in one_light.values()))  # type: ignore[misc]
        for lamp, kind in EVERY.items()
    ]
    run.table("RMSE by light", {"light": "", "kind": ""} | dict.fromkeys(map(", ".join, one_light), ".3f"), by_lamp)
    limit, lines = rules().number("verdict.band_ratio"), []
    for key, group in one_light.items():
        below = group.where(lambda one: (one.band_ratio or 0.0) <= limit)
        above = group.where(lambda one: (one.band_ratio or 0.0) > limit)
        lines.append((*key, len(below) / len(group), below.share(is_far), above.share(is_far)))
    words = ("below the limit", "of these above 0.04", "of the others")
    columns = {"population": "", "given": ""} | dict.fromkeys(words, ".0%")
    run.table("By the width of the band over that without a photo", columns, lines)


def claim(run: Run) -> None:
    """Every population in reach."""
    groups = Groups()
    for population in populations(run, BY_OTHERS, BY_OTHER_MAKER):
        for word, taken in measure(run, population):
            groups.add(taken, population.title, word)
    show(run, groups)
    for title, most, worst in ((BY_OTHERS, 0.030, 0.065), (BY_OTHER_MAKER, 0.038, 0.072)):
        if (title, AUTO) not in groups:
            continue
        auto, known = groups[title, AUTO], groups[title, NAMED]
        run.bar(f"{title}: RMSE", auto.rmse, most=most)
        run.bar(f"{title}: worst capture", auto.worst, most=worst)
        run.bar(f"{title}: accepted above {FAR:g}", auto.accepted.share(is_far) or 0.0, most=0.06)
        if title == BY_OTHERS:
            run.bar(f"{title}: RMSE over the lamp known", auto.rmse / known.rmse, most=1.2)
            run.bar(f"{title}: coverage", auto.coverage, least=0.94, most=0.99)
            run.bar(f"{title}: coverage of the worst phone", min(auto.by_device("covered")), least=0.90)
            right = sure_of(auto).share(is_right)
            run.bar(f"{title}: a kind given 90 % is right", np.nan if right is None else right, least=0.85, most=0.95)
