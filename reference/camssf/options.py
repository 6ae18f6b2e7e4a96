"""How a capture is to be calibrated, beside its photos and lamps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from camssf.curves.basis import Basis


@dataclass(frozen=True)
class Options:
    """What can be said of a calibration; the defaults are right for a photo under a known lamp.

    Of measuring:

    Attributes:
        corners: for each shot None, or (4, 2) outer corners of the patches by hand, px; None to search in all shots.
        white_reflectance: of the white frame's target, 0 to 1, the same at all wavelengths; None for a perfect
            diffuser.
        lamp_tolerance: how well each lamp is known, `2%`, `300K` or both (`with_tolerance`); None for its default.
        lens_shading: "as-stored", or "apply" for the gain maps in the photos' files (`photo.patches`, rule 6).

    Of solving, as in `recover`:

    Attributes:
        basis: "auto", for phones or cameras as the signals say; a name, a file, or a Basis.
        fit: 1-based numbers of the patches that enter the fit; None for all, validated fold by fold.
        nonnegative: coefficients ≥ 0; None leaves it to the basis.
        l2, gamma: the penalties λ₂ and γ; None leaves them to the basis.
        engine: "onnx" or "reference".
        light_per_patch: how much the light may differ from patch to patch where each was photographed for itself,
            8 % is 0.08; None where they stood in one photo.
    """

    corners: Sequence[ArrayLike | None] | None = None
    white_reflectance: float | None = None
    lamp_tolerance: str | Sequence[str | None] | None = None
    lens_shading: str = "as-stored"
    basis: str | Basis = "auto"
    fit: Sequence[int] | None = None
    nonnegative: bool | None = None
    l2: float | None = None
    gamma: float | None = None
    engine: str = "onnx"
    light_per_patch: float | None = None


DEFAULTS = Options()
