"""Commands for many results: camssf registry add, list, compare, export."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from camssf.cli.options import Group, Revoked, TrustedKeys
from camssf.cli.reading import check_captured, given_paths, name_of, read_bytes, result_of
from camssf.cli.terminal import PARTED, UNDECIDED, emit, put, say
from camssf.errors import InvalidArgument
from camssf_fleet.cli.passport import Captured

if TYPE_CHECKING:
    from camssf_fleet.documents import Head
    from camssf_fleet.drift import UnitDrift
    from camssf_fleet.records import Row

registry = Group(
    name="registry",
    help="Keep many results, one row each: list them, compare units and models, detect drift.",
    short_help="Keep and compare many results.",
    epilog='Example: camssf registry compare phones/ --model "Pixel 9"',
    no_args_is_help=True,
    rich_markup_mode=None,
)

Folder: TypeAlias = Annotated[str, typer.Argument(metavar="REGISTRY", help="The registry's folder or URL.")]
Model: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="The camera's model.")]
Serial: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="The unit's serial number.")]
CameraId: TypeAlias = Annotated[
    str, typer.Option(metavar="TEXT", show_default=False, help="Camera id, for a phone with several cameras.")
]
Lens: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="The lens.")]


@registry.command(epilog="Example: camssf registry add phones/ out/result.json --serial A1B2 --captured 2026-11-22")
def add(
    folder: Folder,
    results: Annotated[list[str], typer.Argument(metavar="JSON|JWS...", help="Results or passports.")],
    serial: Serial = "",
    camera_id: CameraId = "",
    lens: Lens = "",
    captured: Captured = "",
    note: Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="A note of the operator.")] = "",
    correct: Annotated[
        bool, typer.Option("--correct", help="Replace what the registry says otherwise of a result.")
    ] = False,
    key: TrustedKeys = None,
    revoked: Revoked = None,
) -> None:
    """Add results; a registry that is missing is made.

    Of a result that it holds already, what is new is added and nothing is emptied. What contradicts the registry is
    refused, unless --correct is given.
    """
    from camssf.documents.excerpt import holds_excerpt
    from camssf.documents.forms import LARGEST, parse_json
    from camssf.photo.read.unit import Unit
    from camssf_fleet.compare import many
    from camssf_fleet.records import Origin, row
    from camssf_fleet.registry import Registry

    check_captured(captured)
    kept, rows, read, passports = Registry(folder, new=True, correct=correct), [], [], []
    for path in given_paths(results, remote=True):
        data = read_bytes(path, LARGEST)
        if data.lstrip()[:1] == b"{":
            plain = parse_json(data, name_of(path), "Give a result.")
            if holds_excerpt(plain):
                passports.append((path, data))
            else:
                read.append((path, data, result_of(plain, name_of(path))))
        elif not re.fullmatch(rb"[!-~]+", data.strip()) or data.count(b".") != 2:
            what = f"{_kind_of(data)}, no result and no passport"
            raise InvalidArgument(f"{name_of(path)} is {what}.", "Give a result.json, or a passport (.jws).")
        else:
            passports.append((path, data))
    if passports and any((serial, camera_id, lens, captured, note)):
        raise InvalidArgument(
            f"{name_of(passports[0][0])} is a passport; it already names its unit and time.",
            "Leave out --serial, --camera-id, --lens, --captured and --note.",
        )
    unit, whole = Unit(serial=serial, camera_id=camera_id, lens=lens), {}
    for path, data, document in read:
        rows.append(row(data, document, Origin(unit, captured, place=_place(folder, path), note=note)))
        whole[rows[-1].key] = data
    rows += [_from_passport(data, folder, path, (key or [], revoked), whole) for path, data in passports]
    names = [name_of(path) for path, *_ in read] + [name_of(path) for path, _ in passports]
    added = kept.add(rows, names=names)
    for name, result in zip(names, added, strict=True):
        if result.changes:
            say("", f"{name}: {', '.join(result.changes)}")
    new, changed = {result.key for result in added if result.new}, {result.key for result in added if result.changes}
    known = {result.key for result in added} - new - changed
    outcomes = ((new, "added to"), (changed - new, "changed in"), (known, "known already in"))
    say("", ", ".join(f"{many(len(keys), 'result')} {words} {folder}" for keys, words in outcomes if keys))


def _kind_of(data: bytes) -> str:
    """The kind of a file that is no result, in words."""
    from camssf.files import kind_of

    return kind_of(data) or ("text" if data.isascii() and b"\0" not in data else "a binary file")


def _from_passport(
    data: bytes,
    folder: str,
    path: str,
    trust: tuple[list[Path], Path | None],
    whole: dict[str, bytes],
) -> Row:
    """The row of a passport, from its excerpt; it must belong to the whole result if that is given too."""
    from camssf_fleet.passport.document import check_belongs, verify
    from camssf_fleet.passport.keys import read_public
    from camssf_fleet.passport.received import read_list
    from camssf_fleet.records import Origin, row

    keys, revoked = trust
    if not keys:
        raise InvalidArgument(f"{name_of(path)} is a passport.", "Give the signer's public key by --key.")
    trusted = read_public(keys)
    passport = verify(data, trusted, revoked=read_list(revoked, trusted))
    if passport.result_sha256 in whole:
        check_belongs(passport, whole[passport.result_sha256])
    origin = Origin(passport.unit, passport.captured, passport=passport.id, place=_place(folder, path))
    return replace(row(passport.result_sha256, passport.result, origin), passport_ends=passport.ends)


def _place(folder: str, path: str) -> str:
    from camssf.places import place, relative

    return "" if path == "-" else relative(place(path), place(folder))


@registry.command("list", epilog='Example: camssf registry list phones/ --model "Pixel 9" > pixels.csv')
def list_results(
    folder: Folder,
    model: Model = "",
    serial: Serial = "",
) -> None:
    """List results as CSV, the newest first."""
    from camssf.photo.read.unit import Unit
    from camssf_fleet.compare import many
    from camssf_fleet.record_queries import as_json
    from camssf_fleet.recorder import csv_text
    from camssf_fleet.registry import SHORT, Registry, Wanted

    listed = Registry(folder).listing(Wanted(Unit(model=model, serial=serial)))
    rows = [as_json(result) | {"lamps": " ".join(result["lamps"] or ())} for result in listed]
    put(csv_text(SHORT, (row.values() for row in rows)).rstrip("\n"))
    count = Counter(str(result["status"]) for result in listed)
    words = ", ".join(f"{n} {word}" for word, n in sorted(count.items()))
    say("", f"{many(len(listed), 'result')}: {words}" if listed else "no results")


@registry.command(epilog="Example: camssf registry compare phones/ --serial A1B2")
def compare(
    folder: Folder,
    make: Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="The camera's make.")] = "",
    model: Model = "",
    serial: Serial = "",
    camera_id: CameraId = "",
    lens: Lens = "",
    doubtful: Annotated[bool, typer.Option("--doubtful", help="Include doubtful results.")] = False,
) -> None:
    """Compare units of a model, or follow one unit.

    The units of a --model, or one unit over time by its --serial.

    JSON on stdout. The exit status for a unit is 1 if it drifts, and 12 if this cannot be decided because its
    newest result was left out.
    """
    from camssf.grid import CHANNELS
    from camssf.photo.read.unit import Unit
    from camssf_fleet import compare as comparing
    from camssf_fleet.documents import GENERATOR, DriftDocument, SpreadDocument
    from camssf_fleet.drift import drift_of
    from camssf_fleet.registry import Registry

    results = Registry(folder)
    statuses = ("accepted", "doubtful") if doubtful else comparing.ACCEPTED
    unit = Unit(make=make, model=model, serial=serial, camera_id=camera_id, lens=lens)
    if not (serial or model):
        raise InvalidArgument(
            "Nothing to compare was named.", "Give --model to compare its units, or --serial to follow one unit."
        )
    if serial:
        drift = drift_of(results, unit, statuses=statuses)
        _emit(
            DriftDocument(
                format="camssf-drift/1",
                generator=GENERATOR,
                serial=serial,
                outcome=drift.outcome,
                alarm=bool(drift.alarms),
                doubtful=drift.doubtful,
                features=drift.features,
                left_out=drift.left_out,
            )
        )
        _say_drift(drift)
        if drift.outcome != "no_drift":
            raise typer.Exit(PARTED if drift.alarms else UNDECIDED)
    else:
        spread = comparing.spread(results, unit, statuses=statuses)
        _emit(SpreadDocument(format="camssf-spread/1", generator=GENERATOR, **vars(spread)))
        size = spread.observed if spread.between is None else spread.between
        what = "units and calibrations together" if spread.between is None else "unit to unit"
        say("", f"standard deviation from {what}, parts of the peak (95 % interval)")
        for colour, s, low, high in zip(CHANNELS, size, spread.low, spread.high, strict=True):
            say("", f"{colour:<6} {s:.4f} ({low:.4f} to {high:.4f})")
        say("", f"{spread.units} units, {comparing.many(spread.results, 'result')}")
        if spread.without_serial:
            say("", f"left out: {comparing.many(spread.without_serial, 'result')} of which the unit is not certain")
        if spread.left_out:
            more = " (--doubtful counts the doubtful ones, too)" if "doubtful" in spread.left_out else ""
            say("", f"left out: {comparing.counts_in_words(spread.left_out)}{more}")


def _emit(document: Head) -> None:
    from camssf.documents.forms import to_plain

    emit(to_plain(document))


def _say_drift(drift: UnitDrift) -> None:
    """Print the outcome, the features that drift, and each result that was left out."""
    from camssf_fleet.drift import ADVICE, NO_UNIT

    first = drift.features[0]
    doubtful = f", {drift.doubtful} of them doubtful," if drift.doubtful else ""
    counted = f"{first.results} results{doubtful} over {first.days:.0f} days"
    for test in drift.alarms:
        moved, words = (test.change, "trend from the first to the last") if test.alarm == "trend" else (
            test.step, "the last against the mean of those before")  # fmt: skip
        say("[bold red]drift[/]: ", f"{test.feature} {moved:+.2f} nm ({words})")
    for result in drift.left_out:
        words = f"{result.captured or 'no time'}, {result.status}"
        if result.code:
            words += f" ({result.code}: {result.reason})"
        if result.why == NO_UNIT:
            words += f", {result.why}"
        if result.steps is not None:
            feature, step = max(result.steps.items(), key=lambda item: abs(item[1]))
            words += f"; {feature} {step:+.2f} nm from the mean of the others"
        say("[yellow]left out[/]: ", f"{words}; result {result.key[:12]}")
    if drift.alarms:
        say("", f"drift in {counted}")
    elif drift.outcome == "no_drift":
        say("", f"no drift in {counted}")
    else:
        say("[bold yellow]undecided[/]: ", f"no drift in {counted}, but the newest result was left out.")
        why = {result.why for result in drift.left_out if result.newest}
        say("", f"  {' '.join(ADVICE[word] for word in sorted(why))}")


@registry.command(epilog="Example: camssf registry export phones/ -o phones.parquet")
def export(
    folder: Folder,
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help=".parquet with everything, .csv without the curves.")
    ],
) -> None:
    """Write all results into one file."""
    from camssf_fleet.registry import Registry

    Registry(folder).export(out)
    say("", f"results: {out}")
