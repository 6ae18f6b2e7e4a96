"""Renders a registry as one page: its models, how their units differ, drifts, what is due, what was not accepted.

The registry is read model by model, so that only one model's curves are in memory.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from camssf.error_codes import explain_code
from camssf.errors import InvalidArgument
from camssf.fleet.compare import ACCEPTED, UNIT, between_units, by_unit, read_curves
from camssf.fleet.drift import FALSE_ALARMS, FEWEST, Drift, drifts, features
from camssf.fleet.registry import Registry, Wanted
from camssf.grid import CHANNELS, Floats
from camssf.photo.read.unit import Unit
from camssf.report.page import render, style
from camssf.report.sections.text import camera_name, number
from camssf.version import __version__

STATUSES = ("accepted", "doubtful", "refused")
MOST_ROWS = 50
"""Largest number of rows of a table; the rest is counted."""


@dataclass(frozen=True)
class FleetUnit:
    """One unit of a model.

    Attributes:
        name: serial number, camera id and lens.
        newest: time of its newest accepted result; None without one, or if its time is unknown.
        alarms: features that drift.
    """

    name: str
    newest: datetime | None
    alarms: tuple[Drift, ...] = ()


@dataclass(frozen=True)
class FleetModel:
    """One model of the registry.

    Attributes:
        name: make and model.
        statuses: numbers of results.
        units: those with a serial number.
        tested: number of units tested for a drift.
        spread: standard deviation between units and its 95 % interval, (3, 3): rows value, low, high; columns red,
            green, blue; None for fewer than two units.
    """

    name: str
    statuses: Counter[str]
    units: tuple[FleetUnit, ...]
    tested: int
    spread: Floats | None


def fleet_page(registry: Registry, *, days: float = 365.0, now: datetime | None = None) -> str:
    """The page of a registry, one self-contained HTML file.

    Args:
        registry: the results.
        days: a unit is due for calibration if its newest accepted result is older.
        now: time of the page, with its zone; the current time unless given.
    """
    now = now or datetime.now(UTC)
    names = registry.query("SELECT DISTINCT make, model FROM rows ORDER BY make, model")
    models = sorted(
        (_model(registry, Unit(make=each["make"], model=each["model"])) for each in names),
        key=lambda model: (-model.statuses.total(), model.name),
    )
    return fleet_html(models, _reasons(registry), days=days, now=now)


def fleet_html(models: list[FleetModel], reasons: list[list[object]], *, days: float, now: datetime) -> str:
    """The page of these models.

    Args:
        models: in the order of the page.
        reasons: rows of the table of codes: code, doubtful, refused, what to do.
        days: as in `fleet_page`.
        now: time of the page.
    """
    before, every = now - timedelta(days=days), [(model, unit) for model in models for unit in model.units]
    due = [(model, unit) for model, unit in every if unit.newest is None or unit.newest < before]
    due.sort(key=lambda each: (each[1].newest is not None, each[1].newest or now))
    drifting = [[*_unit_cells(*each), *_drift_cells(alarm)] for each in every for alarm in each[1].alarms]
    spread = [model for model in models if model.spread is not None]
    total = sum((model.statuses for model in models), Counter[str]())
    shown: dict[str, Any] = {
        "title": "Fleet",
        "style": style(),
        "version": __version__,
        "big": [
            (f"{total.total():,}", "results"), (f"{len(models):,}", "models"), (f"{len(every):,}", "units"),
            *((f"{total[status]:,}", status) for status in STATUSES),
            (f"{sum(bool(unit.alarms) for _, unit in every):,}", "units that drift"),
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
        "tested": sum(model.tested for model in models),
        "false_alarms": f"{FALSE_ALARMS:.0%}".replace("%", " %"),
        "fewest": FEWEST,
        "due": [[*_unit_cells(*each), _day(each[1].newest)] for each in due],
        "reasons": reasons,
        "most": MOST_ROWS,
    }  # fmt: skip
    return render("fleet.html.jinja", shown)


# Reading


def _model(registry: Registry, model: Unit) -> FleetModel:
    """One model: its results by status, its units, their spread and their drifts."""
    where, values = Wanted(model).where()
    rows = registry.arrays(f"SELECT {', '.join(UNIT)}, captured, status FROM rows WHERE {where} ORDER BY key", values)
    accepted = rows["status"] == "accepted"
    timed = accepted & ~np.ma.getmaskarray(rows["captured"])
    curves = read_curves(registry, Wanted(model, statuses=ACCEPTED), (*UNIT, "captured"))
    of_units, _ = by_unit(curves, model)
    alarms, tested = {}, 0
    for unit, places in of_units.items():
        found = [i for i in places if not np.ma.getmaskarray(curves["captured"])[i]]
        found.sort(key=lambda i: curves["captured"][i])
        if len(found) >= FEWEST:
            tested += 1
            seconds = curves["captured"][found].astype("datetime64[s]").astype(float)
            tests = drifts(np.asarray(seconds) / 86400, features(curves["curves"][found]))
            alarms[unit] = tuple(each for each in tests if each.alarm)
    spread = None
    if len(of_units) > 1:
        observed, _, between, low, high = between_units([curves["curves"][places] for places in of_units.values()])
        spread = np.stack([observed if between is None else between, low, high])
    units = []
    for unit, places in by_unit(rows, model)[0].items():
        times = rows["captured"][[i for i in places if timed[i]]]
        newest = times.max().astype("datetime64[s]").item().replace(tzinfo=UTC) if len(times) else None
        _, _, camera_id, serial, lens = unit
        units.append(FleetUnit(" ".join(filter(None, (serial, camera_id, lens))), newest, alarms.get(unit, ())))
    name = camera_name({"camera": {"make": model.make, "model": model.model}})
    return FleetModel(name, Counter(map(str, rows["status"])), tuple(units), tested, spread)


def _reasons(registry: Registry) -> list[list[object]]:
    """Code, doubtful, refused, and what to do; the most frequent first."""
    counts = ", ".join(f"count(*) FILTER (status = '{status}') AS {status}" for status in STATUSES[1:])
    found = registry.query(
        f"SELECT code, {counts} FROM rows WHERE code <> '' GROUP BY code ORDER BY count(*) DESC, code"
    )
    return [[each["code"], each["doubtful"], each["refused"], _advice(each["code"])] for each in found]


def _advice(code: str) -> str:
    try:
        return explain_code(code).do[0]
    except InvalidArgument:  # of another release
        return ""


# Writing


def _unit_cells(model: FleetModel, unit: FleetUnit) -> tuple[str, str]:
    return unit.name, model.name


def _drift_cells(drift: Drift) -> tuple[object, ...]:
    moved = drift.change if drift.alarm == "trend" else drift.step
    change = f"{moved:+.1f} nm, {drift.alarm}".replace("-", "\u2212")
    return drift.feature, change, f"{drift.results} in {drift.days:.0f} days"


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
