"""`camssf parity`: a result falsified at each stage is found at that stage."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from captures import photos

from camssf import cli
from camssf.compare.differences import TABLE, Finding, differences, row_of
from camssf.compare.parity import POSE, STAGES, cause, first, parity
from camssf.documents.result_json import compare
from camssf.errors import InvalidArgument
from camssf.photo.read.dng import read_dng
from camssf.spectra import read_camera, read_light

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
    return document


def compared(document: Json, shots: Path, **more: Any) -> Any:
    more = {"white": [shots / "white.dng"], "dark": [shots / "dark.dng"]} | more
    return parity(document, shots / "chart.dng", **more)


def test_a_result_agrees_with_itself(result: Json, shots: Path) -> None:
    """Tolerance and mode of the lamp come from the document; another pose of the same chart would not."""
    findings = compared(result, shots)
    assert tuple(finding.stage for finding in findings) == STAGES
    assert first(findings) is None, first(findings)
    by_stage = {finding.stage: finding for finding in findings}
    assert by_stage["patch means"].measured == by_stage["signals"].measured == 0
    assert by_stage["curve"].measured <= 1e-12
    assert 0 < by_stage["pose"].measured < POSE


def shot(document: Json) -> Json:
    found: Json = document["shots"][0]
    return found


def shift(document: Json, part: float) -> None:
    """The whole pose, by a part of the pitch."""
    pose = shot(document)["pose"]
    quads = np.array(pose["patches"])
    pitch = np.linalg.norm(quads[1].mean(axis=0) - quads[0].mean(axis=0))
    pose["patches"] = (quads + part * pitch).tolist()
    pose["corners"] = (np.array(pose["corners"]) + part * pitch).tolist()


def patch(document: Json, number: int) -> Json:
    found: Json = shot(document)["patches"][number - 1]
    return found


def scale(values: list[float], at: int, by: float) -> None:
    values[at] *= 1 + by


REASON = {"code": "glare", "message": "m", "advice": "a", "value": None, "threshold": None}
FALSE: list[tuple[str, str, Callable[[Json], object]]] = [
    ("file", "photo", lambda d: shot(d)["photo"].update(sha256="0" * 64)),
    ("photo", "saturation: 15000", lambda d: shot(d).update(saturation=15000.0)),
    ("pose", "patch", lambda d: shift(d, 0.05)),
    ("pose", "90° there", lambda d: shot(d)["pose"].update(quarter_turns=1)),
    ("patch means", "patch", lambda d: shift(d, 0.005)),
    ("patch means", "clipped", lambda d: patch(d, 2).update(clipped=[0.0, 0.25, 0.0])),
    ("signals", "signal, shot 1, patch 19", lambda d: scale(patch(d, 19)["signal"], 0, 1e-9)),
    ("inputs", "chart.table: Ohta", lambda d: d["chart"].update(table="Ohta")),
    ("inputs", "patch 5", lambda d: patch(d, 5).update(used=False)),
    ("curve", "green at 540 nm", lambda d: scale(d["ssf"]["green"], 320, 1e-6)),
    ("band", "blue at 450 nm", lambda d: scale(d["ssf_std"]["blue"], 140, 1e-3)),
    ("band", "missing", lambda d: d.update(ssf_std=None)),
    ("band", "log_evidence of cameras", lambda d: d["choice"][1].update(log_evidence=1.0)),
    ("band", "unseen_std, shot 1, patch 9", lambda d: patch(d, 9).update(unseen_std=None)),
    ("band", "lamp, share, blue", lambda d: scale(d["uncertainty"]["budget"][3]["share"], 2, 1e-3)),
    ("gap", "there", lambda d: d.update(gap=[1e-15, 1e-3, 1e-15])),
    ("scores", "rmsre", lambda d: scale(d["scores"]["rmsre_percent"], 1, 1e-3)),
    ("scores", "unseen, shot 1, patch 12", lambda d: scale(patch(d, 12)["unseen"], 0, 1e-4)),
    ("verdict", "glare", lambda d: d["verdict"]["reasons"].append(REASON)),
    ("verdict", "refused", lambda d: d["verdict"].update(status="refused")),
    ("verdict", "verdict.checks[3] (hopeless).value", lambda d: d["verdict"]["checks"][2].update(value=1.0)),
    ("inputs", "shots[1].lamp.power at 383.5 nm: ", lambda d: scale(shot(d)["lamp"]["power"], 7, 1e-6)),
    ("inputs", "SHA-256 of shot 1, white", lambda d: d["hashes"]["inputs"].pop("shot 1, white: white.dng")),
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
    shot(whole)["patches"] = shot(whole)["patches"][:2]
    document = copy.deepcopy(whole)
    found = list(paths(document))
    assert len(found) > 100
    for path, holder, key in found:
        if path in ("/generator", "/generator/version", "/engine"):  # the schema asks for them
            continue
        value = holder.pop(key)
        for one, other, side in ((document, whole, "there"), (whole, document, "here")):
            fields = [field for field in differences(one, other) if not field.agrees]
            assert [(field.stage, field.measured) for field in fields] == [(row_of(path)[0], np.inf)], path
            assert fields[0].words.endswith(f"is missing {side}"), path
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
    document = copy.deepcopy(result)
    compare(document, read_camera(str(shots / "truth.csv")))
    assert first(compared(document, shots)) is None
    scale(document["scores"]["rmse"], 1, 1e-3)
    found = first(compared(document, shots))
    assert found is not None
    assert (found.stage, found.words.partition(":")[0]) == ("scores", "scores.rmse, green")


def test_bounds_are_those_of_last_bits(result: Json, shots: Path) -> None:
    document = copy.deepcopy(result)
    scale(patch(document, 7)["chart"], 1, 1e-13)
    scale(document["ssf"]["green"], 320, 1e-10)
    assert first(compared(document, shots)) is None


def older(result: Json) -> Json:
    """Of another release, which may lack what this one writes."""
    return copy.deepcopy(result) | {"generator": {"name": "camssf", "version": "0.0.9"}}


def test_a_result_of_before_the_proof(result: Json, shots: Path) -> None:
    """Without the covariance, the evidence and the layers' proof: what there is agrees."""
    document = older(result)
    for key in ("code_covariance", "evidence", "layers_gap", "finish_steps"):
        del document[key]
    assert first(compared(document, shots)) is None


