"""Evidence → verdict: accepted, doubtful or refused, with reasons.

What cannot be answered at all was already refused by the stage that saw it; here the evidence as a whole is weighed.
RMSRE has no say: the same lamp stands on both of its sides, so it stays small when the lamp is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.chart import Pose
from camssf.errors import CalibrationError, ChartUnfit, Glare, LampUnfit, Overexposed, Underexposed, UnevenLight
from camssf.grid import Floats
from camssf.patches import PatchMeans
from camssf.signals import Signals
from camssf.spectra import ChartTable, Lamp
from camssf.ssf import Ssf

MISFIT, IMPOSSIBLE = 3.0, 10.0
"""Root mean square residual in units of its expected size from which the evidence contradicts itself, and from which
nothing is left of it."""
VEIL, FOG = 0.10, 0.25
"""Share of white that the darkest patch may give before light lies over the chart, and before it hides it."""
STRANGE_PATCH = 5.0
"""Residual of one patch, likewise."""
FEW_PATCHES = 12
"""The paper's number of colours; fewer carry less than its accuracy."""
DARK_WHITE = 0.10
"""Share of the sensor's range below which the white leaves the dark patches to noise."""
UNEVEN = 0.05
"""Change of the light across the chart, as residuals that follow the patches' places tell it."""
POOR_POSE = 0.90
"""Agreement of the patches with the chart's own colours below which the corners deserve a look."""
LOOSE = 2
"""Most directions in which a lamp may be off; a kind of LED or fluorescent lamp has more, too large to be linear in:
with them 95 % bands were seen to hold 76 to 95 % (`python -m benchmarks.lamps`)."""
VAGUE = 0.10
"""Widest mean 95 % half-width, in parts of the peak, that still tells cameras apart."""


@dataclass(frozen=True)
class Reason:
    """Why a result is not simply accepted: the vocabulary of `camssf.errors`, with the number that decided."""

    code: str
    message: str
    advice: str
    value: float | None = None
    threshold: float | None = None


class Fatal(Reason):
    """A reason that leaves no answer: the verdict is refused."""


@dataclass(frozen=True)
class Verdict:
    """status is "accepted", "doubtful" or "refused"; reasons are empty only when accepted."""

    status: str
    reasons: tuple[Reason, ...]


def judge(
    signals: Signals,
    table: ChartTable,
    shots: Sequence[PatchMeans],
    poses: Sequence[Pose],
    lamps: Sequence[Lamp],
    ssf: Ssf,
) -> Verdict:
    """Weigh the evidence behind an answer.

    The expected size of a residual is the root sum of squares of the signal's standard error and the chart's
    tolerance; the lamp's own tolerance is left out, so a wrong lamp shows.

    Args:
        signals: (k, n, 3).
        table: the chart's.
        shots, poses, lamps: k of each.
        ssf: the answer, with its predictions (k, n, 3).
    """
    expected = np.hypot(signals.standard_error, table.tolerance[:, None] * signals.values)
    misfit = (signals.values - ssf.predicted) / np.maximum(expected, 1e-4)
    reasons: list[Reason] = []
    for j, (shot, pose) in enumerate(zip(shots, poses, strict=True)):
        name = f"shot {j + 1}"
        used = signals.used[j]
        reasons += _exposure(name, signals, j, shot)
        if int(used.sum()) < FEW_PATCHES:
            clipped = bool((shot.chart.clipped[~used] > 0).any())
            reasons.append(
                Reason(
                    Overexposed.code if clipped else Underexposed.code,
                    f"{name}: only {int(used.sum())} of {used.size} patches carry a signal.",
                    "Take the photo again with less exposure."
                    if clipped
                    else "Take the photo again with more light.",
                    int(used.sum()),
                    FEW_PATCHES,
                )
            )
        unevenness = _fall_off(pose, signals.values[j], ssf.predicted[j], used) if shot.white is None else 0.0
        if unevenness > UNEVEN:
            reasons.append(
                Reason(
                    UnevenLight.code,
                    f"{name}: the light changes by {unevenness:.0%} across the chart and no white frame corrects it.",
                    "Add a white frame, or light the chart evenly and keep it in the middle of the photo.",
                    unevenness,
                    UNEVEN,
                )
            )
        if pose.score < POOR_POSE:
            reasons.append(
                Reason(
                    ChartUnfit.code,
                    f"{name}: the patches agree only {pose.score:.2f} with the chart's own colours.",
                    "Look at the outlines in the report, check --chart, or give the corners by hand.",
                    pose.score,
                    POOR_POSE,
                )
            )
        if unevenness <= UNEVEN:  # else residuals accuse neither lamp nor chart
            patches = [patch for patch, taken in zip(table.patches, used, strict=True) if taken]
            reasons += _residuals(name, misfit[j][used], patches)
    for j, lamp in enumerate(lamps):
        if len(lamp.modes) > LOOSE:
            reasons.append(
                Reason(
                    LampUnfit.code,
                    f"shot {j + 1}: {lamp.name} is known by its kind alone, in {len(lamp.modes)} directions: "
                    "the bands hold the truth less often than they say.",
                    "Measure the lamp, or photograph the chart in daylight or under a bulb.",
                    len(lamp.modes),
                    LOOSE,
                )
            )
    if ssf.std is not None:
        width = float(1.96 * np.mean(ssf.std / ssf.values.max(axis=0)))
        if width > VAGUE:
            reasons.append(
                Reason(
                    Underexposed.code,
                    f"the 95 % band is ±{width:.2f} of the peak wide on average: this capture knows little.",
                    "Add a white frame, a second shot under another lamp, or a photo with more light.",
                    width,
                    VAGUE,
                )
            )
    if any(isinstance(reason, Fatal) for reason in reasons):
        return Verdict("refused", tuple(reasons))
    return Verdict("doubtful" if reasons else "accepted", tuple(reasons))


