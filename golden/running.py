"""Run a case through camssf, by either engine, and hold the result to the case's limits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from camssf.basis import Basis, gaussian_basis, read_basis
from camssf.calibrate import solve as calibrate_capture
from camssf.capture import Capture, Photo, Shot
from camssf.chart import Pose
from camssf.engine import load_model
from camssf.errors import CalibrationError
from camssf.grid import Floats
from camssf.patches import FrameMeans, PatchMeans
from camssf.sensing import Sensing, sense
from camssf.signals import normalise
from camssf.spectra import ChartTable, Lamp
from camssf.ssf import recover
from camssf.unrolled import solve
from golden.compare import METRICS, optimality
from golden.reading import CAPABILITIES, Json, resolve

ENGINES = ("reference", "onnx")
BY_MODEL = ("ssf", "calibrate")
"""Stages that the ONNX model can run; the others are the reference's own steps."""


class Finding(NamedTuple):
    """One limit and what was measured; `skipped` names the capability that the runner lacks."""

    limit: str
    measured: float
    bound: float
    skipped: str = ""

    @property
    def holds(self) -> bool:
        """True where the measured number keeps the bound; a NaN keeps none."""
        return bool(self.skipped) or bool(self.measured <= self.bound)


def basis_of(spec: Any) -> Basis:
    """A shipped basis by name, or Gaussians by {count, width}."""
    return read_basis(spec) if isinstance(spec, str) else gaussian_basis(spec["count"], spec["width"])


def arrays(case: Json) -> dict[str, Any]:
    """The case's inputs with every form resolved."""
    plain = ("basis", "shots")
    return {key: value if key in plain else resolve(value) for key, value in case["inputs"].items()}


def run(case: Json, engine: str = "reference") -> dict[str, Any]:
    """The outputs of a case.

    Raises:
        CalibrationError: what an error case expects.
    """
    given = arrays(case)
    stages = {
        "signals": _signals,
        "sensing": _sensing,
        "weights": _weights,
        "solve": _solve,
    }
    if case["stage"] in stages:
        return stages[case["stage"]](given)
    if case["stage"] == "calibrate":
        return _calibrate(given, engine)
    return _ssf(given, engine, case["expect"] == "success")


def findings(case: Json, engine: str = "reference", capabilities: tuple[str, ...] = CAPABILITIES) -> list[Finding]:
    """Every limit of the case, measured; for an error case whether the code is the expected one."""
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


def judge(case: Json, outputs: dict[str, Any], capabilities: tuple[str, ...] = CAPABILITIES) -> list[Finding]:
    """Hold outputs to the limits."""
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


def problem(case: Json) -> Sensing:
    """A, b and Σ of a case that has a convex problem in it: stages weights, solve, ssf."""
    given = arrays(case)
    if case["stage"] != "ssf":
        return Sensing(given["matrix"], given["target"], given["covariance"])
    signals = (given["chart"] - given["dark"]) / (given["white"] - given["dark"])
    return _rows(given, signals)


def _complete(case: Json, outputs: dict[str, Any]) -> list[Finding]:
    """What is null in the file is absent in the answer: no band without a prior."""
    return [
        Finding(f"{name} is absent", float(outputs[name] is not None and not np.isnan(outputs[name]).all()), 0.0)
        for name, value in case["outputs"].items()
        if value is None
    ]


def _rows(given: dict[str, Any], signals: Floats) -> Sensing:
    return sense(
        signals,
        given["standard_error"],
        given["reflectance"],
        given["lamp"],
        basis_of(given["basis"]),
        chart_tolerance=given["chart_tolerance"],
        white_reflectance=given["white_reflectance"],
        white_tolerance=given["white_tolerance"],
        lamp_tolerance=given["lamp_tolerance"],
        lamp_modes=given["lamp_modes"],
    )


def _sensing(given: dict[str, Any]) -> dict[str, Any]:
    return dict(vars(_rows(given, given["signals"])))


def _weights(given: dict[str, Any]) -> dict[str, Any]:
    """ρ = γ + 2 λ₂ and W = (H + λ₂ I + ρ I)⁻¹; z after each of the depths."""
    sensing = Sensing(given["matrix"], given["target"], given["covariance"])
    l2, gamma, nonnegative = given["l2"], given["gamma"], given["nonnegative"]
    codes = [solve(sensing, l2, gamma, nonnegative=nonnegative, depth=int(d), finish=0) for d in given["depths"]]
    rho = gamma + 2.0 * l2
    eye = np.eye(sensing.matrix.shape[2])
    W = np.linalg.inv(codes[0].precision + (l2 + rho)[:, None, None] * eye)
    return {"rho": rho, "W": W, "z": np.stack([code.values for code in codes])}


