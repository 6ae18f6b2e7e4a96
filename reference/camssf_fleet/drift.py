"""Tests whether the curves of one unit drift over time, and lists the results that were left out.

Curves are on the registry's grid: every 5 nm, each channel's peak = 1. They are compared from 400 to 700 nm.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS, Floats
from camssf.photo.read.unit import Unit
from camssf.shapes import Count, Number, Share, Size, Text, Words
from camssf_fleet.compare import (
    ACCEPTED,
    CAMERA,
    COMPARED,
    LENS,
    NM,
    UNIT,
    counts_in_words,
    curves_in,
    may_be,
    units_of,
)
from camssf_fleet.registry import Registry, Wanted

FALSE_ALARMS = 0.01
"""Probability of an alarm for a unit that does not drift, over all features together."""
SMALLEST_DRIFT = 1.0
"""nm: a smaller drift raises no alarm, even if significant; errors of a lamp or chart table are as large."""
FEWEST = 4
"""Smallest number of results to test for a drift."""
FEATURES = tuple(f"{colour} {what}" for colour in CHANNELS for what in ("centre", "width"))
LARGE_CHANGE = 5.0
"""nm: such a change is warned of although the scatter of calibrations is not known."""
OUTCOMES = (DRIFT, NO_DRIFT, UNDECIDED) = ("drift", "no_drift", "undecided")
DOUBTFUL, NO_CURVES, NO_TIME, NO_UNIT = "doubtful", "no curves", "no time", "unit not certain"
"""Why a result was left out."""
ADVICE = {
    DOUBTFUL: "Clear its doubt with another photo, or count doubtful results by --doubtful.",
    NO_CURVES: "Take another photo of the unit: a refused one tells nothing of a drift.",
    NO_TIME: "Add it again with the time of its photo (--captured).",
    NO_UNIT: "Add it again with its --camera-id and --lens.",
}
"""What to do if the newest result was left out."""
COLUMNS = ("key", "captured", "added", "status", "code", "reason", "list_sort(inputs) AS inputs")


@dataclass(frozen=True)
class _Dated:
    """A result of the unit, or possibly of it: its row, with `values` of FEATURES, None without curves."""

    key: str
    captured: datetime | None
    added: datetime
    status: str
    code: str
    reason: str
    inputs: list[str]
    unit: tuple[str, ...]
    values: Floats | None

    @property
    def time(self) -> datetime:
        """When it was captured; if that is unknown, when it was added."""
        return self.captured or self.added


@dataclass(frozen=True)
class Drift:
    """One feature of one unit over time.

    Attributes:
        feature: one of FEATURES, nm.
        results: number of results.
        days: from the first to the last result.
        slope: of the fitted line, nm a year.
        slope_error: standard error of `slope`, nm a year; None if all results have one time.
        change: slope times the time from the first to the last result, nm.
        step: last value minus the mean of those before it, nm.
        p_trend, p_step: two-sided p-values of the slope and of the step.
        alarm: "trend", "step", or "" for none.
    """

    feature: Text
    results: Count
    days: Number
    slope: Number
    slope_error: Size | None
    change: Number
    step: Number
    p_trend: Share
    p_step: Share
    alarm: Annotated[str, Words(("", "trend", "step"))]


@dataclass(frozen=True)
class LeftOut:
    """A result of the unit, or possibly of the unit, that was left out of the test for drift.

    Attributes:
        key: SHA-256 of its file.
        captured: ISO 8601 in UTC; None if unknown.
        status, code, reason: of its verdict.
        why: DOUBTFUL, NO_CURVES (refused), NO_TIME or NO_UNIT (no camera id or lens, where other results name one).
        newest: no counted result is certainly newer. A result without a time counts as captured when it was added. A
            result of the same photos as a counted one is not new.
        steps: FEATURES minus their mean over the counted results, nm; None without curves.
    """

    key: Text
    captured: Text | None
    status: Text
    code: Text
    reason: Text
    why: Annotated[str, Words((DOUBTFUL, NO_CURVES, NO_TIME, NO_UNIT))]
    newest: bool
    steps: dict[Text, Number] | None


@dataclass(frozen=True)
class UnitDrift:
    """One unit over time.

    Attributes:
        features: each of FEATURES, from the results that count.
        doubtful: number of these that are doubtful.
        left_out: results that do not count, by time.
    """

    features: tuple[Drift, ...]
    doubtful: int
    left_out: tuple[LeftOut, ...]

    @property
    def alarms(self) -> tuple[Drift, ...]:
        """The features that drift."""
        return tuple(feature for feature in self.features if feature.alarm)

    @property
    def outcome(self) -> str:
        """One of OUTCOMES: UNDECIDED if there is no alarm but the newest result was left out."""
        if self.alarms:
            return DRIFT
        return UNDECIDED if any(result.newest for result in self.left_out) else NO_DRIFT


def drift_of(registry: Registry, unit: Unit, *, statuses: Sequence[str] = ACCEPTED) -> UnitDrift:
    """The features of a unit over time, and the results that were left out.

    Args:
        registry: the results.
        unit: its serial number, and what else is needed if several units have that number; "" for any.
        statuses: results with these statuses count.

    Raises:
        InvalidArgument: fewer than FEWEST results with a time, or results of several units.
    """
    serial, (where, parameters) = unit.serial, Wanted(unit).where()
    columns = ", ".join((*UNIT, *COLUMNS, *CHANNELS))
    rows = registry.query(f"SELECT {columns} FROM rows WHERE {where} ORDER BY captured, key", parameters)
    results = [_dated(registry, row) for row in rows]
    counted = [result for result in results if result.status in statuses and result.values is not None]
    units = units_of([result.unit for result in counted])
    own = {name for name in units if name and may_be((name[CAMERA], name[LENS]), (unit.camera_id, unit.lens))}
    if len(own) > 1:
        raise _several(serial, sorted(own))
    used = [result for result, name in zip(counted, units, strict=True) if name in own and result.captured]
    keys, names = {result.key for result in used}, tuple(getattr(unit, name) for name in UNIT)
    rest = [
        result
        for result in results
        if result.key not in keys and all(may_be(result.unit, name) for name in (names, *own))
    ]
    rest.sort(key=lambda result: (result.time, result.key))
    left_out = tuple(_left_out(result, used, statuses) for result in rest)
    if not own and not left_out:
        raise InvalidArgument(
            f"The registry has no result of a unit with the serial number {serial}"
            f"{' and the other options' if unit != Unit(serial=serial) else ''}.",
            "See `camssf registry list` for those that it has.",
        )
    if len(used) < FEWEST:
        more = f" Left out: {counts_in_words(Counter(result.why for result in left_out))}." if left_out else ""
        count = f"{len(used)} {' or '.join(statuses)} result{' has' if len(used) == 1 else 's have'} a time"
        raise InvalidArgument(
            f"A drift is not testable yet: of the unit {serial} {count}, and it needs {FEWEST}.{more}",
            "Add more, each with the time of its photo (--captured).",
        )
    days = np.array([result.time.timestamp() / 86400 for result in used])
    doubtful = sum(result.status == "doubtful" for result in used)
    return UnitDrift(drifts(days, _values(used)), doubtful, left_out)


def _dated(registry: Registry, row: dict[str, Any]) -> _Dated:
    *unit, key, captured, added, status, code, reason, inputs, red, _green, _blue = row.values()
    values = features(curves_in(registry, row)[None][..., COMPARED])[0] if red else None
    names = tuple(name or "" for name in unit)
    return _Dated(key, captured, added, status, code, reason, inputs, names, values)


def _values(results: Sequence[_Dated]) -> Floats:
    """(n, 6) FEATURES of results that have curves."""
    return np.stack([result.values for result in results if result.values is not None])


def _several(serial: str, units: Sequence[tuple[str, ...]]) -> InvalidArgument:
    named = {name: sorted({unit[i] for unit in units}) for i, name in enumerate(UNIT)}
    differ = {name: words for name, words in named.items() if len(words) > 1}
    words = "; ".join(f"{name} {', '.join(map(repr, values))}" for name, values in differ.items())
    options = " or ".join(f"--{name.replace('_', '-')}" for name in differ)
    return InvalidArgument(f"Several units have the serial number {serial}: {words}.", f"Name one by {options}.")


def _left_out(result: _Dated, used: Sequence[_Dated], statuses: Sequence[str]) -> LeftOut:
    """Why a result does not count, beside the results `used`, which do, by time."""
    values, steps = result.values, None
    why = NO_TIME if result.captured is None else NO_UNIT
    if values is None or result.status not in statuses:
        why = NO_CURVES if values is None else DOUBTFUL
    repeated = bool(result.inputs) and result.inputs in [other.inputs for other in used]
    if used and values is not None:
        steps = dict(zip(FEATURES, (values - _values(used).mean(axis=0)).tolist(), strict=True))
    return LeftOut(
        key=result.key,
        captured=None if result.captured is None else f"{result.captured:%Y-%m-%dT%H:%M:%SZ}",
        status=result.status or "",
        code=result.code or "",
        reason=result.reason or "",
        why=why,
        newest=not used or (result.time >= used[-1].time and not repeated),
        steps=steps,
    )


# Features over time


def features(curves: Floats) -> Floats:
    """(n, 6) FEATURES, nm, of (n, 3, wavelengths) curves: each channel's centre of mass and standard deviation."""
    nm, s = NM[COMPARED], np.maximum(curves, 0.0)
    weight = s.sum(axis=-1)
    centre = (s @ nm) / weight
    width = np.sqrt(np.sum(s * (nm - centre[..., None]) ** 2, axis=-1) / weight)
    return np.stack([centre, width], axis=-1).reshape(len(curves), -1)


