"""A result document as pictures: the PNG of the curves and the HTML page. `report` has checked the document."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from camssf.colour.indices import quality_of
from camssf.documents.choice import choice_of
from camssf.documents.light import cost_of, kinds_in_words, lights_of
from camssf.errors import CalibrationError
from camssf.fonts import prepare_matplotlib
from camssf.grid import WAVELENGTHS, Floats

Json: TypeAlias = dict[str, Any]

CHANNELS = ("red", "green", "blue")
BAND = 1.96
COLOUR_LAMPS = ("D65", "A")
"""Half-width of a 95 % band in standard deviations."""


def _curves(ssf: Json) -> Floats:
    """Columns red, green, blue, shape (681, 3)."""
    return np.array([ssf[colour] for colour in CHANNELS], dtype=np.float64).T


def _limits(ssf: Floats, std: Floats | None, truth: Floats | None) -> tuple[float, float]:
    """The response axis: all of every curve, and of the bands what does not dwarf the curves."""
    low, high = min(0.0, float(ssf.min())), 1.0
    if truth is not None:
        low, high = min(low, float(truth.min())), max(high, float(truth.max()))
    if std is not None:
        low = min(low, max(float((ssf - BAND * std).min()), -0.15))
        high = max(high, min(float((ssf + BAND * std).max()), 1.3))
    return low - 0.02, high + 0.09


def _drawn(document: Json) -> tuple[Floats, Floats | None, Floats | None]:
    """Curves, their standard deviations and the truth, (681, 3) each."""
    std, truth = document.get("ssf_std"), document.get("truth")
    return (
        _curves(document["ssf"]),
        _curves(std) if std else None,
        _curves(truth["ssf"]) if truth else None,
    )


def _peak_labels(ssf: Floats, std: Floats | None) -> list[tuple[str, float, float, str]]:
    """(text, nm, response, side) over each peak and its band; neighbours within 50 nm turn away from each other."""
    order = ssf.argmax(axis=0)
    nm = WAVELENGTHS[order]
    labels = []
    for i, colour in enumerate(CHANNELS):
        top = 1.0 if std is None else min(1.3, 1 + BAND * std[order[i], i])
        near = nm[(np.abs(nm - nm[i]) < 50) & (np.arange(3) != i)]
        side = "middle" if not near.size else "start" if nm[i] > near.mean() else "end"
        labels.append((f"{colour} {nm[i]:.0f} nm", float(nm[i]), float(top) + 0.025, side))
    return labels


def picture(document: Json) -> bytes:
    """The curves with their 95 % bands, and the truth where there is one."""
    from io import BytesIO

    prepare_matplotlib()
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    ssf, std, truth = _drawn(document)
    ink, quiet, hues = "#24262b", "#6b7079", ("#b8322a", "#23794a", "#2a57b0")
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        figure = Figure(figsize=(9.6, 5.4), dpi=150, facecolor="white")
        axes = figure.add_axes((0.075, 0.115, 0.9, 0.75))
        for i, (colour, line) in enumerate(zip(CHANNELS, hues, strict=True)):
            curve = ssf[:, i]
            if std is not None:
                half = BAND * std[:, i]
                axes.fill_between(WAVELENGTHS, curve - half, curve + half, color=line, alpha=0.16, linewidth=0)
            axes.plot(WAVELENGTHS, curve, color=line, linewidth=2, label=colour)
            if truth is not None:
                axes.plot(WAVELENGTHS, truth[:, i], color=ink, linewidth=1.1, dashes=(4, 3))
        sides: dict[str, Any] = {"start": "left", "middle": "center", "end": "right"}
        for (text, nm, top, side), line in zip(_peak_labels(ssf, std), hues, strict=True):
            axes.text(nm, top, text, ha=sides[side], color=line, fontsize=9.5)
        axes.set_xlim(380, 720)
        axes.set_ylim(*_limits(ssf, std, truth))
        axes.set_xticks(range(400, 721, 40))
        axes.set_xlabel("wavelength, nm", color=ink)
        axes.set_ylabel("relative response (peak = 1)", color=ink)
        axes.grid(color="#e4e4df", linewidth=0.8)
        axes.set_axisbelow(True)
        axes.axhline(0, color=quiet, linewidth=0.8)
        axes.tick_params(colors=quiet, length=0)
        axes.spines[:].set_visible(False)
        note = "curves" if std is None else "curves with 95 % bands"
        if truth is not None:
            note += f"; dashed: {_short_name(document['truth']['name'])}"
        # Names are hostile input: "$" must not start a formula, nor a rare letter miss its glyph.
        figure.text(0.075, 0.94, _title(document), color=ink, fontsize=14, fontweight="bold", parse_math=False)
        figure.text(0.075, 0.895, note, color=quiet, fontsize=10.5, parse_math=False)
        file = BytesIO()
        FigureCanvasAgg(figure).print_png(file, metadata={"Software": None})
    return file.getvalue()


def _short_name(text: str, length: int = 60) -> str:
    """Letters that every build of the plot's font has, not too many of them."""
    text = "".join(c if c.isprintable() and ord(c) < 0x250 else "?" for c in text)
    return text if len(text) <= length else text[: length - 3] + "..."


def _title(document: Json) -> str:
    lamps = " + ".join(shot["lamp"]["name"] for shot in document["shots"])
    return f"{_short_name(_camera(document), 50)} under {_short_name(lamps, 40)}"


def _camera(document: Json) -> str:
    make, model = document["camera"]["make"].strip(), document["camera"]["model"].strip()
    # "NIKON CORPORATION" "NIKON D5100": many makers repeat their name in the model.
    twice = make and model.lower().startswith(make.lower().split()[0])
    return (model if twice else f"{make} {model}".strip()) or "unnamed camera"


def media_type(image: bytes) -> str | None:
    """Of a JPEG or PNG; None for anything else."""
    if image.startswith(b"\xff\xd8\xff"):
        return "image/jpeg"
    return "image/png" if image.startswith(b"\x89PNG\r\n\x1a\n") else None


