"""The paper's experiments and its rivals: `python -m benchmarks.paper [--jobs 2] [--every 1]`

Cameras: the 52 measured ones and colour-science's two; the paper's own camera is not public. Whatever learns (PCA,
Wiener, the `cameras` basis) sees no camera of the maker it is scored on, and a method with a free number takes the
one that is best on the other makers' cameras under the same lamp and noise. RMSE on peak-normalised curves, 400 to
700 nm, mean of R, G, B; noise σ = ν hypot(y, 0.2) with ν = 0, 0.5 % or 1 %; 12 patches are numbers 7 to 18.

Leaves benchmarks/results/paper.json (everything), docs/paper.json (what the page needs), docs/paper.md (written from
it) and the pictures docs/images/paper-*.png. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from itertools import combinations, islice
from math import comb
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from benchmarks import _paper_captures as captures
from benchmarks._common import CURVES, RESULTS, chart, console, lamp, one_thread, progress, save, table, versions
from benchmarks._paper_figures import draw
from benchmarks._paper_page import page
from benchmarks.accuracy import left_out
from benchmarks.rivals import FIGURE_4, OURS, TABLE_1, Given, method
from benchmarks.rivals.qr import READINGS
from camssf.errors import NotConverged
from camssf.fit.scores import rmsre
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.learning.training import maker_of, read_curves
from camssf.recovery.basis import Basis, gaussian_basis, read_basis
from camssf.recovery.hypotheses import recover
from camssf.recovery.linear_model import LinearModel, anchor, linear_model
from camssf.recovery.observation import Observation
from camssf.recovery.penalties import GAMMA, L2
from camssf.recovery.sensitivity import SolverSettings
from camssf.recovery.solve import solve
from camssf.spectra import colour_science, read_camera, read_chart

SEED = 7
DOCS = Path(__file__).parents[1] / "docs"
CHROMATIC, TWELVE, ALL = slice(0, 18), slice(6, 18), slice(0, 24)
COUNTS = tuple(range(3, 19))
MOST, EACH = 100, 4
"""Combinations of a count of patches; how many of them a camera is shown. Each combination meets a few cameras."""
NOISES = (0.0, 0.005, 0.01)
LAMPS = ("equal-energy", "D55", "A", "LED-B3")
IGNORED = ("D55", "D65", "A", "LED-B3", "LED-V1", "FL2")
ATOMS = (9, 12, 18, 35, 69, 681)
CURVE_CAMERA, CURVE_COUNTS = "Nikon 5100 (NPL)", (9, 12, 15, 18)
PLAIN: dict[str, Any] = {"chart_tolerance": 0.0, "white_tolerance": 0.0}
TOLD: dict[str, Any] = {"chart_tolerance": 0.03, "white_tolerance": 0.01}
Scores: TypeAlias = dict[str, list[float]]
"""Of one camera: what was tried → numbers, one a run or one a weight."""


@dataclass(frozen=True)
class Camera:
    """A measured camera and what may be learned without its maker.

    Attributes:
        name, maker: of the camera.
        curve: (681, 3).
        training: (cameras, 69, 3) of the other makers.
        basis: learned from them.
    """

    name: str
    maker: str
    curve: Floats
    training: Floats
    basis: Basis


@cache
def cameras() -> tuple[Camera, ...]:
    """The 52, then colour-science's two; of Sigma there is no other, so its basis is the shipped one."""
    measured, bases = left_out()
    nodes = read_curves(CURVES)
    known = {name: read_camera(name).values for name in ("Nikon 5100 (NPL)", "Sigma SDMerill (NPL)")}
    makers = {name: maker_of(name) for name in nodes}
    found = []
    for name, curve in (measured | known).items():
        maker = maker_of(name)
        training = np.stack([each for other, each in nodes.items() if makers[other] != maker])
        found.append(Camera(name, maker, curve, training, bases.get(maker, read_basis("cameras"))))
    return tuple(found)


