"""What a newcomer does wrong, each as a command: what it says, what it exits with, and that it spoils nothing.

One row is one mistake. A command runs in a folder with the files of `home`; none of them may change. Apart from what
the row says is left, nothing may be there afterwards.
"""

from __future__ import annotations

import ast
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import tifffile
from PIL import Image

from camssf import cli
from camssf.documents.document import document_bytes
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_chart, read_lamp
from tests.support.captures import calibrated, photos


class Wrong(NamedTuple):
    """One mistake.

    Attributes:
        call: the command, without `camssf`.
        status: its exit status.
        object: what the message names: the wrong thing.
        step: what to do next, as the message says it.
        left: a folder with the report of a refusal.
    """

    call: str
    status: int
    object: str
    step: str
    left: str = ""


RAW = "Give the camera's RAW photo as DNG, not a picture."
AGAIN = "Copy the file from the camera again"
SEARCH = "Let the chart fill more of the frame"
POINTS = "Give four points x,y in pixels"
SHOT = "calibrate chart.dng --lamp D55 -o out"
AREA = "--region 190,170,40,40 --white-region 190,450,40,40"

INPUTS = [
    Wrong("calibrate chart.dgn --lamp D55 -o out", 3, "no file chart.dgn", "Check the path."),
    Wrong("calibrate '' --lamp D55 -o out", 2, "PHOTO is empty", "Give the path"),
    Wrong("calibrate folder --lamp D55 -o out", 3, "folder is a folder", "Name a file, not a folder."),
    Wrong("calibrate *.nef --lamp D55 -o out", 3, "no file *.nef", "Check the path."),
    Wrong(
        r"calibrate 'C:\Users\me\chart.dng' --lamp D55 -o out", 3, r"no file C:\Users\me\chart.dng", "Check the path."
    ),
    Wrong("calibrate https://a.org/b.dng --lamp D55 -o out", 2, "https://a.org/b.dng is a URL", "Copy it here first"),
    Wrong(f"calibrate {'a' * 300}.dng --lamp D55 -o out", 3, "File name too long", "Check the path"),
    Wrong("calibrate ch art.dng --lamp D55 -o out", 2, "2 photo(s) (ch, art.dng)", "quote a name with spaces"),
    Wrong("calibrate -chart.dng --lamp D55 -o out", 2, "No such option: -c", "--help"),
    Wrong("calibrate photo.jpg --lamp D55 -o out", 3, "photo.jpg is not a DNG file", RAW),
    Wrong("calibrate photo.heic --lamp D55 -o out", 3, "photo.heic is not a DNG file", RAW),
    Wrong("calibrate video.mp4 --lamp D55 -o out", 3, "video.mp4 is not a DNG file", RAW),
    Wrong("calibrate photos.zip --lamp D55 -o out", 3, "photos.zip is not a DNG file", RAW),
    Wrong("calibrate photo.png --lamp D55 -o out", 3, "photo.png is a picture", "write that sidecar"),
    Wrong("calibrate png.dng --lamp D55 -o out", 3, "png.dng is not a DNG file", RAW),
    Wrong("calibrate note.dng --lamp D55 -o out", 3, "note.dng is not a DNG file", RAW),
    Wrong("calibrate head.dng --lamp D55 -o out", 3, "head.dng", ""),
    Wrong("calibrate empty.dng --lamp D55 -o out", 3, "empty.dng is empty", AGAIN),
    Wrong("calibrate cut.dng --lamp D55 -o out", 3, "cut.dng is truncated", AGAIN),
    Wrong("calibrate linear.dng --lamp D55 -o out", 3, "linear.dng is a linear DNG", "plain RAW (DNG) mode"),
    Wrong("calibrate chart.dng chart.dng -o out", 2, "chart.dng was given 2 times", "Give each photo once"),
    Wrong(
        "calibrate chart.dng --white chart.dng --lamp D55 -o out",
        2,
        "The chart's photo and the white frame are the same photo",
        "Give another file for one of them",
    ),
    Wrong(
        "calibrate chart.dng --dark twin.dng -o out",
        2,
        "The chart's photo and the dark frame are the same photo",
        "Give another file for one of them",
    ),
    Wrong(
        "patches chart.dng --white white.dng --dark white.dng",
        2,
        "The white frame and the dark frame are the same photo",
        "Give another file for one of them",
    ),
    Wrong("calibrate chart.dng --white '' -o out", 2, "--white is empty", "Give the path"),
    Wrong("patches chart.dng --dark ' '", 2, "--dark is empty", "Give the path"),
    Wrong("solve none.json", 2, "none.json: No such file", "Check the path."),
    Wrong("report none.json -o out", 2, "none.json: No such file", "Check the path."),
    Wrong("batch none.csv -o out", 2, "none.csv cannot be read (No such file", "Check the path."),
    Wrong("batch truth.csv -o out", 2, "truth.csv lacks the column name", "Its first line is name,photo"),
    Wrong("registry list none", 2, "no folder none", "Name the folder that `camssf registry add`"),
    Wrong("registry list folder", 2, "folder is no registry", "Name the folder that `camssf registry add`"),
]
"""Files that are missing, or are no photo."""

