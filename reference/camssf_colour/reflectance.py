"""Reflectance, XYZ and Lab of surfaces from their signals under one or two lights, with their covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camssf.colorimetry import lab, lab_slopes
from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.rules import rules
from camssf.spectra import LampLike, colour_science
from camssf.spectra.bundled import SURFACE_NODES
from camssf_colour.camera import Camera, ColourCamera, as_camera
from camssf_colour.light import Light, see, see_together
from camssf_colour.posterior import SurfacePosterior, surface_posterior
from camssf_colour.response import NODES, surface_response
from camssf_colour.spread import Reference, checked_signals
from camssf_colour.standard import check_light, lamps_of, ratio_error, ratios_of
from camssf_colour.surface_prior import PriorLike, read_prior
from camssf_colour.view import View

FAR = rules().number("surfaces.far")


@dataclass(frozen=True)
class LitSurfaces:
    """Signals of m surfaces in one photo.

    Attributes:
        lamp: as for `read_light`; "auto" mixes the four kinds by their likelihood given the reference's raw ratios.
        signals: (m, 3) or (3,), in units of a perfect white diffuser in the same place.
        standard_error: of the signals.
        reference: the white or grey surface that the raw signals were divided by. Its tolerance is that of the light
            between the two places, too.
    """

    lamp: LampLike
    signals: ArrayLike
    standard_error: ArrayLike = 0.0
    reference: Reference = field(default_factory=Reference)


@dataclass(frozen=True)
class SurfaceSpectra:
    """Reflectances of m surfaces at SURFACE_NODES (380 to 720 nm, every 10 nm), and their colours.

    Attributes:
        reflectance: (m, 35).
        covariance: (m, 35, 35).
        parts: its terms by source (`camssf_colour.PARTS`), (m, 35, 35) each; "metamers" are the surfaces of the
            prior that give equal signals.
        xyz, lab: (m, 3); Y of a perfect white diffuser is 1.
        xyz_covariance, lab_covariance: (m, 3, 3).
        white: (3,) XYZ of the white that Lab is relative to.
        view: how the colours are stated.
        prior: name of the prior.
        distance: (m,) of the signals from the nearest surface of the prior, in standard deviations.
        from_photo: (m,) share of the prior's variance of reflectance, 400 to 700 nm, that the signals removed; the
            rest of what the spectrum says is the prior.
        lamps: names of the lamps, one for each photo, and the weight of each combination.
        chi_squared: χ² of the references' ratios under the likeliest lamps; None if they were not used.
    """

    reflectance: Floats
    covariance: Floats
    parts: dict[str, Floats]
    xyz: Floats
    lab: Floats
    xyz_covariance: Floats
    lab_covariance: Floats
    white: Floats
    view: View
    prior: str
    distance: Floats
    from_photo: Floats
    lamps: tuple[tuple[tuple[str, ...], float], ...]
    chi_squared: float | None

    @property
    def standard_deviation(self) -> Floats:
        """Of the reflectance, (m, 35)."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, axis1=1, axis2=2), 0.0))

    def to_colour(self) -> Any:
        """The reflectances as colour-science's MultiSpectralDistributions, one label for each surface.

        Raises:
            InvalidArgument: colour-science is not installed.
        """
        labels = [f"surface {i}" for i in range(1, len(self.reflectance) + 1)]
        return colour_science().MultiSpectralDistributions(self.reflectance.T, SURFACE_NODES, labels=labels)


def spectrum(
    camera: ColourCamera,
    *photos: LitSurfaces,
    prior: PriorLike = "general",
    view: View | None = None,
) -> SurfaceSpectra:
    """Reflectances of surfaces from their signals in one or two photos.

    Args:
        camera: a result, the excerpt of one, or a Camera.
        photos: one, or two of the same surfaces under different lights. XYZ and Lab are under the first light. The
            reference is assumed to be the same object in both.
        prior: "general", "skin", a file of reflectances, or a SurfacePrior (`camssf_colour.read_prior`).
        view: how to state XYZ and Lab.

    Raises:
        InvalidArgument: invalid values; no photo or more than two; "auto" without a reference, or a camera without
            its own white; an unknown prior.
        LampUnfit: a reference's raw ratios contradict its lamp.
    """
    if len(photos) not in (1, 2):
        raise InvalidArgument(
            f"A spectrum needs one or two photos; got {len(photos)}.", "Give one LitSurfaces a photo."
        )
    view, known, surfaces = view or View(), as_camera(camera), read_prior(prior)
    pairs = [checked_signals(photo.signals, photo.standard_error) for photo in photos]
    if len({len(y) for y, _ in pairs}) != 1:
        raise InvalidArgument("The photos hold different numbers of surfaces.", "Measure the same regions in both.")
    y, error = (np.concatenate([pair[i] for pair in pairs], axis=1) for i in (0, 1))
    references, spectra, evidence = [photo.reference for photo in photos], [], []
    try:
        with np.errstate(all="ignore"):  # the results are checked below
            for lights in _lights(known, photos):
                response, white = surface_response(lights, references, view, reflectance=True)
                given = surface_posterior(surfaces, response, y, error)
                spectra.append(_stated(given, white, surfaces.name, view, lights))
                evidence.append(lights[0].log_evidence)
    except np.linalg.LinAlgError as fault:
        raise _no_spectrum() from fault
    weights = np.exp(np.array(evidence) - max(evidence))
    answer = _mixed(spectra, weights / weights.sum())
    checked = (answer.reflectance, answer.covariance, answer.lab, answer.lab_covariance, answer.distance)
    if not all(np.isfinite(values).all() for values in checked):
        raise _no_spectrum()
    return answer


