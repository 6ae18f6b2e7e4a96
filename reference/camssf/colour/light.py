"""Camera, lamp and a raw white → what is known of both together.

A camera whose own white is known sees in the raw ratios of a white or grey reference what light fell on it: two
numbers. They are evidence of the lamp's modes, of its smooth error, and of the curves; all are conditioned on them
at once, by Gauss-Newton steps, since ln of a sum is not quite linear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.colour.camera import Camera
from camssf.curves.covariance import LAMP_CORRELATION, smooth_errors
from camssf.curves.sensing import DARKEST
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import Lamp

STEPS = 4
OWN_WHITE = 0.01
"""Relative error of the calibration's own white ratios, beside its lamp's: its target, drift, noise."""


@dataclass(frozen=True)
class Light:
    """Lamp and curves as far as they are known, and the directions in which both may be off.

    Attributes:
        name: of the lamp.
        power: (681,) expected.
        curves: (681, 3) expected.
        power_modes: (K, 681) absolute.
        curve_modes: (K, 681, 3) absolute; the same K errors.
        of_lamp: how many of the K, the first ones, vanish where the lamp is known.
        log_evidence: ln of the density of the reference's ratios; 0 where there are none.
        surprise: χ² of these ratios, two degrees of freedom; None where there are none.
    """

    name: str
    power: Floats
    curves: Floats
    power_modes: Floats
    curve_modes: Floats
    of_lamp: int
    log_evidence: float = 0.0
    surprise: float | None = None


def see(camera: Camera, lamp: Lamp, ratios: Floats | None = None, error: float = 0.0) -> Light:
    """What is known of the light.

    Args:
        camera: with its modes.
        lamp: as it was told, with its tolerance and modes.
        ratios: (2,) ln of the reference's raw red and blue over its green; None where there is no reference, or
            nothing to compare it with.
        error: one standard deviation of them.
    """
    modes = lamp_modes(lamp)
    p, q = len(modes), len(camera.modes)
    mean, covariance = np.zeros(p + q), np.eye(p + q)
    surprise, log_evidence = None, 0.0
    if ratios is not None and camera.own is not None:
        for _ in range(STEPS):
            expected, slope, noise = _ratios(camera, lamp, modes, mean)
            noise = noise + error**2 * (np.eye(2) + 1.0)  # green's noise is in both
            off = ratios - expected + slope @ mean
            spread = slope @ slope.T + noise
            gain = np.linalg.solve(spread, slope).T
            mean = gain @ off
        covariance = np.eye(p + q) - gain @ slope
        surprise = float(off @ np.linalg.solve(spread, off))
        log_evidence = -0.5 * (surprise + float(np.linalg.slogdet(2.0 * np.pi * spread)[1]))
    root = np.linalg.cholesky(0.5 * (covariance + covariance.T))  # the lamp's first: later columns move no lamp
    return Light(
        lamp.name, lamp.values * _bend(modes, mean[:p]), _curves(camera, mean[p:]),
        (modes.T @ root[:p]).T * lamp.values, np.einsum("qmc,qk->kmc", camera.modes, root[p:]),
        p, log_evidence, surprise,
    )  # fmt: skip


def lamp_modes(lamp: Lamp) -> Floats:
    """(p, 681) directions in which a lamp may be off, relative to it: its modes, and its smooth error."""
    smooth = lamp.tolerance * smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T
    return np.concatenate([lamp.modes, smooth]) if lamp.tolerance > 0 else lamp.modes


def _ratios(camera: Camera, lamp: Lamp, modes: Floats, at: Floats) -> tuple[Floats, Floats, Floats]:
    """Expected ln ratios (2,), their slopes (2, p + q) at a point, and the covariance of what is not in the modes."""
    assert camera.own is not None
    p = len(modes)
    curves, power = _curves(camera, at[p:]), lamp.values * _bend(modes, at[:p])
    own = camera.own.lamp
    here, there = power @ curves, own.values @ curves  # (3,)
    log = np.log(camera.own.raw * here / there)
    by_lamp = (modes * lamp.values) @ curves / here  # (p, 3)
    by_curve = np.einsum("m,qmc->qc", power, camera.modes) / here
    by_curve = by_curve - np.einsum("m,qmc->qc", own.values, camera.modes) / there
    slope = _against_green(np.concatenate([by_lamp, by_curve]).T)
    of_own = _against_green(((lamp_modes(own) * own.values) @ curves / there).T)
    return _against_green(log), slope, of_own @ of_own.T + OWN_WHITE**2 * (np.eye(2) + 1.0)


def _against_green(values: Floats) -> Floats:
    return np.asarray(values[[0, 2]] - values[1])


def _bend(modes: Floats, at: Floats) -> Floats:
    return np.maximum(1.0 + at @ modes, DARKEST)


def _curves(camera: Camera, at: Floats) -> Floats:
    return np.asarray(camera.values + np.einsum("q,qmc->mc", at, camera.modes))
