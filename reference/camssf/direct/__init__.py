"""Curves without a chart and without a prior: spectrograph frames and monochromator sweeps."""

from camssf.direct.columns import PathLike
from camssf.direct.extraction import Spectrum, extract
from camssf.direct.monochromator import LARGEST_STEP, sweep
from camssf.direct.result import CHANNELS, FIRST, LAST, Direct, Json
from camssf.direct.spectrograph import FAINTEST, Progress, divide

__all__ = [
    "CHANNELS",
    "FAINTEST",
    "FIRST",
    "LARGEST_STEP",
    "LAST",
    "Direct",
    "Json",
    "PathLike",
    "Progress",
    "Spectrum",
    "divide",
    "extract",
    "sweep",
]
