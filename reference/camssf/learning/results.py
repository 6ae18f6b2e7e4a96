"""Learns a basis from results of calibrations, using the likelihood of each photo without the prior.

A result's curves are shrunk towards the mean of the basis that they were computed on, the more so the less
information the photo has. A basis learned from them would repeat the old basis, only narrower. So each result's
posterior is divided by its prior. With s = μ + Ψ x on the old basis, prior x ~ N(0, I) and posterior N(x̂, C), the
photo's likelihood is Gaussian with

    J = C⁻¹ - I,    h = C⁻¹ x̂ + γ sign(x̂)        (ln p(photo | x) = hᵀ x - ½ xᵀ J x + constant)

(γ is the l1 penalty of the elastic net, which shrinks x̂ where it is not 0). Directions with a precision J below
LEAST_SAID are left out: there h is a small difference of rounded numbers, the same for all units of a model. The rest
is a measurement Aᵀ x = g with errors of standard deviation 1: J = A Aᵀ, h = A g. Several photos of a unit count as
one, with the mean of their J and h, because they share the errors of chart and light.

A unit u of the model k has x = c_k + d_u with c ~ N(m, B) and d ~ N(0, W). The most likely m, B, W are found by
expectation and maximisation (EM). The expectation step gives the posterior of each model and of each unit:

    J̃ = A (I + Aᵀ W A)⁻¹ Aᵀ,  h̃ = A (I + Aᵀ W A)⁻¹ g;    V_k = (B⁻¹ + Σ J̃)⁻¹,  c̄_k = m + V_k Σ (h̃ - J̃ m)
    d̄ = W (h̃ - J̃ c̄_k),    E d dᵀ = W - W J̃ W + d̄ d̄ᵀ + W J̃ V_k J̃ W

The maximisation step, with weights w of sum 1 over the old basis' cameras (mean 0, covariance I), measured tables and
models, is

    m = Σ w_k c̄_k + …,    B = w₀ (I + m mᵀ) + Σ w_k (V_k + (c̄_k - m)(c̄_k - m)ᵀ) + …
    W = (P ω² I + Σ E d dᵀ) / (P + n)

The steps are repeated until B and W converge. ω² is the mean variance in W itself, so P regularises W's form, not its
size; FIRST and BELIEVED regularise the size while few models have two units. A direction without information, J = 0,
neither narrows nor widens the population, so each result counts according to its posterior covariance. A maker is
weighted by the root of the number of its models, as in `learn`. The channels are independent in B and W, as in a
basis.

The basis of all: N(m, B + W). That of one model: N(c̄_k, V_k + W).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.learning.basis import COPIES, SEED, enlarge
from camssf.learning.training import Enlargement, maker_of
from camssf.recovery.basis import NODES, Basis

LEAST_VARIANCE = 1e-4
"""Lower bound of variances in C, where the prior's is 1: a hundredth of the standard deviation between cameras."""
ROUNDS, CONVERGED = 200, 1e-3
"""Largest number of EM rounds, and the relative change of B and W below which they have converged."""
ZERO_CODE = 1e-3
"""Coefficients of a code below this are treated as 0: they differ from it only by rounding."""
LEAST_SAID = 0.1
"""Smallest precision J of a direction that is used, in units of the prior's precision."""
FIRST, BELIEVED = 0.3, 4.0
"""Prior standard deviation between units of a model, relative to that between cameras, and the number of units that
this prior counts as."""
FORM = 24.0
"""P: the number of units that W's prior form, the same variance in every direction, counts as."""

Member: TypeAlias = tuple[str, str, str]
"""Maker, model, unit."""


@dataclass(frozen=True)
class PhotoLikelihood:
    """Likelihood of one photo as a function of its camera's code x on the old basis.

    Attributes:
        member: the camera.
        factor: (3 r, q) A.
        value: (q,) g.
    """

    member: Member
    factor: Floats
    value: Floats


@dataclass(frozen=True)
class ReferenceBasis:
    """The old basis, on which the results were computed, on the nodes; no code changes the area of a curve.

    Attributes:
        mean, dictionary: (3, 69) μ and (3, 69, r) Ψ.
        names: of the cameras that it was learned from.
    """

    mean: Floats
    dictionary: Floats
    names: tuple[str, ...] = ()

    def codes(self, curves: Floats) -> Floats:
        """Codes (3 r,) of curves (3, 69) of any scale, by least squares."""
        shapes = curves * (self.mean.sum(axis=1) / curves.sum(axis=1))[:, None] - self.mean
        return np.concatenate([np.linalg.lstsq(*pair)[0] for pair in zip(self.dictionary, shapes, strict=True)])


