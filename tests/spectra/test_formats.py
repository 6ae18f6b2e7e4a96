"""Other people's files of lamps and cameras, judged by other people's readers and files."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import camssf
from camssf.errors import InvalidArgument, LampUnfit
from camssf.exports import export, exported
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import colour_science, lamp_names, read_camera, read_lamp, shipped_cameras
from camssf.spectra.lamps import NAMES_FORMAT, lamp_aliases
from camssf.spectra.readers import CURVES, LAMPS
from camssf.spectra.tables import read_curves, read_spectrum
from camssf.spectra.text import plain
from tests.exports.conftest import pyspectacle
from tests.spectra.test_spectra import write
from tests.support.documents import document

ROOT = Path(__file__).parents[2]
THEIRS = Path(colour_science().__file__).parent / "io" / "tests" / "resources"
"""colour-science installs its tests' files: a UPRtek's, a Sekonic's and a TM-27 file as instruments wrote them."""
NM = np.arange(380, 731, 5)
POWER = 1.0 + np.sin(NM / 40.0)


def theirs(name: str) -> Path:
    path = THEIRS / name
    if not path.is_file():
        pytest.skip(f"this colour-science was installed without {name}")
    return path


@pytest.mark.parametrize(
    ("name", "reader"),
    [
        ("ESPD2021_0104_231446.xls", "SpectralDistribution_UPRTek"),
        ("uprtek.xls.txt", "SpectralDistribution_UPRTek"),
        ("RANDOM_001_02._3262K.csv", "SpectralDistribution_Sekonic"),
    ],
)
def test_meters_files_are_read_as_colour_science_reads_them(name: str, reader: str) -> None:
    path = theirs(name)
    judge = getattr(colour_science(), reader)(str(path)).read()
    assert len(judge.wavelengths) == 401
    lamp = read_lamp(str(path))
    expected = np.interp(WAVELENGTHS, judge.wavelengths, judge.values)
    np.testing.assert_allclose(lamp.values, expected / expected.mean(), rtol=1e-12, atol=1e-15)
    assert lamp.source == f"file {name}"
    assert lamp.tolerance == 0.01


def test_an_uneven_tm27_file_is_read_to_its_digits() -> None:
    path = theirs("Fluorescent.spdx")
    judge = colour_science().SpectralDistribution_IESTM2714(str(path)).read()
    wavelengths, values = read_spectrum(path)
    assert np.array_equal(wavelengths, judge.wavelengths)
    assert np.array_equal(values, judge.values)
    with pytest.raises(LampUnfit, match=r"a gap of 34\.2 nm: nothing from 714\.2 to 748\.4 nm"):  # lines alone
        read_lamp(str(path))


def test_a_gap_is_named_where_it_is(tmp_path: Path) -> None:
    def without(*left_out: int) -> str:
        return re.sub(rf'<SpectralData wavelength="({"|".join(map(str, left_out))})">[^<]*</SpectralData>', "", SPDX)

    with pytest.raises(LampUnfit, match="a gap of 25 nm: nothing from 515 to 540 nm") as caught:
        read_lamp(write(tmp_path / "x.spdx", without(520, 525, 530, 535)))
    assert (caught.value.value, caught.value.threshold) == (25.0, 20.0)
    read_lamp(write(tmp_path / "x.spdx", without(520, 525, 530)))  # 20 nm will do
    beyond = '<SpectralData wavelength="790">1</SpectralData></SpectralDistribution>'
    beyond = SPDX.replace("</SpectralDistribution>", beyond)
    read_lamp(write(tmp_path / "x.spdx", beyond))  # of no matter beyond 720 nm


