"""Problem and answer → verdict: the answer weighed beside what other lamps would have given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from camssf.curves.ssf import Ssf
from camssf.errors import LampUnfit, NotConverged
from camssf.evidence.problem import Problem
from camssf.evidence.verdict import MOST_RIVALLED, RIVALS, Neutral, Rival, Verdict, Weighed, judge, surprise
from camssf.spectra import read_lamp


def weigh(problem: Problem, ssf: Ssf, alone: Sequence[Ssf]) -> Verdict:
    """`judge` on all that is known of the capture; `alone` of several shots, the answer to each."""
    shots = problem.capture.shots
    rho, tolerance = problem.white_reference()
    return judge(
        Weighed(
            problem.signals,
            problem.capture.chart,
            [shot.means for shot in shots],
            [shot.pose for shot in shots],
            problem.lamps,
            rho,
            tolerance,
        ),
        ssf,
        rivals=solve_rivals(problem, ssf),
        neutrals=[
            [Neutral(read_lamp(light).values, np.array(white)) for light, white in shot.photo.neutrals]
            for shot in shots
        ],
        alone=alone,
    )


def solve_rivals(problem: Problem, ssf: Ssf) -> tuple[Rival, ...]:
    """How well the same signals fit with other lamps, one shot at a time: rule 4 of docs/verdict.md."""
    capture, signals = problem.capture, problem.signals
    if ssf.std is None or len(capture.shots) > MOST_RIVALLED:
        return ()
    rho, tolerance = problem.white_reference()
    found = []
    for j, shot in enumerate(capture.shots):
        for name in RIVALS:
            shots = (*capture.shots[:j], replace(shot, lamp=read_lamp(name)), *capture.shots[j + 1 :])
            other = replace(problem, capture=replace(capture, shots=shots))
            try:
                answer = other.solve(signals.used, problem.options.gamma)
            except (LampUnfit, NotConverged):  # then it is no rival
                continue
            fit = surprise(signals, capture.chart, other.lamps, answer, rho, tolerance)
            found.append(Rival(j, name, fit.weighted))
    return tuple(found)
