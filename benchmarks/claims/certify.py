"""Are the answers optimal?

Seeded problems: measured cameras x lamps by name and by kind x one to three shots (one on `gaussian`) x 9 to 96
patches x λ₂ 0 and 1 x γ in [1e-6, 1] of γ_max x noise 0 to 2 % x signed and non-negative codes x Σ diagonal, full,
or the identity. A call on a learned basis is one convex problem of 72 unknowns, on `gaussian` three of 18, each with
a γ inside that range of its own γ_max.

Each is solved by the NumPy reference and by the shipped ONNX model, from raw patch means. The relative duality gap is
recomputed from the code and from the rows that were solved, in long double (64 bits of mantissa): by
`problems.relative_gap`, and the reference's rows whitened anew there. Rounding is then the engine's alone. The
model's own whitened rows come out of the same graph, built anew with two outputs more (this needs the package onnx).

Bars: recomputed gap <= 1e-9 in every problem that the engine does not refuse by name (`not_converged`, by its own gap
above 1e-6). Curves within 1e-6 of the peak of an oracle's wherever the optimum is unique. The rows of the two engines
within 1e-11: whitened rows are known up to a rotation only, so what is compared is what it leaves, Aᵀ Σ⁻¹ A and
Aᵀ Σ⁻¹ b, in parts of the atoms' lengths (and b's); a gap proves an answer to an engine's own rows only. The oracle,
on every `--oracle`th call, is cvxpy with Clarabel on columns of unit length, tolerances 1e-12, then exchanges of
single atoms from its signs (least squares by QR), kept where the gap shrinks. Unique: see `determined`. Where
Clarabel gives no answer, the oracle is the exchanges alone, from zero; that is counted as `oracle refused`.

Then the product as it ships: calls on the learned bases with its penalties (λ₂ 1, γ 0.05), 12 and 24 patches of
another measured table or of the tolerance told, one to three shots, lamps by name and by kind. How many end with the
layers' answer (`finish_steps` 0) and a gap <= 1e-10 (bar: 99 %), and how far the curves of those are from the exact
ones, in parts of their peak (bar: 1e-7 in all of them; of the calls that took the finish as well). Exact is the
reference's finish from the layers' answer, taken whatever their own proof says. How far the reference's layers are
where the finish was needed is told without a bar.

A problem that misses a bar is listed with its number; `--number N` solves it alone, `--default N` one of the
product's.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.claim import Run
from benchmarks.claims.lamps import draw as draw_kind
from benchmarks.claims.oracle import CURVE_BAR, oracle
from benchmarks.problems import (
    Problem,
    curves,
    distance,
    forced,
    gamma_max,
    gaps,
    make_problem,
    open_model,
    reflectances,
    rows_apart,
    temperature_mode,
    whiten,
    whiten_finely,
)
from benchmarks.shared import cameras, lamp, progress
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery import model as formulas
from camssf.recovery.basis import interpolate, read_basis
from camssf.recovery.covariance import CHART_CORRELATION, smooth_errors
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.onnx_model import SHIPPED, Model, load_model
from camssf.recovery.penalties import GAMMA, L2
from camssf.recovery.sensitivity import LARGEST_GAP
from camssf.spectra import read_chart
from camssf.spectra.families import FAMILIES
from golden.linear_model import solve

OPTIONS = {
    "count": (30_000, "convex problems; a call on `gaussian` has three"),
    "defaults": (10_000, "calls with the product's penalties"),
    "seed": (0, "of all problems"),
    "oracle": (20, "ask cvxpy about every so many calls; 0: never"),
    "number": (-1, "the problem of this number alone, with the oracle"),
    "default": (-1, "the product's call of this number alone"),
}
GAP_BAR, ROWS_BAR = 1e-9, 1e-11
ALONE_GAP, ALONE_BAR, ALONE_SHARE = 1e-10, 1e-7, 0.99
"""Gap and curve of the layers on the product's defaults; share of calls that need no finish."""
SMALLEST, LARGEST = 1e-6, 1.0
"""γ, in parts of γ_max."""
LEARNED = tuple(name for name in SHIPPED if name != "gaussian")
LAMPS = ("A", "D50", "D55", "D65", "equal-energy", "FL2", "FL11", "HP1", "LED-B3", "LED-V1", "2400K", "3000K")
KINDS = tuple(FAMILIES)
PATCHES = (9, 12, 18, 24, 48, 96)
PATCH_SHARES = (0.2, 0.25, 0.2, 0.3, 0.035, 0.015)


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


