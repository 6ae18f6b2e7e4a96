"""Between two cameras: limits that can be done by hand, drawing what is not known, the command."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from camssf.colorimetry import KINDS, signals_of
from camssf.errors import InvalidArgument, LampUnfit
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_chart
from camssf.spectra.bundled import surfaces
from camssf_colour import PARTS, Camera, Reference, convert, standard_colour
from camssf_colour.reach import MOST
from tests.colour.conftest import blurred, exact, known, owned, power
from tests.support.problems import measured_cameras, toy_camera

CHART = read_chart("classic24").values


def other() -> Camera:
    return exact(measured_cameras()["Canon EOS 5D"])


# -- limits that can be done by hand ----------------------------------------------------------------------------


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


def mixed() -> tuple[Camera, Camera]:
    """A camera, and one whose curves are mixtures of its."""
    return exact(), Camera("mixed", exact().values @ MIX, np.zeros((0, 681, 3)))


def sizes(part: Floats) -> Floats:
    """Standard deviations (n, 3)."""
    return np.sqrt(np.diagonal(part, axis1=1, axis2=2))


@pytest.mark.parametrize("lamp", ["D55", "FL2", "A"])
def test_curves_that_are_mixtures_give_the_very_matrix(lamp: str) -> None:
    """s_B = s_A M: white-balanced, y_B = y_A · diag(white_A) M diag(1 / white_B)."""
    source, target = mixed()
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


# -- what is not known ------------------------------------------------------------------------------------------


def test_white_stays_white_and_more_light_changes_nothing() -> None:
    for kind in KINDS:
        found = convert(exact(), other(), "D55", np.ones(3), kind=kind)
        conversion = found.conversions[0]
        assert np.abs(found.signals - 1).max() < 1e-12
        y = signals_of(CHART, power(), toy_camera())
        assert np.abs(conversion.apply(0.1 * y) - 0.1 * conversion.apply(y)).max() < 1e-14


def test_parts_add_up_and_are_covariances() -> None:
    y = signals_of(CHART, power("A"), toy_camera())
    found = convert(blurred(), blurred(other().values), "A", y, 0.01 * y)
    assert tuple(found.parts) == PARTS
    assert np.abs(found.covariance - sum(found.parts.values())).max() < 1e-15
    assert (np.linalg.eigvalsh(found.covariance) > 0).all()


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


# -- lamps, white, reach ----------------------------------------------------------------------------------------


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
    assert np.abs(found.covariance - sum(found.parts.values())).max() < 1e-15
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
