"""Judged by colour-science's own tables, by CIE values and formulas, and by writers that camssf does not use."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.errors import CalibrationError, ChartUnfit, InvalidArgument
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.spectra import (
    camera_names,
    colour_science,
    lamp_names,
    read_camera,
    read_chart,
    read_lamp,
    shipped_cameras,
)
from camssf.spectra.bundled import bundled
from camssf.spectra.cameras import DEMO_PHONES
from camssf.spectra.families import FAMILIES, DrawnKind, LampKind
from tests.support.text_tables import PLAIN
from tests.support.text_tables import table as text_table
from tools import demo_phones

TEN = np.arange(380, 731, 10)


def at(values: Floats, nm: float) -> Floats:
    return values[int(np.flatnonzero(nm == WAVELENGTHS)[0])]


def write(path: Path, text: str) -> str:
    path.write_bytes(text.encode())
    return str(path)


def test_every_name_reads() -> None:
    for name in lamp_names():
        lamp = read_lamp(name)
        assert lamp.values.shape == (681,)
        assert lamp.modes.shape == (0, 681) or name in FAMILIES
        assert lamp.values.min() >= 0
        assert lamp.values.mean() == pytest.approx(1)
        assert not lamp.values.flags.writeable
        family = FAMILIES.get(name)
        usual = 0 if name == "equal-energy" else 0.02
        drawn = bundled()["families"][name]["tolerance"] if isinstance(family, DrawnKind) else usual
        assert lamp.tolerance == (family.left if isinstance(family, LampKind) else drawn)


@pytest.mark.parametrize("kelvin", [1000, 2856, 6500.5, 20000])
def test_kelvin_is_planck(kelvin: float) -> None:
    for spec in (f"{kelvin}K", f"{kelvin} k"):
        values = read_lamp(spec).values
        for nm in (380.0, 450.0, 720.0):
            ratio = (560 / nm) ** 5 * np.expm1(1.4388e7 / (kelvin * 560)) / np.expm1(1.4388e7 / (kelvin * nm))
            assert at(values, nm) / at(values, 560) == pytest.approx(ratio, rel=1e-12)


@pytest.mark.parametrize(
    ("one", "other"),
    [("f2", "FL2"), ("F3.1", "FL3.1"), ("d 65", "D65"), ("led_b3", "LED-B3"), ("CIE A", "A"), (" hp1 ", "HP1")],
)
def test_spelling_does_not_matter(one: str, other: str) -> None:
    np.testing.assert_array_equal(read_lamp(one).values, read_lamp(other).values)
    assert read_lamp(one).source == read_lamp(other).source


@pytest.mark.parametrize("nothing", ["", "  ", None])
def test_a_missing_lamp_is_explained(nothing: str) -> None:
    with pytest.raises(InvalidArgument, match="lamp is missing") as caught:
        read_lamp(nothing)
    for word in ("One photo", r"Eq. (5)", "0.10", "D55", "LED-B1", "2856K", "D:5500", "equal-energy", ".spd"):
        assert word in caught.value.advice


WRONG: dict[Callable[[Any], Any], dict[str | None, str]] = {
    read_lamp: {
        "D56": "Did you mean D:5600?", "LED-B33": "Did you mean LED-B3", "daylihgt": "Lamps:", "500K": "1000K",
        "5500": "D:5500 for daylight", "2700": "2700K for a bulb", "99999K": "20000K", "D:3000": "3000K, without D",
        "nowhere.csv": "Check the path",
        "no/such/lamp.spd": "Check the path", "a\0b": "Lamps:", "x" * 5000: "Lamps:", ".": "Lamps:",
    },
    read_chart: {
        "clasic24": "Did you mean classic24", "": "Charts:", None: "Charts:", "classic24:olta": "Check the path",
        "sg140": "sg140:mine.txt", "sg140:none.txt": "Check the path", r"C:\charts\mine.csv": "Check the path",
        "x" * 5000: "Charts:",
    },
    read_camera: {
        "Nikon D510": "Did you mean Nikon D5100", "": "camssf cameras", None: "camssf cameras",
        r"C:\cameras.csv": "Check the path", r"C:\cameras.csv:Canon EOS 5D": "Check the path",
        "x.csv:" + "y" * 5000: "Check the path",
    },
}  # fmt: skip
"""Names that no reader knows, and a part of the advice."""


@pytest.mark.parametrize(
    ("read", "spec", "advice"), [(read, *row) for read, rows in WRONG.items() for row in rows.items()]
)
def test_a_wrong_name_gets_advice(read: Callable[[Any], Any], spec: str | None, advice: str) -> None:
    with pytest.raises(InvalidArgument) as caught:
        read(spec)
    assert advice in caught.value.advice


def test_a_short_lamp_is_held_constant_and_says_so(tmp_path: Path) -> None:
    lamp = read_lamp(write(tmp_path / "short.csv", "".join(f"{nm},{nm}\n" for nm in range(400, 701, 10))))
    assert at(lamp.values, 380) == at(lamp.values, 400)
    assert at(lamp.values, 720) == at(lamp.values, 700)
    assert at(lamp.values, 700) / at(lamp.values, 400) == pytest.approx(7 / 4)
    assert lamp.source == "file short.csv, held constant outside 400 to 700 nm"


def test_a_narrow_line_between_grid_points_keeps_its_power(tmp_path: Path) -> None:
    """A line of 0.04 nm at 546.1 nm lies between 546.0 and 546.5: sampling the grid would lose it."""
    nm = np.round(np.concatenate([np.arange(380, 545, 1), np.arange(545, 547, 0.01), np.arange(547, 721, 1)]), 2)
    line = np.exp(-0.5 * ((nm - 546.1) / 0.02) ** 2) * 1000 + 1
    lamp = read_lamp(write(tmp_path / "line.csv", "".join(f"{a},{b}\n" for a, b in zip(nm, line, strict=True))))
    base = at(lamp.values, 600)
    power = (lamp.values / base - 1).sum() * STEP
    assert power == pytest.approx(1000 * 0.02 * np.sqrt(2 * np.pi), rel=1e-6)
    assert np.flatnonzero(lamp.values > 2 * base).tolist() == [int(np.flatnonzero(WAVELENGTHS == 546)[0])]


def test_noise_below_zero_is_forgiven(tmp_path: Path) -> None:
    assert at(read_lamp(write(tmp_path / "n.csv", text_table(["-1", *PLAIN[1:]]))).values, 380) == 0


@pytest.mark.parametrize(
    ("spec", "table"), [("classic24", "BabelColor Average"), ("nano24:OHTA", "ColorChecker N Ohta")]
)
def test_public_tables_are_colour_science_s(spec: str, table: str) -> None:
    colour = colour_science()
    chart = read_chart(spec)
    assert (chart.table, chart.layout.name, chart.white) == (table, spec[:-5] if ":" in spec else spec, 18)
    assert chart.patches == tuple(colour.SDS_COLOURCHECKERS[table])
    assert chart.patches[18] == "white 9.5 (.05 D)"
    assert chart.values.shape == (24, 681)
    assert not chart.values.flags.writeable
    np.testing.assert_array_equal(chart.tolerance, 0.03)
    np.testing.assert_array_equal(chart.with_tolerance(0.01).tolerance, np.full(24, 0.01))
    for wrong in (-0.01, 1.0, float("nan")):
        with pytest.raises(InvalidArgument, match=r"0 to 0\.5 is possible"):
            chart.with_tolerance(wrong)
    shape = colour.SpectralShape(380, 720, STEP)
    for name, values in zip(chart.patches, chart.values, strict=True):
        table_sd = colour.SDS_COLOURCHECKERS[table][name]
        np.testing.assert_allclose(
            [at(values, nm) for nm in range(380, 721, 10)], table_sd[list(range(380, 721, 10))]
        )
        expected = table_sd.copy().interpolate(shape, interpolator=colour.SpragueInterpolator).values
        np.testing.assert_allclose(values, expected, atol=1e-12)


def babel() -> tuple[list[str], Floats]:
    """Names and (24, 36) reflectances of the BabelColor table as it is stored."""
    table = colour_science().SDS_COLOURCHECKERS["BabelColor Average"]
    return list(table), np.array([sd.values for sd in table.values()])


def columns(names: list[str], rows: Floats, nm: Floats = TEN) -> str:
    """A CSV with the wavelengths as its first line."""
    lines = [["name", *map(str, nm)], *([n, *map(repr, row)] for n, row in zip(names, rows.tolist(), strict=True))]
    return "\n".join(map(",".join, lines))


def test_a_file_can_name_its_layout(tmp_path: Path) -> None:
    path = write(tmp_path / "mine.csv", columns(*babel()))
    named, known = read_chart(path), read_chart("classic24")
    np.testing.assert_allclose(named.values, known.values, atol=1e-12)
    assert (named.layout.name, named.white, named.table) == ("classic24", 18, "mine.csv")
    assert (named.patches, named.source) == (known.patches, "file mine.csv")
    np.testing.assert_array_equal(named.tolerance, 0.01)
    assert read_chart(f"nano24:{path}").layout.name == "nano24"
    with pytest.raises(InvalidArgument, match="holds 24 patches, sg140 has 140"):
        read_chart(f"sg140:{path}")


def cxf(path: Path, names: list[str], rows: Floats, keep_range: bool = True) -> str:
    """A CxF3 file by colour-cxf's own writer."""
    from colour_cxf import cxf3, write_cxf

    items = [
        cxf3.Object(
            object_type="Standard",
            name=name,
            id=str(i),
            color_values=cxf3.ColorValues(
                choice=[cxf3.ReflectanceSpectrum(value=row, start_wl=380, color_specification="S")]
            ),
        )
        for i, (name, row) in enumerate(zip(names, rows.tolist(), strict=True))
    ]
    span = cxf3.WavelengthRange(start_wl=380, increment=10) if keep_range else None
    specification = cxf3.ColorSpecification(id="S", measurement_spec=cxf3.MeasurementSpec(wavelength_range=span))
    document = cxf3.CxF(
        resources=cxf3.Resources(
            object_collection=cxf3.ObjectCollection(object_value=items),
            color_specification_collection=cxf3.ColorSpecificationCollection(color_specification=[specification]),
        )
    )
    path.write_bytes(write_cxf(document))
    return str(path)