@dataclass(frozen=True)
class Tables:
    """Measured cameras that are learned from together with the results.

    Attributes:
        curves: (n, 69, 3).
        names: of each.
        size: of the random changes of their copies.
    """

    curves: Floats = field(default_factory=lambda: np.zeros((0, NODES.size, 3)))
    names: tuple[str, ...] = ()
    size: Enlargement = field(default_factory=Enlargement)


@dataclass(frozen=True)
class Population:
    """The population of cameras, models and units, in the old basis' codes.

    Attributes:
        old: the basis.
        mean, between, within: (3 r,) m, (3 r, 3 r) B and W.
        models: c̄ (3 r,) and V (3 r, 3 r) of each, by maker and model.
        units: number of units.
        rounds: number of EM rounds.
        weights: of the old basis, of each table, and of each model in the order of `models`.
        tables: the measured cameras.
    """

    old: ReferenceBasis
    mean: Floats
    between: Floats
    within: Floats
    models: dict[tuple[str, str], tuple[Floats, Floats]]
    units: int
    rounds: int
    weights: tuple[float, Floats, Floats]
    tables: Tables

    def prior(self, model: tuple[str, str] | None = None) -> tuple[Floats, Floats]:
        """Mean and covariance of the code of a new unit, of any model or of the given one."""
        if model is None:
            return self.mean, self.between + self.within
        centre, spread = self.models[model]
        return centre, _independent(spread) + self.within

    def basis(self, model: tuple[str, str] | None = None, components: int | None = None) -> tuple[Floats, Floats]:
        """Mean (3, 69) and dictionary (3, 69, components), peak 1 and whitened, as from `learn`.

        For all cameras, or for one model's units. Only the basis for all cameras includes the parts of the tables
        outside the span of the old basis.
        """
        old, (mean, covariance) = self.old, self.prior(model)
        means, rows = [], []
        for c, (centre, spread) in enumerate(zip(mean.reshape(3, -1), _blocks(covariance[None])[0], strict=True)):
            atoms = old.dictionary[c]
            means.append(old.mean[c] + atoms @ centre)
            rows.append(_root(spread).T @ atoms.T)
            if model is None and len(self.tables.curves):
                off, own = _beside(self.tables, old, self.weights[1], c)
                means[-1] = means[-1] + off
                rows[-1] = np.concatenate([rows[-1], own])
        return _whitened(np.stack(means), rows, components or old.dictionary.shape[2])


def reference_basis(basis: Basis, names: Sequence[str] = ()) -> ReferenceBasis:
    """The reference basis of a basis; the part of its atoms that only changes a curve's area is removed."""
    mean, atoms = basis.mean[:, ::10], basis.dictionary[:, ::10]
    share = atoms.sum(axis=1) / mean.sum(axis=1)[:, None]
    return ReferenceBasis(mean, atoms - mean[:, :, None] * share[:, None, :], tuple(names))


def photo_likelihood(
    member: Member,
    curves: Floats,
    covariance: Floats,
    reference: ReferenceBasis,
    prior_scale: float,
    gamma: float,
) -> PhotoLikelihood:
    """The likelihood of a result's photo: its posterior without the prior.

    Args:
        member: the camera.
        curves: (3, 69).
        covariance: (3 r, 3 r) C, of the code.
        reference: the basis.
        prior_scale: width of the result's prior relative to the learned one.
        gamma: the l1 penalty.
    """
    x = reference.codes(curves)
    spread, axes = np.linalg.eigh(covariance)
    j = (1.0 / np.clip(spread, LEAST_VARIANCE, 1.0) - 1.0) / prior_scale**2
    pull = (axes.T @ x) * (j + prior_scale**-2.0)
    pull += gamma / prior_scale * axes.T @ (np.sign(x) * (np.abs(x) > ZERO_CODE))
    kept = j > LEAST_SAID
    return PhotoLikelihood(member, axes[:, kept] * np.sqrt(j[kept]), pull[kept] / np.sqrt(j[kept]))


