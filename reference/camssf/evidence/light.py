"""Lamp → reasons: another that fits better, a raw white that it does not give. Rules 4 and 5 of docs/verdict.md."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from camssf.curves.ssf import Ssf
from camssf.evidence.checks import Checks
from camssf.evidence.reasons import Reason, because
from camssf.grid import Floats
from camssf.photo.signals import Signals
from camssf.rules import rules
from camssf.spectra import Lamp

_NUMBER = rules().number
RIVAL, CONDEMNED = _NUMBER("verdict.rival"), _NUMBER("verdict.condemned")
RIVALS = rules().rivals
"""Lamps tried in the place of the named one."""
MISNAMED = _NUMBER("verdict.misnamed")
"""How probable it is beforehand that a lamp is named wrongly."""
MOST_RIVALLED = rules().whole("verdict.most_rivalled")
TINTED, TINTED_UNNAMED = _NUMBER("verdict.tinted"), _NUMBER("verdict.tinted_unnamed")


@dataclass(frozen=True)
class Rival:
    """Another lamp in place of a shot's own.

    Attributes:
        shot: 0-based. lamp: its name.
        gain: of ln of the marginal likelihood over the named lamp's, on the narrowed prior.
    """

    shot: int
    lamp: str
    gain: float


@dataclass(frozen=True)
class Neutral:
    """The camera's white (3,) under a light of power (681,), as a file's colour matrix tells it."""

    light: Floats
    white: Floats


def rivalled(
    rivals: Sequence[Rival], lamps: Sequence[Lamp], tinted_shots: Collection[int], checks: Checks
) -> list[Reason]:
    """Rule 4: of all shots and lamps the one that fits best, and how probable it is that a named lamp is wrong.

    Args:
        rivals: of all shots.
        lamps: as told.
        tinted_shots: 0-based, those whose raw white contradicts the lamp, too: with two witnesses it is refused.
        checks: told of the best.
    """
    best = max(rivals, key=lambda rival: rival.gain, default=None)
    if best is not None:
        checks.note("rival", best.gain, best.shot)
    if best is None or best.gain <= RIVAL:
        return []
    own = np.array([rival.gain for rival in rivals if rival.shot == best.shot])
    # Less the best, or e^gain overflows where a lamp is grossly wrong.
    odds = best.gain + np.log(np.mean(np.exp(own - best.gain)) * MISNAMED / (1.0 - MISNAMED))
    words: dict[str, str | float] = {
        "shot": f"shot {best.shot + 1}",
        "rival": best.lamp,
        "lamp": lamps[best.shot].name,
        "probability": float(1.0 / (1.0 + np.exp(-odds))),
    }
    if best.shot in tinted_shots and best.gain <= CONDEMNED:
        return [because("rival", best.gain, words, fatal=True, threshold=RIVAL)]
    return [because("rival", best.gain, words, fatal=best.gain > CONDEMNED)]


def tinted(
    name: str,
    lamp: Lamp,
    told: Sequence[Neutral],
    signals: Signals,
    j: int,
    answer: Ssf,
    checks: Checks,
    limit: float,
) -> list[Reason]:
    """Rule 5, by the answer to shot j alone, against the limit of a named light or of an estimated one."""
    raw = (signals.white[j] - signals.dark[j])[signals.used[j]].mean(axis=0)
    offs = []
    for neutral in told:
        expected = neutral.white * (answer.lamp[0] @ answer.values) / (neutral.light @ answer.values)
        if not (expected > 0).all():
            continue  # curves that foretell no white; other rules see to them
        ratio = np.log(raw / expected)
        offs.append(float(np.abs(ratio[[0, 2]] - ratio[1]).max()))
    if offs:
        checks.note("tinted", min(offs), j, limit=limit)
    if not offs or min(offs) <= limit:
        return []
    off = min(offs)
    words: dict[str, str | float] = {"shot": name, "share": float(np.expm1(off)), "lamp": lamp.name}
    return [because("tint", off, words, threshold=limit)]
