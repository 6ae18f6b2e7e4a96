"""read_dng against LibRaw, tifffile and files written byte by byte."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rawpy
import tifffile
from numpy.typing import NDArray

from camssf.errors import CalibrationError, RawError, UnreadableRaw, UnsupportedRaw
from camssf.photo.read.dng import Mosaic, read_dng
from golden.dngs import BAD_PIXELS, GAIN_MAP, LONG, RATIONAL, SHORT, Dng, Tags, opcode_list
from golden.forms import ROOT
from tests.support.processes import SEARCH

pytestmark = pytest.mark.requirement("R-SAMPLES")

REAL = Path(__file__).parents[2] / "data" / "dng"
ORDERS = {"RGGB": (0, 1, 1, 2), "GRBG": (1, 0, 2, 1), "GBRG": (1, 2, 0, 1), "BGGR": (2, 1, 1, 0)}


def noise(height: int = 64, width: int = 96, bits: int = 16, seed: int = 0) -> NDArray[np.uint16]:
    return np.random.default_rng(seed).integers(0, 2**bits, (height, width), dtype=np.uint16)


def write(folder: Path, dng: Dng | bytes, name: str = "photo.dng") -> Path:
    path = folder / name
    path.write_bytes(dng if isinstance(dng, bytes) else dng.encode())
    return path


def read(folder: Path, **dng: Any) -> Mosaic:
    return read_dng(write(folder, Dng(**dng)))


def libraw_colours(path: Path) -> tuple[NDArray[np.uint16], NDArray[np.uint8], tuple[int, int]]:
    """LibRaw's whole picture, the colour 0, 1, 2 of its every sample, and the active area's corner."""
    with rawpy.imread(str(path)) as raw:
        corner = raw.sizes.top_margin, raw.sizes.left_margin
        return raw.raw_image.copy(), np.array([0, 1, 2, 1], np.uint8)[raw.raw_colors], corner


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("area", [None, (4, 6, 60, 90), (3, 5, 62, 92)])
def test_colours_and_active_area_are_libraws(tmp_path: Path, order: str, area: tuple[int, ...] | None) -> None:
    samples = noise()
    path = write(tmp_path, Dng(samples, cfa=bytes(ORDERS[order]), tags={50829: (LONG, area)} if area else {}))
    found = read_dng(path)
    top, left, bottom, right = area or (0, 0, *samples.shape)
    assert found.cfa == order
    np.testing.assert_array_equal(found.samples, samples[top:bottom, left:right])
    stored, colours, corner = libraw_colours(path)
    np.testing.assert_array_equal(stored, samples)
    # LibRaw rounds an odd corner up to an even one; its colours there tell what lies at the true corner
    assert corner == (top + top % 2, left + left % 2)
    mine = np.array([["RGB".index(letter) for letter in order[:2]], ["RGB".index(letter) for letter in order[2:]]])
    np.testing.assert_array_equal(np.tile(mine, (8, 8)), colours[top : top + 16, left : left + 16])
    if top % 2 == left % 2 == 0:
        with rawpy.imread(str(path)) as raw:
            np.testing.assert_array_equal(found.samples, raw.raw_image_visible)


@pytest.mark.parametrize("order", ORDERS)
def test_black_and_white_level_are_libraws(tmp_path: Path, order: str) -> None:
    tags = {50713: (SHORT, [2, 2]), 50714: (SHORT, [210, 220, 230, 240]), 50717: (LONG, [15000])}
    path = write(tmp_path, Dng(noise(), cfa=bytes(ORDERS[order]), tags=tags))
    found = read_dng(path)
    with rawpy.imread(str(path)) as raw:
        assert raw.white_level == found.white
        np.testing.assert_array_equal(np.array(raw.black_level_per_channel)[raw.raw_pattern], found.black)


def test_what_the_file_leaves_out(tmp_path: Path) -> None:
    first = {271: None, 272: None, 33434: (RATIONAL, [0, 1000]), 34855: (SHORT, [0])}
    found = read(tmp_path, samples=noise(), first=first, tags={51009: opcode_list(BAD_PIXELS)})
    assert (found.make, found.model, found.orientation) == ("", "Maker Model 1", 1)
    assert found.unique_model == "Maker Model 1"
    assert read(tmp_path, samples=noise(), first={50708: None}).unique_model == ""
    assert (found.exposure, found.iso, found.gain_map) == (None, None, False)
    assert found.color_matrix1 is found.color_matrix2 is found.as_shot_neutral is None


def of(**dng: Any) -> bytes:
    return Dng(noise(), **dng).encode()


def tagged(*, kind: int, tag: int, value: Any) -> bytes:
    return of(tags={tag: (kind, value)})


REFUSED: dict[str, tuple[bytes, type[RawError], str]] = {
    "text": (b"not a photo at all, just words", UnreadableRaw, "not a DNG"),
    "JPEG": (b"\xff\xd8\xff\xe0\0\x10JFIF\0" + b"\0" * 90, UnreadableRaw, "not a DNG"),
    "PNG": (b"\x89PNG\r\n\x1a\n" + b"\0" * 90, UnreadableRaw, "not a DNG"),
    "no directory": (b"II*\0" + b"\0" * 60, UnreadableRaw, "no directory"),
    "Fujifilm": (b"FUJIFILMCCD-RAW 0201" + b"\0" * 90, UnsupportedRaw, "no DNG"),
    "Canon CR2": (b"II*\0\x10\0\0\0CR\x02\0" + b"\0" * 90, UnsupportedRaw, "no DNG"),
    "Canon CR3": (b"\0\0\0\x18ftypcrx " + b"\0" * 90, UnsupportedRaw, "no DNG"),
    "Olympus": (b"IIRO\x08\0\0\0" + b"\0" * 90, UnsupportedRaw, "no DNG"),
    "Panasonic": (b"IIU\0\x18\0\0\0" + b"\0" * 90, UnsupportedRaw, "no DNG"),
    "TIFF picture": (of(first={50706: None}, tags={262: (SHORT, [1])}), UnreadableRaw, "TIFF picture"),
    "two reds": (of(cfa=bytes((0, 0, 1, 2))), UnsupportedRaw, "RRGB"),
    "area of three numbers": (tagged(tag=50829, kind=LONG, value=[0, 0, 9]), UnreadableRaw, "tag 50829"),
    "no width": (of(tags={256: None}), UnreadableRaw, "0 × 64"),
    "strips that overlap": (of(rows_per_strip=32, tags={273: (LONG, [8, 1000])}), UnreadableRaw, "too short"),
    "white 0": (tagged(tag=50717, kind=LONG, value=[0]), UnreadableRaw, "white level"),
    "table too long": (tagged(tag=50712, kind=SHORT, value=[1] * 65537), UnreadableRaw, "too many values"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(tmp_path: Path, name: str) -> None:
    content, kind, words = REFUSED[name]
    path = write(tmp_path, content)
    with pytest.raises(CalibrationError) as caught:
        read_dng(path)
    assert type(caught.value) is kind
    assert words in caught.value.message
    assert str(path) in caught.value.message
    assert caught.value.advice


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process is read as Linux tells it")
@pytest.mark.parametrize("name", ["a claim of 23,000 x 23,000", "one tile for all"])
def test_a_small_file_asks_for_little_memory(tmp_path: Path, name: str) -> None:
    """Refused before LibRaw makes room: the peak of a process of its own grows by less than 50 MB."""
    if name == "one tile for all":
        count = 1600
        tags: Tags = {256: (LONG, [256 * 40]), 257: (LONG, [256 * 40])}
        tags |= {324: (LONG, [8] * count), 325: (LONG, [2 * 256 * 256] * count)}
        content, words = Dng(noise(256, 256), tile=(256, 256), tags=tags).encode(), "overlap"
    else:
        content, words = (ROOT / "dng" / "error-jpeg-claim.dng").read_bytes(), "too short"
    path = write(tmp_path, content)
    code = (
        "import resource, sys\n"
        "import rawpy\n"
        "from camssf.errors import UnreadableRaw\n"
        "from camssf.photo.read.dng import read_dng\n"
        "def peak(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "before = peak()\n"
        "try: read_dng(sys.argv[1])\n"
        "except UnreadableRaw as error: print(peak() - before, error.message)\n"
    )
    environment = os.environ | {"PYTHONPATH": SEARCH}
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, env=environment, timeout=120, text=True
    )
    grown, _, message = done.stdout.partition(" ")
    assert words in message, done.stderr
    assert int(grown) < 50_000  # kB


def test_folder_missing_file_and_forbidden_names(tmp_path: Path) -> None:
    with pytest.raises(UnreadableRaw, match="folder"):
        read_dng(tmp_path)
    with pytest.raises(UnreadableRaw, match="no file"):
        read_dng(tmp_path / "none.dng")
    with pytest.raises(UnreadableRaw):
        read_dng(f"{tmp_path}/a\0b.dng")


def test_truncated_anywhere(tmp_path: Path) -> None:
    area = {50829: (LONG, [4, 6, 60, 90]), 50713: (SHORT, [2, 2]), 50714: (SHORT, [10, 20, 30, 40])}
    rich = area | {51009: opcode_list(GAIN_MAP, BAD_PIXELS), 50712: (SHORT, list(range(512)))}
    content = Dng(noise(), order=">", place="sub", tags=rich, exif={33434: (RATIONAL, [1, 50])}).encode()
    lengths = {*range(40), *range(len(content) - 400, len(content)), *range(40, len(content), 97)}
    whole = read_dng(write(tmp_path, content))
    for length in sorted(lengths):
        path = write(tmp_path, content[:length])
        try:
            found = read_dng(path)
        except UnreadableRaw:
            continue
        # only the writer's closing padding or an unused value may be missing
        assert length > len(content) - 20
        np.testing.assert_array_equal(found.samples, whole.samples)
        np.testing.assert_array_equal(found.black, whole.black)


@pytest.mark.parametrize(
    ("name", "cfa", "black", "white", "shape"),
    [
        ("colorchart.dng", "RGGB", 2056, 15000, (1156, 1734)),
        ("blackmagic_ljpeg.dng", "GBRG", 256, 51080, (1112, 1952)),
    ],
)
def test_real_files_against_libraw_and_tifffile(
    name: str, cfa: str, black: float, white: float, shape: tuple[int, int]
) -> None:
    path = REAL / name
    found = read_dng(path)
    assert (found.cfa, found.white, found.samples.shape) == (cfa, white, shape)
    assert (found.black == black).all()
    with rawpy.imread(str(path)) as raw:
        np.testing.assert_array_equal(found.samples, raw.raw_image_visible)
        assert raw.black_level_per_channel == [black] * 4
        assert raw.white_level == white
        assert "".join("RGBG"[code] for code in raw.raw_pattern.ravel()) == cfa
    with tifffile.TiffFile(path) as tiff:
        tags = tiff.pages[0].tags
        assert (tags[272].value if 272 in tags else tags[50708].value) == found.model
        for code, matrix in ((50721, found.color_matrix1), (50722, found.color_matrix2)):
            assert (code in tags) == (matrix is not None)
            if matrix is not None:
                parts = np.reshape(tags[code].value, (3, 3, 2))
                np.testing.assert_allclose(matrix, parts[..., 0] / parts[..., 1])
        parts = np.reshape(tags[50728].value, (3, 2))
        np.testing.assert_allclose(found.as_shot_neutral, parts[:, 0] / parts[:, 1])
    assert found.exposure is None  # both files write nothing, or 0
    assert not found.gain_map
