"""Camera spectral sensitivities, with error bands, from RAW photos of a ColorChecker.

Names load on first use, so that `import camssf` stays light.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from camssf.calibrate import calibrate as calibrate
    from camssf.chart import find_chart as find_chart
    from camssf.errors import CalibrationError as CalibrationError
    from camssf.mosaic import read_dng as read_dng
    from camssf.patches import measure_patches as measure_patches
    from camssf.signals import normalise as normalise
    from camssf.ssf import recover as recover
    from camssf.validate import validate as validate

__version__ = "0.1.0"

_HOME = {
    "calibrate": "camssf.calibrate",
    "read_dng": "camssf.mosaic",
    "find_chart": "camssf.chart",
    "measure_patches": "camssf.patches",
    "normalise": "camssf.signals",
    "recover": "camssf.ssf",
    "validate": "camssf.validate",
    "CalibrationError": "camssf.errors",
}

__all__ = [
    "CalibrationError",
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


class _Package(ModuleType):
    """Keeps `camssf.calibrate` the verb: Python would put the submodule of that name in its place."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