def _solve(given: dict[str, Any]) -> dict[str, Any]:
    sensing = Sensing(given["matrix"], given["target"], given["covariance"])
    more = {} if given["depth"] is None else {"depth": given["depth"]}
    code = solve(
        sensing, given["l2"], given["gamma"], nonnegative=given["nonnegative"], finish=given["finish"], **more
    )
    return {"code": code.values, "objective": code.objective, "gap": code.gap, "pivots": code.pivots}


def _ssf(given: dict[str, Any], engine: str, sound: bool) -> dict[str, Any]:
    """By the model's own contract; cases that expect an error go through `recover`, which checks its arguments."""
    frames = [given[name] for name in ("chart", "white", "dark")]
    with np.errstate(divide="ignore", invalid="ignore"):
        signals = [(np.array(c, float) - d) / (np.array(w, float) - d) for c, w, d in zip(*frames, strict=True)]
    if engine == "onnx" and sound:
        names = load_model(given["basis"]).session.get_inputs()
        fed = {i.name: given[i.name] for i in names if i.name != "nonnegative"}
        if not fed["lamp_modes"].shape[1]:
            fed["lamp_modes"] = np.zeros((len(frames[0]), 1, fed["lamp"].shape[1]))
        found: dict[str, Any] = dict(
            load_model(given["basis"]).run(fed | {"nonnegative": np.array(float(given["nonnegative"]))})
        )
    else:
        ssf = recover(
            signals,
            given["reflectance"],
            given["lamp"],
            standard_error=given["standard_error"],
            chart_tolerance=given["chart_tolerance"],
            white_reflectance=given["white_reflectance"],
            white_tolerance=given["white_tolerance"],
            lamp_tolerance=given["lamp_tolerance"],
            lamp_modes=given["lamp_modes"],
            basis=given["basis"],
            l2=given["l2"],
            gamma=given["gamma"],
            nonnegative=given["nonnegative"],
            frames=None if not sound else tuple(frames),
            engine=engine,
        )
        found = {
            "ssf": ssf.values,
            "ssf_std": ssf.std,
            "code": ssf.code,
            "signals": np.stack(signals),
            "predicted": ssf.predicted,
            "gap": ssf.gap,
            "channel_gain": ssf.channel_gain,
        }
    rows = _rows(given, np.stack(signals))
    proofs = [
        optimality(A, b, S, x, given["l2"], given["gamma"], given["nonnegative"])
        for A, b, S, x in zip(rows.matrix, rows.target, rows.covariance, found["code"].T, strict=True)
    ]
    return found | {"objective": np.array([objective for objective, _ in proofs])}


def _signals(given: dict[str, Any]) -> dict[str, Any]:
    table = _table(np.ones((given["patches"], 681)), 0.03, given["white"])
    signals = normalise([_means(shot) for shot in given["shots"]], table)
    return {
        "signals": signals.values,
        "standard_error": signals.standard_error,
        "used": signals.used.tolist(),
        "assumptions": [assumption.code for assumption in signals.assumptions],
    }


def _calibrate(given: dict[str, Any], engine: str) -> dict[str, Any]:
    """`camssf.calibrate.solve`, from patch statistics on: what a phone does after measuring."""
    table = _table(given["reflectance"], given["chart_tolerance"], given["white"])
    square = 100.0 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    places = np.array([[100.0 * (i % 6), 100.0 * (i // 6)] for i in range(24)])
    corners = square * np.array([6.0, 4.0])
    pose = Pose("classic24", corners, places[:, None, :] + square, 0, "by hand", 1.0, ())
    photo = Photo("golden", 600, 400, 1, None, None, False, "golden", "golden", "")
    shots = tuple(
        Shot(
            Lamp("golden", values, float(tolerance), modes, "golden/spectra"),
            photo,
            photo if shot["white"] else None,
            photo if shot["dark"] else None,
            pose,
            _means(shot),
            None,
        )
        for shot, values, tolerance, modes in zip(
            given["shots"], given["lamp"], given["lamp_tolerance"], given["lamp_modes"], strict=True
        )
    )
    done = calibrate_capture(
        Capture(shots, table, given["white_reflectance"]),
        basis=given["basis"],
        nonnegative=given["nonnegative"],
        l2=given["l2"],
        gamma=given["gamma"],
        engine=engine,
    )
    curves, std = done.ssf.peak()
    return {
        "signals": done.signals.values,
        "used": done.signals.used.tolist(),
        "ssf": curves,
        "ssf_std": std,
        "predicted": done.ssf.predicted,
        "gap": done.ssf.gap,
        "channel_gain": done.ssf.channel_gain,
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
    return FrameMeans(mean, error, np.full(mean.shape, 400), clipped, still, still, mean[:, [1, 1]])
