"""Are the answers optimal?

Seeded problems: measured cameras x lamps by name and by kind x one to three shots (one on `gaussian`) x 9 to 96
patches x λ₂ 0 and 1 x γ in [1e-6, 1] of γ_max x noise 0 to 2 % x signed and non-negative codes x Σ diagonal, full,
or the identity. A call on a learned basis is one convex problem of 72 unknowns, on `gaussian` three of 18, each with
a γ inside that range of its own γ_max.

Each is solved by the NumPy reference and by the shipped ONNX model, from raw patch means. The relative duality gap,
which bounds the distance from the optimum, is recomputed from the code by `problems.relative_gap` in long double (64
bits of mantissa), on the reference's rows, whitened anew there. Bar: at most 1e-9 in every problem that the engine
does not refuse by name (`not_converged`, by its own gap above 1e-6).

Then the product as it ships: calls on the learned bases with its penalties (λ₂ 1, γ 0.05), 12 and 24 patches of
another measured table or of the tolerance told, one to three shots, lamps by name and by kind. How many end with the
layers' answer (`finish_steps` 0) and a gap <= 1e-10 (bar: 99 %), and how far the curves of those are from the exact
ones, in parts of their peak (bar: 1e-7 in all of them; of the calls that took the finish as well). Exact is the
reference's finish from the layers' answer, taken whatever their own proof says.

A problem that misses the bar is listed with its number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.claim import Run
from benchmarks.claims.lamps import draw as draw_kind
from benchmarks.problems import (
    Problem,
    curves,
    distance,
    forced,
    gamma_max,
    gaps,
    make_problem,
    reflectances,
    temperature_mode,
    whiten,
    whiten_finely,
)
from benchmarks.shared import cameras, lamp, progress
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import interpolate, read_basis
from camssf.recovery.covariance import CHART_CORRELATION, smooth_errors
from camssf.recovery.onnx_model import SHIPPED, load_model
from camssf.recovery.penalties import GAMMA, L2
from camssf.recovery.sensitivity import LARGEST_GAP
from camssf.spectra import read_chart
from camssf.spectra.families import FAMILIES
from golden.linear_model import solve

OPTIONS = {
    "count": (30_000, "convex problems; a call on `gaussian` has three"),
    "defaults": (10_000, "calls with the product's penalties"),
}
GAP_BAR = 1e-9
ALONE_GAP, ALONE_BAR, ALONE_SHARE = 1e-10, 1e-7, 0.99
"""Gap and curve of the layers on the product's defaults; share of calls that need no finish."""
SMALLEST, LARGEST = 1e-6, 1.0
"""γ, in parts of γ_max."""
LEARNED = tuple(name for name in SHIPPED if name != "gaussian")
LAMPS = ("A", "D50", "D55", "D65", "equal-energy", "FL2", "FL11", "HP1", "LED-B3", "LED-V1", "2400K", "3000K")
KINDS = tuple(FAMILIES)
PATCHES = (9, 12, 18, 24, 48, 96)
PATCH_SHARES = (0.2, 0.25, 0.2, 0.3, 0.035, 0.015)
ENGINES = ("reference", "onnx")
SEED = 0


@dataclass(frozen=True)
class Lights:
    """Shots' lamps by name or by kind: what is told of them, and what really fell. First axis: shots."""

    names: tuple[str, ...]
    stated: Floats
    true: Floats
    modes: Floats
    tolerance: tuple[float, ...]


def lights_of(names: Sequence[str], smooth: float, rng: np.random.Generator) -> Lights:
    """Of a kind a real lamp is drawn, and told as one of its shapes; one by name is told as it is, to `smooth`."""
    stated, true, modes, tolerance = [], [], [], []
    for name in names:
        if name in FAMILIES:
            power, light = draw_kind(name, rng)
            told = light.lamps[int(rng.integers(len(light.lamps)))]
            stated.append(told.values)
            true.append(power)
            modes.append(told.modes)
            tolerance.append(told.tolerance)
        else:
            stated.append(lamp(name))
            true.append(lamp(name))
            modes.append(np.zeros((0, WAVELENGTHS.size)))
            tolerance.append(smooth)
    padded = np.zeros((len(names), max(1, *(len(mode) for mode in modes)), WAVELENGTHS.size))
    for j, mode in enumerate(modes):
        padded[j, : len(mode)] = mode
    return Lights(tuple(names), np.stack(stated), np.stack(true), padded, tuple(tolerance))


def chart_errors(n: int, size: float, rng: np.random.Generator) -> Floats:
    """(n, 681) factors of a chart whose reflectances are smoothly off."""
    errors = interpolate(smooth_errors(CHART_CORRELATION))
    return np.asarray(1.0 + size * (errors @ rng.normal(size=(errors.shape[1], n))).T)


