"""Comparing: the spread of a model's units and the drift of one, from the registry; both are as true as they say."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np
import pytest

from camssf.errors import InvalidArgument
from camssf.photo.read.unit import Unit
from camssf_fleet.compare import COMPARED, NM, between_units, spread, units_of
from camssf_fleet.drift import FALSE_ALARMS, FEATURES, drift_of, drifts, features
from camssf_fleet.registry import Registry
from tests.support.registries import START, bells, far_off, history, holding, made

pytestmark = pytest.mark.full  # statistics over many units

MODEL = Unit(model="Model")
BUMP = np.exp(-0.5 * ((NM - 550) / 40) ** 2)


def fleet(one: Registry, units: int, repeats: int, between: float, within: float) -> None:
    """Units whose curves differ by a bump of so many parts of the peak, and results of each that do by another."""
    dice = np.random.default_rng(0)
    rows = []
    for unit in range(units):
        own = between * dice.standard_normal((3, 1)) * BUMP
        for repeat in range(repeats):
            curves = bells() + own + within * dice.standard_normal((3, 1)) * BUMP
            rows.append(made(1000 * unit + repeat, curves, serial=f"u{unit}"))
    one.add(rows)


def rms(bump: float = 1.0) -> float:
    return float(bump * np.sqrt(np.mean(BUMP[COMPARED] ** 2)))


def test_the_spread_of_a_model(one: Registry) -> None:
    fleet(one, units=60, repeats=3, between=0.03, within=0.02)
    one.add([made(900_000, bells(20.0), serial=""), made(900_001, bells(50.0), status="refused", serial="r")])
    found = spread(one, MODEL)
    assert (found.units, found.results, found.without_serial) == (60, 180, 1)
    assert found.repeat == pytest.approx(rms(0.02), rel=0.15)
    assert found.between == pytest.approx(rms(0.03), rel=0.25)
    assert ((found.low < rms(0.03)) & (rms(0.03) < found.high)).all()
    assert found.observed == pytest.approx(rms(np.hypot(0.03, 0.02 / np.sqrt(3))), rel=0.25)


def test_the_interval_of_a_spread_covers() -> None:
    """0.95 of simulated fleets of six units, and not much more where one bump is all that differs."""
    dice, inside = np.random.default_rng(3), 0
    for _ in range(400):
        units = [0.03 * dice.standard_normal((3, 1)) * BUMP[COMPARED] for _ in range(6)]
        _, repeat, between, low, high = between_units([unit[None] for unit in units])
        assert repeat is between is None
        inside += int(np.sum((low <= rms(0.03)) & (rms(0.03) <= high)))
    assert 0.93 <= inside / 1200 <= 0.97


def test_units_that_are_equal_spread_by_nothing(one: Registry) -> None:
    fleet(one, units=30, repeats=4, between=0.0, within=0.02)
    found = spread(one, MODEL)
    assert ((found.low == 0) & (found.high < rms(0.015))).all()
    assert all((np.asarray(number) == 0).all() for number in between_units([np.ones((2, 3, 5))] * 3))


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -1e30, 7.0, "too few"])
def test_curves_that_cannot_be_are_named(one: Registry, wrong: float | str) -> None:
    curves = bells()
    if wrong == "too few":
        curves = curves[:, :60]
    else:
        curves[1, 30] = wrong
    one.add([*history(5, 0), made(77, curves, captured=START, serial="A1"), made(78, bells(), serial="B2")])
    (file,) = holding(one, "kind = 'result'")
    for attempt in (lambda: spread(one, MODEL), lambda: drift_of(one, Unit(serial="A1"))):
        with pytest.raises(InvalidArgument, match=f"{file.name} is damaged: of the result 0000000"):
            attempt()


@pytest.mark.parametrize(("drift", "step", "alarm"), [(0, 0, ""), (6, 0, "trend"), (-6, 0, "trend"), (0, 5, "step")])
def test_a_drift_raises_an_alarm(one: Registry, drift: float, step: float, alarm: str) -> None:
    one.add(history(13, drift, step))
    red, *others = drift_of(one, Unit(serial="A1")).features
    assert (red.feature, *(feature.feature for feature in others)) == tuple(FEATURES)
    assert [feature.alarm for feature in (red, *others)] == [alarm, *[""] * 5]
    assert (red.results, red.days) == (13, pytest.approx(364.8))
    if alarm == "trend":
        assert red.slope == pytest.approx(drift, abs=min(1.0, 4 * red.slope_error))
    if alarm == "step":
        assert red.step == pytest.approx(step, abs=1.0)


def test_false_alarms_are_as_rare_as_they_say() -> None:
    dice, days = np.random.default_rng(5), np.arange(8) * 30.0
    alarms = 0
    for _ in range(2000):
        values = 500 + 20 * dice.standard_normal((8, len(FEATURES)))  # so loud that no limit hides one
        alarms += any(drift.alarm for drift in drifts(days, values))
    assert 0 < alarms / 2000 <= 1.5 * FALSE_ALARMS


def test_a_drift_that_is_certain_and_small_is_no_alarm() -> None:
    days = np.arange(10) * 36.5
    for drift in drifts(days, np.outer(days / 365, [0.5] * 6) + 500):
        assert drift.p_trend < 1e-6
        assert not drift.alarm
    still = drifts(days, np.full((10, 6), 500.0))
    assert [(each.change, each.p_trend, each.p_step, each.alarm) for each in still] == [(0, 1, 1, "")] * 6
    at_once = drifts(np.zeros(5), np.arange(30.0).reshape(5, 6))
    assert all(each.slope == 0 for each in at_once)


def test_what_a_drift_needs(one: Registry) -> None:
    one.add([*history(3, 0), made(90, bells(), captured=None)])
    few = r"not testable yet: of the unit A1 3 accepted results have a time, .* needs 4\. Left out: 1 no time"
    with pytest.raises(InvalidArgument, match=few):
        drift_of(one, Unit(serial="A1"))


@pytest.mark.parametrize(("more", "outcome", "why", "newest"), [
    ({"captured": START + timedelta(days=45)}, "no_drift", "doubtful", False),
    ({"red": (), "green": (), "blue": (), "status": "refused"}, "undecided", "no curves", True),
    ({"captured": None, "status": "accepted"}, "no_drift", "no time", False),  # added before the last photo
    ({"captured": None, "status": "accepted", "added": START + timedelta(days=300)}, "undecided", "no time", True),
    ({"camera_id": "1", "lens": "", "status": "accepted"}, "undecided", "unit not certain", True),
    ({"lens": "24mm"}, "no_drift", None, False),  # of another unit
    ({"inputs": ("a" * 64,)}, "no_drift", "doubtful", False),  # the same photos count, in another result
    ({"model": "Other"}, "no_drift", None, False),
])  # fmt: skip
def test_what_is_left_out_of_a_drift_is_named(one: Registry, more: Any, outcome: str, why: Any, newest: bool) -> None:
    rows = [replace(row, camera_id="1", lens="50mm") for row in history(5, 0)]
    rows[-1] = replace(rows[-1], inputs=("a" * 64,))
    other = [replace(rows[0], key="e" * 64, lens="35mm")] if why == "unit not certain" else []
    one.add([*rows, *other, far_off(**{"camera_id": "1", "lens": "50mm"} | more)])
    found = drift_of(one, Unit(serial="A1", lens="50mm", model="Model" if "model" in more else ""))
    left = [(out.why, out.newest, out.steps is None) for out in found.left_out]
    assert (found.outcome, left) == (outcome, [] if why is None else [(why, newest, why == "no curves")])
    assert found.features[0].results == 5


def test_a_unit_is_one_however_much_its_rows_say(one: Registry) -> None:
    one.add([made(1, bells(), lens="50mm"), made(2, bells()), made(3, bells(1.0), serial="B2"),
             made(4, bells(1.0), serial="B2", camera_id="2", lens="50mm")])  # fmt: skip
    found = spread(one, MODEL)
    assert (found.units, found.results, found.without_serial) == (2, 4, 0)
    one.add([made(5, bells(), lens="24mm"), made(6, bells(), camera_id="1", lens="24mm")])
    found = spread(one, MODEL)
    assert (found.units, found.results, found.without_serial) == (3, 5, 1)
    assert spread(one, Unit(model="Model", lens="50mm")).results == 3
    units = units_of([["m", "p", c, "s", lens] for c, lens in (("1", "a"), ("2", ""), ("2", "b"), ("", "a"))])
    assert units == [("m", "p", "1", "s", "a"), ("m", "p", "2", "s", "b"), ("m", "p", "2", "s", "b"), None]


def test_what_several_units_of_a_number_differ_in_is_said(one: Registry) -> None:
    rows = history(4, 0)

    def others(first: int, **more: str) -> list[Any]:
        return [replace(row, key=f"{i:064d}", **more) for i, row in enumerate(rows, first)]

    one.add([*others(0, lens="50mm"), *others(10, lens="24mm")])
    with pytest.raises(InvalidArgument, match=r"Several units.*lens '24mm', '50mm'") as caught:
        drift_of(one, Unit(serial="A1", model="Model", make="Maker"))
    assert caught.value.advice == "Name one by --lens."
    assert drift_of(one, Unit(serial="A1", lens="24mm")).features[0].results == 4
    one.add(others(20, make="Other", lens="24mm"))
    with pytest.raises(InvalidArgument, match=r"make 'Maker', 'Other'; lens") as caught:
        drift_of(one, Unit(serial="A1"))
    assert caught.value.advice == "Name one by --make or --lens."
    for unit in (Unit(make="Other"), Unit(lens="50mm", camera_id="7")):
        assert drift_of(one, replace(unit, serial="A1")).features[0].results == 4


def test_features_are_centres_and_widths() -> None:
    found = features(bells(np.array([-3.0, 0.0, 4.0]), width=25.0)[None][..., COMPARED])[0]
    assert found == pytest.approx([597, 25, 540, 25, 464, 25], abs=0.5)  # red and blue end a little inside
