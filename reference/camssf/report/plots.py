"""Draws results on matplotlib axes, for notebooks and papers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from io import BytesIO
from itertools import cycle
from typing import Any

import numpy as np

from camssf.documents.document import Document, answer_in
from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS, WAVELENGTHS
from camssf.libraries import library, prepare_matplotlib
from camssf.report.names import camera_of, lamps_of
from camssf.report.sections.curves import DrawnCurves, curves_of
from camssf.report.shots import ShownPatches, shots_of
from camssf.report.svg import HUES

INK, QUIET = "#24262b", "#6b7079"
DASHES = ((1.0, 1.5), (7.0, 2.0), (7.0, 2.0, 1.0, 2.0))
"""Of the lines of further results in one plot."""


def draw(document: Document, kind: str, ax: Any, shot: int, others: Sequence[Document] = ()) -> Any:
    """Draw one kind of plot of a result, on new axes if none are given; with "curves", those of others in dashes.

    Raises:
        InvalidArgument: a refused result, an unknown kind or shot, others in another kind of plot, an object that is
            not axes, or no matplotlib.
    """
    if kind not in KINDS:
        raise InvalidArgument(f"There is no plot {kind!r}.", f"Take one of {', '.join(KINDS)}.")
    if others and kind != "curves":
        raise InvalidArgument(f"The plot {kind!r} shows one result.", "Draw several results with the kind 'curves'.")
    for each in (document, *others):
        answer_in(each)
    count = len(shots_of(document))
    if isinstance(shot, bool) or not isinstance(shot, int) or not 1 <= shot <= count:
        raise InvalidArgument(f"There is no shot {shot!r}: this result has {count}.", f"Give 1 to {count}.")
    if ax is None:
        ax = _axes()
    elif not hasattr(ax, "plot") or not hasattr(ax, "set_xlabel"):
        raise InvalidArgument(
            f"A {type(ax).__name__} is not a matplotlib axes.", "Give one of plt.subplots(), or leave ax out."
        )
    KINDS[kind](document, ax, shot - 1)
    if others:
        _others(document, others, ax)
    return ax


def require_matplotlib() -> None:
    """Call before matplotlib's first import.

    Raises:
        InvalidArgument: it is not installed.
    """
    with suppress(ImportError):
        prepare_matplotlib()
    library("matplotlib", "This plot needs", "plot")


def curves_png(document: Document) -> bytes:
    """A PNG of the curves with their 95 % bands, and of the truth if the result holds it.

    Raises:
        InvalidArgument: no matplotlib.
    """
    require_matplotlib()
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        figure = Figure(figsize=(9.6, 5.4), dpi=150, facecolor="white", layout="constrained")
        axes = figure.subplots()
        draw_curves(axes, curves_of(document))
        # Names are untrusted input: "$" must not start a formula, and rare characters may have no glyph.
        title = "".join(c if c.isprintable() and ord(c) < 0x250 else "?" for c in _names(document))
        axes.set_title(title, color=INK, loc="left", parse_math=False)
        file = BytesIO()
        FigureCanvasAgg(figure).print_png(file, metadata={"Software": None})
    return file.getvalue()


def _axes() -> Any:
    require_matplotlib()
    import matplotlib.pyplot as plt

    return plt.subplots()[1]


def draw_curves(ax: Any, curves: DrawnCurves) -> None:
    """Draw the curves as the report does: 95 % bands, each peak's label above them, and the truth dashed."""
    drawn = curves.smooth()
    for c, (channel, hue) in enumerate(HUES.items()):
        if drawn.low is not None and drawn.high is not None:
            ax.fill_between(WAVELENGTHS, drawn.low[:, c], drawn.high[:, c], color=hue, alpha=0.16, linewidth=0)
        ax.plot(WAVELENGTHS, drawn.ssf[:, c], color=hue, label=channel)
        if drawn.truth is not None:
            ax.plot(WAVELENGTHS, drawn.truth[:, c], color=INK, dashes=(4, 3), linewidth=1.1)
    for (text, nm, top), hue in zip(curves.peak_labels(), HUES.values(), strict=True):
        ax.text(nm, top, text, ha="center", color=hue, fontsize=9)
    ax.set_xlim(380, 720)
    ax.set_ylim(*curves.limits())
    ax.set_xticks(range(400, 721, 40))
    ax.set_xlabel("wavelength, nm")
    ax.set_ylabel("relative response, peak = 1")
    ax.grid(color="#e4e4df", linewidth=0.8)
    ax.set_axisbelow(True)
    ax.axhline(0, color=QUIET, linewidth=0.8)
    ax.tick_params(colors=QUIET, length=0)
    ax.spines[:].set_visible(False)


