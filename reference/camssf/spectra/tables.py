"""Reads files of spectra as numbers: CSV, CGATS text and CxF here, each other format in `readers`.

The format is recognised by the content. The callers check the values.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.libraries import library
from camssf.spectra.limits import FEWEST_IN_HEADER, LARGEST_DEVIATION, LONGEST_QUOTE, PREAMBLE
from camssf.spectra.readers import CURVES, LAMPS
from camssf.spectra.text import (
    TextRow,
    exact_wavelengths,
    lines_of,
    nearest,
    not_a_number,
    number_of,
    numbers_in,
    numeral,
    read_bytes,
    read_text,
    rows_of,
    shows_light,
    tokens_of,
    wavelength_of,
    with_plain_wavelength,
)

DEVIATIONS = {"std", "stdev", "sd", "sigma", "σ", "se", "err", "error", "deviation", "uncertainty"}
"""Words in a header that mark a column as a standard deviation."""


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
    for reader in LAMPS:
        if reader.claims(text):
            return reader.read(text, path)
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
    wavelengths, power = _one_row(rows, path) or _two_columns(rows, path)
    return wavelengths, power


def _one_row(rows: list[TextRow], path: Path) -> tuple[Floats, Floats] | None:
    """Wavelengths and power, (w,) each, of a header of wavelengths and the row below it; None without a header."""
    at = _header_of_wavelengths(rows)
    if at is None:
        return None
    spectra = _under_wavelengths(rows[at], rows[at + 1 :], path)
    if len(spectra.values) != 1:
        raise InvalidArgument(
            f"{path} holds {len(spectra.values)} spectra, from line {rows[at + 1].line} on.",
            "Give a file with one of them.",
        )
    return spectra.wavelengths, spectra.values[0]


def _two_columns(rows: list[TextRow], path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and power, (w,) each, of the table with a line for each wavelength."""
    header, lines = _spectrum_lines(rows, path)
    width = len(lines[0].fields)
    odd = next((row for row in lines if len(row.fields) != width), None)
    if odd is not None:
        raise _no_spectrum(path, f"line {odd.line} has {len(odd.fields)} numbers, line {lines[0].line} has {width}.")
    if width > 3:
        raise _no_spectrum(path, f"line {lines[0].line} has {width} numbers{_named(header)}.")
    table = numbers_in(lines, path, wavelengths=True)
    if width == 3 and not _is_deviation(header.fields if header else [], lines, table):
        raise InvalidArgument(
            f"{path} has two columns beside the wavelength, and the second is no standard deviation of the "
            f"first{_named(header)}.",
            "Give one lamp a file; a standard deviation is named std in the header, or is small against the power. "
            "Where a comma separates the columns, the decimal mark must be a point.",
        )
    return table[:, 0], table[:, 1]


def _named(header: TextRow | None) -> str:
    """Quote a header in a message."""
    return "" if header is None else f"; its header, line {header.line}, reads {_quoted(header)}"


def _quoted(row: TextRow) -> str:
    words = (" " if row.mark == "\t" else row.mark).join(row.fields)
    return f"'{words[:LONGEST_QUOTE]}'"


def _spectrum_lines(rows: list[TextRow], path: Path) -> tuple[TextRow | None, list[TextRow]]:
    """The header, if any, and the lines of numbers of the table of one spectrum; text around it is left out.

    Raises:
        InvalidArgument: no such line, or a line before or after the table that may belong to it.
    """
    runs: list[tuple[int, int]] = []
    for numeric, run in groupby(range(len(rows)), lambda i: _is_line(rows[i])):
        if numeric:
            places = list(run)
            runs.append((places[0], places[-1] + 1))
    if not runs:
        for row in rows:
            odd = next((cell for cell in row.fields[1:] if not numeral(cell)), None)
            if odd is not None and _may_be_wavelength(row):
                raise not_a_number(path, row, odd)
        first = f"; line {rows[0].line} reads {_quoted(rows[0])}" if rows else ""
        raise _no_spectrum(path, f"no line has a wavelength and a number{first}.")
    start, end = max(runs, key=lambda run: (sum(_may_be_wavelength(rows[i]) for i in range(*run)), run[1] - run[0]))
    for i in range(len(rows)):
        beside = i in (start - 1, end)
        if not start <= i < end and _may_be_wavelength(rows[i]) and (beside or _is_line(rows[i])):
            parting = rows[start - 1] if i < start else rows[end]
            is_one = _may_be_wavelength(parting)
            what = "is not a wavelength and a number" if is_one else "stands between two tables of numbers"
            raise _no_spectrum(path, f"line {parting.line}, {_quoted(parting)}, {what}.")
    return rows[start - 1] if start and len(rows[start - 1].fields) > 1 else None, rows[start:end]


def _is_line(row: TextRow) -> bool:
    """Whether a row is a number, then one or more numbers, possibly with thousands separators."""
    return len(row.fields) > 1 and number_of(row.fields[0]) is not None and all(numeral(cell) for cell in row.fields)