# The page

_UNSHOWN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def _t(text: object) -> str:
    """Text for HTML: escaped, without control, surrogate and direction-changing characters."""
    return escape(_UNSHOWN.sub("\ufffd", str(text)))


def _n(value: float, digits: int = 3) -> str:
    """A number for people: significant digits, a true minus, no 'e' unless it must."""
    if value == 0:
        return "0"
    if 1e-4 <= abs(value) < 1e6:
        decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        return f"{value:.{decimals}f}".replace("-", "\u2212")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa} × 10<sup>{int(exponent)}</sup>".replace("-", "\u2212")


def _brief(value: float) -> str:
    """A chosen number, such as a bound: without the zeros that only state a precision."""
    text = _n(value)
    return text.rstrip("0").rstrip(".") if "." in text and "<" not in text else text


def _signed(value: float) -> str:
    text = f"{value:+.1f}" if abs(value) < 1e4 else f"{value:+.0e}"
    text = text.replace("-", "\u2212")
    return "0.0" if text[1:] == "0.0" else text


def page(document: Json, previews: Sequence[bytes | None]) -> str:
    """The report of a result document, one self-contained HTML file."""
    style = files("camssf").joinpath("data", "report.css").read_text("utf-8")
    curves = "ssf" in document
    sections = [
        _banner(document),
        _headline(document),
        _section("Spectral sensitivity", _curve_section(document)) if curves else "",
        _section("Which basis answered", _choice_section(document)),
        _section("The light that nobody named", _light_section(document)),
        _section("Where the band comes from", _budget_section(document)),
        _section("What the curves are worth for colour", _colour_section(document)) if curves else "",
        _section("Measured against synthetic patches", _tile_section(document)),
        _section("Residuals", _residual_section(document)),
        _section("Where each patch lies on the photo", _photo_section(document, previews)),
        _section("What was assumed", _assumption_section(document)),
        _section("Details", _detail_section(document)),
        _section("Hashes", _hash_section(document)),
    ]
    title = f"Spectral sensitivity of {_t(_camera(document))}"
    return f"""<!DOCTYPE html>
<html lang="en-GB">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy"
content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>
{style}</style>
</head>
<body>
<main>
<header><p class="kicker">camssf report</p><h1>{title}</h1></header>
{"".join(sections)}
</main>
<footer><p>Written by camssf {_t(document["generator"]["version"])}; the numbers behind this page are in
result.json beside it.</p></footer>
</body>
</html>
"""


def _section(title: str, body: str) -> str:
    return f"<section><h2>{title}</h2>\n{body}</section>\n" if body else ""


def _per_shot(document: Json, bodies: Sequence[str]) -> str:
    """One block a shot, with a heading where there are several."""
    if len(bodies) == 1:
        return bodies[0]
    names = [_t(shot["lamp"]["name"]) for shot in document["shots"]]
    blocks = zip(names, bodies, strict=True)
    return "".join(f"<h3>Shot {i}: {name}</h3>\n{body}" for i, (name, body) in enumerate(blocks, 1) if body)


def _banner(document: Json) -> str:
    status = document["verdict"]["status"]
    mark, word, meaning = {
        "accepted": ("✓", "Accepted", "Every check passed."),
        "doubtful": ("!", "Doubtful", "The curves are usable with the reservations below."),
        "refused": ("✕", "Refused", "This capture cannot carry an answer, so there are no curves."),
    }[status]
    reasons = "".join(_reason(reason) for reason in document["verdict"]["reasons"])
    return f"""<section class="banner {status}" aria-labelledby="verdict">
<span class="mark" aria-hidden="true">{mark}</span>
<div><h2 id="verdict">{word}</h2><p>{meaning}</p>{f"<ul>{reasons}</ul>" if reasons else ""}</div>
</section>
"""


def _reason(reason: Json) -> str:
    numbers = [
        f"{word} {_brief(reason[key])}"
        for key, word in (("value", "value"), ("threshold", "limit"))
        if reason[key] is not None
    ]
    aside = " · ".join([f"<code>{_t(reason['code'])}</code>", *numbers])
    return (
        f'<li><strong>{_t(reason["message"])}</strong> {_t(reason["advice"])}<span class="aside">{aside}</span></li>'
    )


def _headline(document: Json) -> str:
    shots, chart = document["shots"], document["chart"]
    lamps = " + ".join(_t(shot["lamp"]["name"]) for shot in shots) or "not known"
    facts = {
        "Camera": _t(_camera(document)),
        "Lamp" if len(shots) < 2 else f"Lamps ({len(shots)} shots)": lamps,
        "Chart": f"{_t(chart['name'])}, table {_t(chart['table'])}",
        "Basis": f"{_t(document['basis'])}, {_t(document['engine'])} engine",
    }
    listed = "".join(f"<div><dt>{word}</dt><dd>{text}</dd></div>" for word, text in facts.items())
    body = f'<dl class="facts">{listed}</dl>\n'
    if "ssf" in document:
        body += _headline_numbers(document)
    return f'<section aria-label="In short">{body}</section>\n'


