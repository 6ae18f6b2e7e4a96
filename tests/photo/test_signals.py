from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from camssf.errors import FramesDiffer, Overexposed, Underexposed
from camssf.photo.find.pose import find_chart
from camssf.photo.patches import FrameMeans, PatchMeans, measure_patches
from camssf.photo.read.dng import CFA_ORDERS
from camssf.photo.signals import Signals, normalise
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import Scene
from tests.support.scenes import SIZE, mosaic, shoot, table

QUIET = Sensor(noise=False)
CLASSIC = table()
WHITE = CLASSIC.white


def measured(
    scene: Scene, sensor: Sensor = QUIET, white: bool = True, dark: bool = True
) -> tuple[Signals, np.ndarray]:
    """Signals of a simulated shot, its chart found in the photo, and the theory."""
    frames = shoot(replace(scene, size=SIZE), sensor)
    photo = mosaic(frames.chart, sensor)
    shot = measure_patches(
        photo,
        find_chart(photo, CLASSIC),
        white=mosaic(frames.white, sensor) if white else None,
        dark=mosaic(frames.dark, sensor) if dark else None,
    )
    return normalise([shot], CLASSIC), frames.signals


def means(mean: np.ndarray, error: float | np.ndarray = 1.0, **shares: np.ndarray) -> FrameMeans:
    zero = np.zeros((24, 3))
    full = np.broadcast_to(np.asarray(mean, dtype=float), (24, 3)).copy()
    return FrameMeans(
        full,
        np.broadcast_to(np.asarray(error, dtype=float), (24, 3)).copy(),
        np.full((24, 3), 100),
        shares.get("clipped", zero),
        zero,
        zero,
        np.zeros((24, 2)),
    )


RNG = np.random.default_rng(11)
CHART = 512 + RNG.uniform(400, 9000, (24, 3))
SHOT = PatchMeans(
    means(CHART, 12), means(np.array([9000, 12000, 8000.0]), 20), means(514.0, 3), np.full(3, 512.0), 16383.0
)


def test_theory_under_half_the_light_in_the_corners() -> None:
    scene = Scene(fill=0.85, vignetting=0.5)
    signals, truth = measured(scene)
    np.testing.assert_allclose(signals.values[0], truth, rtol=0.005)
    uncorrected, _ = measured(scene, white=False)
    assert np.abs(uncorrected.values[0] * truth[WHITE] / truth - 1).max() > 0.05  # the scene does test it


@pytest.mark.full
def test_every_cfa_and_every_quarter_turn_give_the_same() -> None:
    reference, _ = measured(Scene(fill=0.5))
    for cfa in CFA_ORDERS:
        signals, _ = measured(Scene(fill=0.5), replace(QUIET, cfa=cfa))
        np.testing.assert_allclose(signals.values, reference.values, rtol=1e-3)
    for rotation in (90, 180, 270):
        signals, _ = measured(Scene(fill=0.5, rotation=rotation))
        np.testing.assert_allclose(signals.values, reference.values, rtol=1e-3)


def test_noise_stays_within_the_standard_errors() -> None:
    signals, truth = measured(Scene(tilt=15, vignetting=0.3), Sensor())
    z = (signals.values[0] - truth) / signals.standard_error[0]
    assert np.std(z) == pytest.approx(1, abs=0.25)
    assert np.abs(z).max() < 4.5


@pytest.mark.full
@pytest.mark.parametrize("white", [True, False])
@pytest.mark.parametrize("dark", [True, False])
def test_propagated_errors_against_sampling(white: bool, dark: bool) -> None:
    """Draw the frames' means 4,000 times; their scatter is what the propagation says."""
    shot = replace(SHOT, white=SHOT.white if white else None, dark=SHOT.dark if dark else None)
    rng = np.random.default_rng(2)

    def drawn(frame: FrameMeans | None) -> FrameMeans | None:
        if frame is None:
            return None
        return replace(frame, mean=frame.mean + frame.standard_error * rng.standard_normal((24, 3)))

    many = [
        replace(shot, chart=drawn(shot.chart), white=drawn(shot.white), dark=drawn(shot.dark)) for _ in range(4000)
    ]
    scatter = normalise(many, CLASSIC).values.std(axis=0)
    claimed = normalise([shot], CLASSIC).standard_error[0]
    rows = np.arange(24) != WHITE if not white else np.arange(24) >= 0
    np.testing.assert_allclose(claimed[rows], scatter[rows], rtol=0.06)


def test_the_white_patch_is_taken_above_its_own_dark_signal() -> None:
    """Without a white frame, where the dark signal differs from patch to patch."""
    dark = 512.0 + 10.0 * np.arange(24.0)[:, None]
    signals = normalise([replace(SHOT, white=None, dark=means(dark, 3))], CLASSIC)
    light = CHART - dark
    np.testing.assert_allclose(signals.values[0], light / light[WHITE], rtol=1e-12)
    equation_5 = (signals.chart - signals.dark) / (signals.white - signals.dark)
    np.testing.assert_allclose(equation_5, signals.values, rtol=1e-12)


def test_the_dark_frames_error_hardly_counts_near_white() -> None:
    """∂y/∂D = (y - 1) / b: with an error of the dark frame alone."""
    shot = PatchMeans(means(CHART, 0.0), means(9000.0, 0.0), means(512.0, 7.0), np.full(3, 512.0), 16383.0)
    signals = normalise([shot], CLASSIC)
    light = CHART - 512.0
    expected = np.abs(light / 8488.0 - 1.0) * 7.0 / 8488.0
    np.testing.assert_allclose(signals.standard_error[0], expected, rtol=1e-9)


def test_clipped_white_patch_as_reference() -> None:
    clipped = np.zeros((24, 3))
    clipped[WHITE, 0] = 0.2
    with pytest.raises(Overexposed, match="white patch"):
        normalise([replace(SHOT, white=None, chart=replace(SHOT.chart, clipped=clipped))], CLASSIC)


@pytest.mark.parametrize("values", [(9000, 12000, 8000), (650, 650, 650), (9000, 12000, 500)])
def test_white_and_dark_swapped(values: tuple[float, float, float]) -> None:
    swapped = replace(SHOT, white=means(514.0, 3), dark=means(np.array(values, dtype=float), 20))
    with pytest.raises(
        FramesDiffer, match="Shot 2: the dark frame is brighter than the white frame: they seem to be swapped"
    ):
        normalise([SHOT, swapped], CLASSIC)


def test_two_dark_frames_are_not_called_swapped() -> None:
    """A dark frame that is brighter by less than the range's 0.5 %, or in one channel alone, is no white one."""
    for dark in (np.full(3, 580.0), np.array([9000.0, 500, 500])):
        with pytest.raises(Underexposed, match="is darker than dark"):
            normalise([replace(SHOT, white=means(514.0, 3), dark=means(dark, 3))], CLASSIC)
