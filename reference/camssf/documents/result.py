"""The two results of a capture, Calibration and Refusal, and the document of both: "camssf-result/1"."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from camssf import __version__
from camssf.curves.engine import load_model
from camssf.curves.ssf import FoundLight, Ssf, Weight
from camssf.documents.patches import plain
from camssf.documents.previews import previews
from camssf.documents.shown import Result
from camssf.errors import CalibrationError
from camssf.evidence.reasons import Reason, Verdict
from camssf.evidence.scores import Scores, reflectance_srgb, rmse
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.capture import Capture, Photo, Record, Shot, Unfinished
from camssf.photo.signals import Assumption, Signals, normalise
from camssf.spectra import CameraCurves, ChartTable, Lamp, Light

Json: TypeAlias = dict[str, Any]


@dataclass(frozen=True, repr=False, eq=False)
class Calibration(Result):
    """Everything one calibration found.

    It shows itself in a notebook (`plot`, `to_pandas`, `to_xarray`, `to_colour`), and `save` writes its document,
    which `load` reads. A pickle, and a copy, leave out the pictures of the photos, which are most of it.

    Attributes:
        capture: what was measured.
        signals: Eq. (5).
        ssf: the curves.
        level: (k, n) times this, signals are what the answer says that even light would have given; ones where a
            white frame says so.
        predicted_std: (k, n, 3) one standard deviation of the true signals less `ssf.predicted` (`predict`); None
            without a prior.
        unseen: (k, n, 3) predictions of fits that had not seen the patch; NaN where every fit had.
        unseen_std: as `predicted_std`, of `unseen`.
        scores, verdict: how good it is.
        truth: measured curves to compare with, or None.
        assumptions: all that was taken for granted.
        uncertainty: the band's half-width, its budget, and the half-width with each shot alone, as the document has
            them; None on a basis without a prior.
    """

    capture: Capture
    signals: Signals
    ssf: Ssf
    level: Floats
    predicted_std: Floats | None
    unseen: Floats
    unseen_std: Floats | None
    scores: Scores
    verdict: Verdict
    truth: CameraCurves | None
    assumptions: tuple[Assumption, ...]
    uncertainty: Json | None

    @property
    def previews(self) -> tuple[bytes | None, ...]:
        """A JPEG of each shot's active area, for the report; None where it did not travel."""
        return previews(_record(self.capture))

    def __getstate__(self) -> Json:
        """What a pickle holds: all but the thumbnails."""
        shots = tuple(replace(shot, thumbnail=None) for shot in self.capture.shots)
        return vars(self) | {"capture": replace(self.capture, shots=shots)}

    def document(self) -> Json:
        """The result as plain data (data/result.schema.json)."""
        curves, std = self.ssf.peak()
        document = _head(_record(self.capture), self.verdict, self.assumptions) | {
            "basis": self.ssf.basis,
            "engine": self.ssf.engine,
            "ssf": _curves(curves),
            "ssf_std": None if std is None else _curves(std),
            "channel_gain": self.ssf.channel_gain.tolist(),
            "code_covariance": None if self.ssf.code_covariance is None else _triangle(self.ssf.code_covariance),
            "gap": self.ssf.gap.tolist(),
            "layers_gap": self.ssf.layers_gap.tolist(),
            "finish_steps": self.ssf.finish_steps.tolist(),
            "evidence": self.ssf.log_evidence,
            "prior_scale": self.ssf.prior_scale,
            "choice": [_weight(weight) for weight in self.ssf.choice],
            "gamma": self.ssf.gamma.tolist(),
            "l2": self.ssf.l2,
            "uncertainty": self.uncertainty,
            "scores": {
                "rmsre_percent": self.scores.rmsre_percent.tolist(),
                "rmse": None if self.scores.rmse is None else self.scores.rmse.tolist(),
                "delta_e00": float(self.scores.delta_e00),
                "unseen": self.scores.unseen,
            },
        }
        if self.truth is not None:
            compare(document, self.truth)
        if self.ssf.engine == "onnx":
            document["hashes"]["model"] = load_model(self.ssf.basis).sha256
        for entry, light in zip(document["shots"], self.ssf.lights, strict=False):  # none where all were named
            if light is not None:
                entry["light"] = _light(light)
        for j, entry in enumerate(document["shots"]):
            for i, patch in enumerate(entry["patches"]):
                unseen = self.unseen[j, i]
                patch["level"] = float(self.level[j, i])
                patch["predicted"] = self.ssf.predicted[j, i].tolist()
                patch["unseen"] = unseen.tolist() if np.isfinite(unseen).all() else None
                for name, band in (("predicted_std", self.predicted_std), ("unseen_std", self.unseen_std)):
                    known = band is not None and np.isfinite(band[j, i]).all()
                    patch[name] = band[j, i].tolist() if band is not None and known else None
                patch["measured_srgb"] = self.scores.measured_srgb[j, i].tolist()
                patch["synthetic_srgb"] = self.scores.synthetic_srgb[j, i].tolist()
                patch["used"] = bool(self.signals.used[j, i])
        return document


