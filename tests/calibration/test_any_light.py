"""Unnamed light: probabilities by hand, mixtures by total variance, phones and cameras, and the faces."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.calibration import attempt, solve
from camssf.cli.terminal import summarise
from camssf.colorimetry import signals_of
from camssf.documents import forms
from camssf.documents.document import document_bytes
from camssf.documents.unnamed_light import cost_of, kinds_in_words, light_in_words, lights_of
from camssf.errors import InvalidArgument, LampUnfit
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import COMBINED, combined
from camssf.grid import WAVELENGTHS
from camssf.options import Options
from camssf.photo.capture import Capture
from camssf.photo.shot import Shot
from camssf.recovery.basis import NODES, misfit_profile, read_basis, widened
from camssf.recovery.hypotheses import FAMILIES, MAKER, NARROW, SOLVED, LampGuess, recover
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import Hypothesis, SolverSettings, half_width_of, prior_std, solve_on_basis
from camssf.recovery.unnamed_light import NO_KIND, LampPosterior, lamp_posteriors, temperature, temperature_slope
from camssf.report.page import page
from camssf.report.shots import shots_of
from camssf.result import Result
from camssf.spectra import Lamp, Unnamed, colour_science, read_lamp, read_light
from camssf.spectra.bundled import observer, surfaces
from camssf.spectra.families import FAMILIES as LAMP_KINDS
from camssf.spectra.lights import Called, kind_of, unnamed_light
from camssf.verdict.judge import _unnamed
from camssf.verdict.lamp import RIVALS
from camssf.verdict.reasons import Checks
from camssf.verdict.rival_lamps import weigh_rivals
from camssf_colour import Camera, Reference, View, standard_colour
from camssf_colour.standard import of_surfaces
from golden.forms import resolve
from golden.scenes import PHONE
from tests.recovery.test_choice import SEEN, belief, capture, observed
from tests.support.captures import capture_in, document_of, photos
from tests.support.problems import measured_cameras


def unnamed(given: Capture, *shots: int) -> Capture:
    """The same capture with the lamps of these shots, or all, not named."""
    which = shots or range(len(given.shots))
    return replace(
        given, shots=tuple(replace(s, lamp=unnamed_light()) if j in which else s for j, s in enumerate(given.shots))
    )


@cache
def found(lamps: tuple[str, ...], make: str = "Apple") -> Result:
    """A phone under these lamps, none of them named."""
    return solve(unnamed(capture(resolve(PHONE), lamps, make=make)))


def guesses(given: Observation, names: Sequence[str] = tuple(LAMP_KINDS)) -> list[LampGuess]:
    every = []
    for name in names:
        lamp = read_lamp(name)
        posed = replace(
            given, lamp=lamp.values[None], lamp_tolerance=np.array([lamp.tolerance]), lamp_modes=lamp.modes[None]
        )
        every.append(LampGuess((name,), posed, 0.0))
    return every


# -- a light without a name ----------------------------------------------------------------------------------------


def test_a_light_without_a_name_is_no_spectrum() -> None:
    light = read_light(" Auto ")
    assert isinstance(light, Unnamed)
    assert not hasattr(light, "values")
    assert {kind_of(lamp.name) for lamp in light.lamps} == set(LAMP_KINDS)
    assert isinstance(read_light("equal-energy"), Lamp)
    with pytest.raises(InvalidArgument, match="not named has no spectrum"):
        read_lamp("auto")
    assert sum(np.exp(light.log_prior)) == pytest.approx(1.0)


# -- probabilities -------------------------------------------------------------------------------------------------


def test_the_probabilities_are_evidence_times_belief() -> None:
    """By hand from the single answers: 2 kinds, 3 bases."""
    given = observed(resolve(PHONE), "D55", patches=12, noise=0.005)
    two = guesses(given, ("daylight", "bulb"))
    ssf = recover(two, prior={"phones": 5.0}, settings=SolverSettings(engine="reference"))
    nats = {
        (guess.kinds, basis): solve_on_basis(
            guess.observation,
            basis,
            prior_scale=1.0 if basis == "cameras" else NARROW,
            settings=SolverSettings(engine="reference"),
        ).log_evidence
        for basis in FAMILIES
        for guess in two
    }
    most = max(value or -np.inf for value in nats.values())
    raw = {key: np.exp((value or 0.0) - most) * belief(key[1], phones=5.0) for key, value in nats.items()}
    assert len(ssf.choice) == len(raw) == 6
    for weight in ssf.choice:
        key = weight.kinds, weight.basis
        assert weight.log_evidence == pytest.approx(nats[key], abs=1e-9)
        assert weight.probability == pytest.approx(raw[key] / sum(raw.values()), rel=1e-9)
    (light,) = ssf.lights
    assert light is not None
    by_kind = {kind: sum(w.probability for w in ssf.choice if w.kinds == (kind,)) for kind in LAMP_KINDS}
    assert light.kinds == pytest.approx(
        {kind: (1.0 - NO_KIND) * share + NO_KIND / len(LAMP_KINDS) for kind, share in by_kind.items()}
    )


def test_guesses_that_differ_in_more_than_lamps_are_not_solved_as_one() -> None:
    """A stack takes from its first problem what it cannot vary: here the chart's tolerance, by guess."""
    first, second = guesses(observed(resolve(PHONE), "D55", patches=12, noise=0.005), ("daylight", "bulb"))
    looser = replace(second.observation, chart_tolerance=np.array(0.1), lamp_modes=first.observation.lamp_modes)
    pair = [first, replace(second, observation=looser)]
    onnx, reference = (
        recover(pair, basis="phones", settings=SolverSettings(engine=engine)) for engine in ("onnx", "reference")
    )
    assert onnx.values == pytest.approx(reference.values, abs=1e-9 * reference.values.max())
    assert onnx.std == pytest.approx(reference.std, abs=1e-9 * reference.values.max())


