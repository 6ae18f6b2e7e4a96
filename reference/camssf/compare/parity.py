"""Compares a result from elsewhere with Python's own on the same photos: which stage differs first, and by how much.

Each stage runs on the outputs of our own earlier stages, except that the pose is the other side's. So the first
difference shows the stage that causes it.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from camssf.calibration import attempt, recorded, solve
from camssf.compare.fields import WORDS, FieldDifference, field_differences
from camssf.compare.values import (
    choice_apart,
    curve_of,
    curves_apart,
    list_apart,
    patch_apart,
    patches_apart,
    stacked,
    triple_apart,
    uncertainty_apart,
    walked,
)
from camssf.documents.basis_choice import hypotheses_in_words
from camssf.documents.result_json import compare
from camssf.documents.unnamed_light import light_differences
from camssf.errors import CalibrationError, InvalidArgument
from camssf.options import DEFAULTS, Options
from camssf.photo.capture import Capture, MeasuredShot, Progress, photo_of
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.patches import LENS_SHADING, measure_patches
from camssf.photo.read.dng import Mosaic
from camssf.photo.read.raw import read_raw
from camssf.photo.read.sidecar import photo_hash
from camssf.photo.shot import PathLike, Shot
from camssf.recovery.hypotheses import AUTO
from camssf.spectra import CameraCurves, ChartTable, Light, Unnamed, read_chart, read_light, with_tolerance

Json: TypeAlias = dict[str, Any]

STAGES = (
    "file", "photo", "pose", "patch means", "signals", "inputs", "curve", "band", "gap", "scores", "verdict",
)  # fmt: skip
"""In the order of processing."""
POSE = 0.02
"""Bound in parts of the patch pitch; repeating the refinement moves a pose by less."""
AGREEMENT = 0.01
"""Bound for a pose's score, which changes with the refinement."""
MEANS = 1e-12
"""Bound in parts of the white level and of the largest signal; sums are exact, so only the last bits may differ."""
CURVES = 1e-9
"""Bound in parts of the peak; processors round differently (measured bounds: docs/solver.md)."""
GAP = 1e-9
"""Largest duality gap allowed on either side."""
SOLVED = ("basis", "width of the prior", "bases weighed", "model")
"""Inputs that only a solved result has."""
FIELDS, VALUES = 1e-9, 1e-8
"""Bounds of `FieldDifference.apart` for fields without a measure of their own, and for the verdict's fields."""
COLOURS = 1e-6
"""Bound for display colours, which are computed from the reflectances."""

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
    "If the result was made with --fit, --signed, --light-per-patch or --white-reflectance, say so here too.",
    "band": "The curve agrees, its standard deviation, the codes' covariance, the evidence, the budget or how "
    "far the truth may lie from a prediction does not.",
    "gap": "One of the two has not converged, or its layers have not.",
    "scores": "The curves agree, the validation does not: the folds, or the patches that it takes.",
    "verdict": "All numbers agree, the conclusion does not: compare the versions of camssf on both sides.",
}


@dataclass(frozen=True)
class Finding:
    """One stage compared.

    Attributes:
        stage: one of STAGES.
        agrees: whether `measured` is within the bound.
        measured: the largest difference in the stage's own measure; for values that are not numbers, 0 or infinity.
        bound: largest difference allowed.
        words: what was compared, and the place of the largest difference.
    """

    stage: str
    agrees: bool
    measured: float
    bound: float
    words: str


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
    tell = progress or (lambda stage, part: None)
    files = [photos] if isinstance(photos, str | Path) else list(photos)
    shots = document["shots"]
    whites, darks = _frames(shots, files, "white", white), _frames(shots, files, "dark", dark)
    if lamps and len(lamps) != len(shots):
        raise InvalidArgument(f"{len(lamps)} lamps for {len(shots)} shots.", "Give one --lamp a photo, or none.")
    specs = list(lamps) or [shot["lamp"]["name"] for shot in shots]
    lights = [_light(spec, shot["lamp"]) for spec, shot in zip(specs, shots, strict=True)]
    table = read_chart(chart or document["chart"]["name"])
    found = [_files(shots, files, whites, darks)]
    if not found[0].agrees:
        return tuple(found)
    tell("reading photos", 0.1)
    frames = [[None if path is None else read_raw(path) for path in each] for each in (files, whites, darks)]
    found += _photos(document, frames[0])
    refused = document["verdict"]["status"] == "refused"
    if any(shot["pose"] is None or not shot["patches"] for shot in shots):
        tell("calibrating", 0.5)
        alike = Options(white_reflectance=options.white_reflectance, light_per_patch=options.light_per_patch)
        given = [Shot(*each) for each in zip(files, lights, whites, darks, strict=True)]
        made = attempt(given, chart=table, options=alike).document()
        _rename(made, document, (files, whites, darks))
        sought = any(reason["code"] == "chart_not_found" for reason in document["verdict"]["reasons"])
        but = ("/shots", *_files_skipped(specs, chart), *(WORDS if sought else ()))
        return _joined([*found, *_verdicts(document, made)], field_differences(document, made, skip=but))
    tell("looking at the pose", 0.3)
    found += _poses(shots, frames[0], table)
    tell("measuring", 0.5)
    try:
        capture = _measure(shots, frames, lights, table, options.white_reflectance)
    except CalibrationError as error:
        words = f"here the measurement is refused: {error.code}, {error.message}"
        return (*found, Finding("patch means", False, np.inf, MEANS, words))
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
    truth = curve_of(document.get("truth", {}), "ssf")
    if truth is not None and "ssf" in made:
        compare(made, CameraCurves(document["truth"]["name"], truth, "the result"))
    found += _measured(document, made)
    found += _inputs(document, made, specs, chart or document["chart"]["name"])
    if not refused and made["verdict"]["status"] != "refused":
        found += _answers(document, made)
    fields = field_differences(document, made, skip=_files_skipped(specs, chart))
    return _joined([*found, *_verdicts(document, made)], fields)


