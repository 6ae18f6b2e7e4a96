"""Signs and verifies passports: a signed excerpt of a result with the camera unit, capture time and validity period.

A passport is a compact JWS (`jws.py`). Its payload has the form data/passport.schema.json and holds an excerpt of the
result (`excerpt.py`). The whole result.json stays outside; the passport holds its SHA-256.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, TypeAlias

from camssf.documents.excerpt import excerpt
from camssf.documents.jws import advice, read_jws, sign_jws, verify_jws
from camssf.documents.result_json import check_document, parse_json
from camssf.documents.schema import BrokenError, check, schema
from camssf.errors import InvalidArgument, PassportInvalid, UnitDiffers
from camssf.photo.read.unit import Unit, read_unit
from camssf.version import __version__

Json: TypeAlias = dict[str, Any]

FORMAT, TYPE = "camssf-passport/1", "camssf-passport+jwt"
LARGEST_PASSPORT = 100_000
"""In bytes. joserfc accepts tokens of up to 129,536 bytes by default."""
LARGEST_PRINTED = 4 * LARGEST_PASSPORT
"""In bytes: an excerpt with its passport, as `camssf passport verify` prints it."""
LONGEST_DAYS = 36500
WHAT = "the passport"
UNIT_OF_PHOTO = ("make", "model", "camera_id", "serial", "lens")
"""What makes a unit; zoom and aperture may differ between a calibration and a later photo."""

_ADVICE = advice(WHAT)


@dataclass(frozen=True)
class Passport:
    """The content of a passport.

    Attributes:
        id: 32 random hexadecimal digits.
        issued, begins, ends: UTC, whole seconds; valid from `begins` until just before `ends`.
        unit: the camera unit that the curves belong to.
        captured: when the photo was taken, ISO 8601; "" if unknown.
        chart_serial: serial number of the chart; "" if unknown.
        lamp_serials: serial number of each shot's lamp; "" if unknown.
        software: version of camssf that wrote it.
        result_sha256: SHA-256 of the whole result's file.
        result: the excerpt: lamps, chart, curves, verdict, hashes of the inputs and of the model.
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

    def document(self) -> Json:
        """The excerpt as a result document, for what takes a result, such as `camssf.colour.standard_colour`."""
        return self.result

    def check_photo(self, photo: Unit, name: str) -> None:
        """Refuse a photo of another unit. What the passport or the photo does not state is not compared.

        Args:
            photo: the unit that the photo's file states, from `read_unit`.
            name: of the photo, for the message.

        Raises:
            UnitDiffers: make, model, camera, serial number or lens differ.
        """
        stated = {each: getattr(photo, each) for each in UNIT_OF_PHOTO}
        if differ := self.unit.differs(Unit(**stated)):
            words = "; ".join(f"{each} {stated[each]!r} against {getattr(self.unit, each)!r}" for each in differ)
            raise UnitDiffers(
                f"{name} was taken by another unit than that of the passport: {words}.",
                "Take the photo with the unit of the passport, or give the passport of this unit.",
            )

    def claims(self) -> Json:
        """The payload as plain data; `jti`, `iat`, `nbf` and `exp` as in RFC 7519, for any reader of JWT."""
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
class PassportRequest:
    """What the signer states in addition to the result.

    Attributes:
        unit: the camera unit; empty make and model are taken from the result.
        captured, chart_serial, lamp_serials: as in `Passport`; `lamp_serials` is empty or has one entry per shot.
        days: validity period.
        begins: start of validity; default: now.
    """

    unit: Unit = field(default_factory=Unit)
    captured: str = ""
    chart_serial: str = ""
    lamp_serials: tuple[str, ...] = ()
    days: float = 365.0
    begins: datetime | None = None


def create_passport(
    result: bytes, request: PassportRequest, *, photos: Sequence[Path | str] = (), now: datetime | None = None
) -> Passport:
    """Create an unsigned passport of a result.

    Args:
        result: the bytes of result.json.
        request: what the signer states.
        photos: files that the result was made from; their tags give the unit and the time.
        now: time of issue; default: the system clock.

    Raises:
        InvalidArgument: the result is invalid or was refused, or a statement is impossible or contradicts the files.
        UnreadableRaw: a photo cannot be read.
    """
    document = check_document(
        parse_json(result, "the result", "Give the result.json that camssf wrote."), "the result"
    )
    if "ssf" not in document:
        raise InvalidArgument("The result was refused: it has no curves to sign.", "Calibrate again.")
    request = _from_photos(request, photos, document)
    known = {each.name for each in fields(Unit)} & {name for name, value in document["camera"].items() if value}
    unit = _agreed(request.unit, Unit(**{name: document["camera"][name] for name in known}), "the result")
    lamps = request.lamp_serials or ("",) * len(document["shots"])
    if len(lamps) != len(document["shots"]):
        raise InvalidArgument(
            f"{len(lamps)} serials of lamps for {len(document['shots'])} shots.", "Give one a shot, in their order."
        )
    if not 0 < request.days <= LONGEST_DAYS:
        raise InvalidArgument(f"Valid for {request.days:g} days.", f"Give more than 0 and at most {LONGEST_DAYS}.")
    issued = (now or datetime.now(UTC)).astimezone(UTC).replace(microsecond=0)
    begins = (request.begins or issued).astimezone(UTC).replace(microsecond=0)
    try:
        ends = begins + max(timedelta(seconds=1), timedelta(days=request.days))
    except OverflowError:
        raise InvalidArgument("The passport must end before the year 9999.", "Let it begin earlier.") from None
    return Passport(
        id=secrets.token_hex(16),
        issued=issued,
        begins=begins,
        ends=ends.replace(microsecond=0),
        unit=unit,
        captured=_captured(request.captured),
        chart_serial=request.chart_serial,
        lamp_serials=tuple(lamps),
        software=__version__,
        result_sha256=hashlib.sha256(result).hexdigest(),
        result=excerpt(document),
    )


