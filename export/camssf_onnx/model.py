"""Builds the whole algebra from Eq. (5) to the curves as one ONNX graph: float64, opset 18, standard operators.

The steps and their order are those of the files of the same names in `camssf.recovery`, which are the specification.
They differ in form, not in value:

- The algebra works on the 5-nm nodes: integrals are folded onto them (`fold`), curves interpolated (`unfold`).
- ONNX has no float64 Cholesky or inverse. `whiten` replaces them by a Loop over panels of pivots; inverses are
  L⁻ᵀ L⁻¹.
- Without modes Σ is one block a patch plus a low-rank part: the blocks are whitened first, the rest by a system of
  the size of that rank (`Folded.sparse`). With modes Σ is whitened whole (`Folded.dense`).
- All problems are solved at once; one that has reached its optimum no longer changes.
- There are no infinities: a missing bound is ±1e300.
"""

from __future__ import annotations

import numpy as np
import onnx
from onnx import helper

from camssf import __version__
from camssf.errors import InvalidArgument
from camssf.recovery.basis import Basis
from camssf.recovery.layers import DEPTH, LAYERS
from camssf.recovery.pivoting import finish_steps
from camssf_onnx.algebra import D, M, inverse
from camssf_onnx.budget import explain
from camssf_onnx.duality_gap import duality_gap as gap_of
from camssf_onnx.elastic_net import mode_posterior, pose
from camssf_onnx.graph import Graph, Value
from camssf_onnx.layers import ista, splitting, splitting_weight, unroll
from camssf_onnx.linear_model import Rows, learned_rows, paper_rows
from camssf_onnx.pivoting import pivot_to_optimum as walk
from camssf_onnx.sensitivity import own_blocks

__all__ = ["INPUTS", "IR", "OPSET", "build"]

OPSET, IR = 18, 9
INPUTS: dict[str, list[str | int]] = {
    "chart": ["k", "n", 3],
    "white": ["k", "n", 3],
    "dark": ["k", "n", 3],
    "standard_error": ["k", "n", 3],
    "reflectance": ["n", M],
    "chart_tolerance": ["n"],
    "white_reflectance": [M],
    "white_tolerance": [],
    "lamp": ["k", M],
    "lamp_tolerance": ["k"],
    "lamp_modes": ["k", "q", M],
    "gain_modes": ["k", "g", "n"],
    "gain_own": [],
    "l2": [],
    "gamma": [],
    "nonnegative": [],
    "prior_scale": [],
    "explain": [],
}
"""Shapes of the inputs. All are required: an input with a default cannot be set from Java."""


