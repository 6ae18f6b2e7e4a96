"""The stage `calibrate`: from patch statistics to curves, scores and verdict, as the product does it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np

from camssf.calibration import solve as calibrate_capture
from golden.contract import LARGEST_GAP, Call, Stage, case, words
from golden.forms import Json
from golden.products import CAPTURE, build_capture
from golden.scenes import ALL, BELLS, CANON, NIKON, PHONE, clip, dimmed, evenly, faulty, frames, uneven_light

Row: TypeAlias = tuple[str, str, list[Json], Sequence[str], Json]
"""Name, comment, shots, their lamps, and what is unlike the base case: inputs, `truth` and `rmse`, `expect`."""
DAYLIGHT, BOTH, THREE = ["D55"], ["D55", "A"], ["D55", "A", "LED-B3"]


def capture(shots: list[Json], lamps: Sequence[str], **change: Any) -> Json:
    """The inputs of a capture with the product's defaults; the stages `light` and `rivals` have the same."""
    return {
        "shots": shots,
        "reflectance": {"chart": "babelcolor", "patches": ALL},
        "chart_tolerance": 0.03,
        "white": 18,
        "lamp": {"lamps": list(lamps)},
        "lamp_tolerance": {"constant": 0.02, "shape": [len(lamps)]},
        "lamp_modes": {"polynomials": [[] for _ in lamps]},
        "white_reflectance": None,
        "basis": "cameras",
        "l2": None,
        "gamma": None,
        "nonnegative": None,
    } | change


def near(camera: Json, rmse: float) -> Json:
    """The true camera, and the bound on the curves' error."""
    return {"truth": camera, "rmse": rmse}


