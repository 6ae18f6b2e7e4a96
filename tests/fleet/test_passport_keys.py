"""Passports' keys: made, locked, read; whatever is none, or others may read, is refused."""

import base64
import os
import stat
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from camssf.errors import InvalidArgument

pytest.importorskip("cryptography", reason="cryptography is not here")
pytest.importorskip("joserfc", reason="joserfc is not here")

from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa

from camssf_fleet.passport.document import read, sign, verify
from camssf_fleet.passport.keys import PRIVATE, PUBLIC, key_name, make_key, read_private, read_public
from tests.support.fixed_passports import fixed_key, same, signed, trusted
from tests.support.signed_passports import small


def pkcs8(key: Any, passphrase: bytes | None = None) -> bytes:
    lock = serialization.BestAvailableEncryption(passphrase) if passphrase else serialization.NoEncryption()
    made: bytes = key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, lock)
    return made


def test_a_pair_of_keys(tmp_path: Path) -> None:
    folder = tmp_path / "keys"
    name = make_key(folder)
    assert list(read_public([folder / PUBLIC])) == [name]
    assert key_name(read_private(folder / PRIVATE).public_key()) == name
    if os.name == "posix":
        assert stat.S_IMODE((folder / PRIVATE).stat().st_mode) == 0o600
    before = (folder / PRIVATE).read_bytes()
    for gone in ((), (PRIVATE,)):
        for file in gone:
            (folder / file).unlink()
        with pytest.raises(InvalidArgument, match="key"):
            make_key(folder)
    assert not (folder / PRIVATE).exists()
    assert b"PRIVATE" in before


def test_a_locked_key(tmp_path: Path) -> None:
    make_key(tmp_path, b"open sesame")
    read_private(tmp_path / PRIVATE, b"open sesame")
    for wrong in (None, b"open"):
        with pytest.raises(InvalidArgument, match="is locked"):
            read_private(tmp_path / PRIVATE, wrong)
    body = base64.b64decode(b"".join((tmp_path / PRIVATE).read_bytes().splitlines()[1:-1]))
    assert body.startswith(b"openssh-key-v1\0\0\0\0\x0aaes256-ctr\0\0\0\x06bcrypt")
    assert body[63:67] == (100).to_bytes(4, "big")  # rounds, behind the length and 16 bytes of salt (PROTOCOL.key)
    with pytest.raises(InvalidArgument, match="1023"):
        make_key(tmp_path / "long", b"a" * 1024)
    make_key(tmp_path / "open")
    with pytest.raises(InvalidArgument, match="not locked"):
        read_private(tmp_path / "open" / PRIVATE, b"open sesame")


@pytest.mark.parametrize("passphrase", [None, b"open sesame"])
def test_a_key_of_openssl(tmp_path: Path, passphrase: bytes | None) -> None:
    """PKCS 8 in PEM."""
    (tmp_path / "key.pem").write_bytes(pkcs8(fixed_key(), passphrase))
    (tmp_path / "key.pem").chmod(0o600)
    assert key_name(read_private(tmp_path / "key.pem", passphrase).public_key()) == next(iter(trusted()))
    with pytest.raises(InvalidArgument, match="locked"):
        read_private(tmp_path / "key.pem", None if passphrase else b"open sesame")


def test_a_damaged_key(tmp_path: Path) -> None:
    """Whatever byte of it is another."""
    make_key(tmp_path)
    first, *middle, last = (tmp_path / PRIVATE).read_bytes().splitlines()
    body = base64.b64decode(b"".join(middle))
    for at in range(0, len(body), 3):
        damaged = base64.encodebytes(body[:at] + bytes([body[at] ^ 6]) + body[at + 1 :])
        (tmp_path / PRIVATE).write_bytes(b"\n".join((first, damaged + last, b"")))
        with suppress(InvalidArgument):  # not the comment, and what fills the last block
            read_private(tmp_path / PRIVATE)


@pytest.mark.skipif(os.name != "posix", reason="files have no such modes here")
def test_a_key_that_others_may_read_is_refused(tmp_path: Path) -> None:
    make_key(tmp_path)
    for mode in (0o640, 0o604, 0o644, 0o660, 0o610):
        (tmp_path / PRIVATE).chmod(mode)
        with pytest.raises(InvalidArgument) as caught:
            read_private(tmp_path / PRIVATE)
        assert f"chmod 600 {tmp_path / PRIVATE}" in caught.value.advice
    for mode in (0o600, 0o400):
        (tmp_path / PRIVATE).chmod(mode)
        read_private(tmp_path / PRIVATE)


@pytest.mark.parametrize("make", [
    lambda: rsa.generate_private_key(65537, 2048), lambda: ec.generate_private_key(ec.SECP256K1()),
    lambda: ec.generate_private_key(ec.SECP384R1()),
], ids=["rsa", "secp256k1", "secp384r1"])  # fmt: skip
def test_keys_of_another_kind(tmp_path: Path, make: Any) -> None:
    form = serialization.PublicFormat.SubjectPublicKeyInfo
    (tmp_path / "private").write_bytes(pkcs8(make()))
    (tmp_path / "private").chmod(0o600)
    (tmp_path / "public").write_bytes(make().public_key().public_bytes(serialization.Encoding.PEM, form))
    for attempt in (lambda: read_private(tmp_path / "private"), lambda: read_public([tmp_path / "public"])):
        with pytest.raises(InvalidArgument, match="P-256"):
            attempt()


def test_files_that_are_no_keys(tmp_path: Path) -> None:
    make_key(tmp_path)
    (tmp_path / "no").write_bytes(b"-----BEGIN PRIVATE KEY-----\nAAAA\n-----END PRIVATE KEY-----\n")
    for name, other in (("no", "no"), (PUBLIC, PRIVATE), ("missing", "missing"), ("", "")):
        with pytest.raises(InvalidArgument):
            read_private(tmp_path / name)
        with pytest.raises(InvalidArgument):
            read_public([tmp_path / other])


@pytest.mark.parametrize("name", ["cryptography", "joserfc"])
def test_without_the_library_it_says_what_to_install(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    token = signed()
    monkeypatch.setitem(sys.modules, name, None)
    assert same(read(token)[0], small())  # reading alone needs neither
    for call in (
        lambda: make_key(tmp_path), lambda: read_private("x"), lambda: read_public([]),
        lambda: sign(small(), None), lambda: verify(b"", {}),
    ):  # fmt: skip
        with pytest.raises(InvalidArgument, match=rf"library {name}.* install -e .*\[passport\]"):
            call()
