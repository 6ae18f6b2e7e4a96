"""Readers for spectral files of other programs, one module per format.

In each module `claims` recognises the format by the content, and `read` reads it. `read` raises InvalidArgument for
a text that it cannot read. Values are returned as in the file; `spectra` checks them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import camssf.spectra.readers.camspec as camspec
import camssf.spectra.readers.dcamprof as dcamprof
import camssf.spectra.readers.labelled as labelled
import camssf.spectra.readers.rawtoaces as rawtoaces
import camssf.spectra.readers.spectacle as spectacle
import camssf.spectra.readers.tm27 as tm27
from camssf.grid import Floats


class LampFormat(NamedTuple):
    """A format for the spectrum of one lamp.

    Attributes:
        what: in words.
        claims: whether a text is of the format.
        read: wavelengths (w,) nm and power (w,).
    """

    what: str
    claims: Callable[[str], bool]
    read: Callable[[str, Path], tuple[Floats, Floats]]


class CurvesFormat(NamedTuple):
    """A format for the curves of cameras.

    Attributes:
        what: in words.
        claims: whether a text is of the format.
        read: for each camera, wavelengths (w,) nm and curves (w, 3) red, green, blue.
    """

    what: str
    claims: Callable[[str], bool]
    read: Callable[[str, Path], dict[str, tuple[Floats, Floats]]]


LAMPS = (
    LampFormat("IES TM-27 (.spdx)", tm27.claims, tm27.read),
    LampFormat("rawtoaces JSON", rawtoaces.claims, rawtoaces.read_lamp),
    LampFormat("Sekonic CSV, UPRtek text (.xls)", labelled.claims, labelled.read),
)
CURVES = (
    CurvesFormat("DCamProf JSON", dcamprof.claims, dcamprof.read),
    CurvesFormat("rawtoaces JSON", rawtoaces.claims, rawtoaces.read),
    CurvesFormat("camspec text", camspec.claims, camspec.read),
    CurvesFormat("SPECTACLE CSV", spectacle.claims, spectacle.read),
)
