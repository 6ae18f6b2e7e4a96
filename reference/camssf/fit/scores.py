"""Scores a fit: predicted against measured signals, and curves against a truth where there is one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.colorimetry import D65, delta_e00, lab, srgb, under_d65, white_of, xyz_of
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.signals import Signals
from camssf.rules import rules
from camssf.shapes import RgbSizes, Size, Text
from camssf.spectra import CameraCurves, ChartTable, Lamp, read_lamp
from camssf.spectra.bundled import observer

FAINTEST = rules().number("calibration.faintest")
"""Smallest signal, as a share of the white, that a sensor measures well enough for a relative error."""


@dataclass(frozen=True)
class Scores:
    """How well the curves predict patches that the fit did not use ("unseen"). Columns are R, G, B.

    Attributes:
        rmsre_percent: (3,) the paper's Eq. (13) over unseen patches, %.
        unseen: how the unseen patches were chosen, in words for the report.
        rmse: (3,) of peak-normalised curves against the truth, 400 to 700 nm; None without a truth.
        delta_e00: mean CIEDE2000 between measured and synthetic patch colours (unseen patches).
    """

    rmsre_percent: RgbSizes
    unseen: Text
    rmse: RgbSizes | None
    delta_e00: Size


def validate(
    signals: Signals,
    predicted: Floats,
    table: ChartTable,
    lamps: Sequence[Lamp],
    ssf_values: Floats | None = None,
    truth: CameraCurves | None = None,
    unseen: ArrayLike | None = None,
    method: str = "",
) -> Scores:
    """Score predictions for patches that the fit did not use.

    RMSRE is the paper's Eq. (13), √mean(((ŷ - y) / y)²) of each channel. A signal not above `FAINTEST` has
    no relative error and is left out of it; its colour still counts.

    Colours are those of `patch_colours`: CIEDE2000 is the visible difference between the two photos, not the error of
    the camera's colours.

    Neither score detects a wrong lamp, which affects both sides; only a truth does.

    Args:
        signals: k shots of n patches.
        predicted: (k, n, 3), finite; where `unseen` is True, of a fit that did not use the patch.
        table: of the chart, n patches.
        lamps: k.
        ssf_values: (681, 3), any scale; needed with `truth`.
        truth: measured curves of the camera.
        unseen: (k, n) the entries that count; None for all that `signals.used` marks.
        method: how they were chosen, in words.

    Raises:
        InvalidArgument: shapes that do not fit together, predictions that are not finite, no unseen patch, or a
            curve without a positive peak.
    """
    y, n = signals.values, len(table.patches)
    counts = signals.used if unseen is None else np.asarray(unseen, dtype=np.bool_)
    predicted = np.asarray(predicted, dtype=np.float64)
    if y.shape != (len(lamps), n, 3) or predicted.shape != y.shape or counts.shape != y.shape[:2]:
        raise InvalidArgument(
            f"Signals {y.shape}, predictions {predicted.shape}, unseen {counts.shape}, {len(lamps)} lamps and "
            f"{n} patches do not fit together.",
            "Give (k, n, 3), (k, n, 3), (k, n), k lamps and a table of n patches.",
        )
    if not np.isfinite(y).all() or not np.isfinite(predicted).all():
        raise InvalidArgument(
            "A signal or a prediction is not a number.", "Fill what was not fitted with `Ssf.predicted`."
        )
    if truth is not None and ssf_values is None:
        raise InvalidArgument("The reference curves are empty.", "Give ssf_values, too.")
    measured, synthetic = patch_colours(y, predicted, signals.used, table, np.stack([lamp.values for lamp in lamps]))
    return Scores(
        rmsre_percent=rmsre(y, predicted, counts),
        unseen=method,
        rmse=None if truth is None or ssf_values is None else rmse(ssf_values, truth.values),
        delta_e00=float(delta_e00(measured.lab[counts], synthetic.lab[counts]).mean()),
    )


def rmsre(measured: Floats, predicted: Floats, counts: NDArray[np.bool_]) -> Floats:
    """The paper's Eq. (13) in %, (3,), over the entries (k, n) that count and lie above `FAINTEST`.

    Raises:
        InvalidArgument: a channel has no such entry.
    """
    valid = counts[:, :, None] & (measured > FAINTEST)
    total = valid.sum(axis=(0, 1))
    if not total.all():
        raise InvalidArgument(
            "No patch is left for validation.", "Leave patches out of the fit, or use a brighter photo."
        )
    error = np.where(valid, predicted / np.where(valid, measured, 1.0) - 1.0, 0.0)
    result: Floats = 100.0 * np.sqrt((error**2).sum(axis=(0, 1)) / total)
    return result


def rmse(curves: Floats, truth: Floats) -> Floats:
    """Root of the mean square difference of curves (681, 3), each divided by its peak, 400 to 700 nm; (3,).

    Raises:
        InvalidArgument: another shape, or a curve that is not finite or has no positive peak.
    """
    pair = []
    for table in (curves, truth):
        values = np.asarray(table, dtype=np.float64)
        if values.shape != (WAVELENGTHS.size, 3) or not np.isfinite(values).all() or (values.max(axis=0) <= 0).any():
            raise InvalidArgument(
                f"Curves of shape {values.shape} cannot be compared.",
                "Give (681, 3) finite values; each channel needs a positive peak.",
            )
        pair.append(values / values.max(axis=0))
    visible = (WAVELENGTHS >= 400.0) & (WAVELENGTHS <= 700.0)
    result: Floats = np.sqrt(np.mean((pair[0] - pair[1])[visible] ** 2, axis=0))
    return result


def reflectance_srgb(table: ChartTable) -> Floats:
    """Display colours 0 to 1 of the table's patches under D65, (n, 3)."""
    light = read_lamp("D65").values
    return _display(xyz_of(table.values, light, observer("1931")), white_of(light))[1]


