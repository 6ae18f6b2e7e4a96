"""Compares a result from elsewhere with Python's own on the same photos: which stage differs first, and by how much.

Each stage runs on the outputs of our own earlier stages, except that the pose is the other side's. So the first
difference shows the stage that causes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from camssf.calibration import attempt, attempted, solve
from camssf.compare.differences import Finding, differences
from camssf.documents.document import shareable
from camssf.documents.forms import to_plain
from camssf.errors import CalibrationError, InvalidArgument
from camssf.options import DEFAULTS, Options
from camssf.photo.capture import CHART_TABLE, Capture, MeasuredShot, Photo, input_hash, photo_of, spec_file
from camssf.photo.find.pose import chart_area, find_chart
from camssf.photo.patches import measure_patches
from camssf.photo.read.dng import Mosaic
from camssf.photo.read.raw import read_raw
from camssf.photo.read.unit import photo_hash
from camssf.photo.shot import PathLike, Shot
from camssf.progress import Progress, part_of
from camssf.recovery.hypotheses import AUTO
from camssf.result import Result
from camssf.spectra import (
    Called,
    CameraCurves,
    ChartTable,
    Light,
    Unnamed,
    read_chart,
    read_lamp,
    read_light,
    with_tolerance,
)

Json: TypeAlias = dict[str, Any]
Frames: TypeAlias = Mapping[str, Sequence[PathLike | None]]
"""The files of each role, "photo", "white" and "dark", one per shot."""

STAGES = (
    "file", "photo", "pose", "patch means", "inputs", "curve", "band", "gap", "scores", "verdict",
)  # fmt: skip
"""In the order of processing."""
SOLVED = ("curve", "band", "gap", "scores")
"""Stages that a refused result does not have."""
POSE = 0.02
"""Bound in parts of the patch pitch; repeating the refinement moves a pose by less."""
AGREEMENT = 0.01
"""Bound for a pose's score, which changes with the refinement."""
UNREPEATED = tuple(
    f"/verdict/reasons/{field}" for field in ("message", "advice", "value", "threshold", "key", "arguments")
)
"""What is said of a chart that was not found depends on the corners that the search started from, which a refused
result does not hold."""

_EQUAL = {
    "file": "SHA-256 of the photos and frames",
    "photo": "size, orientation, exposure, ISO, white level",
    "inputs": "table, lamps, basis, model, patches used",
}
_CAUSES = {
    "file": "These are not the photos that the result was made from. Give the same files.",
    "photo": "The two readers understand the file's tags differently (sizes, levels, exposure).",
    "pose": "The chart lies elsewhere, or another way up. Look at the corners in the report.",
    "patch means": "The two read other samples, or measure other ones: the DNG reader, black level, active area, CFA "
    "order, lens shading, or the rule of camssf/photo/patches.py.",
    "inputs": "The rule for usable patches, or another chart table, lamp, basis or model: compare the versions of "
    "camssf on both sides.",
    "curve": "The inputs agree, the solution does not: the ONNX model, its runtime, or another lamp or "
    "penalty than the result states. "
    "If the result was made of some patches only (fit), with signed coefficients, with light_per_patch or with "
    "white_reflectance, say so here too.",
    "band": "The curve agrees, its standard deviation, the codes' covariance, the evidence, the budget or how "
    "far the truth may lie from a prediction does not.",
    "gap": "One of the two has not converged, or its layers have not.",
    "scores": "The curves agree, the validation does not: the folds, or the patches that it takes.",
    "verdict": "All numbers agree, the conclusion does not: compare the versions of camssf on both sides; say here "
    "on which basis a refused result was made, if not on auto.",
}


