"""Whether a unit's blue curve has moved between its shots (docs/verdict.md, rule 10).

k shots, n patches, m = 681 wavelengths, v = 69 nodes, r atoms a channel; rows as in `camssf.recovery.misfit`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.grid import STEP, WAVELENGTHS
from camssf.recovery.arrays import Array, constant, eye, namespace, whiten
from camssf.recovery.basis import fold
from camssf.recovery.covariance import LAMP_CORRELATION, patchwise, smooth_errors
from camssf.recovery.misfit import (
    AnswerBasis,
    JudgedSignals,
    atoms_at_answer,
    by_row,
    derivative_by_code,
    errors_at_answer,
    signals_at_answer,
)
from camssf.rules import rules

STEPS = round(rules().number("verdict.unit_drift_size") / STEP)
"""One standard deviation of a drift, in steps of the grid."""
WHITE_ERROR = rules().number("verdict.unit_white")
"""Standard error of the logarithm of a raw white's red over green, and blue over green."""
BLUE = 2
RATIOS = ((1.0, -1.0, 0.0), (0.0, -1.0, 1.0))
"""Red over green and blue over green, in logarithms of the channels."""
DRIFTS = 3
"""Number of drifts that are compared: of the whole curve, of its long-wave flank, of its short-wave flank."""


@dataclass(frozen=True)
class UnitShots:
    """What a drift is compared with.

    Attributes:
        new: (k,) 1 for each shot after the drift, else 0.
        raw_white: (k, 3) raw values of each shot's white above dark.
    """

    new: Array
    raw_white: Array


def drift_evidences(judged: JudgedSignals, basis: AnswerBasis, unit: UnitShots) -> Array:
    """ln of the Bayes factor of each of DRIFTS before the new shots, (3,).

    A drift v ~ N(0, 1) moves the blue curve, or one of its flanks, by v · STEPS in these shots. With Σ of rule 1 and
    r = y - ŷ at the answer, and d and A the derivatives of ŷ by the drift and by the code:

        g = dᵀ (Σ + A Aᵀ)⁻¹ r,   G = dᵀ (Σ + A Aᵀ)⁻¹ d,   ln of the Bayes factor = ½ g² / (1 + G) - ½ ln(1 + G)
    """
    xp, (k, n, _), r = namespace(judged.signals), judged.signals.shape, basis.dictionary.shape[-1]
    N, signals_at, atoms = n * 3 * k, signals_at_answer(judged), atoms_at_answer(judged, basis)
    counts, by_curve = by_row(judged.counts), signals_at.against_white[0, ...]  # (3, k, n, m)
    A = derivative_by_code(judged, signals_at, atoms)
    moved = unit.new[:, None, None] * (by_curve[BLUE, ...] @ moves(judged.curves[:, BLUE]).mT)  # (k, n, 3)
    moved = moved[None, ...] * constant(xp, np.eye(3)[BLUE])[:, None, None, None]  # (3, k, n, 3)
    d = counts * xp.reshape(patchwise(moved[None, ...]), (N, DRIFTS))
    errors, whites = errors_at_answer(judged, signals_at), white_rows(judged, unit, atoms)
    both = errors.lamp @ whites.lamp.mT
    sigma = xp.concat(
        [xp.concat([errors.covariance, both], axis=-1), xp.concat([both.mT, whites.covariance], axis=-1)], axis=0
    )
    columns = xp.concat(
        [xp.concat([A, d, judged.difference], axis=-1), xp.concat([whites.A, whites.d, whites.off], axis=-1)], axis=0
    )
    columns, _ = whiten(sigma, columns)
    A, d, off = columns[:, : 3 * r], columns[:, 3 * r : 3 * r + DRIFTS], columns[:, 3 * r + DRIFTS :]
    # Woodbury: what another code would explain.
    free, _ = whiten(A.mT @ A + eye(xp, 3 * r), A.mT @ xp.concat([d, off], axis=-1))
    of_drift, of_rest = free[:, :DRIFTS], free[:, DRIFTS:]
    g = (d.mT @ off - of_drift.mT @ of_rest)[:, 0]
    G = xp.sum(d * d, axis=0) - xp.sum(of_drift * of_drift, axis=0)
    return 0.5 * g**2 / (1.0 + G) - 0.5 * xp.log(1.0 + G)


