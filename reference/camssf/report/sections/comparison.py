"""The comparison section: differences between two results' curves, relative to their bands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from camssf.grid import CHANNELS, WAVELENGTHS, Floats, columns
from camssf.report.notebook import lamps_of
from camssf.report.sections.drawings import Plot, difference_plot
from camssf.report.sections.text import BAND, Json, camera_name, number, signed

VISIBLE = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
LIMIT = 2.2
"""In standard deviations of the difference, assuming independent errors: two results of one camera stay below it at
all wavelengths of all channels in 95 of 100 cases."""
SMALLEST_MOVE = 1.0
"""nm; smaller shifts of a peak are shown only in the table, not in the sentences."""


@dataclass(frozen=True)
class Comparison:
    """The difference between a result and another one.

    Attributes:
        name: file name of the other result. camera, facts: its camera, verdict, lamps, basis and chart.
        same: whether both state the same camera.
        headline: which channels agree and which differ.
        channels: one sentence for each channel, on its worst difference.
        banded: whether both have a band.
        rows: differences for red, green and blue.
        plot: the difference of the curves.
    """

    name: str
    camera: str
    facts: str
    same: bool
    headline: str
    channels: tuple[str, ...]
    banded: bool
    rows: tuple[tuple[str, tuple[Markup, ...]], ...]
    plot: Plot


def comparison_of(document: Json, other: Json | None, name: str) -> Comparison | None:
    """The comparison of two documents; None if there is no other document, or this one has no curves."""
    if other is None or "ssf" not in document:
        return None
    ours, theirs = columns(document["ssf"]), columns(other["ssf"])
    off = ours - theirs
    stds = [columns(each["ssf_std"]) if each.get("ssf_std") else None for each in (document, other)]
    std = None if stds[0] is None or stds[1] is None else np.hypot(stds[0], stds[1])
    most = np.where(VISIBLE[:, None], np.abs(off), -1.0).argmax(axis=0)
    moved = WAVELENGTHS[ours.argmax(axis=0)] - WAVELENGTHS[theirs.argmax(axis=0)]
    gains = np.array(document["channel_gain"]) / np.array(other["channel_gain"])
    rows = [
        ("Root mean square, 400 to 700 nm, peak = 1", [number(float(v), 2) for v in _rms(off[VISIBLE])]),
        ("Largest difference, peak = 1", [number(float(off[k, i]), 2) for i, k in enumerate(most)]),
        ("at, nm", [Markup(f"{WAVELENGTHS[k]:.1f}") for k in most]),
    ]
    sizes = None
    if std is not None:
        sizes, most = worst_of(off, std)
        within = (np.abs(off) <= BAND * std)[VISIBLE].mean(axis=0)
        rows += [
            ("Worst, standard deviations", [number(float(v), 2) for v in sizes]),
            ("at, nm", [Markup(f"{WAVELENGTHS[k]:.1f}") for k in most]),
            ("Inside the 95 % interval", [Markup(f"{100 * v:.0f} %") for v in within]),
        ]
    rows += [
        ("Peak moved by, nm", [Markup(signed(v)) for v in moved.tolist()]),
        ("Channel gain, relative to the other's", [number(float(v), 4) for v in gains]),
    ]
    return Comparison(
        name,
        camera_name(other),
        f"{other['verdict']['status']}, {lamps_of(other)}, basis {other['basis']}, chart {other['chart']['table']}",
        camera_name(other) == camera_name(document),
        _headline(sizes),
        tuple(
            _sentence(i, float(off[k, i]), float(WAVELENGTHS[k]), None if sizes is None else float(sizes[i]), move)
            for i, (k, move) in enumerate(zip(most, moved.tolist(), strict=True))
        ),
        std is not None,
        tuple((word, tuple(cells)) for word, cells in rows),
        difference_plot(off, None if std is None else BAND * std, "difference"),
    )


def worst_of(off: Floats, std: Floats) -> tuple[Floats, np.ndarray]:
    """The largest |difference| / standard deviation of each channel, and its index on the grid.

    Args:
        off: (681, 3) one result's curves minus the other's.
        std: (681, 3) its standard deviation; where it is 0, any difference counts as infinite.
    """
    size = np.divide(np.abs(off), std, out=np.where(off == 0, 0.0, np.inf), where=std > 0)
    size = np.where(VISIBLE[:, None], size, -1.0)
    return np.asarray(size.max(axis=0)), size.argmax(axis=0)


def _headline(sizes: Floats | None) -> str:
    if sizes is None:
        return "One of the two has no band: whether they differ by more than chance cannot be said."
    agree = [name for name, size in zip(CHANNELS, sizes, strict=True) if size <= LIMIT]
    differ = [name for name in CHANNELS if name not in agree]
    if not differ:
        return "The curves agree in all three channels."
    if not agree:
        return "The curves differ in all three channels."
    return f"The curves agree in {' and '.join(agree)} and differ in {' and '.join(differ)}."


def _sentence(channel: int, off: float, nm: float, size: float | None, moved: float) -> str:
    """A sentence on the worst difference of a channel."""
    name = CHANNELS[channel].capitalize()
    by = f"{'more' if off > 0 else 'less'} by {number(abs(off), 2)} of the peak at {nm:.1f} nm"
    words = f"{name}: {by}"
    if size is not None:
        words = f"{name} {'agrees' if size <= LIMIT else 'differs'}: {by}, {size:.1f} standard deviations"
    if abs(moved) >= SMALLEST_MOVE:
        words += f"; its peak moved by {signed(moved)} nm"
    return f"{words}."


def _rms(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