CAPTURES = [
    Wrong("calibrate white.dng --lamp D55 -o out", 4, "white.dng: no chart", SEARCH, "out"),
    Wrong("calibrate dark.dng --lamp D55 -o out", 4, "dark.dng: no chart", SEARCH, "out"),
    Wrong("calibrate half.dng --lamp D55 -o out", 4, "half.dng: no chart", SEARCH, "out"),
    Wrong("calibrate small.dng --lamp D55 -o out", 4, "small.dng: no chart", SEARCH, "out"),
    Wrong("calibrate over.dng --lamp D55 -o out", 5, "Shot 1: up to 100.0%", "with less exposure", "out"),
    Wrong(
        "calibrate under.dng --lamp D55 -o out", 5, "Shot 1: in one channel the white patch", "Expose longer", "out"
    ),
    Wrong("calibrate chart.dng --lamp A -o out", 6, "another than A", "Look for tinted glass", "out"),
    Wrong("calibrate chart.dng -o out", 6, "spectrum was not given", "daylight, bulb", "out"),
    Wrong(
        "calibrate chart.dng --white dark.dng --dark white.dng --lamp D55 -o out",
        5,
        "swapped",
        "Give the bright frame",
        "out",
    ),
    Wrong(
        "calibrate chart.dng --white other.dng --lamp D55 -o out",
        5,
        "white frame other.dng differs",
        "with one camera",
        "out",
    ),
    Wrong(
        "calibrate chart.dng other.dng --lamp D55 --lamp D55 -o out",
        5,
        "different cameras",
        "one camera at a time",
        "out",
    ),
    Wrong(f"{SHOT} --corners '1179,158 1719,158 1719,515 1179,515'", 2, "outside the photo of 900 × 675", POINTS),
    Wrong(f"{SHOT} --corners '179,158 719,515 719,158 179,515'", 2, "convex quadrilateral", POINTS),
    Wrong(f"{SHOT} --corners '5,5 5,5 5,5 5,5'", 2, "convex quadrilateral", POINTS),
    Wrong(f"{SHOT} --corners '1,2 3,4'", 2, "'1,2 3,4' is not four points", "top left, top right"),
    Wrong(f"{SHOT} --corners '1,2 3,4 5,6 7,eight'", 2, "not four points", "top left, top right"),
    Wrong(f"{SHOT} --corners 'nan,2 30,4 50,60 7,80'", 2, "not finite", "Give four points"),
]
"""Photos that carry no answer. What is known of them is left in the report."""

