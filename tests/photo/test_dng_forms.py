"""DNGs as other writers make them: wrong byte counts, padded rows, required opcodes, placeholder matrices, bombs."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf.errors import ChartNotFound, UnreadableRaw, UnsupportedRaw
from camssf.photo.find.pose import find_chart
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.photo.read.pieces import MAX_SAMPLES
from golden.dngs import DEFLATE, JPEG, LONG, RATIONAL, SHORT, SRATIONAL, Dng, Tags
from golden.stages.mosaic import chaos, slope
from tests.support import scenes

pytestmark = pytest.mark.requirement("R-SAMPLES")

PLACEHOLDER = [19549, -7877, -2582, -5724, 10121, 1917, -1267, -110, 6621]
DISPLAY = [32406, -15372, -4986, -9689, 18758, 415, 557, -2040, 10570]
ANOTHER = [7838, -2177, -840, -4786, 12913, 1437, -855, 2016, 4163]
SOUND = [9599, -1936, -1469, -6018, 14024, 1557, -3651, 5602, 6610]
NEUTRAL = [6059, 10000, 1, 1, 8591, 10000]


def read(folder: Path, dng: Dng, **how: Any) -> Mosaic:
    path = folder / "photo.dng"
    path.write_bytes(dng.encode())
    return read_dng(path, **how)


def bomb(side: int) -> bytes:
    """A DNG that claims side × side samples in as many bytes as deflate needs at least."""
    tags: Tags = {tag: (LONG, [side]) for tag in (256, 257, 278)}
    size = len(Dng(np.zeros((2, 2), np.uint16), compression=DEFLATE, tags=tags).encode())
    dng = Dng(np.zeros((2, 2), np.uint16), compression=DEFLATE, tags=tags | {273: (LONG, [size])})
    return dng.encode() + bytes(side * side // 500)


def test_more_samples_than_a_photo_has_are_refused_before_decoding(tmp_path: Path) -> None:
    path = tmp_path / "bomb.dng"
    path.write_bytes(bomb(15_000))
    with pytest.raises(UnsupportedRaw, match="15000 × 15000 samples; camssf reads up to 220 million"):
        read_dng(path)
    path.write_bytes(bomb(14_000))  # allowed: 196 million; it is damaged
    with pytest.raises(UnreadableRaw, match="deflated samples"):
        read_dng(path)
    assert MAX_SAMPLES > 16_384 * 12_288  # phones' 200 megapixels


@pytest.mark.full
@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process is read as Linux tells it")
def test_the_memory_of_the_largest_photo(tmp_path: Path) -> None:
    """Flat, so it is small: two bytes a sample, and 350 MB, in which no chart is found."""
    rows, columns = 12_288, 16_384
    path = tmp_path / "flat.dng"
    path.write_bytes(Dng(np.full((rows, columns), 700, np.uint16), compression=DEFLATE, rows_per_strip=512).encode())
    code = (  # VmHWM: a child's ru_maxrss begins with that of the process that started it
        "import sys\nfrom pathlib import Path\nfrom camssf.cli import main\n"
        "status = main(sys.argv[1:])\nprint(f'\\nstatus {status}', Path('/proc/self/status').read_text())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "patches", str(path), "--lamp", "D55"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert "\nstatus 4 " in done
    (kilobytes,) = re.findall(r"VmHWM:\s+(\d+) kB", done)
    assert int(kilobytes) * 1024 < 2 * rows * columns + 350e6


def matrices(folder: Path, matrix: list[int], light: int | None, neutral: list[int] | None) -> Mosaic:
    values = [part for value in matrix for part in (value, 10_000)]
    first: Tags = {50721: (SRATIONAL, values), 50728: None if neutral is None else (RATIONAL, neutral)}
    return read(folder, Dng(chaos(16), first=first | {50778: None if light is None else (SHORT, [light])}))


@pytest.mark.parametrize("neutral", [NEUTRAL, [1, 1] * 3, None])
def test_a_matrix_that_no_camera_has_is_left_out(tmp_path: Path, neutral: list[int] | None) -> None:
    """The words are also those of Kotlin's TagsTest."""
    found = matrices(tmp_path, PLACEHOLDER, 21, neutral)
    assert found.colour_matrices == ()
    assert found.matrices_left_out == (
        "ColorMatrix1 was left out: it gives a white under D65 whose red is 1.17 of its green, as no sensor's is"
    )
    assert "whose red is 1.00" in matrices(tmp_path, DISPLAY, 21, neutral).matrices_left_out
    assert "whose red is 2.8" in matrices(tmp_path, PLACEHOLDER, 17, neutral).matrices_left_out
    sound = matrices(tmp_path, SOUND, 21, neutral)
    assert sound.matrices_left_out == ""
    assert len(sound.colour_matrices) == 1


