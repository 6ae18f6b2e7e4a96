"""Which penalties, how many components? `python -m benchmarks.penalties [--every 2] [--phones CSV]`

Leave-one-maker-out cross-validation on the measured cameras, or with `--phones` (CAMSSF_PHONES) leave-one-out on
measured phones, over five lamps and three noise levels, 24 patches, BabelColor's table told
exactly (tolerances 0) and, for the middle noise, told for Ohta's. Same draws for every candidate: λ₂ and γ from l1
alone over the elastic net to the posterior mean, then the number of components at the product's penalties. RMSE of
peak-normalised curves, 400 to 700 nm, mean of R, G, B, cameras and lamps; the best of each column is marked *.
About four minutes.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks._common import chart, console, lamp, one_thread, progress, save, table, versions
from benchmarks.accuracy import CHART, SEED, WHITE, Setting, photograph, score
from benchmarks.phones import asked, each_left_out
from camssf.grid import Floats
from camssf.recovery.basis import Basis
from camssf.recovery.hypotheses import recover
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import read_chart

LAMPS = ("D55", "D65", "A", "LED-B3", "FL2")
NOISES = {"0.1 %": (0.001, 0.0002), "0.5 %": (0.005, 0.001), "1 %": (0.01, 0.002)}
PENALTIES = (
    ("l1 alone", 0.0, 0.5),
    ("l1 alone", 0.0, 1.4),
    ("l1 alone", 0.0, 4.0),
    ("elastic net", 0.5, 0.05),
    ("elastic net (product)", 1.0, 0.05),
    ("elastic net", 1.0, 0.5),
    ("elastic net", 2.0, 0.05),
    ("posterior mean", 1.0, 0.0),
    ("posterior mean, half the weight", 0.5, 0.0),
    ("posterior mean, twice the weight", 2.0, 0.0),
)
COMPONENTS = (8, 12, 16, 20, 24)


def truncated(basis: Basis, count: int) -> Basis:
    """The first components of a basis; they come in the order of their spread."""
    return replace(basis, dictionary=basis.dictionary[:, :, :count])


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=int, default=2, help="take every so manieth camera")
    asked(parser)
    options = parser.parse_args(arguments)
    out = console()
    cameras, bases = each_left_out(options.phones)
    names = list(cameras)[:: 1 if options.phones else options.every]
    candidates = [(label, l2, gamma, 24) for label, l2, gamma in PENALTIES]
    candidates += [("elastic net (product)", 1.0, 0.05, count) for count in COMPONENTS[:-1]]
    columns = [(f"noise {level}", Setting(level, (name,), noise=noise)) for level, noise in NOISES.items()
               for name in LAMPS]  # fmt: skip
    columns += [("Ohta's chart", Setting("ohta", (name,), noise=NOISES["0.5 %"], ohta=True)) for name in LAMPS]
    errors: dict[tuple[int, str], list[Floats]] = {}
    ohta = read_chart("classic24:ohta").values
    with progress() as bar:
        task = bar.add_task("settings", total=len(columns) * len(names))
        for column, setting in columns:
            rng = np.random.default_rng(SEED)
            light = np.stack([lamp(name) for name in setting.lamps])
            told: dict[str, Any] = {"chart_tolerance": 0.0, "white_tolerance": 0.0}
            if setting.ohta:
                told = {"chart_tolerance": CHART, "white_tolerance": WHITE}
            for name in names:
                y, error = photograph(setting, cameras[name], ohta if setting.ohta else chart(), rng)
                for i, (_, l2, gamma, count) in enumerate(candidates):
                    answer = recover(
                        Observation(y, chart(), light, standard_error=error, **told),
                        basis=truncated(bases[name], count),
                        settings=SolverSettings(l2=l2, gamma=gamma, engine="reference"),
                    )
                    errors.setdefault((i, column), []).append(score(answer, cameras[name])[0])
                bar.advance(task)
    heads = list(dict.fromkeys(column for column, _ in columns))
    means = np.array([[np.mean(errors[i, head]) for head in heads] for i in range(len(candidates))])
    best = means.argmin(axis=0)
    who = "phones, each" if options.phones else "cameras, maker"
    out.print(
        table(
            f"RMSE, {len(names)} {who} left out, {len(LAMPS)} lamps",
            ["estimator", "λ₂", "γ", "components", *heads, "mean"],
            [
                [label, f"{l2:g}", f"{gamma:g}", str(count)]
                + [f"{means[i, j]:.4f}{'*' if best[j] == i else ''}" for j in range(len(heads))]
                + [f"{means[i].mean():.4f}"]
                for i, (label, l2, gamma, count) in enumerate(candidates)
            ],
        )
    )
    rows = []
    for i, (label, l2, gamma, count) in enumerate(candidates):
        found = dict(zip(heads, map(float, means[i]), strict=True))
        rows.append({"estimator": label, "l2": l2, "gamma": gamma, "components": count, "rmse": found})
    path = save(
        "penalties-phones" if options.phones else "penalties",
        {"cameras": len(names), "lamps": LAMPS, "rows": rows, "versions": versions()},
    )
    out.print(f"written: {path}")
    return 0


if __name__ == "__main__":
    one_thread("benchmarks.penalties")
    sys.exit(main())
