"""Makes and reads the keys of passports: P-256; the private key in OpenSSH's format, the public one in PEM.

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
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from camssf.errors import InvalidArgument
from camssf.files import error_in_words, local, local_folder, read_advice
from camssf.libraries import library

PRIVATE, PUBLIC = "passport-key.pem", "passport-key.pub.pem"
LARGEST_KEY = 64 * 1024
ROUNDS = 100
"""Rounds of bcrypt's key derivation, a second or two; `ssh-keygen -a` has 16 unless told otherwise."""
LONGEST_PASSPHRASE = 1023
"""Bytes; `cryptography` takes no more."""
KEY_ID = re.compile(r"[A-Za-z0-9_-]{43}")

_MAKE = "Make a pair of keys: by `camssf passport key -o FOLDER`, or by the button in the page of `camssf app`."


def need_cryptography() -> None:
    """Raise unless the library `cryptography` is installed."""
    library("cryptography", "Passports need", "passport")


def _need_bcrypt(passphrase: bytes | None) -> None:
    if passphrase:
        library("bcrypt", "A key with a passphrase needs", "passport")


def make_key(folder: Path | str, passphrase: bytes | None = None) -> str:
    """Write a new key pair to `folder`: PRIVATE (readable by its owner only) and PUBLIC.

    Args:
        folder: created if missing; an existing key is never replaced.
        passphrase: encrypts the private key; None for an unencrypted key.

    Returns:
        The key's name.

    Raises:
        InvalidArgument: the pair cannot be written, the folder has one already, or `passphrase` is too long.
    """
    need_cryptography()
    _need_bcrypt(passphrase)
    from cryptography.hazmat.primitives import serialization as form
    from cryptography.hazmat.primitives.asymmetric import ec

    if passphrase and len(passphrase) > LONGEST_PASSPHRASE:
        raise InvalidArgument(f"The passphrase is longer than {LONGEST_PASSPHRASE} bytes.", "Choose a shorter one.")
    ssh = form.PrivateFormat.OpenSSH
    lock = ssh.encryption_builder().kdf_rounds(ROUNDS).build(passphrase) if passphrase else form.NoEncryption()
    key = ec.generate_private_key(ec.SECP256R1())
    private = key.private_bytes(form.Encoding.PEM, ssh, lock)
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


def _create(path: Path, content: bytes, mode: int) -> None:
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), mode)
    with os.fdopen(handle, "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(handle)


def read_private(path: Path | str, passphrase: bytes | None = None) -> Any:
    """Read a private key for signing: in OpenSSH's format, or in PEM as OpenSSL writes it.

    Raises:
        InvalidArgument: the file is not such a key, others may read it, or `passphrase` does not unlock it.
    """
    need_cryptography()
    _need_bcrypt(passphrase)
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import load_pem_private_key, load_ssh_private_key

    data = _bytes(path, LARGEST_KEY, private=True)
    load = load_ssh_private_key if b"OPENSSH" in data else load_pem_private_key
    try:
        key = load(data, passphrase or None)
    except TypeError:  # no message of these errors is shown: it may quote the key
        if passphrase:
            raise InvalidArgument(f"{path} is not locked.", "Give no passphrase.") from None
        raise InvalidArgument(f"{path} is locked.", "Give its passphrase.") from None
    except (ValueError, NotImplementedError, UnsupportedAlgorithm):
        if passphrase:
            raise InvalidArgument(
                f"{path} is locked with another passphrase, or it is damaged.", "Give its passphrase."
            ) from None
        raise InvalidArgument(f"{path} is not a private key.", _MAKE) from None
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
        raise InvalidArgument(f"{path} cannot be read ({error_in_words(error)}).", read_advice(error)) from error
    if private and b"PUBLIC KEY" in data:
        raise InvalidArgument(f"{path} is a public key.", "Give the private key that was made with it.")
    if private and b"PRIVATE KEY" not in data:
        raise InvalidArgument(f"{path} is not a private key.", _MAKE)
    if private and os.name == "posix" and mode & 0o077:
        raise InvalidArgument(
            f"Other users may read or change the private key {path} (mode {mode:03o}).",
            f"Close it: chmod 600 {shlex.quote(str(path))}. If others could use this computer, make a new key.",
        )
    if len(data) > most:
        raise InvalidArgument(f"{path} is larger than {most} bytes.", "Check the path.")
    return data
