"""The stages `picture` and `regions`: photos of golden/dng in standard colour, and rectangles of them measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.photo.read.dng import Mosaic
from camssf_colour.picture import standard_picture, white_of_region
from camssf_colour.regions import measure_regions
from golden.contract import Call, Row, Stage, words
from golden.forms import Json
from golden.products import read_photo
from golden.stages.colour import camera_in

REFLECTANCE = 0.3
ANY: Json = dict.fromkeys(("capture/shots/0/photo/make", "capture/shots/0/photo/model"), "")
"""A result that names no camera: the photos are by several."""
BASE: Json = {
    "result": {"case": "colour/named", "but": ANY}, "lamp": "daylight", "photo": "patches-chart.dng", "dark": None,
    "white": [126, 32, 14, 14], "space": "srgb", "shading": "as-stored", "area": [60, 40, 24, 16],
}  # fmt: skip
WHOLE: Json = {"white": None, "area": None}
MAPPED = {"photo": "patches-mapped.dng", "shading": "apply"}
TORCH = {"photo": "patches-white.dng", "dark": "patches-chart.dng", "lamp": "auto"}
CLIPPED = {"photo": "patches-clipped.dng", "white": None, "area": [20, 92, 40, 20]}
WRONG = {"expect": "invalid_argument"}
ROWS: list[Row] = [
    ("reference", "A white surface in the photo, and the lamp by name.", {}),
    ("auto", "The light by the white surface's raw ratios.", {"lamp": "auto"}),
    ("calibration", "No white surface: the balance of the calibration, with its errors.", {"white": None}),
    ("xyz-d50", "XYZ for ICC.", {"space": "xyz-d50"}),
    ("shading", "The lens's map applied.", MAPPED),
    ("corner", "Colours at the edge, from mirrored samples.", {"area": [156, 120, 24, 12]}),
    ("dark", "A dark frame subtracted.", {"dark": "patches-dark.dng"}),
    ("torch", "With the torch minus without it: the noise of both photos.", TORCH),
    ("clipped", "Patches at the ceiling.", CLIPPED),
    ("cfa-bggr", "Another order of the colours.", WHOLE | {"photo": "cfa-bggr.dng"}),
    ("odd", "Odd height and width.", WHOLE | {"photo": "active-area-odd.dng"}),
    ("turned", "A camera held upright.", WHOLE | {"photo": "metadata.dng"}),
    ("error-space", "A space that is none.", WRONG | {"space": "adobe"}),
    ("error-faint", "A white surface of eight standard errors.", WRONG | {"white": [34, 67, 12, 10]}),
    ("error-light", "Neither a lamp nor a white surface.", WRONG | {"lamp": "auto", "white": None}),
]


def photos_of(given: dict[str, Any]) -> tuple[Mosaic, Mosaic | None]:
    """The photo of a case, and its dark frame, if it has one."""
    return read_photo(given["photo"]), None if given["dark"] is None else read_photo(given["dark"])


def run(call: Call) -> dict[str, Any]:
    """Part of the picture and of its uncertainty: `area` is x, y, width, height, all even; the whole if null."""
    given = call.given
    photo, dark = photos_of(given)
    white = None
    if given["white"] is not None:
        (region,) = measure_regions(photo, [given["white"]], dark=dark, lens_shading=given["shading"])
        white = white_of_region(region, REFLECTANCE)
    made = standard_picture(
        camera_in(given["result"]), given["lamp"], photo, dark=dark, white=white, space=given["space"],
        lens_shading=given["shading"],
    )  # fmt: skip
    pixels, layer = (np.concatenate(strips) for strips in zip(*made.strips(), strict=True))
    x, y, width, height = given["area"] or (0, 0, *pixels.shape[1::-1])
    half = slice(y // 2, (y + height) // 2), slice(x // 2, (x + width) // 2)
    return {"picture": pixels[y : y + height, x : x + width], "uncertainty": layer[half]}


STAGE = Stage(
    name="picture",
    requires="colour",
    rows=lambda: ROWS,
    inputs_of=lambda change: BASE | change,
    run=run,
    inputs=words("result lamp photo dark white space shading area"),
    limits=[("difference", 1.0, "picture uncertainty")],  # steps of 16 bits
    arrays=frozenset(),
)

MANY = [[20, 20, 20, 20], [45, 20, 14, 20], [68, 69, 20, 14]]
PLAIN: Json = {"photo": "patches-chart.dng", "areas": MANY, "dark": None, "lens_shading": "as-stored"}
REGIONS: list[Row] = [
    ("plain", "Rectangles, black level off.", {}),
    ("dark", "A dark frame instead of the black level.", {"dark": "patches-dark.dng"}),
    ("shading", "The lens's map applied.", {"photo": "patches-mapped.dng", "lens_shading": "apply"}),
    ("odd", "Borders that lie on odd columns and rows.", {"areas": [[21, 23, 17, 15]]}),
    ("error-outside", "It leaves the photo.", WRONG | {"areas": [[-1, 20, 20, 20]]}),
    ("error-empty", "No width.", WRONG | {"areas": [[20, 20, 0, 20]]}),
    ("error-small", "Too few samples.", WRONG | {"areas": [[20, 20, 6, 6]]}),
    ("error-clipped", "At the ceiling.",
     {"photo": "patches-clipped.dng", "areas": [[20, 92, 20, 20]], "expect": "overexposed"}),
]  # fmt: skip


def measure(call: Call) -> dict[str, Any]:
    """The stage `regions`: the rectangles' raw signals and their errors."""
    given = call.given
    photo, dark = photos_of(given)
    regions = measure_regions(photo, given["areas"], dark=dark, lens_shading=given["lens_shading"])
    return {"raw": np.stack([one.raw for one in regions]), "standard_error": np.stack([one.error for one in regions])}


REGION_STAGE = Stage(
    name="regions",
    requires="patches",
    rows=lambda: REGIONS,
    inputs_of=lambda change: PLAIN | change,
    run=measure,
    inputs=words("photo areas dark lens_shading"),
    limits=(("norm", 1e-14, "raw"), ("norm", 1e-13, "standard_error")),
    arrays=frozenset(),
)
