"""Raw files that are no DNG: by LibRaw's word, or by a sidecar's; and what is refused. Error codes explained."""

import hashlib
import json
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import rawpy
import tifffile

from camssf import Options, Result, calibrate
from camssf.cli import main
from camssf.documents import forms
from camssf.documents.document import document_bytes
from camssf.error_codes import as_text, codes, explain_code
from camssf.errors import BY_CODE, CalibrationError, InvalidArgument, NotSensorRaw, UnreadableRaw, UnsupportedRaw
from camssf.photo.read.dng import CFA_ORDERS, read_dng
from camssf.photo.read.raw import read_raw
from camssf.photo.read.unit import photo_hash, read_unit
from camssf.photo.shot import Shot
from camssf.rules import rules
from camssf.spectra import read_lamp
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene

ROOT = Path(__file__).parents[2]
ACME = ("Acme", "Model 1")
"""A maker that LibRaw knows nothing of: it takes 0 for black and 65535 for white."""


def write_raw(path: Path, samples: np.ndarray, cfa: str = "RGGB", maker: tuple[str, str] = ACME) -> Path:
    """A TIFF raw file such as makers write: the mosaic under its own tags, and no word of DNG."""
    filters = bytes("RGB".index(letter) for letter in cfa)
    tags = [
        *((271 + i, 2, 0, word, True) for i, word in enumerate(maker)), (274, 3, 1, 6, True),
        (33421, 3, 2, (2, 2), True), (33422, 1, 4, filters, True), (33434, 5, 1, (1, 60), True),
    ]  # fmt: skip
    tifffile.imwrite(path, samples, photometric="cfa", metadata=None, extratags=tags, rowsperstrip=len(samples))
    return path


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Chart and white frame as DNG, as another maker's raw file, and as PNG with a sidecar."""
    folder = tmp_path_factory.mktemp("field")
    sensor = Sensor(black=0.0, white_level=65535, cfa="GBRG")
    shot = simulate("Nikon 5100 (NPL)", "D55", folder, scene=Scene(size=(900, 675)), sensor=sensor).shots[0]
    for name, path in (("chart", shot.chart), ("white", shot.white)):
        samples = read_dng(path).samples
        write_raw(folder / f"{name}.nef", samples, "GBRG")
        cv2.imwrite(str(folder / f"{name}.png"), samples)
        (folder / f"{name}.png.json").write_text(json.dumps(SOUND | {"cfa": "GBRG"}))
    return folder


SOUND: dict[str, Any] = {
    "format": "camssf-mosaic/1", "cfa": "RGGB", "black": 0, "white": 65535, "make": "Acme", "model": "Model 1",
}  # fmt: skip


@cache
def solved(folder: Path, ending: str) -> Result:
    return calibrate(
        # A lamp, not its name: a name is weighed by the colour matrices that the DNG alone has.
        Shot(folder / f"chart.{ending}", read_lamp("D55"), white=folder / f"white.{ending}"),
        options=Options(basis="cameras"),
    )


# -- what LibRaw decodes --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cfa", CFA_ORDERS)
def test_another_maker_s_raw_file_is_read_by_libraw(cfa: str, tmp_path: Path) -> None:
    samples = np.random.default_rng(1).integers(100, 60_000, (200, 300)).astype(np.uint16)
    path = write_raw(tmp_path / "a.nef", samples, cfa)
    with pytest.raises(UnsupportedRaw, match=r"is a raw file, but no DNG"):
        read_dng(path)
    found = read_raw(path)
    assert np.array_equal(found.samples, samples)
    assert (found.cfa, found.white, found.make, found.model) == (cfa, 65535.0, *ACME)
    assert (found.black == 0).all()
    assert (found.orientation, found.exposure) == (6, pytest.approx(1 / 60))
    assert found.levels.startswith("LibRaw 0.")
    assert re.fullmatch("[0-9a-f]{64}", found.sha256)


def test_a_known_camera_has_its_levels_and_its_white(tmp_path: Path) -> None:
    samples = np.random.default_rng(1).integers(100, 15_000, (200, 300)).astype(np.uint16)
    found = read_raw(write_raw(tmp_path / "a.arw", samples, maker=("SONY", "ILCE-7M3")))
    assert found.white == 16383
    (matrix,) = found.colour_matrices
    red, green, blue = matrix.white
    assert matrix.light == "D65"
    assert 0.3 < red < green == 1.0  # red and blue of a camera under daylight are less than green
    assert 0.3 < blue < green


def test_black_levels_stand_in_their_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """LibRaw numbers the second green 3; the mosaic wants levels by place."""
    path = pretended(monkeypatch, tmp_path, black_level_per_channel=[500, 510, 530, 520])
    assert read_raw(path).black.tolist() == [[500, 510], [520, 530]]


