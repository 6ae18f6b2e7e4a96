"""The stage `ssf`: one call of a model, from raw patch means to curves and bands."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.recovery.budget import explain
from camssf.recovery.hypotheses import recover
from camssf.recovery.onnx_model import load_model
from camssf.recovery.pivoting import SETTLED
from camssf.recovery.prediction import predict
from golden.contract import LARGEST_GAP, Call, Row, Stage, against_truth, limit, stored, words
from golden.forms import NIKON, Json, resolve
from golden.products import CALL, build_observation, model_inputs, objective_of, raw_signals, settings_of
from golden.scenes import ALL, BOTH, FAMILY, PHONE, TWELVE, YELLOW_PHONE, gain_modes, photograph, scene, uneven_light

FAR = [[[0.0, 1.5], [0.0, 0.0, 1.0], [0.0, 0.5, 0.0, -1.0]], [[0.0, 5.0], [0.0, 0.0, 6.0], [0.0, -3.0, 0.0, 5.0]]]
"""Modes so large that the lamp is practically unknown."""
LED = ["D55", "LED-B3"]
UNTOLD = {"lamp": {"lamps": ["equal-energy"] * 2}}
EXACT: Json = {"chart_tolerance": 0.0, "white_tolerance": 0.0}
PAPER: Json = {"basis": "gaussian", "l2": 0.0, "gamma": 1e-3, "nonnegative": True}
UNIT = PAPER | EXACT | {"patches": TWELVE, "standard_error": {"constant": 1.0, "shape": [1, 12, 3]}}


def whole(lamps: list[str], camera: Json = NIKON) -> Json:
    """The frames of all 24 patches."""
    return dict(photograph(camera, lamps, {"chart": "babelcolor", "patches": ALL}))


def uneven(lamps: list[str], camera: Json = NIKON, modes: Any = None, own: float = 0.075) -> Json:
    """The chart in uneven light, with gain modes that can describe it."""
    photo = whole(lamps, camera)
    lit = np.round(photo["dark"] + uneven_light()[:, None] * (photo["chart"] - photo["dark"]), 3)
    return {"lamps": lamps, "camera": camera, "chart": lit, "gain_own": own,
            "gain_modes": modes or [gain_modes(-0.05)] * len(lamps)}  # fmt: skip


def patch_modes() -> Any:
    """(24, 24) a gain mode of each patch but the white one, and one of the white's own."""
    others = 0.08 * np.delete(np.eye(24), 18, axis=0)
    return np.concatenate([others, 0.08 * (np.arange(24) != 18)[None]]).tolist()


