"""Camera spectral sensitivities, with error bands, from RAW photos of a ColorChecker.

Names load on first use, so that `import camssf` stays light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from camssf.calibration import calibrate as calibrate
    from camssf.curves.choice import recover as recover
    from camssf.curves.evidence import Evidence as Evidence
    from camssf.documents.result import Calibration as Calibration
    from camssf.documents.shown import Result as Result
    from camssf.errors import CalibrationError as CalibrationError
    from camssf.evidence.scores import validate as validate
    from camssf.options import Options as Options
    from camssf.photo.mosaic import read_dng as read_dng
    from camssf.photo.patches import measure_patches as measure_patches
    from camssf.photo.pose import find_chart as find_chart
    from camssf.photo.signals import normalise as normalise

__version__ = "0.1.0"

_HOME = {
    "calibrate": "camssf.calibration",
    "read_dng": "camssf.photo.mosaic",
    "find_chart": "camssf.photo.pose",
    "measure_patches": "camssf.photo.patches",
    "normalise": "camssf.photo.signals",
    "recover": "camssf.curves.choice",
    "validate": "camssf.evidence.scores",
    "Calibration": "camssf.documents.result",
    "CalibrationError": "camssf.errors",
    "Evidence": "camssf.curves.evidence",
    "Options": "camssf.options",
    "Result": "camssf.documents.shown",
}

__all__ = [
    "Calibration",
    "CalibrationError",
    "Evidence",
    "Options",
    "Result",
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
