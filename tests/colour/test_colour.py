"""Colour: against truth and by drawing; between two cameras: limits that can be done by hand."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from camssf.colorimetry import KINDS, delta_e00, signals_of
from camssf.errors import InvalidArgument, LampUnfit
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery import Observation, recover
from camssf.recovery.basis import interpolate, misfit_profile, read_basis
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.recovery.rows import anchor
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf.spectra.bundled import observer, surfaces
from camssf.verdict.reasons import Verdict
from camssf_colour import PARTS, Camera, Reference, View, camera_of_result, camera_of_ssf, convert, standard_colour
from camssf_colour.colour_error import expected_error, true_error
from camssf_colour.light import OWN_WHITE, lamp_modes, see
from camssf_colour.reach import MOST
from camssf_colour.standard import of_surfaces
from tests.colour.conftest import blurred, exact, known, owned, power
from tests.support.documents import document
from tests.support.problems import measured_cameras, toy_camera

CHART = read_chart("classic24").values


@pytest.mark.parametrize("view", [View(), View("1964"), View(white="D65"), View("1964", "D50")])
def test_colours_of_a_camera_that_is_nearly_an_observer_are_true(view: View) -> None:
    curves = observer(view.observer)
    y = signals_of(CHART, power("A"), curves)
    found = standard_colour(exact(curves), known("A"), y, reference=Reference(0.0), view=view)
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


def test_many_colours_at_once_are_the_same_as_one_by_one() -> None:
    y = signals_of(surfaces()[: MOST + 6], power("D65"), toy_camera())
    many = standard_colour(blurred(), "D65", y, 0.002)
    assert np.isnan(many.reach).all()
    for i in (0, 50, MOST + 5):
        one = standard_colour(blurred(), "D65", y[i], 0.002)
        assert np.abs(one.lab[0] - many.lab[i]).max() < 1e-9
        assert np.abs(one.lab_covariance[0] - many.lab_covariance[i]).max() < 1e-9


def test_colours_say_what_they_are() -> None:
    found = standard_colour(blurred(), "D55", np.full((6, 3), 0.4), 0.002)
    half = 1.96 * np.sqrt(found.lab_covariance[0].diagonal())
    assert repr(found).startswith(
        f"<Colours under D55, CIE 1931, white lamp: L* {found.lab[0, 0]:.1f} ± {half[0]:.1f}, "
    )
    assert repr(found).endswith("; 2 more>")


def test_the_expected_colour_error_is_that_of_draws_from_the_covariance() -> None:
    """ΔE00 between each colour of the chart and draws of it: root mean square, then the mean over the colours."""
    made = document("D55")
    made = replace(made, verdict=Verdict("accepted"))
    found = expected_error(made)
    camera, light = camera_of_result(made), read_lamp("D65")
    colours = standard_colour(camera, light, signals_of(read_chart("classic24").values, light.values, camera.values))
    rng = np.random.default_rng(5)
    pairs = zip(colours.lab, colours.lab_covariance, strict=True)
    drawn = np.stack([rng.multivariate_normal(lab, cov, 4000) for lab, cov in pairs])
    errors = np.sqrt(np.mean(delta_e00(np.broadcast_to(colours.lab[:, None], drawn.shape), drawn) ** 2, axis=1))
    assert found.chart == pytest.approx(errors.mean(), rel=0.1)
    assert found.skin == pytest.approx(errors[:2].mean(), rel=0.1)
    assert f"{found.chart:.1f} ΔE00" in found.in_words()


def test_the_true_colour_error_is_least_for_the_true_curves() -> None:
    truth, other = (read_camera(name).values for name in ("Canon EOS 5D Mark II", "Nikon 5100 (NPL)"))
    own, foreign = true_error(truth, truth), true_error(other, truth)
    assert own < 1.0 < foreign


@pytest.mark.parametrize(
    ("true", "kind"), [("D65", "daylight"), ("2500K", "bulb"), ("LED-B4", "white-led"), ("FL2", "fluorescent")]
)
def test_auto_gives_nearly_the_colours_of_the_lamp_named(true: str, kind: str) -> None:
    camera = owned(blurred(size=0.005))
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
    apart = truth - auto.lab
    chi = np.einsum("mc,mc->m", apart, np.linalg.solve(auto.lab_covariance, apart[..., None])[..., 0])
    assert np.mean(chi < 7.815) > 0.8
    assert sizes(auto.parts["lamp"][1]).mean() > sizes(named.parts["lamp"][1]).mean()


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


def test_a_camera_must_have_the_grid_and_a_peak() -> None:
    with pytest.raises(InvalidArgument, match="do not fit together"):
        Camera("x", np.ones((3, 681)), np.zeros((0, 681, 3)))
    with pytest.raises(InvalidArgument, match="peak"):
        Camera("x", np.zeros((681, 3)), np.zeros((0, 681, 3)))


def other() -> Camera:
    return exact(measured_cameras()["Canon EOS 5D"])


@pytest.mark.parametrize("lamp", ["D55", "FL2", "bulb", "LED-B3"])
@pytest.mark.parametrize("camera", [exact(), blurred()], ids=["exact", "uncertain"])
def test_a_camera_to_itself_is_the_identity_without_error(camera: Camera, lamp: str) -> None:
    """Whatever is not known of its curves and of the lamp: both sides err alike."""
    y = signals_of(CHART, power("D65"), camera.values)
    found = convert(camera, replace(camera, name="again"), lamp, y)
    (conversion,) = found.conversions
    assert conversion.kind == "matrix"
    assert np.abs(conversion.coefficients - np.eye(3)).max() < 1e-11
    assert np.abs(found.signals - y).max() < 1e-11
    for name in ("curves", "lamp", "noise", "metamers"):
        assert np.sqrt(np.abs(found.parts[name]).max()) < 1e-9, name
    assert max(conversion.rms.values()) < 1e-9


MIX = np.array([[0.9, 0.1, 0.0], [0.2, 1.0, 0.1], [0.05, 0.1, 0.8]])


def sizes(part: Floats) -> Floats:
    """Standard deviations (n, 3)."""
    return np.sqrt(np.diagonal(part, axis1=1, axis2=2))


@pytest.mark.parametrize("lamp", ["D55", "FL2", "A"])
def test_curves_that_are_mixtures_give_the_very_matrix(lamp: str) -> None:
    """s_B = s_A M: white-balanced, y_B = y_A · diag(white_A) M diag(1 / white_B)."""
    source, target = exact(), Camera("mixed", exact().values @ MIX, np.zeros((0, 681, 3)))
    whites = [power(lamp) @ camera.values for camera in (source, target)]
    expected = whites[0][:, None] * MIX / whites[1]
    found = convert(source, target, known(lamp), signals_of(CHART, power(lamp), source.values))
    assert found.conversions[0].kind == "matrix"
    assert np.abs(found.conversions[0].coefficients - expected).max() < 1e-10
    assert np.abs(expected.sum(axis=0) - 1).max() < 1e-12
    assert np.abs(found.signals - signals_of(CHART, power(lamp), target.values)).max() < 1e-11
    for name in ("curves", "lamp", "noise", "metamers"):
        assert np.sqrt(np.abs(found.parts[name]).max()) < 1e-9, name
    # the reference's error remains: a white that is off by 1 % is so for both cameras
    assert (sizes(found.parts["reference"])[18] > 0.005).all()


def test_white_stays_white_and_more_light_changes_nothing() -> None:
    for kind in KINDS:
        found = convert(exact(), other(), "D55", np.ones(3), kind=kind)
        conversion = found.conversions[0]
        assert np.abs(found.signals - 1).max() < 1e-12
        y = signals_of(CHART, power(), toy_camera())
        assert np.abs(conversion.apply(0.1 * y) - 0.1 * conversion.apply(y)).max() < 1e-14


def test_metamers_are_what_unseen_surfaces_miss() -> None:
    source, target = exact(), other()
    y, truth = (signals_of(surfaces(), power(), camera.values) for camera in (source, target))
    chunks = [convert(source, target, known(), y[i : i + MOST]) for i in range(0, len(y), MOST)]
    covariance = np.concatenate([chunk.parts["metamers"] for chunk in chunks])
    conversion = chunks[0].conversions[0]
    missed = conversion.residual * y.mean(axis=1, keepdims=True)
    chi = np.einsum("mc,mc->m", missed, np.linalg.solve(covariance, missed[..., None])[..., 0])
    assert 0.9 < np.mean(chi < 7.815) < 0.99
    assert np.sqrt(np.mean((conversion.apply(y) - truth) ** 2)) < conversion.rms[conversion.kind]


def test_whites_balance_and_unbalance() -> None:
    """Raw signals of A over A's white → converted → times B's white are B's raw signals."""
    source, target = owned(exact(), "A"), owned(other(), "D65")
    y = signals_of(CHART, power("FL2"), source.values)
    conversion = convert(source, target, "FL2", y).conversions[0]
    for white, camera in zip(conversion.whites, (source, target), strict=True):
        raw = power("FL2") @ camera.values
        assert np.abs(white / (raw / raw[1]) - 1).max() < 1e-12
    lone = convert(source, other(), "FL2", y).conversions[0].whites
    assert np.isnan(lone[1]).all()
    assert np.isfinite(lone[0]).all()


