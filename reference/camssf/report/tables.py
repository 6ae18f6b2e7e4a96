"""Converts result documents to objects of colour-science, pandas and xarray, which are imported on first use."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from camssf.documents.scale import channel_scale, no_scale
from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS, WAVELENGTHS, columns
from camssf.libraries import library
from camssf.report.notebook import camera_of, with_curves
from camssf.spectra import colour_science

Json: TypeAlias = dict[str, Any]

NEEDS = "This table needs"
TABLES = ("curves", "patches", "budget")
TRIPLES = ("signal", "standard_error", "predicted", "predicted_std", "unseen", "unseen_std")
"""Values that a document holds for each patch and channel."""


def to_colour(document: Json) -> Any:
    """The curves as RGB_CameraSensitivities, on the camera's own scale."""
    values = columns(with_curves(document)["ssf"])
    scale = channel_scale(document)
    if scale is None:
        raise no_scale(document["shots"][0]["lamp"]["name"])
    science = colour_science()
    table = science.MultiSpectralDistributions(values * scale, WAVELENGTHS, labels=CHANNELS)
    return science.characterisation.RGB_CameraSensitivities(table, name=camera_of(document))


def to_pandas(document: Json, table: str) -> Any:
    """A DataFrame of curves, patches or the budget."""
    if table not in TABLES:
        raise InvalidArgument(f"There is no table {table!r}.", f"Take one of {', '.join(TABLES)}.")
    if table != "patches":
        with_curves(document)
    pandas = library("pandas", NEEDS, "notebook")
    if table == "patches":
        rows = [
            {
                "shot": j,
                "lamp": shot["lamp"]["name"],
                "patch": patch["name"],
                "channel": channel,
                "used": patch["used"],
                "level": patch.get("level", 1.0),
            }
            | {name: patch[name][c] if patch.get(name) else np.nan for name in TRIPLES}
            for j, shot in enumerate(document["shots"], 1)
            for patch in shot["patches"]
            for c, channel in enumerate(CHANNELS)
        ]
        return pandas.DataFrame(rows, columns=["shot", "lamp", "patch", "channel", "used", "level", *TRIPLES])
    if table == "budget":
        parts = (document.get("uncertainty") or {}).get("budget", [])
        index = pandas.Index([part["source"] for part in parts], name="source")
        return pandas.DataFrame(np.reshape([part["share"] for part in parts], (-1, 3)), index, list(CHANNELS))
    found = dict(zip(CHANNELS, columns(document["ssf"]).T, strict=True))
    if document.get("ssf_std"):
        names = [f"{channel}_std" for channel in CHANNELS]
        found |= dict(zip(names, columns(document["ssf_std"]).T, strict=True))
    return pandas.DataFrame(found, index=pandas.Index(WAVELENGTHS, name="wavelength_nm"))


def to_xarray(document: Json) -> Any:
    """A Dataset of curves and signals; missing values of a patch are NaN."""
    values: Json = {"ssf": (("wavelength", "channel"), columns(with_curves(document)["ssf"]))}
    xarray = library("xarray", NEEDS, "notebook")
    if document.get("ssf_std"):
        values["ssf_std"] = (("wavelength", "channel"), columns(document["ssf_std"]))
    shots = document["shots"]
    for name in TRIPLES:
        cube = [[patch.get(name) or [np.nan] * 3 for patch in shot["patches"]] for shot in shots]
        values[name] = (("shot", "patch", "channel"), np.array(cube, dtype=np.float64))
    values["used"] = (("shot", "patch"), np.array([[patch["used"] for patch in shot["patches"]] for shot in shots]))
    return xarray.Dataset(
        values,
        {
            "wavelength": ("wavelength", WAVELENGTHS, {"units": "nm"}),
            "channel": list(CHANNELS),
            "lamp": ("shot", [shot["lamp"]["name"] for shot in shots]),
            "patch": [patch["name"] for patch in shots[0]["patches"]],
        },
        {
            "camera": camera_of(document),
            "verdict": document["verdict"]["status"],
            "basis": document["basis"],
            "scale": "each channel's peak = 1",
        },
    )
