"""The stage `finder`: small pictures with one, two or no charts, and what is found in them."""

from __future__ import annotations

from collections.abc import Iterator
from math import isqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf.photo.find.candidates import find_candidates
from camssf.photo.find.chart_colours import ChartColours, chart_colours
from camssf.photo.find.picture import SearchImage, codes_of_bytes, codes_of_light, codes_of_mosaic, rgb_of_yuv
from camssf.photo.find.search import own_kind, plain_signals
from camssf.photo.read.dng import Mosaic
from golden.contract import Call, Stage, words
from golden.drawing import BLACK, GAP, TABLE, TILTED, Samples, View, charts, draw, file, photo_case, turned
from golden.forms import Json
from golden.products import CARD, own_card, read_card, read_photo

FORMS = ("mosaic", "light", "rgb", "luma", "yuv")
"""Forms to which the photo is converted before the search (format.md)."""
DAMAGED: dict[str, Json] = {
    "format": {"format": "camssf-layout/2"},
    "field": {"colums": 7},
    "name": {"name": "classic24"},
    "rows": {"rows": 5.5},
    "patches": {"columns": 30, "rows": 30},
    "gap": {"gap": [1, 2, 3]},
    "wide": {"gap": 20},
    "fiducials": {"fiducials": CARD["fiducials"][::-1]},
}
"""Fields of damaged layouts."""
WIDE = View((440, 300), (-60 * 8 * 900, 900, 150), (-30 * 8 * 900, -120, 900), (48 * 8 * 900, 30, -12))


