"""Every Python block and command of README and docs runs, a page's one after the other, as readers run them.

A tutorial runs in an empty folder; the other pages run where what they speak of is.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from camssf import calibrate
from camssf.exports import export
from camssf.grid import WAVELENGTHS
from camssf.photo.read.raw import read_raw
from camssf.photo.shot import Shot
from camssf.report.build import report
from camssf.spectra import camera_names, read_camera
from camssf_fleet.batch import run_batch
from camssf_fleet.manifest import Manifest
from tests.support.captures import calibrated, photos
from tests.support.pages import DOCS, ROOT, blocks, calls, text_of
from tools import tutorials
from tools.tutorials import TUTORIALS, WITH_OUTPUT

PAGES = [ROOT / "README.md", *DOCS]
PYTHON_NOT_RUN = {
    "passport": "a passport of this photo's unit: test_passport_cli.py signs one",
    "study": "frames of a monochromator: test_direct.py makes them and runs the page",
}
"""Pages whose Python is not run, and why."""
WITH_PYTHON = [
    page
    for page in PAGES
    if page not in TUTORIALS and blocks(page.read_text("utf-8"), "python") and page.stem not in PYTHON_NOT_RUN
]


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What pages speak of: photo.dng under D55 and bulb.dng with their frames, results, and measured curves."""
    folder = tmp_path_factory.mktemp("field")
    for lamp, names in (("D55", ("photo", "white", "dark")), ("A", ("bulb", "bulb-white", "bulb-dark"))):
        (made,) = photos(lamp, vignetting=0.3).shots
        for path, name in zip((made.chart, made.white, made.dark), names, strict=True):
            assert path is not None
            shutil.copy(path, folder / f"{name}.dng")
    shutil.copy(photos(vignetting=0.3).truth, folder / "truth.csv")
    found = calibrated(vignetting=0.3)
    report(found, found.previews).save(folder / "out")
    (folder / "curves.csv").write_bytes(export(found, "colour"))
    for name in ("a.dng", "b.dng"):
        shutil.copy(folder / "photo.dng", folder / name)
    for name in ("a.json", "b.json", "result.json"):
        found.save(folder / name)
    return folder


