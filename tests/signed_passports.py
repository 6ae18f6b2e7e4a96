"""What Python says of passports, for Kotlin's tests: `python tests/signed_passports.py` writes them anew.

Sound ones and broken ones, most of them signed well, with what `verify` and `read` answer, in passports/python.json.
Keys are made here, sign, and are gone: the file holds the public ones only. So a new file has other bytes each time.
"""

from __future__ import annotations

import base64
import copy
import json
from dataclasses import asdict, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature, encode_dss_signature
from cryptography.hazmat.primitives.hashes import SHA256
from test_report import document

from camssf.documents.keys import key_name, unpadded
from camssf.documents.passport import ORDER, Passport, Said, draw_up, read, sign, verify
from camssf.documents.report import report
from camssf.errors import PassportInvalid
from camssf.files import write_file
from camssf.photo.unit import Unit

FOLDER = Path(__file__).with_name("passports")
NOW = datetime(2026, 11, 22, 3, 0, tzinfo=UTC)
LATER = NOW + timedelta(days=30)
PAYLOADS: dict[str, bytes] = {
    "a list": b'[]', "a number": b'1', "no UTF-8": b'\xff', "a BOM": b'\xef\xbb\xbf{}', "nothing": b' ',
    "two": b'{}{}', "deep": b"[" * 10_000, "an overlong letter": b'{"a":"\xc0\xaf"}',
    "half a letter in UTF-8": b'{"a":"\xed\xa0\x80"}',
}  # fmt: skip
SNIPPETS: dict[str, bytes] = {
    "NaN": b'"x":NaN', "Infinity": b'"x":-Infinity', "a word": b'"x":word', "True": b'"x":True', "00": b'"x":00',
    "01": b'"x":01', "-": b'"x":-', "-01": b'"x":-01', "1.": b'"x":1.', ".5": b'"x":.5', "+1": b'"x":+1',
    "1e": b'"x":1e', "1e+": b'"x":1e+', "0x1": b'"x":0x1', "1e999": b'"x":1e999', "-0.0E+5": b'"x":-0.0E+5',
    "4300 digits": b'"x":' + b"9" * 4300, "4301 digits": b'"x":-' + b"9" * 4301,
    "digits of a fraction": b'"x":0.' + b"9" * 4400, "a control character": b'"x":"\x01"',
    "an end of line": b'"x":"\n"', "DEL": b'"x":"\x7f"', "an escape that is none": b'"x":"\\x41"',
    "a short escape": b'"x":"\\u12"', "a wrong escape": b'"x":"\\u00g0"',
    "escapes": b'"x":"\\"\\\\\\/\\b\\f\\n\\r\\t\\u00e9\\uD83D\\uDE00"', "half a letter": b'"x":"\\ud800"',
    "single quotes": b"'x':1", "no quotes": b'x:1', "a comma behind": b'"x":[1,]', "two commas": b'"x":[1,,2]',
    "a comment": b'/* */"x":1', "no colon": b'"x" 1', "blanks": b' \t\r\n"x" \n: [ 1 , {} , [ ] ] ',
    "a hard blank": b'\xc2\xa0"x":1', "a form feed": b'\x0c"x":1',
    "deep but not too deep": b'"x":' + b"[" * 400 + b"]" * 400, "twice": b'"x":1,"x":2',
    "twice by an escape": b'"x":1,"\\u0078":2', "twice inside": b'"x":{"y":[{"z":1,"z":1}]}',
    "exp twice": b'"exp":9999999999', "literals": b'"x":[true,false,null]', "a surrogate pair": '"x":"😀"'.encode(),
}  # fmt: skip
HEADERS: list[dict[str, Any]] = [
    {"alg": "none"}, {"alg": "None"}, {"alg": "HS256"}, {"alg": "ES384"}, {"alg": "RS256"}, {"alg": "es256"},
    {"alg": ["ES256"]}, {"alg": None}, {"typ": "JWT"}, {"typ": None}, {"kid": ""}, {"kid": None}, {"kid": 1},
    {"crit": ["exp"]}, {"b64": False}, {"jwk": {"kty": "EC"}}, {"jku": "https://example.org"}, {"zip": "DEF"},
    {"cty": "JWT"}, {"x": "y" * 1024},
]  # fmt: skip


