"""The shipped ONNX models and the one way to run them: one thread, in order, on the CPU."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats

SHIPPED = ("cameras", "gaussian")
VOCABULARY = "1"
OUTPUTS = ("ssf", "ssf_std", "code", "signals", "predicted", "gap", "channel_gain", "lamp_estimate")


@dataclass(frozen=True)
class Model:
    """A loaded model.

    Attributes:
        session: of ONNX Runtime.
        sha256: of the file, hex.
        metadata: what the model says of itself: basis and its hash, depth, finish, grid, vocabulary.
    """

    session: Any
    sha256: str
    metadata: dict[str, str]

    def run(self, inputs: dict[str, Floats]) -> dict[str, Floats]:
        """Outputs by name; inputs as DESIGN.md's contract names them, float64."""
        values = self.session.run(list(OUTPUTS), {name: np.asarray(value, float) for name, value in inputs.items()})
        return dict(zip(OUTPUTS, values, strict=True))


@lru_cache(maxsize=4)
def load_model(basis: str) -> Model:
    """The shipped model of a basis.

    Raises:
        InvalidArgument: there is no such model, or the file in this installation is damaged.
    """
    if basis not in SHIPPED:
        raise InvalidArgument(
            f"no model of the basis {basis!r} is shipped.",
            f"Take one of {', '.join(SHIPPED)}, or engine='reference', which solves on any basis.",
        )
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    # The graph that was checked is the graph that runs; it also loads in half the time.
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("mlas.disable_kleidiai", "1")
    file = resources.files("camssf") / "data" / f"camssf-{basis}.onnx"
    try:
        content = file.read_bytes()
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        metadata = dict(session.get_modelmeta().custom_metadata_map)
    except Exception as error:  # ONNX Runtime raises its own kinds, none of them typed for us
        raise InvalidArgument(
            f"the model camssf-{basis}.onnx of this installation cannot be loaded ({error}).", "Install camssf anew."
        ) from error
    if metadata.get("vocabulary") != VOCABULARY or metadata.get("basis") != basis:
        raise InvalidArgument(
            f"the model camssf-{basis}.onnx does not belong to this version of camssf.", "Install camssf anew."
        )
    return Model(session, hashlib.sha256(content).hexdigest(), metadata)
