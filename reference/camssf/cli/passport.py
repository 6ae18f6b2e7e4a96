"""Commands for signed results: camssf passport key, sign, issue, verify, revoke, show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from camssf.cli.groups import Command, Group
from camssf.cli.options import CameraId, Captured, Document, Lens
from camssf.cli.reading import check_captured, given_paths, parse_time, read_bytes, read_list, read_received, spare
from camssf.cli.terminal import emit, say
from camssf.errors import InvalidArgument, PassportInvalid

if TYPE_CHECKING:
    from camssf.documents.passport import Passport

passport = Group(
    name="passport",
    help="Sign a result, with the unit, the time and how long it is valid; verify it anywhere, offline.",
    short_help="Sign a result; verify it offline.",
    epilog="Example: camssf passport sign result.json --key passport-key.pem -o camera.jws",
    no_args_is_help=True,
    rich_markup_mode=None,
)

Received: TypeAlias = Annotated[str, typer.Argument(metavar="JWS", help="A passport: a file, or - for stdin.")]
Private: TypeAlias = Annotated[
    Path, typer.Option(metavar="PEM", help="The private key; only its owner may have access to the file.")
]
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
    key: Private,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="Where the passport goes.")],
    passphrase: Passphrase = None,
    photo: Annotated[
        list[str] | None,
        typer.Option(
            metavar="DNG",
            show_default=False,
            help="A photo of the result; serial number, lens and time are read from its file.",
        ),
    ] = None,
    serial: Annotated[
        str, typer.Option(metavar="TEXT", show_default=False, help="Serial number of the camera or phone.")
    ] = "",
    camera_id: CameraId = "",
    lens: Lens = "",
    captured: Captured = "",
    chart_serial: Annotated[
        str, typer.Option(metavar="TEXT", show_default=False, help="Serial number of the chart.")
    ] = "",
    lamp_serial: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", show_default=False, help="Serial number of a shot's lamp; in the shots' order."),
    ] = None,
    days: Annotated[float, typer.Option(help="How long it is valid.")] = 365.0,
    begins: Annotated[
        str | None, typer.Option("--from", metavar="TIME", show_default="now", help="Earliest time, ISO 8601.")
    ] = None,
) -> None:
    """Sign a result.

    The passport holds an excerpt: curves, bands and verdict, not the single patches. Send the result.json along for
    whoever needs all of it; its SHA-256 is signed.
    """
    from camssf.documents.keys import read_private
    from camssf.documents.passport import PassportRequest, create_passport
    from camssf.documents.passport import sign as signed
    from camssf.documents.result_json import LARGEST_DOCUMENT
    from camssf.files import write_file
    from camssf.photo.read.unit import Unit

    check_captured(captured)
    data = read_bytes(result, LARGEST_DOCUMENT)
    said = PassportRequest(
        unit=Unit(serial=serial, camera_id=camera_id, lens=lens),
        captured=captured,
        chart_serial=chart_serial,
        lamp_serials=tuple(lamp_serial or ()),
        days=days,
        begins=parse_time(begins),
    )
    found = create_passport(data, said, photos=given_paths("--photo", photo or []))
    signature = signed(found, read_private(key, _passphrase(passphrase)))
    write_file(spare(out, result, key, *(photo or ())), signature)
    _tell(found)
    say("", f"passport: {out}")


@passport.command(epilog="Example: camssf passport issue phones/ --key passport-key.pem -o passports/")
def issue(
    registry: Annotated[str, typer.Argument(metavar="REGISTRY", help="The registry's folder or URL.")],
    key: Private,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FOLDER", help="Where the passports go.")],
    passphrase: Passphrase = None,
    days: Annotated[float, typer.Option(help="How long they are valid.")] = 365.0,
    renew: Annotated[float, typer.Option(min=0.0, help="Renew a passport that ends within so many days.")] = 30.0,
) -> None:
    """Sign the newest accepted result of each unit in a registry.

    Skips units whose passport is still valid. The result.json must be where the registry says. Each file is named by
    the unit's serial number and the passport's id; the registry notes id and end.
    """
    from camssf.cli.terminal import progress_bar
    from camssf.documents.keys import read_private
    from camssf.fleet.compare import many
    from camssf.fleet.passports import issue_passports
    from camssf.fleet.registry import Registry

    with progress_bar() as progress:
        found = issue_passports(
            Registry(registry), read_private(key, _passphrase(passphrase)), out, days=days, renew=renew, tell=progress
        )
    for name, reason in found.left_out:
        say("[yellow]left out[/]: ", f"{name}: {reason}")
    say("", f"{many(len(found.issued), 'passport')} in {out}, {found.valid} still valid")


@passport.command(epilog="Example: camssf passport verify camera.jws --key passport-key.pub.pem > result.json")
def verify(
    received: Received,
    key: Annotated[list[Path], typer.Option(metavar="PEM", help="A trusted public key; may be repeated.")],
    revoked: Annotated[
        Path | None,
        typer.Option(metavar="JWS", show_default=False, help="Signed list of revoked passports and keys."),
    ] = None,
    at: Annotated[
        str | None, typer.Option(metavar="TIME", show_default="now", help="At what time, ISO 8601.")
    ] = None,
    result: Annotated[
        str | None,
        typer.Option(metavar="JSON", show_default=False, help="The result.json that the passport must belong to."),
    ] = None,
) -> None:
    """Verify a passport, offline.

    The excerpt of the result goes to stdout if all is well, and nothing if not: exit status 10. It holds the
    passport, so what was printed can be verified again.
    """
    from camssf.documents.keys import read_public
    from camssf.documents.passport import as_document
    from camssf.documents.passport import verify as verified
    from camssf.documents.result_json import LARGEST_DOCUMENT

    data, trusted, now = read_received(received), read_public(key), parse_time(at)
    found = verified(
        data,
        trusted,
        revoked=read_list(revoked, trusted, now),
        now=now,
        result=None if result is None else read_bytes(result, LARGEST_DOCUMENT),
    )
    emit(as_document(data, found))
    _tell(found)
    say("[green]verified[/]", "" if result is None else f", and {result} is the result that was signed")
    if result is None:
        say("", f"the whole result was not checked: its SHA-256 is {found.result_sha256}; give it by --result")


class _Names(Command):
    """One key in 64 has a name that begins with a hyphen; it is an argument all the same."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        from camssf.documents.keys import KEY_ID

        names = [each for each in args if each.startswith("-") and KEY_ID.fullmatch(each)]
        rest = [each for each in args if each not in names]
        return super().parse_args(ctx, [*rest, "--", *names] if names and "--" not in rest else args)


