"""Runs the shipped models on every input of one .npz and writes their outputs to another.

Needs NumPy, ONNX Runtime and camssf's own files alone, so that an emulated processor can run it:
`python run_models.py inputs.npz outputs.npz`. Keys: `basis/case/name`.
"""

from __future__ import annotations

import platform
import sys

import numpy as np

from camssf.recovery.onnx_model import load_model


def main(given: str, made: str) -> None:
    """Every case of the input file, in its order."""
    with np.load(given) as content:
        cases: dict[tuple[str, str], dict[str, np.ndarray]] = {}
        for key in content.files:
            basis, case, name = key.split("/")
            cases.setdefault((basis, case), {})[name] = content[key]
    outputs = {"machine": np.array(platform.machine())}
    for number, ((basis, case), inputs) in enumerate(cases.items(), 1):
        for name, value in load_model(basis).run(inputs).items():
            outputs[f"{basis}/{case}/{name}"] = value
        print(f"{number}/{len(cases)}", file=sys.stderr, flush=True)
    np.savez(made, **outputs)  # type: ignore[arg-type]


if __name__ == "__main__":
    main(*sys.argv[1:])
