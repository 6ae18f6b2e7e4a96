"""Direct measurement: simulated spectrograph frames against their truth, sweeps by hand, and all refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import tifffile

from benchmarks.paper import spectrograph
from benchmarks.paper.spectrograph import FINE, Spectrograph, frame, shoot, silicon, write_dng
from camssf.cli import main
from camssf.errors import (
    FramesDiffer,
    InvalidArgument,
    LampUnfit,
    Overexposed,
    Underexposed,
    UnreadableRaw,
)
from camssf.fit.scores import rmse
from camssf.grid import WAVELENGTHS
from camssf.spectra import CameraCurves, read_camera, read_lamp
from camssf_lab.direct import Direct, divide, extract, sweep
from camssf_lab.direct.dispersion import FEWEST, LINES, disperse, fine_structure
from camssf_lab.simulation.camera import Sensor

NIKON = "Nikon 5100 (NPL)"
RGB, MONO = Spectrograph(), Spectrograph(pixel=0.0048, size=(1400, 200), centre=565.0, tilt=-0.4)
VISIBLE = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)


@cache
def nikon() -> CameraCurves:
    return read_camera(NIKON)


def measured(folder: Path, camera: CameraCurves | None = None, seed: int = 1, **scene: object) -> Direct:
    paths = shoot(camera or nikon(), folder, seed, **scene)  # type: ignore[arg-type]
    return divide(
        paths["rgb.dng"], paths["mono.tif"], dark=paths["rgb-dark.dng"], mono_dark=paths["mono-dark.tif"],
        response=paths["mono-response.csv"],
    )  # fmt: skip


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The default scene; nobody writes to it."""
    return shoot(nikon(), tmp_path_factory.mktemp("frames"), 1)


def wavelength_error(found: Direct, role: str, device: Spectrograph) -> float:
    """Largest, nm, where the truth lies between 400 and 700 nm."""
    x = np.arange(device.size[0], dtype=float)
    nm = device.wavelength(x)
    return float(np.abs(found.dispersions[role].wavelength(x) - nm)[(nm >= 400) & (nm <= 700)].max())


@pytest.mark.full
@pytest.mark.parametrize(("light", "mirrored"), [("AM1.5", True), ("daylight", False)])
def test_the_bars_hold_on_simulated_frames(tmp_path: Path, light: str, mirrored: bool) -> None:
    """RMSE ≤ 0.01 and wavelengths within 0.5 nm; noise, two detectors, leaning lines, red left or right."""
    device = replace(RGB, mirrored=mirrored)
    found = measured(tmp_path, light=light, device=device, mono=MONO)
    assert (rmse(found.values, nikon().values) <= 0.01).all()
    assert wavelength_error(found, "rgb", device) <= 0.5
    assert wavelength_error(found, "mono", MONO) <= 0.5
    assert found.tilts["rgb"] == pytest.approx(0.7, abs=0.15)
    assert found.tilts["mono"] == pytest.approx(-0.4, abs=0.15)
    assert all(len(d.lines) >= FEWEST and d.residual <= 0.3 for d in found.dispersions.values())
    gain = found.values.max(axis=0) / nikon().values.max(axis=0)
    assert gain / gain[1] == pytest.approx(np.ones(3), abs=0.02)
    assert found.std is not None
    # Noise alone: beside the lines the two wavelength scales do not agree exactly.
    assert np.median((found.std / found.values.max(axis=0))[VISIBLE]) < 0.005


@pytest.mark.full
@pytest.mark.parametrize("tilt", [-3.0, 3.0])
def test_a_lean_is_found_and_costs_nothing(tilt: float) -> None:
    curves = np.stack([np.interp(FINE, WAVELENGTHS, c, 0.0, 0.0) for c in nikon().values.T], axis=1)
    device = replace(RGB, tilt=tilt)
    cell = np.array([[0, 1], [1, 2]])
    light, dark = frame(curves, device, np.random.default_rng(0), sensor=Sensor(full_well=15000.0), colours=cell)
    spectrum = extract(light - dark.mean(), cell, "frame", "dark")
    assert spectrum.tilt == pytest.approx(tilt, abs=0.12)
    pixel = max(spectrum.pixel, key=len)
    columns = [np.interp(pixel, x, y) for x, y in zip(spectrum.pixel, spectrum.signal, strict=True)]
    found = disperse(pixel, np.stack(columns, axis=1))
    nm = device.wavelength(pixel)
    assert np.abs(found.wavelength(pixel) - nm)[(nm > 400) & (nm < 700)].max() < 0.4


