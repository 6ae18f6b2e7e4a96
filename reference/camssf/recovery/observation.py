"""The common input of `recover`, `explain` and `predict`, checked once: signals, chart, white and lamps."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.messages import fail
from camssf.recovery.basis import Basis
from camssf.rules import rules
from camssf.spectra.charts import faded

MASKED_STANDARD_ERROR = rules().number("calibration.hidden")
"""Standard error of a masked signal, too large for it to change a curve: the model has no mask input."""


@dataclass(frozen=True)
class Observation:
    """Signals of k shots of n patches, with chart, white and lamps. Accepts any array-like; m = 681.

    Attributes:
        signals: (k, n, 3), or (n, 3) of one shot, of Eq. (5), 1.
        reflectance: (n, m) of the patches.
        lamp: (k, m) or (m,) relative power, any scale.
        standard_error: of the signals, same shape; None if unknown.
        used: (k, n) False for a masked signal; None to use all.
        chart_tolerance: (n,) or one number, relative error of the reflectances.
        white_reflectance: (m,) of the white reference; a perfect diffuser by default.
        white_tolerance: its relative error.
        lamp_tolerance: (k,) or one number, the smooth relative error of each lamp.
        lamp_modes: (k, q, m) or (q, m) modes of the error of L, relative to L, each of one standard deviation.
        gain_modes: (k, g, n), or (g, n) of one shot, modes φ of the light on the patches relative to that on the
            white, each of one standard deviation: in even light the signals would be y (1 - Σ v φ).
        gain_own: size of the additional gain errors that are independent by channel, relative to the gain modes.
        frames: chart, white and dark (k, n, 3) DN, that the model forms the signals from, and `Ssf.channel_gain`;
            None if unknown.

    Raises:
        InvalidArgument: invalid shapes or values.
        LampUnfit: a lamp with negative power, or none, on the grid.
    """

    signals: Floats
    reflectance: Floats
    lamp: Floats
    standard_error: Floats | None = None
    used: NDArray[np.bool_] | None = None
    chart_tolerance: Floats = field(default_factory=lambda: np.array(0.03))
    white_reflectance: Floats = field(default_factory=lambda: np.ones(WAVELENGTHS.size))
    white_tolerance: float = 0.01
    lamp_tolerance: Floats = field(default_factory=lambda: np.array(0.0))
    lamp_modes: Floats = field(default_factory=lambda: np.zeros((0, WAVELENGTHS.size)))
    gain_modes: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    gain_own: float = 0.0
    frames: tuple[Floats, Floats, Floats] | None = None

    def __post_init__(self) -> None:
        m = WAVELENGTHS.size
        y = _signals(self.signals, self.used)
        if y.ndim != 3 or y.shape[2] != 3 or 0 in y.shape:
            raise InvalidArgument(
                f"The signals have shape {y.shape}; (k, n, 3) or (n, 3) is needed.",
                "Give every shot the same patches.",
            )
        k, n, _ = y.shape
        lamp = array_of("lamp", self.lamp)
        lamp = np.broadcast_to(lamp, (k, m)) if lamp.shape == (m,) else array_of("lamp", lamp, (k, m))
        if (lamp < 0).any() or (lamp.max(axis=1) <= 0).any():
            raise fail("lamp_unfit.unlit")
        rho = array_of("white_reflectance", self.white_reflectance, (m,))
        if not (rho >= 0).all() or not (rho @ lamp.T > 0).all():
            raise InvalidArgument(
                "The white reference reflects nothing under the lamp.", "Give its reflectance on the grid, 0 to 1."
            )
        mask = _mask(self.used, (k, n))
        checked = {
            "signals": y,
            "reflectance": _reflectance(self.reflectance, (n, m)),
            "lamp": lamp,
            "standard_error": None if self.standard_error is None else _errors(self.standard_error, y),
            "used": mask,
            "chart_tolerance": tolerance_of("chart_tolerance", self.chart_tolerance, n),
            "white_reflectance": rho,
            "white_tolerance": float(tolerance_of("white_tolerance", self.white_tolerance, 1)[0]),
            "lamp_tolerance": tolerance_of("lamp_tolerance", self.lamp_tolerance, k),
            "lamp_modes": _modes("lamp_modes", self.lamp_modes, (k, m)),
            "gain_modes": _modes("gain_modes", self.gain_modes, (k, n)),
            "gain_own": float(tolerance_of("gain_own", self.gain_own, 1)[0]),
            "frames": None if self.frames is None else _frames(self.frames, y.shape),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def faded(self, amount: float) -> Observation:
        """The observation with the table of a chart faded by `amount`; a white frame's flat target does not fade."""
        if not amount:
            return self
        white = faded(self.white_reflectance, amount)
        return replace(self, reflectance=faded(self.reflectance, amount), white_reflectance=white)

    def errors(self, basis: Basis) -> Floats:
        """Standard errors of the rows, (k, n, 3); MASKED_STANDARD_ERROR for masked signals.

        Unknown ones count as 0. On a basis without a prior and with zero chart tolerance they count as 1: Σ = I, the
        paper's plain least squares.
        """
        if self.standard_error is not None:
            error = self.standard_error
        else:
            error = np.full(self.signals.shape, 0.0 if basis.prior or np.any(self.chart_tolerance) else 1.0)
        return error if self.used is None else np.where(self.used[:, :, None], error, MASKED_STANDARD_ERROR)

    def check_for(self, basis: Basis) -> None:
        """Check that the basis can take this observation: the paper's takes one shot only.

        Raises:
            InvalidArgument: several shots on a basis without a mean.
        """
        if not basis.prior and len(self.signals) > 1:
            raise InvalidArgument(
                f"The {basis.name} basis takes one shot, not {len(self.signals)}: each shot's exposure would be a "
                "further unknown.",
                "Give one photo, or choose the basis cameras, whose rows are free of exposure.",
            )


