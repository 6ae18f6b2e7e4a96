"""How right are the channels against each other on a real photo?

data/llanos is a ColorChecker under seven bands of a projector, 10 nm wide, in one mosaic, with the chart's measured
reflectances and the measured shares of red, green and blue in each band on grey patches. The relative power of the
bands is not known: the lamp is assumed. So the shape of the curves is not judged, only R : G : B within a band, and
that depends on the lamp through the scale between the channels, which is the raw white's.

A share is that of a channel's signal, over the light of a band, in the sum of the three. Beside the recovered curves
stands the mean of `cameras`, on the scale that the same raw white gives it: no photo of the chart. Error: root mean
square over channels and bands, all and without that at 400 nm.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.claim import Run
from camssf.calibration import calibrate
from camssf.documents.scale import channel_scale
from camssf.documents.stored_lamp import lamp_of
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import read_basis
from camssf.result import Result

LLANOS = Path(__file__).parents[2] / "data" / "llanos"
HALF_BAND = 20.0
"""nm; no light of a neighbouring band is nearer to a band's middle."""
ALL, REST = "all bands", "without 400 nm"
MOST, LARGEST_RATIO = 0.05, 0.9
"""Bars, without 400 nm: the error, and its ratio to the mean camera's."""


def measured_shares() -> tuple[Floats, Floats]:
    """(7,) middles of the bands, nm, and (7, 3) the measured shares."""
    with (LLANOS / "shares_measured.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    shares = [[float(row[channel]) for channel in ("red", "green", "blue")] for row in rows]
    return np.array([float(row["band_nm"]) for row in rows]), np.array(shares)


def solved() -> Result:
    """The photo's result, with the measured chart and the assumed lamp."""
    lamp, chart = LLANOS / "lamp_assumed.csv", LLANOS / "chart_measured.csv"
    return calibrate(LLANOS / "capture.png", str(lamp), chart=f"classic24:{chart}")


def shares_of(curves: Floats, power: Floats, bands: Floats) -> Floats:
    """(7, 3) shares of curves (681, 3) of one scale under a lamp (681,); negative responses count as 0."""
    inside = np.abs(WAVELENGTHS - bands[:, None]) < HALF_BAND
    signals = np.maximum((inside * power) @ curves, 0.0)
    return np.asarray(signals / signals.sum(axis=1, keepdims=True))


def without_photo(result: Result, power: Floats) -> Floats:
    """The mean of `cameras` (681, 3), on the scale that gives the photo's raw white."""
    assert result.answer is not None
    assert result.capture is not None
    mean, chart = read_basis("cameras").mean.T, result.capture.chart
    return np.asarray(mean * result.answer.channel_gain / ((power * chart.values[chart.white]) @ mean))


def measure() -> dict[str, Any]:
    """Verdict, shares and errors."""
    result, (bands, true) = solved(), measured_shares()
    lamp = lamp_of(result, 0)
    assert lamp is not None
    shares = {
        "recovered": shares_of(result.curves * channel_scale(result), lamp.values, bands),
        "mean camera": shares_of(without_photo(result, lamp.values), lamp.values, bands),
    }
    counted = {ALL: bands > 0.0, REST: bands > 420.0}
    errors = {
        which: {name: float(np.sqrt(np.mean((each - true)[some] ** 2))) for name, each in shares.items()}
        for which, some in counted.items()
    }
    return {
        "status": result.verdict.status,
        "reasons": list(dict.fromkeys(reason.code for reason in result.verdict.reasons)),
        "bands": bands.tolist(),
        "shares": {name: each.tolist() for name, each in {"measured": true, **shares}.items()},
        "errors": errors,
    }


def claim(run: Run) -> None:
    """Shares by band, and their errors."""
    found = measure()
    sides, errors = found["shares"], found["errors"]
    rows = [
        (f"{nm:.0f}", *(" ".join(f"{share:.2f}" for share in side[i]) for side in sides.values()))
        for i, nm in enumerate(found["bands"])
    ]
    rows += [(f"error, {which}", "", *(f"{value:.3f}" for value in own.values())) for which, own in errors.items()]
    run.table("shares of red, green, blue", {"nm": ""} | dict.fromkeys(sides, ""), rows)
    run.say(f"verdict: {found['status']} ({', '.join(found['reasons'])})")
    recovered, mean = errors[REST].values()
    run.bar(f"error, {REST}", recovered, most=MOST)
    run.bar("the same over the mean camera's", recovered / mean, most=LARGEST_RATIO)
    run.bar("doubtful, as it should be", found["status"] == "doubtful", least=1)
    run.kept = found
