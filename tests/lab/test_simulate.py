"""The simulated camera against LibRaw, OpenCV's pinhole, colour-science's tables and closed forms."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rawpy
from numpy.typing import NDArray

from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.read.dng import CFA_ORDERS, read_dng
from camssf.spectra import CameraCurves, Lamp, read_camera, read_chart
from camssf.spectra.layouts import LAYOUTS
from camssf_lab.simulation import frames as module
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import Simulation, simulate
from camssf_lab.simulation.scene import Scene, homography, render_mosaic, true_pose
from camssf_lab.simulation.shot import Frames, photograph
from tests.support.problems import bell
from tests.support.scenes import filters

SIZE = (600, 450)
QUIET = Sensor(noise=False)


def shoot(folder: Path, lamps: Any = None, **more: Any) -> Simulation:
    """A simulation of the toy camera and chart."""
    return simulate(CAMERA, lamps or FLAT, folder, **({"chart": TABLE, "scene": Scene(size=SIZE)} | more))


def taken(lamp: Lamp | None = None, sensor: Sensor = QUIET, seeds: tuple[int, ...] = (), **scene: Any) -> Frames:
    return photograph(CAMERA, lamp or FLAT, TABLE, Scene(**({"size": SIZE} | scene)), sensor, seeds or (0,))


TABLE = read_chart("classic24")
CAMERA = CameraCurves("toy", np.stack([0.9 * bell(600, 35), bell(540, 40), 0.7 * bell(460, 30)], axis=1), "test")
FLAT = Lamp("flat", np.ones(681), 0.0, np.zeros((0, 681)), "test")
RED = Lamp("red lamp", np.linspace(0.3, 2, 681), 0.0, np.zeros((0, 681)), "test")


def inside(patch: Floats, shape: tuple[int, int], share: float = 0.7) -> NDArray[np.bool_]:
    """(h, w) True in the central part of a quadrilateral."""
    corners = patch.mean(axis=0) + share * (patch - patch.mean(axis=0))
    return cv2.fillConvexPoly(np.zeros(shape, np.uint8), np.rint(corners).astype(np.int32), 1).astype(bool)


@pytest.mark.parametrize(
    ("cfa", "compression"),
    [*((cfa, None) for cfa in CFA_ORDERS), pytest.param("GBRG", "ljpeg", marks=pytest.mark.full)],
)
def test_libraw_reads_back_what_was_taken(tmp_path: Path, cfa: str, compression: str | None) -> None:
    if compression:
        pytest.importorskip("imagecodecs", reason="imagecodecs writes the lossless JPEG")
    size, black, white = (404, 303), 256.25, 4095
    sensor = Sensor(cfa=cfa, black=black, white_level=white)
    done = shoot(tmp_path, scene=Scene(size=size), seed=5, sensor=replace(sensor, compression=compression))
    frames = photograph(CAMERA, FLAT, TABLE, done.scene, sensor, (5, 0))
    shot = done.shots[0]
    for path, samples in ((shot.chart, frames.chart), (shot.white, frames.white), (shot.dark, frames.dark)):
        with rawpy.imread(str(path)) as raw:
            assert raw.white_level == white
            assert raw.black_level_per_channel == [256] * 4  # LibRaw keeps whole numbers
            assert "".join("RGBG"[code] for code in raw.raw_pattern.ravel()) == cfa
            np.testing.assert_array_equal(raw.raw_image, samples)
            np.testing.assert_array_equal(raw.raw_image_visible, samples)
        found = read_dng(path)
        np.testing.assert_array_equal(found.samples, samples)
        assert (found.black == black).all()
        assert (found.white, found.cfa, found.model) == (white, cfa, "toy")
        assert (found.exposure, found.iso, found.orientation, found.gain_map) == (0.01, 100, 1, False)


@pytest.mark.parametrize("turn", [0, 180, 33])
def test_patches_hold_theory_to_rounding(turn: float) -> None:
    scene = Scene(size=SIZE, fill=0.5, rotation=turn, tilt=20)
    within = [inside(patch, SIZE[::-1]) for patch in true_pose(scene).patches]
    for cfa in CFA_ORDERS if turn == 33 else CFA_ORDERS[:1]:
        frames = photograph(CAMERA, FLAT, TABLE, scene, replace(QUIET, cfa=cfa))
        colours = filters(frames.chart.shape, cfa)
        for patch, levels in zip(within, frames.levels, strict=True):
            seen, of = frames.chart[patch], colours[patch]
            for colour in range(3):
                samples = seen[of == colour]
                assert samples.size > 100, cfa
                assert np.abs(samples - levels[colour]).max() <= 0.501, cfa
        for colour in range(3):
            assert np.abs(frames.white[colours == colour] - frames.white_levels[colour]).max() <= 0.501, cfa
        assert (frames.dark == 512).all()


def test_noise_is_that_of_a_photon_counter() -> None:
    sensor = Sensor(full_well=3000, read_noise=4.0, exposure=0.7, dark_current=30)
    frames = taken(sensor=sensor, seeds=(11,), fill=0.8)
    electrons = 3000 / (16383 - 512)
    colours = filters(frames.white.shape)

    def judge(samples: NDArray[np.uint16], level: float) -> None:
        count = samples.size
        light = level - 512
        variance = light / electrons + (4.0 / electrons) ** 2 + 1 / 12
        assert abs(samples.mean() - level) < 4.5 * np.sqrt(variance / count)
        # a Poisson's fourth moment adds 1 / mean to the normal's 2
        spread = variance * np.sqrt((2 + 1 / (light * electrons)) / count)
        assert abs(samples.astype(float).var() - variance) < 4.5 * spread

    for c in range(3):
        judge(frames.white[colours == c], frames.white_levels[c])
        for patch, levels in zip(frames.pose.patches, frames.levels, strict=True):
            judge(frames.chart[inside(patch, frames.chart.shape) & (colours == c)], levels[c])
    judge(frames.dark.ravel(), 512 + 30)


def test_vignetting_is_cos4() -> None:
    loss = 0.5
    sensor = Sensor(noise=False, black=0, white_level=65535, exposure=0.9)
    frames = taken(sensor=sensor, size=(601, 451), vignetting=loss)
    green = frames.white[0::2, 1::2].astype(float)  # of RGGB
    y, x = np.mgrid[0:451:2, 1:601:2]
    radius = np.hypot(x - 300, y - 225) / np.hypot(300, 225)
    reach = np.arccos((1 - loss) ** 0.25)  # the field angle whose cos⁴ is what is left in the corner
    cos4 = np.cos(np.arctan(radius * np.tan(reach))) ** 4
    np.testing.assert_allclose(green, cos4 * frames.white_levels[1], atol=0.51)
    assert frames.white[0, 0] == pytest.approx((1 - loss) * frames.white_levels[0], abs=0.51)  # the corner itself
    assert frames.white[224, 300] == pytest.approx(frames.white_levels[0], rel=1e-3)


@pytest.mark.parametrize(("rotation", "tilt", "turns"), [(30, 0, 0), (0, 55, 0), (200, 35, 2), (-70, -45, 3)])
def test_pose_is_a_pinholes(rotation: float, tilt: float, turns: int) -> None:
    """OpenCV's projection of the chart's corners: focal length one picture width, chart turned, then tilted."""
    layout, (width, height) = LAYOUTS["classic24"], SIZE
    pose = true_pose(Scene(size=SIZE, fill=0.6, rotation=rotation, tilt=tilt))
    pitch = 1 / (layout.columns - 1 + layout.side[0])  # the block of patches is one unit wide
    half = np.array([0.5, (layout.rows - 1 + layout.side[1]) * pitch / 2])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    turn, _ = cv2.Rodrigues(np.array([0, 0, np.deg2rad(rotation)]))
    tip, _ = cv2.Rodrigues(np.array([0, np.deg2rad(-tilt), 0]))
    rvec, _ = cv2.Rodrigues(tip @ turn)
    lens = np.array([[width, 0, width / 2 - 0.5], [0, width, height / 2 - 0.5], [0, 0, 1.0]])
    distance = 1 / 0.6  # the block's width over its share of the picture, at a focal length of one
    points, _ = cv2.projectPoints(np.c_[corners, np.zeros(4)], rvec, np.array([0, 0, distance]), lens, None)
    np.testing.assert_allclose(pose.corners, points[:, 0], atol=1e-9)
    assert pose.quarter_turns == turns


@pytest.mark.parametrize(("surround", "share"), [("white", 0.9), ("grey", 0.2), ("black", 0.02)])
def test_surround_frame_and_gaps(surround: str, share: float) -> None:
    scene = Scene(size=SIZE, surround=surround)
    light = render_mosaic(scene, np.full((24, 3), 0.5), np.ones(3))
    assert light[0, 0] == light[-1, -1] == pytest.approx(share)
    to_pixels = homography(scene)
    for u, v in ((0.5, 0.5), (2.5, 1), (-0.6, 0)):  # gap crossing, gap, frame; in pitches
        x, y, w = to_pixels @ [u, v, 1]
        assert light[round(y / w), round(x / w)] == pytest.approx(0.04, abs=1e-3)


def test_glare_dark_current_gains_and_clipping() -> None:
    plain, veiled = taken(), taken(sensor=replace(QUIET, dark_current=25), glare=0.1)
    np.testing.assert_allclose(veiled.levels, plain.levels + 0.1 * (plain.white_levels - 512) + 25)
    np.testing.assert_array_equal(veiled.white.astype(int), plain.white.astype(int) + 25)
    assert (veiled.dark == 512 + 25).all()
    np.testing.assert_array_equal(veiled.signals, plain.signals)  # the truth about the patches, not about the veil
    y, x = plain.pose.patches[7].mean(axis=0).round().astype(int)[::-1]
    colour = filters(plain.chart.shape)[y, x]
    assert veiled.chart[y, x] == pytest.approx(veiled.levels[7, colour], abs=0.51)
    cast = taken(sensor=replace(QUIET, gains=(1, 0.5, 0.1)))
    np.testing.assert_allclose(cast.signals, plain.signals)
    assert cast.white_levels.max() == pytest.approx(512 + 0.8 * (16383 - 512))
    bright = taken(sensor=replace(QUIET, exposure=2))
    assert bright.white[0, 1] == bright.chart.max() == 16383


def test_same_seed_same_bytes(tmp_path: Path) -> None:
    names = ("chart.dng", "white.dng", "dark.dng", "truth.csv", "corners.json")
    for folder, seed in (("a", 1), ("b", 1), ("c", 2)):
        shoot(tmp_path / folder, scene=Scene(size=SIZE, blur=1.0), seed=seed)
    contents = {folder: [Path(tmp_path, folder, name).read_bytes() for name in names] for folder in "abc"}
    assert contents["a"] == contents["b"]
    assert [one == other for one, other in zip(contents["a"], contents["c"], strict=True)] == [False] * 3 + [True] * 2
    assert sorted(path.name for path in Path(tmp_path, "a").iterdir()) == sorted(names)


def test_several_lamps_and_the_truth(tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    done = shoot(out, [FLAT, RED, RED])
    tags = ["flat", "red-lamp", "red-lamp~2"]
    wanted = [f"{kind}-{tag}.dng" for tag in tags for kind in ("chart", "white", "dark")]
    assert sorted(path.name for path in out.iterdir()) == sorted([*wanted, "truth.csv", "corners.json"])
    assert [shot.chart.name for shot in done.shots] == wanted[::3]
    assert [shot.lamp for shot in done.shots] == ["flat", "red lamp", "red lamp"]
    assert read_dng(done.shots[1].chart).sha256 != read_dng(done.shots[2].chart).sha256  # other noise
    rows = list(csv.reader(done.truth.read_text(encoding="utf-8").splitlines()))
    assert rows[0] == ["wavelength_nm", "red", "green", "blue"]
    values = np.array(rows[1:], dtype=float)
    assert values.shape == (681, 4)
    np.testing.assert_array_equal(values[:, 0], WAVELENGTHS)
    np.testing.assert_allclose(values[:, 1:], CAMERA.values / CAMERA.values.max(axis=0), atol=1e-8)
    np.testing.assert_allclose(read_camera(str(done.truth)).values, values[:, 1:], atol=1e-6)


def test_colour_tags_are_plausible(tmp_path: Path) -> None:
    """Under D65 the matrix must take the lamp's own XYZ to the neutral that the file names."""
    done = simulate("Nikon 5100 (NPL)", "D65", tmp_path, scene=Scene(size=SIZE))
    found = read_dng(done.shots[0].white)
    predicted = found.color_matrix1 @ [0.95047, 1.0, 1.08883]
    np.testing.assert_allclose(predicted / predicted[1], found.as_shot_neutral, rtol=1e-3)
    samples = found.samples.astype(float) - found.black[0, 0]
    neutral = np.array([samples[0::2, 0::2].mean(), samples[0::2, 1::2].mean(), samples[1::2, 1::2].mean()])
    np.testing.assert_allclose(neutral / neutral.max(), found.as_shot_neutral, rtol=2e-3)
    with rawpy.imread(str(done.shots[0].white)) as raw:
        gains = np.array(raw.camera_whitebalance[:3])
        np.testing.assert_allclose(gains / gains[1], found.as_shot_neutral[1] / found.as_shot_neutral, rtol=1e-3)
        gains = np.array(raw.daylight_whitebalance[:3])  # LibRaw's own, from the ColorMatrix
        np.testing.assert_allclose(gains / gains[1], found.as_shot_neutral[1] / found.as_shot_neutral, rtol=0.01)


