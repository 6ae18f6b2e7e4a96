"""Reads a whole registry for its page, model by model, so that only one model's curves are in memory."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime

import numpy as np

from camssf.fleet.compare import ACCEPTED, UNIT, between_units, by_unit, read_curves
from camssf.fleet.drift import FALSE_ALARMS, FEWEST, Drift, drifts, features
from camssf.fleet.registry import Registry, Wanted
from camssf.photo.read.unit import Unit
from camssf.report.fleet import FleetDrift, FleetModel, FleetUnit, fleet_html
from camssf.report.sections.text import camera_name


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
    return fleet_html(models, _reasons(registry), days=days, now=now, fewest=FEWEST, false_alarms=FALSE_ALARMS)


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
            alarms[unit] = tuple(_alarm(each) for each in tests if each.alarm)
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


def _alarm(drift: Drift) -> FleetDrift:
    change = drift.change if drift.alarm == "trend" else drift.step
    return FleetDrift(drift.feature, change, drift.alarm, drift.results, drift.days)


def _reasons(registry: Registry) -> list[tuple[str, int, int]]:
    """Codes, and numbers of doubtful and of refused results; the most frequent first."""
    counts = ", ".join(f"count(*) FILTER (status = '{status}') AS {status}" for status in ("doubtful", "refused"))
    found = registry.query(
        f"SELECT code, {counts} FROM rows WHERE code <> '' GROUP BY code ORDER BY count(*) DESC, code"
    )
    return [(each["code"], each["doubtful"], each["refused"]) for each in found]
