"""A simulated grating spectrograph in sunlight before a camera: the frames that `camssf direct` takes.

Light of wavelength λ lands at x(λ) by the grating equation in first order, d (sin α + sin β) = λ, under a lens of
focal length f: x = x₀ + (f / p) tan(β - β₀). The slit's image is a Gaussian of `fwhm` nm, leaning. A pixel counts

    Σ over λ of L(λ) S(λ) slit(λ - λ(x)) dλ/dx · rows(y)      as Poisson electrons, read noise, black, rounding.

L is ASTM G173's global tilt spectrum (AM1.5) as colour-science has it, 0.5 to 1 nm fine, with all lines of sun and
air; or CIE daylight, which is smooth, with the Fraunhofer lines drawn in at their tabulated wavelengths.
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
from camssf.spectra import CameraCurves, read_lamp
from camssf_lab.simulation import dng
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.shot_plan import FileTags

FINE: Floats = np.arange(330.0, 830.0, 0.05)
"""Wavelengths of the simulated light, nm."""
DRAWN = (
    (393.366, 1.6, 0.75), (396.847, 1.4, 0.72), (410.174, 0.35, 0.55), (422.673, 0.20, 0.75), (430.790, 1.0, 0.40),
    (434.047, 0.35, 0.60), (438.355, 0.20, 0.60), (486.134, 0.40, 0.65), (516.733, 0.12, 0.70), (517.270, 0.16, 0.75),
    (518.362, 0.20, 0.80), (526.954, 0.15, 0.65), (588.995, 0.09, 0.80), (589.592, 0.08, 0.75), (656.281, 0.35, 0.75),
    (686.719, 1.0, 0.45), (759.370, 2.0, 0.70),
)  # fmt: skip
"""Lines for the smooth daylight: wavelength, standard deviation (nm) and depth. Wavelengths are Fraunhofer's and
Ångström's lines as any table has them; widths and depths are ours, such that the stronger lines have about their
equivalent widths (0.4 nm for F and C, 0.06 and 0.08 for D1 and D2)."""


@dataclass(frozen=True)
class Spectrograph:
    """Grating, lens and detector.

    Attributes:
        grooves: of the grating, 1/mm.
        focal: of the camera's lens, mm.
        pixel: pitch, mm.
        size: (width, height) of the frame, px.
        centre: wavelength on the frame's middle column, nm.
        angle: of diffraction there, degrees off the grating's normal.
        tilt: of the slit's image against the columns, degrees.
        fwhm: of the slit's image, nm.
        mirrored: red on the left.
    """

    grooves: float = 150.0
    focal: float = 100.0
    pixel: float = 0.0040
    size: tuple[int, int] = (1600, 240)
    centre: float = 560.0
    angle: float = 3.0
    tilt: float = 0.7
    fwhm: float = 2.0
    mirrored: bool = False

    def wavelength(self, x: Floats) -> Floats:
        """Of columns in the middle row, nm."""
        spacing, beta = 1e6 / self.grooves, np.deg2rad(self.angle)
        offset = (x - (self.size[0] - 1) / 2) * (-1.0 if self.mirrored else 1.0)
        lifted = beta + np.arctan(offset * self.pixel / self.focal)
        return np.asarray(self.centre + spacing * (np.sin(lifted) - np.sin(beta)))


RGB, MONO = Spectrograph(), Spectrograph(pixel=0.0048, size=(1400, 200), centre=565.0, tilt=-0.4)
"""The colour camera's, and the mono camera's."""


@cache
def sunlight(kind: str) -> Floats:
    """Photons on FINE, largest 1: "AM1.5" or "daylight" with drawn lines."""
    if kind == "AM1.5":
        from colour.plotting.datasets.astm_g_173 import SD_ASTMG173_GLOBAL_TILT

        power = np.interp(FINE, SD_ASTMG173_GLOBAL_TILT.wavelengths, SD_ASTMG173_GLOBAL_TILT.values)
    else:
        power = np.interp(FINE, WAVELENGTHS, read_lamp("D55").values)
        for centre, sigma, depth in DRAWN:
            power = power * (1.0 - depth * np.exp(-0.5 * ((FINE - centre) / sigma) ** 2))
    return np.asarray(power / power.max())


def silicon(wavelengths: Floats) -> Floats:
    """A mono camera's relative response: smooth as a silicon sensor's, largest at 560 nm, a third at 390 nm."""
    return np.asarray(np.exp(-0.5 * ((wavelengths - 560.0) / np.where(wavelengths < 560.0, 115.0, 190.0)) ** 2))


def frame(
    response: Floats,
    device: Spectrograph,
    rng: np.random.Generator,
    *,
    light: str = "AM1.5",
    exposure: float = 0.7,
    sensor: Sensor | None = None,
    colours: NDArray[np.int64] | None = None,
) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """One frame and its dark frame, (h, w) uint16.

    Args:
        response: (len(FINE), c) of the camera's channels.
        device: the spectrograph.
        rng: of the noise.
        light: see `sunlight`.
        exposure: the brightest pixel as a share of full scale.
        sensor: how it counts.
        colours: (2, 2) channel of each position of the cell; None for one channel.
    """
    counter = sensor or Sensor()
    width, height = device.size
    fine = (sunlight(light)[:, None] * response).T
    blurred = gaussian_filter1d(fine, device.fwhm * FWHM_TO_SIGMA / 0.05, axis=1)
    x, y = np.arange(width, dtype=float), np.arange(height, dtype=float)
    lean = np.tan(np.deg2rad(device.tilt))
    along = x[None, :] - lean * (y[:, None] - (height - 1) / 2)
    nm = device.wavelength(along)
    spread = np.abs(device.wavelength(along + 0.5) - device.wavelength(along - 0.5))
    slit = 1.0 / (1.0 + np.exp((np.abs(y - (height - 1) / 2) - 0.33 * height) / 2.0))
    cell = np.zeros((2, 2), dtype=np.int64) if colours is None else colours
    which = np.tile(cell, (height // 2 + 1, width // 2 + 1))[:height, :width]
    level = np.zeros((height, width))
    for channel in range(response.shape[1]):
        level = np.where(which == channel, np.interp(nm, FINE, blurred[channel], 0.0, 0.0), level)
    level *= spread * slit[:, None]
    level *= exposure / level.max()
    full = counter.white_level - counter.black
    samples = []
    for share in (level, np.zeros_like(level)):
        electrons = rng.poisson(share * counter.full_well) + counter.read_noise * rng.standard_normal(level.shape)
        dn = np.rint(counter.black + electrons / counter.full_well * full)
        samples.append(np.clip(dn, 0, counter.white_level).astype(np.uint16))
    return samples[0], samples[1]


def write_dng(path: Path, samples: NDArray[np.uint16], sensor: Sensor, camera: CameraCurves) -> None:
    """A camera's frame: RGGB, uncompressed, with its black and white level."""
    dng.write_dng(path, samples, FileTags("RGGB", sensor.black, sensor.white_level), camera, np.ones(3), None)


