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
import io
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple, replace
from decimal import Decimal, localcontext
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from camssf.curves.basis import NODES
from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import write_file
from camssf.grid import Floats
from camssf.tools.training import (
    HANDFUL,
    Enlargement,
    Statistics,
    TrainingSet,
    maker_of,
    read_training_set,
    training_set_of,
)

COMPONENTS = 24
COPIES = 40
SEED = 2021


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

    Of 120 nm the condition is 5e10: in float64 another processor's Cholesky gives an L that is 4e-8 off, and so
    another basis. In 60 decimal digits there is one answer, whatever the machine.
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
        if len(rows) < NODES.size:  # fewer directions than may be asked for: the others have no length
            rows = np.concatenate([rows, np.zeros((NODES.size - len(rows), NODES.size))])
        _, spread, directions = np.linalg.svd(rows, full_matrices=False)
        atoms = directions[:components].T * spread[:components]
        atoms *= np.where(atoms[np.abs(atoms).argmax(axis=0), np.arange(components)] < 0, -1.0, 1.0)
        mean.append(centre)
        dictionary.append(atoms)
    return np.stack(mean), np.stack(dictionary)


def _weights(makers: Sequence[str]) -> Floats:
    """(cameras,) of sum 1; a maker's cameras together weigh the root of their number."""
    count = Counter(makers)
    weight = np.array([count[maker] ** -0.5 for maker in makers])
    return np.asarray(weight / weight.sum())


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
                "--handful and --noun do not go with --extend.",
                "Leave them out: the basis that is extended says both.",
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
