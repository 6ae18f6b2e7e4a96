"""Measured cameras → the `cameras` basis: `python -m camssf.tools.learn curves.csv -o cameras.npz`.

`python -m camssf.tools.learn mine.csv --extend cameras -o mine.npz` learns from the shipped basis' cameras and
one's own together; a basis file carries the curves that it was learned from, one's own included. Where measured
curves may not be passed on, as those of `phones`, `--statistics` leaves them out: the file carries their mean, their
spread and how many there were of each maker, which is all that extending needs.

Fifty cameras are few. They are enlarged at random by what makes cameras differ: the sensor and its colour filters
shift and widen along the wavelength, lens and infrared cut filter weigh it smoothly, neighbouring pixels leak into
each other. Makers are fewer still, and a camera yet unseen may come from another one: a maker weighs by the root of
the number of its cameras, and the spread between cameras counts FEW_MAKERS times. Principal components of it all,
each scaled by its spread, make a code's prior standard normal. Six phones of two makers are fewer yet: HANDFUL.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import io
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field, fields, replace
from decimal import Decimal, localcontext
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from camssf.curves.basis import NODES, basis_file, read_basis
from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import write_file
from camssf.grid import Floats

LARGEST = 64 * 2**20
"""Bytes of a table of curves."""
COMPONENTS = 24
COPIES = 40
SEED = 2021
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
        with path.open("rb") as binary:
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


def enlarge(curves: Floats, size: Enlargement, copies: int, rng: np.random.Generator) -> Floats:
    """(cameras, 69, 3) → (cameras · copies, 69, 3), peak 1; the first copy of each camera is the camera itself."""
    root = _smooth_root(size.smooth)
    enlarged = [curves]
    for _ in range(copies - 1):
        for camera in curves:
            common, warp = rng.normal(size=1), rng.normal(size=(NODES.size, 3))
            shift = size.shift * np.sqrt(0.5) * (common + rng.normal(size=3))
            width = 1.0 + size.width * rng.normal(size=3)
            centre = NODES @ camera / camera.sum(axis=0)
            copy = np.empty_like(camera)
            for c in range(3):
                source = centre[c] + (NODES - shift[c] - centre[c]) / width[c]
                copy[:, c] = np.interp(source, NODES, camera[:, c])
            copy *= np.exp(size.warp * root @ warp)
            leak = np.eye(3) + size.cross_talk * rng.normal(size=(3, 3)) * (1 - np.eye(3))
            copy = np.maximum(copy @ leak, 0.0)
            enlarged.append((copy / copy.max(axis=0))[None])
    return np.concatenate(enlarged)


@cache
def _smooth_root(length: float) -> Floats:
    """L with L Lᵀ = exp(-½ (Δλ / length)²) + 1e-9 I on the nodes, rounded once.

    Of 120 nm the condition is 5e10: in float64 another processor's Cholesky gives an L that is 4e-8 off, and so another basis.
    In 60 decimal digits there is one answer, whatever the machine.
    """
    size = NODES.size
    with localcontext() as context:
        context.prec = 60
        gaps = [(Decimal(float(node - NODES[0])) / Decimal(length)) ** 2 / 2 for node in NODES]
        smooth = [(-gap).exp() for gap in gaps]  # the nodes are even: of the distance alone
        smooth[0] += Decimal("1e-9")
        rows: list[list[Decimal]] = []
        for i in range(size):
            row: list[Decimal] = []
            for j in range(i + 1):
                other = rows[j] if j < i else row
                rest = smooth[i - j] - sum((a * b for a, b in zip(row, other, strict=False)), Decimal(0))
                row.append(rest / other[j] if j < i else rest.sqrt())
            rows.append(row)
    return np.array([[float(value) for value in row] + [0.0] * (size - len(row)) for row in rows])


def learn(
    curves: Floats,
    *,
    makers: Sequence[str] | None = None,
    components: int = COMPONENTS,
    size: Enlargement | None = None,
    copies: int = COPIES,
    seed: int = SEED,
    known: Statistics | None = None,
) -> tuple[Floats, Floats]:
    """Mean (3, 69) and dictionary (3, 69, components), whitened: columns are components times their spread.

    Args:
        curves: (cameras, 69, 3), peak 1.
        makers: of each camera; None where each camera counts alike.
        components: r.
        size: of the random changes.
        copies: of each camera, itself included.
        seed: of the random changes; the same seed gives the same basis.
        known: further cameras, of which only this is known; as if their curves stood among the others, enlarged
            as they were.
    """
    size = size or Enlargement()
    enlarged = enlarge(curves, size, copies, np.random.default_rng(seed)).reshape(copies, *curves.shape)
    known_makers = [maker_of(name) for name in known.names] if known else []
    weight = _weights([*(makers or [str(i) for i in range(len(curves))]), *known_makers])
    weight, rest = weight[: len(curves)], weight[len(curves) :].sum()
    mean, dictionary = [], []
    for c in range(3):
        # Rows know no scale, so none may be left to the prior: curves of equal area, the mean's peak at 1.
        shapes = enlarged[..., c] / enlarged[..., c].sum(axis=2, keepdims=True)  # (copies, cameras, 69)
        area = known.mean[c].sum() if known else 1.0
        centre = weight @ (shapes[0] if size.own_mean else shapes.mean(axis=0))
        if known:
            centre = centre + rest * known.mean[c] / area
        height = centre.max()
        shapes, centre = shapes / height, centre / height
        cameras = shapes.mean(axis=0)
        between, within = cameras - centre, shapes - cameras
        rows = np.sqrt(weight)[:, None] * np.stack([np.sqrt(size.few_makers) * between, *within / np.sqrt(copies)])
        rows = rows.reshape(-1, NODES.size)
        if known:
            away = known.mean[c] / area / height - centre
            own = known.spread[c].T / area / height
            rows = np.concatenate([rows, np.sqrt(rest) * np.stack([np.sqrt(size.few_makers) * away, *own])])
        _, spread, directions = np.linalg.svd(rows, full_matrices=False)
        atoms = directions[:components].T * spread[:components]
        atoms *= np.where(atoms[np.abs(atoms).argmax(axis=0), np.arange(components)] < 0, -1.0, 1.0)
        mean.append(centre)
        dictionary.append(atoms)
    return np.stack(mean), np.stack(dictionary)


def maker_of(camera: str) -> str:
    """The first word of a camera's name."""
    return camera.split(maxsplit=1)[0].casefold() if camera.strip() else camera


