"""Converts results to objects of colour-science, pandas and xarray, which are imported on first use."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.documents.document import Document, answer_in
from camssf.documents.scale import channel_scale
from camssf.errors import InvalidArgument
from camssf.grid import CHANNELS, WAVELENGTHS
from camssf.libraries import library
from camssf.report.names import camera_of
from camssf.report.shots import shots_of
from camssf.spectra import colour_science

NEEDS = "This table needs"
TABLES = ("curves", "patches", "budget")
TRIPLES = ("signal", "standard_error", "predicted", "predicted_std", "unseen", "unseen_std")
"""Values of each patch and channel."""
PATCH_COLUMNS = ("shot", "lamp", "patch", "channel", "used", "level", *TRIPLES)


def to_colour(document: Document) -> Any:
    """The curves as RGB_CameraSensitivities, on the camera's own scale."""
    values, scale = answer_in(document).curves.values, channel_scale(document)
    science = colour_science()
    table = science.MultiSpectralDistributions(values * scale, WAVELENGTHS, labels=CHANNELS)
    return science.characterisation.RGB_CameraSensitivities(table, name=camera_of(document))


def to_pandas(document: Document, table: str) -> Any:
    """A DataFrame of curves, patches or the budget."""
    if table not in TABLES:
        raise InvalidArgument(f"There is no table {table!r}.", f"Take one of {', '.join(TABLES)}.")
    if table != "patches":
        answer_in(document)
    pandas = library("pandas", NEEDS, "notebook")
    if table == "patches":
        return pandas.DataFrame(patch_rows(document), columns=list(PATCH_COLUMNS))
    answer = answer_in(document)
    if table == "budget":
        parts = () if answer.uncertainty is None else answer.uncertainty.budget
        index = pandas.Index([part.source for part in parts], name="source")
        return pandas.DataFrame(np.reshape([part.share for part in parts], (-1, 3)), index, list(CHANNELS))
    curves = dict(zip(CHANNELS, answer.curves.values.T, strict=True))
    if answer.std is not None:
        names = [f"{channel}_std" for channel in CHANNELS]
        curves |= dict(zip(names, answer.std.values.T, strict=True))
    return pandas.DataFrame(curves, index=pandas.Index(WAVELENGTHS, name="wavelength_nm"))


def patch_rows(document: Document) -> list[tuple[Any, ...]]:
    """A row of PATCH_COLUMNS for each shot, patch and channel; what is not known is NaN."""
    return [
        (
            *(shot.number, shot.lamp.name, name, channel, bool(patches.used[i]), float(patches.level[i])),
            *(float(getattr(patches, word)[i, c]) for word in TRIPLES),
        )
        for shot in shots_of(document)
        if (patches := shot.patches) is not None
        for i, name in enumerate(patches.names)
        for c, channel in enumerate(CHANNELS)
    ]


def to_xarray(document: Document) -> Any:
    """A Dataset of curves and signals; missing values of a patch are NaN."""
    answer = answer_in(document)
    values: dict[str, Any] = {"ssf": (("wavelength", "channel"), answer.curves.values)}
    xarray = library("xarray", NEEDS, "notebook")
    if answer.std is not None:
        values["ssf_std"] = (("wavelength", "channel"), answer.std.values)
    shots = [(shot.lamp.name, shot.patches) for shot in shots_of(document) if shot.patches is not None]
    for name in TRIPLES:
        values[name] = (("shot", "patch", "channel"), np.stack([getattr(patches, name) for _, patches in shots]))
    values["used"] = (("shot", "patch"), np.stack([patches.used for _, patches in shots]))
    return xarray.Dataset(
        values,
        {
            "wavelength": ("wavelength", WAVELENGTHS, {"units": "nm"}),
            "channel": list(CHANNELS),
            "lamp": ("shot", [lamp for lamp, _ in shots]),
            "patch": list(shots[0][1].names),
        },
        {
            "camera": camera_of(document),
            "verdict": "" if document.verdict is None else document.verdict.status,
            "basis": answer.basis,
            "scale": "each channel's peak = 1",
        },
    )
