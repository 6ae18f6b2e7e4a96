"""Spectra by name or by file: lamps, chart tables, measured cameras.

Lamps and charts known by name come from data/spectra.json, taken from colour-science; cameras from that library.
Lamps are interpolated linearly: their tables have lines, and a smoother curve would overshoot beside each.
Reflectances and cameras are smooth: Sprague's interpolation, which CIE 167:2005 recommends for even steps (a cubic
spline where a file's steps are uneven).
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from camssf._bundled import bundled, daylight, illuminant, planck, reflectances, sprague
from camssf._tables import is_file, looks_like_file, nearest, plain, read_curves, read_spectra, read_spectrum
from camssf.errors import CalibrationError, ChartUnfit, InvalidArgument, LampUnfit
from camssf.families import FAMILIES, Kind, Temperature, principal_modes, temperature_mode
from camssf.fonts import prepare_matplotlib
from camssf.grid import STEP, WAVELENGTHS, Floats


@dataclass(frozen=True)
class Lamp:
    """The relative spectral power of a shot's light.

    Attributes:
        name: as asked for.
        values: (681,) on the grid, any scale, ≥ 0.
        tolerance: one standard deviation of its smooth relative error, 1 (0.02 = 2 %).
        modes: (q, 681) directions in which L may be off, relative to it, each one standard deviation long.
        source: table, formula or file it came from, in words for the report.
    """

    name: str
    values: Floats
    tolerance: float
    modes: Floats
    source: str


@dataclass(frozen=True)
class ChartTable:
    """The measured reflectances of a chart.

    Attributes:
        name: of the chart as asked for, for example "classic24".
        table: name of the table, for example "BabelColor Average".
        layout: geometry it is printed in, a key of `camssf.chart.LAYOUTS`.
        patches: (n) names in reading order from the chart's top left.
        values: (n, 681) reflectance on the grid, 0 to 1.
        tolerance: (n,) one standard deviation of the table's relative error for a chart somebody owns, 1.
        white: index of the white patch.
        source: in words for the report.
    """

    name: str
    table: str
    layout: str
    patches: tuple[str, ...]
    values: Floats
    tolerance: Floats
    white: int
    source: str


@dataclass(frozen=True)
class CameraCurves:
    """The measured sensitivity of a camera, for simulation and comparison.

    Attributes:
        name: of the camera.
        values: (681, 3) red, green, blue on the grid, in the units of the source; 0 outside its range.
        source: in words for the report.
    """

    name: str
    values: Floats
    source: str


NAMED_LAMP = 0.02
"""A real lamp is never the table of its name: batches, age, voltage, dimmers, the walls of the room."""
MEASURED_LAMP = 0.01
"""A spectrometer in the chart's own light leaves its calibration and its noise."""
PUBLIC_CHART = 0.03
"""Measured tables of one and the same product differ by 1 to 3 % RMS; so does somebody's chart."""
MEASURED_CHART = 0.01
"""A spectrophotometer on the chart itself leaves its own accuracy and the fading since."""
NOISE_BELOW_ZERO = 0.005
"""Dark-corrected spectrometers dip below zero by noise: this share of the peak is forgiven."""
# A table must cover these, and leave no larger gap, nm.
_FIRST, _LAST, _GAP = 400.0, 700.0, 20.0

_LAMP_MENU = (
    "Lamps: daylight B C D50 D55 D60 D65 D75, behind a window ID50 ID65, or D:5500 for any colour temperature; "
    "bulb A, or 2856K for any temperature; fluorescent FL1 to FL12, FL3.1 to FL3.15; discharge HP1 to HP5; "
    "LED-B1 to LED-B5, LED-BH1, LED-RGB1, LED-V1, LED-V2; not known but by kind: daylight, bulb, white-led, "
    "fluorescent; flat E, equal-energy (the paper's assumption); or a "
    "file of wavelength and power (.csv .txt .spd .sp)."
)
_CHART_MENU = (
    "Charts: classic24, nano24, mini24, passport24 (add :ohta for Ohta's table), or a file of measured reflectances "
    "(.csv, CGATS .txt, .cxf); sg140 by such a file only, as in sg140:mine.txt."
)
_COUNTS = {24: "classic24", 140: "sg140"}


def lamp_names() -> tuple[str, ...]:
    """Names that `read_lamp` knows, besides `<T>K`, `D:<T>` and files."""
    return (*bundled()["lamps"], "equal-energy", *FAMILIES)


