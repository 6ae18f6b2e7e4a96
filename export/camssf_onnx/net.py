"""The unrolled layers in torch, differentiable: `camssf.recovery.layers` with the same names.

`UnrolledNet` computes x from whitened rows and penalties of a batch of problems; each step is differentiable by A, b,
λ₂ and γ. The shipped models are not made here: torch's exporter (2.15) has no converter for a float64 inverse or an
eigenvalue, and none for rows with k and n dynamic, so `model.py` writes the whole graph by hand. The exporter can
write `Layers`, the loop from given weights.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import while_loop

from camssf.recovery.layers import DEPTH, RELAXATION


class Weights(NamedTuple):
    """v ← W1b + W2 soft(v, θ) + W3 v, of p problems.

    Attributes:
        W1b: (p, r) W₁ b.
        W2, W3: (p, r, r).
        theta: (p, 1) θ.
    """

    W1b: torch.Tensor
    W2: torch.Tensor
    W3: torch.Tensor
    theta: torch.Tensor


def splitting(A: torch.Tensor, b: torch.Tensor, l2: torch.Tensor, gamma: torch.Tensor) -> Weights:
    """The default layer, from rows of unit covariance A (p, N, r), b (p, N), λ₂ () and γ () or (p,)."""
    penalty = gamma.expand(len(A)).reshape(-1, 1, 1)  # (p, 1, 1)
    rho = penalty + 2.0 * l2
    eye = torch.eye(A.shape[2], dtype=A.dtype)
    W = torch.linalg.inv(A.mT @ A + rho * eye)
    target = b.unsqueeze(2)
    u = W @ (A.mT @ target)
    # As in the reference: one refinement step with the residual, since W loses digits to its condition number.
    Wg = u + W @ (A.mT @ (target - A @ u) - rho * u)
    step = RELAXATION * rho / (rho + l2)
    return Weights(
        (step * Wg).squeeze(2),
        step * (2.0 * rho * W - eye),
        eye - RELAXATION * rho * W,
        (penalty / (rho + l2)).squeeze(2),
    )


def ista(A: torch.Tensor, b: torch.Tensor, l2: torch.Tensor, gamma: torch.Tensor) -> Weights:
    """Iterative soft thresholding with the step 1 / ‖M‖; arguments as in `splitting`."""
    eye = torch.eye(A.shape[2], dtype=A.dtype)
    M = A.mT @ A + l2 * eye
    norm = torch.linalg.eigvalsh(M)[:, -1].reshape(-1, 1, 1)
    pull = (A.mT @ b.unsqueeze(2)) / norm
    penalty = gamma.expand(len(A)).reshape(-1, 1)
    return Weights(pull.squeeze(2), eye - M / norm, torch.zeros_like(M), penalty / norm.squeeze(2))


Constructor = Callable[[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor], Weights]
CONSTRUCTORS: dict[str, Constructor] = {"splitting": splitting, "ista": ista}
"""By name, as `camssf.recovery.layers.LAYERS`."""


def soft(v: torch.Tensor, theta: torch.Tensor, nonnegative: bool) -> torch.Tensor:
    """Soft thresholding, optionally with x ≥ 0."""
    shrunk = torch.relu(v - theta)
    return shrunk if nonnegative else shrunk - torch.relu(-v - theta)


def layer(weights: Weights, v: torch.Tensor, nonnegative: bool) -> torch.Tensor:
    """The next state, (p, r)."""
    x = soft(v, weights.theta, nonnegative).unsqueeze(2)
    return weights.W1b + (weights.W2 @ x + weights.W3 @ v.unsqueeze(2)).squeeze(2)


class UnrolledNet(torch.nn.Module):
    """Computes x from whitened rows by `depth` layers of one kind."""

    def __init__(self, iteration: str = "splitting", depth: int = DEPTH, *, nonnegative: bool = False) -> None:
        super().__init__()
        self.weights_of = CONSTRUCTORS[iteration]
        self.depth = depth
        self.nonnegative = nonnegative

    def forward(self, A: torch.Tensor, b: torch.Tensor, l2: torch.Tensor, gamma: torch.Tensor) -> torch.Tensor:
        """x (p, r) from A (p, N, r) and b (p, N) of unit covariance, λ₂ () and γ () or (p,)."""
        return self.path(A, b, l2, gamma)[-1]

    def path(self, A: torch.Tensor, b: torch.Tensor, l2: torch.Tensor, gamma: torch.Tensor) -> torch.Tensor:
        """x after 0, 1, ... `depth` layers, (depth + 1, p, r)."""
        weights = self.weights_of(A, b, l2, gamma)
        v = torch.zeros_like(weights.W1b)
        found = [soft(v, weights.theta, self.nonnegative)]
        for _ in range(self.depth):
            v = layer(weights, v, self.nonnegative)
            found.append(soft(v, weights.theta, self.nonnegative))
        return torch.stack(found)


class Layers(torch.nn.Module):
    """Computes x from weights, in a loop that torch's exporter writes as an ONNX Loop."""

    def __init__(self, depth: int = DEPTH, *, nonnegative: bool = False) -> None:
        super().__init__()
        self.depth = depth
        self.nonnegative = nonnegative

    def forward(self, W1b: torch.Tensor, W2: torch.Tensor, W3: torch.Tensor, theta: torch.Tensor) -> torch.Tensor:
        """x (p, r) from `Weights`."""
        weights = Weights(W1b, W2, W3, theta)

        def again(step: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
            return step < self.depth

        def further(step: torch.Tensor, v: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
            return step + 1, layer(weights, v, self.nonnegative)

        _, v = while_loop(again, further, (torch.tensor(0), torch.zeros_like(W1b)))
        return soft(v, theta, self.nonnegative)
