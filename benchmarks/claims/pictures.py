"""How alike are two cameras' pictures of one scene?

Each camera or phone is recovered with a basis learned without it, as in `colour`, from two shots (D55, A)
whose lamps are off by their 2 %. It then photographs 99 surfaces that neither prior nor chart knows (CIE 224:2017)
and a white that is off by 1 %, with the noise of a phone, under D65, A, LED-B3 and FL2, off by 2 %, each named.
Pixels away from the surfaces' borders, as

- camssf: the picture in standard colour (`camssf picture`),
- matrix: the same demosaiced and white-balanced signals through the colour matrix that LibRaw holds for the camera,
  Adobe's; of phones, which it does not know, those that their true curves give for A and D65.

ΔE00 between two cameras' pictures and from the truth, medians over pixels; and the share of the pixels' L*, a* and b*
that lie within 1.96 of the stated standard deviations from the truth.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import rawpy
import tifffile
from numpy.typing import NDArray

from benchmarks.claim import Run
from benchmarks.claims.colour import SHOTS, WHITE, Case, calibrate, case_groups, drawn, unseen
from benchmarks.devices import LEFT_OUT
from benchmarks.shared import lamp
from camssf.colorimetry import adaptation, delta_e00, lab, white_of
from camssf.grid import BAND, WAVELENGTHS, Floats
from camssf.photo.read.dng import Mosaic
from camssf.recovery.covariance import CHART_CORRELATION, smooth_errors
from camssf.spectra.bundled import correlated_temperature
from camssf.spectra.cameras import CameraCurves
from camssf_colour import View, of_surfaces
from camssf_colour.demosaic import demosaic, interleaved
from camssf_colour.picture import XYZ_ONE, standard_picture, white_of_region
from camssf_colour.picture_strip import PER_UNIT
from camssf_colour.regions import measure_regions
from camssf_lab.simulation.camera import Sensor, count
from camssf_lab.simulation.dng import color_matrix

OPTIONS = {"cameras": (13, "of those that LibRaw knows, evenly over their list")}
LAMPS = ("D65", "A", "LED-B3", "FL2")
BLOCK, INNER = 24, slice(6, 18)
"""Pixels of a surface, and those that are judged."""
COLUMNS = 10
SEED = 31


@dataclass(frozen=True)
class Shown:
    """The judged pixels of one camera's pictures in one light, Lab (99, n, 3).

    Attributes:
        camssf, matrix: by way.
        truth: (99, 1, 3).
        inside: whether it is within the intervals of `camssf`.
    """

    camssf: Floats
    matrix: Floats
    truth: Floats
    inside: NDArray[np.bool_]


WAYS = ("camssf", "matrix")


def scene() -> Floats:
    """(100, 681) the surfaces in rows of COLUMNS; the last is the white."""
    return np.concatenate([unseen(), np.ones((1, WAVELENGTHS.size))])


def photograph(case: Case, power: Floats, rng: np.random.Generator) -> Mosaic:
    """The mosaic of the scene."""
    smooth = smooth_errors(CHART_CORRELATION, WAVELENGTHS)
    surfaces = scene()
    surfaces[-1] *= 1.0 + WHITE * (smooth @ rng.normal(size=smooth.shape[1]))
    raw = (surfaces * power) @ case.curves
    sensor = Sensor()
    raw *= sensor.exposure * (sensor.white_level - sensor.black) / raw[-1].max()
    blocks = raw.reshape(-1, COLUMNS, 3).repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)
    light = np.empty(blocks.shape[:2], dtype=np.float32)
    for row, column in np.ndindex(2, 2):
        light[row::2, column::2] = blocks[row::2, column::2, row + column]
    return Mosaic(
        "scene", count(light, sensor, rng), "RGGB", np.full((2, 2), sensor.black), sensor.white_level, "", "", None,
        None, 1, (), None, None, None, "",
    )  # fmt: skip


def judged(pixels: Floats) -> Floats:
    """(99, n, 3) the inner pixels of each surface but the white."""
    rows = pixels.shape[0] // BLOCK
    blocks = pixels.reshape(rows, BLOCK, COLUMNS, BLOCK, 3)[:, INNER, :, INNER]
    return np.asarray(blocks.transpose(0, 2, 1, 3, 4).reshape(rows * COLUMNS, -1, 3)[:-1])


def show(case: Case, name: str, rng: np.random.Generator) -> Shown:
    """One camera's pictures of the scene in a light near the named one."""
    power = drawn(lamp(name), rng)
    photo = photograph(case, power, rng)
    last = len(scene()) // COLUMNS - 1
    (white,) = measure_regions(photo, [((COLUMNS - 1) * BLOCK + 2.0, last * BLOCK + 2.0, BLOCK - 4.0, BLOCK - 4.0)])
    camera = calibrate(case, SHOTS["two"], rng, off=True)
    made = standard_picture(camera, name, photo, white=white_of_region(white, 1.0), space="xyz-d65")
    pixels, layer = (np.concatenate(strips) for strips in zip(*made.strips(), strict=True))
    white_xyz = of_surfaces(np.ones((1, WAVELENGTHS.size)), power, View(white="D65"))[0][0]
    ours = lab(judged(pixels / XYZ_ONE), white_xyz)
    deviation = judged(layer.repeat(2, axis=0).repeat(2, axis=1) / PER_UNIT)
    truth = of_surfaces(unseen(), power, View(white="D65"))[1][:, None, :]
    signals = judged(malvar(photo.samples - 512.0) / white.raw)
    matrix, own = matrix_for(case, power), white_of(power)
    to_xyz = adaptation(own, white_xyz) @ (np.linalg.inv(matrix) * (matrix @ own))
    theirs = lab(signals @ to_xyz.T, white_xyz)
    return Shown(ours, theirs, truth, np.abs(ours - truth) <= BAND * deviation)


