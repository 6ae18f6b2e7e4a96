"""The printed geometry of charts: the shipped layouts, and the reader of a user's own layout file."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from camssf.errors import InvalidArgument
from camssf.spectra.limits import LONGEST_NAME, NARROWEST, PATCHES, SIDES
from camssf.spectra.text import read_text
from camssf.strict_json import parse_strict

FORMAT = "camssf-layout/1"
REQUIRED = ("format", "name", "columns", "rows", "patch", "gap")
FIELDS = (*REQUIRED, "white", "fiducials")
ADVICE = 'docs/tables.md shows a layout. "patch" and "gap" may be in any unit: "patch": [18, 18], "gap": [3, 3].'

Point = tuple[float, float]


@dataclass(frozen=True)
class ChartLayout:
    """The printed geometry of a chart, in units of its patch pitch (centre to centre).

    Attributes:
        name: key in LAYOUTS, or the name in the user's file.
        columns, rows: number of patches; patch i lies at column i % columns, row i // columns.
        side: edge of a patch in pitches, along x and y (the rest is the gap).
        products: charts sold with this geometry.
        white: name of the white patch in the table; "" for the brightest neutral patch.
        fiducials: positions of four marks around the patches, which the user may mark by hand in place of the block's
            corners: lattice coordinates (x, y), clockwise from the top left; empty if there are none.
    """

    name: str
    columns: int
    rows: int
    side: tuple[float, float]
    products: str = ""
    white: str = ""
    fiducials: tuple[Point, ...] = ()

    @property
    def shipped(self) -> bool:
        """Whether it is one of LAYOUTS."""
        return self.name in LAYOUTS

    PLAIN: ClassVar[dict[str, Any]] = {
        "description": "The printed geometry of a chart: the name of one that camssf ships, or a layout as in "
        "docs/tables.md.",
        "type": ["string", "object"],
    }

    def to_plain(self) -> Any:
        """The layout in a document: its name if it is shipped."""
        return self.name if self.shipped else self.document()

    @staticmethod
    def from_plain(value: Any, place: str) -> ChartLayout:
        """The layout of a document.

        Raises:
            InvalidArgument: neither the name of a shipped layout nor a "camssf-layout/1" document.
        """
        if isinstance(value, str):
            if value not in LAYOUTS:
                raise InvalidArgument(f"{value!r} is no shipped layout.", f"Give one of {', '.join(LAYOUTS)}.")
            return LAYOUTS[value]
        return layout_from(value, place)

    def document(self) -> dict[str, Any]:
        """The layout as a "camssf-layout/1" document, in pitches."""
        edges: dict[str, Any] = {"patch": list(self.side), "gap": [1 - edge for edge in self.side]}
        if self.white:
            edges["white"] = self.white
        if self.fiducials:
            edges["fiducials"] = [
                [p + edge / 2 for p, edge in zip(mark, self.side, strict=True)] for mark in self.fiducials
            ]
        return {"format": FORMAT, "name": self.name, "columns": self.columns, "rows": self.rows} | edges


LAYOUTS: dict[str, ChartLayout] = {
    layout.name: layout
    for layout in (
        ChartLayout("classic24", 6, 4, (0.88, 0.88), "ColorChecker Classic (X-Rite, Calibrite, Macbeth)"),
        ChartLayout("passport24", 6, 4, (0.83, 0.83), "ColorChecker Passport Photo and Video, classic page"),
        ChartLayout("nano24", 6, 4, (0.86, 0.86), "ColorChecker Classic Nano"),
        ChartLayout("mini24", 6, 4, (0.88, 0.88), "ColorChecker Classic Mini"),
        ChartLayout("sg140", 14, 10, (0.835, 0.836), "ColorChecker Digital SG"),
    )
}
"""The shipped layouts, by name. `find_chart` measures the gap again in every photo."""


def read_layout(path: Path) -> ChartLayout:
    """Read a user's own layout, a JSON file "camssf-layout/1" (docs/tables.md).

    Raises:
        InvalidArgument: the file cannot be read, or is no such layout.
    """
    text = read_text(path)
    try:
        document = parse_strict(text)
    except (ValueError, RecursionError):
        raise InvalidArgument(f"{path} is not JSON.", f"A layout is a JSON object. {ADVICE}") from None
    return layout_from(document, str(path))


def layout_from(document: Any, name: str) -> ChartLayout:
    """The layout of a "camssf-layout/1" document; `name` is its file's name in messages.

    Raises:
        InvalidArgument: it is no such layout.
    """

    def need(right: bool, what: str) -> None:
        if not right:
            raise InvalidArgument(f"{name}: {what}.", ADVICE)

    def edges(field: str, least: str, right: Callable[[float], bool]) -> Point:
        sides = _pair(document[field])
        if sides is None or not all(right(edge) for edge in sides):
            raise InvalidArgument(f'{name}: "{field}" must be a number {least}, or two: across and down.', ADVICE)
        return sides

    need(isinstance(document, dict) and document.get("format") == FORMAT, f'a layout has "format": "{FORMAT}"')
    for field in document:
        need(field in FIELDS, f'a layout has no field "{field}"')
    for field in REQUIRED:
        need(field in document, f'the field "{field}" is missing')
    title, columns, rows = document["name"], document["columns"], document["rows"]
    words = (
        isinstance(title, str)
        and len(title) <= LONGEST_NAME
        and re.fullmatch("[A-Za-z0-9][A-Za-z0-9 ._-]*", title) is not None
    )
    need(words, f'"name" needs 1 to {LONGEST_NAME} letters, digits, spaces, dots, hyphens or underscores')
    need(title.lower() not in LAYOUTS, f'"name" is that of a shipped layout, {title}')
    for field in ("columns", "rows"):
        count = document[field]
        whole = isinstance(count, int) and not isinstance(count, bool) and SIDES[0] <= count <= SIDES[1]
        need(whole, f'"{field}" must be a whole number from {SIDES[0]} to {SIDES[1]}')
    few, most = PATCHES
    need(few <= columns * rows <= most, f"it has {columns * rows} patches; {few} to {most} are possible")
    patch, gap = (
        edges("patch", "above 0", lambda edge: edge > 0),
        edges("gap", "of at least 0", lambda edge: edge >= 0),
    )
    side = (patch[0] / (patch[0] + gap[0]), patch[1] / (patch[1] + gap[1]))
    need(
        min(side) >= NARROWEST,
        f"the gaps are too wide: a patch must take at least {100 * NARROWEST:g} % of the step to the next",
    )
    white = document.get("white", "")
    need(isinstance(white, str) and len(white) <= LONGEST_NAME, '"white" must be the name of a patch in the table')
    marks = _marks(document.get("fiducials", []), patch, gap)
    what = '"fiducials" must be four points [x, y], clockwise from the top left, around the patches'
    need(marks is not None and (not marks or _surround(marks, side, columns, rows)), what)
    return ChartLayout(title, columns, rows, side, "", white, tuple(marks or ()))


def _marks(given: Any, patch: Point, gap: Point) -> list[Point] | None:
    """Marks from the outer corner of the first patch, in lattice coordinates; None if they are not four points."""
    points = (
        [_pair(mark) if isinstance(mark, list) else None for mark in given] if isinstance(given, list) else [None]
    )
    marks = [point for point in points if point is not None]
    if len(marks) != len(points) or len(points) not in (0, 4):
        return None
    return [((x - patch[0] / 2) / (patch[0] + gap[0]), (y - patch[1] / 2) / (patch[1] + gap[1])) for x, y in marks]


def _pair(value: Any) -> Point | None:
    """A number, or two, as two floats below a million in size; None for anything else."""
    both = value if isinstance(value, list) else [value, value]
    if len(both) != 2 or any(isinstance(number, bool) or not isinstance(number, int | float) for number in both):
        return None
    return (float(both[0]), float(both[1])) if all(abs(number) < 1e6 for number in both) else None


def _surround(marks: list[Point], side: Point, columns: int, rows: int) -> bool:
    """Whether the marks run clockwise and the block of patches lies inside them or on their edges."""
    left, top, right, bottom = -side[0] / 2, -side[1] / 2, columns - 1 + side[0] / 2, rows - 1 + side[1] / 2
    ends = ((left, top), (right, top), (right, bottom), (left, bottom))
    for i, (x, y) in enumerate(marks):
        dx, dy = marks[(i + 1) % 4][0] - x, marks[(i + 1) % 4][1] - y
        if dx == dy == 0 or any(dx * (v - y) - dy * (u - x) < -1e-9 for u, v in ends):
            return False
    return True
