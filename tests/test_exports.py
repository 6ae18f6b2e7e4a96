"""Exports: each is read back by somebody else's program and gives the same numbers; a refused result gives none."""

import copy
import hashlib
import json
import os
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_report import document, refused

from camssf import cli
from camssf.cli.exports import FORMATS as TOLD
from camssf.documents.report import report
from camssf.errors import InvalidArgument
from camssf.exports import FORMATS, export, read_result
from camssf.grid import WAVELENGTHS, Floats

ROOT = Path(__file__).parents[1]
RAWTOACES = ROOT / "data" / "rawtoaces"
THEN = datetime(2026, 11, 22, 3, 4, 5, tzinfo=UTC)
GRID_5 = np.arange(380, 721, 5)


@pytest.fixture(autouse=True)
def _no_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)


def result(**changes: Any) -> dict[str, Any]:
    return copy.deepcopy(document("D55", "A")) | changes


def true_curves(result: dict[str, Any]) -> Floats:
    return np.array([result["ssf"][name] for name in ("red", "green", "blue")]).T


def strict(text: bytes) -> Any:
    def never(word: str) -> Any:
        raise AssertionError(word)

    return json.loads(text.decode(), parse_constant=never)


# -- what all have in common ------------------------------------------------------------------------------------


@pytest.mark.parametrize("to", FORMATS)
def test_verdict_and_hash_travel(to: str) -> None:
    given = result()
    found = export(given, to, created=THEN)
    sha256 = hashlib.sha256(report(given).result_json).hexdigest()
    assert sha256.encode() in found
    assert f"Verdict: {given['verdict']['status']}".encode() in found
    given["channel_gain"][0] += 0.001  # another result has another hash
    assert sha256.encode() not in export(given, to, created=THEN)


@pytest.mark.parametrize("to", FORMATS)
def test_a_doubtful_verdict_says_why(to: str) -> None:
    doubt = {"code": "glare", "message": "m", "advice": "a", "value": None, "threshold": None}
    given = result(verdict={"status": "doubtful", "reasons": [doubt, doubt | {"code": "blurred"}, doubt]})
    assert b"Verdict: doubtful (glare, blurred)." in export(given, to)


@pytest.mark.parametrize("to", FORMATS)
def test_a_refused_result_exports_nothing(to: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InvalidArgument, match="was refused"):
        export(refused(shots=True), to)
    given, out = tmp_path / "result.json", tmp_path / "file"
    given.write_bytes(report(refused()).result_json)
    assert cli.main(["export", str(given), "--to", to, "-o", str(out)]) == 2
    assert "was refused" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("to", FORMATS)
def test_the_same_result_gives_the_same_bytes(to: str) -> None:
    shuffled = dict(reversed(result().items()))
    assert export(result(), to, created=THEN) == export(shuffled, to, created=THEN)


@pytest.mark.parametrize("to", FORMATS)
def test_a_hostile_name_stays_in_its_line(to: str) -> None:
    plain = export(result(), to, created=THEN)
    given = result(camera={"make": 'M"\n1,2,3,4\u2028', "model": "X\x1b[2J\r\n\ud800"})
    found = export(given, to, created=THEN)
    assert found.count(b"\n") == plain.count(b"\n")
    assert b"\x1b" not in found


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        ({}, "lacks"),
        ({"format": "camssf-result/2"}, "must be"),
        ({"ssf": {}}, "lacks"),
        ({"channel_gain": [1.0, 1.0]}, "entries"),
        ({"channel_gain": [1.0, 1.0, float("nan")]}, "finite"),
    ],
)
def test_a_document_that_breaks_its_form_is_refused(broken: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidArgument, match=words):
        export(result() | broken if broken else {}, "csv")


def test_an_unknown_format_lists_the_known() -> None:
    with pytest.raises(InvalidArgument, match="rawtoaces"):
        export(result(), "pdf")


def test_the_command_line_names_the_formats() -> None:
    assert ", ".join(FORMATS) == TOLD


