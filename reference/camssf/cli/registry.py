"""Many results: camssf registry add, list, compare, learn, export."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import typer

from camssf import __version__
from camssf.cli.options import CameraId, Captured, Lens
from camssf.cli.reading import given_paths, name_of, parse_time, read_bytes, read_result
from camssf.cli.terminal import PARTED, emit, progress_bar, put, say
from camssf.errors import InvalidArgument

STATUSES = ("accepted", "doubtful", "refused")
"""Of results; what failed has none."""
KINDS = {
    b"II*\0": "a photo (DNG or TIFF)", b"MM\0*": "a photo (DNG or TIFF)", b"\x89PNG": "a picture (PNG)",
    b"\xff\xd8\xff": "a picture (JPEG)", b"PK\x03\x04": "an archive (.npz or .zip)", b"PAR1": "Parquet",
    b"%PDF": "a PDF", b"-----BEGIN": "a key (PEM)", b"<": "a page",
}  # fmt: skip
"""Of a file, by its begin."""

registry = typer.Typer(
    name="registry",
    help="Keep many results, one row each: list them, compare units and models, see a drift.",
    short_help="Keep and compare many results.",
    epilog='Example: camssf registry compare phones/ --model "Pixel 9"',
    no_args_is_help=True,
    rich_markup_mode=None,
)

Folder: TypeAlias = Annotated[Path, typer.Argument(metavar="REGISTRY", help="The registry's folder.")]
Make: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="Of the camera.")]
Model: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="Of the camera.")]
Serial: TypeAlias = Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="Of the unit.")]
Doubtful: TypeAlias = Annotated[bool, typer.Option("--doubtful", help="Count doubtful results, too.")]


@registry.command(epilog="Example: camssf registry add phones/ out/result.json --serial A1B2 --captured 2026-11-22")
def add(
    folder: Folder,
    results: Annotated[
        list[str], typer.Argument(metavar="JSON|JWS...", help="Results, or passports, which know their unit.")
    ],
    serial: Serial = "",
    camera_id: CameraId = "",
    lens: Lens = "",
    captured: Captured = "",
    key: Annotated[
        list[Path] | None,
        typer.Option(metavar="PEM", show_default=False, help="A public key that is trusted, for passports."),
    ] = None,
    revoked: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default=False, help="Passports and keys that were called back."),
    ] = None,
) -> None:
    """Add results to a registry, which is made where it is missing."""
    from camssf.documents.report import LARGEST_DOCUMENT, check_document, parse_json
    from camssf.fleet.registry import MANY_FILES, Registry
    from camssf.fleet.rows import Origin, row
    from camssf.photo.unit import Unit

    parse_time(captured or None)
    found, rows = Registry(folder, new=True), []
    for path in given_paths("RESULT", results):
        data = read_bytes(path, 3 * LARGEST_DOCUMENT)
        if data.lstrip()[:1] == b"{":
            if len(data) > LARGEST_DOCUMENT:
                raise InvalidArgument(f"{name_of(path)} is larger than {LARGEST_DOCUMENT} bytes.", "Give a result.")
            document = check_document(parse_json(data, name_of(path), "Give a result."), name_of(path))
            unit = Unit(serial=serial, camera_id=camera_id, lens=lens)
            rows.append(row(data, document, Origin(unit, captured, place=_place(folder, path))))
        elif not re.fullmatch(rb"[!-~]+", data.strip()) or data.count(b".") != 2:
            what = f"{_kind_of(data)}, no result and no passport"
            raise InvalidArgument(f"{name_of(path)} is {what}.", "Give a result.json, or a passport (.jws).")
        else:
            if any((serial, camera_id, lens, captured)):
                raise InvalidArgument(f"{name_of(path)} is a passport, which says its unit.", "Leave the unit out.")
            rows.append(_from_passport(data, folder, path, key or [], revoked))
    found.add(rows)
    if found.files() > MANY_FILES:
        found.gather()
    say("", f"{len(rows)} added to {folder}")


def _kind_of(data: bytes) -> str:
    """A file that was given in a result's place, in words."""
    for begin, word in KINDS.items():
        if data.startswith(begin):
            return word
    return "text" if data.isascii() and b"\0" not in data else "a binary file"