def rows() -> list[Row]:
    """All cases."""
    one, two, black = whole(["D55"]), whole(BOTH), {"constant": 0.0, "shape": [1, 681]}
    hidden = {name: two[name].copy() for name in ("chart", "standard_error")}
    hidden["chart"][1, 18], hidden["standard_error"][1, 18] = 16_383.0, 1e3
    bent = resolve({"polynomials": [[[0.9, -0.02, 0.01]]]})[0, 0].round(6)
    nan = one["chart"].tolist()
    nan[0][3][1] = "NaN"
    phone = {"basis": "phones", "camera": PHONE}
    kind = {"lamp": {"lamps": ["white-led"]}, "lamp_modes": {"modes": ["white-led"]}, "lamp_tolerance": [0.17]}
    unproven, wrong, unfit = ({"expect": code} for code in ("not_converged", "invalid_argument", "lamp_unfit"))
    return [
        ("cameras-nikon", "Nikon D5100 under D55 + A + LED-B3, 24 patches, full covariance, λ₂ = 1; the truth is "
         "one of the cameras that the basis was learned from.", {"lamps": ["D55", "A", "LED-B3"], "rmse": 0.03}),
        ("cameras-foreign-table-two-lamps",
         "The chart photographed is Ohta's, the table known BabelColor's: lamps share the chart's error.",
         {"camera": {"camera": "Nikon Z f"}, "lamps": BOTH, "taken": "ohta", "rmse": 0.1}),
        ("cameras-floor",
         "Neither noise nor tolerances: Σ is the floor of 1e-4 and the drift, the worst conditioned.",
         EXACT | {"noise": "none", "patches": TWELVE, "rmse": 0.03}),
        ("cameras-l1-only", "λ₂ = 0: the l1 penalty alone, a sparse code.", {"l2": 0.0, "gamma": 1.4, "rmse": 0.05}),
        ("cameras-l1-tiny", "λ₂ = 0, γ = 0.001, about 1e-5 of the γ that leaves nothing.",
         {"l2": 0.0, "gamma": 1e-3, "lamps": BOTH}),
        ("cameras-posterior-mean", "γ = 0: the posterior mean in closed form.", {"gamma": 0.0, "rmse": 0.04}),
        ("cameras-zero-code", "γ = 1e9 leaves no code: the answer is the basis's mean, with gap 0.", {"gamma": 1e9}),
        ("cameras-nonnegative", "Non-negative codes on the learned basis.", {"nonnegative": True, "gamma": 0.5}),
        ("cameras-one-patch", "One patch, one row a channel.", {"patches": [15]}),
        ("cameras-lamp-modes", "Two modes of each lamp, a tilt and a bow; one shot has only the first.",
         {"lamps": BOTH, "modes": [[[0.0, 0.08], [0.0, 0.0, 0.05]], [[0.0, 0.12], [0.0]]], "lamp_tolerance": 0.01,
          "rmse": 0.06}),
        ("cameras-lamp-family", "D55 and LED-B3, told as flat lamps that may be far off: a second look.",
         UNTOLD | {"lamps": LED, "modes": FAMILY, "lamp_tolerance": 0.05, "rmse": 0.07}),
        ("cameras-lamp-far", "Modes ten times as large, no noise, no tolerance of the chart: the first look's "
         "matrices have a condition of 1e12 and more, and an explicit inverse in it was 1e-8 of the answer off.",
         UNTOLD | {"lamps": LED, "modes": FAR, "lamp_tolerance": 0.3, "noise": "none", "chart_tolerance": 0.0}),
        ("cameras-lamp-one-of-two", "A lamp known and one that is not: only the second takes ŷ for y in its rows.",
         {"lamps": LED, "modes": [[[0.0]] * 3, FAMILY[1]], "lamp_tolerance": 0.05, "rmse": 0.07,
          "lamp": {"lamps": ["D55", "equal-energy"]}}),
        ("cameras-grey-white", "The white frame shows a card of 90 %, slightly bent over wavelength.",
         {"card": bent, "rmse": 0.04}),
        ("cameras-hidden-patch", "The white patch is clipped in the second shot: a standard error of 1e3 hides it.",
         hidden | {"lamps": BOTH, "rmse": 0.04}),
        ("cameras-zero-signal",
         "Chart equal to dark: every signal is 0, which no camera gives; finite all the same.",
         {"chart": one["dark"]}),
        ("cameras-lamp-scale", "The lamp in other units (× 1000): nothing changes but the scale of the curves.",
         {"lamp": 1000.0 * np.round(resolve({"lamps": ["D55"]}), 3), "rmse": 0.04}),
        ("cameras-wide", "The prior twice as wide: s = μ + 2 Ψ x, in rows, evidence, bands and curves.",
         {"patches": TWELVE, "prior_scale": 2.0}),
        ("cameras-uneven-two", "Two shots: about curves and gains of a first look.", uneven(BOTH) | {"rmse": 0.05}),
        ("phones-bells", "A phone of Gaussian bells, which no list contains; two lamps, the product's penalties.",
         phone | {"lamps": BOTH, "rmse": 0.06}),
        ("phones-uneven", "A plane and a bowl of light over the chart, solved for with the curves.",
         phone | uneven(["D55"], PHONE) | {"rmse": 0.05}),
        ("phones-uneven-kind", "A lamp told by its kind, and uneven light: modes of both beside each other.",
         phone | uneven(["LED-B3"], PHONE) | kind | {"rmse": 0.08}),
        ("phones-uneven-each", "Every patch by itself: a mode each, and one of the white's own.",
         phone | uneven(["D55"], PHONE, [patch_modes()], 0.0) | {"rmse": 0.08}),
        ("ryyb-bells", "The same phone with yellow in green's place.",
         {"basis": "ryyb", "camera": YELLOW_PHONE, "lamps": BOTH, "rmse": 0.06}),
        ("gaussian-paper", "Σ = I: the paper's Eq. (10), x ≥ 0, 12 patches; Nikon D5100 under D55.",
         UNIT | {"gamma": 1e-5, "rmse": 0.08}),
        ("gaussian-paper-signed", "Σ = I: the paper's literal Eq. (10); Nikon D5100 under D55.",
         UNIT | {"gamma": 1e-4, "rmse": 0.10, "nonnegative": False}),
        ("gaussian-measured-errors", "Σ from the measured standard errors and a chart tolerance of 1 %.",
         PAPER | {"gamma": 1.0, "noise": "usual", "chart_tolerance": 0.01}),
        ("gaussian-ridge-nonnegative", "λ₂ = 0.01, γ = 0, x ≥ 0.",
         PAPER | EXACT | {"l2": 0.01, "gamma": 0.0, "patches": TWELVE}),
        ("gaussian-identical-patches", "Twelve times the same patch: rank one.",
         PAPER | EXACT | {"patches": [15] * 12, "gamma": 0.1}),
        ("gaussian-three-patches", "Three patches, 18 atoms: the layers' support has more atoms than there are rows, "
         "the walk from it keeps few digits, and only a second one, from where it ended, is proven.",
         PAPER | EXACT | {"patches": [8, 11, 16], "gamma": 85.0, "noise": "none"}),
        ("error-zero-code-gaussian", "γ = 1e6 leaves none of the paper's curves.", PAPER | unproven | {"gamma": 1e6}),
        ("error-zero-signal-gaussian", "Chart equal to dark: no curve explains a black chart.",
         PAPER | unproven | {"chart": one["dark"]}),
        ("error-wide-gaussian", "A wider prior of a basis that has none.", PAPER | wrong | {"prior_scale": 2.0}),
        ("error-nan-prior-scale", "A prior's width is no number.", wrong | {"patches": TWELVE, "prior_scale": "NaN"}),
        ("error-two-shots-gaussian", "The paper's rows take one shot.", PAPER | wrong | {"lamps": BOTH}),
        ("error-no-penalty", "γ = 0 and λ₂ = 0 leave no unique answer.", wrong | {"l2": 0.0, "gamma": 0.0}),
        ("error-negative-gamma", "γ < 0.", wrong | {"gamma": -0.1}),
        ("error-negative-l2", "λ₂ < 0.", wrong | {"l2": -1.0}),
        ("error-nan-gamma", "γ is not a number.", wrong | {"gamma": "NaN"}),
        ("error-nan-signal", "A chart mean that is not a number.", wrong | {"chart": nan}),
        ("error-negative-tolerance", "A chart tolerance below zero.", wrong | {"chart_tolerance": -0.03}),
        ("error-negative-standard-error", "A standard error below zero.",
         wrong | {"standard_error": {"constant": -0.01, "shape": [1, 24, 3]}}),
        ("error-reflectance-missing", "23 reflectances for 24 patches.",
         wrong | {"reflectance": {"chart": "babelcolor", "patches": ALL[:-1]}}),
        ("error-lamp-dark", "A lamp without power on the grid.", unfit | {"lamp": black}),
        ("error-lamp-negative", "A lamp with negative power.", unfit | {"lamp": black | {"constant": -1.0}}),
        ("error-lamps-too-many", "Two lamps for one shot.", wrong | {"lamp": {"lamps": BOTH}}),
        ("error-modes-of-another-shot", "Modes for two, one shot.", wrong | {"modes": [[[0.0, 0.1]], [[0.0, 0.1]]]}),
        ("error-white-black", "A white reference that reflects nothing.",
         wrong | {"white_reflectance": {"constant": 0.0, "shape": [681]}}),
        ("error-gain-modes", "Gain modes of 23 patches for 24.",
         wrong | uneven(["D55"], modes=[np.zeros((1, 23)).tolist()], own=0.0)),
        ("error-gain-own", "A negative share of its own.", wrong | uneven(["D55"], own=-0.1)),
    ]  # fmt: skip


