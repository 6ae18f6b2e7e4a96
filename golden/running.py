"""Runs a case through camssf, by either engine, and compares the result with the case's limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from camssf.calibration import solve as calibrate_capture
from camssf.colour import PARTS, Reference, View, camera_of_result, standard_colour
from camssf.colour.reach import REACH
from camssf.colour.regions import measure_regions
from camssf.errors import CalibrationError
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.cross_validation import cross_validate, score
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.options import Options
from camssf.photo.capture import Capture, Photo, Shot
from camssf.photo.find.picture import SearchImage, codes_of_bytes, codes_of_light, codes_of_mosaic, rgb_of_yuv
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.find.sightings import find_sightings
from camssf.photo.patches import FrameMeans, PatchMeans, measure_patches
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.photo.signals import Signals, normalise
from camssf.recovery.basis import Basis, gaussian_basis, read_basis, widened
from camssf.recovery.budget import explain
from camssf.recovery.hypotheses import recover
from camssf.recovery.layers import DEPTH
from camssf.recovery.linear_model import LinearModel, anchor, linear_model
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import Model, load_model
from camssf.recovery.prediction import predict
from camssf.recovery.sensitivity import Hypothesis, Ssf
from camssf.recovery.solve import solve
from camssf.spectra import ChartTable, Lamp, Unnamed, read_chart
from camssf.verdict.assumptions import assume
from camssf.verdict.goodness_of_fit import VerdictInputs, best_explanation, shot_answer
from camssf.verdict.judge import judge as judge_capture
from camssf.verdict.lamp import Neutral, Rival
from camssf.verdict.reasons import Fatal
from camssf.verdict.rival_lamps import weigh, weigh_rivals
from golden.compare import METRICS, optimality, peak
from golden.finders import planes, shown
from golden.reading import CAPABILITIES, GoldenError, Json, digest, dng, resolve, sibling

ENGINES = ("reference", "onnx")
VERDICT_NUMBERS = {
    "reflectance", "chart_tolerance", "white_reflectance", "lamp", "lamp_modes", "signals", "standard_error", "white",
    "dark", "centres", "ssf", "ssf_std", "code", "predicted",
}  # fmt: skip
"""Inputs of a verdict that are arrays."""
LACKING = {"metadata"}
"""Capabilities that Python's reader lacks; a phone's may have them."""
ABILITIES = tuple(name for name in CAPABILITIES if name not in LACKING)


class Finding(NamedTuple):
    """One limit and the measured value; `skipped` names the capability that the runner lacks."""

    limit: str
    measured: float
    bound: float
    skipped: str = ""

    @property
    def holds(self) -> bool:
        """Whether the measured value is within the bound, or was skipped; a NaN is not."""
        return bool(self.skipped) or bool(self.measured <= self.bound)


def basis_of(spec: Any) -> Basis:
    """A shipped basis by name, or a Gaussian basis by {count, width}."""
    return read_basis(spec) if isinstance(spec, str) else gaussian_basis(spec["count"], spec["width"])


def arrays(case: Json) -> dict[str, Any]:
    """The case's inputs with every form resolved."""
    plain_numbers = {
        "mosaic": set(),
        "pose": {"corners"},
        "patches": {"quads"},
        "verdict": VERDICT_NUMBERS,
        "colour": {"signals", "standard_error"},
        "regions": set(),
        "finder": set(),
    }
    numbers = plain_numbers.get(case["stage"])
    if numbers is not None:
        return {key: resolve(value) if key in numbers else value for key, value in case["inputs"].items()}
    plain = ("basis", "shots", "iteration", "depth", "prior", "make", "unnamed")
    return {key: value if key in plain else resolve(value) for key, value in case["inputs"].items()}


