"""The stage `ssf`: one call of a model, from raw patch means to curves and bands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf.recovery.budget import explain
from camssf.recovery.hypotheses import recover
from camssf.recovery.onnx_model import load_model
from camssf.recovery.pivoting import SETTLED
from camssf.recovery.prediction import predict
from camssf.recovery.sensitivity import SolverSettings
from golden.contract import Call, Keys, Stage, against_oracle, against_truth, always, each, limit, stored, words
from golden.forms import Json, resolve
from golden.products import (
    CALL,
    build_observation,
    build_rows,
    model_inputs,
    objective_of,
    prior_scale,
    problem_of_call,
)
from golden.scenes import (
    ALL,
    BELLS,
    EIGHTEEN,
    FAMILY,
    NIKON,
    NINE,
    PHONE,
    TWELVE,
    YELLOW_PHONE,
    Case,
    photograph,
    scene,
    uneven_light,
)

FAR = [[[0.0, 1.5], [0.0, 0.0, 1.0], [0.0, 0.5, 0.0, -1.0]], [[0.0, 5.0], [0.0, 0.0, 6.0], [0.0, -3.0, 0.0, 5.0]]]
"""Modes so large that the lamp is practically unknown."""


def _cameras() -> Iterator[Case]:
    known = "the truth is one of the cameras that the basis was learned from"
    makers = [
        ("arri", "ARRI D21", ["D55"], ALL, 0.10),
        ("insta360", "Arashi Vision Insta360 X5", ["A"], ALL, 0.05),
        ("canon", "Canon EOS 5D Mark II", ["LED-B3"], EIGHTEEN, 0.04),
        ("fujifilm", "Fujifilm X-T3", ["FL2"], TWELVE, 0.08),
        ("hasselblad", "Hasselblad L1D-20c", ["D55", "A"], ALL, 0.05),
        ("nikon", "Nikon D5100", ["D55", "A", "LED-B3"], ALL, 0.03),
        ("panasonic", "Panasonic DC-GX9", ["D55"], NINE, 0.06),
        ("sony", "Sony ILCE-7M3", ["FL2", "D55"], ALL, 0.04),
    ]
    for name, camera, lamps, patches, bound in makers:
        yield scene(
            f"cameras-{name}",
            f"{camera} under {' + '.join(lamps)}, {len(patches)} patches, full covariance, λ₂ = 1; {known}.",
            camera={"camera": camera}, lamps=lamps, patches=patches, rmse=bound,
        )  # fmt: skip
    yield scene(
        "cameras-sony-compact", f"A compact camera, two lamps, usual noise; {known}.",
        camera={"camera": "Sony DSC-RX100M4"}, lamps=["D55", "A"], noise="usual", rmse=0.06,
    )  # fmt: skip
    yield scene(
        "cameras-mixtures", "96 patches that are convex mixtures of the measured 24: more rows, no more evidence.",
        camera={"camera": "Canon EOS R5"}, patches=96, rmse=0.04,
    )  # fmt: skip
    yield scene(
        "cameras-bells", "A camera of Gaussian bells, which is in nobody's list; three shots.",
        camera=BELLS, lamps=["D55", "A", "FL2"], rmse=0.06,
    )  # fmt: skip
    for share, lamps in (("one-lamp", ["D55"]), ("two-lamps", ["D55", "A"])):
        yield scene(
            f"cameras-foreign-table-{share}",
            "The chart photographed is Ohta's, the table known BabelColor's: lamps share the chart's error.",
            camera={"camera": "Nikon Z f"}, lamps=lamps, taken="ohta", rmse=0.10,
        )  # fmt: skip
    off: Json = {"chart_tolerance": 0.0, "white_tolerance": 0.0}
    yield scene(
        "cameras-diagonal",
        "All tolerances zero: Σ is the diagonal of the measured errors, and the drift of the light.",
        **off,
        rmse=0.03,
    )
    yield scene(
        "cameras-floor", "Neither noise nor tolerances: Σ is the floor of 1e-4 and the drift, the worst conditioned.",
        noise="none", patches=TWELVE, **off, rmse=0.03,
    )  # fmt: skip
    yield scene(
        "cameras-l1-only", "λ₂ = 0, γ = 1.4: the l1 penalty alone, a sparse code.", l2=0.0, gamma=1.4, rmse=0.05,
    )  # fmt: skip
    yield scene(
        "cameras-l1-tiny",
        "λ₂ = 0, γ = 0.001, about 1e-5 of the γ that leaves nothing.",
        l2=0.0,
        gamma=1e-3,
        lamps=["D55", "A"],
    )
    yield scene("cameras-gamma-half", "λ₂ = 1, γ = 0.5: ten times the default.", gamma=0.5, rmse=0.05)
    yield scene("cameras-gamma-two", "λ₂ = 1, γ = 2 under A, 12 patches.", gamma=2.0, lamps=["A"], patches=TWELVE)
    yield scene(
        "cameras-posterior-mean", "λ₂ = 1, γ = 0: the Gaussian posterior mean in closed form.", gamma=0.0, rmse=0.04,
    )  # fmt: skip
    yield scene(
        "cameras-zero-code", "γ = 1e9 leaves no code at all: the answer is the mean of the basis, with gap 0.",
        gamma=1e9,
    )  # fmt: skip
    yield scene("cameras-nonnegative", "Non-negative codes on the learned basis.", nonnegative=True, gamma=0.5)
    yield scene(
        "cameras-nonnegative-closed", "γ = 0 and non-negative codes: NNLS with a ridge.", nonnegative=True, gamma=0.0,
    )  # fmt: skip
    yield scene(
        "cameras-identical-patches", "Six times one patch, six times another: rank two, the prior fills the rest.",
        patches=[19] * 6 + [15] * 6,
    )  # fmt: skip
    yield scene("cameras-one-patch", "One patch, one row a channel.", patches=[15])
    yield scene(
        "cameras-lamp-tolerance", "Both lamps may be off by 2 % (smooth).", lamps=["D55", "A"],
        lamp_tolerance=0.02, rmse=0.06,
    )  # fmt: skip
    yield scene(
        "cameras-lamp-modes", "Two modes of each lamp, a tilt and a bow; one shot has only the first.",
        lamps=["D55", "A"], modes=[[[0.0, 0.08], [0.0, 0.0, 0.05]], [[0.0, 0.12], [0.0]]], lamp_tolerance=0.01,
        rmse=0.06,
    )  # fmt: skip
    yield scene(
        "cameras-lamp-family", "D55 and LED-B3, told as flat lamps that may be far off: a second look.",
        lamps=["D55", "LED-B3"], modes=FAMILY, lamp_tolerance=0.05, rmse=0.07,
        change={"lamp": {"lamps": ["equal-energy"] * 2}},
    )  # fmt: skip
    yield scene(
        "cameras-lamp-far", "Modes ten times as large, no noise, no tolerance of the chart: the first look's "
        "matrices have a condition of 1e12 and more, and an explicit inverse in it was 1e-8 of the answer off.",
        lamps=["D55", "LED-B3"], modes=FAR, lamp_tolerance=0.3, noise="none", chart_tolerance=0.0,
        change={"lamp": {"lamps": ["equal-energy"] * 2}},
    )  # fmt: skip
    yield scene(
        "cameras-lamp-one-of-two", "A lamp known and one that is not: only the second takes ŷ for y in its rows.",
        lamps=["D55", "LED-B3"], modes=[[[0.0]] * 3, FAMILY[1]], lamp_tolerance=0.05, rmse=0.07,
        change={"lamp": {"lamps": ["D55", "equal-energy"]}},
    )  # fmt: skip
    white = {"polynomials": [[[0.9, -0.02, 0.01]]]}
    yield scene(
        "cameras-grey-white", "The white frame shows a card of 90 %, slightly bent over wavelength.",
        white=resolve(white)[0, 0].round(6), rmse=0.04,
    )  # fmt: skip
    two = photograph(NIKON, ["D55", "A"], {"chart": "babelcolor", "patches": ALL})
    chart, error = two["chart"].copy(), two["standard_error"].copy()
    chart[1, 18], error[1, 18] = 16_383.0, 1e3
    yield scene(
        "cameras-hidden-patch", "The white patch is clipped in the second shot: a standard error of 1e3 hides it.",
        lamps=["D55", "A"], change={"chart": chart, "standard_error": error}, rmse=0.04,
    )  # fmt: skip
    one = photograph(NIKON, ["D55"], {"chart": "babelcolor", "patches": ALL})
    yield scene(
        "cameras-zero-signal", "Chart equal to dark: every signal is 0, which no camera gives; finite all the same.",
        change={"chart": one["dark"]},
    )  # fmt: skip
    yield scene(
        "cameras-lamp-scale", "The lamp in other units (× 1000): nothing changes but the scale of the curves.",
        change={"lamp": 1000.0 * np.round(resolve({"lamps": ["D55"]}), 3)}, rmse=0.04,
    )  # fmt: skip


def _phones() -> Iterator[Case]:
    phone: Json = {"basis": "phones", "camera": PHONE}
    yield scene(
        "phones-bells", "A phone of Gaussian bells, which is in nobody's list; two lamps, the product's penalties.",
        lamps=["D55", "A"], rmse=0.06, **phone,
    )  # fmt: skip
    yield scene(
        "ryyb-bells", "The same phone with yellow in green's place.", lamps=["D55", "A"], rmse=0.06, basis="ryyb",
        camera=YELLOW_PHONE,
    )  # fmt: skip
    yield scene("phones-l1-only", "λ₂ = 0, γ = 1.4: the l1 penalty alone.", l2=0.0, gamma=1.4, **phone)
    yield scene(
        "phones-nonnegative-closed", "γ = 0 and non-negative codes.", patches=TWELVE, nonnegative=True, gamma=0.0,
        **phone,
    )  # fmt: skip
    for basis, camera in (("phones", PHONE), ("cameras", NIKON)):
        yield scene(
            f"{basis}-wide", "The prior twice as wide: s = μ + 2 Ψ x, in rows, evidence, bands and curves.",
            basis=basis, camera=camera, patches=TWELVE, change={"prior_scale": 2.0},
        )  # fmt: skip


def _gain_modes(shots: int) -> list[Any]:
    """(k, 6, 24) linear and quadratic modes and one of the white patch, all minus their value on the white patch."""
    i = np.arange(24)
    x, y = (i % 6 - 2.5) / 2.5, (i // 6 - 1.5) / 2.5
    ways = np.stack([0.2 * x, 0.2 * y, 0.3 * x**2, 0.3 * x * y, 0.3 * y**2, -0.05 * (i == 18)])
    each: list[Any] = np.round(ways - ways[:, [18]], 9).tolist()
    return [each] * shots


def _uneven() -> Iterator[Case]:
    """Cases of uneven light on the chart, with gain modes that can describe it."""

    def uneven(name: str, comment: str, lamps: list[str], modes: list[Any], own: float, **more: Any) -> Case:
        camera = more.get("camera", NIKON)
        photo = photograph(camera, lamps, {"chart": "babelcolor", "patches": ALL})
        lit = np.round(photo["dark"] + uneven_light()[:, None] * (photo["chart"] - photo["dark"]), 3)
        change = {"chart": lit, "gain_modes": modes, "gain_own": own} | more.pop("change", {})
        return scene(name, comment, lamps=lamps, change=change, **more)

    phone: Json = {"basis": "phones", "camera": PHONE}
    yield uneven("phones-uneven", "A plane and a bowl of light over the chart, solved for with the curves.", ["D55"],
                 _gain_modes(1), 0.075, rmse=0.05, **phone)  # fmt: skip
    yield uneven("cameras-uneven-two", "Two shots: about the curves and the gains of a first look.", ["D55", "A"],
                 _gain_modes(2), 0.075, rmse=0.05)  # fmt: skip
    yield uneven("phones-uneven-kind", "A lamp told by its kind, and uneven light: modes of both beside each other.",
                 ["LED-B3"], _gain_modes(1), 0.075, rmse=0.08,
                 change={"lamp": {"lamps": ["white-led"]}, "lamp_modes": {"modes": ["white-led"]},
                         "lamp_tolerance": [0.17]}, **phone)  # fmt: skip
    each = np.concatenate([0.08 * np.delete(np.eye(24), 18, axis=0), 0.08 * (np.arange(24) != 18)[None]])
    yield uneven("phones-uneven-each", "Every patch by itself: a mode each, and one of the white's own.", ["D55"],
                 [each.tolist()], 0.0, rmse=0.08, **phone)  # fmt: skip
    yield uneven("error-gain-modes", "Gain modes of 23 patches for 24.", ["D55"],
                 [np.zeros((1, 23)).tolist()], 0.0, expect="invalid_argument")  # fmt: skip
    yield uneven("error-gain-own", "A negative share of its own.", ["D55"], _gain_modes(1), -0.1,
                 expect="invalid_argument")  # fmt: skip


def _gaussian() -> Iterator[Case]:
    plain: Json = {"basis": "gaussian", "chart_tolerance": 0.0, "white_tolerance": 0.0}
    unit = {"standard_error": {"constant": 1.0, "shape": None}}
    wide: list[tuple[str, str, list[str], Any, float, float, bool, str]] = [
        ("paper", "Nikon D5100", ["D55"], TWELVE, 1e-5, 0.08, True, "the paper's Eq. (10), x ≥ 0, 12 patches"),
        ("paper-signed", "Nikon D5100", ["D55"], TWELVE, 1e-4, 0.10, False, "the paper's literal Eq. (10)"),
        ("nine", "Canon EOS R5", ["LED-B3"], NINE, 1e-5, 0.12, True, "9 patches"),
        ("eighteen", "Fujifilm X-T3", ["A"], EIGHTEEN, 1e-4, 0.10, True, "18 patches"),
        ("twenty-four", "Sony ILCE-7M3", ["FL2"], ALL, 1e-4, 0.15, True, "24 patches"),
        ("mixtures", "Panasonic DC-GX9", ["D55"], 96, 1e-3, 0.10, True, "96 mixtures"),
        ("gamma-large", "Hasselblad L1D-20c", ["A"], ALL, 1e-2, 0.28, True, "a large γ"),
    ]
    for name, camera, lamps, patches, gamma, bound, nonnegative, what in wide:
        n = patches if isinstance(patches, int) else len(patches)
        ones = {"standard_error": unit["standard_error"] | {"shape": [1, n, 3]}}
        yield scene(
            f"gaussian-{name}", f"Σ = I: {what}; {camera} under {lamps[0]}.", camera={"camera": camera}, lamps=lamps,
            patches=patches, gamma=gamma, nonnegative=nonnegative, rmse=bound, change=ones, **plain,
        )  # fmt: skip
    yield scene(
        "gaussian-measured-errors", "Σ from the measured standard errors and a chart tolerance of 1 %.",
        basis="gaussian", gamma=1.0, noise="usual", chart_tolerance=0.01,
    )  # fmt: skip
    yield scene(
        "gaussian-tiny-gamma", "γ = 1 with measured errors, about 1e-5 of what leaves nothing.",
        gamma=1.0, noise="usual", **plain,
    )  # fmt: skip
    yield scene("gaussian-ridge", "λ₂ = 1 and γ = 0.05, measured errors.", l2=1.0, gamma=0.05, **plain)
    yield scene(
        "gaussian-ridge-signed", "λ₂ = 0.01, γ = 0, signed: the closed form.", l2=0.01, gamma=0.0, nonnegative=False,
        **plain,
    )  # fmt: skip
    yield scene("gaussian-ridge-nonnegative", "λ₂ = 0.01, γ = 0, x ≥ 0.", l2=0.01, gamma=0.0, patches=TWELVE, **plain)
    yield scene(
        "gaussian-identical-patches", "Twelve times the same patch: rank one.",
        patches=[15] * 12, gamma=0.1, **plain,
    )  # fmt: skip
    yield scene(
        "gaussian-two-patches", "Six times one patch, six times another, and no prior: rank two.",
        patches=[19] * 6 + [15] * 6, gamma=0.1, **plain,
    )  # fmt: skip
    yield scene(
        "gaussian-three-patches", "Three patches, 18 atoms: the layers' support has more atoms than there are rows, "
        "the walk from it keeps few digits, and only a second one, from where it ended, is proven.",
        patches=[8, 11, 16], gamma=85.0, noise="none", **plain,
    )  # fmt: skip
    yield scene(
        "gaussian-equal-energy", "The paper's assumption of a flat lamp, true here.", lamps=["equal-energy"],
        patches=TWELVE, gamma=1e-5, noise="none", change={"standard_error": {"constant": 1.0, "shape": [1, 12, 3]}},
        rmse=0.08, **plain,
    )  # fmt: skip


def _errors() -> Iterator[Case]:
    yield scene(
        "error-zero-code-gaussian", "γ = 1e6 leaves nothing of the paper's curves.", basis="gaussian", gamma=1e6,
        expect="not_converged",
    )  # fmt: skip
    yield scene(
        "error-wide-gaussian", "A wider prior of a basis that has none.", basis="gaussian",
        change={"prior_scale": 2.0}, expect="invalid_argument",
    )  # fmt: skip
    for name, scale in (("zero", 0.0), ("nan", "NaN")):
        yield scene(
            f"error-{name}-prior-scale", "A prior's width that is no positive number.", patches=TWELVE,
            change={"prior_scale": scale}, expect="invalid_argument",
        )  # fmt: skip
    one = photograph(NIKON, ["D55"], {"chart": "babelcolor", "patches": ALL})
    yield scene(
        "error-zero-signal-gaussian", "Chart equal to dark: no curve explains a black chart.", basis="gaussian",
        change={"chart": one["dark"]}, expect="not_converged",
    )  # fmt: skip
    wrong: list[tuple[str, str, str, Json]] = [
        ("two-shots-gaussian", "The paper's rows take one shot.", "invalid_argument",
         {"basis": "gaussian", "lamps": ["D55", "A"]}),
        ("no-penalty", "γ = 0 and λ₂ = 0 leave no unique answer.", "invalid_argument", {"l2": 0.0, "gamma": 0.0}),
        ("negative-gamma", "γ < 0.", "invalid_argument", {"gamma": -0.1}),
        ("negative-l2", "λ₂ < 0.", "invalid_argument", {"l2": -1.0}),
        ("nan-gamma", "γ is not a number.", "invalid_argument", {"change": {"gamma": "NaN"}}),
        ("negative-tolerance", "A chart tolerance below zero.", "invalid_argument", {"chart_tolerance": -0.03}),
        ("negative-standard-error", "A standard error below zero.", "invalid_argument",
         {"change": {"standard_error": {"constant": -0.01, "shape": [1, 24, 3]}}}),
        ("reflectance-missing", "23 reflectances for 24 patches.", "invalid_argument",
         {"change": {"reflectance": {"chart": "babelcolor", "patches": ALL[:-1]}}}),
        ("lamp-dark", "A lamp without power on the grid.", "lamp_unfit",
         {"change": {"lamp": {"constant": 0.0, "shape": [1, 681]}}}),
        ("lamp-negative", "A lamp with negative power.", "lamp_unfit",
         {"change": {"lamp": {"constant": -1.0, "shape": [1, 681]}}}),
        ("lamps-too-many", "Two lamps for one shot.", "invalid_argument",
         {"change": {"lamp": {"lamps": ["D55", "A"]}}}),
        ("modes-of-another-shot", "Modes for two shots, one given.", "invalid_argument",
         {"modes": [[[0.0, 0.1]], [[0.0, 0.1]]]}),
        ("white-black", "A white reference that reflects nothing.", "invalid_argument",
         {"change": {"white_reflectance": {"constant": 0.0, "shape": [681]}}}),
    ]  # fmt: skip
    for name, comment, code, more in wrong:
        yield scene(f"error-{name}", comment, expect=code, **more)
    chart = one["chart"].tolist()
    chart[0][3][1] = "NaN"
    yield scene("error-nan-signal", "A chart mean that is not a number.", change={"chart": chart},
                expect="invalid_argument")  # fmt: skip
    two = photograph(NIKON, ["D55", "A"], {"chart": "babelcolor", "patches": ALL})
    ragged = {name: [two[name][0].tolist(), two[name][1, :-1].tolist()] for name in ("chart", "white", "dark")}
    yield scene("error-unequal-shots", "24 patches in the first shot, 23 in the second.", lamps=["D55", "A"],
                change=ragged, expect="invalid_argument")  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    yield from _cameras()
    yield from _phones()
    yield from _uneven()
    yield from _gaussian()
    yield from _errors()


def run(call: Call) -> dict[str, Any]:
    """The stage `ssf`: by the model alone; the reference and error cases by `recover`, which checks its arguments."""
    given, engine, sound = call.given, call.engine, call.case["expect"] == "success"
    frames = [given[name] for name in ("chart", "white", "dark")]
    with np.errstate(divide="ignore", invalid="ignore"):
        signals = [(np.array(c, float) - d) / (np.array(w, float) - d) for c, w, d in zip(*frames, strict=True)]
    if engine == "onnx" and sound:
        model = load_model(given["basis"])
        found: dict[str, Any] = model.run(model_inputs(model, given))
    else:
        observation = build_observation(given, signals, tuple(frames) if sound else None)
        ssf = recover(
            observation,
            basis=given["basis"],
            settings=SolverSettings(
                l2=given["l2"], gamma=given["gamma"], nonnegative=given["nonnegative"], engine=engine
            ),
            prior_scale=prior_scale(given),
        )
        budget = std = None
        if ssf.std is not None:
            std = predict(ssf, observation).std
            shares = explain(observation, basis=ssf.basis, prior_scale=ssf.prior_scale)
            budget = np.array(list(shares.values()))
        found = {
            "predicted_std": std,
            "budget": budget,
            "ssf": ssf.values,
            "ssf_std": ssf.std,
            "signals": np.stack(signals),
            "evidence": ssf.log_evidence,
            "code": ssf.code,
            "code_covariance": ssf.code_covariance,
            "predicted": ssf.predicted,
            "channel_gain": ssf.channel_gain,
        } | vars(ssf.proof)
    return found | {"objective": objective_of(given, build_rows(given, np.stack(signals)), found["code"])}


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
    keys=Keys(
        CALL,
        words(
            "signals code gap layers_gap finish_steps evidence ssf ssf_std code_covariance predicted channel_gain "
            "predicted_std budget"
        ),
        words("prior_scale gain_modes gain_own"),
    ),
    requires=always("model"),
    cases=cases,
    run=run,
    limits=limits,
    problem=problem_of_call,
    oracle=True,
)
