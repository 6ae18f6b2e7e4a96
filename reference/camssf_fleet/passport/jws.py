"""Signs and verifies a compact JWS (RFC 7515) with ES256 (RFC 7518) by joserfc: `header.payload.signature` alone.

The received bytes are verified without being decoded and written again, so no canonical form of JSON is needed.
Header and payload have one spelling. From a signature (r, s) anybody can make a second valid one, (r, n - s), so a
signature's bytes are not an identifier.

joserfc 1.8 alone accepts more than a passport may be, so `_open` compares the whole header first. It accepts another
`typ` or `kid`, or none; `jwk`, `jku`, `x5u`, `cty`, `b64`, and a `crit` of known names; a key twice in one object; a
byte order mark and UTF-16; an empty payload. A list or a text as header makes it raise TypeError. It opens no
connection and writes no log. Unless told otherwise it reads an encoded header of 512 bytes and payload of 128,000.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, TypeAlias

from camssf.documents.forms import parse_json
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.files import readable
from camssf_fleet.passport.keys import KEY_ID, key_name, need_libraries

Json: TypeAlias = dict[str, Any]

ALGORITHM = "ES256"
ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551
"""n of P-256, the order of the curve's generator (FIPS 186-5)."""
LARGEST_HEADER = 1024
"""Characters of an encoded header."""


@dataclass(frozen=True)
class SignedKind:
    """A kind of signed document.

    Attributes:
        typ: the header's `typ`.
        name: in messages.
        largest: in bytes.
        longest: most days of validity.
        smaller: the advice if it becomes too large.
    """

    typ: str
    name: str
    largest: int
    longest: int
    smaller: str

    def invalid(self, message: str, place: str = "") -> PassportInvalid:
        """The error for a changed or damaged document; its advice begins with `place`, where the fault is."""
        advice = f"Ask the one who signed it for the {self.name} as it was written; trust nothing in this one."
        return PassportInvalid(message, f"{place}{advice}")

    def validity(self, days: float) -> timedelta:
        """How long a document of this kind is valid, one second or more.

        Raises:
            InvalidArgument: `days` is not more than 0, or too long.
        """
        if not 0 < days <= self.longest:
            raise InvalidArgument(f"Valid for {days:g} days.", f"Give more than 0 and at most {self.longest}.")
        return max(timedelta(seconds=1), timedelta(days=days))


def sign_jws(payload: Json, kind: SignedKind, key: Any) -> bytes:
    """Sign a payload.

    Args:
        payload: plain data.
        kind: what is signed.
        key: from `keys.read_private`.

    Raises:
        InvalidArgument: it would be too large.
    """
    need_libraries()
    from joserfc import jws
    from joserfc.jwk import ECKey

    header = {"alg": ALGORITHM, "kid": key_name(key.public_key()), "typ": kind.typ}
    text = readable(json.dumps(payload, ensure_ascii=False, allow_nan=False, separators=(",", ":")))
    signed: bytes = jws.serialize_compact(header, text, ECKey.import_key(key), algorithms=[ALGORITHM]).encode()
    if len(signed) > kind.largest:
        raise InvalidArgument(f"The {kind.name} would be larger than {kind.largest} bytes.", kind.smaller)
    return signed


def verify_jws(data: bytes, kind: SignedKind, trusted: Mapping[str, Any]) -> tuple[Json, str]:
    """Verify a signed document; return its payload and the name of the trusted key that signed it.

    Args:
        data: as received.
        kind: what it must be.
        trusted: from `keys.read_public`.

    Raises:
        PassportInvalid: the form is wrong, or no trusted key signed these bytes.
    """
    need_libraries()
    from joserfc import jws
    from joserfc.errors import JoseError
    from joserfc.jwk import ECKey

    _, kid, signature = _open(data, kind)
    if kid not in trusted:
        raise PassportInvalid(
            f"The {kind.name} is signed by the key {kid}, which is not trusted.",
            "Give the signer's public key if you trust the signer.",
        )
    if not all(0 < int.from_bytes(half, "big") < ORDER for half in (signature[:32], signature[32:])):
        raise kind.invalid(f"The {kind.name}'s signature is not a valid pair of numbers.")
    registry = jws.JWSRegistry(algorithms=[ALGORITHM])
    registry.max_header_length, registry.max_payload_length = LARGEST_HEADER, kind.largest
    try:
        verified = jws.deserialize_compact(data, ECKey.import_key(trusted[kid]), registry=registry)
    except JoseError:
        raise kind.invalid(f"The {kind.name}'s signature does not match: the content was changed.") from None
    return _object(verified.payload, "payload", kind), kid


def read_jws(data: bytes, kind: SignedKind) -> tuple[Json, str]:
    """Read the payload and the key's name from the header, without verifying anything and without joserfc.

    Raises:
        PassportInvalid: the form is wrong.
    """
    payload, kid, _ = _open(data, kind)
    return _object(payload, "payload", kind), kid


def _open(data: bytes, kind: SignedKind) -> tuple[bytes, str, bytes]:
    """The decoded payload, the key's name and the signature of 64 bytes."""
    if len(data) > kind.largest:
        raise kind.invalid(f"The {kind.name} is larger than {kind.largest} bytes.")
    texts = data.split(b".", 3)
    if len(texts) != 3 or len(texts[0]) > LARGEST_HEADER:
        raise kind.invalid(f"It does not have the form of a {kind.name}, three parts with a dot between them.")
    encoded, payload, signature = (_decode(text, kind) for text in texts)
    header = _object(encoded, "header", kind)
    kid = header.get("kid")
    if not (isinstance(kid, str) and KEY_ID.fullmatch(kid)):
        raise kind.invalid(f"The {kind.name} names no key.")
    if header != {"alg": ALGORITHM, "kid": kid, "typ": kind.typ}:
        raise kind.invalid(f"The {kind.name}'s header does not name {ALGORITHM} and {kind.typ}.")
    if len(signature) != 64:
        raise kind.invalid(f"The {kind.name}'s signature has {len(signature)} bytes, not 64.")
    return payload, kid, signature


def _decode(text: bytes, kind: SignedKind) -> bytes:
    """Decode strict base64url; the bytes are encoded again, because Python's decoder skips unknown characters."""
    try:
        part = base64.urlsafe_b64decode(text + b"=" * (-len(text) % 4))
    except ValueError:
        part = b""
    if not part or base64.urlsafe_b64encode(part).rstrip(b"=") != text:
        raise kind.invalid(f"A part of the {kind.name} is not base64url.")
    return part


def _object(data: bytes, part: str, kind: SignedKind) -> Json:
    try:
        value = parse_json(data, part, "")
    except InvalidArgument as error:
        raise kind.invalid(f"The {kind.name}'s {part} is not valid JSON.") from error
    if not isinstance(value, dict):
        raise kind.invalid(f"The {kind.name}'s {part} is not an object.")
    return value
