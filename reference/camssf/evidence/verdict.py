"""Evidence → verdict: accepted, doubtful or refused, with reasons.

What cannot be answered at all was already refused by the stage that saw it; here the evidence as a whole is weighed.
RMSRE has no say: the same lamp stands on both of its sides, so it stays small when the lamp is wrong.
`python -m benchmarks.faults` counts what these rules catch and what they miss; docs/verdict.md says so in words.

The rules in numbers, since Kotlin repeats them. i runs over patches, j over shots, c over channels; a row is a used
patch of a shot. R reflectance, L lamp as the answer takes it, y signal, ŷ its prediction, s the recovered curves,
Δ = 0.5 nm; sums without an index run over the grid.

1. Expected errors. With W_j = Σ ρ L_j s Δ and the weights w_ij = R_i L_j s Δ / W_j, v_j = L_j s Δ / W_j on the grid,
   and Φ_ℓ the directions of a smooth error of length ℓ (`directions`), the covariance of a channel's rows is
     same row                 max(se², 1e-8) + (τ_i y_ij / 20)²
     same patch, any shots    τ_i² (0.36 ⟨w_ij Φ₁₀₀, w_ij' Φ₁₀₀⟩ + ⟨v_j Φ₂₅, v_j' Φ₂₅⟩ / 9
                              + 4900 nm² ⟨v_j R'_i Φ₂₅, v_j' R'_i Φ₂₅⟩), R' the central difference of R per nm
     all rows                 τ_w² ⟨ŷ_ij v_j ρ Φ₁₀₀, ŷ_i'j' v_j' ρ Φ₁₀₀⟩
     same shot                ⟨a_ij F_j, a_i'j F_j⟩, a_ij = w_ij - ŷ_ij ρ v_j, F_j = τ_Lj Φ₆₀ and the lamp's modes,
                              + (DRIFT ŷ_ij) (DRIFT ŷ_i'j).
   It is `sensing`'s Σ, taken at the answer instead of at the mean camera, and the light's drift between frames.
2. Surprise. r = y - ŷ, e = Σ⁻¹ r. residual = rᵀ e, prior = xᵀ x (0 without a prior), both summed over the channels.
   T = residual + prior is χ² with N degrees of freedom, N the number of rows times 3, if all is as told: at the
   optimum the two terms are -2 ln of the evidence but for a constant (λ₂ = 1, γ = 0). No projection on the columns
   of A is needed: what the curves can follow costs xᵀ x instead.
   z(T) = ((T / N)^⅓ - (1 - u)) / √u with u = 2 / (9 N) is nearly standard normal (Wilson and Hilferty 1931).
3. Suspects, of each shot alone: with the answer to that shot's rows only, and its Σ, r, e. Each is a set of d
   directions D (rows × d, one set a channel) along which y would move. What it explains is gain = gᵀ G⁻¹ g with
   g = Σ_c Dᵀ e, G = Σ_c Dᵀ Σ⁻¹ D (G + 1e-12 tr G · I is solved), χ² with d degrees if it is innocent:
     veil      1 - y                        d = 1     light over the chart photo, or a dark frame too bright
     white     y, in each channel alone     d = 3     the white frame is not of this light; not where there is none
     light     y X, y Y, y (X² + Y²)        d = 3     uneven light; X, Y the patch's centre about the mean of the used
                                                      ones, divided by the larger range of the two; without a white
                                                      frame y as well, d = 4
     tone      y ln max(y, 0.001)           d = 1     a tone curve
     patch i   1 on its row, in each channel alone, d = 3: gain = Σ_c e_i² / (Σ⁻¹)_ii
   The strongest is the one of the largest gain, a veil's counted 1.2-fold: a tone curve looks much like it.
4. Rivals. T₄ = residual + 4 prior, of the answer as it is and of the same capture solved with another lamp (RIVALS)
   in place of shot j's. Cameras scatter half as wide as the prior: hence the 4. dT₄ = T₄ - the smallest of a shot's
   rivals. The caller solves; not done beyond 4 shots, nor where the basis has no prior.
5. Raw white. A file's colour matrix tells the camera's white n (R, G, B) under the light M it was made for. Then,
   with the answer to that shot alone, under lamp L the raw white should be n_c Σ L s_c / Σ M s_c. With
   d_c = ln(measured / expected): off = max(|d_R - d_G|, |d_B - d_G|), the smallest over the file's matrices.
6. Noise, where a shot has white and dark frame. Variance V = se² count of a patch and channel; a photon counter has
   V = V_D + (V_W - V_D) q with q = (C - D) / (W - D). grain = median of V / that over rows; texture = median of
   √max(0, V - that) / (C - D).
   Greens: median over the used patches of |G₁ - G₂| / (mean of both - black).
7. The thresholds stand below; a number beyond one is a reason with that code, and makes the verdict doubtful, or
   refused where it passes the one called fatal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf import errors
from camssf.curves.covariance import EDGE, Seen, Tolerances, covariance, smooth_errors
from camssf.curves.ssf import Ssf
from camssf.errors import (
    Blurred,
    CalibrationError,
    ChartUnfit,
    FramesDiffer,
    Glare,
    LampUnfit,
    NotSensorRaw,
    Overexposed,
    Underexposed,
    UnevenLight,
)
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.pose import Pose
from camssf.photo.signals import Signals
from camssf.spectra import ChartTable, Lamp

SURPRISE, HOPELESS = 3.5, 10.0
"""z(T) from which the evidence contradicts itself; T / N from which nothing is left of it."""
STRANGE, ALIEN = 13.0, 60.0
"""xᵀ x of the three channels from which the curves are unlike a camera's, and from which they are none."""
FREER = 7.0
"""Added to both for each further shot: with more evidence the code is less bound to its prior."""
DRIFT = 0.01
"""Relative change of a lamp between chart and white frame that is nobody's fault."""
RIVAL, CONDEMNED = 15.0, 200.0
"""dT₄ from which another lamp explains the photo better, and from which the named one is out of the question."""
RIVALS = (
    "2300K", "2856K", "3500K", "D:4300", "D:5000", "D:6500", "D:10000", "LED-B1", "LED-B3", "LED-B5", "LED-V1", "FL2",
    "FL7", "FL11",
)  # fmt: skip
"""Lamps tried in the place of the named one."""
MOST_RIVALLED = 4
"""Shots of a capture beyond which rivals are not tried: each costs a solution a rival."""
SUSPECT = 32.0
"""What a suspect may explain by chance and by the chart's own error."""
SHARE = 0.4
"""Of the surprise beyond N that a suspect must explain to be named for it."""
TINTED = 0.20
"""ln by which the raw white may differ from what the file's colour matrix foretells."""
VEIL, FOG = 0.10, 0.25
"""Share of white that the darkest patch may give before light lies over the chart, and before it hides it."""
FEWEST = 3
"""Patches of a shot below which nothing is suspected."""
FEW_PATCHES = 12
"""The paper's number of colours; fewer carry less than its accuracy."""
DARK_WHITE = 0.10
"""Share of the sensor's range below which the white leaves the dark patches to noise."""
POOR_POSE = 0.90
"""Agreement of the patches with the chart's own colours below which the corners deserve a look."""
SMOOTH, ROUGH = 0.6, 0.015
"""Grain below which noise is missing, texture above which a patch is not flat."""
GREENS = 0.06
"""Relative difference of the two greens above which they are not both green."""
DIRTY = 0.06
"""Share of outliers among a patch's samples above which something lies on it."""
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


