"""What goes wrong in front of a camera and behind it: named faults in three severities, as changes of a `Setup`.

`camssf simulate --fault NAME --severity N` writes them as real DNG files, `python -m benchmarks.faults` counts what
the verdict makes of them. Each fault is honest physics where it can be (light, samples), and a lie in a file or a
wrong word of the user where it is that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS
from camssf.simulation import light, samples
from camssf.simulation.inks import ink_jet_copy
from camssf.simulation.setup import Change, Setup
from camssf.spectra import Lamp, read_chart, read_lamp

SEVERITIES = (1, 2, 3)
OTHERS = {
    "daylight": ("D65", "LED-B3", "A"),
    "bulb": ("2500K", "LED-B1", "D65"),
    "led": ("LED-B4", "D55", "A"),
    "tube": ("FL7", "LED-B3", "A"),
}
"""A lamp of that kind is taken for these: its neighbour, another technique, the opposite colour."""


@dataclass(frozen=True)
class Fault:
    """One way to spoil a shot.

    Attributes:
        name: as the command line takes it.
        what: in words.
        degrees: what each of the three severities is, in words.
        change: the setup's change, by setup and severity 1 to 3.
    """

    name: str
    what: str
    degrees: tuple[str, str, str]
    change: Callable[[Setup, int], Setup]


def strike(name: str, severity: int) -> Change:
    """The change of a setup that a fault is.

    Raises:
        InvalidArgument: no such fault, or a severity other than 1, 2, 3.
    """
    fault = FAULTS.get(name)
    if fault is None:
        raise InvalidArgument(f"No fault is called {name!r}.", f"Choose one of {', '.join(FAULTS)}.")
    if severity not in SEVERITIES:
        raise InvalidArgument(f"There is no severity {severity}.", "Choose 1, 2 or 3; 3 is the worst.")
    found = fault.change
    return lambda setup: found(setup, severity)


def _glare(setup: Setup, severity: int) -> Setup:
    return replace(setup, scene=replace(setup.scene, glare=(0.02, 0.06, 0.2)[severity - 1]))


# exposure, black, frames


def _exposure(setup: Setup, share: float) -> Setup:
    return replace(setup, sensor=replace(setup.sensor, exposure=share))


def _one_channel(setup: Setup, severity: int) -> Setup:
    """One channel's signal of the white as a share of full scale, the brightest of the others at the setup's own."""
    power = setup.lamp.values @ setup.camera.values
    gains = np.array(setup.sensor.gains) * power.max() / power
    wanted = (1.1, 1.8, 4.0)[severity - 1]
    gains[0] *= wanted / setup.sensor.exposure
    sensor = replace(setup.sensor, gains=tuple(gains.tolist()), exposure=wanted)
    return replace(setup, sensor=sensor)


def _ceiling(setup: Setup, severity: int) -> Setup:
    """Samples stop below the white level that the file names."""
    share = (0.75, 0.6, 0.35)[severity - 1] * setup.sensor.exposure / 0.8

    def stop(samples: NDArray[np.uint16], setup: Setup) -> NDArray[np.uint16]:
        top = setup.sensor.black + share * (setup.sensor.white_level - setup.sensor.black)
        return np.minimum(samples, np.uint16(top))

    return replace(setup, samples=stop)


def _range(setup: Setup) -> float:
    return setup.sensor.white_level - setup.sensor.black


def _tagged(setup: Setup, **changes: Any) -> Setup:
    tags = {frame: {**setup.tags.get(frame, {}), **changes} for frame in ("chart", "white", "dark")}
    return replace(setup, tags=tags)


def _without(setup: Setup, *frames: str) -> Setup:
    return replace(setup, handed_in={**setup.handed_in, **dict.fromkeys(frames)})


def _black(setup: Setup, severity: int) -> Setup:
    off = (0.005, 0.02, 0.08)[severity - 1] * _range(setup)
    more = setup.sensor.black + off
    return _without(
        _tagged(replace(setup, sensor=replace(setup.sensor, black=more)), black=setup.sensor.black), "dark"
    )


def _dark_tags(setup: Setup, severity: int) -> Setup:
    factor = (2.0, 8.0, 32.0)[severity - 1]
    off = (0.003, 0.01, 0.04)[severity - 1] * _range(setup)
    tags = {**setup.tags, "dark": {**setup.tags.get("dark", {}), "iso": 100.0 * factor}}
    return replace(setup, dark_offset=off, tags=tags)


def _dark_leak(setup: Setup, severity: int) -> Setup:
    return replace(setup, dark_offset=(0.004, 0.015, 0.06)[severity - 1] * _range(setup))


def _swapped(setup: Setup, severity: int) -> Setup:
    order = (("white", "chart", "dark"), ("chart", "dark", "white"), ("dark", "white", "chart"))[severity - 1]
    return replace(setup, handed_in=dict(zip(("chart", "white", "dark"), order, strict=True)))


def _white_level(setup: Setup, severity: int) -> Setup:
    return replace(setup, white_level=setup.white_level * (0.94, 0.8, 0.5)[severity - 1])


# lamps


def _mixed(lamp: Lamp, other: Lamp, share: float) -> Lamp:
    """`share` of the light comes from the other lamp."""
    values = (1 - share) * lamp.values / lamp.values.mean() + share * other.values / other.values.mean()
    return replace(lamp, values=values, name=f"{lamp.name} + {other.name}")


def _opposite(lamp: Lamp) -> Lamp:
    return read_lamp("A" if _kind(lamp) != "bulb" else "D65")


def _kind(lamp: Lamp) -> str:
    """daylight, bulb, led or tube: by name, else by whether blue or red is stronger."""
    name = lamp.name.casefold().replace(" ", "")
    if name.startswith(("led", "white-led")):
        return "led"
    if name.startswith(("fl", "hp")):
        return "tube"
    if (name.endswith("k") and not name.startswith("d")) or name in ("a", "bulb"):
        return "bulb"
    if name.startswith(("d", "id")):
        return "daylight"
    low, high = (lamp.values[(a <= WAVELENGTHS) & (b >= WAVELENGTHS)].mean() for a, b in ((430, 480), (620, 670)))
    return "daylight" if low > 0.6 * high else "bulb"


def _white_lamp(setup: Setup, severity: int) -> Setup:
    share = (0.2, 0.5, 1.0)[severity - 1]
    return replace(setup, white_lamp=_mixed(setup.lamp, _opposite(setup.lamp), share))


def _wrong_lamp(setup: Setup, severity: int) -> Setup:
    names = OTHERS[_kind(setup.lamp)]
    named = names[severity - 1]
    return replace(setup, stated_lamp=named if named != setup.stated_lamp else names[severity % 3])


def _two_lamps(setup: Setup, severity: int) -> Setup:
    return replace(setup, lamp=_mixed(setup.lamp, _opposite(setup.lamp), (0.1, 0.35, 0.8)[severity - 1]))


def _wall(setup: Setup, severity: int) -> Setup:
    """A red wall near the chart: white paint stained by a step at 590 nm."""
    share = (0.1, 0.4, 1.5)[severity - 1]
    stain = 1 + share / (1 + np.exp(-(WAVELENGTHS - 590) / 12))
    return replace(
        setup, lamp=replace(setup.lamp, values=setup.lamp.values * stain, name=f"{setup.lamp.name}, red wall")
    )


# the chart


def _staged(setup: Setup, **changes: Any) -> Setup:
    return replace(setup, scene=replace(setup.scene, **changes))


def _upside_down(setup: Setup, severity: int) -> Setup:
    turn = (180.0, 90.0, 270.0)[severity - 1]
    return _staged(
        setup, rotation=setup.scene.rotation + turn, fill=setup.scene.fill * (1.0 if severity == 1 else 0.7)
    )


def _mirrored(setup: Setup, severity: int) -> Setup:
    turn = (0.0, 180.0, 90.0)[severity - 1]
    fill = setup.scene.fill * (0.7 if severity == 3 else 1.0)
    return _staged(setup, mirrored=True, rotation=setup.scene.rotation + turn, fill=fill)


def _faded(setup: Setup, severity: int) -> Setup:
    """Years in the sun: colours bleach towards grey, red and magenta dyes first; white yellows."""
    share = (0.05, 0.2, 0.5)[severity - 1]
    values = setup.table.values
    grey = values.mean(axis=1, keepdims=True)
    bleach = share * np.exp(-0.5 * ((WAVELENGTHS - 540) / 70) ** 2)
    yellow = 1 - share * 0.3 / (1 + np.exp((WAVELENGTHS - 440) / 15))
    return replace(setup, table=replace(setup.table, values=(values + bleach * (grey - values)) * yellow))


def _vintage(setup: Setup, severity: int) -> Setup:
    """Another production: as far from the asked table as Ohta's is from BabelColor's, times 1, 2, 4."""
    off = read_chart("classic24:ohta").values - read_chart("classic24").values
    values = np.clip(setup.table.values + (1.0, 2.0, 4.0)[severity - 1] * off, 0.005, 1.0)
    return replace(setup, table=replace(setup.table, values=values))


def _wrong_type(setup: Setup, severity: int) -> Setup:
    """Another chart of four rows and six columns: some of its colours stand elsewhere."""
    order = np.arange(24)
    swaps = ((2, 7), (0, 11), (4, 16), (5, 13), (1, 14), (3, 12), (9, 15), (6, 17))
    for a, b in swaps[: (1, 3, 8)[severity - 1]]:
        order[[a, b]] = order[[b, a]]
    return replace(setup, table=replace(setup.table, values=setup.table.values[order]))


def _printed(setup: Setup, severity: int) -> Setup:
    """An ink-jet copy, to the eye the same colours under D50 as far as three inks go."""
    share = (0.25, 0.6, 1.0)[severity - 1]
    values = (1 - share) * setup.table.values + share * ink_jet_copy(setup.table.values)
    return replace(setup, table=replace(setup.table, values=values))


# the files


def _cfa(setup: Setup, severity: int) -> Setup:
    cfa = setup.sensor.cfa
    rolled = (cfa[::-1], cfa[1] + cfa[0] + cfa[3] + cfa[2], cfa[2:] + cfa[:2])
    return _tagged(setup, cfa=rolled[severity - 1])


def _vignetting(setup: Setup, severity: int) -> Setup:
    return _without(_staged(setup, vignetting=(0.15, 0.4, 0.75)[severity - 1]), "white")


FAULTS: dict[str, Fault] = {
    fault.name: fault
    for fault in (
        Fault("clipped", "chart and white frame overexposed", ("white at 105 % of full scale", "150 %", "300 %"),
              lambda p, s: _exposure(p, (1.05, 1.5, 3.0)[s - 1])),
        Fault("clipped-channel", "one channel overexposed", ("red of white at 110 %", "180 %", "400 %"),
              _one_channel),
        Fault("ceiling", "the sensor clips below the white level in the file",
              ("at 75 % of the range", "60 %", "35 %"), _ceiling),
        Fault("underexposed", "too little light", ("white at 10 % of full scale", "2 %", "0.5 %"),
              lambda p, s: _exposure(p, (0.1, 0.02, 0.005)[s - 1])),
        Fault("black", "the file's black level is too low, no dark frame",
              ("by 0.5 % of the range", "2 %", "8 %"), _black),
        Fault("dark-iso", "the dark frame was taken at another ISO, and says so", ("ISO × 2", "× 8", "× 32"),
              _dark_tags),
        Fault("dark-leak", "light or warmth in the dark frame", ("0.4 % of the range", "1.5 %", "6 %"), _dark_leak),
        Fault("swapped", "frames handed in as each other", ("chart and white", "white and dark", "chart and dark"),
              _swapped),
        Fault("white-lamp", "the white frame was taken under another lamp",
              ("20 % of another", "50 %", "wholly"), _white_lamp),
        Fault("white-level", "the light changed between chart and white frame", ("by 6 %", "20 %", "50 %"),
              _white_level),
        Fault("wrong-lamp", "the lamp is named wrongly",
              ("its neighbour (D65 for D55)", "another technique (LED for D55)", "the opposite (A for D65)"),
              _wrong_lamp),
        Fault("two-lamps", "a second lamp shines on everything", ("10 % of the light", "35 %", "80 %"), _two_lamps),
        Fault("wall", "a red wall colours the light", ("10 % more red", "40 %", "150 %"), _wall),
        Fault("glare", "a veil of stray light over the chart photo", ("2 % of white", "6 %", "20 %"), _glare),
        Fault("specular", "a highlight on one patch", ("6 % of white", "40 %", "300 %"), light.specular),
        Fault("shadow", "a shadow with an edge across the chart", ("5 % darker", "20 %", "60 %"), light.shadow),
        Fault("vignetting", "the lens darkens the corners, no white frame", ("by 15 %", "40 %", "75 %"), _vignetting),
        Fault("shading", "lens shading corrected in the chart photo, not in the white frame",
              ("by 5 % in the corners", "20 %", "60 %"), light.shading),
        Fault("motion", "the camera moved", ("by 10 % of a patch", "35 %", "90 %"), light.motion),
        Fault("defocus", "out of focus", ("σ 5 % of a patch", "15 %", "35 %"), light.defocus),
        Fault("upside-down", "the chart is turned", ("180°", "90°", "270°"), _upside_down),
        Fault("mirrored", "the chart is seen in a mirror", ("upright", "turned by 180°", "by 90°"), _mirrored),
        Fault("covered", "a hand on the chart", ("on a third of two patches", "on four", "on twelve"), light.covered),
        Fault("faded", "an old chart: bleached and yellowed", ("5 %", "20 %", "50 %"), _faded),
        Fault("vintage", "a chart of another production", ("Ohta's table", "twice as far", "four times"), _vintage),
        Fault("wrong-type", "another chart of 4 × 6 colours", ("2 colours elsewhere", "6", "16"), _wrong_type),
        Fault("printed", "an ink-jet copy of the chart", ("25 % of the way", "60 %", "wholly"), _printed),
        Fault("tone-mapped", "a tone curve in the samples", ("γ 0.96", "0.85", "0.5"), samples.tone),
        Fault("demosaiced", "demosaiced, colour-converted, made a mosaic again",
              ("demosaiced alone", "40 % of a display's colours", "a display's colours"), samples.demosaiced),
        Fault("cfa", "a wrong colour order in the files", ("red and blue exchanged", "shifted by a column",
              "by a row"), _cfa),
        Fault("hot-pixels", "hot pixels in all frames", ("0.2 %", "2 %", "12 %"), samples.hot),
        Fault("coarse", "samples quantised", ("to 10 bits", "8", "5"), samples.coarse),
    )
}  # fmt: skip
"""By name."""
