"""Lamps and charts in the words that people know: kinds of light and daylight first, charts by their products."""

from __future__ import annotations

from functools import cache
from typing import TypeAlias

from camssf.spectra.bundled import bundled
from camssf.spectra.families import FAMILIES
from camssf.spectra.lamps import LampAlias, lamp_aliases, lamp_names
from camssf.spectra.layouts import LAYOUTS

Group: TypeAlias = tuple[str, list[tuple[str, str]]]
"""A heading, and pairs of a name and its words."""

CHART_MENU = {layout.name: layout.products for layout in LAYOUTS.values()}
"""The products by the chart's name. "sg140" needs a table of the user's own."""
SHOWN = 3
"""Number of common names that a lamp's words begin with."""
CODES = "by code"
"""Heading of the group that holds every lamp by its name alone."""


@cache
def lamp_menu() -> tuple[Group, ...]:
    """Every lamp that can be chosen: kinds of light, daylight by temperature, lamps by common names, all codes."""
    named = [alias for alias in lamp_aliases() if alias.lamp]
    kelvin = {name: value for name, value in bundled()["kelvin"].items() if name.startswith("D")}
    return (
        ("kinds of light", [(kind, _words(alias)) for kind in FAMILIES for alias in named if alias.lamp == kind]),
        (
            "daylight",
            [(name, f"Daylight of {round(value, -2):.0f} K ({name})") for name, value in kelvin.items()],
        ),
        ("lamps by their names", [(alias.lamp, _words(alias)) for alias in named if alias.lamp not in FAMILIES]),
        (CODES, [(name, name) for name in lamp_names() if name not in FAMILIES]),
    )


def _words(alias: LampAlias) -> str:
    words = f"{', '.join(alias.names[:SHOWN])}: {alias.what}"
    return words[0].upper() + words[1:]
