"""Are the answers optimal? `python -m benchmarks.certify [--count 10000] [--seed 0]`

Seeded problems: measured cameras x lamps x one to three shots (one on `gaussian`) x 9 to 96 patches x λ₂ 0 and 1 x
γ in [1e-5, 1e-1] of γ_max x noise 0 to 2 % x signed and non-negative codes x Σ diagonal, full, or the identity.
A problem is one call: three channels, each with a γ inside that range of its own γ_max; so a count of 10,000 is
30,000 convex problems, and the table's worst values run over all of them.

Each is solved by the NumPy reference and by the shipped ONNX model, from raw patch means. Bars: relative duality gap
<= 1e-9 on every channel, as the engine itself reports it and as recomputed here from its code and the rows that it
solved, whitened by Cholesky (`_common.relative_gap`). The ONNX model's own rows are read out of its graph, which
needs the package onnx: a few roundings in the rows already move so small a gap. Curves within 1e-6 of the peak of an
oracle's wherever the optimum is unique. A, b and Σ of the two engines within 1e-11 of their largest numbers: a gap
proves an answer to an engine's own rows only. The oracle, on every --oracle-every-th problem, is cvxpy with Clarabel
on columns of unit length, tolerances 1e-12, then exchanges of single atoms from its signs (least squares by QR), kept
where the gap shrinks. Unique: see `determined`.

Where Clarabel gives no answer, the oracle is the exchanges alone, from zero; that is counted as `oracle refused`.

A problem that misses a bar is listed with its number; `--only NUMBER` solves it alone. Exit status 1 then.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from dataclasses import dataclass
from functools import cache
from importlib import import_module, resources
from typing import Any

import numpy as np

from benchmarks._common import (
    Problem,
    cameras,
    console,
    curves,
    distance,
    gamma_max,
    lamp,
    make_problem,
    one_thread,
    progress,
    reflectances,
    relative_gap,
    save,
    table,
    temperature_mode,
    versions,
    whiten,
)
from camssf.curves.basis import Basis, interpolate, read_basis
from camssf.curves.code import solve
from camssf.curves.covariance import CHART_CORRELATION, smooth_errors
from camssf.curves.engine import load_model, onnx_runtime
from camssf.curves.sensing import Sensing
from camssf.grid import WAVELENGTHS, Floats

GAP_BAR, CURVE_BAR, ROWS_BAR = 1e-9, 1e-6, 1e-11
LAMPS = ("A", "D50", "D55", "D65", "equal-energy", "FL2", "FL11", "HP1", "LED-B3", "LED-V1", "2400K", "3000K")
PATCHES = (9, 12, 18, 24, 48, 96)
PATCH_SHARES = (0.2, 0.25, 0.2, 0.3, 0.035, 0.015)


def draw(seed: int, index: int) -> tuple[Problem, str]:
    """The problem of that number, the same on every machine, and its kind of Σ."""
    rng = np.random.default_rng([seed, index])
    basis = "gaussian" if rng.random() < 0.25 else "cameras"
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
        extra = {"chart_tolerance": 0.03, "white_tolerance": 0.01, "lamp_tolerance": 0.02}
        errors = interpolate(smooth_errors(CHART_CORRELATION))
        seen = reflectance * (1.0 + 0.02 * (errors @ rng.normal(size=(errors.shape[1], n))).T)
    elif basis == "gaussian" and sigma == "diagonal":
        extra = {"chart_tolerance": float(rng.choice((0.0, 0.03)))}
    modes = np.zeros((k, 1, WAVELENGTHS.size))
    if sigma == "full" and rng.random() < 0.5:
        modes[:, 0] = temperature_mode(5500.0, 300.0)
    white = None if rng.random() < 0.5 else 0.92 - 0.1 * (WAVELENGTHS - 380.0) / 340.0
    problem = make_problem(
        basis,
        known[name],
        np.stack([lamp(x) for x in names]),
        seen,
        reflectance,
        noise=noise,
        rng=rng,
        l2=l2,
        gamma=1.0,
        nonnegative=nonnegative,
        standard_error=np.ones(1) if sigma == "identity" else None,
        lamp_modes=modes,
        white=white,
        label=f"{name}, {' + '.join(names)}, {n} patches, noise {100 * noise:.2f} %, {sigma}",
        **extra,
    )
    top = gamma_max(*whiten(problem.sensing(read_basis(basis))), nonnegative)
    # Inside every channel's range; in the rare case that these do not overlap, between them.
    low, high = sorted((1e-5 * top.max(), 1e-1 * top.min()))
    gamma = np.exp(rng.uniform(np.log(low), np.log(high)))
    return Problem(problem.inputs | {"gamma": np.array(gamma)}, basis, problem.label), sigma


@dataclass(frozen=True)
class Oracle:
    """The convex solution by another solver. First axis: channels.

    Attributes:
        code: (3, r).
        gap: (3,) relative, of the code.
        determined: (3,) whether the optimum is unique and its curve known to the bar.
        refused: (3,) whether Clarabel ended without an answer; the polish then starts from zero.
    """

    code: Floats
    gap: Floats
    determined: Floats
    refused: Floats


def oracle(A: Floats, b: Floats, basis: Basis, l2: float, gamma: float, nonnegative: bool) -> Oracle:
    """cvxpy and Clarabel on whitened rows (3, N, r), (3, N), polished on the support."""
    codes, gaps, unique, refused = [], [], [], []
    for c in range(3):
        answer = _clarabel(A[c], b[c], l2, gamma, nonnegative)
        refused.append(answer is None)
        x = np.zeros(A.shape[2]) if answer is None else answer
        gap = relative_gap(A[c], b[c], x, l2, gamma, nonnegative)
        for threshold in 10.0 ** np.arange(-12.0, -3.0):
            other = _polish(A[c], b[c], x, l2, gamma, nonnegative, threshold)
            other_gap = relative_gap(A[c], b[c], other, l2, gamma, nonnegative)
            if other_gap < gap:
                x, gap = other, other_gap
        codes.append(x)
        gaps.append(gap)
        unique.append(determined(A[c], b[c], x, basis.dictionary[c], basis.mean[c], l2, gamma, nonnegative))
    return Oracle(np.array(codes), np.array(gaps), np.array(unique), np.array(refused))


def _clarabel(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Floats | None:
    """Clarabel's code; None where it gives none, by an error of cvxpy or without."""
    cp: Any = import_module("cvxpy")
    length = np.sqrt((A**2).sum(axis=0) + l2)
    length = np.where(length > 0, length, 1.0)
    size = max(float(np.linalg.norm(b)), 1e-300)
    z = cp.Variable(A.shape[1], nonneg=nonnegative)  # x = size · z / length
    parts = [0.5 * cp.sum_squares(A / length @ z - b / size), gamma / size * (1.0 / length) @ cp.abs(z)]
    if l2 > 0:
        parts.append(0.5 * l2 * cp.sum_squares(cp.multiply(1.0 / length, z)))
    tight = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas", "tol_ktratio"), 1e-12)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "may be inaccurate": its own gap judges it, and the polish follows
        try:
            cp.Problem(cp.Minimize(sum(parts))).solve(solver=cp.CLARABEL, max_iter=200, **tight)
        except cp.error.SolverError:
            return None
    return None if z.value is None else np.asarray(z.value) * size / length


