"""How wrong is an answer, and does its band say so?

Each measured camera is solved with a basis learned without its maker. RMSE on peak-normalised curves, 400 to 700 nm,
mean of R, G, B, cameras and draws; noise σ = hypot(0.5 % of y, 0.001) or, "low", hypot(0.1 %, 0.0002); 12 patches are
numbers 7 to 18. Settings:

- exact: the solver is told the very table that the patches have, tolerances 0;
- Ohta: patches simulated from Ohta's table, solved with BabelColor's, 3 %, low noise;
- lamps off: that, and each lamp off by a drawn temperature (300 K of daylight, 100 K of a bulb, by their formulae)
  and a smooth 2 %, both declared.

On the same draws: the product (elastic net, λ₂ = 1, γ = 0.05); ridge on the same prior (γ = 0), on the left-out
basis; the paper's l1 on Gaussians (first photo only; γ by the discrepancy principle); and the mean of the left-out
basis, without any photo. Coverage: the share of wavelengths whose truth lies within 1.96 standard deviations, overall
and in 20-nm bins.
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
from benchmarks.shared import LAMP_SMOOTH, chart, lamp, ripple
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, interpolate, misfit_profile
from camssf.recovery.hypotheses import recover
from camssf.recovery.observation import Observation
from camssf.recovery.optimum import optimum
from camssf.recovery.penalties import GAMMA, L2
from camssf.recovery.posterior import own_blocks, peak_normalised_jacobian
from camssf.recovery.rows import anchor
from camssf.recovery.sensitivity import SolverSettings
from camssf.spectra import read_chart, read_lamp
from camssf_lab.learning.training import maker_of
from golden.linear_model import LinearModel

OPTIONS = {"draws": (4, "of the noise and the lamps, for each camera and setting")}
BINS = tuple(range(400, 700, 20))
TWELVE, ALL = (6, 18), (0, 24)
HIGH = (0.005, 0.001)
KELVIN = {"D55": (5503.0, 300.0), "A": (2856.0, 100.0)}
"""Temperature of a lamp and by how much it may be off, K; 1.4388 / 1.4380 makes D55 a daylight of 5503 K."""
CHART, WHITE = 0.03, 0.01
PRODUCT, RIDGE, PAPER = "elastic net (product)", "ridge, same prior", "paper: l1 on Gaussians"
METHODS = (PRODUCT, RIDGE, PAPER)
SEED = 5
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
        """Means over runs: rmse, coverage over 400 to 700 nm and in each 20 nm."""
        found: dict[str, Any] = {"rmse": float(self.rmse.mean())}
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
    smooth = ripple(rng)
    # The ratio of two formulae bends the table, which keeps whatever the formula lacks.
    return np.asarray(lamp(name) * power(name, kelvin + spread * rng.normal()) / power(name, kelvin) * smooth)


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
    problem = linear.whitened(L2, GAMMA)
    x = np.asarray(optimum(problem).x).reshape(3, -1)
    book = anchor(basis, observation.white_reflectance * observation.lamp[0])
    curves = book.mean + np.einsum("cmr,cr->cm", book.dictionary, x)
    moves = peak_normalised_jacobian(book.dictionary, curves)
    spread = own_blocks(np.linalg.inv(problem.H[0] + np.eye(x.size)))
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
    """The answer of one method."""
    given = chart()[slice(*setting.patches)]
    lamps = np.stack([lamp(name) for name in setting.lamps])
    arguments = setting.tolerances()
    if method == PAPER:
        arguments = {key: arguments[key] for key in ("chart_tolerance", "white_tolerance")}
        return recover(
            Observation(y[:1], given, lamps[:1], standard_error=error[:1], **arguments), basis="gaussian"
        ).peak()
    gamma = None if method == PRODUCT else 0.0
    settings = SolverSettings(gamma=gamma, engine="reference")
    return recover(declared(setting, y, error), basis=basis, settings=settings).peak()


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


def check(run: Run, rows: dict[str, dict[str, dict[str, Any]]]) -> None:
    """Every bar of the settings, as the run stands since each patch has a scale; docs/accuracy.md has the former."""
    rmse = {name: methods[PRODUCT]["rmse"] for name, methods in rows.items()}
    run.bar("exact, D55, 12 patches: RMSE", rmse["exact, D55, 12"], most=0.031)
    run.bar("exact, D55, 24 patches: RMSE", rmse["exact, D55, 24"], most=0.029)
    for count, limit in ((12, 0.0392), (24, 0.0336)):
        worst = max(rmse[f"exact, {name}, {count}"] for name in ("D65", "A", "LED-B3", "FL2"))
        run.bar(f"worst lamp, {count} patches: RMSE over D55's", worst / rmse[f"exact, D55, {count}"], most=1.4)
        run.bar(f"worst lamp, {count} patches: RMSE", worst, most=limit)
    for name, limit in (("D55", 0.041), ("D55 + A", 0.032), ("D55 + A + LED-B3", 0.028)):
        run.bar(f"Ohta, {name}: RMSE", rmse[f"Ohta, {name}"], most=limit)
    run.bar("lamps off: two lamps over one", rmse["lamps off, D55 + A"] / rmse["lamps off, D55"], most=1.0)
    for name, methods in rows.items():
        most = 0.97 if name.startswith("exact") else 0.98
        run.bar(f"{name}: coverage", methods[PRODUCT]["coverage"], least=0.93, most=most)
        run.bar(f"{name}: coverage of the worst 20 nm", min(methods[PRODUCT]["coverage_bins"]), least=0.88)


def claim(run: Run) -> None:
    """A row a setting."""
    cameras, bases = left_out()
    rows = {}
    for setting in run.track(SETTINGS, "settings"):
        scores = measure(setting, METHODS, run.options.draws, cameras, bases)
        rows[setting.name] = {method: score.row() for method, score in scores.items()}
    mean = float(np.mean([no_photo(bases[maker_of(name)], curves) for name, curves in cameras.items()]))
    columns = {f"RMSE {method}": ".4f" for method in METHODS} | {"mean camera, no photo": ".4f"}
    columns |= {"coverage": ".3f", "worst bin": ".3f"}
    run.table(
        f"{len(cameras)} cameras, maker left out, {run.options.draws} draws",
        {"setting": ""} | columns,
        [
            (name, *(row[method]["rmse"] for method in METHODS), mean, row[PRODUCT]["coverage"],
             min(row[PRODUCT]["coverage_bins"]))
            for name, row in rows.items()
        ],
    )  # fmt: skip
    check(run, rows)
