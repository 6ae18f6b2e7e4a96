"""The stages `calibrate`, `light` and `rivals`: what the product does with the patch statistics of a capture."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.calibration import solve as calibrate_capture
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import cross_validate, prediction_bands, recover_each_shot, recover_fit, score
from camssf.spectra.bundled import observer
from camssf.verdict.assumptions import assume
from camssf.verdict.rival_lamps import weigh, weigh_rivals
from golden.contract import LARGEST_GAP, Call, Row, Stage, words
from golden.forms import NIKON, Json, lamp
from golden.products import CAPTURE, build_capture, chosen, judgement
from golden.scenes import ALL, BOTH, CANON, GAINS, PHONE, clip, dimmed, evenly, frames, uneven_light

TAKEN: Json = {"camera": NIKON, "lamps": ["D55"], "noise": "low", "taken": "babelcolor", "fading": 0.0}
"""The photos of the base case, unless a row gives `shots`; `named`: lamps' names, if others than the true ones."""
PHONES: Json = {"basis": "phones", "camera": PHONE}
PAPER: Json = {"basis": "gaussian", "gamma": 1.0}
FOUR = [*BOTH, "LED-B3", "LED-B3"]
OTHER_TABLE: Json = {"table": "BabelColor Average", "taken": "ohta"}
LED, WRONG = {"lamps": ["LED-B3"]}, {"expect": "invalid_argument"}


def capture(change: Json) -> Json:
    """The inputs of a stage: a shot under each lamp, and the product's defaults, but for the change."""
    taken = TAKEN | {key: change[key] for key in TAKEN.keys() & change.keys()}
    named: list[str] = change["named"] if "named" in change else taken["lamps"]
    lights = change.get("lights") or [""] * len(named)
    lamps = ["equal-energy" if light == "auto" else lamp for light, lamp in zip(lights, named, strict=True)]
    inputs: Json = {
        "shots": change.get("shots") or frames(**taken),
        "reflectance": {"chart": "babelcolor", "patches": ALL},
        "chart_tolerance": 0.03,
        "white": 18,
        "lamp": {"lamps": lamps},
        "lamp_tolerance": {"constant": 0.02, "shape": [len(lamps)]},
        "lamp_modes": {"polynomials": [[] for _ in lamps]},
        "basis": "cameras",
        **dict.fromkeys(("white_reflectance", "l2", "gamma", "nonnegative")),
    }
    return inputs | {key: value for key, value in change.items() if key not in (*TAKEN, "named")}


