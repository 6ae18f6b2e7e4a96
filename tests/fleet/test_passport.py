"""Passports: what was signed is accepted; their keys: made, locked, read; whatever is none is refused."""

import base64
import hashlib
import json
import os
import stat
import sys
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa

from camssf.documents import forms
from camssf.documents.document import document_bytes
from camssf.documents.excerpt import Excerpt
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.exports import exported
from camssf.photo.read.unit import Unit, serial_check
from camssf_fleet.passport.document import PassportRequest, as_printed, create_passport, read, sign, verify
from camssf_fleet.passport.excerpt import excerpt_of
from camssf_fleet.passport.keys import PRIVATE, PUBLIC, key_name, make_key, read_private, read_public
from camssf_fleet.passport.received import read_excerpt
from camssf_fleet.passport.revocations import names_of, read_revoked, sign_revocations
from tests.support import signed_passports as samples
from tests.support.dngs import EXIF, FIRST, told
from tests.support.documents import changed, document, refused
from tests.support.signed_passports import NOW, accepts, fixed_key, refuses, result_json, signed, small, trusted


def test_a_result_goes_in_and_comes_out() -> None:
    unit = Unit(serial="A1", lens="35 mm")
    request = PassportRequest(unit, "2026-11-20T10:00:00+01:00", "chart 7", ("lamp 3",), days=90)
    drawn = create_passport(result_json(), request, now=NOW)
    verified = accepts(sign(drawn, fixed_key()), drawn, result=result_json())
    assert verified.id != samples.complete().id
    photo = document().capture.photos[0]
    assert verified.unit == replace(unit, make=photo.make, model=photo.model)
    assert (verified.chart_serial, verified.lamp_serials) == ("chart 7", ("lamp 3",))
    assert verified.ends - verified.begins == timedelta(days=90)


@pytest.mark.parametrize(("data", "wanted", "words"), [
    (b"{", {}, "not valid JSON"), (b"{}", {}, 'it has no "format"'), (document_bytes(refused()), {}, "was refused"),
    (None, {"lamp_serials": ("a", "b")}, "2 serials of lamps for 1 shots"), (None, {"days": 0}, "days"),
    (None, {"days": float("nan")}, "days"), (None, {"days": 1e9}, "days"), (None, {"captured": "soon"}, "not a time"),
    (None, {"unit": Unit(make="Another")}, "names another camera"),
    (None, {"days": 10000, "begins": datetime(9990, 1, 1, tzinfo=UTC)}, "the year 9999"),
], ids=str)  # fmt: skip
def test_what_cannot_be_signed(data: bytes | None, wanted: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidArgument, match=words):
        create_passport(data or result_json(), PassportRequest(**wanted))


def test_photos_speak_for_the_unit(tmp_path: Path) -> None:
    file = tmp_path / "a.dng"
    file.write_bytes(told(FIRST, EXIF))

    def taken(**change: str) -> bytes:
        photo = replace(document().capture.photos[0], make="Maker", model="Model", **change)
        return document_bytes(changed(document(), capture__shots__0__photo=photo))

    with pytest.raises(InvalidArgument, match="not made from"):
        create_passport(taken(), PassportRequest(), photos=[file])
    data = taken(sha256=hashlib.sha256(file.read_bytes()).hexdigest())
    drawn = create_passport(data, PassportRequest(Unit(camera_id="2")), photos=[file])
    check = serial_check("Maker", "Model", "body 9")
    assert drawn.unit == Unit("Maker", "Model", "2", "body 9", check, "Wide 24 mm", 24.7, 1.8)
    assert drawn.captured == "2026-11-20T09:15:00+01:00"
    other = create_passport(data, PassportRequest(captured="2026-11-21T00:00"), photos=[file])
    assert other.captured == "2026-11-21T00:00:00"
    with pytest.raises(InvalidArgument, match="serial is 'body 9' there, not 'x'"):
        create_passport(data, PassportRequest(Unit(serial="x")), photos=[file])


def test_it_ends_by_the_clock() -> None:
    with pytest.raises(PassportInvalid, match="ended"):
        verify(sign(replace(small(), ends=datetime.now(UTC)), fixed_key()), trusted())


def test_what_was_called_back() -> None:
    """By the passport's name or its key's; a signed list, of any length, and no passport in its place."""
    kid, end = next(iter(trusted())), NOW + timedelta(days=30)
    for name in (small().id, kid):
        data = sign_revocations(["f" * 32, name], fixed_key(1), now=NOW, days=30)
        assert read_revoked(data, trusted(1), end - timedelta(seconds=1)) == {"f" * 32, name}
        refuses(signed(), "was revoked", revoked={"f" * 32, name})
    with pytest.raises(PassportInvalid, match="ended at 2026-12-22T03:00:00"):
        read_revoked(data, trusted(1), end)
    assert names_of(data, trusted(1)) == {"f" * 32, kid}  # its signer renews it, old as it is
    refuses(data, "does not name", number=1)  # nor is a list a passport
    names = {f"{number:032x}" for number in range(4000)}
    long = sign_revocations(names, fixed_key(), now=NOW)
    assert len(long) > 130_000  # longer than the payload that joserfc reads by default
    assert read_revoked(long, trusted(), NOW) == names
    for wrong, days in ((["0123"], 1), ([small().id.upper()], 1), ([], 0), ([], 367), ([], float("nan"))):
        with pytest.raises(InvalidArgument):
            sign_revocations(wrong, fixed_key(), days=days)


