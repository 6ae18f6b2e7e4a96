"""The benchmarks run, count every miss, and their own yardsticks are right; tiny sizes, no speed is judged here."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from benchmarks import problems, shared
from benchmarks.claims import accuracy, certify, oracle
from benchmarks.kernels import arm, arm_jvm, capture, solver
from benchmarks.kernels.peers import PEERS, Missing
from camssf.grid import Floats
from camssf.recovery.basis import read_basis
from camssf.recovery.layers import soft
from camssf.recovery.linear_model import LinearModel, linear_model
from camssf.recovery.onnx_model import SHIPPED, load_model
from camssf.recovery.sensitivity import LARGEST_GAP
from camssf.recovery.solve import solve
from tests.problems import random_sensing

pytestmark = pytest.mark.full


@pytest.fixture(autouse=True)
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nothing here overwrites a real result."""
    folder = tmp_path / "results"
    monkeypatch.setattr(shared, "RESULTS", folder)
    return folder


def identity(rows: int, atoms: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal columns: the optimum is soft(Aᵀ b, γ) / (1 + λ₂)."""
    rng = np.random.default_rng(seed)
    A = np.stack([np.linalg.qr(rng.normal(size=(rows, atoms)))[0] for _ in range(3)])
    return A, rng.normal(size=(3, rows))


@pytest.mark.parametrize("nonnegative", [False, True])
@pytest.mark.parametrize("l2", [0.0, 1.0])
def test_the_gap_vanishes_at_a_known_optimum_and_bounds_the_distance_elsewhere(l2: float, nonnegative: bool) -> None:
    A, b = identity(9, 5)
    gamma = 0.1
    for c in range(3):
        best = soft(A[c].T @ b[c], gamma, nonnegative) / (1.0 + l2)
        assert problems.relative_gap(A[c], b[c], best, l2, gamma, nonnegative) < 1e-14

        def objective(x: np.ndarray, c: int = c) -> float:
            r = b[c] - A[c] @ x
            return float(0.5 * r @ r + 0.5 * l2 * x @ x + gamma * np.abs(x).sum())

        for off in (1e-3, 0.1, 3.0):
            worse = best + off
            gap = problems.relative_gap(A[c], b[c], worse, l2, gamma, nonnegative)
            judged = np.maximum(worse, 0.0) if nonnegative else worse
            assert gap * objective(judged) >= (objective(judged) - objective(best)) * (1.0 - 1e-9)
            assert gap > 0


def test_whitening_agrees_with_the_engine_s_own_gap() -> None:
    sensing = random_sensing(3, 12, 7, correlated=True)
    A, b = problems.whiten(sensing)
    gamma = 0.05 * problems.gamma_max(A, b, False)
    for l2 in (0.0, 0.5):
        code = solve(sensing, l2, gamma, depth=4, finish=0)  # not optimal: the gaps are large and comparable
        for c in range(3):
            ours = problems.relative_gap(A[c], b[c], code.values[c], l2, float(gamma[c]), False)
            assert ours > 1e-9
            assert ours == pytest.approx(code.gap[c], rel=1e-9)


def test_whitening_in_long_double_is_the_same_with_more_digits() -> None:
    """Against exact fractions: a covariance of condition 1e8, of which float64 keeps eight digits."""
    sensing = random_sensing(5, 9, 4, correlated=True)
    scale = np.geomspace(1.0, 1e4, 9)
    hard = LinearModel(sensing.matrix, sensing.target, sensing.covariance * scale[:, None] * scale)
    A, b = problems.whiten_finely(hard)
    assert A.dtype == b.dtype == np.longdouble
    for c in range(3):
        system = [[Fraction(float(v)) for v in row] for row in np.column_stack(
            [hard.covariance[c], hard.matrix[c], hard.target[c]])]  # fmt: skip
        n, schur = 9, Fraction(0)
        for i in range(n):  # bᵀ Σ⁻¹ b is what elimination takes from the corner
            schur += system[i][-1] * system[i][-1] / system[i][i]
            for j in range(i + 1, n):
                part = system[j][i] / system[i][i]
                system[j] = [below - part * above for below, above in zip(system[j], system[i], strict=True)]
        found = b[c] @ b[c]
        assert abs(float(found - np.longdouble(schur.numerator) / np.longdouble(schur.denominator))) <= 1e-17 * schur
        rough = problems.whiten(hard)[0][c]
        assert A[c].astype(float) == pytest.approx(rough, rel=1e-9, abs=1e-12 * np.abs(rough).max())


def test_a_gap_below_float64_s_own_rounding_is_seen() -> None:
    A, b = identity(12, 6)
    best = soft(A[0].T @ b[0], 0.1, False) / 2.0
    fine = problems.relative_gap(
        A[0].astype(np.longdouble), b[0].astype(np.longdouble), best + 1e-10, 1.0, 0.1, False
    )
    # ½ δᵀ M δ and the conjugate's as much again, M = 2 I: 6 atoms, 1e-10 each
    x = best
    objective = 0.5 * np.sum((b[0] - A[0] @ x) ** 2) + 0.5 * x @ x + 0.1 * np.abs(x).sum()
    assert fine * objective == pytest.approx(12e-20, rel=0.05)


def test_a_curve_s_exact_code_is_walked_to_even_where_the_layers_are_proof_enough() -> None:
    problem = certify.draw_default(0, 1)
    sensing = problem.sensing(read_basis(problem.basis))
    layers = solve(sensing, problem.l2, problem.penalties(sensing), finish=0, depth=16)
    (each,) = problems.convex(sensing, problem)
    exact = problems.forced(each)
    fine = problems.whiten_finely(sensing)
    assert problems.gaps(*fine, exact, problem) <= 1e-3 * problems.gaps(*fine, layers.values, problem)
    assert exact == pytest.approx(layers.values[0], abs=1e-4)


def test_gamma_max_is_where_the_code_vanishes() -> None:
    sensing = random_sensing(4, 10, 6)
    A, b = problems.whiten(sensing)
    assert (np.einsum("cnr,cn->cr", A, b).max(axis=1) > 0).all()
    for nonnegative in (False, True):
        top = problems.gamma_max(A, b, nonnegative)
        assert not solve(sensing, 0.0, 1.0001 * top, nonnegative=nonnegative).values.any()
        assert solve(sensing, 0.0, 0.9999 * top, nonnegative=nonnegative).values.any(axis=1).all()


def test_problems_are_the_same_every_time_and_of_every_kind() -> None:
    kinds, kind_of_lamp = set(), set()
    for index in range(60):
        problem, sigma = certify.draw(7, index)
        kinds.add((problem.basis, problem.l2, problem.nonnegative))
        assert sigma in ("identity", "diagonal", "full")
        A, b = problems.whiten(problem.sensing(read_basis(problem.basis)))
        share = problem.gamma / problems.gamma_max(A, b, problem.nonnegative)
        assert ((share >= 0.999e-6) & (share <= 1.001)).all()
        kind_of_lamp.add(any(name in problem.label for name in certify.KINDS))
        assert len(A) == (3 if problem.basis == "gaussian" else 1)
    assert len(kinds) == 4 * len(SHIPPED)
    assert kind_of_lamp == {False, True}
    again = certify.draw(7, 59)[0]
    assert all(np.array_equal(again.inputs[name], value) for name, value in problem.inputs.items())


@pytest.mark.full
@pytest.mark.parametrize("nonnegative", [False, True])
def test_the_oracle_finds_a_known_optimum_and_knows_what_is_not_unique(nonnegative: bool) -> None:
    pytest.importorskip("cvxpy")
    A, b = identity(24, 24)
    basis = read_basis("cameras")
    found = oracle.oracle(A, b, basis, 1.0, 0.1, nonnegative)
    pulls = np.einsum("cnr,cn->cr", A, b)
    assert found.code == pytest.approx(np.stack([soft(p, 0.1, nonnegative) / 2.0 for p in pulls]), abs=1e-12)
    assert (found.gap < 1e-12).all()
    assert found.determined.all()
    twins = A.copy()
    twins[:, :, 1] = twins[:, :, 0]  # two equal atoms share their part as they like
    x = np.where(np.arange(24) < 2, 0.0, soft(np.einsum("nr,n->r", twins[0], b[0]), 0.1, nonnegative))
    pull = float(twins[0][:, 0] @ b[0])
    b0 = b[0] + (1.0 - pull) * twins[0][:, 0]  # pull of 1: the twins serve for certain
    x[0] = 0.9
    assert not oracle.determined(twins[0], b0, x, basis.dictionary[:1], basis.mean[:1], 0.0, 0.1, nonnegative)


@pytest.mark.full
def test_the_oracle_takes_the_one_problem() -> None:
    """72 unknowns, three curves: as the three problems apart, where no row knows of two channels."""
    pytest.importorskip("cvxpy")
    basis = read_basis("cameras")
    A, b = identity(24, 24)
    rows = np.zeros((72, 72))
    for c in range(3):
        rows[24 * c : 24 * c + 24, 24 * c : 24 * c + 24] = A[c]
    one = oracle.oracle(rows[None], b.reshape(1, -1), basis, 1.0, 0.1, False)
    three = oracle.oracle(A, b, basis, 1.0, 0.1, False)
    assert one.code.reshape(3, -1) == pytest.approx(three.code, abs=1e-12)
    assert one.determined.shape == (1,)
    ((mean, atoms),) = oracle.curves_of(basis, 1)
    assert mean + atoms @ one.code[0] == pytest.approx(problems.curves(basis, three.code), abs=1e-12)


@pytest.mark.requirement("R-OPTIMUM")
def test_certify_reports_what_it_measured(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cvxpy")
    status = certify.main(["--count", "6", "--defaults", "3", "--oracle-every", "3"])
    said = capsys.readouterr().out
    kept = json.loads((results / "certify.json").read_text())
    assert kept["problems"] >= 6
    assert sum(row["problems"] for row in kept["by_gamma"]) == kept["groups"][-1]["problems"] == kept["problems"]
    assert [row["calls"] for row in kept["defaults"] if row["basis"] == "all"] == [3, 3]
    assert status == ("MISSED" in said)
    assert "all" in said
    assert str(results) not in said


def test_a_missed_bar_is_listed_and_nan_is_missed() -> None:
    problem, _ = certify.draw(0, 1)
    good = dict.fromkeys(("reference", "onnx", "reference_recomputed", "onnx_recomputed"), np.full(3, 1e-12))
    good |= {"steps": np.ones(3), "share": np.full(3, 0.1), "rows_apart": np.full(3, 1e-13)}
    assert not certify.misses(1, problem, good)
    for bad in (1.1e-9, np.nan):
        (miss,) = certify.misses(1, problem, good | {"onnx_recomputed": np.array([0.0, bad, 0.0])})
        assert (miss["index"], miss["bar"]) == (1, "gap onnx")
    off = {"determined": np.array([1.0, 0.0, 1.0]), "reference_off": np.zeros(3)}
    assert not certify.misses(1, problem, good | off | {"onnx_off": np.array([0.0, 1.0, 0.0])})
    assert certify.misses(1, problem, good | off | {"onnx_off": np.array([2e-6, 0.0, 0.0])})
    (miss,) = certify.misses(1, problem, good | {"rows_apart": np.array([0.0, 0.0, 2e-9])})
    assert miss["bar"] == "rows apart"


@pytest.mark.parametrize("own", [2 * LARGEST_GAP, np.nan])
def test_what_the_product_refuses_by_name_is_no_miss(own: float) -> None:
    """And only where it does: a large gap that an engine does not own up to is one."""
    problem, _ = certify.draw(0, 1)
    honest = dict.fromkeys(("reference", "reference_recomputed"), np.array([own]))
    honest |= {"steps": np.ones(1), "share": np.ones(1)}
    assert certify.refused(honest["reference"]).all()
    assert not certify.misses(1, problem, honest)
    assert certify.misses(1, problem, honest | {"reference": np.array([1e-12])})


def test_the_product_s_calls_are_counted_by_their_bars(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = certify.draw_default(0, 0)
    monkeypatch.setattr(certify, "draw_default", lambda *_: problem)
    good = {"exact_gap": 0.0, "reference_steps": 0.0, "reference_gap": 0.5e-10, "reference_off": 1e-8}
    good |= {"layers_off": 1e-5}
    for bad, share in (({}, "100.00 %"), ({"reference_steps": 1.0}, "99.50 %"), ({"reference_gap": 1e-9}, "99.50 %")):
        answers = iter([good | bad, *[good] * 199])
        monkeypatch.setattr(certify, "judge_default", lambda *_, answers=answers: next(answers))
        rows, held = certify.defaults(0, range(200), ("reference",))
        assert held
        assert rows[-1]["layers, gap <= 1e-10"] == share
    for bad, many in (({"reference_off": 2e-7}, 1), ({"reference_off": np.nan}, 1), ({"reference_steps": 3.0}, 3)):
        answers = iter([good | bad] * many + [good] * (200 - many))
        monkeypatch.setattr(certify, "judge_default", lambda *_, answers=answers: next(answers))
        assert not certify.defaults(0, range(200), ("reference",))[1]


@pytest.mark.parametrize("index", range(3))
def test_a_call_of_the_product_is_judged_by_both_engines(index: int) -> None:
    problem = certify.draw_default(0, index)
    assert (problem.l2, problem.gamma, problem.nonnegative) == (1.0, 0.05, False)
    found = certify.judge_default(problem)
    assert found["exact_gap"] < 1e-18
    for engine in certify.ENGINES:
        assert found[f"{engine}_steps"] == 0
        assert found[f"{engine}_gap"] <= 1e-10
        assert found[f"{engine}_off"] <= certify.ALONE_BAR


@pytest.mark.full
def test_an_oracle_without_an_answer_is_counted_and_not_the_end(
    results: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    cvxpy = pytest.importorskip("cvxpy")

    def fail(*_: object, **__: object) -> None:
        raise cvxpy.error.SolverError("Solver 'CLARABEL' failed. Try another solver.")

    monkeypatch.setattr(cvxpy.Problem, "solve", fail)
    A, b = identity(24, 24)
    found = oracle.oracle(A, b, read_basis("cameras"), 1.0, 0.1, False)
    assert found.refused.all()
    assert (found.gap < 1e-12).all()  # the exchanges arrive from zero, too
    certify.main(["--count", "2", "--defaults", "0", "--oracle-every", "1"])
    groups = json.loads((results / "certify.json").read_text())["groups"]
    count = groups[-1]["problems"]
    assert groups[-1]["oracle refused"] == groups[-1]["oracle asked"] == count >= 2
    assert f"oracle refused: Clarabel gave no answer to {count} of {count}" in capsys.readouterr().out


@pytest.mark.full
def test_the_model_s_own_rows_are_read() -> None:
    pytest.importorskip("onnx")
    for index in range(4):
        problem, _ = certify.draw(11, index)
        reference = problem.sensing(read_basis(problem.basis))
        fine, own = problems.whiten_finely(reference), certify.model_rows(problem)
        assert own[0].shape[::2] == reference.matrix.shape[::2]  # it may take more rows: Σ by structure
        assert (certify.rows_apart(own, fine) <= certify.ROWS_BAR).all()
        for wrong in ((own[0] * (1 + 1e-8), own[1]), (own[0], own[1] * (1 + 1e-8))):
            assert (certify.rows_apart(wrong, fine) > certify.ROWS_BAR).all()


@pytest.mark.full
@pytest.mark.parametrize("nonnegative", [False, True])
def test_peers_solve_the_same_problem(nonnegative: bool, recwarn: pytest.WarningsRecorder) -> None:
    """Each one's code is near the known optimum: none is handed another problem."""
    A, b = identity(12, 6)
    l2, gamma = 1.0, 0.2
    best = np.stack([soft(p, gamma, nonnegative) / 2.0 for p in np.einsum("cnr,cn->cr", A, b)])
    # skglm's compiler alone takes longer than this file may.
    _held((name for name in PEERS if name != "skglm"), (A, b, l2, gamma, nonnegative), best)


@pytest.mark.full
def test_peers_solve_the_one_problem_from_fewer_rows() -> None:
    """p = 1; rows beyond the unknowns are reduced, which changes no code."""
    rng = np.random.default_rng(2)
    A, b = rng.normal(size=(1, 40, 8)), rng.normal(size=(1, 40))
    R, target = solver.reduced(A, b)
    assert R.shape == (1, 8, 8)
    best = solve(LinearModel(A, b, np.eye(40)[None]), 1.0, np.array([0.2])).values
    _held((*solver.COMPILED, "Clarabel, called directly"), (R, target, 1.0, 0.2, False), best)
    assert solver.reduced(R, target)[0] is R


def _held(names: Iterable[str], posed: tuple[Floats, Floats, float, float, bool], best: Floats) -> None:
    """Those of the named peers that are installed find the best code; skips where none is."""
    tried = 0
    for name in names:
        try:
            run = PEERS[name](*posed)
        except Missing:
            continue
        assert run() == pytest.approx(best, abs=1e-4), name
        tried += 1
    if not tried:
        pytest.skip("no peer is installed")


def _rows(**times: float) -> list[dict[str, object]]:
    """A contest's rows by contender, times in units of ours."""
    names = {"ours": solver.ONNX, "rows": solver.ROWS, "one": solver.ONE_BY_ONE, "all": solver.AT_ONCE}
    return [
        {"contender": names[key], "ms": value, "times_onnx": value, "gap": 1e-9 if key != "ours" else 1e-12}
        for key, value in times.items()
    ]


def test_the_fastest_compiled_peer_decides_with_its_rows_free() -> None:
    label = "cameras, 24 patches, D55"
    speed, with_rows, gap = solver.bars_of(label, "cameras", _rows(ours=1.0, rows=0.5, one=4.0, all=2.5))
    assert (speed["value"], speed["met"]) == (0.4, True)
    assert with_rows["value"] == pytest.approx(1 / 3)
    assert gap["met"]
    assert not solver.bars_of(label, "cameras", _rows(ours=1.0, rows=0.5, one=4.0, all=1.9))[0]["met"]
    assert solver.bars_of("gaussian", "gaussian", _rows(ours=1.0, rows=0.5, one=4.0, all=1.7))[0]["met"]
    assert not solver.bars_of("gaussian", "gaussian", _rows(ours=1.0, rows=0.5, all=1.6))[0]["met"]


@pytest.mark.full
def test_a_contest_is_printed_with_every_contender(capsys: pytest.CaptureFixture[str], results: Path) -> None:
    rows, _ = solver.contest(solver.problem_of("cameras", 9), 2, ("Clarabel, called directly",))
    names = [row["contender"] for row in rows]
    assert names == [solver.ONNX, solver.REFERENCE, "Clarabel, called directly", solver.ROWS]
    assert all(row["ms"] > 0 for row in rows)
    assert rows[0]["gap"] < 1e-9
    assert rows[0]["times_onnx"] == 1.0


def test_channels_apart_are_each_solved_for_itself() -> None:
    problem = certify.draw_default(0, 3)
    basis = read_basis(problem.basis)
    rows = accuracy.apart(linear_model(problem.evidence, basis))
    got, _ = accuracy.answer_of(rows, problem.evidence, basis)
    n, r = rows.target.shape[1] // 3, rows.matrix.shape[2] // 3
    book = problem.anchored(basis)
    for c in range(3):
        own, atoms = slice(n * c, n * c + n), slice(r * c, r * c + r)
        one = LinearModel(rows.matrix[:, own, atoms], rows.target[:, own], rows.covariance[:, own, own])
        curve = book.mean[c] + book.dictionary[c] @ solve(one, 1.0, np.array([0.05])).values[0]
        assert got[:, c] == pytest.approx(curve / curve.max(), abs=1e-7)


def test_arm_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(arm.shutil, "which", lambda *_, **__: None)
    assert arm.main(["--work", str(tmp_path / "arm")]) == 2
    said = capsys.readouterr().err
    assert "apt-get install qemu-user-static debootstrap" in said
    assert str(tmp_path) not in said


RAN = (
    "on {0}, Java 17\n"
    "golden: 3 of 4 cases ran, {1} failed, 1 skipped (1 needs reference); curves within {2} of the peak of Python's"
)


@pytest.mark.requirement("R-ARM")
@pytest.mark.parametrize(
    ("said", "status"),
    [
        (("aarch64", 0, 1e-12), 0),
        (("aarch64", 0, 1e-8), 1),
        (("aarch64", 1, 1e-12), 1),
        (("x86_64", 0, 1e-12), 1),  # not emulated after all
    ],
)
def test_arm_jvm_holds_its_bar(
    said: tuple[object, ...], status: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def ran(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        line = RAN.format(*(said if "qemu" in command[0] else ("x86_64", 0, 1e-13)))
        return subprocess.CompletedProcess(command, 0, stdout=line, stderr="")

    monkeypatch.setattr(arm_jvm, "tools", lambda: None)
    monkeypatch.setattr(arm_jvm, "root_folder", lambda *_: tmp_path)
    monkeypatch.setattr(arm_jvm, "java_of", lambda root: root / "java")
    monkeypatch.setattr(arm_jvm, "class_path", lambda: "a.jar")
    monkeypatch.setattr(arm_jvm.subprocess, "run", ran)
    assert arm_jvm.main([]) == status


def test_arm_jvm_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(arm_jvm, "tools", lambda: None)
    monkeypatch.setattr(arm_jvm, "root_folder", lambda *_: tmp_path)
    monkeypatch.setattr(arm_jvm, "MODULES", tmp_path)
    assert arm_jvm.main([]) == 2
    assert "mvn -f android-bindings" in capsys.readouterr().err


@pytest.mark.requirement("R-ARM")
def test_arm_compares_norm_wise() -> None:
    ours = {
        "cameras/a/code": np.array([1.0, -4.0]),
        "cameras/a/gap": np.zeros(3),
        "cameras/a/ssf_std": np.array([np.nan]),
    }
    theirs = {
        "cameras/a/code": np.array([1.0 + 4e-9, -4.0]),
        "cameras/a/gap": np.array([0.0, 3e-9, 0.0]),
        "cameras/a/ssf_std": np.array([np.nan]),
    }
    (row,), gap = arm.compare(ours, theirs)
    assert row["worst"] == pytest.approx(1e-9)
    assert gap == 3e-9
    layers = {"cameras/a/layers_gap": np.ones(1), "cameras/a/finish_steps": np.ones(1)}
    assert len(arm.compare(ours | layers, theirs | {name: 0.0 * value for name, value in layers.items()})[0]) == 1
    (row,), _ = arm.compare(ours, theirs | {"cameras/a/code": np.array([np.nan, 1.0])})
    assert not row["worst"] <= arm.BAR


def test_the_runner_for_the_other_processor_runs_here(tmp_path: Path) -> None:
    problem, _ = certify.draw(0, 3)
    given, made = tmp_path / "in.npz", tmp_path / "out.npz"
    np.savez(given, **{f"{problem.basis}/x/{name}": value for name, value in problem.inputs.items()})
    root = Path(__file__).parents[1]
    script = root / "benchmarks" / "kernels" / "run_models.py"
    environment = os.environ | {"PYTHONPATH": str(root / "reference")}
    done = subprocess.run(
        [sys.executable, str(script), str(given), str(made)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr.strip() == "1/1"
    with np.load(made) as content:
        for name, value in load_model(problem.basis).run(problem.inputs).items():
            assert np.array_equal(content[f"{problem.basis}/x/{name}"], value, equal_nan=True)


def test_golden_cases_are_taken_to_the_other_processor() -> None:
    cases = arm.golden()
    if not cases:
        pytest.skip("no golden cases are here")
    (basis, _), (inputs, stored) = next(iter(cases.items()))
    out = load_model(basis).run(inputs)
    assert np.abs(out["ssf"] - stored["ssf"]).max() <= 1e-10 * np.abs(stored["ssf"]).max()


def test_sensing_of_a_problem_is_the_reference_s() -> None:
    problem = solver.problem_of("gaussian", 9)
    sensing = problem.sensing(read_basis("gaussian"))
    assert isinstance(sensing, LinearModel)
    assert problem.penalties(sensing).tolist() == [problem.gamma] * 3
    y = (problem.inputs["chart"] - 64.0)[0] / (problem.inputs["white"] - 64.0)[0]
    assert sensing.target == pytest.approx(y.T)


@pytest.mark.requirement("R-SPEED")
@pytest.mark.parametrize(
    ("ratio", "peak", "status"),
    [(1.9, 3.9, 0), (2.0, 4.0, 0), (2.01, 3.9, 1), (1.9, 4.01, 1), (float("nan"), 1.0, 1)],
)
def test_capture_ends_with_1_where_a_bar_is_missed(
    ratio: float, peak: float, status: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    measured = {"file_megabytes": 1.0, "decode_seconds": 1.0, "calibrate_seconds": 1.0, "ratio_range": [1.0, 3.0]}
    measured |= {"ratio": ratio, "peak_over_mosaic": peak}
    monkeypatch.setattr(capture, "measure", lambda runs, basis: measured)
    assert capture.main([]) == status
    assert ("MISSED" in capsys.readouterr().out) == bool(status)


BENCHMARKS = sorted(
    path for path in Path(shared.__file__).parent.rglob("*.py") if "def main(" in path.read_text("utf-8")
)
WITHOUT_BARS = {"guide", "phones", "run_models"}
"""Those that compare nothing with a bar: they print tables, or are run by another one."""


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: path.stem)
def test_the_status_of_a_benchmark_comes_from_what_it_measured(path: Path) -> None:
    """By reading the source: the last word of `main` is no constant."""
    tree = ast.parse(path.read_text("utf-8"))
    mains = [each for each in tree.body if isinstance(each, ast.FunctionDef) and each.name == "main"]
    text = ast.unparse(tree)
    if path.stem in WITHOUT_BARS:
        assert "BAR" not in text
        assert "exit status 1" not in text.casefold()
        return
    (main,) = mains
    last = main.body[-1]
    assert isinstance(last, ast.Return)
    assert last.value is not None
    assert not isinstance(last.value, ast.Constant)


def test_lamps_by_name_and_by_kind_are_solved(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whether a bar holds for one camera is chance; that every setting has both its numbers is not."""
    from benchmarks.claims import lamps

    status = lamps.main(["--every", "60", "--draws", "1"])
    kept = json.loads((results / "lamps.json").read_text())
    assert [row["lamps"] for row in kept["rows"]] == [" + ".join(kinds) for kinds in lamps.SETTINGS]
    for row in kept["rows"]:
        for how in ("known", "kind"):
            assert 0.0 < row[how]["rmse"] < 0.2
            assert row[how]["coverage"] > 0.4
    assert status == ("MISSED" in capsys.readouterr().out)


def test_what_an_unnamed_light_costs(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No speed is judged; each call is counted, and a kind's is dearer than a name's."""
    from benchmarks.kernels import any_light_cost

    status = any_light_cost.main(["--rounds", "1"])
    kept = json.loads((results / "any_light_cost.json").read_text())
    assert len(kept["rows"]) == 12
    assert kept["kinds"] > 1.0
    assert status == ("MISSED" in capsys.readouterr().out)


def test_what_judging_costs(results: Path) -> None:
    """No speed is judged; the status says whether every bar was held."""
    from benchmarks.kernels import judging

    status = judging.main(["--runs", "1"])
    rows = json.loads((results / "judging.json").read_text())["rows"]
    assert [row[0] for row in rows] == ["cameras", "auto"]
    assert status == any(ratio > bar for *_, ratio, bar, _ in rows)


def test_the_pictures_of_colour_and_their_numbers_on_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As docs/colour.md tells them; another kernel of the linear algebra may move a last digit."""
    from tools import colour_story

    monkeypatch.setattr(shared, "RESULTS", tmp_path)
    assert colour_story.main(["-o", str(tmp_path)]) == 0
    capsys.readouterr()
    found = json.loads((tmp_path / "colour-story.json").read_text("utf-8"))
    page = (Path(__file__).parents[1] / "docs" / "colour.md").read_text("utf-8")
    for name in ("story", "skin"):
        assert (tmp_path / f"colour-{name}.png").read_bytes().startswith(b"\x89PNG")
        assert f"](images/colour-{name}.png)" in page
    for name, row in found["ita"].items():
        (cells,) = re.findall(
            rf"^\| {name} \| ([\d.]+)° \| ([\d.]+)° \| ([\d.]+)° \| ([\d.]+)° \|$", page, re.MULTILINE
        )
        expected = [row[key] for key in ("matrix", "exact", "curves", "half_width")]
        assert [float(cell) for cell in cells] == pytest.approx(expected, abs=0.11)
        assert row["held"] == 1.0
        assert f"{row['range_curves']:.1f}°" in page
    raw, matrix, curves = found["chart"].values()
    (told,) = re.findall(
        r"White-balanced only: ([\d.]+) to ([\d.]+) and ([\d.]+)\. Through a 3 × 3 matrix of a chart "
        r"under D55: ([\d.]+) to ([\d.]+) and ([\d.]+)\. Through the curves: ([\d.]+) and ([\d.]+)\.",
        page,
    )
    expected = [
        *(f(row["cameras"]) for row in (raw, matrix) for f in (min, max)), raw["between"], matrix["between"],
        float(np.mean(curves["cameras"])), curves["between"],
    ]  # fmt: skip
    order = [told[i] for i in (0, 1, 3, 4, 2, 5, 6, 7)]
    assert [float(each) for each in order] == pytest.approx(expected, abs=0.06)


def test_phones_left_out_are_asked_for(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    from benchmarks.claims import colour

    monkeypatch.delenv("CAMSSF_PHONES", raising=False)
    assert colour.main(["--phones"]) == 2
    assert "CAMSSF_PHONES" in capsys.readouterr().err


def test_spectra_need_a_table_of_phones(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    from benchmarks.claims import spectrum

    monkeypatch.delenv("CAMSSF_PHONES", raising=False)
    assert spectrum.main(["--phones"]) == 2
    assert "CAMSSF_PHONES" in capsys.readouterr().err


@pytest.mark.full
def test_spectra_of_surfaces_that_the_prior_does_not_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One camera, few surfaces: looser than the benchmark's bars, which need many."""
    from benchmarks.claims import spectrum

    monkeypatch.setattr(shared, "RESULTS", tmp_path)
    assert spectrum.main(["--cameras", "1", "--every", "40"]) == 0
    found = json.loads((tmp_path / "spectrum.json").read_text("utf-8"))
    assert 0.3 < found["delta_e00"]["general, true"] < found["delta_e00"]["general, transform"]
    assert found["delta_e00"]["skin, one"] < 0.8 * found["delta_e00"]["skin, transform"]
    assert found["spectra"]["general, two"][0] < found["spectra"]["general, one"][0]
    assert all(held > 0.85 for _, held in found["spectra"].values())  # the bars judge bands too wide
    assert found["answered"]["widened, oxyhaemoglobin, two"] > found["answered"]["population, oxyhaemoglobin, one"]
    assert "bar" in capsys.readouterr().out


@pytest.mark.requirement("R-COLOUR")
def test_colour_through_recovered_curves_is_nearly_as_through_true_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two cameras, their makers left out: far looser than the benchmark's bars, which need many."""
    from benchmarks.claims import colour

    monkeypatch.setattr(shared, "RESULTS", tmp_path)
    assert colour.main(["--cameras", "2"]) == 0
    found = json.loads((tmp_path / "colour.json").read_text("utf-8"))
    for rows in found["delta_e00"].values():
        assert 0.3 < rows["mean"]["true"] < rows["mean"]["elsewhere"]
        assert rows["mean"]["two"] < 1.3 * rows["mean"]["true"]
        assert rows["mean"]["two"] < rows["mean"]["chart"]
    assert found["converted"]["after"] < 0.7 * found["converted"]["before"]
    assert 0.85 < found["converted"]["inside"] < 0.995
    assert {row[-1] for row in colour.bars(found["delta_e00"])} <= {"yes", "no"}
    assert "inside 95 %" in capsys.readouterr().out
