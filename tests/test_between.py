"""Between two cameras: limits that can be done by hand, drawing what is not known, the command."""

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import document, refused
from problems import bell, measured_cameras, toy_camera

import camssf
from camssf import cli
from camssf.colour import PARTS, Camera, Reference, convert
from camssf.colour.camera import OwnWhite
from camssf.colour.reach import MOST, REACH
from camssf.colour.transforms import KINDS, signals_of
from camssf.documents.result_json import document_bytes
from camssf.errors import InvalidArgument, LampUnfit
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_chart, read_lamp
from camssf.spectra.surfaces import surfaces
from tests.schemas import check_schema

SCHEMA = Path(camssf.__file__).parent / "data" / "between.schema.json"
CHART = read_chart("classic24").values
LAMP = "D55"


def power(name: str = LAMP) -> Floats:
    return read_lamp(name).values


def exact(curves: Floats | None = None) -> Camera:
    curves = toy_camera() if curves is None else curves
    return Camera("toy", curves / curves.max(axis=0), np.zeros((0, *curves.shape)))


def blurred(curves: Floats | None = None, size: float = 0.02) -> Camera:
    """With two errors of its curves: red too far right, green too wide."""
    one = exact(curves)
    modes = np.zeros((2, *one.values.shape))
    modes[0, :, 0] = size * np.gradient(one.values[:, 0], WAVELENGTHS) * 40
    modes[1, :, 1] = size * bell(500, 15)
    return replace(one, modes=modes)


def other() -> Camera:
    return exact(measured_cameras()["Canon EOS 5D"])


def known(name: str = LAMP) -> Any:
    return replace(read_lamp(name), tolerance=0.0)


# -- limits that can be done by hand ----------------------------------------------------------------------------


@pytest.mark.parametrize("lamp", [LAMP, "FL2", "bulb", "LED-B3"])
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


@pytest.mark.parametrize("lamp", [LAMP, "FL2", "A"])
def test_curves_that_are_mixtures_give_the_very_matrix(lamp: str) -> None:
    """s_B = s_A M: white-balanced, y_B = y_A · diag(white_A) M diag(1 / white_B)."""
    mix = np.array([[0.9, 0.1, 0.0], [0.2, 1.0, 0.1], [0.05, 0.1, 0.8]])
    source = exact()
    target = Camera("mixed", source.values @ mix, np.zeros((0, 681, 3)))
    whites = [power(lamp) @ camera.values for camera in (source, target)]
    expected = whites[0][:, None] * mix / whites[1]
    y = signals_of(CHART, power(lamp), source.values)
    found = convert(source, target, known(lamp), y)
    assert found.conversions[0].kind == "matrix"
    assert np.abs(found.conversions[0].coefficients - expected).max() < 1e-10
    assert np.abs(expected.sum(axis=0) - 1).max() < 1e-12
    assert np.abs(found.signals - signals_of(CHART, power(lamp), target.values)).max() < 1e-11
    for name in ("curves", "lamp", "noise", "metamers"):
        assert np.sqrt(np.abs(found.parts[name]).max()) < 1e-9, name
    # the reference's error remains: a white that is off by 1 % is so for both cameras
    sizes = np.sqrt(np.diagonal(found.parts["reference"], axis1=1, axis2=2))
    assert (sizes[18] > 0.005).all()


def test_noise_goes_through_the_matrix() -> None:
    mix = np.array([[0.9, 0.1, 0.0], [0.2, 1.0, 0.1], [0.05, 0.1, 0.8]])
    source = exact()
    target = Camera("mixed", source.values @ mix, np.zeros((0, 681, 3)))
    y = signals_of(CHART, power(), source.values)
    found = convert(source, target, known(), y, 0.002)
    matrix = found.conversions[0].coefficients
    assert np.abs(found.parts["noise"] - 0.002**2 * matrix.T @ matrix).max() < 1e-12


# -- what is not known ------------------------------------------------------------------------------------------


