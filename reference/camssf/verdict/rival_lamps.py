"""Judges an answer, and computes how well other lamps fit in place of the named ones (rule 4 of docs/verdict.md)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from camssf.fit.capture_fit import CaptureFit
from camssf.fit.solutions import recover_fit
from camssf.recovery.basis import basis_of, widened
from camssf.recovery.evidence import log_evidences
from camssf.recovery.hypotheses import AUTO, MAKERS_OF
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import EstimatedLamp, Ssf
from camssf.rules import rules
from camssf.spectra import Called, Lamp, read_lamp
from camssf.spectra.lights import kind_of, plain_kind
from camssf.verdict.cause import tables_of_causes, weigh_causes, with_light
from camssf.verdict.cause_groups import Causes
from camssf.verdict.goodness_of_fit import VerdictInputs, shot_answer
from camssf.verdict.judge import PHONES, judge
from camssf.verdict.lamp import MOST_SHOTS_COMPARED, RIVALS, Neutral, Rival
from camssf.verdict.reasons import Verdict
from camssf.verdict.unit_drift import drift_probability

NARROW = rules().number("verdict.narrow")
"""Factor on the prior's width for comparing lamps: cameras vary less than their basis, which is enlarged."""


def weigh(fit: CaptureFit, ssf: Ssf, alone: Sequence[Ssf], new: int | None = None) -> Verdict:
    """Run `judge` on a capture's fit; for several shots, `alone` holds the answer to each.

    `new` is the number of new shots before those of a previous result; None if there is none.
    """
    fit = fit.with_chart_of(ssf)
    answered = fit.with_kinds(ssf.kinds) if any(fit.uncertain) else fit
    shots = fit.capture.shots
    inputs = VerdictInputs(
        fit.signals,
        fit.capture.chart,
        [shot.means for shot in shots],
        [shot.pose for shot in shots],
        [
            replace(lamp, name=shot.lamp.name if isinstance(shot.lamp, Called) else kind_of(lamp.name) or lamp.name)
            for lamp, shot in zip(answered.lamps, shots, strict=True)
        ],
        fit.white_reference(),
        fit.gains,
    )
    drift = None
    if new is not None:
        basis = ssf.basis if fit.basis == AUTO else fit.basis
        drift = drift_probability(inputs, ssf, widened(basis_of(basis), ssf.prior_scale), new)
    answers = [shot_answer(answer, j) for j, answer in enumerate(alone or [ssf])]
    reflectances = np.stack([table.values for table in tables_of_causes(fit.capture.chart)])

    def causes(j: int, tried: Sequence[Rival], witnesses: Collection[str]) -> Causes:
        basis = widened(basis_of(answers[j].basis if fit.basis == AUTO else fit.basis), answers[j].prior_scale)
        gains = [rival.gain for rival in tried if rival.shot == j]
        return weigh_causes(inputs, j, answers[j], basis, gains, reflectances, witnesses)

    def light(j: int) -> EstimatedLamp | None:
        unnamed = fit.of_shot(j).with_light_unnamed()
        found = recover_fit(unnamed, unnamed.signals.used, None)
        return found.lights[0] if MAKERS_OF.get(found.basis) == PHONES else None

    verdict = judge(
        inputs if ssf.std is None else replace(inputs, causes=causes),
        ssf,
        rivals=lambda: weigh_rivals(fit, ssf, new),
        neutrals=[
            [Neutral(_lamp(matrix.light).values, matrix.white) for matrix in shot.photo.colour_matrices]
            for shot in shots
        ],
        alone=alone,
        family=next(iter(fit.prior_odds), None) if fit.basis == AUTO else None,
        unnamed=fit.unnamed,
        drift=drift,
    )
    return with_light(verdict, light)


def weigh_rivals(fit: CaptureFit, ssf: Ssf, new: int | None = None) -> tuple[Rival, ...]:
    """Gain in ln marginal likelihood of other lamps, one shot at a time: rule 4 of docs/verdict.md.

    If the signals choose the basis, they choose it again for every lamp: a phone under a wrong lamp may look like a
    camera, and only the phones' basis then finds the right lamp. An unnamed light has no rivals, because all its
    kinds were already compared, and one that was called by a name none of its own kind. Such lights keep the lamp
    that the answer found.

    Args:
        fit: before it is conditioned on the answer, with basis "auto" if the signals chose.
        ssf: the answer.
        new: as in `weigh`; the lamps of a previous result are not doubted again.
    """
    named = [not light for light in fit.unnamed]
    kinds = [plain_kind(shot.lamp.name) if isinstance(shot.lamp, Called) else None for shot in fit.capture.shots]
    fit = fit.with_kinds(ssf.kinds) if any(fit.uncertain) else fit
    capture, used = fit.capture, fit.signals.used
    if ssf.std is None or len(capture.shots) > MOST_SHOTS_COMPARED:
        return ()
    scale = NARROW if ssf.prior_scale == 1.0 else 1.0  # the learned width where the wider one is the likelier
    families = sorted({*MAKERS_OF.values(), ssf.basis}) if fit.basis == AUTO else [fit.basis]
    bases = [widened(basis_of(family), scale) for family in families]
    beliefs = [np.log(fit.prior_odds.get(MAKERS_OF[basis.name], 1.0)) if len(bases) > 1 else 0.0 for basis in bases]

    rivals = [
        (j, name)
        for j, kind in enumerate(kinds[:new])
        if named[j]
        for name in RIVALS
        if kind is None or plain_kind(name) != kind
    ]
    if not rivals:
        return ()
    given = fit.given(used)
    observations = [given, *(_with_lamp(given, j, _lamp(name)) for j, name in rivals)]
    nats = np.logaddexp.reduce([log_evidences(observations, basis) + belief
                                for basis, belief in zip(bases, beliefs, strict=True)])  # fmt: skip
    return tuple(Rival(j, name, float(gain)) for (j, name), gain in zip(rivals, nats[1:] - nats[0], strict=True))


@cache
def _lamp(name: str) -> Lamp:
    """A rival lamp, read once, because every verdict needs the same ones."""
    return read_lamp(name)


def _with_lamp(observation: Observation, j: int, lamp: Lamp) -> Observation:
    """The observation with another lamp, without modes, of shot j."""
    power, tolerance, modes = (
        array.copy() for array in (observation.lamp, observation.lamp_tolerance, observation.lamp_modes)
    )
    power[j], tolerance[j], modes[j] = lamp.values, lamp.tolerance, 0.0
    return replace(observation, lamp=power, lamp_tolerance=tolerance, lamp_modes=modes)
