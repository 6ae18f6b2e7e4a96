"""The stages `colour` and `spectrum`: standard colours and reflectances from a result and raw signals.

The camera is a sum of Gaussians near the mean of the phones. The covariance of the code is a formula, too, that falls
off along the atoms and with their distance; the bands follow from it. All is rounded, and the rounded numbers are the
inputs.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from camssf.documents.curve_errors import modes_of_code
from camssf.documents.document import Answer, Curves
from camssf.documents.stored_lamp import estimated_lamp
from camssf.fit.scores import Scores
from camssf.grid import Floats, columns
from camssf.recovery.basis import read_basis, widened
from camssf.recovery.sensitivity import Proof
from camssf.spectra import Lamp, read_lamp
from camssf.spectra.lamps import is_lamp_name
from camssf_colour import PARTS, Camera, LitSurfaces, Reference, View, spectrum, standard_colour
from camssf_colour.absorbance import INDICES, indices, shipped_index
from camssf_colour.camera import camera_of_answer
from camssf_colour.reach import REACH
from golden.contract import Call, Stage, case, told, words
from golden.forms import Json, chart, resolve, sibling
from golden.scenes import PHONE

GAINS, TINT = (0.55, 1.0, 0.7), (1.008, 1.0, 0.995)
"""Raw white of the result's first shot, relative to green; factors of the reference's error."""
FIRST = "D55"
PATCHES = (0, 6, 12, 15, 18)
"""Patches of BabelColor's chart: skin, orange, blue, yellow, white."""
VIEW = {"observer": "1931", "white": "lamp"}


def cases() -> Iterator[Json]:
    """The case that holds the result, one whose bands follow from another basis, and those that are told."""
    yield case("colour/named", "A lamp by name, nothing asked of the reference.",
               {"result": result(), **photo(asked=False), "view": VIEW})  # fmt: skip
    names = ("basis", "basis_sha256", "prior_scale", "ssf_std")
    wide = {key: value for key, value in result("cameras", 2.0).items() if key in names}
    yield case("colour/wide", "The basis cameras, with a prior twice as wide.",
               {"result": {"case": "colour/named", "but": wide}, **photo(asked=True), "view": VIEW})  # fmt: skip
    yield from told("colour", but=("named", "wide"))


def photo(asked: bool) -> Json:
    """Lamp, signals and reference of a photo of the chart; `asked`: whether the reference's raw ratios are given."""
    seen = curves() * read_lamp("D65").values[:, None]
    first = (curves() * read_lamp(FIRST).values[:, None]).sum(axis=0)
    y = plain(chart("babelcolor")[list(PATCHES)] @ seen / seen.sum(axis=0))
    return {
        "lamp": "D65",
        "signals": y,
        "standard_error": plain(np.hypot(0.005 * np.array(y), 0.0005)),
        "reference": {
            "tolerance": 0.01,
            "raw": plain(8000.0 * np.array(GAINS) * TINT * seen.sum(axis=0) / first) if asked else None,
            "error": 0.002,
        },
    }


def curves() -> Floats:
    """(681, 3) curves at peak 1, rounded."""
    values = resolve(PHONE)
    return np.array(plain(values / values.max(axis=0)))


def result(basis: str = "phones", scale: float = 1.0) -> Json:
    """The part of a result document that colour reads."""
    values, covariance = curves(), code_covariance()
    white = read_lamp(FIRST).values
    modes = modes_of_code(values, covariance, widened(read_basis(basis), scale), white)
    return {
        "camera": {"make": "golden", "model": "phone"},
        "shots": [{"lamp": {"name": FIRST}}],
        "basis": basis,
        "basis_sha256": read_basis(basis).sha256(),
        "prior_scale": scale,
        "ssf": channels(values),
        "ssf_std": channels(np.round(np.sqrt(np.sum(modes**2, axis=0)), 4)),
        "channel_gain": list(GAINS),
        "code_covariance": plain(covariance[np.tril_indices(len(covariance))]),
    }


def code_covariance() -> Floats:
    """(72, 72): d_i d_j 2^-|i - j|, d falling from 0.4 along each channel's atoms; rounded."""
    order = np.arange(3 * 24)
    size = 0.4 / (1.0 + (order % 24) / 4.0)
    return np.array(plain(size[:, None] * size * 0.5 ** np.abs(order[:, None] - order)))


