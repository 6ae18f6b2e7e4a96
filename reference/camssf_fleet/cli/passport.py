"""Commands for signed results: camssf passport key, sign, issue, verify, revoke, show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from camssf.cli.options import Command, Document, Group, OutFolder, Revoked
from camssf.cli.reading import check_captured, given_paths, read_bytes, spare
from camssf.cli.terminal import emit, say
from camssf.errors import InvalidArgument, PassportInvalid

if TYPE_CHECKING:
    from camssf_fleet.passport.document import Passport

passport = Group(
    name="passport",
    help="Sign a result, with the unit, the time and how long it is valid; verify it anywhere, offline.",
    short_help="Sign a result; verify it offline.",
    epilog="Example: camssf passport sign result.json --key passport-key.pem -o camera.jws",
    no_args_is_help=True,
    rich_markup_mode=None,
)


def _option(metavar: str, text: str) -> Any:
    return typer.Option(metavar=metavar, show_default=False, help=text)


Received: TypeAlias = Annotated[str, typer.Argument(metavar="JWS", help="A passport: a file, or - for stdin.")]
Private: TypeAlias = Annotated[Path, _option("PEM", "The private key; only its owner may have access to the file.")]
Captured: TypeAlias = Annotated[str, _option("TIME", "When the photo was taken, ISO 8601.")]


@passport.callback()
def _passport(
    ctx: typer.Context,
    passphrase: Annotated[
        Path | None, _option("FILE", "File whose first line is the private key's passphrase.")
    ] = None,
) -> None:
    ctx.obj = passphrase


@passport.command(epilog="Example: camssf passport key -o keys/")
def key(ctx: typer.Context, out: OutFolder) -> None:
    """Make a pair of keys.

    passport-key.pem signs and stays with you; passport-key.pub.pem verifies and is for everybody. A key is never
    replaced.
    """
    from camssf_fleet.passport.keys import PRIVATE, PUBLIC, make_key

    name = make_key(out, _passphrase(ctx))
    say("", f"key {name}")
    say("", f"signs: {out / PRIVATE}; verifies: {out / PUBLIC}")


@passport.command(
    epilog="Example: camssf passport sign result.json --key passport-key.pem --photo chart.dng -o camera.jws"
)
def sign(
    ctx: typer.Context,
    result: Document,
    key: Private,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="Where the passport goes.")],
    photo: Annotated[
        list[str] | None,
        _option("DNG", "A photo of the result; serial number, lens and time are read from its file."),
    ] = None,
    serial: Annotated[str, _option("TEXT", "Serial number of the camera or phone.")] = "",
    captured: Captured = "",
    chart_serial: Annotated[str, _option("TEXT", "Serial number of the chart.")] = "",
    lamp_serial: Annotated[
        list[str] | None, _option("TEXT", "Serial number of a shot's lamp; in the shots' order.")
    ] = None,
    days: Annotated[float, typer.Option(help="How long it is valid.")] = 365.0,
) -> None:
    """Sign a result.

    The passport holds an excerpt: curves, bands and verdict, not the single patches. Send the result.json along for
    whoever needs all of it; its SHA-256 is signed.
    """
    from camssf.documents.forms import LARGEST
    from camssf.files import write_file
    from camssf.photo.read.unit import Unit
    from camssf_fleet.passport.document import PassportRequest, create_passport
    from camssf_fleet.passport.document import sign as signed
    from camssf_fleet.passport.keys import read_private

    check_captured(captured)
    data = read_bytes(result, LARGEST)
    request = PassportRequest(Unit(serial=serial), captured, chart_serial, tuple(lamp_serial or ()), days)
    content = create_passport(data, request, photos=given_paths(photo or []))
    token = signed(content, read_private(key, _passphrase(ctx)))
    write_file(spare(out, result, key, *(photo or ())), token)
    _summarise(content)
    say("", f"passport: {out}")


@passport.command(epilog="Example: camssf passport issue phones/ --key passport-key.pem -o passports/")
def issue(
    ctx: typer.Context,
    registry: Annotated[str, typer.Argument(metavar="REGISTRY", help="The registry's folder or URL.")],
    key: Private,
    out: OutFolder,
    days: Annotated[float, typer.Option(help="How long they are valid.")] = 365.0,
    renew: Annotated[float, typer.Option(min=0.0, help="Renew a passport that ends within so many days.")] = 30.0,
) -> None:
    """Sign the newest accepted result of each unit in a registry.

    Skips units whose passport is still valid. The result.json must be where the registry says. Each file is named by
    the unit's serial number and the passport's id; the registry notes id and end.
    """
    from camssf.cli.terminal import progress_bar

    with progress_bar() as progress:
        from camssf_fleet.compare import many
        from camssf_fleet.passport.keys import read_private
        from camssf_fleet.passports import issue_passports
        from camssf_fleet.registry import Registry

        issued = issue_passports(
            Registry(registry), read_private(key, _passphrase(ctx)), out, days=days, renew=renew, tell=progress
        )
    for name, reason in issued.left_out:
        say("[yellow]left out[/]: ", f"{name}: {reason}")
    say("", f"{many(len(issued.issued), 'passport')} in {out}, {issued.valid} still valid")


@passport.command(epilog="Example: camssf passport verify camera.jws --key passport-key.pub.pem > result.json")
def verify(
    received: Received,
    key: Annotated[list[Path], typer.Option(metavar="PEM", help="A trusted public key; may be repeated.")],
    revoked: Revoked = None,
    result: Annotated[str | None, _option("JSON", "The result.json that the passport must belong to.")] = None,
) -> None:
    """Verify a passport, offline.

    The excerpt of the result goes to stdout if all is well, and nothing if not: exit status 10. It holds the
    passport, so what was printed can be verified again.
    """
    from camssf.documents.forms import LARGEST, to_plain
    from camssf_fleet.passport.document import as_printed
    from camssf_fleet.passport.document import verify as verified
    from camssf_fleet.passport.keys import read_public
    from camssf_fleet.passport.received import read_list, read_received

    data, trusted = read_received(received), read_public(key)
    whole = None if result is None else read_bytes(result, LARGEST)
    content = verified(data, trusted, revoked=read_list(revoked, trusted), result=whole)
    emit(to_plain(as_printed(data, content)))
    _summarise(content)
    say("[green]verified[/]", "" if result is None else f", and {result} is the result that was signed")
    if result is None:
        say("", f"the whole result was not checked: its SHA-256 is {content.result_sha256}; give it by --result")


class _Names(Command):
    """One key in 64 has a name that begins with a hyphen; it is an argument all the same."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        from camssf_fleet.passport.keys import KEY_ID

        names = [word for word in args if word.startswith("-") and KEY_ID.fullmatch(word)]
        rest = [word for word in args if word not in names]
        return super().parse_args(ctx, [*rest, "--", *names] if names and "--" not in rest else args)