def calibrate_rows() -> list[Row]:
    """From patch statistics to curves, scores and verdict."""
    first, second = frames(NIKON, BOTH)
    one, two = evenly(PHONE), evenly(PHONE, BOTH)
    each_own = [*dimmed(two[:1], uneven_light()), *dimmed(two[1:], uneven_light(0.5))]
    random = 1.0 + 0.08 * np.sin(37.0 * np.arange(24.0) ** 2)
    by_patch, white = dimmed(one, np.round(random / random[18], 6)), slice(18, 19)
    card = [evenly()[0] | {"white": None}]
    families = {"lamp_modes": {"modes": ["daylight", "white-led"]}, "lamp_tolerance": [0.02, 0.17]}
    return [
        ("one-shot", "Chart, white, dark under D55 with the product's defaults.", {"rmse": 0.05}),
        ("two-shots", "D55 and a bulb.", {"camera": CANON, "lamps": BOTH, "rmse": 0.05}),
        ("uneven", "No white frame, and light that falls off by a quarter: solved for with the curves.",
         PHONES | {"shots": dimmed(one, uneven_light()), "rmse": 0.06}),
        ("uneven-two-shots", "The same of two shots, each with a light of its own.",
         PHONES | {"shots": each_own, "lamps": BOTH, "rmse": 0.06}),
        ("one-by-one", "Each patch photographed by itself: the light differs by 8 %.",
         PHONES | {"shots": by_patch, "light_per_patch": 0.08, "rmse": 0.09}),
        ("error-one-by-one", "Light cannot differ by nothing.", WRONG | {"shots": card, "light_per_patch": 0.0}),
        ("grey-card", "The white frame shows a card of 90 %.",
         {"shots": frames(white=np.full(681, 0.9)), "white_reflectance": 0.9, "rmse": 0.05}),
        ("clipped-in-one", "Three patches clipped in the second shot serve in the first alone.",
         {"shots": [first, clip(second, "chart", slice(18, 21))], "lamps": BOTH, "rmse": 0.05}),
        ("clipped-in-both", "A patch that no shot can use is left out of the fit, and predicted.",
         {"shots": [clip(first, "chart", white), clip(second, "chart", white)], "lamps": BOTH, "rmse": 0.05}),
        ("families", "Two lamps known by their kind alone: predicted under the estimated lamps.",
         families | {"lamps": ["D55", "LED-B3"], "named": ["daylight", "white-led"], "rmse": 0.08}),
        ("paper", "The paper's basis with a given γ; no band.", PAPER | {"rmse": 0.15}),
        ("paper-noise", "γ by the noise; where even the smallest leaves more than that, the smallest.",
         PAPER | {"gamma": None, "rmse": 0.15}),
        ("auto-camera", "No basis told: the signals choose, and folds and rivals stand on that.",
         {"basis": "auto", "lamps": BOTH, "rmse": 0.05}),
        ("auto-other-maker", "A phone's curves in a file that names a maker of cameras: camera_unusual.",
         {"basis": "auto", "camera": PHONE, "lamps": BOTH, "noise": "none", "lamp_tolerance": [0.0, 0.0],
          "make": "NIKON CORPORATION"}),
        ("other-table", "The chart is of the other public table by 30 : 1; from 20 : 1 on that one is taken.",
         OTHER_TABLE | {"chart_tolerance": 0.046}),
        ("other-table-hardly", "By 15 : 1 alone, as patches may differ more: the default table stays.",
         OTHER_TABLE | {"chart_tolerance": 0.049}),
        ("error-rival-of-four", "Of four shots one lamp is named wrongly: another lamp refuses it.",
         {"lamps": FOUR, "named": [*FOUR[:3], "D55"], "expect": "lamp_unfit"}),
        ("five-shots", "The same of five: rivals are not tried, the shots contradict each other.",
         {"lamps": [*FOUR, "D55"], "named": [*FOUR[:3], "D55", "D55"]}),
    ]  # fmt: skip


def calibrate(call: Call) -> dict[str, Any]:
    """The stage `calibrate`: `camssf.calibration.solve` from patch statistics, as a phone does after measuring."""
    measured, options = build_capture(call.given, call.engine)
    done = calibrate_capture(measured, options=options)
    assert done.ssf is not None
    curves, std = done.ssf.peak()
    return {
        "signals": done.signals.values,
        "used": done.signals.used.tolist(),
        "ssf": curves,
        "ssf_std": None if std is None else std[::10],
        "predicted": done.ssf.predicted,
        "gap": done.ssf.proof.gap,
        "channel_gain": done.ssf.channel_gain,
        "rmsre_percent": done.scores.rmsre_percent,
        "codes": [reason.code for reason in done.verdict.reasons],
    }


def matrix(made_for: str, name: str, tint: float = 1.0) -> Json:
    """A colour matrix that takes the scene's raw white for that lamp's, with a factor on green."""
    xyz = lamp(name) @ observer("1931")
    diagonal = np.diag(np.array(GAINS) * [1.0, tint, 1.0] * xyz[1] / xyz)
    return {"light": made_for, "values": np.round(diagonal, 6).ravel().tolist()}


