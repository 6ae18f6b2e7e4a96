"""The stage `choice`: the signals choose the basis, or mix."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf.recovery.hypotheses import recover
from camssf.recovery.sensitivity import SolverSettings
from golden.contract import LARGEST_GAP, Call, Keys, Stage, always, each, limit, stored, words
from golden.forms import Json
from golden.products import CALL, build_observation
from golden.scenes import BETWEEN, NIKON, ODD, PHONE, TWELVE, YELLOW_PHONE, Case, moved, scene


def cases() -> Iterator[Json]:
    """Cases of `auto`: one basis alone, or a mixture."""

    def choice(name: str, comment: str, camera: Json, lamps: list[str], prior: dict[str, float] | None = None,
               **more: Any) -> Case:  # fmt: skip
        return scene(name, comment, camera=camera, lamps=lamps, basis="auto", stage="choice",
                     change={"prior": prior or {}}, **more)  # fmt: skip

    yield choice("phone", "A phone under two lamps: its basis answers alone.", PHONE, ["D55", "A"])
    yield choice("camera", "A camera under two lamps: its basis answers alone.", NIKON, ["D55", "A"])
    yield choice("undecided", "Between the two under one lamp: both answers are mixed, bands and all.", BETWEEN,
                 ["D55"], patches=TWELVE, noise="usual")  # fmt: skip
    for family, comment in (("cameras", "it answers alone"), ("phones", "it leads, but not by 20 : 1")):
        yield choice(f"maker-{family}", f"The same with odds of 20 for {family}: {comment}.", BETWEEN,
                     ["D55"], {family: 20.0}, patches=TWELVE, noise="usual")  # fmt: skip
    yield choice("maker-outweighed", "A phone whose file names a maker of cameras: the signals outweigh 20 : 1.",
                 PHONE, ["D55", "A"], {"cameras": 20.0}, noise="none")  # fmt: skip
    yield choice("ryyb", "A phone with yellow in green's place: the basis made for it answers alone.", YELLOW_PHONE,
                 ["D55", "A"], {"phones": 20.0})  # fmt: skip
    yield choice("unfamiliar", "Curves that no basis knows: the answer has a wider prior.", ODD, ["D55", "A"])
    for nm, share in ((9.0, "a third"), (10.0, "more than half")):
        yield choice(f"moved-{nm:g}", f"A phone moved by {nm:g} nm: {share} of the answer has a wider prior.",
                     moved(nm), ["D55", "A"])  # fmt: skip
    yield choice("faded", "A chart that lost a fifth of its colours: found, and the prior is not wider.",
                 PHONE, ["D55", "A"], fading=0.2)  # fmt: skip
    yield choice("l1-only", "λ₂ = 0: the evidence does not know of the penalties.", BETWEEN, ["D55"],
                 patches=TWELVE, noise="usual", l2=0.0, gamma=1.4)  # fmt: skip


def run(call: Call) -> dict[str, Any]:
    """The stage `choice`: `recover` with its hypotheses; curves and bands on the 5-nm nodes, at peak 1."""
    given, engine = call.given, call.engine
    frames = tuple(given[name] for name in ("chart", "white", "dark"))
    signals = (frames[0] - frames[2]) / (frames[1] - frames[2])
    ssf = recover(
        build_observation(given, signals, frames),
        basis=given["basis"],
        settings=SolverSettings(
            l2=given["l2"], gamma=given["gamma"], nonnegative=given["nonnegative"], engine=engine
        ),
        prior=given["prior"],
    )
    curves, std = ssf.peak()
    assert std is not None
    test = ssf.family_test
    assert test is not None
    return {
        "weighed": [[weight.basis] for weight in ssf.choice],
        "family_test": np.array([test.length, test.lamp_residual, test.longest, test.largest]),
        "log_evidence": np.array([weight.log_evidence for weight in ssf.choice]),
        "probability": np.array([weight.probability for weight in ssf.choice]),
        "basis": ssf.basis,
        "prior_scale": ssf.prior_scale,
        "chart_fading": ssf.chart_fading,
        "ssf": curves[::10],
        "ssf_std": std[::10],
        "predicted": ssf.predicted,
        "gap": ssf.proof.gap,
    }


LIMITS = (
    *each("exact", 0.0, "weighed"),
    *each("relative", 1e-10, "log_evidence"),
    *each("norm", 1e-8, "probability"),
    *each("exact", 0.0, "basis prior_scale"),
    *each("norm", 1e-8, "family_test chart_fading"),
    *each("norm", 1e-9, "ssf ssf_std predicted"),
)


def limits(made: Json, scene: Json) -> list[Json]:
    """Against the stored outputs, and the gap."""
    return [*stored(made, LIMITS), limit("gap", "outputs", "at_most", LARGEST_GAP)]


STAGE = Stage(
    name="choice",
    keys=Keys(
        CALL | words("prior"),
        words(
            "gap ssf ssf_std predicted weighed log_evidence probability basis prior_scale family_test chart_fading"
        ),
    ),
    requires=always("model"),
    cases=cases,
    run=run,
    limits=limits,
)
