"""The stage `regions`: rectangles of a photo, measured like patches."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf_colour.regions import measure_regions
from golden import contract
from golden.contract import Call, Stage, words
from golden.forms import Json
from golden.products import read_photo

MANY = [[20, 20, 20, 20], [45, 20, 14, 20], [68, 69, 20, 14]]
BASE: Json = {"photo": "patches-chart.dng", "areas": MANY, "dark": None, "lens_shading": "as-stored"}
WRONG = "invalid_argument"
TABLE: list[tuple[str, str, Json, str]] = [
    ("plain", "Rectangles, black level off.", {}, "success"),
    ("dark", "A dark frame instead of the black level.", {"dark": "patches-dark.dng"}, "success"),
    ("shading", "The lens's map applied.", {"photo": "patches-mapped.dng", "lens_shading": "apply"}, "success"),
    ("odd", "Borders that lie on odd columns and rows.", {"areas": [[21, 23, 17, 15]]}, "success"),
    ("error-outside", "It leaves the photo.", {"areas": [[-1, 20, 20, 20]]}, WRONG),
    ("error-empty", "No width.", {"areas": [[20, 20, 0, 20]]}, WRONG),
    ("error-small", "Too few samples.", {"areas": [[20, 20, 6, 6]]}, WRONG),
    (
        "error-clipped",
        "At the ceiling.",
        {"photo": "patches-clipped.dng", "areas": [[20, 92, 20, 20]]},
        "overexposed",
    ),
]
"""Name, comment, what is unlike the base case, and the outcome."""


def cases() -> Iterator[Json]:
    """All cases."""
    for name, comment, change, expect in TABLE:
        yield contract.case(f"regions/{name}", comment, BASE | change, expect=expect)


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    given = call.given
    photo, dark = (None if given[role] is None else read_photo(given[role]) for role in ("photo", "dark"))
    assert photo is not None
    regions = measure_regions(photo, given["areas"], dark=dark, lens_shading=given["lens_shading"])
    return {"raw": np.stack([one.raw for one in regions]), "standard_error": np.stack([one.error for one in regions])}


STAGE = Stage(
    name="regions",
    requires="patches",
    cases=cases,
    run=run,
    inputs=words("photo areas dark lens_shading"),
    limits=(("norm", 1e-14, "raw"), ("norm", 1e-13, "standard_error")),
    arrays=frozenset(),
)