def light_rows() -> list[Row]:
    """Light that nobody named, which is given as equal energy; of a phone where no other camera is named."""
    base: Json = {"camera": PHONE, "noise": "usual", "basis": "auto", "make": "Apple", "lights": ["auto"]}
    two: Json = {"lamps": BOTH, "lights": ["auto"] * 2}
    pair = [[matrix("A", "LED-B3", 0.9), matrix("D65", "LED-B3", 1.1)]]
    fallen = dimmed(evenly(PHONE, ["LED-B3"], noise="usual"), uneven_light())
    table: list[Row] = [
        ("daylight", "Unnamed light, in truth D55.", {}),
        ("white-led", "Unnamed light, in truth a white LED: kinds are mixed.", LED),
        ("two", "Daylight and a bulb, neither named.", two),
        ("one-of-two", "Named daylight, an unnamed bulb: rivals for the first.", two | {"lights": ["", "auto"]}),
        ("faded", "A chart that lost a fifth of its colours, under unnamed daylight.", {"fading": 0.2}),
        ("called-right", "D55, named D55: the table and the kind are mixed.", {"lights": ["D55"]}),
        ("called-wrong", "D55, named D75: both are mixed, and the assumptions say so.", {"lights": ["D75"]}),
        ("called-kind", "A white LED named by kind: shapes are weighed.", LED | {"lights": ["white-led"]}),
        ("called-kelvin", "A bulb called by two temperatures: of 3,000 K one may be, of 4,000 K none.",
         {"lamps": ["A", "A"], "lights": ["3000K", "4000K"]}),
        ("told-of-two", "The numbers of one-of-two: a lamp named with its tolerance is taken as said.",
         two | {"lights": ["D55,2%", "auto"]}),
        ("told-basis", "The basis is told, a fluorescent lamp is not.", {"lamps": ["FL2"], "basis": "phones"}),
        ("camera", "A camera needs a named lamp: refused, with the probable lights.",
         {"camera": NIKON, "make": "NIKON CORPORATION"}),
        ("no-maker", "The file names no known maker: the signals decide.", {"make": "golden"}),
        ("uneven", "An unnamed white LED, no white frame, light falling off by a quarter.", LED | {"shots": fallen}),
        ("error-paper", "A basis without a prior weighs nothing.", PAPER | WRONG),
        ("three", "Daylight, a bulb and a white LED, none named: kinds are screened shot by shot.",
         {"lamps": FOUR[:3], "lights": ["auto"] * 3}),
        ("matrices", "A white LED, and a file whose two colour matrices give the chromaticity of its white.",
         LED | {"colour_matrices": pair}),
        ("matrices-daylight", "One matrix, in daylight.", {"colour_matrices": [[matrix("D65", "D55")]]}),
        ("matrices-bulb", "The same under a bulb.", {"lamps": ["A"], "colour_matrices": [[matrix("A", "A")]]}),
        ("wrong-matrices", "Colour matrices that give a white of no kind: the kinds stay as they are.",
         LED | {"colour_matrices": [[matrix("D65", "LED-B3", 3.0)]]}),
        ("torch", "The phone's torch, and named daylight.", {"lamps": ["LED-B3", "D55"], "lights": ["torch", ""]}),
        ("other-kind", "A bulb named D55, then unnamed daylight: the advice names the likely kind.",
         {"lamps": ["A", "D55"], "named": ["D55", "D55"], "lights": ["", "auto"]}),
        ("other-kind-unsure", "The same of a white LED, which may be a fluorescent lamp: the advice names none.",
         {"lamps": ["LED-B3", "D55"], "named": ["D55", "D55"], "lights": ["", "auto"]}),
        ("error-four", "Four unnamed lights are too many.",
         WRONG | {"lamps": [*FOUR[:3], "FL2"], "lights": ["auto"] * 4}),
    ]  # fmt: skip
    return [(name, comment, base | change) for name, comment, change in table]


