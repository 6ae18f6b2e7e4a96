"""What a stage of the golden vectors is: its cases, its run, and the limits of its outputs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from golden.forms import NIKON, ROOT, Json

LARGEST_GAP = 1e-9
"""Largest relative duality gap of any engine's result."""
PLAIN = ("basis", "shots", "prior", "make", "lights", "colour_matrices", "table")
"""Inputs that are no numbers."""
Limits: TypeAlias = Sequence[tuple[str, float, str]]
"""Limits against the stored outputs: metric, bound, names of the values."""
Row: TypeAlias = tuple[str, str, Json]
"""Name, comment, and what is unlike the base case of the stage, or unlike EXPECTED."""
EXPECTED: Json = {"expect": "success", "rmse": None, "outputs": None}
"""What a row expects: an error's code; a bound on the error of the curves against the true camera, NIKON unless the
row names another; outputs that the author knows, with which what is computed must agree."""


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
        inputs, optional: keys of the inputs, and those that a case may leave out.
        limits: against the stored outputs, or all limits of a complete case from it and its row.
        rows: all cases; None: those that are stored are written by hand: `comment`, `expect`, `inputs`.
        requires: the capabilities that a runner needs, if others than that of the stage's name.
        inputs_of: the inputs of a case from a row's change.
        outputs: stored outputs beyond those of `limits`.
        written: whether the outputs of cases by hand were, too.
        arrays: inputs that `resolve` makes arrays of; None for all but PLAIN.
        rounded: outputs that are stored with fewer digits.
        convex: whether its cases are convex problems, which cvxpy solves, too.
    """

    name: str
    run: Callable[[Call], dict[str, Any]]
    inputs: frozenset[str]
    limits: Limits | Callable[[Json, Json], list[Json]]
    rows: Callable[[], Iterable[Row]] | None = None
    inputs_of: Callable[[Json], Json] = dict
    requires: str = ""
    optional: frozenset[str] = frozenset()
    outputs: frozenset[str] = frozenset()
    written: bool = False
    arrays: frozenset[str] | None = None
    rounded: frozenset[str] = words("ssf ssf_std code_covariance_sums")
    convex: bool = False

    def scenes(self) -> Iterator[Json]:
        """All cases before they are run: `case`, `comment`, `inputs`, and what they expect."""
        for name, comment, change in self._stored_rows() if self.rows is None else self.rows():
            inputs = self.inputs_of({key: value for key, value in change.items() if key not in EXPECTED})
            known = {key: change.get(key, usual) for key, usual in EXPECTED.items()}
            truth = None if known["rmse"] is None else change.get("camera", NIKON)
            yield {"case": f"{self.name}/{name}", "comment": comment, "inputs": inputs, "truth": truth, **known}

    def _stored_rows(self) -> Iterator[Row]:
        for path in sorted((ROOT / "cases" / self.name).glob("*.json")):
            known = json.loads(path.read_bytes())
            outputs = known.get("outputs") if self.written else None
            yield path.stem, known["comment"], known["inputs"] | {"expect": known["expect"], "outputs": outputs}

    def stored_outputs(self) -> list[str]:
        """The outputs that a case stores."""
        limits = () if callable(self.limits) else self.limits
        return sorted(self.outputs.union(*(names.split() for _, _, names in limits)))

    def limits_of(self, made: Json, scene: Json) -> list[Json]:
        """All limits of a complete case."""
        if callable(self.limits):
            return self.limits(made, scene)
        return [*stored(made, self.limits), *against_truth(made, scene)]


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
    """The error of the curves, where the true camera is known."""
    return [limit("ssf", "truth", "rmse", scene["rmse"])] if made["truth"] is not None else []
