"""Makes data/npl.json from colour-science: the two cameras measured by the National Physical Laboratory.

`python -m tools.npl` writes the file, `--check` tests that colour-science still gives the same.
"""

from __future__ import annotations

import sys
from pathlib import Path

from camssf.spectra import colour_science
from camssf.spectra.cameras import LIBRARY
from tools.tabulate import Json, even, made_file, origin

COMMAND = "python -m tools.npl"
PLACE = Path(__file__).parents[1] / "reference" / "camssf" / "data" / "npl.json"


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns 1 if `--check` finds a difference."""
    return made_file(COMMAND, PLACE, tabulate, arguments)


def tabulate() -> Json:
    """The file's content; a row of values is red, green, blue."""
    tables = {name: colour_science().MSDS_CAMERA_SENSITIVITIES[name] for name in LIBRARY}
    if any(table.labels != ["red", "green", "blue"] for table in tables.values()):
        raise ValueError("other columns")
    cameras = {name: even(table) for name, table in tables.items()}
    return {"format": "camssf-cameras/1", "generator": COMMAND, "origin": origin(), "cameras": cameras}


if __name__ == "__main__":
    sys.exit(main())
