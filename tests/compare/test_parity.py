"""`camssf parity`: a result falsified at each stage is found at that stage."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf import cli
from camssf.compare.differences import TABLE, Finding, differences, row_of
from camssf.compare.parity import POSE, STAGES, cause, first, parity
from camssf.documents.forms import from_plain
from camssf.errors import InvalidArgument
from camssf.photo.read.dng import read_dng
from camssf.result import Result
from camssf.spectra import read_camera
from camssf.spectra.lights import kind_of
from tests.support.captures import photos

Json = dict[str, Any]


@pytest.fixture(scope="module")
def shots() -> Path:
    return photos().shots[0].chart.parent


@pytest.fixture(scope="module")
def result(shots: Path, tmp_path_factory: pytest.TempPathFactory) -> Json:
    out = tmp_path_factory.mktemp("out")
    frames = [f"--{role}={shots / role}.dng" for role in ("white", "dark")]
    arguments = ["calibrate", str(shots / "chart.dng"), "--lamp", "D55", *frames, "--lamp-tolerance", "3%,200K"]
    assert cli.main([*arguments, "-o", str(out)]) == 0
    document: Json = json.loads((out / "result.json").read_text("utf-8"))
    del document["sha256"]
    return document


def loaded(document: Json) -> Result:
    return from_plain(document, Result, "phone.json", "")


def compared(document: Json, shots: Path, **more: Any) -> Any:
    more = {"white": [shots / "white.dng"], "dark": [shots / "dark.dng"]} | more
    return parity(loaded(document), shots / "chart.dng", **more)


def test_a_result_agrees_with_itself(result: Json, shots: Path) -> None:
    """Tolerance and mode of the lamp come from the document; another pose of the same chart would not."""
    findings = compared(result, shots)
    assert tuple(finding.stage for finding in findings) == STAGES
    assert first(findings) is None, first(findings)
    by_stage = {finding.stage: finding for finding in findings}
    assert by_stage["patch means"].measured == 0
    assert by_stage["curve"].measured <= 1e-12
    assert 0 < by_stage["pose"].measured < POSE


def shot(document: Json) -> Json:
    found: Json = document["capture"]["shots"][0]
    return found


def shift(document: Json, part: float) -> None:
    """The whole pose, by a part of the pitch."""
    pose = shot(document)["pose"]
    quads = np.array(pose["patches"])
    pitch = np.linalg.norm(quads[1].mean(axis=0) - quads[0].mean(axis=0))
    pose["patches"] = (quads + part * pitch).tolist()
    pose["corners"] = (np.array(pose["corners"]) + part * pitch).tolist()


def chart(document: Json) -> Json:
    means: Json = shot(document)["means"]["chart"]
    return means


def scale(values: list[float], at: int, by: float) -> None:
    values[at] *= 1 + by


REASON = {"code": "glare", "message": "m", "advice": "a", "value": None, "threshold": None}
FALSE: list[tuple[str, str, Callable[[Json], object]]] = [
    ("file", "photo", lambda d: shot(d)["photo"].update(sha256="0" * 64)),
    ("photo", "saturation: 15000", lambda d: shot(d)["means"].update(saturation=15000.0)),
    ("pose", "patch", lambda d: shift(d, 0.05)),
    ("pose", "90° there", lambda d: shot(d)["pose"].update(quarter_turns=1)),
    ("patch means", "mean", lambda d: shift(d, 0.005)),
    ("patch means", "clipped[2], green", lambda d: chart(d)["clipped"][1].__setitem__(1, 0.25)),
    ("patch means", "mean[19], red", lambda d: scale(chart(d)["mean"][18], 0, 1e-9)),
    ("inputs", "chart.table: Ohta", lambda d: d["capture"]["chart"].update(table="Ohta")),
    ("inputs", "answer.used", lambda d: d["answer"]["used"][0].__setitem__(4, False)),
    ("curve", "green at 540 nm", lambda d: scale(d["answer"]["curves"]["green"], 320, 1e-6)),
    ("band", "blue at 450 nm", lambda d: scale(d["answer"]["std"]["blue"], 140, 1e-3)),
    ("band", "std is missing there", lambda d: d["answer"].pop("std")),
    ("band", "(cameras).log_evidence", lambda d: d["answer"]["choice"][1].update(log_evidence=1.0)),
    ("band", "unseen_std: other rows", lambda d: d["answer"]["unseen_std"][0].__setitem__(8, None)),
    ("band", "(lamp).share, blue", lambda d: scale(d["answer"]["uncertainty"]["budget"][3]["share"], 2, 1e-3)),
    ("gap", "there", lambda d: d["answer"]["proof"].update(gap=[1e-15, 1e-3, 1e-15])),
    ("scores", "rmsre", lambda d: scale(d["answer"]["scores"]["rmsre_percent"], 1, 1e-3)),
    ("scores", "unseen[1][12], red", lambda d: scale(d["answer"]["unseen"][0][11], 0, 1e-4)),
    ("verdict", "glare", lambda d: d["verdict"].setdefault("reasons", []).append(REASON)),
    ("verdict", "doubtful", lambda d: d["verdict"].update(status="doubtful")),
    ("verdict", "verdict.checks[3] (misfit_refuses).value", lambda d: d["verdict"]["checks"][2].update(value=1.0)),
    ("inputs", "shots[1].lamp.values at 383.5 nm: ", lambda d: scale(shot(d)["lamp"]["values"], 7, 1e-6)),
    ("file", "capture.shots[1].white.sha256", lambda d: shot(d)["white"].update(sha256="1" * 64)),
]


@pytest.mark.full
@pytest.mark.parametrize(("stage", "words", "falsify"), FALSE, ids=[f"{s}-{w[:12]}" for s, w, _ in FALSE])
def test_the_first_difference_is_named(
    result: Json, shots: Path, stage: str, words: str, falsify: Callable[[Json], object]
) -> None:
    document = copy.deepcopy(result)
    falsify(document)
    found = first(compared(document, shots))
    assert found is not None
    assert found.stage == stage
    assert words in found.words
    assert found.measured > found.bound
    assert len(cause(found)) > 20


def paths(value: Any, path: str = "") -> Iterator[tuple[str, Json, str]]:
    """Every key of a document: its path, the object that holds it, and its name."""
    if isinstance(value, dict):
        for key in list(value):
            yield f"{path}/{key}", value, key
            yield from paths(value[key], f"{path}/{key}")
    elif isinstance(value, list):
        for each in value[:1]:
            yield from paths(each, path)


def test_no_field_may_be_missing(result: Json) -> None:
    """Each key in turn, on either side."""
    whole = copy.deepcopy(result)
    document = copy.deepcopy(whole)
    found = list(paths(document))
    assert len(found) > 100
    for path, holder, key in found:
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
    document = copy.deepcopy(result)
    for path, holder, key in list(paths(document)):
        value = holder[key]
        if isinstance(value, dict | list) and value:
            continue
        holder[key] = "another" if not isinstance(value, bool) else not value
        differs = any(not field.agrees for field in differences(document, result))
        assert differs != (row_of(path.partition(": ")[0])[1] is None), path
        holder[key] = value
    assert {stage for stage, _, _ in TABLE.values()} == set(STAGES)


def test_a_truth_travels(result: Json, shots: Path) -> None:
    """What a result was compared with is no input of it, but the comparison is held to the truth that it states."""
    true = loaded(result).with_truth(read_camera(str(shots / "truth.csv")))
    frames = {"white": [shots / "white.dng"], "dark": [shots / "dark.dng"]}
    assert first(parity(true, shots / "chart.dng", **frames)) is None
    assert true.answer is not None
    assert true.answer.scores.rmse is not None
    scores = replace(true.answer.scores, rmse=true.answer.scores.rmse * [1, 1.001, 1])
    false = replace(true, answer=replace(true.answer, scores=scores))
    found = first(parity(false, shots / "chart.dng", **frames))
    assert found is not None
    assert (found.stage, found.words.partition(":")[0]) == ("scores", "answer.scores.rmse, green")


def test_bounds_are_those_of_last_bits(result: Json, shots: Path) -> None:
    document = copy.deepcopy(result)
    scale(chart(document)["mean"][6], 1, 1e-13)
    scale(document["answer"]["curves"]["green"], 320, 1e-10)
    assert first(compared(document, shots)) is None


def test_a_result_of_another_release_may_lack_fields(result: Json, shots: Path) -> None:
    """What there is agrees."""
    document = copy.deepcopy(result) | {"version": "0.0.9"}
    for key in ("code_covariance", "evidence", "uncertainty", "predicted_std", "unseen_std"):
        del document["answer"][key]
    del document["verdict"]["checks"]
    assert first(compared(document, shots)) is None


def test_a_result_on_a_stated_basis(shots: Path, tmp_path: Path) -> None:
    """Solved here on the basis that it names, not by a choice."""
    frames = [f"--{role}={shots / role}.dng" for role in ("white", "dark")]
    arguments = ["calibrate", str(shots / "chart.dng"), "--lamp", "D55", *frames, "--basis", "phones"]
    assert cli.main([*arguments, "-o", str(tmp_path)]) == 0
    document: Json = json.loads((tmp_path / "result.json").read_text("utf-8"))
    del document["sha256"]
    assert document["answer"]["basis"] == "phones"
    assert "prior_scale" not in document["answer"]
    assert {one["basis"] for one in document["answer"]["choice"]} == {"phones"}  # its lamps were weighed
    assert first(compared(document, shots)) is None
    document["answer"]["prior_scale"] = 2.0
    found = first(compared(document, shots))
    assert found is not None
    assert (found.stage, found.words) == ("inputs", "answer.prior_scale is missing here")


def test_light_that_differs_from_patch_to_patch_is_told_again(shots: Path, tmp_path: Path) -> None:
    photo, document = str(shots / "chart.dng"), tmp_path / "result.json"
    given = ["--lamp", "D55", "--basis", "phones", "--light-per-patch", "8%"]
    assert cli.main(["calibrate", photo, *given, "-o", str(tmp_path)]) == 0
    assert cli.main(["parity", str(document), photo, "--light-per-patch", "8%"]) == 0
    assert cli.main(["parity", str(document), photo]) == cli.PARTED


def test_a_result_in_a_light_that_nobody_named(shots: Path, tmp_path: Path) -> None:
    """Nobody named it here, either: the same hypotheses, by the same weights."""
    frames = [f"--{role}={shots / role}.dng" for role in ("white", "dark")]
    assert cli.main(["calibrate", str(shots / "chart.dng"), *frames, "--basis", "phones", "-o", str(tmp_path)]) == 0
    document: Json = json.loads((tmp_path / "result.json").read_text("utf-8"))
    del document["sha256"]
    answer = document["answer"]
    lamps = {kind_of(lamp) for one in answer["choice"] for lamp in one["kinds"]}
    assert lamps == set(answer["lights"][0]["kinds"])
    assert first(compared(document, shots)) is None

    def falsified(falsify: Callable[[Json], object]) -> list[Finding]:
        other = copy.deepcopy(document)
        falsify(other)
        return [field for field in differences(other, document) if not field.agrees]

    evidence = answer["choice"][1]["log_evidence"] + 1.0
    (found,) = falsified(lambda d: d["answer"]["choice"][1].update(log_evidence=evidence))
    assert found.words.startswith("answer.choice[2] (phones under bulb).log_evidence")
    for key, change in (("kelvin", 1.0), ("kelvin_std", 1.0), ("power", 1e-6), ("std", 1e-6)):
        value = answer["lights"][0][key]
        new = [each + change for each in value] if isinstance(value, list) else value + change
        found, *_ = falsified(lambda d, key=key, new=new: d["answer"]["lights"][0].update({key: new}))
        assert (found.stage, found.words.startswith(f"answer.lights[1].{key}")) == ("band", True), found
    (found,) = falsified(lambda d: d["answer"].pop("lights"))
    assert found.words == "answer.lights[1] is missing there"


def test_another_lamp_there_is_another_power(result: Json, shots: Path) -> None:
    """Named D55, solved with D65."""
    found = first(compared(result, shots, lamps=["D65"]))
    assert found is not None
    assert (found.stage, found.words.partition(" ")[0]) == ("inputs", "capture.shots[1].lamp.source:")


def test_another_tolerance_there(result: Json, shots: Path) -> None:
    document = copy.deepcopy(result)
    shot(document)["lamp"]["source"] = shot(document)["lamp"]["source"].partition(", ±")[0]
    shot(document)["lamp"]["modes"] = []
    assert shot(document)["lamp"].pop("tolerance_kelvin") == 200
    found = first(compared(document, shots))
    assert found is not None
    assert found.stage == "curve"


def test_frames_are_asked_for(result: Json, shots: Path) -> None:
    for more, words in (({"white": []}, "used the white frame"), ({"dark": [None]}, "used the dark frame")):
        with pytest.raises(InvalidArgument, match=words):
            compared(result, shots, **more)
    with pytest.raises(InvalidArgument, match="2 photo"):
        parity(loaded(result), [shots / "chart.dng"] * 2)
    with pytest.raises(InvalidArgument, match="2 lamps"):
        compared(result, shots, lamps=["D55", "A"])
    with pytest.raises(InvalidArgument, match="cannot be read"):
        compared(result, shots, white=[shots / "none.dng"])
    alone = copy.deepcopy(result)
    shot(alone)["white"] = shot(alone)["means"]["white"] = None
    with pytest.raises(InvalidArgument, match="used no white frame"):
        compared(alone, shots)


def test_files_of_lamps_and_charts(shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A lamp by file: the document knows its hash, and the file is given again."""
    from camssf.spectra import read_lamp

    def write(name: str, power: np.ndarray) -> str:
        rows = zip(np.arange(380, 720.5, 0.5).tolist(), power.tolist(), strict=True)
        (tmp_path / name).write_text("".join(f"{nm},{value!r}\n" for nm, value in rows), "utf-8")
        return str(tmp_path / name)

    lamp, other = write("lamp.csv", read_lamp("A").values), write("other.csv", read_lamp("B").values)
    assert cli.main(["calibrate", str(shots / "chart.dng"), "--lamp", lamp]) in (0, 6)
    document = loaded(json.loads(capsys.readouterr().out))
    assert first(parity(document, shots / "chart.dng", lamps=[lamp])) is None
    found = first(parity(document, shots / "chart.dng", lamps=[other]))
    assert found is not None
    assert (found.stage, "capture.files.shot 1, lamp" in found.words) == ("inputs", True)


