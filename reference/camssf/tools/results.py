"""Results of calibrations → a basis: what photos say of a population of cameras, without what was believed before.

A result's curves are drawn towards the mean of the basis that they were found on, the more so the less the photo
said. Who learned from them would learn the old basis again, and narrower. So each result is taken for what its photo
says alone. With s = μ + Ψ x on the old basis, x ~ N(0, I) beforehand and N(x̂, C) afterwards, the photo said

    J = C⁻¹ - I,    h = C⁻¹ x̂ + γ sign(x̂)        (ln p(photo | x) = hᵀ x - ½ xᵀ J x + constant)

(γ is the elastic net's pull towards 0 where x̂ is not 0). Directions of which it said less than LEAST_SAID are left
out: there h is small differences of rounded numbers, the same for all units of a model. What remains is a measurement
Aᵀ x = g with errors of size 1: J = A Aᵀ, h = A g. Several photos of a unit are one, with the mean of their J and h:
they share what is wrong with chart and light.

A unit u of the model k has x = c_k + d_u with c ~ N(m, B) and d ~ N(0, W). The most likely m, B, W are found by
expectation and maximisation. What a unit says of its model, what all units and the population do, and what is left
for the unit:

    J̃ = A (I + Aᵀ W A)⁻¹ Aᵀ,  h̃ = A (I + Aᵀ W A)⁻¹ g;    V_k = (B⁻¹ + Σ J̃)⁻¹,  c̄_k = m + V_k Σ (h̃ - J̃ m)
    d̄ = W (h̃ - J̃ c̄_k),    E d dᵀ = W - W J̃ W + d̄ d̄ᵀ + W J̃ V_k J̃ W

and then, with weights w of sum 1 over the old basis' cameras (mean 0, covariance I), measured tables and models,

    m = Σ w_k c̄_k + …,    B = w₀ (I + m mᵀ) + Σ w_k (V_k + (c̄_k - m)(c̄_k - m)ᵀ) + …
    W = (P ω² I + Σ E d dᵀ) / (P + n)

until they stay; ω² is the mean variance in W itself, so P holds its form, not its size, but for what FIRST and
BELIEVED say of the size while few models have two units. A direction in which no photo says anything, J = 0, gives
back what it was told: it neither narrows nor widens the population. So a result weighs by its band. A maker weighs by
the root of the number of its models, as in `learn`. B and W are of independent channels, as a basis is.

The basis of all: N(m, B + W). That of one model: N(c̄_k, V_k + W).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf.curves.basis import NODES, Basis
from camssf.grid import Floats
from camssf.tools.learn import COPIES, SEED, enlarge
from camssf.tools.training import Enlargement, maker_of

LEAST_VARIANCE = 1e-4
"""Of a code in C, whose prior's is 1: no photo is believed better than a hundredth of what cameras differ by."""
ROUNDS, STILL = 200, 1e-3
"""Of expectation and maximisation, at most; and the change of B and W, in parts of them, that is none."""
NOUGHT = 1e-3
"""A code below it was 0 before it was rounded."""
LEAST_SAID = 0.1
"""J in units of the prior's precision."""
FIRST, BELIEVED = 0.3, 4.0
"""How far units of a model are believed to differ, in parts of what cameras do, and for how many units that
counts."""
FORM = 24.0
"""P: for how many units W's form, the same in every direction, counts."""

Member: TypeAlias = tuple[str, str, str]
"""Maker, model, unit."""


@dataclass(frozen=True)
class Said:
    """What one photo says of its camera's code x on the old basis.

    Attributes:
        member: whose it is.
        factor: (3 r, q) A.
        value: (q,) g.
    """

    member: Member
    factor: Floats
    value: Floats


@dataclass(frozen=True)
class Old:
    """The basis that the results were found on, on the nodes, its channels' curves of equal area.

    Attributes:
        mean, dictionary: (3, 69) μ and (3, 69, r) Ψ.
        names: of the cameras that it was learned from.
    """

    mean: Floats
    dictionary: Floats
    names: tuple[str, ...] = ()

    def codes(self, curves: Floats) -> Floats:
        """(3 r,) of curves (3, 69) of any scale, by least squares."""
        shapes = curves * (self.mean.sum(axis=1) / curves.sum(axis=1))[:, None] - self.mean
        return np.concatenate([np.linalg.lstsq(*pair)[0] for pair in zip(self.dictionary, shapes, strict=True)])


