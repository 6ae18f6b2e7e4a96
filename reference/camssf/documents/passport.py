"""A result document, signed: whose camera, when, until when, made from what, and by whom.

A passport is a compact JWS (RFC 7515) with ES256 (RFC 7518): `header.payload.signature`, nothing before or after it.
What was received is what is verified: nothing is decoded and written anew in between, so no form of JSON has to be
agreed on. One passport has one spelling. The unused bits at the end of each part are 0, and of the two signatures
(r, s) and (r, n - s), which anybody can turn into each other, only the one with the smaller s counts; so no byte can
be changed without a key.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import re
import secrets
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, TypeAlias

from camssf import __version__
from camssf.documents.keys import KEY_ID, PASSPORT_ID, key_name, need_cryptography, unpadded
from camssf.documents.report import LARGEST_DOCUMENT, check_document, parse_json
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.files import readable
from camssf.photo.unit import Unit, read_unit

Json: TypeAlias = dict[str, Any]

FORMAT, TYPE, ALGORITHM = "camssf-passport/1", "camssf-passport+jwt", "ES256"
LARGEST_PASSPORT = 2 * LARGEST_DOCUMENT
LONGEST_DAYS = 36500
ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551
"""n of P-256: how many points the curve's generator makes (FIPS 186-5)."""

_HEADER = 1024
"""Characters that a header may have."""
_HASH = re.compile(r"[0-9a-f]{64}")
_ASK = "Ask the one who signed it for the passport as it was written; trust nothing in this one."


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
        result_sha256: of the result's file, byte for byte.
        result: the result document: lamps, chart, curves, verdict, hashes of the inputs and of the model.
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
        result=document,
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
        InvalidArgument: the result is too large.
    """
    need_cryptography()
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature
    from cryptography.hazmat.primitives.hashes import SHA256

    header = {"alg": ALGORITHM, "kid": key_name(key.public_key()), "typ": TYPE}
    signed = b".".join(unpadded(_json(part)).encode() for part in (header, passport.claims()))
    if len(signed) > LARGEST_PASSPORT - 128:
        raise InvalidArgument(
            f"The passport would be larger than {LARGEST_PASSPORT} bytes.", "Sign a smaller result."
        )
    r, s = decode_dss_signature(key.sign(signed, ec.ECDSA(SHA256())))
    s = min(s, ORDER - s)
    return signed + b"." + unpadded(r.to_bytes(32, "big") + s.to_bytes(32, "big")).encode()


def _json(value: Json) -> bytes:
    return readable(json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))).encode()


# Verifying


def verify(
    data: bytes,
    trusted: Mapping[str, Any],
    *,
    revoked: Collection[str] = (),
    now: datetime | None = None,
    result: bytes | None = None,
) -> Passport:
    """The passport, if it is one: whole, signed by a trusted key, in its time, not called back.

    Args:
        data: as received.
        trusted: of `keys.read_public`.
        revoked: of `keys.read_revoked`.
        now: at what time; the clock's unless given.
        result: the bytes of a result.json that it shall belong to.

    Raises:
        PassportInvalid: anything of it is not as it must be.
    """
    need_cryptography()
    parts, kid = _parts(data)
    key = trusted.get(kid)
    if key is None:
        raise PassportInvalid(
            f"The passport is signed by the key {kid}, which is not trusted.",
            "Give that signer's public key, if you trust him.",
        )
    _check_signature(key, data, parts[2])
    passport = _passport(parts[1])
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
    if result is not None and hashlib.sha256(result).hexdigest() != passport.result_sha256:
        raise PassportInvalid("The passport is of another result.", "Give the very file that was signed.")
    return passport


def read(data: bytes) -> tuple[Passport, str]:
    """What a passport says, and the name of the key that it says it is signed by. Nothing of it is verified.

    Raises:
        PassportInvalid: it has not the form of one.
    """
    parts, kid = _parts(data)
    return _passport(parts[1]), kid


def _parts(data: bytes) -> tuple[list[bytes], str]:
    """Header, payload and signature, decoded, and the key's name."""
    if len(data) > LARGEST_PASSPORT:
        raise PassportInvalid(f"The passport is larger than {LARGEST_PASSPORT} bytes.", _ASK)
    texts = data.split(b".")
    if len(texts) != 3 or len(texts[0]) > _HEADER:
        raise PassportInvalid("It has not the form of a passport, three parts with a dot between them.", _ASK)
    parts = [_decode(text) for text in texts]
    header = _object(parts[0], "header")
    kid = header.get("kid")
    if not (isinstance(kid, str) and KEY_ID.fullmatch(kid)):
        raise PassportInvalid("The passport names no key.", _ASK)
    if header != {"alg": ALGORITHM, "kid": kid, "typ": TYPE}:  # `none`, HS256, crit, jwk, a foreign typ: all the same
        raise PassportInvalid(f"The passport's header asks for something else than {ALGORITHM}.", _ASK)
    if len(parts[2]) != 64:
        raise PassportInvalid(f"The passport's signature has {len(parts[2])} bytes, not 64.", _ASK)
    return parts, kid


