"""What a stage of the golden vectors is: its cases, its run, and the limits of its outputs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from golden.forms import ROOT, Json

LARGEST_GAP = 1e-9
"""Largest relative duality gap of any engine's result."""
PLAIN = ("basis", "shots", "prior", "make", "unnamed", "called", "colour_matrices", "table")
"""Inputs that are no numbers."""
Limits: TypeAlias = Sequence[tuple[str, float, str]]
"""Limits against the stored outputs: metric, bound, names of the values."""


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
        requires: the capabilities that a runner needs.
        inputs, optional: keys of the inputs, and those that a case may leave out.
        cases: all cases before they are run; None: those that are stored, as `handwritten` says.
        limits: against the stored outputs, or all limits of a complete case from it and what `case` said of it.
        outputs: stored outputs beyond those of `limits`.
        arrays: inputs that `resolve` makes arrays of; None for all but PLAIN.
        rounded: outputs that are stored with fewer digits.
        convex: whether its cases are convex problems, which cvxpy solves, too.
    """

    name: str
    requires: str
    run: Callable[[Call], dict[str, Any]]
    inputs: frozenset[str]
    limits: Limits | Callable[[Json, Json], list[Json]]
    cases: Callable[[], Iterable[Json]] | None = None
    optional: frozenset[str] = frozenset()
    outputs: frozenset[str] = frozenset()
    arrays: frozenset[str] | None = None
    rounded: frozenset[str] = words("ssf ssf_std code_covariance")
    convex: bool = False

    def scenes(self) -> Iterable[Json]:
        """All cases before they are run."""
        return handwritten(self.name) if self.cases is None else self.cases()

    def stored_outputs(self) -> list[str]:
        """The outputs that a case stores."""
        limits = () if callable(self.limits) else self.limits
        return sorted(self.outputs.union(*(names.split() for _, _, names in limits)))

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
    truth: Json | None = None,
    rmse: float | None = None,
    outputs: Json | None = None,
) -> Json:
    """A case before it is run.

    Args:
        name: with its stage, "ssf/cameras-nikon".
        truth: the true camera; `rmse` bounds the error of the curves.
        outputs: those that the author knows; what is found must agree.
    """
    return {
        "case": name, "comment": comment, "inputs": inputs, "expect": expect, "truth": truth, "rmse": rmse,
        "outputs": outputs,
    }  # fmt: skip


def handwritten(stage: str, *, outputs: bool = False) -> Iterator[Json]:
    """The cases of a stage that are written by hand: `comment`, `expect`, `inputs`, and maybe `outputs`."""
    for path in sorted((ROOT / "cases" / stage).glob("*.json")):
        known = json.loads(path.read_bytes())
        yield case(
            f"{stage}/{path.stem}", known["comment"], known["inputs"], expect=known["expect"],
            outputs=known.get("outputs") if outputs else None,
        )  # fmt: skip


def limit(value: str, against: str, metric: str, bound: float, *requires: str) -> Json:
    """One limit as it is stored."""
    return {"value": value, "against": against, "metric": metric, "bound": {"float64": bound},
            "requires": list(requires)}  # fmt: skip


def stored(made: Json, limits: Limits) -> list[Json]:
    """Limits against the stored outputs, but for outputs that are null."""
    return [
        limit(name, "outputs", metric, bound)
        for metric, bound, names in limits
        for name in names.split()
        if made["outputs"][name] is not None
    ]


def against_truth(made: Json, scene: Json) -> list[Json]:
    """The error of the curves, where the true camera is given."""
    return [limit("ssf", "truth", "rmse", scene["rmse"])] if made["truth"] is not None else []
