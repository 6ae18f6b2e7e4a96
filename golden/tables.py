"""Makes golden/spectra, the spectra that cases use by name; rounded, because the rounded numbers are the inputs."""

from __future__ import annotations

import numpy as np

from camssf.grid import Floats
from camssf.spectra import read_chart, read_lamp
from golden.forms import ROOT, Json, digest, spectra

CURVES = ROOT.parent / "data" / "ssf" / "rawtoaces.csv"
CHARTS = {"babelcolor": "classic24", "ohta": "classic24:ohta"}
LAMPS = ("D55", "A", "LED-B3", "FL2")
KINDS = ("daylight", "white-led", "fluorescent")
"""Kinds of lamp: the mean is stored among the lamps, the modes separately."""
CAMERAS = (
    "ARRI D21", "Arashi Vision Insta360 X5", "Canon EOS 5D Mark II", "Canon EOS R5", "Fujifilm X-T3",
    "Hasselblad L1D-20c", "Nikon D5100", "Nikon Z f", "Panasonic DC-GX9", "Sony ILCE-7M3", "Sony DSC-RX100M4",
)  # fmt: skip
DECIMALS = 6


def write_tables() -> dict[str, Json]:
    """The content of golden/spectra/<name>.json, by name."""
    from camssf_lab.learning.training import read_curves

    science, every, nodes = "colour-science, BSD-3-Clause", "every 0.5 nm", "every 5 nm, straight between"
    curves, file = read_curves(CURVES), digest(CURVES.read_bytes())
    kinds = {name: read_lamp(name) for name in KINDS}
    tables = {
        "charts": (f"{science}: BabelColor Average and ColorChecker N Ohta, by camssf.spectra.read_chart", every,
                   {name: _settled(name, read_chart(spec).values) for name, spec in CHARTS.items()}),
        "lamps": (f"{science}: CIE illuminants, scaled to a mean of 1, by camssf.spectra.read_lamp", every,
                  {name: _rounded(read_lamp(name).values) for name in LAMPS + KINDS}),
        "modes": (f"{science}: what lamps of a kind differ by, in parts of the kind's mean among the lamps, one "
                  "standard deviation each, by camssf.spectra.read_lamp", nodes,
                  {name: _rounded(_upright(kind.modes[:, ::10])) for name, kind in kinds.items()}),
        "cameras": (f"rawtoaces-data 1.1.0 of the Academy Software Foundation (SHA-256 {file}), each channel's "
                    "peak 1", nodes, {name: _rounded(curves[name]) for name in CAMERAS}),
    }  # fmt: skip
    return {
        name: {"origin": origin, "licence": "Apache-2.0" if name == "cameras" else "BSD-3-Clause",
               "grid": f"380 to 720 nm {grid}", "values": values}
        for name, (origin, grid, values) in tables.items()
    }  # fmt: skip


def _settled(name: str, values: Floats) -> list[list[float]] | list[float]:
    """Rounded values; where a value is a tie of two roundings, the stored one is kept, whatever its last bit."""
    rounded = np.array(_rounded(values))
    if (ROOT / "spectra" / "charts.json").exists():
        stored = np.array(spectra("charts")["values"][name])
        tie = np.abs(values - stored) < 0.5 * 10.0**-DECIMALS + 1e-14
        rounded = np.where(tie, stored, rounded)
    return _rounded(rounded)


def _upright(modes: Floats) -> Floats:
    """Modes with their largest value positive, because the sign of a decomposition is arbitrary."""
    largest = np.take_along_axis(modes, np.abs(modes).argmax(axis=1)[:, None], axis=1)
    return np.asarray(modes * np.sign(largest))


def _rounded(values: Floats) -> list[list[float]] | list[float]:
    rounded: list[list[float]] | list[float] = (np.round(values, DECIMALS) + 0.0).tolist()
    return rounded
