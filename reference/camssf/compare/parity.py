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

from camssf.calibration import attempt, recorded, solve
from camssf.compare.differences import Finding, differences
from camssf.documents.result_json import compare, photo_json
from camssf.errors import CalibrationError, InvalidArgument
from camssf.grid import columns
from camssf.options import DEFAULTS, Options
from camssf.photo.capture import Capture, MeasuredShot, Progress, input_hash, photo_of
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.patches import LENS_SHADING, measure_patches
from camssf.photo.read.dng import Mosaic
from camssf.photo.read.raw import read_raw
from camssf.photo.read.sidecar import photo_hash
from camssf.photo.shot import PathLike, Shot
from camssf.recovery.hypotheses import AUTO
from camssf.spectra import CameraCurves, ChartTable, Light, Unnamed, read_chart, read_light, with_tolerance

Json: TypeAlias = dict[str, Any]
Frames: TypeAlias = Mapping[str, Sequence[PathLike | None]]
"""The files of each role, "photo", "white" and "dark", one per shot."""

STAGES = (
    "file", "photo", "pose", "patch means", "signals", "inputs", "curve", "band", "gap", "scores", "verdict",
)  # fmt: skip
"""In the order of processing."""
SOLVED = ("curve", "band", "gap", "scores")
"""Stages that a refused result does not have."""
POSE = 0.02
"""Bound in parts of the patch pitch; repeating the refinement moves a pose by less."""
AGREEMENT = 0.01
"""Bound for a pose's score, which changes with the refinement."""
UNREPEATED = tuple(f"/verdict/reasons/{key}" for key in ("message", "advice", "value", "threshold"))
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
    "signals": "The samples agree, Eq. (5) does not: the white or dark reference, or the rule for usable patches.",
    "inputs": "Another chart table, lamp, basis or model: compare the versions of camssf on both sides.",
    "curve": "The inputs agree, the solution does not: the ONNX model, its runtime, or another lamp or "
    "penalty than the result states. "
    "If the result was made of some patches only (fit), with signed coefficients, with light_per_patch or with "
    "white_reflectance, say so here too.",
    "band": "The curve agrees, its standard deviation, the codes' covariance, the evidence, the budget or how "
    "far the truth may lie from a prediction does not.",
    "gap": "One of the two has not converged, or its layers have not.",
    "scores": "The curves agree, the validation does not: the folds, or the patches that it takes.",
    "verdict": "All numbers agree, the conclusion does not: compare the versions of camssf on both sides.",
}


