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
from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.read.colour_matrix import ColourMatrix
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.photo.shot import Shot
from camssf.recovery.basis import Basis, gaussian_basis, read_basis, widened
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import Model
from camssf.spectra import ChartTable, Lamp, Light, read_chart
from camssf.spectra.lamps import AUTO, TORCH
from camssf.spectra.layouts import LAYOUTS
from camssf.spectra.lights import unnamed_light
from golden.compare import optimality
from golden.contract import words
from golden.forms import Json, dng, resolve
from golden.linear_model import LinearModel, linear_model

ROWS = words("basis reflectance chart_tolerance white_reflectance white_tolerance lamp lamp_tolerance lamp_modes")
CALL = ROWS | words("chart white dark standard_error l2 gamma nonnegative")
CAPTURE = words(
    "shots reflectance chart_tolerance white lamp lamp_tolerance lamp_modes white_reflectance basis l2 gamma "
    "nonnegative"
)
"""Inputs of rows, of a model's call, and of a capture."""


def basis_of(spec: Any) -> Basis:
    """A shipped basis by name, or a Gaussian basis by {count, width}."""
    return read_basis(spec) if isinstance(spec, str) else gaussian_basis(spec["count"], spec["width"])


def build_observation(given: dict[str, Any], signals: Any, frames: Any = None) -> Observation:
    """The observation of a case; the signals may be ragged in an error case."""
    return Observation(
        signals=signals,
        reflectance=given["reflectance"],
        lamp=given["lamp"],
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


def build_rows(given: dict[str, Any], signals: Floats) -> LinearModel:
    """The reference's rows and covariance."""
    return linear_model(build_observation(given, signals), widened(basis_of(given["basis"]), prior_scale(given)))


def problem_of_call(given: dict[str, Any]) -> LinearModel:
    """The rows of a model's call, from raw patch means."""
    return build_rows(given, (given["chart"] - given["dark"]) / (given["white"] - given["dark"]))


def prior_scale(given: dict[str, Any]) -> float:
    """The width of the prior; 1 if the case does not give it."""
    return float(given.get("prior_scale", 1.0))


def model_inputs(model: Model, given: dict[str, Any]) -> dict[str, Floats]:
    """All inputs of the model from a case's inputs; a mode of zeros if there is none, as the model needs one."""
    k, n, _ = np.shape(given["chart"])
    none = {"lamp_modes": np.zeros((k, 1, WAVELENGTHS.size)), "gain_modes": np.zeros((k, 1, n)), "gain_own": 0.0}
    none |= {"prior_scale": prior_scale(given), "explain": 1.0}
    arguments = none | {name: value for name, value in given.items() if np.size(value)}
    names = {each.name for each in model.session.get_inputs()} - {"solve", *model.arrays}
    return {name: np.asarray(arguments[name], float) for name in sorted(names)}


def objective_of(given: dict[str, Any], rows: LinearModel, code: Floats) -> Floats:
    """(p,) objective of a code (r, 3), recomputed without its solver."""
    return np.array([
        optimality(A, b, S, x, given["l2"], given["gamma"], given["nonnegative"])[0]
        for A, b, S, x in zip(
            rows.matrix, rows.target, rows.covariance, code.T.reshape(len(rows.matrix), -1), strict=True
        )
    ])  # fmt: skip


def build_capture(given: dict[str, Any], engine: str) -> tuple[Capture, Options]:
    """A capture made from patch statistics, and the options to solve it."""
    table = build_table(given["reflectance"], given["chart_tolerance"], given["white"])
    square = 100.0 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    places = np.array([[100.0 * (i % 6), 100.0 * (i // 6)] for i in range(24)])
    corners = square * np.array([6.0, 4.0])
    pose = Pose(
        layout="classic24", corners=corners, patches=places[:, None, :] + square, quarter_turns=0, method="by hand",
        score=1.0, notes=(),
    )  # fmt: skip
    photo = Photo(
        name="golden", width=600, height=400, orientation=1, exposure=None, iso=None, gain_map=False,
        make=given.get("make", "golden"), model=given.get("model", "golden"), sha256="0" * 64,
    )  # fmt: skip
    charts, whites, darks = (
        [replace(photo, sha256=f"{number}{j:063}") for j in range(len(given["shots"]))] for number in (1, 2, 3)
    )
    unnamed = dict.fromkeys(given.get("unnamed", ()), AUTO) | dict.fromkeys(given.get("torch", ()), TORCH)
    names = given.get("called") or [""] * len(given["shots"])
    matrices = given.get("colour_matrices") or [[] for _ in given["shots"]]
    shots = tuple(
        MeasuredShot(
            lamp=unnamed_light(unnamed[j])
            if j in unnamed
            else _told(names[j - 1])
            if names[j - 1]
            else build_lamp(values, tolerance, modes),
            photo=replace(
                charts[j - 1],
                colour_matrices=tuple(ColourMatrix(each["light"], tuple(each["values"])) for each in matrices[j - 1]),
            ),
            white=whites[j - 1] if shot["white"] else None,
            dark=darks[j - 1] if shot["dark"] else None,
            pose=pose,
            means=build_means(shot),
            thumbnail=None,
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
    return Capture(shots=shots, chart=table, white_reflectance=given["white_reflectance"]), options


def build_lamp(values: Floats, tolerance: float, modes: Floats) -> Lamp:
    """A lamp of a case."""
    return Lamp(name="golden", values=values, tolerance=float(tolerance), modes=modes, source="golden/spectra")


def build_table(values: Floats, tolerance: float, white: int) -> ChartTable:
    """The classic chart with these reflectances."""
    names = tuple(f"patch {i + 1}" for i in range(len(values)))
    return ChartTable(
        name="classic24", table="golden", layout=LAYOUTS["classic24"], patches=names,
        wavelengths=WAVELENGTHS, reflectance=values,
        tolerance=np.full(len(values), tolerance), white=white, source="golden/spectra",
    )  # fmt: skip


def build_means(shot: Json) -> PatchMeans:
    """The statistics of a shot."""
    black, saturation = np.array(shot["black"], float), float(shot["saturation"])
    frames = [_frame(shot[name]) for name in ("chart", "white", "dark")]
    assert frames[0] is not None
    return PatchMeans(chart=frames[0], white=frames[1], dark=frames[2], black=black, saturation=saturation)


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
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(dng(name))
        return read_dng(path)


CARD: Json = {
    "format": "camssf-layout/1", "name": "garden card", "columns": 7, "rows": 5, "patch": 8, "gap": 2,
    "white": "p19", "fiducials": [[-10, -10], [78, -10], [78, 58], [-10, 58]],
}  # fmt: skip
"""A layout of the user's own."""


def own_card() -> Json:
    """The inputs `layout` and `csv`: CARD and a table of mixtures of the 24 colours, four decimals."""
    nodes = np.arange(400, 701, 20)
    known = read_chart("classic24").values[:, 2 * (nodes - 380)]
    lines = ["patch," + ",".join(str(node) for node in nodes)]
    for i in range(CARD["columns"] * CARD["rows"]):
        share = (37 * i) % 100 / 100
        mixed = (1 - share) * known[i % 24] + share * known[(7 * i + 5) % 24]
        lines.append(f"p{i + 1}," + ",".join(f"{value:.4f}" for value in mixed))
    return {"layout": CARD, "csv": "\n".join(lines) + "\n"}


def read_card(card: Json) -> ChartTable:
    """The table of the inputs `layout` and `csv`, read from files."""
    with TemporaryDirectory() as folder:
        layout, table = Path(folder, "card.json"), Path(folder, "card.csv")
        layout.write_text(json.dumps(card["layout"]))
        table.write_text(card["csv"])
        return read_chart(f"{layout}:{table}")


def _told(text: str) -> Light:
    """The light that a name stands for, or a name and its tolerance, `D55,2%`."""
    name, _, tolerance = text.partition(",")
    return Shot("golden.dng", name, lamp_tolerance=tolerance or None).light()
