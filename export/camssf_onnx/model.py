"""Builds the whole algebra from Eq. (5) to the curves as one ONNX graph: float64, opset 18, standard operators.

The steps and their order are those of the files of the same names in `camssf.recovery`, which are the specification.
They differ in form, not in value:

- The algebra works on the 5-nm nodes: integrals are folded onto them (`fold`), curves interpolated (`unfold`).
- ONNX has no float64 Cholesky or inverse. `whiten` replaces them by a Loop over panels of pivots; inverses are
  L⁻ᵀ L⁻¹.
- Without modes Σ is one block a patch plus a low-rank part: the blocks are whitened first, the rest by a system of
  the size of that rank (`Folded.sparse`). With modes Σ is whitened whole (`Folded.dense`).
- All problems are solved at once; one that has reached its optimum no longer changes.
- The lamps have a leading axis of hypotheses h, and the chart one of c = h, or 1 for all. With `solve` 0 the evidence
  of every hypothesis is computed and nothing else; with `solve` 1 the first one is solved.
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
from camssf_onnx.algebra import D, M, inverse, whiten_and_root
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
    "reflectance": ["c", "n", M],
    "chart_tolerance": ["n"],
    "white_reflectance": ["c", M],
    "white_tolerance": [],
    "lamp": ["h", "k", M],
    "lamp_tolerance": ["h", "k"],
    "lamp_modes": ["h", "k", "q", M],
    "gain_modes": ["k", "g", "n"],
    "gain_own": [],
    "l2": [],
    "gamma": [],
    "nonnegative": [],
    "prior_scale": [],
    "explain": [],
    "solve": [],
}
"""Shapes of the inputs. All are required: an input with a default cannot be set from Java."""


def output_shapes(p: int, r: int) -> dict[str, list[str | int]]:
    """Shapes of the outputs that depend on `solve`, of p problems and r atoms a channel."""
    return {
        "ssf": [M, 3],
        "ssf_std": [M, 3],
        "code": [r, 3],
        "code_covariance": [3 * r, 3 * r],
        "predicted": ["k", "n", 3],
        "predicted_std": ["k", "n", 3],
        "budget": [7, 3],
        "gap": [3],
        "layers_gap": [p],
        "finish_steps": [p],
        "evidence": ["h"],
        "lamp_estimate": ["k", M],
        "mode_estimate": ["k", "q"],
        "mode_covariance": ["k q", "k q"],
        "gain_code": ["k", "g"],
        "gain_estimate": ["k", "n"],
    }


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
    signals, modes, gain_modes = (g.op("Shape", given[name]) for name in ("chart", "lamp_modes", "gain_modes"))
    sizes = {"k": signals.slice(0, 1, 0), "n": signals.slice(1, 2, 0), "h": modes.slice(0, 1, 0)}
    sizes |= {"q": modes.slice(2, 3, 0), "g": gain_modes.slice(1, 2, 0)}
    sizes["k q"] = sizes["k"] * sizes["q"]
    shapes = output_shapes(p, r)

    def nothing(g: Graph, name: str) -> Value:
        """NaN in the shape of an output."""
        size = [g.ints(each) if isinstance(each, int) else sizes[each].here(g) for each in shapes[name]]
        return g.op("Expand", np.nan, g.op("Concat", *size, axis=0))

    def solved(g: Graph) -> list[Value]:
        """The outputs for the first hypothesis."""
        here = {name: value.here(g) for name, value in given.items()}
        A, b = (each.here(g).slice(0, p, 0) for each in (whitened.A, whitened.b))
        problem = pose((A, b), (here["l2"], here["gamma"]), here["nonnegative"], (p, R))
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
        code = x.reshape(3, r)
        found = {"code": code.transpose(1, 0), "gap": gap * np.ones(3), "layers_gap": before, "finish_steps": steps}

        own = None
        if basis.prior:
            assert inverses is not None
            assert log_dets is not None
            assert whitened.log_det is not None
            assert whitened.modes is not None
            spread = inverses.slice(0, 1, 0).squeeze(0)
            own = own_blocks(spread, r)
            mean = (spread @ problem.g).squeeze(2)  # (1, R) the posterior mean
            rest = problem.rest(mean)
            D_ = whitened.modes.here(g).slice(0, 1, 0)
            loose, of_modes = mode_posterior(problem, D_, spread.unsqueeze(0), rest)
            found |= {"code_covariance": spread, "mode_covariance": of_modes.squeeze(0)}
            found["mode_estimate"] = loose.like(g.op("Concat", sizes["k"], sizes["q"], axis=0))
            log_det = whitened.log_det.here(g).slice(0, 1, 0) + log_dets.slice(0, 1, 0)
            found["evidence"] = _evidence(rest, mean.unsqueeze(2), log_det)
        gained = gain_modes.here(g).slice(0, 2, 0)
        if whitened.gains is not None:
            D_ = whitened.gains.here(g).slice(0, 1, 0)
            gain_code = (D_.transpose(0, 2, 1) @ problem.rest(x)).like(gained)
        else:
            gain_code = g.op("Expand", 0.0, gained)
        found |= {"gain_code": gain_code, "gain_estimate": (gain_code.unsqueeze(1) @ here["gain_modes"]).squeeze(1)}
        answer = curves(code, own)
        found |= {
            "ssf": answer.ssf,
            "ssf_std": answer.std,
            "predicted": answer.predicted,
            "lamp_estimate": answer.lamp,
        }
        if whitened.errors is not None:
            explained = explain(here["explain"], whitened.errors, (mean, spread), answer, (signals.here(g), r))
            found |= zip(("budget", "predicted_std"), explained, strict=True)
        return [found[name] if name in found else nothing(g, name) for name in shapes]

    def weighed(g: Graph) -> list[Value]:
        """The evidence of every hypothesis, and nothing else: `log_evidences` of `camssf.recovery.solve`."""
        assert whitened.log_det is not None
        A, b = whitened.A.here(g), whitened.b.here(g).unsqueeze(2)
        across = A.transpose(0, 2, 1)
        K = across @ A + np.eye(R)
        pull, log_det, root = whiten_and_root(g, K, across @ b)
        mean = root.solve(pull).slice(0, R, 1)  # (h, R, 1)
        evidence = _evidence(b - A @ mean, mean, whitened.log_det.here(g) + log_det)
        return [evidence if name == "evidence" else nothing(g, name) for name in shapes]

    wanted = g.op("Greater", given["solve"], 0.5)
    answers = g.choose(wanted, solved, weighed, "solve") if basis.prior else solved(g)
    outputs = dict(zip(shapes, answers, strict=True)) | {"signals": rows.signals, "channel_gain": rows.gain()}
    shapes |= {"signals": ["k", "n", 3], "channel_gain": [3]}
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


def _evidence(rest: Value, mean: Value, log_det: Value) -> Value:
    """-½ (‖b - A x̂‖² + ‖x̂‖² + ln det P), (h,), from the residual (h, N, 1) and the posterior mean x̂ (h, R, 1)."""
    return -0.5 * ((rest * rest).sum(1, 2) + (mean * mean).sum(1, 2) + log_det)