def parity(
    result: Result,
    photos: PathLike | Sequence[PathLike],
    *,
    white: Sequence[PathLike | None] = (),
    dark: Sequence[PathLike | None] = (),
    lamps: Sequence[str] = (),
    chart: str | None = None,
    options: Options = DEFAULTS,
    progress: Progress | None = None,
) -> tuple[Finding, ...]:
    """Compare every field of a result with Python's own result on the same photos.

    A missing field is a difference, unless another release of camssf wrote the result.

    Pose, lamp, chart, tolerances, basis and penalties are taken from the result. What it does not hold must be
    given again: files of lamps and charts, the white target, the patches to fit, signed coefficients, uneven light,
    and, of a refusal, basis and penalties.

    Args:
        result: from elsewhere.
        photos: DNG of each shot, in the shots' order.
        white, dark: the frames that the result lists as used.
        lamps, chart: replace the result's, if those are files at another path here.
        options: of the calibration; basis, l2 and gamma count for a refusal alone.
        progress: called with the stage in words and the part done, 0 to 1.

    Returns:
        A finding for each stage that could be compared, in order.

    Raises:
        InvalidArgument: photos or frames do not match the result in number, or a lamp or chart is unknown.
        RawError: a file cannot be read.
    """
    if any(assumption.code == "previous_result" for assumption in result.assumptions):
        raise InvalidArgument(
            "This result holds the shots of a previous one, which are not measured again.",
            "Compare the result of the new photos alone, and the previous one by itself.",
        )
    capture, tell = result.capture, part_of(progress, 0.0, 1.0)
    if capture is None:
        raise InvalidArgument("This result was refused before a photo was read.", "There is nothing to compare.")
    files = [photos] if isinstance(photos, str | Path) else list(photos)
    frames = {"photo": files} | {
        role: _frames(capture, files, role, paths) for role, paths in (("white", white), ("dark", dark))
    }
    if lamps and len(lamps) != len(capture.lights):
        raise InvalidArgument(
            f"{len(lamps)} lamps for {len(capture.lights)} shots.", "Give one lamp a photo, or none."
        )
    specs = list(lamps) or [light.name for light in capture.lights]
    lights = [_light(spec, stated) for spec, stated in zip(specs, capture.lights, strict=True)]
    table = read_chart(chart or capture.chart.name)
    stated = to_plain(shareable(result))
    findings = _findings(_of_shots(stated, _hashes(capture, frames)), ("file",))
    if first(findings):
        tell("compared", 1.0)
        return tuple(findings)
    tell("reading photos", 0.0)
    mosaics = [read_raw(path) for path in files]
    ours = [replace(photo_of(mosaic), unit=replace(mosaic.unit, serial="")) for mosaic in mosaics]
    facts: list[Json] = [{"photo": to_plain(photo)} for photo in ours]
    for shot, mosaic in zip(facts[: len(capture.shots)], mosaics, strict=False):
        shot["means"] = {"saturation": mosaic.white}
    findings += _findings(_of_shots(stated, facts), ("photo",))
    # The names of lamp and chart files may differ; their SHA-256 are compared.
    skip: tuple[str, ...] = ("/capture/shots/lamp/source",) if any(spec_file("lamp", spec) for spec in specs) else ()
    skip += ("/capture/chart/name", "/capture/chart/source") if chart and spec_file(CHART_TABLE, chart) else ()
    if capture.unfinished is not None or not capture.shots:
        tell("calibrating", 0.5)
        shots = [Shot(*row) for row in zip(files, lights, frames["white"], frames["dark"], strict=True)]
        made = to_plain(shareable(attempt(shots, chart=table, options=options)))
        _rename(made, capture, frames)
        sought = any(reason.code == "chart_not_found" for reason in result.verdict.reasons)
        skip += ("/capture", *(UNREPEATED if sought else ()))
        tell("compared", 1.0)
        return _joined(findings, stated, made, skip, ("verdict",))
    tell("looking at the pose", 0.3)
    findings.append(_pose(capture.shots, mosaics, table))
    tell("measuring", 0.5)
    try:
        rows = zip(capture.shots, lights, mosaics, frames["white"], frames["dark"], strict=True)
        measured = tuple(_measure(*row) for row in rows)
    except CalibrationError as error:
        words = f"here the measurement is refused: {error.code}, {error.message}"
        tell("compared", 1.0)
        return (*findings, Finding("patch means", False, np.inf, 0.0, words))
    hashes = input_hash(CHART_TABLE, chart or capture.chart.name)
    for j, spec in enumerate(specs, 1):
        hashes |= input_hash(f"shot {j}, lamp", spec)
    again = Capture(measured, table, options.white_reflectance, hashes)
    tell("solving", 0.7)
    answer, settings = result.answer, options
    if answer is not None:
        # A basis chosen by evidence must be chosen again here, with the same probabilities; where only the light's
        # kind was chosen there is one.
        basis = AUTO if len({hypothesis.basis for hypothesis in answer.choice}) > 1 else answer.basis
        settings = replace(options, basis=basis, l2=answer.l2, gamma=answer.gamma.tolist())
    solved = attempted(lambda: solve(again, options=settings))
    if result.truth is not None:
        solved = solved.with_truth(CameraCurves(result.truth.name, result.truth.curves.values, "the result"))
    tell("compared", 1.0)
    both = answer is not None and solved.answer is not None
    stages = [stage for stage in STAGES[3:] if both or stage not in SOLVED]
    return _joined(findings, stated, to_plain(shareable(solved)), skip, stages)