def _headline_numbers(document: Json) -> str:
    scores = document["scores"]
    ssf, std, _ = _drawn(document)
    visible = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
    error = math.fsum(scores["rmsre_percent"]) / 3
    big = [
        (f"{_n(error)} %", "RMSRE: relative error on unseen patches"),
        (_n(scores["delta_e00"], 2), "ΔE<sub>00</sub> of the patch colours"),
        (_n(max(document["gap"]), 2), "largest relative duality gap"),
    ]
    rows = [
        ("Peak, nm", [f"{WAVELENGTHS[k]:.1f}" for k in ssf.argmax(axis=0)]),
        ("RMSRE on unseen patches, %", [_n(v) for v in scores["rmsre_percent"]]),
        ("Channel gain, relative to green", [_n(v, 4) for v in document["channel_gain"]]),
        ("Relative duality gap", [_n(v, 1) for v in document["gap"]]),
        ("Penalty γ (l1)", [_brief(v) for v in document["gamma"]]),
    ]
    if std is not None:
        half = BAND * std[visible].mean(axis=0)
        big.insert(0, (f"± {_n(float(half.mean()), 2)}", "mean half-width of the 95 % band"))
        rows.insert(1, ("Mean half-width of the 95 % band, 400–700 nm", [_n(v, 2) for v in half]))
    if scores["rmse"] is not None:
        big.insert(0, (_n(math.fsum(scores["rmse"]) / 3, 2), "RMSE against the truth (peak = 1)"))
        rows.insert(1, ("RMSE against the truth, 400–700 nm", [_n(v) for v in scores["rmse"]]))
    tiles = "".join(f'<div><span class="number">{value}</span><span>{text}</span></div>' for value, text in big)
    table = _table(
        f"Each channel. Unseen patches: {_t(scores['unseen'])}. Quadratic penalty λ₂ = {_brief(document['l2'])}.",
        ["", "Red", "Green", "Blue"],
        [[name, *cells] for name, cells in rows],
        "channels",
    )
    return f'<div class="big">{tiles}</div>\n{table}{_proof(document)}'


def _proof(document: Json) -> str:
    """One line that says what the proof is: the layers' own gap, and what the finish had to do."""
    if "layers_gap" not in document or "finish_steps" not in document:
        return ""
    largest, steps = max(document["layers_gap"]), document["finish_steps"]
    names = f" ({', '.join(CHANNELS)})" if len(steps) > 1 else ""
    counts = ", ".join(f"{count:.0f}" for count in steps)
    walked = f"took {counts} step{'' if steps == [1] else 's'} to it{names}" if any(steps) else "had nothing to do"
    near = _n(max(largest, 0.0), 2)
    return (
        f"<p>The proof: the layers alone came within {near} of the optimum (relative duality gap); "
        f"the exact finish {walked}.</p>\n"
    )


def _table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "") -> str:
    """A table of HTML cells whose first column is the row's heading; scrolls by itself where it is wide."""
    top = "".join(f'<th scope="col">{cell}</th>' if cell else "<td></td>" for cell in head)
    body = "".join(
        f'<tr><th scope="row">{row[0]}</th>{"".join(f"<td>{cell}</td>" for cell in row[1:])}</tr>\n' for row in rows
    )
    label = re.sub("<[^>]*>", "", caption)
    return (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{label}">'
        f'<table class="{kind}"><caption>{caption}</caption><thead><tr>{top}</tr></thead>\n'
        f"<tbody>{body}</tbody></table></div>\n"
    )


# Curves


def _curve_section(document: Json) -> str:
    ssf, std, truth = _drawn(document)
    keys = "".join(f'<li class="{colour}"><span class="key"></span>{colour}</li>' for colour in CHANNELS)
    if std is not None:
        keys += '<li><span class="key wash"></span>95 % band</li>'
    if truth is not None:
        keys += f'<li><span class="key dashes"></span>{_t(document["truth"]["name"])}</li>'
    picks = np.arange(0, len(WAVELENGTHS), 20)
    head, columns = ["nm", "Red", "Green", "Blue"], [*ssf.T]
    if std is not None:
        head, columns = [*head, "± red", "± green", "± blue"], [*columns, *(BAND * std.T)]
    if truth is not None:
        head, columns = [*head, "true red", "true green", "true blue"], [*columns, *truth.T]
    rows = [[f"{WAVELENGTHS[k]:.0f}", *(f"{c[k]:.4f}".replace("-", "\u2212") for c in columns)] for k in picks]
    caption = "Response, peak = 1" + ("" if std is None else "; ± is the half-width of the 95 % band")
    none = "" if std is not None else "<p>This basis holds no spread of cameras, so it gives no band.</p>"
    return f"""<figure>
<ul class="keys">{keys}</ul>
{_plot(document, 1080, 440, 5, "wide")}{_plot(document, 360, 300, 10, "narrow")}
<figcaption>Relative response of each channel, peak = 1. Point at a wavelength to read it.</figcaption>
</figure>{none}
<details><summary>Values every 10 nm</summary>
{_table(caption, head, rows, "numbers")}
</details>
"""


