"""The shipped models: what they say of themselves, and that another one is not taken for them."""

import hashlib
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from camssf.errors import InvalidArgument, NotConverged
from camssf.recovery import onnx_model
from camssf.recovery.basis import read_basis, widened
from camssf.recovery.prediction import predict, predict_together
from camssf.recovery.sensitivity import Problem, solve_on_basis, solve_together
from golden.compare import norm
from tests.recovery.test_dense_model import BASES, random_captures
from tests.support.problems import chart_and_lamp, recovered, seeds, theory, toy_camera

pytestmark = pytest.mark.requirement("R-ENGINE")


@pytest.mark.parametrize("name", onnx_model.SHIPPED)
def test_a_shipped_model_belongs_to_its_basis(name: str) -> None:
    model, basis = onnx_model.load_model(name), read_basis(name)
    file = "gaussian" if name == "gaussian" else "learned"
    content = (resources.files("camssf") / "data" / f"camssf-{file}.onnx").read_bytes()
    assert model.sha256 == hashlib.sha256(content).hexdigest()
    assert len(content) <= 400_000
    assert model.metadata["basis_sha256"] == basis.sha256()
    assert model.metadata["grid"] == "380 to 720 nm every 0.5 nm"


def test_another_model_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidArgument, match="shipped"):
        onnx_model.load_model("nonsense")
    onnx_model.load_model.cache_clear()
    monkeypatch.setattr(onnx_model, "VOCABULARY", "2")
    with pytest.raises(InvalidArgument, match="do not belong"):
        onnx_model.load_model("cameras")
    monkeypatch.undo()
    monkeypatch.setattr(onnx_model, "read_basis", lambda name: widened(read_basis(name), 1.01))
    with pytest.raises(InvalidArgument, match="the basis cameras do not belong"):
        onnx_model.load_model("cameras")
    monkeypatch.undo()
    onnx_model._open.cache_clear()
    nowhere = resources.files("camssf") / "nowhere"
    monkeypatch.setattr(onnx_model.resources, "files", lambda package: nowhere)
    with pytest.raises(InvalidArgument, match="Install camssf anew"):
        onnx_model.load_model("cameras")
    monkeypatch.undo()
    onnx_model.load_model.cache_clear()


@pytest.mark.parametrize("which", ["onnx", "reference"])
def test_no_curve_without_its_proof(which: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("camssf.recovery.sensitivity.LARGEST_GAP", -1.0)
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    with pytest.raises(NotConverged, match="duality gap"):
        recovered(y, reflectance, lamp, standard_error=0.01 * y, engine=which)


def test_a_penalty_that_leaves_nothing_is_refused() -> None:
    reflectance, lamp = chart_and_lamp("D55")
    y = theory(reflectance, lamp, toy_camera())
    for which in ("onnx", "reference"):
        with pytest.raises(NotConverged, match="smaller gamma"):
            recovered(y, reflectance, lamp, basis="gaussian", gamma=1e9, engine=which)


@pytest.mark.parametrize("seed", seeds(9))
def test_folds_solved_together_are_those_of_each_without_its_patches(seed: int) -> None:
    """Curves, predictions of the left-out patches and their bands: a mask is as good as leaving out."""
    (given,) = random_captures(seed)
    basis, n = BASES[seed % 3], len(given.reflectance)
    used = np.ones(given.signals.shape[:2], dtype=bool) if given.used is None else given.used
    masks = [used & (np.arange(n) % 4 != fold) for fold in range(4)]
    observations = [replace(given, used=mask) for mask in masks]
    answers = solve_together([Problem(observation, basis) for observation in observations])
    bands = predict_together(answers, observations, basis=basis)
    for mask, found, band in zip(masks, answers, bands, strict=True):
        kept = mask.any(axis=0)
        gains = given.gain_modes
        alone = replace(
            given, signals=given.signals[:, kept], reflectance=given.reflectance[kept], used=mask[:, kept],
            standard_error=None if given.standard_error is None else given.standard_error[:, kept],
            chart_tolerance=given.chart_tolerance[kept], gain_modes=gains[:, :, kept],
        )  # fmt: skip
        expected = solve_on_basis(alone, basis)
        assert np.abs(found.values - expected.values).max() <= 1e-9 * expected.values.max()
        assert norm(found.lamp, expected.lamp) <= 1e-9
        std = predict(
            expected, alone, of=given.reflectance[~kept], of_tolerance=given.chart_tolerance[~kept],
            of_gains=gains[:, :, ~kept], basis=basis,
        ).std  # fmt: skip
        assert band.std[:, ~kept] == pytest.approx(std[:, kept.sum() :], rel=1e-9)
        assert band.std[:, kept] == pytest.approx(std[:, : kept.sum()], rel=1e-9)
