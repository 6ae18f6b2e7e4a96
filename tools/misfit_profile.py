"""Makes data/misfit.json: by how much curves miss a camera of another maker beyond what their bands say.

`python -m tools.misfit_profile` writes the file, `--check` tests that it is still the same. Each of the 52 measured
cameras is solved with a basis learned without its maker, on noisy captures of 24 patches of a known table under five
lamps. The profile is m, m² = mean of (s - truth)² - σ² of the curves of peak 1, not below 0, then smoothed over
10 nm; a maker counts by the root of the number of its cameras. No phone enters.
"""

from __future__ import annotations

import hashlib
import sys
from functools import partial

import numpy as np

from benchmarks.claims.accuracy import ALL, SETTINGS, Setting, answer_of, declared, missed, photograph
from benchmarks.devices import left_out
from benchmarks.shared import CURVES, chart
from camssf.grid import Floats
from camssf.recovery.basis import MISFIT_FILE, NODES
from camssf_lab.learning.training import maker_of
from golden.linear_model import linear_model
from tools.pages import GRID, Json, made_files

SEED = 2026
EXACT = tuple(setting for setting in SETTINGS if not setting.ohta and setting.patches == ALL)
SMOOTH = 10.0
"""Standard deviation of the smoothing, nm."""
DECIMALS = 4
ROUNDING = {"/values/": 2.0 * 10.0**-DECIMALS}


def tabulate() -> Json:
    """The file's content: rows of red, green and blue on 5-nm nodes."""
    beyond = np.stack([excess(setting, i) for i, setting in enumerate(EXACT)]).mean(axis=0)  # (cameras, 3, 69)
    makers = [maker_of(name) for name in left_out()[0]]
    weight = np.array([makers.count(maker) ** -0.5 for maker in makers])
    mean = np.maximum(np.tensordot(weight / weight.sum(), beyond, axes=1), 0.0)
    kernel = np.exp(-0.5 * ((NODES[:, None] - NODES) / SMOOTH) ** 2)
    profile = np.sqrt(mean @ kernel / kernel.sum(axis=0))
    return {
        "format": "camssf-misfit/1",
        "cameras": {"file": CURVES.name, "sha256": hashlib.sha256(CURVES.read_bytes()).hexdigest()},
        **GRID,
        "values": np.round(profile, DECIMALS).tolist(),
    }


def excess(setting: Setting, number: int) -> Floats:
    """(s - truth)² - σ² (cameras, 3, 69) of the curves of peak 1."""
    cameras, bases = left_out()
    rows = []
    for i, (name, curves) in enumerate(cameras.items()):
        basis = bases[maker_of(name)]
        y, error = photograph(setting, curves, chart(), np.random.default_rng([SEED, number, i]))
        observation = declared(setting, y, error)
        answer, std = answer_of(linear_model(observation, basis), observation, basis)
        assert std is not None  # a learned basis has a prior
        own = std**2 - missed() ** 2  # without the profile that is measured here
        rows.append((((answer - curves / curves.max(axis=0)) ** 2 - own)[::10]).T)
    return np.stack(rows)


main = partial(made_files, __spec__, __doc__, lambda: {MISFIT_FILE: tabulate()}, bounds=ROUNDING)

if __name__ == "__main__":
    sys.exit(main())
