"""The errors of a result against measured curves, beside those without any photo: the mean of the basis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.documents.document import Document
from camssf.errors import InvalidArgument
from camssf.fit.scores import rmse
from camssf.grid import Floats
from camssf.libraries import REPORT, extension
from camssf.recovery.basis import read_basis
from camssf.report.names import lamps_of


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


def true_errors(document: Document, other: Document | None = None, other_name: str = "") -> list[TrueError]:
    """Errors without a photo, of the result, and of another result with the same truth; empty without a truth."""
    answer = document.answer
    if answer is None or document.truth is None:
        return []
    truth = document.truth.curves.values
    if (truth.max(axis=0) <= 0).any():  # of a foreign document: nothing can be relative to it
        return []
    errors = []
    try:
        basis = read_basis(answer.basis)
    except InvalidArgument:  # a basis of the user's own that is not here
        basis = None
    if basis is not None and basis.prior:
        mean = basis.mean.T
        errors.append(_error(f"no photo: mean of basis {basis.name}", mean / mean.max(axis=0), truth))
    errors.append(_error(f"this result: {lamps_of(document)}", answer.curves.values, truth))
    if other is None or other.answer is None or other.truth is None:
        return errors
    if np.array_equal(other.truth.curves.values, truth):
        errors.append(_error(other_name, other.answer.curves.values, truth))
    return errors


def _error(name: str, values: Floats, truth: Floats) -> TrueError:
    colour = extension(REPORT, "colour").true_error(np.maximum(values, 0.0), truth)
    return TrueError(name, tuple(rmse(values, truth).tolist()), colour)
