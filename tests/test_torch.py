"""The torch twin of the layers: equal to the reference, and its own export equal to it."""

from __future__ import annotations

import io

import numpy as np
import pytest

from camssf.curves.engine import onnx_runtime
from camssf.curves.layers import DEPTH, splitting
from camssf.curves.problem import Problem, whiten
from tests.problems import gamma_max, random_sensing

torch = pytest.importorskip("torch", reason="torch is not installed (extra: export)")
pytest.importorskip("onnxscript", reason="onnxscript is not installed (extra: export)")


def arguments(nonnegative: bool) -> tuple[list[object], np.ndarray]:
    from camssf_onnx.net import UnrolledNet

    sensing = random_sensing(7, 20, 12)
    gamma = float(0.05 * gamma_max(sensing).min())
    problems = [
        Problem(*whiten(A, b, S), 0.5, gamma, nonnegative)
        for A, b, S in zip(sensing.matrix, sensing.target, sensing.covariance, strict=True)
    ]
    expected = np.stack([splitting(p).unroll(DEPTH) for p in problems])
    rho = torch.tensor(problems[0].gamma + 2.0 * problems[0].l2, dtype=torch.float64)
    both, push = UnrolledNet.weights(
        torch.tensor(np.stack([p.M for p in problems])), torch.tensor(np.stack([p.g for p in problems])), rho
    )
    high = torch.tensor(gamma, dtype=torch.float64) / rho
    return [both, push, torch.tensor(-1e300, dtype=torch.float64) if nonnegative else -high, high], expected


@pytest.mark.parametrize("nonnegative", [False, True])
def test_layers_equal_the_reference(nonnegative: bool) -> None:
    from camssf_onnx.net import UnrolledNet

    inputs, expected = arguments(nonnegative)
    assert UnrolledNet()(*inputs).squeeze(2).numpy() == pytest.approx(expected, rel=1e-10, abs=1e-12)


@pytest.mark.filterwarnings("ignore")  # torch's exporter warns about its own insides
def test_torch_s_export_of_the_layers_is_small_and_equal() -> None:
    onnxruntime = onnx_runtime()
    from camssf_onnx.net import UnrolledNet

    inputs, expected = arguments(False)
    program = torch.onnx.export(UnrolledNet(), tuple(inputs), dynamo=True, opset_version=18, verbose=False)
    assert len(program.model_proto.graph.node) <= 8
    stream = io.BytesIO(program.model_proto.SerializeToString())
    session = onnxruntime.InferenceSession(stream.getvalue(), providers=["CPUExecutionProvider"])
    fed = {i.name: value.numpy() for i, value in zip(session.get_inputs(), inputs, strict=True)}
    assert session.run(None, fed)[0][..., 0] == pytest.approx(expected, rel=1e-10, abs=1e-12)
