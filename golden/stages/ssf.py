"""The stage `ssf`: one call of a model, from raw patch means to curves and bands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from camssf.recovery.budget import explain
from camssf.recovery.hypotheses import recover
from camssf.recovery.onnx_model import load_model
from camssf.recovery.pivoting import SETTLED
from camssf.recovery.prediction import predict
from golden.contract import Call, Stage, against_oracle, against_truth, each, limit, stored, words
from golden.forms import Json, resolve
from golden.products import (
    CALL,
    build_observation,
    build_rows,
    model_inputs,
    objective_of,
    prior_scale,
    problem_of_call,
    settings_of,
)
from golden.scenes import (
    ALL,
    BELLS,
    FAMILY,
    NIKON,
    PHONE,
    TWELVE,
    YELLOW_PHONE,
    gain_modes,
    photograph,
    scene,
    uneven_light,
)

Row: TypeAlias = tuple[str, str, Json]
"""Name, comment, and what is unlike the base case: arguments of `scene`; `rmse` bounds the curves' error."""
FAR = [[[0.0, 1.5], [0.0, 0.0, 1.0], [0.0, 0.5, 0.0, -1.0]], [[0.0, 5.0], [0.0, 0.0, 6.0], [0.0, -3.0, 0.0, 5.0]]]
"""Modes so large that the lamp is practically unknown."""
BOTH, LED = ["D55", "A"], ["D55", "LED-B3"]
UNTOLD = {"lamp": {"lamps": ["equal-energy"] * 2}}
EXACT: Json = {"chart_tolerance": 0.0, "white_tolerance": 0.0}


def whole(lamps: list[str], camera: Json = NIKON, **more: Any) -> Json:
    """The frames of all 24 patches."""
    return dict(photograph(camera, lamps, {"chart": "babelcolor", "patches": ALL}, **more))


def _cameras() -> list[Row]:
    known = "the truth is one of the cameras that the basis was learned from"
    makers: list[tuple[str, str, list[str], list[int], float]] = [
        ("arri", "ARRI D21", ["D55"], ALL, 0.10),
        ("nikon", "Nikon D5100", ["D55", "A", "LED-B3"], ALL, 0.03),
        ("sony", "Sony ILCE-7M3", ["FL2", "D55"], ALL, 0.04),
    ]
    other = "The chart photographed is Ohta's, the table known BabelColor's: lamps share the chart's error."
    foreign: Json = {"camera": {"camera": "Nikon Z f"}, "taken": "ohta", "rmse": 0.10}
    hidden = whole(BOTH)
    hidden["chart"][1, 18], hidden["standard_error"][1, 18] = 16_383.0, 1e3
    bent = resolve({"polynomials": [[[0.9, -0.02, 0.01]]]})[0, 0].round(6)
    return [
        *((name, f"{camera} under {' + '.join(lamps)}, {len(patches)} patches, full covariance, λ₂ = 1; {known}.",
           {"camera": {"camera": camera}, "lamps": lamps, "patches": patches, "rmse": bound})
          for name, camera, lamps, patches, bound in makers),
        ("mixtures", "96 patches that are convex mixtures of the measured 24: more rows, no more evidence.",
         {"camera": {"camera": "Canon EOS R5"}, "patches": 96, "rmse": 0.04}),
        ("bells", "A camera of Gaussian bells, which no list contains; three shots.",
         {"camera": BELLS, "lamps": ["D55", "A", "FL2"], "rmse": 0.06}),
        ("foreign-table-one-lamp", other, foreign),
        ("foreign-table-two-lamps", other, foreign | {"lamps": BOTH}),
        ("diagonal", "All tolerances zero: Σ is the diagonal of the measured errors, and the drift of the light.",
         EXACT | {"rmse": 0.03}),
        ("floor", "Neither noise nor tolerances: Σ is the floor of 1e-4 and the drift, the worst conditioned.",
         EXACT | {"noise": "none", "patches": TWELVE, "rmse": 0.03}),
        ("l1-only", "λ₂ = 0, γ = 1.4: the l1 penalty alone, a sparse code.", {"l2": 0.0, "gamma": 1.4, "rmse": 0.05}),
        ("l1-tiny", "λ₂ = 0, γ = 0.001, about 1e-5 of the γ that leaves nothing.",
         {"l2": 0.0, "gamma": 1e-3, "lamps": BOTH}),
        ("gamma-half", "λ₂ = 1, γ = 0.5: ten times the default.", {"gamma": 0.5, "rmse": 0.05}),
        ("posterior-mean", "λ₂ = 1, γ = 0: the Gaussian posterior mean in closed form.",
         {"gamma": 0.0, "rmse": 0.04}),
        ("zero-code", "γ = 1e9 leaves no code at all: the answer is the mean of the basis, with gap 0.",
         {"gamma": 1e9}),
        ("nonnegative", "Non-negative codes on the learned basis.", {"nonnegative": True, "gamma": 0.5}),
        ("nonnegative-closed", "γ = 0 and non-negative codes: NNLS with a ridge.",
         {"nonnegative": True, "gamma": 0.0}),
        ("identical-patches", "Six times one patch, six times another: rank two, the prior fills the rest.",
         {"patches": [19] * 6 + [15] * 6}),
        ("one-patch", "One patch, one row a channel.", {"patches": [15]}),
        ("lamp-tolerance", "Both lamps may be off by 2 % (smooth).",
         {"lamps": BOTH, "lamp_tolerance": 0.02, "rmse": 0.06}),
        ("lamp-modes", "Two modes of each lamp, a tilt and a bow; one shot has only the first.",
         {"lamps": BOTH, "modes": [[[0.0, 0.08], [0.0, 0.0, 0.05]], [[0.0, 0.12], [0.0]]], "lamp_tolerance": 0.01,
          "rmse": 0.06}),
        ("lamp-family", "D55 and LED-B3, told as flat lamps that may be far off: a second look.",
         {"lamps": LED, "modes": FAMILY, "lamp_tolerance": 0.05, "rmse": 0.07, "change": UNTOLD}),
        ("lamp-far", "Modes ten times as large, no noise, no tolerance of the chart: the first look's matrices have "
         "a condition of 1e12 and more, and an explicit inverse in it was 1e-8 of the answer off.",
         {"lamps": LED, "modes": FAR, "lamp_tolerance": 0.3, "noise": "none", "chart_tolerance": 0.0,
          "change": UNTOLD}),
        ("lamp-one-of-two", "A lamp known and one that is not: only the second takes ŷ for y in its rows.",
         {"lamps": LED, "modes": [[[0.0]] * 3, FAMILY[1]], "lamp_tolerance": 0.05, "rmse": 0.07,
          "change": {"lamp": {"lamps": ["D55", "equal-energy"]}}}),
        ("grey-white", "The white frame shows a card of 90 %, slightly bent over wavelength.",
         {"white": bent, "rmse": 0.04}),
        ("hidden-patch", "The white patch is clipped in the second shot: a standard error of 1e3 hides it.",
         {"lamps": BOTH, "change": hidden, "rmse": 0.04}),
        ("zero-signal", "Chart equal to dark: every signal is 0, which no camera gives; finite all the same.",
         {"change": {"chart": whole(["D55"])["dark"]}}),
        ("lamp-scale", "The lamp in other units (× 1000): nothing changes but the scale of the curves.",
         {"change": {"lamp": 1000.0 * np.round(resolve({"lamps": ["D55"]}), 3)}, "rmse": 0.04}),
        ("wide", "The prior twice as wide: s = μ + 2 Ψ x, in rows, evidence, bands and curves.",
         {"patches": TWELVE, "change": {"prior_scale": 2.0}}),
    ]  # fmt: skip