def test_white_stays_white_and_more_light_changes_nothing() -> None:
    for kind in KINDS:
        found = convert(exact(), other(), LAMP, np.ones(3), kind=kind)
        conversion = found.conversions[0]
        assert np.abs(found.signals - 1).max() < 1e-12
        y = signals_of(CHART, power(), toy_camera())
        assert np.abs(conversion.apply(0.1 * y) - 0.1 * conversion.apply(y)).max() < 1e-14


def test_signals_of_unseen_surfaces_are_nearly_those_of_the_other_camera() -> None:
    source, target = exact(), other()
    y, truth = (signals_of(CHART, power(), camera.values) for camera in (source, target))
    found = convert(source, target, known(), y)
    before, after = (np.sqrt(np.mean((each - truth) ** 2)) for each in (y, found.signals))
    assert after < 0.5 * before
    off = found.signals - truth
    # without the reference's part: this reference was exact
    spread = found.covariance - found.parts["reference"]
    chi = np.einsum("mc,mc->m", off[:18], np.linalg.solve(spread[:18], off[:18, :, None])[..., 0])
    assert np.mean(chi < 7.815) > 0.85
    conversion = found.conversions[0]
    assert conversion.rms[conversion.kind] == min(conversion.rms.values())
    assert conversion.rms["root-polynomial"] < conversion.rms["matrix"]


def test_parts_add_up_and_are_covariances() -> None:
    y = signals_of(CHART, power("A"), toy_camera())
    found = convert(blurred(), blurred(other().values), "A", y, 0.01 * y)
    assert tuple(found.parts) == PARTS
    assert np.abs(found.covariance - sum(found.parts.values())).max() < 1e-15
    assert (np.linalg.eigvalsh(found.covariance) > 0).all()


@pytest.mark.parametrize("side", ["source", "target"])
def test_the_curves_part_is_what_drawing_curves_gives(side: str) -> None:
    """Of either camera."""
    cameras = {"source": exact(), "target": other()}
    true = cameras[side].values
    y = signals_of(CHART[:6], power("LED-B3"), cameras["source"].values)
    unsure = blurred(true, 0.01)
    told = known("LED-B3")
    found = convert(**(cameras | {side: unsure}), lamp=told, signals=y, kind="matrix")
    assert not found.parts["lamp"].any()
    rng = np.random.default_rng(5)
    drawn = []
    for _ in range(200):
        values = true + np.einsum("q,qmc->mc", rng.normal(size=2), unsure.modes)
        drawn.append(convert(**(cameras | {side: exact(values)}), lamp=told, signals=y, kind="matrix").signals)
    ours, theirs = np.sqrt(np.diagonal(found.parts["curves"], axis1=1, axis2=2)), np.std(drawn, axis=0)
    assert np.abs(ours - theirs).max() < 0.2 * theirs.max()


def test_the_lamp_part_is_what_drawing_lamps_gives() -> None:
    source, target = exact(), other()
    told = replace(known("bulb"), modes=0.5 * read_lamp("bulb").modes)
    y = signals_of(CHART[:6], told.values, source.values)
    found = convert(source, target, told, y, kind="matrix")
    rng = np.random.default_rng(5)
    drawn = []
    for _ in range(200):
        values = told.values * (1 + rng.normal(size=len(told.modes)) @ told.modes)
        drawn.append(
            convert(source, target, replace(told, values=values, modes=told.modes[:0]), y, kind="matrix").signals
        )
    ours, theirs = np.sqrt(np.diagonal(found.parts["lamp"], axis1=1, axis2=2)), np.std(drawn, axis=0)
    assert np.abs(ours - theirs).max() < 0.15 * theirs.max()


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


def owned(camera: Camera, name: str = LAMP) -> Camera:
    raw = power(name) @ camera.values
    return replace(camera, own=OwnWhite(raw / raw[1], read_lamp(name)))


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


@pytest.mark.parametrize(("signal", "far"), [((0.4, 0.2, 0.1), False), ((0.02, 0.9, 0.02), True)])
def test_signals_that_no_surface_gives_are_found_out(signal: tuple[float, ...], far: bool) -> None:
    found = convert(blurred(size=0.005), other(), LAMP, np.array(signal), 0.002)
    assert (found.reach[0] > REACH) == far


