"""Makes data/demo-phone.json: the camera of `camssf demo`, a draw from the basis `phones` that is no known phone.

`python -m tools.demo_phone` writes the file, `--check` tests that the shipped basis still gives the same.

A code x ~ N(0, 0.7² I) of each channel gives the curves μ + Ψ x: the basis' prior is wider than phones are. A
sensitivity is nowhere negative, so the first seed is taken whose curves are not; they are as smooth as the basis.
"""

from __future__ import annotations

import sys
from functools import partial
from itertools import count

import numpy as np

from camssf.recovery.basis import read_basis
from camssf.spectra.cameras import DEMO_PHONE
from tools.pages import DATA, GRID, Json, made_files
from tools.tabulate import digest

PLACE = DATA / "demo-phone.json"
BASIS = "phones"
WIDTH = 0.7
"""Standard deviation of the code, about that of measured phones."""


def tabulate() -> Json:
    """The file's content; a row of values is red, green, blue."""
    basis = read_basis(BASIS)
    for seed in count():
        # NumPy keeps the stream of RandomState the same in all versions.
        code = np.random.RandomState(seed).standard_normal((3, basis.dictionary.shape[2]))
        curves = (basis.mean + WIDTH * np.einsum("cmr,cr->cm", basis.dictionary, code)).T[::10]  # (69, 3)
        if curves.min() >= 0:
            break
    values = np.round(curves / curves.max(axis=0), 6)
    return {
        "format": "camssf-cameras/1",
        "origin": {"basis": BASIS, "sha256": basis.sha256(), "seed": seed},
        "cameras": {DEMO_PHONE: GRID | {"sha256": digest(values), "values": values.tolist()}},
    }


main = partial(made_files, __spec__, __doc__, lambda: {PLACE: tabulate()})

if __name__ == "__main__":
    sys.exit(main())
