"""The formulas on torch: equal to NumPy's, and differentiable."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from camssf.grid import Floats
from camssf.recovery.basis import read_basis
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.inputs import hypotheses_of
from camssf.recovery.layers import DEPTH, LAYERS, splitting
from camssf.recovery.posterior import evidence_of
from camssf.recovery.rows import Hypotheses
from camssf.recovery.whitening import whitened_model
from golden.linear_model import whitened_problem
from tests.recovery.test_dense_model import random_captures
from tests.support.problems import gamma_max, random_sensing, walked

torch = pytest.importorskip("torch", reason="torch is not installed (extra: torch)")
pytest.importorskip("array_api_compat", reason="array-api-compat is not installed (extra: torch)")

KINDS = pytest.mark.parametrize("iteration", ["splitting", "ista"])
SIGNED = pytest.mark.parametrize("nonnegative", [False, True], ids=["signed", "nonnegative"])


def tensor(x: Any) -> Any:
    return torch.tensor(np.array(x), dtype=torch.float64)


def three(nonnegative: bool = False, l2: float = 0.5, seed: int = 7, size: tuple[int, int] = (20, 12)) -> ElasticNet:
    """Three problems of their own γ, on NumPy."""
    sensing = random_sensing(seed, *size)
    return whitened_problem(sensing, l2, np.array([0.02, 0.05, 0.1]) * gamma_max(sensing), nonnegative)[0]


def arguments(problem: ElasticNet) -> tuple[Any, ...]:
    """A, b, λ₂, γ as tensors."""
    return tuple(tensor(x) for x in (problem.A, problem.b, problem.l2, problem.gamma))


@KINDS
@SIGNED
@pytest.mark.parametrize("l2", [0.0, 0.5])
def test_every_layer_equals_numpy_s(iteration: str, nonnegative: bool, l2: float) -> None:
    problem = three(nonnegative, l2)
    twin = LAYERS[iteration](ElasticNet(*arguments(problem), torch.tensor(nonnegative)))
    layer = LAYERS[iteration](problem)
    for depth in (0, 1, 2, 7, DEPTH):
        assert twin.unroll(depth).numpy() == pytest.approx(layer.unroll(depth), rel=1e-10, abs=1e-12)


@KINDS
@SIGNED
def test_gradients_of_the_layers_are_those_of_finite_differences(iteration: str, nonnegative: bool) -> None:
    """By A, b, λ₂ and γ, early and late; no atom of a random problem stands on the threshold itself."""
    inputs = tuple(x.requires_grad_() for x in arguments(three(nonnegative, seed=17, size=(7, 4))))

    def some(*inputs: Any) -> Any:
        layer = LAYERS[iteration](ElasticNet(*inputs, torch.tensor(nonnegative)))
        return torch.stack([layer.unroll(depth) for depth in (1, 4, DEPTH)])

    assert (some(*inputs).detach()[:, 0].count_nonzero(dim=1) > 0).all()
    assert torch.autograd.gradcheck(some, inputs, eps=1e-6, atol=1e-6, rtol=1e-5)


@SIGNED
def test_deep_gradients_are_the_optimum_s_own(nonnegative: bool) -> None:
    """∂x/∂b = M⁻¹ Aᵀ and ∂x/∂γ = -M⁻¹ sign(x) on the support, zero off it: implicit differentiation of the KKT.

    So a gradient through the walk needs no walk: autograd through its tableau has no value where a bound is missing.
    """
    every = three(nonnegative, seed=16, size=(20, 8))
    problem = ElasticNet(every.A[2], every.b[2, :, 0], float(every.l2), float(every.gamma[2, 0, 0]), nonnegative)
    A, b, l2, gamma = (tensor(x) for x in (problem.A, problem.b, problem.l2, problem.gamma))

    def deep(b: Any, gamma: Any) -> Any:
        return splitting(ElasticNet(A, b, l2, gamma, torch.tensor(nonnegative))).unroll(400)

    by_b, by_gamma = torch.autograd.functional.jacobian(deep, (b, gamma))
    x = walked(problem, np.zeros(8))[0]
    serves = np.flatnonzero(x)
    assert 1 < serves.size < 8
    M = problem.M[np.ix_(serves, serves)]
    expected, slope = np.zeros((8, 20)), np.zeros(8)
    expected[serves] = np.linalg.solve(M, problem.A[:, serves].T)
    slope[serves] = -np.linalg.solve(M, np.sign(x[serves]))
    assert by_b.numpy() == pytest.approx(expected, abs=1e-9)
    assert by_gamma.numpy() == pytest.approx(slope, abs=1e-9)


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
