"""Gaussian posterior of the code from whitened rows: evidence, bands, budget, modes, errors of predictions.

The small l1 penalty is left out: x ~ N(0, I), b = A x + error, error ~ N(0, I). Axes as in `camssf.recovery.rows`.
"""

from __future__ import annotations

from camssf.recovery.arrays import Array, constant, eye, inverse, namespace, whiten_and_solve
from camssf.recovery.basis import NODES, SHARES, interpolate, misfit_profile
from camssf.recovery.whitening import Whitened


def log_evidence(A: Array, b: Array, mean: Array, log_dets: Array) -> Array:
    """ln of the density of b but for a constant, -½ (bᵀ P⁻¹ b + ln det P), (h,), from whitened rows.

    P = L (I + A Aᵀ) Lᵀ, Σ = L Lᵀ. With K = H + I and the posterior mean x̂ = K⁻¹ g, bᵀ P⁻¹ b = ‖b - A x̂‖² + ‖x̂‖²,
    which an error of x̂ changes in second order only, and ln det P = ln det Σ + ln det K.

    Args:
        A, b: (h, N, R) and (h, N, 1).
        mean: (h, R, 1) x̂.
        log_dets: (h,) ln det Σ + ln det K.
    """
    xp, rest = namespace(A), b - A @ mean
    squares = xp.sum(rest * rest, axis=(-2, -1)) + xp.sum(mean * mean, axis=(-2, -1))
    return -0.5 * (squares + log_dets)


def evidence_of(model: Whitened) -> Array:
    """`log_evidence` of every hypothesis, without solving it."""
    A, b = model.A, model.b
    _, log_det, solve = whiten_and_solve(A.mT @ A + eye(namespace(A), A.shape[-1]), A.mT @ b)
    return log_evidence(A, b, solve(), model.log_det + log_det)


def code_posterior(model: Whitened) -> tuple[Array, Array]:
    """Posterior mean x̂ = S g (h, R, 1) and covariance S = (H + I)⁻¹ (h, R, R) of the code."""
    A = model.A
    spread, _ = inverse(A.mT @ A + eye(namespace(A), A.shape[-1]))
    return spread @ (A.mT @ model.b), spread


def modes_of_lamps(model: Whitened, mean: Array, spread: Array) -> tuple[Array, Array]:
    """Posterior mean (h, K, 1) and covariance (h, K, K) of the lamp modes, K = k q.

    With b = A x + D u + e, P = Σ + A Aᵀ and D Dᵀ in Σ: û = Dᵀ P⁻¹ b with covariance I - Dᵀ P⁻¹ D. From the code's
    posterior mean x̂ and covariance S, P⁻¹ b = Σ⁻¹ (b - A x̂) and Dᵀ P⁻¹ D = Dᵀ Σ⁻¹ D - (Dᵀ Σ⁻¹ A) S (Aᵀ Σ⁻¹ D).
    """
    D = model.lamps
    on_code = D.mT @ model.A
    reduced = D.mT @ D - on_code @ spread @ on_code.mT
    return D.mT @ (model.b - model.A @ mean), eye(namespace(D), D.shape[-1]) - reduced


def own_blocks(covariance: Array) -> Array:
    """Diagonal blocks (..., 3, r, r), one a channel, of covariances (..., 3 r, 3 r) of the three channels' codes."""
    r = covariance.shape[-1] // 3
    blocks = [covariance[..., c * r : (c + 1) * r, c * r : (c + 1) * r] for c in range(3)]
    return namespace(covariance).stack(blocks, axis=-3)


def peak_normalised_jacobian(dictionary: Array, curves: Array) -> Array:
    """Derivative of the curves of peak 1 by the code, times the peak, (..., 3, v, r).

    With ŝ = s / s_p, p where s peaks, an error d s changes ŝ by (d s - ŝ d s_p) / s_p: Ψ - ŝ Ψ_p.

    Args:
        dictionary: (..., 3, v, r) Ψ.
        curves: (..., 3, v) s.
    """
    xp = namespace(curves)
    places = xp.arange(curves.shape[-1])
    at_peak = xp.astype(xp.argmax(curves, axis=-1, keepdims=True) == places, xp.float64)  # (..., 3, v)
    shape = curves / xp.max(curves, axis=-1, keepdims=True)
    return dictionary - shape[..., None] * (at_peak[..., None, :] @ dictionary)


