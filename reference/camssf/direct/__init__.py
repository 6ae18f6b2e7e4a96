"""Curves without a chart: spectrograph frames and monochromator sweeps."""

from camssf.direct.spectrograph import Direct, Spectrum, divide, extract, sweep

__all__ = ["Direct", "Spectrum", "divide", "extract", "sweep"]
