"""Makes the excerpt of a result that a passport holds."""

from __future__ import annotations

from dataclasses import replace

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
    return Excerpt(
        format=FORMAT,
        generator=Generator("camssf", document.version),
        camera=CameraName(first.make, first.model, first.unique_model or None),
        chart=ChartName(table.name, table.table, table.layout.name, table.source),
        basis=answer.basis,
        engine=answer.engine,
        ssf=_rounded(answer.curves),
        ssf_std=None if answer.std is None else _rounded(answer.std),
        channel_gain=answer.channel_gain,
        gap=answer.proof.gap,
        layers_gap=answer.proof.layers_gap,
        finish_steps=answer.proof.finish_steps,
        evidence=answer.evidence,
        prior_scale=answer.prior_scale,
        chart_fading=answer.chart_fading,
        choice=answer.choice,
        gamma=answer.gamma,
        l2=answer.l2,
        shots=tuple(map(_shot_facts, capture.shots)),
        scores=answer.scores,
        verdict=PassedVerdict(
            verdict.status, tuple(WrittenReason(**vars(reason)) for reason in verdict.reasons), verdict.checks
        ),
        uncertainty=None if answer.uncertainty is None else StatedUncertainty(**vars(answer.uncertainty)),
        assumptions=document.assumptions,
        hashes=Hashes({readable(name): sha256 for name, sha256 in capture.hashes.items()}, answer.model),
    )


def printed(excerpt: Excerpt, sha256: str, token: bytes) -> Excerpt:
    """The excerpt with the passport that holds it, as `camssf passport verify` prints it."""
    return replace(excerpt, excerpt=SignedBy(sha256, token.decode()))


def _rounded(curves: Curves) -> GridCurves:
    red, green, blue = ([round(value, DECIMALS) for value in curve.tolist()] for curve in curves.values.T)
    return GridCurves(np.array(red), np.array(green), np.array(blue), WAVELENGTHS)


def _shot_facts(shot: MeasuredShot) -> ShotFacts:
    lamp = shot.lamp
    errors = (lamp.tolerance, lamp.tolerance_kelvin) if isinstance(lamp, Lamp) else (None, None)
    return ShotFacts(
        lamp=LampName(lamp.name, errors[0], lamp.source, errors[1]),
        white_reference="white frame" if shot.means.white else "white patch",
        dark_reference="dark frame" if shot.means.dark else "black level",
        photo=_photo_facts(shot.photo),
        white=None if shot.white is None else FrameFacts(shot.white.name, shot.white.sha256),
        dark=None if shot.dark is None else FrameFacts(shot.dark.name, shot.dark.sha256),
        pose=None,
        saturation=shot.means.saturation,
        patches=(),
        lens_shading=shot.lens_shading,
    )


def _photo_facts(photo: Photo) -> PhotoFacts:
    return PhotoFacts(
        name=photo.name,
        width=photo.width,
        height=photo.height,
        orientation=photo.orientation,
        exposure=photo.exposure,
        iso=photo.iso,
        gain_map=photo.gain_map,
        sha256=photo.sha256,
        camera=" ".join(filter(None, (photo.make, photo.model))),
    )