def channels(values: Floats) -> Json:
    """(681, 3) curves in the form of documents."""
    return {name: plain(values[:, c]) for c, name in enumerate(("red", "green", "blue"))}


def plain(values: Any) -> Any:
    """The values as plain numbers of six decimals."""
    return (np.round(np.asarray(values, dtype=np.float64), 6) + 0.0).tolist()


def run(call: Call) -> dict[str, Any]:
    """The stage `colour`: `camssf_colour.standard_colour` of a result; `reach` has only distances above REACH."""
    given = call.given
    colours = standard_colour(
        camera_in(given["result"]),
        given["lamp"],
        given["signals"],
        given["standard_error"],
        reference=reference_in(given["reference"]),
        view=View(**given["view"]),
    )
    far = colours.reach > REACH
    names = "xyz lab xyz_covariance lab_covariance white chi_squared"
    return {
        **{name: getattr(colours, name) for name in names.split()},
        "parts": np.stack([np.sqrt(np.diagonal(colours.parts[name][1], axis1=1, axis2=2)) for name in PARTS]),
        "lamps": [name for name, _ in colours.lamps],
        "weights": np.array([weight for _, weight in colours.lamps]),
        "far": far.tolist(),
        "reach": colours.reach[far] if far.any() else None,
    }


def reference_in(given: Json) -> Reference:
    """The reference of a photo."""
    raw = None if given["raw"] is None else np.array(given["raw"])
    return Reference(tolerance=given["tolerance"], raw=raw, error=given["error"])


def camera_in(given: Json) -> Camera:
    """The camera of the part of a result that a case holds; made once of each."""
    return _camera(json.dumps(result_of(given)))


@cache
def _camera(result: str) -> Camera:
    fields = json.loads(result)
    ssf, std, triangle = fields["ssf"], fields["ssf_std"], fields["code_covariance"]
    none = np.zeros((1, 0, 3))
    answer = Answer(
        basis=fields["basis"],
        basis_sha256=fields["basis_sha256"],
        engine="onnx",
        curves=Curves.of(columns(ssf)),
        std=None if std is None else Curves.of(columns(std)),
        channel_gain=np.array(fields["channel_gain"]),
        code_covariance=None if triangle is None else np.array(triangle),
        prior_scale=fields["prior_scale"],
        gamma=np.zeros(3), l2=0.0, proof=Proof(np.zeros(3), np.zeros(1), np.zeros(1, dtype=np.int64)),
        used=((),), level=none[..., 0], predicted=none, unseen=none, scores=Scores(np.zeros(3), "", None, 0.0),
    )  # fmt: skip
    return camera_of_answer(answer, _first_lamp(fields["shots"][0]), "golden phone")


def _first_lamp(shot: Json) -> Lamp | None:
    """The lamp of a shot: estimated, with its power, by its name, or unknown."""
    name = shot["lamp"]["name"]
    if "light" in shot:
        return estimated_lamp(name, np.array(shot["light"]["power"]), np.array(shot["light"]["std"]))
    if "power" in shot["lamp"]:
        entry = shot["lamp"]
        return Lamp(name, np.array(entry["power"]), entry["tolerance"], np.zeros((0, 681)), entry["source"])
    return read_lamp(name) if is_lamp_name(name) else None


def result_of(given: Json) -> Json:
    """A result, or that of another case with some fields replaced."""
    return sibling(given["case"])["inputs"]["result"] | given.get("but", {}) if "case" in given else given


STAGE = Stage(
    name="colour",
    requires="colour",
    cases=cases,
    run=run,
    inputs=words("result lamp signals standard_error reference view"),
    limits=(
        ("norm", 1e-12, "xyz lab xyz_covariance lab_covariance parts"),
        ("norm", 1e-14, "white"),
        ("exact", 0.0, "lamps"),
        ("norm", 1e-12, "weights"),
        ("relative", 1e-11, "chi_squared"),  # of the small difference of two raw whites
        ("exact", 0.0, "far"),
        ("norm", 1e-9, "reach"),
    ),
    arrays=words("signals standard_error"),
)


def run_spectrum(call: Call) -> dict[str, Any]:
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


SPECTRUM = Stage(
    name="spectrum",
    requires="colour",
    run=run_spectrum,
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