def parity(
    document: Json,
    photos: PathLike | Sequence[PathLike],
    *,
    white: Sequence[PathLike | None] = (),
    dark: Sequence[PathLike | None] = (),
    lamps: Sequence[str] = (),
    chart: str | None = None,
    options: Options = DEFAULTS,
    progress: Progress | None = None,
) -> tuple[Finding, ...]:
    """Compare every field of a "camssf-result/1" document with Python's own result on the same photos.

    A missing field is a difference, unless another release of camssf wrote the result.

    Pose, lamp, chart, tolerances, basis and penalties are taken from the document. What it does not hold must be
    given again: files of lamps and charts, the white target, the patches to fit, signed coefficients, uneven light.

    Args:
        document: the result, checked against its schema.
        photos: DNG of each shot, in the shots' order.
        white, dark: the frames that the document lists as used.
        lamps, chart: replace the document's, if those are files at another path here.
        options: white_reflectance, fit, nonnegative and light_per_patch; the others are taken from the document.
        progress: called with the stage in words and the part done, 0 to 1.

    Returns:
        A finding for each stage that could be compared, in order.

    Raises:
        InvalidArgument: photos or frames do not match the document in number, or a lamp or chart is unknown.
        RawError: a file cannot be read.
    """
    if any(each["code"] == "previous_result" for each in document["assumptions"]):
        raise InvalidArgument(
            "This result holds the shots of a previous one, which are not measured again.",
            "Compare the result of the new photos alone, and the previous one by itself.",
        )
    tell = progress or (lambda stage, part: None)
    files = [photos] if isinstance(photos, str | Path) else list(photos)
    shots = document["shots"]
    frames = {"photo": files} | {
        role: _frames(shots, files, role, given) for role, given in (("white", white), ("dark", dark))
    }
    if lamps and len(lamps) != len(shots):
        raise InvalidArgument(f"{len(lamps)} lamps for {len(shots)} shots.", "Give one lamp a photo, or none.")
    specs = list(lamps) or [shot["lamp"]["name"] for shot in shots]
    lights = [_light(spec, shot["lamp"]) for spec, shot in zip(specs, shots, strict=True)]
    table = read_chart(chart or document["chart"]["name"])
    found = _findings(differences({"shots": shots}, {"shots": _hashes(shots, frames)}, part=True), ("file",))
    if first(found):
        return tuple(found)
    tell("reading photos", 0.1)
    mosaics = [read_raw(path) for path in files]
    facts = [{"photo": photo_json(photo_of(mosaic)), "saturation": mosaic.white} for mosaic in mosaics]
    found += _findings(differences({"shots": shots}, {"shots": facts}, part=True), ("photo",))
    # The names of lamp and chart files may differ; their SHA-256 are compared.
    skip: tuple[str, ...] = ("/shots/lamp/source",) if any(Path(spec).is_file() for spec in specs) else ()
    skip += ("/chart/name", "/chart/source") if chart and Path(chart).is_file() else ()
    if any(shot["pose"] is None or not shot["patches"] for shot in shots):
        tell("calibrating", 0.5)
        alike = Options(white_reflectance=options.white_reflectance, light_per_patch=options.light_per_patch)
        given = [Shot(*each) for each in zip(files, lights, frames["white"], frames["dark"], strict=True)]
        made = attempt(given, chart=table, options=alike).document()
        _rename(made, document, frames)
        sought = any(reason["code"] == "chart_not_found" for reason in document["verdict"]["reasons"])
        skip += ("/shots", "/hashes", *(UNREPEATED if sought else ()))
        return _joined(found, document, made, skip, ("verdict",))
    tell("looking at the pose", 0.3)
    found.append(_pose(shots, mosaics, table))
    tell("measuring", 0.5)
    try:
        each_shot = zip(shots, lights, mosaics, frames["white"], frames["dark"], strict=True)
        measured = tuple(_measure(*each) for each in each_shot)
    except CalibrationError as error:
        words = f"here the measurement is refused: {error.code}, {error.message}"
        return (*found, Finding("patch means", False, np.inf, 0.0, words))
    hashes = input_hash("chart table", chart or document["chart"]["name"])
    for j, spec in enumerate(specs, 1):
        hashes |= input_hash(f"shot {j}, lamp", spec)
    capture = Capture(measured, table, options.white_reflectance, hashes)
    tell("solving", 0.7)
    # A basis chosen by evidence must be chosen again here, with the same probabilities. A refusal holds no basis.
    bases = {each["basis"] for each in document.get("choice", ())}  # only one if just the light's kind was chosen
    chosen = document["basis"] == "none" or len(bases) > 1
    basis = AUTO if chosen else document["basis"]
    stated = replace(
        DEFAULTS, basis=basis, fit=options.fit, nonnegative=options.nonnegative, l2=document.get("l2"),
        gamma=document.get("gamma"), light_per_patch=options.light_per_patch,
    )  # fmt: skip
    made = recorded(lambda record: solve(capture, options=stated, record=record)).document()
    if "truth" in document and "ssf" in made:
        truth = columns(document["truth"]["ssf"])
        compare(made, CameraCurves(document["truth"]["name"], truth, "the result"))
    solved = "ssf" in document and "ssf" in made
    return _joined(found, document, made, skip, [each for each in STAGES[3:] if solved or each not in SOLVED])


def first(findings: Sequence[Finding]) -> Finding | None:
    """The first stage that differs; None if all agree."""
    return next((finding for finding in findings if not finding.agrees), None)


def cause(finding: Finding) -> str:
    """The usual cause of such a difference, and what to check."""
    return _CAUSES[finding.stage]


def _findings(fields: Iterable[Finding], stages: Sequence[str]) -> list[Finding]:
    """A finding for each of the stages, and for each other one that differs."""
    found, every = [], list(fields)
    for stage in STAGES:
        own = [each for each in every if each.stage == stage]
        worst = max(own, key=lambda each: each.measured / (each.bound or 1.0), default=None)
        if worst is not None and not worst.agrees:
            alike = [each.words for each in own if each.measured == worst.measured]
            found.append(replace(worst, words="; ".join(alike[:3])))
        elif stage in stages:
            worst = worst or Finding(stage, True, 0.0, 0.0, "equal to the bit")
            found.append(replace(worst, words=_EQUAL.get(stage, worst.words)))
    return found


def _joined(
    found: Sequence[Finding], document: Json, made: Json, skip: tuple[str, ...], stages: Sequence[str]
) -> tuple[Finding, ...]:
    """The findings so far, and those of each field of both documents."""
    by_stage = {each.stage: each for each in found}
    for each in _findings(differences(document, made, skip=skip), stages):
        if each.stage == "verdict" and each.agrees:
            codes = ", ".join(sorted({reason["code"] for reason in made["verdict"]["reasons"]})) or "no reasons"
            shown = f"{made['verdict']['status']} ({codes})"
            each = replace(each, words=f"{shown} there, {shown} here")
        if each.stage not in by_stage or by_stage[each.stage].agrees:
            by_stage[each.stage] = each
    return tuple(by_stage[stage] for stage in STAGES if stage in by_stage)


