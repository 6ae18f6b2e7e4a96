"""Settings of a calibration that hold for all its shots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from camssf.recovery.basis import Basis


@dataclass(frozen=True)
class Options:
    """Settings of a calibration; the defaults suit a photo under a known lamp.

    For measuring:

    Attributes:
        white_reflectance: of the white frame's target, 0 to 1, the same at all wavelengths; None for a perfect
            diffuser.

    For solving, as in `recover`:

    Attributes:
        basis: "auto" to choose among phones, cameras and ryyb by the marginal likelihood; a name, a file, or a Basis.
        fit: 1-based numbers of the patches that enter the fit; None for all patches, with cross-validation.
        nonnegative: coefficients ≥ 0; None for the basis' default.
        l2, gamma: the penalties λ₂ and γ; None for the basis' defaults.
        engine: "onnx" or "reference".
        light_per_patch: variation of the light from patch to patch if each was photographed separately, 8 % is 0.08;
            None if they are in one photo.
    """

    white_reflectance: float | None = None
    basis: str | Basis = "auto"
    fit: Sequence[int] | None = None
    nonnegative: bool | None = None
    l2: float | None = None
    gamma: float | Sequence[float] | None = None
    engine: str = "onnx"
    light_per_patch: float | None = None


DEFAULTS = Options()