def run(case: Json, engine: str = "reference") -> dict[str, Any]:
    """The outputs of a case.

    Raises:
        CalibrationError: the error that an error case expects.
    """
    given = arrays(case)
    stages = {
        "mosaic": _mosaic,
        "pose": _pose,
        "patches": _patches,
        "signals": _signals,
        "sensing": _sensing,
        "weights": _weights,
        "solve": _solve,
        "verdict": _verdict,
        "colour": _colour,
        "regions": _regions,
        "finder": _finder,
    }
    if case["stage"] in stages:
        return stages[case["stage"]](given)
    if case["stage"] == "calibrate":
        return _calibrate(given, engine)
    if case["stage"] == "light":
        return _light(given, engine)
    if case["stage"] == "rivals":
        return _rivals(given)
    if case["stage"] == "choice":
        return _choice(given, engine)
    if case["stage"] == "layers":
        return layers(case, load_model(given["basis"]) if engine == "onnx" else None)
    return _ssf(given, engine, case["expect"] == "success")


def by_model(case: Json) -> bool:
    """Whether the shipped ONNX model can run the case; the other cases are single steps of the reference."""
    return "model" in case["requires"]


def findings(case: Json, engine: str = "reference", capabilities: tuple[str, ...] = ABILITIES) -> list[Finding]:
    """Measure every limit of the case; for an error case compare the error code."""
    lacking = sorted(set(case["requires"]) - set(capabilities))
    if lacking:
        return [Finding("case", 0.0, 0.0, f"needs {', '.join(lacking)}")]
    try:
        outputs = run(case, engine)
    except CalibrationError as error:
        return [Finding(f"expect {case['expect']}, found {error.code}", float(error.code != case["expect"]), 0.0)]
    if case["expect"] != "success":
        return [Finding(f"expect {case['expect']}, found success", 1.0, 0.0)]
    return [*judge(case, outputs, capabilities), *_complete(case, outputs)]


def judge(case: Json, outputs: dict[str, Any], capabilities: tuple[str, ...] = ABILITIES) -> list[Finding]:
    """Compare outputs with the limits."""
    found = []
    for limit in case["limits"]:
        name = f"{limit['value']} against {limit['against']}, {limit['metric']}"
        lacking = sorted(set(limit["requires"]) - set(capabilities))
        if lacking:
            found.append(Finding(name, 0.0, 0.0, f"needs {', '.join(lacking)}"))
            continue
        known = case[limit["against"]][limit["value"]]
        expected = resolve(known) if limit["metric"] != "exact" else known
        measured = METRICS[limit["metric"]](outputs[limit["value"]], expected)
        found.append(Finding(name, measured, limit["bound"]["float64"]))
    return found


def problem(case: Json) -> LinearModel:
    """A, b and Σ of a case with convex problems: stages weights, solve, ssf, layers."""
    given = arrays(case)
    if case["stage"] not in ("ssf", "layers"):
        return LinearModel(given["matrix"], given["target"], given["covariance"])
    signals = (given["chart"] - given["dark"]) / (given["white"] - given["dark"])
    return _rows(given, signals)


def _complete(case: Json, outputs: dict[str, Any]) -> list[Finding]:
    """Check that outputs which are null in the file are absent in the result, as a band without a prior."""
    return [
        Finding(f"{name} is absent", float(outputs[name] is not None and not np.isnan(outputs[name]).all()), 0.0)
        for name, value in case["outputs"].items()
        if value is None and name in outputs
    ]


def _observation(given: dict[str, Any], signals: Any, frames: Any = None) -> Observation:
    """The observation of a case; the signals may be ragged in an error case."""
    return Observation(
        signals,
        given["reflectance"],
        given["lamp"],
        standard_error=given["standard_error"],
        chart_tolerance=given["chart_tolerance"],
        white_reflectance=given["white_reflectance"],
        white_tolerance=given["white_tolerance"],
        lamp_tolerance=given["lamp_tolerance"],
        lamp_modes=given["lamp_modes"],
        gain_modes=given.get("gain_modes", np.zeros((0, 0))),
        gain_own=given.get("gain_own", 0.0),
        frames=frames,
    )


