"""Issues passports for the units of a registry, and notes them there."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from camssf.errors import InvalidArgument
from camssf.files import write_file
from camssf.photo.read.unit import Unit
from camssf.places import join, place, reached
from camssf_fleet.passport.document import PassportRequest, create_passport, sign
from camssf_fleet.records import Row, columns
from camssf_fleet.registry import Registry

PER_UNIT = "PARTITION BY make, model, serial, camera_id, lens ORDER BY captured DESC NULLS LAST, added DESC, key"
NOTED = 100
"""Passports that are noted in one commit."""


@dataclass(frozen=True)
class Issued:
    """What `issue_passports` did.

    Attributes:
        issued: the files.
        valid: number of units whose passport was still valid.
        left_out: units without a new passport, and why.
    """

    issued: tuple[Path, ...]
    valid: int
    left_out: tuple[tuple[str, str], ...]


def issue_passports(
    registry: Registry,
    key: Any,
    out: Path,
    *,
    days: float = 365.0,
    renew: float = 30.0,
    tell: Callable[[str, float], None] = lambda *_: None,
) -> Issued:
    """Sign the newest accepted result of each unit with a serial number.

    Args:
        registry: the results; it notes each passport's id and end.
        key: from `keys.read_private`.
        out: folder of the passports.
        days: validity of each.
        renew: a passport that ends within so many days is renewed.
        tell: called with a message and a fraction.

    Raises:
        InvalidArgument: the folder or the registry cannot be written to.
    """
    now = datetime.now(UTC)
    rows = registry.query(
        f"SELECT {', '.join(columns(Row))} FROM rows WHERE status = 'accepted' AND serial <> '' "
        f"QUALIFY row_number() OVER ({PER_UNIT}) = 1 ORDER BY key"
    )
    due = [row for row in rows if (row["passport_ends"] or now) <= now + timedelta(days=renew)]
    issued, left_out, noted = [], [], list[Row]()
    for number, newest in enumerate(due):
        tell("signing", number / len(due))
        fields: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in newest.items()}
        row = Row(**fields)
        unit = Unit(
            camera_id=row.camera_id,
            serial=row.serial,
            lens=row.lens,
            focal_length=row.focal_length,
            aperture=row.aperture,
        )
        captured = "" if row.captured is None else row.captured.isoformat()
        try:
            passport = create_passport(_result(registry, row), PassportRequest(unit, captured, days=days))
        except InvalidArgument as error:
            left_out.append((f"{row.make} {row.model} {row.serial}", error.message))
            continue
        file = out / f"{re.sub(r'[^A-Za-z0-9]+', '_', row.serial)}-{passport.id}.jws"
        out.mkdir(parents=True, exist_ok=True)
        write_file(file, sign(passport, key))
        issued.append(file)
        noted.append(replace(row, passport=passport.id, passport_ends=passport.ends))
        if len(noted) == NOTED:
            registry.add(noted)
            noted = []
    registry.add(noted)
    return Issued(tuple(issued), len(rows) - len(due), tuple(left_out))


def _result(registry: Registry, row: Row) -> bytes:
    """The bytes of a row's document."""
    file = place(join(registry.folder, row.place)) if row.place else None
    if file is None:
        raise InvalidArgument("The registry does not know its result.json.", "Add it again as a file.")
    try:
        with reached(file, "read"):
            data = file.read_bytes()
    except OSError as error:
        raise InvalidArgument(f"{file} cannot be read ({error.strerror or error}).", "Restore it.") from error
    if hashlib.sha256(data).hexdigest() != row.key:
        raise InvalidArgument(f"{file} is not the result of its row.", "Restore it.")
    return data
