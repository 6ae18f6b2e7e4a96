"""`camssf parity`: a result falsified at each stage is found at that stage."""

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf import Options, Shot, cli
from camssf.calibration import attempt
from camssf.compare.differences import TABLE, differences, row_of
from camssf.compare.parity import POSE, STAGES, cause, first, parity
from camssf.documents.document import document_bytes
from camssf.documents.forms import from_plain
from camssf.errors import InvalidArgument
from camssf.photo.read.dng import read_dng
from camssf.result import Result
from camssf.spectra import read_camera
from camssf.spectra.lights import kind_of
from tests.support.captures import photos

Json = dict[str, Any]


@pytest.fixture(scope="session")
def result() -> Json:
    return measured(lamp_tolerance="3%,200K")


def measured(photo: str = "chart", options: Options | None = None, **more: Any) -> Json:
    """The document of a calibration of these photos, without its hash."""
    given = {"lamp": "D55", "white": frame("white"), "dark": frame("dark")} | more
    document: Json = json.loads(document_bytes(attempt([Shot(frame(photo), **given)], options=options or Options())))
    del document["sha256"]
    return document


def frame(role: str) -> str:
    return str(photos().shots[0].chart.with_name(f"{role}.dng"))


def loaded(document: Json) -> Result:
    return from_plain(document, Result, "phone.json", "")


def compared(document: Json, photo: str = "chart", **more: Any) -> Any:
    return parity(loaded(document), frame(photo), **({"white": [frame("white")], "dark": [frame("dark")]} | more))


def test_a_result_agrees_with_itself(result: Json) -> None:
    """Tolerance and mode of the lamp come from the document; another pose of the same chart would not."""
    findings = compared(result)
    assert tuple(finding.stage for finding in findings) == STAGES
    assert first(findings) is None, first(findings)
    by_stage = {finding.stage: finding for finding in findings}
    assert by_stage["patch means"].measured == 0
    assert by_stage["curve"].measured <= 1e-12
    assert 0 < by_stage["pose"].measured < POSE


def shot(document: Json) -> Json:
    return document["capture"]["shots"][0]


def shift(document: Json, part: float) -> None:
    """The whole pose, by a part of the pitch."""
    pose = shot(document)["pose"]
    quads = np.array(pose["patches"])
    pitch = np.linalg.norm(quads[1].mean(axis=0) - quads[0].mean(axis=0))
    pose["patches"] = (quads + part * pitch).tolist()
    pose["corners"] = (np.array(pose["corners"]) + part * pitch).tolist()


def chart(document: Json) -> Json:
    return shot(document)["means"]["chart"]


def scale(values: list[float], at: int, by: float) -> None:
    values[at] *= 1 + by


REASON = {"code": "glare", "message": "m", "advice": "a", "value": None, "threshold": None}
FALSE: list[tuple[str, str, Callable[[Json], object]]] = [
    ("file", "photo", lambda d: shot(d)["photo"].update(sha256="0" * 64)),
    ("pose", "patch", lambda d: shift(d, 0.05)),
    ("patch means", "mean", lambda d: shift(d, 0.005)),
    ("patch means", "clipped[2], green", lambda d: chart(d)["clipped"][1].__setitem__(1, 0.25)),
    ("inputs", "chart.table: Ohta", lambda d: d["capture"]["chart"].update(table="Ohta")),
    ("inputs", "answer.used", lambda d: d["answer"]["used"][0].__setitem__(4, False)),
    ("curve", "green at 540 nm", lambda d: scale(d["answer"]["curves"]["green"], 320, 1e-6)),
    ("band", "unseen_std: other rows", lambda d: d["answer"]["unseen_std"][0].__setitem__(8, None)),
    ("band", "blue at 450 nm", lambda d: scale(d["answer"]["std"]["blue"], 140, 1e-3)),
    ("gap", "there", lambda d: d["answer"]["proof"].update(gap=[1e-15, 1e-3, 1e-15])),
    ("scores", "rmsre", lambda d: scale(d["answer"]["scores"]["rmsre_percent"], 1, 1e-3)),
    ("verdict", "glare", lambda d: d["verdict"].setdefault("reasons", []).append(REASON)),
    ("verdict", "verdict.checks[3] (misfit_refuses).value", lambda d: d["verdict"]["checks"][2].update(value=1.0)),
    ("file", "capture.shots[1].white.sha256", lambda d: shot(d)["white"].update(sha256="1" * 64)),
]