def variance_of_curves(moves: Array, spread: Array) -> tuple[Array, Array]:
    """Variances of interpolated curves at the nodes, (..., 3, v), and from each to the next, (..., 3, v - 1, 10).

    Args:
        moves: (..., 3, v, r) derivatives by the code, at the nodes.
        spread: (..., 3, r, r) covariance of each channel's code.
    """
    xp = namespace(moves)
    reach, right = moves @ spread, constant(xp, SHARES)
    here, left = xp.sum(reach * moves, axis=-1), 1.0 - right
    after = xp.sum(reach[..., :-1, :] * moves[..., 1:, :], axis=-1)
    between = here[..., :-1, None] * (left * left) + after[..., None] * (2.0 * left * right)
    return here, between + here[..., 1:, None] * (right * right)


def std_of_curves(dictionary: Array, curves: Array, spread: Array) -> Array:
    """One standard deviation (h, 3, m) on the grid of the curves of peak 1, times the peak.

    It includes what every basis misses (`misfit_profile`).
    """
    xp, (h, _, v) = namespace(curves), curves.shape
    here, between = variance_of_curves(peak_normalised_jacobian(dictionary, curves), own_blocks(spread))
    variance = xp.concat([xp.reshape(between, (h, 3, (v - 1) * 10)), here[..., -1:]], axis=-1)
    return xp.sqrt(xp.maximum(variance, 0.0) + missed_variance(curves))


def missed_variance(curves: Array) -> Array:
    """Variance (..., 3, m) on the grid that every basis misses of curves (..., 3, v) of peak 1, times the peak²."""
    xp = namespace(curves)
    missed = interpolate(constant(xp, misfit_profile()[..., None]))[..., 0]  # (3, m)
    missed = missed * xp.max(curves, axis=-1, keepdims=True)
    return missed * missed


def budget(model: Whitened, mean: Array, spread: Array) -> Array:
    """Share of each source in the variance of each channel, (h, 7, 3): the six of `SOURCES`, then "unseen".

    The covariance of the code is S = G Σ Gᵀ + (I - G A)(I - G A)ᵀ, G = S Eᵀ: the sum of S Eᵀ Σ_t E S over the
    sources t, and of S S, the prior variance that the patches do not determine, because I - G A = S. The variance of
    a channel is that of its curve of peak 1, summed over the grid. What every basis misses is unseen, too.

    Args:
        model: with its `errors`.
        mean, spread: (h, R, 1) x̂ and (h, R, R) S.
    """
    xp, folded = namespace(mean), model.folded
    h, R = folded.h, spread.shape[-1]
    every = xp.concat([model.errors.by_source, xp.broadcast_to(eye(xp, R), (h, 1, R, R))], axis=1)
    curves = folded.mean + (folded.atoms @ xp.reshape(mean, (h, 3, R // 3, 1)))[..., 0]
    parts = own_blocks(spread[:, None, ...] @ every @ spread[:, None, ...])  # (h, 7, 3, r, r)
    here, between = variance_of_curves(peak_normalised_jacobian(folded.atoms, curves)[:, None, ...], parts)
    total = xp.sum(between, axis=(-2, -1)) + here[..., NODES.size - 1]
    missed = xp.sum(missed_variance(curves), axis=-1)[:, None, :]
    total = xp.concat([total[:, :-1, :], total[:, -1:, :] + missed], axis=1)
    return total / xp.sum(total, axis=1, keepdims=True)


def predicted_std(model: Whitened, spread: Array, response: Array) -> Array:
    """One standard deviation (h, k, n, 3) of each true signal minus its prediction; masked signals have one, too.

    Args:
        model: with its `errors`; the formula is that of `errors_by_source`.
        spread: (h, R, R) posterior covariance of the code.
        response: (h, k, 3) white signal of the curves, times that of μ under the first lamp over that of the curves.
    """
    xp, h, (k, n, *_), errors = namespace(spread), model.folded.h, model.folded.sizes, model.errors
    variance = xp.sum((errors.signal @ spread) * errors.error, axis=-1) + errors.rest
    std = xp.permute_dims(xp.reshape(xp.sqrt(variance), (h, n, 3, k)), (0, 3, 1, 2))
    return std / response[:, :, None, :]
