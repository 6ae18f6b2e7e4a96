"""Regions of a photo, and the commands `colour`, `spectrum` and `picture`: what they state, refuse and draw."""

import hashlib
import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from PIL import Image

from camssf import cli
from camssf.colorimetry import xyz_of
from camssf.documents.document import document_bytes
from camssf.documents.forms import from_plain, to_plain
from camssf.documents.schema import schema
from camssf.errors import InvalidArgument
from camssf.result import Result
from camssf.spectra import read_chart
from camssf.spectra.bundled import observer
from camssf_colour import View
from camssf_colour.document import ColourDocument
from camssf_colour.picture_document import PictureDocument
from camssf_colour.regions import against, measure_regions
from camssf_colour.spectrum_document import SpectrumDocument
from camssf_colour.standard import of_surfaces
from tests.colour.conftest import place, power
from tests.support.captures import calibrated, photos
from tests.support.scenes import mosaic

CHART = read_chart("classic24").values
Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Result]:
    path = tmp_path_factory.mktemp("spectrum") / "result.json"
    path.write_bytes(document_bytes(calibrated()))
    return str(path), calibrated()


@cache
def photo() -> str:
    return str(photos().shots[0].chart)


def read_document(printed: str, form: type = ColourDocument) -> Any:
    """The JSON of a command, once its schema and its reader agree."""
    found = json.loads(printed)
    jsonschema.Draft202012Validator(schema(form)).validate(found)
    assert to_plain(from_plain(found, form, "it", "")) == found
    return found


@pytest.mark.requirement("R-COLOUR")
@pytest.mark.full
@pytest.mark.parametrize("told", ["A", "bulb", "auto"])
def test_the_command_states_true_colours(told: str, of_two_lamps: tuple[Path, Result], capsys: Capture) -> None:
    folder, document = of_two_lamps
    patches = (0, 4, 12, 14, 15)
    words = [word for patch in patches for word in ("--region", place(document, patch))]
    white = xyz_of(CHART[18], power("A"), observer("1931"))[1]
    words += ["--lamp", told, "--white-region", f"{place(document, 18)},{white:.4f}", "--adapt", "D65"]
    assert cli.main(["colour", str(folder / "result.json"), str(photos("A").shots[0].chart), *words]) == 0
    printed = capsys.readouterr()
    found = read_document(printed.out)
    assert found["result"]["sha256"] == hashlib.sha256((folder / "result.json").read_bytes()).hexdigest()
    assert found["white"]["of"] == "D65"
    truth = of_surfaces(CHART[list(patches)], power("A"), View(white="D65"))[1]
    off = np.array([region["lab"] for region in found["regions"]]) - truth
    assert np.linalg.norm(off, axis=1).mean() < 3.5
    chi = [o @ np.linalg.solve(region["lab_covariance"], o) for o, region in zip(off, found["regions"], strict=True)]
    assert max(chi) < 16.3
    assert printed.err.count("region ") == len(patches)


def test_a_colour_out_of_reach_is_in_the_document_without_numbers(
    result: tuple[str, Result], capsys: Capture
) -> None:
    path, document = result
    words = ["--region", place(document, 18), "--region", place(document, 22)]
    words += ["--white-region", f"{place(document, 22)},0.9"]
    assert cli.main(["colour", path, photo(), *words]) == 9
    printed = capsys.readouterr()
    assert "Colour 1" in printed.err
    found = read_document(printed.out)
    assert [region["status"] for region in found["regions"]] == ["colour_out_of_reach", "ok"]
    assert "lab" not in found["regions"][0]


def test_a_signal_is_against_its_reference_and_has_the_error_of_both() -> None:
    samples = np.where(np.arange(100) < 50, 1512.0, 2512.0) + 3 * np.random.default_rng(1).normal(size=(80, 100))
    left, right = measure_regions(mosaic(np.rint(samples).astype(np.uint16)), [(10, 10, 30, 40), (60, 10, 30, 40)])
    y, error = against([left], right, 0.9)
    assert np.abs(y - 0.45).max() < 1e-3
    assert np.abs(error / (0.9 * np.hypot(left.error / 2000, 0.5 * right.error / 2000)) - 1).max() < 0.01
    with pytest.raises(InvalidArgument, match="dark"):
        against([left], replace(right, raw=np.ones(3), error=np.ones(3)), 0.9)


def test_the_command_states_true_spectra(result: tuple[str, Result], capsys: Capture, tmp_path: Path) -> None:
    path, document = result
    patches = (0, 1, 12, 14)
    words = [word for patch in patches for word in ("--region", place(document, patch))]
    grey = read_chart("classic24").values[20][100:641].mean()  # the flattest of the greys
    words += ["--white-region", f"{place(document, 20)},{grey:.4f}"]
    words += ["--index", "erythema", "-o", str(tmp_path / "s.csv"), "-o", str(tmp_path / "s.svg")]
    truth = read_chart("classic24").values[list(patches)][:, ::20]
    for lights in (["--lamp", "D55"], [str(photos("A").shots[0].chart), "--lamp", "D55", "--lamp", "A"]):
        assert cli.main(["spectrum", path, photo(), *lights, *words]) == 0
        printed = capsys.readouterr()
        found = read_document(printed.out, SpectrumDocument)
        assert found["prior"]["name"] == "general"
        assert [len(each["signal"]) for each in found["regions"]] == [lights.count("--lamp")] * len(patches)
        assert printed.err.count("prior general") == len(patches)
        got, std = (np.array([each[k] for each in found["regions"]]) for k in ("reflectance", "standard_deviation"))
        assert (np.abs(got - truth) < 1.96 * std)[:, 5:33].mean() > 0.8  # below 430 nm the white patch is not white
        assert np.sqrt(np.mean((got - truth)[:, 2:33] ** 2)) < 0.06
        rows = np.genfromtxt(tmp_path / "s.csv", delimiter=",", skip_header=1)
        assert np.abs(rows[:, 1 : 1 + len(patches)].T - got).max() < 1e-6
        assert (tmp_path / "s.svg").read_bytes().startswith(b"<svg")


