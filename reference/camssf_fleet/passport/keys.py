"""Makes and reads the keys of passports: P-256; the private key in OpenSSH's format, the public one in PEM.

A key's name is its thumbprint (RFC 7638, SHA-256), the same in every language. No message, document or log holds
any part of a private key.
"""

from __future__ import annotations

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


def need_libraries(passphrase: bytes | None = None) -> None:
    """Raise unless the libraries are installed: cryptography, joserfc, and with a passphrase bcrypt.

    Raises:
        InvalidArgument: one is missing.
    """
    for name in ("cryptography", "joserfc", *(["bcrypt"] if passphrase else [])):
        library(name, "A key with a passphrase needs" if name == "bcrypt" else "Passports need", "passport")


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
    need_libraries(passphrase)
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
    with open(path, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


def read_private(path: Path | str, passphrase: bytes | None = None) -> Any:
    """Read a private key for signing: in OpenSSH's format, or in PEM as OpenSSL writes it.

    Raises:
        InvalidArgument: the file is not such a key, others may read it, or `passphrase` does not unlock it.
    """
    need_libraries(passphrase)
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.serialization import load_pem_private_key, load_ssh_private_key

    data, mode = _read(path)
    if b"PUBLIC KEY" in data:
        raise InvalidArgument(f"{path} is a public key.", "Give the private key that was made with it.")
    if b"PRIVATE KEY" not in data:
        raise InvalidArgument(f"{path} is not a private key.", _MAKE)
    _check_size(data, path)
    if os.name == "posix" and mode & 0o077:
        raise InvalidArgument(
            f"Other users may read or change the private key {path} (mode {mode:03o}).",
            f"Close it: chmod 600 {shlex.quote(str(path))}. If others could use this computer, make a new key.",
        )
    try:
        key = (load_ssh_private_key if b"OPENSSH" in data else load_pem_private_key)(data, passphrase or None)
    except TypeError:  # no message of these errors is shown: it may quote the key
        state, advice = ("not locked", "Give no passphrase.") if passphrase else ("locked", "Give its passphrase.")
        raise InvalidArgument(f"{path} is {state}.", advice) from None
    except (ValueError, NotImplementedError, UnsupportedAlgorithm):
        if passphrase:
            raise InvalidArgument(
                f"{path} is locked with another passphrase, or it is damaged.", "Give its passphrase."
            ) from None
        raise InvalidArgument(f"{path} is not a private key.", _MAKE) from None
    _check_curve(key, path)
    return key


def read_public(paths: Iterable[Path | str]) -> dict[str, Any]:
    """Read the trusted public keys, by their names.

    Raises:
        InvalidArgument: a file is not a public key on P-256.
    """
    need_libraries()
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.serialization import load_pem_public_key

    keys = {}
    for path in paths:
        data, _ = _read(path)
        _check_size(data, path)
        try:
            key = load_pem_public_key(data)
        except (ValueError, UnsupportedAlgorithm):
            raise InvalidArgument(
                f"{path} is not a public key in PEM.", "Give the signer's public key, not the private one."
            ) from None
        _check_curve(key, path)
        keys[key_name(key)] = key
    return keys


def key_name(public: Any) -> str:
    """Thumbprint of a public key (RFC 7638, section 3.2)."""
    from joserfc.jwk import ECKey

    return str(ECKey.import_key(public).thumbprint())


def _check_curve(key: Any, path: Path | str) -> None:
    from cryptography.hazmat.primitives.asymmetric import ec

    elliptic = isinstance(key, ec.EllipticCurvePrivateKey | ec.EllipticCurvePublicKey)
    if not (elliptic and isinstance(key.curve, ec.SECP256R1)):
        raise InvalidArgument(f"{path} is not a key on the curve P-256.", _MAKE)


def _read(path: Path | str) -> tuple[bytes, int]:
    """The bytes of a key's file, at most one more than LARGEST_KEY, and the file's mode."""
    try:
        with open(local(path), "rb") as stream:
            data, mode = stream.read(LARGEST_KEY + 1), stat.S_IMODE(os.fstat(stream.fileno()).st_mode)
    except (OSError, ValueError) as error:
        raise InvalidArgument(f"{path} cannot be read ({error_in_words(error)}).", read_advice(error)) from error
    return data, mode


def _check_size(data: bytes, path: Path | str) -> None:
    if len(data) > LARGEST_KEY:
        raise InvalidArgument(f"{path} is larger than {LARGEST_KEY} bytes.", "Check the path.")
