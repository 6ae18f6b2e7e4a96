"""Measures curves without a chart and without a prior, from spectrograph frames or monochromator sweeps."""

from camssf.direct.columns import PathLike
from camssf.direct.extraction import FrameSpectrum, extract
from camssf.direct.monochromator import LARGEST_STEP, sweep
from camssf.direct.result import FIRST, LAST, Direct, Json
from camssf.direct.spectrograph import FAINTEST, Progress, divide
from camssf.grid import CHANNELS

__all__ = [
    "CHANNELS",
    "FAINTEST",
    "FIRST",
    "LARGEST_STEP",
    "LAST",
    "Direct",
    "FrameSpectrum",
    "Json",
    "PathLike",
    "Progress",
    "divide",
    "extract",
    "sweep",
]
