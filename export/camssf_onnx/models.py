"""The shipped models: the functions of `camssf.recovery.model`, traced to ONNX graphs of standard operators."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import fields
from hashlib import sha256
from typing import Any

import numpy as np
import onnx
from onnx import helper

from camssf import __version__
from camssf.colorimetry import white_of
from camssf.recovery.arrays import cond
from camssf.recovery.basis import LEARNED, NODES, Basis, misfit_profile, read_basis
from camssf.recovery.causes import CAUSES, ChartScene, cause_evidences
from camssf.recovery.drift import DRIFTS, UnitShots, drift_evidences
from camssf.recovery.inputs import basis_arrays
from camssf.recovery.layers import DEPTH
from camssf.recovery.misfit import AnswerBasis, JudgedSignals, misfit
from camssf.recovery.model import M, learned_model, paper_model
from camssf.recovery.onnx_model import VOCABULARY
from camssf.recovery.pivoting import finish_steps
from camssf.spectra import read_lamp
from camssf.spectra.bundled import SURFACE_NODES
from camssf_colour.light import LightInputs, condition
from camssf_colour.picture import SPACES
from camssf_colour.picture_file import profile_of
from camssf_colour.picture_strip import StripInputs, picture_strip
from camssf_colour.pixel_table import COVARIANCE_NODES, PAIRS, RATIO_NODES, PixelTable
from camssf_colour.posterior import Components, LinearResponse, components_of, exact_posteriors, posterior_of
from camssf_colour.response import SOURCES, Viewed, response_of
from camssf_colour.surface_prior import SurfacePrior
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
    "first_lamp": [M],
    "mean": [3, NODES.size],
    "dictionary": [3, NODES.size, ATOMS],
    "new": ["k"],
    "raw_white": ["k", 3],
    "weigh": [],
    "places": ["n", 2],
    "reference": ["n"],
    "tables": ["t", "n", M],
}
"""Shapes of `JudgedSignals`, `explain`, `AnswerBasis`, `UnitShots`, `weigh` and `ChartScene`."""

CELLS: list[str | int] = ["h", 2, "w", 2]
OF_STRIP: dict[str, list[str | int]] = {
    "mosaic": CELLS, "clipped": CELLS, "dark": CELLS, "gains": CELLS, "photon_noise": [3], "matrix": [3, 3],
    "curved": [],
}  # fmt: skip
OF_TABLE: dict[str, list[str | int]] = {
    "roots": [RATIO_NODES**2, 3], "covariance": [COVARIANCE_NODES**2, len(PAIRS)], "distance": [COVARIANCE_NODES**2],
}  # fmt: skip
"""Shapes of `StripInputs` and `PixelTable`."""


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
    """The model of what the verdict computes.

    `misfit`, `drift_evidences` if a shot is new, and `cause_evidences` of one shot if `weigh` is 1; else NaN.
    """

    def function(inputs: dict[str, Array]) -> dict[str, Array]:
        explain, weigh, xp = inputs.pop("explain"), inputs.pop("weigh"), inputs["signals"].xp
        unit = UnitShots(**{field.name: inputs.pop(field.name) for field in fields(UnitShots)})
        basis = AnswerBasis(**{field.name: inputs.pop(field.name) for field in fields(AnswerBasis)})
        scene = ChartScene(**{field.name: inputs.pop(field.name) for field in fields(ChartScene)})
        judged = JudgedSignals(**inputs)

        def nothing(size: Any) -> Array:
            return xp.full((size,), np.nan, dtype=xp.float64)

        (drift,) = cond(
            xp.max(unit.new) > 0.5, lambda: [drift_evidences(judged, basis, unit)], lambda: [nothing(DRIFTS)]
        )
        of_causes, of_patches = cond(
            weigh > 0.5,
            lambda: list(vars(cause_evidences(judged, basis, scene)).values()),
            lambda: [nothing(len(CAUSES)), nothing(judged.signals.shape[1])],
        )
        return vars(misfit(judged, explain)) | {"drift": drift, "cause": of_causes, "cause_patch": of_patches}

    return _described(
        traced("camssf-verdict", OF_VERDICT, function),
        "χ² of an answer, what explains it, and what may have spoilt the capture.",
        {},
    )


J = SURFACE_NODES.size
OF_PRIOR: dict[str, list[str | int]] = {
    "log_weights": ["n"],
    "shapes": ["n", J],
    "variances": ["n", "v"],
    "shared": ["v", J, J],
    "changes": ["q", J],
}
"""Shapes of a prior of surfaces."""
MOVES = "moves by "
"""Before the names of the sources where one model gives their errors and another takes them."""
OF_RESPONSE: dict[str, list[str | int]] = {
    "signals": ["c", J],
    "outputs": ["p", J],
    **{MOVES + source: [source, "w", J] for source in SOURCES},
}
"""Shapes of a linear response; an error changes w rows: the signals, then the last outputs."""
OF_LIGHT_INPUTS: dict[str, list[str | int]] = {
    "curves": [M, 3],
    "curve_modes": ["q", M, 3],
    "lamp": ["j", M],
    "lamp_modes": ["p", M],
    "of_photo": ["j", "p"],
    "ratios": ["j", 2],
    "ratio_error": ["j"],
    "measured": ["j"],
    "own_raw": [3],
    "own_lamp": [M],
    "own_modes": ["w", M],
}
"""Shapes of `LightInputs`."""
OF_VIEWED: dict[str, list[str | int]] = {
    "tolerance": ["j"],
    "smooth": ["s", M],
    "observer": [M, 3],
    "aim": [3],
    "adapted": [],
}
"""Shapes of `Viewed`."""
OF_COMPONENTS: dict[str, list[str | int]] = {
    "log_weights": ["n"],
    "scale": ["n"],
    "variances": ["n", "v"],
    "shared": ["v", "r", "r"],
    "changes": ["n", "q", "r"],
    "expected": ["n", "r"],
    "of_level": ["n", "r"],
    "crossed": ["n", "r", "c"],
    "prior_variance": ["p"],
    **{source: ["n", "e", "e"] for source in SOURCES},
}
"""Shapes of `Components`."""
COMPONENT = "component "
"""Before these names, where one model gives them and another takes them."""
COMPONENTS = {COMPONENT + name: shape for name, shape in OF_COMPONENTS.items()}


def build_lights() -> onnx.ModelProto:
    """The model of `camssf_colour.light.condition` and, under these lights, `camssf_colour.response.response_of`."""

    def function(inputs: dict[str, Array]) -> dict[str, Array]:
        light = condition(LightInputs(**{name: inputs[name] for name in OF_LIGHT_INPUTS}))
        viewed = Viewed(**{name: inputs[name] for name in OF_VIEWED})
        outputs = vars(response_of(light, inputs["lamp_modes"].shape[0], viewed)).copy()
        outputs |= {MOVES + source: moves for source, moves in outputs.pop("moves").items()}
        return outputs | {"log_evidence": light.log_evidence, "chi_squared": light.chi_squared}

    return traced("surfaces-lights", OF_LIGHT_INPUTS | OF_VIEWED, function)


def build_components() -> onnx.ModelProto:
    """The model of `camssf_colour.posterior.components_of`: a prior as a response sees it."""

    def function(inputs: dict[str, Array]) -> dict[str, Array]:
        xp, sources = inputs["signals"].xp, {}
        start: Any = 0
        for source in SOURCES:
            stop = start + inputs[MOVES + source].shape[0]
            sources[source], start = slice(start, stop), stop
        moves, c = xp.concat([inputs[MOVES + source] for source in SOURCES]), inputs["signals"].shape[0]
        response = LinearResponse(inputs["signals"], moves[:, :c, :], inputs["outputs"], moves[:, c:, :], sources)
        prior: dict[str, Any] = {name: inputs[name] for name in OF_PRIOR}
        outputs = vars(components_of(SurfacePrior("", **prior), response)).copy()
        return {COMPONENT + name: array for name, array in (outputs | outputs.pop("errors")).items()}

    return traced("surfaces-components", OF_PRIOR | OF_RESPONSE, function)


def build_posterior() -> onnx.ModelProto:
    """The model of `posterior_of`: one surface."""

    def function(inputs: dict[str, Array]) -> dict[str, Array]:
        outputs: dict[str, Any] = vars(posterior_of(_components(inputs), inputs["y"], inputs["error"])).copy()
        return {**outputs.pop("parts"), **outputs}

    return traced("surfaces-posterior", COMPONENTS | {"y": ["c"], "error": ["c"]}, function)


def build_exact() -> onnx.ModelProto:
    """The model of `exact_posteriors`: many signals without noise."""

    def function(inputs: dict[str, Array]) -> dict[str, Array]:
        return vars(exact_posteriors(_components(inputs), inputs["fine"], inputs["coarse"]))

    return traced("surfaces-exact", COMPONENTS | {"fine": ["b", "m", "c"], "coarse": ["k", "c"]}, function)


def build_picture() -> onnx.ModelProto:
    """The model of `picture_strip`: a strip of a mosaic."""

    def function(inputs: dict[str, Array]) -> dict[str, Array]:
        table = PixelTable(**{name: inputs[name] for name in OF_TABLE})
        picture, uncertainty = picture_strip(StripInputs(**{name: inputs[name] for name in OF_STRIP}), table)
        return {"picture": picture, "uncertainty": uncertainty}

    return traced("surfaces-picture", OF_STRIP | OF_TABLE, function)


def _components(inputs: dict[str, Array]) -> Components:
    arrays = {name: inputs[COMPONENT + name] for name in OF_COMPONENTS}
    return Components(errors={name: arrays.pop(name) for name in SOURCES}, **arrays)


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
    """The learned bases for Kotlin, float64, little-endian.

    Of each of LEARNED μ (3, 69), then Ψ (3, 69, ATOMS); last the misfit profile (3, 69) of all.
    """
    every = [basis_arrays(read_basis(name), ATOMS) for name in LEARNED]
    arrays = [one[name] for one in every for name in ("mean", "dictionary")] + [misfit_profile()]
    return b"".join(np.asarray(array, "<f8").tobytes() for array in arrays)


def picture_spaces() -> bytes:
    """The colour spaces of pictures for Kotlin: matrices from XYZ over white, and ICC profiles in hexadecimal."""
    spaces = {}
    for space in SPACES.values():
        profile = profile_of(space)
        spaces[space.name] = {
            "matrix": np.round(space.matrix(white_of(read_lamp(space.white).values)), 12).ravel().tolist(),
            "curved": space.primaries is not None,
            "profile": None if profile is None else profile.hex(),
        }
    return (json.dumps({"format": "camssf-picture-spaces/1", "spaces": spaces}) + "\n").encode()


def files() -> dict[str, bytes]:
    """Content of each shipped file by name; the same sources give the same bytes."""
    models = {
        "camssf-learned": build_learned(),
        "camssf-gaussian": build_paper(read_basis("gaussian")),
        "camssf-verdict": build_verdict(),
        "surfaces-lights": build_lights(),
        "surfaces-components": build_components(),
        "surfaces-posterior": build_posterior(),
        "surfaces-exact": build_exact(),
        "surfaces-picture": build_picture(),
    }
    contents = {f"{name}.onnx": model.SerializeToString(deterministic=True) for name, model in models.items()}
    return contents | {"bases.f64": bases(), "picture-spaces.json": picture_spaces()}
