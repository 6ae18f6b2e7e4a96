"""Commands on a whole registry: camssf registry report, verify, history, compact, delete."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from camssf.cli.terminal import emit, put, say
from camssf_fleet.cli.registry import Folder, Model

SerialOfUnit: TypeAlias = Annotated[str, typer.Argument(metavar="UNIT", help="The unit's serial number.")]


def verify(
    folder: Folder,
    head: Annotated[
        str,
        typer.Option(
            metavar="HASH", show_default=False, help="The heads that an earlier verify printed: notices an old copy."
        ),
    ] = "",
) -> None:
    """Compare files, records, lists and the archive with each other and with their hashes.

    JSON on stdout. The exit status is 1 if anything is damaged or missing, and it is named. Run it while nobody
    writes to the registry: a batch that runs, or was stopped, has results without a record.
    """
    from camssf.cli.terminal import PARTED
    from camssf.documents.forms import to_plain
    from camssf_fleet.compare import many
    from camssf_fleet.documents import GENERATOR, VerificationDocument
    from camssf_fleet.registry import Registry
    from camssf_fleet.verification import verify as verify_registry

    verification = verify_registry(Registry(folder), head)
    emit(to_plain(VerificationDocument(format="camssf-verification/1", generator=GENERATOR, **vars(verification))))
    for fault in verification.faults:
        say("[bold red]damaged[/]: ", fault)
    counts = ((verification.rows, "result"), (verification.files, "file"), (verification.documents, "document"))
    missing = f", {many(verification.documents_missing, 'document')} not at hand" * (
        verification.documents_missing > 0
    )
    say("", f"{', '.join(many(*count) for count in counts)} compared{missing}")
    for name in verification.heads:
        say("", f"head {name}")
    if verification.faults:
        say("", f"{many(len(verification.faults), 'fault')}. {verification.advice}")
        raise typer.Exit(PARTED)


def history(folder: Folder, unit: SerialOfUnit, model: Model = "") -> None:
    """Print what was said of a unit, by whom and when, as CSV."""
    from camssf.photo.read.unit import Unit
    from camssf_fleet.recorder import csv_text
    from camssf_fleet.registry import Registry

    changes = Registry(folder).history(Unit(model=model, serial=unit)) if unit else ()
    if not changes:
        raise _no_unit(unit)
    put(csv_text(("added", "added_by", "key", "what"), (vars(change).values() for change in changes)).rstrip("\n"))


def compact(folder: Folder) -> None:
    """Merge small files into larger ones, so that the registry is read faster."""
    from camssf_fleet.compare import many
    from camssf_fleet.registry import Registry

    files = Registry(folder).files
    before = len(files.sizes())
    files.compact()
    say("", f"{many(before, 'file')} before, {many(len(files.sizes()), 'file')} now")


def delete(folder: Folder, unit: SerialOfUnit, model: Model = "") -> None:
    """Delete all results of a unit, in every file.

    Their documents remain where they are. JSON on stdout gives each one's place, relative to the registry.
    """
    from camssf.documents.forms import to_plain
    from camssf.photo.read.unit import Unit
    from camssf_fleet.compare import many
    from camssf_fleet.documents import GENERATOR, DeletionDocument
    from camssf_fleet.registry import Deletion, Registry

    deletion = Registry(folder).delete(Unit(model=model, serial=unit)) if unit else Deletion((), 0, 0)
    if not deletion.records and not deletion.files:
        raise _no_unit(unit)
    emit(to_plain(DeletionDocument(format="camssf-deletion/1", generator=GENERATOR, **vars(deletion))))
    counts = ((len(deletion.results), "result"), (deletion.records, "record"), (deletion.files, "file"))
    results, records, files = (many(*count) for count in counts)
    say("", f"{results} deleted: {records} in {files}; the documents remain, their places are on stdout")


def _no_unit(serial: str) -> Exception:
    from camssf.errors import InvalidArgument

    return InvalidArgument(
        f"The registry has no result of a unit with the serial number {serial!r}.",
        "See `camssf registry list` for those that it has.",
    )


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
    (history, "camssf registry history phones/ A1B2"),
    (compact, "camssf registry compact phones/"),
    (delete, "camssf registry delete phones/ A1B2"),
)
"""Each command and its example."""
