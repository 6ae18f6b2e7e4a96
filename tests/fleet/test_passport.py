"""Passports: what was signed is accepted, and nothing else; judged by another library, by OpenSSL and by a JVM."""

import base64
import hashlib
import hmac
import io
import json
import os
import random
import shutil
import stat
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from camssf import cli
from camssf.documents import forms
from camssf.documents.document import Document, document_bytes
from camssf.documents.excerpt import Excerpt
from camssf.errors import InvalidArgument, PassportInvalid, UnreadableRaw
from camssf.exports import exported
from camssf.photo.read.unit import Taken, Unit, read_unit, serial_check
from tests.support.documents import document, refused

pytest.importorskip("cryptography", reason="cryptography is not here")
pytest.importorskip("joserfc", reason="joserfc is not here")

from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from joserfc import jws
from joserfc.jwk import ECKey

from camssf_fleet.passport import document as passports
from camssf_fleet.passport.document import (
    FORMAT,
    PASSPORT,
    Passport,
    PassportRequest,
    as_printed,
    create_passport,
    read,
    sign,
    verify,
)
from camssf_fleet.passport.excerpt import excerpt_of
from camssf_fleet.passport.jws import ORDER, sign_jws, verify_jws
from camssf_fleet.passport.keys import PRIVATE, PUBLIC, ROUNDS, key_name, make_key, read_private, read_public
from camssf_fleet.passport.received import read_excerpt
from camssf_fleet.passport.revocations import names_of, read_revoked, sign_revocations
from tests.support.processes import SEARCH
from tests.support.signed_passports import FOLDER, HEADERS, answer, claimed, other_results, small_result, stored

NOW = datetime(2026, 11, 22, 3, 0, tzinfo=UTC)
LATER = NOW + timedelta(days=30)
JUDGE = Path(__file__).with_name("PassportJudge.java")
STORED = FOLDER
SOUND = [
    "result: bands", "result: no bands", "result: a member of a later release", "curve: peak 1.0", "curve: negative",
    "bands without a peak",
]  # fmt: skip
"""Results of `other_results` that are no faults."""


@cache
def key(number: int = 0) -> ec.EllipticCurvePrivateKey:
    """The same at every run."""
    return ec.derive_private_key(int.from_bytes(hashlib.sha256(bytes([number])).digest(), "big"), ec.SECP256R1())


def trusted(number: int = 0) -> dict[str, Any]:
    return {key_name(key(number).public_key()): key(number).public_key()}


def pem(number: int = 0) -> bytes:
    return (
        key(number)
        .public_key()
        .public_bytes(serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo)
    )


def as_excerpt(plain: Any) -> Excerpt:
    return forms.from_plain(plain, Excerpt, "it", "")


def excerpt_in(result: bytes) -> dict[str, Any]:
    """The excerpt of a result.json as plain data."""
    return dict(forms.to_plain(excerpt_of(forms.read(result, Document, "it", ""))))


def same(one: Passport, other: Passport) -> bool:
    return claimed(one) == claimed(other)


@cache
def small() -> Passport:
    """A passport whose result is as short as it can be."""
    return Passport(
        id="0123456789abcdef" * 2, issued=NOW, begins=NOW, ends=NOW + timedelta(days=365),
        unit=Unit("Maker", "Model"), captured="", chart_serial="", lamp_serials=("",), software="0.1.0",
        result_sha256="5e" * 32, result=as_excerpt(small_result()),
    )  # fmt: skip


@cache
def signed() -> bytes:
    return sign(small(), key())


@cache
def result_json() -> bytes:
    return document_bytes(document())


@cache
def whole_passport() -> Passport:
    """A passport of a whole result."""
    return create_passport(result_json(), PassportRequest(), now=NOW)


def refuses(data: bytes, words: str = "", number: int = 0, **more: Any) -> None:
    with pytest.raises(PassportInvalid) as caught:
        verify(data, trusted(number), now=LATER, **more)
    assert words in caught.value.message


def b64(data: bytes) -> bytes:
    return base64.urlsafe_b64encode(data).rstrip(b"=")


def unb64(text: bytes) -> bytes:
    return base64.urlsafe_b64decode(text + b"=" * (-len(text) % 4))


# What is signed is what is read


def test_a_result_goes_in_and_comes_out() -> None:
    said = PassportRequest(
        Unit(serial="A1", lens="35 mm"), "2026-11-20T10:00:00+01:00", "chart 7", ("lamp 3",), days=90
    )
    drawn = create_passport(result_json(), said, now=NOW)
    verified = verify(sign(drawn, key()), trusted(), now=LATER, result=result_json())
    assert same(verified, drawn)
    assert forms.to_plain(verified.result) == excerpt_in(result_json())
    photo = document().capture.photos[0]
    assert verified.unit == Unit(photo.make, photo.model, serial="A1", lens="35 mm")
    assert (verified.chart_serial, verified.lamp_serials) == ("chart 7", ("lamp 3",))
    assert verified.ends - verified.begins == timedelta(days=90)
    assert verified.result_sha256 == hashlib.sha256(result_json()).hexdigest()


def test_no_two_are_alike() -> None:
    assert create_passport(result_json(), PassportRequest(), now=NOW).id != whole_passport().id