@pytest.mark.parametrize("failing", [1, 6])
def test_all_files_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: int) -> None:
    written = module.write_dng
    calls = iter(range(1, 100))

    def fails(*arguments: Any) -> None:
        written(*arguments)
        if next(calls) == failing:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "write_dng", fails)
    with pytest.raises(InvalidArgument, match="No space left"):
        shoot(tmp_path, [FLAT, RED])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"size": (10, 10)}, "size"), ({"size": (30000, 30000)}, "at most 200 megapixels"), ({"fill": 0.0}, "fill"),
        ({"fill": float("nan")}, "fill"), ({"fill": 1.0, "rotation": 45}, "beyond the picture"),
        ({"tilt": 85}, "tilt"), ({"rotation": float("inf")}, "rotation"), ({"vignetting": 1.0}, "vignetting"),
        ({"blur": -1}, "blur"), ({"glare": 2}, "glare"), ({"surround": "pink"}, "surround"), ({"cfa": "XTRA"}, "cfa"),
        ({"black": 20000}, "black is out"), ({"white_level": 70000}, "white_level is out"),
        ({"white_level": 0}, "white_level is out"), ({"exposure": 0}, "exposure"), ({"full_well": 0}, "full_well"),
        ({"read_noise": -1}, "read_noise"), ({"dark_current": -1}, "dark_current"), ({"compression": "zip"}, "zip"),
        ({"seed": -1}, "Seed"),
    ],
)  # fmt: skip
def test_settings_out_of_range(tmp_path: Path, settings: dict[str, Any], words: str) -> None:
    scene, sensor = (
        {k: v for k, v in settings.items() if k in part.__dataclass_fields__} for part in (Scene, Sensor)
    )
    seed = settings.get("seed", 0)
    with pytest.raises(InvalidArgument, match=words):
        shoot(tmp_path / "out", scene=Scene(**({"size": SIZE} | scene)), sensor=Sensor(**sensor), seed=seed)
    assert not (tmp_path / "out").exists()


