"""The stage `rivals`: by how much each other lamp would fit better."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import recover_fit
from camssf.verdict.rival_lamps import weigh_rivals
from golden.contract import Call, Keys, Stage, against_stored, always, case, each, words
from golden.forms import Json, resolve
from golden.products import CAPTURE, build_capture
from golden.scenes import PHONE, Case, frames
from golden.stages import calibrate


def cases() -> Iterator[Json]:
    """Cases of the gains of rival lamps, which the verdict's rule 4 uses."""
    names = {"basis", "shots", "lamp"}

    def rivals(name: str, comment: str, shots: list[Json], lamps: Sequence[str], **more: Any) -> Case:
        made = next(each for each in calibrate.cases() if each["case"] == "calibrate/two-shots")["inputs"]
        inputs = {key: value for key, value in made.items() if key not in names}
        inputs |= {"shots": shots, "lamp": {"lamps": list(lamps)}, "basis": "cameras",
                   "lamp_tolerance": {"constant": 0.02, "shape": [len(lamps)]},
                   "lamp_modes": {"polynomials": [[] for _ in lamps]}}  # fmt: skip
        return case(f"rivals/{name}", comment, inputs | more)

    yield rivals("right", "D55 under its own name: no lamp gains much.", frames(), ["D55"])
    yield rivals("wrong", "D55 named A: daylight gains most.", frames(), ["A"])
    yield rivals("phone", "On the basis of phones, two shots, the second named wrongly.",
                 frames(PHONE, ["D55", "LED-B3"]), ["D55", "A"], basis="phones")  # fmt: skip
    yield rivals("auto", "A phone's bulb named daylight: for a camera it may pass, the phones' basis sees it.",
                 frames(PHONE, ["A"]), ["D55"], basis="auto", make="samsung", model="SM-G991B")  # fmt: skip
    yield rivals("auto-no-maker", "The same of a file that does not say who made it.",
                 frames(PHONE, ["A"]), ["D55"], basis="auto")  # fmt: skip
    card = frames(white=resolve({"chart": "babelcolor", "patches": [19]})[0], shade=0.0)[0] | {"white": None}
    yield rivals("no-white", "A wrong lamp without a white frame: gain modes stand beside every lamp.", [card], ["A"])
    yield rivals("kind", "Told by its kind alone: a rival has no modes.", frames(), ["daylight"],
                 lamp_modes={"modes": ["daylight"]})  # fmt: skip


def run(call: Call) -> dict[str, Any]:
    """The stage `rivals`: `camssf.verdict.rival_lamps.weigh_rivals`, the gain of every lamp for each shot."""
    given = call.given
    capture, options = build_capture(given, "reference")
    fit = prepare_fit(capture, options)
    found = weigh_rivals(fit, recover_fit(fit, fit.signals.used, options.gamma))
    return {"gains": np.array([rival.gain for rival in found]).reshape(len(capture.shots), -1)}


LIMITS = (*each("norm", 1e-8, "gains"),)


STAGE = Stage(
    name="rivals",
    keys=Keys(CAPTURE, words("gains"), words("make model")),
    requires=always("signals", "model"),
    cases=cases,
    run=run,
    limits=against_stored(LIMITS),
)
