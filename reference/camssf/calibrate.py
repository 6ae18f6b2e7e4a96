"""The only place where the stages meet: photos and lamps in, calibration out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
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
from camssf.spectra import CameraCurves, ChartTable, Lamp, read_camera, read_chart, read_lamp
from camssf.ssf import Ssf, recover
from camssf.validate import Scores, validate
from camssf.verdict import Reason, Verdict, judge

FOLDS = 4
"""All patches enter the fit; each is predicted by a fit that left its quarter of the chart out."""
HIDDEN = 1e3
"""Standard error of a signal that is used in another shot but not in this one: it then weighs nothing."""
WHITE_TOLERANCE = 0.01
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


@dataclass(frozen=True)
class Capture:
    """k measured shots of one chart with one camera: what `solve` needs.

    Attributes:
        shots: k of them.
        chart: the chart's table.
        white_reflectance: of the white frame's card, one number; None for a perfect diffuser.
    """

    shots: tuple[Shot, ...]
    chart: ChartTable
    white_reflectance: float | None

    def document(self) -> Json:
        """The capture as plain data, "camssf-patches/1"; lamps and chart travel as their names."""
        return {
            "format": "camssf-patches/1",
            "generator": {"name": "camssf", "version": __version__},
            "chart": self.chart.name,
            "white_reflectance": self.white_reflectance,
            "patches": list(self.chart.patches),
            "shots": [
                {
                    "lamp": shot.lamp.name,
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
            share = document["white_reflectance"]
            return Capture(
                tuple(_shot_from(entry) for entry in document["shots"]),
                read_chart(document["chart"]),
                None if share is None else float(share),
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InvalidArgument(
                f"the camssf-patches/1 document has no proper {error}.", "Make it anew with `camssf patches`."
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
    """

    capture: Capture
    signals: Signals
    ssf: Ssf
    unseen: Floats
    scores: Scores
    verdict: Verdict
    truth: CameraCurves | None
    assumptions: tuple[Assumption, ...]

    @property
    def previews(self) -> tuple[bytes | None, ...]:
        """A JPEG of each shot's active area, for the report."""
        return tuple(_jpeg(shot) for shot in self.capture.shots)

    def document(self) -> Json:
        """The result as plain data, "camssf-result/1" (data/result.schema.json)."""
        curves, std = self.ssf.peak()
        document = _head(self.capture, self.verdict, self.assumptions) | {
            "basis": self.ssf.basis,
            "engine": self.ssf.engine,
            "ssf": _curves(curves),
            "ssf_std": None if std is None else _curves(std),
            "channel_gain": self.ssf.channel_gain.tolist(),
            "gap": self.ssf.gap.tolist(),
            "gamma": self.ssf.gamma.tolist(),
            "l2": self.ssf.l2,
            "scores": {
                "rmsre_percent": self.scores.rmsre_percent.tolist(),
                "rmse": None if self.scores.rmse is None else self.scores.rmse.tolist(),
                "delta_e00": float(self.scores.delta_e00),
                "unseen": self.scores.unseen,
            },
        }
        if self.truth is not None:
            document["truth"] = {
                "name": self.truth.name,
                "ssf": _curves(self.truth.values / self.truth.values.max(axis=0)),
            }
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