def test_an_unnamed_light_needs_a_prior_and_guesses_reflectances_their_grid() -> None:
    given = observed(resolve(PHONE), "D55")
    for shots in (1, 2):
        shot = unnamed(capture(resolve(PHONE), ["D55", "A"][:shots], make="Apple"))
        with pytest.raises(InvalidArgument, match="gaussian basis has no prior"):
            solve(shot, options=Options(basis="gaussian"))
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
    ssf = recover(guesses(observed(resolve(PHONE), "D55"), ("daylight",)), basis=str(tmp_path / "mine.npz"))
    assert {weight.basis for weight in ssf.choice} == {"mine"} == {ssf.basis}


def test_mixtures_have_the_total_variance() -> None:
    """By hand from two answers whose weights are known; curves, their bands, and the signals."""
    given = observed(resolve(PHONE), "D55", patches=12, noise=0.005)
    two = guesses(given, ("daylight", "fluorescent"))
    ssf = recover(two, basis="phones", settings=SolverSettings(engine="reference"))
    p = np.array([weight.probability for weight in ssf.choice])
    assert p.min() > SOLVED
    settings = SolverSettings(engine="reference")
    pair = [solve_on_basis(guess.observation, "phones", prior_scale=NARROW, settings=settings) for guess in two]
    s1, s2 = (each.peak()[0] for each in pair)
    d1, d2 = (solve_on_basis(guess.observation, "phones", settings=settings).peak()[1] for guess in two)
    assert d1 is not None
    assert d2 is not None
    mean = p[0] * s1 + p[1] * s2
    between = p[0] * (s1 - mean) ** 2 + p[1] * (s2 - mean) ** 2
    variance = p[0] * d1**2 + p[1] * d2**2 + between
    top = mean.max(axis=0)
    curves, std = ssf.peak()
    assert std is not None
    assert curves == pytest.approx(mean / top, rel=1e-12)
    assert std == pytest.approx(np.sqrt(variance) / top, rel=1e-12)
    assert ssf.between == pytest.approx(between.sum(axis=0) / variance.sum(axis=0), rel=1e-9)
    assert ssf.predicted == pytest.approx(p[0] * pair[0].predicted + p[1] * pair[1].predicted, rel=1e-12)
    (light,) = ssf.lights
    assert light is not None
    own = [lamp_posteriors(guess.observation, widened(read_basis("phones"), NARROW))[0] for guess in two]
    power = p[0] * own[0].power + p[1] * own[1].power
    spread = sum(
        w * (np.sum(each.modes**2, axis=0) + (each.power - power) ** 2) for w, each in zip(p, own, strict=True)
    )
    assert light.power == pytest.approx(power, rel=1e-12)
    assert light.std == pytest.approx(np.sqrt(spread), rel=1e-12)
    assert light.power.mean() == pytest.approx(1.0)


