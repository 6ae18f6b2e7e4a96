"""The accuracy benchmark: its bands cover, of cameras whose makers their bases do not know."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.claims import accuracy
from benchmarks.claims.accuracy import PRODUCT, SETTINGS
from benchmarks.devices import left_out
from benchmarks.shared import CURVES
from camssf.recovery.basis import interpolate
from camssf_lab.learning.basis import learn
from camssf_lab.learning.training import maker_of, read_curves

NAMED = {setting.name: setting for setting in SETTINGS}
EXACT = "exact, D55, 24"


pytestmark = [pytest.mark.full, pytest.mark.requirement("R-CAMERAS")]


def test_bands_cover() -> None:
    """Of left-out cameras; one draw of 52 cameras, so the bars of the benchmark with 1 % more to each side."""
    cameras, bases = left_out()
    scores = accuracy.measure(NAMED[EXACT], (PRODUCT,), 1, cameras, bases)[PRODUCT]
    assert scores.rmse.mean() < 0.031
    row = scores.row()
    assert 0.92 <= row["coverage"] <= 0.98
    assert min(row["coverage_bins"]) >= 0.87


def test_a_left_out_maker_is_not_in_its_basis() -> None:
    _, bases = left_out()
    curves = read_curves(CURVES)
    others = {name: curve for name, curve in curves.items() if not name.startswith("Nikon")}
    mean, atoms = learn(np.stack(list(others.values())), makers=[maker_of(name) for name in others])
    assert (bases["nikon"].dictionary == interpolate(atoms)).all()
    assert (bases["nikon"].mean == interpolate(mean[..., None])[..., 0]).all()
