"""χ² of signals against an answer, and how much of it errors of a capture explain (docs/verdict.md, rules 1 to 3).

k shots, n patches, m = 681 wavelengths. Rows are ordered by patch, then channel, then shot, N = n 3 k.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.grid import STEP, WAVELENGTHS
from camssf.recovery.arrays import Array, cond, constant, eye, namespace, whiten
from camssf.recovery.basis import fold
from camssf.recovery.covariance import LinearisedSignals, Tolerances, by_shot, covariance, patchwise
from camssf.recovery.rows import anchored, slope
from camssf.rules import rules

DARKEST_TONE = rules().number("verdict.darkest_tone")
"""Smallest signal of which the logarithm is taken for a tone curve."""
KINDS = ("veil", "black", "white", "light", "tone")
"""Errors of a capture, in the order of `Misfit.gain`."""


@dataclass(frozen=True)
class JudgedSignals:
    """Signals, and the answer that they are judged by.

    Attributes:
        signals, standard_error, predicted: (k, n, 3) y, its standard error, and ŷ of the answer.
        used: (k, n) 1, or 0 for a patch that does not count.
        level: (k, n, 3) white signal over the largest one, both above dark.
        fields: (f, k, n) relative changes of the light over the chart that are tried.
        curves, code: (m, 3) s and (r, 3) x of the answer.
        lamp: (k, m) as the answer estimates them.
        lamp_tolerance, lamp_modes: (k,) and (k, q, m), as given.
        reflectance, chart_tolerance: (n, m) and (n,).
        white_reflectance, white_tolerance: (m,) ρ_w, and its relative error, ().
        gain_modes, gain_own: (k, g, n) φ, and κ, (), as in `Hypotheses`.

    A recorded model needs at least one field and one mode: of zeros if there are none.
    """

    signals: Array
    standard_error: Array
    predicted: Array
    used: Array
    level: Array
    fields: Array
    curves: Array
    code: Array
    lamp: Array
    lamp_tolerance: Array
    lamp_modes: Array
    reflectance: Array
    chart_tolerance: Array
    white_reflectance: Array
    white_tolerance: Array
    gain_modes: Array
    gain_own: Array

    @property
    def counts(self) -> Array:
        """(k, n, 3) 1 for each signal that counts, else 0."""
        return self.used[..., None] * namespace(self.used).ones((3,), dtype=namespace(self.used).float64)

    @property
    def difference(self) -> Array:
        """(N, 1) y - ŷ in the order of the rows; 0 where it does not count."""
        return by_row(self.counts * (self.signals - self.predicted))


@dataclass(frozen=True)
class Misfit:
    """The parts of T, and of what may explain it.

    Attributes:
        residual, prior, count: () (y - ŷ)ᵀ Σ⁻¹ (y - ŷ), xᵀx, and the number of rows that count.
        gain: (5,) the part of T that each of KINDS explains.
        amount: (3,) size of those errors that have one direction, in units of it: veil, black, tone.
        patch_gain: (n,) the part that independent errors of one patch's signals explain.
    """

    residual: Array
    prior: Array
    count: Array
    gain: Array
    amount: Array
    patch_gain: Array


def signals_at_answer(judged: JudgedSignals) -> LinearisedSignals:
    """The signals and their derivatives at the answer, of one hypothesis; those that do not count are 1."""
    xp = namespace(judged.signals)
    curve, light = judged.curves.mT[None, :, None, :, None], judged.lamp * STEP  # s, and L dλ (k, m)
    response = (light * judged.white_reflectance) @ judged.curves  # W (k, 3)
    per_white = (light / response.mT[..., None])[None, :, :, None, :]  # (1, 3, k, 1, m) L dλ / W
    y, predicted, error = (
        xp.permute_dims(xp.where(judged.used[..., None] > 0.5, x, 1.0), (2, 0, 1))[None, ...]  # (1, 3, k, n)
        for x in (judged.signals, judged.predicted, judged.standard_error)
    )
    return LinearisedSignals(
        y, predicted, error, curve, judged.reflectance * per_white, slope(judged.reflectance) * per_white, per_white,
        judged.white_reflectance * per_white,
    )  # fmt: skip


@dataclass(frozen=True)
class AnswerBasis:
    """The basis of an answer.

    Attributes:
        first_lamp: (m,) of the first shot, as given.
        mean, dictionary: (3, v) μ and (3, v, r) Ψ at the nodes, of the prior's width.
    """

    first_lamp: Array
    mean: Array
    dictionary: Array


def atoms_at_answer(judged: JudgedSignals, basis: AnswerBasis) -> Array:
    """(3, v, r) derivative of the answer's curves by the code.

    The curves are the basis's over their white signal under the first lamp, which no atom changes.
    """
    white = fold((judged.white_reflectance * STEP * basis.first_lamp)[None, :])[:, None, :]  # (1, 1, v)
    return anchored(basis.mean, basis.dictionary, white) / (white @ basis.mean[..., None])


def derivative_by_code(judged: JudgedSignals, signals_at: LinearisedSignals, atoms: Array) -> Array:
    """(N, 3 r) derivative of ŷ by the code; 0 where a signal does not count."""
    xp, (k, n, _), r = namespace(judged.signals), judged.signals.shape, atoms.shape[-1]
    by_curve = signals_at.against_white[0, ...]  # (3, k, n, m)
    of_channel = patchwise((fold(by_curve) @ atoms[:, None, ...])[None, ...])[0, ...]  # (n, 3, k, r)
    of_all = of_channel[:, :, :, None, :] * constant(xp, np.eye(3))[:, None, :, None]
    return by_row(judged.counts) * xp.reshape(of_all, (n * 3 * k, 3 * r))


@dataclass(frozen=True)
class ErrorsAtAnswer:
    """Errors of the signals at the answer; rows that do not count are of the identity.

    Attributes:
        covariance: Σ (N, N). It includes lamp and gain modes by their prior size, so that what they can model is
            weighted by it.
        lamp: (N, p) factors of the lamps' part of it: their modes, then those of `Covariance.lamp`.
    """

    covariance: Array
    lamp: Array


def errors_at_answer(judged: JudgedSignals, signals_at: LinearisedSignals) -> ErrorsAtAnswer:
    """The errors of the signals at the answer."""
    xp, (k, n, _), q = namespace(judged.signals), judged.signals.shape, judged.lamp_modes.shape[1]
    g, N = judged.gain_modes.shape[1], n * 3 * k
    y, curve = signals_at.signal, signals_at.curve
    tolerances = Tolerances(judged.chart_tolerance, judged.white_tolerance, judged.lamp_tolerance[None, :])
    errors = covariance(signals_at, tolerances, WAVELENGTHS)
    by_lamp = (signals_at.against_white * curve[..., 0][..., None, :]) @ judged.lamp_modes.mT[None, None, ...]
    lamps = xp.reshape(by_shot(patchwise(by_lamp)), (N, k * q))
    gains = xp.reshape(by_shot(patchwise(y[..., None] * judged.gain_modes.mT)), (N, k * g))
    one_channel = xp.broadcast_to(constant(xp, np.eye(3))[:, None, None, :, None], (n, 3, k, n, 3, k))
    one_channel = xp.reshape(one_channel, (N, N))
    sigma = errors.dense[0, ...] + lamps @ lamps.mT + (1.0 + judged.gain_own**2 * one_channel) * (gains @ gains.mT)
    counts = by_row(judged.counts)
    lamp = counts * xp.concat([lamps, errors.lamp[0, ...]], axis=-1)
    return ErrorsAtAnswer(counts * counts.mT * sigma + (1.0 - counts) * eye(xp, N), lamp)


def misfit(judged: JudgedSignals, explain: Array) -> Misfit:
    """T and its explanations; these are NaN where `explain`, (), is 0.

    With e = Σ⁻¹ (y - ŷ) and the directions D of an error of the capture, its gain is gᵀ G⁻¹ g with g = Dᵀ e and
    G = Dᵀ Σ⁻¹ D, and its amount G⁻¹ g. The gain of independent errors of a patch's rows is eᵀ ((Σ⁻¹)_pp)⁻¹ e.

        veil     1 - y                                stray light of the white's colour
        black    (1 - y) / level                      a wrong black level, the same in every channel
        white    y, a direction for each channel      a wrong white frame
        light    y times each of `fields`             uneven light
        tone     y ln y                               a tone curve
    """
    xp, (k, n, _) = namespace(judged.signals), judged.signals.shape
    N, f, y = n * 3 * k, judged.fields.shape[0], judged.signals
    used, difference = judged.counts, judged.difference
    sigma = errors_at_answer(judged, signals_at_answer(judged)).covariance

    def explained() -> list[Array]:
        directions = [
            1.0 - y,
            (1.0 - y) / judged.level,
            y * xp.log(xp.maximum(y, DARKEST_TONE)),
            *(y * constant(xp, np.eye(3)[c]) for c in range(3)),
        ]
        light = xp.permute_dims(used * y * judged.fields[..., None], (2, 3, 1, 0))
        columns = [difference, *(by_row(used * x) for x in directions), xp.reshape(light, (N, f)), eye(xp, N)]
        whitened, _ = whiten(sigma, xp.concat(columns, axis=-1))
        off = whitened[:, :1]
        veil, black, tone = (_gain(whitened[:, i : i + 1], off) for i in (1, 2, 3))
        (white, _), (uneven, _) = _gain(whitened[:, 4:7], off), _gain(whitened[:, 7 : 7 + f], off)
        of_patch = xp.permute_dims(xp.reshape(whitened[:, 7 + f :], (N, n, 3 * k)), (1, 0, 2))  # (n, N, 3 k)
        alone, _ = whiten(of_patch.mT @ of_patch, of_patch.mT @ off, 3)
        return [
            xp.sum(off * off),
            xp.concat([veil[0], black[0], white, uneven, tone[0]], axis=0),
            xp.concat([veil[1], black[1], tone[1]], axis=0),
            xp.sum(alone * alone, axis=(1, 2)),
        ]

    def unexplained() -> list[Array]:
        off, _ = whiten(sigma, difference)
        nothing = [xp.full(shape, np.nan, dtype=xp.float64) for shape in ((5,), (3,), (n,))]
        return [xp.sum(off * off), *nothing]

    residual, gain, amount, patch_gain = cond(explain > 0.5, explained, unexplained)
    return Misfit(residual, xp.sum(judged.code * judged.code), xp.sum(used), gain, amount, patch_gain)


def by_row(x: Array) -> Array:
    """(k, n, 3) → (N, 1): in the order of the rows."""
    xp, (k, n, _) = namespace(x), x.shape
    return xp.reshape(xp.permute_dims(x, (1, 2, 0)), (n * 3 * k, 1))


def _gain(D: Array, off: Array) -> tuple[Array, Array]:
    """Gain (1,) of whitened directions D (N, d), and the amount (1,) of the first alone."""
    xp, d = namespace(D), D.shape[1]
    G, g = D.mT @ D, D.mT @ off
    ridge = 1e-12 * xp.sum(G * eye(xp, d)) + 1e-300
    whitened, _ = whiten(G + ridge * eye(xp, d), g)
    return xp.sum(whitened * whitened, axis=0), g[0, :] / (G[0, :1] + ridge)
