"""The stage `sensing`: the rows A, b and their covariance Σ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from golden.contract import Call, Keys, Stage, against_stored, always, case, each, words
from golden.forms import Json
from golden.products import ROWS, build_rows
from golden.scenes import FAMILY, TWELVE, Case, scene


def cases() -> Iterator[Json]:
    """All cases."""

    def sensing(name: str, comment: str, patches: list[int], lamps: Sequence[str] = ("D55",), **more: Any) -> Case:
        made = scene(name, comment, patches=patches, lamps=lamps, noise="usual", **more)["inputs"]
        y = (made["chart"] - made["dark"]) / (made["white"] - made["dark"])
        unused = ("chart", "white", "dark", "l2", "gamma", "nonnegative")
        inputs = {key: value for key, value in made.items() if key not in unused}
        return case(f"sensing/{name}", comment, inputs | {"signals": np.round(y, 6)})

    few = [15, 14, 13, 19]
    yield sensing(
        "cameras-diagonal",
        "No tolerances: Σ is the noise, and of each shot the drift of its light.",
        few,
        chart_tolerance=0.0,
        white_tolerance=0.0,
    )
    yield sensing("cameras-chart", "The chart's error: one a patch, the same under both lamps.", few, ["D55", "A"],
                  white_tolerance=0.0)  # fmt: skip
    yield sensing("cameras-white", "The white's error: common to all rows.", few, ["D55", "FL2"], chart_tolerance=0.0)
    yield sensing("cameras-lamp", "Each lamp's own error, smooth.", few, ["A", "LED-B3"],
                  chart_tolerance=0.0, white_tolerance=0.0, lamp_tolerance=0.02)  # fmt: skip
    yield sensing("cameras-modes", "Modes: rows about what a first look finds, the same for all channels.", few,
                  ["D55", "LED-B3"], modes=FAMILY, lamp_tolerance=0.02,
                  change={"lamp": {"lamps": ["equal-energy"] * 2}})  # fmt: skip
    yield sensing("cameras-two-lamps", "Everything at once: 12 patches, two shots.", TWELVE, ["D55", "A"],
                  lamp_tolerance=0.02)  # fmt: skip
    yield sensing("gaussian-twelve", "The paper's rows F Ψ x = y, 12 patches.", TWELVE, basis="gaussian",
                  chart_tolerance=0.0)  # fmt: skip
    yield sensing("gaussian-one-atom", "A basis of a single Gaussian.", few, basis="gaussian",
                  change={"basis": {"count": 1, "width": 50.0}})  # fmt: skip


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    given = call.given
    return dict(vars(build_rows(given, given["signals"])))


LIMITS = (*each("norm", 1e-12, "matrix target covariance"),)


STAGE = Stage(
    name="sensing",
    keys=Keys(
        ROWS | words("signals standard_error"), words("matrix target covariance"), words("gain_modes gain_own")
    ),
    requires=always("reference"),
    cases=cases,
    run=run,
    limits=against_stored(LIMITS),
)
