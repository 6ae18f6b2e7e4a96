"""Reads chart tables by name, by file or from objects.

Tables known by name are in data/spectra.json, taken from colour-science. Reflectances are interpolated by Sprague's
method, which CIE 167:2005 recommends for even steps (by a cubic spline if a file's steps are uneven).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats, frozen
from camssf.messages import fail
from camssf.shapes import MOST_PATCHES, Bounds, Count, Reflectances, Share, Sizes, Text, Tolerances
from camssf.spectra.bundled import bundled, reflectances
from camssf.spectra.layouts import LAYOUTS, ChartLayout, read_layout
from camssf.spectra.limits import (
    AS_WHITE,
    LARGEST_CHART_TOLERANCE,
    LARGEST_REFLECTANCE,
    MEASURED_CHART,
    NEUTRAL,
    OTHER_ORDER,
    PERCENT,
    PUBLIC_CHART,
    UNEVEN,
)
from camssf.spectra.sampled import (
    Name,
    Pair,
    Spectra,
    Spectrum,
    ascending,
    check_wavelengths,
    held,
    sampled,
    smooth,
    text_of,
)
from camssf.spectra.tables import read_spectra
from camssf.spectra.text import looks_like_file, nearest


@dataclass(frozen=True)
class ChartTable:
    """The measured reflectances of a chart.

    Attributes:
        name: of the chart as given, for example "classic24".
        table: name of the table, for example "BabelColor Average".
        layout: printed geometry.
        patches: (n) names in reading order from the chart's top left.
        wavelengths: (w,) nodes of the table, nm.
        reflectance: (n, w) as the table has it, 0 to 1.
        tolerance: (n,) one standard deviation of the table's relative error for an individual chart, dimensionless.
        white: index of the white patch.
        source: description for the report.
        fading: part v of its colour that the chart has lost, 0 to 1: R + v (R̄ - R), R̄ the mean over the grid.
    """

    name: Text
    table: Text
    layout: ChartLayout
    patches: Annotated[tuple[Text, ...], Bounds(1, MOST_PATCHES)] = field(repr=False)
    wavelengths: Sizes = field(repr=False)
    reflectance: Reflectances = field(repr=False)
    tolerance: Tolerances = field(repr=False)
    white: Count
    source: Text
    fading: Share = 0.0

    @cached_property
    def values(self) -> Floats:
        """(n, 681) reflectance on the grid, 0 to 1."""
        values = self.reflectance
        if not np.array_equal(self.wavelengths, WAVELENGTHS):
            values = np.clip([smooth(self.wavelengths, row) for row in self.reflectance], 0.0, LARGEST_REFLECTANCE)
        return frozen(faded(values, self.fading) if self.fading else values)

    def with_tolerance(self, tolerance: float) -> ChartTable:
        """The table with another relative error of an individual chart, one standard deviation: 0.01 for 1 %.

        Raises:
            InvalidArgument: no number from 0 to 0.5.
        """
        if not 0.0 <= tolerance <= LARGEST_CHART_TOLERANCE:
            raise InvalidArgument(
                f"The chart's tolerance is {tolerance:g}; 0 to {LARGEST_CHART_TOLERANCE:g} is possible.",
                "Write 1 % as 1% or 0.01.",
            )
        return replace(self, tolerance=frozen(np.full(len(self.patches), float(tolerance))))

    def with_values(self, values: Floats) -> ChartTable:
        """The chart with other reflectances (n, 681) on the grid."""
        return replace(
            self, wavelengths=WAVELENGTHS, reflectance=frozen(np.array(values, dtype=np.float64)), fading=0.0
        )

    def faded(self, amount: float) -> ChartTable:
        """The table of a chart that has faded by `amount`."""
        return replace(self, fading=amount) if amount else self

    @property
    def public(self) -> bool:
        """Whether the table is a published one, not measured by the user."""
        return self.table in bundled()["charts"]["tables"].values()

    def other_tables(self) -> tuple[ChartTable, ...]:
        """The chart's other public tables, with the same tolerance, if this is the default one and not named."""
        charts = bundled()["charts"]
        default, *others = charts["tables"]
        if self.name not in charts["names"] or self.table != charts["tables"][default]:
            return ()
        return tuple(replace(read_chart(f"{self.name}:{table}"), tolerance=self.tolerance) for table in others)


