"""Training sets of a basis: measured curves or their statistics, their origin, and the size of random copies."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.files import local
from camssf.grid import Floats
from camssf.recovery.basis import NODES, basis_file, read_basis

LARGEST = 64 * 2**20
"""Largest size of a table of curves, bytes."""
FEW_MAKERS = 2.0
"""Factor by which the covariance for a member of a new group exceeds that estimated from n groups:
(n + 1) (n - 1) / (n (n - 3)), the variance of Student's predictive distribution. The eight makers of rawtoaces,
weighted by the roots of their numbers, count as n = (Σ w)² / Σ w² = 5.9."""
BEYOND = 20.0
"""Beyond its ends a measured curve falls linearly to 0 over this length, nm. Filters do not cut abruptly: for the 52
cameras of rawtoaces, green keeps 0.4 of its 400 nm value at 390 nm, and 0.7 of its 700 nm value at 710 nm."""


@dataclass(frozen=True)
class Enlargement:
    """Standard deviations of the random changes of one copy.

    Attributes:
        shift: along the wavelength, nm; half of its variance is common to the three channels.
        width: relative change of width about the channel's centre of gravity.
        warp: smooth change of ln s.
        cross_talk: share of the other channels that leaks in.
        few_makers: factor on the covariance between cameras.
        smooth: correlation length of the warp, nm.
        own_mean: use the mean of the cameras, not of their copies. Curves are never negative, so cross-talk shifts
            the mean of the copies: R's centre of gravity by 5 nm for a cross-talk of 0.1.
        process: share of the covariance that is that of a Gaussian process (`process_rows`), not of the copies.
    """

    shift: float = 4.5
    width: float = 0.06
    warp: float = 0.25
    cross_talk: float = 0.02
    few_makers: float = FEW_MAKERS
    smooth: float = 120.0
    own_mean: bool = False
    process: float = 0.0


HANDFUL = Enlargement(3.0, 0.04, 0.15, 0.10, 1.0, 60.0, own_mean=True, process=0.5)
"""For six phones of two makers; chosen by leaving phones and makers out (docs/accuracy.md).
Phones differ less than cameras, so shift and width are smaller. Their bands were too narrow at the feet of the curves
and for details finer than 120 nm, so cross-talk is larger and the warp's correlation length shorter. A larger
`few_makers` would only widen bands that are wide enough."""


YELLOW = (0.3, 0.5, 0.75, 1.0)
"""Shares of red in yellow, relative to the peaks of the curves."""
RYYB_PHONES = "RYYB phones"
"""What the curves of `with_yellow` are of."""


@dataclass(frozen=True)
class Statistics:
    """Mean and covariance of cameras whose curves are not stored.

    Attributes:
        mean: (3, 69), peak 1.
        spread: (3, 69, r) root of their covariance, random copies included: a basis' dictionary.
        names: of the cameras.
    """

    mean: Floats
    spread: Floats
    names: tuple[str, ...]


def read_curves(path: Path, *, least: int = 2) -> dict[str, Floats]:
    """Read a CSV with the columns camera, wavelength_nm, R, G, B: name → (69, 3) on the 5-nm nodes, peak 1.

    If a table ends within the grid, its curves fall to 0 over BEYOND.

    Raises:
        InvalidArgument: an unreadable file, curves that do not cover 400 to 700 nm, or fewer than `least` cameras.
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
        raise InvalidArgument(f"{path} holds {len(curves)} camera(s).", "A basis needs at least two.")
    return curves


def maker_of(camera: str) -> str:
    """The maker in a camera's name: its first word, in lower case."""
    return camera.split(maxsplit=1)[0].casefold() if camera.strip() else camera


