"""RAW that a program has mixed, demosaiced or smoothed (rule 11 of docs/verdict.md)."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import convolve, gaussian_filter

from camssf.grid import Floats
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.neighbours import SampleNoise
from camssf.photo.patches import measure_patches
from camssf.photo.photon_noise import Estimate, mixed_noise
from camssf.verdict.processed import DEMOSAICED, colours_mixed, processed
from camssf.verdict.reasons import Checks
from camssf_lab.simulation.camera import Sensor
from tests.support.scenes import filtered, filters, mosaic, shoot, table

KERNEL = np.array([[1.0, 2.0, 1.0], [2.0, 4.0, 2.0], [1.0, 2.0, 1.0]])
Change = Callable[[Floats], Floats]


@cache
def pose() -> Pose:
    return find_chart(mosaic(shoot().chart), table())


def demosaiced(light: Floats) -> Floats:
    """(h, w, 3), each colour between its samples."""
    own = filters(light.shape)
    full = [convolve(light * (own == c), KERNEL) / convolve((own == c) * 1.0, KERNEL) for c in range(3)]
    return np.stack([np.where(own == c, light, one) for c, one in enumerate(full)], axis=2)


def desaturated(share: float) -> Change:
    return lambda light: filtered(demosaiced(light) @ (np.eye(3) * (1.0 - share) + share / 3.0))


def without_chroma_noise(light: Floats) -> Floats:
    full = demosaiced(light)
    grey = full.mean(axis=2, keepdims=True)
    return filtered(grey + np.stack([gaussian_filter((full - grey)[:, :, c], 2.0) for c in range(3)], axis=2))


def reasons_of(change: Change | None, sensor: Sensor | None = None) -> list[str]:
    sensor = sensor or Sensor()
    samples = shoot(sensor=sensor).chart
    if change is not None:
        changed = change(samples.astype(float) - sensor.black) + sensor.black
        samples = np.clip(np.rint(changed), 0, sensor.white_level).astype(np.uint16)
    return [reason.key for reason in processed(measure_patches(mosaic(samples, sensor), pose()), 0, Checks())]


@pytest.mark.parametrize(
    ("change", "reasons"),
    [
        (None, []),
        (lambda light: filtered(demosaiced(light)), []),
        (desaturated(0.15), ["not_sensor_raw.mixed"]),
        (desaturated(0.35), ["not_sensor_raw.mixed"]),
        (without_chroma_noise, ["not_sensor_raw.mixed"]),
    ],
    ids=["sensor", "demosaiced without mixing", "desaturated 15 %", "desaturated 35 %", "chroma noise reduction"],
)
def test_samples_that_a_program_has_mixed_are_doubted(change: Change | None, reasons: list[str]) -> None:
    assert reasons_of(change) == reasons


@pytest.mark.parametrize("period", [3.0, 9.0])
def test_a_weave_is_no_noise(period: float) -> None:
    """A pattern that all rows share, as of cloth or of a lamp's flicker, is not taken for correlated noise."""

    def woven(light: Floats) -> Floats:
        return light * (1.0 + 0.02 * np.sin(2.0 * np.pi / period * np.arange(light.shape[1])))

    assert reasons_of(woven) == []


def test_the_noise_of_a_sensor_shows_no_mixture_and_that_of_a_mixture_shows_how_much() -> None:
    rng = np.random.default_rng(2)
    signal = rng.uniform(100.0, 9000.0, (24, 3))
    count = np.full((24, 3), 4000.0)
    for share, expected in ((0.0, 0.0), (0.15, -2 * 0.15 / (3 - 2 * 0.15))):
        mix = np.eye(3) * (1.0 - share) + share / 3.0
        variance = (30.0 + 2.0 * signal) @ (mix**2).T + 1.0 / 12.0
        found = mixed_noise(
            signal @ mix.T, variance * (1.0 + np.sqrt(2.0 / 4000) * rng.normal(size=(24, 3))), count, 1.0
        )
        assert abs(found.value - expected) < 4.0 * found.error < 0.1


def test_noise_that_does_not_suffice_is_not_judged() -> None:
    still = np.full((1200, 1600), 900, np.uint16)
    means = measure_patches(mosaic(still), pose())
    assert (means.noise.unlike, means.noise.like) == (None, None)
    assert colours_mixed(means) is None
    assert processed(means, 0, Checks()) == []


def test_a_correlation_within_its_own_error_is_none() -> None:
    means = measure_patches(mosaic(np.full((1200, 1600), 900, np.uint16)), pose())
    for error, reasons in ((1.1 * DEMOSAICED, []), (0.01 * DEMOSAICED, ["not_sensor_raw.demosaiced"])):
        noise = SampleNoise(1.0, Estimate(2.0 * DEMOSAICED, error), None)
        found = processed(replace(means, noise=noise), 0, Checks())
        assert [reason.key for reason in found] == reasons
