"""The stages `colour` and `spectrum`: standard colours and reflectances from a result and raw signals.

The camera is a sum of Gaussians near the mean of the phones. The covariance of the code is a formula, too, that falls
off along the atoms and with their distance; the bands follow from it. All is rounded, and the rounded numbers are the
inputs.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from functools import cache, reduce
from typing import Any

import numpy as np

from camssf.documents.curve_errors import modes_of_code
from camssf.documents.document import FORMAT, Answer, Curves, Document, lower_triangle
from camssf.documents.forms import from_plain, to_plain
from camssf.fit.scores import Scores
from camssf.grid import Floats
from camssf.photo.capture import Capture, MeasuredShot
from camssf.recovery.basis import read_basis, widened
from camssf.recovery.sensitivity import EstimatedLamp, Proof
from camssf.spectra import Lamp, Light, read_chart, read_lamp
from camssf.spectra.lights import unnamed_light
from camssf.verdict.reasons import Verdict
from camssf_colour import PARTS, Camera, LitSurfaces, Reference, View, spectrum, standard_colour
from camssf_colour.absorbance import INDICES, indices, shipped_index
from camssf_colour.camera import camera_of_result
from camssf_colour.reach import REACH
from camssf_colour.reflectance import FAR
from golden.contract import Call, Row, Stage, words
from golden.forms import Json, chart, resolve, sibling
from golden.products import PHOTO, build_means, pose_by_hand
from golden.scenes import PHONE

GAINS, TINT = (0.55, 1.0, 0.7), (1.008, 1.0, 0.995)
"""Raw white of the result's first shot, relative to green; factors of the reference's error."""
FIRST = "D55"
PATCHES = (0, 6, 12, 15, 18)
"""Patches of BabelColor's chart: skin, orange, blue, yellow, white."""
BASE = {"case": "colour/named"}
VIEW = {"observer": "1931", "white": "lamp"}


def rows() -> list[Row]:
    """All cases: name, comment, result, lamp, and what is unlike the base case."""

    def but(first: Light | None = None, **answer: Any) -> Json:
        """The base result with another first lamp, and other fields of its answer."""
        lamp = {} if first is None else {"capture/shots/0/lamp": to_plain(first)}
        return BASE | {"but": lamp | {f"answer/{name}": value for name, value in answer.items()}}

    light, unnamed = estimate(), unnamed_light()
    stored = Lamp("lost.csv", light.power, 0.03, np.zeros((0, 681)), "file lost.csv")
    wide = {name: result("cameras", 2.0)["answer"][name] for name in ("basis", "basis_sha256", "prior_scale", "std")}
    blind = {name: [0] * 681 for name in ("red", "green", "blue")}
    dark = [[0.0, 0.0, 0.0], [-0.002, 0.001, -0.001], [0.004, 0.003, 0.002]]
    strange = [[0.9, 0.05, 0.02], [1.4, 1.4, 1.4], [0.3, 0.3, 0.3], [0.02, 0.6, 0.7]]

    def under(true: str, **more: Any) -> Json:
        return {"true": true, "asked": True, **more}

    wrong = {"expect": "invalid_argument"}
    table: list[tuple[str, str, Json, str, Json]] = [
        ("named", "A lamp by name, nothing asked of the reference.", result(), "D65", {}),
        ("own-lamp", "The lamp of the result's own first shot.", BASE, FIRST, {}),
        ("reference", "The reference's raw ratios tell the light: the lamp, known by its kind, and the curves are "
         "conditioned.", BASE, "daylight", under("D65")),
        ("auto", "The four kinds, weighed by the reference's ratios.", BASE, "auto", under("LED-B3")),
        ("auto-estimated", "The result's own light was unnamed: its estimate with its standard deviation.",
         but(unnamed, lights=[to_plain(light)]), "auto", under("LED-B3")),
        ("auto-stored", "The result's own lamp was a file, whose spectrum the document holds.",
         but(stored), "auto", under("A")),
        ("modes", "A kind of lamp with modes, no reference.", BASE, "white-led", {"true": "LED-B3", "white": "D65"}),
        ("adapted-d50", "The observer of 1964, adapted to D50.", BASE, "A", {"observer": "1964", "white": "D50"}),
        ("dark", "Black, below black, and hardly any light.", BASE, "D65", {"signals": dark}),
        ("out-of-reach", "Colours that no surface has, and one that many have.", BASE, "D65", {"signals": strange}),
        ("wide", "The basis cameras, with a prior twice as wide.", but(**wide), "D65", under("D65")),
        ("bands", "No covariance: errors are smooth over 10 nm within the bands.",
         but(code_covariance=None), "D65", under("D65")),
        ("other-basis", "The covariance belongs to another basis of this name: the errors are those of the bands.",
         but(basis_sha256="0" * 64), "D65", {}),
        ("exact", "Curves without a band are taken to be exact.",
         but(std=None, code_covariance=None), "daylight", under("D50")),
        ("unknown-lamp", "A first lamp that nothing tells: nothing ties the channels, the reference is not asked.",
         but(unnamed), "D65", under("A")),
        ("error-contradicted", "A reference lit by a bulb, and daylight was named.",
         BASE, "D65", under("A", expect="lamp_unfit")),
        ("tinted", "The raw ratios of the reference are off by a tenth: χ² = 14 does not reject the lamp.",
         BASE, "D65", under("D65", tint=(1.1, 1.0, 0.995))),
        ("error-tinted", "Off by an eighth: χ² = 20 does.",
         BASE, "D65", under("D65", tint=(1.12, 1.0, 0.995), expect="lamp_unfit")),
        ("error-auto", "The lamp is unknown.", BASE, "auto", wrong),
        ("error-blind", "A channel that sees nothing.", but(curves=blind), "D65", wrong),
    ]  # fmt: skip
    return [(name, comment, {"result": of, "lamp": lamp} | change) for name, comment, of, lamp, change in table]


