"""Unnamed light: probabilities by hand, mixtures by total variance, phones and cameras, and the faces."""

import json
import re
from dataclasses import replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.calibration import solve
from camssf.cli.terminal import summarise
from camssf.colorimetry import signals_of
from camssf.documents import forms
from camssf.documents.document import document_bytes
from camssf.documents.unnamed_light import cost_of, kinds_in_words, light_in_words, lights_of
from camssf.errors import InvalidArgument
from camssf.fit.solutions import COMBINED, combined
from camssf.grid import WAVELENGTHS
from camssf.options import Options
from camssf.photo.capture import Capture
from camssf.recovery.basis import NODES, misfit_profile, read_basis
from camssf.recovery.hypotheses import LampGuess, recover
from camssf.recovery.sensitivity import half_width_of, prior_std
from camssf.recovery.unnamed_light import temperature
from camssf.report.page import page
from camssf.report.shots import shots_of
from camssf.result import Result
from camssf.spectra import Lamp, Unnamed, colour_science, read_lamp, read_light
from camssf.spectra.bundled import observer, surfaces
from camssf.spectra.families import FAMILIES as LAMP_KINDS
from camssf.spectra.lights import Called, kind_of, unnamed_light
from camssf_colour import Camera, Reference, View, standard_colour
from camssf_colour.standard import of_surfaces
from golden.forms import resolve
from golden.scenes import PHONE
from tests.recovery.test_choice import SEEN, capture, observed
from tests.support.captures import capture_in, document_of

LIGHTS = ("D65", "D50", "A", "2500K", "LED-B3", "FL2", "FL3.12")


def unnamed(given: Capture, *named: Lamp) -> Capture:
    """The same capture with no lamp named, but for the last shots'."""
    lamps = [unnamed_light()] * (len(given.shots) - len(named)) + list(named)
    return replace(given, shots=tuple(replace(s, lamp=lamp) for s, lamp in zip(given.shots, lamps, strict=True)))


@cache
def found(lamp: str) -> Result:
    """A phone under this lamp, which is not named."""
    return solve(unnamed(capture(resolve(PHONE), [lamp], make="Apple")))


def test_a_light_without_a_name_is_no_spectrum() -> None:
    light = read_light(" Auto ")
    assert isinstance(light, Unnamed)
    assert not hasattr(light, "values")
    assert {kind_of(lamp.name) for lamp in light.lamps} == set(LAMP_KINDS)
    assert isinstance(read_light("equal-energy"), Lamp)
    with pytest.raises(InvalidArgument, match="not named has no spectrum"):
        read_lamp("auto")
    assert sum(np.exp(light.log_prior)) == pytest.approx(1.0)


def test_an_unnamed_light_needs_a_prior_and_guesses_reflectances_their_grid() -> None:
    given = observed(resolve(PHONE), "D55")
    with pytest.raises(InvalidArgument, match="gaussian basis has no prior"):
        solve(unnamed(capture(resolve(PHONE), ["D55"], make="Apple")), options=Options(basis="gaussian"))
    with pytest.raises(InvalidArgument, match="no guesses"):
        recover([])
    for of in (np.ones((3, 31)), [[0.5] * 31]):
        with pytest.raises(InvalidArgument, match="`of` has shape"):
            recover(given, basis="phones", of=of)
    assert recover(given, basis="phones", of=[0.5] * 681).predicted == pytest.approx(0.5)


def test_hypotheses_on_a_basis_s_file_have_its_name(tmp_path: Path) -> None:
    """Not its path, which would stand in the result."""
    shipped = resources.files("camssf") / "data" / "phones.npz"
    (tmp_path / "mine.npz").write_bytes(shipped.read_bytes())
    ssf = recover([LampGuess(("daylight",), observed(resolve(PHONE), "D55"), 0.0)], basis=str(tmp_path / "mine.npz"))
    assert {weight.basis for weight in ssf.choice} == {"mine"} == {ssf.basis}


