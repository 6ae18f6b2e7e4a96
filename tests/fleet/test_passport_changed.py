"""Passports that were changed or never right are refused; other libraries, a JVM and Kotlin judge alike."""

import hashlib
import hmac
import json
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import jwt
import pytest
from cryptography.hazmat.primitives import serialization
from jwcrypto import jwk
from jwcrypto.jwt import JWT

from camssf import cli
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.photo.read.unit import Unit
from camssf_fleet.passport import document as passports
from camssf_fleet.passport.document import FORMAT, PASSPORT, PassportRequest, create_passport, sign, verify
from camssf_fleet.passport.jws import sign_jws, verify_jws
from camssf_fleet.passport.keys import key_name, read_public
from tests.support import signed_passports as samples
from tests.support.signed_passports import accepts, claimed, fixed_key, refuses, result_json, signed, small, trusted

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


@pytest.mark.full
@pytest.mark.requirement("R-PASSPORT")
def test_stored_documents_are_judged_as_kotlin_is_told() -> None:
    """Most are signed well by the trusted key and yet no passport: header, claims, result, JSON, signature, time."""
    known = samples.stored()
    keys = {who: serialization.load_pem_public_key(entry["pem"].encode()) for who, entry in known["keys"].items()}
    assert {who: key_name(key) for who, key in keys.items()} == {w: k["name"] for w, k in known["keys"].items()}
    signer = {key_name(keys["signer"]): keys["signer"]}
    accepted = set()
    for case in known["cases"]:
        at, data = datetime.fromtimestamp(case["at"], UTC), case["data"].encode("latin-1")
        answers = samples.answer(data, signer, at, case["revoked"])
        assert answers == {name: case[name] for name in answers}, case["name"]
        if isinstance(answers["verified"], dict):
            accepted.add(case["name"])
    assert len(known["cases"]) > 370
    (twin,) = accepted - SOUND
    assert twin.startswith("signature ")
    assert accepted > SOUND
    lists = {case["name"]: samples.read_list(case["data"].encode("latin-1"), signer) for case in known["lists"]}
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


@pytest.mark.requirement("R-PASSPORT")
def test_swapped_algorithms() -> None:
    """The old tricks: no signature at all; the public key as the secret of an HMAC."""
    header, payload, signature = signed().split(b".")
    for alg in ("none", "HS256", "ES256"):
        text = samples.b64(json.dumps(json.loads(samples.unb64(header)) | {"alg": alg}).encode()) + b"." + payload
        macs = (samples.b64(hmac.digest(secret, text, "sha256")) for secret in (samples.pem(), samples.pem().strip()))
        for mac in (b"", *macs, signature):
            refuses(text + b"." + mac)


def test_one_that_is_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    data = signed()
    monkeypatch.setattr(passports, "PASSPORT", replace(PASSPORT, largest=1000))
    refuses(data + b"A" * 1000, "larger")
    with pytest.raises(InvalidArgument, match="larger"):
        sign(replace(small(), captured="x" * 1000), fixed_key())


@pytest.mark.requirement("R-PASSPORT")
def test_other_programs_read_ours_and_ours_reads_theirs() -> None:
    """PyJWT and jwcrypto, with their defaults."""
    drawn = create_passport(result_json(), PassportRequest(Unit(serial="A1")))  # of today: they look at the clock
    data = sign(drawn, fixed_key())
    changed = data[:2000] + (b"B" if data[2000:2001] == b"A" else b"A") + data[2001:]
    for claims_in in (
        lambda token: jwt.decode(token, samples.pem(), algorithms=["ES256"]),
        lambda token: json.loads(JWT(jwt=token.decode(), key=jwk.JWK.from_pem(samples.pem())).claims),
    ):
        assert claims_in(data) == claimed(drawn)
        with pytest.raises(Exception, match=r"(?i)signature"):
            claims_in(changed)
    header, payload, _ = (samples.unb64(part) for part in signed().split(b"."))
    for _ in range(8):  # the smaller s, and the larger
        theirs = jwt.api_jws.encode(payload, fixed_key(), algorithm="ES256", headers=json.loads(header))
        accepts(theirs.encode())


@pytest.mark.requirement("R-PASSPORT")
def test_kotlins_passports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Signed by `java.security`: verified here, and shown alike."""
    known, results = json.loads((samples.FOLDER / "kotlin.json").read_text("utf-8")), samples.stored()
    (tmp_path / "key.pem").write_text(known["pem"])
    keys = read_public([tmp_path / "key.pem"])
    assert len(known["passports"]) == 3
    for case in known["passports"]:
        data = case["data"].encode()
        sha256 = hashlib.sha256(results[case["result"]].encode()).hexdigest()
        assert verify(data, keys, now=samples.LATER).result_sha256 == sha256
        (tmp_path / "a.jws").write_bytes(data)
        assert cli.main(["passport", "show", str(tmp_path / "a.jws")]) == 0
        assert json.loads(capsys.readouterr().out) == case["shown"]
        for other in (data[:-1], data[:500] + data[501:], data.replace(b"A", b"B", 1)):
            with pytest.raises(PassportInvalid):
                verify(other, keys, now=samples.LATER)
