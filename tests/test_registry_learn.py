"""What is learned from results: the old basis taken out again, a population found, and what is not believed."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import document
from registries import made
from schemas import check_schema

import camssf
import camssf.learning.training
from camssf import cli
from camssf.documents.basis_choice import choice_of
from camssf.documents.result_json import document_bytes
from camssf.errors import InvalidArgument
from camssf.fleet.rows import Origin, Row, prior_scale_of, row
from camssf.grid import Floats
from camssf.learning import judgement
from camssf.learning.basis import main as learn_tables
from camssf.learning.judgement import Judgement, judge_gains
from camssf.learning.results import (
    PhotoLikelihood,
    ReferenceBasis,
    Tables,
    log_predictive,
    photo_likelihood,
    populate,
    reference_basis,
    weigh,
)
from camssf.learning.training import training_set_of
from camssf.recovery.basis import Basis, read_basis
from camssf.recovery.hypotheses import recover
from camssf.recovery.linear_model import linear_model
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import load_model
from camssf.recovery.sensitivity import SolverSettings, answer
from camssf.spectra import read_chart, read_lamp

pytest.importorskip("duckdb", reason="duckdb is not here")

from camssf.fleet import learn
from camssf.fleet.learn import LearnRequest, learn_basis
from camssf.fleet.registry import Registry

SCHEMA = Path(camssf.__file__).parent / "data" / "registry.schema.json"


@cache
def old() -> ReferenceBasis:
    known = training_set_of("phones").statistics
    assert known is not None
    return reference_basis(read_basis("phones"), known.names)


def photo(code: Floats, rng: np.random.Generator) -> Observation:
    """Of a phone of this code (3, 24); the noise is large, so that the basis has much to say."""
    basis = read_basis("phones")
    curves = (basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code)).T
    chart, light = read_chart("classic24").values, read_lamp("D55").values
    y = (light * chart) @ curves / (light @ curves)
    error = np.hypot(0.003 * y, 0.0006)
    return Observation(
        y + error * rng.normal(size=y.shape), chart, light, standard_error=error, chart_tolerance=0.02,
        lamp_tolerance=0.01,
    )  # fmt: skip


def result(number: int, code: Floats, rng: np.random.Generator, **more: Any) -> Row:
    """As the registry has it."""
    found = answer(photo(code, rng), "phones", settings=SolverSettings(engine="onnx"))
    assert found.posterior is not None
    row_ = made(number, found.peak()[0][::10].T, **{"make": "Acme", "model": f"P{number % 4}", "serial": ""} | more)
    return replace(
        row_, basis="phones", onnx=load_model("phones").sha256, l2=found.settings.l2,
        gamma=float(found.settings.gamma[0]), prior_scale=1.0,
        code_covariance=tuple(found.posterior.code_covariance[np.tril_indices(72)]),
    )  # fmt: skip


@cache
def fleet() -> tuple[tuple[Row, ...], Floats]:
    """Twenty units of four models, and the models' codes (4, 3, 24), two standard deviations from the basis' mean."""
    rng = np.random.default_rng(7)
    centres = 0.7 * rng.normal(size=(4, 3, 24)) + np.where(np.arange(24) < 3, 2.0, 0.0)
    rows = [result(i, centres[i % 4] + 0.2 * rng.normal(size=(3, 24)), rng) for i in range(20)]
    return tuple(rows), centres


@pytest.fixture
def registry(tmp_path: Path) -> Registry:
    one = Registry(tmp_path / "phones", new=True)
    one.add(fleet()[0])
    return one


# What a photo says


def test_the_old_prior_is_taken_out_again() -> None:
    """J = Aᵀ Σ⁻¹ A of the rows themselves, and h = Aᵀ Σ⁻¹ b, to the first order in the code."""
    rng = np.random.default_rng(1)
    evidence, basis = photo(0.3 * rng.normal(size=(3, 24)), rng), read_basis("phones")
    found = answer(evidence, basis, settings=SolverSettings(engine="reference", gamma=0.0))
    assert found.posterior is not None
    curves = found.peak()[0][::10].T
    taken = photo_likelihood(("", "", ""), curves, found.posterior.code_covariance, old(), 1.0, 0.0)
    rows = linear_model(evidence, basis)
    weighed = np.linalg.solve(rows.covariance[0], np.column_stack([rows.matrix[0], rows.target[0]]))
    J, h = rows.matrix[0].T @ weighed[:, :-1], rows.matrix[0].T @ weighed[:, -1]
    strongest = np.linalg.eigh(J)[1][:, -20:]  # what it says well; the very best is bounded, the faintest left out
    mine = strongest.T @ taken.factor
    said_ = (strongest.T @ J @ strongest).diagonal()
    clear = (said_ > 0.2) & (said_ < 5e3)
    assert clear.sum() >= 8
    assert (mine @ mine.T).diagonal()[clear] == pytest.approx(
        (strongest.T @ J @ strongest).diagonal()[clear], rel=0.02
    )
    exact, got = strongest.T @ h, strongest.T @ (taken.factor @ taken.value)
    size = np.sqrt((strongest.T @ J @ strongest).diagonal())
    assert (got / size)[clear] == pytest.approx((exact / size)[clear], abs=0.3)


def test_what_was_found_under_two_widths_says_the_same_as_under_one() -> None:
    rng = np.random.default_rng(2)
    evidence = photo(1.5 * rng.normal(size=(3, 24)), rng)
    one, wide = (
        answer(evidence, "phones", settings=SolverSettings(engine="reference", gamma=0.0), prior_scale=s)
        for s in (1.0, 2.0)
    )
    assert one.posterior is not None
    assert wide.posterior is not None
    alone = photo_likelihood(("", "", ""), one.peak()[0][::10].T, one.posterior.code_covariance, old(), 1.0, 0.0)
    other = photo_likelihood(("", "", ""), wide.peak()[0][::10].T, wide.posterior.code_covariance, old(), 2.0, 0.0)
    mean, spread = np.zeros(72), np.eye(72)
    J, K = (each.factor @ each.factor.T for each in (alone, other))
    assert np.trace(spread @ J) == pytest.approx(np.trace(spread @ K), rel=0.1)
    x, y = (
        np.linalg.solve(each.factor @ each.factor.T + spread, each.factor @ each.value) for each in (alone, other)
    )
    assert np.sqrt(np.mean((x - y) ** 2)) < 0.05
    assert np.sqrt(np.mean(x**2)) > 0.5
    assert log_predictive(alone, mean, spread) < log_predictive(alone, x, 0.1 * spread)


def test_photos_that_say_nothing_change_nothing() -> None:
    """The trap: curves that lean on the old basis, taken for measured ones, would narrow it."""
    nothing = [PhotoLikelihood(("acme", f"m{i}", str(i)), np.zeros((72, 1)), np.zeros(1)) for i in range(50)]
    found = populate(nothing, old())
    assert found.mean == pytest.approx(np.zeros(72), abs=1e-12)
    assert found.between == pytest.approx(np.eye(72), abs=1e-9)
    assert np.sqrt(np.trace(found.within) / 72) == pytest.approx(0.3)


@pytest.mark.requirement("R-LEARN")
@pytest.mark.full
def test_a_population_is_found_again() -> None:
    """Two-level, of photos that say half of it: mean, between and within, in simulated measurements of known size."""
    rng = np.random.default_rng(3)
    m = np.where(np.arange(72) % 24 < 4, 1.0, 0.0)
    results = []
    for model in range(60):
        centre = m + 0.5 * rng.normal(size=72)
        for unit in range(4):
            x = centre + 0.4 * rng.normal(size=72)
            A = np.linalg.qr(rng.normal(size=(72, 36)))[0] * 4.0
            results.append(
                PhotoLikelihood((f"maker {model}", f"m{model}", str(unit)), A, A.T @ x + rng.normal(size=36))
            )
    found = populate(results, replace(old(), names=("Elder 1",)))  # one camera, so that it counts for little
    share = found.weights[0]
    assert share == pytest.approx(1 / 61)
    assert found.mean == pytest.approx((1 - share) * m, abs=0.35)
    assert np.trace(found.within) / 72 == pytest.approx(0.16, rel=0.15)
    expected = share * (1 + np.mean(m**2)) + (1 - share) * 0.25
    assert np.trace(found.between) / 72 == pytest.approx(expected, rel=0.15)
    first = found.models["maker 0", "m0"]
    assert np.trace(first[1]) / 72 < 0.2


def test_several_photos_of_a_unit_count_as_one() -> None:
    rng = np.random.default_rng(4)
    A = np.linalg.qr(rng.normal(size=(72, 30)))[0] * 5.0
    one = PhotoLikelihood(("a", "m", "u"), A, A.T @ np.ones(72))
    once, often = populate([one], old()), populate([one] * 7, old())
    assert once.mean == pytest.approx(often.mean, abs=1e-9)
    assert once.within == pytest.approx(often.within, abs=1e-9)
    assert often.units == 1


def test_weights_are_those_of_learn() -> None:
    known = ("Apple 1", "Apple 2", "Apple 3", "Apple 4", "Nokia 1")
    rest, beside, own = weigh(known, ("Apple 5", "Sony 1"), [("apple", "6"), ("sony", "2"), ("new", "1")])
    assert rest + beside.sum() + own.sum() == pytest.approx(1.0)
    total = 6**0.5 + 1 + 2**0.5 + 1
    assert own == pytest.approx(np.array([6**-0.5, 2**-0.5, 1.0]) / total)
    assert beside == pytest.approx(np.array([6**-0.5, 2**-0.5]) / total)


# From a registry


@pytest.mark.requirement("R-LEARN")
def test_a_registry_learns_its_phones(registry: Registry, tmp_path: Path) -> None:
    """Those of a model that were not seen are nearer; and the judgement, which does not know the truth, says so."""
    lesson = learn_basis(registry, LearnRequest(model="P1"))
    assert (len(lesson.keys), lesson.of, lesson.judgement.left_out) == (20, ("acme", "P1"), "unit")
    assert lesson.judgement.helps is True
    everybody = learn_basis(registry)
    assert everybody.judgement.helps is True
    assert (everybody.judgement.left_out, everybody.judgement.groups) == ("model", 4)
    assert learn_basis(registry, LearnRequest(leave="maker")).judgement.helps is None  # there is one maker alone
    rng, (_, centres) = np.random.default_rng(8), fleet()
    wrong: dict[str, list[float]] = {"old": [], "all": [], "own": []}
    basis = read_basis("phones")
    for _ in range(6):
        code = centres[1] + 0.2 * rng.normal(size=(3, 24))
        truth = (basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code)).T
        evidence = photo(code, rng)
        for name, used in (("old", basis), ("all", everybody.basis), ("own", lesson.basis)):
            curves = answer(evidence, used, settings=SolverSettings(engine="reference")).peak()[0]
            wrong[name].append(float(np.sqrt(np.mean((curves - truth / truth.max(axis=0)) ** 2))))
    old_, all_, own = (np.mean(each) for each in wrong.values())
    assert own < 0.9 * old_
    assert own < all_ < 1.02 * old_
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text("utf-8"))).validate(lesson.document())
    lesson.save(tmp_path / "own.npz")
    kept = read_basis(str(tmp_path / "own.npz"))
    assert kept.mean[:, ::10] == pytest.approx(lesson.mean)
    assert "20 results of 20 units of acme P1, and from " in kept.source
    with np.load(tmp_path / "own.npz") as content:
        assert json.loads(str(content["registry"])) == lesson.document()
        assert len(content["registry_results"]) == 20
        assert content["curves"].shape == (0, 69, 3)
    assert recover(evidence, basis=str(tmp_path / "own.npz")).values.shape == (681, 3)


def test_a_basis_that_was_learned_can_be_extended(registry: Registry, tmp_path: Path) -> None:
    """Its models count as cameras of their makers, beside the six that `phones` knows."""
    learn_basis(registry).save(tmp_path / "ours.npz")
    known = training_set_of(str(tmp_path / "ours.npz")).statistics
    assert known is not None
    assert set(known.names) == {*old().names, *(f"acme P{i}" for i in range(4))}
    table(tmp_path / "mine.csv")
    words = [str(tmp_path / "mine.csv"), "-o", str(tmp_path / "more.npz"), "--extend", str(tmp_path / "ours.npz")]
    assert learn_tables(words) == 0


def table(path: Path, names: tuple[str, ...] = ("Tester One", "Tester Two")) -> None:
    """Measured cameras: the basis' mean, bent."""
    mean, nm = read_basis("phones").mean[:, ::10], np.arange(380, 721, 5)
    lines = ["camera,wavelength_nm,R,G,B"]
    for number, name in enumerate(names):
        bent = mean * np.exp(0.2 * (number + 1) * np.sin(nm / 40.0))
        lines += [f"{name},{w},{r:.6f},{g:.6f},{b:.6f}" for w, r, g, b in zip(nm, *bent, strict=True)]
    path.write_text("\n".join(lines) + "\n")


