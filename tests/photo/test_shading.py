"""Lens shading from the photo's own gain maps: judged by maps computed by hand, and by a photo without shading."""

import struct
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from camssf.errors import InvalidArgument, UnreadableRaw, UnsupportedRaw
from camssf.photo.find.pose import Pose
from camssf.photo.patches import measure_patches
from camssf.photo.read.dng import Mosaic, read_dng, shading
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import Scene
from golden.dngs import RATIONAL, SHORT, Dng, gain_map, opcode_list
from tests.support.captures import photos
from tests.support.scenes import mosaic, shoot

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
PATCH = Pose("classic24", np.zeros((4, 2)), np.array([10.0 + 80 * SQUARE]), 0, "by hand", 1.0, ())
"""Its centre is (50, 50)."""


def noise(height: int = 120, width: int = 120) -> np.ndarray:
    return np.random.default_rng(5).integers(900, 4000, (height, width)).astype(np.uint16)


def read(folder: Path, samples: np.ndarray, *opcodes: bytes, tag: int = 51009, **dng: Any) -> Mosaic:
    path = folder / "x.dng"
    path.write_bytes(Dng(samples, tags={tag: opcode_list(*opcodes)}, **dng).encode())
    return read_dng(path)


def test_bilinear_by_hand(tmp_path: Path) -> None:
    """100 × 200 px, a net of 2 × 3 points at 0, 1 and 0, 1/2, 1: at row 24.5, column 49.5 a quarter of each span."""
    whole = (0, 0, 100, 200)
    photo = read(tmp_path, noise(100, 200), gain_map([[1, 2, 4], [3, 5, 9]], whole, spacing=(1.0, 0.5)))
    first, second = 1 + 0.25 * (3 - 1), 2 + 0.25 * (5 - 2)
    np.testing.assert_allclose(shading(photo, 49.5, 24.5), first + 0.5 * (second - first), rtol=1e-15)
    # the first sample's centre lies half a pixel inside; beyond the outermost points the map is constant
    first, second = 1 + 0.005 * (3 - 1), 2 + 0.005 * (5 - 2)
    np.testing.assert_allclose(shading(photo, 0, 0), first + 0.005 * (second - first), rtol=1e-15)
    inner = read(
        tmp_path, noise(100, 200), gain_map([[1, 2], [3, 4]], whole, spacing=(0.5, 0.5), origin=(0.25, 0.25))
    )
    corners = [shading(inner, x, y)[0, 0] for y in (0, 99) for x in (0, 199)]
    assert corners == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("opcode", "tag"),
    [(gain_map([[2.0]], (0, 0, 120, 120)), 51008), (gain_map([[2.0]], (0, 0, 120, 120), (4, 4)), 51009)],
)
def test_maps_that_cannot_be_applied(tmp_path: Path, opcode: bytes, tag: int) -> None:
    photo = read(tmp_path, noise(), opcode, tag=tag)
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
        read(tmp_path, noise(), opcode)


def test_what_is_asked_for_must_exist() -> None:
    with pytest.raises(InvalidArgument, match="no lens-shading map"):
        measure_patches(mosaic(noise()), PATCH, lens_shading="apply")
    with pytest.raises(InvalidArgument, match="as-stored or apply"):
        measure_patches(mosaic(noise()), PATCH, lens_shading="yes")


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
