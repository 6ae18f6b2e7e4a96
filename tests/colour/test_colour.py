"""Colour: against colour-science, against truth, and each part of the covariance against drawing it."""

import hashlib
import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf import cli
from camssf.colorimetry import KINDS, delta_e00, fit, lab_slopes, signals_of, terms, xyz_of
from camssf.documents.curve_errors import modes_of_bands
from camssf.documents.document import Curves
from camssf.documents.forms import from_plain, to_plain
from camssf.documents.schema import schema
from camssf.errors import CalibrationError, ColourOutOfReach, InvalidArgument, LampUnfit, Overexposed
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery import Observation, recover
from camssf.recovery.basis import interpolate, misfit_profile, read_basis
from camssf.recovery.sensitivity import SolverSettings
from camssf.result import Result
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf.spectra.bundled import observer, surfaces
from camssf.verdict.reasons import Verdict
from camssf_colour import (
    PARTS,
    Camera,
    LitSurfaces,
    Reference,
    View,
    adapt,
    camera_of_result,
    camera_of_ssf,
    choose,
    convert,
    lab,
    quality_of,
    read_prior,
    spectrum,
    standard_colour,
    white_of,
)
from camssf_colour.camera import OwnWhite
from camssf_colour.colour_error import expected_error, true_error
from camssf_colour.document import ColourDocument
from camssf_colour.light import see
from camssf_colour.posterior import surface_posterior
from camssf_colour.reach import MOST, REACH, check_reach
from camssf_colour.regions import against, measure_regions
from camssf_colour.response import surface_response
from camssf_colour.standard import of_surfaces
from camssf_fleet.passport.excerpt import excerpt_of
from tests.support.documents import document
from tests.support.problems import bell, measured_cameras, toy_camera
from tests.support.scenes import mosaic
from tests.support.schemas import check_schema

ROOT = Path(__file__).parents[2]
SCHEMA = schema(ColourDocument)
CHART = read_chart("classic24").values


def power(name: str = "D55") -> Floats:
    return read_lamp(name).values


def exact(curves: Floats | None = None) -> Camera:
    curves = toy_camera() if curves is None else curves
    return Camera("toy", curves / curves.max(axis=0), np.zeros((0, *curves.shape)))


def blurred(size: float = 0.02) -> Camera:
    """With two errors of its curves: red too far right, green too wide."""
    one = exact()
    modes = np.zeros((2, *one.values.shape))
    modes[0, :, 0] = size * np.gradient(one.values[:, 0], WAVELENGTHS) * 40
    modes[1, :, 1] = size * bell(500, 15)
    return replace(one, modes=modes)


def spread(parts: dict[str, tuple[Floats, Floats]], name: str) -> Floats:
    return np.sqrt(np.diagonal(parts[name][1], axis1=1, axis2=2))


# -- spaces -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lamp", ["D50", "A", "FL2"])
def test_lab_and_cat16_are_colour_science_s(lamp: str) -> None:
    import colour

    xyz, white = xyz_of(CHART, power(lamp), observer("1931")), white_of(power(lamp))
    theirs = colour.XYZ_to_Lab(xyz, colour.XYZ_to_xy(white))
    assert np.abs(lab(xyz, white) - theirs).max() < 1e-10
    aim = white_of(power("D65"))
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


# -- what ships -------------------------------------------------------------------------------------------------


@pytest.mark.repository
def test_the_surfaces_are_what_their_source_says() -> None:
    from tools import surfaces as tool

    stored = json.loads(tool.PLACE.read_text("utf-8"))
    assert stored["surfaces"]["sha256"] == hashlib.sha256(tool.SOURCE.read_bytes()).hexdigest()
    assert tool.main(["--check"]) == 0
    assert surfaces().shape == (190, WAVELENGTHS.size)
    notice = (ROOT / "NOTICE").read_text("utf-8")
    assert "camssf/data/colour.json" in notice


@pytest.mark.repository
def test_a_drift_of_the_surfaces_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from tools import surfaces as tool

    other = tmp_path / "colour.json"
    other.write_text(tool.PLACE.read_text("utf-8").replace("0.0893", "0.0894", 1), "utf-8")
    monkeypatch.setattr(tool, "PLACE", other)
    assert tool.main(["--check"]) == 1