def _rows(given: dict[str, Any], signals: Floats) -> LinearModel:
    return linear_model(_observation(given, signals), widened(basis_of(given["basis"]), _scale(given)))


def _scale(given: dict[str, Any]) -> float:
    """The width of the prior; 1 if the case does not give it."""
    return float(given.get("prior_scale", 1.0))


def _sensing(given: dict[str, Any]) -> dict[str, Any]:
    return dict(vars(_rows(given, given["signals"])))


def _weights(given: dict[str, Any]) -> dict[str, Any]:
    """ρ = γ + 2 λ₂, W = (H + ρ I)⁻¹, and z after each of the depths."""
    sensing = LinearModel(given["matrix"], given["target"], given["covariance"])
    l2, gamma, nonnegative = given["l2"], given["gamma"], given["nonnegative"]
    codes = [solve(sensing, l2, gamma, nonnegative=nonnegative, depth=int(d), finish=0) for d in given["depths"]]
    rho = gamma + 2.0 * l2
    W = np.linalg.inv(codes[0].precision + rho[:, None, None] * np.eye(sensing.matrix.shape[2]))
    return {"rho": rho, "W": W, "z": np.stack([code.values for code in codes])}


def _solve(given: dict[str, Any]) -> dict[str, Any]:
    sensing = LinearModel(given["matrix"], given["target"], given["covariance"])
    more = {} if given["depth"] is None else {"depth": given["depth"]}
    code = solve(
        sensing, given["l2"], given["gamma"], nonnegative=given["nonnegative"], finish=given["finish"], **more
    )
    names = ("objective", "gap", "layers_gap", "finish_steps")
    return {"code": code.values, "evidence": code.log_evidence} | {name: getattr(code, name) for name in names}


def _ssf(given: dict[str, Any], engine: str, sound: bool) -> dict[str, Any]:
    """The stage `ssf`: by the model alone; the reference and error cases by `recover`, which checks its arguments."""
    frames = [given[name] for name in ("chart", "white", "dark")]
    with np.errstate(divide="ignore", invalid="ignore"):
        signals = [(np.array(c, float) - d) / (np.array(w, float) - d) for c, w, d in zip(*frames, strict=True)]
    if engine == "onnx" and sound:
        model = load_model(given["basis"])
        found: dict[str, Any] = model.run(model_inputs(model, given))
    else:
        observation = _observation(given, signals, tuple(frames) if sound else None)
        ssf = recover(
            observation,
            basis=given["basis"],
            l2=given["l2"],
            gamma=given["gamma"],
            nonnegative=given["nonnegative"],
            engine=engine,
            prior_scale=_scale(given),
        )
        names = ("code", "code_covariance", "predicted", "gap", "layers_gap", "finish_steps", "channel_gain")
        budget = std = None
        if ssf.std is not None:
            std = predict(ssf, observation).std
            budget = np.array(list(explain(observation, basis=ssf.basis, prior_scale=ssf.prior_scale).values()))
        found = {
            "predicted_std": std,
            "budget": budget,
            "ssf": ssf.values,
            "ssf_std": ssf.std,
            "signals": np.stack(signals),
            "evidence": ssf.log_evidence,
        } | {name: getattr(ssf, name) for name in names}
    return found | {"objective": _objective(given, _rows(given, np.stack(signals)), found["code"])}


def model_inputs(model: Model, given: dict[str, Any]) -> dict[str, Floats]:
    """All inputs of the model from a case's inputs; a mode of zeros if there is none, as the model needs one."""
    k, n, _ = np.shape(given["chart"])
    none = {"lamp_modes": np.zeros((k, 1, WAVELENGTHS.size)), "gain_modes": np.zeros((k, 1, n)), "gain_own": 0.0}
    none |= {"prior_scale": _scale(given), "explain": 1.0}
    told = none | {name: value for name, value in given.items() if np.size(value)}
    return {each.name: np.asarray(told[each.name], float) for each in model.session.get_inputs()}


