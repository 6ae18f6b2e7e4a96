"""Compares the curves of two results, relative to their bands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.documents.document import Document, answer_in
from camssf.grid import CHANNELS, WAVELENGTHS, Floats
from camssf.report.sections.text import signed

VISIBLE = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
LIMIT = 2.2
"""In standard deviations of the difference, assuming independent errors: two results of one camera stay below it at
all wavelengths of all channels in 95 of 100 cases."""
SMALLEST_MOVE = 1.0
"""nm; smaller shifts of a peak are not in the sentences."""


@dataclass(frozen=True)
class Comparison:
    """The difference between two results' curves.

    `std` adds the two bands in squares. What the two have in common (a chart's or a lamp's table, and for one unit
    what its photos do not show) cancels in the difference, so `std` is too large and |z| too small: a large |z| is a
    difference, a small one does not prove that the curves are equal. Neighbouring wavelengths are not independent.

    Attributes:
        headline: which channels differ, and in which no difference was found.
        channels: one sentence for each channel, on its worst difference from 400 to 700 nm.
        difference: (681, 3) the first result's curves minus the other's, peak = 1.
        std: (681, 3) standard deviation of the difference, as if the two had no error in common; None without bands.
        peak_moved: (3,) move of each channel's peak, nm.
    """

    headline: str
    channels: tuple[str, ...]
    difference: Floats
    std: Floats | None
    peak_moved: Floats

    @property
    def z(self) -> Floats | None:
        """(681, 3) `difference` over `std`; None without bands."""
        return None if self.std is None else in_deviations(self.difference, self.std)

    def __str__(self) -> str:
        return " ".join([self.headline, *self.channels])


def compare(result: Document, other: Document) -> Comparison:
    """The comparison of two results.

    Raises:
        InvalidArgument: one of them was refused and has no curves, or is no document.
    """
    first, second = answer_in(result), answer_in(other)
    ours, theirs = first.curves.values, second.curves.values
    off = ours - theirs
    std = None if first.std is None or second.std is None else np.hypot(first.std.values, second.std.values)
    most = np.where(VISIBLE[:, None], np.abs(off), -1.0).argmax(axis=0)
    moved = WAVELENGTHS[ours.argmax(axis=0)] - WAVELENGTHS[theirs.argmax(axis=0)]
    sizes = unseen = None
    if std is not None:
        unseen = LIMIT * std[VISIBLE].max(axis=0)
        sizes, most = worst_of(off, std)
    sentences = tuple(
        _sentence(
            i,
            float(off[k, i]),
            float(WAVELENGTHS[k]),
            None if sizes is None else float(sizes[i]),
            float(moved[i]),
            None if unseen is None else float(unseen[i]),
        )
        for i, k in enumerate(most)
    )
    return Comparison(_headline(sizes, unseen), sentences, off, std, moved)


def in_deviations(off: Floats, std: Floats) -> Floats:
    """Differences over their standard deviations; infinite where a deviation is 0 and the difference is not."""
    return np.divide(off, std, out=np.where(off == 0, 0.0, np.copysign(np.inf, off)), where=std > 0)


def worst_of(off: Floats, std: Floats) -> tuple[Floats, np.ndarray]:
    """The largest |difference| / standard deviation of each channel, and its index on the grid.

    Args:
        off: (681, 3) one result's curves minus the other's.
        std: (681, 3) its standard deviation; where it is 0, any difference counts as infinite.
    """
    size = np.where(VISIBLE[:, None], np.abs(in_deviations(off, std)), -1.0)
    return np.asarray(size.max(axis=0)), size.argmax(axis=0)


def _headline(sizes: Floats | None, unseen: Floats | None) -> str:
    """The channels that differ, and those without a difference with the largest one that would not be seen.

    Args:
        sizes: (3,) worst differences in standard deviations; None without bands.
        unseen: (3,) LIMIT standard deviations at each channel's most uncertain wavelength, in parts of the peak.
    """
    if sizes is None or unseen is None:
        return "One of the two has no band: whether they differ by more than chance cannot be said."
    differ = [name for name, size in zip(CHANNELS, sizes, strict=True) if size > LIMIT]
    if len(differ) == len(CHANNELS):
        return "The curves differ in all three channels."
    same = [name for name in CHANNELS if name not in differ]
    blind = max(limit for name, limit in zip(CHANNELS, unseen, strict=True) if name in same)
    where = _listed(same) if differ else "any channel"
    words = f"no difference was found in {where}; up to {_short(blind, 2)} of the peak cannot be seen."
    return f"The curves differ in {_listed(differ)}; {words}" if differ else words[0].upper() + words[1:]


def _listed(names: list[str]) -> str:
    return " and ".join(names)


def _sentence(channel: int, off: float, nm: float, size: float | None, moved: float, unseen: float | None) -> str:
    """A sentence on the worst difference of a channel."""
    name = CHANNELS[channel].capitalize()
    by = f"{'more' if off > 0 else 'less'} by {_short(abs(off), 2)} of the peak at {nm:.1f} nm"
    words = f"{name}: {by}"
    if size is not None and unseen is not None:
        words = f"{name} differs: {by}, {size:.1f} standard deviations"
        if size <= LIMIT:
            largest = f"the largest is {by}" if off else "the curves are the same"
            words = f"{name}: no difference found, up to {_short(unseen, 2)} of the peak cannot be seen; {largest}"
    if abs(moved) >= SMALLEST_MOVE:
        words += f"; its peak moved by {signed(moved)} nm"
    return f"{words}."


def _short(value: float, digits: int) -> str:
    """A number with significant digits, without an exponent."""
    return np.format_float_positional(value, precision=digits, fractional=False, trim="-")
