"""Reads a whole registry for its page, model by model, so that only one model's curves are in memory."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np

from camssf.grid import Floats
from camssf.photo.read.unit import Unit
from camssf.report.sections.text import named
from camssf_fleet.compare import ACCEPTED, UNIT, between_units, by_unit, read_curves
from camssf_fleet.drift import FALSE_ALARMS, FEWEST, Drift, RepeatScatter, drifts, features, last_change
from camssf_fleet.page import MOST_ROWS, FleetDrift, FleetModel, FleetUnit, NotAccepted, fleet_html
from camssf_fleet.registry import Registry, Wanted

NOT_ACCEPTED = (
    "SELECT trim(concat_ws(' ', make, model, serial)) AS unit, name, photos, status, code, reason, added FROM jobs "
    "QUALIFY row_number() OVER (PARTITION BY name ORDER BY added DESC) = 1 "
    "UNION ALL SELECT trim(concat_ws(' ', make, model, serial)), name, [], status, code, reason, added FROM rows "
    "WHERE name = ''"
)
"""How the newest job of each name ended, and the results that no batch made."""


@dataclass(frozen=True)
class _Timed:
    """A unit's accepted results with curves and a time: days, increasing, and (n, 6) FEATURES."""

    days: Floats
    values: Floats


def fleet_page(registry: Registry, *, days: float = 365.0, now: datetime | None = None) -> str:
    """The page of a registry, one self-contained HTML file.

    Args:
        registry: the results.
        days: a unit is due for calibration if its newest accepted result is older.
        now: time of the page, with its zone; the current time unless given.
    """
    now = now or datetime.now(UTC)
    names = registry.query("SELECT DISTINCT make, model FROM rows ORDER BY make, model")
    read = [_model(registry, Unit(**name)) for name in names]
    scatter = RepeatScatter.of([unit.values for _, units in read for unit in units.values()])
    models = []
    for model, timed in read:
        units = tuple(replace(unit, **_drift(timed.get(unit.name), scatter)) for unit in model.units)
        models.append(replace(model, units=units))
    models.sort(key=lambda model: (-model.statuses.total(), model.name))
    return fleet_html(
        models, _reasons(registry), _not_accepted(registry), days=days, now=now, false_alarms=FALSE_ALARMS
    )


def _model(registry: Registry, model: Unit) -> tuple[FleetModel, dict[str, _Timed]]:
    """One model, its units without their drifts; and what drifts are tested on, by unit."""
    where, values = Wanted(model).where()
    names = f"{', '.join(UNIT)}, coalesce(captured, added) AS time, captured, status"
    sql = f"SELECT {names} FROM rows WHERE {where} ORDER BY key"
    rows = registry.arrays(sql, values)
    *_, times, captured, statuses = rows.values()
    dated = (statuses == "accepted") & ~np.ma.getmaskarray(captured)
    curves = read_curves(registry, Wanted(model, statuses=ACCEPTED), (*UNIT, "captured"))
    of_units, _ = by_unit(curves.columns, model)
    when, timed = curves.columns["captured"], dict[str, _Timed]()
    for unit, places in of_units.items():
        ordered = sorted((i for i in places if not np.ma.getmaskarray(when)[i]), key=lambda i: when[i])
        if ordered:
            seconds = np.asarray(when[ordered].astype("datetime64[s]").astype(float))
            timed[_name(unit)] = _Timed(seconds / 86400, features(curves.curves[ordered]))
    spread = None
    if len(of_units) > 1:
        observed, _, between, low, high = between_units([curves.curves[places] for places in of_units.values()])
        spread = np.stack([observed if between is None else between, low, high])
    units = []
    for unit, places in by_unit(rows, model)[0].items():
        last = max(places, key=lambda i: times[i])
        accepted = captured[[i for i in places if dated[i]]]
        newest = _time(accepted.max()) if len(accepted) else None
        untimed = sum(statuses[i] == "accepted" and not dated[i] for i in places)
        units.append(FleetUnit(_name(unit), newest, _time(times[last]), str(statuses[last]), untimed))
    return FleetModel(named(model.make, model.model), Counter(map(str, statuses)), tuple(units), spread), timed


def _name(unit: tuple[str, ...]) -> str:
    _, _, camera_id, serial, lens = unit
    return " ".join(filter(None, (serial, camera_id, lens)))


def _time(value: Any) -> datetime:
    time: datetime = value.astype("datetime64[s]").item()
    return time.replace(tzinfo=UTC)


def _drift(timed: _Timed | None, scatter: RepeatScatter) -> dict[str, Any]:
    """What is known of a unit's drift, as fields of FleetUnit."""
    count = 0 if timed is None else len(timed.days)
    if timed is None or count < 2:
        return {"timed": count}
    tests = drifts(timed.days, timed.values) if count >= FEWEST else ()
    alarms = tuple(_alarm(test) for test in tests if test.alarm)
    return {"timed": count, "alarms": alarms, "change": last_change(timed.values, scatter)}


def _alarm(drift: Drift) -> FleetDrift:
    change = drift.change if drift.alarm == "trend" else drift.step
    return FleetDrift(drift.feature, change, drift.alarm, drift.results, drift.days)


def _reasons(registry: Registry) -> list[tuple[str, int, int]]:
    """Codes, and numbers of doubtful and of refused results; the most frequent first."""
    counts = ", ".join(f"count(*) FILTER (status = '{status}') AS {status}" for status in ("doubtful", "refused"))
    reasons = registry.query(
        f"SELECT code, {counts} FROM rows WHERE code <> '' GROUP BY code ORDER BY count(*) DESC, code"
    )
    return [(code, doubtful, refused) for code, doubtful, refused in (row.values() for row in reasons)]


def _not_accepted(registry: Registry) -> tuple[list[NotAccepted], int]:
    """The newest captures that gave no accepted result, refused ones first, and the number of all."""
    sql = f"FROM ({NOT_ACCEPTED}) WHERE status <> 'accepted'"
    rows = registry.query(
        f"SELECT unit, name, photos, status, code, reason {sql} "
        f"ORDER BY status = 'doubtful', added DESC, name LIMIT {MOST_ROWS}"
    )
    (count,) = registry.query(f"SELECT count(*) AS count {sql}")
    shown = [
        NotAccepted(row["unit"] or row["name"], ", ".join(row["photos"] or [row["name"]]), *list(row.values())[3:])
        for row in rows
    ]
    return shown, count["count"]
