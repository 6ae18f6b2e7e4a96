"""The stage `pose`: the corners by hand, and the chart's pose that follows from them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from camssf.photo.find.pose import find_chart
from camssf.spectra import read_chart
from golden.contract import Call, Keys, Stage, against_stored, always, each, words
from golden.drawing import TILTED, draw, file, photo_case, rounded, turned
from golden.forms import Json
from golden.products import own_card, read_card, read_photo
from golden.stages.finder import card_kind
from golden.stages.finder import upright as drawn_upright


def cases() -> Iterator[Json]:
    """All cases."""
    half = 0.44  # half a patch, relative to the pitch

    def pose(
        name: str,
        comment: str,
        photo: str,
        content: bytes,
        corners: Any,
        *,
        table: str = "classic24",
        expect: str = "success",
        card: Json | None = None,
    ) -> Json:
        inputs = {"dng": photo, "table": table, "corners": corners} | (card or {})
        return photo_case(f"pose/{name}", comment, inputs, {photo: content}, expect)

    upright = turned(24, 0)
    photo = file(draw(upright))
    for turns in range(4):
        view = turned(24, turns)
        content = photo if turns == 0 else file(draw(view))
        rough = view.corners() + np.array([[3, -2], [-4, 3], [2, 4], [-3, -3]])
        yield pose(
            f"turned-{turns}", f"The chart turned by {90 * turns}° clockwise; corners a few pixels off.",
            f"chart-turned-{turns}.dng", content, rounded(np.roll(rough, turns, axis=0)),
        )  # fmt: skip
    for first in (1, 2, 3):
        yield pose(
            f"from-corner-{first + 1}", f"The corners begin with number {first + 1}: the colours say which is which.",
            "chart-turned-0.dng", photo, rounded(np.roll(upright.corners() + 1.5, -first, axis=0)),
        )  # fmt: skip
    yield pose(
        "other-way-round", "The corners run against the clock.", "chart-turned-0.dng", photo,
        rounded(upright.corners()[::-1] - 1.25),
    )  # fmt: skip
    for name, ways in (("together", [(1, 1)] * 4), ("apart", [(1, -1), (1, 1), (-1, 1), (-1, -1)])):
        off = half * 24 * np.array(ways) / np.sqrt(2)
        yield pose(
            f"half-a-patch-{name}", f"All corners off by half a patch, {name}.", "chart-turned-0.dng", photo,
            rounded(upright.corners() + off),
        )  # fmt: skip
    tilted = file(draw(TILTED, bytes((1, 2, 0, 1))), cfa=bytes((1, 2, 0, 1)))
    yield pose(
        "tilted", "Turned by 20° and tilted, GBRG.", "chart-tilted.dng", tilted,
            rounded(TILTED.corners() + np.array([3, -4])),
    )  # fmt: skip
    for factor, pitch in ((2, 90), (3, 128)):
        view = turned(pitch, 1, margin=pitch)
        yield pose(
            f"reduced-{factor}", f"A large photo: {factor} × {factor} CFA cells make a pixel of the search.",
            f"chart-large-{factor}.dng", file(draw(view, unrest=0)),
            rounded(view.corners() + np.array([0.3 * pitch, 5.0])),
        )  # fmt: skip
    yield pose(
        "ohta", "Another table of the same chart.", "chart-turned-0.dng", photo, rounded(upright.corners() + 2),
        table="classic24:ohta",
    )  # fmt: skip
    shrunk = upright.corners() + 0.7 * 24 * np.array([[1, 0], [-1, 0], [-1, 0], [1, 0]])
    yield pose(
        "kept", "No borders where the corners say: they are kept, since the colours agree.", "chart-turned-0.dng",
        photo, rounded(shrunk),
    )  # fmt: skip
    card = own_card()
    own = file(drawn_upright(card_kind(card), 24))
    block = np.array([[31.5, 31.5], [195.5, 31.5], [195.5, 147.5], [31.5, 147.5]])
    marks = np.array([[7.9, 7.9], [219.1, 7.9], [219.1, 171.1], [7.9, 171.1]])
    yield pose(
        "own-layout", "A chart of the user's own layout; `table` is not read.", "finder-card.dng", own,
        rounded(block + 1.5), table="", card=card,
    )  # fmt: skip
    yield pose(
        "own-layout-fiducials", "The corners are the layout's fiducials, from the third.", "finder-card.dng", own,
        rounded(np.roll(marks, -2, axis=0) + 1), table="", card=card,
    )  # fmt: skip
    nowhere = [[40, 40], [80, 40], [80, 66], [40, 66]]
    yield pose(
        "error-elsewhere", "Corners inside the chart: the colours do not agree.", "chart-turned-0.dng", photo,
        nowhere, expect="chart_not_found",
    )  # fmt: skip
    yield pose(
        "error-mirrored", "A mirrored chart.", "chart-mirrored.dng", file(draw(upright, mirrored=True)),
        rounded(upright.corners()), expect="chart_not_found",
    )  # fmt: skip
    small = turned(8, 0, margin=8)
    yield pose(
        "error-small", "A photo of 56 × 40 px.", "chart-small.dng", file(draw(small)), rounded(small.corners()),
        expect="chart_not_found",
    )  # fmt: skip
    wrong: dict[str, tuple[str, Sequence[Any]]] = {
        "outside": ("A corner outside the photo.", [[-5, 0], [100, 0], [100, 90], [0, 90]]),
        "crossed": ("Corners that cross.", [[10, 10], [100, 10], [10, 90], [100, 90]]),
        "three": ("Three corners.", [[10, 10], [100, 10], [100, 90]]),
        "nan": ("A corner that is no number.", [[10, 10], ["NaN", 10], [100, 90], [10, 90]]),
    }
    for name, (comment, corners) in wrong.items():
        yield pose(
            f"error-{name}", comment, "chart-turned-0.dng", photo, list(corners), expect="invalid_argument",
        )  # fmt: skip


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


LIMITS = (
    *each("norm", 1e-9, "corners quads"),
    *each("exact", 0.0, "quarter_turns"),
    *each("norm", 1e-9, "score"),
    *each("exact", 0.0, "kept"),
)


STAGE = Stage(
    name="pose",
    keys=Keys(
        words("dng table corners"),
        words("corners quads quarter_turns score kept"),
        optional=words("layout csv"),
        arrays=words("corners"),
    ),
    requires=always("pose"),
    cases=cases,
    run=run,
    limits=against_stored(LIMITS),
)
