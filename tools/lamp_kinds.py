"""Kinds of lamps by formula, for data/spectra.json: lamps drawn at random, their mean and principal components.

`daylight` is CIE daylight (CIE 15) from a late afternoon to a blue sky: the reciprocal temperature is N(155, 38) per
megakelvin, so 6,500 K, and 95 in 100 between 4,400 and 12,600 K; the extremes are 4,200 and 23,800 K.

`white-led` is a blue or violet pump with phosphors or a red diode (RECIPES), their amplitudes such that the light is
white (within 0.012 of the Planckian or daylight locus) and has a temperature of 2,500 to 7,000 K. Shapes: the pump by
Ohno (Opt. Eng. 2005, 44, 111302), S = (g + 2 g⁵) / 3 with g = exp(-((λ - λ₀) / Δλ)²); YAG:Ce and nitride phosphors as
a Gaussian over the wavenumber, their peaks and widths in the ranges of Ye et al. (Mater. Sci. Eng. R 2010, 71, 1);
K₂SiF₆:Mn⁴⁺ by its five lines. No measured lamp was used.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from camssf.colorimetry import uv
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.unnamed_light import temperature
from camssf.spectra.bundled import daylight, observer, planck
from camssf.spectra.limits import DIMMEST
from tools.pages import GRID

SEED = 2026
DRAWS = {"daylight": 500, "white-led": 1200}
COMPONENTS = {"daylight": 2, "white-led": 8}
TOLERANCES = {"daylight": 0.04, "white-led": 0.30}
"""Smooth errors of the drawn lamps: daylight has leaves, walls and windows; LEDs have other phosphors.

The LEDs' was set on other draws of the same formulas: of 0.1 to 0.6 the value with the least error of the curves.
"""
RECIPES = {"broad": 0.75, "ksf": 0.12, "hybrid": 0.06, "violet": 0.07}
"""Shares of the white LEDs: broad phosphors; a narrow red phosphor; a red diode; a violet pump. Assumed: most lamps
on sale are of the first kind."""
SHAPES = 6
"""Number of shapes of white LEDs, clusters of the drawn ones: one mean with modes describes LEDs of every shape by
none of them."""
SHAPE_COMPONENTS, SHAPE_TOLERANCE = 4, 0.2
"""Components of a shape, and its smooth error, set on other draws of the same formulas: of 0.1, 0.15, 0.2 and 0.3 the
value with the least error of the curves, 0.0397, 0.0394, 0.0393, 0.0397; the light's 95 % bands hold 0.90 to 0.96."""
DECIMALS, SHAPE_DECIMALS = 7, 5
KSF = ((609.0, 0.10), (613.5, 0.35), (630.5, 1.0), (634.5, 0.55), (648.0, 0.20))
"""Lines of K₂SiF₆:Mn⁴⁺, nm, and their heights; 2 nm wide (one standard deviation)."""
OFF_WHITE = 0.012
"""Largest distance from the locus of white light, CIE 1960 u, v."""


def drawn_kind(kind: str) -> dict[str, Any]:
    """A kind as data/spectra.json has it: mean (69,) and modes times the mean (q, 69) on 5-nm nodes, tolerance.

    White LEDs also have their shapes, each the same and its share.
    """
    random = np.random.RandomState(SEED)  # NumPy keeps its stream the same in all versions
    lamps = np.stack(list(islice(daylights(random), DRAWS[kind]))) if kind == "daylight" else white_leds(random)
    lamps = lamps / lamps.mean(axis=1, keepdims=True)
    drawn = {
        "drawn": DRAWS[kind],
        "dimmest": DIMMEST,
        **GRID,
        **components_of(lamps, COMPONENTS[kind], TOLERANCES[kind]),
    }
    if kind == "daylight":
        return drawn
    cluster, shapes = clusters(lamps[:, ::10], random), []
    for shape in (lamps[cluster == i] for i in range(SHAPES)):
        described = components_of(shape, SHAPE_COMPONENTS, SHAPE_TOLERANCE, SHAPE_DECIMALS)
        shapes.append({"share": round(len(shape) / len(lamps), DECIMALS)} | described)
    return drawn | {"shapes": shapes}


def components_of(lamps: Floats, count: int, tolerance: float, decimals: int = DECIMALS) -> dict[str, Any]:
    """Mean and principal components of lamps (n, 681) of mean 1, at the nodes, and the smooth tolerance."""
    mean = lamps.mean(axis=0)
    _, size, directions = np.linalg.svd(lamps - mean, full_matrices=False)
    modes = size[:count, None] * directions[:count] / np.sqrt(len(lamps) - 1)
    modes *= np.sign(np.take_along_axis(modes, np.abs(modes).argmax(axis=1)[:, None], axis=1))
    return {
        "tolerance": tolerance,
        "mean": np.round(mean[::10], decimals).tolist(),
        "modes": np.round(modes[:, ::10], decimals).tolist(),
    }


