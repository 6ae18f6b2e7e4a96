"""How well each kind of error of a capture explains the signals, beside other curves (docs/verdict.md, "Causes").

One shot, n patches, m = 681 wavelengths, v = 69 nodes, r atoms a channel; rows as in `camssf.recovery.misfit`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from camssf.recovery.arrays import Array, constant, eye, namespace, whiten
from camssf.recovery.covariance import LinearisedSignals
from camssf.recovery.misfit import (
    DARKEST_TONE,
    AnswerBasis,
    JudgedSignals,
    atoms_at_answer,
    by_row,
    derivative_by_code,
    errors_at_answer,
    signals_at_answer,
)
from camssf.rules import rules

CAUSES = (
    "patch", "gloss", "veil", "black", "white", "clipped", "shadow", "lights", "tone", "tint", "table", "stranger",
)  # fmt: skip
"""In the order of `CauseEvidences.log_evidence`."""
NARROW = rules().number("verdict.narrow")
COLD = -1e9
"""ln of the evidence of a patch that does not count."""


def _size(name: str) -> float:
    return rules().number(f"causes.{name}")


PATCH_SHARE, PATCH_OFFSET = _size("patch_share"), _size("patch_offset")
OFFSETS = _size("offset_small"), _size("offset_large")
BLACKS = _size("black_small"), _size("black_large")
WHITES = _size("white_small"), _size("white_large")
CLIPPED, CLIPPED_WHITE = _size("clipped"), _size("clipped_white")
CLIPPED_FROM = (0.45, 0.6, 0.75, 0.9)
"""Levels relative to a channel's brightest patch."""
SHADOWS, SPOT = (_size("shadow_small"), _size("shadow_large")), _size("shadow_spot")
RADII = (0.25, 0.45)
"""Standard deviations of a round shadow, in parts of the chart's larger side."""
ANGLES, EDGES = 8, (-0.3, -0.1, 0.1, 0.3)
"""Directions of a shadow with a straight edge, and the edge's distances from the middle of the chart."""
REACHES = (1.2, 1.6)
"""Radii of a group of spoilt patches, in distances between neighbours: four neighbours, eight neighbours."""
LIGHTS = _size("lights_small"), _size("lights_large")
TONES, KINK, TOE = (_size("tone_small"), _size("tone_large")), _size("tone_kink"), _size("tone_toe")
KINKS = (0.2, 0.4, 0.6)
"""Signals at which a tone curve may have a kink."""
TOE_END = 0.03
"""Signal over which a toe falls to 1 / e."""
TINTS, MOVED = (_size("tint_small"), _size("tint_large")), (_size("moved_small"), _size("moved_large"))
TABLES = _size("table_small"), _size("table_large")
STRANGERS = (1.0, 2.0, 4.0)
"""Widths of the prior of a camera unlike those of its basis, relative to the learned one."""


@dataclass(frozen=True)
class ChartScene:
    """What the causes of one shot need besides its signals.

    Attributes:
        places: (n, 2) X and Y of the patches' centres, about their mean, divided by the larger range.
        reference: (n,) 1 for the white patch that stands for the white frame, else 0; all 0 with a white frame.
        tables: (t, n, m) reflectances of other tables of the chart.
    """

    places: Array
    reference: Array
    tables: Array


@dataclass(frozen=True)
class CauseEvidences:
    """ln of the marginal likelihood of each cause over that of none.

    Attributes:
        log_evidence: (12,) in the order of CAUSES; of the mean over each one's variants.
        of_patch: (n,) of each patch; COLD where it does not count.
    """

    log_evidence: Array
    of_patch: Array


@dataclass(frozen=True)
class Variants:
    """Errors of one kind: D v with v ~ N(0, I).

    Attributes:
        directions: (c, n, 3, w) D of each variant.
        counts: (c,) 1, or 0 for a variant that does not count.
    """

    directions: Array
    counts: Array