@pytest.mark.full
@pytest.mark.parametrize(("stage", "words", "falsify"), FALSE, ids=[f"{s}-{w[:12]}" for s, w, _ in FALSE])
def test_the_first_difference_is_named(
    result: Json, stage: str, words: str, falsify: Callable[[Json], object]
) -> None:
    document = copy.deepcopy(result)
    falsify(document)
    finding = first(compared(document))
    assert finding.stage == stage
    assert words in finding.words
    assert finding.measured > finding.bound
    assert len(cause(finding)) > 20


def paths(value: Any, path: str = "") -> Iterator[tuple[str, Json, str]]:
    """Every key of a document: its path, the object that holds it, and its name."""
    if isinstance(value, dict):
        for key in list(value):
            yield f"{path}/{key}", value, key
            yield from paths(value[key], f"{path}/{key}")
    elif isinstance(value, list):
        for each in value[:1]:
            yield from paths(each, path)


def few(value: Any) -> Any:
    """The same with the first entry of each list alone, which is faster to compare."""
    if isinstance(value, dict):
        return {key: few(entry) for key, entry in value.items()}
    return [few(entry) for entry in value[:1]] if isinstance(value, list) else value


PARTS = ("format", "capture", "answer", "verdict", "assumptions")


@pytest.mark.parametrize("part", [pytest.param("capture", marks=pytest.mark.full), *sorted({*PARTS} - {"capture"})])
def test_no_field_may_be_missing(part: str, result: Json) -> None:
    """Each key of each part in turn, on either side."""
    assert set(result) == {"version", *PARTS}
    whole, document = (few({"version": "", part: result[part]}) for _ in range(2))
    for path, holder, key in list(paths(document)):
        if path in ("/version", "/answer"):  # without one, two releases, or a refusal, are compared
            continue
        value = holder.pop(key)
        for one, other, side in ((document, whole, "there"), (whole, document, "here")):
            fields = [field for field in differences(one, other) if not field.agrees]
            assert {(field.stage, field.measured) for field in fields} == {(row_of(path)[0], np.inf)}, path
            assert all(field.words.endswith(f"is missing {side}") for field in fields), path
        holder[key] = value


def test_every_field_is_compared(result: Json) -> None:
    """Each value in turn: it differs, or has a measure of its own, or is one of the few that cannot be equal."""
    whole, document = few(result), few(result)
    for path, holder, key in list(paths(document)):
        value = holder[key]
        if isinstance(value, dict | list) and value:
            continue
        holder[key] = "another" if not isinstance(value, bool) else not value
        differs = any(not field.agrees for field in differences(document, whole))
        assert differs != (row_of(path.partition(": ")[0])[1] is None), path
        holder[key] = value
    assert {stage for stage, _, _ in TABLE.values()} == set(STAGES)


def test_a_truth_travels(result: Json) -> None:
    """What a result was compared with is no input of it, but the comparison is held to the truth that it states."""
    true = json.loads(document_bytes(loaded(result).with_truth(read_camera(str(photos().truth)))))
    del true["sha256"]
    assert first(compared(true)) is None
    scale(true["answer"]["scores"]["rmse"], 1, 1e-3)
    finding = first(compared(true))
    assert (finding.stage, finding.words.partition(":")[0]) == ("scores", "answer.scores.rmse, green")


def test_bounds_are_those_of_last_bits_and_another_release_may_lack_fields(result: Json) -> None:
    document = copy.deepcopy(result) | {"version": "0.0.9"}
    scale(chart(document)["mean"][6], 1, 1e-13)
    scale(document["answer"]["curves"]["green"], 320, 1e-10)
    for key in ("code_covariance", "evidence", "uncertainty", "predicted_std", "unseen_std"):
        del document["answer"][key]
    del document["verdict"]["checks"]
    assert first(compared(document)) is None


@pytest.mark.full
def test_a_result_on_a_stated_basis() -> None:
    """Solved here on the basis that it names, not by a choice."""
    document = measured(options=Options(basis="phones"))
    assert document["answer"]["basis"] == "phones"
    assert "prior_scale" not in document["answer"]
    assert {one["basis"] for one in document["answer"]["choice"]} == {"phones"}  # its lamps were weighed
    assert first(compared(document)) is None
    document["answer"]["prior_scale"] = 2.0
    finding = first(compared(document))
    assert (finding.stage, finding.words) == ("inputs", "answer.prior_scale is missing here")


