"""Prior distributions of reflectance, made from measured surfaces.

A prior is a mixture of Gaussians, one at each measured surface. Reflectances are divided by their mean over the nodes
first, since a photo's own level states how bright a surface is. The width of a Gaussian follows the distance to the
nearest other surfaces, so where surfaces are dense the prior is narrow.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TypeAlias

import numpy as np

from camssf.errors import InvalidArgument
from camssf.files import local
from camssf.grid import Floats, frozen
from camssf.rules import rules
from camssf.spectra.bundled import SURFACE_NODES, absorber_changes, absorbers, surface_sets
from camssf.spectra.limits import LARGEST_REFLECTANCE, PERCENT
from camssf.spectra.sampled import ascending, check_wavelengths
from camssf.spectra.tables import read_spectra
from camssf.spectra.text import looks_like_file

PRIORS = ("general", "skin")
"""Names that `read_prior` accepts beside the path of a file."""
NEIGHBOURS = rules().whole("surfaces.neighbours")
WIDTH, NARROWEST, ROUGHNESS, ROUGHNESS_CORRELATION, SKINS_COUNT, SATURATION = (
    rules().number(f"surfaces.{word}")
    for word in ("width", "narrowest", "roughness", "roughness_correlation", "skins_count", "saturation")
)


@dataclass(frozen=True)
class SurfacePrior:
    """A mixture of N Gaussians of reflectance at SURFACE_NODES, each divided by its mean.

    Attributes:
        name: "general", "skin", or a file's name.
        shapes: (N, 35) centres s_i, of mean 1.
        variances: (N, 2) h_i² and 1, of the covariances that all share.
        shared: (2, 35, 35) these covariances, C and F.
        changes: (q, 35) relative changes g of reflectance, one standard deviation each; at least one, of zeros. The
            covariance of the i-th is h_i² C + F + Σ (s_i g)(s_i g)ᵀ.
        log_weights: (N,) ln of the weights, up to a constant.
    """

    name: str
    shapes: Floats = field(repr=False)
    variances: Floats = field(repr=False)
    shared: Floats = field(repr=False)
    changes: Floats = field(repr=False)
    log_weights: Floats = field(repr=False)


PriorLike: TypeAlias = str | PathLike[str] | SurfacePrior
"""What `read_prior` accepts."""


def read_prior(spec: PriorLike) -> SurfacePrior:
    """The prior of a name, or of a file of measured reflectances.

    Args:
        spec: "general" (760 surfaces and 97 skins, each skin counted SKINS_COUNT times), "skin" (the 97 skins,
            widened by `skin_changes`), a CSV, CGATS or CxF file with one reflectance for each surface, or a prior.

    Raises:
        InvalidArgument: an unknown name; a file that cannot be read, does not cover 400 to 700 nm, or holds values
            that are no reflectances.
    """
    if isinstance(spec, SurfacePrior):
        return spec
    if isinstance(spec, str) and spec in PRIORS:
        return _shipped(spec)
    path = local(spec)
    if not path.suffix and not (isinstance(spec, PathLike) or looks_like_file(spec)):
        raise InvalidArgument(
            f"No prior is called {str(spec)!r}.", f"Take {' or '.join(PRIORS)}, or a file of reflectances."
        )
    return prior_of(_from_file(path), path.name)


def prior_of(
    reflectances: Floats, name: str = "own", *, counts: Floats | None = None, changes: Floats | None = None
) -> SurfacePrior:
    """The prior that measured surfaces give.

    s_i = R_i / mean R_i. r_i is the root mean square distance to the NEIGHBOURS nearest, h_i = WIDTH max(r_i,
    NARROWEST median r), C the mean of u uᵀ over all differences u of neighbours, each divided by its root mean
    square, and F is of ROUGHNESS.

    Args:
        reflectances: (N, 35) at SURFACE_NODES.
        name: of the prior.
        counts: (N,) weights; 1 unless given.
        changes: (q, 35) relative changes of reflectance, one standard deviation each; none unless given.

    Raises:
        InvalidArgument: no surface, one that is not finite, or one whose mean is not positive.
    """
    values = np.asarray(reflectances, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != SURFACE_NODES.size or not len(values):
        raise InvalidArgument(
            f"Reflectances have shape {values.shape}; (N, {SURFACE_NODES.size}) is needed.",
            "Give each surface at 380 to 720 nm, every 10 nm.",
        )
    means = values.mean(axis=1, keepdims=True)
    if not (np.isfinite(values).all() and (means > 0).all()):
        raise InvalidArgument("A surface's reflectance is not finite or not positive.", "Leave that surface out.")
    shapes = values / means
    n = len(shapes)
    width, common = _neighbourhood(shapes) if n > 1 else (np.zeros(1), np.zeros((SURFACE_NODES.size,) * 2))
    steps = (SURFACE_NODES[:, None] - SURFACE_NODES) / ROUGHNESS_CORRELATION
    shared = np.stack([common, ROUGHNESS**2 * np.exp(-0.5 * steps**2)])
    return SurfacePrior(
        name, frozen(shapes), frozen(np.stack([width**2, np.ones(n)], axis=1)), frozen(shared),
        frozen(np.zeros((1, SURFACE_NODES.size)) if changes is None else changes),
        frozen(np.zeros(n) if counts is None else np.log(counts)),
    )  # fmt: skip


def _neighbourhood(shapes: Floats) -> tuple[Floats, Floats]:
    """The width h (N,) of each surface, and the covariance C (35, 35) of neighbours' unit differences."""
    squares = np.einsum("ij,ij->i", shapes, shapes)
    distance = np.maximum(squares[:, None] + squares - 2.0 * shapes @ shapes.T, 0.0)
    np.fill_diagonal(distance, np.inf)
    nearest = np.argsort(distance, axis=1, kind="stable")[:, :NEIGHBOURS]
    apart = shapes[nearest] - shapes[:, None]  # (N, k, 35)
    size = np.sqrt(np.mean(apart**2, axis=2))
    radius = np.sqrt(np.mean(size**2, axis=1))
    unit = (apart / np.maximum(size, 1e-9)[:, :, None]).reshape(-1, shapes.shape[1])
    return WIDTH * np.maximum(radius, NARROWEST * np.median(radius)), unit.T @ unit / len(unit)


