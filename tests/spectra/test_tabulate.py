"""data/spectra.json: judged by colour-science's own tables, formulae and interpolators."""

from __future__ import annotations

import json

import numpy as np
import pytest

from camssf.grid import WAVELENGTHS
from camssf.spectra import chart_names, colour_science, lamp_names, read_chart, read_lamp
from camssf.spectra.bundled import bundled, illuminant, linear, planck, reflectances
from camssf.spectra.families import FAMILIES, LampKind, logarithm
from camssf.spectra.layouts import LAYOUTS
from tools import tabulate


@pytest.mark.repository
def test_the_file_is_what_the_command_makes(capsys: pytest.CaptureFixture[str]) -> None:
    assert tabulate.main(["--check"]) == 0, capsys.readouterr().out


def test_it_is_strict_json_of_plain_numbers() -> None:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    text = tabulate.PLACE.read_text("utf-8")
    assert len(text) < 110_000  # a phone reads it at every start
    found = json.loads(text, parse_constant=refuse)
    assert found == bundled()
    assert tabulate.as_text(found) == text


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


def test_hashes_are_of_the_numbers() -> None:
    file = bundled()
    for table in (*file["lamps"].values(), *file["tables"].values()):
        assert table["sha256"] == tabulate.digest(table["values"])
    parts, observer = file["daylight"], file["observer"]
    assert parts["sha256"] == tabulate.digest([parts["S0"], parts["S1"], parts["S2"]])
    assert observer["sha256"] == tabulate.digest([observer[name] for name in "xyz"])
    # 1.0 is the bytes 00 00 00 00 00 00 f0 3f
    assert tabulate.digest([1.0]) == "6c3c396ed6b5c36dcae172271f462051b1266b851e92df3deea8ac65478fd712"


def test_names_and_layouts_are_the_package_s() -> None:
    file = bundled()
    assert lamp_names() == (*file["lamps"], "equal-energy", *FAMILIES)
    assert set(file["families"]) == set(FAMILIES)
    assert len(chart_names()) == len(file["charts"]["names"]) * len(file["charts"]["tables"])
    assert {name: tuple(each["side"]) for name, each in file["layouts"].items()} == {
        name: each.side for name, each in LAYOUTS.items()
    }
    assert file["tolerances"]["named_lamp"] == read_lamp("A").tolerance
    assert file["tolerances"]["public_chart"] == read_chart("classic24").tolerance[0]


@pytest.mark.parametrize("name", [name for name, family in FAMILIES.items() if isinstance(family, LampKind)])
def test_weights_give_the_family_s_mean_and_modes(name: str) -> None:
    """As a phone does it: sums of the members, no singular value decomposition."""
    family, lamp = bundled()["families"][name], read_lamp(name)
    shapes = np.stack([illuminant(member) / illuminant(member).mean() for member in family["members"]])
    power = shapes.mean(axis=0)
    np.testing.assert_allclose(power / power.mean(), lamp.values, rtol=1e-13)
    modes = np.array(family["weights"]) @ shapes / np.maximum(power, family["dimmest"] * power.max())
    np.testing.assert_allclose(modes.T @ modes, lamp.modes.T @ lamp.modes, rtol=0, atol=1e-12)  # signs are free
    assert family["tolerance"] == lamp.tolerance
    low = min(illuminant(member).min() / illuminant(member).max() for member in family["members"])
    assert family["dimmest"] == 1e-3
    assert low >= 0


def test_a_temperature_family_is_a_central_difference() -> None:
    family, lamp = bundled()["families"]["bulb"], read_lamp("bulb")
    assert family["formula"] == "planck"
    low, high = (logarithm(planck(family["centre"] + side * family["spread"])) for side in (-1, 1))
    np.testing.assert_allclose(lamp.modes, [(high - low) / 2], rtol=0, atol=1e-14)
    assert family["tolerance"] == lamp.tolerance


def test_nodes_are_kept_to_the_bit() -> None:
    for name, table in bundled()["tables"].items():
        step = round(table["step"] / 0.5)
        first = round((table["start"] - 380.0) / 0.5)
        inside = [i for i in range(len(table["values"][0])) if 0 <= first + i * step < 681]
        for row, stored in zip(reflectances(name), table["values"], strict=True):
            assert row[[first + i * step for i in inside]].tolist() == [stored[i] for i in inside]
    assert illuminant("FL2")[::10].tolist() == bundled()["lamps"]["FL2"]["values"][:69]
    ramp = linear({"start": 400.0, "step": 5.0, "values": [1.0, 3.0]})
    assert ramp[[0, 40, 45, 50, 680]].tolist() == [1.0, 1.0, 2.0, 3.0, 3.0]
