"""Matrices by a formula, and the inputs of convex problems: stages `weights` and `solve`."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.grid import Floats
from golden.contract import words
from golden.forms import Json
from golden.linear_model import LinearModel

PROBLEM = words("matrix target covariance l2 gamma nonnegative")
"""Inputs of a convex problem."""


def waves(rows: int, columns: int, seed: int) -> Floats:
    """(3, rows, columns) matrices by a formula, entries in [-1, 1] with three decimals."""
    c, i, j = np.meshgrid(np.arange(3), np.arange(rows), np.arange(columns), indexing="ij")
    waves: Floats = np.sin(12.9898 * (i + 1) ** 2 + 78.233 * (j + 1) ** 2 + 37.719 * (c + seed) + 0.5 * i * j)
    return np.round(waves, 3)


def identity(rows: int) -> Floats:
    """(3, rows, rows)."""
    return np.broadcast_to(np.eye(rows), (3, rows, rows)).copy()


def posed(A: Any, b: Any, sigma: Any, l2: float, gamma: Any, nonnegative: bool = False) -> Json:
    """Three problems by their numbers."""
    return {"matrix": A, "target": b, "covariance": sigma, "l2": l2, "gamma": gamma, "nonnegative": nonnegative}


def rows_of(name: str, l2: float, gamma: Any, nonnegative: bool = False) -> Json:
    """The problem of a case of the stage `sensing`."""
    A, b, sigma = ({"case": f"sensing/{name}", "output": part} for part in ("matrix", "target", "covariance"))
    return posed(A, b, sigma, l2, gamma, nonnegative)


def problem_of_rows(given: dict[str, Any]) -> LinearModel:
    """The rows that a case gives itself."""
    return LinearModel(matrix=given["matrix"], target=given["target"], covariance=given["covariance"])