def test_what_cannot_be_signed() -> None:
    whole = result_json()
    for data, wanted, words in (
        (b"{", PassportRequest(), "not valid JSON"),
        (b"{}", PassportRequest(), 'it has no "format"'),
        (document_bytes(refused()), PassportRequest(), "was refused"),
        (whole, PassportRequest(lamp_serials=("a", "b")), "2 serials of lamps for 1 shots"),
        (whole, PassportRequest(days=0), "days"),
        (whole, PassportRequest(days=float("nan")), "days"),
        (whole, PassportRequest(days=1e9), "days"),
        (whole, PassportRequest(captured="yesterday"), "not a time"),
        (whole, PassportRequest(unit=Unit(make="Another")), "names another camera"),
        (whole, PassportRequest(days=10000, begins=datetime(9990, 1, 1, tzinfo=UTC)), "the year 9999"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            create_passport(data, wanted)


def test_its_time() -> None:
    one = replace(small(), begins=NOW + timedelta(days=1))
    data = sign(one, key())
    for at, words in (
        (NOW, "not valid before"),
        (one.begins - timedelta(seconds=1), "not valid before"),
        (one.ends, "ended"),
        (one.ends + timedelta(days=9999), "ended"),
    ):
        with pytest.raises(PassportInvalid, match=words):
            verify(data, trusted(), now=at)
    for at in (one.begins, one.ends - timedelta(seconds=1)):
        assert same(verify(data, trusted(), now=at), one)
    with pytest.raises(PassportInvalid, match="ended"):
        verify(sign(replace(small(), ends=datetime.now(UTC)), key()), trusted())  # by the system clock


def test_what_was_called_back() -> None:
    kid = next(iter(trusted()))
    for name in (small().id, kid):
        data = sign_revocations(["f" * 32, name], key(1), now=NOW, days=60)
        assert read_revoked(data, trusted(1), LATER) == {"f" * 32, name}
        refuses(signed(), "was revoked", revoked=read_revoked(data, trusted(1), LATER))
    data = sign_revocations(["f" * 32], key(), now=NOW, days=60)
    assert verify(signed(), trusted(), now=LATER, revoked=read_revoked(data, trusted(), LATER)).id == small().id


def test_a_list_of_what_was_called_back_that_is_not_to_be_trusted() -> None:
    """Old, a stranger's, changed, not signed, a passport in its place."""
    data = sign_revocations([small().id], key(), now=NOW, days=30)
    header, payload, signature = data.split(b".")
    other = b64(json.dumps(json.loads(unb64(payload)) | {"revoked": []}).encode())
    for wrong, words in (
        (data, "ended at 2026-12-22T03:00:00"),
        (sign_revocations([small().id], key(1), now=LATER), "not trusted"),
        (b".".join((header, other, signature)), "does not match"),
        (small().id.encode(), "not signed"),
        (f"# a list\n{small().id}\n".encode(), "not signed"),
        (b"", "not signed"),
        (signed(), "does not name"),
    ):
        with pytest.raises(PassportInvalid, match=words):
            read_revoked(wrong, trusted(), LATER)
    refuses(data, "does not name")  # nor is a list a passport
    assert read_revoked(data, trusted(), LATER - timedelta(seconds=1)) == {small().id}
    assert names_of(data, trusted()) == {small().id}  # its signer renews it, old as it is
    assert read_revoked(sign_revocations([], key(), now=LATER), trusted(), NOW) == frozenset()


def test_a_long_list() -> None:
    """Longer than the payload that joserfc reads by default."""
    names = {f"{number:032x}" for number in range(4000)}
    data = sign_revocations(names, key(), now=NOW)
    assert len(data) > 130_000
    assert read_revoked(data, trusted(), NOW) == names


def test_a_list_that_cannot_be_signed() -> None:
    for names, days in ((["0123"], 1), ([small().id.upper()], 1), ([], 0), ([], 367), ([], float("nan"))):
        with pytest.raises(InvalidArgument):
            sign_revocations(names, key(), days=days)


def test_of_another_result() -> None:
    data = sign(whole_passport(), key())
    refuses(data, "another result", result=result_json() + b"\n")


def test_the_excerpt_is_what_the_signed_result_holds() -> None:
    drawn = whole_passport()
    assert same(verify(sign(drawn, key()), trusted(), now=LATER, result=result_json()), drawn)
    other = replace(drawn, result=replace(drawn.result, basis="phones"))
    refuses(sign(other, key()), "excerpt differs", result=result_json())
    data = b'{"format": "camssf-result/1"}'
    of_none = replace(drawn, result_sha256=hashlib.sha256(data).hexdigest())
    refuses(sign(of_none, key()), "not in the form", result=data)


def test_a_passport_is_small() -> None:
    """By default joserfc reads 129,536 bytes; an answer of several shots fits, too."""
    drawn = whole_passport()
    assert len(sign(drawn, key())) < 65_000
    ten = replace(drawn, result=replace(drawn.result, shots=drawn.result.shots * 10), lamp_serials=("lamp",) * 10)
    assert len(sign(ten, key())) < PASSPORT.largest == 100_000


def test_an_excerpt_keeps_curves_bands_and_verdict() -> None:
    whole, part = document(), excerpt_of(document())
    answer, held = whole.answer, part.answer()
    assert held.curves.values == pytest.approx(answer.curves.values, abs=5.1e-6)
    assert held.std.values == pytest.approx(answer.std.values, abs=5.1e-6)
    apart = ("curves", "std", "code_covariance", "used", "level", "predicted", "unseen", "uncertainty")
    for name in vars(answer).keys() - set(apart):
        assert forms.to_plain(getattr(held, name)) == forms.to_plain(getattr(answer, name)), name
    assert forms.to_plain(held.uncertainty) == {
        name: value for name, value in forms.to_plain(answer.uncertainty).items() if value is not None
    }
    assert (part.verdict.status, part.verdict.checks) == (whole.verdict.status, whole.verdict.checks)
    for stated, reason in zip(part.verdict.reasons, whole.verdict.reasons, strict=True):
        assert vars(stated) == {name: getattr(reason, name) for name in vars(stated)}
    assert part.assumptions == whole.assumptions
    assert part.hashes.inputs == whole.capture.hashes
    photo = whole.capture.photos[0]
    assert (part.shots[0].photo.name, part.shots[0].photo.sha256) == (photo.name, photo.sha256)
    form = {"pose", "patches", "saturation", "lamp", "photo", "white", "dark", "white_reference", "dark_reference"}
    assert set(forms.to_plain(part)["shots"][0]) == form
    assert same_excerpt(as_excerpt(forms.to_plain(part)), part)


def same_excerpt(one: Excerpt, other: Excerpt) -> bool:
    return bool(forms.to_plain(one) == forms.to_plain(other))


def test_what_was_printed_can_be_verified_again() -> None:
    """And holds what it was printed of: in it nothing can be changed either."""
    drawn = whole_passport()
    token = sign(drawn, key())
    whole = forms.to_plain(as_printed(token, drawn))
    data = json.dumps(whole, indent=1).encode()
    assert same(verify(data, trusted(), now=LATER, result=result_json()), drawn)
    assert same(read(data)[0], drawn)
    assert forms.to_plain(as_printed(data, drawn)) == whole
    refuses(data, "not trusted", number=1)
    parts = whole["excerpt"]
    for change in (
        {"basis": "phones"}, {"ssf": 5}, {"further": 1}, {"excerpt": parts | {"result_sha256": "0" * 64}},
        {"excerpt": parts | {"further": 1}}, {"excerpt": parts | {"passport": signed().decode()}},
        {"excerpt": parts | {"passport": 5}}, {"excerpt": parts | {"passport": "\xe9"}}, {"excerpt": {}},
        {"excerpt": None},
    ):  # fmt: skip
        refuses(json.dumps(whole | change).encode())
        with pytest.raises((InvalidArgument, PassportInvalid)):
            read_excerpt(whole | change, "it")
    for gone in ("basis", "excerpt"):
        refuses(json.dumps({name: value for name, value in whole.items() if name != gone}).encode())
    assert exported(read_excerpt(whole, "it")).sha256 == whole["excerpt"]["result_sha256"]
    with pytest.raises(InvalidArgument, match="excerpt"):
        create_passport(data, PassportRequest())


def test_a_result_that_is_no_calibration_is_never_verified() -> None:
    """Signed well by a trusted key: `"ssf": 5`, a refused one, a covariance that belongs outside."""
    for name, other in other_results().items():
        claims = claimed(small()) | {"result": other}
        data = sign_jws(claims, PASSPORT, key())
        if name in SOUND:
            excerpt = verify(data, trusted(), now=LATER).result
            known = {member: value for member, value in other.items() if member != "further"}
            assert same_excerpt(excerpt, as_excerpt(known)), name
            continue
        words = "was refused" if "refused" in name else "result is missing or invalid"
        refuses(data, words)
        with pytest.raises(PassportInvalid):
            read(data)
        with pytest.raises(InvalidArgument):
            as_excerpt(other)
    assert set(SOUND) < set(other_results())


def test_a_hash_of_zeros_is_nobodys() -> None:
    refuses(sign_jws(claimed(small()) | {"result_sha256": "0" * 64}, PASSPORT, key()), "result_sha256")


# What was changed


def turned(data: bytes) -> Iterator[bytes]:
    """Every bit turned, every byte left out, doubled, and cut off at every place."""
    for i in range(len(data)):
        for bit in range(8):
            yield data[:i] + bytes([data[i] ^ 1 << bit]) + data[i + 1 :]
        yield data[:i] + data[i + 1 :]
        yield data[:i] + data[i : i + 1] + data[i:]
        yield data[:i]


@pytest.mark.requirement("R-PASSPORT")
@pytest.mark.full
def test_any_bit_matters() -> None:
    """Some 3,000 documents, none accepted; and the one that was not changed is, so that this test can fail."""
    short = sign_jws({"format": FORMAT}, PASSPORT, key())
    assert verify_jws(short, PASSPORT, trusted())[0] == {"format": FORMAT}
    count = 0
    for data in turned(short):
        if data != short:
            with pytest.raises(PassportInvalid):
                verify_jws(data, PASSPORT, trusted())
            refuses(data)
            count += 1
    assert count == 11 * len(short)  # eight bits, left out, doubled, cut off


def mutated(data: bytes, dice: random.Random) -> bytes:
    """What a disk, a mail program or an attacker without a key may do."""
    i, j = sorted(dice.sample(range(len(data) + 1), 2))
    letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
    some = bytes(dice.choice(letters) for _ in range(dice.randint(1, 8)))
    header, payload, signature = data.split(b".")
    r, s = signature_of(data)
    return dice.choice(
        [
            lambda: data[:i] + data[j:],
            lambda: data[:i] + some + data[i:],
            lambda: data[:i] + some + data[i + len(some) :],
            lambda: data[:i] + bytes([dice.randrange(256)]) + data[i + 1 :],
            lambda: data[:i] + data[i:j][::-1] + data[j:],
            lambda: b".".join((header, payload, signed().split(b".")[2])),
            lambda: b".".join((signed().split(b".")[0], *signed().split(b".")[1:2], signature)),
            lambda: with_signature(data, r, (s + dice.randrange(1, ORDER)) % ORDER),  # n - s: one in 2^256
            lambda: with_signature(data, dice.randrange(ORDER), s),
            lambda: with_payload(data, dice),
        ]
    )()


def with_payload(data: bytes, dice: random.Random) -> bytes:
    """One claim of the payload is another; the signature stays."""
    header, payload, signature = data.split(b".")
    claims = json.loads(unb64(payload))
    name = dice.choice(sorted(claims))
    claims[name] = dice.choice([None, 0, "x", [], {}, claims["exp"] + 1, dice.random()])
    return b".".join((header, b64(json.dumps(claims).encode()), signature))


def signature_of(data: bytes) -> tuple[int, int]:
    both = unb64(data.split(b".")[2])
    return int.from_bytes(both[:32], "big"), int.from_bytes(both[32:], "big")


def with_signature(data: bytes, r: int, s: int) -> bytes:
    return data[: data.rindex(b".") + 1] + b64(r.to_bytes(32, "big") + s.to_bytes(32, "big"))


def test_a_thousand_changed_passports() -> None:
    dice, count = random.Random(7), 0
    while count < 1000:
        other = mutated(signed(), dice)
        if other != signed():
            refuses(other)
            count += 1


def header_of(data: bytes) -> dict[str, Any]:
    return dict(json.loads(unb64(data.split(b".")[0])))


def resigned(header: dict[str, Any] | bytes, payload: bytes | None = None, number: int = 0) -> bytes:
    """Anything, signed well: what only the rules of the form can refuse."""
    from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature
    from cryptography.hazmat.primitives.hashes import SHA256

    head = header if isinstance(header, bytes) else json.dumps(header).encode()
    text = b64(head) + b"." + (signed().split(b".")[1] if payload is None else b64(payload))
    r, s = decode_dss_signature(key(number).sign(text, ec.ECDSA(SHA256())))
    return with_signature(text + b".", r, s)


def test_a_header_that_asks_for_something_else() -> None:
    """Even with a sound signature of the trusted key."""
    for change in HEADERS:
        refuses(resigned({k: v for k, v in (header_of(signed()) | change).items() if v is not None}))


def test_headers_that_are_none() -> None:
    text = json.dumps(header_of(signed()))
    for head in (b"[]", b"null", b"1", text[:-1].encode(), f'{text[:-1]}, "alg": "ES256"}}'.encode(), b"\xff" * 20):
        refuses(resigned(head))
    refuses(resigned(text.encode() + b" " * 1024), "three parts")  # joserfc would read half of that
    assert same(verify(resigned(text.encode() + b" " * 500), trusted(), now=LATER), small())


def test_what_joserfc_alone_would_accept() -> None:
    """Each is a reason for a line of our own in jws.py; one that joserfc refuses some day can go."""
    form = header_of(signed())
    text = json.dumps(form)
    changes: list[dict[str, Any]] = [
        {"typ": "JWT"}, {"typ": None}, {"kid": ""}, {"kid": None}, {"jwk": {"kty": "EC"}}, {"b64": True},
        {"cty": "JWT"}, {"jku": "https://a.org"}, {"x5u": "https://a.org"}, {"crit": []}, {"crit": ["kid"]},
    ]  # fmt: skip
    heads = [json.dumps({k: v for k, v in (form | change).items() if v is not None}).encode() for change in changes]
    heads += [f'{{"alg": "none", {text[1:]}'.encode(), b"\xef\xbb\xbf" + text.encode(), text.encode("utf-16")]
    public = ECKey.import_key(key().public_key())
    for token in (*map(resigned, heads), resigned(form, b"")):
        jws.deserialize_compact(token, public, algorithms=["ES256"])
        refuses(token)
    for head in (b'"alg"', b'["alg"]'):
        with pytest.raises(TypeError):
            jws.deserialize_compact(resigned(head), public, algorithms=["ES256"])
        refuses(resigned(head), "header is not an object")


@pytest.mark.requirement("R-PASSPORT")
def test_swapped_algorithms() -> None:
    """The old tricks: no signature at all; the public key as the secret of an HMAC."""
    header, payload, signature = signed().split(b".")
    for alg in ("none", "HS256", "ES256"):
        head = b64(json.dumps(header_of(signed()) | {"alg": alg}).encode())
        text = head + b"." + payload
        for mac in (b"", hmac.digest(pem(), text, "sha256"), hmac.digest(pem().strip(), text, "sha256"), signature):
            refuses(text + b"." + (mac if mac == signature else b64(mac)))
    refuses(header + b"." + payload + b".")
    refuses(header + b"." + payload)


def test_both_signatures_that_fit_are_accepted() -> None:
    """(r, s) and (r, n - s) are both valid ES256 (FIPS 186-5): a signature's bytes identify nothing."""
    r, s = signature_of(signed())
    for half in (s, ORDER - s):
        assert same(verify(with_signature(signed(), r, half), trusted(), now=LATER), small())


def test_other_spellings_of_the_same_signature() -> None:
    """DER, padding and bits that nobody reads."""
    from cryptography.hazmat.primitives.asymmetric.utils import encode_dss_signature

    r, s = signature_of(signed())
    head = signed()[: signed().rindex(b".")]
    refuses(head + b"." + b64(encode_dss_signature(r, s)), "bytes, not 64")
    refuses(signed() + b"==", "not base64url")
    letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
    last = letters.index(signed()[-1:])
    for bits in range(1, 16):
        same = signed()[:-1] + letters[last ^ bits : (last ^ bits) + 1]
        assert signature_of(same) == (r, s)
        refuses(same, "not base64url")


def test_numbers_that_are_no_signature() -> None:
    """(0, 0) was accepted by Java for years (CVE-2022-21449)."""
    for r, s in ((0, 0), (0, 1), (1, 0), (ORDER, 1), (1, ORDER), (ORDER - 1, ORDER - 1), (2**256 - 1, 2**256 - 1)):
        refuses(with_signature(signed(), r, s))


def test_nothing_before_and_nothing_behind() -> None:
    for more in (b"\n", b" ", b"\r\n", b"\0", b".", b".e30", b"=", "\ufeff".encode()):
        refuses(signed() + more)
        refuses(more + signed())


@pytest.mark.requirement("R-PASSPORT")
def test_a_foreign_signature() -> None:
    foreign = sign(small(), key(1))
    refuses(foreign, "not trusted")
    refuses(resigned(header_of(signed()), number=1), "does not match")  # and says that it is the trusted key's
    refuses(signed(), "not trusted", number=1)
    both = trusted(0) | trusted(1)
    assert same(verify(foreign, both, now=LATER), verify(signed(), both, now=LATER))
    with pytest.raises(PassportInvalid, match="not trusted"):
        verify(signed(), {}, now=LATER)


def test_not_a_passport() -> None:
    for data in (b"", b".", b"..", b"...", b"a.b.c", result_json(), os.urandom(4096), b"A" * 10**6, b"." * 10**5):
        refuses(data)
        with pytest.raises(PassportInvalid):
            read(data)
    flat = {"payload": "", "signatures": []}
    refuses(json.dumps(flat).encode())


def test_one_that_is_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(passports, "PASSPORT", replace(PASSPORT, largest=1000))
    refuses(signed() + b"A" * 1000, "larger")
    with pytest.raises(InvalidArgument, match="larger"):
        sign(replace(small(), captured="x" * 1000), key())


def test_a_trusted_signer_who_errs() -> None:
    """Signed well and yet not in the form: refused, and no bug of ours."""
    for name in claimed(small()):
        for value in ("absent", None, "", -1, 1.5, True, [], {}, "x" * 32, 10**12, float(2**60)):
            claims = claimed(small()) | {name: value}
            if value == "absent":
                del claims[name]
            data = resigned(header_of(signed()), json.dumps(claims).encode())
            if name == "captured" and isinstance(value, str) and value != "absent":
                verify(data, trusted(), now=LATER)
            else:
                refuses(data, name if value != 10**12 else "")


def test_payloads_that_are_none() -> None:
    text = json.dumps(claimed(small()))
    twice = f'{text[:-1]}, "exp": 9999999999}}'
    for payload in (b"[]", b"1", b"\xff", text[:-1].encode(), twice.encode(), b"[" * 100_000, b'{"exp": NaN}'):
        refuses(resigned(header_of(signed()), payload))


def test_an_older_reader_leaves_out_what_it_does_not_know() -> None:
    claims = claimed(small()) | {"further": 1}
    assert same(verify(resigned(header_of(signed()), json.dumps(claims).encode()), trusted(), now=LATER), small())


# Other judges


def pyjwt_signs(header: dict[str, Any], payload: bytes) -> bytes:
    import jwt

    return jwt.api_jws.encode(payload, key(), algorithm="ES256", headers=header).encode()


def pyjwt_reads(data: bytes) -> bytes:
    import jwt

    return json.dumps(jwt.decode(data, pem(), algorithms=["ES256"])).encode()


def jwcrypto_signs(header: dict[str, Any], payload: bytes) -> bytes:
    from jwcrypto import jwk, jws

    token = jws.JWS(payload)
    token.add_signature(jwk.JWK.from_pyca(key()), None, json.dumps(header), None)
    return token.serialize(compact=True).encode()


def jwcrypto_reads(data: bytes) -> bytes:
    from jwcrypto import jwk, jwt

    return jwt.JWT(jwt=data.decode(), key=jwk.JWK.from_pem(pem())).claims.encode()


JUDGES = {
    "jwt": (pyjwt_signs, pyjwt_reads),
    "jwcrypto": (jwcrypto_signs, jwcrypto_reads),
}


@pytest.mark.requirement("R-PASSPORT")
@pytest.mark.parametrize("judge", JUDGES)
def test_other_programs_read_ours_with_their_defaults(judge: str) -> None:
    pytest.importorskip(judge, reason=f"{judge} is missing")
    drawn = create_passport(result_json(), PassportRequest(Unit(serial="A1")))  # of today: they look at the clock
    data = sign(drawn, key())
    assert json.loads(JUDGES[judge][1](data)) == claimed(drawn)
    other = data[:2000] + (b"B" if data[2000:2001] == b"A" else b"A") + data[2001:]
    with pytest.raises(Exception, match=r"(?i)signature"):
        JUDGES[judge][1](other)


@pytest.mark.requirement("R-PASSPORT")
@pytest.mark.parametrize("judge", JUDGES)
def test_signatures_of_other_programs(judge: str) -> None:
    """Three with the larger s and three with the smaller; altered in three places, none is accepted."""
    pytest.importorskip(judge, reason=f"{judge} is missing")
    header, payload = header_of(signed()), unb64(signed().split(b".")[1])
    assert json.loads(payload) == claimed(small())
    dice, count = random.Random(11), {True: 0, False: 0}
    while min(count.values()) < 3:
        data = JUDGES[judge][0](header, payload)
        high = signature_of(data)[1] > ORDER // 2
        if count[high] < 3:
            count[high] += 1
            assert same(verify(data, trusted(), now=LATER), small())
            refuses(with_signature(data, *(half + 1 for half in signature_of(data))))
            for _ in range(2):
                at = dice.randrange(len(data))
                letter = dice.choice([code for code in b"ABCDEFGHIJ" if code != data[at]])
                refuses(data[:at] + bytes([letter]) + data[at + 1 :])


@pytest.mark.requirement("R-PASSPORT")
@pytest.mark.full
def test_a_jvm_with_java_security_alone_agrees(tmp_path: Path) -> None:
    if shutil.which("java") is None:
        pytest.skip("no java here")
    (tmp_path / "key.pem").write_bytes(pem())
    r, s = signature_of(signed())
    files = {
        "good": signed(),
        "whole": sign(whole_passport(), key()),
        "changed": signed()[:300] + bytes([signed()[300] ^ 1]) + signed()[301:],
        "foreign": sign(small(), key(1)),
        "twin": with_signature(signed(), r, ORDER - s),
        "zero": with_signature(signed(), 0, 0),
        "none": b64(b'{"alg":"none"}') + b"." + signed().split(b".")[1] + b".",
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    paths = [str(tmp_path / name) for name in ("key.pem", *files)]
    call = ["java", "-XX:-UsePerfData", str(JUDGE), *paths]
    done = subprocess.run(call, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert dict(zip(files, done.stdout.split(), strict=True)) == {
        name: "valid" if name in ("good", "whole", "twin") else "invalid" for name in files
    }


def test_kotlin_was_told_what_is_so() -> None:
    """Every third case of passports/python.json.gz, which Kotlin is held to, is true of the rules of today."""
    known = stored()
    keys = {who: serialization.load_pem_public_key(entry["pem"].encode()) for who, entry in known["keys"].items()}
    assert {who: key_name(key) for who, key in keys.items()} == {w: k["name"] for w, k in known["keys"].items()}
    assert len(known["cases"]) > 300
    for case in known["cases"][::3]:
        at, data = datetime.fromtimestamp(case["at"], UTC), case["data"].encode("latin-1")
        answers = answer(data, {key_name(keys["signer"]): keys["signer"]}, at, case["revoked"])
        assert answers == {name: case[name] for name in answers}, case["name"]
    assert len(known["lists"]) > 40
    for revocations in known["lists"]:
        try:
            names: Any = sorted(
                read_revoked(revocations["data"].encode("latin-1"), {key_name(keys["signer"]): keys["signer"]}, LATER)
            )
        except PassportInvalid as error:
            names = error.message
        assert names == revocations["told"], revocations["name"]


@pytest.mark.requirement("R-PASSPORT")
def test_kotlins_passports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Signed by `java.security`: verified here, and shown alike."""
    known = json.loads((STORED / "kotlin.json").read_text("utf-8"))
    results = stored()
    (tmp_path / "key.pem").write_text(known["pem"])
    keys = read_public([tmp_path / "key.pem"])
    assert len(known["passports"]) == 3
    for case in known["passports"]:
        data = case["data"].encode()
        sha256 = hashlib.sha256(results[case["result"]].encode()).hexdigest()
        assert verify(data, keys, now=LATER).result_sha256 == sha256
        (tmp_path / "a.jws").write_bytes(data)
        assert cli.main(["passport", "show", str(tmp_path / "a.jws")]) == 0
        assert json.loads(capsys.readouterr().out) == case["shown"]
        for other in (data[:-1], data[:500] + data[501:], data.replace(b"A", b"B", 1)):
            with pytest.raises(PassportInvalid):
                verify(other, keys, now=LATER)


# Keys


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
    for wrong in (None, b"open", b""):
        with pytest.raises(InvalidArgument, match="is locked"):
            read_private(tmp_path / PRIVATE, wrong)
    body = base64.b64decode(b"".join((tmp_path / PRIVATE).read_bytes().splitlines()[1:-1]))
    assert ROUNDS == 100
    assert body.startswith(b"openssh-key-v1\0\0\0\0\x0aaes256-ctr\0\0\0\x06bcrypt")
    assert body[63:67] == ROUNDS.to_bytes(4, "big")  # behind the length and 16 bytes of salt (PROTOCOL.key)
    if shutil.which("ssh-keygen"):
        call = ["ssh-keygen", "-y", "-P", "open sesame", "-f", str(tmp_path / PRIVATE)]
        said = subprocess.run(call, capture_output=True, timeout=60, check=True).stdout
        (public,) = read_public([tmp_path / PUBLIC]).values()
        assert public == serialization.load_ssh_public_key(said)
    with pytest.raises(InvalidArgument, match="1023"):
        make_key(tmp_path / "long", b"a" * 1024)
    make_key(tmp_path / "open")
    with pytest.raises(InvalidArgument, match="not locked"):
        read_private(tmp_path / "open" / PRIVATE, b"open sesame")


@pytest.mark.parametrize("passphrase", [None, b"open sesame"])
def test_a_key_of_openssl(tmp_path: Path, passphrase: bytes | None) -> None:
    """PKCS 8 in PEM."""
    lock = serialization.BestAvailableEncryption(passphrase) if passphrase else serialization.NoEncryption()
    made = key().private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, lock)
    (tmp_path / "key.pem").write_bytes(made)
    (tmp_path / "key.pem").chmod(0o600)
    assert key_name(read_private(tmp_path / "key.pem", passphrase).public_key()) == next(iter(trusted()))
    other = None if passphrase else b"open sesame"
    with pytest.raises(InvalidArgument, match="locked"):
        read_private(tmp_path / "key.pem", other)


def test_a_damaged_key(tmp_path: Path) -> None:
    """Whatever byte of it is another."""
    make_key(tmp_path)
    first, *middle, last = (tmp_path / PRIVATE).read_bytes().splitlines()
    body = base64.b64decode(b"".join(middle))
    for at in range(len(body)):
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


def other_pem(kind: str, public: bool) -> bytes:
    made: Any = {
        "rsa": lambda: rsa.generate_private_key(65537, 2048),
        "secp256k1": lambda: ec.generate_private_key(ec.SECP256K1()),
        "secp384r1": lambda: ec.generate_private_key(ec.SECP384R1()),
    }[kind]()
    if public:
        return bytes(
            made.public_key().public_bytes(
                serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
            )
        )
    return bytes(
        made.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
    )


@pytest.mark.parametrize("kind", ["rsa", "secp256k1", "secp384r1"])
def test_keys_of_another_kind(tmp_path: Path, kind: str) -> None:
    (tmp_path / "private").write_bytes(other_pem(kind, False))
    (tmp_path / "private").chmod(0o600)
    (tmp_path / "public").write_bytes(other_pem(kind, True))
    with pytest.raises(InvalidArgument, match="P-256"):
        read_private(tmp_path / "private")
    with pytest.raises(InvalidArgument, match="P-256"):
        read_public([tmp_path / "public"])


def test_files_that_are_no_keys(tmp_path: Path) -> None:
    make_key(tmp_path)
    (tmp_path / "no").write_bytes(b"-----BEGIN PRIVATE KEY-----\nAAAA\n-----END PRIVATE KEY-----\n")
    for path in (tmp_path / "no", tmp_path / PUBLIC, tmp_path / "missing", tmp_path):
        with pytest.raises(InvalidArgument):
            read_private(path)
    for path in (tmp_path / "no", tmp_path / PRIVATE, tmp_path / "missing", tmp_path):
        with pytest.raises(InvalidArgument):
            read_public([path])


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


# The unit, by its file


def tiff(first: dict[int, Any], exif: dict[int, Any]) -> bytes:
    """A TIFF of two directories: text, or (numerator, denominator)."""

    def directory(at: int, tags: dict[int, Any]) -> bytes:
        entries, rest = b"", b""
        behind = at + 2 + 12 * len(tags) + 4
        for tag, value in sorted(tags.items()):
            kind, count, data = (
                (2, len(value) + 1, value.encode() + b"\0") if isinstance(value, str)
                else (4, 1, struct.pack("<I", value)) if isinstance(value, int)
                else (5, 1, struct.pack("<II", *value))
            )  # fmt: skip
            if len(data) > 4:
                entries += struct.pack("<HHII", tag, kind, count, behind + len(rest))
                rest += data
            else:
                entries += struct.pack("<HHI4s", tag, kind, count, data)
        return struct.pack("<H", len(tags)) + entries + b"\0\0\0\0" + rest

    main = directory(8, first | {34665: 0})
    return (
        b"II*\0"
        + struct.pack("<I", 8)
        + directory(8, first | {34665: 8 + len(main)})
        + directory(8 + len(main), exif)
    )


FIRST = {271: "Maker", 272: "Model", 50735: "body 9"}
EXIF = {
    42036: "Wide 24 mm", 37386: (247, 10), 33437: (18, 10), 36867: "2026:11:20 09:15:00", 36881: "+01:00",
}  # fmt: skip
BODY = Unit("Maker", "Model", "", "body 9", serial_check("Maker", "Model", "body 9"))
WHOLE = replace(BODY, lens="Wide 24 mm", focal_length=24.7, aperture=1.8)
OTHER = replace(WHOLE, serial="serial 1", serial_check=serial_check("Maker", "Model", "serial 1"))


@pytest.mark.parametrize(
    ("first", "exif", "unit", "time"),
    [
        (FIRST, EXIF, WHOLE, "2026-11-20T09:15:00+01:00"),
        (
            FIRST,
            EXIF | {42033: "serial 1"},
            OTHER,
            "2026-11-20T09:15:00+01:00",
        ),
        (FIRST, {36867: "2026:11:20 09:15:00"}, BODY, "2026-11-20T09:15:00"),
        ({271: "Maker", 50708: "Unique"}, {}, Unit("Maker", "Unique"), ""),
        ({}, {36867: "0000:00:00 00:00:00"}, Unit(), ""),
        ({}, {36867: "    :  :     :  :  "}, Unit(), ""),
        ({}, {36867: "2026:13:45 99:99:99"}, Unit(), ""),
        ({}, {37386: (0, 1), 33437: (1, 0)}, Unit(), ""),
        ({37386: (50, 1), 33437: (4, 1)}, {}, Unit(focal_length=50.0, aperture=4.0), ""),
    ],
)
def test_what_a_file_says(tmp_path: Path, first: Any, exif: Any, unit: Unit, time: str) -> None:
    file = tmp_path / "a.dng"
    file.write_bytes(tiff(first, exif))
    assert read_unit(file) == Taken(unit, time, hashlib.sha256(file.read_bytes()).hexdigest())


def test_files_that_cannot_tell(tmp_path: Path) -> None:
    whole = tiff(FIRST, EXIF)
    file = tmp_path / "a.dng"
    with pytest.raises(UnreadableRaw):
        read_unit(file)
    with pytest.raises(UnreadableRaw):
        read_unit(tmp_path)
    for length in range(0, len(whole), 7):  # cut off: an answer or a refusal, no bug
        file.write_bytes(whole[:length])
        with pytest.raises(UnreadableRaw):
            read_unit(file)


def test_units_that_differ() -> None:
    assert WHOLE.differs(Unit()) == WHOLE.differs(WHOLE) == ()
    assert WHOLE.differs(replace(WHOLE, serial="x", aperture=2.0)) == ("serial", "aperture")
    assert Unit(lens="Wide 24 mm").filled(WHOLE) == WHOLE


def test_photos_speak_for_the_unit(tmp_path: Path) -> None:
    file = tmp_path / "a.dng"
    file.write_bytes(tiff(FIRST, EXIF))
    whole = document()
    (shot,) = whole.capture.shots

    def taken(**change: str) -> bytes:
        photo = replace(shot.photo, make="Maker", model="Model", **change)
        return document_bytes(replace(whole, capture=replace(whole.capture, shots=(replace(shot, photo=photo),))))

    with pytest.raises(InvalidArgument, match="not made from"):
        create_passport(taken(), PassportRequest(), photos=[file])
    data = taken(sha256=hashlib.sha256(file.read_bytes()).hexdigest())
    drawn = create_passport(data, PassportRequest(Unit(camera_id="2")), photos=[file])
    assert (drawn.unit, drawn.captured) == (replace(WHOLE, camera_id="2"), "2026-11-20T09:15:00+01:00")
    assert (
        create_passport(data, PassportRequest(captured="2026-11-21T00:00"), photos=[file]).captured
        == "2026-11-21T00:00:00"
    )
    with pytest.raises(InvalidArgument, match="serial is 'body 9' there, not 'x'"):
        create_passport(data, PassportRequest(Unit(serial="x")), photos=[file])


# The command line


@pytest.fixture
def desk(tmp_path: Path) -> Path:
    """A folder with a result, a pair of keys and a passport."""
    (tmp_path / "result.json").write_bytes(result_json())
    result, private, out = (str(tmp_path / name) for name in ("result.json", PRIVATE, "camera.jws"))
    for words in (
        ["key", "-o", str(tmp_path)],
        ["sign", result, "--key", private, "--serial", "A1", "--days", "90", "-o", out],
    ):
        assert cli.main(["passport", *words]) == 0
    return tmp_path


@dataclass
class Done:
    returncode: int
    stdout: bytes
    stderr: bytes


def run(folder: Path, *words: str, stdin: bytes = b"") -> Done:
    """The command in this folder: what it reads and writes is bytes, as in a process of its own."""
    out, err, entered = (io.TextIOWrapper(io.BytesIO(data), "utf-8") for data in (b"", b"", stdin))
    with chdir(folder), redirect_stdout(out), redirect_stderr(err), pytest.MonkeyPatch.context() as patched:
        patched.setattr("sys.stdin", entered)
        status = cli.main(["passport", *words])
    out.flush()
    err.flush()
    return Done(status, out.buffer.getvalue(), err.buffer.getvalue())


def test_sign_verify_show(desk: Path) -> None:
    data = (desk / "camera.jws").read_bytes()
    for words, stdin in ((["camera.jws"], b""), (["-"], data)):
        done = run(desk, "verify", *words, "--key", PUBLIC, "--result", "result.json", stdin=stdin)
        assert done.returncode == 0, done.stderr
        shown_claims = json.loads(done.stdout)
        assert shown_claims.pop("excerpt") == {
            "result_sha256": hashlib.sha256(result_json()).hexdigest(), "passport": data.decode()
        }  # fmt: skip
        assert shown_claims == excerpt_in(result_json())
        again = run(desk, "verify", "-", "--key", PUBLIC, stdin=done.stdout)
        assert (again.returncode, again.stdout) == (0, done.stdout), again.stderr
    shown = run(desk, "show", "camera.jws")
    shown_claims = json.loads(shown.stdout)
    assert (shown_claims["verified"], shown_claims["format"], shown_claims["unit"]["serial"]) == (False, FORMAT, "A1")
    assert shown_claims["verdict"] == document().verdict.status
    assert b"not verified" in shown.stderr
    (desk / "revoked.txt").write_text(shown_claims["id"])
    assert run(desk, "revoke", shown_claims["id"], "--key", PRIVATE, "-o", "revoked.jws").returncode == 0
    for more in (
        ["--revoked", "revoked.jws"], ["--revoked", "revoked.txt"], ["--result", PUBLIC],
    ):  # fmt: skip
        done = run(desk, "verify", "camera.jws", "--key", PUBLIC, *more)
        assert (done.returncode, done.stdout) == (PassportInvalid.exit_status, b""), more
        assert b"passport_invalid" in done.stderr
    done = run(desk, "verify", "camera.jws", "--key", PUBLIC, "--revoked", "missing.txt")
    assert (done.returncode, done.stdout) == (InvalidArgument.exit_status, b"")


def test_the_private_key_is_nowhere(desk: Path) -> None:
    """In no output, no passport, no traceback; and no passphrase either."""
    (desk / "phrase").write_text("correct horse\n")
    assert run(desk, "--passphrase", "phrase", "key", "-o", "locked").returncode == 0
    private = (desk / PRIVATE).read_bytes()
    number = read_private(desk / PRIVATE).private_numbers().private_value
    secrets = [line for line in private.splitlines() if b"-----" not in line]
    secrets += [str(number).encode(), f"{number:x}".encode(), b64(number.to_bytes(32, "big")), b"correct horse"]
    (desk / "broken.pem").write_bytes(private[:120] + b"!" + private[120:])
    locked = ["sign", "result.json", "--key", f"locked/{PRIVATE}", "-o", "b.jws", "--debug"]
    said = b""
    for words, status in (
        (["sign", "result.json", "--key", PRIVATE, "-o", "a.jws", "--debug"], 0),
        (["--passphrase", "phrase", *locked], 0),
        (locked, 2),
        (["--passphrase", "result.json", *locked], 2),
        (["sign", "result.json", "--key", "broken.pem", "-o", "c.jws", "--debug"], 2),
        (["sign", "result.json", "--key", PRIVATE, "-o", "no/where.jws", "--debug"], 2),
        (["verify", "camera.jws", "--key", PRIVATE, "--debug"], 2),
        (["show", PRIVATE, "--debug"], 10),
    ):
        done = run(desk, *words)
        assert done.returncode == status, (words, done.stderr)
        said += done.stdout + done.stderr
    for name in ("a.jws", "b.jws", "camera.jws"):
        said += (desk / name).read_bytes() + b"".join(map(unb64, (desk / name).read_bytes().split(b".")))
    assert len(secrets) >= 7
    assert not [secret for secret in secrets if secret in said]


@pytest.mark.full
def test_a_process_of_its_own_verifies(desk: Path) -> None:
    call = [sys.executable, "-m", "camssf", "passport", "verify", "-", "--key", PUBLIC]
    done = subprocess.run(
        call, cwd=desk, input=(desk / "camera.jws").read_bytes(), capture_output=True, timeout=120, check=True,
        env=os.environ | {"PYTHONPATH": SEARCH},
    )  # fmt: skip
    assert json.loads(done.stdout)["format"] == "camssf-result/1"
    assert b"serial A1" in done.stderr
    assert b"verified" in done.stderr


def test_a_list_is_renewed(desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing that was called back is lost: a list that exists is extended, if this key signed it."""
    files = [str(desk / "revoked.jws"), str(desk / PRIVATE), str(desk / PUBLIC)]
    here, private, public = files
    call = ["passport", "revoke", "--key", private, "-o", here]
    assert cli.main(call) == InvalidArgument.exit_status  # nothing is called back
    assert cli.main([*call, "x"]) == InvalidArgument.exit_status
    assert cli.main([*call, "f" * 32]) == 0
    assert cli.main(call) == 0  # dated anew
    assert cli.main([*call, "e" * 32]) == 0
    hyphen = "-I" + "o" * 41  # a key's name may look like options
    assert cli.main([*call, hyphen, "--days", "1"]) == 0
    assert cli.main([*call, "--", "-" + "k" * 42]) == 0
    keys = read_public([public])
    assert read_revoked((desk / "revoked.jws").read_bytes(), keys) == {"e" * 32, "f" * 32, hyphen, "-" + "k" * 42}
    (desk / "own").mkdir()
    make_key(desk / "own")
    before = (desk / "revoked.jws").read_bytes()
    strange = ["passport", "revoke", "f" * 32, "--key", str(desk / "own" / PRIVATE), "-o", here]
    assert cli.main(strange) == PassportInvalid.exit_status
    capsys.readouterr()
    for other in (private, str(desk / "camera.jws")):
        kept = Path(other).read_bytes()
        assert cli.main([*call[:-1], other, "f" * 32]) in (InvalidArgument.exit_status, PassportInvalid.exit_status)
        assert Path(other).read_bytes() == kept
    assert (desk / "revoked.jws").read_bytes() == before


def test_what_was_printed_serves_as_a_result_where_an_excerpt_will_do(
    desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    public, data = str(desk / PUBLIC), str(desk / "y.json")
    assert cli.main(["passport", "verify", str(desk / "camera.jws"), "--key", public]) == 0
    (desk / "y.json").write_text(capsys.readouterr().out, "utf-8")
    for form in ("csv", "icc"):
        assert cli.main(["export", data, "--to", form, "-o", str(desk / f"y.{form}")]) == 0
    assert hashlib.sha256(result_json()).hexdigest() in (desk / "y.csv").read_text("utf-8")
    capsys.readouterr()
    for words in (
        ["report", data, "-o", str(desk / "out")],
        ["passport", "sign", data, "--key", str(desk / PRIVATE), "-o", "x"],
    ):
        capsys.readouterr()
        assert cli.main(words) == InvalidArgument.exit_status
        assert "whole result.json, of SHA-256" in " ".join(capsys.readouterr().err.split())


def test_two_hundred_megabytes(desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In whatever place: the documented status, soon, since no more is read than may be there."""
    with open(desk / "huge", "wb") as file:
        file.write(b"{")
        file.truncate(200 * 10**6)
    (desk / "huge").chmod(0o600)
    monkeypatch.chdir(desk)
    for words, status in (
        (["verify", "huge", "--key", PUBLIC], 10),
        (["verify", "-", "--key", PUBLIC], 10),
        (["show", "huge"], 10),
        (["verify", "camera.jws", "--key", PUBLIC, "--revoked", "huge"], 10),
        (["verify", "camera.jws", "--key", PUBLIC, "--result", "huge"], 2),
        (["verify", "camera.jws", "--key", "huge"], 2),
        (["sign", "huge", "--key", PRIVATE, "-o", "x.jws"], 2),
        (["sign", "result.json", "--key", "huge", "-o", "x.jws"], 2),
        (["--passphrase", "huge", "sign", "result.json", "--key", PRIVATE, "-o", "x.jws"], 2),
        (["revoke", "--key", PRIVATE, "-o", "huge"], 10),
    ):
        with open("huge", "rb") as file, io.TextIOWrapper(file) as text:
            monkeypatch.setattr("sys.stdin", text)
            assert cli.main(["passport", *words]) == status, words
    with open("huge", "r+b") as file:
        file.write(b"A.")
    for words in (["verify", "huge", "--key", PUBLIC], ["show", "huge"]):
        assert cli.main(["passport", *words]) == 10, words
    assert not (desk / "x.jws").exists()
