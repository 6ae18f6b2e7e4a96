"""The three results: Calibration (just made), Refusal (no curves) and SavedResult (read from its document)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from camssf.documents.result_json import (
    check_document,
    compare,
    curves_json,
    document_bytes,
    head_json,
    light_json,
    read_document,
    record_of,
    triangle,
    weight_json,
)
from camssf.errors import CalibrationError
from camssf.files import write_file
from camssf.fit.scores import Scores
from camssf.grid import Floats, columns
from camssf.photo.capture import Capture, Record
from camssf.photo.signals import Assumption, Signals
from camssf.recovery.onnx_model import load_model
from camssf.recovery.sensitivity import Ssf
from camssf.report.notebook import as_html, as_line, with_curves
from camssf.report.previews import previews
from camssf.spectra import CameraCurves
from camssf.verdict.checks import Check
from camssf.verdict.reasons import Reason, Verdict

if TYPE_CHECKING:
    import pandas
    import xarray
    from colour.characterisation import RGB_CameraSensitivities
    from matplotlib.axes import Axes

Json: TypeAlias = dict[str, Any]
Kind: TypeAlias = Literal["curves", "residuals", "patches", "budget"]
"""What `Result.plot` draws."""
Table: TypeAlias = Literal["curves", "patches", "budget"]
"""What `Result.to_pandas` lists."""


class Result:
    """Common interface of all results: plot, save, and convert to other libraries.

    A `Calibration` was just computed and holds its capture; a `SavedResult` was read from a file; a `Refusal` has no
    curves.
    """

    def document(self) -> Json:
        """The result as plain data, "camssf-result/1" (data/result.schema.json)."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return as_line(type(self).__name__, self.document())

    def _repr_html_(self) -> str:
        """HTML for Jupyter: verdict, curves, scores."""
        return as_html(self.document())

    @property
    def curves(self) -> Floats:
        """(681, 3) red, green, blue, 380 to 720 nm every 0.5 nm, each channel's peak = 1.

        Raises:
            InvalidArgument: the result was refused.
        """
        return columns(with_curves(self.document())["ssf"])

    @property
    def std(self) -> Floats | None:
        """(681, 3) one standard deviation of `curves`; None on a basis without a prior.

        Raises:
            InvalidArgument: the result was refused.
        """
        found = with_curves(self.document()).get("ssf_std")
        return None if found is None else columns(found)

    def plot(self, kind: Kind = "curves", ax: Axes | None = None, *, shot: int = 1) -> Axes:
        """Draw the result.

        Args:
            kind: "curves" with their 95 % bands; "residuals", cross-validated prediction minus measured signal of
                each patch, %; "patches", the measured and the predicted colour of each; "budget", the sources of the
                band.
            ax: matplotlib axes to draw on; new ones unless given.
            shot: which one, from 1, for residuals and patches.

        Returns:
            The axes.

        Raises:
            InvalidArgument: a refused result, an unknown kind, a shot that does not exist, or no matplotlib.
        """
        from camssf.report.plots import draw

        axes: Axes = draw(self.document(), kind, ax, shot)
        return axes

    def to_colour(self) -> RGB_CameraSensitivities:
        """The curves as colour-science's RGB_CameraSensitivities, every 0.5 nm.

        The channels keep their relative scale, and so the camera's white balance; the largest peak is 1.

        Raises:
            InvalidArgument: a refused result, or one whose first lamp is not available any more.
        """
        from camssf.report.tables import to_colour

        return to_colour(self.document())

    def to_pandas(self, table: Table = "curves") -> pandas.DataFrame:
        """A DataFrame: "curves" by wavelength_nm; "patches" of all shots; or "budget" by source.

        Raises:
            InvalidArgument: a refused result (except for "patches"), an unknown table, or no pandas.
        """
        from camssf.report.tables import to_pandas

        return to_pandas(self.document(), table)

    def to_xarray(self) -> xarray.Dataset:
        """A Dataset: ssf and ssf_std over wavelength and channel, signals over shot, patch and channel.

        Raises:
            InvalidArgument: a refused result, or no xarray.
        """
        from camssf.report.tables import to_xarray

        return to_xarray(self.document())

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the result document; the same result gives the same bytes. `load` and all commands can read it.

        Returns:
            The file.

        Raises:
            InvalidArgument: it cannot be written there.
        """
        document = self.document()
        check_document(document, "document")
        write_file(Path(path), document_bytes(document))
        return Path(path)

    @staticmethod
    def load(path: str | PathLike[str]) -> SavedResult:
        """Read a result from its document, written by Python, the command line or a phone.

        Raises:
            InvalidArgument: the file is not a valid "camssf-result/1".
        """
        return SavedResult(read_document(Path(path)))


@dataclass(frozen=True, repr=False)
class SavedResult(Result):
    """A result read from its document; it does not hold the photos' samples.

    Attributes:
        content: the checked document; do not modify it.
    """

    content: Json = field(repr=False)

    def __post_init__(self) -> None:
        check_document(self.content, "document")

    def document(self) -> Json:
        """The result as plain data, "camssf-result/1" (data/result.schema.json)."""
        return self.content

    @property
    def verdict(self) -> Verdict:
        """accepted, doubtful or refused, with the reasons."""
        said = self.content["verdict"]
        reasons = tuple(Reason(**reason) for reason in said["reasons"])
        return Verdict(said["status"], reasons, tuple(Check(**check) for check in said.get("checks", ())))

    @property
    def uncertainty(self) -> Json | None:
        """The band's half-width and its budget, as `Calibration.uncertainty`."""
        return self.content.get("uncertainty")

    @property
    def assumptions(self) -> tuple[Assumption, ...]:
        """The assumptions behind the answer."""
        return tuple(Assumption(**each) for each in self.content["assumptions"])

    @property
    def scores(self) -> Mapping[str, Any]:
        """As in the document: rmsre_percent, rmse, delta_e00, unseen; empty if the result was refused."""
        return dict(self.content.get("scores") or {})


