"""Loads and runs the shipped ONNX models: one thread, sequentially, on the CPU."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats

SHIPPED = ("phones", "cameras", "ryyb", "gaussian")
VOCABULARY = "1"
LAST_SILENT = (1, 28)
"""Last version of ONNX Runtime without telemetry; later ones send usage data on every system unless disabled."""
SWITCH = "ORT_DISABLE_TELEMETRY"
"""Environment variable that disables the telemetry; ONNX Runtime reads it once, when it is loaded."""
OUTPUTS = (
    "ssf", "ssf_std", "code", "code_covariance", "signals", "predicted", "predicted_std", "budget", "gap",
    "layers_gap", "finish_steps", "evidence", "channel_gain", "lamp_estimate", "mode_estimate", "mode_covariance",
    "gain_code", "gain_estimate",
)  # fmt: skip


OF_HYPOTHESES = ("reflectance", "white_reflectance", "lamp", "lamp_tolerance", "lamp_modes")
"""Inputs with a leading axis of hypotheses."""


@dataclass(frozen=True)
class Model:
    """A loaded model.

    Attributes:
        session: of ONNX Runtime.
        sha256: of the file, hex.
        metadata: of the file: basis and its hash, depth, finish, grid, vocabulary.
    """

    session: Any
    sha256: str
    metadata: dict[str, str]

    def run(self, inputs: dict[str, Floats], outputs: Sequence[str] = OUTPUTS) -> dict[str, Floats]:
        """Outputs by name for one hypothesis.

        Every input that docs/architecture.md names but `solve` must be given, without the axis of hypotheses.
        """
        given = {name: np.asarray(value, float) for name, value in inputs.items()} | {"solve": np.array(1.0)}
        given |= {name: given[name][None] for name in OF_HYPOTHESES if name in given}
        found = dict(zip(outputs, self.session.run(list(outputs), given), strict=True))
        if "evidence" in found:
            found["evidence"] = found["evidence"][0]
        return found


def onnx_runtime() -> Any:
    """Import ONNX Runtime with its telemetry disabled. Nothing else in this repository imports it.

    The version that camssf requires has no telemetry; in a newer one it is disabled before loading.

    Raises:
        InvalidArgument: a newer version was imported before with its telemetry on, which can no longer be stopped.
    """
    early = sys.modules.get("onnxruntime")
    version = str(getattr(early, "__version__", "of an unknown version"))
    if early is not None and not _silent(version) and os.environ.get(SWITCH) != "1":
        raise InvalidArgument(
            f"ONNX Runtime {version} was imported before camssf could switch off its telemetry.",
            f"Install onnxruntime 1.28.0, which camssf needs; or set {SWITCH}=1 before anything imports it; "
            "or take engine='reference', which needs no ONNX Runtime.",
        )
    os.environ[SWITCH] = "1"
    import onnxruntime

    # Windows: every version writes to the system's own event log. Elsewhere this does nothing up to 1.28.
    onnxruntime.disable_telemetry_events()
    return onnxruntime


def _silent(version: str) -> bool:
    """Whether a version is known to have no telemetry; False if it cannot be parsed."""
    parts = version.split(".")[:2]
    return len(parts) == 2 and all(part.isdecimal() for part in parts) and tuple(map(int, parts)) <= LAST_SILENT


@lru_cache(maxsize=4)
def load_model(basis: str) -> Model:
    """The shipped model of a basis.

    Raises:
        InvalidArgument: there is no such model, or the file in this installation is damaged.
    """
    if basis not in SHIPPED:
        raise InvalidArgument(
            f"No model of the basis {basis!r} is shipped.",
            f"Take one of {', '.join(SHIPPED)}, or engine='reference', which solves on any basis.",
        )
    onnxruntime = onnx_runtime()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    # Run exactly the graph that was checked; this also halves the loading time.
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("mlas.disable_kleidiai", "1")
    file = resources.files("camssf") / "data" / f"camssf-{basis}.onnx"
    try:
        content = file.read_bytes()
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        metadata = dict(session.get_modelmeta().custom_metadata_map)
    except Exception as error:  # ONNX Runtime raises untyped exceptions of its own
        raise InvalidArgument(
            f"The model camssf-{basis}.onnx of this installation cannot be loaded ({error}).", "Install camssf anew."
        ) from error
    if metadata.get("vocabulary") != VOCABULARY or metadata.get("basis") != basis:
        raise InvalidArgument(
            f"The model camssf-{basis}.onnx does not belong to this version of camssf.", "Install camssf anew."
        )
    return Model(session, hashlib.sha256(content).hexdigest(), metadata)
