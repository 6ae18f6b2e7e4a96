"""A result document's lights that nobody named, in words."""

from __future__ import annotations

from typing import Any, TypeAlias

Json: TypeAlias = dict[str, Any]

SHOWN = 0.005
"""A kind less probable than this goes unsaid."""
OF_LIGHT = ("lamp", "lamp modes", "which lamp")
"""Sources of the budget that a known lamp would take away, or make small."""


def lights_of(document: Json) -> list[tuple[int, Json]]:
    """The number of each shot whose light was not named, from 1, and what the signals say of it."""
    return [(j, shot["light"]) for j, shot in enumerate(document.get("shots") or [], 1) if "light" in shot]


def kinds_in_words(light: Json) -> str:
    """`daylight 90 %, white-led 5 %`, the likeliest first."""
    likely = sorted(light["kinds"].items(), key=lambda each: -each[1])
    return ", ".join(f"{kind} {100 * share:.0f} %" for kind, share in likely if share >= SHOWN)


def light_in_words(light: Json) -> str:
    """One line: kinds, and the correlated colour temperature with one standard deviation."""
    return f"{kinds_in_words(light)}; {light['kelvin']:,.0f} ± {light['kelvin_std']:,.0f} K"


def cost_of(document: Json) -> list[float] | None:
    """Share of each channel's variance that the light is to blame for; None where there is no budget."""
    rows = (document.get("uncertainty") or {}).get("budget") or []
    shares = [row["share"] for row in rows if row["source"] in OF_LIGHT]
    return [float(sum(each)) for each in zip(*shares, strict=True)] if shares else None
