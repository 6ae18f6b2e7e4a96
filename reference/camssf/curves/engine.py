"""The shipped ONNX models and the one way to run them: one thread, in order, on the CPU."""

from __future__ import annotations

import hashlib
import os
import sys
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats

SHIPPED = ("phones", "cameras", "gaussian")
VOCABULARY = "1"
LAST_SILENT = (1, 28)
"""Version of ONNX Runtime after which it reports its use to its maker, on every system, unless it is told not to."""
SWITCH = "ORT_DISABLE_TELEMETRY"
"""The whole of that switch, an environment variable; read once, when the library is loaded."""
OUTPUTS = (
    "ssf", "ssf_std", "code", "code_covariance", "signals", "predicted", "gap", "layers_gap", "finish_steps",
    "evidence", "channel_gain", "lamp_estimate", "mode_estimate", "mode_covariance", "gain_code", "gain_estimate",
)  # fmt: skip


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
        """Outputs by name. Every input that docs/architecture.md names must be given, float64."""
        values = self.session.run(list(OUTPUTS), {name: np.asarray(value, float) for name, value in inputs.items()})
        return dict(zip(OUTPUTS, values, strict=True))


def onnx_runtime() -> Any:
    """ONNX Runtime, which reports nothing to its maker. Nothing else in this repository imports it.

    The version that camssf asks for cannot report; a newer one is switched off before it is loaded.

    Raises:
        InvalidArgument: something else loaded a newer one before, and not switched off: it has begun to report, and
            cannot be stopped any more.
    """
    early = sys.modules.get("onnxruntime")
    version = str(getattr(early, "__version__", "of an unknown version"))
    if early is not None and not _silent(version) and os.environ.get(SWITCH) != "1":
        raise InvalidArgument(
            f"ONNX Runtime {version} was imported before camssf could keep it from reporting to its maker.",
            f"Install onnxruntime 1.28.0, which camssf asks for; or set {SWITCH}=1 before anything imports it; "
            "or take engine='reference', which does without.",
        )
    os.environ[SWITCH] = "1"
    import onnxruntime

    # Windows: every version writes to the system's own event log. Elsewhere this does nothing up to 1.28.
    onnxruntime.disable_telemetry_events()
    return onnxruntime


def _silent(version: str) -> bool:
    """Whether a version has nothing to report with; one that cannot be read is not taken for one."""
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
            f"The model camssf-{basis}.onnx of this installation cannot be loaded ({error}).", "Install camssf anew."
        ) from error
    if metadata.get("vocabulary") != VOCABULARY or metadata.get("basis") != basis:
        raise InvalidArgument(
            f"The model camssf-{basis}.onnx does not belong to this version of camssf.", "Install camssf anew."
        )
    return Model(session, hashlib.sha256(content).hexdigest(), metadata)
