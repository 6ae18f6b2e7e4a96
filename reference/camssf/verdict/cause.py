"""Weighs the causes of a misfit against each other, and says the likeliest (docs/verdict.md, "Causes")."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from camssf.grid import Floats
from camssf.recovery.basis import Basis
from camssf.recovery.causes import CAUSES, ChartScene, cause_evidences
from camssf.recovery.misfit import AnswerBasis
from camssf.recovery.sensitivity import EstimatedLamp, Ssf
from camssf.rules import rules
from camssf.spectra import ChartTable
from camssf.verdict.cause_groups import Causes
from camssf.verdict.goodness_of_fit import GoodnessOfFit, VerdictInputs, explained_signals, places
from camssf.verdict.reasons import Fatal, Reason, Verdict, because

LAMP, NONE = "lamp", "none"
"""Another lamp than the named one, weighed by its own evidence; and no error at all."""
PRIORS = {name: rules().number(f"causes.prior_{name}") for name in (NONE, *CAUSES, LAMP)}
WITNESS = rules().number("causes.witness")
BY_WHITE = (LAMP, "tint", "white", "clipped")
"""Causes that also change the raw white."""
BLAMED = {
    rules().reasons[name].message.key
    for name in ("veil", "bright_dark", "black", "white", "light", "tone", "patch", "unexplained", "rival")
}
"""Messages of rules 2 to 4, which name a cause without weighing it against the others."""
LIKELY = rules().number("causes.likely_kind")
OTHER_LAMP = rules().reasons["rival"].message.key
PATCH = rules().reasons["patch"].message.key
SEEN = {rules().reasons[name].message.key for name in ("mixed", "demosaiced", "smoothed")}
"""Messages of rule 11, which the samples' noise shows: what has changed the samples comes before any cause."""
FADED = rules().number("causes.faded_small"), rules().number("causes.faded_large")


def tables_of_causes(table: ChartTable) -> tuple[ChartTable, ...]:
    """Other tables that the chart may have: faded, and published ones."""
    return (*(table.faded(amount) for amount in FADED), *table.other_tables())


def weigh_causes(
    inputs: VerdictInputs,
    j: int,
    answer: Ssf,
    basis: Basis,
    rivals: Sequence[float],
    tables: Floats,
    witnesses: Collection[str] = (),
) -> Causes:
    """The causes of shot j.

    Args:
        inputs: all shots.
        answer: to shot j alone, with a prior.
        basis: of the answer, with the prior's width.
        rivals: gains of other lamps of this shot in ln of the marginal likelihood; empty if none was tried.
        tables: (t, n, 681) other reflectances of the chart.
        witnesses: causes for which another rule speaks: BY_WHITE for rule 5, "table" for a faded chart.
    """
    alone = inputs.of_shot(j)
    framed, reference = alone.means[0].white is not None, np.zeros(len(inputs.table.patches))
    reference[inputs.table.white] = 0.0 if framed else 1.0
    scene = ChartScene(places(alone.poses[0], alone.signals.used[0]), reference, tables)
    nodes = AnswerBasis(alone.lamps[0].values, basis.mean[:, ::10], basis.dictionary[:, ::10])
    evidences = cause_evidences(explained_signals(alone, answer), nodes, scene)
    nats = dict(zip(CAUSES, evidences.log_evidence.tolist(), strict=True)) | {NONE: 0.0}
    if not framed:
        del nats["white"]
    if rivals:
        nats[LAMP] = float(np.logaddexp.reduce(rivals) - np.log(len(rivals)))
    for name in nats:
        nats[name] += np.log(PRIORS[name]) + (np.log(WITNESS) if name in witnesses else 0.0)
    total = np.logaddexp.reduce(list(nats.values()))
    probability = {name: float(np.exp(value - total)) for name, value in nats.items()}
    return Causes(j, probability, int(np.argmax(evidences.of_patch)), basis.name)


