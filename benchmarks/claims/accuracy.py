"""How wrong is an answer, and does its band say so?

Each measured camera is solved with a basis learned without its maker (the shipped one only serves the Monte Carlo
run). RMSE on peak-normalised curves, 400 to 700 nm, mean of R, G, B, cameras and draws; noise σ = hypot(0.5 % of y,
0.001) or, "low", hypot(0.1 %, 0.0002); 12 patches are numbers 7 to 18. Settings:

- exact: the solver is told the very table that the patches have, tolerances 0;
- Ohta: patches simulated from Ohta's table, solved with BabelColor's, 3 %, low noise;
- lamps off: that, and each lamp off by a drawn temperature (300 K of daylight, 100 K of a bulb, by their formulae)
  and a smooth 2 %, both declared.

On the same draws: the product (elastic net, λ₂ = 1, γ = 0.05); ridge on the same prior (γ = 0), l1 alone (λ₂ = 0,
γ = 1.4), both on the left-out basis; the paper's l1 on Gaussians (first photo only; γ by the discrepancy principle);
and the mean of the left-out basis, without any photo. "Apart" is the product without what its channels know of each
other: the same rows and penalties, but the blocks of Σ between the channels nought, so that each is solved for
itself. Under lamp modes each channel then has its own u: the rows are taken about the same first look, but what is
left of u is no longer one for the three. Coverage: the share of wavelengths whose truth lies within 1.96 standard
deviations, overall and in 20-nm bins.

The Monte Carlo run (GUM Supplement 1) draws camera, noise, chart, white and lamp from what the model is told of
them, solves with the shipped model, and compares the errors with the bands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from benchmarks.captures import LOW
from benchmarks.claim import Run
from benchmarks.devices import SEEN, errors, left_out, no_photo
from benchmarks.shared import chart, lamp
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
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import read_chart, read_lamp
from camssf_lab.learning.training import maker_of
from golden.linear_model import LinearModel, linear_model
from golden.linear_model import solve as solve_code

OPTIONS = {
    "draws": (4, "of the noise and the lamps, for each camera and setting"),
    "trials": (1000, "of the Monte Carlo run, for each setting"),
}
BINS = tuple(range(400, 700, 20))
TWELVE, ALL = (6, 18), (0, 24)
HIGH = (0.005, 0.001)
KELVIN = {"D55": (5503.0, 300.0), "A": (2856.0, 100.0)}
"""Temperature of a lamp and by how much it may be off, K; 1.4388 / 1.4380 makes D55 a daylight of 5503 K."""
LAMP_SMOOTH = 0.02
CHART, WHITE = 0.03, 0.01
PRODUCT, MEAN, SPARSE, PAPER = "elastic net (product)", "ridge, same prior", "l1 alone", "paper: l1 on Gaussians"
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


def measure(
    setting: Setting, methods: Sequence[str], draws: int, cameras: Mapping[str, Floats], bases: Mapping[str, Basis]
) -> dict[str, Scores]:
    """Scores by method; every method sees the same draws."""
    rng = np.random.default_rng(SEED)
    table = read_chart("classic24:ohta").values if setting.ohta else chart()
    runs: dict[str, list[tuple[Floats, Floats | None]]] = {method: [] for method in methods}
    for _ in range(draws):
        for name, camera in cameras.items():
            y, error = photograph(setting, camera, table[slice(*setting.patches)], rng)
            for method in methods:
                runs[method].append(errors(*solve(method, setting, y, error, bases[maker_of(name)]), camera))
    return {
        method: Scores(
            np.stack([rmse for rmse, _ in pairs]),
            None if pairs[0][1] is None else np.stack([held for _, held in pairs if held is not None]),
        )
        for method, pairs in runs.items()
    }


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


def check(run: Run, rows: dict[str, dict[str, dict[str, Any]]]) -> None:
    """Every bar of the settings."""
    rmse = {name: methods[PRODUCT]["rmse"] for name, methods in rows.items()}
    run.bar("exact, D55, 12 patches: RMSE", rmse["exact, D55, 12"], most=0.028)
    run.bar("exact, D55, 24 patches: RMSE", rmse["exact, D55, 24"], most=0.024)
    for count, limit in ((12, 0.028), (24, 0.024)):
        worst = max(rmse[f"exact, {name}, {count}"] for name in ("D65", "A", "LED-B3", "FL2"))
        run.bar(f"worst lamp, {count} patches: RMSE over D55's", worst / rmse[f"exact, D55, {count}"], most=1.4)
        run.bar(f"worst lamp, {count} patches: RMSE against 1.4 x D55's bar", worst, most=1.4 * limit)
    for name, limit in (("D55", 0.040), ("D55 + A", 0.031), ("D55 + A + LED-B3", 0.028)):
        run.bar(f"Ohta, {name}: RMSE", rmse[f"Ohta, {name}"], most=limit)
    run.bar("lamps off: two lamps over one", rmse["lamps off, D55 + A"] / rmse["lamps off, D55"], most=1.0)
    few = {setting.name for setting in SETTINGS if setting.ohta and len(setting.lamps) <= 2}
    for name, methods in rows.items():
        product, alone = methods[PRODUCT], methods[APART]
        run.bar(f"{name}: coverage", product["coverage"], least=0.93, most=0.97)
        run.bar(f"{name}: coverage of the worst 20 nm", min(product["coverage_bins"]), least=0.88)
        limit = FOREIGN if name in few else NEVER
        run.bar(f"{name}: RMSE together over apart", product["rmse"] / alone["rmse"], most=limit)
        further = abs(product["coverage"] - 0.95) - abs(alone["coverage"] - 0.95)
        run.bar(f"{name}: coverage further from .95 than apart", further, most=COVERAGE_SLACK)


def claim(run: Run) -> None:
    """Both tables and the Monte Carlo run."""
    cameras, bases = left_out()
    rows = {}
    for setting in run.track(SETTINGS, "settings"):
        scores = measure(setting, METHODS, run.options.draws, cameras, bases)
        rows[setting.name] = {method: score.row() for method, score in scores.items()}
    mean = float(np.mean([no_photo(bases[maker_of(name)], curves) for name, curves in cameras.items()]))
    run.table(
        f"{len(cameras)} cameras, maker left out, {run.options.draws} draws",
        {"setting": "", **{f"RMSE {method}": ".4f" for method in METHODS}, "mean camera, no photo": ".4f",
         "R G B": "{:.3f} {:.3f} {:.3f}", "coverage": ".3f", "worst bin": ".3f", "apart covers": ".3f",
         "l1 alone covers": ".3f", "together / apart": ".3f"},
        [
            (name, *(row[method]["rmse"] for method in METHODS), mean, tuple(row[PRODUCT]["rmse_rgb"]),
             row[PRODUCT]["coverage"], min(row[PRODUCT]["coverage_bins"]), row[APART]["coverage"],
             row[SPARSE]["coverage"], row[PRODUCT]["rmse"] / row[APART]["rmse"])
            for name, row in rows.items()
        ],
    )  # fmt: skip
    check(run, rows)
    ratios = []
    for setting in run.track([s for s in SETTINGS if s.name == "exact, D55, 24" or s.ohta], "Monte Carlo"):
        ratio = monte_carlo(setting, run.options.trials, np.random.default_rng(SEED))
        ratios.append((setting.name, *ratio))
        name = f"Monte Carlo, {setting.name}: error over band, channel furthest from 1"
        run.bar(name, max(abs(ratio - 1)), most=0.10)
    columns = {"setting": "", "R": ".3f", "G": ".3f", "B": ".3f"}
    run.table("Monte Carlo (GUM S1): error over band", columns, ratios)
