"""The errors of a result against measured curves, beside those without any photo: the mean of the basis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.errors import InvalidArgument
from camssf.fit.scores import rmse
from camssf.grid import Floats, columns
from camssf.recovery.basis import read_basis
from camssf.report.colour_error import true_error
from camssf.report.notebook import lamps_of
from camssf.report.sections.text import Json


@dataclass(frozen=True)
class TrueError:
    """Errors of curves against the truth.

    Attributes:
        name: of the curves.
        rmse: red, green, blue; 400 to 700 nm, peak = 1.
        colour: mean ΔE00 of a ColorChecker's 24 colours in daylight D65; None if it cannot be computed.
    """

    name: str
    rmse: tuple[float, ...]
    colour: float | None

    def cells(self) -> tuple[str, ...]:
        """The numbers as text."""
        return (*(f"{value:.3f}" for value in self.rmse), "–" if self.colour is None else f"{self.colour:.2f}")


HEAD = ("red", "green", "blue", "colour, ΔE00")


def true_errors(document: Json, other: Json | None = None, other_name: str = "") -> list[TrueError]:
    """Errors without a photo, of the result, and of another result with the same truth; empty without a truth."""
    if "ssf" not in document or not document.get("truth"):
        return []
    truth = columns(document["truth"]["ssf"])
    if (truth.max(axis=0) <= 0).any():  # of a foreign document: nothing can be relative to it
        return []
    found = []
    try:
        basis = read_basis(document["basis"])
    except InvalidArgument:  # a basis of the user's own that is not here
        basis = None
    if basis is not None and basis.prior:
        mean = basis.mean.T
        found.append(_error(f"no photo: mean of basis {basis.name}", mean / mean.max(axis=0), truth))
    found.append(_error(f"this result: {lamps_of(document)}", columns(document["ssf"]), truth))
    if other is not None and other.get("truth") and np.array_equal(columns(other["truth"]["ssf"]), truth):
        found.append(_error(other_name, columns(other["ssf"]), truth))
    return found


def _error(name: str, values: Floats, truth: Floats) -> TrueError:
    return TrueError(name, tuple(rmse(values, truth).tolist()), true_error(np.maximum(values, 0.0), truth))
