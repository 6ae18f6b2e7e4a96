"""Commands for many results: camssf registry add, list, compare, learn, export."""

from __future__ import annotations

import csv
import hashlib
import io
import math
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from camssf.cli.groups import Group
from camssf.cli.options import CameraId, Captured, Lens
from camssf.cli.reading import check_captured, given_paths, name_of, read_bytes, read_list, read_result
from camssf.cli.terminal import PARTED, UNDECIDED, emit, progress_bar, put, say
from camssf.errors import InvalidArgument
from camssf.version import __version__

if TYPE_CHECKING:
    from camssf.fleet.drift import UnitDrift
    from camssf.fleet.registry import Registry
    from camssf.learning.judgement import Judgement

STATUSES = ("accepted", "doubtful", "refused")
"""Statuses of results; a failed job has no result."""

registry = Group(
    name="registry",
    help="Keep many results, one row each: list them, compare units and models, detect drift.",
    short_help="Keep and compare many results.",
    epilog='Example: camssf registry compare phones/ --model "Pixel 9"',
    no_args_is_help=True,
    rich_markup_mode=None,
)

Folder: TypeAlias = Annotated[str, typer.Argument(metavar="REGISTRY", help="The registry's folder or URL.")]
Make: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="The camera's make.")]
Model: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="The camera's model.")]
Serial: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="The unit's serial number.")]
AsOf: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="VERSION|TIME", show_default=False, help="Read the registry as it was, at a version or at a time."
    ),
]
Verify: TypeAlias = Annotated[bool, typer.Option("--verify", help="Verify the registry before it is read.")]
Doubtful: TypeAlias = Annotated[bool, typer.Option("--doubtful", help="Include doubtful results.")]


def read_registry(folder: str, as_of: str, verify: bool) -> Registry:
    """The registry, verified if that is asked for."""
    from camssf.fleet.registry import Registry

    found = Registry(folder, as_of=as_of)
    if verify:
        from camssf.fleet.verify import check_registry

        check_registry(found)
    return found


@registry.command(epilog="Example: camssf registry add phones/ out/result.json --serial A1B2 --captured 2026-11-22")
def add(
    folder: Folder,
    results: Annotated[list[str], typer.Argument(metavar="JSON|JWS...", help="Results or passports.")],
    serial: Serial = "",
    camera_id: CameraId = "",
    lens: Lens = "",
    captured: Captured = "",
    key: Annotated[
        list[Path] | None,
        typer.Option(metavar="PEM", show_default=False, help="For passports: a trusted public key."),
    ] = None,
    revoked: Annotated[
        Path | None,
        typer.Option(metavar="JWS", show_default=False, help="Signed list of revoked passports and keys."),
    ] = None,
) -> None:
    """Add results; a registry that is missing is made."""
    from camssf.documents.result_json import LARGEST_DOCUMENT, check_document, parse_json
    from camssf.fleet.compare import many
    from camssf.fleet.registry import Registry
    from camssf.fleet.rows import Origin, row
    from camssf.fleet.upkeep import MANY_FILES, optimize
    from camssf.photo.read.unit import Unit

    check_captured(captured)
    found, rows, read, passports = Registry(folder, new=True), [], [], []
    for path in given_paths("RESULT", results, remote=True):
        data = read_bytes(path, LARGEST_DOCUMENT)
        if data.lstrip()[:1] == b"{":
            document = parse_json(data, name_of(path), "Give a result.")
            if isinstance(document, dict) and "excerpt" in document:
                passports.append((path, data))
            else:
                read.append((path, data, check_document(document, name_of(path))))
        elif not re.fullmatch(rb"[!-~]+", data.strip()) or data.count(b".") != 2:
            what = f"{_kind_of(data)}, no result and no passport"
            raise InvalidArgument(f"{name_of(path)} is {what}.", "Give a result.json, or a passport (.jws).")
        else:
            passports.append((path, data))
    if passports and any((serial, camera_id, lens, captured)):
        raise InvalidArgument(
            f"{name_of(passports[0][0])} is a passport; it already names its unit and time.",
            "Leave out --serial, --camera-id, --lens and --captured.",
        )
    whole = {hashlib.sha256(data).hexdigest(): (data, document) for _, data, document in read}
    signed = {}
    for path, data in passports:
        added = _from_passport(data, folder, path, (key or [], revoked), whole)
        signed[added.key] = added
    for path, data, document in read:
        if hashlib.sha256(data).hexdigest() not in signed:  # else the row of its passport replaces it
            unit = Unit(serial=serial, camera_id=camera_id, lens=lens)
            rows.append(row(data, document, Origin(unit, captured, place=_place(folder, path))))
    rows += signed.values()
    found.add(rows)
    optimize(found, least=MANY_FILES)
    say("", f"{many(len(rows), 'result')} added to {folder}")


