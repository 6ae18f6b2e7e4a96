"""Defines what a registry stores: records that never change, each known by the SHA-256 of what it says.

Kinds of record (`kind`): a result, or the excerpt of one in a passport; a fact that is said of a result later; the
end of a batch's job; the deletion of records; and a list of the records that were written.
"""

from __future__ import annotations

import hashlib
import json
import struct
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, TypeAlias

from camssf.grid import CHANNELS
from camssf.photo.read.unit import Unit

if TYPE_CHECKING:
    from camssf.documents.document import Answer, Curves, Document
    from camssf.documents.excerpt import Excerpt

STRIDE = 10
"""Grid points between the registry's samples: its curves are sampled every 5 nm from 380 to 720 nm."""

RESULT, EXCERPT, FACT, JOB, DELETION, LIST = "result", "excerpt", "fact", "job", "deletion", "list"
"""Kinds of record."""
OF_RESULTS = (RESULT, EXCERPT, FACT)
"""Kinds of record that say something of a result."""

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

_UNIT = ("make", "model", "camera_id", "serial", "lens", "focal_length", "aperture")
"""The columns of a unit."""
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
        prior_scale: width of the prior; None unless one basis and one lamp of each shot were used alone.
        odds: of the basis against the others; infinite if their probability is 0, None if the basis was given.
        code_covariance: posterior covariance of the code, as in the result.
        note: of the operator.
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
    note: str = ""


@dataclass(frozen=True)
class JobEnd:
    """How one job of a batch ended.

    Attributes:
        task: hash of the job's rows, options, version, and its files' sizes and times (`archive.task_of`).
        job: SHA-256 of the job's rows and options (`manifest.rows_hash`).
        made_from: as in `Row`; "" if the files could not be read.
        added: UTC.
        name: in the manifest.
        status: accepted, doubtful, refused, failed.
        code, reason: of the first reason.
        key: of its result; "" without one.
        make, model, serial: of the unit, as far as they are known.
        photos: of the job, as the manifest names them; empty if the result was accepted.
        deaths: number of processes that died during the job.
    """

    task: str
    job: str
    made_from: str
    added: datetime
    name: str
    status: str
    code: str
    reason: str
    key: str
    make: str = ""
    model: str = ""
    serial: str = ""
    photos: tuple[str, ...] = ()
    deaths: int = 0


@dataclass(frozen=True)
class Origin:
    """The fields of a row that do not come from the result document.

    Attributes:
        unit: what is known about the unit besides make and model.
        captured: ISO 8601, "" if unknown.
        name, made_from, passport, place, note: as in `Row`.
        extra: further columns of the manifest.
    """

    unit: Unit = field(default_factory=Unit)
    captured: str = ""
    name: str = ""
    made_from: str = ""
    passport: str = ""
    place: str = ""
    extra: Mapping[str, str] = field(default_factory=dict)
    note: str = ""


def columns(kind: type) -> dict[str, str]:
    """Names and DuckDB types of the fields of `Row` or `JobEnd`."""
    return {column.name: _TYPES[str(column.type)] for column in fields(kind)}


HEAD = {"record": "VARCHAR", "kind": "VARCHAR", "added": "TIMESTAMPTZ", "added_by": "VARCHAR", "revision": "INTEGER"}
"""Columns of every record: its hash, its kind, when and by whom it was added, and its revision: 0 if it changes
nothing that was said before, else one more than the largest revision of its result."""
LISTED = {"records": "VARCHAR[]", "keys": "VARCHAR[]", "previous": "VARCHAR[]"}
"""Columns of a list: the hashes of records, the keys of their results, and the hashes of the lists before it. A
deletion has `records`."""
COLUMNS = HEAD | columns(Row) | columns(JobEnd) | LISTED
"""Names and DuckDB types of the columns of every file; a record's are null where it says nothing."""
SAID_WHEN = ("record", "added", "added_by", "task", "filename")
"""Columns that a record's hash leaves out: who says the same again, at another time, adds no record."""


def row(result: bytes | str, document: Document | Excerpt, origin: Origin, *, now: datetime | None = None) -> Row:
    """The row of a result.

    Args:
        result: the bytes of result.json, or their SHA-256.
        document: its content, or the excerpt of it in a passport.
        origin: fields that the document does not have.
        now: time of adding; the current time unless given.
    """
    from camssf.documents.excerpt import Excerpt
    from camssf.verdict.reasons import Reason

    made_of = _sources_of_excerpt(document) if isinstance(document, Excerpt) else _sources(document)
    verdict = document.verdict
    assert verdict is not None
    first = verdict.reasons[0] if verdict.reasons else Reason("", "", "")
    return Row(
        key=result if isinstance(result, str) else hashlib.sha256(result).hexdigest(),
        added=utc(now or datetime.now(UTC)),
        name=origin.name,
        status=verdict.status,
        code=first.code,
        reason=first.message,
        reasons=tuple(reason.code for reason in verdict.reasons),
        captured=utc(datetime.fromisoformat(origin.captured)) if origin.captured else None,
        chart=made_of.chart,
        chart_table=made_of.chart_table,
        lamps=made_of.lamps,
        software=made_of.software,
        inputs=made_of.inputs,
        made_from=origin.made_from,
        passport=origin.passport,
        place=origin.place,
        extra=json.dumps(dict(origin.extra), ensure_ascii=False, sort_keys=True) if origin.extra else "",
        note=origin.note,
        **_stated(origin.unit.filled(made_of.unit)),
        **_solved(document.answer() if isinstance(document, Excerpt) else document.answer),
    )