def colours(change: Json) -> Json:
    """Inputs of the stage `colour` from a result, and changed arguments of `photo` and fields of VIEW."""
    of_photo = {key: value for key, value in change.items() if key not in (*VIEW, "result")}
    view = {key: change.get(key, usual) for key, usual in VIEW.items()}
    return {"result": change["result"], **photo(**of_photo), "view": view}


def photo(
    lamp: str,
    *,
    true: str | None = None,
    asked: bool = False,
    patches: Sequence[int] = PATCHES,
    signals: Any = None,
    noise: float = 0.005,
    tolerance: float = 0.01,
    tint: Sequence[float] = TINT,
) -> Json:
    """Lamp, signals and reference of a photo; its signals are the chart's under the `true` lamp.

    asked: whether the reference's raw ratios are given; tint: factors of their error.
    """
    seen = curves() * read_lamp(true or (lamp if lamp != "auto" else FIRST)).values[:, None]
    first = (curves() * read_lamp(FIRST).values[:, None]).sum(axis=0)
    y = plain(chart("babelcolor")[list(patches)] @ seen / seen.sum(axis=0)) if signals is None else signals
    return {
        "lamp": lamp,
        "signals": y,
        "standard_error": plain(np.hypot(noise * np.array(y), 0.1 * noise)),
        "reference": {
            "tolerance": tolerance,
            "raw": plain(8000.0 * np.array(GAINS) * tint * seen.sum(axis=0) / first) if asked else None,
            "error": 0.002,
        },
    }


def curves() -> Floats:
    """(681, 3) curves at peak 1, rounded."""
    values = resolve(PHONE)
    return np.array(plain(values / values.max(axis=0)))


def result(basis: str = "phones", scale: float = 1.0) -> Json:
    """A result's document; its patches have no signals, as colour reads curves and the first lamp alone."""
    values, covariance, lamp = curves(), code_covariance(), read_lamp(FIRST)
    modes = modes_of_code(values, covariance, widened(read_basis(basis), scale), lamp.values)
    none = np.zeros((1, 24, 3))
    frame = {"mean": none[0], "standard_error": none[0], "clipped": none[0]}
    means = build_means({"chart": frame, "white": None, "dark": None, "black": [0.0] * 3, "saturation": 16000.0})
    pose = pose_by_hand(np.zeros((24, 4, 2)))
    shot = MeasuredShot(lamp, replace(PHOTO, model="phone"), white=None, dark=None, pose=pose, means=means)
    answer = Answer(
        basis=basis, basis_sha256=read_basis(basis).sha256(), prior_scale=scale, engine="onnx",
        curves=Curves.of(values), std=Curves.of(np.round(np.sqrt(np.sum(modes**2, axis=0)), 4)),
        channel_gain=np.array(GAINS), code_covariance=lower_triangle(covariance),
        gamma=np.zeros(3), l2=1.0, proof=Proof(np.zeros(3), np.zeros(1), np.zeros(1, dtype=np.int64)),
        used=((True,) * 24,), level=np.ones((1, 24)), predicted=none, unseen=none,
        scores=Scores(np.zeros(3), "none", None, 0.0),
    )  # fmt: skip
    capture = Capture((shot,), read_chart("classic24"))
    verdict = Verdict("accepted")
    whole: Json = to_plain(Document(format=FORMAT, version="golden", capture=capture, answer=answer, verdict=verdict))
    return whole


def estimate() -> EstimatedLamp:
    """An estimated light near the first lamp, and its standard deviation, which grows to both ends."""
    power = read_lamp(FIRST).values
    std = power * (0.03 + 0.1 * np.linspace(-1.0, 1.0, power.size) ** 2)
    return EstimatedLamp({"daylight": 1.0}, np.array(plain(power)), np.array(plain(std)), 5500.0, 100.0)


def code_covariance() -> Floats:
    """(72, 72): d_i d_j 2^-|i - j|, d falling from 0.4 along each channel's atoms; rounded."""
    order = np.arange(3 * 24)
    size = 0.4 / (1.0 + (order % 24) / 4.0)
    return np.array(plain(size[:, None] * size * 0.5 ** np.abs(order[:, None] - order)))