def weigh(
    statistics: Sequence[str], tables: Sequence[str], models: Sequence[tuple[str, str]]
) -> tuple[float, Floats, Floats]:
    """Weights of the old basis' cameras together, of each table and of each model; their sum is 1."""
    makers = [*map(maker_of, (*statistics, *tables)), *(maker for maker, _ in models)]
    count = Counter(makers)
    weight = np.array([count[maker] ** -0.5 for maker in makers])
    weight /= weight.sum()
    first, second = len(statistics), len(statistics) + len(tables)
    return float(weight[:first].sum()), weight[first:second], weight[second:]


def populate(
    results: Sequence[PhotoLikelihood], reference: ReferenceBasis, tables: Tables | None = None
) -> Population:
    """Estimate the most likely population by EM, as the module's docstring describes.

    Args:
        results: at least one.
        reference: the basis that they were computed on; its cameras count as in `learn`.
        tables: measured cameras, each a model of its own.
    """
    tables, size = tables or Tables(), 3 * reference.dictionary.shape[2]
    units, A, g = _units(results)
    names = list(dict.fromkeys(unit[:2] for unit in units))
    of = np.array([names.index(unit[:2]) for unit in units])
    weights = weigh(reference.names or ("?",), tables.names, names)
    centres, spreads = _codes_of(tables, reference)
    m, B, W = np.zeros(size), np.eye(size), FIRST**2 * np.eye(size)
    rounds, moved = 0, np.inf
    while moved > CONVERGED and rounds < ROUNDS:
        rounds += 1
        c, V, d, D = _expected((A, g, of, len(names)), m, B, W)
        m = weights[1] @ centres + weights[2] @ c
        fresh = weights[0] * (np.eye(size) + np.outer(m, m)) + np.einsum("k,kij->ij", weights[2], V)
        fresh += np.einsum("k,ki,kj->ij", weights[2], c - m, c - m)
        fresh += np.einsum("k,kij->ij", weights[1], spreads)
        fresh += tables.size.few_makers * np.einsum("k,ki,kj->ij", weights[1], centres - m, centres - m)
        scatter = D.sum(axis=0) + d.T @ d
        even = (BELIEVED * FIRST**2 + np.trace(scatter) / size) / (BELIEVED + len(units))
        spread = (FORM * even * np.eye(size) + scatter) / (FORM + len(units))
        fresh, spread = _independent(fresh), _independent(spread)
        moved = max(np.abs(fresh - B).max() / np.abs(B).max(), np.abs(spread - W).max() / np.abs(W).max())
        B, W = fresh, spread
    c, V, _, _ = _expected((A, g, of, len(names)), m, B, W)
    models = {name: (c[i], V[i]) for i, name in enumerate(names)}
    return Population(reference, m, B, W, models, len(units), rounds, weights, tables)


def log_predictive(result: PhotoLikelihood, m: Floats, T: Floats) -> float:
    """ln of the predictive density of a held-out photo under N(m, T), up to a constant independent of m and T."""
    off = result.value - m @ result.factor
    inner = np.eye(off.size) + result.factor.T @ T @ result.factor
    return float(-0.5 * off @ np.linalg.solve(inner, off) - 0.5 * np.linalg.slogdet(inner)[1])


def _units(results: Sequence[PhotoLikelihood]) -> tuple[list[Member], Floats, Floats]:
    """Units, and A (n, 3 r, q) and g (n, q) of each, padded with zeros."""
    places: dict[Member, list[PhotoLikelihood]] = {}
    for each in results:
        places.setdefault(each.member, []).append(each)
    most = max(sum(each.value.size for each in photos) for photos in places.values())
    A, g = np.zeros((len(places), len(results[0].factor), most)), np.zeros((len(places), most))
    for i, photos in enumerate(places.values()):
        value = np.concatenate([each.value for each in photos]) / len(photos) ** 0.5
        g[i, : value.size] = value
        A[i, :, : value.size] = np.concatenate([each.factor for each in photos], axis=1) / len(photos) ** 0.5
    return list(places), A, g


