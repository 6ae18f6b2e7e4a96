"""Measured cameras by name or by file.

Those known by name are colour-science's. Curves are smooth: Sprague's interpolation, as for reflectances.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra.sampled import check_wavelengths, colour_science, frozen, smooth, text_of
from camssf.spectra.tables import is_file, looks_like_file, nearest, plain, read_curves


@dataclass(frozen=True)
class CameraCurves:
    """The measured sensitivity of a camera, for simulation and comparison.

    Attributes:
        name: of the camera.
        values: (681, 3) red, green, blue on the grid, in the units of the source; 0 outside its range.
        source: in words for the report.
    """

    name: str
    values: Floats
    source: str


def camera_names() -> tuple[str, ...]:
    """Names that `read_camera` knows, besides files."""
    return tuple(str(name) for name in colour_science().MSDS_CAMERA_SENSITIVITIES)


def read_camera(spec: str) -> CameraCurves:
    """Measured sensitivities of a camera, by name or by file; 0 outside the measured range.

    Names are colour-science's (`camera_names`). A file is a CSV with the header `wavelength_nm,red,green,blue` (or
    `R,G,B`; further columns are ignored), or one of many cameras with a column `camera` more, of which
    `cameras.csv:Canon EOS 5D` names one.

    Raises:
        InvalidArgument: unknown name, or a file that is no such table of finite, positive curves.
    """
    text = text_of(spec)
    known = {plain(alias): name for name in camera_names() for alias in (name, name.removesuffix(" (NPL)"))}
    name = known.get(plain(text).replace("nikond5100", "nikon5100"))
    if name is not None:
        return _known_camera(name)
    match = re.fullmatch(r"(.+\.(?:csv|tsv|txt)):([^/\\]+)", text, re.IGNORECASE)
    if match and not is_file(text):
        return _measured_camera(Path(match[1]), match[2].strip())
    if looks_like_file(text):
        return _measured_camera(Path(text), None)
    raise InvalidArgument(
        f"No measured camera is called {text!r}." if text else "The camera is missing.",
        f"{nearest(text, camera_names())}Cameras: {', '.join(camera_names())}; or a file of curves, "
        "wavelength_nm,red,green,blue; or cameras.csv:NAME for one of many.",
    )


@cache
def _known_camera(name: str) -> CameraCurves:
    table = colour_science().MSDS_CAMERA_SENSITIVITIES[name]
    values = _on_grid(np.asarray(table.wavelengths), np.asarray(table.values))
    return CameraCurves(name, values, f"{name} (colour-science)")


def _measured_camera(path: Path, name: str | None) -> CameraCurves:
    label, wavelengths, curves = read_curves(path, name)
    check_wavelengths(wavelengths, path, InvalidArgument, whole=False)
    if not np.isfinite(curves).all() or np.abs(curves).max() > 1e100:
        raise InvalidArgument(f"{path} has a sensitivity that is not a number.", "Give measured curves.")
    values = _on_grid(wavelengths, curves)
    if (values.max(axis=0) <= 0).any():
        raise InvalidArgument(f"{path} has a curve without response from 380 to 720 nm.", "Give measured curves.")
    return CameraCurves(label, values, f"{label}, file {path.name}")


def _on_grid(wavelengths: Floats, curves: Floats) -> Floats:
    """Curves (w, 3) → (681, 3): smooth, 0 outside, and not below zero where the measurement is not."""
    values = np.stack([smooth(wavelengths, curve) for curve in curves.T], axis=1)
    if curves.min() >= 0:
        values = np.maximum(values, 0.0)  # beside a steep edge a smooth interpolation dips
    values[(wavelengths[0] > WAVELENGTHS) | (wavelengths[-1] < WAVELENGTHS)] = 0.0
    return frozen(values)
