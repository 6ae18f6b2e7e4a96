"""A simulated grating spectrograph in sunlight before a camera: the frames that `camssf direct` takes.

Light of wavelength λ lands at x(λ) by the grating equation in first order, d (sin α + sin β) = λ, under a lens of
focal length f: x = x₀ + (f / p) tan(β - β₀). The slit's image is a Gaussian of `fwhm` nm, leaning. A pixel counts

    Σ over λ of L(λ) S(λ) slit(λ - λ(x)) dλ/dx · rows(y)      as Poisson electrons, read noise, black, rounding.

L is ASTM G173's global tilt spectrum (AM1.5) as colour-science has it, 0.5 to 1 nm fine, with all lines of sun and
air.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import FWHM_TO_SIGMA
from camssf.spectra import CameraCurves
from camssf_lab.simulation import dng
from camssf_lab.simulation.camera import Sensor, count
from camssf_lab.simulation.shot_plan import FileTags

FINE: Floats = np.arange(330.0, 830.0, 0.05)
"""Wavelengths of the simulated light, nm."""


@dataclass(frozen=True)
class Spectrograph:
    """Grating, lens and detector."""

    grooves: float = 150.0  # of the grating, 1/mm
    focal: float = 100.0  # of the camera's lens, mm
    pixel: float = 0.0040  # pitch, mm
    size: tuple[int, int] = (1600, 240)  # (width, height) of the frame, px
    centre: float = 560.0  # wavelength on the frame's middle column, nm
    angle: float = 3.0  # of diffraction there, degrees off the grating's normal
    tilt: float = 0.7  # of the slit's image against the columns, degrees
    fwhm: float = 2.0  # of the slit's image, nm
    mirrored: bool = False  # red on the left

    def wavelength(self, x: Floats) -> Floats:
        """Of columns in the middle row, nm."""
        spacing, beta = 1e6 / self.grooves, np.deg2rad(self.angle)
        offset = (x - (self.size[0] - 1) / 2) * (-1.0 if self.mirrored else 1.0)
        lifted = beta + np.arctan(offset * self.pixel / self.focal)
        return np.asarray(self.centre + spacing * (np.sin(lifted) - np.sin(beta)))


RGB, MONO = Spectrograph(), Spectrograph(pixel=0.0048, size=(1400, 200), centre=565.0, tilt=-0.4)
"""The colour camera's, and the mono camera's."""


@cache
def sunlight() -> Floats:
    """Photons on FINE, largest 1."""
    from colour.plotting.datasets.astm_g_173 import SD_ASTMG173_GLOBAL_TILT

    power = np.interp(FINE, SD_ASTMG173_GLOBAL_TILT.wavelengths, SD_ASTMG173_GLOBAL_TILT.values)
    return np.asarray(power / power.max())


def silicon(wavelengths: Floats) -> Floats:
    """A mono camera's relative response: smooth as a silicon sensor's, largest at 560 nm, a third at 390 nm."""
    return np.asarray(np.exp(-0.5 * ((wavelengths - 560.0) / np.where(wavelengths < 560.0, 115.0, 190.0)) ** 2))


def frame(
    response: Floats, device: Spectrograph, rng: np.random.Generator, sensor: Sensor, cell: NDArray[np.int64]
) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """One frame, whose brightest pixel is 0.7 of full scale, and its dark frame, (h, w) uint16.

    Args:
        response: (len(FINE), c) of the camera's channels.
        device, rng, sensor: the spectrograph, of the noise, how it counts.
        cell: (2, 2) channel of each position.
    """
    width, height = device.size
    fine = (sunlight()[:, None] * response).T
    blurred = gaussian_filter1d(fine, device.fwhm * FWHM_TO_SIGMA / 0.05, axis=1)
    x, y = np.arange(width, dtype=float), np.arange(height, dtype=float)
    lean = np.tan(np.deg2rad(device.tilt))
    along = x[None, :] - lean * (y[:, None] - (height - 1) / 2)
    nm = device.wavelength(along)
    spread = np.abs(device.wavelength(along + 0.5) - device.wavelength(along - 0.5))
    slit = 1.0 / (1.0 + np.exp((np.abs(y - (height - 1) / 2) - 0.33 * height) / 2.0))
    which = np.tile(cell, (height // 2 + 1, width // 2 + 1))[:height, :width]
    level = np.zeros((height, width))
    for channel in range(response.shape[1]):
        level = np.where(which == channel, np.interp(nm, FINE, blurred[channel], 0.0, 0.0), level)
    level *= spread * slit[:, None]
    level *= 0.7 / level.max()
    light = level * (sensor.white_level - sensor.black)
    return count(light, sensor, rng), count(0.0 * light, sensor, rng)


def write_dng(path: Path, samples: NDArray[np.uint16], sensor: Sensor, camera: CameraCurves) -> None:
    """A camera's frame: RGGB, uncompressed, with its black and white level."""
    dng.write_dng(path, samples, FileTags("RGGB", sensor.black, sensor.white_level), camera, np.ones(3), None)


def shoot(camera: CameraCurves, folder: Path, seed: int, device: Spectrograph = RGB) -> dict[str, Path]:
    """rgb.dng, rgb-dark.dng, mono.tif, mono-dark.tif and mono-response.csv in `folder`; their paths."""
    rng = np.random.default_rng(seed)
    sensor = Sensor(full_well=15000.0)
    curves = np.stack([np.interp(FINE, WAVELENGTHS, c, 0.0, 0.0) for c in camera.values.T], axis=1)
    curves /= curves.max()
    folder.mkdir(parents=True, exist_ok=True)
    paths = {name: folder / name for name in ("rgb.dng", "rgb-dark.dng", "mono.tif", "mono-dark.tif")}
    colour = frame(curves, device, rng, sensor, np.array([[0, 1], [1, 2]]))
    grey = frame(silicon(FINE)[:, None], MONO, rng, sensor, np.zeros((2, 2), np.int64))
    for name, samples in zip(("rgb.dng", "rgb-dark.dng"), colour, strict=True):
        write_dng(paths[name], samples, sensor, camera)
    for name, samples in zip(("mono.tif", "mono-dark.tif"), grey, strict=True):
        tifffile.imwrite(paths[name], samples)
    response = folder / "mono-response.csv"
    lines = [f"{nm:g},{value:.6f}" for nm, value in zip(WAVELENGTHS[::10], silicon(WAVELENGTHS[::10]), strict=True)]
    response.write_text("\n".join(["wavelength_nm,response", *lines, ""]), encoding="utf-8")
    return paths | {"mono-response.csv": response}
