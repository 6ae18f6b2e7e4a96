"""Cameras for colour computations: curves and the modes of their errors, from a result or an Ssf."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Protocol, TypeAlias

import numpy as np

from camssf.errors import CalibrationError, InvalidArgument
from camssf.grid import WAVELENGTHS, Floats, columns
from camssf.recovery.basis import Basis, read_basis, widened
from camssf.recovery.covariance import smooth_errors
from camssf.recovery.linear_model import anchor
from camssf.recovery.sensitivity import Ssf, moves_of_peak_one
from camssf.spectra import Lamp, read_lamp

BAND_CORRELATION = 10.0
"""Correlation length of a curve's errors if only its band is known, nm. Photos determine integrals of the curves, so
true errors change sign; a longer length would overestimate the uncertainty of colours even more."""
SAME_BAND = 0.02
"""Largest difference between a document's bands and those that its covariance gives, relative to the largest band."""
LEAST = 1e-6
"""Modes with less than this share of the largest mode's variance are left out."""


@dataclass(frozen=True)
class OwnWhite:
    """The calibration's raw white, which fixes the relative scale of the three channels.

    Attributes:
        raw: (3,) white signal of each channel relative to green.
        lamp: of that shot.
    """

    raw: Floats
    lamp: Lamp


@dataclass(frozen=True)
class Camera:
    """A camera's curves and the modes of their errors.

    Attributes:
        name: of the camera or of the result.
        values: (681, 3), each channel's peak = 1.
        modes: (q, 681, 3) independent error modes, each one standard deviation long; (0, 681, 3) for curves that are
            assumed exact.
        own: the calibration's white; None if it is not known.
        whole: True if the modes come from the whole covariance, False if only from the bands.
    """

    name: str
    values: Floats = field(repr=False)
    modes: Floats = field(repr=False)
    own: OwnWhite | None = None
    whole: bool = True

    def __post_init__(self) -> None:
        m = WAVELENGTHS.size
        if self.values.shape != (m, 3) or self.modes.shape[1:] != (m, 3):
            raise InvalidArgument(
                f"Curves of shape {self.values.shape} with modes of shape {self.modes.shape} do not fit together.",
                "Give (681, 3) and (q, 681, 3) on the grid.",
            )
        if not (np.isfinite(self.values).all() and np.isfinite(self.modes).all() and (self.values.max(0) > 0).all()):
            raise InvalidArgument("A curve is not finite, or has no positive peak.", "Give measured curves.")


class HasDocument(Protocol):
    """A result: `Calibration`, or one that was loaded."""

    def document(self) -> dict[str, Any]:
        """The result as plain data, "camssf-result/1"."""


ColourCamera: TypeAlias = Camera | HasDocument | Mapping[str, Any]
"""What the colour functions accept as a camera: a Camera, a result, or a result's document."""


def as_camera(given: ColourCamera) -> Camera:
    """The camera of a Camera, a result or a result's document.

    Raises:
        InvalidArgument: it is none of these, or the result was refused.
    """
    if isinstance(given, Camera):
        return given
    if hasattr(given, "document"):
        return camera_of_result(given.document())
    if isinstance(given, Mapping) and given.get("format") == "camssf-result/1":
        return camera_of_result(dict(given))
    raise InvalidArgument(
        f"A {type(given).__name__} cannot be used as a camera.",
        "Give a Calibration, a result document, or a Camera.",
    )


def camera_of_ssf(ssf: Ssf, basis: Basis, white: Floats, own: OwnWhite | None = None) -> Camera:
    """The camera of an answer of `recover`, with its whole covariance.

    Args:
        ssf: on a basis with a prior.
        basis: that basis.
        white: (681,) ρ_w L of the first shot, as in the observation: the basis was anchored to it.
        own: the calibration's white, if raw frames are known.

    Raises:
        InvalidArgument: an answer without a covariance.
    """
    if ssf.posterior is None:
        raise InvalidArgument(
            f"The {ssf.settings.basis} basis has no prior, so no covariance.", "Choose the basis cameras."
        )
    values, basis = ssf.peak()[0], widened(basis, ssf.settings.prior_scale)
    return Camera(ssf.settings.basis, values, modes_of_code(values, ssf.posterior.code_covariance, basis, white), own)


