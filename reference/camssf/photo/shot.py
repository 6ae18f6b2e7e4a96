"""One photo of the chart as the user gives it: its files, its lamp, and how it is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.files import check_local
from camssf.shapes import MOST_SHOTS
from camssf.spectra import Called, Light, LightLike, Unnamed, read_lamp, read_light, with_tolerance
from camssf.spectra.lamps import AUTO, TORCH

SHOTS = 'Give the path of one photo, a Shot, or a list as [Shot("a.dng", "D55"), Shot("b.dng", "A")].'

PathLike: TypeAlias = str | Path


@dataclass(frozen=True)
class Shot:
    """One photo of the chart under one lamp, with its white and dark frames if they exist.

    No file is read before use.

    Attributes:
        photo: RAW file (`camssf.photo.read.raw.read_raw`).
        lamp: its light, as for `read_lamp`: a name, a file, a SpectralDistribution, a pair of arrays, a Lamp; "auto"
            if it is unknown: its kind is then estimated from the signals, for phones only.
        white: RAW file of the white frame, taken with the same settings; all or none of a capture's shots have one.
        dark: RAW file of the dark frame, also with these settings.
        corners: (4, 2) rough outer corners of the block of patches, px; None to search for them.
        lamp_tolerance: uncertainty of the lamp, `2%`, `300K` or both (`with_tolerance`); None for its default.
        lens_shading: "as-stored", or "apply" for the gain maps in the photo's file (`photo.patches`, rule 6).
    """

    photo: PathLike
    lamp: LightLike = AUTO
    white: PathLike | None = None
    dark: PathLike | None = None
    corners: ArrayLike | None = None
    lamp_tolerance: str | None = None
    lens_shading: str = "as-stored"

    def light(self) -> Light:
        """Read the lamp.

        Raises:
            InvalidArgument, LampUnfit: as `read_light` and `with_tolerance`.
        """
        light = read_light(self.lamp)
        if not self.lamp_tolerance:
            return light
        if isinstance(light, Unnamed):
            raise InvalidArgument(
                "A light that is not named has no tolerance.", "Leave the tolerance out, or name the lamp."
            )
        # Who states a tolerance knows the lamp: it is taken as said, not as one of its kind.
        return with_tolerance(read_lamp(light.name) if isinstance(light, Called) else light, self.lamp_tolerance)


Shots: TypeAlias = PathLike | Shot | Sequence[Shot]
"""The path of one photo, one shot, or several."""


def check_shots(shots: Shots, lamp: LightLike | None = None) -> list[Shot]:
    """The shots as a list; `lamp` is that of a path.

    Raises:
        InvalidArgument: no shots, too many, a value that is no shot, a URL, or a white frame for some of them only.
    """
    if isinstance(shots, str | Path):
        shots = Shot(shots, AUTO if lamp is None else lamp)
    elif lamp is not None:
        raise InvalidArgument("A lamp was given in addition to shots.", 'Name it in its shot: Shot("a.dng", "D55").')
    listed = [shots] if isinstance(shots, Shot) else _listed(shots)
    if not listed:
        raise InvalidArgument("There is no photo.", "Give the DNG of at least one photo of the chart.")
    if len(listed) > MOST_SHOTS:
        raise InvalidArgument(f"{len(listed)} photos are too many.", f"Give at most {MOST_SHOTS}.")
    if len({shot.white is None for shot in listed}) > 1:
        raise some_white()
    for path in (path for shot in listed for path in (shot.photo, shot.white, shot.dark) if path is not None):
        if not isinstance(path, str | Path):
            raise InvalidArgument(f"{path!r} is no path of a file.", "Give the RAW file as a str or a Path.")
        check_local(path)
    return listed


def check_torch(shots: Sequence[Shot], lights: Sequence[Light]) -> None:
    """Check that a shot by the torch has a photo with the torch off, which is subtracted, and no white frame.

    Raises:
        InvalidArgument: it has not.
    """
    for number, (shot, light) in enumerate(zip(shots, lights, strict=True), 1):
        if light.name == TORCH and (shot.dark is None or shot.white is not None):
            raise InvalidArgument(
                f"Shot {number}: the torch's light needs a dark frame, the same photo with the torch off, and no "
                "white frame.",
                "Give the photo with the torch off as the dark frame, and leave the white frame out.",
            )


def some_white() -> InvalidArgument:
    """The error of shots of which some have a white frame and some have none."""
    return InvalidArgument(
        "Some shots have a white frame and some have none.", "Give a white frame for all shots, or for none."
    )


def _listed(shots: Sequence[Shot]) -> list[Shot]:
    try:
        listed = list(shots)
    except TypeError as error:
        raise InvalidArgument(f"{shots!r} is no shot.", SHOTS) from error
    for shot in listed:
        if not isinstance(shot, Shot):
            raise InvalidArgument(f"{shot!r} is no Shot.", SHOTS)
    return listed