def test_the_command_line_writes_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given, out = tmp_path / "result.json", tmp_path / "curves.csv"
    given.write_bytes(report(result()).result_json)
    assert cli.main(["export", str(given), "--to", "csv", "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert "plain CSV" in said.err
    assert out.read_bytes() == export(result(), "csv")
    assert cli.main(["export", str(given), "--to", "csv"]) == 2
    assert cli.main(["export", str(given), "--to", "nothing", "-o", str(out)]) == 2
    assert out.read_bytes() == export(result(), "csv")


# -- rawtoaces --------------------------------------------------------------------------------------------------


def test_rawtoaces_meets_its_schema_and_holds_the_curves() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((RAWTOACES / "spectral_1.0.0.schema.json").read_text("utf-8"))
    given = result()
    found = strict(export(given, "rawtoaces", created=THEN, licence="CC-BY-4.0"))
    judge = jsonschema.Draft4Validator(schema)
    judge.validate(found)
    header = found["header"]
    assert header["license"] == "CC-BY-4.0"
    assert header["document_creation_date"] == "2026-11-22T03:04:05Z"
    assert (header["manufacturer"], header["model"]) == (given["camera"]["make"], given["camera"]["model"])
    table = found["spectral_data"]["data"]["main"]
    theirs = json.loads((RAWTOACES / "Nikon_D850_380_780_5.json").read_text("utf-8"))
    assert list(table) == list(theirs["spectral_data"]["data"]["main"])  # the 81 samples of a camera of theirs
    assert found["spectral_data"]["index"] == theirs["spectral_data"]["index"]
    assert np.array_equal([table[str(nm)] for nm in GRID_5], true_curves(given)[::10])
    assert not np.any([table[str(nm)] for nm in range(725, 781, 5)])
    del found["header"]["license"]  # the judge judges
    assert not judge.is_valid(found)


def test_a_camera_without_a_name_exports_to_rawtoaces() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads((RAWTOACES / "spectral_1.0.0.schema.json").read_text("utf-8"))
    found = strict(export(result(camera={"make": "", "model": ""}), "rawtoaces"))
    jsonschema.Draft4Validator(schema).validate(found)
    assert found["header"]["manufacturer"] is None
    assert "unnamed camera" in found["header"]["description"]


def test_the_time_is_utc_and_can_be_fixed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    found = strict(export(result(), "rawtoaces", created=THEN))
    assert found["header"]["document_creation_date"] == "2001-09-09T01:46:40Z"


def test_an_empty_licence_is_an_error() -> None:
    with pytest.raises(InvalidArgument, match="licence"):
        export(result(), "rawtoaces", licence=" \n")


# -- tables -----------------------------------------------------------------------------------------------------


def test_plain_csv_reads_back(tmp_path: Path) -> None:
    given, path = result(), tmp_path / "curves.csv"
    path.write_bytes(export(given, "csv"))
    found = np.genfromtxt(path, delimiter=",", skip_header=1, names=True)
    assert found.dtype.names == ("wavelength_nm", "red", "green", "blue", "red_std", "green_std", "blue_std")
    for name in ("red", "green", "blue"):
        assert np.array_equal(found[name], given["ssf"][name])
        assert np.array_equal(found[f"{name}_std"], given["ssf_std"][name])


def test_plain_csv_is_a_camera_to_camssf(tmp_path: Path) -> None:
    from camssf.spectra import read_camera

    path = tmp_path / "curves.csv"
    path.write_bytes(export(result(), "csv"))
    assert np.abs(read_camera(str(path)).values - true_curves(result())).max() < 1e-12


SPECTACLE = """
import sys, json, pathlib
import scipy.integrate
from spectacle import spectral
table, name = spectral.load_spectral_response(pathlib.Path(sys.argv[1]), return_filename=True)
print(json.dumps([table.tolist(), str(name)]))
"""


@pytest.mark.parametrize("judge", ["numpy", "pyspectacle"])
def test_spectacle_s_own_reader_takes_it(judge: str, tmp_path: Path) -> None:
    """SPECTACLE is GPL and needs an old SciPy: an environment of its own, named by CAMSSF_SPECTACLE, judges."""
    given = result()
    (tmp_path / "calibration").mkdir()
    path = tmp_path / "calibration" / "spectral_response.csv"
    path.write_bytes(export(given, "spectacle"))
    if judge == "numpy":
        table = np.loadtxt(path, delimiter=",").T
    else:
        python = os.environ.get("CAMSSF_SPECTACLE")
        if not python:
            pytest.skip("CAMSSF_SPECTACLE names no Python that has pyspectacle")
        done = subprocess.run(
            [python, "-W", "ignore", "-c", SPECTACLE, str(tmp_path)],
            capture_output=True, text=True, check=True, timeout=120, env=os.environ | {"HOME": str(tmp_path)},
        )  # fmt: skip
        numbers, name = json.loads(done.stdout.splitlines()[-1])
        assert name == str(path)
        table = np.array(numbers)
    assert np.array_equal(table[0], np.arange(380, 721))
    curves, std = true_curves(given)[::2].T, np.array(list(given["ssf_std"].values())[1:])[:, ::2]
    assert np.array_equal(table[1:5], curves[[0, 1, 2, 1]])
    assert np.array_equal(table[5:9], std[[0, 1, 2, 1]])


def test_spectacle_without_bands_says_nan(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(export(result(ssf_std=None), "spectacle"))
    assert np.isnan(np.loadtxt(path, delimiter=",")[:, 5:]).all()


def test_colour_science_reads_its_csv(tmp_path: Path) -> None:
    import colour
    from colour.characterisation import RGB_CameraSensitivities

    given, path = result(), tmp_path / "curves.csv"
    path.write_bytes(export(given, "colour"))
    read = colour.read_sds_from_csv_file(str(path))
    camera = RGB_CameraSensitivities(colour.MultiSpectralDistributions({name: read[name] for name in "RGB"}))
    assert np.array_equal(camera.wavelengths, WAVELENGTHS)
    assert [label.casefold()[0] for label in camera.labels] == ["r", "g", "b"]
    assert np.array_equal(camera.values, true_curves(given))


def test_a_result_read_twice_is_the_same() -> None:
    once = read_result(result())
    assert once.lamps == ("D55", "A")
    assert once.std is not None
    assert read_result(result(ssf_std=None)).std is None