@pytest.mark.parametrize("wrong", [np.ones(2), np.array([[1.0, np.nan, 1.0]]), np.ones((1, 1, 3))])
def test_signals_that_are_none_are_refused(wrong: Floats) -> None:
    with pytest.raises(InvalidArgument, match="Signals"):
        convert(exact(), other(), LAMP, wrong)


def test_what_cannot_be_converted_is_refused() -> None:
    with pytest.raises(InvalidArgument, match="no transform"):
        convert(exact(), other(), LAMP, np.ones(3), kind="cube")
    with pytest.raises(InvalidArgument, match="standard error"):
        convert(exact(), other(), LAMP, np.ones(3), -1.0)
    twins = exact()
    twins.values[:, 1] = twins.values[:, 0]
    with pytest.raises(InvalidArgument, match="No conversion"):
        convert(twins, other(), LAMP, np.ones(3))
    ultraviolet = replace(read_lamp(LAMP), values=np.where(WAVELENGTHS < 381, 1.0, 0.0), tolerance=0.0)
    blind = other()
    blind.values[WAVELENGTHS < 400] = 0.0
    with pytest.raises(InvalidArgument, match="no response"):
        convert(exact(), blind, ultraviolet, np.ones(3))


# -- the command ------------------------------------------------------------------------------------------------


def results(tmp_path: Path) -> tuple[str, str, dict[str, Any]]:
    """Two results, of a Nikon and of a Canon."""
    paths = []
    given = [copy.deepcopy(document("D55")) for _ in range(2)]
    canon = other().values
    for name, curve in zip(("red", "green", "blue"), canon.T, strict=True):
        given[1]["ssf"][name] = (curve / curve.max()).tolist()
    given[1]["camera"] = {"make": "Canon", "model": "Canon EOS 5D"}
    for name, each in zip("ab", given, strict=True):
        path = tmp_path / f"{name}.json"
        path.write_bytes(document_bytes(each))
        paths.append(str(path))
    return paths[0], paths[1], given[0]


def validator() -> Any:
    jsonschema = pytest.importorskip("jsonschema")
    return jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text("utf-8")))


def test_the_command_converts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b, given = results(tmp_path)
    words = ["colour", "--from", a, "--to", b, "--lamp", "LED-B3", "--signal", "0.4,0.3,0.2", "--signal", "1,1,1"]
    assert cli.main(words) == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    validator().validate(found)
    assert found["from"]["camera"] == "NIKON CORPORATION NIKON D850"
    assert found["to"]["camera"] == "Canon EOS 5D"
    assert found["from"]["verdict"] == given["verdict"]["status"]
    assert [each["status"] for each in found["signals"]] == ["ok", "ok"]
    (conversion,) = found["conversions"]
    y = np.array([0.4, 0.3, 0.2])
    rows = [*y, np.sqrt(y[0] * y[1]), np.sqrt(y[1] * y[2]), np.sqrt(y[0] * y[2])]
    by_hand = np.array(rows[: len(conversion["coefficients"])]) @ np.array(conversion["coefficients"])
    assert np.abs(by_hand - found["signals"][0]["converted"]).max() < 1e-12
    assert np.abs(np.array(found["signals"][1]["converted"]) - 1).max() < 1e-9
    assert np.abs(np.array(conversion["matrix"]).sum(axis=0) - 1).max() < 1e-9
    assert "signal 1: R 0." in said.err
    assert "Canon EOS 5D under LED-B3" in said.err
    covariance = np.array(found["signals"][0]["covariance"])
    parts = sum(np.square(each) for each in found["signals"][0]["parts"].values())
    assert np.abs(np.diagonal(covariance) - parts).max() < 1e-12


def test_without_signals_the_conversion_alone_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b, _ = results(tmp_path)
    assert cli.main(["colour", "--from", a, "--to", b]) == 0
    found = json.loads(capsys.readouterr().out)
    validator().validate(found)
    assert found["signals"] == []
    assert found["lamp"]["asked"] == "D55"  # of the first shot
    assert cli.main(["colour", "--from", a, "--to", a]) == 0
    same = json.loads(capsys.readouterr().out)["conversions"][0]
    assert np.abs(np.array(same["coefficients"]) - np.eye(3)).max() < 1e-11