def first(findings: Sequence[Finding]) -> Finding | None:
    """The first stage that differs; None if all agree."""
    return next((finding for finding in findings if not finding.agrees), None)


def cause(finding: Finding) -> str:
    """The usual cause of such a difference, and what to check."""
    return _CAUSES[finding.stage]


def _findings(fields: Iterable[Finding], stages: Sequence[str]) -> list[Finding]:
    """A finding for each of the stages, and for each other one that differs."""
    findings, every = [], list(fields)
    for stage in STAGES:
        own = [difference for difference in every if difference.stage == stage]
        worst = max(own, key=lambda each: each.measured / (each.bound or 1.0), default=None)
        if worst is not None and not worst.agrees:
            alike = [difference.words for difference in own if difference.measured == worst.measured]
            findings.append(replace(worst, words="; ".join(alike[:3])))
        elif stage in stages:
            worst = worst or Finding(stage, True, 0.0, 0.0, "equal to the bit")
            findings.append(replace(worst, words=_EQUAL.get(stage, worst.words)))
    return findings


def _joined(
    findings: Sequence[Finding], document: Json, made: Json, skip: tuple[str, ...], stages: Sequence[str]
) -> tuple[Finding, ...]:
    """The findings so far, and those of each field of both documents."""
    by_stage = {finding.stage: finding for finding in findings}
    for finding in _findings(differences(document, made, skip=skip), stages):
        if finding.stage == "verdict" and finding.agrees:
            codes = (
                ", ".join(sorted({reason["code"] for reason in made["verdict"].get("reasons", ())})) or "no reasons"
            )
            shown = f"{made['verdict']['status']} ({codes})"
            finding = replace(finding, words=f"{shown} there, {shown} here")
        if finding.stage not in by_stage or by_stage[finding.stage].agrees:
            by_stage[finding.stage] = finding
    return tuple(by_stage[stage] for stage in STAGES if stage in by_stage)


def _of_shots(stated: Json, shots: list[Json]) -> Iterable[Finding]:
    """The differences of those fields of the shots that are given here."""
    theirs = [*stated["capture"]["shots"], stated["capture"].get("unfinished")]
    return differences({"capture": {"shots": theirs[: len(shots)]}}, {"capture": {"shots": shots}}, part=True)


def _rename(made: Json, capture: Capture, frames: Frames) -> None:
    """Replace our file paths in the messages and their arguments by the other side's file names."""
    for reason in made["verdict"].get("reasons", ()):
        words = reason.get("arguments", {})
        for role, paths in frames.items():
            for j, path in enumerate(paths):
                if path is not None:
                    frame = _frame(capture, j, role)
                    name = frame.name if frame is not None else Path(path).name
                    reason["message"] = reason["message"].replace(str(path), name)
                    texts = {key: text for key, text in words.items() if isinstance(text, str)}
                    words |= {key: text.replace(str(path), name) for key, text in texts.items()}


def _frame(capture: Capture, j: int, role: str) -> Photo | None:
    """The photo or frame of shot j (from 0); None if there is none."""
    if j < len(capture.shots):
        frame: Photo | None = getattr(capture.shots[j], role)
        return frame
    return capture.photos[j] if role == "photo" else None