def blamed_shots(reasons: Sequence[Reason], count: int) -> list[int]:
    """The shots, 0-based, that rules 2 to 4 blame; all `count` shots if they blame none by its number.

    A spoilt shot bends the common curves, so that a sound one may look as improbable.
    """
    numbers = {reason.arguments.get("shot") for reason in reasons if reason.key in BLAMED} - {None}
    return sorted(int(number) - 1 for number in numbers if number is not None) or list(range(count))


def put_first(
    reasons: Sequence[Reason],
    causes: Causes,
    one: GoodnessOfFit,
    inputs: VerdictInputs,
) -> list[Reason]:
    """The reasons with the likeliest cause first, in place of those that name a cause without weighing it.

    Where an error is less likely than none and no such reason is there, the reasons stay as they are: what they say
    is not a misfit of the signals. Processed RAW, which its noise shows, comes before any cause.

    Args:
        reasons: all of them.
        causes: of the shot with the clearest cause.
        one: of that shot.
        inputs: all shots.
    """
    replaced = [reason for reason in reasons if reason.key in BLAMED]
    if not replaced and causes.probability[NONE] >= 0.5:
        return list(reasons)
    fatal = any(isinstance(reason, Fatal) for reason in (replaced or reasons))
    value, threshold = (replaced[0].value, replaced[0].threshold) if replaced else (None, None)
    name, words = _message(causes, one, inputs)
    first = because(name, value, {"shot": causes.shot + 1, **words}, fatal=fatal, threshold=threshold)
    rest = [reason for reason in reasons if reason not in replaced and reason.key != first.key]
    seen = [(Fatal if fatal else Reason)(**vars(reason)) for reason in rest if reason.key in SEEN]
    return [*seen, first, *(reason for reason in rest if reason.key not in SEEN)]


def with_light(verdict: Verdict, estimated: Callable[[int], EstimatedLamp | None]) -> Verdict:
    """The verdict that says what the light is by the signals, if another lamp comes first and one kind is likely.

    Args:
        verdict: as `judge` made it.
        estimated: the light of a shot, 0-based, as if it were not named; None if it cannot be estimated.
    """
    first = verdict.reasons[0] if verdict.reasons else None
    if first is None or first.key != OTHER_LAMP:
        return verdict
    light = estimated(int(first.arguments["shot"]) - 1)
    if light is None or max(light.kinds.values()) <= LIKELY:
        return verdict
    kind = max(light.kinds, key=lambda kind: light.kinds[kind])
    words = first.arguments | {"kind": kind, "kelvin": light.kelvin, "std": light.kelvin_std}
    fatal = isinstance(first, Fatal)
    told = because("rival_kind", first.value, words, fatal=fatal, threshold=first.threshold)
    return replace(verdict, reasons=(told, *verdict.reasons[1:]))


def blamed_patch(verdict: Verdict, table: ChartTable) -> int | None:
    """The patch, 0-based, that is the first reason of a verdict, if it is one."""
    first = verdict.reasons[0] if verdict.reasons else None
    if first is None or first.key != PATCH:
        return None
    return table.patches.index(str(first.arguments["patch"]))


def _message(causes: Causes, one: GoodnessOfFit, inputs: VerdictInputs) -> tuple[str, dict[str, str | float]]:
    """The reason's name, and the values of its placeholders."""
    group, of, table = causes.group, causes.probability, inputs.table
    amount = {explanation.kind: explanation.amount for explanation in one.explanations}
    if group == "patch":
        return "patch", {"patch": table.patches[causes.patch]}
    if group == "tone":
        return "tone", {"exponent": 1.0 + amount["tone"]}
    if group == "lamp":
        return "rival", {"lamp": inputs.lamps[causes.shot].name}
    if group == "stranger":
        return group, {"basis": causes.basis}
    if group != "offset":
        return "light" if group == "shadow" else group, {}
    if of["gloss"] > of["veil"] + of["black"]:
        return "gloss", {}
    if "black" in amount and (of["black"] > of["veil"] or amount["veil"] < 0):  # without a dark frame
        return "black", {"amount": abs(amount["black"])}
    return "veil" if amount["veil"] > 0 else "bright_dark", {"amount": abs(amount["veil"])}
