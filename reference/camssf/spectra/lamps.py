"""Reads lamps by name, by temperature, by kind, by file or from objects.

Lamps known by name are in data/spectra.json, taken from colour-science. They are interpolated linearly, because
smooth interpolation would overshoot at their spectral lines.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import STEP, WAVELENGTHS, Floats, frozen
from camssf.messages import fail
from camssf.shapes import Modes, Power, Size, Text
from camssf.spectra.bundled import bundled, daylight, illuminant, linear, planck
from camssf.spectra.families import FAMILIES, DrawnKind, Temperature, principal_modes, temperature_mode
from camssf.spectra.limits import (
    LARGEST_KELVIN_TOLERANCE,
    LARGEST_LAMP_TOLERANCE,
    MEASURED_LAMP,
    NAMED_LAMP,
    NOISE_BELOW_ZERO,
    TEMPERATURES,
)
from camssf.spectra.sampled import Name, Pair, Spectrum, ascending, check_wavelengths, held, sampled, text_of
from camssf.spectra.tables import read_spectrum
from camssf.spectra.text import looks_like_file, nearest, plain

NAMES_FORMAT = "camssf-lamp-names/1"


@dataclass(frozen=True)
class LampAlias:
    """Common names with the same meaning.

    Attributes:
        names: as people write them.
        what: their meaning.
        lamp: the known lamp; "" if the names are refused.
        advice: what to give instead, if the names are refused.
    """

    names: tuple[str, ...]
    what: str
    lamp: str
    advice: str


@cache
def lamp_aliases() -> tuple[LampAlias, ...]:
    """All entries of the file, in its order."""
    table: dict[str, Any] = json.loads((files("camssf") / "data" / "lamp-names.json").read_text("utf-8"))
    return tuple(
        LampAlias(tuple(entry["names"]), entry["what"], entry.get("lamp", ""), entry.get("advice", ""))
        for entry in table["names"]
    )


def resolve_lamp_alias(text: str) -> str | None:
    """The known lamp's name for a common name; None if the file does not have it.

    Raises:
        InvalidArgument: the name is ambiguous.
    """
    alias = _by_name().get(plain(text))
    if alias is None:
        return None
    if not alias.lamp:
        raise InvalidArgument(f"{text!r} does not say which lamp it is. {alias.what}", alias.advice)
    return alias.lamp


@cache
def _by_name() -> dict[str, LampAlias]:
    return {plain(name): alias for alias in lamp_aliases() for name in alias.names}


@dataclass(frozen=True)
class Lamp:
    """The relative spectral power distribution of a shot's light.

    Attributes:
        name: as given.
        values: (681,) on the grid, any scale, ≥ 0.
        tolerance: one standard deviation of its smooth relative error, dimensionless (0.02 = 2 %).
        modes: (q, 681) directions of the relative error of L, each one standard deviation long.
        source: its table, formula or file, in words for the report.
        tolerance_kelvin: one standard deviation of its colour temperature, K; None if not given. `modes` holds it.
    """

    KIND: ClassVar[str] = "named"

    name: Text
    values: Power = field(repr=False)
    tolerance: Size
    modes: Modes = field(repr=False)
    source: Text
    tolerance_kelvin: Size | None = None


AUTO = "auto"
"""Name of an unnamed light."""
TORCH = "torch"
"""Name of a phone's own torch: an unnamed light whose only kind is the white LED."""
UNNAMED = (AUTO, TORCH)
"""Names of unnamed lights; their shots alone identify no curves."""


LampLike: TypeAlias = Name | Lamp | Spectrum | Pair
"""What `read_lamp` accepts: a name, a formula or a file; a Lamp; colour-science's SpectralDistribution or any object
with `wavelengths` and `values`; or a pair of arrays, wavelengths in nm and power."""


BULB_NAME, DAYLIGHT_NAME = re.compile(r"(\d+(?:\.\d+)?) ?k"), re.compile(r"d: ?(\d+(?:\.\d+)?) ?k?")
"""Names of lamps by their temperature."""

_LAMP_MENU = (
    "Lamps: daylight B C D50 D55 D60 D65 D75, behind a window ID50 ID65, or D:5500 for any colour temperature; "
    "bulb A, or 2856K for any temperature; fluorescent FL1 to FL12, FL3.1 to FL3.15; discharge HP1 to HP5; "
    "LED-B1 to LED-B5, LED-BH1, LED-RGB1, LED-V1, LED-V2; not known but by kind: daylight, bulb, white-led, "
    "fluorescent; flat E, equal-energy (the paper's assumption); a file of "
    "wavelength and power (two columns, .spdx, Argyll's .sp, rawtoaces' JSON, a Sekonic's or UPRtek's export); "
    "torch for the phone's own; or auto for a phone's photo under whatever light."
)