def test_cxf(tmp_path: Path) -> None:
    names, rows = babel()
    table = read_chart(cxf(tmp_path / "chart.cxf", names, rows))
    np.testing.assert_allclose(table.values, read_chart("classic24").values, atol=1e-12)
    assert table.patches == tuple(names)
    with pytest.raises(InvalidArgument, match="one set of wavelengths"):
        read_chart(cxf(tmp_path / "other.cxf", names, rows, keep_range=False))


@pytest.mark.parametrize(
    "names",
    [[f"{'ABCD'[i // 6]}{i % 6 + 1}" for i in range(24)], [f"{'ABCDEF'[i % 6]}{i // 6 + 1}" for i in range(24)]],
    ids=["letters are rows", "letters are columns"],
)
def test_positions_order_24_patches(names: list[str], tmp_path: Path) -> None:
    rows, shuffled = babel()[1], np.random.default_rng(0).permutation(24)
    text = columns([names[i] for i in shuffled], rows[shuffled])
    table = read_chart(write(tmp_path / "c.csv", text))
    np.testing.assert_allclose(table.values, read_chart("classic24").values, atol=1e-12)
    assert table.patches == tuple(names)


def changed(value: float) -> str:
    names, rows = babel()
    rows[2, 5] = value
    return columns(names, rows)