@pytest.mark.full
def test_a_flat_mono_camera_shows_why_its_response_matters(frames: dict[str, Path]) -> None:
    paths = frames
    flat = divide(paths["rgb.dng"], paths["mono.tif"], dark=paths["rgb-dark.dng"], mono_dark=paths["mono-dark.tif"])
    inverse = flat.values * silicon(WAVELENGTHS)[:, None]
    assert (rmse(inverse, nikon().values) <= 0.01).all()
    assert rmse(flat.values, nikon().values).max() > 0.02
    assert any("taken for flat" in message for _, message in flat.assumptions)


@pytest.mark.full
def test_without_dark_frames_the_file_s_black_serves(frames: dict[str, Path]) -> None:
    paths = frames
    found = divide(paths["rgb.dng"], paths["mono.tif"], response=paths["mono-response.csv"])
    assert (rmse(found.values, nikon().values) <= 0.01).all()
    (black,) = (message for code, message in found.assumptions if code == "black")
    assert "the file's black level" in black
    assert "darkest tenth of the rows" in black


@pytest.mark.full
def test_the_division_cancels_pixels_of_another_size(tmp_path: Path) -> None:
    """Noise-free tables: I = L S |dλ/dx| on two bent scales gives S back; without dλ/dx red to blue were 3 % off."""
    paths = {}
    for name, curves, bend in (("rgb", nikon().values, 9.0), ("mono", silicon(WAVELENGTHS)[:, None], -9.0)):
        x = np.arange(1800, dtype=float)
        t = (x - 900.0) / 900.0
        nm, spread = 550.0 + 200.0 * t + bend / 4.0 * t**2, 200.0 + bend / 2.0 * t
        light = np.interp(nm, FINE, spectrograph.gaussian_filter1d(spectrograph.sunlight("daylight"), 16.0))
        columns = [np.interp(nm, WAVELENGTHS, c, 0.0, 0.0) * light * spread for c in curves.T]
        head = "pixel," + ("red,green,blue" if name == "rgb" else "signal")
        rows = [",".join(f"{v:.9g}" for v in row) for row in np.stack([x, *columns], axis=1)]
        paths[name] = tmp_path / f"{name}.csv"
        paths[name].write_text("\n".join([head, *rows]))
    response = tmp_path / "response.csv"
    response.write_text("wavelength_nm,response\n" + "\n".join(f"{w},{silicon(w):.9f}" for w in WAVELENGTHS))
    found = divide(paths["rgb"], paths["mono"], response=response)
    assert (rmse(found.values, nikon().values) <= 0.005).all()
    gain = found.values.max(axis=0) / nikon().values.max(axis=0)
    assert gain[0] / gain[2] == pytest.approx(1.0, abs=0.01)
    assert found.tilts == {"rgb": 0.0, "mono": 0.0}
    assert found.std is None


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


@pytest.mark.parametrize("lean", [-1e-16, 0.0, 1e-16, 1e-9])
@pytest.mark.parametrize("mono", [False, True])
def test_a_lean_of_one_rounding_moves_no_sample_to_another_bin(
    monkeypatch: pytest.MonkeyPatch, lean: float, mono: bool
) -> None:
    """Samples lie half a column from the edges of bins: the last bit of the lean, a processor's own, is nothing."""
    monkeypatch.setattr("camssf_lab.direct.extraction._lean", lambda *_: lean)
    cell = np.zeros((2, 2), int) if mono else np.array([[1, 0], [2, 1]])
    picture = np.tile(np.linspace(50.0, 100.0, 400), (34, 1)) * np.where(np.arange(34) < 5, 0.0, 1.0)[:, None]
    found = extract(picture, cell, "frame", "none")
    assert [len(x) for x in found.pixel] == ([400] if mono else [200] * 3)


def test_fine_structure_forgets_what_is_smooth_and_keeps_a_line() -> None:
    x = np.linspace(-1.0, 1.0, 1400)
    smooth = np.exp(x - 2.0 * x**2 + x**3)
    line = 1.0 - 0.1 * np.exp(-0.5 * ((x - 0.2) / 0.005) ** 2)
    assert np.abs(fine_structure(smooth[:, None])).max() < 1e-3
    both = fine_structure((smooth * line)[:, None])
    assert x[np.argmin(both)] == pytest.approx(0.2, abs=0.002)
    assert -0.11 < both.min() < -0.05


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