@dataclass(frozen=True)
class Tables:
    """Measured cameras beside the results.

    Attributes:
        curves: (n, 69, 3).
        names: of each.
        size: how they are enlarged.
    """

    curves: Floats = field(default_factory=lambda: np.zeros((0, NODES.size, 3)))
    names: tuple[str, ...] = ()
    size: Enlargement = field(default_factory=Enlargement)


@dataclass(frozen=True)
class Population:
    """Cameras by model and unit, in the old basis' codes.

    Attributes:
        old: the basis.
        mean, between, within: (3 r,) m, (3 r, 3 r) B and W.
        models: c̄ (3 r,) and V (3 r, 3 r) of each, by maker and model.
        units: how many there were.
        rounds: that it took.
        weights: shares of the old basis, of each table, and of each model in the order of `models`.
        tables: that were learned from.
    """

    old: Old
    mean: Floats
    between: Floats
    within: Floats
    models: dict[tuple[str, str], tuple[Floats, Floats]]
    units: int
    rounds: int
    weights: tuple[float, Floats, Floats]
    tables: Tables

    def prior(self, model: tuple[str, str] | None = None) -> tuple[Floats, Floats]:
        """Mean and covariance of a unit's code: of any camera, or of a model's."""
        if model is None:
            return self.mean, self.between + self.within
        centre, spread = self.models[model]
        return centre, _independent(spread) + self.within

    def basis(self, model: tuple[str, str] | None = None, components: int | None = None) -> tuple[Floats, Floats]:
        """Mean (3, 69) and dictionary (3, 69, components), peak 1 and whitened, as `learn` leaves them.

        Of all cameras, or of one model's units. What the tables have beside the old basis' directions is in that of
        all.
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


def old_basis(basis: Basis, names: Sequence[str] = ()) -> Old:
    """A basis as `learn` leaves it; another one's atoms lose what only changes a curve's size."""
    mean, atoms = basis.mean[:, ::10], basis.dictionary[:, ::10]
    share = atoms.sum(axis=1) / mean.sum(axis=1)[:, None]
    return Old(mean, atoms - mean[:, :, None] * share[:, None, :], tuple(names))


def said(
    member: Member, curves: Floats, covariance: Floats, old: Old, widths: Sequence[tuple[float, float]], gamma: float
) -> Said:
    """What is left of a result without the prior that it was found with.

    Args:
        member: whose.
        curves: (3, 69).
        covariance: (3 r, 3 r) C, of the code on the first of `widths`.
        old: the basis.
        widths: how much wider than the basis the prior was taken, and the weight of the answer under it; the
            likeliest first. Answers under several widths are mixed by weight, so x̂ = Σ w (J + I / width²)⁻¹ h.
        gamma: the l1 penalty.
    """
    x = old.codes(curves)
    spread, axes = np.linalg.eigh(covariance)
    first = widths[0][0]
    j = (1.0 / np.clip(spread, LEAST_VARIANCE, 1.0) - 1.0) / first**2
    gain = sum(weight / (j + width**-2.0) for width, weight in widths) / sum(weight for _, weight in widths)
    pull = (axes.T @ x) / gain + gamma / first * axes.T @ (np.sign(x) * (np.abs(x) > NOUGHT))
    kept = j > LEAST_SAID
    return Said(member, axes[:, kept] * np.sqrt(j[kept]), pull[kept] / np.sqrt(j[kept]))


def weigh(
    known: Sequence[str], tables: Sequence[str], models: Sequence[tuple[str, str]]
) -> tuple[float, Floats, Floats]:
    """Weights of the old basis' cameras together, of each table and of each model; their sum is 1."""
    makers = [*map(maker_of, (*known, *tables)), *(maker for maker, _ in models)]
    count = Counter(makers)
    weight = np.array([count[maker] ** -0.5 for maker in makers])
    weight /= weight.sum()
    first, second = len(known), len(known) + len(tables)
    return float(weight[:first].sum()), weight[first:second], weight[second:]


def populate(results: Sequence[Said], old: Old, tables: Tables | None = None) -> Population:
    """The most likely population: see above.

    Args:
        results: at least one.
        old: the basis that they were found on; its cameras count as they would in `learn`.
        tables: measured cameras, each a model of its own.
    """
    tables, size = tables or Tables(), 3 * old.dictionary.shape[2]
    units, A, g = _units(results)
    names = list(dict.fromkeys(unit[:2] for unit in units))
    of = np.array([names.index(unit[:2]) for unit in units])
    weights = weigh(old.names or ("?",), tables.names, names)
    centres, spreads = _codes_of(tables, old)
    m, B, W = np.zeros(size), np.eye(size), FIRST**2 * np.eye(size)
    rounds, moved = 0, np.inf
    while moved > STILL and rounds < ROUNDS:
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
    return Population(old, m, B, W, models, len(units), rounds, weights, tables)


