"""The only place where the stages meet: photos and lamps in, calibration out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camssf.curves.basis import Basis
from camssf.curves.engine import load_model
from camssf.curves.ssf import HIDDEN, Ssf, explain, predict, recover, respond
from camssf.errors import InvalidArgument, LampUnfit, NotConverged
from camssf.evidence.scores import FAINTEST, Scores, rmse, validate
from camssf.evidence.verdict import MOST_RIVALLED, RIVALS, Neutral, Rival, Verdict, Weighed, judge, refusal, surprise
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.capture import (
    Begun,
    Capture,
    Json,
    PathLike,
    Progress,
    Shot,
    evidence,
    head_document,
    listed,
    measure,
    shot_picture,
)
from camssf.photo.signals import Assumption, Signals, normalise
from camssf.rules import rules
from camssf.spectra import CameraCurves, ChartTable, Lamp, read_camera, read_lamp

FOLDS = rules().whole("calibration.folds")
"""All patches enter the fit; each is predicted by a fit that left its quarter of the chart out."""
WHITE_TOLERANCE = rules().number("calibration.white_tolerance")


@dataclass(frozen=True)
class Calibration:
    """Everything one calibration found.

    Attributes:
        capture: what was measured.
        signals: Eq. (5).
        ssf: the curves.
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
        """A JPEG of each shot's active area, for the report."""
        return tuple(shot_picture(shot) for shot in self.capture.shots)

    def document(self) -> Json:
        """The result as plain data, "camssf-result/1" (data/result.schema.json)."""
        curves, std = self.ssf.peak()
        capture = self.capture
        begun = Begun(list(capture.shots), capture.chart, capture.chart.name, files=capture.files)
        document = head_document(begun, self.verdict, self.assumptions) | {
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
                for name, band in (("predicted_std", self.predicted_std), ("unseen_std", self.unseen_std)):
                    known = band is not None and np.isfinite(band[j, i]).all()
                    patch[name] = band[j, i].tolist() if band is not None and known else None
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
    lens_shading: str = "as-stored",
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
        lens_shading: "as-stored", or "apply" for the gain maps in the photos' files (`photo.patches`, rule 6).
        basis, nonnegative, l2, gamma, engine: as in `recover`.
        fit: 1-based numbers of the patches that enter the fit; None for all, validated fold by fold.
        truth: measured curves of this camera (CSV or name), to compare with.
        progress: called with a stage in words and the part done, 0 to 1.

    Raises:
        CalibrationError: refused; `evidence` on it is a result document without curves.
    """
    capture = measure(
        photos, lamps, white=white, dark=dark, chart=chart, corners=corners, white_reflectance=white_reflectance,
        lamp_tolerance=lamp_tolerance, lens_shading=lens_shading, progress=progress,
    )  # fmt: skip
    return solve(
        capture, basis=basis, fit=fit, nonnegative=nonnegative, l2=l2, gamma=gamma, engine=engine, truth=truth,
        progress=progress,
    )  # fmt: skip


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
    begun = Begun(list(capture.shots), capture.chart, capture.chart.name, files=capture.files)
    with evidence(begun):
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

        def bands(used: NDArray[np.bool_], answer: Ssf) -> Floats | None:
            return _bands(capture, signals, used, answer, basis)

        predicted_std = bands(signals.used, ssf)
        unseen, unseen_std, how = _unseen(signals, ssf, predicted_std, asked, solution, bands, capture)
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
        uncertainty, alone = None, []
        if ssf.std is not None:
            single = np.eye(k, dtype=bool)[:, :, None] if k > 1 else np.zeros((0, 1, 1), dtype=bool)
            alone = [solution(signals.used & shot, gamma) for shot in single]
            uncertainty = _uncertainty(capture, signals, ssf, basis, alone)
        means, poses = [shot.means for shot in capture.shots], [shot.pose for shot in capture.shots]
        rho, white_tolerance = white_reference(capture)
        verdict = judge(
            Weighed(signals, table, means, poses, lamps, rho, white_tolerance),
            ssf,
            neutrals=[
                [Neutral(read_lamp(light).values, np.array(white)) for light, white in shot.photo.neutrals]
                for shot in capture.shots
            ],
            alone=alone,
            rivals=_rivals(
                capture,
                signals,
                ssf,
                lambda other: _recover(other, signals, signals.used, basis, nonnegative, l2, gamma, engine),
            ),
        )
        if verdict.status == "refused":
            raise refusal(verdict)
    assumptions = signals.assumptions + _assumptions(capture, ssf, k)
    return Calibration(
        capture, signals, ssf, predicted_std, unseen, unseen_std, scores, verdict, known, assumptions, uncertainty
    )  # fmt: skip


def _rivals(capture: Capture, signals: Signals, ssf: Ssf, solution: Callable[[Capture], Ssf]) -> tuple[Rival, ...]:
    """How well the same signals fit with other lamps, one shot at a time: rule 4 of `camssf.evidence.verdict`."""
    if ssf.std is None or len(capture.shots) > MOST_RIVALLED:
        return ()
    rho, tolerance = white_reference(capture)
    found = []
    for j, shot in enumerate(capture.shots):
        for name in RIVALS:
            shots = (*capture.shots[:j], replace(shot, lamp=read_lamp(name)), *capture.shots[j + 1 :])
            other = replace(capture, shots=shots)
            try:
                answer = solution(other)
            except (LampUnfit, NotConverged):  # then it is no rival
                continue
            lamps = [each.lamp for each in shots]
            fit = surprise(signals, capture.chart, lamps, answer, rho, tolerance)
            found.append(Rival(j, name, fit.weighted))
    return tuple(found)


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
    predicted = respond(ssf.values, capture.chart.values, ssf.lamp, arguments["white_reflectance"])
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


def _bands(
    capture: Capture, signals: Signals, used: NDArray[np.bool_], ssf: Ssf, basis: str | Basis
) -> Floats | None:
    """(k, n, 3) how far every patch's true signal may lie from what a fit to the used ones predicts."""
    if ssf.std is None:
        return None
    table, taken = capture.chart, used.any(axis=0)
    given = _arguments(capture, signals, used, basis)
    found = predict(ssf, **given, of=table.values[~taken], of_tolerance=table.tolerance[~taken]).std
    std = np.empty_like(signals.values)
    std[:, taken], std[:, ~taken] = found[:, : taken.sum()], found[:, taken.sum() :]
    return std


def _unseen(
    signals: Signals,
    ssf: Ssf,
    predicted_std: Floats | None,
    asked: NDArray[np.bool_],
    solution: Callable[[NDArray[np.bool_], ArrayLike | None], Ssf],
    bands: Callable[[NDArray[np.bool_], Ssf], Floats | None],
    capture: Capture,
) -> tuple[Floats, Floats | None, str]:
    """Predictions of fits that had not seen the patch, their bands, and how that was done in words."""
    rest = ~asked
    if capture.shots[0].means.white is None:
        rest = rest & (np.arange(asked.size) != capture.chart.white)  # its signal is 1 whatever the curves
    if rest.any():
        names = f"{int(rest.sum())} patches that did not enter the fit"
        out = rest[None, :, None]
        std = None if predicted_std is None else np.where(out, predicted_std, np.nan)
        return np.where(out, ssf.predicted, np.nan), std, names
    taken = np.flatnonzero(signals.used.any(axis=0))
    unseen = np.full(ssf.predicted.shape, np.nan)
    std = None if predicted_std is None else unseen.copy()
    for fold in range(FOLDS):
        out = np.zeros(asked.size, dtype=bool)
        out[taken[fold::FOLDS]] = True
        answer = solution(signals.used & ~out, ssf.gamma)
        unseen[:, out] = answer.predicted[:, out]
        band = bands(signals.used & ~out, answer)
        if std is not None and band is not None:
            std[:, out] = band[:, out]
    unseen[~signals.used] = np.nan
    return unseen, std, f"each of {taken.size} patches, by a fit that left its quarter of the chart out"


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
            found.append(Assumption("lens_shading", where + _shading(shot)))
    if capture.shots[0].means.white is not None and capture.white_reflectance is None:
        found.append(Assumption("white_reference", "the white frame shows a perfect diffuser (reflectance 1)."))
    if paper:
        found.append(Assumption("no_band", "the paper's basis has no prior, so this answer carries no error band."))
    return tuple(found)


def _shading(shot: Shot) -> str:
    """What became of the lens-shading map in a shot's file, in words."""
    map_of = f"{shot.photo.name} holds a lens-shading map;"
    if shot.lens_shading == "apply":
        return f"{map_of} it was applied to the patches' signals" + (
            " of every frame, so that it cancels against the white frame." if shot.white else "."
        )
    rest = ", the white frame corrects the shading." if shot.white else " and no white frame corrects it."
    return f"{map_of} it was not applied{rest}"


def _curves(values: Floats) -> Json:
    red, green, blue = values.T.tolist()
    return {"wavelength_nm": WAVELENGTHS.tolist(), "red": red, "green": green, "blue": blue}


def _fit(fit: Sequence[int] | None, n: int) -> NDArray[np.bool_]:
    if fit is None:
        return np.ones(n, dtype=bool)
    numbers = listed("fit", fit)
    if not numbers or not all(isinstance(i, Integral) and 1 <= int(i) <= n for i in numbers):
        raise InvalidArgument(f"the patches of this chart are numbered 1 to {n}; got {numbers[:30]}.", "Write 7-18.")
    mask = np.zeros(n, dtype=bool)
    mask[np.array(numbers, dtype=int) - 1] = True
    return mask
