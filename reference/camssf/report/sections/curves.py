"""The curves of a result as drawn, with their bands and the positions of their labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.documents.document import Document, answer_in
from camssf.grid import CHANNELS, WAVELENGTHS, Floats
from camssf.report.sections.bands import possible

NODE = 10
"""Grid steps between the values of a learned basis: 5 nm."""
LABEL = 70.0
"""Width of a peak's label on a plot of usual size, nm."""
STRAIGHT = 0.005
"""Largest distance from the straight lines, less than a line's width."""
NEARLY = 0.015
"""Phones were measured every 10 nm; their values in between differ by less than this from the neighbours' mean."""


@dataclass(frozen=True)
class DrawnCurves:
    """The drawn curves; each array (681, 3), columns red, green, blue.

    Attributes:
        ssf: the curves, peak = 1; negative values are set to 0 if there is a band.
        low, high: the 95 % band; None if the basis gives none.
        truth: measured curves, or None.
    """

    ssf: Floats
    low: Floats | None
    high: Floats | None
    truth: Floats | None

    def limits(self) -> tuple[float, float]:
        """Range of the response axis: all curves from -1 to 2, bands up to 1.3, the peaks' labels above them."""
        low = min(0.0, float(self.ssf.min()))
        if self.truth is not None:
            low = min(low, float(self.truth.min()))
        return max(low, -1.0) - 0.02, self._top() + 0.09

    def _top(self) -> float:
        """The largest drawn value."""
        tops = [1.0]
        if self.truth is not None:
            tops.append(min(float(self.truth.max()), 2.0))
        if self.high is not None:
            tops.append(min(float(self.high.max()), 1.3))
        return max(tops)

    def peak_labels(self) -> list[tuple[str, float, float]]:
        """(text, nm, response) of the middle of each peak's label: above the bands, and beside each other."""
        nm = WAVELENGTHS[self.ssf.argmax(axis=0)]
        order = np.argsort(nm, kind="stable")
        at = nm[order]
        for _ in range(8):  # moved apart, the outer ones away from the middle one
            lack = np.maximum(LABEL - np.diff(at), 0.0) / 2.0
            at = at + np.array([-lack[0], lack[0] - lack[1], lack[1]])
            at = np.clip(at, *(WAVELENGTHS[[0, -1]] + np.array([1, -1]) * LABEL / 2.0))
        places = dict(zip(order.tolist(), at.tolist(), strict=True))
        top = self._top() + 0.025
        return [(f"{colour} {nm[i]:.0f} nm", places[i], top) for i, colour in enumerate(CHANNELS)]

    def smooth(self) -> DrawnCurves:
        """The curves as lines to draw: smooth between the values of a learned basis, which straight lines join.

        They neither overshoot nor move a peak (Fritsch and Carlson, 1980).
        """
        step = _knots(self.ssf)
        if step is None:
            return self
        at = WAVELENGTHS[::step]
        ssf, low, high = (
            None if curve is None else _monotone(at, curve[::step]) for curve in (self.ssf, self.low, self.high)
        )
        assert ssf is not None
        return DrawnCurves(ssf, low, high, self.truth)


def _monotone(x: Floats, y: Floats) -> Floats:
    """Monotone cubic interpolation of y (n, 3) at even nodes x (n,) onto the grid (Fritsch and Butland, 1984)."""
    h = x[1] - x[0]
    d = np.diff(y, axis=0) / h
    left, right = d[:-1], d[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.where(left * right > 0, 2.0 / (1.0 / left + 1.0 / right), 0.0)
    slope = np.concatenate([_end_slope(d[0], d[1])[None], inner, _end_slope(d[-1], d[-2])[None]])
    i = np.minimum(((WAVELENGTHS - x[0]) / h).astype(int), len(x) - 2)
    t = ((WAVELENGTHS - x[i]) / h)[:, None]
    cubic = (1 + 2 * t) * (1 - t) ** 2 * y[i] + t * (1 - t) ** 2 * h * slope[i]
    return np.asarray(cubic + t * t * (3 - 2 * t) * y[i + 1] + t * t * (t - 1) * h * slope[i + 1])


def _end_slope(first: Floats, second: Floats) -> Floats:
    """Slope at an end from the two nearest secants: of their parabola, limited so that it does not overshoot."""
    slope = (3.0 * first - second) / 2.0
    slope = np.where(np.sign(slope) != np.sign(first), 0.0, slope)
    turns = (np.sign(first) != np.sign(second)) & (np.abs(slope) > 3.0 * np.abs(first))
    return np.where(turns, 3.0 * first, slope)


def curves_of(document: Document) -> DrawnCurves:
    """A result's curves, bands and truth."""
    answer = answer_in(document)
    ssf, low, high = answer.curves.values, None, None
    if answer.std is not None:
        low, high = possible(ssf, answer.std.values)
        ssf = np.maximum(ssf, 0.0)  # a posterior mean may be negative, a sensitivity may not
    return DrawnCurves(ssf, low, high, None if document.truth is None else document.truth.curves.values)


def _knots(curves: Floats) -> int | None:
    """Grid steps between values with straight lines between them; None if there are none."""
    nodes = curves[::NODE]
    lines = np.stack([np.interp(WAVELENGTHS, WAVELENGTHS[::NODE], values) for values in nodes.T], axis=1)
    if np.abs(lines - curves).max() > STRAIGHT:  # a curve set to 0 where it was negative bends between two nodes
        return None
    off = np.abs(nodes[1::2] - 0.5 * (nodes[:-1:2] + nodes[2::2])).max()
    return 2 * NODE if off < NEARLY else NODE
