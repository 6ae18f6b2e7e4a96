"""The accuracy benchmark, small: what it measures, and that the product is what its table says."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from benchmarks.claims import accuracy
from benchmarks.claims.accuracy import (
    MEAN,
    METHODS,
    PAPER,
    PRODUCT,
    SETTINGS,
    SPARSE,
    Scores,
    Setting,
)
from benchmarks.shared import CURVES, chart, lamp
from camssf.grid import STEP
from camssf.learning.basis import learn
from camssf.learning.training import maker_of, read_curves
from camssf.recovery.basis import interpolate
from camssf.recovery.covariance import (
    ABSOLUTE,
    CHART_CORRELATION,
    EDGE,
    RELATIVE,
    TABLE_CORRELATION,
    smooth_errors,
)
from tests.problems import predicted, recovered

NAMED = {setting.name: setting for setting in SETTINGS}


@cache
def measured(*names: str, methods: tuple[str, ...] = (PRODUCT,)) -> dict[str, dict[str, Scores]]:
    """Every camera once."""
    cameras, bases = accuracy.left_out()
    return accuracy.measure([NAMED[name] for name in names], methods, 1, cameras, bases)


@pytest.mark.full
def test_the_product_is_better_than_what_stands_beside_it() -> None:
    found = measured("exact, D55, 24", methods=METHODS)["exact, D55, 24"]
    rmse = {method: float(scores.rmse.mean()) for method, scores in found.items()}
    assert rmse[PRODUCT] < 0.031
    assert rmse[PRODUCT] < 0.5 * rmse[PAPER]
    assert rmse[PRODUCT] < rmse[SPARSE]
    assert rmse[PRODUCT] == pytest.approx(rmse[MEAN], rel=0.02)  # γ is small
    assert found[PAPER].covered is None


@pytest.mark.full
def test_more_lamps_cancel_more_of_a_foreign_table() -> None:
    names = [name for name in NAMED if name.startswith("Ohta")]
    one, two, three = (scores[PRODUCT].rmse.mean() for scores in measured(*names).values())
    assert two < 0.8 * one
    assert three < 0.9 * two
    assert three < 0.028


@pytest.mark.full
def test_lamps_that_are_off_and_declared_cost_little() -> None:
    off = measured("lamps off, D55", "lamps off, D55 + A")
    known = measured("Ohta, D55", "Ohta, D55 + A", "Ohta, D55 + A + LED-B3")
    one, two = (off[name][PRODUCT].rmse.mean() for name in off)
    assert two < 0.9 * one
    assert one < 1.1 * known["Ohta, D55"][PRODUCT].rmse.mean()


@pytest.mark.requirement("R-CAMERAS")
@pytest.mark.full
@pytest.mark.parametrize("name", ["exact, D55, 24", "Ohta, D55 + A", "lamps off, D55 + A"])
def test_bands_cover(name: str) -> None:
    """Of left-out cameras; one draw of 52 cameras, so the bars of the benchmark with 1 % more to each side."""
    row = measured(name)[name][PRODUCT].row()
    assert 0.92 <= row["coverage"] <= 0.98
    assert min(row["coverage_bins"]) >= 0.87


@pytest.mark.requirement("R-CAMERAS")
@pytest.mark.full
@pytest.mark.parametrize("name", ["exact, D55, 24", "lamps off, D55 + A"])
def test_monte_carlo_agrees_with_the_bands(name: str) -> None:
    """GUM Supplement 1 with the shipped model; 300 draws know the ratio to about 3 %."""
    assert accuracy.monte_carlo(NAMED[name], 300, np.random.default_rng(1)) == pytest.approx(np.ones(3), abs=0.10)


@pytest.mark.requirement("R-CAMERAS")
@pytest.mark.full
def test_a_left_out_maker_is_not_in_its_basis() -> None:
    _, bases = accuracy.left_out()
    curves = read_curves(CURVES)
    others = {name: curve for name, curve in curves.items() if not name.startswith("Nikon")}
    mean, atoms = learn(np.stack(list(others.values())), makers=[maker_of(name) for name in others])
    assert (bases["nikon"].dictionary == interpolate(atoms)).all()
    assert (bases["nikon"].mean == interpolate(mean[..., None])[..., 0]).all()


@pytest.mark.full
@pytest.mark.parametrize(("lamps", "off"), [(("D55",), False), (("D55", "A"), True)])
def test_predicted_colours_lie_within_their_bands(lamps: tuple[str, ...], off: bool) -> None:
    """Cameras left out, half of a chart fitted whose table, white and lamps are off as declared: true signals of both
    halves, without noise, against their 95 % bands."""
    cameras, bases = accuracy.left_out()
    setting = Setting("bands", lamps, ohta=True, off=off)
    told, light = setting.tolerances(), np.stack([lamp(name) for name in lamps])
    long, short = (interpolate(smooth_errors(length)) for length in (CHART_CORRELATION, TABLE_CORRELATION))
    table, slope = chart(), EDGE * np.gradient(chart(), STEP, axis=1)
    fit, rest = np.arange(0, 24, 2), np.arange(1, 24, 2)
    rng = np.random.default_rng(9)
    held = []
    for name, camera in list(cameras.items())[::2]:
        u = [rng.normal(size=(24, curves.shape[1])) @ curves.T for curves in (long, short, short)]
        seen = table + accuracy.CHART * (RELATIVE * table * u[0] + ABSOLUTE * u[1] + slope * u[2])
        white = 1.0 + accuracy.WHITE * (long @ rng.normal(size=long.shape[1]))
        true = np.stack([accuracy.true_lamp(each, off, rng) for each in lamps])
        signals = ((true[:, None] * seen) @ camera) / ((true * white) @ camera)[:, None]
        error = np.hypot(0.005 * signals, 0.001)[:, fit]
        given = {
            "signals": signals[:, fit] + error * rng.normal(size=error.shape),
            "reflectance": table[fit],
            "lamp": light,
            "standard_error": error,
            "basis": bases[maker_of(name)],
            **told,
        }
        found = predicted(recovered(**given), **given, of=table[rest], of_tolerance=accuracy.CHART)
        off_by = np.abs(found.values - signals[:, [*fit, *rest]])
        held.append((off_by <= 1.96 * found.std).reshape(len(lamps), 2, 12, 3).mean(axis=(0, 2, 3)))
    fitted, unseen = np.mean(held, axis=0)
    assert 0.925 <= fitted <= 0.975  # 26 cameras a draw: the bar's 93 to 97 %, and half a per cent for chance
    assert 0.925 <= unseen <= 0.975