def calibrate(
    photos: PathLike | Sequence[PathLike],
    lamps: str | Lamp | Sequence[str | Lamp],
    *,
    white: PathLike | Sequence[PathLike | None] | None = None,
    dark: PathLike | Sequence[PathLike | None] | None = None,
    chart: str | ChartTable = "classic24",
    corners: Sequence[ArrayLike | None] | None = None,
    white_reflectance: float | None = None,
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
        basis, nonnegative, l2, gamma, engine: as in `recover`.
        fit: 1-based numbers of the patches that enter the fit; None for all, validated fold by fold.
        truth: measured curves of this camera (CSV or name), to compare with.
        progress: called with a stage in words and the part done, 0 to 1.

    Raises:
        CalibrationError: refused; `evidence` on it is a result document without curves.
    """
    capture = measure(
        photos, lamps, white=white, dark=dark, chart=chart, corners=corners, white_reflectance=white_reflectance,
        progress=progress,
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
    progress: Progress | None = None,
) -> Capture:
    """Read the photos, find the chart and measure its patches; arguments as in `calibrate`."""
    tell = progress or (lambda stage, part: None)
    files = _list(photos)
    if not files:
        raise InvalidArgument("there is no photo.", "Give the DNG of at least one photo of the chart.")
    names = _list(lamps)
    k = len(files)
    if len(names) != k:
        read_lamp("") if not names else None  # explains why a lamp must be named
        raise InvalidArgument(
            f"{k} photo(s) but {len(names)} lamp(s).", "Give one --lamp a photo, in the same order."
        )
    whites, darks = _frames("white", white, k), _frames("dark", dark, k)
    places = list(corners) if corners else [None] * k
    if len(places) != k:
        raise InvalidArgument(f"{k} photo(s) but {len(places)} set(s) of corners.", "Give one set a photo.")
    if white_reflectance is not None and not 0.05 <= white_reflectance <= 1.2:
        raise InvalidArgument(f"a white card of reflectance {white_reflectance} is none.", "Write 95 % as 0.95.")
    if len({w is None for w in whites}) > 1:
        raise InvalidArgument(
            "some shots have a white frame and some have none.", "Give a white frame for all shots, or for none."
        )
    lights = [lamp if isinstance(lamp, Lamp) else read_lamp(lamp) for lamp in names]
    table = chart if isinstance(chart, ChartTable) else read_chart(chart)
    shots: list[Shot] = []
    with _evidence(lambda: Capture(tuple(shots), table, white_reflectance)):
        for j in range(k):
            at = f" {j + 1} of {k}" if k > 1 else ""
            tell(f"reading photo{at}", j / k)
            photo = read_dng(files[j])
            tell(f"looking for the chart{at}", (j + 0.4) / k)
            pose = find_chart(photo, table, corners=places[j])
            tell(f"measuring the patches{at}", (j + 0.7) / k)
            white_file, dark_file = whites[j], darks[j]
            white_frame = None if white_file is None else read_dng(white_file)
            dark_frame = None if dark_file is None else read_dng(dark_file)
            means = measure_patches(photo, pose, white=white_frame, dark=dark_frame)
            shots.append(
                Shot(
                    lights[j],
                    _facts(photo),
                    _facts(white_frame) if white_frame else None,
                    _facts(dark_frame) if dark_frame else None,
                    pose,
                    means,
                    _thumbnail(photo),
                )
            )
        bodies = {(shot.photo.make, shot.photo.model) for shot in shots}
        if len(bodies) > 1:
            raise FramesDiffer(
                f"the photos come from different cameras: {', '.join(sorted(' '.join(b) for b in bodies))}.",
                "Calibrate one camera at a time; `camssf batch` takes many.",
            )
    return Capture(tuple(shots), table, white_reflectance)


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
    asked = _numbers(fit, len(table.patches))
    with _evidence(lambda: capture):
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
        mask: NDArray[np.bool_] = np.all(np.isfinite(unseen), axis=2)
        scores = validate(
            signals,
            np.where(mask[:, :, None], unseen, ssf.predicted),
            table,
            [shot.lamp for shot in capture.shots],
            ssf.values,
            known,
            mask,
            how,
        )
        verdict = judge(signals, table, [s.means for s in capture.shots], [s.pose for s in capture.shots], ssf)
    assumptions = signals.assumptions + _assumptions(capture, ssf, k)
    return Calibration(capture, signals, ssf, unseen, scores, verdict, known, assumptions)


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
    table = capture.chart
    taken = used.any(axis=0)
    error = np.where(used[:, :, None], signals.standard_error, HIDDEN)[:, taken]
    paper = basis == "gaussian" or (isinstance(basis, Basis) and not basis.prior)
    rho, white_tolerance = white_reference(capture)
    lamps = np.stack([shot.lamp.values for shot in capture.shots])
    ssf = recover(
        signals.values[:, taken],
        table.values[taken],
        lamps,
        standard_error=error,
        chart_tolerance=0.0 if paper else table.tolerance[taken],  # the paper knows of no error in the chart
        white_reflectance=rho,
        white_tolerance=white_tolerance,
        lamp_tolerance=[shot.lamp.tolerance for shot in capture.shots],
        lamp_modes=_modes(capture),
        basis=basis,
        l2=l2,
        gamma=gamma,
        nonnegative=nonnegative,
        frames=(signals.chart[:, taken], signals.white[:, taken], signals.dark[:, taken]),
        engine=engine,
    )
    predicted = ((lamps[:, None] * table.values) @ ssf.values) / ((lamps * rho) @ ssf.values)[:, None]
    return replace(ssf, predicted=predicted)


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
                f"{shot.lamp.tolerance:.1%}.",
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
def _evidence(so_far: Callable[[], Capture]) -> Iterator[None]:
    """Attach a refused result document, with what was learned until then, to a refusal on its way out."""
    try:
        yield
    except CalibrationError as error:
        if error.evidence is None and not isinstance(error, InvalidArgument):
            reason = Reason(error.code, error.message, error.advice, error.value, error.threshold)
            capture = so_far()
            document = _head(capture, Verdict("refused", (reason,)), ())
            error.evidence = document | {"basis": "none", "engine": "reference"}
            error.previews = tuple(_jpeg(shot) for shot in capture.shots)
        raise


def _head(capture: Capture, verdict: Verdict, assumptions: tuple[Assumption, ...]) -> Json:
    """The part of a result document that needs no curves."""
    table = capture.chart
    first = capture.shots[0].photo if capture.shots else None
    inputs = {}
    for shot in capture.shots:
        for photo in (shot.photo, shot.white, shot.dark):
            if photo is not None:
                inputs[photo.name] = photo.sha256
    return {
        "format": "camssf-result/1",
        "generator": {"name": "camssf", "version": __version__},
        "camera": {"make": first.make if first else "", "model": first.model if first else ""},
        "chart": {"name": table.name, "table": table.table, "layout": table.layout, "source": table.source},
        "shots": [_shot_document(shot, capture) for shot in capture.shots],
        "verdict": {"status": verdict.status, "reasons": [vars(reason) for reason in verdict.reasons]},
        "assumptions": [vars(assumption) for assumption in assumptions],
        "hashes": {"inputs": inputs, "model": None},
    }


def _shot_document(shot: Shot, capture: Capture) -> Json:
    """One shot without predictions; signals where they can be formed."""
    from camssf.validate import reflectance_srgb

    table = capture.chart
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
        "photo": {
            "name": shot.photo.name,
            "width": shot.photo.width,
            "height": shot.photo.height,
            "orientation": shot.photo.orientation,
            "exposure": shot.photo.exposure,
            "iso": shot.photo.iso,
            "gain_map": shot.photo.gain_map,
            "sha256": shot.photo.sha256,
            "camera": " ".join(filter(None, (shot.photo.make, shot.photo.model))),
        },
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


def _shot_from(entry: Mapping[str, Any]) -> Shot:
    """One shot of a patches document."""

    def frame(name: str) -> FrameMeans | None:
        plain = entry["means"][name]
        if plain is None:
            return None
        fields: dict[str, Any] = {key: np.array(plain[key], dtype=np.float64) for key in FrameMeans.__annotations__}
        if not all(np.isfinite(array).all() and array.ndim == 2 for array in fields.values()):
            raise ValueError(f"means of the {name} frame")
        fields["count"] = fields["count"].astype(np.int64)
        return FrameMeans(**fields)

    def photo(name: str) -> Photo | None:
        plain = entry[name]
        return None if plain is None else Photo(**{key: plain[key] for key in Photo.__annotations__})

    first, chart = photo("photo"), frame("chart")
    if first is None or chart is None:
        raise ValueError("chart photo")
    pose = entry["pose"]
    if pose["layout"] not in LAYOUTS:
        raise ValueError("pose layout")
    return Shot(
        read_lamp(entry["lamp"]),
        first,
        photo("white"),
        photo("dark"),
        Pose(
            pose["layout"],
            np.array(pose["corners"], float).reshape(4, 2),
            np.array(pose["patches"], float).reshape(-1, 4, 2),
            int(pose["quarter_turns"]),
            str(pose["method"]),
            float(pose["score"]),
            tuple(map(str, pose["notes"])),
        ),
        PatchMeans(
            chart,
            frame("white"),
            frame("dark"),
            np.array(entry["black"], float).reshape(3),
            float(entry["saturation"]),
        ),
        None,
    )


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


def _list(value: Any) -> list[Any]:
    return [value] if isinstance(value, (str, Path, Lamp)) else [] if value is None else list(value)


def _frames(word: str, value: PathLike | Sequence[PathLike | None] | None, k: int) -> list[PathLike | None]:
    frames = _list(value) or [None] * k
    if len(frames) != k:
        raise InvalidArgument(
            f"{k} photo(s) but {len(frames)} {word} frame(s).", f"Give one --{word} a photo, or none."
        )
    return frames


def _numbers(fit: Sequence[int] | None, n: int) -> NDArray[np.bool_]:
    if fit is None:
        return np.ones(n, dtype=bool)
    numbers = list(fit)
    if not numbers or not all(isinstance(i, int) and 1 <= i <= n for i in numbers):
        raise InvalidArgument(f"the patches of this chart are numbered 1 to {n}; got {numbers}.", "Write 7-18.")
    mask = np.zeros(n, dtype=bool)
    mask[np.array(numbers) - 1] = True
    return mask
