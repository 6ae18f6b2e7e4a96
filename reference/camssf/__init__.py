"""Camera spectral sensitivities, with error bands, from RAW photos of a ColorChecker.

Each public name is imported on first use, so that `import camssf` stays fast.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from camssf.lazy_names import lazy_names
from camssf.version import __version__ as __version__

if TYPE_CHECKING:
    from camssf.calibration import attempt as attempt
    from camssf.calibration import calibrate as calibrate
    from camssf.documents.document import Answer as Answer
    from camssf.documents.document import Document as Document
    from camssf.documents.document import document_bytes as document_bytes
    from camssf.error_codes import explain_code as explain_code
    from camssf.errors import CalibrationError as CalibrationError
    from camssf.fit.scores import validate as validate
    from camssf.grid import WAVELENGTHS as WAVELENGTHS
    from camssf.options import Options as Options
    from camssf.photo.find.pose import find_chart as find_chart
    from camssf.photo.patches import measure_patches as measure_patches
    from camssf.photo.read.dng import read_dng as read_dng
    from camssf.photo.read.raw import read_raw as read_raw
    from camssf.photo.read.unit import read_unit as read_unit
    from camssf.photo.shot import Shot as Shot
    from camssf.photo.signals import normalise as normalise
    from camssf.recovery.hypotheses import recover as recover
    from camssf.recovery.observation import Observation as Observation
    from camssf.result import Result as Result

_HOME = {
    "attempt": "camssf.calibration",
    "calibrate": "camssf.calibration",
    "document_bytes": "camssf.documents.document",
    "explain_code": "camssf.error_codes",
    "read_dng": "camssf.photo.read.dng",
    "read_raw": "camssf.photo.read.raw",
    "read_unit": "camssf.photo.read.unit",
    "find_chart": "camssf.photo.find.pose",
    "measure_patches": "camssf.photo.patches",
    "normalise": "camssf.photo.signals",
    "recover": "camssf.recovery.hypotheses",
    "validate": "camssf.fit.scores",
    "__version__": "camssf.version",
    "Answer": "camssf.documents.document",
    "CalibrationError": "camssf.errors",
    "Document": "camssf.documents.document",
    "Observation": "camssf.recovery.observation",
    "Options": "camssf.options",
    "Result": "camssf.result",
    "Shot": "camssf.photo.shot",
    "WAVELENGTHS": "camssf.grid",
}

__all__ = [
    "WAVELENGTHS",
    "Answer",
    "CalibrationError",
    "Document",
    "Observation",
    "Options",
    "Result",
    "Shot",
    "attempt",
    "calibrate",
    "document_bytes",
    "explain_code",
    "find_chart",
    "measure_patches",
    "normalise",
    "read_dng",
    "read_raw",
    "read_unit",
    "recover",
    "validate",
]


__getattr__, __dir__ = lazy_names(__name__, _HOME)