@dataclass(frozen=True, repr=False, eq=False)
class Calibration(Result):
    """The result of one calibration.

    `save` writes its document, which `load` reads. A pickle or a copy leaves out the photos' thumbnails, which are
    most of its size.

    Attributes:
        capture: the measured shots.
        signals: Eq. (5).
        ssf: the curves.
        level: (k, n) correction for uneven light: signals times `level` are the estimated signals under even light.
            All ones if no gain modes were fitted.
        predicted_std: (k, n, 3) standard deviation of the true signals minus `ssf.predicted` (`predict`); None
            without a prior.
        unseen: (k, n, 3) cross-validated predictions; NaN for a patch that is in every fit.
        unseen_std: as `predicted_std`, of `unseen`.
        scores, verdict: the quality of the answer.
        truth: measured curves to compare with, or None.
        assumptions: the assumptions behind the answer.
        uncertainty: the band's half-width, its budget, and the half-width with each shot alone, as in the document;
            None on a basis without a prior.
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
        """A JPEG of each shot's active area, for the report; None where the capture holds no thumbnail."""
        return previews(record_of(self.capture))

    def __getstate__(self) -> Json:
        """The state for a pickle or a copy, without the thumbnails."""
        shots = tuple(replace(shot, thumbnail=None) for shot in self.capture.shots)
        return vars(self) | {"capture": replace(self.capture, shots=shots)}

    def document(self) -> Json:
        """The result as plain data (data/result.schema.json)."""
        curves, std = self.ssf.peak()
        settings, light, posterior = self.ssf.settings, self.ssf.light, self.ssf.posterior
        document = head_json(record_of(self.capture), self.verdict, self.assumptions) | {
            "basis": settings.basis,
            "engine": settings.engine,
            "ssf": curves_json(curves),
            "ssf_std": None if std is None else curves_json(std),
            "channel_gain": light.channel_gain.tolist(),
            "code_covariance": None if posterior is None else triangle(posterior.code_covariance),
            "gap": self.ssf.proof.gap.tolist(),
            "layers_gap": self.ssf.proof.layers_gap.tolist(),
            "finish_steps": self.ssf.proof.finish_steps.tolist(),
            "evidence": None if posterior is None else posterior.log_evidence,
            "prior_scale": settings.prior_scale,
            "chart_fading": settings.chart_fading,
            "choice": [weight_json(weight) for weight in self.ssf.choice],
            "gamma": settings.gamma.tolist(),
            "l2": settings.l2,
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
        if settings.engine == "onnx":
            document["hashes"]["model"] = load_model(settings.basis).sha256
        for entry, estimated in zip(document["shots"], light.lights, strict=False):  # empty if all are named
            if estimated is not None:
                entry["light"] = light_json(estimated)
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
    """A refused capture, without curves.

    Attributes:
        error: the reason.
        record: what was measured before the refusal.
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
        return head_json(self.record, Verdict("refused", reasons, error.checks), ()) | {
            "basis": "none",
            "engine": "none",
        }