def test_auto_weighs_the_kinds() -> None:
    source, target = owned(blurred(size=0.005)), other()
    y, raw = signals_of(CHART[:18], power("D75"), source.values), power("D75") @ source.values
    found = convert(source, target, "auto", y, reference=Reference(raw=raw))
    assert [name for name, _ in found.lamps] == ["daylight", "bulb", "white-led", "fluorescent"]
    assert sum(weight for _, weight in found.lamps) == pytest.approx(1)
    named = convert(source, target, "D75", y, reference=Reference(raw=raw))
    assert np.abs(found.signals - named.signals).max() < 0.03
    assert np.trace(found.parts["lamp"].mean(axis=0)) > np.trace(named.parts["lamp"].mean(axis=0))
    assert tuple(found.parts) == PARTS
    assert np.abs(found.covariance - sum(found.parts.values())).max() < 1e-15
    assert (np.linalg.eigvalsh(found.covariance) > 0).all()
    assert standard_colour(exact(), "torch", np.full(3, 0.5)).lamps == (("white-led", 1.0),)  # it has one kind
    with pytest.raises(InvalidArgument, match="lamp is unknown"):
        convert(source, target, "auto", y)
    with pytest.raises(LampUnfit, match="not white under A"):
        convert(source, target, "A", y, reference=Reference(raw=raw))