TABLES = [
    Wrong("calibrate chart.dng --lamp tungstn -o out", 2, "No lamp is called 'tungstn'", "Did you mean tungsten"),
    Wrong("calibrate chart.dng --lamp 5500 -o out", 2, "'5500' is ambiguous", "D:5500 for daylight"),
    Wrong("calibrate chart.dng --lamp 28560K -o out", 2, "28560 K is not possible", "1000K to 20000K"),
    Wrong("calibrate chart.dng --lamp D:90 -o out", 2, "not defined at 90 K", "Give D:4000"),
    Wrong(
        "calibrate chart.dng --lamp um.csv -o out", 2, "wavelengths in um.csv are not in nm", "Write 550 for green"
    ),
    Wrong("calibrate chart.dng --lamp mixed.csv -o out", 2, "wavelengths in mixed.csv do not increase", "Sort them"),
    Wrong("calibrate chart.dng --lamp minus.csv -o out", 6, "lamp in minus.csv has no power", "Measure it again"),
    Wrong("calibrate chart.dng --lamp hole.csv -o out", 6, "lamp in hole.csv has a power that is not", "Measure it"),
    Wrong("calibrate chart.dng --lamp short.csv -o out", 6, "short.csv covers only 455 to 595", "cover 400 to 700"),
    Wrong("calibrate chart.dng --lamp photos.zip -o out", 2, "photos.zip is an archive", "Save the table"),
    Wrong("calibrate chart.dng --lamp counts.csv -o out", 2, "counts.csv, line 8: '1,045'", "thousands separators"),
    Wrong("calibrate chart.dng --lamp inks.csv -o out", 2, "inks.csv is not a table of one spectrum", "Write a line"),
    Wrong(f"{SHOT} --chart none.csv", 2, "no file none.csv", "Check the path."),
    Wrong(f"{SHOT} --chart classic42", 2, "No chart is called 'classic42'", "Did you mean classic24"),
    Wrong(f"{SHOT} --chart lamp.csv", 2, "lamp.csv is not a table of reflectances", "a line for each patch"),
    Wrong(f"{SHOT} --chart inks23.csv", 2, "inks23.csv holds 23 patches", "one spectrum for each patch"),
    Wrong(
        f"{SHOT} --chart card.json",
        2,
        "card.json holds a layout, my card, and no reflectances",
        "as in card.json:mine",
    ),
    Wrong(
        f"{SHOT} --chart card.json:inks.csv", 2, "inks.csv holds 24 patches, my card has 35", "one spectrum for each"
    ),
    Wrong(f"{SHOT} --chart card.json:none.csv", 2, "no file none.csv", "Check the path."),
    Wrong(f"{SHOT} --chart gone.json:inks.csv", 2, "no file gone.json", "Check the path."),
    Wrong(
        f"{SHOT} --chart wide.json:inks.csv", 2, "wide.json: the gaps are too wide", "docs/tables.md shows a layout."
    ),
    Wrong(f"{SHOT} --chart cut.json:inks.csv", 2, "cut.json is not JSON", "A layout is a JSON object."),
    Wrong(f"{SHOT} --truth lamp.csv", 2, "lamp.csv is not a table of a camera's curves", "Its first line must read"),
    Wrong(f"{SHOT} --truth nobody", 2, "No measured camera is called 'nobody'", "`camssf cameras` lists"),
]
"""Lamps, charts and curves."""