@dataclass(frozen=True)
class Suspect:
    """One way in which a capture may be wrong, and what it would explain of T: rule 3.

    Attributes:
        kind: "veil", "white", "light", "tone" or "patch".
        patch: 0-based; None where it is of no patch.
        gain: of T. amount: its size where d = 1, in units of D; 0 else.
    """

    kind: str
    patch: int | None
    gain: float
    amount: float


@dataclass(frozen=True)
class Surprise:
    """How ill the answer fits what was told: rules 1 to 3.

    Attributes:
        residual, prior: the two parts of T, summed over the channels.
        count: N.
        suspects: in the order of rule 3, patches last.
    """

    residual: float
    prior: float
    count: int
    suspects: tuple[Suspect, ...]

    @property
    def total(self) -> float:
        """T."""
        return self.residual + self.prior

    @property
    def weighted(self) -> float:
        """T₄."""
        return self.residual + 4.0 * self.prior

    @property
    def z(self) -> float:
        """T as a standard normal number, rule 2."""
        u = 2.0 / (9.0 * self.count)
        return float(((self.total / self.count) ** (1.0 / 3.0) - (1.0 - u)) / np.sqrt(u))


@dataclass(frozen=True)
class Rival:
    """T₄ with another lamp in place of a shot's own."""

    shot: int
    lamp: str
    weighted: float


