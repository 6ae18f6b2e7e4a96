"""Makes the excerpt of a result that a passport holds."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from camssf.documents.document import Curves, Document, answer_in
from camssf.documents.excerpt import (
    FORMAT,
    CameraName,
    ChartName,
    Excerpt,
    FrameFacts,
    Generator,
    GridCurves,
    Hashes,
    LampName,
    PassedVerdict,
    PhotoFacts,
    ShotFacts,
    SignedBy,
    StatedUncertainty,
    WrittenReason,
)
from camssf.files import readable
from camssf.grid import WAVELENGTHS
from camssf.photo.capture import MeasuredShot, Photo
from camssf.spectra import Lamp

DECIMALS = 5
"""Decimals of curves (peak 1) and bands: at most a fiftieth of the narrowest band."""


def excerpt_of(document: Document) -> Excerpt:
    """The excerpt of a result.

    Raises:
        InvalidArgument: the result was refused, or it is a capture that was not solved.
    """
    answer, capture, verdict = answer_in(document), document.capture, document.verdict
    assert capture is not None
    assert verdict is not None
    assert verdict.status != "refused"
    table, first = capture.chart, capture.photos[0]
    reasons = tuple(WrittenReason(**same_named(WrittenReason, reason)) for reason in verdict.reasons)
    return Excerpt(
        **same_named(Excerpt, answer, but=("uncertainty",)),
        **same_named(Excerpt, answer.proof),
        format=FORMAT,
        generator=Generator("camssf", document.version),
        camera=CameraName(first.make, first.model, first.unique_model or None),
        chart=ChartName(table.name, table.table, table.layout.name, table.source),
        ssf=_rounded(answer.curves),
        ssf_std=None if answer.std is None else _rounded(answer.std),
        shots=tuple(map(_shot_facts, capture.shots)),
        verdict=PassedVerdict(verdict.status, reasons, verdict.checks),
        uncertainty=None if answer.uncertainty is None else StatedUncertainty(**vars(answer.uncertainty)),
        assumptions=document.assumptions,
        hashes=Hashes({readable(name): sha256 for name, sha256 in capture.hashes.items()}, answer.model),
    )


def same_named(kind: Any, source: Any, *, but: tuple[str, ...] = ()) -> dict[str, Any]:
    """The attributes of `source` that have the names of a dataclass's fields, without those in `but`."""
    names = (field.name for field in fields(kind))
    return {name: getattr(source, name) for name in names if hasattr(source, name) and name not in but}


def printed(excerpt: Excerpt, sha256: str, token: bytes) -> Excerpt:
    """The excerpt with the passport that holds it, as `camssf passport verify` prints it."""
    return replace(excerpt, excerpt=SignedBy(sha256, token.decode()))


def _rounded(curves: Curves) -> GridCurves:
    red, green, blue = ([round(value, DECIMALS) for value in curve.tolist()] for curve in curves.values.T)
    return GridCurves(np.array(red), np.array(green), np.array(blue), WAVELENGTHS)


def _shot_facts(shot: MeasuredShot) -> ShotFacts:
    lamp, photo = shot.lamp, shot.photo
    percent, kelvin = (lamp.tolerance, lamp.tolerance_kelvin) if isinstance(lamp, Lamp) else (None, None)
    camera = " ".join(filter(None, (photo.make, photo.model)))
    return ShotFacts(
        lamp=LampName(lamp.name, percent, lamp.source, kelvin),
        white_reference="white frame" if shot.means.white else "white patch",
        dark_reference="dark frame" if shot.means.dark else "black level",
        photo=PhotoFacts(**same_named(PhotoFacts, photo), camera=camera),
        white=_frame_facts(shot.white),
        dark=_frame_facts(shot.dark),
        pose=None,
        saturation=shot.means.saturation,
        patches=(),
        lens_shading=shot.lens_shading,
    )


def _frame_facts(frame: Photo | None) -> FrameFacts | None:
    return None if frame is None else FrameFacts(frame.name, frame.sha256)