@passport.command(cls=_Names, epilog="Example: camssf passport revoke ID --key passport-key.pem -o revoked.jws")
def revoke(
    ctx: typer.Context,
    key: Private,
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help="The signed list; one that exists is extended.")
    ],
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME|JWS...", help="Passports, by id or file, or names of keys, which revokes all they signed."
        ),
    ] = None,
    days: Annotated[float, typer.Option(help="Validity of the list; it must be renewed before it ends.")] = 30.0,
) -> None:
    """Sign the revocation list, or extend it.

    One that exists must be signed by this key. Without a name it is only dated anew.
    """
    from camssf.files import write_file
    from camssf_fleet.passport.keys import key_name, read_private
    from camssf_fleet.passport.revocations import LIST, names_of, sign_revocations

    signer = read_private(key, _passphrase(ctx))
    public = signer.public_key()
    spare(out, key)
    revoked = {_name_of(name) for name in names or ()}
    if out.exists():
        revoked |= names_of(read_bytes(str(out), LIST.largest, PassportInvalid), {key_name(public): public})
    elif not revoked:
        raise InvalidArgument("Nothing to revoke was named.", "Name passports or keys, or a list to renew by -o.")
    write_file(out, sign_revocations(revoked, signer, days=days))
    say("", f"{len(revoked)} revoked, list valid for {days:g} days: {out}")


@passport.command(epilog="Example: camssf passport show camera.jws")
def show(received: Received) -> None:
    """Say what stands in a passport, without its result.

    Nothing is verified.
    """
    from camssf.documents.forms import to_plain
    from camssf_fleet.passport.document import read
    from camssf_fleet.passport.received import read_received

    content, key = read(read_received(received))
    claims = to_plain(content.claims())
    emit(
        {"key": key, "verified": False, "id": content.id}
        | {time: getattr(content, time).isoformat() for time in ("issued", "begins", "ends")}
        | {name: value for name, value in claims.items() if name not in ("jti", "iat", "nbf", "exp", "result")}
        | {"verdict": content.result.verdict.status}
    )
    say("[yellow]not verified[/]", ": anybody may have written this; see `camssf passport verify`")


def _name_of(text: str) -> str:
    """The id of the passport in a file, or the text itself."""
    from camssf_fleet.passport.document import read
    from camssf_fleet.passport.received import read_received

    return read(read_received(text))[0].id if Path(text).suffix in (".jws", ".json") else text


def _passphrase(ctx: typer.Context) -> bytes | None:
    path: Path | None = ctx.obj
    if path is None:
        return None
    line = read_bytes(str(path), 4096).splitlines()[0]
    if not line:
        raise InvalidArgument(f"{path} has an empty first line.", "Write the passphrase there.")
    return line


def _summarise(content: Passport) -> None:
    """Print the unit, the status and the time of validity."""
    unit = content.unit
    parts = [unit.make, unit.model, unit.camera_id, unit.lens, unit.serial and f"serial {unit.serial}"]
    status = content.result.verdict.status
    say("", f"{' '.join(filter(None, parts)) or 'camera'}: {status}; passport {content.id}")
    say("", f"valid from {content.begins.isoformat()} to {content.ends.isoformat()}")
