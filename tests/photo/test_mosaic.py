"""read_dng against LibRaw, tifffile and files written byte by byte; DNGs as other writers make them."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rawpy
import tifffile
from numpy.typing import NDArray

from camssf.errors import CalibrationError, ChartNotFound, RawError, UnreadableRaw, UnsupportedRaw
from camssf.photo.find.pose import find_chart
from camssf.photo.read.dng import Mosaic, read_dng
from camssf.photo.read.pieces import MAX_SAMPLES
from camssf_lab.simulation.scene import Scene
from golden.forms import ROOT
from tests.support import scenes
from tests.support.dngs import BAD_PIXELS, DEFLATE, GAIN_MAP, LONG, RATIONAL, SHORT, SRATIONAL, Dng, Tags, opcode_list
from tests.support.processes import memory_below

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


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("area", [None, (4, 6, 60, 90), (3, 5, 62, 92)])
def test_colours_levels_and_active_area_are_libraws(tmp_path: Path, order: str, area: tuple[int, ...] | None) -> None:
    samples = noise()
    tags: Tags = {50713: (SHORT, [2, 2]), 50714: (SHORT, [210, 220, 230, 240]), 50717: (LONG, [15000])}
    tags |= {50829: (LONG, area)} if area else {}
    path = write(tmp_path, Dng(samples, cfa=bytes(ORDERS[order]), tags=tags))
    found = read_dng(path)
    top, left, bottom, right = area or (0, 0, *samples.shape)
    assert found.cfa == order
    np.testing.assert_array_equal(found.samples, samples[top:bottom, left:right])
    with rawpy.imread(str(path)) as raw:
        colours = np.array([0, 1, 2, 1], np.uint8)[raw.raw_colors]
        corner = raw.sizes.top_margin, raw.sizes.left_margin
        np.testing.assert_array_equal(raw.raw_image, samples)
        np.testing.assert_array_equal(np.array(raw.black_level_per_channel)[raw.raw_pattern], found.black)
        assert raw.white_level == found.white
        if top % 2 == left % 2 == 0:
            np.testing.assert_array_equal(found.samples, raw.raw_image_visible)
    # LibRaw rounds an odd corner up to an even one; its colours there tell what lies at the true corner
    assert corner == (top + top % 2, left + left % 2)
    mine = np.array([["RGB".index(letter) for letter in order[:2]], ["RGB".index(letter) for letter in order[2:]]])
    np.testing.assert_array_equal(np.tile(mine, (8, 8)), colours[top : top + 16, left : left + 16])


def test_what_the_file_leaves_out(tmp_path: Path) -> None:
    first = {271: None, 272: None, 33434: (RATIONAL, [0, 1000]), 34855: (SHORT, [0])}
    found = read(tmp_path, samples=noise(), first=first, tags={51009: opcode_list(BAD_PIXELS)})
    assert (found.make, found.model, found.orientation) == ("", "Maker Model 1", 1)
    assert found.unique_model == "Maker Model 1"
    assert read(tmp_path, samples=noise(), first={50708: None}).unique_model == ""
    assert (found.exposure, found.iso, found.gain_map) == (None, None, False)
    assert found.color_matrix1 is found.color_matrix2 is found.as_shot_neutral is None
    assert read(tmp_path, samples=noise() // 64, bits=10, tags={50717: None}).white == 1023


def of(**dng: Any) -> bytes:
    return Dng(noise(), **dng).encode()


def tagged(*, kind: int, tag: int, value: Any) -> bytes:
    return of(tags={tag: (kind, value)})


REFUSED: dict[str, tuple[bytes, type[RawError], str]] = {
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
    with pytest.raises(CalibrationError, match=words) as caught:
        read_dng(path)
    assert type(caught.value) is kind
    assert str(path) in caught.value.message
    assert caught.value.advice


@pytest.mark.parametrize(
    ("name", "words"), [("a claim of 23,000 x 23,000", "too short"), ("one tile for all", "overlap")]
)
def test_a_small_file_asks_for_little_memory(
    name: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Refused before LibRaw, whose memory is not counted, reads any of it."""
    content = (ROOT / "dng" / "error-jpeg-claim.dng").read_bytes()
    if name == "one tile for all":
        count = 1600
        tags: Tags = {256: (LONG, [256 * 40]), 257: (LONG, [256 * 40])}
        tags |= {322: (LONG, [256]), 323: (LONG, [256])} | dict.fromkeys((273, 278, 279))
        tags |= {324: (LONG, [8] * count), 325: (LONG, [2 * 256 * 256] * count)}
        content = Dng(noise(256, 256), tags=tags).encode()
    path = write(tmp_path, content)
    monkeypatch.delattr(rawpy, "imread")
    with memory_below(50_000_000), pytest.raises(UnreadableRaw, match=words):
        read_dng(path)


def test_folder_missing_file_and_forbidden_names(tmp_path: Path) -> None:
    for place, words in ((tmp_path, "folder"), (tmp_path / "none.dng", "no file"), (f"{tmp_path}/a\0b.dng", None)):
        with pytest.raises(UnreadableRaw, match=words):
            read_dng(place)


def test_truncated_anywhere(tmp_path: Path) -> None:
    area = {50829: (LONG, [4, 6, 60, 90]), 50713: (SHORT, [2, 2]), 50714: (SHORT, [10, 20, 30, 40])}
    rich = area | {51009: opcode_list(GAIN_MAP, BAD_PIXELS), 50712: (SHORT, list(range(512)))}
    content = Dng(noise(), order=">", sub=True, tags=rich, exif={33434: (RATIONAL, [1, 50])}).encode()
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


