"""Direct measurement: simulated spectrograph frames against their truth, sweeps by hand, refusals; docs/study.md."""

import json
import shlex
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray

from camssf.cli import main
from camssf.errors import FramesDiffer, InvalidArgument, LampUnfit, Overexposed, Underexposed, UnreadableRaw
from camssf.fit.scores import rmse
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import read_basis
from camssf.result import Result
from camssf.spectra import CameraCurves, read_camera, read_lamp
from camssf_lab.direct import Direct, divide, extract, sweep
from camssf_lab.direct.dispersion import FEWEST, LINES, disperse
from camssf_lab.simulation.camera import Sensor
from tests.repository.test_docs import ROOT, blocks
from tests.support import spectrograph
from tests.support.scenes import filters
from tests.support.spectrograph import FINE, MONO, RGB, Spectrograph, shoot, write_dng


@cache
def nikon() -> CameraCurves:
    return read_camera("Nikon 5100 (NPL)")


@pytest.fixture(scope="session")
def frames(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The default scene; nobody writes to it."""
    return shoot(nikon(), tmp_path_factory.mktemp("frames"), 1)


def wavelength_error(found: Direct, role: str, device: Spectrograph) -> float:
    """Largest, nm, where the truth lies between 400 and 700 nm."""
    x = np.arange(device.size[0], dtype=float)
    nm = device.wavelength(x)
    return float(np.abs(found.dispersions[role].wavelength(x) - nm)[(nm >= 400) & (nm <= 700)].max())


@pytest.mark.full
@pytest.mark.parametrize("mirrored", [True, False])
def test_the_bars_hold_on_simulated_frames(frames: dict[str, Path], tmp_path: Path, mirrored: bool) -> None:
    """RMSE ≤ 0.01 and wavelengths within 0.5 nm; noise, two detectors, leaning lines, red left or right."""
    device = replace(RGB, mirrored=mirrored)
    paths = shoot(nikon(), tmp_path, 1, device) if mirrored else frames
    roles = {"dark": "rgb-dark.dng", "mono_dark": "mono-dark.tif", "response": "mono-response.csv"}
    found = divide(paths["rgb.dng"], paths["mono.tif"], **{role: paths[name] for role, name in roles.items()})
    assert (rmse(found.values, nikon().values) <= 0.01).all()
    assert wavelength_error(found, "rgb", device) <= 0.5
    assert wavelength_error(found, "mono", MONO) <= 0.5
    assert found.tilts["rgb"] == pytest.approx(0.7, abs=0.15)
    assert found.tilts["mono"] == pytest.approx(-0.4, abs=0.15)
    assert all(len(d.lines) >= FEWEST and d.residual <= 0.3 for d in found.dispersions.values())
    gain = found.values.max(axis=0) / nikon().values.max(axis=0)
    assert gain / gain[1] == pytest.approx(np.ones(3), abs=0.02)
    # Noise alone: beside the lines the two wavelength scales do not agree exactly.
    assert np.median((found.std / found.values.max(axis=0))[40:641]) < 0.005


def test_extraction_by_hand() -> None:
    """Rows of unequal brightness and a cell of three constants: each channel's mean is its constant."""
    cell = np.array([[1, 0], [2, 1]])
    rows = np.concatenate([np.zeros(10), [0.9, 0.9], np.ones(10), [0.8, 0.8], np.zeros(10)])
    bumps = 1.0 - 0.3 * np.exp(-0.5 * ((np.arange(400) - 150.0) / 5.0) ** 2)
    constant = np.array([100.0, 300.0, 50.0])
    picture = constant[np.tile(cell, (17, 200))] * rows[:, None] * bumps
    found = extract(picture, cell, "frame", "none")
    assert found.tilt == pytest.approx(0.0, abs=0.02)
    # A row is weighed by its own brightness: Σ s / Σ p with p of mean 1 over the lit rows.
    lit = rows[rows > 0]
    scale = lit.mean()
    for channel in range(3):
        away = np.abs(found.pixel[channel] - 150.0) > 40.0
        assert found.signal[channel][away] == pytest.approx(constant[channel] * scale, rel=1e-6)
    assert [len(x) for x in found.pixel] == [200, 200, 200]


def test_the_lines_are_fraunhofer_s() -> None:
    """Against tabulated single lines (nm in air)."""
    table = {"K": 393.366, "H": 396.847, "Hδ": 410.174, "F": 486.134, "C": 656.281}
    ours = {name: nm for name, nm, _, _ in LINES}
    assert all(ours[name] == nm for name, nm in table.items())
    assert ours["D"] == pytest.approx((588.995 + 589.592) / 2, abs=0.1)
    assert [nm for _, nm, _, _ in LINES] == sorted(nm for _, nm, _, _ in LINES)


def test_light_without_lines_is_refused() -> None:
    """A bulb, and noise, which has fine structure but not the sun's."""
    x = np.arange(1400, dtype=float)
    bulb = np.exp(-0.5 * ((x - 900.0) / 300.0) ** 2)[:, None]
    noise = np.random.default_rng(0).normal(size=(1400, 1))
    for signal in (bulb + 1e-4 * np.abs(noise), bulb * np.exp(0.05 * noise)):
        with pytest.raises(LampUnfit, match="Fraunhofer") as caught:
            disperse(x, signal, "bulb.tif")
        assert "bulb.tif" in caught.value.message
        assert caught.value.threshold == FEWEST


@pytest.fixture
def files(frames: dict[str, Path], tmp_path: Path) -> dict[str, Path | None]:
    """Frames that are none, and others with one fault each, by their names."""

    def picture(name: str, samples: NDArray[Any], **more: Any) -> None:
        tifffile.imwrite(tmp_path / name, np.asarray(samples, dtype=np.uint16), **more)

    mono, rng = tifffile.imread(frames["mono.tif"]), np.random.default_rng(0)
    picture("clipped.tif", np.minimum(mono, 4095))
    picture("colour.tif", np.zeros((20, 30, 3)), photometric="rgb")
    picture("noise.tif", rng.integers(0, 16000, (200, 800)))
    write_dng(tmp_path / "small.dng", np.full((100, 200), 512, dtype=np.uint16), Sensor(), nikon())
    (tmp_path / "broken.tif").write_bytes(b"II*\0" + b"\0" * 40)
    x = np.arange(1500, dtype=float)
    lines = np.interp(375.0 + 0.2 * x, FINE, spectrograph.gaussian_filter1d(spectrograph.sunlight(), 17.0))
    rows = zip(x, lines, strict=True)
    for name, text in (
        ("row.csv", "pixel,signal\n1,2\n"),
        ("blind.csv", "wavelength_nm,response\n380,0\n720,1\n"),
        ("no-red.csv", "pixel,signal\n" + "\n".join(f"{pixel:g},{light:.9g}" for pixel, light in rows)),
    ):
        (tmp_path / name).write_text(text)
    names = [*(path.name for path in tmp_path.iterdir()), "none.tif"]
    return {"-": None} | frames | {name: tmp_path / name for name in names}


REFUSED: list[tuple[str, type[Exception], str]] = [
    ("rgb-dark.dng mono.tif", Underexposed, "no rows exceed"),
    ("rgb.dng clipped.tif", Overexposed, r"clipped\.tif is clipped"),  # whatever its bits
    ("rgb.dng mono.tif dark=rgb.dng", FramesDiffer, "not darker"),
    ("rgb.dng mono.tif dark=small.dng", FramesDiffer, "200 × 100"),
    ("rgb.dng none.tif", UnreadableRaw, "no file"),
    ("mono.tif mono.tif", InvalidArgument, "cannot be the colour frame"),
    ("rgb.dng colour.tif", UnreadableRaw, "one grey page"),
    ("rgb.dng broken.tif", UnreadableRaw, "broken"),
    ("rgb.dng row.csv", InvalidArgument, "1 rows"),
    ("rgb.dng mono.tif response=blind.csv", InvalidArgument, "0 or less, at 380 nm"),
    ("rgb.dng row.csv mono_dark=mono.tif", InvalidArgument, "a dark frame cannot be subtracted"),
    ("rgb.dng no-red.csv", FramesDiffer, r"share only 3\d\d to 6\d\d nm"),  # lines enough, but it ends at 640 nm
    ("rgb.dng noise.tif", Underexposed, r"noise\.tif"),
]


@pytest.mark.parametrize(("call", "kind", "words"), REFUSED)
def test_frames_that_do_not_serve_are_refused(
    call: str, kind: type[Exception], words: str, files: dict[str, Path | None]
) -> None:
    rgb, mono, *more = call.split()
    options = {role: files[name] for role, _, name in (word.partition("=") for word in more)}
    with pytest.raises(kind, match=words):
        divide(files[rgb], files[mono], **options)  # type: ignore[arg-type]


NM_5 = np.arange(380.0, 725.0, 5.0)
NM_10 = np.arange(400.0, 705.0, 10.0)
HEAD = "wavelength_nm,red,green,blue,power"


def curves_at(nm: Floats) -> Floats:
    """(w, 3) the Nikon's."""
    return np.stack([np.interp(nm, WAVELENGTHS, curve) for curve in nikon().values.T], axis=1)


def sweep_text(nm: Floats = NM_5, power: Floats | float = 1.0) -> str:
    """The Nikon's curves times a power."""
    power = np.broadcast_to(power, nm.shape)
    rows = np.column_stack([nm, curves_at(nm) * power[:, None], power])
    return "\n".join(["# a comment", HEAD, *(",".join(f"{value:.9g}" for value in row) for row in rows)])


def write_sweep(folder: Path, text: str | None = None) -> Path:
    path = folder / "sweep.csv"
    path.write_text(text or sweep_text())
    return path


def test_a_sweep_is_divided_by_its_power_exactly(tmp_path: Path) -> None:
    """At the sweep's own wavelengths the curve is signal over power; between them straight."""
    found = sweep(write_sweep(tmp_path, sweep_text(NM_5, 1.0 + np.sin(NM_5 / 20.0) ** 2)))
    expected = curves_at(NM_5)
    assert found.values[::10] == pytest.approx(expected, rel=1e-7, abs=1e-9)
    assert found.values[5::10] == pytest.approx((expected[1:] + expected[:-1]) / 2, rel=1e-7, abs=1e-9)
    assert found.std is None
    assert found.covered == (380.0, 720.0)
    assert not any(code == "covered" for code, _ in found.assumptions)


def test_a_short_sweep_says_where_it_ends(tmp_path: Path) -> None:
    found = sweep(write_sweep(tmp_path, sweep_text(NM_10)))
    assert not found.values[(WAVELENGTHS < 400) | (WAVELENGTHS > 700)].any()
    assert ("covered", "only 400.0 to 700.0 nm were measured; beyond, the curves are set to 0.") in found.assumptions


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [
        (sweep_text(np.arange(420.0, 720.0, 10.0)), InvalidArgument, "covers 420 to 710"),
        (sweep_text(np.arange(400.0, 725.0, 25.0)), InvalidArgument, "steps of up to 25"),
        (sweep_text(NM_10, 0.0), Underexposed, "without reference power, at 400 nm"),
        (sweep_text(np.array([400.0, *NM_10])), InvalidArgument, "does not increase"),
        (sweep_text(NM_10, np.nan), InvalidArgument, "not finite"),
        (sweep_text(NM_10, -1.0), Underexposed, "without reference power"),
        ("\n".join([HEAD, *(f"{nm},1e308,1,1,1e-308" for nm in NM_5)]), InvalidArgument, "too large for their power"),
        (HEAD.replace(",power", "\n400,1,1,1"), InvalidArgument, f"first line must read {HEAD}"),
    ],
)
def test_a_sweep_that_is_none(text: str, kind: type[Exception], words: str, tmp_path: Path) -> None:
    with pytest.raises(kind, match=words):
        sweep(write_sweep(tmp_path, text))