@cache
def _shipped(name: str) -> SurfacePrior:
    kinds = {
        kind: np.concatenate([surfaces.values for surfaces in surface_sets() if surfaces.kind == kind])
        for kind in PRIORS
    }
    if name == "skin":
        return prior_of(kinds["skin"], name, changes=skin_changes())
    counts = np.concatenate([np.ones(len(kinds["general"])), np.full(len(kinds["skin"]), SKINS_COUNT)])
    return prior_of(np.concatenate([kinds["general"], kinds["skin"]]), name, counts=counts)


def skin_changes() -> Floats:
    """(q, 35) relative changes of a skin's reflectance within one person, one standard deviation each.

    -size a(λ) for the layer above everything, -size a(λ) (1 + c) / (a(λ) + c) for the one that saturates.
    """
    changes = []
    for name, a in absorbers().items():
        above, below = absorber_changes()[name]
        changes += [-above * a, -below * a * (1.0 + SATURATION) / (a + SATURATION)]
    return np.stack([change for change in changes if change.any()])


def _from_file(path: Path) -> Floats:
    """Reflectances (N, 35) of a file; linear between its wavelengths, constant outside."""
    table = read_spectra(path)
    wavelengths, columns = ascending(table.wavelengths, table.values.T)
    check_wavelengths(wavelengths, path, "invalid_argument")
    values = columns.T
    if np.isfinite(values).all() and values.max() > PERCENT:
        values = values / 100.0
    if not (
        np.isfinite(values).all()
        and values.min() >= 0.0
        and values.max() <= LARGEST_REFLECTANCE
        and (values.max(axis=1) > 0).all()
    ):
        raise InvalidArgument(
            f"{path} has a value that is no reflectance.", "Give all as 0 to 1, or all in percent; one row a surface."
        )
    return np.stack([np.interp(SURFACE_NODES, wavelengths, row) for row in values])
