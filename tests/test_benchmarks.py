"""The benchmarks run, count every miss, and their own yardsticks are right; tiny sizes, no speed is judged here."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import _common, arm, arm_jvm, capture, certify, depth, solver
from benchmarks._peers import PEERS, Missing
from camssf.curves.basis import read_basis
from camssf.curves.code import soft, solve
from camssf.curves.engine import load_model
from camssf.curves.sensing import Sensing
from tests.problems import random_sensing


@pytest.fixture(autouse=True)
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Nothing here overwrites a real result."""
    folder = tmp_path / "results"
    for module in (_common, solver, depth):
        monkeypatch.setattr(module, "RESULTS", folder)
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
        assert _common.relative_gap(A[c], b[c], best, l2, gamma, nonnegative) < 1e-14

        def objective(x: np.ndarray, c: int = c) -> float:
            r = b[c] - A[c] @ x
            return float(0.5 * r @ r + 0.5 * l2 * x @ x + gamma * np.abs(x).sum())

        for off in (1e-3, 0.1, 3.0):
            worse = best + off
            gap = _common.relative_gap(A[c], b[c], worse, l2, gamma, nonnegative)
            judged = np.maximum(worse, 0.0) if nonnegative else worse
            assert gap * objective(judged) >= (objective(judged) - objective(best)) * (1.0 - 1e-9)
            assert gap > 0


def test_whitening_agrees_with_the_engine_s_own_gap() -> None:
    sensing = random_sensing(3, 12, 7, correlated=True)
    A, b = _common.whiten(sensing)
    gamma = 0.05 * _common.gamma_max(A, b, False)
    for l2 in (0.0, 0.5):
        code = solve(sensing, l2, gamma, depth=4, finish=0)  # not optimal: the gaps are large and comparable
        for c in range(3):
            ours = _common.relative_gap(A[c], b[c], code.values[c], l2, float(gamma[c]), False)
            assert ours > 1e-9
            assert code.gap[c] > 1e-9
            if l2 == 0:  # else the engine's is by the penalty's conjugate
                assert ours == pytest.approx(code.gap[c], rel=1e-9)


def test_gamma_max_is_where_the_code_vanishes() -> None:
    sensing = random_sensing(4, 10, 6)
    A, b = _common.whiten(sensing)
    assert (np.einsum("cnr,cn->cr", A, b).max(axis=1) > 0).all()
    for nonnegative in (False, True):
        top = _common.gamma_max(A, b, nonnegative)
        assert not solve(sensing, 0.0, 1.0001 * top, nonnegative=nonnegative).values.any()
        assert solve(sensing, 0.0, 0.9999 * top, nonnegative=nonnegative).values.any(axis=1).all()


def test_problems_are_the_same_every_time_and_of_every_kind() -> None:
    kinds = set()
    for index in range(60):
        problem, sigma = certify.draw(7, index)
        kinds.add((problem.basis, problem.l2, problem.nonnegative))
        assert sigma in ("identity", "diagonal", "full")
        A, b = _common.whiten(problem.sensing(read_basis(problem.basis)))
        share = problem.gamma / _common.gamma_max(A, b, problem.nonnegative)
        assert ((share >= 0.999e-5) & (share <= 1.001e-1)).all()
    assert len(kinds) == 8
    again = certify.draw(7, 59)[0]
    assert all(np.array_equal(again.inputs[name], value) for name, value in problem.inputs.items())


@pytest.mark.parametrize("nonnegative", [False, True])
def test_the_oracle_finds_a_known_optimum_and_knows_what_is_not_unique(nonnegative: bool) -> None:
    pytest.importorskip("cvxpy")
    A, b = identity(24, 24)
    basis = read_basis("cameras")
    found = certify.oracle(A, b, basis, 1.0, 0.1, nonnegative)
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
    assert not certify.determined(twins[0], b0, x, basis.dictionary[0], basis.mean[0], 0.0, 0.1, nonnegative)


