"""Commands on a whole registry: camssf registry report, verify, optimize, vacuum, delete."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from camssf.cli.terminal import emit, say
from camssf_fleet.cli.registry import Folder, Model


def verify(folder: Folder) -> None:
    """Compare rows, tasks, files and the archive with each other and with their checksums.

    JSON on stdout. The exit status is 1 if anything is damaged or missing, and it is named. Run it while nobody
    writes to the registry: a batch that runs, or was stopped, has results without a row.
    """
    from camssf.cli.terminal import PARTED
    from camssf.documents.forms import to_plain
    from camssf_fleet.compare import many
    from camssf_fleet.documents import GENERATOR, VerificationDocument
    from camssf_fleet.registry import Registry
    from camssf_fleet.verification import verify as verify_registry

    found = verify_registry(Registry(folder))
    emit(to_plain(VerificationDocument(format="camssf-verification/1", generator=GENERATOR, **vars(found))))
    for fault in found.faults:
        say("[bold red]damaged[/]: ", fault)
    counted = (
        f"{many(found.rows, 'row')}, {many(found.files, 'file')} and {many(found.documents, 'document')} compared"
    )
    missing = f", {many(found.documents_missing, 'document')} not at hand" if found.documents_missing else ""
    say("", f"{counted}{missing}")
    if found.faults:
        say("", f"{many(len(found.faults), 'fault')}. {found.advice}")
        raise typer.Exit(PARTED)


def optimize(folder: Folder) -> None:
    """Merge small files, so that the registry is read faster."""
    from camssf_fleet import upkeep
    from camssf_fleet.compare import many
    from camssf_fleet.registry import Registry

    found = Registry(folder)
    before = len(found.files())
    upkeep.seal_commits(found)
    upkeep.optimize(found)
    say("", f"{many(before, 'file')} before, {len(found.files())} now")


def vacuum(
    folder: Folder,
    days: Annotated[float, typer.Option(min=0.0, help="Keep what versions of so many days need.")] = 7.0,
) -> None:
    """Delete files that no version of the last days needs. Versions before can then not be read any more."""
    from camssf_fleet import upkeep
    from camssf_fleet.compare import many
    from camssf_fleet.registry import Registry

    say("", f"{many(upkeep.vacuum(Registry(folder), days), 'file')} deleted")


def delete(
    folder: Folder,
    serial: Annotated[str, typer.Option(metavar="TEXT", help="Serial number of the unit.")],
    model: Model = "",
) -> None:
    """Delete all results of a unit from the registry and from its older versions.

    Their documents remain where they are. JSON on stdout gives each one's place, relative to the registry.
    """
    from camssf.documents.forms import to_plain
    from camssf.errors import InvalidArgument
    from camssf.photo.read.unit import Unit
    from camssf_fleet import upkeep
    from camssf_fleet.compare import many
    from camssf_fleet.documents import GENERATOR, DeletionDocument
    from camssf_fleet.registry import Registry

    found = Registry(folder)
    deleted = upkeep.delete(found, Unit(model=model, serial=serial)) if serial else ()
    if not deleted:
        raise InvalidArgument(
            f"The registry has no result of a unit with the serial number {serial!r}.",
            "See `camssf registry list` for those that it has.",
        )
    emit(to_plain(DeletionDocument(format="camssf-deletion/1", generator=GENERATOR, results=deleted)))
    say("", f"{many(len(deleted), 'result')} deleted; the documents remain, their places are on stdout")


def report(
    folder: Folder,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="The page, .html.")],
    days: Annotated[
        float, typer.Option(min=0.0, help="A unit is due if its newest accepted result is older than this.")
    ] = 365.0,
) -> None:
    """Write a page on the whole fleet.

    Models, how their units differ, drifts, what is due for calibration, and why results were not accepted.
    """
    from camssf.errors import InvalidArgument
    from camssf.files import write_file
    from camssf_fleet.overview import fleet_page
    from camssf_fleet.registry import Registry

    if out.suffix != ".html":
        raise InvalidArgument(f"The page {out} does not end in .html.", "Give it this ending.")
    write_file(out, fleet_page(Registry(folder), days=days))
    say("", f"page: {out}")


COMMANDS: tuple[tuple[Callable[..., Any], str], ...] = (
    (report, "camssf registry report phones/ -o fleet.html"),
    (verify, "camssf registry verify phones/"),
    (optimize, "camssf registry optimize phones/"),
    (vacuum, "camssf registry vacuum phones/ --days 30"),
    (delete, "camssf registry delete phones/ --serial A1B2"),
)
"""Each command and its example."""
