"""The stage `regions`: rectangles of a photo, measured like patches."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf_colour.regions import measure_regions
from golden import contract
from golden.contract import Call, Keys, Stage, against_stored, always, each, words
from golden.forms import Json
from golden.products import read_photo


def cases() -> Iterator[Json]:
    """All cases of the stage `regions`: rectangles in files of golden/dng, measured like patches."""
    many = [[20, 20, 20, 20], [45, 20, 14, 20], [68, 69, 20, 14]]
    yield region("plain", "Rectangles, black level off.", "patches-chart.dng", many)
    yield region("dark", "A dark frame instead of the black level.", "patches-chart.dng", many, "patches-dark.dng")
    yield region("shading", "The lens's map applied.", "patches-mapped.dng", many, shading="apply")
    yield region("odd", "Borders that lie on odd columns and rows.", "patches-chart.dng", [[21, 23, 17, 15]])
    error = "invalid_argument"
    yield region("error-outside", "It leaves the photo.", "patches-chart.dng", [[-1, 20, 20, 20]], expect=error)
    yield region("error-empty", "No width.", "patches-chart.dng", [[20, 20, 0, 20]], expect=error)
    yield region("error-small", "Too few samples.", "patches-chart.dng", [[20, 20, 6, 6]], expect=error)
    yield region("error-clipped", "At the ceiling.", "patches-clipped.dng", [[20, 92, 20, 20]], expect="overexposed")


def region(
    name: str,
    comment: str,
    photo: str,
    areas: list[list[int]],
    dark: str | None = None,
    *,
    shading: str = "as-stored",
    expect: str = "success",
) -> Json:
    """One case of the stage `regions`."""
    inputs = {"photo": photo, "areas": areas, "dark": dark, "lens_shading": shading}
    return contract.case(f"regions/{name}", comment, inputs, expect=expect)


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    given = call.given
    photo, dark = (None if given[role] is None else read_photo(given[role]) for role in ("photo", "dark"))
    assert photo is not None
    found = measure_regions(photo, given["areas"], dark=dark, lens_shading=given["lens_shading"])
    return {"raw": np.stack([each.raw for each in found]), "standard_error": np.stack([each.error for each in found])}


LIMITS = (*each("norm", 1e-14, "raw"), *each("norm", 1e-13, "standard_error"))


STAGE = Stage(
    name="regions",
    keys=Keys(words("photo areas dark lens_shading"), words("standard_error raw"), arrays=frozenset()),
    requires=always("patches"),
    cases=cases,
    run=run,
    limits=against_stored(LIMITS),
)