def _phones() -> list[Row]:
    """Of a phone of Gaussian bells, on the basis of phones."""
    return [
        ("bells", "A phone of Gaussian bells, which no list contains; two lamps, the product's penalties.",
         {"lamps": BOTH, "rmse": 0.06}),
        ("uneven", "A plane and a bowl of light over the chart, solved for with the curves.",
         {"change": uneven(["D55"], PHONE), "rmse": 0.05}),
        ("uneven-kind", "A lamp told by its kind, and uneven light: modes of both beside each other.",
         {"lamps": ["LED-B3"], "rmse": 0.08, "change": uneven(["LED-B3"], PHONE) | {
             "lamp": {"lamps": ["white-led"]}, "lamp_modes": {"modes": ["white-led"]}, "lamp_tolerance": [0.17]}}),
        ("uneven-each", "Every patch by itself: a mode each, and one of the white's own.",
         {"change": uneven(["D55"], PHONE, [patch_modes()], 0.0), "rmse": 0.08}),
    ]  # fmt: skip


def uneven(lamps: list[str], camera: Json = NIKON, modes: Any = None, own: float = 0.075) -> Json:
    """The chart in uneven light, with gain modes that can describe it."""
    photo = whole(lamps, camera)
    lit = np.round(photo["dark"] + uneven_light()[:, None] * (photo["chart"] - photo["dark"]), 3)
    return {"chart": lit, "gain_modes": modes or [gain_modes(-0.05)] * len(lamps), "gain_own": own}


def patch_modes() -> Any:
    """(24, 24) a gain mode of each patch but the white one, and one of the white's own."""
    others = 0.08 * np.delete(np.eye(24), 18, axis=0)
    return np.concatenate([others, 0.08 * (np.arange(24) != 18)[None]]).tolist()


