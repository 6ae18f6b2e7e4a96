"""Passports signed by keys that are the same at every run, and what Python says of them and of others, for Kotlin.

`python -m tests.support.signed_passports` writes sound ones and broken ones, most of them signed well, with what
`verify` and `read` answer. A signature has other bytes each time, and so has a new file.
"""

import base64
import gzip
import hashlib
import json
from collections.abc import Callable, Iterator
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature, encode_dss_signature
from cryptography.hazmat.primitives.hashes import SHA256

from camssf.documents import forms
from camssf.documents.document import Curves, document_bytes
from camssf.documents.excerpt import Excerpt
from camssf.errors import PassportInvalid
from camssf.files import write_file
from camssf.photo.read.unit import Unit
from camssf.verdict.reasons import Reason, Verdict
from camssf_fleet.passport import revocations
from camssf_fleet.passport.document import Passport, PassportRequest, create_passport, read, sign, verify
from camssf_fleet.passport.excerpt import excerpt_of
from camssf_fleet.passport.jws import ORDER
from camssf_fleet.passport.keys import key_name
from tests.support.documents import changed, document

NOW = datetime(2026, 11, 22, 3, 0, tzinfo=UTC)
LATER = NOW + timedelta(days=30)


@cache
def fixed_key(number: int = 0) -> ec.EllipticCurvePrivateKey:
    return ec.derive_private_key(int.from_bytes(hashlib.sha256(bytes([number])).digest(), "big"), ec.SECP256R1())


def trusted(number: int = 0) -> dict[str, Any]:
    public = fixed_key(number).public_key()
    return {key_name(public): public}


def pem(number: int = 0) -> bytes:
    form = serialization.PublicFormat.SubjectPublicKeyInfo
    return fixed_key(number).public_key().public_bytes(serialization.Encoding.PEM, form)


def b64(data: bytes) -> bytes:
    return base64.urlsafe_b64encode(data).rstrip(b"=")


def unb64(text: bytes) -> bytes:
    return base64.urlsafe_b64decode(text + b"=" * (-len(text) % 4))


def claimed(passport: Passport) -> dict[str, Any]:
    """The payload as plain data; the result first, so that its letters repeat from one case to the next."""
    claims = dict(forms.to_plain(passport.claims()))
    return {"result": claims.pop("result")} | claims


@cache
def small_result() -> dict[str, Any]:
    """The excerpt of a result, as short as its form allows, as plain data that nobody changes."""
    names = ("format", "generator", "camera", "chart", "basis", "engine", "ssf", "channel_gain", "gap", "gamma", "l2",
             "shots", "scores", "verdict", "assumptions", "hashes")  # fmt: skip
    short = {name: value for name, value in forms.to_plain(excerpt_of(document())).items() if name in names}
    grid = short["ssf"]["wavelength_nm"]
    short["ssf"] = {"wavelength_nm": grid} | {colour: [1] + [0] * 680 for colour in ("red", "green", "blue")}
    short["verdict"] = {"status": "accepted", "reasons": []}
    short["assumptions"] = []
    return short


@cache
def small() -> Passport:
    """A passport whose result is as short as it can be."""
    return Passport(
        id="0123456789abcdef" * 2, issued=NOW, begins=NOW, ends=NOW + timedelta(days=365),
        unit=Unit("Maker", "Model", focal_length=24.7), captured="", chart_serial="", lamp_serials=("",),
        software="0.1.0", result_sha256="5e" * 32, result=forms.from_plain(small_result(), Excerpt, "it", ""),
    )  # fmt: skip


@cache
def signed() -> bytes:
    return sign(small(), fixed_key())


@cache
def result_json() -> bytes:
    return document_bytes(document())


@cache
def complete() -> Passport:
    return create_passport(result_json(), PassportRequest(), now=NOW)


def accepts(data: bytes, passport: Passport | None = None, **more: Any) -> Passport:
    verified = verify(data, trusted(), now=LATER, **more)
    assert claimed(verified) == claimed(passport or small())
    return verified


def refuses(data: bytes, words: str = "", number: int = 0, **more: Any) -> None:
    with pytest.raises(PassportInvalid) as caught:
        verify(data, trusted(number), now=LATER, **more)
    assert words in caught.value.message


