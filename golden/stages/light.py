"""The stage `light`: curves and light where nobody named the lamp, and the verdict."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import cross_validate, prediction_bands, recover_each_shot, recover_fit, score
from camssf.verdict.assumptions import assume
from camssf.verdict.rival_lamps import weigh
from golden.contract import LARGEST_GAP, Call, Keys, Stage, always, case, each, limit, stored, words
from golden.forms import Json, resolve
from golden.products import CAPTURE, build_capture
from golden.scenes import NIKON, PHONE, Case, dimmed, frames, moved, uneven_light
from golden.stages import calibrate


def cases() -> Iterator[Json]:
    """Cases of uncertain light: `unnamed` lists the shots, counted from 1, `called` the names; `lamp` is ignored."""

    def matrix(made_for: str, tint: float) -> Json:
        """A colour matrix that takes the scene's equal raw white for a light of about 5,000 K."""
        return {"light": made_for, "values": [1.0 / 0.96, 0.0, 0.0, 0.0, tint, 0.0, 0.0, 0.0, 1.0 / 0.82]}

    def light(
        name: str, comment: str, camera: Json, lamps: Sequence[str], unnamed: list[int], *, expect: str = "success",
        fading: float = 0.0, **more: Any,
    ) -> Case:  # fmt: skip
        made = next(each for each in calibrate.cases() if each["case"] == "calibrate/auto-phone")["inputs"]
        lamp_names = ["equal-energy" if j in unnamed else lamp for j, lamp in enumerate(lamps, 1)]
        k = len(lamps)
        inputs = made | {
            "shots": frames(camera, lamps, noise="usual", fading=fading),
            "lamp": {"lamps": lamp_names},
            "lamp_tolerance": {"constant": 0.02, "shape": [k]},
            "lamp_modes": {"polynomials": [[] for _ in lamps]},
            "unnamed": unnamed,
        }
        return case(f"light/{name}", comment, inputs | more, expect=expect)

    yield light("daylight", "A phone under D55, and nobody said so.", PHONE, ["D55"], [1])
    yield light("white-led", "The same under a white LED: kinds are mixed.", PHONE, ["LED-B3"], [1])
    yield light("two", "Daylight and a bulb, neither named.", PHONE, ["D55", "A"], [1, 2])
    yield light("one-of-two", "Daylight by its name and a bulb by none: rivals of the first alone.", PHONE,
                ["D55", "A"], [2])  # fmt: skip
    yield light("faded", "A chart that lost a fifth of its colours, under daylight that nobody named.",
                PHONE, ["D55"], [1], fading=0.2)  # fmt: skip
    yield light("moved", "A phone moved by 12 nm, under a bulb that nobody named: two widths are mixed.",
                moved(12.0), ["A"], [1])  # fmt: skip
    for name, comment, lamps, names in (
        ("called-right", "A phone under D55, called so: the table and the kind are mixed.", ["D55"], ["D55"]),
        ("called-wrong", "The same, called D75: the kind, and that is said.", ["D55"], ["D75"]),
        ("called-kind", "A white LED by its kind: its shapes are weighed.", ["LED-B3"], ["white-led"]),
        ("called-two", "Daylight and a LED by their names, the LED's wrong.", ["D55", "LED-B3"], ["D55", "LED-B1"]),
    ):
        yield light(name, comment, PHONE, lamps, [], called=names)
    yield light("told-of-two", "The numbers of one-of-two: a lamp named with its tolerance is taken as said.",
                PHONE, ["D55", "A"], [2], called=["D55,2%", ""])  # fmt: skip
    yield light("told-basis", "The basis told, a fluorescent lamp not: a phone by word.", PHONE, ["FL2"], [1],
                basis="phones")  # fmt: skip
    yield light("camera", "A camera must name its lamp: refused, and what it might have been.", NIKON, ["D55"], [1],
                make="NIKON CORPORATION")  # fmt: skip
    yield light("no-maker", "A phone's curves in a file of nobody: the signals decide.", PHONE, ["D55"], [1],
                make="golden")  # fmt: skip
    white = resolve({"chart": "babelcolor", "patches": [19]})[0]
    yield light(
        "uneven",
        "A white LED that nobody named, no white frame, and light that falls off by a quarter.",
        PHONE,
        ["LED-B3"],
        [1],
        shots=dimmed(frames(PHONE, ["LED-B3"], white=white, shade=0.0, noise="usual"), uneven_light()),
    )
    yield light("error-paper", "A basis without a prior weighs nothing.", PHONE, ["D55"], [1], basis="gaussian",
                gamma=1.0, expect="invalid_argument")  # fmt: skip
    yield light("three", "Daylight, a bulb and a white LED, none named: kinds are screened shot by shot.", PHONE,
                ["D55", "A", "LED-B3"], [1, 2, 3])  # fmt: skip
    yield light("matrices", "A white LED, and a file whose two colour matrices give the chromaticity of its white.",
                PHONE, ["LED-B3"], [1], colour_matrices=[[matrix("A", 0.9), matrix("D65", 1.1)]])  # fmt: skip
    yield light("wrong-matrices", "Colour matrices that give a white of no kind: the kinds stay as they are.", PHONE,
                ["LED-B3"], [1], colour_matrices=[[matrix("D65", 3.0)]])  # fmt: skip
    yield light("torch", "The phone's torch, a white LED, beside named daylight.", PHONE, ["LED-B3", "D55"], [],
                torch=[1])  # fmt: skip
    yield light("error-four", "Four lights at once are too many.", PHONE, ["D55", "A", "LED-B3", "FL2"], [1, 2, 3, 4],
                expect="invalid_argument")  # fmt: skip


