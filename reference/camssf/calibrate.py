"""The only place where the stages meet: photos and lamps in, calibration out."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf import __version__
from camssf.basis import Basis
from camssf.chart import LAYOUTS, Pose, find_chart
from camssf.engine import load_model
from camssf.errors import CalibrationError, FramesDiffer, InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.mosaic import Mosaic, read_dng
from camssf.patches import FrameMeans, PatchMeans, measure_patches
from camssf.signals import Assumption, Signals, normalise
from camssf.spectra import CameraCurves, ChartTable, Lamp, read_camera, read_chart, read_lamp, with_tolerance
from camssf.ssf import Ssf, explain, recover
from camssf.validate import FAINTEST, Scores, reflectance_srgb, rmse, validate
from camssf.verdict import Reason, Verdict, judge, refusal

FOLDS = 4
"""All patches enter the fit; each is predicted by a fit that left its quarter of the chart out."""
HIDDEN = 1e3
"""Standard error of a signal that is used in another shot but not in this one: it then weighs nothing."""
WHITE_TOLERANCE = 0.01
MOST_SHOTS, MOST_PATCHES = 64, 1000
PREVIEW = 1200
"""Longest side of a preview, px."""

Json = dict[str, Any]
Progress = Callable[[str, float], None]
PathLike = str | Path


@dataclass(frozen=True)
class Photo:
    """What a frame's file says, without its samples."""

    name: str
    width: int
    height: int
    orientation: int
    exposure: float | None
    iso: float | None
    gain_map: bool
    make: str
    model: str
    sha256: str


@dataclass(frozen=True)
class Shot:
    """One measured shot: the chart photo under one lamp, with its frames.

    Attributes:
        lamp: its light.
        photo, white, dark: what the files say; None where there is no frame.
        pose: where the chart lies in the photo.
        means: the patch statistics of all frames.
        thumbnail: (h, w, 3) DN, a sparse sample of the active area for the report; None where it did not travel.
    """

    lamp: Lamp
    photo: Photo
    white: Photo | None
    dark: Photo | None
    pose: Pose
    means: PatchMeans
    thumbnail: NDArray[np.uint16] | None


@dataclass
class _Begun:
    """What is known so far, for the evidence of a refusal: finished shots, and the one that was in work."""

    shots: list[Shot] = field(default_factory=list)
    table: ChartTable | None = None
    chart: str = ""
    lamp: Lamp | None = None
    photo: Photo | None = None
    saturation: float = 0.0
    pose: Pose | None = None
    picture: bytes | None = None
    files: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Capture:
    """k measured shots of one chart with one camera: what `solve` needs.

    Attributes:
        shots: k of them.
        chart: the chart's table.
        white_reflectance: of the white frame's card, one number; None for a perfect diffuser.
        files: SHA-256 of the lamp and chart files, by role and name; empty where both go by name.
    """

    shots: tuple[Shot, ...]
    chart: ChartTable
    white_reflectance: float | None
    files: dict[str, str] = field(default_factory=dict)

    def document(self) -> Json:
        """The capture as plain data, "camssf-patches/1"; it needs no other file to be solved."""
        return {
            "format": "camssf-patches/1",
            "generator": {"name": "camssf", "version": __version__},
            "chart": _plain(vars(self.chart)),
            "white_reflectance": self.white_reflectance,
            "files": self.files,
            "shots": [
                {
                    "lamp": _plain(vars(shot.lamp)),
                    "photo": vars(shot.photo),
                    "white": vars(shot.white) if shot.white else None,
                    "dark": vars(shot.dark) if shot.dark else None,
                    "pose": _plain(vars(shot.pose)),
                    "saturation": shot.means.saturation,
                    "black": shot.means.black.tolist(),
                    "means": {
                        frame: _plain(vars(means)) if (means := getattr(shot.means, frame)) else None
                        for frame in ("chart", "white", "dark")
                    },
                }
                for shot in self.shots
            ],
        }

    @staticmethod
    def from_document(document: Json) -> Capture:
        """The capture of a "camssf-patches/1" document.

        Raises:
            InvalidArgument: another format, or a field that is missing or of the wrong kind.
        """
        if not isinstance(document, dict) or document.get("format") != "camssf-patches/1":
            raise InvalidArgument("this is not a camssf-patches/1 document.", "Make one with `camssf patches`.")
        try:
            table = _table_from(document["chart"])
            shots = tuple(_shot_from(entry, len(table.patches)) for entry in document["shots"])
            _need(0 < len(shots) <= MOST_SHOTS, "shots", f"must hold 1 to {MOST_SHOTS}")
            files = {_text(key, "files"): _text(value, "files") for key, value in document["files"].items()}
            _agree(shots)
            return Capture(shots, table, _card(document["white_reflectance"], shots[0].white is not None), files)
        except KeyError as error:
            raise InvalidArgument(
                f"the camssf-patches/1 document lacks {error}.", "Make it anew with `camssf patches`."
            ) from error
        except (TypeError, ValueError, AttributeError) as error:
            raise InvalidArgument(
                f"the camssf-patches/1 document is damaged: {error}.", "Make it anew with `camssf patches`."
            ) from error


