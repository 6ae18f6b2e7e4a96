"""Bases of the spectral sensitivities: a mean μ and a dictionary Ψ for each channel, s = μ + Ψ x.

`gaussian` is the paper's basis: no mean, overlapping Gaussians (its Sec. 2.3, FWHM 50 nm). `cameras` and `phones` are
learned from measured cameras and phones, `ryyb` from the phones with yellow in green's place; they are whitened, so
that the prior of the code x is N(0, I). `camssf_lab.learning.basis` writes their files.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from dataclasses import dataclass, replace
from functools import cache, lru_cache, reduce
from importlib import resources
from operator import mul
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.files import local
from camssf.grid import WAVELENGTHS, Floats, frozen
from camssf.recovery.arrays import Array, constant, namespace
from camssf.spectra.text import path_text

NODES: Floats = WAVELENGTHS[::10]
"""The 69 wavelengths, 5 nm apart, of the measured curves; between them curves are interpolated linearly."""

MISFIT_FILE = Path(__file__).parents[1] / "data" / "misfit.json"
"""Written by `python -m tools.misfit_profile`."""


@cache
def misfit_profile() -> Floats:
    """m (3, 69) of R, G, B at the nodes: one standard deviation of what curves of peak 1 miss besides their bands.

    A learned basis holds only cameras like those that it was learned from. The profile comes from measured cameras,
    each solved without its maker's; it is added in squares to the bands of every basis with a prior.
    """
    return frozen(np.array(json.loads(MISFIT_FILE.read_text("utf-8"))["values"]))


FWHM_TO_SIGMA = 1.0 / np.sqrt(8.0 * np.log(2.0))
LEARNED = ("cameras", "phones", "ryyb")
"""Learned bases that the package ships, as data/NAME.npz."""
NAMES = (*LEARNED, "gaussian")


@dataclass(frozen=True)
class Basis:
    """A basis of the curves, s = μ + Ψ x for each channel.

    Attributes:
        name: "gaussian", "cameras", "phones", "ryyb", or a file's name.
        mean: (3, 681) μ of R, G, B.
        dictionary: (3, 681, r) Ψ of R, G, B.
        prior: whether x ~ N(0, I) a priori; without a prior there are no error bands.
        source: origin, as text for the report.
    """

    name: str
    mean: Floats
    dictionary: Floats
    prior: bool
    source: str

    def sha256(self) -> str:
        """SHA-256 of mean and dictionary at the nodes, rounded to 12 decimals: the same on every machine."""
        nodes = (self.mean[:, ::10], self.dictionary[:, ::10])
        return hashlib.sha256(b"".join((np.round(n, 12) + 0.0).tobytes() for n in nodes)).hexdigest()


def steady_exp(x: Floats) -> Floats:
    """e^x for x below 700, with the same bits on every processor.

    `np.exp` rounds differently on processors with AVX2 or AVX-512, so models built from it would differ in their
    bytes. This function uses only basic float64 arithmetic in a fixed order: the Taylor series about the nearest
    multiple of ln 2, which is subtracted in two parts, the first exactly.
    """
    k = np.rint(x * 1.4426950408889634)
    r = (x - k * 0.6931471803691238) - k * 1.9082149292705877e-10
    p = np.ones_like(r)
    for n in range(13, 0, -1):
        p = 1.0 + p * r / n
    return np.asarray(np.ldexp(p, k.astype(np.int32)))


def gaussian_basis(count: int = 18, width: float = 50.0) -> Basis:
    """The paper's dictionary: `count` Gaussians of `width` nm FWHM, centres spaced evenly from 380 to 720 nm.

    18 atoms lie 20 nm apart; more of them only worsen the conditioning.

    Raises:
        InvalidArgument: count below 1, or a width that is not positive.
    """
    if count < 1 or not np.isfinite(width) or width <= 0:
        raise InvalidArgument(
            f"A Gaussian basis of {count} atoms, {width} nm wide, is empty.",
            "Take at least one atom and a width > 0.",
        )
    centres = np.linspace(380.0, 720.0, count) if count > 1 else np.array([550.0])
    atoms = steady_exp(-0.5 * ((WAVELENGTHS[:, None] - centres) / (width * FWHM_TO_SIGMA)) ** 2)
    return Basis(
        "gaussian",
        np.zeros((3, WAVELENGTHS.size)),
        np.broadcast_to(atoms, (3, *atoms.shape)),
        False,
        f"{count} Gaussians, FWHM {width:g} nm (the paper's)",
    )


def widened(basis: Basis, scale: float) -> Basis:
    """The basis with a prior `scale` times as wide: s = μ + scale · Ψ x.

    Raises:
        InvalidArgument: a scale that is not positive, or not 1 on a basis without a prior.
    """
    if scale == 1.0:
        return basis
    if not (np.isfinite(scale) and scale > 0 and basis.prior):
        raise InvalidArgument(
            f"`prior_scale` = {scale} is not possible on the {basis.name} basis.",
            "Give a number above 0, and 1 on a basis without a prior.",
        )
    return replace(basis, dictionary=scale * basis.dictionary)


SHARES: Floats = np.arange(10) / 10.0
"""Weight of the next node at each of the ten grid points from a node to the next."""


def interpolate(nodes: Array) -> Array:
    """Interpolate curves linearly from the nodes, (..., 69, r), to the grid, (..., 681, r)."""
    xp, (*lead, v, r) = namespace(nodes), nodes.shape
    share = constant(xp, SHARES[:, None])
    between = nodes[..., :-1, None, :] * (1.0 - share) + nodes[..., 1:, None, :] * share  # (..., 68, 10, r)
    return xp.concat([xp.reshape(between, (*lead, (v - 1) * 10, r)), nodes[..., -1:, :]], axis=-2)


def fold(*factors: Array) -> Array:
    """Apply the adjoint of `interpolate` to a product f of functions on the grid, (..., 681) → (..., 69).

    Σ f s over the grid equals Σ fold(f) s over the nodes, for every curve s that is linear between the nodes.
    """
    xp = namespace(factors[0])
    # Reshaped before they are multiplied: the product is the largest array of the model.
    head = reduce(mul, [xp.reshape(f[..., :-1], (*f.shape[:-1], NODES.size - 1, 10)) for f in factors])
    last = reduce(mul, [f[..., -1:] for f in factors])
    parts = head @ constant(xp, np.stack([1.0 - SHARES, SHARES], axis=1))  # (..., 68, 2): to each node, to the next
    return xp.concat([parts[..., 0], last], axis=-1) + xp.concat([0.0 * last, parts[..., 1]], axis=-1)


def basis_file(spec: str) -> Any:
    """The file with a basis's arrays: inside the package for a shipped one, else the file `spec`."""
    return resources.files("camssf") / "data" / f"{spec}.npz" if spec in LEARNED else local(spec)


