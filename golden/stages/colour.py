"""The stage `colour`: standard colour from a result and raw signals.

The camera is a sum of Gaussians near the mean of the phones. The covariance of the code is a formula, too, that falls
off along the atoms and with their distance; the bands follow from it. All is rounded, and the rounded numbers are the
inputs.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf.documents.curve_errors import modes_of_code
from camssf.documents.document import Answer, Curves, Document
from camssf.documents.stored_lamp import estimated_lamp
from camssf.fit.scores import Scores
from camssf.grid import Floats, columns
from camssf.recovery.basis import read_basis, widened
from camssf.recovery.sensitivity import Proof
from camssf.spectra import Lamp, read_lamp
from camssf.spectra.lamps import is_lamp_name
from camssf.verdict.reasons import Reason, Verdict
from camssf_colour import PARTS, Camera, Reference, View, camera_of_result, standard_colour
from camssf_colour.camera import camera_of_answer
from camssf_colour.reach import REACH
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
        "auto-estimated", "The result's own light was not named: its estimate with its standard deviation.",
        base | {"but": {"shots": [{"lamp": {"name": "auto"}, "light": estimate()}]}}, "auto",
        true="LED-B3", asked=True,
    )  # fmt: skip
    lamp = {"name": "lost.csv", "tolerance": 0.03, "source": "file lost.csv", "power": estimate()["power"]}
    yield case(
        "auto-stored", "The result's own lamp was a file, whose spectrum the document holds.",
        base | {"but": {"shots": [{"lamp": lamp}]}}, "auto", true="A", asked=True,
    )  # fmt: skip
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
    wide = {name: wide[name] for name in ("basis", "basis_sha256", "prior_scale", "ssf_std")}
    yield case(
        "wide", "The basis cameras, with a prior twice as wide.", base | {"but": wide}, "D65", true="D65", asked=True
    )
    yield case(
        "bands", "No covariance: errors are smooth over 10 nm within the bands.",
        base | {"but": {"code_covariance": None}}, "D65", true="D65", asked=True,
    )  # fmt: skip
    yield case(
        "other-basis", "The covariance belongs to another basis of this name, so the errors are those of the bands.",
        base | {"but": {"basis_sha256": "0" * 64}}, "D65",
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
        "basis_sha256": read_basis(basis).sha256(),
        "prior_scale": scale,
        "ssf": channels(values),
        "ssf_std": channels(np.round(np.sqrt(np.sum(modes**2, axis=0)), 4)),
        "channel_gain": list(GAINS),
        "code_covariance": plain(covariance[np.tril_indices(len(covariance))]),
    }


def estimate() -> Json:
    """An estimated light near the first lamp, and its standard deviation, which grows to both ends."""
    power = read_lamp(FIRST).values
    return {"power": plain(power), "std": plain(power * (0.03 + 0.1 * np.linspace(-1.0, 1.0, power.size) ** 2))}


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
    """The stage `colour`: `camssf_colour.standard_colour` of a result; `reach` has only distances above REACH."""
    given = call.given
    camera = camera_in(given["result"])
    as_given = given["reference"]
    raw = None if as_given["raw"] is None else np.array(as_given["raw"])
    reference = Reference(tolerance=as_given["tolerance"], raw=raw, error=as_given["error"])
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


def camera_in(given: Json) -> Camera:
    """The camera of the part of a result that a case holds."""
    fields = result_of(given)
    if "ssf" not in fields:
        verdict = Verdict("refused", (Reason("chart_not_found", "", fields["verdict"]["reasons"][0]["advice"]),))
        return camera_of_result(Document(format="camssf/2", version="", verdict=verdict))
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


LIMITS = (
    *each("norm", 1e-12, "xyz lab xyz_covariance lab_covariance parts"),
    *each("norm", 1e-14, "white"),
    *each("exact", 0.0, "lamps"),
    *each("norm", 1e-12, "weights"),
    *each("relative", 1e-11, "chi_squared"),  # of the small difference of two raw whites
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