def test_a_result_of_before_the_budget(result: Json, shots: Path) -> None:
    """A phone's of an older release: no shares, no predicted_std, no unseen_std, no checks."""
    document = older(result)
    del document["verdict"]["checks"]
    document["uncertainty"]["budget"] = []
    for number in range(1, 25):
        for key in ("predicted_std", "unseen_std"):
            del patch(document, number)[key]
    assert first(compared(document, shots)) is None


def test_a_result_on_a_told_basis(shots: Path, tmp_path: Path) -> None:
    """Solved here on the basis that it names, not by a choice; one of before the choice says no more than that."""
    frames = [f"--{role}={shots / role}.dng" for role in ("white", "dark")]
    arguments = ["calibrate", str(shots / "chart.dng"), "--lamp", "D55", *frames, "--basis", "phones"]
    assert cli.main([*arguments, "-o", str(tmp_path)]) == 0
    document: Json = json.loads((tmp_path / "result.json").read_text("utf-8"))
    assert (document["basis"], document["prior_scale"], document["choice"]) == ("phones", 1.0, [])
    assert first(compared(document, shots)) is None
    document = older(document)
    for key in ("prior_scale", "choice"):
        del document[key]
    assert first(compared(document, shots)) is None
    found = first(compared(document | {"prior_scale": 2.0}, shots))
    assert found is not None
    assert (found.stage, found.words) == ("inputs", "width of the prior: 2 there, 1 here")


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
    assert {tuple(each["kinds"]) for each in document["choice"]} == {
        (kind,) for kind in shot(document)["light"]["kinds"]
    }
    assert first(compared(document, shots)) is None

    def falsified(falsify: Callable[[Json], object]) -> list[Finding]:
        other = copy.deepcopy(document)
        falsify(other)
        return [field for field in differences(other, document) if not field.agrees]

    (found,) = falsified(lambda d: d["choice"][1].update(log_evidence=d["choice"][1]["log_evidence"] + 1.0))
    assert found.words.startswith("log_evidence of phones under bulb")
    for key, change in (("kelvin", 1.0), ("kelvin_std", 1.0), ("power", 1e-6), ("std", 1e-6)):
        value = shot(document)["light"][key]
        new = [each + change for each in value] if isinstance(value, list) else value + change
        found, *_ = falsified(lambda d, key=key, new=new: shot(d)["light"].update({key: new}))
        assert (found.stage, found.words.startswith(f"{key} of the light of shot 1")) == ("band", True), found
    (found,) = falsified(lambda d: shot(d).pop("light"))
    assert found.words == "shots[1].light is missing there"