def argyll(curves: Floats | None = None) -> tuple[str, Floats, Floats]:
    """As spotread writes it: fields are named by whole nanometres, 106 bands lie 3.33 nm apart. Curves: a .cmf."""
    nm = np.linspace(380.0, 730.0, 106)
    rows = np.atleast_2d(2.0 + np.cos(nm / 30.0) if curves is None else curves)
    fields = " ".join(f"SPEC_{round(each)}" for each in nm)
    numbers = "\n".join(" ".join(f"{each:.9f}" for each in row) for row in rows)
    text = (
        f'{"SPECT" if curves is None else "CMF  "}\n\nORIGINATOR "Argyll CMS"\nSPECTRAL_BANDS "106"\n'
        f'SPECTRAL_START_NM "380.000000"\nSPECTRAL_END_NM "730.000000"\nSPECTRAL_NORM "1.000000"\n'
        f"NUMBER_OF_FIELDS 106\nBEGIN_DATA_FORMAT\n{fields}\nEND_DATA_FORMAT\n\nNUMBER_OF_SETS {len(rows)}\n"
        f"BEGIN_DATA\n{numbers}\nEND_DATA\n"
    )
    return text, nm, rows


def test_argyll_s_bands_lie_where_its_header_says(tmp_path: Path) -> None:
    text, nm, power = argyll()
    wavelengths, values = read_spectrum(Path(write(tmp_path / "lamp.sp", text)))
    assert np.abs(wavelengths - nm).max() < 1e-12
    assert np.abs(values - power).max() < 1e-9


SPDX = (
    '<?xml version="1.0" encoding="utf-8"?>\n<IESTM2714 xmlns="iestm2714" version="1.0"><Header/>'
    "<SpectralDistribution><SpectralQuantity>relative</SpectralQuantity>"
    + "".join(f'<SpectralData wavelength="{nm}">{value}</SpectralData>' for nm, value in zip(NM, POWER, strict=True))
    + "</SpectralDistribution></IESTM2714>\n"
)


LAYERS = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 30))
BOMB = f'<!DOCTYPE x [<!ENTITY e0 "a">{LAYERS}]><IESTM2714>&e29;'
"""Entities that would grow without end."""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("</IESTM2714>", "", "not a TM-27"),
        ("<Header/>", "<!DOCTYPE a><Header/>", "not a TM-27"),
        ('<IESTM2714 xmlns="iestm2714" version="1.0">', BOMB, "not a TM-27"),
        ("<IESTM2714", '<!DOCTYPE x [<!ENTITY e "a">]><IESTM2714', "not a TM-27"),
        ("IESTM2714", "IESXX2714", "not a TM-27"),
        ("relative", "reflectance", "not light"),
        (f">{POWER[3]}<", ">x<", "not a number"),
        ('wavelength="400"', 'nm="400"', "not a number"),
        ('wavelength="400"', 'wavelength="395"', "do not increase"),
    ],
)
def test_a_broken_tm27_file_is_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert old in SPDX
    with pytest.raises(InvalidArgument, match=words):
        read_lamp(write(tmp_path / "x.spdx", SPDX.replace(old, new)))


D850 = ROOT / "data" / "rawtoaces" / "Nikon_D850_380_780_5.json"


def test_rawtoaces_own_camera_is_read(tmp_path: Path) -> None:
    """Against rawtoaces-data's table of the same camera, made from such files; columns go by name."""
    camera, found = read_camera(str(D850)), json.loads(D850.read_text("utf-8"))
    table = found["spectral_data"]
    ours = camera.values[::10]
    assert camera.name == "Nikon D850"
    np.testing.assert_allclose(ours, [table["data"]["main"][str(nm)] for nm in range(380, 721, 5)], atol=1e-12)
    np.testing.assert_allclose(ours / ours.max(axis=0), shipped_cameras()["Nikon D850"], atol=1e-12)
    table["index"]["main"] = ["B", "g", "R"]
    table["data"]["main"] = {nm: row[::-1] for nm, row in reversed(table["data"]["main"].items())}
    found["header"] = {}
    turned = read_camera(write(tmp_path / "mine.json", json.dumps(found)))
    assert turned.name == "mine"
    assert np.array_equal(turned.values, camera.values)