class Desk:
    """A signer and another one, and what was gathered of them."""

    def __init__(self) -> None:
        self.keys = {name: ec.generate_private_key(ec.SECP256R1()) for name in ("signer", "other")}
        self.cases: list[dict[str, Any]] = []

    def public(self, name: str) -> dict[str, Any]:
        key = self.keys[name].public_key()
        return {key_name(key): key}

    def pem(self, name: str) -> str:
        form = serialization.PublicFormat.SubjectPublicKeyInfo
        return self.keys[name].public_key().public_bytes(serialization.Encoding.PEM, form).decode()

    def raw(self, text: bytes, name: str = "signer") -> bytes:
        """Anything, signed well."""
        r, s = decode_dss_signature(self.keys[name].sign(text, ec.ECDSA(SHA256())))
        return text + b"." + numbers(r, min(s, ORDER - s))

    def add(self, name: str, data: bytes, *, at: datetime = LATER, revoked: tuple[str, ...] = ()) -> None:
        case = {"name": name, "data": data.decode("latin-1"), "at": int(at.timestamp()), "revoked": list(revoked)}
        self.cases.append(case | answer(data, self.public("signer"), at, revoked))


def answer(data: bytes, trusted: dict[str, Any], at: datetime, revoked: tuple[str, ...]) -> dict[str, Any]:
    """What `verify` and `read` say: the words of the refusal, or the claims but for the result."""
    told: dict[str, Any] = {}
    asks = {
        "verified": lambda: verify(data, trusted, now=at, revoked=revoked),
        "read": lambda: read(data)[0],
    }
    for call, ask in asks.items():
        try:
            claims = ask().claims()
            told[call] = {name: value for name, value in claims.items() if name != "result"}
        except PassportInvalid as error:
            told[call] = error.message
    return told


def numbers(r: int, s: int) -> bytes:
    return unpadded(r.to_bytes(32, "big") + s.to_bytes(32, "big")).encode()


def small() -> Passport:
    return Passport(
        id="0123456789abcdef" * 2, issued=NOW, begins=NOW, ends=NOW + timedelta(days=365),
        unit=Unit("Maker", "Model", focal_length=24.7), captured="", chart_serial="", lamp_serials=("",),
        software="0.1.0", result_sha256="0" * 64, result={"format": "camssf-result/1", "ssf": {}},
    )  # fmt: skip


