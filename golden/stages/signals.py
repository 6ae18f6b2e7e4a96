"""The stage `signals`: patch statistics to Eq. (5)."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.photo.signals import normalise
from golden.contract import Call, Row, Stage, words
from golden.forms import Json
from golden.products import build_means, build_table
from golden.scenes import CANON, clip, evenly, frames, put


def rows() -> list[Row]:
    """All cases."""
    (shot,), (card,) = frames(), evenly()
    card |= {"white": None}
    shares = [[0, share, 0] for share in (0.011, 0.01, 0.5) + (0.0,) * 21]
    clipped = shot | {"chart": shot["chart"] | {"clipped": shares}}
    span = 16_383.0 - 64.0
    level = np.array(shot["white"]["mean"])[5, 2] - 64.0
    signal = np.array(shot["chart"]["mean"])[:, 2] - np.array(shot["dark"]["mean"])[:, 2]
    near = shot
    for i, errors in ((22, 4.0), (23, 2.0)):
        near = put(near, "chart", "standard_error", (i, 2), round(signal[i] / errors, 4))

    def faint(share: float) -> Json:
        bright = put(shot, "white", "mean", (slice(None), 2), 64.0 + share * span)
        return put(bright, "white", "standard_error", (slice(None), 2), 1.0)

    def noisy(share: float) -> Json:
        return put(shot, "white", "standard_error", (5, 2), round(share * level, 4))

    under, over, wrong = ({"expect": code} for code in ("underexposed", "overexposed", "invalid_argument"))
    table: list[tuple[str, str, list[Json], Json]] = [
        ("triple", "Chart, white and dark frame: Eq. (5) and its standard errors.", [shot], {}),
        ("no-white", "The chart's white patch stands in; its own row is not used.", [card], {}),
        ("no-dark", "The black level stands in for the dark frame.", [shot | {"dark": None}], {}),
        ("two-shots", "Two shots are normalised each by its own frames.", frames(CANON, ["D55", "A"]), {}),
        ("clipped-patches", "Clipped above 1 % in one channel: not used; 1 % itself is.", [clipped], {}),
        ("white-just-bright", "The white frame's blue lies at 0.6 % of the range: enough.", [faint(0.006)], {}),
        ("white-just-quiet", "The white frame is known to 4 % at one patch: enough.", [noisy(0.04)], {}),
        ("nearly-lost", "Four standard errors are a signal, two are none.", [near], {}),
        ("six-left", "Six patches that are not clipped: just enough.", [clip(shot, "chart", slice(6, 24))], {}),
        ("error-white-just-faint", "The white frame's blue lies at 0.4 % of the range.", [faint(0.004)], under),
        ("error-white-just-noisy", "The white frame is known to 6 % at one patch.", [noisy(0.06)], under),
        ("error-five-left", "Five patches that are not clipped.", [clip(shot, "chart", slice(5, 24))], over),
        ("error-channel-all-clipped", "Every patch's green is clipped.", [clip(shot, "chart", slice(0, 24))], over),
        ("error-white-clipped", "The white is clipped in red.", [clip(shot, "white", slice(4, 5), 0.02, 0)], over),
        ("error-patches-lost", "Noise swallows 20 of 24 patches.",
         [put(shot, "chart", "standard_error", (slice(0, 20), slice(None)), 5000.0)], under),
        ("error-no-shot", "No shot at all.", [], wrong),
        ("error-other-chart", "24 patches, a table of 140.", [shot], wrong | {"patches": 140}),
    ]  # fmt: skip
    return [(name, comment, {"shots": shots} | change) for name, comment, shots, change in table]


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


STAGE = Stage(
    name="signals",
    rows=rows,
    inputs_of=lambda change: {"patches": 24, "white": 18} | change,
    run=run,
    inputs=words("shots patches white"),
    limits=(
        ("norm", 1e-15, "signals"),
        ("norm", 1e-14, "standard_error"),
        ("exact", 0.0, "used assumptions"),
    ),
)
