"""The command that measures curves with a spectrograph or a monochromator."""

from __future__ import annotations

from typing import Annotated

import typer

from camssf.cli.options import Out
from camssf.cli.reading import given_frames, given_paths
from camssf.cli.terminal import emit, progress_bar, say
from camssf.errors import InvalidArgument
from camssf.files import local_folder


def direct(
    frames: Annotated[
        list[str],
        typer.Argument(
            metavar="FRAME...",
            help="Sunlight's spectrum by the colour camera (DNG, or CSV pixel,red,green,blue) and by the mono camera "
            "(TIFF, DNG, or CSV pixel,signal); or one monochromator sweep (CSV wavelength_nm,red,green,blue,power).",
        ),
    ],
    dark: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE",
            show_default=False,
            help="A frame with the slit closed: the colour camera's, then the mono camera's. `none` for one without.",
        ),
    ] = None,
    response: Annotated[
        str | None,
        typer.Option(
            metavar="CSV",
            show_default=False,
            help="The mono camera's response, wavelength_nm,response; flat unless given.",
        ),
    ] = None,
    out: Out = None,
) -> None:
    """Measure the curves with a spectrograph or a monochromator.

    The frames' wavelengths come from the Fraunhofer lines in them.
    """
    with progress_bar() as progress:
        from camssf_lab.direct import divide, sweep

        paths = given_paths(frames)
        if out is not None:
            local_folder(out)
        darks = given_frames(dark)
        if len(paths) > 2 or (len(paths) == 1 and (darks or response)):
            raise InvalidArgument(
                f"{len(paths)} file(s) do not fit this call.",
                "Give the colour and the mono camera's frame, or a sweep alone: a sweep takes no dark frame or "
                "response.",
            )
        if len(darks) > 2:
            raise InvalidArgument(f"{len(darks)} dark frames for 2 cameras.", "Give one a camera.")
        if len(paths) == 2:
            rgb_dark, mono_dark = (*darks, None, None)[:2]
            curves = divide(*paths, dark=rgb_dark, mono_dark=mono_dark, response=response, progress=progress)
        else:
            curves = sweep(paths[0])
        if out is None:
            emit(curves.document())
        else:
            curves.save(out)
    for role, dispersion in curves.dispersions.items():
        names = " ".join(line.name for line in dispersion.lines)
        say("", f"{role}: {len(dispersion.lines)} lines ({names}), residual {dispersion.residual:.2f} nm")
    if out is not None:
        say("", f"curves: {out / 'ssf.csv'}")
