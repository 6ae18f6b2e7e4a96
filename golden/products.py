"""The package's products from a case's inputs: observation, rows, capture, statistics, photo."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from camssf.grid import WAVELENGTHS, Floats
from camssf.options import Options
from camssf.photo.capture import Capture, MeasuredShot, Photo
from camssf.photo.find.pose import Pose
from camssf.photo.neighbours import SampleNoise
from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.photon_noise import Estimate
from camssf.photo.read.colour_matrix import ColourMatrix
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.photo.shot import Shot
from camssf.recovery.basis import LEARNED, read_basis, widened
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import load_model
from camssf.recovery.sensitivity import FamilyTest, Hypothesis, Proof, SolverSettings, Ssf, half_width_of, prior_std
from camssf.spectra import ChartTable, Lamp, Light, read_chart
from camssf.spectra.layouts import LAYOUTS
from camssf.verdict.reasons import Verdict
from golden.compare import optimality
from golden.contract import Call, words
from golden.forms import ROOT, Json, resolve
from golden.linear_model import LinearModel, linear_model

CALL = words(
    "basis reflectance chart_tolerance white_reflectance white_tolerance lamp lamp_tolerance lamp_modes chart white "
    "dark standard_error l2 gamma nonnegative"
)
CAPTURE = CALL - words("white_tolerance chart dark standard_error") | {"shots"}
"""Inputs of a model's call, and of a capture."""


def build_observation(given: dict[str, Any], signals: Any, frames: Any = None) -> Observation:
    """The observation of a case."""
    named = CALL & Observation.__annotations__.keys()
    gains = {"gain_modes": given.get("gain_modes", np.zeros((0, 0))), "gain_own": given.get("gain_own", 0.0)}
    return Observation(signals=signals, frames=frames, **gains, **{name: given[name] for name in named})


def build_rows(given: dict[str, Any]) -> LinearModel:
    """The reference's rows and covariance of a model's call, from raw patch means."""
    basis = widened(read_basis(given["basis"]), given.get("prior_scale", 1.0))
    return linear_model(build_observation(given, raw_signals(given)), basis)


def model_inputs(given: dict[str, Any]) -> dict[str, Floats]:
    """All inputs of the model from a case's inputs; a mode of zeros if there is none, as the model needs one."""
    k, n, _ = np.shape(given["chart"])
    none = {"lamp_modes": np.zeros((k, 1, WAVELENGTHS.size)), "gain_modes": np.zeros((k, 1, n)), "gain_own": 0.0}
    none |= {"prior_scale": 1.0, "explain": 1.0}
    arguments = none | {name: value for name, value in given.items() if np.size(value)}
    model = load_model(given["basis"])
    names = {each.name for each in model.session.get_inputs()} - {"solve", *model.arrays}
    return {name: np.asarray(arguments[name], float) for name in sorted(names)}


def objective_of(given: dict[str, Any], code: Floats) -> Floats:
    """(p,) objective of a code (r, 3), recomputed without its solver."""
    rows = build_rows(given)
    codes = code.T.reshape(len(rows.matrix), -1)
    return np.array([
        optimality(A, b, S, x, given["l2"], given["gamma"], given["nonnegative"])[0]
        for A, b, S, x in zip(rows.matrix, rows.target, rows.covariance, codes, strict=True)
    ])  # fmt: skip


def raw_signals(given: dict[str, Any]) -> Floats:
    """(k, n, 3) signals from raw patch means, Eq. (5)."""
    signals: Floats = (given["chart"] - given["dark"]) / (given["white"] - given["dark"])
    return signals


def settings_of(call: Call) -> SolverSettings:
    """How the case wants its problems solved."""
    given = call.given
    return SolverSettings(l2=given["l2"], gamma=given["gamma"], nonnegative=given["nonnegative"], engine=call.engine)


def chosen(ssf: Ssf) -> dict[str, Any]:
    """What was weighed, and the answer: curves and bands on the 5-nm nodes, at peak 1."""
    curves, std = ssf.peak()
    assert std is not None
    return {
        "log_evidence": np.array([weight.log_evidence for weight in ssf.choice]),
        "probability": np.array([weight.probability for weight in ssf.choice]),
        "ssf": curves[::10],
        "ssf_std": std[::10],
        "gap": ssf.proof.gap,
        **{name: getattr(ssf, name) for name in ("basis", "prior_scale", "chart_fading", "predicted")},
    }


def judgement(verdict: Verdict) -> dict[str, Any]:
    """Status and reasons of a verdict."""
    reasons = verdict.reasons
    return {
        "status": verdict.status,
        "codes": [reason.code for reason in reasons],
        "messages": [reason.message for reason in reasons],
        "advice": [reason.advice for reason in reasons],
        "values": [float(reason.value or 0.0) for reason in reasons] or None,
        "thresholds": [float(reason.threshold or 0.0) for reason in reasons] or None,
    }


def pose_by_hand(quads: Floats, corners: Floats | None = None) -> Pose:
    """A pose with the patches (n, 4, 2) of a classic chart."""
    return Pose(
        layout="classic24", corners=np.zeros((4, 2)) if corners is None else corners, patches=quads, quarter_turns=0,
        method="by hand", score=1.0, notes=(),
    )  # fmt: skip