def _choice(given: dict[str, Any], engine: str) -> dict[str, Any]:
    """The stage `choice`: `recover` with its hypotheses; curves and bands on the 5-nm nodes, at peak 1."""
    frames = tuple(given[name] for name in ("chart", "white", "dark"))
    signals = (frames[0] - frames[2]) / (frames[1] - frames[2])
    ssf = recover(
        _observation(given, signals, frames),
        basis=given["basis"],
        l2=given["l2"],
        gamma=given["gamma"],
        nonnegative=given["nonnegative"],
        engine=engine,
        prior=given["prior"],
    )
    curves, std = ssf.peak()
    assert std is not None
    return {
        "weighed": [[weight.basis, weight.prior_scale] for weight in ssf.choice],
        "log_evidence": np.array([weight.log_evidence for weight in ssf.choice]),
        "probability": np.array([weight.probability for weight in ssf.choice]),
        "basis": ssf.basis,
        "prior_scale": ssf.prior_scale,
        "ssf": curves[::10],
        "ssf_std": std[::10],
        "predicted": ssf.predicted,
        "gap": ssf.gap,
    }


def _objective(given: dict[str, Any], rows: LinearModel, code: Floats) -> Floats:
    """(p,) objective of a code (r, 3), recomputed without its solver."""
    return np.array([
        optimality(A, b, S, x, given["l2"], given["gamma"], given["nonnegative"])[0]
        for A, b, S, x in zip(
            rows.matrix, rows.target, rows.covariance, code.T.reshape(len(rows.matrix), -1), strict=True
        )
    ])  # fmt: skip


def layers(case: Json, model: Model | None = None) -> dict[str, Any]:
    """The result of a number of layers alone, and its distance from the oracle's curve.

    The reference runs the layers alone. A model also has a finish; if that took no step, its result is the layers',
    and cases for models require that it took none.

    Raises:
        GoldenError: the model has other layers.
    """
    given = arrays(case)
    signals = (given["chart"] - given["dark"]) / (given["white"] - given["dark"])
    rows, basis = _rows(given, signals), basis_of(given["basis"])
    iteration, depth = given["iteration"], int(given["depth"])
    if model is None:
        told = (rows, given["l2"], np.full(len(rows.matrix), float(given["gamma"])))
        kind: dict[str, Any] = {"nonnegative": given["nonnegative"], "depth": depth, "layers": iteration}
        alone = solve(*told, finish=0, **kind)
        white = given["white_reflectance"] * given["lamp"][0]
        own, code, gap = anchor(basis, white), alone.values.reshape(3, -1).T, alone.gap
        curves = (own.mean + np.einsum("cmr,rc->cm", own.dictionary, code)).T
        curves = curves / (white @ curves * STEP)
        steps = solve(*told, **kind).finish_steps
    else:
        has = model.metadata.get("iteration"), int(model.metadata["depth"])
        if has != (iteration, depth):
            raise GoldenError(
                f"{case['case']}: {depth} layers of {iteration}, but the model has {has[1]} of {has[0]}"
            )
        found: dict[str, Any] = model.run(model_inputs(model, given))
        curves, code, gap, steps = (found[name] for name in ("ssf", "code", "layers_gap", "finish_steps"))
    return {
        "ssf": curves,
        "gap": gap,
        "finish_steps": steps if (iteration, depth) == ("splitting", DEPTH) else None,
        "objective": _objective(given, rows, code),
        "distance": peak(curves, resolve(case["oracle"]["ssf"])),
    }


def _read(name: str) -> Mosaic:
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(dng(name))
        return read_dng(path)


