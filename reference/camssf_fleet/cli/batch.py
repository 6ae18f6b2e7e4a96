"""The command that calibrates many cameras from a manifest."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camssf.cli.options import BasisName, LensShading
from camssf.cli.terminal import BATCH_FAILED, emit, literal, progress_bar, say, stderr
from camssf.errors import InvalidArgument

if TYPE_CHECKING:
    from camssf_fleet.outcome import Outcome, Summary

AGAIN = "Once the causes are mended, run the same command again: what is done is not done again."
STOPPED = "Run the same command again to resume: what is done is not done again."
MOST_MODELS = 20
"""Largest number of models in a batch's summary on the terminal; the JSON has all."""


def batch(
    manifest: Annotated[
        str | None,
        typer.Argument(
            metavar="CSV",
            show_default=False,
            help="Columns name,photo,lamp,white,dark,chart; rows of one name are its shots.",
        ),
    ] = None,
    out: Annotated[
        str, typer.Option("-o", "--out", metavar="FOLDER", help="Output folder; with a registry also a URL.")
    ] = "out",
    basis: BasisName = "auto",
    lens_shading: LensShading = "as-stored",
    workers: Annotated[
        str | None,
        typer.Option(
            metavar="NUMBER|ADDRESS",
            show_default=False,
            help="Processes, one for each core unless given; with a registry also the address of a Dask scheduler, "
            "as tcp://host:8786, whose workers do the jobs.",
        ),
    ] = None,
    registry: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER",
            show_default=False,
            help="Registry that the results go to; with it the manifest may be of any size and have further columns.",
        ),
    ] = None,
    correct: Annotated[
        bool, typer.Option("--correct", help="With a registry: replace what it says otherwise of a result.")
    ] = False,
    make_manifest: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER",
            show_default=False,
            help="Only write FOLDER/manifest.csv, of photos named UNIT_LAMP.dng, UNIT_LAMP_white.dng ...",
        ),
    ] = None,
) -> None:
    """Calibrate many cameras from a manifest.

    Goes on after a failure, skips what is done and unchanged.
    """
    if (manifest is None) == (make_manifest is None):
        raise InvalidArgument(
            f"{'Neither' if manifest is None else 'Both'} a manifest {'nor' if manifest is None else 'and'} "
            "--make-manifest was given.",
            "Name a CSV file, or the folder whose manifest is to be made.",
        )
    if make_manifest is not None:
        _make(make_manifest)
        return
    assert manifest is not None
    count, scheduler = _parse_workers(workers)
    if registry is None and correct:
        raise InvalidArgument("--correct is for a registry.", "Leave it out, or name a --registry.")
    try:
        with progress_bar() as progress:
            from camssf_fleet.batch import run_batch
            from camssf_fleet.compare import many
            from camssf_fleet.manifest import Manifest
            from camssf_fleet.registry import Registry

            rows = Manifest(manifest, basis=basis, lens_shading=lens_shading)
            rows_to = None if registry is None else Registry(registry, new=True, correct=correct)
            summary = run_batch(rows, out, rows_to, workers=count, dask=scheduler, progress=progress)
    except KeyboardInterrupt:
        say("", STOPPED)
        raise
    done = f"{summary.total - summary.failed} of {summary.total} calibrated"
    if registry is None:
        _say_outcomes(summary.outcomes)
        say("", f"{done}; summary in {Path(out) / 'summary.csv'}")
    else:
        emit(summary.document())
        _say_numbers(summary)
        counts = f"{summary.resumed} from before, {summary.duplicates} duplicates"
        say("", f"{done} ({counts}); {many(summary.added, 'row')} added to {registry}")
    if summary.failed:
        say("", AGAIN)
        raise typer.Exit(BATCH_FAILED)


def _make(folder: str) -> None:
    from camssf_fleet.compare import many
    from camssf_fleet.manifest_maker import MANIFEST, make_manifest

    rows = make_manifest(folder)
    path = Path(folder) / MANIFEST
    say("", f"{many(rows, 'row')} written to {path}; it has serial numbers, so `camssf batch` needs a --registry")


def _parse_workers(text: str | None) -> tuple[int | None, str | None]:
    """A number of processes, or a scheduler's address."""
    if text is None or ":" in text:
        return None, text
    if not re.fullmatch("[1-9][0-9]{0,5}", text):
        raise InvalidArgument(
            f"--workers {text!r} is no number of processes.",
            "Give 1 or more, or the address of a Dask scheduler, as tcp://host:8786.",
        )
    return int(text), None


def _say_outcomes(outcomes: Sequence[Outcome]) -> None:
    """Print a table with a line for each job."""
    from rich.table import Table

    table = Table("name", "status", "reason")
    for outcome in outcomes:
        colour = {"accepted": "green", "doubtful": "yellow"}.get(outcome.status, "red")
        status = f"[{colour}]{outcome.status}[/]{' (unchanged)' if outcome.resumed else ''}"
        table.add_row(literal(outcome.name), status, literal(outcome.reason))
    stderr().print(table)


def _say_numbers(summary: Summary) -> None:
    """Print the numbers of jobs by model and by reason."""
    models = sorted(summary.by_model.items(), key=lambda row: (-row[1].total(), row[0]))
    for model, counts in models[:MOST_MODELS]:
        words = ", ".join(f"{count} {word}" for word, count in counts.items())
        say("", f"{counts.total():>8} {model or 'of an unknown model'}: {words}")
    if len(models) > MOST_MODELS:
        say("", f"         and {len(models) - MOST_MODELS} more models")
    for code, count in summary.by_code.most_common():
        example = f" ({'one: ' * (count > 1)}{summary.examples[code]})" if code in summary.examples else ""
        say("", f"{count:>8} {code}{example}")
    if crashed := summary.by_status["failed"]:
        say("", f"{crashed:>8} failed: a process died, or a fault of camssf")
