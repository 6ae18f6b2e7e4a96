"""The measured curves with their assumptions, and their document."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.files import local_folder, write_files
from camssf.grid import CHANNELS, WAVELENGTHS, Floats
from camssf.messages import fail
from camssf.version import __version__
from camssf_lab.direct.columns import PathLike
from camssf_lab.direct.dispersion import Dispersion

Json: TypeAlias = dict[str, Any]


FIRST = 400.0
LAST = 700.0
"""Range that both frames, or a sweep, must cover, nm."""


@dataclass(frozen=True)
class Direct:
    """The measured curves. Columns are R, G, B.

    Attributes:
        values: (681, 3) relative response, one scale for the three channels; 0 where nothing was measured.
        std: (681, 3) its standard error from the scatter of the pixels; None for a sweep or a table.
        covered: (first, last) measured wavelength, nm.
        camera: (make, model), empty if unknown.
        dispersions: by role, "rgb" and "mono"; empty for a sweep.
        tilts: of the lines, degrees, by role.
        assumptions: (code, message) of each assumption.
        files: name and SHA-256 of each, by role.
    """

    values: Floats
    std: Floats | None
    covered: tuple[float, float]
    camera: tuple[str, str]
    dispersions: dict[str, Dispersion]
    tilts: dict[str, float]
    assumptions: tuple[tuple[str, str], ...]
    files: dict[str, tuple[str, str]]

    def document(self) -> Json:
        """The document "camssf-direct/1" as plain data: `ssf` and `ssf_std` as in camssf-result/1, peak 1."""
        peak = self.values.max(axis=0)
        return {
            "format": "camssf-direct/1",
            "generator": {"name": "camssf", "version": __version__},
            "camera": dict(zip(("make", "model"), self.camera, strict=True)),
            "covered_nm": list(self.covered),
            "ssf": _curves(self.values / peak),
            "ssf_std": None if self.std is None else _curves(self.std / peak),
            "channel_gain": (peak / peak[1]).tolist(),
            "wavelengths": {
                role: {
                    "residual_nm": dispersion.residual,
                    "likeness": dispersion.likeness,
                    "tilt_degrees": self.tilts[role],
                    "polynomial": {
                        "middle_px": dispersion.middle,
                        "half_px": dispersion.half,
                        "coefficients_nm": dispersion.coefficients.tolist(),
                    },
                    "lines": [
                        {
                            "name": line.name,
                            "table_nm": line.nm,
                            "pixel": line.pixel,
                            "fitted_nm": line.fitted,
                            "residual_nm": line.residual,
                        }
                        for line in dispersion.lines
                    ],
                }
                for role, dispersion in self.dispersions.items()
            },
            "assumptions": [{"code": code, "message": message} for code, message in self.assumptions],
            "files": {role: {"name": name, "sha256": sha256} for role, (name, sha256) in self.files.items()},
        }

    def save(self, folder: PathLike) -> list[Path]:
        """Write direct.json and ssf.csv (as `camssf calibrate` writes it) to `folder`, both or none.

        Raises:
            InvalidArgument: the folder cannot be written to, or holds the result of a calibration.
        """
        if os.path.isfile(local_folder(folder) / "result.json"):
            raise InvalidArgument(
                f"{folder} holds the result of a calibration, whose ssf.csv would be replaced.",
                "Name another folder.",
            )
        document = self.document()
        columns = [WAVELENGTHS, *(np.array(document["ssf"][c]) for c in CHANNELS)]
        head = ["wavelength_nm", *CHANNELS]
        if document["ssf_std"]:
            columns += [np.array(document["ssf_std"][c]) for c in CHANNELS]
            head += [f"{c}_std" for c in CHANNELS]
        rows = [",".join([f"{row[0]:.1f}", *(f"{v:.9f}" for v in row[1:])]) for row in zip(*columns, strict=True)]
        texts = {
            "direct.json": json.dumps(document, ensure_ascii=False, allow_nan=False) + "\n",
            "ssf.csv": "\n".join([",".join(head), *rows, ""]),
        }
        return write_files(folder, texts)


def checked(direct: Direct) -> Direct:
    """The same curves, with the assumption "covered" added if they do not cover the whole grid.

    Raises:
        Underexposed: a channel has no signal.
    """
    if not np.isfinite(direct.values).all() or (direct.values.max(axis=0) <= 0).any():
        raise fail("underexposed.empty_channel")
    if direct.covered[0] <= WAVELENGTHS[0] and direct.covered[1] >= WAVELENGTHS[-1]:
        return direct
    low, high = (f"{nm:.1f}" for nm in direct.covered)
    gap = ("covered", f"only {low} to {high} nm were measured; beyond, the curves are set to 0.")
    return replace(direct, assumptions=(*direct.assumptions, gap))


def identified(paths: Mapping[str, PathLike | None]) -> dict[str, tuple[str, str]]:
    """Name and SHA-256 of each file that is not None, by role."""
    return {
        role: (Path(path).name, hashlib.sha256(Path(path).read_bytes()).hexdigest())
        for role, path in paths.items()
        if path is not None
    }


def _curves(values: Floats) -> Json:
    return {"wavelength_nm": WAVELENGTHS.tolist()} | {c: v.tolist() for c, v in zip(CHANNELS, values.T, strict=True)}
