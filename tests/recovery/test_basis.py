"""Bases by name and by file, and the command that learns one."""

import hashlib
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS
from camssf.recovery.basis import NODES, gaussian_basis, read_basis, steady_exp
from camssf_lab.learning.basis import enlarge, learn, main, process_rows
from camssf_lab.learning.training import HANDFUL, Enlargement, read_curves, training_set_of
from tests.support.problems import CURVES, chart_and_lamp, recovered, theory, toy_camera
from tools import misfit_profile as misfit_profile_tool


def test_gaussians_are_the_paper_s() -> None:
    basis = gaussian_basis()
    assert basis.dictionary.shape == (3, 681, 18)
    assert not basis.mean.any()
    atom = basis.dictionary[0, :, 9]
    above = WAVELENGTHS[atom >= 0.5]
    assert above[-1] - above[0] == pytest.approx(50.0, abs=0.5)  # FWHM
    peaks = WAVELENGTHS[basis.dictionary[0].argmax(axis=0)]
    assert np.diff(peaks) == pytest.approx(20.0)
    assert gaussian_basis(5, 80.0).dictionary.shape == (3, 681, 5)
    for count, width in ((0, 50.0), (3, 0.0), (3, float("nan"))):
        with pytest.raises(InvalidArgument):
            gaussian_basis(count, width)


def test_the_steady_exponential_is_the_exponential() -> None:
    """To two units in the last place; bits by hand, which no processor may change."""
    x = -np.concatenate([np.linspace(0.0, 3.0, 20_001), np.linspace(3.0, 600.0, 20_001), [1e-300, 0.0]])
    found, known = steady_exp(x), np.array([math.exp(value) for value in x])
    assert np.abs(found / known - 1.0).max() <= 2 * 2.0**-52
    assert steady_exp(np.array([0.0, -745.2, -1e3])).tolist() == [1.0, 0.0, 0.0]
    digest = hashlib.sha256(found.astype("<f8").tobytes()).hexdigest()
    assert digest.startswith("63435b6f5e60d8e4")


def toys(count: int = 12) -> np.ndarray:
    curves = np.stack([toy_camera(shift)[::10] for shift in np.linspace(-15, 15, count)])
    return curves / curves.max(axis=1, keepdims=True)


def test_the_dictionary_is_the_spread_of_the_training_set() -> None:
    """Ψ Ψᵀ = 2 x the cameras' covariance + the enlargement's own, by loops; makers weigh the root of their number."""
    makers, copies = ["a"] * 9 + ["b"] * 2 + ["c"], 10
    enlarged = enlarge(toys(), Enlargement(), copies, np.random.default_rng(0)).reshape(copies, 12, 69, 3)
    mean, dictionary = learn(toys(), makers=makers, components=69, copies=copies, seed=0)
    weight = np.array([1 / 3] * 9 + [2**-0.5] * 2 + [1.0]) / (3 + 2**0.5 + 1)
    for c in range(3):
        shapes = enlarged[..., c] / enlarged[..., c].sum(axis=2, keepdims=True)
        centre = sum(w * shapes[:, i].mean(axis=0) for i, w in enumerate(weight))
        assert mean[c] == pytest.approx(centre / centre.max(), abs=1e-12)
        expected = np.zeros((69, 69))
        for i, w in enumerate(weight):
            own = shapes[:, i].mean(axis=0)
            expected += 2 * w * np.outer(own - centre, own - centre)
            for copy in range(copies):
                expected += w / copies * np.outer(shapes[copy, i] - own, shapes[copy, i] - own)
        assert dictionary[c] @ dictionary[c].T == pytest.approx(expected / centre.max() ** 2, abs=1e-12)
    alike = learn(toys(), copies=2)
    assert all(
        (x == y).all() for x, y in zip(alike, learn(toys(), makers=list("abcdefghijkl"), copies=2), strict=True)
    )


def test_half_of_the_phones_covariance_is_that_of_a_process() -> None:
    """By its closed form: between the cameras, with that for a new group; a shift; a smooth relative change."""
    shapes = np.stack([np.exp(-0.5 * ((NODES - centre) / 34.0) ** 2) for centre in (516.0, 533.0, 584.0)])
    weight = np.array([0.2, 0.3, 0.5])
    rows, off = process_rows(shapes, weight), shapes - weight @ shapes
    smooth = np.exp(-0.5 * ((NODES[:, None] - NODES) / 30.0) ** 2)
    expected = 2.0 * (weight[:, None] * off).T @ off
    for shape, share in zip(shapes, weight, strict=True):
        slope = np.gradient(shape, NODES)
        expected += share * (2.0**2 * np.outer(slope, slope) + 0.1**2 * np.outer(shape, shape) * smooth)
    assert rows.T @ rows == pytest.approx(expected, abs=1e-9)
    curves = np.stack([np.stack([shape] * 3, axis=1) for shape in shapes])
    plain = replace(HANDFUL, process=0.0)
    alone, none, both = (
        dictionary[0] @ dictionary[0].T
        for _, dictionary in (
            learn(curves, components=69, size=size) for size in (replace(HANDFUL, process=1.0), plain, HANDFUL)
        )
    )
    assert both == pytest.approx(0.5 * (alone + none), abs=1e-9)


