"""Reads measured cameras by name, by file, or from an object of colour-science.

The names are the 52 cameras of rawtoaces-data that the basis `cameras` was learned from, the two of colour-science,
and the demo's phone, which is drawn. Curves are interpolated smoothly, with Sprague's method, as reflectances are.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats, frozen
from camssf.spectra.sampled import Name, Pair, ascending, check_wavelengths, smooth, text_of
from camssf.spectra.tables import read_curves
from camssf.spectra.text import is_file, looks_like_file, nearest, plain


@dataclass(frozen=True)
class CameraCurves:
    """The measured sensitivity of a camera, for simulation and comparison.

    Attributes:
        name: of the camera.
        values: (681, 3) red, green, blue on the grid, in the units of the source; 0 outside its range.
        source: description for the report.
    """

    name: str
    values: Floats = field(repr=False)
    source: str


class MeasuredCurves(Protocol):
    """Curves with the attributes of colour-science's RGB_CameraSensitivities or MultiSpectralDistributions."""

    @property
    def wavelengths(self) -> Any:
        """(w,) nm."""

    @property
    def values(self) -> Any:
        """(w, 3)."""

    @property
    def labels(self) -> Any:
        """Names of the columns: red, green, blue or R, G, B, in any order."""


CameraLike: TypeAlias = Name | CameraCurves | MeasuredCurves | Pair
"""What `read_camera` accepts: a name or a file; CameraCurves; colour-science's RGB_CameraSensitivities or any object
with `wavelengths`, `values` and `labels`; or a pair of arrays, wavelengths (w,) in nm and curves (w, 3), R, G, B."""

SHIPPED_SOURCE = "rawtoaces-data 1.1.0, Apache-2.0"
"""Source of the curves in data/cameras.npz; data/README.md has the file's hash."""
DRAWN = "a draw from the basis phones, no known phone"
"""Source of the curves in data/demo-phones.json."""

LIBRARY = ("Nikon 5100 (NPL)", "Sigma SDMerill (NPL)")
"""Colour-science's cameras, in data/npl.json, which `python -m tools.npl` writes."""
DEMO_PHONES = ("Demo phone", "Second demo phone")
"""Draws from the basis `phones`, no known phones; in data/demo-phones.json (`python -m tools.demo_phones`)."""


def camera_names() -> tuple[str, ...]:
    """Names that `read_camera` accepts."""
    return (*shipped_cameras(), *LIBRARY, *DEMO_PHONES)


@cache
def shipped_cameras() -> dict[str, Floats]:
    """The 52 cameras by name, the maker first: (69, 3) every 5 nm from 380 to 720 nm, each channel's peak = 1."""
    place = files("camssf") / "data" / "cameras.npz"
    with place.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
        return {str(name): frozen(nodes) for name, nodes in zip(content["cameras"], content["curves"], strict=True)}


def read_camera(spec: CameraLike | None) -> CameraCurves:
    """Read the measured sensitivities of a camera by name, by file or from an object; 0 outside the measured range.

    Names are those of `camera_names`. A file is a CSV with the header `wavelength_nm,red,green,blue` (or `R,G,B`;
    other columns are ignored), or a CSV of these four columns without a header; a camera file of rawtoaces or
    DCamProf; SPECTACLE's spectral_response.csv; Argyll's .cmf; or the list camspec_database.txt. A CSV of several
    cameras has a column `camera`; one of several is chosen as in `cameras.csv:Canon EOS 5D` or
    `camspec_database.txt:Nikon D40`. An object has `wavelengths`, `values` and `labels`, as colour-science's
    RGB_CameraSensitivities. A pair of arrays is wavelengths (w,) and values (w, 3), red, green, blue.

    Raises:
        InvalidArgument: unknown name, or a file or object that is not such a table of finite, positive curves.

    Example:
        >>> from camssf.spectra import read_camera
        >>> camera = read_camera("Canon EOS 5D Mark II")
        >>> camera.values.shape, camera.source
        ((681, 3), 'Canon EOS 5D Mark II (rawtoaces-data 1.1.0, Apache-2.0)')
    """
    if isinstance(spec, CameraCurves):
        return spec
    if spec is not None and not isinstance(spec, str | PathLike):
        return _camera_of_object(spec)
    text = text_of(spec)
    known = {plain(name): name for name in reversed(camera_names())}
    words = plain(text)
    name = known.get(words) or known.get(f"{words}(npl)") or known.get(words.replace("nikond5100", "nikon5100"))
    if name is not None:
        return _known_camera(name)
    match = re.fullmatch(r"(.+\.(?:csv|tsv|txt)):([^/\\]+)", text, re.IGNORECASE)
    if match and not is_file(text):
        return _measured_camera(Path(match[1]), match[2].strip())
    if looks_like_file(text):
        return _measured_camera(Path(text), None)
    raise InvalidArgument(
        f"No measured camera is called {text!r}." if text else "The camera is missing.",
        f"{nearest(text, camera_names())}`camssf cameras` lists the known cameras; or give a file of "
        "curves: CSV (wavelength_nm,red,green,blue), rawtoaces or DCamProf JSON, SPECTACLE CSV, camspec text or "
        "Argyll's .cmf; or cameras.csv:NAME for one of many.",
    )


