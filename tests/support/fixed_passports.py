"""Passports signed by keys that are the same at every run, and what becomes of others."""

import hashlib
from functools import cache
from typing import Any

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from camssf.documents.document import document_bytes
from camssf.errors import PassportInvalid
from camssf_fleet.passport.document import Passport, PassportRequest, create_passport, sign, verify
from camssf_fleet.passport.keys import key_name
from tests.support.documents import document
from tests.support.signed_passports import LATER, NOW, claimed, small


@cache
def fixed_key(number: int = 0) -> ec.EllipticCurvePrivateKey:
    return ec.derive_private_key(int.from_bytes(hashlib.sha256(bytes([number])).digest(), "big"), ec.SECP256R1())


def trusted(number: int = 0) -> dict[str, Any]:
    public = fixed_key(number).public_key()
    return {key_name(public): public}


def pem(number: int = 0) -> bytes:
    form = serialization.PublicFormat.SubjectPublicKeyInfo
    return fixed_key(number).public_key().public_bytes(serialization.Encoding.PEM, form)


def same(one: Passport, other: Passport) -> bool:
    return claimed(one) == claimed(other)


@cache
def signed() -> bytes:
    return sign(small(), fixed_key())


@cache
def result_json() -> bytes:
    return document_bytes(document())


@cache
def whole_passport() -> Passport:
    """A passport of a whole result."""
    return create_passport(result_json(), PassportRequest(), now=NOW)


def accepts(data: bytes, passport: Passport | None = None, number: int = 0, **more: Any) -> None:
    assert same(verify(data, trusted(number), now=LATER, **more), passport or small())


def refuses(data: bytes, words: str = "", number: int = 0, **more: Any) -> None:
    with pytest.raises(PassportInvalid) as caught:
        verify(data, trusted(number), now=LATER, **more)
    assert words in caught.value.message
