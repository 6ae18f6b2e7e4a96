"""The part of a result that a passport holds: curves, bands, verdict, what it was made from; not the single patches.

Whole, a result is too large for a token that other programs accept (128,000 bytes). The whole result.json stands
outside of the passport and is tied to it by its SHA-256.
"""

from __future__ import annotations

import json
from typing import Any, TypeAlias

from camssf.files import readable

Json: TypeAlias = dict[str, Any]

DECIMALS = 5
"""Of the curves and their bands, whose peak is 1: a fiftieth of the narrowest band, or less."""
_LEFT_OUT = ("code_covariance", "truth", "excerpt")
_LEFT_OUT_OF_SHOTS = ("light",)


def excerpt(document: Json) -> Json:
    """What a passport holds of a result.

    Every member as it is, but: `code_covariance` and `truth` are left out, and of each shot the light's spectra, the
    chart's pose and its patches; curves and bands have five decimals.

    Args:
        document: a result with curves, checked against its form.
    """
    kept = {name: value for name, value in document.items() if name not in _LEFT_OUT}
    for name in ("ssf", "ssf_std"):
        if kept.get(name) is not None:
            kept[name] = {
                key: values if key == "wavelength_nm" else [round(value, DECIMALS) for value in values]
                for key, values in kept[name].items()
            }
    kept["shots"] = [_shot(shot) for shot in document["shots"]]
    return dict(json.loads(readable(json.dumps(kept, ensure_ascii=False))))  # half a character as it is written


def _shot(shot: Json) -> Json:
    kept = {name: value for name, value in shot.items() if name not in _LEFT_OUT_OF_SHOTS}
    lamp = {name: value for name, value in shot["lamp"].items() if name != "power"}
    return kept | {"lamp": lamp, "pose": None, "patches": []}