@dataclass(frozen=True)
class Neutral:
    """The camera's white (3,) under a light of power (681,), as a file's colour matrix tells it."""

    light: Floats
    white: Floats


@cache
def directions(length: float) -> Floats:
    """Φ of a smooth error on the grid, (681, p): column q is √(h / (ℓ √(π/2))) exp(-((λ - t_q) / ℓ)²).

    h = ℓ / 2, t_q = 380 - 2 ℓ + q h up to the first at or beyond 720 + 2 ℓ: white noise, smoothed, so that
    Φ Φᵀ = exp(-½ (Δλ / ℓ)²).
    """
    found = smooth_errors(length, WAVELENGTHS)
    found.setflags(write=False)
    return found


def surprise(
    signals: Signals,
    table: ChartTable,
    lamps: Sequence[Lamp],
    ssf: Ssf,
    white_reflectance: Floats,
    white_tolerance: float,
    *,
    pose: Pose | None = None,
) -> Surprise:
    """Rules 1 to 3; arguments as in `judge`. Suspects are questioned where a pose is given, of one shot."""
    used = signals.used
    y, off = signals.values[used], (signals.values - ssf.predicted)[used]
    inverse: list[Floats] = []
    e: list[Floats] = []
    for c in range(3):
        sigma = _covariance(signals, table, lamps, ssf, white_reflectance, white_tolerance, c)
        inverse.append(np.asarray(np.linalg.inv(sigma), dtype=np.float64))
        e.append(inverse[c] @ off[:, c])
    residual = sum(float(off[:, c] @ e[c]) for c in range(3))
    prior = float(np.sum(ssf.code**2)) if ssf.std is not None else 0.0
    found: list[Suspect] = []
    if pose is not None:
        X, Y = _places(pose, used[0])[used[0]].T[:, :, None]
        ways: dict[str, list[NDArray[np.floating[Any]]]] = {
            "veil": [1.0 - y],
            "white": [y * np.eye(3)[c] for c in range(3)],
            "light": [y * X, y * Y, y * (X**2 + Y**2)],
            "tone": [y * np.log(np.maximum(y, 1e-3))],
        }
        if signals.white_is_patch[0]:
            ways["light"].append(y)
            del ways["white"]
        found += [Suspect(kind, None, *_gain(way, inverse, e)) for kind, way in ways.items()]
        gains = sum(e[c] ** 2 / np.diag(inverse[c]) for c in range(3))
        found += [
            Suspect("patch", int(i), float(gain), 0.0)
            for i, gain in zip(np.flatnonzero(used[0]), np.asarray(gains), strict=True)
        ]
    return Surprise(residual, prior, 3 * len(y), tuple(found))


def judge(
    signals: Signals,
    table: ChartTable,
    shots: Sequence[PatchMeans],
    poses: Sequence[Pose],
    lamps: Sequence[Lamp],
    ssf: Ssf,
    *,
    white_reflectance: Floats,
    white_tolerance: float,
    rivals: Sequence[Rival] = (),
    neutrals: Sequence[Sequence[Neutral]] = (),
    alone: Sequence[Ssf] = (),
) -> Verdict:
    """Weigh the evidence behind an answer.

    Args:
        signals: (k, n, 3).
        table: the chart's.
        shots, poses, lamps: k of each.
        ssf: the answer, with its predictions (k, n, 3).
        white_reflectance, white_tolerance: (681,) ρ and its relative error.
        rivals: T₄ with other lamps.
        neutrals: for each shot what its file tells of the camera's white; none where it tells nothing.
        alone: of several shots, the answer to each alone, predictions (k, n, 3); not needed for one.
    """
    found = surprise(signals, table, lamps, ssf, white_reflectance, white_tolerance)
    answers = [shot_answer(answer, j) for j, answer in enumerate(alone or [ssf] * len(shots))]
    each = [
        surprise(only(signals, j), table, [lamps[j]], answer, white_reflectance, white_tolerance, pose=poses[j])
        if int(signals.used[j].sum()) >= FEWEST
        else Surprise(0.0, 0.0, FEWEST, ())
        for j, answer in enumerate(answers)
    ]
    reasons = _surprises(found, each, table)
    for j, (means, pose) in enumerate(zip(shots, poses, strict=True)):
        name = f"shot {j + 1}"
        reasons += _exposure(name, signals, j, means)
        reasons += _few(name, signals.used[j], means)
        reasons += _samples(name, means, signals.used[j], table)
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
    for j, lamp in enumerate(lamps):
        reasons += _tint(f"shot {j + 1}", lamp, neutrals[j] if neutrals else (), signals, j, answers[j])
    if len(shots) == 1 or not any(accused(one) for one in each):
        reasons += _rival(rivals, lamps, found.weighted)
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
    kinds = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, CalibrationError)]
    kind = next(kind for kind in kinds if kind.code == reason.code)
    error = kind(reason.message, reason.advice, value=reason.value, threshold=reason.threshold)
    error.reasons = verdict.reasons
    return error