def build_answer(given: dict[str, Any], solution: dict[str, Any]) -> Ssf:
    """An answer with the curves, code and predictions of a solution, and all else as the case says."""
    choice = tuple(
        Hypothesis(basis=basis, log_evidence=0.0, probability=probability)
        for basis, probability in given.get("choice", ())
    )
    basis = max(choice, key=lambda weight: weight.probability).basis if choice else given.get("basis", "golden")
    std, size = given["ssf_std"], solution["code"].size
    return Ssf(
        basis=basis, engine="golden", l2=1.0, gamma=np.zeros(3),
        values=solution["ssf"], code=solution["code"], predicted=solution["predicted"],
        proof=Proof(gap=np.zeros(3), layers_gap=np.zeros(1), finish_steps=np.zeros(1, np.int64)),
        lamp=given["lamp"], gain_code=np.zeros((1, 0)), channel_gain=np.ones(3), std=std,
        code_covariance=None if std is None else np.diag(np.array(given.get("code_variance", np.ones(size)), float)),
        log_evidence=None if std is None else 0.0,
        half_width_without_photo=half_width_of(prior_std(read_basis(basis))) if basis in LEARNED else None,
        chart_fading=given.get("chart_fading", 0.0),
        family_test=FamilyTest(*given["family_test"]) if "family_test" in given else None,
        choice=choice,
    )  # fmt: skip


PHOTO = Photo(
    name="golden", width=600, height=400, orientation=1, exposure=None, iso=None, gain_map=False, make="golden",
    model="golden", sha256="0" * 64,
)  # fmt: skip


def build_capture(given: dict[str, Any], engine: str) -> tuple[Capture, Options]:
    """A capture made from patch statistics, and the options to solve it."""
    table = build_table(given["reflectance"], given["chart_tolerance"], given["white"], given.get("table", PRIVATE))
    square = 100.0 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    places = np.array([[100.0 * (i % 6), 100.0 * (i // 6)] for i in range(24)])
    pose = pose_by_hand(places[:, None, :] + square, square * np.array([6.0, 4.0]))
    named = {name: given[name] for name in ("make", "model") if name in given}
    shots = []
    for j, shot in enumerate(given["shots"]):
        chart, white, dark = (replace(PHOTO, **named, sha256=f"{number}{j:063}") for number in (1, 2, 3))
        stated = given["colour_matrices"][j] if "colour_matrices" in given else []
        matrices = tuple(ColourMatrix(matrix["light"], tuple(matrix["values"])) for matrix in stated)
        shots.append(
            MeasuredShot(
                lamp=_light(given, j), photo=replace(chart, colour_matrices=matrices),
                white=white if shot["white"] else None, dark=dark if shot["dark"] else None,
                pose=pose, means=build_means(shot), thumbnail=None,
            )
        )  # fmt: skip
    names = ("basis", "nonnegative", "l2", "gamma")
    options = Options(**{name: given[name] for name in names}, engine=engine,
                      light_per_patch=given.get("light_per_patch"))  # fmt: skip
    return Capture(shots=tuple(shots), chart=table, white_reflectance=given["white_reflectance"]), options


def _light(given: dict[str, Any], j: int) -> Light:
    """The light of a shot: unnamed, the torch, a name (with its tolerance, `D55,2%`), or a lamp of the case."""
    name, _, tolerance = (given["lights"][j] if "lights" in given else "").partition(",")
    if name:
        return Shot("golden.dng", name, lamp_tolerance=tolerance or None).light()
    return build_lamp(given["lamp"][j], given["lamp_tolerance"][j], given["lamp_modes"][j])


def build_lamp(values: Floats, tolerance: float, modes: Floats) -> Lamp:
    """A lamp of a case."""
    return Lamp(name="golden", values=values, tolerance=float(tolerance), modes=modes, source="golden/spectra")


PRIVATE = "golden"
"""The name of a table that is not public, and so has no others beside it."""


def build_table(values: Floats, tolerance: float, white: int, table: str = PRIVATE) -> ChartTable:
    """The classic chart with these reflectances, which are those of this table."""
    names = tuple(f"patch {i + 1}" for i in range(len(values)))
    return ChartTable(
        name="classic24", table=table, layout=LAYOUTS["classic24"], patches=names,
        wavelengths=WAVELENGTHS, reflectance=values,
        tolerance=np.full(len(values), tolerance), white=white, source="golden/spectra",
    )  # fmt: skip


def build_means(shot: Json) -> PatchMeans:
    """The statistics of a shot."""
    black, saturation = np.array(shot["black"], float), float(shot["saturation"])
    frames = [_frame(shot[name]) for name in ("chart", "white", "dark")]
    assert frames[0] is not None
    noise = _noise(shot["noise"]) if "noise" in shot else None
    return PatchMeans(frames[0], frames[1], frames[2], black=black, saturation=saturation, noise=noise)


def _noise(noise: Json) -> SampleNoise:
    unlike, like = (noise[name] and Estimate(*noise[name]) for name in ("unlike", "like"))
    return SampleNoise(step=noise["step"], unlike=unlike, like=like)


def _frame(frame: Json | None) -> FrameMeans | None:
    if frame is None:
        return None
    mean, error, clipped = (resolve(frame[key]) for key in ("mean", "standard_error", "clipped"))
    still = np.zeros_like(mean)
    count = np.array(frame.get("count", np.full(mean.shape, 400)), np.int64)
    dead, greens = (np.array(frame.get(key, other)) for key, other in (("dead", still), ("greens", mean[:, [1, 1]])))
    return FrameMeans(
        mean=mean, standard_error=error, count=count, clipped=clipped, dead=dead, gradient=still, greens=greens
    )


def read_photo(name: str) -> Mosaic:
    """A photo of golden/dng."""
    return read_dng(ROOT / "dng" / name)


def read_card(card: Json) -> ChartTable:
    """The table of the inputs `layout` and `csv`, read from files."""
    with TemporaryDirectory() as folder:
        layout, table = Path(folder, "card.json"), Path(folder, "card.csv")
        layout.write_text(json.dumps(card["layout"]))
        table.write_text(card["csv"])
        return read_chart(f"{layout}:{table}")
