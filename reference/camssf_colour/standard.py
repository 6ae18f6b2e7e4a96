"""XYZ and Lab of surfaces from their signals, under a stated observer and white, with a covariance and its parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from camssf.colorimetry import adaptation, lab, lab_slopes, white_of, xyz_of
from camssf.errors import InvalidArgument
from camssf.grid import BAND, Floats
from camssf.messages import fail
from camssf.rules import rules
from camssf.spectra import Lamp, LampLike, Unnamed, read_lamp, read_light
from camssf.spectra.bundled import observer
from camssf.spectra.lights import kind_of
from camssf_colour.camera import Camera, ColourCamera, as_camera
from camssf_colour.light import Light, see
from camssf_colour.posterior import surface_posterior
from camssf_colour.reach import distances
from camssf_colour.response import surface_response
from camssf_colour.spread import Reference, checked_signals, outer
from camssf_colour.surface_prior import read_prior
from camssf_colour.view import View

PARTS = ("curves", "lamp", "noise", "reference", "metamers")
"""Sources of a colour's covariance."""
PRIOR = "general"
"""Prior of the surfaces' reflectance."""
CONTRADICTED = rules().number("colour.contradicted")
SHOWN = 4
"""Most colours that a Colours prints of itself."""


@dataclass(frozen=True, repr=False)
class Colours:
    """m standard colours. Y of a perfect white diffuser is 1.

    Attributes:
        xyz, lab: (m, 3).
        xyz_covariance, lab_covariance: (m, 3, 3).
        parts: the terms of these covariances by name (PARTS): (m, 3, 3) of XYZ and of Lab.
        white: (3,) XYZ of the white that Lab is relative to, and that XYZ is adapted to if the view asks for it.
        view: how they are stated.
        lamps: names of the lamps that were compared, and their weights.
        distances: a function for each light that computes how far the signals are from those of any surface.
        chi_squared: χ² of the reference's ratios under the likeliest lamp; None if they were not used.
    """

    xyz: Floats
    lab: Floats
    xyz_covariance: Floats
    lab_covariance: Floats
    parts: dict[str, tuple[Floats, Floats]]
    white: Floats
    view: View
    lamps: tuple[tuple[str, float], ...]
    distances: tuple[Callable[[], Floats], ...]
    chi_squared: float | None

    @cached_property
    def reach(self) -> Floats:
        """(m,) distance of the signals from those that any surface can give, in standard deviations."""
        return np.asarray(np.min([distance() for distance in self.distances], axis=0))

    def __repr__(self) -> str:
        """The view, and Lab of the first colours with half the width of their 95 % intervals."""
        half = BAND * np.sqrt(np.diagonal(self.lab_covariance, axis1=1, axis2=2))
        shown = [
            ", ".join(f"{name} {v:.1f} ± {s:.1f}" for name, v, s in zip(("L*", "a*", "b*"), lab, band, strict=True))
            for lab, band in zip(self.lab[:SHOWN], half, strict=False)
        ]
        more = [f"{len(self.lab) - SHOWN} more"] if len(self.lab) > SHOWN else []
        lamps = " or ".join(name for name, _ in self.lamps)
        view = f"CIE {self.view.observer}, white {self.view.white}"
        return f"<Colours under {lamps}, {view}: {'; '.join([*shown, *more])}>"


def standard_colour(
    camera: ColourCamera,
    lamp: LampLike,
    signals: ArrayLike,
    standard_error: ArrayLike = 0.0,
    *,
    reference: Reference | None = None,
    view: View | None = None,
) -> Colours:
    """Compute colours of surfaces from their signals: their posterior given the prior "general" of reflectance.

    Args:
        camera: a result, the excerpt of one, or a Camera.
        lamp: as for `read_light`; "auto" mixes the four kinds by their likelihood given the reference's raw ratios.
        signals: (m, 3) or (3,), in units of a perfect white diffuser in the same place: raw signal of the surface
            over that of a white or grey reference, times the reference's reflectance.
        standard_error: of the signals.
        reference: the white or grey surface that the raw signals were divided by.
        view: how to state the colours.

    Raises:
        InvalidArgument: invalid values; "auto" without a reference, or a camera without its own white; curves from
            which no colour can be computed.
        LampUnfit: the reference's raw ratios contradict the lamp.
    """
    given, view = reference or Reference(), view or View()
    y, error = checked_signals(signals, standard_error)
    try:
        with np.errstate(all="ignore"):  # the results are checked below
            colour = _answer(lights(as_camera(camera), lamp, given), y, error, given, view)
    except np.linalg.LinAlgError as fault:
        raise no_colour() from fault
    if not all(np.isfinite(values).all() for values in (colour.lab, colour.xyz_covariance, colour.lab_covariance)):
        raise no_colour()
    return colour


def no_colour() -> InvalidArgument:
    """The error if a lamp and curves give no colour."""
    return InvalidArgument(
        "These curves are too uncertain to compute colour under this lamp.",
        "Check the curves and the lamp; calibrate with better photos.",
    )


def _answer(lights: Sequence[Light], y: Floats, error: Floats, given: Reference, view: View) -> Colours:
    """The answers under each light, mixed by their marginal likelihood."""
    return _mixed([_colours(light, y, error, given, view) for light in lights], evidence_weights(lights))


def evidence_weights(lights: Sequence[Light]) -> Floats:
    """Weights of lights by their marginal likelihood; they add up to 1."""
    evidence = np.array([light.log_evidence for light in lights])
    weights = np.exp(evidence - evidence.max())
    return np.asarray(weights / weights.sum())


