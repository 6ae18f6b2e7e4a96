"""Reads files of spectra as numbers: CSV, CGATS text and CxF here, each other format in `readers`.

The format is recognised by the content. The callers check the values.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.libraries import library
from camssf.spectra.readers import CURVES, LAMPS
from camssf.spectra.readers.cgats import exact_wavelengths, shows_light
from camssf.spectra.text import nearest, numbers_of, read_bytes, read_text, rows_of, tokens_of, wavelength_of

DEVIATIONS = {"std", "stdev", "sd", "sigma", "σ", "se", "err", "error", "deviation", "uncertainty"}
"""Words in a header that mark a column as a standard deviation."""
LARGEST_DEVIATION = 0.2
"""A third column without a header is a standard deviation if it stays below this part of the largest power."""


class SpectraTable(NamedTuple):
    """Named spectra at common wavelengths, as in the file.

    Attributes:
        names: (n) of the patches, or their numbers.
        wavelengths: (w,) nm.
        values: (n, w) in the file's scale.
    """

    names: tuple[str, ...]
    wavelengths: Floats
    values: Floats


def read_spectrum(path: Path) -> tuple[Floats, Floats]:
    """Read wavelengths and values, (w,) each, from a file with one spectrum.

    The file has two columns, or three with the power's standard deviation, which is dropped; or is CGATS with one
    set, as Argyll's `.sp`; or has one of the formats in `readers.LAMPS`.

    Raises:
        InvalidArgument: the file cannot be read, or is not such a table.
    """
    text = read_text(path)
    for each in LAMPS:
        if each.claims(text):
            return each.read(text, path)
    if "BEGIN_DATA_FORMAT" in text:
        spectra = _cgats(text, path)
        if not shows_light(text):
            raise InvalidArgument(
                f"{path} holds the spectrum of a surface, not of light.",
                "Measure the lamp's emission (spotread -e or -a).",
            )
        if len(spectra.values) != 1:
            raise InvalidArgument(f"{path} holds {len(spectra.values)} spectra.", "Give a file with one of them.")
        return spectra.wavelengths, spectra.values[0]
    rows = rows_of(text)
    start = next((i for i, row in enumerate(rows) if numbers_of(row) is not None), len(rows))
    pairs = [numbers_of(row) for row in rows[start:]]
    widths = {0 if pair is None else len(pair) for pair in pairs}
    if widths not in ({2}, {3}):
        raise InvalidArgument(
            f"{path} is not a table of one spectrum.",
            "Write a line for each wavelength: the wavelength in nm, the power.",
        )
    table = np.array(pairs, dtype=np.float64)
    if widths == {3} and not _is_deviation(rows[start - 1] if start else [], table):
        raise InvalidArgument(
            f"{path} has two columns beside the wavelength, and the second is no standard deviation of the first.",
            "Give one lamp a file; a standard deviation is named std in the header, or is small against the power.",
        )
    return table[:, 0], table[:, 1]


def _is_deviation(header: list[str], table: Floats) -> bool:
    """Whether the third column is the power's standard deviation, by its header or, without one, by its size."""
    if len(header) == 3:
        return not DEVIATIONS.isdisjoint(re.findall("[a-zσ]+", header[2].casefold()))
    return bool((table[:, 2] >= 0).all() and table[:, 2].max() <= LARGEST_DEVIATION * table[:, 1].max())


def read_spectra(path: Path) -> SpectraTable:
    """Read the spectra of a chart's patches, in the file's order.

    Formats: CSV with a line of wavelengths (`380`, `nm380`, `SPECTRAL_NM380` ...) and then a line for each patch, or
    with a line for each wavelength; CGATS.17 text with spectral fields; CxF3 (`.cxf`).

    Raises:
        InvalidArgument: the file cannot be read, or is not such a table.
    """
    text = read_text(path)
    if path.suffix.casefold() == ".cxf" or text.lstrip().startswith("<"):
        return _cxf(read_bytes(path), path)
    return _cgats(text, path) if "BEGIN_DATA_FORMAT" in text else _csv(text, path)