OPTIONS = [
    Wrong("calibrate", 2, "Missing argument", "--help"),
    Wrong("calibrat chart.dng", 2, "No such command 'calibrat'", "Did you mean 'calibrate'"),
    Wrong("chart.dng", 2, "No such command 'chart.dng'", "--help"),
    Wrong("calibrate chart.dng --output out", 2, "No such option: --output", "--out"),
    Wrong(f"{SHOT} --lamp A", 2, "1 photo(s) (chart.dng) but 2 lamp(s) (D55, A)", "Give one --lamp a photo"),
    Wrong(f"{SHOT} --chart nano24 --chart mini24", 2, "--chart was given 2 times", "Give it once."),
    Wrong(f"{SHOT} --out other", 2, "--out was given 2 times", "Give it once."),
    Wrong("registry list none --model A --model B", 2, "--model was given 2 times", "Give it once."),
    Wrong(f"{SHOT} --basis phone", 2, "'phone' is neither a basis", "Name one of these"),
    Wrong(f"{SHOT} --engine torch", 2, "no engine 'torch'", "onnx, reference"),
    Wrong(f"{SHOT} --lens-shading yes", 2, "Lens shading 'yes'", "as-stored or apply"),
    Wrong(f"{SHOT} --gamma much", 2, "--gamma", "--help"),
    Wrong(f"{SHOT} --gamma=-1", 2, "gamma", "Leave them out"),
    Wrong(f"{SHOT} --gamma nan", 2, "`gamma` holds NaN", "Give finite numbers"),
    Wrong(f"{SHOT} --white white.dng --white-reflectance 95", 2, "got 95", "Write 95 % as 0.95."),
    Wrong(f"{SHOT} --white white.dng --white-reflectance nan", 2, "got nan", "Write 95 % as 0.95."),
    Wrong(f"{SHOT} --white white.dng --white-reflectance 95%", 2, "'95%' is not a number", "0.95"),
    Wrong(f"{SHOT} --white-reflectance 0.9", 2, "but no white frame", "Give the white frame"),
    Wrong(f"{SHOT} --lamp-tolerance 2", 2, "'2' is not a lamp tolerance", "Write 2%, 300K"),
    Wrong(f"{SHOT} --chart-tolerance 3", 2, "tolerance is 3", "Write 1 % as 1%"),
    Wrong(f"{SHOT} --light-per-patch 8", 2, "got 8.0", "Write 8 % as 0.08."),
    Wrong(f"{SHOT} --fit 0-24", 2, "numbered 1 to 24", "Give some of these numbers"),
    Wrong(f"{SHOT} --fit 7-", 2, "'7-' is not a list of patches", "Write 7-18"),
    Wrong(f"{SHOT} --fit seven", 2, "'seven' is not a list of patches", "Write 7-18"),
    Wrong(f"{SHOT} --fit 1-9999999999", 2, "not a list of patches", "Write 7-18"),
    Wrong(f"{SHOT} --fit {'9' * 5000}", 2, "not a list of patches", "Write 7-18"),
    Wrong(f"{SHOT} --fit 1-8,9-7", 2, "not a list of patches", "Write 7-18"),
    Wrong("simulate -o out", 2, "A simulation needs a lamp", "Name one"),
    Wrong("simulate --lamp D55 --size big -o out", 2, "'big' is not a size", "4000x3000"),
    Wrong(f"simulate --lamp D55 --size {'9' * 5000}x9 -o out", 2, "not a size", "4000x3000"),
    Wrong("simulate --lamp D55 --size 30000x30000 -o out", 2, "megapixels", ""),
    Wrong("simulate --camera iPhone99 --lamp D55 -o out", 2, "'iPhone99'", "`camssf cameras` lists"),
    Wrong("simulate --lamp auto -o out", 2, "A light that is not named has no spectrum", "Lamps:"),
    Wrong("batch manifest.csv --workers 0", 2, "--workers '0'", "Give 1 or more"),
    Wrong("app --port 99999", 2, "--port", "65535"),
    Wrong("explain overexposure", 2, "no error code 'overexposure'", "overexposed"),
]
"""Names, numbers and units."""

