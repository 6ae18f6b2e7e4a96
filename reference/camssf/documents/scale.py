"""Computes the relative scale of the three channels, which curves normalised to peak 1 have lost."""

from __future__ import annotations

import numpy as np

from camssf.documents.document import Answer, Document, answer_in
from camssf.documents.stored_lamp import lamp_of
from camssf.errors import InvalidArgument
from camssf.grid import Floats


def channel_scale(document: Document) -> Floats:
    """Factors (3,), the largest 1, that turn a result's curves of peak 1 into the camera's own curves.

    A raw white signal is g_c = k_c Σ ρ_w L s_c dλ with the curve s_c of peak 1, the first shot's lamp L and the
    reflectance ρ_w of its white reference. `channel_gain` holds g_c / g_green, so k_c = g_c / Σ ρ_w L s_c dλ: the
    curves k_c s_c reproduce the raw signals of white, and so the camera's white balance.

    Raises:
        InvalidArgument: the result was refused, or a channel has no white signal.
    """
    answer, capture = answer_in(document), document.capture
    lamp = lamp_of(document, 0)
    assert capture is not None
    assert lamp is not None
    white, table = lamp.values, capture.chart
    if capture.shots[0].means.white is None:
        white = white * table.values[table.white]
    scale = scale_under(answer, white)
    if scale is None:
        raise InvalidArgument(
            "The scale between the channels of this result is unknown: a channel has no response under the lamp of "
            f"its first shot, {lamp.name}.",
            "Calibrate again under a lamp that all channels see.",
        )
    return scale


def scale_under(answer: Answer, white: Floats) -> Floats | None:
    """`channel_scale` of an answer, with ρ_w L (681,) of the first shot; None if a channel has no white signal."""
    integrals, raw = white @ answer.curves.values, answer.channel_gain
    if not ((raw > 0).all() and (integrals > 0).all()):
        return None
    scale = raw / integrals
    return np.asarray(scale / scale.max())
