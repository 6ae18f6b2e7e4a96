"""The basis `phones`: what ships, where it came from, and the benchmark that judges it.

The phones' table may not be passed on. Who has it sets CAMSSF_PHONES to its path; what needs it skips elsewhere.
"""

import hashlib
import json
import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks import shared as _common
from benchmarks.__main__ import main as benchmark
from benchmarks.claims import phones
from benchmarks.claims.accuracy import Setting
from benchmarks.claims.phones import APART, JUDGED, Runs, auto
from benchmarks.devices import CAMERAS, OTHER_MAKER, OTHERS, PHONES, Device, phones_left_out
from camssf.grid import Floats
from camssf.recovery.basis import NODES, read_basis
from camssf_lab.learning.basis import learn, main
from camssf_lab.learning.training import HANDFUL, Enlargement, Statistics, maker_of, read_curves, training_set_of
from tests.recovery.test_basis import write_curves
from tests.support.problems import toy_camera

PAPERS = ("Tominaga, Nishi, Ohtera, Sensors 2021, 21, 4985", "Burggraaff et al., Opt. Express 2019, 27, 19075")
LICENCE = "none stated, so the table is in no file of camssf"
TABLE = os.environ.get("CAMSSF_PHONES")
needs_the_table = pytest.mark.skipif(
    TABLE is None, reason="the phones' table may not be passed on: CAMSSF_PHONES names it for those who have it"
)


def toys() -> dict[str, Floats]:
    """Four phones of two makers, which differ by their wavelengths."""
    names = ("Apfel 1", "Apfel 2", "Sonne 1", "Sonne 2")
    found = {name: toy_camera(shift)[::10] for name, shift in zip(names, (-4.0, -1.0, 2.0, 4.0), strict=True)}
    return {name: curves / curves.max(axis=0) for name, curves in found.items()}


def spread(dictionary: Floats) -> Floats:
    return np.einsum("cmr,cnr->cmn", dictionary, dictionary)


@pytest.mark.requirement("R-PHONES")
def test_the_shipped_basis_is_the_one_that_was_judged() -> None:
    """Its hash on the nodes; it names both papers."""
    basis, notice = read_basis("phones"), (Path(__file__).parents[2] / "NOTICE").read_text("utf-8")
    assert basis.sha256() == "b885e56fc003bcffb390d0df96588632855f835e61b26b747215852f9d5153f8"
    assert all(paper in basis.source for paper in PAPERS)
    assert all(
        word in notice for word in ("phones.npz", "Tominaga", "2021, 21, 4985", "Burggraaff", "2019, 27, 19075")
    )


def test_no_phone_can_be_read_out_of_it() -> None:
    """Nothing in the file is a curve of one phone: the mean is no phone's, and no array has one row for each."""
    with np.load(str(phones_file()), allow_pickle=False) as content:
        shapes = {name: content[name].shape for name in content.files}
    assert shapes.pop("known") == (6,)
    assert shapes.pop("curves") == (0, 69, 3)
    assert not any(6 in shape for shape in shapes.values())


def phones_file() -> Path:
    import camssf

    return Path(camssf.__file__).parent / "data" / "phones.npz"


def test_extended_by_nothing_it_is_itself(tmp_path: Path) -> None:
    (tmp_path / "none.csv").write_text("camera,wavelength_nm,R,G,B\n")
    assert main([str(tmp_path / "none.csv"), "--extend", "phones", "-o", str(tmp_path / "same.npz")]) == 0
    same, shipped = read_basis(str(tmp_path / "same.npz")), read_basis("phones")
    assert same.mean == pytest.approx(shipped.mean, abs=1e-12)
    assert spread(same.dictionary[:, ::40]) == pytest.approx(spread(shipped.dictionary[:, ::40]), abs=1e-9)
    assert "from 6 measured phones (" in same.source


def test_a_phone_of_one_s_own_moves_it_and_can_be_added_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = write_curves(tmp_path / "mine.csv", {"Sonne 1": toys()["Sonne 1"]})
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
    known = write_curves(tmp_path / "known.csv", {"apple iphone x": toys()["Apfel 1"]})
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
    curves = toys() | {"Tal 1": toys()["Apfel 1"] ** 1.2, "Tal 2": toys()["Sonne 2"] ** 0.9}
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
    nodes = toys()
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
    monkeypatch.setattr(phones, "measured_cameras", lambda: phones_left_out(toys())[:0] or stand_in())
    table = str(write_curves(tmp_path / "toys.csv", toys()))
    monkeypatch.delenv("CAMSSF_FOREIGN", raising=False)
    assert benchmark(["phones", "--phones", table, "--draws", "1"]) == 0
    out = capsys.readouterr().out
    tables = json.loads((tmp_path / "phones.json").read_text("utf-8"))["tables"]
    row, no_photo = tables["phones, left out (4, 1 draws): RMSE, coverage, worst device"]
    assert {OTHERS, OTHER_MAKER, CAMERAS, APART, auto(OTHERS), auto(OTHER_MAKER)} < set(row)
    assert row[OTHERS][0] < float(no_photo[OTHERS])
    assert "--foreign or CAMSSF_FOREIGN" in out


def stand_in() -> list[Device]:
    """One toy in the place of the 52 cameras."""
    device = phones_left_out(toys())[0]
    bases = {CAMERAS: device.bases[CAMERAS], PHONES: read_basis("phones")}
    return [Device(device.name, device.curves, bases)]


@needs_the_table
def test_shipped_phones_come_from_the_command(tmp_path: Path) -> None:
    words = ["--handful", "--noun", "phones", "--statistics", "--licence", LICENCE]
    papers = [word for paper in PAPERS for word in ("--paper", paper)]
    path = Path(str(TABLE))
    assert main([str(path), "-o", str(tmp_path / "again.npz"), *words, *papers]) == 0
    again, shipped = read_basis(str(tmp_path / "again.npz")), read_basis("phones")
    assert training_set_of("phones").sha256 == (hashlib.sha256(path.read_bytes()).hexdigest(),)
    assert again.source.replace(path.name, "phones.csv") == shipped.source
    assert again.mean == pytest.approx(shipped.mean, abs=1e-12)
    assert spread(again.dictionary[:, ::40]) == pytest.approx(spread(shipped.dictionary[:, ::40]), abs=1e-9)


@cache
def judged() -> dict[str, dict[str, Runs]]:
    """Each phone left out, two draws."""
    devices = phones_left_out(read_curves(Path(str(TABLE))))
    return {setting.name: phones.measure(devices, setting, 2) for setting in JUDGED}


@pytest.mark.full
@needs_the_table
def test_phones_are_better_served_by_other_phones() -> None:
    """The bars of docs/accuracy.md with two draws instead of eight: 1 % more to each side of coverage."""
    for setting, bases in judged().items():
        (rmse, coverage, worst), theirs = bases[OTHERS].row, bases[CAMERAS].row[0]
        assert rmse < 0.8 * theirs, setting
        assert 0.94 <= coverage <= 0.995, setting
        assert worst >= 0.88, setting
        assert bases[OTHER_MAKER].row[0] < 0.9 * theirs, setting


@pytest.mark.full
@needs_the_table
def test_the_evidence_chooses_phones_for_phones() -> None:
    """Whatever the setting and draw, `cameras` is never clearly ahead; seen under two lamps, phones are."""
    nats = phones.odds(judged(), OTHERS)
    assert min(own.min() for own in nats.values()) > -1.0
    assert np.median(np.concatenate(list(nats.values()))) > phones.CLEAR
    assert nats["Ohta, D55 + A"].min() > phones.CLEAR
