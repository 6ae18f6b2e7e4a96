"""Evidence → verdict: accepted, doubtful or refused, with reasons.

What cannot be answered at all was already refused by the stage that saw it; here the evidence as a whole is weighed.
RMSRE has no say: the same lamp stands on both of its sides, so it stays small when the lamp is wrong.
`python -m benchmarks.faults` counts what the rules catch and what they miss. docs/verdict.md states the rules in
numbers, for this file and its neighbours and for Kotlin; data/rules.json holds the thresholds and the words.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from camssf.curves.choice import CLEAR
from camssf.curves.ssf import Ssf
from camssf.evidence.checks import Checks
from camssf.evidence.light import (
    TINTED,
    TINTED_UNNAMED,
    Neutral,
    Rival,
    rivalled,
    tinted,
)
from camssf.evidence.reasons import Fatal, Reason, Verdict, because
from camssf.evidence.samples import (
    exposure,
    few,
    samples,
)
from camssf.evidence.surprise import (
    BLACK,
    SURPRISE,
    Surprise,
    Suspect,
    Weighed,
    accusable,
    accused,
    offset,
    shot_answer,
)
from camssf.grid import Floats
from camssf.photo.search import agreement, plain_signals
from camssf.rules import rules
from camssf.spectra import ChartTable

_NUMBER = rules().number
HOPELESS = _NUMBER("verdict.hopeless")
STRANGE, ALIEN = _NUMBER("verdict.strange"), _NUMBER("verdict.alien")
POOR_POSE, VAGUE = _NUMBER("verdict.poor_pose"), _NUMBER("verdict.vague")
UNUSUAL = _NUMBER("verdict.unusual")
UNNAMED, UNNAMEABLE = _NUMBER("verdict.unnamed"), _NUMBER("verdict.unnameable")
PHONES = "phones"
"""The one basis whose cameras are alike enough to tell a light by."""


def judge(
    weighed: Weighed,
    ssf: Ssf,
    *,
    rivals: Sequence[Rival] | Callable[[], Sequence[Rival]] = (),
    neutrals: Sequence[Sequence[Neutral]] = (),
    alone: Sequence[Ssf] = (),
    family: str | None = None,
    unnamed: Sequence[bool] = (),
) -> Verdict:
    """Weigh the evidence behind an answer.

    Args:
        weighed: the k shots.
        ssf: the answer, with its predictions (k, n, 3).
        rivals: other lamps, or what finds them: it is not asked where the capture is refused already.
        neutrals: for each shot what its file tells of the camera's white; none where it tells nothing.
        alone: of several shots, the answer to each alone, predictions (k, n, 3); not needed for one.
        family: the basis that the file's own word for the maker speaks for, if any.
        unnamed: of each shot, whether nobody named its light; none where all were named.
    """
    signals, table, lamps = weighed.signals, weighed.table, weighed.lamps
    found = weighed.surprise(ssf)
    answers = [shot_answer(answer, j) for j, answer in enumerate(alone or [ssf] * len(lamps))]
    each = [weighed.surprise_of(j, answer) for j, answer in enumerate(answers)]
    checks = Checks()
    reasons = [*_surprised(found, each, table, checks), *_strange(ssf, checks)]
    for j, means in enumerate(weighed.means):
        name = f"shot {j + 1}"
        reasons += exposure(name, signals, j, means, checks)
        reasons += few(name, signals.used[j], j, means, checks)
        reasons += samples(name, means, signals.used[j], j, table, checks)
        reasons += _disagreeing(name, signals.values[j], j, table, answers[j], checks)
    limits = [TINTED_UNNAMED if each else TINTED for each in unnamed] or [TINTED] * len(lamps)
    whites = [
        tinted(f"shot {j + 1}", lamp, neutrals[j] if neutrals else (), signals, j, answers[j], checks, limits[j])
        for j, lamp in enumerate(lamps)
    ]
    reasons += [reason for white in whites for reason in white]
    reasons += _vague(ssf, checks)
    reasons += _unusual(ssf, family, checks)
    reasons += _unnamed(ssf, family, checks) if any(unnamed) else []
    fatal = any(isinstance(reason, Fatal) for reason in reasons)
    if not fatal and (len(lamps) == 1 or not any(accused(one) for one in each)):
        doubted = [j for j, white in enumerate(whites) if white]
        reasons += rivalled(rivals() if callable(rivals) else rivals, lamps, doubted, checks)
    if any(isinstance(reason, Fatal) for reason in reasons):
        return Verdict("refused", tuple(reasons), tuple(checks))
    return Verdict("doubtful" if reasons else "accepted", tuple(reasons), tuple(checks))


def _surprised(found: Surprise, each: Sequence[Surprise], table: ChartTable, checks: Checks) -> list[Reason]:
    """Rules 2 and 3 against their thresholds: the strongest suspect of each shot, else that nothing explains it."""
    hopeless = found.total > HOPELESS * found.count
    over = found.total / found.count
    reasons = []
    for j, one in enumerate(each):
        suspect = accused(one)
        if suspect is not None:
            name, words = _accusation(suspect, table)
            value = over if hopeless else suspect.gain
            bound = BLACK if not hopeless and suspect.gain <= accusable(one)[1] else None
            words["shot"] = f"shot {j + 1}"
            reasons.append(because(name, value, words, fatal=hopeless, threshold=bound))
        _note_suspects(one, j, checks)
    worst = max(one.z for one in each)
    largest = max(found.z, worst)
    checks.note("surprise", largest)
    checks.note("hopeless", over)
    if not reasons and (hopeless or largest > SURPRISE):
        name = "contradiction" if len(each) > 1 and worst <= SURPRISE else "unexplained"
        value = over if hopeless else largest
        reasons.append(because(name, value, {"size": float(np.sqrt(over))}, fatal=hopeless))
    return reasons


def _note_suspects(one: Surprise, j: int, checks: Checks) -> None:
    """The strongest of shot j beside what would have named it, and the offset, which has a limit of its own."""
    if not one.suspects:
        return
    strongest, enough = accusable(one)
    checks.note("suspect", strongest.gain, j, limit=enough)
    found = offset(one)
    if found is not None:
        checks.note("black", found.gain, j)


def _accusation(suspect: Suspect, table: ChartTable) -> tuple[str, dict[str, str | float]]:
    """The reason's name for a suspect, and what fills its words."""
    if suspect.kind == "patch":
        assert suspect.patch is not None
        return "patch", {"patch": table.patches[suspect.patch]}
    if suspect.kind == "veil":
        return "veil" if suspect.amount > 0 else "bright_dark", {"amount": abs(suspect.amount)}
    if suspect.kind == "black":
        return "black", {"amount": abs(suspect.amount)}
    return suspect.kind, {"exponent": 1 + suspect.amount} if suspect.kind == "tone" else {}