def shoot(
    camera: CameraCurves,
    folder: Path,
    seed: int,
    *,
    light: str = "AM1.5",
    device: Spectrograph = RGB,
    mono: Spectrograph = MONO,
    exposure: float = 0.7,
) -> dict[str, Path]:
    """rgb.dng, rgb-dark.dng, mono.tif, mono-dark.tif and mono-response.csv in `folder`; their paths."""
    rng = np.random.default_rng(seed)
    sensor = Sensor(full_well=15000.0)
    curves = np.stack([np.interp(FINE, WAVELENGTHS, c, 0.0, 0.0) for c in camera.values.T], axis=1)
    curves /= curves.max()
    folder.mkdir(parents=True, exist_ok=True)
    paths = {name: folder / name for name in ("rgb.dng", "rgb-dark.dng", "mono.tif", "mono-dark.tif")}
    cell = np.array([[0, 1], [1, 2]])
    colour = frame(curves, device, rng, light=light, sensor=sensor, colours=cell, exposure=exposure)
    grey = frame(silicon(FINE)[:, None], mono, rng, light=light, sensor=sensor)
    for name, samples in zip(("rgb.dng", "rgb-dark.dng"), colour, strict=True):
        write_dng(paths[name], samples, sensor, camera)
    for name, samples in zip(("mono.tif", "mono-dark.tif"), grey, strict=True):
        tifffile.imwrite(paths[name], samples)
    response = folder / "mono-response.csv"
    lines = [f"{nm:g},{value:.6f}" for nm, value in zip(WAVELENGTHS[::10], silicon(WAVELENGTHS[::10]), strict=True)]
    response.write_text("\n".join(["wavelength_nm,response", *lines, ""]), encoding="utf-8")
    return paths | {"mono-response.csv": response}