def test_a_signal_out_of_reach_ends_in_its_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b, _ = results(tmp_path)
    assert cli.main(["colour", "--from", a, "--to", b, "--signal", "0.01,3,0.01"]) == 9
    said = capsys.readouterr()
    found = json.loads(said.out)
    validator().validate(found)
    assert found["signals"][0]["status"] == "colour_out_of_reach"
    assert "converted" not in found["signals"][0]


def test_the_command_says_no(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b, _ = results(tmp_path)
    no = tmp_path / "refused.json"
    no.write_bytes(document_bytes(refused()))
    base = ["colour", "--from", a, "--to", b]
    for words, text in (
        (["colour"], "needs a result"),
        (["colour", a], "needs a result"),
        (["colour", a, "photo.dng", "--signal", "1,1,1"], "needs a result"),
        (["colour", "--from", a], "needs two cameras"),
        (["colour", "--to", a], "needs two cameras"),
        (["colour", "--from", str(no), "--to", b], "refused"),
        (["colour", "--from", a, "--to", str(no)], "refused"),
        (["colour", "--from", "-", "--to", "-"], "one result"),
        ([*base, "--observer", "1964"], "no observer"),
        ([*base, "--adapt", "D50"], "no observer"),
        ([*base, "photo.dng"], "either from a photo"),
        ([*base, "--region", "1,2,3,4"], "either from a photo"),
        ([*base, "photo.dng", "--region", "1,2,3,4"], "needs a region, and a white"),
        ([*base, "photo.dng", "other.dng"], "at most one photo"),
        ([*base, "--signal", "1,2"], "is not a signal"),
        ([*base, "--signal", "1,2,x"], "is not a signal"),
        ([*base, "--signal", "1,2,nan"], "finite"),
        ([*base, "--lamp", "auto"], "lamp is unknown"),
    ):
        assert cli.main(words) == 2, words
        said = capsys.readouterr()
        assert text in said.err, words
        assert said.out == ""


@pytest.mark.full
def test_regions_of_a_photo_are_converted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From a simulated photo by the one camera; what the other would have seen is known."""
    from camssf.simulation.frames import simulate
    from camssf.simulation.scene import Scene

    scene = simulate("Nikon 5100 (NPL)", ["D55"], tmp_path, scene=Scene(size=(900, 675)), seed=3)
    from camssf.spectra import read_camera

    truth = read_camera("Nikon 5100 (NPL)").values
    a, b, given = results(tmp_path)
    for name, curve in zip(("red", "green", "blue"), truth.T, strict=True):
        given["ssf"][name] = (curve / curve.max()).tolist()
    raw = power() @ truth
    given["channel_gain"] = (raw / raw[1]).tolist()
    given["camera"] = {"make": "", "model": ""}
    Path(a).write_bytes(document_bytes(given))
    corners = np.array(scene.pose.patches)

    def place(patch: int) -> str:
        x, y = corners[patch].min(axis=0) + 12
        return f"{x:.0f},{y:.0f},56,56"

    regions = [word for patch in (0, 4, 12) for word in ("--region", place(patch))]
    white = signals_of(CHART[18:19], power(), truth).mean()
    words = ["--white-region", place(18), "--white-reflectance", f"{white:.4f}", "--lamp", LAMP]
    photo = str(scene.shots[0].chart)
    status = cli.main(["colour", photo, "--from", a, "--to", b, *regions, *words])
    said = capsys.readouterr()
    assert status == 0, said.err
    found = json.loads(said.out)
    validator().validate(found)
    assert found["photo"]["name"] == Path(photo).name
    expected = signals_of(CHART[[0, 4, 12]], power(), other().values)
    for each, aim in zip(found["signals"], expected, strict=True):
        off = np.array(each["converted"]) - aim
        assert off @ np.linalg.solve(np.array(each["covariance"]), off) < 16.3


def test_the_schema_is_sound_and_says_what_everything_is() -> None:
    check_schema(SCHEMA)
