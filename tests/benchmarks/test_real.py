"""Real data as a judge: a Nikon D70 whose chart and whose curves others measured; the page is the benchmark's."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.claims import real, whole_chart
from benchmarks.claims.real import AUTO, CLAIM, LEFT_OUT, MEASURED, PAPER, PASSES, PHONES, PUBLISHED, SHIPPED, d70
from camssf.grid import WAVELENGTHS

DOCS = Path(__file__).parents[2] / "docs"
APART = 0.036
"""RMSE of the two passes of the monochromator from each other."""


@cache
def row(basis: str, name: str = MEASURED, tolerance: float = 0.08) -> dict[str, Any]:
    return real.attempt(basis, name, tolerance)


def worst(found: dict[str, Any]) -> tuple[float, float]:
    """The larger error, and the smaller coverage, of both passes."""
    passes = found["passes"].values()
    return max(each["rmse"] for each in passes), min(each["coverage"] for each in passes)


# what is read


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


def test_the_lamp_is_the_white_patch_s_radiance_over_its_reflectance() -> None:
    """Tungsten: it rises to the red, without lines; and white under it is what the radiometer saw."""
    light, capture = real.light(), d70()
    white = real.chart(PUBLISHED).values[capture.white]
    assert light * white == pytest.approx(capture.radiance[capture.white])
    steps = light[(WAVELENGTHS >= 400) & (WAVELENGTHS <= 600)][::20]
    assert (np.diff(steps) > 0).all()
    assert (real.chart(MEASURED).values[capture.white] == white).all()


# what is said of the camera


@pytest.mark.requirement("R-REAL")
@pytest.mark.parametrize("basis", [CLAIM, LEFT_OUT])
def test_curves_without_a_nikon_in_the_basis(basis: str) -> None:
    """Measured: .060 and .056, all of the values in the band. Captures simulated like it have .052 to .072 and 95 to
    99 % (5th and 95th percentile): the bound of the error lies inside what luck alone may do. A basis or a penalty
    that moves the error by a sixth is seen."""
    rmse, coverage = worst(row(basis))
    assert APART < rmse < 0.07
    assert coverage > 0.93
    assert row(basis)["band"] < 0.16  # a band that holds because it is wide is worth nothing; measured: .14


@pytest.mark.parametrize(("basis", "most"), [(CLAIM, 0.06), (AUTO, 0.053)])
def test_the_light_of_each_patch_solved_for(basis: str, most: float) -> None:
    """Measured: .056 and .053 without a Nikon, .048 and .049 as shipped, less than with 8 % on the chart; and the
    published table, of little use with 3 % on the chart (.19), comes to .070."""
    free = real.attempt(basis, MEASURED, 0.03, light_per_patch=real.SCATTERED)
    rmse, coverage = worst(free)
    assert APART < rmse < most
    assert rmse < worst(row(basis))[0]
    assert coverage > 0.88
    published = real.attempt(basis, PUBLISHED, 0.03, light_per_patch=real.SCATTERED)
    assert worst(published)[0] < 0.5 * worst(row(basis, PUBLISHED, 0.03))[0]
    assert published["z"] < 3.5 < row(basis, PUBLISHED, 0.03)["z"]


def test_the_photos_say_more_than_the_mean_camera() -> None:
    """Measured: .73 and .64 of the error of the guess without a photo."""
    mean = real.references()[real.MEAN]
    assert real.over(row(CLAIM)["passes"], mean) < 0.85


def test_the_paper_s_basis_is_twice_as_far_off() -> None:
    """Measured: the claim has .50 and .45 of its error. It is told the scatter as noise, the only error it knows;
    told 1 % it is worse."""
    paper = row(PAPER)["passes"]
    assert real.over(row(CLAIM)["passes"], paper) < 0.7
    assert paper["2011"]["coverage"] is None
    assert row(PAPER, tolerance=0.0)["passes"]["2011"]["rmse"] > paper["2011"]["rmse"]


def test_too_small_a_tolerance_is_seen_without_the_truth() -> None:
    """The light scatters by 8 %; told 3 %, the verdict's surprise (doubtful above 3.5) is 8, and the answer worse.
    The evidence does not tell: each patch has its scale. Published, 3 %: 20, and worse than no photo."""
    stated, meant = row(LEFT_OUT, tolerance=0.03), row(LEFT_OUT)
    assert meant["z"] < 3.5 < 6.0 < stated["z"]
    published = row(CLAIM, PUBLISHED, 0.03)
    assert published["z"] > 12
    assert worst(published)[0] > real.references()[real.MEAN]["2011"]["rmse"]


# the page


@pytest.mark.repository
def test_the_page_s_headline_is_the_benchmark_s() -> None:
    found = json.loads((DOCS / "real.json").read_text("utf-8"))
    text = (DOCS / "real.md").read_text("utf-8")
    assert all(bar["met"] for bar in found["bars"])
    for basis in (CLAIM, AUTO, PAPER):
        assert ", ".join(real.scores_of(real.row_of(found["rows"], basis)["passes"])) in text, basis


@pytest.mark.requirement("R-REAL")
def test_the_page_s_numbers_are_what_is_measured_now() -> None:
    """Half of the last digit printed, and a little for other processors."""
    rows = json.loads((DOCS / "real.json").read_text("utf-8"))["rows"]
    for basis in (CLAIM, LEFT_OUT, AUTO, SHIPPED, PHONES, PAPER):
        then, now = real.row_of(rows, basis), row(basis)
        for each in PASSES:
            assert now["passes"][each]["rmse"] == pytest.approx(then["passes"][each]["rmse"], abs=5e-4), basis
            if then["passes"][each]["coverage"] is not None:
                assert now["passes"][each]["coverage"] == pytest.approx(then["passes"][each]["coverage"], abs=0.012)


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