FOLDER = Path(__file__).with_name("passports")
"""What Kotlin is held to."""
LETTERS = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
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
    "an end of line": b'"x":"\n"', "DEL": b'"x":"\x7f"', "an unknown escape": b'"x":"\\x41"',
    "a short escape": b'"x":"\\u12"', "a wrong escape": b'"x":"\\u00g0"',
    "escapes": b'"x":"\\"\\\\\\/\\b\\f\\n\\r\\t\\u00e9\\uD83D\\uDE00"', "half a letter": b'"x":"\\ud800"',
    "single quotes": b"'x':1", "no quotes": b'x:1', "a comma behind": b'"x":[1,]', "two commas": b'"x":[1,,2]',
    "a comment": b'/* */"x":1', "no colon": b'"x" 1', "blanks": b' \t\r\n"x" \n: [ 1 , {} , [ ] ] ',
    "a hard blank": b'\xc2\xa0"x":1', "a form feed": b'\x0c"x":1',
    "deep but not too deep": b'"x":' + b"[" * 150 + b"]" * 150, "twice": b'"x":1,"x":2',
    "twice by an escape": b'"x":1,"\\u0078":2', "twice inside": b'"x":{"y":[{"z":1,"z":1}]}',
    "exp twice": b'"exp":9999999999', "literals": b'"x":[true,false,null]', "a surrogate pair": '"x":"😀"'.encode(),
}  # fmt: skip
HEADERS: list[dict[str, Any]] = [
    {"alg": "none"}, {"alg": "None"}, {"alg": "HS256"}, {"alg": "ES384"}, {"alg": "RS256"}, {"alg": "es256"},
    {"alg": ["ES256"]}, {"alg": None}, {"typ": "JWT"}, {"typ": None}, {"kid": ""}, {"kid": None}, {"kid": 1},
    {"crit": ["exp"]}, {"b64": False}, {"jwk": {"kty": "EC"}}, {"jku": "https://example.org"}, {"zip": "DEF"},
    {"cty": "JWT"}, {"x": "y" * 1024},
]  # fmt: skip


def numbers(r: int, s: int) -> bytes:
    return b64(r.to_bytes(32, "big") + s.to_bytes(32, "big"))


def raw(text: bytes, number: int = 0) -> bytes:
    """Anything, signed well."""
    return text + b"." + numbers(*decode_dss_signature(fixed_key(number).sign(text, ec.ECDSA(SHA256()))))


def read_or_refused(read: Callable[[], Any]) -> Any:
    """What it gives, of a passport the claims but for the result; or the words of its refusal."""
    try:
        product = read()
    except PassportInvalid as error:
        return error.message
    if isinstance(product, Passport):
        return {name: value for name, value in claimed(product).items() if name != "result"}
    return product


def answer(data: bytes, trusted: dict[str, Any], at: datetime, revoked: tuple[str, ...]) -> dict[str, Any]:
    """What `verify` and `read` say."""
    verified = read_or_refused(lambda: verify(data, trusted, now=at, revoked=revoked))
    return {"verified": verified, "read": read_or_refused(lambda: read(data)[0])}


def small_document() -> Any:
    """A whole result with letters and numbers that are easily written wrong."""
    red = np.array([1.0, 0.123455, 0.123445, 0.015625, -1e-7, 12e-6] + [0] * 675)
    flat = np.array([1.0] + [0.0] * 680)
    return changed(
        document(), capture__shots__0__photo__make="Maker", capture__shots__0__photo__model="Model A",
        capture__chart__source='"a  b" \\ {\ud800} \u00e9 \u2028', answer__curves=Curves(red, flat, flat),
        answer__std=Curves(np.abs(red), flat, flat),
        verdict=Verdict("doubtful", (Reason("glare", "m", "a", None, 1e-300),)),
    )  # fmt: skip


RESULTS: dict[str, Any] = {
    "ssf 5": {"ssf": 5}, "no ssf": {"ssf": "absent"}, "no format": {"format": "absent"},
    "another format": {"format": "camssf-result/2"}, "no camera": {"camera": "absent"},
    "a camera's name": {"camera": "x"},
    "make 1": {"camera": {"make": 1, "model": "x"}}, "no verdict": {"verdict": "absent"},
    "refused": {"verdict": {"status": "refused", "reasons": []}}, "a refusal in one word": {"verdict": "refused"},
    "refused, in words": {"verdict": {"status": "refused", "reasons": [{"code": "glare"}]}, "ssf": "absent"},
    "another verdict": {"verdict": {"status": "good", "reasons": []}}, "no shots": {"shots": []},
    "shots as text": {"shots": "x"}, "a shot as text": {"shots": ["x"]}, "no gains": {"channel_gain": "absent"},
    "two gains": {"channel_gain": [1, 1]}, "a gain as text": {"channel_gain": ["1", 1, 1]},
    "a covariance": {"code_covariance": [1.0] * 6}, "a truth": {"truth": None},
    "an excerpt of its own": {"excerpt": {}},
    "bands": {"ssf_std": "ssf"}, "no bands": {"ssf_std": None}, "bands 5": {"ssf_std": 5},
    "a member of a later release": {"further": {"x": 1}},
}  # fmt: skip
CURVES: dict[str, Any] = {
    "no red": {"red": "absent"}, "red as text": {"red": "x"}, "680 numbers": {"red": [1] + [0] * 679},
    "682 numbers": {"red": [1] + [0] * 681}, "no peak": {"red": [0] * 681}, "peak 2": {"red": [2] + [0] * 680},
    "a word": {"red": [1, "0"] + [0] * 679}, "true": {"red": [1, True] + [0] * 679},
    "null": {"red": [1, None] + [0] * 679},
    "huge": {"red": [1, -1e13] + [0] * 679}, "peak 1.0": {"red": [0, 1.0] + [0] * 679},
    "negative": {"red": [1, -0.25] + [0] * 679}, "another grid": {"wavelength_nm": [380 + i / 4 for i in range(681)]},
    "a further colour": {"clear": [1] + [0] * 680},
}  # fmt: skip


