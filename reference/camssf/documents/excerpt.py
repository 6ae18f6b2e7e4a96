"""The excerpt of a result that a passport holds: curves, bands, verdict and provenance, without the single patches.

A whole result is too large for a token that other programs accept (128,000 bytes). It stays outside the passport,
which holds its SHA-256. The excerpt's form is "camssf-result/1", because passports of that form are signed: they are
verified as they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from camssf.documents.document import Answer, Curves, Document, answer_in
from camssf.documents.forms import BrokenError
from camssf.documents.scale import scale_under
from camssf.errors import CalibrationError, InvalidArgument
from camssf.fit.scores import Scores
from camssf.fit.solutions import Uncertainty
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.patches import LENS_SHADING
from camssf.photo.signals import Assumption
from camssf.recovery.sensitivity import ENGINES, Hypothesis, Proof
from camssf.shapes import (
    MOST_SHOTS,
    Bounds,
    Counts,
    Number,
    Rgb,
    RgbSizes,
    Sha256,
    Share,
    Size,
    Spectrum,
    Text,
    Vector,
    Whole,
    Words,
)
from camssf.spectra import Lamp, read_chart, read_lamp
from camssf.spectra.charts import chart_parts
from camssf.verdict.reasons import Check

FORMAT: Literal["camssf-result/1"] = "camssf-result/1"
PASSED = ("accepted", "doubtful")
"""Statuses of results that have curves."""
LARGEST_PASSPORT = 100_000
"""In bytes. joserfc accepts tokens of up to 129,536 bytes by default."""


@dataclass(frozen=True)
class Generator:
    """The program that wrote the result.

    Attributes:
        name: always camssf.
        version: its version.
    """

    name: Literal["camssf"]
    version: Text


@dataclass(frozen=True)
class CameraName:
    """The camera as its files name it; "" if they do not.

    Attributes:
        make, model: of the first photo.
        unique_model: the DNG's UniqueCameraModel.
    """

    make: Text
    model: Text
    unique_model: Text | None = None


@dataclass(frozen=True)
class ChartName:
    """The chart and its table.

    Attributes:
        name: as given.
        table: name of the reflectance table.
        layout: printed geometry.
        source: of the table.
    """

    name: Text
    table: Text
    layout: Text
    source: Text


@dataclass(frozen=True, eq=False)
class GridCurves(Curves):
    """Three curves with their wavelengths.

    Attributes:
        red, green, blue: one channel.
        wavelength_nm: the grid, 380 to 720 nm every 0.5 nm.
    """

    wavelength_nm: Spectrum

    def __post_init__(self) -> None:
        if not np.array_equal(self.wavelength_nm, WAVELENGTHS):
            raise BrokenError("wavelength_nm", "must be 380 to 720 nm every 0.5 nm")


@dataclass(frozen=True)
class LampName:
    """The light of a shot, without its spectrum.

    Attributes:
        name: as given.
        tolerance: one standard deviation of its smooth relative error; null if the light was not named.
        source: table, formula or file.
        tolerance_kelvin: one standard deviation of its colour temperature, K.
    """

    name: Text
    tolerance: Size | None
    source: Text
    tolerance_kelvin: Size | None = None


@dataclass(frozen=True)
class PhotoFacts:
    """The chart's photo.

    Attributes:
        name: of its file.
        width, height: of the active area, px.
        orientation: TIFF orientation of the display.
        exposure: exposure time, s.
        iso: ISO sensitivity.
        gain_map: whether the file holds a lens-shading map that its samples do not contain.
        sha256: of the file.
        camera: make and model.
    """

    name: Text
    width: Whole
    height: Whole
    orientation: Annotated[int, Bounds(1, 8)]
    exposure: Size | None
    iso: Size | None
    gain_map: bool
    sha256: Sha256
    camera: Text


@dataclass(frozen=True)
class FrameFacts:
    """A white or dark frame.

    Attributes:
        name: of its file.
        sha256: of the file.
    """

    name: Text
    sha256: Sha256


@dataclass(frozen=True)
class ShotFacts:
    """One photo of the chart under one lamp.

    Attributes:
        lamp: its light.
        white_reference: what white was.
        dark_reference: what dark was.
        photo, white, dark: the frames.
        pose: always null.
        saturation: white level, DN.
        patches: always empty.
        lens_shading: treatment of the shading that the file describes.
    """

    lamp: LampName
    white_reference: Annotated[str, Words(("white frame", "white patch"))]
    dark_reference: Annotated[str, Words(("dark frame", "black level"))]
    photo: PhotoFacts
    white: FrameFacts | None
    dark: FrameFacts | None
    pose: None
    saturation: Size
    patches: Annotated[tuple[Text, ...], Bounds(0, 0)]
    lens_shading: Annotated[str, Words(LENS_SHADING)] = LENS_SHADING[0]


@dataclass(frozen=True)
class WrittenReason:
    """Why a verdict is not accepted.

    Attributes:
        code: of the error vocabulary.
        message: what is wrong.
        advice: what to do next.
        value: the number that decided.
        threshold: the bound that it broke.
    """

    code: Text
    message: Text
    advice: Text
    value: Number | None
    threshold: Number | None


@dataclass(frozen=True)
class PassedVerdict:
    """The judgement of a result that was not refused.

    Attributes:
        status: accepted or doubtful.
        reasons: empty only when accepted.
        checks: every number that was compared.
    """

    status: Annotated[str, Words(PASSED)]
    reasons: tuple[WrittenReason, ...]
    checks: tuple[Check, ...] = ()

    def __post_init__(self) -> None:
        if self.status == "doubtful" and not self.reasons:
            raise BrokenError("reasons", "must not be empty if the verdict is doubtful")


@dataclass(frozen=True, kw_only=True, eq=False)
class StatedUncertainty(Uncertainty):
    """The width of the band and where it comes from. Widths are means of the 95 % band's half-width, 400 to 700 nm.

    Attributes:
        half_width: in parts of the peak.
        alone: of each shot alone, if there are several.
        budget: the sources.
        half_width_without_photo: the same of the basis alone, before any photo, missing in the oldest passports.
    """

    half_width_without_photo: Size | None = None


@dataclass(frozen=True)
class Hashes:
    """What the result was made from.

    Attributes:
        inputs: SHA-256 of each input file by its role and name.
        model: SHA-256 of the ONNX model; null with the reference engine.
    """

    inputs: dict[Text, Sha256]
    model: Sha256 | None


@dataclass(frozen=True)
class SignedBy:
    """The passport from which an excerpt was printed.

    Attributes:
        result_sha256: SHA-256 of the whole result that was signed.
        passport: the token; `camssf passport verify` reads it here again.
    """

    result_sha256: Sha256
    passport: Annotated[str, Bounds(0, LARGEST_PASSPORT)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Excerpt:
    """The excerpt of a result that was not refused; its curves have five decimals.

    Attributes:
        format: name and version of this form.
        generator: what wrote the result.
        camera: as its files name it.
        chart: chart and table.
        basis: name of the basis.
        engine: what solved the problem.
        ssf: the curves, each channel's peak = 1.
        ssf_std: one standard deviation of them.
        channel_gain: raw white signal of each channel relative to green.
        gap: relative duality gap of each channel's problem.
        layers_gap: the same before the finish, one number a problem.
        finish_steps: pivots of the finish, one number a problem.
        evidence: ln of the marginal likelihood of the signals, up to a constant.
        prior_scale: width of the prior relative to the learned one.
        chart_fading: part of its colour that the chart has lost.
        choice: the compared hypotheses.
        gamma: the l1 penalty of each channel's problem.
        l2: the quadratic penalty.
        shots: the shots.
        scores: quality of the answer.
        verdict: the judgement.
        uncertainty: width of the band and its sources.
        assumptions: fallbacks and choices on which the result relies.
        hashes: what it was made from.
        excerpt: only in what `camssf passport verify` prints.
    """

    format: Literal["camssf-result/1"]
    generator: Generator
    camera: CameraName
    chart: ChartName
    basis: Text
    engine: Annotated[str, Words(ENGINES)]
    ssf: GridCurves
    ssf_std: GridCurves | None = None
    channel_gain: Rgb
    gap: Rgb
    layers_gap: Vector | None = None
    finish_steps: Counts | None = None
    evidence: Number | None = None
    prior_scale: Size = 1.0
    chart_fading: Share = 0.0
    choice: tuple[Hypothesis, ...] = ()
    gamma: RgbSizes
    l2: Size
    shots: Annotated[tuple[ShotFacts, ...], Bounds(1, MOST_SHOTS)]
    scores: Scores
    verdict: PassedVerdict
    uncertainty: StatedUncertainty | None = None
    assumptions: tuple[Assumption, ...]
    hashes: Hashes
    excerpt: SignedBy | None = None

    def __post_init__(self) -> None:
        self.answer()  # checks the peaks and the numbers of problems

    def answer(self) -> Answer:
        """The answer, without patches and covariance."""
        k = len(self.shots)
        empty = np.zeros((k, 0, 3))
        layers = self.gap if self.layers_gap is None else self.layers_gap
        steps = np.zeros(len(layers), dtype=np.int64) if self.finish_steps is None else self.finish_steps
        try:
            return Answer(
                basis=self.basis,
                engine=self.engine,
                curves=self.ssf,
                channel_gain=self.channel_gain,
                gamma=self.gamma,
                l2=self.l2,
                proof=Proof(self.gap, layers, steps),
                used=((),) * k,
                level=empty[..., 0],
                predicted=empty,
                unseen=empty,
                scores=self.scores,
                model=self.hashes.model,
                std=self.ssf_std,
                evidence=self.evidence,
                prior_scale=self.prior_scale,
                chart_fading=self.chart_fading,
                choice=self.choice,
                uncertainty=self.uncertainty,
            )
        except BrokenError as error:
            where, what = error.args
            raise BrokenError(where.replace("curves.", "ssf."), what) from None

    def lamp(self) -> Lamp | None:
        """The lamp of the first shot; None if no lamp has its name: a file, or a light that was not named."""
        try:
            return read_lamp(self.shots[0].lamp.name)
        except CalibrationError:
            return None

    def scale(self) -> Floats | None:
        """`camssf.documents.scale.channel_scale` of these curves; None if the lamp is not known here."""
        lamp = self.lamp()
        return None if lamp is None else scale_under(self.answer(), lamp.values * self._white())

    def _white(self) -> Floats:
        """(681,) reflectance of the first shot's white reference; of a measured table, that of the printed chart."""
        if self.shots[0].white_reference == "white patch":
            for name in (self.chart.name, self.chart.layout):
                try:
                    if not chart_parts(name)[1]:
                        table = read_chart(name)
                        return np.asarray(table.values[table.white])
                except CalibrationError:
                    continue
        return np.ones(WAVELENGTHS.size)


def holds_excerpt(plain: Any) -> bool:
    """Whether parsed JSON is the excerpt that `camssf passport verify` printed."""
    return isinstance(plain, dict) and isinstance(plain.get("excerpt"), dict)


def check_whole(plain: Any, name: str) -> None:
    """Refuse the printed excerpt of a passport where a whole result is needed; `name` is its source in the message.

    Raises:
        InvalidArgument: it is an excerpt.
    """
    if holds_excerpt(plain):
        raise InvalidArgument(
            f"{name}: is the excerpt that a passport holds, without patches and covariance.",
            f"Give the whole result.json, of SHA-256 {plain['excerpt'].get('result_sha256')}.",
        )


def answer_of(document: Document | Excerpt) -> Answer:
    """The answer of a result, or of the excerpt of one.

    Raises:
        InvalidArgument: the result was refused, or it is a capture that was not solved.
    """
    return document.answer() if isinstance(document, Excerpt) else answer_in(document)