def _expected(
    observed: tuple[Floats, Floats, NDArray[np.intp], int], m: Floats, B: Floats, W: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """The expectation step: c̄ and V of each model; d̄ and the covariance of d of each unit."""
    A, g, of, count = observed
    back = A.swapaxes(1, 2)
    inner = np.linalg.solve(np.eye(g.shape[1]) + back @ W @ A, np.concatenate([back, g[:, :, None]], axis=2))
    both = A @ inner
    told, pulled = both[:, :, :-1], both[:, :, -1]
    of_model, pull = np.zeros((count, *told.shape[1:])), np.zeros((count, len(m)))
    np.add.at(of_model, of, told)
    np.add.at(pull, of, pulled - told @ m)
    root = _root(B)
    inner = np.eye(len(m)) + root.T @ of_model @ root
    V = root @ np.linalg.solve(inner, np.broadcast_to(root.T, inner.shape))
    c = m + np.einsum("kij,kj->ki", V, pull)
    K = W @ told
    d = np.einsum("ij,nj->ni", W, pulled) - np.einsum("nij,nj->ni", K, c[of])
    return c, V, d, W - K @ W + K @ V[of] @ K.swapaxes(1, 2)


def _root(T: Floats) -> Floats:
    size, axes = np.linalg.eigh(T)
    return np.asarray(axes * np.sqrt(np.maximum(size, 0.0)))


def _blocks(matrices: Floats) -> Floats:
    """The diagonal block of each channel: (n, 3 r, 3 r) → (n, 3, r, r)."""
    r = matrices.shape[-1] // 3
    return np.stack([matrices[:, c * r : (c + 1) * r, c * r : (c + 1) * r] for c in range(3)], axis=1)


def _independent(covariance: Floats) -> Floats:
    """The covariance (3 r, 3 r) with the blocks between channels set to 0."""
    channel = np.repeat(np.arange(3), len(covariance) // 3)
    return np.where(channel[:, None] == channel, covariance, 0.0)


def _shapes(tables: Tables, reference: ReferenceBasis) -> Floats:
    """Curves (copies, n, 3, 69) of the tables and their copies, scaled to the area of the old mean."""
    enlarged = enlarge(tables.curves, tables.size, COPIES, np.random.default_rng(SEED))
    shapes = enlarged.reshape(COPIES, -1, NODES.size, 3).swapaxes(2, 3)
    return np.asarray(shapes * (reference.mean.sum(axis=1)[:, None] / shapes.sum(axis=3, keepdims=True)))


def _codes_of(tables: Tables, reference: ReferenceBasis) -> tuple[Floats, Floats]:
    """(n, 3 r) codes of the tables, and (n, 3 r, 3 r) covariances of their copies."""
    size = 3 * reference.dictionary.shape[2]
    if not len(tables.curves):
        return np.zeros((0, size)), np.zeros((0, size, size))
    shapes = _shapes(tables, reference) - reference.mean
    backs = [np.linalg.pinv(atoms) for atoms in reference.dictionary]
    codes = np.concatenate([shapes[:, :, c] @ backs[c].T for c in range(3)], axis=2)  # (copies, n, 3 r)
    away = codes - codes.mean(axis=0)
    centres = codes[0] if tables.size.own_mean else codes.mean(axis=0)
    return centres, np.einsum("qni,qnj->nij", away, away) / len(codes)


def _beside(tables: Tables, reference: ReferenceBasis, weights: Floats, c: int) -> tuple[Floats, Floats]:
    """The tables' part outside the span of the old basis, in channel c: its mean (69,) and deviations (q, 69)."""
    atoms = reference.dictionary[c]
    shapes = _shapes(tables, reference)[:, :, c] - reference.mean[c]
    shapes = shapes - shapes @ np.linalg.pinv(atoms).T @ atoms.T
    centre = shapes[0] if tables.size.own_mean else shapes.mean(axis=0)
    off = weights @ centre
    rows = (shapes - off) * np.sqrt(weights / len(shapes))[:, None]
    return off, rows.reshape(-1, NODES.size)


def _whitened(means: Floats, rows: Sequence[Floats], components: int) -> tuple[Floats, Floats]:
    """Scale to peak 1, and compute principal components times their spread, as `learn` does."""
    dictionary = []
    for each, mean in zip(rows, means, strict=True):
        _, spread, directions = np.linalg.svd(each / mean.max(), full_matrices=False)
        atoms = directions[:components].T * spread[:components]
        signs = np.where(atoms[np.abs(atoms).argmax(axis=0), np.arange(atoms.shape[1])] < 0, -1.0, 1.0)
        dictionary.append(atoms * signs)
    return means / means.max(axis=1, keepdims=True), np.stack(dictionary)