def _mosaic(given: dict[str, Any]) -> dict[str, Any]:
    """The stage `mosaic`: what the reader finds; Python does not read the fields of `metadata`."""
    found = _read(given["dng"])
    height, width = found.samples.shape
    names = ("sha256", "cfa", "white", "make", "model", "exposure", "iso", "orientation")
    maps = [
        {
            "list": each.stage,
            "area": [each.top, each.left, each.bottom, each.right],
            "plane": each.plane,
            "planes": each.planes,
            "row_pitch": each.row_pitch,
            "column_pitch": each.column_pitch,
            "spacing": list(each.spacing),
            "origin": list(each.origin),
            "gains": each.gains.tolist(),
        }
        for each in found.gain_maps
    ]
    more = {name: getattr(found, name) for name in ("color_matrix1", "color_matrix2", "as_shot_neutral")}
    return {
        **{name: getattr(found, name) for name in names},
        **{name: None if value is None else value.ravel() for name, value in more.items()},
        "width": width,
        "height": height,
        "samples_sha256": digest(found.samples.astype("<u2").tobytes()),
        "black": found.black.ravel(),
        "gain_maps": maps,
    }


def _pose(given: dict[str, Any]) -> dict[str, Any]:
    pose = find_chart(_read(given["dng"]), read_chart(given["table"]), corners=given["corners"])
    return {
        "corners": pose.corners,
        "quads": pose.patches,
        "quarter_turns": pose.quarter_turns,
        "score": pose.score,
        "kept": bool(pose.notes),
    }


def _finder(given: dict[str, Any]) -> dict[str, Any]:
    """The stage `finder`: charts found in one of the forms of a photo; the points of all charts concatenated."""
    photo = _read(given["dng"])
    found = find_sightings(_searched(photo, given["form"]))
    seen = found.sightings
    return {
        "findings": list(found.findings),
        "kinds": [each.kind for each in seen],
        "mirrored": [each.mirrored for each in seen],
        "seen": [each.blobs for each in seen],
        "corners": np.array([each.corners for each in seen]).reshape(-1, 2),
        "patches": np.concatenate([np.zeros((0, 2)), *(each.patches for each in seen)]),
        "confidence": np.array([each.confidence for each in seen]),
    }