def test_the_command_says_when_the_prior_does_not_hold(result: tuple[str, Result], capsys: Capture) -> None:
    path, document = result
    words = ["--region", place(document, 12), "--white-region", place(document, 18), "--prior", "skin"]
    assert cli.main(["spectrum", path, photo(), *words]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["regions"][0]["status"] == "outside_prior"
    assert "outside the prior" in printed.err


@pytest.mark.parametrize(
    ("command", "more", "status", "words"),
    [
        ("colour", "", 2, "needs a region"),
        ("colour", "--region 1,2,3 WHITE", 2, "not a rectangle"),
        ("colour", "--region 1,2,x,4 WHITE", 2, "not a rectangle"),
        ("colour", "HERE WHITE --adapt D55", 2, "D55"),
        ("colour", "HERE WHITE --lamp A", 6, "not white under A"),
        ("colour", "HERE WHITE --lamp nonsense", 2, "No lamp"),
        ("colour", "HERE WHITE,90", 2, "reflectance"),
        ("colour", "HERE WHITE,18%", 2, "0.18"),
        ("spectrum", "", 2, "needs a region"),
        ("spectrum", "HERE", 2, "needs a region"),
        ("spectrum", "HERE WHITE --lamp A --lamp D55", 2, "one --lamp a photo"),
        ("spectrum", "PHOTO HERE WHITE --lamp A", 2, "one --lamp a photo"),
        ("spectrum", "PHOTO HERE WHITE", 2, "one --lamp a photo"),
        ("spectrum", "PHOTO PHOTO HERE WHITE", 2, "Give one photo, or two"),
        ("spectrum", "HERE WHITE --index fur", 2, "No index"),
        ("picture", "-o OUT", 2, "--white-region"),
        ("picture", "-o OUT --lamp daylight HERE", 2, "--compare"),
        ("picture", "-o OUT --lamp auto --dark nothing.dng", 3, "nothing.dng"),
    ],
)
def test_the_commands_say_no(
    command: str, more: str, status: int, words: str, result: tuple[str, Result], capsys: Capture, tmp_path: Path
) -> None:
    path, document = result
    areas = {"HERE": f"--region {place(document, 3)}", "WHITE": f"--white-region {place(document, 18)}"}
    for name, value in (areas | {"PHOTO": photo(), "OUT": str(tmp_path / "out.png")}).items():
        more = more.replace(name, value)
    assert cli.main([command, path, photo(), *more.split()]) == status
    printed = capsys.readouterr()
    assert words in printed.err
    assert printed.out == ""
    assert not list(tmp_path.iterdir())


@pytest.mark.full
def test_the_command_writes_the_picture_of_a_simulated_photo(
    of_two_lamps: tuple[Path, Result], tmp_path: Path, capsys: Capture
) -> None:
    """Of another light than the calibration's, and refuses the photo of another camera."""
    folder, result = of_two_lamps
    (under_a,) = photos("A").shots
    white = ["--white-region", f"{place(result, 18)},0.9"]
    command = ["picture", str(folder / "result.json"), str(under_a.chart), "-o", str(tmp_path / "a.png")]
    command += ["--lamp", "bulb", *white]
    assert cli.main(command) == 0
    said = read_document(capsys.readouterr().out, PictureDocument)
    assert json.loads(Image.open(tmp_path / "a.png").text["Description"]) == said
    assert said["white"]["source"] == "reference"
    assert cli.main([*command, "--dark", str(under_a.dark)]) == 0
    printed = capsys.readouterr()
    subtracted = json.loads(printed.out)
    assert subtracted["dark"]["name"] == "dark.dng"
    assert max(subtracted["white"]["dark_share"]) < 0.01  # a lens cap
    assert "subtracted: 0%" in printed.err
    x, y, width, height = map(int, place(result, 14).split(","))
    seen = np.asarray(Image.open(tmp_path / "a.png"))[y : y + height, x : x + width].reshape(-1, 3).mean(axis=0)
    assert seen[0] > 2 * max(seen[1:])  # the red one

    canon = {"camera": "Canon EOS 5D Mark II"}
    chart = photos(**canon).shots[0].chart
    assert cli.main([*command[:2], str(chart), "-o", str(tmp_path / "b.png"), "--lamp", "D55"]) == 5
    assert re.search("Canon.*each has its own curves", capsys.readouterr().err, re.DOTALL)
    (tmp_path / "other.json").write_bytes(document_bytes(calibrated(**canon)))
    pair = ["picture", str(folder / "result.json"), str(photos().shots[0].chart), "--lamp", "D55", *white]
    pair += ["-o", str(tmp_path / "scene.html"), "--compare", str(tmp_path / "other.json"), str(chart)]
    assert cli.main(pair) == 2
    assert "--region" in capsys.readouterr().err
    assert cli.main([*pair, "--region", place(result, 1)]) == 0
    page = (tmp_path / "scene.html").read_text("utf-8")
    assert page.count("data:image/jpeg") == 4
    (row,) = re.findall(r'<tr><th scope="row">1</th><td>([\d.]+)</td><td>([\d.]+)</td>', page)
    assert float(row[1]) < 2.0