def photograph(
    camera: Camera, seen: Floats, light: Floats, noise: float, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Signals of Eq. (5) (n, 3) and their standard error."""
    y = (seen * light) @ camera.curve / (light @ camera.curve)
    error = noise * np.hypot(y, 0.2)
    return y + error * rng.normal(size=y.shape), error


def score(curves: Floats, camera: Camera) -> float:
    """RMSE of curves divided by their peaks; a curve that is nowhere positive is wrong by the whole truth."""
    visible = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
    peak = curves.max(axis=0)
    shape = np.where(peak > 0, curves / np.where(peak > 0, peak, 1.0), 0.0)
    wrong = (shape - camera.curve / camera.curve.max(axis=0))[visible]
    return float(np.sqrt(np.mean(wrong**2, axis=0)).mean())


def given(camera: Camera, patches: Any, name: str, noise: float, rng: np.random.Generator) -> Given:
    """A capture of some patches under a known lamp."""
    table_, light = chart()[patches], lamp(name)
    y, error = photograph(camera, table_, light, noise, rng)
    return Given(y, error, table_, light, camera.training, camera.basis)


def attempt(name: str, shown: Given, camera: Camera, weight: float = 0.0) -> float:
    """The score of one method; NaN where camssf's solver refuses its own answer."""
    try:
        return score(method(name).estimate(shown, weight), camera)
    except NotConverged:
        return float("nan")


def combinations_of(count: int) -> list[tuple[int, ...]]:
    """All combinations of `count` of the 18 chromatic patches, or 100 of them, seeded."""
    if comb(18, count) <= MOST:
        return list(combinations(range(18), count))
    rng = np.random.default_rng([SEED, count])
    drawn: dict[tuple[int, ...], None] = {}
    while len(drawn) < MOST:
        drawn[tuple(sorted(rng.choice(18, count, replace=False).tolist()))] = None
    return list(islice(drawn, MOST))


# the experiments, each for one camera


def colours(camera: Camera, index: int) -> Scores:
    """Fig. 3a: RMSE against the number of colours."""
    found: Scores = {}
    rng = np.random.default_rng([SEED, 1, index])
    for count in COUNTS:
        known = combinations_of(count)
        mine = sorted({(EACH * index + j) % len(known) for j in range(EACH)})
        for noise in NOISES[:2]:
            for number in mine:
                shown = given(camera, list(known[number]), "D55", noise, rng)
                for name in ("paper", "product"):
                    key = f"{name}|{noise}|{count}"
                    found.setdefault(key, []).append(attempt(name, shown, camera))
    return found


def figure_4(camera: Camera, index: int) -> Scores:
    """Fig. 4: QR, pseudo-inverse, l1; 12 patches, D55."""
    found: Scores = {}
    for noise in NOISES:
        shown = given(camera, TWELVE, "D55", noise, np.random.default_rng([SEED, 2, index]))
        for name in (*FIGURE_4, *OURS):
            if name == "sparse":
                continue
            found[f"{name}|{noise}"] = [attempt(name, shown, camera, w) for w in method(name).WEIGHTS]
    return found


def rivals(camera: Camera, index: int) -> Scores:
    """Table 1's families: noise × lamp, 24 patches."""
    found: Scores = {}
    for j, light in enumerate(LAMPS):
        for noise in NOISES:
            shown = given(camera, ALL, light, noise, np.random.default_rng([SEED, 3, index, j]))
            for name in (*TABLE_1, *OURS):
                found[f"{name}|{noise}|{light}"] = [attempt(name, shown, camera, w) for w in method(name).WEIGHTS]
    return found


def lamps(camera: Camera, index: int) -> Scores:
    """The lamp ignored (the paper's Eq. (5) to (10) as they stand) and known; no noise. RMSE and RMSRE."""
    found: Scores = {}
    others = samples()
    for name in IGNORED:
        light = lamp(name)
        y, error = photograph(camera, chart()[TWELVE], light, 0.0, np.random.default_rng(0))
        truth = (others * light) @ camera.curve / (light @ camera.curve)
        for told in ("known", "ignored"):
            believed = light if told == "known" else np.ones_like(light)
            shown = Given(y, error, chart()[TWELVE], believed, camera.training, camera.basis)
            for rival in ("paper", "product"):
                found[f"{rival}|{told}|{name}"] = [float("nan")] * 2
                try:
                    curves = method(rival).estimate(shown, 0.0)
                except NotConverged:
                    continue
                predicted = (others * believed) @ curves / (believed @ curves)
                wrong = rmsre(truth[None], predicted[None], np.ones((1, len(others)), dtype=bool))
                found[f"{rival}|{told}|{name}"] = [score(curves, camera), float(wrong.mean())]
    return found


def atoms(camera: Camera, index: int) -> Scores:
    """How many Gaussians: 12 patches, D55; one camera in nine, since 681 of them are slow."""
    found: Scores = {}
    if index % 9:
        return found
    for noise in NOISES[:2]:
        shown = given(camera, TWELVE, "D55", noise, np.random.default_rng([SEED, 4, index]))
        for count in ATOMS:
            for weight in method("tuned").WEIGHTS:
                try:
                    answer = recover(
                        Observation(
                            shown.signals, shown.reflectance, shown.lamp, standard_error=shown.standard_error, **PLAIN
                        ),
                        basis=gaussian_basis(count),
                        settings=SolverSettings(gamma=weight, engine="reference"),
                    )
                    value = score(answer.values, camera)
                except NotConverged:
                    value = float("nan")
                found.setdefault(f"{noise}|{count}", []).append(value)
    return found


def charts(camera: Camera, index: int) -> Scores:
    """The chart is Ohta's, the table BabelColor's; one lamp and more. Noise 0.1 %, 24 patches."""
    found: Scores = {}
    rng = np.random.default_rng([SEED, 5, index])
    ohta = read_chart("classic24:ohta").values
    for names in (("D55",), ("D55", "D55"), ("D55", "A"), ("D55", "A", "LED-B3")):
        lights = np.stack([lamp(name) for name in names])
        for table_name, seen in (("same", chart()), ("foreign", ohta)):
            pairs = [photograph(camera, seen, light, 0.001, rng) for light in lights]
            y, error = np.stack([p[0] for p in pairs]), np.stack([p[1] for p in pairs])
            key = f"{table_name}|{' + '.join(names)}"
            told = PLAIN if table_name == "same" else TOLD
            answer = recover(
                Observation(y, chart(), lights, standard_error=error, **told),
                basis=camera.basis,
                settings=SolverSettings(engine="reference"),
            )
            found[f"product|{key}"] = [score(answer.values, camera)]
            found[f"diagonal|{key}"] = [score(_diagonal(y, error, lights, camera.basis, told), camera)]
            if len(names) == 1:
                shown = Given(y[0], error[0], chart(), lights[0], camera.training, camera.basis)
                found[f"paper|{key}"] = [attempt("paper", shown, camera)]
    return found


def _diagonal(y: Floats, error: Floats, lights: Floats, basis: Basis, told: dict[str, Any]) -> Floats:
    """The product's problem with all correlations of the chart's and the white's errors struck out: curves (681, 3).

    Light that drifts between a shot's frames, which any capture has, stays one error a shot.
    """
    k, n, _ = y.shape
    full = linear_model(
        Observation(
            y,
            chart(),
            lights,
            standard_error=error,
            chart_tolerance=np.full(n, told["chart_tolerance"]),
            white_reflectance=np.ones_like(WAVELENGTHS),
            white_tolerance=told["white_tolerance"],
            lamp_tolerance=np.zeros(k),
            lamp_modes=np.zeros((k, 0, WAVELENGTHS.size)),
        ),
        basis,
    )
    shots = full.terms["lamp"]
    loose = LinearModel(full.matrix, full.target, shots + (full.covariance - shots) * np.eye(3 * k * n))
    code = solve(loose, L2, np.array([GAMMA])).values.reshape(3, -1)
    book = anchor(basis, lights[0])
    return np.asarray((book.mean + np.einsum("cmr,cr->cm", book.dictionary, code)).T)


@cache
def samples() -> Floats:
    """(96, 681) reflectances of real surfaces in place of an SG's 96 colours, whose table is not public.

    CIE 224:2017's test colours (colour-science has all 99: paints, textiles, skin, plants, plastics, printed matter),
    without the three darkest. None is a patch of the chart.
    """
    from colour.quality.cfi2017 import load_TCS_CIE2017

    colour = colour_science()
    values = np.asarray(load_TCS_CIE2017(colour.SpectralShape(380, 780, 5)).values).T
    grid = np.arange(380, 785, 5)
    on_grid = np.stack([np.interp(WAVELENGTHS, grid, each) for each in values])
    return on_grid[np.sort(np.argsort(on_grid.mean(axis=1))[3:])]


EXPERIMENTS: dict[str, Callable[[Camera, int], Scores]] = {
    "rivals": rivals,
    "colours": colours,
    "figure_4": figure_4,
    "lamps": lamps,
    "charts": charts,
    "atoms": atoms,
}


def run(experiment: str, index: int) -> Scores:
    """One experiment on one camera: what a process is given to do."""
    return EXPERIMENTS[experiment](cameras()[index], index)


# from cameras to tables


def tuned(runs: dict[int, list[float]]) -> dict[str, Any]:
    """Mean score where each camera's weight is the best of the other makers' cameras; camera → score of each weight.

    NaN is an answer that camssf's solver refused: counted, and left out of the mean.
    """
    makers = {index: cameras()[index].maker for index in runs}
    chosen, picks = [], []
    for index, values in runs.items():
        others = np.array([v for other, v in runs.items() if makers[other] != makers[index]])
        answered = np.isfinite(others)
        mean = np.where(answered, others, 0.0).sum(axis=0) / np.maximum(answered.sum(axis=0), 1)
        picks.append(int(np.argmin(np.where(answered.any(axis=0), mean, np.inf))))
        chosen.append(values[picks[-1]])
    answers = [value for value in chosen if np.isfinite(value)]
    rmse = float(np.mean(answers)) if answers else None
    return {"rmse": rmse, "picks": np.bincount(picks).argmax().item(), "refused": len(chosen) - len(answers)}


def by_key(results: dict[int, Scores]) -> dict[str, dict[int, list[float]]]:
    """Camera → key → numbers turned into key → camera → numbers."""
    found: dict[str, dict[int, list[float]]] = {}
    for index in sorted(results):
        for key, values in results[index].items():
            found.setdefault(key, {})[index] = values
    return found


def gather_colours(results: dict[int, Scores]) -> dict[str, Any]:
    """Mean, spread (a tenth of the runs lie below and above it) by method, noise and count."""
    found: dict[str, Any] = {"counts": list(COUNTS), "combinations": [len(combinations_of(c)) for c in COUNTS]}
    for key, runs in by_key(results).items():
        name, noise, count = key.split("|")
        values = np.concatenate([runs[index] for index in runs])
        refused = int(np.isnan(values).sum())
        values = values[~np.isnan(values)]
        row = found.setdefault(name, {}).setdefault(
            noise, {"mean": [], "low": [], "high": [], "runs": [], "refused": 0}
        )
        assert count == str(COUNTS[len(row["mean"])])
        row["mean"].append(values.mean().item())
        row["low"].append(np.quantile(values, 0.1).item())
        row["high"].append(np.quantile(values, 0.9).item())
        row["runs"].append(len(values))
        row["refused"] += refused
    two = [i for i in results if cameras()[i].name.endswith("(NPL)")]
    for i in two:
        values = [results[i][f"paper|0.0|{count}"] for count in COUNTS]
        found.setdefault("public", {})[cameras()[i].name] = [float(np.nanmean(v)) for v in values]
    return found


def gather_figure_4(results: dict[int, Scores]) -> dict[str, Any]:
    """Rows: method and reading × noise."""
    found: dict[str, Any] = {}
    for key, runs in by_key(results).items():
        name, noise = key.split("|")
        if name in FIGURE_4:
            for j, reading in enumerate(READINGS):
                values = [v[j] for v in runs.values()]
                found.setdefault(f"{method(name).NAME}: {reading}", {})[noise] = float(np.mean(values))
        else:
            found.setdefault(method(name).NAME, {})[noise] = tuned(runs)["rmse"]
    return found


def gather_rivals(results: dict[int, Scores]) -> dict[str, Any]:
    """Method → noise → lamp → RMSE and the weight chosen most often."""
    found: dict[str, Any] = {}
    for key, runs in by_key(results).items():
        name, noise, light = key.split("|")
        row = tuned(runs)
        weights = method(name).WEIGHTS
        cell = {"rmse": row["rmse"]} | ({"weight": weights[row["picks"]]} if len(weights) > 1 else {})
        found.setdefault(method(name).NAME, {}).setdefault(noise, {})[light] = cell
    return found


def gather_lamps(results: dict[int, Scores]) -> dict[str, Any]:
    """Method → known or ignored → lamp → RMSE and RMSRE in %."""
    found: dict[str, Any] = {}
    for key, runs in by_key(results).items():
        name, told, light = key.split("|")
        values = np.array(list(runs.values()))
        answered = np.isfinite(values[:, 0])
        rmse, relative = values[answered].mean(axis=0).tolist()
        cell = {"rmse": rmse, "rmsre_percent": relative, "refused": int((~answered).sum())}
        found.setdefault(method(name).NAME, {}).setdefault(told, {})[light] = cell
    return found


def gather_atoms(results: dict[int, Scores]) -> dict[str, Any]:
    """Noise → atoms → RMSE, with the best γ of the other makers; how many answers were refused."""
    found: dict[str, Any] = {"cameras": sum(bool(scores) for scores in results.values())}
    for key, runs in by_key(results).items():
        noise, count = key.split("|")
        row = tuned(runs)
        found.setdefault(noise, {})[count] = {"rmse": row["rmse"], "refused": row["refused"]}
    return found


def gather_charts(results: dict[int, Scores]) -> dict[str, Any]:
    """Method → table → lamps → RMSE."""
    found: dict[str, Any] = {}
    for key, runs in by_key(results).items():
        name, table_name, names = key.split("|")
        found.setdefault(name, {}).setdefault(table_name, {})[names] = float(np.nanmean(list(runs.values())))
    return found


GATHER: dict[str, Callable[[dict[int, Scores]], dict[str, Any]]] = {
    "colours": gather_colours,
    "figure_4": gather_figure_4,
    "rivals": gather_rivals,
    "lamps": gather_lamps,
    "atoms": gather_atoms,
    "charts": gather_charts,
}


def correlations() -> dict[str, Any]:
    """Fig. 3f: |r| between pairs of reflectances, and how alike the columns of F Ψ are (their mutual coherence)."""
    found: dict[str, Any] = {}
    for label, patches in (("1 to 12", slice(0, 12)), ("7 to 18", TWELVE)):
        for name, table_ in (("BabelColor", chart()), ("Ohta", read_chart("classic24:ohta").values)):
            r = np.corrcoef(table_[patches])
            pairs = np.abs(r[np.triu_indices(12, 1)])
            found[f"{name}, {label}"] = {"mean": float(pairs.mean()), "map": r.tolist()}
    rows = chart()[TWELVE] * STEP
    coherence = {}
    for count in ATOMS:
        columns = rows @ gaussian_basis(count).dictionary[0]
        columns = columns / np.linalg.norm(columns, axis=0)
        alike = np.abs(columns.T @ columns) - np.eye(count)
        coherence[str(count)] = float(1.0 - alike.max())
    return {"tables": found, "coherence_below_1": coherence}


def curves() -> dict[str, Any]:
    """Fig. 3b to e: one public camera, seeded patches, noise 0.5 %."""
    camera = next(each for each in cameras() if each.name == CURVE_CAMERA)
    found: dict[str, Any] = {"camera": camera.name, "truth": camera.curve.tolist(), "panels": {}}
    for count in CURVE_COUNTS:
        patches = combinations_of(count)[0]
        shown = given(camera, list(patches), "D55", 0.005, np.random.default_rng([SEED, 6, count]))
        panel: dict[str, Any] = {"patches": [p + 1 for p in patches]}
        for name in ("paper", "product"):
            values = method(name).estimate(shown, 0.0)
            panel[name] = {"rmse": score(values, camera), "curves": (values / values.max(axis=0)).tolist()}
        found["panels"][str(count)] = panel
    return found


def phone(index: int) -> dict[str, Any]:
    """Sec. 5 for one of the phones."""
    camera = cameras()[index]
    return captures.phone(camera.name, camera.curve, camera.basis, samples(), SEED * 100 + index)


def spectrograph(index: int, light: str) -> dict[str, Any]:
    """Sec. 4 for one camera."""
    camera = cameras()[index]
    return captures.spectrograph(camera.name, camera.curve, light, SEED * 1000 + index)


def gather_direct(runs: dict[tuple[int, str], dict[str, Any]]) -> dict[str, Any]:
    """Means and worst cases by light."""
    found: dict[str, Any] = {}
    for light in ("AM1.5", "daylight"):
        mine = [run for (_, name), run in runs.items() if name == light and "rmse" in run]
        asked = sum(name == light for _, name in runs)
        errors = np.array([run["rmse"] for run in mine])
        found[light] = {
            "cameras": len(mine),
            "refused": asked - len(mine),
            "rmse": float(errors.mean()),
            "rmse_worst": float(errors.max()),
            **{
                role: {
                    "wavelength_error_worst_nm": max(run[role]["wavelength_error_nm"] for run in mine),
                    "residual_nm": float(np.mean([run[role]["residual_nm"] for run in mine])),
                    "fewest_lines": min(run[role]["lines"] for run in mine),
                }
                for role in ("rgb", "mono")
            },
        }
    return found


def bars(found: dict[str, Any]) -> list[dict[str, Any]]:
    """Every bar of the experiments with its value, its limit and whether it is met."""
    made: list[dict[str, Any]] = []

    def add(name: str, value: float, limit: float, *, least: bool = False) -> None:
        met = value >= limit if least else value <= limit
        made.append({"bar": name, "value": value, "limit": limit, "at_least": least, "met": bool(met)})

    rows = found["figure_4"]
    for noise in ("0.005", "0.01"):
        best = rows[method("paper").NAME][noise]
        words = f"{100 * float(noise):g} % noise"
        for name in FIGURE_4:
            ours = rows[f"{method(name).NAME}: wavelengths, clipped"][noise]
            add(f"{method(name).NAME}, clipped, over the paper's l1, {words}", ours / best, 2.0, least=True)
        order = rows[f"{method('qr').NAME}: wavelengths, clipped"][noise]
        order /= rows[f"{method('pinv').NAME}: wavelengths, clipped"][noise]
        add(f"QR over pseudo-inverse, clipped, {words}", order, 1.0, least=True)
    for light, row in found["direct"].items():
        add(f"camssf direct, {light}: worst channel's RMSE", row["rmse_worst"], 0.01)
        for role in ("rgb", "mono"):
            worst = row[role]["wavelength_error_worst_nm"]
            add(f"camssf direct, {light}: worst wavelength of the {role} frames, nm", worst, 0.5)
    return made


HEAVY = ("curves", "std", "truth", "map", "measured_srgb", "synthetic_srgb", "direct_of_one")
"""What the pictures need and the page does not."""


def light_copy(content: Any) -> Any:
    """Without the pictures' arrays, five significant digits."""
    if isinstance(content, dict):
        return {key: light_copy(value) for key, value in content.items() if key not in HEAVY}
    if isinstance(content, list):
        return [light_copy(value) for value in content]
    return float(f"{content:.5g}") if isinstance(content, float) else content


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.paper", description=__doc__)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--every", type=int, default=1, help="take every so manieth camera; no page then")
    parser.add_argument("--page", action="store_true", help="only write the page and the pictures from the last run")
    parser.add_argument(
        "--captures", action="store_true", help="only Sec. 4 and 5 (spectrograph, phones) anew, the rest as it was"
    )
    options = parser.parse_args(arguments)
    out = console()
    if options.page:
        full = json.loads((RESULTS / "paper.json").read_text("utf-8"))
        publish(full)
        return 0
    begun = time.perf_counter()
    known = cameras()
    chosen = [i for i in range(len(known)) if i % options.every == 0 or known[i].name.endswith("(NPL)")]
    phones = [i for i, camera in enumerate(known) if camera.name in captures.PHONES]
    work: list[tuple[Any, ...]] = [(run, name, i) for name in EXPERIMENTS for i in chosen]
    work = [] if options.captures else work
    public = next(i for i, camera in enumerate(known) if camera.name == CURVE_CAMERA)
    work += [(spectrograph, i, light) for i in sorted({*chosen[::4], public}) for light in ("AM1.5", "daylight")]
    work += [(phone, i) for i in phones]
    results: dict[tuple[Any, ...], Any] = {}
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool, progress() as bar:
        task = bar.add_task("the paper's experiments", total=len(work))
        waiting = {pool.submit(*each): each for each in work}
        for done in as_completed(waiting):
            results[waiting[done]] = done.result()
            bar.advance(task)
    found: dict[str, Any] = {"cameras": len(chosen), "every": options.every}
    if options.captures:
        found = json.loads((RESULTS / "paper.json").read_text("utf-8")) | {"captures_anew": True}
    else:
        for name, gather in GATHER.items():
            found[name] = gather({i: results[run, name, i] for i in chosen})
        found["correlation"], found["curves_of_one"] = correlations(), curves()
        spent = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        found["minutes"] = (time.perf_counter() - begun) / 60.0
        found["cpu_minutes"] = sum(each.ru_utime + each.ru_stime for each in spent) / 60.0
    found["phones"] = {known[i].name: results[phone, i] for i in phones}
    found["direct"] = gather_direct({k[1:]: v for k, v in results.items() if k[0] is spectrograph})
    found["direct_of_one"] = results[spectrograph, public, "AM1.5"]
    found["bars"] = bars(found)
    found["versions"] = versions("scipy", "colour-science", "scikit-learn")
    place = save("paper", found)
    show(found, out)
    out.print(f"{place}, {found['minutes']:.1f} minutes")
    if found["every"] == 1:
        publish(found)
    return 0 if all(bar["met"] for bar in found["bars"]) else 1


