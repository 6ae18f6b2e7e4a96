"""The stage `pose`: the corners by hand, and the chart's pose that follows from them."""

from __future__ import annotations

from typing import Any

from camssf.photo.find.pose import find_chart
from camssf.spectra import read_chart
from golden.contract import Call, Stage, words
from golden.products import read_card, read_photo


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
