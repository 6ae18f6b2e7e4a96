"""Commands on a whole registry: camssf registry report, verify, optimize, vacuum, delete."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from camssf.cli.registry import AsOf, Folder, Make, Model, Verify, read_registry
from camssf.cli.terminal import emit, say
from camssf.version import __version__


def verify(folder: Folder) -> None:
    """Compare all rows, files and documents with their checksums.

    JSON on stdout. The exit status is 1 if anything is damaged.
    """
    from camssf.cli.terminal import PARTED
    from camssf.fleet.compare import many
    from camssf.fleet.registry import Registry
    from camssf.fleet.verify import verify as verify_registry

    found = verify_registry(Registry(folder))
    emit({"format": "camssf-verification/1", "generator": {"name": "camssf", "version": __version__}} | vars(found))
    for fault in found.faults:
        say("[bold red]damaged[/]: ", fault)
    counted = (
        f"{many(found.rows, 'row')}, {many(found.files, 'file')} and {many(found.documents, 'document')} compared"
    )
    missing = f", {many(found.documents_missing, 'document')} not at hand" if found.documents_missing else ""
    say("", f"{counted}{missing}")
    if found.unsealed:
        say("[yellow]not sealed[/]: ", f"{many(len(found.unsealed), 'file')}, left by a writer that was stopped")
    if found.faults:
        raise typer.Exit(PARTED)


def optimize(folder: Folder) -> None:
    """Merge small files, so that the registry is read faster."""
    from camssf.fleet import upkeep
    from camssf.fleet.compare import many
    from camssf.fleet.registry import Registry

    found = Registry(folder)
    before = len(found.files())
    upkeep.optimize(found)
    say("", f"{many(before, 'file')} before, {len(found.files())} now")


def vacuum(
    folder: Folder,
    days: Annotated[float, typer.Option(min=0.0, help="Keep what versions of so many days need.")] = 7.0,
) -> None:
    """Delete files that no version of the last days needs. Versions before can then not be read any more."""
    from camssf.fleet import upkeep
    from camssf.fleet.compare import many
    from camssf.fleet.registry import Registry

    say("", f"{many(upkeep.vacuum(Registry(folder), days), 'file')} deleted")


def delete(
    folder: Folder,
    serial: Annotated[str, typer.Option(metavar="TEXT", help="Serial number of the unit.")],
    make: Make = "",
    model: Model = "",
) -> None:
    """Delete all results of a unit from the registry and from its older versions.

    Their documents remain where they are. JSON on stdout gives each one's place, relative to the registry.
    """
    from camssf.errors import InvalidArgument
    from camssf.fleet import upkeep
    from camssf.fleet.compare import many
    from camssf.fleet.registry import Registry
    from camssf.photo.read.unit import Unit

    found = Registry(folder)
    deleted = upkeep.delete(found, Unit(make=make, model=model, serial=serial)) if serial else []
    if not deleted:
        raise InvalidArgument(
            f"The registry has no result of a unit with the serial number {serial!r}.",
            "See `camssf registry list` for those that it has.",
        )
    emit({"format": "camssf-deletion/1", "generator": {"name": "camssf", "version": __version__}, "results": deleted})
    say("", f"{many(len(deleted), 'result')} deleted; the documents remain, their places are on stdout")


def report(
    folder: Folder,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="The page, .html.")],
    days: Annotated[
        float, typer.Option(min=0.0, help="A unit is due if its newest accepted result is older than this.")
    ] = 365.0,
    as_of: AsOf = "",
    verify: Verify = False,
) -> None:
    """Write a page on the whole fleet.

    Models, how their units differ, drifts, what is due for calibration, and why results were not accepted.
    """
    from camssf.errors import InvalidArgument
    from camssf.files import write_file
    from camssf.fleet.overview import fleet_page

    if out.suffix != ".html":
        raise InvalidArgument(f"The page {out} does not end in .html.", "Give it this ending.")
    write_file(out, fleet_page(read_registry(folder, as_of, verify), days=days))
    say("", f"page: {out}")


COMMANDS: tuple[tuple[Callable[..., Any], str], ...] = (
    (report, "camssf registry report phones/ -o fleet.html"),
    (verify, "camssf registry verify phones/"),
    (optimize, "camssf registry optimize phones/"),
    (vacuum, "camssf registry vacuum phones/ --days 30"),
    (delete, "camssf registry delete phones/ --serial A1B2"),
)
"""Each command and its example."""
