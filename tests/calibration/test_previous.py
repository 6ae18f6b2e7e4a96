"""A previous result of the same unit: its shots read again, the drift by hand, the fallback, and wrong uses."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf import cli
from camssf.calibration import calibrate, read_previous, solve
from camssf.documents.document import document_bytes
from camssf.documents.previous import evened
from camssf.errors import CalibrationError, FramesDiffer, InvalidArgument, UnitDiffers
from camssf.grid import Floats
from camssf.options import Options
from camssf.photo.capture import Capture, MeasuredShot, measure
from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.read.unit import Unit
from camssf.photo.shot import Shot
from camssf.photo.signals import normalise
from camssf.recovery.drift import STEPS, moves
from camssf.report.build import report
from camssf.result import Result
from camssf.rules import rules
from camssf.spectra import read_lamp
from camssf.spectra.lights import read_light, unnamed_light
from golden.forms import resolve
from golden.scenes import PHONE
from tests.recovery.test_choice import SEEN, TABLE, capture
from tests.support import captures
from tests.support.documents import changed
from tests.verdict.test_verdict import BLACK

NEW = "1" * 64
ACCEPTED = {"verdict__status": "accepted", "verdict__reasons": ()}


def later(lamp: str, named: bool = False, camera: Floats | None = None) -> Capture:
    """A photo of the phone taken later, in this lamp."""
    camera = resolve(PHONE) if camera is None else camera
    photo = in_light(capture(camera, (lamp,), make="Apple"), lamp, camera)
    photo = changed(photo, shots__0__photo__name="later.dng", shots__0__photo__sha256=NEW)
    return photo if named else changed(photo, shots__0__lamp=unnamed_light())


def in_light(given: Capture, lamp: str, camera: Floats) -> Capture:
    """The capture of one photo with the raw white that the camera sees under this lamp."""
    (shot,) = given.shots
    seen = read_lamp(lamp).values @ camera
    seen /= seen.max()
    frames = {}
    for role in ("chart", "white", "dark"):
        if (frame := getattr(shot.means, role)) is not None:
            mean = BLACK + seen * (frame.mean - BLACK)
            error = seen * frame.standard_error
            frames[role] = replace(frame, mean=mean, standard_error=error, greens=mean[:, [1, 1]])
    return changed(given, shots__0__means=replace(shot.means, **frames))


@cache
def previous(lamp: str = "D55") -> Result:
    """The phone's calibration under a named lamp."""
    return solve(in_light(capture(resolve(PHONE), (lamp,), make="Apple"), lamp, resolve(PHONE)))


def error(found: Result, camera: Floats) -> float:
    off = (found.ssf.peak()[0] - camera / camera.max(axis=0))[SEEN]
    return float(np.sqrt(np.mean(off**2)))


def drift_of(result: Result) -> float:
    (value,) = (check.value for check in result.verdict.checks if check.name == "unit_drift")
    return value


@pytest.mark.parametrize("frames", [("white", "dark"), ()])
def test_shots_of_a_document_have_the_same_signals(frames: tuple[str, ...]) -> None:
    """Relative to the white patch; errors to first order, since white frame and white patch are independent."""
    given = later("A", named=True)
    (shot,) = given.shots
    dropped: dict[str, Any] = {role: None for role in ("white", "dark") if role not in frames}
    shot = replace(shot, means=replace(shot.means, **dropped), **dropped)
    first = solve(replace(given, shots=(shot,)), options=Options(basis="phones"))
    joint = read_previous(changed(first, **ACCEPTED)).joined(capture(resolve(PHONE), ("D55",), make="Apple"))
    again, direct = (normalise([each.means], TABLE) for each in (joint.shots[1], evened(shot, TABLE)))
    for name in ("values", "standard_error", "used"):
        assert np.array_equal(getattr(again, name), getattr(direct, name))
    before = normalise([shot.means], TABLE).values
    assert again.values == pytest.approx(before / before[:, [TABLE.white]], rel=1e-12, abs=1e-12)
    assert joint.shots[1].lamp.name == "A"
    assert (joint.shots[1].white is None) == ("white" not in frames)