@pytest.mark.full
@pytest.mark.parametrize("name", ["FL2", "FL11", "HP1", "LED-RGB1"])
def test_lamps_with_lines_of_their_own_are_no_sun(name: str) -> None:
    """FL3.7, FL3.9 and HP4 are, of all CIE lamps, those whose lines come nearest to the sun's by chance."""
    x = np.arange(1600, dtype=float)
    power = np.interp(FINE, WAVELENGTHS, read_lamp(name).values) * silicon(FINE)
    light = np.interp(RGB.wavelength(x), FINE, spectrograph.gaussian_filter1d(power, 17.0))
    noise = np.random.default_rng(0).normal(size=x.size) * np.sqrt(light / light.max() / 3e5 + 1e-8)
    with pytest.raises(LampUnfit):
        disperse(x, (light / light.max() + noise)[:, None])


def test_too_few_lines_say_how_many() -> None:
    """The sun through a filter that leaves 560 to 640 nm: one line."""
    device = replace(RGB, size=(1600, 8))
    x = np.arange(1600, dtype=float)
    nm = device.wavelength(x)
    light = np.interp(nm, FINE, spectrograph.gaussian_filter1d(spectrograph.sunlight("AM1.5"), 17.0))
    with pytest.raises(LampUnfit, match="cannot be calibrated in wavelength"):
        disperse(x, (light * np.exp(-0.5 * ((nm - 600.0) / 18.0) ** 2))[:, None])


def test_a_clipped_frame_is_refused(tmp_path: Path) -> None:
    paths = shoot(nikon(), tmp_path, 1, exposure=1.6)
    with pytest.raises(Overexposed, match="clipped") as caught:
        divide(paths["rgb.dng"], paths["mono.tif"])
    assert caught.value.value is not None
    assert caught.value.value > 0.01


def test_a_clipped_mono_frame_is_refused_whatever_its_bits(frames: dict[str, Path], tmp_path: Path) -> None:
    paths = frames
    samples = tifffile.imread(paths["mono.tif"])
    clipped = tmp_path / "mono.tif"
    tifffile.imwrite(clipped, np.minimum(samples, 4095).astype(np.uint16))
    with pytest.raises(Overexposed, match=r"mono\.tif is clipped"):
        divide(paths["rgb.dng"], clipped)


@pytest.mark.full
def test_eight_bits_are_few_levels_but_no_heap(frames: dict[str, Path], tmp_path: Path) -> None:
    """Many samples share the largest of few levels without being clipped; at 255 they are."""
    paths = frames
    samples = tifffile.imread(paths["mono.tif"]).astype(float) - 512.0
    table = tmp_path / "mono.tif"
    tifffile.imwrite(table, np.clip(np.rint(samples / samples.max() * 200.0 + 10.0), 0, 255).astype(np.uint8))
    found = divide(paths["rgb.dng"], table, dark=paths["rgb-dark.dng"], response=paths["mono-response.csv"])
    assert (rmse(found.values, nikon().values) <= 0.01).all()
    tifffile.imwrite(table, np.clip(np.rint(samples / samples.max() * 400.0 + 10.0), 0, 255).astype(np.uint8))
    with pytest.raises(Overexposed, match="255 DN"):
        divide(paths["rgb.dng"], table)


def test_a_dark_photo_is_refused(frames: dict[str, Path]) -> None:
    paths = frames
    with pytest.raises(Underexposed, match="no rows exceed"):
        divide(paths["rgb-dark.dng"], paths["mono.tif"])


def test_frames_that_differ_are_refused(frames: dict[str, Path], tmp_path: Path) -> None:
    paths = frames
    rgb, mono = paths["rgb.dng"], paths["mono.tif"]
    with pytest.raises(FramesDiffer, match="not darker"):
        divide(rgb, mono, dark=rgb)
    small = tmp_path / "small.dng"
    write_dng(small, np.full((100, 200), 512, dtype=np.uint16), Sensor(), nikon())
    with pytest.raises(FramesDiffer, match="200 × 100"):
        divide(rgb, mono, dark=small)


@pytest.mark.full
def test_frames_of_other_wavelengths_are_refused(frames: dict[str, Path], tmp_path: Path) -> None:
    """A mono table that ends at 640 nm has lines enough, but no red."""
    paths = frames
    x = np.arange(1500, dtype=float)
    nm = 375.0 + 0.2 * x
    light = np.interp(nm, FINE, spectrograph.gaussian_filter1d(spectrograph.sunlight("AM1.5"), 17.0))
    table = tmp_path / "mono.csv"
    table.write_text("pixel,signal\n" + "\n".join(f"{a:g},{b:.9g}" for a, b in zip(x, light, strict=True)))
    with pytest.raises(FramesDiffer, match=r"share only 3\d\d to 6\d\d nm"):
        divide(paths["rgb.dng"], table)