@cache
def _known_camera(name: str) -> CameraCurves:
    nodes = shipped_cameras().get(name)
    if nodes is not None:
        return CameraCurves(name, _on_grid(WAVELENGTHS[::10], nodes), f"{name} ({SHIPPED_SOURCE})")
    place, source = ("demo-phones.json", DRAWN) if name in DEMO_PHONES else ("npl.json", "colour-science")
    table = json.loads((files("camssf") / "data" / place).read_text("utf-8"))["cameras"][name]
    curves = np.array(table["values"])
    values = _on_grid(table["start"] + table["step"] * np.arange(len(curves)), curves)
    return CameraCurves(name, values, f"{name} ({source})")


def _measured_camera(path: Path, name: str | None) -> CameraCurves:
    label, wavelengths, curves = read_curves(path, name)
    return CameraCurves(label, _checked(wavelengths, curves, path), f"{label}, file {path.name}")


def _camera_of_object(given_curves: Any) -> CameraCurves:
    if isinstance(given_curves, tuple | list) and len(given_curves) == 2:
        return _camera_of_arrays(*given_curves)
    label = str(getattr(given_curves, "name", "") or type(given_curves).__name__)
    try:
        letters = [str(label).strip().casefold()[:1] for label in given_curves.labels]
        wavelengths = np.asarray(given_curves.wavelengths, dtype=np.float64)
        curves = np.asarray(given_curves.values, dtype=np.float64)
    except (AttributeError, TypeError, ValueError) as error:
        raise _no_object(label) from error
    if sorted(letters) != ["b", "g", "r"] or curves.shape != (wavelengths.size, 3) or wavelengths.ndim != 1:
        raise _no_object(label)
    curves = curves[:, [letters.index(channel) for channel in "rgb"]]
    return CameraCurves(label, _checked(wavelengths, curves, Path(label)), f"{label}, an object of colour-science")


def _camera_of_arrays(*pair: Any) -> CameraCurves:
    try:
        wavelengths, curves = (np.array(values, dtype=np.float64) for values in pair)
    except (TypeError, ValueError) as error:
        raise _no_object("two arrays") from error
    if wavelengths.ndim != 1 or curves.shape != (wavelengths.size, 3):
        raise _no_object("two arrays")
    return CameraCurves("camera (given)", _checked(wavelengths, curves, Path("The camera")), "given as arrays")


def _no_object(label: str) -> InvalidArgument:
    return InvalidArgument(
        f"{label!r} is not a camera.",
        "Give a name, a file, an object with wavelengths (w,), values (w, 3) and labels red, green, blue, or a pair "
        "of arrays, wavelengths (w,) and values (w, 3).",
    )


def _checked(wavelengths: Floats, curves: Floats, path: Path) -> Floats:
    wavelengths, curves = ascending(wavelengths, curves)
    check_wavelengths(wavelengths, path, "invalid_argument", whole=False)
    if not np.isfinite(curves).all() or np.abs(curves).max() > 1e100:
        raise InvalidArgument(f"{path} has a sensitivity that is not a number.", "Give measured curves.")
    values = _on_grid(wavelengths, curves)
    if (values.max(axis=0) <= 0).any():
        raise InvalidArgument(f"{path} has a curve without response from 380 to 720 nm.", "Give measured curves.")
    return values


def _on_grid(wavelengths: Floats, curves: Floats) -> Floats:
    """Interpolate curves (w, 3) to (681, 3): smooth, 0 outside, and ≥ 0 if the measurement is."""
    values = np.stack([smooth(wavelengths, curve) for curve in curves.T], axis=1)
    if curves.min() >= 0:
        values = np.maximum(values, 0.0)  # smooth interpolation undershoots next to steep edges
    values[(wavelengths[0] > WAVELENGTHS) | (wavelengths[-1] < WAVELENGTHS)] = 0.0
    return frozen(values)
