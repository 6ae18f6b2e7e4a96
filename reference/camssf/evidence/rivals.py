"""Problem and answer → verdict: the answer weighed beside other lamps in the place of those named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from camssf.curves.basis import Basis, read_basis, widened
from camssf.curves.choice import AUTO, FAMILIES
from camssf.curves.code import log_evidence
from camssf.curves.sensing import sense
from camssf.curves.ssf import Ssf
from camssf.evidence.light import MOST_RIVALLED, RIVALS, Neutral, Rival
from camssf.evidence.problem import Problem
from camssf.evidence.reasons import Verdict
from camssf.evidence.surprise import Weighed
from camssf.evidence.verdict import judge
from camssf.rules import rules
from camssf.spectra import read_lamp

NARROW = rules().number("verdict.narrow")
"""Lamps are compared by cameras that spread so much less than their basis, which was enlarged on purpose."""


def weigh(problem: Problem, ssf: Ssf, alone: Sequence[Ssf]) -> Verdict:
    """`judge` on all that is known of the capture; `alone` of several shots, the answer to each."""
    settled = problem.lit(ssf.kinds) if any(problem.unnamed) else problem
    shots = problem.capture.shots
    rho, tolerance = problem.white_reference()
    return judge(
        Weighed(
            problem.signals,
            problem.capture.chart,
            [shot.means for shot in shots],
            [shot.pose for shot in shots],
            settled.lamps,
            rho,
            tolerance,
            problem.gains,
        ),
        ssf,
        rivals=lambda: weigh_rivals(problem, ssf),
        neutrals=[
            [Neutral(read_lamp(light).values, np.array(white)) for light, white in shot.photo.neutrals]
            for shot in shots
        ],
        alone=alone,
        family=next(iter(problem.believed), None) if problem.basis == AUTO else None,
        unnamed=problem.unnamed,
    )


def weigh_rivals(problem: Problem, ssf: Ssf) -> tuple[Rival, ...]:
    """How much better the same signals fit with other lamps, one shot at a time: rule 4 of docs/verdict.md.

    Where the signals choose the basis, every lamp has the same choice: a phone under a wrong lamp may look like a
    camera, and its right lamp is then seen by the phones' basis alone. A light that nobody named has no rivals: all
    kinds were weighed; beside it stands what the answer takes it for.

    Args:
        problem: as it was asked, `auto` where the signals chose.
        ssf: the answer.
    """
    named = [not each for each in problem.unnamed]
    problem = problem if all(named) else problem.lit(ssf.kinds)
    capture, used = problem.capture, problem.signals.used
    if ssf.std is None or len(capture.shots) > MOST_RIVALLED:
        return ()
    scale = NARROW * ssf.prior_scale
    asked = FAMILIES if problem.basis == AUTO else (problem.basis,)
    bases = [widened(each if isinstance(each, Basis) else read_basis(each), scale) for each in asked]
    beliefs = [np.log(problem.believed.get(basis.name, 1.0)) if len(bases) > 1 else 0.0 for basis in bases]

    def weighed(posed: Problem) -> float:
        given = posed.given(used)
        return float(np.logaddexp.reduce([
            log_evidence(sense(given, basis)) + belief for basis, belief in zip(bases, beliefs, strict=True)
        ]))  # fmt: skip

    given = weighed(problem) if any(named) else 0.0
    found = []
    for j, shot in enumerate(capture.shots):
        for name in RIVALS if named[j] else ():
            shots = (*capture.shots[:j], replace(shot, lamp=read_lamp(name)), *capture.shots[j + 1 :])
            other = replace(problem, capture=replace(capture, shots=shots))
            found.append(Rival(j, name, weighed(other) - given))
    return tuple(found)