def faded(reflectance: Floats, amount: float | Floats) -> Floats:
    """Reflectances (..., 681) of a chart whose colours have faded by v: R + v (R̄ - R), R̄ the mean over the grid."""
    return np.asarray(reflectance + amount * (reflectance.mean(axis=-1, keepdims=True) - reflectance))


ChartLike: TypeAlias = Name | ChartTable | Spectra | Mapping[str, Spectrum] | Pair
"""What `read_chart` accepts: a name or a file; a ChartTable; colour-science's MultiSpectralDistributions, or a
mapping of patch names to SpectralDistributions; or a pair of arrays, wavelengths (w,) in nm and reflectances
(n, w)."""


_CHART_MENU = (
    "Charts: classic24, nano24, mini24, passport24 (add :babelcolor or :ohta to fix the table), or a file of "
    "measured reflectances (.csv, CGATS .txt, .cxf); sg140 by such a file only, as in sg140:mine.txt; another chart "
    "by its layout and such a file, as in card.json:mine.csv."
)


_COUNTS = {24: "classic24", 140: "sg140"}


def chart_names() -> tuple[str, ...]:
    """Names that `read_chart` accepts."""
    charts = bundled()["charts"]
    _first, *others = charts["tables"]
    return (*charts["names"], *(f"{chart}:{table}" for table in others for chart in charts["names"]))


def read_chart(spec: ChartLike) -> ChartTable:
    """Read the reflectances of a chart by name, by file or from an object.

    `classic24`, `nano24`, `mini24` and `passport24` have the same 24 colours: BabelColor's average of 30 charts, or
    Ohta's table where the signals clearly speak for it (`camssf.fit.solutions`); `:babelcolor` or `:ohta` fixes the
    table. A file (CSV, CGATS, CxF) holds 24 or 140 patches in reading order, unless it names them by position
    (A1 ...); `nano24:mine.csv` states its layout, `card.json:mine.csv` gives one of the user's own
    (`camssf.spectra.layouts`). If a value exceeds 2, all are read as percent. A file must cover 400 to 700 nm in
    steps of 20 nm at most; reflectance is constant outside, which `source` states.

    An object or a pair of arrays is read like a file, with its patches by their names or in reading order.

    The tolerance is 3 % for a public table and 1 % for a file or an object, which is assumed to be a measurement of
    the user's own chart. The white patch is "white 9.5 (.05 D)" of the public tables; in a file, it is the brightest
    neutral patch, or E5 of an SG if no patch is clearly brighter.

    Raises:
        InvalidArgument: unknown name, a file that is not such a table, or another number of patches.
        ChartUnfit: too few wavelengths, a reflectance outside 0 to 1.2 or not finite, no neutral patch, or the 24
            colours not in reading order.

    Example:
        >>> from camssf.spectra import read_chart
        >>> chart = read_chart("classic24")
        >>> chart.values.shape, chart.patches[chart.white]
        ((24, 681), 'white 9.5 (.05 D)')
    """
    if isinstance(spec, ChartTable):
        return spec
    if spec is not None and not isinstance(spec, str | PathLike):
        return _given_chart(spec)
    text = text_of(spec)
    head, _, tail = text.partition(":")
    chart = head.casefold()
    known: list[str] = bundled()["charts"]["names"]
    tables: dict[str, str] = bundled()["charts"]["tables"]
    if chart in known and tail.casefold() in ("", *tables):
        table = tables[tail.casefold() or next(iter(tables))]
        entry = bundled()["tables"][table]
        values = np.array(entry["values"])
        return ChartTable(
            name=text,
            table=table,
            layout=LAYOUTS[chart],
            patches=tuple(entry["patches"]),
            wavelengths=frozen(entry["start"] + entry["step"] * np.arange(values.shape[1], dtype=np.float64)),
            reflectance=frozen(values),
            tolerance=frozen(np.full(len(values), PUBLIC_CHART)),
            white=entry["white"],
            source=f"{table} (colour-science)",
        )
    if chart == "sg140" and not tail:
        raise InvalidArgument(
            "No table of the ColorChecker Digital SG ships, because its spectra are not published.",
            "Give a file of measured reflectances, 140 patches, as in sg140:mine.txt (CSV, CGATS or CxF).",
        )
    if chart in (*known, "sg140") and tail:
        return _measured_chart(text, Path(tail), LAYOUTS[chart])
    own, table_file = chart_parts(text)
    if own:
        return _measured_chart(text, Path(table_file), read_layout(Path(own)))
    if text.casefold().endswith(".json"):
        layout = read_layout(Path(text))
        raise InvalidArgument(
            f"{text} holds a layout, {layout.name}, and no reflectances.",
            f"Add the file of the patches' measured reflectances, as in {text}:mine.csv.",
        )
    if looks_like_file(text):
        return _measured_chart(text, Path(text), None)
    raise InvalidArgument(
        f"No chart is called {text!r}." if text else "The chart is missing.",
        nearest(text, (*chart_names(), "sg140")) + _CHART_MENU,
    )