def _plot(document: Json, width: int, height: int, step: int, kind: str) -> str:
    """The curves as SVG in CSS pixels; `step` nm between readouts."""
    ssf, std, truth = _drawn(document)
    low, high = _limits(ssf, std, truth)
    left, right, top, bottom = (52, 12, 46, 46) if kind == "wide" else (30, 14, 52, 40)

    def x(nm: Floats | float) -> Any:
        return left + (np.asarray(nm) - 380.0) / 340.0 * (width - left - right)

    def y(value: Floats | float) -> Any:
        return height - bottom - (np.asarray(value) - low) / (high - low) * (height - top - bottom)

    def path(nm: Floats, values: Floats) -> str:
        # 1 nm is finer than a pixel.
        return "M" + "L".join(f"{a:.1f},{b:.1f}" for a, b in zip(x(nm), y(values), strict=True))

    thin = slice(None, None, 2)
    nm = WAVELENGTHS[thin]
    parts = []
    for v in np.arange(math.ceil(low * 5), math.floor(high * 5) + 1) / 5:
        line = f'<line class="{"zero" if v == 0 else "grid"}" x1="{left}" x2="{width - right}"'
        label = f"{v:.1f}".replace("-", "\u2212")
        parts.append(
            f'{line} y1="{y(v):.1f}" y2="{y(v):.1f}"/><text x="{left - 7}" y="{y(v) + 4:.1f}" '
            f'text-anchor="end">{label}</text>'
        )
    for mark in range(400, 721, 40 if kind == "wide" else 80):
        parts.append(f'<text x="{x(mark):.1f}" y="{height - bottom + 18}" text-anchor="middle">{mark}</text>')
    middle = (left + width - right) / 2
    parts.append(f'<text x="{middle}" y="{height - 6}" text-anchor="middle">wavelength, nm</text>')
    parts.append(f'<text x="{left if kind == "wide" else 4}" y="{top - 26}">relative response</text>')
    drawing = []
    for i, colour in enumerate(CHANNELS):
        curve = ssf[thin, i]
        if std is not None:
            half = BAND * std[thin, i]
            ring = path(np.r_[nm, nm[::-1]], np.r_[curve + half, (curve - half)[::-1]])
            drawing.append(f'<path class="band {colour}" d="{ring}Z"/>')
    for i, colour in enumerate(CHANNELS):
        drawing.append(f'<path class="curve {colour}" d="{path(nm, ssf[thin, i])}"/>')
    if truth is not None:
        drawing += [f'<path class="truth" d="{path(nm, truth[thin, i])}"/>' for i in range(3)]
    for colour, (text, at_nm, height_at, side) in zip(CHANNELS, _peak_labels(ssf, std), strict=True):
        drawing.append(
            f'<text class="peak {colour}" x="{x(at_nm):.1f}" y="{y(height_at):.1f}" '
            f'text-anchor="{side}">{text if kind == "wide" else colour}</text>'
        )
    frame = f'x="{left}" y="{top}" width="{width - left - right}" height="{height - top - bottom}"'
    slot = step / 340.0 * (width - left - right)
    readouts = []
    for k in range(0, len(WAVELENGTHS), 2 * step):
        at = float(x(WAVELENGTHS[k]))
        values = "".join(
            f'<tspan class="{colour}" dx="10">{ssf[k, i]:.3f}'
            + ("" if std is None else f" ± {BAND * std[k, i]:.3f}" if kind == "wide" else "")
            + "</tspan>"
            for i, colour in enumerate(CHANNELS)
        ).replace("-", "\u2212")
        start, end = max(left, at - slot / 2), min(width - right, at + slot / 2)
        readouts.append(
            f'<g class="readout"><rect x="{start:.1f}" y="{top}" width="{end - start:.1f}" '
            f'height="{height - top - bottom}"/>'
            f'<line x1="{at:.1f}" x2="{at:.1f}" y1="{top}" y2="{height - bottom}"/>'
            f'<text x="{width - right}" y="{top - 26}" text-anchor="end">{WAVELENGTHS[k]:.0f} nm{values}</text>'
            "</g>\n"
        )
    peaks = ", ".join(f"{c} at {WAVELENGTHS[k]:.0f} nm" for c, k in zip(CHANNELS, ssf.argmax(axis=0), strict=True))
    return f"""<svg class="plot {kind}" viewBox="0 0 {width} {height}" role="img"
aria-label="Three curves of relative response over wavelength, 380 to 720 nm. Peaks: {peaks}.">
<clipPath id="frame-{kind}"><rect {frame}/></clipPath>
{"".join(parts)}
<g clip-path="url(#frame-{kind})">{"".join(drawing)}</g>
{"".join(readouts)}</svg>
"""


# Patches


def _columns(quadrangles: Sequence[Any]) -> int:
    """Patches in a row of the chart: where the walk from patch to patch first turns back."""
    centres = np.asarray(quadrangles, dtype=np.float64).mean(axis=1)
    for i, (a, b) in enumerate(pairwise(centres), 1):
        if np.dot(b - a, centres[1] - centres[0]) < 0:
            return i if len(centres) % i == 0 else len(centres)
    return len(centres)


def _hex(srgb: Sequence[float]) -> str:
    return "#" + "".join(f"{round(255 * v):02x}" for v in srgb)


def _choice_section(document: Json) -> str:
    """Which basis answered, with what odds, and why; nothing where one was told."""
    found = choice_of(document)
    if found is None:
        return ""
    weighed = document["choice"]
    best = max(each["log_evidence"] for each in weighed)
    together: dict[tuple[str, float], tuple[float, float]] = {}
    for each in weighed:  # over the kinds of a light that nobody named: their own section shows them
        nats, share = together.get((each["basis"], each["prior_scale"]), (-math.inf, 0.0))
        own = max(nats, each["log_evidence"]), share + each["probability"]
        together[each["basis"], each["prior_scale"]] = own
    rows = [
        [_t(basis), _brief(scale), f"{nats - best:.1f}".replace("-", "\u2212"), _percent(share)]
        for (basis, scale), (nats, share) in together.items()
    ]
    table = _table(
        "What was weighed. Evidence: natural logarithm of the marginal likelihood, less the best; the probabilities "
        "hold what was believed beforehand, too.",
        ["Basis", "Width of its prior", "Evidence", "Probability"],
        rows,
        "choice",
    )
    return "".join(f"<p>{_t(words)}</p>\n" for words in found.words) + table


def _light_section(document: Json) -> str:
    """Of each light that nobody named: what it was, and what that costs."""
    lights = lights_of(document)
    if not lights:
        return ""
    several, bodies = len(document["shots"]) > 1, []
    for number, light in lights:
        head = f"<h3>Shot {number}</h3>\n" if several else ""
        bodies.append(
            f"{head}<p>{_t(kinds_in_words(light))}. Correlated colour temperature {light['kelvin']:,.0f} ± "
            f"{light['kelvin_std']:,.0f} K (one standard deviation).</p>\n{_light_plot(light, f'light-{number}')}"
        )
    cost = cost_of(document)
    words = "" if cost is None else ", ".join(f"{c} {100 * v:.0f} %" for c, v in zip(CHANNELS, cost, strict=True))
    paid = f"<p>Of the curves' variance the light is to blame for: {words}. A named lamp narrows the band.</p>\n"
    return (
        "<p>No lamp was named, so the signals were solved under each kind of light; the answers are mixed by their "
        f"probabilities, and so is the light.</p>\n{''.join(bodies)}{paid if words else ''}"
    )


