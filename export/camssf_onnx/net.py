"""The unrolled layers as a torch module, for those who want gradients through them.

The shipped models do not come from here. torch's exporter (2.15) turns this loop into a clean graph, four nodes and a
body, but it has no converter for a float64 inverse and none for the rows with k and n dynamic; so `model.py` writes
the whole graph by hand, and a test holds both to the reference.
"""

from __future__ import annotations

import torch
from torch import while_loop

from camssf.curves.layers import DEPTH, RELAXATION


class UnrolledNet(torch.nn.Module):
    """v ← W₁ b + W_v v + W_q clip(v), `depth` times; z = v - clip(v) (z = soft(v, γ / ρ))."""

    def __init__(self, depth: int = DEPTH) -> None:
        super().__init__()
        self.depth = depth

    @staticmethod
    def weights(quadratic: torch.Tensor, pull: torch.Tensor, rho: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The analytic weights of M (c, r, r) and g (c, r): (W_v | W_q) (c, r, 2 r) and W₁ b (c, r, 1)."""
        eye = torch.eye(pull.shape[1], dtype=pull.dtype)
        W = torch.linalg.inv(quadratic + rho * eye)
        W2 = RELAXATION * rho * W
        both = torch.cat([W2 + (1.0 - RELAXATION) * eye, RELAXATION * eye - 2.0 * W2], dim=2)
        return both, RELAXATION * (W @ pull.unsqueeze(2))

    def forward(self, both: torch.Tensor, push: torch.Tensor, low: torch.Tensor, high: torch.Tensor) -> torch.Tensor:
        """z (c, r, 1) from the weights and the clip's bounds: low = -γ / ρ, or far below it for x ≥ 0."""

        def clip(v: torch.Tensor) -> torch.Tensor:
            return torch.minimum(torch.maximum(v, low), high)

        def again(step: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
            return step < self.depth

        def layer(step: torch.Tensor, v: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
            return step + 1, push + both @ torch.cat([v, clip(v)], dim=1)

        _, v = while_loop(again, layer, (torch.tensor(0), torch.zeros_like(push)))
        return v - clip(v)
