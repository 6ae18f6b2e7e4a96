"""From cameras to tables: means over the cameras, each weight chosen on other makers, and the bars."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.claim import Run
from benchmarks.paper.experiments import Scores, cameras
from benchmarks.paper.rivals import FIGURE_4, READINGS, method


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


def nested(results: dict[int, Scores], cell: Callable[[str, dict[int, list[float]]], Any]) -> dict[str, Any]:
    """A cell for each key "name|...|...", nested by its words; methods by their labels."""
    found: dict[str, Any] = {}
    for key in next(iter(results.values())):
        runs = {index: results[index][key] for index in sorted(results)}
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
    "figure_4": gather_figure_4,
    "rivals": gather_rivals,
    "lamps": gather_lamps,
}


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