def _covariance(
    signals: Signals,
    table: ChartTable,
    lamps: Sequence[Lamp],
    ssf: Ssf,
    white_reflectance: Floats,
    white_tolerance: float,
    c: int,
) -> Floats:
    """Rule 1, (rows, rows)."""
    shot, patch = np.nonzero(signals.used)
    light = ssf.lamp * STEP
    light = light / (light @ (white_reflectance * ssf.values[:, c]))[:, None]  # (k, m) L dλ / W
    reflectance, slope = table.values[patch], np.gradient(table.values, STEP, axis=1)[patch]
    widths = np.array([lamp.tolerance for lamp in lamps])
    seen = Seen(
        shot, patch, signals.values[signals.used][:, c], ssf.predicted[signals.used][:, c],
        signals.standard_error[signals.used][:, c], ssf.values[:, c],
        light[shot] * reflectance, EDGE * light[shot] * slope, light[shot], light[shot] * white_reflectance,
        WAVELENGTHS,
    )  # fmt: skip
    known = Tolerances(table.tolerance[patch], white_tolerance, widths[shot], DRIFT)
    sigma = np.sum(list(covariance(seen, known).values()), axis=0)
    for j, each in enumerate(lamps):
        if len(each.modes):
            modes = (seen.against_white * seen.curve * (shot == j)[:, None]) @ each.modes.T
            sigma = sigma + modes @ modes.T
    return np.asarray(sigma)


def _places(pose: Pose, used: NDArray[np.bool_]) -> Floats:
    """(n, 2) X, Y of the patches."""
    centres = pose.patches.mean(axis=1)
    return np.asarray((centres - centres[used].mean(axis=0)) / max(float(np.ptp(centres[used], axis=0).max()), 1.0))


def _gain(
    ways: Sequence[NDArray[np.floating[Any]]], inverse: Sequence[Floats], e: Sequence[Floats]
) -> tuple[float, float]:
    """What a suspect explains, and its amount: rule 3. Each way is (rows, 3)."""
    g, G = np.zeros(len(ways)), np.zeros((len(ways), len(ways)))
    for c in range(3):
        D = np.stack([way[:, c] for way in ways], axis=1)
        g += D.T @ e[c]
        G += D.T @ inverse[c] @ D
    amounts = np.linalg.solve(G + (1e-12 * np.trace(G) + 1e-300) * np.eye(len(G)), g)
    return float(g @ amounts), float(amounts[0]) if len(ways) == 1 else 0.0


def only(signals: Signals, j: int) -> Signals:
    """Shot j alone."""
    arrays = ("values", "standard_error", "chart", "white", "dark", "used", "white_is_patch")
    return replace(signals, **{name: getattr(signals, name)[j : j + 1] for name in arrays})


def shot_answer(answer: Ssf, j: int) -> Ssf:
    """What an answer says of shot j alone."""
    return replace(answer, predicted=answer.predicted[j : j + 1], lamp=answer.lamp[j : j + 1])


def accused(one: Surprise) -> Suspect | None:
    """The strongest suspect of a shot, if it explains enough: SHARE of a surprise, else SUSPECT."""
    if not one.suspects:
        return None
    strongest = max(one.suspects, key=lambda suspect: suspect.gain * (1.2 if suspect.kind == "veil" else 1.0))
    enough = SHARE * (one.total - one.count) if one.z > SURPRISE else SUSPECT
    return strongest if strongest.gain > enough else None


