"""Every way camssf says no: one tree, one code a leaf, one exit status a family.

CalibrationError
├── InvalidArgument        invalid_argument    2   the call itself is wrong
├── RawError                                   3   the file
│   ├── UnreadableRaw      unreadable_raw
│   ├── UnsupportedRaw     unsupported_raw
│   └── NotSensorRaw       not_sensor_raw
├── ChartError                                 4   the chart in the photo
│   ├── ChartNotFound      chart_not_found
│   └── ChartUnfit         chart_unfit
├── CaptureError                               5   how the photo was taken
│   ├── Overexposed        overexposed
│   ├── Underexposed       underexposed
│   ├── UnevenLight        uneven_light
│   ├── FramesDiffer       frames_differ
│   ├── UnitDiffers        unit_differs
│   ├── Blurred            blurred
│   └── Glare              glare
├── LampUnfit              lamp_unfit          6   the light
├── NotConverged           not_converged       7   the solver's own proof failed
├── CameraUnusual          camera_unusual      8   no basis knows such a camera
├── ColourOutOfReach       colour_out_of_reach 9   a colour that no surface has
├── PassportInvalid        passport_invalid   10   a signed document that is not to be trusted
└── OutOfMemory            out_of_memory      11   the photo is too large for the memory that is left

The codes are the same in Python, Kotlin and JSON. Every error carries an advice: what to do next.
"""

from __future__ import annotations

from typing import Any, ClassVar


class CalibrationError(Exception):
    """A refusal with its reason.

    Attributes:
        code: the word of the vocabulary, the same in every language.
        exit_status: of the command line, one a family.
        message: what is wrong, with the file or patch it is about.
        advice: what to do next.
        value, threshold: the number that decided and the bound it broke, where there is one.
        reasons, checks: of a verdict that refused; empty where a stage did.
    """

    code: ClassVar[str] = "calibration_error"
    exit_status: ClassVar[int] = 1

    def __init__(
        self, message: str, advice: str, *, value: float | None = None, threshold: float | None = None
    ) -> None:
        super().__init__(f"{message} {advice}")
        self.message = message
        self.advice = advice
        self.value = value
        self.threshold = threshold
        self.reasons: tuple[Any, ...] = ()
        self.checks: tuple[Any, ...] = ()


class InvalidArgument(CalibrationError):
    """An argument has a wrong shape, value or name."""

    code = "invalid_argument"
    exit_status = 2


class RawError(CalibrationError):
    """The file cannot serve as a photo of the sensor."""

    exit_status = 3


class UnreadableRaw(RawError):
    """Missing, truncated, damaged, or not an image file."""

    code = "unreadable_raw"


class UnsupportedRaw(RawError):
    """A sound file in a form that camssf does not read."""

    code = "unsupported_raw"


class NotSensorRaw(RawError):
    """The samples are not the sensor's: demosaiced, merged or tone-mapped."""

    code = "not_sensor_raw"


class ChartError(CalibrationError):
    """The chart in the photo, or its table, does not serve."""

    exit_status = 4


class ChartNotFound(ChartError):
    """No chart of the asked kind lies in the photo, or it is mirrored."""

    code = "chart_not_found"


class ChartUnfit(ChartError):
    """The chart does not agree with its table, or too few patches are left."""

    code = "chart_unfit"


class CaptureError(CalibrationError):
    """The photo was taken in a way that carries no answer."""

    exit_status = 5


class Overexposed(CaptureError):
    """Too many samples at the sensor's ceiling."""

    code = "overexposed"


class Underexposed(CaptureError):
    """Signals too close to the black level."""

    code = "underexposed"


class UnevenLight(CaptureError):
    """The light falls off across the chart and no white frame corrects it."""

    code = "uneven_light"


class FramesDiffer(CaptureError):
    """Chart, white and dark frame were not taken alike."""

    code = "frames_differ"


class UnitDiffers(CaptureError):
    """Photos of different physical cameras or lenses."""

    code = "unit_differs"


class Blurred(CaptureError):
    """Neighbouring patches run into each other."""

    code = "blurred"


class Glare(CaptureError):
    """Light that no patch reflects lies over the chart."""

    code = "glare"


class LampUnfit(CalibrationError):
    """The lamp's spectrum has no power on the grid, or contradicts the photo."""

    code = "lamp_unfit"
    exit_status = 6


class NotConverged(CalibrationError):
    """The duality gap of the answer is not small: there is no curve to trust."""

    code = "not_converged"
    exit_status = 7


class CameraUnusual(CalibrationError):
    """A camera unlike all that the bases were learned from."""

    code = "camera_unusual"
    exit_status = 8


class ColourOutOfReach(CalibrationError):
    """A colour that no surface has under this lamp, so that the curves cannot carry it."""

    code = "colour_out_of_reach"
    exit_status = 9


class PassportInvalid(CalibrationError):
    """A passport, or a list of what was called back, that is changed, has ended, or is signed by nobody trusted."""

    code = "passport_invalid"
    exit_status = 10


class OutOfMemory(CalibrationError):
    """The photo does not fit into the memory that the program may use."""

    code = "out_of_memory"
    exit_status = 11
