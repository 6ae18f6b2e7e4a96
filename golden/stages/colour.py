"""The stage `colour`: standard colour from a result and raw signals.

The camera is a sum of Gaussians near the mean of the phones. The covariance of the code is a formula, too, that falls
off along the atoms and with their distance; the bands follow from it. All is rounded, and the rounded numbers are the
inputs.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf.colour import PARTS, Reference, View, camera_of_result, standard_colour
from camssf.colour.camera import modes_of_code
from camssf.colour.reach import REACH
from camssf.grid import Floats
from camssf.recovery.basis import read_basis, widened
from camssf.spectra import read_lamp
from golden import contract
from golden.contract import Call, Keys, Stage, against_stored, always, each, words
from golden.forms import Json, chart, resolve, sibling
from golden.scenes import PHONE

DECIMALS = 6
GAINS, TINT = (0.55, 1.0, 0.7), (1.008, 1.0, 0.995)
"""Raw white of the result's first shot, relative to green; factors of the reference's error."""
FIRST = "D55"
PATCHES = (0, 6, 12, 15, 18)
"""Patches of BabelColor's chart: skin, orange, blue, yellow, white."""
ATOMS = 24


def cases() -> Iterator[Json]:
    """All cases of the stage `colour`."""
    yield case("named", "A lamp by name, nothing asked of the reference.", result(), "D65")
    base = {"case": "colour/named"}
    yield case("own-lamp", "The lamp of the result's own first shot.", base, FIRST)
    yield case(
        "reference",
        "The reference's raw ratios say what light it is: the lamp, known by kind, and the curves are conditioned.",
        base, "daylight", true="D65", asked=True,
    )  # fmt: skip
    yield case("auto", "The four kinds, weighed by the reference's ratios.", base, "auto", true="LED-B3", asked=True)
    yield case("auto-bulb", "The same under a bulb.", base, "auto", true="A", asked=True)
    yield case(
        "modes", "A kind of lamp with modes, and no reference asked.", base, "white-led", true="LED-B3", white="D65"
    )
    yield case("adapted-d50", "The observer of 1964, adapted to D50.", base, "A", observer="1964", white="D50")
    yield case("adapted-d65", "The observer of 1931, adapted to D65.", base, "FL2", white="D65")
    yield case(
        "loose-reference", "A reference known to 5 %, which reflects 18 %, and no noise.", base, "D50",
        tolerance=0.05, noise=0.0,
    )  # fmt: skip
    yield case(
        "dark", "Black, below black, and hardly any light.", base, "D65",
        signals=[[0.0, 0.0, 0.0], [-0.002, 0.001, -0.001], [0.004, 0.003, 0.002]],
    )  # fmt: skip
    yield case(
        "out-of-reach", "Colours that no surface has, beside one that many have.", base, "D65",
        signals=[[0.9, 0.05, 0.02], [1.4, 1.4, 1.4], [0.3, 0.3, 0.3], [0.02, 0.6, 0.7]],
    )  # fmt: skip
    wide = result("cameras", 2.0)
    wide = {name: wide[name] for name in ("basis", "prior_scale", "ssf_std")}
    yield case(
        "wide", "The basis cameras, with a prior twice as wide.", base | {"but": wide}, "D65", true="D65", asked=True
    )
    yield case(
        "bands", "No covariance: errors are smooth over 10 nm within the bands.",
        base | {"but": {"code_covariance": None}}, "D65", true="D65", asked=True,
    )  # fmt: skip
    yield case(
        "other-covariance", "A covariance that does not give the bands is not believed.",
        base | {"but": {"prior_scale": 2.0}}, "D65",
    )  # fmt: skip
    yield case(
        "exact", "Curves without a band are taken to be exact.",
        base | {"but": {"ssf_std": None, "code_covariance": None}}, "daylight", true="D50", asked=True,
    )  # fmt: skip
    yield case(
        "measured-lamp", "A first lamp that was a file: nothing ties the channels, the reference is not asked.",
        base | {"but": {"shots": [{"lamp": {"name": "desk.csv"}}]}}, "D65", true="A", asked=True,
    )  # fmt: skip
    yield case(
        "error-contradicted", "A reference lit by a bulb, and daylight was named.", base, "D65", true="A", asked=True,
        expect="lamp_unfit",
    )  # fmt: skip
    yield case("error-auto", "The lamp is unknown.", base, "auto", expect="invalid_argument")
    yield case(
        "error-blind", "A channel that sees nothing.",
        base | {"but": {"ssf": {name: [0] * 681 for name in ("red", "green", "blue")}}}, "D65",
        expect="invalid_argument",
    )  # fmt: skip
    refused = {"verdict": {"reasons": [{"advice": "Take it again."}]}}
    yield case("error-refused", "A result that was refused.", refused, "D65", expect="invalid_argument")