def _decode(text: bytes) -> bytes:
    """Base64url in its one spelling; Python's decoder leaves out what it does not know, so the way back tells."""
    try:
        part = base64.urlsafe_b64decode(text + b"=" * (-len(text) % 4))
    except (ValueError, binascii.Error):
        part = b""
    if not part or unpadded(part).encode() != text:
        raise PassportInvalid("A part of the passport is not base64url.", _ASK)
    return part


def _object(data: bytes, name: str) -> Json:
    try:
        found = parse_json(data, name, _ASK)
    except InvalidArgument as error:
        raise PassportInvalid(f"The passport's {name} is not sound JSON.", _ASK) from error
    if not isinstance(found, dict):
        raise PassportInvalid(f"The passport's {name} is no object.", _ASK)
    return found


def _check_signature(key: Any, data: bytes, signature: bytes) -> None:
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.asymmetric.utils import encode_dss_signature
    from cryptography.hazmat.primitives.hashes import SHA256

    r, s = (int.from_bytes(half, "big") for half in (signature[:32], signature[32:]))
    if not (0 < r < ORDER and 0 < s <= ORDER // 2):
        raise PassportInvalid("The passport's signature is out of its bounds.", _ASK)
    try:
        key.verify(encode_dss_signature(r, s), data[: data.rindex(b".")], ec.ECDSA(SHA256()))
    except InvalidSignature:
        raise PassportInvalid("The passport's signature does not fit: it was changed.", _ASK) from None


def _passport(payload: bytes) -> Passport:
    """The payload's form. Of the result only what says that it is one: it may be of another release of camssf."""
    claims = _object(payload, "payload")
    for name, right in _FORM.items():
        if name not in claims or not right(claims[name]):
            raise PassportInvalid(f"The passport's {name} is missing or not as it must be.", _ASK)
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
        result=claims["result"],
    )


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _second(value: Any) -> bool:
    """A whole number that a calendar holds."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 253402300800


def _size(value: Any) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool) and value > 0)


def _is_unit(value: Any) -> bool:
    kinds = {each.name: _size if each.name in ("focal_length", "aperture") else _text for each in fields(Unit)}
    return isinstance(value, dict) and all(name in value and right(value[name]) for name, right in kinds.items())


def _are_serials(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and _text(value.get("chart"))
        and isinstance(value.get("lamps"), list)
        and all(map(_text, value["lamps"]))
    )


def _is_result(value: Any) -> bool:
    return isinstance(value, dict) and str(value.get("format")).startswith("camssf-result/") and "ssf" in value


_FORM: dict[str, Callable[[Any], bool]] = {
    "format": lambda value: value == FORMAT,
    "jti": lambda value: _text(value) and PASSPORT_ID.fullmatch(value) is not None,
    "iat": _second,
    "nbf": _second,
    "exp": _second,
    "unit": _is_unit,
    "captured": _text,
    "serials": _are_serials,
    "software": lambda value: isinstance(value, dict) and _text(value.get("version")),
    "result_sha256": lambda value: _text(value) and _HASH.fullmatch(value) is not None,
    "result": _is_result,
}