def lamp_names() -> tuple[str, ...]:
    """Names that `read_lamp` accepts, in addition to `<T>K`, `D:<T>` and files."""
    return (*bundled()["lamps"], "equal-energy", *FAMILIES)


@lru_cache(maxsize=1024)
def is_lamp_name(text: str) -> bool:
    """Whether a text is a known name or formula of a lamp, which goes before a file of that name."""
    key, words = text.strip().casefold(), plain(text)
    common = (plain(name) for alias in lamp_aliases() if alias.lamp for name in alias.names)
    known = {*UNNAMED, "equalenergy", *map(plain, FAMILIES), *common}
    return words in known or bool(BULB_NAME.fullmatch(key) or DAYLIGHT_NAME.fullmatch(key) or cie_name(text))


def read_lamp(spec: LampLike) -> Lamp:
    """Read the spectral power of a lamp by name, formula, file or object, scaled to a mean of 1 on the grid.

    - A CIE illuminant: `A`, `D55`, `FL2` or `F2`, `LED-B3` ...; case, blanks and hyphens do not matter.
    - `2856K`: Planck's law with c₂ = 1.4388e-2 m K (CIE 15, ITS-90), 1000 to 20,000 K.
    - `D:5500`: CIE daylight of that correlated colour temperature (CIE 15), 4000 to 25,000 K, without correction.
      The D illuminants were named when c₂ was 1.4380e-2: D55 is `D:5503`, D65 is `D:6504`.
    - `equal-energy`: exactly 1 with tolerance 0, the paper's own assumption.
    - A kind of lamp: `daylight`, `bulb`, `white-led`, `fluorescent` (families.py): a mean, and modes of its error.
    - A common name: `halogen`, `TL84`, `sun` ... (data/lamp-names.json). The lamp has the standard name, and `source`
      states the given one. Ambiguous names, such as `flash`, are refused with advice.
    - A file of wavelength (nm) and power, which must cover 400 to 700 nm in steps of 20 nm at most: two
      columns, CGATS (Argyll's .sp), IES TM-27 (.spdx), rawtoaces' JSON, Sekonic's CSV or UPRtek's text, recognised by
      their content.
      Outside its range the power is held constant, which `source` states. If its steps are finer than the grid's,
      power is averaged over each step of the grid, so that no narrow line is lost. Negative noise, down to 0.5 % of
      the peak from 380 to 720 nm, is set to 0.
    - An object with `wavelengths` and `values`, or a pair of arrays, like a file; a Lamp is returned unchanged.

    The tolerance is 2 % for a name or formula, 1 % for a file or an object, `LampKind.left` for a family of tables.

    Example:
        >>> from camssf.spectra import read_lamp
        >>> read_lamp("D55").values.shape
        (681,)
        >>> read_lamp(([380, 390, 400, 550, 700, 720], [1] * 6))  # doctest: +ELLIPSIS
        Traceback (most recent call last):
        camssf.errors.LampUnfit: lamp (given) has a gap of 150 nm: ...

    Raises:
        InvalidArgument: no lamp, unknown name, temperature out of range, or a file that is not such a table.
        LampUnfit: power that is negative, not finite or all zero, or a file with too small a range or too large gaps.
    """
    if isinstance(spec, Lamp):
        return spec
    modes = frozen(np.zeros((0, WAVELENGTHS.size)))
    if spec is not None and not isinstance(spec, str | PathLike):
        return _given_lamp(spec, modes)
    text = text_of(spec)
    key = text.casefold()
    if not text:
        raise InvalidArgument(
            "The lamp is missing.",
            "One photo cannot do without: dividing by the white frame, Eq. (5), does not cancel the lamp's spectrum, "
            "and no photo of a chart tells lamp from camera. Taking a bulb (A) for flat light costs an RMSE of 0.10, "
            f"more than the curve of an average camera does (0.08). {_LAMP_MENU}",
        )
    if key in UNNAMED:
        raise InvalidArgument(
            "A light that is not named has no spectrum.", f"Only a chart's photo can tell it. {_LAMP_MENU}"
        )
    if plain(text) == "equalenergy":
        return Lamp(text, frozen(np.ones_like(WAVELENGTHS)), 0.0, modes, "equal energy, by definition")
    if kind := {plain(name): name for name in FAMILIES}.get(plain(text)):
        return _family(kind)
    if match := BULB_NAME.fullmatch(key):
        power, source, tolerance = _planck(float(match[1])), f"Planck's law, {match[1]} K", NAMED_LAMP
    elif match := DAYLIGHT_NAME.fullmatch(key):
        power, source, tolerance = _daylight(float(match[1])), f"CIE daylight, {match[1]} K", NAMED_LAMP
    elif name := cie_name(text):
        power, source, tolerance = illuminant(name), f"CIE illuminant {name} (colour-science)", NAMED_LAMP
    elif looks_like_file(text) and not is_lamp_name(text):
        power, source = _measured_lamp(Path(text))
        tolerance = MEASURED_LAMP
    elif meant := resolve_lamp_alias(text):
        lamp = read_lamp(meant)
        return replace(lamp, source=f"{lamp.source}; {text!r} was asked for")
    else:
        if re.fullmatch(r"\d{4,5}", key):
            raise InvalidArgument(
                f"The lamp {text!r} is ambiguous.", f"Write {key}K for a bulb, D:{key} for daylight."
            )
        daylight = re.fullmatch(r"d(\d{2})", key)
        names = (*lamp_names(), *(name for alias in lamp_aliases() for name in alias.names))
        near = f"Did you mean D:{daylight[1]}00? " if daylight else nearest(text, names)
        raise InvalidArgument(f"No lamp is called {text!r}.", near + _LAMP_MENU)
    return Lamp(text, frozen(power / power.mean()), tolerance, modes, source)