@pytest.mark.parametrize("to", ["rawtoaces", "spectacle", "csv", "colour", "dcamprof"])
def test_our_own_exports_are_cameras(to: str, tmp_path: Path) -> None:
    given = document("D55")
    path = tmp_path / "export"
    path.write_bytes(export(given, to))
    expected = exported(given).own
    camera = read_camera(str(path))
    step = {"rawtoaces": 10, "dcamprof": 10, "spectacle": 2}.get(to, 1)
    np.testing.assert_allclose(camera.values[::step], expected[::step], atol=1e-12)


def bells(nm: Any) -> Floats:
    """(w, 3) a camera's curves."""
    return np.stack([np.exp(-(((nm - at) / 45.0) ** 2)) for at in (600, 530, 460)], axis=1)


@pytest.mark.parametrize("mark", [",", ";", "\t", "  "])
def test_a_camera_of_four_columns_needs_no_header(mark: str, tmp_path: Path) -> None:
    nm = np.arange(400, 701, 10)
    curves = bells(nm)
    rows = [mark.join(map(repr, [int(w), *row])) for w, row in zip(nm, curves.tolist(), strict=True)]
    name, wavelengths, found = read_curves(Path(write(tmp_path / "mine.csv", "\n".join(["# measured", *rows]))), None)
    assert name == "mine"
    assert np.array_equal(wavelengths, nm)
    assert np.array_equal(found, curves)
    for line, words in (("710,1,2", "line 32: .* is not four numbers"), ("710,1,2,x", "line 3[23]: 'x'")):
        with pytest.raises(InvalidArgument, match=words):
            read_camera(write(tmp_path / "x.csv", "\n".join([*rows, line.replace(",", mark)])))


def test_argyll_s_cmf_is_a_camera(tmp_path: Path) -> None:
    nm = np.linspace(380.0, 730.0, 106)
    text, _, curves = argyll(bells(nm).T)
    name, wavelengths, found = read_curves(Path(write(tmp_path / "mine.cmf", text)), None)
    assert name == "mine"
    assert np.abs(wavelengths - nm).max() < 1e-12
    assert np.abs(found - curves.T).max() < 1e-9
    with pytest.raises(InvalidArgument, match="1 spectra"):
        read_camera(write(tmp_path / "one.cmf", argyll(curves[:1])[0]))


DCAMPROF = """// a camera's own file, as DCamProf's example lays it out
{
  // camera name, see http://example.org/names
  "camera_name": "Maker \\"One\\" // 7",
  /* bands in nanometres */
  "ssf_bands": [ 400, 720, 10 ], // 400 nm to 720 nm
  "red_ssf": [%s],
  "green_ssf": [%s],
  "blue_ssf": [%s]
}
"""
DCAMPROF_NM = np.arange(400, 721, 10)
DCAMPROF_CURVES = bells(DCAMPROF_NM)
DCAMPROF_TEXT = DCAMPROF % tuple(", ".join(map(repr, curve.tolist())) for curve in DCAMPROF_CURVES.T)


@pytest.mark.parametrize("listed", [False, True])
def test_dcamprof_s_camera_is_read(listed: bool, tmp_path: Path) -> None:
    """With its comments; bands as [first, last, step] or every wavelength. The channels keep their scale."""
    text = DCAMPROF_TEXT
    if listed:
        text = text.replace("[ 400, 720, 10 ]", str(DCAMPROF_NM.tolist()))
    name, nm, curves = read_curves(Path(write(tmp_path / "camera.json", text)), None)
    assert name == 'Maker "One" // 7'
    assert np.array_equal(nm, DCAMPROF_NM)
    assert np.array_equal(curves, DCAMPROF_CURVES)


