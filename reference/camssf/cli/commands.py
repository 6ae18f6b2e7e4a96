"""The command line: lists the commands in the order of the help, and maps errors to exit statuses."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Annotated, Any, TypeAlias

import typer

from camssf.cli.options import Group
from camssf.cli.others import cameras, charts, explain, export, lamps, parity
from camssf.cli.steps import calibrate, patches, report, solve, validate
from camssf.cli.terminal import BUG, INTERRUPTED, discard_stdout, put, say, trace
from camssf.errors import CalibrationError, InvalidArgument
from camssf.libraries import COMMANDS as CONTRIBUTED
from camssf.libraries import extensions
from camssf.version import __version__

Command: TypeAlias = Callable[..., Any] | Group

COMMANDS: tuple[tuple[Command, str], ...] = (
    (calibrate, "camssf calibrate photo.dng --lamp daylight --white white.dng --dark dark.dng -o out/"),
    (patches, "camssf patches photo.dng --lamp daylight > patches.json"),
    (solve, "camssf patches photo.dng --lamp daylight | camssf solve - > result.json"),
    (validate, "camssf validate result.json --truth truth.csv > scored.json"),
    (report, "camssf report result.json -o out/ --photo photo.dng"),
    (export, "camssf export out/result.json --to rawtoaces -o camera.json"),
    (parity, "camssf parity phone.json photo.dng --white white.dng"),
    (explain, "camssf explain uneven_light"),
    (lamps, "camssf lamps | grep LED"),
    (charts, "camssf charts"),
    (cameras, "camssf cameras"),
)
"""Each command of this package with an example for its help."""

ORDER = (
    "demo", "calibrate", "batch", "simulate", "patches", "solve", "validate", "report", "export", "colour",
    "spectrum", "app", "direct", "parity", "explain", "lamps", "charts", "cameras", "passport", "registry",
)  # fmt: skip
"""Names of the commands in the order of the help; others come last."""

app = Group(
    name="camssf",
    help="Camera spectral sensitivities, with error bands, from RAW photos of a ColorChecker.",
    epilog="Example: camssf demo -o out/",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status; catches all exceptions."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in arguments
    if "_CAMSSF_COMPLETE" in os.environ:  # a shell asks for its completion
        typer.completion.get_completion_inspect_parameters()  # registers the shells
    try:
        typer.main.get_command(app).main([a for a in arguments if a != "--debug"], prog_name="camssf")
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
) -> None:
    # `main` removes --debug from the arguments; it is declared here for --help only.
    del version, debug


def _rank(command: Command) -> int:
    name = command.info.name if isinstance(command, Group) else command.__name__
    return ORDER.index(name) if name in ORDER else len(ORDER)


for _command, _example in sorted(
    (*COMMANDS, *chain(*extensions(CONTRIBUTED).values())), key=lambda row: _rank(row[0])
):
    if isinstance(_command, Group):
        app.add_typer(_command)
    else:
        app.command(epilog=f"Example: {_example}")(_command)
