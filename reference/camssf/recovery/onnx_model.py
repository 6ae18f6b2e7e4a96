"""Loads and runs the shipped ONNX models: one thread, sequentially, on the CPU."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import resources
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.recovery.basis import LEARNED, read_basis
from camssf.recovery.inputs import OF_HYPOTHESES, basis_arrays, of_hypothesis, with_hypothesis

SHIPPED = ("phones", "cameras", "ryyb", "gaussian")
VOCABULARY = "1"
LAST_SILENT = (1, 28)
"""Last version of ONNX Runtime without telemetry; later ones send usage data on every system unless disabled."""
SWITCH = "ORT_DISABLE_TELEMETRY"
"""Environment variable that disables the telemetry; ONNX Runtime reads it once, when it is loaded."""


@dataclass(frozen=True)
class Model:
    """A loaded model.

    Attributes:
        session: of ONNX Runtime; the learned bases have one.
        sha256: of the file, hex.
        metadata: of the file: depth, finish, grid, vocabulary; with the basis and its hash.
        arrays: the basis as inputs; none of the paper's, which its model contains.
    """

    session: Any
    sha256: str
    metadata: dict[str, str]
    arrays: dict[str, Floats] = field(default_factory=dict)

    def run(self, inputs: dict[str, Floats]) -> dict[str, Floats]:
        """All outputs by name for one hypothesis.

        Every input that docs/architecture.md names but the basis and `solve` must be given, without the axis of
        hypotheses.
        """
        given = with_hypothesis(inputs) | self.arrays | {"solve": np.array(1.0)}
        return of_hypothesis(run_session(self.session, given))


def run_session(session: Any, inputs: dict[str, Floats]) -> dict[str, Floats]:
    """All outputs of a session by name."""
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, inputs), strict=True))


def run_stack(models: Sequence[Model], inputs: Sequence[dict[str, Floats]]) -> list[dict[str, Floats]]:
    """`Model.run` of each of several learned bases on its inputs, in one call.

    The inputs may differ in those of OF_HYPOTHESES.
    """
    stacked = [{name: np.asarray(value, float) for name, value in one.items()} for one in inputs]
    given = stacked[0] | {name: np.stack([one[name] for one in stacked]) for name in OF_HYPOTHESES}
    given |= {name: np.concatenate([model.arrays[name] for model in models]) for name in models[0].arrays}
    given["solve"] = np.array(1.0)
    outputs = run_session(models[0].session, given)
    outputs["channel_gain"] = np.repeat(outputs["channel_gain"][None], len(models), axis=0)
    return [{name: value[i] for name, value in outputs.items()} for i in range(len(models))]


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
        InvalidArgument: there is no such model, or the files in this installation are damaged or of two versions.
    """
    if basis not in SHIPPED:
        raise InvalidArgument(
            f"No model of the basis {basis!r} is shipped.",
            f"Take one of {', '.join(SHIPPED)}, or engine='reference', which solves on any basis.",
        )
    name = f"camssf-{'learned' if basis in LEARNED else basis}.onnx"
    session, sha256, metadata = _open(name)
    known = read_basis(basis)
    if metadata.get("vocabulary") != VOCABULARY or metadata.get(f"basis_sha256 {basis}") != known.sha256():
        raise InvalidArgument(
            f"The model {name} and the basis {basis} do not belong to this version of camssf.", "Install camssf anew."
        )
    arrays = basis_arrays(known, int(metadata["atoms"])) if basis in LEARNED else {}
    return Model(session, sha256, metadata | {"basis": basis, "basis_sha256": known.sha256()}, arrays)


@lru_cache(maxsize=2)
def _open(name: str) -> tuple[Any, str, dict[str, str]]:
    """Session, SHA-256 and metadata of a model's file."""
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
    try:
        content = (resources.files("camssf") / "data" / name).read_bytes()
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        return session, hashlib.sha256(content).hexdigest(), dict(session.get_modelmeta().custom_metadata_map)
    except Exception as error:  # ONNX Runtime raises untyped exceptions of its own
        raise InvalidArgument(
            f"The model {name} of this installation cannot be loaded ({error}).", "Install camssf anew."
        ) from error