# -- transforms -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lamp", ["D55", "A", "LED-B3"])
def test_white_keeps_its_colour(kind: str, lamp: str) -> None:
    found = choose(toy_camera(), power(lamp), kind=kind)
    assert np.abs(found.apply(np.ones(3)) - white_of(power(lamp))).max() < 1e-12
    assert np.abs(found.apply(np.full(3, 0.3)) - 0.3 * white_of(power(lamp))).max() < 1e-12


def test_more_light_changes_no_hue() -> None:
    found = choose(toy_camera(), power("D55"))
    y = signals_of(CHART, power("D55"), toy_camera())
    assert found.kind == "root-polynomial"
    assert np.abs(found.apply(0.1 * y) - 0.1 * found.apply(y)).max() < 1e-14


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
    other = choose(mixed, power("FL2"), "1964")
    assert other.delta_e00[other.kind] > 0.1


def test_unseen_surfaces_judge_the_kinds() -> None:
    found = choose(toy_camera(), power("D55"))
    assert found.delta_e00["root-polynomial"] < found.delta_e00["matrix"]
    y = signals_of(surfaces(), power("D55"), toy_camera())
    seen = found.apply(y) - xyz_of(surfaces(), power("D55"), observer("1931"))
    left = found.residual * np.mean(y, axis=1, keepdims=True)
    assert (seen**2).sum() < (left**2).sum()  # what was left out is missed by more


def test_curves_that_do_not_see_the_lamp_are_refused() -> None:
    curves = toy_camera()
    curves[:, 2] = 0.0
    with pytest.raises(InvalidArgument, match="no response"):
        choose(curves, power("D55"))


def test_a_curve_that_the_others_make_up_is_refused() -> None:
    """Else the coefficients are rounding, hundreds of units large, and so are the colours."""
    curves = toy_camera()
    curves[:, 2] = 0.5 * curves[:, 0] + 0.25 * curves[:, 1]
    with pytest.raises(InvalidArgument, match="alike"):
        choose(curves, power("D55"))


# -- standard colour --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("view", [View(), View("1964"), View(white="D65"), View("1964", "D50")])
def test_colours_of_a_camera_that_is_nearly_an_observer_are_true(view: View) -> None:
    curves = observer(view.observer)
    y = signals_of(CHART, power("A"), curves)
    stated = replace(read_lamp("A"), tolerance=0.0)
    found = standard_colour(exact(curves), stated, y, reference=Reference(0.0), view=view)
    xyz, colours = of_surfaces(CHART, power("A"), view)
    assert np.abs(found.xyz - xyz).max() < 1e-9
    assert np.abs(found.lab - colours).max() < 1e-6


@pytest.mark.requirement("R-COLOUR")
def test_parts_add_up_and_are_covariances() -> None:
    y = signals_of(CHART, power("A"), toy_camera())
    found = standard_colour(blurred(), "A", y, 0.01 * y, view=View(white="D65"))
    assert tuple(found.parts) == PARTS
    for i, total in enumerate((found.xyz_covariance, found.lab_covariance)):
        assert np.abs(total - sum(part[i] for part in found.parts.values())).max() < 1e-12 * np.abs(total).max()
        assert (np.linalg.eigvalsh(total) > 0).all()
        for part in found.parts.values():
            least = np.linalg.eigvalsh(part[i])
            assert (least > -1e-12 * np.abs(total).max()).all()


@pytest.mark.parametrize("view", [View(), View("1964", "D50")])
def test_a_colour_is_its_spectrum_s(view: View) -> None:
    y = signals_of(CHART[:6], power("A"), toy_camera())
    reference = Reference(0.02)
    found = standard_colour(blurred(), "A", y, 0.01 * y, reference=reference, view=view)
    whole = spectrum(blurred(), LitSurfaces("A", y, 0.01 * y, reference), view=view)
    for name in ("xyz", "lab", "xyz_covariance", "lab_covariance", "white"):
        ours, theirs = getattr(found, name), getattr(whole, name)
        assert np.abs(ours - theirs).max() < 1e-11 * np.abs(theirs).max(), name


def test_the_covariance_of_the_signals_is_that_of_all_errors() -> None:
    """Against drawing curves and noise, for a surface of the prior."""
    rng, camera, row = np.random.default_rng(5), blurred(), surfaces()[17]
    stated = replace(read_lamp("D55"), tolerance=0.0)
    y = signals_of(row[None], stated.values, camera.values)
    response, _ = surface_response([see(camera, stated)], [Reference(0.0)], View(), reflectance=False)
    found = surface_posterior(read_prior("general"), response, y, 0.01 * y)
    values = camera.values + np.einsum("nq,qmc->nmc", rng.normal(size=(4000, 2)), camera.modes)
    light = stated.values[:, None] * values
    drawn = (row @ light) / light.sum(axis=1) + 0.01 * y * rng.normal(size=(4000, 3))
    truth = np.cov(drawn.T)
    scale = np.sqrt(np.outer(np.diagonal(truth), np.diagonal(truth)))
    assert np.abs((found.signal_covariance[0] - truth) / scale).max() < 0.1


