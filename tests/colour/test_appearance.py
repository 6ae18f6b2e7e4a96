"""Lab, sRGB, adaptation and CIEDE2000 against colour-science; and a calibration that does not load it."""

import numpy as np

from camssf.colorimetry import D65, D65_XY, delta_e00, lab, srgb, under_d65
from camssf.spectra import camera_names, colour_science
from camssf.spectra.bundled import observer
from camssf.spectra.cameras import LIBRARY
from camssf.spectra.sampled import smooth

RNG = np.random.default_rng(3)
XYZ = RNG.uniform(0.0, 1.0, (2000, 3)) ** 3
WHITE = np.array([1.0985, 1.0, 0.3558])


def test_lab_srgb_and_adaptation_are_the_library_s() -> None:
    colour = colour_science()
    adapted = colour.chromatic_adaptation(XYZ, WHITE, colour.xy_to_XYZ(np.array(D65_XY)), method="Von Kries")
    assert np.abs(under_d65(XYZ, WHITE) - adapted).max() < 1e-13
    d65 = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    assert tuple(d65) == D65_XY
    assert np.abs(lab(XYZ, D65) - colour.XYZ_to_Lab(XYZ, d65)).max() < 1e-11
    assert np.abs(srgb(XYZ) - colour.XYZ_to_sRGB(XYZ, d65)).max() < 1e-12
    assert np.abs(srgb(XYZ * 1e-3) - colour.XYZ_to_sRGB(XYZ * 1e-3, d65)).max() < 1e-12


def test_the_difference_is_the_library_s() -> None:
    colour = colour_science()
    pairs = RNG.uniform(-1.0, 1.0, (2, 20_000, 3)) * np.array([50.0, 80.0, 80.0]) + np.array([50.0, 0.0, 0.0])
    pairs[1, :10_000] = pairs[0, :10_000] + RNG.normal(0.0, 1.0, (10_000, 3))
    pairs[:, :100, 1:] = 0.0  # greys
    pairs[0, 100:200, 1:] = 0.0
    found, expected = delta_e00(*pairs), colour.delta_E(*pairs, method="CIE 2000")
    assert np.abs(found - expected).max() < 1e-10
    assert (delta_e00(pairs[0], pairs[0]) == 0).all()


def test_shipped_tables_are_the_library_s() -> None:
    colour = colour_science()
    table = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    nm = np.linspace(380, 720, 681)
    theirs = [np.interp(nm, table.wavelengths, each) for each in np.asarray(table.values).T]
    assert np.abs(observer("1931").T - theirs).max() < 1e-15
    assert set(LIBRARY) == set(colour.MSDS_CAMERA_SENSITIVITIES)
    assert set(LIBRARY) < set(camera_names())
    uneven = np.sort(RNG.uniform(380, 720, 60))
    values = RNG.uniform(size=60)
    theirs = colour.CubicSplineInterpolator(uneven, values)(np.clip(nm, uneven[0], uneven[-1]))
    assert np.abs(smooth(uneven, values) - theirs).max() < 1e-9
