"""Text tables of lamps, charts, cameras and frames: no number is read wrongly without a word, good input is read."""

from pathlib import Path

import numpy as np
import pytest

from camssf.errors import CalibrationError, InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf_lab.direct.columns import read_columns
from tests.spectra.test_spectra import write
from tests.support.text_tables import COMMAS, COUNTS, NM, QUOTED, SHARES, TABLES, english, table

UNFIT = [f"lamp, {name}" for name in ("noise inside", "negative", "not a number", "no power", "from 420 nm",
                                       "three lines")]  # fmt: skip
"""Tables that are read, but not of a lamp's values."""


@pytest.mark.parametrize("name", TABLES)
def test_a_text_table_is_read_or_refused_with_its_place(name: str, tmp_path: Path) -> None:
    text, words, kind = TABLES[name]
    path = write(tmp_path / "table.csv", text)
    read = read_lamp if kind == "lamp" else read_chart
    if words is not None:
        with pytest.raises(CalibrationError, match=words) as caught:
            read(path)
        assert caught.value.code == ("lamp_unfit" if name in UNFIT else "invalid_argument")
        return
    values = read(path).values
    if kind == "chart":
        np.testing.assert_allclose(values[:, ::20], read_chart("classic24").values[:, ::20], atol=1e-6)
    elif "\n339.500" not in text and not text.startswith("339.500"):
        known = np.interp(WAVELENGTHS, NM, [5000 + c if "three digits" in name else c for c in COUNTS])
        np.testing.assert_allclose(values, known / known.mean(), rtol=1e-9)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_ends_of_lines(encoding: str, end: str, tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_bytes(table(COMMAS, "\t", head="Wellenl\u00e4nge\tW\n").replace("\n", end).encode(encoding))
    assert read_lamp(str(path)).values[0] == pytest.approx(
        0.01 / np.interp(WAVELENGTHS, NM, np.array(COUNTS) / 1e4).mean()
    )


CURVES = {
    "quoted": ([f'"{english(c)}"' for c in COUNTS], ",", "line 9: '1,045' may be"),
    "German": ([english(c).replace(",", ".") for c in COUNTS], ";", r"line 9: '1\.045' may be"),
    "Swiss": ([english(c).replace(",", "'") for c in COUNTS], "\t", "line 9: \"?'1'045' has"),
    "decimal commas": (COMMAS, ";", None),
    "no number": (["x", *SHARES[1:]], ",", "line 2: 'x' is not a number"),
    "descending": (SHARES[::-1], ",", None),
}


@pytest.mark.parametrize("name", CURVES)
@pytest.mark.parametrize(
    "head", ["wavelength_nm,red,green,blue", "Wavelength (nm), R, G, B", "Meter 5\nnm,r,g,b", "wavelength_nm,power"]
)
def test_a_table_of_a_camera_or_of_a_sweep(name: str, head: str, tmp_path: Path) -> None:
    values, mark, words = CURVES[name]
    camera = "power" not in head
    nm = NM[::-1] if name == "descending" else NM
    rows = [mark.join([str(w), *[v] * (3 if camera else 1)]) for w, v in zip(nm, values, strict=True)]
    path = tmp_path / "table.csv"
    path.write_text("\n".join([head.replace(",", mark), *rows]), "utf-8" if camera else "utf-16")

    def read() -> Floats:
        return read_camera(str(path)).values[::10, 0] if camera else read_columns(path, ("wavelength_nm", "power"))[1]

    if words is None:
        np.testing.assert_allclose(read(), (np.array(COUNTS) / 1e4)[: len(read())], rtol=1e-6)
        return
    if "\n" in head:
        words = words.replace("line 9", "line 10").replace("line 2", "line 3")
    with pytest.raises(InvalidArgument, match=words):
        read()


def test_a_workbook_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "lamp.xls"
    path.write_bytes(b"PK\x03\x04" + QUOTED[0].encode())
    with pytest.raises(InvalidArgument, match="Save the table as CSV"):
        read_lamp(str(path))