@pytest.mark.parametrize("lamp", ["D55", "A", "LED-B3", "FL2"])
def test_white_is_nearly_white(lamp: str) -> None:
    found = standard_colour(exact(), lamp, np.ones(3))
    assert np.abs(found.lab[0] - [100.0, 0.0, 0.0]).max() < 0.25


def test_many_colours_at_once_are_the_same_as_one_by_one() -> None:
    y = signals_of(surfaces()[: MOST + 6], power("D65"), toy_camera())
    many = standard_colour(blurred(), "D65", y, 0.002)
    assert np.isnan(many.reach).all()
    for i in (0, 50, MOST + 5):
        one = standard_colour(blurred(), "D65", y[i], 0.002)
        assert np.abs(one.lab[0] - many.lab[i]).max() < 1e-9
        assert np.abs(one.lab_covariance[0] - many.lab_covariance[i]).max() < 1e-9


@pytest.mark.parametrize("wrong", [np.ones(2), np.array([[1.0, np.nan, 1.0]]), np.ones((1, 1, 3))])
def test_signals_that_are_none_are_refused(wrong: Floats) -> None:
    with pytest.raises(InvalidArgument, match="Signals"):
        standard_colour(exact(), "D55", wrong)


def test_errors_that_are_none_are_refused() -> None:
    with pytest.raises(InvalidArgument, match="standard error"):
        standard_colour(exact(), "D55", np.ones(3), -0.1)


def test_colours_say_what_they_are() -> None:
    found = standard_colour(blurred(), "D55", np.full((6, 3), 0.4), 0.002)
    half = 1.96 * np.sqrt(found.lab_covariance[0].diagonal())
    assert repr(found).startswith(
        f"<Colours under D55, CIE 1931, white lamp: L* {found.lab[0, 0]:.1f} ± {half[0]:.1f}, "
    )
    assert repr(found).endswith("; 2 more>")


# -- the colour error of a result -------------------------------------------------------------------------------


def test_the_expected_colour_error_is_that_of_draws_from_the_covariance() -> None:
    """ΔE00 between each colour of the chart and draws of it: root mean square, then the mean over the colours."""
    made = document("D55")
    made = replace(made, verdict=Verdict("accepted"))
    found = expected_error(made)
    assert found is not None
    camera, light = camera_of_result(made), read_lamp("D65")
    colours = standard_colour(camera, light, signals_of(read_chart("classic24").values, light.values, camera.values))
    rng = np.random.default_rng(5)
    pairs = zip(colours.lab, colours.lab_covariance, strict=True)
    drawn = np.stack([rng.multivariate_normal(lab, cov, 4000) for lab, cov in pairs])
    errors = np.sqrt(np.mean(delta_e00(np.broadcast_to(colours.lab[:, None], drawn.shape), drawn) ** 2, axis=1))
    assert found.chart == pytest.approx(errors.mean(), rel=0.1)
    assert found.skin == pytest.approx(errors[:2].mean(), rel=0.1)
    assert f"{found.chart:.1f} ΔE00" in found.in_words()


def test_a_wider_band_is_a_larger_colour_error_and_no_band_is_none() -> None:
    made = document("D55")
    answer = replace(made.answer, code_covariance=None)
    errors = []
    for factor in (0.3, 1.0, 3.0):
        std = Curves.of(factor * answer.std.values)
        errors.append(expected_error(replace(made, answer=replace(answer, std=std))))
    sizes = [error.chart for error in errors if error is not None]
    assert sizes == sorted(sizes)
    assert sizes[2] > 1.2 * sizes[1]
    assert expected_error(replace(made, answer=replace(answer, std=None))) is None


def test_the_true_colour_error_is_least_for_the_true_curves() -> None:
    truth, other = (read_camera(name).values for name in ("Canon EOS 5D Mark II", "Nikon 5100 (NPL)"))
    own, foreign = true_error(truth, truth), true_error(other, truth)
    assert own is not None
    assert foreign is not None
    assert own < 1.0 < foreign