def draw(seed: int, index: int) -> tuple[Problem, str]:
    """The problem of that number, the same on every machine, and its kind of Σ."""
    rng = np.random.default_rng([seed, index])
    basis = "gaussian" if rng.random() < 0.25 else str(rng.choice(LEARNED))
    known = cameras()[0]
    name = str(rng.choice(list(known)))
    k = 1 if basis == "gaussian" else int(rng.integers(1, 4))
    n = int(rng.choice(PATCHES, p=PATCH_SHARES))
    names = [str(x) for x in rng.choice(LAMPS, k, replace=False)]
    noise = 0.0 if rng.random() < 0.2 else float(rng.uniform(0.0, 0.02))
    l2, nonnegative = float(rng.integers(2)), bool(rng.integers(2))
    sigma = str(rng.choice(("identity", "diagonal") if basis == "gaussian" else ("diagonal", "full")))
    reflectance = reflectances(n, rng)
    seen, extra = reflectance, {}
    if sigma == "full":
        extra = {"chart_tolerance": 0.03, "white_tolerance": 0.01}
        seen = reflectance * chart_errors(n, 0.02, rng)
        names = [str(rng.choice(KINDS)) if rng.random() < 0.35 else each for each in names]
    elif basis == "gaussian" and sigma == "diagonal":
        extra = {"chart_tolerance": float(rng.choice((0.0, 0.03)))}
    lights = lights_of(names, 0.02 if sigma == "full" else 0.0, rng)
    if sigma == "full" and not lights.modes.any() and rng.random() < 0.5:
        lights.modes[:, 0] = temperature_mode(5500.0, 300.0)
    white = None if rng.random() < 0.5 else 0.92 - 0.1 * (WAVELENGTHS - 380.0) / 340.0
    problem = make_problem(
        basis, known[name], lights.stated, seen, reflectance, noise=noise, rng=rng, l2=l2, gamma=1.0,
        nonnegative=nonnegative, standard_error=np.ones(1) if sigma == "identity" else None,
        lamp_tolerance=lights.tolerance, lamp_modes=lights.modes, light=lights.true, white=white,
        label=f"{name}, {' + '.join(names)}, {n} patches, noise {100 * noise:.2f} %, {sigma}", **extra,
    )  # fmt: skip
    top = gamma_max(*whiten(problem.sensing(read_basis(basis))), nonnegative)
    # Inside every problem's range; in the rare case that these do not overlap, between them.
    low, high = sorted((SMALLEST * top.max(), LARGEST * top.min()))
    gamma = np.exp(rng.uniform(np.log(low), np.log(high)))
    return Problem(problem.inputs | {"gamma": np.array(gamma)}, basis, problem.label), sigma


def draw_default(seed: int, index: int) -> Problem:
    """The product's call of that number: its penalties, on a learned basis, and what a user tells it."""
    rng = np.random.default_rng([seed, index, 1])
    known = cameras()[0]
    name, n = str(rng.choice(list(known))), int(rng.choice((12, 24)))
    names = [str(x) for x in rng.choice((*LAMPS, *KINDS), int(rng.integers(1, 4)), replace=False)]
    patches = slice(6, 18) if n == 12 else slice(0, 24)
    reflectance = read_chart("classic24").values[patches]
    foreign = rng.random() < 0.5
    seen = read_chart("classic24:ohta").values[patches] if foreign else reflectance * chart_errors(n, 0.02, rng)
    lights = lights_of(names, 0.02, rng)
    noise = float(rng.uniform(0.0005, 0.02))
    return make_problem(
        str(rng.choice(LEARNED)), known[name], lights.stated, seen, reflectance, noise=noise, rng=rng, l2=L2,
        gamma=GAMMA, nonnegative=False, chart_tolerance=0.03, white_tolerance=0.01,
        lamp_tolerance=lights.tolerance, lamp_modes=lights.modes, light=lights.true,
        label=f"{name}, {' + '.join(names)}, {n} patches{' of Ohta' if foreign else ''}, noise {100 * noise:.2f} %",
    )  # fmt: skip


def judge(problem: Problem) -> dict[str, Floats]:
    """The engines' answers to one call, measured: name → (p,) or, of curves, (3,)."""
    basis = problem.anchored(read_basis(problem.basis))
    sensing = problem.sensing(basis)
    fine = whiten_finely(sensing)
    code = solve(sensing, problem.l2, problem.penalties(sensing), nonnegative=problem.nonnegative)
    out = load_model(problem.basis).run(problem.inputs)
    return {
        "reference": code.gap,
        "reference_recomputed": gaps(*fine, code.values, problem),
        "steps": code.finish_steps.astype(float),
        "onnx": out["gap"][: len(code.gap)],
        "onnx_recomputed": gaps(*fine, out["code"].T, problem),
        "apart": distance(out["ssf"].T, curves(basis, code.values)),
    }