def _frames(
    capture: Capture, files: Sequence[PathLike], role: str, paths: Sequence[PathLike | None]
) -> list[PathLike | None]:
    """The frames' files, one per shot; a frame must be given exactly where the result names one."""
    count = len(capture.photos)
    if len(files) != count:
        raise InvalidArgument(
            f"{len(files)} photo(s) for a result of {count} shot(s).", "Give the photos in the shots' order."
        )
    frames = list(paths) or [None] * count
    if len(frames) != count:
        raise InvalidArgument(f"{len(frames)} {role} frames for {count} shots.", "Give one a photo, or none.")
    for number, (shot, path) in enumerate(zip(capture.shots, frames, strict=False), 1):
        frame = getattr(shot, role)
        if (frame is None) != (path is None):
            used = f"used the {role} frame {frame.name}" if frame else f"used no {role} frame"
            raise InvalidArgument(f"Shot {number} of the result {used}.", f"Give just that by --{role}.")
    return frames


def _light(spec: str, stated: Light) -> Light:
    """The lamp of that name or file with the tolerances that the result states, or an unnamed light."""
    lamp = read_light(spec)
    if isinstance(stated, Called | Unnamed) or isinstance(lamp, Unnamed):
        return lamp
    if isinstance(lamp, Called):  # a tolerance was given by hand
        lamp = read_lamp(lamp.name)
    if stated.tolerance_kelvin is not None:
        lamp = with_tolerance(lamp, f"{stated.tolerance_kelvin!r}K")
    return replace(lamp, name=stated.name, tolerance=stated.tolerance)


def _hashes(capture: Capture, frames: Frames) -> list[Json]:
    """SHA-256 of each shot's files, as a result holds them; without frames that the result does not name."""
    shots: list[Json] = [{} for _ in capture.photos]
    for role, paths in frames.items():
        for j, (shot, path) in enumerate(zip(shots, paths, strict=True)):
            try:
                if path is not None and _frame(capture, j, role) is not None:
                    shot |= {role: {"sha256": photo_hash(path)}}
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or error
                raise InvalidArgument(f"{path} cannot be read: {reason}.", "Check the path.") from error
    return shots


def _pose(shots: Sequence[MeasuredShot], photos: Sequence[Mosaic], table: ChartTable) -> Finding:
    """Check that refining the other side's corners here leaves the pose in place and in the same orientation."""
    worst, words = 0.0, "the corners refine to themselves, the same way up"
    for number, (shot, photo) in enumerate(zip(shots, photos, strict=True), 1):
        stated = shot.pose
        try:
            pose = find_chart(photo, table, corners=stated.corners)
        except CalibrationError as error:
            return Finding("pose", False, np.inf, POSE, f"shot {number}: here it is {error.code}, {error.message}")
        if stated.patches.shape != pose.patches.shape or pose.quarter_turns != stated.quarter_turns:
            turns = f"{90 * stated.quarter_turns}° there, {90 * pose.quarter_turns}° here"
            count = len(stated.patches)
            return Finding("pose", False, np.inf, POSE, f"shot {number}: {count} patches, turned by {turns}")
        change = abs(pose.score - stated.score)
        if change > AGREEMENT:
            words = f"shot {number}: score {stated.score:.3f} there, {pose.score:.3f} here"
            return Finding("pose", False, change, AGREEMENT, words)
        middle = pose.patches.mean(axis=1)
        apart = np.linalg.norm(stated.patches - pose.patches, axis=2)
        moved = max(float(apart.max()), float(np.abs(pose.corners - stated.corners).max()))
        moved /= float(np.linalg.norm(middle[1] - middle[0]))
        if moved >= worst:
            patch, worst = int(apart.max(axis=1).argmax()) + 1, moved
            words = f"shot {number}: patch {patch} lies {apart.max():.3g} px from where it is found here"
    return Finding("pose", worst <= POSE, worst, POSE, f"{words} (in pitches)")


def _measure(stated: MeasuredShot, lamp: Light, photo: Mosaic, *paths: PathLike | None) -> MeasuredShot:
    """Measure a shot with its white and dark frame here, with the other side's pose."""
    pose = stated.pose
    white, dark = (None if path is None else read_raw(path, chart_area(pose.corners)) for path in paths)
    means = measure_patches(photo, pose, white=white, dark=dark, lens_shading=stated.lens_shading)
    of_white, of_dark = (None if frame is None else photo_of(frame) for frame in (white, dark))
    return MeasuredShot(lamp, photo_of(photo), of_white, of_dark, pose, means, None, stated.lens_shading)