def drifts(days: Floats, values: Floats) -> tuple[Drift, ...]:
    """Test each feature for a linear trend, and its last value against those before.

    Both are t tests, each at FALSE_ALARMS divided by the number of tests (Bonferroni). The variance is estimated from
    the results themselves, so it includes the scatter from light, chart position and noise.

    Args:
        days: (n,) increasing, n at least FEWEST.
        values: (n, 6) FEATURES.
    """
    n, (first, last) = len(days), (days[0], days[-1])
    level = FALSE_ALARMS / (2 * len(FEATURES))
    tests = []
    for name, y in zip(FEATURES, values.T, strict=True):
        x = days - days.mean()
        slope, error, p_trend = 0.0, None, 1.0
        if np.sum(x**2) > 0:
            slope = float(x @ y / np.sum(x**2))
            rest = y - y.mean() - slope * x
            error = float(np.sqrt(np.sum(rest**2) / (n - 2) / np.sum(x**2)))
            p_trend = _two_sided(slope, error, n - 2)
        before = y[:-1]
        step = float(y[-1] - before.mean())
        p_step = _two_sided(step, float(before.std(ddof=1) * np.sqrt(1 + 1 / (n - 1))), n - 2)
        change = slope * float(last - first)
        trend = p_trend < level and abs(change) >= SMALLEST_DRIFT
        jump = p_step < level and abs(step) >= SMALLEST_DRIFT
        alarm = "trend" if trend and (not jump or p_trend <= p_step) else "step" if jump else ""
        tests.append(
            Drift(
                name,
                n,
                float(last - first),
                slope * 365.25,
                None if error is None else error * 365.25,
                change,
                step,
                p_trend,
                p_step,
                alarm,
            )
        )
    return tuple(tests)


