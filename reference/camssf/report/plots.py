"""Draws result documents on matplotlib axes, for notebooks and papers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.fonts import prepare_matplotlib
from camssf.grid import CHANNELS, WAVELENGTHS
from camssf.report.notebook import HUES, camera_of, lamps_of, with_curves
from camssf.report.sections.curves import DrawnCurves, curves_of

Json: TypeAlias = dict[str, Any]

INK, QUIET = "#24262b", "#6b7079"


def draw(document: Json, kind: str, ax: Any, shot: int) -> Any:
    """Draw one kind of plot of a result, on new axes if none are given.

    Raises:
        InvalidArgument: a refused result, an unknown kind or shot, an object that is not axes, or no matplotlib.
    """
    if kind not in KINDS:
        raise InvalidArgument(f"There is no plot {kind!r}.", f"Take one of {', '.join(KINDS)}.")
    with_curves(document)
    count = len(document["shots"])
    if isinstance(shot, bool) or not isinstance(shot, int) or not 1 <= shot <= count:
        raise InvalidArgument(f"There is no shot {shot!r}: this result has {count}.", f"Give 1 to {count}.")
    if ax is None:
        ax = _axes()
    elif not hasattr(ax, "plot") or not hasattr(ax, "set_xlabel"):
        raise InvalidArgument(
            f"A {type(ax).__name__} is not a matplotlib axes.", "Give one of plt.subplots(), or leave ax out."
        )
    KINDS[kind](document, ax, shot - 1)
    return ax


def require_matplotlib() -> None:
    """Call before matplotlib's first import.

    Raises:
        InvalidArgument: it is not installed.
    """
    try:
        prepare_matplotlib()
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise InvalidArgument(
            "Plots need matplotlib, which is not installed.", "Run pip install matplotlib."
        ) from error


def _axes() -> Any:
    require_matplotlib()
    import matplotlib.pyplot as plt

    return plt.subplots()[1]


def draw_curves(ax: Any, curves: DrawnCurves) -> None:
    """Draw the curves as the report does: 95 % bands, each peak's label above them, and the truth dashed."""
    drawn = curves.smooth()
    for c, (channel, hue) in enumerate(zip(CHANNELS, HUES, strict=True)):
        if drawn.low is not None and drawn.high is not None:
            ax.fill_between(WAVELENGTHS, drawn.low[:, c], drawn.high[:, c], color=hue, alpha=0.16, linewidth=0)
        ax.plot(WAVELENGTHS, drawn.ssf[:, c], color=hue, label=channel)
        if drawn.truth is not None:
            ax.plot(WAVELENGTHS, drawn.truth[:, c], color=INK, dashes=(4, 3), linewidth=1.1)
    for (text, nm, top), hue in zip(curves.peak_labels(), HUES, strict=True):
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


def _curves(document: Json, ax: Any, shot: int) -> None:
    draw_curves(ax, curves_of(document))
    _title(ax, f"{camera_of(document)}, {lamps_of(document)}: {document['verdict']['status']}")


def _residuals(document: Json, ax: Any, shot: int) -> None:
    """Draw predicted / measured signal - 1 in %; predictions are from fits without the patch, if available."""
    patches = document["shots"][shot]["patches"]
    for c, (channel, hue) in enumerate(zip(CHANNELS, HUES, strict=True)):
        at, values = [], []
        for i, patch in enumerate(patches):
            guess = patch["unseen"] or patch["predicted"]
            signal = patch.get("level", 1.0) * patch["signal"][c]  # the signal under even light
            if patch["used"] and guess and signal > 0:
                at.append(i + 1 + 0.2 * (c - 1))
                values.append(100.0 * (guess[c] / signal - 1.0))
        ax.vlines(at, 0.0, values, color=hue, linewidth=1)
        ax.plot(at, values, "o", color=hue, markersize=4, label=channel)
    ax.axhline(0.0, color="0.5", linewidth=0.8)
    ax.set_xlim(0.4, len(patches) + 0.6)
    ax.set_xlabel("patch")
    ax.set_ylabel("predicted over measured signal, less 1, %")
    _title(ax, f"{camera_of(document)}, {document['shots'][shot]['lamp']['name']}: unseen patches")
    ax.legend(frameon=False)


def _patches(document: Json, ax: Any, shot: int) -> None:
    """Draw each patch with the measured colour on the left and the predicted one on the right."""
    patches = document["shots"][shot]["patches"]
    across = 14 if len(patches) == 140 else 6
    down = -(-len(patches) // across)
    picture = np.full((down, 2 * across, 3), 0.5)
    for i, patch in enumerate(patches):
        row, column = divmod(i, across)
        for half, name in enumerate(("measured_srgb", "synthetic_srgb")):
            if patch[name] is not None:
                picture[row, 2 * column + half] = patch[name]
    ax.imshow(picture, extent=(0, across, down, 0), interpolation="nearest")
    ax.set_xticks(range(across + 1), [])
    ax.set_yticks(range(down + 1), [])
    ax.grid(color="black", linewidth=2)
    ax.tick_params(length=0)
    _title(ax, "measured on the left, predicted on the right")


def _budget(document: Json, ax: Any, shot: int) -> None:
    """Draw each source's share in the curves' variance, one bar per channel."""
    uncertainty = document.get("uncertainty")
    if uncertainty is None:
        raise InvalidArgument(f"The {document['basis']} basis has no prior, so no budget.", "Take basis cameras.")
    left = np.zeros(3)
    for number, part in enumerate(uncertainty["budget"]):
        share = 100.0 * np.array(part["share"])
        ax.barh(CHANNELS, share, left=left, label=part["source"], color=f"C{number}")
        left = left + share
    ax.invert_yaxis()
    ax.set_xlim(0, 100)
    ax.set_xlabel("share of the curves' variance, %")
    _title(ax, f"95 % band ± {uncertainty['half_width']:.3f} of the peak on average, 400 to 700 nm")
    ax.legend(frameon=False, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.18))


def _title(ax: Any, text: str) -> None:
    ax.set_title(text, parse_math=False)  # names come from files: "$" must not start a formula


KINDS: dict[str, Callable[[Json, Any, int], None]] = {
    "curves": _curves,
    "residuals": _residuals,
    "patches": _patches,
    "budget": _budget,
}