@dataclass(frozen=True, repr=False)
class Refusal(Result):
    """A capture that gave no curves.

    Attributes:
        error: why.
        record: what was known by then.
    """

    error: CalibrationError
    record: Record

    @property
    def previews(self) -> tuple[bytes | None, ...]:
        """A JPEG of the active area of each shot that was read, for the report."""
        return previews(self.record)

    def document(self) -> Json:
        """The refused result as plain data, without curves (data/result.schema.json)."""
        error = self.error
        reasons = error.reasons or (Reason(error.code, error.message, error.advice, error.value, error.threshold),)
        return _head(self.record, Verdict("refused", reasons, error.checks), ()) | {"basis": "none", "engine": "none"}


def compare(document: Json, truth: CameraCurves) -> None:
    """Set a result document's truth and its RMSE against it."""
    curves = np.stack([document["ssf"][colour] for colour in ("red", "green", "blue")], axis=1)
    document["scores"]["rmse"] = rmse(curves, truth.values).tolist()
    document["truth"] = {"name": truth.name, "ssf": _curves(truth.values / truth.values.max(axis=0))}


def _weight(weight: Weight) -> Json:
    """A hypothesis; kinds only where a light was not named."""
    told = {name: value for name, value in vars(weight).items() if name != "kinds"}
    return told | {"kinds": list(weight.kinds)} if weight.kinds else told


def _lamp(lamp: Light) -> Json:
    """A lamp as it was told; nobody knows how well where nobody told it."""
    told = {"name": lamp.name, "tolerance": None, "source": lamp.source}
    if not isinstance(lamp, Lamp):
        return told
    return told | {"tolerance": lamp.tolerance, "power": (lamp.values / lamp.values.mean()).tolist()}


def _light(found: FoundLight) -> Json:
    """What the signals say of a light that nobody named."""
    return {
        "kinds": found.kinds,
        "wavelength_nm": WAVELENGTHS.tolist(),
        "power": found.power.tolist(),
        "std": found.std.tolist(),
        "kelvin": found.kelvin,
        "kelvin_std": found.kelvin_std,
    }


def _record(capture: Capture) -> Record:
    record = Record()
    record.note(capture)
    return record