@dataclass(frozen=True)
class LastChange:
    """The largest change of a unit's last result against those before, in parts of what can be seen.

    Attributes:
        feature: one of FEATURES.
        change: last value minus the mean of those before, nm.
        detectable: the smallest change that would be significant, nm; None if the scatter is not known.
        warns: whether the change is as large.
    """

    feature: str
    change: float
    detectable: float | None
    warns: bool


@dataclass(frozen=True, eq=False)
class RepeatScatter:
    """The scatter of FEATURES between results of one unit, pooled over units.

    Attributes:
        squares: (6,) sums of squares about each unit's mean, nm².
        freedom: degrees of freedom.
    """

    squares: Floats
    freedom: int

    @classmethod
    def of(cls, units: Sequence[Floats]) -> RepeatScatter:
        """The scatter of units, each (n, 6) FEATURES, n from 1 on."""
        squares = [np.sum((unit - unit.mean(axis=0)) ** 2, axis=0) for unit in units]
        return cls(sum(squares, np.zeros(len(FEATURES))), sum(len(unit) - 1 for unit in units))

    def without(self, unit: Floats) -> RepeatScatter:
        """The scatter of the other units."""
        own = RepeatScatter.of([unit])
        return RepeatScatter(np.maximum(self.squares - own.squares, 0.0), self.freedom - own.freedom)


def last_change(values: Floats, scatter: RepeatScatter) -> LastChange:
    """The last result of a unit against those before: a t test of each feature, as the step in `drifts`.

    Args:
        values: (n, 6) FEATURES by time, n at least 2. From FEWEST on their own scatter counts.
        scatter: of all units; with less than FEWEST - 2 degrees of freedom besides this unit's only a LARGE_CHANGE is
            warned of.
    """
    from scipy.special import stdtrit

    n, before = len(values), values[:-1]
    scatter = RepeatScatter.of([before]) if n >= FEWEST else scatter.without(values)
    freedom = scatter.freedom
    change = values[-1] - before.mean(axis=0)
    if freedom < FEWEST - 2:
        at = int(np.argmax(np.abs(change)))
        return LastChange(FEATURES[at], float(change[at]), None, bool(abs(change[at]) >= LARGE_CHANGE))
    quantile = stdtrit(freedom, 1 - FALSE_ALARMS / (4 * len(FEATURES)))
    limit = np.maximum(SMALLEST_DRIFT, quantile * np.sqrt(scatter.squares / freedom * (1 + 1 / (n - 1))))
    at = int(np.argmax(np.abs(change) / limit))
    return LastChange(FEATURES[at], float(change[at]), float(limit.max()), bool(abs(change[at]) >= limit[at]))


def _two_sided(value: float, error: float, freedom: int) -> float:
    from scipy.special import stdtr

    if value == 0:
        return 1.0
    return float(2 * stdtr(freedom, -abs(value) / error)) if error > 0 else 0.0