def test_a_refusal_agrees_with_a_refusal(shots: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The white frame for the dark one: refused here and there, by the same code."""
    frames = ["--white", str(shots / "dark.dng"), "--dark", str(shots / "white.dng")]
    assert cli.main(["calibrate", str(shots / "chart.dng"), "--lamp", "D55", *frames]) == 5
    document = json.loads(capsys.readouterr().out)
    del document["sha256"]
    more = {"white": [shots / "dark.dng"], "dark": [shots / "white.dng"]}
    findings = parity(loaded(document), shots / "chart.dng", **more)
    assert first(findings) is None
    document["verdict"]["reasons"][0]["code"] = "blurred"
    found = first(parity(loaded(document), shots / "chart.dng", **more))
    assert found is not None
    assert found.stage == "verdict"


def test_a_refusal_before_any_patch(shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No chart in the white frame: pose and patches are missing on both sides."""
    photo = str(shots / "white.dng")
    assert cli.main(["calibrate", photo, "--lamp", "D55"]) == 4
    document = json.loads(capsys.readouterr().out)
    findings = parity(loaded(document), photo)
    assert [finding.stage for finding in findings] == ["file", "photo", "verdict"]
    assert first(findings) is None
    assert read_dng(photo).sha256 == document["capture"]["unfinished"]["photo"]["sha256"]


def test_the_command(result: Json, shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "phone.json"
    path.write_text(json.dumps(result), "utf-8")
    arguments = ["parity", str(path), str(shots / "chart.dng")]
    frames = [f"--{role}={shots / role}.dng" for role in ("white", "dark")]
    assert cli.main([*arguments, *frames]) == 0
    out, err = capsys.readouterr()
    answer = json.loads(out)
    assert (answer["agrees"], answer["first"], len(answer["stages"])) == (True, None, len(STAGES))
    assert err.count("agrees") == len(STAGES)
    false = copy.deepcopy(result)
    scale(false["answer"]["curves"]["green"], 320, 1e-6)
    path.write_text(json.dumps(false), "utf-8")
    assert cli.main([*arguments, *frames]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out)["first"] == "curve"
    assert "first difference: curve. The inputs agree, the solution does not" in " ".join(err.split())
    assert cli.main(arguments) == 2
    assert "Give just that by --white" in capsys.readouterr().err
    path.write_text("{}", "utf-8")
    assert cli.main(arguments) == 2
