"""The formulas on torch: equal to NumPy's, and differentiable."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from camssf.grid import Floats
from camssf.recovery.basis import read_basis
from camssf.recovery.inputs import hypotheses_of
from camssf.recovery.posterior import evidence_of
from camssf.recovery.rows import Hypotheses
from camssf.recovery.whitening import whitened_model
from tests.recovery.test_dense_model import random_captures

torch = pytest.importorskip("torch", reason="torch is not installed (extra: torch)")
pytest.importorskip("array_api_compat", reason="array-api-compat is not installed (extra: torch)")


def tensor(x: Any) -> Any:
    return torch.tensor(np.array(x), dtype=torch.float64)


def evidences(evidence: Hypotheses, **changed: Any) -> Any:
    """ln of the evidence of a stack, on torch."""
    arrays = {field.name: tensor(getattr(evidence, field.name)) for field in fields(Hypotheses)} | changed
    return evidence_of(whitened_model(Hypotheses(**arrays), torch.tensor(0.0)))


@pytest.mark.parametrize("seed", [3, 5, 8])
def test_gradients_of_the_evidence_are_those_of_finite_differences(seed: int) -> None:
    """By signals, lamp and dictionary, along a random direction each; with and without modes.

    A hypothesis's evidence, and a slope, may be next to nothing: their bounds are relative to what they are sums of.
    """
    observations = random_captures(seed, h=2)
    evidence = hypotheses_of(observations, read_basis("phones"))
    known: Floats = evidence_of(whitened_model(evidence, np.array(0.0)))
    assert evidences(evidence).numpy() == pytest.approx(known, abs=1e-12 * np.abs(known).max())
    rng = np.random.default_rng(seed)
    for name in ("signals", "lamp", "dictionary"):
        value = getattr(evidence, name)
        leaf = tensor(value).requires_grad_()
        evidences(evidence, **{name: leaf}).sum().backward()
        direction = value * rng.normal(size=value.shape)
        parts = leaf.grad.numpy() * direction
        step = 1e-6
        ahead, behind = (
            evidence_of(whitened_model(replace(evidence, **{name: value + sign * step * direction}), np.array(0.0)))
            for sign in (1.0, -1.0)
        )
        slope = float((ahead - behind).sum()) / (2.0 * step)
        assert parts.sum() == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(parts).sum())