def plain(values: Any) -> Any:
    """The values as plain numbers of six decimals."""
    return (np.round(np.asarray(values, dtype=np.float64), 6) + 0.0).tolist()


def run(call: Call) -> dict[str, Any]:
    """The stage `colour`: `camssf_colour.standard_colour` of a result; `reach` has only distances above REACH."""
    given = call.given
    seen = standard_colour(
        camera_in(given["result"]), given["lamp"], given["signals"], given["standard_error"],
        reference=reference_in(given["reference"]), view=View(**given["view"]),
    )  # fmt: skip
    far = seen.reach > REACH
    names = "xyz lab xyz_covariance lab_covariance white chi_squared"
    return {
        **{name: getattr(seen, name) for name in names.split()},
        "parts": np.stack([np.sqrt(np.diagonal(seen.parts[name][1], axis1=1, axis2=2)) for name in PARTS]),
        "lamps": [name for name, _ in seen.lamps],
        "weights": np.array([weight for _, weight in seen.lamps]),
        "far": far.tolist(),
        "reach": seen.reach[far] if far.any() else None,
    }


def reference_in(given: Json) -> Reference:
    """The reference of a photo."""
    raw = None if given["raw"] is None else np.array(given["raw"])
    return Reference(tolerance=given["tolerance"], raw=raw, error=given["error"])


def camera_in(given: Json) -> Camera:
    """The camera of a case's result, made once of each."""
    return _camera(json.dumps(result_of(given)))


@cache
def _camera(result: str) -> Camera:
    return camera_of_result(from_plain(json.loads(result), Document, "result", ""))


def result_of(given: Json) -> Json:
    """A document, or that of another case but for the values at some paths."""
    if "case" not in given:
        return given
    result: Json = deepcopy(sibling(given["case"])["inputs"]["result"])
    for path, value in given.get("but", {}).items():
        *way, name = path.split("/")
        part = reduce(lambda part, key: part[int(key) if isinstance(part, list) else key], way, result)
        part[name] = value
    return result


STAGE = Stage(
    name="colour",
    rows=rows,
    inputs_of=colours,
    run=run,
    inputs=words("result lamp signals standard_error reference view"),
    limits=(
        ("norm", 1e-12, "xyz lab xyz_covariance lab_covariance parts weights"),
        ("norm", 1e-14, "white"),
        ("exact", 0.0, "lamps far"),
        ("relative", 1e-11, "chi_squared"),  # of the small difference of two raw whites
        ("norm", 1e-9, "reach"),
    ),
    arrays=words("signals standard_error"),
)

SKIN, ORANGE, BLUE = [0], [6], [12]


def spectrum_rows() -> list[Row]:
    """All cases of the stage `spectrum`: name, comment, photos, and what is unlike the base case."""
    two = [photo(lamp, patches=ORANGE, tolerance=0.05) for lamp in ("D65", "LED-B3")]
    auto = [photo(lamp, true=true, asked=True, patches=ORANGE) for lamp, true in (("daylight", "D65"), ("auto", "A"))]
    wrong = [photo("D65", patches=SKIN), photo("A", true="D65", asked=True, patches=SKIN)]
    table: list[tuple[str, str, list[Json], Json]] = [
        ("one", "One photo, a lamp by name.", [photo("D65", patches=SKIN + BLUE)], {}),
        ("skin", "The prior of skins, the observer of 1964, adapted to D50.",
         [photo("A", patches=SKIN)], {"prior": "skin", "view": {"observer": "1964", "white": "D50"}}),
        ("two", "Two photos, lamps by name, a grey known to 5 %.", two, {}),
        ("two-auto", "Two photos: the references tell the light, of the second among all kinds.", auto, {}),
        ("bands", "No covariance of the curves, a kind of lamp with modes, and signals below black, once too far.",
         [photo("white-led", signals=[[-0.002, 0.001, -0.001], [-0.0036, 0.0018, -0.0018]])],
         {"result": BASE | {"but": {"answer/code_covariance": None}}}),
        ("error-contradicted", "The second reference shows daylight, named a bulb.", wrong, {"expect": "lamp_unfit"}),
    ]  # fmt: skip
    return [(name, comment, {"photos": photos} | change) for name, comment, photos, change in table]


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
        "far": (found.distance > FAR).tolist(),
    }


SPECTRUM = Stage(
    name="spectrum",
    requires="colour",
    rows=spectrum_rows,
    inputs_of=lambda change: {"result": BASE, "prior": "general", "view": VIEW} | change,
    run=run_spectrum,
    inputs=words("result photos prior view"),
    limits=(
        ("norm", 1e-12, "reflectance covariance_sums parts indices xyz lab xyz_covariance lab_covariance distance "
         "from_photo weights"),
        ("norm", 1e-14, "white"),
        ("exact", 0.0, "lamps far"),
        ("relative", 1e-12, "chi_squared"),
    ),
    arrays=frozenset(),
)  # fmt: skip
