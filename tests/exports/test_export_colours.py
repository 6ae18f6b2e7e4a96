"""An export in another program: RawTherapee's colours of 24 patches, by recovered curves and by the true ones."""

from pathlib import Path

import numpy as np
import pytest

from camssf.calibration import attempt
from camssf.colorimetry import delta_e00
from camssf.documents.document import Curves
from camssf.exports import export
from camssf.grid import Floats
from camssf.result import Result
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf_colour import View, lab
from camssf_colour.picture import SPACES
from camssf_colour.standard import of_surfaces
from tests.colour.test_picture import linear
from tests.exports.conftest import run
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


def apart(one: Floats, other: Floats, white: Floats) -> float:
    """Mean ΔE00 between XYZ (24, 3), the white patch of both as light as it is: a profile has no exposure."""
    one, other = (each * (WHITE_PATCH / each[18, 1]) for each in (one, other))
    return float(delta_e00(lab(one, white), lab(other, white)).mean())


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
SRGB = SPACES["srgb"].to_xyz


def by_rawtherapee(document: Result, photo: Path, folder: Path) -> Floats:
    """XYZ (24, 3) under D65 of the chart's photo, developed with the profile, its tone curve in force."""
    import tifffile

    profile, steps, picture = folder / "camera.dcp", folder / "steps.pp3", folder / "picture.tif"
    profile.write_bytes(export(document, "dcp"))
    steps.write_text(DEVELOP.format(profile=profile), "utf-8")
    run("rawtherapee-cli", "-q", "-o", picture, "-Y", "-t", "-b16", "-p", steps, "-c", photo, home=folder)
    light = linear(tifffile.imread(picture))
    outlines = document.capture.shots[0].pose.patches
    low, high = outlines.min(axis=1).astype(int) + 20, outlines.max(axis=1).astype(int) - 20
    rgb = np.array([light[b:d, a:c].mean(axis=(0, 1)) for (a, b), (c, d) in zip(low, high, strict=True)])
    return np.asarray(rgb @ SRGB.T)


def test_rawtherapee_develops_the_true_curves_colours_with_the_dcp(tmp_path: Path) -> None:
    """From a simulated photo to sRGB, against the profile of the true curves and against the chart's own colours.

    The camera is a Nikon D850, whose curves rawtoaces-data holds on one scale.
    """
    camera, power = read_camera(D850).values, read_lamp(LAMP).values
    shot = photos(LAMP, str(D850)).shots[0]
    result = attempt(shot.shot)
    white = power @ camera
    curves = Curves.of(camera / camera.max(axis=0))
    of_truth = changed(result, answer__curves=curves, answer__channel_gain=white / white[1])
    true, found = (by_rawtherapee(each, shot.chart, tmp_path) for each in (of_truth, result))
    assert apart(true, found, SRGB @ np.ones(3)) < NEAR
    chart = of_surfaces(read_chart("classic24").values, read_lamp(LAMP).values, View(white="D65"))[1]
    light = found * (WHITE_PATCH / found[18, 1])
    inside = np.arange(24) != 17  # cyan lies outside of sRGB
    assert delta_e00(lab(light, SRGB @ np.ones(3)), chart)[inside].mean() < 2.0
