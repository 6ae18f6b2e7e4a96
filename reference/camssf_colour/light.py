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
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.recovery.rows import DARKEST
from camssf.spectra import Lamp
from camssf_colour.camera import Camera

STEPS = 4
OWN_WHITE = 0.01
"""Relative error of the calibration's own white ratios by target, drift and noise; its lamp's error is added."""


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
    ends = np.cumsum([0, *(len(mode) for mode in modes)])
    p, q = int(ends[-1]), len(camera.modes)
    mean, covariance = np.zeros(p + q), np.eye(p + q)
    chi_squared, log_evidence = None, 0.0
    seen = [j for j, ratio in enumerate(ratios) if ratio is not None] if camera.own is not None else []
    if seen:
        given = np.concatenate([np.asarray(ratios[j]) for j in seen])
        for _ in range(STEPS):
            by_light = [_ratios(camera, lamps[j], modes[j], mean[ends[j] : ends[j + 1]], mean[p:]) for j in seen]
            expected = np.concatenate([light[0] for light in by_light])
            slope = np.zeros((2 * len(seen), p + q))
            for i, (j, (_, by_lamp, by_curve, _)) in enumerate(zip(seen, by_light, strict=True)):
                slope[2 * i : 2 * i + 2, ends[j] : ends[j + 1]] = by_lamp
                slope[2 * i : 2 * i + 2, p:] = by_curve
            # the calibration's own white is the same for all; green's noise is in both ratios
            noise = np.tile(by_light[0][3], (len(seen), len(seen)))
            noise = noise + np.kron(np.diag([errors[j] ** 2 for j in seen]), np.eye(2) + 1.0)
            off = given - expected + slope @ mean
            spread = slope @ slope.T + noise
            gain = np.linalg.solve(spread, slope).T
            mean = gain @ off
        covariance = np.eye(p + q) - gain @ slope
        chi_squared = float(off @ np.linalg.solve(spread, off))
        log_evidence = -0.5 * (chi_squared + float(np.linalg.slogdet(2.0 * np.pi * spread)[1]))
    root = np.linalg.cholesky(0.5 * (covariance + covariance.T))  # lamps first: later columns do not change a lamp
    curves, curve_modes = _curves(camera, mean[p:]), np.einsum("qmc,qk->kmc", camera.modes, root[p:])
    return [
        Light(
            lamp.name, lamp.values * _bend(modes[j], mean[ends[j] : ends[j + 1]]), curves,
            (modes[j].T @ root[ends[j] : ends[j + 1]]).T * lamp.values, curve_modes, p, log_evidence, chi_squared,
        )
        for j, lamp in enumerate(lamps)
    ]  # fmt: skip


def lamp_modes(lamp: Lamp) -> Floats:
    """(p, 681) error modes of a lamp, relative to its power: its own modes, and its smooth error."""
    smooth = lamp.tolerance * smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T
    return np.concatenate([lamp.modes, smooth]) if lamp.tolerance > 0 else lamp.modes


def _ratios(
    camera: Camera, lamp: Lamp, modes: Floats, at_lamp: Floats, at_curves: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Expected ln ratios (2,) at a point, their derivatives (2, p) and (2, q), and the own white's covariance."""
    assert camera.own is not None
    curves, power = _curves(camera, at_curves), lamp.values * _bend(modes, at_lamp)
    own = camera.own.lamp
    here, there = power @ curves, own.values @ curves  # (3,)
    log = np.log(camera.own.raw * here / there)
    by_lamp = (modes * lamp.values) @ curves / here  # (p, 3)
    by_curve = np.einsum("m,qmc->qc", power, camera.modes) / here
    by_curve = by_curve - np.einsum("m,qmc->qc", own.values, camera.modes) / there
    of_own = _against_green(((lamp_modes(own) * own.values) @ curves / there).T)
    noise = of_own @ of_own.T + OWN_WHITE**2 * (np.eye(2) + 1.0)
    return _against_green(log), _against_green(by_lamp.T), _against_green(by_curve.T), noise


def _against_green(values: Floats) -> Floats:
    return np.asarray(values[[0, 2]] - values[1])


def _bend(modes: Floats, at: Floats) -> Floats:
    return np.maximum(1.0 + at @ modes, DARKEST)


def _curves(camera: Camera, at: Floats) -> Floats:
    return np.asarray(camera.values + np.einsum("q,qmc->mc", at, camera.modes))