@dataclass(frozen=True)
class _Sources:
    """What a result was made with."""

    unit: Unit
    chart: str
    chart_table: str
    lamps: tuple[str, ...]
    software: str
    inputs: tuple[str, ...]


def _sources(document: Document) -> _Sources:
    capture = document.capture
    if capture is None:
        return _Sources(Unit(), "", "", (), document.version, ())
    first = capture.photos[0] if capture.photos else None
    return _Sources(
        Unit() if first is None else Unit(first.make, first.model),
        capture.chart.name,
        capture.chart.table,
        tuple(light.name for light in capture.lights),
        document.version,
        tuple(capture.hashes.values()),
    )


def _sources_of_excerpt(excerpt: Excerpt) -> _Sources:
    return _Sources(
        Unit(excerpt.camera.make, excerpt.camera.model),
        excerpt.chart.name,
        excerpt.chart.table,
        tuple(shot.lamp.name for shot in excerpt.shots),
        excerpt.generator.version,
        tuple(excerpt.hashes.inputs.values()),
    )


def _stated(unit: Unit) -> dict[str, Any]:
    """The columns of the unit; one name has one spelling."""
    values = {name: getattr(unit, name) for name in _UNIT}
    return {name: one_spelling(value) if isinstance(value, str) else value for name, value in values.items()}


def one_spelling(name: str) -> str:
    """A name without blanks around it, in Unicode's composed form (NFC)."""
    return unicodedata.normalize("NFC", name).strip()


def _solved(answer: Answer | None) -> dict[str, Any]:
    """The columns of the answer."""
    from camssf.documents.basis_choice import choice_of  # loads SciPy, which most questions do without

    curves, std = (None, None) if answer is None else (answer.curves, answer.std)
    sampled = {colour: _sampled(curves, colour) for colour in CHANNELS}
    sampled |= {f"{colour}_std": _sampled(std, colour) for colour in CHANNELS}
    if answer is None:
        unsolved = {"basis": "none", "engine": "none", "onnx": "", "delta_e00": None, "rmsre": (), "half_width": None}
        return unsolved | {"gap": None, "evidence": None, "channel_gain": ()} | sampled
    chosen, covariance = choice_of(answer), answer.code_covariance
    return sampled | {
        "basis": answer.basis,
        "engine": answer.engine,
        "onnx": answer.model or "",
        "delta_e00": answer.scores.delta_e00,
        "rmsre": tuple(answer.scores.rmsre_percent.tolist()),
        "half_width": None if answer.uncertainty is None else answer.uncertainty.half_width,
        "gap": max(answer.proof.gap.tolist()),
        "evidence": answer.evidence,
        "channel_gain": tuple(answer.channel_gain.tolist()),
        "l2": answer.l2,
        "gamma": max(answer.gamma.tolist()),
        "prior_scale": prior_scale_of(answer),
        "odds": None if chosen is None else chosen.odds,
        "code_covariance": () if covariance is None else tuple(covariance.tolist()),
    }


def prior_scale_of(answer: Answer) -> float | None:
    """Width of a result's prior; None if bases or kinds of light were mixed: it does not belong to one basis."""
    from camssf.recovery.hypotheses import CLEAR

    shares = [hypothesis.probability for hypothesis in answer.choice] or [1.0]
    mixed = max(shares) < CLEAR * (sum(shares) - max(shares))
    return None if mixed else answer.prior_scale


def utc(time: datetime) -> datetime:
    """The time in UTC; one without an offset is taken as UTC."""
    return time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)


def record_hash(record: Mapping[str, Any]) -> str:
    """SHA-256 of what a record says: its values by column, without empty ones and SAID_WHEN.

    A column that a later release adds is empty in older records, so it leaves their hashes as they are.

    Args:
        record: values as DuckDB returns them: times with a zone, lists of numbers or of texts.
    """
    digest = hashlib.sha256()
    for name, value in sorted(record.items()):
        if name in SAID_WHEN or is_empty(value):
            continue
        values = value if isinstance(value, list) else [value]
        if isinstance(values[0], float):
            data = struct.pack(f"<{len(values)}d", *values)
        else:
            data = json.dumps([v.isoformat() if isinstance(v, datetime) else v for v in values]).encode()
        digest.update(f"{name} {len(data)} ".encode() + data)
    return digest.hexdigest()


def is_empty(value: Any) -> bool:
    """Whether a column says nothing: null, or a text or a list without content."""
    return value is None or value in ("", [])


def _sampled(curves: Curves | None, colour: str) -> Curve:
    return () if curves is None else tuple(getattr(curves, colour)[::STRIDE].tolist())