def with_tolerance(lamp: Lamp, text: str) -> Lamp:
    """Return the lamp with another tolerance: `2%`, `300K`, or both, `300K,1%`.

    A percentage replaces the lamp's smooth tolerance. A temperature adds a mode: the change of ln L over that many
    kelvin at the lamp's own temperature. Both are one standard deviation.

    Raises:
        InvalidArgument: invalid text, or a temperature for a lamp without a colour temperature.
    """
    for part in filter(None, (p.strip() for p in text.split(","))):
        number = re.fullmatch(r"(\d+(?:\.\d+)?) ?(%|k)", part.casefold())
        if number is None:
            raise InvalidArgument(f"{part!r} is not a lamp tolerance.", "Write 2%, 300K, or 300K,2%.")
        size = float(number[1])
        if number[2] == "%":
            if size > 100 * LARGEST_LAMP_TOLERANCE:
                raise InvalidArgument(
                    f"A lamp tolerance of {size:g} % is too large.", "Name the kind of lamp, or measure its spectrum."
                )
            lamp = replace(lamp, tolerance=size / 100.0)
            continue
        formula, kelvin = _temperature(lamp.name)
        if not 0 < size < LARGEST_KELVIN_TOLERANCE * kelvin:
            raise InvalidArgument(
                f"{size:g} K is too large a tolerance for a lamp of {kelvin:g} K.", "Give less than a quarter of it."
            )
        mode = temperature_mode(formula, kelvin, size)
        source = f"{lamp.source}, ± {size:g} K"
        modes, total = np.concatenate([lamp.modes, mode]), math.hypot(lamp.tolerance_kelvin or 0.0, size)
        lamp = replace(lamp, modes=frozen(modes), source=source, tolerance_kelvin=total)
    return lamp


def _temperature(name: str) -> tuple[Callable[[float], Floats], float]:
    """Formula and colour temperature of a lamp; raises if it has none."""
    key = name.casefold().strip()
    if match := BULB_NAME.fullmatch(key):
        return _planck, float(match[1])
    if match := DAYLIGHT_NAME.fullmatch(key):
        return _daylight, float(match[1])
    cie = cie_name(name)
    if cie in bundled()["kelvin"]:
        return (_planck if cie == "A" else _daylight), bundled()["kelvin"][cie]
    raise InvalidArgument(
        f"The lamp {name!r} has no temperature to be off in.",
        "Give its tolerance in percent; kelvins suit A, D50 to D75, 3000K or D:5500.",
    )


def _family(name: str) -> Lamp:
    family = FAMILIES[name]
    tolerance = NAMED_LAMP
    if isinstance(family, DrawnKind):
        return drawn_lamp(name, bundled()["families"][name], family.words)
    if isinstance(family, Temperature):
        power, modes = _planck(family.centre), temperature_mode(_planck, family.centre, family.spread)
        source = f"Planck, {family.centre:g} ± {family.spread:g} K"
    else:
        power, modes = principal_modes([illuminant(member) for member in family.members], family.components)
        source = f"mean and {len(modes)} principal components of {len(family.members)} CIE lamps"
        tolerance = family.left
    return Lamp(name, frozen(power / power.mean()), tolerance, frozen(modes), source)