def altered(whole: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """With other members: none where the change says "absent", the curves where it says "ssf"."""
    return {
        name: whole["ssf"] if value == "ssf" else value
        for name, value in (whole | change).items()
        if name not in change or value != "absent"
    }


def spoilt(whole: dict[str, Any], values: tuple[Any, ...], *names: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each member, or those named, with each of the values in its place."""
    for name in names or whole:
        for value in values:
            yield f"{name} {value!r}", altered(whole, {name: value})


def other_results() -> Iterator[tuple[str, dict[str, Any]]]:
    """Results of which most are none."""
    small, shot = small_result(), small_result()["shots"][0]
    yield from ((f"result: {name}", altered(small, change)) for name, change in RESULTS.items())
    yield from ((f"curve: {name}", small | {"ssf": altered(small["ssf"], change)}) for name, change in CURVES.items())
    yield "bands without a peak", small | {"ssf_std": small["ssf"] | {"red": [0.01] * 681}}
    for name, change in {
        "a pose": {"pose": {}}, "a patch": {"patches": [{}]}, "a light": {"light": {}}, "no lamp": {"lamp": "absent"},
        "lamp's power": {"lamp": shot["lamp"] | {"power": [1] * 681}},
    }.items():  # fmt: skip
        yield f"shot: {name}", small | {"shots": [altered(shot, change)]}


def gather(result: bytes) -> list[dict[str, Any]]:
    """All cases."""
    cases: list[dict[str, Any]] = []

    def add(name: str, data: bytes, *, at: datetime = LATER, revoked: tuple[str, ...] = ()) -> None:
        case = {"name": name, "data": data.decode("latin-1"), "at": int(at.timestamp()), "revoked": list(revoked)}
        cases.append(case | answer(data, trusted(), at, revoked))

    def claim(name: str, payload: Any) -> None:
        """A payload, as bytes or plain data, signed well."""
        add(name, raw(header + b"." + b64(payload if isinstance(payload, bytes) else compact(payload))))

    good, kid = signed(), next(iter(trusted()))
    header, payload, signature = good.split(b".")
    said = PassportRequest(Unit(serial='Ä "1" \\ 😀'), "2026-11-20T10:00:00+01:00", "chart\t7", ("lamp 3",), days=90)
    whole = create_passport(result, said, now=NOW)
    add("small", good)
    add("whole", sign(whole, fixed_key()))

    for at in (NOW - timedelta(seconds=1), NOW, small().ends - timedelta(seconds=1), small().ends):
        add(f"at {at.isoformat()}", good, at=at)
    for name in (small().id, kid, "f" * 32):
        add(f"revoked {name}", good, revoked=(name,))
    plain = claimed(small())
    for name, other in other_results():
        claim(name, plain | {"result": other})
    claim("a hash of zeros", plain | {"result_sha256": "0" * 64})

    form = json.loads(unb64(header))
    for change in HEADERS:
        head = {k: v for k, v in (form | change).items() if v is not None}
        add(f"header {change}"[:60], raw(b64(json.dumps(head).encode()) + b"." + payload))
    text = json.dumps(form)
    for head in (b"[]", b"null", text[:-1].encode(), f'{text[:-1]}, "alg": "ES256"}}'.encode(), b"\xff" * 20):
        add(f"header {head!r}"[:60], raw(b64(head) + b"." + payload))
    spelt = text.replace("alg", "\\u0061lg", 1).replace(", ", " ,\n ").encode()
    add("a header in another spelling", raw(b64(spelt) + b"." + payload))

    r, s = (int.from_bytes(unb64(signature)[at : at + 32], "big") for at in (0, 32))
    front = header + b"." + payload + b"."
    for pair in ((r, ORDER - s), (s, r), (0, 0), (0, 1), (1, 0), (ORDER, 1), (1, ORDER), (2**256 - 1, 2**256 - 1)):
        add(f"signature {pair[0] % 97} {pair[1] % 97}", front + numbers(*pair))
    add("DER", front + b64(encode_dss_signature(r, s)))
    add("no signature", front)
    add("two parts", front[:-1])
    for bits in (1, 2, 8, 15):
        last = LETTERS.index(signature[-1:])
        add(f"unread bits {bits}", good[:-1] + LETTERS[last ^ bits : (last ^ bits) + 1])
    for more in (b"\n", b" ", b"\r\n", b"\0", b".", b".e30", b"=", b"==", b"\xef\xbb\xbf"):
        add(f"behind {more!r}", good + more)
        add(f"before {more!r}", more + good)
    for alphabet in (b"+/", b"!?"):
        add(f"the letters {alphabet!r}", good.replace(b"A", alphabet[:1], 1))
    add("another signer", sign(small(), fixed_key(1)))
    add("another signer in this one's name", raw(front[:-1], 1))
    add("another payload", b".".join((header, b64(compact(plain | {"jti": "f" * 32})), signature)))

    values = ("absent", None, "", -1, 1.5, True, [], {}, "x" * 32, 10**12, float(2**60))
    for name, claims in spoilt(plain, values):
        claim(name.replace(" ", " is ", 1), claims)
    for name, members in {"unit": asdict(Unit()), "serials": ("chart", "lamps"), "software": ("version",)}.items():
        for inside, part in spoilt(plain[name], ("absent", None, 7, -7, "", [], ["", 1]), *members):
            claim(f"{name} {inside}", plain | {name: part})
    claims = compact(plain)
    stamp = f'"iat":{int(NOW.timestamp())}'.encode()
    for word in (b"-0", b"0", b"1.0", b"1e3", b"253402300799", b"253402300800", b"9" * 30, b'"1"'):
        claim(f"iat as {word!r}", claims.replace(stamp, b'"iat":' + word, 1))
    for name, content in PAYLOADS.items():
        claim(f"payload: {name}", content)
    for name, snippet in SNIPPETS.items():
        claim(f"JSON: {name}", claims[:-1] + b"," + snippet + b"}")
    claim("JSON: cut off", claims[:-1])
    return cases


def compact(value: Any) -> bytes:
    """As JSON without blanks, so that hundreds of payloads stay a small file."""
    return json.dumps(value, separators=(",", ":")).encode()


def lists() -> list[dict[str, Any]]:
    """Signed lists of what was called back, most of them spoilt, and what `read_revoked` says of them."""
    names = [small().id, next(iter(trusted(1)))]

    def listed(names: list[str], number: int = 0, now: datetime = NOW, days: int = 60) -> bytes:
        return revocations.sign_revocations(names, fixed_key(number), now=now, days=days)

    good = listed(names)
    header, payload, signature = good.split(b".")
    form = json.loads(unb64(payload))
    made = {
        "good": good, "empty": listed([]), "a stranger's": listed(names, 1),
        "not signed": f"# a list\n{small().id}\n".encode(), "nothing": b"", "a passport": signed(),
        "changed": b".".join((header, b64(compact(form | {"revoked": []})), signature)),
        "no object": raw(header + b"." + b64(b"[]")), "no base64": good + b"=", "ended": listed(names, days=29),
        "issued later": listed(names, now=LATER + timedelta(days=1)),
    }  # fmt: skip
    for name, other in spoilt(form, ("absent", None, "x", -1, 1.5, 10**12, [], ["x"], [1], {})):
        made[name] = raw(header + b"." + b64(compact(other)))
    return [
        {"name": name, "data": data.decode("latin-1"), "told": read_list(data, trusted())}
        for name, data in made.items()
    ]


def read_list(data: bytes, trusted: dict[str, Any]) -> Any:
    """The names in a signed list, or the words of the refusal."""
    return read_or_refused(lambda: sorted(revocations.read_revoked(data, trusted, LATER)))


def stored() -> dict[str, Any]:
    """What Kotlin is held to."""
    return dict(json.loads(gzip.decompress((FOLDER / "python.json.gz").read_bytes())))


def main() -> None:
    # numbers of four digits, which nobody reads here: a file of a third of the size
    text = json.dumps(forms.to_plain(document()))
    result = forms.pretty(json.loads(text, parse_float=lambda number: float(f"{float(number):.4g}"))).encode()
    cases = gather(result)
    keys = {
        who: {"pem": pem(i).decode(), "name": next(iter(trusted(i)))} for i, who in enumerate(("signer", "other"))
    }
    both = {"result": result.decode(), "small": document_bytes(small_document()).decode()}
    whole = {"keys": keys, **both, "lists": lists(), "cases": cases}
    write_file(FOLDER / "python.json.gz", gzip.compress(json.dumps(whole).encode(), mtime=0))
    valid = sum(isinstance(case["verified"], dict) for case in cases)
    print(f"{len(cases)} passports, {valid} of them valid; {len(whole['lists'])} lists")


if __name__ == "__main__":
    main()