def chart_names() -> tuple[str, ...]:
    """Names that `read_chart` knows, besides files."""
    charts = bundled()["charts"]
    _first, *others = charts["tables"]
    return (*charts["names"], *(f"{chart}:{table}" for table in others for chart in charts["names"]))


def camera_names() -> tuple[str, ...]:
    """Names that `read_camera` knows, besides files."""
    return tuple(str(name) for name in colour_science().MSDS_CAMERA_SENSITIVITIES)


def read_lamp(spec: str) -> Lamp:
    """Spectral power of the light, by name, formula or file, scaled to a mean of 1 on the grid.

    - A CIE illuminant: `A`, `D55`, `FL2` or `F2`, `LED-B3` ...; case, blanks and hyphens do not matter.
    - `2856K`: Planck's law with c₂ = 1.4388e-2 m K (CIE 15, ITS-90), 1000 to 20,000 K.
    - `D:5500`: CIE daylight of that correlated colour temperature (CIE 15), 4000 to 25,000 K, taken as it stands.
      The D illuminants were named when c₂ was 1.4380e-2: D55 is `D:5503`, D65 is `D:6504`.
    - `equal-energy`: exactly 1 with tolerance 0, the paper's own assumption.
    - A family whose member is not known: `daylight`, `bulb`, `white-led`, `fluorescent` (families.py): a mean, and
      modes in which it may be off.
    - A file of wavelength (nm, increasing) and power, which must cover 400 to 700 nm in steps of 20 nm at most.
      Outside its range the power is held constant, a guess that `source` names. Where its steps are finer than the
      grid's, power is averaged over each step of the grid, so that no narrow line is lost. Noise below zero, down
      to 0.5 % of the peak, becomes 0.

    The tolerance is 2 % for a name or formula (a real lamp is never its table), 1 % for a file, and for a family of
    tables what its modes leave of a lamp left out.

    Raises:
        InvalidArgument: no lamp, unknown name, temperature out of range, or a file that is no such table.
        LampUnfit: power that is negative, not finite or all zero, or a file that covers too little.
    """
    text = _text(spec)
    key = text.casefold()
    modes = _frozen(np.zeros((0, WAVELENGTHS.size)))
    if not text:
        raise InvalidArgument(
            "The lamp is missing.",
            "One photo cannot do without: dividing by the white frame, Eq. (5), does not cancel the lamp's spectrum, "
            "and no photo of a chart tells lamp from camera. Taking a bulb (A) for flat light costs an RMSE of 0.10, "
            f"more than the curve of an average camera does (0.08). {_LAMP_MENU}",
        )
    if plain(text) == "equalenergy":
        return Lamp(text, _frozen(np.ones_like(WAVELENGTHS)), 0.0, modes, "equal energy, by definition")
    if key in FAMILIES:
        return _family(key)
    if match := re.fullmatch(r"(\d+(?:\.\d+)?) ?k", key):
        power, source, tolerance = _planck(float(match[1])), f"Planck's law, {match[1]} K", NAMED_LAMP
    elif match := re.fullmatch(r"d: ?(\d+(?:\.\d+)?) ?k?", key):
        power, source, tolerance = _daylight(float(match[1])), f"CIE daylight, {match[1]} K", NAMED_LAMP
    elif name := _cie_name(text):
        power, source, tolerance = illuminant(name), f"CIE illuminant {name} (colour-science)", NAMED_LAMP
    elif looks_like_file(text):
        power, source = _measured_lamp(Path(text))
        tolerance = MEASURED_LAMP
    else:
        daylight = re.fullmatch(r"d(\d{2})", key)
        near = f"Did you mean D:{daylight[1]}00? " if daylight else nearest(text, lamp_names())
        raise InvalidArgument(f"No lamp is called {text!r}.", near + _LAMP_MENU)
    return Lamp(text, _frozen(power / power.mean()), tolerance, modes, source)


