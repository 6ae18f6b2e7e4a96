"""What goes wrong in front of a camera and behind it: named faults in three severities, as changes of a `Plan`.

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
from camssf.grid import WAVELENGTHS, Floats
from camssf.simulation.frames import Change, Light, Plan, View, sites
from camssf.spectra import Lamp, read_chart, read_lamp

SEVERITIES = (1, 2, 3)
OTHERS = {
    "daylight": ("D65", "LED-B3", "A"),
    "bulb": ("2500K", "LED-B1", "D65"),
    "led": ("LED-B4", "D55", "A"),
    "tube": ("FL7", "LED-B3", "A"),
}
"""A lamp of that kind is taken for these: its neighbour, another technique, the opposite colour."""
_DISPLAY = np.array([[1.9, -0.7, -0.2], [-0.3, 1.6, -0.3], [0.0, -0.6, 1.6]])
"""From a camera's own colours to a display's, as a converter does it; rows add up to 1."""


@dataclass(frozen=True)
class Fault:
    """One way to spoil a shot.

    Attributes:
        name: as the command line takes it.
        what: in words.
        degrees: what each of the three severities is, in words.
        change: the plan's change, by plan and severity 1 to 3.
    """

    name: str
    what: str
    degrees: tuple[str, str, str]
    change: Callable[[Plan, int], Plan]


def strike(name: str, severity: int) -> Change:
    """The change of a plan that a fault is.

    Raises:
        InvalidArgument: no such fault, or a severity other than 1, 2, 3.
    """
    fault = FAULTS.get(name)
    if fault is None:
        raise InvalidArgument(f"No fault is called {name!r}.", f"Choose one of {', '.join(FAULTS)}.")
    if severity not in SEVERITIES:
        raise InvalidArgument(f"There is no severity {severity}.", "Choose 1, 2 or 3; 3 is the worst.")
    found = fault.change
    return lambda plan: found(plan, severity)


# light


def _through(plan: Plan, frame: str, effect: Light) -> Plan:
    """The plan with one more effect on a frame's light, after those that it has."""
    before = plan.light.get(frame)

    def both(light: NDArray[np.float32], view: View) -> NDArray[np.float32]:
        return effect(light if before is None else before(light, view), view)

    return replace(plan, light={**plan.light, frame: both})


def _specular(plan: Plan, severity: int) -> Plan:
    height = (0.06, 0.4, 3.0)[severity - 1]
    column, row = 2, 2  # red, in the lower half

    def spot(light: NDArray[np.float32], view: View) -> NDArray[np.float32]:
        blob = height * np.exp(-0.5 * (((view.u - column) / 0.3) ** 2 + ((view.v - row) / 0.3) ** 2))
        for rows, columns, colour in sites(view.cfa, *light.shape):
            light[rows, columns] += blob[rows, columns] * np.float32(view.white[colour])
        return light

    return _through(plan, "chart", spot)


def _shadow(plan: Plan, severity: int) -> Plan:
    depth = (0.05, 0.2, 0.6)[severity - 1]

    def shade(light: NDArray[np.float32], view: View) -> NDArray[np.float32]:
        edge = 1.0 / (1.0 + np.exp(np.clip((view.u + 0.5 * view.v - 3.2) / 0.15, -30, 30)))
        return np.asarray(light * (1 - depth * edge), dtype=np.float32)

    return _through(plan, "chart", shade)


def _covered(plan: Plan, severity: int) -> Plan:
    columns = (0.35, 1.5, 3.5)[severity - 1]  # a hand from the right, so many columns in

    def hand(light: NDArray[np.float32], view: View) -> NDArray[np.float32]:
        over = (view.u > 5.5 - columns) & (view.v > (0.6 if severity < 3 else -0.6)) & (view.v < 2.4)
        for rows, cols, colour in sites(view.cfa, *light.shape):
            part = light[rows, cols]
            part[over[rows, cols]] = view.reflected[1, colour]
        return light

    return _through(plan, "chart", hand)