def _head(record: Record, verdict: Verdict, assumptions: tuple[Assumption, ...]) -> Json:
    """The part of a document that needs no curves."""
    table, last = record.table, record.unfinished
    photos = [shot.photo for shot in record.shots]
    shots = [_shot_document(shot, table) for shot in record.shots] if table else []
    if last is not None and last.photo is not None:
        photos.append(last.photo)
        shots.append(_unfinished_document(last, last.photo))
    inputs = dict(record.files)
    for j, photo in enumerate(photos):
        inputs[f"shot {j + 1}, chart: {photo.name}"] = photo.sha256
    for j, shot in enumerate(record.shots):
        for role, frame in (("white", shot.white), ("dark", shot.dark)):
            if frame is not None:
                inputs[f"shot {j + 1}, {role}: {frame.name}"] = frame.sha256
    return {
        "format": "camssf-result/1",
        "generator": {"name": "camssf", "version": __version__},
        "camera": {
            "make": photos[0].make if photos else "",
            "model": photos[0].model if photos else "",
            "unique_model": (photos[0].unique_model if photos else "") or None,
        },
        "chart": {
            "name": record.chart,
            "table": table.table if table else "",
            "layout": table.layout if table else "",
            "source": table.source if table else "",
        },
        "shots": shots,
        "verdict": {"status": verdict.status, "reasons": [vars(reason) for reason in verdict.reasons]}
        | ({"checks": [vars(check) for check in verdict.checks]} if verdict.checks else {}),
        "assumptions": [vars(assumption) for assumption in assumptions],
        "hashes": {"inputs": inputs, "model": None},
    }


def _unfinished_document(shot: Unfinished, photo: Photo) -> Json:
    """A shot that was not measured to its end."""
    return {
        "lamp": _lamp(shot.lamp),
        "white_reference": "white patch",
        "dark_reference": "black level",
        "photo": _photo_facts(photo),
        "white": None,
        "dark": None,
        "pose": plain(vars(shot.pose)) if shot.pose else None,
        "saturation": shot.saturation,
        "patches": [],
    }


def _photo_facts(photo: Photo) -> Json:
    apart = ("make", "model", "neutrals", "unit", "active_area", "levels", "unique_model")
    facts = {key: value for key, value in vars(photo).items() if key not in apart}
    return facts | {"camera": " ".join(filter(None, (photo.make, photo.model)))}


def _shot_document(shot: Shot, table: ChartTable) -> Json:
    """One shot without predictions; signals where they can be formed."""
    colours = reflectance_srgb(table)
    means = shot.means
    try:
        signals = normalise([means], table)
        y, error, white, dark = signals.values[0], signals.standard_error[0], signals.white[0], signals.dark[0]
    except CalibrationError:  # the refusal is on its way; show what was measured all the same
        y = error = np.zeros_like(means.chart.mean)
        white = means.white.mean if means.white else np.tile(means.chart.mean[table.white], (len(y), 1))
        dark = means.dark.mean if means.dark else np.tile(means.black, (len(y), 1))
    return {
        "lamp": _lamp(shot.lamp),
        "white_reference": "white frame" if means.white else "white patch",
        "dark_reference": "dark frame" if means.dark else "black level",
        "photo": _photo_facts(shot.photo),
        "white": {"name": shot.white.name, "sha256": shot.white.sha256} if shot.white else None,
        "dark": {"name": shot.dark.name, "sha256": shot.dark.sha256} if shot.dark else None,
        "lens_shading": shot.lens_shading,
        "pose": plain(vars(shot.pose)),
        "saturation": means.saturation,
        "patches": [
            {
                "name": name,
                "used": False,
                "reflectance_srgb": colours[i].tolist(),
                "measured_srgb": None,
                "synthetic_srgb": None,
                "signal": y[i].tolist(),
                "level": 1.0,
                "predicted": None,
                "unseen": None,
                "standard_error": error[i].tolist(),
                "clipped": means.chart.clipped[i].tolist(),
                "dead": means.chart.dead[i].tolist(),
                "gradient": means.chart.gradient[i].tolist(),
                "chart": means.chart.mean[i].tolist(),
                "white": white[i].tolist(),
                "dark": dark[i].tolist(),
            }
            for i, name in enumerate(table.patches)
        ],
    }


def _triangle(covariance: Floats) -> list[float]:
    """The lower triangle of a symmetric matrix, row after row: half of 100 kB, and every digit kept."""
    lower: list[float] = covariance[np.tril_indices(len(covariance))].tolist()
    return lower


def _curves(values: Floats) -> Json:
    red, green, blue = values.T.tolist()
    return {"wavelength_nm": WAVELENGTHS.tolist(), "red": red, "green": green, "blue": blue}