def read_chart(spec: str) -> ChartTable:
    """Reflectances of a chart, by name or by file.

    `classic24`, `nano24`, `mini24` and `passport24` have the same 24 colours: BabelColor's average of 30 charts,
    or Ohta's table with `:ohta`. A file (CSV, CGATS, CxF) holds 24 or 140 patches in reading order, unless it names
    them by position (A1 ...); `nano24:mine.csv` names its layout. Values above 2 are taken for percent. Outside a
    file's wavelengths reflectance is held constant, which `source` says; it must cover 400 to 700 nm in steps of
    20 nm at most.

    The tolerance is 3 % for a public table, because measured tables of one chart differ by 1 to 3 %, and 1 % for
    a file, which is taken for a measurement of the user's own chart. White is "white 9.5 (.05 D)" of the public
    tables; of a file, E5 of an SG, else the brightest neutral patch.

    Raises:
        InvalidArgument: unknown name, a file that is no such table, or another number of patches.
        ChartUnfit: too few wavelengths, a reflectance outside 0 to 1.2 or not finite, no neutral patch, or the 24
            colours in another order than reading order.
    """
    text = _text(spec)
    head, _, tail = text.partition(":")
    chart = head.casefold()
    known: list[str] = bundled()["charts"]["names"]
    tables: dict[str, str] = bundled()["charts"]["tables"]
    if chart in known and tail.casefold() in ("", *tables):
        table = tables[tail.casefold() or next(iter(tables))]
        entry, values = bundled()["tables"][table], _frozen(reflectances(table))
        patches, tolerance = tuple(entry["patches"]), _frozen(np.full(len(values), PUBLIC_CHART))
        return ChartTable(text, table, chart, patches, values, tolerance, entry["white"], f"{table} (colour-science)")
    if chart == "sg140" and not tail:
        raise InvalidArgument(
            "camssf has no table of the ColorChecker Digital SG: colour-science, its source of tables, has none.",
            "Give a file of measured reflectances, 140 patches, as in sg140:mine.txt (CSV, CGATS or CxF).",
        )
    if chart in (*known, "sg140") and tail:
        return _measured_chart(text, Path(tail), chart)
    if looks_like_file(text):
        return _measured_chart(text, Path(text), None)
    raise InvalidArgument(
        f"No chart is called {text!r}." if text else "The chart is missing.",
        nearest(text, (*chart_names(), "sg140")) + _CHART_MENU,
    )


def read_camera(spec: str) -> CameraCurves:
    """Measured sensitivities of a camera, by name or by file; 0 outside the measured range.

    Names are colour-science's (`camera_names`). A file is a CSV with the header `wavelength_nm,red,green,blue` (or
    `R,G,B`; further columns are ignored), or one of many cameras with a column `camera` more, of which
    `cameras.csv:Canon EOS 5D` names one.

    Raises:
        InvalidArgument: unknown name, or a file that is no such table of finite, positive curves.
    """
    text = _text(spec)
    known = {plain(alias): name for name in camera_names() for alias in (name, name.removesuffix(" (NPL)"))}
    name = known.get(plain(text).replace("nikond5100", "nikon5100"))
    if name is not None:
        return _known_camera(name)
    match = re.fullmatch(r"(.+\.(?:csv|tsv|txt)):([^/\\]+)", text, re.IGNORECASE)
    if match and not is_file(text):
        return _measured_camera(Path(match[1]), match[2].strip())
    if looks_like_file(text):
        return _measured_camera(Path(text), None)
    raise InvalidArgument(
        f"No measured camera is called {text!r}." if text else "The camera is missing.",
        f"{nearest(text, camera_names())}Cameras: {', '.join(camera_names())}; or a file of curves, "
        "wavelength_nm,red,green,blue; or cameras.csv:NAME for one of many.",
    )


def with_tolerance(lamp: Lamp, text: str) -> Lamp:
    """The same lamp, known as well as the text says: `2%`, `300K`, or both, `300K,1%`.

    A percentage replaces the lamp's smooth tolerance. A temperature becomes a mode: the change of ln L over so many
    kelvin at the lamp's own temperature. Both are one standard deviation.

    Raises:
        InvalidArgument: other text, or a temperature for a lamp that has none.
    """
    for part in filter(None, (p.strip() for p in text.split(","))):
        number = re.fullmatch(r"(\d+(?:\.\d+)?) ?(%|k)", part.casefold())
        if number is None:
            raise InvalidArgument(f"{part!r} is no tolerance of a lamp.", "Write 2%, 300K, or 300K,2%.")
        size = float(number[1])
        if number[2] == "%":
            if size > 50:
                raise InvalidArgument(f"A lamp known to {size:g} % is not known.", "Name a family, or measure it.")
            lamp = replace(lamp, tolerance=size / 100.0)
            continue
        formula, kelvin = _temperature(lamp.name)
        if not 0 < size < 0.25 * kelvin:
            raise InvalidArgument(
                f"{size:g} K is no tolerance of a lamp of {kelvin:g} K.", "Give less than a quarter of it."
            )
        mode = temperature_mode(formula, kelvin, size)
        source = f"{lamp.source}, ± {size:g} K"
        lamp = replace(lamp, modes=_frozen(np.concatenate([lamp.modes, mode])), source=source)
    return lamp


