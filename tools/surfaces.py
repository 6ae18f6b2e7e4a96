"""Makes data/colour.json from data/rawtoaces, data/surfaces and colour-science: surfaces, absorbers, an observer.

`python -m tools.surfaces` writes the file from a checkout, `--check` tests that the sources still give the same.
"""

from __future__ import annotations

import hashlib
import json
import sys
import warnings
from collections.abc import Iterator
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np

from camssf.grid import Floats
from camssf.recovery.basis import NODES
from camssf.spectra import colour_science
from camssf.spectra.bundled import COLOUR_FORMAT, SURFACE_NODES
from tools.pages import DATA, GRID, Json, made_files
from tools.tabulate import digest, observer

PLACE = DATA / "colour.json"
SOURCE = Path(__file__).parents[1] / "data" / "rawtoaces" / "training_spectral.json"
FILES = {
    "vhrel_dupont": ("general", "Vhrel, Gershon, Iwan 1994: DuPont paints"),
    "vhrel_munsell": ("general", "Vhrel, Gershon, Iwan 1994: Munsell chips"),
    "vhrel_objects": ("general", "Vhrel, Gershon, Iwan 1994: objects without skins"),
    "esser": ("general", "Esser TE221"),
    "vhrel_skin": ("skin", "Vhrel, Gershon, Iwan 1994: skins"),
    "hyspex_skin": ("skin", "Hyspex: cheeks"),
}
"""Sets of data/surfaces: kind, and what they are; all as passed on by ISETCAM."""
ISETCAM = "isetcam 421f87a28be95fdb76383d9ce0f92e2e736bd4a2, data/surfaces/reflectances"
UNIT = 1e-5
"""The unit of the library's whole numbers; one reflectance of it is far below the error of any instrument."""
BILIRUBIN = (460.0, 30.0)
"""Peak and width (standard deviation), nm, of the Gaussian that stands for bilirubin bound to albumin."""
CHANGES = {"oxyhaemoglobin": [0.8, 0.2], "deoxyhaemoglobin": [0.8, 0.2], "bilirubin": [0.2, 0.0]}
"""As `absorber_changes` says: assumed, and judged by `python -m benchmarks spectrum`, its column "change"."""


def tabulate() -> Json:
    """The file's content."""
    data = SOURCE.read_bytes()
    table = json.loads(data)["spectral_data"]["data"]["main"]
    return {
        "format": COLOUR_FORMAT,
        "surfaces": {
            "name": "rawtoaces-data 1.1.0, training_spectral.json",
            "licence": "Apache-2.0",
            "sha256": hashlib.sha256(data).hexdigest(),
            **GRID,
            "values": np.array([table[f"{nm:.0f}"] for nm in NODES]).T.tolist(),
        },
        "library": {
            "start": float(SURFACE_NODES[0]),
            "step": float(SURFACE_NODES[1] - SURFACE_NODES[0]),
            "unit": UNIT,
            "sets": list(_sets()),
        },
        "absorbers": _absorbers(),
        "observer": {
            "name": f"CIE 1964 10°; colour-science {version('colour-science')}",
            "licence": "BSD-3-Clause",
            **observer(colour_science().MSDS_CMFS["CIE 1964 10 Degree Standard Observer"]),
        },
    }


def _sets() -> Iterator[Json]:
    """Colour samples of standards, from colour-science, then the sets of data/surfaces."""
    science, at = colour_science(), np.arange(380.0, 781.0, 5.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns that tables are extrapolated
        from colour.quality.cfi2017 import load_TCS_CIE2017

        cie2017 = np.asarray(load_TCS_CIE2017(science.SpectralShape(380, 780, 5)).values).T
    cri, cqs = (
        np.stack([np.interp(at, sample.wavelengths, sample.values) for sample in samples.values()])
        for samples in (science.quality.SDS_TCS["CIE 2024"], science.quality.SDS_VS["NIST CQS 9.0"])
    )
    for name, what, rows in (
        ("cie2017", "CIE 224:2017, 99 colour samples", cie2017),
        ("cri", "CIE 13.3 and its later skin, 15 test colours", cri),
        ("cqs", "NIST CQS 9.0, 15 test colours", cqs),
    ):
        origin = f"{what}; colour-science {version('colour-science')}"
        yield _set(name, "general", origin, "BSD-3-Clause", digest(rows), at, rows)
    for name, (kind, what) in FILES.items():
        at, values, sha256 = _table(name)
        yield _set(name, kind, f"{what}; {ISETCAM}", "MIT", sha256, at, values)


def _table(name: str) -> tuple[Floats, Floats, str]:
    """Wavelengths (w,), values (n, w) and SHA-256 of a file of data/surfaces."""
    data = (SOURCE.parents[1] / "surfaces" / f"{name}.csv").read_bytes()
    table = np.loadtxt(data.decode().splitlines(), delimiter=",", skiprows=1)
    return table[:, 0], table[:, 1:].T, hashlib.sha256(data).hexdigest()


def _set(name: str, kind: str, origin: str, licence: str, sha256: str, at: Floats, values: Floats) -> Json:
    """A set of surfaces at SURFACE_NODES, linear between the wavelengths `at` and constant outside."""
    rows = [np.rint(np.interp(SURFACE_NODES, at, row) / UNIT).astype(int).tolist() for row in values]
    return {"name": name, "kind": kind, "origin": origin, "licence": licence, "sha256": sha256, "values": rows}


def _absorbers() -> Json:
    """Absorption of two haemoglobins and of bilirubin at SURFACE_NODES; 1 at its largest."""
    at, values, sha256 = _table("skin_absorbances")
    peak, width = BILIRUBIN
    rows = {
        "oxyhaemoglobin": np.interp(SURFACE_NODES, at, values[0]),
        "deoxyhaemoglobin": np.interp(SURFACE_NODES, at, values[1]),
        "bilirubin": np.exp(-0.5 * ((SURFACE_NODES - peak) / width) ** 2),
    }
    return {
        "origin": f"haemoglobins: {ISETCAM.partition(',')[0]}, skin/absorbances; "
        f"bilirubin: a Gaussian at {peak:g} nm, standard deviation {width:g} nm",
        "licence": "MIT",
        "sha256": sha256,
        "values": {name: np.round(row / row.max(), 6).tolist() for name, row in rows.items()},
        "changes": CHANGES,
    }


main = partial(made_files, __spec__, __doc__, lambda: {PLACE: tabulate()})

if __name__ == "__main__":
    sys.exit(main())