@pytest.mark.full
@pytest.mark.parametrize("ending", ["nef", "png"])
def test_the_same_samples_give_the_same_curves_and_an_assumption_more(field: Path, ending: str) -> None:
    dng, other = solved(field, "dng"), solved(field, ending)
    assert np.abs(dng.curves - other.curves).max() < 1e-9
    assert [assumption.code for assumption in dng.assumptions].count("raw_levels") == 0
    said = [assumption.message for assumption in other.assumptions if assumption.code == "raw_levels"]
    whose = ["LibRaw"] if ending == "nef" else [f"chart.{ending}.json", f"white.{ending}.json"]
    assert all(words in message for words, message in zip(whose, said, strict=True))
    data = document_bytes(other)
    assert document_bytes(forms.read(data, Result, "test", "")) == data


# -- what LibRaw decodes and we do not take -------------------------------------------------------------------------


def pretended(monkeypatch: pytest.MonkeyPatch, folder: Path, **words: Any) -> Path:
    """LibRaw as it answers of files that no test here can have: what it says of a sound file, but for some words."""

    class Other(rawpy.RawPy):  # type: ignore[misc]
        def __getattribute__(self, name: str) -> Any:
            return words[name] if name in words else super().__getattribute__(name)

    monkeypatch.setattr(rawpy, "RawPy", Other)
    return write_raw(folder / "a.raf", np.full((40, 60), 9000, np.uint16))