def _temperature(name: str) -> tuple[Callable[[float], Floats], float]:
    """Formula and colour temperature of a lamp that has them."""
    key = name.casefold().strip()
    if match := re.fullmatch(r"(\d+(?:\.\d+)?) ?k", key):
        return _planck, float(match[1])
    if match := re.fullmatch(r"d: ?(\d+(?:\.\d+)?) ?k?", key):
        return _daylight, float(match[1])
    cie = _cie_name(name)
    if cie in bundled()["kelvin"]:
        return (_planck if cie == "A" else _daylight), bundled()["kelvin"][cie]
    raise InvalidArgument(
        f"The lamp {name!r} has no temperature to be off in.",
        "Give its tolerance in percent; kelvins suit A, D50 to D75, 3000K or D:5500.",
    )


def _family(name: str) -> Lamp:
    family = FAMILIES[name]
    if isinstance(family, Temperature):
        formula = _daylight if name == "daylight" else _planck
        power, modes = formula(family.centre), temperature_mode(formula, family.centre, family.spread)
        source = f"{'CIE daylight' if name == 'daylight' else 'Planck'}, {family.centre:g} ± {family.spread:g} K"
    else:
        power, modes = principal_modes([illuminant(member) for member in family.members], family.components)
        source = f"mean and {len(modes)} principal components of {len(family.members)} CIE lamps"
    tolerance = family.left if isinstance(family, Kind) else NAMED_LAMP
    return Lamp(name, _frozen(power / power.mean()), tolerance, _frozen(modes), source)


