"""Patches and signals: means by hand, errors against truth, lens shading from the photo's own gain maps."""

import struct
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from camssf.errors import FramesDiffer, InvalidArgument, Overexposed, UnreadableRaw, UnsupportedRaw
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.patches import FrameMeans, PatchMeans, measure_patches
from camssf.photo.read.dng import CFA_ORDERS, Mosaic, read_dng, shading
from camssf.photo.signals import Signals, normalise
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import Scene
from tests.support.captures import photos
from tests.support.dngs import RATIONAL, SHORT, Dng, gain_map, opcode_list
from tests.support.scenes import SIZE, mosaic, shoot, table

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def pose_of(*quads: np.ndarray) -> Pose:
    return Pose("classic24", np.zeros((4, 2)), np.array(quads, dtype=float), 0, "by hand", 1.0, ())


def flat(level: float = 4000, noise: float = 0, seed: int = 0, size: int = 120) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.rint(level + noise * rng.standard_normal((size, size))).astype(np.uint16)


# The measured part of this patch are the samples with 30 <= x, y <= 70: 41 a side, 21 of them even.
PATCH = pose_of(10 + 80 * SQUARE)


def test_counts_and_means_of_a_square() -> None:
    """RGGB: red has even rows and columns; closed form of the sums."""
    y, x = np.mgrid[0:120, 0:120]
    got = measure_patches(mosaic((1000 + 3 * x + 5 * y).astype(np.uint16)), PATCH).chart
    assert got.count.tolist() == [[21 * 21, 2 * 21 * 20, 20 * 20]]
    np.testing.assert_allclose(got.mean, [[1000 + 8 * 50] * 3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(got.greens, [[1400, 1400]], rtol=0, atol=1e-9)
    # a plane without noise: nothing is rejected, and only the rounding to whole DN is left
    assert got.dead.tolist() == got.clipped.tolist() == [[0, 0, 0]]
    np.testing.assert_allclose(got.standard_error[0, [0, 2]], np.sqrt([1 / 12 / 441, 1 / 12 / 400]), rtol=1e-6)
    np.testing.assert_allclose(got.gradient[0, 0], 40 * 8 / (1400 - 512), rtol=1e-9)


@pytest.mark.parametrize("cfa", CFA_ORDERS)
def test_colours_of_every_cfa(cfa: str) -> None:
    samples = np.empty((120, 120), np.uint16)
    levels = {"R": 1000, "G": 2000, "B": 3000}
    for i, letter in enumerate(cfa):
        samples[i // 2 :: 2, i % 2 :: 2] = levels[letter]
    samples[cfa.index("R") // 2 :: 2] += (samples[cfa.index("R") // 2 :: 2] == 2000).astype(np.uint16) * 8
    got = measure_patches(mosaic(samples, Sensor(cfa=cfa)), PATCH).chart
    assert got.mean.tolist() == [[1000, 2004, 3000]]
    assert got.greens.tolist() == [[2008, 2000]]  # red's rows, blue's rows


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"samples": flat(size=122)}, "size"),
        ({"cfa": "BGGR"}, "CFA"),
        ({"model": "Other"}, "camera model"),
        ({"white": 4095.0}, "white level"),
        ({"black": np.full((2, 2), 800.0)}, "black level"),
        ({"exposure": 0.02}, "exposure 0.02 s against 0.01 s"),
        ({"iso": 400.0}, "iso 400 against 100"),
    ],
)
def test_frames_that_differ(change: dict[str, object], word: str) -> None:
    photo = mosaic(flat(), model="This")
    with pytest.raises(FramesDiffer, match=word) as refusal:
        measure_patches(photo, PATCH, white=replace(photo, path="w.dng", **change))  # type: ignore[arg-type]
    assert "white" in refusal.value.message
    assert "w.dng" in refusal.value.message
    assert "manual" in refusal.value.advice


@pytest.mark.parametrize("change", [{"exposure": None}, {"iso": None}, {"model": ""}, {"exposure": 0.010049}])
def test_frames_that_are_alike_as_far_as_the_files_say(change: dict[str, object]) -> None:
    photo = mosaic(flat(), model="This")
    assert measure_patches(photo, PATCH, white=replace(photo, **change)).white is not None  # type: ignore[arg-type]


QUIET = Sensor(noise=False)
CLASSIC = table()
WHITE = CLASSIC.white


def measured(
    scene: Scene, sensor: Sensor = QUIET, white: bool = True, dark: bool = True
) -> tuple[Signals, np.ndarray]:
    """Signals of a simulated shot, its chart found in the photo, and the theory."""
    frames = shoot(replace(scene, size=SIZE), sensor)
    photo = mosaic(frames.chart, sensor)
    shot = measure_patches(
        photo,
        find_chart(photo, CLASSIC),
        white=mosaic(frames.white, sensor) if white else None,
        dark=mosaic(frames.dark, sensor) if dark else None,
    )
    return normalise([shot], CLASSIC), frames.signals


