"""The stage `sensing`: the rows A, b and their covariance Σ."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from golden.contract import Call, Stage, case, each, words
from golden.forms import Json
from golden.products import ROWS, build_rows, raw_signals
from golden.scenes import FAMILY, TWELVE, scene

Row: TypeAlias = tuple[str, str, list[int], list[str], Json]
"""Name, comment, patches, lamps, and what is unlike the base case: arguments of `scene`."""
FEW = [15, 14, 13, 19]
TABLE: list[Row] = [
    ("cameras-diagonal", "No tolerances: Σ is the noise, and of each shot the drift of its light.",
     FEW, ["D55"], {"chart_tolerance": 0.0, "white_tolerance": 0.0}),
    ("cameras-chart", "The chart's error: one a patch, the same under both lamps.",
     FEW, ["D55", "A"], {"white_tolerance": 0.0}),
    ("cameras-white", "The white's error: common to all rows.", FEW, ["D55", "FL2"], {"chart_tolerance": 0.0}),
    ("cameras-lamp", "Each lamp's own error, smooth.",
     FEW, ["A", "LED-B3"], {"chart_tolerance": 0.0, "white_tolerance": 0.0, "lamp_tolerance": 0.02}),
    ("cameras-modes", "Modes: rows about what a first look estimates, the same for all channels.",
     FEW, ["D55", "LED-B3"],
     {"modes": FAMILY, "lamp_tolerance": 0.02, "change": {"lamp": {"lamps": ["equal-energy"] * 2}}}),
    ("cameras-two-lamps", "Everything at once: 12 patches, two shots.",
     TWELVE, ["D55", "A"], {"lamp_tolerance": 0.02}),
    ("gaussian-twelve", "The paper's rows F Ψ x = y, 12 patches.",
     TWELVE, ["D55"], {"basis": "gaussian", "chart_tolerance": 0.0}),
    ("gaussian-one-atom", "A basis of a single Gaussian.",
     FEW, ["D55"], {"basis": "gaussian", "change": {"basis": {"count": 1, "width": 50.0}}}),
]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    for name, comment, patches, lamps, change in TABLE:
        inputs = scene(name, comment, patches=patches, lamps=lamps, noise="usual", **change)["inputs"]
        kept = {key: value for key, value in inputs.items() if key in STAGE.inputs}
        yield case(f"sensing/{name}", comment, kept | {"signals": np.round(raw_signals(inputs), 6)})


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    return dict(vars(build_rows(call.given, call.given["signals"])))


STAGE = Stage(
    name="sensing",
    requires="reference",
    cases=cases,
    run=run,
    inputs=ROWS | words("signals standard_error"),
    optional=words("gain_modes gain_own"),
    limits=each("norm", 1e-12, "matrix target covariance"),
)
