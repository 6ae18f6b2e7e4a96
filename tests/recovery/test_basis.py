"""Bases by name and by file, and the command that learns one; `phones`: what ships, and the benchmark that judges it.

The phones' table may not be passed on. Who has it sets CAMSSF_PHONES to its path; what needs it skips elsewhere.
"""

import hashlib
import json
import math
import os
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from benchmarks import shared as _common
from benchmarks.__main__ import main as benchmark
from benchmarks.claims import phones
from benchmarks.claims.accuracy import Setting
from benchmarks.claims.phones import APART, auto
from benchmarks.devices import CAMERAS, OTHER_MAKER, OTHERS, PHONES, Device, phones_left_out
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import NODES, Basis, gaussian_basis, read_basis, steady_exp
from camssf_lab.learning.basis import enlarge, learn, main, process_rows
from camssf_lab.learning.training import HANDFUL, Enlargement, Statistics, maker_of, read_curves, training_set_of
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
    """Ψ Ψᵀ = 2 x the cameras' covariance + the enlargement's own; makers weigh the root of their number."""
    makers, copies = ["a"] * 9 + ["b"] * 2 + ["c"], 10
    enlarged = enlarge(toys(), Enlargement(), copies, np.random.default_rng(0)).reshape(copies, 12, 69, 3)
    mean, dictionary = learn(toys(), makers=makers, components=69, copies=copies, seed=0)
    weight = np.array([1 / 3] * 9 + [2**-0.5] * 2 + [1.0]) / (3 + 2**0.5 + 1)
    for c in range(3):
        shapes = enlarged[..., c] / enlarged[..., c].sum(axis=2, keepdims=True)
        cameras = shapes.mean(axis=0)
        centre = weight @ cameras
        assert mean[c] == pytest.approx(centre / centre.max(), abs=1e-12)
        between, copied = cameras - centre, shapes - cameras
        expected = 2 * (weight[:, None] * between).T @ between
        expected += np.einsum("i,kim,kin->mn", weight / copies, copied, copied)
        assert dictionary[c] @ dictionary[c].T == pytest.approx(expected / centre.max() ** 2, abs=1e-12)
    for alike, known in zip(learn(toys(), copies=2), learn(toys(), makers=[*"abcdefghijkl"], copies=2), strict=True):
        assert (alike == known).all()


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
    curves = np.stack([shapes] * 3, axis=2)
    sizes = (replace(HANDFUL, process=1.0), replace(HANDFUL, process=0.0), HANDFUL)
    learned = (learn(curves, components=69, size=size)[1][0] for size in sizes)
    alone, none, both = (dictionary @ dictionary.T for dictionary in learned)
    assert both == pytest.approx(0.5 * (alone + none), abs=1e-9)


@pytest.mark.repository
def test_the_misfit_profile_is_what_its_command_makes(capsys: pytest.CaptureFixture[str]) -> None:
    assert misfit_profile_tool.main(["--check"]) == 0, capsys.readouterr().out


def write_curves(path: Path, cameras: dict[str, np.ndarray]) -> Path:
    rows = [
        [name, w, *row] for name, curves in cameras.items() for w, row in zip(NODES, curves.tolist(), strict=True)
    ]
    path.write_text("".join(",".join(map(str, row)) + "\n" for row in [["camera,wavelength_nm,R,G,B"], *rows]))
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


def test_bad_curves_and_bases_are_named(tmp_path: Path) -> None:
    junk, odd, pickled = (tmp_path / f"{name}.npz" for name in ("junk", "odd", "pickled"))
    junk.write_bytes(b"PK\x03\x04 nonsense")
    np.savez(odd, mean=np.zeros((3, 5)), dictionary=np.zeros((3, 5, 2)), source=np.array("x"))
    np.savez(pickled, mean=np.array([{"a": 1}], dtype=object), dictionary=np.zeros((3, 69, 2)), source=np.array("x"))
    for spec, words in (
        (junk, "basis"), (tmp_path / "none.npz", "basis"), ("nonsense", "basis"), (tmp_path, "basis"),
        (odd, "shape"), (pickled, None),
    ):  # fmt: skip
        with pytest.raises(InvalidArgument, match=words):
            read_basis(str(spec))
    text, head = tmp_path / "curves.csv", "camera,wavelength_nm,R,G,B\n"
    for content in ("", "a,b\n1,2\n", f"{head}x,500,1,1,1\n", f"{head}x,y,1,1,1\n"):
        text.write_text(content)
        with pytest.raises(InvalidArgument):
            read_curves(text)


def test_what_cannot_be_learned_extended_or_written_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine, out = write_curves(tmp_path / "mine.csv", {"toy 1": toys()[0]}), tmp_path / "out.npz"
    np.savez(tmp_path / "old.npz", mean=np.ones((3, 69)), dictionary=np.ones((3, 69, 2)), source=np.array("x"))
    (tmp_path / "none.csv").write_text("")
    for arguments, words in (
        (f"{tmp_path / 'none.csv'}", "invalid_argument"),
        (f"{mine} --extend {tmp_path / 'old.npz'}", "does not carry"),
        (f"{mine} --extend gaussian", "does not carry"),
        (f"{mine} --extend none", "neither a basis"),
        (f"{mine}", "at least two"),
        (f"{mine} --extend cameras -o {tmp_path / 'missing' / 'out.npz'}", "cannot be written"),
        (f"{mine} --extend cameras --components 70", "Take 1 to 69"),
    ):
        assert main(["-o", str(out), *arguments.split()]) == 2
        assert words in capsys.readouterr().err
        assert not out.exists()


