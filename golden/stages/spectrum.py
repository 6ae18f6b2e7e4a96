"""The stage `spectrum`: reflectances of surfaces from a result and their signals in one or two photos.

Results and signals are those of the stage `colour`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf_colour import PARTS, LitSurfaces, Reference, View, spectrum
from camssf_colour.absorbance import INDICES, indices, shipped_index
from golden import contract
from golden.contract import Call, Keys, Stage, against_stored, always, each, words
from golden.forms import Json
from golden.stages.colour import camera_in, photo

SKIN, ORANGE, BLUE = 0, 6, 12
"""Patches of BabelColor's chart."""
BASE = {"case": "colour/named"}


def cases() -> Iterator[Json]:
    """All cases of the stage `spectrum`."""
    yield case("one", "One photo, a lamp by name.", [photo("D65", patches=(SKIN, BLUE))])
    yield case(
        "skin", "The prior of skins, the observer of 1964, adapted to D50.", [photo("A", patches=(SKIN,))],
        prior="skin", observer="1964", white="D50",
    )  # fmt: skip
    yield case(
        "two", "Two photos, lamps by name, a grey known to 5 %.",
        [photo(lamp, patches=(ORANGE,), tolerance=0.05) for lamp in ("D65", "LED-B3")],
    )  # fmt: skip
    yield case(
        "two-auto", "Two photos: the references say what light it is, of the second among all kinds.",
        [photo("daylight", true="D65", asked=True, patches=(ORANGE,)),
         photo("auto", true="A", asked=True, patches=(ORANGE,))],
    )  # fmt: skip
    yield case(
        "bands", "No covariance of the curves, a kind of lamp with modes, and signals below black.",
        [photo("white-led", signals=[[-0.002, 0.001, -0.001]])], BASE | {"but": {"code_covariance": None}},
    )  # fmt: skip
    yield case(
        "error-contradicted", "The second reference is lit by daylight, and a bulb was named.",
        [photo("D65", patches=(SKIN,)), photo("A", true="D65", asked=True, patches=(SKIN,))], expect="lamp_unfit",
    )  # fmt: skip


def case(
    name: str, comment: str, photos: list[Json], document: Json = BASE, *, expect: str = "success", **more: str
) -> Json:
    """One case of the stage `spectrum`."""
    usual = {"observer": "1931", "white": "lamp"}
    inputs = {
        "result": document,
        "photos": photos,
        "prior": more.get("prior", "general"),
        "view": {key: more.get(key, value) for key, value in usual.items()},
    }
    return contract.case(f"spectrum/{name}", comment, inputs, expect=expect)


def run(call: Call) -> dict[str, Any]:
    """The stage `spectrum`: `camssf_colour.spectrum` of a result."""
    given = call.given
    photos = []
    for entry in given["photos"]:
        reference = entry["reference"]
        raw = None if reference["raw"] is None else np.array(reference["raw"])
        known = Reference(tolerance=reference["tolerance"], raw=raw, error=reference["error"])
        photos.append(LitSurfaces(entry["lamp"], entry["signals"], entry["standard_error"], known))
    camera = camera_in(given["result"])
    found = spectrum(camera, *photos, prior=given["prior"], view=View(**given["view"]))
    names = "reflectance xyz lab xyz_covariance lab_covariance white distance from_photo chi_squared"
    return {
        **{name: getattr(found, name) for name in names.split()},
        "covariance_sums": found.covariance.sum(axis=2),
        "parts": np.stack([np.sqrt(np.trace(found.parts[name], axis1=1, axis2=2)) for name in PARTS]),
        "indices": np.stack([np.stack(indices(found, shipped_index(name)), axis=-1) for name in INDICES]),
        "lamps": [list(names) for names, _ in found.lamps],
        "weights": np.array([weight for _, weight in found.lamps]),
    }


LIMITS = (
    *each("norm", 1e-12, "reflectance covariance_sums parts indices xyz lab xyz_covariance lab_covariance"),
    *each("norm", 1e-14, "white"),
    *each("norm", 1e-12, "distance from_photo weights"),
    *each("exact", 0.0, "lamps"),
    *each("relative", 1e-12, "chi_squared"),
)

STAGE = Stage(
    name="spectrum",
    keys=Keys(
        words("result photos prior view"),
        words("reflectance covariance_sums parts indices xyz lab xyz_covariance lab_covariance white distance "
              "from_photo lamps weights chi_squared"),
        arrays=frozenset(),
    ),
    requires=always("colour"),
    cases=cases,
    run=run,
    limits=against_stored(LIMITS),
)  # fmt: skip
