"""Problems shared by the solver's tests: measured-camera-like signals and random matrices, all seeded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from camssf.curves import Evidence, Prediction, Ssf, explain, predict, recover
from camssf.curves.sensing import Sensing
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_chart, read_lamp

CURVES = Path(__file__).parents[1] / "data" / "ssf" / "rawtoaces.csv"


def bell(centre: float, width: float) -> Floats:
    return np.exp(-0.5 * ((WAVELENGTHS - centre) / width) ** 2)


def toy_camera(shift: float = 0.0) -> Floats:
    """Smooth curves that no basis here was learned from, (681, 3)."""
    red = bell(600 + shift, 32) + 0.08 * bell(440 + shift, 25)
    green = bell(532 + shift, 38)
    blue = bell(458 + shift, 27) + 0.03 * bell(540, 30)
    return np.stack([red, green, blue], axis=1)


def theory(reflectance: Floats, lamp: Floats, camera: Floats, white: Floats | float = 1.0) -> Floats:
    """Eq. (5) by its integrals, (n, 3)."""
    return ((reflectance * lamp) @ camera) / ((white * lamp) @ camera)


def chart_and_lamp(lamp: str = "D55", patches: slice = slice(6, 18)) -> tuple[Floats, Floats]:
    return read_chart("classic24").values[patches], read_lamp(lamp).values


def measured_cameras() -> dict[str, Floats]:
    """The 52 cameras on the grid; skips where the data is not there."""
    from camssf.curves.basis import interpolate
    from camssf.tools.learn import read_curves

    return {name: interpolate(curves) for name, curves in read_curves(CURVES).items()}


def random_sensing(seed: int, rows: int, atoms: int, *, correlated: bool = False) -> Sensing:
    """Three random channels with smooth, correlated columns and, where asked, a full covariance."""
    rng = np.random.default_rng(seed)
    mixing = np.exp(-0.5 * ((np.arange(atoms)[:, None] - np.arange(atoms)) / 1.5) ** 2)
    matrix = rng.normal(size=(3, rows, atoms)) @ mixing
    target = np.einsum("crn,cn->cr", matrix, rng.normal(size=(3, atoms)) * (rng.random((3, atoms)) < 0.4))
    target += 0.1 * rng.normal(size=target.shape)
    sigma = np.broadcast_to(np.eye(rows), (3, rows, rows)).copy()
    if correlated:
        factor = 0.5 * rng.normal(size=(3, rows, 3))
        sigma += factor @ factor.transpose(0, 2, 1)
    return Sensing(matrix, target, sigma)


def gamma_max(sensing: Sensing) -> Floats:
    pulls = [
        A.T @ np.linalg.solve(S, b)
        for A, b, S in zip(sensing.matrix, sensing.target, sensing.covariance, strict=True)
    ]
    return np.abs(pulls).max(axis=1)


def told(*positional: Any, **named: Any) -> tuple[Evidence, dict[str, Any]]:
    """Evidence from the arguments that are its own, and the rest."""
    fields = Evidence.__dataclass_fields__
    evidence = Evidence(*positional, **{name: value for name, value in named.items() if name in fields})
    return evidence, {name: value for name, value in named.items() if name not in fields}


def recovered(*positional: Any, **named: Any) -> Ssf:
    """`recover` of signals, reflectance, lamp and the rest by name."""
    evidence, rest = told(*positional, **named)
    return recover(evidence, **rest)


def explained(*positional: Any, **named: Any) -> dict[str, Floats]:
    """`explain`, likewise."""
    evidence, rest = told(*positional, **named)
    return explain(evidence, **rest)


def predicted(ssf: Ssf, *positional: Any, **named: Any) -> Prediction:
    """`predict`, likewise."""
    evidence, rest = told(*positional, **named)
    return predict(ssf, evidence, **rest)
