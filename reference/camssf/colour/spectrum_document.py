"""Writes spectra as "camssf-spectrum/1" and as CSV; the schema is data/spectrum.schema.json."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from camssf.colour.absorbance import indices
from camssf.colour.document import OBSERVERS
from camssf.colour.reflectance import FAR, SurfaceSpectra
from camssf.colour.regions import Region
from camssf.grid import Floats
from camssf.spectra.surfaces import SURFACE_NODES
from camssf.version import __version__

FORMAT = "camssf-spectrum/1"


def spectrum_document(
    spectra: SurfaceSpectra,
    photos: Sequence[dict[str, Any]],
    regions: Sequence[Region],
    weights: Mapping[str, Floats],
    about: dict[str, Any],
) -> dict[str, Any]:
    """The document of spectra measured in one or two photos.

    Args:
        spectra: of m regions.
        photos: of each photo `photo`, `lamp` and `reference` as in the schema, and `signals` and `errors`, (m, 3).
        regions: where the signals were measured.
        weights: of the indices to state, by name.
        about: `result` as in the schema.
    """
    values = {name: indices(spectra, each) for name, each in weights.items()}
    stated = ("photo", "lamp", "reference")
    return {
        "format": FORMAT,
        "generator": {"name": "camssf", "version": __version__},
        "result": about["result"],
        "prior": {"name": spectra.prior, "limit": FAR},
        "photos": [{name: each[name] for name in stated} for each in photos],
        "lamps": [{"names": list(names), "weight": weight} for names, weight in spectra.lamps],
        "chi_squared": spectra.chi_squared,
        "observer": OBSERVERS[spectra.view.observer],
        "white": {"of": spectra.view.white, "xyz": spectra.white.tolist()},
        "wavelength_nm": SURFACE_NODES.tolist(),
        "regions": [
            {
                "rectangle": list(region.rectangle),
                "status": "outside_prior" if spectra.distance[i] > FAR else "ok",
                "signal": [each["signals"][i].tolist() for each in photos],
                "standard_error": [each["errors"][i].tolist() for each in photos],
                "distance": float(spectra.distance[i]),
                "from_photo": float(spectra.from_photo[i]),
                "reflectance": spectra.reflectance[i].tolist(),
                "standard_deviation": spectra.standard_deviation[i].tolist(),
                "covariance": spectra.covariance[i].tolist(),
                "parts": {
                    name: np.sqrt(np.maximum(np.diagonal(part[i]), 0.0)).tolist()
                    for name, part in spectra.parts.items()
                },
                "xyz": spectra.xyz[i].tolist(),
                "xyz_covariance": spectra.xyz_covariance[i].tolist(),
                "lab": spectra.lab[i].tolist(),
                "lab_covariance": spectra.lab_covariance[i].tolist(),
                "indices": {
                    name: {"value": float(value[i]), "standard_deviation": float(std[i])}
                    for name, (value, std) in values.items()
                },
            }
            for i, region in enumerate(regions)
        ],
    }


def spectrum_csv(spectra: SurfaceSpectra) -> str:
    """A line for each wavelength: the reflectance of each region, then its standard deviation."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    numbers = range(1, len(spectra.reflectance) + 1)
    writer.writerow(["wavelength_nm", *(f"region_{i}" for i in numbers), *(f"region_{i}_std" for i in numbers)])
    table = np.concatenate([spectra.reflectance, spectra.standard_deviation]).T
    for nm, row in zip(SURFACE_NODES, table, strict=True):
        writer.writerow([f"{nm:g}", *(f"{value:.6f}" for value in row)])
    return text.getvalue()
