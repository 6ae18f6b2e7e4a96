"""Ssf → predictions: the signals that the curves give, and how far the true ones may lie from them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from camssf.curves.basis import Basis, read_basis, widened
from camssf.curves.evidence import Evidence, array_of, tolerance_of
from camssf.curves.sensing import levels, sense
from camssf.curves.ssf import Ssf, respond
from camssf.errors import InvalidArgument
from camssf.grid import STEP, WAVELENGTHS, Floats


@dataclass(frozen=True)
class Prediction:
    """Signals and how far the true ones may lie from them.

    Attributes:
        values: (k, p, 3), 1.
        std: (k, p, 3) one standard deviation of true, noise-free signal less prediction.
    """

    values: Floats
    std: Floats


def predict(
    ssf: Ssf,
    evidence: Evidence,
    *,
    of: ArrayLike | None = None,
    of_tolerance: ArrayLike = 0.0,
    of_gains: ArrayLike | None = None,
    basis: str | Basis | None = None,
) -> Prediction:
    """The signals that the curves give of the patches they come from, then of other surfaces `of`, with their bands.

    A true signal is t = A x + e of a row, where e is what chart, white and lamp do to it; the measured ones, with
    noise ν, gave x̂ = G (A x + e + ν). So t - A x̂ = (I - A G)(A x + e) - A G ν, and its variance is the diagonal of
    (I - A G)(A Aᵀ + Σ - N)(I - A G)ᵀ + A G N Gᵀ Aᵀ with N the noise's part of Σ: what the data leave open of the
    curves, and what no data can tell of this very surface and light. A surface that was not measured stands in the
    rows with a standard error without end. The small l1 penalty is left out, as in `explain`.

    Uneven light stands beside the code here, t = y (1 - Σ v φ): what it leaves open is in the band, what it is is not
    in the values.

    Args:
        ssf: the answer to the evidence.
        evidence: what it was recovered from.
        of: (p, 681) reflectances of the other surfaces, seen under the same lamps; None for none.
        of_tolerance: how well these are known, (p,) or one number; 0 for surfaces of exactly that reflectance.
        of_gains: (k, g, p) their gain modes, where they stood in the same photos; None for surfaces under the white's
            own light.
        basis: the answer's own: to be given where it was a file or a Basis. Of a mixture it is the likeliest one's.

    Returns:
        n + p surfaces: the n of `reflectance`, then the p of `of`.

    Raises:
        InvalidArgument: as `recover`; also a basis without a prior, which has no bands.
    """
    basis = basis if isinstance(basis, Basis) else read_basis(ssf.basis if basis is None else str(basis))
    if not basis.prior:
        raise InvalidArgument(f"The {basis.name} basis has no prior, so no bands.", "Take --basis cameras.")
    evidence.check_for(basis)
    basis = widened(basis, ssf.prior_scale)
    others = np.zeros((0, WAVELENGTHS.size)) if of is None else np.atleast_2d(array_of("of", of))
    if others.shape[1:] != (WAVELENGTHS.size,):
        raise InvalidArgument(f"`of` has shape {others.shape}.", "Give reflectances (p, 681) on the grid.")
    (k, n, _), p = evidence.signals.shape, len(others)
    every = np.concatenate([evidence.reflectance, others])
    g = evidence.gain_modes.shape[1]
    other_gains = np.zeros((k, g, p)) if of_gains is None else array_of("of_gains", of_gains, (k, g, p))
    values = respond(ssf.values, every, ssf.lamp, evidence.white_reflectance)
    used = np.ones((k, n), dtype=bool) if evidence.used is None else evidence.used
    modes = np.concatenate([evidence.gain_modes, other_gains], axis=2)
    known = ssf.gain_code if ssf.gain_code.shape == (k, g) else np.zeros((k, 0))  # of another evidence
    lit = values / levels(known, modes)[:, :, None]  # as they would have been measured in this light
    extended = replace(
        evidence,
        signals=np.concatenate([np.where(used[:, :, None], evidence.signals, lit[:, :n]), lit[:, n:]], axis=1),
        standard_error=np.concatenate([evidence.errors(basis), np.zeros((k, p, 3))], axis=1),
        used=np.concatenate([used, np.zeros((k, p), dtype=bool)], axis=1),
        reflectance=every,
        chart_tolerance=np.concatenate([evidence.chart_tolerance, tolerance_of("of_tolerance", of_tolerance, p)]),
        gain_modes=modes,
        frames=None,
    )
    sensing = sense(extended, basis)
    # A row is a difference of signals times its curve's white signal over W.
    first = evidence.lamp[0] * evidence.white_reflectance * STEP
    seen = (ssf.lamp * evidence.white_reflectance * STEP) @ ssf.values * (basis.mean @ first)  # (k, 3)
    shared = sensing.gains @ sensing.gains.T
    A = np.concatenate([sensing.matrix[0], sensing.gains], axis=1)
    sigma, noise = sensing.covariance[0] - shared, np.diag(sensing.terms["noise"][0])
    weighted = np.linalg.solve(sigma, A)
    smoother = A @ np.linalg.solve(A.T @ weighted + np.eye(A.shape[1]), weighted.T)
    rest = np.eye(len(A)) - smoother
    kept = A @ A.T - shared + sum(term[0] for source, term in sensing.terms.items() if source != "noise")
    variance = np.sum(rest @ kept * rest, axis=1) + smoother**2 @ noise
    std = np.sqrt(variance).reshape(3, k, n + p) * (sensing.white / seen.T)[:, :, None]
    return Prediction(values, np.moveaxis(std, 0, -1))
