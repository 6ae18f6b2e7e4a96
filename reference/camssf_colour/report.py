"""What a report says of colour: the expected error, the error against a truth, and the quality of the curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from camssf.documents.document import Document, answer_in
from camssf.errors import CalibrationError
from camssf.report.sections.text import number
from camssf_colour.colour_error import expected_error, true_error
from camssf_colour.indices import quality_of

__all__ = ["expected_error", "quality_in_words", "true_error"]

COLOUR_LAMPS = ("D65", "A")


@dataclass(frozen=True)
class Colour:
    """The colour quality of the curves in words, and the rows of the matrices."""

    words: str
    rows: tuple[tuple[str, tuple[Markup, ...]], ...]


def quality_in_words(document: Document) -> Colour | None:
    """Luther condition, SMI, and the matrices for two lamps; they depend on the curves only, not on the photos."""
    try:
        qualities = [quality_of(answer_in(document).curves.values, lamp) for lamp in COLOUR_LAMPS]
    except (CalibrationError, np.linalg.LinAlgError):  # curves of a foreign document may give no signal
        return None
    rows = tuple(
        (f"{word} from {quality.lamp}'s camera RGB", tuple(number(value, 5) for value in row))
        for quality in qualities
        for word, row in zip("XYZ", quality.matrix.coefficients.T.tolist(), strict=True)
    )
    misses = "; ".join(
        f"under {quality.lamp} {quality.matrix.delta_e00['matrix']:.2f} by a matrix, "
        f"{quality.polynomial.delta_e00['root-polynomial']:.2f} by a root-polynomial"
        for quality in qualities
    )
    first = qualities[0]
    return Colour(
        f"Sensitivity metamerism index {first.smi:.0f} (100 is an observer's). No matrix of the curves gives "
        f"{100 * first.luther:.0f} % of the CIE 1931 observer (Luther condition: 0 %). Mean ΔE00 of surfaces that "
        f"the fit had not seen: {misses}.",
        rows,
    )