def array_of(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> Floats:
    """Convert to an array of finite numbers and check its shape.

    Raises:
        InvalidArgument: not numbers, not finite, or another shape.
    """
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(
            f"`{name}` is not an array of numbers: {error}.", "Give numbers; of several shots, the same patches each."
        ) from error
    if shape is not None and array.shape != shape:
        raise InvalidArgument(
            f"`{name}` has shape {array.shape}; {shape} is needed.", "Put it on the 681-point grid."
        )
    if not np.isfinite(array).all():
        raise InvalidArgument(
            f"`{name}` holds NaN or infinity.", "Give finite numbers; leave out what could not be measured."
        )
    return array


def surfaces_of(name: str, value: ArrayLike) -> Floats:
    """Reflectances (p, 681), of one surface or several.

    Raises:
        InvalidArgument: not finite numbers on the grid.
    """
    array = np.atleast_2d(array_of(name, value))
    if array.shape[1:] != (WAVELENGTHS.size,):
        raise InvalidArgument(f"`{name}` has shape {array.shape}.", "Give reflectances (p, 681) on the grid.")
    return array


def tolerance_of(name: str, value: ArrayLike, size: int) -> Floats:
    """Tolerances (size,), from one number or `size` numbers.

    Raises:
        InvalidArgument: another shape, or a negative value.
    """
    array = array_of(name, value)
    if array.shape not in ((), (1,), (size,)) or (array < 0).any():
        raise InvalidArgument(
            f"`{name}` must be one number or {size} numbers, not negative; it has shape {array.shape}.",
            "Write 3 % as 0.03.",
        )
    return np.broadcast_to(array.reshape(-1), size).copy()


def _signals(value: ArrayLike, used: ArrayLike | None) -> Floats:
    """Signals (k, n, 3); masked ones may be NaN."""
    try:
        y, mask = np.asarray(value, dtype=np.float64), None if used is None else np.asarray(used)
    except (TypeError, ValueError):
        y, mask = array_of("signals", value), None  # raises with the reason
    y = y[None] if y.ndim == 2 else y
    if mask is not None and mask.dtype == np.bool_ and mask.shape in (y.shape[:2], y.shape[1:2]):
        y = np.where(np.isnan(y) & ~np.broadcast_to(mask, y.shape[:2])[:, :, None], 0.0, y)
    return array_of("signals", y)


def _reflectance(value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Reflectances (n, m), up to 2: a fluorescent patch can exceed 1."""
    reflectance = array_of("reflectance", value, shape)
    if reflectance.min() < -0.01 or reflectance.max() > 2.0:
        raise InvalidArgument(
            f"`reflectance` reaches from {reflectance.min():.3g} to {reflectance.max():.3g}.", "Write 35 % as 0.35."
        )
    return reflectance


def _frames(value: Any, shape: tuple[int, ...]) -> tuple[Floats, ...]:
    """Chart, white and dark, each (k, n, 3)."""
    if not isinstance(value, tuple | list) or len(value) != 3:
        raise InvalidArgument("`frames` is not chart, white and dark.", "Give three arrays like the signals.")
    frames = tuple(array_of("frames", frame) for frame in value)
    frames = tuple(frame[None] if frame.ndim == 2 else frame for frame in frames)
    if any(frame.shape != shape for frame in frames):
        raise InvalidArgument(
            f"`frames` have shapes {[frame.shape for frame in frames]}, the signals {shape}.",
            "Give each of the three the shape of the signals.",
        )
    return frames


def _errors(value: ArrayLike, signals: Floats) -> Floats:
    error = array_of("standard_error", value)
    error = error[None] if error.ndim == 2 else error
    if error.shape != signals.shape:
        raise InvalidArgument(
            f"`standard_error` has shape {error.shape}, the signals {signals.shape}.", "Give one for each signal."
        )
    if (error < 0).any():
        raise InvalidArgument("A standard error is negative.", "Give standard errors ≥ 0.")
    return error


def _mask(value: ArrayLike | None, shape: tuple[int, int]) -> NDArray[np.bool_] | None:
    if value is None:
        return None
    try:
        mask = np.asarray(value)
    except ValueError as error:
        raise InvalidArgument(f"`used` is no array: {error}.", "Give every shot the same patches.") from error
    mask = mask[None] if mask.ndim == 1 else mask
    if mask.dtype != np.bool_ or mask.shape != shape:
        raise InvalidArgument(
            f"`used` has shape {mask.shape} and type {mask.dtype}; {shape} of booleans is needed.",
            "Give True for each signal that enters the fit.",
        )
    if not mask.any():
        raise InvalidArgument("`used` leaves no signal at all.", "Mark at least one as True.")
    return mask


def _modes(name: str, value: ArrayLike, shape: tuple[int, int]) -> Floats:
    """Modes (k, q, size), from (q, size) if there is one shot; `shape` is (k, size)."""
    k, size = shape
    modes = array_of(name, value)
    if not modes.size:
        return np.zeros((k, 0, size))
    if modes.ndim == 2:
        modes = modes[None]
    if modes.ndim != 3 or modes.shape[::2] != (k, size):
        raise InvalidArgument(
            f"`{name}` have shape {modes.shape}; ({k}, q, {size}) is needed.", "Give q modes a shot."
        )
    return modes