def _kind_of(data: bytes) -> str:
    """The kind of a file that is no result, in words."""
    from camssf.files import kind_of

    return kind_of(data) or ("text" if data.isascii() and b"\0" not in data else "a binary file")


def _from_passport(
    data: bytes,
    folder: str,
    path: str,
    trust: tuple[list[Path], Path | None],
    whole: dict[str, tuple[bytes, dict[str, Any]]],
) -> Any:
    """The row of a passport, from the whole result if that is given too, else from the excerpt."""
    from camssf.documents.keys import read_public
    from camssf.documents.passport import check_belongs, verify
    from camssf.fleet.rows import Origin, row

    keys, revoked = trust
    if not keys:
        raise InvalidArgument(f"{name_of(path)} is a passport.", "Give the signer's public key by --key.")
    trusted = read_public(keys)
    found = verify(data, trusted, revoked=read_list(revoked, trusted))
    document = found.result
    if found.result_sha256 in whole:
        result, document = whole[found.result_sha256]
        check_belongs(found, result)
    else:
        say(
            "[yellow]without its covariance[/]",
            f": {name_of(path)} holds an excerpt; `registry learn` needs the whole result.json, added with it",
        )
    origin = Origin(found.unit, found.captured, passport=found.id, place=_place(folder, path))
    return replace(row(found.result_sha256, document, origin), passport_ends=found.ends)


def _place(folder: str, path: str) -> str:
    from camssf.places import place, relative

    return "" if path == "-" else relative(place(path), place(folder))


@registry.command("list", epilog='Example: camssf registry list phones/ --model "Pixel 9" > pixels.csv')
def list_results(
    folder: Folder,
    make: Make = "",
    model: Model = "",
    serial: Serial = "",
    status: Annotated[
        list[str] | None,
        typer.Option(
            metavar="WORD",
            show_default=False,
            help="Only results of this status: accepted, doubtful or refused; may be repeated.",
        ),
    ] = None,
    limit: Annotated[
        int | None, typer.Option(min=1, show_default=False, help="Largest number of rows, newest first.")
    ] = None,
    as_of: AsOf = "",
    verify: Verify = False,
) -> None:
    """List results as CSV, the newest first."""
    from camssf.fleet.compare import many
    from camssf.fleet.recorder import cell
    from camssf.fleet.registry import SHORT, Wanted
    from camssf.fleet.tables import as_json
    from camssf.photo.read.unit import Unit

    for word in status or ():
        if word not in STATUSES:
            raise InvalidArgument(f"{word!r} is not a status of a result.", f"Use one of {', '.join(STATUSES)}.")
    unit = Unit(make=make, model=model, serial=serial)
    found = read_registry(folder, as_of, verify).listing(Wanted(unit, statuses=tuple(status or ())), limit=limit)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(SHORT)
    for each in found:
        values = as_json(each)
        values["lamps"] = " ".join(values["lamps"] or ())
        writer.writerow(["" if value is None else cell(str(value)) for value in values.values()])
    put(text.getvalue().rstrip("\n"))
    count = Counter(str(each["status"]) for each in found)
    words = ", ".join(f"{n} {word}" for word, n in sorted(count.items()))
    say("", f"{many(len(found), 'result')}: {words}" if found else "no results")


