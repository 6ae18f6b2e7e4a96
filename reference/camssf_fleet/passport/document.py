"""Signs and verifies passports: a signed excerpt of a result with the camera unit, capture time and validity period.

A passport is a compact JWS (`jws.py`). Its payload has the form `claims.Claims` and holds an excerpt of the result.
The whole result.json stays outside; the passport holds its SHA-256.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from camssf.documents import forms
from camssf.documents.document import ADVICE, Document
from camssf.documents.excerpt import LARGEST_PASSPORT, Excerpt, check_whole
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.messages import fail
from camssf.photo.read.unit import Unit, read_unit
from camssf.version import __version__
from camssf_fleet.passport.claims import FORMAT, PASSPORT, Claims, Serials, Software, StatedUnit, read_claims
from camssf_fleet.passport.excerpt import excerpt_of, printed, same_named
from camssf_fleet.passport.jws import read_jws, sign_jws, verify_jws

LARGEST_PRINTED = 4 * LARGEST_PASSPORT
"""In bytes: an excerpt with its passport, as `camssf passport verify` prints it."""
UNIT_OF_PHOTO = ("make", "model", "camera_id", "serial", "lens")
"""What makes a unit; zoom and aperture may differ between a calibration and a later photo."""

_GIVE = "Give the passport, or what `camssf passport verify` printed."


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
    result: Excerpt

    def check_photo(self, photo: Unit, name: str) -> None:
        """Refuse a photo of another unit. What the passport or the photo does not state is not compared.

        Args:
            photo: the unit that the photo's file states, from `read_unit`.
            name: of the photo, for the message.

        Raises:
            UnitDiffers: make, model, camera, serial number or lens differ.
        """
        stated = Unit(**{part: getattr(photo, part) for part in UNIT_OF_PHOTO})
        if differing := self.unit.differs(stated):
            values = ((part, getattr(stated, part), getattr(self.unit, part)) for part in differing)
            pairs = "; ".join(
                f"{part} {of_photo!r} against {of_passport!r}" for part, of_photo, of_passport in values
            )
            raise fail("unit_differs.passport", file=name, differences=pairs)

    def claims(self) -> Claims:
        """The payload; `jti`, `iat`, `nbf` and `exp` as in RFC 7519, for any reader of JWT."""
        return Claims(
            format=FORMAT,
            jti=self.id,
            iat=int(self.issued.timestamp()),
            nbf=int(self.begins.timestamp()),
            exp=int(self.ends.timestamp()),
            unit=StatedUnit(**same_named(StatedUnit, self.unit)),
            captured=self.captured,
            serials=Serials(self.chart_serial, self.lamp_serials),
            software=Software(self.software, "camssf"),
            result_sha256=self.result_sha256,
            result=self.result,
        )


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
    plain = forms.parse_json(result, "the result", ADVICE)
    check_whole(plain, "the result")
    excerpt = excerpt_of(forms.from_plain(plain, Document, "the result", ADVICE))
    request = _from_photos(request, photos, excerpt)
    unit = _agreed(request.unit, Unit(excerpt.camera.make, excerpt.camera.model), "the result")
    lamps = request.lamp_serials or ("",) * len(excerpt.shots)
    if len(lamps) != len(excerpt.shots):
        raise InvalidArgument(
            f"{len(lamps)} serials of lamps for {len(excerpt.shots)} shots.", "Give one a shot, in their order."
        )
    issued = (now or datetime.now(UTC)).astimezone(UTC).replace(microsecond=0)
    begins = (request.begins or issued).astimezone(UTC).replace(microsecond=0)
    try:
        ends = begins + PASSPORT.validity(request.days)
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
        result=excerpt,
    )


def _from_photos(request: PassportRequest, photos: Sequence[Path | str], excerpt: Excerpt) -> PassportRequest:
    """Fill empty fields of the request from the photos' tags; stated fields must agree with them."""
    shots = {shot.photo.sha256 for shot in excerpt.shots}
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
    claims = forms.to_plain(passport.claims())
    try:
        read_claims(claims)
    except PassportInvalid as error:  # sign nothing that a verifier would reject
        raise InvalidArgument(error.message, error.advice) from error
    return sign_jws(claims, PASSPORT, key)


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
    passport, kid = _open(*_token(data), trusted)
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
    return _open(*_token(data))


def check_belongs(passport: Passport, result: bytes) -> None:
    """Raise unless the passport belongs to that result: the SHA-256 of its bytes and the excerpt must match.

    Raises:
        PassportInvalid: the result is another one, or the excerpt differs.
    """
    if hashlib.sha256(result).hexdigest() != passport.result_sha256:
        raise PassportInvalid("The passport belongs to another result.", "Give the file that was signed.")
    try:
        excerpt = excerpt_of(forms.read(result, Document, "the result", ADVICE))
    except InvalidArgument as error:
        raise PASSPORT.invalid("The result that was signed is not in the form of one.") from error
    if forms.to_plain(excerpt) != forms.to_plain(passport.result):
        raise PASSPORT.invalid("The passport's excerpt differs from the signed result.")


def as_printed(token: bytes, passport: Passport) -> Excerpt:
    """The excerpt of a verified passport, with the passport inside for later verification.

    Args:
        token: the passport, or its printed excerpt.
        passport: what `verify` returned for it.
    """
    return printed(passport.result, passport.result_sha256, _token(token)[0])


def passport_in(excerpt: Excerpt) -> Passport:
    """The passport that a printed excerpt holds and matches; the signature is not verified.

    Raises:
        PassportInvalid: there is none, they differ, or the passport's form is wrong.
    """
    return _open(_token_in(excerpt), excerpt)[0]


def _token(data: bytes) -> tuple[bytes, Excerpt | None]:
    """The JWS, and the printed excerpt that contained it, if any."""
    if data[:1] != b"{" or len(data) > LARGEST_PRINTED:
        return data, None
    try:
        shown = forms.read(data, Excerpt, "the document", "")
    except InvalidArgument as error:
        raise PassportInvalid("This document holds no passport.", _GIVE) from error
    return _token_in(shown), shown


def _token_in(shown: Excerpt) -> bytes:
    if shown.excerpt is None:
        raise PassportInvalid("This document holds no passport.", _GIVE)
    return shown.excerpt.passport.encode("utf-8", "replace")


def _open(token: bytes, shown: Excerpt | None, trusted: Mapping[str, Any] | None = None) -> tuple[Passport, str]:
    """The passport and the name of its key, verified if trusted keys are given; it must be what was printed of it."""
    payload, kid = read_jws(token, PASSPORT) if trusted is None else verify_jws(token, PASSPORT, trusted)
    passport = _passport(read_claims(payload))
    content = printed(passport.result, passport.result_sha256, token)
    if shown is not None and forms.to_plain(shown) != forms.to_plain(content):
        raise PASSPORT.invalid("The document that encloses the passport differs from the passport's content.")
    return passport, kid


def _passport(claims: Claims) -> Passport:
    issued, begins, ends = (datetime.fromtimestamp(second, UTC) for second in (claims.iat, claims.nbf, claims.exp))
    return Passport(
        id=claims.jti,
        issued=issued,
        begins=begins,
        ends=ends,
        unit=Unit(**vars(claims.unit)),
        captured=claims.captured,
        chart_serial=claims.serials.chart,
        lamp_serials=claims.serials.lamps,
        software=claims.software.version,
        result_sha256=claims.result_sha256,
        result=claims.result,
    )