def _shading(plan: Plan, severity: int) -> Plan:
    gain = (0.05, 0.2, 0.6)[severity - 1]

    def corrected(light: NDArray[np.float32], view: View) -> NDArray[np.float32]:
        height, width = light.shape
        y, x = np.mgrid[:height, :width].astype(np.float32)
        r2 = ((x - width / 2) ** 2 + (y - height / 2) ** 2) / ((width / 2) ** 2 + (height / 2) ** 2)
        for rows, columns, colour in sites(view.cfa, *light.shape):
            light[rows, columns] *= 1 + gain * (1.3, 1.0, 1.1)[colour] * r2[rows, columns]
        return light

    return _through(plan, "chart", corrected)


def _motion(plan: Plan, severity: int) -> Plan:
    length = (0.1, 0.35, 0.9)[severity - 1]

    def moved(light: NDArray[np.float32], view: View) -> NDArray[np.float32]:
        from scipy.ndimage import uniform_filter1d

        pitch = 1.0 / abs(float(np.gradient(view.u[len(view.u) // 2]).mean()))
        for rows, columns, _ in sites(view.cfa, *light.shape):
            size = max(1, round(length * pitch / 2))
            light[rows, columns] = uniform_filter1d(light[rows, columns], size, axis=1)
        return light

    return _through(plan, "chart", moved)


def _defocus(plan: Plan, severity: int) -> Plan:
    width = (0.05, 0.15, 0.35)[severity - 1]

    def soft(light: NDArray[np.float32], view: View) -> NDArray[np.float32]:
        from scipy.ndimage import gaussian_filter

        pitch = 1.0 / abs(float(np.gradient(view.u[len(view.u) // 2]).mean()))
        for rows, columns, _ in sites(view.cfa, *light.shape):
            light[rows, columns] = gaussian_filter(light[rows, columns], width * pitch / 2)
        return light

    return _through(plan, "chart", soft)


def _glare(plan: Plan, severity: int) -> Plan:
    return replace(plan, scene=replace(plan.scene, glare=(0.02, 0.06, 0.2)[severity - 1]))


# exposure, black, frames


def _exposure(plan: Plan, share: float) -> Plan:
    return replace(plan, sensor=replace(plan.sensor, exposure=share))


def _one_channel(plan: Plan, severity: int) -> Plan:
    """One channel's signal of the white as a share of full scale, the brightest of the others at the plan's."""
    power = plan.lamp.values @ plan.camera.values
    gains = np.array(plan.sensor.gains) * power.max() / power
    wanted = (1.1, 1.8, 4.0)[severity - 1]
    gains[0] *= wanted / plan.sensor.exposure
    sensor = replace(plan.sensor, gains=tuple(gains.tolist()), exposure=wanted)
    return replace(plan, sensor=sensor)


def _ceiling(plan: Plan, severity: int) -> Plan:
    """Samples stop below the white level that the file names."""
    share = (0.75, 0.6, 0.35)[severity - 1] * plan.sensor.exposure / 0.8

    def stop(samples: NDArray[np.uint16], plan: Plan) -> NDArray[np.uint16]:
        top = plan.sensor.black + share * (plan.sensor.white_level - plan.sensor.black)
        return np.minimum(samples, np.uint16(top))

    return replace(plan, samples=stop)


def _range(plan: Plan) -> float:
    return plan.sensor.white_level - plan.sensor.black


def _told(plan: Plan, **changes: Any) -> Plan:
    told = {frame: {**plan.told.get(frame, {}), **changes} for frame in ("chart", "white", "dark")}
    return replace(plan, told=told)


def _without(plan: Plan, *frames: str) -> Plan:
    return replace(plan, handed={**plan.handed, **dict.fromkeys(frames)})


def _black(plan: Plan, severity: int) -> Plan:
    off = (0.005, 0.02, 0.08)[severity - 1] * _range(plan)
    more = plan.sensor.black + off
    return _without(_told(replace(plan, sensor=replace(plan.sensor, black=more)), black=plan.sensor.black), "dark")


def _dark_tags(plan: Plan, severity: int) -> Plan:
    factor = (2.0, 8.0, 32.0)[severity - 1]
    off = (0.003, 0.01, 0.04)[severity - 1] * _range(plan)
    told = {**plan.told, "dark": {**plan.told.get("dark", {}), "iso": 100.0 * factor}}
    return replace(plan, dark_offset=off, told=told)


def _dark_leak(plan: Plan, severity: int) -> Plan:
    return replace(plan, dark_offset=(0.004, 0.015, 0.06)[severity - 1] * _range(plan))


def _swapped(plan: Plan, severity: int) -> Plan:
    order = (("white", "chart", "dark"), ("chart", "dark", "white"), ("dark", "white", "chart"))[severity - 1]
    return replace(plan, handed=dict(zip(("chart", "white", "dark"), order, strict=True)))


def _white_level(plan: Plan, severity: int) -> Plan:
    return replace(plan, white_level=plan.white_level * (0.94, 0.8, 0.5)[severity - 1])


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


def _white_lamp(plan: Plan, severity: int) -> Plan:
    share = (0.2, 0.5, 1.0)[severity - 1]
    return replace(plan, white_lamp=_mixed(plan.lamp, _opposite(plan.lamp), share))


def _wrong_lamp(plan: Plan, severity: int) -> Plan:
    names = OTHERS[_kind(plan.lamp)]
    told = names[severity - 1]
    return replace(plan, told_lamp=told if told != plan.told_lamp else names[severity % 3])


def _two_lamps(plan: Plan, severity: int) -> Plan:
    return replace(plan, lamp=_mixed(plan.lamp, _opposite(plan.lamp), (0.1, 0.35, 0.8)[severity - 1]))


def _wall(plan: Plan, severity: int) -> Plan:
    """A red wall near the chart: white paint stained by a step at 590 nm."""
    share = (0.1, 0.4, 1.5)[severity - 1]
    stain = 1 + share / (1 + np.exp(-(WAVELENGTHS - 590) / 12))
    return replace(plan, lamp=replace(plan.lamp, values=plan.lamp.values * stain, name=f"{plan.lamp.name}, red wall"))


# the chart


def _lie(plan: Plan, **changes: Any) -> Plan:
    return replace(plan, scene=replace(plan.scene, **changes))


def _upside_down(plan: Plan, severity: int) -> Plan:
    turn = (180.0, 90.0, 270.0)[severity - 1]
    return _lie(plan, rotation=plan.scene.rotation + turn, fill=plan.scene.fill * (1.0 if severity == 1 else 0.7))


def _mirrored(plan: Plan, severity: int) -> Plan:
    turn = (0.0, 180.0, 90.0)[severity - 1]
    fill = plan.scene.fill * (0.7 if severity == 3 else 1.0)
    return _lie(plan, mirrored=True, rotation=plan.scene.rotation + turn, fill=fill)


def _faded(plan: Plan, severity: int) -> Plan:
    """Years in the sun: colours bleach towards grey, red and magenta dyes first; white yellows."""
    share = (0.05, 0.2, 0.5)[severity - 1]
    values = plan.table.values
    grey = values.mean(axis=1, keepdims=True)
    bleach = share * np.exp(-0.5 * ((WAVELENGTHS - 540) / 70) ** 2)
    yellow = 1 - share * 0.3 / (1 + np.exp((WAVELENGTHS - 440) / 15))
    return replace(plan, table=replace(plan.table, values=(values + bleach * (grey - values)) * yellow))


def _vintage(plan: Plan, severity: int) -> Plan:
    """Another production: as far from the asked table as Ohta's is from BabelColor's, times 1, 2, 4."""
    off = read_chart("classic24:ohta").values - read_chart("classic24").values
    values = np.clip(plan.table.values + (1.0, 2.0, 4.0)[severity - 1] * off, 0.005, 1.0)
    return replace(plan, table=replace(plan.table, values=values))


def _wrong_type(plan: Plan, severity: int) -> Plan:
    """Another chart of four rows and six columns: some of its colours stand elsewhere."""
    order = np.arange(24)
    swaps = ((2, 7), (0, 11), (4, 16), (5, 13), (1, 14), (3, 12), (9, 15), (6, 17))
    for a, b in swaps[: (1, 3, 8)[severity - 1]]:
        order[[a, b]] = order[[b, a]]
    return replace(plan, table=replace(plan.table, values=plan.table.values[order]))


def _printed(plan: Plan, severity: int) -> Plan:
    """An ink-jet copy, to the eye the same colours under D50 as far as three inks go."""
    share = (0.25, 0.6, 1.0)[severity - 1]
    values = (1 - share) * plan.table.values + share * _prints(plan.table.values)
    return replace(plan, table=replace(plan.table, values=values))


def _prints(wanted: Floats) -> Floats:
    """(n, 681) reflectance of ink amounts whose XYZ under D50 comes closest to that of `wanted`."""
    from scipy.optimize import least_squares

    from camssf.spectra import colour_science

    colour = colour_science()
    shape = colour.SpectralShape(380, 720, 0.5)
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape).values
    weights = observer * read_lamp("D50").values[:, None]
    weights = weights / weights[:, 1].sum()
    bands = ((605.0, 720.0), (505.0, 585.0), (375.0, 490.0))  # absorbed by cyan, magenta, yellow
    ink = np.array(
        [1 / (1 + np.exp((low - WAVELENGTHS) / 12)) / (1 + np.exp((WAVELENGTHS - high) / 15)) for low, high in bands]
    )
    density = 1.6 * ink + 0.12 * ink[[1, 0, 1]] + 0.03
    paper = 0.90 - 0.06 / (1 + np.exp((WAVELENGTHS - 415) / 8))

    def paint(amounts: Floats) -> Floats:
        return np.asarray(paper * 10 ** -(amounts @ density))

    found = []
    for target in wanted @ weights:
        root = np.cbrt(target + 0.001)
        fit = least_squares(lambda a, r=root: np.cbrt(paint(a) @ weights + 0.001) - r, np.full(3, 0.4), bounds=(0, 2))
        found.append(paint(fit.x))
    return np.stack(found)


# software


def _tone(plan: Plan, severity: int) -> Plan:
    power = (0.96, 0.85, 0.5)[severity - 1]

    def curve(samples: NDArray[np.uint16], plan: Plan) -> NDArray[np.uint16]:
        black, span = plan.sensor.black, _range(plan)
        x = (samples - black) / span
        bent = np.sign(x) * np.abs(x) ** power
        return np.asarray(np.clip(np.rint(black + span * bent), 0, plan.sensor.white_level), np.uint16)

    return replace(plan, samples=curve)


def _demosaiced(plan: Plan, severity: int) -> Plan:
    """Bilinear demosaicing, so much of the way to display colours, and back into a mosaic."""
    mix = np.eye(3) + (0.0, 0.4, 1.0)[severity - 1] * (_DISPLAY - np.eye(3))

    def cook(samples: NDArray[np.uint16], plan: Plan) -> NDArray[np.uint16]:
        from scipy.ndimage import convolve

        black = plan.sensor.black
        kernel = np.array([[0.25, 0.5, 0.25], [0.5, 1, 0.5], [0.25, 0.5, 0.25]])
        light = samples.astype(np.float64) - black
        power = plan.lamp.values @ plan.camera.values * plan.sensor.gains
        balance = power.max() / power  # a converter balances white before it mixes
        full = []
        for c in range(3):
            known, mask = np.zeros_like(light), np.zeros_like(light)
            for rows, columns, colour in sites(plan.sensor.cfa, *light.shape):
                if colour == c:
                    known[rows, columns], mask[rows, columns] = light[rows, columns], 1
            between = convolve(known, kernel, mode="mirror") / convolve(mask, kernel, mode="mirror")
            full.append(np.where(mask > 0, known, between) * balance[c])
        mixed = np.stack([sum(mix[c, d] * full[d] for d in range(3)) / balance[c] for c in range(3)])
        for rows, columns, colour in sites(plan.sensor.cfa, *light.shape):
            light[rows, columns] = mixed[colour][rows, columns]
        return np.asarray(np.clip(np.rint(light + black), 0, plan.sensor.white_level), np.uint16)

    return replace(plan, samples=cook)


def _cfa(plan: Plan, severity: int) -> Plan:
    cfa = plan.sensor.cfa
    rolled = (cfa[::-1], cfa[1] + cfa[0] + cfa[3] + cfa[2], cfa[2:] + cfa[:2])
    return _told(plan, cfa=rolled[severity - 1])


def _hot(plan: Plan, severity: int) -> Plan:
    share = (0.002, 0.02, 0.12)[severity - 1]

    def burn(samples: NDArray[np.uint16], plan: Plan) -> NDArray[np.uint16]:
        rng = np.random.default_rng(severity)  # the same pixels in every frame
        hot = rng.random(samples.shape) < share
        glow = rng.exponential(0.25 * _range(plan), samples.shape)
        return np.asarray(np.minimum(samples + np.where(hot, glow, 0), plan.sensor.white_level), np.uint16)

    return replace(plan, samples=burn)


def _coarse(plan: Plan, severity: int) -> Plan:
    bits = (10, 8, 5)[severity - 1]

    def round_down(samples: NDArray[np.uint16], plan: Plan) -> NDArray[np.uint16]:
        step = (plan.sensor.white_level + 1) / 2**bits
        return np.asarray(np.floor(samples / step) * step, np.uint16)

    return replace(plan, samples=round_down)


def _vignetting(plan: Plan, severity: int) -> Plan:
    return _without(_lie(plan, vignetting=(0.15, 0.4, 0.75)[severity - 1]), "white")


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
        Fault("specular", "a highlight on one patch", ("6 % of white", "40 %", "300 %"), _specular),
        Fault("shadow", "a shadow with an edge across the chart", ("5 % darker", "20 %", "60 %"), _shadow),
        Fault("vignetting", "the lens darkens the corners, no white frame", ("by 15 %", "40 %", "75 %"), _vignetting),
        Fault("shading", "lens shading corrected in the chart photo, not in the white frame",
              ("by 5 % in the corners", "20 %", "60 %"), _shading),
        Fault("motion", "the camera moved", ("by 10 % of a patch", "35 %", "90 %"), _motion),
        Fault("defocus", "out of focus", ("σ 5 % of a patch", "15 %", "35 %"), _defocus),
        Fault("upside-down", "the chart is turned", ("180°", "90°", "270°"), _upside_down),
        Fault("mirrored", "the chart is seen in a mirror", ("upright", "turned by 180°", "by 90°"), _mirrored),
        Fault("covered", "a hand on the chart", ("on a third of two patches", "on four", "on twelve"), _covered),
        Fault("faded", "an old chart: bleached and yellowed", ("5 %", "20 %", "50 %"), _faded),
        Fault("vintage", "a chart of another production", ("Ohta's table", "twice as far", "four times"), _vintage),
        Fault("wrong-type", "another chart of 4 × 6 colours", ("2 colours elsewhere", "6", "16"), _wrong_type),
        Fault("printed", "an ink-jet copy of the chart", ("25 % of the way", "60 %", "wholly"), _printed),
        Fault("tone-mapped", "a tone curve in the samples", ("γ 0.96", "0.85", "0.5"), _tone),
        Fault("demosaiced", "demosaiced, colour-converted, made a mosaic again",
              ("demosaiced alone", "40 % of a display's colours", "a display's colours"), _demosaiced),
        Fault("cfa", "a wrong colour order in the files", ("red and blue exchanged", "shifted by a column",
              "by a row"), _cfa),
        Fault("hot-pixels", "hot pixels in all frames", ("0.2 %", "2 %", "12 %"), _hot),
        Fault("coarse", "samples quantised", ("to 10 bits", "8", "5"), _coarse),
    )
}  # fmt: skip
"""By name."""
