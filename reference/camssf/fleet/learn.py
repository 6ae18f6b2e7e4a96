"""Registry → a basis of its own cameras, and whether it would have helped with those that it had not seen.

The estimator is `camssf.tools.results`; here is what of a registry it may be told, and the file that it becomes.
"""

from __future__ import annotations

import io
import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from camssf import __version__
from camssf.curves.basis import LEARNED, Basis, interpolate, read_basis
from camssf.curves.engine import load_model
from camssf.curves.penalties import L2
from camssf.errors import InvalidArgument
from camssf.files import write_file
from camssf.fleet.compare import LARGEST, NM, counts_in_words, many, other_statuses
from camssf.fleet.registry import Registry, Wanted
from camssf.fleet.rows import CHANNELS
from camssf.grid import Floats
from camssf.tools.results import Old, Population, Said, Tables, log_predictive, old_basis, populate, said
from camssf.tools.training import TrainingSet, maker_of, read_training_set, training_set_of

Json: TypeAlias = dict[str, Any]

OF_MODEL, MOST = 30, 400
"""Results of one model, and of all together, that are learned from, the newest: more teach little and take hours."""
FOLDS = 12
"""Groups that are left out one after the other; where there are more, several at once."""
CONFIDENCE = 0.95
"""Of the interval that says whether a basis helps."""
LEAVE = ("model", "maker")
SLACK, WIDEST = 1e-3, 10.0
"""Of a covariance's eigenvalues: below 0, for it is kept in 32 bits, and at most."""


