"""A result document as one self-contained HTML page, by the templates of data/report.

`report` has checked the document. What the page says is made by the files of `view`; how it looks stands in the
templates, whose every value is escaped. A new part of the page is a function of `view`, a template that shows what it
gives, and a line in data/report/page.html.jinja.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from camssf.documents.beside import NOTHING, Beside
from camssf.documents.view import certificate, details, patches, photos, plots, story, uneven
from camssf.documents.view.comparison import LIMIT, comparison_of
from camssf.documents.view.curves import Curves, curves_of
from camssf.documents.view.text import CHANNELS, Json, brief, camera_name, finalize, number, words
from camssf.grid import WAVELENGTHS

WITH_CURVES = (
    "curves", "curve_plots", "curve_rows", "big", "channels", "proof", "colour", "comparison", "linearity",
)  # fmt: skip
"""What a refused result lacks."""
TEN_NM = range(0, len(WAVELENGTHS), 20)


def page(document: Json, previews: Sequence[bytes | None], beside: Beside = NOTHING) -> str:
    """The report of a result document, one self-contained HTML file.

    Args:
        document: checked.
        previews: of each shot, or None.
        beside: what the document does not hold.
    """
    shots = document["shots"]
    shown: dict[str, Any] = dict.fromkeys(WITH_CURVES) | {
        "document": document,
        "title": f"Spectral sensitivity of {camera_name(document)}",
        "style": files("camssf").joinpath("data", "report", "report.css").read_text("utf-8"),
        "mark": certificate.MARKS[document["verdict"]["status"]],
        "facts": certificate.facts_of(document, beside),
        "checks": certificate.checks_of(document),
        "budget": certificate.budget_of(document),
        "signature": beside.signature,
        "lights": story.lights_of(document),
        "basis": story.basis_of(document),
        "residuals": patches.residuals_of(document),
        "tiles": [patches.tiles_of(shot) for shot in shots],
        "noise": [plots.noise_plot(shot["patches"], f"noise-{j}") for j, shot in enumerate(shots, 1)],
        "falls": uneven.falls_of(document),
        "photos": [photos.photo_of(shot, preview) for shot, preview in zip(shots, previews, strict=True)],
        "assumptions": details.assumptions_of(document),
        "details": details.details_of(document),
        "number_columns": details.NUMBERS,
        "numbers": [details.numbers_of(shot) for shot in shots],
        "hashes": details.hashes_of(document),
    }
    if "ssf" in document:
        curves = curves_of(document)
        shown |= {
            "curves": curves,
            "curve_plots": (
                plots.curve_plot(curves, 1080, 400, 5, "wide"),
                plots.curve_plot(curves, 360, 300, 10, "narrow"),
            ),
            "curve_rows": _values(curves),
            "big": certificate.big_numbers(document),
            "channels": certificate.channels_of(document),
            "proof": story.proof_of(document),
            "colour": story.colour_of(document),
            "comparison": comparison_of(document, beside.other, beside.other_name),
            "comparison_limit": LIMIT,
            "linearity": [plots.linearity_plot(shot["patches"], f"linearity-{j}") for j, shot in enumerate(shots, 1)],
        }
    return str(_environment().get_template("page.html.jinja").render(shown))


def _values(curves: Curves) -> list[list[str]]:
    """A row every 10 nm: the curves, the ends of their bands, the truth."""
    columns = list(curves.ssf.T)
    if curves.low is not None and curves.high is not None:
        columns += [end[:, i] for i in range(3) for end in (curves.low, curves.high)]
    if curves.truth is not None:
        columns += list(curves.truth.T)
    return [
        [f"{WAVELENGTHS[k]:.0f}", *(f"{column[k]:.4f}".replace("-", "\u2212") for column in columns)] for k in TEN_NM
    ]


def _flat(row: tuple[Any, Sequence[Any]]) -> list[Any]:
    """A row's heading and its cells as one list."""
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
    environment.globals |= {"channels_in_order": CHANNELS}
    return environment