def _light_plot(light: Json, name: str) -> str:
    """A light's estimated power and its 95 % band, as SVG in CSS pixels."""
    width, height, left, right, top, bottom = 720, 260, 52, 12, 34, 46
    thin = slice(None, None, 2)
    nm, power, std = (np.array(light[key], dtype=np.float64)[thin] for key in ("wavelength_nm", "power", "std"))
    low, high = np.maximum(power - BAND * std, 0.0), power + BAND * std
    ceiling = 1.05 * max(float(min(high.max(), 3.0 * power.max())), 1e-9)

    def path(values: Floats, across: Floats) -> str:
        x = left + (across - 380.0) / 340.0 * (width - left - right)
        y = height - bottom - np.clip(values, 0.0, ceiling) / ceiling * (height - top - bottom)
        return "M" + "L".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))

    ring = path(np.r_[high, low[::-1]], np.r_[nm, nm[::-1]])
    base = height - bottom
    marks = "".join(
        f'<text x="{left + (mark - 380) / 340 * (width - left - right):.1f}" y="{base + 18}" '
        f'text-anchor="middle">{mark}</text>'
        for mark in range(400, 720, 40)
    )
    return f"""<figure><svg class="plot" viewBox="0 0 {width} {height}" role="img" id="{name}"
aria-label="Relative power of the light over wavelength, 380 to 720 nm, with its 95 % band.">
<line class="zero" x1="{left}" x2="{width - right}" y1="{base}" y2="{base}"/>
{marks}<text x="{(left + width - right) / 2}" y="{height - 6}" text-anchor="middle">wavelength, nm</text>
<text x="{left}" y="{top - 14}">relative power</text>
<path style="fill:var(--quiet);fill-opacity:.2" d="{ring}Z"/>
<path style="fill:none;stroke:var(--ink);stroke-width:1.6" d="{path(power, nm)}"/></svg>
<figcaption>The light as the signals have it: the mean over its kinds, and its 95 % band.</figcaption></figure>
"""


def _percent(share: float) -> str:
    """A probability; beyond a thousandth of 0 or 1 only that it is."""
    return "&lt; 0.1 %" if share < 1e-3 else "&gt; 99.9 %" if share > 0.999 else f"{100 * share:.1f} %"


def _budget_section(document: Json) -> str:
    """The uncertainty budget, and what each shot would have said alone."""
    found = document.get("uncertainty")
    if not found:
        return ""
    rows = [
        [_t(term["source"]), _t(term["size"]), *(f"{100 * share:.0f} %" for share in term["share"])]
        for term in found["budget"]
    ]
    table = _table("Share of each source in the variance", ["Source", "Size", "Red", "Green", "Blue"], rows, "budget")
    if not found["alone"]:
        return table
    names = [_t(shot["lamp"]["name"]) for shot in document["shots"]]
    alone = ", ".join(f"{name} ± {width:.3f}" for name, width in zip(names, found["alone"], strict=False))
    bought = 1.0 - found["half_width"] / min(found["alone"]) if min(found["alone"]) > 0 else 0.0
    return (
        f"<p>All shots together: ± {found['half_width']:.3f} of the peak on average. Each alone: {alone}. "
        f"The other lamps narrow the best single shot's band by {100 * bought:.0f} %.</p>\n{table}"
    )


def _colour_section(document: Json) -> str:
    """Luther condition, SMI, and the matrices of two lamps: of the curves alone, whatever the photos were like."""
    curves = np.stack([np.array(document["ssf"][colour], dtype=np.float64) for colour in CHANNELS], axis=1)
    try:
        found = [quality_of(curves, lamp) for lamp in COLOUR_LAMPS]
    except (CalibrationError, np.linalg.LinAlgError):  # curves of a strange document may see no light
        return ""
    rows = [
        [_t(f"{word} from {each.lamp}'s camera RGB"), *(_n(value, 5) for value in row)]
        for each in found
        for word, row in zip("XYZ", each.matrix.coefficients.T.tolist(), strict=True)
    ]
    misses = "; ".join(
        f"under {_t(each.lamp)} {each.matrix.delta_e00['matrix']:.2f} by a matrix, "
        f"{each.polynomial.delta_e00['root-polynomial']:.2f} by a root-polynomial"
        for each in found
    )
    first = found[0]
    return (
        f"<p>Sensitivity metamerism index {first.smi:.0f} (100 is an observer's). No matrix of the curves gives "
        f"{100 * first.luther:.0f} % of the CIE 1931 observer (Luther condition: 0 %). Mean ΔE00 of surfaces that "
        f"the fit had not seen: {misses}.</p>\n"
        + _table("White-balanced camera RGB to XYZ; white keeps its colour", ["", "Red", "Green", "Blue"], rows)
    )


def _tile_section(document: Json) -> str:
    bodies = [_tiles(shot) for shot in document["shots"]]
    if not any(bodies):
        return ""
    return (
        "<p>Each patch twice: <strong>left half measured</strong>, <strong>right half synthetic</strong>, "
        "as the recovered curves predict it. The less the seam shows, the better (the paper's Fig. 6).</p>"
        + _per_shot(document, bodies)
    )


def _tiles(shot: Json) -> str:
    patches = shot["patches"]
    if not patches or any(patch["measured_srgb"] is None or patch["synthetic_srgb"] is None for patch in patches):
        return ""
    columns = _columns(shot["pose"]["patches"])
    tiles = []
    for patch in patches:
        left, right, name = _hex(patch["measured_srgb"]), _hex(patch["synthetic_srgb"]), _t(patch["name"])
        words = f"{name}: measured {left}, synthetic {right}"
        tiles.append(
            f'<li><span class="tile" role="img" aria-label="{words}" title="{words}">'
            f'<span style="background:{left}"></span><span style="background:{right}"></span></span>'
            f'<span class="name">{name}</span></li>\n'
        )
    dense = " dense" if columns > 8 else ""
    return f'<ul class="tiles{dense}" style="--columns:{columns}">{"".join(tiles)}</ul>\n'