def _files_skipped(specs: Sequence[str], chart: str | None) -> tuple[str, ...]:
    """Paths of the names of lamp and chart files, which may differ here; their SHA-256 is compared."""
    of_lamps = ("/shots/lamp/source",) if any(Path(spec).is_file() for spec in specs) else ()
    return of_lamps + (("/chart/name", "/chart/source") if chart and Path(chart).is_file() else ())


def _joined(found: Sequence[Finding], fields: Sequence[FieldDifference]) -> tuple[Finding, ...]:
    """Merge the field differences into the findings of their stages."""
    by_stage = {finding.stage: finding for finding in found}
    for field in fields:
        known, bound = by_stage.get(field.stage), VALUES if field.stage == "verdict" else FIELDS
        if field.apart > bound and (known is None or known.agrees):
            by_stage[field.stage] = Finding(field.stage, False, field.apart, bound, field.words)
    return tuple(by_stage[stage] for stage in STAGES if stage in by_stage)


def _rename(made: Json, document: Json, files: Sequence[Sequence[PathLike | None]]) -> None:
    """Replace our file paths in the messages by the other side's file names."""
    for reason in made["verdict"]["reasons"]:
        for role, paths in zip(("photo", "white", "dark"), files, strict=True):
            for shot, path in zip(document["shots"], paths, strict=False):
                if path is not None:
                    name = shot[role]["name"] if shot[role] else Path(path).name
                    reason["message"] = reason["message"].replace(str(path), name)


def first(findings: Sequence[Finding]) -> Finding | None:
    """The first stage that differs; None if all agree."""
    return next((finding for finding in findings if not finding.agrees), None)


def cause(finding: Finding) -> str:
    """The usual cause of such a difference, and what to check."""
    return _CAUSES[finding.stage]


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
    """The lamp of that name or file with the tolerance that the document states, or an unnamed light."""
    lamp = read_light(spec)
    if isinstance(lamp, Unnamed) or stated["tolerance"] is None:
        return lamp
    kelvin = re.search(r", ± ([0-9.]+) K", stated["source"])
    if kelvin:
        lamp = with_tolerance(lamp, f"{kelvin[1]}K")
    return replace(lamp, name=stated["name"], tolerance=float(stated["tolerance"]))


def _files(
    shots: Sequence[Json],
    files: Sequence[PathLike],
    whites: Sequence[PathLike | None],
    darks: Sequence[PathLike | None],
) -> Finding:
    """Compare the files' SHA-256."""
    other = []
    for number, (shot, *paths) in enumerate(zip(shots, files, whites, darks, strict=True), 1):
        for role, path in zip(("photo", "white", "dark"), paths, strict=True):
            if path is None or shot[role] is None:
                continue
            try:
                sha256 = photo_hash(path)
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or error
                raise InvalidArgument(f"{path} cannot be read: {reason}.", "Check the path.") from error
            if sha256 != shot[role]["sha256"]:
                stated = shot[role]["sha256"]
                other.append(f"shot {number}, {role}: {sha256[:12]}... here, {stated[:12]}... in the result")
    words = "; ".join(other) or f"SHA-256 of {len(shots)} shot(s)"
    return Finding("file", not other, float(len(other)), 0.0, words)