def test_the_colour_temperature_is_that_of_colour_science() -> None:
    """McCamy's formula, and within 1.5 % of Ohno's exact one for what lights a chart."""
    colour = colour_science()
    for name, kelvin in (("A", 2856.0), ("D50", 5003.0), ("D65", 6504.0), ("3500K", 3500.0)):
        assert temperature(read_lamp(name).values) == pytest.approx(kelvin, rel=0.005), name
    for name in ("2300K", "LED-B3", "FL11", "D:10000"):
        power = read_lamp(name).values
        xyz = power @ observer("1931")
        xy = xyz[:2] / xyz.sum()
        assert temperature(power) == pytest.approx(float(colour.temperature.xy_to_CCT_McCamy1992(xy)), rel=1e-9)
        u, v = 4 * xy[0] / (-2 * xy[0] + 12 * xy[1] + 3), 6 * xy[1] / (-2 * xy[0] + 12 * xy[1] + 3)
        exact = colour.temperature.uv_to_CCT_Ohno2013(np.array([u, v]))[0]
        assert temperature(power) == pytest.approx(exact, rel=0.015), name


@pytest.mark.requirement("R-FIELD")
@pytest.mark.parametrize(("lamp", "kind"), [
    ("D55", "daylight"), ("FL2", "fluorescent"), ("LED-B1", "white-led"),
    pytest.param("A", "bulb", marks=pytest.mark.full),
])  # fmt: skip
def test_a_phone_in_any_light(lamp: str, kind: str) -> None:
    """Nothing named: accepted, curves and light within their bands, and no kelvin is invented."""
    done = found(lamp)
    assert done.ssf.band_ratio is not None
    assert (done.verdict.status, done.ssf.basis) == ("accepted", "phones")
    truth = resolve(PHONE)
    curves, std = done.ssf.peak()
    off = np.abs(curves - truth / truth.max(axis=0))[SEEN]
    assert (off <= 1.96 * std[SEEN]).mean() >= 0.9  # measured phones: `python -m benchmarks any_light`
    assert np.sqrt(np.mean(off**2)) < 0.03
    (light,) = done.ssf.lights
    assert max(light.kinds, key=lambda name: light.kinds[name]) == kind
    true = read_lamp(lamp).values
    assert (np.abs(light.power - true / true.mean()) <= 1.96 * light.std)[SEEN].mean() >= 0.93
    assert abs(light.kelvin - float(temperature(true))) < 1.96 * light.kelvin_std


def test_the_band_without_a_photo_is_the_spread_of_the_prior() -> None:
    """By draws: x ~ N(0, I), curves divided by the value at the mean's peak."""
    basis = read_basis("phones")
    x = np.random.default_rng(1).normal(size=(4000, 3, basis.dictionary.shape[2]))
    curves = basis.mean + np.einsum("cmr,ncr->ncm", 0.01 * basis.dictionary, x)  # small: the band is linear
    top = basis.mean.argmax(axis=1)
    drawn = curves / curves[:, np.arange(3), top][:, :, None]
    missed = np.stack([np.interp(WAVELENGTHS, NODES, channel) for channel in misfit_profile()], axis=1)
    np.testing.assert_allclose(np.hypot(100.0 * drawn.std(axis=0).T, missed), prior_std(basis), rtol=0.08, atol=1e-3)
    assert found("D55").ssf.half_width_without_photo == pytest.approx(half_width_of(prior_std(basis)), rel=1e-12)


def test_the_document_has_the_light() -> None:
    result = found("D55")
    data = document_bytes(result)
    assert document_bytes(forms.read(data, Result, "test", "")) == data
    document = json.loads(data)
    (shot,) = document["capture"]["shots"]
    assert shot["lamp"] == {"kind": "unnamed", "name": "auto"}
    ((number, light),) = lights_of(result.answer)
    assert number == 1
    assert forms.to_plain(light) == document["answer"]["lights"][0]
    assert sum(light.kinds.values()) == pytest.approx(1.0)
    assert kinds_in_words(light.kinds).startswith("daylight 89 %")
    kelvin = f"{light.kelvin:,.0f} ± {light.kelvin_std:,.0f} K"
    assert light_in_words(result.capture.shots[0].lamp, light).endswith(kelvin)
    assert 0.05 < max(cost_of(result.answer)) < 1.0
    assert min(cost_of(result.answer)) > 0.0
    (said,) = [assumption.message for assumption in result.assumptions if assumption.code == "lamp"]
    assert said.startswith("the light was not named and was estimated from the signals")
    assert "daylight 89%" in said


