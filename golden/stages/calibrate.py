"""The stage `calibrate`: from patch statistics to curves, scores and verdict, as the product does it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from camssf.calibration import solve as calibrate_capture
from golden.contract import LARGEST_GAP, Call, Keys, Stage, against_truth, always, case, each, limit, stored, words
from golden.forms import Json, resolve
from golden.products import CAPTURE, build_capture
from golden.scenes import ALL, BELLS, CANON, NIKON, PHONE, Case, clip, dimmed, faulty, frames, uneven_light


def cases() -> Iterator[Json]:
    """All cases."""

    def calibrate(name: str, comment: str, shots: list[Json], lamps: Sequence[str] = ("D55",), **more: Any) -> Case:
        known = {"truth", "rmse", "expect"}
        inputs = {
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
        } | {key: value for key, value in more.items() if key not in known}
        return case(f"calibrate/{name}", comment, inputs, **{k: v for k, v in more.items() if k in known})

    (shot,) = frames()
    white = resolve({"chart": "babelcolor", "patches": [19]})[0]
    card = frames(white=white, shade=0.0)[0] | {"white": None}
    yield calibrate("one-shot", "Chart, white, dark under D55 with the product's defaults.", [shot], truth=NIKON,
                    rmse=0.05)  # fmt: skip
    yield calibrate("two-shots", "D55 and a bulb.", frames(CANON, ["D55", "A"]), ["D55", "A"], truth=CANON,
                    rmse=0.05)  # fmt: skip
    yield calibrate("three-shots", "D55, a bulb and a white LED.", frames(BELLS, ["D55", "A", "LED-B3"]),
                    ["D55", "A", "LED-B3"], truth=BELLS, rmse=0.08)  # fmt: skip
    yield calibrate("no-white", "The chart's white patch stands in: ρ_w is its table, its row drops out.", [card],
                    truth=NIKON, rmse=0.06)  # fmt: skip

    one, two = (frames(PHONE, lamps, white=white, shade=0.0) for lamps in (["D55"], ["D55", "A"]))
    yield calibrate("uneven", "No white frame, and light that falls off by a quarter: solved for with the curves.",
                    dimmed(one, uneven_light()), basis="phones", truth=PHONE, rmse=0.06)  # fmt: skip
    yield calibrate("uneven-two-shots", "The same of two shots, each with a light of its own.",
                    [*dimmed(two[:1], uneven_light()), *dimmed(two[1:], uneven_light(0.5))], ["D55", "A"],
                    basis="phones", truth=PHONE, rmse=0.06)  # fmt: skip
    yield calibrate("uneven-shadow", "Half of the chart in a shadow: more than a bowl of light can be.",
                    dimmed(one, np.where(np.arange(24) % 6 > 2, 0.7, 1.0)), basis="phones", truth=PHONE,
                    rmse=0.12)  # fmt: skip
    random = 1.0 + 0.08 * np.sin(37.0 * np.arange(24.0) ** 2)
    yield calibrate("one-by-one", "Each patch photographed for itself: the light differs by 8 %.",
                    dimmed(one, np.round(random / random[18], 6)), basis="phones", light_per_patch=0.08, truth=PHONE,
                    rmse=0.09)  # fmt: skip
    yield calibrate("one-by-one-framed", "The same with a white frame: a mode a patch.", [shot], light_per_patch=0.08,
                    truth=NIKON, rmse=0.09)  # fmt: skip
    yield calibrate("error-one-by-one", "Light cannot differ by nothing.", [card], light_per_patch=0.0,
                    expect="invalid_argument")  # fmt: skip
    yield calibrate("no-dark", "The black level stands in for the dark frame.", [shot | {"dark": None}], truth=NIKON,
                    rmse=0.05)  # fmt: skip
    yield calibrate("grey-card", "The white frame shows a card of 90 %.",
                    frames(white=np.full(681, 0.9)), white_reflectance=0.9, truth=NIKON, rmse=0.05)  # fmt: skip
    first, second = frames(NIKON, ["D55", "A"])
    yield calibrate("clipped-in-one", "Three patches clipped in the second shot serve in the first alone.",
                    [first, clip(second, "chart", slice(18, 21))], ["D55", "A"], truth=NIKON, rmse=0.05)  # fmt: skip
    yield calibrate("clipped-in-both", "A patch that no shot can use is left out of the fit, and predicted.",
                    [clip(first, "chart", slice(18, 19)), clip(second, "chart", slice(18, 19))], ["D55", "A"],
                    truth=NIKON, rmse=0.05)  # fmt: skip
    yield calibrate("modes", "A lamp of uncertain temperature: one mode.", [shot],
                    lamp_modes={"polynomials": [[[0.0, 0.1]]]}, truth=NIKON, rmse=0.08)  # fmt: skip
    yield calibrate("families", "Two lamps known by their kind alone: predicted under the lamps as found.",
                    frames(NIKON, ["D55", "LED-B3"]), ["daylight", "white-led"],
                    lamp_modes={"modes": ["daylight", "white-led"]}, lamp_tolerance=[0.02, 0.17],
                    truth=NIKON, rmse=0.08)  # fmt: skip
    yield calibrate("paper", "The paper's basis with a given γ; no band.", [shot], basis="gaussian", gamma=1.0,
                    truth=NIKON, rmse=0.15)  # fmt: skip
    yield calibrate("auto-camera", "No basis told: the signals choose, and folds and rivals stand on that.",
                    frames(NIKON, ["D55", "A"]), ["D55", "A"], basis="auto", truth=NIKON, rmse=0.05)  # fmt: skip
    yield calibrate("auto-phone", "The same of a phone, whose file says so.", frames(PHONE, ["D55", "A"]),
                    ["D55", "A"], basis="auto", make="Apple", truth=PHONE, rmse=0.06)  # fmt: skip
    yield calibrate("auto-other-maker", "A phone's curves in a file that names a maker of cameras: camera_unusual.",
                    frames(PHONE, ["D55", "A"], noise="none"), ["D55", "A"], basis="auto", lamp_tolerance=[0.0, 0.0],
                    make="NIKON CORPORATION")  # fmt: skip
    for name, comment, code, shots, _ in faulty():
        yield calibrate(f"error-{name}", comment, shots, expect=code)
    yield calibrate("error-lamp-dark", "A lamp without power on the grid.", [shot],
                    lamp={"constant": 0.0, "shape": [1, 681]}, expect="lamp_unfit")  # fmt: skip
    yield calibrate("error-two-shots-paper", "The paper's rows take one shot.", frames(NIKON, ["D55", "A"]),
                    ["D55", "A"], basis="gaussian", gamma=1.0, expect="invalid_argument")  # fmt: skip
    true, named = ["D55", "A", "LED-B3", "LED-B3", "D55"], ["D55", "A", "LED-B3", "D55", "D55"]
    yield calibrate("error-rival-of-four", "Of four shots one lamp is named wrongly: another lamp refuses it.",
                    frames(NIKON, true[:4]), named[:4], expect="lamp_unfit")  # fmt: skip
    yield calibrate("five-shots", "The same of five: rivals are not tried, the shots contradict each other.",
                    frames(NIKON, true), named)  # fmt: skip
    yield calibrate("error-nothing-left", "γ = 1e9 on the paper's basis: no curve.", [shot], basis="gaussian",
                    gamma=1e9, expect="not_converged")  # fmt: skip


def run(call: Call) -> dict[str, Any]:
    """The stage `calibrate`: `camssf.calibration.solve` from patch statistics, as a phone does after measuring."""
    given, engine = call.given, call.engine
    capture, options = build_capture(given, engine)
    done = calibrate_capture(capture, options=options)
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


LIMITS = (
    *each("norm", 1e-15, "signals"),
    *each("exact", 0.0, "used"),
    *each("norm", 1e-10, "ssf ssf_std predicted"),
    *each("norm", 1e-14, "channel_gain"),
    *each("norm", 1e-8, "rmsre_percent"),
    *each("exact", 0.0, "codes"),
)


def limits(made: Json, scene: Json) -> list[Json]:
    """Against the stored outputs, and the true camera."""
    return [*stored(made, LIMITS), limit("gap", "outputs", "at_most", LARGEST_GAP), *against_truth(made, scene)]


STAGE = Stage(
    name="calibrate",
    keys=Keys(
        CAPTURE,
        words("signals used gap ssf ssf_std predicted channel_gain rmsre_percent codes"),
        words("make model light_per_patch"),
    ),
    requires=always("signals", "model"),
    cases=cases,
    run=run,
    limits=limits,
)
