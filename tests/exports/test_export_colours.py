"""Exports in other people's programs: the colours of 24 patches, of recovered curves and of the true ones.

A simulated Nikon D850, whose curves rawtoaces-data holds on one scale, photographs a chart under D55. Its result is
exported, and so are the true curves; each program turns the same signals into colours with both.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from camssf.calibration import attempt
from camssf.colorimetry import delta_e00
from camssf.documents.document import Curves
from camssf.exports import export
from camssf.grid import Floats
from camssf.result import Result
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf_colour import View, lab, white_of
from camssf_colour.standard import of_surfaces
from camssf_lab.simulation.frames import SimulatedShot
from tests.exports.conftest import pyspectacle, run
from tests.support.captures import photos
from tests.support.documents import changed

pytestmark = pytest.mark.full
ROOT = Path(__file__).parents[2]
D850 = ROOT / "data" / "rawtoaces" / "Nikon_D850_380_780_5.json"
LAMP = "D55"
NEAR = 1.5
"""Mean ΔE00 of 24 patches."""
WHITE_PATCH = 0.885
"""Y of the chart's white."""


class Captured(NamedTuple):
    """A result, the same with the true curves in it, raw signals (24, 3) of the patches, and the chart's photo."""

    found: Result
    true: Result
    raw: Floats
    shot: SimulatedShot


@pytest.fixture(scope="module")
def captured() -> Captured:
    camera = read_camera(D850)
    shot = photos(LAMP, str(D850)).shots[0]
    found = attempt(shot.shot)
    power = read_lamp(LAMP).values
    white = power @ camera.values
    curves = Curves.of(camera.values / camera.values.max(axis=0))
    true = changed(found, answer__curves=curves, answer__channel_gain=white / white[1])
    raw = read_chart("classic24").values @ (power[:, None] * camera.values)
    return Captured(found, true, np.asarray(0.9 * raw / white.max()), shot)


def apart(one: Floats, other: Floats, white: Floats) -> float:
    """Mean ΔE00 between XYZ (24, 3), the white patch of both as light as it is: a profile has no exposure."""
    one, other = (each * (WHITE_PATCH / each[18, 1]) for each in (one, other))
    return float(delta_e00(lab(one, white), lab(other, white)).mean())


# -- programs that read the curves: they find the white balance from them -----------------------------------------


SPECTACLE = """
import json, pathlib, sys
import numpy as np
import scipy.integrate
from spectacle import spectral
table = spectral.load_spectral_response(pathlib.Path(sys.argv[1]))
curves = spectral.convert_RGBG2_to_RGB(table[1:5])
matrix = spectral.calculate_XYZ_matrix(table[0], curves)
raw = np.array(json.load(sys.stdin))
print(json.dumps(spectral.convert_to_XYZ(matrix, raw / curves.sum(axis=1)).tolist()))
"""


def by_spectacle(document: Result, raw: Floats, folder: Path) -> tuple[Floats, Floats]:
    """pyspectacle's reader and its matrix to XYZ, for signals of which equal energy gives 1, 1, 1."""
    xyz = pyspectacle(SPECTACLE, folder, export(document, "spectacle"), raw.tolist())
    return np.array(xyz), white_of(read_lamp(LAMP).values)


def test_curves_give_the_true_curves_colours_in_spectacle(
    captured: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    true, white = by_spectacle(captured.true, captured.raw, tmp_path)
    found, _ = by_spectacle(captured.found, captured.raw, tmp_path)
    assert apart(true, found, white) < NEAR
    monkeypatch.setattr("camssf.exports.curves.channel_scale", lambda document: np.ones(3))
    flat, _ = by_spectacle(captured.found, captured.raw, tmp_path)  # curves of peak 1, as before
    assert apart(true, flat, white) > 2.5 * NEAR


# -- programs that read a profile ---------------------------------------------------------------------------------


DEVELOP = """
[Version]
AppVersion=5.9
Version=349
[Exposure]
Auto=false
HistogramMatching=false
[White Balance]
Enabled=true
Setting=Camera
[Color Management]
InputProfile=file:{profile}
ToneCurve=true
ApplyLookTable=false
ApplyBaselineExposureOffset=false
ApplyHueSatMap=false
WorkingProfile=ProPhoto
OutputProfile=RTv4_sRGB
OutputProfileIntent=Relative
"""
SRGB = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]]
)


def by_rawtherapee(document: Result, captured: Captured, folder: Path) -> Floats:
    """XYZ (24, 3) under D65 of the chart's photo, developed with the profile, its tone curve in force."""
    import tifffile

    profile, steps, picture = folder / "camera.dcp", folder / "steps.pp3", folder / "picture.tif"
    profile.write_bytes(export(document, "dcp"))
    steps.write_text(DEVELOP.format(profile=profile), "utf-8")
    photo = captured.shot.chart
    run("rawtherapee-cli", "-q", "-o", picture, "-Y", "-t", "-b16", "-p", steps, "-c", photo, home=folder)
    coded = tifffile.imread(io.BytesIO(picture.read_bytes())) / 65535.0
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    outlines = captured.found.capture.shots[0].pose.patches  # type: ignore[union-attr]
    low, high = outlines.min(axis=1).astype(int) + 20, outlines.max(axis=1).astype(int) - 20
    rgb = np.array([linear[b:d, a:c].mean(axis=(0, 1)) for (a, b), (c, d) in zip(low, high, strict=True)])
    return np.asarray(rgb @ SRGB.T)


def test_rawtherapee_develops_the_true_curves_colours_with_the_dcp(captured: Captured, tmp_path: Path) -> None:
    """From a simulated photo to sRGB, against the profile of the true curves and against the chart's own colours."""
    true, found = (by_rawtherapee(each, captured, tmp_path) for each in (captured.true, captured.found))
    white = SRGB @ np.ones(3)
    assert apart(true, found, white) < NEAR
    chart = of_surfaces(read_chart("classic24").values, read_lamp(LAMP).values, View(white="D65"))[1]
    light = found * (WHITE_PATCH / found[18, 1])
    inside = np.arange(24) != 17  # cyan lies outside of sRGB
    assert delta_e00(lab(light, white), chart)[inside].mean() < 2.0
