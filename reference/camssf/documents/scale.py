"""Computes the relative scale of the three channels, which curves normalised to peak 1 have lost."""

from __future__ import annotations

from typing import Any

import numpy as np

from camssf.errors import CalibrationError, InvalidArgument
from camssf.grid import CHANNELS, Floats
from camssf.spectra import read_chart, read_lamp
from camssf.spectra.text import looks_like_file


def channel_scale(document: dict[str, Any]) -> Floats | None:
    """Factors (3,), the largest 1, that turn the document's curves of peak 1 into the camera's own curves.

    A raw white signal is g_c = k_c Σ ρ_w L s_c dλ with the curve s_c of peak 1, the first shot's lamp L and the
    reflectance ρ_w of its white reference. `channel_gain` holds g_c / g_green, so k_c = g_c / Σ ρ_w L s_c dλ: the
    curves k_c s_c reproduce the raw signals of white, and so the camera's white balance.

    None if the first shot's lamp is neither in the document nor available here, or a channel has no white signal.
    """
    shot = document["shots"][0]
    white = _lamp(shot)
    if white is None:
        return None
    if shot["white_reference"] == "white patch":
        white = white * _white_patch(document["chart"])
    seen = np.array([white @ np.array(document["ssf"][channel]) for channel in CHANNELS])
    raw = np.array(document["channel_gain"], dtype=np.float64)
    if not ((raw > 0).all() and (seen > 0).all()):
        return None
    scale = raw / seen
    return np.asarray(scale / scale.max())


def no_scale(lamp: str) -> InvalidArgument:
    """The error to raise if `channel_scale` is None; `lamp` is the name of the first shot's lamp."""
    return InvalidArgument(
        f"The scale between the channels of this result is unknown: the lamp of its first shot, {lamp}, is missing, "
        "or a channel has no response under it.",
        "Put the lamp's file back, or calibrate again: new results store the lamp's spectrum.",
    )


def _lamp(shot: dict[str, Any]) -> Floats | None:
    """Power (681,): the estimate of an unnamed light, else the document's spectrum, else the lamp of that name."""
    found: dict[str, Any] | None
    for found in (shot.get("light"), shot["lamp"]):
        if found is not None and "power" in found:
            return np.array(found["power"], dtype=np.float64)
    try:
        return read_lamp(shot["lamp"]["name"]).values
    except CalibrationError:  # an older result without spectrum, whose lamp was a file
        return None


def _white_patch(chart: dict[str, Any]) -> Floats:
    """Reflectance (681,) of the white patch of the chart's table; for a measured table, of the printed chart."""
    for name in (chart["name"], chart["layout"]):
        if looks_like_file(name):
            continue
        try:
            table = read_chart(name)
        except CalibrationError:
            continue
        return np.asarray(table.values[table.white])
    return np.ones(1)
