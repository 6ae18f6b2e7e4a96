"""One shot before it is taken: the truth, what goes wrong, what the files and the user say of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf.simulation.camera import Sensor
from camssf.simulation.scene import ChartProjection, Scene
from camssf.spectra import CameraCurves, ChartTable, Lamp


@dataclass(frozen=True)
class FileTags:
    """What a frame's file says of itself, whether or not it is true.

    Attributes:
        cfa, black, white_level: as in `Sensor`, DN.
        exposure: seconds. iso: sensitivity.
    """

    cfa: str
    black: float
    white_level: int
    exposure: float = 0.01
    iso: float = 100.0


Light: TypeAlias = Callable[[NDArray[np.float32], ChartProjection], NDArray[np.float32]]

Samples: TypeAlias = Callable[[NDArray[np.uint16], "Setup"], NDArray[np.uint16]]


@dataclass(frozen=True)
class Setup:
    """One shot before it is taken: what lies there, what the camera does with it, what the user says of it.

    Attributes:
        camera, lamp, table, scene, sensor: the truth about the chart photo.
        stated_lamp: the spec that the user names; stated_chart: likewise.
        white_lamp: the light on the white frame; None for the chart's own.
        white_level: brightness of the white frame's target, 1 for an ideal diffuser in the chart's light.
        dark_offset: DN that the dark frame has more than the others.
        light: what happens to the light on its way to the "chart" or "white" frame.
        samples: what software does to the samples of all frames.
        tags: changes of what the files say, by frame.
        handed_in: which frame is handed in as what; None where there is none.
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
        """What the file of "chart", "white" or "dark" says."""
        sensor = self.sensor
        return replace(FileTags(sensor.cfa, sensor.black, sensor.white_level), **self.tags.get(frame, {}))


Change: TypeAlias = Callable[[Setup], Setup]
