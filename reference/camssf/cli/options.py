"""Arguments and options that several commands share, and commands that take each once."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer
import typer.core
from typer.models import CommandFunctionType

from camssf.errors import InvalidArgument

PAPER = "Options of the paper's method"
"""Heading of its options in a command's help."""

Photos: TypeAlias = Annotated[
    list[str], typer.Argument(metavar="PHOTO...", help="RAW photo (DNG) of the chart, one for each lamp.")
]
Lamps: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--lamp",
        metavar="SPEC",
        show_default=False,
        help="Light of a photo: daylight, bulb, white-led, fluorescent; a CIE name, 2856K or D:5500, weighed against "
        "its kind; equal-energy or a file, taken as it is (see `camssf lamps`); torch for the phone's own; auto if "
        "nobody knows, as for all photos where none is given. Outdoors: daylight. Repeat it in the order of the "
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
        rich_help_panel=PAPER,
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
        rich_help_panel=PAPER,
    ),
]
L2: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--l2",
        show_default=False,
        help="The quadratic penalty λ₂; unless given, 1, on `gaussian` 0.",
        rich_help_panel=PAPER,
    ),
]
Engine: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="reference (NumPy) or onnx.",
        rich_help_panel=PAPER,
    ),
]
Fit: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="NUMBERS",
        show_default=False,
        help="Patches to fit, as 7-18 or 1,4,7-18; all unless given. The others validate.",
        rich_help_panel=PAPER,
    ),
]
Signed: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--signed", help="Let coefficients be negative: the paper's Eq. (10) as written.", rich_help_panel=PAPER
    ),
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
TrustedKeys: TypeAlias = Annotated[
    list[Path] | None,
    typer.Option(
        "--key", metavar="PEM", show_default=False, help="For a passport: a trusted public key. May be repeated."
    ),
]
Revoked: TypeAlias = Annotated[
    Path | None,
    typer.Option(metavar="JWS", show_default=False, help="Signed list of revoked passports and keys."),
]
Png: TypeAlias = Annotated[bool, typer.Option("--png", help="Draw the curves as ssf.png, too; needs the extra plot.")]


PATHS = re.compile("FOLDER|FILE|JSON|DNG|CSV|PEM|JWS|PHOTO|FRAME|REGISTRY")
"""What the help calls values that are paths."""


class Command(typer.core.TyperCommand):
    """A command that takes no option twice; click would use the last value and drop the others."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Check and parse the arguments.

        Raises:
            InvalidArgument: an option with one value was given several times, or a path is empty.
        """
        values, _, order = self.make_parser(ctx).parse_args(list(args))
        for option, times in Counter(order).items():
            if times > 1 and isinstance(option, typer.core.TyperOption) and not (option.multiple or option.is_flag):
                raise InvalidArgument(
                    f"{max(option.opts, key=len)} was given {times} times; it takes one value.", "Give it once."
                )
            kind, value = option.metavar or "", values[option.name]
            texts = value if isinstance(value, list | tuple) else [value]
            if PATHS.search(kind) and any(isinstance(text, str) and not text.strip() for text in texts):
                named = isinstance(option, typer.core.TyperOption)
                raise InvalidArgument(
                    f"{max(option.opts, key=len) if named else kind.removesuffix('...')} is empty.",
                    "Give the path; a shell variable that is not set is empty, too.",
                )
        return super().parse_args(ctx, args)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the help of the arguments and options, a section for each `rich_help_panel`."""
        sections: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            if (record := param.get_help_record(ctx)) is not None:
                usual = "Arguments" if param.param_type_name == "argument" else "Options"
                sections.setdefault(getattr(param, "rich_help_panel", None) or usual, []).append(record)
        for heading in sorted(sections, key=lambda heading: ("Arguments", "Options").count(heading) == 0):
            with formatter.section(heading):
                formatter.write_dl(sections[heading])


class Group(typer.Typer):
    """A group of such commands."""

    def command(self, *args: Any, **settings: Any) -> Callable[[CommandFunctionType], CommandFunctionType]:
        """As `typer.Typer.command`."""
        return super().command(*args, **{"cls": Command} | settings)
