"""Renders a result document as one line of text and as a small piece of HTML for a notebook."""

from __future__ import annotations

from html import escape
from typing import Any, TypeAlias

import numpy as np

from camssf.documents.basis_choice import band_in_words
from camssf.documents.unnamed_light import lamp_name
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.report.sections.curves import curves_of

Json: TypeAlias = dict[str, Any]

HUES = ("#c8352b", "#268a54", "#3a63d0")
"""Colours of red, green and blue that are legible on white and on black."""
STATUS = {"accepted": "#268a54", "doubtful": "#b07800", "refused": "#c8352b"}
STEP = 4
"""Every fourth wavelength is drawn: 2 nm."""
LONGEST = 60
"""Largest number of characters of a name."""


def with_curves(document: Json) -> Json:
    """The document, if it has curves.

    Raises:
        InvalidArgument: the result was refused.
    """
    if "ssf" not in document:
        reason = document["verdict"]["reasons"][0]
        raise InvalidArgument(f"This result was refused ({reason['code']}): it has no curves.", reason["advice"])
    return document


def as_line(kind: str, document: Json) -> str:
    """`<Calibration of Nikon D5100, D55: accepted; ...>`, always on one line."""
    verdict, parts = document["verdict"], [f"{camera_of(document)}, {lamps_of(document)}"]
    codes = ", ".join(dict.fromkeys(reason["code"] for reason in verdict["reasons"]))
    parts[0] += f": {verdict['status']}" + (f" ({codes})" if codes else "")
    if "ssf" in document:
        parts.append(f"basis {_short(document['basis'])}")
        parts += [f"{name} {value}" for name, value in numbers(document)]
    return f"<{kind} of {'; '.join(parts)}>"


def as_html(document: Json) -> str:
    """Verdict and reasons, the curves as SVG, the scores as a table. No script, no style sheet."""
    verdict = document["verdict"]
    head = (
        f"<p><strong>{escape(camera_of(document))}</strong>, {escape(lamps_of(document))}: "
        f'<strong style="color:{STATUS[verdict["status"]]}">{verdict["status"]}</strong></p>'
    )
    reasons = "".join(
        f"<li><code>{escape(each['code'])}</code>: {escape(each['message'])} {escape(each['advice'])}</li>"
        for each in verdict["reasons"]
    )
    rows = "".join(f"<tr><th scope='row'>{escape(a)}</th><td>{escape(b)}</td></tr>" for a, b in numbers(document))
    return (
        f'<div class="camssf-result">{head}{f"<ul>{reasons}</ul>" if reasons else ""}'
        f"{_svg(document) if 'ssf' in document else ''}{f'<table>{rows}</table>' if rows else ''}</div>"
    )


def camera_of(document: Json) -> str:
    """Make and model; the make is not repeated. "camera" if the files state neither."""
    named = document.get("camera") or {}
    make, model = str(named.get("make") or ""), str(named.get("model") or "")
    words = model if model.casefold().startswith(make.casefold()) else f"{make} {model}"
    return _short(words) or "camera"


def lamps_of(document: Json) -> str:
    """Names of the shots' lamps."""
    names = [_short(lamp_name(shot)) for shot in document["shots"]]
    return " + ".join(names[:4]) + (f" + {len(names) - 4} more" if len(names) > 4 else "") or "no photo"


def numbers(document: Json) -> list[tuple[str, str]]:
    """The main scores as pairs of name and text; empty without curves."""
    if "ssf" not in document:
        return []
    scores, found = document["scores"], []
    if scores.get("rmse") is not None:
        found.append(("RMSE against the truth, R G B", " ".join(f"{value:.4f}" for value in scores["rmse"])))
    found.append(
        ("RMSRE of unseen patches, R G B", " ".join(f"{value:.2f}" for value in scores["rmsre_percent"]) + " %")
    )
    if document.get("uncertainty"):
        found.append(("95 % band", band_in_words(document["uncertainty"])))
    found.append(("duality gap", f"{max(document['gap']):.0e}"))
    return found


def _svg(document: Json) -> str:
    """The three curves and their bands as SVG, 480 by 220; text and axis use the page's text colour."""
    nm = WAVELENGTHS[::STEP]
    drawn = curves_of(document).smooth()
    curves = list(drawn.ssf[::STEP].T)
    band = []
    if drawn.low is not None and drawn.high is not None:
        band = list(zip(drawn.low[::STEP].T, drawn.high[::STEP].T, strict=True))
    low = min(0.0, *(float(curve.min()) for curve in curves))
    high = max(1.05, min(1.4, max((float(top.max()) for _, top in band), default=1.0)))

    def points(x: Floats, y: Floats) -> str:
        across = 36 + 436 * (x - 380.0) / 340.0
        down = 196 - 184 * (np.clip(y, low, high) - low) / (high - low)
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, down, strict=True))

    shapes = [
        f'<polygon points="{points(np.append(nm, nm[::-1]), np.append(bottom, top[::-1]))}" fill="{hue}" '
        'fill-opacity="0.18"/>'
        for (bottom, top), hue in zip(band, HUES, strict=False)
    ]
    shapes += [
        f'<polyline points="{points(nm, curve)}" fill="none" stroke="{hue}" stroke-width="1.6"/>'
        for curve, hue in zip(curves, HUES, strict=True)
    ]
    zero = points(np.array([380.0, 720.0]), np.zeros(2))
    ticks = "".join(
        f'<text x="{36 + 436 * (at - 380) / 340:.0f}" y="212" text-anchor="middle">{at}</text>'
        for at in range(400, 721, 80)
    )
    return (
        '<svg viewBox="0 0 480 220" width="480" height="220" style="max-width:100%;height:auto" role="img" '
        f'aria-label="Sensitivity of red, green and blue over wavelength{", with 95 % bands" if band else ""}">'
        f'<polyline points="{zero}" fill="none" stroke="currentColor" stroke-opacity="0.5"/>{"".join(shapes)}'
        f'<g fill="currentColor" font-size="10" font-family="sans-serif">{ticks}'
        '<text x="472" y="188" text-anchor="end">nm</text>'
        f'<text x="30" y="{points(nm[:1], np.ones(1)).split(",")[1]}" text-anchor="end">1</text></g></svg>'
    )


def _short(text: str) -> str:
    """The text on one line and shortened, because names come from files."""
    words = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return words if len(words) <= LONGEST else f"{words[: LONGEST - 3]}..."