def test_measured_tables_count_beside_results(registry: Registry, tmp_path: Path) -> None:
    table(tmp_path / "mine.csv")
    without, found = (
        learn_basis(registry),
        learn_basis(registry, LearnRequest(table=tmp_path / "mine.csv", licence="CC0")),
    )
    document_ = found.document()
    assert [each["name"] for each in document_["tables"]] == ["Tester One", "Tester Two"]
    shares = [document_["weight_of_basis"], *(each["weight"] for each in document_["tables"] + document_["models"])]
    assert sum(shares) == pytest.approx(1.0)
    nodes, _ = (camssf.learning.training.read_curves(tmp_path / "mine.csv"), None)
    target = nodes["Tester Two"].T / nodes["Tester Two"].sum(axis=0)[:, None]
    near, far = (np.abs(each.mean / each.mean.sum(axis=1)[:, None] - target).sum() for each in (found, without))
    assert near < far
    assert "CC0" in found.source
    table(tmp_path / "twice.csv", ("Samsung Galaxy S8", "Tester Two"))
    with pytest.raises(InvalidArgument, match="in the basis already"):
        learn_basis(registry, LearnRequest(table=tmp_path / "twice.csv"))


def test_tables_as_results_would_have_it() -> None:
    """A table in the old basis' directions and a photo without error of the same camera teach the same."""
    code = np.random.default_rng(6).normal(size=72) * np.where(np.arange(72) % 24 < 3, 1.0, 0.0)
    curves = old().mean + np.einsum("cmr,cr->cm", old().dictionary, code.reshape(3, 24))
    none = camssf.learning.training.Enlargement(0.0, 0.0, 0.0, 0.0, 1.0, 60.0, own_mean=True)
    nothing = PhotoLikelihood(("acme", "m", "1"), np.zeros((72, 1)), np.zeros(1))
    tables = Tables(curves.T[None] / curves.max(axis=1), ("Acme t",), none)
    by_table = populate([nothing], old(), tables)
    exact = PhotoLikelihood(("acme", "t", "1"), 1e3 * np.eye(72), 1e3 * code)
    by_photo = populate([nothing, exact], old())
    assert by_table.mean == pytest.approx(by_photo.mean, abs=0.02)
    mean, dictionary = by_table.basis()
    assert mean.max(axis=1) == pytest.approx(np.ones(3))
    gram = np.einsum("cmr,cms->crs", dictionary, dictionary)
    assert gram == pytest.approx(gram * np.eye(24), abs=1e-9)


