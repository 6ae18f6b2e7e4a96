"""Lamps known by kind, and tolerances of lamps known by name."""

from __future__ import annotations

import numpy as np
import pytest

from camssf import recover
from camssf.errors import InvalidArgument
from camssf.families import FAMILIES, Kind, logarithm, principal_modes
from camssf.spectra import read_lamp, with_tolerance
from tests.problems import chart_and_lamp, theory, toy_camera


@pytest.mark.parametrize("name", FAMILIES)
def test_a_family_is_a_mean_and_modes(name: str) -> None:
    lamp = read_lamp(name)
    assert lamp.values.mean() == pytest.approx(1.0)
    assert (lamp.values > 0).all()
    assert len(lamp.modes) >= 1
    assert lamp.modes.mean(axis=1) == pytest.approx(np.zeros(len(lamp.modes)), abs=1e-12)  # a scale is no evidence


@pytest.mark.parametrize(
    ("family", "warm", "cool", "limit"), [("daylight", "D:4900", "D:6700", 0.03), ("bulb", "2450K", "2950K", 0.02)]
)
def test_one_temperature_mode_reaches_its_neighbours(family: str, warm: str, cool: str, limit: float) -> None:
    """One standard deviation along the mode is the lamp at the temperature one spread away, to second order."""
    lamp = read_lamp(family)
    for name, side in ((warm, -1.0), (cool, 1.0)):
        off = logarithm(read_lamp(name).values) - logarithm(lamp.values) - side * lamp.modes[0]
        assert np.sqrt(np.mean(off**2)) < limit + 0.2 * np.sqrt(np.mean(lamp.modes[0] ** 2))


@pytest.mark.parametrize("name", ["white-led", "fluorescent"])
def test_modes_are_the_members_own_spread(name: str) -> None:
    family = FAMILIES[name]
    assert isinstance(family, Kind)
    logs = logarithm(np.stack([read_lamp(member).values for member in family.members]))
    lamp = read_lamp(name)
    residual = logs - logs.mean(axis=0)
    codes = np.linalg.lstsq(lamp.modes.T, residual.T, rcond=None)[0]
    assert codes.std(axis=1, ddof=1) == pytest.approx(np.ones(len(lamp.modes)))  # one standard deviation long
    mean, modes = principal_modes([read_lamp(m).values for m in family.members], 99)
    assert len(modes) == len(family.members) - 1
    everything = np.linalg.lstsq(modes.T, (logs - logarithm(mean)).T, rcond=None)[1]
    assert np.abs(everything).max(initial=0.0) < 1e-18 * logs.size or not everything.size


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


@pytest.mark.parametrize(
    ("lamp", "text"), [("FL2", "300K"), ("D55", "much"), ("D55", "80%"), ("D55", "3000K"), ("D55", "0K"), ("E", "1K")]
)
def test_impossible_tolerances_are_named(lamp: str, text: str) -> None:
    with pytest.raises(InvalidArgument) as refusal:
        with_tolerance(read_lamp(lamp), text)
    assert refusal.value.advice


def test_an_unknown_lamp_widens_the_bands() -> None:
    reflectance, true = chart_and_lamp("D:6300", slice(0, 24))
    y = theory(reflectance, true, toy_camera())
    widths = []
    for spec in ("D:6300", "daylight", "white-led"):
        lamp = read_lamp(spec)
        answer = recover(
            y,
            reflectance,
            lamp.values,
            standard_error=0.003 * y,
            lamp_tolerance=lamp.tolerance,
            lamp_modes=lamp.modes[None],
        )
        std = answer.peak()[1]
        assert std is not None
        widths.append(std.mean())
    assert widths[0] < widths[1] < widths[2]