def read_curves(path: Path, name: str | None) -> tuple[str, Floats, Floats]:
    """Read a camera's name, wavelengths (w,) in nm and curves (w, 3) from a file.

    Formats: CSV whose header names its columns, or with four columns without a header: wavelength, red, green, blue;
    CGATS with three sets in that order, as Argyll's `.cmf`; one of `readers.CURVES`. The name is from the column
    `camera`, else from the file's content, else the file's own name; `name` selects one of several cameras.

    Raises:
        InvalidArgument: the file cannot be read or is not such a table; no camera has that name; several and no name.
    """
    text = read_text(path)
    for each in CURVES:
        if each.claims(text):
            return pick(each.read(text, path), path, name)
    if "BEGIN_DATA_FORMAT" in text:
        return pick({path.stem: _three_sets(text, path)}, path, name)
    header, *body = rows_of(text) or [[]]
    if len(header) == 4 and numbers_of(header) is not None:
        header, body = ["wavelength_nm", "red", "green", "blue"], [header, *body]
        if any(len(row) != 4 for row in body):
            raise InvalidArgument(f"{path} has a line without four numbers.", "Write wavelength, red, green, blue.")
    fields = [field.casefold() for field in header]
    wanted = (("wavelength_nm", "wavelength", "nm"), ("red", "r"), ("green", "g"), ("blue", "b"))
    columns = [next((fields.index(word) for word in words if word in fields), -1) for words in wanted]
    if -1 in columns:
        raise InvalidArgument(
            f"{path} is not a table of a camera's curves.",
            "Its first line must read wavelength_nm,red,green,blue, or be four numbers in that order.",
        )
    label = name or path.stem
    if "camera" in fields:
        at = fields.index("camera")
        names = tuple(dict.fromkeys(row[at] for row in body if len(row) > at))
        label = one_of(names, path, name)
        body = [row for row in body if len(row) > at and row[at] == label]
    elif name is not None:
        raise InvalidArgument(f"{path} has no column camera.", f"Leave out :{name}, or add that column.")
    lines = [numbers_of([row[c] for c in columns]) if len(row) > max(columns) else None for row in body]
    if not lines or any(line is None for line in lines):
        raise InvalidArgument(f"{path} has a line that is not a row of numbers.", "Write four numbers in each line.")
    table = np.array(lines, dtype=np.float64)
    return label, table[:, 0], table[:, 1:]


def _three_sets(text: str, path: Path) -> tuple[Floats, Floats]:
    """Wavelengths (w,) and curves (w, 3) of a CGATS file with three spectra: red, green, blue."""
    table = _cgats(text, path)
    if not shows_light(text):
        raise InvalidArgument(f"{path} holds spectra of surfaces, not a camera's curves.", "Give measured curves.")
    if len(table.values) != 3:
        raise InvalidArgument(
            f"{path} holds {len(table.values)} spectra, a camera has three.",
            "Give red, green and blue, in that order.",
        )
    return table.wavelengths, table.values.T


def pick(cameras: dict[str, tuple[Floats, Floats]], path: Path, name: str | None) -> tuple[str, Floats, Floats]:
    """Select one of a file's cameras; errors as in `one_of`."""
    label = one_of(tuple(cameras), path, name)
    return label, *cameras[label]


def one_of(names: tuple[str, ...], path: Path, name: str | None) -> str:
    """Select the camera of that name, or the only one.

    Raises:
        InvalidArgument: there is none of that name, or there are several and no name was given.
    """
    wish = (name or (names[0] if len(names) == 1 else "")).casefold()
    label = next((known for known in names if known.casefold() == wish), "")
    if not label:
        close = nearest(name or "", names) or f"One of them is {names[0]}. " if names else ""
        raise InvalidArgument(
            f"{path} has {len(names)} cameras" + (f", none called {name!r}." if name else "."),
            f"{close}Name one as in {path.name}:NAME.",
        )
    return label


def _no_chart(path: Path) -> InvalidArgument:
    return InvalidArgument(
        f"{path} is not a table of reflectances.",
        "Write a line of wavelengths and a line for each patch, or a line for each wavelength, a column a patch.",
    )


def _csv(text: str, path: Path) -> SpectraTable:
    rows = rows_of(text)
    for i, row in enumerate(rows[:40]):  # instruments write a preamble
        if sum(wavelength_of(field) is not None for field in row) >= 10:
            return _under_wavelengths(row, rows[i + 1 :], path)
    start = next((i for i, row in enumerate(rows) if len(row) > 2 and numbers_of(row) is not None), len(rows))
    lines = [numbers_of(row) for row in rows[start:]]
    if not lines or any(line is None or len(line) != len(lines[0] or ()) for line in lines):
        raise _no_chart(path)
    table = np.array(lines, dtype=np.float64)
    count = table.shape[1] - 1
    header = rows[start - 1][1:] if start else []
    names = header if len(header) == count else [str(i + 1) for i in range(count)]
    return SpectraTable(tuple(names), table[:, 0], table[:, 1:].T)


