"""What a stage of the golden vectors is: its cases, its run, and the limits of its outputs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from golden.forms import Json
from golden.linear_model import LinearModel

LARGEST_GAP = 1e-9
"""Largest relative duality gap of any engine's result."""
PLAIN = ("basis", "shots", "depth", "prior", "make", "unnamed", "called", "colour_matrices")
"""Inputs that are no numbers."""
Rows: TypeAlias = Sequence[tuple[str, str, float]]
"""Limits against the stored outputs: value, metric, bound."""


def words(text: str) -> frozenset[str]:
    """The words of a text as a set."""
    return frozenset(text.split())


class Call(NamedTuple):
    """What a stage's `run` is called with: the inputs as arrays, the case, and the engine, `reference` or `onnx`."""

    given: dict[str, Any]
    case: Json
    engine: str = "reference"


@dataclass(frozen=True)
class Stage:
    """One stage.

    Attributes:
        name: its folder under cases/.
        requires: the capabilities that a runner needs, unless a case says others.
        cases: all cases before they are run.
        run: the outputs of a case by the reference or the model.
        inputs, optional: keys of the inputs, and those that a case may leave out.
        limits: rows of limits, or all limits of a complete case from it and what `case` said of it.
        outputs: stored outputs beyond those of the rows.
        arrays: inputs that `resolve` makes arrays of; None for all but PLAIN.
        rounded: outputs that are stored with fewer digits.
        problem: the rows of a case's convex problems, from its inputs; None where it has none.
        oracle: whether cvxpy solves them, too.
    """

    name: str
    requires: str
    cases: Callable[[], Iterable[Json]]
    run: Callable[[Call], dict[str, Any]]
    inputs: frozenset[str]
    limits: Rows | Callable[[Json, Json], list[Json]]
    optional: frozenset[str] = frozenset()
    outputs: frozenset[str] = frozenset()
    arrays: frozenset[str] | None = None
    rounded: frozenset[str] = words("ssf ssf_std code_covariance W")
    problem: Callable[[dict[str, Any]], LinearModel] | None = None
    oracle: bool = False

    def stored_outputs(self) -> list[str]:
        """The outputs that a case stores."""
        return sorted(self.outputs | (set() if callable(self.limits) else {name for name, _, _ in self.limits}))

    def limits_of(self, made: Json, scene: Json) -> list[Json]:
        """All limits of a complete case."""
        if callable(self.limits):
            return self.limits(made, scene)
        return [*stored(made, self.limits), *against_truth(made, scene)]


def case(
    name: str,
    comment: str,
    inputs: Json,
    *,
    expect: str = "success",
    requires: str | None = None,
    truth: Json | None = None,
    rmse: float | None = None,
    generic: bool = True,
    files: dict[str, bytes] | None = None,
    outputs: Json | None = None,
) -> Json:
    """A case before it is run.

    Args:
        name: with its stage, "ssf/cameras-nikon".
        comment: the one reason why the case is there.
        inputs: in the forms of format.md.
        expect: "success" or an error code.
        requires: the capabilities that a runner needs, if others than the stage's.
        truth: the true camera; `rmse` bounds the error of the curves.
        generic: whether code and pivots may be compared (stage `solve`).
        files: photos by their path in golden/.
        outputs: those that the author knows; what is found must agree.
    """
    return {
        "case": name, "comment": comment, "inputs": inputs, "expect": expect, "requires": requires, "truth": truth,
        "rmse": rmse, "generic": generic, "files": files or {}, "outputs": outputs,
    }  # fmt: skip


def limit(value: str, against: str, metric: str, bound: float, *requires: str) -> Json:
    """One limit as it is stored."""
    return {"value": value, "against": against, "metric": metric, "bound": {"float64": bound},
            "requires": list(requires)}  # fmt: skip


def each(metric: str, bound: float, names: str) -> list[tuple[str, str, float]]:
    """The same metric and bound for some outputs."""
    return [(name, metric, bound) for name in names.split()]


def stored(made: Json, rows: Rows) -> list[Json]:
    """Limits against the stored outputs, but for outputs that are null."""
    return [
        limit(name, "outputs", metric, bound) for name, metric, bound in rows if made["outputs"][name] is not None
    ]


def against_oracle(made: Json, *requires: str) -> list[Json]:
    """Objective, gap and curves of a case with an oracle; the objective may require a capability."""
    if made["oracle"] is None:
        return []
    curves = [limit("ssf", "oracle", "peak", 1e-6)] if made["oracle"]["ssf"] is not None else []
    return [
        limit("objective", "oracle", "relative", 1e-9, *requires),
        limit("gap", "oracle", "at_most", LARGEST_GAP),
        *curves,
    ]


def against_truth(made: Json, scene: Json) -> list[Json]:
    """The error of the curves, where the true camera is given."""
    return [limit("ssf", "truth", "rmse", scene["rmse"])] if made["truth"] is not None else []