@pytest.mark.full
@pytest.mark.requirement("R-PREVIOUS")
def test_a_later_photo_in_any_light_is_solved_with_the_previous_result(tmp_path: Path) -> None:
    first, new = previous(), later("A")
    path = first.save(tmp_path / "first.json")
    alone, found = solve(new), solve(new, previous=path)
    assert found.verdict.status == "accepted"
    assert [shot.photo.sha256 for shot in found.capture.shots] == [NEW, "0" * 64]
    assert drift_of(found) < rules().number("verdict.unit_drift_unnamed")
    phone = resolve(PHONE)
    # Two photos of the same chart share its error, so the second adds little; a thousandth is chance.
    assert error(found, phone) < max(error(alone, phone), error(first, phone)) + 0.001
    assert found.ssf.half_width < first.ssf.half_width
    saved = Result.load(found.save(tmp_path / "found.json"))
    assert saved.capture.hashes["previous result: first.json"] == read_previous(path).sha256
    assert any(assumption.code == "previous_result" for assumption in saved.assumptions)


def test_moves_by_hand() -> None:
    curve = np.interp(np.arange(681), [0, 200, 300, 680], [0.0, 0.0, 1.0, 0.0])
    whole, long, short = moves(curve)
    assert whole[250] == pytest.approx(-STEPS / 100.0)
    assert whole[400] == long[400] == pytest.approx(STEPS / 380.0)
    assert short[250] == whole[250]
    assert not long[:301].any()
    assert not short[300:].any()


@pytest.mark.requirement("R-PREVIOUS")
def test_a_drift_is_noticed_and_the_previous_answer_stays() -> None:
    """The phone's blue curve has moved by 5 nm."""
    first, phone = previous(), resolve(PHONE).copy()
    phone[:, 2] = np.roll(phone[:, 2], -10)
    found = solve(later("D65", named=True, camera=phone), previous=first)
    assert found.verdict.status == "doubtful"
    assert [reason.code for reason in found.verdict.reasons] == ["unit_differs"]
    assert found.verdict.reasons[0].value == drift_of(found)
    assert (found.curves == first.curves).all()
    assert [shot.photo for shot in found.capture.shots] == [shot.photo for shot in first.capture.shots]
    assert found.capture.hashes[f"not used: later.dng, {NEW[:8]}"] == NEW
    assert "previous result: (given)" in found.capture.hashes
    with pytest.raises(InvalidArgument, match="was doubtful"):
        solve(later("A"), previous=found)


@pytest.mark.full
def test_a_wrong_name_of_the_new_lamp_does_not_touch_the_previous_answer() -> None:
    """The blue curve seems to have moved, but another lamp explains more."""
    first, new = previous(), later("LED-B3")
    found = solve(changed(new, shots__0__lamp=read_light("daylight")), previous=first)
    assert (found.verdict.status, found.verdict.reasons) == ("accepted", ())
    assert (found.curves == first.curves).all()
    assert "(shot 1: later.dng) did not enter: " in found.assumptions[-1].message


def shot_in(document: dict[str, Any]) -> Any:
    """The only shot of a document."""
    (shot,) = document["capture"]["shots"]
    return shot


GLARE = {"code": "glare", "message": "a.", "advice": "b.", "value": 1.0, "threshold": 0.0}
WRONG: list[tuple[Callable[[dict[str, Any]], Any], type[CalibrationError], str]] = [
    (lambda d: d["verdict"].update(status="doubtful", reasons=[GLARE]), InvalidArgument, "was doubtful: a."),
    (lambda d: shot_in(d).update(lamp={"kind": "unnamed", "name": "auto"}), InvalidArgument, "names no lamp"),
    (lambda d: d["capture"]["chart"].update(name="nano24"), InvalidArgument, "on the chart nano24"),
    (lambda d: shot_in(d)["photo"].update(make="Samsung"), UnitDiffers, "make Samsung against Apple"),
    (lambda d: shot_in(d)["photo"].update(make=""), FramesDiffer, "different cameras"),
    (lambda d: shot_in(d)["photo"].update(unit={"lens": "tele"}), UnitDiffers, "lens 'wide' against 'tele'"),
    (lambda d: shot_in(d)["photo"].update(sha256=NEW), InvalidArgument, "already in the previous result"),
]


@pytest.mark.parametrize(("change", "kind", "words"), WRONG, ids=[words for _, _, words in WRONG])
def test_what_cannot_be_a_previous_result(change: Any, kind: Any, words: str, tmp_path: Path) -> None:
    document = json.loads(document_bytes(previous()))
    del document["sha256"]
    change(document)
    (tmp_path / "first.json").write_text(json.dumps(document))
    new = changed(later("A"), shots__0__photo__unit=Unit(lens="wide"))
    with pytest.raises(kind, match=words):
        solve(new, previous=tmp_path / "first.json")


