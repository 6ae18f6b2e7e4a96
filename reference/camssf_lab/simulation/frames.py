"""Writes simulated shots of a chart as DNG files, with their true values, for the demo and the tests."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from os import PathLike
from pathlib import Path

import numpy as np

from camssf.errors import InvalidArgument
from camssf.files import local_folder, write_together
from camssf.grid import Floats
from camssf.photo.find.pose import Pose
from camssf.photo.shot import Shot
from camssf.spectra import CameraCurves, CameraLike, ChartLike, Lamp, LampLike, read_camera, read_chart, read_lamp
from camssf.spectra.sampled import is_one
from camssf_lab.simulation.camera import Sensor, check_sensor
from camssf_lab.simulation.dng import is_simulated, write_dng, write_truth
from camssf_lab.simulation.scene import (
    Scene,
    check_scene,
    true_pose,
)
from camssf_lab.simulation.shot import Frames, take
from camssf_lab.simulation.shot_plan import Change, ShotPlan


@dataclass(frozen=True)
class SimulatedShot:
    """The files of one lamp; a fault may leave out the white or the dark frame.

    `lamp` and `stated_chart` are the inputs of a calibration; `signals` (n, 3) is the expected result of Eq. (5).
    """

    chart: Path
    white: Path | None
    dark: Path | None
    lamp: str
    stated_chart: str
    signals: Floats

    @property
    def shot(self) -> Shot:
        """The shot as `camssf.calibrate` takes it."""
        return Shot(self.chart, self.lamp, self.white, self.dark)


@dataclass(frozen=True)
class Simulation:
    """The files of a simulation, and its settings.

    Attributes:
        shots: one for each lamp, in the order of the lamps.
        truth: path of the CSV of the camera's curves, peak 1.
        corners: path of the JSON of the chart's corners in each chart photo, for `--corners`.
        pose: true pose of the chart in the chart photos, without a fault.
        camera, chart: their names.
        scene, sensor: all settings.
        seed: seed of the noise.
    """

    shots: tuple[SimulatedShot, ...]
    truth: Path
    pose: Pose
    camera: str
    chart: str
    scene: Scene
    sensor: Sensor
    seed: int
    corners: Path


def simulate(
    camera: CameraLike,
    lamps: LampLike | Sequence[LampLike],
    out: str | Path,
    *,
    chart: ChartLike = "classic24",
    scene: Scene | None = None,
    sensor: Sensor | None = None,
    seed: int = 0,
    change: Change | None = None,
) -> Simulation:
    """Write chart, white and dark frame of every lamp as DNG, truth.csv with the camera's curves, and corners.json.

    One lamp gives `chart.dng white.dng dark.dng`, several `chart-<lamp>.dng` and so on. All files appear, or none.

    Args:
        camera: as `camssf.spectra.read_camera` accepts it.
        lamps: as `read_lamp` accepts them, one for each shot.
        out: folder; created if missing.
        chart: as `read_chart` accepts it; its layout becomes the scene's.
        scene: geometry and optics.
        sensor: properties of the sensor and of its files.
        seed: seed of the noise; the same seed gives the same bytes.
        change: a change of the last lamp's shot, such as a fault.

    Raises:
        InvalidArgument: a setting is out of range, the chart does not fit into the picture, or a file that no
            simulation wrote would be replaced.
    """
    scene, sensor = scene or Scene(), sensor or Sensor()
    body = read_camera(camera)
    table = read_chart(chart)
    one = isinstance(lamps, str | PathLike | Lamp) or is_one(lamps)
    lights = [read_lamp(lamp) for lamp in ([lamps] if one else list(lamps))]  # type: ignore[arg-type]
    if not lights:
        raise InvalidArgument("A simulation needs a lamp.", 'Name one, for example "D55".')
    scene = replace(scene, layout=table.layout)
    check_scene(scene)
    check_sensor(sensor)
    if seed < 0:
        raise InvalidArgument(f"Seed {seed} is below 0.", "Choose a whole number of at least 0.")
    if sensor.compression and find_spec("imagecodecs") is None:
        raise InvalidArgument("Lossless JPEG needs imagecodecs.", "Install it, or leave compression out.")
    pose = true_pose(scene)
    if not ((pose.corners >= 0) & (pose.corners <= np.array(scene.size) - 1)).all():
        raise InvalidArgument(
            "The chart reaches beyond the picture.", "Make fill smaller, or rotate or tilt it less."
        )
    plans = [ShotPlan(body, light, table, scene, sensor, light.name, table.name) for light in lights]
    if change is not None:
        plans[-1] = change(plans[-1])
    files = [_names(plan, tag) for plan, tag in zip(plans, _tags(lights), strict=True)]
    folder = local_folder(out)
    truth, corners = folder / "truth.csv", folder / "corners.json"
    check_replaced(folder, [*(name for names in files for name in names.values()), truth.name, corners.name])
    with write_together(folder) as aside:
        shots = []
        poses: dict[str, Pose] = {}
        for number, (plan, names) in enumerate(zip(plans, files, strict=True)):
            frames = take(plan, (seed, number))
            _write_frames(aside, names, plan, frames, body)
            if plan.handed_in["chart"] == "chart":  # a fault may hand in a frame without a chart
                poses[names["chart"]] = true_pose(plan.scene)
            paths = {role: folder / name for role, name in names.items()}
            shots.append(
                SimulatedShot(
                    paths["chart"],
                    paths.get("white"),
                    paths.get("dark"),
                    plan.stated_lamp,
                    plan.stated_chart,
                    frames.signals,
                )
            )
        write_truth(aside / truth.name, body)
        (aside / corners.name).write_text(corners_json(poses), "utf-8")
    return Simulation(tuple(shots), truth, pose, body.name, table.name, scene, sensor, seed, corners)


def check_replaced(folder: Path, names: Iterable[str]) -> None:
    """Raise if a file that no simulation wrote would be replaced."""
    for path in (folder / name for name in names):
        if path.is_dir():
            raise InvalidArgument(f"{path} is a folder; a file goes there.", "Name another folder by -o.")
        simulated = is_simulated(path) if path.suffix == ".dng" else _is_simulation(folder)
        if path.is_file() and not simulated:
            raise InvalidArgument(
                f"{path} is not a simulated file; it would be replaced.", "Name another folder by -o."
            )


def _is_simulation(folder: Path) -> bool:
    """Whether a folder's corners.json is that of simulated photos in it."""
    try:
        photos = json.loads((folder / "corners.json").read_text("utf-8"))["photos"]
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return isinstance(photos, dict) and all(is_simulated(folder / name) for name in photos)


