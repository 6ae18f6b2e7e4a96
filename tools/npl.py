"""Makes data/npl.json from colour-science: the two cameras measured by the National Physical Laboratory.

`python -m tools.npl` writes the file, `--check` tests that colour-science still gives the same.
"""

from __future__ import annotations

import sys
from functools import partial

from camssf.spectra import colour_science
from camssf.spectra.cameras import LIBRARY
from tools.pages import DATA, Json, made_files
from tools.tabulate import even, origin

PLACE = DATA / "npl.json"


def tabulate() -> Json:
    """The file's content; a row of values is red, green, blue."""
    tables = {name: colour_science().MSDS_CAMERA_SENSITIVITIES[name] for name in LIBRARY}
    if any(table.labels != ["red", "green", "blue"] for table in tables.values()):
        raise ValueError("other columns")
    cameras = {name: even(table) for name, table in tables.items()}
    return {"format": "camssf-cameras/1", "origin": origin(), "cameras": cameras}


main = partial(made_files, __spec__, __doc__, lambda: {PLACE: tabulate()})

if __name__ == "__main__":
    sys.exit(main())
