"""Joint posterior of the lamp and the curves, given the raw signals of a white or grey reference.

If the camera's own white is known, the two raw ratios of the reference depend on the light. The lamp's modes, its
smooth error and the curves' modes are conditioned on them jointly, by Gauss-Newton steps, because the logarithm of a
sum is not linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.arrays import Array, constant, eye, inverse, namespace, whiten
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.recovery.rows import DARKEST
from camssf.rules import rules
from camssf.spectra import Lamp
from camssf_colour.camera import Camera

STEPS = 4
OWN_WHITE = rules().number("colour.own_white")


@dataclass(frozen=True)
class Light:
    """Posterior mean of a lamp and a camera's curves, with their joint error modes.

    Attributes:
        name: of the lamp.
        power: (681,) posterior mean.
        curves: (681, 3) posterior mean.
        power_modes: (K, 681) absolute.
        curve_modes: (K, 681, 3) absolute, of the same K errors.
        of_lamp: how many of the K errors come from the lamps; they are the first ones.
        log_evidence: ln of the density of the reference's ratios; 0 without them.
        chi_squared: χ² of these ratios, two degrees of freedom; None without them.
    """

    name: str
    power: Floats
    curves: Floats
    power_modes: Floats
    curve_modes: Floats
    of_lamp: int
    log_evidence: float = 0.0
    chi_squared: float | None = None


def see(camera: Camera, lamp: Lamp, ratios: Floats | None = None, error: float = 0.0) -> Light:
    """Condition lamp and curves on the reference's raw ratios.

    Args:
        camera: with its modes.
        lamp: as named, with its tolerance and modes.
        ratios: (2,) ln of the reference's raw red and blue over its green; None without a usable reference. They are
            ignored if the camera's own white is not known.
        error: one standard deviation of them.
    """
    return see_together(camera, [lamp], [ratios], [error])[0]


def see_together(
    camera: Camera, lamps: Sequence[Lamp], ratios: Sequence[Floats | None], errors: Sequence[float]
) -> list[Light]:
    """Condition the lamps of several photos and the curves, which are the same in all, on the references' ratios.

    Args:
        camera, lamps, ratios, errors: as in `see`, one lamp for each photo.

    Returns:
        One light for each photo. They have the same K errors, evidence and χ²; the lamps' errors are the first ones.
    """
    modes = [lamp_modes(lamp) for lamp in lamps]
    measured = np.array([float(camera.own is not None and ratio is not None) for ratio in ratios])
    flat = np.ones(WAVELENGTHS.size)
    own, of_own = (flat, flat[None]) if camera.own is None else (camera.own.lamp.values, lamp_modes(camera.own.lamp))
    conditioned = condition(
        LightInputs(
            curves=camera.values,
            curve_modes=camera.modes,
            lamp=np.stack([lamp.values for lamp in lamps]),
            lamp_modes=np.concatenate(modes),
            of_photo=np.repeat(np.eye(len(lamps)), [len(mode) for mode in modes], axis=1),
            ratios=np.stack([np.zeros(2) if ratio is None else ratio for ratio in ratios]),
            ratio_error=np.array(errors, dtype=np.float64),
            measured=measured,
            own_raw=np.ones(3) if camera.own is None else camera.own.raw,
            own_lamp=own,
            own_modes=of_own,
        )
    )
    chi_squared = float(conditioned.chi_squared) if measured.any() else None
    return [
        Light(
            lamp.name, conditioned.power[j], conditioned.curves, conditioned.power_modes[j], conditioned.curve_modes,
            sum(map(len, modes)), float(conditioned.log_evidence), chi_squared,
        )
        for j, lamp in enumerate(lamps)
    ]  # fmt: skip


@dataclass(frozen=True)
class LightInputs:
    """A camera, and the lamps and references of j photos, before the references' ratios are used.

    Attributes:
        curves: (681, 3).
        curve_modes: (q, 681, 3).
        lamp: (j, 681).
        lamp_modes: (p, 681) of all lamps, relative.
        of_photo: (j, p), 1 for the modes of a photo's own lamp.
        ratios: (j, 2) ln of the reference's raw red and blue over its green.
        ratio_error: (j,) one standard deviation of them.
        measured: (j,), 1 where the ratios count, else 0.
        own_raw: (3,) the calibration's white.
        own_lamp: (681,) of that white.
        own_modes: (w, 681) its modes, relative.
    """

    curves: Array
    curve_modes: Array
    lamp: Array
    lamp_modes: Array
    of_photo: Array
    ratios: Array
    ratio_error: Array
    measured: Array
    own_raw: Array
    own_lamp: Array
    own_modes: Array


@dataclass(frozen=True)
class ConditionedLight:
    """The arrays of `Light` for j photos.

    Attributes:
        power: (j, 681).
        curves: (681, 3).
        power_modes: (j, K, 681).
        curve_modes: (K, 681, 3).
        log_evidence, chi_squared: ().
    """

    power: Array
    curves: Array
    power_modes: Array
    curve_modes: Array
    log_evidence: Array
    chi_squared: Array


def condition(inputs: LightInputs) -> ConditionedLight:
    """The posterior of lamps and curves given the references' ratios, by STEPS of Gauss and Newton."""
    xp, j = namespace(inputs.lamp), inputs.lamp.shape[0]
    (p, m), (q, _, _), rows = inputs.lamp_modes.shape, inputs.curve_modes.shape, 2 * j
    by_wavelength = xp.reshape(xp.permute_dims(inputs.curve_modes, (1, 0, 2)), (m, 3 * q))
    against_green = constant(xp, [[1.0, 0.0], [-1.0, -1.0], [0.0, 1.0]])
    shared = constant(xp, np.eye(2) + 1.0)  # green's noise is in both ratios
    seen = xp.reshape(xp.broadcast_to(inputs.measured[:, None], (j, 2)), (rows,)) > 0.5
    of_photos = eye(xp, j) * inputs.ratio_error**2
    reference = xp.reshape(of_photos[:, None, :, None] * shared[None, :, None, :], (rows, rows))

    def at(mean: Array) -> tuple[Array, Array]:
        """Power (j, 681) and curves (681, 3)."""
        bend = xp.maximum(1.0 + (inputs.of_photo * mean[None, :p]) @ inputs.lamp_modes, DARKEST)
        change = xp.reshape(mean[None, p:] @ xp.reshape(inputs.curve_modes, (q, 3 * m)), (m, 3))
        return inputs.lamp * bend, inputs.curves + change

    mean = xp.zeros((p + q,), dtype=xp.float64)
    for _ in range(STEPS):
        power, curves = at(mean)
        own = inputs.own_lamp[None, :]
        here, there = power @ curves, own @ curves  # (j, 3), (1, 3)
        by_lamp = (
            (inputs.lamp[:, None, :] * inputs.lamp_modes) @ curves / here[:, None, :] * inputs.of_photo[:, :, None]
        )
        by_curve = xp.reshape(power @ by_wavelength, (j, q, 3)) / here[:, None, :]
        by_curve = by_curve - xp.reshape(own @ by_wavelength, (1, q, 3)) / there
        slope = (xp.concat([by_lamp, by_curve], axis=1) @ against_green).mT
        slope = xp.where(seen[:, None], xp.reshape(slope, (rows, p + q)), 0.0)
        of_own = (own * inputs.own_modes) @ curves / there @ against_green
        own_noise = of_own.mT @ of_own + OWN_WHITE**2 * shared  # the calibration's own white is the same for all
        noise = xp.reshape(xp.broadcast_to(own_noise[None, :, None, :], (j, 2, j, 2)), (rows, rows)) + reference
        expected = xp.log(inputs.own_raw * here / there) @ against_green
        off = xp.reshape(inputs.ratios - expected, (rows,)) + (slope @ mean[:, None])[:, 0]
        off = xp.where(seen, off, 0.0)
        # A photo without ratios has 1 / 2π, which adds nothing to the evidence.
        spread = xp.where(seen[:, None] & seen[None, :], slope @ slope.mT + noise, eye(xp, rows) / (2.0 * np.pi))
        precision, log_det = inverse(spread)
        gain = slope.mT @ precision
        mean = (gain @ off[:, None])[:, 0]
    chi_squared = (off[None, :] @ precision @ off[:, None])[0, 0]
    covariance = eye(xp, p + q) - gain @ slope
    covariance = 0.5 * (covariance + covariance.mT)
    root = whiten(covariance, covariance)[0].mT  # lamps first: later columns do not change a lamp
    power, curves = at(mean)
    power_modes = (inputs.of_photo[:, None, :] * root[:p, :].mT) @ inputs.lamp_modes * inputs.lamp[:, None, :]
    curve_modes = xp.reshape(root[p:, :].mT @ xp.reshape(inputs.curve_modes, (q, 3 * m)), (p + q, m, 3))
    normal = xp.sum(xp.full((rows,), float(np.log(2.0 * np.pi)), dtype=xp.float64))
    return ConditionedLight(
        power, curves, power_modes, curve_modes, -0.5 * (chi_squared + normal + log_det), chi_squared
    )


def lamp_modes(lamp: Lamp) -> Floats:
    """(p, 681) error modes of a lamp, relative to its power: its own modes, and its smooth error."""
    smooth = lamp.tolerance * smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T
    return np.concatenate([lamp.modes, smooth]) if lamp.tolerance > 0 else lamp.modes
