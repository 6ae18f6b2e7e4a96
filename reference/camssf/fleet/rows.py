"""What the registry keeps of a result: one row, and of every job what became of it: another."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeAlias

from camssf.curves.choice import CLEAR
from camssf.documents.choice import choice_of
from camssf.photo.unit import Unit

Json: TypeAlias = dict[str, Any]

CHANNELS = ("red", "green", "blue")
STRIDE = 10
"""Of the grid's half nanometres: the registry's curves stand every 5 nm, 380 to 720, as measured tables do."""

_TYPES = {
    "str": "VARCHAR",
    "datetime": "TIMESTAMP",
    "datetime | None": "TIMESTAMP",
    "float | None": "DOUBLE",
    "int": "INTEGER",
    "tuple[str, ...]": "VARCHAR[]",
    "tuple[float, ...]": "DOUBLE[]",
    "Curve": "FLOAT[]",
}
"""DuckDB's types of the fields below."""

Curve: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class Row:
    """One result. No photo, no place on earth, no file's name but the result's own.

    Attributes:
        key: SHA-256 of the result's file: a result that is added twice is there once.
        added: UTC.
        name: in the manifest.
        status, code, reason, reasons: of the verdict: its first reason in words, and the codes of all.
        make, model, camera_id, serial, lens, focal_length, aperture: the unit.
        captured: UTC; a time without an offset is taken as UTC.
        chart, chart_table, lamps, basis, engine, software: what it was made by.
        inputs: SHA-256 of every file; onnx: of the model.
        made_from: SHA-256 of files, options and version together, where a batch made it.
        passport: id of the passport that it came in.
        place: of the result, seen from the registry.
        delta_e00, rmsre, half_width, gap, evidence: scores; rmsre in %, gap the largest of all.
        channel_gain: red, green, blue.
        red, green, blue, red_std, green_std, blue_std: curves and bands, peak = 1; empty where there are none.
        extra: further columns of the manifest, as JSON.
        l2, gamma: the penalties that it was solved with.
        prior_scale, prior_share: where its basis answered alone, how wide its prior was taken, likeliest first, and
            the weight of each width in the answer; else empty.
        odds: of its basis against the others; infinite where nothing is left to them, None where a basis was told.
        code_covariance: of the code, as in the result: with the curves, all that the photo said.
    """

    key: str
    added: datetime
    name: str
    status: str
    code: str
    reason: str
    reasons: tuple[str, ...]
    make: str
    model: str
    camera_id: str
    serial: str
    lens: str
    focal_length: float | None
    aperture: float | None
    captured: datetime | None
    chart: str
    chart_table: str
    lamps: tuple[str, ...]
    basis: str
    engine: str
    software: str
    inputs: tuple[str, ...]
    onnx: str
    made_from: str
    passport: str
    place: str
    delta_e00: float | None
    rmsre: tuple[float, ...]
    half_width: float | None
    gap: float | None
    evidence: float | None
    channel_gain: tuple[float, ...]
    red: Curve
    green: Curve
    blue: Curve
    red_std: Curve
    green_std: Curve
    blue_std: Curve
    extra: str
    l2: float | None = None
    gamma: float | None = None
    prior_scale: tuple[float, ...] = ()
    prior_share: tuple[float, ...] = ()
    odds: float | None = None
    code_covariance: Curve = ()


@dataclass(frozen=True)
class Task:
    """What became of one job of a batch.

    Attributes:
        task: of the job's rows, options and version, its files' sizes and times: known without reading them.
        made_from: as in `Row`; "" where the files could not be read.
        ended: UTC.
        name: in the manifest.
        status: accepted, doubtful, refused, failed.
        code, reason: of the first reason.
        key: of its result; "" without one.
        deaths: of processes that worked on it.
    """

    task: str
    made_from: str
    ended: datetime
    name: str
    status: str
    code: str
    reason: str
    key: str
    deaths: int = 0


@dataclass(frozen=True)
class Origin:
    """What a row says that its result does not know.

    Attributes:
        unit: what is known of it beside make and model.
        captured: ISO 8601, "" where unknown.
        name, made_from, passport, place: as in `Row`.
        extra: further columns of the manifest.
    """

    unit: Unit = field(default_factory=Unit)
    captured: str = ""
    name: str = ""
    made_from: str = ""
    passport: str = ""
    place: str = ""
    extra: Mapping[str, str] = field(default_factory=dict)


