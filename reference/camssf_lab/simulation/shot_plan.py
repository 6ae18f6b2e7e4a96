"""Plans one simulated shot: true scene and camera, faults, and the statements of the files and the user."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf.spectra import CameraCurves, ChartTable, Lamp
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import ChartProjection, Scene


@dataclass(frozen=True)
class FileTags:
    """The tags of a frame's file, whether or not they are true.

    Attributes:
        cfa, black, white_level: as in `Sensor`, DN.
        exposure: exposure time, s.
        iso: sensitivity.
        make, model: of the camera; "" for camssf and the camera's name.
    """

    cfa: str
    black: float
    white_level: int
    exposure: float = 0.01
    iso: float = 100.0
    make: str = ""
    model: str = ""


Light: TypeAlias = Callable[[NDArray[np.float32], ChartProjection], NDArray[np.float32]]

Samples: TypeAlias = Callable[[NDArray[np.uint16], "ShotPlan"], NDArray[np.uint16]]


@dataclass(frozen=True)
class ShotPlan:
    """Plan of one simulated shot: scene, camera, faults, and the statements of the user.

    Attributes:
        camera, lamp, table, scene, sensor: true values of the chart photo.
        stated_lamp, stated_chart: the specs that the user names.
        white_lamp: the lamp of the white frame; None for the chart's lamp.
        white_level: brightness of the white frame's target, 1 for an ideal diffuser in the chart's light.
        dark_offset: additional signal of the dark frame, DN.
        light: changes of the light on its way to the "chart" or "white" frame.
        samples: change of the samples of all frames by software.
        tags: changes of the file tags, by frame.
        handed_in: the frame that is handed in for each role; None for none.
    """

    camera: CameraCurves
    lamp: Lamp
    table: ChartTable
    scene: Scene
    sensor: Sensor
    stated_lamp: str
    stated_chart: str
    white_lamp: Lamp | None = None
    white_level: float = 1.0
    dark_offset: float = 0.0
    light: Mapping[str, Light] = field(default_factory=dict)
    samples: Samples | None = None
    tags: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    handed_in: Mapping[str, str | None] = field(
        default_factory=lambda: {"chart": "chart", "white": "white", "dark": "dark"}
    )

    def file_tags(self, frame: str) -> FileTags:
        """The tags in the file of "chart", "white" or "dark"."""
        sensor = self.sensor
        true = FileTags(sensor.cfa, sensor.black, sensor.white_level, make=sensor.make, model=sensor.model)
        return replace(true, **self.tags.get(frame, {}))


Change: TypeAlias = Callable[[ShotPlan], ShotPlan]
