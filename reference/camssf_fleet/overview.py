"""Reads a whole registry for its page, model by model, so that only one model's curves are in memory."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime

import numpy as np

from camssf.photo.read.unit import Unit
from camssf.report.sections.text import named
from camssf_fleet.compare import ACCEPTED, UNIT, between_units, by_unit, read_curves
from camssf_fleet.drift import FALSE_ALARMS, FEWEST, Drift, drifts, features
from camssf_fleet.page import FleetDrift, FleetModel, FleetUnit, fleet_html
from camssf_fleet.registry import Registry, Wanted


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
        (_model(registry, Unit(**name)) for name in names),
        key=lambda model: (-model.statuses.total(), model.name),
    )
    return fleet_html(models, _reasons(registry), days=days, now=now, fewest=FEWEST, false_alarms=FALSE_ALARMS)


def _model(registry: Registry, model: Unit) -> FleetModel:
    """One model: its results by status, its units, their spread and their drifts."""
    where, values = Wanted(model).where()
    rows = registry.arrays(f"SELECT {', '.join(UNIT)}, captured, status FROM rows WHERE {where} ORDER BY key", values)
    *_, captured, statuses = rows.values()
    timed = (statuses == "accepted") & ~np.ma.getmaskarray(captured)
    found = read_curves(registry, Wanted(model, statuses=ACCEPTED), (*UNIT, "captured"))
    of_units, _ = by_unit(found.columns, model)
    *_, times = found.columns.values()
    alarms, counts = {}, dict[tuple[str, ...], int]()
    for unit, places in of_units.items():
        dated = [i for i in places if not np.ma.getmaskarray(times)[i]]
        dated.sort(key=lambda i: times[i])
        counts[unit] = len(dated)
        if len(dated) >= FEWEST:
            seconds = times[dated].astype("datetime64[s]").astype(float)
            tests = drifts(np.asarray(seconds) / 86400, features(found.curves[dated]))
            alarms[unit] = tuple(_alarm(test) for test in tests if test.alarm)
    spread = None
    if len(of_units) > 1:
        observed, _, between, low, high = between_units([found.curves[places] for places in of_units.values()])
        spread = np.stack([observed if between is None else between, low, high])
    units = []
    for unit, places in by_unit(rows, model)[0].items():
        accepted = captured[[i for i in places if timed[i]]]
        newest = accepted.max().astype("datetime64[s]").item().replace(tzinfo=UTC) if len(accepted) else None
        _, _, camera_id, serial, lens = unit
        name = " ".join(filter(None, (serial, camera_id, lens)))
        units.append(FleetUnit(name, newest, counts.get(unit, 0), alarms.get(unit, ())))
    return FleetModel(named(model.make, model.model), Counter(map(str, statuses)), tuple(units), spread)


def _alarm(drift: Drift) -> FleetDrift:
    change = drift.change if drift.alarm == "trend" else drift.step
    return FleetDrift(drift.feature, change, drift.alarm, drift.results, drift.days)


def _reasons(registry: Registry) -> list[tuple[str, int, int]]:
    """Codes, and numbers of doubtful and of refused results; the most frequent first."""
    counts = ", ".join(f"count(*) FILTER (status = '{status}') AS {status}" for status in ("doubtful", "refused"))
    found = registry.query(
        f"SELECT code, {counts} FROM rows WHERE code <> '' GROUP BY code ORDER BY count(*) DESC, code"
    )
    return [(code, doubtful, refused) for code, doubtful, refused in (row.values() for row in found)]