def test_two_groups_have_one_degree_of_freedom() -> None:
    """4 ± 1 nats of two groups: ± 12.7 standard errors, so nobody can tell; of five, ± 2.78, and it helps."""
    two, five = judge_gains("model", np.array([3.0, 5.0])), judge_gains("model", np.array([1.0, 5.0, 4.0, 5.0, 5.0]))
    assert (two.groups, two.nats, two.error, two.helps) == (2, 4.0, pytest.approx(1.0), None)
    assert (two.low, two.high) == (pytest.approx(4 - 12.7062, abs=1e-3), pytest.approx(4 + 12.7062, abs=1e-3))
    assert five.low == pytest.approx(4 - 2.77645 * five.error, abs=1e-4)  # type: ignore[operator]
    assert five.helps is True
    assert judge_gains("unit", -np.array([4.0, 4.1, 4.2])).helps is False
    assert judge_gains("unit", np.array([4.0])) == Judgement("unit", 1, None, None, None, None, None)


def test_what_does_not_count_is_said(tmp_path: Path) -> None:
    one = Registry(tmp_path / "r", new=True)
    (good, *_) = fleet()[0]
    bad = [
        replace(good, code_covariance=()), replace(good, prior_scale=None), replace(good, l2=2.0),
        replace(good, onnx="e" * 64), replace(good, onnx="", software="0.0.1"), replace(good, basis="cameras"),
        replace(good, status="doubtful"),
    ]  # fmt: skip
    one.add([replace(each, key=f"{i:064d}") for i, each in enumerate(bad, 100)])
    with pytest.raises(InvalidArgument, match=r"1 on another basis, .*1 without a covariance") as caught:
        learn_basis(one)
    assert "Add results" in caught.value.advice
    one.add([good, replace(good, key="b" * 64, onnx="", software=camssf.__version__)])
    found = learn_basis(one)
    assert len(found.keys) == 2
    assert sum(found.left_aside.values()) == 7
    assert found.left_aside["doubtful"] == 1
    assert found.left_aside["another release's phones"] == 2
    assert found.judgement.helps is None
    assert len(learn_basis(one, LearnRequest(statuses=("accepted", "doubtful"))).keys) == 3


