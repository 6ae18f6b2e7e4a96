"""The part of a result that can be carried, signed: whose camera, when, until when, made from what, and by whom.

A passport is a compact JWS (`jws.py`). Its payload has the form data/passport.schema.json and holds an excerpt of the
result (`excerpt.py`); the whole result.json stands outside, tied to it by its SHA-256.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, TypeAlias

from camssf import __version__
from camssf.documents.excerpt import excerpt
from camssf.documents.jws import advice, read_jws, sign_jws, verify_jws
from camssf.documents.report import check_document, parse_json
from camssf.documents.schema import BrokenError, check, schema
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.photo.unit import Unit, read_unit

Json: TypeAlias = dict[str, Any]

FORMAT, TYPE = "camssf-passport/1", "camssf-passport+jwt"
LARGEST_PASSPORT = 100_000
"""In bytes. joserfc takes tokens of 129,536 bytes unless its limits are raised."""
LARGEST_PRINTED = 4 * LARGEST_PASSPORT
"""In bytes: an excerpt with the passport that it comes from, as `camssf passport verify` prints it."""
LONGEST_DAYS = 36500
WHAT = "the passport"

_ADVICE = advice(WHAT)


@dataclass(frozen=True)
class Passport:
    """What is signed.

    Attributes:
        id: 32 hexadecimal digits, by chance.
        issued, begins, ends: UTC, whole seconds; it is valid from `begins` on, and no more at `ends`.
        unit: whose curves these are.
        captured: when the photo was taken, ISO 8601; "" where nobody said.
        chart_serial: of the chart; "" where nobody said.
        lamp_serials: of each shot's lamp, likewise.
        software: the version of camssf that wrote it.
        result_sha256: of the whole result's file, byte for byte.
        result: the excerpt of it: lamps, chart, curves, verdict, hashes of the inputs and of the model.
    """

    id: str
    issued: datetime
    begins: datetime
    ends: datetime
    unit: Unit
    captured: str
    chart_serial: str
    lamp_serials: tuple[str, ...]
    software: str
    result_sha256: str
    result: Json

    def claims(self) -> Json:
        """As plain data: the payload. `jti`, `iat`, `nbf` and `exp` as in RFC 7519, for any reader of JWT."""
        return {
            "format": FORMAT,
            "jti": self.id,
            "iat": int(self.issued.timestamp()),
            "nbf": int(self.begins.timestamp()),
            "exp": int(self.ends.timestamp()),
            "unit": asdict(self.unit),
            "captured": self.captured,
            "serials": {"chart": self.chart_serial, "lamps": list(self.lamp_serials)},
            "software": {"name": "camssf", "version": self.software},
            "result_sha256": self.result_sha256,
            "result": self.result,
        }


@dataclass(frozen=True)
class Said:
    """What the one who signs says beside the result.

    Attributes:
        unit: whose curves these are; make and model may be left to the result.
        captured, chart_serial, lamp_serials: as in `Passport`; no serials at all, or one a shot.
        days: how long it is valid.
        begins: from when on; now unless given.
    """

    unit: Unit = field(default_factory=Unit)
    captured: str = ""
    chart_serial: str = ""
    lamp_serials: tuple[str, ...] = ()
    days: float = 365.0
    begins: datetime | None = None


def draw_up(result: bytes, said: Said, *, photos: Sequence[Path | str] = (), now: datetime | None = None) -> Passport:
    """A passport of a result, not yet signed.

    Args:
        result: the bytes of result.json.
        said: what the result does not hold.
        photos: files that the result was made from, for what they say of the unit and of the time.
        now: the time of issue; the clock's unless given.

    Raises:
        InvalidArgument: the result is none, was refused, or what is said cannot be.
        UnreadableRaw: a photo cannot be read.
    """
    document = check_document(
        parse_json(result, "the result", "Give the result.json that camssf wrote."), "the result"
    )
    if "ssf" not in document:
        raise InvalidArgument("The result was refused: it has no curves to sign.", "Calibrate again.")
    said = _from_photos(said, photos, document)
    known = {each.name for each in fields(Unit)} & {name for name, value in document["camera"].items() if value}
    unit = _agreed(said.unit, Unit(**{name: document["camera"][name] for name in known}), "the result")
    lamps = said.lamp_serials or ("",) * len(document["shots"])
    if len(lamps) != len(document["shots"]):
        raise InvalidArgument(
            f"{len(lamps)} serials of lamps for {len(document['shots'])} shots.", "Give one a shot, in their order."
        )
    if not 0 < said.days <= LONGEST_DAYS:
        raise InvalidArgument(f"Valid for {said.days:g} days.", f"Give more than 0 and at most {LONGEST_DAYS}.")
    issued = (now or datetime.now(UTC)).astimezone(UTC).replace(microsecond=0)
    begins = (said.begins or issued).astimezone(UTC).replace(microsecond=0)
    try:
        ends = begins + max(timedelta(seconds=1), timedelta(days=said.days))
    except OverflowError:
        raise InvalidArgument("No calendar holds the day when it would end.", "Let it begin earlier.") from None
    return Passport(
        id=secrets.token_hex(16),
        issued=issued,
        begins=begins,
        ends=ends.replace(microsecond=0),
        unit=unit,
        captured=_captured(said.captured),
        chart_serial=said.chart_serial,
        lamp_serials=tuple(lamps),
        software=__version__,
        result_sha256=hashlib.sha256(result).hexdigest(),
        result=excerpt(document),
    )


def _from_photos(said: Said, photos: Sequence[Path | str], document: Json) -> Said:
    """What is said, and what the files say where nobody did; the two must agree."""
    shots = {shot["photo"]["sha256"] for shot in document["shots"]}
    for path in photos:
        taken = read_unit(path)
        if taken.sha256 not in shots:
            raise InvalidArgument(f"The result was not made from {path}.", "Give the very file, or leave it out.")
        said = replace(said, unit=_agreed(said.unit, taken.unit, str(path)), captured=said.captured or taken.time)
    return said


def _agreed(unit: Unit, other: Unit, source: str) -> Unit:
    if wrong := unit.differs(other):
        raise InvalidArgument(
            f"Another camera by what {source} says: {wrong[0]} is {getattr(other, wrong[0])!r} there, "
            f"not {getattr(unit, wrong[0])!r}.",
            "Name the unit that the photo was taken with.",
        )
    return unit.filled(other)


def _captured(text: str) -> str:
    try:
        return datetime.fromisoformat(text).isoformat() if text else ""
    except ValueError:
        raise InvalidArgument(f"{text!r} is not a time.", "Write ISO 8601, as 2026-11-22T10:30:00+01:00.") from None


# Signing


def sign(passport: Passport, key: Any) -> bytes:
    """The signed passport.

    Args:
        passport: of `draw_up`.
        key: of `keys.read_private`.

    Raises:
        InvalidArgument: it would be too large, or it breaks its form.
    """
    claims = passport.claims()
    try:
        _passport(claims)
    except PassportInvalid as error:  # what no verifier takes is not signed
        raise InvalidArgument(error.message, error.advice) from error
    signed = sign_jws(claims, TYPE, key)
    if len(signed) > LARGEST_PASSPORT:
        raise InvalidArgument(
            f"The passport would be larger than {LARGEST_PASSPORT} bytes.",
            "Sign a result of fewer shots.",
        )
    return signed


# Verifying


def verify(
    data: bytes,
    trusted: Mapping[str, Any],
    *,
    revoked: Collection[str] = (),
    now: datetime | None = None,
    result: bytes | None = None,
) -> Passport:
    """The passport, if it is one: whole, signed by a trusted key, in its form and time, not called back.

    Args:
        data: as received, or what `camssf passport verify` printed of it.
        trusted: of `keys.read_public`.
        revoked: of `revocations.read_revoked`.
        now: at what time; the clock's unless given.
        result: the bytes of the whole result.json, which it shall belong to.

    Raises:
        PassportInvalid: anything of it is not as it must be.
    """
    token, document = _token(data)
    claims, kid = verify_jws(token, TYPE, trusted, WHAT)
    passport = _passport(claims)
    _check_printed(document, token, passport)
    for name, what in ((passport.id, "The passport"), (kid, "The key that signed it")):
        if name in revoked:
            raise PassportInvalid(f"{what} was called back ({name}).", "Calibrate again.")
    at = now or datetime.now(UTC)
    if at < passport.begins:
        raise PassportInvalid(
            f"The passport is not valid before {passport.begins.isoformat()}.", "Wait, or look at the clock."
        )
    if at >= passport.ends:
        raise PassportInvalid(f"The passport ended at {passport.ends.isoformat()}.", "Calibrate again.")
    if result is not None:
        check_belongs(passport, result)
    return passport


def read(data: bytes) -> tuple[Passport, str]:
    """What a passport says, and the name of the key that it names. Nothing of it is verified.

    Raises:
        PassportInvalid: it has not the form of one.
    """
    token, document = _token(data)
    claims, kid = read_jws(token, TYPE, WHAT)
    passport = _passport(claims)
    _check_printed(document, token, passport)
    return passport, kid


def check_belongs(passport: Passport, result: bytes) -> None:
    """Raise unless the passport is of that result: its very bytes, and the excerpt is what they hold.

    Raises:
        PassportInvalid: it is of another one, or its excerpt says something else.
    """
    if hashlib.sha256(result).hexdigest() != passport.result_sha256:
        raise PassportInvalid("The passport is of another result.", "Give the very file that was signed.")
    try:
        held = excerpt(check_document(parse_json(result, "the result", _ADVICE), "the result"))
    except InvalidArgument as error:
        raise PassportInvalid("The result that was signed is not in the form of one.", _ADVICE) from error
    if held != passport.result:
        raise PassportInvalid("The passport's excerpt is not what the signed result holds.", _ADVICE)


def as_document(token: bytes, passport: Passport) -> Json:
    """A verified passport as a document: its excerpt as a result, and the passport itself, so that it verifies again.

    Args:
        token: the passport, or what was printed of it.
        passport: what `verify` found in it.
    """
    return _printed(_token(token)[0], passport)


def check_printed(document: Json) -> None:
    """Check that what was printed of a passport is what the passport holds; its signature is not looked at.

    Raises:
        PassportInvalid: it is not.
    """
    token = document["excerpt"]["passport"].encode("utf-8", "replace")
    _check_printed(document, token, read(token)[0])


def _printed(token: bytes, passport: Passport) -> Json:
    return passport.result | {"excerpt": {"result_sha256": passport.result_sha256, "passport": token.decode()}}


def _check_printed(document: Json | None, token: bytes, passport: Passport) -> None:
    if document is not None and document != _printed(token, passport):
        raise PassportInvalid("The document round the passport is not what the passport holds.", _ADVICE)


def _token(data: bytes) -> tuple[bytes, Json | None]:
    """The JWS; and the document that it stood in, if it was printed in one."""
    document = None
    if data[:1] == b"{" and len(data) <= LARGEST_PRINTED:
        try:
            document = parse_json(data, "the document", _ADVICE)
            data = document["excerpt"]["passport"].encode("ascii")
        except (InvalidArgument, KeyError, TypeError, AttributeError, UnicodeEncodeError) as error:
            raise PassportInvalid(
                "This document holds no passport.", "Give the passport, or what `camssf passport verify` printed."
            ) from error
    if len(data) > LARGEST_PASSPORT:
        raise PassportInvalid(f"The passport is larger than {LARGEST_PASSPORT} bytes.", _ADVICE)
    return data, document


def _passport(claims: Json) -> Passport:
    """The payload, checked against data/passport.schema.json; claims that it does not name are left out."""
    for name in schema("passport")["required"]:
        _check_claim(claims, name)
    issued, begins, ends = (datetime.fromtimestamp(claims[name], UTC) for name in ("iat", "nbf", "exp"))
    unit, serials = claims["unit"], claims["serials"]
    return Passport(
        id=claims["jti"],
        issued=issued,
        begins=begins,
        ends=ends,
        unit=Unit(**{each.name: unit[each.name] for each in fields(Unit)}),
        captured=claims["captured"],
        chart_serial=serials["chart"],
        lamp_serials=tuple(serials["lamps"]),
        software=claims["software"]["version"],
        result_sha256=claims["result_sha256"],
        result=_known(claims["result"]),
    )


def _known(result: Any) -> Any:
    """Without the members that a later release may have added."""
    names = schema("result")["properties"]
    return {name: value for name, value in result.items() if name in names} if isinstance(result, dict) else result


def _check_claim(claims: Json, name: str) -> None:
    value: Any = _known(claims.get(name)) if name == "result" else claims.get(name)
    if name == "result" and isinstance(value, dict):
        verdict = value.get("verdict")
        if isinstance(verdict, dict) and verdict.get("status") == "refused":
            raise PassportInvalid("The passport's result was refused: it is no calibration.", "Calibrate again.")
    try:
        if name not in claims:
            raise BrokenError("", "is missing")
        check(value, "passport", name)
        if name in ("iat", "nbf", "exp") and not isinstance(value, int):  # 1.0 is a whole number to a schema
            raise BrokenError("", "must be written without a fraction")
        if name == "result":
            excerpt_of = {"result_sha256": claims["result_sha256"], "passport": ""}
            check_document(value | {"excerpt": excerpt_of}, "the result", excerpt=True)
    except (BrokenError, InvalidArgument) as error:
        why = error.message if isinstance(error, InvalidArgument) else f"{name}{error.args[0]} {error.args[1]}."
        raise PassportInvalid(
            f"The passport's {name} is missing or not as it must be.", f"{why} {_ADVICE}"
        ) from error