def test_certify_reports_what_it_measured(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cvxpy")
    status = certify.main(["--count", "6", "--oracle-every", "3"])
    said = capsys.readouterr().out
    assert (results / "certify.json").exists()
    assert status == ("MISSED" in said)
    assert "all" in said
    assert str(results) not in said


def test_a_missed_bar_is_listed_and_nan_is_missed() -> None:
    problem, _ = certify.draw(0, 1)
    good = dict.fromkeys(("reference", "onnx", "reference_recomputed", "onnx_recomputed"), np.full(3, 1e-12))
    good |= {"pivots": np.ones(3), "rows_apart": np.full(3, 1e-13)}
    assert not certify.misses(1, problem, good)
    for bad in (1.1e-9, np.nan):
        (miss,) = certify.misses(1, problem, good | {"onnx": np.array([0.0, bad, 0.0])})
        assert (miss["index"], miss["bar"]) == (1, "gap onnx")
    off = {"determined": np.array([1.0, 0.0, 1.0]), "reference_off": np.zeros(3)}
    assert not certify.misses(1, problem, good | off | {"onnx_off": np.array([0.0, 1.0, 0.0])})
    assert certify.misses(1, problem, good | off | {"onnx_off": np.array([2e-6, 0.0, 0.0])})
    (miss,) = certify.misses(1, problem, good | {"rows_apart": np.array([0.0, 0.0, 2e-10])})
    assert miss["bar"] == "rows apart"


def test_an_oracle_without_an_answer_is_counted_and_not_the_end(
    results: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    cvxpy = pytest.importorskip("cvxpy")

    def fail(*_: object, **__: object) -> None:
        raise cvxpy.error.SolverError("Solver 'CLARABEL' failed. Try another solver.")

    monkeypatch.setattr(cvxpy.Problem, "solve", fail)
    A, b = identity(24, 24)
    found = certify.oracle(A, b, read_basis("cameras"), 1.0, 0.1, False)
    assert found.refused.all()
    assert (found.gap < 1e-12).all()  # the exchanges arrive from zero, too
    certify.main(["--count", "2", "--oracle-every", "1"])
    assert "oracle refused: Clarabel gave no answer to 6 of 6" in capsys.readouterr().out
    groups = json.loads((results / "certify.json").read_text())["groups"]
    assert groups[-1]["oracle refused"] == groups[-1]["oracle asked"] == 6


def test_the_model_s_own_rows_are_read() -> None:
    pytest.importorskip("onnx")
    for index in range(4):
        problem, _ = certify.draw(11, index)
        reference = problem.sensing(read_basis(problem.basis))
        own = certify.model_rows(problem, reference)
        assert own is not reference
        for ours, theirs in zip(
            (own.matrix, own.target, own.covariance),
            (reference.matrix, reference.target, reference.covariance),
            strict=True,
        ):
            assert np.abs(ours - theirs).max() <= 1e-12 * np.abs(theirs).max()


@pytest.mark.parametrize("nonnegative", [False, True])
def test_peers_solve_the_same_problem(nonnegative: bool, recwarn: pytest.WarningsRecorder) -> None:
    """Each one's code is near the known optimum: none is handed another problem."""
    A, b = identity(12, 6)
    l2, gamma = 1.0, 0.2
    best = np.stack([soft(p, gamma, nonnegative) / 2.0 for p in np.einsum("cnr,cn->cr", A, b)])
    tried = 0
    for name, make in PEERS.items():
        if name == "skglm":
            continue  # its compiler alone takes longer than this file may
        try:
            run = make(A, b, l2, gamma, nonnegative)
        except Missing:
            continue
        assert run() == pytest.approx(best, abs=1e-4), name
        tried += 1
    if not tried:
        pytest.skip("no peer is installed")


def test_a_contest_is_printed_with_every_contender(capsys: pytest.CaptureFixture[str], results: Path) -> None:
    rows, _ = solver.contest(solver.problem_of("cameras", 9), 2, ("Clarabel, called directly",))
    names = [row["contender"] for row in rows]
    assert names == [solver.ONNX, solver.REFERENCE, "Clarabel, called directly", solver.ROWS]
    assert all(row["ms"] > 0 for row in rows)
    assert rows[0]["gap"] < 1e-9
    assert rows[0]["times_onnx"] == 1.0
    word = solver.plot(
        {"patches": [{"patches": 9, "ONNX": 1.0, "gap": 0.0}, {"patches": 12, "ONNX": 2.0, "gap": 0.0}]}
    )
    assert word == "benchmarks/results/solver.png"
    assert (results / "solver.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_depth_shows_the_layers_closing_in(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = depth.main(["--cameras", "1", "--depths", "1", "32"])
    said = capsys.readouterr().out
    assert "Plain ISTA" in said
    assert status in (0, 1)
    assert (results / "depth.png").exists()
    problem = depth.problems("cameras", 1.0, 1, 0)[0]
    layers, plain, gap, _ = depth.measure(problem, (1, 64))
    assert gap <= 1e-9
    assert layers[1].max() < 1e-6 < layers[0].max()
    assert plain[1].max() > 10 * layers[1].max()


def test_ista_arrives_where_it_is_easy() -> None:
    A, b = identity(9, 5)
    best = np.stack([soft(p, 0.1, False) for p in np.einsum("cnr,cn->cr", A, b)])
    assert depth.ista(A, b, 0.0, 0.1, False, (1, 2))[1] == pytest.approx(best, abs=1e-12)


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
    (row,), _ = arm.compare(ours, theirs | {"cameras/a/code": np.array([np.nan, 1.0])})
    assert not row["worst"] <= arm.BAR


def test_the_runner_for_the_other_processor_runs_here(tmp_path: Path) -> None:
    problem, _ = certify.draw(0, 3)
    given, made = tmp_path / "in.npz", tmp_path / "out.npz"
    np.savez(given, **{f"{problem.basis}/x/{name}": value for name, value in problem.inputs.items()})
    root = Path(__file__).parents[1]
    script = root / "benchmarks" / "_run_models.py"
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
    assert isinstance(sensing, Sensing)
    y = (problem.inputs["chart"] - 64.0)[0] / (problem.inputs["white"] - 64.0)[0]
    assert sensing.target == pytest.approx(y.T)


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


BENCHMARKS = sorted(path for path in Path(_common.__file__).parent.glob("[a-z]*.py"))
WITHOUT_BARS = {"kotlin_variants", "penalties", "rules_table", "spectrograph"}
"""Those that compare nothing with a bar: they write a file or print tables, or are not a command."""


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
