"""Renders a registry as one page: its models, how their units differ, drifts, what is due, what was not accepted.

`camssf_fleet.overview` reads the registry into the products of this file.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from camssf.error_codes import explain_code
from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS, Floats
from camssf.report.page import render, style
from camssf.report.sections.text import number
from camssf.version import __version__

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
        timed: number of its accepted results with curves and a time.
        alarms: features that drift.
    """

    name: str
    newest: datetime | None
    timed: int = 0
    alarms: tuple[FleetDrift, ...] = ()


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
    *,
    days: float,
    now: datetime,
    fewest: int,
    false_alarms: float,
) -> str:
    """The page of these models.

    Args:
        models: in the order of the page.
        reasons: code, and numbers of doubtful and of refused results.
        days: a unit is due for calibration if its newest accepted result is older.
        now: time of the page.
        fewest: smallest number of results that are tested for a drift.
        false_alarms: probability of an alarm for a unit that does not drift.
    """
    before, every = now - timedelta(days=days), [(model, unit) for model in models for unit in model.units]
    due = [(model, unit) for model, unit in every if unit.newest is None or unit.newest < before]
    due.sort(key=lambda each: (each[1].newest is not None, each[1].newest or now))
    drifting = [[*_unit_cells(*each), *_drift_cells(alarm)] for each in every for alarm in each[1].alarms]
    tested = sum(unit.timed >= fewest for _, unit in every)
    spread = [model for model in models if model.spread is not None]
    total = sum((model.statuses for model in models), Counter[str]())
    shown: dict[str, Any] = {
        "title": "Fleet",
        "style": style(),
        "version": __version__,
        "big": [
            (f"{total.total():,}", "results"), (f"{len(models):,}", "models"), (f"{len(every):,}", "units"),
            *((f"{total[status]:,}", status) for status in STATUSES),
            (f"{sum(bool(unit.alarms) for _, unit in every):,}", f"of {tested:,} tested units drift")
            if tested
            else ("not testable", "whether units drift"),
            (f"{len(due):,}", "units due for calibration"),
        ],
        "at": f"{now:%Y-%m-%d %H:%M} UTC",
        "days": f"{days:g}",
        "models": [
            [model.name, len(model.units), *(model.statuses[status] for status in STATUSES)] for model in models
        ],
        "scale": str(number(_largest(spread[:MOST_ROWS]), 2)),
        "spread": [_spread_row(model, _largest(spread[:MOST_ROWS])) for model in spread[:MOST_ROWS]],
        "more_spread": max(0, len(spread) - MOST_ROWS),
        "drifting": drifting,
        "tested": tested,
        "untested": _untested(Counter(unit.timed for _, unit in every if unit.timed < fewest)),
        "false_alarms": f"{false_alarms:.0%}".replace("%", " %"),
        "fewest": fewest,
        "due": [[*_unit_cells(*each), _day(each[1].newest)] for each in due],
        "reasons": [[code, *counts, _advice(code)] for code, *counts in reasons],
        "most": MOST_ROWS,
    }  # fmt: skip
    return render("fleet.html.jinja", shown)


def _untested(units: Counter[int]) -> str:
    """Numbers of units that are not testable, by their number of results."""
    words = {0: "no calibration with a time", 1: "one calibration"}
    return ", ".join(
        f"{count:,} unit{' has' if count == 1 else 's have'} {words.get(number, f'{number} calibrations')}"
        for number, count in sorted(units.items())
    )


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


def _day(time: datetime | None) -> str:
    return "none with a time" if time is None else f"{time:%Y-%m-%d}"


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