def spread(dictionary: np.ndarray) -> np.ndarray:
    return dictionary @ dictionary.mT


def same_basis(path: Path, name: str) -> tuple[Basis, Basis]:
    """The basis of a file and a shipped one, once they agree."""
    found, shipped = read_basis(str(path)), read_basis(name)
    assert found.mean == pytest.approx(shipped.mean, abs=1e-12)
    assert spread(found.dictionary[:, ::40]) == pytest.approx(spread(shipped.dictionary[:, ::40]), abs=1e-9)
    return found, shipped


def test_shipped_basis_comes_from_the_command(tmp_path: Path) -> None:
    assert main([str(CURVES), "-o", str(tmp_path / "again.npz"), "--licence", "Apache-2.0"]) == 0
    again, shipped = same_basis(tmp_path / "again.npz", "cameras")
    assert again.source == shipped.source
    carried, measured = training_set_of("cameras").curves, read_curves(CURVES)
    assert list(carried) == list(measured)
    assert all((carried[name] == measured[name]).all() for name in measured)


PAPERS = ("Tominaga, Nishi, Ohtera, Sensors 2021, 21, 4985", "Burggraaff et al., Opt. Express 2019, 27, 19075")
LICENCE = "none stated, so the table is in no file of camssf"
TABLE = os.environ.get("CAMSSF_PHONES")


def toy_phones() -> dict[str, Floats]:
    """Four phones of two makers, which differ by their wavelengths."""
    names = ("Apfel 1", "Apfel 2", "Sonne 1", "Sonne 2")
    every = (toy_camera(shift)[::10] for shift in (-4.0, -1.0, 2.0, 4.0))
    return {name: curves / curves.max(axis=0) for name, curves in zip(names, every, strict=True)}


@pytest.mark.requirement("R-PHONES")
def test_the_shipped_basis_is_the_one_that_was_judged() -> None:
    """Its hash on the nodes; it names both papers."""
    basis, notice = read_basis("phones"), (Path(__file__).parents[2] / "NOTICE").read_text("utf-8")
    assert basis.sha256() == "b885e56fc003bcffb390d0df96588632855f835e61b26b747215852f9d5153f8"
    assert all(paper in basis.source for paper in PAPERS)
    assert training_set_of("phones").curves == {}
    for word in ("phones.npz", "Tominaga", "2021, 21, 4985", "Burggraaff", "2019, 27, 19075"):
        assert word in notice


def test_no_phone_can_be_read_out_of_it() -> None:
    """Nothing in the file is a curve of one phone: the mean is no phone's, and no array has one row for each."""
    with np.load(str(files("camssf") / "data" / "phones.npz"), allow_pickle=False) as content:
        shapes = {name: content[name].shape for name in content.files}
    assert shapes.pop("known") == (6,)
    assert shapes.pop("curves") == (0, 69, 3)
    assert not any(6 in shape for shape in shapes.values())


def test_extended_by_nothing_it_is_itself(tmp_path: Path) -> None:
    (tmp_path / "none.csv").write_text("camera,wavelength_nm,R,G,B\n")
    assert main([str(tmp_path / "none.csv"), "--extend", "phones", "-o", str(tmp_path / "same.npz")]) == 0
    assert "from 6 measured phones (" in same_basis(tmp_path / "same.npz", "phones")[0].source


def test_a_phone_of_one_s_own_moves_it_and_can_be_added_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = write_curves(tmp_path / "mine.csv", {"Sonne 1": toy_phones()["Sonne 1"]})
    assert main([str(mine), "--extend", "phones", "-o", str(tmp_path / "mine.npz"), "--licence", "mine"]) == 0
    found, shipped = read_basis(str(tmp_path / "mine.npz")), read_basis("phones")
    assert "6 measured phones and 1 measured camera (phones.csv" in found.source
    assert PAPERS[1] in found.source
    assert np.abs(found.mean - shipped.mean).max() > 0.01
    carried = training_set_of(str(tmp_path / "mine.npz"))
    assert list(carried.curves) == ["Sonne 1"]
    assert carried.size == HANDFUL
    capsys.readouterr()
    assert main([str(mine), "--extend", str(tmp_path / "mine.npz"), "-o", str(tmp_path / "no.npz")]) == 2
    known = write_curves(tmp_path / "known.csv", {"apple iphone x": toy_phones()["Apfel 1"]})
    assert main([str(known), "--extend", "phones", "-o", str(tmp_path / "no.npz")]) == 2
    assert capsys.readouterr().err.count("in the basis already") == 2
    assert main([str(mine), "--extend", "phones", "--handful", "-o", str(tmp_path / "no.npz")]) == 2
    assert "do not go with --extend" in capsys.readouterr().err
    assert not (tmp_path / "no.npz").exists()


