"""The stage `rivals`: by how much each other lamp would fit better."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import recover_fit
from camssf.verdict.rival_lamps import weigh_rivals
from golden.contract import Call, Stage, case, words
from golden.forms import Json
from golden.products import CAPTURE, build_capture
from golden.scenes import PHONE, evenly, frames
from golden.stages.calibrate import capture

Row: TypeAlias = tuple[str, str, list[Json], list[str], Json]
"""Name, comment, shots, the lamps that they are said to have, and the inputs that are unlike the base case's."""


def rows() -> list[Row]:
    """All cases: the gains that rule 4 of the verdict uses."""
    bulb, auto = frames(PHONE, ["A"]), {"basis": "auto"}
    return [
        ("right", "D55 under its own name: no lamp gains much.", frames(), ["D55"], {}),
        ("wrong", "D55 named A: daylight gains most.", frames(), ["A"], {}),
        ("phone", "On the basis of phones, two shots, the second named wrongly.",
         frames(PHONE, ["D55", "LED-B3"]), ["D55", "A"], {"basis": "phones"}),
        ("auto", "A phone's bulb named daylight: possible for a camera, but not for a phone.",
         bulb, ["D55"], auto | {"make": "samsung", "model": "SM-G991B"}),
        ("auto-no-maker", "The same of a file that does not say who made it.", bulb, ["D55"], auto),
        ("no-white", "A wrong lamp without a white frame: gain modes stand beside every lamp.",
         [evenly()[0] | {"white": None}], ["A"], {}),
        ("kind", "Told by its kind alone: a rival has no modes.",
         frames(), ["daylight"], {"lamp_modes": {"modes": ["daylight"]}}),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    for name, comment, shots, lamps, change in rows():
        yield case(f"rivals/{name}", comment, capture(shots, lamps, **change))


def run(call: Call) -> dict[str, Any]:
    """The stage `rivals`: `camssf.verdict.rival_lamps.weigh_rivals`, the gain of every lamp for each shot."""
    measured, options = build_capture(call.given, "reference")
    fit = prepare_fit(measured, options)
    weighed = weigh_rivals(fit, recover_fit(fit, fit.signals.used, options.gamma))
    return {"gains": np.array([rival.gain for rival in weighed]).reshape(len(measured.shots), -1)}


STAGE = Stage(
    name="rivals",
    requires="signals model",
    cases=cases,
    run=run,
    inputs=CAPTURE,
    optional=words("make model"),
    limits=[("norm", 1e-8, "gains")],
)