def _searched(photo: Mosaic, form: str) -> SearchImage:
    if form == "mosaic":
        return codes_of_mosaic(photo)
    light = planes(photo)
    if form == "light":
        return codes_of_light(light.astype(np.float32))
    picture = shown(light)
    if form == "yuv":
        y, blue, red = (picture[:, :, channel].astype(np.int64) for channel in (1, 2, 0))
        u, v = (np.clip(128 + (each - y) // 2, 0, 255)[::2, ::2].astype(np.uint8) for each in (blue, red))
        picture = rgb_of_yuv(picture[:, :, 1], u, v)
    return codes_of_bytes(picture[:, :, 1] if form == "luma" else picture)


def _patches(given: dict[str, Any]) -> dict[str, Any]:
    photos = {role: given[role] and _read(given[role]) for role in ("photo", "white", "dark")}
    pose = Pose("classic24", np.zeros((4, 2)), given["quads"], 0, "by hand", 1.0, ())
    means = measure_patches(
        photos["photo"], pose, white=photos["white"], dark=photos["dark"], lens_shading=given["lens_shading"]
    )
    found: dict[str, Any] = {"black": means.black, "saturation": means.saturation}
    for frame in ("chart", "white", "dark"):
        statistics = getattr(means, frame)
        for name in FrameMeans.__annotations__:
            found[f"{frame}_{name}"] = None if statistics is None else getattr(statistics, name)
    return found


def _signals(given: dict[str, Any]) -> dict[str, Any]:
    table = _table(np.ones((given["patches"], 681)), 0.03, given["white"])
    signals = normalise([_means(shot) for shot in given["shots"]], table)
    return {
        "signals": signals.values,
        "standard_error": signals.standard_error,
        "used": signals.used.tolist(),
        "assumptions": [assumption.code for assumption in signals.assumptions],
    }


def _verdict(given: dict[str, Any]) -> dict[str, Any]:
    """The stage `verdict`: `camssf.verdict.judge.judge`, and the values that its rules 1 to 3 used."""
    table = replace(_table(given["reflectance"], 0.0, 18), tolerance=given["chart_tolerance"])
    used = np.array(given["used"], bool)
    signals = Signals(
        given["signals"], given["standard_error"], given["white"], given["white"], given["dark"], used,
        np.array(given["white_is_patch"], bool), (),
    )  # fmt: skip
    lamps = [
        Lamp("golden", values, float(tolerance), modes, "golden/spectra")
        for values, tolerance, modes in zip(given["lamp"], given["lamp_tolerance"], given["lamp_modes"], strict=True)
    ]
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    poses = [
        Pose("classic24", square, centres[:, None] + square, 0, "by hand", 1.0, ()) for centres in given["centres"]
    ]
    rho = np.ravel(given["white_reflectance"])

    choice = tuple(
        Hypothesis(basis, scale, 0.0, probability) for basis, scale, probability in given.get("choice", ())
    )
    basis = max(choice, key=lambda weight: weight.probability).basis if choice else "golden"

    variance = given.get("code_variance")
    spread = None if variance is None else np.diag(np.array(variance, float))

    def answer(curves: Floats, code: Floats, predicted: Floats, std: Floats | None) -> Ssf:
        return Ssf(
            curves, std, code, spread, predicted, np.zeros(3), np.zeros(1), np.zeros(1, np.int64), None, np.zeros(3),
            1.0, np.ones(3), basis, "golden", given["lamp"], choice=choice,
        )  # fmt: skip

    ssf = answer(given["ssf"], given["code"], given["predicted"], given["ssf_std"])
    alone = [answer(resolve(a["ssf"]), resolve(a["code"]), resolve(a["predicted"]), ssf.std) for a in given["alone"]]
    rivals = [Rival(shot, name, gain) for shot, name, gain in given["rivals"]]
    neutrals = [[Neutral(resolve(light)[0], np.array(white)) for light, white in told] for told in given["neutrals"]]
    shots = [_means(shot) for shot in given["shots"]]
    gains = None
    if "gain_modes" in given:
        gains = np.array(given["gain_modes"], float), float(given["gain_own"])
    inputs = VerdictInputs(signals, table, shots, poses, lamps, rho, given["white_tolerance"], gains)
    verdict = judge_capture(inputs, ssf, rivals=rivals, neutrals=neutrals, alone=alone, family=given.get("family"),
                            unnamed=[given.get("unnamed", False)] * len(shots))  # fmt: skip
    joint = inputs.goodness_of_fit(ssf)
    each = [inputs.goodness_of_fit_of_shot(j, shot_answer(a, j)) for j, a in enumerate(alone or [ssf] * len(shots))]
    found = [best_explanation(one) for one in each]
    return {
        "status": verdict.status,
        "codes": [reason.code for reason in verdict.reasons],
        "messages": [reason.message for reason in verdict.reasons],
        "advice": [reason.advice for reason in verdict.reasons],
        "fatal": [isinstance(reason, Fatal) for reason in verdict.reasons],
        "values": [float(reason.value or 0.0) for reason in verdict.reasons] or None,
        "thresholds": [float(reason.threshold or 0.0) for reason in verdict.reasons] or None,
        "checks": [f"{check.name} {check.beyond} {check.shot or 'whole'}" for check in verdict.checks],
        "checked": np.array([[check.value, check.limit, check.refuses or 0.0] for check in verdict.checks]),
        "named": [None if s is None else s.kind if s.patch is None else f"{s.kind} {s.patch}" for s in found],
        "residual": joint.residual,
        "prior": joint.prior,
        "count": joint.count,
        "z": np.array([joint.z, *(one.z for one in each)]),
        "gains": np.array([suspect.gain for one in each for suspect in one.explanations]),
    }


def _capture(given: dict[str, Any], engine: str) -> tuple[Capture, Options]:
    """A capture made from patch statistics, and the options to solve it."""
    table = _table(given["reflectance"], given["chart_tolerance"], given["white"])
    square = 100.0 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    places = np.array([[100.0 * (i % 6), 100.0 * (i // 6)] for i in range(24)])
    corners = square * np.array([6.0, 4.0])
    pose = Pose("classic24", corners, places[:, None, :] + square, 0, "by hand", 1.0, ())
    photo = Photo(
        "golden", 600, 400, 1, None, None, False, given.get("make", "golden"), given.get("model", "golden"), ""
    )
    unnamed = given.get("unnamed", ())
    shots = tuple(
        Shot(
            Unnamed() if j in unnamed else Lamp("golden", values, float(tolerance), modes, "golden/spectra"),
            photo,
            photo if shot["white"] else None,
            photo if shot["dark"] else None,
            pose,
            _means(shot),
            None,
        )
        for j, (shot, values, tolerance, modes) in enumerate(
            zip(given["shots"], given["lamp"], given["lamp_tolerance"], given["lamp_modes"], strict=True), 1
        )
    )
    options = Options(
        basis=given["basis"],
        nonnegative=given["nonnegative"],
        l2=given["l2"],
        gamma=given["gamma"],
        engine=engine,
        light_per_patch=given.get("light_per_patch"),
    )
    return Capture(shots, table, given["white_reflectance"]), options


def _colour(given: dict[str, Any]) -> dict[str, Any]:
    """The stage `colour`: `camssf.colour.standard_colour` of a result; `reach` has only distances above REACH."""
    camera = camera_of_result(_result(given["result"]))
    told = given["reference"]
    reference = Reference(told["tolerance"], None if told["raw"] is None else np.array(told["raw"]), told["error"])
    found = standard_colour(
        camera,
        given["lamp"],
        given["signals"],
        given["standard_error"],
        reference=reference,
        view=View(**given["view"]),
    )
    far = found.reach > REACH
    return {
        **{name: getattr(found, name) for name in ("xyz", "lab", "xyz_covariance", "lab_covariance", "white")},
        "parts": np.stack([np.sqrt(np.diagonal(found.parts[name][1], axis1=1, axis2=2)) for name in PARTS]),
        "lamps": [name for name, _ in found.lamps],
        "weights": np.array([weight for _, weight in found.lamps]),
        "kinds": [transform.kind for transform in found.transforms],
        "surprise": found.surprise,
        "far": far.tolist(),
        "reach": found.reach[far] if far.any() else None,
    }


def _result(given: Json) -> Json:
    """A result, or that of another case with some fields replaced."""
    return sibling(given["case"])["inputs"]["result"] | given.get("but", {}) if "case" in given else given


def _regions(given: dict[str, Any]) -> dict[str, Any]:
    photo, dark = (None if given[role] is None else _read(given[role]) for role in ("photo", "dark"))
    assert photo is not None
    found = measure_regions(photo, given["areas"], dark=dark, lens_shading=given["lens_shading"])
    return {"raw": np.stack([each.raw for each in found]), "standard_error": np.stack([each.error for each in found])}


def _rivals(given: dict[str, Any]) -> dict[str, Any]:
    """The stage `rivals`: `camssf.verdict.rival_lamps.weigh_rivals`, the gain of every lamp for each shot."""
    capture, options = _capture(given, "reference")
    fit = prepare_fit(capture, options)
    found = weigh_rivals(fit, fit.solve(fit.signals.used, options.gamma))
    return {"gains": np.array([rival.gain for rival in found]).reshape(len(capture.shots), -1)}


def _calibrate(given: dict[str, Any], engine: str) -> dict[str, Any]:
    """The stage `calibrate`: `camssf.calibration.solve` from patch statistics, as a phone does after measuring."""
    capture, options = _capture(given, engine)
    done = calibrate_capture(capture, options=options)
    curves, std = done.ssf.peak()
    return {
        "signals": done.signals.values,
        "used": done.signals.used.tolist(),
        "ssf": curves,
        "ssf_std": std,
        "predicted": done.ssf.predicted,
        "gap": done.ssf.gap,
        "channel_gain": done.ssf.channel_gain,
        "rmsre_percent": done.scores.rmsre_percent,
        "codes": [reason.code for reason in done.verdict.reasons],
    }


def _light(given: dict[str, Any], engine: str) -> dict[str, Any]:
    """The stage `light`: curves and light for unnamed lamps, and the verdict, even if it refuses."""
    capture, options = _capture(given, engine)
    free_fit = prepare_fit(capture, options)
    ssf = free_fit.solve(free_fit.signals.used, options.gamma)
    fit = free_fit.conditioned_on(ssf)
    verdict = weigh(free_fit, ssf, fit.solve_alone())
    scores = score(fit, ssf, cross_validate(fit, ssf, fit.bands(free_fit.signals.used, ssf)), None)
    curves, std = ssf.peak()
    assert std is not None
    lights = [light for light in ssf.lights if light is not None]
    return {
        "weighed": [[weight.basis, weight.prior_scale, *weight.kinds] for weight in ssf.choice],
        "log_evidence": np.array([weight.log_evidence for weight in ssf.choice]),
        "probability": np.array([weight.probability for weight in ssf.choice]),
        "basis": ssf.basis,
        "prior_scale": ssf.prior_scale,
        "likeliest": list(ssf.kinds),
        "ssf": curves[::10],
        "ssf_std": std[::10],
        "predicted": ssf.predicted,
        "gap": ssf.gap,
        "rmsre_percent": scores.rmsre_percent,
        "kinds": np.array([list(light.kinds.values()) for light in lights]),
        "power": np.stack([light.power[::10] for light in lights]),
        "power_std": np.stack([light.std[::10] for light in lights]),
        "kelvin": np.array([light.kelvin for light in lights]),
        "kelvin_std": np.array([light.kelvin_std for light in lights]),
        "status": verdict.status,
        "codes": [reason.code for reason in verdict.reasons],
        "messages": [reason.message for reason in verdict.reasons],
        "values": np.array([float(reason.value or 0.0) for reason in verdict.reasons]) if verdict.reasons else None,
        "thresholds": np.array([float(reason.threshold or 0.0) for reason in verdict.reasons])
        if verdict.reasons
        else None,
        "said": [each.message for each in assume(capture, ssf, fit.level(ssf)) if each.code == "lamp"],
    }


def _table(values: Floats, tolerance: float, white: int) -> ChartTable:
    names = tuple(f"patch {i + 1}" for i in range(len(values)))
    return ChartTable(
        "classic24", "golden", "classic24", names, values, np.full(len(values), tolerance), white, "golden/spectra"
    )


def _means(shot: Json) -> PatchMeans:
    black, saturation = np.array(shot["black"], float), float(shot["saturation"])
    frames = [_frame(shot[name]) for name in ("chart", "white", "dark")]
    assert frames[0] is not None
    return PatchMeans(frames[0], frames[1], frames[2], black, saturation)


def _frame(frame: Json | None) -> FrameMeans | None:
    if frame is None:
        return None
    mean, error, clipped = (resolve(frame[key]) for key in ("mean", "standard_error", "clipped"))
    still = np.zeros_like(mean)
    count = np.array(frame.get("count", np.full(mean.shape, 400)), np.int64)
    dead, greens = (np.array(frame.get(key, other)) for key, other in (("dead", still), ("greens", mean[:, [1, 1]])))
    return FrameMeans(mean, error, count, clipped, dead, still, greens)
