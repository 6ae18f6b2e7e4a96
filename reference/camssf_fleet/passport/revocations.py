"""Signs and reads the list of revoked passports and keys, which is dated and expires.

The list is a compact JWS (`jws.py`), signed with a key like those of passports. It is renewed by signing its names
again. An expired list is rejected, because later revocations may be missing.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from camssf.errors import InvalidArgument, PassportInvalid
from camssf_fleet.passport.jws import advice, sign_jws, verify_jws
from camssf_fleet.passport.keys import KEY_ID

FORMAT, TYPE = "camssf-revocations/1", "camssf-revocations+jwt"
LARGEST_LIST = 16 * 2**20
LONGEST_DAYS = 366
PASSPORT_ID = re.compile(r"[0-9a-f]{32}")

_WHAT = "the revocation list"


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
        if not _is_name(name):
            raise InvalidArgument(
                f"{name!r} is neither a passport's id nor a key's name.",
                "Give what `camssf passport show` prints as id (32 hexadecimal digits) or key (43 characters).",
            )
    if not 0 < days <= LONGEST_DAYS:
        raise InvalidArgument(f"Good for {days:g} days.", f"Give more than 0 and at most {LONGEST_DAYS}.")
    issued = (now or datetime.now(UTC)).timestamp()
    payload = {
        "format": FORMAT,
        "iat": int(issued),
        "exp": int(issued + max(1.0, timedelta(days=days).total_seconds())),
        "revoked": sorted(set(names)),
    }
    signed = sign_jws(payload, TYPE, key)
    if len(signed) > LARGEST_LIST:
        raise InvalidArgument(f"The list would be larger than {LARGEST_LIST} bytes.", "Revoke a key instead.")
    return signed


def read_revoked(data: bytes, trusted: Mapping[str, Any], now: datetime | None = None) -> frozenset[str]:
    """Read the revoked names from a list that is signed by a trusted key and has not expired.

    Args:
        data: as received.
        trusted: from `keys.read_public`.
        now: time of the check; default: the system clock. A list issued later is accepted: it is more complete.

    Raises:
        PassportInvalid: the list is unsigned, signed by an untrusted key, changed, malformed or expired.
    """
    names, ends = _read(data, trusted)
    if (now or datetime.now(UTC)).timestamp() >= ends:
        when = datetime.fromtimestamp(ends, UTC).isoformat()
        raise PassportInvalid(
            f"The revocation list ended at {when}.",
            "Get the newest one from its signer, who renews it by `camssf passport revoke`.",
        )
    return names


def names_of(data: bytes, trusted: Mapping[str, Any]) -> frozenset[str]:
    """Read the revoked names from a list, expired or not, so that its signer can renew it.

    Raises:
        PassportInvalid: as for `read_revoked`, except that the list may have expired.
    """
    return _read(data, trusted)[0]


def _read(data: bytes, trusted: Mapping[str, Any]) -> tuple[frozenset[str], int]:
    if len(data) > LARGEST_LIST:
        raise PassportInvalid(f"The revocation list is larger than {LARGEST_LIST} bytes.", advice(_WHAT))
    if data.count(b".") != 2:
        raise PassportInvalid(
            "The revocation list is not signed.",
            "Get it from its signer; `camssf passport revoke` signs one.",
        )
    payload, _ = verify_jws(data, TYPE, trusted, _WHAT)
    names: Any = payload.get("revoked")
    issued, ends = (payload.get(name) for name in ("iat", "exp"))
    sound = (
        payload.get("format") == FORMAT
        and all(type(time) is int and 0 <= time < 253402300800 for time in (issued, ends))
        and isinstance(names, list)
        and all(isinstance(name, str) and _is_name(name) for name in names)
    )
    if not sound:  # reject the whole list: reading a part of it would miss revocations
        raise PassportInvalid(f"The revocation list is not in the form {FORMAT}.", advice(_WHAT))
    return frozenset(names), int(ends or 0)


def _is_name(name: str) -> bool:
    return bool(PASSPORT_ID.fullmatch(name) or KEY_ID.fullmatch(name))
