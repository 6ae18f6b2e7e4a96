"""Simulates the sensor: converts the light on every pixel into samples with photon and read noise.

    DN = round(black + light + dark current), clipped at 0 and the white level

Shot noise is Poisson noise of the electrons (`Sensor.full_well` at full scale); read noise is normal.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.photo.read.dng import CFA_ORDERS


@dataclass(frozen=True)
class Sensor:
    """Properties of the sensor and of its files.

    Attributes:
        cfa: colours of the 2 × 2 cell at the corner, one of RGGB, GRBG, GBRG, BGGR.
        black, white_level: DN; their difference is full scale.
        exposure: the brightest channel's signal of an ideal diffuser, as a share of full scale.
        gains: factors of the channels R, G, B, multiplied with the camera's curves: a colour cast.
        noise: whether shot and read noise are simulated.
        full_well: electrons at full scale.
        read_noise: standard deviation, electrons.
        dark_current: mean thermal signal in every frame, DN.
        compression: compression of the files: None, or "ljpeg" for lossless JPEG tiles (needs imagecodecs).
        make, model: what the files name; "" for "camssf" and the camera's name.
    """

    cfa: str = "RGGB"
    black: float = 512.0
    white_level: int = 16383
    exposure: float = 0.8
    gains: tuple[float, float, float] = (1.0, 1.0, 1.0)
    noise: bool = True
    full_well: float = 5000.0
    read_noise: float = 2.5
    dark_current: float = 0.0
    compression: str | None = None
    make: str = ""
    model: str = ""


def refuse(*rules: tuple[bool, str, str]) -> None:
    """Raise InvalidArgument for the first rule (holds, setting, requirement) that does not hold."""
    for holds, name, wanted in rules:
        if not holds:
            raise InvalidArgument(f"The simulation's {name} is out of range.", f"It must be {wanted}.")


def check_sensor(sensor: Sensor) -> None:
    """Refuse settings out of range.

    Raises:
        InvalidArgument: names the setting.
    """
    refuse(
        (sensor.cfa in CFA_ORDERS, "cfa", f"one of {', '.join(CFA_ORDERS)}"),
        (1 <= sensor.white_level <= 65535, "white_level", "1 to 65535 DN"),
        (0 <= sensor.black < sensor.white_level, "black", "at least 0 and below white_level, DN"),
        (0 < sensor.exposure <= 10, "exposure", "a share of full scale, above 0 and at most 10; 80 % is 0.8"),
        (sensor.full_well > 0, "full_well", "above 0, electrons"),
        (sensor.read_noise >= 0, "read_noise", "at least 0, electrons"),
        (sensor.dark_current >= 0, "dark_current", "at least 0, DN"),
        (min(sensor.gains) > 0, "gains", "above 0"),
    )
    if sensor.compression not in (None, "ljpeg"):
        raise InvalidArgument(f"Compression {sensor.compression} is unknown.", 'Choose None or "ljpeg".')


def cell(cfa: str) -> Iterator[tuple[int, int, int]]:
    """(row, column, colour) of the four positions of the CFA cell."""
    if cfa not in CFA_ORDERS:
        raise InvalidArgument(f"No Bayer order is called {cfa}.", f"Choose one of {', '.join(CFA_ORDERS)}.")
    for position, letter in enumerate(cfa):
        yield position // 2, position % 2, "RGB".index(letter)


def sites(cfa: str, height: int, width: int) -> Iterator[tuple[slice, slice, int]]:
    """Slices of the four planes of the CFA, with their colours."""
    for row, column, colour in cell(cfa):
        yield slice(row, height, 2), slice(column, width, 2), colour


def count(light: NDArray[np.float32], sensor: Sensor, rng: np.random.Generator) -> NDArray[np.uint16]:
    """Convert light in DN above black into samples, in strips to save memory."""
    samples = np.empty(light.shape, dtype=np.uint16)
    electrons = sensor.full_well / (sensor.white_level - sensor.black)
    step = max(1, (1 << 20) // light.shape[1])
    for start in range(0, len(light), step):
        strip = light[start : start + step].astype(np.float64) + sensor.dark_current
        if sensor.noise:
            strip = rng.poisson(strip * electrons) + sensor.read_noise * rng.standard_normal(strip.shape)
            strip /= electrons
        np.rint(strip + sensor.black, out=strip)
        samples[start : start + step] = np.clip(strip, 0, sensor.white_level, out=strip)
    return samples