def _may_be_wavelength(row: TextRow) -> bool:
    """Whether the row begins with a number that may be a wavelength in nm."""
    return wavelength_of(row.fields[0]) is not None


def _no_spectrum(path: Path, why: str) -> InvalidArgument:
    return InvalidArgument(
        f"{path} is not a table of one spectrum: {why}",
        "Write a line for each wavelength: the wavelength in nm, the power. Leave out all other tables.",
    )


def _is_deviation(header: list[str], lines: list[TextRow], table: Floats) -> bool:
    """Whether the third column is the power's standard deviation, by its header or, without one, by its size.

    Digits such as 05 are decimals behind a comma.
    """
    if any(re.fullmatch("0[0-9]+", row.fields[2]) for row in lines):
        return False
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
    for reader in CURVES:
        if reader.claims(text):
            return pick(reader.read(text, path), path, name)
    if "BEGIN_DATA_FORMAT" in text:
        return pick({path.stem: _three_sets(text, path)}, path, name)
    rows = rows_of(text)
    header, body = _curves_header(rows, path)
    fields = [_word(field) for field in header]
    columns = _columns(fields)
    label = name or path.stem
    if "camera" in fields:
        at = fields.index("camera")
        names = tuple(dict.fromkeys(row.fields[at] for row in body if len(row.fields) > at))
        label = one_of(names, path, name)
        body = [row for row in body if len(row.fields) > at and row.fields[at] == label]
    elif name is not None:
        raise InvalidArgument(f"{path} has no column camera.", f"Leave out :{name}, or add that column.")
    if not body:
        raise InvalidArgument(f"{path} has no line below its header.", "Write four numbers in each line.")
    table = numbers_in(_selected(body, columns, path), path, wavelengths=True)
    return label, table[:, 0], table[:, 1:]


_CURVES = ("wavelength_nm", "red", "green", "blue")
_COLUMNS = (("wavelength_nm", "wavelength", "nm", "lambda", "λ"), ("red", "r"), ("green", "g"), ("blue", "b"))


def _word(field: str) -> str:
    """A column's name without its unit in brackets."""
    return field.casefold().partition("(")[0].partition("[")[0].strip()


def _columns(fields: Sequence[str]) -> list[int]:
    """Indices of wavelength, red, green and blue; -1 for a column that is missing."""
    return [next((fields.index(word) for word in words if word in fields), -1) for words in _COLUMNS]


def _curves_header(rows: list[TextRow], path: Path) -> tuple[Sequence[str], list[TextRow]]:
    """Names of the columns, and the rows below; a file of four columns of numbers needs no names."""
    for i, row in enumerate(rows[:PREAMBLE]):
        if -1 not in _columns([_word(field) for field in row.fields]):
            return row.fields, rows[i + 1 :]
    if rows and len(rows[0].fields) == 4 and _is_line(rows[0]):
        if (odd := next((row for row in rows if len(row.fields) != 4), None)) is not None:
            raise InvalidArgument(
                f"{path}, line {odd.line}: {_quoted(odd)} is not four numbers.", "Write wavelength, red, green, blue."
            )
        return _CURVES, rows
    first = f"; line {rows[0].line} reads {_quoted(rows[0])}" if rows else ""
    raise InvalidArgument(
        f"{path} is not a table of a camera's curves{first}.",
        "Its first line must read wavelength_nm,red,green,blue, or be four numbers in that order.",
    )


def _selected(rows: list[TextRow], columns: Sequence[int], path: Path) -> list[TextRow]:
    """The rows' cells in these columns."""
    for row in rows:
        if len(row.fields) <= max(columns):
            raise InvalidArgument(
                f"{path}, line {row.line}: {_quoted(row)} has too few cells.", "Correct that line, or leave it out."
            )
    return [row._replace(fields=[row.fields[i] for i in columns]) for row in rows]


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


def _no_chart(path: Path, why: str) -> InvalidArgument:
    return InvalidArgument(
        f"{path} is not a table of reflectances: {why}",
        "Write a line of wavelengths and a line for each patch, or a line for each wavelength, a column a patch.",
    )


def _header_of_wavelengths(rows: list[TextRow]) -> int | None:
    """Index of the first row with at least ten wavelengths, which may stand below a preamble; None without one."""
    for i, row in enumerate(rows[:PREAMBLE]):
        if sum(wavelength_of(field) is not None for field in row.fields) >= FEWEST_IN_HEADER:
            return i
    return None


def _csv(text: str, path: Path) -> SpectraTable:
    rows = rows_of(text)
    at = _header_of_wavelengths(rows)
    if at is not None:
        return _under_wavelengths(rows[at], rows[at + 1 :], path)
    rows = [with_plain_wavelength(row) for row in rows]
    start = next((i for i, row in enumerate(rows) if len(row.fields) > 2 and _is_line(row)), len(rows))
    lines = rows[start:]
    if not lines:
        first = f"; line {rows[0].line} reads {_quoted(rows[0])}" if rows else ""
        raise _no_chart(path, f"no line has ten wavelengths, or a wavelength and the numbers of the patches{first}.")
    width = len(lines[0].fields)
    odd = next((row for row in lines if len(row.fields) != width), None)
    if odd is not None:
        raise _no_chart(
            path, f"line {odd.line}, {_quoted(odd)}, has {len(odd.fields)} cells, line {lines[0].line} has {width}."
        )
    table = numbers_in(lines, path, wavelengths=True)
    header = rows[start - 1].fields[1:] if start else []
    names = header if len(header) == width - 1 else [str(i + 1) for i in range(width - 1)]
    return SpectraTable(tuple(names), table[:, 0], table[:, 1:].T)