PLACEHOLDER = [19549, -7877, -2582, -5724, 10121, 1917, -1267, -110, 6621]
DISPLAY = [32406, -15372, -4986, -9689, 18758, 415, 557, -2040, 10570]
ANOTHER = [7838, -2177, -840, -4786, 12913, 1437, -855, 2016, 4163]
SOUND = [9599, -1936, -1469, -6018, 14024, 1557, -3651, 5602, 6610]
NEUTRAL = [6059, 10000, 1, 1, 8591, 10000]


def test_dense_rows_before_other_data_are_not_padded(tmp_path: Path) -> None:
    """The count of 12-bit samples as if they had 16, and as many bytes behind them: LibRaw reads the same."""
    samples = noise(120, 160, bits=12)
    padded = np.vstack([samples, noise(40, 160, bits=12, seed=1)])
    dng = Dng(padded, bits=12, tags={257: (LONG, [120]), 278: (LONG, [120]), 279: (LONG, [120 * 160 * 2])})
    path = write(tmp_path, dng)
    np.testing.assert_array_equal(read_dng(path).samples, samples)
    with rawpy.imread(str(path)) as raw:
        np.testing.assert_array_equal(raw.raw_image_visible, samples)


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
    command = [sys.executable, "-c", code, "patches", str(path), "--lamp", "D55"]
    done = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "\nstatus 4 " in done
    (kilobytes,) = re.findall(r"VmHWM:\s+(\d+) kB", done)
    assert int(kilobytes) * 1024 < 2 * rows * columns + 350e6


LEFT_OUT = "ColorMatrix1 was left out: it gives a white under D65 whose red is 1.17 of its green, as no sensor's is"
NO_LAMP = "the colour matrices were left out: with them AsShotNeutral is the white of no lamp"
EQUAL = [1, 1] * 3


WHATEVER_THE_NEUTRAL = (
    (PLACEHOLDER, 21, None, LEFT_OUT),  # also a word of Kotlin's TagsTest
    (DISPLAY, 21, None, "whose red is 1.00"),
    (PLACEHOLDER, 17, None, "whose red is 2.8"),
    (SOUND, 21, "D65", ""),
)


@pytest.mark.parametrize(
    ("matrix", "code", "light", "words", "neutral"),
    [
        *((*row, neutral) for row in WHATEVER_THE_NEUTRAL for neutral in (NEUTRAL, EQUAL, None)),
        (ANOTHER, 21, None, NO_LAMP, NEUTRAL),
        (ANOTHER, 21, "D65", "", EQUAL),  # says nothing
        *((SOUND, code, light, "", None) for code, light in ((1, "D55"), (3, "A"), (11, "D75"), (23, "D50"))),
        *((SOUND, n, None, f"made for light source {n or 0}, whose", None) for n in (None, 2, 24, 255, 4711)),
    ],
)
def test_matrices_that_no_camera_or_lamp_has_are_left_out(
    matrix: list[int], code: int | None, light: str | None, words: str, neutral: list[int] | None, tmp_path: Path
) -> None:
    first: Tags = {50721: (SRATIONAL, [part for value in matrix for part in (value, 10_000)])}
    first |= {50728: neutral and (RATIONAL, neutral), 50778: code and (SHORT, [code])}
    found = read(tmp_path, samples=noise(), first=first)
    assert [each.light for each in found.colour_matrices] == ([light] if light else [])
    assert words in found.matrices_left_out
    assert bool(words) == bool(found.matrices_left_out)


def test_damage_outside_the_part_that_is_asked_for(tmp_path: Path) -> None:
    """Tiles of 16 × 24; the second of the first row is damaged."""
    sound = ROOT / "dng" / "jpeg-tiles.dng"
    samples = read_dng(sound).samples
    with tifffile.TiffFile(sound) as tiff:
        at = tiff.pages[0].dataoffsets[1] + 60
    content = sound.read_bytes()
    path = write(tmp_path, content[:at] + b"\xfe" * 8 + content[at + 8 :])
    with pytest.raises(UnreadableRaw):
        read_dng(path)
    part = (4, 2, 30, 22)
    found = read_dng(path, part).samples
    np.testing.assert_array_equal(found[4:30, 2:22], samples[4:30, 2:22])
    assert found.sum() == samples[4:30, 2:22].sum()
    rest = read_dng(path, part, rest=True).samples
    lost = np.zeros(samples.shape, bool)
    lost[:16, 24:48] = True
    np.testing.assert_array_equal(rest, np.where(lost, 0, samples))
    with pytest.raises(UnreadableRaw):
        read_dng(path, (4, 2, 30, 25), rest=True)
    np.testing.assert_array_equal(read_dng(sound, part, rest=True).samples, samples)
    np.testing.assert_array_equal(read_dng(sound, (-9, -9, 999, 999)).samples, samples)


def test_wrong_colour_filters_are_named_with_corners_by_hand_too() -> None:
    frames = scenes.shoot(Scene(size=(900, 675)))
    photo = scenes.mosaic(frames.chart, cfa="GRBG")
    for by_hand in (None, frames.pose.corners):
        with pytest.raises(ChartNotFound) as caught:
            find_chart(photo, scenes.table(), corners=by_hand)
        assert "colour filters" in caught.value.advice
        assert "quad Bayer" in caught.value.advice
