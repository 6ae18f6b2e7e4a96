"""Tests whether a camera belongs to the family of its basis, and answers one that does not with a wider prior.

Two numbers of the answer at the width that the basis was learned with (docs/verdict.md, rule 7): the length of its
code, and the gain in evidence when the lamp may err by much more than was declared. From the length follows the
probability that the camera is a stranger to the family. By it the answer is mixed with that of a prior WIDER times as
wide, so that its bands hold for a stranger, too, and are hardly wider for another camera. Beyond the limit of the
second number the answer is the wider one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from camssf.recovery.basis import Basis, read_basis
from camssf.recovery.evidence import log_evidences
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import FamilyTest, Ssf
from camssf.rules import rules

_NUMBER = rules().number
LARGEST = 700.0
"""Largest ln of odds: the exponential of a larger one is no number."""
WIDER = _NUMBER("choice.wider")
"""Width of the prior of an unfamiliar camera, relative to the learned one."""
STRANGER = _NUMBER("choice.stranger")
"""Prior probability that a camera belongs to no family."""
FAMILIAR, FAMILIAR_STD, STRANGER_STD = (
    _NUMBER(f"choice.{name}") for name in ("familiar", "familiar_std", "stranger_std")
)
"""Mean and standard deviation of z(x) of a family's members, and the latter of strangers, whose mean is 0."""
LEAST_STRANGE = FAMILIAR / (1.0 - (FAMILIAR_STD / STRANGER_STD) ** 2)
"""z(x) of the least odds of a stranger, -4.3: below it they would rise again, since strangers spread more."""
LAMP_ERROR = _NUMBER("choice.lamp_error")
"""Smooth relative error that a named lamp may have in the lamp residual."""


def family_test(observation: Observation, answer: Ssf, named: Sequence[bool]) -> FamilyTest:
    """Test an answer of the learned width; `named` says of which shots the lamp was named."""
    basis, length, evidence = answer.basis, code_length(answer), answer.log_evidence
    assert length is not None  # every family has a prior
    assert evidence is not None
    residual = lamp_residual(observation, read_basis(basis), evidence, named) if any(named) else None
    return FamilyTest(length, residual, longest_code(basis, named=all(named)), largest_residual(basis))


def stranger_probability(test: FamilyTest) -> float:
    """Probability that a camera belongs to no family; 1 where the lamp residual is beyond its limit."""
    if test.lamp_residual is not None and test.lamp_residual > test.largest:
        return 1.0
    z = max(test.length, LEAST_STRANGE)
    squares = ((z - FAMILIAR) / FAMILIAR_STD) ** 2 - (z / STRANGER_STD) ** 2
    odds = math.log(STRANGER / (1.0 - STRANGER) * FAMILIAR_STD / STRANGER_STD) + 0.5 * squares
    return 1.0 / (1.0 + math.exp(-min(odds, LARGEST)))


def code_length(answer: Ssf) -> float | None:
    """z(x): the length of the code as a standard normal number under the prior; None without a prior.

    Under the prior the posterior mean x̂ ~ N(0, K), K = I - C: x̂ᵀx̂ is nearly a scaled χ² (Satterthwaite 1946).
    """
    if answer.code_covariance is None:
        return None
    K = np.eye(len(answer.code_covariance)) - answer.code_covariance
    expected = float(np.trace(K))
    if expected <= 0:  # the posterior equals the prior
        return None
    u = 2.0 * float(np.sum(K**2)) / (9.0 * expected**2)
    return float((np.cbrt(np.sum(answer.code**2) / expected) - (1.0 - u)) / np.sqrt(u))


def lamp_residual(observation: Observation, basis: Basis, log_evidence: float, named: Sequence[bool]) -> float:
    """ln of the evidence with errors of LAMP_ERROR in named lamps, minus `log_evidence`, with the declared ones.

    A tinted glass, water, or another lamp of about the same colour changes the light smoothly.
    """
    declared = observation.lamp_tolerance
    tolerances = np.where(named, np.maximum(declared, LAMP_ERROR), declared)
    return float(log_evidences([replace(observation, lamp_tolerance=tolerances)], basis)[0]) - log_evidence


def longest_code(basis: str, *, named: bool) -> float:
    """Limit of `code_length` on a basis; `named` says whether every lamp was named."""
    if basis in ("phones", "ryyb"):
        return _NUMBER("verdict.unusual_phone" if named else "verdict.unusual_phone_unnamed")
    return _NUMBER("verdict.unusual_camera" if basis == "cameras" else "verdict.improbable_curves")


def largest_residual(basis: str) -> float:
    """Limit of `lamp_residual` on a basis."""
    return _NUMBER("verdict.lamp_residual_camera" if basis == "cameras" else "verdict.lamp_residual")