def drawn_lamp(name: str, table: dict[str, Any], words: str) -> Lamp:
    """A kind of drawn lamps, or a shape of one, from its mean and modes at the nodes."""
    power, *rows = (linear(table | {"values": row}) for row in (table["mean"], *table["modes"]))
    modes = np.stack(rows) / np.maximum(power, table["dimmest"] * power.max())
    source = f"mean and {len(modes)} principal components of {words}"
    return Lamp(name, frozen(power / power.mean()), table["tolerance"], frozen(modes), source)


def _planck(kelvin: float) -> Floats:
    coldest, hottest = TEMPERATURES["planck"]
    if not coldest <= kelvin <= hottest:
        raise InvalidArgument(
            f"A lamp of {kelvin:g} K is not possible.", f"Give {coldest:g}K to {hottest:g}K.", value=kelvin
        )
    return planck(kelvin)


def _daylight(kelvin: float) -> Floats:
    warmest, bluest = TEMPERATURES["daylight"]
    if not warmest <= kelvin <= bluest:
        raise InvalidArgument(
            f"CIE daylight is not defined at {kelvin:g} K.",
            f"Give D:{warmest:g} to D:{bluest:g}; for a bulb {kelvin:g}K, without D.",
            value=kelvin,
        )
    return daylight(kelvin)


def cie_name(text: str) -> str | None:
    """The name of the CIE illuminant that a text means, in any spelling; None for another text."""
    key = re.sub(r"^f(?=\d)", "fl", plain(text).removeprefix("cie"))
    return {plain(name): name for name in bundled()["lamps"]}.get(key)


def _measured_lamp(path: Path) -> tuple[Floats, str]:
    wavelengths, power = read_spectrum(path)
    return _power(wavelengths, power, path), f"file {path.name}{held(wavelengths)}"


def _given_lamp(given: Spectrum | Pair, modes: Floats) -> Lamp:
    """A lamp from an object or from arrays, treated like a measured file."""
    spectrum = sampled(
        given, "lamp", f"Give a name, a Lamp, an object with wavelengths and values, or both as arrays. {_LAMP_MENU}"
    )
    if len(spectrum.values) != 1:
        raise InvalidArgument(
            f"{spectrum.name} holds {len(spectrum.values)} spectra, a lamp is one.", "Give one of them."
        )
    power = _power(spectrum.wavelengths, spectrum.values[0], Path(spectrum.name))
    source = f"{spectrum.source}{held(spectrum.wavelengths)}"
    return Lamp(spectrum.name, frozen(power / power.mean()), MEASURED_LAMP, modes, source)


def _power(wavelengths: Floats, power: Floats, path: Path) -> Floats:
    """Check measured power (w,) and convert it to the grid, (681,); `path` is its name in messages."""
    wavelengths, power = ascending(wavelengths, power)
    check_wavelengths(wavelengths, path, "lamp_unfit")
    # Nodes that the grid needs; a spectrometer's noise beyond them does not matter.
    first = max(int(np.searchsorted(wavelengths, WAVELENGTHS[0] - STEP, side="right")) - 1, 0)
    last = int(np.searchsorted(wavelengths, WAVELENGTHS[-1] + STEP)) + 1
    wavelengths, power = wavelengths[first:last], power[first:last]
    if not np.isfinite(power).all():
        raise fail("lamp_unfit.not_a_number", file=path)
    seen = power[(wavelengths >= WAVELENGTHS[0]) & (wavelengths <= WAVELENGTHS[-1])]
    peak = float(seen.max())
    if peak <= 0:
        raise fail("lamp_unfit.no_power", file=path)
    power = power / peak
    least = float(seen.min()) / peak
    if least < -NOISE_BELOW_ZERO:
        raise fail("lamp_unfit.negative", value=least, threshold=-NOISE_BELOW_ZERO, file=path)
    fine = np.diff(wavelengths).min() < 0.99 * STEP
    power = np.maximum(power, 0.0)
    return _step_means(wavelengths, power) if fine else np.interp(WAVELENGTHS, wavelengths, power)


def _step_means(wavelengths: Floats, power: Floats) -> Floats:
    """Mean over each step of the grid, (681,), by exact integration of the linear interpolant of the samples."""
    edges = np.append(WAVELENGTHS - STEP / 2, WAVELENGTHS[-1] + STEP / 2)
    knots = np.union1d(wavelengths, edges)
    heights = np.interp(knots, wavelengths, power)
    area = np.concatenate([[0.0], np.cumsum(np.diff(knots) * (heights[1:] + heights[:-1]) / 2)])
    means: Floats = np.diff(area[np.searchsorted(knots, edges)]) / STEP
    return np.maximum(means, 0.0)  # rounding may make a difference of sums negative