def _polish(A: Floats, b: Floats, x: Floats, l2: float, gamma: float, nonnegative: bool, threshold: float) -> Floats:
    """From the signs that x has above the threshold to those of the optimum, one atom out or in at a time.

    Least squares by QR, less its shrinkage; an atom of the wrong sign leaves, else the worst one beyond its bound
    enters. It may circle: the gap judges, and the steps are counted.
    """
    length = np.sqrt((A**2).sum(axis=0) + l2)
    weight = np.abs(x) * length
    signs = np.where(weight > threshold * weight.max(initial=0.0), np.sign(x), 0.0)
    signs = np.maximum(signs, 0.0) if nonnegative else signs
    best, least = x, np.inf
    for _ in range(2 * x.size):
        made = _least_squares(A, b, signs, l2, gamma)
        if made is None:
            break
        gap = relative_gap(A, b, made, l2, gamma, nonnegative) if (made * signs >= 0).all() else np.inf
        if gap < least:
            best, least = made, gap
        wrong = np.where(made * signs < 0, np.abs(made) * length, 0.0)
        w = A.T @ (b - A @ made) - l2 * made
        beyond = np.where(signs == 0, (w if nonnegative else np.abs(w)) - gamma, 0.0) / length
        if wrong.any():
            signs[wrong.argmax()] = 0.0
        elif (beyond > 1e-12 * gamma / length).any():
            signs[beyond.argmax()] = np.sign(w[beyond.argmax()])
        else:
            break
    return best


