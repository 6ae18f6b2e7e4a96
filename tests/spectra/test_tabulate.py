"""data/spectra.json: judged by colour-science's own tables, formulae and interpolators."""

import numpy as np
import pytest

from camssf.grid import WAVELENGTHS
from camssf.spectra import colour_science
from camssf.spectra.bundled import bundled, linear
from tools import tabulate


@pytest.mark.repository
def test_the_file_is_what_the_command_makes(capsys: pytest.CaptureFixture[str]) -> None:
    assert tabulate.main(["--check"]) == 0, capsys.readouterr().out


@pytest.mark.repository
def test_every_number_is_colour_science_s() -> None:
    science, file = colour_science(), bundled()
    daylight = science.colorimetry.datasets.illuminants.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES
    parts = [(file["daylight"] | {"values": file["daylight"][name]}, daylight[name]) for name in ("S0", "S1", "S2")]
    lamps = [(table, science.SDS_ILLUMINANTS[name]) for name, table in file["lamps"].items()]
    for table, known in parts + lamps:
        nodes = table["start"] + table["step"] * np.arange(len(table["values"]))
        assert nodes.tolist() == known.wavelengths.tolist()
        assert table["values"] == known.values.tolist()
    observer = science.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    for c, name in enumerate("xyz"):
        known = np.interp(WAVELENGTHS, observer.wavelengths, observer.values[:, c])
        assert linear(file["observer"] | {"values": file["observer"][name]}).tolist() == known.tolist()
    for name, chart in file["tables"].items():
        known = science.SDS_COLOURCHECKERS[name]
        assert chart["patches"] == list(known)
        assert chart["values"] == [sd.values.tolist() for sd in known.values()]
        assert known[chart["patches"][chart["white"]]][550] == max(sd[550] for sd in known.values())
