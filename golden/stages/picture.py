"""The stage `picture`: photos of golden/dng as pictures in standard colour, by a result of the stage `colour`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf_colour.picture import standard_picture, white_of_region
from camssf_colour.regions import measure_regions
from golden import contract
from golden.contract import Call, Keys, Stage, against_stored, always, each, words
from golden.forms import Json
from golden.products import read_photo
from golden.stages.colour import camera_in

RESULT = {"case": "colour/named"}
CHART, WHITE = "patches-chart.dng", [126, 32, 14, 14]
REFLECTANCE = 0.3
AREA = [60, 40, 24, 16]


def cases() -> Iterator[Json]:
    """All cases of the stage `picture`."""
    yield picture("reference", "A white surface in the photo, and the lamp by name.")
    yield picture("auto", "The light by the white surface's raw ratios.", lamp="auto")
    yield picture("calibration", "No white surface: the balance of the calibration, with its errors.", white=None)
    yield picture("display-p3", "A wider display.", space="display-p3")
    yield picture("xyz-d65", "XYZ itself.", space="xyz-d65")
    yield picture("xyz-d50", "XYZ for ICC.", space="xyz-d50")
    yield picture("shading", "The lens's map applied.", photo="patches-mapped.dng", shading="apply")
    yield picture("corner", "Colours at the edge, from mirrored samples.", area=[156, 120, 24, 12])
    yield picture("dark", "A dark frame subtracted.", dark="patches-dark.dng")
    yield picture(
        "torch", "With the torch minus without it: the noise of both photos.", photo="patches-white.dng",
        dark="patches-chart.dng", lamp="auto",
    )  # fmt: skip
    yield picture(
        "clipped", "Patches at the ceiling.", photo="patches-clipped.dng", white=None, area=[20, 92, 40, 20]
    )
    whole: Json = {"white": None, "area": None}
    for order in ("grbg", "gbrg", "bggr"):
        yield picture(f"cfa-{order}", "Another order of the colours.", photo=f"cfa-{order}.dng", **whole)
    yield picture("odd", "Odd height and width.", photo="active-area-odd.dng", **whole)
    yield picture("turned", "A camera held upright.", photo="metadata.dng", **whole)
    error = "invalid_argument"
    yield picture("error-space", "A space that is none.", space="adobe", expect=error)
    yield picture("error-light", "Neither a lamp nor a white surface.", lamp="auto", white=None, expect=error)


def picture(name: str, comment: str, *, expect: str = "success", **changes: Any) -> Json:
    """One case of the stage `picture`."""
    inputs = {
        "result": RESULT, "lamp": "daylight", "photo": CHART, "dark": None, "white": WHITE, "space": "srgb",
        "shading": "as-stored", "area": AREA, **changes,
    }  # fmt: skip
    return contract.case(f"picture/{name}", comment, inputs, expect=expect)


def run(call: Call) -> dict[str, Any]:
    """Part of the picture and of its uncertainty: `area` is x, y, width, height, all even; the whole if null."""
    given = call.given
    photo, dark = (None if given[role] is None else read_photo(given[role]) for role in ("photo", "dark"))
    assert photo is not None
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
    keys=Keys(
        words("result lamp photo dark white space shading area"), words("picture uncertainty"), arrays=frozenset()
    ),
    requires=always("colour"),
    cases=cases,
    run=run,
    limits=against_stored(each("norm", 2e-5, "picture uncertainty")),
)
