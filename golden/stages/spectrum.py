"""The stage `spectrum`: reflectances of surfaces from a result and their signals in one or two photos.

Results and signals are those of the stage `colour`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from camssf_colour import PARTS, LitSurfaces, View, spectrum
from camssf_colour.absorbance import INDICES, indices, shipped_index
from golden.contract import Call, Stage, case, words
from golden.forms import Json
from golden.stages.colour import BASE, VIEW, camera_in, photo, reference_in

SKIN, ORANGE, BLUE = [0], [6], [12]
"""Patches of BabelColor's chart."""
Row: TypeAlias = tuple[str, str, list[Json], Json]
"""Name, comment, photos, and what is unlike the base case: inputs, and `expect`."""


def rows() -> list[Row]:
    """All cases."""
    two = [photo(lamp, patches=ORANGE, tolerance=0.05) for lamp in ("D65", "LED-B3")]
    auto = [photo(lamp, true=true, asked=True, patches=ORANGE) for lamp, true in (("daylight", "D65"), ("auto", "A"))]
    wrong = [photo("D65", patches=SKIN), photo("A", true="D65", asked=True, patches=SKIN)]
    return [
        ("one", "One photo, a lamp by name.", [photo("D65", patches=SKIN + BLUE)], {}),
        ("skin", "The prior of skins, the observer of 1964, adapted to D50.",
         [photo("A", patches=SKIN)], {"prior": "skin", "view": {"observer": "1964", "white": "D50"}}),
        ("two", "Two photos, lamps by name, a grey known to 5 %.", two, {}),
        ("two-auto", "Two photos: the references tell the light, of the second among all kinds.", auto, {}),
        ("bands", "No covariance of the curves, a kind of lamp with modes, and signals below black.",
         [photo("white-led", signals=[[-0.002, 0.001, -0.001]])],
         {"result": BASE | {"but": {"code_covariance": None}}}),
        ("error-contradicted", "The second reference is lit by daylight, and a bulb was named.",
         wrong, {"expect": "lamp_unfit"}),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    for name, comment, photos, change in rows():
        expect = change.pop("expect", "success")
        inputs = {"result": BASE, "photos": photos, "prior": "general", "view": VIEW} | change
        yield case(f"spectrum/{name}", comment, inputs, expect=expect)


def run(call: Call) -> dict[str, Any]:
    """The stage `spectrum`: `camssf_colour.spectrum` of a result."""
    given = call.given
    photos = [
        LitSurfaces(one["lamp"], one["signals"], one["standard_error"], reference_in(one["reference"]))
        for one in given["photos"]
    ]
    found = spectrum(camera_in(given["result"]), *photos, prior=given["prior"], view=View(**given["view"]))
    names = "reflectance xyz lab xyz_covariance lab_covariance white distance from_photo chi_squared"
    return {
        **{name: getattr(found, name) for name in names.split()},
        "covariance_sums": found.covariance.sum(axis=2),
        "parts": np.stack([np.sqrt(np.trace(found.parts[name], axis1=1, axis2=2)) for name in PARTS]),
        "indices": np.stack([np.stack(indices(found, shipped_index(name)), axis=-1) for name in INDICES]),
        "lamps": [list(names) for names, _ in found.lamps],
        "weights": np.array([weight for _, weight in found.lamps]),
    }


STAGE = Stage(
    name="spectrum",
    requires="colour",
    cases=cases,
    run=run,
    inputs=words("result photos prior view"),
    limits=(
        ("norm", 1e-12, "reflectance covariance_sums parts indices xyz lab xyz_covariance lab_covariance"),
        ("norm", 1e-14, "white"),
        ("norm", 1e-12, "distance from_photo weights"),
        ("exact", 0.0, "lamps"),
        ("relative", 1e-12, "chi_squared"),
    ),
    arrays=frozenset(),
)
