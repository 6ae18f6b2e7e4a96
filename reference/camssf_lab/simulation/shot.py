"""Simulates one shot in memory: chart, white and dark frame, and their true values.

    signal(pixel) = exposure · Σ R L S dλ / max over channels (Σ 1 L S dλ) · falloff(pixel)      share of full scale
    DN(pixel)     = round(black + (white level − black) · signal + dark current), clipped at 0 and the white level

with R the reflectance at the pixel, L the lamp, S the pixel's channel. The white frame shows an ideal diffuser
(R = 1) and the dark frame gets no light, both at the chart's exposure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.grid import STEP, Floats
from camssf.photo.find.pose import Pose
from camssf.spectra import CameraCurves, ChartTable, Lamp
from camssf_lab.simulation.camera import Sensor, check_sensor, count, sites
from camssf_lab.simulation.scene import Scene, check_scene, fall_off, project, render_mosaic, true_pose
from camssf_lab.simulation.shot_plan import ShotPlan


@dataclass(frozen=True)
class Frames:
    """One shot in memory.

    Attributes:
        chart, white, dark: (h, w) uint16 DN.
        signals: (n, 3) y = Σ R L S dλ / Σ L S dλ of every patch: the expected result of Eq. (5) without glare.
        levels: (n, 3) DN of every patch before falloff, noise and rounding; with black, dark current and glare.
        white_levels: (3,) the same for the ideal diffuser, without glare.
        pose: the true pose of the chart.
    """

    chart: NDArray[np.uint16]
    white: NDArray[np.uint16]
    dark: NDArray[np.uint16]
    signals: Floats
    levels: Floats
    white_levels: Floats
    pose: Pose


def photograph(
    camera: CameraCurves,
    lamp: Lamp,
    table: ChartTable,
    scene: Scene,
    sensor: Sensor,
    seed: Sequence[int] = (0,),
) -> Frames:
    """Simulate one shot in memory: chart, white and dark frame, and their true values.

    Raises:
        InvalidArgument: a setting is out of range, or a channel of the camera does not respond to the lamp.
    """
    return take(ShotPlan(camera, lamp, table, scene, sensor, lamp.name, table.name), seed)


def take(plan: ShotPlan, seed: Sequence[int] = (0,)) -> Frames:
    """Simulate the frames of a plan, in memory; its `tags` and `handed_in` are left to the writer of the files.

    Raises:
        InvalidArgument: as `photograph`.
    """
    scene, sensor = plan.scene, plan.sensor
    check_scene(scene)
    check_sensor(sensor)
    reflected, diffuser = _exposed(plan, plan.lamp)
    if plan.white_lamp is None:
        white = diffuser
    else:
        _, white = _exposed(plan, plan.white_lamp)
    width, height = scene.size
    flat = np.empty((height, width), dtype=np.float32)
    for rows, columns, colour in sites(sensor.cfa, height, width):
        flat[rows, columns] = plan.white_level * white[colour]
    fall_off(flat, scene.vignetting)
    light = render_mosaic(scene, reflected, diffuser, sensor.cfa)
    if plan.light:
        chart_at = project(scene, reflected, diffuser, sensor.cfa)
        flat = plan.light["white"](flat, chart_at) if "white" in plan.light else flat
        light = plan.light["chart"](light, chart_at) if "chart" in plan.light else light
    chart = count(light, sensor, np.random.default_rng([*seed, 0]))
    del light
    lit = count(flat, sensor, np.random.default_rng([*seed, 1]))
    warm = replace(sensor, dark_current=sensor.dark_current + plan.dark_offset)
    dark = count(np.zeros_like(flat), warm, np.random.default_rng([*seed, 2]))
    if plan.samples is not None:
        chart, lit, dark = (plan.samples(frame, plan) for frame in (chart, lit, dark))
    offset = sensor.black + sensor.dark_current
    levels = reflected + scene.glare * diffuser + offset
    signals = reflected / diffuser
    return Frames(chart, lit, dark, signals, levels, diffuser + offset, true_pose(scene))


def _exposed(plan: ShotPlan, lamp: Lamp) -> tuple[Floats, Floats]:
    """Light of the patches (n, 3) and of an ideal diffuser (3,) under a lamp, DN above black."""
    sensor, curves = plan.sensor, plan.camera.values
    diffuser = np.einsum("m,mc->c", lamp.values, curves) * STEP * sensor.gains
    if not diffuser.min() > 0:
        raise InvalidArgument(
            f"Camera {plan.camera.name} has a channel without response to lamp {lamp.name}.",
            "Choose a lamp with power between 400 and 700 nm.",
        )
    reflected = np.einsum("nm,m,mc->nc", plan.table.values, lamp.values, curves) * STEP * sensor.gains
    scale = sensor.exposure * (sensor.white_level - sensor.black) / float(diffuser.max())
    return scale * reflected, scale * diffuser
