"""The curves of a document, what can be of their bands, and where their labels stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.documents.view.bands import possible
from camssf.documents.view.text import CHANNELS, Json
from camssf.grid import WAVELENGTHS, Floats


@dataclass(frozen=True)
class Curves:
    """What is drawn; each (681, 3), columns red, green, blue.

    Attributes:
        ssf: the curves, peak = 1; those with a band are drawn from zero up, as their bands are.
        low, high: the 95 % band; None where the basis gives none.
        truth: measured curves, or None.
    """

    ssf: Floats
    low: Floats | None
    high: Floats | None
    truth: Floats | None

    def limits(self) -> tuple[float, float]:
        """The response axis: all of every curve, and of the bands what does not dwarf the curves."""
        low, high = min(0.0, float(self.ssf.min())), 1.0
        if self.truth is not None:
            low, high = min(low, float(self.truth.min())), max(high, float(self.truth.max()))
        if self.high is not None:
            high = max(high, min(float(self.high.max()), 1.3))
        return low - 0.02, high + 0.09

    def peak_labels(self) -> list[tuple[str, float, float, str]]:
        """(text, nm, response, side) over each peak and its band; neighbours within 50 nm turn away."""
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
        """Half of the band's width in each channel, (3,), mean of 400 to 700 nm."""
        if self.low is None or self.high is None:
            return None
        visible = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
        return np.asarray((self.high - self.low)[visible].mean(axis=0) / 2)


def curves_of(document: Json) -> Curves:
    """A document's curves, its bands and its truth."""
    ssf = columns(document["ssf"])
    std, truth = document.get("ssf_std"), document.get("truth")
    low, high = possible(ssf, columns(std)) if std else (None, None)
    if std:
        ssf = np.maximum(ssf, 0.0)  # a posterior's mean may lie below, no response does
    return Curves(ssf, low, high, columns(truth["ssf"]) if truth else None)


def columns(spectra: Json) -> Floats:
    """Red, green, blue, shape (681, 3)."""
    return np.array([spectra[colour] for colour in CHANNELS], dtype=np.float64).T
