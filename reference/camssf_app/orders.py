"""Checks the orders of the page before anything is done: their form, names and files.

An order is the JSON that the page sent for a task. It names files by their numbers, lamps and charts by the names of
the lists: no text of it ever becomes a path. A file that was sent keeps its own name, in a folder of its number.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeAlias, get_type_hints

from camssf.documents import forms
from camssf.documents.forms import BrokenError
from camssf.errors import InvalidArgument
from camssf.files import readable
from camssf.grid import Floats
from camssf.shapes import Bounds, Pattern, Shape
from camssf.spectra.lamps import AUTO
from camssf.spectra.limits import REFERENCE
from camssf_app.menus import CHART_MENU, lamp_menu

MOST_FILES = 32
"""Files that a tab takes."""
_LETTERS = Pattern(r"[^\ud800-\udfff]*", "must be text without lone surrogates")
Name: TypeAlias = Annotated[str, Bounds(0, 1000), _LETTERS]
FileNumber: TypeAlias = Annotated[int, Bounds(1, MOST_FILES)]
Coordinate: TypeAlias = Annotated[float, Bounds(-1e6, 1e6)]
Rectangle: TypeAlias = tuple[Coordinate, Coordinate, Coordinate, Coordinate]
Corners: TypeAlias = Annotated[Floats, Shape((4, 2), -1e6, 1e6)]
PhotoNumbers: TypeAlias = Annotated[tuple[FileNumber, ...], Bounds(1, MOST_FILES)]

RESULT = Path("result")
"""The folder of the newest report, in the session's folder."""
UPLOADS = {"photo": "", "layout": ".json", "table": ""}
"""Kinds of files from the page, and the ending that a name gets if it has another: a layout is known by it."""
LONGEST_NAME = 60
"""Characters; at most four bytes each, and a file system takes 255."""
LONGEST_ENDING = 12
_UNSAFE = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|\u202a-\u202e\u2066-\u2069\ud800-\udfff]')
"""Separators and what Windows forbids; control characters, also those that turn text around; lone surrogates."""


def stored_name(kind: str, name: str) -> str:
    """The name under which a file from the page is stored: its own, without what could mean something in a path."""
    plain = _UNSAFE.sub("_", name).lstrip(". -").rstrip(". ")
    if not plain.lower().endswith(UPLOADS[kind]):
        plain += UPLOADS[kind]
    ending = Path(plain).suffix[:LONGEST_ENDING]
    return plain.removesuffix(ending)[: LONGEST_NAME - len(ending)] + ending or kind


@dataclass(frozen=True)
class ChartFiles:
    """A chart of the user's own.

    Attributes:
        table: number of the file of its reflectances.
        layout: number of the file of its layout.
    """

    table: FileNumber
    layout: FileNumber | None = None


Chart: TypeAlias = Name | ChartFiles
FIRST_CHART = next(iter(CHART_MENU))


@dataclass(frozen=True)
class FindOrder:
    """Search for the chart in a photo.

    Attributes:
        photo: its number.
        chart: which chart.
    """

    photo: FileNumber
    chart: Chart = FIRST_CHART


@dataclass(frozen=True)
class ChartOrder:
    """Check the files of a chart.

    Attributes:
        chart: which chart.
    """

    chart: Chart


@dataclass(frozen=True, eq=False)
class OrderedShot:
    """A photo under one lamp.

    Attributes:
        photo, white, dark: numbers of the frames.
        lamp: its light.
        corners: x, y of the chart's four, clockwise from the top left, pixels of the sensor.
    """

    photo: FileNumber
    lamp: Name = AUTO
    white: FileNumber | None = None
    dark: FileNumber | None = None
    corners: Corners | None = None


@dataclass(frozen=True)
class CalibrateOrder:
    """Calibrate the camera.

    Attributes:
        shots: the shots.
        chart: which chart.
    """

    shots: Annotated[tuple[OrderedShot, ...], Bounds(1, MOST_FILES)]
    chart: Chart = FIRST_CHART


@dataclass(frozen=True)
class ColourOrder:
    """Measure the colour of a region.

    Attributes:
        photo: its number.
        region, white: left, top, width, height of the surface and of the reference, pixels of the sensor.
        reflectance: of the reference.
        lamp: the light.
    """

    photo: FileNumber
    region: Rectangle
    white: Rectangle
    reflectance: Annotated[float, Bounds(*REFERENCE)]
    lamp: Name = AUTO


@dataclass(frozen=True)
class ExportOrder:
    """Write the result in another program's format.

    Attributes:
        to: name of the format.
    """

    to: Name


