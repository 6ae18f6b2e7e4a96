"""Makes data/demo-phones.json: the cameras of `camssf demo`, draws from the basis `phones` that are no known phones.

`python -m tools.demo_phones` writes the file, `--check` tests that the shipped basis still gives the same.

A code x ~ N(0, 0.7² I) of each channel gives the curves μ + Ψ x: the basis' prior is wider than phones are. A
sensitivity is nowhere negative, so the first seeds are taken whose curves are not; they are as smooth as the basis.
"""

from __future__ import annotations

import sys
from functools import partial
from itertools import count

import numpy as np

from camssf.grid import Floats
from camssf.recovery.basis import read_basis
from camssf.spectra.cameras import DEMO_PHONES
from tools.pages import DATA, GRID, Json, made_files
from tools.tabulate import digest

PLACE = DATA / "demo-phones.json"
BASIS = "phones"
WIDTH = 0.7
"""Standard deviation of the code, about that of measured phones."""


def tabulate() -> Json:
    """The file's content; a row of values is red, green, blue."""
    basis = read_basis(BASIS)
    drawn: dict[int, Floats] = {}
    for seed in count():
        # NumPy keeps the stream of RandomState the same in all versions.
        code = np.random.RandomState(seed).standard_normal((3, basis.dictionary.shape[2]))
        curves = (basis.mean + WIDTH * np.einsum("cmr,cr->cm", basis.dictionary, code)).T[::10]  # (69, 3)
        if curves.min() >= 0:
            drawn[seed] = np.round(curves / curves.max(axis=0), 6)
        if len(drawn) == len(DEMO_PHONES):
            break
    cameras = {
        name: GRID | {"sha256": digest(values), "values": values.tolist()}
        for name, values in zip(DEMO_PHONES, drawn.values(), strict=True)
    }
    origin = {"basis": BASIS, "sha256": basis.sha256(), "seeds": list(drawn)}
    return {"format": "camssf-cameras/1", "origin": origin, "cameras": cameras}


main = partial(made_files, __spec__, __doc__, lambda: {PLACE: tabulate()})

if __name__ == "__main__":
    sys.exit(main())
