"""Result → which known cameras its curves are most like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from camssf import __version__
from camssf.colour.camera import camera_of_result
from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra.cameras import SHIPPED_SOURCE, shipped_cameras

FORMAT = "camssf-nearest/1"
TABLE = 0.02
"""One standard deviation of a known camera's curves, in parts of the peak: laboratories that measured one model
differ by so much and more. Without it a node where the band is 0, as at the peak, would decide alone."""


@dataclass(frozen=True)
class Likeness:
    """A known camera beside a result; over the N = 207 nodes and channels, every 5 nm from 380 to 720 nm.

    Attributes:
        name: of the camera, its maker first.
        distance: √(1/N Σ (s - s_known)² / (σ² + TABLE²)), σ the result's band as one standard deviation: 1 is what
            the band and the table's own error leave open.
        whole: √(1/N dᵀ (Σ_s + TABLE² I)⁻¹ d), d = s - s_known, with the whole covariance Σ_s of the curves; None
            where the result holds none, or its basis is not at hand.
        rms: √(1/N Σ d²), in parts of the peak.
    """

    name: str
    distance: float
    whole: float | None
    rms: float

    @property
    def maker(self) -> str:
        """The first word of the name."""
        return self.name.partition(" ")[0]


def nearest(document: dict[str, Any]) -> tuple[Likeness, ...]:
    """The 52 shipped cameras, those first that a result document is most like by `distance`.

    The bands order them, and not the whole covariance: `python -m benchmarks.nearest` finds a camera's own table
    first more often by the bands, since what a learned basis cannot form weighs more against the covariance.

    Raises:
        InvalidArgument: a refused result, or one without bands.
    """
    camera = camera_of_result(document)
    if document.get("ssf_std") is None:
        raise InvalidArgument(
            f"A result on the {document['basis']} basis has no bands to measure a distance by.",
            "Solve it with --basis auto, phones or cameras.",
        )
    std = np.stack([np.array(document["ssf_std"][c], dtype=np.float64) for c in ("red", "green", "blue")], axis=1)
    modes = camera.modes if camera.whole else None
    return tuple(sorted(likenesses(camera.values, std, modes), key=lambda each: each.distance))


def likenesses(values: Floats, std: Floats, modes: Floats | None) -> list[Likeness]:
    """Every shipped camera, in the order of the file.

    Args:
        values: (681, 3) each channel's peak = 1.
        std: (681, 3) one standard deviation.
        modes: (q, 681, 3) whose outer products sum to the covariance; None where it is not known.
    """
    known = shipped_cameras()
    d = (values[::10] - np.stack(list(known.values()))).reshape(len(known), -1)
    variance = std[::10].ravel() ** 2 + TABLE**2
    distance = np.sqrt(np.mean(d**2 / variance, axis=1))
    whole: list[float | None] = [None] * len(known)
    if modes is not None:
        flat = modes[:, ::10].reshape(len(modes), -1)
        covariance = flat.T @ flat + TABLE**2 * np.eye(d.shape[1])
        whole = np.sqrt(np.mean(d.T * np.linalg.solve(covariance, d.T), axis=0)).tolist()
    rms = np.sqrt(np.mean(d**2, axis=1))
    return [Likeness(*each) for each in zip(known, distance.tolist(), whole, rms.tolist(), strict=True)]


def nearest_document(found: tuple[Likeness, ...], result: dict[str, Any]) -> dict[str, Any]:
    """As plain data.

    Args:
        found: as many as shall stand there.
        result: whose they are: camera, sha256, verdict, reasons.
    """
    return {
        "format": FORMAT,
        "generator": {"name": "camssf", "version": __version__},
        "result": result,
        "table": TABLE,
        "cameras": [
            {
                "name": each.name,
                "maker": each.maker,
                "source": SHIPPED_SOURCE,
                "distance": each.distance,
                "whole": each.whole,
                "rms": each.rms,
            }
            for each in found
        ],
    }
