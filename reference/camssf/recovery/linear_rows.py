"""The rows A, b and Σ of an observation as whole matrices, for another solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.recovery.basis import Basis, basis_of, interpolate, widened
from camssf.recovery.inputs import hypotheses_of
from camssf.recovery.observation import Observation, array_of
from camssf.recovery.rows import fold_hypotheses
from camssf.recovery.whitening import dense_covariance, linearise, target_at


@dataclass(frozen=True)
class LinearRows:
    """b = A x + error, error ~ N(0, Σ), a priori x ~ N(0, I): the problem that `recover` solves on one basis.

    x holds red's r numbers first, then green's, then blue's. N = 3 k n rows of k shots of n patches are ordered by
    patch, then channel, then shot.

    Attributes:
        A: (N, 3 r), zero between channels.
        b: (N,).
        covariance: (N, N) Σ of the errors of noise, chart, white, lamp and light.
        mean: (681, 3) μ.
        dictionary: (681, 3, r) Ψ, anchored to the first shot's white: no code changes Σ ρ_w L s dλ.
    """

    A: Floats
    b: Floats
    covariance: Floats
    mean: Floats
    dictionary: Floats

    def curves(self, code: ArrayLike) -> Floats:
        """The curves μ + Ψ x of a code (3 r,), (681, 3), each channel's peak = 1.

        Raises:
            InvalidArgument: a code of another shape.
        """
        x = array_of("code", code, (self.A.shape[1],)).reshape(3, -1)
        values = self.mean + np.einsum("mcr,cr->mc", self.dictionary, x)
        return np.asarray(values / values.max(axis=0))


def linear_rows(observation: Observation, *, basis: str | Basis = "cameras", prior_scale: float = 1.0) -> LinearRows:
    """The rows of an observation on a basis with a prior (docs/maths.md, "The rows").

    Where a lamp or the light on the patches has modes, they are the rows of the second linearisation, and Σ contains
    the modes' errors.

    Args:
        observation: signals, chart, white and lamps; a masked signal's row has a very large variance.
        basis: a name, a file, or a Basis.
        prior_scale: width of the prior relative to the learned one.

    Raises:
        InvalidArgument: as `recover`; also for a basis without a prior, whose rows are Eq. (8) to (10).
    """
    known = basis_of(basis)
    if not known.prior:
        raise InvalidArgument(f"The {known.name} basis has no prior, so no such rows.", "Choose the basis cameras.")
    folded = fold_hypotheses(hypotheses_of([observation], widened(known, prior_scale)))
    rows, modes, point = linearise(folded)
    return LinearRows(
        A=rows.A[0],
        b=target_at(rows, modes, point)[0, :, 0],
        covariance=(dense_covariance(rows, modes) + modes.both @ modes.both.mT)[0],
        mean=interpolate(folded.mean[0].mT),
        dictionary=np.moveaxis(interpolate(folded.atoms[0]), 0, 1),
    )
