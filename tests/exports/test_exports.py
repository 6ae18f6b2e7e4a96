"""Exports: each is read back by somebody else's program and gives the same numbers; a refused result gives none."""

import hashlib
import io
import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from camssf import cli
from camssf.cli.others import FORMATS as TOLD
from camssf.colorimetry import BRADFORD, adaptation, signals_of, xyz_of
from camssf.documents.document import Document, answer_in, document_bytes
from camssf.errors import InvalidArgument
from camssf.exports import FORMATS, export, exported
from camssf.exports.matrices import ACES, ACES_WHITE, D50, matrices
from camssf.grid import CHANNELS, WAVELENGTHS, Floats
from camssf.result import Result
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf.spectra.bundled import observer
from camssf.verdict.reasons import Reason, Verdict
from camssf_colour import lab, white_of
from tests.exports.conftest import pyspectacle, run
from tests.support.documents import changed, document, refused

ROOT = Path(__file__).parents[2]
RAWTOACES = ROOT / "data" / "rawtoaces"
THEN = datetime(2026, 11, 22, 3, 4, 5, tzinfo=UTC)
CURVE_FORMATS = ("rawtoaces", "spectacle", "csv", "colour", "dcamprof")
GRID_5 = np.arange(380, 721, 5)


@pytest.fixture(autouse=True)
def _no_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)


def result(**changes: Any) -> Result:
    return changed(document("D55", "A"), **changes)


def renamed(make: str, model: str) -> Result:
    """A result whose photos name another camera."""
    return result(capture__shots__all__photo__make=make, capture__shots__all__photo__model=model)


def gain(first: float) -> Result:
    """A result of another white of red."""
    return result(answer__channel_gain=np.array([first, 1.0, 0.6408]))


def own_curves(made: Document) -> Floats:
    """On the camera's own scale, written out: each channel gives the first shot's white its raw signal."""
    lamp, answer = made.capture.shots[0].lamp, answer_in(made)
    own = answer.curves.values * answer.channel_gain / (lamp.values @ answer.curves.values)
    return np.asarray(own / own.max())


def strict(text: bytes) -> Any:
    return json.loads(text.decode(), parse_constant=pytest.fail)


def said(content: bytes, words: str) -> bool:
    """In whatever coding the format has."""
    return any(words.encode(coding) in content for coding in ("utf-8", "utf-16-be"))


@pytest.mark.parametrize("to", FORMATS)
def test_verdict_and_hash_travel(to: str) -> None:
    given = result()
    found = export(given, to, created=THEN)
    sha256 = hashlib.sha256(document_bytes(given)).hexdigest()
    assert said(found, sha256)
    assert said(found, f"Verdict: {given.verdict.status}")
    assert not said(export(gain(0.832), to, created=THEN), sha256)  # another result has another hash
    doubts = tuple(Reason(code, "m", "a") for code in ("glare", "blurred", "glare"))
    given = result(verdict=Verdict("doubtful", doubts))
    assert said(export(given, to), "Verdict: doubtful (glare, blurred).")
    with pytest.raises(InvalidArgument, match="was refused"):
        export(refused(shots=True), to)


@pytest.mark.parametrize("to", [name for name in FORMATS if name not in ("icc", "dcp")])
def test_a_hostile_name_stays_in_its_line(to: str) -> None:
    given = renamed(make='M"\n1,2,3,4\u2028', model="X\x1b[2J\r\n\ud800")
    content = export(given, to, created=THEN)
    assert content.count(b"\n") == export(result(), to, created=THEN).count(b"\n")
    assert b"\x1b" not in content


def test_the_command_line_writes_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ", ".join(FORMATS) == TOLD
    given, out = tmp_path / "result.json", tmp_path / "curves.csv"
    given.write_bytes(document_bytes(result()))
    assert cli.main(["export", str(given), "--to", "csv", "-o", str(out)]) == 0
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "plain CSV" in printed.err
    assert out.read_bytes() == export(result(), "csv")


