"""Other people's files of spectra, one module a format.

Each module says whether a text is of its format (`claims`), by the content alone, and reads it (`read`); whatever it
claims and cannot read is an InvalidArgument. Values are as the file has them: `spectra` judges them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import camssf.spectra.formats.camspec as camspec
import camssf.spectra.formats.dcamprof as dcamprof
import camssf.spectra.formats.rawtoaces as rawtoaces
import camssf.spectra.formats.sekonic as sekonic
import camssf.spectra.formats.spectacle as spectacle
import camssf.spectra.formats.tm27 as tm27
import camssf.spectra.formats.uprtek as uprtek
from camssf.grid import Floats


class LampFormat(NamedTuple):
    """A file of one spectrum of light.

    Attributes:
        what: in words.
        claims: whether a text is of the format.
        read: wavelengths (w,) nm and power (w,).
    """

    what: str
    claims: Callable[[str], bool]
    read: Callable[[str, Path], tuple[Floats, Floats]]


class CurvesFormat(NamedTuple):
    """A file of cameras.

    Attributes:
        what: in words.
        claims: whether a text is of the format.
        read: by camera wavelengths (w,) nm and curves (w, 3) red, green, blue.
    """

    what: str
    claims: Callable[[str], bool]
    read: Callable[[str, Path], dict[str, tuple[Floats, Floats]]]


LAMPS = (
    LampFormat("IES TM-27 (.spdx)", tm27.claims, tm27.read),
    LampFormat("Sekonic CSV", sekonic.claims, sekonic.read),
    LampFormat("UPRtek text (.xls)", uprtek.claims, uprtek.read),
)
CURVES = (
    CurvesFormat("DCamProf JSON", dcamprof.claims, dcamprof.read),
    CurvesFormat("rawtoaces JSON", rawtoaces.claims, rawtoaces.read),
    CurvesFormat("camspec text", camspec.claims, camspec.read),
    CurvesFormat("SPECTACLE CSV", spectacle.claims, spectacle.read),
)
