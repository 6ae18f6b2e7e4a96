"""Signs and verifies a compact JWS (RFC 7515) with ES256 (RFC 7518): `header.payload.signature` and nothing else.

The received bytes are verified without being decoded and written again, so no canonical form of JSON is needed.
Header and payload have one spelling. From a signature (r, s) anybody can make a second valid one, (r, n - s), so a
signature's bytes are not an identifier.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Mapping
from typing import Any, TypeAlias

from camssf.documents.forms import parse_json
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.files import readable
from camssf_fleet.passport.keys import KEY_ID, key_name, need_cryptography, unpadded

Json: TypeAlias = dict[str, Any]

ALGORITHM = "ES256"
ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551
"""n of P-256, the order of the curve's generator (FIPS 186-5)."""

_HEADER = 1024
"""Largest length of an encoded header, in characters."""
_ADVICE = "Ask the one who signed it for {what} as it was written; trust nothing in this one."


def sign_jws(payload: Json, kind: str, key: Any) -> bytes:
    """Sign a payload.

    Args:
        payload: plain data.
        kind: the header's `typ`.
        key: from `keys.read_private`.
    """
    need_cryptography()
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature
    from cryptography.hazmat.primitives.hashes import SHA256

    header = {"alg": ALGORITHM, "kid": key_name(key.public_key()), "typ": kind}
    signed = b".".join(unpadded(_json(part)).encode() for part in (header, payload))
    r, s = decode_dss_signature(key.sign(signed, ec.ECDSA(SHA256())))
    return signed + b"." + unpadded(r.to_bytes(32, "big") + s.to_bytes(32, "big")).encode()


def verify_jws(data: bytes, kind: str, trusted: Mapping[str, Any], what: str) -> tuple[Json, str]:
    """Verify a signed document; return its payload and the name of the trusted key that signed it.

    Args:
        data: as received.
        kind: the header's `typ`.
        trusted: from `keys.read_public`.
        what: its name in messages, for example "the passport".

    Raises:
        PassportInvalid: the form is wrong, or no trusted key signed these bytes.
    """
    need_cryptography()
    parts, kid = _parts(data, kind, what)
    key = trusted.get(kid)
    if key is None:
        raise PassportInvalid(
            f"{_begin(what)} is signed by the key {kid}, which is not trusted.",
            "Give the signer's public key if you trust the signer.",
        )
    _check_signature(key, data, parts[2], what)
    return _object(parts[1], "payload", what), kid


def read_jws(data: bytes, kind: str, what: str) -> tuple[Json, str]:
    """Read the payload and the key's name from the header, without verifying anything.

    Raises:
        PassportInvalid: the form is wrong.
    """
    parts, kid = _parts(data, kind, what)
    return _object(parts[1], "payload", what), kid


def advice(what: str) -> str:
    """The advice for a signed document that was changed or damaged."""
    return _ADVICE.format(what=what)


def _begin(what: str) -> str:
    return what[:1].upper() + what[1:]


def _json(value: Json) -> bytes:
    return readable(json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))).encode()


def _parts(data: bytes, kind: str, what: str) -> tuple[list[bytes], str]:
    """Return the decoded header, payload and signature, and the key's name."""
    texts = data.split(b".", 3)
    if len(texts) != 3 or len(texts[0]) > _HEADER:
        raise PassportInvalid(
            f"It does not have the form of {what.replace('the ', 'a ', 1)}, three parts with a dot between them.",
            advice(what),
        )
    parts = [_decode(text, what) for text in texts]
    header = _object(parts[0], "header", what)
    kid = header.get("kid")
    if not (isinstance(kid, str) and KEY_ID.fullmatch(kid)):
        raise PassportInvalid(f"{_begin(what)} names no key.", advice(what))
    if header != {"alg": ALGORITHM, "kid": kid, "typ": kind}:  # rejects `none`, HS256, crit, jwk and another typ
        raise PassportInvalid(f"{_begin(what)}'s header does not name {ALGORITHM} and {kind}.", advice(what))
    if len(parts[2]) != 64:
        raise PassportInvalid(f"{_begin(what)}'s signature has {len(parts[2])} bytes, not 64.", advice(what))
    return parts, kid


def _decode(text: bytes, what: str) -> bytes:
    """Decode strict base64url; the result is encoded again, because Python's decoder skips unknown characters."""
    try:
        part = base64.urlsafe_b64decode(text + b"=" * (-len(text) % 4))
    except (ValueError, binascii.Error):
        part = b""
    if not part or unpadded(part).encode() != text:
        raise PassportInvalid(f"A part of {what} is not base64url.", advice(what))
    return part


def _object(data: bytes, name: str, what: str) -> Json:
    try:
        found = parse_json(data, name, advice(what))
    except InvalidArgument as error:
        raise PassportInvalid(f"{_begin(what)}'s {name} is not valid JSON.", advice(what)) from error
    if not isinstance(found, dict):
        raise PassportInvalid(f"{_begin(what)}'s {name} is not an object.", advice(what))
    return found


def _check_signature(key: Any, data: bytes, signature: bytes, what: str) -> None:
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.asymmetric.utils import encode_dss_signature
    from cryptography.hazmat.primitives.hashes import SHA256

    r, s = (int.from_bytes(half, "big") for half in (signature[:32], signature[32:]))
    if not (0 < r < ORDER and 0 < s < ORDER):
        raise PassportInvalid(f"{_begin(what)}'s signature is not a valid pair of numbers.", advice(what))
    try:
        key.verify(encode_dss_signature(r, s), data[: data.rindex(b".")], ec.ECDSA(SHA256()))
    except InvalidSignature:
        raise PassportInvalid(
            f"{_begin(what)}'s signature does not match: the content was changed.", advice(what)
        ) from None
