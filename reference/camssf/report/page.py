"""Renders a result as one self-contained HTML page, with the templates in data/report.

The files of `sections` make the page's content; the templates define its look and
escape every value. A new part of the page needs a function in `sections`, a template for its output, and a line in
data/report/page.html.jinja.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from camssf.documents.document import Document
from camssf.documents.unnamed_light import lamp_name
from camssf.grid import CHANNELS, WAVELENGTHS
from camssf.libraries import REPORT, extension
from camssf.report.provenance import NO_PROVENANCE, Provenance
from camssf.report.sections import certificate, details, drawings, patches, photos, story, uneven
from camssf.report.sections.curves import DrawnCurves, curves_of
from camssf.report.sections.text import brief, camera_name, finalize, number, words
from camssf.report.sections.truth import true_errors
from camssf.report.shots import ShownShot
from camssf.report.svg import svg

WITH_CURVES = (
    "curves", "curve_plots", "curve_rows", "true_errors", "big", "channels", "proof", "colour", "expected", "gap",
)  # fmt: skip
"""Template variables that are None for a refused result."""
TEN_NM = range(0, len(WAVELENGTHS), 20)


def page(
    document: Document,
    shots: Sequence[ShownShot],
    previews: Sequence[bytes | None],
    provenance: Provenance = NO_PROVENANCE,
) -> str:
    """The report of a result, one self-contained HTML file.

    Args:
        document: the result.
        shots: its shots (`shots_of`).
        previews: image of each shot, or None.
        provenance: facts that the result does not hold.
    """
    verdict, answer = document.verdict, document.answer
    assert verdict is not None
    columns = 1 if document.capture is None else document.capture.chart.layout.columns
    shown: dict[str, Any] = dict.fromkeys(WITH_CURVES) | {
        "document": document,
        "shots": shots,
        "title": f"Spectral sensitivity of {camera_name(document)}",
        "style": style(),
        "mark": certificate.MARKS[verdict.status],
        "facts": certificate.facts_of(document, provenance),
        "checks": certificate.checks_of(verdict),
        "budget": certificate.budget_of(document),
        "signature": provenance.signature,
        "lights": story.lights_of(answer, shots),
        "basis": story.basis_of(answer),
        "residuals": patches.residuals_of(shots),
        "tiles": [patches.tiles_of(shot, columns) for shot in shots],
        "noise": [drawings.noise_plot(shot.patches, f"noise-{shot.number}") for shot in shots],
        "falls": [uneven.fall_of(shot) for shot in shots],
        "photos": [
            photos.photo_of(shot, preview, verdict.reasons) for shot, preview in zip(shots, previews, strict=True)
        ],
        "assumptions": details.assumptions_of(document),
        "details": details.details_of(shots),
        "number_columns": details.NUMBERS,
        "numbers": [details.numbers_of(shot) for shot in shots],
        "hashes": details.hashes_of(document),
    }
    if answer is not None:
        curves, colour = curves_of(document), extension(REPORT, "colour")
        expected = colour.expected_error(document)
        shown |= {
            "curves": curves,
            "curve_plots": (
                drawings.curve_plot(curves, 1080, 400, 5, "wide"),
                drawings.curve_plot(curves, 360, 300, 10, "narrow"),
            ),
            "curve_rows": _values(curves),
            "true_errors": [[error.name, *error.cells()] for error in true_errors(document)],
            "big": certificate.big_numbers(answer),
            "channels": certificate.channels_of(document, answer),
            "expected": None if expected is None else expected.in_words(),
            "gap": number(float(answer.proof.gap.max()), 2),
            "proof": story.proof_of(answer.proof),
            "colour": colour.quality_in_words(document),
        }
    return render("page.html.jinja", shown)


def style() -> str:
    """The pages' style sheet."""
    return files("camssf").joinpath("data", "report", "report.css").read_text("utf-8")


def render(template: str, shown: dict[str, Any]) -> str:
    """A page by its template in data/report and the template's variables."""
    return str(_environment().get_template(template).render(shown))


def _values(curves: DrawnCurves) -> list[list[str]]:
    """Table rows every 10 nm: the curves, the limits of their bands, the truth."""
    columns = list(curves.ssf.T)
    if curves.low is not None and curves.high is not None:
        columns += [end[:, i] for i in range(3) for end in (curves.low, curves.high)]
    if curves.truth is not None:
        columns += list(curves.truth.T)
    return [
        [f"{WAVELENGTHS[k]:.0f}", *(f"{column[k]:.4f}".replace("-", "\u2212") for column in columns)] for k in TEN_NM
    ]


def _flat(row: tuple[Any, Sequence[Any]]) -> list[Any]:
    """A row's heading and cells as one list."""
    return [row[0], *row[1]]


@cache
def _environment() -> Any:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    folder = files("camssf").joinpath("data", "report")
    environment = Environment(
        loader=FunctionLoader(lambda name: folder.joinpath(name).read_text("utf-8")),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=finalize,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"t": words, "number": number, "brief": brief, "flat": _flat}
    environment.filters |= {"lamp_name": lamp_name, "svg": svg}
    environment.globals |= {"channels_in_order": CHANNELS}
    return environment