@registry.command(epilog="Example: camssf registry compare phones/ --serial A1B2")
def compare(
    folder: Folder,
    make: Make = "",
    model: Model = "",
    serial: Serial = "",
    camera_id: CameraId = "",
    lens: Lens = "",
    result: Annotated[
        str | None, typer.Option(metavar="JSON", show_default=False, help="List the models nearest to this result.")
    ] = None,
    doubtful: Doubtful = False,
    as_of: AsOf = "",
    verify: Verify = False,
) -> None:
    """Compare units of a model, or follow one unit.

    The units of a --model, one unit over time by its --serial, or a --result with the models of the registry.

    JSON on stdout. The exit status for a unit is 1 if it drifts, and 12 if this cannot be decided because its
    newest result was left out.
    """
    from camssf.fleet import compare as comparing
    from camssf.fleet.drift import drift_of
    from camssf.fleet.registry import Wanted
    from camssf.grid import CHANNELS
    from camssf.photo.read.unit import Unit

    found = read_registry(folder, as_of, verify)
    statuses = ("accepted", "doubtful") if doubtful else comparing.ACCEPTED
    unit = Unit(make=make, model=model, serial=serial, camera_id=camera_id, lens=lens)
    if result is not None and unit != Unit():
        unused = ", ".join(f"--{name.replace('_', '-')}" for name, value in vars(unit).items() if value)
        raise InvalidArgument(
            "--result is compared with all models, so it excludes --model and --serial.", f"Leave {unused} out."
        )
    if result is None and not (serial or model):
        raise InvalidArgument(
            "Nothing to compare was named.",
            "Give --model to compare its units, --serial to follow one unit, or --result to find the nearest models.",
        )
    if result is not None:
        document = read_result(result, excerpt=True)
        if "ssf" not in document:
            raise InvalidArgument("The result was refused: it has no curves.", "Give one with curves.")
        near = comparing.nearest(found, comparing.curves_of(document), statuses=statuses)
        left_out = comparing.other_statuses(found, Wanted(), statuses)
        emit(_document("registry-nearest") | {"models": [vars(one) for one in near], "left_out": left_out})
        say("", "root mean square difference, parts of the peak" if near else "no model to compare with")
        for one in near:
            say("", f"{one.distance:.4f}  {one.make} {one.model} ({comparing.many(one.results, 'result')})")
        _say_left_out(left_out)
    elif serial:
        drift = drift_of(found, unit, statuses=statuses)
        emit(_drift_document(serial, drift))
        _say_drift(drift)
        if drift.outcome != "no_drift":
            raise typer.Exit(PARTED if drift.alarms else UNDECIDED)
    else:
        spread = comparing.spread(found, unit, statuses=statuses)
        emit(
            _document("spread")
            | {name: value.tolist() if hasattr(value, "tolist") else value for name, value in vars(spread).items()}
        )
        size = spread.observed if spread.between is None else spread.between
        what = "units and calibrations together" if spread.between is None else "unit to unit"
        say("", f"standard deviation from {what}, parts of the peak (95 % interval)")
        for colour, s, low, high in zip(CHANNELS, size, spread.low, spread.high, strict=True):
            say("", f"{colour:<6} {s:.4f} ({low:.4f} to {high:.4f})")
        say("", f"{spread.units} units, {comparing.many(spread.results, 'result')}")
        if spread.without_serial:
            say("", f"left out: {comparing.many(spread.without_serial, 'result')} of which the unit is not certain")
        _say_left_out(spread.left_out)


def _say_left_out(left_out: dict[str, int]) -> None:
    """Print the numbers of results left out because of their status."""
    from camssf.fleet.compare import counts_in_words

    if left_out:
        more = " (--doubtful counts the doubtful ones, too)" if "doubtful" in left_out else ""
        say("", f"left out: {counts_in_words(left_out)}{more}")


def _drift_document(serial: str, drift: UnitDrift) -> dict[str, Any]:
    from camssf.fleet.drift import FEATURES

    return _document("drift") | {
        "serial": serial,
        "outcome": drift.outcome,
        "alarm": bool(drift.alarms),
        "doubtful": drift.doubtful,
        "features": [{name: _finite(value) for name, value in vars(each).items()} for each in drift.features],
        "left_out": [
            vars(each) | {"steps": None if each.steps is None else dict(zip(FEATURES, each.steps, strict=True))}
            for each in drift.left_out
        ],
    }