def build(basis: Basis, *, iteration: str = "splitting", depth: int = DEPTH, finish: bool = True) -> onnx.ModelProto:
    """The model of a basis; the same basis gives the same bytes.

    Args:
        basis: the basis.
        iteration, depth: name of the layers in `camssf.recovery.layers.LAYERS`, and their number.
        finish: whether a pivoting walk follows where the layers' gap is too large.

    Raises:
        InvalidArgument: unknown `iteration`.
    """
    g = Graph(f"camssf-{basis.name}")
    given = {name: Value(g, name) for name in INPUTS}
    r = basis.dictionary.shape[2]
    p, R = (1, 3 * r) if basis.prior else (3, r)

    rows = Rows(g, given)
    whitened, curves = (
        learned_rows(g, rows, basis, given["prior_scale"]) if basis.prior else paper_rows(g, rows, basis)
    )
    problem = pose((whitened.A, whitened.b), (given["l2"], given["gamma"]), given["nonnegative"], (p, R))
    one = g.constant(np.eye(R))
    # One call inverts for the code's posterior covariance and for the layers' W.
    wanted = [problem.H + one] if basis.prior else []
    if iteration == "splitting":
        wanted.append(problem.H + splitting_weight(problem) * one)
    inverses, log_dets = inverse(g, g.op("Concat", *wanted, axis=0), R) if wanted else (None, None)
    if iteration == "splitting":
        assert inverses is not None
        layer = splitting(problem, inverses.slice(-p, 2**31, 0))
    elif iteration == "ista":
        layer = ista(problem)
    else:
        raise InvalidArgument(f"There are no layers {iteration!r}.", f"Take one of {', '.join(LAYERS)}.")
    z = unroll(problem, layer, depth)
    before = gap_of(problem, z)
    if finish:
        x, gap, steps = walk(problem, z, before)
    else:
        x, gap, steps = z, before, 0.0 * before

    own = None
    many = g.op("Shape", given["lamp_modes"]).slice(0, 2, 0)  # k, q
    count = many.slice(0, 1, 0) * many.slice(1, 2, 0)
    if basis.prior:
        assert inverses is not None
        assert log_dets is not None
        assert whitened.log_det is not None
        assert whitened.modes is not None
        spread = inverses.slice(0, 1, 0).squeeze(0)
        own = own_blocks(spread, r)
        mean = (spread @ problem.g).squeeze(2)  # (1, R) the posterior mean
        rest = problem.rest(mean)
        loose, of_modes = mode_posterior(problem, whitened.modes, spread.unsqueeze(0), rest)
        squares = (rest * rest).sum(1, 2) + (mean * mean).sum(1)
        evidence = (-0.5 * (squares + whitened.log_det + log_dets.slice(0, 1, 0))).squeeze(0)
    else:
        spread = g.op("Expand", np.nan, g.ints(3 * r, 3 * r))
        evidence = g.constant(np.nan)
        loose, of_modes = g.op("Expand", np.nan, many), g.op("Expand", np.nan, g.op("Concat", count, count, axis=0))
    gained = g.op("Shape", given["gain_modes"]).slice(0, 2, 0)
    if whitened.gains is not None:
        gain_code = (whitened.gains.transpose(0, 2, 1) @ problem.rest(x)).like(gained)
    else:
        gain_code = g.op("Expand", 0.0, gained)
    code = x.reshape(3, r)
    answer = curves(code, own)
    if whitened.errors is not None:
        signals = g.op("Shape", rows.signals)
        explained = explain(given["explain"], whitened.errors, (mean, spread), answer, (signals, r))
    else:
        explained = [g.op("Expand", np.nan, g.ints(7, 3)), answer.predicted * np.nan]
    outputs = {
        "ssf": answer.ssf,
        "ssf_std": answer.std,
        "code": code.transpose(1, 0),
        "code_covariance": spread,
        "signals": rows.signals,
        "predicted": answer.predicted,
        "predicted_std": explained[1],
        "budget": explained[0],
        "gap": gap * np.ones(3),
        "layers_gap": before,
        "finish_steps": steps,
        "evidence": evidence,
        "channel_gain": rows.gain(),
        "lamp_estimate": answer.lamp,
        "mode_estimate": loose.like(many),
        "mode_covariance": of_modes.squeeze(0) if basis.prior else of_modes,
        "gain_code": gain_code,
        "gain_estimate": (gain_code.unsqueeze(1) @ given["gain_modes"]).squeeze(1),
    }
    shapes: dict[str, list[str | int]] = {
        "ssf": [M, 3],
        "ssf_std": [M, 3],
        "code": [r, 3],
        "code_covariance": [3 * r, 3 * r],
        "signals": ["k", "n", 3],
        "predicted": ["k", "n", 3],
        "predicted_std": ["k", "n", 3],
        "budget": [7, 3],
        "gap": [3],
        "layers_gap": [p],
        "finish_steps": [p],
        "evidence": [],
        "channel_gain": [3],
        "lamp_estimate": ["k", M],
        "mode_estimate": ["k", "q"],
        "mode_covariance": ["k q", "k q"],
        "gain_code": ["k", "g"],
        "gain_estimate": ["k", "n"],
    }
    for name in shapes:
        g.nodes.append(helper.make_node("Identity", [outputs[name].name], [name]))
    graph = helper.make_graph(
        g.nodes,
        g.name,
        [helper.make_tensor_value_info(name, D, shape) for name, shape in INPUTS.items()],
        [helper.make_tensor_value_info(name, D, shape) for name, shape in shapes.items()],
        g.initializers,
        doc_string="RAW patch statistics of a ColorChecker in, camera spectral sensitivities and their proof out.",
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR, producer_name="camssf"
    )
    model.producer_version = __version__
    metadata = {
        "basis": basis.name,
        "basis_sha256": basis.sha256(),
        "basis_source": basis.source,
        "iteration": iteration,
        "depth": str(depth),
        "finish": str(finish_steps(R) if finish else 0),
        "grid": "380 to 720 nm every 0.5 nm",
        "vocabulary": "1",
    }
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model, full_check=True)
    return model
