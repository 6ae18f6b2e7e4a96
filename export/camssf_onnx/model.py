"""The whole algebra from Eq. (5) to the curves as one ONNX graph: float64, opset 18, standard operators only.

The same steps in the same order as the files of these names in `camssf.curves`, which are the specification.
Differences of form, none of value:

- What is known only on the 5-nm nodes stays there: integrals are folded onto them (`fold`), curves unfolded.
- ONNX has no float64 Cholesky or inverse. Rows are whitened by Gauss' elimination in a Loop, whose scaled pivot rows
  are L⁻¹ (A | b). Matrices of unit diagonal are inverted by a Loop of symmetric sweeps, one rank-one update each.
- The three channels are solved side by side; one that has arrived stands still.
- No infinities: a bound that does not exist is ±1e300.
"""

from __future__ import annotations

import numpy as np
import onnx
from onnx import helper

from camssf import __version__
from camssf.curves.basis import Basis
from camssf.curves.finish import finish_steps
from camssf.curves.layers import DEPTH
from camssf_onnx.algebra import BIG, D, M, inverse
from camssf_onnx.finish import finish
from camssf_onnx.graph import Graph, Value
from camssf_onnx.layers import unroll
from camssf_onnx.problem import pose
from camssf_onnx.sensing import Rows, learned_rows, paper_rows

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
    "l2": [],
    "gamma": [],
}


def build(basis: Basis, *, depth: int = DEPTH) -> onnx.ModelProto:
    """The model of a basis; the same basis gives the same bytes."""
    g = Graph(f"camssf-{basis.name}")
    given = {name: Value(g, name) for name in INPUTS}
    nonnegative = Value(g, "nonnegative")
    r = basis.dictionary.shape[2]

    rows = Rows(g, given)
    A, b, curves = learned_rows(g, rows, basis) if basis.prior else paper_rows(g, rows, basis)
    H = A.transpose(0, 2, 1) @ A
    pull = (A.transpose(0, 2, 1) @ b.unsqueeze(2)).squeeze(2)  # (3, r) g
    l2, gamma = given["l2"], given["gamma"]
    eye = g.constant(np.eye(r))
    quadratic = H + l2 * eye  # M
    rho = gamma + 2.0 * l2
    low = -g.op("Where", g.op("Greater", nonnegative, 0.5), BIG, gamma)
    # The layers' weights and the code's posterior covariance in one go.
    both = inverse(g, g.op("Concat", quadratic + rho * eye, H + eye, axis=0), r)
    W, spread = both.slice(0, 3, 0), both.slice(3, 6, 0)

    problem = pose((A, b), quadratic, (l2, gamma), nonnegative, r)
    z = unroll(g, W, problem.pulled(W, pull, rho), rho, gamma, low, r, depth)
    x, gap = finish(problem, z)
    ssf, std, predicted, lamp = curves(x, spread)
    outputs = {
        "ssf": ssf,
        "ssf_std": std,
        "code": x.transpose(1, 0),
        "signals": rows.signals,
        "predicted": predicted,
        "gap": gap,
        "channel_gain": rows.gain(),
        "lamp_estimate": lamp,
    }
    shapes: dict[str, list[str | int]] = {
        "ssf": [M, 3],
        "ssf_std": [M, 3],
        "code": [r, 3],
        "signals": ["k", "n", 3],
        "predicted": ["k", "n", 3],
        "gap": [3],
        "channel_gain": [3],
        "lamp_estimate": ["k", M],
    }
    for name in shapes:
        g.nodes.append(helper.make_node("Identity", [outputs[name].name], [name]))
    default = helper.make_tensor("nonnegative", D, [], [0.0 if basis.prior else 1.0])
    graph = helper.make_graph(
        g.nodes,
        g.name,
        [helper.make_tensor_value_info(name, D, shape) for name, shape in INPUTS.items()]
        + [helper.make_tensor_value_info("nonnegative", D, [])],
        [helper.make_tensor_value_info(name, D, shape) for name, shape in shapes.items()],
        [*g.initializers, default],
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
        "depth": str(depth),
        "finish": str(finish_steps(r)),
        "grid": "380 to 720 nm every 0.5 nm",
        "vocabulary": "1",
    }
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model, full_check=True)
    return model