def refusal(verdict: Verdict) -> CalibrationError:
    """The error that a refused verdict raises: its gravest reason's, with all of them on it."""
    reason = next(r for r in verdict.reasons if isinstance(r, Fatal))
    kind = LampUnfit if reason.code == LampUnfit.code else Glare
    error = kind(reason.message, reason.advice, value=reason.value, threshold=reason.threshold)
    error.reasons = verdict.reasons
    return error


def _exposure(name: str, signals: Signals, j: int, shot: PatchMeans) -> list[Reason]:
    """The white's level, and light where there should be none."""
    reasons = []
    span = shot.saturation - signals.dark[j]
    level = float(((signals.white[j] - signals.dark[j]) / span).mean(axis=0).max())
    if level < DARK_WHITE:
        reasons.append(
            Reason(
                Underexposed.code,
                f"{name}: the brightest channel of the white reaches {level:.0%} of the sensor's range.",
                "Expose longer, to about 80 %.",
                level,
                DARK_WHITE,
            )
        )
    veil = float(signals.values[j].min(axis=0).max())
    if veil > VEIL:
        kind, bound = (Fatal, FOG) if veil > FOG else (Reason, VEIL)
        reasons.append(
            kind(
                Glare.code,
                f"{name}: the darkest patch gives {veil:.0%} of white; black ink gives 3 %.",
                "Turn the chart away from the reflection, and shade the lens.",
                veil,
                bound,
            )
        )
    return reasons


def _fall_off(pose: Pose, signals: Floats, predicted: Floats, used: NDArray[np.bool_]) -> float:
    """Range over the chart of the smooth part of ln(y / ŷ), a plane and a bowl; 0 where it explains less than half.

    Only light acts on all three channels alike by place: the channels' mean is taken first.
    """
    seen = used & (signals > 0).all(axis=1) & (predicted > 0).all(axis=1)
    if int(seen.sum()) < 8:
        return 0.0
    centres = pose.patches[seen].mean(axis=1)
    x, y = ((centres - centres.mean(axis=0)) / max(float(np.ptp(centres, axis=0).max()), 1.0)).T
    excess = np.log(signals[seen] / predicted[seen]).mean(axis=1)
    excess = excess - excess.mean()
    design = np.stack([np.ones_like(x), x, y, x**2 + y**2], axis=1)
    smooth = design @ np.linalg.lstsq(design, excess, rcond=None)[0]
    explained = float(np.sum(smooth**2)) / max(float(np.sum(excess**2)), 1e-300)
    return float(np.ptp(smooth)) if explained > 0.5 else 0.0


def _residuals(name: str, misfit: Floats, patches: list[str]) -> list[Reason]:
    """Residuals of the used patches against their expected size, (used, 3)."""
    worst = np.abs(misfit).max(axis=1)
    strangest = int(worst.argmax())
    off = float(worst[strangest])
    overall = float(np.sqrt(np.mean(misfit**2)))
    others = float(np.sqrt(np.mean(np.delete(misfit, strangest, axis=0) ** 2)))
    if others > MISFIT:
        kind, bound = (Fatal, IMPOSSIBLE) if others > IMPOSSIBLE else (Reason, MISFIT)
        return [
            kind(
                LampUnfit.code,
                f"{name}: the curves leave {overall:.1f} times the expected residual.",
                "Check that --lamp is the light of this photo and --chart the chart in it.",
                overall,
                bound,
            )
        ]
    if off > STRANGE_PATCH:
        return [
            Reason(
                ChartUnfit.code,
                f"{name}: patch {patches[strangest]} is off by {off:.1f} times its expected error.",
                "Look for a reflection, dirt or a finger on it, or give the chart's own measured table by --chart.",
                off,
                STRANGE_PATCH,
            )
        ]
    return []
