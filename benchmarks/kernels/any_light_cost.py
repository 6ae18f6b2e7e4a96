"""What does an unnamed light cost in processor time? `python -m benchmarks.kernels.any_light_cost`

One shot of a phone and 24 patches under D55. A call with one lamp by its name; the call that weighs four kinds at
once; a call by each kind, and one with its smooth error as modes, which gives the light; then the models' calls
of an answer whose basis the signals choose, with the lamp named and not, as Kotlin makes them. Contenders in turn,
medians, one thread. Bar: four kinds weighed at most 3 times one name; exit status 1 where missed.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.kernels.turns import clocked, in_turn
from benchmarks.shared import command_parser, console, one_thread, save, table, versions
from camssf.grid import Floats
from camssf.recovery.basis import read_basis
from camssf.recovery.evidence import log_evidences
from camssf.recovery.hypotheses import FAMILIES, NARROW, LampGuess, recover
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import load_model
from camssf.recovery.sensitivity import solve_on_basis
from camssf.recovery.unnamed_light import by_modes
from camssf.spectra import read_chart, read_lamp
from camssf.spectra.lights import unnamed_light

BAR = 3.0
"""Calls with four kinds, in calls with one lamp."""


def named() -> Observation:
    """The mean phone under D55, by its name."""
    chart, lamp = read_chart("classic24"), read_lamp("D55")
    s = read_basis("phones").mean.T
    y = ((chart.values * lamp.values) @ s) / (lamp.values @ s)
    return Observation(
        y[None], chart.values, lamp.values[None], standard_error=np.hypot(0.005 * y, 0.001)[None],
        chart_tolerance=chart.tolerance, lamp_tolerance=np.array([lamp.tolerance]),
    )  # fmt: skip


def weigh(guesses: Sequence[LampGuess], basis: str) -> Floats:
    """The model's evidence of each guess, in one call."""
    observations = [guess.observation for guess in guesses]
    first, most = observations[0], max(observation.lamp_modes.shape[1] for observation in observations)
    modes = [
        np.pad(observation.lamp_modes, ((0, 0), (0, most - observation.lamp_modes.shape[1]), (0, 0)))
        for observation in observations
    ]
    one = np.ones_like(first.signals)
    given = {name: getattr(first, name) for name in ("chart_tolerance", "white_tolerance", "gain_own")}
    given |= {name: getattr(first, name)[None] for name in ("standard_error", "reflectance", "white_reflectance")}
    given |= {name: np.stack([getattr(each, name) for each in observations]) for name in ("lamp", "lamp_tolerance")}
    given |= {"chart": first.signals[None], "white": one, "dark": 0 * one, "gain_modes": 0 * one[:, None, :, 0]}
    given |= {"lamp_modes": np.stack(modes), "prior_scale": 1.0, "solve": 0.0, "explain": 0.0}
    given |= {"l2": 1.0, "gamma": 0.05, "nonnegative": 0.0}
    inputs = {name: np.asarray(value, float) for name, value in given.items()}
    model = load_model(basis)
    return np.asarray(model.session.run(["evidence"], inputs | model.arrays)[0])


def main(arguments: list[str] | None = None) -> int:
    """Measure; 1 where the bar is missed."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--rounds", type=int, default=31)
    rounds = parser.parse_args(arguments).rounds
    given = named()
    guesses = [
        LampGuess((kind.name,), replace(given, lamp=kind.values[None], lamp_tolerance=np.array([kind.tolerance]),
                                    lamp_modes=kind.modes[None]), 0.0)
        for kind in unnamed_light().lamps
    ]  # fmt: skip
    exact = log_evidences([guess.observation for guess in guesses], read_basis("phones"))
    assert np.abs(weigh(guesses, "phones") - exact).max() <= 1e-9 * np.abs(exact).max()
    calls: dict[str, Callable[[], object]] = {
        "one lamp, by name": lambda: solve_on_basis(given, "phones"),
        "four kinds, weighed": lambda: weigh(guesses, "phones"),
    }
    for guess in guesses:
        calls[f"{guess.kinds[0]}, by kind"] = lambda guess=guess: solve_on_basis(guess.observation, "phones")  # type: ignore[misc]
        calls[f"{guess.kinds[0]}, its light"] = lambda guess=guess: solve_on_basis(
            by_modes(guess.observation), "phones"
        )  # type: ignore[misc]
    calls["an answer, lamp named"] = lambda: recover(given)
    calls["an answer, four kinds weighed"] = lambda: [weigh(guesses, name) for name in FAMILIES]
    found = recover(guesses)
    by_name = {guess.kinds[0]: guess for guess in guesses}
    solved = [weight for weight in found.choice if weight.probability >= 0.001]
    calls["an answer's curves"] = lambda: [
        solve_on_basis(by_name[each.kinds[0]].observation, each.basis, prior_scale=scale)
        for each in solved
        for scale in ((NARROW, 1.0) if each.basis != "cameras" else (1.0,))
    ]
    calls["an answer's lights"] = lambda: [
        solve_on_basis(by_modes(by_name[each.kinds[0]].observation), each.basis) for each in solved
    ]
    times = in_turn({name: clocked(call, time.process_time) for name, call in calls.items()}, rounds)
    one = statistics.median(times["one lamp, by name"])
    rows = [[name, 1e3 * statistics.median(each), statistics.median(each) / one] for name, each in times.items()]
    console().print(table("Processor time, one shot, 24 patches", ["what", "ms", "of one lamp"], rows))
    kinds = statistics.median(times["four kinds, weighed"]) / one
    whole = sum(
        statistics.median(times[name]) for name in times if name.startswith("an answer") and "named" not in name
    )
    whole /= statistics.median(times["an answer, lamp named"])
    print(f"four kinds: {kinds:.1f} calls with one lamp (bar {BAR:g}): {'held' if kinds <= BAR else 'MISSED'}")
    print(f"a whole answer with its lights ({len(solved)}): {whole:.1f} times the answer with the lamp named")
    document = {"rows": rows, "kinds": kinds, "whole": whole, "versions": versions()}
    print(f"written: {save('any_light_cost', document)}")
    return int(kinds > BAR)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
