"""Ranks the known cameras by the similarity of their curves to a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from camssf.colour.camera import camera_of_result
from camssf.errors import CalibrationError, InvalidArgument
from camssf.grid import Floats, columns
from camssf.spectra.cameras import SHIPPED_SOURCE, shipped_cameras
from camssf.version import __version__

FORMAT = "camssf-nearest/1"
TABLE = 0.02
"""One standard deviation of a known camera's curves, in parts of the peak: laboratories differ by this and more.
Without it a node with a band of 0, as at the peak, would dominate the distance."""


@dataclass(frozen=True)
class Likeness:
    """Distances of a known camera from a result, over the N = 207 nodes and channels, every 5 nm from 380 to 720 nm.

    Attributes:
        name: of the camera, its maker first.
        distance: √(1/N Σ (s - s_known)² / (σ² + TABLE²)), σ one standard deviation of the result's curves; about 1
            if the difference is as large as the band and the table's error.
        whole: √(1/N dᵀ (Σ_s + TABLE² I)⁻¹ d), d = s - s_known, with the full covariance Σ_s of the curves; None if
            the result holds none, or its basis is not available.
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
    """The 52 shipped cameras, sorted by their `distance` from a result document.

    They are sorted by the bands, not by the full covariance, because the covariance overweights differences that a
    learned basis cannot represent.

    Raises:
        InvalidArgument: a refused result, or one without bands.
    """
    camera = camera_of_result(document)
    if document.get("ssf_std") is None:
        raise InvalidArgument(
            f"A result on the {document['basis']} basis has no bands, so no distance can be computed.",
            "Solve it on the basis auto, phones or cameras.",
        )
    std = columns(document["ssf_std"])
    modes = camera.modes if camera.whole else None
    return tuple(sorted(likenesses(camera.values, std, modes), key=lambda each: each.distance))


def nearest_of(document: dict[str, Any]) -> Likeness | None:
    """The nearest of the shipped cameras, to draw beside the curves; None with a truth, or without bands."""
    if document.get("truth") or document.get("ssf_std") is None:
        return None
    try:
        return nearest(document)[0]
    except CalibrationError:  # a foreign document whose lamp is not here
        return None


def likenesses(values: Floats, std: Floats, modes: Floats | None) -> list[Likeness]:
    """The distances of all shipped cameras, in the order of the file.

    Args:
        values: (681, 3) each channel's peak = 1.
        std: (681, 3) one standard deviation.
        modes: (q, 681, 3) whose outer products sum to the covariance; None if it is not known.
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
    """The nearest cameras as plain data.

    Args:
        found: the cameras to list.
        result: facts of the result: camera, sha256, verdict, reasons.
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