def _surprises(found: Surprise, each: Sequence[Surprise], table: ChartTable) -> list[Reason]:
    """Rules 2 and 3 against their thresholds: the strongest suspect of each shot, else that nothing explains it."""
    reasons: list[Reason] = []
    hopeless = found.total > HOPELESS * found.count
    kind = Fatal if hopeless else Reason
    for j, one in enumerate(each):
        suspect = accused(one)
        if suspect is not None:
            code, words, advice = _accusation(suspect, table)
            value, bound = (found.total / found.count, HOPELESS) if hopeless else (suspect.gain, SUSPECT)
            reasons.append(kind(code, f"shot {j + 1}: {words}", advice, value, bound))
    if not reasons and (hopeless or max(found.z, *(one.z for one in each)) > SURPRISE):
        size = np.sqrt(found.total / found.count)
        together = len(each) > 1 and max(one.z for one in each) <= SURPRISE
        reasons.append(
            kind(
                ChartUnfit.code,
                f"the patches are off by {size:.1f} times what was to be expected, and no single cause explains it."
                if not together
                else f"the shots contradict each other: together they are off by {size:.1f} times what was to be "
                "expected, each alone is not.",
                "Check that --chart is the chart in the photo and --lamp its light; a printed copy or a faded chart "
                "has other spectra than the table.",
                found.total / found.count if hopeless else max(found.z, *(one.z for one in each)),
                HOPELESS if hopeless else SURPRISE,
            )
        )
    strange, none = (bound + FREER * (len(each) - 1) for bound in (STRANGE, ALIEN))
    if found.prior > strange:
        alien = found.prior > none
        reasons.append(
            (Fatal if alien else Reason)(
                LampUnfit.code,
                f"the curves are unlike any camera's ({found.prior:.0f}, where cameras stay below {strange:.0f}).",
                "Check --lamp, and that neither the photo nor the white frame went through a converter.",
                found.prior,
                none if alien else strange,
            )
        )
    return reasons


def _accusation(suspect: Suspect, table: ChartTable) -> tuple[str, str, str]:
    """Code, words and advice for a suspect."""
    if suspect.kind == "patch":
        assert suspect.patch is not None
        return (
            ChartUnfit.code,
            f"patch {table.patches[suspect.patch]} is not what the chart's table says.",
            "Look for a reflection, dirt or a finger on it, leave it out by --fit, or give the chart's own measured "
            "table by --chart.",
        )
    if suspect.kind == "veil" and suspect.amount > 0:
        return (
            Glare.code,
            f"dark patches are too bright, as if {suspect.amount:.1%} of white lay over all.",
            "Shade the lens, turn the chart away from reflections, and add a dark frame: the black level may be off.",
        )
    if suspect.kind == "veil":
        return (
            FramesDiffer.code,
            f"dark patches are too dark, as if the dark frame held {-suspect.amount:.1%} of white.",
            "Take the dark frame again, lens cap on, with the photo's own exposure time and ISO.",
        )
    if suspect.kind == "white":
        return (
            FramesDiffer.code,
            "all patches are off by a factor of their own in each channel: the white frame is not of this light.",
            "Take the white frame again, in the chart's place, under the same lamp, with the same exposure.",
        )
    if suspect.kind == "light":
        return (
            UnevenLight.code,
            "the patches' errors follow their places: the light changes across the chart.",
            "Light the chart evenly, without shadows, keep it in the middle of the photo, and add a white frame.",
        )
    return (
        NotSensorRaw.code,
        f"the signals are not linear: they follow a tone curve, about y^{1 + suspect.amount:.2f}.",
        "Photograph in the camera's plain RAW (DNG) mode; a converter or a merged photo bends them.",
    )


def _rival(rivals: Sequence[Rival], lamps: Sequence[Lamp], weighted: float) -> list[Reason]:
    """Rule 4: of all shots and lamps the one that fits best."""
    best = min(rivals, key=lambda rival: rival.weighted, default=None)
    if best is None or weighted - best.weighted <= RIVAL:
        return []
    gain = weighted - best.weighted
    kind, bound = (Fatal, CONDEMNED) if gain > CONDEMNED else (Reason, RIVAL)
    told = lamps[best.shot].name
    return [
        kind(
            LampUnfit.code,
            f"shot {best.shot + 1}: the photo fits {best.lamp} far better than {told}.",
            f"Check --lamp; the light is more like {best.lamp}. If it is not, measure it.",
            gain,
            bound,
        )
    ]


