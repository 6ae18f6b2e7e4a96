"""The chart's error model: larger in the deep red, and a scale for each patch."""

from __future__ import annotations

import numpy as np
import pytest

from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery import whitening
from camssf.recovery.basis import read_basis
from camssf.recovery.covariance import red_end
from camssf.recovery.inputs import hypotheses_of
from camssf.recovery.observation import Observation
from camssf.recovery.rows import fold_hypotheses, prior_point, rows_at
from camssf.recovery.sensitivity import SolverSettings, solve_on_basis
from camssf.recovery.whitening import modes_at_prior, patch_scales
from camssf.spectra import read_chart, read_lamp
from golden.forms import resolve
from golden.scenes import PHONE

pytestmark = pytest.mark.requirement("R-TABLE")

TABLE = read_chart("classic24")
RED = 14
"""The red patch."""


def capture(*, wrong: float = 1.0, tolerance: float = 0.03) -> Observation:
    """A phone's signals of the table under D55 and A; the red patch reflects `wrong` times as much as it says."""
    chart = TABLE.values.copy()
    chart[RED] *= wrong
    lamps = np.stack([read_lamp(name).values for name in ("D55", "A")])
    camera = resolve(PHONE)
    signals = ((lamps[:, None] * chart) @ camera) / (lamps @ camera)[:, None]
    return Observation(
        signals, TABLE.values, lamps, standard_error=0.002 * signals, chart_tolerance=np.array(tolerance)
    )


def scales(observation: Observation) -> Floats:
    """(24,) of the basis phones."""
    folded = fold_hypotheses(hypotheses_of([observation], read_basis("phones")))
    point = prior_point(folded)
    rows = rows_at(folded, point)
    return np.asarray(patch_scales(rows, modes_at_prior(folded, rows, point))[0])


def test_two_tables_of_one_chart_differ_most_in_the_deep_red() -> None:
    """Ohta's and BabelColor's, from which the size comes: between 2 and 3.2 times as much."""
    apart = (read_chart("classic24:ohta").values - read_chart("classic24:babelcolor").values) ** 2
    deep = (WAVELENGTHS >= 660) & (WAVELENGTHS <= 700)
    rest = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 640)
    assert 2.0 < np.sqrt(apart[:, deep].mean() / apart[:, rest].mean()) < 3.2
    h = red_end(WAVELENGTHS)
    assert h[rest].max() < 1.4
    assert h[deep].min() > 2.2
    assert h.max() < 2.6 + 1e-3


def test_a_patch_unlike_its_table_has_the_largest_scale() -> None:
    clean, odd = scales(capture()), scales(capture(wrong=1.25))
    assert (clean >= 1.0).all()
    assert clean.max() < 1.5
    assert odd.argmax() == RED
    assert odd[RED] > 3.0
    assert np.delete(odd, RED).max() < 2.0


def test_what_is_exact_has_no_scale() -> None:
    """Without a tolerance there is nothing to enlarge, however wrong a patch is."""
    assert (scales(capture(wrong=1.25, tolerance=0.0)) == 1.0).all()


def test_a_wrong_patch_harms_the_curves_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """Than with the same scale for all patches: half as much at most."""

    def curves(wrong: float) -> Floats:
        return solve_on_basis(capture(wrong=wrong), "phones", settings=SolverSettings(engine="reference")).peak()[0]

    scaled = np.abs(curves(1.25) - curves(1.0)).mean()
    monkeypatch.setattr(whitening, "MOST", 1.0)
    assert scaled < 0.5 * np.abs(curves(1.25) - curves(1.0)).mean()