def planes(photo: Mosaic) -> NDArray[np.int64]:
    """(h, w, 3) DN above black (256), at least 0: red, the first green and blue of every cell."""
    first = [photo.cfa.index(letter) for letter in "RGB"]
    height, width = (side // 2 for side in photo.samples.shape)
    cells = [photo.samples[k // 2 :: 2, k % 2 :: 2][:height, :width].astype(np.int64) for k in first]
    return np.maximum(np.stack(cells, axis=2) - BLACK, 0)


def shown(light: NDArray[np.int64]) -> NDArray[np.uint8]:
    """(h, w, 3) 8-bit values of planes: twice the integer square root."""
    return np.array([2 * isqrt(int(v)) for v in light.ravel()], dtype=np.uint8).reshape(light.shape)


Row: TypeAlias = tuple[str, str, str, Json]
"""Name, comment, photo, and what is unlike the base case: one of FORMS, or a chart of the user's own."""


def photos() -> dict[str, bytes]:
    """All photos by name."""
    one, chart = draw(turned(24, 0)), draw(turned(48, 0), unrest=0)
    large = np.full((chart.shape[0], 1960), TABLE, dtype=np.uint16)
    large[:, 1000 : 1000 + chart.shape[1]] = chart
    semi_gloss = next(kind for kind in chart_colours() if kind.columns == 14)
    drawn = {
        "tilted": draw(WIDE),
        "large": large,
        "two": np.concatenate([one, draw(turned(24, 2))]),
        "row": np.concatenate([draw(turned(24, 0, margin=36))] * 2, axis=1),
        "sg140": upright(semi_gloss, 20),
        "clutter": _cluttered(),
        "keys": keys_beside(),
        "none": _clutter((480, 320)),
        "part": one[:, :120],
    }
    return {
        **charts(),
        **{f"finder-{name}.dng": file(samples) for name, samples in drawn.items()},
        "finder-card.dng": card_photo(),
    }


def rows() -> list[Row]:
    """All cases that are no errors."""
    card = own_card()
    return [
        *((f"form-{form}", f"An upright chart, searched as {form}.", "chart-turned-0", {"form": form})
          for form in FORMS),
        *((f"turned-{n}", f"The chart turned by {90 * n}° clockwise.", f"chart-turned-{n}", {})
          for n in (1, 2, 3)),
        ("mirrored", "A mirrored chart.", "chart-mirrored", {}),
        ("tilted", "Turned and tilted.", "finder-tilted", {}),
        ("tilted-yuv", "The same as a preview's planes.", "finder-tilted", {"form": "yuv"}),
        ("reduced", "A large photo: blocks of cells make a pixel of the search.", "finder-large", {}),
        ("two", "Two charts: the first in the list agrees best.", "finder-two", {}),
        ("two-aligned", "Two charts whose rows and pitches run on from one to the other.", "finder-row", {}),
        ("semi-gloss", "140 patches, the classic 24 among them.", "finder-sg140", {}),
        ("clutter", "Between keys and tiles.", "finder-clutter", {}),
        ("keys-beside", "Between keys about as wide as patches.", "finder-keys", {}),
        ("none", "Keys and tiles alone.", "finder-none", {}),
        ("part", "Half of a chart.", "finder-part", {}),
        ("own-layout", "A chart of the user's own layout and table.", "finder-card", card),
        ("own-layout-rgb", "The same as a picture for a display.", "finder-card", {"form": "rgb"} | card),
        ("own-layout-elsewhere", "A ColorChecker where another chart is searched.", "chart-turned-0", card),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    files, wrong = photos(), "invalid_argument"
    for name, comment, photo, change in rows():
        yield photo_case(f"finder/{name}", comment, {"dng": f"{photo}.dng", "form": "mosaic"} | change, files)
    small, own = ({"dng": f"{photo}.dng", "form": "mosaic"} for photo in ("chart-small", "finder-card"))
    yield photo_case("finder/error-small", "28 × 20 cells.", small, files, wrong)
    for name, fields in DAMAGED.items():
        damaged = {"layout": CARD | fields, "csv": ""}
        yield photo_case(f"finder/error-layout-{name}", "A damaged layout file.", own | damaged, files, wrong)


def upright(kind: ChartColours, pitch: int) -> Samples:
    """An upright chart of this kind with patches 0.8 pitch wide, 30 px from the edges."""
    colours = BLACK + np.rint(12000 * kind.colours).astype(np.int64)
    height, width = (n * pitch + 60 for n in (kind.rows, kind.columns))
    y, x = np.mgrid[0:height, 0:width].astype(np.int64)
    i, j = (x - 30) // pitch, (y - 30) // pitch
    inside = (x >= 30) & (y >= 30) & (i < kind.columns) & (j < kind.rows)
    edge = pitch // 10
    for place in ((x - 30) % pitch, (y - 30) % pitch):
        inside &= (place >= edge) & (place < pitch - edge)
    patch = np.where(inside, np.clip(j, 0, kind.rows - 1) * kind.columns + np.clip(i, 0, kind.columns - 1), 0)
    colour = np.array([[0, 1], [1, 2]])[y % 2, x % 2]
    noise = (29 * x + 37 * y + x * y) % 7 - 3
    return np.asarray(np.where(inside, colours[patch, colour], GAP) + noise, dtype=np.uint16)


def card_kind(card: Json) -> ChartColours:
    """The kind of chart of a layout and its table."""
    table = read_card(card)
    return own_kind(table.layout, plain_signals(table))


def card_photo() -> bytes:
    """A photo of the user's own chart."""
    return file(upright(card_kind(own_card()), 24))


def _clutter(size: tuple[int, int]) -> Samples:
    """A background without a chart: keys in the upper third, grey tiles in the middle, marks below."""
    width, height = size
    y, x = np.mgrid[0:height, 0:width].astype(np.int64)
    noise = (29 * x + 37 * y + x * y) % 11 - 5
    keys = np.where((x % 26 < 20) & (y % 26 < 20), 1200, 420)
    tiles = np.where((x % 34 < 30) & (y % 34 < 30), 700 + 900 * ((5 * (x // 34) + 3 * (y // 34)) % 11), TABLE)
    marks = np.where(((x * x // 97 + 3 * y) % 23 < 9) & (y % 14 < 8), 600, 6000)
    third = height // 3
    return np.asarray(np.where(y < third, keys, np.where(y < 2 * third, tiles, marks)) + noise, dtype=np.uint16)


def keys_beside() -> Samples:
    """An upright chart with keys next to its board: left, above and below."""
    chart = draw(turned(32, 0))[10:-10, 10:-10]
    height, width = chart.shape
    y, x = np.mgrid[0 : height + 80, 0 : width + 260].astype(np.int64)
    samples = np.where((x % 38 < 30) & ((y + 8) % 38 < 30), 1200, 420) + (29 * x + 37 * y + x * y) % 11 - 5
    samples[30 : 30 + height, 240 : 240 + width] = chart
    return np.asarray(samples, dtype=np.uint16)


def _cluttered() -> Samples:
    """The tilted chart on the background of `_clutter`."""
    samples = _clutter((480, 320))
    chart = draw(TILTED)
    samples[60 : 60 + chart.shape[0], 120 : 120 + chart.shape[1]] = chart
    return samples


def run(call: Call) -> dict[str, Any]:
    """The stage `finder`: charts found in one of the forms of a photo; the points of all charts concatenated."""
    given = call.given
    photo = read_photo(given["dng"])
    kinds = (card_kind(given),) if "layout" in given else None
    result = find_candidates(_searched(photo, given["form"]), kinds)
    seen = result.candidates
    return {
        "findings": list(result.findings),
        "kinds": [each.kind for each in seen],
        "mirrored": [each.mirrored for each in seen],
        "seen": [each.blobs for each in seen],
        "corners": np.array([each.corners for each in seen]).reshape(-1, 2),
        "patches": np.concatenate([np.zeros((0, 2)), *(each.patches for each in seen)]),
        "confidence": np.array([each.confidence for each in seen]),
    }


def _searched(photo: Mosaic, form: str) -> SearchImage:
    if form == "mosaic":
        return codes_of_mosaic(photo)
    light = planes(photo)
    if form == "light":
        return codes_of_light(light.astype(np.float32))
    picture = shown(light)
    if form == "yuv":
        y, blue, red = (picture[:, :, channel].astype(np.int64) for channel in (1, 2, 0))
        u, v = (np.clip(128 + (each - y) // 2, 0, 255)[::2, ::2].astype(np.uint8) for each in (blue, red))
        picture = rgb_of_yuv(picture[:, :, 1], u, v)
    return codes_of_bytes(picture[:, :, 1] if form == "luma" else picture)


STAGE = Stage(
    name="finder",
    requires="finder",
    cases=cases,
    run=run,
    inputs=words("dng form"),
    optional=words("layout csv"),
    arrays=frozenset(),
    limits=(
        ("exact", 0.0, "findings kinds mirrored seen"),
        ("norm", 1e-13, "corners patches"),
        ("norm", 3e-9, "confidence"),
    ),
)
