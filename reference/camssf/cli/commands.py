"""The command line: lists the commands in the order of the help, and maps errors to exit statuses."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from camssf.cli.captures import batch, calibrate, simulate
from camssf.cli.colour import colour
from camssf.cli.demo import demo
from camssf.cli.exports import export
from camssf.cli.groups import Group
from camssf.cli.others import cameras, charts, direct, explain, lamps, parity
from camssf.cli.page import app as page
from camssf.cli.passport import passport
from camssf.cli.registry import registry
from camssf.cli.spectrum import spectrum
from camssf.cli.steps import patches, report, solve, validate
from camssf.cli.terminal import BUG, INTERRUPTED, demand_json, discard_stdout, put, say, trace
from camssf.cli.upkeep import COMMANDS as UPKEEP
from camssf.errors import CalibrationError, InvalidArgument
from camssf.version import __version__

COMMANDS = (
    (demo, "camssf demo -o out/"),
    (calibrate, "camssf calibrate photo.dng --lamp D55 --white white.dng --dark dark.dng -o out/"),
    (batch, "camssf batch manifest.csv -o out/ --jobs 2"),
    (simulate, "camssf simulate --lamp D55 --size 1800x1350 -o shots/"),
    (patches, "camssf patches photo.dng --lamp D55 > patches.json"),
    (solve, "camssf patches photo.dng --lamp D55 | camssf solve - > result.json"),
    (validate, "camssf validate result.json --truth truth.csv > scored.json"),
    (report, "camssf report result.json -o out/ --photo photo.dng"),
    (export, "camssf export out/result.json --to rawtoaces -o camera.json"),
    (
        colour,
        "camssf colour out/result.json photo.dng --lamp daylight --region 640,480,40,40 --white-region 700,480,40,40",
    ),
    (
        spectrum,
        "camssf spectrum out/result.json photo.dng --lamp daylight --region 640,480,40,40 "
        "--white-region 700,480,40,40 --prior skin",
    ),
    (page, "camssf app"),
    (direct, "camssf direct rgb.dng mono.tif --dark dark.dng --response mono.csv -o out/"),
    (parity, "camssf parity phone.json photo.dng --white white.dng"),
    (explain, "camssf explain uneven_light"),
    (lamps, "camssf lamps | grep LED"),
    (charts, "camssf charts"),
    (cameras, "camssf cameras"),
)
"""Each command with an example for its help."""

app = Group(
    name="camssf",
    help="Camera spectral sensitivities, with error bands, from RAW photos of a ColorChecker.",
    epilog="Example: camssf demo -o out/",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status; catches all exceptions."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in arguments
    demand_json("--json" in arguments)
    try:
        typer.main.get_command(app).main([a for a in arguments if a not in ("--debug", "--json")], prog_name="camssf")
    except SystemExit as stop:
        status = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
        if status == INTERRUPTED:
            say("", "stopped")
        return status
    except KeyboardInterrupt:
        return INTERRUPTED
    except CalibrationError as error:
        trace(debug)
        say(f"[bold red]{error.code}[/]: ", error.message)
        say("", f"  {error.advice}")
        return error.exit_status
    except Exception as error:
        trace(debug)
        if isinstance(error, OSError) and error.errno == errno.ENOSPC:  # from click's own printing, as --help
            discard_stdout()
            say(f"[bold red]{InvalidArgument.code}[/]: ", f"{os.strerror(errno.ENOSPC)}.")
            say("", "  Free some space, or write elsewhere.")
            return InvalidArgument.exit_status
        say("[bold red]bug[/]: ", f"{type(error).__name__}: {' '.join(str(error).split())}")
        say("", "  This is camssf's fault. Run it again with --debug and report what it prints.")
        return BUG
    return 0


def _version(wanted: bool) -> None:
    if wanted:
        put(f"camssf {__version__}")
        raise typer.Exit


@app.callback()
def _camssf(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_version, help="Print the version and exit.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Print the traceback of an error.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON on a terminal too.")] = False,
) -> None:
    # `main` removes --debug and --json from the arguments; they are declared here for --help only.
    del version, debug, json


for _command, _example in COMMANDS:
    app.command(epilog=f"Example: {_example}")(_command)
app.add_typer(passport)
for _upkeep, _example in UPKEEP:
    registry.command(epilog=f"Example: {_example}")(_upkeep)
app.add_typer(registry)