def _under_wavelengths(header: list[str], body: list[list[str]], path: Path) -> SpectraTable:
    """Read rows of patches under a header with wavelengths and other fields."""
    nm = {i: w for i, field in enumerate(header) if (w := wavelength_of(field)) is not None}
    if not body or any(len(row) != len(header) for row in body):
        raise _no_chart(path)
    values = [numbers_of([row[i] for i in nm]) for row in body]
    if any(row is None for row in values):
        raise _no_chart(path)
    words = [re.sub(r"[^a-z]", "", field.casefold()) for field in header]
    known = ("sampleloc", "samplename", "patchname", "patch", "name", "sampleid", "id")
    columns = [words.index(word) for word in known if word in words] or [i for i in (0,) if i not in nm]
    named = [tuple(row[i] for row in body) for i in columns] + [tuple(str(i + 1) for i in range(len(body)))]
    # The patches' names are positions (A1 ...) if there is such a column, else the first column of names.
    positions = [names for names in named if all(re.fullmatch(r"[A-Na-n]\d{1,2}", name) for name in names)]
    return SpectraTable((positions + named)[0], np.array(list(nm.values())), np.array(values, dtype=np.float64))


def _cgats(text: str, path: Path) -> SpectraTable:
    """Read the first table with spectral fields of a CGATS.17 file, such as Argyll's .ti3 and .sp."""
    clean = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("#"))
    for part in clean.split("BEGIN_DATA_FORMAT")[1:]:
        fields, _, rest = part.partition("END_DATA_FORMAT")
        data, ended, _ = rest.partition("BEGIN_DATA")[2].partition("END_DATA")
        header = tokens_of(fields)
        if sum(wavelength_of(field) is not None for field in header) < 10:
            continue
        if not ended:
            raise InvalidArgument(f"{path} ends early: its table has no END_DATA.", "Export it again.")
        body = [
            [field.strip().strip('"') for field in line.split("\t")] for line in data.splitlines() if line.strip()
        ]
        if any(len(row) != len(header) for row in body):  # not one tab-separated set per line: split at blanks
            words = tokens_of(data)
            body = [words[i : i + len(header)] for i in range(0, len(words), len(header))]
        found = _under_wavelengths(header, body, path)
        return found._replace(wavelengths=exact_wavelengths(found.wavelengths, clean))
    raise InvalidArgument(
        f"{path} has no table of spectra.", "Export the spectral data (fields such as SPECTRAL_NM380), too."
    )


def _cxf(data: bytes, path: Path) -> SpectraTable:
    """Read the reflectance spectra of a CxF3 file (ISO 17972-1) with colour-cxf (BSD-3-Clause)."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            colour_cxf = library("colour_cxf", f"{path} is CxF, which needs", "cxf")
            resources: Any = colour_cxf.read_cxf(data).resources
        ranges: dict[Any, Any] = {
            each.id: each.measurement_spec.wavelength_range
            for each in resources.color_specification_collection.color_specification
            if each.measurement_spec is not None
        }
        found: list[tuple[str, Any, Any]] = [
            (str(item.name), spectrum, ranges.get(spectrum.color_specification))
            for item in resources.object_collection.object_value
            for spectrum in (item.color_values.choice if item.color_values is not None else ())
            if isinstance(spectrum, colour_cxf.cxf3.ReflectanceSpectrum)
        ]
        grids = [
            (spectrum.start_wl or span.start_wl) + span.increment * np.arange(len(spectrum.value), dtype=np.float64)
            for _, spectrum, span in found
        ]
        values = np.array([spectrum.value for _, spectrum, _ in found], dtype=np.float64)
    except InvalidArgument:
        raise
    except Exception:  # its XML parsers and missing elements raise many kinds
        found = []
    if not found or not all(np.array_equal(grid, grids[0]) for grid in grids):
        raise InvalidArgument(
            f"{path} is not a CxF3 file with reflectance spectra on one set of wavelengths.",
            "Export it again; its ColorSpecification needs a WavelengthRange with StartWL and Increment.",
        )
    return SpectraTable(tuple(name for name, _, _ in found), grids[0], values)
