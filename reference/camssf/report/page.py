"""Renders a result document as one self-contained HTML page, with the templates in data/report.

`report` has checked the document. The files of `sections` make the page's content; the templates define its look and
escape every value. A new part of the page needs a function in `sections`, a template for its output, and a line in
data/report/page.html.jinja.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from camssf.documents.unnamed_light import lamp_name
from camssf.grid import CHANNELS, WAVELENGTHS
from camssf.report.colour_error import expected_error
from camssf.report.nearest import nearest_of
from camssf.report.provenance import NO_PROVENANCE, Provenance
from camssf.report.sections import certificate, details, drawings, patches, photos, story, uneven
from camssf.report.sections.comparison import LIMIT, comparison_of
from camssf.report.sections.curves import DrawnCurves, curves_of
from camssf.report.sections.text import Json, brief, camera_name, finalize, number, words
from camssf.report.sections.truth import true_errors
from camssf.spectra import read_camera

WITH_CURVES = (
    "curves", "curve_plots", "curve_rows", "true_errors", "big", "channels", "proof", "colour", "comparison",
    "linearity", "expected", "nearest", "gap",
)  # fmt: skip
"""Template variables that are None for a refused result."""
TEN_NM = range(0, len(WAVELENGTHS), 20)


def page(document: Json, previews: Sequence[bytes | None], provenance: Provenance = NO_PROVENANCE) -> str:
    """The report of a result document, one self-contained HTML file.

    Args:
        document: checked.
        previews: image of each shot, or None.
        provenance: facts that the document does not hold.
    """
    shots = document["shots"]
    shown: dict[str, Any] = dict.fromkeys(WITH_CURVES) | {
        "document": document,
        "title": f"Spectral sensitivity of {camera_name(document)}",
        "style": style(),
        "mark": certificate.MARKS[document["verdict"]["status"]],
        "facts": certificate.facts_of(document, provenance),
        "checks": certificate.checks_of(document),
        "budget": certificate.budget_of(document),
        "signature": provenance.signature,
        "lights": story.lights_of(document),
        "basis": story.basis_of(document),
        "residuals": patches.residuals_of(document),
        "tiles": [patches.tiles_of(shot) for shot in shots],
        "noise": [drawings.noise_plot(shot["patches"], f"noise-{j}") for j, shot in enumerate(shots, 1)],
        "falls": uneven.falls_of(document),
        "photos": [photos.photo_of(shot, preview) for shot, preview in zip(shots, previews, strict=True)],
        "assumptions": details.assumptions_of(document),
        "details": details.details_of(document),
        "number_columns": details.NUMBERS,
        "numbers": [details.numbers_of(shot) for shot in shots],
        "hashes": details.hashes_of(document),
    }
    if "ssf" in document:
        curves, expected, nearest = curves_of(document), expected_error(document), nearest_of(document)
        dotted = None if nearest is None else read_camera(nearest.name).values
        dotted = None if dotted is None else dotted / dotted.max(axis=0)
        shown |= {
            "curves": curves,
            "curve_plots": (
                drawings.curve_plot(curves, 1080, 400, 5, "wide", dotted),
                drawings.curve_plot(curves, 360, 300, 10, "narrow", dotted),
            ),
            "curve_rows": _values(curves),
            "true_errors": [
                [each.name, *each.cells()] for each in true_errors(document, provenance.other, provenance.other_name)
            ],
            "big": certificate.big_numbers(document),
            "channels": certificate.channels_of(document),
            "nearest": None
            if nearest is None
            else f"{nearest.name}; RMS difference {100 * nearest.rms:.1f} % of the peak",
            "expected": None if expected is None else expected.in_words(),
            "gap": number(max(document["gap"]), 2),
            "proof": story.proof_of(document),
            "colour": story.colour_of(document),
            "comparison": comparison_of(document, provenance.other, provenance.other_name),
            "comparison_limit": LIMIT,
            "linearity": [
                drawings.linearity_plot(shot["patches"], f"linearity-{j}") for j, shot in enumerate(shots, 1)
            ],
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
    environment.filters |= {"t": words, "number": number, "brief": brief, "flat": _flat, "lamp_name": lamp_name}
    environment.globals |= {"channels_in_order": CHANNELS}
    return environment
