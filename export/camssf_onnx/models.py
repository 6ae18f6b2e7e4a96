"""The shipped models: the functions of `camssf.recovery.model`, traced to ONNX graphs of standard operators."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from hashlib import sha256
from typing import Any

import numpy as np
import onnx
from onnx import helper

from camssf import __version__
from camssf.recovery.arrays import cond
from camssf.recovery.basis import LEARNED, NODES, Basis, read_basis
from camssf.recovery.drift import DRIFTS, UnitShots, drift_evidences
from camssf.recovery.inputs import basis_arrays
from camssf.recovery.layers import DEPTH
from camssf.recovery.misfit import JudgedSignals, misfit
from camssf.recovery.model import M, learned_model, paper_model
from camssf.recovery.onnx_model import VOCABULARY
from camssf.recovery.pivoting import finish_steps
from camssf.spectra.bundled import SURFACE_NODES
from camssf_colour.posterior import LinearResponse, components_of, posterior_of
from camssf_colour.response import SOURCES
from camssf_onnx.graph import Graph, info
from camssf_onnx.sizes import Dim
from camssf_onnx.tracer import Array, Tracer

OPSET, IR = 18, 9
INPUTS: dict[str, list[str | int]] = {
    "chart": ["e", "k", "n", 3],
    "white": ["k", "n", 3],
    "dark": ["k", "n", 3],
    "standard_error": ["e", "k", "n", 3],
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
ATOMS = 24
"""Number of atoms a channel of the learned bases' model."""
OF_BASIS: dict[str, list[str | int]] = {"mean": ["b", 3, NODES.size], "dictionary": ["b", 3, NODES.size, ATOMS]}
"""Shapes of the further inputs of the learned bases' model."""

OF_VERDICT: dict[str, list[str | int]] = {
    "signals": ["k", "n", 3],
    "standard_error": ["k", "n", 3],
    "predicted": ["k", "n", 3],
    "used": ["k", "n"],
    "level": ["k", "n", 3],
    "fields": ["f", "k", "n"],
    "curves": [M, 3],
    "code": ["r", 3],
    "lamp": ["k", M],
    "lamp_tolerance": ["k"],
    "lamp_modes": ["k", "q", M],
    "reflectance": ["n", M],
    "chart_tolerance": ["n"],
    "white_reflectance": [M],
    "white_tolerance": [],
    "gain_modes": ["k", "g", "n"],
    "gain_own": [],
    "explain": [],
    "new": ["k"],
    "first_lamp": [M],
    "mean": [3, NODES.size],
    "dictionary": [3, NODES.size, ATOMS],
}
"""Shapes of `JudgedSignals`, `explain` and `UnitShots`."""


def traced(
    name: str, inputs: Mapping[str, list[str | int]], function: Callable[[dict[str, Array]], dict[str, Array]]
) -> onnx.ModelProto:
    """The model of a function of arrays by name."""
    xp = Tracer(Graph())
    outputs = function({each: xp.input(each, shape) for each, shape in inputs.items()})
    for each, value in outputs.items():
        xp.graph.nodes.append(helper.make_node("Identity", [value.name], [each]))
    shapes = {
        each: [repr(size) if isinstance(size, Dim) else size for size in value.shape]
        for each, value in outputs.items()
    }
    graph = xp.graph.proto(
        name,
        [info(each, "float64", shape) for each, shape in inputs.items()],
        [info(each, value.dtype, shapes[each]) for each, value in outputs.items()],
    )
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR, producer_name="camssf"
    )
    model.producer_version = __version__
    return model


def build_learned() -> onnx.ModelProto:
    """The model of the learned bases, which are its inputs; its metadata has their hashes."""
    model = traced("camssf-learned", INPUTS | OF_BASIS, learned_model)
    hashes = {f"basis_sha256 {name}": read_basis(name).sha256() for name in LEARNED}
    of_bases = {"bases": " ".join(LEARNED), "bases_sha256": sha256(bases()).hexdigest(), "atoms": str(ATOMS)}
    return _described(model, SOLVES, hashes | of_bases | _of_solver(3 * ATOMS))


def build_paper(basis: Basis) -> onnx.ModelProto:
    """The model of the paper's basis, which it contains."""

    def function(inputs: dict[str, Array]) -> dict[str, Array]:
        return paper_model(inputs, inputs["chart"].xp.asarray(basis.dictionary[0]))

    atoms = basis.dictionary.shape[2]
    hashes = {f"basis_sha256 {basis.name}": basis.sha256()}
    return _described(traced(f"camssf-{basis.name}", INPUTS, function), SOLVES, hashes | _of_solver(atoms))


