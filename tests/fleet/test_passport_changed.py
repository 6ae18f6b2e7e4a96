"""Passports that were changed or never right are refused; other libraries, a JVM and Kotlin judge alike."""

import hashlib
import hmac
import json
import os
import random
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from camssf import cli
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.photo.read.unit import Unit

pytest.importorskip("cryptography", reason="cryptography is not here")
pytest.importorskip("joserfc", reason="joserfc is not here")

from cryptography.hazmat.primitives import serialization
from joserfc import jws
from joserfc.jwk import ECKey

from camssf_fleet.passport import document as passports
from camssf_fleet.passport.document import (
    FORMAT,
    PASSPORT,
    PassportRequest,
    create_passport,
    read,
    sign,
    verify,
)
from camssf_fleet.passport.jws import ORDER, sign_jws, verify_jws
from camssf_fleet.passport.keys import key_name, read_public
from tests.support.fixed_passports import (
    accepts,
    fixed_key,
    pem,
    refuses,
    result_json,
    signed,
    trusted,
    whole_passport,
)
from tests.support.signed_passports import (
    FOLDER,
    LATER,
    LETTERS,
    answer,
    b64,
    claimed,
    numbers,
    raw,
    read_list,
    small,
    stored,
    unb64,
)

JUDGE = Path(__file__).with_name("PassportJudge.java")
SOUND = {
    "small", "whole", "at 2026-11-22T03:00:00+00:00", "at 2027-11-22T02:59:59+00:00",
    "revoked ffffffffffffffffffffffffffffffff", "result: bands", "result: no bands",
    "result: a member of a later release", "curve: peak 1.0", "curve: negative", "bands without a peak",
    "a header in another spelling", "captured is ''", "captured is 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx'",
    "unit make ''", "unit model ''", "unit camera_id ''", "unit serial ''", "unit serial_check 'absent'",
    "unit serial_check None", "unit serial_check 7", "unit serial_check -7", "unit serial_check ''",
    "unit serial_check []", "unit serial_check ['', 1]", "unit lens ''", "unit focal_length None",
    "unit focal_length 7", "unit aperture None", "unit aperture 7", "serials chart ''", "serials lamps []",
    "software version ''", "iat as b'-0'", "iat as b'0'", "iat as b'253402300799'", "JSON: 1e999", "JSON: -0.0E+5",
    "JSON: 4300 digits", "JSON: digits of a fraction", "JSON: DEL", "JSON: escapes", "JSON: half a letter",
    "JSON: blanks", "JSON: deep but not too deep", "JSON: literals", "JSON: a surrogate pair",
}  # fmt: skip
"""Stored documents that are accepted, beside (r, n - s), the other valid signature of ES256 (FIPS 186-5)."""


@pytest.mark.requirement("R-PASSPORT")
def test_stored_documents_are_judged_as_kotlin_is_told() -> None:
    """Most are signed well by the trusted key and yet no passport: header, claims, result, JSON, signature, time."""
    known = stored()
    keys = {who: serialization.load_pem_public_key(entry["pem"].encode()) for who, entry in known["keys"].items()}
    assert {who: key_name(key) for who, key in keys.items()} == {w: k["name"] for w, k in known["keys"].items()}
    signer = {key_name(keys["signer"]): keys["signer"]}
    accepted = set()
    for case in known["cases"]:
        at, data = datetime.fromtimestamp(case["at"], UTC), case["data"].encode("latin-1")
        answers = answer(data, signer, at, case["revoked"])
        assert answers == {name: case[name] for name in answers}, case["name"]
        if isinstance(answers["verified"], dict):
            accepted.add(case["name"])
    assert len(known["cases"]) > 370
    (twin,) = accepted - SOUND
    assert twin.startswith("signature ")
    assert accepted > SOUND
    lists = {case["name"]: read_list(case["data"].encode("latin-1"), signer) for case in known["lists"]}
    assert lists == {case["name"]: case["told"] for case in known["lists"]}
    names = {name for name, told in lists.items() if isinstance(told, list)}
    assert names == {"good", "empty", "issued later", "revoked []"}


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
    short = sign_jws({"format": FORMAT}, PASSPORT, fixed_key())
    assert verify_jws(short, PASSPORT, trusted())[0] == {"format": FORMAT}
    others = [data for data in turned(short) if data != short]
    for data in others:
        with pytest.raises(PassportInvalid):
            verify_jws(data, PASSPORT, trusted())
        refuses(data)
    assert len(others) == 11 * len(short)  # eight bits, left out, doubled, cut off


def signature_of(data: bytes) -> tuple[int, int]:
    both = unb64(data.split(b".")[2])
    return int.from_bytes(both[:32], "big"), int.from_bytes(both[32:], "big")


def with_signature(data: bytes, r: int, s: int) -> bytes:
    return data[: data.rindex(b".") + 1] + numbers(r, s)


def with_payload(data: bytes, dice: random.Random) -> bytes:
    """One claim of the payload is another; the signature stays."""
    header, payload, signature = data.split(b".")
    claims = json.loads(unb64(payload))
    name = dice.choice(sorted(claims))
    claims[name] = dice.choice([None, 0, "x", [], {}, claims["exp"] + 1, dice.random()])
    return b".".join((header, b64(json.dumps(claims).encode()), signature))


