"""Named faults of a shot at three severities, as changes of a `ShotPlan`.

`camssf_lab.simulation.frames.simulate(change=apply_fault(NAME, N))` writes them as real DNG files, and
`python -m benchmarks faults` counts the verdicts on them. Faults of light and samples follow physics;
the others are false tags in a file or false input of the user.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.faults import light, samples
from benchmarks.faults.inks import ink_jet_copy
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import Lamp, read_chart, read_lamp
from camssf_lab.simulation.shot_plan import Change, ShotPlan

SEVERITIES = (1, 2, 3)
OTHERS = {
    "daylight": ("D65", "LED-B3", "A"),
    "bulb": ("2500K", "LED-B1", "D65"),
    "led": ("LED-B4", "D55", "A"),
    "tube": ("FL7", "LED-B3", "A"),
}
"""Wrong lamps for each kind of lamp, by severity: a similar lamp, another technology, the opposite colour."""


@dataclass(frozen=True)
class Fault:
    """One kind of fault.

    Attributes:
        name: its name.
        what: description of the fault.
        degrees, sizes: of the three severities, in words, and as `change` takes them.
        change: returns the changed plan for a plan and a size.
        groups: of causes that a verdict should name, the first, and others that would be right as well; empty where
            no curves are left to judge.
    """

    name: str
    what: str
    degrees: tuple[str, str, str]
    sizes: tuple[Any, Any, Any]
    change: Callable[[ShotPlan, Any], ShotPlan]
    groups: tuple[str, ...] = ()


def apply_fault(name: str, severity: int) -> Change:
    """The change of a shot plan by a fault.

    Raises:
        InvalidArgument: an unknown fault, or a severity other than 1, 2, 3.
    """
    fault = FAULTS.get(name)
    if fault is None:
        raise InvalidArgument(f"No fault is called {name!r}.", f"Choose one of {', '.join(FAULTS)}.")
    if severity not in SEVERITIES:
        raise InvalidArgument(f"There is no severity {severity}.", "Choose 1, 2 or 3; 3 is the worst.")
    change, size = fault.change, fault.sizes[severity - 1]
    return lambda plan: change(plan, size)


# exposure, black, frames


def _exposure(plan: ShotPlan, share: float) -> ShotPlan:
    return replace(plan, sensor=replace(plan.sensor, exposure=share))


def _one_channel(plan: ShotPlan, wanted: float) -> ShotPlan:
    """White overexposed in red, to a share of full scale; green and blue keep the plan's exposure."""
    power = plan.lamp.values @ plan.camera.values
    gains = np.array(plan.sensor.gains) * power.max() / power
    gains[0] *= wanted / plan.sensor.exposure
    sensor = replace(plan.sensor, gains=tuple(gains.tolist()), exposure=wanted)
    return replace(plan, sensor=sensor)


def _ceiling(plan: ShotPlan, size: float) -> ShotPlan:
    """Clip the samples below the white level in the file."""
    share = size * plan.sensor.exposure / 0.8

    def stop(samples: NDArray[np.uint16], plan: ShotPlan) -> NDArray[np.uint16]:
        top = plan.sensor.black + share * (plan.sensor.white_level - plan.sensor.black)
        return np.minimum(samples, np.uint16(top))

    return replace(plan, samples=stop)


def _range(plan: ShotPlan) -> float:
    return plan.sensor.white_level - plan.sensor.black


def _tagged(plan: ShotPlan, **changes: Any) -> ShotPlan:
    tags = {frame: {**plan.tags.get(frame, {}), **changes} for frame in ("chart", "white", "dark")}
    return replace(plan, tags=tags)


def _without(plan: ShotPlan, *frames: str) -> ShotPlan:
    return replace(plan, handed_in={**plan.handed_in, **dict.fromkeys(frames)})


def _black(plan: ShotPlan, size: float) -> ShotPlan:
    off = size * _range(plan)
    more = plan.sensor.black + off
    return _without(_tagged(replace(plan, sensor=replace(plan.sensor, black=more)), black=plan.sensor.black), "dark")


def _dark_tags(plan: ShotPlan, size: tuple[float, float]) -> ShotPlan:
    factor, share = size
    off = share * _range(plan)
    tags = {**plan.tags, "dark": {**plan.tags.get("dark", {}), "iso": 100.0 * factor}}
    return replace(plan, dark_offset=off, tags=tags)


def _swapped(plan: ShotPlan, order: tuple[str, ...]) -> ShotPlan:
    return replace(plan, handed_in=dict(zip(("chart", "white", "dark"), order, strict=True)))


# lamps


def _mixed(lamp: Lamp, other: Lamp, share: float) -> Lamp:
    """A lamp with `share` of its light from another lamp."""
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