def chart_parts(text: str) -> tuple[str, str]:
    """Layout and file of a chart as `nano24:mine.csv`, `card.json:mine.csv`, `mine.csv`; "" where there is none.

    Both are "" for a known name, which goes before a file of that name.
    """
    charts = bundled()["charts"]
    head, _, tail = text.partition(":")
    if head.casefold() in (*charts["names"], "sg140"):
        return ("", "") if tail.casefold() in ("", *charts["tables"]) else (head, tail)
    match = re.fullmatch(r"(.+\.json):(.+)", text, re.IGNORECASE)
    return (match[1], match[2]) if match else ("", text)


def _given_chart(given: Spectra | Mapping[str, Spectrum] | Pair) -> ChartTable:
    """A chart from objects or from arrays, treated like a measured file."""
    surfaces = sampled(
        given,
        "chart",
        f"Give a name, a ChartTable, objects with wavelengths and values, or both as arrays. {_CHART_MENU}",
    )
    names = surfaces.labels or tuple(str(number) for number in range(1, len(surfaces.values) + 1))
    return _measured(
        surfaces.name, Path(surfaces.name), (names, surfaces.wavelengths, surfaces.values), None, surfaces.source
    )


def _measured_chart(name: str, path: Path, layout: ChartLayout | None) -> ChartTable:
    return _measured(name, path, read_spectra(path), layout, f"file {path.name}")


