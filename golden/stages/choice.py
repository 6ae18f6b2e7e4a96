"""The stage `choice`: the signals choose the basis, or mix."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from camssf.recovery.hypotheses import recover
from golden.contract import LARGEST_GAP, Call, Stage, each, words
from golden.forms import Json
from golden.products import CALL, build_observation, chosen, raw_signals, settings_of
from golden.scenes import BETWEEN, NIKON, ODD, PHONE, TWELVE, YELLOW_PHONE, moved, scene

Row: TypeAlias = tuple[str, str, Json, list[str], Json]
"""Name, comment, camera, lamps, and what is unlike the base case: arguments of `scene`, and `prior`, 1 elsewhere."""
BOTH = ["D55", "A"]
TOLD: Json = {"patches": TWELVE, "noise": "usual"}
"""Little is known: twelve patches, the usual noise."""


def rows() -> list[Row]:
    """Of `auto`: one basis alone, or a mixture."""
    return [
        ("phone", "A phone under two lamps: its basis answers alone.", PHONE, BOTH, {}),
        ("camera", "A camera under two lamps: its basis answers alone.", NIKON, BOTH, {}),
        ("undecided", "Between the two under one lamp: both answers are mixed, bands and all.",
         BETWEEN, ["D55"], TOLD),
        ("maker-cameras", "The same with odds of 20 for cameras: it answers alone.",
         BETWEEN, ["D55"], TOLD | {"prior": {"cameras": 20.0}}),
        ("maker-phones", "The same with odds of 20 for phones: it leads, but not by 20 : 1.",
         BETWEEN, ["D55"], TOLD | {"prior": {"phones": 20.0}}),
        ("maker-outweighed", "A phone whose file names a maker of cameras: the signals outweigh 20 : 1.",
         PHONE, BOTH, {"prior": {"cameras": 20.0}, "noise": "none"}),
        ("ryyb", "A phone with yellow in green's place: the basis made for it answers alone.",
         YELLOW_PHONE, BOTH, {"prior": {"phones": 20.0}}),
        ("unfamiliar", "Curves that no basis knows: the answer has a wider prior.", ODD, BOTH, {}),
        ("moved-9", "A phone moved by 9 nm: a third of the answer has a wider prior.", moved(9.0), BOTH, {}),
        ("moved-10", "A phone moved by 10 nm: more than half of the answer has a wider prior.",
         moved(10.0), BOTH, {}),
        ("faded", "A chart that lost a fifth of its colours: noticed, and the prior is not wider.",
         PHONE, BOTH, {"fading": 0.2}),
        ("l1-only", "λ₂ = 0: the evidence does not know of the penalties.",
         BETWEEN, ["D55"], TOLD | {"l2": 0.0, "gamma": 1.4}),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    for name, comment, camera, lamps, change in rows():
        arguments = {key: value for key, value in change.items() if key != "prior"}
        yield scene(name, comment, camera=camera, lamps=lamps, basis="auto", stage="choice",
                    change={"prior": change.get("prior", {})}, **arguments)  # fmt: skip


def run(call: Call) -> dict[str, Any]:
    """The stage `choice`: `recover` with its hypotheses."""
    given, signals = call.given, raw_signals(call.given)
    frames = (given["chart"], given["white"], given["dark"])
    observation = build_observation(given, signals, frames)
    ssf = recover(observation, basis=given["basis"], settings=settings_of(call), prior=given["prior"])
    test = ssf.family_test
    assert test is not None
    return chosen(ssf) | {
        "weighed": [[weight.basis] for weight in ssf.choice],
        "family_test": np.array([test.length, test.lamp_residual, test.longest, test.largest]),
    }


STAGE = Stage(
    name="choice",
    requires="model",
    cases=cases,
    run=run,
    inputs=CALL | words("prior"),
    limits=(
        *each("exact", 0.0, "weighed"),
        *each("relative", 1e-10, "log_evidence"),
        *each("norm", 1e-8, "probability"),
        *each("exact", 0.0, "basis prior_scale"),
        *each("norm", 1e-8, "family_test chart_fading"),
        *each("norm", 1e-9, "ssf ssf_std predicted"),
        *each("at_most", LARGEST_GAP, "gap"),
    ),
)