@dataclass(frozen=True)
class Calibration:
    """Everything one calibration found.

    Attributes:
        capture: what was measured.
        signals: Eq. (5).
        ssf: the curves.
        unseen: (k, n, 3) predictions of fits that had not seen the patch; NaN where every fit had.
        scores, verdict: how good it is.
        truth: measured curves to compare with, or None.
        assumptions: all that was taken for granted.
        uncertainty: the band's half-width, its budget, and the half-width with each shot alone, as the document has
            them; None on a basis without a prior.
    """

    capture: Capture
    signals: Signals
    ssf: Ssf
    unseen: Floats
    scores: Scores
    verdict: Verdict
    truth: CameraCurves | None
    assumptions: tuple[Assumption, ...]
    uncertainty: Json | None

    @property
    def previews(self) -> tuple[bytes | None, ...]:
        """A JPEG of each shot's active area, for the report."""
        return tuple(_jpeg(shot) for shot in self.capture.shots)

    def document(self) -> Json:
        """The result as plain data, "camssf-result/1" (data/result.schema.json)."""
        curves, std = self.ssf.peak()
        capture = self.capture
        begun = _Begun(list(capture.shots), capture.chart, capture.chart.name, files=capture.files)
        document = _head(begun, self.verdict, self.assumptions) | {
            "basis": self.ssf.basis,
            "engine": self.ssf.engine,
            "ssf": _curves(curves),
            "ssf_std": None if std is None else _curves(std),
            "channel_gain": self.ssf.channel_gain.tolist(),
            "gap": self.ssf.gap.tolist(),
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
        for j, entry in enumerate(document["shots"]):
            for i, patch in enumerate(entry["patches"]):
                unseen = self.unseen[j, i]
                patch["predicted"] = self.ssf.predicted[j, i].tolist()
                patch["unseen"] = unseen.tolist() if np.isfinite(unseen).all() else None
                patch["measured_srgb"] = self.scores.measured_srgb[j, i].tolist()
                patch["synthetic_srgb"] = self.scores.synthetic_srgb[j, i].tolist()
                patch["used"] = bool(self.signals.used[j, i])
        return document


def compare(document: Json, truth: CameraCurves) -> None:
    """Set a result document's truth and its RMSE against it."""
    curves = np.stack([document["ssf"][colour] for colour in ("red", "green", "blue")], axis=1)
    document["scores"]["rmse"] = rmse(curves, truth.values).tolist()
    document["truth"] = {"name": truth.name, "ssf": _curves(truth.values / truth.values.max(axis=0))}


def calibrate(
    photos: PathLike | Sequence[PathLike],
    lamps: str | Lamp | Sequence[str | Lamp],
    *,
    white: PathLike | Sequence[PathLike | None] | None = None,
    dark: PathLike | Sequence[PathLike | None] | None = None,
    chart: str | ChartTable = "classic24",
    corners: Sequence[ArrayLike | None] | None = None,
    white_reflectance: float | None = None,
    lamp_tolerance: str | Sequence[str | None] | None = None,
    basis: str | Basis = "cameras",
    fit: Sequence[int] | None = None,
    nonnegative: bool | None = None,
    l2: float | None = None,
    gamma: float | None = None,
    engine: str = "onnx",
    truth: PathLike | CameraCurves | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """From RAW photos to the camera's spectral sensitivity: `solve(measure(...))`.

    Args:
        photos: DNG of each shot.
        lamps: the light of each shot, a name for `read_lamp` or a Lamp.
        white, dark: DNG of each shot's white and dark frame; None where there is none.
        chart: name or file for `read_chart`, or a table.
        corners: for each shot None or (4, 2) corners by hand.
        white_reflectance: of the white frame's card, 0 to 1, flat; None for a perfect diffuser.
        lamp_tolerance: how well each lamp is known, `2%`, `300K` or both (`with_tolerance`); None for its default.
        basis, nonnegative, l2, gamma, engine: as in `recover`.
        fit: 1-based numbers of the patches that enter the fit; None for all, validated fold by fold.
        truth: measured curves of this camera (CSV or name), to compare with.
        progress: called with a stage in words and the part done, 0 to 1.

    Raises:
        CalibrationError: refused; `evidence` on it is a result document without curves.
    """
    capture = measure(
        photos, lamps, white=white, dark=dark, chart=chart, corners=corners, white_reflectance=white_reflectance,
        lamp_tolerance=lamp_tolerance, progress=progress,
    )  # fmt: skip
    return solve(
        capture, basis=basis, fit=fit, nonnegative=nonnegative, l2=l2, gamma=gamma, engine=engine, truth=truth,
        progress=progress,
    )  # fmt: skip


def measure(
    photos: PathLike | Sequence[PathLike],
    lamps: str | Lamp | Sequence[str | Lamp],
    *,
    white: PathLike | Sequence[PathLike | None] | None = None,
    dark: PathLike | Sequence[PathLike | None] | None = None,
    chart: str | ChartTable = "classic24",
    corners: Sequence[ArrayLike | None] | None = None,
    white_reflectance: float | None = None,
    lamp_tolerance: str | Sequence[str | None] | None = None,
    progress: Progress | None = None,
) -> Capture:
    """Read the photos, find the chart and measure its patches; arguments as in `calibrate`."""
    tell = progress or (lambda stage, part: None)
    files = _list("photos", photos)
    if not files:
        raise InvalidArgument("there is no photo.", "Give the DNG of at least one photo of the chart.")
    names = _list("lamps", lamps)
    k = len(files)
    if len(names) != k:
        read_lamp("") if not names else None  # explains why a lamp must be named
        raise InvalidArgument(
            f"{k} photo(s) but {len(names)} lamp(s).", "Give one --lamp a photo, in the same order."
        )
    _need(k <= MOST_SHOTS, "photos", f"must be at most {MOST_SHOTS}")
    whites, darks = _frames("white", white, k), _frames("dark", dark, k)
    places = _list("corners", corners) or [None] * k
    if len(places) != k:
        raise InvalidArgument(f"{k} photo(s) but {len(places)} set(s) of corners.", "Give one set a photo.")
    if len({w is None for w in whites}) > 1:
        raise InvalidArgument(
            "some shots have a white frame and some have none.", "Give a white frame for all shots, or for none."
        )
    known = _list("lamp_tolerance", lamp_tolerance) or [None] * k
    if len(known) != k:
        raise InvalidArgument(f"{k} photo(s) but {len(known)} lamp tolerance(s).", "Give one a photo, or none.")
    card = _card(white_reflectance, whites[0] is not None)
    begun = _Begun(chart=chart.name if isinstance(chart, ChartTable) else str(chart))
    with _evidence(begun):
        for role, spec in [("chart table", chart), *((f"shot {j + 1}, lamp", lamp) for j, lamp in enumerate(names))]:
            begun.files |= _file(role, spec)
        lights = [lamp if isinstance(lamp, Lamp) else read_lamp(lamp) for lamp in names]
        lights = [with_tolerance(lamp, text) if text else lamp for lamp, text in zip(lights, known, strict=True)]
        begun.table = table = chart if isinstance(chart, ChartTable) else read_chart(chart)
        for j in range(k):
            at = f" {j + 1} of {k}" if k > 1 else ""
            tell(f"reading photo{at}", j / k)
            begun.lamp, begun.photo, begun.pose = lights[j], None, None
            photo = read_dng(files[j])
            begun.photo, begun.saturation = _facts(photo), photo.white
            tell(f"looking for the chart{at}", (j + 0.4) / k)
            try:
                begun.pose = pose = find_chart(photo, table, corners=places[j])
                tell(f"measuring the patches{at}", (j + 0.7) / k)
                white_file, dark_file = whites[j], darks[j]
                white_frame = None if white_file is None else read_dng(white_file)
                dark_frame = None if dark_file is None else read_dng(dark_file)
                means = measure_patches(photo, pose, white=white_frame, dark=dark_frame)
            except CalibrationError:
                begun.picture = preview(photo)
                raise
            begun.shots.append(
                Shot(
                    lights[j],
                    begun.photo,
                    _facts(white_frame) if white_frame else None,
                    _facts(dark_frame) if dark_frame else None,
                    pose,
                    means,
                    _thumbnail(photo),
                )
            )
            begun.lamp = begun.photo = None
        _agree(begun.shots)
    return Capture(tuple(begun.shots), table, card, begun.files)


def solve(
    capture: Capture,
    *,
    basis: str | Basis = "cameras",
    fit: Sequence[int] | None = None,
    nonnegative: bool | None = None,
    l2: float | None = None,
    gamma: float | None = None,
    engine: str = "onnx",
    truth: PathLike | CameraCurves | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """From measured patches to curves, scores and verdict; arguments as in `calibrate`."""
    tell = progress or (lambda stage, part: None)
    known = truth if isinstance(truth, CameraCurves) or truth is None else read_camera(str(truth))
    table, k = capture.chart, len(capture.shots)
    asked = _fit(fit, len(table.patches))
    begun = _Begun(list(capture.shots), capture.chart, capture.chart.name, files=capture.files)
    with _evidence(begun):
        tell("solving", 0.9)
        signals = normalise([shot.means for shot in capture.shots], table)
        signals = replace(signals, used=signals.used & asked)
        taken = signals.used.any(axis=0)
        if int(taken.sum()) < 3:
            raise InvalidArgument(
                f"only {int(taken.sum())} patches are left for the fit.",
                "Name more patches by --fit, or leave it out.",
            )

        def solution(used: NDArray[np.bool_], penalty: ArrayLike | None) -> Ssf:
            return _recover(capture, signals, used, basis, nonnegative, l2, penalty, engine)

        ssf = solution(signals.used, gamma)
        tell("validating", 0.95)
        unseen, how = _unseen(signals, ssf, asked, solution, capture)
        lamps = [shot.lamp for shot in capture.shots]
        mask: NDArray[np.bool_] = np.all(np.isfinite(unseen), axis=2)
        scores = validate(
            signals,
            np.where(mask[:, :, None], unseen, ssf.predicted),
            table,
            lamps,
            ssf.values,
            known,
            mask,
            how,
        )
        uncertainty = None
        if ssf.std is not None:
            single = np.eye(k, dtype=bool)[:, :, None] if k > 1 else np.zeros((0, 1, 1), dtype=bool)
            alone = [solution(signals.used & shot, gamma) for shot in single]
            uncertainty = _uncertainty(capture, signals, ssf, basis, alone)
        means, poses = [shot.means for shot in capture.shots], [shot.pose for shot in capture.shots]
        verdict = judge(signals, table, means, poses, lamps, ssf)
        if verdict.status == "refused":
            raise refusal(verdict)
    assumptions = signals.assumptions + _assumptions(capture, ssf, k)
    return Calibration(capture, signals, ssf, unseen, scores, verdict, known, assumptions, uncertainty)


def _recover(
    capture: Capture,
    signals: Signals,
    used: NDArray[np.bool_],
    basis: str | Basis,
    nonnegative: bool | None,
    l2: float | None,
    gamma: ArrayLike | None,
    engine: str,
) -> Ssf:
    """`recover` on the used patches; the answer predicts all of them."""
    taken = used.any(axis=0)
    arguments = _arguments(capture, signals, used, basis)
    ssf = recover(
        **arguments,
        l2=l2,
        gamma=gamma,
        nonnegative=nonnegative,
        frames=(signals.chart[:, taken], signals.white[:, taken], signals.dark[:, taken]),
        engine=engine,
    )
    lamps, rho = arguments["lamp"], arguments["white_reflectance"]
    predicted = ((lamps[:, None] * capture.chart.values) @ ssf.values) / ((lamps * rho) @ ssf.values)[:, None]
    return replace(ssf, predicted=predicted)


def _arguments(capture: Capture, signals: Signals, used: NDArray[np.bool_], basis: str | Basis) -> dict[str, Any]:
    """What `recover` and `explain` take of a capture."""
    table = capture.chart
    taken = used.any(axis=0)
    paper = basis == "gaussian" or (isinstance(basis, Basis) and not basis.prior)
    rho, white_tolerance = white_reference(capture)
    return {
        "signals": signals.values[:, taken],
        "reflectance": table.values[taken],
        "lamp": np.stack([shot.lamp.values for shot in capture.shots]),
        "standard_error": np.where(used[:, :, None], signals.standard_error, HIDDEN)[:, taken],
        "chart_tolerance": 0.0 if paper else table.tolerance[taken],  # the paper knows of no error in the chart
        "white_reflectance": rho,
        "white_tolerance": white_tolerance,
        "lamp_tolerance": [shot.lamp.tolerance for shot in capture.shots],
        "lamp_modes": _modes(capture),
        "basis": basis,
    }


def _uncertainty(capture: Capture, signals: Signals, ssf: Ssf, basis: str | Basis, alone: Sequence[Ssf]) -> Json:
    """Where the band comes from, GUM style, and how wide it would be with each shot alone."""
    shares = explain(**_arguments(capture, signals, signals.used, basis))
    noise = float(np.median((signals.standard_error / np.maximum(signals.values, FAINTEST))[signals.used]))
    _, white = white_reference(capture)
    lamps = [shot.lamp for shot in capture.shots]
    sizes = {
        "noise": f"standard errors of the signals, median {noise:.2%}",
        "chart": f"{np.median(capture.chart.tolerance):.1%} a patch, smooth over 100 nm, the same under every lamp",
        "white": f"{white:.1%}, smooth over 100 nm",
        "lamp": ", ".join(f"{lamp.tolerance:.1%}" for lamp in lamps) + ", smooth over 60 nm",
        "lamp modes": ", ".join(f"{lamp.name}: {len(lamp.modes)}" for lamp in lamps),
        "unseen": "what the prior leaves open and no patch has seen",
    }
    return {
        "half_width": _half_width(ssf),
        "alone": [_half_width(answer) for answer in alone],
        "budget": [
            {"source": source, "size": sizes[source], "share": share.tolist()} for source, share in shares.items()
        ],
    }


def _half_width(ssf: Ssf) -> float:
    """Mean half-width of the 95 % band, 400 to 700 nm, in parts of the peak."""
    std = ssf.peak()[1]
    visible = (WAVELENGTHS >= 400.0) & (WAVELENGTHS <= 700.0)
    return 0.0 if std is None else float(1.96 * std[visible].mean())


def white_reference(capture: Capture) -> tuple[Floats, float]:
    """ρ_w (681,) and its tolerance: the white frame's card, or the chart's own white patch."""
    table = capture.chart
    if capture.shots[0].means.white is None:
        return table.values[table.white], float(table.tolerance[table.white])
    share = 1.0 if capture.white_reflectance is None else capture.white_reflectance
    return np.full(WAVELENGTHS.size, share), WHITE_TOLERANCE


def _modes(capture: Capture) -> Floats:
    """(k, q, 681): every shot's lamp modes, filled up with zeros to the longest list."""
    q = max(len(shot.lamp.modes) for shot in capture.shots)
    modes = np.zeros((len(capture.shots), q, WAVELENGTHS.size))
    for j, shot in enumerate(capture.shots):
        modes[j, : len(shot.lamp.modes)] = shot.lamp.modes
    return modes


def _unseen(
    signals: Signals,
    ssf: Ssf,
    asked: NDArray[np.bool_],
    solution: Callable[[NDArray[np.bool_], ArrayLike | None], Ssf],
    capture: Capture,
) -> tuple[Floats, str]:
    """Predictions of fits that had not seen the patch, and how that was done in words."""
    rest = ~asked
    if capture.shots[0].means.white is None:
        rest = rest & (np.arange(asked.size) != capture.chart.white)  # its signal is 1 whatever the curves
    if rest.any():
        names = f"{int(rest.sum())} patches that did not enter the fit"
        return np.where(rest[None, :, None], ssf.predicted, np.nan), names
    taken = np.flatnonzero(signals.used.any(axis=0))
    unseen = np.full(ssf.predicted.shape, np.nan)
    for fold in range(FOLDS):
        out = np.zeros(asked.size, dtype=bool)
        out[taken[fold::FOLDS]] = True
        unseen[:, out] = solution(signals.used & ~out, ssf.gamma).predicted[:, out]
    unseen[~signals.used] = np.nan
    return unseen, f"each of {taken.size} patches, by a fit that left its quarter of the chart out"


def _assumptions(capture: Capture, ssf: Ssf, k: int) -> tuple[Assumption, ...]:
    """What the answer takes for granted beyond the fallbacks of Eq. (5)."""
    table = capture.chart
    paper = ssf.std is None
    found = [
        Assumption(
            "chart_table", f"the chart's reflectances are {table.source} ({table.table}), not this very chart's."
        )
    ]
    for j, shot in enumerate(capture.shots):
        where = f"shot {j + 1}: " if k > 1 else ""
        found.append(
            Assumption(
                "lamp",
                f"{where}the light was {shot.lamp.name} ({shot.lamp.source}), smooth relative tolerance "
                f"{shot.lamp.tolerance:.1%}, {len(shot.lamp.modes)} mode(s).",
            )
        )
        if shot.photo.gain_map:
            found.append(
                Assumption(
                    "lens_shading",
                    f"{where}{shot.photo.name} holds a lens-shading map; it was not applied"
                    + (
                        ", the white frame corrects the shading."
                        if shot.white
                        else " and no white frame corrects it."
                    ),
                )
            )
    if capture.shots[0].means.white is not None and capture.white_reflectance is None:
        found.append(Assumption("white_reference", "the white frame shows a perfect diffuser (reflectance 1)."))
    if paper:
        found.append(Assumption("no_band", "the paper's basis has no prior, so this answer carries no error band."))
    return tuple(found)


# --- documents ---------------------------------------------------------------------------------------------------


@contextmanager
def _evidence(begun: _Begun) -> Iterator[None]:
    """Attach a refused result document, with what was learned until then, to a refusal on its way out."""
    try:
        yield
    except CalibrationError as error:
        if error.evidence is None and not isinstance(error, InvalidArgument):
            reasons = error.reasons or (
                Reason(error.code, error.message, error.advice, error.value, error.threshold),
            )
            error.evidence = _head(begun, Verdict("refused", reasons), ()) | {"basis": "none", "engine": "none"}
            error.previews = tuple(_jpeg(shot) for shot in begun.shots)
            if begun.photo is not None:
                error.previews += (begun.picture,)
        raise


def _head(begun: _Begun, verdict: Verdict, assumptions: tuple[Assumption, ...]) -> Json:
    """The part of a result document that needs no curves."""
    table = begun.table
    facts = [shot.photo for shot in begun.shots] + ([begun.photo] if begun.photo else [])
    inputs = dict(begun.files)
    for j, photo in enumerate(facts):
        inputs[f"shot {j + 1}, chart: {photo.name}"] = photo.sha256
    for j, shot in enumerate(begun.shots):
        for role, frame in (("white", shot.white), ("dark", shot.dark)):
            if frame is not None:
                inputs[f"shot {j + 1}, {role}: {frame.name}"] = frame.sha256
    shots = [_shot_document(shot, table) for shot in begun.shots] if table else []
    if begun.photo and begun.lamp:
        shots.append(_begun_document(begun, begun.photo, begun.lamp))
    return {
        "format": "camssf-result/1",
        "generator": {"name": "camssf", "version": __version__},
        "camera": {"make": facts[0].make if facts else "", "model": facts[0].model if facts else ""},
        "chart": {
            "name": begun.chart,
            "table": table.table if table else "",
            "layout": table.layout if table else "",
            "source": table.source if table else "",
        },
        "shots": shots,
        "verdict": {"status": verdict.status, "reasons": [vars(reason) for reason in verdict.reasons]},
        "assumptions": [vars(assumption) for assumption in assumptions],
        "hashes": {"inputs": inputs, "model": None},
    }


def _begun_document(begun: _Begun, photo: Photo, lamp: Lamp) -> Json:
    """A shot that was not measured to its end."""
    return {
        "lamp": {"name": lamp.name, "tolerance": lamp.tolerance, "source": lamp.source},
        "white_reference": "white patch",
        "dark_reference": "black level",
        "photo": _photo_document(photo),
        "white": None,
        "dark": None,
        "pose": _plain(vars(begun.pose)) if begun.pose else None,
        "saturation": begun.saturation,
        "patches": [],
    }


def _photo_document(photo: Photo) -> Json:
    facts = {key: value for key, value in vars(photo).items() if key not in ("make", "model")}
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
        "lamp": {"name": shot.lamp.name, "tolerance": shot.lamp.tolerance, "source": shot.lamp.source},
        "white_reference": "white frame" if means.white else "white patch",
        "dark_reference": "dark frame" if means.dark else "black level",
        "photo": _photo_document(shot.photo),
        "white": {"name": shot.white.name, "sha256": shot.white.sha256} if shot.white else None,
        "dark": {"name": shot.dark.name, "sha256": shot.dark.sha256} if shot.dark else None,
        "pose": _plain(vars(shot.pose)),
        "saturation": means.saturation,
        "patches": [
            {
                "name": name,
                "used": False,
                "reflectance_srgb": colours[i].tolist(),
                "measured_srgb": None,
                "synthetic_srgb": None,
                "signal": y[i].tolist(),
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


def _shot_from(entry: Mapping[str, Any], n: int) -> Shot:
    """One shot of a patches document about n patches."""
    frames = {name: _means_from(entry["means"][name], name, n) for name in ("chart", "white", "dark")}
    photos = {role: _photo_from(entry[role], role) for role in ("photo", "white", "dark")}
    pose, lamp = entry["pose"], entry["lamp"]
    chart, photo = frames["chart"], photos["photo"]
    if chart is None or photo is None:
        raise ValueError("a shot has no chart photo")
    for role in ("white", "dark"):
        _need((frames[role] is None) == (photos[role] is None), role, "must be there as a photo and as means, or not")
    _need(pose["layout"] in LAYOUTS, "pose.layout", "is no layout that camssf knows")
    black, saturation = (
        _numbers(entry["black"], "black", (3,)),
        float(_numbers(entry["saturation"], "saturation", ())),
    )
    _need(bool((saturation > black).all()), "saturation", "must lie above black")
    values = _numbers(lamp["values"], "lamp.values", (WAVELENGTHS.size,))
    modes = np.asarray(lamp["modes"], float).reshape(-1, WAVELENGTHS.size)
    light = Lamp(
        _text(lamp["name"], "lamp.name"),
        values,
        float(_numbers(lamp["tolerance"], "lamp.tolerance", (), least=0.0)),
        _numbers(modes, "lamp.modes", modes.shape),
        _text(lamp["source"], "lamp.source"),
    )
    place = Pose(
        pose["layout"],
        _numbers(pose["corners"], "pose.corners", (4, 2)),
        _numbers(pose["patches"], "pose.patches", (n, 4, 2)),
        int(pose["quarter_turns"]) % 4,
        _text(pose["method"], "pose.method"),
        float(_numbers(pose["score"], "pose.score", ())),
        tuple(_text(note, "pose.notes") for note in pose["notes"]),
    )
    means = PatchMeans(chart, frames["white"], frames["dark"], black, saturation)
    return Shot(light, photo, photos["white"], photos["dark"], place, means, None)


def _table_from(plain: Mapping[str, Any]) -> ChartTable:
    """The chart table of a patches document."""
    patches = tuple(_text(name, "chart.patches") for name in plain["patches"])
    n = len(patches)
    _need(0 < n <= MOST_PATCHES, "chart.patches", f"must hold 1 to {MOST_PATCHES}")
    white = plain["white"]
    layout = _text(plain["layout"], "chart.layout")
    _need(layout in LAYOUTS, "chart.layout", "is no layout that camssf knows")
    _need(isinstance(white, int) and 0 <= white < n, "chart.white", f"must be a number from 0 to {n - 1}")
    return ChartTable(
        _text(plain["name"], "chart.name"),
        _text(plain["table"], "chart.table"),
        layout,
        patches,
        _numbers(plain["values"], "chart.values", (n, WAVELENGTHS.size), least=0.0, most=2.0),
        _numbers(plain["tolerance"], "chart.tolerance", (n,), least=0.0),
        white,
        _text(plain["source"], "chart.source"),
    )


def _means_from(plain: Mapping[str, Any] | None, name: str, n: int) -> FrameMeans | None:
    if plain is None:
        return None
    least = {"standard_error": 0.0, "count": 1.0, "clipped": 0.0, "dead": 0.0}
    fields: dict[str, Any] = {
        key: _numbers(plain[key], f"{name} {key}", (n, 2 if key == "greens" else 3), least=least.get(key, -np.inf))
        for key in FrameMeans.__annotations__
    }
    fields["count"] = fields["count"].astype(np.int64)
    return FrameMeans(**fields)


def _photo_from(plain: Mapping[str, Any] | None, role: str) -> Photo | None:
    if plain is None:
        return None
    texts = {key: _text(plain[key], f"{role}.{key}") for key in ("name", "make", "model", "sha256")}
    _need(re.fullmatch("[0-9a-f]{64}", texts["sha256"]) is not None, f"{role}.sha256", "must be 64 hex digits")
    for key in ("width", "height", "orientation"):
        _need(isinstance(plain[key], int) and plain[key] > 0, f"{role}.{key}", "must be a whole number above 0")
    exposure, iso = (
        None if plain[key] is None else float(_numbers(plain[key], f"{role}.{key}", (), least=0.0))
        for key in ("exposure", "iso")
    )
    return Photo(
        width=plain["width"],
        height=plain["height"],
        orientation=plain["orientation"],
        gain_map=bool(plain["gain_map"]),
        exposure=exposure,
        iso=iso,
        **texts,
    )


def _numbers(
    value: Any, name: str, shape: tuple[int, ...], *, least: float = -np.inf, most: float = np.inf
) -> Floats:
    array = np.asarray(value, dtype=np.float64)
    _need(array.shape == shape, name, f"has shape {array.shape}, not {shape}")
    _need(bool(np.isfinite(array).all()), name, "is not finite")
    _need(bool((array >= least).all() and (array <= most).all()), name, f"must lie between {least:g} and {most:g}")
    return array


def _text(value: Any, name: str) -> str:
    _need(isinstance(value, str) and len(value) <= 4096, name, "must be a short text")
    return str(value)


def _need(right: bool, name: str, what: str) -> None:
    if not right:
        raise InvalidArgument(f"{name} {what}.", "Correct it, or make the document anew with `camssf patches`.")


def _plain(fields: Mapping[str, Any]) -> Json:
    return {
        key: value.tolist() if isinstance(value, np.ndarray) else list(value) if isinstance(value, tuple) else value
        for key, value in fields.items()
    }


def _curves(values: Floats) -> Json:
    red, green, blue = values.T.tolist()
    return {"wavelength_nm": WAVELENGTHS.tolist(), "red": red, "green": green, "blue": blue}


def _facts(mosaic: Mosaic) -> Photo:
    height, width = mosaic.samples.shape
    return Photo(
        Path(mosaic.path).name, width, height, mosaic.orientation, mosaic.exposure, mosaic.iso, mosaic.gain_map,
        mosaic.make, mosaic.model, mosaic.sha256,
    )  # fmt: skip


def _thumbnail(mosaic: Mosaic) -> NDArray[np.uint16]:
    """Every so many cells of the mosaic as (h, w, 3) DN: cheap now, a picture when somebody asks."""
    height, width = mosaic.samples.shape
    step = 2 * max(1, -(-max(height, width) // (2 * PREVIEW)))
    rows, columns = (height - 1) // step, (width - 1) // step
    picture = np.empty((rows, columns, 3), np.uint16)
    for position in range(4):
        y, x = divmod(position, 2)  # of the two greens the lower one stays
        picture[:, :, "RGB".index(mosaic.cfa[position])] = mosaic.samples[y::step, x::step][:rows, :columns]
    return picture


def preview(mosaic: Mosaic) -> bytes | None:
    """A JPEG of a photo's active area for the report, as the sensor saw it."""
    cells = [mosaic.black[divmod(mosaic.cfa.index(colour), 2)] for colour in "RGB"]
    return _encode(_thumbnail(mosaic), np.array(cells), mosaic.white)


def _jpeg(shot: Shot) -> bytes | None:
    return None if shot.thumbnail is None else _encode(shot.thumbnail, shot.means.black, shot.means.saturation)


def _encode(thumbnail: NDArray[np.uint16], black: Floats, saturation: float) -> bytes | None:
    """A display-like picture, white-balanced on its brightest parts."""
    import cv2

    picture = np.maximum(thumbnail - black, 0.0) / (saturation - black)
    top = np.maximum(np.percentile(picture[::2, ::2], 99, axis=(0, 1)), 1e-6)
    display = (255.0 * np.clip(picture / top, 0.0, 1.0) ** (1 / 2.2) + 0.5).astype(np.uint8)
    done, data = cv2.imencode(".jpg", display[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    return bytes(data) if done else None


# --- arguments ---------------------------------------------------------------------------------------------------


def _list(name: str, value: Any) -> list[Any]:
    if isinstance(value, str | Path | Lamp):
        return [value]
    try:
        return [] if value is None else list(value)
    except TypeError as error:
        raise InvalidArgument(f"{name} is {value!r}, no list.", "Give one a shot, in the shots' order.") from error


def _frames(word: str, value: Any, k: int) -> list[PathLike | None]:
    frames = _list(word, value) or [None] * k
    if len(frames) != k:
        raise InvalidArgument(
            f"{k} photo(s) but {len(frames)} {word} frame(s).", f"Give one --{word} a photo, or none."
        )
    return frames


def _card(share: Any, framed: bool) -> float | None:
    """The white frame's reflectance, checked."""
    if share is None:
        return None
    if isinstance(share, bool) or not isinstance(share, Real) or not 0.05 <= float(share) <= 1.2:
        raise InvalidArgument(f"a white card of reflectance {share} is none.", "Write 95 % as 0.95.")
    if not framed:
        raise InvalidArgument(
            "a white card's reflectance was given, but no white frame.", "Give the white frame, or leave it out."
        )
    return float(share)


def _fit(fit: Sequence[int] | None, n: int) -> NDArray[np.bool_]:
    if fit is None:
        return np.ones(n, dtype=bool)
    numbers = _list("fit", fit)
    if not numbers or not all(isinstance(i, Integral) and 1 <= int(i) <= n for i in numbers):
        raise InvalidArgument(f"the patches of this chart are numbered 1 to {n}; got {numbers[:30]}.", "Write 7-18.")
    mask = np.zeros(n, dtype=bool)
    mask[np.array(numbers, dtype=int) - 1] = True
    return mask


def _agree(shots: Sequence[Shot]) -> None:
    """Raise unless one camera took all shots, and all or none have a white frame."""
    bodies = {(shot.photo.make, shot.photo.model) for shot in shots}
    if len(bodies) > 1:
        raise FramesDiffer(
            f"the photos come from different cameras: {', '.join(sorted(' '.join(b) for b in bodies))}.",
            "Calibrate one camera at a time; `camssf batch` takes many.",
        )
    _need(len({shot.white is None for shot in shots}) == 1, "white", "must be there for all shots or for none")


def _file(role: str, spec: Any) -> dict[str, str]:
    """SHA-256 of the file behind a lamp or chart spec, if there is one."""
    text = str(spec) if isinstance(spec, str | Path) else ""
    for name in (text, text.partition(":")[2]):
        try:
            if name and Path(name).is_file():
                return {f"{role}: {Path(name).name}": hashlib.sha256(Path(name).read_bytes()).hexdigest()}
        except (OSError, ValueError):
            continue  # whoever reads it says what is wrong
    return {}
