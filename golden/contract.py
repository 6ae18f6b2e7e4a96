"""What a stage of the golden vectors is: its cases, its run, and the limits of its outputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from golden.forms import Json
from golden.linear_model import LinearModel


def words(text: str) -> frozenset[str]:
    """The words of a text as a set."""
    return frozenset(text.split())


class Call(NamedTuple):
    """What a stage's `run` is called with: the inputs as arrays, the case, and the engine, `reference` or `onnx`."""

    given: dict[str, Any]
    case: Json
    engine: str = "reference"


@dataclass(frozen=True)
class Keys:
    """The keys of a stage's cases.

    Attributes:
        inputs, optional: of the inputs; format.md gives the optional ones' defaults.
        outputs: of the outputs.
        arrays: inputs that `resolve` makes arrays of; None for all but PLAIN.
        rounded: outputs that are stored with fewer digits.
    """

    inputs: frozenset[str]
    outputs: frozenset[str]
    optional: frozenset[str] = frozenset()
    arrays: frozenset[str] | None = None
    rounded: frozenset[str] = words("ssf ssf_std code_covariance W")


@dataclass(frozen=True)
class Stage:
    """One stage.

    Attributes:
        name: its folder under cases/.
        keys: of its cases.
        requires: the capabilities that a runner needs for a case of these inputs.
        cases: all cases before they are run.
        run: the outputs of a case by the reference or the model.
        limits: of a complete case and what `case` said of it.
        problem: the rows of a case's convex problems, from its inputs; None where it has none.
        oracle: whether cvxpy solves them, too.
    """

    name: str
    keys: Keys
    requires: Callable[[Json], list[str]]
    cases: Callable[[], Iterator[Json]]
    run: Callable[[Call], dict[str, Any]]
    limits: Callable[[Json, Json], list[Json]]
    problem: Callable[[dict[str, Any]], LinearModel] | None = None
    oracle: bool = False


PLAIN = ("basis", "shots", "iteration", "depth", "prior", "make", "unnamed", "called", "colour_matrices")
"""Inputs that are no numbers."""


def case(
    name: str,
    comment: str,
    inputs: Json,
    *,
    expect: str = "success",
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
        truth: the true camera; `rmse` bounds the error of the curves.
        generic: whether code and pivots may be compared (stage `solve`).
        files: photos by their path in golden/.
        outputs: what was written to the file, where no reader says it (stage `mosaic`).
    """
    return {
        "case": name, "comment": comment, "inputs": inputs, "expect": expect, "truth": truth, "rmse": rmse,
        "generic": generic, "files": files or {}, "outputs": outputs,
    }  # fmt: skip


def always(*names: str) -> Callable[[Json], list[str]]:
    """`requires` of a stage whose cases all need the same."""
    return lambda inputs: list(names)


def limit(value: str, against: str, metric: str, bound: float, *requires: str) -> Json:
    """One limit as it is stored."""
    return {"value": value, "against": against, "metric": metric, "bound": {"float64": bound},
            "requires": list(requires)}  # fmt: skip


def each(metric: str, bound: float, names: str) -> list[tuple[str, str, float]]:
    """The same metric and bound for some outputs."""
    return [(name, metric, bound) for name in names.split()]


def stored(made: Json, limits: Sequence[tuple[str, str, float]]) -> list[Json]:
    """Limits against the stored outputs, (value, metric, bound) each, but for outputs that are null."""
    return [
        limit(name, "outputs", metric, bound) for name, metric, bound in limits if made["outputs"][name] is not None
    ]


def against_stored(limits: Sequence[tuple[str, str, float]]) -> Callable[[Json, Json], list[Json]]:
    """`limits` of a stage that compares stored outputs alone."""
    return lambda made, scene: stored(made, limits)


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


LARGEST_GAP = 1e-9
"""Largest relative duality gap of any engine's result."""