def _gaussian() -> list[Row]:
    """On the paper's basis."""

    def unit(camera: str, lamp: str, patches: Any, gamma: float, rmse: float, nonnegative: bool = True) -> Json:
        n = patches if isinstance(patches, int) else len(patches)
        return EXACT | {
            "camera": {"camera": camera}, "lamps": [lamp], "patches": patches, "gamma": gamma, "rmse": rmse,
            "nonnegative": nonnegative, "change": {"standard_error": {"constant": 1.0, "shape": [1, n, 3]}},
        }  # fmt: skip

    nikon = "Nikon D5100"
    return [
        ("paper", "Σ = I: the paper's Eq. (10), x ≥ 0, 12 patches; Nikon D5100 under D55.",
         unit(nikon, "D55", TWELVE, 1e-5, 0.08)),
        ("paper-signed", "Σ = I: the paper's literal Eq. (10); Nikon D5100 under D55.",
         unit(nikon, "D55", TWELVE, 1e-4, 0.10, nonnegative=False)),
        ("measured-errors", "Σ from the measured standard errors and a chart tolerance of 1 %.",
         {"gamma": 1.0, "noise": "usual", "chart_tolerance": 0.01}),
        ("ridge", "λ₂ = 1 and γ = 0.05, measured errors.", EXACT | {"l2": 1.0, "gamma": 0.05}),
        ("ridge-signed", "λ₂ = 0.01, γ = 0, signed: the closed form.",
         EXACT | {"l2": 0.01, "gamma": 0.0, "nonnegative": False}),
        ("ridge-nonnegative", "λ₂ = 0.01, γ = 0, x ≥ 0.", EXACT | {"l2": 0.01, "gamma": 0.0, "patches": TWELVE}),
        ("identical-patches", "Twelve times the same patch: rank one.", EXACT | {"patches": [15] * 12, "gamma": 0.1}),
        ("two-patches", "Six times one patch, six times another, and no prior: rank two.",
         EXACT | {"patches": [19] * 6 + [15] * 6, "gamma": 0.1}),
        ("three-patches", "Three patches, 18 atoms: the layers' support has more atoms than there are rows, the walk "
         "from it keeps few digits, and only a second one, from where it ended, is proven.",
         EXACT | {"patches": [8, 11, 16], "gamma": 85.0, "noise": "none"}),
        ("equal-energy", "The paper's assumption of a flat lamp, true here.",
         unit(nikon, "equal-energy", TWELVE, 1e-5, 0.08) | {"noise": "none"}),
    ]  # fmt: skip


