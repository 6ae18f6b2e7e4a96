"""The unnamed lights of a result document, in words."""

from __future__ import annotations

from typing import Any, TypeAlias

Json: TypeAlias = dict[str, Any]

NAMES = {"auto": "light not named", "torch": "the phone's torch"}
"""What an unnamed light is called for a reader."""
SHOWN = 0.05
"""Smallest probability of a kind that is shown."""
OF_LIGHT = ("lamp", "lamp modes", "which lamp")
"""Sources of the budget that a known lamp would remove or reduce."""


def lights_of(document: Json) -> list[tuple[int, Json]]:
    """Number, from 1, of each shot whose light was not named, and the estimate of its light."""
    return [(j, shot["light"]) for j, shot in enumerate(document.get("shots") or [], 1) if "light" in shot]


def lamp_name(shot: Json) -> str:
    """The name of a shot's lamp as given, or what an unnamed light is called."""
    name = str(shot["lamp"]["name"])
    return NAMES.get(name, name)


def kinds_in_words(light: Json) -> str:
    """The kinds as `daylight 90 %, white-led 5 %`, the most probable first."""
    likely = sorted(light["kinds"].items(), key=lambda each: -each[1])
    return ", ".join(f"{kind} {100 * share:.0f} %" for kind, share in likely if share >= SHOWN)


def light_in_words(light: Json) -> str:
    """One line: kinds, and the correlated colour temperature with one standard deviation."""
    return f"{kinds_in_words(light)}; {light['kelvin']:,.0f} ± {light['kelvin_std']:,.0f} K"


def cost_of(document: Json) -> list[float] | None:
    """Share of each channel's variance that the light causes; None without a budget."""
    rows = (document.get("uncertainty") or {}).get("budget") or []
    shares = [row["share"] for row in rows if row["source"] in OF_LIGHT]
    return [float(sum(each)) for each in zip(*shares, strict=True)] if shares else None
