"""Defines the registry's two kinds of row, one for each result, one for each job of a batch, and their checksum."""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from typing import Any, TypeAlias

from camssf.grid import CHANNELS
from camssf.photo.read.unit import Unit

Json: TypeAlias = dict[str, Any]

STRIDE = 10
"""Grid points between the registry's samples: its curves are sampled every 5 nm from 380 to 720 nm."""

_TYPES = {
    "str": "VARCHAR",
    "datetime": "TIMESTAMPTZ",
    "datetime | None": "TIMESTAMPTZ",
    "float | None": "DOUBLE",
    "int": "INTEGER",
    "tuple[str, ...]": "VARCHAR[]",
    "tuple[float, ...]": "DOUBLE[]",
    "Curve": "FLOAT[]",
}
"""DuckDB types of the fields below."""

Curve: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class Row:
    """One result, without photos, location or the names of input files.

    Attributes:
        key: SHA-256 of the result file, so that a result added twice counts once.
        added: UTC.
        name: in the manifest.
        status: of the verdict.
        code, reason: code and message of its first reason.
        reasons: codes of all its reasons.
        make, model, camera_id, serial, lens, focal_length, aperture: the unit.
        captured: UTC; a time without an offset is taken as UTC.
        chart, chart_table, lamps, basis, engine, software: what the result was made with.
        inputs: SHA-256 of every input file.
        onnx: SHA-256 of the model.
        made_from: SHA-256 of files, options and version together, if a batch made the result.
        passport, passport_ends: id and end of the result's passport.
        place: path of the result, relative to the registry.
        delta_e00, rmsre, half_width, gap, evidence: scores; rmsre in %, gap the largest of the three channels.
        channel_gain: red, green, blue.
        red, green, blue, red_std, green_std, blue_std: curves and bands, peak = 1; empty if there are none.
        extra: further columns of the manifest, as JSON.
        l2, gamma: penalties of the fit; gamma the largest of the three channels.
        prior_scale: width of the prior; None unless one basis was used alone, under named lights.
        odds: of the basis against the others; infinite if their probability is 0, None if the basis was given.
        code_covariance: posterior covariance of the code, as in the result.
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
    prior_scale: float | None = None
    odds: float | None = None
    code_covariance: Curve = ()
    passport_ends: datetime | None = None


@dataclass(frozen=True)
class Task:
    """The end of one job of a batch.

    Attributes:
        task: hash of the job's rows, options, version, and its files' sizes and times (`archive.task_of`).
        made_from: as in `Row`; "" if the files could not be read.
        ended: UTC.
        name: in the manifest.
        status: accepted, doubtful, refused, failed.
        code, reason: of the first reason.
        key: of its result; "" without one.
        camera: make and model of the result.
        deaths: number of processes that died during the job.
    """

    task: str
    made_from: str
    ended: datetime
    name: str
    status: str
    code: str
    reason: str
    key: str
    camera: str = ""
    deaths: int = 0


@dataclass(frozen=True)
class Origin:
    """The fields of a row that do not come from the result document.

    Attributes:
        unit: what is known about the unit besides make and model.
        captured: ISO 8601, "" if unknown.
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
    """Names and DuckDB types of the fields of `Row` or `Task`."""
    return {each.name: _TYPES[str(each.type)] for each in fields(kind)}


def row(result: bytes | str, document: Json, origin: Origin, *, now: datetime | None = None) -> Row:
    """The row of a result.

    Args:
        result: the bytes of result.json, or their SHA-256.
        document: its content, checked against the schema.
        origin: fields that the document does not have.
        now: time of adding; the current time unless given.
    """
    from camssf.documents.basis_choice import choice_of  # loads SciPy, which most questions do without

    verdict, scores = document["verdict"], document.get("scores") or {}
    first = verdict["reasons"][0] if verdict["reasons"] else {"code": "", "message": ""}
    camera = document["camera"]
    unit = origin.unit.filled(Unit(make=camera["make"], model=camera["model"]))
    uncertainty = document.get("uncertainty") or {}
    unit_and_curves: dict[str, Any] = {each.name: getattr(unit, each.name) for each in fields(Unit)}
    for colour in CHANNELS:
        unit_and_curves[colour] = _curve(document.get("ssf"), colour)
        unit_and_curves[f"{colour}_std"] = _curve(document.get("ssf_std"), colour)
    chosen = choice_of(document)
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
        prior_scale=prior_scale_of(document),
        odds=None if chosen is None else chosen.odds,
        code_covariance=tuple(document.get("code_covariance") or ()),
        **unit_and_curves,
    )


def prior_scale_of(document: Json) -> float | None:
    """Width of a result's prior; None if bases or kinds of light were mixed: it does not belong to one basis."""
    from camssf.recovery.hypotheses import CLEAR

    choice = document.get("choice") or []
    own = sum(each["probability"] for each in choice if each["basis"] == document["basis"])
    rest = sum(each["probability"] for each in choice) - own
    mixed = any(each.get("kinds") for each in choice) or own < CLEAR * rest
    return None if mixed else document.get("prior_scale")


def utc(time: datetime) -> datetime:
    """The time in UTC; one without an offset is taken as UTC."""
    return time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)


def checksum(row: Mapping[str, Any]) -> str:
    """SHA-256 of a row's values by column, without `checksum`, empty values and the name of its file.

    A column that a later release adds is empty in older rows, so it leaves their checksums as they are.

    Args:
        row: values as the registry returns them: times with a zone, lists of numbers or of texts.
    """
    found = hashlib.sha256()
    for name, value in sorted(row.items()):
        if name in ("checksum", "filename") or value is None or value in ("", []):
            continue
        numbers = value if isinstance(value, list) else [value]
        if isinstance(numbers[0], float):
            data = struct.pack(f"<{len(numbers)}d", *numbers)
        else:
            data = json.dumps([v.isoformat() if isinstance(v, datetime) else v for v in numbers]).encode()
        found.update(f"{name} {len(data)} ".encode() + data)
    return found.hexdigest()


def _curve(curves: Json | None, colour: str) -> Curve:
    return tuple(curves[colour][::STRIDE]) if curves else ()
