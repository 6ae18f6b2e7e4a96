"""Compares results in a registry: how the units of a model differ.

Curves are on the registry's grid: every 5 nm, each channel's peak = 1. They are compared from 400 to 700 nm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS, WAVELENGTHS, Floats
from camssf.photo.read.unit import Unit
from camssf.shapes import Count, RgbSizes, Text
from camssf_fleet.records import STRIDE
from camssf_fleet.registry import Registry, Wanted

if TYPE_CHECKING:
    pass

NM = WAVELENGTHS[::STRIDE]
COMPARED = (NM >= 400) & (NM <= 700)
ACCEPTED = ("accepted",)

CONFIDENCE = 0.95
LARGEST = 2.0
"""Largest possible absolute value of a curve whose peak is 1; a larger value means a damaged row."""
UNIT = ("make", "model", "camera_id", "serial", "lens")
CAMERA, SERIAL, LENS = (UNIT.index(name) for name in ("camera_id", "serial", "lens"))


@dataclass(frozen=True)
class Spread:
    """How the units of a model differ, as fractions of the peak; each (3,) red, green, blue.

    Attributes:
        model: name of the model.
        units, results: their numbers.
        without_serial: number of results left out because their unit is unknown: no serial number, or no camera id
            or lens while the serial number occurs with several.
        left_out: number of the model's results left out because of their status, by status.
        observed: standard deviation between the units' mean curves, root mean square over 400 to 700 nm.
        repeat: standard deviation between results of one unit; None if no unit has two results.
        between: `observed` without the contribution of `repeat`; None if `repeat` is None.
        low, high: CONFIDENCE interval of `between`, or of `observed` if `between` is None.
    """

    model: Text
    units: Count
    results: Count
    without_serial: Count
    left_out: dict[Text, Count]
    observed: RgbSizes
    repeat: RgbSizes | None
    between: RgbSizes | None
    low: RgbSizes
    high: RgbSizes


# Which results are one unit's


def units_of(rows: Sequence[Sequence[str]]) -> list[tuple[str, ...] | None]:
    """The unit of each row: its make, model, camera_id, serial and lens (UNIT).

    An empty camera_id or lens is filled in from other rows with the same serial number. If these name several, the
    unit is unknown: None, as for a row without a serial number.
    """
    units: list[list[str] | None] = [list(row) if row[SERIAL] else None for row in rows]
    for place, same in ((CAMERA, (0, 1, SERIAL)), (LENS, (0, 1, SERIAL, CAMERA))):
        named: dict[tuple[str, ...], set[str]] = {}
        for unit in filter(None, units):
            named.setdefault(tuple(unit[i] for i in same), set()).update(filter(None, [unit[place]]))
        for number, row in enumerate(units):
            names = named[tuple(row[i] for i in same)] if row else set()
            if row and not row[place] and len(names) > 1:
                units[number] = None
            elif row and names:
                row[place] = row[place] or next(iter(names))
    return [None if row is None else tuple(row) for row in units]


def by_unit(columns: dict[str, Any], wanted: Unit) -> tuple[dict[tuple[str, ...], list[int]], int]:
    """Row indices of each unit with the camera_id and lens, and the number of rows of unknown unit; "" is any."""
    places: dict[tuple[str, ...], list[int]] = {}
    units = units_of(list(zip(*(columns[name] for name in UNIT), strict=True)))
    for i, unit in enumerate(units):
        if unit is not None and may_be((unit[CAMERA], unit[LENS]), (wanted.camera_id, wanted.lens)):
            places.setdefault(unit, []).append(i)
    return places, units.count(None)


def may_be(unit: Sequence[str], other: Sequence[str]) -> bool:
    """Whether two units may be the same: all names that both have are equal."""
    return all(not a or not b or a == b for a, b in zip(unit, other, strict=True))


# Units of a model


def spread(registry: Registry, units: Unit, *, statuses: Sequence[str] = ACCEPTED) -> Spread:
    """How units of a model differ.

    Args:
        registry: the results.
        units: the model, and what else the units have in common; "" for any.
        statuses: results with these statuses count.

    Raises:
        InvalidArgument: the registry has fewer than two units of the model.
    """
    model = units.model
    accepted = read_curves(registry, Wanted(units, statuses=tuple(statuses)), UNIT)
    places, unnamed = by_unit(accepted.columns, units)
    curves = [accepted.curves[rows] for rows in places.values()]
    left_out = other_statuses(registry, Wanted(units), statuses)
    if len(curves) < 2:
        rest = f" Left out: {counts_in_words(left_out)}." if left_out else ""
        raise InvalidArgument(
            f"There is {'1' if curves else 'no'} unit of {model} with a serial number and {' or '.join(statuses)} "
            f"results; a spread needs 2.{rest}",
            "Add results of at least two units, each with its serial number (--serial)"
            + ("; --doubtful counts doubtful ones, too." if "doubtful" in left_out else "."),
        )
    results = sum(map(len, curves))
    return Spread(model, len(curves), results, unnamed, left_out, *between_units(curves))


def between_units(units: Sequence[Floats]) -> tuple[Floats, Floats | None, Floats | None, Floats, Floats]:
    """`observed`, `repeat`, `between`, `low` and `high` of a Spread.

    The variance is averaged over the wavelengths. Neighbouring wavelengths are correlated, so its degrees of freedom
    are Satterthwaite's, from the covariance C of the n units' means: (n - 1) tr(C)² / tr(C²). Few units underestimate
    them, which makes the interval wider.

    Args:
        units: (results, 3, wavelengths) of each unit, at least two units.
    """
    from scipy.special import chdtri

    means = np.stack([unit.mean(axis=0) for unit in units])
    centred = means - means.mean(axis=0)
    n = len(units)
    variance = np.mean(np.sum(centred**2, axis=0) / (n - 1), axis=-1)
    spare = sum(len(unit) - 1 for unit in units)
    within = None
    if spare:
        within = sum(np.sum((unit - unit.mean(axis=0)) ** 2, axis=0) for unit in units) / spare
        within = np.mean(within, axis=-1)
    share = 0.0 if within is None else within * np.mean([1 / len(unit) for unit in units])
    powers = np.stack([np.linalg.svd(centred[:, c], compute_uv=False) ** 2 for c in range(3)])
    alike = np.sum(powers**2, axis=1)
    freedom = (n - 1) * np.divide(powers.sum(axis=1) ** 2, alike, out=np.ones(3), where=alike > 0)
    tail = (1 - CONFIDENCE) / 2
    low, high = (variance * freedom / chdtri(freedom, p) for p in (tail, 1 - tail))
    low, high, alone = (np.sqrt(np.maximum(v - share, 0.0)) for v in (low, high, variance))
    return (
        np.sqrt(variance),
        None if within is None else np.sqrt(within),
        None if within is None else alone,
        low,
        high,
    )


def other_statuses(registry: Registry, wanted: Wanted, statuses: Sequence[str]) -> dict[str, int]:
    """Numbers of results with other statuses than these, by status."""
    where, values = wanted.where()
    counts = registry.query(
        f"SELECT status, count(*) AS n FROM rows WHERE {where} AND NOT list_contains(?, status) "
        "GROUP BY status ORDER BY status",
        [*values, list(statuses)],
    )
    return dict(tuple(row.values()) for row in counts)


def counts_in_words(counts: dict[str, int]) -> str:
    """Format counts as in "2 doubtful, 1 refused"."""
    return ", ".join(f"{n} {word}" for word, n in counts.items())


def many(count: int, word: str) -> str:
    """Format a count as in "1 result", "2 results"."""
    return f"{count} {word}{'' if count == 1 else 's'}"


@dataclass(frozen=True)
class ManyCurves:
    """The results that have curves, by key.

    Attributes:
        columns: the columns that were asked for, n rows.
        curves: (n, 3, wavelengths from 400 to 700 nm).
    """

    columns: dict[str, Any]
    curves: Floats


def read_curves(registry: Registry, wanted: Wanted, also: Sequence[str]) -> ManyCurves:
    """The results that have curves, with the columns `also`."""
    import duckdb

    where, values = wanted.where()
    arrays = ", ".join(f"{colour}::FLOAT[{len(NM)}] AS {colour}" for colour in CHANNELS)
    sql = f"SELECT {', '.join(also)}, {arrays} FROM rows WHERE {where} AND len(red) > 0 ORDER BY key"
    try:
        columns = registry.arrays(sql, values)
    except duckdb.Error:
        _name_damaged_row(registry, where, values)
        raise
    channels = [np.array(list(columns.pop(colour)), dtype=float).reshape(-1, len(NM)) for colour in CHANNELS]
    curves = np.stack(channels, axis=1)
    if not (np.abs(curves) <= LARGEST).all():
        _name_damaged_row(registry, where, values)
    return ManyCurves(columns, curves[..., COMPARED])


def curves_in(registry: Registry, row: dict[str, Any]) -> Floats:
    """(3, 69) curves of a row of the registry.

    Raises:
        InvalidArgument: they are damaged.
    """
    if {len(row[colour] or ()) for colour in CHANNELS} == {len(NM)}:
        curves = np.array([row[colour] for colour in CHANNELS], dtype=float)
        if (np.abs(curves) <= LARGEST).all():
            return curves
    raise registry.damaged(str(row["key"]), "the curves cannot be right")


def _name_damaged_row(registry: Registry, where: str, values: list[Any]) -> None:
    """Raise for the first row whose curves are impossible, if there is one; DuckDB sorts NaN above all numbers."""
    sound = " AND ".join(
        f"len({colour}) = {len(NM)} AND list_max({colour}) <= {LARGEST} AND list_min({colour}) >= -{LARGEST}"
        for colour in CHANNELS
    )
    damaged = registry.query(
        f"SELECT key FROM rows WHERE {where} AND len(red) > 0 AND NOT coalesce({sound}, false) ORDER BY key LIMIT 1",
        values,
    )
    if damaged:
        raise registry.damaged(str(damaged[0]["key"]), "the curves cannot be right")
