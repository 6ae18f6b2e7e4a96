"""Writes colours as "camssf-colour/1" and conversions as "camssf-between/1".

Their schemas are data/colour.schema.json and data/between.schema.json.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from camssf.colour.between import Conversion, Converted
from camssf.colour.reach import REACH
from camssf.colour.regions import Region
from camssf.colour.standard import Colours
from camssf.grid import Floats
from camssf.version import __version__

FORMAT = "camssf-colour/1"
BETWEEN = "camssf-between/1"
OBSERVERS = {"1931": "CIE 1931 2°", "1964": "CIE 1964 10°"}


def colour_document(
    colours: Colours, signals: Floats, errors: Floats, regions: Sequence[Region], white: Region, about: dict[str, Any]
) -> dict[str, Any]:
    """The document of colours measured in a photo.

    Args:
        colours: m colours.
        signals, errors: (m, 3) signals and standard errors that the colours were computed from.
        regions: where these were measured.
        white: the reference.
        about: `result`, `photo` and `reference` as in the schema, `lamp` as the user gave it.
    """
    return {
        "format": FORMAT,
        "generator": {"name": "camssf", "version": __version__},
        "result": about["result"],
        "photo": about["photo"],
        "observer": OBSERVERS[colours.view.observer],
        "white": {"of": colours.view.white, "xyz": colours.white.tolist()},
        "lamp": {
            "asked": about["lamp"],
            "weights": [{"name": name, "weight": weight} for name, weight in colours.lamps],
            "chi_squared": colours.chi_squared,
        },
        "reference": about["reference"] | {"rectangle": list(white.rectangle), "raw": white.raw.tolist()},
        "regions": [_region(colours, signals, errors, region, i) for i, region in enumerate(regions)],
    }


def _region(colours: Colours, signals: Floats, errors: Floats, region: Region, i: int) -> dict[str, Any]:
    far = bool(colours.reach[i] > REACH)
    found: dict[str, Any] = {
        "rectangle": list(region.rectangle),
        "status": "colour_out_of_reach" if far else "ok",
        "reach": None if np.isnan(colours.reach[i]) else float(colours.reach[i]),
        "signal": signals[i].tolist(),
        "standard_error": errors[i].tolist(),
    }
    if far:
        return found
    return found | {
        "xyz": colours.xyz[i].tolist(),
        "xyz_covariance": colours.xyz_covariance[i].tolist(),
        "lab": colours.lab[i].tolist(),
        "lab_covariance": colours.lab_covariance[i].tolist(),
        "parts": {name: np.sqrt(np.diagonal(part[1][i])).tolist() for name, part in colours.parts.items()},
    }


def between_document(found: Converted, signals: Floats, errors: Floats, about: dict[str, Any]) -> dict[str, Any]:
    """The document of signals converted from one camera to another.

    Args:
        found: m converted signals.
        signals, errors: (m, 3) signals and standard errors that were converted.
        about: `from`, `to` and `photo` as in the schema, `lamp` as the user gave it, `regions`: m entries, each a
            rectangle or None.
    """
    return {
        "format": BETWEEN,
        "generator": {"name": "camssf", "version": __version__},
        "from": about["from"],
        "to": about["to"],
        "photo": about["photo"],
        "lamp": {
            "asked": about["lamp"],
            "weights": [{"name": name, "weight": weight} for name, weight in found.lamps],
            "chi_squared": found.chi_squared,
        },
        "conversions": [_conversion(each) for each in found.conversions],
        "signals": [_converted(found, signals, errors, rectangle, i) for i, rectangle in enumerate(about["regions"])],
    }


def _conversion(each: Conversion) -> dict[str, Any]:
    whites = [white.tolist() if np.isfinite(white).all() else None for white in each.whites]
    return {
        "lamp": each.lamp,
        "kind": each.kind,
        "coefficients": each.coefficients.tolist(),
        "matrix": each.matrix.tolist(),
        "rms": each.rms,
        "white": {"from": whites[0], "to": whites[1]},
    }


def _converted(
    found: Converted, signals: Floats, errors: Floats, rectangle: list[float] | None, i: int
) -> dict[str, Any]:
    far = bool(found.reach[i] > REACH)
    said: dict[str, Any] = {
        "rectangle": rectangle,
        "status": "colour_out_of_reach" if far else "ok",
        "reach": None if np.isnan(found.reach[i]) else float(found.reach[i]),
        "signal": signals[i].tolist(),
        "standard_error": errors[i].tolist(),
    }
    if far:
        return said
    return said | {
        "converted": found.signals[i].tolist(),
        "covariance": found.covariance[i].tolist(),
        "parts": {name: np.sqrt(np.diagonal(part[i])).tolist() for name, part in found.parts.items()},
    }
