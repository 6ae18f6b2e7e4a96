"""All errors of camssf: a tree of classes with one code for each leaf and one exit status for each family.

CalibrationError
├── InvalidArgument        invalid_argument    2   the call itself
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
│   ├── BandsTooWide       bands_too_wide
│   ├── UnevenLight        uneven_light
│   ├── FramesDiffer       frames_differ
│   ├── UnitDiffers        unit_differs
│   ├── Blurred            blurred
│   └── Glare              glare
├── LampUnfit              lamp_unfit          6   the light
├── NotConverged           not_converged       7   the solver's duality gap
├── CameraUnusual          camera_unusual      8   the camera, unlike those of every basis
├── ColourOutOfReach       colour_out_of_reach 9   a colour that no surface can have
├── PassportInvalid        passport_invalid   10   a signed document
└── OutOfMemory            out_of_memory      11   the photo, too large for the free memory

InvalidArgument is misuse: the caller's code or command is wrong. PassportInvalid is about a signed document. All
others are refusals, which a result can state; data/messages.json has their texts. The codes are the same in Python,
Kotlin and JSON. Every error has an advice: what to do next.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar


class CalibrationError(Exception):
    """A refusal with its reason.

    Attributes:
        code: the error code, the same in every language.
        exit_status: of the command line, one for each family.
        message: what is wrong, with the file or patch concerned.
        advice: what to do next.
        value, threshold: the number that decided and the bound that it broke; None if there is none.
        key: of the message in data/messages.json (`camssf.messages`); empty if it is not in it.
        arguments: values of that message's placeholders.
        reasons, checks: those of the verdict if the verdict refused, else empty.
        capture: what was measured until then, a `Capture`; None if nothing was.
    """

    code: ClassVar[str] = "calibration_error"
    exit_status: ClassVar[int] = 1

    def __init__(
        self,
        message: str,
        advice: str,
        *,
        value: float | None = None,
        threshold: float | None = None,
        key: str = "",
        arguments: Mapping[str, str | int | float] = MappingProxyType({}),
    ) -> None:
        super().__init__(f"{message} {advice}")
        self.message = message
        self.advice = advice
        self.value = value
        self.threshold = threshold
        self.key = key
        self.arguments = dict(arguments)
        self.reasons: tuple[Any, ...] = ()
        self.checks: tuple[Any, ...] = ()
        self.capture: Any = None

    def _render_traceback_(self) -> list[str]:
        """The error as one paragraph, which Jupyter shows in place of a traceback."""
        return [f"{type(self).__name__} ({self.code}): {self.message} {self.advice}"]


class InvalidArgument(CalibrationError):
    """An argument has a wrong shape, value or name."""

    code = "invalid_argument"
    exit_status = 2


class RawError(CalibrationError):
    """The file cannot serve as a photo of the sensor."""

    exit_status = 3


class UnreadableRaw(RawError):
    """The file is missing, truncated, damaged, or not an image."""

    code = "unreadable_raw"


class UnsupportedRaw(RawError):
    """The file is valid, but camssf does not support its format."""

    code = "unsupported_raw"


class NotSensorRaw(RawError):
    """The samples are not the sensor's: demosaiced, merged or tone-mapped."""

    code = "not_sensor_raw"


class ChartError(CalibrationError):
    """The chart in the photo, or its table, cannot be used."""

    exit_status = 4


class ChartNotFound(ChartError):
    """The photo shows no chart of the requested kind, or shows it mirrored."""

    code = "chart_not_found"


class ChartUnfit(ChartError):
    """The chart does not agree with its table, or too few patches are left."""

    code = "chart_unfit"


class CaptureError(CalibrationError):
    """The photo was taken in a way from which no curves can be recovered."""

    exit_status = 5


class Overexposed(CaptureError):
    """Too many samples are clipped."""

    code = "overexposed"


class Underexposed(CaptureError):
    """The signals are too close to the black level."""

    code = "underexposed"


class BandsTooWide(CaptureError):
    """The photos leave the curves too uncertain."""

    code = "bands_too_wide"


class UnevenLight(CaptureError):
    """The light varies across the chart and no white frame corrects it."""

    code = "uneven_light"


class FramesDiffer(CaptureError):
    """Chart, white and dark frame were taken with different settings."""

    code = "frames_differ"


class UnitDiffers(CaptureError):
    """The photos are from different physical cameras or lenses."""

    code = "unit_differs"


class Blurred(CaptureError):
    """Neighbouring patches are blurred into each other."""

    code = "blurred"


class Glare(CaptureError):
    """Stray light lies over the chart."""

    code = "glare"


class LampUnfit(CalibrationError):
    """The lamp's spectrum has no power on the grid, or contradicts the photo."""

    code = "lamp_unfit"
    exit_status = 6


class NotConverged(CalibrationError):
    """The duality gap of the answer is too large: the curves cannot be trusted."""

    code = "not_converged"
    exit_status = 7


class CameraUnusual(CalibrationError):
    """The camera is unlike all cameras that the bases were learned from."""

    code = "camera_unusual"
    exit_status = 8


class ColourOutOfReach(CalibrationError):
    """No surface can have this colour under this lamp."""

    code = "colour_out_of_reach"
    exit_status = 9


class PassportInvalid(CalibrationError):
    """A passport, or a list of revoked ones, was changed, has expired, or is not signed by a trusted key."""

    code = "passport_invalid"
    exit_status = 10


class OutOfMemory(CalibrationError):
    """The photo does not fit into the memory available to the program."""

    code = "out_of_memory"
    exit_status = 11


BY_CODE: Mapping[str, type[CalibrationError]] = MappingProxyType(
    {
        kind.code: kind
        for kind in tuple(globals().values())
        if isinstance(kind, type) and issubclass(kind, CalibrationError) and kind.code != CalibrationError.code
    }
)
"""Each leaf of the tree by its code."""