def unproven(measured: dict[str, Floats]) -> bool:
    """Whether an engine's gap is above the bar, or NaN, and the product does not refuse by name."""
    return any(
        bool(((measured[engine] <= LARGEST_GAP) & ~(measured[f"{engine}_recomputed"] <= GAP_BAR)).any())
        for engine in ENGINES
    )


def summary(run: Run, kept: list[tuple[Problem, dict[str, Floats]]]) -> None:
    """A row a group of basis, λ₂ and sign, and one of all."""
    groups: dict[tuple[str, ...], list[dict[str, Floats]]] = {}
    for problem, measured in kept:
        sign = "x >= 0" if problem.nonnegative else "signed"
        for key in ((problem.basis, str(int(problem.l2)), sign), ("~all", "", "")):
            groups.setdefault(key, []).append(measured)
    rows = []
    for key, group in sorted(groups.items()):
        steps = np.concatenate([measured["steps"] for measured in group])
        rows.append((
            *(word.strip("~") for word in key), steps.size,
            sum((~(measured[engine] <= LARGEST_GAP)).sum() for measured in group for engine in ENGINES),
            *(max(measured[name].max() for measured in group) for name in WORST), np.mean(steps == 0),
            int(steps.max()),
        ))  # fmt: skip
    columns = dict.fromkeys(("basis", "l2", "sign"), "") | {"problems": "d", "refused": "d"}
    columns |= dict.fromkeys(WORST.values(), ".1e") | {"no finish": ".0%", "most steps": "d"}
    run.table("Worst of each group", columns, rows)


WORST = {
    "reference_recomputed": "gap of the reference",
    "onnx_recomputed": "gap of ONNX",
    "apart": "reference - ONNX",
}


def judge_default(problem: Problem) -> dict[str, float]:
    """One of the product's calls: steps of the finish, own gap, and the curves' distance from the exact ones."""
    basis = problem.anchored(read_basis(problem.basis))
    sensing = problem.sensing(basis)
    code = solve(sensing, problem.l2, problem.penalties(sensing))
    exact = forced(sensing, problem)
    truth = curves(basis, exact)
    out = load_model(problem.basis).run(problem.inputs)
    return {
        "exact_gap": float(gaps(*whiten_finely(sensing), exact, problem).max()),
        "reference_steps": float(code.finish_steps.max()),
        "reference_gap": float(code.gap.max()),
        "reference_off": float(distance(curves(basis, code.values), truth).max()),
        "onnx_steps": float(out["finish_steps"].max()),
        "onnx_gap": float(out["gap"].max()),
        "onnx_off": float(distance(out["ssf"].T, truth).max()),
    }


def defaults(run: Run) -> None:
    """The product's calls: a row and bars an engine."""
    calls = [
        judge_default(draw_default(SEED, index))
        for index in run.track(range(run.options.defaults), "the product's defaults")
    ]
    rows = []
    for engine in ENGINES:
        steps, gap, off = (np.array([call[f"{engine}_{what}"] for call in calls]) for what in ("steps", "gap", "off"))
        alone = np.mean((steps == 0) & (gap <= ALONE_GAP))
        rows.append((engine, len(calls), alone, int(steps.max()), gap.max(), off.max(), int(off.argmax())))
        run.bar(f"{engine}: the layers' answer in the product's calls", alone, least=ALONE_SHARE)
        run.bar(f"{engine}: worst curve of the product's calls", off.max(), most=ALONE_BAR)
    columns = {"engine": "", "calls": "d", "layers, gap <= 1e-10": ".2%", "most steps": "d"}
    columns |= {"worst gap": ".1e", "worst curve": ".1e", "of number": "d"}
    run.table("The product's defaults", columns, rows)


def claim(run: Run) -> None:
    """All problems, then the product's calls."""
    kept: list[tuple[Problem, dict[str, Floats]]] = []
    done = 0
    with progress() as bar:
        task = bar.add_task("certifying", total=run.options.count)
        while done < run.options.count:
            problem, _ = draw(SEED, len(kept))
            kept.append((problem, judge(problem)))
            done += kept[-1][1]["reference"].size
            bar.update(task, completed=done)
    summary(run, kept)
    missed = [(number, *one) for number, one in enumerate(kept) if unproven(one[1])]
    if missed:
        rows = [(i, max(m[f"{engine}_recomputed"].max() for engine in ENGINES), p.label) for i, p, m in missed]
        run.table("Bar missed", {"number": "d", "gap": ".1e", "problem": ""}, rows)
    run.bar(f"calls with a gap > {GAP_BAR:.0e}, not refused", len(missed), most=0)
    defaults(run)
