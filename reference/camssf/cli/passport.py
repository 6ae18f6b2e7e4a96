"""Signed results: camssf passport key, sign, verify, show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from camssf.cli.options import CameraId, Captured, Document, Lens
from camssf.cli.reading import given_paths, parse_time, read_bytes, spare
from camssf.cli.terminal import emit, say
from camssf.errors import InvalidArgument

if TYPE_CHECKING:
    from camssf.documents.passport import Passport

passport = typer.Typer(
    name="passport",
    help="Sign a result, with the unit, the time and how long it is valid; verify it anywhere, offline.",
    short_help="Sign a result; verify it offline.",
    epilog="Example: camssf passport sign result.json --key passport-key.pem -o camera.jws",
    no_args_is_help=True,
    rich_markup_mode=None,
)

Received: TypeAlias = Annotated[str, typer.Argument(metavar="JWS", help="A passport: a file, or - for stdin.")]
Passphrase: TypeAlias = Annotated[
    Path | None,
    typer.Option(metavar="FILE", show_default=False, help="File whose first line is the private key's passphrase."),
]


@passport.command(epilog="Example: camssf passport key -o keys/")
def key(
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FOLDER", help="Where the two files go.")],
    passphrase: Passphrase = None,
) -> None:
    """Make a pair of keys.

    passport-key.pem signs and stays with you; passport-key.pub.pem verifies and is for everybody. A key is never
    replaced.
    """
    from camssf.documents.keys import PRIVATE, PUBLIC, make_key

    name = make_key(out, _passphrase(passphrase))
    say("", f"key {name}")
    say("", f"signs: {out / PRIVATE}; verifies: {out / PUBLIC}")


@passport.command(
    epilog="Example: camssf passport sign result.json --key passport-key.pem --photo chart.dng -o camera.jws"
)
def sign(
    result: Document,
    key: Annotated[Path, typer.Option(metavar="PEM", help="The private key.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="Where the passport goes.")],
    passphrase: Passphrase = None,
    photo: Annotated[
        list[str] | None,
        typer.Option(
            metavar="DNG",
            show_default=False,
            help="A photo that the result was made from: its file may tell serial, lens and time.",
        ),
    ] = None,
    serial: Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="Of the camera or phone.")] = "",
    camera_id: CameraId = "",
    lens: Lens = "",
    captured: Captured = "",
    chart_serial: Annotated[str, typer.Option(metavar="TEXT", show_default=False, help="Of the chart.")] = "",
    lamp_serial: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", show_default=False, help="Of a shot's lamp; in the shots' order."),
    ] = None,
    days: Annotated[float, typer.Option(help="How long it is valid.")] = 365.0,
    begins: Annotated[
        str | None, typer.Option("--from", metavar="TIME", show_default="now", help="From when on, ISO 8601.")
    ] = None,
) -> None:
    """Sign a result."""
    from camssf.documents.keys import read_private
    from camssf.documents.passport import Said, draw_up
    from camssf.documents.passport import sign as signed
    from camssf.documents.report import LARGEST_DOCUMENT
    from camssf.files import write_file
    from camssf.photo.unit import Unit

    data = read_bytes(result, LARGEST_DOCUMENT)
    said = Said(
        unit=Unit(serial=serial, camera_id=camera_id, lens=lens),
        captured=captured,
        chart_serial=chart_serial,
        lamp_serials=tuple(lamp_serial or ()),
        days=days,
        begins=parse_time(begins),
    )
    found = draw_up(data, said, photos=given_paths("--photo", photo or []))
    signature = signed(found, read_private(key, _passphrase(passphrase)))
    write_file(spare(out, result, key, *(photo or ())), signature)
    _tell(found)
    say("", f"passport: {out}")


@passport.command(epilog="Example: camssf passport verify camera.jws --key passport-key.pub.pem > result.json")
def verify(
    received: Received,
    key: Annotated[list[Path], typer.Option(metavar="PEM", help="A public key that is trusted; may be repeated.")],
    revoked: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", show_default=False, help="What was called back: ids of passports or keys, one a line."
        ),
    ] = None,
    at: Annotated[
        str | None, typer.Option(metavar="TIME", show_default="now", help="At what time, ISO 8601.")
    ] = None,
    result: Annotated[
        str | None, typer.Option(metavar="JSON", show_default=False, help="The result.json that it shall belong to.")
    ] = None,
) -> None:
    """Verify a passport, offline.

    The result goes to stdout if all is well, and nothing if not: exit status 10.
    """
    from camssf.documents.keys import read_public, read_revoked
    from camssf.documents.passport import LARGEST_PASSPORT
    from camssf.documents.passport import verify as verified
    from camssf.documents.report import LARGEST_DOCUMENT

    found = verified(
        read_bytes(received, LARGEST_PASSPORT),
        read_public(key),
        revoked=frozenset() if revoked is None else read_revoked(revoked),
        now=parse_time(at),
        result=None if result is None else read_bytes(result, LARGEST_DOCUMENT),
    )
    emit(found.result)
    _tell(found)
    say("[green]verified[/]", "")


@passport.command(epilog="Example: camssf passport show camera.jws")
def show(received: Received) -> None:
    """Say what stands in a passport, without its result.

    Nothing is verified.
    """
    from camssf.documents.passport import LARGEST_PASSPORT, read

    found, name = read(read_bytes(received, LARGEST_PASSPORT))
    claims = found.claims()
    verdict = found.result.get("verdict")
    emit(
        {"key": name, "verified": False, "id": found.id}
        | {when: getattr(found, when).isoformat() for when in ("issued", "begins", "ends")}
        | {name: value for name, value in claims.items() if name not in ("jti", "iat", "nbf", "exp", "result")}
        | {"verdict": verdict.get("status") if isinstance(verdict, dict) else None}
    )
    say("[yellow]not verified[/]", ": anybody may have written this; see `camssf passport verify`")


def _passphrase(path: Path | None) -> bytes | None:
    if path is None:
        return None
    line = read_bytes(str(path), 4096).splitlines()[0]
    if not line:
        raise InvalidArgument(f"{path} has nothing in its first line.", "Write the passphrase there.")
    return line


def _tell(found: Passport) -> None:
    """Who and when, in words."""
    unit = found.unit
    words = [unit.make, unit.model, unit.camera_id, unit.lens, unit.serial and f"serial {unit.serial}"]
    verdict = found.result.get("verdict")
    status = verdict.get("status") if isinstance(verdict, dict) else None
    say("", f"{' '.join(filter(None, words)) or 'camera'}: {status}; passport {found.id}")
    say("", f"valid from {found.begins.isoformat()} to {found.ends.isoformat()}")