def _least_squares(A: Floats, b: Floats, signs: Floats, l2: float, gamma: float) -> Floats | None:
    """The optimum among codes of these signs, wherever they lead; None where their atoms are dependent."""
    on = signs != 0
    made = np.zeros_like(signs)
    if not on.any():
        return made
    if l2 == 0 and on.sum() > len(b):
        return None
    stacked = np.concatenate([A[:, on], np.sqrt(l2) * np.eye(int(on.sum()))]) if l2 > 0 else A[:, on]
    target = np.concatenate([b, np.zeros(len(stacked) - len(b))])
    Q, R = np.linalg.qr(stacked)
    if np.abs(np.diag(R)).min() <= 1e-15 * np.abs(np.diag(R)).max():
        return None
    made[on] = np.linalg.solve(R, Q.T @ target - gamma * np.linalg.solve(R.T, signs[on]))
    return made


def determined(
    A: Floats, b: Floats, x: Floats, atoms: Floats, mean: Floats, l2: float, gamma: float, nonnegative: bool
) -> bool:
    """Whether the optimum is unique, and so well that its curve is known to 1e-6 of the peak in float64.

    E = the atoms at their bound, |w| >= γ (1 - 1e-6). Unique where the columns of E (with √λ₂ below them) are
    independent; strictly complementary where every atom of E serves. Known where the curve's worst error s_E M_EE⁻¹
    s_Eᵀ, for a change of the objective by one rounding, 2⁻⁵² of it, stays below the bar.
    """
    r = b - A @ x
    w = A.T @ r - l2 * x
    at_bound = (w if nonnegative else np.abs(w)) >= gamma * (1.0 - 1e-6)
    serves = x != 0
    if (serves & ~at_bound).any() or (at_bound & ~serves).any():
        return False
    if not serves.any():
        return True
    stacked = np.concatenate([A[:, serves], np.sqrt(l2) * np.eye(int(serves.sum()))])
    R: Floats = np.linalg.qr(stacked)[1]
    if np.abs(np.diag(R)).min() <= 1e-14 * np.abs(np.diag(R)).max():
        return False
    reach = np.linalg.solve(R.T, atoms[:, serves].T)
    objective = 0.5 * float(r @ r + l2 * x @ x) + gamma * float(np.abs(x).sum())
    loose = np.sqrt(2.0 * 2.0**-52 * objective * (reach**2).sum(axis=0).max())
    return bool(loose <= CURVE_BAR * np.abs(mean + atoms @ x).max())


@cache
def row_reader(basis: str) -> Any:
    """The shipped model, opened where its rows are whitened: gives (turns, 3, N, ...) of (Σ | A | b | ...).

    None without onnx. On `cameras` rows are formed in a Loop of one or two turns, of which the last counts.
    """
    try:
        import onnx
    except ImportError:
        return None
    onnxruntime = onnx_runtime()
    model = onnx.load_from_string((resources.files("camssf") / "data" / f"camssf-{basis}.onnx").read_bytes())
    nodes = list(model.graph.node)
    first = next(i for i, node in enumerate(nodes) if node.op_type == "Loop")
    body = nodes[first].attribute[0].g
    inner = next((node for node in body.node if node.op_type == "Loop"), None)
    if inner is None:
        system = nodes[first].input[2]
        del model.graph.node[first:]
    else:
        system = "systems"
        body.output.append(onnx.helper.make_tensor_value_info(inner.input[2], onnx.TensorProto.DOUBLE, None))
        nodes[first].output.append(system)
        del model.graph.node[first + 1 :]
    del model.graph.output[:]
    model.graph.output.append(onnx.helper.make_tensor_value_info(system, onnx.TensorProto.DOUBLE, None))
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])


def model_rows(problem: Problem, reference: Sensing) -> Sensing:
    """The rows that the model forms; the reference's where they cannot be read."""
    session = row_reader(problem.basis)
    if session is None:
        return reference
    (system,) = session.run(None, problem.inputs)
    system = system[-1] if system.ndim == 4 else system
    N, r = reference.target.shape[1], reference.matrix.shape[2]
    own = Sensing(system[:, :, N : N + r], system[:, :, N + r], system[:, :, :N])
    if own.matrix.shape != reference.matrix.shape or not (rows_apart(own, reference) <= 1e-3).all():
        raise RuntimeError("the model's rows are not where this benchmark looks for them")
    return own


def rows_apart(own: Sensing, reference: Sensing) -> Floats:
    """(3,) how far A, b and Σ of two engines are apart, each in parts of its largest number, the worst of the three.

    A gap proves an answer to an engine's own rows; that these are the right rows is proven here.
    """

    def apart(found: Floats, known: Floats) -> Floats:
        axes = tuple(range(1, known.ndim))
        size = np.abs(known).max(axis=axes)
        return np.asarray(np.abs(found - known).max(axis=axes) / np.where(size > 0, size, 1.0))

    pairs = [(getattr(own, name), getattr(reference, name)) for name in ("matrix", "target", "covariance")]
    return np.asarray(np.max([apart(found, known) for found, known in pairs], axis=0))