@pytest.mark.full
def test_a_result_in_a_light_that_nobody_named() -> None:
    """Nobody named it here, either: the same hypotheses, by the same weights."""
    document = measured(lamp="auto", options=Options(basis="phones"))
    answer = document["answer"]
    lamps = {kind_of(lamp) for one in answer["choice"] for lamp in one["kinds"]}
    assert lamps == set(answer["lights"][0]["kinds"])
    assert first(compared(document)) is None
    light = answer["lights"][0]
    moved = {key: light[key] + 1.0 for key in ("kelvin", "kelvin_std")}
    moved |= {key: [value + 1e-6 for value in light[key]] for key in ("power", "std")}
    evidence = {"log_evidence": answer["choice"][1]["log_evidence"] + 1.0}
    for words, place, change in (
        ("answer.choice[2] (phones under bulb).log_evidence", lambda d: d["choice"][1], evidence),
        *((f"answer.lights[1].{key}", lambda d: d["lights"][0], {key: value}) for key, value in moved.items()),
        ("answer.lights[1] is missing there", lambda d: d, {"lights": []}),
    ):
        other = copy.deepcopy(document)
        place(other["answer"]).update(change)
        finding, *_ = [field for field in differences(other, document) if not field.agrees]
        assert (finding.stage, finding.words.startswith(words)) == ("band", True), finding


def test_frames_are_asked_for(result: Json) -> None:
    alone = copy.deepcopy(result)
    shot(alone)["white"] = shot(alone)["means"]["white"] = None
    for document, more, words in (
        (result, {"white": []}, "used the white frame"),
        (result, {"dark": [None]}, "used the dark frame"),
        (result, {"lamps": ["D55", "A"]}, "2 lamps"),
        (result, {"white": [frame("none")]}, "cannot be read"),
        (alone, {}, "used no white frame"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            compared(document, **more)
    with pytest.raises(InvalidArgument, match="2 photo"):
        parity(loaded(result), [frame("chart")] * 2)


def test_a_refusal_agrees_with_a_refusal() -> None:
    """The white frame for the dark one: refused here and there, by the same code."""
    document = measured(white=frame("dark"), dark=frame("white"))
    frames = {"white": [frame("dark")], "dark": [frame("white")]}
    assert first(compared(document, **frames)) is None
    document["verdict"]["reasons"][0]["code"] = "blurred"
    assert first(compared(document, **frames)).stage == "verdict"


@pytest.mark.full
def test_a_refusal_with_stated_options() -> None:
    """Such a result holds neither basis nor penalties: they are given again."""
    document = measured(options=Options(basis="phones", l2=4.0), lamp="2856K")
    assert document["verdict"]["status"] == "refused"
    assert first(compared(document, options=Options(basis="phones", l2=4.0))) is None
    for less in (Options(basis="phones"), Options(l2=4.0)):
        assert first(compared(document, options=less)).stage == "verdict"


def test_a_refusal_before_any_patch() -> None:
    """No chart in the white frame: pose and patches are missing on both sides."""
    document = measured("white", white=None, dark=None)
    findings = compared(document, "white", white=(), dark=())
    assert [finding.stage for finding in findings] == ["file", "photo", "verdict"]
    assert first(findings) is None
    assert read_dng(frame("white")).sha256 == document["capture"]["unfinished"]["photo"]["sha256"]


@pytest.mark.full
def test_the_command(result: Json, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, false = tmp_path / "phone.json", copy.deepcopy(result)
    scale(false["answer"]["curves"]["green"], 320, 1e-6)
    call = ["parity", str(path), frame("chart")]
    frames = [f"--{role}={frame(role)}" for role in ("white", "dark")]
    for document, status, stage in ((result, 0, None), (false, 1, "curve")):
        path.write_text(json.dumps(document), "utf-8")
        assert cli.main([*call, *frames]) == status
        out, err = capsys.readouterr()
        answer = json.loads(out)
        assert (answer["agrees"], answer["first"], len(answer["stages"])) == (status == 0, stage, len(STAGES))
        assert (err.count("agrees") == len(STAGES)) == (status == 0)
    assert "first difference: curve. The inputs agree, the solution does not" in " ".join(err.split())
    assert cli.main(call) == 2
    assert "Give just that by --white" in capsys.readouterr().err
