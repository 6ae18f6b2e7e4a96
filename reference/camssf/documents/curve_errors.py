"""The errors of an answer's curves as independent modes, whose squares add up to the curves' covariance."""

from __future__ import annotations

import numpy as np

from camssf.documents.document import Answer
from camssf.documents.stored_lamp import unit_errors
from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.recovery.basis import Basis, read_basis, widened
from camssf.recovery.posterior import peak_normalised_jacobian
from camssf.recovery.rows import anchor
from camssf.rules import rules

BAND_CORRELATION = rules().number("colour.band_correlation")
LEAST = rules().number("colour.least_mode")
"""Modes with less than this share of the largest mode's variance are left out."""


def error_modes(answer: Answer, white: Floats | None) -> tuple[Floats, bool]:
    """Modes (q, 681, 3) of the errors of curves of peak 1, and whether they come from the whole covariance.

    They come from the answer's covariance, if its basis is the installed one, and from what its bands hold besides;
    else from its bands alone. No modes if it has no bands.

    Args:
        answer: the curves.
        white: (681,) the light of the first shot, to which the basis was anchored; None if it is not known.
    """
    if answer.std is None:
        return np.zeros((0, *answer.curves.values.shape)), True
    modes = None if white is None else _modes_of_covariance(answer, answer.std.values, white)
    return (modes_of_bands(answer.std.values), False) if modes is None else (modes, True)


def _modes_of_covariance(answer: Answer, band: Floats, white: Floats) -> Floats | None:
    """Modes from the answer's covariance; None if it has none, or its basis or a response to the light is missing."""
    covariance = answer.covariance
    if covariance is None or not (white @ answer.curves.values > 0).all():
        return None
    try:
        basis = read_basis(answer.basis)
    except InvalidArgument:
        return None
    if answer.basis_sha256 != basis.sha256() or len(covariance) != 3 * basis.dictionary.shape[2]:
        return None
    return with_rest(modes_of_code(answer.curves.values, covariance, widened(basis, answer.prior_scale), white), band)


def with_rest(modes: Floats, band: Floats) -> Floats:
    """Modes of a band (681, 3): these (q, 681, 3), where they are not wider, and those of what else the band holds.

    The rest is what the basis misses, and the difference between mixed answers.
    """
    own = np.sqrt(np.sum(modes**2, axis=0))
    modes = modes * np.divide(band, own, out=np.ones_like(own), where=own > band)
    rest = np.sqrt(np.maximum(band**2 - np.minimum(own, band) ** 2, 0.0))
    return _largest(np.concatenate([modes, modes_of_bands(rest)])) if rest.any() else modes


def modes_of_code(values: Floats, covariance: Floats, basis: Basis, white: Floats) -> Floats:
    """(q, 681, 3) modes of curves of peak 1 from the covariance (3 r, 3 r) of their code.

    The basis is anchored to the white (681,) ρ_w L, so no code changes Σ white s dλ; this gives the curves' scale.
    """
    anchored = anchor(basis, white)
    curves = values.T * ((anchored.mean @ white) / (values.T @ white))[:, None]
    moves = peak_normalised_jacobian(anchored.dictionary, curves) / curves.max(axis=1)[:, None, None]
    size, axes = np.linalg.eigh(covariance)
    steps = (axes * np.sqrt(np.maximum(size, 0.0))).reshape(3, -1, size.size)
    return _largest(np.einsum("cmr,crq->qmc", moves, steps))


def modes_of_bands(std: Floats) -> Floats:
    """(q, 681, 3) modes whose variance at each wavelength is the band's (681, 3)."""
    smooth = unit_errors(BAND_CORRELATION)
    modes = np.zeros((3, smooth.shape[1], *std.shape))
    for c in range(3):
        modes[c, :, :, c] = (std[:, c, None] * smooth).T
    return _largest(modes.reshape(-1, *std.shape))


def _largest(modes: Floats) -> Floats:
    """The modes reduced to principal ones, the largest first; those below LEAST are left out."""
    flat = modes.reshape(len(modes), -1)
    size, axes = np.linalg.eigh(flat @ flat.T)  # a quarter of the time of singular values, which LEAST needs no finer
    kept = size > LEAST * size[-1]
    return np.asarray((axes[:, kept].T @ flat)[::-1].reshape(-1, *modes.shape[1:]))
