"""Faults of the samples before they are written: tone curves, processing, hot pixels, fewer bits.

Each function changes a `ShotPlan` at one of three severities; `benchmarks.faults` lists them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf_lab.simulation.camera import sites
from camssf_lab.simulation.shot_plan import ShotPlan

_DISPLAY = np.array([[1.9, -0.7, -0.2], [-0.3, 1.6, -0.3], [0.0, -0.6, 1.6]])
"""Matrix from a camera's colours to a display's, like that of a raw converter; rows add up to 1."""


def tone(plan: ShotPlan, power: float) -> ShotPlan:
    """Apply a tone curve to the samples."""

    def curve(samples: NDArray[np.uint16], plan: ShotPlan) -> NDArray[np.uint16]:
        black, span = plan.sensor.black, _full_scale(plan)
        x = (samples - black) / span
        bent = np.sign(x) * np.abs(x) ** power
        return np.asarray(np.clip(np.rint(black + span * bent), 0, plan.sensor.white_level), np.uint16)

    return replace(plan, samples=curve)


def demosaiced(plan: ShotPlan, size: float) -> ShotPlan:
    """Demosaic bilinearly, convert to display colours by 0, 40 or 100 %, and sample a mosaic again."""
    mix = np.eye(3) + size * (_DISPLAY - np.eye(3))
    return _processed(plan, lambda planes: np.einsum("cd,dyx->cyx", mix, planes))


def desaturated(plan: ShotPlan, share: float) -> ShotPlan:
    """Move each colour towards the grey of its pixel by 5, 15 or 35 %, as a picture style does."""
    return _processed(plan, lambda planes: planes + share * (planes.mean(axis=0) - planes))


def chroma(plan: ShotPlan, width: float) -> ShotPlan:
    """Smooth the differences between the colours: chroma noise reduction."""
    from scipy.ndimage import gaussian_filter

    def smoothed(planes: Floats) -> Floats:
        grey = planes.mean(axis=0)
        return np.stack([grey + gaussian_filter(plane - grey, width) for plane in planes])

    return _processed(plan, smoothed)


def resized(plan: ShotPlan, moved: float) -> ShotPlan:
    """Resample the mosaic as if it were a grey picture, by 0.1, 0.25 or 0.5 pixels: it mixes the colours."""

    def resample(samples: NDArray[np.uint16], plan: ShotPlan) -> NDArray[np.uint16]:
        from scipy.ndimage import shift

        return np.asarray(np.rint(shift(samples.astype(float), moved, order=1, mode="nearest")), np.uint16)

    return replace(plan, samples=resample)


def quad(plan: ShotPlan, size: int) -> ShotPlan:
    """A mosaic of 4 × 4 (quad Bayer) that the camera has turned into one of 2 × 2, on windows of 3, 5 or 7 pixels."""
    from scipy.ndimage import uniform_filter

    def again(planes: Floats) -> Floats:
        height, width = planes.shape[1:]
        y, x = np.mgrid[:height, :width] // 2 % 2
        colour = np.array([[0, 1], [1, 2]])[y, x]
        filled = []
        for c, plane in enumerate(planes):
            known = (colour == c).astype(float)
            around = uniform_filter(known * plane, size) / np.maximum(uniform_filter(known, size), 1e-9)
            filled.append(np.where(known > 0, plane, np.where(uniform_filter(known, size) > 1e-9, around, plane)))
        return np.stack(filled)

    return _processed(plan, again)


def burst(plan: ShotPlan, size: float) -> ShotPlan:
    """The mean of 2, 4 or 8 photos: right colours with less noise."""
    sensor = plan.sensor
    return replace(plan, sensor=replace(sensor, full_well=sensor.full_well * size))


def _processed(plan: ShotPlan, process: Callable[[Floats], Floats]) -> ShotPlan:
    """The plan whose frames are demosaiced bilinearly, balanced, processed (3, height, width) and made mosaics."""

    def cook(samples: NDArray[np.uint16], plan: ShotPlan) -> NDArray[np.uint16]:
        from scipy.ndimage import convolve

        black = plan.sensor.black
        kernel = np.array([[0.25, 0.5, 0.25], [0.5, 1, 0.5], [0.25, 0.5, 0.25]])
        light = samples.astype(np.float64) - black
        power = plan.lamp.values @ plan.camera.values * plan.sensor.gains
        balance = power.max() / power  # a converter balances white before its matrix
        full = []
        for c in range(3):
            known, mask = np.zeros_like(light), np.zeros_like(light)
            for rows, columns, colour in sites(plan.sensor.cfa, *light.shape):
                if colour == c:
                    known[rows, columns], mask[rows, columns] = light[rows, columns], 1
            between = convolve(known, kernel, mode="mirror") / convolve(mask, kernel, mode="mirror")
            full.append(np.where(mask > 0, known, between) * balance[c])
        mixed = process(np.stack(full)) / balance[:, None, None]
        for rows, columns, colour in sites(plan.sensor.cfa, *light.shape):
            light[rows, columns] = mixed[colour][rows, columns]
        return np.asarray(np.clip(np.rint(light + black), 0, plan.sensor.white_level), np.uint16)

    return replace(plan, samples=cook)


def hot(plan: ShotPlan, size: tuple[int, float]) -> ShotPlan:
    """Add hot pixels to all frames."""
    seed, share = size

    def burn(samples: NDArray[np.uint16], plan: ShotPlan) -> NDArray[np.uint16]:
        rng = np.random.default_rng(seed)  # the same pixels in every frame
        hot = rng.random(samples.shape) < share
        glow = rng.exponential(0.25 * _full_scale(plan), samples.shape)
        return np.asarray(np.minimum(samples + np.where(hot, glow, 0), plan.sensor.white_level), np.uint16)

    return replace(plan, samples=burn)


def coarse(plan: ShotPlan, bits: int) -> ShotPlan:
    """Quantise the samples to fewer bits."""

    def round_down(samples: NDArray[np.uint16], plan: ShotPlan) -> NDArray[np.uint16]:
        step = (plan.sensor.white_level + 1) / 2**bits
        return np.asarray(np.floor(samples / step) * step, np.uint16)

    return replace(plan, samples=round_down)


def _full_scale(plan: ShotPlan) -> float:
    return plan.sensor.white_level - plan.sensor.black