def corners_json(poses: Mapping[str, Pose]) -> str:
    """JSON text `camssf-corners/1`: corners of the block of patches and layout of each photo, by file name.

    Corners are px of the active area, the chart's top left, top right, bottom right, bottom left, as in
    `--corners` and Kotlin's `Corners`.
    """
    photos = {
        name: {"layout": pose.layout, "corners": pose.corners.tolist(), "quarter_turns": pose.quarter_turns}
        for name, pose in poses.items()
    }
    return json.dumps({"format": "camssf-corners/1", "photos": photos}, indent=1) + "\n"


def _names(plan: ShotPlan, tag: str) -> dict[str, str]:
    """File names of the frames that are handed in, by role."""
    return {role: f"{role}{tag}.dng" for role, frame in plan.handed_in.items() if frame is not None}


def _write_frames(
    folder: Path, names: Mapping[str, str], plan: ShotPlan, frames: Frames, camera: CameraCurves
) -> None:
    """Write the frames that are handed in."""
    sensor = plan.sensor
    samples = {"chart": frames.chart, "white": frames.white, "dark": frames.dark}
    neutral = (frames.white_levels - sensor.black - sensor.dark_current) / sensor.exposure
    neutral /= sensor.white_level - sensor.black
    for role, name in names.items():
        frame = plan.handed_in[role]
        assert frame is not None
        write_dng(folder / name, samples[frame], plan.file_tags(frame), camera, neutral, sensor.compression)


def _tags(lamps: list[Lamp]) -> list[str]:
    """Suffixes that distinguish the lamps' files; "" for a single lamp."""
    if len(lamps) == 1:
        return [""]
    tags: list[str] = []
    for lamp in lamps:
        tag = "-" + (re.sub(r"[^A-Za-z0-9.]+", "-", Path(lamp.name).stem).strip("-.") or "lamp")
        again = sum(other == tag or other.startswith(tag + "~") for other in tags)
        tags.append(f"{tag}~{again + 1}" if again else tag)
    return tags
