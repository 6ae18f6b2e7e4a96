"""The torch twin of the layers: equal to the reference, differentiable, and its own export equal to it."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from camssf.recovery.elastic_net import ElasticNet, whiten
from camssf.recovery.layers import DEPTH, LAYERS, RELAXATION
from camssf.recovery.onnx_model import onnx_runtime
from camssf.recovery.pivoting import finish_steps, pivot_to_optimum
from tests.problems import gamma_max, random_sensing

torch = pytest.importorskip("torch", reason="torch is not installed (extra: export)")
pytest.importorskip("onnxscript", reason="onnxscript is not installed (extra: export)")

KINDS = pytest.mark.parametrize("iteration", ["splitting", "ista"])
SIGNED = pytest.mark.parametrize("nonnegative", [False, True], ids=["signed", "nonnegative"])


def three(
    nonnegative: bool = False, l2: float = 0.5, seed: int = 7, size: tuple[int, int] = (20, 12)
) -> list[ElasticNet]:
    """Three problems of their own γ."""
    sensing = random_sensing(seed, *size)
    shares = np.array([0.02, 0.05, 0.1]) * gamma_max(sensing)
    rows = zip(sensing.matrix, sensing.target, sensing.covariance, shares, strict=True)
    return [ElasticNet(*whiten(A, b, S)[:2], l2, float(gamma), nonnegative) for A, b, S, gamma in rows]


def arguments(problems: list[ElasticNet]) -> tuple[Any, ...]:
    """A, b, λ₂, γ of the twin."""
    A, b = (torch.tensor(np.stack(part)) for part in zip(*((p.A, p.b) for p in problems), strict=True))
    l2 = torch.tensor(problems[0].l2, dtype=torch.float64)
    return A, b, l2, torch.tensor([p.gamma for p in problems], dtype=torch.float64)


@KINDS
@SIGNED
@pytest.mark.parametrize("l2", [0.0, 0.5])
def test_every_layer_equals_the_reference_s(iteration: str, nonnegative: bool, l2: float) -> None:
    from camssf_onnx.net import UnrolledNet

    problems = three(nonnegative, l2)
    found = UnrolledNet(iteration, nonnegative=nonnegative).path(*arguments(problems)).numpy()
    assert found.shape == (DEPTH + 1, 3, 12)
    for depth in (0, 1, 2, 7, DEPTH):
        expected = np.stack([LAYERS[iteration](p).unroll(depth) for p in problems])
        assert found[depth] == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_the_pull_is_refined_as_the_reference_s_is() -> None:
    """What W g of rows of condition 1e6 leaves of (H + ρ I) u = g, and what the twin's W₁ b leaves."""
    from camssf_onnx.net import splitting

    rng = np.random.default_rng(9)
    left, _, right = np.linalg.svd(rng.normal(size=(20, 12)), full_matrices=False)
    problem = ElasticNet(left * np.geomspace(1e4, 1e-2, 12) @ right, rng.normal(size=20), 0.0, 1e-3, False)
    spread = problem.H + problem.gamma * np.eye(12)
    plain = np.linalg.inv(spread) @ problem.g
    refined, reference = (
        pushed / RELAXATION
        for pushed in (splitting(*arguments([problem])).W1b[0].numpy(), LAYERS["splitting"](problem).W1b)
    )
    left_over = [abs(problem.A.T @ (problem.b - problem.A @ u) - problem.gamma * u).max() for u in (plain, refined)]
    assert left_over[1] < 0.1 * left_over[0]
    assert refined == pytest.approx(reference, rel=1e-7)


@KINDS
def test_the_net_ends_where_its_path_ends_and_takes_one_gamma_for_all(iteration: str) -> None:
    from camssf_onnx.net import UnrolledNet

    problems = [replace(p, gamma=0.3) for p in three()]
    A, b, l2, gamma = arguments(problems)
    net = UnrolledNet(iteration, 5)
    assert torch.equal(net(A, b, l2, gamma), net.path(A, b, l2, gamma)[-1])
    assert torch.equal(net(A, b, l2, gamma), net(A, b, l2, gamma[0]))


@KINDS
@SIGNED
def test_gradients_are_those_of_finite_differences(iteration: str, nonnegative: bool) -> None:
    """By A, b, λ₂ and γ, in float64, early and late; no atom of a random problem stands on the threshold itself."""
    from camssf_onnx.net import UnrolledNet

    net = UnrolledNet(iteration, nonnegative=nonnegative)
    inputs = tuple(x.clone().requires_grad_() for x in arguments(three(nonnegative, seed=17, size=(7, 4))))

    def some(*inputs: Any) -> Any:
        return net.path(*inputs)[[1, 4, DEPTH]]

    assert (some(*inputs).detach()[:, 0].count_nonzero(dim=1) > 0).all()
    assert torch.autograd.gradcheck(some, inputs, eps=1e-6, atol=1e-6, rtol=1e-5)


