"""Observations as the arrays that the formulas take: hypotheses on a capture, the inputs of a model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import Basis
from camssf.recovery.observation import Observation
from camssf.recovery.rows import Hypotheses

OF_HYPOTHESES = (
    "chart", "standard_error", "reflectance", "white_reflectance", "lamp", "lamp_tolerance", "lamp_modes",
)  # fmt: skip
"""Inputs with a leading axis of hypotheses."""


def observation_arrays(observation: Observation, basis: Basis) -> dict[str, Floats]:
    """What is known of a capture by the names of the model's inputs; one mode of zeros where there is none."""
    k, n, _ = observation.signals.shape
    lamp_modes, gain_modes = observation.lamp_modes, observation.gain_modes
    return {
        "standard_error": observation.errors(basis),
        "reflectance": observation.reflectance,
        "chart_tolerance": observation.chart_tolerance,
        "white_reflectance": observation.white_reflectance,
        "white_tolerance": np.array(observation.white_tolerance),
        "lamp": observation.lamp,
        "lamp_tolerance": observation.lamp_tolerance,
        "lamp_modes": lamp_modes if lamp_modes.shape[1] else np.zeros((k, 1, WAVELENGTHS.size)),
        "gain_modes": gain_modes if gain_modes.shape[1] else np.zeros((k, 1, n)),
        "gain_own": np.array(observation.gain_own),
    }


def stacks_of(
    observations: Sequence[Observation], further: Callable[[int], tuple[object, ...]]
) -> Iterator[list[int]]:
    """The observations' numbers, those together that make a stack: they differ in the inputs of OF_HYPOTHESES alone.

    `further` gives what else an observation has in common with the others of its stack.
    """
    stacks: dict[tuple[object, ...], list[int]] = {}
    for i, one in enumerate(observations):
        modes, gains = one.lamp_modes, one.gain_modes
        numbers = one.white_tolerance, one.gain_own, bool(modes.any()), modes.shape, gains.shape
        key = (one.chart_tolerance.tobytes(), gains.tobytes(), *numbers, *further(i))
        stacks.setdefault(key, []).append(i)
    yield from stacks.values()


def hypotheses_of(observations: Sequence[Observation], basis: Basis) -> Hypotheses:
    """Observations that differ in signals, their errors, chart or lamps, and have the rest in common, as a stack."""
    arrays = [{"signals": one.signals} | observation_arrays(one, basis) for one in observations]
    single = [
        names
        for names in (("signals", "standard_error"), ("reflectance", "white_reflectance"))
        if all(np.array_equal(one[name], arrays[0][name]) for one in arrays for name in names)
    ]
    stacked = {
        name: np.stack([one[name] for one in (arrays[:1] if any(name in names for names in single) else arrays)])
        for name in ("signals", *OF_HYPOTHESES)
        if name in arrays[0]
    }
    common = {name: value for name, value in arrays[0].items() if name not in stacked}
    mean, dictionary = basis.mean[None, :, ::10], basis.dictionary[None, :, ::10]
    return Hypotheses(mean=mean, dictionary=dictionary, **common, **stacked)


def basis_arrays(basis: Basis, atoms: int) -> dict[str, Floats]:
    """The inputs `mean` and `dictionary` of a basis, with atoms of zeros, which change nothing, up to a number."""
    mean, dictionary = basis.mean[None, :, ::10], basis.dictionary[None, :, ::10]
    return {"mean": mean, "dictionary": np.pad(dictionary, ((0, 0),) * 3 + ((0, atoms - dictionary.shape[-1]),))}


def with_hypothesis(inputs: Mapping[str, Floats]) -> dict[str, Floats]:
    """The inputs of a model with the axis of one hypothesis."""
    given = {name: np.asarray(value, float) for name, value in inputs.items()}
    return given | {name: given[name][None] for name in OF_HYPOTHESES if name in given}


def of_hypothesis(outputs: Mapping[str, Floats]) -> dict[str, Floats]:
    """The outputs of a model for its first hypothesis, without that axis."""
    return {name: value if name == "channel_gain" else value[0] for name, value in outputs.items()}