def _curves(document: Document, ax: Any, shot: int) -> None:
    draw_curves(ax, curves_of(document))
    _title(ax, f"{_names(document)}: {'' if document.verdict is None else document.verdict.status}")


def _others(document: Document, others: Sequence[Document], ax: Any) -> None:
    """Draw the curves of other results in dashes, without their bands, and a legend of all."""
    from matplotlib.lines import Line2D

    named = [Line2D([], [], color=INK, label=_names(document))]
    for other, dashes in zip(others, cycle(DASHES), strict=False):
        for values, hue in zip(curves_of(other).smooth().ssf.T, HUES.values(), strict=True):
            ax.plot(WAVELENGTHS, values, color=hue, dashes=dashes, linewidth=1.3)
        named.append(Line2D([], [], color=INK, dashes=dashes, label=_names(other)))
    ax.set_title("")
    above = ax.legend(handles=named, frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    for text in above.get_texts():
        text.set_parse_math(False)


def _residuals(document: Document, ax: Any, shot: int) -> None:
    """Draw predicted / measured signal - 1 in %; predictions are from fits without the patch, if available."""
    lamp, patches = _shown(document, shot)
    guess = np.where(np.isnan(patches.unseen), patches.predicted, patches.unseen)
    signal = patches.level[:, None] * patches.signal  # under even light
    for c, (channel, hue) in enumerate(HUES.items()):
        rows = np.flatnonzero(patches.used & (signal[:, c] > 0))
        at, values = rows + 1 + 0.2 * (c - 1), 100.0 * (guess[rows, c] / signal[rows, c] - 1.0)
        ax.vlines(at, 0.0, values, color=hue, linewidth=1)
        ax.plot(at, values, "o", color=hue, markersize=4, label=channel)
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    ax.set_xlim(0.4, len(patches.names) + 0.6)
    ax.set_xlabel("patch")
    ax.set_ylabel("predicted over measured signal, less 1, %")
    _title(ax, f"{camera_of(document)}, {lamp}: unseen patches")
    ax.legend(frameon=False)


def _patches(document: Document, ax: Any, shot: int) -> None:
    """Draw each patch with the measured colour on the left and the predicted one on the right."""
    _, patches = _shown(document, shot)
    count = len(patches.names)
    across = 14 if count == 140 else 6
    down = -(-count // across)
    picture = np.full((down, 2 * across, 3), 0.5)
    for i in range(count):
        row, column = divmod(i, across)
        for half, colours in enumerate((patches.measured_srgb, patches.synthetic_srgb)):
            if colours is not None:
                picture[row, 2 * column + half] = colours[i]
    ax.imshow(picture, extent=(0, across, down, 0), interpolation="nearest")
    ax.set_xticks(range(across + 1), [])
    ax.set_yticks(range(down + 1), [])
    ax.grid(color="black", linewidth=2)
    ax.tick_params(length=0)
    _title(ax, "measured on the left, predicted on the right")


def _budget(document: Document, ax: Any, shot: int) -> None:
    """Draw each source's share in the curves' variance, one bar per channel."""
    answer = answer_in(document)
    uncertainty = answer.uncertainty
    if uncertainty is None:
        raise InvalidArgument(f"The {answer.basis} basis has no prior, so no budget.", "Take basis cameras.")
    left = np.zeros(3)
    for number, part in enumerate(uncertainty.budget):
        share = 100.0 * part.share
        ax.barh(CHANNELS, share, left=left, label=part.source, color=f"C{number}")
        left = left + share
    ax.invert_yaxis()
    ax.set_xlim(0, 100)
    ax.set_xlabel("share of the curves' variance, %")
    _title(ax, f"95 % band ± {uncertainty.half_width:.3f} of the peak on average, 400 to 700 nm")
    ax.legend(frameon=False, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.18))


def _shown(document: Document, shot: int) -> tuple[str, ShownPatches]:
    """Lamp and patches of a shot, from 0."""
    shown = shots_of(document)[shot]
    assert shown.patches is not None
    return shown.lamp.name, shown.patches


def _names(document: Document) -> str:
    return f"{camera_of(document)}, {lamps_of(document)}"


def _title(ax: Any, text: str) -> None:
    ax.set_title(text, parse_math=False)  # names come from files: "$" must not start a formula


KINDS: dict[str, Callable[[Document, Any, int], None]] = {
    "curves": _curves,
    "residuals": _residuals,
    "patches": _patches,
    "budget": _budget,
}