def cause_evidences(judged: JudgedSignals, basis: AnswerBasis, scene: ChartScene) -> CauseEvidences:
    """Weigh the causes, linearised at the answer.

    With Σ of rule 1, r = y - ŷ, and A the derivative of ŷ by the code x at the answer: b = r + A x. As cameras vary
    less than their basis, without an error b ~ N(0, P) with P = Σ + (NARROW A) (NARROW A)ᵀ. An error D v adds

        ½ gᵀ (I + G)⁻¹ g - ½ ln det(I + G)  with  g = Dᵀ P⁻¹ b,  G = Dᵀ P⁻¹ D

    to the ln of the evidence. The kinds of errors are those of `kinds_of_error`, and, each with a P of its own,

        tint      the lamp's smooth error is larger
        table     the chart's error is larger, its wavelengths are off, or the signals are those of another table
        stranger  the prior is as wide as the learned one or wider
    """
    judged = first_shot(judged)
    xp, N = namespace(judged.signals), 3 * judged.signals.shape[1]
    signals_at = signals_at_answer(judged)
    A = derivative_by_code(judged, signals_at, atoms_at_answer(judged, basis))
    code = judged.code[: A.shape[-1] // 3, :]  # whole: a recorded model then knows its size
    b = judged.difference + A @ xp.reshape(code.mT, (A.shape[-1], 1))
    curves, sigma = A @ A.mT, errors_at_answer(judged, signals_at).covariance
    kinds = kinds_of_error(judged, scene)
    counts, own = by_row(judged.counts), eye(xp, N) * by_row(judged.counts * spoilt(judged, scene))
    shifts = counts * table_shifts(judged, scene, signals_at)  # (N, t)
    moved = counts * moved_table(signals_at)  # (N, 1)
    columns = [b, shifts, moved, own]
    for variants in kinds:
        for one in variants:
            c, w = one.directions.shape[0], one.directions.shape[-1]
            D = counts * xp.reshape(one.directions, (c, N, w))
            columns.append(xp.reshape(xp.permute_dims(D, (1, 0, 2)), (N, c * w)))
    whitened, log_det = whiten(sigma + NARROW**2 * curves, xp.concat(columns, axis=-1))
    off, at = whitened[:, :1], 2 + shifts.shape[-1] + N
    none = -0.5 * (xp.sum(off * off, axis=0) + log_det)

    def log_evidence(spread: Array) -> Array:
        """Of b ~ N(0, spread), over that of none, (1,)."""
        of, log_det_of = whiten(spread, b)
        return -0.5 * (xp.sum(of * of, axis=0) + log_det_of) - none

    groups = patch_groups(judged, scene)  # (c, n)
    mask = xp.broadcast_to(groups[:, :, None], (groups.shape[0], groups.shape[1], 3))
    of_groups = gains(whitened[:, at - N : at] * xp.reshape(mask, (groups.shape[0], 1, N)), off)
    used, n = judged.used[0, :], judged.used.shape[1]
    of_kinds = [log_mean(of_groups, xp.concat([used] * (1 + len(REACHES)), axis=0))]
    for variants in kinds:
        values = []
        for one in variants:
            c, w = one.directions.shape[0], one.directions.shape[-1]
            D = xp.permute_dims(xp.reshape(whitened[:, at : at + c * w], (N, c, w)), (1, 0, 2))
            values.append(gains(D, off))
            at = at + c * w
        of_kinds.append(log_mean(xp.concat(values, axis=0), xp.concat([one.counts for one in variants], axis=0)))
    tinted, loose = (
        [log_evidence(errors_at_answer(other, signals_at).covariance + NARROW**2 * curves) for other in others]
        for others in (
            [replace(judged, lamp_tolerance=xp.maximum(judged.lamp_tolerance, size)) for size in TINTS],
            [replace(judged, chart_tolerance=factor * judged.chart_tolerance) for factor in TABLES],
        )
    )
    shifted = whitened[:, 1 : 1 + shifts.shape[-1]]
    of_move = whitened[None, :, 1 + shifts.shape[-1] : 2 + shifts.shape[-1]]
    tables = xp.concat(
        [
            *loose,
            *(gains(size * of_move, off) for size in MOVED),
            (shifted.mT @ off)[:, 0] - 0.5 * xp.sum(shifted * shifted, axis=0),
        ],
        axis=0,
    )
    strangers = xp.concat([log_evidence(sigma + width**2 * curves) for width in STRANGERS], axis=0)
    wholes = [log_mean(values, values * 0.0 + 1.0) for values in (xp.concat(tinted, axis=0), tables, strangers)]
    return CauseEvidences(xp.concat([*of_kinds, *wholes], axis=0), xp.where(used > 0.5, of_groups[:n], COLD))


def first_shot(judged: JudgedSignals) -> JudgedSignals:
    """The only shot: a recorded model then knows that it is one."""
    by_shot = ("signals", "standard_error", "predicted", "used", "level", "lamp", "lamp_tolerance", "lamp_modes",
               "gain_modes")  # fmt: skip
    first: dict[str, Array] = {name: getattr(judged, name)[:1, ...] for name in by_shot}
    return replace(judged, **first, fields=judged.fields[:, :1, :])


def kinds_of_error(judged: JudgedSignals, scene: ChartScene) -> list[list[Variants]]:
    """The variants of the kinds "gloss" to "tone" of CAUSES.

        gloss     an offset of each patch, of the white's colour
        veil      1 - y, of the white's colour or of another
        black     (1 - y) / level, likewise
        white     y, each channel on its own                           with a white frame
        clipped   one channel: y above a level, or the white's signal, or both
        shadow    y times a plane and a bowl (with a white frame), cubic terms, a spot about a patch, or an edge
        lights    y times a plane, each channel on its own
        tone      y ln y, a kink or a toe

    Sizes stand in data/rules.json, group "causes".
    """
    xp, (_, n, _) = namespace(judged.signals), judged.signals.shape
    y, used, level = judged.signals[0, ...], judged.used[0, :], judged.level[0, ...]  # (n, 3), (n,)
    reference = scene.reference[:, None]  # (n, 1)
    framed = 1.0 - xp.sum(scene.reference)
    channels = constant(xp, np.eye(3))
    X, Y = scene.places[:, :1], scene.places[:, 1:]

    def variant(*directions: Array, counts: Array | None = None) -> Variants:
        """One variant of these directions, (n, 3) each."""
        D = xp.stack([xp.broadcast_to(d, (n, 3)) for d in directions], axis=-1)[None, ...]
        return Variants(D, xp.ones((1,), dtype=xp.float64) if counts is None else xp.reshape(counts, (1,)))

    def each_channel(d: Array) -> list[Array]:
        return [d * channels[c, :] for c in range(3)]

    among = eye(xp, n)  # (variant, patch)
    gloss = [xp.broadcast_to(s * among[None, :, None, :], (1, n, 3, n)) for s in OFFSETS]
    ones = xp.ones((1,), dtype=xp.float64)
    offset = [
        [
            each
            for s in sizes
            for each in (
                variant(s * (1.0 - y) / of),
                variant(*(s * (channels[c, :] - y * channels[c, :] * (1.0 - framed * white)) / of for c in range(3))),
            )
        ]
        for sizes, of, white in ((OFFSETS, 1.0, 1.0), (BLACKS, level, 0.0))
    ]
    seen = xp.stack([y, judged.predicted[0, ...]], axis=0)  # the signals, and the answer's, may be above the ceiling
    top = xp.max(used[:, None] * seen, axis=1)[:, None, None, :]  # (2, 1, 1, 3)
    shares = constant(xp, np.array(CLIPPED_FROM))[:, None, None]
    bent = CLIPPED * xp.maximum(seen[:, None, :, :] - shares * top, 0.0)  # (2, 4, n, 3)
    count = 2 * len(CLIPPED_FROM) * 3
    bent = xp.reshape(bent[:, :, None, :, :] * channels[:, None, :], (count, n, 3))
    of_white = CLIPPED_WHITE * y * channels[:, None, :]  # (3, n, 3) of each channel
    both = xp.reshape(xp.broadcast_to(of_white, (count // 3, 3, n, 3)), (count, n, 3))
    clipped = [
        Variants(D, xp.ones((D.shape[0],), dtype=xp.float64))
        for D in (bent[..., None], xp.stack([bent, both], axis=-1), of_white[..., None])
    ]
    plane = [variant(*(s * y * field for field in (X, Y, X * X, X * Y, Y * Y)), counts=framed) for s in SHADOWS]
    cubic = variant(*(SHADOWS[0] * y * field for field in (X * X * X, X * X * Y, X * Y * Y, Y * Y * Y)))
    apart = (X - X.mT) ** 2 + (Y - Y.mT) ** 2  # (n, n)
    spots = []
    for radius in RADII:
        spot = xp.exp(-0.5 / radius**2 * apart)
        spot = spot - spot @ reference  # where the white patch is the reference, it is as dark as that
        spots.append(Variants(SPOT * (spot[:, :, None] * y)[..., None], used))
    turns = np.arange(ANGLES) * (2.0 * np.pi / ANGLES)
    across = X * constant(xp, np.cos(turns)) + Y * constant(xp, np.sin(turns))  # (n, a)
    distances = constant(xp, np.array(EDGES))[:, None, None]
    dark = xp.astype(across.mT[None, ...] > distances, xp.float64)  # (e, a, n)
    dark = dark - xp.sum(scene.reference * dark, axis=-1)[..., None]
    dark = xp.reshape(dark, (len(EDGES) * ANGLES, n, 1))
    edges = Variants((SHADOWS[1] * dark * y)[..., None], xp.ones((len(EDGES) * ANGLES,), dtype=xp.float64))
    lights = [variant(*(s * d for field in (X, Y) for d in each_channel(y * field))) for s in LIGHTS]
    tone = [variant(s * y * xp.log(xp.maximum(y, DARKEST_TONE))) for s in TONES]
    tone += [variant(KINK * xp.maximum(y - at, 0.0)) for at in KINKS]
    tone.append(variant(TOE * (1.0 - xp.exp(-y / TOE_END) - y)))
    kinds = [
        [Variants(d, ones) for d in gloss],
        *offset,
        [variant(*each_channel(s * framed * y)) for s in WHITES],
        clipped,
        [*plane, cubic, *spots, edges],
        lights,
        tone,
    ]
    return [merged(variants) for variants in kinds]


def merged(variants: list[Variants]) -> list[Variants]:
    """The same variants, those of one width together."""
    xp = namespace(variants[0].counts)
    of_width: dict[Any, list[Variants]] = {}
    for one in variants:
        of_width.setdefault(one.directions.shape[-1], []).append(one)
    return [
        Variants(
            xp.concat([one.directions for one in alike], axis=0), xp.concat([one.counts for one in alike], axis=0)
        )
        for alike in of_width.values()
    ]


def spoilt(judged: JudgedSignals, scene: ChartScene) -> Array:
    """(1, n, 3) size of the error of a patch that is not what the table says."""
    return (PATCH_SHARE * judged.signals + PATCH_OFFSET) * (1.0 - scene.reference[:, None])


def patch_groups(judged: JudgedSignals, scene: ChartScene) -> Array:
    """(3 n, n) 1 for the patches of each group: each patch alone, with its four and with its eight neighbours.

    Errors of a group's signals are independent: dirt, a misprint, or a finger over some of them.
    """
    xp, n = namespace(judged.signals), judged.signals.shape[1]
    X, Y = scene.places[:, :1], scene.places[:, 1:]
    apart, self_ = (X - X.mT) ** 2 + (Y - Y.mT) ** 2, eye(xp, n)
    nearest = xp.min(apart + 1e9 * self_)
    return xp.concat([self_, *(xp.astype(apart < reach**2 * nearest, xp.float64) for reach in REACHES)], axis=0)


def moved_table(signals_at: LinearisedSignals) -> Array:
    """(N, 1) change of ŷ if the table's wavelengths are off by 1 nm."""
    change = (signals_at.edges @ signals_at.curve)[..., 0]  # (1, 3, k, n)
    return by_row(namespace(change).permute_dims(change[0, ...], (1, 2, 0)))


def table_shifts(judged: JudgedSignals, scene: ChartScene, signals_at: LinearisedSignals) -> Array:
    """(N, t) signals of the other tables minus those of the chart's own, at the answer."""
    xp, (t, n, _) = namespace(judged.signals), scene.tables.shape
    light = judged.curves.mT * (signals_at.light[0, :, 0, 0, :])  # (3, m) L s dλ / W
    apart = (scene.tables - judged.reflectance) @ light.mT  # (t, n, 3)
    return xp.reshape(xp.permute_dims(apart, (1, 2, 0)), (3 * n, t))


def gains(D: Array, off: Array) -> Array:
    """(c,) of whitened directions D (c, N, w) and whitened b (N, 1)."""
    xp, w = namespace(D), D.shape[-1]
    g = D.mT @ off
    explained, log_det = whiten(D.mT @ D + eye(xp, w), g)
    return 0.5 * (xp.sum(explained * explained, axis=(1, 2)) - log_det)


def log_mean(values: Array, counts: Array) -> Array:
    """(1,) ln of the mean of exp(values), of those that count."""
    xp = namespace(values)
    top = xp.max(xp.where(counts > 0.5, values, COLD))
    share = xp.sum(counts * xp.exp(xp.minimum(values - top, 0.0))) / xp.sum(counts)
    return xp.reshape(top + xp.log(share), (1,))
