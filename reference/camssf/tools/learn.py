"""Measured cameras → the `cameras` basis: `python -m camssf.tools.learn curves.csv -o cameras.npz`.

`python -m camssf.tools.learn mine.csv --extend cameras -o mine.npz` learns from the shipped basis' cameras and
one's own together; a basis file carries the curves that it was learned from, one's own included.

Fifty cameras are few. They are enlarged at random by what makes cameras differ: the sensor and its colour filters
shift and widen along the wavelength, lens and infrared cut filter weigh it smoothly, neighbouring pixels leak into
each other. Makers are fewer still, and a camera yet unseen may come from another one: a maker weighs by the root of
the number of its cameras, and the spread between cameras counts FEW_MAKERS times. Principal components of it all,
each scaled by its spread, make a code's prior standard normal.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import io
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cache
from pathlib import Path

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


@dataclass(frozen=True)
class Enlargement:
    """Standard deviations of the random changes of one copy.

    Attributes:
        shift: along the wavelength, nm; half of its variance common to the three channels.
        width: relative change of width about the channel's centre of gravity.
        warp: smooth change of ln s, over 120 nm.
        cross_talk: share of the other channels that leaks in.
    """

    shift: float = 4.5
    width: float = 0.06
    warp: float = 0.25
    cross_talk: float = 0.02


def read_curves(path: Path, *, least: int = 2) -> dict[str, Floats]:
    """Cameras of a CSV with columns camera, wavelength_nm, R, G, B: name → (69, 3) on the 5-nm nodes, peak 1.

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
        response = np.stack([np.interp(NODES, table[:, 0], table[:, c], 0.0, 0.0) for c in (1, 2, 3)], axis=1)
        curves[name] = np.maximum(response, 0.0) / response.max(axis=0)
    if len(curves) < least:
        raise InvalidArgument(f"{path} holds {len(curves)} camera(s).", "A spread needs at least two.")
    return curves