# -- the light itself ----------------------------------------------------------------------------------------------


def test_the_colour_temperature_is_that_of_colour_science() -> None:
    """McCamy's formula, and within 1.5 % of Ohno's exact one for what lights a chart."""
    colour = colour_science()
    for name, kelvin in (("A", 2856.0), ("D50", 5003.0), ("D65", 6504.0), ("3500K", 3500.0)):
        assert temperature(read_lamp(name).values) == pytest.approx(kelvin, rel=0.005), name
    for name in ("2300K", "LED-B1", "LED-B3", "LED-B5", "FL2", "FL11", "D:10000"):
        power = read_lamp(name).values
        xyz = power @ observer("1931")
        xy = xyz[:2] / xyz.sum()
        assert temperature(power) == pytest.approx(float(colour.temperature.xy_to_CCT_McCamy1992(xy)), rel=1e-9)
        u, v = 4 * xy[0] / (-2 * xy[0] + 12 * xy[1] + 3), 6 * xy[1] / (-2 * xy[0] + 12 * xy[1] + 3)
        exact = colour.temperature.uv_to_CCT_Ohno2013(np.array([u, v]))[0]
        assert temperature(power) == pytest.approx(exact, rel=0.015), name


def test_the_temperature_s_deviation_is_that_of_draws() -> None:
    """The linear one against 4,000 lamps drawn from the modes."""
    power = read_lamp("D55").values
    wave = np.linspace(-1.0, 1.0, power.size)
    modes = np.stack([0.05 * wave * power, 0.02 * np.cos(3 * wave) * power])
    modes = modes - modes.mean(axis=1, keepdims=True) * power
    kelvin, std = LampPosterior(power, modes).kelvin
    drawn = temperature(power + np.random.default_rng(3).normal(size=(4000, 2)) @ modes)
    assert kelvin == pytest.approx(drawn.mean(), rel=0.01)
    assert std == pytest.approx(drawn.std(), rel=0.06)


def test_the_temperature_s_slope_is_that_of_differences() -> None:
    """∂T / ∂L against central differences of the formula, along waves of every length."""
    for name in ("D55", "2700K", "LED-B3", "FL11"):
        power = read_lamp(name).values
        for count in (0, 1, 2, 5, 11):
            wave = 1e-5 * np.cos(count * np.linspace(0.0, np.pi, power.size)) * power
            rise = temperature(power + wave) - temperature(power - wave)
            assert 2.0 * wave @ temperature_slope(power) == pytest.approx(float(rise), rel=1e-6, abs=1e-7)


# -- phones and cameras --------------------------------------------------------------------------------------------


@pytest.mark.requirement("R-FIELD")
@pytest.mark.parametrize(
    ("lamp", "kind"), [("D55", "daylight"), ("A", "bulb"), ("FL2", "fluorescent"), ("LED-B1", "white-led")]
)
def test_a_phone_in_any_light(lamp: str, kind: str) -> None:
    """Nothing named: curves within their bands, the light within its own, and no kelvin is invented.

    All are accepted; the LED by the shape that is like it.
    """
    done = found((lamp,))
    assert done.ssf.band_ratio is not None
    assert done.verdict.status == "accepted"
    assert done.ssf.basis == "phones"
    truth = resolve(PHONE)
    curves, std = done.ssf.peak()
    assert std is not None
    off = np.abs(curves - truth / truth.max(axis=0))[SEEN]
    assert (off <= 1.96 * std[SEEN]).mean() >= 0.9  # measured phones: `python -m benchmarks any_light`
    assert np.sqrt(np.mean(off**2)) < 0.03
    (light,) = done.ssf.lights
    assert light is not None
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
    assert found(("D55",)).ssf.half_width_without_photo == pytest.approx(half_width_of(prior_std(basis)), rel=1e-12)