def _photos(document: Json, photos: Sequence[Mosaic | None]) -> Iterator[Finding]:
    """Compare the metadata that each side read from the files."""
    other = []
    for number, (shot, photo) in enumerate(zip(document["shots"], photos, strict=True), 1):
        assert photo is not None
        camera = " ".join(filter(None, (photo.make, photo.model)))
        ours: Json = vars(photo_of(photo)) | {"saturation": photo.white, "camera": camera}
        theirs: Json = shot["photo"] | {"saturation": shot["saturation"]}
        for key in ("width", "height", "orientation", "exposure", "iso", "gain_map", "saturation", "camera"):
            if ours[key] != theirs[key]:
                other.append(f"shot {number}: {key} {theirs[key]} there, {ours[key]} here")
    words = "; ".join(other) or "size, orientation, exposure, ISO, white level"
    yield Finding("photo", not other, float(len(other)), 0.0, words)


def _poses(shots: Sequence[Json], photos: Sequence[Mosaic | None], table: ChartTable) -> Iterator[Finding]:
    """Check that refining the other side's corners here leaves the pose in place and in the same orientation."""
    worst, words = 0.0, "the corners refine to themselves, the same way up"
    for number, (shot, photo) in enumerate(zip(shots, photos, strict=True), 1):
        assert photo is not None
        stated = shot["pose"]
        try:
            pose = find_chart(photo, table, corners=stated["corners"])
        except CalibrationError as error:
            yield Finding("pose", False, np.inf, POSE, f"shot {number}: here it is {error.code}, {error.message}")
            return
        quads = np.array(stated["patches"], float)
        if quads.shape != pose.patches.shape or pose.quarter_turns != stated["quarter_turns"]:
            turns = f"{90 * stated['quarter_turns']}° there, {90 * pose.quarter_turns}° here"
            yield Finding("pose", False, np.inf, POSE, f"shot {number}: {len(quads)} patches, turned by {turns}")
            return
        middle = pose.patches.mean(axis=1)
        pitch = float(np.linalg.norm(middle[1] - middle[0]))
        if abs(pose.score - stated["score"]) > AGREEMENT:
            words = f"shot {number}: score {stated['score']:.3f} there, {pose.score:.3f} here"
            yield Finding("pose", False, abs(pose.score - stated["score"]), AGREEMENT, words)
            return
        apart = np.linalg.norm(quads - pose.patches, axis=2)
        moved = max(float(apart.max()), float(np.abs(pose.corners - np.array(stated["corners"])).max())) / pitch
        if moved >= worst:
            patch = int(apart.max(axis=1).argmax())
            worst = moved
            words = f"shot {number}: patch {patch + 1} lies {apart.max():.3g} px from where it is found here"
    yield Finding("pose", worst <= POSE, worst, POSE, f"{words} (in pitches)")


def _measure(
    shots: Sequence[Json],
    frames: Sequence[Sequence[Mosaic | None]],
    lights: Sequence[Light],
    table: ChartTable,
    white_reflectance: float | None,
) -> Capture:
    """Measure the capture here with the other side's poses."""
    measured = []
    for shot, lamp, photo, white, dark in zip(shots, lights, *frames, strict=True):
        assert photo is not None
        stated = shot["pose"]
        pose = Pose(
            stated["layout"], np.array(stated["corners"], float), np.array(stated["patches"], float),
            stated["quarter_turns"], stated["method"], stated["score"], tuple(stated["notes"]),
        )  # fmt: skip
        shading = shot.get("lens_shading", LENS_SHADING[0])
        means = measure_patches(photo, pose, white=white, dark=dark, lens_shading=shading)
        of_white, of_dark = (None if frame is None else photo_of(frame) for frame in (white, dark))
        measured.append(MeasuredShot(lamp, photo_of(photo), of_white, of_dark, pose, means, None, shading))
    return Capture(tuple(measured), table, white_reflectance)


def _compare(stage: str, bound: float, parts: Sequence[tuple[float, str]]) -> Finding:
    measured, words = max(parts, key=lambda part: part[0])
    if measured == 0.0:
        words = "equal to the bit"
    return Finding(stage, measured <= bound, measured, bound, words)


def _measured(document: Json, made: Json) -> Iterator[Finding]:
    """Compare patch statistics and signals."""
    white = max(shot["saturation"] for shot in made["shots"])
    scales = {"chart": white, "white": white, "dark": white, "clipped": 1.0, "dead": 1.0, "gradient": 1.0}
    yield _compare("patch means", MEANS, [patch_apart(document, key, made, by) for key, by in scales.items()])
    largest = {key: np.abs(stacked(made, key)).max() or 1.0 for key in ("signal", "standard_error")}
    parts = [patch_apart(document, key, made, by) for key, by in largest.items()]
    yield _compare("signals", MEANS, parts)