OUTPUTS = [
    Wrong("calibrate chart.dng --lamp D55 -o chart.dng", 2, "chart.dng is a file", "Name a folder."),
    Wrong("calibrate chart.dng --lamp D55 -o own", 2, "own/report.html belongs to no sound result", "Move it away"),
    Wrong("report result.json -o own", 2, "own/report.html belongs to no sound result", "Move it away"),
    Wrong(f"calibrate chart.dng --lamp D55 -o {'a' * 300}", 2, "File name too long", "Choose a place"),
    Wrong("export result.json --to rawtoace -o x.json", 2, "no export to 'rawtoace'", "Take one of rawtoaces"),
    Wrong("export result.json", 2, "No output file", "Add -o FILE."),
    Wrong("export result.json -o result.json", 2, "result.json belongs to the result", "Name another file."),
    Wrong("export result.json -o chart.dng", 2, "chart.dng is a photo", "Name another file."),
    Wrong("export result.json -o folder", 2, "folder cannot be written (it is a folder)", "Name a file"),
    Wrong("export result.json -o pipe", 2, "pipe cannot be written (it is a device or a pipe)", "Name a file"),
    Wrong("export result.json -o none/x.csv", 2, "none/x.csv cannot be written", "Make its folder first"),
    Wrong(f"spectrum result.json chart.dng {AREA} -o chart.dng", 2, "chart.dng is an input", "Name another file."),
]
"""Where results go."""

RESULTS = [
    Wrong("export newer.json -o x.csv", 2, "is camssf/3, not camssf/2; another version", "`camssf calibrate`"),
    Wrong("report newer.json -o out", 2, "is camssf/3, not camssf/2; another version", "`camssf calibrate`"),
    Wrong("report older.json -o out", 2, "never released, so measure", "`camssf calibrate`"),
    Wrong("solve changed.json", 2, "changed.json: sha256 is not the hash of the rest", "as it was written"),
    Wrong("export curveless.json -o x.csv", 2, "answer is missing, but the verdict", "`camssf calibrate`"),
    Wrong("export cut.json -o x.csv", 2, "cut.json is not valid JSON", "Give the result.json"),
    Wrong("export truth.csv -o x.csv", 2, "truth.csv is not valid JSON", "Give the result.json"),
    Wrong("export passport.jws -o x.csv", 2, "passport.jws is a passport", "`camssf passport verify`"),
    Wrong("passport show result.json", 10, "holds no passport", "Give the passport"),
    Wrong("passport sign result.json --key truth.csv -o x.jws", 2, "truth.csv is not a private key", "passport key"),
    Wrong(f"colour result.json other.dng {AREA}", 5, "other.dng was taken by", "Calibrate that camera"),
    Wrong("colour result.json chart.dng --region 190,170,40,40", 2, "a white or grey surface", "--white-region"),
    Wrong(f"spectrum result.json chart.dng {AREA} -o x.bmp", 2, "x.bmp", "ends in .csv or .svg"),
    Wrong(f"colour result.json chart.dng {AREA} --observer 1932", 2, "'1932'", "Take 1931 or 1964."),
    Wrong(
        "colour result.json chart.dng --region 5000,450,40,40 --white-region 190,450,40,40",
        2, "Region 1 (5000,450,40,40) leaves the photo, which is 900 × 675", "Pixels are counted",
    ),
    Wrong(f"spectrum result.json chart.dng {AREA} --prior nails", 2, "'nails'", "general or skin"),
    Wrong("calibrate other.dng --previous curveless.json", 2, "curveless.json: answer", "Give the result.json"),
    Wrong("calibrate other.dng --previous other.dng", 2, "other.dng is a photo", "Measure it first"),
    Wrong("calibrate other.dng --previous cut.json", 2, "cut.json", "Give the result.json"),
    Wrong("calibrate other.dng --previous result.json", 5, "of another camera than", "Give the result of this unit"),
    Wrong("calibrate chart.dng --previous result.json", 2, "is already in the previous result", "Take a new photo."),
    Wrong("parity result.json other.dng", 2, "used the white frame white.dng", "Give just that"),
]  # fmt: skip
"""Results that are damaged, foreign, or of another camera."""

ROWS = [*INPUTS, *CAPTURES, *TABLES, *OPTIONS, *OUTPUTS, *RESULTS]


def spectra(path: Path, nm: Floats, columns: Floats) -> None:
    """Write a CSV table: wavelengths, and a column for each spectrum."""
    np.savetxt(path, np.column_stack([nm, columns]), delimiter=",", fmt="%.6g")