@pytest.mark.parametrize("options", [Options(basis="gaussian"), Options(light_per_patch=0.08)])
def test_options_without_a_previous_result(options: Options) -> None:
    new = later("A", named=True)
    with pytest.raises(InvalidArgument, match="cannot be used"):
        solve(new, options=options, previous=previous())


@pytest.mark.full
@pytest.mark.requirement("R-PREVIOUS")
def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two photos of the demo's phone: named and framed before, unnamed and alone now."""
    first = calibrate(captures.shot("D55", "Demo phone")).save(tmp_path / "first.json")
    photo = str(captures.photos("A", "Demo phone", seed=4).shots[0].chart)
    assert cli.main(["calibrate", photo, "--previous", str(first)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["verdict"]["status"], len(document["capture"]["shots"])) == ("accepted", 2)
    (tmp_path / "joint.json").write_text(json.dumps(document))
    assert cli.main(["patches", photo]) == 0
    (tmp_path / "patches.json").write_text(capsys.readouterr().out)
    assert cli.main(["solve", str(tmp_path / "patches.json"), "--previous", str(first)]) == 0
    assert json.loads(capsys.readouterr().out)["answer"]["curves"] == document["answer"]["curves"]
    assert cli.main(["report", str(tmp_path / "joint.json"), "-o", str(tmp_path / "out")]) == 0
    assert cli.main(["parity", str(tmp_path / "joint.json"), photo]) == 2
    assert "previous one by itself" in capsys.readouterr().err
    with pytest.raises(InvalidArgument, match="cannot be read"):
        calibrate(Shot(photo), previous=tmp_path / "none.json")


def torch_shot() -> MeasuredShot:
    """The chart under a LED torch and half as much fluorescent light, which the frame with the torch off subtracts.

    Noise of both frames: hypot(0.1 % of the signal, 0.0002).
    """
    phone, chart = resolve(PHONE), TABLE.values
    torch, room = (read_lamp(name).values for name in ("LED-B3", "FL2"))
    on = (chart * torch) @ phone
    span, noise = on.max(), np.random.default_rng(3)
    off = 0.5 * (chart * room) @ phone * np.linspace(0.3, 1.0, 24)[:, None]  # uneven
    (shot,) = later("A").shots

    def frame(signal: Floats) -> FrameMeans:
        y = signal / span
        error = np.hypot(0.001 * y, 0.0002)
        mean, still = 512.0 + 9000.0 * (y + error * noise.normal(size=y.shape)), np.zeros_like(y)
        return FrameMeans(mean, 9000.0 * error, np.full(y.shape, 36), still, still, still, mean[:, [1, 1]])

    means = PatchMeans(frame(on + off), None, frame(off), np.full(3, 512.0), 16383.0)
    return replace(shot, lamp=read_light("torch"), white=None, means=means)


@pytest.mark.parametrize("frames", [{}, {"dark": "off.dng", "white": "white.dng"}])
def test_the_torch_needs_a_photo_with_the_torch_off_and_no_white_frame(frames: dict[str, str]) -> None:
    with pytest.raises(InvalidArgument, match="with the torch off"):
        measure(Shot("on.dng", "torch", **frames))


@pytest.mark.full
def test_the_torch_s_spectrum_is_measured_against_a_named_lamp() -> None:
    """Together with a calibration in daylight: found within its band, and more certain than by the torch alone."""
    true = read_lamp("LED-B3").values
    photo = replace(later("A"), shots=(torch_shot(),))
    alone, found = (solve(photo, previous=each) for each in (None, previous()))
    assert [shot.lamp.name for shot in found.capture.shots] == ["torch", "D55"]
    light, other = (each.answer.lights[0] for each in (found, alone))
    assert light.kinds["white-led"] > 0.9
    assert (np.abs(light.power - true / true.mean()) <= 1.96 * light.std)[SEEN].mean() >= 0.8  # one light
    assert light.std[SEEN].mean() < other.std[SEEN].mean()
    made = report(found)
    assert json.loads(made.result_json)["answer"]["lights"][0]["power"] == light.power.tolist()
    assert any("the light was the phone's torch" in assumption.message for assumption in found.assumptions)
    for words in ("<dd>the phone&#39;s torch + D55</dd>", "Shot 1: the phone&#39;s torch"):
        assert words in made.html
    assert "not named" not in made.html
    new = changed(later("A"), shots__0__photo__sha256="2" * 64)
    again = read_previous(changed(found, **ACCEPTED)).joined(new)
    assert [shot.lamp.name for shot in again.shots] == ["auto", "D55"]  # the torch's shot identifies no curves
