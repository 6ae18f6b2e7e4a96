"""Camera spectral sensitivities, with error bands, from RAW photos of a ColorChecker.

Each public name is imported on first use, so that `import camssf` stays fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from camssf.version import __version__ as __version__

if TYPE_CHECKING:
    from camssf.calibration import calibrate as calibrate
    from camssf.errors import CalibrationError as CalibrationError
    from camssf.fit.scores import validate as validate
    from camssf.options import Options as Options
    from camssf.photo.find.pose import find_chart as find_chart
    from camssf.photo.patches import measure_patches as measure_patches
    from camssf.photo.read.dng import read_dng as read_dng
    from camssf.photo.shot import Shot as Shot
    from camssf.photo.signals import normalise as normalise
    from camssf.recovery.hypotheses import recover as recover
    from camssf.recovery.observation import Observation as Observation
    from camssf.result import Calibration as Calibration
    from camssf.result import Result as Result

_HOME = {
    "calibrate": "camssf.calibration",
    "read_dng": "camssf.photo.read.dng",
    "find_chart": "camssf.photo.find.pose",
    "measure_patches": "camssf.photo.patches",
    "normalise": "camssf.photo.signals",
    "recover": "camssf.recovery.hypotheses",
    "validate": "camssf.fit.scores",
    "Calibration": "camssf.result",
    "CalibrationError": "camssf.errors",
    "Observation": "camssf.recovery.observation",
    "Options": "camssf.options",
    "Result": "camssf.result",
    "Shot": "camssf.photo.shot",
}

__all__ = [
    "Calibration",
    "CalibrationError",
    "Observation",
    "Options",
    "Result",
    "Shot",
    "calibrate",
    "find_chart",
    "measure_patches",
    "normalise",
    "read_dng",
    "recover",
    "validate",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'camssf' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
