"""Learns a basis from measured cameras: `python -m camssf_lab.learning.basis curves.csv -o cameras.npz`.

`python -m camssf_lab.learning.basis mine.csv --extend cameras -o mine.npz` learns from the shipped basis' cameras and
your own together; a basis file contains the curves that it was learned from, your own included. If measured curves
may not be redistributed, as those of `phones`, `--statistics` leaves them out: the file then contains their mean,
their spread and the cameras' names, which is all that --extend needs.

Because the cameras are few, random copies of them are added (data augmentation). A copy differs as cameras differ:
the sensor and its colour filters shift and widen along the wavelength, lens and infrared cut filter change the curves
smoothly, and neighbouring pixels leak into each other. The makers are fewer still, and a new camera may come from
another maker: so a maker is weighted by the square root of the number of its cameras, and the covariance between
cameras is multiplied by FEW_MAKERS. The basis holds the principal components, each scaled by its standard deviation,
so that the prior of a code is standard normal. HANDFUL is for very few cameras, such as six phones of two makers:
half of its covariance is that of a Gaussian process, which allows for what copies cannot show.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import astuple, replace
from decimal import Decimal, localcontext
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import write_file
from camssf.grid import Floats
from camssf.recovery.basis import NODES
from camssf_lab.learning.training import (
    FEW_MAKERS,
    HANDFUL,
    RYYB_PHONES,
    Enlargement,
    Statistics,
    TrainingSet,
    maker_of,
    read_training_set,
    training_set_of,
    with_yellow,
)

COMPONENTS = 24
COPIES = 40
SEED = 2021
PROCESS_SHIFT, PROCESS_WARP, PROCESS_SMOOTH = 2.0, 0.1, 30.0
"""Of the Gaussian process: shift along the wavelength, nm, smooth change of s relative to s, and its length, nm.

Chosen by leaving each of the six phones out, on charts of other tables under one to three lamps: of shifts of 2 and
3 nm, changes of 0.05 to 0.25 and lengths of 20 to 60 nm, with and without FEW_MAKERS."""


def enlarge(curves: Floats, size: Enlargement, copies: int, rng: np.random.Generator) -> Floats:
    """Add random copies: (cameras, 69, 3) → (copies · cameras, 69, 3), peak 1; the first copies are the cameras."""
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
    """Cholesky factor L with L Lᵀ = exp(-½ (Δλ / length)²) + 1e-9 I on the nodes, the same on every machine.

    For 120 nm the condition number is 5e10, so in float64 processors differ by 4e-8 in L, and so in the basis. It is
    computed in 60 decimal digits and rounded once.
    """
    size = NODES.size
    with localcontext() as context:
        context.prec = 60
        gaps = [(Decimal(float(node - NODES[0])) / Decimal(length)) ** 2 / 2 for node in NODES]
        smooth = [(-gap).exp() for gap in gaps]  # the nodes are equidistant: a function of the distance alone
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


def process_rows(shapes: Floats, weight: Floats) -> Floats:
    """Rows (p, 69) whose Σ row rowᵀ is the covariance of one channel's curves as a Gaussian process.

    It is the covariance between the cameras, with that for a member of a new group (FEW_MAKERS), plus a shift of each
    camera along the wavelength, to first order, and a smooth relative change of it.

    Args:
        shapes: (cameras, 69), in the scale of their mean.
        weight: (cameras,) of sum 1.
    """
    root = np.sqrt(weight)[:, None]
    smooth = (root * shapes)[..., None] * _smooth_root(PROCESS_SMOOTH)  # (cameras, 69, 69)
    return np.concatenate([
        np.sqrt(FEW_MAKERS) * root * (shapes - weight @ shapes),
        PROCESS_SHIFT * root * np.gradient(shapes, NODES, axis=1),
        PROCESS_WARP * np.swapaxes(smooth, 1, 2).reshape(-1, NODES.size),
    ])  # fmt: skip


def learn(
    curves: Floats,
    *,
    makers: Sequence[str] | None = None,
    components: int = COMPONENTS,
    size: Enlargement | None = None,
    copies: int = COPIES,
    seed: int = SEED,
    statistics: Statistics | None = None,
) -> tuple[Floats, Floats]:
    """Learn the mean (3, 69) and the dictionary (3, 69, components): principal components times their spread.

    Args:
        curves: (cameras, 69, 3), peak 1.
        makers: of each camera; None to give all cameras the same weight.
        components: r.
        size: of the random changes.
        copies: of each camera, itself included.
        seed: of the random changes; the same seed gives the same basis.
        statistics: statistics of further cameras; they count as if their curves and copies were among the others.
    """
    size = size or Enlargement()
    enlarged = enlarge(curves, size, copies, np.random.default_rng(seed)).reshape(copies, *curves.shape)
    known_makers = [maker_of(name) for name in statistics.names] if statistics else []
    weight = _weights([*(makers or [str(i) for i in range(len(curves))]), *known_makers])
    weight, rest = weight[: len(curves)], weight[len(curves) :].sum()
    mean, dictionary = [], []
    for c in range(3):
        # Signals do not depend on a curve's scale, so the prior must not either: equal areas, peak of the mean 1.
        shapes = enlarged[..., c] / enlarged[..., c].sum(axis=2, keepdims=True)  # (copies, cameras, 69)
        area = statistics.mean[c].sum() if statistics else 1.0
        centre = weight @ (shapes[0] if size.own_mean else shapes.mean(axis=0))
        if statistics:
            centre = centre + rest * statistics.mean[c] / area
        height = centre.max()
        shapes, centre = shapes / height, centre / height
        cameras = shapes.mean(axis=0)
        between, within = cameras - centre, shapes - cameras
        rows = np.sqrt(weight)[:, None] * np.stack([np.sqrt(size.few_makers) * between, *within / np.sqrt(copies)])
        rows = rows.reshape(-1, NODES.size)
        if size.process:
            of_process = process_rows(shapes[0], weight / weight.sum()) * np.sqrt(weight.sum())
            rows = np.concatenate([np.sqrt(1.0 - size.process) * rows, np.sqrt(size.process) * of_process])
        if statistics:
            away = statistics.mean[c] / area / height - centre
            own = statistics.spread[c].T / area / height
            rows = np.concatenate([rows, np.sqrt(rest) * np.stack([np.sqrt(size.few_makers) * away, *own])])
        if len(rows) < NODES.size:  # fewer directions than components may need: pad with zeros
            rows = np.concatenate([rows, np.zeros((NODES.size - len(rows), NODES.size))])
        _, spread, directions = np.linalg.svd(rows, full_matrices=False)
        atoms = directions[:components].T * spread[:components]
        atoms *= np.where(atoms[np.abs(atoms).argmax(axis=0), np.arange(components)] < 0, -1.0, 1.0)
        mean.append(centre)
        dictionary.append(atoms)
    return np.stack(mean), np.stack(dictionary)


def _weights(makers: Sequence[str]) -> Floats:
    """Weights (cameras,) of sum 1; a maker's total weight is proportional to the root of its number of cameras."""
    count = Counter(makers)
    weight = np.array([count[maker] ** -0.5 for maker in makers])
    return np.asarray(weight / weight.sum())


