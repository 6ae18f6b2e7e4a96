"""Standard deviations of predicted signals as nodes: `camssf.recovery.prediction`."""

from __future__ import annotations

from camssf_onnx.covariance import Errors
from camssf_onnx.graph import Graph, Value


def predicted_std(g: Graph, errors: Errors, spread: Value, response: Value, shape: Value) -> Value:
    """One standard deviation (k, n, 3) of each true signal minus its prediction.

    Args:
        spread: (R, R) posterior covariance of the code.
        response: (k, 3), as in `Answer`.
        shape: of the signals, (k, n, 3).
    """
    square = ((errors.signal @ spread) * errors.error).sum(2, keep=True) + errors.own  # (1, N, 1)
    k, n = (g.op("Slice", shape, g.ints(i), g.ints(i + 1), g.ints(0)) for i in range(2))
    by_patch = g.op("Sqrt", square).like(g.op("Concat", n, g.ints(3), k, axis=0))
    return by_patch.transpose(2, 0, 1) / response.unsqueeze(1)
