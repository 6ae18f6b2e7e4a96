"""What does an unnamed light cost in runs of the models? `python -m benchmarks.kernels.any_light_cost`

One shot of a phone and 24 patches under D55. A call with one lamp by its name, a call by each kind, and a call with
the lamp's smooth error as modes, which tells the light; then all calls of an answer whose basis the signals choose,
with the lamp named and not. Contenders in turn, medians of processor time, one thread. Bar: four kinds at most 3
times one name; exit status 1 where it is missed.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.shared import command_parser, console, one_thread, save, table, versions
from camssf.grid import Floats
from camssf.recovery.basis import read_basis
from camssf.recovery.hypotheses import FAMILIES, recover
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import Model
from camssf.recovery.sensitivity import answer
from camssf.recovery.unnamed_light import LampGuess, by_modes, recover_in_any_light
from camssf.spectra import Unnamed, read_chart, read_lamp

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


def main(arguments: list[str] | None = None) -> int:
    """Measure; 1 where the bar is missed."""
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--rounds", type=int, default=31)
    rounds = parser.parse_args(arguments).rounds
    given = named()
    guesses = [
        LampGuess((kind.name,), replace(given, lamp=kind.values[None], lamp_tolerance=np.array([kind.tolerance]),
                                    lamp_modes=kind.modes[None]), 0.0)
        for kind in Unnamed().kinds
    ]  # fmt: skip
    spent: list[float] = []
    run = Model.run

    def timed(self: Model, inputs: dict[str, Floats]) -> dict[str, Floats]:
        start = time.process_time()
        try:
            return run(self, inputs)
        finally:
            spent.append(time.process_time() - start)

    calls: dict[str, Callable[[], object]] = {"one lamp, by name": lambda: answer(given, "phones")}
    for guess in guesses:
        calls[f"{guess.kinds[0]}, by kind"] = lambda guess=guess: answer(guess.observation, "phones")  # type: ignore[misc]
        calls[f"{guess.kinds[0]}, its light"] = lambda guess=guess: answer(by_modes(guess.observation), "phones")  # type: ignore[misc]
    calls["an answer, lamp named"] = lambda: recover(given)
    calls["an answer, four kinds"] = lambda: [
        answer(guess.observation, name) for guess in guesses for name in FAMILIES
    ]
    found = recover_in_any_light(guesses)
    by_name = {guess.kinds[0]: guess for guess in guesses}
    solved = [weight for weight in found.choice if weight.probability >= 0.001]
    calls["an answer's lights"] = lambda: [
        answer(by_modes(by_name[each.kinds[0]].observation), each.basis) for each in solved
    ]
    times: dict[str, list[float]] = {name: [] for name in calls}
    Model.run = timed  # type: ignore[method-assign]
    try:
        for _ in range(rounds):
            for name, call in calls.items():
                spent.clear()
                call()
                times[name].append(sum(spent))
    finally:
        Model.run = run  # type: ignore[method-assign]
    one = statistics.median(times["one lamp, by name"])
    rows = [[name, 1e3 * statistics.median(each), statistics.median(each) / one] for name, each in times.items()]
    console().print(table("Runs of the models, one shot, 24 patches", ["what", "ms", "of one lamp"], rows))
    kinds = sum(statistics.median(times[f"{guess.kinds[0]}, by kind"]) for guess in guesses) / one
    whole = sum(statistics.median(times[name]) for name in ("an answer, four kinds", "an answer's lights"))
    whole /= statistics.median(times["an answer, lamp named"])
    print(f"four kinds: {kinds:.1f} calls with one lamp (bar {BAR:g}): {'held' if kinds <= BAR else 'MISSED'}")
    print(f"a whole answer with its lights ({len(solved)}): {whole:.1f} times the answer with the lamp named")
    document = {"rows": rows, "kinds": kinds, "whole": whole, "versions": versions()}
    print(f"written: {save('any_light_cost', document)}")
    return int(kinds > BAR)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
