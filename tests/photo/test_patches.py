from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camssf.errors import FramesDiffer
from camssf.photo.find.pose import Pose
from camssf.photo.patches import measure_patches
from camssf.photo.read.dng import CFA_ORDERS
from camssf.photo.samples import SHRINK, samples_in
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import Scene
from tests.support.scenes import SIZE, mosaic, shoot

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def pose_of(*quads: np.ndarray) -> Pose:
    return Pose("classic24", np.zeros((4, 2)), np.array(quads, dtype=float), 0, "by hand", 1.0, ())


def flat(level: float = 4000, noise: float = 0, seed: int = 0, size: int = 120) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.rint(level + noise * rng.standard_normal((size, size))).astype(np.uint16)


# The measured part of this patch are the samples with 30 <= x, y <= 70: 41 a side, 21 of them even.
PATCH = pose_of(10 + 80 * SQUARE)


def test_counts_and_means_of_a_square() -> None:
    """RGGB: red has even rows and columns; closed form of the sums."""
    y, x = np.mgrid[0:120, 0:120]
    got = measure_patches(mosaic((1000 + 3 * x + 5 * y).astype(np.uint16)), PATCH).chart
    assert got.count.tolist() == [[21 * 21, 2 * 21 * 20, 20 * 20]]
    np.testing.assert_allclose(got.mean, [[1000 + 8 * 50] * 3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(got.greens, [[1400, 1400]], rtol=0, atol=1e-9)
    # a plane without noise: nothing is rejected, and only the rounding to whole DN is left
    assert got.dead.tolist() == got.clipped.tolist() == [[0, 0, 0]]
    np.testing.assert_allclose(got.standard_error[0, [0, 2]], np.sqrt([1 / 12 / 441, 1 / 12 / 400]), rtol=1e-6)
    np.testing.assert_allclose(got.gradient[0, 0], 40 * 8 / (1400 - 512), rtol=1e-9)


@pytest.mark.parametrize("cfa", CFA_ORDERS)
def test_colours_of_every_cfa(cfa: str) -> None:
    samples = np.empty((120, 120), np.uint16)
    levels = {"R": 1000, "G": 2000, "B": 3000}
    for i, letter in enumerate(cfa):
        samples[i // 2 :: 2, i % 2 :: 2] = levels[letter]
    samples[cfa.index("R") // 2 :: 2] += (samples[cfa.index("R") // 2 :: 2] == 2000).astype(np.uint16) * 8
    got = measure_patches(mosaic(samples, Sensor(cfa=cfa)), PATCH).chart
    assert got.mean.tolist() == [[1000, 2004, 3000]]
    assert got.greens.tolist() == [[2008, 2000]]  # red's rows, blue's rows


def test_a_turned_quad_selects_what_lies_inside() -> None:
    """A diamond: |x - 60| + |y - 60| <= 20 after shrinking; counted by the definition."""
    diamond = 60 + 40 * np.array([[0, -1], [1, 0], [0, 1], [-1, 0]])
    inside = sum(abs(x - 60) + abs(y - 60) <= 20 for x in range(0, 120, 2) for y in range(0, 120, 2))
    assert measure_patches(mosaic(flat()), pose_of(diamond)).chart.count[0, 0] == inside


@pytest.mark.full
@settings(deadline=None)  # the machine's load is no fault
@given(st.integers(0, 2**32 - 1))
def test_mean_and_error_against_exact_fractions(seed: int) -> None:
    """The sums of rule 5, once more in exact rational arithmetic."""
    samples = flat(3000, 60, seed)
    got = measure_patches(mosaic(samples), PATCH).chart
    box = [(x, y, int(samples[y, x])) for y in range(30, 71, 2) for x in range(30, 71, 2)]
    middle = np.median([v for *_, v in box])
    mad = np.median([abs(v - middle) for *_, v in box])
    kept = [(x // 2, y // 2, v) for x, y, v in box if abs(v - middle) <= 6 * mad + 2]
    n = len(kept)
    assert got.count[0, 0] == n
    mean = [Fraction(sum(row[i] for row in kept), n) for i in range(3)]
    assert got.mean[0, 0] == float(mean[2])

    def product(i: int, j: int) -> Fraction:
        return sum(((row[i] - mean[i]) * (row[j] - mean[j]) for row in kept), Fraction(0))

    xx, xy, yy, xv, yv, vv = (product(*p) for p in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2)))
    determinant = xx * yy - xy * xy
    rest = vv - ((yy * xv - xy * yv) * xv + (xx * yv - xy * xv) * yv) / determinant
    error = float(rest / (n - 3) + Fraction(1, 12)) / n
    assert got.standard_error[0, 0] == pytest.approx(error**0.5, rel=1e-12)


def test_corners_are_rounded_to_a_sixteenth_of_a_pixel() -> None:
    """A border 0.02 px before a column still holds it, one 0.04 px before does not."""
    for short, last in ((0.02, 30), (0.04, 28)):
        ends = np.array([[10.0, 10.0], [30.0 - short, 10.0], [30.0 - short, 30.0 - short], [10.0, 30.0 - short]])
        centre = ends.mean(axis=0)
        rows, columns = samples_in(centre + (ends - centre) / SHRINK, (0, 0), (60, 60), 1)
        assert (columns.min(), columns.max(), rows.max()) == (10, last, last)


def test_steep_gradient_rejects_nothing_and_is_not_noise() -> None:
    """30 % across the measured part, noise 20 DN: the standard error is the noise's."""
    y, x = np.mgrid[0:120, 0:120]
    samples = np.rint(3000 + 20 * x + 15 * y + 20 * np.random.default_rng(4).standard_normal((120, 120)))
    got = measure_patches(mosaic(samples.astype(np.uint16)), PATCH).chart
    assert got.dead.max() < 0.002
    np.testing.assert_allclose(got.standard_error[0], 20 / np.sqrt([441, 840, 400]), rtol=0.1)
    assert got.gradient[0, 1] == pytest.approx(40 * 35 / (3000 + 35 * 50 - 512), rel=0.03)


def test_standard_errors_are_those_of_the_photon_noise() -> None:
    """z = (mean - truth) / se over 24 patches, three colours and three frames is standard normal."""
    frames = shoot(Scene(size=SIZE, fill=0.5, tilt=20))
    sensor = Sensor()
    got = measure_patches(mosaic(frames.chart), frames.pose, white=mosaic(frames.white), dark=mosaic(frames.dark))
    assert got.white is not None
    assert got.dark is not None
    truths = (frames.levels, frames.white_levels, np.full(3, sensor.black))
    z = [(f.mean - t) / f.standard_error for f, t in zip((got.chart, got.white, got.dark), truths, strict=True)]
    assert np.std(z) == pytest.approx(1, abs=0.2)
    assert np.abs(z).max() < 4.5


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"samples": flat(size=122)}, "size"),
        ({"cfa": "BGGR"}, "CFA"),
        ({"model": "Other"}, "camera model"),
        ({"white": 4095.0}, "white level"),
        ({"black": np.full((2, 2), 800.0)}, "black level"),
        ({"exposure": 0.02}, "exposure 0.02 s against 0.01 s"),
        ({"iso": 400.0}, "iso 400 against 100"),
    ],
)
@pytest.mark.parametrize("frame", ["white", "dark"])
def test_frames_that_differ(change: dict[str, object], word: str, frame: str) -> None:
    photo = mosaic(flat(), model="This")
    with pytest.raises(FramesDiffer, match=word) as refusal:
        measure_patches(photo, PATCH, **{frame: replace(photo, path="w.dng", **change)})  # type: ignore[arg-type]
    assert frame in refusal.value.message
    assert "w.dng" in refusal.value.message
    assert "manual" in refusal.value.advice


@pytest.mark.parametrize("change", [{"exposure": None}, {"iso": None}, {"model": ""}, {"exposure": 0.010049}])
def test_frames_that_are_alike_as_far_as_the_files_say(change: dict[str, object]) -> None:
    photo = mosaic(flat(), model="This")
    assert measure_patches(photo, PATCH, white=replace(photo, **change)).white is not None  # type: ignore[arg-type]