def strangeness(ssf: Ssf) -> float | None:
    """z(x) of rule 2: the length of the code as a standard normal number under the prior; None where there is none.

    Under the prior the posterior mean x̂ ~ N(0, K), K = I - C: x̂ᵀx̂ is nearly a multiple of a χ² (Satterthwaite 1946).
    """
    if ssf.std is None or ssf.code_covariance is None:
        return None
    K = np.eye(len(ssf.code_covariance)) - ssf.code_covariance
    expected = float(np.trace(K))
    if expected <= 0:  # nothing was learned
        return None
    u = 2.0 * float(np.sum(K**2)) / (9.0 * expected**2)
    return float((np.cbrt(np.sum(ssf.code**2) / expected) - (1.0 - u)) / np.sqrt(u))


def _strange(ssf: Ssf, checks: Checks) -> list[Reason]:
    """Curves unlike a camera's."""
    size = strangeness(ssf)
    if size is not None:
        checks.note("strange", size)
    if size is None or size <= STRANGE:
        return []
    return [because("strange", size, {"size": size}, fatal=size > ALIEN)]


def _unusual(ssf: Ssf, family: str | None, checks: Checks) -> list[Reason]:
    """A camera that its basis does not know: wider than it, or of the other family than its maker."""
    wide = sum(weight.probability for weight in ssf.choice if weight.prior_scale > 1.0)
    other = sum(weight.probability for weight in ssf.choice if family is not None and weight.basis != family)
    if ssf.choice:
        checks.note("unusual", max(wide, other))
    if max(wide, other) <= UNUSUAL:
        return []
    words = {"probability": max(wide, other), "basis": ssf.basis}
    return [because("unusual", max(wide, other), words)]


def _unnamed(ssf: Ssf, family: str | None, checks: Checks) -> list[Reason]:
    """A camera that may be no phone, in a light that nobody named: its curves and the light look too much alike.

    Nearly all makers of phones are known by name, so a file that names none of them is taken for a camera's, and must
    speak as clearly for a phone as a basis that answers alone.
    """
    phone, rest = (
        sum(weight.probability for weight in ssf.choice if (weight.basis == PHONES) == same) for same in (True, False)
    )
    if family is None and rest > 0:  # else the odds hold the maker's word, or there was no choice
        phone = phone / (phone + CLEAR * rest)
    bound = UNNAMED if family == PHONES else CLEAR / (1.0 + CLEAR)
    checks.note("unnamed", phone, limit=bound)
    if phone >= bound:
        return []
    fatal = phone < UNNAMEABLE
    name = "no_maker" if family is None and phone > 0 else "unnamed"
    return [because(name, phone, {"probability": phone}, fatal=fatal, threshold=None if fatal else bound)]


def _disagreeing(name: str, values: Floats, j: int, table: ChartTable, answer: Ssf, checks: Checks) -> list[Reason]:
    """Rule 9: colours that are not the chart's, as a plain camera sees them under the lamp that the answer takes."""
    score = agreement(values, plain_signals(table, answer.lamp[0]))
    checks.note("poor_pose", score, j)
    return [because("pose", score, {"shot": name, "score": score})] if score < POOR_POSE else []


def _vague(ssf: Ssf, checks: Checks) -> list[Reason]:
    """A band too wide to tell cameras apart."""
    if ssf.std is None:
        return []
    width = float(1.96 * np.mean(ssf.std / ssf.values.max(axis=0)))
    checks.note("vague", width)
    return [because("vague", width, {"width": width})] if width > VAGUE else []