def in_order(order: Any) -> str:
    names, rows = babel()
    return columns([names[i] for i in order], rows[order])


NUMBERS = np.arange(24).reshape(4, 6)


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [
        (in_order(NUMBERS.ravel()[::-1]), ChartUnfit, r"run upside down\."),
        (in_order(NUMBERS.T.ravel()), ChartUnfit, r"run by columns\."),
        (in_order(NUMBERS[::-1].T.ravel()), ChartUnfit, r"run by columns from below\."),
        (changed(np.nan), ChartUnfit, "not a number"),
        (changed(-0.2), ChartUnfit, "reflectance of -0.2"),
        (changed(1.4), ChartUnfit, "reflectance of 1.4"),
        (columns([*map(str, range(24))], np.tile(TEN / 800, (24, 1))), ChartUnfit, "no neutral patch"),
        (columns(["0"], np.full((1, 36), 0.5)), InvalidArgument, "holds 1 patches"),
        (columns([*map(str, range(25))], np.full((25, 36), 0.5)), InvalidArgument, "holds 25 patches"),
    ],
)
def test_a_table_that_is_not_of_the_chart_is_refused(
    text: str, kind: type[CalibrationError], words: str, tmp_path: Path
) -> None:
    with pytest.raises(kind, match=words):
        read_chart(write(tmp_path / "c.csv", text))