@cache
def row_reader(basis: str) -> Model | None:
    """The shipped model with its whitened rows as two outputs more, `rows` (p, N, r) and `target` (p, N).

    None without onnx. It is built anew by the same sources, which must first give the shipped bytes.
    """
    try:
        from camssf_onnx import models
    except ImportError:
        return None
    model = load_model(basis)
    name, paper = ("paper_model", True) if basis == "gaussian" else ("learned_model", False)
    function, posed = getattr(models, name), []

    def build() -> Any:
        return models.build_paper(read_basis(basis)) if paper else models.build_learned()

    if hashlib.sha256(build().SerializeToString(deterministic=True)).hexdigest() != model.sha256:
        raise RuntimeError(f"the model of {basis} is not what its sources make: run python -m camssf_onnx build")

    def pose(A: Any, b: Any, *penalties: Any) -> Any:
        posed.append((A, b))
        return ElasticNet(A, b, *penalties)

    def with_rows(*arguments: Any) -> Any:
        found = function(*arguments)
        return found | {"rows": posed[0][0][None, ...], "target": posed[0][1][None, ..., 0]}

    with patch.object(formulas, "ElasticNet", pose), patch.object(models, name, with_rows):
        content = build().SerializeToString()
    return Model(open_model(content), "", {}, model.arrays)


def model_rows(reader: Model, inputs: dict[str, Floats]) -> tuple[Floats, Floats]:
    """The whitened rows that the model solves, (p, N, r) and (p, N)."""
    found = reader.run(inputs)
    return found["rows"], found["target"]


ENGINES = ("reference", "onnx")


def judge(problem: Problem, ask_oracle: bool) -> dict[str, Floats]:
    """The engines' answers to one call, measured: name → (p,) or, of curves, (3,)."""
    basis = problem.anchored(read_basis(problem.basis))
    sensing = problem.sensing(basis)
    A, b = whiten(sensing)
    fine = whiten_finely(sensing)
    code = solve(sensing, problem.l2, problem.penalties(sensing), nonnegative=problem.nonnegative)
    out = load_model(problem.basis).run(problem.inputs)
    reader = row_reader(problem.basis)
    own = fine if reader is None else model_rows(reader, problem.inputs)
    answers = {"reference": curves(basis, code.values), "onnx": out["ssf"].T}
    measured = {
        "share": problem.gamma / gamma_max(A, b, problem.nonnegative),
        "reference": code.gap,
        "reference_recomputed": gaps(*fine, code.values, problem),
        "layers": code.layers_gap,
        "steps": code.finish_steps.astype(float),
        "onnx": out["gap"][: len(A)],
        "onnx_recomputed": gaps(*(rows.astype(np.longdouble) for rows in own), out["code"].T, problem),
        "apart": distance(answers["onnx"], answers["reference"]),
        "rows_apart": rows_apart(own, fine),
    }
    if ask_oracle:
        best = oracle(A, b, basis, problem.l2, problem.gamma, problem.nonnegative)
        truth = curves(basis, best.code)
        measured |= {
            "oracle_gap": best.gap,
            "determined": best.determined.astype(float),
            "oracle_refused": best.refused.astype(float),
        }
        measured |= {f"{engine}_off": distance(curve, truth) for engine, curve in answers.items()}
    return measured


def refused(own: Floats) -> Floats:
    """Where the product refuses by name: the engine's own gap is too large, or no number."""
    return np.asarray(~(own <= LARGEST_GAP))


def unproven(measured: dict[str, Floats], engine: str) -> Floats:
    """Where a gap is above the bar and nobody said so; NaN is."""
    return np.asarray(~refused(measured[engine]) & ~(measured[f"{engine}_recomputed"] <= GAP_BAR))


def _off(measured: dict[str, Floats], engine: str) -> Floats:
    """Distances from the oracle, 0 where its curve is not unique; a problem of three curves has one verdict."""
    return np.asarray(np.where(measured["determined"] > 0, measured[f"{engine}_off"], 0.0))


def misses(measured: dict[str, Floats]) -> dict[str, Floats]:
    """Every bar that a call misses, with its values; NaN misses."""
    found = {}
    for engine in ENGINES:
        if unproven(measured, engine).any():
            found[f"gap {engine}"] = measured[f"{engine}_recomputed"]
        if "determined" in measured and not (_off(measured, engine) <= CURVE_BAR).all():
            found[f"{engine} off oracle"] = measured[f"{engine}_off"]
    if not (measured["rows_apart"] <= ROWS_BAR).all():
        found["rows apart"] = measured["rows_apart"]
    return found


