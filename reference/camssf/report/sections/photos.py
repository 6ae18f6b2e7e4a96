"""The photo section: outlines of the patches on the photo, shown upright."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from camssf.grid import Floats
from camssf.report.sections.patches import hexed
from camssf.report.shots import ShownPatches, ShownShot
from camssf.verdict.reasons import Reason


@dataclass(frozen=True)
class Name:
    """A patch's name inside its outline: lines of text with their positions; `light` for a light patch."""

    light: bool
    lines: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True)
class ShownPhoto:
    """One photo on the page.

    Attributes:
        name: file name.
        width, height: as shown. size: of the active area, px.
        data: data URI of the picture; "" if there is none.
        matrix: SVG matrix from the active area to the shown picture.
        placed: whether the chart was found; if not, pixel coordinates are shown.
        view: SVG viewBox of the close-up.
        chart: the chart's outline.
        outlines: name, outline and the table's colour of each patch, and whether the verdict blames it.
        blamed: names of those that it blames.
        names, name_size: texts inside the outlines, and their size.
        step: distance of the numbered lines, px.
    """

    name: str
    width: int
    height: int
    size: tuple[int, int]
    data: str
    matrix: str
    placed: bool
    view: str = ""
    chart: str = ""
    outlines: tuple[tuple[str, str, str, bool], ...] = ()
    blamed: tuple[str, ...] = ()
    names: tuple[Name, ...] = ()
    name_size: float = 0.0
    step: int = 0


def media_type(image: bytes) -> str | None:
    """The media type of a JPEG or PNG; None for anything else."""
    if image.startswith(b"\xff\xd8\xff"):
        return "image/jpeg"
    return "image/png" if image.startswith(b"\x89PNG\r\n\x1a\n") else None


def photo_of(shot: ShownShot, preview: bytes | None, reasons: Sequence[Reason]) -> ShownPhoto | None:
    """The photo of a shot; None without a chart pose and without a picture.

    Patches that one of the verdict's `reasons` names are marked.
    """
    blamed = {reason.arguments.get("patch") for reason in reasons if reason.arguments.get("shot") == shot.number}
    photo, pose, patches = shot.photo, shot.pose, shot.patches
    width, height, orientation = photo.width, photo.height, photo.orientation
    data = "" if preview is None else f"data:{media_type(preview)};base64,{base64.b64encode(preview).decode()}"
    if pose is None:
        # Not rotated: corners given by hand are in these pixel coordinates.
        steps = (50, 100, 200, 500, 1000, 2000, 5000, 10_000)
        step = next(s for s in steps if max(width, height) / s <= 9 or s == 10_000)
        turn = " ".join(map(str, _turn(width, height, 1)))
        return ShownPhoto(photo.name, width, height, (width, height), data, turn, False, step=step) if data else None
    shown = (height, width) if orientation >= 5 else (width, height)
    quads = upright(pose.patches, width, height, orientation)
    corners = upright(pose.corners, width, height, orientation)
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = max(1.0, 0.06 * (high - low).max())
    names, size = ((), 0.0) if patches is None else _names(patches, quads)
    return ShownPhoto(
        photo.name,
        *shown,
        (width, height),
        data,
        " ".join(map(str, _turn(width, height, orientation))),
        True,
        view=" ".join(f"{v:.1f}" for v in [*(low - margin), *(high - low + 2 * margin)]),
        chart=ring(corners),
        outlines=()
        if patches is None
        else tuple(
            (name, ring(quad), hexed(colour), name in blamed)
            for name, colour, quad in zip(patches.names, patches.reflectance_srgb, quads, strict=True)
        ),
        blamed=() if patches is None else tuple(name for name in patches.names if name in blamed),
        names=names,
        name_size=size,
    )


def upright(points: Any, width: int, height: int, orientation: int) -> Floats:
    """Convert active-area px to display px by the TIFF orientation; sample centres move from 0 to 0.5."""
    a, b, c, d, e, f = _turn(width, height, orientation)
    p = np.asarray(points, dtype=np.float64) + 0.5
    return np.stack([a * p[..., 0] + c * p[..., 1] + e, b * p[..., 0] + d * p[..., 1] + f], axis=-1)


def _turn(width: int, height: int, orientation: int) -> tuple[int, int, int, int, int, int]:
    """The SVG matrix a b c d e f of a TIFF orientation (TIFF 6.0, tag 274)."""
    w, h = width, height
    return {
        1: (1, 0, 0, 1, 0, 0),
        2: (-1, 0, 0, 1, w, 0),
        3: (-1, 0, 0, -1, w, h),
        4: (1, 0, 0, -1, 0, h),
        5: (0, 1, 1, 0, 0, 0),
        6: (0, 1, -1, 0, h, 0),
        7: (0, -1, -1, 0, h, w),
        8: (0, -1, 1, 0, 0, w),
    }[orientation]


def ring(points: Floats) -> str:
    """An outline as SVG points."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _names(patches: ShownPatches, quads: Floats) -> tuple[tuple[Name, ...], float]:
    """The patches' names, one word per line, in one size that fits all patches; "(.23 D)" is left out."""
    words = [(re.sub(r"\(.*?\)", "", name)[:40].split() or ["?"])[:3] for name in patches.names]
    diagonals = quads[:, 2:] - quads[:, :2]
    area = np.abs(diagonals[:, 0, 0] * diagonals[:, 1, 1] - diagonals[:, 0, 1] * diagonals[:, 1, 0]) / 2
    longest = max(max(map(len, lines)) for lines in words)
    size = math.sqrt(float(np.median(area))) * min(0.24, 1.5 / longest, 0.8 / max(map(len, words)))
    names = []
    for colour, lines, (x, y) in zip(patches.reflectance_srgb, words, quads.mean(axis=1), strict=True):
        light = bool(np.dot(colour, (0.2126, 0.7152, 0.0722)) > 0.6)
        first = y - size * 1.05 * (len(lines) - 1) / 2 + size * 0.35
        names.append(Name(light, tuple((w, float(x), float(first + 1.05 * size * k)) for k, w in enumerate(lines))))
    return tuple(names), size
