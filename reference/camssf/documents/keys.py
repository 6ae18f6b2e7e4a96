"""Keys of passports, P-256, in PEM files, and the list of what was called back.

A key's name is its thumbprint (RFC 7638, SHA-256), the same in every language. Private keys are read, used and
forgotten: no message, no document and no log holds any of one.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from camssf.errors import InvalidArgument
from camssf.libraries import library

PRIVATE, PUBLIC = "passport-key.pem", "passport-key.pub.pem"
LARGEST_KEY = 64 * 1024
LARGEST_LIST = 16 * 2**20
PASSPORT_ID = re.compile(r"[0-9a-f]{32}")
KEY_ID = re.compile(r"[A-Za-z0-9_-]{43}")

_MAKE = "`camssf passport key -o FOLDER` makes a pair."


def need_cryptography() -> None:
    """See that `cryptography` is there."""
    library("cryptography", "Passports need", "passport")


def make_key(folder: Path | str, passphrase: bytes | None = None) -> str:
    """A new pair in `folder`: PRIVATE, for its owner's eyes only, and PUBLIC, for everybody.

    Args:
        folder: made where it is missing; a key that lies there is never replaced.
        passphrase: that the private key is locked with; None for none.

    Returns:
        The key's name.

    Raises:
        InvalidArgument: it cannot be written, or there is one already.
    """
    need_cryptography()
    from cryptography.hazmat.primitives import serialization as form
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    lock = form.BestAvailableEncryption(passphrase) if passphrase else form.NoEncryption()
    private = key.private_bytes(form.Encoding.PEM, form.PrivateFormat.PKCS8, lock)
    public = key.public_key().public_bytes(form.Encoding.PEM, form.PublicFormat.SubjectPublicKeyInfo)
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / PUBLIC).exists():
            raise FileExistsError(0, "there is a key already")
        _create(folder / PRIVATE, private, 0o600)
        _create(folder / PUBLIC, public, 0o644)
    except (OSError, ValueError) as error:
        raise InvalidArgument(
            f"No key can be made in {folder} ({getattr(error, 'strerror', None) or error}).",
            "Choose another folder; a key is never replaced.",
        ) from error
    return key_name(key.public_key())


def _create(path: Path, content: bytes, mode: int) -> None:
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), mode)
    with os.fdopen(handle, "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(handle)


def read_private(path: Path | str, passphrase: bytes | None = None) -> Any:
    """The key that signs.

    Raises:
        InvalidArgument: it is none, or it is locked and `passphrase` does not open it.
    """
    need_cryptography()
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    data = _bytes(path, LARGEST_KEY)
    try:
        key = load_pem_private_key(data, passphrase)
    except (TypeError, ValueError, UnsupportedAlgorithm):  # without its words: they speak of what lies in the file
        if b"ENCRYPTED" in data:
            raise InvalidArgument(f"{path} is locked.", "Give the file of its passphrase by --passphrase.") from None
        raise InvalidArgument(
            f"{path} is not a private key in PEM, or not locked, but a passphrase is given.", _MAKE
        ) from None
    if not isinstance(key, ec.EllipticCurvePrivateKey) or not isinstance(key.curve, ec.SECP256R1):
        raise InvalidArgument(f"{path} is not a key on the curve P-256.", _MAKE)
    return key


def read_public(paths: Iterable[Path | str]) -> dict[str, Any]:
    """The keys that are trusted, by their names.

    Raises:
        InvalidArgument: a file is no public key on P-256.
    """
    need_cryptography()
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import load_pem_public_key

    keys = {}
    for path in paths:
        try:
            key = load_pem_public_key(_bytes(path, LARGEST_KEY))
        except (ValueError, UnsupportedAlgorithm):
            raise InvalidArgument(
                f"{path} is not a public key in PEM.", "Give the signer's public key, not the private one."
            ) from None
        if not isinstance(key, ec.EllipticCurvePublicKey) or not isinstance(key.curve, ec.SECP256R1):
            raise InvalidArgument(f"{path} is not a key on the curve P-256.", _MAKE)
        keys[key_name(key)] = key
    return keys


def key_name(public: Any) -> str:
    """The thumbprint of a public key: RFC 7638, section 3.2."""
    numbers = public.public_numbers()
    x, y = (unpadded(value.to_bytes(32, "big")) for value in (numbers.x, numbers.y))
    form = json.dumps({"crv": "P-256", "kty": "EC", "x": x, "y": y}, separators=(",", ":"))
    return unpadded(hashlib.sha256(form.encode()).digest())


def unpadded(data: bytes) -> str:
    """Base64url without padding: RFC 7515, section 2."""
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


def read_revoked(path: Path | str) -> frozenset[str]:
    """Passports and keys that were called back: a text file, a name a line, # begins a comment.

    Raises:
        InvalidArgument: it cannot be read, or a line is no name. A list that is half understood protects nobody.
    """
    try:
        lines = _bytes(path, LARGEST_LIST).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InvalidArgument(f"{path} is not text in UTF-8.", "Write one passport or key a line.") from None
    names = set()
    for number, line in enumerate(lines, 1):
        name = line.partition("#")[0].strip()
        if name and not (PASSPORT_ID.fullmatch(name) or KEY_ID.fullmatch(name)):
            raise InvalidArgument(
                f"{path}, line {number}: is neither a passport's id nor a key's name.",
                "Write what `camssf passport show` says as id (32 hexadecimal digits) or key (43 characters).",
            )
        names.add(name)
    return frozenset(names - {""})


def _bytes(path: Path | str, most: int) -> bytes:
    try:
        with open(path, "rb") as stream:
            data = stream.read(most + 1)
    except (OSError, ValueError) as error:
        raise InvalidArgument(
            f"{path} cannot be read ({getattr(error, 'strerror', None) or error}).", "Check the path."
        ) from error
    if len(data) > most:
        raise InvalidArgument(f"{path} is larger than {most} bytes.", "Give the file that was meant.")
    return data
