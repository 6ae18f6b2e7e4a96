"""What a basis is learned from: measured curves, or what is kept of them, their origin and their enlargement."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from camssf.curves.basis import NODES, basis_file, read_basis
from camssf.errors import InvalidArgument
from camssf.files import local
from camssf.grid import Floats

LARGEST = 64 * 2**20
"""Bytes of a table of curves."""
FEW_MAKERS = 2.0
"""What a covariance estimated from n groups falls short of for a member of a new one, in squared lengths:
(n + 1) (n - 1) / (n (n - 3)), the variance of Student's predictive distribution. The eight makers of rawtoaces,
weighed by the roots of their numbers, are worth n = (Σ w)² / Σ w² = 5.9."""
BEYOND = 20.0
"""Past its ends a measured curve falls straight to 0 over so many nm. Filters cut there, but not at once: of the 52
cameras of rawtoaces green keeps .4 of its 400 nm at 390, and .7 of its 700 nm at 710."""


@dataclass(frozen=True)
class Enlargement:
    """Standard deviations of the random changes of one copy.

    Attributes:
        shift: along the wavelength, nm; half of its variance common to the three channels.
        width: relative change of width about the channel's centre of gravity.
        warp: smooth change of ln s.
        cross_talk: share of the other channels that leaks in.
        few_makers: by how much the spread between cameras counts more, in squared lengths.
        smooth: correlation length of the warp, nm.
        own_mean: the mean is that of the cameras, not of their copies. Curves are never negative, so cross-talk moves
            the mean of copies: R's centre of gravity by 5 nm where it is 0.1.
    """

    shift: float = 4.5
    width: float = 0.06
    warp: float = 0.25
    cross_talk: float = 0.02
    few_makers: float = FEW_MAKERS
    smooth: float = 120.0
    own_mean: bool = False


HANDFUL = Enlargement(3.0, 0.04, 0.15, 0.10, 1.0, 60.0, own_mean=True)
"""For six phones of two makers, by leaving phones and makers out: `python -m benchmarks.phones --choose`. Phones lie
closer together than cameras do, so less shift and width; what their bands lack is at the feet of the curves and finer
than 120 nm, so more cross-talk and a shorter warp. Counting the spread between phones more than once widens only what
is wide enough."""


@dataclass(frozen=True)
class Statistics:
    """What is kept of cameras whose curves are not.

    Attributes:
        mean: (3, 69), peak 1.
        spread: (3, 69, r) root of their covariance, the enlargement's included: a basis' dictionary.
        names: of the cameras.
    """

    mean: Floats
    spread: Floats
    names: tuple[str, ...]


def read_curves(path: Path, *, least: int = 2) -> dict[str, Floats]:
    """Cameras of a CSV with columns camera, wavelength_nm, R, G, B: name → (69, 3) on the 5-nm nodes, peak 1.

    Where a table ends within the grid its curves fall to 0 over BEYOND.

    Raises:
        InvalidArgument: unreadable, curves that do not cover 400 to 700 nm, or fewer than `least`.
    """
    rows: dict[str, list[list[float]]] = {}
    try:
        with local(path).open("rb") as binary:
            data = binary.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise ValueError(f"it is larger than {LARGEST} bytes")
        for row in csv.DictReader(io.StringIO(data.decode("utf-8"), newline="")):
            numbers = [float(row[key]) for key in ("wavelength_nm", "R", "G", "B")]
            rows.setdefault(row["camera"], []).append(numbers)
    except (OSError, KeyError, ValueError, TypeError, csv.Error) as error:
        raise InvalidArgument(
            f"{path} cannot be read as measured curves ({error}).",
            "Give a CSV with the columns camera,wavelength_nm,R,G,B.",
        ) from error
    curves = {}
    for name, lines in rows.items():
        table = np.array(sorted(lines))
        if (
            table[0, 0] > 400
            or table[-1, 0] < 700
            or not np.isfinite(table).all()
            or (table[:, 1:].max(0) <= 0).any()
        ):
            raise InvalidArgument(f"{name} in {path} does not cover 400 to 700 nm with numbers.", "Leave it out.")
        ends = np.clip(1.0 - np.maximum(table[0, 0] - NODES, NODES - table[-1, 0]) / BEYOND, 0.0, 1.0)
        response = np.stack([ends * np.interp(NODES, table[:, 0], table[:, c]) for c in (1, 2, 3)], axis=1)
        curves[name] = np.maximum(response, 0.0) / response.max(axis=0)
    if len(curves) < least:
        raise InvalidArgument(f"{path} holds {len(curves)} camera(s).", "A spread needs at least two.")
    return curves


def maker_of(camera: str) -> str:
    """The first word of a camera's name."""
    return camera.split(maxsplit=1)[0].casefold() if camera.strip() else camera


