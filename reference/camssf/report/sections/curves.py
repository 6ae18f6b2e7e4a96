"""The curves of a document as drawn, with their bands and the positions of their labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.grid import CHANNELS, WAVELENGTHS, Floats, columns
from camssf.report.sections.bands import possible
from camssf.report.sections.text import Json

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
        """Range of the response axis: it holds all curves, bands up to 1.3, and the peaks' labels above them."""
        low = min(0.0, float(self.ssf.min()))
        if self.truth is not None:
            low = min(low, float(self.truth.min()))
        return low - 0.02, self._top() + 0.09

    def _top(self) -> float:
        """The largest drawn value."""
        found = [1.0]
        if self.truth is not None:
            found.append(float(self.truth.max()))
        if self.high is not None:
            found.append(min(float(self.high.max()), 1.3))
        return max(found)

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
        from scipy.interpolate import PchipInterpolator

        step = _knots(self.ssf)
        if step is None:
            return self
        at = WAVELENGTHS[::step]
        ssf, low, high = (
            None if each is None else np.asarray(PchipInterpolator(at, each[::step], axis=0)(WAVELENGTHS))
            for each in (self.ssf, self.low, self.high)
        )
        assert ssf is not None
        return DrawnCurves(ssf, low, high, self.truth)


def curves_of(document: Json) -> DrawnCurves:
    """A document's curves, bands and truth."""
    ssf = columns(document["ssf"])
    std, truth = document.get("ssf_std"), document.get("truth")
    low, high = possible(ssf, columns(std)) if std else (None, None)
    if std:
        ssf = np.maximum(ssf, 0.0)  # a posterior mean may be negative, a sensitivity may not
    return DrawnCurves(ssf, low, high, columns(truth["ssf"]) if truth else None)


def _knots(curves: Floats) -> int | None:
    """Grid steps between values with straight lines between them; None if there are none."""
    nodes = curves[::NODE]
    lines = np.stack([np.interp(WAVELENGTHS, WAVELENGTHS[::NODE], each) for each in nodes.T], axis=1)
    if np.abs(lines - curves).max() > STRAIGHT:  # a curve set to 0 where it was negative bends between two nodes
        return None
    off = np.abs(nodes[1::2] - 0.5 * (nodes[:-1:2] + nodes[2::2])).max()
    return 2 * NODE if off < NEARLY else NODE
