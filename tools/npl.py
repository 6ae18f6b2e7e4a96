"""Makes data/npl.json from colour-science: the two cameras measured by the National Physical Laboratory.

`python -m tools.npl` writes the file, `--check` tests that colour-science still gives the same.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from camssf.spectra import colour_science
from camssf.spectra.cameras import LIBRARY
from tools.tabulate import Json, digest, made_file, origin

COMMAND = "python -m tools.npl"
PLACE = Path(__file__).parents[1] / "reference" / "camssf" / "data" / "npl.json"


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns 1 if `--check` finds a difference."""
    return made_file(COMMAND, PLACE, tabulate, arguments)


def tabulate() -> Json:
    """The file's content; a row of values is red, green, blue."""
    cameras = {}
    for name in LIBRARY:
        table = colour_science().MSDS_CAMERA_SENSITIVITIES[name]
        nm, values = np.asarray(table.wavelengths, float), np.asarray(table.values, float)
        step = float(nm[1] - nm[0])
        if table.labels != ["red", "green", "blue"] or not np.array_equal(nm, nm[0] + step * np.arange(nm.size)):
            raise ValueError(f"{name}: other columns, or uneven wavelengths")
        cameras[name] = {"start": float(nm[0]), "step": step, "sha256": digest(values), "values": values.tolist()}
    return {"format": "camssf-cameras/1", "generator": COMMAND, "origin": origin(), "cameras": cameras}


if __name__ == "__main__":
    sys.exit(main())