def log_predictive(result: Said, m: Floats, T: Floats) -> float:
    """ln of how likely a photo is that was not learned from, but for a constant that no population changes."""
    off = result.value - m @ result.factor
    inner = np.eye(off.size) + result.factor.T @ T @ result.factor
    return float(-0.5 * off @ np.linalg.solve(inner, off) - 0.5 * np.linalg.slogdet(inner)[1])


def _units(results: Sequence[Said]) -> tuple[list[Member], Floats, Floats]:
    """Units, and A (n, 3 r, q) and g (n, q) of each, filled up with zeros."""
    places: dict[Member, list[Said]] = {}
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
    seen: tuple[Floats, Floats, NDArray[np.intp], int], m: Floats, B: Floats, W: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """c̄ and V of each model; d̄ and the covariance of d of each unit."""
    A, g, of, count = seen
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
    """(n, 3 r, 3 r) → (n, 3, r, r), each channel's own."""
    r = matrices.shape[-1] // 3
    return np.stack([matrices[:, c * r : (c + 1) * r, c * r : (c + 1) * r] for c in range(3)], axis=1)


def _independent(covariance: Floats) -> Floats:
    """The same, where no channel knows of another."""
    channel = np.repeat(np.arange(3), len(covariance) // 3)
    return np.where(channel[:, None] == channel, covariance, 0.0)


def _shapes(tables: Tables, old: Old) -> Floats:
    """(copies, n, 3, 69) of the tables, of the old mean's area."""
    enlarged = enlarge(tables.curves, tables.size, COPIES, np.random.default_rng(SEED))
    shapes = enlarged.reshape(COPIES, -1, NODES.size, 3).swapaxes(2, 3)
    return np.asarray(shapes * (old.mean.sum(axis=1)[:, None] / shapes.sum(axis=3, keepdims=True)))


def _codes_of(tables: Tables, old: Old) -> tuple[Floats, Floats]:
    """(n, 3 r) codes of the tables, and (n, 3 r, 3 r) covariances of their copies."""
    size = 3 * old.dictionary.shape[2]
    if not len(tables.curves):
        return np.zeros((0, size)), np.zeros((0, size, size))
    shapes = _shapes(tables, old) - old.mean
    backs = [np.linalg.pinv(atoms) for atoms in old.dictionary]
    codes = np.concatenate([shapes[:, :, c] @ backs[c].T for c in range(3)], axis=2)  # (copies, n, 3 r)
    away = codes - codes.mean(axis=0)
    centres = codes[0] if tables.size.own_mean else codes.mean(axis=0)
    return centres, np.einsum("qni,qnj->nij", away, away) / len(codes)


def _beside(tables: Tables, old: Old, weights: Floats, c: int) -> tuple[Floats, Floats]:
    """What the tables' shapes have beside the directions of the old basis: of the mean (69,), and rows (q, 69)."""
    atoms = old.dictionary[c]
    shapes = _shapes(tables, old)[:, :, c] - old.mean[c]
    shapes = shapes - shapes @ np.linalg.pinv(atoms).T @ atoms.T
    centre = shapes[0] if tables.size.own_mean else shapes.mean(axis=0)
    off = weights @ centre
    rows = (shapes - off) * np.sqrt(weights / len(shapes))[:, None]
    return off, rows.reshape(-1, NODES.size)


def _whitened(means: Floats, rows: Sequence[Floats], components: int) -> tuple[Floats, Floats]:
    """Peak 1, and principal components times their spread, as `learn` leaves them."""
    dictionary = []
    for each, mean in zip(rows, means, strict=True):
        _, spread, directions = np.linalg.svd(each / mean.max(), full_matrices=False)
        atoms = directions[:components].T * spread[:components]
        signs = np.where(atoms[np.abs(atoms).argmax(axis=0), np.arange(atoms.shape[1])] < 0, -1.0, 1.0)
        dictionary.append(atoms * signs)
    return means / means.max(axis=1, keepdims=True), np.stack(dictionary)