def run(call: Call) -> dict[str, Any]:
    """The stage `ssf`: by the model alone; the reference and error cases by `recover`, which checks its arguments."""
    given, sound = call.given, call.case["expect"] == "success"
    with np.errstate(divide="ignore", invalid="ignore"):
        signals = raw_signals(given)
    if call.engine == "onnx" and sound:
        outputs: dict[str, Any] = load_model(given["basis"]).run(model_inputs(given))
    else:
        frames = tuple(given[name] for name in ("chart", "white", "dark"))
        observation = build_observation(given, signals, frames if sound else None)
        scale = float(given.get("prior_scale", 1.0))
        ssf = recover(observation, basis=given["basis"], settings=settings_of(call), prior_scale=scale)
        budget = std = None
        if ssf.std is not None:
            std = predict(ssf, observation).std
            shares = explain(observation, basis=ssf.basis, prior_scale=ssf.prior_scale)
            budget = np.array(list(shares.values()))
        outputs = {
            "predicted_std": std, "budget": budget, "ssf": ssf.values, "ssf_std": ssf.std, "signals": signals,
            "evidence": ssf.log_evidence,
            **{name: getattr(ssf, name) for name in ("code", "code_covariance", "predicted", "channel_gain")},
            **vars(ssf.proof),
        }  # fmt: skip
    covariance, sums = outputs.pop("code_covariance"), None
    if covariance is not None:  # fewer numbers are stored, in which every element counts
        sums = covariance.reshape(len(covariance), 3, -1).sum(axis=2)
    return outputs | {"objective": objective_of(given, outputs["code"]), "code_covariance_sums": sums}