def test_another_lamp_there_is_another_power(result: Json, shots: Path) -> None:
    """Named D55, solved with D65; where the result does not hold the power, only the curve can tell."""
    found = first(compared(result, shots, lamps=["D65"]))
    assert found is not None
    assert (found.stage, found.words.partition(":")[0]) == ("inputs", "shots[1].lamp.source")
    document = older(result)
    lamp = shot(document)["lamp"]
    del lamp["power"], lamp["tolerance_kelvin"]
    lamp["source"] = read_light("D65").source
    found = first(compared(document, shots, lamps=["D65"]))
    assert found is not None
    assert found.stage == "curve"


def test_another_tolerance_there(result: Json, shots: Path) -> None:
    document = copy.deepcopy(result)
    shot(document)["lamp"]["source"] = shot(document)["lamp"]["source"].partition(", ±")[0]
    assert shot(document)["lamp"].pop("tolerance_kelvin") == 200
    found = first(compared(document, shots))
    assert found is not None
    assert found.stage == "curve"


def test_frames_are_asked_for(result: Json, shots: Path) -> None:
    for more, words in (({"white": []}, "used the white frame"), ({"dark": [None]}, "used the dark frame")):
        with pytest.raises(InvalidArgument, match=words):
            compared(result, shots, **more)
    with pytest.raises(InvalidArgument, match="2 photo"):
        parity(result, [shots / "chart.dng"] * 2)
    with pytest.raises(InvalidArgument, match="2 lamps"):
        compared(result, shots, lamps=["D55", "A"])
    with pytest.raises(InvalidArgument, match="cannot be read"):
        compared(result, shots, white=[shots / "none.dng"])
    alone = copy.deepcopy(result)
    shot(alone)["white"] = None
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
    document = json.loads(capsys.readouterr().out)
    assert first(parity(document, shots / "chart.dng", lamps=[lamp])) is None
    found = first(parity(document, shots / "chart.dng", lamps=[other]))
    assert found is not None
    assert (found.stage, "SHA-256 of shot 1, lamp:" in found.words) == ("inputs", True)


def test_a_refusal_agrees_with_a_refusal(shots: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The white frame for the dark one: refused here and there, by the same code."""
    frames = ["--white", str(shots / "dark.dng"), "--dark", str(shots / "white.dng")]
    assert cli.main(["calibrate", str(shots / "chart.dng"), "--lamp", "D55", *frames]) == 5
    document = json.loads(capsys.readouterr().out)
    more = {"white": [shots / "dark.dng"], "dark": [shots / "white.dng"]}
    findings = parity(document, shots / "chart.dng", **more)
    assert first(findings) is None
    document["verdict"]["reasons"][0]["code"] = "blurred"
    found = first(parity(document, shots / "chart.dng", **more))
    assert found is not None
    assert found.stage == "verdict"


def test_a_refusal_before_any_patch(shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No chart in the white frame: pose and patches are missing on both sides."""
    photo = str(shots / "white.dng")
    assert cli.main(["calibrate", photo, "--lamp", "D55"]) == 4
    document = json.loads(capsys.readouterr().out)
    findings = parity(document, photo)
    assert [finding.stage for finding in findings] == ["file", "photo", "verdict"]
    assert first(findings) is None
    assert read_dng(photo).sha256 == document["shots"][0]["photo"]["sha256"]


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
    scale(false["ssf"]["green"], 320, 1e-6)
    path.write_text(json.dumps(false), "utf-8")
    assert cli.main([*arguments, *frames]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out)["first"] == "curve"
    assert "first difference: curve. The inputs agree, the solution does not" in " ".join(err.split())
    assert cli.main(arguments) == 2
    assert "Give just that by --white" in capsys.readouterr().err
    path.write_text("{}", "utf-8")
    assert cli.main(arguments) == 2
