"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

Photos: TypeAlias = Annotated[
    list[str], typer.Argument(metavar="PHOTO...", help="RAW photo (DNG) of the chart, one for each lamp.")
]
Lamps: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--lamp",
        metavar="SPEC",
        show_default=False,
        help="Light of a photo: a CIE name, 2856K, D:5500, equal-energy or a file (see `camssf lamps`); torch for "
        "the phone's own; auto if nobody knows, as for all photos where none is given. Repeat it in the order of the "
        "photos, as --white, --dark and --corners.",
    ),
]
Whites: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--white",
        metavar="DNG",
        show_default=False,
        help="White frame: same place, same exposure. `none` for a photo without.",
    ),
]
Darks: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--dark",
        metavar="DNG",
        show_default=False,
        help="Dark frame: lens cap on, same exposure. `none` for a photo without.",
    ),
]
Chart: TypeAlias = Annotated[
    str, typer.Option(metavar="NAME|FILE", help="The chart, or a table of its reflectances.")
]
Corners: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        metavar="'X,Y X,Y X,Y X,Y'",
        show_default=False,
        help="Outer corners of the patches by hand, px: the chart's top left, top right, bottom right, "
        "bottom left. `none` for a photo whose chart is to be searched.",
    ),
]
WhiteReflectance: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="SHARE",
        show_default=False,
        help="Reflectance of the white frame's target, 0 to 1; 1 unless given.",
    ),
]
LampTolerances: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        metavar="2%|300K",
        show_default=False,
        help="How well the lamp is known, one standard deviation: 2%, 300K, or 300K,2%. In the photos' order.",
    ),
]
ChartTolerance: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="1%",
        show_default=False,
        help="How well the table fits this chart, one standard deviation. Unless given: 3% for a named table, 1% for "
        "a file, which is taken for a measurement of this chart.",
    ),
]
LensShading: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="WORD",
        help="How to use a lens-shading map in the photo's file: as-stored (ignore it) or apply. Not needed "
        "with a white frame.",
    ),
]
LightPerPatch: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="8%",
        show_default=False,
        help="Relative variation of the light between patches, if each patch was photographed separately.",
    ),
]
BasisName: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="auto (chosen by the signals), phones, cameras, ryyb (phones with yellow in green's place), "
        "gaussian (the paper's), or a file.",
    ),
]
Gamma: TypeAlias = Annotated[
    float | None,
    typer.Option(
        show_default=False,
        help="The l1 penalty γ; unless given, 0.05, on `gaussian` chosen from the measured noise.",
    ),
]
L2: TypeAlias = Annotated[
    float | None,
    typer.Option("--l2", show_default=False, help="The quadratic penalty λ₂; unless given, 1, on `gaussian` 0."),
]
Engine: TypeAlias = Annotated[str, typer.Option(metavar="NAME", help="reference (NumPy) or onnx.")]
Fit: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="NUMBERS",
        show_default=False,
        help="Patches to fit, as 7-18 or 1,4,7-18; all unless given. The others validate.",
    ),
]
Signed: TypeAlias = Annotated[
    bool, typer.Option("--signed", help="Let coefficients be negative: the paper's Eq. (10) as written.")
]
Previous: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="JSON",
        show_default=False,
        help="An accepted result of this unit, same chart, named lamp: checked for a drift, and used "
        "with the new photos.",
    ),
]
Truth: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="CSV|NAME", show_default=False, help="Measured curves of this camera to compare with."),
]
Out: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--out",
        metavar="FOLDER",
        show_default=False,
        help="Where the report goes; without, JSON on stdout.",
    ),
]
OutFolder: TypeAlias = Annotated[Path, typer.Option("-o", "--out", metavar="FOLDER", help="Where the files go.")]
Document: TypeAlias = Annotated[str, typer.Argument(metavar="JSON", help="A file, or - for stdin.")]
CameraId: TypeAlias = Annotated[
    str, typer.Option(metavar="TEXT", show_default=False, help="Camera id, for a phone with several cameras.")
]
Lens: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="The lens.")]
Captured: TypeAlias = Annotated[
    str, typer.Option(metavar="TIME", show_default=False, help="When the photo was taken, ISO 8601.")
]
Regions: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(metavar="X,Y,W,H", show_default=False, help="Region to measure, px; may be repeated."),
]
WhiteRegion: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="X,Y,W,H", show_default=False, help="A white or grey surface in the same light, px."),
]
RegionReflectance: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="SHARE", show_default=False, help="Reflectance of that surface; 1 unless given."),
]
RegionLamp: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="SPEC",
        show_default=False,
        help="The light (see `camssf lamps`), or auto: estimated from the white region. "
        "The lamp of the result's first shot unless given.",
    ),
]
RegionDark: TypeAlias = Annotated[
    str | None, typer.Option(metavar="DNG", show_default=False, help="Dark frame: lens cap on, same exposure.")
]
Observer: TypeAlias = Annotated[str, typer.Option(metavar="YEAR", help="1931 (2°) or 1964 (10°).")]
Adapt: TypeAlias = Annotated[str, typer.Option(metavar="WHITE", help="lamp, or adapted by CAT16 to D50 or D65.")]