def judge(problem: Problem, ask_oracle: bool) -> dict[str, Floats]:
    """Both engines' answers to one problem, measured: name → (3,)."""
    basis = problem.anchored(read_basis(problem.basis))
    sensing = problem.sensing(basis)
    A, b = whiten(sensing)
    l2, gamma, nonnegative = problem.l2, problem.gamma, problem.nonnegative
    code = solve(sensing, l2, np.full(3, gamma), nonnegative=nonnegative)
    out = load_model(problem.basis).run(problem.inputs)
    onnx = out["code"].T
    reference = curves(basis, code.values)
    rows = model_rows(problem, sensing)
    own = whiten(rows)
    measured = {
        "reference": code.gap,
        "onnx": out["gap"],
        "reference_recomputed": _gaps(A, b, code.values, l2, gamma, nonnegative),
        "onnx_recomputed": _gaps(*own, onnx, l2, gamma, nonnegative),
        "onnx_on_reference_rows": _gaps(A, b, onnx, l2, gamma, nonnegative),
        "apart": distance(out["ssf"].T, reference),
        "rows_apart": rows_apart(rows, sensing),
        "pivots": code.pivots.astype(float),
        "unrolled": code.unrolled_gap,
    }
    if ask_oracle:
        best = oracle(A, b, basis, l2, gamma, nonnegative)
        truth = curves(basis, best.code)
        measured |= {
            "oracle_gap": best.gap,
            "determined": best.determined.astype(float),
            "oracle_refused": best.refused.astype(float),
            "reference_off": distance(reference, truth),
            "onnx_off": distance(out["ssf"].T, truth),
        }
    return measured


def _gaps(A: Floats, b: Floats, x: Floats, l2: float, gamma: float, nonnegative: bool) -> Floats:
    return np.array([relative_gap(A[c], b[c], x[c], l2, gamma, nonnegative) for c in range(3)])


WORST = {
    "gap reference": "reference",
    "gap ONNX": "onnx",
    "recomputed reference": "reference_recomputed",
    "recomputed ONNX": "onnx_recomputed",
    "reference - ONNX": "apart",
    "rows apart": "rows_apart",
}


def misses(index: int, problem: Problem, measured: dict[str, Floats]) -> list[dict[str, Any]]:
    """Every bar that a problem misses; NaN misses."""
    found = []
    for name in ("reference", "onnx", "reference_recomputed", "onnx_recomputed"):
        if not (measured[name] <= GAP_BAR).all():
            found.append((f"gap {name}", measured[name]))
    if not (measured["rows_apart"] <= ROWS_BAR).all():
        found.append(("rows apart", measured["rows_apart"]))
    for name in ("reference_off", "onnx_off"):
        if name in measured and not (np.where(measured["determined"] > 0, measured[name], 0.0) <= CURVE_BAR).all():
            found.append((name, measured[name]))
    return [
        {
            "index": index, "bar": bar, "values": values.tolist(), "basis": problem.basis, "l2": problem.l2,
            "gamma": problem.gamma, "nonnegative": problem.nonnegative, "problem": problem.label,
            "pivots": measured["pivots"].tolist(), "oracle_gap": measured.get("oracle_gap", np.zeros(0)).tolist(),
        }
        for bar, values in found
    ]  # fmt: skip


