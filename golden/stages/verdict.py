"""The stage `verdict`: a case for each rule of `camssf.verdict.judge`, in plain numbers."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from camssf.photo.signals import Signals
from camssf.recovery.basis import LEARNED, read_basis
from camssf.verdict.cause import BY_WHITE, tables_of_causes, weigh_causes
from camssf.verdict.cause_groups import Causes
from camssf.verdict.goodness_of_fit import FEWEST, VerdictInputs, best_explanation, shot_answer
from camssf.verdict.judge import judge as judge_capture
from camssf.verdict.lamp import Neutral, Rival
from camssf.verdict.reasons import Fatal
from camssf.verdict.unit_drift import drift_probability
from golden.contract import Call, Stage, words
from golden.forms import resolve
from golden.products import build_answer, build_lamp, build_means, build_table, judgement, pose_by_hand
from golden.stages.verdict_cases import rows


def run(call: Call) -> dict[str, Any]:
    """The stage `verdict`: `camssf.verdict.judge.judge`, and the values that its rules 1 to 3 used."""
    given = call.given
    table = replace(build_table(given["reflectance"], 0.0, 18), tolerance=given["chart_tolerance"])
    used = np.array(given["used"], bool)
    signals = Signals(
        values=given["signals"], standard_error=given["standard_error"], chart=given["white"], white=given["white"],
        dark=given["dark"], used=used, white_is_patch=np.array([not shot["white"] for shot in given["shots"]]),
        assumptions=(),
    )  # fmt: skip
    lamps = [
        build_lamp(values, tolerance, modes)
        for values, tolerance, modes in zip(given["lamp"], given["lamp_tolerance"], given["lamp_modes"], strict=True)
    ]
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    inputs = VerdictInputs(
        signals=signals, table=table, lamps=lamps, means=[build_means(shot) for shot in given["shots"]],
        poses=[pose_by_hand(centres[:, None] + square, square) for centres in given["centres"]],
        white_reference=(np.ravel(given["white_reflectance"]), given["white_tolerance"]),
        gains=(np.array(given["gain_modes"], float), float(given["gain_own"])) if "gain_modes" in given else None,
    )  # fmt: skip
    ssf = build_answer(given, given)
    alone = [build_answer(given, {name: resolve(value) for name, value in one.items()}) for one in given["alone"]]
    rivals = [Rival(shot=shot, lamp=name, gain=gain) for shot, name, gain in given["rivals"]]
    neutrals = [
        [Neutral(light=resolve(light)[0], white=np.array(white)) for light, white in of_shot]
        for of_shot in given["neutrals"]
    ]
    shots = range(len(given["shots"]))
    basis: Any = read_basis(ssf.basis) if ssf.basis in LEARNED else None
    answers = [shot_answer(answer, j) for j, answer in enumerate(alone or [ssf] * len(shots))]
    tables = np.stack([table.values for table in tables_of_causes(table)])

    @cache
    def weighed_causes(j: int, gains: tuple[float, ...], witnesses: frozenset[str]) -> Causes:
        return weigh_causes(inputs, j, answers[j], basis, gains, tables, witnesses)

    def causes(j: int, tried: Sequence[Rival], witnesses: Collection[str]) -> Causes:
        return weighed_causes(j, tuple(rival.gain for rival in tried if rival.shot == j), frozenset(witnesses))

    known = ssf.basis in LEARNED and ssf.std is not None
    verdict = judge_capture(
        replace(inputs, causes=causes) if known else inputs, ssf, rivals=rivals, neutrals=neutrals, alone=alone,
        family=given.get("family"), unnamed=[given.get("unnamed", False) for _ in shots],
        drift=drift_probability(inputs, ssf, basis, given["new"]) if "new" in given else None,
    )  # fmt: skip
    joint, single = inputs.goodness_of_fit(ssf), [inputs.goodness_of_fit_of_shot(j, answers[j]) for j in shots]
    enough = known and int(used.sum()) >= FEWEST
    weighed = [p for j in shots if enough for w in ((), BY_WHITE) for p in causes(j, rivals, w).probability.values()]
    suspects = [best_explanation(fit) for fit in single]
    return judgement(verdict) | {
        "fatal": [isinstance(reason, Fatal) for reason in verdict.reasons],
        "checks": [f"{check.name} {check.beyond} {check.shot or 'whole'}" for check in verdict.checks],
        "checked": np.array([[check.value, check.limit, check.refuses or 0.0] for check in verdict.checks]),
        "named": [None if s is None else s.kind if s.patch is None else f"{s.kind} {s.patch}" for s in suspects],
        **{name: getattr(joint, name) for name in ("residual", "prior", "count")},
        "z": np.array([joint.z, *(fit.z for fit in single)]),
        "gains": np.array([suspect.gain for fit in single for suspect in fit.explanations]),
        "causes": np.array(weighed) if weighed else None,
    }  # fmt: skip


STAGE = Stage(
    name="verdict",
    rows=rows,
    inputs_of=lambda change: {key: value for key, value in change.items() if key != "basis" or value is not None},
    run=run,
    inputs=words(
        "reflectance chart_tolerance white_reflectance white_tolerance lamp lamp_tolerance lamp_modes signals "
        "standard_error used white dark shots centres ssf ssf_std code predicted alone rivals neutrals"
    ),
    optional=words("choice family family_test chart_fading code_variance unnamed new gain_modes gain_own basis"),
    arrays=words(
        "reflectance chart_tolerance white_reflectance lamp lamp_modes signals standard_error white dark centres ssf "
        "ssf_std code predicted"
    ),
    limits=(
        ("exact", 0.0, "status codes messages advice fatal checks named count"),
        ("norm", 1e-9, "checked"),
        ("relative", 1e-8, "values thresholds residual"),
        ("relative", 1e-12, "prior"),
        ("norm", 1e-8, "z gains causes"),
    ),
)
