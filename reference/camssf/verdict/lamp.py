"""Checks the named lamp against rival lamps and against the raw white (rules 4 and 5 of docs/verdict.md)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats
from camssf.photo.signals import Signals
from camssf.recovery.sensitivity import Ssf
from camssf.rules import rules
from camssf.spectra import Lamp
from camssf.verdict.reasons import Checks, Reason, because

_NUMBER = rules().number
RIVAL, OTHER_LAMP_REFUSES = _NUMBER("verdict.rival"), _NUMBER("verdict.other_lamp_refuses")
RIVALS = rules().rivals
"""Lamps tried in place of the named one."""
MOST_SHOTS_COMPARED = rules().whole("verdict.most_shots_compared")
WHITE_BALANCE_MISMATCH, WHITE_BALANCE_MISMATCH_UNNAMED = (
    _NUMBER("verdict.white_balance_mismatch"),
    _NUMBER("verdict.white_balance_mismatch_unnamed"),
)


@dataclass(frozen=True)
class Rival:
    """Another lamp in place of a shot's own.

    Attributes:
        shot: 0-based.
        lamp: the other lamp's name.
        gain: increase in ln of the marginal likelihood over the named lamp, on the narrowed prior.
    """

    shot: int
    lamp: str
    gain: float


@dataclass(frozen=True)
class Neutral:
    """The camera's white (3,) under a light of power (681,), from a file's colour matrix."""

    light: Floats
    white: Floats


def rival_lamp(
    rivals: Sequence[Rival], lamps: Sequence[Lamp], tinted_shots: Collection[int], checks: Checks
) -> list[Reason]:
    """Rule 4: find the best-fitting rival of all shots.

    Args:
        rivals: of all shots.
        lamps: the named lamps.
        tinted_shots: 0-based, shots whose raw white also contradicts the lamp; the rival then refuses above RIVAL.
        checks: receives the best rival's gain.
    """
    best = max(rivals, key=lambda rival: rival.gain, default=None)
    if best is None:
        return []
    by_white = best.shot in tinted_shots and best.gain <= OTHER_LAMP_REFUSES
    checks.note("rival", best.gain, best.shot, refuses=RIVAL if by_white else None)
    if best.gain <= RIVAL:
        return []
    words = {"shot": best.shot + 1, "lamp": lamps[best.shot].name}
    fatal = by_white or best.gain > OTHER_LAMP_REFUSES
    return [because("rival", best.gain, words, fatal=fatal, threshold=RIVAL if by_white else None)]


def white_balance_mismatch(
    lamp: Lamp,
    neutrals: Sequence[Neutral],
    signals: Signals,
    j: int,
    answer: Ssf,
    checks: Checks,
    limit: float,
) -> list[Reason]:
    """Rule 5: compare the raw white of shot j with the file's colour matrix; `answer` is that to shot j alone."""
    raw = signals.raw_white(j)
    offs = []
    for neutral in neutrals:
        expected = neutral.white * (answer.lamp[0] @ answer.values) / (neutral.light @ answer.values)
        if not (expected > 0).all():
            continue  # the curves predict no positive white; other rules catch this
        ratio = np.log(raw / expected)
        offs.append(float(np.abs(ratio[[0, 2]] - ratio[1]).max()))
    if offs:
        checks.note("white_balance_mismatch", min(offs), j, limit=limit)
    if not offs or min(offs) <= limit:
        return []
    off = min(offs)
    words: dict[str, str | float] = {"shot": j + 1, "share": float(np.expm1(off)), "lamp": lamp.name}
    return [because("tint", off, words, threshold=limit)]
