"""Tests whether a camera belongs to the family of its basis, and answers one that does not with a wider prior.

Two numbers of the answer at the width that the basis was learned with (docs/verdict.md, rule 7): the length of its
code, and the gain in evidence when the lamp may err by much more than was declared. Their limits are the largest
values of clean captures of that family, with some slack. Beyond one of them the bands of the learned width are too
narrow, and the answer is that of a prior WIDER times as wide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from camssf.recovery.basis import Basis, read_basis
from camssf.recovery.evidence import log_evidences
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import FamilyTest, Ssf
from camssf.rules import rules

_NUMBER = rules().number
WIDER = _NUMBER("choice.wider")
"""Width of the prior of an unfamiliar camera, relative to the learned one."""
LAMP_ERROR = _NUMBER("choice.lamp_error")
"""Smooth relative error that a named lamp may have in the lamp residual."""


def family_test(observation: Observation, answer: Ssf, named: Sequence[bool]) -> FamilyTest:
    """Test an answer of the learned width; `named` says of which shots the lamp was named."""
    basis, length, evidence = answer.basis, code_length(answer), answer.log_evidence
    assert length is not None  # every family has a prior
    assert evidence is not None
    residual = lamp_residual(observation, read_basis(basis), evidence, named) if any(named) else None
    return FamilyTest(length, residual, longest_code(basis, named=all(named)), largest_residual(basis))


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