def _under_wavelengths(header: TextRow, body: list[TextRow], path: Path) -> SpectraTable:
    """Read rows of patches, or of one lamp, under a header with wavelengths and other fields."""
    nm = {i: w for i, field in enumerate(header.fields) if (w := wavelength_of(field)) is not None}
    width = len(header.fields)
    odd = next((row for row in body if len(row.fields) != width), None)
    if odd is not None:
        raise InvalidArgument(
            f"{path}, line {odd.line}: {_quoted(odd)} has {len(odd.fields)} cells, its header, line {header.line}, "
            f"{width}.",
            "Correct that line, or leave it out.",
        )
    if not body:
        raise InvalidArgument(
            f"{path} has no line below its header, line {header.line}.", "Write one for a spectrum."
        )
    values = numbers_in([row._replace(fields=[row.fields[i] for i in nm]) for row in body], path, wavelengths=False)
    words = [re.sub(r"[^a-z]", "", field.casefold()) for field in header.fields]
    known = ("sampleloc", "samplename", "patchname", "patch", "name", "sampleid", "id")
    columns = [words.index(word) for word in known if word in words] or [i for i in (0,) if i not in nm]
    named = [tuple(row.fields[i] for row in body) for i in columns] + [tuple(str(i + 1) for i in range(len(body)))]
    # The patches' names are positions (A1 ...) if there is such a column, else the first column of names.
    positions = [names for names in named if all(re.fullmatch(r"[A-Na-n]\d{1,2}", name) for name in names)]
    return SpectraTable((positions + named)[0], np.array(list(nm.values())), values)


def _cgats(text: str, path: Path) -> SpectraTable:
    """Read the first table with spectral fields of a CGATS.17 file, such as Argyll's .ti3 and .sp."""
    clean = "\n".join(lines_of(text))
    first, *parts = clean.split("BEGIN_DATA_FORMAT")
    line = 1 + first.count("\n")
    for part in parts:
        fields, _, rest = part.partition("END_DATA_FORMAT")
        between, _, rest = rest.partition("BEGIN_DATA")
        data, ended, _ = rest.partition("END_DATA")
        at, line = line, line + part.count("\n")
        header = tokens_of(fields)
        if sum(wavelength_of(field) is not None for field in header) < FEWEST_IN_HEADER:
            continue
        if not ended:
            raise InvalidArgument(f"{path} ends early: its table has no END_DATA.", "Export it again.")
        lines = list(enumerate(data.split("\n"), at + fields.count("\n") + between.count("\n")))
        body = [
            TextRow(number, [field.strip().strip('"') for field in words.split("\t")], "\t")
            for number, words in lines
            if words.strip()
        ]
        if any(len(row.fields) != len(header) for row in body):  # not one tab-separated set per line: split at blanks
            tokens = [(number, word) for number, words in lines for word in tokens_of(words)]
            sets = [tokens[i : i + len(header)] for i in range(0, len(tokens), len(header))]
            body = [TextRow(words[0][0], [word for _, word in words], " ") for words in sets]
        rows = _under_wavelengths(TextRow(at, header, " "), body, path)
        return rows._replace(wavelengths=exact_wavelengths(rows.wavelengths, clean))
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
            specification.id: specification.measurement_spec.wavelength_range
            for specification in resources.color_specification_collection.color_specification
            if specification.measurement_spec is not None
        }
        spectra: list[tuple[str, Any, Any]] = [
            (str(item.name), spectrum, ranges.get(spectrum.color_specification))
            for item in resources.object_collection.object_value
            for spectrum in (item.color_values.choice if item.color_values is not None else ())
            if isinstance(spectrum, colour_cxf.cxf3.ReflectanceSpectrum)
        ]
        grids = [
            (spectrum.start_wl or span.start_wl) + span.increment * np.arange(len(spectrum.value), dtype=np.float64)
            for _, spectrum, span in spectra
        ]
        values = np.array([spectrum.value for _, spectrum, _ in spectra], dtype=np.float64)
    except InvalidArgument:
        raise
    except Exception:  # its XML parsers and missing elements raise many kinds
        spectra = []
    if not spectra or not all(np.array_equal(grid, grids[0]) for grid in grids):
        raise InvalidArgument(
            f"{path} is not a CxF3 file with reflectance spectra on one set of wavelengths.",
            "Export it again; its ColorSpecification needs a WavelengthRange with StartWL and Increment.",
        )
    return SpectraTable(tuple(name for name, _, _ in spectra), grids[0], values)
