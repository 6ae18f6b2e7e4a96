"""Lamps known by kind, tolerances of lamps known by name; data/spectra.json by colour-science's own tables."""

import numpy as np
import pytest

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import colour_science, read_lamp, with_tolerance
from camssf.spectra.bundled import bundled, observer
from camssf.spectra.families import FAMILIES, LampKind, Temperature, principal_modes
from tests.support.problems import near
from tools import tabulate


def floored(power: Floats) -> Floats:
    return np.maximum(power, 1e-3 * power.max())


@pytest.mark.parametrize("name", FAMILIES)
def test_a_family_is_a_mean_and_modes(name: str) -> None:
    lamp = read_lamp(name)
    assert lamp.values.mean() == pytest.approx(1.0)
    assert (lamp.values > 0).all()
    assert len(lamp.modes) >= 1
    formula = isinstance(FAMILIES[name], Temperature)
    weight = np.ones_like(lamp.values) if formula else floored(lamp.values)
    # A scale is no evidence; drawn kinds are rounded and linear between nodes of 5 nm.
    assert lamp.modes @ weight / weight.size == pytest.approx(0.0, abs=3e-3)


def test_modes_are_the_members_own_spread() -> None:
    family = FAMILIES["fluorescent"]
    assert isinstance(family, LampKind)
    lamps = np.stack([read_lamp(member).values for member in family.members])
    lamps /= lamps.mean(axis=1, keepdims=True)
    lamp, n = read_lamp("fluorescent"), len(lamps)
    assert lamp.values == pytest.approx(lamps.mean(axis=0))
    # A sample of n tells (n - 1) / (n - 3) (1 + 1 / n) too little of the variance of one lamp more.
    off = np.linalg.lstsq((lamp.modes * floored(lamp.values)).T, (lamps - lamp.values).T, rcond=None)[0]
    assert off.var(axis=1, ddof=1) == pytest.approx(np.full(len(lamp.modes), (n - 3) / (n - 1) / (1 + 1 / n)))
    mean, modes = principal_modes(list(lamps), 99)
    assert len(modes) == n - 1
    modes = modes * floored(mean)
    assert near(np.cov(lamps.T) * (n - 1) / (n - 3) * (1 + 1 / n), modes.T @ modes, rel=1e-6)


def test_a_temperature_tolerance_is_the_change_over_it() -> None:
    lamp = with_tolerance(read_lamp("2856K"), "100K")
    c2 = 1.4388e-2
    wavelength = np.array([450e-9, 650e-9])
    slope = c2 / (wavelength * 2856.0**2) / (1 - np.exp(-c2 / (wavelength * 2856.0))) * 100.0  # d ln L / dT by hand
    found = lamp.modes[0][[140, 540]]
    assert found[0] - found[1] == pytest.approx(slope[0] - slope[1], rel=2e-3)
    both = with_tolerance(read_lamp("D55"), "300K,1%")
    assert both.tolerance == pytest.approx(0.01)
    assert both.modes.shape == (1, 681)
    assert "300 K" in both.source
    assert (read_lamp("D55").tolerance_kelvin, both.tolerance_kelvin) == (None, 300.0)
    assert with_tolerance(both, "400K").tolerance_kelvin == 500.0  # variances add


@pytest.mark.parametrize(
    ("lamp", "text"), [("FL2", "300K"), ("D55", "much"), ("D55", "80%"), ("D55", "3000K"), ("D55", "0K"), ("E", "1K")]
)
def test_impossible_tolerances_are_named(lamp: str, text: str) -> None:
    with pytest.raises(InvalidArgument) as refusal:
        with_tolerance(read_lamp(lamp), text)
    assert refusal.value.advice


@pytest.mark.repository
def test_the_file_is_what_the_command_makes(capsys: pytest.CaptureFixture[str]) -> None:
    assert tabulate.main(["--check"]) == 0, capsys.readouterr().out


@pytest.mark.repository
def test_daylight_lamps_and_observer_are_colour_science_s() -> None:
    science, file = colour_science(), bundled()
    daylight = science.colorimetry.datasets.illuminants.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES
    parts = [(file["daylight"] | {"values": file["daylight"][name]}, daylight[name]) for name in ("S0", "S1", "S2")]
    lamps = [(table, science.SDS_ILLUMINANTS[name]) for name, table in file["lamps"].items()]
    for table, known in parts + lamps:
        nodes = table["start"] + table["step"] * np.arange(len(table["values"]))
        assert nodes.tolist() == known.wavelengths.tolist()
        assert table["values"] == known.values.tolist()
    matching = science.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    known = np.stack([np.interp(WAVELENGTHS, matching.wavelengths, each) for each in matching.values.T], axis=1)
    assert observer("1931") == pytest.approx(known, abs=1e-15)