@pytest.mark.repository
def test_the_misfit_profile_is_what_its_command_makes(capsys: pytest.CaptureFixture[str]) -> None:
    assert misfit_profile_tool.main(["--check"]) == 0, capsys.readouterr().out


def write_curves(path: Path, cameras: dict[str, np.ndarray]) -> Path:
    lines = ["camera,wavelength_nm,R,G,B"]
    for name, curves in cameras.items():
        lines += [
            f"{name},{w:g},{','.join(map(repr, map(float, row)))}" for w, row in zip(NODES, curves, strict=True)
        ]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_the_command_learns_a_basis_that_recover_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    curves = write_curves(tmp_path / "mine.csv", {f"toy {i}": c for i, c in enumerate(toys())})
    assert main([str(curves), "-o", str(tmp_path / "mine.npz"), "--components", "6", "--licence", "mine"]) == 0
    assert "12 measured cameras" in capsys.readouterr().out
    assert [p.name for p in tmp_path.iterdir() if p.suffix == ".npz"] == ["mine.npz"]
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    answer = recovered(y, reflectance, lamp, basis=str(tmp_path / "mine.npz"), standard_error=0.002 * y)
    assert answer.engine == "reference"
    assert answer.basis == "mine"
    assert answer.code.shape == (6, 3)


def test_bad_curves_and_bases_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    junk = tmp_path / "junk.npz"
    junk.write_bytes(b"PK\x03\x04 nonsense")
    for spec in (str(junk), str(tmp_path / "none.npz"), "nonsense", str(tmp_path)):
        with pytest.raises(InvalidArgument, match="basis"):
            read_basis(spec)
    odd = tmp_path / "odd.npz"
    np.savez(odd, mean=np.zeros((3, 5)), dictionary=np.zeros((3, 5, 2)), source=np.array("x"))
    with pytest.raises(InvalidArgument, match="shape"):
        read_basis(str(odd))
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, mean=np.array([{"a": 1}], dtype=object), dictionary=np.zeros((3, 69, 2)), source=np.array("x"))
    with pytest.raises(InvalidArgument):
        read_basis(str(pickled))
    text = tmp_path / "curves.csv"
    for content in (
        "",
        "a,b\n1,2\n",
        "camera,wavelength_nm,R,G,B\nx,500,1,1,1\n",
        "camera,wavelength_nm,R,G,B\nx,y,1,1,1\n",
    ):
        text.write_text(content)
        with pytest.raises(InvalidArgument):
            read_curves(text)
    assert main([str(text), "-o", str(tmp_path / "out.npz")]) == 2
    assert "invalid_argument" in capsys.readouterr().err
    assert not (tmp_path / "out.npz").exists()


def test_shipped_basis_comes_from_the_command(tmp_path: Path) -> None:
    assert main([str(CURVES), "-o", str(tmp_path / "again.npz"), "--licence", "Apache-2.0"]) == 0
    again, shipped = read_basis(str(tmp_path / "again.npz")), read_basis("cameras")
    assert again.source == shipped.source
    carried, measured = training_set_of("cameras").curves, read_curves(CURVES)
    assert list(carried) == list(measured)
    assert all((carried[name] == measured[name]).all() for name in measured)
    assert again.mean == pytest.approx(shipped.mean, abs=1e-12)
    assert spread(again.dictionary[:, ::40]) == pytest.approx(spread(shipped.dictionary[:, ::40]), abs=1e-9)


def spread(dictionary: np.ndarray) -> np.ndarray:
    return np.einsum("cmr,cnr->cmn", dictionary, dictionary)


def test_what_cannot_be_extended_or_written_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine = write_curves(tmp_path / "mine.csv", {"toy 1": toys()[0]})
    old = tmp_path / "old.npz"
    np.savez(old, mean=np.ones((3, 69)), dictionary=np.ones((3, 69, 2)), source=np.array("x"))
    for base, words in ((str(old), "does not carry"), ("gaussian", "does not carry"), ("none", "neither a basis")):
        assert main([str(mine), "--extend", base, "-o", str(tmp_path / "out.npz")]) == 2
        assert words in capsys.readouterr().err
    assert main([str(mine), "-o", str(tmp_path / "out.npz")]) == 2
    assert "at least two" in capsys.readouterr().err
    assert main([str(mine), "--extend", "cameras", "-o", str(tmp_path / "missing" / "out.npz")]) == 2
    assert "cannot be written" in capsys.readouterr().err
    assert main([str(mine), "--extend", "cameras", "--components", "70", "-o", str(tmp_path / "out.npz")]) == 2
    assert "Take 1 to 69" in capsys.readouterr().err
    assert not (tmp_path / "out.npz").exists()