def enlarge(curves: Floats, size: Enlargement, copies: int, rng: np.random.Generator) -> Floats:
    """(cameras, 69, 3) → (cameras · copies, 69, 3), peak 1; the first copy of each camera is the camera itself."""
    root = _smooth_root()
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
def _smooth_root() -> Floats:
    """L with L Lᵀ = exp(-½ (Δλ / 120 nm)²) + 1e-9 I on the nodes, rounded once.

    The condition is 5e10: in float64 another processor's Cholesky gives an L that is 4e-8 off, and so another basis.
    In 60 decimal digits there is one answer, whatever the machine.
    """
    size = NODES.size
    with localcontext() as context:
        context.prec = 60
        gaps = [(Decimal(float(node - NODES[0])) / 120) ** 2 / 2 for node in NODES]
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
) -> tuple[Floats, Floats]:
    """Mean (3, 69) and dictionary (3, 69, components), whitened: columns are components times their spread.

    Args:
        curves: (cameras, 69, 3), peak 1.
        makers: of each camera; None where each camera counts alike.
        components: r.
        size: of the random changes.
        copies: of each camera, itself included.
        seed: of the random changes; the same seed gives the same basis.
    """
    enlarged = enlarge(curves, size or Enlargement(), copies, np.random.default_rng(seed))
    enlarged = enlarged.reshape(copies, *curves.shape)
    weight = _weights(makers or [str(i) for i in range(len(curves))])
    mean, dictionary = [], []
    for c in range(3):
        # Rows know no scale, so none may be left to the prior: curves of equal area, the mean's peak at 1.
        shapes = enlarged[..., c] / enlarged[..., c].sum(axis=2, keepdims=True)  # (copies, cameras, 69)
        centre = weight @ shapes.mean(axis=0)
        height = centre.max()
        shapes, centre = shapes / height, centre / height
        cameras = shapes.mean(axis=0)
        between, within = cameras - centre, shapes - cameras
        rows = np.sqrt(weight)[:, None] * np.stack([np.sqrt(FEW_MAKERS) * between, *within / np.sqrt(copies)])
        _, spread, directions = np.linalg.svd(rows.reshape(-1, NODES.size), full_matrices=False)
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
    """

    curves: dict[str, Floats]
    files: tuple[str, ...]
    sha256: tuple[str, ...]
    licences: tuple[str, ...]

    def joined(self, other: TrainingSet) -> TrainingSet:
        """Both sets as one.

        Raises:
            InvalidArgument: a camera is in both.
        """
        known = {name.casefold() for name in self.curves}
        twice = [name for name in other.curves if name.casefold() in known]
        if twice:
            raise InvalidArgument(
                f"{twice[0]} is in {', '.join(other.files)} and in the basis already.",
                "Give it another name, the maker first, to let both count.",
            )
        return TrainingSet(
            self.curves | other.curves,
            self.files + other.files,
            self.sha256 + other.sha256,
            self.licences + other.licences,
        )

    def source(self, components: int) -> str:
        """In words, for the report."""
        origins = zip(self.files, self.sha256, self.licences, strict=True)
        parts = [f"{file}, SHA-256 {digest[:16]}..., licence {licence}" for file, digest, licence in origins]
        return f"{components} components learned from {len(self.curves)} measured cameras ({'; '.join(parts)})"


def read_training_set(path: Path, licence: str, *, least: int = 2) -> TrainingSet:
    """The cameras of a CSV; errors as `read_curves`."""
    curves = read_curves(path, least=least)
    return TrainingSet(curves, (path.name,), (hashlib.sha256(path.read_bytes()).hexdigest(),), (licence,))


def training_set_of(spec: str) -> TrainingSet:
    """The cameras that a basis was learned from: `cameras`, or a file that this command wrote.

    Raises:
        InvalidArgument: no such basis, or one that does not carry its cameras.
    """
    read_basis(spec)  # says what is wrong with it
    try:
        with basis_file(spec).open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            names, curves = (content[key] for key in ("cameras", "curves"))
            origins = [tuple(map(str, np.atleast_1d(content[key]))) for key in ("files", "sha256", "licence")]
    except (OSError, KeyError, ValueError) as error:
        raise InvalidArgument(
            f"{spec!r} does not carry the cameras it was learned from ({error}), so nothing can be added to them.",
            "Learn anew from all curves in one CSV.",
        ) from error
    if curves.shape != (len(names), NODES.size, 3) or not np.isfinite(curves).all():
        raise InvalidArgument(f"{spec!r} holds curves of shape {curves.shape}.", "Learn anew from all curves.")
    return TrainingSet(dict(zip(map(str, names), curves, strict=True)), *origins)


Crowd, read_crowd, crowd_of = TrainingSet, read_training_set, training_set_of
"""Their names in version 0.1; to be removed in the release after the next."""


def save(training: TrainingSet, components: int, path: Path) -> str:
    """Learn from a training set and write the basis file, whole or not at all; returns what it says of itself."""
    stack = np.stack(list(training.curves.values()))
    mean, dictionary = learn(stack, makers=[maker_of(name) for name in training.curves], components=components)
    source = training.source(components)
    content = io.BytesIO()
    np.savez_compressed(
        content,
        mean=mean,
        dictionary=dictionary,
        source=np.array(source),
        files=np.array(training.files),
        sha256=np.array(training.sha256),
        licence=np.array(training.licences),
        cameras=np.array(list(training.curves)),
        curves=stack,
    )
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
        "--extend", metavar="BASIS", help="learn from this basis' cameras, too: `cameras`, or a file of this command"
    )
    options = parser.parse_args(arguments)
    try:
        if not 1 <= options.components <= NODES.size:
            raise InvalidArgument(
                f"A basis of {options.components} components cannot be learned.", f"Take 1 to {NODES.size}."
            )
        training = read_training_set(options.curves, options.licence, least=0 if options.extend else 2)
        if options.extend:
            training = training_set_of(options.extend).joined(training)
        source = save(training, options.components, options.output)
    except CalibrationError as error:
        print(f"{error.code}: {error}", file=sys.stderr)
        return error.exit_status
    print(f"{options.output}: {source}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