# -- out of reach -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("signal", "far"),
    [
        ((1.0, 1.0, 1.0), False),
        ((0.0, 0.0, 0.0), False),
        ((0.4, 0.2, 0.1), False),
        ((1.3, 1.3, 1.3), True),  # brighter than white
        ((0.02, 0.9, 0.02), True),  # no surface is so green to curves that overlap
        ((-0.2, 0.1, 0.1), True),
    ],
)
def test_a_colour_that_no_surface_has_is_found_out(signal: tuple[float, ...], far: bool) -> None:
    found = standard_colour(blurred(0.005), "D55", np.array(signal), 0.002)
    assert (found.reach[0] > REACH) == far
    if far:
        with pytest.raises(ColourOutOfReach, match="Colour 1") as caught:
            check_reach(found.reach)
        assert caught.value.value == found.reach[0]
        assert caught.value.exit_status == 9


def test_every_real_surface_is_in_reach() -> None:
    for name in ("D55", "A", "LED-B3", "FL2"):
        y = signals_of(surfaces()[:60], power(name), toy_camera())
        assert standard_colour(exact(), name, y, 0.002).reach.max() < 3.0


# -- lamps by what the reference says ---------------------------------------------------------------------------


def owned(camera: Camera, name: str = "D55") -> Camera:
    raw = power(name) @ camera.values
    return replace(camera, own=OwnWhite(raw / raw[1], read_lamp(name)))


@pytest.mark.parametrize(
    ("true", "kind"), [("D65", "daylight"), ("2500K", "bulb"), ("LED-B4", "white-led"), ("FL2", "fluorescent")]
)
def test_auto_gives_nearly_the_colours_of_the_lamp_named(true: str, kind: str) -> None:
    camera = owned(blurred(0.005))
    y, raw = signals_of(CHART[:18], power(true), camera.values), 3000.0 * (power(true) @ camera.values)
    truth = of_surfaces(CHART[:18], power(true), View())[1]
    named = standard_colour(camera, true, y, reference=Reference(raw=raw))
    auto = standard_colour(camera, "auto", y, reference=Reference(raw=raw))
    weights = dict(auto.lamps)
    assert set(weights) == {"daylight", "bulb", "white-led", "fluorescent"}
    assert abs(sum(weights.values()) - 1) < 1e-12
    assert weights[kind] > 0.02
    off, off_named = (np.linalg.norm(each.lab - truth, axis=1).mean() for each in (auto, named))
    assert off < off_named + 4.0
    chi = np.einsum(
        "mc,mc->m", truth - auto.lab, np.linalg.solve(auto.lab_covariance, (truth - auto.lab)[..., None])[..., 0]
    )
    assert np.mean(chi < 7.815) > 0.8
    assert spread(auto.parts, "lamp").mean() > spread(named.parts, "lamp").mean()


def test_the_reference_narrows_a_lamp_known_by_kind() -> None:
    camera = owned(exact())
    y, raw = signals_of(CHART, power("D75"), camera.values), power("D75") @ camera.values
    alone = standard_colour(camera, "daylight", y)
    asked = standard_colour(camera, "daylight", y, reference=Reference(raw=raw))
    assert spread(asked.parts, "lamp").mean() < 0.7 * spread(alone.parts, "lamp").mean()
    assert asked.chi_squared is not None
    assert alone.chi_squared is None
    # and moves it: the estimate is bluer than the kind's mean
    light = see(camera, read_lamp("daylight"), np.log((raw / raw[1])[[0, 2]]), 0.005)
    assert light.power[:100].mean() / light.power[-100:].mean() > 1.05 * (
        read_lamp("daylight").values[:100].mean() / read_lamp("daylight").values[-100:].mean()
    )


