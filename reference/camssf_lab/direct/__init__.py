"""Measures curves without a chart and without a prior, from spectrograph frames or monochromator sweeps."""

from camssf.grid import CHANNELS
from camssf.progress import Progress
from camssf_lab.direct.columns import PathLike
from camssf_lab.direct.extraction import FrameSpectrum, extract
from camssf_lab.direct.monochromator import LARGEST_STEP, sweep
from camssf_lab.direct.result import FIRST, LAST, Direct, Json
from camssf_lab.direct.spectrograph import FAINTEST, divide

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
