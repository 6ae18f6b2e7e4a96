from dataclasses import replace

import numpy as np
import pytest

from camssf.errors import FramesDiffer, Overexposed
from camssf.photo.find.pose import find_chart
from camssf.photo.patches import FrameMeans, PatchMeans, measure_patches
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


def test_noise_stays_within_the_standard_errors() -> None:
    signals, truth = measured(Scene(tilt=15, vignetting=0.3), Sensor())
    z = (signals.values[0] - truth) / signals.standard_error[0]
    assert np.std(z) == pytest.approx(1, abs=0.25)
    assert np.abs(z).max() < 4.5


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