def columns(kind: type) -> dict[str, str]:
    """Names and DuckDB's types of `Row` or `Task`."""
    return {each.name: _TYPES[str(each.type)] for each in fields(kind)}


def row(result: bytes | str, document: Json, origin: Origin, *, now: datetime | None = None) -> Row:
    """A result's row.

    Args:
        result: the bytes of result.json, or their SHA-256.
        document: what is in it, checked against its form.
        origin: what it does not know.
        now: when it is added; the clock's time unless given.
    """
    verdict, scores = document["verdict"], document.get("scores") or {}
    first = verdict["reasons"][0] if verdict["reasons"] else {"code": "", "message": ""}
    camera = document["camera"]
    unit = origin.unit.filled(Unit(make=camera["make"], model=camera["model"]))
    uncertainty = document.get("uncertainty") or {}
    known: dict[str, Any] = {each.name: getattr(unit, each.name) for each in fields(Unit)}
    for colour in CHANNELS:
        known[colour] = _curve(document.get("ssf"), colour)
        known[f"{colour}_std"] = _curve(document.get("ssf_std"), colour)
    widths, chosen = widths_of(document), choice_of(document)
    return Row(
        key=result if isinstance(result, str) else hashlib.sha256(result).hexdigest(),
        added=utc(now or datetime.now(UTC)),
        name=origin.name,
        status=verdict["status"],
        code=first["code"],
        reason=first["message"],
        reasons=tuple(reason["code"] for reason in verdict["reasons"]),
        captured=utc(datetime.fromisoformat(origin.captured)) if origin.captured else None,
        chart=document["chart"]["name"],
        chart_table=document["chart"]["table"],
        lamps=tuple(shot["lamp"]["name"] for shot in document["shots"]),
        basis=document["basis"],
        engine=document["engine"],
        software=document["generator"]["version"],
        inputs=tuple(document["hashes"]["inputs"].values()),
        onnx=document["hashes"]["model"] or "",
        made_from=origin.made_from,
        passport=origin.passport,
        place=origin.place,
        delta_e00=scores.get("delta_e00"),
        rmsre=tuple(scores.get("rmsre_percent") or ()),
        half_width=uncertainty.get("half_width"),
        gap=max(document["gap"]) if "gap" in document else None,
        evidence=document.get("evidence"),
        channel_gain=tuple(document.get("channel_gain") or ()),
        extra=json.dumps(dict(origin.extra), ensure_ascii=False, sort_keys=True) if origin.extra else "",
        l2=document.get("l2"),
        gamma=max(document["gamma"]) if document.get("gamma") else None,
        prior_scale=tuple(width for width, _ in widths),
        prior_share=tuple(share for _, share in widths),
        odds=None if chosen is None else chosen.odds,
        code_covariance=tuple(document.get("code_covariance") or ()),
        **known,
    )


def widths_of(document: Json) -> tuple[tuple[float, float], ...]:
    """How wide the basis that answered took its prior, likeliest first, and the weight of each width.

    None where two bases were mixed, or lights that nobody named: such curves are no one's alone.
    """
    if "prior_scale" not in document:
        return ()
    choice = document.get("choice") or []
    own = [each for each in choice if each["basis"] == document["basis"]]
    rest = sum(each["probability"] for each in choice) - sum(each["probability"] for each in own)
    if any(each.get("kinds") for each in choice) or sum(each["probability"] for each in own) < CLEAR * rest:
        return ()
    found = [(each["prior_scale"], each["probability"]) for each in own] or [(document["prior_scale"], 1.0)]
    return tuple(sorted(found, key=lambda width: -width[1]))


def place_of(file: Path | str, registry: Path | str) -> str:
    """Where a result lies, seen from the registry; links are followed on both sides."""
    file = os.path.realpath(file)
    try:
        return Path(os.path.relpath(file, os.path.realpath(registry))).as_posix()
    except ValueError:  # on another drive
        return Path(file).as_posix()


def utc(time: datetime) -> datetime:
    """Without an offset, in UTC, as the registry keeps times."""
    return time if time.tzinfo is None else time.astimezone(UTC).replace(tzinfo=None)


def _curve(curves: Json | None, colour: str) -> Curve:
    return tuple(curves[colour][::STRIDE]) if curves else ()