def basis_of(spec: object) -> Basis:
    """The basis itself, or the one of this name or file (`read_basis`)."""
    if isinstance(spec, Basis):
        return spec
    return read_basis(path_text(spec) if isinstance(spec, PathLike) else str(spec))


@lru_cache(maxsize=8)
def read_basis(spec: str) -> Basis:
    """Read a basis by its name, or from a file that `python -m camssf_lab.learning.basis` wrote.

    Raises:
        InvalidArgument: `spec` is neither a name nor a valid basis file.
    """
    if spec == "gaussian":
        return gaussian_basis()
    try:
        with basis_file(spec).open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            mean, dictionary = content["mean"], content["dictionary"]
            source = str(content["source"])
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile) as error:
        reason = getattr(error, "strerror", None) or "it is no .npz with mean, dictionary and source"
        raise InvalidArgument(
            f"{spec!r} is neither a basis ({', '.join(NAMES)}) nor a basis file ({reason}).",
            "Name one of these, or make a file from measured curves with "
            "`python -m camssf_lab.learning.basis curves.csv`.",
        ) from error
    shapes = mean.shape == (3, NODES.size) and dictionary.ndim == 3 and dictionary.shape[:2] == (3, NODES.size)
    if not shapes or not (np.isfinite(mean).all() and np.isfinite(dictionary).all()):
        raise InvalidArgument(
            f"{spec!r} holds arrays of shape {mean.shape} and {dictionary.shape}, or values that are not finite.",
            "Make it anew with `python -m camssf_lab.learning.basis curves.csv`.",
        )
    name = spec if spec in NAMES else Path(spec).stem
    return Basis(name, interpolate(mean[..., None])[..., 0], interpolate(dictionary), True, source)