def test_the_excerpt_is_what_the_signed_result_holds() -> None:
    drawn = samples.complete()
    accepts(sign(drawn, fixed_key()), drawn, result=result_json())
    refuses(sign(drawn, fixed_key()), "another result", result=result_json() + b"\n")
    other = replace(drawn, result=replace(drawn.result, basis="phones"))
    refuses(sign(other, fixed_key()), "excerpt differs", result=result_json())
    data = b'{"format": "camssf-result/1"}'
    of_none = replace(drawn, result_sha256=hashlib.sha256(data).hexdigest())
    refuses(sign(of_none, fixed_key()), "not in the form", result=data)


def test_an_excerpt_keeps_curves_bands_and_verdict() -> None:
    whole, part = document(), excerpt_of(document())
    answer, held = whole.answer, part.answer()
    assert held.curves.values == pytest.approx(answer.curves.values, abs=5.1e-6)
    assert held.std.values == pytest.approx(answer.std.values, abs=5.1e-6)
    apart = ("curves", "std", "code_covariance", "used", "level", "predicted", "unseen", "uncertainty")
    for name in vars(answer).keys() - set(apart):
        assert forms.to_plain(getattr(held, name)) == forms.to_plain(getattr(answer, name)), name
    uncertainty = forms.to_plain(answer.uncertainty)
    assert forms.to_plain(held.uncertainty) == {k: value for k, value in uncertainty.items() if value is not None}
    assert (part.verdict.status, part.verdict.checks) == (whole.verdict.status, whole.verdict.checks)
    for stated, reason in zip(part.verdict.reasons, whole.verdict.reasons, strict=True):
        assert vars(stated) == {name: getattr(reason, name) for name in vars(stated)}
    assert (part.assumptions, part.hashes.inputs) == (whole.assumptions, whole.capture.hashes)
    photo = whole.capture.photos[0]
    assert (part.shots[0].photo.name, part.shots[0].photo.sha256) == (photo.name, photo.sha256)
    plain = forms.to_plain(part)
    form = {"pose", "patches", "saturation", "lamp", "photo", "white", "dark", "white_reference", "dark_reference"}
    assert set(plain["shots"][0]) == form
    assert forms.to_plain(forms.from_plain(plain, Excerpt, "it", "")) == plain


def test_what_was_printed_can_be_verified_again() -> None:
    """And holds what it was printed of: in it nothing can be changed either."""
    drawn = samples.complete()
    whole = forms.to_plain(as_printed(sign(drawn, fixed_key()), drawn))
    data = json.dumps(whole, indent=1).encode()
    accepts(data, drawn, result=result_json())
    assert samples.claimed(read(data)[0]) == samples.claimed(drawn)
    assert forms.to_plain(as_printed(data, drawn)) == whole
    refuses(data, "not trusted", number=1)
    parts = whole["excerpt"]
    inside = ({"result_sha256": "0" * 64}, {"further": 1}, *({"passport": p} for p in (signed().decode(), 5, "\xe9")))
    others = [{"excerpt": parts | change} for change in inside]
    for change in ({"basis": "phones"}, {"ssf": 5}, {"further": 1}, {"excerpt": {}}, {"excerpt": None}, *others):
        refuses(json.dumps(whole | change).encode())
        with pytest.raises((InvalidArgument, PassportInvalid)):
            read_excerpt(whole | change, "it")
    for gone in ("basis", "excerpt"):
        refuses(json.dumps({name: value for name, value in whole.items() if name != gone}).encode())
    assert exported(read_excerpt(whole, "it")).sha256 == parts["result_sha256"]
    with pytest.raises(InvalidArgument, match="excerpt"):
        create_passport(data, PassportRequest())


def pkcs8(key: Any, passphrase: bytes | None = None) -> bytes:
    lock = serialization.BestAvailableEncryption(passphrase) if passphrase else serialization.NoEncryption()
    return bytes(key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, lock))


def test_a_pair_of_keys(tmp_path: Path) -> None:
    folder = tmp_path / "keys"
    name = make_key(folder)
    assert list(read_public([folder / PUBLIC])) == [name]
    assert key_name(read_private(folder / PRIVATE).public_key()) == name
    if os.name == "posix":
        assert stat.S_IMODE((folder / PRIVATE).stat().st_mode) == 0o600
    for private in (True, False):  # neither over a pair nor over the public key alone
        if not private:
            (folder / PRIVATE).unlink()
        with pytest.raises(InvalidArgument, match="key"):
            make_key(folder)
        assert (folder / PRIVATE).exists() == private


@pytest.mark.full
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
def test_a_key_of_openssl_in_pkcs8(tmp_path: Path, passphrase: bytes | None) -> None:
    (tmp_path / "key.pem").write_bytes(pkcs8(fixed_key(), passphrase))
    (tmp_path / "key.pem").chmod(0o600)
    assert key_name(read_private(tmp_path / "key.pem", passphrase).public_key()) == next(iter(trusted()))
    with pytest.raises(InvalidArgument, match="locked"):
        read_private(tmp_path / "key.pem", None if passphrase else b"open sesame")


def test_a_damaged_key(tmp_path: Path) -> None:
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
def test_a_missing_library_is_named(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    token = signed()
    monkeypatch.setitem(sys.modules, name, None)
    assert samples.claimed(read(token)[0]) == samples.claimed(small())  # reading alone needs neither
    for call in (
        lambda: make_key(tmp_path), lambda: read_private("x"), lambda: read_public([]),
        lambda: sign(small(), None), lambda: verify(b"", {}),
    ):  # fmt: skip
        with pytest.raises(InvalidArgument, match=rf"library {name}.* install -e .*\[passport\]"):
            call()