def camera_of_result(document: dict[str, Any]) -> Camera:
    """The camera of a result document.

    The modes come from the document's covariance if its basis and the lamp of its first shot are available. Else they
    come from its bands: errors are then assumed smooth over BAND_CORRELATION and independent between the channels,
    which about doubles the stated uncertainty of colours. `own` also needs that lamp.

    Raises:
        InvalidArgument: a refused result.
    """
    if "ssf" not in document:
        reasons = document["verdict"]["reasons"]
        raise InvalidArgument("This result was refused: it has no curves.", reasons[0]["advice"])
    values, std = columns(document["ssf"]), document.get("ssf_std")
    named = document["camera"]
    name = " ".join(filter(None, (named["make"], named["model"]))) or "camera"
    try:
        lamp = read_lamp(document["shots"][0]["lamp"]["name"])
        raw = np.array(document["channel_gain"], dtype=np.float64)
        own = OwnWhite(raw, lamp) if ((raw > 0) & (lamp.values @ values > 0)).all() else None
    except CalibrationError:  # a lamp from a file that is not available: the channels' relative scale is unknown
        own = None
    if std is None:
        return Camera(name, values, np.zeros((0, *values.shape)), own)
    band = columns(std)
    modes = None if own is None else _modes_of_document(document, values, band, own.lamp.values)
    if modes is None:
        return Camera(name, values, modes_of_bands(band), own, whole=False)
    return Camera(name, values, modes, own)


def _modes_of_document(document: dict[str, Any], values: Floats, band: Floats, white: Floats) -> Floats | None:
    """Modes from the document's covariance; None if it has none, or if its basis differs from the installed one."""
    triangle = document.get("code_covariance")
    try:
        basis = widened(read_basis(document["basis"]), document.get("prior_scale", 1.0))
    except InvalidArgument:
        return None
    size = 3 * basis.dictionary.shape[2]
    if triangle is None or not basis.prior or len(triangle) != size * (size + 1) // 2:
        return None
    covariance = np.zeros((size, size))
    covariance[np.tril_indices(size)] = triangle
    covariance = covariance + np.tril(covariance, -1).T
    with np.errstate(all="ignore"):  # the covariance may belong to another basis; this is checked below
        modes = modes_of_code(values, covariance, basis, white)
        # The document's own bands show whether basis and covariance belong together.
        found = np.sqrt(np.sum(modes**2, axis=0))
    return modes if np.abs(found - band).max() < SAME_BAND * band.max() else None


def modes_of_code(values: Floats, covariance: Floats, basis: Basis, white: Floats) -> Floats:
    """(q, 681, 3) modes of curves of peak 1 from the covariance (3 r, 3 r) of their code.

    The basis is anchored to the white (681,) ρ_w L, so no code changes Σ white s dλ; this gives the curves' scale.
    """
    anchored = anchor(basis, white)
    curves = values.T * ((anchored.mean @ white) / (values.T @ white))[:, None]
    moves = moves_of_peak_one(anchored, curves) / curves.max(axis=1)[:, None, None]
    size, axes = np.linalg.eigh(covariance)
    steps = (axes * np.sqrt(np.maximum(size, 0.0))).reshape(3, -1, size.size)
    return _largest(np.einsum("cmr,crq->qmc", moves, steps))


def modes_of_bands(std: Floats) -> Floats:
    """(q, 681, 3) modes whose variance at each wavelength is the band's (681, 3)."""
    smooth = _unit_errors()
    modes = np.zeros((3, smooth.shape[1], *std.shape))
    for c in range(3):
        modes[c, :, :, c] = (std[:, c, None] * smooth).T
    return _largest(modes.reshape(-1, *std.shape))


@cache
def _unit_errors() -> Floats:
    """(681, p) smooth errors of variance 1 at every wavelength."""
    smooth = smooth_errors(BAND_CORRELATION, WAVELENGTHS)
    return np.asarray(smooth / np.linalg.norm(smooth, axis=1, keepdims=True))


def _largest(modes: Floats) -> Floats:
    """The modes reduced to principal ones, the largest first; those below LEAST are left out."""
    shape = modes.shape
    _, size, axes = np.linalg.svd(modes.reshape(len(modes), -1), full_matrices=False)
    kept = size**2 > LEAST * size[0] ** 2 if size[0] > 0 else np.zeros(size.shape, dtype=bool)
    return np.asarray((size[kept, None] * axes[kept]).reshape(-1, *shape[1:]))