@SIGNED
def test_deep_gradients_are_the_optimum_s_own(nonnegative: bool) -> None:
    """∂x/∂b = M⁻¹ Aᵀ and ∂x/∂γ = -M⁻¹ sign(x) on the support, zero off it: implicit differentiation of the KKT."""
    from camssf_onnx.net import UnrolledNet

    problem = three(nonnegative, seed=16, size=(20, 8))[2]
    A, b, l2, gamma = arguments([problem])
    net = UnrolledNet(depth=400, nonnegative=nonnegative)
    by_b, by_gamma = torch.autograd.functional.jacobian(lambda b, gamma: net(A, b, l2, gamma)[0], (b, gamma))
    x = pivot_to_optimum(problem, np.zeros(8), finish_steps(8))[0]
    serves = np.flatnonzero(x)
    assert 1 < serves.size < 8
    M = problem.M[np.ix_(serves, serves)]
    expected, slope = np.zeros((8, 20)), np.zeros(8)
    expected[serves] = np.linalg.solve(M, problem.A[:, serves].T)
    slope[serves] = -np.linalg.solve(M, np.sign(x[serves]))
    assert by_b[:, 0].numpy() == pytest.approx(expected, abs=1e-9)
    assert by_gamma[:, 0].numpy() == pytest.approx(slope, abs=1e-9)


def written(iteration: str) -> bytes:
    """The repository's own graph of the layers, from A, b, λ₂, γ and `nonnegative` to x, of three problems.

    No input is called A: capitals are the graph's own names for its values.
    """
    from onnx import TensorProto, helper

    from camssf_onnx import layers
    from camssf_onnx.algebra import inverse
    from camssf_onnx.elastic_net import pose
    from camssf_onnx.graph import Graph, Value
    from camssf_onnx.model import IR, OPSET

    g = Graph("layers")
    shapes: dict[str, list[int]] = {
        "rows": [3, 20, 12], "b": [3, 20], "l2": [], "gamma": [], "nonnegative": [],
    }  # fmt: skip
    A, b, l2, gamma, nonnegative = (Value(g, name) for name in shapes)
    posed = pose((A, b), (l2, gamma), nonnegative, (3, 12))
    if iteration == "splitting":
        W, _ = inverse(g, posed.H + layers.splitting_weight(posed) * np.eye(12), 12)
        layer = layers.splitting(posed, W)
    else:
        layer = layers.ista(posed)
    g.nodes.append(helper.make_node("Identity", [layers.unroll(posed, layer, DEPTH).name], ["x"]))
    inputs = [helper.make_tensor_value_info(name, TensorProto.DOUBLE, shape) for name, shape in shapes.items()]
    outputs = [helper.make_tensor_value_info("x", TensorProto.DOUBLE, [3, 12])]
    graph = helper.make_graph(g.nodes, g.name, inputs, outputs, g.initializers)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR)
    return bytes(model.SerializeToString())


@KINDS
@SIGNED
@pytest.mark.filterwarnings("ignore")  # torch's exporter warns about its own insides
def test_torch_s_export_and_the_graph_written_by_hand_are_equal(iteration: str, nonnegative: bool) -> None:
    onnxruntime = onnx_runtime()
    from camssf_onnx.net import CONSTRUCTORS, Layers

    problems = [replace(p, gamma=0.3) for p in three(nonnegative)]
    A, b, l2, gamma = arguments(problems)
    weights = CONSTRUCTORS[iteration](A, b, l2, gamma)
    net = Layers(nonnegative=nonnegative).eval()
    program = torch.onnx.export(net, tuple(weights), dynamo=True, opset_version=18, verbose=False)
    graph = program.model_proto.graph
    assert "Loop" in [node.op_type for node in graph.node]  # not 32 times the same nodes
    assert len(graph.node) <= 16
    stream = io.BytesIO(program.model_proto.SerializeToString())
    exported = onnxruntime.InferenceSession(stream.getvalue(), providers=["CPUExecutionProvider"])
    fed = {i.name: value.numpy() for i, value in zip(exported.get_inputs(), weights, strict=True)}
    (found,) = exported.run(None, fed)
    by_hand = onnxruntime.InferenceSession(written(iteration), providers=["CPUExecutionProvider"])
    (ours,) = by_hand.run(
        ["x"], {"rows": A.numpy(), "b": b.numpy(), "l2": l2.numpy(), "gamma": gamma[0].numpy(),
                "nonnegative": np.array(float(nonnegative))},
    )  # fmt: skip
    expected = np.stack([LAYERS[iteration](p).unroll(DEPTH) for p in problems])
    assert np.count_nonzero(expected) >= 5
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-12)
    assert ours == pytest.approx(found, rel=1e-10, abs=1e-12)