def _wrong_lamp(plan: ShotPlan, which: int) -> ShotPlan:
    names = OTHERS[_kind(plan.lamp)]
    named = names[which]
    return replace(plan, stated_lamp=named if named != plan.stated_lamp else names[(which + 1) % 3])


def _wall(plan: ShotPlan, share: float) -> ShotPlan:
    """Light reflected by a red wall: the lamp's spectrum with a smooth step at 590 nm added."""
    stain = 1 + share / (1 + np.exp(-(WAVELENGTHS - 590) / 12))
    return replace(plan, lamp=replace(plan.lamp, values=plan.lamp.values * stain, name=f"{plan.lamp.name}, red wall"))


def _filtered(plan: ShotPlan, transmission: Floats, what: str) -> ShotPlan:
    """The lamp's light through a filter that the user does not name."""
    return replace(
        plan, lamp=replace(plan.lamp, values=plan.lamp.values * transmission, name=f"{plan.lamp.name}, {what}")
    )


def _didymium(plan: ShotPlan, depth: float) -> ShotPlan:
    """Glass of neodymium and praseodymium: a notch at 585 nm and a weaker one at 527 nm."""
    notches = np.exp(-0.5 * ((WAVELENGTHS - 585) / 9) ** 2) + 0.4 * np.exp(-0.5 * ((WAVELENGTHS - 527) / 6) ** 2)
    return _filtered(plan, 1 - depth * np.minimum(notches, 1.0), "didymium")


def _blue_blocking(plan: ShotPlan, blocked: float) -> ShotPlan:
    """Glasses that block a part of the light below 480 nm."""
    return _filtered(plan, 1 - blocked / (1 + np.exp((WAVELENGTHS - 480) / 8)), "blue-blocking")


# the chart


def _moved_table(plan: ShotPlan, shift: float) -> ShotPlan:
    """A chart's file whose wavelengths are off: the chart reflects at λ what the file says at λ + 2, 5 or 10 nm."""
    moved = np.stack([np.interp(WAVELENGTHS + shift, WAVELENGTHS, patch) for patch in plan.table.values])
    return replace(plan, table=plan.table.with_values(moved))


def _screen(plan: ShotPlan, share: float) -> ShotPlan:
    """The chart shown on a screen: its three primaries, mixed to the chart's colours, by 15, 50 or 100 %."""
    primaries = np.stack(
        [np.exp(-0.5 * ((WAVELENGTHS - peak) / width) ** 2) for peak, width in ((620, 12), (532, 18), (455, 10))]
    )
    # Reflectances that would send the screen's light to the camera; a tube has hardly any light beside its lines.
    light = primaries / np.maximum(plan.lamp.values, 0.05 * plan.lamp.values.mean())
    seen, of_primaries = (values * plan.lamp.values @ plan.camera.values for values in (plan.table.values, light))
    values = np.maximum(seen @ np.linalg.inv(of_primaries), 0.0) @ light
    values *= plan.table.values.max() / values.max()
    return replace(plan, table=plan.table.with_values((1 - share) * plan.table.values + share * values))


def _staged(plan: ShotPlan, **changes: Any) -> ShotPlan:
    return replace(plan, scene=replace(plan.scene, **changes))


def _turned(plan: ShotPlan, size: tuple[float, float], **changes: Any) -> ShotPlan:
    turn, fill = size
    return _staged(plan, rotation=plan.scene.rotation + turn, fill=plan.scene.fill * fill, **changes)


def _faded(plan: ShotPlan, share: float) -> ShotPlan:
    """A chart faded by sunlight: colours bleach towards grey, red and magenta dyes first; white turns yellow."""
    values = plan.table.values
    grey = values.mean(axis=1, keepdims=True)
    bleach = share * np.exp(-0.5 * ((WAVELENGTHS - 540) / 70) ** 2)
    yellow = 1 - share * 0.3 / (1 + np.exp((WAVELENGTHS - 440) / 15))
    return replace(plan, table=plan.table.with_values((values + bleach * (grey - values)) * yellow))


def _vintage(plan: ShotPlan, size: float) -> ShotPlan:
    """A chart of another production: the difference of Ohta's table from BabelColor's is added, times 1, 2, 4."""
    off = read_chart("classic24:ohta").values - read_chart("classic24").values
    values = np.clip(plan.table.values + size * off, 0.005, 1.0)
    return replace(plan, table=plan.table.with_values(values))


def _wrong_type(plan: ShotPlan, size: int) -> ShotPlan:
    """Another chart of four rows and six columns: some of its colours are at other places."""
    order = np.arange(24)
    swaps = ((2, 7), (0, 11), (4, 16), (5, 13), (1, 14), (3, 12), (9, 15), (6, 17))
    for a, b in swaps[:size]:
        order[[a, b]] = order[[b, a]]
    return replace(plan, table=plan.table.with_values(plan.table.values[order]))


