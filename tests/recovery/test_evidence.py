"""Hypotheses: what it takes, what it refuses, and the calls before it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from camssf.errors import InvalidArgument
from camssf.recovery import Observation, recover
from camssf.recovery.sensitivity import SolverSettings
from tests.support.problems import chart_and_lamp, theory, toy_camera


def arguments() -> dict[str, Any]:
    """Signals with 2 % of noise of 24 patches under D55."""
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    noisy = y * (1 + 0.02 * np.random.default_rng(2).normal(size=y.shape))
    return {"signals": noisy, "reflectance": reflectance, "lamp": lamp, "standard_error": 0.02 * y}


@pytest.mark.parametrize("basis", ["cameras", "gaussian"])
def test_a_mask_is_the_same_as_leaving_patches_out(basis: str) -> None:
    given = arguments()
    used = np.zeros((1, 24), dtype=bool)
    used[0, 6:18] = True
    few = given | {name: given[name][6:18] for name in ("signals", "reflectance", "standard_error")}
    masked, left_out = (recover(Observation(**e), basis=basis) for e in (given | {"used": used}, few))
    gamma = left_out.gamma
    assert masked.gamma == pytest.approx(gamma, rel=0.02)  # the discrepancy is searched to 1 %
    exact = SolverSettings(gamma=gamma[0])
    masked, left_out = (recover(Observation(**e), basis=basis, settings=exact) for e in (given | {"used": used}, few))
    assert masked.values == pytest.approx(left_out.values, rel=1e-5, abs=1e-7 * left_out.values.max())


def test_what_is_not_used_may_be_unknown() -> None:
    given = arguments()
    used = np.ones((1, 24), dtype=bool)
    used[0, 3] = False
    hole = given["signals"].copy()
    hole[3] = np.nan
    found = recover(Observation(**given | {"signals": hole, "used": used}))
    assert found.peak()[0] == pytest.approx(recover(Observation(**given | {"used": used})).peak()[0], abs=1e-5)
    with pytest.raises(InvalidArgument, match="NaN"):
        Observation(**given | {"signals": hole})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"used": np.zeros((1, 24), dtype=bool)}, "no signal at all"),
        ({"used": np.ones((1, 5), dtype=bool)}, "has shape"),
        ({"used": [[True], [True, False]]}, "is no array"),
        ({"standard_error": np.ones((3, 24))}, "has shape"),
        ({"reflectance": 100 * np.ones((24, 681))}, "reaches from 100"),
        ({"reflectance": -np.ones((24, 681))}, "reaches from -1"),
        ({"frames": 3}, "is not chart, white and dark"),
        ({"frames": (np.ones((24, 3)), np.ones((24, 3)), np.ones((5, 3)))}, "have shapes"),
        ({"signals": [[1, 2], [3]]}, "not an array"),
    ],
)
def test_wrong_evidence_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidArgument, match=words) as refusal:
        Observation(**arguments() | change)
    assert refusal.value.advice


def test_modes_of_one_shot_need_no_axis_of_shots() -> None:
    modes = np.ones((2, 24))
    assert np.array_equal(Observation(**arguments(), gain_modes=modes).gain_modes, modes[None])
