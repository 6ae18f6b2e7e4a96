"""Splits the posterior variance of the curves by source as nodes: `camssf.recovery.budget`."""

from __future__ import annotations

import numpy as np

from camssf_onnx.covariance import Errors
from camssf_onnx.graph import Graph, Value, within
from camssf_onnx.prediction import predicted_std
from camssf_onnx.sensitivity import Answer, moves_of_peak_one, own_blocks, variance_of_curves


def explain(
    wanted: Value, errors: Errors, posterior: tuple[Value, Value], answer: Answer, shape: tuple[Value, int]
) -> list[Value]:
    """`budget` (7, 3) and `predicted_std` (k, n, 3); NaN unless wanted is 1.

    Args:
        posterior: mean x̂ (1, R) and covariance S (R, R) of the code.
        answer: the curves.
        shape: that of the signals, and the number of atoms a channel.
    """
    signals, r = shape

    def explained(g: Graph) -> list[Value]:
        here, (mean, spread) = within(errors, g), (each.here(g) for each in posterior)
        return [budget(g, here, mean, spread, r), predicted_std(g, here, spread, answer.response.here(g), signals)]

    def unexplained(g: Graph) -> list[Value]:
        return [g.op("Expand", np.nan, g.ints(7, 3)), g.op("Expand", np.nan, signals)]

    return wanted.graph.choose(wanted.graph.op("Greater", wanted, 0.5), explained, unexplained, "budget")


def budget(g: Graph, errors: Errors, mean: Value, spread: Value, r: int) -> Value:
    """Share of each source in the variance of each channel, (7, 3): the six of `SOURCES`, then "unseen".

    The posterior mean is x̂ = S Eᵀ b with E = Σ⁻¹ A. Its covariance S is the sum of S Eᵀ Σ_t E S over the sources t
    and of S S, the part of the prior that the patches do not determine, because I - S H = S.
    """
    every = g.op("Concat", errors.by_source, g.constant(np.eye(3 * r)).unsqueeze(0), axis=0)
    curves = errors.mean + (errors.atoms @ mean.reshape(3, r, 1)).squeeze(2)
    parts = own_blocks(spread @ every @ spread, r)  # (7, 3, r, r)
    here, between = variance_of_curves(g, moves_of_peak_one(g, curves, errors.atoms), parts)
    total = between.sum(2, 3) + here.slice(-1, 2**31, 2).squeeze(2)
    return total / total.sum(0, keep=True)
