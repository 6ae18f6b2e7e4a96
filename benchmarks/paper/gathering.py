"""From cameras to tables: means over the cameras, each weight chosen on other makers, and the bars."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.claim import Run
from benchmarks.paper.experiments import (
    COUNTS,
    TWELVE,
    Scores,
    cameras,
)
from benchmarks.paper.rivals import FIGURE_4, READINGS, method
from benchmarks.shared import chart
from camssf.grid import STEP
from camssf.recovery.basis import gaussian_basis
from camssf.spectra import read_chart


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
    """Mean by method, noise and count."""
    found: dict[str, Any] = {"counts": list(COUNTS)}
    for key, runs in by_key(results).items():
        name, noise, count = key.split("|")
        values = np.concatenate([runs[index] for index in runs])
        refused = int(np.isnan(values).sum())
        values = values[~np.isnan(values)]
        row = found.setdefault(name, {}).setdefault(noise, {"mean": [], "runs": [], "refused": 0})
        assert count == str(COUNTS[len(row["mean"])])
        row["mean"].append(values.mean().item())
        row["runs"].append(len(values))
        row["refused"] += refused
    return found


def nested(results: dict[int, Scores], cell: Callable[[str, dict[int, list[float]]], Any]) -> dict[str, Any]:
    """A cell for each key "name|...|...", nested by its words; methods by their labels."""
    found: dict[str, Any] = {}
    for key, runs in by_key(results).items():
        name, *middle, last = key.split("|")
        place = found.setdefault(method(name).label, {})
        for word in middle:
            place = place.setdefault(word, {})
        place[last] = cell(name, runs)
    return found


def gather_figure_4(results: dict[int, Scores]) -> dict[str, Any]:
    """Rows: method and reading × noise."""
    rows = nested(results, lambda name, runs: list(runs.values()) if name in FIGURE_4 else tuned(runs)["rmse"])
    found: dict[str, Any] = {}
    for label, cells in rows.items():
        if label in {method(name).label for name in FIGURE_4}:
            for j, reading in enumerate(READINGS):
                means = {noise: float(np.mean([v[j] for v in values])) for noise, values in cells.items()}
                found[f"{label}: {reading}"] = means
        else:
            found[label] = cells
    return found


def gather_rivals(results: dict[int, Scores]) -> dict[str, Any]:
    """Method → noise → lamp → RMSE and the weight chosen most often."""

    def cell(name: str, runs: dict[int, list[float]]) -> dict[str, Any]:
        row, weights = tuned(runs), method(name).weights
        return {"rmse": row["rmse"]} | ({"weight": weights[row["picks"]]} if len(weights) > 1 else {})

    return nested(results, cell)


def gather_lamps(results: dict[int, Scores]) -> dict[str, Any]:
    """Method → known or ignored → lamp → RMSE and RMSRE in %."""

    def cell(_: str, runs: dict[int, list[float]]) -> dict[str, Any]:
        values = np.array(list(runs.values()))
        answered = np.isfinite(values[:, 0])
        rmse, relative = values[answered].mean(axis=0).tolist()
        return {"rmse": rmse, "rmsre_percent": relative, "refused": int((~answered).sum())}

    return nested(results, cell)


GATHER: dict[str, Callable[[dict[int, Scores]], dict[str, Any]]] = {
    "colours": gather_colours,
    "figure_4": gather_figure_4,
    "rivals": gather_rivals,
    "lamps": gather_lamps,
}


def correlations() -> dict[str, Any]:
    """Fig. 3f: |r| between pairs of reflectances, and how alike the columns of F Ψ are (their mutual coherence)."""
    found: dict[str, Any] = {}
    for label, patches in (("1 to 12", slice(0, 12)), ("7 to 18", TWELVE)):
        for name, table_ in (("BabelColor", chart()), ("Ohta", read_chart("classic24:ohta").values)):
            r = np.corrcoef(table_[patches])
            pairs = np.abs(r[np.triu_indices(12, 1)])
            found[f"{name}, {label}"] = {"mean": float(pairs.mean())}
    rows = chart()[TWELVE] * STEP
    columns = rows @ gaussian_basis(18).dictionary[0]
    columns = columns / np.linalg.norm(columns, axis=0)
    alike = np.abs(columns.T @ columns) - np.eye(18)
    return {"tables": found, "coherence_below_1": float(1.0 - alike.max())}


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


def check(run: Run, found: dict[str, Any]) -> None:
    """Every bar of the experiments."""
    rows = found["figure_4"]
    for noise in ("0.005", "0.01"):
        best = rows[method("paper").label][noise]
        words = f"{100 * float(noise):g} % noise"
        qr, pinv = (rows[f"{method(name).label}: wavelengths, clipped"][noise] for name in FIGURE_4)
        for name, ours in zip(FIGURE_4, (qr, pinv), strict=True):
            run.bar(f"{method(name).label}, clipped, over the paper's l1, {words}", ours / best, least=2.0)
        run.bar(f"QR over pseudo-inverse, clipped, {words}", qr / pinv, least=1.0)
    for light, row in found["direct"].items():
        run.bar(f"camssf direct, {light}: worst channel's RMSE", row["rmse_worst"], most=0.01)
        for role in ("rgb", "mono"):
            worst = row[role]["wavelength_error_worst_nm"]
            run.bar(f"camssf direct, {light}: worst wavelength of the {role} frames, nm", worst, most=0.5)
