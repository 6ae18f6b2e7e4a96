"""How wrong is an answer, and does its band say so? `python -m benchmarks.claims.accuracy [--draws 4]`

Each measured camera is solved with a basis learned without its maker (the shipped one only serves the Monte Carlo
run). RMSE on peak-normalised curves, 400 to 700 nm, mean of R, G, B, cameras and draws; noise σ = hypot(0.5 % of y,
0.001) or, "low", hypot(0.1 %, 0.0002); 12 patches are numbers 7 to 18. Settings:

- exact: the solver is told the very table that the patches have, tolerances 0;
- Ohta: patches simulated from Ohta's table, solved with BabelColor's, 3 %, low noise;
- lamps off: that, and each lamp off by a drawn temperature (300 K of daylight, 100 K of a bulb, by their formulae)
  and a smooth 2 %, both declared.

On the same draws: the product (elastic net, λ₂ = 1, γ = 0.05), the posterior mean (γ = 0), l1 alone (λ₂ = 0,
γ = 1.4), all on the left-out basis, and the paper's l1 on Gaussians (first photo only; γ by the discrepancy
principle). "Apart" is the product without what its channels know of each other: the same rows and penalties, but the
blocks of Σ between the channels nought, so that each is solved for itself. Under lamp modes each channel then has
its own u: the rows are taken about the same first look, but what is left of u is no longer one for the three.
Coverage: the share of wavelengths whose truth lies within 1.96 standard deviations, overall and in 20-nm bins.

The Monte Carlo run (GUM Supplement 1) draws camera, noise, chart, white and lamp from what the model is told of
them, solves with the shipped model, and compares the errors with the bands. Exit status 1 where a bar is missed.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from rich.progress import Progress

from benchmarks.shared import (
    CURVES,
    RESULTS,
    chart,
    command_parser,
    console,
    lamp,
    one_thread,
    progress,
    save,
    table,
    versions,
)
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, interpolate, misfit_profile, read_basis
from camssf.recovery.covariance import (
    ABSOLUTE,
    CHANNEL_SHARE,
    CHART_CORRELATION,
    DRIFT,
    EDGE,
    INDEPENDENT_SHARE,
    LAMP_CORRELATION,
    RELATIVE,
    TABLE_CORRELATION,
    smooth_errors,
)
from camssf.recovery.hypotheses import recover
from camssf.recovery.observation import Observation
from camssf.recovery.penalties import GAMMA, L2
from camssf.recovery.posterior import own_blocks, peak_normalised_jacobian
from camssf.recovery.rows import anchor
from camssf.recovery.sensitivity import SolverSettings, Ssf
from camssf.spectra import read_chart, read_lamp
from camssf_lab.learning.basis import learn
from camssf_lab.learning.training import maker_of, read_curves
from golden.linear_model import LinearModel, linear_model
from golden.linear_model import solve as solve_code

SEEN = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
BINS = tuple(range(400, 700, 20))
TWELVE, ALL = (6, 18), (0, 24)
HIGH, LOW = (0.005, 0.001), (0.001, 0.0002)
KELVIN = {"D55": (5503.0, 300.0), "A": (2856.0, 100.0)}
"""Temperature of a lamp and by how much it may be off, K; 1.4388 / 1.4380 makes D55 a daylight of 5503 K."""
LAMP_SMOOTH = 0.02
CHART, WHITE = 0.03, 0.01
PRODUCT, MEAN, SPARSE, PAPER = "elastic net (product)", "posterior mean", "l1 alone", "paper: l1 on Gaussians"
APART = "apart"
METHODS = (PRODUCT, APART, MEAN, SPARSE, PAPER)
SEED = 5
FOREIGN, NEVER, COVERAGE_SLACK = 0.95, 1.01, 0.01
"""Bars of together over apart: with a foreign table and one or two lamps, anywhere; and by how much further from .95
the coverage may lie than apart: what chance does to it."""
Found = tuple[Floats, Floats | None]
"""Curves (681, 3) of peak 1, and their standard deviations, if there are any."""


@dataclass(frozen=True)
class Setting:
    """One row of the table."""

    name: str
    lamps: tuple[str, ...]
    patches: tuple[int, int] = ALL
    noise: tuple[float, float] = HIGH
    ohta: bool = False
    off: bool = False

    def tolerances(self) -> dict[str, Any]:
        """What the solver is told of errors that are not noise."""
        arguments: dict[str, Any] = {"chart_tolerance": 0.0, "white_tolerance": 0.0}
        if self.ohta:
            arguments = {"chart_tolerance": CHART, "white_tolerance": WHITE}
        if self.off:
            arguments |= {
                "lamp_tolerance": LAMP_SMOOTH,
                "lamp_modes": np.stack([mode(name)[None] for name in self.lamps]),
            }
        return arguments


def pair(name: str, lamp_: str) -> tuple[Setting, Setting]:
    return Setting(f"{name}, 12", (lamp_,), TWELVE), Setting(f"{name}, 24", (lamp_,))


SETTINGS = (
    *pair("exact, D55", "D55"),
    *(setting for name in ("D65", "A", "LED-B3", "FL2") for setting in pair(f"exact, {name}", name)),
    Setting("Ohta, D55", ("D55",), noise=LOW, ohta=True),
    Setting("Ohta, D55 + A", ("D55", "A"), noise=LOW, ohta=True),
    Setting("Ohta, D55 + A + LED-B3", ("D55", "A", "LED-B3"), noise=LOW, ohta=True),
    Setting("lamps off, D55", ("D55",), noise=LOW, ohta=True, off=True),
    Setting("lamps off, D55 + A", ("D55", "A"), noise=LOW, ohta=True, off=True),
)


@dataclass
class Scores:
    """Of one setting and method: rmse (runs, 3); covered (runs, 3, 681) or None without bands."""

    rmse: Floats
    covered: Floats | None

    def row(self) -> dict[str, Any]:
        """Means over runs: rmse, of R, G, B, coverage over 400 to 700 nm and in each 20 nm."""
        found: dict[str, Any] = {"rmse": float(self.rmse.mean()), "rmse_rgb": self.rmse.mean(axis=0).tolist()}
        if self.covered is not None:
            bins = [float(self.covered[..., inside(low)].mean()) for low in BINS]
            found |= {"coverage": float(self.covered[..., SEEN].mean()), "coverage_bins": bins}
        return found


def inside(low: int) -> Any:
    """The 20 nm from `low` on; the last bin has both its ends."""
    high = low + 20 + (0.5 * STEP if low == BINS[-1] else 0.0)
    return (low <= WAVELENGTHS) & (high > WAVELENGTHS)


@cache
def mode(name: str) -> Floats:
    """(681,) change of ln L when the lamp's temperature rises by its standard deviation: half of a difference."""
    kelvin, off = KELVIN[name]
    high, low = (power(name, kelvin + sign * off) for sign in (1, -1))
    return np.asarray(0.5 * np.log(high / low))