@cache
def colour_science() -> Any:
    """The library, imported late and silently: it warns of optional packages that camssf does not use."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        prepare_matplotlib()  # colour-science loads it
        import colour
    return colour


def _planck(kelvin: float) -> Floats:
    if not 1000.0 <= kelvin <= 20_000.0:
        raise InvalidArgument(f"No lamp burns at {kelvin:g} K.", "Give 1000K to 20000K.", value=kelvin)
    return planck(kelvin)


def _daylight(kelvin: float) -> Floats:
    if not 4000.0 <= kelvin <= 25_000.0:
        raise InvalidArgument(
            f"CIE daylight is not defined at {kelvin:g} K.",
            f"Give D:4000 to D:25000; for a bulb {kelvin:g}K, without D.",
            value=kelvin,
        )
    return daylight(kelvin)


def _cie_name(text: str) -> str | None:
    key = re.sub(r"^f(?=\d)", "fl", plain(text).removeprefix("cie"))
    return {plain(name): name for name in bundled()["lamps"]}.get(key)


def _measured_lamp(path: Path) -> tuple[Floats, str]:
    wavelengths, power = read_spectrum(path)
    _check_wavelengths(wavelengths, path, LampUnfit)
    advice = "Measure it again, or name a lamp that is like it."
    peak = float(power.max())
    if not np.isfinite(power).all():
        raise LampUnfit(f"The lamp in {path} has a power that is not a number.", advice)
    if peak <= 0:
        raise LampUnfit(f"The lamp in {path} has no power.", advice)
    power = power / peak
    if power.min() < -NOISE_BELOW_ZERO:
        raise LampUnfit(
            f"The lamp in {path} has negative power.",
            "Correct the spectrometer's dark signal, or set noise below zero to 0.",
            value=float(power.min()),
            threshold=-NOISE_BELOW_ZERO,
        )
    fine = np.diff(wavelengths).min() < 0.99 * STEP
    power = np.maximum(power, 0.0)
    values = _step_means(wavelengths, power) if fine else np.interp(WAVELENGTHS, wavelengths, power)
    if values.max() <= 0:
        raise LampUnfit(f"The lamp in {path} has no power from 380 to 720 nm.", advice)
    return values, f"file {path.name}{_held(wavelengths)}"


def _step_means(wavelengths: Floats, power: Floats) -> Floats:
    """Mean over each step of the grid of the polygon through the samples, from its exact integral, (681,)."""
    edges = np.append(WAVELENGTHS - STEP / 2, WAVELENGTHS[-1] + STEP / 2)
    knots = np.union1d(wavelengths, edges)
    heights = np.interp(knots, wavelengths, power)
    area = np.concatenate([[0.0], np.cumsum(np.diff(knots) * (heights[1:] + heights[:-1]) / 2)])
    means: Floats = np.diff(area[np.searchsorted(knots, edges)]) / STEP
    return np.maximum(means, 0.0)  # a difference of sums may round below zero


def _measured_chart(name: str, path: Path, layout: str | None) -> ChartTable:
    names, wavelengths, table = read_spectra(path)
    count = len(table)
    if count not in _COUNTS or (layout and (layout == "sg140") != (count == 140)):
        raise InvalidArgument(
            f"{path} holds {count} patches" + (f", {layout} does not." if layout else "."),
            "classic24, nano24, mini24 and passport24 have 24, sg140 has 140; give one spectrum for each patch.",
            value=count,
        )
    _check_wavelengths(wavelengths, path, ChartUnfit)
    if not np.isfinite(table).all():
        raise ChartUnfit(f"{path} has a reflectance that is not a number.", "Measure that patch again.")
    if table.max() > 2.0:
        table = table / 100.0
    worst = float(min(table.min(), 0.0) or table.max())
    if not 0.0 <= worst <= 1.2:
        raise ChartUnfit(
            f"{path} has a reflectance of {worst:g}.",
            "Give all as 0 to 1, or all in percent; a patch that fluoresces above 1.2 does not serve.",
            value=worst,
        )
    order = _reading_order(names)
    values = _frozen(np.clip([_smooth(wavelengths, table[i]) for i in order], 0.0, 1.2))
    if count == 24:
        _check_order(values, path)
    return ChartTable(
        name=name,
        table=path.name,
        layout=layout or _COUNTS[count],
        patches=tuple(names[i] for i in order),
        values=values,
        tolerance=_frozen(np.full(count, MEASURED_CHART)),
        white=_white(values, path),
        source=f"file {path.name}{_held(wavelengths)}",
    )


def _reading_order(names: tuple[str, ...]) -> list[int]:
    """The file's rows in reading order where their names are positions, else as they stand.

    Letters are columns on the SG (A1 to N10) and on 24 patches A1 to F4; rows on 24 patches A1 to D6.
    """
    stand = list(range(len(names)))
    places = [re.fullmatch(r"([A-N])(\d{1,2})", name.upper()) for name in names]
    cells = [(ord(place[1]), int(place[2])) for place in places if place]
    letters, numbers = ({cell[axis] for cell in cells} for axis in (0, 1))
    shape = len(letters), len(numbers)
    if len(set(cells)) != len(names) or shape not in ((14, 10), (6, 4), (4, 6)):
        return stand
    return sorted(stand, key=lambda i: cells[i] if shape == (4, 6) else cells[i][::-1])


def _check_order(values: Floats, path: Path) -> None:
    """Refuse the 24 known colours upside down or column by column: every later number would be wrong."""
    known = reflectances("BabelColor Average")
    cells = np.arange(24).reshape(4, 6)  # position in the file of each patch of the chart, if in reading order
    by_columns = np.arange(24).reshape(6, 4).T
    orders = {"upside down": cells[::-1, ::-1], "by columns": by_columns, "by columns from below": by_columns[::-1]}
    misfit = {way: _rms(values[order.ravel()] - known) for way, order in orders.items()}
    way = min(misfit, key=lambda each: misfit[each])
    if misfit[way] < 0.5 * _rms(values - known):
        raise ChartUnfit(
            f"The patches in {path} run {way}.",
            "Sort them in reading order (dark skin first, black last), or name them A1 to D6.",
            value=_rms(values - known),
            threshold=2 * misfit[way],
        )


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _white(values: Floats, path: Path) -> int:
    """The brightest neutral patch; E5 of an SG if none is plainly brighter (its border repeats the white)."""
    visible = values[:, (WAVELENGTHS >= 430) & (WAVELENGTHS <= 700)]
    level = visible.mean(axis=1)
    brightness = np.where(visible.std(axis=1) <= 0.08 * level, level, 0.0)
    if brightness.max() <= 0:
        raise ChartUnfit(f"{path} has no neutral patch.", "Check its columns: a chart's white patch is flat.")
    e5 = 4 * 14 + 4
    if len(values) == 140 and brightness[e5] >= 0.95 * brightness.max():
        return e5
    return int(np.argmax(brightness))


@cache
def _known_camera(name: str) -> CameraCurves:
    table = colour_science().MSDS_CAMERA_SENSITIVITIES[name]
    values = _on_grid(np.asarray(table.wavelengths), np.asarray(table.values))
    return CameraCurves(name, values, f"{name} (colour-science)")


def _measured_camera(path: Path, name: str | None) -> CameraCurves:
    label, wavelengths, curves = read_curves(path, name)
    _check_wavelengths(wavelengths, path, InvalidArgument, whole=False)
    if not np.isfinite(curves).all() or np.abs(curves).max() > 1e100:
        raise InvalidArgument(f"{path} has a sensitivity that is not a number.", "Give measured curves.")
    values = _on_grid(wavelengths, curves)
    if (values.max(axis=0) <= 0).any():
        raise InvalidArgument(f"{path} has a curve without response from 380 to 720 nm.", "Give measured curves.")
    return CameraCurves(label, values, f"{label}, file {path.name}")


def _on_grid(wavelengths: Floats, curves: Floats) -> Floats:
    """Curves (w, 3) → (681, 3): smooth, 0 outside, and not below zero where the measurement is not."""
    values = np.stack([_smooth(wavelengths, curve) for curve in curves.T], axis=1)
    if curves.min() >= 0:
        values = np.maximum(values, 0.0)  # beside a steep edge a smooth interpolation dips
    values[(wavelengths[0] > WAVELENGTHS) | (wavelengths[-1] < WAVELENGTHS)] = 0.0
    return _frozen(values)


def _smooth(wavelengths: Floats, values: Floats) -> Floats:
    """Sprague (CIE 167:2005) for even steps, else a cubic spline, to the grid; held constant outside. (681,)."""
    first, last = float(wavelengths[0]), float(wavelengths[-1])
    step = (last - first) / (len(wavelengths) - 1)
    if np.allclose(wavelengths, first + step * np.arange(len(wavelengths)), rtol=0, atol=1e-3):
        return sprague(first, step, values)
    interpolator = colour_science().CubicSplineInterpolator(wavelengths, values)
    return np.asarray(interpolator(np.clip(WAVELENGTHS, first, last)), dtype=np.float64)


def _check_wavelengths(wavelengths: Floats, path: Path, unfit: type[CalibrationError], *, whole: bool = True) -> None:
    """Increasing, in nm, without gaps; `whole`: covering 400 to 700 nm. What is too little raises `unfit`."""
    steps = np.diff(wavelengths)
    if len(wavelengths) < 2 or not np.isfinite(wavelengths).all() or steps.min() < 1e-3:
        raise InvalidArgument(f"The wavelengths in {path} do not increase.", "Sort them, in nm, each once.")
    if not 100 <= wavelengths[0] <= wavelengths[-1] <= 20_000:
        raise InvalidArgument(f"The wavelengths in {path} are not in nm.", "Write 550 for green, not 0.55 or 5500.")
    span = f"{wavelengths[0]:g} to {wavelengths[-1]:g} nm"
    if whole and (wavelengths[0] > _FIRST or wavelengths[-1] < _LAST):
        raise unfit(f"{path} covers only {span}.", "It must cover 400 to 700 nm, better 380 to 720 nm.")
    if steps.max() > _GAP or len(wavelengths) < 6:
        raise unfit(
            f"{path} has only {len(wavelengths)} wavelengths from {span}.",
            "Give a spectrum every 20 nm or finer; 5 nm is usual.",
            value=float(steps.max()),
            threshold=_GAP,
        )


def _held(wavelengths: Floats) -> str:
    if wavelengths[0] <= WAVELENGTHS[0] and wavelengths[-1] >= WAVELENGTHS[-1]:
        return ""
    return f", held constant outside {wavelengths[0]:g} to {wavelengths[-1]:g} nm"


def _text(spec: str | None) -> str:
    return "" if spec is None else str(spec).strip()


def _frozen(values: Floats) -> Floats:
    values = np.array(values, dtype=np.float64)
    values.setflags(write=False)
    return values
