"""Makes and reads the keys of passports: P-256, in PEM files.

A key's name is its thumbprint (RFC 7638, SHA-256), the same in every language. No message, document or log holds
any part of a private key.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import shlex
import stat
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from camssf.errors import InvalidArgument
from camssf.files import local, local_folder
from camssf.libraries import library

PRIVATE, PUBLIC = "passport-key.pem", "passport-key.pub.pem"
LARGEST_KEY = 64 * 1024
ROUNDS = 600_000
"""Rounds of PBKDF2 with HMAC-SHA-256 (OWASP Password Storage Cheat Sheet, 2023)."""
KEY_ID = re.compile(r"[A-Za-z0-9_-]{43}")

_MAKE = "Make a pair of keys: by `camssf passport key -o FOLDER`, or by the button in the page of `camssf app`."


def need_cryptography() -> None:
    """Raise unless the library `cryptography` is installed."""
    library("cryptography", "Passports need", "passport")


def make_key(folder: Path | str, passphrase: bytes | None = None) -> str:
    """Write a new key pair to `folder`: PRIVATE (readable by its owner only) and PUBLIC.

    Args:
        folder: created if missing; an existing key is never replaced.
        passphrase: encrypts the private key; None for an unencrypted key.

    Returns:
        The key's name.

    Raises:
        InvalidArgument: the pair cannot be written, or the folder has one already.
    """
    need_cryptography()
    from cryptography.hazmat.primitives import serialization as form
    from cryptography.hazmat.primitives.asymmetric import ec

    key = ec.generate_private_key(ec.SECP256R1())
    private = _locked(key, passphrase) if passphrase else _open(key, form.Encoding.PEM)
    public = key.public_key().public_bytes(form.Encoding.PEM, form.PublicFormat.SubjectPublicKeyInfo)
    folder = local_folder(folder)
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


def _open(key: Any, encoding: Any) -> bytes:
    from cryptography.hazmat.primitives.serialization import NoEncryption, PrivateFormat

    return bytes(key.private_bytes(encoding, PrivateFormat.PKCS8, NoEncryption()))


def _locked(key: Any, passphrase: bytes) -> bytes:
    """EncryptedPrivateKeyInfo in PEM: PBES2 (RFC 8018, appendix A) with PBKDF2, HMAC-SHA-256 and AES-256-CBC.

    Written here because `cryptography` writes PKCS 8 with 20,000 rounds and has no option to change them.
    """
    from cryptography.hazmat.primitives.ciphers import Cipher, algorithms, modes
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.kdf.pbkdf2 import PBKDF2HMAC
    from cryptography.hazmat.primitives.padding import PKCS7
    from cryptography.hazmat.primitives.serialization import Encoding

    salt, start = os.urandom(16), os.urandom(16)
    secret = PBKDF2HMAC(SHA256(), 32, salt, ROUNDS).derive(passphrase)
    padder, cipher = PKCS7(128).padder(), Cipher(algorithms.AES(secret), modes.CBC(start)).encryptor()
    hidden = cipher.update(padder.update(_open(key, Encoding.DER)) + padder.finalize()) + cipher.finalize()

    def sequence(*parts: bytes) -> bytes:
        return _der(0x30, b"".join(parts))

    # Object identifiers: id-hmacWithSHA256, id-PBKDF2, aes256-CBC-PAD, id-PBES2
    hmac = sequence(bytes.fromhex("06082a864886f70d0209"), b"\x05\0")
    rounds = _der(2, ROUNDS.to_bytes(4, "big").lstrip(b"\0"))
    derivation = sequence(bytes.fromhex("06092a864886f70d01050c"), sequence(_der(4, salt), rounds, hmac))
    encryption = sequence(bytes.fromhex("060960864801650304012a"), _der(4, start))
    scheme = sequence(bytes.fromhex("06092a864886f70d01050d"), sequence(derivation, encryption))
    body = base64.b64encode(sequence(scheme, _der(4, hidden))).decode()
    name = "ENCRYPTED PRIVATE KEY-----"
    return "\n".join(["-----BEGIN " + name, *textwrap.wrap(body, 64), "-----END " + name, ""]).encode()


def _der(tag: int, content: bytes) -> bytes:
    """One value of at most 255 bytes in DER (X.690)."""
    size = len(content)
    return bytes([tag, size] if size < 128 else [tag, 0x81, size]) + content


def _create(path: Path, content: bytes, mode: int) -> None:
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), mode)
    with os.fdopen(handle, "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(handle)


def read_private(path: Path | str, passphrase: bytes | None = None) -> Any:
    """Read a private key for signing.

    Raises:
        InvalidArgument: the file is not such a key, others may read it, or `passphrase` does not unlock it.
    """
    need_cryptography()
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    data = _bytes(path, LARGEST_KEY, private=True)
    try:
        key = load_pem_private_key(data, passphrase)
    except (TypeError, ValueError, UnsupportedAlgorithm):  # its message may quote the key
        if b"ENCRYPTED" in data:
            raise InvalidArgument(f"{path} is locked.", "Give its passphrase.") from None
        raise InvalidArgument(
            f"{path} is not a private key in PEM, or not encrypted although a passphrase was given.", _MAKE
        ) from None
    if not isinstance(key, ec.EllipticCurvePrivateKey) or not isinstance(key.curve, ec.SECP256R1):
        raise InvalidArgument(f"{path} is not a key on the curve P-256.", _MAKE)
    return key


def read_public(paths: Iterable[Path | str]) -> dict[str, Any]:
    """Read the trusted public keys, by their names.

    Raises:
        InvalidArgument: a file is not a public key on P-256.
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
    """Thumbprint of a public key (RFC 7638, section 3.2)."""
    numbers = public.public_numbers()
    x, y = (unpadded(value.to_bytes(32, "big")) for value in (numbers.x, numbers.y))
    form = json.dumps({"crv": "P-256", "kty": "EC", "x": x, "y": y}, separators=(",", ":"))
    return unpadded(hashlib.sha256(form.encode()).digest())


def unpadded(data: bytes) -> str:
    """Base64url without padding (RFC 7515, section 2)."""
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


def _bytes(path: Path | str, most: int, *, private: bool = False) -> bytes:
    try:
        with open(local(path), "rb") as stream:
            mode = stat.S_IMODE(os.fstat(stream.fileno()).st_mode)
            data = stream.read(most + 1)
    except (OSError, ValueError) as error:
        raise InvalidArgument(
            f"{path} cannot be read ({getattr(error, 'strerror', None) or error}).", "Check the path."
        ) from error
    if private and b"PUBLIC KEY" in data:
        raise InvalidArgument(f"{path} is a public key.", "Give the private key that was made with it.")
    if private and b"PRIVATE KEY" not in data:
        raise InvalidArgument(f"{path} is not a private key in PEM.", _MAKE)
    if private and os.name == "posix" and mode & 0o077:
        raise InvalidArgument(
            f"Other users may read or change the private key {path} (mode {mode:03o}).",
            f"Close it: chmod 600 {shlex.quote(str(path))}. If others could use this computer, make a new key.",
        )
    if len(data) > most:
        raise InvalidArgument(f"{path} is larger than {most} bytes.", "Check the path.")
    return data
