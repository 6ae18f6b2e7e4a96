"""The shipped models: what they say of themselves, and that another one is not taken for them."""

from __future__ import annotations

import hashlib
from importlib import resources

import numpy as np
import pytest

from camssf.errors import InvalidArgument, NotConverged
from camssf.grid import WAVELENGTHS
from camssf.recovery import onnx_model
from camssf.recovery.basis import read_basis
from tests.problems import chart_and_lamp, recovered, theory, toy_camera

pytestmark = pytest.mark.requirement("R-ENGINE")


@pytest.mark.parametrize("name", onnx_model.SHIPPED)
def test_a_shipped_model_belongs_to_its_basis(name: str) -> None:
    model, basis = onnx_model.load_model(name), read_basis(name)
    content = (resources.files("camssf") / "data" / f"camssf-{name}.onnx").read_bytes()
    assert model.sha256 == hashlib.sha256(content).hexdigest()
    assert len(content) <= 400_000
    assert model.metadata["basis_sha256"] == basis.sha256()
    assert model.metadata["grid"] == "380 to 720 nm every 0.5 nm"


@pytest.mark.parametrize("basis", onnx_model.SHIPPED)
@pytest.mark.parametrize("shots", [1, 2])
def test_engines_give_the_same_numbers(basis: str, shots: int) -> None:
    if basis == "gaussian" and shots > 1:
        shots = 1
    reflectance, day = chart_and_lamp("D55", slice(0, 24))
    _, bulb = chart_and_lamp("A")
    lamps = np.stack([day, bulb])[:shots]
    y = np.stack([theory(reflectance, lamp, toy_camera()) for lamp in lamps])
    y = y * (1 + 0.004 * np.sin(np.arange(y.size)).reshape(y.shape))
    arguments = {
        "standard_error": np.hypot(0.004 * y, 1e-3),
        "lamp_tolerance": 0.02,
        "lamp_modes": 0.01 * np.sin(WAVELENGTHS / 50) * np.ones((shots, 2, 1)),
        "white_reflectance": 0.9 + 0.05 * np.cos(WAVELENGTHS / 80),
        "basis": basis,
        "frames": (512 + 9000 * y, 9512 + 0 * y, 512 + 0 * y),
    }
    one, other = (recovered(y, reflectance, lamps, engine=e, **arguments) for e in ("onnx", "reference"))
    assert (one.settings.engine, other.settings.engine) == ("onnx", "reference")
    for name in ("values", "code", "predicted", "std"):
        a, b = getattr(one, name), getattr(other, name)
        if name == "std" and basis == "gaussian":
            assert a is None
            assert b is None
        else:
            assert np.abs(a - b).max() <= 1e-10 * np.abs(b).max()
    assert one.light.channel_gain == pytest.approx(other.light.channel_gain, rel=1e-10)
    assert (one.proof.gap <= 1e-9).all()


def test_another_model_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidArgument, match="shipped"):
        onnx_model.load_model("nonsense")
    onnx_model.load_model.cache_clear()
    monkeypatch.setattr(onnx_model, "VOCABULARY", "2")
    with pytest.raises(InvalidArgument, match="does not belong"):
        onnx_model.load_model("cameras")
    monkeypatch.undo()
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