def test_conditioning_is_bayes_by_drawing() -> None:
    """Weighted draws of a bulb's temperature and the smooth error give the mean and spread that `see` states."""
    camera = owned(exact())
    named = read_lamp("bulb")
    raw = power("2600K") @ camera.values
    seen = np.log((raw / raw[1])[[0, 2]])
    light = see(camera, named, seen, 0.02)
    from camssf_colour.light import OWN_WHITE, lamp_modes

    rng = np.random.default_rng(3)
    modes = lamp_modes(named)
    u = rng.normal(size=(12000, len(modes)))
    powers = named.values * np.maximum(1 + u @ modes, 0.02)
    own = read_lamp("D55").values * (1 + 0.02 * 0)
    logs = np.log(camera.own.raw * (powers @ camera.values) / (own @ camera.values))  # type: ignore[union-attr]
    ratios = logs[:, [0, 2]] - logs[:, 1:2]
    from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors

    smooth = 0.02 * smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T * own
    of_own = (smooth @ camera.values / (own @ camera.values)).T
    of_own = of_own[[0, 2]] - of_own[1]
    noise = of_own @ of_own.T + (OWN_WHITE**2 + 0.02**2) * (np.eye(2) + 1)
    off = seen - ratios
    weight = np.exp(-0.5 * np.einsum("ni,ij,nj->n", off, np.linalg.inv(noise), off))
    weight /= weight.sum()
    mean = weight @ powers
    std = np.sqrt(weight @ (powers - mean) ** 2)
    stated = np.sqrt((light.power_modes**2).sum(axis=0))
    assert np.abs(light.power - mean).max() < 0.25 * std.max()
    assert np.abs(stated / std - 1).max() < 0.15


def test_a_reference_that_contradicts_the_lamp_is_refused() -> None:
    camera = owned(blurred(0.005))
    raw = power("A") @ camera.values
    with pytest.raises(LampUnfit, match="not white under D55"):
        standard_colour(camera, "D55", np.full(3, 0.5), reference=Reference(raw=raw))
    standard_colour(camera, "A", np.full(3, 0.5), reference=Reference(raw=raw))


@pytest.mark.parametrize("raw", [None, np.array([1.0, 0.0, 1.0]), np.array([1.0, 1.0])])
def test_auto_needs_a_reference(raw: Floats | None) -> None:
    with pytest.raises(InvalidArgument):
        standard_colour(owned(exact()), "auto", np.full(3, 0.5), reference=Reference(raw=raw))
    with pytest.raises(InvalidArgument, match="lamp is unknown"):
        standard_colour(exact(), "auto", np.full(3, 0.5), reference=Reference(raw=np.ones(3)))


# -- cameras ----------------------------------------------------------------------------------------------------


def test_a_camera_of_an_ssf_has_its_bands() -> None:
    lamps = np.stack([power("D55"), power("A")])
    y = ((lamps[:, None] * CHART) @ toy_camera()) / (lamps @ toy_camera())[:, None]
    observation = Observation(y, CHART, lamps, standard_error=0.003 * y)
    answer = recover(observation, basis="cameras", settings=SolverSettings(engine="reference"))
    camera = camera_of_ssf(answer, read_basis("cameras"), lamps[0])
    curves, std = answer.peak()
    assert np.array_equal(camera.values, curves)
    assert np.abs(np.sqrt((camera.modes**2).sum(axis=0)) - std).max() < 1e-4 * std.max()
    # channels err together: what drawing the code gives
    rng = np.random.default_rng(2)
    codes = answer.code.T.ravel() + rng.multivariate_normal(np.zeros(answer.code.size), answer.code_covariance, 3000)
    from camssf.recovery.rows import anchor

    basis = anchor(read_basis("cameras"), lamps[0])
    drawn = basis.mean + np.einsum("cmr,ncr->ncm", basis.dictionary, codes.reshape(-1, 3, answer.code.shape[0]))
    drawn = drawn / drawn[:, np.arange(3), curves.argmax(axis=0)][..., None]
    at = [(0, 440), (1, 300), (2, 160), (0, 300)]
    picked = np.stack([drawn[:, c, m] for c, m in at])
    ours = np.stack([camera.modes[:, m, c] for c, m in at]) @ np.stack([camera.modes[:, m, c] for c, m in at]).T
    missed = interpolate(misfit_profile()[..., None])[..., 0]
    expected = np.cov(picked) + np.diag([missed[c, m] ** 2 for c, m in at])
    assert np.abs(ours - expected).max() < 0.12 * np.abs(ours).max()
    with pytest.raises(InvalidArgument, match="prior"):
        camera_of_ssf(replace(answer, code_covariance=None), read_basis("cameras"), lamps[0])


def test_modes_of_bands_have_the_bands() -> None:
    std = 0.01 + 0.02 * toy_camera()
    modes = modes_of_bands(std)
    assert np.abs(np.sqrt((modes**2).sum(axis=0)) / std - 1).max() < 1e-3


def test_a_camera_must_have_the_grid_and_a_peak() -> None:
    with pytest.raises(InvalidArgument, match="do not fit together"):
        Camera("x", np.ones((3, 681)), np.zeros((0, 681, 3)))
    with pytest.raises(InvalidArgument, match="peak"):
        Camera("x", np.zeros((681, 3)), np.zeros((0, 681, 3)))