def power(name: str, kelvin: float) -> Floats:
    """(681,) CIE daylight or a hot body of that temperature."""
    return read_lamp(f"D:{kelvin:.3f}" if name.startswith("D") else f"{kelvin:.3f}K").values


def true_lamp(name: str, off: bool, rng: np.random.Generator) -> Floats:
    """(681,) the light that really fell on the chart."""
    if not off:
        return lamp(name)
    kelvin, spread = KELVIN[name]
    smooth = smooth_errors(LAMP_CORRELATION)
    ripple = LAMP_SMOOTH * interpolate((smooth @ rng.normal(size=smooth.shape[1]))[:, None])[:, 0]
    # The ratio of two formulae bends the table, which keeps whatever the formula lacks.
    return np.asarray(lamp(name) * power(name, kelvin + spread * rng.normal()) / power(name, kelvin) * np.exp(ripple))


def photograph(setting: Setting, camera: Floats, seen: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Signals (k, n, 3) of Eq. (5) by its integrals, with noise, and their standard error."""
    lamps = np.stack([true_lamp(name, setting.off, rng) for name in setting.lamps])
    y = ((lamps[:, None, :] * seen) @ camera) / (lamps @ camera)[:, None, :]
    error = np.hypot(setting.noise[0] * y, setting.noise[1])
    return y + error * rng.normal(size=y.shape), error


def score(answer: Ssf, camera: Floats) -> tuple[Floats, Floats | None]:
    """RMSE (3,) and where the band covers the truth (3, 681)."""
    return judge(answer.peak(), camera)


def judge(found: Found, camera: Floats) -> tuple[Floats, Floats | None]:
    """The same of curves of peak 1."""
    got, std = found
    wrong = (got - camera / camera.max(axis=0)).T
    rmse = np.sqrt(np.mean(wrong[:, SEEN] ** 2, axis=1))
    return rmse, None if std is None else (np.abs(wrong) <= 1.96 * std.T).astype(float)


def apart(linear: LinearModel) -> LinearModel:
    """The same rows, where no channel knows of another's errors."""
    channel = np.repeat(np.arange(3), linear.target.shape[1] // 3)
    return replace(linear, covariance=np.where(channel[:, None] == channel, linear.covariance, 0.0))


def answer_of(linear: LinearModel, observation: Observation, basis: Basis) -> Found:
    """What `recover` makes of rows on a basis with a prior, at the product's penalties."""
    code = solve_code(linear, L2, np.array([GAMMA]))
    x = code.values.reshape(3, -1)
    book = anchor(basis, observation.white_reflectance * observation.lamp[0])
    curves = book.mean + np.einsum("cmr,cr->cm", book.dictionary, x)
    moves = peak_normalised_jacobian(book.dictionary, curves)
    spread = own_blocks(np.linalg.inv(code.precision[0] + np.eye(x.size)))
    peak = curves.max(axis=1)[:, None]
    std = np.sqrt(np.maximum(np.einsum("cmr,crs,cms->cm", moves, spread, moves), 0.0))
    return (curves / peak).T, np.hypot((std / peak).T, missed())


def missed() -> Floats:
    """(681, 3) what every basis misses, one standard deviation of the curves of peak 1."""
    return np.asarray(interpolate(misfit_profile()[..., None])[..., 0].T)


def declared(setting: Setting, y: Floats, error: Floats) -> Observation:
    """The signals, and what is told of chart, white and lamps."""
    lamps = np.stack([lamp(name) for name in setting.lamps])
    return Observation(y, chart()[slice(*setting.patches)], lamps, standard_error=error, **setting.tolerances())


def solve(method: str, setting: Setting, y: Floats, error: Floats, basis: Basis) -> Found:
    given = chart()[slice(*setting.patches)]
    lamps = np.stack([lamp(name) for name in setting.lamps])
    arguments = setting.tolerances()
    if method == PAPER:
        arguments = {key: arguments[key] for key in ("chart_tolerance", "white_tolerance")}
        return recover(
            Observation(y[:1], given, lamps[:1], standard_error=error[:1], **arguments), basis="gaussian"
        ).peak()
    evidence = declared(setting, y, error)
    if method == APART:
        return answer_of(apart(linear_model(evidence, basis)), evidence, basis)
    l2, gamma = {PRODUCT: (None, None), MEAN: (1.0, 0.0), SPARSE: (0.0, 1.4)}[method]
    return recover(evidence, basis=basis, settings=SolverSettings(l2=l2, gamma=gamma, engine="reference")).peak()


def left_out() -> tuple[dict[str, Floats], dict[str, Basis]]:
    """Cameras (681, 3) by name, and by maker the basis learned from all others."""
    curves = read_curves(CURVES)
    names = list(curves)
    stack = np.stack([curves[name] for name in names])
    makers = np.array([maker_of(name) for name in names])
    bases = {}
    for maker in sorted(set(makers)):
        others = makers != maker
        mean, atoms = learn(stack[others], makers=makers[others].tolist())
        bases[maker] = Basis("cameras", interpolate(mean[..., None])[..., 0], interpolate(atoms), True, f"no {maker}")
    return {name: interpolate(curves[name]) for name in names}, bases


def measure(
    settings: Sequence[Setting],
    methods: Sequence[str],
    draws: int,
    cameras: dict[str, Floats],
    bases: dict[str, Basis],
    bar: Progress | None = None,
) -> dict[str, dict[str, Scores]]:
    """Scores by setting and method; every method sees the same draws."""
    found: dict[str, dict[str, Scores]] = {}
    task = None if bar is None else bar.add_task("cameras", total=len(settings) * draws * len(cameras))
    ohta = read_chart("classic24:ohta").values
    for setting in settings:
        rng = np.random.default_rng(SEED)
        seen = (ohta if setting.ohta else chart())[slice(*setting.patches)]
        runs: dict[str, list[tuple[Floats, Floats | None]]] = {method: [] for method in methods}
        for _ in range(draws):
            for name, camera in cameras.items():
                y, error = photograph(setting, camera, seen, rng)
                for method in methods:
                    runs[method].append(judge(solve(method, setting, y, error, bases[maker_of(name)]), camera))
                if bar is not None and task is not None:
                    bar.advance(task)
        found[setting.name] = {
            method: Scores(
                np.stack([rmse for rmse, _ in run]),
                None if run[0][1] is None else np.stack([covered for _, covered in run if covered is not None]),
            )
            for method, run in runs.items()
        }
    return found


def monte_carlo(setting: Setting, count: int, rng: np.random.Generator) -> Floats:
    """GUM Supplement 1: (3,) root mean square error of the drawn answers over their mean band, 400 to 700 nm.

    Cameras from the shipped prior itself, then what the setting is told may be off: the chart and the white by
    covariance.py's model (each channel sees its own chart, CHANNEL_SHARE of whose smooth errors are common), the
    lamps as `true_lamp`; and light that drifts between chart and white frame.
    """
    basis = read_basis("cameras")
    given = chart()[slice(*setting.patches)]
    lamps = np.stack([lamp(name) for name in setting.lamps])
    arguments = setting.tolerances()
    long, short = (interpolate(smooth_errors(length)) for length in (CHART_CORRELATION, TABLE_CORRELATION))
    edge = EDGE * np.gradient(given, STEP, axis=1)
    errors, bands = [], []
    n = len(given)
    for _ in range(count):
        code = rng.normal(size=(3, basis.dictionary.shape[2]))
        camera = (basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code)).T
        u = [_by_channel(n, curves.shape[1], rng) @ curves.T for curves in (long, short, short)]
        seen = given + arguments["chart_tolerance"] * (RELATIVE * given * u[0] + ABSOLUTE * u[1] + edge * u[2])
        white = 1.0 + arguments["white_tolerance"] * (long @ rng.normal(size=long.shape[1]))
        light = np.stack([true_lamp(name, setting.off, rng) for name in setting.lamps])
        y = np.einsum("km,cnm,mc->knc", light, seen, camera) / ((light * white) @ camera)[:, None, :]
        error = np.hypot(setting.noise[0] * y, setting.noise[1])
        y = y * (1.0 + DRIFT * rng.normal(size=(len(lamps), 1, 1)))
        own = INDEPENDENT_SHARE * arguments["chart_tolerance"] * y
        y = y + np.hypot(error, own) * rng.normal(size=y.shape)
        answer = recover(Observation(y, given, lamps, standard_error=error, **arguments), basis="cameras")
        got, std = answer.peak()
        assert std is not None
        errors.append((got - camera / camera.max(axis=0))[SEEN])
        bands.append(std[SEEN])
    return np.asarray(np.sqrt(np.mean(np.square(errors), axis=(0, 1)) / np.mean(np.square(bands), axis=(0, 1))))


def _by_channel(n: int, size: int, rng: np.random.Generator) -> Floats:
    """(3, n, size) numbers of unit variance, CHANNEL_SHARE of it common to the channels."""
    common, own = rng.normal(size=(n, size)), rng.normal(size=(3, n, size))
    return np.sqrt(CHANNEL_SHARE) * common + np.sqrt(1.0 - CHANNEL_SHARE) * own


def together(rows: dict[str, dict[str, dict[str, Any]]]) -> list[dict[str, Any]]:
    """The product over its channels apart, setting by setting: RMSE, their ratio, both coverages."""
    return [
        {
            "setting": name,
            "together": methods[PRODUCT]["rmse"],
            "apart": methods[APART]["rmse"],
            "ratio": methods[PRODUCT]["rmse"] / methods[APART]["rmse"],
            "coverage": methods[PRODUCT]["coverage"],
            "coverage_apart": methods[APART]["coverage"],
        }
        for name, methods in rows.items()
    ]


def bars(rows: dict[str, dict[str, dict[str, Any]]], ratios: dict[str, list[float]]) -> list[dict[str, Any]]:
    """Every bar with its value, its limit and whether it is met."""
    product = {name: methods[PRODUCT] for name, methods in rows.items()}
    rmse = {name: row["rmse"] for name, row in product.items()}
    found: list[dict[str, Any]] = []

    def add(name: str, value: float, limit: float, *, least: bool = False) -> None:
        met = value >= limit if least else value <= limit
        found.append({"bar": name, "value": value, "limit": limit, "at_least": least, "met": bool(met)})

    add("exact, D55, 12 patches: RMSE", rmse["exact, D55, 12"], 0.028)
    add("exact, D55, 24 patches: RMSE", rmse["exact, D55, 24"], 0.024)
    for count, limit in ((12, 0.028), (24, 0.024)):
        worst = max(rmse[f"exact, {name}, {count}"] for name in ("D65", "A", "LED-B3", "FL2"))
        add(f"worst lamp, {count} patches: RMSE over D55's", worst / rmse[f"exact, D55, {count}"], 1.4)
        add(f"worst lamp, {count} patches: RMSE against 1.4 x D55's bar", worst, 1.4 * limit)
    for name, limit in (("D55", 0.040), ("D55 + A", 0.031), ("D55 + A + LED-B3", 0.028)):
        add(f"Ohta, {name}: RMSE", rmse[f"Ohta, {name}"], limit)
    add("lamps off: two lamps over one", rmse["lamps off, D55 + A"] / rmse["lamps off, D55"], 1.0)
    for name, row in product.items():
        add(f"{name}: coverage", row["coverage"], 0.93, least=True)
        add(f"{name}: coverage", row["coverage"], 0.97)
        add(f"{name}: coverage of the worst 20 nm", min(row["coverage_bins"]), 0.88, least=True)
    few = {setting.name for setting in SETTINGS if setting.ohta and len(setting.lamps) <= 2}
    for row in together(rows):
        limit = FOREIGN if row["setting"] in few else NEVER
        add(f"{row['setting']}: RMSE together over apart", row["ratio"], limit)
        further = abs(row["coverage"] - 0.95) - abs(row["coverage_apart"] - 0.95)
        add(f"{row['setting']}: coverage further from .95 than apart", further, COVERAGE_SLACK)
    for name, ratio in ratios.items():
        add(f"Monte Carlo, {name}: error over band, channel furthest from 1", max(abs(r - 1) for r in ratio), 0.10)
    return found


def plot(rows: dict[str, dict[str, dict[str, Any]]]) -> str:
    """results/accuracy.png: RMSE by setting and method; coverage by 20-nm bin. Returns its place."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(15, 6), layout="constrained")
    names = list(rows)
    for i, method in enumerate(METHODS):
        height = 0.8 / len(METHODS)
        at = np.arange(len(names)) + height * (i - 0.5 * (len(METHODS) - 1))
        left.barh(at, [rows[name][method]["rmse"] for name in names], height=height, label=method)
    left.set_yticks(np.arange(len(names)), names)
    left.invert_yaxis()
    left.set_xlabel("RMSE, peak-normalised, 400 to 700 nm")
    left.legend(loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=2)
    shades = matplotlib.colormaps["tab20"]
    for i, name in enumerate(names):
        right.plot([low + 10 for low in BINS], rows[name][PRODUCT]["coverage_bins"], label=name, color=shades(i))
    right.axhline(0.95, color="black", linewidth=0.8)
    right.axhline(0.88, color="black", linewidth=0.8, linestyle="--")
    right.set_xlabel("wavelength, nm")
    right.set_ylabel("coverage of the 95 % bands")
    right.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    RESULTS.mkdir(exist_ok=True)
    figure.savefig(RESULTS / "accuracy.png", dpi=110)
    plt.close(figure)
    return "benchmarks/results/accuracy.png"


def main(arguments: Sequence[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument(
        "--draws", type=int, default=4, help="of the noise and the lamps, for each camera and setting"
    )
    parser.add_argument("--trials", type=int, default=1000, help="of the Monte Carlo run, for each setting")
    options = parser.parse_args(arguments)
    cameras, bases = left_out()
    with progress() as bar:
        scores = measure(SETTINGS, METHODS, options.draws, cameras, bases, bar)
        chosen = [s for s in SETTINGS if s.name == "exact, D55, 24" or s.ohta]
        task = bar.add_task("Monte Carlo", total=len(chosen))
        ratios = {}
        for setting in chosen:
            ratios[setting.name] = monte_carlo(setting, options.trials, np.random.default_rng(SEED)).tolist()
            bar.advance(task)
    rows = {name: {method: s.row() for method, s in methods.items()} for name, methods in scores.items()}
    makers = np.array([maker_of(name) for name in cameras])
    by_maker = {
        name: {
            maker: float(
                scores[name][PRODUCT].rmse.reshape(options.draws, len(cameras), 3)[:, makers == maker].mean()
            )
            for maker in sorted(set(makers))
        }
        for name in rows
    }
    verdicts = bars(rows, ratios)
    out = console()
    head = ["setting", *(f"RMSE {m}" for m in METHODS), "R G B", "coverage", "worst bin", "l1 alone covers"]
    out.print(
        table(
            f"{len(cameras)} cameras, maker left out, {options.draws} draws",
            head,
            [
                [
                    name,
                    *(f"{row[m]['rmse']:.4f}" for m in METHODS),
                    " ".join(f"{v:.3f}" for v in row[PRODUCT]["rmse_rgb"]),
                    f"{row[PRODUCT]['coverage']:.3f}",
                    f"{min(row[PRODUCT]['coverage_bins']):.3f}",
                    f"{row[SPARSE]['coverage']:.3f}",
                ]
                for name, row in rows.items()
            ],
        )
    )
    compared = together(rows)
    out.print(
        table(
            "Three channels as one problem, and each for itself",
            ["setting", "RMSE together", "apart", "ratio", "coverage together", "apart"],
            [
                [row["setting"], f"{row['together']:.4f}", f"{row['apart']:.4f}", f"{row['ratio']:.3f}",
                 f"{row['coverage']:.3f}", f"{row['coverage_apart']:.3f}"]
                for row in compared
            ],
        )
    )  # fmt: skip
    out.print(
        table(
            "Monte Carlo (GUM S1): error over band, R G B",
            ["setting", "R", "G", "B"],
            [[name, *(f"{r:.3f}" for r in ratio)] for name, ratio in ratios.items()],
        )
    )
    out.print(
        table(
            "Bars",
            ["bar", "value", "limit", "verdict"],
            [
                [b["bar"], f"{b['value']:.4f}", f"{'≥' if b['at_least'] else '≤'} {b['limit']:.4f}",
                 "met" if b["met"] else "MISSED"]
                for b in verdicts
            ],
        )
    )  # fmt: skip
    picture = plot(rows)
    place = save(
        "accuracy",
        {
            "draws": options.draws,
            "trials": options.trials,
            "cameras": len(cameras),
            "settings": rows,
            "together": compared,
            "rmse_by_maker": by_maker,
            "monte_carlo": ratios,
            "bars": verdicts,
            "versions": versions("scipy", "colour-science"),
        },
    )
    out.print(f"{place}, {picture}")
    return 0 if all(b["met"] for b in verdicts) else 1


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