def gather(result: bytes) -> Desk:
    """All cases."""
    desk = Desk()
    signer = desk.keys["signer"]
    good = sign(small(), signer)
    kid = next(iter(desk.public("signer")))
    header, payload, signature = good.split(b".")
    said = Said(Unit(serial='Ä "1" \\ 😀'), "2026-11-20T10:00:00+01:00", "chart\t7", ("lamp 3",), days=90)
    whole = draw_up(result, said, now=NOW)
    desk.add("small", good)
    desk.add("whole", sign(whole, signer))

    for at in (NOW - timedelta(seconds=1), NOW, small().ends - timedelta(seconds=1), small().ends):
        desk.add(f"at {at.isoformat()}", good, at=at)
    for name in (small().id, kid, "f" * 32):
        desk.add(f"revoked {name}", good, revoked=(name,))
    newer = replace(small(), result={"format": "camssf-result/2", "ssf": {}, "colour": {}})
    desk.add("a newer result", sign(newer, signer))

    form = json.loads(base64.urlsafe_b64decode(header + b"=" * (-len(header) % 4)))
    for change in HEADERS:
        head = {k: v for k, v in (form | change).items() if v is not None}
        desk.add(f"header {change}"[:60], desk.raw(b64(json.dumps(head).encode()) + b"." + payload))
    text = json.dumps(form)
    for head in (b"[]", b"null", text[:-1].encode(), f'{text[:-1]}, "alg": "ES256"}}'.encode(), b"\xff" * 20):
        desk.add(f"header {head!r}"[:60], desk.raw(b64(head) + b"." + payload))
    spelt = text.replace("alg", "\\u0061lg", 1).replace(", ", " ,\n ").encode()
    desk.add("a header in another spelling", desk.raw(b64(spelt) + b"." + payload))

    r, s = (int.from_bytes(unb64(signature)[at : at + 32], "big") for at in (0, 32))
    front = header + b"." + payload + b"."
    for pair in ((r, ORDER - s), (s, r), (0, 0), (0, 1), (1, 0), (ORDER, 1), (1, ORDER), (2**256 - 1, 2**256 - 1)):
        desk.add(f"signature {pair[0] % 97} {pair[1] % 97}", front + numbers(*pair))
    desk.add("DER", front + b64(encode_dss_signature(r, s)))
    desk.add("no signature", front)
    desk.add("two parts", front[:-1])
    for bits in (1, 2, 8, 15):
        last = LETTERS.index(signature[-1:])
        desk.add(f"unread bits {bits}", good[:-1] + LETTERS[last ^ bits : (last ^ bits) + 1])
    for more in (b"\n", b" ", b"\r\n", b"\0", b".", b".e30", b"=", b"==", b"\xef\xbb\xbf"):
        desk.add(f"behind {more!r}", good + more)
        desk.add(f"before {more!r}", more + good)
    for alphabet in (b"+/", b"!?"):
        desk.add(f"the letters {alphabet!r}", good.replace(b"A", alphabet[:1], 1))
    desk.add("another signer", sign(small(), desk.keys["other"]))
    desk.add("another signer in this one's name", desk.raw(front[:-1], "other"))
    desk.add(
        "another payload",
        b".".join((header, b64(json.dumps(replace(small(), id="f" * 32).claims()).encode()), signature)),
    )

    for name in small().claims():
        for value in ("absent", None, "", -1, 1.5, True, [], {}, "x" * 32, 10**12, float(2**60)):
            claims = copy.deepcopy(small().claims()) | {name: value}
            if value == "absent":
                del claims[name]
            desk.add(f"{name} is {value!r}", desk.raw(header + b"." + b64(json.dumps(claims).encode())))
    parts = {"unit": tuple(asdict(Unit())), "serials": ("chart", "lamps"), "software": ("version",)}
    for name, inside in parts.items():
        for member in inside:
            for value in ("absent", None, 7, -7, "", [], ["", 1]):
                claims = copy.deepcopy(small().claims())
                claims[name][member] = value
                if value == "absent":
                    del claims[name][member]
                desk.add(f"{name} {member} {value!r}", desk.raw(header + b"." + b64(json.dumps(claims).encode())))
    stamp = f'"iat": {int(NOW.timestamp())}'.encode()
    for word in (b"-0", b"0", b"1.0", b"1e3", b"253402300799", b"253402300800", b"9" * 30, b'"1"'):
        claims = json.dumps(small().claims()).encode().replace(stamp, b'"iat": ' + word, 1)
        desk.add(f"iat as {word!r}", desk.raw(header + b"." + b64(claims)))
    claims = json.dumps(small().claims()).encode()
    for name, content in PAYLOADS.items():
        desk.add(f"payload: {name}", desk.raw(header + b"." + b64(content)))
    for name, snippet in SNIPPETS.items():
        desk.add(f"JSON: {name}", desk.raw(header + b"." + b64(claims[:-1] + b"," + snippet + b"}")))
    desk.add("JSON: cut off", desk.raw(header + b"." + b64(claims[:-1])))
    return desk


LETTERS = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"


def b64(data: bytes) -> bytes:
    return unpadded(data).encode()


def unb64(text: bytes) -> bytes:
    return base64.urlsafe_b64decode(text + b"=" * (-len(text) % 4))


def rounded(value: Any) -> Any:
    """With numbers of four digits, which nobody reads here: a file of a third of the size."""
    if isinstance(value, dict):
        return {name: rounded(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(each) for each in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value


def main() -> None:
    result = report(rounded(document())).result_json
    desk = gather(result)
    keys = {name: {"pem": desk.pem(name), "name": next(iter(desk.public(name)))} for name in desk.keys}
    lines = ",\n".join(json.dumps(case) for case in desk.cases)
    head = json.dumps({"keys": keys, "result": result.decode()}, indent=1)
    write_file(FOLDER / "python.json", f'{head[:-2]},\n "cases": [\n{lines}\n]}}\n')
    valid = sum(isinstance(case["verified"], dict) for case in desk.cases)
    print(f"{len(desk.cases)} passports, {valid} of them valid")


if __name__ == "__main__":
    main()