LIMITS = (
    ("norm", 1e-10, "ssf ssf_std code_covariance_sums"),
    ("norm", 1e-15, "signals"),
    ("norm", 1e-10, "predicted predicted_std budget"),
    ("relative", 1e-10, "evidence"),
    ("norm", 1e-14, "channel_gain"),
)


def limits(made: Json, scene: Json) -> list[Json]:
    """Against the stored outputs, the oracle and the true camera; where no step was taken none may be."""
    alone, curves = [], []
    if not np.any(made["outputs"]["finish_steps"]):
        alone = [limit("finish_steps", "outputs", "at_most", 0.0), limit("layers_gap", "outputs", "at_most", SETTLED)]
    if made["oracle"]["ssf"] is not None:
        curves = [limit("ssf", "oracle", "peak", 1e-6)]
    optimum = limit("objective", "oracle", "relative", 1e-9, "reference")
    proof = [optimum, limit("gap", "oracle", "at_most", LARGEST_GAP)]
    return [*stored(made, LIMITS), *alone, *proof, *curves, *against_truth(made, scene)]


STAGE = Stage(
    name="ssf",
    requires="model",
    rows=rows,
    inputs_of=scene,
    run=run,
    inputs=CALL,
    optional=words("prior_scale gain_modes gain_own"),
    limits=limits,
    outputs=words(
        "signals code gap layers_gap finish_steps evidence ssf ssf_std code_covariance_sums predicted channel_gain "
        "predicted_std budget"
    ),
    convex=True,
)