@pytest.mark.full
@pytest.mark.parametrize("kind", ["noise", "small", "spikes", "slope"])
def test_pictures_of_something_else_are_refused(frames: dict[str, Path], tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(0)
    picture = {
        "zeros": np.zeros((100, 300)),
        "noise": rng.integers(0, 16000, (200, 800)),
        "small": rng.integers(0, 100, (2, 2)),
        "row": rng.integers(0, 100, (1, 500)),
        "spikes": np.where(rng.random((200, 800)) < 1e-4, 15000, 520),
        "slope": np.repeat(np.linspace(600, 9000, 800)[None], 100, 0) * np.hanning(100)[:, None],
    }[kind]
    file = tmp_path / "mono.tif"
    tifffile.imwrite(file, picture.astype(np.uint16))
    with pytest.raises((Underexposed, LampUnfit), match=r"mono\.tif"):
        divide(frames["rgb.dng"], file)


def test_files_that_are_no_frames_are_refused(frames: dict[str, Path], tmp_path: Path) -> None:
    paths = frames
    rgb, mono = paths["rgb.dng"], paths["mono.tif"]
    with pytest.raises(UnreadableRaw, match="no file"):
        divide(rgb, tmp_path / "none.tif")
    with pytest.raises(InvalidArgument, match="cannot be the colour frame"):
        divide(mono, mono)
    colour = tmp_path / "colour.tif"
    tifffile.imwrite(colour, np.zeros((20, 30, 3), dtype=np.uint16), photometric="rgb")
    with pytest.raises(UnreadableRaw, match="one grey page"):
        divide(rgb, colour)
    broken = tmp_path / "broken.tif"
    broken.write_bytes(b"II*\0" + b"\0" * 40)
    with pytest.raises(UnreadableRaw):
        divide(rgb, broken)
    table = tmp_path / "mono.csv"
    table.write_text("pixel,signal\n1,2\n")
    with pytest.raises(InvalidArgument, match="1 rows"):
        divide(rgb, table)
    blind = tmp_path / "response.csv"
    blind.write_text("wavelength_nm,response\n380,0\n720,1\n")
    with pytest.raises(InvalidArgument, match="0 or less, at 380 nm"):
        divide(rgb, mono, response=blind)
    with pytest.raises(InvalidArgument, match="a dark frame cannot be subtracted"):
        divide(rgb, table, mono_dark=mono)


def write_sweep(path: Path, nm: np.ndarray, power: np.ndarray) -> Path:
    curves = np.stack([np.interp(nm, WAVELENGTHS, c) for c in nikon().values.T], axis=1)
    rows = np.column_stack([nm, curves * power[:, None], power])
    head = "# a comment\nwavelength_nm,red,green,blue,power\n"
    path.write_text(head + "\n".join(",".join(f"{v:.9g}" for v in row) for row in rows))
    return path


def test_a_sweep_is_divided_by_its_power_exactly(tmp_path: Path) -> None:
    """At the sweep's own wavelengths the curve is signal over power; between them straight."""
    nm = np.arange(380.0, 725.0, 5.0)
    found = sweep(write_sweep(tmp_path / "sweep.csv", nm, 1.0 + np.sin(nm / 20.0) ** 2))
    expected = np.stack([np.interp(nm, WAVELENGTHS, c) for c in nikon().values.T], axis=1)
    assert found.values[::10] == pytest.approx(expected, rel=1e-7, abs=1e-9)
    assert found.values[5::10] == pytest.approx((expected[1:] + expected[:-1]) / 2, rel=1e-7, abs=1e-9)
    assert found.std is None
    assert found.covered == (380.0, 720.0)
    assert not any(code == "covered" for code, _ in found.assumptions)


def test_a_short_sweep_says_where_it_ends(tmp_path: Path) -> None:
    nm = np.arange(400.0, 705.0, 10.0)
    found = sweep(write_sweep(tmp_path / "sweep.csv", nm, np.ones_like(nm)))
    assert not found.values[(WAVELENGTHS < 400) | (WAVELENGTHS > 700)].any()
    assert ("covered", "only 400.0 to 700.0 nm were measured; beyond, the curves are set to 0.") in found.assumptions


@pytest.mark.parametrize(
    ("nm", "power", "kind", "match"),
    [
        (np.arange(420.0, 720.0, 10.0), 1.0, InvalidArgument, "covers 420 to 710"),
        (np.arange(400.0, 725.0, 25.0), 1.0, InvalidArgument, "steps of up to 25"),
        (np.arange(400.0, 705.0, 10.0), 0.0, Underexposed, "without reference power, at 400 nm"),
        (np.array([400.0, *np.arange(400.0, 705.0, 10.0)]), 1.0, InvalidArgument, "does not increase"),
        (np.arange(400.0, 705.0, 10.0), np.nan, InvalidArgument, "not finite"),
        (np.arange(400.0, 705.0, 10.0), -1.0, Underexposed, "without reference power"),
    ],
)
def test_a_sweep_that_is_none(
    tmp_path: Path, nm: np.ndarray, power: float, kind: type[Exception], match: str
) -> None:
    with pytest.raises(kind, match=match):
        sweep(write_sweep(tmp_path / "sweep.csv", nm, np.full(nm.shape, power)))


def test_a_sweep_beyond_all_numbers(tmp_path: Path) -> None:
    path = tmp_path / "sweep.csv"
    rows = [f"{nm},1e308,1,1,1e-308" for nm in range(380, 725, 5)]
    path.write_text("\n".join(["wavelength_nm,red,green,blue,power", *rows]))
    with pytest.raises(InvalidArgument, match="too large for their power"):
        sweep(path)


def test_a_sweep_without_a_column(tmp_path: Path) -> None:
    path = tmp_path / "sweep.csv"
    path.write_text("wavelength_nm,red,green,blue\n400,1,1,1\n700,1,1,1\n")
    with pytest.raises(InvalidArgument, match="first line must read wavelength_nm,red,green,blue,power"):
        sweep(path)


def test_the_files_are_read_by_the_rest_of_camssf(tmp_path: Path) -> None:
    nm = np.arange(380.0, 725.0, 5.0)
    found = sweep(write_sweep(tmp_path / "sweep.csv", nm, np.ones_like(nm)))
    out = tmp_path / "out"
    assert [path.name for path in found.save(out)] == ["direct.json", "ssf.csv"]
    assert sorted(path.name for path in out.iterdir()) == ["direct.json", "ssf.csv"]
    again = read_camera(str(out / "ssf.csv"))
    assert rmse(again.values, found.values) == pytest.approx(np.zeros(3), abs=1e-6)
    document = json.loads((out / "direct.json").read_text())
    assert document["format"] == "camssf-direct/1"
    assert max(document["ssf"]["green"]) == 1.0
    assert document["ssf"]["wavelength_nm"] == WAVELENGTHS.tolist()
    assert document["channel_gain"][1] == 1.0
    assert document["files"]["sweep"]["name"] == "sweep.csv"


def test_a_folder_that_cannot_be_written_gets_no_half(tmp_path: Path) -> None:
    nm = np.arange(380.0, 725.0, 5.0)
    found = sweep(write_sweep(tmp_path / "sweep.csv", nm, np.ones_like(nm)))
    (tmp_path / "out").write_text("a file")
    with pytest.raises(InvalidArgument, match="out is a file"):
        found.save(tmp_path / "out")
    (tmp_path / "folder" / "ssf.csv").mkdir(parents=True)
    with pytest.raises(InvalidArgument, match=r"ssf\.csv is a folder"):
        found.save(tmp_path / "folder")
    assert [path.name for path in (tmp_path / "folder").iterdir()] == ["ssf.csv"]


def test_a_calibration_s_curves_are_not_replaced(tmp_path: Path) -> None:
    nm = np.arange(380.0, 725.0, 5.0)
    found = sweep(write_sweep(tmp_path / "sweep.csv", nm, np.ones_like(nm)))
    for name in ("result.json", "ssf.csv"):
        (tmp_path / name).write_text("calibrated")
    with pytest.raises(InvalidArgument, match="holds the result of a calibration"):
        found.save(tmp_path)
    assert (tmp_path / "ssf.csv").read_text() == "calibrated"


@pytest.mark.full
def test_the_command(frames: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = {name: str(path) for name, path in frames.items()}
    out = tmp_path / "out"
    both = ["direct", paths["rgb.dng"], paths["mono.tif"]]
    darks = ["--dark", paths["rgb-dark.dng"], "--dark", paths["mono-dark.tif"]]
    more = ["--response", paths["mono-response.csv"], "-o", str(out)]
    assert main([*both, *darks, *more]) == 0
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
    nm = np.arange(380.0, 725.0, 5.0)
    path = write_sweep(tmp_path / "sweep.csv", nm, np.ones_like(nm))
    assert main(["direct", str(path)]) == 0
    assert json.loads(capsys.readouterr().out)["wavelengths"] == {}
    assert main(["direct", str(path), "--dark", "x.dng"]) == InvalidArgument.exit_status
    assert main(["direct", str(tmp_path / "none.csv")]) == InvalidArgument.exit_status
    said = capsys.readouterr().err
    assert "Traceback" not in said
