"""The manifest of a folder of photos named by camera and lamp."""

import csv
from pathlib import Path

import pytest

from camssf import cli
from camssf.errors import InvalidArgument
from camssf_fleet.manifest import Manifest
from camssf_fleet.manifest_maker import make_manifest


def shoot(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).write_text("photo")
    return folder


def made(folder: Path, *names: str) -> list[list[str]]:
    rows = make_manifest(shoot(folder, *names))
    header, *lines = csv.reader((folder / "manifest.csv").read_text("utf-8").splitlines())
    assert header == ["name", "photo", "lamp", "white", "dark", "chart", "serial"]
    assert rows == len(lines)
    return lines


def test_rows_of_a_unit_are_its_shots_with_their_frames(tmp_path: Path) -> None:
    names = ("S2_D65.dng", "S1_D55.DNG", "S1_d55_white.dng", "S1_A_2.dng", "S1_A_1.dng", "S1_A_dark.dng", "S1.txt")
    rows = made(tmp_path, *names)
    assert rows == [
        ["S1", "S1_A_1.dng", "A", "", "S1_A_dark.dng", "", "S1"],
        ["S1", "S1_A_2.dng", "A", "", "S1_A_dark.dng", "", "S1"],
        ["S1", "S1_D55.DNG", "D55", "S1_d55_white.dng", "", "", "S1"],
        ["S2", "S2_D65.dng", "D65", "", "", "", "S2"],
    ]
    one, two = Manifest(tmp_path / "manifest.csv")
    assert (one.lamps, two.lamps, one.unit.serial) == (("A", "A", "D55"), ("D65",), "S1")
    assert not one.fault
    assert not two.fault


@pytest.mark.parametrize(
    ("name", "unit", "lamp"), [
        ("Pixel 9_A1_B2_D65.dng", "Pixel 9_A1_B2", "D65"), ("A_D55_third try.dng", "A", "D55"),
        ("S1_D55_A.dng", "S1_D55", "A"),  # the last place where a lamp stands
        ("S1_led-b1.nef", "S1", "led-b1"), ("S1_FL1_2.dng", "S1", "FL1"), ("S1_auto.dng", "S1", "auto"),
        ("S1_my_lamp_2.dng", "S1", "my_lamp.csv"), ("S1_BENCH.dng", "S1", "bench.CSV"),
        ("S1_D65_Whitehall.dng", "S1", "D65"),
    ],
)  # fmt: skip
def test_a_name_is_a_unit_and_a_lamp(name: str, unit: str, lamp: str, tmp_path: Path) -> None:
    ((row),) = made(tmp_path, name, "my_lamp.csv", "bench.CSV", "d65.csv")
    assert row[:3] == [unit, name, lamp]


def test_a_picture_needs_its_sidecar_and_folders_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "S3_D55.dng").mkdir()
    rows = made(tmp_path, "S1_D55.png", "S1_D55.png.json", "S2_D55.png", "S2_D55.jpg")
    assert [row[1] for row in rows] == ["S1_D55.png"]


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["S1_D55.dng", "S2.dng"], "S2.dng does not name a lamp, as UNIT_LAMP.dng does"),
        (["S1_D55.dng", "_D55.dng"], "_D55.dng does not name a lamp"),
        (["S1_D55.dng", "white.dng"], "white.dng does not name a lamp"),
        (["S1_D55.dng", "S1_flash.dng"], "S1_flash.dng does not name a lamp"),
        (["S1_D55.dng", "S1_A_white.dng"], "a white frame, but S1 has no photo under A"),
        (["S1_D55.dng", "S1_D55_dark.dng", "S1_D55_2_dark.dng"], "a second dark frame of S1 under D55"),
        (["S1_D55.txt"], "has no photo of a chart"),
    ],
)
def test_a_photo_without_a_place_is_named_and_nothing_is_written(
    names: list[str], words: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidArgument, match=words):
        make_manifest(shoot(tmp_path, *names))
    assert not (tmp_path / "manifest.csv").exists()


def test_no_manifest_is_written_over(tmp_path: Path) -> None:
    (tmp_path / "manifest.csv").write_text("mine")
    with pytest.raises(InvalidArgument, match="was not changed"):
        make_manifest(shoot(tmp_path, "S1_D55.dng"))
    assert (tmp_path / "manifest.csv").read_text() == "mine"
    with pytest.raises(InvalidArgument, match="cannot be read"):
        make_manifest(tmp_path / "nowhere")


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shoot(tmp_path, "S1_D55.dng", "S2_D55.dng")
    folder = str(tmp_path)
    for words in (["batch"], ["batch", "m.csv", "--make-manifest", folder]):
        assert cli.main(words) == InvalidArgument.exit_status
    assert not (tmp_path / "manifest.csv").exists()
    capsys.readouterr()
    assert cli.main(["batch", "--make-manifest", folder]) == 0
    out, err = capsys.readouterr()
    assert not out
    assert "2 rows written to" in err
    assert cli.main(["batch", "--make-manifest", folder]) == InvalidArgument.exit_status
