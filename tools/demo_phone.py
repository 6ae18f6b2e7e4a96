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

from camssf.grid import Floats
from camssf.recovery.basis import NODES, read_basis
from camssf.spectra.cameras import DEMO_PHONE
from tools.pages import DATA, Json, made_files
from tools.tabulate import digest

PLACE = DATA / "demo-phone.json"
BASIS = "phones"
DECIMALS = 6
WIDTH = 0.7
"""Standard deviation of the code, about that of measured phones."""


def draw(seed: int) -> Floats:
    """Curves (69, 3) at the nodes, drawn from the prior; they may be negative."""
    basis = read_basis(BASIS)
    # NumPy keeps the stream of RandomState the same in all versions.
    code = np.random.RandomState(seed).standard_normal((3, basis.dictionary.shape[2]))
    return np.asarray(basis.mean + WIDTH * np.einsum("cmr,cr->cm", basis.dictionary, code)).T[::10]


def tabulate() -> Json:
    """The file's content; a row of values is red, green, blue."""
    seed, curves = next((seed, found) for seed in count() if (found := draw(seed)).min() >= 0)
    values = np.round(curves / curves.max(axis=0), DECIMALS)
    camera = {"start": float(NODES[0]), "step": float(NODES[1] - NODES[0]), "sha256": digest(values)}
    origin = {"basis": BASIS, "sha256": read_basis(BASIS).sha256(), "seed": seed}
    return {
        "format": "camssf-cameras/1",
        "origin": origin,
        "cameras": {DEMO_PHONE: camera | {"values": values.tolist()}},
    }


main = partial(made_files, __spec__, __doc__, lambda: {PLACE: tabulate()})

if __name__ == "__main__":
    sys.exit(main())