def _inputs(document: Json, made: Json, specs: Sequence[str], chart: str) -> Iterator[Finding]:
    """Compare the other inputs of the equations: table, lamps' files, basis, model, patches used."""
    other = []
    for name, theirs, ours in (
        ("table", document["chart"]["table"], made["chart"]["table"]),
        ("layout", document["chart"]["layout"], made["chart"]["layout"]),
        ("basis", document["basis"], made["basis"]),
        ("width of the prior", document.get("prior_scale", 1.0), made.get("prior_scale", 1.0)),
        ("bases weighed", hypotheses_in_words(document), hypotheses_in_words(made)),
        ("model", document["hashes"]["model"], made["hashes"]["model"]),
    ):
        if theirs != ours and not (name in SOLVED and "none" in (document["engine"], made["engine"])):
            other.append(f"{name} {theirs} there, {ours} here")
    stated: Mapping[str, str] = document["hashes"]["inputs"]
    for role, spec in (("chart table", chart), *((f"shot {j}, lamp", lamp) for j, lamp in enumerate(specs, 1))):
        known = {sha256 for key, sha256 in stated.items() if key.startswith(f"{role}:")}
        path = next((Path(name) for name in (spec, spec.partition(":")[2]) if name and Path(name).is_file()), None)
        if path is not None and hashlib.sha256(path.read_bytes()).hexdigest() not in known:
            other.append(f"{role}: {path.name} is another file")
    roles = {key.partition(": ")[0]: sha256 for key, sha256 in stated.items()}
    for key, sha256 in made["hashes"]["inputs"].items():
        role = key.partition(": ")[0]
        if roles.get(role) != sha256:
            other.append(f"SHA-256 of {role}: {roles.get(role)} there, {sha256} here")
    used = [
        f"shot {j + 1}, patch {i + 1} ({theirs['name']}) {'used' if theirs['used'] else 'not used'} there"
        for j, (shot, mine) in enumerate(zip(document["shots"], made["shots"], strict=True))
        for i, (theirs, ours) in enumerate(zip(shot["patches"], mine["patches"], strict=True))
        if theirs["used"] != ours["used"]
    ]
    colours, where = patch_apart(document, "reflectance_srgb", made, 1.0)
    if colours > COLOURS:
        other.append(f"reflectances: {where}")
    words = "; ".join(other + used[:3]) or "table, lamps, basis, model, patches used"
    differ = bool(other or used)
    yield Finding("inputs", not differ, max(colours, np.inf if differ else 0.0), COLOURS, words)


def _answers(document: Json, made: Json) -> Iterator[Finding]:
    """Compare curves, bands and evidence, gaps, scores."""
    parts = [
        curves_apart(document, made, "ssf"),
        triple_apart(document, made, "channel_gain"),
        patch_apart(document, "predicted", made, 1.0),
    ]
    yield _compare("curve", CURVES, parts)
    spread = [
        list_apart(document, made, "code_covariance", 1.0),
        list_apart(document, made, "evidence", made.get("evidence")),
    ]
    spread += [patches_apart(document, made, key) for key in ("level", "predicted_std", "unseen_std")]
    weighed = [*choice_apart(document, made), *light_differences(document, made), *uncertainty_apart(document, made)]
    yield _compare("band", CURVES, [curves_apart(document, made, "ssf_std"), *spread, *weighed])
    gaps = [("there", max(document["gap"])), ("here", max(made["gap"]))]
    parts = [(gap, f"largest {where} {gap:.2g}") for where, gap in gaps]
    yield _compare("gap", GAP, [*parts, list_apart(document, made, "layers_gap", 1.0), walked(document, made)])
    scores = [triple_apart(document["scores"], made["scores"], "rmsre_percent")]
    scores += [list_apart(document["scores"], made["scores"], "delta_e00", made["scores"]["delta_e00"])]
    scores += [patches_apart(document, made, key) for key in ("unseen", "measured_srgb", "synthetic_srgb")]
    yield _compare("scores", CURVES, scores)


def _verdicts(document: Json, made: Json) -> Iterator[Finding]:
    """Compare the status and the codes of the reasons and assumptions."""
    theirs, ours = (
        (
            each["verdict"]["status"],
            sorted({reason["code"] for reason in each["verdict"]["reasons"]}),
            sorted({assumption["code"] for assumption in each["assumptions"]}),
        )
        for each in (document, made)
    )
    if document["verdict"]["status"] == made["verdict"]["status"] == "refused":
        theirs, ours = theirs[:2], ours[:2]  # type: ignore[assignment]
    shown = [f"{each[0]} ({', '.join(each[1]) or 'no reasons'})" for each in (theirs, ours)]
    words = f"{shown[0]} there, {shown[1]} here"
    if theirs[:2] == ours[:2] and theirs != ours:
        words = f"assumptions {', '.join(theirs[2])} there, {', '.join(ours[2])} here"
    yield Finding("verdict", theirs == ours, float(theirs != ours), 0.0, words)
