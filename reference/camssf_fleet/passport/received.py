"""Reads passports as the command line receives them: verified with trusted keys, or only read if there are none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from camssf.cli.reading import read_bytes
from camssf.documents.excerpt import Excerpt
from camssf.documents.forms import from_plain
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.photo.read.unit import Unit
from camssf.report.provenance import Signature
from camssf_fleet.passport.document import LARGEST_PRINTED, Passport, check_belongs, passport_in, read, verify
from camssf_fleet.passport.keys import read_public
from camssf_fleet.passport.revocations import LIST, read_revoked

__all__ = ["check_photo_of", "read_excerpt", "read_list", "read_received", "read_signature"]


def read_signature(source: str, result: bytes, keys: Sequence[Path], revoked: Path | None) -> Signature:
    """The passport of the result: verified with the keys, or only read if there are none."""
    data = read_received(source)
    passport, key = read(data)
    if not keys and revoked is not None:
        raise InvalidArgument(
            "--revoked needs --key: only a verified passport can be checked for revocation.", "Add --key PEM."
        )
    if not keys:
        check_belongs(passport, result)
        return Signature(passport, key, False)
    trusted = read_public(keys)
    verify(data, trusted, revoked=read_list(revoked, trusted), result=result)
    return Signature(passport, key, True)


def read_excerpt(plain: Any, name: str) -> Excerpt:
    """A printed excerpt of parsed JSON, which matches the passport that it holds; the signature is not verified.

    Raises:
        InvalidArgument: no such excerpt.
        PassportInvalid: it differs from its passport.
    """
    excerpt = from_plain(plain, Excerpt, name, "Give what `camssf passport verify` printed, or a result.json.")
    passport_in(excerpt)
    return excerpt


def check_photo_of(excerpt: Excerpt, unit: Unit, name: str) -> Passport:
    """The passport that a printed excerpt holds, after its unit was compared with that of a photo.

    Args:
        excerpt: printed.
        unit: the unit that the photo's file states.
        name: of the photo, for the message.

    Raises:
        UnitDiffers: the photo is of another unit.
    """
    passport = passport_in(excerpt)
    passport.check_photo(unit, name)
    return passport


def read_received(source: str) -> bytes:
    """The bytes of a passport, or of a document that contains one; raises PassportInvalid if too large or empty."""
    return read_bytes(source, LARGEST_PRINTED, PassportInvalid)


def read_list(source: Path | None, trusted: Mapping[str, Any]) -> frozenset[str]:
    """The names that a signed list revokes; empty without a list."""
    if source is None:
        return frozenset()
    return read_revoked(read_bytes(str(source), LIST.largest, PassportInvalid), trusted)