@pytest.mark.parametrize("judge", ["numpy", "pyspectacle"])
def test_spectacle_is_read_as_its_own_reader_does(judge: str, tmp_path: Path) -> None:
    """A file with two greens, as a camera's own script of SPECTACLE saves it: np.savetxt with its header."""
    nm, path = np.arange(390.0, 701.0), tmp_path / "spectral_response.csv"
    columns = [np.exp(-(((nm - centre) / 40.0) ** 2)) for centre in (600, 530, 460, 534)]
    values = np.column_stack([nm, *columns, *(0.01 * column for column in columns)])
    np.savetxt(path, values, delimiter=",", header="wavelength,R,G,B,G2,R_err,G_err,B_err,G2_err")
    table = np.loadtxt(path, delimiter=",").T
    if judge == "pyspectacle":
        table = np.array(pyspectacle(tmp_path, path.read_bytes())[0])
    name, nm, curves = read_curves(path, None)
    assert name == "spectral_response"
    assert np.array_equal(nm, table[0])
    assert np.array_equal(curves, np.column_stack([table[1], 0.5 * (table[2] + table[4]), table[3]]))


CAMSPEC_NM = np.arange(400, 721, 10)


def camspec_curves(i: int) -> Floats:
    """(33, 3) of the i-th camera."""
    return np.stack([np.exp(-(((CAMSPEC_NM - 600 + 70 * c - i) / 50) ** 2)) for c in range(3)], axis=1).round(6)


def camspec(*names: str) -> str:
    """A name, and a line for each channel between tabs."""
    lines = []
    for i, name in enumerate(names):
        lines += [name, *("\t".join(f"{value:.6f}" for value in curve) for curve in camspec_curves(i).T)]
    return "\r\n".join(lines) + "\r\n"


def test_the_list_of_camspec_is_read(tmp_path: Path) -> None:
    names = ("Canon 1D Mark III", "Nikon D40", "Point Grey Grasshopper 50S5C")
    path = write(tmp_path / "camspec_database.txt", camspec(*names))
    for i, name in enumerate(names):
        camera = read_camera(f"{path}:{name.upper()}")
        assert camera.name == name
        np.testing.assert_allclose(camera.values[np.isin(WAVELENGTHS, CAMSPEC_NM)], camspec_curves(i), atol=1e-12)
        assert not camera.values[WAVELENGTHS < 400].any()
    with pytest.raises(InvalidArgument, match="has 3 cameras"):
        read_camera(path)
    with pytest.raises(InvalidArgument) as caught:
        read_camera(f"{path}:Nikon D400")
    assert "Did you mean Nikon D40?" in caught.value.advice


def changed(change: Callable[[Any], object]) -> str:
    """rawtoaces' camera, changed."""
    camera = json.loads(D850.read_text("utf-8"))
    change(camera)
    return json.dumps(camera)


def at_400_nm(values: list[Any]) -> str:
    return changed(lambda camera: camera["spectral_data"]["data"]["main"].update({"400": values}))