@pytest.mark.parametrize("wrong", [np.ones(2), np.array([[1.0, np.nan, 1.0]]), np.ones((1, 1, 3))])
def test_signals_that_are_none_are_refused(wrong: Floats) -> None:
    for product in (partial(convert, exact(), other()), partial(standard_colour, exact())):
        with pytest.raises(InvalidArgument, match="Signals"):
            product("D55", wrong)
        with pytest.raises(InvalidArgument, match="standard error"):
            product("D55", np.ones(3), -1.0)


def test_what_cannot_be_converted_is_refused() -> None:
    twins, blind = exact(), other()
    twins.values[:, 1] = twins.values[:, 0]
    blind.values[WAVELENGTHS < 400] = 0.0
    ultraviolet = replace(known(), values=np.where(WAVELENGTHS < 381, 1.0, 0.0))
    with pytest.raises(InvalidArgument, match="no transform"):
        convert(exact(), other(), "D55", np.ones(3), kind="cube")
    with pytest.raises(InvalidArgument, match="No conversion"):
        convert(twins, other(), "D55", np.ones(3))
    with pytest.raises(InvalidArgument, match="no response"):
        convert(exact(), blind, ultraviolet, np.ones(3))


def test_conditioning_is_bayes_by_drawing() -> None:
    """Weighted draws of a bulb's temperature and the smooth error give the mean and spread that `see` states."""
    camera, named, own = owned(exact()), read_lamp("bulb"), power("D55")
    raw = power("2600K") @ camera.values
    seen = np.log((raw / raw[1])[[0, 2]])
    light = see(camera, named, seen, 0.02)

    modes = lamp_modes(named)
    draws = np.random.default_rng(3).normal(size=(12000, len(modes)))
    powers = named.values * np.maximum(1 + draws @ modes, 0.02)
    logs = np.log(camera.own.raw * (powers @ camera.values) / (own @ camera.values))
    smooth = 0.02 * smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T * own
    of_own = (smooth @ camera.values / (own @ camera.values)).T
    of_own = of_own[[0, 2]] - of_own[1]
    noise = of_own @ of_own.T + (OWN_WHITE**2 + 0.02**2) * (np.eye(2) + 1)
    off = seen - (logs[:, [0, 2]] - logs[:, 1:2])
    weight = np.exp(-0.5 * np.einsum("ni,ij,nj->n", off, np.linalg.inv(noise), off))
    weight /= weight.sum()
    mean = weight @ powers
    std = np.sqrt(weight @ (powers - mean) ** 2)
    stated = np.sqrt((light.power_modes**2).sum(axis=0))
    assert np.abs(light.power - mean).max() < 0.25 * std.max()
    assert np.abs(stated / std - 1).max() < 0.15


@pytest.mark.full
@pytest.mark.parametrize("side", ["source", "target"])
def test_the_curves_part_is_what_drawing_curves_gives(side: str) -> None:
    """Of either camera."""
    cameras = {"source": exact(), "target": other()}
    true = cameras[side].values
    y = signals_of(CHART[:6], power("LED-B3"), cameras["source"].values)
    unsure = blurred(true, 0.01)
    lamp = known("LED-B3")
    found = convert(**(cameras | {side: unsure}), lamp=lamp, signals=y, kind="matrix")
    assert not found.parts["lamp"].any()
    drawn = [
        convert(**(cameras | {side: exact(values)}), lamp=lamp, signals=y, kind="matrix").signals
        for values in true + np.einsum("nq,qmc->nmc", np.random.default_rng(5).normal(size=(200, 2)), unsure.modes)
    ]
    assert np.abs(sizes(found.parts["curves"]) - np.std(drawn, axis=0)).max() < 0.2 * np.std(drawn, axis=0).max()
