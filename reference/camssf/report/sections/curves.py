"""The curves of a document as drawn, with their bands and the positions of their labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.grid import CHANNELS, WAVELENGTHS, Floats, columns
from camssf.report.sections.bands import possible
from camssf.report.sections.text import Json


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
        """Range of the response axis: it holds all curves, and bands up to 1.3."""
        low, high = min(0.0, float(self.ssf.min())), 1.0
        if self.truth is not None:
            low, high = min(low, float(self.truth.min())), max(high, float(self.truth.max()))
        if self.high is not None:
            high = max(high, min(float(self.high.max()), 1.3))
        return low - 0.02, high + 0.09

    def peak_labels(self) -> list[tuple[str, float, float, str]]:
        """(text, nm, response, side) of each peak's label; labels of peaks within 50 nm are put on opposite sides."""
        order = self.ssf.argmax(axis=0)
        nm = WAVELENGTHS[order]
        labels = []
        for i, colour in enumerate(CHANNELS):
            top = 1.0 if self.high is None else min(1.3, self.high[order[i], i])
            near = nm[(np.abs(nm - nm[i]) < 50) & (np.arange(3) != i)]
            side = "middle" if not near.size else "start" if nm[i] > near.mean() else "end"
            labels.append((f"{colour} {nm[i]:.0f} nm", float(nm[i]), float(top) + 0.025, side))
        return labels

    def half_width(self) -> Floats | None:
        """Mean half-width of the band in each channel, (3,), over 400 to 700 nm."""
        if self.low is None or self.high is None:
            return None
        visible = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
        return np.asarray((self.high - self.low)[visible].mean(axis=0) / 2)


def curves_of(document: Json) -> DrawnCurves:
    """A document's curves, bands and truth."""
    ssf = columns(document["ssf"])
    std, truth = document.get("ssf_std"), document.get("truth")
    low, high = possible(ssf, columns(std)) if std else (None, None)
    if std:
        ssf = np.maximum(ssf, 0.0)  # a posterior mean may be negative, a sensitivity may not
    return DrawnCurves(ssf, low, high, columns(truth["ssf"]) if truth else None)