def _residual_section(document: Json) -> str:
    errors = [_errors(shot) for shot in document["shots"]]
    patches = [patch for shot in document["shots"] for patch in shot["patches"]]
    banded = any(patch.get("unseen_std") or patch.get("predicted_std") for patch in patches)
    interval = "what the prediction leaves open, and the noise" if banded else "the measurement's own noise"
    size = np.concatenate([np.abs(error[np.isfinite(error)]) for error, _ in errors] or [np.empty(0)])
    if not size.size:
        return ""
    # One scale for all, so that shots compare; a few wild patches must not flatten the others.
    scale = _round_up(min(size.max(), 5 * np.quantile(size, 0.8)) * 1.05)
    shots = zip(document["shots"], errors, strict=True)
    bodies = [_residuals(shot, error, half, scale) for shot, (error, half) in shots]
    return (
        "<p>Predicted minus measured signal, in percent of the measured one. <strong>Filled dot:</strong> "
        "predicted by a fit that has not seen the patch. <strong>Hollow dot:</strong> by the full fit. "
        f"<strong>Bar:</strong> 95 % interval from {interval}. A triangle points at a value beyond the scale."
        f"{_held(document, errors) if banded else ''}</p>" + _per_shot(document, bodies)
    )


def _held(document: Json, errors: list[tuple[Floats, Floats]]) -> str:
    """How many unseen values lie within their bars, in words."""
    inside = []
    for shot, (error, half) in zip(document["shots"], errors, strict=True):
        unseen = np.array([patch["unseen"] is not None for patch in shot["patches"]])[:, None] & np.isfinite(error)
        inside.append((np.abs(error) <= half)[unseen])
    within = np.concatenate(inside)
    return f" Of {within.size} unseen values {within.mean():.0%} lie within their bars." if within.size else ""


def _errors(shot: Json) -> tuple[Floats, Floats]:
    """Predicted minus measured signal and the half-width of its 95 % interval, (n, 3) in % of the signal."""
    patches = shot["patches"]
    signal = np.array([patch["signal"] for patch in patches], dtype=np.float64)
    guess = [patch["unseen"] or patch["predicted"] or [math.nan] * 3 for patch in patches]
    # A patch without light has no relative error.
    signal = np.where(signal > 1e-6, signal, math.nan)
    noise = np.array([patch["standard_error"] for patch in patches], dtype=np.float64)
    open_ = [patch.get("unseen_std" if patch["unseen"] else "predicted_std") or [0.0] * 3 for patch in patches]
    half = BAND * np.hypot(noise, np.array(open_, dtype=np.float64))
    return 100 * (np.array(guess, dtype=np.float64) - signal) / signal, 100 * half / signal


def _residuals(shot: Json, error: Floats, half: Floats, scale: float) -> str:
    """A table of dot plots: a row for each patch, a column for each channel."""
    patches = shot["patches"]
    rows = []
    for i, patch in enumerate(patches):
        cells = "".join(
            _dot(error[i, c], half[i, c], scale, colour, seen=patch["unseen"] is None)
            for c, colour in enumerate(CHANNELS)
        )
        swatch = f'<span class="swatch" style="background:{_hex(patch["reflectance_srgb"])}"></span>'
        left_out = "" if patch["used"] else " <small>not fitted</small>"
        rows.append(f'<tr><th scope="row">{swatch}{_t(patch["name"])}{left_out}</th>{cells}</tr>\n')
    axis = f'<td class="axis"><span>\u2212{scale:g}</span><span>0</span><span>+{scale:g}</span></td>'
    head = "".join(f'<th scope="col">{colour.capitalize()}</th>' for colour in CHANNELS)
    return f"""<table class="residuals"><caption>Residual of each patch and channel, %</caption>
<thead><tr><th scope="col">Patch</th>{head}</tr><tr><td></td>{axis * 3}</tr></thead>
<tbody>{"".join(rows)}</tbody></table>
"""


def _dot(error: float, half: float, scale: float, colour: str, *, seen: bool) -> str:
    if not math.isfinite(error):
        return "<td>–</td>"

    def at(value: float) -> str:
        return f"{50 + 50 * max(-1.0, min(1.0, value / scale)):.2f}%"

    if abs(error) <= scale:
        mark = f'<circle class="{"hollow" if seen else "full"}" cx="{at(error)}" cy="50%" r="3.5"/>'
    else:
        end, back = (at(error), -9 if error > 0 else 9)
        mark = f'<svg x="{end}" y="50%" overflow="visible"><path d="M{back},-5L0,0L{back},5Z"/></svg>'
    bar = f'<line x1="{at(error - half)}" x2="{at(error + half)}" y1="50%" y2="50%"/>' if abs(error) <= scale else ""
    return (
        f'<td class="{colour}"><svg class="dot" width="100%" height="18" aria-hidden="true">'
        f'<line class="zero" x1="50%" x2="50%" y1="0" y2="100%"/>{bar}{mark}</svg>'
        f'<span class="value">{_signed(error)}</span></td>'
    )


def _round_up(value: float) -> float:
    """The next of 1, 1.5, 2, 3, 4, 6, 8 × a power of ten."""
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1, 1.5, 2, 3, 4, 6, 8, 10) if step * power >= value)


# Photos


def _upright(points: Any, width: int, height: int, orientation: int) -> Floats:
    """Active-area px → display px by the TIFF orientation; sample centres move from 0 to 0.5."""
    a, b, c, d, e, f = _turn(width, height, orientation)
    p = np.asarray(points, dtype=np.float64) + 0.5
    return np.stack([a * p[..., 0] + c * p[..., 1] + e, b * p[..., 0] + d * p[..., 1] + f], axis=-1)


def _turn(width: int, height: int, orientation: int) -> tuple[int, int, int, int, int, int]:
    """The SVG matrix a b c d e f of a TIFF orientation (TIFF 6.0, tag 274)."""
    w, h = width, height
    return {
        1: (1, 0, 0, 1, 0, 0),
        2: (-1, 0, 0, 1, w, 0),
        3: (-1, 0, 0, -1, w, h),
        4: (1, 0, 0, -1, 0, h),
        5: (0, 1, 1, 0, 0, 0),
        6: (0, 1, -1, 0, h, 0),
        7: (0, -1, -1, 0, h, w),
        8: (0, -1, 1, 0, 0, w),
    }[orientation]