LIST = camspec("Canon 1D", "Nikon D40")
BROKEN: dict[str, tuple[str, str, str | None]] = {
    "no spectral data": ("x.json", changed(lambda camera: camera.pop("spectral_data")), None),
    "no index": ("x.json", changed(lambda camera: camera["spectral_data"].pop("index")), None),
    "two columns": ("x.json", changed(lambda camera: camera["spectral_data"]["index"].update(main=["R", "G"])), None),
    "two values": ("x.json", at_400_nm([1, 2]), None),
    "a truth value": ("x.json", at_400_nm([1, True, 3]), None),
    "not a number": ("x.json", at_400_nm([1, float("nan"), 3]), None),
    "no wavelength": ("x.json", D850.read_text("utf-8").replace('"400"', '"x"'), None),
    **{f"JSON {text[:9]}": ("x.json", text, "rawtoaces")
       for text in ("{", "{}", '{"a":' * 5000, '{"header":{},"header":{}}', '{"a": NaN}')},
    **{f"DCamProf, {new}": ("x.json", DCAMPROF_TEXT.replace(old, new), "DCamProf") for old, new in (
        ("400, 720, 10", "400, 720, 7"), ("400, 720, 10", "720, 400, 10"), ("400, 720, 10", "400, 1e308, 1e-300"),
        ("400, 720, 10", "400, 720"), ('"red_ssf": [', '"red_ssf": [1.0, '), ('"red_ssf": [', '"green_ssf": ['),
        ('"blue_ssf"', '"blau_ssf"'), ("/* bands in nanometres */", "/* bands in nanometres"), ("}", ""),
    )},
    # the whole list, even where another camera of it is wanted: lines that slip would mix cameras
    "list, cut off": ("x.txt:Canon 1D", LIST[: 3 * len(LIST) // 4], None),
    "list, a name missing": ("x.txt:Canon 1D", LIST.replace("Nikon D40\r\n", ""), None),
    "list, a name twice": ("x.txt:Canon 1D", LIST.replace("Nikon D40", "Canon 1D"), None),
}  # fmt: skip
"""What is read, the file's text, and a part of the message."""


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_of_a_camera_is_refused(name: str, tmp_path: Path) -> None:
    spec, text, words = BROKEN[name]
    assert text not in (D850.read_text("utf-8"), DCAMPROF_TEXT, LIST)
    write(tmp_path / spec.partition(":")[0], text)
    with pytest.raises(InvalidArgument, match=words):
        read_camera(f"{tmp_path}/{spec}")


def test_objects_of_colour_science_are_cameras() -> None:
    from colour.characterisation import RGB_CameraSensitivities

    science = colour_science()
    known = science.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"]
    camera = read_camera(known)
    assert np.array_equal(camera.values, read_camera("Nikon 5100 (NPL)").values)
    assert camera.name == known.name
    values, nm = np.asarray(known.values), np.asarray(known.wavelengths)
    other = RGB_CameraSensitivities(values, nm, labels=["R", "G", "B"], name="mine")
    turned = science.MultiSpectralDistributions(values[:, [2, 0, 1]], nm, labels=["B", "R", "G"], name="mine")
    for each in (other, turned):
        assert np.array_equal(read_camera(each).values, camera.values)
        assert read_camera(each).name == "mine"
    assert read_camera(camera) is camera
    for wrong in (5, ("a", "b"), (nm, values.T)):
        with pytest.raises(InvalidArgument, match="is not a camera"):
            read_camera(wrong)  # type: ignore[arg-type]


def test_the_names_are_data_and_each_says_one_thing() -> None:
    place = Path(camssf.__file__).parent / "data" / "lamp-names.json"
    assert json.loads(place.read_text("utf-8"))["format"] == NAMES_FORMAT
    names = [plain(name) for alias in lamp_aliases() for name in alias.names]
    assert len(names) == len(set(names)) > 80
    assert not set(names) & {plain(name) for name in lamp_names()}  # a name that is known already means itself
    for alias in lamp_aliases():
        assert bool(alias.lamp) != bool(alias.advice)
        assert alias.what


@pytest.mark.parametrize("each", lamp_aliases(), ids=lambda each: each.names[0])
def test_what_people_type_is_answered(each: Any) -> None:
    for name in each.names:
        for written in (name, name.upper(), name.replace(" ", "-"), f" {name} "):
            if each.lamp:
                lamp, meant = read_lamp(written), read_lamp(each.lamp)
                assert np.array_equal(lamp.values, meant.values)
                assert (lamp.name, lamp.tolerance) == (each.lamp, meant.tolerance)
                assert np.array_equal(lamp.modes, meant.modes)
                assert repr(written.strip()) in lamp.source
            else:
                with pytest.raises(InvalidArgument, match="does not say which lamp") as caught:
                    read_lamp(written)
                assert caught.value.advice == each.advice


@pytest.mark.repository
def test_the_page_of_tables_lists_formats() -> None:
    page = (ROOT / "docs" / "tables.md").read_text("utf-8")
    for each in (*LAMPS, *CURVES):
        assert f"| {each.what} |" in page
