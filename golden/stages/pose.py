"""The stage `pose`: the corners by hand, and the chart's pose that follows from them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from camssf.photo.find.pose import find_chart
from camssf.spectra import read_chart
from golden.contract import Call, Stage, case, words
from golden.forms import Json
from golden.products import own_card, read_card, read_photo
from golden.views import TILTED, rounded, turned

Row: TypeAlias = tuple[str, str, str, Any, Json]
"""Name, comment, photo, the corners by hand, and what is unlike the base case: inputs, and `expect`."""


def rows() -> list[Row]:
    """All cases; the corners are a few pixels off."""
    upright, tilted = turned(24, 0).corners(), TILTED.corners()
    hand = np.array([[3, -2], [-4, 3], [2, 4], [-3, -3]])
    half = 0.44 * 24 / np.sqrt(2)
    inwards = 0.7 * 24 * np.array([[1, 0], [-1, 0], [-1, 0], [1, 0]])
    block = np.array([[31.5, 31.5], [195.5, 31.5], [195.5, 147.5], [31.5, 147.5]])
    card = own_card() | {"table": ""}
    unknown, wrong = {"expect": "chart_not_found"}, {"expect": "invalid_argument"}
    chart = "chart-turned-0"
    return [
        *((f"turned-{n}", f"The chart turned by {90 * n}° clockwise; corners a few pixels off.", f"chart-turned-{n}",
           np.roll(turned(24, n).corners() + hand, n, axis=0), {}) for n in range(4)),
        ("other-way-round", "The corners run against the clock.", chart, upright[::-1] - 1.25, {}),
        ("half-a-patch-together", "All corners off by half a patch, together.",
         chart, upright + half, {}),
        ("tilted", "Turned by 20° and tilted, GBRG.", "chart-tilted", tilted + np.array([3, -4]), {}),
        *((f"reduced-{n}", f"A large photo: {n} × {n} CFA cells make a pixel of the search.", f"chart-large-{n}",
           turned(pitch, 1, pitch).corners() + np.array([0.3 * pitch, 5.0]), {}) for n, pitch in ((2, 90), (3, 128))),
        ("kept", "No borders where the corners say: they are kept, since the colours agree.",
         chart, upright + inwards, {}),
        ("own-layout", "A chart of the user's own layout; `table` is not read.", "finder-card", block + 1.5, card),
        ("error-elsewhere", "Corners inside the chart: the colours do not agree.",
         chart, [[40, 40], [80, 40], [80, 66], [40, 66]], unknown),
        ("error-mirrored", "A mirrored chart.", "chart-mirrored", upright, unknown),
        ("error-outside", "A corner outside the photo.", chart, [[-5, 0], [100, 0], [100, 90], [0, 90]], wrong),
        ("error-crossed", "Corners that cross.", chart, [[10, 10], [100, 10], [10, 90], [100, 90]], wrong),
    ]  # fmt: skip


def cases() -> Iterator[Json]:
    """All cases."""
    for name, comment, photo, corners, change in rows():
        expect = change.get("expect", "success")
        inputs = {"dng": f"{photo}.dng", "table": "classic24",
                  "corners": rounded(corners) if isinstance(corners, np.ndarray) else corners}  # fmt: skip
        own = {key: value for key, value in change.items() if key != "expect"}
        yield case(f"pose/{name}", comment, inputs | own, expect=expect)


def run(call: Call) -> dict[str, Any]:
    """The outputs of a case."""
    given = call.given
    table = read_card(given) if "layout" in given else read_chart(given["table"])
    pose = find_chart(read_photo(given["dng"]), table, corners=given["corners"])
    return {
        "corners": pose.corners,
        "quads": pose.patches,
        "quarter_turns": pose.quarter_turns,
        "score": pose.score,
        "kept": bool(pose.notes),
    }


STAGE = Stage(
    name="pose",
    requires="pose",
    cases=cases,
    run=run,
    inputs=words("dng table corners"),
    optional=words("layout csv"),
    arrays=words("corners"),
    limits=(
        ("norm", 1e-9, "corners quads"),
        ("exact", 0.0, "quarter_turns"),
        ("norm", 1e-9, "score"),
        ("exact", 0.0, "kept"),
    ),
)