def test_matrices_that_contradict_the_files_own_white_are_left_out(tmp_path: Path) -> None:
    found = matrices(tmp_path, ANOTHER, 21, NEUTRAL)
    assert found.colour_matrices == ()
    words = "the colour matrices were left out: with them AsShotNeutral is the white of no lamp"
    assert found.matrices_left_out == words
    assert matrices(tmp_path, ANOTHER, 21, [1, 1] * 3).matrices_left_out == ""  # says nothing


@pytest.mark.parametrize(
    ("code", "light"),
    [(1, "D55"), (3, "A"), (11, "D75"), (23, "D50")],
)
def test_the_illuminant_of_a_matrix(tmp_path: Path, code: int, light: str) -> None:
    (found,) = matrices(tmp_path, SOUND, code, None).colour_matrices
    assert found.light == light


@pytest.mark.parametrize("code", [None, 2, 24, 255, 4711])
def test_a_matrix_of_a_light_without_a_spectrum_is_left_out(tmp_path: Path, code: int | None) -> None:
    found = matrices(tmp_path, SOUND, code, None)
    assert found.colour_matrices == ()
    assert f"made for light source {code or 0}, whose spectrum" in found.matrices_left_out


def halves(damage: slice | None = None, compression: int = JPEG) -> bytes:
    """Two tiles side by side; the bytes of the second are damaged."""
    dng = Dng(slope(12), bits=12, compression=compression, tile=(40, 28))
    content, first = dng.encode(), len(dng.pieces()[0])
    if damage is None:
        return content
    return content[: 8 + first + 60] + b"\xfe" * 8 + content[8 + first + 68 :]


def test_damage_outside_the_part_that_is_asked_for(tmp_path: Path) -> None:
    path, samples = tmp_path / "photo.dng", slope(12)
    path.write_bytes(halves(slice(0)))
    with pytest.raises(UnreadableRaw):
        read_dng(path)
    part = (4, 2, 30, 26)
    found = read_dng(path, part).samples
    np.testing.assert_array_equal(found[4:30, 2:26], samples[4:30, 2:26])
    assert found.sum() == samples[4:30, 2:26].sum()
    rest = read_dng(path, part, rest=True).samples
    np.testing.assert_array_equal(rest[:, :28], samples[:, :28])
    assert not rest[:, 28:].any()
    with pytest.raises(UnreadableRaw):
        read_dng(path, (4, 2, 30, 29), rest=True)
    path.write_bytes(halves())
    np.testing.assert_array_equal(read_dng(path, part, rest=True).samples, samples)
    whole = read_dng(path, (-9, -9, 999, 999)).samples
    np.testing.assert_array_equal(whole, samples)


def test_wrong_colour_filters_are_named_with_corners_by_hand_too() -> None:
    frames = scenes.shoot()
    photo = scenes.mosaic(frames.chart, cfa="GRBG")
    corners = frames.pose.corners
    with pytest.raises(ChartNotFound) as sought:
        find_chart(photo, scenes.table())
    with pytest.raises(ChartNotFound) as by_hand:
        find_chart(photo, scenes.table(), corners=corners)
    for caught in (sought, by_hand):
        assert "colour filters" in caught.value.advice
        assert "quad Bayer" in caught.value.advice