def build_verdict() -> onnx.ModelProto:
    """The model of what the verdict computes: `misfit`, and `drift_evidences` if a shot is new, else NaN."""

    def function(inputs: dict[str, Array]) -> dict[str, Array]:
        explain, xp = inputs.pop("explain"), inputs["signals"].xp
        unit = UnitShots(**{name: inputs.pop(name) for name in ("new", "first_lamp", "mean", "dictionary")})
        judged = JudgedSignals(**inputs)
        (drift,) = cond(
            xp.max(unit.new) > 0.5,
            lambda: [drift_evidences(judged, unit)],
            lambda: [xp.full((DRIFTS,), np.nan, dtype=xp.float64)],
        )
        return vars(misfit(judged, explain)) | {"drift": drift}

    return _described(traced("camssf-verdict", OF_VERDICT, function), "χ² of an answer, and what explains it.", {})


OF_SURFACES: dict[str, list[str | int]] = {
    "y": ["c"],
    "error": ["c"],
    "log_weights": ["n"],
    "shapes": ["n", SURFACE_NODES.size],
    "covariances": ["n", SURFACE_NODES.size, SURFACE_NODES.size],
    "signals": ["c", SURFACE_NODES.size],
    "outputs": ["p", SURFACE_NODES.size],
}
"""Shapes of a surface's signals, of the prior and of the response; its errors have inputs of their own by source."""


def build_surfaces() -> onnx.ModelProto:
    """The model of `camssf_colour.posterior.posterior_of`. It is not shipped before a host runs it."""
    moves: dict[str, list[str | int]] = {}
    for source in SOURCES:
        moves |= {f"{source}_signals": [source, "c", SURFACE_NODES.size]}
        moves |= {f"{source}_outputs": [source, 6, SURFACE_NODES.size]}

    def function(inputs: dict[str, Array]) -> dict[str, Array]:
        xp, sources = inputs["y"].xp, {}
        start: Any = 0
        for source in SOURCES:
            stop = start + inputs[f"{source}_signals"].shape[0]
            sources[source], start = slice(start, stop), stop
        signal_moves, output_moves = (
            xp.concat([inputs[f"{source}_{what}"] for source in SOURCES], axis=0) for what in ("signals", "outputs")
        )
        response = LinearResponse(inputs["signals"], signal_moves, inputs["outputs"], output_moves, sources)
        components = components_of(inputs["log_weights"], inputs["shapes"], inputs["covariances"], response)
        outputs = vars(posterior_of(components, response, inputs["y"], inputs["error"])).copy()
        return outputs | {f"by {name}": part for name, part in outputs.pop("parts").items()}

    return traced("camssf-surfaces", OF_SURFACES | moves, function)


SOLVES = "RAW patch statistics of a ColorChecker in, camera spectral sensitivities and proof out."


def _of_solver(size: int) -> dict[str, str]:
    """What the metadata says of the solver of a problem of this size."""
    return {"iteration": "splitting", "depth": str(DEPTH), "finish": str(finish_steps(size))}


def _described(model: onnx.ModelProto, text: str, metadata: dict[str, str]) -> onnx.ModelProto:
    """The checked model with what it is in words."""
    model.graph.doc_string = text
    metadata |= {"grid": "380 to 720 nm every 0.5 nm", "vocabulary": VOCABULARY}
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model, full_check=True)
    return model


def bases() -> bytes:
    """The learned bases for Kotlin: of each of LEARNED μ (3, 69), then Ψ (3, 69, ATOMS), float64, little-endian."""
    every = [basis_arrays(read_basis(name), ATOMS) for name in LEARNED]
    return b"".join(np.asarray(each[name], "<f8").tobytes() for each in every for name in ("mean", "dictionary"))


def files() -> dict[str, bytes]:
    """Content of each shipped file by name; the same sources give the same bytes."""
    models = {
        "learned": build_learned(),
        "gaussian": build_paper(read_basis("gaussian")),
        "verdict": build_verdict(),
    }
    contents = {f"camssf-{name}.onnx": model.SerializeToString(deterministic=True) for name, model in models.items()}
    return contents | {"bases.f64": bases()}