@pytest.mark.parametrize("own_mean", [False, True])
def test_statistics_stand_for_the_curves(own_mean: bool) -> None:
    """Two makers as statistics and a third one's curves, without random changes: as all curves together.

    One maker's devices weigh the root of their number whichever side they stand on.
    """
    size = Enlargement(0, 0, 0, 0, few_makers=3.0, own_mean=own_mean)
    curves = toy_phones() | {"Tal 1": toy_phones()["Apfel 1"] ** 1.2, "Tal 2": toy_phones()["Sonne 2"] ** 0.9}
    stack, makers = np.stack(list(curves.values())), [maker_of(name) for name in curves]
    known = Statistics(*learn(stack[:4], makers=makers[:4], components=69, size=size, copies=2), tuple(curves)[:4])
    mean, found = learn(stack[4:], makers=makers[4:], components=69, size=size, copies=2, statistics=known)
    expected_mean, expected = learn(stack, makers=makers, components=69, size=size, copies=2)
    assert mean == pytest.approx(expected_mean, abs=1e-12)
    assert spread(found) == pytest.approx(spread(expected), abs=1e-12)


def test_curves_end_gently(tmp_path: Path) -> None:
    """From 400 to 700 nm, as phones are measured: half is left 10 nm further, nothing at the grid's ends."""
    lines = ["camera,wavelength_nm,R,G,B"] + [f"x,{nm},1,0.5,{0.2 + (nm == 500)}" for nm in range(400, 701, 10)]
    path = tmp_path / "short.csv"
    path.write_text("\n".join(lines) + "\n")
    (found,) = read_curves(path, least=1).values()
    at = {nm: int(np.flatnonzero(nm == NODES)[0]) for nm in (380, 385, 390, 400, 700, 710, 720)}
    for nm, left in ((380, 0.0), (385, 0.25), (390, 0.5), (400, 1.0), (700, 1.0), (710, 0.5), (720, 0.0)):
        assert found[at[nm]] == pytest.approx(left * np.array([1.0, 1.0, 0.2 / 1.2]), abs=1e-12)


@pytest.mark.requirement("R-PHONES")
def test_no_phone_teaches_its_own_basis() -> None:
    nodes = toy_phones()
    for device in phones_left_out(nodes):
        others = device.bases[OTHERS].source.split(", ")
        assert sorted([*others, device.name]) == sorted(nodes)
        strangers = device.bases[OTHER_MAKER].source.split(", ")
        assert len(strangers) == 2
        assert maker_of(device.name) not in map(maker_of, strangers)
        rest = np.stack([nodes[name] for name in others])
        expected = learn(rest, makers=[maker_of(name) for name in others], size=HANDFUL)[1]
        assert (device.bases[OTHERS].dictionary[:, ::10] == expected).all()


@pytest.mark.requirement("R-PHONES", "R-LABORATORY")
@pytest.mark.full
def test_the_benchmark_runs_on_any_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One setting, one draw, no cameras."""
    monkeypatch.setattr(_common, "RESULTS", tmp_path)
    monkeypatch.setattr(phones, "EVERY", (Setting("x", ("D55",)),))
    toy = phones_left_out(toy_phones())[0]  # in the place of the 52 cameras
    bases = {CAMERAS: toy.bases[CAMERAS], PHONES: read_basis("phones")}
    monkeypatch.setattr(phones, "measured_cameras", lambda: [Device(toy.name, toy.curves, bases)])
    table = str(write_curves(tmp_path / "toys.csv", toy_phones()))
    monkeypatch.delenv("CAMSSF_FOREIGN", raising=False)
    assert benchmark(["phones", "--phones", table, "--draws", "1"]) == 0
    out = capsys.readouterr().out
    tables = json.loads((tmp_path / "phones.json").read_text("utf-8"))["tables"]
    row, no_photo = tables["phones, left out (4, 1 draws): RMSE, coverage, worst device"]
    assert {OTHERS, OTHER_MAKER, CAMERAS, APART, auto(OTHERS), auto(OTHER_MAKER)} < set(row)
    assert row[OTHERS][0] < float(no_photo[OTHERS])
    assert "--foreign or CAMSSF_FOREIGN" in out


@pytest.mark.skipif(
    TABLE is None, reason="the phones' table may not be passed on: CAMSSF_PHONES names it for those who have it"
)
def test_shipped_phones_come_from_the_command(tmp_path: Path) -> None:
    words = ["--handful", "--noun", "phones", "--statistics", "--licence", LICENCE]
    papers = [word for paper in PAPERS for word in ("--paper", paper)]
    path = Path(str(TABLE))
    assert main([str(path), "-o", str(tmp_path / "again.npz"), *words, *papers]) == 0
    again, shipped = same_basis(tmp_path / "again.npz", "phones")
    assert training_set_of("phones").sha256 == (hashlib.sha256(path.read_bytes()).hexdigest(),)
    assert again.source.replace(path.name, "phones.csv") == shipped.source
