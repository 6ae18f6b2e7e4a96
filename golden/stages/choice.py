"""The stage `choice`: the signals choose the basis, or mix."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.recovery.hypotheses import recover
from golden.contract import LARGEST_GAP, Call, Row, Stage, words
from golden.forms import Json
from golden.products import CALL, build_observation, chosen, raw_signals, settings_of
from golden.scenes import BETWEEN, BOTH, ODD, PHONE, TWELVE, YELLOW_PHONE, moved, scene

TOLD: Json = {"camera": BETWEEN, "lamps": ["D55"], "patches": TWELVE, "noise": "usual"}
"""Little is known: one lamp, twelve patches, the usual noise."""
DULL: Json = {"camera": PHONE, "lamps": ["D55"], "patches": list(range(13, 19))}
"""Saturated colours, whose fading is seen most."""


def rows() -> list[Row]:
    """Of `auto`: one basis alone, or a mixture; the base case has two lamps."""
    return [
        ("phone", "A phone under two lamps: its basis answers alone.", {"camera": PHONE}),
        ("camera", "A camera under two lamps: its basis answers alone.", {}),
        ("undecided", "Between the two under one lamp: both answers are mixed, bands and all.", TOLD),
        ("maker-cameras", "The same with odds of 20 for cameras: these alone.", TOLD | {"prior": {"cameras": 20.0}}),
        ("maker-phones", "Odds of 20 for phones: they lead by less than 20 : 1.", TOLD | {"prior": {"phones": 20.0}}),
        ("maker-outweighed", "A phone whose file names a maker of cameras: the signals outweigh 20 : 1.",
         {"camera": PHONE, "prior": {"cameras": 20.0}, "noise": "none"}),
        ("ryyb", "A phone with yellow in green's place: the basis made for it answers alone.",
         {"camera": YELLOW_PHONE, "prior": {"phones": 20.0}}),
        ("unfamiliar", "Curves that no basis knows: the answer has a wider prior.", {"camera": ODD}),
        ("moved-9", "A phone moved by 9 nm: a third of the answer has a wider prior.", {"camera": moved(9.0)}),
        ("moved-10", "A phone moved by 10 nm: most of the answer has a wider prior.", {"camera": moved(10.0)}),
        ("faded", "A chart that lost a fifth of its colours: noticed, and the prior is not wider.",
         {"camera": PHONE, "fading": 0.2}),
        ("faded-barely", "Odds of 22 : 1 that the chart has faded: from 20 : 1 on it has.", DULL | {"fading": 0.176}),
        ("faded-hardly", "Odds of 17 : 1: it is not.", DULL | {"fading": 0.173}),
        ("l1-only", "λ₂ = 0: the evidence does not know of the penalties.", TOLD | {"l2": 0.0, "gamma": 1.4}),
    ]  # fmt: skip


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
    rows=rows,
    inputs_of=lambda change: scene({"lamps": BOTH, "basis": "auto", "prior": {}} | change),
    run=run,
    inputs=CALL | words("prior"),
    limits=(
        ("exact", 0.0, "weighed basis prior_scale"),
        ("relative", 1e-10, "log_evidence"),
        ("norm", 1e-8, "probability family_test chart_fading"),
        ("norm", 1e-9, "ssf ssf_std predicted"),
        ("at_most", LARGEST_GAP, "gap"),
    ),
)
