"""Faults of the light between chart and sensor: highlights, shadows, a hand, shading, motion, defocus.

Each function changes a `ShotPlan` at one of three severities; `benchmarks.faults` lists them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from camssf_lab.simulation.camera import sites
from camssf_lab.simulation.scene import ChartProjection
from camssf_lab.simulation.shot_plan import Light, ShotPlan


def _through(plan: ShotPlan, frame: str, effect: Light) -> ShotPlan:
    """The plan with one more effect on a frame's light, after its present ones."""
    before = plan.light.get(frame)

    def both(light: NDArray[np.float32], chart: ChartProjection) -> NDArray[np.float32]:
        return effect(light if before is None else before(light, chart), chart)

    return replace(plan, light={**plan.light, frame: both})


def specular(plan: ShotPlan, height: float) -> ShotPlan:
    """Add a highlight on one patch."""
    column, row = 2, 2  # red, in the lower half

    def spot(light: NDArray[np.float32], chart: ChartProjection) -> NDArray[np.float32]:
        blob = height * np.exp(-0.5 * (((chart.u - column) / 0.3) ** 2 + ((chart.v - row) / 0.3) ** 2))
        for rows, columns, colour in sites(chart.cfa, *light.shape):
            light[rows, columns] += blob[rows, columns] * np.float32(chart.white[colour])
        return light

    return _through(plan, "chart", spot)


def shadow(plan: ShotPlan, depth: float) -> ShotPlan:
    """Cast a shadow with an edge across the chart."""

    def shade(light: NDArray[np.float32], chart: ChartProjection) -> NDArray[np.float32]:
        edge = 1.0 / (1.0 + np.exp(np.clip((chart.u + 0.5 * chart.v - 3.2) / 0.15, -30, 30)))
        return np.asarray(light * (1 - depth * edge), dtype=np.float32)

    return _through(plan, "chart", shade)


def covered(plan: ShotPlan, size: tuple[float, float]) -> ShotPlan:
    """Cover columns of the chart with a hand, from the right, below a row."""
    columns, top = size

    def hand(light: NDArray[np.float32], chart: ChartProjection) -> NDArray[np.float32]:
        over = (chart.u > 5.5 - columns) & (chart.v > top) & (chart.v < 2.4)
        for rows, cols, colour in sites(chart.cfa, *light.shape):
            part = light[rows, cols]
            part[over[rows, cols]] = chart.reflected[1, colour]
        return light

    return _through(plan, "chart", hand)


def shading(plan: ShotPlan, gain: float) -> ShotPlan:
    """Correct lens shading in the chart photo, but not in the white frame."""

    def corrected(light: NDArray[np.float32], chart: ChartProjection) -> NDArray[np.float32]:
        r2 = _squared_radius(light.shape)
        for rows, columns, colour in sites(chart.cfa, *light.shape):
            light[rows, columns] *= 1 + gain * (1.3, 1.0, 1.1)[colour] * r2[rows, columns]
        return light

    return _through(plan, "chart", corrected)


def colour_shading(plan: ShotPlan, change: float) -> ShotPlan:
    """Shade the chart photo towards the corners, red and blue by opposite amounts: a thin lens, no correction."""

    def shaded(light: NDArray[np.float32], chart: ChartProjection) -> NDArray[np.float32]:
        r2 = _squared_radius(light.shape)
        for rows, columns, colour in sites(chart.cfa, *light.shape):
            light[rows, columns] *= 1 + change * (1.0, 0.0, -1.0)[colour] * r2[rows, columns]
        return light

    return _through(plan, "chart", shaded)


def crosstalk(plan: ShotPlan, share: float) -> ShotPlan:
    """Leak light of the neighbouring pixels, the more the farther from the middle, where light falls in aslant."""
    from scipy.ndimage import uniform_filter

    def leaking(light: NDArray[np.float32], chart: ChartProjection) -> NDArray[np.float32]:
        leak = share * _squared_radius(light.shape)
        return np.asarray((1 - leak) * light + leak * uniform_filter(light, 3), dtype=np.float32)

    return _through(_through(plan, "chart", leaking), "white", leaking)


def other_unit(plan: ShotPlan, change: float) -> ShotPlan:
    """Take the white frame with another unit of the same name, whose red and blue are stronger and weaker."""

    def other(light: NDArray[np.float32], chart: ChartProjection) -> NDArray[np.float32]:
        for rows, columns, colour in sites(chart.cfa, *light.shape):
            light[rows, columns] *= 1 + change * (1.0, 0.0, -1.0)[colour]
        return light

    return _through(plan, "white", other)


def _squared_radius(shape: tuple[int, ...]) -> NDArray[np.float32]:
    """(height, width) squared distance from the middle, 1 in the corners."""
    height, width = shape
    y, x = np.mgrid[:height, :width].astype(np.float32)
    return np.asarray(
        ((x - width / 2) ** 2 + (y - height / 2) ** 2) / ((width / 2) ** 2 + (height / 2) ** 2), dtype=np.float32
    )


def motion(plan: ShotPlan, length: float) -> ShotPlan:
    """Blur the chart photo by a movement of the camera."""
    from scipy.ndimage import uniform_filter1d

    return _blurred(plan, lambda part, pitch: uniform_filter1d(part, max(1, round(length * pitch)), axis=1))


def defocus(plan: ShotPlan, width: float) -> ShotPlan:
    """Blur the chart photo as if out of focus."""
    from scipy.ndimage import gaussian_filter

    return _blurred(plan, lambda part, pitch: gaussian_filter(part, width * pitch))


def _blurred(plan: ShotPlan, blur: Callable[[NDArray[np.float32], float], NDArray[np.float32]]) -> ShotPlan:
    """The plan with the chart photo's light at each site of the CFA cell blurred, given the pitch of its patches."""

    def soft(light: NDArray[np.float32], chart: ChartProjection) -> NDArray[np.float32]:
        pitch = 0.5 / abs(float(np.gradient(chart.u[len(chart.u) // 2]).mean()))  # in samples of one site
        for rows, columns, _ in sites(chart.cfa, *light.shape):
            light[rows, columns] = blur(light[rows, columns], pitch)
        return light

    return _through(plan, "chart", soft)