@dataclass(frozen=True)
class TrainingSet:
    """Measured cameras and where they come from, in the order in which they are learned from.

    Attributes:
        curves: by name, (69, 3) on the 5-nm nodes, peak 1.
        files, sha256, licences: of the CSV files, oldest first.
        papers: in which the curves were published, where somebody asks to be named.
        size: how the curves are enlarged.
        known: further cameras, of which no curves are kept.
        noun: what `known`, or all of them, are.
    """

    curves: dict[str, Floats]
    files: tuple[str, ...]
    sha256: tuple[str, ...]
    licences: tuple[str, ...]
    papers: tuple[str, ...] = ()
    size: Enlargement = field(default_factory=Enlargement)
    known: Statistics | None = None
    noun: str = "cameras"

    def joined(self, other: TrainingSet) -> TrainingSet:
        """Both sets as one, the other's curves enlarged as these.

        Raises:
            InvalidArgument: a camera is in both.
        """
        names = [*self.curves, *(self.known.names if self.known else ())]
        known = {name.casefold() for name in names}
        twice = [name for name in other.curves if name.casefold() in known]
        if twice:
            raise InvalidArgument(
                f"{twice[0]} is in {', '.join(other.files)} and in the basis already.",
                "Give it another name, the maker first, to let both count.",
            )
        return replace(
            self,
            curves=self.curves | other.curves,
            files=self.files + other.files,
            sha256=self.sha256 + other.sha256,
            licences=self.licences + other.licences,
            papers=self.papers + other.papers,
        )

    def source(self, components: int) -> str:
        """In words, for the report."""
        origins = zip(self.files, self.sha256, self.licences, strict=True)
        parts = [f"{file}, SHA-256 {digest[:16]}..., licence {licence}" for file, digest, licence in origins]
        parts += [f"published in {paper}" for paper in self.papers]
        groups = [(len(self.known.names), self.noun)] if self.known else []
        if self.curves or not groups:
            groups.append((len(self.curves), "cameras" if self.known else self.noun))
        who = " and ".join(f"{count} measured {noun[:-1] if count == 1 else noun}" for count, noun in groups)
        return f"{components} components learned from {who} ({'; '.join(parts)})"


def read_training_set(path: Path, licence: str, *, least: int = 2) -> TrainingSet:
    """The cameras of a CSV; errors as `read_curves`."""
    curves = read_curves(path, least=least)
    return TrainingSet(curves, (path.name,), (hashlib.sha256(path.read_bytes()).hexdigest(),), (licence,))


def training_set_of(spec: str) -> TrainingSet:
    """What a basis was learned from: `cameras`, `phones`, or a file that this command wrote.

    Raises:
        InvalidArgument: no such basis, or one that does not carry its cameras.
    """
    read_basis(spec)  # says what is wrong with it
    try:
        with basis_file(spec).open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            return _carried(content)
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise InvalidArgument(
            f"{spec!r} does not carry the cameras it was learned from ({error}), so nothing can be added to them.",
            "Learn anew from all curves in one CSV.",
        ) from error


def _carried(content: Mapping[str, Any]) -> TrainingSet:
    """From the arrays of a basis file; those of version 0.1 say nothing of papers, enlargement and statistics."""

    def words(key: str) -> tuple[str, ...]:
        return tuple(map(str, np.atleast_1d(content[key]))) if key in content else ()

    names, curves = tuple(map(str, content["cameras"])), content["curves"]
    _hold(curves, (len(names), NODES.size, 3))
    size, known = Enlargement(), None
    if "enlargement" in content:
        _hold(content["enlargement"], (len(fields(Enlargement)),))
        numbers = dict(
            zip([field.name for field in fields(Enlargement)], content["enlargement"].tolist(), strict=True)
        )
        size = Enlargement(**numbers | {"own_mean": bool(numbers["own_mean"])})
    if "known" in content:
        known = Statistics(content["known_mean"], content["known_spread"], words("known"))
        _hold(known.mean, (3, NODES.size))
        _hold(known.spread, (3, NODES.size, known.spread.shape[-1]))
    files, sha256, licences = (tuple(map(str, np.atleast_1d(content[key]))) for key in ("files", "sha256", "licence"))
    return TrainingSet(
        dict(zip(names, curves, strict=True)),
        files,
        sha256,
        licences,
        papers=words("papers"),
        size=size,
        known=known,
        noun=str(content["noun"]) if "noun" in content else "cameras",
    )


def _hold(array: Floats, shape: tuple[int, ...]) -> None:
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"an array of shape {array.shape}, where {shape} of finite numbers is needed")