def means(mean: np.ndarray, error: float | np.ndarray = 1.0, **shares: np.ndarray) -> FrameMeans:
    zero = np.zeros((24, 3))
    full = np.broadcast_to(np.asarray(mean, dtype=float), (24, 3)).copy()
    return FrameMeans(
        full,
        np.broadcast_to(np.asarray(error, dtype=float), (24, 3)).copy(),
        np.full((24, 3), 100),
        shares.get("clipped", zero),
        zero,
        zero,
        np.zeros((24, 2)),
    )


RNG = np.random.default_rng(11)
CHART = 512 + RNG.uniform(400, 9000, (24, 3))
SHOT = PatchMeans(
    means(CHART, 12), means(np.array([9000, 12000, 8000.0]), 20), means(514.0, 3), np.full(3, 512.0), 16383.0
)


def test_noise_stays_within_the_standard_errors() -> None:
    signals, truth = measured(Scene(tilt=15, vignetting=0.3), Sensor())
    z = (signals.values[0] - truth) / signals.standard_error[0]
    assert np.std(z) == pytest.approx(1, abs=0.25)
    assert np.abs(z).max() < 4.5


def test_clipped_white_patch_as_reference() -> None:
    clipped = np.zeros((24, 3))
    clipped[WHITE, 0] = 0.2
    with pytest.raises(Overexposed, match="white patch"):
        normalise([replace(SHOT, white=None, chart=replace(SHOT.chart, clipped=clipped))], CLASSIC)


@pytest.mark.parametrize("values", [(9000, 12000, 8000), (650, 650, 650), (9000, 12000, 500)])
def test_white_and_dark_swapped(values: tuple[float, float, float]) -> None:
    swapped = replace(SHOT, white=means(514.0, 3), dark=means(np.array(values, dtype=float), 20))
    with pytest.raises(
        FramesDiffer, match="Shot 2: the dark frame is brighter than the white frame: they seem to be swapped"
    ):
        normalise([SHOT, swapped], CLASSIC)


SHADED_PATCH = Pose("classic24", np.zeros((4, 2)), np.array([10.0 + 80 * SQUARE]), 0, "by hand", 1.0, ())
"""Its centre is (50, 50)."""


def unrest(height: int = 120, width: int = 120) -> np.ndarray:
    return np.random.default_rng(5).integers(900, 4000, (height, width)).astype(np.uint16)


def read_shaded(folder: Path, samples: np.ndarray, *opcodes: bytes, tag: int = 51009, **dng: Any) -> Mosaic:
    path = folder / "x.dng"
    path.write_bytes(Dng(samples, tags={tag: opcode_list(*opcodes)}, **dng).encode())
    return read_dng(path)


def test_bilinear_by_hand(tmp_path: Path) -> None:
    """100 × 200 px, a net of 2 × 3 points at 0, 1 and 0, 1/2, 1: at row 24.5, column 49.5 a quarter of each span."""
    whole = (0, 0, 100, 200)
    photo = read_shaded(tmp_path, unrest(100, 200), gain_map([[1, 2, 4], [3, 5, 9]], whole, spacing=(1.0, 0.5)))
    first, second = 1 + 0.25 * (3 - 1), 2 + 0.25 * (5 - 2)
    np.testing.assert_allclose(shading(photo, 49.5, 24.5), first + 0.5 * (second - first), rtol=1e-15)
    # the first sample's centre lies half a pixel inside; beyond the outermost points the map is constant
    first, second = 1 + 0.005 * (3 - 1), 2 + 0.005 * (5 - 2)
    np.testing.assert_allclose(shading(photo, 0, 0), first + 0.005 * (second - first), rtol=1e-15)
    inner = read_shaded(
        tmp_path, unrest(100, 200), gain_map([[1, 2], [3, 4]], whole, spacing=(0.5, 0.5), origin=(0.25, 0.25))
    )
    corners = [shading(inner, x, y)[0, 0] for y in (0, 99) for x in (0, 199)]
    assert corners == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("opcode", "tag"),
    [(gain_map([[2.0]], (0, 0, 120, 120)), 51008), (gain_map([[2.0]], (0, 0, 120, 120), (4, 4)), 51009)],
)
def test_maps_that_cannot_be_applied(tmp_path: Path, opcode: bytes, tag: int) -> None:
    photo = read_shaded(tmp_path, unrest(), opcode, tag=tag)
    with pytest.raises(UnsupportedRaw, match="white frame"):
        measure_patches(photo, SHADED_PATCH, lens_shading="apply")
    measure_patches(photo, SHADED_PATCH)


def spoil(opcode: bytes, at: int, part: bytes) -> bytes:
    return opcode[: 16 + at] + part + opcode[16 + at + len(part) :]