def _from_photos(request: PassportRequest, photos: Sequence[Path | str], document: Json) -> PassportRequest:
    """Fill empty fields of the request from the photos' tags; stated fields must agree with them."""
    shots = {shot["photo"]["sha256"] for shot in document["shots"]}
    for path in photos:
        taken = read_unit(path)
        if taken.sha256 not in shots:
            raise InvalidArgument(f"The result was not made from {path}.", "Give the original file, or leave it out.")
        request = replace(
            request, unit=_agreed(request.unit, taken.unit, str(path)), captured=request.captured or taken.time
        )
    return request


def _agreed(unit: Unit, other: Unit, source: str) -> Unit:
    if wrong := unit.differs(other):
        raise InvalidArgument(
            f"{source} names another camera: {wrong[0]} is {getattr(other, wrong[0])!r} there, "
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
    """Sign a passport.

    Args:
        passport: from `create_passport`.
        key: from `keys.read_private`.

    Raises:
        InvalidArgument: it would be too large, or it does not follow the schema.
    """
    claims = passport.claims()
    try:
        _passport(claims)
    except PassportInvalid as error:  # sign nothing that a verifier would reject
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
    """Verify a passport: unchanged, signed by a trusted key, valid in form and time, not revoked.

    Args:
        data: as received, or as `camssf passport verify` printed it.
        trusted: from `keys.read_public`.
        revoked: from `revocations.read_revoked`.
        now: time of the check; default: the system clock.
        result: bytes of the whole result.json that the passport must belong to; None to skip this check.

    Raises:
        PassportInvalid: one of these checks fails.
    """
    token, document = _token(data)
    claims, kid = verify_jws(token, TYPE, trusted, WHAT)
    passport = _passport(claims)
    _check_printed(document, token, passport)
    for name, what in ((passport.id, "The passport"), (kid, "The key that signed it")):
        if name in revoked:
            raise PassportInvalid(f"{what} was revoked ({name}).", "Calibrate again.")
    at = now or datetime.now(UTC)
    if at < passport.begins:
        raise PassportInvalid(
            f"The passport is not valid before {passport.begins.isoformat()}.",
            "Wait, or check this computer's clock.",
        )
    if at >= passport.ends:
        raise PassportInvalid(f"The passport ended at {passport.ends.isoformat()}.", "Calibrate again.")
    if result is not None:
        check_belongs(passport, result)
    return passport


def read(data: bytes) -> tuple[Passport, str]:
    """Read a passport and the name of its key, without verifying anything.

    Raises:
        PassportInvalid: the form is wrong.
    """
    token, document = _token(data)
    claims, kid = read_jws(token, TYPE, WHAT)
    passport = _passport(claims)
    _check_printed(document, token, passport)
    return passport, kid


def check_belongs(passport: Passport, result: bytes) -> None:
    """Raise unless the passport belongs to that result: the SHA-256 of its bytes and the excerpt must match.

    Raises:
        PassportInvalid: the result is another one, or the excerpt differs.
    """
    if hashlib.sha256(result).hexdigest() != passport.result_sha256:
        raise PassportInvalid("The passport belongs to another result.", "Give the file that was signed.")
    try:
        held = excerpt(check_document(parse_json(result, "the result", _ADVICE), "the result"))
    except InvalidArgument as error:
        raise PassportInvalid("The result that was signed is not in the form of one.", _ADVICE) from error
    if held != passport.result:
        raise PassportInvalid("The passport's excerpt differs from the signed result.", _ADVICE)


def as_document(token: bytes, passport: Passport) -> Json:
    """A verified passport as a document: its excerpt as a result, with the passport inside for later verification.

    Args:
        token: the passport, or its printed document.
        passport: what `verify` returned for it.
    """
    return _printed(_token(token)[0], passport)


def check_printed(document: Json) -> None:
    """Check that a printed document matches the passport that it holds; the signature is not verified.

    Raises:
        PassportInvalid: they differ, or the passport's form is wrong.
    """
    token = document["excerpt"]["passport"].encode("utf-8", "replace")
    _check_printed(document, token, read(token)[0])


def _printed(token: bytes, passport: Passport) -> Json:
    return passport.result | {"excerpt": {"result_sha256": passport.result_sha256, "passport": token.decode()}}


def _check_printed(document: Json | None, token: bytes, passport: Passport) -> None:
    if document is not None and document != _printed(token, passport):
        raise PassportInvalid("The document that encloses the passport differs from the passport's content.", _ADVICE)


def _token(data: bytes) -> tuple[bytes, Json | None]:
    """The JWS, and the printed document that contained it, if any."""
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
    """The payload, checked against data/passport.schema.json; unknown claims are ignored."""
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
    """The result without members that a later release may have added."""
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
        if name in ("iat", "nbf", "exp") and not isinstance(value, int):  # a JSON Schema accepts 1.0 as an integer
            raise BrokenError("", "must be written without a fraction")
        if name == "result":
            excerpt_of = {"result_sha256": claims["result_sha256"], "passport": ""}
            check_document(value | {"excerpt": excerpt_of}, "the result", excerpt=True)
    except (BrokenError, InvalidArgument) as error:
        why = error.message if isinstance(error, InvalidArgument) else f"{name}{error.args[0]} {error.args[1]}."
        raise PassportInvalid(f"The passport's {name} is missing or invalid.", f"{why} {_ADVICE}") from error
