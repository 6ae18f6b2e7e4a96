"""Reads text files: their rows, numbers and wavelengths; shared by all readers of spectra."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from os import PathLike, curdir, fspath
from os.path import join
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from camssf.errors import InvalidArgument
from camssf.files import error_in_words, kind_of, local, read_advice
from camssf.grid import Floats
from camssf.spectra.limits import LARGEST_FILE, LONGEST_CELL, NAMED, NANOMETRES, ROUNDED, SAMPLE

_NUMBER = re.compile(r"[+-]?(?:(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?|nan|inf|infinity)", re.IGNORECASE)
_SEPARATED = re.compile(r"[+-]?[0-9]{1,3}(?:[.,'’ʼ´`_ \u00a0\u2007\u2009\u202f][0-9]{3})+(?:[.,][0-9]*)?")
"""Numbers with thousands separators of any country, such as 9'000 or 9.000,5."""
_GROUPED = {mark: re.compile(rf"[+-]?[1-9][0-9]{{0,2}}\{mark}[0-9]{{3}}") for mark in ",."}
"""Cells in which the mark may be a decimal mark or a thousands separator, such as 9,000."""
_WHOLE = re.compile(r"[+-]?0*[1-9][0-9]*")


class TextRow(NamedTuple):
    """One line of a text table.

    Attributes:
        line: its number in the file, from 1.
        fields: its cells.
        mark: the separator between them; a blank for any number of blanks.
    """

    line: int
    fields: list[str]
    mark: str


def number_of(field: str) -> float | None:
    """The cell as a number, or None. A comma is a decimal comma."""
    return float(field.replace(",", ".")) if _NUMBER.fullmatch(field.strip()) else None


def numbers_of(fields: Sequence[str]) -> list[float] | None:
    """The cells as numbers, or None if one is not a number."""
    numbers = [number_of(field) for field in fields]
    return None if None in numbers else [value for value in numbers if value is not None]


def numeral(field: str) -> bool:
    """Whether the cell is a number, possibly with thousands separators."""
    return bool(_NUMBER.fullmatch(field) or _SEPARATED.fullmatch(field))


def numbers_in(rows: Sequence[TextRow], path: Path, *, wavelengths: bool) -> Floats:
    """The numbers (n, k) of n rows with k cells each.

    Args:
        rows: of the table, without its header.
        path: of the file, for messages.
        wavelengths: whether the first column holds wavelengths; their decimal mark is then known.

    Raises:
        InvalidArgument: a cell is not a number, has thousands separators or may have them.
    """
    for row in rows:
        for field in row.fields:
            if not _NUMBER.fullmatch(field):
                raise _separated(path, row, field) if _SEPARATED.fullmatch(field) else not_a_number(path, row, field)
    _check_marks(rows, path, int(wavelengths))
    return np.array([numbers_of(row.fields) for row in rows], dtype=np.float64)


def _check_marks(rows: Sequence[TextRow], path: Path, first: int) -> None:
    """Raise where 9,000 may be nine or nine thousand, judged by the other cells.

    A cell such as 0,95 shows that the comma is the decimal mark, 380,5 nm that it is the wavelengths'. Without the
    former, whole numbers beside it, the other mark as decimal mark, or quotes in a comma-separated file are a doubt.
    If all cells have the mark and three digits behind it, both readings differ by a factor alone.
    """
    values = [field for row in rows for field in row.fields[first:]]
    whole = any(_WHOLE.fullmatch(field) for field in values)
    decimal = {mark: any(mark in cell and not _GROUPED[mark].fullmatch(cell) for cell in values) for mark in ",."}
    in_nm = dict.fromkeys(",.", False)
    for row in rows if first else ():
        value = number_of(row.fields[0]) or 0.0
        for mark in ",.":
            in_nm[mark] |= mark in row.fields[0] and NANOMETRES[0] <= value <= NANOMETRES[1]
    for mark, other in (",.", ".,"):
        elsewhere = not in_nm[mark] and (in_nm[other] or (bool(rows) and rows[0].mark == mark))
        if not decimal[mark] and (whole or decimal[other] or elsewhere):
            for row in rows:
                for field in row.fields[first:]:
                    if _GROUPED[mark].fullmatch(field):
                        raise _separated(path, row, field, doubted=True)