@pytest.fixture
def there(field: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("agg")
    shutil.copytree(field, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    plt.close("all")


@pytest.mark.full
@pytest.mark.parametrize("page", WITH_PYTHON, ids=lambda page: page.stem)
def test_the_python_of_a_page_runs(page: Path, there: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {"__name__": "__main__"}
    for number, block in enumerate(blocks(page.read_text("utf-8"), "python"), 1):
        exec(compile(block, f"{page.name}, block {number}", "exec"), names)
    assert "nan" not in capsys.readouterr().out.split()


# -- shell ----------------------------------------------------------------------------------------------------------

NOT_RUN = {
    "camssf batch --make-manifest photos/": "photos named by unit and lamp: test_manifest.py has some",
    "camssf batch photos/manifest.csv": "likewise",
    "camssf registry report phones/": "of that batch: test_fleet_page.py writes the page",
    "camssf calibrate first.dng": "a unit's two photos: test_previous.py makes them and runs both commands",
    "camssf calibrate later.dng": "likewise",
    "camssf calibrate on.dng": "a torch, on and off: test_previous.py solves the means of such photos",
    "camssf picture out/result.json on.dng": "likewise: test_picture.py makes such photos",
    "camssf app": "it serves until Ctrl-C: test_app.py runs it",
    "camssf direct rgb.dng": "frames of a spectrograph: test_direct.py makes them and runs the command",
    "camssf calibrate photo.dng --lamp daylight --corners": "corners of another photo: test_cli.py has its own",
    "camssf calibrate day.dng --lamp daylight --basis mine.npz": "a basis of one's own: test_basis.py has one",
    "camssf calibrate chart.dng -o out/": "a phone's photo: test_any_light.py, test_gains.py",
    "camssf report out/result.json -o signed/": "a passport of this very result: test_cli.py signs one",
    "camssf passport issue phones/": "a fleet's registry: test_passport_cli.py issues from one",
    "camssf passport revoke passports/": "a passport that `issue` made, likewise",
    "camssf batch s3://": "an object store: test_stores.py starts one",
    "camssf registry list s3://": "likewise",
}
"""Lines that begin so are parsed (test_docs.py), not run, and why."""


def camssf_lines(page: Path) -> list[str]:
    return [line for block in blocks(page.read_text("utf-8"), "sh") for line in block.splitlines() if calls(line)]


def runs(line: str) -> bool:
    return "venv" not in line and not any(line.startswith(beginning) for beginning in NOT_RUN)


RUN_ELSEWHERE = {
    "accuracy": "test_docs.py runs its commands and compares their numbers",
    "index": "its one command is README.md's first",
    "study": "test_direct.py runs its commands between what its instruments give",
}
"""Pages whose commands are not run here, and why."""
WITH_COMMANDS = [
    page
    for page in PAGES
    if page not in WITH_OUTPUT and page.stem not in RUN_ELSEWHERE and any(map(runs, camssf_lines(page)))
]


@pytest.fixture(scope="module")
def workshop(field: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The field, and whatever else the pages' commands name; `camssf` is this package."""
    folder = tmp_path_factory.mktemp("workshop")
    shutil.copytree(field, folder, dirs_exist_ok=True)
    for old, new in (("photo", "day"), ("white", "white-day"), ("bulb-white", "white-bulb")):
        shutil.copy(folder / f"{old}.dng", folder / f"{new}.dng")
    calibrate(Shot(folder / "photo.dng", "D55", white=folder / "white.dng")).save(folder / "phone.json")
    (folder / "manifest.csv").write_text("name,photo,lamp,white,dark\nday,photo.dng,D55,white.dng,dark.dng\n")
    nm = np.arange(400.0, 701.0, 10.0)
    curves = read_camera(next(name for name in camera_names() if name.startswith("Canon EOS 5D"))).values.T
    rows = np.column_stack([nm, *(np.interp(nm, WAVELENGTHS, each) for each in curves), nm**0])
    np.savetxt(folder / "sweep.csv", rows, delimiter=",", header="wavelength_nm,red,green,blue,power", comments="")
    shim = folder / "bin" / "camssf"
    shim.parent.mkdir()
    shim.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m camssf "$@"\n')
    shim.chmod(0o755)
    return folder


NUMBER = re.compile(r"\d[\d,]*\.?\d*")


def same(shown: str, printed: str) -> bool:
    """Word for word; numbers within 2 %, or one of the last digit shown: another processor sums in another order."""
    if NUMBER.sub("#", shown) != NUMBER.sub("#", printed):
        return False
    for one, other in zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True):
        value, now = (float(each.replace(",", "")) for each in (one, other))
        last = 10.0 ** -len(one.partition(".")[2])
        if abs(value - now) > 1.001 * max(last, 0.02 * value):
            return False
    return True


@pytest.mark.full
@pytest.mark.skipif(os.name == "nt", reason="the pages' commands are for a POSIX shell")
@pytest.mark.parametrize("page", WITH_OUTPUT, ids=lambda page: page.stem)
def test_a_tutorial_prints_in_an_empty_folder_what_it_shows(page: Path, tmp_path: Path) -> None:
    text = page.read_text("utf-8")
    shown = [output for _, _, output in tutorials.blocks(text)]
    assert len(shown) >= 3
    printed = tutorials.outputs(text, tmp_path)
    for (kind, code, output), found in zip(tutorials.blocks(text), printed, strict=True):
        if kind == "python" or output is not None:
            assert same(output or "", found), f"run python -m tools.tutorials {page.stem}\n{code}\n{found}"
    assert "nan" not in " ".join(printed).split()
    if page.stem == "first-phone":  # a stranger's ten minutes end well
        assert (tmp_path / "curves.png").stat().st_size > 10_000
        assert "verdict: accepted" in printed[1]


@pytest.mark.full
@pytest.mark.skipif(os.name == "nt", reason="the pages' commands are for a POSIX shell")
@pytest.mark.parametrize("page", WITH_COMMANDS, ids=lambda page: page.stem)
def test_the_commands_of_a_page_run(
    page: Path, workshop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In their order, in one folder, each line with its pipes; the last command's status is the line's."""
    shutil.copytree(workshop, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("MPLBACKEND", "agg")
    for line in filter(runs, camssf_lines(page)):
        done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, f"{line}\n{done.stderr}"
        assert "Traceback" not in done.stderr


@pytest.mark.repository
def test_what_is_not_run_is_written_somewhere() -> None:
    lines = [line for page in PAGES for line in camssf_lines(page)]
    for beginning in NOT_RUN:
        assert any(line.startswith(beginning) for line in lines), beginning


# -- data -----------------------------------------------------------------------------------------------------------


def test_the_sidecar_of_raw_md_is_one(tmp_path: Path) -> None:
    (block,) = blocks(text_of("docs/raw.md"), "json")
    cv2.imwrite(str(tmp_path / "photo.png"), np.full((40, 60), 9000, np.uint16))
    (tmp_path / "photo.png.json").write_text(block)
    found = read_raw(tmp_path / "photo.png")
    assert (found.cfa, found.white, found.make, found.exposure) == ("RGGB", 16383, "Acme", 0.0125)


def test_the_manifest_of_fleet_md_is_one(tmp_path: Path) -> None:
    """Its photos are not here; its columns and rows are read."""
    (block,) = blocks(text_of("docs/fleet.md"), "csv")
    (tmp_path / "manifest.csv").write_text(block + "\n")
    outcomes = run_batch(Manifest(tmp_path / "manifest.csv", basis="cameras"), tmp_path / "out", workers=1).outcomes
    assert [outcome.name for outcome in outcomes] == ["Canon 550D", "Nikon D5100"]
    assert all("chart.dng" in outcome.reason or "led.csv" in outcome.reason for outcome in outcomes)
