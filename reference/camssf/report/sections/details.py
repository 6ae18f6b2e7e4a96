"""The detail sections: assumptions, facts of each shot, all numbers of all patches, hashes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from camssf.documents.document import Document
from camssf.documents.unnamed_light import lamp_name
from camssf.photo.capture import Photo
from camssf.photo.signals import Assumption
from camssf.report.sections.text import brief, number, words
from camssf.report.shots import ShownShot
from camssf.spectra import Lamp


def assumptions_of(document: Document) -> tuple[Assumption, ...]:
    """The document's assumptions; chart table and lamps are always listed, without a code if a refusal lacks them."""
    items, codes = [], {entry.code for entry in document.assumptions}
    capture = document.capture
    if capture is not None and "chart_table" not in codes:
        items.append(Assumption("", f"Chart table: {capture.chart.table}. {capture.chart.source}"))
    for lamp in capture.lights if capture is not None and "lamp" not in codes else ():
        words = lamp.name
        if isinstance(lamp, Lamp):
            words += f", taken for right to {brief(100 * lamp.tolerance)} % (one standard deviation)"
        items.append(Assumption("", f"Lamp: {words}. {lamp.source}"))
    return (*items, *document.assumptions)


def details_of(shots: Sequence[ShownShot]) -> tuple[tuple[str, tuple[Markup, ...]], ...]:
    """Photo settings and chart detection of each shot: rows of a term and its value for each shot."""
    return tuple((name, tuple(words(find(shot)) for shot in shots)) for name, find in _DETAILS)


def _share(shot: ShownShot, name: str) -> str:
    """The largest share and its patch."""
    if shot.patches is None:
        return "not measured"
    shares = getattr(shot.patches, name).max(axis=1)
    worst = int(shares.argmax())
    return "none" if shares[worst] == 0 else f"{number(100 * shares[worst], 2)} % ({shot.patches.names[worst]})"


def _reference(shot: ShownShot, role: str, instead: str) -> str:
    """The frame of a role with its file, or what was taken instead."""
    frame: Photo | None = getattr(shot.measured, role) if shot.measured else None
    if frame is None:
        return instead
    used = shot.measured is not None and getattr(shot.measured.means, role) is not None
    return f"{role} frame: {frame.name}" if used else f"{instead}: {frame.name}"


def _exposure(seconds: float | None) -> str:
    if seconds is None:
        return "not stated"
    return f"1/{1 / seconds:.0f} s" if 0 < seconds < 0.4 else f"{number(seconds)} s"


def _shading_map(shot: ShownShot) -> str:
    if not shot.photo.gain_map:
        return "none"
    return "applied" if shot.measured is not None and shot.measured.lens_shading == "apply" else "not applied"


_DETAILS: tuple[tuple[str, Callable[[ShownShot], Any]], ...] = (
    ("Camera in the file", lambda s: " ".join(filter(None, (s.photo.make, s.photo.model))) or "not stated"),
    ("Lamp", lambda s: lamp_name(s.lamp)),
    ("White reference", lambda s: _reference(s, "white", "white patch")),
    ("Dark reference", lambda s: _reference(s, "dark", "black level")),
    ("Exposure", lambda s: _exposure(s.photo.exposure)),
    ("ISO", lambda s: "not stated" if s.photo.iso is None else f"{s.photo.iso:g}"),
    ("Active area, px", lambda s: f"{s.photo.width} × {s.photo.height}"),
    ("TIFF orientation", lambda s: f"{s.photo.orientation}"),
    ("Lens-shading map", _shading_map),
    ("White level, DN", lambda s: f"{s.saturation:g}"),
    ("Chart layout", lambda s: s.pose.layout if s.pose else "–"),
    ("Chart found", lambda s: f"{s.pose.method}, {90 * s.pose.quarter_turns}° from upright" if s.pose else "no"),
    ("Agreement with the chart's colours", lambda s: number(s.pose.score) if s.pose else "–"),
    ("Largest clipped share", lambda s: _share(s, "clipped")),
    ("Largest rejected share (dust, hot pixels)", lambda s: _share(s, "dead")),
    ("Notes", lambda s: Markup("<br>").join(map(words, s.pose.notes if s.pose else ())) or "none"),
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


def numbers_of(shot: ShownShot) -> tuple[PatchNumbers, ...]:
    """The numbers of each patch of a shot."""
    patches = shot.patches
    if patches is None:
        return ()
    columns = [(getattr(patches, name), factor, digits) for name, _, factor, digits in _PLAIN]
    return tuple(
        PatchNumbers(
            name,
            bool(patches.used[i]),
            tuple(
                Markup("–")
                if np.isnan(rows[i]).any()
                else Markup("<br>").join(number(factor * value, digits) for value in rows[i].tolist())
                for rows, factor, digits in columns
            ),
        )
        for i, name in enumerate(patches.names)
    )


def hashes_of(document: Document) -> tuple[tuple[str, str], ...]:
    """SHA-256 of each input, of the model, and of the basis."""
    inputs = {} if document.capture is None else document.capture.hashes
    answer = document.answer
    model, basis = (None, None) if answer is None else (answer.model, answer.basis_sha256)
    stated = () if basis is None else (("basis", basis),)
    return (*((name, inputs[name]) for name in sorted(inputs)), ("ONNX model", model or "not used"), *stated)
