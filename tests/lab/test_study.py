"""docs/study.md from the protocol to the page of results, on the files that simulated instruments write."""

import json
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.cli import main
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import read_basis
from camssf.result import Result
from camssf.spectra import read_camera, read_lamp
from camssf_lab.simulation.camera import Sensor
from tests.repository.test_docs import ROOT, blocks
from tests.support.spectrograph import write_dng

STUDY = (ROOT / "docs" / "study.md").read_text("utf-8")
SENSOR = Sensor(black=256, white_level=15000)


def lines(wanted: str) -> list[list[str]]:
    """The page's camssf commands that hold these words, without `camssf`."""
    every = [line for block in blocks(STUDY, "sh") for line in block.splitlines()]
    return [shlex.split(line)[1:] for line in every if wanted in line]


def photograph_sweep(curves: Floats) -> None:
    """A monochromator's frames of 5 nm steps, their dark frame and the meter's readings, as the page names them."""
    folder, rng = Path("sweep"), np.random.default_rng(3)
    folder.mkdir()
    nm = np.arange(400.0, 701.0, 5.0)
    power = 1e-6 * (1.0 + 0.5 * np.sin(nm / 60.0))
    np.savetxt(folder / "power.csv", np.column_stack([nm, power]), delimiter=",", header="wavelength_nm,power")
    stray = 40.0  # DN in every frame, the dark one too

    def shoot(name: str, signals: Any) -> None:
        mosaic = np.empty((240, 320))
        for (i, j), channel in {(0, 0): 0, (0, 1): 1, (1, 0): 1, (1, 1): 2}.items():
            mosaic[i::2, j::2] = signals[channel]
        mosaic = mosaic + SENSOR.black + stray + 6.0 * rng.normal(size=mosaic.shape)
        write_dng(folder / name, np.rint(mosaic).astype(np.uint16), SENSOR, read_camera("Demo phone"))

    shoot("dark.dng", np.zeros(3))
    for wavelength, watts in zip(nm, power, strict=True):
        seen = [np.interp(wavelength, WAVELENGTHS, curve) for curve in curves.T]
        shoot(f"{wavelength:.0f}.dng", 8e9 * watts * np.array(seen))


@pytest.mark.full
def test_the_study_leads_to_the_page_of_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    def run(wanted: str, count: int) -> None:
        commands = lines(wanted)
        assert len(commands) == count, wanted
        for words in commands:
            assert main(words) == 0, words

    run("simulate", 2)
    camera = read_camera("day/truth.csv").values
    photograph_sweep(camera)
    exec(compile("\n".join(blocks(STUDY, "python")), "study.md", "exec"), {})
    run("direct sweep.csv", 1)
    measured = read_camera("truth/ssf.csv").values
    visible = (WAVELENGTHS >= 400.0) & (WAVELENGTHS <= 700.0)
    swept, true = (curves[visible][::10] for curves in (measured, camera))  # between them it is interpolated
    assert np.abs(swept / swept.max(axis=0) - true / true.max(axis=0)).max() < 2e-3

    run("-o two/", 1)
    run("-o one/", 1)
    mean = read_basis("phones").mean.T
    without = np.sqrt(np.mean((mean / mean.max(axis=0) - camera)[visible] ** 2, axis=0))
    for folder in ("two", "one"):
        result = Result.load(f"{folder}/result.json")
        assert result.verdict.status == "accepted"
        assert result.scores.rmse.mean() < 0.9 * without.mean()
        assert result.coverage.min() > 0.8
        assert "no photo: mean of basis phones" in Path(folder, "report.html").read_text("utf-8")

    lamp = np.column_stack([WAVELENGTHS, read_lamp("D55").values])
    np.savetxt("lamp.csv", lamp, delimiter=",", header="nm,power", comments="")
    run("--lamp lamp.csv", 1)
    run("-o unnamed/", 1)
    stated = json.loads(Path("unnamed/result.json").read_text("utf-8"))["truth"]
    assert np.allclose(stated["curves"]["green"], Result.load("lamp/result.json").curves[:, 1], atol=1e-5)
