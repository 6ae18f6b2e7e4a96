"""Patches and signals: means by hand, errors against truth, lens shading from the photo's own gain maps."""

import struct
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from camssf.errors import FramesDiffer, InvalidArgument, Overexposed, UnreadableRaw, UnsupportedRaw
from camssf.photo.find.pose import Pose
from camssf.photo.patches import FrameMeans, PatchMeans, measure_patches
from camssf.photo.read.dng import CFA_ORDERS, Mosaic, read_dng, shading
from camssf.photo.signals import normalise
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import Scene
from camssf_lab.simulation.shot import Frames
from tests.support.dngs import Dng, gain_map, opcode_list
from tests.support.scenes import SIZE, mosaic, shoot, table

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


def flat(level: float = 4000, noise: float = 0, seed: int = 0, size: int = 120) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.rint(level + noise * rng.standard_normal((size, size))).astype(np.uint16)


# The measured part of this patch are the samples with 30 <= x, y <= 70: 41 a side, 21 of them even.
PATCH = Pose("classic24", np.zeros((4, 2)), np.array([10.0 + 80 * SQUARE]), 0, "by hand", 1.0, ())


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
        ({"samples": flat(size=122)}, "size"), ({"cfa": "BGGR"}, "CFA"), ({"model": "Other"}, "camera model"),
        ({"white": 4095.0}, "white level"), ({"black": np.full((2, 2), 800.0)}, "black level"),
        ({"exposure": 0.02}, "exposure 0.02 s against 0.01 s"), ({"iso": 400.0}, "iso 400 against 100"),
    ],
)  # fmt: skip
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


CLASSIC = table()


def means(mean: Any, error: float) -> FrameMeans:
    zero = np.zeros((24, 3))
    return FrameMeans(mean + zero, error + zero, zero.astype(int) + 100, zero, zero, zero, zero[:, :2])


RNG = np.random.default_rng(11)
CHART = 512 + RNG.uniform(400, 9000, (24, 3))
SHOT = PatchMeans(means(CHART, 12), means([9000, 12000, 8000.0], 20), means(514.0, 3), np.full(3, 512.0), 16383.0)


def test_clipped_white_patch_as_reference() -> None:
    clipped = np.zeros((24, 3))
    clipped[CLASSIC.white, 0] = 0.2
    with pytest.raises(Overexposed, match="white patch"):
        normalise([replace(SHOT, white=None, chart=replace(SHOT.chart, clipped=clipped))], CLASSIC)


@pytest.mark.parametrize("values", [(9000, 12000, 8000), (650, 650, 650), (9000, 12000, 500)])
def test_white_and_dark_swapped(values: tuple[float, float, float]) -> None:
    swapped = replace(SHOT, white=means(514.0, 3), dark=means(values, 20))
    words = "Shot 2: the dark frame is brighter than the white frame: they seem to be swapped"
    with pytest.raises(FramesDiffer, match=words):
        normalise([SHOT, swapped], CLASSIC)


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
        measure_patches(photo, PATCH, lens_shading="apply")
    measure_patches(photo, PATCH)


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
        measure_patches(mosaic(unrest()), PATCH, lens_shading="apply")
    with pytest.raises(InvalidArgument, match="as-stored or apply"):
        measure_patches(mosaic(unrest()), PATCH, lens_shading="yes")


def test_a_colour_applies_the_map_if_the_result_did(tmp_path: Path) -> None:
    """An even area whose map says that twice as much light is lost on its right."""
    from camssf_colour.cli.regions import measure as measured

    def signal(*applied: str) -> Any:
        shots = [SimpleNamespace(lens_shading=word) for word in applied]
        result = SimpleNamespace(capture=SimpleNamespace(shots=shots, photos=[SimpleNamespace(make="", model="")]))
        path = str(tmp_path / "x.dng")
        return measured(result, path, ["80,40,20,20"], "10,40,20,20,0.9", None).signals  # type: ignore[arg-type]

    read_shaded(tmp_path, flat(noise=9), gain_map([[1, 1, 2, 2]], (0, 0, 120, 120), spacing=(1.0, 1 / 3)))
    assert signal("as-stored") == pytest.approx(0.9, rel=0.01)
    assert signal("as-stored", "apply") == pytest.approx(1.8, rel=0.01)
    read_shaded(tmp_path, flat(noise=9))
    assert (signal("apply") == signal("as-stored")).all()  # no map in this file


def test_standard_errors_are_those_of_the_photon_noise() -> None:
    """z = (value - truth) / se is standard normal: of means in three frames, and of signals in shaded ones."""

    def measured(frames: Frames) -> PatchMeans:
        chart, white, dark = (mosaic(samples) for samples in (frames.chart, frames.white, frames.dark))
        return measure_patches(chart, frames.pose, white=white, dark=dark)

    even, shaded = shoot(Scene(size=SIZE, fill=0.5, tilt=20)), shoot(Scene(size=SIZE, tilt=15, vignetting=0.3))
    got, signals = measured(even), normalise([measured(shaded)], CLASSIC)
    truths = (even.levels, even.white_levels, np.full(3, Sensor().black))
    of_means = [
        (f.mean - t) / f.standard_error for f, t in zip((got.chart, got.white, got.dark), truths, strict=True)
    ]
    for z in (np.array(of_means), (signals.values[0] - shaded.signals) / signals.standard_error[0]):
        assert np.std(z) == pytest.approx(1, abs=0.2)
        assert np.abs(z).max() < 4.5