@passport.command(
    cls=_Names, epilog="Example: camssf passport revoke ID --key passport-key.pem --list revoked.jws -o revoked.jws"
)
def revoke(
    key: Private,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="Where the signed list goes.")],
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME|JWS...", help="Passports, by id or file, or names of keys, which revokes all they signed."
        ),
    ] = None,
    old: Annotated[
        Path | None,
        typer.Option(
            "--list", metavar="JWS", show_default=False, help="The existing list, signed by this key, to renew."
        ),
    ] = None,
    passphrase: Passphrase = None,
    days: Annotated[float, typer.Option(help="Validity of the list; it must be renewed before it ends.")] = 30.0,
) -> None:
    """Sign the revocation list, or renew it.

    Without a name, --list is only dated anew.
    """
    from camssf.documents.keys import key_name, read_private
    from camssf.documents.revocations import LARGEST_LIST, names_of, sign_revocations
    from camssf.files import write_file

    signer = read_private(key, _passphrase(passphrase))
    public = signer.public_key()
    called = {_name_of(each) for each in names or ()}
    if old is not None:
        called |= names_of(read_bytes(str(old), LARGEST_LIST, PassportInvalid), {key_name(public): public})
    elif not called:
        raise InvalidArgument("Nothing to revoke was named.", "Name passports or keys, or renew a list by --list.")
    if out.exists() and (old is None or not out.samefile(old)):
        raise InvalidArgument(f"{out} exists already, and the names in it would be lost.", f"Renew it: --list {out}.")
    write_file(spare(out, key), sign_revocations(called, signer, days=days))
    say("", f"{len(called)} revoked, list valid for {days:g} days: {out}")


@passport.command(epilog="Example: camssf passport show camera.jws")
def show(received: Received) -> None:
    """Say what stands in a passport, without its result.

    Nothing is verified.
    """
    from camssf.documents.passport import read

    found, name = read(read_received(received))
    claims = found.claims()
    verdict = found.result.get("verdict")
    emit(
        {"key": name, "verified": False, "id": found.id}
        | {when: getattr(found, when).isoformat() for when in ("issued", "begins", "ends")}
        | {name: value for name, value in claims.items() if name not in ("jti", "iat", "nbf", "exp", "result")}
        | {"verdict": verdict.get("status") if isinstance(verdict, dict) else None}
    )
    say("[yellow]not verified[/]", ": anybody may have written this; see `camssf passport verify`")


def _name_of(text: str) -> str:
    """The id of the passport in a file, or the text itself."""
    from camssf.documents.passport import read

    return read(read_received(text))[0].id if Path(text).suffix in (".jws", ".json") else text


def _passphrase(path: Path | None) -> bytes | None:
    if path is None:
        return None
    line = read_bytes(str(path), 4096).splitlines()[0]
    if not line:
        raise InvalidArgument(f"{path} has an empty first line.", "Write the passphrase there.")
    return line


def _tell(found: Passport) -> None:
    """Print the unit, the status and the time of validity."""
    unit = found.unit
    words = [unit.make, unit.model, unit.camera_id, unit.lens, unit.serial and f"serial {unit.serial}"]
    verdict = found.result.get("verdict")
    status = verdict.get("status") if isinstance(verdict, dict) else None
    say("", f"{' '.join(filter(None, words)) or 'camera'}: {status}; passport {found.id}")
    say("", f"valid from {found.begins.isoformat()} to {found.ends.isoformat()}")