def lights(camera: Camera, lamp: LampLike, given: Reference) -> list[Light]:
    """The lamp, or for "auto" the four kinds, conditioned on the reference's raw ratios if these are usable."""
    ratios = ratios_of(camera, given)
    seen = [see(camera, source, ratios, ratio_error(given)) for source in lamps_of(lamp, ratios)]
    if len(seen) == 1:
        check_light(seen[0])
    return seen


def lamps_of(lamp: LampLike, ratios: Floats | None) -> list[Lamp]:
    """The lamp, or the kinds of an unnamed light: four for "auto", the white LED for "torch".

    Raises:
        InvalidArgument: "auto" without ratios of a reference.
    """
    light = read_light(lamp)
    if not isinstance(light, Unnamed):
        return [light if isinstance(light, Lamp) else read_lamp(light.name)]
    kinds = list(dict.fromkeys(filter(None, (kind_of(possible.name) for possible in light.lamps))))
    if len(kinds) > 1 and ratios is None:
        raise InvalidArgument(
            "The lamp is unknown, and nothing in the photo tells it.",
            "Name the lamp; or measure a white or grey reference in the photo, and take a result that holds the "
            "light of its first photo: the whole result.json, not a passport, and not of an older version.",
        )
    return [read_lamp(kind) for kind in kinds]


def ratios_of(camera: Camera, given: Reference) -> Floats | None:
    """ln of the reference's raw red and blue over its green, (2,); None if they or the camera's own are not known.

    Raises:
        InvalidArgument: raw signals that are not three positive numbers.
    """
    if given.raw is None or camera.own is None:
        return None
    raw = np.asarray(given.raw, dtype=np.float64)
    if raw.shape != (3,) or not (np.isfinite(raw).all() and (raw > 0).all()):
        raise InvalidArgument("The reference's raw signals are not three positive numbers.", "Take a lit white.")
    return np.asarray(np.log(raw[[0, 2]] / raw[1]))


def ratio_error(given: Reference) -> float:
    """One standard deviation of these ratios."""
    return float(np.hypot(given.error, given.tolerance / 2.0))


def check_light(light: Light) -> None:
    """Check that the reference's raw ratios agree with the lamp.

    Raises:
        LampUnfit: they contradict it.
    """
    if light.chi_squared is not None and light.chi_squared > CONTRADICTED:
        raise fail(
            "lamp_unfit.reference",
            value=light.chi_squared,
            threshold=CONTRADICTED,
            lamp=light.name,
            misfit=light.chi_squared,
        )


def _colours(light: Light, y: Floats, error: Floats, given: Reference, view: View) -> Colours:
    """The colours under one lamp."""
    response, white = surface_response([light], [given], view, reflectance=False)
    posterior = surface_posterior(read_prior(PRIOR), response, y, error)
    relative, ones = posterior.mean[:, 3:], np.ones(3)
    slopes = lab_slopes(relative, ones)

    def stated(covariance: Floats) -> tuple[Floats, Floats]:
        """Covariances of XYZ, and of Lab by that of XYZ over its white, whose errors are those of the lamp, too."""
        return covariance[:, :3, :3], slopes @ covariance[:, 3:, 3:] @ np.swapaxes(slopes, 1, 2)

    total = stated(posterior.covariance)
    return Colours(
        posterior.mean[:, :3], lab(relative, ones), total[0], total[1],
        {name: stated(posterior.parts[name]) for name in PARTS}, white, view, ((light.name, 1.0),),
        (partial(distances, y, posterior.signal_covariance, light),), light.chi_squared,
    )  # fmt: skip


def _mixed(answers: Sequence[Colours], weights: Floats) -> Colours:
    """Mix the answers by the law of total variance; their differences count as lamp error."""
    if len(answers) == 1:
        return answers[0]

    def mean(values: Sequence[Floats]) -> Floats:
        return np.asarray(np.tensordot(weights, np.stack(values), axes=1))

    xyz, colours = mean([a.xyz for a in answers]), mean([a.lab for a in answers])
    between = tuple(
        mean([outer((getattr(a, name) - middle)[None]) for a in answers])
        for name, middle in (("xyz", xyz), ("lab", colours))
    )
    parts = {
        name: (mean([a.parts[name][0] for a in answers]), mean([a.parts[name][1] for a in answers])) for name in PARTS
    }
    parts["lamp"] = (parts["lamp"][0] + between[0], parts["lamp"][1] + between[1])
    best = answers[int(weights.argmax())]
    return replace(
        best, xyz=xyz, lab=colours, parts=parts,
        xyz_covariance=np.sum([part[0] for part in parts.values()], axis=0),
        lab_covariance=np.sum([part[1] for part in parts.values()], axis=0),
        white=mean([a.white for a in answers]),
        lamps=tuple((a.lamps[0][0], float(w)) for a, w in zip(answers, weights, strict=True)),
        distances=tuple(distance for a in answers for distance in a.distances),
    )  # fmt: skip


def of_surfaces(reflectance: Floats, lamp: Floats, view: View) -> tuple[Floats, Floats]:
    """True XYZ and Lab (m, 3) of known reflectances (m, 681) under a lamp (681,), as the view states them."""
    xyz, own = xyz_of(reflectance, lamp, observer(view.observer)), white_of(lamp, view.observer)
    if view.white == "lamp":
        return xyz, lab(xyz, own)
    aim = white_of(read_lamp(view.white).values, view.observer)
    turned = xyz @ adaptation(own, aim).T
    return turned, lab(turned, aim)
