"""Learns a basis from a registry's results, and tests by cross-validation whether it helps with unseen cameras.

The estimator is `camssf.learning.results`, the test `camssf.learning.judgement`; this module selects the results.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.fleet.compare import counts_in_words, curves_in, many
from camssf.fleet.registry import Registry
from camssf.grid import Floats
from camssf.learning.basis import write_basis
from camssf.learning.judgement import Judgement, judge
from camssf.learning.results import (
    PhotoLikelihood,
    Population,
    ReferenceBasis,
    Tables,
    photo_likelihood,
    populate,
    reference_basis,
)
from camssf.learning.training import Statistics, TrainingSet, maker_of, read_training_set, training_set_of
from camssf.recovery.basis import Basis, interpolate, read_basis
from camssf.recovery.onnx_model import load_model
from camssf.recovery.penalties import L2
from camssf.version import __version__

Json: TypeAlias = dict[str, Any]

OF_MODEL, MOST = 30, 400
"""Largest numbers of results to learn from, of one model and in total, newest first; more help little, take hours."""
BASES = ("cameras", "phones")
"""Those that were learned from measured curves."""
LEAVE = ("model", "maker")
SLACK = 1e-3
"""Eigenvalues of a stored covariance may be so far outside 0 to 1, because of rounding to 32 bits."""


@dataclass(frozen=True)
class LearnRequest:
    """What to learn.

    Attributes:
        basis: shipped basis to start from; only results on it count.
        make, model, camera_id: learn the basis of this model; of all cameras without a model.
        statuses: results with these statuses count.
        table: measured cameras to learn from as well, CSV as for `camssf.learning.basis`; None for none.
        licence: of the table.
        leave: what each fold leaves out, one of LEAVE; with a model always a unit.
    """

    basis: str = "phones"
    make: str = ""
    model: str = ""
    camera_id: str = ""
    statuses: tuple[str, ...] = ("accepted",)
    table: Path | None = None
    licence: str = "that of the curves"
    leave: str = "model"


@dataclass(frozen=True)
class LearnedBasis:
    """A basis learned from a registry.

    Attributes:
        request: the request.
        population: the fitted population of all cameras.
        of: maker and model of the basis; None for all cameras.
        keys: keys of the results learned from.
        left_aside: numbers of results left out, by reason.
        judgement: the cross-validated gain.
        training: cameras of the old basis, and those of the table.
        mean, dictionary: (3, 69), (3, 69, r).
    """

    request: LearnRequest
    population: Population
    of: tuple[str, str] | None
    keys: tuple[str, ...]
    left_aside: dict[str, int]
    judgement: Judgement
    training: TrainingSet
    mean: Floats = field(repr=False)
    dictionary: Floats = field(repr=False)

    @property
    def basis(self) -> Basis:
        """The basis, interpolated to the grid, to solve with."""
        mean, dictionary = interpolate(self.mean[..., None])[..., 0], interpolate(self.dictionary)
        return Basis("learned", mean, dictionary, True, self.source)

    @property
    def source(self) -> str:
        """What it was learned from, in words for the report."""
        who = " ".join(self.of) if self.of else many(len(self.population.models), "model")
        source = self.training.source(self.dictionary.shape[2]).partition(" learned from ")[2]
        return (
            f"{self.dictionary.shape[2]} components learned from {many(len(self.keys), 'result')} of "
            f"{many(self.population.units, 'unit')} of {who}, and from {source}"
        )

    def document(self) -> Json:
        """As plain data."""
        found, (old, tables, models) = self.population, self.population.weights
        return {
            "format": "camssf-registry-basis/1",
            "generator": {"name": "camssf", "version": __version__},
            "basis": self.request.basis,
            "basis_sha256": read_basis(self.request.basis).sha256(),
            "of": list(self.of) if self.of else None,
            "statuses": list(self.request.statuses),
            "results": len(self.keys),
            "units": found.units,
            "left_aside": self.left_aside,
            "weight_of_basis": old,
            "tables": [
                {"name": name, "weight": weight}
                for name, weight in zip(found.tables.names, tables.tolist(), strict=True)
            ],
            "models": [
                {"make": make, "model": model, "weight": weight}
                for (make, model), weight in zip(found.models, models.tolist(), strict=True)
            ],
            "unit_spread": float(np.sqrt(np.trace(found.within) / len(found.within))),
            "rounds": found.rounds,
            "judgement": vars(self.judgement),
        }

    def save(self, path: Path | str) -> None:
        """Write the basis file atomically: as `camssf.learning.basis` writes it, without curves, plus the document.

        Raises:
            InvalidArgument: it cannot be written.
        """
        known = self.training.statistics
        models = map(" ".join, self.population.models)
        names = (*(known.names if known else ()), *self.training.curves, *models)
        training = replace(self.training, curves={}, statistics=Statistics(self.mean, self.dictionary, names))
        registry = {"registry": np.array(json.dumps(self.document(), ensure_ascii=False))}
        registry["registry_results"] = np.array(self.keys)
        write_basis(path, training, self.mean, self.dictionary, self.source, registry)


def learn_basis(
    registry: Registry, request: LearnRequest | None = None, *, progress: Callable[[str, float], None] | None = None
) -> LearnedBasis:
    """Learn a basis from a registry's results and from measured cameras.

    Raises:
        InvalidArgument: no usable result, no such model, an unknown basis, or a bad table.
    """
    request, tell = request or LearnRequest(), progress or (lambda *_: None)
    if request.basis not in BASES or request.leave not in LEAVE:
        option, wrong, right = ("--leave", request.leave, LEAVE)
        if request.basis not in BASES:
            option, wrong, right = ("--basis", request.basis, BASES)
        raise InvalidArgument(f"{option} takes {' or '.join(right)}; got {wrong!r}.", "Name one of these.")
    training = training_set_of(request.basis)
    names = (*(training.statistics.names if training.statistics else ()), *training.curves)
    old = reference_basis(read_basis(request.basis), names)
    tables = Tables(size=training.size)
    if request.table is not None:
        added = read_training_set(request.table, request.licence, least=1)
        training = training.joined(added)
        tables = Tables(np.stack(list(added.curves.values())), tuple(added.curves), training.size)
    results, keys, aside = _results(registry, request, old)
    of = _model_of(results, request)
    tell("learning", 0.0)
    found = populate(results, old, tables)
    judgement = judge(results, old, tables, of=of, leave=request.leave, progress=tell)
    return LearnedBasis(request, found, of, keys, dict(aside), judgement, training, *found.basis(of))


def _results(
    registry: Registry, request: LearnRequest, reference: ReferenceBasis
) -> tuple[list[PhotoLikelihood], tuple[str, ...], Counter[str]]:
    """Likelihoods of the results that can be used, their keys, and numbers of the others by reason."""
    size, model = 3 * reference.dictionary.shape[2], load_model(request.basis).sha256
    of_model = "row_number() OVER (PARTITION BY make, model, camera_id, why ORDER BY added DESC, key)"
    rows = f"""(SELECT *, {of_model} AS of_model FROM (SELECT *, CASE WHEN NOT list_contains(?, status) THEN status
        WHEN basis <> ? THEN 'on another basis'
        WHEN len(code_covariance) <> {size * (size + 1) // 2} THEN 'without a covariance'
        WHEN prior_scale IS NULL THEN 'two bases mixed, or an unnamed light'
        WHEN l2 <> {L2} THEN 'another penalty than the usual'
        WHEN CASE WHEN onnx <> '' THEN onnx <> ? ELSE software <> ? END THEN 'another release''s ' || basis
        END AS why FROM rows))"""
    values = [list(request.statuses), request.basis, model, __version__]
    found = registry.query(
        "SELECT key, make, model, camera_id, serial, red, green, blue, code_covariance, prior_scale, gamma "
        f"FROM {rows} WHERE why IS NULL AND of_model <= {OF_MODEL} ORDER BY of_model, added DESC, key LIMIT {MOST}",
        values,
    )
    older = f"older than the newest {OF_MODEL} of their model, or than the newest {MOST} of all"
    counts = registry.query(f"SELECT coalesce(why, ?) AS why, count(*) AS n FROM {rows} GROUP BY 1 ORDER BY 1",
                            [older, *values])  # fmt: skip
    aside = Counter({each["why"]: each["n"] for each in counts})
    aside[older] -= len(found)
    results = [_likelihood_of(registry, each, reference, size) for each in found]
    if not results:
        why = counts_in_words(+aside) or "there is none"
        raise InvalidArgument(
            f"No {' or '.join(request.statuses)} result on {request.basis} can be learned from: {why}.",
            f"Add results that {request.basis} answered alone, under named lamps"
            + ("; or name another --basis." if aside["on another basis"] else "."),
        )
    return results, tuple(sorted(str(each["key"]) for each in found)), +aside


def _likelihood_of(registry: Registry, row: Json, reference: ReferenceBasis, size: int) -> PhotoLikelihood:
    """The likelihood of a row's photo.

    Raises:
        InvalidArgument: the row is damaged.
    """
    curves, covariance = curves_in(registry, row), np.zeros((size, size))
    covariance[np.tril_indices(size)] = row["code_covariance"]
    covariance = covariance + np.tril(covariance, -1).T
    if not np.isfinite(covariance).all() or np.abs(np.linalg.eigvalsh(covariance) - 0.5).max() > 0.5 + SLACK:
        raise registry.damaged(row["key"], "the covariance cannot be right")
    if not 0 < row["prior_scale"] < np.inf:
        raise registry.damaged(row["key"], "the prior's width cannot be right")
    model = " ".join(filter(None, (row["model"], row["camera_id"])))
    member = (maker_of(row["make"]), model, row["serial"] or row["key"])
    return photo_likelihood(member, curves, covariance, reference, row["prior_scale"], row["gamma"] or 0.0)


def _model_of(results: Sequence[PhotoLikelihood], request: LearnRequest) -> tuple[str, str] | None:
    if not request.model:
        return None
    wanted = " ".join(filter(None, (request.model, request.camera_id)))
    found = sorted({each.member[:2] for each in results if each.member[1] == wanted})
    found = [each for each in found if not request.make or each[0] == maker_of(request.make)]
    if len(found) != 1:
        if found:
            makers = ", ".join(maker for maker, _ in found)
            raise InvalidArgument(f"Several makers have a model {wanted}: {makers}.", "Name one by --make.")
        models = ", ".join(sorted({" ".join(each.member[:2]) for each in results})[:10])
        raise InvalidArgument(f"No result of {wanted} can be learned from.", f"Those that can are of {models}.")
    return found[0]