def _no_spectrum() -> InvalidArgument:
    return InvalidArgument(
        "These curves are too uncertain to compute a spectrum under this lamp.",
        "Check the curves and the lamp; calibrate with better photos.",
    )


def _lights(camera: Camera, photos: Sequence[LitSurfaces]) -> list[list[Light]]:
    """For each combination of lamps, one light for each photo, with curves that are the same in both.

    Raises:
        InvalidArgument, LampUnfit: as `spectrum`.
    """
    ratios = [ratios_of(camera, photo.reference) for photo in photos]
    errors = [ratio_error(photo.reference) for photo in photos]
    choices = [lamps_of(photo.lamp, ratio) for photo, ratio in zip(photos, ratios, strict=True)]
    for lamps, ratio, error in zip(choices, ratios, errors, strict=True):
        if len(lamps) == 1:
            check_light(see(camera, lamps[0], ratio, error))
    return [see_together(camera, combined, ratios, errors) for combined in product(*choices)]


def _stated(
    posterior: SurfacePosterior, white: Floats, prior: str, view: View, lights: Sequence[Light]
) -> SurfaceSpectra:
    """The outputs by name; Lab and its covariance from XYZ over its white, whose errors are those of a lamp, too."""
    xyz, relative = posterior.mean[:, NODES : NODES + 3], posterior.mean[:, NODES + 3 :]
    ones = np.ones(3)
    slopes = lab_slopes(relative, ones)
    inside = (SURFACE_NODES >= 400.0) & (SURFACE_NODES <= 700.0)
    variance = np.diagonal(posterior.covariance, axis1=1, axis2=2)[:, :NODES][:, inside].sum(axis=1)
    before = posterior.prior_variance[:, :NODES][:, inside].sum(axis=1)
    return SurfaceSpectra(
        reflectance=posterior.mean[:, :NODES],
        covariance=posterior.covariance[:, :NODES, :NODES],
        parts={name: part[:, :NODES, :NODES] for name, part in posterior.parts.items()},
        xyz=xyz,
        lab=lab(relative, ones),
        xyz_covariance=posterior.covariance[:, NODES : NODES + 3, NODES : NODES + 3],
        lab_covariance=slopes @ posterior.covariance[:, NODES + 3 :, NODES + 3 :] @ np.swapaxes(slopes, 1, 2),
        white=white,
        view=view,
        prior=prior,
        distance=posterior.distance,
        from_photo=1.0 - variance / before,
        lamps=((tuple(light.name for light in lights), 1.0),),
        chi_squared=lights[0].chi_squared,
    )


def _mixed(answers: Sequence[SurfaceSpectra], weights: Floats) -> SurfaceSpectra:
    """Mix the answers by the law of total variance; their differences count as lamp error."""
    if len(answers) == 1:
        return answers[0]

    def mean(values: Sequence[Floats]) -> Floats:
        return np.asarray(np.tensordot(weights, np.stack(values), axes=1))

    def between(name: str) -> tuple[Floats, Floats]:
        values = [getattr(answer, name) for answer in answers]
        middle = mean(values)
        return middle, mean([(value - middle)[:, :, None] * (value - middle)[:, None] for value in values])

    (reflectance, apart), (xyz, of_xyz), (colour, of_lab) = (between(name) for name in ("reflectance", "xyz", "lab"))
    parts = {name: mean([answer.parts[name] for answer in answers]) for name in answers[0].parts}
    parts["lamp"] = parts["lamp"] + apart
    best = answers[int(weights.argmax())]
    return SurfaceSpectra(
        reflectance=reflectance,
        covariance=mean([answer.covariance for answer in answers]) + apart,
        parts=parts,
        xyz=xyz,
        lab=colour,
        xyz_covariance=mean([answer.xyz_covariance for answer in answers]) + of_xyz,
        lab_covariance=mean([answer.lab_covariance for answer in answers]) + of_lab,
        white=mean([answer.white for answer in answers]),
        view=best.view,
        prior=best.prior,
        distance=np.min([answer.distance for answer in answers], axis=0),
        from_photo=mean([answer.from_photo for answer in answers]),
        lamps=tuple((answer.lamps[0][0], float(weight)) for answer, weight in zip(answers, weights, strict=True)),
        chi_squared=best.chi_squared,
    )
