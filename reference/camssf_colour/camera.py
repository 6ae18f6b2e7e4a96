"""Cameras for colour computations: curves and the modes of their errors, from a result or an Ssf."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from camssf.documents.curve_errors import error_modes, modes_of_code, with_rest
from camssf.documents.document import Document
from camssf.documents.excerpt import Excerpt, answer_of
from camssf.documents.stored_lamp import lamp_of
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, widened
from camssf.recovery.sensitivity import Ssf
from camssf.spectra import Lamp


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


ColourCamera: TypeAlias = Camera | Document | Excerpt
"""What the colour functions accept as a camera: a Camera, a result, or the excerpt of one in a passport."""


def as_camera(given: ColourCamera) -> Camera:
    """The camera of a Camera, a result or an excerpt.

    Raises:
        InvalidArgument: it is none of these, or the result was refused.
    """
    if isinstance(given, Camera):
        return given
    if isinstance(given, Document | Excerpt):
        return camera_of_result(given)
    raise InvalidArgument(
        f"A {type(given).__name__} cannot be used as a camera.", "Give a Result, an excerpt, or a Camera."
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
    if ssf.code_covariance is None:
        raise InvalidArgument(f"The {ssf.basis} basis has no prior, so no covariance.", "Choose the basis cameras.")
    (values, band), basis = ssf.peak(), widened(basis, ssf.prior_scale)
    assert band is not None  # a covariance comes with a band
    return Camera(ssf.basis, values, with_rest(modes_of_code(values, ssf.code_covariance, basis, white), band), own)


def camera_of_result(document: Document | Excerpt) -> Camera:
    """The camera of a result, or of the excerpt of one.

    The modes come from the result's covariance, if its basis is available, and from what its bands hold besides.
    Else, and of an excerpt, they come from its bands alone: errors are then assumed smooth over BAND_CORRELATION (of
    `curve_errors`) and independent between the channels, which about doubles the stated uncertainty of colours. `own`
    needs the light of the first shot.

    Raises:
        InvalidArgument: a refused result.
    """
    answer = answer_of(document)
    lamp = document.lamp() if isinstance(document, Excerpt) else lamp_of(document, 0)
    name = " ".join(filter(None, make_and_model(document))) or "camera"
    values, raw = answer.curves.values, answer.channel_gain
    own = None if lamp is None or not ((raw > 0) & (lamp.values @ values > 0)).all() else OwnWhite(raw, lamp)
    modes, whole = error_modes(answer, None if own is None else own.lamp.values)
    return Camera(name, values, modes, own, whole)


def make_and_model(document: Document | Excerpt) -> tuple[str, str]:
    """Make and model of a result's camera, as its files name it."""
    if isinstance(document, Excerpt):
        return document.camera.make, document.camera.model
    assert document.capture is not None
    return document.capture.photos[0].make, document.capture.photos[0].model
