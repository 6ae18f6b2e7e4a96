"""What became of one job of a batch, and of all."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from camssf_fleet.records import Row

KEPT = "The earlier result of this name was kept as it is."


@dataclass(frozen=True)
class Outcome:
    """What became of one job.

    Attributes:
        name, folder: as in `Job`.
        status: "accepted", "doubtful", "refused" (with a code of `camssf.errors`), "failed" (bug, crash).
        code: of the first reason, "" if accepted.
        reason: in words.
        made_from: SHA-256 of all that determines the result; "" if the files could not be read.
        resumed: the result is from an earlier run and its inputs are unchanged.
        row: of the result in the registry; None without a result or a registry.
        deaths: number of processes that died during the job.
    """

    name: str
    status: str
    code: str = ""
    reason: str = ""
    folder: str = ""
    made_from: str = ""
    resumed: bool = False
    row: Row | None = None
    deaths: int = 0

    @property
    def ok(self) -> bool:
        """Whether the result has curves."""
        return self.status in ("accepted", "doubtful")

    @property
    def camera(self) -> str:
        """Make and model; "" without a row."""
        return "" if self.row is None else f"{self.row.make} {self.row.model}".strip()


@dataclass
class Summary:
    """Numbers of jobs of a manifest.

    Attributes:
        by_status: by status.
        by_code: by the code of the first reason, if there is one.
        examples: by code, the name and the reason of one job.
        by_model: by make and model ("" if unknown), and status.
        resumed: done in an earlier run.
        added: results that the registry did not have.
        duplicates: made from the same files as another name.
        seconds: duration of the run.
        outcomes: of each job, in the manifest's order; empty with a registry, which keeps them.
    """

    by_status: Counter[str] = field(default_factory=Counter)
    by_code: Counter[str] = field(default_factory=Counter)
    examples: dict[str, str] = field(default_factory=dict)
    by_model: dict[str, Counter[str]] = field(default_factory=dict)
    resumed: int = 0
    added: int = 0
    duplicates: int = 0
    seconds: float = 0.0
    outcomes: tuple[Outcome, ...] = ()

    @property
    def total(self) -> int:
        """Number of all jobs."""
        return self.by_status.total()

    @property
    def failed(self) -> int:
        """Number of jobs without curves."""
        return self.by_status["refused"] + self.by_status["failed"]

    def add(self, outcome: Outcome) -> None:
        """Count the outcome of a job."""
        self.resumed += outcome.resumed
        self.count(outcome.status, outcome.code, outcome.camera)
        if outcome.code:
            self.examples.setdefault(outcome.code, f"{outcome.name}: {outcome.reason}")

    def count(self, status: str, code: str, camera: str) -> None:
        """Count one job."""
        self.by_status[status] += 1
        if code:
            self.by_code[code] += 1
        self.by_model.setdefault(camera, Counter())[status] += 1

    def document(self) -> dict[str, Any]:
        """As plain data, without the outcomes."""
        numbers = {name: value for name, value in vars(self).items() if name != "outcomes"}
        return {"format": "camssf-batch-summary/1", "total": self.total} | numbers
