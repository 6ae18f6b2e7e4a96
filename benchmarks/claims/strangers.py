"""Is a camera that no basis knows recognised?

The measured phones, each solved with bases of the other phones (or of the other maker's alone), and changed so that
they are strangers: all curves moved by 8 and 12 nm, widened by 20 %, yellow in green's place (RYYB), a tenth of all
channels in each (RGBW), an infrared cut at 635 nm; and with a chart that has faded. One photo with white and dark
frame, solved and judged as `camssf calibrate` does it, under five lamps, named and not; Ohta's chart with
BabelColor's table, noise hypot(0.1 %, 0.0002). Cameras (every third, maker left out) and another laboratory's, each
with its own maker's name, with a phone maker's, and with none. z(x) and lamp residual: docs/verdict.md, rule 7.

Error: RMSE of peak-normalised curves, 400 to 700 nm, of all captures, refused ones too; coverage of the 95 % bands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.captures import Group, Groups, capture, judged, power, unnamed
from benchmarks.claim import Run
from benchmarks.devices import (
    CAMERAS,
    FOREIGN,
    OTHER_MAKER,
    OTHERS,
    Device,
    foreign_cameras,
    measured_cameras,
    phones_left_out,
    taught,
)
from benchmarks.shared import standing_in
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import Basis
from camssf.spectra import read_chart, read_lamp
from camssf.spectra.charts import faded
from camssf_lab.learning.training import maker_of, read_curves, with_yellow, yellow_for_green

OTHER, UNKNOWN = "as measured, basis of another maker's", "as measured, no maker in the file"
FADED = {"chart faded by 10 %": 0.1, "chart faded by 20 %": 0.2}
"""Mean fading of the chart's patches; each one's own is 0.5 to 1.5 times of it."""
LAMPS = ("D55", "D:7500", "2700K", "LED-B3", "FL2")
PHONE_MAKER = "Apple"
HARM = 0.06
"""RMSE above which an accepted answer of no phone is a failure: a phone's curves never have it."""
Change = Callable[[Floats], Floats]
Stranger = tuple[str, Device, tuple[Basis, ...], str]
"""Title, changed device, bases that do not know it, and maker's name."""


def moved(nm: float) -> Change:
    """All curves moved along the wavelength."""
    return lambda curves: np.stack([np.interp(WAVELENGTHS - nm, WAVELENGTHS, curve) for curve in curves.T], axis=1)


def wider(curves: Floats) -> Floats:
    """Each curve 20 % wider about its centre of gravity."""
    centre = WAVELENGTHS @ curves / curves.sum(axis=0)
    places = centre + (WAVELENGTHS[:, None] - centre) / 1.2
    return np.stack([np.interp(at, WAVELENGTHS, curve) for at, curve in zip(places.T, curves.T, strict=True)], 1)


# The shares of red are none of those that the basis `ryyb` is made with.
STRANGERS: dict[str, Change] = {
    "as measured": lambda curves: curves,
    "8 nm to the red": moved(8),
    "8 nm to the blue": moved(-8),
    "12 nm to the red": moved(12),
    "12 nm to the blue": moved(-12),
    "20 % wider": wider,
    "RYYB, G + 0.4 R": lambda curves: yellow_for_green(curves, 0.4),
    "RYYB, G + 0.85 R": lambda curves: yellow_for_green(curves, 0.85),
    "RGBW": lambda curves: curves + 0.1 * curves.sum(axis=1, keepdims=True),
    "infrared cut at 635 nm": lambda curves: curves / (1.0 + np.exp((WAVELENGTHS - 635.0) / 4.0))[:, None],
}


def known_of(device: Device, key: str, nodes: dict[str, Floats]) -> tuple[Basis, Basis]:
    """The bases `phones` and `ryyb` as all phones but this one, or but its maker's, teach them; (69, 3) by name."""
    others = {
        name: curves
        for name, curves in nodes.items()
        if name != device.name and (key == OTHERS or maker_of(name) != device.maker)
    }
    computed = with_yellow(others)
    return device.known_by(key), taught(computed, list(computed), label="ryyb")


def phones(path: Path) -> Iterator[Stranger]:
    """Each phone, changed and as it is."""
    nodes = read_curves(path)
    for device in phones_left_out(nodes):
        known = known_of(device, OTHERS, nodes)
        for title, change in STRANGERS.items():
            curves = change(device.curves)
            yield title, replace(device, curves=curves / curves.max(axis=0)), known, device.maker
        yield OTHER, device, known_of(device, OTHER_MAKER, nodes), device.maker
        yield UNKNOWN, device, known, ""
        for title in FADED:
            yield title, device, known, device.maker