@dataclass(frozen=True)
class Asked:
    """What shall be learned.

    Attributes:
        basis: shipped one whose results count, and which is the point of departure.
        make, model, camera_id: of one model, whose own basis it shall be; all cameras' without a model.
        statuses: of the results that count.
        table, licence: measured cameras beside them, CSV as `camssf.tools.learn` takes it; None for none.
        leave: what is left out for the judgement, LEAVE; a unit at a time where a model is named.
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
class Judgement:
    """How much likelier photos are on what was learned without them than on the old basis.

    Attributes:
        left_out: what was left out at a time: model, maker, unit.
        groups: how many of them.
        nats: ln of how many times likelier a photo is, mean over the groups.
        error: one standard error of it; None of one group.
        low, high: CONFIDENCE interval of `nats`, by Student's t with groups - 1 degrees of freedom; None likewise.
        helps: the interval lies above 0; False below; None where it holds 0, or of one group.
    """

    left_out: str
    groups: int
    nats: float | None
    error: float | None
    low: float | None
    high: float | None
    helps: bool | None


@dataclass(frozen=True)
class Lesson:
    """What was learned.

    Attributes:
        asked: what for.
        population: of all cameras.
        of: maker and model that it is the basis of; None for all.
        keys: of the results that count.
        left_aside: results that do not, by the reason.
        judgement: whether it would have helped.
        training: the old basis' cameras, and the measured ones.
        mean, dictionary: (3, 69), (3, 69, r).
    """

    asked: Asked
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
        """To solve with."""
        mean, dictionary = interpolate(self.mean[..., None])[..., 0], interpolate(self.dictionary)
        return Basis("learned", mean, dictionary, True, self.source)

    @property
    def source(self) -> str:
        """In words, for the report."""
        who = " ".join(self.of) if self.of else many(len(self.population.models), "model")
        beside = self.training.source(self.dictionary.shape[2]).partition(" learned from ")[2]
        return (
            f"{self.dictionary.shape[2]} components learned from {many(len(self.keys), 'result')} of "
            f"{many(self.population.units, 'unit')} of {who}, and from {beside}"
        )

    def document(self) -> Json:
        """As plain data."""
        found, (old, tables, models) = self.population, self.population.weights
        return {
            "format": "camssf-registry-basis/1",
            "generator": {"name": "camssf", "version": __version__},
            "basis": self.asked.basis,
            "basis_sha256": read_basis(self.asked.basis).sha256(),
            "of": list(self.of) if self.of else None,
            "statuses": list(self.asked.statuses),
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
        """The basis file, whole or not at all: as `camssf.tools.learn` writes one without curves, and the document.

        Raises:
            InvalidArgument: it cannot be written.
        """
        known = self.training.known
        names = [*(known.names if known else ()), *self.training.curves]
        content = io.BytesIO()
        np.savez_compressed(
            content,
            mean=self.mean,
            dictionary=self.dictionary,
            source=np.array(self.source),
            files=np.array(self.training.files),
            sha256=np.array(self.training.sha256),
            licence=np.array(self.training.licences),
            papers=np.array(self.training.papers, dtype=np.str_),
            enlargement=np.array(astuple(self.training.size), dtype=np.float64),
            noun=np.array(self.training.noun),
            cameras=np.array([], dtype=np.str_),
            curves=np.zeros((0, self.mean.shape[1], 3)),
            known=np.array([*names, *(" ".join(model) for model in self.population.models)]),
            known_mean=self.mean,
            known_spread=self.dictionary,
            registry=np.array(json.dumps(self.document(), ensure_ascii=False)),
            registry_results=np.array(self.keys),
        )
        write_file(path, content.getvalue())


def learn_basis(
    registry: Registry, asked: Asked | None = None, *, progress: Callable[[str, float], None] | None = None
) -> Lesson:
    """Learn from a registry's results, and from measured cameras.

    Raises:
        InvalidArgument: nothing can be learned from: no result, no such model, an unknown basis, a bad table.
    """
    asked, tell = asked or Asked(), progress or (lambda *_: None)
    if asked.basis not in LEARNED or asked.leave not in LEAVE:
        option, wrong, right = ("--leave", asked.leave, LEAVE)
        if asked.basis not in LEARNED:
            option, wrong, right = ("--basis", asked.basis, LEARNED)
        raise InvalidArgument(f"{option} takes {' or '.join(right)}; got {wrong!r}.", "Name one of these.")
    training = training_set_of(asked.basis)
    names = (*(training.known.names if training.known else ()), *training.curves)
    old = old_basis(read_basis(asked.basis), names)
    tables = Tables(size=training.size)
    if asked.table is not None:
        beside = read_training_set(asked.table, asked.licence, least=1)
        training = training.joined(beside)
        tables = Tables(np.stack(list(beside.curves.values())), tuple(beside.curves), training.size)
    results, keys, aside = _results(registry, asked, old)
    of = _model_of(results, asked)
    tell("learning", 0.0)
    found = populate(results, old, tables)
    judgement = _judge(results, old, tables, (of, asked.leave), tell)
    return Lesson(asked, found, of, keys, dict(aside), judgement, training, *found.basis(of))


def _results(registry: Registry, asked: Asked, old: Old) -> tuple[list[Said], tuple[str, ...], Counter[str]]:
    """What the results say, their keys, and why others say nothing."""
    values = [list(asked.statuses), asked.basis]
    counted = "SELECT count(*) AS n FROM rows WHERE list_contains(?, status) AND basis {} ?"
    (other,) = registry.query(counted.format("<>"), values)
    (same,) = registry.query(f"{counted.format('=')} AND len(red) > 0", values)
    newest = "row_number() OVER (PARTITION BY make, model, camera_id ORDER BY added DESC, key)"
    found = registry.query(
        "SELECT key, make, model, camera_id, serial, red, green, blue, code_covariance, prior_scale, prior_share, "
        "l2, gamma, onnx, software FROM rows WHERE list_contains(?, status) AND basis = ? AND len(red) > 0 "
        f"QUALIFY {newest} <= {OF_MODEL} ORDER BY {newest}, added DESC, key LIMIT {MOST}",
        values,
    )
    aside: Counter[str] = Counter(other_statuses(registry, Wanted(), asked.statuses))
    aside["on another basis"] = other["n"]
    aside[f"older than the newest {OF_MODEL} of their model, or than the newest {MOST} of all"] = same["n"] - len(
        found
    )
    results, keys, size = [], [], 3 * old.dictionary.shape[2]
    ours = load_model(asked.basis).sha256
    for each in found:
        if len(each["code_covariance"] or ()) != size * (size + 1) // 2:
            aside["without a covariance"] += 1
        elif not each["prior_scale"]:
            aside["two bases mixed, or a light that nobody named"] += 1
        elif each["l2"] != L2:
            aside["another penalty than the usual"] += 1
        elif each["onnx"] != ours if each["onnx"] else each["software"] != __version__:
            aside[f"another release's {asked.basis}"] += 1
        else:
            results.append(_said(registry, each, old, size))
            keys.append(str(each["key"]))
    if not results:
        why = counts_in_words(+aside) or "there is none"
        raise InvalidArgument(
            f"No {' or '.join(asked.statuses)} result on {asked.basis} can be learned from: {why}.",
            f"Add results that {asked.basis} answered alone, under named lamps"
            + ("; or name another --basis." if aside["on another basis"] else "."),
        )
    return results, tuple(sorted(keys)), +aside


def _said(registry: Registry, row: Json, old: Old, size: int) -> Said:
    """What a row says; refused where damage is seen in it, so that one row spoils no basis."""
    if {len(row[colour] or ()) for colour in CHANNELS} != {len(NM)}:
        raise registry.damaged(row["key"], "the curves cannot be right")
    curves = np.array([row[colour] for colour in CHANNELS], dtype=np.float64)
    covariance = np.zeros((size, size))
    covariance[np.tril_indices(size)] = row["code_covariance"]
    covariance = covariance + np.tril(covariance, -1).T
    scale, share = (np.array(row[name] or (), dtype=np.float64) for name in ("prior_scale", "prior_share"))
    if not (np.abs(curves) <= LARGEST).all():
        raise registry.damaged(row["key"], "the curves cannot be right")
    if not np.isfinite(covariance).all() or not _posterior(covariance):
        raise registry.damaged(row["key"], "the covariance cannot be right")
    if len(scale) != len(share) or not (np.isfinite([scale, share]).all() and (scale > 0).all() and share.sum() > 0):
        raise registry.damaged(row["key"], "the prior's widths cannot be right")
    model = " ".join(filter(None, (row["model"], row["camera_id"])))
    member = (maker_of(row["make"]), model, row["serial"] or row["key"])
    widths = list(zip(scale.tolist(), share.tolist(), strict=True))
    return said(member, curves, covariance, old, widths, row["gamma"] or 0.0)


def _posterior(covariance: Floats) -> bool:
    """It may be (H + I)⁻¹, whose eigenvalues lie from 0 to 1; those of several widths mixed may lie above."""
    found = np.linalg.eigvalsh(covariance)
    return bool(found[0] > -SLACK and found[-1] < WIDEST)


def _model_of(results: Sequence[Said], asked: Asked) -> tuple[str, str] | None:
    if not asked.model:
        return None
    wanted = " ".join(filter(None, (asked.model, asked.camera_id)))
    found = sorted({each.member[:2] for each in results if each.member[1] == wanted})
    found = [each for each in found if not asked.make or each[0] == maker_of(asked.make)]
    if len(found) != 1:
        if found:
            makers = ", ".join(maker for maker, _ in found)
            raise InvalidArgument(f"Several makers have a model {wanted}: {makers}.", "Name one by --make.")
        models = ", ".join(sorted({" ".join(each.member[:2]) for each in results})[:10])
        raise InvalidArgument(f"No result of {wanted} can be learned from.", f"Those that can are of {models}.")
    return found[0]


def _judge(
    results: Sequence[Said],
    old: Old,
    tables: Tables,
    what: tuple[tuple[str, str] | None, str],
    tell: Callable[[str, float], None],
) -> Judgement:
    """Learn without each group, and see what its photos would have been taken for."""
    of, leave = what
    word = "unit" if of else leave
    judged = [each for each in results if of is None or each.member[:2] == of]

    def group_of(each: Said) -> tuple[str, ...]:
        return each.member if of else each.member[:2] if leave == "model" else each.member[:1]

    groups = list(dict.fromkeys(map(group_of, judged)))
    if len(groups) < 2:
        return judge_gains(word, np.zeros(len(groups)))
    size = 3 * old.dictionary.shape[2]
    gains: dict[tuple[str, ...], list[float]] = {each: [] for each in groups}
    folds = [groups[i::FOLDS] for i in range(min(FOLDS, len(groups)))]
    for number, fold in enumerate(folds):
        tell(f"without a {word}", number / len(folds))
        out = set(fold)
        rest = [each for each in results if group_of(each) not in out]
        beside = tables if of or leave == "model" else _without(tables, {each[0] for each in out})
        found = populate(rest, old, beside) if rest else None
        if found is None:
            continue
        mean, covariance = found.prior(of if of in found.models else None)
        for each in judged:
            if group_of(each) in out:
                before = log_predictive(each, np.zeros(size), np.eye(size))
                gains[group_of(each)].append(log_predictive(each, mean, covariance) - before)
    means = np.array([np.mean(each) for each in gains.values() if each])
    return judge_gains(word, means)


def judge_gains(left_out: str, gains: Floats) -> Judgement:
    """The mean of the groups' gains, and what it says.

    Args:
        left_out: what a group is.
        gains: (groups,) nats a photo.
    """
    from scipy.special import stdtrit

    n = len(gains)
    if n < 2:
        return Judgement(left_out, n, None, None, None, None, None)
    mean, error = float(gains.mean()), float(gains.std(ddof=1) / np.sqrt(n))
    half = float(stdtrit(n - 1, (1 + CONFIDENCE) / 2)) * error
    helps = None if mean - half <= 0 <= mean + half else mean > 0
    return Judgement(left_out, n, mean, error, mean - half, mean + half, helps)


def _without(tables: Tables, makers: set[str]) -> Tables:
    kept = [i for i, name in enumerate(tables.names) if maker_of(name) not in makers]
    return Tables(tables.curves[kept], tuple(tables.names[i] for i in kept), tables.size)