def test_named_cameras_are_colour_science_s_and_the_shipped_ones() -> None:
    tables = colour_science().MSDS_CAMERA_SENSITIVITIES
    assert camera_names() == (*shipped_cameras(), *tables, *DEMO_PHONES)
    for name in tables:
        camera = read_camera(name.upper())
        assert camera.name == name
        assert camera.values.shape == (681, 3)
        assert not camera.values.flags.writeable
        nodes = np.isin(WAVELENGTHS, tables[name].wavelengths)
        inside = np.isin(tables[name].wavelengths, WAVELENGTHS)
        np.testing.assert_allclose(camera.values[nodes], tables[name].values[inside], atol=1e-12)
        assert camera.values.min() >= 0


@pytest.mark.repository
def test_the_demo_s_phones_are_the_draws_that_their_command_makes(capsys: pytest.CaptureFixture[str]) -> None:
    """Cameras that could be, and none that the basis was learned from: those stand nearer to each other."""
    assert demo_phones.main(["--check"]) == 0, capsys.readouterr().err
    for phone in map(read_camera, DEMO_PHONES):
        assert "no known phone" in phone.source
        assert phone.values.min() >= 0
        assert (np.abs(np.diff(phone.values, axis=0)).max(axis=0) < 0.05).all()


def test_shipped_cameras_are_those_of_rawtoaces() -> None:
    """The file that they were learned from, each channel's peak at 1; a name is read as the very camera."""
    table = Path(__file__).parents[2] / "data" / "ssf" / "rawtoaces.csv"
    assert len(shipped_cameras()) == 52
    for name, nodes in list(shipped_cameras().items())[::13]:
        camera = read_camera(name)
        assert camera.name == name
        np.testing.assert_allclose(camera.values[::10], nodes, atol=1e-12)
        whole = read_camera(f"{table}:{name}").values[::10]
        np.testing.assert_allclose(nodes, whole / whole.max(axis=0), atol=1e-12)
    with pytest.raises(InvalidArgument, match="has 52 cameras") as caught:
        read_camera(str(table))
    assert "rawtoaces.csv:NAME" in caught.value.advice
    with pytest.raises(InvalidArgument, match="none called 'Canon 5D'"):
        read_camera(f"{table}:Canon 5D")
    assert read_camera("nikon d5100").source == "Nikon D5100 (rawtoaces-data 1.1.0, Apache-2.0)"


HEAD = "wavelength_nm,red,green,blue\n"


def camera_file(red: str = "1", nm: Iterable[int] = range(380, 721, 5)) -> str:
    return HEAD + "".join(f"{w},{red},1,1\n" for w in nm)


@pytest.mark.parametrize(
    "text",
    [
        *("", HEAD, "wavelength_nm,red,green\n380,1,1\n", HEAD + "380,1,1,1\n385,1,1\n"),
        *(camera_file(red) for red in ("0", "nan", "1e300")),
        *(camera_file(nm=nm) for nm in ((385, *range(380, 721, 5)), range(800, 1000, 5), (380, 550))),
    ],
)
def test_no_table_of_a_camera(tmp_path: Path, text: str) -> None:
    with pytest.raises(InvalidArgument):
        read_camera(write(tmp_path / "c.csv", text))