def cameras(foreign: Path | None) -> Iterator[Stranger]:
    """Each camera under three makers' names."""
    groups = [("cameras", measured_cameras()[::3])]
    groups += [] if foreign is None else [(FOREIGN, foreign_cameras(foreign))]
    for title, devices in groups:
        for device in devices:
            known = (device.known_by(CAMERAS),) if title == "cameras" else ()
            for word, maker in (("", device.maker), (f", says {PHONE_MAKER}", PHONE_MAKER), (", no maker", "")):
                yield title + word, device, known, maker


def faded_chart(fading: float, seed: int) -> Floats:
    """Ohta's chart, faded by about as much: each patch by 0.5 to 1.5 times of it."""
    chart = read_chart("classic24:ohta").values
    own = fading * np.random.default_rng(seed).uniform(0.5, 1.5, len(chart))
    return faded(chart, own[:, None])


def wrong(group: Group) -> int:
    """How many are accepted and wrong."""
    return sum(one.rmse > HARM for one in group.accepted)


def check(run: Run, title: str, named: Group, auto: Group) -> None:
    """The bars of a row."""
    doubted = 1.0 - len(named.accepted) / len(named)
    if title == "as measured":
        run.bar(f"{title}, named: doubted", doubted, most=0.01)
    if title == "chart faded by 20 %":
        for word, group in (("named", named), ("not named", auto)):
            run.bar(f"{title}, {word}: RMSE", group.rmse, most=0.036)
            run.bar(f"{title}, {word}: coverage", group.coverage, least=0.94)
            said = group.share(lambda one: "chart_unfit" in one.codes) or 0.0
            run.bar(f"{title}, {word}: said so", said, least=0.9)
    if title == "20 % wider":
        run.bar(f"{title}, named: not accepted", doubted, least=0.55)
    if title.startswith("RYYB"):
        for word, group, most in (("named", named, 0.030), ("not named", auto, 0.042)):
            run.bar(f"{title}, {word}: RMSE", group.rmse, most=most)
            run.bar(f"{title}, {word}: coverage", group.coverage, least=0.96)
    doubtful = named.where(lambda one: one.status == "doubtful")
    if doubtful and title == "20 % wider":
        run.bar(f"{title}, named: coverage where doubted", doubtful.coverage, least=0.93)
    if title in ("cameras", FOREIGN):
        unusual = named.share(lambda one: "camera_unusual" in one.codes) or 0.0
        run.bar(f"{title}, named: doubted as unusual", unusual, most=0.04)
        run.bar(f"{title}, not named: wrong and accepted", wrong(auto), most=0)


def claim(run: Run) -> None:
    """A row a change and way of telling the light."""
    devices = [*(phones(run.named("phones")) if run.options.phones else ()), *cameras(run.options.foreign)]
    groups = Groups()
    asked = [stranger for stranger in devices if run.wants(stranger[0])]
    for number, (title, device, known, maker) in enumerate(run.track(asked, "strangers")):
        with standing_in(*known):
            for at, lamp in enumerate(LAMPS):
                seed, lit = 100 * number + at, {lamp: power(lamp)}
                chart = faded_chart(FADED.get(title, 0.0), seed)
                for word, light in (("named", read_lamp(lamp)), ("not named", unnamed(lamp))):
                    photo = capture(device, lit, [light], maker, seed, chart)
                    groups.add(judged(photo, device, lit), title, word)
    columns = {"camera": "", "light": ""} | dict.fromkeys(("RMSE", "mean phone, no photo"), ".4f")
    columns |= {"coverage": ".3f", "accepted, doubtful, refused": "{}, {}, {}", "wrong and accepted": "d"}
    columns |= dict.fromkeys(("z(x), median and largest", "lamp residual"), "{:.2f}, {:.2f}") | {"why": ""}
    rows: list[tuple[Any, ...]] = [
        (*key, group.rmse, group.mean("no_photo"), group.coverage, group.counts, wrong(group),
         group.quantiles("length", 0.5, 1.0), group.quantiles("lamp_residual", 0.5, 1.0), group.codes)
        for key, group in groups.items()
    ]  # fmt: skip
    run.table(f"Strangers; wrong: RMSE above {HARM:g}", columns, rows)
    for title in dict.fromkeys(title for title, _ in groups):
        check(run, title, groups[title, "named"], groups[title, "not named"])