def test_a_row_that_was_damaged_is_named(tmp_path: Path) -> None:
    (good, *_) = fleet()[0]
    cov, red = list(good.code_covariance), list(good.red)
    for number, more in enumerate(
        (
            {"code_covariance": (float("nan"), *cov[1:])}, {"code_covariance": (-1e9, *cov[1:])},
            {"code_covariance": (float("inf"), *cov[1:])}, {"red": (1e20, *red[1:])}, {"red": tuple(red[1:])},
            {"blue": (float("nan"), *good.blue[1:])}, {"prior_scale": -1.0},
        )
    ):  # fmt: skip
        one = Registry(tmp_path / str(number), new=True)
        one.add([good, replace(good, key="b" * 64, **more)])
        with pytest.raises(InvalidArgument, match=r"parquet is damaged: of the result bbbbbbbbbbbb\.\.\. "):
            learn_basis(one)


def test_what_cannot_be_learned(registry: Registry) -> None:
    for wanted, words in (
        (LearnRequest(basis="gaussian"), "--basis takes cameras or phones"),
        (LearnRequest(basis="cameras"), "on cameras"),
        (LearnRequest(leave="unit"), "--leave takes model or maker; got 'unit'"),
        (LearnRequest(model="P9"), "No result of P9"),
        (LearnRequest(model="P1", make="Other"), "No result of P1"),
        (LearnRequest(table=Path("none.csv")), "cannot be read"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            learn_basis(registry, wanted)


def test_more_groups_than_folds_are_all_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judgement, "FOLDS", 2)
    monkeypatch.setattr(learn, "OF_MODEL", 3)
    one = Registry(tmp_path / "r", new=True)
    (good, *_) = fleet()[0]
    one.add([replace(good, key=f"{i:064d}", model=f"m{i}") for i in range(5)])
    assert learn_basis(one).judgement.groups == 5
    one.add([replace(good, key=f"{i:064d}", model="m0", serial=str(i)) for i in range(100, 104)])
    (reason,) = (found := learn_basis(one)).left_aside
    assert "older than the newest 3 of their model" in reason
    assert found.left_aside[reason] == 2


# The row


def test_the_row_holds_what_learning_needs() -> None:
    given = document("D55", "A")
    found = row(document_bytes(given), given, Origin())
    assert (found.l2, found.gamma) == (given["l2"], max(given["gamma"]))
    assert list(found.code_covariance) == given["code_covariance"]
    assert found.prior_scale in (None, given["prior_scale"])
    chosen = choice_of(given)
    assert found.odds == (None if chosen is None else chosen.odds)
    weighed = [
        {"basis": basis, "log_evidence": 0.0, "probability": share}
        for basis, share in ((given["basis"], 0.98), ("other", 0.02))
    ]
    assert row("b" * 64, {**given, "choice": weighed}, Origin()).odds == pytest.approx(49.0)
    refused = row("a" * 64, {**given, "verdict": {"status": "refused", "reasons": []}}, Origin())
    assert refused.status == "refused"


def test_the_prior_s_width_of_what_answered_alone() -> None:
    def weight(basis: str, share: float, **more: Any) -> dict[str, Any]:
        return {"basis": basis, "probability": share} | more

    told = {"basis": "phones", "prior_scale": 1.0}
    clear = [weight("phones", 0.98), weight("cameras", 0.02)]
    mixed = [weight("phones", 0.6), weight("cameras", 0.4)]
    unnamed = [weight("phones", 1.0, kinds=["bulb"])]
    assert prior_scale_of({}) is None
    assert prior_scale_of(told | {"choice": []}) == prior_scale_of(told | {"choice": clear}) == 1.0
    assert prior_scale_of({"basis": "phones", "prior_scale": 4.0, "choice": clear}) == 4.0
    assert prior_scale_of(told | {"choice": mixed}) is prior_scale_of(told | {"choice": unnamed}) is None


# The command line


def run(*words: object) -> int:
    return cli.main(["registry", *map(str, words)])


def test_the_command(registry: Registry, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text("utf-8")))
    assert run("learn", registry.folder, "-o", tmp_path / "ours.npz") == 0
    out, err = capsys.readouterr()
    schema.validate(json.loads(out))
    words = " ".join(err.split())
    assert "nats a photo, 95 % interval" in words
    assert "from 4 models, each left out in turn (Student's t, 3 degrees of freedom)" in words
    assert run("learn", registry.folder, "-o", tmp_path / "own.txt") == InvalidArgument.exit_status
    assert run("learn", registry.folder, "-o", tmp_path / "no.npz", "--basis", "cameras") == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ours.npz", "phones"]
    basis: Basis = read_basis(str(tmp_path / "ours.npz"))
    assert basis.prior


def test_the_schema_is_sound() -> None:
    check_schema(SCHEMA)
    for each in json.loads(SCHEMA.read_text("utf-8"))["$defs"].values():
        assert each["description"]