@dataclass(frozen=True)
class PatchColours:
    """Colours of patches seen under D65.

    Attributes:
        lab: (k, n, 3) CIE L*a*b*.
        srgb: (k, n, 3) display colours, 0 to 1.
    """

    lab: Floats
    srgb: Floats


def patch_colours(
    measured: Floats, predicted: Floats, used: NDArray[np.bool_], table: ChartTable, lamps: Floats
) -> tuple[PatchColours, PatchColours]:
    """Colours of the measured and of the synthetic patches, as in the paper's Fig. 6.

    For each shot a 3 × 3 matrix, fitted by least squares from the measured signals of its used patches to the XYZ of
    the table under its lamp (CIE 1931, 2°), converts both measured and predicted signals to XYZ; von Kries with CAT02
    adapts the lamp's white to D65. Both colours share the matrix's error.

    Args:
        measured, predicted: (k, n, 3) signals in even light.
        used: (k, n) the patches that the fit used.
        table: of the chart.
        lamps: (k, 681).
    """
    shots = []
    for y, guess, chosen, lamp in zip(measured, predicted, used, lamps, strict=True):
        target = xyz_of(table.values, lamp, observer("1931"))
        fit = chosen if chosen.sum() >= 3 else np.ones_like(chosen)
        matrix = np.linalg.lstsq(y[fit], target[fit], rcond=None)[0]
        white = white_of(lamp)
        shots.append((*_display(y @ matrix, white), *_display(guess @ matrix, white)))
    lab, srgb, synthetic_lab, synthetic_srgb = (np.stack(rows) for rows in zip(*shots, strict=True))
    return PatchColours(lab, srgb), PatchColours(synthetic_lab, synthetic_srgb)


def _display(xyz: Floats, white: Floats) -> tuple[Floats, Floats]:
    """Lab and sRGB, clipped to 0 to 1, of XYZ (n, 3) seen under a white (3,) and adapted to D65."""
    with np.errstate(all="ignore"):  # under a single-line lamp a cone's response to white can be 0
        adapted = under_d65(xyz, white)
    adapted = np.nan_to_num(adapted, posinf=0.0, neginf=0.0)
    return lab(adapted, D65), np.clip(srgb(np.maximum(adapted, 0.0)), 0.0, 1.0)