def malvar(light: Floats) -> Floats:
    """(h, w, 3) of a mosaic RGGB (h, w)."""
    height, width = light.shape
    cells = np.pad(light, 2, mode="reflect").reshape(height // 2 + 2, 2, width // 2 + 2, 2)
    return np.moveaxis(interleaved(demosaic(cells)).reshape(3, height, width), 0, 2)


def numbers(shown: list[Shown]) -> dict[str, float]:
    """The columns of the table for one light; between cameras over all pairs of neighbours in the list."""
    pairs = list(zip(shown, [*shown[1:], shown[0]], strict=True))
    found = {}
    for way in WAYS:
        own = [(getattr(one, way), getattr(other, way)) for one, other in pairs]
        found[f"{way}: apart"] = np.median([delta_e00(*pair) for pair in own])
        found[f"{way}: averaged"] = np.median([delta_e00(a.mean(axis=1), b.mean(axis=1)) for a, b in own])
        found[f"{way}: from truth"] = np.median([delta_e00(getattr(one, way), one.truth) for one in shown])
    found["inside 95 %"] = np.mean([one.inside for one in shown])
    return {name: float(value) for name, value in found.items()}


def matrix_for(case: Case, power: Floats) -> Floats:
    """(3, 3) XYZ to camera: what LibRaw holds of the maker's or Adobe's for D65, or those that the curves give.

    The latter, for A and D65, are interpolated by the light's temperature as DNG readers do.
    """
    known = stored_matrix(case.name)
    if known is not None:
        return known
    bulb, daylight = (color_matrix(CameraCurves(case.name, case.curves, ""), name) for name in ("A", "D65"))
    mired = np.array([1e6 / correlated_temperature(white_of(each)) for each in (lamp("A"), lamp("D65"), power)])
    share = float(np.clip((mired[2] - mired[0]) / (mired[1] - mired[0]), 0.0, 1.0))
    return np.asarray((1.0 - share) * bulb + share * daylight)


@cache
def stored_matrix(name: str) -> Floats | None:
    """(3, 3) XYZ to camera in LibRaw's table; None if it does not know this make and model."""
    make, _, model = name.partition(" ")
    tags = [
        (271, 2, 0, make, True), (272, 2, 0, model, True), (33421, 3, 2, (2, 2), True),
        (33422, 1, 4, bytes((0, 1, 1, 2)), True),
        (50706, 1, 4, bytes((1, 4, 0, 0)), True), (50708, 2, 0, name, True), (50717, 4, 1, 16383, True),
    ]  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plain.dng"
        tifffile.imwrite(path, np.full((64, 64), 2000, np.uint16), photometric="cfa", metadata=None, extratags=tags)
        with rawpy.imread(str(path)) as raw:
            matrix = np.asarray(raw.rgb_xyz_matrix[:3], dtype=np.float64)
    return matrix if matrix.any() else None


def claim(run: Run) -> None:
    """A row a light, and their mean, for cameras and phones."""
    for title, group in case_groups(run, 52):
        known = [case for case in group if stored_matrix(case.name) is not None] if title == LEFT_OUT else []
        shown = known[:: max(1, len(known) // run.options.cameras)][: run.options.cameras] if known else group
        rows = {}
        for at, name in enumerate(run.track(LAMPS, title)):
            rngs = [np.random.default_rng([SEED, number, at]) for number in range(len(shown))]
            rows[name] = numbers([show(case, name, rng) for case, rng in zip(shown, rngs, strict=True)])
        rows["all"] = {key: float(np.mean([rows[name][key] for name in LAMPS])) for key in rows[LAMPS[0]]}
        columns = {"light": ""} | dict.fromkeys(rows["all"], ".3f")
        lines = [(name, *row.values()) for name, row in rows.items()]
        run.table(f"{title}: median ΔE00 of pictures, {len(shown)} cameras", columns, lines)
