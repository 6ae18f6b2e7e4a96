"""The stage `light`: curves and light where nobody named the lamp, and the verdict."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import cross_validate, prediction_bands, recover_each_shot, recover_fit, score
from camssf.verdict.assumptions import assume
from camssf.verdict.rival_lamps import weigh
from golden.contract import LARGEST_GAP, Call, Stage, case, words
from golden.forms import Json
from golden.products import CAPTURE, build_capture, chosen, judgement
from golden.scenes import NIKON, PHONE, dimmed, evenly, frames, moved, uneven_light
from golden.stages.calibrate import capture

Row: TypeAlias = tuple[str, str, list[str], list[int], Json]
"""Name, comment, true lamps, the shots whose light is unnamed (from 1), and what is unlike the base case: inputs, and
`camera`, `fading`, `expect`."""


def matrix(made_for: str, tint: float) -> Json:
    """A colour matrix that takes the scene's equal raw white for a light of about 5,000 K."""
    return {"light": made_for, "values": [1.0 / 0.96, 0.0, 0.0, 0.0, tint, 0.0, 0.0, 0.0, 1.0 / 0.82]}


def rows() -> list[Row]:
    """All cases, of a phone where no other camera is named."""
    pair, apart = [[matrix("A", 0.9), matrix("D65", 1.1)]], [[matrix("D65", 3.0)]]
    fallen = dimmed(evenly(PHONE, ["LED-B3"], noise="usual"), uneven_light())
    return [
        ("daylight", "Unnamed light, in truth D55.", ["D55"], [1], {}),
        ("white-led", "Unnamed light, in truth a white LED: kinds are mixed.", ["LED-B3"], [1], {}),
        ("two", "Daylight and a bulb, neither named.", ["D55", "A"], [1, 2], {}),
        ("one-of-two", "Named daylight and an unnamed bulb: only the first is compared with other lamps.",
         ["D55", "A"], [2], {}),
        ("faded", "A chart that lost a fifth of its colours, under unnamed daylight.", ["D55"], [1], {"fading": 0.2}),
        ("moved", "A phone moved by 12 nm, under an unnamed bulb: two widths are mixed.",
         ["A"], [1], {"camera": moved(12.0)}),
        ("called-right", "D55, named D55: the table and the kind are mixed.", ["D55"], [], {"called": ["D55"]}),
        ("called-wrong", "D55, named D75: the kind is taken, and the assumptions say so.",
         ["D55"], [], {"called": ["D75"]}),
        ("called-kind", "A white LED named by its kind: its shapes are weighed.",
         ["LED-B3"], [], {"called": ["white-led"]}),
        ("called-two", "Daylight and a LED by their names, the LED's wrong.",
         ["D55", "LED-B3"], [], {"called": ["D55", "LED-B1"]}),
        ("told-of-two", "The numbers of one-of-two: a lamp named with its tolerance is taken as said.",
         ["D55", "A"], [2], {"called": ["D55,2%", ""]}),
        ("told-basis", "The basis is told, a fluorescent lamp is not.", ["FL2"], [1], {"basis": "phones"}),
        ("camera", "A camera needs a named lamp: refused, with the probable lights.",
         ["D55"], [1], {"camera": NIKON, "make": "NIKON CORPORATION"}),
        ("no-maker", "The file names no known maker: the signals decide.", ["D55"], [1], {"make": "golden"}),
        ("uneven", "An unnamed white LED, no white frame, and light that falls off by a quarter.",
         ["LED-B3"], [1], {"shots": fallen}),
        ("error-paper", "A basis without a prior weighs nothing.",
         ["D55"], [1], {"basis": "gaussian", "gamma": 1.0, "expect": "invalid_argument"}),
        ("three", "Daylight, a bulb and a white LED, none named: kinds are screened shot by shot.",
         ["D55", "A", "LED-B3"], [1, 2, 3], {}),
        ("matrices", "A white LED, and a file whose two colour matrices give the chromaticity of its white.",
         ["LED-B3"], [1], {"colour_matrices": pair}),
        ("wrong-matrices", "Colour matrices that give a white of no kind: the kinds stay as they are.",
         ["LED-B3"], [1], {"colour_matrices": apart}),
        ("torch", "The phone's torch, a white LED, beside named daylight.", ["LED-B3", "D55"], [], {"torch": [1]}),
        ("error-four", "Four unnamed lights are too many.",
         ["D55", "A", "LED-B3", "FL2"], [1, 2, 3, 4], {"expect": "invalid_argument"}),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases; the lamp of a shot whose light is unnamed says nothing."""
    for name, comment, lamps, unnamed, change in rows():
        camera, fading = change.pop("camera", PHONE), change.pop("fading", 0.0)
        expect = change.pop("expect", "success")
        shots = frames(camera, lamps, noise="usual", fading=fading)
        named = ["equal-energy" if j in unnamed else lamp for j, lamp in enumerate(lamps, 1)]
        inputs = capture(shots, named, basis="auto", make="Apple", unnamed=unnamed) | change
        yield case(f"light/{name}", comment, inputs, expect=expect)


def run(call: Call) -> dict[str, Any]:
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


STAGE = Stage(
    name="light",
    requires="signals model",
    cases=cases,
    run=run,
    inputs=CAPTURE | words("unnamed"),
    optional=words("make model colour_matrices torch called"),
    rounded=words("ssf ssf_std power power_std predicted"),
    limits=(
        ("exact", 0.0, "weighed"),
        ("relative", 1e-10, "log_evidence"),
        ("norm", 1e-8, "probability"),
        ("exact", 0.0, "basis prior_scale likeliest"),
        ("norm", 1e-8, "length chart_fading"),
        ("norm", 1e-9, "ssf ssf_std predicted"),
        ("norm", 1e-8, "rmsre_percent kinds"),
        ("norm", 1e-9, "power power_std"),
        ("relative", 1e-9, "kelvin kelvin_std"),
        ("exact", 0.0, "status codes messages"),
        ("relative", 1e-8, "values"),
        ("relative", 1e-15, "thresholds"),
        ("exact", 0.0, "said"),
        ("at_most", LARGEST_GAP, "gap"),
    ),
)
