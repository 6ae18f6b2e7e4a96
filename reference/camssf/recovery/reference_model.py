"""Runs the formulas of a model on NumPy: the engine "reference", which takes any basis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats
from camssf.recovery.basis import Basis
from camssf.recovery.inputs import basis_arrays, of_hypothesis, with_hypothesis
from camssf.recovery.model import learned_model, paper_model


@dataclass(frozen=True)
class ReferenceModel:
    """The formulas on a basis; takes and gives what `camssf.recovery.onnx_model.Model` does."""

    basis: Basis

    def run(self, inputs: Mapping[str, Floats]) -> dict[str, Floats]:
        """Outputs by name for one hypothesis, from all inputs that docs/architecture.md names but `solve`."""
        basis = self.basis
        given = with_hypothesis(inputs) | {"solve": np.array(1.0)}
        with np.errstate(divide="ignore", invalid="ignore"):  # NaN where a curve does not respond to white
            if basis.prior:
                outputs = learned_model(given | basis_arrays(basis, basis.dictionary.shape[-1]))
            else:
                outputs = paper_model(given, basis.dictionary[0])
        return of_hypothesis(outputs)