def changed(path: Path, source: Path, change: Callable[[Floats], Floats]) -> None:
    """Write a copy of a DNG with other samples."""
    shutil.copy(source, path)
    with tifffile.TiffFile(source) as file:
        page = file.pages[0]
        samples, start = change(page.asarray().astype(float)), page.dataoffsets[0]
    with path.open("r+b") as stream:
        stream.seek(start)
        stream.write(np.clip(samples, 0, 65535).astype("<u2").tobytes())


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stranger's folder: sound photos and tables, and those with which something is wrong."""
    folder = tmp_path_factory.mktemp("home")
    made = photos().shots[0]
    for role in ("chart", "white", "dark"):
        shutil.copy(getattr(made, role), folder / f"{role}.dng")
    shutil.copy(made.chart, folder / "twin.dng")
    shutil.copy(photos(camera="Demo phone").shots[0].chart, folder / "other.dng")
    shutil.copy(photos(fill=0.08).shots[0].chart, folder / "small.dng")
    shutil.copy(photos().truth, folder / "truth.csv")
    chart = folder / "chart.dng"
    data = chart.read_bytes()
    for name, content in {
        "cut.dng": data[: len(data) // 2], "head.dng": data[:8], "empty.dng": b"", "note.dng": b"hello",
        "photo.heic": b"\0\0\0\x18ftypheic" + bytes(500), "video.mp4": b"\0\0\0\x18ftypmp42" + bytes(500),
        "passport.jws": b"eyJh.eyJi.c2ln", "manifest.csv": b"name,photo,lamp\na,chart.dng,D55\n",
    }.items():  # fmt: skip
        (folder / name).write_bytes(content)
    with zipfile.ZipFile(folder / "photos.zip", "w") as archive:
        archive.write(folder / "truth.csv", "truth.csv")
    grey = Image.fromarray(np.full((90, 120, 3), 128, np.uint8))
    grey.save(folder / "photo.jpg")
    grey.save(folder / "photo.png")
    shutil.copy(folder / "photo.png", folder / "png.dng")
    shutil.copy(chart, folder / "linear.dng")
    with tifffile.TiffFile(folder / "linear.dng", mode="r+") as file:
        file.pages[0].tags["PhotometricInterpretation"].overwrite(34892)
    changed(folder / "half.dng", chart, lambda a: np.hstack([a[:, 440:], np.tile(a[:, :2], 220)]))
    changed(folder / "over.dng", chart, lambda a: np.minimum(4 * a, 16383))
    changed(folder / "under.dng", chart, lambda a: 512 + (a - 512) // 200)
    nm = np.arange(380.0, 731.0, 5.0)
    lamp = np.interp(nm, WAVELENGTHS, read_lamp("D55").values)
    for name, x, power in (
        ("lamp", nm, lamp), ("um", nm / 1000, lamp), ("mixed", np.roll(nm, 9), np.roll(lamp, 9)),
        ("minus", nm, -lamp), ("hole", nm, np.where(nm == 500, np.nan, lamp)), ("short", nm[15:44], lamp[15:44]),
    ):  # fmt: skip
        spectra(folder / f"{name}.csv", x, power)
    (folder / "counts.csv").write_text("".join(f'{w:g},"{100 + 27 * (w - 380):,.0f}"\n' for w in nm), "utf-8")
    inks = np.array([np.interp(nm, WAVELENGTHS, value) for value in read_chart("classic24").values]).T
    spectra(folder / "inks.csv", nm, inks)
    spectra(folder / "inks23.csv", nm, inks[:, 1:])
    card = {"format": "camssf-layout/1", "name": "my card", "columns": 7, "rows": 5, "patch": 18, "gap": 3}
    (folder / "card.json").write_text(json.dumps(card), "utf-8")
    (folder / "wide.json").write_text(json.dumps(card | {"gap": 30}), "utf-8")
    data = document_bytes(calibrated())
    result = json.loads(data)
    (folder / "result.json").write_bytes(data)
    (folder / "cut.json").write_bytes(data[:5000])
    (folder / "newer.json").write_text(json.dumps(result | {"format": "camssf/3"}), "utf-8")
    (folder / "older.json").write_text(json.dumps(result | {"format": "camssf-result/1"}), "utf-8")
    (folder / "changed.json").write_bytes(data.replace(b'"iso": 100.0', b'"iso": 200.0'))
    del result["answer"], result["sha256"]
    (folder / "curveless.json").write_text(json.dumps(result), "utf-8")
    (folder / "folder").mkdir()
    (folder / "own").mkdir()
    (folder / "own" / "report.html").write_text("mine", "utf-8")
    if hasattr(os, "mkfifo"):
        os.mkfifo(folder / "pipe")
    return folder


def state(folder: Path) -> dict[str, tuple[int, int]]:
    """Size and time of each file and folder, by its path."""
    return {
        str(path.relative_to(folder)): (0, 0) if path.is_dir() else (path.stat().st_size, path.stat().st_mtime_ns)
        for path in folder.rglob("*")
    }


@pytest.mark.requirement("R-REFUSAL")
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.call[:90])
def test_a_wrong_use(
    row: Wrong, home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(home)
    before = state(home)
    status = cli.main(shlex.split(row.call))
    err = capsys.readouterr().err
    left = {name for name in state(home) if name not in before}
    expected = {row.left, *(f"{row.left}/{name}" for name in ("result.json", "report.html"))} if row.left else set()
    page = (home / row.left / "report.html").read_text("utf-8") if row.left else ""
    for name in sorted(left, reverse=True):
        (home / name).rmdir() if (home / name).is_dir() else (home / name).unlink()
    assert status == row.status, err
    assert left == expected
    assert state(home) == before
    assert row.object in err
    assert row.step in err
    assert not re.search("Traceback|bug:|Errno|numpy|None", err)
    assert "data:image" in page or not row.left  # the report of a refusal shows what is known: the photo


@pytest.mark.repository
def test_no_advice_of_the_library_names_an_option() -> None:
    """The page in the browser and callers of Python have none: only texts of the terminal's commands name them."""
    reference = Path(cli.__file__).parents[2]
    terminal = {"cli", "cli.py", "camssf_fleet", "learning", "server.py"}
    ours = [path for path in reference.rglob("*.py") if not terminal & set(path.relative_to(reference).parts)]
    assert len(ours) > 100
    for path in ours:
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call | ast.Dict):
                for text in ast.walk(node):
                    if isinstance(text, ast.Constant) and isinstance(text.value, str):
                        words = re.sub("`.*?`", "", text.value)  # a command as a whole may be named
                        assert not re.search(r"(^|\s|\()--[a-z]", words), f"{path.name}: {text.value}"
    page = reference / "camssf_app" / "data"
    data = [reference / "camssf" / "data" / name for name in ("errors.json", "messages.json", "lamp-names.json")]
    for path in (*data, page / "app.js", page / "index.html"):
        assert not re.search(r"--[a-z]", path.read_text("utf-8")), path.name


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="no bash there")
def test_a_full_disk_and_a_read_only_folder(home: Path, tmp_path: Path) -> None:
    """In processes of their own: a folder that nobody may write to, and a file that may not grow."""
    (tmp_path / "locked").mkdir()
    (tmp_path / "locked").chmod(0o555)
    calls = {"ulimit -f 3; {} -o full": "File too large"}
    if os.geteuid() != 0:  # root may write everywhere
        calls["{} -o locked"] = "Permission denied"
    for script, words in calls.items():
        command = f"{sys.executable} -m camssf calibrate {home / 'chart.dng'} --lamp D55"
        done = subprocess.run(
            ["bash", "-c", script.format(command)], cwd=tmp_path, capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 2, done.stderr
        assert words in done.stderr
        assert "nothing was left behind" in done.stderr
        assert [path.name for path in tmp_path.rglob("*")] == ["locked"]
