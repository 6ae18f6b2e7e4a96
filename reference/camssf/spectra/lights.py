"""The light of a photo: a lamp that is known, one that was called by a name, or one that nobody named."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, ClassVar, TypeAlias, cast

from camssf.errors import InvalidArgument
from camssf.rules import rules
from camssf.spectra.bundled import bundled
from camssf.spectra.families import FAMILIES
from camssf.spectra.lamps import (
    AUTO,
    BULB_NAME,
    DAYLIGHT_NAME,
    TORCH,
    UNNAMED,
    Lamp,
    LampLike,
    cie_name,
    drawn_lamp,
    is_lamp_name,
    read_lamp,
)
from camssf.spectra.sampled import text_of
from camssf.spectra.text import looks_like_file, plain


@dataclass(frozen=True)
class PossibleLamps:
    """A light that may be one of several lamps: it has no spectrum of its own.

    Attributes:
        name: as given.
        lamps: the possible lamps. One of a kind has the kind's name, or that of one of its shapes, "white-led/1".
        log_prior: ln of the prior probability of each.
        source: description for the report.
    """

    name: str
    lamps: tuple[Lamp, ...] = field(repr=False)
    log_prior: tuple[float, ...] = field(repr=False)
    source: str


@dataclass(frozen=True)
class Called(PossibleLamps):
    """A light that was called by a lamp's name, or by a kind of lamps.

    A lamp's name is one hypothesis beside its kind: lamps sold under one name differ, and people name them wrongly.

    Attributes:
        name: as given, in the spelling of `lamp_names`.
        lamps, log_prior: the possible lamps, and ln of the prior probability of each.
        source: description for the report.
    """

    KIND: ClassVar[str] = "called"
    PLAIN: ClassVar[dict[str, Any]] = {
        "description": "A light by the name of a lamp or of a kind of lamps.",
        "type": "object",
        "additionalProperties": False,
        "required": ["kind", "name"],
        "properties": {
            "kind": {"const": KIND},
            "name": {"type": "string", "description": "As it was given: D55, bulb, LED-B3."},
        },
    }

    def to_plain(self) -> dict[str, str]:
        """The light in a document: its name alone, because its lamps are the reader's."""
        return {"name": self.name}

    @staticmethod
    def from_plain(value: dict[str, Any], place: str) -> Called:
        """The light of a document.

        Raises:
            InvalidArgument: another form, or a name of no kind.
        """
        name = value.get("name") if value.keys() == {"name"} else None
        known = isinstance(name, str) and is_lamp_name(name) and plain_kind(name) is not None  # no file is read
        light = called(name) if isinstance(name, str) and known else None
        if light is None:
            raise InvalidArgument(f"{place} is no light by the name of a lamp or of a kind.", "Write its name: D55.")
        return light


@dataclass(frozen=True)
class Unnamed(PossibleLamps):
    """An unnamed light.

    Attributes:
        name: "auto", or "torch".
        lamps, log_prior: the possible lamps, and ln of the prior probability of each.
        source: description for the report.
    """

    KIND: ClassVar[str] = "unnamed"
    PLAIN: ClassVar[dict[str, Any]] = {
        "description": "A light that nobody named.",
        "type": "object",
        "additionalProperties": False,
        "required": ["kind", "name"],
        "properties": {
            "kind": {"const": KIND},
            "name": {"enum": list(UNNAMED), "description": "`torch` is the phone's own light."},
        },
    }

    def to_plain(self) -> dict[str, str]:
        """The light in a document: its name alone, because its kinds are the reader's."""
        return {"name": self.name}

    @staticmethod
    def from_plain(value: dict[str, Any], place: str) -> Unnamed:
        """The light of a document.

        Raises:
            InvalidArgument: another form.
        """
        if value.keys() != {"name"} or value["name"] not in UNNAMED:
            raise InvalidArgument(
                f"{place} is an unnamed light, which has only a name: {' or '.join(UNNAMED)}", "Give one of them."
            )
        return unnamed_light(value["name"])


