"""The chromaticity of the raw white: matrices, kinds narrowed by it, and matrices that are wrong."""

import numpy as np
import pytest

from camssf.colorimetry import chromaticity, uv
from camssf.grid import WAVELENGTHS
from camssf.photo.read.colour_matrix import WHITE_POINTS, colour_matrix
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.recovery.raw_white import given_raw_white, narrow
from camssf.rules import rules
from camssf.spectra import colour_science, read_lamp
from camssf.spectra.bundled import observer
from camssf.spectra.lights import unnamed_light

FLAT = np.ones(WAVELENGTHS.size)


def test_a_matrix_gives_the_white_of_its_illuminant() -> None:
    matrix = np.diag([0.5, 1.0, 0.8])
    found = colour_matrix(21, matrix, calibration=2.0 * np.eye(3), balance=np.array([1.0, 1.0, 1.5]))
    x, y = WHITE_POINTS["D65"]
    assert found.white == pytest.approx([0.5 * x / y, 1.0, 1.2 * (1.0 - x - y) / y])
    assert found.kelvin == pytest.approx(6504.0, rel=0.002)
    with pytest.raises(ValueError, match="light source 255"):  # a light that Exif does not define
        colour_matrix(255, matrix)
    with pytest.raises(ValueError, match="no white under D65"):
        colour_matrix(21, np.diag([1.0, 1.0, -1.0]))


def test_the_chromaticity_is_colour_science_s() -> None:
    """A camera whose curves are the observer itself has the identity for its matrices."""
    colour = colour_science()
    for name in ("A", "D55", "LED-B3", "FL2"):
        xyz = read_lamp(name).values @ observer("1931")
        found = chromaticity(7.0 * xyz, [(2856.0, np.eye(3)), (6504.0, np.eye(3))])
        xy = colour.XYZ_to_xy(xyz)
        assert found == pytest.approx(colour.xy_to_Luv_uv(xy), abs=1e-9)


def test_two_matrices_are_interpolated_by_the_reciprocal_temperature() -> None:
    """Half-way in 1 / T between A and D65 the two have equal shares: the answer is a fixed point."""
    middle = 2.0 / (1.0 / 2856.0 + 1.0 / 6504.0)
    xyz = read_lamp(f"{middle:.0f}K").values @ observer("1931")
    first, second = np.diag([1.1, 1.0, 1.0]), np.diag([0.9, 1.0, 1.0])
    assert chromaticity(xyz, [(2856.0, first), (6504.0, second)]) == pytest.approx(uv(xyz), abs=2e-4)


@pytest.mark.parametrize("matrices", [[], [(6504.0, np.zeros((3, 3)))], [(6504.0, np.diag([1.0, 1.0, -1.0]))]])
def test_matrices_without_a_chromaticity_change_nothing(matrices: list[tuple[float, np.ndarray]]) -> None:
    light = unnamed_light()
    assert given_raw_white(light, np.ones(3), matrices, FLAT) is light


def test_a_kind_is_narrowed_as_by_draws() -> None:
    """Bayes by 100,000 lamps of the kind, weighed by the normal density of their chromaticity."""
    lamp = read_lamp("daylight")
    measured = uv(read_lamp("D:9000").values @ observer("1931"))
    narrowed, log_density = narrow(lamp, measured, FLAT)
    smooth = lamp.tolerance * smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T
    every = np.concatenate([lamp.modes, smooth])
    u = np.random.default_rng(4).normal(size=(100_000, len(every)))
    xyz = lamp.values @ observer("1931") + u @ ((lamp.values * every) @ observer("1931"))
    off = (uv(xyz) - measured) / rules().number("lamp.white_error_daylight")
    weight = np.exp(-0.5 * np.sum(off**2, axis=1))
    mean = weight @ u[:, : len(lamp.modes)] / weight.sum()
    power = lamp.values * (1.0 + mean @ lamp.modes)
    assert narrowed.values == pytest.approx(power / power.mean(), abs=0.02)
    spread = weight @ (u[:, 0] - mean[0]) ** 2 / weight.sum()
    before, after = (float(np.sum(each.modes[:, 60] ** 2)) for each in (lamp, narrowed))  # at 410 nm
    assert after / before == pytest.approx(spread, rel=0.5)
    assert narrow(lamp, measured + 0.05, FLAT)[1] < log_density - 5.0