def case(name: str, comment: str, document: Json, lamp: str, **more: Any) -> Json:
    """One case of the stage `colour`."""
    inputs = {
        "result": document,
        **photo(lamp, **more),
        "view": {name: more.get(name, usual) for name, usual in VIEW.items()},
    }
    return contract.case(f"colour/{name}", comment, inputs, expect=more.get("expect", "success"))


def photo(lamp: str, **more: Any) -> Json:
    """Lamp, signals and reference of a photo; its signals are the chart's under the `true` lamp."""
    light = more.get("true", lamp if lamp != "auto" else FIRST)
    seen = curves() * read_lamp(light).values[:, None]
    patches = chart("babelcolor")[list(more.get("patches", PATCHES))]
    y = more.get("signals", plain(patches @ seen / seen.sum(axis=0)))
    first = (curves() * read_lamp(FIRST).values[:, None]).sum(axis=0)
    noise = more.get("noise", 0.005)
    return {
        "lamp": lamp,
        "signals": y,
        "standard_error": plain(np.hypot(noise * np.array(y), 0.1 * noise)),
        "reference": {
            "tolerance": more.get("tolerance", 0.01),
            "raw": plain(8000.0 * np.array(GAINS) * TINT * seen.sum(axis=0) / first) if more.get("asked") else None,
            "error": 0.002,
        },
    }


VIEW = {"observer": "1931", "white": "lamp"}


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
        "prior_scale": scale,
        "ssf": channels(values),
        "ssf_std": channels(np.round(np.sqrt(np.sum(modes**2, axis=0)), 4)),
        "channel_gain": list(GAINS),
        "code_covariance": plain(covariance[np.tril_indices(len(covariance))]),
    }


def code_covariance() -> Floats:
    """(72, 72): d_i d_j 2^-|i - j|, d falling from 0.4 along each channel's atoms; rounded."""
    order = np.arange(3 * ATOMS)
    size = 0.4 / (1.0 + (order % ATOMS) / 4.0)
    return np.array(plain(size[:, None] * size * 0.5 ** np.abs(order[:, None] - order)))


def channels(values: Floats) -> Json:
    """(681, 3) curves in the form of documents."""
    return {name: plain(values[:, c]) for c, name in enumerate(("red", "green", "blue"))}


def plain(values: Any) -> Any:
    """The values as rounded plain numbers."""
    return (np.round(np.asarray(values, dtype=np.float64), DECIMALS) + 0.0).tolist()


def run(call: Call) -> dict[str, Any]:
    """The stage `colour`: `camssf.colour.standard_colour` of a result; `reach` has only distances above REACH."""
    given = call.given
    camera = camera_of_result(result_of(given["result"]))
    told = given["reference"]
    raw = None if told["raw"] is None else np.array(told["raw"])
    reference = Reference(tolerance=told["tolerance"], raw=raw, error=told["error"])
    found = standard_colour(
        camera,
        given["lamp"],
        given["signals"],
        given["standard_error"],
        reference=reference,
        view=View(**given["view"]),
    )
    far = found.reach > REACH
    return {
        **{name: getattr(found, name) for name in ("xyz", "lab", "xyz_covariance", "lab_covariance", "white")},
        "parts": np.stack([np.sqrt(np.diagonal(found.parts[name][1], axis1=1, axis2=2)) for name in PARTS]),
        "lamps": [name for name, _ in found.lamps],
        "weights": np.array([weight for _, weight in found.lamps]),
        "chi_squared": found.chi_squared,
        "far": far.tolist(),
        "reach": found.reach[far] if far.any() else None,
    }


def result_of(given: Json) -> Json:
    """A result, or that of another case with some fields replaced."""
    return sibling(given["case"])["inputs"]["result"] | given.get("but", {}) if "case" in given else given


LIMITS = (
    *each("norm", 1e-12, "xyz lab xyz_covariance lab_covariance parts"),
    *each("norm", 1e-14, "white"),
    *each("exact", 0.0, "lamps"),
    *each("norm", 1e-12, "weights"),
    *each("relative", 1e-12, "chi_squared"),
    *each("exact", 0.0, "far"),
    *each("norm", 1e-9, "reach"),
)


STAGE = Stage(
    name="colour",
    keys=Keys(
        words("result lamp signals standard_error reference view"),
        words("white weights xyz lab xyz_covariance lab_covariance parts lamps chi_squared far reach"),
        arrays=words("signals standard_error"),
    ),
    requires=always("colour"),
    cases=cases,
    run=run,
    limits=against_stored(LIMITS),
)