def _tint(name: str, lamp: Lamp, told: Sequence[Neutral], signals: Signals, j: int, answer: Ssf) -> list[Reason]:
    """Rule 5, by the answer to that shot alone."""
    raw = (signals.white[j] - signals.dark[j])[signals.used[j]].mean(axis=0)
    offs = []
    for neutral in told:
        expected = neutral.white * (answer.lamp[0] @ answer.values) / (neutral.light @ answer.values)
        ratio = np.log(raw / expected)
        offs.append(float(np.abs(ratio[[0, 2]] - ratio[1]).max()))
    if not offs or min(offs) <= TINTED:
        return []
    return [
        Reason(
            LampUnfit.code,
            f"{name}: the white is off by {np.expm1(min(offs)):.0%} in red or blue from what the file's own colour "
            f"matrix foretells under {lamp.name}.",
            "Check --lamp, look for a second light and for coloured walls, and measure the light at the chart.",
            min(offs),
            TINTED,
        )
    ]


def _few(name: str, used: NDArray[np.bool_], means: PatchMeans) -> list[Reason]:
    count = int(used.sum())
    if count >= FEW_PATCHES:
        return []
    clipped = bool((means.chart.clipped[~used] > 0).any())
    return [
        Reason(
            Overexposed.code if clipped else Underexposed.code,
            f"{name}: only {count} of {used.size} patches carry a signal.",
            "Take the photo again with less exposure." if clipped else "Take the photo again with more light.",
            count,
            FEW_PATCHES,
        )
    ]


def _samples(name: str, means: PatchMeans, used: NDArray[np.bool_], table: ChartTable) -> list[Reason]:
    """Rule 6, and outliers."""
    reasons: list[Reason] = []
    chart = means.chart
    dirty = int(np.argmax(chart.dead.max(axis=1)))
    share = float(chart.dead[dirty].max())
    if share > DIRTY:
        reasons.append(
            Reason(
                ChartUnfit.code,
                f"{name}: {share:.0%} of the samples of patch {table.patches[dirty]} do not belong to the others.",
                "Look for a reflection, dirt or a finger on it.",
                share,
                DIRTY,
            )
        )
    above = np.maximum(chart.greens.mean(axis=1) - means.black[1], 1.0)
    greens = float(np.median((np.abs(chart.greens[:, 0] - chart.greens[:, 1]) / above)[used]))
    if greens > GREENS:
        reasons.append(
            Reason(
                NotSensorRaw.code,
                f"{name}: the two greens differ by {greens:.0%}.",
                "The file may name a wrong order of the colour filters: photograph with another app or camera mode.",
                greens,
                GREENS,
            )
        )
    if means.white is not None and means.dark is not None:
        grain, texture = _noise(chart, means.white, means.dark, used)
        if grain < SMOOTH:
            reasons.append(
                Reason(
                    NotSensorRaw.code,
                    f"{name}: the samples have {grain:.0%} of the noise that light must have.",
                    "Photograph in the camera's plain RAW (DNG) mode, without noise reduction or 8-bit storage.",
                    grain,
                    SMOOTH,
                )
            )
        if texture > ROUGH:
            reasons.append(
                Reason(
                    Blurred.code,
                    f"{name}: the patches vary by {texture:.1%} inside: neighbours or shadows run into them.",
                    "Focus on the chart, keep the camera still, and let the chart fill more of the frame.",
                    texture,
                    ROUGH,
                )
            )
    return reasons


def _noise(chart: FrameMeans, white: FrameMeans, dark: FrameMeans, used: NDArray[np.bool_]) -> tuple[float, float]:
    """Grain and texture: rule 6."""
    V, V_W, V_D = ((f.standard_error**2 * f.count)[used] for f in (chart, white, dark))
    signal = (chart.mean - dark.mean)[used]
    expected = np.maximum(V_D + (V_W - V_D) * signal / (white.mean - dark.mean)[used], 1.0 / 12.0)
    texture = np.sqrt(np.maximum(V - expected, 0.0)) / np.maximum(signal, 1.0)
    return float(np.median(V / expected)), float(np.median(texture))


def _exposure(name: str, signals: Signals, j: int, shot: PatchMeans) -> list[Reason]:
    """The white's level, and light where there should be none."""
    reasons: list[Reason] = []
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