def _separated(path: Path, row: TextRow, field: str, *, doubted: bool = False) -> InvalidArgument:
    what = "may be a decimal number or have a thousands separator" if doubted else "has a thousands separator"
    return InvalidArgument(
        f"{path}, line {row.line}: '{field}' {what}.",
        "Export the numbers without thousands separators, with a decimal point.",
    )


def not_a_number(path: Path, row: TextRow, field: str) -> InvalidArgument:
    """The error for a cell that is not a number."""
    what = f"'{field[:40]}'" if field else "an empty cell"
    return InvalidArgument(f"{path}, line {row.line}: {what} is not a number.", "Correct that line, or leave it out.")


COMMENTS = ("#", "%", "//", "!", "sep=")
"""Beginnings of lines that are no data; the last one is Excel's."""
_SEPARATORS = (";", "\t", ",", " ")
_WAVELENGTH = re.compile(
    r"(?:(?:spectral[ _]?(?:data)?|spec|spd|reflectance|refl|wavelength|lambda|λ|wl|w|r|s|x)[ _=:(\[-]*)?"
    r"(?:nm[ _=:-]*)?([0-9]{3,4}(?:[.,][0-9]+)?)[ _-]*[\[(]?(?:nm)?[\])]?"
)
SUFFIXES = (
    "csv", "tsv", "txt", "spd", "sp", "cxf", "cgats", "ti3", "cie", "dat", "json", "spdx", "xls", "cmf",
)  # fmt: skip
"""Suffixes by which a text is taken for a file name. Formats are recognised by content, not by suffix."""


def looks_like_file(text: str) -> bool:
    """Whether a text is the path of an existing file, or looks like a path. Ask first whether it is a known name."""
    if not text or "\0" in text:
        return False
    return looks_like_path(text) or is_file(text)


def looks_like_path(text: str) -> bool:
    """Whether a text names a folder or ends as files of spectra do."""
    return bool(re.search(rf"\.({'|'.join(SUFFIXES)})$|[/\\]", text, re.IGNORECASE))


def path_text(path: str | PathLike[str]) -> str:
    """A path as a text that is no known name: `./D55` for D55."""
    text = fspath(path)
    return text if looks_like_path(text) else join(curdir, text)


def is_file(text: str) -> bool:
    """Whether the file exists; False also for a path that is too long."""
    try:
        return Path(text).is_file()
    except (OSError, ValueError):
        return False


def plain(name: str) -> str:
    """A name without case, blanks, hyphens and underscores, for comparison."""
    return re.sub(r"[\s_-]", "", name.casefold())


def nearest(text: str, names: tuple[str, ...]) -> str:
    """'Did you mean ...? ', or an empty text if no name is similar."""
    import difflib

    known = {plain(name): name for name in names}
    close = [known[match] for match in difflib.get_close_matches(plain(text), known, n=3)]
    return f"Did you mean {' or '.join(close)}? " if close else ""


def read_bytes(path: Path) -> bytes:
    """Read a file's content.

    Raises:
        InvalidArgument: it does not exist, is too large, or cannot be read.
    """
    local(path)
    try:
        if path.is_dir():
            raise InvalidArgument(f"{path} is a folder, no file.", "Name a file in it.")
        if not path.exists():
            raise InvalidArgument(f"There is no file {path}.", "Check the path.")
        if path.stat().st_size > LARGEST_FILE:
            raise InvalidArgument(
                f"{path} is larger than {LARGEST_FILE / 1e6:g} MB.", "Tables of spectra are smaller. Check the file."
            )
        return path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise InvalidArgument(f"{path} cannot be read ({error_in_words(error)}).", read_advice(error)) from None