@pytest.mark.parametrize(
    ("words", "kind", "said"),
    [
        ({"raw_pattern": np.zeros((6, 6), np.uint8)}, UnsupportedRaw, r"X-Trans or another, 6 × 6"),
        ({"raw_pattern": None}, UnsupportedRaw, "no Bayer pattern"),
        ({"raw_type": rawpy.RawType.Stack}, NotSensorRaw, "sRAW"),
        ({"raw_image_visible": None}, NotSensorRaw, "several colours a pixel"),
        ({"color_desc": b"RGBE"}, UnsupportedRaw, "colour filters RGEB"),
        ({"black_level_per_channel": [70_000] * 4}, UnsupportedRaw, "black at 70000"),
        ({"white_level": 2000}, UnsupportedRaw, "far above the white level"),
        ({"sizes": SimpleNamespace(raw_width=65_535, raw_height=65_535)}, UnsupportedRaw, "65535 × 65535"),
    ],
)
def test_what_is_not_bayer_or_not_sound_is_refused(
    words: dict[str, Any], kind: type[CalibrationError], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(kind, match=said) as caught:
        read_raw(pretended(monkeypatch, tmp_path, **words))
    assert caught.value.advice


def test_damaged_and_unknown_files_are_refused(tmp_path: Path) -> None:
    path = write_raw(tmp_path / "a.nef", np.full((200, 300), 9000, np.uint16))
    data = path.read_bytes()
    for length in (len(data) // 2, len(data) - 100):
        path.write_bytes(data[:length])
        with pytest.raises(UnreadableRaw):
            read_raw(path)
    (tmp_path / "b.cr3").write_bytes(b"\0\0\0\x18ftypcrx \0\0\0\x01" + bytes(500))
    with pytest.raises(UnsupportedRaw, match=r"not a DNG, and LibRaw [\d.]+ does not support") as caught:
        read_raw(tmp_path / "b.cr3")
    assert "DNG converter" in caught.value.advice
    (tmp_path / "c.nef").write_bytes(b"")
    (tmp_path / "d.jpg").write_bytes(b"\xff\xd8\xff\xe0" + bytes(100))
    for place in (tmp_path / "c.nef", tmp_path / "d.jpg", tmp_path / "nothing.nef", tmp_path, "/", "."):
        with pytest.raises(UnreadableRaw):
            read_raw(place)


# -- pictures with a sidecar ----------------------------------------------------------------------------------------


PLAIN = np.full((40, 60), 9000, np.uint16)


def picture(folder: Path, sidecar: Any, name: str = "a.png", samples: np.ndarray = PLAIN) -> Path:
    path = folder / name
    if name.endswith("png"):
        cv2.imwrite(str(path), samples)
    else:
        tifffile.imwrite(path, samples, photometric="minisblack", metadata=None)
    path.with_name(f"{name}.json").write_text(sidecar if isinstance(sidecar, str) else json.dumps(sidecar))
    return path


def test_a_sidecar_says_levels_for_each_place_and_what_else_is_known(tmp_path: Path) -> None:
    sidecar = SOUND | {"black": [[1, 2], [3, 4]], "exposure": 0.01, "iso": 50, "orientation": 8}
    found = read_raw(picture(tmp_path, sidecar))
    assert found.black.tolist() == [[1, 2], [3, 4]]
    assert (found.exposure, found.iso, found.orientation) == (0.01, 50, 8)
    assert found.levels == "the sidecar a.png.json"
    assert found.sha256 == photo_hash(tmp_path / "a.png")
    small = read_raw(picture(tmp_path, SOUND | {"white": 255}, "b.png", np.full((40, 60), 90, np.uint8)))
    assert small.samples.dtype == np.uint16
    assert (small.samples == 90).all()


def test_the_hash_is_of_picture_and_sidecar_together(tmp_path: Path) -> None:
    """`cat photo.png photo.png.json | sha256sum`: other levels are another photo."""
    seen = set()
    for name in ("a.png", "a.tif"):
        for black in (512, 513):
            path = picture(tmp_path, SOUND | {"black": black}, name)
            found = read_raw(path).sha256
            both = path.read_bytes() + (tmp_path / f"{name}.json").read_bytes()
            assert found == photo_hash(path) == hashlib.sha256(both).hexdigest()
            seen.add(found)
    assert len(seen) == 4
    assert read_unit(tmp_path / "a.tif").sha256 in seen  # as a passport asks
    (tmp_path / "a.png.json").rename(tmp_path / "a.dng.json")
    assert photo_hash(tmp_path / "a.png") == hashlib.sha256((tmp_path / "a.png").read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ("", "cannot be read"),
        ("[]", "no camssf-mosaic/1"),
        (json.dumps(SOUND)[:-1] + ', "black": 3}', "a key stands twice"),
        ({"format": "camssf-mosaic/1"}, "needs cfa, black and white"),
        (SOUND | {"gamma": 2.2}, "knows no other keys"),
        (SOUND | {"cfa": "RGBG"}, "cfa must be"),
        (SOUND | {"black": [1, 2, 3, 4]}, "black must be"),
        (SOUND | {"white": 0}, "white must be"),
        (SOUND | {"iso": -1}, "iso must be"),
        (SOUND | {"make": 5}, "make must be"),
        (SOUND | {"orientation": 9}, "orientation must be"),
    ],
)
def test_a_sidecar_that_is_none_is_refused(told: Any, said: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match=said):
        read_raw(picture(tmp_path, told))


THREE = np.full((40, 60, 3), 9000, np.uint16)


def other_tiff(path: Path, samples: np.ndarray, photometric: str) -> None:
    tifffile.imwrite(path, samples, photometric=photometric, metadata=None)


Damage = Callable[[Path], object]
NO_MOSAIC: dict[str, tuple[str, Damage, type[CalibrationError], str | None]] = {
    "colours of a PNG": ("a.png", lambda path: cv2.imwrite(str(path), THREE), NotSensorRaw, None),
    "signed": ("a.tif", lambda path: other_tiff(path, np.int16(PLAIN), "minisblack"), NotSensorRaw, "int16"),
    "above white": ("a.png", lambda path: picture(path.parent, SOUND | {"white": 1000}), UnsupportedRaw, "far above"),
    "cut": ("a.png", lambda path: path.write_bytes(path.read_bytes()[:60]), CalibrationError, None),
    "huge": (
        "a.png",
        lambda path: path.write_bytes(path.read_bytes()[:16] + (60_000).to_bytes(4) * 2 + path.read_bytes()[24:]),
        UnsupportedRaw, "60000 × 60000",
    ),
    "a PNG alone": ("a.png", lambda path: path.with_name("a.png.json").unlink(), UnsupportedRaw, "sidecar a."),
    "a TIFF alone": ("a.tif", lambda path: path.with_name("a.tif.json").unlink(), UnreadableRaw, "a TIFF pic"),
    "two pages": ("a.tif", lambda path: other_tiff(path, [PLAIN] * 2, "minisblack"), NotSensorRaw, "2 pages"),
    "a negative": ("a.tif", lambda path: other_tiff(path, PLAIN, "miniswhite"), UnsupportedRaw, "negative"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "damage", "kind", "said"), NO_MOSAIC.values(), ids=NO_MOSAIC)
def test_a_picture_that_is_no_mosaic_is_refused(
    name: str, damage: Damage, kind: type[CalibrationError], said: str | None, tmp_path: Path
) -> None:
    path = picture(tmp_path, SOUND, name)
    damage(path)
    with pytest.raises(kind, match=said):
        read_raw(path)


# -- error codes ----------------------------------------------------------------------------------------------------


def test_every_code_is_explained_and_has_its_page() -> None:
    table = json.loads((ROOT / "reference" / "camssf" / "data" / "errors.json").read_text("utf-8"))
    assert set(codes()) == set(BY_CODE) == set(table["codes"])
    for code, kind in BY_CODE.items():
        found = explain_code(code)
        assert found.exit_status == kind.exit_status
        assert all((found.means, found.causes, found.do)), code
        assert all((ROOT / "docs" / page).is_file() for page in found.see)
    said = {reason.name for code in codes() for reason in explain_code(code).reasons}
    assert said == set(rules().reasons)


def test_explain_prints_what_to_do(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "Uneven-Light"]) == 0
    said = capsys.readouterr().out
    assert said == as_text(explain_code("uneven_light")) + "\n"
    assert "exit status 5" in said
    assert "1. Take a white frame" in said
    assert "doubtful above" in said
    assert main(["explain"]) == 0
    assert capsys.readouterr().out.split() == list(codes())
    assert main(["explain", "glair"]) == InvalidArgument.exit_status
    assert "Did you mean glare?" in capsys.readouterr().err