Kept = list[tuple[int, Problem, dict[str, Floats]]]


def largest(name: str, group: Sequence[dict[str, Floats]]) -> float | None:
    """Of all problems that have that number."""
    every = [measured[name].max() for measured in group if name in measured]
    return float(np.max(every)) if every else None


def summary(run: Run, kept: Kept) -> None:
    """A row a group of basis, λ₂, sign and number of shots, and one of all."""
    groups: dict[tuple[Any, ...], list[dict[str, Floats]]] = {}
    for _, problem, measured in kept:
        sign = "x >= 0" if problem.nonnegative else "signed"
        for key in (
            (problem.basis, str(int(problem.l2)), sign, str(len(problem.inputs["lamp"]))),
            ("~all", "", "", ""),
        ):
            groups.setdefault(key, []).append(measured)
    rows = []
    for key, group in sorted(groups.items()):
        asked = [measured for measured in group if "determined" in measured]
        steps = np.concatenate([measured["steps"] for measured in group])
        counts = [sum(m[name].sum() for m in asked) for name in ("determined", "oracle_refused")]
        off = [_off(measured, engine).max() for measured in asked for engine in ENGINES]
        rows.append((
            *(word.strip("~") for word in key), steps.size,
            sum(refused(measured[engine]).sum() for measured in group for engine in ENGINES),
            *(largest(name, group) for name in WORST), sum(m["determined"].size for m in asked), *map(int, counts),
            max(off, default=None), largest("oracle_gap", asked), np.mean(steps == 0), int(steps.max()),
        ))  # fmt: skip
    columns = dict.fromkeys(("basis", "l2", "sign", "shots"), "") | {"problems": "d", "refused": "d"}
    columns |= dict.fromkeys(WORST.values(), ".1e")
    columns |= dict.fromkeys(("oracle asked", "unique", "oracle refused"), "d")
    columns |= dict.fromkeys(("off oracle", "oracle gap"), ".1e") | {"no finish": ".0%", "most steps": "d"}
    run.table("Worst of each group", columns, rows)


WORST = {
    "reference": "gap reference",
    "onnx": "gap ONNX",
    "reference_recomputed": "recomputed reference",
    "onnx_recomputed": "recomputed ONNX",
    "apart": "reference - ONNX",
    "rows_apart": "rows apart",
}


def judge_default(problem: Problem) -> dict[str, float]:
    """One of the product's calls: steps of the finish, own gap, and the curves' distance from the exact ones."""
    basis = problem.anchored(read_basis(problem.basis))
    sensing = problem.sensing(basis)
    code = solve(sensing, problem.l2, problem.penalties(sensing))
    layers = solve(sensing, problem.l2, problem.penalties(sensing), finish=0)
    exact = forced(sensing, problem)
    truth = curves(basis, exact)
    out = load_model(problem.basis).run(problem.inputs)
    return {
        "exact_gap": float(gaps(*whiten_finely(sensing), exact, problem).max()),
        "reference_steps": float(code.finish_steps.max()),
        "reference_gap": float(code.gap.max()),
        "reference_off": float(distance(curves(basis, code.values), truth).max()),
        "layers_off": float(distance(curves(basis, layers.values), truth).max()),
        "onnx_steps": float(out["finish_steps"].max()),
        "onnx_gap": float(out["gap"].max()),
        "onnx_off": float(distance(out["ssf"].T, truth).max()),
    }