def publish(found: dict[str, Any]) -> None:
    """docs/paper.json, docs/paper.md from it, and the pictures."""
    short = light_copy(found)
    draw(found, DOCS / "images")
    for name, text in (
        ("paper.json", json.dumps(short, indent=1, ensure_ascii=False) + "\n"),
        ("paper.md", page(short)),
    ):
        temporary = DOCS / f".{name}.{os.getpid()}"
        temporary.write_text(text, encoding="utf-8")
        os.replace(temporary, DOCS / name)


def show(found: dict[str, Any], out: Any) -> None:
    """The tables, on stdout."""
    rows = found["rivals"]
    head = ["method", *(f"{name} {float(noise):.1%}" for noise in map(str, NOISES) for name in LAMPS)]
    cells = [
        [name, *(f"{row[noise][lamp_]['rmse']:.4f}" for noise in map(str, NOISES) for lamp_ in LAMPS)]
        for name, row in rows.items()
    ]
    out.print(table(f"Table 1's families, 24 patches, {found['cameras']} cameras", head, cells))
    head = ["method", *(f"{float(noise):.1%}" for noise in map(str, NOISES))]
    cells = [[name, *(f"{row[str(noise)]:.4f}" for noise in NOISES)] for name, row in found["figure_4"].items()]
    out.print(table("Fig. 4, 12 patches, D55", head, cells))
    head = ["bar", "value", "limit", "verdict"]
    cells = [
        [
            b["bar"],
            f"{b['value']:.4f}",
            f"{'≥' if b['at_least'] else '≤'} {b['limit']:g}",
            "met" if b["met"] else "MISSED",
        ]
        for b in found["bars"]
    ]
    out.print(table("Bars", head, cells))


if __name__ == "__main__":
    one_thread("benchmarks.paper")
    sys.exit(main())
