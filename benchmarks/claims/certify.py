"""Are the answers optimal? `python -m benchmarks.claims.certify [--count 30000] [--defaults 10000] [--seed 0]`

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
on every --oracle-every-th call, is cvxpy with Clarabel on columns of unit length, tolerances 1e-12, then exchanges of
single atoms from its signs (least squares by QR), kept where the gap shrinks. Unique: see `determined`. Where
Clarabel gives no answer, the oracle is the exchanges alone, from zero; that is counted as `oracle refused`.

Then the product as it ships: calls on the learned bases with its penalties (λ₂ 1, γ 0.05), 12 and 24 patches of
another measured table or of the tolerance told, one to three shots, lamps by name and by kind. How many end with the
layers' answer (`finish_steps` 0) and a gap <= 1e-10 (bar: 99 %), and how far the curves of those are from the exact
ones, in parts of their peak (bar: 1e-7 in all of them; of the calls that took the finish as well). Exact is the
reference's finish from the layers' answer, taken whatever their own proof says. How far the reference's layers are
where the finish was needed is told without a bar.

A problem that misses a bar is listed with its number; `--only NUMBER` solves it alone, `--only-default NUMBER` one of
the product's. Exit status 1 then.
"""

from __future__ import annotations

import hashlib
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.claims.lamps import draw as draw_kind
from benchmarks.claims.oracle import CURVE_BAR, oracle
from benchmarks.problems import (
    Long,
    Problem,
    curves,
    distance,
    forced,
    gamma_max,
    gaps,
    make_problem,
    open_model,
    reflectances,
    temperature_mode,
    whiten,
    whiten_finely,
)
from benchmarks.shared import cameras, command_parser, console, lamp, one_thread, progress, save, table, versions
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
        basis,
        known[name],
        lights.stated,
        seen,
        reflectance,
        noise=noise,
        rng=rng,
        l2=l2,
        gamma=1.0,
        nonnegative=nonnegative,
        standard_error=np.ones(1) if sigma == "identity" else None,
        lamp_tolerance=lights.tolerance,
        lamp_modes=lights.modes,
        light=lights.true,
        white=white,
        label=f"{name}, {' + '.join(names)}, {n} patches, noise {100 * noise:.2f} %, {sigma}",
        **extra,
    )
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
        str(rng.choice(LEARNED)),
        known[name],
        lights.stated,
        seen,
        reflectance,
        noise=noise,
        rng=rng,
        l2=L2,
        gamma=GAMMA,
        nonnegative=False,
        chart_tolerance=0.03,
        white_tolerance=0.01,
        lamp_tolerance=lights.tolerance,
        lamp_modes=lights.modes,
        light=lights.true,
        label=f"{name}, {' + '.join(names)}, {n} patches{' of Ohta' if foreign else ''}, noise {100 * noise:.2f} %",
    )


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


def rows_apart(own: tuple[Floats, Floats], fine: tuple[Long, Long]) -> Floats:
    """(p,) how far whitened rows are from the reference's, in what no rotation of them changes.

    |H_ij - H'_ij| in parts of √(H'_ii H'_jj), with b as one column more, the worst.
    """
    apart = []
    for A, b, fine_A, fine_b in zip(*own, *fine, strict=True):
        pairs = (np.column_stack(pair).astype(np.longdouble) for pair in ((A, b), (fine_A, fine_b)))
        ours, theirs = (columns.T @ columns for columns in pairs)
        length = np.sqrt(np.diag(theirs))
        length = np.where(length > 0, length, 1.0)
        apart.append(float(np.max(np.abs(ours - theirs) / (length * length[:, None]))))
    return np.array(apart)


ENGINES = ("reference", "onnx")