# -- indices ----------------------------------------------------------------------------------------------------


def test_an_observer_fulfils_luther() -> None:
    found = quality_of(observer("1931") @ np.array([[1, 0.2, 0], [0, 1, 0.1], [0.1, 0, 1]]))
    assert found.luther < 1e-12
    assert abs(found.vora - 1) < 1e-12
    assert abs(found.smi - 100) < 1e-6


def test_real_cameras_are_where_cameras_are() -> None:
    found = [quality_of(curves) for curves in list(measured_cameras().values())[::17]]
    assert all(70 < each.smi < 95 for each in found)
    assert all(0.85 < each.vora < 1 for each in found)
    assert all(0 < each.luther < 0.2 for each in found)
    assert all(each.matrix.kind == "matrix" and each.polynomial.kind == "root-polynomial" for each in found)


# -- regions ----------------------------------------------------------------------------------------------------


def picture() -> Any:
    """Black 512; left half 1512 above black 1000, right half 2512; one hot pixel."""
    rng = np.random.default_rng(1)
    samples = np.full((80, 100), 1512.0)
    samples[:, 50:] = 2512.0
    samples = np.rint(samples + 3 * rng.normal(size=samples.shape)).astype(np.uint16)
    samples[20, 20] = 16383
    return mosaic(samples)


def test_regions_are_measured() -> None:
    left, right = measure_regions(picture(), [(10, 10, 30, 40), (60, 10, 30, 40)])
    assert np.abs(left.raw - 1000).max() < 1
    assert np.abs(right.raw - 2000).max() < 1
    assert (left.error > 0.05).all()
    assert (left.error < 0.4).all()
    y, error = against([left], right, 0.9)
    assert np.abs(y - 0.45).max() < 1e-3
    assert np.abs(error / (0.9 * np.hypot(left.error / 2000, 0.5 * right.error / 2000)) - 1).max() < 0.01


def test_a_region_is_measured_to_its_borders() -> None:
    samples = np.full((80, 100), 1512, np.uint16)
    samples[10:50, 10:40] += np.uint16(1)
    (inside,) = measure_regions(mosaic(samples), [(10, 10, 30, 40)])
    assert np.array_equal(inside.raw, [1001.0] * 3)


@pytest.mark.parametrize(
    ("rectangle", "words"),
    [
        ((90, 10, 30, 40), "leaves the photo"),
        ((-1, 10, 30, 40), "leaves the photo"),
        ((10, 10, 0, 40), "empty"),
        ((10, 10, float("nan"), 40), "empty"),
        ((10, 10, 4, 4), "samples"),
    ],
)
def test_a_region_that_is_none_is_refused(rectangle: Any, words: str) -> None:
    with pytest.raises(InvalidArgument, match=words):
        measure_regions(picture(), [rectangle])


def test_a_clipped_region_is_refused() -> None:
    samples = np.full((80, 100), 16383, np.uint16)
    with pytest.raises(Overexposed, match="Region 1"):
        measure_regions(mosaic(samples), [(10, 10, 30, 40)])


def test_a_reference_must_be_lit() -> None:
    left, right = measure_regions(picture(), [(10, 10, 30, 40), (60, 10, 30, 40)])
    with pytest.raises(InvalidArgument, match="reflectance"):
        against([left], right, 18.0)
    with pytest.raises(InvalidArgument, match="dark"):
        against([left], replace(right, raw=np.array([1.0, 1.0, 1.0]), error=np.ones(3)), 0.9)


# -- the whole way ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A folder with chart-D55.dng, chart-A.dng and the result of both."""
    from camssf.calibration import attempt
    from camssf.documents.document import document_bytes
    from camssf.options import Options
    from camssf_lab.simulation.frames import simulate
    from camssf_lab.simulation.scene import Scene

    folder = tmp_path_factory.mktemp("colour")
    scene = simulate("Nikon 5100 (NPL)", ["D55", "A"], folder, scene=Scene(size=(900, 675)), seed=3)
    result = attempt([shot.shot for shot in scene.shots], options=Options(engine="reference"))
    (folder / "result.json").write_bytes(document_bytes(result))
    return folder, result


def place(document: Result, patch: int) -> str:
    outline = document.capture.shots[0].pose.patches[patch]
    x, y = outline.min(axis=0) + 12
    return f"{x:.0f},{y:.0f},56,56"