def run(call: Call) -> dict[str, Any]:
    """The stage `light`: curves and light for unnamed lamps, and the verdict, even if it refuses."""
    given, engine = call.given, call.engine
    capture, options = build_capture(given, engine)
    free_fit = prepare_fit(capture, options)
    ssf = recover_fit(free_fit, free_fit.signals.used, options.gamma)
    fit = free_fit.conditioned_on(ssf)
    verdict = weigh(free_fit, ssf, recover_each_shot(fit))
    scores = score(fit, ssf, cross_validate(fit, ssf, prediction_bands(fit, free_fit.signals.used, ssf)))
    curves, std = ssf.peak()
    assert std is not None
    lights = [light for light in ssf.lights if light is not None]
    test = ssf.family_test
    return {
        "length": None if test is None else np.array([test.length, test.longest]),
        "weighed": [[weight.basis, *weight.kinds] for weight in ssf.choice],
        "log_evidence": np.array([weight.log_evidence for weight in ssf.choice]),
        "probability": np.array([weight.probability for weight in ssf.choice]),
        "basis": ssf.basis,
        "prior_scale": ssf.prior_scale,
        "chart_fading": ssf.chart_fading,
        "likeliest": list(ssf.kinds),
        "ssf": curves[::10],
        "ssf_std": std[::10],
        "predicted": ssf.predicted,
        "gap": ssf.proof.gap,
        "rmsre_percent": scores.rmsre_percent,
        "kinds": np.array([list(light.kinds.values()) for light in lights]),
        "power": np.stack([light.power[::10] for light in lights]),
        "power_std": np.stack([light.std[::10] for light in lights]),
        "kelvin": np.array([light.kelvin for light in lights]),
        "kelvin_std": np.array([light.kelvin_std for light in lights]),
        "status": verdict.status,
        "codes": [reason.code for reason in verdict.reasons],
        "messages": [reason.message for reason in verdict.reasons],
        "values": np.array([float(reason.value or 0.0) for reason in verdict.reasons]) if verdict.reasons else None,
        "thresholds": np.array([float(reason.threshold or 0.0) for reason in verdict.reasons])
        if verdict.reasons
        else None,
        "said": [each.message for each in assume(capture, ssf, fit.level(ssf), None) if each.code == "lamp"],
    }


LIMITS = (
    *each("exact", 0.0, "weighed"),
    *each("relative", 1e-10, "log_evidence"),
    *each("norm", 1e-8, "probability"),
    *each("exact", 0.0, "basis prior_scale likeliest"),
    *each("norm", 1e-8, "length chart_fading"),
    *each("norm", 1e-9, "ssf ssf_std predicted"),
    *each("norm", 1e-8, "rmsre_percent kinds"),
    *each("norm", 1e-9, "power power_std"),
    *each("relative", 1e-9, "kelvin kelvin_std"),
    *each("exact", 0.0, "status codes messages"),
    *each("relative", 1e-8, "values"),
    *each("relative", 1e-15, "thresholds"),
    *each("exact", 0.0, "said"),
)


def limits(made: Json, scene: Json) -> list[Json]:
    """Against the stored outputs, and the gap."""
    return [*stored(made, LIMITS), limit("gap", "outputs", "at_most", LARGEST_GAP)]


STAGE = Stage(
    name="light",
    keys=Keys(
        CAPTURE | words("unnamed"),
        words(
            "gap ssf ssf_std predicted weighed log_evidence probability basis prior_scale chart_fading length "
            "likeliest rmsre_percent kinds power power_std kelvin kelvin_std status codes messages values "
            "thresholds said"
        ),
        words("make model colour_matrices torch called"),
        rounded=words("ssf ssf_std power power_std predicted"),
    ),
    requires=always("signals", "model"),
    cases=cases,
    run=run,
    limits=limits,
)