def defaults(run: Run) -> None:
    """The product's calls: a row a basis, number of shots and engine, and one of all an engine, which has bars."""
    groups: dict[tuple[str, str], list[tuple[int, dict[str, float]]]] = {}
    for index in run.track(range(run.options.defaults), "the product's defaults"):
        problem = draw_default(run.options.seed, index)
        measured = judge_default(problem)
        for key in ((problem.basis, str(len(problem.inputs["lamp"]))), ("~all", "")):
            groups.setdefault(key, []).append((index, measured))
    rows = []
    for ((basis, shots), group), engine in product(sorted(groups.items()), ENGINES):
        steps, gap, off = (
            np.array([measured[f"{engine}_{what}"] for _, measured in group]) for what in ("steps", "gap", "off")
        )
        alone = np.mean((steps == 0) & (gap <= ALONE_GAP))
        needed = [m["layers_off"] for _, m in group if m["reference_steps"] > 0]
        rows.append((
            basis.strip("~"), shots, engine, len(group), alone, int(steps.max()), gap.max(), off.max(),
            np.percentile(off, 99), int((~(off <= ALONE_BAR)).sum()), group[int(off.argmax())][0],
            max(needed, default=None) if engine == "reference" else None,
            max(measured["exact_gap"] for _, measured in group),
        ))  # fmt: skip
        if basis == "~all":
            run.bar(f"{engine}: the layers' answer in the product's calls", alone, least=ALONE_SHARE)
            run.bar(f"{engine}: worst curve of the product's calls", off.max(), most=ALONE_BAR)
    columns = {"basis": "", "shots": "", "engine": "", "calls": "d", "layers, gap <= 1e-10": ".2%", "most steps": "d"}
    columns |= dict.fromkeys(("worst gap", "worst curve", "99 % of curves"), ".1e")
    columns |= dict.fromkeys(("above 1e-7", "worst is number"), "d")
    columns |= dict.fromkeys(("layers before a finish", "exact curve's gap"), ".1e")
    run.table("The product's defaults; one call: --default NUMBER", columns, rows)


def problems(run: Run) -> Iterator[tuple[int, Problem, dict[str, Floats]]]:
    """Numbers, calls and what was measured, until so many convex problems are done."""
    done, index, every = 0, 0, run.options.oracle
    with progress() as bar:
        task = bar.add_task("certifying", total=run.options.count)
        while done < run.options.count:
            problem, _ = draw(run.options.seed, index)
            measured = judge(problem, every > 0 and index % every == 0)
            if "determined" not in measured and misses(measured):
                measured = judge(problem, True)  # what another solver reaches belongs beside a miss
            yield index, problem, measured
            done, index = done + measured["reference"].size, index + 1
            bar.update(task, completed=done)


def claim(run: Run) -> None:
    """All problems, then the product's calls; or one of them."""
    run.say(f"cameras: {cameras()[1]}; seed {run.options.seed}")
    if row_reader("cameras") is None:
        run.say("onnx is not installed: the ONNX code is recomputed on the reference's rows")
    if run.options.default >= 0 or run.options.number >= 0:
        seed, number = run.options.seed, max(run.options.default, run.options.number)
        problem = draw_default(seed, number) if run.options.default >= 0 else draw(seed, number)[0]
        run.say(f"{problem.basis}: {problem.label}, λ₂ {problem.l2:g}, γ {problem.gamma:.3g}")
        found: Any = judge_default(problem) if run.options.default >= 0 else judge(problem, True)
        for name, values in found.items():
            run.say(f"{name:24} {' '.join(f'{value:.3e}' for value in np.atleast_1d(values))}")
        return
    kept = list(problems(run))
    summary(run, kept)
    steps, before = (np.concatenate([measured[name] for *_, measured in kept]) for name in ("steps", "layers"))
    run.say(
        f"{len(kept)} calls, {steps.size} convex problems. Steps of the reference's finish: none in "
        f"{100 * np.mean(steps == 0):.1f} %, median of the others {np.median(steps[steps > 0]):.0f}, most "
        f"{steps.max():.0f}. Gap of the layers: median {np.median(before):.1e}, worst {before.max():.1e}."
    )
    missed = [(index, problem, measured) for index, problem, measured in kept if misses(measured)]
    rows = [
        (index, bar, values.max(), largest("oracle_gap", [measured]), problem.basis, f"{problem.l2:g}",
         "x >= 0" if problem.nonnegative else "signed", min(measured["share"]), problem.label)
        for index, problem, measured in missed for bar, values in misses(measured).items()
    ]  # fmt: skip
    if rows:
        columns = {"number": "d", "bar": "", "worst": ".1e", "oracle's": ".1e", "basis": "", "l2": "", "sign": ""}
        columns |= {"γ / γ_max": ".1e", "problem": ""}
        run.table("Bars missed; one problem: --number NUMBER", columns, rows)
    name = (
        f"calls with a gap > {GAP_BAR:.0e}, not refused, curves beyond {CURVE_BAR:.0e} or rows beyond {ROWS_BAR:.0e}"
    )
    run.bar(name, len(missed), most=0)
    if run.options.defaults:
        defaults(run)