@pytest.mark.parametrize("lamp", ["D55", "A"])
def test_exported_curves_give_the_camera_s_own_white_balance(lamp: str) -> None:
    """Σ L s dλ under the lamp of the calibration is the raw white that was measured, channel against channel.

    tests/spectra/test_formats.py reads these curves from the file of every format.
    """
    made = document(lamp)
    own = own_curves(made)
    white = read_lamp(lamp).values @ own
    assert white / white[1] == pytest.approx(answer_in(made).channel_gain, rel=1e-12)
    assert sorted(own.max(axis=0))[0] < 0.95
    np.testing.assert_allclose(exported(made).own, own, rtol=1e-12)


def test_a_white_patch_is_no_perfect_white() -> None:
    """Where the chart's own patch was white, its reflectance is taken out: it is 2 % in blue."""
    framed = exported(document("D55")).own_scale
    (shot,) = document("D55").capture.shots
    shot = replace(shot, white=None, means=replace(shot.means, white=None))
    given = changed(document("D55"), capture__shots__0=shot)
    patched = exported(given).own_scale
    chart = read_chart("classic24")
    wanted = answer_in(given).channel_gain / ((chart.values[chart.white] * read_lamp("D55").values) @ given.curves)
    assert patched == pytest.approx(wanted / wanted.max(), rel=1e-12)
    assert abs(patched[2] / patched[1] / (framed[2] / framed[1]) - 1) > 0.01


@pytest.mark.parametrize("to", [*CURVE_FORMATS, "dcp"])
def test_without_a_scale_nothing_is_exported_that_needs_one(to: str) -> None:
    given = gain(-0.1)
    with pytest.raises(InvalidArgument, match=r"scale between the channels.*D55"):
        export(given, to)
    assert export(given, "icc", created=THEN)  # its white is balanced


def judge_of_rawtoaces() -> Any:
    return jsonschema.Draft4Validator(json.loads((RAWTOACES / "spectral_1.0.0.schema.json").read_text("utf-8")))


def test_rawtoaces_meets_its_schema_and_holds_the_curves() -> None:
    given, judge = result(), judge_of_rawtoaces()
    found = strict(export(given, "rawtoaces", created=THEN, licence="CC-BY-4.0"))
    judge.validate(found)
    named = ("license", "document_creation_date", "manufacturer", "model")
    stated = ["CC-BY-4.0", "2026-11-22T03:04:05Z", "NIKON CORPORATION", "NIKON D850"]
    assert [found["header"][name] for name in named] == stated
    table = found["spectral_data"]["data"]["main"]
    theirs = json.loads((RAWTOACES / "Nikon_D850_380_780_5.json").read_text("utf-8"))
    assert list(table) == list(theirs["spectral_data"]["data"]["main"])  # the 81 samples of a camera of theirs
    assert found["spectral_data"]["index"] == theirs["spectral_data"]["index"]
    np.testing.assert_allclose([table[str(nm)] for nm in GRID_5], own_curves(given)[::10], rtol=1e-13)
    assert not np.any([table[str(nm)] for nm in range(725, 781, 5)])
    del found["header"]["license"]  # the judge judges
    assert not judge.is_valid(found)


def test_a_camera_without_a_name_exports_to_rawtoaces() -> None:
    found = strict(export(renamed(make="", model=""), "rawtoaces"))
    judge_of_rawtoaces().validate(found)
    assert found["header"]["manufacturer"] is None
    assert "unnamed camera" in found["header"]["description"]


def test_the_time_is_utc_and_can_be_fixed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    found = strict(export(result(), "rawtoaces", created=THEN))
    assert found["header"]["document_creation_date"] == "2001-09-09T01:46:40Z"


def test_plain_csv_reads_back_and_is_a_camera_to_camssf(tmp_path: Path) -> None:
    given, path = result(), tmp_path / "curves.csv"
    path.write_bytes(export(given, "csv"))
    found = np.genfromtxt(path, delimiter=",", skip_header=1, names=True)
    assert found.dtype.names == ("wavelength_nm", "red", "green", "blue", "red_std", "green_std", "blue_std")
    own = own_curves(given)
    for c, name in enumerate(CHANNELS):
        np.testing.assert_allclose(found[name], own[:, c], rtol=1e-13)
        np.testing.assert_allclose(found[f"{name}_std"], own[:, c].max() * given.std[:, c], rtol=1e-12)
    assert np.abs(read_camera(str(path)).values - own).max() < 1e-12