def _photo_section(document: Json, previews: Sequence[bytes | None]) -> str:
    shots = zip(document["shots"], previews, strict=True)
    return _per_shot(document, [_photo(i, shot, preview) for i, (shot, preview) in enumerate(shots)])


def _photo(index: int, shot: Json, preview: bytes | None) -> str:
    """The whole photo, and the chart close up with the patches' names."""
    photo, pose = shot["photo"], shot["pose"]
    width, height, orientation = int(photo["width"]), int(photo["height"]), int(photo["orientation"])
    shown = (height, width) if orientation >= 5 else (width, height)
    if pose is None:
        return _unplaced(shot, preview, shown)
    quads = _upright(pose["patches"], width, height, orientation)
    corners = _upright(pose["corners"], width, height, orientation)
    picture = _picture(photo, preview, shown)
    outlines = []
    for patch, quad in zip(shot["patches"], quads, strict=bool(shot["patches"])):  # none when refused before
        name, ring = _t(patch["name"]), _ring(quad)
        fill = f' style="fill:{_hex(patch["reflectance_srgb"])}"' if preview is None else ""
        outlines.append(f'<polygon points="{ring}"{fill}><title>{name}</title></polygon>')
    drawn = f'<g class="outlines">{"".join(outlines)}</g>'
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = max(1.0, 0.06 * (high - low).max())
    view = [*(low - margin), *(high - low + 2 * margin)]
    box = " ".join(f"{v:.1f}" for v in view)
    missing = (
        " There is no picture of the photo, so the patches carry the table's colours." if preview is None else ""
    )
    name = _t(photo["name"])
    return f"""<figure class="photo{" tall" if shown[1] > shown[0] else ""}">
<svg viewBox="0 0 {shown[0]} {shown[1]}" role="img" aria-label="{name} with the outline of the chart">
<g id="photo-{index}">{picture}</g><g class="outlines"><polygon points="{_ring(corners)}"/></g></svg>
<svg viewBox="{box}" role="img" aria-label="{name}, close-up of the chart with {len(quads)} outlined patches">
<use href="#photo-{index}"/>{drawn}{_labels(shot["patches"], quads) if shot["patches"] else ""}</svg>
<figcaption>{name}: the chart in the photo, and its patches close up. The central part of each outline is
measured.{missing}</figcaption>
</figure>
"""


def _picture(photo: Json, preview: bytes | None, shown: tuple[int, int], *, upright: bool = True) -> str:
    if preview is None:
        return f'<rect class="blank" width="{shown[0]}" height="{shown[1]}"/>'
    width, height = int(photo["width"]), int(photo["height"])
    data = f"data:{media_type(preview)};base64,{base64.b64encode(preview).decode()}"
    matrix = " ".join(map(str, _turn(width, height, int(photo["orientation"]) if upright else 1)))
    return (
        f'<image href="{data}" width="{width}" height="{height}" preserveAspectRatio="none" '
        f'transform="matrix({matrix})"/>'
    )


def _unplaced(shot: Json, preview: bytes | None, shown: tuple[int, int]) -> str:
    """The photo alone, as the sensor saw it, with its pixels numbered: corners by hand are read from it."""
    photo, name = shot["photo"], _t(shot["photo"]["name"])
    if preview is None:
        return ""
    width, height = int(photo["width"]), int(photo["height"])
    size = max(width, height) / 45
    step = next(
        s for s in (50, 100, 200, 500, 1000, 2000, 5000, 10_000) if max(width, height) / s <= 9 or s == 10_000
    )
    texts = [(x, 0.9 * size, f"{x}") for x in range(step, width, step)]
    texts += [(2, y, f"{y}") for y in range(step, height, step)]
    lines = "".join(f'<path d="M{x} 0V{height}"/>' for x in range(step, width, step))
    lines += "".join(f'<path d="M0 {y}H{width}"/>' for y in range(step, height, step))
    numbers = "".join(f'<text fill="#d22" x="{x}" y="{y}">{text}</text>' for x, y, text in texts)
    return f"""<figure class="photo alone">
<svg viewBox="0 0 {width} {height}" role="img" aria-label="{name} with its pixels numbered">
{_picture(photo, preview, (width, height), upright=False)}
<g stroke="#d22" stroke-opacity=".4" stroke-width="{size / 20:.1f}">{lines}</g>
<g font-size="{0.8 * size:.1f}">{numbers}</g></svg>
<figcaption>{name}: no chart was measured in it. The numbers are pixels of the active area, from its top left, as the
sensor saw it: what corners given by hand are counted in.</figcaption>
</figure>
"""


def _ring(points: Floats) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _labels(patches: Sequence[Json], quads: Floats) -> str:
    """The patches' names inside them, a word a line, all of one size that fits; "(.23 D)" is left out."""
    words = [(re.sub(r"\(.*?\)", "", p["name"])[:40].split() or ["?"])[:3] for p in patches]
    diagonals = quads[:, 2:] - quads[:, :2]
    area = np.abs(diagonals[:, 0, 0] * diagonals[:, 1, 1] - diagonals[:, 0, 1] * diagonals[:, 1, 0]) / 2
    longest = max(max(map(len, lines)) for lines in words)
    size = math.sqrt(float(np.median(area))) * min(0.24, 1.5 / longest, 0.8 / max(map(len, words)))
    texts = []
    for patch, lines, (x, y) in zip(patches, words, quads.mean(axis=1), strict=True):
        light = np.dot(patch["reflectance_srgb"], (0.2126, 0.7152, 0.0722)) > 0.6
        first = y - size * 1.05 * (len(lines) - 1) / 2 + size * 0.35
        spans = (f'<tspan x="{x:.1f}" y="{first + 1.05 * size * k:.1f}">{_t(w)}</tspan>' for k, w in enumerate(lines))
        texts.append(f'<text class="{"on-light" if light else "on-dark"}">{"".join(spans)}</text>')
    return f'<g class="labels" font-size="{size:.1f}" aria-hidden="true">{"".join(texts)}</g>'