def _say_drift(drift: UnitDrift) -> None:
    """Print the outcome, the features that drift, and each result that was left out."""
    from camssf.fleet.drift import ADVICE, FEATURES, NO_UNIT

    first = drift.features[0]
    doubtful = f", {drift.doubtful} of them doubtful," if drift.doubtful else ""
    counted = f"{first.results} results{doubtful} over {first.days:.0f} days"
    for each in drift.alarms:
        moved, words = (each.change, "trend from the first to the last") if each.alarm == "trend" else (
            each.step, "the last against the mean of those before")  # fmt: skip
        say("[bold red]drift[/]: ", f"{each.feature} {moved:+.2f} nm ({words})")
    for result in drift.left_out:
        words = f"{result.captured or 'no time'}, {result.status}"
        if result.code:
            words += f" ({result.code}: {result.reason})"
        if result.why == NO_UNIT:
            words += f", {result.why}"
        if result.steps is not None:
            feature, step = max(zip(FEATURES, result.steps, strict=True), key=lambda each: abs(each[1]))
            words += f"; {feature} {step:+.2f} nm from the mean of the others"
        say("[yellow]left out[/]: ", f"{words}; result {result.key[:12]}")
    if drift.alarms:
        say("", f"drift in {counted}")
    elif drift.outcome == "no_drift":
        say("", f"no drift in {counted}")
    else:
        say("[bold yellow]undecided[/]: ", f"no drift in {counted}, but the newest result was left out.")
        why = {each.why for each in drift.left_out if each.newest}
        say("", f"  {' '.join(ADVICE[each] for each in sorted(why))}")


@registry.command(epilog="Example: camssf registry learn phones/ -o ours.npz")
def learn(
    folder: Folder,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="Output file of the basis, .npz.")],
    basis: Annotated[
        str,
        typer.Option(metavar="NAME", help="Learn from results on this basis, and extend it: phones or cameras."),
    ] = "phones",
    make: Make = "",
    model: Annotated[
        str,
        typer.Option(
            metavar="TEXT", show_default=False, help="Learn a basis of this model only; all models unless given."
        ),
    ] = "",
    camera_id: CameraId = "",
    table: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV",
            show_default=False,
            help="Measured curves to learn from as well: camera,wavelength_nm,R,G,B.",
        ),
    ] = None,
    licence: Annotated[
        str, typer.Option(metavar="TEXT", help="Licence of the --table, kept in the file.")
    ] = "that of the curves",
    leave: Annotated[
        str,
        typer.Option(
            metavar="WORD", help="What the cross-validation leaves out: model or maker; with --model always a unit."
        ),
    ] = "model",
    doubtful: Doubtful = False,
    as_of: AsOf = "",
    verify: Verify = False,
) -> None:
    """Learn a basis from the results.

    Each model, maker or unit is left out in turn, which says whether the basis helps with cameras that it has not
    seen. JSON on stdout; `camssf calibrate --basis FILE` takes the file.
    """
    from camssf.fleet.compare import ACCEPTED
    from camssf.fleet.learn import LearnRequest, learn_basis

    if out.suffix != ".npz":
        raise InvalidArgument(f"The basis file {out} does not end in .npz.", "Give it this ending.")
    statuses = ("accepted", "doubtful") if doubtful else ACCEPTED
    request = LearnRequest(basis, make, model, camera_id, statuses, table, licence, leave)
    with progress_bar() as progress:
        lesson = learn_basis(read_registry(folder, as_of, verify), request, progress=progress)
    lesson.save(out)
    emit(lesson.document())
    for reason, count in lesson.left_aside.items():
        say("", f"left out: {count} {reason}")
    say("", lesson.source)
    _say_judgement(lesson.judgement)
    say("", f"basis: {out}")


def _say_judgement(found: Judgement) -> None:
    """Print whether the basis helps, with the interval and the number of groups."""
    if found.nats is None:
        say("whether it helps is unknown: ", f"it needs results of at least 2 {found.left_out}s, and there is 1")
        return
    words = {True: "it helps", False: "[bold red]it harms[/]", None: "whether it helps is not clear yet"}[found.helps]
    say(
        f"{words}: ",
        f"{found.nats:+.1f} nats a photo, 95 % interval {found.low:+.1f} to {found.high:+.1f}, from {found.groups} "
        f"{found.left_out}s, each left out in turn (Student's t, {found.groups - 1} degrees of freedom)",
    )


@registry.command(epilog="Example: camssf registry export phones/ -o phones.parquet")
def export(
    folder: Folder,
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help=".parquet with everything, .csv without the curves.")
    ],
    as_of: AsOf = "",
    verify: Verify = False,
) -> None:
    """Write all results into one file."""
    read_registry(folder, as_of, verify).export(out)
    say("", f"results: {out}")


def _document(kind: str) -> dict[str, Any]:
    return {"format": f"camssf-{kind}/1", "generator": {"name": "camssf", "version": __version__}}


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
