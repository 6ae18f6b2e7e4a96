"""Whether a unit's blue curve has moved since its previous result (rule 10 of docs/verdict.md)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camssf.recovery.basis import Basis
from camssf.recovery.drift import UnitShots, drift_evidences
from camssf.recovery.misfit import AnswerBasis
from camssf.recovery.sensitivity import Ssf
from camssf.verdict.goodness_of_fit import VerdictInputs, judged_signals
from camssf.verdict.reasons import Check, Reason, because

FIT, DRIFT, RIVAL = "goodness_of_fit", "unit_drift", "rival"


def drift_probability(inputs: VerdictInputs, ssf: Ssf, basis: Basis, new: int) -> float:
    """Probability that the blue curve has moved before the first `new` shots, at prior odds of 1 : 1.

    The drifts of `drift_evidences` are equally probable.

    Args:
        inputs: all shots, the new ones first.
        ssf: the answer to all of them.
        basis: its basis, with the prior's width.
        new: number of new shots.
    """
    nodes = basis.mean[:, ::10], basis.dictionary[:, ::10]
    k = len(inputs.lamps)
    whites = np.stack([inputs.signals.raw_white(j) for j in range(k)])
    shots = UnitShots((np.arange(k) < new).astype(float), whites)
    nats = drift_evidences(judged_signals(inputs, ssf), AnswerBasis(inputs.lamps[0].values, *nodes), shots)
    return float(np.exp(-np.logaddexp(0.0, np.log(len(nats)) - np.logaddexp.reduce(nats))))


def contradiction(joint: Sequence[Check], alone: Sequence[Check]) -> Reason | None:
    """Why new shots and those of a previous result have no common answer: a drift, or a bad fit of both together.

    None also where another lamp of a new shot explains more than a drift, or explains that shot alone better than its
    lamp: then the name of that lamp is wrong.

    Args:
        joint, alone: the checks of the answer to all shots, and to the new ones.
    """
    drift, fit, own = (_check(*pair) for pair in ((joint, DRIFT), (joint, FIT), (alone, FIT)))
    rivals, own_rivals = (
        [check.value for check in c if check.name == RIVAL and _broken(check)] for c in (joint, alone)
    )
    if own_rivals or max(rivals, default=0.0) > (0.0 if drift is None else _nats(drift.value)):
        return None
    if drift is not None and _broken(drift):
        return because("drift", drift.value, {"probability": drift.value}, threshold=drift.limit)
    over = _check(joint, "misfit_refuses")
    if fit is None or over is None or not _broken(fit) or (own is not None and _broken(own)):
        return None
    return because("contradiction", fit.value, {"size": float(np.sqrt(over.value))})


def _nats(probability: float) -> float:
    """ln of the odds."""
    return float(np.log(probability / max(1.0 - probability, np.finfo(float).eps)))


def _check(checks: Sequence[Check], name: str) -> Check | None:
    return next((check for check in checks if check.name == name), None)


def _broken(check: Check) -> bool:
    return check.value > check.limit
