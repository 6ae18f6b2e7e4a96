"""Makes data/colour.json from data/rawtoaces and colour-science: surfaces and observers for fits of standard colour.

`python -m tools.surfaces` writes the file from a checkout, `--check` tests that the sources still give the same.
"""

from __future__ import annotations

import hashlib
import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np

from camssf.recovery.basis import NODES
from camssf.spectra import colour_science
from camssf.spectra.surfaces import FORMAT
from tools.tabulate import Json, write_or_check

COMMAND = "python -m tools.surfaces"
PLACE = Path(__file__).parents[1] / "reference" / "camssf" / "data" / "colour.json"
SOURCE = Path(__file__).parents[1] / "data" / "rawtoaces" / "training_spectral.json"
OBSERVERS = {"1931": "CIE 1931 2 Degree Standard Observer", "1964": "CIE 1964 10 Degree Standard Observer"}


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns 1 if `--check` finds a difference."""
    return write_or_check(COMMAND, PLACE, tabulate, arguments)


def tabulate() -> Json:
    """The file's content."""
    data = SOURCE.read_bytes()
    table = json.loads(data)["spectral_data"]["data"]["main"]
    science = colour_science()
    observers = {}
    for name, long_name in OBSERVERS.items():
        functions = science.MSDS_CMFS[long_name]
        at = np.arange(380, 721)
        rows = {int(nm): row for nm, row in zip(functions.wavelengths, functions.values.tolist(), strict=True)}
        observers[name] = [[rows[int(nm)][i] for nm in at] for i in range(3)]
    return {
        "format": FORMAT,
        "generator": COMMAND,
        "surfaces": {
            "name": "rawtoaces-data 1.1.0, training_spectral.json",
            "licence": "Apache-2.0",
            "sha256": hashlib.sha256(data).hexdigest(),
            "start": 380.0,
            "step": 5.0,
            "values": np.array([table[f"{nm:.0f}"] for nm in NODES]).T.tolist(),
        },
        "observers": {
            "name": f"colour-science {version('colour-science')}",
            "licence": "BSD-3-Clause",
            "start": 380.0,
            "step": 1.0,
            "values": observers,
        },
    }


if __name__ == "__main__":
    sys.exit(main())