def test_the_band_is_wider_than_with_the_lamp_named() -> None:
    named = solve(capture(resolve(PHONE), ["D55"], make="Apple")).uncertainty
    nobody = found(("D55",)).uncertainty
    assert named is not None
    assert nobody is not None
    assert nobody.half_width > named.half_width


def test_two_shots_join_what_each_knows() -> None:
    """Daylight and a bulb, neither named: less is left open than by either alone."""
    done = found(("D:6500", "2700K"))
    assert done.verdict.status == "accepted"
    assert done.ssf.kinds == ("daylight", "bulb")
    assert done.uncertainty is not None
    assert done.uncertainty.half_width < min(done.uncertainty.alone)
    day, bulb = done.ssf.lights
    assert day is not None
    assert bulb is not None
    assert day.kinds["daylight"] > 0.9
    assert bulb.kinds["bulb"] > 0.9
    assert {weight.kinds for weight in done.ssf.choice} >= {("daylight", "bulb")}
    assert len(done.ssf.choice) < 48  # kinds that their own shot excludes are not combined


def test_one_of_two_lamps_may_be_named() -> None:
    given = unnamed(capture(resolve(PHONE), ["D55", "A"], make="Apple"), 1)
    done = solve(given)
    assert done.verdict.status == "accepted"
    first, second = done.ssf.lights
    assert first is None
    assert second is not None
    assert second.kinds["bulb"] > 0.9
    fit = prepare_fit(given, Options())
    rivals = weigh_rivals(fit, done.ssf)
    assert {rival.shot for rival in rivals} == {0}
    assert len(rivals) == len(RIVALS)
    nobody = prepare_fit(unnamed(given), Options())
    assert weigh_rivals(nobody, replace(done.ssf, kinds=("daylight", "bulb"))) == ()


@pytest.mark.full
def test_three_lights_without_a_name() -> None:
    done = found(("D:6500", "2700K", "LED-B3"))
    assert [kind_of(lamp) for lamp in done.ssf.kinds] == ["daylight", "bulb", "white-led"]
    assert done.ssf.half_width < found(("D:6500",)).ssf.half_width


def test_four_lights_without_a_name_are_too_many() -> None:
    with pytest.raises(InvalidArgument, match="4 shots was not named; at most 3"):
        solve(unnamed(capture(resolve(PHONE), ["D55", "A", "FL2", "LED-B3"], make="Apple")))


def test_a_camera_must_name_its_lamp() -> None:
    """Whatever maker its file names, the signals say that it is no phone; the message says which words would help."""
    try:
        reasons = solve(unnamed(capture(measured_cameras()["Nikon D5100"], ["D55"], make="Apple"))).verdict.reasons
    except LampUnfit as refused:
        reasons = refused.reasons
    reason = next(each for each in reasons if "spectrum was not given" in each.message)
    assert reason.advice.startswith("Name the lamp: at least its kind (daylight, bulb")


def test_a_phone_is_known_by_its_signals() -> None:
    assert solve(unnamed(capture(resolve(PHONE), ["D55"], make=""))).verdict.status == "accepted"


def test_bounds_of_the_probability() -> None:
    """Without the maker's odds: .77 and .2, whoever made it."""
    ssf = found(("D55",)).ssf

    def said(phone: float, family: str | None) -> tuple[str, float | None]:
        odds = phone / (1.0 - phone) * {"phones": MAKER, "cameras": 1.0 / MAKER, None: 1.0}[family]
        share = odds / (1.0 + odds)
        weights = (
            Hypothesis("phones", 0.0, 0.7 * share, ("bulb",)),
            Hypothesis("ryyb", 0.0, 0.3 * share, ("bulb",)),
            Hypothesis("cameras", 0.0, 1.0 - share, ("bulb",)),
        )
        reasons = _unnamed(replace(ssf, choice=weights), family, Checks())
        return ("accepted", None) if not reasons else (type(reasons[0]).__name__, reasons[0].value)

    for family in ("phones", "cameras", None):
        assert said(0.78, family) == ("accepted", None)
        assert said(0.76, family) == ("Reason", pytest.approx(0.76))
        assert said(0.21, family) == ("Reason", pytest.approx(0.21))
        assert said(0.19, family) == ("Fatal", pytest.approx(0.19))