def rows() -> list[Row]:
    """All cases but those of captures without signals."""
    (shot,), (first, second), framed = frames(), frames(NIKON, BOTH), frames(PHONE, BOTH)
    card = evenly()[0] | {"white": None}
    one, two = evenly(PHONE), evenly(PHONE, BOTH)
    lit, shadow = dimmed(one, uneven_light()), dimmed(one, np.where(np.arange(24) % 6 > 2, 0.7, 1.0))
    each_own = [*dimmed(two[:1], uneven_light()), *dimmed(two[1:], uneven_light(0.5))]
    random = 1.0 + 0.08 * np.sin(37.0 * np.arange(24.0) ** 2)
    by_patch = dimmed(one, np.round(random / random[18], 6))
    white = slice(18, 19)
    auto, phones, paper = {"basis": "auto"}, {"basis": "phones"}, {"basis": "gaussian", "gamma": 1.0}
    families = {"lamp_modes": {"modes": ["daylight", "white-led"]}, "lamp_tolerance": [0.02, 0.17]}
    four = ["D55", "A", "LED-B3", "LED-B3"]
    return [
        ("one-shot", "Chart, white, dark under D55 with the product's defaults.",
         [shot], DAYLIGHT, near(NIKON, 0.05)),
        ("two-shots", "D55 and a bulb.", frames(CANON, BOTH), BOTH, near(CANON, 0.05)),
        ("three-shots", "D55, a bulb and a white LED.", frames(BELLS, THREE), THREE, near(BELLS, 0.08)),
        ("no-white", "The chart's white patch stands in: ρ_w is its table, its row drops out.",
         [card], DAYLIGHT, near(NIKON, 0.06)),
        ("uneven", "No white frame, and light that falls off by a quarter: solved for with the curves.",
         lit, DAYLIGHT, phones | near(PHONE, 0.06)),
        ("uneven-two-shots", "The same of two shots, each with a light of its own.",
         each_own, BOTH, phones | near(PHONE, 0.06)),
        ("uneven-shadow", "Half of the chart in a shadow: more than a bowl of light can be.",
         shadow, DAYLIGHT, phones | near(PHONE, 0.12)),
        ("one-by-one", "Each patch photographed by itself: the light differs by 8 %.",
         by_patch, DAYLIGHT, phones | {"light_per_patch": 0.08} | near(PHONE, 0.09)),
        ("one-by-one-framed", "The same with a white frame: a mode a patch.",
         [shot], DAYLIGHT, {"light_per_patch": 0.08} | near(NIKON, 0.09)),
        ("error-one-by-one", "Light cannot differ by nothing.",
         [card], DAYLIGHT, {"light_per_patch": 0.0, "expect": "invalid_argument"}),
        ("no-dark", "The black level stands in for the dark frame.",
         [shot | {"dark": None}], DAYLIGHT, near(NIKON, 0.05)),
        ("grey-card", "The white frame shows a card of 90 %.",
         frames(white=np.full(681, 0.9)), DAYLIGHT, {"white_reflectance": 0.9} | near(NIKON, 0.05)),
        ("clipped-in-one", "Three patches clipped in the second shot serve in the first alone.",
         [first, clip(second, "chart", slice(18, 21))], BOTH, near(NIKON, 0.05)),
        ("clipped-in-both", "A patch that no shot can use is left out of the fit, and predicted.",
         [clip(first, "chart", white), clip(second, "chart", white)], BOTH, near(NIKON, 0.05)),
        ("modes", "A lamp of uncertain temperature: one mode.",
         [shot], DAYLIGHT, {"lamp_modes": {"polynomials": [[[0.0, 0.1]]]}} | near(NIKON, 0.08)),
        ("families", "Two lamps known by their kind alone: predicted under the estimated lamps.",
         frames(NIKON, ["D55", "LED-B3"]), ["daylight", "white-led"], families | near(NIKON, 0.08)),
        ("paper", "The paper's basis with a given γ; no band.", [shot], DAYLIGHT, paper | near(NIKON, 0.15)),
        ("auto-camera", "No basis told: the signals choose, and folds and rivals stand on that.",
         [first, second], BOTH, auto | near(NIKON, 0.05)),
        ("auto-phone", "The same of a phone, whose file says so.",
         framed, BOTH, auto | {"make": "Apple"} | near(PHONE, 0.06)),
        ("auto-other-maker", "A phone's curves in a file that names a maker of cameras: camera_unusual.",
         frames(PHONE, BOTH, noise="none"), BOTH,
         auto | {"lamp_tolerance": [0.0, 0.0], "make": "NIKON CORPORATION"}),
        ("error-lamp-dark", "A lamp without power on the grid.",
         [shot], DAYLIGHT, {"lamp": {"constant": 0.0, "shape": [1, 681]}, "expect": "lamp_unfit"}),
        ("error-two-shots-paper", "The paper's rows take one shot.",
         [first, second], BOTH, paper | {"expect": "invalid_argument"}),
        ("error-nothing-left", "γ = 1e9 on the paper's basis: no curve.",
         [shot], DAYLIGHT, paper | {"gamma": 1e9, "expect": "not_converged"}),
        ("error-rival-of-four", "Of four shots one lamp is named wrongly: another lamp refuses it.",
         frames(NIKON, four), [*THREE, "D55"], {"expect": "lamp_unfit"}),
        ("five-shots", "The same of five: rivals are not tried, the shots contradict each other.",
         frames(NIKON, [*four, "D55"]), [*THREE, "D55", "D55"], {}),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    faults = [(f"error-{name}", text, shots, DAYLIGHT, {"expect": code}) for name, text, code, shots in faulty()]
    for name, comment, shots, lamps, change in [*rows(), *faults]:
        about = {key: change.pop(key) for key in ("truth", "rmse", "expect") if key in change}
        yield case(f"calibrate/{name}", comment, capture(shots, lamps, **change), **about)


def run(call: Call) -> dict[str, Any]:
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


STAGE = Stage(
    name="calibrate",
    requires="signals model",
    cases=cases,
    run=run,
    inputs=CAPTURE,
    optional=words("make model light_per_patch"),
    limits=(
        ("norm", 1e-15, "signals"),
        ("exact", 0.0, "used"),
        ("norm", 1e-10, "ssf ssf_std predicted"),
        ("norm", 1e-14, "channel_gain"),
        ("norm", 1e-8, "rmsre_percent"),
        ("exact", 0.0, "codes"),
        ("at_most", LARGEST_GAP, "gap"),
    ),
)