def test_spectacle_s_own_reader_takes_it(tmp_path: Path) -> None:
    given = result()
    numbers, name = pyspectacle(tmp_path, export(given, "spectacle"))
    assert name == str(tmp_path / "calibration" / "spectral_response.csv")
    table = np.array(numbers)
    assert np.array_equal(table[0], np.arange(380, 721))
    own = own_curves(given)
    std = given.std[::2].T * own.max(axis=0)[:, None]
    np.testing.assert_allclose(table[1:5], own[::2].T[[0, 1, 2, 1]], rtol=1e-13)
    np.testing.assert_allclose(table[5:9], std[[0, 1, 2, 1]], rtol=1e-12)


def test_colour_science_reads_its_csv(tmp_path: Path) -> None:
    import colour
    from colour.characterisation import RGB_CameraSensitivities

    given, path = result(), tmp_path / "curves.csv"
    path.write_bytes(export(given, "colour"))
    read = colour.read_sds_from_csv_file(str(path))
    camera = RGB_CameraSensitivities(colour.MultiSpectralDistributions({name: read[name] for name in "RGB"}))
    assert np.array_equal(camera.wavelengths, WAVELENGTHS)
    assert [label.casefold()[0] for label in camera.labels] == ["r", "g", "b"]
    np.testing.assert_allclose(camera.values, own_curves(given), rtol=1e-13)


def balanced(made: Result, lamp: str) -> tuple[Floats, Floats, Floats]:
    """White-balanced camera RGB (24, 3) of the chart under a lamp, its XYZ, and the lamp's white."""
    power = read_lamp(lamp).values
    chart = read_chart("classic24").values
    y = signals_of(chart, power, made.curves)
    return y, xyz_of(chart, power, observer("1931")), white_of(power)


@pytest.mark.parametrize("lamp", ["D65", "A", "LED-B3"])
def test_the_matrices_are_good_and_keep_white(lamp: str) -> None:
    curves = exported(result())
    found = matrices(curves, lamp)
    y, xyz, white = balanced(result(), lamp)
    assert np.abs(found.to_d50 @ np.ones(3) - D50).max() < 1e-12
    assert np.abs(found.to_aces @ np.ones(3) - 1).max() < 1e-12
    assert np.abs(found.to_xyz @ np.ones(3) - white).max() < 1e-12
    assert np.linalg.norm(lab(y @ found.to_xyz.T, white) - lab(xyz, white), axis=1).mean() < 4
    turned = xyz @ adaptation(white, D50, BRADFORD).T
    assert np.linalg.norm(lab(y @ found.to_d50.T, D50) - lab(turned, D50), axis=1).mean() < 4


def test_aces_and_bradford_are_colour_science_s() -> None:
    import colour

    space = colour.RGB_COLOURSPACES["ACES2065-1"]
    assert np.abs(space.matrix_XYZ_to_RGB - ACES).max() < 1e-9
    assert np.abs(colour.xy_to_XYZ(space.whitepoint) - ACES_WHITE).max() < 1e-12
    assert np.array_equal(colour.CHROMATIC_ADAPTATION_TRANSFORMS["Bradford"], BRADFORD)


@pytest.mark.parametrize("lamp", ["D65", "A", "LED-B3"])
def test_littlecms_reads_the_profile(lamp: str) -> None:
    """Its `chad` takes the lamp's white to D50 by Bradford's transform; undone, the colours are the lamp's."""
    from PIL import Image, ImageCms

    profile = ImageCms.getOpenProfile(io.BytesIO(export(result(), "icc", created=THEN, lamp=lamp)))
    inside, wanted = profile.profile, matrices(exported(result()), lamp)
    colorants = np.array([inside.red_colorant[0], inside.green_colorant[0], inside.blue_colorant[0]]).T
    assert np.abs(colorants - wanted.to_d50).max() < 2.5 / 65536  # two roundings stand in green's
    assert np.array_equal(np.rint(colorants.sum(axis=1) * 65536), np.rint(D50 * 65536))
    assert (inside.version, inside.device_class, inside.xcolor_space.strip()) == (4.3, "scnr", "RGB")
    assert inside.creation_date == THEN.replace(tzinfo=None)
    assert inside.is_matrix_shaper
    assert exported(result()).sha256 in inside.profile_description
    transform = ImageCms.buildTransform(profile, ImageCms.createProfile("LAB"), "RGB", "LAB", ImageCms.Intent(1))
    swatch = Image.new("RGB", (4, 4), (255, 255, 255))
    assert ImageCms.applyTransform(swatch, transform).getpixel((0, 0)) == (255, 128, 128)  # L* 100, a* = b* = 0
    chad, white = np.array(inside.chromatic_adaptation[0]), white_of(read_lamp(lamp).values)
    assert np.abs(chad @ white - D50).max() < 1e-4
    assert np.abs(chad - adaptation(white, D50, BRADFORD)).max() < 1 / 65536
    assert np.abs(np.linalg.solve(chad, colorants) - wanted.to_xyz).max() < 2e-4