@dataclass(frozen=True)
class WhiteRows:
    """ln of red over green and of blue over green of the raw whites, relative to the last shot's, at the answer.

    Attributes:
        A, d: (2 k - 2, 3 r) and (2 k - 2, DRIFTS) derivatives by the code and by the drifts.
        off: (2 k - 2, 1) measured minus predicted.
        lamp: (2 k - 2, p) factors of the lamps' errors, as in `ErrorsAtAnswer`.
        covariance: (2 k - 2, 2 k - 2) of the errors.
    """

    A: Array
    d: Array
    off: Array
    lamp: Array
    covariance: Array


def white_rows(judged: JudgedSignals, unit: UnitShots, atoms: Array) -> WhiteRows:
    """The rows of the raw whites; `atoms` (3, v, r) are those of the answer's curves.

    The raw white W_cj = g_c Σ ρ_w L_j s_c dλ has the camera's unknown gains g_c, the same in all shots: what differs
    between two shots of a unit is the light, or the unit.
    """
    xp, k, r = namespace(judged.signals), judged.lamp.shape[0], atoms.shape[-1]
    channels = constant(xp, np.array(RATIOS))  # (2, 3)
    light = judged.lamp * judged.white_reflectance * STEP  # (k, m)
    response = light @ judged.curves  # W (k, 3)
    by_curve = light[:, None, :] / response[..., None]  # (k, 3, m) ∂ ln W / ∂s
    by_light = channels @ (by_curve * judged.curves.mT)  # (k, 2, m) ∂ / ∂ ln L
    by_code = xp.permute_dims(fold(xp.permute_dims(by_curve, (1, 0, 2))) @ atoms, (1, 0, 2))  # (k, 3, r)
    by_code = channels[:, :, None] * by_code[:, None, ...]  # (k, 2, 3, r)
    moved = unit.new[:, None] * (by_curve[:, BLUE, :] @ moves(judged.curves[:, BLUE]).mT)  # (k, DRIFTS)
    measured = xp.log(unit.raw_white) - xp.log(response)  # (k, 3)
    smooth = by_light @ smooth_errors(LAMP_CORRELATION, constant(xp, WAVELENGTHS))
    smooth = judged.lamp_tolerance[:, None, None] * smooth
    smooth = xp.concat([smooth, xp.zeros((k, 2, 1), dtype=xp.float64)], axis=-1)  # the drift changes no ratio
    own = eye(xp, k)[:, None, :, None]
    modes, smooth = (
        xp.reshape(factors[:, :, None, :] * own, (k, 2, k * factors.shape[-1]))
        for factors in (by_light @ judged.lamp_modes.mT, smooth)
    )

    def relative(rows: Array) -> Array:
        return xp.reshape(rows[:-1, ...] - rows[-1:, ...], (2 * k - 2, rows.shape[-1]))

    lamp = relative(xp.concat([modes, smooth], axis=-1))
    noise = WHITE_ERROR * relative(xp.reshape(eye(xp, 2 * k), (k, 2, 2 * k)))
    return WhiteRows(
        A=relative(xp.reshape(by_code, (k, 2, 3 * r))),
        d=relative(moved[:, None, :] * channels[:, BLUE, None]),
        off=relative((measured @ channels.mT)[..., None]),
        lamp=lamp,
        covariance=lamp @ lamp.mT + noise @ noise.mT,
    )


def moves(curve: Array) -> Array:
    """(3, m) changes of a curve (m,) whose whole, long-wave flank or short-wave flank moves STEPS to the red."""
    xp, at = namespace(curve), constant(namespace(curve), np.arange(WAVELENGTHS.size, dtype=float))
    peak = xp.astype(xp.argmax(curve, axis=0), xp.float64)
    whole = xp.concat([curve[:1] * xp.ones((STEPS,), dtype=xp.float64), curve[:-STEPS]], axis=0)
    long = xp.where(at > peak, xp.where(at > peak + STEPS, whole, xp.max(curve)), curve)
    short = xp.where(at < peak, whole, curve)
    return xp.stack([whole - curve, long - curve, short - curve], axis=0)