def read_text(path: Path) -> str:
    """Read a file's text: UTF-16, UTF-8 or Latin-1, with or without a byte order mark; errors as in `read_bytes`."""
    data = read_bytes(path)
    if not data.startswith(b"<") and (kind := kind_of(data)) is not None:
        raise InvalidArgument(f"{path} is {kind}, not a table.", "Save the table as CSV or text, or give a name.")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    if b"\0" in data[:2]:  # UTF-16 of a text that begins with ASCII
        return data.decode("utf-16-be" if data[:1] == b"\0" else "utf-16-le", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def lines_of(text: str) -> list[str]:
    """The lines, as editors count them; comments are empty lines."""
    return ["" if line.lstrip().startswith(COMMENTS) else line for line in re.split(r"\r\n|\r|\n", text)]


def rows_of(text: str) -> list[TextRow]:
    """Split each line that is neither empty nor a comment into cells at semicolons, tabs, commas or blanks.

    The separator is the one that gives most rows of numbers, else one of the last line.
    """
    lines = [(number, line) for number, line in enumerate(lines_of(text), 1) if line.strip()]
    sample = [line for _, line in lines[-SAMPLE:]]
    rows = {mark: sum(_numeric(cells(line, mark)) for line in sample) for mark in _SEPARATORS}
    separator = max(rows, key=lambda mark: rows[mark])
    if not rows[separator]:
        separator = next((mark for mark in _SEPARATORS if lines and mark in lines[-1][1]), " ")
    text_rows = [TextRow(number, cells(line, separator), separator) for number, line in lines]
    return [row for row in text_rows if row.fields]


def cells(line: str, mark: str) -> list[str]:
    """The cells of a line, without empty ones at its end; a cell in double quotes may hold the separator."""
    if mark == " ":
        return [cell for cell in re.split(r"[ \t\f\v]+", line) if cell]
    try:
        parts = (
            line.split(mark) if '"' not in line else next(csv.reader([line], delimiter=mark, skipinitialspace=True))
        )
    except csv.Error:
        parts = [line]
    parts = [cell.strip() for cell in parts]
    while parts and not parts[-1]:
        parts.pop()
    return parts


def _numeric(fields: list[str]) -> bool:
    """Whether all cells are numbers, but for a name or a wavelength in the first one."""
    named = len(fields) > 2 or (len(fields) == 2 and (numeral(fields[0]) or wavelength_of(fields[0]) is not None))
    return named and all(numeral(field) for field in fields[1:])


def wavelength_of(field: str) -> float | None:
    """380 from 380, nm380, 380_NM, R380, 380 [nm], SPECTRAL_NM_380, λ=380 ...; None for anything else."""
    match = _WAVELENGTH.fullmatch(field.strip().casefold()) if len(field) <= LONGEST_CELL else None
    value = float(match[1].replace(",", ".")) if match else 0.0
    return value if NAMED[0] <= value <= NAMED[1] else None


def tokens_of(text: str) -> list[str]:
    """Split CGATS text at blanks; text in quotes is one word."""
    return [token.strip('"') for token in re.findall(r'"[^"\n]*"|[^\s"]+', text)]


UNSOUND = (ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError, RecursionError)
"""Exceptions that can occur when a document has another form."""


def json_number(value: Any) -> float:
    """Convert a JSON number.

    Raises:
        TypeError: it is something else.
        OverflowError: it is too large.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(value)
    return float(value)


def shows_light(text: str) -> bool:
    """Whether the file holds light; False for a reflectance or transmittance."""
    kind = re.search(r'^MEAS_TYPE\s+"?(\w+)', text, re.MULTILINE)
    return kind is None or kind[1] not in ("REFLECTIVE", "TRANSMISSIVE")


def exact_wavelengths(named: Floats, text: str) -> Floats:
    """Wavelengths (w,) from the file's number of bands, start and end, if they fit those of the names."""
    matches = [
        re.search(rf'^SPECTRAL_{word}\s+"?([0-9.]+)', text, re.MULTILINE) for word in ("BANDS", "START_NM", "END_NM")
    ]
    try:
        bands, first, last = (float(match[1]) if match else float("nan") for match in matches)
    except ValueError:
        return named
    if bands != len(named):
        return named
    exact = np.linspace(first, last, len(named))
    return exact if np.abs(exact - named).max() < ROUNDED else named


def with_plain_wavelength(row: TextRow) -> TextRow:
    """The row with 380 in place of `380nm` in its first cell."""
    first = row.fields[0]
    if number_of(first) is not None or (value := wavelength_of(first)) is None:
        return row
    return row._replace(fields=[repr(value), *row.fields[1:]])
