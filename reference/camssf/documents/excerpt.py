"""The part of a result that a passport holds: curves, bands, verdict and provenance, without the single patches.

A whole result is too large for a token that other programs accept (128,000 bytes). The whole result.json stays
outside the passport, which holds its SHA-256.
"""

from __future__ import annotations

import json
from typing import Any, TypeAlias

from camssf.files import readable

Json: TypeAlias = dict[str, Any]

DECIMALS = 5
"""Decimals of curves (peak 1) and bands: at most a fiftieth of the narrowest band."""
_LEFT_OUT = ("code_covariance", "truth", "excerpt")
_LEFT_OUT_OF_SHOTS = ("light",)


def excerpt(document: Json) -> Json:
    """The excerpt of a result for a passport.

    All members are kept except `code_covariance`, `truth`, and, in each shot, the light's spectra, the chart's pose
    and its patches. Curves and bands are rounded to five decimals.

    Args:
        document: a result with curves, already checked.
    """
    kept = {name: value for name, value in document.items() if name not in _LEFT_OUT}
    for name in ("ssf", "ssf_std"):
        if kept.get(name) is not None:
            kept[name] = {
                key: values if key == "wavelength_nm" else [round(value, DECIMALS) for value in values]
                for key, values in kept[name].items()
            }
    kept["shots"] = [_shot(shot) for shot in document["shots"]]
    return dict(json.loads(readable(json.dumps(kept, ensure_ascii=False))))  # replaces lone surrogates


def _shot(shot: Json) -> Json:
    kept = {name: value for name, value in shot.items() if name not in _LEFT_OUT_OF_SHOTS}
    lamp = {name: value for name, value in shot["lamp"].items() if name != "power"}
    return kept | {"lamp": lamp, "pose": None, "patches": []}
