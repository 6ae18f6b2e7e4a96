"""Reads text files and splits them into rows; shared by all readers of spectra."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from camssf.errors import InvalidArgument
from camssf.files import PHOTO, kind_of

LARGEST_FILE = 20_000_000
SUFFIXES = (
    "csv", "tsv", "txt", "spd", "sp", "cxf", "cgats", "ti3", "cie", "dat", "json", "spdx", "xls", "cmf",
)  # fmt: skip
"""Suffixes by which a text is taken for a file name. Formats are recognised by content, not by suffix."""


def looks_like_file(text: str) -> bool:
    """Whether a text is the path of an existing file, or looks like a path."""
    if not text or "\0" in text:
        return False
    return bool(re.search(rf"\.({'|'.join(SUFFIXES)})$|[/\\]", text, re.IGNORECASE)) or is_file(text)


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
    if not is_file(str(path)):
        raise InvalidArgument(f"There is no file {path}.", "Check the path.")
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InvalidArgument(f"{path} is larger than 20 MB.", "Tables of spectra are smaller. Check the file.")
        return path.read_bytes()
    except OSError as error:
        raise InvalidArgument(f"{path} cannot be read ({error.strerror}).", "Check its permissions.") from None


def read_text(path: Path) -> str:
    """Read a file's text: UTF-16 with a byte order mark, else UTF-8, else Latin-1; errors as in `read_bytes`."""
    data = read_bytes(path)
    if data.startswith(PHOTO):
        raise InvalidArgument(f"{path} is {kind_of(data)}, not a table.", "Give a file of numbers, or a name.")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def rows_of(text: str) -> list[list[str]]:
    """Split each line that is neither empty nor a comment into fields at semicolons, tabs, commas or blanks."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    separator = next((mark for mark in ";\t," if lines and mark in lines[-1]), None)
    if separator is None:
        return [line.split() for line in lines]
    try:
        found = [[field.strip() for field in row] for row in csv.reader(lines, delimiter=separator)]
    except csv.Error:
        return []
    for row in found:
        while row and not row[-1]:  # separators at the end of a line
            row.pop()
    return [row for row in found if row]


def numbers_of(fields: list[str]) -> list[float] | None:
    """The fields as numbers, or None. A comma inside a field is a decimal comma."""
    try:
        return [float(field.replace(",", ".")) for field in fields]
    except ValueError:
        return None


def wavelength_of(field: str) -> float | None:
    """380 from 380, nm380, 380nm, SPEC_380, SPECTRAL_NM380, SPECTRAL_NM_380 ...; None for anything else."""
    match = re.fullmatch(
        r"(?:spectral_?|spec_?|reflectance_?|r_?)?(?:nm_?)?(\d{3,4}(?:[.,]\d+)?) ?(?:nm)?", field.casefold()
    )
    value = float(match[1].replace(",", ".")) if match else 0.0
    return value if 200.0 <= value <= 2500.0 else None


def tokens_of(text: str) -> list[str]:
    """Split CGATS text at blanks; text in quotes is one word."""
    return [token.strip('"') for token in re.findall(r'"[^"\n]*"|[^\s"]+', text)]