def _errors() -> list[tuple[str, str, str, Json]]:
    """Name, error code, comment and change of what must be refused."""
    wrong, unfit, paper = "invalid_argument", "lamp_unfit", {"basis": "gaussian"}
    one, two = whole(["D55"]), whole(BOTH)
    nan = one["chart"].tolist()
    nan[0][3][1] = "NaN"
    ragged = {name: [two[name][0].tolist(), two[name][1, :-1].tolist()] for name in ("chart", "white", "dark")}
    width = "A prior's width that is no positive number."
    return [
        ("zero-code-gaussian", "not_converged", "γ = 1e6 leaves nothing of the paper's curves.",
         paper | {"gamma": 1e6}),
        ("zero-signal-gaussian", "not_converged", "Chart equal to dark: no curve explains a black chart.",
         paper | {"change": {"chart": one["dark"]}}),
        ("wide-gaussian", wrong, "A wider prior of a basis that has none.", paper | {"change": {"prior_scale": 2.0}}),
        ("zero-prior-scale", wrong, width, {"patches": TWELVE, "change": {"prior_scale": 0.0}}),
        ("nan-prior-scale", wrong, width, {"patches": TWELVE, "change": {"prior_scale": "NaN"}}),
        ("two-shots-gaussian", wrong, "The paper's rows take one shot.", paper | {"lamps": BOTH}),
        ("no-penalty", wrong, "γ = 0 and λ₂ = 0 leave no unique answer.", {"l2": 0.0, "gamma": 0.0}),
        ("negative-gamma", wrong, "γ < 0.", {"gamma": -0.1}),
        ("negative-l2", wrong, "λ₂ < 0.", {"l2": -1.0}),
        ("nan-gamma", wrong, "γ is not a number.", {"change": {"gamma": "NaN"}}),
        ("nan-signal", wrong, "A chart mean that is not a number.", {"change": {"chart": nan}}),
        ("negative-tolerance", wrong, "A chart tolerance below zero.", {"chart_tolerance": -0.03}),
        ("negative-standard-error", wrong, "A standard error below zero.",
         {"change": {"standard_error": {"constant": -0.01, "shape": [1, 24, 3]}}}),
        ("reflectance-missing", wrong, "23 reflectances for 24 patches.",
         {"change": {"reflectance": {"chart": "babelcolor", "patches": ALL[:-1]}}}),
        ("unequal-shots", wrong, "24 patches in the first shot, 23 in the second.",
         {"lamps": BOTH, "change": ragged}),
        ("lamp-dark", unfit, "A lamp without power on the grid.",
         {"change": {"lamp": {"constant": 0.0, "shape": [1, 681]}}}),
        ("lamp-negative", unfit, "A lamp with negative power.",
         {"change": {"lamp": {"constant": -1.0, "shape": [1, 681]}}}),
        ("lamps-too-many", wrong, "Two lamps for one shot.", {"change": {"lamp": {"lamps": BOTH}}}),
        ("modes-of-another-shot", wrong, "Modes for two shots, one given.", {"modes": [[[0.0, 0.1]], [[0.0, 0.1]]]}),
        ("white-black", wrong, "A white reference that reflects nothing.",
         {"change": {"white_reflectance": {"constant": 0.0, "shape": [681]}}}),
        ("gain-modes", wrong, "Gain modes of 23 patches for 24.",
         {"change": uneven(["D55"], modes=[np.zeros((1, 23)).tolist()], own=0.0)}),
        ("gain-own", wrong, "A negative share of its own.", {"change": uneven(["D55"], own=-0.1)}),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    for basis, rows in (("cameras", _cameras()), ("phones", _phones()), ("gaussian", _gaussian())):
        base: Json = {"basis": basis, "camera": PHONE if basis == "phones" else NIKON}
        for name, comment, change in rows:
            yield scene(f"{basis}-{name}", comment, **(base | change))
    yield scene("cameras-uneven-two", "Two shots: about the curves and the gains of a first look.", lamps=BOTH,
                change=uneven(BOTH), rmse=0.05)  # fmt: skip
    yield scene("ryyb-bells", "The same phone with yellow in green's place.", lamps=BOTH, rmse=0.06, basis="ryyb",
                camera=YELLOW_PHONE)  # fmt: skip
    for name, code, comment, change in _errors():
        yield scene(f"error-{name}", comment, expect=code, **change)


def run(call: Call) -> dict[str, Any]:
    """The stage `ssf`: by the model alone; the reference and error cases by `recover`, which checks its arguments."""
    given, sound = call.given, call.case["expect"] == "success"
    frames = [given[name] for name in ("chart", "white", "dark")]
    with np.errstate(divide="ignore", invalid="ignore"):
        signals = [(np.array(c, float) - d) / (np.array(w, float) - d) for c, w, d in zip(*frames, strict=True)]
    outputs: dict[str, Any]
    if call.engine == "onnx" and sound:
        model = load_model(given["basis"])
        outputs = model.run(model_inputs(model, given))
    else:
        observation = build_observation(given, signals, tuple(frames) if sound else None)
        scale = prior_scale(given)
        ssf = recover(observation, basis=given["basis"], settings=settings_of(call), prior_scale=scale)
        budget = std = None
        if ssf.std is not None:
            std = predict(ssf, observation).std
            shares = explain(observation, basis=ssf.basis, prior_scale=ssf.prior_scale)
            budget = np.array(list(shares.values()))
        outputs = {
            "predicted_std": std,
            "budget": budget,
            "ssf": ssf.values,
            "ssf_std": ssf.std,
            "signals": np.stack(signals),
            "evidence": ssf.log_evidence,
            **{name: getattr(ssf, name) for name in ("code", "code_covariance", "predicted", "channel_gain")},
            **vars(ssf.proof),
        }
    return outputs | {"objective": objective_of(given, build_rows(given, np.stack(signals)), outputs["code"])}


LIMITS = (
    *each("norm", 1e-10, "ssf ssf_std"),
    *each("sums", 1e-10, "code_covariance"),
    *each("norm", 1e-15, "signals"),
    *each("norm", 1e-10, "predicted predicted_std budget"),
    *each("relative", 1e-10, "evidence"),
    *each("norm", 1e-14, "channel_gain"),
)


def limits(made: Json, scene: Json) -> list[Json]:
    """Against the stored outputs, the oracle and the true camera; where no step was taken none may be."""
    alone = []
    if not np.any(made["outputs"]["finish_steps"]):
        alone = [limit("finish_steps", "outputs", "at_most", 0.0), limit("layers_gap", "outputs", "at_most", SETTLED)]
    return [*stored(made, LIMITS), *alone, *against_oracle(made, "reference"), *against_truth(made, scene)]


STAGE = Stage(
    name="ssf",
    requires="model",
    cases=cases,
    run=run,
    inputs=CALL,
    optional=words("prior_scale gain_modes gain_own"),
    limits=limits,
    outputs=words(
        "signals code gap layers_gap finish_steps evidence ssf ssf_std code_covariance predicted channel_gain "
        "predicted_std budget"
    ),
    problem=problem_of_call,
    oracle=True,
)