def test_the_files_are_read_by_the_rest_of_camssf(tmp_path: Path) -> None:
    found, out = sweep(write_sweep(tmp_path)), tmp_path / "out"
    assert found.save(out) == sorted(out.iterdir()) == [out / "direct.json", out / "ssf.csv"]
    again = read_camera(str(out / "ssf.csv"))
    assert rmse(again.values, found.values) == pytest.approx(np.zeros(3), abs=1e-6)
    document = json.loads((out / "direct.json").read_text())
    assert document["format"] == "camssf-direct/1"
    assert max(document["ssf"]["green"]) == 1.0
    assert document["ssf"]["wavelength_nm"] == WAVELENGTHS.tolist()
    assert document["channel_gain"][1] == 1.0
    assert document["files"]["sweep"]["name"] == "sweep.csv"


def test_what_stands_there_is_not_replaced(tmp_path: Path) -> None:
    found = sweep(write_sweep(tmp_path))
    (tmp_path / "file").write_text("a file")
    (tmp_path / "folder" / "ssf.csv").mkdir(parents=True)
    (tmp_path / "result").mkdir()
    for name in ("result.json", "ssf.csv"):
        (tmp_path / "result" / name).write_text("calibrated")

    def contents() -> dict[Path, bytes | None]:
        return {path: path.read_bytes() if path.is_file() else None for path in tmp_path.rglob("*")}

    before = contents()
    for name, words in (("file", "is a file"), ("folder", r"ssf\.csv is a folder"), ("result", "of a calibration")):
        with pytest.raises(InvalidArgument, match=words):
            found.save(tmp_path / name)
    assert contents() == before


