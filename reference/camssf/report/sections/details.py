"""The detail sections: assumptions, facts of each shot, all numbers of all patches, hashes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from camssf.documents.unnamed_light import lamp_name
from camssf.report.sections.text import Json, brief, number, words


@dataclass(frozen=True)
class Assumed:
    """A sentence and its code for programs; "" if it has none."""

    text: str
    code: str


def assumptions_of(document: Json) -> tuple[Assumed, ...]:
    """The document's assumptions; chart table and lamps are always listed."""
    chart, codes = document["chart"], {entry["code"] for entry in document["assumptions"]}
    items = []
    if "chart_table" not in codes:
        items.append(Assumed(f"Chart table: {chart['table']}. {chart['source']}", ""))
    for lamp in [shot["lamp"] for shot in document["shots"]] if "lamp" not in codes else ():
        if lamp["tolerance"] is None:
            items.append(Assumed(f"Lamp: {lamp['name']}. {lamp['source']}", ""))
            continue
        tolerance = brief(100 * lamp["tolerance"])
        told = f"Lamp: {lamp['name']}, taken for right to {tolerance} % (one standard deviation). {lamp['source']}"
        items.append(Assumed(told, ""))
    return (*items, *(Assumed(entry["message"], entry["code"]) for entry in document["assumptions"]))


def details_of(document: Json) -> tuple[tuple[str, tuple[Markup, ...]], ...]:
    """Photo settings and chart detection of each shot: rows of a term and its value for each shot."""
    return tuple((name, tuple(words(find(shot)) for shot in document["shots"])) for name, find in _DETAILS)


def _share(shot: Json, key: str) -> str:
    """The largest share and its patch."""
    if not shot["patches"]:
        return "not measured"
    worst = max(shot["patches"], key=lambda patch: max(patch[key]))
    share = max(worst[key])
    return "none" if share == 0 else f"{number(100 * share, 2)} % ({worst['name']})"


def _exposure(seconds: float | None) -> str:
    if seconds is None:
        return "not stated"
    return f"1/{1 / seconds:.0f} s" if 0 < seconds < 0.4 else f"{number(seconds)} s"


def _shading_map(shot: Json) -> str:
    if not shot["photo"]["gain_map"]:
        return "none"
    return "applied" if shot.get("lens_shading") == "apply" else "not applied"


_DETAILS: tuple[tuple[str, Callable[[Json], Any]], ...] = (
    ("Camera in the file", lambda s: s["photo"]["camera"] or "not stated"),
    ("Lamp", lamp_name),
    ("White reference", lambda s: s["white_reference"] + (f": {s['white']['name']}" if s["white"] else "")),
    ("Dark reference", lambda s: s["dark_reference"] + (f": {s['dark']['name']}" if s["dark"] else "")),
    ("Exposure", lambda s: _exposure(s["photo"]["exposure"])),
    ("ISO", lambda s: "not stated" if s["photo"]["iso"] is None else f"{s['photo']['iso']:g}"),
    ("Active area, px", lambda s: f"{s['photo']['width']:g} × {s['photo']['height']:g}"),
    ("TIFF orientation", lambda s: f"{s['photo']['orientation']:g}"),
    ("Lens-shading map", _shading_map),
    ("White level, DN", lambda s: f"{s['saturation']:g}"),
    ("Chart layout", lambda s: s["pose"]["layout"] if s["pose"] else "–"),
    (
        "Chart found",
        lambda s: f"{s['pose']['method']}, {90 * s['pose']['quarter_turns']:g}° from upright" if s["pose"] else "no",
    ),
    ("Agreement with the chart's colours", lambda s: number(s["pose"]["score"]) if s["pose"] else "–"),
    ("Largest clipped share", lambda s: _share(s, "clipped")),
    ("Largest rejected share (dust, hot pixels)", lambda s: _share(s, "dead")),
    ("Notes", lambda s: Markup("<br>").join(map(words, s["pose"]["notes"] if s["pose"] else ())) or "none"),
)


# Every number


_PLAIN = (
    ("signal", "signal", 1.0, 4),
    ("standard_error", "standard error", 1.0, 2),
    ("predicted", "predicted", 1.0, 4),
    ("predicted_std", "its std", 1.0, 2),
    ("unseen", "unseen", 1.0, 4),
    ("unseen_std", "its std", 1.0, 2),
    ("chart", "chart, DN", 1.0, 5),
    ("white", "white, DN", 1.0, 5),
    ("dark", "dark, DN", 1.0, 5),
    ("clipped", "clipped, %", 100.0, 2),
    ("dead", "rejected, %", 100.0, 2),
    ("gradient", "gradient, %", 100.0, 2),
)
NUMBERS = ("Patch", *(word for _, word, _, _ in _PLAIN))
"""Columns of `numbers_of`."""


@dataclass(frozen=True)
class PatchNumbers:
    """All numbers of one patch; each cell has red, green and blue."""

    name: str
    used: bool
    cells: tuple[Markup, ...]


def numbers_of(shot: Json) -> tuple[PatchNumbers, ...]:
    """The numbers of each patch of a shot."""
    return tuple(
        PatchNumbers(
            patch["name"],
            patch["used"],
            tuple(
                Markup("–")
                if patch.get(key) is None
                else Markup("<br>").join(number(factor * value, digits) for value in patch[key])
                for key, _, factor, digits in _PLAIN
            ),
        )
        for patch in shot["patches"]
    )


def hashes_of(document: Json) -> tuple[tuple[str, str], ...]:
    """SHA-256 of each input and of the model."""
    inputs, model = document["hashes"]["inputs"], document["hashes"]["model"]
    return (*((name, inputs[name]) for name in sorted(inputs)), ("ONNX model", model or "not used"))