def _measured(
    name: str, path: Path, spectra: tuple[tuple[str, ...], Floats, Floats], layout: ChartLayout | None, source: str
) -> ChartTable:
    """Check names, wavelengths and reflectances (n, w) and make a table; `path` is its name in messages."""
    names, wavelengths, table = spectra
    count = len(table)
    if layout is None:
        layout = LAYOUTS[_COUNTS[count]] if count in _COUNTS else None
    if layout is None or layout.columns * layout.rows != count:
        own = layout is not None and not layout.shipped
        raise InvalidArgument(
            f"{path} holds {count} patches"
            + (f", {layout.name} has {layout.columns * layout.rows}." if layout else "."),
            "Give one spectrum for each patch of the layout."
            if own
            else "classic24, nano24, mini24 and passport24 have 24, sg140 has 140; give one spectrum for each patch, "
            "or the layout of another chart, as in card.json:mine.csv (docs/tables.md).",
            value=count,
        )
    wavelengths, columns = ascending(wavelengths, table.T)
    check_wavelengths(wavelengths, path, "chart_unfit")
    table = columns.T
    if not np.isfinite(table).all():
        raise fail("chart_unfit.not_a_number", file=path)
    if table.max() > PERCENT:
        table = table / 100.0
    worst = float(min(table.min(), 0.0) or table.max())
    if not 0.0 <= worst <= LARGEST_REFLECTANCE:
        raise fail("chart_unfit.reflectance", value=worst, file=path, reflectance=worst)
    order = _reading_order(names, layout)
    chart = ChartTable(
        name=name,
        table=path.name,
        layout=layout,
        patches=tuple(names[i] for i in order),
        wavelengths=frozen(wavelengths),
        reflectance=frozen(table[order]),
        tolerance=frozen(np.full(count, MEASURED_CHART)),
        white=0,
        source=f"{source}{held(wavelengths)}",
    )
    if layout.shipped and count == 24:
        _check_order(chart.values, path)
    return replace(chart, white=_white(chart.values, chart.patches, layout, path))


def _reading_order(names: tuple[str, ...], layout: ChartLayout) -> list[int]:
    """Indices of the file's rows in reading order if their names are positions, else in the file's order.

    Letters are columns where their number is the layout's number of columns (A1 to F4), else rows (A1 to D6).
    """
    stand = list(range(len(names)))
    places = [re.fullmatch(r"([A-Z])(\d{1,2})", name.upper()) for name in names]
    cells = [(ord(place[1]), int(place[2])) for place in places if place]
    letters, numbers = ({cell[axis] for cell in cells} for axis in (0, 1))
    shape = len(letters), len(numbers)
    by_columns = shape == (layout.columns, layout.rows)
    if len(set(cells)) != len(names) or not (by_columns or shape == (layout.rows, layout.columns)):
        return stand
    return sorted(stand, key=lambda i: cells[i][::-1] if by_columns else cells[i])


def _check_order(values: Floats, path: Path) -> None:
    """Raise if the 24 known colours are listed upside down or by columns; all results would be wrong."""
    known = reflectances("BabelColor Average")
    cells = np.arange(24).reshape(4, 6)  # position in the file of each patch of the chart, if in reading order
    by_columns = np.arange(24).reshape(6, 4).T
    orders = {"upside down": cells[::-1, ::-1], "by columns": by_columns, "by columns from below": by_columns[::-1]}
    misfit = {way: _rms(values[order.ravel()] - known) for way, order in orders.items()}
    way = min(misfit, key=lambda each: misfit[each])
    if misfit[way] < OTHER_ORDER * _rms(values - known):
        raise fail(
            "chart_unfit.order", value=_rms(values - known), threshold=misfit[way] / OTHER_ORDER, file=path, order=way
        )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _white(values: Floats, names: tuple[str, ...], layout: ChartLayout, path: Path) -> int:
    """The layout's white patch; without one the brightest neutral patch, or E5 of an SG if none is clearly brighter.

    The border of an SG repeats the white.
    """
    if layout.white:
        if layout.white not in names:
            raise InvalidArgument(
                f"{path} has no patch {layout.white!r}, the white patch of the layout {layout.name}.",
                'Give its name in the table as "white" of the layout, or leave "white" out.',
            )
        return names.index(layout.white)
    first, last = NEUTRAL
    visible = values[:, (first <= WAVELENGTHS) & (last >= WAVELENGTHS)]
    level = visible.mean(axis=1)
    brightness = np.where(visible.std(axis=1) <= UNEVEN * level, level, 0.0)
    if brightness.max() <= 0:
        raise fail("chart_unfit.no_neutral", file=path)
    e5 = 4 * 14 + 4
    if layout.name == "sg140" and brightness[e5] >= AS_WHITE * brightness.max():
        return e5
    return int(np.argmax(brightness))
