"""The documents that `camssf registry` prints: spread, drift, verification, deletion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from camssf.documents.excerpt import Generator
from camssf.shapes import Count, Text, Words
from camssf.version import __version__
from camssf_fleet.compare import Spread
from camssf_fleet.drift import OUTCOMES, Drift, LeftOut
from camssf_fleet.registry import Deletion
from camssf_fleet.verification import Verification

GENERATOR = Generator("camssf", __version__)


@dataclass(frozen=True, kw_only=True)
class Head:
    """What every document begins with.

    Attributes:
        format: name and version of the form.
        generator: the program that wrote it.
    """

    format: Text
    generator: Generator


@dataclass(frozen=True, kw_only=True, eq=False)
class SpreadDocument(Spread, Head):
    """How units of a model differ, as fractions of the peak; each (3,) red, green, blue.

    Attributes:
        format: name and version of this form.
        generator: the program that wrote it.
        model: name of the model.
        units, results: their numbers.
        without_serial: number of results left out because their unit is unknown.
        left_out: numbers of results that do not count, by status.
        observed: standard deviation between the units' mean curves, root mean square over 400 to 700 nm.
        repeat: standard deviation between results of one unit; null if no unit has two results.
        between: `observed` without the contribution of `repeat`; null if `repeat` is null.
        low, high: 95 % interval of `between`, or of `observed` if `between` is null.
    """

    format: Literal["camssf-spread/1"]


@dataclass(frozen=True, kw_only=True)
class DriftDocument(Head):
    """One unit over time.

    Attributes:
        format: name and version of this form.
        generator: the program that wrote it.
        serial: of the unit.
        outcome: undecided: no alarm, but the newest result was left out.
        alarm: whether any feature drifts.
        doubtful: doubtful results among those that count.
        features: centre and width of each channel.
        left_out: results of the unit, or possibly of it, that do not count, by time.
    """

    format: Literal["camssf-drift/1"]
    serial: Text
    outcome: Annotated[str, Words(OUTCOMES)]
    alarm: bool
    doubtful: Count
    features: tuple[Drift, ...]
    left_out: tuple[LeftOut, ...]


@dataclass(frozen=True, kw_only=True)
class VerificationDocument(Verification, Head):
    """Whether a registry is what was written.

    Attributes:
        format: name and version of this form.
        generator: the program that wrote it.
        files, rows, documents: numbers that were compared with their hashes.
        documents_missing: number of documents outside an archive that are not at hand.
        heads: the newest lists; a later verify --head notices that one is gone.
        faults: what is damaged, missing or of unknown origin, with its place.
        advice: what to do; "" without faults.
    """

    format: Literal["camssf-verification/1"]


@dataclass(frozen=True, kw_only=True)
class DeletionDocument(Deletion, Head):
    """The results that were deleted.

    Attributes:
        format: name and version of this form.
        generator: the program that wrote it.
        results: each deleted result.
        records: number of records that were deleted.
        files: number of files that were written again without them.
    """

    format: Literal["camssf-deletion/1"]