def mutated(data: bytes, dice: random.Random) -> bytes:
    """What a disk, a mail program or an attacker without a key may do."""
    i, j = sorted(dice.sample(range(len(data) + 1), 2))
    some = bytes(dice.choice(LETTERS) for _ in range(dice.randint(1, 8)))
    r, s = signature_of(data)
    return dice.choice([
        lambda: data[:i] + data[j:],
        lambda: data[:i] + some + data[i:],
        lambda: data[:i] + some + data[i + len(some) :],
        lambda: data[:i] + bytes([dice.randrange(256)]) + data[i + 1 :],
        lambda: data[:i] + data[i:j][::-1] + data[j:],
        lambda: with_signature(data, r, (s + dice.randrange(1, ORDER)) % ORDER),  # n - s: one in 2^256
        lambda: with_signature(data, dice.randrange(ORDER), s),
        lambda: with_payload(data, dice),
    ])()  # fmt: skip


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
    head = header if isinstance(header, bytes) else json.dumps(header).encode()
    text = b64(head) + b"." + (signed().split(b".")[1] if payload is None else b64(payload))
    return raw(text, fixed_key(number))


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
    public = ECKey.import_key(fixed_key().public_key())
    for token in (*map(resigned, heads), resigned(form, b"")):
        jws.deserialize_compact(token, public, algorithms=["ES256"])
        refuses(token)
    for head in (b'"alg"', b'["alg"]'):
        with pytest.raises(TypeError):
            jws.deserialize_compact(resigned(head), public, algorithms=["ES256"])
        refuses(resigned(head), "header is not an object")
    refuses(resigned(text.encode() + b" " * 1024), "three parts")  # joserfc would read half of that
    accepts(resigned(text.encode() + b" " * 500))


@pytest.mark.requirement("R-PASSPORT")
def test_swapped_algorithms() -> None:
    """The old tricks: no signature at all; the public key as the secret of an HMAC."""
    _header, payload, signature = signed().split(b".")
    for alg in ("none", "HS256", "ES256"):
        text = b64(json.dumps(header_of(signed()) | {"alg": alg}).encode()) + b"." + payload
        macs = (b64(hmac.digest(secret, text, "sha256")) for secret in (pem(), pem().strip()))
        for mac in (b"", *macs, signature):
            refuses(text + b"." + mac)


@pytest.mark.requirement("R-PASSPORT")
def test_a_foreign_signature() -> None:
    foreign = sign(small(), fixed_key(1))
    refuses(foreign, "not trusted")
    accepts(foreign, number=1)
    refuses(resigned(header_of(signed()), number=1), "does not match")  # and says that it is the trusted key's
    with pytest.raises(PassportInvalid, match="not trusted"):
        verify(signed(), {}, now=LATER)


def test_not_a_passport() -> None:
    flat = json.dumps({"payload": "", "signatures": []}).encode()
    for data in (
        b"",
        b".",
        b"..",
        b"...",
        b"a.b.c",
        result_json(),
        os.urandom(4096),
        b"A" * 10**6,
        b"." * 10**5,
        flat,
    ):
        refuses(data)
        with pytest.raises(PassportInvalid):
            read(data)


def test_one_that_is_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(passports, "PASSPORT", replace(PASSPORT, largest=1000))
    refuses(signed() + b"A" * 1000, "larger")
    with pytest.raises(InvalidArgument, match="larger"):
        sign(replace(small(), captured="x" * 1000), fixed_key())


# Other judges


def pyjwt_signs(header: dict[str, Any], payload: bytes) -> bytes:
    import jwt

    return jwt.api_jws.encode(payload, fixed_key(), algorithm="ES256", headers=header).encode()


def pyjwt_reads(data: bytes) -> bytes:
    import jwt

    return json.dumps(jwt.decode(data, pem(), algorithms=["ES256"])).encode()


def jwcrypto_signs(header: dict[str, Any], payload: bytes) -> bytes:
    from jwcrypto import jwk, jws

    token = jws.JWS(payload)
    token.add_signature(jwk.JWK.from_pyca(fixed_key()), None, json.dumps(header), None)
    return token.serialize(compact=True).encode()


def jwcrypto_reads(data: bytes) -> bytes:
    from jwcrypto import jwk, jwt

    return jwt.JWT(jwt=data.decode(), key=jwk.JWK.from_pem(pem())).claims.encode()


JUDGES = {"jwt": (pyjwt_signs, pyjwt_reads), "jwcrypto": (jwcrypto_signs, jwcrypto_reads)}


@pytest.mark.requirement("R-PASSPORT")
@pytest.mark.parametrize("judge", JUDGES)
def test_other_programs_read_ours_with_their_defaults(judge: str) -> None:
    pytest.importorskip(judge, reason=f"{judge} is missing")
    drawn = create_passport(result_json(), PassportRequest(Unit(serial="A1")))  # of today: they look at the clock
    data = sign(drawn, fixed_key())
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
            accepts(data)
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
        "whole": sign(whole_passport(), fixed_key()),
        "changed": signed()[:300] + bytes([signed()[300] ^ 1]) + signed()[301:],
        "foreign": sign(small(), fixed_key(1)),
        "twin": with_signature(signed(), r, ORDER - s),
        "zero": with_signature(signed(), 0, 0),
        "none": b64(b'{"alg":"none"}') + b"." + signed().split(b".")[1] + b".",
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    call = ["java", "-XX:-UsePerfData", str(JUDGE), *(str(tmp_path / name) for name in ("key.pem", *files))]
    done = subprocess.run(call, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    judged = dict(zip(files, done.stdout.split(), strict=True))
    assert judged == {name: "valid" if name in ("good", "whole", "twin") else "invalid" for name in files}


@pytest.mark.requirement("R-PASSPORT")
def test_kotlins_passports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Signed by `java.security`: verified here, and shown alike."""
    known, results = json.loads((FOLDER / "kotlin.json").read_text("utf-8")), stored()
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