def judge(problem: Problem, ask_oracle: bool, engines: Sequence[str] = ENGINES) -> dict[str, Floats]:
    """The engines' answers to one call, measured: name → (p,) or, of curves, (3,)."""
    basis = problem.anchored(read_basis(problem.basis))
    sensing = problem.sensing(basis)
    A, b = whiten(sensing)
    fine = whiten_finely(sensing)
    code = solve(sensing, problem.l2, problem.penalties(sensing), nonnegative=problem.nonnegative)
    reference = curves(basis, code.values)
    measured = {
        "share": problem.gamma / gamma_max(A, b, problem.nonnegative),
        "reference": code.gap,
        "reference_recomputed": gaps(*fine, code.values, problem),
        "layers": code.layers_gap,
        "steps": code.finish_steps.astype(float),
    }
    found = {"reference": reference}
    if "onnx" in engines:
        out = load_model(problem.basis).run(problem.inputs)
        x = out["code"].T
        found["onnx"] = out["ssf"].T
        reader = row_reader(problem.basis)
        own = fine if reader is None else model_rows(reader, problem.inputs)
        measured |= {
            "onnx": out["gap"][: len(A)],
            "onnx_recomputed": gaps(*(each.astype(np.longdouble) for each in own), x, problem),
            "onnx_on_reference_rows": gaps(*fine, x, problem),
            "onnx_layers": out["layers_gap"],
            "onnx_steps": out["finish_steps"],
            "apart": distance(found["onnx"], reference),
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
        measured |= {f"{engine}_off": distance(curve, truth) for engine, curve in found.items()}
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


def misses(index: int, problem: Problem, measured: dict[str, Floats]) -> list[dict[str, Any]]:
    """Every bar that a call misses; NaN misses."""
    found = []
    engines = [engine for engine in ENGINES if engine in measured]
    for engine in engines:
        if unproven(measured, engine).any():
            found.append((f"gap {engine}", measured[f"{engine}_recomputed"]))
        if "determined" in measured and not (_off(measured, engine) <= CURVE_BAR).all():
            found.append((f"{engine} off oracle", measured[f"{engine}_off"]))
    if "rows_apart" in measured and not (measured["rows_apart"] <= ROWS_BAR).all():
        found.append(("rows apart", measured["rows_apart"]))
    return [
        {
            "index": index, "bar": bar, "values": values.tolist(), "basis": problem.basis, "l2": problem.l2,
            "gamma": problem.gamma, "share": measured["share"].tolist(), "nonnegative": problem.nonnegative,
            "problem": problem.label, "steps": measured["steps"].tolist(),
            "oracle_gap": measured.get("oracle_gap", np.zeros(0)).tolist(),
        }
        for bar, values in found
    ]  # fmt: skip


WORST = {
    "gap reference": "reference",
    "gap ONNX": "onnx",
    "recomputed reference": "reference_recomputed",
    "recomputed ONNX": "onnx_recomputed",
    "reference - ONNX": "apart",
    "rows apart": "rows_apart",
}
Kept = list[tuple[Problem, dict[str, Floats]]]


def summary(kept: Kept) -> list[dict[str, Any]]:
    """One row a group of basis, λ₂, sign and number of shots, and one of all."""
    groups: dict[tuple[Any, ...], list[dict[str, Floats]]] = {}
    for problem, measured in kept:
        key = (problem.basis, int(problem.l2), "x >= 0" if problem.nonnegative else "signed")
        groups.setdefault((*key, len(problem.inputs["lamp"])), []).append(measured)
    rows = []
    for key, group in [*sorted(groups.items()), (("all", "", "", ""), [measured for _, measured in kept])]:
        asked = [measured for measured in group if "determined" in measured]
        engines = [engine for engine in ENGINES if engine in group[0]]
        row = dict(zip(("basis", "l2", "sign", "shots"), key, strict=True))
        row |= {"problems": int(sum(measured["reference"].size for measured in group))}
        row |= {"refused": int(sum(refused(m[engine]).sum() for m in group for engine in engines))}
        row |= {
            head: float(np.max(np.concatenate([measured[name] for measured in group])))
            for head, name in WORST.items()
            if name in group[0]
        }
        rows.append(
            row
            | {
                "oracle asked": sum(m["determined"].size for m in asked),
                "unique": int(sum(m["determined"].sum() for m in asked)),
                "oracle refused": int(sum(m["oracle_refused"].sum() for m in asked)),
                "off oracle": float(np.max([_off(m, e).max() for m in asked for e in engines])) if asked else None,
                "oracle gap": float(np.max(np.concatenate([m["oracle_gap"] for m in asked]))) if asked else None,
                "no finish": float(np.mean(np.concatenate([m["steps"] for m in group]) == 0)),
                "most steps": int(np.max(np.concatenate([m["steps"] for m in group]))),
            }
        )
    return rows


def by_gamma(kept: Kept) -> list[dict[str, Any]]:
    """One row a λ₂ and a tenfold of γ / γ_max: where float64 ends."""
    rows = []
    for l2 in (0, 1):
        for power in range(-6, 0):
            group: list[tuple[dict[str, Floats], Any]] = []
            for problem, measured in kept:
                decade = np.clip(np.floor(np.log10(measured["share"])), -6, -1)
                if problem.l2 == l2 and (decade == power).any():
                    group.append((measured, decade == power))
            if not group:
                continue
            row: dict[str, Any] = {"l2": l2, "γ / γ_max": f"1e{power} to 1e{power + 1}"}
            row["problems"] = int(sum(here.sum() for _, here in group))
            for engine, word in (("reference", "reference"), ("onnx", "ONNX")):
                if engine in group[0][0]:
                    row[f"above {GAP_BAR:.0e}, {word}"] = int(
                        sum(unproven(m, engine)[here].sum() for m, here in group)
                    )
                    row[f"refused, {word}"] = int(sum(refused(m[engine])[here].sum() for m, here in group))
                    worst = [m[f"{engine}_recomputed"][here & ~refused(m[engine])] for m, here in group]
                    row[f"worst, {word}"] = float(np.max(np.concatenate(worst), initial=0.0))
            row["no finish"] = float(np.mean(np.concatenate([m["steps"][here] for m, here in group]) == 0))
            rows.append(row)
    return rows


def judge_default(problem: Problem, engines: Sequence[str] = ENGINES) -> dict[str, float]:
    """One of the product's calls: steps of the finish, own gap, and the curves' distance from the exact ones."""
    basis = problem.anchored(read_basis(problem.basis))
    sensing = problem.sensing(basis)
    code = solve(sensing, problem.l2, problem.penalties(sensing))
    layers = solve(sensing, problem.l2, problem.penalties(sensing), finish=0)
    exact = forced(sensing, problem)
    truth = curves(basis, exact)
    measured = {
        "exact_gap": float(gaps(*whiten_finely(sensing), exact, problem).max()),
        "reference_steps": float(code.finish_steps.max()),
        "reference_gap": float(code.gap.max()),
        "reference_off": float(distance(curves(basis, code.values), truth).max()),
        "layers_off": float(distance(curves(basis, layers.values), truth).max()),
    }
    if "onnx" in engines:
        out = load_model(problem.basis).run(problem.inputs)
        measured |= {
            "onnx_steps": float(out["finish_steps"].max()),
            "onnx_gap": float(out["gap"].max()),
            "onnx_off": float(distance(out["ssf"].T, truth).max()),
        }
    return measured


def defaults(seed: int, numbers: Sequence[int], engines: Sequence[str]) -> tuple[list[dict[str, Any]], bool]:
    """The product's calls: a row a basis, number of shots and engine, one of all an engine; whether these hold."""
    kept: list[tuple[int, Problem, dict[str, float]]] = []
    with progress() as bar:
        for index in bar.track(numbers, description="the product's defaults"):
            problem = draw_default(seed, index)
            kept.append((index, problem, judge_default(problem, engines)))
    groups: dict[tuple[Any, ...], list[tuple[int, dict[str, float]]]] = {}
    for index, problem, measured in kept:
        for key in ((problem.basis, len(problem.inputs["lamp"])), ("all", "")):
            groups.setdefault(key, []).append((index, measured))
    rows, held = [], True
    for (basis, shots), group in sorted(groups.items(), key=lambda item: (item[0][0] == "all", item[0])):
        for engine in engines:
            steps, gap, off = (
                np.array([measured[f"{engine}_{what}"] for _, measured in group]) for what in ("steps", "gap", "off")
            )
            alone = (steps == 0) & (gap <= ALONE_GAP)
            good = bool(alone.mean() >= ALONE_SHARE and (off <= ALONE_BAR).all())
            held &= good or basis != "all"
            needed = [m["layers_off"] for _, m in group if m["reference_steps"] > 0]
            rows.append(
                {
                    "basis": basis,
                    "shots": shots,
                    "engine": engine,
                    "calls": len(group),
                    "layers, gap <= 1e-10": f"{100 * alone.mean():.2f} %",
                    "most steps": int(steps.max()),
                    "worst gap": float(gap.max()),
                    "worst curve": float(off.max()),
                    "99 % of curves": float(np.percentile(off, 99)),
                    "above 1e-7": int((~(off <= ALONE_BAR)).sum()),
                    "worst is number": group[int(off.argmax())][0],
                    "layers before a finish": max(needed, default=None) if engine == "reference" else None,
                    "exact curve's gap": float(max(measured["exact_gap"] for _, measured in group)),
                    "held": "held" if good else "MISSED",
                }
            )
    return rows, held


def main(arguments: list[str] | None = None) -> int:
    parser = command_parser(__spec__, __doc__)
    parser.add_argument("--count", type=int, default=30_000, help="convex problems; a call on `gaussian` has three")
    parser.add_argument("--defaults", type=int, default=10_000, help="calls with the product's penalties")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--oracle-every", type=int, default=20, help="ask cvxpy about every so many calls; 0: never")
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=list(ENGINES))
    parser.add_argument("--only", type=int, help="the problem of this number alone, with the oracle")
    parser.add_argument("--only-default", type=int, help="the product's call of this number alone")
    options = parser.parse_args(arguments)
    out = console()
    out.print(f"cameras: {cameras()[1]}; seed {options.seed}")
    engines = [engine for engine in ENGINES if engine == "reference" or engine in options.engines]
    if "onnx" in engines and row_reader("cameras") is None:
        out.print("onnx is not installed: the ONNX code is recomputed on the reference's rows")
    if options.only_default is not None:
        problem = draw_default(options.seed, options.only_default)
        out.print(f"{problem.basis}: {problem.label}")
        for name, value in judge_default(problem, engines).items():
            out.print(f"{name:24} {value:.3e}")
        return 0
    kept: Kept = []
    missed: list[dict[str, Any]] = []
    start, index, done = time.perf_counter(), options.only or 0, 0
    with progress() as bar:
        task = bar.add_task("certifying", total=1 if options.only is not None else options.count)
        while done < (1 if options.only is not None else options.count):
            problem, _ = draw(options.seed, index)
            every = options.oracle_every
            measured = judge(problem, options.only is not None or (every > 0 and index % every == 0), engines)
            if "determined" not in measured and misses(index, problem, measured):
                measured = judge(problem, True, engines)  # what another solver reaches belongs beside a miss
            kept.append((problem, measured))
            missed += misses(index, problem, measured)
            done, index = done + measured["reference"].size, index + 1
            bar.update(task, completed=done)
    seconds = time.perf_counter() - start
    if options.only is not None:
        problem, measured = kept[0]
        out.print(f"{problem.basis}: {problem.label}, λ₂ {problem.l2:g}, γ {problem.gamma:.3g}, "
                  f"{'x >= 0' if problem.nonnegative else 'signed'}")  # fmt: skip
        for name, values in measured.items():
            out.print(f"{name:24} {' '.join(f'{value:.3e}' for value in values)}")
        return 1 if missed else 0
    rows, decades = summary(kept), by_gamma(kept)
    key, asked = (
        ("basis", "l2", "sign", "shots"),
        ("oracle asked", "unique", "oracle refused", "off oracle", "oracle gap"),
    )
    gap_columns = [name for name in rows[0] if name not in (*key, *asked)]
    for title, lines, columns in (
        ("Worst of each group", rows, [*key, *gap_columns]),
        ("Beside the oracle", rows, [*key, *asked]),
        ("By γ", decades, list(decades[0])),
    ):
        out.print(table(title, columns, [[_cell(row[name], name) for name in columns] for row in lines]))
    steps = np.concatenate([measured["steps"] for _, measured in kept])
    before = np.concatenate([measured["layers"] for _, measured in kept])
    out.print(
        f"{len(kept)} calls, {done} convex problems, {seconds:.0f} s. Steps of the reference's finish: none in "
        f"{100 * np.mean(steps == 0):.1f} %, median of the others {np.median(steps[steps > 0]):.0f}, most "
        f"{steps.max():.0f}. Gap of the layers: median {np.median(before):.1e}, worst {before.max():.1e}."
    )
    if "onnx" in engines:
        elsewhere = np.concatenate([measured["onnx_on_reference_rows"] for _, measured in kept])
        out.print(
            f"On the reference's rows, which differ from the model's by rounding, {int((elsewhere > GAP_BAR).sum())} "
            f"of the ONNX codes have a gap above 1e-9, at most {elsewhere.max():.1e}."
        )
    if rows[-1]["oracle refused"]:
        out.print(
            f"oracle refused: Clarabel gave no answer to {rows[-1]['oracle refused']} of {rows[-1]['oracle asked']} "
            "problems; there the exchanges started from zero."
        )
    if missed:
        head = ("index", "bar", "worst", "oracle's", "basis", "l2", "sign", "γ / γ_max", "problem")
        shown = [
            (
                m["index"], m["bar"], f"{np.max(m['values']):.1e}", f"{np.max(m['oracle_gap'], initial=0.0):.1e}",
                m["basis"], f"{m['l2']:g}", "x >= 0" if m["nonnegative"] else "signed", f"{min(m['share']):.1e}",
                m["problem"],
            )
            for m in missed
        ]  # fmt: skip
        out.print(table(f"Bars missed; reproduce with --seed {options.seed} --only INDEX", head, shown))
    proven = not missed
    out.print(
        f"gap <= {GAP_BAR:.0e} or refused, curves within {CURVE_BAR:.0e} and rows within {ROWS_BAR:.0e}: "
        + ("held" if proven else f"MISSED by {len({m['index'] for m in missed})} of {len(kept)} calls")
    )
    content: dict[str, Any] = {
        "seed": options.seed, "calls": len(kept), "problems": done, "cameras": cameras()[1],
        "seconds": round(seconds, 1), "engines": engines, "versions": versions("cvxpy", "clarabel", "onnx"),
        "gap_bar": GAP_BAR, "curve_bar": CURVE_BAR, "rows_bar": ROWS_BAR, "groups": rows, "by_gamma": decades,
        "missed": missed,
    }  # fmt: skip
    alone = True
    if options.defaults:
        calls, alone = defaults(options.seed, range(options.defaults), engines)
        title = f"The product's defaults; one call: --seed {options.seed} --only-default NUMBER"
        out.print(table(title, list(calls[0]), [[_cell(value) for value in row.values()] for row in calls]))
        out.print(
            f"the layers' answer in {100 * ALONE_SHARE:.0f} % of the product's calls, curves within {ALONE_BAR:.0e}: "
            + ("held" if alone else "MISSED")
        )
        content["defaults"] = calls
    out.print(f"written: {save('certify', content)}")
    return 0 if proven and alone else 1


def _cell(value: object, column: str = "") -> str:
    if value is None:
        return ""
    if column == "no finish":
        return f"{100 * float(str(value)):.0f} %"
    return f"{value:.1e}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    one_thread(__spec__)
    sys.exit(main())
