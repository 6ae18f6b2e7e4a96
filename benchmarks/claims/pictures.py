"""How alike are two cameras' pictures of one scene?

Each camera or phone is recovered with a basis learned without it, as in `colour`, from two shots (D55, A)
whose lamps are off by their 2 %. It then photographs 99 surfaces that neither prior nor chart knows (CIE 224:2017)
and a white that is off by 1 %, with the noise of a phone, under D65, A, LED-B3 and FL2, off by 2 %, each named.
Pixels away from the surfaces' borders, as

- camssf: the picture in standard colour (`camssf picture`),
- exact: the same through the true curves, what no recovery can surpass,
- stored: the same demosaiced and white-balanced signals through the colour matrix that LibRaw holds for the camera,
  Adobe's for D65 (it knows a model by the beginning of its name: the S8 has the S7's),
- ideal: through the matrix that the true curves give for that lamp, fitted to 190 other surfaces: what only somebody
  could know who has the curves.

ΔE00 between two cameras' pictures (single pixels, and the mean of a surface's) and from the truth, medians; and the
share of the pixels' L*, a* and b* that lie within 1.96 of the stated standard deviations from the truth.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import rawpy
import tifffile
from numpy.typing import NDArray

from benchmarks.claim import Run
from benchmarks.claims.colour import SHOTS, WHITE, Case, calibrate, case_groups, drawn, unseen
from benchmarks.devices import LEFT_OUT
from benchmarks.shared import lamp
from camssf.colorimetry import adaptation, delta_e00, fit, lab, signals_of, white_of, xyz_of
from camssf.grid import BAND, WAVELENGTHS, Floats
from camssf.photo.read.dng import Mosaic
from camssf.recovery.covariance import CHART_CORRELATION, smooth_errors
from camssf.spectra.bundled import observer, surfaces
from camssf_colour import View, of_surfaces
from camssf_colour.demosaic import demosaic, interleaved
from camssf_colour.picture import XYZ_ONE, standard_picture, white_of_region
from camssf_colour.picture_strip import PER_UNIT
from camssf_colour.regions import measure_regions
from camssf_lab.simulation.camera import Sensor, count

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
        by: of each way but `stored` where LibRaw does not know the camera.
        truth: (99, 1, 3).
        inside: whether it is within the intervals of `camssf`.
    """

    by: dict[str, Floats]
    truth: Floats
    inside: NDArray[np.bool_]


WAYS = ("camssf", "exact", "stored", "ideal")
MEASURES = ("two cameras' pixels", "two cameras' surfaces", "pixels from the truth")


def photograph(case: Case, power: Floats, rng: np.random.Generator) -> Mosaic:
    """The mosaic of the surfaces in rows of COLUMNS, and of the white, which is the last."""
    smooth = smooth_errors(CHART_CORRELATION, WAVELENGTHS)
    reflectances = np.append(unseen(), [1.0 + WHITE * (smooth @ rng.normal(size=smooth.shape[1]))], axis=0)
    raw = (reflectances * power) @ case.curves
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
    last = len(photo.samples) // BLOCK - 1
    (white,) = measure_regions(photo, [((COLUMNS - 1) * BLOCK + 2.0, last * BLOCK + 2.0, BLOCK - 4.0, BLOCK - 4.0)])
    camera = calibrate(case, SHOTS["two"], rng, off=True)
    exact = replace(camera, values=case.curves / case.curves.max(axis=0), modes=camera.modes[:0])
    standard = View(white="D65")
    white_xyz = of_surfaces(np.ones((1, WAVELENGTHS.size)), power, standard)[0][0]
    by = {}
    for way, curves in (("exact", exact), ("camssf", camera)):
        made = standard_picture(curves, name, photo, white=white_of_region(white, 1.0), space="xyz-d65")
        pixels, layer = (np.concatenate(strips) for strips in zip(*made.strips(), strict=True))
        by[way] = lab(judged(pixels / XYZ_ONE), white_xyz)
    deviation = judged(layer.repeat(2, axis=0).repeat(2, axis=1) / PER_UNIT)
    truth = of_surfaces(unseen(), power, standard)[1][:, None, :]
    signals, own, named = judged(malvar(photo.samples - 512.0) / white.raw), white_of(power), white_of(lamp(name))
    stored, known = stored_matrix(case.name), (surfaces(), lamp(name))
    ideal = fit(signals_of(*known, case.curves), xyz_of(*known, observer("1931")), named, "matrix").T
    by["ideal"] = lab(signals @ (adaptation(named, white_xyz) @ ideal).T, white_xyz)
    if stored is not None:
        to_xyz = adaptation(own, white_xyz) @ (np.linalg.inv(stored) * (stored @ own))
        by["stored"] = lab(signals @ to_xyz.T, white_xyz)
    return Shown(by, truth, np.abs(by["camssf"] - truth) <= BAND * deviation)


