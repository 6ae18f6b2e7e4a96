"""The stage `signals`: patch statistics to Eq. (5)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from camssf.photo.signals import normalise
from golden.contract import Call, Keys, Stage, against_stored, always, case, each, words
from golden.forms import Json, resolve
from golden.products import build_means, build_table
from golden.scenes import CANON, Case, clip, faulty, frames, put


def cases() -> Iterator[Json]:
    """All cases."""

    def signals(name: str, comment: str, shots: list[Json], *, patches: int = 24, **more: Any) -> Case:
        return case(f"signals/{name}", comment, {"shots": shots, "patches": patches, "white": 18}, **more)

    (shot,) = frames()
    yield signals("triple", "Chart, white and dark frame: Eq. (5) and its standard errors.", [shot])
    white = resolve({"chart": "babelcolor", "patches": [19]})[0]
    card = frames(white=white, shade=0.0)[0] | {"white": None}
    yield signals("no-white", "The chart's white patch stands in; its own row is not used.", [card])
    yield signals("no-dark", "The black level stands in for the dark frame.", [shot | {"dark": None}])
    yield signals("chart-alone", "Neither white nor dark frame: two fallbacks.", [card | {"dark": None}])
    yield signals("two-shots", "Two shots are normalised each by its own frames.", frames(CANON, ["D55", "A"]))
    exact = {key: {"mean": {"constant": dn, "shape": [24, 3]}, "standard_error": {"constant": 0.0, "shape": [24, 3]},
                   "clipped": {"constant": 0.0, "shape": [24, 3]}}
             for key, dn in (("chart", 576.0), ("white", 2112.0), ("dark", 64.0))}  # fmt: skip
    yield signals("quarter", "(576 - 64) / (2112 - 64) is exactly 1/4.", [shot | exact])
    yield signals("clipped-patches", "Clipped above 1 % in one channel: not used; 1 % itself is.",
                  [clip(clip(shot, "chart", slice(0, 2), 0.011), "chart", slice(0, 3), 0.01)
                   | {"chart": shot["chart"] | {"clipped": [[0, v, 0] for v in (0.011, 0.01, 0.5) + (0.0,) * 21]}}]
                  )  # fmt: skip
    level = np.array(shot["white"]["mean"])[:, 2]
    dim = put(shot, "white", "mean", (slice(None), 2), 64.0 + 0.006 * (16_383.0 - 64.0))
    dim = put(dim, "white", "standard_error", (slice(None), 2), 1.0)
    yield signals("white-just-bright", "The white frame's blue lies at 0.6 % of the range: enough.", [dim])
    just = put(shot, "white", "standard_error", (5, 2), round(0.04 * (level[5] - 64.0), 4))
    yield signals("white-just-quiet", "The white frame is known to 4 % at one patch: enough.", [just])
    signal = np.array(shot["chart"]["mean"])[:, 2] - np.array(shot["dark"]["mean"])[:, 2]
    near = shot
    for i, errors in ((22, 4.0), (23, 2.0)):
        near = put(near, "chart", "standard_error", (i, 2), round(signal[i] / errors, 4))
    yield signals("nearly-lost", "Four standard errors are a signal, two are none.", [near])
    yield signals("six-left", "Six patches that are not clipped: just enough.",
                  [clip(shot, "chart", slice(6, 24))])  # fmt: skip
    yield signals("lost-patch", "The black patch lies below three standard errors in blue.",
                  [put(shot, "chart", "standard_error", (23, 2), 2000.0)])  # fmt: skip
    for name, comment, code, shots, _ in faulty():
        yield signals(f"error-{name}", comment, shots, expect=code)
    low = put(shot, "white", "mean", (slice(None), 2), 64.0 + 0.004 * (16_383.0 - 64.0))
    low = put(low, "white", "standard_error", (slice(None), 2), 1.0)
    for name, comment, code, wrong in (
        ("white-just-faint", "The white frame's blue lies at 0.4 % of the range.", "underexposed", low),
        ("white-just-noisy", "The white frame is known to 6 % at one patch.", "underexposed",
         put(shot, "white", "standard_error", (5, 2), round(0.06 * (level[5] - 64.0), 4))),
        ("five-left", "Five patches that are not clipped.", "overexposed", clip(shot, "chart", slice(5, 24))),
    ):  # fmt: skip
        yield signals(f"error-{name}", comment, [wrong], expect=code)
    yield signals("error-no-shot", "No shot at all.", [], expect="invalid_argument")
    yield signals("error-other-chart", "24 patches, a table of 140.", [shot], patches=140, expect="invalid_argument")


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    given = call.given
    table = build_table(np.ones((given["patches"], 681)), 0.03, given["white"])
    signals = normalise([build_means(shot) for shot in given["shots"]], table)
    return {
        "signals": signals.values,
        "standard_error": signals.standard_error,
        "used": signals.used.tolist(),
        "assumptions": [assumption.code for assumption in signals.assumptions],
    }


LIMITS = (
    *each("norm", 1e-15, "signals"),
    *each("norm", 1e-14, "standard_error"),
    *each("exact", 0.0, "used assumptions"),
)


STAGE = Stage(
    name="signals",
    keys=Keys(words("shots patches white"), words("signals standard_error used assumptions")),
    requires=always("signals"),
    cases=cases,
    run=run,
    limits=against_stored(LIMITS),
)