def save(training: TrainingSet, components: int, path: Path, *, statistics: bool = False) -> str:
    """Learn from a training set and write the basis file atomically; returns the basis' source in words.

    With `statistics` the file holds no curves, only what was learned from them.
    """
    names = list(training.curves)
    stack = np.stack(list(training.curves.values())) if names else np.zeros((0, NODES.size, 3))
    makers = [maker_of(name) for name in names]
    mean, dictionary = learn(
        stack, makers=makers, components=components, size=training.size, statistics=training.statistics
    )
    source = training.source(components)
    if statistics:
        known = training.statistics
        everybody = Statistics(mean, dictionary, (*(known.names if known else ()), *names))
        training = replace(training, curves={}, statistics=everybody)
    write_basis(path, training, mean, dictionary, source)
    return source


def write_basis(
    path: Path | str,
    training: TrainingSet,
    mean: Floats,
    dictionary: Floats,
    source: str,
    further: Mapping[str, Any] | None = None,
) -> None:
    """Write a basis file atomically.

    Args:
        path: of the file.
        training: what it was learned from.
        mean, dictionary: (3, 69), (3, 69, r).
        source: what it was learned from, in words.
        further: arrays by name that the file holds as well.

    Raises:
        InvalidArgument: it cannot be written.
    """
    names, known = list(training.curves), training.statistics
    arrays: dict[str, Any] = {
        "mean": mean,
        "dictionary": dictionary,
        "source": np.array(source),
        "files": np.array(training.files),
        "sha256": np.array(training.sha256),
        "licence": np.array(training.licences),
        "cameras": np.array(names, dtype=np.str_),
        "curves": np.stack(list(training.curves.values())) if names else np.zeros((0, NODES.size, 3)),
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
    np.savez_compressed(content, **arrays, **(further or {}))
    write_file(path, content.getvalue())


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m camssf_lab.learning.basis",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
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
    fresh.add_argument(
        "--noun",
        choices=("cameras", "phones", RYYB_PHONES),
        default="cameras",
        help=f"what the curves are of; {RYYB_PHONES!r} computes them from phones, with yellow in green's place",
    )
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
        if options.noun == RYYB_PHONES:
            training = replace(training, curves=with_yellow(training.curves))
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