def _rename(made: Json, document: Json, frames: Frames) -> None:
    """Replace our file paths in the messages by the other side's file names."""
    for reason in made["verdict"]["reasons"]:
        for role, paths in frames.items():
            for shot, path in zip(document["shots"], paths, strict=False):
                if path is not None:
                    name = shot[role]["name"] if shot[role] else Path(path).name
                    reason["message"] = reason["message"].replace(str(path), name)


def _frames(
    shots: Sequence[Json], files: Sequence[PathLike], role: str, given: Sequence[PathLike | None]
) -> list[PathLike | None]:
    """The frames' files, one per shot; a frame must be given exactly where the document names one."""
    if len(files) != len(shots):
        raise InvalidArgument(
            f"{len(files)} photo(s) for a result of {len(shots)} shot(s).", "Give the photos in the shots' order."
        )
    frames = list(given) or [None] * len(shots)
    if len(frames) != len(shots):
        raise InvalidArgument(f"{len(frames)} {role} frames for {len(shots)} shots.", "Give one a photo, or none.")
    for number, (shot, frame) in enumerate(zip(shots, frames, strict=True), 1):
        if shot["patches"] and (shot[role] is None) != (frame is None):  # else the frames were not recorded
            named = f"used the {role} frame {shot[role]['name']}" if shot[role] else f"used no {role} frame"
            raise InvalidArgument(f"Shot {number} of the result {named}.", f"Give just that by --{role}.")
    return frames


def _light(spec: str, stated: Json) -> Light:
    """The lamp of that name or file with the tolerances that the document states, or an unnamed light."""
    lamp = read_light(spec)
    if isinstance(lamp, Unnamed) or stated["tolerance"] is None:
        return lamp
    if "tolerance_kelvin" in stated:
        lamp = with_tolerance(lamp, f"{stated['tolerance_kelvin']!r}K")
    return replace(lamp, name=stated["name"], tolerance=float(stated["tolerance"]))


def _hashes(shots: Sequence[Json], frames: Frames) -> list[Json]:
    """SHA-256 of each shot's files, as a result holds them; without frames that the result does not name."""
    found: list[Json] = [{} for _ in shots]
    for role, paths in frames.items():
        for shot, stated, path in zip(found, shots, paths, strict=True):
            try:
                shot |= {role: {"sha256": photo_hash(path)}} if path is not None and stated[role] else {}
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or error
                raise InvalidArgument(f"{path} cannot be read: {reason}.", "Check the path.") from error
    return found


def _pose(shots: Sequence[Json], photos: Sequence[Mosaic], table: ChartTable) -> Finding:
    """Check that refining the other side's corners here leaves the pose in place and in the same orientation."""
    worst, words = 0.0, "the corners refine to themselves, the same way up"
    for number, (shot, photo) in enumerate(zip(shots, photos, strict=True), 1):
        stated = shot["pose"]
        try:
            pose = find_chart(photo, table, corners=stated["corners"])
        except CalibrationError as error:
            return Finding("pose", False, np.inf, POSE, f"shot {number}: here it is {error.code}, {error.message}")
        quads = np.array(stated["patches"], float)
        if quads.shape != pose.patches.shape or pose.quarter_turns != stated["quarter_turns"]:
            turns = f"{90 * stated['quarter_turns']}° there, {90 * pose.quarter_turns}° here"
            return Finding("pose", False, np.inf, POSE, f"shot {number}: {len(quads)} patches, turned by {turns}")
        change = abs(pose.score - stated["score"])
        if change > AGREEMENT:
            words = f"shot {number}: score {stated['score']:.3f} there, {pose.score:.3f} here"
            return Finding("pose", False, change, AGREEMENT, words)
        middle = pose.patches.mean(axis=1)
        apart = np.linalg.norm(quads - pose.patches, axis=2)
        moved = max(float(apart.max()), float(np.abs(pose.corners - np.array(stated["corners"])).max()))
        moved /= float(np.linalg.norm(middle[1] - middle[0]))
        if moved >= worst:
            patch, worst = int(apart.max(axis=1).argmax()) + 1, moved
            words = f"shot {number}: patch {patch} lies {apart.max():.3g} px from where it is found here"
    return Finding("pose", worst <= POSE, worst, POSE, f"{words} (in pitches)")


def _measure(stated: Json, lamp: Light, photo: Mosaic, *paths: PathLike | None) -> MeasuredShot:
    """Measure a shot with its white and dark frame here, with the other side's pose."""
    white, dark = (None if path is None else read_raw(path) for path in paths)
    corners, patches = (np.array(stated["pose"][key], float) for key in ("corners", "patches"))
    pose = Pose(**stated["pose"] | {"corners": corners, "patches": patches, "notes": tuple(stated["pose"]["notes"])})
    shading = stated.get("lens_shading", LENS_SHADING[0])
    means = measure_patches(photo, pose, white=white, dark=dark, lens_shading=shading)
    of_white, of_dark = (None if frame is None else photo_of(frame) for frame in (white, dark))
    return MeasuredShot(lamp, photo_of(photo), of_white, of_dark, pose, means, None, shading)