def light(call: Call) -> dict[str, Any]:
    """The stage `light`: curves and light for unnamed lamps, and the verdict, even if it refuses."""
    measured, options = build_capture(call.given, call.engine)
    free_fit = prepare_fit(measured, options)
    ssf = recover_fit(free_fit, free_fit.signals.used, options.gamma)
    fit = free_fit.conditioned_on(ssf)
    verdict = weigh(free_fit, ssf, recover_each_shot(fit))
    scores = score(fit, ssf, cross_validate(fit, ssf, prediction_bands(fit, free_fit.signals.used, ssf)))
    lights = [light for light in ssf.lights if light is not None]
    test = ssf.family_test
    return chosen(ssf) | judgement(verdict) | {
        "length": None if test is None else np.array([test.length, test.longest]),
        "weighed": [[weight.basis, *weight.kinds] for weight in ssf.choice],
        "likeliest": list(ssf.kinds),
        "rmsre_percent": scores.rmsre_percent,
        "kinds": np.array([list(light.kinds.values()) for light in lights]),
        "power": np.stack([light.power[::10] for light in lights]),
        "power_std": np.stack([light.std[::10] for light in lights]),
        "kelvin": np.array([light.kelvin for light in lights]),
        "kelvin_std": np.array([light.kelvin_std for light in lights]),
        "said": [known.message for known in assume(measured, ssf, fit.level(ssf), None) if known.code == "lamp"],
    }  # fmt: skip


def rivals_rows() -> list[Row]:
    """By how much each other lamp would fit better: the gains that rule 4 of the verdict uses."""
    bulb = {"camera": PHONE, "lamps": ["A"], "named": ["D55"], "basis": "auto"}
    return [
        ("right", "D55 under its own name: no lamp gains much.", {}),
        ("wrong", "D55 named A: daylight gains most.", {"named": ["A"]}),
        ("phone", "On the basis of phones, two shots, the second named wrongly.",
         PHONES | {"lamps": ["D55", "LED-B3"], "named": BOTH}),
        ("auto", "A phone's bulb named daylight: possible for a camera, but not for a phone.",
         bulb | {"make": "samsung", "model": "SM-G991B"}),
        ("auto-no-maker", "The same of a file that does not say who made it.", bulb),
        ("no-white", "A wrong lamp without a white frame: gain modes stand beside every lamp.",
         {"shots": [evenly()[0] | {"white": None}], "named": ["A"]}),
        ("kind", "Told by its kind alone: a rival has no modes.",
         {"named": ["daylight"], "lamp_modes": {"modes": ["daylight"]}}),
    ]  # fmt: skip


def rivals(call: Call) -> dict[str, Any]:
    """The stage `rivals`: `camssf.verdict.rival_lamps.weigh_rivals`, the gain of every lamp for each shot."""
    measured, options = build_capture(call.given, "reference")
    fit = prepare_fit(measured, options)
    weighed = weigh_rivals(fit, recover_fit(fit, fit.signals.used, options.gamma))
    return {"gains": np.array([rival.gain for rival in weighed]).reshape(len(measured.shots), -1)}


STAGES = (
    Stage(
        name="calibrate",
        requires="signals model",
        rows=calibrate_rows,
        inputs_of=capture,
        run=calibrate,
        inputs=CAPTURE,
        optional=words("make model light_per_patch table"),
        limits=(
            ("norm", 1e-15, "signals"),
            ("exact", 0.0, "used codes"),
            ("norm", 1e-10, "ssf ssf_std predicted"),
            ("norm", 1e-14, "channel_gain"),
            ("norm", 1e-8, "rmsre_percent"),
            ("at_most", LARGEST_GAP, "gap"),
        ),
    ),
    Stage(
        name="light",
        requires="signals model",
        rows=light_rows,
        inputs_of=capture,
        run=light,
        inputs=CAPTURE | words("lights"),
        optional=words("make model colour_matrices"),
        rounded=words("ssf ssf_std power power_std predicted"),
        limits=(
            ("exact", 0.0, "weighed basis prior_scale likeliest status codes messages advice said"),
            ("relative", 1e-10, "log_evidence"),
            ("norm", 1e-8, "probability length chart_fading rmsre_percent kinds"),
            ("norm", 1e-9, "ssf ssf_std predicted power power_std"),
            ("relative", 1e-9, "kelvin kelvin_std"),
            ("relative", 1e-8, "values thresholds"),
            ("at_most", LARGEST_GAP, "gap"),
        ),
    ),
    Stage(
        name="rivals",
        requires="signals model",
        rows=rivals_rows,
        inputs_of=capture,
        run=rivals,
        inputs=CAPTURE,
        optional=words("make model"),
        limits=(("norm", 1e-8, "gains"),),
    ),
)
