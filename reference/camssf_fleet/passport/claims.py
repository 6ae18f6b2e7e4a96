"""The payload of a passport as JSON, and how it is read: claims that are not named here are left out."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields, is_dataclass
from typing import Annotated, Any, Literal, get_type_hints

from camssf.documents import forms
from camssf.documents.excerpt import LARGEST_PASSPORT, Excerpt
from camssf.documents.forms import BrokenError
from camssf.errors import PassportInvalid
from camssf.files import readable
from camssf.shapes import MOST_SHOTS, Bounds, Pattern, Positive, Text
from camssf_fleet.passport.jws import SignedKind

FORMAT: Literal["camssf-passport/1"] = "camssf-passport/1"
PASSPORT = SignedKind("camssf-passport+jwt", "passport", LARGEST_PASSPORT, 36500, "Sign a result of fewer shots.")
PASSPORT_ID = "[0-9a-f]{32}"
"""Regular expression of a passport's id."""
Second = Annotated[int, Bounds(0, 253402300799)]
"""Seconds since 1970, UTC, written without a fraction."""
BARRED = ("code_covariance", "truth")
"""Members of a result that its excerpt must not have."""


@dataclass(frozen=True)
class StatedUnit:
    """The physical camera; "" and null mean unknown.

    Attributes:
        make, model: as its files name it.
        camera_id: which camera of a phone.
        serial: of the body.
        lens: its model.
        focal_length: mm.
        aperture: the f-number.
    """

    make: Text
    model: Text
    camera_id: Text
    serial: Text
    lens: Text
    focal_length: Positive | None
    aperture: Positive | None


@dataclass(frozen=True)
class Serials:
    """Serial numbers; "" if unknown.

    Attributes:
        chart: of the chart.
        lamps: of each shot's lamp.
    """

    chart: Text
    lamps: Annotated[tuple[Text, ...], Bounds(0, MOST_SHOTS)]


@dataclass(frozen=True)
class Software:
    """What wrote the passport.

    Attributes:
        version: its version.
        name: its name.
    """

    version: Text
    name: Text = ""


@dataclass(frozen=True, eq=False)
class Claims:
    """The payload of a passport: an excerpt of one result, with the unit, the time and how long it is valid.

    Attributes:
        format: name and version of this form.
        jti: the passport's id, random.
        iat: issued at.
        nbf: valid from then on.
        exp: not valid from then on.
        unit: the physical camera.
        captured: when the photo was taken, ISO 8601; "" if unknown.
        serials: serial numbers.
        software: what wrote the passport.
        result_sha256: of the whole result.json, byte for byte.
        result: the excerpt.
    """

    format: Literal["camssf-passport/1"]
    jti: Annotated[str, Pattern(PASSPORT_ID, "must be 32 hex digits")]
    iat: Second
    nbf: Second
    exp: Second
    unit: StatedUnit
    captured: Text
    serials: Serials
    software: Software
    result_sha256: Annotated[str, Pattern("(?=.*[1-9a-f])[0-9a-f]{64}", "must be 64 hex digits, not all 0")]
    result: Excerpt

    def __post_init__(self) -> None:
        if self.result.excerpt is not None:
            raise BrokenError("result", 'has the unknown key "excerpt"')


def read_claims(payload: dict[str, Any]) -> Claims:
    """The payload, checked.

    Raises:
        PassportInvalid: a claim is missing or invalid, or the result was refused; unknown claims are left out.
    """
    match payload.get("result"):
        case {"verdict": {"status": "refused"}}:
            raise PassportInvalid("The passport's result was refused: it is no calibration.", "Calibrate again.")
    hints = get_type_hints(Claims)
    known = {name: known_members(claim, hints[name]) for name, claim in known_members(payload, Claims).items()}
    try:
        for name in hints:
            if name not in known:
                raise BrokenError(name, "is missing")
        return forms.part_of(Claims, known)
    except BrokenError as error:
        place, what = error.args
        place = place.lstrip(".") or "format"
        name = re.split(r"[.\[]", place)[0]
        where = f"{readable(place)} {readable(what)}. "
        raise PASSPORT.invalid(f"The passport's {name} is missing or invalid.", where) from None


def known_members(value: Any, kind: Any) -> Any:
    """An object without the members that a later release may have added; any other value as it is."""
    if not (isinstance(value, dict) and is_dataclass(kind)):
        return value
    names = {field.name for field in fields(kind)} | (set(BARRED) if kind is Excerpt else set())
    return {name: member for name, member in value.items() if name in names}
