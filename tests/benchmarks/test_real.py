"""Real data as a judge: a Nikon D70 whose chart and whose curves others measured; the page is the benchmark's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.claim import Run
from benchmarks.claims import real, whole_chart
from benchmarks.claims.real import d70
from camssf.grid import WAVELENGTHS

DOCS = Path(__file__).parents[2] / "docs"
APART = 0.036
"""RMSE of the two passes of the monochromator from each other."""


def test_the_capture_is_read_as_it_stands() -> None:
    capture = d70()
    assert capture.raw.shape == (24, 3)
    assert capture.raw[0] == pytest.approx(np.array([2550.41, 963.638, 303.498]) / 0.0125)
    assert capture.raw.sum(axis=1).argmax() == capture.white
    assert capture.signals[capture.white] == pytest.approx(np.ones(3))
    assert (capture.signals[capture.used][:, 1] < 1).all()
    assert capture.radiance[0, WAVELENGTHS == 440] == pytest.approx([2.3592e-05])
    assert WAVELENGTHS[capture.at] == pytest.approx(np.arange(400, 710, 10))


def test_the_passes_are_read_apart_and_differ() -> None:
    truth = d70().truth
    at = d70().at
    assert all(curves[at].max(axis=0) == pytest.approx(np.ones(3)) for curves in truth.values())
    assert truth["2010"][at[1], 2] == pytest.approx(0.218155 / 0.568163)
    assert truth["2011"][at[1], 2] == pytest.approx(0.0957149 / 0.547828)
    assert real.judged(truth["2010"])["2011"]["rmse"] == pytest.approx(APART, abs=5e-4)
    assert real.judged(truth["2011"])["2011"]["rmse"] == 0


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    """What the benchmark finds now, with its bars."""
    run = Run.of("real", real, [])
    run.kept = real.measure()
    real.check(run, run.kept)
    return run.kept | {"bars": run.bars}


@pytest.mark.requirement("R-REAL")
def test_the_bars_hold(found: dict[str, Any]) -> None:
    """Error, bands and fit without a Nikon in the basis; less error than the mean camera's and the paper's basis."""
    assert [bar["bar"] for bar in found["bars"] if not bar["met"]] == []
    passes = real.row_of(found["rows"], real.CLAIM)["passes"].values()
    assert min(each["rmse"] for each in passes) > APART
    assert real.row_of(found["rows"], real.CLAIM)["band"] < 0.16  # one that holds because it is wide is worth nothing


@pytest.mark.requirement("R-REAL")
def test_the_page_s_numbers_are_what_is_measured_now(found: dict[str, Any]) -> None:
    """Half of the last digit printed, and a little for other processors."""
    kept, text = json.loads((DOCS / "real.json").read_text("utf-8")), (DOCS / "real.md").read_text("utf-8")
    for then, now in zip(kept["rows"], found["rows"], strict=True):
        row = tuple(now[key] for key in ("basis", "chart", "tolerance", "light"))
        assert row == tuple(then[key] for key in ("basis", "chart", "tolerance", "light"))
        assert (now["z"] or 0.0) == pytest.approx(then["z"] or 0.0, rel=0.01), row
        for each in real.PASSES:
            old, new = then["passes"][each], now["passes"][each]
            assert new["rmse"] == pytest.approx(old["rmse"], abs=5e-4), row
            assert (new["coverage"] or 0.0) == pytest.approx(old["coverage"] or 0.0, abs=0.012), row
    for basis in (real.CLAIM, real.AUTO, real.PAPER):
        assert ", ".join(real.scores_of(real.row_of(kept["rows"], basis)["passes"])) in text, basis


@pytest.mark.requirement("R-REAL")
def test_the_shares_of_the_whole_chart_s_photo_are_those_of_the_page() -> None:
    found, text = whole_chart.measure(), (DOCS / "real.md").read_text("utf-8")
    recovered, mean = found["errors"][whole_chart.REST].values()
    assert recovered <= min(whole_chart.MOST, whole_chart.LARGEST_RATIO * mean)
    assert found["status"] == "doubtful"
    assert ", ".join(f"`{code}`" for code in found["reasons"]) in text
    for which, errors in found["errors"].items():
        (line,) = [line for line in text.splitlines() if line.startswith(f"| error, {which} |")]
        shown = [float(cell) for cell in line.strip("| ").split("|")[2:]]
        assert list(errors.values()) == pytest.approx(shown, abs=1.5e-3)
    for i, nm in enumerate(found["bands"]):
        (line,) = [line for line in text.splitlines() if line.startswith(f"| {nm:.0f} | ")]
        shown = [[float(value) for value in cell.split()] for cell in line.strip("| ").split("|")[1:]]
        assert np.abs(np.array([side[i] for side in found["shares"].values()]) - shown).max() < 0.012


def test_a_share_is_of_the_light_of_its_band_alone() -> None:
    bands, power = np.array([450.0, 600.0]), np.where(np.abs(WAVELENGTHS - 450.0) < 5.0, 1.0, 0.01)
    curves = np.stack([WAVELENGTHS > 500.0, WAVELENGTHS < 500.0, -np.ones(681)], axis=1).astype(float)
    assert whole_chart.shares_of(curves, power, bands) == pytest.approx(np.array([[0, 1, 0], [1, 0, 0]]))