@pytest.mark.full
def test_a_result_s_own_covariance_is_taken(calibrated: tuple[Path, Result]) -> None:
    document = calibrated[1]
    camera = camera_of_result(document)
    answer, band = document.answer, document.std
    assert np.abs(np.sqrt((camera.modes**2).sum(axis=0)) - band).max() < 1e-4 * band.max()
    assert camera.own is not None
    assert camera.own.lamp.name == "D55"
    y = signals_of(CHART, power("LED-B3"), camera.values)
    by_band = camera_of_result(replace(document, answer=replace(answer, code_covariance=None)))
    ours, theirs = (
        np.sqrt(np.diagonal(standard_colour(each, "LED-B3", y).parts["curves"][1], axis1=1, axis2=2)).mean()
        for each in (camera, by_band)
    )
    assert ours < theirs < 4 * ours  # bands alone overrate, and must not underrate
    other = replace(document, answer=replace(answer, basis_sha256="0" * 64))
    assert np.array_equal(camera_of_result(other).modes, by_band.modes)  # another release's basis of this name
    assert camera_of_result(replace(document, answer=replace(answer, std=None))).modes.shape[0] == 0
    first, *rest = document.capture.shots
    nameless = replace(first, lamp=replace(first.lamp, name="lost.csv"))
    of_file = replace(document, capture=replace(document.capture, shots=(nameless, *rest)))
    kept = camera_of_result(of_file).own  # its spectrum is in the document
    assert kept is not None
    assert np.array_equal(kept.lamp.values, camera.own.lamp.values)
    excerpt = excerpt_of(document)
    assert camera_of_result(excerpt).own.lamp.name == "D55"
    assert not camera_of_result(excerpt).whole
    assert camera_of_result(excerpt_of(of_file)).own is None  # but not in the excerpt


@pytest.mark.requirement("R-COLOUR")
@pytest.mark.full
@pytest.mark.parametrize("told", ["A", "bulb", "auto"])
def test_the_command_states_true_colours(
    told: str, calibrated: tuple[Path, Result], capsys: pytest.CaptureFixture[str]
) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    folder, document = calibrated
    patches = (0, 4, 12, 14, 15)
    regions = [word for patch in patches for word in ("--region", place(document, patch))]
    white = xyz_of(CHART[18], power("A"), observer("1931"))[1]
    arguments = ["--lamp", told, "--white-region", f"{place(document, 18)},{white:.4f}"]
    status = cli.main(
        ["colour", str(folder / "result.json"), str(folder / "chart-A.dng"), *regions, *arguments, "--adapt", "D65"]
    )
    said = capsys.readouterr()
    assert status == 0, said.err
    found = json.loads(said.out)
    jsonschema.Draft202012Validator(SCHEMA).validate(found)
    assert to_plain(from_plain(found, ColourDocument, "it", "")) == found
    assert found["result"]["sha256"] == hashlib.sha256((folder / "result.json").read_bytes()).hexdigest()
    assert found["white"]["of"] == "D65"
    truth = of_surfaces(CHART[list(patches)], power("A"), View(white="D65"))[1]
    got = np.array([region["lab"] for region in found["regions"]])
    off = got - truth
    assert np.linalg.norm(off, axis=1).mean() < 3.5
    chi = [o @ np.linalg.solve(region["lab_covariance"], o) for o, region in zip(off, found["regions"], strict=True)]
    assert max(chi) < 16.3
    assert said.err.count("region ") == len(patches)


@pytest.mark.full
def test_the_command_says_no(calibrated: tuple[Path, Result], capsys: pytest.CaptureFixture[str]) -> None:
    folder, document = calibrated
    base = ["colour", str(folder / "result.json"), str(folder / "chart-D55.dng")]
    here, white = ["--region", place(document, 3)], ["--white-region", place(document, 18)]
    dark = ["--white-region", f"{place(document, 23)},0.9"]
    for arguments, status, words in (
        ([], 2, "needs a region"),
        (here, 2, "needs a region"),
        (["--region", "1,2,3", *white], 2, "not a rectangle"),
        (["--region", "1,2,x,4", *white], 2, "not a rectangle"),
        ([*here, *white, "--observer", "1932"], 2, "observer"),
        ([*here, *white, "--adapt", "D55"], 2, "D55"),
        ([*here, *white, "--lamp", "A"], 6, "not white under A"),
        ([*here, *white, "--lamp", "nonsense"], 2, "No lamp"),
        ([*here, "--white-region", f"{place(document, 18)},90"], 2, "reflectance"),
        ([*here, "--white-region", f"{place(document, 18)},18%"], 2, "0.18"),
        (["--region", place(document, 18), *dark], 9, "Colour 1"),
    ):
        assert cli.main([*base, *arguments]) == status, arguments
        assert words in capsys.readouterr().err, arguments
    shots = tuple(replace(shot, photo=replace(shot.photo, model="other")) for shot in document.capture.shots)
    other = replace(document, capture=replace(document.capture, shots=shots)).save(folder / "other.json")
    assert cli.main(["colour", str(other), base[2], *here, *white]) == 5
    assert "each has its own curves" in capsys.readouterr().err