def malvar(light: Floats) -> Floats:
    """(h, w, 3) of a mosaic RGGB (h, w)."""
    height, width = light.shape
    cells = np.pad(light, 2, mode="reflect").reshape(height // 2 + 2, 2, width // 2 + 2, 2)
    return np.moveaxis(interleaved(demosaic(cells)).reshape(3, height, width), 0, 2)


def numbers(shown: list[Shown]) -> Floats:
    """(3, 4) MEASURES by WAYS, between cameras over all pairs; NaN where LibRaw does not know all."""
    pairs = list(combinations(shown, 2))
    found = np.full((len(MEASURES), len(WAYS)), np.nan)
    for at, way in enumerate(WAYS):
        if all(way in one.by for one in shown):
            own = [(one.by[way], other.by[way]) for one, other in pairs]
            means = [(a.mean(axis=1), b.mean(axis=1)) for a, b in own]
            from_truth = [(one.by[way], one.truth) for one in shown]
            found[:, at] = [np.median([delta_e00(*pair) for pair in kind]) for kind in (own, means, from_truth)]
    return found


@cache
def stored_matrix(name: str) -> Floats | None:
    """(3, 3) XYZ to camera in LibRaw's table; None if no name there begins this make and model."""
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
    """A row a light and a measure, for cameras and phones; those that LibRaw knows by themselves, too, if not all."""
    for title, group in case_groups(run, 52):
        cases = [case for case in group if title != LEFT_OUT or stored_matrix(case.name) is not None]
        if title == LEFT_OUT:
            cases = [cases[at] for at in np.linspace(0, len(cases) - 1, run.options.cameras, dtype=int)]
        shown = {
            name: [show(case, name, np.random.default_rng([SEED, number, at])) for number, case in enumerate(cases)]
            for at, name in enumerate(run.track(LAMPS, title))
        }
        report(run, f"{title}, {len(cases)}", shown)
        some = {name: [one for one in row if "stored" in one.by] for name, row in shown.items()}
        if len(some[LAMPS[0]]) < len(cases):
            report(run, f"{title}, {len(some[LAMPS[0]])} that LibRaw knows", some)


def report(run: Run, title: str, shown: dict[str, list[Shown]]) -> None:
    """Table and bars of some cameras' pictures, by the light."""
    table = {name: numbers(row) for name, row in shown.items()}
    table["all"] = np.mean(list(table.values()), axis=0)
    columns = {"light": "", "ΔE00": ""} | dict.fromkeys(WAYS, ".2f")
    lines = [(name, *row) for name, rows in table.items() for row in zip(MEASURES, *rows.T, strict=True)]
    run.table(f"{title}: median ΔE00", columns, lines)
    for measure, (camssf, _, stored, _) in zip(MEASURES[:2], table["all"], strict=False):
        if np.isfinite(stored):
            run.bar(f"{title}: {measure} over stored", camssf / stored, most=0.6)
    inside = np.mean([one.inside for row in shown.values() for one in row])
    run.bar(f"{title}: pixels inside the 95 % bands", inside, least=0.9, most=0.98)
