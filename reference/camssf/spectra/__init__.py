"""Reads spectra by name, by file or from objects: lamps, chart tables, measured cameras."""

from camssf.spectra.cameras import (
    CameraCurves,
    CameraLike,
    MeasuredCurves,
    camera_names,
    read_camera,
    shipped_cameras,
)
from camssf.spectra.charts import ChartLike, ChartTable, chart_names, read_chart
from camssf.spectra.lamps import Lamp, LampLike, lamp_names, read_lamp, with_tolerance
from camssf.spectra.lights import Called, Light, LightLike, Unnamed, read_light
from camssf.spectra.sampled import colour_science

__all__ = [
    "Called",
    "CameraCurves",
    "CameraLike",
    "ChartLike",
    "ChartTable",
    "Lamp",
    "LampLike",
    "Light",
    "LightLike",
    "MeasuredCurves",
    "Unnamed",
    "camera_names",
    "chart_names",
    "colour_science",
    "lamp_names",
    "read_camera",
    "read_chart",
    "read_lamp",
    "read_light",
    "shipped_cameras",
    "with_tolerance",
]