def summary(kept: list[tuple[Problem, dict[str, Floats]]]) -> list[dict[str, Any]]:
    """One row a group of basis, λ₂, sign and number of shots, and one of all."""
    groups: dict[tuple[Any, ...], list[dict[str, Floats]]] = {}
    for problem, measured in kept:
        key = (problem.basis, int(problem.l2), "x >= 0" if problem.nonnegative else "signed")
        groups.setdefault((*key, len(problem.inputs["lamp"])), []).append(measured)
    rows = []
    for key, group in [*sorted(groups.items()), (("all", "", "", ""), [measured for _, measured in kept])]:
        asked = [measured for measured in group if "determined" in measured]
        unique = [measured["determined"] > 0 for measured in asked]
        off = [
            np.maximum(measured["reference_off"], measured["onnx_off"])[sure]
            for measured, sure in zip(asked, unique, strict=True)
        ]
        row = dict(zip(("basis", "l2", "sign", "shots"), key, strict=True)) | {"calls": len(group)}
        row |= {head: float(np.max([measured[name] for measured in group])) for head, name in WORST.items()}
        rows.append(
            row
            | {
                "oracle asked": 3 * len(asked),
                "unique": int(np.sum(unique)),
                "oracle refused": int(np.sum([m["oracle_refused"] for m in asked])),
                "off oracle": float(np.max(np.concatenate(off), initial=0.0)) if off else None,
                "oracle gap": float(np.max([m["oracle_gap"] for m in asked])) if asked else None,
                "most pivots": int(np.max([measured["pivots"] for measured in group])),
            }
        )
    return rows


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.certify", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000, help="calls of three channels")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--oracle-every", type=int, default=20, help="ask cvxpy about every so many; 0 for never")
    parser.add_argument("--only", type=int, help="the problem of this number alone, with the oracle")
    options = parser.parse_args(arguments)
    out = console()
    out.print(f"cameras: {cameras()[1]}; seed {options.seed}; a call is three channels, each a convex problem")
    if row_reader("cameras") is None:
        out.print("onnx is not installed: the ONNX code is recomputed on the reference's rows")
    numbers = range(options.count) if options.only is None else [options.only]
    kept, missed, start = [], [], time.perf_counter()
    with progress() as bar:
        for index in bar.track(numbers, description="certifying"):
            problem, _ = draw(options.seed, index)
            every = options.oracle_every
            measured = judge(problem, options.only is not None or (every > 0 and index % every == 0))
            if "determined" not in measured and misses(index, problem, measured):
                measured = judge(problem, True)  # what another solver reaches belongs beside a miss
            kept.append((problem, measured))
            missed += misses(index, problem, measured)
    seconds = time.perf_counter() - start
    rows = summary(kept)
    out.print(table("Worst of each group", list(rows[0]), [[_cell(value) for value in row.values()] for row in rows]))
    pivots = np.concatenate([measured["pivots"] for _, measured in kept])
    elsewhere = np.concatenate([measured["onnx_on_reference_rows"] for _, measured in kept])
    before = np.concatenate([measured["unrolled"] for _, measured in kept])
    out.print(
        f"{len(kept)} calls, {3 * len(kept)} convex problems, {seconds:.0f} s. Pivots: median {np.median(pivots):.0f}"
        f", 99 % {np.percentile(pivots, 99):.0f}, most {pivots.max():.0f}. Gap before the finish: median "
        f"{np.median(before):.1e}, worst {before.max():.1e}."
    )
    out.print(
        f"On the reference's rows, which differ from the model's by rounding, the ONNX codes' gap is at most "
        f"{elsewhere[elsewhere < 1e-6].max(initial=0.0):.1e} where it is below 1e-6; "
        f"{int((elsewhere > GAP_BAR).sum())} problems lie above 1e-9."
    )
    if rows[-1]["oracle refused"]:
        out.print(
            f"oracle refused: Clarabel gave no answer to {rows[-1]['oracle refused']} of {rows[-1]['oracle asked']} "
            "problems; there the exchanges started from zero."
        )
    if missed:
        head = ("index", "bar", "worst", "oracle's", "basis", "l2", "sign", "gamma", "problem")
        lines = [
            (
                m["index"], m["bar"], f"{np.max(m['values']):.1e}", f"{np.max(m['oracle_gap']):.1e}", m["basis"],
                f"{m['l2']:g}",
                "x >= 0" if m["nonnegative"] else "signed", f"{m['gamma']:.3g}", m["problem"],
            )
            for m in missed
        ]  # fmt: skip
        out.print(table(f"Bars missed; reproduce with --seed {options.seed} --only INDEX", head, lines))
    out.print(
        f"gap <= {GAP_BAR:.0e}, curves within {CURVE_BAR:.0e} and rows within {ROWS_BAR:.0e}: "
        + ("held" if not missed else f"MISSED by {len({m['index'] for m in missed})} of {len(kept)} calls")
    )
    if options.only is None:
        place = save(
            "certify",
            {
                "seed": options.seed, "calls": len(kept), "cameras": cameras()[1], "seconds": round(seconds, 1),
                "versions": versions("cvxpy", "clarabel", "onnx"), "gap_bar": GAP_BAR, "curve_bar": CURVE_BAR,
                "rows_bar": ROWS_BAR,
                "groups": rows, "missed": missed,
            },
        )  # fmt: skip
        out.print(f"written: {place}")
    else:
        for name, values in kept[0][1].items():
            out.print(f"{name:24} {' '.join(f'{value:.3e}' for value in values)}")
    return 1 if missed else 0


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.1e}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    one_thread("benchmarks.certify")
    sys.exit(main())