def _from_passport(data: bytes, folder: Path, path: str, keys: list[Path], revoked: Path | None) -> Any:
    from camssf.documents.keys import read_public, read_revoked
    from camssf.documents.passport import verify
    from camssf.documents.report import check_document
    from camssf.fleet.rows import Origin, row

    if not keys:
        raise InvalidArgument(f"{name_of(path)} is a passport.", "Give the signer's public key by --key.")
    called = frozenset() if revoked is None else read_revoked(revoked)
    found = verify(data, read_public(keys), revoked=called)
    origin = Origin(found.unit, found.captured, passport=found.id, place=_place(folder, path))
    return row(found.result_sha256, check_document(found.result, name_of(path)), origin)


def _place(folder: Path, path: str) -> str:
    from camssf.fleet.rows import place_of

    return "" if path == "-" else place_of(path, folder)


@registry.command("list", epilog='Example: camssf registry list phones/ --model "Pixel 9" > pixels.csv')
def list_results(
    folder: Folder,
    make: Make = "",
    model: Model = "",
    serial: Serial = "",
    status: Annotated[
        list[str] | None, typer.Option(metavar="WORD", show_default=False, help="accepted, doubtful, refused.")
    ] = None,
    limit: Annotated[int | None, typer.Option(min=1, show_default=False, help="At most so many.")] = None,
) -> None:
    """List results as CSV, the newest first."""
    from camssf.fleet.registry import SHORT, Registry, Wanted, as_json
    from camssf.fleet.run import cell

    for word in status or ():
        if word not in STATUSES:
            raise InvalidArgument(f"No result is {word!r}.", f"The words are {', '.join(STATUSES)}.")
    found = Registry(folder).listing(Wanted(make, model, serial, statuses=tuple(status or ())), limit=limit)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(SHORT)
    for each in found:
        values = as_json(each)
        values["lamps"] = " ".join(values["lamps"] or ())
        writer.writerow(["" if value is None else cell(str(value)) for value in values.values()])
    put(text.getvalue().rstrip("\n"))
    count = Counter(str(each["status"]) for each in found)
    say("", ", ".join(f"{n} {word}" for word, n in sorted(count.items())) or "no results")


@registry.command(epilog="Example: camssf registry compare phones/ --serial A1B2")
def compare(
    folder: Folder,
    make: Make = "",
    model: Model = "",
    serial: Serial = "",
    camera_id: CameraId = "",
    lens: Lens = "",
    result: Annotated[
        str | None, typer.Option(metavar="JSON", show_default=False, help="A result: which models are nearest?")
    ] = None,
    doubtful: Doubtful = False,
) -> None:
    """Compare: the units of a --model, a unit over time by its --serial, or a --result with all models.

    JSON on stdout; exits with 1 where a unit drifts.
    """
    from camssf.fleet import compare as comparing
    from camssf.fleet.registry import Registry

    found = Registry(folder)
    statuses = ("accepted", "doubtful") if doubtful else comparing.ACCEPTED
    which = {"--make": make, "--model": model, "--serial": serial, "--camera-id": camera_id, "--lens": lens}
    if result is not None and any(which.values()):
        unused = ", ".join(option for option, word in which.items() if word)
        raise InvalidArgument("A --result is compared with all models.", f"Leave {unused} out.")
    if result is None and not (serial or model):
        raise InvalidArgument("What shall be compared?", "Name a --model, a unit by --serial, or a --result.")
    if result is not None:
        document = read_result(result)
        if "ssf" not in document:
            raise InvalidArgument("The result was refused: it has no curves.", "Give one with curves.")
        near = comparing.nearest(found, comparing.curves_of(document), statuses=statuses)
        emit(_document("registry-nearest") | {"models": [vars(one) for one in near]})
        for one in near:
            say("", f"{one.distance:.4f}  {one.make} {one.model} ({one.results})")
    elif serial:
        drifts = comparing.drift(
            found, serial, make=make, model=model, camera_id=camera_id, lens=lens, statuses=statuses
        )
        alarms = [each for each in drifts if each.alarm]
        emit(
            _document("drift")
            | {"serial": serial, "alarm": bool(alarms)}
            | {"features": [{name: _finite(value) for name, value in vars(each).items()} for each in drifts]}
        )
        for each in alarms:
            moved = each.change if each.alarm == "trend" else each.step
            say("[bold red]drift[/]: ", f"{each.feature} {moved:+.2f} nm ({each.alarm})")
        if alarms:
            raise typer.Exit(PARTED)
        say("", f"no drift in {drifts[0].results} results over {drifts[0].days:.0f} days")
    else:
        spread = comparing.spread(found, model, make=make, camera_id=camera_id, lens=lens, statuses=statuses)
        emit(
            _document("spread")
            | {name: value.tolist() if hasattr(value, "tolist") else value for name, value in vars(spread).items()}
        )
        size = spread.seen if spread.between is None else spread.between
        for colour, s, low, high in zip(("red", "green", "blue"), size, spread.low, spread.high, strict=True):
            say("", f"{colour:<6} {s:.4f} of the peak ({low:.4f} to {high:.4f})")
        say("", f"{spread.units} units, {spread.results} results; {spread.without_serial} name no unit")