WHOLE = gain_map([[1.0, 2.0]], (0, 0, 9, 9))


@pytest.mark.parametrize(
    "opcode",
    [
        spoil(WHOLE, 32, struct.pack(">I", 3)),  # points that are not there
        spoil(WHOLE, 48, struct.pack(">d", 0.0)),  # spacing
        spoil(WHOLE, 64, struct.pack(">d", np.inf)),  # origin
        spoil(WHOLE, 24, struct.pack(">I", 0)),  # pitch
        spoil(WHOLE, 76, struct.pack(">f", np.nan)),
        struct.pack(">4I", 9, 0x01030000, 1, 20) + bytes(20),
    ],
)
def test_a_damaged_map_is_a_damaged_file(tmp_path: Path, opcode: bytes) -> None:
    with pytest.raises(UnreadableRaw, match="opcode list 51009 holds a gain map"):
        read_shaded(tmp_path, unrest(), opcode)


def test_what_is_asked_for_must_exist() -> None:
    with pytest.raises(InvalidArgument, match="no lens-shading map"):
        measure_patches(mosaic(unrest()), SHADED_PATCH, lens_shading="apply")
    with pytest.raises(InvalidArgument, match="as-stored or apply"):
        measure_patches(mosaic(unrest()), SHADED_PATCH, lens_shading="yes")


# -- a simulated phone --------------------------------------------------------------------------------------------

SHADED = Scene(size=(900, 675), vignetting=0.5, fill=0.8)


def phone(samples: np.ndarray, sensor: Sensor, vignetting: float) -> bytes:
    """A DNG as Android writes it: four maps of 13 × 17 points with the inverse of the simulated fall-off."""
    height, width = samples.shape
    v, h = np.linspace(0, 1, 13), np.linspace(0, 1, 17)
    y, x = (v[:, None] * height - height / 2), (h * width - width / 2)
    a = (1 - vignetting) ** -0.5 - 1
    net = (1 + a * (x**2 + y**2) / (np.hypot(width, height) / 2) ** 2) ** 2
    area = [(row, column, height, width) for row, column in np.ndindex(2, 2)]
    maps = opcode_list(*(gain_map(net, each, (2, 2), (1 / 12, 1 / 16)) for each in area))
    tags = {51009: maps, 50714: (SHORT, [round(sensor.black)]), 50717: (SHORT, [sensor.white_level])}
    exif = {33434: (RATIONAL, [1, 100]), 34855: (SHORT, [100])}
    return Dng(samples, bytes("RGB".index(c) for c in sensor.cfa), tags=tags, exif=exif).encode()


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder, sensor = tmp_path_factory.mktemp("phone"), Sensor()
    files = {}
    for name, scene in (("even", replace(SHADED, vignetting=0.0)), ("shaded", SHADED)):
        frames = shoot(scene, sensor)
        for role in ("chart", "white", "dark"):
            files[f"{name} {role}"] = folder / f"{name}-{role}.dng"
            files[f"{name} {role}"].write_bytes(phone(getattr(frames, role), sensor, SHADED.vignetting))
    return files


def test_a_colour_applies_the_map_if_the_result_did(shots: dict[str, Path]) -> None:
    from camssf_colour.cli.regions import measure as measured

    white = "440,440,40,40,0.9"

    def signals(photo: Path, *applied: str) -> np.ndarray:
        taken = [SimpleNamespace(lens_shading=word) for word in applied]
        result = SimpleNamespace(capture=SimpleNamespace(shots=taken, photos=[SimpleNamespace(make="", model="")]))
        return measured(result, str(photo), ["40,40,40,40"], white, None).signals  # type: ignore[arg-type]

    shaded, plain = shots["shaded white"], photos().shots[0].white
    stored, evened = signals(shaded, "as-stored"), signals(shaded, "as-stored", "apply")
    assert np.abs(evened - 0.9).max() < 0.02 < np.abs(stored - 0.9).max()
    assert signals(plain, "apply").tolist() == signals(plain, "as-stored").tolist()  # no map in this file


def test_standard_errors_are_those_of_the_photon_noise() -> None:
    """z = (mean - truth) / se over 24 patches, three colours and three frames is standard normal."""
    frames = shoot(Scene(size=SIZE, fill=0.5, tilt=20))
    sensor = Sensor()
    got = measure_patches(mosaic(frames.chart), frames.pose, white=mosaic(frames.white), dark=mosaic(frames.dark))
    assert got.white is not None
    assert got.dark is not None
    truths = (frames.levels, frames.white_levels, np.full(3, sensor.black))
    z = [(f.mean - t) / f.standard_error for f, t in zip((got.chart, got.white, got.dark), truths, strict=True)]
    assert np.std(z) == pytest.approx(1, abs=0.2)
    assert np.abs(z).max() < 4.5
