"""The stages `picture` and `regions`: photos of golden/dng in standard colour, and rectangles of them measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.photo.read.dng import Mosaic
from camssf_colour.picture import standard_picture, white_of_region
from camssf_colour.regions import measure_regions
from golden.contract import Call, Stage, words
from golden.products import read_photo
from golden.stages.colour import camera_in

REFLECTANCE = 0.3


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
    run=run,
    inputs=words("result lamp photo dark white space shading area"),
    limits=[("difference", 1.0, "picture uncertainty")],  # steps of 16 bits
    arrays=frozenset(),
)


def measure(call: Call) -> dict[str, Any]:
    """The stage `regions`: the rectangles' raw signals and their errors."""
    given = call.given
    photo, dark = photos_of(given)
    regions = measure_regions(photo, given["areas"], dark=dark, lens_shading=given["lens_shading"])
    return {"raw": np.stack([one.raw for one in regions]), "standard_error": np.stack([one.error for one in regions])}


REGION_STAGE = Stage(
    name="regions",
    requires="patches",
    run=measure,
    inputs=words("photo areas dark lens_shading"),
    limits=(("norm", 1e-14, "raw"), ("norm", 1e-13, "standard_error")),
    arrays=frozenset(),
)