@pytest.mark.full
def test_the_command(frames: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = "direct rgb.dng mono.tif --dark rgb-dark.dng --dark mono-dark.tif --response mono-response.csv -o"
    out = tmp_path / "out"
    assert main([*(str(frames.get(word, word)) for word in words.split()), str(out)]) == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert "rgb: " in said.err
    assert sorted(path.name for path in out.iterdir()) == ["direct.json", "ssf.csv"]
    head, first = (out / "ssf.csv").read_text().splitlines()[:2]
    assert head == "wavelength_nm,red,green,blue,red_std,green_std,blue_std"
    assert first.startswith("380.0,")
    lines = json.loads((out / "direct.json").read_text())["wavelengths"]["rgb"]["lines"]
    assert all(abs(line["fitted_nm"] - line["table_nm"]) <= 1.0 for line in lines)


def test_the_command_with_a_sweep_writes_to_stdout(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(write_sweep(tmp_path))
    assert main(["direct", path]) == 0
    assert json.loads(capsys.readouterr().out)["wavelengths"] == {}
    assert main(["direct", path, "--dark", "x.dng"]) == InvalidArgument.exit_status
    assert "Traceback" not in capsys.readouterr().err


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
        mosaic = np.asarray(signals)[filters((240, 320))]
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
