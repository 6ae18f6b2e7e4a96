"""Rank-based (Finlayson, Darrodi and Mackiewicz 2016): only the order of the patches counts, not their signals.

y_i > y_j says (F_i - F_j) s > 0, so the ranks confine s to a cone; neighbours in rank imply all other pairs. Of the
cone's curves, s ≥ 0 and scaled to white, this takes the smoothest that keeps each pair apart by w times what their
mean distance is: a margin in place of the paper's search through the cone. One quadratic programme, solved as
non-negative least squares with a slack for each pair.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from benchmarks.paper.rivals import Given, bends, between
from camssf.grid import Floats

NAME = "rank-based (after Finlayson 2016)"
WEIGHTS = (0.05, 0.1, 0.15, 0.2)
STRICT = 1e4
"""Weight of the scale and of a pair in the wrong order, against smoothness."""


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    rows = given.node_rows()
    white = (given.lamp / given.lamp.sum()) @ between()
    n, m = rows.shape
    found = []
    for y in given.signals.T:
        order = np.argsort(y, kind="stable")
        steps = np.diff(rows[order], axis=0)
        margin = np.full(n - 1, weight * 0.9 / (n - 1))  # a chart spans about nine tenths of white
        system = np.zeros((len(bends()) + n, m + n - 1))
        system[: len(bends()), :m] = bends()
        system[len(bends()) : -1, :m], system[len(bends()) : -1, m:] = STRICT * steps, -STRICT * np.eye(n - 1)
        system[-1, :m] = STRICT * white
        target = np.concatenate([np.zeros(len(bends())), STRICT * margin, [STRICT]])
        found.append(nnls(system, target, maxiter=50 * system.shape[1])[0][:m])
    return between() @ np.stack(found, axis=1)