@dataclass(frozen=True)
class KeyOrder:
    """Make a pair of keys for passports.

    Attributes:
        passphrase: of the private key; "" for none.
    """

    passphrase: Name = ""


@dataclass(frozen=True)
class PassportOrder:
    """Sign the result.

    Attributes:
        key: the private key, PEM.
        photos: numbers of the result's photos.
        passphrase: of the key.
        serial: serial number of the camera.
    """

    key: Annotated[str, Bounds(0, 2**20), _LETTERS]
    photos: PhotoNumbers
    passphrase: Name = ""
    serial: Name = ""


Order: TypeAlias = FindOrder | ChartOrder | CalibrateOrder | ColourOrder | ExportOrder | KeyOrder | PassportOrder


@dataclass(frozen=True)
class Orders:
    """Orders of the page of camssf app, one member for each task.

    Attributes:
        find: search for the chart.
        chart: check a chart's files.
        calibrate: calibrate the camera.
        colour: measure a colour.
        export: write another format.
        key: make keys.
        passport: sign the result.
    """

    find: FindOrder
    chart: ChartOrder
    calibrate: CalibrateOrder
    colour: ColourOrder
    export: ExportOrder
    key: KeyOrder
    passport: PassportOrder


ORDERS: dict[str, type[Order]] = get_type_hints(Orders)
"""The order of each task."""


def read_order(task: str, plain: Any, folder: Path) -> Order:
    """The order of a task, checked; `folder` is the session's.

    Raises:
        InvalidArgument: another form than the task's, a lamp, chart or format that is in no list, a file that was not
            sent, or no result yet.
    """
    from camssf.exports import FORMATS

    try:
        order = forms.part_of(ORDERS[task], plain)
    except BrokenError as error:
        place, fault = error.args
        raise InvalidArgument(
            readable(f"The order {task}{place} {fault}."),
            "Correct it; docs/schemas/order.schema.json has the forms.",
        ) from None
    match order:
        case FindOrder() | ChartOrder():
            listed_chart(order.chart, folder)
        case CalibrateOrder():
            listed_chart(order.chart, folder)
            for shot in order.shots:
                listed_lamp(shot.lamp)
        case ColourOrder():
            listed_lamp(order.lamp)
        case ExportOrder() if order.to not in FORMATS:
            raise InvalidArgument(f"There is no export to {order.to!r}.", f"Take one of {', '.join(FORMATS)}.")
    for number in _photos(order):
        uploaded("photo", number, folder)
    if task in ("colour", "export", "passport"):
        result_path(folder)
    return order


def _photos(order: Order) -> list[int]:
    """The numbers of the photos that an order names."""
    match order:
        case FindOrder() | ColourOrder():
            return [order.photo]
        case CalibrateOrder():
            frames = [(shot.photo, shot.white, shot.dark) for shot in order.shots]
            return [number for shot in frames for number in shot if number is not None]
        case PassportOrder():
            return list(order.photos)
    return []


def uploaded(kind: str, number: int, folder: Path = Path()) -> Path:
    """A file that the page sent, by its number.

    Raises:
        InvalidArgument: there is no such file.
    """
    uploads = list((folder / f"{kind}-{number}").glob("*"))
    if not uploads:
        raise InvalidArgument(f"This tab has no {kind} {number}.", f"Drop the {kind} again.")
    return uploads[0]


def listed_lamp(name: str) -> str:
    """The lamp of an order: a name of the list or "auto", never a file."""
    if name != AUTO and name not in {code for _, lamps in lamp_menu() for code, _ in lamps}:
        raise InvalidArgument(f"There is no lamp {name!r} in the list.", "Choose one from it, or leave it unknown.")
    return name


def listed_chart(chart: Chart, folder: Path = Path()) -> str:
    """The chart of an order as `read_chart` takes it: a name of the list, or the user's own files."""
    from camssf.spectra import chart_names

    if isinstance(chart, ChartFiles):
        numbers = (("layout", chart.layout), ("table", chart.table))
        return ":".join(str(uploaded(kind, number, folder)) for kind, number in numbers if number is not None)
    if chart not in chart_names():
        raise InvalidArgument(f"There is no chart {chart!r} in the list.", "Choose one from it.")
    return chart


def result_path(folder: Path = Path()) -> Path:
    """The newest result's file.

    Raises:
        InvalidArgument: there is none.
    """
    path = folder / RESULT / "result.json"
    if not path.is_file():
        raise InvalidArgument("This tab has no result yet.", "Calibrate first.")
    return path