def test_who_names_the_basis_says_that_it_is_a_phone() -> None:
    done = solve(unnamed(capture(resolve(PHONE), ["D55"])), options=Options(basis="phones"))
    assert done.verdict.status == "accepted"
    assert {weight.basis for weight in done.ssf.choice} == {"phones"}
    with pytest.raises(LampUnfit, match="do not tell it from the camera"):
        solve(unnamed(capture(resolve(PHONE), ["D55"])), options=Options(basis="cameras"))


def test_a_named_lamp_is_solved_as_ever() -> None:
    """Nothing of the result tells that lights may be unnamed."""
    done = solve(capture(resolve(PHONE), ["D55"], make="Apple"))
    assert (done.ssf.lights, done.ssf.kinds, done.ssf.between) == ((), (), None)
    document = json.loads(document_bytes(done))["answer"]
    assert document["choice"]
    assert not any("kinds" in each for each in document["choice"])
    assert "lights" not in document
    assert "which lamp" not in [row.source for row in done.uncertainty.budget]


# -- the faces -----------------------------------------------------------------------------------------------------


def test_the_document_has_the_light() -> None:
    result = found(("D55",))
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
    assert light_in_words(result.capture.shots[0].lamp, light).endswith(
        f"{light.kelvin:,.0f} ± {light.kelvin_std:,.0f} K"
    )
    assert all(kind_of(lamp) for one in document["answer"]["choice"] for lamp in one["kinds"])
    cost = cost_of(result.answer)
    assert cost is not None
    assert all(0.0 < share < 1.0 for share in cost)
    assert max(cost) > 0.05
    shares = np.array([row.share for row in result.uncertainty.budget])
    assert shares.sum(axis=0) == pytest.approx(1.0)
    (said,) = [assumption.message for assumption in result.assumptions if assumption.code == "lamp"]
    assert said.startswith("the light was not named and was estimated from the signals")
    assert "daylight 89%" in said


def page_of(result: Result) -> str:
    shots = shots_of(result)
    return page(result, shots, [None] * len(shots))