def clusters(lamps: Floats, random: np.random.RandomState) -> NDArray[np.intp]:
    """The shape (n,) of each lamp (n, 69): k-means of the roots of their power, begun far apart (k-means++)."""
    roots = np.sqrt(lamps)
    centres = roots[[random.randint(len(roots))]]
    while len(centres) < SHAPES:
        squares = ((roots[:, None] - centres) ** 2).sum(axis=2).min(axis=1)
        centres = np.concatenate([centres, roots[[random.choice(len(roots), p=squares / squares.sum())]]])
    return np.asarray(kmeans2(roots, centres, iter=200, minit="matrix")[1])


def daylights(random: np.random.RandomState) -> Iterator[Floats]:
    """Powers (681,) of daylight."""
    while True:
        reciprocal = random.normal(155.0, 38.0)
        if 42.0 <= reciprocal <= 238.0:
            yield daylight(1e6 / reciprocal)


def white_leds(random: np.random.RandomState) -> Floats:
    """Powers (n, 681) of white LEDs of all recipes."""
    counts = {recipe: round(share * DRAWS["white-led"]) for recipe, share in RECIPES.items()}
    return np.stack([power for recipe, n in counts.items() for power in islice(drawn_leds(recipe, random), n)])


def drawn_leds(recipe: str, random: np.random.RandomState) -> Iterator[Floats]:
    """Powers (681,) of white LEDs of a recipe."""
    while True:
        kelvin = float(np.exp(random.uniform(np.log(2500.0), np.log(7000.0))))
        warm = kelvin < 4500.0
        pump = led(random.normal(451.0, 5.0), random.uniform(11.0, 20.0))
        yellow = phosphor(random.normal(550.0, 14.0), random.uniform(85.0, 135.0))
        red = phosphor(random.normal(622.0, 14.0), random.uniform(70.0, 105.0))
        if recipe == "broad":
            share = random.uniform(0.0, 1.4 if warm else 0.7) * (warm or random.uniform() < 0.7)
            rest = yellow + share * red
        elif recipe == "ksf":
            lines = sum(height * np.exp(-0.5 * ((WAVELENGTHS - line) / 2.0) ** 2) for line, height in KSF)
            green = phosphor(random.normal(540.0, 10.0), random.uniform(55.0, 110.0))
            rest = green + random.uniform(0.8, 5.0) * lines + random.uniform(0.0, 0.3) * red
        elif recipe == "hybrid":
            green = phosphor(random.normal(548.0, 12.0), random.uniform(85.0, 130.0))
            rest = green + random.uniform(0.3, 1.8) * led(random.normal(625.0, 8.0), random.uniform(10.0, 16.0))
        else:
            pump = 1.2 * led(random.normal(415.0, 8.0), random.uniform(9.0, 14.0))
            pump = pump + random.uniform(0.2, 0.8) * phosphor(random.normal(465.0, 10.0), random.uniform(35.0, 65.0))
            rest = yellow + random.uniform(0.0, 1.4) * red
        power = balanced(pump, rest, kelvin)
        if abs(float(temperature(power)) - kelvin) < 100.0 and off_white(power) < OFF_WHITE:
            yield power


def led(peak: float, width: float) -> Floats:
    """The light of a LED (681,): Ohno's model."""
    g = np.exp(-(((WAVELENGTHS - peak) / width) ** 2))
    return np.asarray((g + 2.0 * g**5) / 3.0)


def phosphor(peak: float, width: float) -> Floats:
    """The emission of a phosphor (681,), `width` nm wide at half of its height: a Gaussian over the wavenumber."""
    deviation = width / peak**2 / 2.3548
    return np.asarray(np.exp(-0.5 * ((1.0 / WAVELENGTHS - 1.0 / peak) / deviation) ** 2))


def balanced(pump: Floats, rest: Floats, kelvin: float) -> Floats:
    """So much of the pump that the light has this temperature, by bisection."""
    least, most = 0.01, 20.0
    for _ in range(22):
        middle = np.sqrt(least * most)
        found = float(temperature(middle * pump + rest))
        least, most = (least, middle) if found > kelvin or found < 0.0 else (middle, most)
    return np.asarray(least * pump + rest)


def off_white(power: Floats) -> float:
    """Distance from Planck's light, or from daylight above 4,900 K, of the same temperature, CIE 1960 u, v."""
    kelvin = float(temperature(power))
    white = daylight(kelvin) if kelvin > 4900.0 else planck(kelvin)
    off = (uv(power @ observer("1931")) - uv(white @ observer("1931"))) * np.array([1.0, 2.0 / 3.0])
    return float(np.hypot(*off))