def unnamed_light(name: str = AUTO) -> Unnamed:
    """The unnamed light "auto", or "torch", whose only kind is the white LED."""
    if name == TORCH:
        return Unnamed(TORCH, *_of_kind("white-led"), "the phone's torch, a white LED, as the signals say")
    of_kinds = [(*_of_kind(kind), math.log(rules().number(f"lamp.{kind}"))) for kind in FAMILIES]
    lamps = tuple(lamp for own, _, _ in of_kinds for lamp in own)
    log_prior = tuple(prior + share for _, shares, prior in of_kinds for share in shares)
    return Unnamed(AUTO, lamps, log_prior, "not named: daylight, bulb, white LED or fluorescent, as the signals say")


def called(name: str) -> Called | None:
    """The light of a lamp's or a kind's name; None if the lamp is of no kind, or if it is no name.

    Raises:
        InvalidArgument: as `read_lamp`.
    """
    lamp = read_lamp(name)
    kind = plain_kind(lamp.name)
    if kind is None:
        return None
    lamps, shares = _of_kind(kind)
    if lamp.name == kind:
        return Called(kind, lamps, shares, lamp.source)
    p = rules().number("lamp.named")
    log_prior = (math.log(p), *(math.log(1.0 - p) + share for share in shares))
    return Called(lamp.name, (lamp, *lamps), log_prior, f"{lamp.source}, or another {kind}")


@lru_cache(maxsize=8)
def _of_kind(kind: str) -> tuple[tuple[Lamp, ...], tuple[float, ...]]:
    """The lamps that a kind may be, and ln of their shares: one, or several shapes."""
    shapes = bundled()["families"][kind].get("shapes")
    if shapes is None:
        return (read_lamp(kind),), (0.0,)
    whole = bundled()["families"][kind]
    lamps = tuple(
        drawn_lamp(f"{kind}/{i}", whole | shape, f"white LEDs of shape {i}") for i, shape in enumerate(shapes, 1)
    )
    return lamps, tuple(math.log(shape["share"]) for shape in shapes)


def kind_of(name: str) -> str | None:
    """The kind of a lamp that is known by its kind alone, or by a shape of its kind; None for another lamp."""
    kind = name.partition("/")[0]
    return kind if kind in FAMILIES else None


_KINDS = (
    ("daylight", re.compile(r"d\d\d|b|c|id50|id65")),
    ("bulb", re.compile(r"a")),
    ("white-led", re.compile(r"led-(b\d|bh1|v1|v2)")),
    ("fluorescent", re.compile(r"fl.*")),
)
"""Names of tables and formulas by their kind."""
HOTTEST_BULB = rules().number("lamp.hottest_bulb")


def plain_kind(name: str) -> str | None:
    """The kind of the lamp that a name means: of a kind itself, or of a table or formula; None if it is of none."""
    kind = kind_of({plain(family): family for family in FAMILIES}.get(plain(name), name))
    if kind is not None:
        return kind
    key = name.strip().casefold()
    if match := BULB_NAME.fullmatch(key):
        return "bulb" if float(match[1]) <= HOTTEST_BULB else None
    if DAYLIGHT_NAME.fullmatch(key):
        return "daylight"
    cie = (cie_name(name) or "").casefold()
    return next((kind for kind, names in _KINDS if names.fullmatch(cie)), None)


Light: TypeAlias = Lamp | Called | Unnamed
"""The light of a shot, as given."""
LightLike: TypeAlias = LampLike | Called | Unnamed
"""What `read_light` accepts: a LampLike, or a light that was read already."""


def read_light(spec: LightLike) -> Light:
    """Read the light of a photo: `auto` and `torch` are unnamed; a lamp's name is one hypothesis beside its kind.

    Files, objects, lamps and names of no kind are taken as said, by `read_lamp`.

    Raises:
        InvalidArgument, LampUnfit: as `read_lamp`.
    """
    if isinstance(spec, Called | Unnamed):
        return spec
    if not isinstance(spec, str):
        return read_lamp(cast(LampLike, spec))
    text = text_of(spec)
    if text.casefold() in UNNAMED:
        return unnamed_light(text.casefold())
    return read_lamp(spec) if looks_like_file(text) and not is_lamp_name(text) else called(text) or read_lamp(spec)
