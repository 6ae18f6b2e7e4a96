"""Runs a case through camssf, by either engine, and compares the result with the case's limits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from camssf.errors import CalibrationError
from golden.compare import METRICS
from golden.contract import PLAIN, Call
from golden.forms import Json, resolve
from golden.linear_model import LinearModel
from golden.products import build_rows
from golden.reading import CAPABILITIES
from golden.stages import STAGES

LACKING = {"metadata"}
"""Capabilities that Python's reader lacks; a phone's may have them."""
ABILITIES = CAPABILITIES - LACKING


class Finding(NamedTuple):
    """One limit and the measured value; `skipped` names the capability that the runner lacks."""

    limit: str
    measured: float
    bound: float
    skipped: str = ""

    @property
    def holds(self) -> bool:
        """Whether the measured value is within the bound, or was skipped; a NaN is not."""
        return bool(self.skipped) or bool(self.measured <= self.bound)


def arrays(case: Json) -> dict[str, Any]:
    """The case's inputs with every form resolved."""
    numbers = STAGES[case["stage"]].arrays
    return {
        key: resolve(value) if (key not in PLAIN if numbers is None else key in numbers) else value
        for key, value in case["inputs"].items()
    }


def run(case: Json, engine: str = "reference") -> dict[str, Any]:
    """The outputs of a case.

    Raises:
        CalibrationError: the error that an error case expects.
    """
    return STAGES[case["stage"]].run(Call(given=arrays(case), case=case, engine=engine))


def problem(case: Json) -> LinearModel:
    """A, b and Σ of a case with convex problems."""
    return build_rows(arrays(case))


def findings(case: Json, engine: str = "reference") -> list[Finding]:
    """Measure every limit of the case; for an error case compare the error code."""
    try:
        outputs = run(case, engine)
    except CalibrationError as error:
        return [Finding(f"expect {case['expect']}, found {error.code}", float(error.code != case["expect"]), 0.0)]
    if case["expect"] != "success":
        return [Finding(f"expect {case['expect']}, found success", 1.0, 0.0)]
    return judge(case, outputs)


def judge(case: Json, outputs: dict[str, Any]) -> list[Finding]:
    """Compare outputs with the limits; what is null in the file, as a band without a prior, must be absent."""
    found = []
    for limit in case["limits"]:
        name = f"{limit['value']} against {limit['against']}, {limit['metric']}"
        lacking = sorted(set(limit["requires"]) - ABILITIES)
        if lacking:
            found.append(Finding(name, 0.0, 0.0, f"needs {', '.join(lacking)}"))
            continue
        known = case[limit["against"]][limit["value"]]
        expected = resolve(known) if limit["metric"] != "exact" else known
        measured = METRICS[limit["metric"]](outputs[limit["value"]], expected)
        found.append(Finding(name, measured, limit["bound"]["float64"]))
    return found + [
        Finding(f"{name} is absent", float(outputs[name] is not None and not np.isnan(outputs[name]).all()), 0.0)
        for name, value in case["outputs"].items()
        if value is None and name in outputs
    ]
