"""Files of spectra → numbers: CSV, CGATS text and CxF. Knows formats, not physics: `spectra` judges the values."""

from __future__ import annotations

import csv
import re
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats

_LARGEST_FILE = 20_000_000
_SUFFIXES = ("csv", "tsv", "txt", "spd", "sp", "cxf", "cgats", "ti3", "cie", "dat")


class Spectra(NamedTuple):
    """Named spectra on common wavelengths, as the file has them.

    Attributes:
        names: (n) of the patches, or their numbers.
        wavelengths: (w,) nm.
        values: (n, w) in the file's scale.
    """

    names: tuple[str, ...]
    wavelengths: Floats
    values: Floats


def looks_like_file(text: str) -> bool:
    """True for a path of a file that is there, or that reads like one."""
    if not text or "\0" in text:
        return False
    return bool(re.search(rf"\.({'|'.join(_SUFFIXES)})$|[/\\]", text, re.IGNORECASE)) or is_file(text)


def is_file(text: str) -> bool:
    """True for a file that is there; a path too long to exist is none."""
    try:
        return Path(text).is_file()
    except (OSError, ValueError):
        return False


def read_spectrum(path: Path) -> tuple[Floats, Floats]:
    """Wavelengths and values, (w,) each, of a file with one spectrum: two columns, or CGATS with one set.

    Raises:
        InvalidArgument: the file cannot be read, or is no such table.
    """
    text = _read_text(path)
    if "BEGIN_DATA_FORMAT" in text:
        table = _cgats(text, path)
        if len(table.values) != 1:
            raise InvalidArgument(f"{path} holds {len(table.values)} spectra.", "Give a file with one of them.")
        return table.wavelengths, table.values[0]
    rows = _rows(text)
    start = next((i for i, row in enumerate(rows) if _numbers(row) is not None), len(rows))
    pairs = [_numbers(row) for row in rows[start:]]
    if not pairs or any(pair is None or len(pair) != 2 for pair in pairs):
        raise InvalidArgument(
            f"{path} is no table of one spectrum.",
            "Write a line for each wavelength: the wavelength in nm, the power.",
        )
    wavelengths, values = np.array(pairs, dtype=np.float64).T
    return wavelengths, values


def read_spectra(path: Path) -> Spectra:
    """The spectra of a chart's patches, in the file's order.

    CSV with a line of wavelengths (`380`, `nm380`, `SPECTRAL_NM380` ...) over a line for each patch, or with a
    line for each wavelength; CGATS.17 text with spectral fields; CxF3 (`.cxf`).

    Raises:
        InvalidArgument: the file cannot be read, or is no such table.
    """
    if path.suffix.casefold() == ".cxf":
        return _cxf(_read_bytes(path), path)
    text = _read_text(path)
    return _cgats(text, path) if "BEGIN_DATA_FORMAT" in text else _csv(text, path)


def read_curves(path: Path, name: str | None) -> tuple[str, Floats, Floats]:
    """Camera's name, wavelengths (w,) nm and curves (w, 3) from a CSV whose header names its columns.

    The name is the column `camera`, else the file's own; `name` picks one of several cameras.

    Raises:
        InvalidArgument: the file cannot be read or is no such table; no camera of that name, or several.
    """
    header, *body = _rows(_read_text(path)) or [[]]
    fields = [field.casefold() for field in header]
    wanted = (("wavelength_nm", "wavelength", "nm"), ("red", "r"), ("green", "g"), ("blue", "b"))
    columns = [next((fields.index(word) for word in words if word in fields), -1) for words in wanted]
    if -1 in columns:
        raise InvalidArgument(
            f"{path} is no table of a camera's curves.", "Its first line must read wavelength_nm,red,green,blue."
        )
    label = name or path.stem
    if "camera" in fields:
        at = fields.index("camera")
        names = tuple(dict.fromkeys(row[at] for row in body if len(row) > at))
        wish = (name or (names[0] if len(names) == 1 else "")).casefold()
        label = next((known for known in names if known.casefold() == wish), "")
        if not label:
            close = nearest(name or "", names) or f"One of them is {names[0]}. " if names else ""
            raise InvalidArgument(
                f"{path} has {len(names)} cameras" + (f", none called {name!r}." if name else "."),
                f"{close}Name one as in {path.name}:NAME.",
            )
        body = [row for row in body if len(row) > at and row[at] == label]
    elif name is not None:
        raise InvalidArgument(f"{path} has no column camera.", f"Leave :{name} away, or add that column.")
    rows = [_numbers([row[c] for c in columns]) if len(row) > max(columns) else None for row in body]
    if not rows or any(row is None for row in rows):
        raise InvalidArgument(f"{path} has a line that is no row of numbers.", "Write four numbers in each line.")
    table = np.array(rows, dtype=np.float64)
    return label, table[:, 0], table[:, 1:]


