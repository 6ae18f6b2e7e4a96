"""Renders a registry as one page: its models, how their units differ, drifts, what is due, what was not accepted.

`camssf_fleet.overview` reads the registry into the products of this file.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from camssf.error_codes import explain_code
from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS, Floats
from camssf.report.page import render, style
from camssf.report.sections.text import number
from camssf.version import __version__
from camssf_fleet.compare import many
from camssf_fleet.drift import LastChange

STATUSES = ("accepted", "doubtful", "refused")
MOST_ROWS = 50
"""Largest number of rows of a table; the rest is counted."""


@dataclass(frozen=True)
class FleetDrift:
    """A feature of a unit that drifts.

    Attributes:
        feature: in words.
        change: nm; of the whole time for a trend, of the last result for a step.
        alarm: "trend" or "step".
        results: number of results.
        days: from the first to the last.
    """

    feature: str
    change: float
    alarm: str
    results: int
    days: float


@dataclass(frozen=True)
class FleetUnit:
    """One unit of a model.

    Attributes:
        name: serial number, camera id and lens.
        newest: time of its newest accepted result; None without one, or if its time is unknown.
        last: time of its last result, whatever its verdict; that of adding if its own is unknown.
        status: verdict of the last result.
        untimed: number of its accepted results without a time.
        timed: number of its accepted results with curves and a time.
        alarms: features that drift.
        change: of the last of these results against those before; None for fewer than two.
    """

    name: str
    newest: datetime | None
    last: datetime
    status: str
    untimed: int = 0
    timed: int = 0
    alarms: tuple[FleetDrift, ...] = ()
    change: LastChange | None = None

    @property
    def warns(self) -> bool:
        """Whether it drifts, or its last result differs from those before."""
        return bool(self.alarms) or (self.change is not None and self.change.warns)


@dataclass(frozen=True)
class NotAccepted:
    """A capture without an accepted result.

    Attributes:
        unit: make, model and serial number; the name in the manifest if these are unknown.
        photos: as the manifest names them.
        status, code, reason: of the verdict.
    """

    unit: str
    photos: str
    status: str
    code: str
    reason: str


@dataclass(frozen=True)
class FleetModel:
    """One model of the registry.

    Attributes:
        name: make and model.
        statuses: numbers of results.
        units: those with a serial number.
        spread: standard deviation between units and its 95 % interval, (3, 3): rows value, low, high; columns red,
            green, blue; None for fewer than two units.
    """

    name: str
    statuses: Counter[str]
    units: tuple[FleetUnit, ...]
    spread: Floats | None


def fleet_html(
    models: list[FleetModel],
    reasons: list[tuple[str, int, int]],
    not_accepted: tuple[list[NotAccepted], int],
    *,
    days: float,
    now: datetime,
    false_alarms: float,
) -> str:
    """The page of these models.

    Args:
        models: in the order of the page.
        reasons: code, and numbers of doubtful and of refused results.
        not_accepted: captures without an accepted result, and the number of all of them.
        days: a unit is due for calibration if its newest accepted result is older.
        now: time of the page.
        false_alarms: probability of an alarm for a unit that does not drift.
    """
    every = [(model, unit) for model in models for unit in model.units]
    every.sort(key=lambda pair: (not pair[1].warns, _due(pair[1], days) or datetime.min.replace(tzinfo=UTC)))
    due = sum((_due(unit, days) or now) <= now for _, unit in every)
    drifting = [[*_unit_cells(model, unit), *_drift_cells(alarm)] for model, unit in every for alarm in unit.alarms]
    tested = sum(unit.change is not None for _, unit in every)
    spread = [model for model in models if model.spread is not None]
    total = sum((model.statuses for model in models), Counter[str]())
    captures, count = not_accepted
    shown: dict[str, Any] = {
        "title": "Fleet",
        "style": style(),
        "version": __version__,
        "big": [
            (f"{total.total():,}", "results"), (f"{len(models):,}", "models"), (f"{len(every):,}", "units"),
            *((f"{total[status]:,}", status) for status in STATUSES),
            (f"{sum(unit.warns for _, unit in every):,}", f"of {tested:,} tested units changed")
            if tested
            else ("not testable", "whether units change"),
            (f"{due:,}", "units due for calibration"),
        ],
        "at": f"{now:%Y-%m-%d %H:%M} UTC",
        "days": f"{days:g}",
        "units": [
            [", ".join(_unit_cells(model, unit)), *_state_cells(unit, days, now)] for model, unit in every[:MOST_ROWS]
        ],
        "more_units": max(0, len(every) - MOST_ROWS),
        "models": [
            [model.name, len(model.units), *(model.statuses[status] for status in STATUSES)] for model in models
        ],
        "scale": str(number(_largest(spread[:MOST_ROWS]), 2)),
        "spread": [_spread_row(model, _largest(spread[:MOST_ROWS])) for model in spread[:MOST_ROWS]],
        "more_spread": max(0, len(spread) - MOST_ROWS),
        "drifting": drifting,
        "false_alarms": f"{false_alarms:.0%}".replace("%", " %"),
        "reasons": [[code, *counts, _advice(code)] for code, *counts in reasons],
        "captures": [list(vars(capture).values()) for capture in captures],
        "more_captures": max(0, count - len(captures)),
        "most": MOST_ROWS,
    }  # fmt: skip
    return render("fleet.html.jinja", shown)


def _due(unit: FleetUnit, days: float) -> datetime | None:
    """When a unit is due for calibration; None for now, without an accepted result."""
    return None if unit.newest is None else unit.newest + timedelta(days=days)


def _state_cells(unit: FleetUnit, days: float, now: datetime) -> tuple[str, ...]:
    """Last result with its verdict, the days since and the next calibration; drift."""
    due, since = _due(unit, days), many(max(0, (now - unit.last).days), "day")
    following = "now" if due is None or due <= now else f"{due:%Y-%m-%d}"
    following = "unknown" if due is None and unit.untimed else following
    return f"{unit.status}, {unit.last:%Y-%m-%d}, {since} ago; next {following}", _drift_words(unit)


def _drift_words(unit: FleetUnit) -> str:
    """What is known of a unit's drift."""
    if unit.change is None and unit.untimed:
        return f"not testable: {many(unit.untimed, 'accepted result')} without a time"
    if unit.change is None:
        return f"not testable yet: {unit.timed} of 2 calibrations"
    change = f"{unit.change.feature} {unit.change.change:+.1f} nm".replace("-", "\u2212")
    if unit.alarms:
        return f"drifts, below: {', '.join(alarm.feature for alarm in unit.alarms)}"
    against = "the first" if unit.timed == 2 else f"the {unit.timed - 1} before"
    if unit.change.warns:
        return f"changed against {against}: {change}"
    if unit.change.detectable is None:
        return f"{change} against {against}; too few repeats to say what that means"
    return f"none found; smaller than {unit.change.detectable:.1f} nm cannot be seen"


