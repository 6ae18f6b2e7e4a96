"""The estimated lights of a result, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from camssf.documents.document import Answer
from camssf.recovery.sensitivity import EstimatedLamp
from camssf.spectra import Light
from camssf.spectra.lights import Called
from camssf.verdict.assumptions import called_in_words

NAMES = {"auto": "light not named", "torch": "the phone's torch"}
"""What an unnamed light is called for a reader."""
SHOWN = 0.05
"""Smallest probability of a kind that is shown."""
OF_LIGHT = ("lamp", "lamp modes", "which lamp")
"""Sources of the budget that a known lamp would remove or reduce."""


def lights_of(answer: Answer | None) -> list[tuple[int, EstimatedLamp]]:
    """Number, from 1, of each shot whose light was estimated, and the estimate."""
    return [] if answer is None else [(j, light) for j, light in enumerate(answer.lights, 1) if light is not None]


def lamp_name(lamp: Light) -> str:
    """The name of a lamp as given, or what an unnamed light is called."""
    return NAMES.get(lamp.name, lamp.name)


def kinds_in_words(kinds: Mapping[str, float]) -> str:
    """The kinds as `daylight 90 %, white-led 5 %`, the most probable first."""
    likely = sorted(kinds.items(), key=lambda kind: -kind[1])
    return ", ".join(f"{kind} {100 * share:.0f} %" for kind, share in likely if share >= SHOWN)


def weighed_kinds_in_words(lamps: Sequence[tuple[str, float]]) -> str:
    """How the kinds of a photo's unnamed light were weighed for a colour; "" for a lamp that was named."""
    if len(lamps) == 1:
        return ""
    return (
        f"the light was not named: {kinds_in_words(dict(lamps))}, as the white reference says; the intervals include "
        "what that leaves open"
    )


def light_in_words(lamp: Light, light: EstimatedLamp) -> str:
    """One line: what it was called, the kinds, and the correlated colour temperature with one standard deviation."""
    if isinstance(lamp, Called):
        return called_in_words(lamp.name, light)
    return f"{kinds_in_words(light.kinds)}; {light.kelvin:,.0f} ± {light.kelvin_std:,.0f} K"


def cost_of(answer: Answer | None) -> list[float] | None:
    """Share of each channel's variance that the light causes; None without a budget."""
    budget = () if answer is None or answer.uncertainty is None else answer.uncertainty.budget
    shares = [source.share.tolist() for source in budget if source.source in OF_LIGHT]
    return [float(sum(channel)) for channel in zip(*shares, strict=True)] if shares else None