@dataclass(frozen=True)
class TrainingSet:
    """Measured cameras and their origin, in the order in which they are learned from.

    Attributes:
        curves: by name, (69, 3) on the 5-nm nodes, peak 1.
        files, sha256, licences: of the CSV files, oldest first.
        papers: in which the curves were published, to be cited.
        size: of the random changes of the copies.
        statistics: statistics of further cameras whose curves are not stored.
        noun: "cameras", "phones" or RYYB_PHONES: what `known` are, or all of them if there is no `known`.
    """

    curves: dict[str, Floats]
    files: tuple[str, ...]
    sha256: tuple[str, ...]
    licences: tuple[str, ...]
    papers: tuple[str, ...] = ()
    size: Enlargement = field(default_factory=Enlargement)
    statistics: Statistics | None = None
    noun: str = "cameras"

    def joined(self, other: TrainingSet) -> TrainingSet:
        """Both sets as one, with this set's size of random changes.

        Raises:
            InvalidArgument: a camera is in both.
        """
        names = [*self.curves, *(self.statistics.names if self.statistics else ())]
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
        """The origin of a basis learned from this set, in words, for the report."""
        origins = zip(self.files, self.sha256, self.licences, strict=True)
        parts = [f"{file}, SHA-256 {digest[:16]}..., licence {licence}" for file, digest, licence in origins]
        parts += [f"published in {paper}" for paper in self.papers]
        groups = [(len(self.statistics.names), self.noun)] if self.statistics else []
        if self.curves or not groups:
            groups.append((len(self.curves), "cameras" if self.statistics else self.noun))
        who = " and ".join(
            f"{count} {'computed' if noun == RYYB_PHONES else 'measured'} {noun[:-1] if count == 1 else noun}"
            for count, noun in groups
        )
        return f"{components} components learned from {who} ({'; '.join(parts)})"


def with_yellow(curves: Mapping[str, Floats]) -> dict[str, Floats]:
    """Each phone with `yellow_for_green`, once for every share of YELLOW. No such phone has published curves."""
    return {
        f"{name}, G + {share:g} R": yellow_for_green(curve, share)
        for name, curve in curves.items()
        for share in YELLOW
    }


def yellow_for_green(curves: Floats, share: float) -> Floats:
    """Curves (m, 3) of a sensor with an RYYB mosaic: G + `share` R, divided by its peak, in the place of G."""
    red, green, blue = curves.T
    yellow = green + share * red
    return np.stack([red, yellow / yellow.max(), blue], axis=1)


def read_training_set(path: Path, licence: str, *, least: int = 2) -> TrainingSet:
    """The cameras of a CSV; errors as `read_curves`."""
    curves = read_curves(path, least=least)
    return TrainingSet(curves, (path.name,), (hashlib.sha256(path.read_bytes()).hexdigest(),), (licence,))


def training_set_of(spec: str) -> TrainingSet:
    """The training set of a basis: `cameras`, `phones`, or a file that `camssf_lab.learning.basis` wrote.

    Raises:
        InvalidArgument: no such basis, or one that does not contain its cameras.
    """
    read_basis(spec)  # raises a clear error if it is invalid
    try:
        with basis_file(spec).open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            return _carried(content)
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise InvalidArgument(
            f"{spec!r} does not carry the cameras it was learned from ({error}), so nothing can be added to them.",
            "Learn anew from all curves in one CSV.",
        ) from error


def _carried(content: Mapping[str, Any]) -> TrainingSet:
    """The training set in the arrays of a basis file; papers, enlargement and statistics may be missing."""

    def words(key: str) -> tuple[str, ...]:
        return tuple(map(str, np.atleast_1d(content[key]))) if key in content else ()

    names, curves = tuple(map(str, content["cameras"])), content["curves"]
    _hold(curves, (len(names), NODES.size, 3))
    size, known = Enlargement(), None
    if "enlargement" in content:
        names_of_sizes = [field.name for field in fields(Enlargement)]
        sizes = content["enlargement"]
        # Files of before there was a process have one number less.
        _hold(sizes, (min(max(sizes.size, len(names_of_sizes) - 1), len(names_of_sizes)),))
        numbers = dict(zip(names_of_sizes, sizes.tolist(), strict=False))
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
        statistics=known,
        noun=str(content["noun"]) if "noun" in content else "cameras",
    )


def _hold(array: Floats, shape: tuple[int, ...]) -> None:
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"an array of shape {array.shape}, where {shape} of finite numbers is needed")