def test_the_called_name_of_a_light_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    """In the result, the terminal and the report; the true light is D55."""
    given = capture(resolve(PHONE), ["D55"], make="Apple")
    result = solve(replace(given, shots=(replace(given.shots[0], lamp=read_light("D:12000")),)))
    words = r"called D:12000; by the signals another daylight of [\d,]+ ± \d+ K \(\d+%\)"
    (said,) = [assumption.message for assumption in result.assumptions if assumption.code == "lamp"]
    assert re.fullmatch(f"the light was {words}.", said)
    summarise(result, None)
    assert re.search(f"^light: {words}$", " ".join(capsys.readouterr().err.split(" ")), re.M)
    assert re.search(f">The light by the signals.*C{words[1:]}", page(result, shots_of(result), [None]))


def test_patches_travel_without_a_lamp() -> None:
    document = document_of(unnamed(capture(resolve(PHONE), ["D55", "A"], make="Apple"), read_lamp("A")))
    back = capture_in(document)
    assert [type(shot.lamp) for shot in back.shots] == [Unnamed, Lamp]
    assert document_of(back) == document


def test_the_combinations_of_several_lamps_are_the_most_probable_ones() -> None:
    few = [[("a", 0.5), ("b", 0.5)], [("c", 0.9), ("d", 0.1)]]
    assert combined(few) == [("a", "c"), ("a", "d"), ("b", "c"), ("b", "d")]
    many = combined([[(str(i), 0.5 / (i + 1)) for i in range(7)]] * 20)
    assert len(many) == COMBINED
    assert many[0] == ("0",) * 20
    assert all(sum(kind != "0" for kind in one) <= 4 for one in many)


@pytest.mark.parametrize("name", ["/etc/hostname", "lamp.csv", "./D55", "HP1", "", "auto"])
def test_a_stored_name_reads_no_file(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "lamp.csv").write_text("400,1\n700,1\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidArgument, match="is no light by the name"):
        Called.from_plain({"name": name}, "capture.shots[0].lamp")


@pytest.mark.full
@pytest.mark.requirement("R-COLOUR")
def test_the_colour_after_a_calibration_in_unnamed_light_covers_the_truth() -> None:
    """In the chart's light and in another; what curves and light add, by the colour through the true ones."""
    seen, none = surfaces()[::30], np.zeros((0, 681))
    rng, basis = np.random.default_rng(8), read_basis("phones")
    whole: dict[bool, list[Any]] = {False: [], True: []}
    of_light: dict[bool, list[Any]] = {False: [], True: []}
    for number, name in enumerate(LIGHTS):
        code = 0.7 * rng.normal(size=(3, basis.dictionary.shape[2]))
        curves = np.maximum(basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code), 0.0).T
        curves = curves / curves.max(axis=0)
        result = solve(unnamed(capture(curves, (name,), make="Apple")))
        raw = read_lamp(name).values @ curves  # `capture` has a white frame of equal channels
        result = replace(result, answer=replace(result.answer, channel_gain=raw / raw[1]))
        for other, into in whole.items():
            light = read_lamp(LIGHTS[(number + 2) % len(LIGHTS)] if other else name).values
            y, error = signals_of(seen, light, curves), 0.002
            reference = Reference(raw=3000.0 * (light @ curves), error=0.002)
            colours = standard_colour(result, "auto", y, error, reference=reference)
            truth = of_surfaces(seen, light, View())[1]
            camera, lamp = Camera("true", curves, np.zeros((0, 681, 3))), Lamp("true", light, 0.0, none, "")
            exact = standard_colour(camera, lamp, y, error)
            added = colours.parts["curves"][1] + colours.parts["lamp"][1] + 1e-4 * np.eye(3)
            into.append(chi_squared(colours.lab - truth, colours.lab_covariance))
            of_light[other].append(chi_squared(colours.lab - exact.lab, added))
    for other in (False, True):
        for chi in (whole[other], of_light[other]):
            assert np.mean(np.concatenate(chi) < 7.815) > 0.93
        assert np.mean(of_light[other]) > 0.3  # nor is the band much too wide


def chi_squared(off: Any, covariance: Any) -> Any:
    """(m,) of errors (m, 3)."""
    return np.einsum("mc,mc->m", off, np.linalg.solve(covariance, off[..., None])[..., 0])
