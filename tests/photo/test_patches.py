from dataclasses import replace

import numpy as np
import pytest

from camssf.errors import FramesDiffer
from camssf.photo.find.pose import Pose
from camssf.photo.patches import measure_patches
from camssf.photo.read.dng import CFA_ORDERS
from camssf_lab.simulation.camera import Sensor
from tests.support.scenes import mosaic

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
def test_frames_that_differ(change: dict[str, object], word: str) -> None:
    photo = mosaic(flat(), model="This")
    with pytest.raises(FramesDiffer, match=word) as refusal:
        measure_patches(photo, PATCH, white=replace(photo, path="w.dng", **change))  # type: ignore[arg-type]
    assert "white" in refusal.value.message
    assert "w.dng" in refusal.value.message
    assert "manual" in refusal.value.advice


@pytest.mark.parametrize("change", [{"exposure": None}, {"iso": None}, {"model": ""}, {"exposure": 0.010049}])
def test_frames_that_are_alike_as_far_as_the_files_say(change: dict[str, object]) -> None:
    photo = mosaic(flat(), model="This")
    assert measure_patches(photo, PATCH, white=replace(photo, **change)).white is not None  # type: ignore[arg-type]
