"""Photos for the tests of chart, patches and signals: the renderer of `camssf_lab.simulation.frames` as mosaics."""

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.photo.read.dng import Mosaic
from camssf.spectra import ChartTable, read_camera, read_chart, read_lamp
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import Scene
from camssf_lab.simulation.shot import Frames, photograph

SIZE = (1600, 1200)


def mosaic(samples: NDArray[np.uint16], sensor: Sensor | None = None, **changes: object) -> Mosaic:
    sensor = sensor or Sensor()
    plain = Mosaic(
        path="scene", samples=samples, cfa=sensor.cfa, black=np.full((2, 2), sensor.black),
        white=float(sensor.white_level), make="", model="", exposure=0.01, iso=100.0, orientation=1, gain_maps=(),
        color_matrix1=None, color_matrix2=None, as_shot_neutral=None, sha256="",
    )  # fmt: skip
    return replace(plain, **changes)


def filters(shape: tuple[int, ...], cfa: str = "RGGB") -> NDArray[np.int64]:
    """(h, w) the channel of each sample."""
    cell = np.array(["RGB".index(letter) for letter in cfa]).reshape(2, 2)
    return np.tile(cell, (shape[0] // 2 + 1, shape[1] // 2 + 1))[: shape[0], : shape[1]]


def filtered(colours: Floats, cfa: str = "RGGB") -> Floats:
    """(h, w) of each pixel (h, w, 3) the colour that its filter lets through."""
    return np.take_along_axis(colours, filters(colours.shape[:2], cfa)[..., None], axis=2)[..., 0]


@cache
def table(name: str = "classic24") -> ChartTable:
    return read_chart(name)


@cache
def shoot(
    scene: Scene | None = None, sensor: Sensor | None = None, lamp: str = "D55", chart: str = "classic24"
) -> Frames:
    scene = replace(scene or Scene(), size=SIZE) if scene is None or scene.size == (4000, 3000) else scene
    return photograph(read_camera("Nikon 5100 (NPL)"), read_lamp(lamp), table(chart), scene, sensor or Sensor(), (7,))
