"""`python -m camssf_onnx build` writes the shipped models and bases, `check` rebuilds and compares the bytes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import camssf
from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import write_file
from camssf.libraries import install_extra

DATA = Path(camssf.__file__).parent / "data"
LARGEST = 400_000
"""Largest allowed size of a model file, bytes."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; exit status 0, 1 if a check failed, or that of the error's family."""
    parser = argparse.ArgumentParser(prog="python -m camssf_onnx", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("build", help="write the files into the package's data folder")
    verbs.add_parser("check", help="build in memory, compare with the shipped bytes")
    verb = parser.parse_args(arguments).verb
    try:
        return _build() if verb == "build" else _check()
    except CalibrationError as error:
        print(f"{error.code}: {error}", file=sys.stderr)
        return error.exit_status


def built() -> dict[str, bytes]:
    """Content of each file by name, built now.

    Raises:
        InvalidArgument: onnx is not installed.
    """
    try:
        from camssf_onnx.models import files
    except ImportError as error:
        raise InvalidArgument(f"the models cannot be built without {error.name}.", install_extra("export")) from error
    return files()


def faults(content: bytes) -> list[str]:
    """Faults of a model file: too large, another opset or IR, non-standard operators, external data, invalid."""
    import onnx

    from camssf_onnx.models import IR, OPSET

    model = onnx.load_model_from_string(content)
    found = []
    if len(content) > LARGEST:
        found.append(f"{len(content)} bytes, more than {LARGEST}")
    if model.ir_version != IR:
        found.append(f"IR {model.ir_version}, not {IR}")
    if [(opset.domain, opset.version) for opset in model.opset_import] != [("", OPSET)]:
        found.append(f"opsets {[(o.domain, o.version) for o in model.opset_import]}, not the standard {OPSET} alone")
    odd = sorted({f"{node.domain}.{node.op_type}" for node in _nodes(model.graph) if node.domain})
    if odd or model.functions:
        found.append(f"operators outside the standard: {', '.join(odd) or 'local functions'}")
    if any(tensor.data_location == onnx.TensorProto.EXTERNAL for tensor in model.graph.initializer):
        found.append("data outside the file")
    try:
        onnx.checker.check_model(model, full_check=True)
    except onnx.checker.ValidationError as error:
        found.append(f"invalid: {error}")
    return found


def _nodes(graph: Any) -> Iterator[Any]:
    """All nodes, including those of subgraphs."""
    for node in graph.node:
        yield node
        for attribute in node.attribute:
            if attribute.HasField("g"):
                yield from _nodes(attribute.g)


def _build() -> int:
    for name, content in built().items():
        write_file(DATA / name, content)
        print(_line(name, content))
    return 0


def _line(name: str, content: bytes) -> str:
    import onnx

    nodes = ""
    if name.endswith(".onnx"):
        nodes = f"  {sum(1 for _ in _nodes(onnx.load_model_from_string(content).graph))} nodes"
    return f"{name}  {len(content)} bytes{nodes}  SHA-256 {sha256(content).hexdigest()}"


def _check() -> int:
    passed, failed = 0, 0
    for name, content in built().items():
        path = DATA / name
        try:
            shipped = path.read_bytes()
        except OSError as error:
            raise InvalidArgument(
                f"{path.name} cannot be read ({error.strerror}).", "Run `python -m camssf_onnx build`."
            ) from error
        print(_line(name, shipped))
        wrong = faults(shipped) if name.endswith(".onnx") else []
        if content == shipped:
            print("  built anew: the same bytes")
        else:
            wrong.append(f"built anew: other bytes, SHA-256 {sha256(content).hexdigest()}")
        for fault in wrong:
            print(f"  FAILED {fault}")
        passed, failed = passed + (not wrong), failed + bool(wrong)
    print(f"{passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