@pytest.mark.full
def test_a_colour_out_of_reach_is_in_the_document_without_numbers(
    calibrated: tuple[Path, Result], capsys: pytest.CaptureFixture[str]
) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    folder, document = calibrated
    arguments = ["--region", place(document, 18), "--region", place(document, 22)]
    white = ["--white-region", f"{place(document, 22)},0.9"]
    assert cli.main(["colour", str(folder / "result.json"), str(folder / "chart-D55.dng"), *arguments, *white]) == 9
    found = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(SCHEMA).validate(found)
    assert to_plain(from_plain(found, ColourDocument, "it", "")) == found
    assert [region["status"] for region in found["regions"]] == ["colour_out_of_reach", "ok"]
    assert "lab" not in found["regions"][0]


def test_the_schema_is_sound_and_says_what_everything_is() -> None:
    check_schema(SCHEMA)


def hostile(document: Result, seed: int) -> Result:
    """A result of sound form with numbers that no camera has."""
    rng = np.random.default_rng(seed)
    answer = document.answer
    curves, std = dict(vars(answer.curves)), dict(vars(answer.std))
    for c in rng.choice(["red", "green", "blue"], 2):
        curve = curves[c]
        kind = rng.integers(6)
        if kind == 0:
            curve = -np.abs(curve)
        elif kind == 1:
            curve = np.zeros_like(curve)
        elif kind == 2:
            curve = rng.normal(size=curve.size)
        elif kind == 3:
            curve = curve * 10.0 ** rng.integers(-12, 12)
        elif kind == 4:
            curve = curves["red"]
        curve = np.clip(curve / max(curve.max(), 1e-300), -1e3, 1.0)
        curve[rng.integers(curve.size)] = 1.0
        curves[c] = curve
        if rng.random() < 0.5:
            std[c] = np.abs(rng.normal(size=curve.size)) * 10.0 ** rng.integers(-12, 9)
    size = len(answer.code_covariance)
    triangle = rng.normal(size=size) * 10.0 ** rng.integers(-6, 9)
    variances = np.cumsum(np.arange(1, 73)) - 1
    triangle[variances] = np.abs(triangle[variances])
    changed, band = (Curves(*(part[c] for c in ("red", "green", "blue"))) for part in (curves, std))
    gain = rng.normal(size=3) * 10.0 ** rng.integers(-6, 6)
    return replace(
        document,
        answer=replace(answer, curves=changed, std=band, code_covariance=triangle, channel_gain=gain),
    )


@pytest.mark.full
@pytest.mark.parametrize("seed", range(2))
def test_strange_curves_give_an_answer_or_a_typed_error(seed: int, calibrated: tuple[Path, Result]) -> None:
    from camssf.exports import FORMATS, export
    from camssf.report.build import report

    given = hostile(calibrated[1], seed)
    for stated in ("LED-B3", "auto"):
        with suppress(CalibrationError):
            found = standard_colour(
                camera_of_result(given),
                stated,
                np.full(3, 0.3),
                0.01,
                reference=Reference(raw=np.array([0.7, 1.0, 0.6])),
            )
            assert np.isfinite(found.lab).all()
            assert np.isfinite(found.lab_covariance).all()
        for pair in ((given, calibrated[1]), (calibrated[1], given)):
            with suppress(CalibrationError):
                ours, theirs = (camera_of_result(each) for each in pair)
                got = convert(ours, theirs, stated, np.full(3, 0.3), 0.01, reference=Reference(raw=np.ones(3)))
                assert np.isfinite(got.signals).all()
                assert np.isfinite(got.covariance).all()
    for to in FORMATS:
        with suppress(CalibrationError):
            assert b"nan" not in export(given, to).lower()
    assert report(given).html
