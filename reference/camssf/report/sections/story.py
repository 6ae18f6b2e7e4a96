"""The sections about the solution: basis, light, colour quality, proof of optimality."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from camssf.colour.indices import quality_of
from camssf.documents.basis_choice import choice_of
from camssf.documents.unnamed_light import cost_of, kinds_in_words, lamp_name
from camssf.errors import CalibrationError
from camssf.grid import CHANNELS, columns
from camssf.report.sections.drawings import Plot, light_plot
from camssf.report.sections.text import Json, brief, number, percent

COLOUR_LAMPS = ("D65", "A")


def proof_of(document: Json) -> Markup | None:
    """One line about the proof of optimality: the duality gap of the layers, and the steps of exact pivoting."""
    if "layers_gap" not in document or "finish_steps" not in document:
        return None
    largest, steps = max(document["layers_gap"]), document["finish_steps"]
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


def basis_of(document: Json) -> Choice | None:
    """The choice of basis; None if the basis was given."""
    found = choice_of(document)
    if found is None:
        return None
    weighed = document["choice"]
    best = max(each["log_evidence"] for each in weighed)
    together: dict[str, tuple[float, float]] = {}
    for each in weighed:  # summed over kinds of unnamed light
        nats, share = together.get(each["basis"], (-math.inf, 0.0))
        own = max(nats, each["log_evidence"]), share + each["probability"]
        together[each["basis"]] = own
    rows = tuple(
        (basis, f"{nats - best:.1f}".replace("-", "\u2212"), percent(share))
        for basis, (nats, share) in together.items()
    )
    return Choice(found.words, rows)


# The light


@dataclass(frozen=True)
class LightStory:
    """A shot's light.

    Attributes:
        shot: from 1. name: as it was given.
        named: whether it was given; else it was estimated from the signals.
        words: its tolerance, or its kind.
        kinds: name, probability and its text for each kind, the most probable first; empty for a named lamp.
        plot: its power with its band; None if the document does not hold it.
    """

    shot: int
    name: str
    named: bool
    words: str
    kinds: tuple[tuple[str, float, str], ...]
    plot: Plot | None


@dataclass(frozen=True)
class Lights:
    """The lights of all shots, and the share of the variance that unnamed lights cause."""

    shots: tuple[LightStory, ...]
    cost: str

    @property
    def named(self) -> bool:
        """Whether all lights were named."""
        return all(light.named for light in self.shots)

    @property
    def several(self) -> bool:
        """Whether a light was estimated as one of several kinds."""
        return any(len(light.kinds) > 1 for light in self.shots)


def lights_of(document: Json) -> Lights | None:
    """The lights of a document; None if it holds no light's power."""
    lights = tuple(_light(number, shot) for number, shot in enumerate(document["shots"], 1))
    if not any(light.plot for light in lights):
        return None
    cost = None if all(light.named for light in lights) else cost_of(document)
    words = "" if cost is None else ", ".join(f"{c} {100 * v:.0f} %" for c, v in zip(CHANNELS, cost, strict=True))
    return Lights(lights, words)


def _light(number: int, shot: Json) -> LightStory:
    lamp, found = shot["lamp"], shot.get("light")
    name = f"light-{number}"
    if found is not None:
        words = (
            f"{kinds_in_words(found)}. Correlated colour temperature {found['kelvin']:,.0f} ± "
            f"{found['kelvin_std']:,.0f} K (one standard deviation)."
        )
        kinds = sorted(found["kinds"].items(), key=lambda each: -each[1])
        shares = tuple((kind, share, percent(share)) for kind, share in kinds)
        plot = light_plot(np.array(found["power"]), np.array(found["std"]), name)
        return LightStory(number, lamp_name(shot), False, words, shares, plot)
    tolerance, power = lamp["tolerance"], lamp.get("power")
    words = "" if tolerance is None else f"Taken for right to {brief(100 * tolerance)} % (one standard deviation)."
    drawn = None if power is None else light_plot(np.array(power), np.array(power) * (tolerance or 0.0), name)
    return LightStory(number, lamp["name"], True, words, (), drawn)


# Colour


@dataclass(frozen=True)
class Colour:
    """The colour quality of the curves in words, and the rows of the matrices."""

    words: str
    rows: tuple[tuple[str, tuple[Markup, ...]], ...]


def colour_of(document: Json) -> Colour | None:
    """Luther condition, SMI, and the matrices for two lamps; they depend on the curves only, not on the photos."""
    try:
        found = [quality_of(columns(document["ssf"]), lamp) for lamp in COLOUR_LAMPS]
    except (CalibrationError, np.linalg.LinAlgError):  # curves of a foreign document may give no signal
        return None
    rows = tuple(
        (f"{word} from {each.lamp}'s camera RGB", tuple(number(value, 5) for value in row))
        for each in found
        for word, row in zip("XYZ", each.matrix.coefficients.T.tolist(), strict=True)
    )
    misses = "; ".join(
        f"under {each.lamp} {each.matrix.delta_e00['matrix']:.2f} by a matrix, "
        f"{each.polynomial.delta_e00['root-polynomial']:.2f} by a root-polynomial"
        for each in found
    )
    first = found[0]
    return Colour(
        f"Sensitivity metamerism index {first.smi:.0f} (100 is an observer's). No matrix of the curves gives "
        f"{100 * first.luther:.0f} % of the CIE 1931 observer (Luther condition: 0 %). Mean ΔE00 of surfaces that "
        f"the fit had not seen: {misses}.",
        rows,
    )
