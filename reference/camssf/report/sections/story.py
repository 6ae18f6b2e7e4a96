"""The sections about the solution: basis, light, proof of optimality."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from camssf.documents.basis_choice import choice_of
from camssf.documents.document import Answer
from camssf.documents.unnamed_light import cost_of, kinds_in_words, lamp_name
from camssf.grid import CHANNELS
from camssf.recovery.sensitivity import Proof
from camssf.recovery.unnamed_light import NAMED
from camssf.report.sections.drawings import light_plot
from camssf.report.sections.text import brief, number, percent
from camssf.report.shots import ShownShot
from camssf.report.svg import Plot
from camssf.spectra import Lamp
from camssf.spectra.lights import Called
from camssf.verdict.assumptions import called_in_words

ESTIMATED = "The light estimated from the signals: the mean over its kinds, and its 95 % band."
CALLED = "The light by the signals, where the named lamp and others of its kind are possible, and its 95 % band."


def proof_of(proof: Proof) -> Markup:
    """One line about the proof of optimality: the duality gap of the layers, and the steps of exact pivoting."""
    largest, steps = proof.layers_gap.max(), proof.finish_steps.tolist()
    names = f" ({', '.join(CHANNELS)})" if len(steps) > 1 else ""
    counts = ", ".join(f"{count:.0f}" for count in steps)
    walked = f"took {counts} step{'' if steps == [1] else 's'} to it{names}" if any(steps) else "had nothing to do"
    return Markup(
        "The proof: the layers alone came within {} of the optimum (relative duality gap); the exact finish {}."
    ).format(number(max(largest, 0.0), 2), walked)


# The basis


@dataclass(frozen=True)
class Choice:
    """The chosen basis in sentences, and one row per hypothesis: basis, log evidence, probability."""

    words: tuple[str, ...]
    rows: tuple[tuple[str, str, str], ...]


def basis_of(answer: Answer | None) -> Choice | None:
    """The choice of basis; None if the basis was given."""
    chosen = choice_of(answer)
    if answer is None or chosen is None:
        return None
    best = max(hypothesis.log_evidence for hypothesis in answer.choice)
    together: dict[str, tuple[float, float]] = {}
    for hypothesis in answer.choice:  # summed over kinds of unnamed light
        nats, share = together.get(hypothesis.basis, (-math.inf, 0.0))
        together[hypothesis.basis] = max(nats, hypothesis.log_evidence), share + hypothesis.probability
    rows = tuple(
        (basis, f"{nats - best:.1f}".replace("-", "\u2212"), percent(share))
        for basis, (nats, share) in together.items()
    )
    return Choice(chosen.words, rows)


# The light


@dataclass(frozen=True)
class LightStory:
    """A shot's light.

    Attributes:
        shot: from 1. name: as it was given.
        estimated: whether it was estimated from the signals; else it was taken as it was given.
        caption: what its plot shows. words: its tolerance, or its kind.
        kinds: name, probability and its text for each kind, the most probable first; empty if no kinds were weighed.
        plot: its power with its band; None if it is not known.
    """

    shot: int
    name: str
    estimated: bool
    caption: str
    words: str
    kinds: tuple[tuple[str, float, str], ...]
    plot: Plot | None


@dataclass(frozen=True)
class Lights:
    """The lights of all shots, and the share of the variance that unnamed lights cause."""

    shots: tuple[LightStory, ...]
    cost: str

    @property
    def estimated(self) -> bool:
        """Whether a light was estimated."""
        return any(light.estimated for light in self.shots)

    @property
    def several(self) -> bool:
        """Whether a light was estimated as one of several."""
        return any(len(light.kinds) > 1 for light in self.shots)


def lights_of(answer: Answer | None, shots: Sequence[ShownShot]) -> Lights | None:
    """The lights of a result; None if no light's power is known."""
    lights = tuple(map(_light, shots))
    if not any(light.plot for light in lights):
        return None
    cost = cost_of(answer) if any(light.estimated for light in lights) else None
    words = "" if cost is None else ", ".join(f"{c} {100 * v:.0f} %" for c, v in zip(CHANNELS, cost, strict=True))
    return Lights(lights, words)


def _light(shot: ShownShot) -> LightStory:
    lamp, light, name = shot.lamp, shot.light, f"light-{shot.number}"
    if light is not None:
        called = isinstance(lamp, Called)
        words = called_in_words(lamp.name, light) if called else kinds_in_words(light.kinds)
        words = f"{words[0].upper()}{words[1:]}"
        if "±" not in words:
            words += f". Correlated colour temperature {light.kelvin:,.0f} ± {light.kelvin_std:,.0f} K"
        words += " (one standard deviation)."
        kinds = sorted(light.kinds.items(), key=lambda kind: -kind[1])
        weighed = not called or NAMED in light.kinds  # of a light called by its kind alone nothing else was possible
        shares = tuple((kind, share, percent(share)) for kind, share in kinds) if weighed else ()
        caption = CALLED if called else ESTIMATED
        plot = light_plot(light.power, light.std, name)
        return LightStory(shot.number, lamp_name(lamp), True, caption, words, shares, plot)
    if not isinstance(lamp, Lamp):
        return LightStory(shot.number, lamp.name, False, "", "", (), None)
    words = f"Taken for right to {brief(100 * lamp.tolerance)} % (one standard deviation)."
    power = lamp.values / lamp.values.mean()
    plot = light_plot(power, power * lamp.tolerance, name)
    return LightStory(shot.number, lamp.name, False, "The named lamp and its 95 % band.", words, (), plot)
