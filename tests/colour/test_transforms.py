"""Colour spaces, observers, adaptation, differences, fits and indices, against colour-science and scipy."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from camssf.colorimetry import (
    D65,
    D65_XY,
    KINDS,
    delta_e00,
    fit,
    lab,
    lab_slopes,
    signals_of,
    srgb,
    terms,
    under_d65,
    xyz_of,
)
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS
from camssf.spectra import colour_science, read_chart
from camssf.spectra.bundled import observer, surfaces
from camssf.spectra.sampled import smooth
from camssf_colour import View, adapt, choose, quality_of, white_of
from tests.colour.conftest import power
from tests.support.problems import toy_camera

CHART = read_chart("classic24").values


@pytest.mark.parametrize("lamp", ["D50", "A", "FL2"])
def test_cat16_is_colour_science_s(lamp: str) -> None:
    import colour

    xyz, white, aim = xyz_of(CHART, power(lamp), observer("1931")), white_of(power(lamp)), white_of(power("D65"))
    theirs = colour.chromatic_adaptation(xyz, white, aim, method="Von Kries", transform="CAT16")
    assert np.abs(adapt(xyz, white, aim) - theirs).max() < 1e-12
    assert np.abs(adapt(white, white, aim) - aim).max() < 1e-14


@pytest.mark.parametrize("name", ["1931", "1964"])
def test_xyz_is_colour_science_s(name: str) -> None:
    import colour

    long = {"1931": "CIE 1931 2 Degree Standard Observer", "1964": "CIE 1964 10 Degree Standard Observer"}[name]
    shape = colour.SpectralShape(380, 720, 1)
    functions = colour.MSDS_CMFS[long].copy().trim(shape)
    lamp = colour.SDS_ILLUMINANTS["D65"].copy().interpolate(shape)
    table = colour.MultiSpectralDistributions(CHART[:, ::2].T, WAVELENGTHS[::2])
    theirs = colour.msds_to_XYZ(table, functions, lamp, method="Integration", shape=shape) / 100.0
    assert np.abs(xyz_of(CHART, power("D65"), observer(name)) - theirs).max() < 2e-4


def test_slopes_of_lab_are_its_derivatives() -> None:
    white = white_of(power("D50"))
    xyz = np.concatenate([xyz_of(CHART, power("D50"), observer("1931")), [[0.001, 0.002, 0.003]]])
    for c in range(3):
        step = 1e-7 * np.eye(3)[c]
        numeric = (lab(xyz + step, white) - lab(xyz - step, white)) / 2e-7
        assert np.abs(lab_slopes(xyz, white)[..., c] - numeric).max() < 1e-5 * np.abs(numeric).max()


def test_an_unknown_observer_white_and_kind_are_errors() -> None:
    for wrong in ({"observer": "1932"}, {"white": "D55"}):
        with pytest.raises(InvalidArgument):
            View(**wrong)
    with pytest.raises(InvalidArgument):
        choose(toy_camera(), power("D55"), kind="cube")


@pytest.mark.repository
def test_the_surfaces_are_what_their_source_says() -> None:
    from tools import surfaces as tool

    stored = json.loads(tool.PLACE.read_text("utf-8"))
    assert stored["surfaces"]["sha256"] == hashlib.sha256(tool.SOURCE.read_bytes()).hexdigest()
    assert tool.main(["--check"]) == 0
    assert surfaces().shape == (190, WAVELENGTHS.size)
    notice = (Path(__file__).parents[2] / "NOTICE").read_text("utf-8")
    assert "camssf/data/colour.json" in notice


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lamp", ["D55", "A", "LED-B3"])
def test_white_keeps_its_colour(kind: str, lamp: str) -> None:
    found = choose(toy_camera(), power(lamp), kind=kind)
    assert np.abs(found.apply(np.ones(3)) - white_of(power(lamp))).max() < 1e-12
    y = signals_of(CHART, power(lamp), toy_camera())
    assert np.abs(found.apply(0.1 * y) - 0.1 * found.apply(y)).max() < 1e-14  # more light changes no hue


def test_the_fit_is_the_best_one_that_keeps_white() -> None:
    """Against scipy, which minimises the same sum over what the constraint leaves free."""
    from scipy.optimize import lsq_linear

    y, white = signals_of(surfaces(), power("A"), toy_camera()), white_of(power("A"))
    target = xyz_of(surfaces(), power("A"), observer("1931"))
    for kind, p in KINDS.items():
        rows = terms(y, kind)
        free = rows[:, :-1] - rows[:, -1:]  # the last coefficient is what white leaves
        for c in range(3):
            best = lsq_linear(free, target[:, c] - white[c] * rows[:, -1], tol=1e-14).x
            ours = fit(y, target, white, kind)[:, c]
            assert np.abs(ours[:-1] - best).max() < 1e-8
            assert ours.shape == (p,)


def test_an_observer_needs_no_fit() -> None:
    """Where the Luther condition holds, a matrix gives every colour, and cross-validation chooses it."""
    mixed = observer("1931") @ np.array([[0.9, 0.1, 0.0], [0.2, 1.0, 0.1], [0.0, 0.1, 0.8]])
    found = choose(mixed, power("FL2"))
    assert found.kind == "matrix"
    assert found.delta_e00["matrix"] < 1e-6
    assert choose(toy_camera(), power("D55")).kind == "root-polynomial"
    other = choose(mixed, power("FL2"), "1964")
    assert other.delta_e00[other.kind] > 0.1


@pytest.mark.parametrize(("mix", "words"), [((0.0, 0.0), "no response"), ((0.5, 0.25), "alike")])
def test_curves_that_tell_no_third_colour_are_refused(mix: tuple[float, float], words: str) -> None:
    """Else the coefficients are rounding, hundreds of units large, and so are the colours."""
    curves = toy_camera()
    curves[:, 2] = curves[:, :2] @ mix
    with pytest.raises(InvalidArgument, match=words):
        choose(curves, power())


def test_an_observer_fulfils_luther() -> None:
    found = quality_of(observer("1931") @ np.array([[1, 0.2, 0], [0, 1, 0.1], [0.1, 0, 1]]))
    assert found.luther < 1e-12
    assert abs(found.vora - 1) < 1e-12
    assert abs(found.smi - 100) < 1e-6


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


def test_uneven_tables_are_smoothed_as_the_library_does_it() -> None:
    colour = colour_science()
    uneven, values = np.sort(RNG.uniform(380, 720, 60)), RNG.uniform(size=60)
    theirs = colour.CubicSplineInterpolator(uneven, values)(np.clip(WAVELENGTHS, uneven[0], uneven[-1]))
    assert np.abs(smooth(uneven, values) - theirs).max() < 1e-9
