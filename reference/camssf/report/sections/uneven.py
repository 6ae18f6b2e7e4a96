"""The section of uneven light: the estimated illumination of the patches without a white frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.report.sections.photos import ring, upright
from camssf.report.shots import ShownShot

DARKEST, BRIGHTEST = 25.0, 95.0
"""Lightness of the dimmest and the brightest patch in a drawing, %."""
DIMMEST = 0.01
"""Smallest level that is drawn, because a result may hold 0."""
EVEN = 0.005
"""Light with a smaller range is treated as even and not drawn."""


@dataclass(frozen=True)
class Patch:
    """One patch: name, outline, centre, drawn lightness, and its light relative to the white patch as text."""

    name: str
    ring: str
    x: float
    y: float
    lightness: float
    text: str


@dataclass(frozen=True)
class Fall:
    """The light over one shot's chart.

    Attributes:
        view: SVG viewBox.
        size: of the text.
        patches: of the chart.
        least, most: smallest and largest light on a patch relative to the white patch, as text.
    """

    view: str
    size: float
    patches: tuple[Patch, ...]
    least: str
    most: str


def fall_of(shot: ShownShot) -> Fall | None:
    """The light of a shot; None if it is even or was not estimated."""
    patches, pose, photo = shot.patches, shot.pose, shot.photo
    if pose is None or patches is None:
        return None
    light = 1.0 / np.maximum(patches.level, DIMMEST)
    if np.ptp(light) < EVEN:
        return None
    quads = upright(pose.patches, photo.width, photo.height, photo.orientation)
    low, high = quads.min(axis=(0, 1)), quads.max(axis=(0, 1))
    margin = 0.03 * float((high - low).max())
    pitch = float(np.sqrt(np.abs(np.prod(high - low)) / len(quads)))
    share = (light - light.min()) / np.ptp(light)
    drawn = tuple(
        Patch(
            name,
            ring(quad),
            float(quad[:, 0].mean()),
            float(quad[:, 1].mean()),
            DARKEST + (BRIGHTEST - DARKEST) * float(part),
            _words(float(value)),
        )
        for name, quad, part, value in zip(patches.names, quads, share, light, strict=True)
    )
    view = " ".join(f"{v:.1f}" for v in [*(low - margin), *(high - low + 2 * margin)])
    return Fall(view, 0.24 * pitch, drawn, _words(float(light.min())), _words(float(light.max())))


def _words(light: float) -> str:
    return f"{100.0 * light - 100.0:+.0f} %".replace("-", "\u2212")