def test_the_report_draws_the_light() -> None:
    html = page_of(found(("D55",)))
    assert html.count("The estimated light") == 1
    assert "Correlated colour temperature" in html
    assert "Share of the light in the curves" in html
    assert html.count('id="light-1"') == 1
    two = page_of(found(("D:6500", "2700K")))
    assert two.count('id="light-1"') == two.count('id="light-2"') == 1
    named = page_of(solve(capture(resolve(PHONE), ["D55"], make="Apple")))
    assert "The estimated light" not in named


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("D:12000", r"called D:12000; by the signals another daylight of [\d,]+ ± \d+ K \(\d+%\)"),
        ("D55", r"called D55; by the signals D55 itself \(\d\d%\) or another daylight"),
        ("daylight", r"called daylight; by the signals of 5,\d\d\d ± \d+ K"),
    ],
)
def test_a_light_that_was_called_by_a_name_is_said_so_in_result_terminal_and_report(
    name: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The true light is D55."""
    given = capture(resolve(PHONE), ["D55"], make="Apple")
    result = solve(replace(given, shots=(replace(given.shots[0], lamp=read_light(name)),)))
    (said,) = [assumption.message for assumption in result.assumptions if assumption.code == "lamp"]
    assert re.fullmatch(f"the light was {words}.", said)
    summarise(result, None)
    assert re.search(f"^light: {words}$", " ".join(capsys.readouterr().err.split(" ")), re.M)
    assert re.search(f">The light by the signals.*C{words[1:]}", page_of(result))


def test_the_terminal_tells_the_light_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    result = found(("D55",))
    summarise(result, None)
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("light: ")]
    assert line == "light: " + light_in_words(result.capture.shots[0].lamp, result.answer.lights[0])
    summarise(found(("D:6500", "2700K")), None)
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("light: ")]
    assert re.fullmatch(r"light: shot 1: daylight 92 %; [\d,]+ ± \d+ K; shot 2: bulb 92 %; [\d,]+ ± \d+ K", line)


def test_patches_travel_without_a_lamp() -> None:
    given = unnamed(capture(resolve(PHONE), ["D55", "A"], make="Apple"), 0)
    document = document_of(given)
    shot = document["capture"]["shots"][0]
    assert shot["lamp"] == {"kind": "unnamed", "name": "auto"}
    back = capture_in(document)
    assert isinstance(back.shots[0].lamp, Unnamed)
    assert isinstance(back.shots[1].lamp, Lamp)
    assert document_of(back) == document
    alone = document_of(unnamed(capture(resolve(PHONE), ["D55"], make="Apple")))
    assert (solve(capture_in(alone)).ssf.values == found(("D55",)).ssf.values).all()
    kind = {"kind": "unnamed"}
    wrong: list[dict[str, Any]] = [kind | {"name": "A"}, kind | {"name": "auto", "values": [1.0]}, kind]
    for lamp in (*wrong, {"name": "auto"}, {"kind": "named", "name": "auto"}, {}):
        shot["lamp"] = lamp
        with pytest.raises(InvalidArgument, match=r"capture\.shots\[0\]\.lamp"):
            capture_in(document)


def test_a_refusal_in_unnamed_light_is_a_document_too(tmp_path: Path) -> None:
    """No photo can be read; nobody named a lamp, and the tolerance of nothing is refused as a wrong call."""
    missing = attempt(tmp_path / "none.dng")
    assert missing.verdict.status == "refused"
    assert isinstance(missing.capture.unfinished.lamp, Unnamed)
    data = document_bytes(missing)
    assert document_bytes(forms.read(data, Result, "test", "")) == data
    with pytest.raises(InvalidArgument, match="has no tolerance"):
        attempt(Shot(tmp_path / "none.dng", lamp_tolerance="2%"))


def test_a_name_with_a_stated_tolerance_is_taken_as_said() -> None:
    assert isinstance(Shot("a.dng", "D55").light(), Called)
    told, exact = Shot("a.dng", "D55", lamp_tolerance="2%").light(), read_lamp("D55")
    assert isinstance(told, Lamp)
    assert (told.values == exact.values).all()
    assert (told.tolerance, len(told.modes)) == (exact.tolerance, 0)


# -- colour with a result in unnamed light -------------------------------------------------------------------------

LIGHTS = ("D65", "D50", "A", "2500K", "LED-B3", "FL2", "FL3.12")


@pytest.mark.full
@pytest.mark.requirement("R-COLOUR")
@pytest.mark.parametrize("other", [False, True], ids=["the chart's light", "another light"])
def test_the_colour_after_a_calibration_in_unnamed_light_covers_the_truth(other: bool) -> None:
    """14 phones drawn from the prior. What curves and light add is compared with the colour by the true ones."""
    rng, basis, surfaces_seen = np.random.default_rng(8), read_basis("phones"), surfaces()[::60]
    none = np.zeros((0, 681))
    whole: list[Any] = []
    of_light: list[Any] = []
    for number, name in enumerate(LIGHTS * 2):
        code = 0.7 * rng.normal(size=(3, basis.dictionary.shape[2]))
        curves = np.maximum(basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code), 0.0).T
        curves = curves / curves.max(axis=0)
        result = solve(unnamed(capture(curves, (name,), make="Apple")))
        raw = read_lamp(name).values @ curves  # `capture` has a white frame of equal channels
        result = replace(result, answer=replace(result.answer, channel_gain=raw / raw[1]))
        light = read_lamp(LIGHTS[(number + 2) % len(LIGHTS)] if other else name).values
        y, error = signals_of(surfaces_seen, light, curves), 0.002
        reference = Reference(raw=3000.0 * (light @ curves), error=0.002)
        colours = standard_colour(result, "auto", y, error, reference=reference)
        truth = of_surfaces(surfaces_seen, light, View())[1]
        exact = standard_colour(
            Camera("true", curves, np.zeros((0, 681, 3))), Lamp("true", light, 0.0, none, ""), y, error
        )
        added = colours.parts["curves"][1] + colours.parts["lamp"][1] + 1e-4 * np.eye(3)
        for off, covariance, into in (
            (colours.lab - truth, colours.lab_covariance, whole),
            (colours.lab - exact.lab, added, of_light),
        ):
            into.append(np.einsum("mc,mc->m", off, np.linalg.solve(covariance, off[..., None])[..., 0]))
    for chi in (np.concatenate(whole), np.concatenate(of_light)):
        assert np.mean(chi < 7.815) > 0.93
    assert np.mean(of_light) > 0.3  # nor is the band much too wide


@pytest.mark.full
@pytest.mark.parametrize("told", [[], ["--lamp", "auto"]])
def test_a_colour_is_read_on_the_default_path_after_unnamed_light(
    told: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the command line and in the page; truth is the chart's table."""
    from camssf import calibrate, cli
    from camssf.spectra.cameras import DEMO_PHONE
    from camssf_app.orders import ColourOrder
    from camssf_app.tasks import perform

    monkeypatch.chdir(tmp_path)
    (made,) = photos("D55", DEMO_PHONE).shots
    result = calibrate(str(made.chart))
    (tmp_path / "result").mkdir()
    result.save("result/result.json")
    (tmp_path / "photo-0").mkdir()
    shutil.copy(made.chart, tmp_path / "photo-0")
    corners = [np.array(result.capture.shots[0].pose.patches[patch]).min(axis=0) + 8 for patch in (13, 18)]
    squares = [[*corner.tolist(), 40.0, 40.0] for corner in corners]
    truth = of_surfaces(result.capture.chart.values[13:14], read_lamp("D55").values, View(white="D65"))[1][0]
    region, white = (",".join(f"{number:.0f}" for number in square) for square in squares)
    words = ["--region", region, "--white-region", f"{white},0.9", "--adapt", "D65"]
    assert cli.main(["colour", "result/result.json", str(made.chart), *words, *told]) == 0
    said = capsys.readouterr()
    assert "the light was not named: " in said.err
    order = ColourOrder(photo=0, lamp="auto", region=squares[0], white=squares[1], reflectance=0.9)
    page_said = perform("colour", order, lambda stage, part: None)["value"]
    assert page_said["light"].startswith("the light was not named: ")
    (region_said,) = json.loads(said.out)["regions"]
    found = [(region_said["lab"], np.sqrt(np.diagonal(region_said["lab_covariance"])))]
    for lab, std in (*found, (page_said["lab"], np.array(page_said["lab_std"]))):
        assert (np.abs(np.array(lab) - truth) < 3.0 * std).all()


@pytest.mark.parametrize("name", ["auto", "torch"])
def test_a_light_that_nothing_tells_is_refused_unless_it_has_one_kind(name: str) -> None:
    camera = Camera("any", resolve(PHONE), np.zeros((0, 681, 3)))
    if name == "torch":
        assert standard_colour(camera, name, np.full(3, 0.5)).lamps == (("white-led", 1.0),)
        return
    with pytest.raises(InvalidArgument, match="lamp is unknown, and nothing in the photo tells it"):
        standard_colour(camera, name, np.full(3, 0.5))


# -- combinations of lamps ----------------------------------------------------------------------------------------


def test_the_combinations_of_several_lamps_are_the_most_probable_ones() -> None:
    few = [[("a", 0.5), ("b", 0.5)], [("c", 0.9), ("d", 0.1)]]
    assert combined(few) == [("a", "c"), ("a", "d"), ("b", "c"), ("b", "d")]
    many = combined([[(str(i), 0.5 / (i + 1)) for i in range(7)]] * 20)
    assert len(many) == COMBINED
    assert many[0] == ("0",) * 20
    assert all(sum(kind != "0" for kind in one) <= 4 for one in many)


def test_a_lamp_that_was_called_is_reported_on_the_papers_basis_too() -> None:
    given = capture(resolve(PHONE), ["D55"])
    result = solve(
        replace(given, shots=(replace(given.shots[0], lamp=read_light("D55")),)), options=Options(basis="gaussian")
    )
    assert "The estimated light" not in page_of(result)


@pytest.mark.parametrize("name", ["/etc/hostname", "lamp.csv", "./D55", "HP1", "", "auto"])
def test_a_stored_name_reads_no_file(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "lamp.csv").write_text("400,1\n700,1\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidArgument, match="is no light by the name"):
        Called.from_plain({"name": name}, "capture.shots[0].lamp")