def _printed(plan: ShotPlan, share: float) -> ShotPlan:
    """An ink-jet copy with the same colours under D50, as closely as three inks allow."""
    values = (1 - share) * plan.table.values + share * ink_jet_copy(plan.table.values)
    return replace(plan, table=plan.table.with_values(values))


# the files


def _cfa(plan: ShotPlan, order: tuple[int, ...]) -> ShotPlan:
    return _tagged(plan, cfa="".join(plan.sensor.cfa[i] for i in order))


FAULTS: dict[str, Fault] = {
    fault.name: fault
    for fault in (
        Fault("clipped", "chart and white frame overexposed",
              ("white at 105 % of full scale", "white at 150 % of full scale", "300 %"),
              (1.05, 1.5, 3.0), _exposure),
        Fault("clipped-channel", "one channel overexposed",
              ("red of white at 110 %", "red of white at 180 %", "400 %"),
              (1.1, 1.8, 4.0), _one_channel, ("white or ceiling",)),
        Fault("ceiling", "the sensor clips below the white level in the file",
              ("at 75 % of the range", "at 60 % of the range", "35 %"),
              (0.75, 0.6, 0.35), _ceiling, ("white or ceiling",)),
        Fault("underexposed", "too little light",
              ("white at 10 % of full scale", "white at 2 % of full scale", "0.5 %"),
              (0.1, 0.02, 0.005), _exposure),
        Fault("black", "the file's black level is too low, no dark frame",
              ("by 0.5 % of the range", "by 2 % of the range", "8 %"),
              (0.005, 0.02, 0.08), _black, ("offset",)),
        Fault("dark-iso", "the dark frame was taken at another ISO, as its file states",
              ("ISO × 2", "ISO × 8", "× 32"),
              ((2.0, 0.003), (8.0, 0.01), (32.0, 0.04)), _dark_tags),
        Fault("dark-leak", "light or warmth in the dark frame", ("0.4 % of the range", "1.5 % of the range", "6 %"),
              (0.004, 0.015, 0.06), lambda p, s: replace(p, dark_offset=s * _range(p)), ("offset",)),
        Fault("swapped", "frames handed in as each other", ("chart and white", "white and dark", "chart and dark"),
              (("white", "chart", "dark"), ("chart", "dark", "white"), ("dark", "white", "chart")), _swapped),
        Fault("white-lamp", "the white frame was taken under another lamp",
              ("20 % of another", "50 % of another", "wholly"),
              (0.2, 0.5, 1.0), lambda p, s: replace(p, white_lamp=_mixed(p.lamp, _opposite(p.lamp), s)),
              ("white or ceiling",)),
        Fault("white-level", "the light changed between chart and white frame", ("by 6 %", "by 20 %", "50 %"),
              (0.94, 0.8, 0.5), lambda p, s: replace(p, white_level=p.white_level * s), ("white or ceiling",)),
        Fault("wrong-lamp", "the lamp is named wrongly",
              ("its neighbour (D65 for D55)", "another technique (LED for D55)", "the opposite (A for D65)"),
              (0, 1, 2), _wrong_lamp, ("light",)),
        Fault("two-lamps", "a second lamp shines on everything", ("10 % of the light", "35 % of the light", "80 %"),
              (0.1, 0.35, 0.8), lambda p, s: replace(p, lamp=_mixed(p.lamp, _opposite(p.lamp), s)), ("light",)),
        Fault("wall", "a red wall colours the light", ("10 % more red", "40 % more red", "150 %"),
              (0.1, 0.4, 1.5), _wall, ("light",)),
        Fault("glare", "a veil of stray light over the chart photo", ("2 % of white", "6 % of white", "20 %"),
              (0.02, 0.06, 0.2), lambda p, s: _staged(p, glare=s), ("offset",)),
        Fault("specular", "a highlight on one patch", ("6 % of white", "40 % of white", "300 %"),
              (0.06, 0.4, 3.0), light.specular, ("patch", "offset")),
        Fault("shadow", "a shadow with an edge across the chart", ("5 % darker", "20 % darker", "60 %"),
              (0.05, 0.2, 0.6), light.shadow, ("uneven",)),
        Fault("vignetting", "the lens darkens the corners, no white frame", ("by 15 %", "by 40 %", "75 %"),
              (0.15, 0.4, 0.75), lambda p, s: _without(_staged(p, vignetting=s), "white"), ("uneven",)),
        Fault("shading", "lens shading corrected in the chart photo, not in the white frame",
              ("by 5 % in the corners", "by 20 % in the corners", "60 %"),
              (0.05, 0.2, 0.6), light.shading, ("uneven",)),
        Fault("motion", "the camera moved", ("by 10 % of a patch", "by 35 % of a patch", "90 %"),
              (0.1, 0.35, 0.9), light.motion),
        Fault("defocus", "out of focus", ("σ 5 % of a patch", "σ 15 % of a patch", "35 %"),
              (0.05, 0.15, 0.35), light.defocus),
        Fault("upside-down", "the chart is turned", ("180°", "90°", "270°"),
              ((180.0, 1.0), (90.0, 0.7), (270.0, 0.7)), _turned),
        Fault("mirrored", "the chart is seen in a mirror", ("upright", "turned by 180°", "by 90°"),
              ((0.0, 1.0), (180.0, 1.0), (90.0, 0.7)), lambda p, s: _turned(p, s, mirrored=True)),
        Fault("covered", "a hand on the chart", ("a third of two patches", "four patches", "twelve"),
              ((0.35, 0.6), (1.5, 0.6), (3.5, -0.6)), light.covered, ("patch",)),
        Fault("faded", "an old chart: bleached and yellowed", ("5 %", "20 %", "50 %"),
              (0.05, 0.2, 0.5), _faded, ("table",)),
        Fault("vintage", "a chart of another production", ("Ohta's table", "twice as far", "four times"),
              (1.0, 2.0, 4.0), _vintage, ("table",)),
        Fault("wrong-type", "another chart of 4 × 6 colours", ("2 colours elsewhere", "6 colours elsewhere", "16"),
              (1, 3, 8), _wrong_type, ("table",)),
        Fault("printed", "an ink-jet copy of the chart", ("25 % of the way", "60 % of the way", "wholly"),
              (0.25, 0.6, 1.0), _printed, ("table",)),
        Fault("tone-mapped", "a tone curve in the samples", ("γ 0.96", "γ 0.85", "0.5"),
              (0.96, 0.85, 0.5), samples.tone, ("tone",)),
        Fault("demosaiced", "demosaiced, colour-converted, made a mosaic again",
              ("demosaiced alone", "40 % of a display's colours", "a display's colours"),
              (0.0, 0.4, 1.0), samples.demosaiced, ("processed",)),
        Fault("desaturated", "colours moved towards grey, made a mosaic again", ("5 %", "15 %", "35 %"),
              (0.05, 0.15, 0.35), samples.desaturated, ("processed",)),
        Fault("chroma", "chroma noise reduction, made a mosaic again", ("σ 1 px", "σ 3 px", "σ 8 px"),
              (1.0, 3.0, 8.0), samples.chroma, ("processed",)),
        Fault("resized", "the mosaic resampled as a grey picture", ("by 0.1 px", "by 0.25 px", "0.5 px"),
              (0.1, 0.25, 0.5), samples.resized, ("processed",)),
        Fault("quad", "4 × 4 mosaic turned into 2 × 2", ("3 px", "5 px", "7 px"),
              (3, 5, 7), samples.quad, ("processed",)),
        Fault("burst", "the mean of several photos, right colours", ("of 2", "of 4", "8"),
              (2.0, 4.0, 8.0), samples.burst),
        Fault("didymium", "glass of didymium before the lamp", ("30 %", "60 %", "90 %"),
              (0.3, 0.6, 0.9), _didymium, ("light",)),
        Fault("blue-blocking", "glasses that block blue before the lamp", ("20 %", "50 %", "90 %"),
              (0.2, 0.5, 0.9), _blue_blocking, ("light",)),
        Fault("moved-table", "the chart's file is off in wavelength", ("by 2 nm", "by 5 nm", "10 nm"),
              (2.0, 5.0, 10.0), _moved_table, ("table",)),
        Fault("screen", "the chart shown on a screen", ("15 % of the way", "50 % of the way", "wholly"),
              (0.15, 0.5, 1.0), _screen, ("table",)),
        Fault("colour-shading", "red and blue fall off differently", ("by 2 %", "by 8 %", "25 %"),
              (0.02, 0.08, 0.25), light.colour_shading, ("uneven",)),
        Fault("crosstalk", "light leaks between pixels towards the corners", ("2 %", "6 %", "20 %"),
              (0.02, 0.06, 0.2), light.crosstalk),
        Fault("other-unit", "the white frame is of another unit of that name", ("2 %", "6 %", "20 %"),
              (0.02, 0.06, 0.2), light.other_unit, ("white or ceiling",)),
        Fault("cfa", "a wrong colour order in the files",
              ("red and blue exchanged", "shifted by a column", "by a row"),
              ((3, 2, 1, 0), (1, 0, 3, 2), (2, 3, 0, 1)), _cfa),
        Fault("hot-pixels", "hot pixels in all frames", ("0.2 %", "2 %", "12 %"),
              ((1, 0.002), (2, 0.02), (3, 0.12)), samples.hot),
        Fault("coarse", "samples quantised", ("to 10 bits", "to 8 bits", "5"),
              (10, 8, 5), samples.coarse),
    )
}  # fmt: skip
"""All faults, by name."""