@pytest.mark.full
@pytest.mark.parametrize("lamp", ["D65", "A"])
def test_opencolorio_applies_the_clf(lamp: str, tmp_path: Path) -> None:
    ocio, path = pytest.importorskip("PyOpenColorIO"), tmp_path / "camera.clf"
    path.write_bytes(export(result(), "clf", lamp=lamp))
    processor = ocio.Config.CreateRaw().getProcessor(ocio.FileTransform(str(path)))
    group = processor.createGroupTransform()
    metadata, node = group.getFormatMetadata(), group[0].getFormatMetadata()
    stated = [child.getElementValue() for child in metadata.getChildElements()]
    assert exported(result()).description in stated
    assert any(f"under {lamp}" in words and words.endswith("to ACES2065-1.") for words in stated)
    assert "ACES2065-1" in metadata.getName()
    assert (node.getID(), node.getName()) == ("camera-to-aces", "camera RGB to ACES2065-1")
    y = balanced(result(), lamp)[0]
    got = np.array([processor.getDefaultCPUProcessor().applyRGB(row.tolist()) for row in y])
    assert np.abs(got - y @ matrices(exported(result()), lamp).to_aces.T).max() < 3e-7  # it works in float32


def test_exiftool_reads_the_dcp(tmp_path: Path) -> None:
    given, path = result(), tmp_path / "camera.dcp"
    path.write_bytes(export(given, "dcp"))
    assert "Warning" not in json.loads(run("exiftool", "-j", "-n", "-validate", "-warning", "-a", path))[0]
    (found,) = json.loads(run("exiftool", "-j", "-n", path))
    curves = exported(given)
    assert found["FileType"] == "DCP"
    assert found["UniqueCameraModel"] == curves.camera
    assert found["ProfileToneCurve"] == "0 0 1 1"
    assert found["DefaultBlackRender"] == 1  # none
    assert found["ProfileCopyright"] == curves.description
    assert (found["CalibrationIlluminant1"], found["CalibrationIlluminant2"]) == (17, 21)
    for which, lamp in ((1, "A"), (2, "D65")):
        forward, colour = (
            np.array([float(word) for word in found[f"{name}Matrix{which}"].split()]).reshape(3, 3)
            for name in ("Forward", "Color")
        )
        assert np.abs(forward - matrices(curves, lamp).to_d50).max() < 1e-7
        assert np.abs(forward.sum(axis=1) - D50).max() < 1e-6
        # a colour matrix takes XYZ to the raw RGB of the very camera: its white is what the curves see of the lamp
        power, first = read_lamp(lamp).values, read_lamp("D55").values
        raw = answer_in(given).channel_gain * (power @ given.curves) / (first @ given.curves)
        white = colour @ white_of(power)
        assert np.abs(white - raw / raw.max()).max() < 1e-6
        y, xyz, _ = balanced(given, lamp)
        back = np.linalg.solve(colour, (y * raw / raw.max()).T).T
        assert np.linalg.norm(lab(back, white_of(power)) - lab(xyz, white_of(power)), axis=1).mean() < 4


@pytest.mark.parametrize("unique", ["SM-S911B-samsung-samsung", "Nikon  D850", ""])
def test_a_dcp_names_the_camera_as_its_dng_does(unique: str, tmp_path: Path) -> None:
    """Raw converters compare UniqueCameraModel letter by letter; where the file has none, make and model must do."""
    path = tmp_path / "camera.dcp"
    path.write_bytes(export(result(capture__shots__0__photo__unique_model=unique), "dcp"))
    assert run("exiftool", "-b", "-UniqueCameraModel", path) == (unique or "NIKON CORPORATION NIKON D850")
