"""Signals and all that is known of them: what `recover`, `explain` and `predict` share, checked once."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.curves.basis import Basis
from camssf.errors import InvalidArgument, LampUnfit
from camssf.grid import WAVELENGTHS, Floats
from camssf.rules import rules

WEIGHTLESS = rules().number("calibration.hidden")
"""Standard error of a signal that may not be used. The model has one input for both; what weighs 1e-6 of the faintest
signal moves no curve."""


@dataclass(frozen=True)
class Evidence:
    """k shots of n patches, with what is known of chart, white and lamps. Any array-like is taken; m = 681.

    Attributes:
        signals: (k, n, 3), or (n, 3) of one shot, of Eq. (5), 1.
        reflectance: (n, m) of the patches.
        lamp: (k, m) or (m,) relative power, any scale.
        standard_error: of the signals, same shape; None where unknown.
        used: (k, n) False for a signal that must not be looked at; None for all.
        chart_tolerance: (n,) or one number, relative error of the reflectances.
        white_reflectance: (m,) of the white reference; a perfect diffuser if nothing is said.
        white_tolerance: its relative error.
        lamp_tolerance: (k,) or one number, the smooth relative error of each lamp.
        lamp_modes: (k, q, m) or (q, m) directions in which L may be off, relative to it, each one standard deviation
            long.
        frames: chart, white and dark (k, n, 3) DN that the signals came from, for the ratio between the channels;
            None where they are not known.

    Raises:
        InvalidArgument: shapes or values that do not fit.
        LampUnfit: a lamp without power on the grid.
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
    frames: tuple[Floats, Floats, Floats] | None = None

    def __post_init__(self) -> None:
        m = WAVELENGTHS.size
        y = array_of("signals", self.signals)
        y = y[None] if y.ndim == 2 else y
        if y.ndim != 3 or y.shape[2] != 3 or 0 in y.shape:
            raise InvalidArgument(
                f"The signals have shape {y.shape}; (k, n, 3) or (n, 3) is needed.",
                "Give every shot the same patches.",
            )
        k, n, _ = y.shape
        lamp = array_of("lamp", self.lamp)
        lamp = np.broadcast_to(lamp, (k, m)) if lamp.shape == (m,) else array_of("lamp", lamp, (k, m))
        if (lamp < 0).any() or (lamp.max(axis=1) <= 0).any():
            raise LampUnfit(
                "The lamp has negative power, or none at all, between 380 and 720 nm.",
                "Give the spectrum of the light that fell on the chart, in nm and relative power.",
            )
        rho = array_of("white_reflectance", self.white_reflectance, (m,))
        if not (rho >= 0).all() or not (rho @ lamp.T > 0).all():
            raise InvalidArgument(
                "The white reference reflects nothing under the lamp.", "Give its reflectance on the grid, 0 to 1."
            )
        checked = {
            "signals": y,
            "reflectance": array_of("reflectance", self.reflectance, (n, m)),
            "lamp": lamp,
            "standard_error": None if self.standard_error is None else _errors(self.standard_error, y),
            "used": _mask(self.used, (k, n)),
            "chart_tolerance": tolerance_of("chart_tolerance", self.chart_tolerance, n),
            "white_reflectance": rho,
            "white_tolerance": float(tolerance_of("white_tolerance", self.white_tolerance, 1)[0]),
            "lamp_tolerance": tolerance_of("lamp_tolerance", self.lamp_tolerance, k),
            "lamp_modes": _modes(self.lamp_modes, k),
            "frames": None if self.frames is None else tuple(array_of("frames", f, y.shape) for f in self.frames),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def errors(self, basis: Basis) -> Floats:
        """Standard errors as the rows take them, (k, n, 3): without end where a signal is not used.

        Unknown ones count as 0. On a basis without a prior, with nothing said of the chart either, they count as 1:
        Σ = I, the paper's plain least squares.
        """
        if self.standard_error is not None:
            error = self.standard_error
        else:
            error = np.full(self.signals.shape, 0.0 if basis.prior or np.any(self.chart_tolerance) else 1.0)
        return error if self.used is None else np.where(self.used[:, :, None], error, WEIGHTLESS)

    def check_for(self, basis: Basis) -> None:
        """Refuse what a basis cannot take: the paper's knows one shot.

        Raises:
            InvalidArgument: several shots on a basis without a mean.
        """
        if not basis.prior and len(self.signals) > 1:
            raise InvalidArgument(
                f"The {basis.name} basis takes one shot, not {len(self.signals)}: each shot's exposure would be a "
                "further unknown.",
                "Give one photo, or take --basis cameras, whose rows are free of exposure.",
            )


def array_of(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> Floats:
    """An array of finite numbers, of that shape.

    Raises:
        InvalidArgument: it is none.
    """
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(
            f"`{name}` is not an array of numbers: {error}.", "Give every shot the same patches and channels."
        ) from error
    if shape is not None and array.shape != shape:
        raise InvalidArgument(
            f"`{name}` has shape {array.shape}; {shape} is needed.", "Put it on the 681-point grid."
        )
    if not np.isfinite(array).all():
        raise InvalidArgument(f"`{name}` holds NaN or infinity.", "Leave out what could not be measured.")
    return array


def tolerance_of(name: str, value: ArrayLike, size: int) -> Floats:
    """One tolerance for each of so many, from one number or as many, (size,).

    Raises:
        InvalidArgument: another number of them, or a negative one.
    """
    array = array_of(name, value)
    if array.shape not in ((), (1,), (size,)) or (array < 0).any():
        raise InvalidArgument(
            f"`{name}` must be one number or {size} numbers, not negative; it has shape {array.shape}.",
            "Write 3 % as 0.03.",
        )
    return np.broadcast_to(array.reshape(-1), size).copy()


def _errors(value: ArrayLike, signals: Floats) -> Floats:
    error = array_of("standard_error", value)
    if error.size != signals.size:
        raise InvalidArgument(
            f"`standard_error` has {error.size} values, the signals {signals.size}.", "Give one for each signal."
        )
    if (error < 0).any():
        raise InvalidArgument("A standard error is negative.", "Give standard errors ≥ 0.")
    return error.reshape(signals.shape)


def _mask(value: ArrayLike | None, shape: tuple[int, int]) -> NDArray[np.bool_] | None:
    if value is None:
        return None
    mask = np.asarray(value)
    mask = mask[None] if mask.ndim == 1 else mask
    if mask.dtype != np.bool_ or mask.shape != shape:
        raise InvalidArgument(
            f"`used` has shape {mask.shape} and type {mask.dtype}; {shape} of booleans is needed.",
            "Give True for each signal that enters the fit.",
        )
    return mask


def _modes(value: ArrayLike, k: int) -> Floats:
    m = WAVELENGTHS.size
    modes = array_of("lamp_modes", value)
    if modes.ndim == 2:
        modes = modes[None] if len(modes) else np.zeros((k, 0, m))
    if modes.ndim != 3 or modes.shape[::2] != (k, m):
        raise InvalidArgument(
            f"`lamp_modes` have shape {modes.shape}; ({k}, q, {m}) is needed.", "Give q modes a shot."
        )
    return modes


def evidence_of(verb: str, given: Evidence | ArrayLike, former: Sequence[Any], named: Mapping[str, Any]) -> Evidence:
    """What a verb was given, also in the form before `Evidence`: signals, reflectance, lamp and the rest by name."""
    if isinstance(given, Evidence):
        if former or named:
            extra = ", ".join(named) or f"{len(former)} more positional argument(s)"
            raise TypeError(f"{verb}() takes an Evidence, which says it all; got also {extra}")
        return given
    warnings.warn(
        f"{verb}(signals, reflectance, lamp, ...) has become {verb}(Evidence(signals, reflectance, lamp, ...)); the "
        "former form goes with the release after the next.",
        DeprecationWarning,
        stacklevel=3,
    )
    return Evidence(given, *former, **{name: value for name, value in named.items() if value is not None})  # type: ignore[arg-type]