@registry.command(epilog="Example: camssf registry learn phones/ -o ours.npz")
def learn(
    folder: Folder,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="The basis, .npz.")],
    basis: Annotated[
        str, typer.Option(metavar="NAME", help="Whose results count, and what is departed from: phones or cameras.")
    ] = "phones",
    make: Make = "",
    model: Annotated[
        str, typer.Option(metavar="TEXT", show_default=False, help="A basis of this model's units alone.")
    ] = "",
    camera_id: CameraId = "",
    table: Annotated[
        Path | None,
        typer.Option(
            metavar="CSV", show_default=False, help="Measured cameras beside them: camera,wavelength_nm,R,G,B."
        ),
    ] = None,
    licence: Annotated[
        str, typer.Option(metavar="TEXT", help="Of these curves, kept in the file.")
    ] = "that of the curves",
    leave: Annotated[
        str, typer.Option(metavar="WORD", help="Left out for the judgement: model or maker; a unit with --model.")
    ] = "model",
    doubtful: Doubtful = False,
) -> None:
    """Make a basis of the results, and say by leaving out whether it would have helped.

    JSON on stdout; `--basis FILE` of calibrate takes the file.
    """
    from camssf.fleet.compare import ACCEPTED
    from camssf.fleet.learn import Asked, learn_basis
    from camssf.fleet.registry import Registry

    if out.suffix != ".npz":
        raise InvalidArgument(f"{out} is no .npz.", "Name the basis file like that.")
    statuses = ("accepted", "doubtful") if doubtful else ACCEPTED
    asked = Asked(basis, make, model, camera_id, statuses, table, licence, leave)
    with progress_bar() as progress:
        lesson = learn_basis(Registry(folder), asked, progress=progress)
    lesson.save(out)
    emit(lesson.document())
    for reason, count in lesson.left_aside.items():
        say("", f"{count:>8} left aside: {reason}")
    say("", lesson.source)
    found = lesson.judgement
    if found.nats is None or found.error is None:
        say("", f"of one {found.left_out} alone nobody can tell whether it helps")
    else:
        word = {True: "it helps", False: "[bold red]it harms[/]", None: "whether it helps is not clear yet"}[
            found.helps
        ]
        say(
            f"{word}: ", f"{found.nats:+.1f} ± {found.error:.1f} nats a photo, each {found.left_out} left out in turn"
        )
    say("", f"basis: {out}")


@registry.command(epilog="Example: camssf registry export phones/ -o phones.parquet")
def export(
    folder: Folder,
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help=".parquet with everything, .csv without the curves.")
    ],
) -> None:
    """Write all results into one file."""
    from camssf.fleet.registry import Registry

    Registry(folder).export(out)
    say("", f"results: {out}")


def _document(kind: str) -> dict[str, Any]:
    return {"format": f"camssf-{kind}/1", "generator": {"name": "camssf", "version": __version__}}


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