# Facts


def _assumption_section(document: Json) -> str:
    """What calibrate lists; chart table and lamps in any case."""
    chart, codes = document["chart"], {entry["code"] for entry in document["assumptions"]}
    items = []
    if "chart_table" not in codes:
        items.append(f"Chart table: {_t(chart['table'])}. {_t(chart['source'])}")
    for lamp in [shot["lamp"] for shot in document["shots"]] if "lamp" not in codes else ():
        if lamp["tolerance"] is None:
            items.append(f"Lamp: {_t(lamp['name'])}. {_t(lamp['source'])}")
            continue
        tolerance = _brief(100 * lamp["tolerance"])
        items.append(
            f"Lamp: {_t(lamp['name'])}, taken for right to {tolerance} % (one standard deviation). "
            f"{_t(lamp['source'])}"
        )
    items += [f"{_t(a['message'])} <code>{_t(a['code'])}</code>" for a in document["assumptions"]]
    return "<ul>" + "".join(f"<li>{item}</li>\n" for item in items) + "</ul>\n"


def _detail_section(document: Json) -> str:
    shots = document["shots"]
    if not shots:
        return ""
    rows = [(name, [find(shot) for shot in shots]) for name, find in _DETAILS]
    table = _table(
        "How each shot was taken and found",
        ["", *(_t(shot["photo"]["name"]) for shot in shots)],
        [[name, *cells] for name, cells in rows],
    )
    return table + _per_shot(document, [_patch_table(shot) for shot in shots])


def _share(shot: Json, key: str) -> str:
    """The largest share, and the patch it belongs to."""
    if not shot["patches"]:
        return "not measured"
    worst = max(shot["patches"], key=lambda patch: max(patch[key]))
    share = max(worst[key])
    return "none" if share == 0 else f"{_n(100 * share, 2)} % ({_t(worst['name'])})"


def _exposure(seconds: float | None) -> str:
    if seconds is None:
        return "not stated"
    return f"1/{1 / seconds:.0f} s" if 0 < seconds < 0.4 else f"{_n(seconds)} s"


def _lines(texts: Sequence[str]) -> str:
    return "<br>".join(map(_t, texts)) or "none"


def _shading_map(shot: Json) -> str:
    if not shot["photo"]["gain_map"]:
        return "none"
    return "applied" if shot.get("lens_shading") == "apply" else "not applied"


_DETAILS: tuple[tuple[str, Any], ...] = (
    ("Camera in the file", lambda s: _t(s["photo"]["camera"]) or "not stated"),
    ("Lamp", lambda s: _t(s["lamp"]["name"])),
    (
        "White reference",
        lambda s: s["white_reference"] + (f": {_t(s['white']['name'])}" if s["white"] else ""),
    ),
    ("Dark reference", lambda s: s["dark_reference"] + (f": {_t(s['dark']['name'])}" if s["dark"] else "")),
    ("Exposure", lambda s: _exposure(s["photo"]["exposure"])),
    ("ISO", lambda s: "not stated" if s["photo"]["iso"] is None else f"{s['photo']['iso']:g}"),
    ("Active area, px", lambda s: f"{s['photo']['width']:g} × {s['photo']['height']:g}"),
    ("TIFF orientation", lambda s: f"{s['photo']['orientation']:g}"),
    ("Lens-shading map", _shading_map),
    ("White level, DN", lambda s: f"{s['saturation']:g}"),
    ("Chart layout", lambda s: _t(s["pose"]["layout"]) if s["pose"] else "–"),
    (
        "Chart found",
        lambda s: f"{s['pose']['method']}, {90 * s['pose']['quarter_turns']:g}° from upright" if s["pose"] else "no",
    ),
    ("Agreement with the chart's colours", lambda s: _n(s["pose"]["score"]) if s["pose"] else "–"),
    ("Largest clipped share", lambda s: _share(s, "clipped")),
    ("Largest rejected share (dust, hot pixels)", lambda s: _share(s, "dead")),
    ("Notes", lambda s: _lines(s["pose"]["notes"]) if s["pose"] else "none"),
)


def _patch_table(shot: Json) -> str:
    """Every number of every patch, folded away."""
    if not shot["patches"]:
        return ""
    percent = [
        ("clipped", "clipped, %", 100.0, 2),
        ("dead", "rejected, %", 100.0, 2),
        ("gradient", "gradient, %", 100.0, 2),
    ]
    plain = [
        ("signal", "signal", 1.0, 4),
        ("standard_error", "standard error", 1.0, 2),
        ("predicted", "predicted", 1.0, 4),
        ("predicted_std", "its std", 1.0, 2),
        ("unseen", "unseen", 1.0, 4),
        ("unseen_std", "its std", 1.0, 2),
        ("chart", "chart, DN", 1.0, 5),
        ("white", "white, DN", 1.0, 5),
        ("dark", "dark, DN", 1.0, 5),
    ]
    columns = plain + percent
    rows = [
        [
            _t(patch["name"]) + ("" if patch["used"] else " <small>not fitted</small>"),
            *(
                "–" if patch.get(key) is None else "<br>".join(_n(factor * v, digits) for v in patch[key])
                for key, _, factor, digits in columns
            ),
        ]
        for patch in shot["patches"]
    ]
    head = ["Patch", *(word for _, word, _, _ in columns)]
    body = _table("In each cell red, green and blue, from top to bottom", head, rows, "numbers")
    return f"<details><summary>All numbers of each patch</summary>\n{body}</details>\n"


def _hash_section(document: Json) -> str:
    hashes = document["hashes"]
    rows = [[_t(name), f"<code>{hashes['inputs'][name]}</code>"] for name in sorted(hashes["inputs"])]
    rows.append(["ONNX model", f"<code>{hashes['model']}</code>" if hashes["model"] else "not used"])
    return _table("SHA-256 of what this result was made from", ["File", "SHA-256"], rows, "hashes")