def _unit_cells(model: FleetModel, unit: FleetUnit) -> tuple[str, str]:
    return unit.name, model.name


def _drift_cells(drift: FleetDrift) -> tuple[str, str, str]:
    change = f"{drift.change:+.1f} nm, {drift.alarm}".replace("-", "\u2212")
    return drift.feature, change, f"{drift.results} in {drift.days:.0f} days"


def _advice(code: str) -> str:
    try:
        return explain_code(code).do[0]
    except InvalidArgument:  # of another release
        return ""


def _largest(models: list[FleetModel]) -> float:
    """End of the scale: the largest limit of an interval, as a fraction of the peak."""
    return max((float(model.spread[2].max()) for model in models if model.spread is not None), default=0.0) or 1.0


def _spread_row(model: FleetModel, largest: float) -> dict[str, Any]:
    """Name; of each channel the value and its interval as text, and their places on the scale, in %."""
    assert model.spread is not None
    at, low, high = (100 * model.spread / largest).tolist()
    texts = [[str(number(value, 2)) for value in channel] for channel in model.spread.T]
    return {
        "name": model.name,
        "cells": [f"{value} ({start} to {end})" for value, start, end in texts],
        "dots": list(zip(CHANNELS, (text[0] for text in texts), at, low, high, strict=True)),
    }