def _weights(makers: Sequence[str]) -> Floats:
    """(cameras,) of sum 1; a maker's cameras together weigh the root of their number."""
    count = Counter(makers)
    weight = np.array([count[maker] ** -0.5 for maker in makers])
    return np.asarray(weight / weight.sum())


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
        who = " and ".join(f"{count} measured {noun}" for count, noun in groups)
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
        *numbers, own_mean = map(float, content["enlargement"])
        size = Enlargement(*numbers, own_mean=bool(own_mean))
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


Crowd, read_crowd, crowd_of = TrainingSet, read_training_set, training_set_of
"""Their names in version 0.1; to be removed in the release after the next."""


def save(training: TrainingSet, components: int, path: Path, *, statistics: bool = False) -> str:
    """Learn from a training set and write the basis file, whole or not at all; returns what it says of itself.

    With `statistics` the file holds no curves, only what was learned from them.
    """
    names = list(training.curves)
    stack = np.stack(list(training.curves.values())) if names else np.zeros((0, NODES.size, 3))
    makers = [maker_of(name) for name in names]
    mean, dictionary = learn(stack, makers=makers, components=components, size=training.size, known=training.known)
    source = training.source(components)
    known = training.known
    if statistics:
        known = Statistics(mean, dictionary, (*(known.names if known else ()), *names))
        names, stack = [], stack[:0]
    arrays: dict[str, Any] = {
        "mean": mean,
        "dictionary": dictionary,
        "source": np.array(source),
        "files": np.array(training.files),
        "sha256": np.array(training.sha256),
        "licence": np.array(training.licences),
        "cameras": np.array(names, dtype=np.str_),
        "curves": stack,
    }
    if training.papers or known or training.size != Enlargement():
        arrays |= {
            "papers": np.array(training.papers, dtype=np.str_),
            "enlargement": np.array(astuple(training.size), dtype=np.float64),
            "noun": np.array(training.noun),
        }
    if known:
        arrays |= {"known": np.array(known.names), "known_mean": known.mean, "known_spread": known.spread}
    content = io.BytesIO()
    np.savez_compressed(content, **arrays)
    write_file(path, content.getvalue())
    return source


def main(arguments: list[str] | None = None) -> int:
    """The command: reads curves, writes the basis file, all or nothing."""
    parser = argparse.ArgumentParser(
        prog="python -m camssf.tools.learn", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("curves", type=Path, help="CSV with the columns camera,wavelength_nm,R,G,B")
    parser.add_argument("-o", "--output", type=Path, default=Path("cameras.npz"))
    parser.add_argument("--components", type=int, default=COMPONENTS)
    parser.add_argument("--licence", default="that of the curves", help="licence of the curves, kept in the file")
    parser.add_argument(
        "--paper",
        action="append",
        default=[],
        help="where the curves were published, kept in the file; repeatable",
    )
    parser.add_argument("--statistics", action="store_true", help="keep no curves in the file, only what was learned")
    parser.add_argument(
        "--extend", metavar="BASIS", help="learn from this basis' cameras, too: a name, or a file of this command"
    )
    fresh = parser.add_argument_group("without --extend, which takes both from the basis")
    fresh.add_argument("--handful", action="store_true", help="enlarge as suits a few of one or two makers")
    fresh.add_argument("--noun", choices=("cameras", "phones"), default="cameras", help="what the curves are of")
    options = parser.parse_args(arguments)
    try:
        if not 1 <= options.components <= NODES.size:
            raise InvalidArgument(
                f"A basis of {options.components} components cannot be learned.", f"Take 1 to {NODES.size}."
            )
        if options.extend and (options.handful or options.noun != "cameras"):
            raise InvalidArgument(
                "--handful and --noun do not go with --extend.", "Leave them out: the basis that is extended says both."
            )
        training = read_training_set(options.curves, options.licence, least=0 if options.extend else 2)
        training = replace(
            training,
            papers=tuple(options.paper),
            size=HANDFUL if options.handful else Enlargement(),
            noun=options.noun,
        )
        if options.extend:
            training = training_set_of(options.extend).joined(training)
        source = save(training, options.components, options.output, statistics=options.statistics)
    except CalibrationError as error:
        print(f"{error.code}: {error}", file=sys.stderr)
        return error.exit_status
    print(f"{options.output}: {source}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