def plain(name: str) -> str:
    """A name without case, blanks, hyphens and underscores, for comparison."""
    return re.sub(r"[\s_-]", "", name.casefold())


def nearest(text: str, names: tuple[str, ...]) -> str:
    """'Did you mean ...? ', or nothing where no name is near."""
    import difflib

    known = {plain(name): name for name in names}
    close = [known[match] for match in difflib.get_close_matches(plain(text), known, n=3)]
    return f"Did you mean {' or '.join(close)}? " if close else ""


def _read_bytes(path: Path) -> bytes:
    if not is_file(str(path)):
        raise InvalidArgument(f"There is no file {path}.", "Check the path.")
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise InvalidArgument(f"{path} is larger than 20 MB.", "Tables of spectra are small: is it another file?")
        return path.read_bytes()
    except OSError as error:
        raise InvalidArgument(f"{path} cannot be read ({error.strerror}).", "Check its permissions.") from None


def _read_text(path: Path) -> str:
    data = _read_bytes(path)
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _rows(text: str) -> list[list[str]]:
    """Fields of every line that is neither empty nor a comment; between them ; or tab or comma or blanks."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    separator = next((mark for mark in ";\t," if lines and mark in lines[-1]), None)
    if separator is None:
        return [line.split() for line in lines]
    try:
        rows = [[field.strip() for field in row] for row in csv.reader(lines, delimiter=separator)]
    except csv.Error:
        return []
    for row in rows:
        while row and not row[-1]:  # separators at the end of a line
            row.pop()
    return [row for row in rows if row]


def _numbers(fields: list[str]) -> list[float] | None:
    """The fields as numbers, or None. A comma that is left is a decimal comma: half of Europe writes it."""
    try:
        return [float(field.replace(",", ".")) for field in fields]
    except ValueError:
        return None


def _wavelength(field: str) -> float | None:
    """380 of 380, nm380, 380nm, SPEC_380, SPECTRAL_NM380, SPECTRAL_NM_380 ...; None of anything else."""
    match = re.fullmatch(
        r"(?:spectral_?|spec_?|reflectance_?|r_?)?(?:nm_?)?(\d{3,4}(?:[.,]\d+)?) ?(?:nm)?", field.casefold()
    )
    value = float(match[1].replace(",", ".")) if match else 0.0
    return value if 200.0 <= value <= 2500.0 else None


def _no_chart(path: Path) -> InvalidArgument:
    return InvalidArgument(
        f"{path} is no table of reflectances.",
        "Write a line of wavelengths and a line for each patch, or a line for each wavelength, a column a patch.",
    )


def _csv(text: str, path: Path) -> Spectra:
    rows = _rows(text)
    for i, row in enumerate(rows[:40]):  # instruments write a preamble
        if sum(_wavelength(field) is not None for field in row) >= 10:
            return _under_wavelengths(row, rows[i + 1 :], path)
    start = next((i for i, row in enumerate(rows) if len(row) > 2 and _numbers(row) is not None), len(rows))
    lines = [_numbers(row) for row in rows[start:]]
    if not lines or any(line is None or len(line) != len(lines[0] or ()) for line in lines):
        raise _no_chart(path)
    table = np.array(lines, dtype=np.float64)
    count = table.shape[1] - 1
    header = rows[start - 1][1:] if start else []
    names = header if len(header) == count else [str(i + 1) for i in range(count)]
    return Spectra(tuple(names), table[:, 0], table[:, 1:].T)


def _under_wavelengths(header: list[str], body: list[list[str]], path: Path) -> Spectra:
    """Rows of patches under a header of which some fields are wavelengths, others names."""
    nm = {i: w for i, field in enumerate(header) if (w := _wavelength(field)) is not None}
    if not body or any(len(row) != len(header) for row in body):
        raise _no_chart(path)
    values = [_numbers([row[i] for i in nm]) for row in body]
    if any(row is None for row in values):
        raise _no_chart(path)
    words = [re.sub(r"[^a-z]", "", field.casefold()) for field in header]
    known = ("sampleloc", "samplename", "patchname", "patch", "name", "sampleid", "id")
    columns = [words.index(word) for word in known if word in words] or [i for i in (0,) if i not in nm]
    named = [tuple(row[i] for row in body) for i in columns] + [tuple(str(i + 1) for i in range(len(body)))]
    # A column of positions (A1 ...) orders the patches; without one, the first column of names.
    positions = [names for names in named if all(re.fullmatch(r"[A-Na-n]\d{1,2}", name) for name in names)]
    return Spectra((positions + named)[0], np.array(list(nm.values())), np.array(values, dtype=np.float64))


def _cgats(text: str, path: Path) -> Spectra:
    """The first table with spectral fields of a CGATS.17 file (Argyll's .ti3 and .sp are such files)."""
    clean = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("#"))
    for part in clean.split("BEGIN_DATA_FORMAT")[1:]:
        fields, _, rest = part.partition("END_DATA_FORMAT")
        data = rest.partition("BEGIN_DATA")[2].partition("END_DATA")[0]
        header = _tokens(fields)
        if sum(_wavelength(field) is not None for field in header) < 10:
            continue
        body = [
            [field.strip().strip('"') for field in line.split("\t")] for line in data.splitlines() if line.strip()
        ]
        if any(len(row) != len(header) for row in body):  # not one set a line between tabs: blanks count, too
            words = _tokens(data)
            body = [words[i : i + len(header)] for i in range(0, len(words), len(header))]
        return _under_wavelengths(header, body, path)
    raise InvalidArgument(
        f"{path} has no table of spectra.", "Export the spectral data (fields such as SPECTRAL_NM380), too."
    )


def _tokens(text: str) -> list[str]:
    return [token.strip('"') for token in re.findall(r'"[^"\n]*"|[^\s"]+', text)]


def _cxf(data: bytes, path: Path) -> Spectra:
    """The reflectance spectra of a CxF3 file (ISO 17972-1), read by colour-cxf (BSD-3-Clause)."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import colour_cxf
            from colour_cxf.cxf3 import ReflectanceSpectrum

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
            if isinstance(spectrum, ReflectanceSpectrum)
        ]
        grids = [
            (spectrum.start_wl or span.start_wl) + span.increment * np.arange(len(spectrum.value), dtype=np.float64)
            for _, spectrum, span in found
        ]
        values = np.array([spectrum.value for _, spectrum, _ in found], dtype=np.float64)
    except Exception:  # the XML parsers behind it, and gaps in the tree, raise many kinds
        found = []
    if not found or not all(np.array_equal(grid, grids[0]) for grid in grids):
        raise InvalidArgument(
            f"{path} is no CxF3 file with reflectance spectra on one set of wavelengths.",
            "Export it again; its ColorSpecification needs a WavelengthRange with StartWL and Increment.",
        )
    return Spectra(tuple(name for name, _, _ in found), grids[0], values)
