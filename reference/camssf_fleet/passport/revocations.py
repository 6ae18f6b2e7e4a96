"""Signs and reads the list of revoked passports and keys, which is dated and expires.

The list is a compact JWS (`jws.py`), signed with a key like those of passports. It is renewed by signing its names
again. An expired list is rejected, because later revocations may be missing.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated, Any, Literal

from camssf.documents import forms
from camssf.documents.forms import BrokenError
from camssf.errors import InvalidArgument, PassportInvalid
from camssf.shapes import Pattern
from camssf_fleet.passport.claims import PASSPORT_ID, Second, known_members
from camssf_fleet.passport.jws import SignedKind, sign_jws, verify_jws
from camssf_fleet.passport.keys import KEY_ID

FORMAT: Literal["camssf-revocations/1"] = "camssf-revocations/1"
LIST = SignedKind("camssf-revocations+jwt", "revocation list", 16 * 2**20, 366, "Revoke a key instead.")
NAME = Pattern(f"{PASSPORT_ID}|{KEY_ID.pattern}", "is neither a passport's id nor a key's name")


@dataclass(frozen=True)
class Revocations:
    """The payload of a list.

    Attributes:
        format: name and version of this form.
        iat: issued at.
        exp: not valid from then on.
        revoked: ids of passports and names of keys.
    """

    format: Literal["camssf-revocations/1"]
    iat: Second
    exp: Second
    revoked: tuple[Annotated[str, NAME], ...]


def sign_revocations(names: Collection[str], key: Any, *, days: float = 30.0, now: datetime | None = None) -> bytes:
    """Sign a list of revoked names.

    Args:
        names: ids of passports and names of keys.
        key: from `keys.read_private`.
        days: validity period.
        now: time of issue; default: the system clock.

    Raises:
        InvalidArgument: a name is neither an id nor a key's name, or `days` or the list is too large.
    """
    for name in names:
        if not re.fullmatch(NAME.expression, name):
            raise InvalidArgument(
                f"{name!r} {NAME.words}.",
                "Give what `camssf passport show` prints as id (32 hexadecimal digits) or key (43 characters).",
            )
    issued = now or datetime.now(UTC)
    ends = issued + LIST.validity(days)
    revocations = Revocations(FORMAT, int(issued.timestamp()), int(ends.timestamp()), tuple(sorted(set(names))))
    return sign_jws(forms.to_plain(revocations), LIST, key)


def read_revoked(data: bytes, trusted: Mapping[str, Any], now: datetime | None = None) -> frozenset[str]:
    """Read the revoked names from a list that is signed by a trusted key and has not expired.

    Args:
        data: as received.
        trusted: from `keys.read_public`.
        now: time of the check; default: the system clock. A list issued later is accepted: it is more complete.

    Raises:
        PassportInvalid: the list is unsigned, signed by an untrusted key, changed, malformed or expired.
    """
    revocations = _read(data, trusted)
    ends = datetime.fromtimestamp(revocations.exp, UTC)
    if (now or datetime.now(UTC)) >= ends:
        raise PassportInvalid(
            f"The revocation list ended at {ends.isoformat()}.",
            "Get the newest one from its signer, who renews it by `camssf passport revoke`.",
        )
    return frozenset(revocations.revoked)


def names_of(data: bytes, trusted: Mapping[str, Any]) -> frozenset[str]:
    """Read the revoked names from a list, expired or not, so that its signer can renew it.

    Raises:
        PassportInvalid: as for `read_revoked`, except that the list may have expired.
    """
    return frozenset(_read(data, trusted).revoked)


def _read(data: bytes, trusted: Mapping[str, Any]) -> Revocations:
    if data.count(b".") != 2:
        raise PassportInvalid(
            "The revocation list is not signed.",
            "Get it from its signer; `camssf passport revoke` signs one.",
        )
    payload, _ = verify_jws(data, LIST, trusted)
    try:  # reject the whole list: reading a part of it would miss revocations
        return forms.part_of(Revocations, known_members(payload, Revocations))
    except BrokenError as error:
        raise LIST.invalid(f"The revocation list is not in the form {FORMAT}.") from error