def test_eq5_of_the_files_against_colour_science(tmp_path: Path) -> None:
    """The issue's bar: 24 patches, D55, Nikon D5100 (NPL), within 0.3 % of theory without noise."""
    import colour

    done = simulate(
        "Nikon 5100 (NPL)", "D55", tmp_path, scene=Scene(size=(900, 674), vignetting=0.5),
        sensor=Sensor(noise=False, white_level=65535),
    )  # fmt: skip
    shape = colour.SpectralShape(380, 720, 5)
    camera = colour.MSDS_CAMERA_SENSITIVITIES["Nikon 5100 (NPL)"].copy().align(shape).values
    light = colour.SDS_ILLUMINANTS["D55"].copy().align(shape).values
    chart = colour.SDS_COLOURCHECKERS["BabelColor Average"]
    reflectance = np.array([sd.copy().align(shape).values for sd in chart.values()])
    theory = (reflectance * light) @ camera / (light @ camera)
    shot = done.shots[0]
    lit, white, dark = (read_dng(path).samples.astype(float) for path in (shot.chart, shot.white, shot.dark))
    colours = filters(lit.shape)
    measured = np.empty((24, 3))
    for number, patch in enumerate(done.pose.patches):
        within = inside(patch, lit.shape)
        for c in range(3):
            at = within & (colours == c)
            measured[number, c] = (lit[at] - dark[at]).sum() / (white[at] - dark[at]).sum()
    # 5-nm sums of tables are themselves 0.1 % off the interpolated integral
    np.testing.assert_allclose(measured, theory, rtol=3e-3)
    np.testing.assert_allclose(measured, shot.signals, rtol=1e-3)
